//! The bond-based material: `T⟨ξ⟩ = ½ λ(|ξ|) ξ (ξ · η)` to first order, `½ λ |ξ|² e M` with geometrically exact bonds (prototype microelastic brittle).

use std::sync::Arc;

use super::{Constants, NamedLaw, Parameter, Ratio, SOFTENING};
use crate::{
    material::{Kinematics, LocalLaw},
    peridynamics::{
        Accelerator, BondEnergy, DeformedFamily, Departure, EnergyDensity, Family, ForceState,
        ForceStateKind, HistoryLayout, Influence, Law, LinearForceState, Linearity, Micromodulus,
        MomentConditions, Parameters, Past, PdError, PointStress, Present, ShellTarget, StatePart,
        StressFit,
        influence::{Alpha, Degree},
    },
    tensor::{Tensor, Tensor4, Vector},
};

/// `P_1/|ξ|`, ω of the divergence of the partial stress beside a triangular micromodulus, which is `P_1/|ξ|` too: stable in motion, where a Gaussian grows. Beside the inverse distance it is the other way round.
const DIVERGENCE: Influence = Influence::Polynomial {
    degree: Degree::P1,
    alpha: Alpha::One,
};

/// Linearised bond-based material with a general micromodulus.
///
/// Source: [SAND2015-7998] eq. (3.1). Each of the two points of a bond carries half of `λ ξ ⊗ ξ η`.
/// Its Poisson ratio is fixed: 1/4 in 3D and plane strain, 1/3 in plane stress ([SAND2015-7998] section 3.2).
#[derive(Clone, Debug)]
pub struct BondBased<const D: usize> {
    /// The shape of λ(|ξ|).
    pub micromodulus: Micromodulus,
    tensor: Tensor4<D>,
}

impl<const D: usize> BondBased<D> {
    /// A bond-based material whose classical limit is `C_1122 = strength`, `C_1111 = 3 strength` (in 1D `C = 3 strength`) \[Pa\].
    pub fn new(micromodulus: Micromodulus, strength: f64) -> Self {
        Self {
            micromodulus,
            tensor: Tensor4::isotropic(strength, strength),
        }
    }
}

impl<const D: usize> NamedLaw<D> for BondBased<D> {
    const KEY: &'static str = "bond-based";
    const ABOUT: &'static str = "Bonds that act alone; Poisson's ratio follows (1/3 in plane stress, 1/4 in plane strain and solids).";
    const RATIO: Ratio = Ratio::Pairwise;
    const KINEMATICS: &'static [Kinematics] = Kinematics::ALL;
    const PARAMETERS: &'static [Parameter] = &[SOFTENING];

    fn build(constants: Constants, _values: &[f64]) -> Arc<dyn Law<D>> {
        Arc::new(Self::new(constants.micromodulus, constants.shear))
    }
}

impl<const D: usize> Law<D> for BondBased<D> {
    fn name(&self) -> &'static str {
        "bond-based"
    }

    fn linearised(&self) -> &dyn LinearForceState<D> {
        self
    }

    fn force_state(&self) -> Option<&dyn ForceState<D>> {
        Some(self)
    }

    fn accelerator(&self) -> Option<Accelerator> {
        Some(Accelerator::Pairwise)
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

    fn bond_energy(&self, horizon: f64) -> Option<BondEnergy> {
        let c1111 = self.tensor.get(0, 0, 0, 0);
        Some(BondEnergy::Pairwise {
            micromodulus: self.micromodulus,
            constant: self.micromodulus.constant::<D>(horizon, c1111),
        })
    }
}

impl<const D: usize> LinearForceState<D> for BondBased<D> {
    fn kind(&self) -> ForceStateKind {
        ForceStateKind::BondBased
    }

    fn fitted_to(&self, _stress: StressFit) -> Option<Box<dyn LinearForceState<D> + '_>> {
        None
    }

    fn divergence(&self) -> Influence {
        match self.micromodulus {
            Micromodulus::Triangular => DIVERGENCE,
            _ => Influence::Gaussian,
        }
    }

    fn tensor(&self) -> &Tensor4<D> {
        &self.tensor
    }

    fn kernel(&self, r: f64, horizon: f64) -> f64 {
        self.micromodulus
            .constant::<D>(horizon, self.tensor.get(0, 0, 0, 0))
            * self.micromodulus.shape(r, horizon)
    }

    fn shell_target(&self) -> Option<ShellTarget> {
        Some(ShellTarget::Strength(2.0 * self.tensor.get(0, 0, 0, 0)))
    }

    fn moment_conditions(
        &self,
        bonds: &[(Vector<D>, f64)],
        horizon: f64,
    ) -> Option<(Vec<f64>, MomentConditions<D>)> {
        let lambda = bonds
            .iter()
            .map(|(xi, _)| self.kernel(xi.norm(), horizon))
            .collect();
        Some((lambda, MomentConditions::bond_based(&self.tensor)))
    }

    fn coefficients(
        &self,
        family: &Family<'_, D>,
        pair: &mut [f64],
        _omega: &mut [f64],
    ) -> Result<Option<StatePart<D>>, PdError> {
        let of_horizon = |horizon: f64| {
            let c1111 = self.tensor.get(0, 0, 0, 0);
            (horizon, self.micromodulus.constant::<D>(horizon, c1111))
        };
        let (mut horizon, mut c) = of_horizon(family.horizon);
        for (k, xi) in family.bonds.iter().enumerate() {
            if family.horizon_of(k) != horizon {
                (horizon, c) = of_horizon(family.horizon_of(k));
            }
            pair[k] = 0.5 * c * family.factors[k] * self.micromodulus.shape(xi.norm(), horizon);
        }
        Ok(None)
    }
}

impl<const D: usize> ForceState<D> for BondBased<D> {
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
        let mut stored = 0.0;
        for (k, force) in force.iter_mut().enumerate() {
            let e = family.extension[k];
            let t = family.pair[k] * family.bonds[k].norm_squared() * e;
            *force = family.direction[k] * t;
            stored += 0.5 * t * e * family.volumes[k];
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
