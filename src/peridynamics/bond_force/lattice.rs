//! The pass over a lattice: families are one stencil, and all that a bond needs of its own is its bit.

use super::{
    BondKinematics, BondPass,
    lattice_simd::{Broken, CARE, FOREIGN, FULL, IDLE, job},
    simd::LANES,
    softened_bonds::SoftenedBonds,
    stencil::{NONE, Stencil},
};
use crate::{
    parallel,
    system::{BondChanges, ExactSum, FailureUpdate, Interval, Segments},
};

/// Groups of eight points per task; a constant, so that no result depends on the number of threads.
pub(super) const TASK: usize = 64;
/// Cells or points per task of copying.
pub(super) const COPY: usize = 4096;

/// Coefficients of the state-based law.
pub(super) struct Solid {
    /// `D/m` and `(D k − (D+2) μ)/m`, eight per group.
    pub(super) dilatation: Vec<[f64; LANES]>,
    pub(super) volumetric: Vec<[f64; LANES]>,
    /// `D (D+2) μ/m` and `(D k − (D+2) μ) θ/m` by cell.
    pub(super) deviatoric: Vec<f64>,
    pub(super) pull: Vec<f64>,
    /// Group of each eight cells.
    pub(super) group_of: Vec<u32>,
}

/// Share of a process in a lattice whose points are moved by several, each its own.
pub(super) struct OwnReach {
    /// Own points, in chunks of [`COPY`].
    pub(super) own: Segments,
    /// Cells whose displacements are known, in the same chunks.
    pub(super) cells: Segments,
    /// Lanes of each group whose bonds break here, since all that they see is known.
    pub(super) seen: Vec<u8>,
    /// Own points whose forces others wait for.
    pub(super) sent: Vec<u32>,
}

/// A bond pass over a lattice: one bit per directed bond, the rest per point.
pub(super) struct Lattice<const D: usize> {
    pub(super) stencil: Stencil<D>,
    /// Volume of most points.
    pub(super) unit: f64,
    /// Volumes by cell in parts of `unit`.
    pub(super) volume: Vec<f64>,
    /// Points whose bonds never fail, by cell; empty for none.
    pub(super) no_fail: Vec<bool>,
    pub(super) flags: Vec<u8>,
    /// Volume of each point whose force is computed, 0 for the others; empty if all are computed and alike.
    pub(super) scale: Vec<f64>,
    /// Group times eight plus lane of each point, [`NONE`] for those without a family.
    pub(super) place: Vec<u32>,
    pub(super) kinematics: BondKinematics,
    pub(super) limit: f64,
    pub(super) solid: Option<Solid>,
    pub(super) u: [Vec<f64>; D],
    pub(super) sums: Vec<[f64; LANES]>,
    pub(super) reference: u64,
    /// Bonds that the last pass broke; empty if they soften.
    pub(super) broken: Vec<Broken>,
    /// Bonds past the onset of softening, which have no bit; none if bonds break at once.
    pub(super) softened: Option<SoftenedBonds>,
    /// Lanes of each group that are not left to others; empty if all are.
    pub(super) own: Vec<u8>,
    /// Points that are own or known where each process moves its own points.
    pub(super) reach: Option<OwnReach>,
    /// True if the last force at own points broke bonds of points whose breaks are found here.
    pub(super) has_seen_breaks: bool,
}

impl<const D: usize> Lattice<D> {
    /// Sets the flag of groups whose bits are all set.
    pub(super) fn mark_full(&mut self) {
        let stencil = self.stencil.offsets.len().max(1);
        let bits = self.stencil.intact.chunks_exact(stencil);
        for (flag, bits) in self.flags.iter_mut().zip(bits) {
            *flag &= !FULL;
            if bits.iter().all(|&b| b == u8::MAX) {
                *flag |= FULL;
            }
        }
    }

    fn energy<const EXACT: bool>(&self, u: &[f64]) -> f64 {
        let mut field_u = std::array::from_fn(|_| vec![0.0; self.stencil.point_of.len()]);
        Self::spread(&self.stencil.point_of, None, u, &mut field_u);
        let mut flags: Vec<u8> = self.flags.iter().map(|f| f & !(IDLE | FOREIGN)).collect();
        let mut sums = vec![[0.0; LANES]; self.stencil.groups.len() * 2];
        let field = self.field(&field_u, &[], f64::INFINITY);
        self.sweep::<EXACT, { job::MOMENTS }>(&field, IDLE, &mut flags, &mut sums);
        if let Some(softened) = &self.softened {
            self.add_softened_moments::<EXACT>(softened, &field_u, &mut sums);
        }
        let mut energy = 0.0;
        for (p, &place) in self.place.iter().enumerate() {
            let volume = self.scale.get(p).copied().unwrap_or(self.unit);
            if place == NONE || volume == 0.0 {
                continue;
            }
            let (g, lane) = (place as usize / LANES, place as usize % LANES);
            let (first, second) = (sums[2 * g][lane], sums[2 * g + 1][lane]);
            energy += volume
                * match &self.solid {
                    // half of ½ (2 p r²) e² V_i V_j
                    None => 0.25 * second,
                    Some(s) => {
                        let d = s.dilatation[g][lane];
                        let theta = d * first;
                        let bulk = if d == 0.0 {
                            0.0
                        } else {
                            s.volumetric[g][lane] / d
                        };
                        let cell = self.stencil.groups[g] as usize + lane;
                        0.5 * (bulk * theta * theta + s.deviatoric[cell] * second)
                    }
                };
        }
        energy
    }

    /// The cell of a point in a group.
    fn cell(&self, p: usize) -> Option<usize> {
        let place = self.place[p];
        (place != NONE).then(|| {
            let place = place as usize;
            self.stencil.groups[place / LANES] as usize + place % LANES
        })
    }

    /// Calls `f(offset, neighbour's cell)` for the standing bonds of lane `lane` of group `g`.
    #[inline(always)]
    pub(super) fn each(&self, bits: &[u8], g: usize, lane: usize, mut f: impl FnMut(usize, usize)) {
        let stencil = self.stencil.offsets.len();
        let cell = self.stencil.groups[g] as usize + lane;
        for (o, bits) in bits[g * stencil..(g + 1) * stencil].iter().enumerate() {
            if bits >> lane & 1 == 1 {
                f(o, (cell as isize + self.stencil.offsets[o].delta) as usize);
            }
        }
    }
}

pub(super) fn ones(bits: &[u8]) -> u64 {
    let of_chunk = |_, c: &[u8]| c.iter().map(|b| u64::from(b.count_ones())).sum::<u64>();
    let counts = parallel::map_chunks(bits, COPY, of_chunk);
    counts.iter().sum()
}

impl<const D: usize> BondPass<D> for Lattice<D> {
    fn points(&self) -> usize {
        self.place.len()
    }

    fn name(&self) -> &'static str {
        "lattice"
    }

    fn bonds(&self) -> u64 {
        self.reference
    }

    fn force_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        _interval: Interval,
        breakage: FailureUpdate,
    ) -> BondChanges {
        match self.kinematics {
            BondKinematics::Exact => self.pass::<true>(u, force, breakage, None),
            BondKinematics::Linear => self.pass::<false>(u, force, breakage, None),
        }
    }

    fn tangent_into(&self, x: &[f64], y: &mut [f64]) {
        let mut field_x = std::array::from_fn(|_| vec![0.0; self.stencil.point_of.len()]);
        Self::spread(&self.stencil.point_of, None, x, &mut field_x);
        // linear bonds need no care
        let mut flags: Vec<u8> = self.flags.iter().map(|f| f & !CARE).collect();
        let mut sums = vec![[0.0; LANES]; self.sums.len()];
        match &self.solid {
            None => {
                let field = self.field(&field_x, &[], f64::INFINITY);
                self.sweep::<false, { job::PAIR }>(&field, FOREIGN, &mut flags, &mut sums);
                if let Some(softened) = &self.softened {
                    self.add_softened_forces::<false>(softened, (&field_x, &[]), &mut sums);
                }
            }
            Some(solid) => {
                let field = self.field(&field_x, &[], f64::INFINITY);
                self.sweep::<false, { job::MOMENTS }>(&field, IDLE, &mut flags, &mut sums);
                if let Some(softened) = &self.softened {
                    self.add_softened_moments::<false>(softened, &field_x, &mut sums);
                }
                let mut pull = vec![0.0; self.stencil.point_of.len()];
                self.pull_from(solid, &flags, &sums, &mut pull);
                let field = self.field(&field_x, &pull, f64::INFINITY);
                self.sweep::<false, { job::SOLID }>(&field, FOREIGN, &mut flags, &mut sums);
                if let Some(softened) = &self.softened {
                    self.add_softened_forces::<false>(softened, (&field_x, &pull), &mut sums);
                }
            }
        }
        self.collect(&sums, y);
    }

    fn row_sums(&self) -> Vec<f64> {
        // softened bonds with all of their stiffness, which they have under compression
        let bits = &*self.standing();
        let offsets = &self.stencil.offsets;
        // by cell: Σ_l |∂θ/∂u_l|
        let mut dilatations = vec![
            0.0;
            if self.solid.is_some() {
                self.u[0].len()
            } else {
                0
            }
        ];
        if let Some(solid) = &self.solid {
            parallel::for_each_chunk(&mut dilatations, LANES, 1, |group, to| {
                let g = solid.group_of[group];
                if g == NONE {
                    return;
                }
                for lane in 0..LANES {
                    let (mut own, mut others) = ([0.0; D], 0.0);
                    self.each(bits, g as usize, lane, |o, there| {
                        let w = offsets[o].weight * self.volume[there];
                        for (own, x) in own.iter_mut().zip(offsets[o].xi) {
                            *own += w * x;
                            others += (w * x).abs();
                        }
                    });
                    to[lane] = (others + own.iter().map(|x| x.abs()).sum::<f64>())
                        * solid.dilatation[g as usize][lane];
                }
            });
        }
        let mut result = vec![0.0; self.points() * D];
        parallel::for_each_chunk(&mut result, D, TASK, |p, row| {
            let volume = self.scale.get(p).copied().unwrap_or(self.unit);
            if self.place[p] == NONE || volume == 0.0 {
                return;
            }
            let (g, lane) = (
                self.place[p] as usize / LANES,
                self.place[p] as usize % LANES,
            );
            let here = self.stencil.groups[g] as usize + lane;
            let (mut own, mut first) = ([[0.0; D]; D], [0.0; D]);
            self.each(bits, g, lane, |o, there| {
                let o = &offsets[o];
                let w = o.weight * self.volume[there] * volume;
                let mut stiffness = w / o.square;
                if let Some(s) = &self.solid {
                    stiffness *= s.deviatoric[here] + s.deviatoric[there];
                }
                for a in 0..D {
                    for b in 0..D {
                        let k = stiffness * o.xi[a] * o.xi[b];
                        own[a][b] += k;
                        row[a] += k.abs();
                    }
                    if let Some(s) = &self.solid {
                        first[a] += w * o.xi[a];
                        let g = s.group_of[there / LANES];
                        if g != NONE {
                            let modulus = s.volumetric[g as usize][there % LANES];
                            row[a] += (w * o.xi[a] * modulus).abs() * dilatations[there];
                        }
                    }
                }
            });
            for a in 0..D {
                row[a] += own[a].iter().map(|k| k.abs()).sum::<f64>();
                if let Some(s) = &self.solid {
                    row[a] += (first[a] * s.volumetric[g][lane]).abs() * dilatations[here];
                }
            }
        });
        result
    }

    fn stored_energy(&self, u: &[f64]) -> f64 {
        match self.kinematics {
            BondKinematics::Exact => self.energy::<true>(u),
            BondKinematics::Linear => self.energy::<false>(u),
        }
    }

    fn damage_into(&self, damage: &mut [f64]) {
        parallel::for_each_mut(damage, TASK, |p, damage| {
            *damage = 0.0;
            // most points are whole, which their group's words say at once
            if !self.is_damaged(p) {
                return;
            }
            let (g, lane) = (
                self.place[p] as usize / LANES,
                self.place[p] as usize % LANES,
            );
            let (mut all, mut left) = (0.0, 0.0);
            self.each(&self.stencil.reference, g, lane, |_, there| {
                all += self.volume[there]
            });
            let here = (self.stencil.groups[g] as usize + lane) as isize;
            self.each_left(g, lane, |o, part| {
                let there = here + self.stencil.offsets[o].delta;
                left += part * self.volume[there as usize];
            });
            if left != all {
                *damage = 1.0 - left / all;
            }
        });
    }

    fn is_damaged(&self, i: usize) -> bool {
        let place = self.place[i];
        if place == NONE {
            return false;
        }
        let (group, lane) = (place as usize / LANES, place as usize % LANES);
        let count = self.stencil.offsets.len();
        let of_group = group * count..(group + 1) * count;
        let now = &self.stencil.intact[of_group.clone()];
        let then = &self.stencil.reference[of_group];
        now != then && now.iter().zip(then).any(|(a, b)| (a ^ b) >> lane & 1 == 1)
    }

    fn broken(&self) -> u64 {
        let softened = self.softened.iter().flat_map(SoftenedBonds::bonds).count();
        self.reference - ones(&self.stencil.intact) - softened as u64
    }

    fn last_broken(&self) -> Vec<(u32, u32)> {
        if let Some(softened) = &self.softened {
            return softened.last_broken();
        }
        let point = |cell: usize| self.stencil.point_of[cell];
        let last = self.last().into_iter();
        last.map(|(g, lane, offset, _)| {
            let cell = self.stencil.groups[g] as usize + lane;
            let there = cell as isize + self.stencil.offsets[offset].delta;
            (point(cell), point(there as usize))
        })
        .collect()
    }

    fn drag_rate(&self, _mass: &dyn Fn(usize) -> f64) -> f64 {
        0.0
    }

    fn add_lost_energy(&self, at: &dyn Fn(usize) -> [f64; D], lost: &mut ExactSum) {
        match self.kinematics {
            BondKinematics::Exact => self.lost::<true>(at, lost),
            BondKinematics::Linear => self.lost::<false>(at, lost),
        }
    }

    fn left(&self, i: usize, j: usize) -> [f64; 2] {
        let Some(here) = self.cell(i) else {
            return [0.0; 2];
        };
        let offsets = &self.stencil.offsets;
        let slot = match self.cell(j) {
            // a flat distance is that of one step only: rows are padded by the reach of the stencil
            Some(there) => {
                let delta = there as isize - here as isize;
                offsets.iter().position(|o| o.delta == delta)
            }
            // a point without a family, in elements: it has a cell, but no place
            None => offsets.iter().position(|o| {
                let there = (here as isize + o.delta) as usize;
                self.stencil.point_of[there] == j as u32
            }),
        };
        let Some(slot) = slot else {
            return [0.0; 2];
        };
        let place = self.place[i] as usize;
        let intact = self.stencil.intact[place / LANES * offsets.len() + slot];
        if intact >> (place % LANES) & 1 == 1 {
            return [1.0; 2];
        }
        let softened = self.softened.as_ref();
        let found = softened.and_then(|softened| softened.find(i, slot as u64));
        found.map_or([0.0; 2], SoftenedBonds::left)
    }

    fn damage_state(&self) -> Vec<u64> {
        if self.limit == f64::INFINITY {
            return Vec::new();
        }
        let mut words = super::pack(&self.stencil.intact, self.reference);
        words.extend(self.softened.iter().flat_map(SoftenedBonds::state));
        words
    }

    fn restore_damage(&mut self, state: &[u64]) -> bool {
        if self.limit == f64::INFINITY {
            return state.is_empty();
        }
        let parts = SoftenedBonds::split(self.softened.as_ref(), state);
        let whole = parts
            .is_some_and(|(bits, _)| super::unpack(bits, self.reference, &mut self.stencil.intact));
        if let (Some(softened), Some((_, bonds)), true) = (&mut self.softened, parts, whole) {
            softened.restore(bonds);
        }
        self.mark_full();
        whole
    }

    fn commit(&mut self) -> f64 {
        0.0
    }

    fn remembers(&self) -> bool {
        false
    }

    fn own_points(&mut self) -> Option<&mut dyn super::OwnPoints> {
        // others would not know what has softened here
        match self.softened {
            Some(_) => None,
            None => Some(self),
        }
    }

    fn heated(&mut self) -> Option<&mut dyn super::HeatedBonds> {
        None
    }

    fn force_states(&self) -> Option<&dyn super::ForceStates<D>> {
        None
    }

    fn memory_bytes(&self) -> usize {
        let numbers = self.u.iter().map(Vec::len).sum::<usize>()
            + self.volume.len()
            + self.scale.len()
            + self.sums.len() * LANES;
        let s = &self.stencil;
        let solid = self.solid.as_ref().map_or(0, |s| {
            16 * LANES * s.dilatation.len() + 16 * s.pull.len() + 4 * s.group_of.len()
        });
        8 * numbers
            + solid
            + 4 * (s.point_of.len() + s.groups.len() + self.place.len())
            + s.reference.len()
            + s.intact.len()
            + self.no_fail.len()
            + self.flags.len()
            + (self.softened.as_ref()).map_or(0, SoftenedBonds::memory_bytes)
    }
}
