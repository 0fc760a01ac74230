//! The position-aware linear solid (PALS).

use std::sync::Arc;

use super::{Constants, NamedLaw, Parameter, Ratio};
use crate::{
    material::{Kinematics, LocalLaw},
    peridynamics::{
        Accelerator, BondEnergy, CalibrationFields, DeformedFamily, Departure, EnergyDensity,
        Family, ForceState, ForceStateKind, HistoryLayout, Influence, Law, LinearForceState,
        Linearity, MomentConditions, Parameters, Past, PdError, PointStress, Present, ShellTarget,
        StatePart, StressFit,
        position_aware_influence::{self, PositionAware},
    },
    tensor::{Tensor, Tensor4, Vector},
};

/// Ordinary state-based solid whose two influence functions are fitted to every family, so that surfaces do not soften it.
///
/// Source: [SAND2015-7998] eq. (4.9), with ε of (4.5), θ of (4.10) and the force state (4.11), for `D` dimensions with κ the bulk modulus of `D` dimensions (`λ + 2μ/D`):
///
/// ```text
/// W = ½ κ θ² + μ Σ σ ε² V ,     θ = Σ ω |ξ| e V ,     ε = e − θ |ξ|/D
/// T⟨ξ⟩ = [ (κ θ − 2μ/D Σ σ |ξ| ε V) ω |ξ| + 2 μ σ ε ] M
/// ```
///
/// ω and σ are those of [`position_aware_influence::fit`], of the family without cracks in motion: where bonds break, the others keep theirs, and sums go over intact bonds.
#[derive(Clone, Debug)]
pub struct PositionAwareSolid<const D: usize> {
    influence: Influence,
    fields: CalibrationFields,
    bulk: f64,
    shear: f64,
    tensor: Tensor4<D>,
}

impl<const D: usize> PositionAwareSolid<D> {
    /// A position-aware solid with the Lamé parameters of `D` dimensions \[Pa\], its influence functions as near to `influence` as can be.
    pub fn new(influence: Influence, fields: CalibrationFields, lambda: f64, mu: f64) -> Self {
        Self {
            influence,
            fields,
            bulk: lambda + 2.0 * mu / D as f64,
            shear: mu,
            tensor: Tensor4::isotropic(lambda, mu),
        }
    }

    /// That of a scene, by the place of its word among `calibration-fields`.
    pub(super) fn of(constants: Constants, fields: f64) -> Self {
        let fields = match fields {
            0.0 => CalibrationFields::Axes,
            _ => CalibrationFields::Affine,
        };
        let Constants { lambda, shear, .. } = constants;
        Self::new(constants.influence, fields, lambda, shear)
    }

    /// κ of `D` dimensions \[Pa\].
    pub(super) fn bulk(&self) -> f64 {
        self.bulk
    }

    /// The influence function of the scene, bond by bond.
    fn base(&self, family: &Family<'_, D>) -> Vec<f64> {
        (family.bonds.iter().zip(family.factors))
            .map(|(xi, factor)| factor * self.influence.value(xi.norm(), family.horizon))
            .collect()
    }

    /// Overwrites the coefficients of a family with those of its influence functions.
    fn state_part(
        &self,
        family: &Family<'_, D>,
        weights: &PositionAware,
        pair: &mut [f64],
        omega: &mut [f64],
    ) -> StatePart<D> {
        omega.copy_from_slice(&weights.omega);
        let mut shape = Tensor::<D>::zeros();
        let mut second = Tensor::<D>::zeros();
        for (k, xi) in family.bonds.iter().enumerate() {
            let v = family.volumes[k];
            pair[k] = 2.0 * self.shear * weights.sigma[k] / xi.norm_squared();
            shape += xi * xi.transpose() * (omega[k] * v);
            second += xi * xi.transpose() * (2.0 * self.shear * weights.sigma[k] * v);
        }
        // ½ θ² (κ + 2μ/D² Σ σ |ξ|² V): what θ stores in ½ κ θ² and in the square of ε
        let d = D as f64;
        let factor = self.bulk + second.trace() / (d * d);
        let mut modulus = Tensor4::zeros();
        for i in 0..D {
            modulus.0[i][i] = Tensor::identity() * factor;
        }
        StatePart {
            modulus,
            stabilisation: 0.0,
            control: 0.0,
            deviator: 1.0 / d,
            second,
            shape,
        }
    }

    /// θ of a family, [SAND2015-7998] eq. (4.10).
    pub(super) fn dilatation(family: &DeformedFamily<'_, D>) -> f64 {
        let extensions = family.extension.iter().enumerate();
        extensions.fold(0.0, |theta, (k, e)| {
            theta + family.omega[k] * family.bonds[k].norm() * e * family.volumes[k]
        })
    }
}

impl<const D: usize> NamedLaw<D> for PositionAwareSolid<D> {
    const KEY: &'static str = "pals";
    const ABOUT: &'static str =
        "Position-aware linear solid: an LPS whose energy at surfaces is that of elasticity.";
    const RATIO: Ratio = Ratio::Any;
    const KINEMATICS: &'static [Kinematics] = &[
        Kinematics::PlaneStress,
        Kinematics::PlaneStrain,
        Kinematics::Solid,
    ];
    const PARAMETERS: &'static [Parameter] = &[Parameter::words(
        "calibration-fields",
        "Fields under which the energy of every family is exact: uniaxial strains along the axes and shears between them, or all affine ones.",
        &["axes", "affine"],
    )];

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        Arc::new(Self::of(constants, values[0]))
    }
}

impl<const D: usize> Law<D> for PositionAwareSolid<D> {
    fn name(&self) -> &'static str {
        "position-aware linear solid"
    }

    fn linearised(&self) -> &dyn LinearForceState<D> {
        self
    }

    fn force_state(&self) -> Option<&dyn ForceState<D>> {
        Some(self)
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
        true
    }

    fn parameters(&self) -> Parameters<'_, D> {
        Parameters::Typed
    }

    fn bond_energy(&self, _horizon: f64) -> Option<BondEnergy> {
        // a continuous complete family is that of an LPS
        Some(BondEnergy::Lps {
            influence: self.influence,
            bulk: self.bulk,
            shear: self.shear,
        })
    }
}

impl<const D: usize> LinearForceState<D> for PositionAwareSolid<D> {
    fn kind(&self) -> ForceStateKind {
        ForceStateKind::OrdinaryWithDeviators
    }

    fn fitted_to(&self, stress: StressFit) -> Option<Box<dyn LinearForceState<D> + '_>> {
        Some(Box::new(FittedStress { law: self, stress }))
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
        let weights = position_aware_influence::fit(family, &self.base(family), self.fields)?;
        Ok(Some(self.state_part(family, &weights, pair, omega)))
    }
}

/// A position-aware solid with a partial stress that is exact under affine fields on any family, whatever its calibration fields are.
struct FittedStress<'a, const D: usize> {
    law: &'a PositionAwareSolid<D>,
    stress: StressFit,
}

impl<const D: usize> LinearForceState<D> for FittedStress<'_, D> {
    fn kind(&self) -> ForceStateKind {
        self.law.kind()
    }

    fn fitted_to(&self, _stress: StressFit) -> Option<Box<dyn LinearForceState<D> + '_>> {
        None
    }

    fn divergence(&self) -> Influence {
        self.law.divergence()
    }

    fn tensor(&self) -> &Tensor4<D> {
        self.law.tensor()
    }

    fn kernel(&self, r: f64, horizon: f64) -> f64 {
        self.law.kernel(r, horizon)
    }

    fn shell_target(&self) -> Option<ShellTarget> {
        self.law.shell_target()
    }

    fn moment_conditions(
        &self,
        bonds: &[(Vector<D>, f64)],
        horizon: f64,
    ) -> Option<(Vec<f64>, MomentConditions<D>)> {
        self.law.moment_conditions(bonds, horizon)
    }

    fn coefficients(
        &self,
        family: &Family<'_, D>,
        pair: &mut [f64],
        omega: &mut [f64],
    ) -> Result<Option<StatePart<D>>, PdError> {
        let base = self.law.base(family);
        let weights = position_aware_influence::fit_stress(family, &base, self.stress)?;
        Ok(Some(self.law.state_part(family, &weights, pair, omega)))
    }
}

impl<const D: usize> ForceState<D> for PositionAwareSolid<D> {
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
        let d = D as f64;
        let theta = Self::dilatation(family);
        // 2 μ σ = p |ξ|²
        let deviatoric = |k: usize| {
            let r = family.bonds[k].norm();
            let epsilon = family.extension[k] - theta * r / d;
            (r, epsilon, family.pair[k] * r * r * epsilon)
        };
        let (mut product, mut stored) = (0.0, 0.5 * self.bulk * theta * theta);
        for (k, volume) in family.volumes.iter().enumerate() {
            let (r, epsilon, t) = deviatoric(k);
            product += t * r * volume;
            stored += 0.5 * t * epsilon * volume;
        }
        let pressure = self.bulk * theta - product / d;
        for (k, force) in force.iter_mut().enumerate() {
            let (r, _, t) = deviatoric(k);
            *force = family.direction[k] * (pressure * family.omega[k] * r + t);
        }
        EnergyDensity {
            stored,
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
