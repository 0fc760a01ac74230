//! The pass that any law takes: the force state of every family, then the sum over the bonds of every point, [SAND2015-7998] eq. (2.6) and (2.5).
//!
//! Nothing is assumed of the law but what [`ForceState`] says, so this is the place where a law is computed as it is written. The lattice and list passes are its accelerators.

use std::sync::Arc;

use rayon::prelude::*;

use super::{
    BondKinematics, BondPass, BondSetup, ForceStates,
    bond_failure::BondFailure,
    bond_heat::Heat,
    carried_deformation::CarriedDeformation,
    list::{extension, ratio, stretched},
    point_loops::Sites,
    point_state::PointForces,
};
use crate::{
    parallel,
    peridynamics::{
        DeformedFamily, EnergyDensity, Families, ForceState, HistoryLayout, KeptDamage, Law, Past,
        PdBody, Present, StatePart, body::split_rows, failure::Flow,
    },
    system::{BondChanges, ExactSum, FailureUpdate, Interval},
    tensor::{Tensor, Vector},
};

/// No bond from the other end.
pub(super) const NONE: u32 = u32::MAX;

/// History variables of points and bonds; bonds in the order of the families.
#[derive(Clone, Default)]
pub(super) struct History {
    pub(super) point: Vec<f64>,
    pub(super) bonds: Vec<f64>,
}

/// Dissipation and plastic flow of a point in a step.
#[derive(Clone, Copy, Default)]
pub(super) struct Outcome {
    /// Energy dissipated \[J\].
    pub(super) dissipated: f64,
    pub(super) flow: Flow,
}

/// The pass over force states: some hundred bytes per directed bond.
pub(super) struct Generic<const D: usize> {
    pub(super) law: Arc<dyn Law<D>>,
    pub(super) layout: HistoryLayout,
    pub(super) position: Vec<Vector<D>>,
    pub(super) volume: Vec<f64>,
    pub(super) row: Vec<bool>,
    pub(super) no_fail: Vec<bool>,
    /// The material of each point; empty if all have one.
    pub(super) material: Vec<u16>,
    pub(super) families: Families,
    /// Of each bond, that of its other end, counted over all families; `NONE` if the far point has no family.
    pub(super) reverse: Vec<u32>,
    pub(super) pair: Vec<f64>,
    pub(super) omega: Vec<f64>,
    pub(super) state: Vec<Option<StatePart<D>>>,
    pub(super) failure: BondFailure,
    pub(super) carried: Option<CarriedDeformation<D>>,
    pub(super) kinematics: BondKinematics,
    pub(super) intact: Vec<bool>,
    /// Bonds that were reported as broken because their damage is 1 at both ends; they stay in their families. Empty for a law without damage.
    pub(super) damaged_through: Vec<bool>,
    /// Volume of the far points of each family, with what lies behind faces at which it ends; empty where no bond can be broken.
    pub(super) family_volume: Vec<f64>,
    /// Committed, and at the end of the last force.
    pub(super) past: History,
    pub(super) present: History,
    /// Outcome of each point in the last force.
    pub(super) outcome: Vec<Outcome>,
    /// Points and bonds, counted over all families, that the last force broke.
    pub(super) last: Vec<(u32, usize)>,
    /// `T⟨ξ⟩` of every bond, kept between passes; empty where points have a stress.
    pub(super) force_state: Vec<Vector<D>>,
    /// Of a law whose points have a stress.
    pub(super) points: Option<PointForces<D>>,
    /// Thermal expansion of bonds; none where nothing expands.
    pub(super) heat: Option<Heat>,
}

/// One deformed family in memory that the next one takes over.
#[derive(Default)]
pub(super) struct Scratch<const D: usize> {
    keeps_damage: bool,
    material: u16,
    kinematics: BondKinematics,
    bonds: Vec<Vector<D>>,
    volumes: Vec<f64>,
    pair: Vec<f64>,
    omega: Vec<f64>,
    difference: Vec<Vector<D>>,
    pub(super) extension: Vec<f64>,
    pub(super) direction: Vec<Vector<D>>,
    /// The bond of each entry, counted over all families.
    pub(super) of: Vec<usize>,
    past: Vec<f64>,
    present: Vec<f64>,
    pub(super) point: Vec<f64>,
    pub(super) principal_stress: [f64; 3],
    pub(super) force: Vec<Vector<D>>,
    is_whole: bool,
    damage: f64,
    pub(super) carried: Option<Tensor<D>>,
}

/// Input of a law for one family, and the numbers that it overwrites.
pub(super) struct Parts<'a, const D: usize> {
    pub(super) family: DeformedFamily<'a, D>,
    pub(super) past: &'a [f64],
    pub(super) present: Present<'a>,
    pub(super) force: &'a mut [Vector<D>],
}

impl<const D: usize> Scratch<D> {
    pub(super) fn split<'a>(
        &'a mut self,
        state: Option<&'a StatePart<D>>,
        stress: bool,
    ) -> Parts<'a, D> {
        Parts {
            family: DeformedFamily {
                bonds: &self.bonds,
                volumes: &self.volumes,
                pair: &self.pair,
                omega: &self.omega,
                state,
                difference: &self.difference,
                extension: &self.extension,
                direction: &self.direction,
                is_whole: self.is_whole,
                damage: self.damage,
                carried: self.carried.as_ref(),
                keeps_damage: self.keeps_damage,
                material: self.material,
                kinematics: self.kinematics,
            },
            past: &self.past,
            present: Present {
                point: &mut self.point,
                bonds: &mut self.present,
                principal_stress: stress.then_some(&mut self.principal_stress),
            },
            force: &mut self.force,
        }
    }
}

impl<const D: usize> Generic<D> {
    /// The pass of a law, with the coefficients that `body` has for the bonds of its linearisation.
    pub(super) fn new(
        setup: &BondSetup<'_, D>,
        law: &Arc<dyn Law<D>>,
        states: &dyn ForceState<D>,
        body: &PdBody<D>,
    ) -> Self {
        let layout = states.history();
        let points = setup.position.len();
        let families = setup.families.clone();
        let bonds = families.neighbours.len();
        let (mut pair, mut omega) = (Vec::with_capacity(bonds), Vec::new());
        let mut reverse = Vec::with_capacity(bonds);
        let mut intact = Vec::with_capacity(bonds);
        for i in 0..points {
            for &j in families.of(i) {
                let place = body.families.of(i).binary_search(&j);
                let (p, w) = body.kernel(i);
                pair.push(place.map_or(0.0, |k| p[k]));
                if !law.linearised().is_pairwise() {
                    omega.push(place.map_or(0.0, |k| w[k]));
                }
                let back = families.of(j as usize).binary_search(&(i as u32));
                let start = families.offsets[j as usize] as u32;
                reverse.push(back.map_or(NONE, |k| start + k as u32));
                intact.push(!setup.precracked.is_some_and(|cut| cut(i, j as usize)));
            }
        }
        let past = History {
            point: vec![0.0; points * layout.point.len()],
            bonds: vec![0.0; bonds * layout.bond.len()],
        };
        let counted = match layout.damage {
            Some(KeptDamage::Bond(_)) => bonds,
            _ => 0,
        };
        let damaged_through = vec![false; counted];
        let by_points = PointForces::new(states, points);
        let kept = if by_points.is_some() { 0 } else { bonds };
        let failure = BondFailure::new(setup, body, &reverse);
        let mut pass = Self {
            law: Arc::clone(law),
            layout,
            position: setup.position.to_vec(),
            volume: setup.volume.to_vec(),
            row: (0..points).map(|i| setup.row(i)).collect(),
            no_fail: (0..points).map(|i| setup.no_fail(i)).collect(),
            material: body.cloud.material.clone(),
            state: (0..points).map(|i| body.state(i).cloned()).collect(),
            reverse,
            pair,
            omega,
            carried: CarriedDeformation::new(&layout, &failure, points),
            failure,
            kinematics: setup.kinematics,
            family_volume: match setup.failure.is_some() || setup.precracked.is_some() {
                true => Self::family_volumes(setup, body),
                false => Vec::new(),
            },
            intact,
            damaged_through,
            present: past.clone(),
            past,
            outcome: vec![Outcome::default(); points],
            last: Vec::new(),
            force_state: vec![Vector::zeros(); kept],
            points: by_points,
            heat: None,
            families,
        };
        pass.recall_intact(None);
        pass
    }

    pub(super) fn xi(&self, i: usize, j: usize) -> Vector<D> {
        self.position[j] - self.position[i]
    }

    pub(super) fn range(&self, i: usize) -> std::ops::Range<usize> {
        self.families.offsets[i]..self.families.offsets[i + 1]
    }

    pub(super) fn neighbour(&self, bond: usize) -> usize {
        self.families.neighbours[bond] as usize
    }

    /// `t` and r² of a bond, and the direction `ξ + η`, or ξ of a linear one.
    pub(super) fn stretched(
        &self,
        i: usize,
        j: usize,
        eta: &Vector<D>,
    ) -> super::list::Stretched<D> {
        let (xi, here) = (self.xi(i, j).into(), [0.0; D]);
        match self.kinematics {
            BondKinematics::Exact => stretched::<D, true>(&xi, &here, eta.as_slice()),
            BondKinematics::Linear => stretched::<D, false>(&xi, &here, eta.as_slice()),
        }
    }

    /// The response of one family, of those of its bonds that count; forces and history lie in the scratch.
    pub(super) fn respond(
        &self,
        i: usize,
        displaced: &dyn Fn(usize) -> Vector<D>,
        counts: impl Fn(usize) -> bool,
        step: f64,
        past: &History,
        s: &mut Scratch<D>,
    ) -> EnergyDensity {
        let here = displaced(i);
        for list in [&mut s.volumes, &mut s.pair, &mut s.omega, &mut s.extension] {
            list.clear();
        }
        for list in [&mut s.bonds, &mut s.difference, &mut s.direction] {
            list.clear();
        }
        s.of.clear();
        s.past.clear();
        s.keeps_damage = self.no_fail[i];
        s.kinematics = self.kinematics;
        s.material = self.material.get(i).copied().unwrap_or(0);
        let kept = self.layout.bond.len();
        for bond in self.range(i).filter(|&bond| counts(bond)) {
            let j = self.neighbour(bond);
            let eta = displaced(j) - here;
            let stretch = self.stretched(i, j, &eta);
            let (t, r) = (stretch.t(), stretch.length.sqrt());
            let (e, shrink) = match self.kinematics {
                BondKinematics::Exact => (extension::<true>(t), ratio::<true>(t)),
                BondKinematics::Linear => (extension::<false>(t), ratio::<false>(t)),
            };
            let (e, eta) = match self.taken_stretch(i, j) {
                Some(free) => (e - free, eta - self.xi(i, j) * free),
                None => (e, eta),
            };
            s.of.push(bond);
            s.bonds.push(self.xi(i, j));
            s.volumes.push(self.volume[j]);
            s.pair.push(self.pair[bond]);
            s.omega.extend(self.omega.get(bond));
            s.difference.push(eta);
            s.extension.push(e * r);
            s.direction
                .push(Vector::from_column_slice(&stretch.direction) * (shrink / r));
            s.past.extend(&past.bonds[bond * kept..(bond + 1) * kept]);
        }
        s.principal_stress = [0.0; 3];
        s.is_whole = s.of.len() == self.range(i).len();
        s.damage = match s.is_whole {
            true => 0.0,
            false => self.lost_share(i, &counts),
        };
        s.force.clear();
        s.force.resize(s.of.len(), Vector::zeros());
        s.present.clone_from(&s.past);
        let own = i * self.layout.point.len()..(i + 1) * self.layout.point.len();
        s.point.clear();
        s.point.extend(&past.point[own.clone()]);
        let Some(law) = self.law.force_state() else {
            return EnergyDensity::default();
        };
        let asks = self.failure.reads().flow;
        let parts = s.split(self.state[i].as_ref(), asks);
        let past = Past {
            point: &past.point[own],
            bonds: parts.past,
        };
        law.respond(&parts.family, step, past, parts.present, parts.force)
    }

    /// Force states of all families at the end of a step, and the history there.
    fn respond_all(&mut self, u: &[f64], step: f64) {
        let mut force = std::mem::take(&mut self.force_state);
        let mut present = std::mem::take(&mut self.present);
        let mut outcome = std::mem::take(&mut self.outcome);
        let offsets = &self.families.offsets;
        let scaled = |n: usize| offsets.iter().map(|o| o * n).collect::<Vec<_>>();
        let kept = [self.layout.point.len(), self.layout.bond.len()];
        let points: Vec<usize> = (0..offsets.len()).map(|i| i * kept[0]).collect();
        let mut heat = self
            .heat
            .as_mut()
            .map(|heat| std::mem::take(&mut heat.present));
        let resisted: Vec<&mut [f64]> = match &mut heat {
            Some(resisted) => split_rows(resisted, offsets),
            None => points.iter().map(|_| Default::default()).collect(),
        };
        let forces = split_rows(&mut force, offsets);
        let of_bonds = split_rows(&mut present.bonds, &scaled(kept[1]));
        let of_points = split_rows(&mut present.point, &points);
        let families = forces
            .into_par_iter()
            .zip(of_bonds)
            .zip(of_points)
            .zip(resisted)
            .zip(&mut outcome);
        parallel::for_each_with(
            families.enumerate().with_min_len(16),
            Scratch::default,
            |s, (i, ((((force, bonds), point), resisted), outcome))| {
                let range = self.range(i);
                if range.is_empty() {
                    return;
                }
                let displaced = |j: usize| at(u, j);
                let intact = |bond: usize| self.intact[bond];
                s.carried = self.carried_of(i).copied();
                let energy = self.respond(i, &displaced, intact, step, &self.past, s);
                outcome.dissipated = energy.dissipated * self.volume[i];
                outcome.flow = self.flow(i, s);
                force.fill(Vector::zeros());
                resisted.fill(0.0);
                point.copy_from_slice(&s.point);
                for (e, &bond) in s.of.iter().enumerate() {
                    let k = bond - range.start;
                    force[k] = s.force[e];
                    if let Some(resisted) = resisted.get_mut(k) {
                        let along = s.force[e].dot(&s.direction[e]) * s.bonds[e].norm();
                        *resisted = self.volume[i] * s.volumes[e] * along;
                    }
                    bonds[k * kept[1]..(k + 1) * kept[1]]
                        .copy_from_slice(&s.present[e * kept[1]..(e + 1) * kept[1]]);
                }
            },
        );
        if let (Some(heat), Some(resisted)) = (&mut self.heat, heat) {
            heat.present = resisted;
        }
        self.force_state = force;
        self.present = present;
        self.outcome = outcome;
    }

    /// `−V_i Σ V_j (T_i⟨ξ⟩ − T_j⟨−ξ⟩)` of the points with rows, [SAND2015-7998] eq. (2.5) as the sum (5.5); without a family at the far end a pairwise law has the same bond there, any other no energy.
    pub(super) fn gather(&self, states: &[Vector<D>], force: &mut [f64]) {
        parallel::for_each_chunk(force, D, 64, |i, force| {
            let mut sum = Vector::<D>::zeros();
            if self.row[i] {
                for bond in self.range(i) {
                    let back = match self.reverse[bond] {
                        NONE if self.law.linearised().is_pairwise() => -states[bond],
                        NONE => Vector::zeros(),
                        back => states[back as usize],
                    };
                    sum += (states[bond] - back) * self.volume[self.neighbour(bond)];
                }
            }
            force.copy_from_slice((sum * -self.volume[i]).as_slice());
        });
    }

    /// Energy of a point \[J\] at once, from a history.
    pub(super) fn energy_of(
        &self,
        i: usize,
        displaced: &dyn Fn(usize) -> Vector<D>,
        counts: impl Fn(usize) -> bool,
        history: &History,
        scratch: &mut Scratch<D>,
    ) -> f64 {
        let density = self.respond(i, displaced, counts, 0.0, history, scratch);
        density.stored * self.volume[i]
    }
}

/// The displacement of a point.
pub(super) fn at<const D: usize>(u: &[f64], i: usize) -> Vector<D> {
    Vector::from_column_slice(&u[i * D..][..D])
}

impl<const D: usize> BondPass<D> for Generic<D> {
    fn points(&self) -> usize {
        self.position.len()
    }

    fn name(&self) -> &'static str {
        "force states"
    }

    fn bonds(&self) -> u64 {
        self.families.neighbours.len() as u64
    }

    fn force_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        interval: Interval,
        breakage: FailureUpdate,
    ) -> BondChanges {
        self.last.clear();
        self.failure.keep(u);
        if breakage == FailureUpdate::Update {
            self.last = self.failing(u);
            if !self.last.is_empty() {
                // bonds that break have been heated before
                self.sum_heat();
                self.break_last(u);
                let last = std::mem::take(&mut self.last);
                self.recall_intact(Some(&last));
                self.last = last;
            }
        }
        if let Some(mut points) = self.points.take() {
            self.respond_points(&mut points, u, interval);
            self.gather_points(&points, u, force);
            self.points = Some(points);
            self.begin_heat();
            return BondChanges::broken(self.last.len() as u64);
        }
        self.respond_all(u, interval.length);
        if breakage == FailureUpdate::Update {
            self.find_damaged_through();
        }
        self.gather(&self.force_state, force);
        self.begin_heat();
        BondChanges::broken(self.last.len() as u64)
    }

    fn commit(&mut self) -> f64 {
        self.sum_heat_of_points();
        self.past.clone_from(&self.present);
        self.sum_heat();
        if let Some(drag) = self.points.as_mut().and_then(|p| p.drag.as_mut()) {
            drag.commit();
        }
        self.advance_failure();
        let own = self.outcome.iter().zip(&self.row);
        own.filter(|(_, row)| **row)
            .map(|(outcome, _)| outcome.dissipated)
            .sum()
    }

    fn remembers(&self) -> bool {
        let drag = self.points.as_ref().and_then(|p| p.drag.as_ref());
        !self.layout.is_empty() || drag.is_some()
    }

    fn tangent_into(&self, x: &[f64], y: &mut [f64]) {
        self.tangent_product(x, y);
    }

    fn row_sums(&self) -> Vec<f64> {
        self.tangent_row_sums()
    }

    fn stored_energy(&self, u: &[f64]) -> f64 {
        let mut sites = Sites::default();
        if self.points.is_some() {
            sites.set(&self.position, u, None);
        }
        let of_point = |s: &mut Scratch<D>, i: usize| {
            if !self.row[i] {
                return 0.0;
            }
            if let Some(points) = &self.points {
                return self.point_energy(points, i, (u, &sites), &self.past, &mut s.point);
            }
            s.carried = self.carried_of(i).copied();
            self.energy_of(i, &|j| at(u, j), |bond| self.intact[bond], &self.past, s)
        };
        let energies: Vec<f64> =
            parallel::map_with(self.position.len(), 64, Scratch::default, of_point);
        energies.iter().sum()
    }

    fn damage_into(&self, damage: &mut [f64]) {
        for (i, damage) in damage.iter_mut().enumerate() {
            *damage = self.damage_of_point(i);
        }
    }

    fn is_damaged(&self, i: usize) -> bool {
        self.kept_of_point(i) > 0.0 || self.range(i).any(|bond| self.damage_of(bond) > 0.0)
    }

    fn broken(&self) -> u64 {
        let broken = (0..self.intact.len()).filter(|&bond| !self.stands(bond));
        broken.count() as u64
    }

    fn last_broken(&self) -> Vec<(u32, u32)> {
        let last = self.last.iter();
        last.map(|&(i, bond)| (i, self.families.neighbours[bond]))
            .collect()
    }

    fn drag_rate(&self, mass: &dyn Fn(usize) -> f64) -> f64 {
        self.rate_of_drag(mass)
    }

    fn add_lost_energy(&self, displaced: &dyn Fn(usize) -> [f64; D], lost: &mut ExactSum) {
        lost.add(self.lost(displaced));
    }

    fn left(&self, i: usize, j: usize) -> [f64; 2] {
        let place = self.families.of(i).binary_search(&(j as u32));
        let stands = place.is_ok_and(|k| self.stands(self.range(i).start + k));
        [f64::from(u8::from(stands)); 2]
    }

    fn damage_state(&self) -> Vec<u64> {
        self.words()
    }

    fn restore_damage(&mut self, state: &[u64]) -> bool {
        self.restore(state)
    }

    fn own_points(&mut self) -> Option<&mut dyn super::OwnPoints> {
        None
    }

    fn heated(&mut self) -> Option<&mut dyn super::HeatedBonds> {
        Some(self)
    }

    fn force_states(&self) -> Option<&dyn ForceStates<D>> {
        Some(self)
    }

    fn memory_bytes(&self) -> usize {
        let bonds = self.families.neighbours.len();
        let vectors = self.position.len() + self.force_state.len();
        let history = 2 * (self.past.point.len() + self.past.bonds.len());
        vectors * D * 8
            + (self.volume.len() * 2 + self.pair.len() + self.omega.len()) * 8
            + (self.failure.numbers() + self.family_volume.len()) * 8
            + self.state.len() * std::mem::size_of::<Option<StatePart<D>>>()
            + self.families.offsets.len() * 8
            + bonds * 9
            + self.damaged_through.len()
            + self.points.as_ref().map_or(0, PointForces::memory_bytes)
            + self
                .carried
                .as_ref()
                .map_or(0, CarriedDeformation::memory_bytes)
            + (self.row.len() + self.material.len()) * 2
            + history * 8
    }
}
