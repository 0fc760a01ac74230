//! Partial stresses of peridynamic points, as a term of a coupled model.
//!
//! ```text
//!   f_s = Σ_j ν_j a_sj ,     ν_j = Σ T⟨ξ⟩ ⊗ ξ V
//! ```
//!
//! Source: [SAND2015-7998] eq. (2.19) and (2.29): `a_sj` are the weights of a divergence, or gradients of shape functions at Gauss points. Rows have ν to first order in the displacement; [`ExactStresses`](super::ExactStresses) has the remainder. Units: ν \[Pa\], a \[m^(D−1)\], f \[N\].

use std::sync::Arc;

use crate::{
    assembly::Row,
    fem::{self, QuadraturePoint},
    model::Model,
    peridynamics::PdBody,
    tensor::{Tensor, Vector},
};

/// The points whose partial stress the row of a site takes, with the weights of these stresses.
pub type StressesOn<'a, const D: usize> =
    Box<dyn Fn(usize) -> Vec<(usize, Vector<D>)> + Send + Sync + 'a>;

/// Partial stresses of peridynamic points in the rows of sites.
pub struct PartialStresses<'a, const D: usize> {
    /// Sites, elements and the body.
    pub model: &'a Model<D>,
    /// Body in which the points are numbered; none for the model's own body.
    pub body: Option<Arc<PdBody<D>>>,
    /// The points whose stress the row of a site takes; none where it takes no stresses.
    pub on_site: StressesOn<'a, D>,
    /// For each cell its first Gauss point in the body, [`NO_GAUSS_POINT`] where its stress is that of its law; empty where no cell has a partial stress.
    pub first_of_cell: Vec<u32>,
}

/// Entry of a cell without Gauss points in a body.
pub const NO_GAUSS_POINT: u32 = u32::MAX;

impl<const D: usize> PartialStresses<'_, D> {
    fn body(&self) -> Option<&PdBody<D>> {
        self.body.as_deref().or_else(|| self.model.body())
    }

    /// Adds the stresses to first order in the displacement.
    pub(super) fn add_row(&self, site: usize, row: &mut Row<D>) {
        let on = (self.on_site)(site);
        if let (Some(body), false) = (self.body(), on.is_empty()) {
            body.add_partial_stresses(on, row);
        }
    }

    /// Bonds of a body of its own.
    pub(super) fn additional_bonds(&self) -> usize {
        self.body.as_ref().map_or(0, |body| body.bond_count())
    }

    /// Returns true if the stress of a cell is the partial stress at its Gauss points.
    pub(super) fn carries(&self, cell: usize) -> bool {
        (self.first_of_cell.get(cell)).is_some_and(|&first| first != NO_GAUSS_POINT)
    }

    /// The Gauss points of a cell that carries partial stresses, with their numbers in the body.
    pub(super) fn gauss_points(
        &self,
        cell: usize,
        quadrature: &mut Vec<QuadraturePoint<D>>,
    ) -> std::ops::Range<usize> {
        quadrature.clear();
        if self.carries(cell) {
            fem::quadrature(&self.model.mesh, cell, quadrature);
        }
        let first = self.first_of_cell.get(cell).copied().unwrap_or(0) as usize;
        first..first + quadrature.len()
    }

    /// The mean partial stress of a cell; none of a cell whose stress is that of its own law.
    pub(super) fn cell_stress(&self, cell: usize, u: &[f64]) -> Option<Tensor<D>> {
        let body = self.body().filter(|_| self.carries(cell))?;
        let mut quadrature = Vec::new();
        let points = self.gauss_points(cell, &mut quadrature);
        let volume: f64 = quadrature.iter().map(|g| g.weight).sum();
        let stresses = (points.zip(&quadrature))
            .map(|(point, g)| body.partial_stress(point, u) * (g.weight / volume));
        Some(stresses.sum())
    }

    /// Adds the stresses of cells under each component of fields of one number per site.
    pub(super) fn add_cell_stresses(
        &self,
        cells: &[usize],
        fields: &[Vec<f64>],
        sums: &mut [[Tensor<D>; D]],
    ) {
        let carries = cells.iter().any(|&cell| self.carries(cell));
        let Some(body) = self.body().filter(|_| carries) else {
            return;
        };
        let transfer = &body.cloud.transfer;
        let at_places: Vec<Vec<f64>> = (fields.iter())
            .map(|field| {
                let at = |(site, weight): (u32, f64)| weight * field[site as usize];
                (0..transfer.len())
                    .map(|place| transfer.row(place).map(at).sum())
                    .collect()
            })
            .collect();
        let mut quadrature = Vec::new();
        for &cell in cells {
            let points = self.gauss_points(cell, &mut quadrature);
            let volume: f64 = quadrature.iter().map(|g| g.weight).sum();
            for (point, g) in points.zip(&quadrature) {
                add_stresses(body, point, &at_places, g.weight / volume, sums);
            }
        }
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

/// Adds the partial stress of a Gauss point under each component of each field, which have one number per place, times `share`.
///
/// The bonds enter by `Σ p ξ⊗ξ⊗ξ V Δf` and `Σ ω ξ V Δf` of each field, which serve all components of displacement.
fn add_stresses<const D: usize>(
    body: &PdBody<D>,
    point: usize,
    fields: &[Vec<f64>],
    share: f64,
    sums: &mut [[Tensor<D>; D]],
) {
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
