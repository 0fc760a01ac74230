//! The nonlinear response of a law: force states of deformed families, and the history of points and bonds.
//!
//! A law gives the force state `T⟨ξ⟩` of one family at a time, [SAND2015-7998] eq. (2.6): the Fréchet derivative (2.3) of the energy density. [`crate::peridynamics::bond_force`] passes over all families, adds `T_i⟨ξ⟩ − T_j⟨−ξ⟩` up,
//! breaks bonds, and keeps the history. So a law that is written here runs in load steps and in explicit motion, beside every seam, with damage, energies and checkpoints.

use crate::{
    material::LocalLaw,
    peridynamics::{StatePart, ZeroEnergyControl, bond_force::BondKinematics, invert_shape_tensor},
    tensor::{Tensor, Vector, determinant},
};

/// The numbers that a law keeps from step to step, by their names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HistoryLayout {
    /// Of each point.
    pub point: &'static [&'static str],
    /// Of each bond, seen from either end.
    pub bond: &'static [&'static str],
    /// Place of the damage of bonds among the numbers kept; none for a law whose bonds are whole until they break by their stretch.
    ///
    /// Results show damage by this. Every law states it: what it left out would pass for undamaged.
    pub damage: Option<KeptDamage>,
}

/// Place of a damage, from 0 to 1, among the numbers that a law keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeptDamage {
    /// The damage φ of a bond, by its place among the numbers of bonds. A bond counts as broken once φ is 1 at both of its ends.
    Bond(usize),
    /// The damage D of a point, by its place among the numbers of points: that of all bonds of its family alike, `φ⟨ξ⟩ = D`, [SAND2015-7998] eq. (6.28). No bond breaks by it.
    Point(usize),
}

impl HistoryLayout {
    /// A law without memory.
    pub const NONE: Self = Self {
        point: &[],
        bond: &[],
        damage: None,
    };

    /// Returns true if nothing is kept.
    pub fn is_empty(&self) -> bool {
        self.point.is_empty() && self.bond.is_empty()
    }
}

/// One deformed family, of its intact bonds only.
///
/// Shapes: one entry per intact bond; `omega` is empty for a pairwise law. Units: ξ and e \[m\], V \[m^D\].
#[derive(Clone, Copy, Debug)]
pub struct DeformedFamily<'a, const D: usize> {
    /// Bond vectors ξ of the reference configuration.
    pub bonds: &'a [Vector<D>],
    /// Volumes V of the bonds' far points.
    pub volumes: &'a [f64],
    /// `p` of the linearised law, [`crate::peridynamics::LinearForceState::coefficients`], of the whole family: broken bonds change nothing of it.
    pub pair: &'a [f64],
    /// `ω` of the linearised law.
    pub omega: &'a [f64],
    /// Its state part, of the whole family.
    pub state: Option<&'a StatePart<D>>,
    /// Difference of displacement η \[m\].
    pub difference: &'a [Vector<D>],
    /// Extension `e = |ξ + η| − |ξ|`; with linear kinematics `ξ·η/|ξ|`.
    pub extension: &'a [f64],
    /// Direction `M = (ξ + η)/|ξ + η|`; with linear kinematics `ξ/|ξ|`.
    pub direction: &'a [Vector<D>],
    /// True if no bond of the family is broken.
    pub is_whole: bool,
    /// Share of the family's volume whose bonds are broken, the `D = τ • φ` of [SAND2015-7998] eq. (6.28) with `τ = 1/V`.
    pub damage: f64,
    /// `C − I` of a point that has flowed and lost bonds, at which a local law is evaluated: its deformation gradient is `F̄ C`, so that it does not jump where bonds break. None where there is nothing to carry.
    pub carried: Option<&'a Tensor<D>>,
    /// True if the point keeps the damage that it has: in a region `no-fail`, and where its row is not that of its bonds alone.
    pub keeps_damage: bool,
    /// The material of the point, 0 in a body of one.
    pub material: u16,
    /// Kinematics of the extensions and directions.
    pub kinematics: BondKinematics,
}

impl<const D: usize> DeformedFamily<'_, D> {
    /// Number of intact bonds.
    pub fn len(&self) -> usize {
        self.bonds.len()
    }

    /// Returns true if no bond is intact.
    pub fn is_empty(&self) -> bool {
        self.bonds.is_empty()
    }

    /// The virial `σ = J⁻¹ Σ T⟨ξ⟩ ⊗ Y⟨ξ⟩ V` of the deformed bonds with the force state `T` \[Pa\], which is symmetric for an ordinary law: under a uniform deformation `J⁻¹ P Fᵀ` with P of
    /// [SAND2015-7998] eq. (2.19). Linear bonds have no other than the linear stress `Σ T⟨ξ⟩ ⊗ ξ V`, which a rotation turns to first order only.
    pub fn virial_stress(&self, force: &[Vector<D>]) -> Tensor<D> {
        let virial = force.iter().enumerate();
        let virial = virial.fold(Tensor::zeros(), |sum, (k, force)| {
            sum + force * self.deformed_bond(k).transpose() * self.volumes[k]
        });
        virial / self.volume_ratio()
    }

    /// `Y⟨ξ⟩` of a bond without its thermal expansion; ξ of a linear one.
    fn deformed_bond(&self, k: usize) -> Vector<D> {
        match self.kinematics {
            BondKinematics::Exact => self.direction[k] * (self.bonds[k].norm() + self.extension[k]),
            BondKinematics::Linear => self.bonds[k],
        }
    }

    /// Volume over undeformed volume, `J = det F̄` with `F̄ = (Σ Y⟨ξ⟩ ⊗ ξ V/|ξ|²) (Σ ξ ⊗ ξ V/|ξ|²)⁻¹` of the intact bonds; 1 of linear bonds, and of those that do not span the space or are turned inside out.
    pub fn volume_ratio(&self) -> f64 {
        if self.kinematics == BondKinematics::Linear {
            return 1.0;
        }
        let (mut shape, mut moment) = (Tensor::<D>::zeros(), Tensor::<D>::zeros());
        for (k, xi) in self.bonds.iter().enumerate() {
            let weighed = xi.transpose() * (self.volumes[k] / xi.norm_squared());
            shape += xi * weighed;
            moment += self.deformed_bond(k) * weighed;
        }
        let ratio = match invert_shape_tensor(&shape, self.len()) {
            Ok(inverse) => determinant(&(moment * inverse)),
            Err(_) => 1.0,
        };
        if ratio > 0.0 { ratio } else { 1.0 }
    }
}

/// Cauchy stress of a point \[Pa\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CauchyStress<const D: usize> {
    /// Its components within the body.
    pub tensor: Tensor<D>,
    /// The normal stress out of the plane of a long body; none where it is `ν tr σ` of an isotropic elastic one.
    pub across: Option<f64>,
}

impl<const D: usize> CauchyStress<D> {
    /// That of a point that carries none.
    pub fn zero() -> Self {
        Self {
            tensor: Tensor::zeros(),
            across: Some(0.0),
        }
    }
}

/// History of a point and its intact bonds, by [`HistoryLayout`]: the numbers of a bond follow one another, bond after bond.
#[derive(Clone, Copy, Debug)]
pub struct Past<'a> {
    /// Of the point.
    pub point: &'a [f64],
    /// Of its bonds.
    pub bonds: &'a [f64],
}

/// The same at the end of the step, to be overwritten.
#[derive(Debug)]
pub struct Present<'a> {
    /// Of the point.
    pub point: &'a mut [f64],
    /// Of its bonds.
    pub bonds: &'a mut [f64],
    /// The principal Cauchy stresses of the undamaged material \[Pa\] in any order, where a failure criterion asks for them; a law with the history variable [`PLASTIC_STRAIN`] overwrites them.
    pub principal_stress: Option<&'a mut [f64; 3]>,
}

/// The name of the equivalent plastic strain among the history variables of points.
pub const PLASTIC_STRAIN: &str = "equivalent plastic strain";

/// Energies per volume of a point \[J/m^D\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnergyDensity {
    /// Stored at the end of the step.
    pub stored: f64,
    /// Dissipated within the step, without what breaking bonds costs.
    pub dissipated: f64,
}

/// A response whose force state is a stress of its point, `T⟨ξ⟩ = ω P(F̄) K⁻¹ ξ (1 − D)`, and a zero-energy control.
#[derive(Clone, Copy, Debug)]
pub struct PointStress<'a, const D: usize> {
    /// Law of the stress P.
    pub law: &'a dyn LocalLaw<D>,
    /// Law of P where the point keeps the damage that it has, if that is another law.
    pub keeping: Option<&'a dyn LocalLaw<D>>,
    /// Control of the rest of the deformation.
    pub control: ZeroEnergyControl,
}

/// A law's nonlinear response.
pub trait ForceState<const D: usize>: Send + Sync {
    /// Returns the layout of its history. History starts at zero.
    fn history(&self) -> HistoryLayout;

    /// Overwrites `force` with `T⟨ξ⟩` of the intact bonds at the end of a step of the length `step` \[s\], and `present` with the history then; returns the energies.
    ///
    /// A step of length zero is the response at once: nothing that takes time happens.
    fn respond(
        &self,
        family: &DeformedFamily<'_, D>,
        step: f64,
        past: Past<'_>,
        present: Present<'_>,
        force: &mut [Vector<D>],
    ) -> EnergyDensity;

    /// The Cauchy stress of a point whose force state is `force`, as results show it: [`DeformedFamily::virial_stress`], and of correspondence `J⁻¹ P Fᵀ`.
    fn stress(
        &self,
        family: &DeformedFamily<'_, D>,
        _past: Past<'_>,
        force: &[Vector<D>],
    ) -> CauchyStress<D> {
        CauchyStress {
            tensor: family.virial_stress(force),
            across: None,
        }
    }

    /// The stress of a point, of a law whose [`ForceState::respond`] is that and nothing else: the pass then evaluates it once per point instead of a force per bond. `material` is that of the point; none asks whether all of them have one control.
    fn correspondence(&self, material: Option<u16>) -> Option<PointStress<'_, D>>;

    /// Returns true if a family that has lost bonds still has a response; if not, its point carries no stress of its own. Runs report the number of such points.
    fn responds(&self, _family: &DeformedFamily<'_, D>) -> bool {
        true
    }

    /// Returns true if a rotation of the family rotates its force state: only such a law takes geometrically exact bonds.
    fn is_objective(&self) -> bool;

    /// Energy stored in a bond at the stretch `s` over that of the linearised law, `½ c s²`: 1 for a law that is linear in the extension. By this the critical stretch follows from a fracture energy.
    fn energy_ratio(&self, s: f64) -> f64;
}
