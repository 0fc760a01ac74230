//! Distance to the edge between two sets of cells: what a blending function is a function of.

use crate::{mesh::Mesh, tensor::Vector};

/// The facets between two sets of cells.
pub struct Edge<'a, const D: usize> {
    mesh: &'a Mesh<D>,
    facets: Vec<(Vector<D>, Vector<D>, Vec<u32>)>,
}

impl<'a, const D: usize> Edge<'a, D> {
    /// The facets between the cells that `first` selects and the other cells.
    pub fn of(mesh: &'a Mesh<D>, first: impl Fn(usize) -> bool) -> Self {
        let class: Vec<bool> = (0..mesh.cell_count()).map(first).collect();
        let facets = mesh
            .interface_facets(&class, &true, &false)
            .into_iter()
            .map(|facet| {
                let nodes = facet.first.nodes;
                let (low, high) = mesh.bounds_of(&nodes);
                (low, high, nodes)
            })
            .collect();
        Self { mesh, facets }
    }

    /// Distance of `x` to the edge \[m\]; infinite if there is none.
    pub fn distance(&self, x: &Vector<D>) -> f64 {
        self.nearest(x, f64::INFINITY)
    }

    /// Returns true if `x` is nearer to the edge than `limit` \[m\].
    pub fn within(&self, x: &Vector<D>, limit: f64) -> bool {
        self.nearest(x, limit) < limit
    }

    fn nearest(&self, x: &Vector<D>, limit: f64) -> f64 {
        let mut best = limit;
        for (low, high, nodes) in &self.facets {
            let outside = (low - x).sup(&(x - high)).map(|d| d.max(0.0));
            if outside.norm() < best {
                best = best.min(self.mesh.distance_to_facet(x, nodes));
            }
        }
        best
    }
}
