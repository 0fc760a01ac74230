//! Energy and damage of the bonds that a seam cuts.

use super::breaking::Breaking;
use super::softened_bonds::SeamSoftening;
use super::{CHUNK, NonlinearSeam};
use crate::{
    coupling::truncated::{bond_kinematics::Part, dilatation_state::States},
    parallel,
    peridynamics::bond_force::{BondKinematics, BondPass},
    tensor::Vector,
};

impl<const D: usize> NonlinearSeam<D> {
    /// The elongation of a part.
    pub(super) fn elongation(&self, p: usize, u: &[f64]) -> f64 {
        let part = &self.parts[p];
        let d: Vector<D> = self.difference.displacement(p, u);
        match self.kinematics {
            BondKinematics::Exact => part.strained::<true>(&d).elongation,
            BondKinematics::Linear => part.strained::<false>(&d).elongation,
        }
    }

    /// Energy of the parts that stand, and of the dilatations of the seam \[J\].
    pub(in crate::coupling) fn energy(&self, u: &[f64]) -> f64 {
        let elongation: Vec<f64> =
            parallel::map(self.parts.len(), CHUNK, |p| self.elongation(p, u));
        let parts = self.parts.iter().zip(&elongation);
        let parts: f64 = parts
            .map(|(part, q)| 0.5 * self.left(part.bond)[0] * part.stiffness * q * q)
            .sum();
        let Some(states) = &self.states else {
            return parts;
        };
        let own = states.own_parts(u, self.kinematics, |_| true);
        let handed = |p: usize| self.left(self.parts[p].bond)[1] * elongation[p];
        let pressures = states.pressures(&own, handed, |_| true);
        parts + states.energy(&own, &pressures, u)
    }

    /// Forgets what broke in the last pass.
    pub(in crate::coupling) fn begin_pass(&mut self) {
        self.last.clear();
    }

    /// Returns true if a bond of the seam broke or softened in the last pass.
    pub(in crate::coupling) fn has_changed(&self) -> bool {
        !self.last.is_empty()
    }

    /// Adds to the damage of points, so far that of the bonds of the body's pass, what they lost here; `of_bonds` is the volume that a point's whole bonds reach.
    pub(in crate::coupling) fn add_damage(
        &self,
        damage: &mut [f64],
        of_bonds: impl Fn(u32) -> f64,
    ) {
        for of in self.lost.chunk_by(|a, b| a.0 == b.0) {
            let point = of[0].0;
            let sum = |all: bool| -> f64 {
                let part = |bond| if all { 1.0 } else { 1.0 - self.left(bond)[1] };
                of.iter().map(|l| part(l.1) * l.2).sum()
            };
            let (whole, lost) = (of_bonds(point), sum(false));
            let damage = &mut damage[point as usize];
            if lost > 0.0 || *damage > 0.0 {
                *damage = (*damage * whole + lost) / (whole + sum(true));
            }
        }
    }

    /// A point next to a face up to which damage has come: a bond that ends on the face within a spacing of it, or one along the face between points next to it, is broken.
    pub(in crate::coupling) fn damaged_at_face(&self, pass: &dyn BondPass<D>) -> Option<u32> {
        let ends = self.next_to_face.iter();
        let mut ends = ends.filter(|(bond, _)| !self.stands(*bond));
        if let Some(&(_, point)) = ends.next() {
            return Some(point);
        }
        let mut along = self.along_face.iter();
        along
            .find(|[i, j]| pass.is_damaged(*i as usize) && !pass.bonded(*i as usize, *j as usize))
            .map(|[i, _]| *i)
    }

    /// Bytes held.
    pub(in crate::coupling) fn memory_bytes(&self) -> usize {
        self.parts.len() * (size_of::<Part<D>>() + D * 8 + 8)
            + self.breaks.as_ref().map_or(0, Breaking::memory_bytes)
            + self.states.as_ref().map_or(0, States::memory_bytes)
            + (self.softening.as_ref()).map_or(0, SeamSoftening::memory_bytes)
            + self.difference.matrix().nnz() * 28
            + self.families.neighbours.len() * 4
    }
}
