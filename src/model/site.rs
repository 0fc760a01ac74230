//! Sites of a body: nodes of elements and peridynamic points.

use crate::tensor::Vector;

/// Carrier of the degrees of freedom at a site.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SiteKind {
    /// A node of finite elements, by its number in the mesh.
    Node(u32),
    /// A peridynamic point, by its number in the cloud.
    Point(u32),
}

/// A place where a body keeps degrees of freedom.
#[derive(Clone, Copy, Debug)]
pub struct Site<const D: usize> {
    /// Reference position \[m\].
    pub position: Vector<D>,
    /// Node or point.
    pub kind: SiteKind,
    /// Volume of the part of the body that the site stands for \[m^D\], see [`Tributary`](crate::model::Tributary): far from seams and surfaces that of the point's cell, or the integral of the node's shape function.
    pub volume: f64,
}
