//! Zero-energy modes: what resists the part of a deformation that a correspondence stress does not see.

use super::bond_force::BondKinematics;
use crate::tensor::{Tensor, Vector};

/// Control of the part of a family's deformation that is not uniform.
///
/// A correspondence stress depends on the mean deformation gradient `F̄` of a family alone, so that an alternating displacement costs no energy. With `q = s D (D+2) μ/m`, the strength of the pairwise part of an LPS times `stabilisation = s`,
/// and `m = Σ ω |ξ|² V`, each adds a force state that vanishes for uniform deformations of any size, leaves linear and angular momentum alone, and has no part in the stress:
///
/// ```text
/// bond force    T = q ω (Y − F̄ ξ)                                          [Silling2017]
/// length        T = q ω (|Y| − |F̄ ξ|) M ,          M = Y/|Y|               [SAND2015-7998] section 6.3, T_L
/// drag          T = c ω (Ẏ − L Y) ,                c = q δ/√((λ + 2 μ)/ρ)
/// ```
///
/// The length control is printed with the other sign, by which it would feed the modes; the printed strength `β_L C`, `C = 18 k/(π δ⁵)`, is `q` at `s = β_L · 18 k m/(15 π δ⁵ μ)`. The printed drag takes a share of the force densities of
/// the neighbours instead of the own one, which keeps neither force nor torque; here L is the velocity gradient of the intact bonds as they are deformed, `L = Σ ω Ẏ ⊗ Y V (Σ ω Y ⊗ Y V)⁻¹`,
/// whose remainder `Ẏ − L Y` has no moment, and the power `−Σ T · Ẏ V = −c Σ ω |Ẏ − L Y|² V` is never positive. A drag whose force state has the sign of the velocities' difference resists it, by the convention of [SAND2015-7998] eq. (2.5).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ZeroEnergyControl {
    /// Along the part of the bond that is not uniform: elastic.
    #[default]
    BondForce,
    /// Along the deformed bond, by its length; rotations of bonds are not resisted. The force state of the report: it follows the deformation at once, but is not quite the derivative of the energy that is reported for it, `½ q ω (|Y| − |F̄ ξ|)²`, since that depends on `F̄`, too.
    Length,
    /// Against velocities that are not uniform: dissipates, and holds no mode in place.
    Drag,
}

impl ZeroEnergyControl {
    /// Its names in scenes, in the order of the values.
    pub const WORDS: &'static [&'static str] = &["bond-force", "length", "drag"];

    /// The control of a place in [`ZeroEnergyControl::WORDS`].
    pub fn of_place(place: usize) -> Self {
        match place {
            0 => Self::BondForce,
            1 => Self::Length,
            _ => Self::Drag,
        }
    }
}

/// Returns the share of the strength of a control that remains at a point with the damage D, `(1 − D)⁸`.
///
/// A control that is not uniform deformation alone holds the two sides of a crack together: one that faded like the stress would take as much energy again as the crack. Bars of points that were pulled to separation (a horizon of three and four spacings,
/// a crack band of a twentieth of the widest) spent in it 0.13 to 0.30 of the fracture energy with the exponent 2, 0.02 to 0.04 with 4, and less than 0.01 with 8. It is that of the damage at the beginning of a step, so that a step's force is the derivative of an energy.
pub(crate) fn control_left(damage: f64) -> f64 {
    (1.0 - damage).powi(8)
}

/// `|Y| − |F̄ ξ|` of a bond, `F̄ = I + gradient`, without the difference of two long lengths; with linear kinematics `M·(η − gradient ξ)`.
pub(crate) fn excess_length<const D: usize>(
    xi: &Vector<D>,
    eta: &Vector<D>,
    gradient: &Tensor<D>,
    kinematics: BondKinematics,
) -> f64 {
    let uniform = gradient * xi;
    let beyond = eta - uniform;
    match kinematics {
        BondKinematics::Exact => {
            let (deformed, smooth) = (xi + eta, xi + uniform);
            beyond.dot(&(deformed + smooth)) / (deformed.norm() + smooth.norm())
        }
        BondKinematics::Linear => beyond.dot(xi) / xi.norm(),
    }
}
