//! Balanced rows: between a splice's and a blending's, so that their out-of-balance forces cancel.

use crate::{
    coupling::{
        BlendingFunction, Operator,
        blending::{self, Blended, SpliceShare},
    },
    mesh::Mesh,
    model::{CellRole, Interface, Model, ModelError, Reach, Zone, ZoneLayout},
    peridynamics::{LinearForceState, PdBody},
    system::Symmetry,
};

/// Rows between those of a splice and of a blending, with a step in β at the edge of the nonlocal zone unless a function is given.
///
/// Source: none; derived in `docs/methods.md`, section 8. Under a field with a third derivative the internal forces of a splice add up to `(M₆ − g) u‴/24` at a seam, those of a blending to
/// `−(M₆′ − g) u‴/24` whatever the width of β (`bondline verify balance`). Here `M₆` and `M₆′` are sixth moments of the bonds, and `g = 2 C h²` belongs to elements of the size h. With the share `s` of the splice the sum vanishes
/// if `s (M₆ − g) = (1 − s)(M₆′ − g)`. For the pairwise part `M₆′ = M₆`, hence `s = ½`. For the state part the dilatation reaches over two horizons and its expansion over one: `M₆ = 8 L K′`, `M₆′ = 2 L K′`, `g = 2 h² K′` with
/// `L = 3 Σω|ξ|⁴V / ((D + 2) Σω|ξ|²V)` \[m²\], hence `s = (L − h²)/(5 L − 2 h²)`.
///
/// With a function β varies through the transition zone; without one a transition zone is local. The stiffness is not symmetric. If elements have the spacing of the lattice, cubic and quartic fields leave no force for pairwise laws, and for
/// state-based ones in 1D. In 2D and 3D `Σω|ξ|⁴` is not isotropic for the latter, and a small force remains. Coarser elements leave the error of their own discretisation.
#[derive(Clone, Copy, Debug, Default)]
pub struct Balanced {
    /// β in the transition zone; none for a step at the edge of the nonlocal zone.
    pub function: Option<BlendingFunction>,
}

impl<const D: usize> ZoneLayout<D> for Balanced {
    fn name(&self) -> &'static str {
        "balanced"
    }

    fn interface(&self) -> Interface {
        Interface::OVERLAP
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Unsymmetric
    }

    fn roles(&self, mesh: &Mesh<D>, zones: &[Zone], largest_horizon: f64) -> Vec<CellRole> {
        let outermost = match self.function {
            Some(_) => Zone::Transition,
            None => Zone::Nonlocal,
        };
        blending::with_collar(mesh, zones, outermost, largest_horizon * blending::CLOSED)
    }

    fn reach(&self, law: &dyn LinearForceState<D>) -> Reach {
        Reach::of_bond_forces(law)
    }

    fn takes_deviators(&self) -> bool {
        true
    }
}

coupling_by_rows!(Balanced);

impl Balanced {
    fn rows<'a, const D: usize>(&self, model: &'a Model<D>) -> Result<Operator<'a, D>, ModelError> {
        let Some(body) = model.body() else {
            return Ok(super::uncoupled::own_model(model));
        };
        let share = SpliceShare {
            pair: 0.5,
            state: state_share(body, model.spacing()),
        };
        let beta = blending::at_points(self.function, model, body);
        Ok(Blended::new(model, body, beta, share)?.operator())
    }
}

/// Returns the share of the splice for the state part of the law, by the moments of all families of the largest size: with one of them alone the result would depend on
/// the numbering of points that lie on no lattice.
fn state_share<const D: usize>(body: &PdBody<D>, spacing: f64) -> f64 {
    let size = |i: usize| body.families.of(i).len();
    let largest = (0..body.families.len()).map(size).max().unwrap_or(0);
    let (mut second, mut fourth) = (0.0, 0.0);
    for i in (0..body.families.len()).filter(|&i| size(i) == largest) {
        if body.state(i).is_none() {
            return 0.5;
        }
        let (_, omega) = body.kernel(i);
        for (&j, omega) in body.families.of(i).iter().zip(omega) {
            let square = body.bond(i, j as usize).norm_squared();
            let weight = omega * body.cloud.volume[j as usize];
            second += weight * square;
            fourth += weight * square * square;
        }
    }
    if second <= 0.0 {
        return 0.5;
    }
    let length = 3.0 * fourth / ((D as f64 + 2.0) * second);
    let grid = spacing * spacing;
    (length - grid) / (5.0 * length - 2.0 * grid)
}
