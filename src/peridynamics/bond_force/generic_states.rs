//! Force states of single points in the generic pass: stress, energy density and history.

use super::{
    BondPass, ForceStates,
    bond_failure::BondFailure,
    generic::{Generic, Scratch, at},
};
use crate::{
    peridynamics::{CauchyStress, Past},
    tensor::Vector,
};

impl<const D: usize> ForceStates<D> for Generic<D> {
    fn stress(&self, i: usize, displaced: &dyn Fn(usize) -> Vector<D>) -> CauchyStress<D> {
        let mut s = Scratch::default();
        s.carried = self.carried_of(i).copied();
        let intact = |bond: usize| self.intact[bond];
        self.respond(i, displaced, intact, 0.0, &self.past, &mut s);
        let own = i * self.layout.point.len()..(i + 1) * self.layout.point.len();
        let parts = s.split(self.state[i].as_ref(), false);
        let past = Past {
            point: &self.past.point[own],
            bonds: parts.past,
        };
        let law = self.law.force_state();
        law.map_or_else(CauchyStress::zero, |law| {
            law.stress(&parts.family, past, parts.force)
        })
    }

    fn energy_density(&self, i: usize, u: &[f64]) -> f64 {
        let (displaced, intact) = (|j| at(u, j), |bond: usize| self.intact[bond]);
        let mut s = Scratch::default();
        s.carried = self.carried_of(i).copied();
        self.respond(i, &displaced, intact, 0.0, &self.past, &mut s)
            .stored
    }

    fn family_size(&self, point: usize) -> usize {
        self.range(point).len()
    }

    fn points_without_response(&self, u: &[f64]) -> usize {
        let Some(law) = self.law.force_state() else {
            return 0;
        };
        let mut s = Scratch::default();
        let lacks = |i: &usize| {
            let intact = |bond: usize| self.intact[bond];
            s.carried = self.carried_of(*i).copied();
            self.respond(*i, &|j| at(u, j), intact, 0.0, &self.past, &mut s);
            !law.responds(&s.split(self.state[*i].as_ref(), false).family)
        };
        let damaged = (0..self.position.len()).filter(|&i| self.row[i] && self.is_damaged(i));
        damaged.filter(lacks).count()
    }

    fn remembered(&self) -> Vec<(&'static str, Vec<f64>)> {
        let names = self.layout.point;
        let column = |k: usize| {
            let points = self.past.point.chunks_exact(names.len());
            points.map(|numbers| numbers[k]).collect()
        };
        let named = names
            .iter()
            .enumerate()
            .filter(|(_, name)| !name.is_empty());
        let mut found: Vec<_> = named.map(|(k, name)| (*name, column(k))).collect();
        if let BondFailure::State { state, .. } = &self.failure {
            found.extend(state.fields());
        }
        found
    }
}
