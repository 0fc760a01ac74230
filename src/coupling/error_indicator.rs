//! Regions where the local model would be wrong, and where a bond could break, estimated from the displacement at the nodes.
//!
//! The force densities of a peridynamic law with an even kernel and of its local limit differ under a smooth field, to second order in the horizon, by
//!
//! ```text
//!   L_pd u − L_0 u = div τ + O(δ⁴),     τ = C : ℓ² ∇²ε(u),     ℓ² = 5/12 · 1/(D + 4) · ∫ λ r⁶ dV / ∫ λ r⁴ dV
//! ```
//!
//! with λ the micromodulus of a bond, whose force is `λ ξ (ξ·η)`. In one dimension the fourth derivative has the factor
//! `E ℓ² = ∫ λ ξ⁶/24 dξ`, and the expression is exact up to fields of the fifth degree; in two and three it is that of a plane longitudinal wave, and
//! for an LPS that of its bonds alone. Where a zone `Ω` stays local, its error `w` obeys `L_0 w = −div τ` in `Ω`: in the norm of energy it is at most
//! that of τ,
//!
//! ```text
//!   ‖w‖² ≤ Σ_c V_c (ℓ²∇²ε) : C : (ℓ²∇²ε),
//! ```
//!
//! and cells are taken out of `Ω`, the worst first, until the root of the sum is less than `tolerance` times that of `Σ_c V_c ε : C : ε`, the energy of the
//! finite-element solution. `ℓ²∇²ε` is the difference between the strain of a cell and the mean of the strains around it, scaled by second
//! moments. It counts up to the cell's own energy only, since ∇²ε is unbounded at a corner.

use rayon::prelude::*;

use crate::coupling::second_gradients::{Around, Reached, cells_of, is_simplex, kinds, level};
use crate::{
    fem::{self, Rule},
    mesh::Mesh,
    model::ElasticCells,
    parallel,
    tensor::{Tensor, Vector, strain},
};

/// Cells per task: a number of its own, so that what a task reuses does not depend on the number of threads.
const CHUNK: usize = 1024;

/// No cell.
const NONE: u32 = u32::MAX;

/// Criteria for the need of peridynamics.
#[derive(Clone, Copy, Debug)]
pub struct Criteria<'a, const D: usize> {
    /// The mesh of the whole body.
    pub mesh: &'a Mesh<D>,
    /// Local elastic tensors and materials of the cells.
    pub elastic: &'a ElasticCells<D>,
    /// The material that peridynamic points would have; no other cell is marked.
    pub material: u16,
    /// Horizon at the centre of each cell \[m\].
    pub horizon: &'a [f64],
    /// `ℓ²/δ²`, [`gradient_ratio`].
    pub gradient_ratio: f64,
    /// Error of the local model, relative in the norm of energy, that may remain.
    pub tolerance: f64,
    /// Stretch from which a cell is marked; none if no bond breaks.
    pub stretch: Option<f64>,
    /// Cells without a strain, one entry per cell: cracks and voids pass through them, and no mean passes over them.
    pub cut: &'a [bool],
    /// Cells in which no bond can break, one entry per cell.
    pub unbreakable: &'a [bool],
    /// Cells whose error does not count, one entry per cell: at the end of a support the strain knows no bound in either model, and points there have bonds to nothing.
    pub held: &'a [bool],
}

/// Cells where peridynamics is needed, one entry per cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Need {
    /// The local model errs too much.
    pub error: Vec<bool>,
    /// A bond may be stretched beyond the limit.
    pub stretch: Vec<bool>,
    /// Estimated error of the local model in the whole body, relative in the norm of energy.
    pub all_local: f64,
    /// Part of `all_local` that remains outside of the cells of `error`.
    pub remaining: f64,
    /// The part of the square of `all_local` that each cell has.
    pub squares: Vec<f64>,
}

/// `ℓ²/δ²` of bonds with the micromodulus `lambda(r)` \[any unit\] and the horizon `horizon` \[m\].
pub fn gradient_ratio<const D: usize>(lambda: impl Fn(f64) -> f64, horizon: f64) -> f64 {
    // the midpoint rule: powers of r and kernels that vanish at the horizon, smooth in between
    const STEPS: usize = 2000;
    let moment = |power: i32| -> f64 {
        (0..STEPS)
            .map(|i| (i as f64 + 0.5) / STEPS as f64)
            .map(|s| lambda(s * horizon) * s.powi(power + D as i32 - 1))
            .sum()
    };
    5.0 / 12.0 / (D + 4) as f64 * moment(6) / moment(4)
}

impl Need {
    /// Returns the estimated error of the local model that remains outside of a set of cells, one entry per cell, relative in the norm of energy.
    pub fn remaining_outside(&self, cells: &[bool]) -> f64 {
        let outside = self
            .squares
            .iter()
            .zip(cells)
            .filter(|(_, inside)| !**inside);
        outside.map(|(square, _)| square).sum::<f64>().sqrt()
    }
}

impl<const D: usize> Criteria<'_, D> {
    /// Returns the cells where peridynamics is needed under a displacement.
    ///
    /// Shapes: `displacement` gives that of a node of the mesh \[m\].
    pub fn need(&self, displacement: impl Fn(usize) -> Vector<D> + Sync) -> Need {
        let mesh = self.mesh;
        let count = mesh.cell_count();
        let node_cells = mesh.node_cells();
        let strains = self.strains(&node_cells, &displacement);
        let neighbours = self.neighbours(&node_cells);
        let centre: Vec<Vector<D>> = (0..count).map(|c| mesh.centroid(c)).collect();
        let volume: Vec<f64> = parallel::map(count, 1, |c| mesh.cell_volume(c).abs());
        let energy = |c: usize, e: &Tensor<D>| {
            let tensor = self.elastic.tensor(c);
            volume[c] * tensor.contract(e).dot(e)
        };
        let own: Vec<f64> = parallel::map(count, 1, |c| match self.cut[c] {
            true => 0.0,
            false => energy(c, &strains[c]),
        });
        let around = Around {
            horizon: self.horizon,
            kind: kinds(&neighbours, &centre, &volume),
            neighbours: &neighbours,
            strains: &strains,
            centre: &centre,
            volume: &volume,
        };
        let mut wrong = vec![0.0; count];
        parallel::for_each_with(
            wrong.par_chunks_mut(CHUNK).enumerate(),
            || Reached {
                from: NONE,
                radius: 0.0,
                cells: Vec::new(),
                weights: Vec::new(),
                stamp: vec![NONE; count],
            },
            |reached, (number, wrong)| {
                reached.from = NONE;
                for (i, wrong) in wrong.iter_mut().enumerate() {
                    let c = number * CHUNK + i;
                    if self.is_candidate(c) && !self.held[c] {
                        let gradient = around.second_gradient(c, reached) * self.length_squared(c);
                        *wrong = energy(c, &gradient).min(own[c]);
                    }
                }
            },
        );
        let largest: Vec<f64> = parallel::map(count, 1, |c| {
            match self.stretch.is_some() && self.is_candidate(c) {
                true => largest_strain(mesh, c, &displacement),
                false => 0.0,
            }
        });
        let whole = own.iter().sum();
        let (error, all_local, remaining) = worst(&wrong, whole, self.tolerance);
        let is_known = all_local > 0.0;
        wrong
            .iter_mut()
            .for_each(|w| *w = if is_known { *w / whole } else { 0.0 });
        Need {
            error,
            stretch: (0..count)
                .map(|c| {
                    self.stretch
                        .is_some_and(|s| largest[c] >= s && !self.unbreakable[c])
                })
                .collect(),
            all_local,
            remaining,
            squares: wrong,
        }
    }

    fn is_candidate(&self, c: usize) -> bool {
        self.elastic.material[c] == self.material && !self.cut[c]
    }

    fn length_squared(&self, c: usize) -> f64 {
        self.gradient_ratio * self.horizon[c].powi(2)
    }

    /// The strain at the centre of each cell; on simplices, where it jumps from cell to cell, that of a plane through those of the neighbours.
    fn strains(
        &self,
        node_cells: &(Vec<u32>, Vec<u32>),
        displacement: &(impl Fn(usize) -> Vector<D> + Sync),
    ) -> Vec<Tensor<D>> {
        let mesh = self.mesh;
        let raw: Vec<Tensor<D>> = parallel::map(mesh.cell_count(), 1, |c| {
            strain(&fem::displacement_gradient_at_centre(mesh, c, displacement))
        });
        if !mesh.shapes.iter().any(|s| is_simplex(*s)) {
            return raw;
        }
        parallel::map(mesh.cell_count(), 1, |c| {
            if !is_simplex(mesh.shapes[c]) || !self.is_candidate(c) {
                return raw[c];
            }
            let mut near: Vec<u32> = mesh
                .cell(c)
                .iter()
                .flat_map(|&n| cells_of(node_cells, n))
                .copied()
                .filter(|&k| self.is_candidate(k as usize))
                .collect();
            near.sort_unstable();
            near.dedup();
            let x = mesh.centroid(c);
            let places = near.iter().map(|&k| {
                let k = k as usize;
                (mesh.centroid(k) - x, mesh.cell_volume(k).abs())
            });
            let mut weights = Vec::new();
            level(places, &mut weights);
            if weights.is_empty() {
                return raw[c];
            }
            let values = near.iter().map(|&k| raw[k as usize]);
            values.zip(&weights).map(|(e, w)| e * *w).sum()
        })
    }

    /// The candidates that share a facet with each candidate; `NONE` fills the rest.
    fn neighbours(&self, node_cells: &(Vec<u32>, Vec<u32>)) -> Vec<[u32; 6]> {
        let mesh = self.mesh;
        parallel::map(mesh.cell_count(), 1, |c| {
            let mut found = [NONE; 6];
            if !self.is_candidate(c) {
                return found;
            }
            let nodes = mesh.corners(c);
            let facets = mesh.shapes[c].linear().facets();
            for (slot, facet) in found.iter_mut().zip(facets) {
                let other = cells_of(node_cells, nodes[facet[0]]).iter().find(|&&k| {
                    let theirs = mesh.cell(k as usize);
                    k as usize != c
                        && self.is_candidate(k as usize)
                        && facet[1..].iter().all(|&i| theirs.contains(&nodes[i]))
                });
                *slot = other.copied().unwrap_or(NONE);
            }
            found
        })
    }
}

/// Marks the largest entries until the root of the sum of the others is below `tolerance` times that of `whole`; with the ratio of the roots before and after.
fn worst(wrong: &[f64], whole: f64, tolerance: f64) -> (Vec<bool>, f64, f64) {
    let mut marked = vec![false; wrong.len()];
    let all: f64 = wrong.iter().sum();
    if whole <= 0.0 || !all.is_finite() {
        return (marked, 0.0, 0.0);
    }
    let ratio = |left: f64| (left.max(0.0) / whole).sqrt();
    let mut order: Vec<u32> = (0..wrong.len() as u32).collect();
    order.sort_unstable_by(|a, b| {
        wrong[*a as usize]
            .total_cmp(&wrong[*b as usize])
            .then(a.cmp(b))
    });
    // summed from the smallest, so that rounding does not hide it
    let mut left = 0.0;
    let mut stays = 0;
    for &c in &order {
        let with = left + wrong[c as usize];
        if ratio(with) > tolerance {
            break;
        }
        left = with;
        stays += 1;
    }
    for &c in &order[stays..] {
        marked[c as usize] = true;
    }
    (marked, ratio(all), ratio(left))
}

/// The largest principal strain at the quadrature points of a cell.
fn largest_strain<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    displacement: impl Fn(usize) -> Vector<D>,
) -> f64 {
    let mut largest = 0.0f64;
    fem::for_each_point(mesh, c, Rule::Stiffness, |p| {
        let g = fem::displacement_gradient(p, |a| displacement(mesh.cell(c)[a] as usize));
        largest = largest.max(largest_eigenvalue(&strain(&g)));
    });
    largest
}

/// The largest eigenvalue of a symmetric tensor.
fn largest_eigenvalue<const D: usize>(e: &Tensor<D>) -> f64 {
    match D {
        1 => e[(0, 0)],
        2 => {
            let mean = 0.5 * (e[(0, 0)] + e[(1, 1)]);
            mean + (0.5 * (e[(0, 0)] - e[(1, 1)])).hypot(e[(0, 1)])
        }
        _ => nalgebra::Matrix3::from_fn(|i, j| e[(i, j)])
            .symmetric_eigenvalues()
            .max(),
    }
}

#[cfg(test)]
#[path = "error_indicator_tests.rs"]
mod tests;
