//! Places whose displacement a scene prescribes.

use rustc_hash::FxHashMap;

use crate::mesh::{IN_PLANE, Mesh};
use crate::scene::conditions::{Condition, Support};
use crate::scene::region::Region;
use crate::tensor::Vector;

/// Nodes of a mesh, and places, whose displacement is prescribed.
pub(super) struct HeldPlaces<'a, const D: usize> {
    pub nodes: Vec<bool>,
    /// Facets of supports by the cells of a grid that they may meet.
    facets: FxHashMap<[i32; D], Vec<&'a [u32]>>,
    regions: Vec<&'a Region<D>>,
    /// Edge of the cells of the grid.
    edge: f64,
}

impl<'a, const D: usize> HeldPlaces<'a, D> {
    /// Those of the supports among `conditions`, by a grid of cells with this edge.
    pub fn new(mesh: &Mesh<D>, conditions: &'a [Condition<D>], edge: f64) -> Self {
        let mut held = Self {
            nodes: vec![false; mesh.nodes.len()],
            facets: FxHashMap::default(),
            regions: Vec::new(),
            edge,
        };
        for support in conditions.iter().filter_map(Condition::support) {
            match support {
                Support::Set { nodes, facets, .. } => {
                    nodes.iter().for_each(|&n| held.nodes[n as usize] = true);
                    for facet in facets {
                        held.add(mesh, facet);
                    }
                }
                Support::Inside(region) => {
                    let inside = region.select_nodes(mesh);
                    let all = held.nodes.iter_mut().zip(inside);
                    all.for_each(|(held, is)| *held |= is);
                    held.regions.push(region);
                }
            }
        }
        held
    }

    /// The cell of the grid that holds a place.
    fn cell(&self, x: &Vector<D>) -> [i32; D] {
        std::array::from_fn(|i| (x[i] / self.edge).floor() as i32)
    }

    fn add(&mut self, mesh: &Mesh<D>, facet: &'a [u32]) {
        let (low, high) = mesh.bounds_of(facet);
        let off = Vector::repeat(IN_PLANE * self.edge);
        let (from, to) = (self.cell(&(low - off)), self.cell(&(high + off)));
        let mut index = from;
        loop {
            self.facets.entry(index).or_default().push(facet);
            let Some(axis) = (0..D).find(|&i| index[i] < to[i]) else {
                return;
            };
            index[axis] += 1;
            index[..axis].copy_from_slice(&from[..axis]);
        }
    }

    /// Returns true if nothing is prescribed.
    pub fn is_empty(&self) -> bool {
        self.facets.is_empty() && self.regions.is_empty()
    }

    /// Returns true if the displacement is prescribed at a place.
    pub fn holds(&self, mesh: &Mesh<D>, x: &Vector<D>) -> bool {
        let tolerance = IN_PLANE * self.edge;
        let near = self.facets.get(&self.cell(x)).into_iter().flatten();
        let mut regions = self.regions.iter();
        regions.any(|region| region.contains(x, tolerance))
            || (near.into_iter()).any(|facet| mesh.distance_to_facet(x, facet) <= tolerance)
    }
}
