//! Force-based blending of peridynamics and classical elasticity.

use std::sync::Arc;

use crate::{
    assembly::Row,
    coupling::{BodyBonds, Definiteness, Operator, Term, uncoupled::own_elements},
    mesh::Mesh,
    model::{
        CellRole, Interface, Model, ModelError, Reach, Zone, ZoneLayout,
        held_families::depth_of_seam,
        least_squares_gradient::{self, DerivativeWeights},
        zone_distance::Edge,
    },
    parallel,
    peridynamics::{LinearForceState, PdBody},
    system::Symmetry,
    tensor::{Tensor, Vector},
};

/// Shape of the blending function.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "BetaSpec")]
pub enum BlendingFunction {
    /// One half throughout the transition zone.
    Constant,
    /// Straight.
    Linear,
    /// The cubic `3 s² - 2 s³`.
    #[default]
    Smooth,
}

impl BlendingFunction {
    /// `β̂` of [SAND2015-7998] eq. (3.9) at the relative distance `s` from the local side.
    pub fn value(self, s: f64) -> f64 {
        match self {
            Self::Constant => 0.5,
            Self::Linear => s,
            Self::Smooth => s * s * (3.0 - 2.0 * s),
        }
    }
}

/// Force-based blending, [SAND2015-7998] eq. (3.14), with β of (3.9), the weights (3.12) and the expansion (3.13); extended to state-based laws.
///
/// The transition zone of the scene is the blending region `B_b`. Points fill it and a collar of one horizon around it, since a bond has the weight
/// `w = (β(x) + β(x′))/2`, which is not 0 there. The remaining share `1 − w` of the force acts on the Taylor expansion of the displacement at the
/// point itself, whose first and second derivatives are least-squares fits to the nearest points.
///
/// For a state-based law `T⟨ξ⟩ = p ξ(ξ·η) + ω (𝓜:Ḡ) ξ` the expansion takes `Ḡ ≈ ∇u K` and, at the other end of the bond, `Ḡ′ ≈ (∇u + ξ·∇∇u) K′`, with the shape tensor K. For a law with a [`StatePart::deviator`](crate::peridynamics::StatePart::deviator) it takes
/// `B ≈ P : ∇u` and `B′ ≈ P′ : (∇u + ξ·∇∇u)`. Each end has the coefficients of its own family, so that an affine field has the force of peridynamics at surfaces too.
#[derive(Clone, Copy, Debug)]
pub struct Blending {
    /// β in the blending region.
    pub function: BlendingFunction,
}

impl<const D: usize> ZoneLayout<D> for Blending {
    fn name(&self) -> &'static str {
        "blending"
    }

    fn interface(&self) -> Interface {
        Interface::OVERLAP
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Unsymmetric
    }

    fn roles(&self, mesh: &Mesh<D>, zones: &[Zone], largest_horizon: f64) -> Vec<CellRole> {
        let horizons = match self.function {
            BlendingFunction::Constant => CLOSED,
            _ => OPEN,
        };
        with_collar(mesh, zones, Zone::Transition, largest_horizon * horizons)
    }

    fn reach(&self, law: &dyn LinearForceState<D>) -> Reach {
        Reach::of_bond_forces(law)
    }

    fn takes_deviators(&self) -> bool {
        true
    }

    fn families_of_all(&self, law: &dyn LinearForceState<D>) -> Option<usize> {
        Some(depth_of_seam(law.is_pairwise()))
    }
}

coupling_by_rows!(Blending);

impl Blending {
    fn rows<'a, const D: usize>(&self, model: &'a Model<D>) -> Result<Operator<'a, D>, ModelError> {
        let Some(body) = model.body() else {
            return Ok(super::uncoupled::own_model(model));
        };
        let beta = at_points(Some(self.function), model, body);
        let rows = Blended::new(model, body, beta, SpliceShare::default())?;
        Ok(rows.operator())
    }
}

/// Just beyond a horizon: where β jumps, bonds of exactly one horizon have weight too.
pub(super) const CLOSED: f64 = 1.0 + 1e-6;

/// Just below a horizon: where β is 0 at the edge, bonds of exactly one horizon have no weight.
const OPEN: f64 = 1.0 - 1e-9;

/// Returns the roles of cells: points in the nonlocal zone, in the zone `outermost` and in a collar of width `reach` \[m\] around them, elements elsewhere.
///
/// With a collar of one horizon the points cover `B_t` of [SAND2015-7998] eq. (3.11), where the mean (3.10) of β over a family lies between 0 and 1.
pub(super) fn with_collar<const D: usize>(
    mesh: &Mesh<D>,
    zones: &[Zone],
    outermost: Zone,
    reach: f64,
) -> Vec<CellRole> {
    let filled = |c: usize| zones[c] == Zone::Nonlocal || zones[c] == outermost;
    let edge = Edge::of(mesh, filled);
    let is_near = |&n: &u32| edge.within(&mesh.nodes[n as usize], reach);
    // what is left of a cut cell lies beyond a rim that holds the whole collar, wherever its nodes lie
    let is_cut = |c: usize| mesh.embedded.cut_cell(c).is_some();
    let role = |c| match filled(c) || !is_cut(c) && mesh.cell(c).iter().any(is_near) {
        true => CellRole::Points,
        false => CellRole::Element,
    };
    (0..mesh.cell_count()).map(role).collect()
}

/// β of [SAND2015-7998] eq. (3.9) at every point of the cloud: 1 in the nonlocal zone, 0 in the local one, `function` in between or, without one, 0.
pub(super) fn at_points<const D: usize>(
    function: Option<BlendingFunction>,
    model: &Model<D>,
    body: &PdBody<D>,
) -> Vec<f64> {
    let (mesh, zones) = (&model.mesh, &model.zones);
    let outer = Edge::of(mesh, |c| zones[c] == Zone::Local);
    let inner = Edge::of(mesh, |c| zones[c] == Zone::Nonlocal);
    (0..body.cloud.position.len())
        .map(|p| match model.zone_of_point(p) {
            Zone::Local => 0.0,
            Zone::Nonlocal => 1.0,
            Zone::Transition => {
                let x = &body.cloud.position[p];
                let (to_local, to_nonlocal) = (outer.distance(x), inner.distance(x));
                let s = match (to_local.is_finite(), to_nonlocal.is_finite()) {
                    (true, true) => to_local / (to_local + to_nonlocal),
                    (true, false) => 0.0,
                    _ => 1.0,
                };
                function.map_or(0.0, |f| f.value(s))
            }
        })
        .collect()
}

/// Share s of the splice weighting in a row, for the pairwise part and for the state part of a law; the rest is that of a blending.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SpliceShare {
    pub pair: f64,
    pub state: f64,
}

/// Rows of bonds with the weights `s β(x) + (1 − s) (β(x) + β(x′))/2`, and the remainder expanded at the point itself.
pub(super) struct Blended<'a, const D: usize> {
    model: &'a Model<D>,
    body: &'a PdBody<D>,
    beta: Vec<f64>,
    share: SpliceShare,
    /// For each point; none where all bonds have the weight 1.
    derivatives: Vec<Option<DerivativeWeights<D>>>,
}

impl<'a, const D: usize> Blended<'a, D> {
    /// Rows for β at the points of the body.
    pub fn new(
        model: &'a Model<D>,
        body: &'a PdBody<D>,
        beta: Vec<f64>,
        share: SpliceShare,
    ) -> Result<Self, ModelError> {
        if body.cloud.horizon.uniform().is_none() {
            return Err(ModelError::Unsupported {
                what: "force-based blending with a horizon that varies",
                remedy: "give one horizon, or use splice or partial-stress",
            });
        }
        let derivatives = parallel::try_map(body.cloud.position.len(), 1, |i| {
            let family = body.families.of(i);
            if family.iter().all(|&j| beta[i] + beta[j as usize] == 2.0) {
                return Ok(None);
            }
            let bond = |&j: &u32| (j, body.bond(i, j as usize));
            let neighbours: Vec<(u32, Vector<D>)> = family.iter().map(bond).collect();
            let weights = least_squares_gradient::quadratic(model.spacing(), &neighbours);
            weights.map(Some).ok_or_else(|| ModelError::Derivative {
                position: body.cloud.position[i].iter().copied().collect(),
                bonds: family.len(),
            })
        })?;
        Ok(Self {
            model,
            body,
            beta,
            share,
            derivatives,
        })
    }

    /// The weights of the bond from point `i` to point `j`, for the pairwise part and for the state part: `(β(x) + β(x′))/2` of [SAND2015-7998] eq. (3.12) where the splice has no share.
    fn weights(&self, i: usize, j: usize) -> [f64; 2] {
        let (own, mean) = (self.beta[i], 0.5 * (self.beta[i] + self.beta[j]));
        [self.share.pair, self.share.state].map(|s| s * own + (1.0 - s) * mean)
    }
}

impl<'a, const D: usize> Blended<'a, D> {
    /// Finite elements, the bonds where β is 1 all around, and weighted bonds with their remainder: [SAND2015-7998] eq. (3.14).
    pub fn operator(self) -> Operator<'a, D> {
        let model = self.model;
        let rows = Arc::new(self);
        let [of_bonds, of_beta] = [Arc::clone(&rows), Arc::clone(&rows)];
        let point = |site: usize| model.point_of(site).map(|(_, i)| i);
        let is_alone = move |site| point(site).is_some_and(|i| of_bonds.is_alone(i));
        Operator {
            model,
            terms: vec![
                own_elements(model),
                Term::Bonds(BodyBonds::alone(is_alone)),
                Term::Rows(Box::new(move |site, row| {
                    let Some(i) = point(site).filter(|i| !rows.is_alone(*i)) else {
                        return;
                    };
                    rows.body
                        .add_force_row_of_parts(i, |j| rows.weights(i, j), row);
                    if let Some(derivatives) = &rows.derivatives[i] {
                        rows.add_remainder(i, derivatives, row);
                    }
                })),
            ],
            beta: Box::new(move |site| point(site).map_or(0.0, |i| of_beta.beta[i])),
            counts_materials: false,
            definiteness: Definiteness::SumOfSquares,
        }
    }

    /// Returns true if the row of a point is that of its bonds, unweighted.
    fn is_alone(&self, i: usize) -> bool {
        self.beta[i] == 1.0 && self.derivatives[i].is_none()
    }
}

impl<const D: usize> Blended<'_, D> {
    /// Adds the remainder, expanded at the point by [SAND2015-7998] eq. (3.13): the second and third terms of (3.14), whose first term is the weighted row.
    fn add_remainder(&self, i: usize, at: &DerivativeWeights<D>, row: &mut Row<D>) {
        let body = self.body;
        let (pair, omega) = body.kernel(i);
        // moments of the remainder: force_c = first[b]_ce ∂_b u_e + second[b][d]_ce ∂_b ∂_d u_e
        let mut first = [Tensor::<D>::zeros(); D];
        let mut second = [[Tensor::<D>::zeros(); D]; D];
        let family = body.families.of(i);
        for (k, &j) in family.iter().enumerate() {
            let j = j as usize;
            let xi = body.bond(i, j);
            let [rest, of_state] = self.weights(i, j).map(|w| (1.0 - w) * body.cloud.volume[j]);
            if rest == 0.0 && of_state == 0.0 {
                continue;
            }
            // the force states of both ends, each with the coefficients of its own family: at a surface they differ
            let own = (pair[k], omega.get(k).copied().unwrap_or(0.0));
            let far = body.far_coefficients(i, k);
            let mut block = xi * xi.transpose() * (rest * (own.0 + far.0));
            if let (Some(state), Some(state_far)) = (body.state(i), body.state(j)) {
                let q = state.stabilisation * own.1 + state_far.stabilisation * far.1;
                block += Tensor::identity() * (q * rest);
                let here = body.state_force_of_gradient(i, &xi, own);
                let there = body.state_force_of_gradient(j, &xi, far);
                for b in 0..D {
                    first[b] += (here[b] + there[b]) * of_state;
                    // the change of G along the bond
                    for d in 0..D {
                        second[b][d] += there[b] * (xi[d] * of_state);
                    }
                }
            }
            for b in 0..D {
                first[b] += block * xi[b];
                for d in 0..D {
                    second[b][d] += block * (0.5 * xi[b] * xi[d]);
                }
            }
        }
        let mut own = Tensor::zeros();
        for (n, &j) in at.neighbours.iter().enumerate() {
            let mut block = Tensor::zeros();
            for b in 0..D {
                block -= first[b] * at.gradient[n][b];
                for d in 0..D {
                    block -= second[b][d] * at.hessian[n][(b, d)];
                }
            }
            block *= body.cloud.volume[i];
            own -= block;
            row.add(&body.cloud.transfer, j as usize, &block);
        }
        row.add(&body.cloud.transfer, i, &own);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::SceneModel;
    use crate::run::block::Block;

    /// A block that the collar fills to its surfaces: the largest difference of any row from that of peridynamics alone, whose families lack bonds there, under affine fields, over the largest force.
    fn difference_from_peridynamics<const D: usize>(material: [&str; 2]) -> f64 {
        let block = Block {
            coupling: "\"blending\"",
            material,
            influence: "",
            size: 1,
            has_triangles: false,
            widths: [2, 2, 1],
            ratio: 2,
            origin: 0.0,
        };
        let SceneModel {
            model, coupling, ..
        } = block.model::<D>();
        let operator = coupling.operator(&model).unwrap();
        let sites = model.sites.len();
        let mut row = Row::<D>::new(sites);
        // one component of the gradient each, repeated where they are fewer than nine
        let fields: [Vec<f64>; 9] = std::array::from_fn(|k| {
            let (a, b) = (k / D % D, k % D);
            let mut u = vec![0.0; sites * D];
            for (u, site) in u.chunks_mut(D).zip(&model.sites) {
                u[a] = site.position[b];
            }
            u
        });
        let fields = fields.each_ref().map(Vec::as_slice);
        let (mut difference, mut largest) = (0.0f64, 0.0f64);
        for site in 0..sites {
            let (body, i) = model.point_of(site).expect("the collar fills the block");
            operator.add_row(site, &mut row);
            let blended = row.take_products(fields);
            body.add_force_row(i, |_| 1.0, &mut row);
            let whole = row.take_products(fields);
            for (blended, whole) in blended.iter().zip(&whole) {
                difference = difference.max((blended - whole).amax());
                largest = largest.max(whole.amax());
            }
        }
        assert!(largest > 0.0);
        difference / largest
    }

    #[test]
    fn affine_fields_have_the_forces_of_peridynamics_at_surfaces_too() {
        for law in ["lps", "pals"] {
            let material = [law, "poisson-ratio = 0.3\n"];
            let found = [
                difference_from_peridynamics::<2>(material),
                difference_from_peridynamics::<3>(material),
            ];
            assert!(found.iter().all(|d| *d < 1e-12), "{law}: {found:?}");
        }
        let found = difference_from_peridynamics::<2>(["bond-based", ""]);
        assert!(found < 1e-12, "bond-based: {found:e}");
    }
}
