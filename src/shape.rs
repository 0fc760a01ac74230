//! Plain shapes (boxes, balls, polylines, polygons) and the barriers that bonds cannot pass.
//!
//! A shape says how far a point is from it. It paints zones ("within 3δ of the crack line") and describes what cuts bonds.

use crate::tensor::Vector;

/// Distance to a barrier, as a fraction of the bond's length, within which a bond counts as touching it and no more.
///
/// Coordinates of size 1 carry errors of 1e-16 and bonds are rarely shorter than 1e-4 of the model, so 1e-9 of a bond lies
/// three orders above round-off and far below anything a mesh resolves.
pub const TOUCH: f64 = 1e-9;

/// A closed set of points in `D` dimensions.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape<const D: usize> {
    /// The axis-parallel box `min ≤ x ≤ max`.
    Box {
        /// Smallest coordinates.
        min: Vector<D>,
        /// Largest coordinates.
        max: Vector<D>,
    },
    /// All points within `radius` of `center`.
    Ball {
        /// Centre.
        center: Vector<D>,
        /// Radius.
        radius: f64,
    },
    /// The straight line from `a` to `b`, without thickness. With `a = b` a point.
    Segment {
        /// Start.
        a: Vector<D>,
        /// End.
        b: Vector<D>,
    },
    /// Straight lines from each point to the next, without thickness.
    Polyline(Vec<Vector<D>>),
    /// A simple closed polygon: its area in 2D, a plane surface without thickness in 3D, its edges in 1D.
    Polygon(Vec<Vector<D>>),
    /// All points.
    Everywhere,
    /// Points of any member.
    Union(Vec<Shape<D>>),
    /// The closure of the points of `from` that are not in `removed`.
    Without {
        /// Shape from which a part is removed.
        from: Box<Shape<D>>,
        /// Part that is removed.
        removed: Box<Shape<D>>,
    },
}

impl<const D: usize> Shape<D> {
    /// Returns true if `x` lies in the shape or within `tolerance` \[length\] of it.
    ///
    /// On the boundary of what [`Shape::Without`] removes, a point is still contained.
    pub fn contains(&self, x: &Vector<D>, tolerance: f64) -> bool {
        self.signed_distance(x) <= tolerance
    }

    /// Distance from `x` to the boundary, negative inside; for shapes without thickness the plain distance.
    ///
    /// Exact for every single shape. A union takes the smallest member (exact outside), a difference `max(d_from, −d_removed)`
    /// (right in sign, a lower bound in size). `−∞` for [`Shape::Everywhere`], `+∞` for an empty union or polyline.
    pub fn signed_distance(&self, x: &Vector<D>) -> f64 {
        match self {
            Self::Box { min, max } => {
                let q = (min - x).sup(&(x - max));
                let outside = q.sup(&Vector::zeros()).norm();
                if outside > 0.0 { outside } else { q.max() }
            }
            Self::Ball { center, radius } => (x - center).norm() - radius,
            Self::Segment { a, b } => distance_to_segment(x, a, b),
            Self::Polyline(points) => match points.as_slice() {
                [] => f64::INFINITY,
                [p] => (x - p).norm(),
                _ => points
                    .windows(2)
                    .map(|w| distance_to_segment(x, &w[0], &w[1]))
                    .fold(f64::INFINITY, f64::min),
            },
            Self::Polygon(points) => polygon_distance(points, x),
            Self::Everywhere => f64::NEG_INFINITY,
            Self::Union(members) => members
                .iter()
                .map(|s| s.signed_distance(x))
                .fold(f64::INFINITY, f64::min),
            Self::Without { from, removed } => {
                from.signed_distance(x).max(-removed.signed_distance(x))
            }
        }
    }

    /// Smallest and largest coordinates; infinite for [`Shape::Everywhere`], and `(+∞, −∞)` for an empty shape.
    pub fn bounds(&self) -> (Vector<D>, Vector<D>) {
        match self {
            Self::Box { min, max } => (*min, *max),
            Self::Ball { center, radius } => (
                center.add_scalar(-radius.abs()),
                center.add_scalar(radius.abs()),
            ),
            Self::Segment { a, b } => (a.inf(b), a.sup(b)),
            Self::Polyline(points) | Self::Polygon(points) => hull(points.iter().map(|p| (*p, *p))),
            Self::Everywhere => (
                Vector::repeat(f64::NEG_INFINITY),
                Vector::repeat(f64::INFINITY),
            ),
            Self::Union(members) => hull(members.iter().map(Self::bounds)),
            Self::Without { from, .. } => from.bounds(),
        }
    }

    /// Appends every parameter `t` at which `a + t (b − a)` may pass the shape's boundary.
    fn add_crossings(&self, a: &Vector<D>, b: &Vector<D>, t: &mut Vec<f64>) {
        let d = b - a;
        match self {
            Self::Box { min, max } => {
                for k in 0..D {
                    if d[k] != 0.0 {
                        t.push((min[k] - a[k]) / d[k]);
                        t.push((max[k] - a[k]) / d[k]);
                    }
                }
            }
            Self::Ball { center, radius } => {
                let (dd, e) = (d.norm_squared(), a - center);
                let (half, c) = (d.dot(&e), e.norm_squared() - radius * radius);
                let root = half * half - dd * c;
                if root >= 0.0 && dd > 0.0 {
                    t.push((-half - root.sqrt()) / dd);
                    t.push((-half + root.sqrt()) / dd);
                }
            }
            Self::Polygon(points) if D == 2 => {
                for (p, q) in edges(points) {
                    let e = q - p;
                    let cross = d[0] * e[1] - d[1] * e[0];
                    if cross != 0.0 {
                        let w = p - a;
                        t.push((w[0] * e[1] - w[1] * e[0]) / cross);
                    } else {
                        let dd = d.norm_squared();
                        t.push((p - a).dot(&d) / dd);
                        t.push((q - a).dot(&d) / dd);
                    }
                }
            }
            Self::Union(members) => members.iter().for_each(|s| s.add_crossings(a, b, t)),
            Self::Without { from, removed } => {
                from.add_crossings(a, b, t);
                removed.add_crossings(a, b, t);
            }
            Self::Segment { .. } | Self::Polyline(_) | Self::Polygon(_) | Self::Everywhere => {}
        }
    }

    /// Returns true if a piece of positive length of the segment lies strictly inside the shape.
    fn swallows(&self, a: &Vector<D>, b: &Vector<D>) -> bool {
        let d = b - a;
        let length = d.norm();
        let skin = TOUCH * length;
        match self {
            Self::Box { min, max } => {
                let (mut t0, mut t1) = (0.0f64, 1.0f64);
                for k in 0..D {
                    let (lo, hi) = (min[k] + skin - a[k], max[k] - skin - a[k]);
                    if d[k].abs() <= f64::MIN_POSITIVE {
                        if !(lo < 0.0 && 0.0 < hi) {
                            return false;
                        }
                    } else {
                        let (p, q) = (lo / d[k], hi / d[k]);
                        if lo >= hi {
                            return false;
                        }
                        t0 = t0.max(p.min(q));
                        t1 = t1.min(p.max(q));
                    }
                }
                t0 < t1
            }
            Self::Ball { center, radius } => distance_to_segment(center, a, b) < radius - skin,
            Self::Segment { .. } | Self::Polyline(_) => false,
            Self::Polygon(_) if D != 2 => false,
            Self::Everywhere => true,
            Self::Polygon(_) | Self::Union(_) | Self::Without { .. } => {
                let mut t = vec![0.0, 1.0];
                self.add_crossings(a, b, &mut t);
                t.retain(|t| (0.0..=1.0).contains(t));
                t.sort_unstable_by(f64::total_cmp);
                t.windows(2).any(|w| {
                    w[1] - w[0] > TOUCH && self.surrounds(&(a + d * (0.5 * (w[0] + w[1]))), skin)
                })
            }
        }
    }

    /// Returns true if `x` and its neighbours at a distance `skin` along and between all axes are contained.
    ///
    /// Unlike a signed distance this sees that a face shared by two members of a union is no boundary.
    fn surrounds(&self, x: &Vector<D>, skin: f64) -> bool {
        (0..3usize.pow(D as u32)).all(|code| {
            let offset: Vector<D> =
                Vector::from_fn(|k, _| skin * ((code / 3usize.pow(k as u32) % 3) as f64 - 1.0));
            self.signed_distance(&(x + offset)) <= 0.0
        })
    }

    /// Returns true if the segment passes from one side of the surface to the other.
    fn parts(&self, a: &Vector<D>, b: &Vector<D>) -> bool {
        match self {
            Self::Segment { a: p, b: q } => line_parts(p, q, a, b),
            Self::Polyline(points) => match points.as_slice() {
                [p] => line_parts(p, p, a, b),
                _ => points.windows(2).any(|w| line_parts(&w[0], &w[1], a, b)),
            },
            Self::Polygon(points) if D == 3 => polygon_parts(points, a, b),
            Self::Polygon(points) => edges(points).any(|(p, q)| line_parts(p, q, a, b)),
            Self::Box { min, max } => match (0..D).find(|&k| min[k] == max[k]) {
                Some(k) => {
                    plane_parts(a[k] - min[k], b[k] - min[k], (b - a).norm()).is_some_and(|t| {
                        let x = a + (b - a) * t;
                        let skin = TOUCH * (b - a).norm();
                        (0..D).all(|i| i == k || (min[i] - skin <= x[i] && x[i] <= max[i] + skin))
                    })
                }
                None => self.swallows(a, b),
            },
            Self::Union(members) => members.iter().any(|s| s.parts(a, b)),
            Self::Ball { .. } | Self::Everywhere | Self::Without { .. } => self.swallows(a, b),
        }
    }
}

/// Something that cuts the bonds that cross it.
#[derive(Clone, Debug, PartialEq)]
pub enum Barrier<const D: usize> {
    /// Empty space: cuts a bond if a piece of positive length of it lies strictly inside.
    ///
    /// A bond along a face of the void, or touching its corner, is not cut; one between opposite faces is.
    /// Shapes without volume cut nothing.
    Void(Shape<D>),
    /// A surface without thickness: cuts a bond that passes from one side of it to the other.
    ///
    /// Surfaces are a point in 1D, a segment, polyline or polygon outline in 2D, a plane polygon in 3D, and a box of zero
    /// thickness along one axis. A shape with volume acts as a void; a line in 3D cuts nothing.
    ///
    /// A point on the surface (within 1e-9 of the bond's length) counts as on its positive side: larger x in 1D; left of
    /// the way from start to end in 2D; where the corners run counter-clockwise in 3D; larger coordinate for a flat box.
    /// A bond through the very tip or edge of the surface is cut.
    Crack(Shape<D>),
}

impl<const D: usize> Barrier<D> {
    /// Returns true if the barrier cuts the bond from `a` to `b`. The same answer for `b` to `a`.
    pub fn cuts(&self, a: &Vector<D>, b: &Vector<D>) -> bool {
        match self {
            Self::Void(shape) => shape.swallows(a, b),
            Self::Crack(shape) => shape.parts(a, b),
        }
    }

    /// The shape, whichever way it cuts.
    pub fn shape(&self) -> &Shape<D> {
        match self {
            Self::Void(shape) | Self::Crack(shape) => shape,
        }
    }

    /// Smallest and largest coordinates of the barrier.
    pub fn bounds(&self) -> (Vector<D>, Vector<D>) {
        self.shape().bounds()
    }
}

/// Several barriers with their bounding boxes, for loops over many bonds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Barriers<const D: usize> {
    members: Vec<(Vector<D>, Vector<D>, Barrier<D>)>,
}

impl<const D: usize> Barriers<D> {
    /// Stores the barriers with their bounds.
    pub fn new(members: Vec<Barrier<D>>) -> Self {
        let members = members
            .into_iter()
            .map(|barrier| {
                let (lo, hi) = barrier.bounds();
                (lo, hi, barrier)
            })
            .collect();
        Self { members }
    }

    /// Returns true if there is no barrier at all.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// Returns true if a bond of length `reach` or less that starts at `x` can meet a barrier; if not, its family needs no test.
    pub fn near(&self, x: &Vector<D>, reach: f64) -> bool {
        let reach = reach * (1.0 + TOUCH);
        self.members
            .iter()
            .any(|(lo, hi, _)| (0..D).all(|k| x[k] >= lo[k] - reach && x[k] <= hi[k] + reach))
    }

    /// Returns true if any barrier cuts the bond from `a` to `b`.
    pub fn cuts(&self, a: &Vector<D>, b: &Vector<D>) -> bool {
        self.members.iter().any(|(lo, hi, barrier)| {
            // a crack keeps points within a skin of it apart, hence the margin
            let skin = TOUCH * (b - a).amax() * 2.0;
            (0..D).all(|k| a[k].min(b[k]) <= hi[k] + skin && a[k].max(b[k]) >= lo[k] - skin)
                && barrier.cuts(a, b)
        })
    }
}

/// Distance from `x` to the segment from `a` to `b`.
pub fn distance_to_segment<const D: usize>(x: &Vector<D>, a: &Vector<D>, b: &Vector<D>) -> f64 {
    let (d, w) = (b - a, x - a);
    let dd = d.norm_squared();
    let t = if dd > 0.0 {
        (w.dot(&d) / dd).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (w - d * t).norm()
}

/// Smallest box around boxes.
fn hull<const D: usize>(
    boxes: impl Iterator<Item = (Vector<D>, Vector<D>)>,
) -> (Vector<D>, Vector<D>) {
    boxes.fold(
        (
            Vector::repeat(f64::INFINITY),
            Vector::repeat(f64::NEG_INFINITY),
        ),
        |(lo, hi), (l, h)| (lo.inf(&l), hi.sup(&h)),
    )
}

/// The edges of a closed polygon.
fn edges<const D: usize>(
    points: &[Vector<D>],
) -> impl Iterator<Item = (&Vector<D>, &Vector<D>)> + '_ {
    points.iter().zip(points.iter().cycle().skip(1))
}

/// Normal of a plane polygon in 3D, not normalised (Newell); zero in other dimensions.
fn polygon_normal<const D: usize>(points: &[Vector<D>]) -> Vector<D> {
    let mut n = Vector::zeros();
    if D == 3 {
        for (p, q) in edges(points) {
            for k in 0..3 {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                n[k] += (p[i] - q[i]) * (p[j] + q[j]) * 0.5;
            }
        }
    }
    n
}

/// Even-odd test in the plane of axes `i` and `j`.
fn encloses<const D: usize>(points: &[Vector<D>], x: &Vector<D>, i: usize, j: usize) -> bool {
    let mut inside = false;
    for (p, q) in edges(points) {
        if (p[j] > x[j]) != (q[j] > x[j]) {
            let at = p[i] + (x[j] - p[j]) / (q[j] - p[j]) * (q[i] - p[i]);
            inside ^= x[i] < at;
        }
    }
    inside
}

/// See [`Shape::signed_distance`].
fn polygon_distance<const D: usize>(points: &[Vector<D>], x: &Vector<D>) -> f64 {
    let rim = edges(points)
        .map(|(p, q)| distance_to_segment(x, p, q))
        .fold(f64::INFINITY, f64::min);
    match D {
        2 if encloses(points, x, 0, 1) => -rim,
        3 if points.len() >= 3 => {
            let normal = polygon_normal(points);
            let k = normal.iamax();
            let area = normal.norm();
            if area > 0.0 && {
                let foot = x - normal * ((x - points[0]).dot(&normal) / (area * area));
                encloses(points, &foot, (k + 1) % 3, (k + 2) % 3)
            } {
                ((x - points[0]).dot(&normal) / area).abs()
            } else {
                rim
            }
        }
        _ => rim,
    }
}

/// Returns the position at which the bond crosses a plane, given the heights of its ends above it: `Some(t)` if they lie on different sides.
fn plane_parts(height_a: f64, height_b: f64, length: f64) -> Option<f64> {
    let skin = TOUCH * length;
    let (above_a, above_b) = (height_a >= -skin, height_b >= -skin);
    (above_a != above_b).then(|| (height_a / (height_a - height_b)).clamp(0.0, 1.0))
}

/// Returns true if the line from `p` to `q` (a point in 1D) separates `a` from `b`.
fn line_parts<const D: usize>(p: &Vector<D>, q: &Vector<D>, a: &Vector<D>, b: &Vector<D>) -> bool {
    let length = (b - a).norm();
    match D {
        1 => [p, q]
            .iter()
            .any(|c| plane_parts(a[0] - c[0], b[0] - c[0], length).is_some()),
        2 => {
            let e = q - p;
            let size = e.norm();
            if size == 0.0 {
                return false;
            }
            let height = |x: &Vector<D>| (e[0] * (x[1] - p[1]) - e[1] * (x[0] - p[0])) / size;
            plane_parts(height(a), height(b), length).is_some_and(|t| {
                let along = (a + (b - a) * t - p).dot(&e) / size;
                let skin = TOUCH * length;
                (-skin..=size + skin).contains(&along)
            })
        }
        _ => false,
    }
}

/// Returns true if the plane polygon separates `a` from `b`.
fn polygon_parts<const D: usize>(points: &[Vector<D>], a: &Vector<D>, b: &Vector<D>) -> bool {
    let normal = polygon_normal(points);
    let area = normal.norm();
    if area == 0.0 {
        return false;
    }
    let length = (b - a).norm();
    let height = |x: &Vector<D>| (x - points[0]).dot(&normal) / area;
    plane_parts(height(a), height(b), length).is_some_and(|t| {
        let x = a + (b - a) * t;
        let k = normal.iamax();
        encloses(points, &x, (k + 1) % 3, (k + 2) % 3)
            || edges(points).any(|(p, q)| distance_to_segment(&x, p, q) <= TOUCH * length)
    })
}

#[cfg(test)]
#[path = "shape_tests.rs"]
mod tests;
