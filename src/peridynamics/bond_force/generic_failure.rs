//! Failure in the generic pass: which bonds break, what they stored, and how that is saved.

#![deny(clippy::wildcard_enum_match_arm)]

use super::{
    bond_failure::BondFailure,
    bond_heat::Heat,
    carried_deformation::CarriedDeformation,
    generic::{Generic, Scratch, at},
};
use crate::{
    parallel,
    peridynamics::{
        failure::{BondResponse, EndOfStep, Flow, tension},
        force_state::PLASTIC_STRAIN,
    },
    tensor::{Tensor, Vector, determinant, least_eigenvalue},
};

/// Stretch of the intact bonds of a torn family along some direction below which it has failed: a time step of half the stable one bears four times the stiffness. Below 0.2, points of the notched bar
/// of [SAND2015-7998] section 6.3.1 at 0.6 mm went from volume to volume in each step and created 0.3 % of the work; necks of ductile metals keep more than half of their width.
const FLATTEST: f64 = 0.25;

impl<const D: usize> Generic<D> {
    /// Returns true if the intact part of a torn family is so flat at these displacements that its stiffness, which grows with `F̄⁻¹`, exceeds that of the stable step, or if it is turned inside out.
    fn is_flattened(&self, i: usize, u: &[f64]) -> bool {
        let intact = self.points.as_ref().map(|points| &points.intact[i]);
        let is_torn = intact.is_some_and(|intact| intact.damage > 0.0 && intact.inverse.is_some());
        if !is_torn || !self.is_finite_strain(i) {
            return false;
        }
        self.intact_gradient(i, u).is_some_and(|gradient| {
            let deformation = Tensor::identity() + gradient;
            let square = deformation.transpose() * deformation;
            least_eigenvalue(&square) < FLATTEST * FLATTEST || determinant(&deformation) <= 0.0
        })
    }

    /// Bonds that fail at these displacements; each end finds its own. A family that is flattened loses what it has.
    pub(super) fn failing(&self, u: &[f64]) -> Vec<(u32, usize)> {
        let fails = |i: usize, bond: usize| match &self.failure {
            BondFailure::Never => false,
            BondFailure::Stretch(limit) => {
                let j = self.neighbour(bond);
                let s = self.stretched(i, j, &(at(u, j) - at(u, i)));
                let limit = match self.free_stretch(i, j) {
                    Some(free) => Heat::limit(self.kinematics, limit[bond], free),
                    None => limit[bond],
                };
                s.excess > limit * s.length
            }
            BondFailure::State { state, .. } => state.breaks([i, self.neighbour(bond)], bond),
        };
        let may = |i: usize| match &self.failure {
            BondFailure::Never => false,
            BondFailure::Stretch(_) => true,
            BondFailure::State { state, .. } => state.may_break(i),
        };
        if matches!(self.failure, BondFailure::Never) {
            return Vec::new();
        }
        parallel::listed(self.position.len(), 64, |i, failing| {
            let is_flattened = self.is_flattened(i, u);
            if self.no_fail[i] || !(is_flattened || may(i)) {
                return;
            }
            let found = self.range(i).filter(|&bond| {
                self.intact[bond]
                    && !self.no_fail[self.neighbour(bond)]
                    && (is_flattened || fails(i, bond))
            });
            failing.extend(found.map(|bond| (i as u32, bond)));
        })
    }

    /// Plastic flow of a point in a response that lies in the scratch, where a criterion asks for it.
    pub(super) fn flow(&self, i: usize, s: &Scratch<D>) -> Flow {
        let names = self.layout.point;
        let place = names.iter().position(|name| *name == PLASTIC_STRAIN);
        let Some(place) = place.filter(|_| self.failure.reads().flow) else {
            return Flow::default();
        };
        let before = self.past.point[i * names.len() + place];
        Flow::new([before, s.point[place]], || tension(&s.principal_stress))
    }

    /// Ends a step of a criterion of a state.
    pub(super) fn advance_failure(&mut self) {
        let mut failure = std::mem::replace(&mut self.failure, BondFailure::Never);
        if let BondFailure::State {
            state,
            displacement,
            ..
        } = &mut failure
        {
            let flow = |i: usize| self.outcome[i].flow;
            let is_known = !displacement.is_empty();
            // at the end of the step nothing more is remembered
            let bonds = |i: usize, each: &mut dyn FnMut(usize, BondResponse)| {
                if !is_known || self.range(i).is_empty() {
                    return;
                }
                let mut s = Scratch::default();
                s.carried = self.carried_of(i).copied();
                let (displaced, intact) = (|j| at(displacement, j), |b: usize| self.intact[b]);
                self.respond(i, &displaced, intact, 0.0, &self.past, &mut s);
                for (k, bond) in s.of.iter().enumerate() {
                    let response = BondResponse {
                        extension: s.extension[k],
                        force: s.force[k].dot(&s.direction[k]),
                    };
                    each(*bond, response);
                }
            };
            state.advance(&EndOfStep {
                families: &self.families,
                volume: &self.volume,
                is_intact: &self.intact,
                flow: &flow,
                bonds: &bonds,
            });
        }
        self.failure = failure;
    }

    /// Energy that the points with rows would store less at these displacements, for the bonds that the last pass broke.
    pub(super) fn lost(&self, displaced: &dyn Fn(usize) -> [f64; D]) -> f64 {
        let displaced = |j: usize| Vector::from(displaced(j));
        let mut scratch = Scratch::default();
        let mut lost = 0.0;
        for of_point in self.last.chunk_by(|a, b| a.0 == b.0) {
            let i = of_point[0].0 as usize;
            if !self.row[i] {
                continue;
            }
            let broke = |bond: usize| of_point.iter().any(|l| l.1 == bond);
            let before = |bond: usize| self.intact[bond] || broke(bond);
            let after = |bond: usize| self.intact[bond];
            scratch.carried = self.carried_before(i).copied();
            lost += self.energy_of(i, &displaced, before, &self.past, &mut scratch);
            scratch.carried = self.carried_of(i).copied();
            lost -= self.energy_of(i, &displaced, after, &self.past, &mut scratch);
        }
        lost
    }

    /// Intact bonds, history of the law and of the criterion, and history of drags and points.
    pub(super) fn words(&self) -> Vec<u64> {
        let mut words = Vec::new();
        if !matches!(self.failure, BondFailure::Never) {
            let bits = self.intact.chunks(8).map(|eight| {
                let set = eight.iter().enumerate();
                set.fold(0u8, |byte, (k, intact)| byte | u8::from(*intact) << k)
            });
            let bonds = self.intact.len() as u64;
            words = super::pack(&bits.collect::<Vec<u8>>(), bonds);
        }
        let failure = self.failure.history();
        let history = self
            .past
            .point
            .iter()
            .chain(&self.past.bonds)
            .chain(failure);
        words.extend(history.map(|x| x.to_bits()));
        let drag = self.points.as_ref().and_then(|p| p.drag.as_ref());
        let moved = drag.into_iter().flat_map(|drag| drag.kept());
        words.extend(moved.map(|x| x.to_bits()));
        let carried = self.carried.iter().flat_map(CarriedDeformation::numbers);
        words.extend(carried.map(|x| x.to_bits()));
        words
    }

    /// Puts them back; false, and nothing changed, if they belong to another pass.
    pub(super) fn restore(&mut self, state: &[u64]) -> bool {
        let of_failure = self.failure.history().len();
        let drag = self.points.as_mut().and_then(|p| p.drag.as_mut());
        let dragged = drag.map_or(0, |drag| drag.kept().count());
        let carried = self.carried.as_ref().map_or(0, |c| c.numbers().count());
        let kept = self.past.point.len() + self.past.bonds.len() + of_failure + dragged + carried;
        let Some(words) = state.len().checked_sub(kept) else {
            return false;
        };
        let (words, history) = state.split_at(words);
        let mut bits = vec![0u8; self.intact.len().div_ceil(8)];
        let bonds = self.intact.len() as u64;
        match &self.failure {
            BondFailure::Never if !words.is_empty() => return false,
            BondFailure::Never => {}
            BondFailure::Stretch(_) | BondFailure::State { .. } => {
                if !super::unpack(words, bonds, &mut bits) {
                    return false;
                }
                for (bond, intact) in self.intact.iter_mut().enumerate() {
                    *intact = bits[bond / 8] >> (bond % 8) & 1 == 1;
                }
            }
        }
        let mut criterion = self.failure.history().to_vec();
        let own = self.past.point.iter_mut().chain(&mut self.past.bonds);
        let drag = self.points.as_mut().and_then(|p| p.drag.as_mut());
        let moved = drag.into_iter().flat_map(|drag| drag.kept_mut());
        let carried = self.carried.iter_mut().flat_map(|c| c.numbers_mut());
        for (number, word) in own
            .chain(&mut criterion)
            .chain(moved)
            .chain(carried)
            .zip(history)
        {
            *number = f64::from_bits(*word);
        }
        self.failure.restore(&criterion);
        self.present.clone_from(&self.past);
        self.recall_intact(None);
        self.recall_damaged_through();
        if let Some(heat) = &mut self.heat {
            heat.begin();
        }
        true
    }
}
