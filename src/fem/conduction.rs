//! Matrices of heat conduction: `c ∂T/∂t = ∇·(k ∇T) + q` in the body, `k ∂T/∂n = h (T∞ − T)` on surfaces that exchange heat.
//!
//! With `T = Σ_b T_b N_b` the weak form is `C ∂T/∂t + (K + H) T = f`:
//!
//! ```text
//!   K_ab = ∫ k ∇N_a·∇N_b dV      C_ab = ∫ c N_a N_b dV      H_ab = ∫ h N_a N_b dA      f_a = ∫ N_a q dV + ∫ N_a h T∞ dA
//! ```
//!
//! Source: \[CarslawJaeger1959\] sections 1.6 and 1.9. Loads are the first components of [`super::body_force_vector`] and [`super::traction_vector`].

use super::cell::Rule;
use super::element::{QuadraturePoint, for_each_point};
use super::load::facet_points;
use crate::mesh::Mesh;
use crate::system::BlockCsr;

/// Conductance `K_ab = ∫ k ∇N_a·∇N_b dV` [W/K] of all cells, one row per node.
///
/// `conductivity` is k of a cell [W/(m K)]; the row of a node without a cell is empty.
pub fn conductance<const D: usize>(
    mesh: &Mesh<D>,
    conductivity: impl Fn(usize) -> f64,
) -> BlockCsr {
    let entry = |c: usize, p: &QuadraturePoint<D>, a: usize, b: usize| {
        conductivity(c) * p.gradient[a].dot(&p.gradient[b])
    };
    assembled(mesh, Rule::Stiffness, entry)
}

/// Consistent heat capacity `C_ab = ∫ c N_a N_b dV` [J/K] of all cells, in the pattern of [`conductance`].
///
/// `capacity` is the heat capacity of a cell per volume [J/(m³ K)].
pub fn heat_capacity<const D: usize>(mesh: &Mesh<D>, capacity: impl Fn(usize) -> f64) -> BlockCsr {
    let entry = |c: usize, p: &QuadraturePoint<D>, a: usize, b: usize| {
        capacity(c) * p.shape[a] * p.shape[b]
    };
    assembled(mesh, Rule::Mass, entry)
}

/// Adds `H_ab = ∫ h N_a N_b dA` [W/K] of a facet of a cell to a matrix of [`conductance`].
///
/// `coefficient` is h [W/(m² K)].
pub fn add_heat_transfer<const D: usize>(
    mesh: &Mesh<D>,
    facet: &[u32],
    coefficient: f64,
    matrix: &mut BlockCsr,
) {
    facet_points(mesh, facet, |p| {
        for (&i, a) in facet.iter().zip(&p.shape) {
            for (&j, b) in facet.iter().zip(&p.shape) {
                add(matrix, (i, j), coefficient * a * b * p.weight);
            }
        }
    });
}

/// Sum over all cells of the integrals of `entry`, a number per quadrature point and pair of local nodes.
fn assembled<const D: usize>(
    mesh: &Mesh<D>,
    rule: Rule,
    entry: impl Fn(usize, &QuadraturePoint<D>, usize, usize) -> f64,
) -> BlockCsr {
    let mut matrix = pattern(mesh);
    let mut sums = Vec::new();
    for c in 0..mesh.cell_count() {
        let nodes = mesh.cell(c);
        sums.clear();
        sums.resize(nodes.len() * nodes.len(), 0.0);
        for_each_point(mesh, c, rule, |p| {
            for (a, row) in sums.chunks_exact_mut(nodes.len()).enumerate() {
                for (b, sum) in row.iter_mut().enumerate() {
                    *sum += entry(c, p, a, b) * p.weight;
                }
            }
        });
        let pairs = nodes
            .iter()
            .flat_map(|&i| nodes.iter().map(move |&j| (i, j)));
        for (at, sum) in pairs.zip(&sums) {
            add(&mut matrix, at, *sum);
        }
    }
    matrix
}

/// Zeros for each pair of nodes that share a cell.
fn pattern<const D: usize>(mesh: &Mesh<D>) -> BlockCsr {
    let (offsets, cells) = mesh.node_cells();
    let mut matrix = BlockCsr {
        block: 1,
        row_offsets: vec![0],
        columns: Vec::new(),
        values: Vec::new(),
        shared: None,
    };
    let mut row = Vec::new();
    for around in offsets.windows(2) {
        row.clear();
        for &c in &cells[around[0] as usize..around[1] as usize] {
            row.extend_from_slice(mesh.cell(c as usize));
        }
        row.sort_unstable();
        row.dedup();
        matrix.columns.extend_from_slice(&row);
        matrix.row_offsets.push(matrix.columns.len());
    }
    matrix.values = vec![0.0; matrix.columns.len()];
    matrix
}

/// Adds to an entry of a matrix that has it.
fn add(matrix: &mut BlockCsr, (i, j): (u32, u32), value: f64) {
    let row = matrix.row_offsets[i as usize]..matrix.row_offsets[i as usize + 1];
    let found = matrix.columns[row.clone()].binary_search(&j);
    debug_assert!(found.is_ok(), "nodes {i} and {j} share no cell");
    if let Ok(k) = found {
        matrix.values[row.start + k] += value;
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample::boxes;
    use super::*;
    use crate::tensor::Vector;

    fn integrals_are_right<const D: usize>() {
        for mesh in boxes::<D>(3, 0.2) {
            let slope = Vector::<D>::from_fn(|i, _| 1.0 + i as f64);
            let field: Vec<f64> = mesh.nodes.iter().map(|x| 0.3 + slope.dot(x)).collect();
            let energy = |matrix: &BlockCsr, v: &[f64]| {
                let product = matrix.multiply(v);
                product.iter().zip(v).map(|(p, v)| p * v).sum::<f64>()
            };
            // ∫ k |∇T|² and ∫ c over the unit box
            let k = conductance(&mesh, |_| 3.0);
            assert!((energy(&k, &field) - 3.0 * slope.norm_squared()).abs() < 1e-12);
            let ones = vec![1.0; field.len()];
            let c = heat_capacity(&mesh, |_| 2.0);
            assert!((energy(&c, &ones) - 2.0).abs() < 1e-12);
            // of the surface: h times the area of a side, x = 0 of a box whose nodes there did not move off it
            let sides = mesh.outer_facets();
            let is_left = |n: &u32| mesh.nodes[*n as usize][0].abs() < 1e-12;
            let mut h = conductance(&mesh, |_| 0.0);
            for side in sides.iter().filter(|side| side.nodes.iter().all(is_left)) {
                add_heat_transfer(&mesh, &side.nodes, 5.0, &mut h);
            }
            assert!((energy(&h, &ones) - 5.0).abs() < 1e-12);
        }
    }

    #[test]
    fn matrices_of_every_cell_integrate_affine_fields() {
        integrals_are_right::<1>();
        integrals_are_right::<2>();
        integrals_are_right::<3>();
    }
}
