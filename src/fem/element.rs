//! Quadrature points in space, block rows of an element's stiffness, and fields inside of a cell.

use super::cell::{MAX_NODES, PerNode, ReferenceCell, Rule};
use super::geometry::{jacobian, relative_nodes};
use super::{divided, reference_cell};
use crate::mesh::Mesh;
use crate::tensor::{Tensor, Tensor4, Vector, inverse, padded};

/// A quadrature point of a cell, in space.
///
/// Shapes: `shape` and `gradient` have room for the nodes of any cell; entries from `nodes` on are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadraturePoint<const D: usize> {
    /// Position \[m\].
    pub position: Vector<D>,
    /// `|det J| w` [m^D].
    pub weight: f64,
    /// Shape functions `N_a`.
    pub shape: PerNode<f64>,
    /// Their gradients `∂N_a/∂x` [1/m]; they add up to zero.
    pub gradient: PerNode<Vector<D>>,
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
    let shape = mesh.shapes[c];
    let cell = match mesh.embedded.is_divided(c) {
        false => reference_cell(shape),
        true => divided::of(shape),
    };
    cell.filter(|cell| cell.shape.dimension() == D)
}

/// The point of a cell at reference coordinates `xi` with quadrature weight `w`.
fn point_at<const D: usize>(
    cell: &ReferenceCell,
    origin: &Vector<D>,
    x: &[Vector<D>],
    xi: &[f64; 3],
    w: f64,
) -> QuadraturePoint<D> {
    let shape = (cell.values)(xi);
    let reference_gradients = (cell.gradients)(xi);
    let nodes = cell.nodes();
    let x = &x[..nodes];
    let mut position = *origin;
    for (n, x) in shape.iter().zip(x) {
        position += x * *n;
    }
    let mut gradient = [Vector::zeros(); MAX_NODES];
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

/// Calls `visit` with each quadrature point of cell `c`, without allocating; of a cut cell with those of the part that belongs to the body.
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
    let points = match (mesh.embedded.cut_cell(c), rule) {
        (None, _) => cell.rule(rule),
        (Some(cut), Rule::Stiffness) => &cut.stiffness,
        (Some(cut), Rule::Mass) => &cut.mass,
    };
    for (xi, w) in points {
        visit(&point_at(cell, &origin, &x, xi, *w));
    }
}

/// The points of the full-integration rule of cell `c`; overwrites `points`.
///
/// Line 2, triangle 1, quadrilateral 2 × 2, tetrahedron 1, hexahedron 2 × 2 × 2 points; of second order 3, 3, 3 × 3, 4, 3 × 3 × 3.
pub fn quadrature<const D: usize>(mesh: &Mesh<D>, c: usize, points: &mut Vec<QuadraturePoint<D>>) {
    points.clear();
    for_each_point(mesh, c, Rule::Stiffness, |p| points.push(*p));
}

/// Shape functions of cell `c` at reference coordinates, and how many nodes there are.
pub fn shape_values<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    reference_coordinates: &Vector<D>,
) -> (PerNode<f64>, usize) {
    match reference(mesh, c) {
        Some(cell) => ((cell.values)(&padded(reference_coordinates)), cell.nodes()),
        None => ([0.0; MAX_NODES], 0),
    }
}

/// Adds one quadrature point's share of the block row `K_ab = ∫ ∂N_a/∂x · C · ∂N_b/∂x dV`, `a = local_node`: `L⁰ = ∇·σ` of [SAND2015-7998] eq. (2.11) in weak form.
///
/// Shapes: `blocks[b]` is the block of local node b. Units: \[N/m^(4−D)\], the forces being per unit of thickness in a plane and of area on a line.
pub fn row_at<const D: usize>(
    point: &QuadraturePoint<D>,
    tangent: &Tensor4<D>,
    local_node: usize,
    blocks: &mut [Tensor<D>],
) {
    // a_j C_ijkl is common to all blocks of the row; contracting it first halves the work in 3D and more
    let ga = point.gradient[local_node] * point.weight;
    let mut half = [Tensor::<D>::zeros(); D];
    for (half, c) in half.iter_mut().zip(&tangent.0) {
        for (c, g) in c.iter().zip(ga.iter()) {
            *half += c * *g;
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

/// The stiffness of cell `c`, `K u = f_external`, row by row: the block of local nodes a and b is number `a · nodes + b`; overwrites `blocks`.
pub fn stiffness_into<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    tangent: &Tensor4<D>,
    blocks: &mut Vec<Tensor<D>>,
) {
    let nodes = reference(mesh, c).map_or(0, ReferenceCell::nodes);
    blocks.clear();
    blocks.resize(nodes * nodes, Tensor::zeros());
    for_each_point(mesh, c, Rule::Stiffness, |p| {
        for (a, row) in blocks.chunks_exact_mut(nodes).enumerate() {
            row_at(p, tangent, a, row);
        }
    });
}

/// Length, area or volume of cell `c` [m^D].
pub fn cell_volume<const D: usize>(mesh: &Mesh<D>, c: usize) -> f64 {
    let mut volume = 0.0;
    // det J of a curved cell is of a higher degree than its stiffness needs
    let rule = match mesh.shapes[c].is_quadratic() {
        true => Rule::Mass,
        false => Rule::Stiffness,
    };
    for_each_point(mesh, c, rule, |p| volume += p.weight);
    volume
}

/// The displacement gradient `G_ij = Σ_a u_a,i ∂N_a/∂x_j` at a point of a cell.
///
/// Shapes: `displacement` gives the displacement \[m\] of a local node, below `point.nodes`.
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
/// Shapes: `displacement` gives the displacement \[m\] of a node of the mesh. Strain is [`crate::tensor::strain`] of
/// it, stress that of the law.
pub fn displacement_gradient_at_centre<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    displacement: impl Fn(usize) -> Vector<D>,
) -> Tensor<D> {
    match reference(mesh, c) {
        Some(cell) => displacement_gradient_at(mesh, c, &cell.centre, displacement),
        None => Tensor::zeros(),
    }
}

/// The displacement gradient of cell `c` at reference coordinates `xi`.
///
/// Shapes: as [`displacement_gradient_at_centre`].
pub fn displacement_gradient_at<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    xi: &[f64; 3],
    displacement: impl Fn(usize) -> Vector<D>,
) -> Tensor<D> {
    let Some(cell) = reference(mesh, c) else {
        return Tensor::zeros();
    };
    let (origin, x) = relative_nodes(mesh, c);
    let point = point_at(cell, &origin, &x, xi, 1.0);
    displacement_gradient(&point, |a| displacement(mesh.cell(c)[a] as usize))
}

#[cfg(test)]
mod tests {
    use super::super::sample::{boxes, noise, unit_box};
    use super::*;
    use crate::material::{Elastic, Kinematics};
    use crate::mesh::CellShape;

    fn tangent<const D: usize>(e: f64, nu: f64) -> Tensor4<D> {
        let kinematics = [Kinematics::Bar, Kinematics::PlaneStress, Kinematics::Solid][D - 1];
        Elastic::new(e, nu, 0.0)
            .unwrap()
            .stiffness(kinematics)
            .unwrap()
    }

    /// The block rows of a cell's stiffness.
    fn stiffness<const D: usize>(
        mesh: &Mesh<D>,
        c: usize,
        tangent: &Tensor4<D>,
    ) -> Vec<Vec<Tensor<D>>> {
        let mut blocks = Vec::new();
        stiffness_into(mesh, c, tangent, &mut blocks);
        let nodes = mesh.cell(c).len();
        blocks.chunks(nodes).map(<[_]>::to_vec).collect()
    }

    #[test]
    fn unit_square_in_plane_stress_has_its_published_stiffness() {
        // Sigmund, "A 99 line topology optimization code written in Matlab", 2001: the matrix in closed form
        let nu = 0.3;
        let k = [
            0.5 - nu / 6.0,
            0.125 + nu / 8.0,
            -0.25 - nu / 12.0,
            -0.125 + 3.0 * nu / 8.0,
            -0.25 + nu / 12.0,
            -0.125 - nu / 8.0,
            nu / 6.0,
            0.125 - 3.0 * nu / 8.0,
        ];
        let pattern = [
            [1, 2, 3, 4, 5, 6, 7, 8],
            [2, 1, 8, 7, 6, 5, 4, 3],
            [3, 8, 1, 6, 7, 4, 5, 2],
            [4, 7, 6, 1, 8, 3, 2, 5],
            [5, 6, 7, 8, 1, 2, 3, 4],
            [6, 5, 4, 3, 2, 1, 8, 7],
            [7, 4, 5, 2, 3, 8, 1, 6],
            [8, 3, 2, 5, 4, 7, 6, 1],
        ];
        let mesh = unit_box::<2>(CellShape::Quad4, 1, 0.0);
        let rows = stiffness(&mesh, 0, &tangent::<2>(1.0, nu));
        for (p, line) in pattern.iter().enumerate() {
            for (q, entry) in line.iter().enumerate() {
                // the box numbers its nodes by rows, the cell counter-clockwise
                let found = rows[p / 2][q / 2][(p % 2, q % 2)];
                let expected = k[entry - 1] / (1.0 - nu * nu);
                assert!((found - expected).abs() < 1e-15, "{p} {q}");
            }
        }
    }

    #[test]
    fn unit_cube_line_and_triangle_have_their_published_stiffness() {
        // [LiuTovar2014]: first two entries
        let nu = 0.3;
        let mesh = unit_box::<3>(CellShape::Hex8, 1, 0.0);
        let rows = stiffness(&mesh, 0, &tangent::<3>(1.0, nu));
        let factor = 1.0 / ((1.0 + nu) * (1.0 - 2.0 * nu) * 144.0);
        assert!((rows[0][0][(0, 0)] - factor * (32.0 - 48.0 * nu)).abs() < 1e-15);
        assert!((rows[0][0][(0, 1)] - factor * 6.0).abs() < 1e-15);
        // E A / L
        let mesh = unit_box::<1>(CellShape::Line2, 4, 0.0);
        let rows = stiffness(&mesh, 2, &tangent::<1>(3.0, nu));
        assert!((rows[0][0][(0, 0)] - 12.0).abs() < 1e-13);
        assert!((rows[0][1][(0, 0)] + 12.0).abs() < 1e-13);
        // constant-strain triangle: with b_a = y_b − y_c, c_a = x_c − x_b, K_ab,xx = t (C11 b_a b_b + C33 c_a c_b) / (4A)
        let mut mesh = Mesh::<2> {
            nodes: [[0.3, 0.1], [2.1, 0.4], [0.8, 1.7]]
                .map(|x| Vector::<2>::new(x[0], x[1]))
                .to_vec(),
            ..Mesh::default()
        };
        mesh.push_cell(CellShape::Tri3, &[0, 1, 2]);
        let rows = stiffness(&mesh, 0, &tangent::<2>(1.0, nu));
        let (b, c) = (
            [0.4 - 1.7, 1.7 - 0.1, 0.1 - 0.4],
            [0.8 - 2.1, 0.3 - 0.8, 2.1 - 0.3],
        );
        let twice_area = 1.8 * 1.6 - 0.5 * 0.3;
        let (c11, c12, c33) = (1.0 / 0.91, 0.3 / 0.91, 0.35 / 0.91);
        for p in 0..3 {
            for q in 0..3 {
                let xx = (c11 * b[p] * b[q] + c33 * c[p] * c[q]) / (2.0 * twice_area);
                let xy = (c12 * b[p] * c[q] + c33 * c[p] * b[q]) / (2.0 * twice_area);
                assert!((rows[p][q][(0, 0)] - xx).abs() < 1e-14);
                assert!((rows[p][q][(0, 1)] - xy).abs() < 1e-14);
            }
        }
    }

    fn kernel_is_right<const D: usize>() {
        for mesh in boxes::<D>(3, 0.3) {
            let c = mesh.cell_count() / 2;
            let tangent = tangent::<D>(1.0, 0.3);
            let rows = stiffness(&mesh, c, &tangent);
            let nodes = mesh.cell(c).len();
            // a tensor without any symmetry tells its indices apart
            let mut odd = Tensor4::<D>::zeros();
            for i in 0..D {
                for j in 0..D {
                    odd.0[i][j] = Tensor::from_fn(|k, l| noise(9 * i + j, 7 * k + l));
                }
            }
            let mut expected = vec![vec![Tensor::<D>::zeros(); nodes]; nodes];
            for_each_point(&mesh, c, Rule::Stiffness, |p| {
                for (row, ga) in expected.iter_mut().zip(&p.gradient) {
                    for (block, gb) in row.iter_mut().zip(&p.gradient) {
                        *block += odd.between(ga, gb) * p.weight;
                    }
                }
            });
            for (row, expected) in stiffness(&mesh, c, &odd).iter().zip(&expected) {
                for (block, expected) in row.iter().zip(expected) {
                    assert!((block - expected).amax() < 1e-14);
                }
            }
            // as many zero modes as there are rigid ones, and no negative one
            let n = nodes * D;
            let k = nalgebra::DMatrix::from_fn(n, n, |p, q| rows[p / D][q / D][(p % D, q % D)]);
            let values = k.symmetric_eigenvalues();
            let top = values.amax();
            let free = values.iter().filter(|v| v.abs() < 1e-12 * top).count();
            assert_eq!(free, D * (D + 1) / 2, "{:?}", mesh.shapes[c]);
            assert!(values.iter().all(|&v| v > -1e-12 * top));
            // gradients reproduce an affine field and add up to zero
            let g = Tensor::<D>::from_fn(noise);
            let shift = Vector::<D>::repeat(0.3);
            let mut points = Vec::new();
            quadrature(&mesh, c, &mut points);
            for p in &points {
                let sum: Vector<D> = p.gradient.iter().sum();
                assert!(sum.amax() < 1e-14);
                let at = |a: usize| g * mesh.nodes[mesh.cell(c)[a] as usize] + shift;
                assert!((displacement_gradient(p, at) - g).amax() < 1e-13);
            }
            let centre = displacement_gradient_at_centre(&mesh, c, |n| g * mesh.nodes[n] + shift);
            assert!((centre - g).amax() < 1e-13);
        }
    }

    #[test]
    fn kernels_are_right_on_distorted_cells() {
        kernel_is_right::<1>();
        kernel_is_right::<2>();
        kernel_is_right::<3>();
    }
}
