//! Partial stress in finite elements: transition cells whose stress is the partial stress of peridynamic points at their Gauss points.

use std::sync::Arc;

use crate::{
    assembly::Row,
    coupling::{Coupling, ExactStresses, MixedRows, Operator, Rows, SeamBonds},
    dimension,
    fem::{self, QuadraturePoint},
    mesh::Mesh,
    model::{CellRole, FitDegree, Interface, Model, ModelError, Zone, ZoneLayout},
    parallel,
    peridynamics::{
        Bound, Cloud, Ends, Factors, Families, Family, LinearForceState, MomentConditions, PdBody,
        PdError, StressFit, TIE_TOLERANCE,
        alike::{self, FamilyShape},
        moment_fitted_weights,
    },
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
        Interface::Constrained(self.fit)
    }

    fn takes_deviators(&self) -> bool {
        true
    }
}

impl<const D: usize> Coupling<D> for PartialStressElements {
    fn operator<'a>(&self, model: &'a Model<D>) -> Result<Box<dyn Operator<D> + 'a>, ModelError> {
        static ROWS: (
            Rows<PartialStressElements, 1>,
            Rows<PartialStressElements, 2>,
            Rows<PartialStressElements, 3>,
        ) = (
            PartialStressElements::rows,
            PartialStressElements::rows,
            PartialStressElements::rows,
        );
        dimension::of::<Rows<Self, D>>(&ROWS)(self, model)
    }
}

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

/// The families of some points.
fn shapes<const D: usize>(
    cloud: &Cloud<D>,
    families: &Families,
    points: &[usize],
    horizon: impl Fn(usize) -> f64 + Sync,
) -> Vec<FamilyShape<D>> {
    parallel::map_slice(points, |&i| FamilyShape {
        bonds: families
            .of(i)
            .iter()
            .map(|&j| {
                let j = j as usize;
                (cloud.position[j] - cloud.position[i], cloud.volume[j])
            })
            .collect(),
        horizon: horizon(i),
    })
}

/// Bonds of a whole family with their volumes, and the moments that they have.
type LatticeMoments<const D: usize> = (Vec<(Vector<D>, f64)>, Vec<f64>);

/// Fit of the weights of a Gauss point's family, so that its partial stress is that of the elements around under affine fields.
struct FamilyFit<'a, const D: usize> {
    law: &'a dyn LinearForceState<D>,
    /// Bonds and coefficients of the lattice whose tensor the elements have, where that is not the typed one.
    lattice: Option<LatticeMoments<D>>,
    /// True if places in elements lie between the nodes, so that fifth moments should vanish too. If every place is a node, the errors of the points of one element under quadratic fields cancel around each node.
    between_nodes: bool,
}

impl<'a, const D: usize> FamilyFit<'a, D> {
    fn new(model: &Model<D>, law: &'a dyn LinearForceState<D>) -> Self {
        let lattice = model.plain_lattice().map(|whole| {
            // Σ λ ξ⊗ξ⊗ξ⊗ξ V of a pairwise law, whose p is λ/2; Σ ω ξ⊗ξ⊗ξ⊗ξ/|ξ|² V of another
            let of = |(p, omega): (f64, f64)| if law.is_pairwise() { 2.0 * p } else { omega };
            (whole.vectors(), whole.bonds().map(|(_, c)| of(c)).collect())
        });
        Self {
            law,
            lattice,
            between_nodes: model.has_places_between_nodes(),
        }
    }

    /// Returns the conditions that the coefficients of a family should meet; none where the law is exact on every family.
    fn conditions(
        &self,
        bonds: &[(Vector<D>, f64)],
        horizon: f64,
    ) -> Option<(Vec<f64>, MomentConditions<D>)> {
        let (base, conditions) = self.law.moment_conditions(bonds, horizon)?;
        let conditions = match &self.lattice {
            Some((vectors, g)) => conditions.with_values_of(vectors, g),
            None => conditions,
        };
        Some((base, conditions))
    }

    /// The law with influence functions that are fitted to each family, where factors alone do not make its partial stress exact.
    fn fitted_law(&self) -> Option<Box<dyn LinearForceState<D> + '_>> {
        self.law.fitted_to(match self.between_nodes {
            true => StressFit::Quadratic,
            false => StressFit::Affine,
        })
    }

    /// Returns true if non-negative weights can meet the conditions for affine fields.
    fn is_met_by_positive(&self, bonds: &[(Vector<D>, f64)], horizon: f64) -> bool {
        if let Some(law) = self.law.fitted_to(StressFit::Positive) {
            let (vectors, volumes): (Vec<_>, Vec<_>) = bonds.iter().copied().unzip();
            let family = Family {
                bonds: &vectors,
                volumes: &volumes,
                factors: &vec![1.0; bonds.len()],
                horizon,
                materials: None,
            };
            let (mut pair, mut omega) = (vec![0.0; bonds.len()], vec![0.0; bonds.len()]);
            return law.coefficients(&family, &mut pair, &mut omega).is_ok();
        }
        self.conditions(bonds, horizon).is_none_or(|(base, c)| {
            moment_fitted_weights::fit(bonds, &base, &c, Bound::AtLeast(0.0)).is_ok()
        })
    }

    /// Weights that are exact for quadratic fields and not negative, where they are asked for and there are bonds enough to expect some.
    ///
    /// In space a search for the smallest change that is not negative would take most of the time of a run (36 conditions per Gauss point: the coupled bar of section 7.3 took 2.5 times as long), so only the smallest change of any sign counts there.
    fn quadratic(
        &self,
        bonds: &[(Vector<D>, f64)],
        base: &[f64],
        affine: &MomentConditions<D>,
    ) -> Option<moment_fitted_weights::Fit> {
        let conditions = affine.clone().with_vanishing_moments(5);
        if !self.between_nodes || bonds.len() < 2 * conditions.rows.len() {
            return None;
        }
        let smallest = moment_fitted_weights::fit(bonds, base, &conditions, Bound::Free).ok()?;
        if smallest.smallest_factor >= 0.0 {
            return Some(smallest);
        }
        let bounded =
            || moment_fitted_weights::fit(bonds, base, &conditions, Bound::AtLeast(0.0)).ok();
        if D < 3 { bounded() } else { None }
    }

    /// The factors of the bonds: exact for quadratic fields if factors that are not negative can be, else for affine ones.
    fn factors(&self, bonds: &[(Vector<D>, f64)], horizon: f64) -> Result<Vec<f64>, PdError> {
        let Some((base, conditions)) = self.conditions(bonds, horizon) else {
            return Ok(vec![1.0; bonds.len()]);
        };
        let positive = |c: &MomentConditions<D>| {
            moment_fitted_weights::fit(bonds, &base, c, Bound::AtLeast(0.0))
        };
        let fit = match self.quadratic(bonds, &base, &conditions) {
            Some(fit) => Ok(fit),
            None => positive(&conditions),
        }
        .or_else(|_| moment_fitted_weights::fit(bonds, &base, &conditions, Bound::Free))?;
        let factor = |(g, b): (&f64, &f64)| if *b > 0.0 { g / b } else { 1.0 };
        Ok(fit.values.iter().zip(&base).map(factor).collect())
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

    fn additional_bonds(&self) -> usize {
        self.body.bond_count()
    }

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
mod tests {
    use super::*;
    use crate::run::SceneModel;
    use crate::run::block::Block;

    /// Sums of all components of some fields at once against the stress under each displacement.
    fn sums_are_those_of_single_cells<const D: usize>(material: [&str; 2]) {
        let block = Block {
            coupling: "\"partial-stress\"",
            material,
            influence: "influence = \"gaussian\"\n",
            size: 3,
            has_triangles: false,
            widths: if D == 3 { [3, 3, 6] } else { [6, 6, 12] },
            ratio: 2,
            origin: 0.0,
        };
        let SceneModel {
            model, coupling, ..
        } = block.model::<D>();
        let operator = coupling.operator(&model).unwrap();
        let is_stressed = |c: &usize| model.roles[*c] == CellRole::StressElement;
        let cells: Vec<usize> = (0..model.mesh.cell_count()).filter(is_stressed).collect();
        let fields = [1.7, 0.3].map(|k| -> Vec<f64> {
            let at = |x: Vector<D>| (k * x.sum()).sin() + k * x[0] * x[D - 1];
            model.sites.iter().map(|site| at(site.position)).collect()
        });
        let sums = operator.sums_of_cell_stress(&cells, &fields);
        assert!(!cells.is_empty() && sums.len() == fields.len());
        for (field, sums) in fields.iter().zip(&sums) {
            for (c, sum) in sums.iter().enumerate() {
                let mut u = vec![0.0; field.len() * D];
                for (u, value) in u.chunks_mut(D).zip(field) {
                    u[c] = *value;
                }
                let stress = |&cell: &usize| operator.cell_stress(cell, &u).unwrap();
                let (mut expected, mut size) = (Tensor::<D>::zeros(), 0.0);
                for stress in cells.iter().map(stress) {
                    expected += stress;
                    size += stress.amax();
                }
                let error = (sum - expected).amax() / size;
                assert!(error < 1e-13, "component {c}: {error:e}");
            }
        }
    }

    #[test]
    fn one_pass_over_the_families_gives_the_stress_of_all_fields() {
        let pairwise = ["bond-based", ""];
        let state_based = ["lps", "poisson-ratio = 0.3\n"];
        let position_aware = ["pals", "poisson-ratio = 0.3\n"];
        sums_are_those_of_single_cells::<1>(state_based);
        sums_are_those_of_single_cells::<2>(pairwise);
        sums_are_those_of_single_cells::<2>(state_based);
        sums_are_those_of_single_cells::<2>(position_aware);
        sums_are_those_of_single_cells::<3>(pairwise);
        sums_are_those_of_single_cells::<3>(state_based);
        sums_are_those_of_single_cells::<3>(position_aware);
    }
}
