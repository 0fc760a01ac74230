//! Places of the nodes of a cell, Jacobians, and normals of facets.

use super::cell::{MAX_NODES, PerNode};
use crate::mesh::Mesh;
use crate::tensor::{Tensor, Vector};

/// Positions of the nodes relative to the first, which keeps digits of small cells far from the origin.
pub(super) fn relative_nodes<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
) -> (Vector<D>, PerNode<Vector<D>>) {
    let nodes = mesh.cell(c);
    let origin = mesh.nodes[nodes[0] as usize];
    let mut x = [Vector::zeros(); MAX_NODES];
    for (x, &n) in x.iter_mut().zip(nodes) {
        *x = mesh.nodes[n as usize] - origin;
    }
    (origin, x)
}

/// `J_ij = ∂x_i/∂ξ_j` from the positions of a cell's nodes and reference gradients.
pub(super) fn jacobian<const D: usize>(x: &[Vector<D>], gradients: &[[f64; 3]]) -> Tensor<D> {
    let mut j = Tensor::zeros();
    for (x, g) in x.iter().zip(gradients) {
        for k in 0..D {
            for i in 0..D {
                j[(i, k)] += x[i] * g[k];
            }
        }
    }
    j
}

/// The unit normal of a facet with these tangents: on the right of `p` in 2D, along `p × q` in 3D.
pub(super) fn normal<const D: usize>(p: &Vector<D>, q: &Vector<D>) -> Vector<D> {
    let normal: Vector<D> = match D {
        2 => Vector::from_fn(|k, _| if k == 0 { p[1] } else { -p[0] }),
        3 => Vector::from_fn(|k, _| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            p[i] * q[j] - p[j] * q[i]
        }),
        _ => Vector::zeros(),
    };
    normal.try_normalize(0.0).unwrap_or_else(Vector::zeros)
}
