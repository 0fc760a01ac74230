//! The linearised bond-based material, `T⟨ξ⟩ = ½ λ(|ξ|) ξ (ξ · η)`.

use crate::{
    peridynamics::{
        BondEnergy, BondLaw, Conditions, Family, Micromodulus, PdError, ShellTarget, StatePart,
    },
    tensor::{Tensor4, Vector},
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

impl<const D: usize> BondLaw<D> for BondBased<D> {
    fn name(&self) -> &'static str {
        "bond-based"
    }

    fn is_pairwise(&self) -> bool {
        true
    }

    fn tensor(&self) -> &Tensor4<D> {
        &self.tensor
    }

    fn bond_energy(&self, horizon: f64) -> Option<BondEnergy> {
        let c1111 = self.tensor.get(0, 0, 0, 0);
        Some(BondEnergy::Pairwise {
            micromodulus: self.micromodulus,
            constant: self.micromodulus.constant::<D>(horizon, c1111),
        })
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
    ) -> Option<(Vec<f64>, Conditions<D>)> {
        let lambda = bonds
            .iter()
            .map(|(xi, _)| self.kernel(xi.norm(), horizon))
            .collect();
        Some((lambda, Conditions::bond_based(&self.tensor)))
    }

    fn coefficients(
        &self,
        family: &Family<'_, D>,
        pair: &mut [f64],
        _omega: &mut [f64],
    ) -> Result<Option<StatePart<D>>, PdError> {
        let c = self
            .micromodulus
            .constant::<D>(family.horizon, self.tensor.get(0, 0, 0, 0));
        for (k, xi) in family.bonds.iter().enumerate() {
            pair[k] =
                0.5 * c * family.factors[k] * self.micromodulus.shape(xi.norm(), family.horizon);
        }
        Ok(None)
    }
}
