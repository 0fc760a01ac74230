//! The force state of one family of a law without memory.

use super::bond_force::{BondKinematics, stretch::psi};
use crate::{
    peridynamics::{
        CauchyStress, DeformedFamily, EnergyDensity, ForceState, Past, Present, StatePart,
    },
    tensor::{Tensor, Vector},
};

/// The intact bonds of a family, with the coefficients of its linearised law.
///
/// Shapes: one entry per bond; `omega` is not read by a pairwise law. Units: ξ \[m\], V \[m^D\].
#[derive(Clone, Copy, Debug)]
pub struct MemorylessFamily<'a, const D: usize> {
    /// Bond vectors ξ.
    pub bonds: &'a [Vector<D>],
    /// Volumes V of their far points.
    pub volumes: &'a [f64],
    /// `p` of the linearised law.
    pub pair: &'a [f64],
    /// `ω` of the linearised law.
    pub omega: &'a [f64],
    /// Its state part.
    pub state: Option<&'a StatePart<D>>,
    /// The material of the point, 0 in a body of one.
    pub material: u16,
    /// Share of the family's volume whose bonds are broken, 0 of a whole family.
    pub damage: f64,
}

impl<const D: usize> MemorylessFamily<'_, D> {
    /// The partial stress `Σ T⟨ξ⟩ ⊗ ξ V` \[Pa\], [SAND2015-7998] eq. (2.19), and the energies, where the displacements of the far points differ from that of the point by `difference` \[m\].
    pub fn stress(
        &self,
        law: &dyn ForceState<D>,
        kinematics: BondKinematics,
        difference: &[Vector<D>],
    ) -> (Tensor<D>, EnergyDensity) {
        self.deformed(law, kinematics, difference, &[], |family, force, energy| {
            let forces = force.iter().zip(family.bonds).zip(family.volumes);
            let stress = forces.fold(Tensor::zeros(), |sum, ((force, xi), volume)| {
                sum + force * xi.transpose() * *volume
            });
            (stress, energy)
        })
    }

    /// The Cauchy stress of exact bonds, [`ForceState::stress`], and their stored energy density, likewise; bonds expand freely by the stretches `free`.
    pub fn cauchy_stress(
        &self,
        law: &dyn ForceState<D>,
        difference: &[Vector<D>],
        free: &[f64],
    ) -> (CauchyStress<D>, f64) {
        let exact = BondKinematics::Exact;
        self.deformed(law, exact, difference, free, |family, force, energy| {
            (law.stress(family, NO_PAST, force), energy.stored)
        })
    }

    fn deformed<T>(
        &self,
        law: &dyn ForceState<D>,
        kinematics: BondKinematics,
        difference: &[Vector<D>],
        free: &[f64],
        told: impl FnOnce(&DeformedFamily<'_, D>, &[Vector<D>], EnergyDensity) -> T,
    ) -> T {
        let bonds = self.bonds.len();
        let (mut extension, mut direction) = (vec![0.0; bonds], self.bonds.to_vec());
        for (k, eta) in difference.iter().enumerate() {
            let xi = &self.bonds[k];
            let length = xi.norm();
            let cross = 2.0 * xi.dot(eta);
            match kinematics {
                BondKinematics::Exact => {
                    let t = (cross + eta.norm_squared()) / (length * length);
                    let psi = psi(t);
                    extension[k] = length * t * (1.0 - (1.0 + t) * psi);
                    direction[k] = (xi + eta) * ((1.0 - t * psi) / length);
                }
                BondKinematics::Linear => {
                    extension[k] = 0.5 * cross / length;
                    direction[k] /= length;
                }
            }
            extension[k] -= free.get(k).map_or(0.0, |stretch| stretch * length);
        }
        let mut force = vec![Vector::zeros(); bonds];
        let family = DeformedFamily {
            bonds: self.bonds,
            volumes: self.volumes,
            pair: self.pair,
            omega: self.omega,
            state: self.state,
            difference,
            extension: &extension,
            direction: &direction,
            is_whole: self.damage == 0.0,
            damage: self.damage,
            carried: None,
            keeps_damage: false,
            material: self.material,
            kinematics,
        };
        let present = Present {
            point: &mut [],
            bonds: &mut [],
            principal_stress: None,
        };
        let energy = law.respond(&family, 0.0, NO_PAST, present, &mut force);
        told(&family, &force, energy)
    }
}

const NO_PAST: Past<'_> = Past {
    point: &[],
    bonds: &[],
};
