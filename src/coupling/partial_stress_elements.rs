//! Partial stress in finite elements: the stress of a transition cell is the partial stress of peridynamic points at its Gauss points.

use std::sync::Arc;

use crate::coupling::partial_stress_fit::{FamilyFit, shapes};
use crate::{
    coupling::{
        BodyBonds, Definiteness, NO_GAUSS_POINT, Operator, PartialStresses, Term,
        uncoupled::own_elements,
    },
    fem::{self, QuadraturePoint},
    mesh::Mesh,
    model::{CellRole, FitDegree, Interface, Model, ModelError, Reach, Zone, ZoneLayout},
    parallel,
    peridynamics::{
        Cloud, Ends, Factors, Families, LinearForceState, PdBody, PdError, TIE_TOLERANCE,
        alike::{self},
    },
    system::Symmetry,
};

/// Partial stress in finite elements.
///
/// Source: [SAND2015-7998] section 7.3: the cells of the transition zone are finite elements; the material points at their Gauss points are peridynamic points, and
/// their partial stress, eq. (2.19), is the element's stress, whose weak form gives the divergence (2.20) in `B_ps` of (2.29). Nodes at the seam to the peridynamic zone follow a least-squares fit.
/// Differs from it by: the family of a Gauss point holds the points of the peridynamic zone and of its lattice continued through the elements, not other
/// Gauss points, which would be too few in cells coarser than the lattice (9 bonds at m = 2 in cells of 3 h, where 15 conditions have to be met) and eight times too many in matching ones.
///
/// Families of Gauss points are irregular; unless the law is exact there, bond weights are fitted to the fourth moments, so that `ν^ps` is exact for affine fields.
#[derive(Clone, Copy, Debug)]
pub struct PartialStressElements {
    /// Degree of the least-squares fit that nodes of the seam follow (quadratic in the report).
    pub fit: FitDegree,
}

impl<const D: usize> ZoneLayout<D> for PartialStressElements {
    fn name(&self) -> &'static str {
        "partial stress (elements)"
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Unsymmetric
    }

    fn roles(&self, _mesh: &Mesh<D>, zones: &[Zone], _largest_horizon: f64) -> Vec<CellRole> {
        zones
            .iter()
            .map(|zone| match zone {
                Zone::Local => CellRole::Element,
                Zone::Transition => CellRole::StressElement,
                Zone::Nonlocal => CellRole::Points,
            })
            .collect()
    }

    fn interface(&self) -> Interface {
        Interface::constrained(self.fit)
    }

    fn reach(&self, law: &dyn LinearForceState<D>) -> Reach {
        Reach::of_bond_forces(law)
    }

    fn takes_deviators(&self) -> bool {
        true
    }
}

coupling_by_rows!(PartialStressElements);

impl PartialStressElements {
    fn rows<'a, const D: usize>(&self, model: &'a Model<D>) -> Result<Operator<'a, D>, ModelError> {
        Elements::new(model).map(Elements::operator)
    }
}

struct Elements<'a, const D: usize> {
    model: &'a Model<D>,
    /// Points of the peridynamic zone, then Gauss points.
    body: Arc<PdBody<D>>,
    /// First Gauss point of each cell in `body`; [`NO_GAUSS_POINT`] for a cell that is no stress element.
    first: Vec<u32>,
}

impl<'a, const D: usize> Elements<'a, D> {
    fn new(model: &'a Model<D>) -> Result<Self, ModelError> {
        let mesh = &model.mesh;
        let Some((around, peridynamics)) = model.surroundings().zip(model.peridynamics.as_ref())
        else {
            return Err(ModelError::Unsupported {
                what: "partial stress in elements without a transition zone beside a nonlocal zone",
                remedy: "add [zones.transition] around the nonlocal zone, or use coupling.splice",
            });
        };
        let mut cloud = around.clone();
        let points = cloud.position.len();
        let mut first = vec![NO_GAUSS_POINT; mesh.cell_count()];
        let mut horizon = Vec::new();
        let mut quadrature: Vec<QuadraturePoint<D>> = Vec::new();
        for (c, start) in first.iter_mut().enumerate() {
            if model.roles[c] != CellRole::StressElement {
                continue;
            }
            *start = cloud.position.len() as u32;
            fem::quadrature(mesh, c, &mut quadrature);
            for g in &quadrature {
                cloud.position.push(g.position);
                cloud.volume.push(g.weight);
                horizon.push(peridynamics.horizon.at(&g.position));
                let shape = &g.shape[..g.nodes];
                cloud
                    .transfer
                    .push(model.place_row(c as u32, shape, &g.position));
            }
        }
        let fit = FamilyFit::new(model, peridynamics.law.linearised());
        let families = Self::families(model, &cloud, &mut horizon, &fit)?;
        let centres: Vec<usize> = (points..cloud.position.len()).collect();
        let shapes = shapes(&cloud, &families, &centres, |i| horizon[i - points]);
        let first_alike = alike::first_alike(&shapes);
        let fitted: Vec<Result<Vec<f64>, PdError>> =
            parallel::map(shapes.len(), 1, |k| match first_alike[k] == k {
                true => fit.factors(&shapes[k].bonds, shapes[k].horizon),
                false => Ok(Vec::new()),
            });
        let factors = |i: usize| fitted[first_alike[i - points]].clone();
        cloud.horizon = cloud.horizon.followed_by(points, &horizon);
        let fitted = fit.fitted_law();
        let body = PdBody::new(
            cloud,
            families,
            fitted.as_deref().unwrap_or(fit.law),
            &Factors::OfFamily(&factors),
            Ends::Alike,
        )
        .map_err(ModelError::gauss_point)?;
        let body = Arc::new(body);
        Ok(Self { model, body, first })
    }

    /// Families of the Gauss points, which are the last of the cloud and have these horizons.
    ///
    /// At a free surface or edge a family lacks bonds. The rest may be too few for the moment conditions of the law, or may meet them only with negative
    /// weights, which soften the edge. The horizon of such a family is widened step by step until non-negative weights meet the conditions.
    fn families(
        model: &Model<D>,
        cloud: &Cloud<D>,
        horizon: &mut [f64],
        fit: &FamilyFit<'_, D>,
    ) -> Result<Families, ModelError> {
        let points = cloud.position.len() - horizon.len();
        let centres: Vec<u32> = (points as u32..cloud.position.len() as u32).collect();
        let mut candidates: Vec<usize> = (points..cloud.position.len()).collect();
        let mut widened = 1.0;
        loop {
            let rows = Families::search_from(
                &cloud.position[points..],
                &vec![None; centres.len()],
                horizon,
                &cloud.position[..points],
                TIE_TOLERANCE,
            )?;
            let mut families = rows.spread(&centres, cloud.position.len());
            model.cut_bonds(&cloud.position, &mut families);
            let shapes = shapes(cloud, &families, &candidates, |i| horizon[i - points]);
            let first_alike = alike::first_alike(&shapes);
            let lacks: Vec<bool> = parallel::map(shapes.len(), 1, |k| {
                first_alike[k] == k && !fit.is_met_by_positive(&shapes[k].bonds, shapes[k].horizon)
            });
            let mut of_candidates = first_alike.iter().map(|&k| lacks[k]);
            candidates.retain(|_| of_candidates.next() == Some(true));
            if candidates.is_empty() || widened > WIDEST {
                return Ok(families);
            }
            widened *= WIDENING;
            for &i in &candidates {
                horizon[i - points] *= WIDENING;
            }
        }
    }
}

/// Steps in which the horizon of such a Gauss point grows, and where it stops.
const WIDENING: f64 = 1.25;
const WIDEST: f64 = 1.9;

impl<'a, const D: usize> Elements<'a, D> {
    /// Finite elements, the bonds of the points, and the partial stresses of Gauss points: [SAND2015-7998] eq. (2.20) in weak form.
    fn operator(self) -> Operator<'a, D> {
        let Self { model, body, first } = self;
        let on_site = {
            let first = first.clone();
            move |site: usize| {
                let (mut on, mut quadrature) = (Vec::new(), Vec::new());
                for (c, local) in model.cells_of_site(site) {
                    if first[c] == NO_GAUSS_POINT {
                        continue;
                    }
                    fem::quadrature(&model.mesh, c, &mut quadrature);
                    for (q, g) in quadrature.iter().enumerate() {
                        on.push((first[c] as usize + q, g.gradient[local] * g.weight));
                    }
                }
                on
            }
        };
        let beta = {
            let first = first.clone();
            move |site: usize| {
                let mut cells = model.cells_of_site(site);
                match model.point_of(site) {
                    Some(_) => 1.0,
                    None if cells.any(|(c, _)| first[c] != NO_GAUSS_POINT) => 0.5,
                    None => 0.0,
                }
            }
        };
        Operator {
            model,
            terms: vec![
                own_elements(model),
                Term::Bonds(BodyBonds::alone(|site| model.point_of(site).is_some())),
                Term::Stresses(PartialStresses {
                    model,
                    body: Some(body),
                    on_site: Box::new(on_site),
                    first_of_cell: first,
                }),
            ],
            beta: Box::new(beta),
            counts_materials: false,
            definiteness: Definiteness::SumOfSquares,
        }
    }
}

#[cfg(test)]
#[path = "partial_stress_elements_tests.rs"]
mod tests;
