//! Partial stress in finite elements: transition cells whose stress is the partial stress of peridynamic points at their Gauss points.

use std::sync::Arc;

use crate::coupling::partial_stress_fit::{FamilyFit, shapes};
use crate::{
    assembly::Row,
    coupling::{CellStresses, Definiteness, ExactStresses, MixedRows, Operator, SeamBonds},
    fem::{self, QuadraturePoint},
    mesh::Mesh,
    model::{CellRole, FitDegree, Interface, Model, ModelError, Reach, Zone, ZoneLayout},
    parallel,
    peridynamics::{
        Cloud, Ends, Factors, Families, LinearForceState, PdBody, PdError, TIE_TOLERANCE,
        alike::{self},
    },
    system::Symmetry,
    tensor::{Tensor, Vector},
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
    /// Degree of the least-squares fit (the report says quadratic).
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
    fn rows<'a, const D: usize>(
        &self,
        model: &'a Model<D>,
    ) -> Result<Box<dyn Operator<D> + 'a>, ModelError> {
        Elements::new(model).map(|operator| Box::new(operator) as _)
    }
}

struct Elements<'a, const D: usize> {
    model: &'a Model<D>,
    /// Points of the peridynamic zone, then Gauss points.
    body: Arc<PdBody<D>>,
    /// First Gauss point of each cell in `body`; `u32::MAX` for a cell that is no stress element.
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
        let mut first = vec![u32::MAX; mesh.cell_count()];
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
    /// At a free surface or edge a family lacks bonds. What is left may be too few for the moment conditions of the law, or may meet them only with negative
    /// weights, which soften the edge: on the coupled bar with free sides (3D, m = 2) sites there were off by 2.3 % (LPS) and 84 % (bond-based) of the largest
    /// displacement, against 0.3 % and 4.7 % now. Such a family is given a wider horizon, step by step, until weights that are not negative carry the law.
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

impl<const D: usize> Elements<'_, D> {
    /// The Gauss points whose stresses the force of a node takes, with the weighted gradients of its shape function: [SAND2015-7998] eq. (2.20) in weak form; none for a point.
    fn stresses_on(&self, site: usize) -> Vec<(usize, Vector<D>)> {
        let (mut on, mut quadrature) = (Vec::new(), Vec::new());
        for (c, local) in self.model.cells_of_site(site) {
            if self.first[c] == u32::MAX {
                continue;
            }
            fem::quadrature(&self.model.mesh, c, &mut quadrature);
            for (q, g) in quadrature.iter().enumerate() {
                on.push((self.first[c] as usize + q, g.gradient[local] * g.weight));
            }
        }
        on
    }
}

impl<const D: usize> Operator<D> for Elements<'_, D> {
    fn add_row(&self, site: usize, row: &mut Row<D>) {
        if let Some((body, i)) = self.model.point_of(site) {
            body.add_force_row(i, |_| 1.0, row);
            return;
        }
        self.model.add_element_rows(site, row);
        self.body.add_partial_stresses(self.stresses_on(site), row);
    }

    fn counts_materials(&self) -> bool {
        false
    }

    fn mixed_rows(&self) -> Option<&dyn MixedRows<D>> {
        None
    }

    fn seam_bonds(&self) -> Option<SeamBonds<'_, D>> {
        None
    }

    fn exact_stresses(&self) -> Option<ExactStresses<D>> {
        let mut gradients = vec![Vec::new(); self.body.cloud.position.len()];
        let mut quadrature = Vec::new();
        for (c, &first) in self
            .first
            .iter()
            .enumerate()
            .filter(|(_, f)| **f != u32::MAX)
        {
            fem::quadrature(&self.model.mesh, c, &mut quadrature);
            for (q, g) in quadrature.iter().enumerate() {
                let nodes = self.model.mesh.cell(c).iter().copied();
                gradients[first as usize + q] = nodes.zip(g.gradient).collect();
            }
        }
        ExactStresses::new(
            self.model,
            Some(Arc::clone(&self.body)),
            |site| self.stresses_on(site),
            |j| gradients[j].clone(),
        )
    }

    fn is_body_row(&self, site: usize) -> bool {
        self.model.point_of(site).is_some()
    }

    fn beta(&self, site: usize) -> f64 {
        if self.model.point_of(site).is_some() {
            1.0
        } else if self
            .model
            .cells_of_site(site)
            .any(|(c, _)| self.first[c] != u32::MAX)
        {
            0.5
        } else {
            0.0
        }
    }

    fn definiteness(&self) -> Definiteness {
        Definiteness::SumOfSquares
    }

    fn additional_bonds(&self) -> usize {
        self.body.bond_count()
    }

    fn cell_stresses(&self) -> Option<&dyn CellStresses<D>> {
        Some(self)
    }
}

impl<const D: usize> CellStresses<D> for Elements<'_, D> {
    fn cell_stress(&self, cell: usize, u: &[f64]) -> Option<Tensor<D>> {
        if self.first[cell] == u32::MAX {
            return None;
        }
        let mut quadrature = Vec::new();
        fem::quadrature(&self.model.mesh, cell, &mut quadrature);
        let volume: f64 = quadrature.iter().map(|g| g.weight).sum();
        Some(
            quadrature
                .iter()
                .enumerate()
                .map(|(q, g)| {
                    self.body.partial_stress(self.first[cell] as usize + q, u) * (g.weight / volume)
                })
                .sum(),
        )
    }

    fn sums_of_cell_stress(&self, cells: &[usize], fields: &[Vec<f64>]) -> Vec<[Tensor<D>; D]> {
        let transfer = &self.body.cloud.transfer;
        let at_places: Vec<Vec<f64>> = (fields.iter())
            .map(|field| {
                let at = |(site, weight): (u32, f64)| weight * field[site as usize];
                (0..transfer.len())
                    .map(|place| transfer.row(place).map(at).sum())
                    .collect()
            })
            .collect();
        let mut sums = vec![[Tensor::zeros(); D]; fields.len()];
        let mut quadrature = Vec::new();
        for &cell in cells.iter().filter(|&&c| self.first[c] != u32::MAX) {
            fem::quadrature(&self.model.mesh, cell, &mut quadrature);
            let volume: f64 = quadrature.iter().map(|g| g.weight).sum();
            for (q, g) in quadrature.iter().enumerate() {
                let point = self.first[cell] as usize + q;
                self.add_stresses(point, &at_places, g.weight / volume, &mut sums);
            }
        }
        sums
    }
}

/// Components `a ≤ b ≤ c` of a symmetric tensor of third order in space.
const THIRD: usize = 10;

/// Number of a component of such a tensor, whatever the order of its indices.
fn third(a: usize, b: usize, c: usize) -> usize {
    let mut index = [a, b, c];
    index.sort_unstable();
    let [a, b, c] = index;
    // those whose last index is less come first: 1, 4, then 10 of them
    c * (c + 1) * (c + 2) / 6 + b * (b + 1) / 2 + a
}

impl<const D: usize> Elements<'_, D> {
    /// Adds the partial stress of a Gauss point under each component of each field, which have one number per place, times `share`.
    ///
    /// The bonds enter by `Σ p ξ⊗ξ⊗ξ V Δf` and `Σ ω ξ V Δf` of each field, which serve all components of displacement.
    fn add_stresses(
        &self,
        point: usize,
        fields: &[Vec<f64>],
        share: f64,
        sums: &mut [[Tensor<D>; D]],
    ) {
        let body = &self.body;
        let (pair, omega) = body.kernel(point);
        let mut moments = vec![([0.0; THIRD], Vector::<D>::zeros()); fields.len()];
        for (k, &l) in body.families.of(point).iter().enumerate() {
            let l = l as usize;
            let (xi, volume) = (body.bond(point, l), body.cloud.volume[l]);
            let mut cubes = [0.0; THIRD];
            for c in 0..D {
                for b in 0..=c {
                    for a in 0..=b {
                        cubes[third(a, b, c)] = pair[k] * volume * xi[a] * xi[b] * xi[c];
                    }
                }
            }
            let weighted = xi * omega.get(k).map_or(0.0, |omega| omega * volume);
            for ((moment, gradient), field) in moments.iter_mut().zip(fields) {
                let difference = field[l] - field[point];
                for (moment, cube) in moment.iter_mut().zip(&cubes) {
                    *moment += cube * difference;
                }
                *gradient += weighted * difference;
            }
        }
        for ((moment, along), sums) in moments.iter().zip(sums) {
            for (c, sum) in sums.iter_mut().enumerate() {
                let mut stress = Tensor::<D>::from_fn(|a, b| moment[third(a, b, c)]);
                if let Some(state) = body.state(point) {
                    let mut gradient = Tensor::<D>::zeros();
                    gradient.set_row(c, &along.transpose());
                    // Σ p |ξ|² ξ·η V is the trace of what the pairs give
                    let (theta, product) = (gradient.trace(), stress.trace());
                    let products = state.shape * product + state.second * theta;
                    stress += gradient * state.stabilisation
                        + state.modulus.contract(&gradient) * state.shape
                        - products * state.deviator;
                }
                *sum += stress * share;
            }
        }
    }
}

#[cfg(test)]
#[path = "partial_stress_elements_tests.rs"]
mod tests;
