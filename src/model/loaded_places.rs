//! The elements and the cells of points that facets of a mesh belong to.

use crate::mesh::boundary::BoundaryFacet;
use crate::mesh::{Facet, facet_corners};
use crate::model::Model;

/// Returns true if any of the facets may belong to a cell that holds points: all of its nodes do. To find the cells themselves takes all facets of the mesh.
pub(crate) fn may_bound_zone<const D: usize>(model: &Model<D>, facets: &[Facet]) -> bool {
    let at_zone = |facet: &Facet| {
        if let Some(crossing) = model.mesh.embedded.crossing(facet) {
            return !model.is_element(crossing.cell as usize);
        }
        let corners = facet_corners::<D>(facet);
        corners.iter().all(|&n| model.touches_points(n))
    };
    facets.iter().any(at_zone)
}

/// Facets of finite elements, and those of cells that hold points.
pub(crate) fn split_facets<const D: usize>(
    model: &Model<D>,
    facets: &[Facet],
) -> (Vec<Facet>, Vec<BoundaryFacet>) {
    if !may_bound_zone(model, facets) {
        return (model.mesh.present_facets(facets.to_vec()), Vec::new());
    }
    // a facet without a cell is an element's as far as anybody knows
    let Ok(located) = model.mesh.locate_facets(facets) else {
        return (facets.to_vec(), Vec::new());
    };
    let (own, zone): (Vec<_>, Vec<_>) = located
        .into_iter()
        .partition(|f| model.is_element(f.cell as usize));
    (own.into_iter().map(|f| f.nodes).collect(), zone)
}
