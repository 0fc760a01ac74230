//! Faces of cracks between points as surfaces that press on each other.
//!
//! A face is divided into pieces half a spacing long, whose corners follow the points on their side: by an affine fit to those that the crack does not hide. What has grown from a crack has no faces, and points press there.

use rustc_hash::FxHashSet;

use super::of_model::Parts;
use super::surface::{self, Facet, Place, normal};

use crate::fem::Locator;
use crate::model::{Model, Sampler};
use crate::shape::{Barrier, Shape};
use crate::tensor::Vector;

/// Length of a piece over the spacing of points.
const PIECE: f64 = 0.5;

/// Distance from a face, over the spacing, at which it is looked at from its side.
const ASIDE: f64 = 1e-6;

/// Places on a piece, by their barycentric coordinates; each has an equal part of its area.
fn rule<const D: usize>() -> Vec<[f64; D]> {
    let near = [1.0, 0.5 + 0.5 / 3.0_f64.sqrt(), 2.0 / 3.0][D - 1];
    let others = if D > 1 {
        (1.0 - near) / (D - 1) as f64
    } else {
        0.0
    };
    (0..D)
        .map(|k| std::array::from_fn(|i| if i == k { near } else { others }))
        .collect()
}

/// Pieces of a crack no longer than `length`; none of a shape that is no surface.
pub(super) fn pieces<const D: usize>(shape: &Shape<D>, length: f64) -> Vec<[Vector<D>; D]> {
    let mut found = Vec::new();
    match shape {
        Shape::Segment { a, .. } if D == 1 => found.push([*a; D]),
        Shape::Segment { a, b } if D == 2 => divide_segment(a, b, length, &mut found),
        Shape::Polyline(corners) if D == 2 => {
            for pair in corners.windows(2) {
                divide_segment(&pair[0], &pair[1], length, &mut found);
            }
        }
        Shape::Polygon(corners) if D == 3 => {
            for triangle in triangles(corners) {
                divide_triangle(triangle, length, &mut found);
            }
        }
        // no surfaces in this dimension, and what no scene takes for a crack
        Shape::Segment { .. }
        | Shape::Polyline(_)
        | Shape::Polygon(_)
        | Shape::Box { .. }
        | Shape::Ball { .. }
        | Shape::Everywhere
        | Shape::Union(_)
        | Shape::Without { .. } => {}
    }
    found
}

fn divide_segment<const D: usize>(
    a: &Vector<D>,
    b: &Vector<D>,
    length: f64,
    found: &mut Vec<[Vector<D>; D]>,
) {
    let count = ((b - a).norm() / length).ceil().max(1.0) as usize;
    let at = |k: usize| a.lerp(b, k as f64 / count as f64);
    found.extend((0..count).map(|k| std::array::from_fn(|i| at(k + i))));
}

/// Triangles of a simple plane polygon, ears first.
fn triangles<const D: usize>(corners: &[Vector<D>]) -> Vec<[Vector<D>; 3]> {
    let mut left = corners.to_vec();
    let doubled = |a: &Vector<D>, b: &Vector<D>, c: &Vector<D>| {
        let mut of = [Vector::zeros(); D];
        of[0] = *a;
        of[1] = *b;
        of[D - 1] = *c;
        normal(&of)
    };
    let whole: Vector<D> = (1..corners.len().saturating_sub(1))
        .map(|k| doubled(&corners[0], &corners[k], &corners[k + 1]))
        .sum();
    let mut found = Vec::new();
    while left.len() > 2 {
        let n = left.len();
        let is_ear = |&k: &usize| {
            let (a, b, c) = (&left[(k + n - 1) % n], &left[k], &left[(k + 1) % n]);
            if doubled(a, b, c).dot(&whole) <= 0.0 {
                return false;
            }
            let is_inside = |x: &Vector<D>| {
                x != a
                    && x != b
                    && x != c
                    && [(a, b), (b, c), (c, a)]
                        .iter()
                        .all(|(p, q)| doubled(p, q, x).dot(&whole) >= 0.0)
            };
            !left.iter().any(is_inside)
        };
        let Some(ear) = (0..n).find(is_ear) else {
            break;
        };
        found.push([left[(ear + n - 1) % n], left[ear], left[(ear + 1) % n]]);
        left.remove(ear);
    }
    found
}

/// Halves the longest edge until none is longer than `length`.
fn divide_triangle<const D: usize>(
    triangle: [Vector<D>; 3],
    length: f64,
    found: &mut Vec<[Vector<D>; D]>,
) {
    let mut open = vec![triangle];
    while let Some([a, b, c]) = open.pop() {
        let turns = [[a, b, c], [b, c, a], [c, a, b]];
        let edge = |t: &[Vector<D>; 3]| (t[1] - t[0]).norm();
        let longest = turns.iter().max_by(|s, t| edge(s).total_cmp(&edge(t)));
        let [a, b, c] = *longest.unwrap_or(&turns[0]);
        if (b - a).norm() <= length {
            found.push(std::array::from_fn(|k| [a, b, c][k]));
        } else {
            let middle = (a + b) * 0.5;
            open.push([a, middle, c]);
            open.push([middle, b, c]);
        }
    }
}

/// Returns true if a model has cracks between its points.
pub(crate) fn has_cracks<const D: usize>(model: &Model<D>) -> bool {
    let is_crack = |b: &Barrier<D>| matches!(b, Barrier::Crack(_));
    let p = model
        .peridynamics
        .as_ref()
        .filter(|_| model.body().is_some());
    p.is_some_and(|p| p.barriers.iter().any(is_crack))
}

/// A piece of a crack, with the displacements of its corners on both sides by those of sites.
pub(super) struct Face<const D: usize> {
    pub corners: [Vector<D>; D],
    /// Unit normal, to the side that is above.
    pub normal: Vector<D>,
    pub above: [Vec<(u32, f64)>; D],
    pub below: [Vec<(u32, f64)>; D],
    /// The cell of the mesh that it lies in.
    pub cell: usize,
}

impl<const D: usize> Face<D> {
    /// Returns true if no site is seen from both sides, as about the tip of a crack.
    fn has_two_sides(&self) -> bool {
        let sites = |rows: &[Vec<(u32, f64)>; D]| -> FxHashSet<u32> {
            rows.iter().flatten().map(|(site, _)| *site).collect()
        };
        sites(&self.above).is_disjoint(&sites(&self.below))
    }

    pub fn middle(&self) -> Vector<D> {
        self.corners.iter().sum::<Vector<D>>() / D as f64
    }
}

/// The pieces of all cracks between points, as far as they lie in the body.
pub(super) fn faces<const D: usize>(model: &Model<D>) -> Vec<Face<D>> {
    let (true, Some(p)) = (has_cracks(model), model.peridynamics.as_ref()) else {
        return Vec::new();
    };
    let (sampler, spacing) = (Sampler::new(model), model.spacing());
    let cells = Locator::new(&model.mesh, 0..model.mesh.cell_count());
    let mut found = Vec::new();
    for barrier in &p.barriers {
        let Barrier::Crack(shape) = barrier else {
            continue;
        };
        for corners in pieces(shape, PIECE * spacing) {
            let middle = corners.iter().sum::<Vector<D>>() / D as f64;
            let Some(located) = cells.locate(&model.mesh, &middle, 1e-9) else {
                continue;
            };
            let normal = match D {
                1 => Vector::repeat(1.0),
                _ => normal(&corners).normalize(),
            };
            let rows = |side: f64| -> Option<[Vec<(u32, f64)>; D]> {
                // aside, and within the piece, where another crack may end
                let at =
                    |x: Vector<D>| x + (middle - x) * ASIDE + normal * (side * ASIDE * spacing);
                let rows = corners.map(|x| sampler.weights(&at(x)));
                rows.iter()
                    .all(Option::is_some)
                    .then(|| rows.map(Option::unwrap_or_default))
            };
            if let (Some(above), Some(below)) = (rows(1.0), rows(-1.0)) {
                found.push(Face {
                    corners,
                    normal,
                    above,
                    below,
                    cell: located.cell,
                });
            }
        }
    }
    found
}

impl<const D: usize> Parts<'_, D> {
    /// Adds the two faces of each crack between points, as far as it lies in the body.
    pub(super) fn add_crack_faces(&mut self) {
        let model = self.model;
        let material = usize::from(model.peridynamic_material());
        let spacing = model.spacing();
        let stiffness = model.elastic.tensors[material].longitudinal_modulus() / spacing;
        for face in faces(model).into_iter().filter(Face::has_two_sides) {
            let body = self.body_of(face.cell);
            for (rows, outward) in [(face.above, -1.0), (face.below, 1.0)] {
                self.add_face(&face.corners, rows, outward, (spacing, stiffness, body));
            }
        }
    }

    /// Adds a piece of a face whose body lies opposite to its normal, or along it where `outward` is negative.
    fn add_face(
        &mut self,
        piece: &[Vector<D>; D],
        rows: [Vec<(u32, f64)>; D],
        outward: f64,
        (size, stiffness, body): (f64, f64, u32),
    ) {
        let first = self.corners.len() as u32;
        let mut corners: [u32; D] = std::array::from_fn(|k| first + k as u32);
        if outward < 0.0 && D > 1 {
            corners.swap(0, 1);
        }
        let facet = self.facets.len() as u32;
        self.corners.extend(piece);
        self.facets.push(Facet {
            corners,
            size,
            stiffness,
            body,
        });
        self.outward.push(outward);
        let places = rule::<D>();
        let area = surface::area(piece) / places.len() as f64;
        for weights in places {
            let place = Place {
                area,
                stiffness,
                clearance: 0.0,
                size,
                facet,
                body,
            };
            let x: Vector<D> = piece.iter().zip(weights).map(|(x, w)| x * w).sum();
            let row = rows.iter().zip(weights);
            let row = row.flat_map(|(row, w)| row.iter().map(move |(site, v)| (*site, v * w)));
            self.places.push((place, x, row.collect()));
        }
        rows.into_iter().for_each(|row| self.corner_rows.push(row));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_fill_a_polygon_that_is_not_convex() {
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 0.5], [0.0, 2.0]];
        let tilted = corners.map(|[x, y]| Vector::<3>::new(x, 0.6 * y, 0.8 * y));
        let found = pieces(&Shape::Polygon(tilted.to_vec()), 0.3);
        let area: f64 = found.iter().map(surface::area).sum();
        assert!((area - 2.5).abs() < 1e-12, "{area}");
        for piece in &found {
            assert!(normal(piece).dot(&Vector::<3>::new(0.0, -0.8, 0.6)) > 0.0);
            assert!((0..3).all(|k| (piece[k] - piece[(k + 1) % 3]).norm() <= 0.3 + 1e-12));
        }
    }
}
