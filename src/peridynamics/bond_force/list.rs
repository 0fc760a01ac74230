//! The pass over neighbour lists.

use rayon::prelude::*;

use super::bond_list::{Limit, List, Solid};
use super::{
    BondForce, BondKinematics, BondPass, BondSetup, Storage,
    compressed_list::{Neighbours, Weights},
    lattice_simd::Bits,
    list_simd::{self, Sum},
    softened_bonds::SoftenedBonds,
    stretch::psi,
};
use crate::{
    parallel,
    system::{BondChanges, ExactSum, FailureUpdate, Interval},
};

/// Points per task; a constant, so that no result depends on the number of threads.
const BLOCK: usize = 256;

/// Stretch and direction of one bond.
pub(crate) struct Stretched<const D: usize> {
    /// `t r²` and `r²`: a bond beyond its limit is found without dividing.
    pub(crate) excess: f64,
    pub(crate) length: f64,
    /// `ξ + η`, or ξ of a linear bond.
    pub(crate) direction: [f64; D],
}

impl<const D: usize> Stretched<D> {
    #[inline(always)]
    pub(crate) fn t(&self) -> f64 {
        self.excess / self.length
    }
}

#[inline(always)]
pub(crate) fn stretched<const D: usize, const EXACT: bool>(
    xi: &[f64; D],
    here: &[f64; D],
    there: &[f64],
) -> Stretched<D> {
    let (mut cross, mut square, mut length) = (0.0, 0.0, 0.0);
    let mut direction = *xi;
    for a in 0..D {
        let eta = there[a] - here[a];
        cross += xi[a] * eta;
        length += xi[a] * xi[a];
        if EXACT {
            square += eta * eta;
            direction[a] += eta;
        }
    }
    Stretched {
        excess: 2.0 * cross + square,
        length,
        direction,
    }
}

/// Extension over length, `(|ξ+η| − r)/r`, linear: `ξ·η/r²`.
#[inline(always)]
pub(crate) fn extension<const EXACT: bool>(t: f64) -> f64 {
    if EXACT {
        t * (1.0 - (1.0 + t) * psi(t))
    } else {
        0.5 * t
    }
}

/// `r/|ξ+η|`, linear: 1.
#[inline(always)]
pub(crate) fn ratio<const EXACT: bool>(t: f64) -> f64 {
    if EXACT { 1.0 - t * psi(t) } else { 1.0 }
}

/// A number per bond, made block by block in place.
fn fill<T: Copy + Default + Send>(
    offsets: &[usize],
    f: impl Fn(usize, usize) -> T + Sync,
) -> Vec<T> {
    let points = offsets.len().saturating_sub(1);
    let mut numbers = vec![T::default(); offsets.last().copied().unwrap_or(0)];
    let mut blocks = Vec::new();
    let mut rest = numbers.as_mut_slice();
    for start in (0..points).step_by(BLOCK) {
        let end = (start + BLOCK).min(points);
        let (head, tail) = rest.split_at_mut(offsets[end] - offsets[start]);
        blocks.push((start..end, head));
        rest = tail;
    }
    parallel::for_each_task(blocks, 1, |_, (range, numbers)| {
        let first = offsets[range.start];
        for i in range {
            for bond in offsets[i]..offsets[i + 1] {
                numbers[bond - first] = f(i, bond - offsets[i]);
            }
        }
    });
    numbers
}

#[inline(always)]
pub(super) fn vector<const D: usize>(u: &[f64], i: usize) -> [f64; D] {
    std::array::from_fn(|a| u[i * D + a])
}

impl<const D: usize> List<D> {
    pub(super) fn new(setup: &BondSetup<'_, D>) -> Self {
        let points = setup.position.len();
        let families = setup.families;
        let per_bond =
            |f: &(dyn Fn(usize, usize) -> f64 + Sync)| -> Vec<f64> { fill(&families.offsets, f) };
        let xi = |i: usize, k: usize| setup.bond(i, families.of(i)[k] as usize);
        let weights = match setup.storage {
            Storage::Double => Weights::Double(per_bond(&|i, k| setup.weight(i, k, &xi(i, k)))),
            Storage::Single => Weights::Single(fill(&families.offsets, |i, k| {
                setup.weight(i, k, &xi(i, k)) as f32
            })),
        };
        let limit = match setup.failure.map(|f| f.critical) {
            // a criterion of a state takes the generic pass
            None | Some(super::BondCriterion::State(_)) => Limit::Never,
            Some(super::BondCriterion::Uniform(_)) => {
                Limit::Uniform(setup.limit(0, 0, &crate::tensor::Vector::zeros()))
            }
            Some(super::BondCriterion::PerBond(_)) => {
                Limit::PerBond(per_bond(&|i, k| setup.limit(i, k, &xi(i, k))))
            }
        };
        let solid = match setup.force {
            // any other law is passed over by its force states
            BondForce::Pairwise { .. } | BondForce::Law { .. } => None,
            BondForce::Solid { bulk, shear, .. } => {
                let d = D as f64;
                let inverse: Vec<f64> = (0..points)
                    .map(|i| {
                        let m = setup.weighted_volume(i);
                        if m == 0.0 { 0.0 } else { 1.0 / m }
                    })
                    .collect();
                Some(Solid {
                    dilatation: inverse.iter().map(|m| d * m).collect(),
                    volumetric: inverse
                        .iter()
                        .map(|m| (d * bulk - (d + 2.0) * shear) * m)
                        .collect(),
                    deviatoric: inverse.iter().map(|m| d * (d + 2.0) * shear * m).collect(),
                    theta: vec![0.0; points],
                })
            }
        };
        let mut bytes = vec![0];
        let mut intact = Vec::new();
        for i in 0..points {
            let family = families.of(i);
            let first = intact.len();
            intact.resize(first + family.len().div_ceil(8), 0u8);
            for (k, &j) in family.iter().enumerate() {
                if !setup.precracked.is_some_and(|cut| cut(i, j as usize)) {
                    intact[first + k / 8] |= 1 << (k % 8);
                }
            }
            bytes.push(intact.len());
        }
        Self {
            position: setup.position.iter().map(|x| (*x).into()).collect(),
            volume: setup.volume.to_vec(),
            row: (0..points).map(|i| setup.row(i)).collect(),
            no_fail: (0..points).map(|i| setup.no_fail(i)).collect(),
            offsets: families.offsets.clone(),
            neighbours: Neighbours::new(&families.offsets, &families.neighbours),
            weights,
            limit,
            kinematics: setup.kinematics,
            solid,
            bytes,
            intact,
            reference: families.neighbours.len() as u64,
            last: Vec::new(),
            softened: (setup.failure.and_then(|f| f.softening)).map(SoftenedBonds::new),
            parts: Vec::new(),
            has_seen_breaks: false,
        }
    }

    #[inline(always)]
    pub(super) fn xi(&self, i: usize, j: usize) -> [f64; D] {
        let (a, b) = (&self.position[i], &self.position[j]);
        std::array::from_fn(|k| b[k] - a[k])
    }

    #[inline(always)]
    pub(super) fn is_intact(&self, i: usize, k: usize) -> bool {
        self.intact[self.bytes[i] + k / 8] >> (k % 8) & 1 == 1
    }

    /// Sums over the intact bonds of every point, block by block; bits are cleared of bonds beyond their limit first, if they may break. Returns which did.
    fn add_up<const EXACT: bool>(
        &self,
        u: &[f64],
        sum: Sum<'_>,
        bits: Bits<'_>,
        sums: &mut [f64],
    ) -> Vec<(u32, usize)> {
        let width = sums.len() / self.points().max(1);
        let mut rest = bits;
        let mut blocks = Vec::new();
        for (k, sums) in sums.chunks_mut(BLOCK * width.max(1)).enumerate() {
            let start = k * BLOCK;
            let end = (start + BLOCK).min(self.points());
            let own;
            (own, rest) = match rest {
                Bits::Held(all) => (Bits::Held(all), Bits::Held(all)),
                Bits::Breaking(bits) => {
                    let (own, more) = bits.split_at_mut(self.bytes[end] - self.bytes[start]);
                    (Bits::Breaking(own), Bits::Breaking(more))
                }
            };
            blocks.push((start..end, own, sums));
        }
        parallel::list_each(blocks.into_par_iter(), |(points, bits, sums)| {
            list_simd::add_up::<D, EXACT>(self, points, u, sum, bits, sums)
        })
    }

    /// Calls `f(bond, j, stretched, left)` of the bonds of point `i`, with the parts of its stiffness that each has left, [`SoftenedBonds::left`].
    #[inline(always)]
    fn each<const EXACT: bool>(
        &self,
        i: usize,
        u: &[f64],
        mut f: impl FnMut(usize, usize, &Stretched<D>, [f64; 2]),
    ) {
        let here = vector(u, i);
        for bond in self.offsets[i]..self.offsets[i + 1] {
            if self.is_intact(i, bond - self.offsets[i]) {
                let j = self.neighbours.get(i, bond);
                let s = stretched::<D, EXACT>(&self.xi(i, j), &here, &u[j * D..][..D]);
                f(bond, j, &s, [1.0; 2]);
            }
        }
        let Some(softened) = &self.softened else {
            return;
        };
        for bond in softened.of(i) {
            let j = bond.far as usize;
            let s = stretched::<D, EXACT>(&self.xi(i, j), &here, &u[j * D..][..D]);
            f(bond.slot as usize, j, &s, SoftenedBonds::left(bond));
        }
    }

    fn dilatation<const EXACT: bool>(&self, solid: &Solid, i: usize, u: &[f64]) -> f64 {
        let mut sum = 0.0;
        self.each::<EXACT>(i, u, |bond, j, s, left| {
            let e = extension::<EXACT>(s.t());
            sum += left[1] * self.weights.get(bond) * s.length * self.volume[j] * e;
        });
        sum * solid.dilatation[i]
    }

    /// Dilatations and forces; hands bonds that it finds past the onset of softening over to `softened`, if they may change.
    fn sweep<const EXACT: bool>(
        &self,
        u: &[f64],
        theta: &mut [f64],
        bits: Bits<'_>,
        softened: Option<&mut SoftenedBonds>,
        force: &mut [f64],
    ) -> (Vec<(u32, usize)>, BondChanges) {
        let may_break = matches!(bits, Bits::Breaking(_));
        let mut changes = BondChanges::default();
        let follow = |softened: &mut SoftenedBonds, broken: &mut Vec<(u32, usize)>| {
            let handed = std::mem::take(broken);
            match may_break {
                true => self.soften::<EXACT>(softened, &handed, u),
                false => softened.hold(),
            }
        };
        let broken = match &self.solid {
            None => {
                let mut broken = self.add_up::<EXACT>(u, Sum::Pairwise, bits, force);
                if let Some(softened) = softened {
                    changes = follow(softened, &mut broken);
                    self.add_softened_forces::<EXACT>(softened, (u, &[]), force);
                }
                broken
            }
            Some(c) => {
                let extension =
                    |bits, theta: &mut [f64]| self.add_up::<EXACT>(u, Sum::Extension, bits, theta);
                let (mut broken, left) = match bits {
                    Bits::Held(all) => (extension(Bits::Held(all), theta), all),
                    Bits::Breaking(all) => (extension(Bits::Breaking(all), theta), &*all),
                };
                let mut held = None;
                if let Some(softened) = softened {
                    changes = follow(softened, &mut broken);
                    self.add_softened_extensions::<EXACT>(softened, u, theta);
                    held = Some(&*softened);
                }
                parallel::for_each_chunk(theta, BLOCK, 1, |block, theta| {
                    let factors = &c.dilatation[block * BLOCK..];
                    let both = theta.iter_mut().zip(factors);
                    both.for_each(|(theta, factor)| *theta *= factor);
                });
                self.add_up::<EXACT>(u, Sum::State(theta), Bits::Held(left), force);
                if let Some(softened) = held {
                    self.add_softened_forces::<EXACT>(softened, (u, theta), force);
                }
                broken
            }
        };
        parallel::for_each_chunk(force, BLOCK * D, 1, |block, force| {
            let volumes = &self.volume[block * BLOCK..];
            let both = force.chunks_exact_mut(D).zip(volumes);
            both.for_each(|(force, volume)| force.iter_mut().for_each(|f| *f *= -volume));
        });
        changes.broken += broken.len() as u64;
        (broken, changes)
    }

    fn pass<const EXACT: bool>(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        breakage: FailureUpdate,
    ) -> BondChanges {
        let may_break = breakage == FailureUpdate::Update && !matches!(self.limit, Limit::Never);
        let mut theta = self.solid.as_mut().map(|c| std::mem::take(&mut c.theta));
        let mut none = Vec::new();
        let theta_of = theta.as_mut().unwrap_or(&mut none);
        let mut intact = std::mem::take(&mut self.intact);
        let mut softened = self.softened.take();
        let bits = match may_break {
            true => Bits::Breaking(&mut intact),
            false => Bits::Held(&intact),
        };
        let changes;
        (self.last, changes) = self.sweep::<EXACT>(u, theta_of, bits, softened.as_mut(), force);
        self.intact = intact;
        self.softened = softened;
        if let (Some(c), Some(theta)) = (&mut self.solid, theta) {
            c.theta = theta;
        }
        changes
    }

    fn energy<const EXACT: bool>(&self, u: &[f64]) -> f64 {
        let energies: Vec<f64> = parallel::map(self.points(), BLOCK, |i| {
            if !self.row[i] {
                return 0.0;
            }
            let mut sum = 0.0;
            self.each::<EXACT>(i, u, |bond, j, s, left| {
                let e = extension::<EXACT>(s.t());
                sum += left[0] * self.weights.get(bond) * self.volume[j] * e * e * s.length;
            });
            // pairwise: 2 p r² e² r² / 4; state-based: B ω e² r² / 2
            self.volume[i]
                * match &self.solid {
                    None => 0.25 * sum,
                    Some(c) => {
                        let theta = self.dilatation::<EXACT>(c, i, u);
                        // (k − (D+2) μ/D) = A m/D
                        let a = if c.dilatation[i] == 0.0 {
                            0.0
                        } else {
                            c.volumetric[i] / c.dilatation[i]
                        };
                        0.5 * (a * theta * theta + c.deviatoric[i] * sum)
                    }
                }
        });
        energies.iter().sum()
    }
}

impl<const D: usize> BondPass<D> for List<D> {
    fn points(&self) -> usize {
        self.position.len()
    }

    fn name(&self) -> &'static str {
        "list"
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
            BondKinematics::Exact => self.pass::<true>(u, force, breakage),
            BondKinematics::Linear => self.pass::<false>(u, force, breakage),
        }
    }

    fn tangent_into(&self, x: &[f64], y: &mut [f64]) {
        let points = self.solid.as_ref().map_or(0, |_| self.points());
        let mut softened = self.softened.clone();
        let (theta, bits) = (&mut vec![0.0; points], Bits::Held(&self.intact));
        self.sweep::<false>(x, theta, bits, softened.as_mut(), y);
    }

    fn row_sums(&self) -> Vec<f64> {
        let points = self.points();
        // Σ_l |∂θ_i/∂u_l| in the maximum norm over components
        let sums: Vec<f64> = match &self.solid {
            None => Vec::new(),
            Some(c) => parallel::map(points, BLOCK, |i| {
                let (mut own, mut others) = ([0.0; D], 0.0);
                for bond in self.offsets[i]..self.offsets[i + 1] {
                    if self.stands(i, bond) {
                        let j = self.neighbours.get(i, bond);
                        let w = self.weights.get(bond) * self.volume[j];
                        for (own, x) in own.iter_mut().zip(self.xi(i, j)) {
                            *own += w * x;
                            others += (w * x).abs();
                        }
                    }
                }
                (others + own.iter().map(|x| x.abs()).sum::<f64>()) * c.dilatation[i]
            }),
        };
        let mut result = vec![0.0; points * D];
        parallel::for_each_chunk(&mut result, D, BLOCK, |i, row| {
            if !self.row[i] {
                return;
            }
            let mut own = [[0.0; D]; D];
            let mut first = [0.0; D];
            for bond in self.offsets[i]..self.offsets[i + 1] {
                if !self.stands(i, bond) {
                    continue;
                }
                let j = self.neighbours.get(i, bond);
                let xi = self.xi(i, j);
                let length: f64 = xi.iter().map(|x| x * x).sum();
                let w = self.weights.get(bond) * self.volume[i] * self.volume[j];
                let stiffness = match &self.solid {
                    None => w / length,
                    Some(c) => (c.deviatoric[i] + c.deviatoric[j]) * w / length,
                };
                for a in 0..D {
                    for b in 0..D {
                        let k = stiffness * xi[a] * xi[b];
                        own[a][b] += k;
                        row[a] += k.abs();
                    }
                    if let Some(c) = &self.solid {
                        first[a] += w * xi[a];
                        row[a] += (w * xi[a] * c.volumetric[j]).abs() * sums[j];
                    }
                }
            }
            for a in 0..D {
                row[a] += own[a].iter().map(|k| k.abs()).sum::<f64>();
                if let Some(c) = &self.solid {
                    row[a] += (first[a] * c.volumetric[i]).abs() * sums[i];
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
        parallel::for_each_mut(damage, 1024, |i, damage| {
            *damage = 0.0;
            // most points are whole
            if !self.is_damaged(i) {
                return;
            }
            let (mut all, mut lost) = (0.0, 0.0);
            for bond in self.offsets[i]..self.offsets[i + 1] {
                let v = self.volume[self.neighbours.get(i, bond)];
                all += v;
                lost += (1.0 - self.left_of(i, bond)[1]) * v;
            }
            *damage = lost / all;
        });
    }

    fn is_damaged(&self, i: usize) -> bool {
        (0..self.offsets[i + 1] - self.offsets[i]).any(|k| !self.is_intact(i, k))
    }

    fn broken(&self) -> u64 {
        let of_chunk = |_, c: &[u8]| c.iter().map(|b| u64::from(b.count_ones())).sum();
        let standing: Vec<u64> = parallel::map_chunks(&self.intact, 4096, of_chunk);
        let softened = self.softened.iter().flat_map(SoftenedBonds::bonds).count();
        self.reference - standing.iter().sum::<u64>() - softened as u64
    }

    fn last_broken(&self) -> Vec<(u32, u32)> {
        if let Some(softened) = &self.softened {
            return softened.last_broken();
        }
        let last = self.last.iter();
        last.map(|&(i, bond)| (i, self.neighbours.get(i as usize, bond) as u32))
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
        self.neighbours
            .place(i, self.offsets[i]..self.offsets[i + 1], j)
            .map_or([0.0; 2], |k| self.left_of(i, self.offsets[i] + k))
    }

    fn damage_state(&self) -> Vec<u64> {
        if matches!(self.limit, Limit::Never) {
            return Vec::new();
        }
        let mut words = super::pack(&self.intact, self.reference);
        words.extend(self.softened.iter().flat_map(SoftenedBonds::state));
        words
    }

    fn restore_damage(&mut self, state: &[u64]) -> bool {
        if matches!(self.limit, Limit::Never) {
            return state.is_empty();
        }
        let parts = SoftenedBonds::split(self.softened.as_ref(), state);
        let whole =
            parts.is_some_and(|(bits, _)| super::unpack(bits, self.reference, &mut self.intact));
        if let (Some(softened), Some((_, bonds)), true) = (&mut self.softened, parts, whole) {
            softened.restore(bonds);
        }
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
        let bytes = std::mem::size_of::<f64>();
        let solid = self.solid.as_ref().map_or(0, |s| 4 * s.theta.len() * bytes);
        let limit = match &self.limit {
            Limit::PerBond(t) => t.len() * bytes,
            _ => 0,
        };
        solid
            + self.weights.memory_bytes()
            + limit
            + self.position.len() * (D + 1) * bytes
            + self.row.len()
            + self.no_fail.len()
            + (self.offsets.len() + self.bytes.len()) * std::mem::size_of::<usize>()
            + self.neighbours.memory_bytes()
            + self.intact.len()
            + (self.softened.as_ref()).map_or(0, SoftenedBonds::memory_bytes)
    }
}
