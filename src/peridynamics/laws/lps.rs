//! The linear peridynamic solid (LPS), any Poisson ratio.

use std::sync::Arc;

use super::{Constants, NamedLaw, Parameter, Ratio, SOFTENING};
use crate::{
    material::{Kinematics, LocalLaw},
    peridynamics::{
        Accelerator, BondEnergy, DeformedFamily, Departure, EnergyDensity, Family, ForceState,
        ForceStateKind, HistoryLayout, Influence, Law, LinearForceState, Linearity,
        MomentConditions, Parameters, Past, PdError, PointStress, Present, ShellTarget, StatePart,
        StressFit, moment_fitted_weights,
    },
    tensor::{Tensor, Tensor4, Vector},
};

/// Linear peridynamic solid, an ordinary state-based law.
///
/// Source: [SAND2015-7998] eq. (5.16), with the dilatation θ of (5.17) and the weighted volume m of (5.18), for `D` dimensions with `k` the bulk modulus of `D` dimensions (`λ + 2μ/D`):
///
/// ```text
/// T⟨ξ⟩ = (D k − (D+2) μ)/m  ω θ ξ  +  D(D+2) μ/m  ω  ξ (ξ·η)/|ξ|² ,     θ = D/m Σ ω ξ·η V ,   m = Σ ω |ξ|² V
/// ```
///
/// In 3D the factors are those of the report: `3k − 5μ`, `15 μ` and `3/m`. The stored energy density is
///
/// ```text
/// W = ½ K′ θ² + ½ α Σ ω e² V ,     α = D(D+2) μ/m ,   K′ = k − (D+2) μ/D = λ − μ ,   e = ξ·η/|ξ|
/// ```
///
/// With geometrically exact bonds `e = |ξ + η| − |ξ|`, and T points along the deformed bond. A broken bond leaves the sums over `e` and for θ; m stays that of the whole family.
#[derive(Clone, Debug)]
pub struct LinearPeridynamicSolid<const D: usize> {
    /// The influence function ω.
    pub influence: Influence,
    bulk: f64,
    shear: f64,
    tensor: Tensor4<D>,
}

impl<const D: usize> LinearPeridynamicSolid<D> {
    /// An LPS with the Lamé parameters of `D` dimensions \[Pa\].
    pub fn new(influence: Influence, lambda: f64, mu: f64) -> Self {
        Self {
            influence,
            bulk: lambda + 2.0 * mu / D as f64,
            shear: mu,
            tensor: Tensor4::isotropic(lambda, mu),
        }
    }
}

impl<const D: usize> NamedLaw<D> for LinearPeridynamicSolid<D> {
    const KEY: &'static str = "lps";
    const ABOUT: &'static str =
        "Ordinary state-based law (linear peridynamic solid), any Poisson ratio.";
    const RATIO: Ratio = Ratio::Any;
    const KINEMATICS: &'static [Kinematics] = Kinematics::ALL;
    const PARAMETERS: &'static [Parameter] = &[SOFTENING];

    fn build(constants: Constants, _values: &[f64]) -> Arc<dyn Law<D>> {
        let (lambda, shear) = (constants.lambda, constants.shear);
        Arc::new(Self::new(constants.influence, lambda, shear))
    }
}

impl<const D: usize> Law<D> for LinearPeridynamicSolid<D> {
    fn name(&self) -> &'static str {
        "linear peridynamic solid"
    }

    fn linearised(&self) -> &dyn LinearForceState<D> {
        self
    }

    fn force_state(&self) -> Option<&dyn ForceState<D>> {
        Some(self)
    }

    fn accelerator(&self) -> Option<Accelerator> {
        Some(Accelerator::Solid {
            bulk: self.bulk,
            shear: self.shear,
        })
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
        true
    }

    fn parameters(&self) -> Parameters<'_, D> {
        Parameters::Typed
    }

    fn bond_energy(&self, _horizon: f64) -> Option<BondEnergy> {
        Some(BondEnergy::Lps {
            influence: self.influence,
            bulk: self.bulk,
            shear: self.shear,
        })
    }
}

impl<const D: usize> LinearForceState<D> for LinearPeridynamicSolid<D> {
    fn kind(&self) -> ForceStateKind {
        ForceStateKind::Ordinary
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
        Some(ShellTarget::Isotropy)
    }

    fn moment_conditions(
        &self,
        bonds: &[(Vector<D>, f64)],
        horizon: f64,
    ) -> Option<(Vec<f64>, MomentConditions<D>)> {
        let omega: Vec<f64> = bonds
            .iter()
            .map(|(xi, _)| self.influence.value(xi.norm(), horizon))
            .collect();
        let m = moment_fitted_weights::weighted_volume(bonds, &omega);
        Some((omega, MomentConditions::lps(m)))
    }

    fn coefficients(
        &self,
        family: &Family<'_, D>,
        pair: &mut [f64],
        omega: &mut [f64],
    ) -> Result<Option<StatePart<D>>, PdError> {
        let mut shape = Tensor::<D>::zeros();
        for (k, xi) in family.bonds.iter().enumerate() {
            omega[k] = family.factors[k] * self.influence.value(xi.norm(), family.horizon_of(k));
            shape += xi * xi.transpose() * (omega[k] * family.volumes[k]);
        }
        let m = shape.trace();
        if m.is_nan() || m <= 0.0 {
            return Err(PdError::EmptyFamily);
        }
        let d = D as f64;
        for (k, xi) in family.bonds.iter().enumerate() {
            pair[k] = d * (d + 2.0) * self.shear / m * omega[k] / xi.norm_squared();
        }
        let factor = (d * self.bulk - (d + 2.0) * self.shear) / m * d / m;
        let mut modulus = Tensor4::zeros();
        for i in 0..D {
            modulus.0[i][i] = Tensor::identity() * factor;
        }
        Ok(Some(StatePart {
            modulus,
            stabilisation: 0.0,
            control: 0.0,
            deviator: 0.0,
            second: Tensor::zeros(),
            shape,
        }))
    }
}

impl<const D: usize> ForceState<D> for LinearPeridynamicSolid<D> {
    fn history(&self) -> HistoryLayout {
        HistoryLayout::NONE
    }

    fn respond(
        &self,
        family: &DeformedFamily<'_, D>,
        _step: f64,
        _past: Past<'_>,
        _present: Present<'_>,
        force: &mut [Vector<D>],
    ) -> EnergyDensity {
        // `theta` is θ m/D over intact bonds, `modulus` its factor (D k − (D+2) μ)/m · D/m
        let (mut theta, mut stored) = (0.0, 0.0);
        for (k, e) in family.extension.iter().enumerate() {
            theta += family.omega[k] * family.bonds[k].norm() * e * family.volumes[k];
        }
        let modulus = family.state.map_or(0.0, |s| s.modulus.get(0, 0, 0, 0));
        for (k, force) in force.iter_mut().enumerate() {
            let (e, r) = (family.extension[k], family.bonds[k].norm());
            let pairwise = family.pair[k] * r * r * e;
            *force = family.direction[k] * (pairwise + modulus * theta * family.omega[k] * r);
            stored += 0.5 * pairwise * e * family.volumes[k];
        }
        EnergyDensity {
            stored: stored + 0.5 * modulus * theta * theta,
            dissipated: 0.0,
        }
    }

    fn correspondence(&self, _material: Option<u16>) -> Option<PointStress<'_, D>> {
        None
    }

    fn is_objective(&self) -> bool {
        true
    }

    fn energy_ratio(&self, _s: f64) -> f64 {
        1.0
    }
}
