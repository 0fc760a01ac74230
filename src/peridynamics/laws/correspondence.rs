//! Elastic correspondence: a classical stress through the family's deformation gradient.

use std::sync::Arc;

use super::{Constants, NamedLaw, Parameter, Ratio};
use crate::{
    material::{Kinematics, LocalLaw},
    peridynamics::{
        Accelerator, BondEnergy, Departure, Family, ForceState, ForceStateKind, Influence, Law,
        LinearForceState, Linearity, MomentConditions, Parameters, PdError, ShellTarget, StatePart,
        StressFit, ZeroEnergyControl, invert_shape_tensor,
    },
    tensor::{Tensor, Tensor4, Vector},
};

/// Linear elastic correspondence material, stabilised against zero-energy modes.
///
/// Source: [SAND2015-7998] section 7.2 (after \[Silling2007\]): `F̄ = Ḡ K⁻¹`, `T⟨ξ⟩ = ω σ(F̄) K⁻¹ ξ`. The stabilising term
/// `q ω (η − F̄ ξ)` \[Silling2017\] vanishes for affine fields and leaves the partial stress as it is; without it an alternating displacement costs no energy.
#[derive(Clone, Debug)]
pub struct Correspondence<const D: usize> {
    /// The influence function ω.
    pub influence: Influence,
    /// Strength of the stabilising term relative to `D (D+2) μ / m`, that of the pairwise part of an LPS; 0 switches it off.
    pub stabilisation: f64,
    /// Form of the term beyond the first order; that of the linear law is a bond force.
    pub control: ZeroEnergyControl,
    shear: f64,
    /// `√(ρ/(λ + 2 μ))` \[s/m\], of a drag.
    slowness: f64,
    tensor: Tensor4<D>,
}

impl<const D: usize> Correspondence<D> {
    /// A correspondence material with the Lamé parameters of `D` dimensions \[Pa\].
    pub fn new(influence: Influence, lambda: f64, mu: f64, stabilisation: f64) -> Self {
        Self {
            influence,
            stabilisation,
            control: ZeroEnergyControl::BondForce,
            shear: mu,
            slowness: 0.0,
            tensor: Tensor4::isotropic(lambda, mu),
        }
    }

    /// The same with another zero-energy control; `density` is that of the material [kg/m^D], by which a drag is measured.
    ///
    /// The linearisation of [`ZeroEnergyControl::Length`] is a bond force of the mean over all directions, `q/D`: what a bond resists along itself alone is no force state of [`LinearForceState`]. A drag has none.
    #[must_use]
    pub fn with_control(mut self, control: ZeroEnergyControl, density: f64) -> Self {
        self.control = control;
        self.slowness = (density / self.tensor.get(0, 0, 0, 0)).sqrt();
        self
    }
}

/// The strength of the stabilising term, for scenes.
pub(super) const STABILISATION: Parameter = Parameter {
    key: "stabilisation",
    about: "Strength of the zero-energy control relative to the bonds of an LPS; 0 switches it off.",
    default: Some(1.0),
    least: 0.0,
    most: 1e6,
    usual: 1.0,
    words: &[],
};

impl<const D: usize> NamedLaw<D> for Correspondence<D> {
    const KEY: &'static str = "correspondence";
    const ABOUT: &'static str = "Elastic correspondence: the local law applied to a deformation gradient averaged over the family.";
    const RATIO: Ratio = Ratio::Any;
    const KINEMATICS: &'static [Kinematics] = Kinematics::ALL;
    const PARAMETERS: &'static [Parameter] = &[Parameter {
        most: f64::MAX,
        ..STABILISATION
    }];

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        let (lambda, shear) = (constants.lambda, constants.shear);
        Arc::new(Self::new(constants.influence, lambda, shear, values[0]))
    }
}

impl<const D: usize> Law<D> for Correspondence<D> {
    fn name(&self) -> &'static str {
        "correspondence"
    }

    fn linearised(&self) -> &dyn LinearForceState<D> {
        self
    }

    fn force_state(&self) -> Option<&dyn ForceState<D>> {
        None
    }

    fn accelerator(&self) -> Option<Accelerator> {
        None
    }

    fn local_law(&self) -> Option<Arc<dyn LocalLaw<D>>> {
        None
    }

    fn linearity(&self) -> Linearity {
        Linearity::Always
    }

    fn departure(&self, _strain: &Tensor<D>, _time: f64) -> Departure {
        Departure::None
    }

    fn has_breakable_bonds(&self) -> bool {
        false
    }

    fn parameters(&self) -> Parameters<'_, D> {
        Parameters::Typed
    }

    fn bond_energy(&self, _horizon: f64) -> Option<BondEnergy> {
        None
    }
}

impl<const D: usize> LinearForceState<D> for Correspondence<D> {
    fn kind(&self) -> ForceStateKind {
        ForceStateKind::NonOrdinary
    }

    fn fitted_to(&self, _stress: StressFit) -> Option<Box<dyn LinearForceState<D> + '_>> {
        None
    }

    fn divergence(&self) -> Influence {
        self.influence
    }

    fn tensor(&self) -> &Tensor4<D> {
        &self.tensor
    }

    fn kernel(&self, r: f64, horizon: f64) -> f64 {
        self.influence.value(r, horizon) / (r * r)
    }

    fn shell_target(&self) -> Option<ShellTarget> {
        None
    }

    fn moment_conditions(
        &self,
        _bonds: &[(Vector<D>, f64)],
        _horizon: f64,
    ) -> Option<(Vec<f64>, MomentConditions<D>)> {
        None
    }

    fn coefficients(
        &self,
        family: &Family<'_, D>,
        pair: &mut [f64],
        omega: &mut [f64],
    ) -> Result<Option<StatePart<D>>, PdError> {
        let mut shape = Tensor::<D>::zeros();
        for (k, xi) in family.bonds.iter().enumerate() {
            pair[k] = 0.0;
            omega[k] = self.influence.value(xi.norm(), family.horizon);
            shape += xi * xi.transpose() * (omega[k] * family.volumes[k]);
        }
        let inverse = invert_shape_tensor(&shape, family.bonds.len())?;
        let d = D as f64;
        let q = self.stabilisation * d * (d + 2.0) * self.shear / shape.trace();
        let (q, control) = match self.control {
            ZeroEnergyControl::BondForce => (q, 0.0),
            ZeroEnergyControl::Length => (q / d, q),
            ZeroEnergyControl::Drag => (0.0, q * family.horizon * self.slowness),
        };
        let mut modulus = Tensor4::zeros();
        for i in 0..D {
            for a in 0..D {
                let mut t = Tensor::<D>::zeros();
                for j in 0..D {
                    t += self.tensor.0[i][j] * inverse * inverse[(j, a)];
                }
                for b in 0..D {
                    t[(i, b)] -= q * inverse[(a, b)];
                }
                modulus.0[i][a] = t;
            }
        }
        Ok(Some(StatePart {
            modulus,
            stabilisation: q,
            control,
            deviator: 0.0,
            second: Tensor::zeros(),
            shape,
        }))
    }
}
