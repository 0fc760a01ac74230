//! Small meshes for the tests of this folder, with closed-form geometry.

use std::collections::BTreeMap;

use super::element::stiffness_into;
use crate::mesh::{CellShape, Mesh};
use crate::system::BlockCsr;
use crate::tensor::{Tensor, Tensor4, Vector};

/// A number in [-1, 1] that depends on its arguments only.
pub fn noise(a: usize, b: usize) -> f64 {
    let x = ((a * 131 + b * 71 + 17) as f64 * 12.9898).sin() * 43758.5453;
    2.0 * (x - x.floor()) - 1.0
}

/// `n^D` cells of shape `shape` on the unit box; inner corners are moved by up to `jitter` spacings, and nodes in the middle of edges lie there.
pub fn unit_box<const D: usize>(shape: CellShape, n: usize, jitter: f64) -> Mesh<D> {
    let h = 1.0 / n as f64;
    let mut mesh = Mesh::default();
    let m = n + 1;
    for number in 0..m.pow(D as u32) {
        let index = [number % m, number / m % m, number / m / m];
        let inner = (0..D).all(|i| index[i] > 0 && index[i] < n);
        mesh.nodes.push(Vector::from_fn(|i, _| {
            let shift = if inner {
                jitter * noise(number, i)
            } else {
                0.0
            };
            (index[i] as f64 + shift) * h
        }));
    }
    let at = |i: usize, j: usize, k: usize| ((k * m + j) * m + i) as u32;
    for number in 0..n.pow(D as u32) {
        let (i, j, k) = (number % n, number / n % n, number / n / n);
        let hex = [
            at(i, j, k),
            at(i + 1, j, k),
            at(i + 1, j + 1, k),
            at(i, j + 1, k),
            at(i, j, k + 1),
            at(i + 1, j, k + 1),
            at(i + 1, j + 1, k + 1),
            at(i, j + 1, k + 1),
        ];
        for pick in shape.in_box() {
            let nodes: Vec<u32> = pick.iter().map(|&p| hex[p]).collect();
            mesh.push_cell(shape.linear(), &nodes);
        }
    }
    if shape.is_quadratic() {
        mesh.raise_order();
    }
    mesh
}

/// A jittered unit box of every shape that has dimension `D`.
pub fn boxes<const D: usize>(n: usize, jitter: f64) -> Vec<Mesh<D>> {
    super::CELLS
        .iter()
        .filter(|cell| cell.shape.dimension() == D)
        .map(|cell| unit_box(cell.shape, n, jitter))
        .collect()
}

/// The stiffness of the cells that have a tangent, `K u = f_external`: one block row per node.
pub fn assemble<'a, const D: usize>(
    mesh: &Mesh<D>,
    tangent: impl Fn(usize) -> Option<&'a Tensor4<D>>,
) -> BlockCsr {
    let mut rows = vec![BTreeMap::<u32, Tensor<D>>::new(); mesh.nodes.len()];
    let mut blocks = Vec::new();
    for c in 0..mesh.cell_count() {
        let Some(tangent) = tangent(c) else {
            continue;
        };
        stiffness_into(mesh, c, tangent, &mut blocks);
        let nodes = mesh.cell(c);
        for (a, row) in nodes.iter().zip(blocks.chunks_exact(nodes.len())) {
            for (b, block) in nodes.iter().zip(row) {
                *rows[*a as usize].entry(*b).or_insert_with(Tensor::zeros) += block;
            }
        }
    }
    let mut k = BlockCsr {
        block: D,
        row_offsets: vec![0],
        columns: Vec::new(),
        values: Vec::new(),
        shared: None,
    };
    for row in rows {
        for (column, block) in row {
            k.columns.push(column);
            let entries = (0..D).flat_map(|i| (0..D).map(move |j| (i, j)));
            k.values.extend(entries.map(|at| block[at]));
        }
        k.row_offsets.push(k.columns.len());
    }
    k
}

/// Solves `K u = f` by dense LU with some unknowns prescribed.
pub fn solve(k: &BlockCsr, f: &[f64], fixed: &[(usize, f64)]) -> Vec<f64> {
    let (n, d) = (k.dofs(), k.block);
    let mut a = nalgebra::DMatrix::<f64>::zeros(n, n);
    let mut b = nalgebra::DVector::from_column_slice(f);
    for i in 0..k.rows() {
        let (columns, blocks) = k.row(i);
        for (e, &c) in columns.iter().enumerate() {
            for p in 0..d {
                for q in 0..d {
                    a[(i * d + p, c as usize * d + q)] = blocks[(e * d + p) * d + q];
                }
            }
        }
    }
    for &(i, value) in fixed {
        a.row_mut(i).fill(0.0);
        a[(i, i)] = 1.0;
        b[i] = value;
    }
    a.lu().solve(&b).unwrap().iter().copied().collect()
}
