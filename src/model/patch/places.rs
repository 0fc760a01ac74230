//! Places that a scene wants to be peridynamic, holds, and keeps a patch off.

use crate::tensor::Vector;

/// Places that decide where a patch lies, and what of it follows the mesh.
#[derive(Clone, Copy)]
pub struct Places<'a, const D: usize> {
    /// True in the zone.
    pub is_wanted: &'a (dyn Fn(&Vector<D>) -> bool + Sync),
    /// Places at which elements of the mesh are to lie: the zone ends a rim and a cell before them.
    pub kept_off: &'a [Vector<D>],
    /// True of a node of the mesh that has a prescribed motion: it follows none.
    pub is_held: &'a dyn Fn(u32) -> bool,
    /// True at a place with a prescribed motion; none where there is none. The forces of supports would reach nodes of the mesh through what follows these.
    pub holds: Option<&'a dyn Fn(&Vector<D>) -> bool>,
}
