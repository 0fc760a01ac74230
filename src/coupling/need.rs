//! Where the local model would be wrong, and where a bond could break, seen from the displacement at the nodes.
//!
//! A peridynamic law with an even kernel sees of a smooth field, to the second order in the horizon,
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
//! moments. No more than the cell's own energy counts: at a corner, where ∇²ε knows no bound, the difference of two mean strains does.

use rayon::prelude::*;

use crate::{
    fem::{self, Rule},
    mesh::{CellShape, Mesh},
    tensor::{Tensor, Tensor4, Vector, strain},
};

/// Strains are averaged over this many sizes of a cell, or over a horizon where that is less. Wider means cost more and round corners; narrower ones take the noise of the mesh for a gradient.
const AVERAGED_OVER: f64 = 2.5;

/// And at least over so many, or a cell has no neighbour.
const AT_LEAST: f64 = 1.5;

/// No cell.
const NONE: u32 = u32::MAX;

/// What decides where peridynamics is needed.
#[derive(Clone, Copy, Debug)]
pub struct Criteria<'a, const D: usize> {
    /// The mesh of the whole body.
    pub mesh: &'a Mesh<D>,
    /// Local elastic tensor of each material \[Pa\].
    pub tensors: &'a [Tensor4<D>],
    /// Material of each cell, an index into `tensors`.
    pub cell_material: &'a [u16],
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

/// Where peridynamics is needed, one entry per cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Need {
    /// The local model errs too much.
    pub error: Vec<bool>,
    /// A bond may be stretched beyond the limit.
    pub stretch: Vec<bool>,
    /// Estimated error of the local model in the whole body, relative in the norm of energy.
    pub all_local: f64,
    /// What remains of it outside of the cells of `error`.
    pub remaining: f64,
    /// The largest principal strain; zero if no bond breaks.
    pub largest_strain: f64,
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

impl<const D: usize> Criteria<'_, D> {
    /// Where peridynamics is needed under a displacement.
    ///
    /// Shapes: `displacement` gives that of a node of the mesh \[m\].
    pub fn need(&self, displacement: impl Fn(usize) -> Vector<D> + Sync) -> Need {
        let mesh = self.mesh;
        let count = mesh.cell_count();
        let node_cells = mesh.node_cells();
        let strains = self.strains(&node_cells, &displacement);
        let neighbours = self.neighbours(&node_cells);
        let centre: Vec<Vector<D>> = (0..count).map(|c| mesh.centroid(c)).collect();
        let volume: Vec<f64> = (0..count)
            .into_par_iter()
            .map(|c| mesh.cell_volume(c).abs())
            .collect();
        let energy = |c: usize, e: &Tensor<D>| {
            let tensor = &self.tensors[self.cell_material[c] as usize];
            volume[c] * tensor.contract(e).dot(e)
        };
        let own: Vec<f64> = (0..count)
            .into_par_iter()
            .map(|c| match self.cut[c] {
                true => 0.0,
                false => energy(c, &strains[c]),
            })
            .collect();
        let around = Around {
            criteria: self,
            neighbours: &neighbours,
            strains: &strains,
            centre: &centre,
            volume: &volume,
        };
        let mut wrong = vec![0.0; count];
        // stamps are as long as the mesh, so chunks are few
        let chunk = count.div_ceil(4 * rayon::current_num_threads()).max(1);
        wrong
            .par_chunks_mut(chunk)
            .enumerate()
            .for_each(|(number, wrong)| {
                let mut reached = Reached {
                    cells: Vec::new(),
                    stamp: vec![u32::MAX; count],
                };
                for (i, wrong) in wrong.iter_mut().enumerate() {
                    let c = number * chunk + i;
                    if self.is_candidate(c) && !self.held[c] {
                        let gradient =
                            around.second_gradient(c, &mut reached) * self.length_squared(c);
                        *wrong = energy(c, &gradient).min(own[c]);
                    }
                }
            });
        let largest: Vec<f64> = (0..count)
            .into_par_iter()
            .map(|c| match self.stretch.is_some() && self.is_candidate(c) {
                true => largest_strain(mesh, c, &displacement),
                false => 0.0,
            })
            .collect();
        let (error, all_local, remaining) = worst(&wrong, own.iter().sum(), self.tolerance);
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
            largest_strain: largest.iter().copied().fold(0.0, f64::max),
        }
    }

    fn is_candidate(&self, c: usize) -> bool {
        self.cell_material[c] == self.material && !self.cut[c]
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
        let raw: Vec<Tensor<D>> = (0..mesh.cell_count())
            .into_par_iter()
            .map(|c| strain(&fem::displacement_gradient_at_centre(mesh, c, displacement)))
            .collect();
        if !mesh.shapes.iter().any(|s| is_simplex(*s)) {
            return raw;
        }
        (0..mesh.cell_count())
            .into_par_iter()
            .map(|c| {
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
                let data = near.iter().map(|&k| {
                    let k = k as usize;
                    (mesh.centroid(k) - x, mesh.cell_volume(k).abs(), raw[k])
                });
                level(data).unwrap_or(raw[c])
            })
            .collect()
    }

    /// The candidates that share a facet with each candidate; `NONE` fills the rest.
    fn neighbours(&self, node_cells: &(Vec<u32>, Vec<u32>)) -> Vec<[u32; 6]> {
        let mesh = self.mesh;
        (0..mesh.cell_count())
            .into_par_iter()
            .map(|c| {
                let mut found = [NONE; 6];
                if !self.is_candidate(c) {
                    return found;
                }
                let nodes = mesh.cell(c);
                for (slot, facet) in found.iter_mut().zip(mesh.shapes[c].facets()) {
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
            .collect()
    }
}

fn is_simplex(shape: CellShape) -> bool {
    matches!(shape, CellShape::Tri3 | CellShape::Tet4)
}

fn cells_of((offsets, cells): &(Vec<u32>, Vec<u32>), node: u32) -> &[u32] {
    &cells[offsets[node as usize] as usize..offsets[node as usize + 1] as usize]
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

/// The strains around a cell.
struct Around<'a, const D: usize> {
    criteria: &'a Criteria<'a, D>,
    neighbours: &'a [[u32; 6]],
    strains: &'a [Tensor<D>],
    centre: &'a [Vector<D>],
    volume: &'a [f64],
}

/// Cells that have been reached, and for each cell of the mesh from which cell it was reached last.
struct Reached {
    cells: Vec<u32>,
    stamp: Vec<u32>,
}

impl<const D: usize> Around<'_, D> {
    /// `∇²ε` at the centre of cell `c`: from the cells that a path of candidates within a small ball joins to it, so that no mean passes over a slit.
    fn second_gradient(&self, c: usize, reached: &mut Reached) -> Tensor<D> {
        let size = self.volume[c].powf(1.0 / D as f64);
        let radius = (AVERAGED_OVER * size)
            .min(self.criteria.horizon[c])
            .max(AT_LEAST * size)
            * (1.0 + 1e-9);
        let x = self.centre[c];
        reached.cells.clear();
        reached.cells.push(c as u32);
        reached.stamp[c] = c as u32;
        let mut next = 0;
        while let Some(&at) = reached.cells.get(next) {
            next += 1;
            for &k in self.neighbours[at as usize].iter().filter(|k| **k != NONE) {
                if reached.stamp[k as usize] != c as u32
                    && (self.centre[k as usize] - x).norm() <= radius
                {
                    reached.stamp[k as usize] = c as u32;
                    reached.cells.push(k);
                }
            }
        }
        let (mut second, mut weight) = (0.0, 0.0);
        for &k in &reached.cells {
            let v = self.volume[k as usize];
            second += v * (self.centre[k as usize] - x).norm_squared();
            weight += v;
        }
        let data = reached.cells.iter().map(|&k| {
            let k = k as usize;
            (
                self.centre[k] - x,
                self.volume[k],
                self.strains[k] - self.strains[c],
            )
        });
        // the mean of ½ x·H·x over the ball is ½ ⟨x₁²⟩ tr H
        match level(data) {
            Some(difference) if second > 0.0 => difference * (2.0 * D as f64 * weight / second),
            _ => Tensor::zeros(),
        }
    }
}

/// The value at zero of the plane that fits weighted values best; their mean where they do not determine a plane. `None` without weight.
///
/// Shapes: position, weight and value of each. A plane loses what a one-sided mean makes of a constant gradient.
fn level<const D: usize>(
    data: impl Iterator<Item = (Vector<D>, f64, Tensor<D>)> + Clone,
) -> Option<Tensor<D>> {
    let (mut weight, mut first, mut mean) = (0.0, Vector::<D>::zeros(), Tensor::<D>::zeros());
    for (x, w, value) in data.clone() {
        weight += w;
        first += x * w;
        mean += value * w;
    }
    if weight <= 0.0 {
        return None;
    }
    first /= weight;
    mean /= weight;
    let mut second = Tensor::<D>::zeros();
    for (x, w, _) in data.clone() {
        let x = x - first;
        second += x * x.transpose() * (w / weight);
    }
    let scale = second.trace();
    let inverse = match crate::tensor::inverse(&second) {
        Some((inverse, determinant)) if determinant > 1e-6 * scale.powi(D as i32) => inverse,
        _ => return Some(mean),
    };
    let slope = inverse * first;
    let mut value = mean;
    for (x, w, v) in data {
        value -= v * (w / weight * slope.dot(&(x - first)));
    }
    Some(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{Axis, Grid, cuboid, line, rectangle};
    use crate::peridynamics::Micromodulus;

    /// The need of a grid of one material with unit shear modulus.
    fn need<const D: usize>(
        mesh: &Mesh<D>,
        horizon: f64,
        ratio: f64,
        tolerance: f64,
        u: impl Fn(&Vector<D>) -> Vector<D> + Sync,
    ) -> Need {
        let count = mesh.cell_count();
        Criteria {
            mesh,
            tensors: &[Tensor4::isotropic(1.0, 1.0)],
            cell_material: &vec![0; count],
            material: 0,
            horizon: &vec![horizon; count],
            gradient_ratio: ratio,
            tolerance,
            stretch: None,
            cut: &vec![false; count],
            unbreakable: &vec![false; count],
            held: &vec![false; count],
        }
        .need(|n| u(&mesh.nodes[n]))
    }

    fn cells(n: usize) -> Axis {
        Axis::Uniform {
            min: -1.0,
            max: 1.0,
            cells: n,
        }
    }

    #[test]
    fn the_gradient_ratio_has_its_closed_forms() {
        // λ = c/r² in 1D: L x⁴ = ∫ c (6 x² ξ² + ξ⁴) dξ = c (4 x² δ³ + 2 δ⁵/5) with E = c δ³/3, so L − L_0 = 6/5 E δ² = 24 E ℓ²
        let found = gradient_ratio::<1>(|r| Micromodulus::Constant.shape(r, 0.3), 0.3);
        assert!((found * 20.0 - 1.0).abs() < 1e-6, "{found}");
        // λ = c/r³: L x⁴ = ∫ c/|ξ| (6 x² ξ² + ξ⁴) dξ = c (6 x² δ² + δ⁴/2) with E = c δ²/2, so L − L_0 = E δ² = 24 E ℓ²
        let found = gradient_ratio::<1>(|r| Micromodulus::InverseDistance.shape(r, 0.3), 0.3);
        assert!((found * 24.0 - 1.0).abs() < 1e-6, "{found}");
        // 5/12 · 1/6 · (1/5)/(1/3) and 5/12 · 1/7 · (1/6)/(1/4)
        let found = gradient_ratio::<2>(|r| Micromodulus::InverseDistance.shape(r, 2.0), 2.0);
        assert!((found / (5.0 / 72.0 * 0.6) - 1.0).abs() < 1e-6, "{found}");
        let found = gradient_ratio::<3>(|r| Micromodulus::InverseDistance.shape(r, 2.0), 2.0);
        assert!(
            (found / (5.0 / 84.0 * 2.0 / 3.0) - 1.0).abs() < 1e-6,
            "{found}"
        );
    }

    #[test]
    fn a_field_of_the_fourth_degree_has_the_error_of_its_closed_form() {
        // u = x⁴: ε = 4 x³ + x h² in a cell, ℓ²∇²ε = 24 ℓ² x, to round-off; E of λ = μ = 1 is 3 in 1D and drops out
        let (n, delta) = (80, 0.1);
        let h = 2.0 / n as f64;
        let mesh = line(cells(n)).mesh().unwrap();
        let ratio = gradient_ratio::<1>(|r| Micromodulus::InverseDistance.shape(r, delta), delta);
        let found = need(&mesh, delta, ratio, 1.0, |x| Vector::<1>::new(x[0].powi(4)));
        let middle = |i: usize| -1.0 + (i as f64 + 0.5) * h;
        let (mut wrong, mut whole) = (0.0f64, 0.0f64);
        for i in 0..n {
            let x = middle(i);
            // at an end, where the mean is one-sided, a plane leaves half as much: see `level`
            let gradient = 24.0 * ratio * delta * delta * x;
            let strain = 4.0 * x.powi(3) + x * h * h;
            if i >= 2 && i + 2 < n {
                wrong += gradient.powi(2).min(strain.powi(2));
            }
            whole += strain.powi(2);
        }
        let inner = (wrong / whole).sqrt();
        // the four cells at the ends hold less than a tenth of the sum
        assert!(
            found.all_local >= inner * (1.0 - 1e-9) && found.all_local < 1.06 * inner,
            "{} {inner}",
            found.all_local
        );
    }

    #[test]
    fn fields_of_the_second_degree_need_nothing() {
        fn check<const D: usize>(mut grid: Grid<D>) {
            let jittered = grid.jitter(0.2, 7).mesh().unwrap();
            let quadratic = |x: &Vector<D>| Vector::from_fn(|i, _| x[i] * x[(i + 1) % D] + x[0]);
            let found = need(&jittered, 0.4, 0.04, 1e-3, quadratic);
            assert!(found.all_local < 5e-3, "{D} {}", found.all_local);
        }
        check(line(cells(20)));
        check(rectangle(cells(12), cells(12)));
        check(cuboid(cells(8), cells(8), cells(8)));
        let regular = rectangle(cells(12), cells(12)).mesh().unwrap();
        let found = need(&regular, 0.4, 0.04, 1e-3, |x| {
            Vector::<2>::new(x[0] * x[1], x[1] * x[1])
        });
        assert!(found.all_local < 1e-12, "{}", found.all_local);
        assert!(!found.error.contains(&true));
    }

    #[test]
    fn cells_are_marked_until_the_rest_is_within_the_tolerance() {
        let (marked, all, left) = worst(&[4.0, 0.0, 1.0, 3.0, 0.5], 100.0, 0.13);
        assert_eq!(marked, [true, false, false, true, false]);
        assert!((all - 0.085f64.sqrt()).abs() < 1e-12 && (left - 0.015f64.sqrt()).abs() < 1e-12);
        let (marked, all, _) = worst(&[0.0; 3], 0.0, 0.1);
        assert!(!marked.contains(&true) && all == 0.0);
    }

    #[test]
    fn principal_strains_are_those_of_known_tensors() {
        let turned = Tensor::<2>::new(1.0, 2.0, 2.0, 1.0);
        assert!((largest_eigenvalue(&turned) - 3.0).abs() < 1e-14);
        let solid = Tensor::<3>::new(2.0, 1.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0, -5.0);
        assert!((largest_eigenvalue(&solid) - 3.0).abs() < 1e-14);
    }
}
