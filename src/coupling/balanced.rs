//! Balanced rows: part of a splice's and part of a blending's, so that what both leave out of balance cancels.

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

/// Half of a splice's rows and half of a blending's, with a step in β at the edge of the nonlocal zone.
///
/// Source: none; derived in `docs/methods.md`, section 8. Under a field with a third derivative the internal forces of a splice add up to `(M₆ − g) u‴/24` at a seam, those of a blending to
/// `−(M₆′ − g) u‴/24`, whatever the width of β (suite `balance`). The shares `s` of the splice with `s (M₆ − g) = (1 − s)(M₆′ − g)` leave nothing: ½ for what bonds do by
/// themselves. For the state part of a law the dilatation reaches over two horizons and its expansion over one, `M₆ = 8 L K′`, `M₆′ = 2 L K′`, `g = 2 h² K′` with
/// `L = 3 Σω|ξ|⁴V / ((D + 2) Σω|ξ|²V)`, hence `s = (L − h²)/(5 L − 2 h²)`.
///
/// Given a function, β runs through the transition zone instead of jumping; without, a transition zone is local. The stiffness is not symmetric. On meshes of the lattice's spacing nothing is left under cubic and quartic fields, for pairwise laws in 1D, 2D and 3D and for
/// state-based ones in 1D; in 2D and 3D the shape tensors' fourth moments are not isotropic and a little remains. Elements coarser than the lattice leave the error of their own discretisation.
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

/// The share of the splice for the state part of the law, from the moments of the largest families together: of several that are equally large none is
/// preferred, or else the numbering of points that lie on no lattice would decide.
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
