//! Consistent nodal forces of tractions and body forces.

use super::cell::{GAUSS_3, ReferenceCell, Rule, RulePoint};
use super::element::for_each_point;
use super::{line2, quad4, tri3};
use crate::mesh::Mesh;
use crate::mesh::boundary::BoundaryFacet;
use crate::tensor::Vector;

/// Three Gauss points: exact to degree 5, so that a traction of degree 4 is integrated exactly.
const LINE: [(f64, f64); 3] = [
    (-GAUSS_3, 5.0 / 9.0),
    (0.0, 8.0 / 9.0),
    (GAUSS_3, 5.0 / 9.0),
];

/// Six points on the triangle, exact to degree 4: two orbits `(a, a, 1 − 2a)`.
const TRIANGLE: [(f64, f64); 2] = [
    (0.445_948_490_915_964_9, 0.111_690_794_839_005_73),
    (0.091_576_213_509_770_74, 0.054_975_871_827_660_93),
];

/// A quadrature point of a facet.
///
/// Shapes: `shape` has one entry per node of the facet (up to four).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacetPoint<const D: usize> {
    /// Position \[m\].
    pub position: Vector<D>,
    /// Weight [m^(D−1)]; 1 for the single point of a facet in 1D.
    pub weight: f64,
    /// Shape functions of the facet's nodes.
    pub shape: [f64; 4],
    /// Unit normal, to the side to which the order of the nodes turns right-handed; zero in 1D.
    pub normal: Vector<D>,
}

/// Calls `visit` with each quadrature point of a facet, given by its nodes in order.
///
/// Point in 1D; edge in 2D with 3 Gauss points; triangle with 6 and quadrilateral with 3 × 3 points in 3D.
///
/// # Panics
/// For a facet of another number of nodes, which no cell of [`super::CELLS`] has: a traction on it would be no force.
pub fn facet_points<const D: usize>(
    mesh: &Mesh<D>,
    facet: &[u32],
    mut visit: impl FnMut(&FacetPoint<D>),
) {
    match (D, facet.len()) {
        (1, 1) => visit(&FacetPoint {
            position: mesh.nodes[facet[0] as usize],
            weight: 1.0,
            shape: [1.0, 0.0, 0.0, 0.0],
            normal: Vector::zeros(),
        }),
        (2, 2) => {
            for (x, w) in LINE {
                visit(&facet_point(mesh, facet, &line2::CELL, &([x, 0.0, 0.0], w)));
            }
        }
        (3, 3) => {
            for (a, w) in TRIANGLE {
                let b = 1.0 - 2.0 * a;
                for xi in [[a, a, 0.0], [b, a, 0.0], [a, b, 0.0]] {
                    visit(&facet_point(mesh, facet, &tri3::CELL, &(xi, w)));
                }
            }
        }
        (3, 4) => {
            for (x, wx) in LINE {
                for (y, wy) in LINE {
                    visit(&facet_point(
                        mesh,
                        facet,
                        &quad4::CELL,
                        &([x, y, 0.0], wx * wy),
                    ));
                }
            }
        }
        (_, nodes) => panic!("a facet of {nodes} nodes in {D} dimensions has no quadrature"),
    }
}

fn facet_point<const D: usize>(
    mesh: &Mesh<D>,
    facet: &[u32],
    cell: &ReferenceCell,
    (xi, w): &RulePoint,
) -> FacetPoint<D> {
    let values = (cell.values)(xi);
    let gradients = (cell.gradients)(xi);
    let origin = mesh.nodes[facet[0] as usize];
    let mut position = origin;
    let mut tangents: [Vector<D>; 2] = [Vector::zeros(); 2];
    let mut shape = [0.0; 4];
    for (a, &n) in facet.iter().enumerate() {
        let x = mesh.nodes[n as usize] - origin;
        shape[a] = values[a];
        position += x * values[a];
        tangents[0] += x * gradients[a][0];
        tangents[1] += x * gradients[a][1];
    }
    let [p, q] = tangents;
    // Gram determinant: the area that the tangents span, in any dimension
    let stretch = if cell.shape.dimension() == 1 {
        p.norm()
    } else {
        let pq = p.dot(&q);
        (p.norm_squared() * q.norm_squared() - pq * pq)
            .max(0.0)
            .sqrt()
    };
    FacetPoint {
        position,
        weight: stretch * w,
        shape,
        normal: normal(&p, &q),
    }
}

/// The unit normal of a facet with these tangents: on the right of `p` in 2D, along `p × q` in 3D.
fn normal<const D: usize>(p: &Vector<D>, q: &Vector<D>) -> Vector<D> {
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

/// Visits the quadrature points of a facet with its outward unit normal there, in 1D too.
pub fn outward_points<const D: usize>(
    mesh: &Mesh<D>,
    facet: &BoundaryFacet,
    mut visit: impl FnMut(&FacetPoint<D>),
) {
    let of_point = (D == 1).then(|| mesh.facet_normal_area(facet));
    facet_points(mesh, &facet.nodes, |p| match of_point {
        Some(normal) => visit(&FacetPoint { normal, ..*p }),
        None => visit(p),
    });
}

/// Length or area of a facet [m^(D−1)]; 1 for a point in 1D.
pub fn facet_area<const D: usize>(mesh: &Mesh<D>, facet: &[u32]) -> f64 {
    let mut area = 0.0;
    facet_points(mesh, facet, |p| area += p.weight);
    area
}

/// Consistent nodal forces `f_a = ∫ N_a t dA` of a traction on a facet: one (node, force) per node of the facet.
///
/// `traction` is t(x) [N/m²] (force per length and unit thickness in 2D, force in 1D). Forces \[N\].
pub fn traction_vector<const D: usize>(
    mesh: &Mesh<D>,
    facet: &[u32],
    traction: impl Fn(&Vector<D>) -> Vector<D>,
) -> Vec<(u32, Vector<D>)> {
    let mut forces: Vec<(u32, Vector<D>)> = facet.iter().map(|&n| (n, Vector::zeros())).collect();
    facet_points(mesh, facet, |p| {
        let t = traction(&p.position) * p.weight;
        for ((_, f), n) in forces.iter_mut().zip(&p.shape) {
            *f += t * *n;
        }
    });
    forces
}

/// Consistent nodal forces `f_a = ∫ N_a t(x, n) dA` of a traction that knows the outward unit normal n: one (node, force) per node of the facet.
///
/// `traction` is t(x, n) [N/m²], `−p n` of a pressure p. Forces \[N\].
pub fn outward_traction_vector<const D: usize>(
    mesh: &Mesh<D>,
    facet: &BoundaryFacet,
    traction: impl Fn(&Vector<D>, &Vector<D>) -> Vector<D>,
) -> Vec<(u32, Vector<D>)> {
    let nodes = facet.nodes.iter();
    let mut forces: Vec<(u32, Vector<D>)> = nodes.map(|&n| (n, Vector::zeros())).collect();
    outward_points(mesh, facet, |p| {
        let t = traction(&p.position, &p.normal) * p.weight;
        for ((_, f), n) in forces.iter_mut().zip(&p.shape) {
            *f += t * *n;
        }
    });
    forces
}

/// Consistent nodal forces `f_a = ∫ N_a b dV` of a body force in cell `c`: one (node, force) per node of the cell.
///
/// `body_force` is b(x) [N/m^D]; exact where b is affine and the cell too. Forces \[N\].
pub fn body_force_vector<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    body_force: impl Fn(&Vector<D>) -> Vector<D>,
) -> Vec<(u32, Vector<D>)> {
    let mut forces: Vec<(u32, Vector<D>)> =
        mesh.cell(c).iter().map(|&n| (n, Vector::zeros())).collect();
    for_each_point(mesh, c, Rule::Mass, |p| {
        let b = body_force(&p.position) * p.weight;
        for ((_, f), n) in forces.iter_mut().zip(&p.shape) {
            *f += b * *n;
        }
    });
    forces
}

#[cfg(test)]
mod tests {
    use super::super::sample::boxes;
    use super::*;

    #[test]
    fn edge_forces_of_a_linear_traction_are_those_of_the_textbook() {
        let mesh = Mesh::<2> {
            nodes: vec![Vector::<2>::new(1.0, 1.0), Vector::<2>::new(4.0, 5.0)],
            ..Mesh::default()
        };
        // t grows from p to q along an edge of length 5: f = L (2p + q) / 6 and L (p + 2q) / 6
        let t = |x: &Vector<2>| Vector::<2>::new(2.0 + 3.0 * (x[0] - 1.0) / 3.0, 0.0);
        let f = traction_vector(&mesh, &[0, 1], t);
        assert!((f[0].1[0] - 5.0 * (2.0 * 2.0 + 5.0) / 6.0).abs() < 1e-13);
        assert!((f[1].1[0] - 5.0 * (2.0 + 2.0 * 5.0) / 6.0).abs() < 1e-13);
        assert_eq!((f[0].0, f[1].0), (0, 1));
        assert!((facet_area(&mesh, &[0, 1]) - 5.0).abs() < 1e-14);
    }

    #[test]
    fn face_forces_add_up_to_force_and_moment() {
        let mesh = Mesh::<3> {
            nodes: vec![
                Vector::<3>::new(0.0, 0.0, 1.0),
                Vector::<3>::new(2.0, 0.0, 1.0),
                Vector::<3>::new(2.0, 3.0, 1.0),
                Vector::<3>::new(0.0, 3.0, 1.0),
            ],
            ..Mesh::default()
        };
        // pressure x^3 y on a 2 by 3 rectangle: total 4 * 4.5, first moment in x 32/5 * 4.5
        let t = |x: &Vector<3>| Vector::<3>::new(0.0, 0.0, x[0].powi(3) * x[1]);
        let sums = |f: &[(u32, Vector<3>)]| {
            let mut total = 0.0;
            let mut moment = 0.0;
            for (n, f) in f {
                total += f[2];
                moment += f[2] * mesh.nodes[*n as usize][0];
            }
            (total, moment)
        };
        let (total, moment) = sums(&traction_vector(&mesh, &[0, 1, 2, 3], t));
        assert!((total - 18.0).abs() < 1e-12 && (moment - 28.8).abs() < 1e-12);
        // the same on two triangles: only degree 4 in all is exact there, so take x^2 y with its moment x^3 y
        let t = |x: &Vector<3>| Vector::<3>::new(0.0, 0.0, x[0].powi(2) * x[1]);
        let mut f = traction_vector(&mesh, &[0, 1, 2], t);
        f.extend(traction_vector(&mesh, &[0, 2, 3], t));
        let (total, moment) = sums(&f);
        assert!((total - 8.0 / 3.0 * 4.5).abs() < 1e-12 && (moment - 18.0).abs() < 1e-12);
    }

    fn body<const D: usize>() {
        for mesh in boxes::<D>(3, 0.2) {
            // b = (1 + 2x, 0, 0) on the unit box: total 2, first moment in x is 1/2 + 2/3
            let (mut total, mut moment) = (0.0, 0.0);
            for c in 0..mesh.cell_count() {
                let b = |x: &Vector<D>| {
                    let mut b = Vector::zeros();
                    b[0] = 1.0 + 2.0 * x[0];
                    b
                };
                for (n, f) in body_force_vector(&mesh, c, b) {
                    total += f[0];
                    moment += f[0] * mesh.nodes[n as usize][0];
                }
            }
            assert!((total - 2.0).abs() < 1e-13, "{:?}", mesh.shapes[0]);
            // Σ x_a N_a = x, so the moment's integrand is x (1 + 2x) det J: of degree 4 on a jittered hexahedron, which
            // two points do not integrate, and of degree 3 or 2 on all others
            if mesh.shapes[0] != crate::mesh::CellShape::Hex8 {
                assert!((moment - 7.0 / 6.0).abs() < 1e-13, "{:?}", mesh.shapes[0]);
            }
        }
    }

    #[test]
    fn body_forces_add_up_to_force_and_moment() {
        body::<1>();
        body::<2>();
        body::<3>();
    }
}
