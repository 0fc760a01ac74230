//! The shape of a rigid impactor: depth of a position inside it, and the shortest direction out.

use crate::tensor::Vector;

/// Shape of a rigid impactor.
#[derive(Clone, Debug, PartialEq)]
pub enum ImpactorShape<const D: usize> {
    /// A sphere; a disc in two dimensions, an interval in one.
    Sphere {
        /// Its centre \[m\].
        center: Vector<D>,
        /// Its radius \[m\].
        radius: f64,
    },
    /// A cylinder without ends, of solids.
    Cylinder {
        /// A point of its axis \[m\].
        point: Vector<D>,
        /// The direction of its axis, of length 1.
        direction: Vector<D>,
        /// Its radius \[m\].
        radius: f64,
    },
    /// The half space behind a plane.
    Plane {
        /// A point of the plane \[m\].
        point: Vector<D>,
        /// The normal of length 1 that points out of the impactor.
        normal: Vector<D>,
    },
}

impl<const D: usize> ImpactorShape<D> {
    /// The place that stands for the impactor where its position is told: its centre, or the point that was given \[m\].
    pub fn place(&self) -> Vector<D> {
        match self {
            Self::Sphere { center, .. } => *center,
            Self::Cylinder { point, .. } | Self::Plane { point, .. } => *point,
        }
    }

    /// Distance of its place from the origin, and its radius \[m\]: what a depth is rounded by.
    pub fn extent(&self) -> f64 {
        let radius = match self {
            Self::Sphere { radius, .. } | Self::Cylinder { radius, .. } => *radius,
            Self::Plane { .. } => 0.0,
        };
        self.place().norm() + radius
    }

    /// Returns the depth \[m\] inside of the shape of a site that extends `clearance` beyond `x`, and the unit vector along the shortest way out; none outside, and none on a centre or an axis, from which no way is the shortest.
    #[inline]
    pub fn penetration(&self, x: &Vector<D>, clearance: f64) -> Option<(f64, Vector<D>)> {
        let (from, radius) = match self {
            Self::Sphere { center, radius } => (x - center, *radius),
            Self::Cylinder {
                point,
                direction,
                radius,
            } => {
                let from = x - point;
                (from - direction * from.dot(direction), *radius)
            }
            Self::Plane { point, normal } => {
                let depth = clearance - (x - point).dot(normal);
                return (depth > 0.0).then_some((depth, *normal));
            }
        };
        let reach = radius + clearance;
        let square = from.norm_squared();
        // most sites are far away: no root for them
        if square >= reach * reach || square == 0.0 {
            return None;
        }
        let distance = square.sqrt();
        Some((reach - distance, from / distance))
    }

    /// The direction of its axis, a unit vector; none but a cylinder has one.
    pub fn axis(&self) -> Option<Vector<D>> {
        match self {
            Self::Cylinder { direction, .. } => Some(*direction),
            Self::Sphere { .. } | Self::Plane { .. } => None,
        }
    }

    /// The largest area that a body between the corners `low` and `high` may lay against the impactor \[m²\] (\[m\] in 2D, 1 in 1D): half of a sphere or cylinder, or what the box shows to it.
    pub fn largest_area(&self, low: &Vector<D>, high: &Vector<D>) -> f64 {
        let extent = high - low;
        // the faces of the box across each axis
        let face = |k: usize| -> f64 { (0..D).filter(|&j| j != k).map(|j| extent[j]).product() };
        let shown = |normal: &Vector<D>| -> f64 { (0..D).map(|k| normal[k].abs() * face(k)).sum() };
        let all: f64 = (0..D).map(face).sum();
        match self {
            Self::Sphere { radius, .. } => {
                let own = [
                    1.0,
                    std::f64::consts::PI * radius,
                    2.0 * std::f64::consts::PI * radius * radius,
                ][D - 1];
                own.min(all)
            }
            Self::Cylinder { radius, .. } => {
                (std::f64::consts::PI * radius * extent.norm()).min(all)
            }
            Self::Plane { normal, .. } => shown(normal),
        }
    }
}
