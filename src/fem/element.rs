//! Quadrature points in space, block rows of an element's stiffness, and fields inside of a cell.

use super::cell::{ReferenceCell, Rule};
use super::reference_cell;
use crate::mesh::Mesh;
use crate::tensor::{Tensor, Tensor4, Vector, inverse, padded};

/// A quadrature point of a cell, in space.
///
/// Shapes: `shape` and `gradient` have room for eight nodes; entries from `nodes` on are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadraturePoint<const D: usize> {
    /// Position [m].
    pub position: Vector<D>,
    /// `|det J| w` [m^D].
    pub weight: f64,
    /// Shape functions `N_a`.
    pub shape: [f64; 8],
    /// Their gradients `∂N_a/∂x` [1/m]; they add up to zero.
    pub gradient: [Vector<D>; 8],
    /// Number of nodes.
    pub nodes: usize,
}

/// The cell that `c` is an instance of, if elements of dimension `D` live on it.
///
/// `check` has refused other cells before any kernel runs; for those that come here unchecked a kernel does nothing.
pub(super) fn reference<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
) -> Option<&'static ReferenceCell> {
    reference_cell(mesh.shapes[c]).filter(|cell| cell.shape.dimension() == D)
}

/// Positions of the nodes relative to the first, which keeps digits of small cells far from the origin.
pub(super) fn relative_nodes<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
) -> (Vector<D>, [Vector<D>; 8]) {
    let nodes = mesh.cell(c);
    let origin = mesh.nodes[nodes[0] as usize];
    let mut x = [Vector::zeros(); 8];
    for (x, &n) in x.iter_mut().zip(nodes) {
        *x = mesh.nodes[n as usize] - origin;
    }
    (origin, x)
}

/// `J_ij = ∂x_i/∂ξ_j` from node positions and reference gradients.
pub(super) fn jacobian<const D: usize>(x: &[Vector<D>; 8], gradients: &[[f64; 3]; 8]) -> Tensor<D> {
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

/// The point of a cell at reference coordinates `xi` with quadrature weight `w`.
fn point_at<const D: usize>(
    cell: &ReferenceCell,
    origin: &Vector<D>,
    x: &[Vector<D>; 8],
    xi: &[f64; 3],
    w: f64,
) -> QuadraturePoint<D> {
    let shape = (cell.values)(xi);
    let reference_gradients = (cell.gradients)(xi);
    let nodes = cell.nodes();
    let mut position = *origin;
    for (n, x) in shape.iter().zip(x) {
        position += x * *n;
    }
    let mut gradient = [Vector::zeros(); 8];
    let mut weight = 0.0;
    if let Some((inverse, det)) = inverse(&jacobian(x, &reference_gradients)) {
        weight = det.abs() * w;
        for (g, r) in gradient.iter_mut().zip(&reference_gradients).take(nodes) {
            for i in 0..D {
                for k in 0..D {
                    g[i] += inverse[(k, i)] * r[k];
                }
            }
        }
    }
    QuadraturePoint {
        position,
        weight,
        shape,
        gradient,
        nodes,
    }
}

/// Calls `visit` with each quadrature point of cell `c`, without allocating.
///
/// Precondition: the mesh has passed [`super::check`]. A cell that no element can live on has no points.
pub fn for_each_point<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    rule: Rule,
    mut visit: impl FnMut(&QuadraturePoint<D>),
) {
    let Some(cell) = reference(mesh, c) else {
        return;
    };
    let (origin, x) = relative_nodes(mesh, c);
    for (xi, w) in cell.rule(rule) {
        visit(&point_at(cell, &origin, &x, xi, *w));
    }
}

/// The points of the full-integration rule of cell `c`; overwrites `points`.
///
/// Line 2, triangle 1, quadrilateral 2 × 2, tetrahedron 1, hexahedron 2 × 2 × 2 points.
pub fn quadrature<const D: usize>(mesh: &Mesh<D>, c: usize, points: &mut Vec<QuadraturePoint<D>>) {
    quadrature_of(mesh, c, Rule::Stiffness, points);
}

/// The points of a rule of cell `c`; overwrites `points`.
pub fn quadrature_of<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    rule: Rule,
    points: &mut Vec<QuadraturePoint<D>>,
) {
    points.clear();
    for_each_point(mesh, c, rule, |p| points.push(*p));
}

/// Shape functions of cell `c` at reference coordinates, and how many nodes there are.
pub fn shape_values<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    reference_coordinates: &Vector<D>,
) -> ([f64; 8], usize) {
    match reference(mesh, c) {
        Some(cell) => ((cell.values)(&padded(reference_coordinates)), cell.nodes()),
        None => ([0.0; 8], 0),
    }
}

/// Adds one quadrature point's share of the block row `K_ab = ∫ ∂N_a/∂x · C · ∂N_b/∂x dV`, `a = local_node`.
///
/// Shapes: `blocks[b]` is the block of local node b. Units: [N/m^(D−2)] per unit thickness where D < 3.
pub fn row_at<const D: usize>(
    point: &QuadraturePoint<D>,
    tangent: &Tensor4<D>,
    local_node: usize,
    blocks: &mut [Tensor<D>; 8],
) {
    // a_j C_ijkl is common to all blocks of the row; contracting it first halves the work in 3D and more
    let ga = point.gradient[local_node] * point.weight;
    let mut half = [Tensor::<D>::zeros(); D];
    for i in 0..D {
        for j in 0..D {
            half[i] += tangent.0[i][j] * ga[j];
        }
    }
    for (block, gb) in blocks.iter_mut().zip(&point.gradient).take(point.nodes) {
        for i in 0..D {
            for k in 0..D {
                let mut s = 0.0;
                for l in 0..D {
                    s += half[i][(k, l)] * gb[l];
                }
                block[(i, k)] += s;
            }
        }
    }
}

/// The block row of node `local_node` in the stiffness of cell `c`: `K u = f_external`; overwrites `blocks`.
///
/// Shapes: `blocks[b]` is the block of local node b; blocks beyond the cell's nodes are zero.
pub fn row<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    tangent: &Tensor4<D>,
    local_node: usize,
    blocks: &mut [Tensor<D>; 8],
) {
    *blocks = [Tensor::zeros(); 8];
    for_each_point(mesh, c, Rule::Stiffness, |p| {
        row_at(p, tangent, local_node, blocks);
    });
}

/// All block rows of the stiffness of cell `c`: `[a][b]` is the block of local nodes a and b.
pub fn stiffness<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    tangent: &Tensor4<D>,
) -> [[Tensor<D>; 8]; 8] {
    let mut rows = [[Tensor::zeros(); 8]; 8];
    for_each_point(mesh, c, Rule::Stiffness, |p| {
        for (a, blocks) in rows.iter_mut().enumerate().take(p.nodes) {
            row_at(p, tangent, a, blocks);
        }
    });
    rows
}

/// Length, area or volume of cell `c` [m^D].
pub fn cell_volume<const D: usize>(mesh: &Mesh<D>, c: usize) -> f64 {
    let mut volume = 0.0;
    for_each_point(mesh, c, Rule::Stiffness, |p| volume += p.weight);
    volume
}

/// The displacement gradient `G_ij = Σ_a u_a,i ∂N_a/∂x_j` at a point of a cell.
///
/// Shapes: `displacement` gives the displacement [m] of a local node, below `point.nodes`.
pub fn displacement_gradient<const D: usize>(
    point: &QuadraturePoint<D>,
    mut displacement: impl FnMut(usize) -> Vector<D>,
) -> Tensor<D> {
    let mut g = Tensor::zeros();
    for a in 0..point.nodes {
        g += displacement(a) * point.gradient[a].transpose();
    }
    g
}

/// The displacement gradient at the centre of cell `c`, where low-order cells are most accurate; for output.
///
/// Shapes: `displacement` gives the displacement [m] of a node of the mesh. Strain is [`crate::tensor::strain`] of
/// it, stress that of the law.
pub fn displacement_gradient_at_centre<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    displacement: impl Fn(usize) -> Vector<D>,
) -> Tensor<D> {
    let Some(cell) = reference(mesh, c) else {
        return Tensor::zeros();
    };
    let (origin, x) = relative_nodes(mesh, c);
    let centre = point_at(cell, &origin, &x, &cell.centre, 1.0);
    displacement_gradient(&centre, |a| displacement(mesh.cell(c)[a] as usize))
}
