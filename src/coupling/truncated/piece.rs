//! Pieces of bonds between the faces that they cross.

use crate::tensor::Vector;

/// A piece of a bond inside of the peridynamic zone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Piece {
    /// Start of the piece, as a fraction of the bond.
    pub from: f64,
    /// End of the piece, as a fraction of the bond.
    pub to: f64,
    /// Share of the bond that runs there: less than 1 for a bond within a face or an edge of the zone, or through an edge.
    pub share: f64,
}

impl Piece {
    /// A bond from end to end.
    pub const WHOLE: Self = Self {
        from: 0.0,
        to: 1.0,
        share: 1.0,
    };

    /// Returns the piece, inside of the zone, of a bond that is not outside as a whole; of one that is cut, the first part or the last.
    pub fn of(course: Course, is_first: bool) -> Self {
        match (course, is_first) {
            (Course::Cut(to), true) => Self { to, ..Self::WHOLE },
            (Course::Cut(from), false) => Self {
                from,
                ..Self::WHOLE
            },
            _ => Self::WHOLE,
        }
    }
}

/// Course of a bond, as far as the faces determine it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Course {
    /// Inside of the zone.
    Inside,
    /// Outside of it.
    Outside,
    /// Through the faces once, at this fraction of it.
    Cut(f64),
    /// [`Seam::pieces`] has to tell: along a face, through an edge of the zone, or more often.
    Unclear,
}

pub(super) fn add(pieces: &mut Vec<Piece>, from: f64, to: f64, share: f64) {
    match pieces.iter_mut().find(|p| p.from == from && p.to == to) {
        Some(piece) => piece.share += share,
        None => pieces.push(Piece { from, to, share }),
    }
}

/// Returns the fraction at which the bond from `a` to `b` passes a point (1D), an edge (2D) or a triangle (3D); none if it runs in its plane.
pub(super) fn crossing<const D: usize>(
    a: &Vector<D>,
    b: &Vector<D>,
    corners: &[Vector<D>; D],
    normal: &Vector<D>,
    tolerance: f64,
) -> Option<f64> {
    let (p, q) = ((a - corners[0]).dot(normal), (b - corners[0]).dot(normal));
    if (p > tolerance && q > tolerance)
        || (p < -tolerance && q < -tolerance)
        || (p - q).abs() <= 2.0 * tolerance
    {
        return None;
    }
    let t = (p / (p - q)).clamp(0.0, 1.0);
    (beyond_edges(&(a + (b - a) * t), corners, normal) <= tolerance).then_some(t)
}

/// Returns the distance \[m\] by which a place in the plane of a point (1D), an edge (2D) or a triangle (3D) lies beyond its ends; negative inside of them.
pub(super) fn beyond_edges<const D: usize>(
    x: &Vector<D>,
    corners: &[Vector<D>; D],
    normal: &Vector<D>,
) -> f64 {
    match D {
        1 => 0.0,
        2 => {
            let e = corners[1] - corners[0];
            let s = (x - corners[0]).dot(&e) / e.norm_squared();
            (-s).max(s - 1.0) * e.norm()
        }
        _ => (0..D)
            .map(|i| {
                // distance beyond the edge, within the plane
                let (c, d) = (corners[i], corners[(i + 1) % D]);
                let e = d - c;
                let v = x - c;
                let mut across = 0.0;
                for k in 0..3 {
                    let (l, m) = ((k + 1) % 3, (k + 2) % 3);
                    across += normal[k] * (e[l] * v[m] - e[m] * v[l]);
                }
                -across / e.norm()
            })
            .fold(f64::NEG_INFINITY, f64::max),
    }
}

/// Unit normal; none of a degenerate face.
pub(super) fn normal_of<const D: usize>(x: &[Vector<D>; D]) -> Option<Vector<D>> {
    let mut n = Vector::<D>::zeros();
    match D {
        1 => n[0] = 1.0,
        2 => {
            let e = x[1] - x[0];
            (n[0], n[1]) = (e[1], -e[0]);
        }
        _ => {
            let (p, q) = (x[1] - x[0], x[2] - x[0]);
            for k in 0..3 {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                n[k] = p[i] * q[j] - p[j] * q[i];
            }
        }
    }
    let size = n.norm();
    (size > 0.0).then(|| n / size)
}

pub(super) fn for_box<const D: usize>(
    first: &[i64; D],
    last: &[i64; D],
    mut visit: impl FnMut([i64; D]),
) {
    let mut at = *first;
    loop {
        visit(at);
        let mut axis = 0;
        while axis < D {
            if at[axis] < last[axis] {
                at[axis] += 1;
                break;
            }
            at[axis] = first[axis];
            axis += 1;
        }
        if axis == D {
            return;
        }
    }
}
