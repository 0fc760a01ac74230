//! The linearisation of a law at rest, for seams, linear statics and preconditioners.
//!
//! To first order in the relative displacements `η = u(x + ξ) − u(x)` every law has the force state \[N/m^(2D)\]
//!
//! ```text
//! T⟨ξ⟩ = p(ξ) ξ (ξ · η)  +  q ω(ξ) η  +  ω(ξ) (𝓜 : Ḡ) ξ ,      Ḡ = Σ ω η ⊗ ξ V
//! ```
//!
//! with a pairwise part, an optional stabilising part, and a *state part* through the weighted gradient `Ḡ` of the family. A law with [`StatePart::deviator`] adds
//! `− d [ω B + p |ξ|² tr Ḡ] ξ` with `B = Σ p |ξ|² ξ·η V`. The bond-based material has only the first part.
//! In the linear peridynamic solid (LPS) `𝓜 ∝ I ⊗ I` stands for the dilatation, in correspondence 𝓜 stands for the stress. For all laws
//! `body.rs` turns these coefficients into rows of the stiffness and into the partial stress. `T` is the derivative of the energy
//! density `W = ½ Σ [p (ξ · η)² + q ω η²] V + ½ Ḡ : 𝓜 : Ḡ`, so a body of such points alone has a symmetric stiffness.

use crate::{
    peridynamics::{Influence, MomentConditions, PdError, ShellTarget},
    tensor::{Tensor, Tensor4, Vector},
};

/// One family as a law sees it.
///
/// Shapes: `bonds`, `volumes` and `factors` have one entry per intact bond. Units: ξ and δ \[m\], V \[m^D\], factors \[1\].
#[derive(Clone, Copy, Debug)]
pub struct Family<'a, const D: usize> {
    /// Bond vectors ξ.
    pub bonds: &'a [Vector<D>],
    /// Volumes V of the bonds' far points.
    pub volumes: &'a [f64],
    /// Weight of each bond relative to the plain kernel (1 with plain weights).
    pub factors: &'a [f64],
    /// Horizon δ of the family's centre.
    pub horizon: f64,
    /// Horizon of each bond, where bonds have others than the centre; empty elsewhere.
    pub bond_horizons: &'a [f64],
    /// The materials of its points; none in a body of one material.
    pub materials: Option<FamilyMaterials<'a>>,
}

impl<const D: usize> Family<'_, D> {
    /// Horizon of a bond \[m\].
    pub fn horizon_of(&self, bond: usize) -> f64 {
        self.bond_horizons
            .get(bond)
            .copied()
            .unwrap_or(self.horizon)
    }
}

/// The materials of a family's points, by the numbers that [`crate::peridynamics::Several`] has for them.
#[derive(Clone, Copy, Debug)]
pub struct FamilyMaterials<'a> {
    /// Of its centre.
    pub own: u16,
    /// Of the far points, one entry per bond.
    pub far: &'a [u16],
}

/// The state part of a law at one point.
#[derive(Clone, Debug)]
pub struct StatePart<const D: usize> {
    /// `𝓜_iakb` \[Pa/m^(2D+4)\], from `Ḡ_kb` to the `(i, a)` component of the tensor that multiplies `ω ξ_a`.
    pub modulus: Tensor4<D>,
    /// `q` \[Pa/m^(D+2)\], the factor of the stabilising part.
    pub stabilisation: f64,
    /// The strength of a [`crate::peridynamics::ZeroEnergyControl`] that the linearisation does not show: of a length control \[Pa/m^(D+2)\], of a drag \[Pa s/m^(D+2)\].
    pub control: f64,
    /// `d`, of the products `−d tr Ḡ Σ p |ξ|² ξ·η V` in the energy density: `1/D` for a law whose deviatoric extensions `e − θ |ξ|/D` have another influence function than its dilatation θ, else 0.
    pub deviator: f64,
    /// `P = Σ p |ξ|² ξ ⊗ ξ V` \[Pa\] of such a law, `B = P : ∇u` under an affine field; else 0.
    pub second: Tensor<D>,
    /// `K = Σ ω ξ ⊗ ξ V` \[m^(D+2)\], the shape tensor of the family.
    pub shape: Tensor<D>,
}

/// Conditions on the influence functions of an irregular family, beside the energy of all affine fields, so that its partial stress is that of elasticity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StressFit {
    /// None; σ is not negative.
    Positive,
    /// None; σ of any sign where none else meets it.
    Affine,
    /// The partial stress of quadratic fields, where a σ that is not negative meets it; else as [`StressFit::Affine`].
    Quadratic,
}

/// Kinds of force states, by what the force of a bond depends on and by its direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ForceStateKind {
    /// Bonds act independently of each other and along themselves: there is no state part.
    BondBased,
    /// The force of a bond points along it and depends on its family.
    Ordinary,
    /// The same with a [`StatePart::deviator`], which not every coupling can represent.
    OrdinaryWithDeviators,
    /// The force of a bond has any direction.
    NonOrdinary,
}

/// A law linearised at rest: seams, linear statics and preconditioners are made from it.
pub trait LinearForceState<const D: usize>: Send + Sync {
    /// Returns the kind of force state.
    fn kind(&self) -> ForceStateKind;

    /// The law with coefficients that make the partial stress exact under affine fields on irregular families; none where [`LinearForceState::coefficients`], or factors by [`LinearForceState::moment_conditions`], suffice.
    fn fitted_to(&self, stress: StressFit) -> Option<Box<dyn LinearForceState<D> + '_>>;

    /// ω of the divergence of a meshfree partial stress beside this law.
    fn divergence(&self) -> Influence;

    /// The classical elastic tensor that the law is calibrated to \[Pa\].
    fn tensor(&self) -> &Tensor4<D>;

    /// The kernel, at bond length `r` \[m\], whose fourth moments the weights of the shells of a lattice make isotropic.
    fn kernel(&self, r: f64, horizon: f64) -> f64;

    /// Returns the target of the fourth moment of [`LinearForceState::kernel`] on a lattice; `None` if the law needs no correction.
    fn shell_target(&self) -> Option<ShellTarget>;

    /// Coefficients and moment conditions that make the partial stress exact for affine fields on any one family, whose bonds are `(ξ, V)`;
    /// `None` if it is exact without.
    fn moment_conditions(
        &self,
        bonds: &[(Vector<D>, f64)],
        horizon: f64,
    ) -> Option<(Vec<f64>, MomentConditions<D>)>;

    /// Overwrites `pair` with `p` \[Pa/m^(D+4)\] and `omega` with `ω` \[1\] (untouched by a pairwise law), one entry per bond, and returns the state part, if the law has one.
    ///
    /// # Errors
    /// [`PdError`] if the family is too small or degenerate for the law.
    fn coefficients(
        &self,
        family: &Family<'_, D>,
        pair: &mut [f64],
        omega: &mut [f64],
    ) -> Result<Option<StatePart<D>>, PdError>;
}

impl<const D: usize> dyn LinearForceState<D> + '_ {
    /// Returns true if bonds act independently of each other (no state part).
    pub fn is_pairwise(&self) -> bool {
        self.kind() == ForceStateKind::BondBased
    }

    /// Returns true if the force of a bond points along it.
    pub fn is_ordinary(&self) -> bool {
        self.kind() != ForceStateKind::NonOrdinary
    }

    /// Returns true if its state parts have a [`StatePart::deviator`].
    pub fn has_deviators(&self) -> bool {
        self.kind() == ForceStateKind::OrdinaryWithDeviators
    }
}

/// The collapsed tensor C \[Pa\] of a family: `ν⁰ = C : G` under `u = G x`.
///
/// Source: [SAND2015-7998] eq. (2.10), for the linear force state above:
/// `C_ijkl = Σ p ξ_i ξ_j ξ_k ξ_l V + q δ_ik K_jl + 𝓜_iakb K_aj K_bl − d (K_ij P_kl + P_ij K_kl)`.
pub fn collapsed_tensor<const D: usize>(
    family: &Family<'_, D>,
    pair: &[f64],
    state: Option<&StatePart<D>>,
) -> Tensor4<D> {
    let mut c = Tensor4::zeros();
    for (k, xi) in family.bonds.iter().enumerate() {
        c.add_fourth_power(pair[k] * family.volumes[k], xi);
    }
    if let Some(state) = state {
        if state.deviator != 0.0 {
            for i in 0..D {
                for j in 0..D {
                    let products =
                        state.second * state.shape[(i, j)] + state.shape * state.second[(i, j)];
                    c.0[i][j] -= products * state.deviator;
                }
            }
        }
        for i in 0..D {
            for j in 0..D {
                let mut t = Tensor::<D>::zeros();
                for a in 0..D {
                    t += state.modulus.0[i][a] * state.shape * state.shape[(a, j)];
                }
                for l in 0..D {
                    t[(i, l)] += state.stabilisation * state.shape[(j, l)];
                }
                c.0[i][j] += t;
            }
        }
    }
    c
}
