//! A ball and a general hexahedron, in closed form.
//!
//! The cell is the sum, with signs, of the cones from the ball's centre over its faces. A triangle whose plane passes the centre at distance `d < R`
//! cuts the ball in a disc of radius `ρ = √(R² − d²)` about the foot of the perpendicular. Split into the triangles (foot, A, B) over its edges, each
//! part of an edge inside the disc adds a cone over a triangle, `d/3 · ½ |a × b|`, and each part outside, seen from the foot under the angle φ, adds
//! the cone over a sector and the ball's own cone beyond it, `d/3 · ½ ρ² φ + R³/3 (Ω − φ (1 − d/R))`, where Ω is the solid angle of the triangle.

use bondline::tensor::Vector;

/// A hexahedron; corners in the order of VTK and Gmsh (bottom face counter-clockwise seen from the top face, then the top face).
///
/// A face is four triangles about the mean of its corners: the face itself where it is plane, and else of the same volume below it as the bilinear
/// face. Neighbours agree on it, so that cells that fill a body still do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hexahedron {
    corners: [Vector<3>; 8],
}

/// Corners of the faces, counter-clockwise seen from outside.
const FACES: [[usize; 4]; 6] = [
    [0, 3, 2, 1],
    [4, 5, 6, 7],
    [0, 1, 5, 4],
    [1, 2, 6, 5],
    [2, 3, 7, 6],
    [3, 0, 4, 7],
];

impl Hexahedron {
    /// A hexahedron from its corners \[m\]; none unless its volume is positive.
    pub fn new(corners: [Vector<3>; 8]) -> Option<Self> {
        let cell = Self { corners };
        let volume = cell.volume();
        (volume.is_finite() && volume > 0.0).then_some(cell)
    }

    /// Its volume, that of the trilinear cell. Units: \[m³\].
    pub fn volume(&self) -> f64 {
        // about a corner, or digits are lost far from the origin
        let origin = self.corners[0];
        self.triangles(&origin)
            .map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0)
            .sum()
    }

    /// Volume of its intersection with a ball. Units: \[m\] → \[m³\].
    pub fn ball_volume(&self, centre: &Vector<3>, radius: f64) -> f64 {
        if radius <= 0.0 {
            return 0.0;
        }
        let sum: f64 = self
            .triangles(centre)
            .map(|triangle| cone(triangle, radius))
            .sum();
        sum.max(0.0)
    }

    /// The triangles of its faces, seen from a point.
    fn triangles(&self, from: &Vector<3>) -> impl Iterator<Item = [Vector<3>; 3]> + '_ {
        let from = *from;
        FACES.into_iter().flat_map(move |face| {
            let corners = face.map(|k| self.corners[k] - from);
            let middle = corners.iter().sum::<Vector<3>>() / 4.0;
            [0, 1, 2, 3].map(|k| [middle, corners[k], corners[(k + 1) % 4]])
        })
    }
}

/// Signed volume of the ball's part in the cone from the origin over a triangle; positive if the triangle turns its back to the origin.
fn cone([a, b, c]: [Vector<3>; 3], radius: f64) -> f64 {
    let normal = (b - a).cross(&(c - a));
    let size = normal.norm();
    if size == 0.0 {
        return 0.0;
    }
    let normal = normal / size;
    let offset = normal.dot(&a);
    let foot = normal * offset;
    let corners = [a - foot, b - foot, c - foot];
    let sum: f64 = [0, 1, 2]
        .map(|k| {
            edge(
                &corners[k],
                &corners[(k + 1) % 3],
                &normal,
                offset.abs(),
                radius,
            )
        })
        .into_iter()
        .sum();
    if offset == 0.0 {
        0.0
    } else {
        offset.signum() * sum
    }
}

/// The share of one edge, from `a` to `b` seen from the foot, in [`cone`]; `d` is the plane's distance.
fn edge(a: &Vector<3>, b: &Vector<3>, normal: &Vector<3>, d: f64, radius: f64) -> f64 {
    let along = b - a;
    let square = (radius - d) * (radius + d);
    let beyond = |p: &Vector<3>, q: &Vector<3>| -> f64 {
        let turn = normal.dot(&p.cross(q));
        let cosine = p.dot(q);
        let (lp, lq) = (p.norm_squared(), q.norm_squared());
        let (op, oq) = ((lp + d * d).sqrt(), (lq + d * d).sqrt());
        let solid = 2.0 * turn.atan2(op * oq + d * (op + oq) + d * d + cosine);
        if square <= 0.0 {
            return radius.powi(3) / 3.0 * solid;
        }
        let angle = turn.atan2(cosine);
        d / 6.0 * square * angle + radius * radius / 3.0 * (radius * solid - angle * (radius - d))
    };
    let within = |p: &Vector<3>, q: &Vector<3>| -> f64 { d / 6.0 * normal.dot(&p.cross(q)) };
    // where the edge's line enters and leaves the disc: |a + t along|² = ρ²
    let (quadratic, half) = (along.norm_squared(), a.dot(&along));
    let discriminant = half * half - quadratic * (a.norm_squared() - square);
    if square <= 0.0 || discriminant <= 0.0 {
        return beyond(a, b);
    }
    let root = discriminant.sqrt();
    let enters = ((-half - root) / quadratic).clamp(0.0, 1.0);
    let leaves = ((-half + root) / quadratic).clamp(0.0, 1.0);
    if enters >= leaves {
        return beyond(a, b);
    }
    let (p, q) = (a + along * enters, a + along * leaves);
    let mut sum = within(&p, &q);
    if enters > 0.0 {
        sum += beyond(a, &p);
    }
    if leaves < 1.0 {
        sum += beyond(&q, b);
    }
    sum
}

#[cfg(test)]
mod tests {
    use bondline::peridynamics::BoxCell;

    use super::*;

    fn hexahedron(cell: &BoxCell<3>, map: impl Fn(Vector<3>) -> Vector<3>) -> Hexahedron {
        let (l, h) = cell.corners();
        let corner = |x: f64, y: f64, z: f64| map(Vector::<3>::new(x, y, z));
        Hexahedron::new([
            corner(l.x, l.y, l.z),
            corner(h.x, l.y, l.z),
            corner(h.x, h.y, l.z),
            corner(l.x, h.y, l.z),
            corner(l.x, l.y, h.z),
            corner(h.x, l.y, h.z),
            corner(h.x, h.y, h.z),
            corner(l.x, h.y, h.z),
        ])
        .unwrap()
    }

    #[test]
    fn a_turned_box_has_the_same_volume_in_the_ball() {
        let (c, s) = (0.8, 0.6);
        let turn = |x: Vector<3>| {
            let y = Vector::<3>::new(c * x.x - s * x.y, s * x.x + c * x.y, x.z);
            Vector::<3>::new(y.x, c * y.y - s * y.z, s * y.y + c * y.z)
        };
        let cell = BoxCell::new(
            Vector::<3>::new(0.5, -0.3, 0.2),
            Vector::<3>::new(1.0, 0.5, 0.6),
        )
        .unwrap();
        let exact = cell.ball_measure(&Vector::zeros(), 0.9);
        let measured = hexahedron(&cell, turn).ball_volume(&Vector::zeros(), 0.9);
        assert!((measured - exact).abs() < 1e-14, "{measured} {exact}");
        // the ball inside, around, beyond, and a centre on a face's plane and on a corner
        for (centre, radius) in [
            (Vector::<3>::new(0.75, 0.1, 0.4), 0.1),
            (Vector::<3>::new(0.7, 0.1, 0.4), 3.0),
            (Vector::<3>::new(3.0, 0.1, 0.4), 0.5),
            (Vector::<3>::new(0.5, 0.1, 0.4), 0.3),
            (Vector::<3>::new(0.5, -0.3, 0.2), 0.45),
            (Vector::<3>::new(0.2, -0.3, 0.2), 0.45),
        ] {
            let exact = cell.ball_measure(&centre, radius);
            let straight = hexahedron(&cell, |x| x).ball_volume(&centre, radius);
            let turned = hexahedron(&cell, turn).ball_volume(&turn(centre), radius);
            assert!(
                (straight - exact).abs() < 1e-14,
                "{centre} {radius}: {straight} {exact}"
            );
            assert!(
                (turned - exact).abs() < 1e-13,
                "{centre} {radius}: {turned} {exact}"
            );
        }
    }

    #[test]
    fn skewed_hexahedra_that_fill_a_box_fill_the_ball() {
        // eight hexahedra about a middle point that is moved off the middle: their faces are not plane
        let grid = [-1.0, 0.0, 1.0];
        let moved = |x: Vector<3>| {
            let inner = (1.0 - x.x * x.x) * (1.0 - x.y * x.y) * (1.0 - x.z * x.z);
            let face = |a: f64, b: f64| (1.0 - a * a) * (1.0 - b * b);
            x + Vector::<3>::new(0.15 * inner, -0.1 * face(x.y, x.x) * inner, 0.12 * inner)
                + Vector::<3>::new(0.1 * face(x.x, x.y), 0.1 * face(x.y, x.z), 0.0)
        };
        let mut sum = 0.0;
        let mut whole = 0.0;
        for i in 0..2 {
            for j in 0..2 {
                for k in 0..2 {
                    let low = Vector::<3>::new(grid[i], grid[j], grid[k]);
                    let cell = BoxCell::new(low, low.add_scalar(1.0)).unwrap();
                    let hexahedron = hexahedron(&cell, moved);
                    whole += hexahedron.volume();
                    sum += hexahedron.ball_volume(&Vector::<3>::new(0.05, 0.02, -0.03), 0.6);
                }
            }
        }
        assert!((whole - 8.0).abs() < 1e-13, "{whole}");
        let ball = 4.0 / 3.0 * std::f64::consts::PI * 0.6f64.powi(3);
        assert!((sum / ball - 1.0).abs() < 1e-13, "{sum}");
    }

    #[test]
    fn a_hexahedron_without_volume_is_none() {
        assert!(Hexahedron::new([Vector::zeros(); 8]).is_none());
    }
}
