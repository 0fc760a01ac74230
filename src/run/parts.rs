//! Parts of cut elements as a file shows them.

use rustc_hash::FxHashMap;

use super::fields::place::Spot;
use crate::fem;
use crate::mesh::{CellShape, Mesh};
use crate::model::{Model, patch::Left};
use crate::parallel;
use crate::tensor::{Vector, padded};

/// Distance of a corner from a node, over the size of the element, up to which it is the node.
const AT_NODE: f64 = 1e-12;

/// The part of a cut element that belongs to the body, in simplices.
pub(super) struct ElementParts<const D: usize> {
    /// Nodes of the element that are corners.
    pub nodes: Vec<u32>,
    /// The other corners: positions and places in the element.
    pub corners: Vec<(Vector<D>, Spot)>,
    /// The corners of each simplex among nodes and other corners, in this order, and its volume.
    pub simplices: Vec<([usize; 4], f64)>,
}

impl<const D: usize> ElementParts<D> {
    /// Shape of all parts.
    pub const SHAPE: CellShape = [CellShape::Line2, CellShape::Tri3, CellShape::Tet4][D - 1];

    /// Those of the elements among some cells that are cut.
    pub fn of(model: &Model<D>, cells: impl Iterator<Item = usize>) -> FxHashMap<u32, Self> {
        let mesh = &model.mesh;
        let is_cut = |c: &usize| mesh.embedded.cut_cell(*c).is_some() && model.is_element(*c);
        let cut: Vec<usize> = cells.filter(is_cut).collect();
        if cut.is_empty() {
            return FxHashMap::default();
        }
        let left = Left::new(mesh);
        let parts = parallel::map_slice(&cut, |&c| {
            Some((c as u32, Self::of_element(mesh, c, &left)?))
        });
        parts.into_iter().flatten().collect()
    }

    fn of_element(mesh: &Mesh<D>, c: usize, left: &Left<'_, D>) -> Option<Self> {
        let left = left.simplices(c)?;
        let (low, high) = mesh.bounds_of(mesh.corners(c));
        let near = AT_NODE * (high - low).amax();
        let node_at = |x: &Vector<D>| {
            let is_at = |n: &&u32| (mesh.nodes[**n as usize] - x).amax() <= near;
            mesh.corners(c).iter().find(is_at).copied()
        };
        let mut all: Vec<(Vector<D>, Option<u32>)> = Vec::new();
        let mut known: FxHashMap<[u64; D], usize> = FxHashMap::default();
        let mut number = |x: &Vector<D>| {
            let key = std::array::from_fn(|i| x[i].to_bits());
            *known.entry(key).or_insert_with(|| {
                all.push((*x, node_at(x)));
                all.len() - 1
            })
        };
        let mut simplices: Vec<([usize; 4], f64)> = (left.iter())
            .map(|(x, size)| (std::array::from_fn(|i| number(&x[i.min(D)])), *size))
            .collect();
        let mut nodes: Vec<u32> = all.iter().filter_map(|corner| corner.1).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let mut corners = Vec::new();
        let mut order = Vec::new();
        for (x, node) in &all {
            order.push(match node.and_then(|n| nodes.binary_search(&n).ok()) {
                Some(k) => k,
                None => {
                    let xi = fem::reference_of(mesh, c, x)?;
                    corners.push((*x, Spot::InElement(c, padded(&xi))));
                    nodes.len() + corners.len() - 1
                }
            });
        }
        let renumbered = simplices.iter_mut().flat_map(|simplex| &mut simplex.0);
        renumbered.for_each(|corner| *corner = order[*corner]);
        Some(Self {
            nodes,
            corners,
            simplices,
        })
    }
}
