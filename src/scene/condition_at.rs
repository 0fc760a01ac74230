//! A condition where the scene names it: the context in which each kind of condition is read.

use super::solve::Clock;
use super::value::Text;
use crate::mesh::Mesh;

/// The name of a condition, the place of its table, and the mesh and the clock of its scene.
pub(crate) struct ConditionAt<'a, const D: usize> {
    pub place: &'a str,
    pub name: &'a Text,
    pub mesh: &'a Mesh<D>,
    pub clock: Clock,
}
