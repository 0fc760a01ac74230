//! Sets and shapes that conditions of a scene name.

use rustc_hash::FxHashSet;

use super::condition_at::ConditionAt;
use super::error::SceneError;
use super::region::{Region, region, unknown_set};
use super::spec::ShapeSpec;
use super::value::Text;
use crate::mesh::boundary::BoundaryFacet;
use crate::mesh::{Facet, Mesh};
use crate::tensor::Vector;

/// Place at which a displacement is prescribed.
#[derive(Clone, Debug, PartialEq)]
pub enum Support<const D: usize> {
    /// On a named set of the mesh: its nodes, and the facets among them if it is a set of facets.
    Set {
        /// Its name.
        name: String,
        /// Its nodes.
        nodes: Vec<u32>,
        /// Its facets.
        facets: Vec<Facet>,
    },
    /// At all sites inside a region.
    Inside(Region<D>),
}

/// A shape that holds a part of the mesh.
pub(crate) fn inside<const D: usize>(
    place: &str,
    name: &Text,
    shape: &ShapeSpec,
    mesh: &Mesh<D>,
) -> Result<Region<D>, SceneError> {
    if let ShapeSpec::Set(set) = shape {
        return Err(
            SceneError::conflict(format!("`{place}.inside` is the set `{set}`"))
                .label(set.span.clone(), "no shape")
                .help("name a set by `on`, or give a shape such as `box`"),
        );
    }
    let found = region(&format!("{place}.inside"), shape, mesh)?;
    let tolerance = 1e-9 * (mesh.bounds().1 - mesh.bounds().0).norm();
    let holds_something = mesh.nodes.iter().any(|x| found.contains(x, tolerance))
        || (0..mesh.cell_count()).any(|c| found.contains(&mesh.centroid(c), tolerance));
    if holds_something {
        return Ok(found);
    }
    Err(
        SceneError::empty(format!("`{place}.inside` holds no part of the mesh"))
            .label(name.span.clone(), "acts nowhere")
            .help(extent(mesh)),
    )
}

/// The extent of a mesh, as a remedy for what misses it.
pub(crate) fn extent<const D: usize>(mesh: &Mesh<D>) -> String {
    let (lo, hi) = mesh.bounds();
    format!(
        "the mesh reaches from {:?} to {:?}",
        lo.as_slice(),
        hi.as_slice()
    )
}

impl<'a, const D: usize> ConditionAt<'a, D> {
    /// The place of a condition: a set of the mesh, or a shape.
    pub fn support(
        &self,
        on: Option<&Text>,
        inside: Option<&ShapeSpec>,
    ) -> Result<Support<D>, SceneError> {
        let (place, mesh) = (self.place, self.mesh);
        Ok(match (on, inside) {
            (Some(set), None) => {
                let at = format!("{place}.on");
                let known = mesh.set_names();
                let Some(nodes) = mesh.nodes_of_set(&set.value) else {
                    return Err(unknown_set(&at, set, "set", &known, mesh));
                };
                not_empty(&at, set, nodes.len())?;
                Support::Set {
                    name: set.value.clone(),
                    nodes,
                    facets: mesh.facet_sets.get(&set.value).cloned().unwrap_or_default(),
                }
            }
            (None, Some(shape)) => Support::Inside(self.inside(shape)?),
            (both, _) => {
                let (what, label) = match both {
                    Some(_) => ("both `on` and `inside`", "two places"),
                    None => ("neither `on` nor `inside`", "where?"),
                };
                return Err(SceneError::choice(format!("`{place}` has {what}"))
                    .label(self.name.span.clone(), label)
                    .help("keep one: `on = \"set\"` of the mesh, or `inside = { box = ... }`"));
            }
        })
    }

    /// A shape that holds a part of the mesh.
    pub fn inside(&self, shape: &ShapeSpec) -> Result<Region<D>, SceneError> {
        inside(self.place, self.name, shape, self.mesh)
    }

    /// The facets of a named set, of which there are some.
    pub fn facet_set(&self, on: &Text) -> Result<&'a [Facet], SceneError> {
        let place = format!("{}.on", self.place);
        let sets = &self.mesh.facet_sets;
        let Some(facets) = sets.get(&on.value) else {
            let known: Vec<&str> = sets.keys().map(String::as_str).collect();
            let wanted = ["set of end points", "set of edges", "set of faces"][D - 1];
            return Err(unknown_set(&place, on, wanted, &known, self.mesh));
        };
        not_empty(&place, on, facets.len())?;
        Ok(facets)
    }

    /// The facets of a named set, normals outwards; all of them bound the mesh.
    pub fn outer_facets(&self, on: &Text) -> Result<Vec<BoundaryFacet>, SceneError> {
        let (place, mesh) = (self.place, self.mesh);
        let facets = self.facet_set(on)?;
        let sorted = |nodes: &[u32]| {
            let mut nodes = nodes.to_vec();
            nodes.sort_unstable();
            nodes
        };
        let outer = mesh.outer_facets();
        let outer: FxHashSet<Vec<u32>> = outer.iter().map(|f| sorted(&f.nodes)).collect();
        if let Some(inner) = facets.iter().find(|f| !outer.contains(&sorted(f))) {
            let nodes = inner.iter().map(|&n| mesh.nodes[n as usize]);
            let middle = nodes.sum::<Vector<D>>() / inner.len() as f64;
            return Err(SceneError::conflict(format!(
                "`{place}.on`: the facet of the set `{on}` at {:?} is not at the boundary of the mesh",
                middle.as_slice()
            ))
            .label(on.span.clone(), "has no outside there")
            .help("name a set of facets that each belong to one cell; inside of the body prescribe a traction"));
        }
        self.faces(on)
    }

    /// The facets of a named set, each a face of a cell, its normal pointing out of that.
    pub fn faces(&self, on: &Text) -> Result<Vec<BoundaryFacet>, SceneError> {
        let facets = self.facet_set(on)?;
        self.mesh.locate_facets(facets).map_err(|error| {
            let message = format!("`{}.on`: {error}", self.place);
            SceneError::conflict(message)
                .label(on.span.clone(), "not a face of a cell")
                .help("let the set hold faces of the cells of this mesh only")
        })
    }
}

fn not_empty(place: &str, set: &Text, count: usize) -> Result<(), SceneError> {
    if count > 0 {
        return Ok(());
    }
    Err(
        SceneError::empty(format!("`{place}`: the set `{set}` of the mesh is empty"))
            .label(set.span.clone(), "empty")
            .help("put facets or nodes of the body's cells into it, or name another set"),
    )
}
