//! Consistent nodal forces of tractions and body forces.

use super::cell::{ReferenceCell, Rule, RulePoint};
use super::divided;
use super::element::{for_each_point, shape_values};
use super::geometry::normal;
use super::locate::reference_of;
use super::{line2, line3, quad4, quad8, tri3, tri6};
use crate::mesh::boundary::BoundaryFacet;
use crate::mesh::{Mesh, facet_corners};
use crate::tensor::Vector;

/// A quadrature point of a facet.
///
/// Shapes: `shape` has one entry per node of the facet (up to eight).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacetPoint<const D: usize> {
    /// Position \[m\].
    pub position: Vector<D>,
    /// Weight [m^(D−1)]; 1 for the single point of a facet in 1D.
    pub weight: f64,
    /// Shape functions of the facet's nodes.
    pub shape: [f64; 8],
    /// Unit normal, to the side to which the order of the nodes turns right-handed; zero in 1D.
    pub normal: Vector<D>,
}

/// Calls `visit` with each quadrature point of a facet, given by its nodes in order.
///
/// Point in 1D; edge in 2D with 3 Gauss points, exact to degree 5; triangle with 6 points, exact to degree 4, and quadrilateral with 3 × 3 points in 3D. Facets of second order may be curved. Of a cut facet the points are those of the part that belongs to the surface, exact to degree 2.
///
/// # Panics
/// For a facet of another number of nodes, which no cell of [`super::CELLS`] has: a traction on it would be no force.
pub fn facet_points<const D: usize>(
    mesh: &Mesh<D>,
    facet: &[u32],
    mut visit: impl FnMut(&FacetPoint<D>),
) {
    if D == 1 && facet.len() == 1 {
        let mut shape = [0.0; 8];
        shape[0] = 1.0;
        return visit(&FacetPoint {
            position: mesh.nodes[facet[0] as usize],
            weight: 1.0,
            shape,
            normal: Vector::zeros(),
        });
    }
    let nodes = facet.len();
    let Some((cell, rule)) = facet_rule::<D>(nodes) else {
        panic!("a facet of {nodes} nodes in {D} dimensions has no quadrature");
    };
    let corners = facet_corners::<D>(facet);
    if let Some(part) = mesh.embedded.cut_facet(corners) {
        // the local coordinates are affine unless a quadrilateral is divided
        let cell = match part.is_divided && corners.len() == 4 {
            true => &divided::QUADRILATERAL,
            false => cell,
        };
        for (x, weight) in &part.rule {
            let xi = local_coordinates(mesh, cell, corners, x);
            let point = facet_point(mesh, facet, cell, &(xi, 0.0));
            visit(&FacetPoint {
                weight: *weight,
                ..point
            });
        }
        return;
    }
    for point in rule {
        visit(&facet_point(mesh, facet, cell, point));
    }
}

/// Local coordinates of a place on a facet whose map is affine, or which is divided.
fn local_coordinates<const D: usize>(
    mesh: &Mesh<D>,
    cell: &ReferenceCell,
    corners: &[u32],
    position: &Vector<D>,
) -> [f64; 3] {
    let place = |a: usize| mesh.nodes[corners[a] as usize];
    if std::ptr::eq(cell, &divided::QUADRILATERAL) {
        let x: Vec<Vector<D>> = (0..corners.len()).map(place).collect();
        let xi = divided::coordinates(cell, &x, position);
        return xi.map_or(cell.centre, |xi| [xi[0], xi[1], 0.0]);
    }
    let last = corners.len() - 1;
    // the corners that the first has an edge to
    let ends: &[usize] = if last == 1 { &[1] } else { &[1, last] };
    let mut xi = cell.corners[0];
    let rest = position - place(0);
    for &end in ends {
        // edges of rectangles are normal to one another, those of triangles are made so
        let along = place(end) - place(0);
        let others = ends.iter().filter(|&&other| other != end);
        let normal = others.fold(along, |normal, &other| {
            let other = place(other) - place(0);
            normal - other * (normal.dot(&other) / other.norm_squared())
        });
        let t = rest.dot(&normal) / along.dot(&normal);
        for (k, xi) in xi.iter_mut().enumerate() {
            *xi += t * (cell.corners[end][k] - cell.corners[0][k]);
        }
    }
    xi
}

/// The cell and the rule of an edge or a face by its number of nodes.
fn facet_rule<const D: usize>(
    nodes: usize,
) -> Option<(&'static ReferenceCell, &'static [RulePoint])> {
    Some(match (D, nodes) {
        (2, 2) => (&line2::CELL, line3::CELL.mass),
        (2, 3) => (&line3::CELL, line3::CELL.mass),
        (3, 3) => (&tri3::CELL, tri6::CELL.mass),
        (3, 6) => (&tri6::CELL, tri6::CELL.mass),
        (3, 4) => (&quad4::CELL, quad8::CELL.mass),
        (3, 8) => (&quad8::CELL, quad8::CELL.mass),
        _ => return None,
    })
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
    let mut shape = [0.0; 8];
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

/// `∫ N_a n dA` of each node of a facet \[m^(D−1)\], n being the unit normal that its order gives.
///
/// Exact for facets of second order too, curved or not. Zero in 1D, where a point has no order.
pub fn facet_normals<const D: usize>(mesh: &Mesh<D>, facet: &[u32]) -> Vec<Vector<D>> {
    let mut sums = vec![Vector::zeros(); facet.len()];
    facet_points(mesh, facet, |p| {
        for (sum, value) in sums.iter_mut().zip(&p.shape) {
            *sum += p.normal * (value * p.weight);
        }
    });
    sums
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
    let mut spread = Spread::new(mesh, facet);
    facet_points(mesh, facet, |p| spread.add(p, traction(&p.position)));
    spread.forces
}

/// Nodal forces of a facet: of its own nodes, or of those of the cell that the surface crosses there.
struct Spread<'a, const D: usize> {
    mesh: &'a Mesh<D>,
    crossed: Option<usize>,
    forces: Vec<(u32, Vector<D>)>,
}

impl<'a, const D: usize> Spread<'a, D> {
    fn new(mesh: &'a Mesh<D>, facet: &[u32]) -> Self {
        let crossed = mesh.embedded.crossing(facet).map(|f| f.cell as usize);
        let nodes = crossed.map_or(facet, |c| mesh.cell(c)).iter();
        Self {
            mesh,
            crossed,
            forces: nodes.map(|&n| (n, Vector::zeros())).collect(),
        }
    }

    fn add(&mut self, p: &FacetPoint<D>, traction: Vector<D>) {
        let t = traction * p.weight;
        let of_cell = self.crossed.map(|c| {
            let xi = reference_of(self.mesh, c, &p.position);
            shape_values(self.mesh, c, &xi.unwrap_or_else(Vector::zeros)).0
        });
        let shape = of_cell.as_ref().map_or(&p.shape[..], |shape| &shape[..]);
        for ((_, f), n) in self.forces.iter_mut().zip(shape) {
            *f += t * *n;
        }
    }
}

/// Consistent nodal forces `f_a = ∫ N_a t(x, n) dA` of a traction that knows the outward unit normal n: one (node, force) per node of the facet.
///
/// `traction` is t(x, n) [N/m²], `−p n` of a pressure p. Forces \[N\].
pub fn outward_traction_vector<const D: usize>(
    mesh: &Mesh<D>,
    facet: &BoundaryFacet,
    traction: impl Fn(&Vector<D>, &Vector<D>) -> Vector<D>,
) -> Vec<(u32, Vector<D>)> {
    let mut spread = Spread::new(mesh, &facet.nodes);
    outward_points(mesh, facet, |p| {
        spread.add(p, traction(&p.position, &p.normal));
    });
    spread.forces
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

    #[test]
    fn uniform_tractions_on_straight_facets_of_second_order_are_those_of_the_textbook() {
        let forces = |corners: &[[f64; 3]], sides: &[[usize; 2]]| -> Vec<f64> {
            let mut mesh = Mesh::<3> {
                nodes: corners.iter().map(|x| Vector::<3>::from(*x)).collect(),
                ..Mesh::default()
            };
            for &[p, q] in sides {
                mesh.nodes.push((mesh.nodes[p] + mesh.nodes[q]) * 0.5);
            }
            let facet: Vec<u32> = (0..mesh.nodes.len() as u32).collect();
            let area = facet_area(&mesh, &facet);
            let up = |_: &Vector<3>| Vector::<3>::new(0.0, 0.0, 1.0);
            let forces = traction_vector(&mesh, &facet, up);
            forces.iter().map(|(_, f)| f[2] / area).collect()
        };
        let triangle = forces(
            &[[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [0.5, 3.0, 1.0]],
            &[[0, 1], [1, 2], [2, 0]],
        );
        for (f, expected) in triangle.iter().zip([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]) {
            assert!((f - expected / 3.0).abs() < 1e-15);
        }
        let square = forces(
            &[
                [0.0, 0.0, 1.0],
                [2.0, 0.0, 1.0],
                [2.5, 3.0, 1.0],
                [0.5, 3.0, 1.0],
            ],
            &[[0, 1], [1, 2], [2, 3], [3, 0]],
        );
        for (a, f) in square.iter().enumerate() {
            let expected = if a < 4 { -1.0 / 12.0 } else { 1.0 / 3.0 };
            assert!((f - expected).abs() < 1e-14);
        }
    }

    #[test]
    fn a_curved_edge_has_the_length_and_the_normals_of_its_parabola() {
        // y = x (1 − x) / 4 from 0 to 1: x(ξ) is linear, the arc's length ∫ √(1 + y'²) dx with y' from 1/4 to −1/4
        let mesh = Mesh::<2> {
            nodes: [[0.0, 0.0], [1.0, 0.0], [0.5, 0.0625]]
                .map(|x| Vector::<2>::new(x[0], x[1]))
                .to_vec(),
            ..Mesh::default()
        };
        let (slope, root) = (0.25f64, 1.0625f64.sqrt());
        let length = 0.5 * root + 0.5 * slope.asinh() / slope;
        assert!((facet_area(&mesh, &[0, 1, 2]) - length).abs() < 1e-6);
        let shares = facet_normals(&mesh, &[0, 1, 2]);
        let total: Vector<2> = shares.iter().sum();
        assert!((total - Vector::<2>::new(0.0, -1.0)).amax() < 1e-15);
        // ∫ N_a n ds = ∫ N_a (y', −1) dx, with N of a line of length one
        assert!((shares[0] - Vector::<2>::new(slope / 6.0, -1.0 / 6.0)).amax() < 1e-15);
        assert!((shares[2] - Vector::<2>::new(0.0, -2.0 / 3.0)).amax() < 1e-15);
    }

    #[test]
    fn normals_of_curved_faces_add_up_to_the_volume() {
        use super::super::sample::{noise, unit_box};
        use crate::mesh::CellShape;
        for shape in [CellShape::Tet10, CellShape::Hex20] {
            let mut mesh = unit_box::<3>(shape, 1, 0.0);
            for (n, x) in mesh.nodes.iter_mut().enumerate() {
                *x += Vector::<3>::from_fn(|i, _| 0.04 * noise(n, i));
            }
            let volume: f64 = (0..mesh.cell_count())
                .map(|c| super::super::cell_volume(&mesh, c))
                .sum();
            // ∮ n dA = 0 and ∮ x · n dA = 3 V
            let (mut total, mut product) = (Vector::<3>::zeros(), 0.0);
            for facet in mesh.outer_facets() {
                let shares = facet_normals(&mesh, &facet.nodes);
                for (&n, share) in facet.nodes.iter().zip(&shares) {
                    total += share;
                    product += share.dot(&mesh.nodes[n as usize]);
                }
            }
            assert!(total.amax() < 1e-14, "{shape:?}: {total:?}");
            assert!((product - 3.0 * volume).abs() < 1e-13, "{shape:?}");
        }
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
