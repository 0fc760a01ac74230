//! Cells of first and second order: corners, nodes in the middle of edges, and from the one to the other.

use rustc_hash::{FxHashMap, FxHashSet};

use super::{Facet, Mesh};
use crate::tensor::Vector;

/// The order of the cells of a mesh from a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "FileOrderSpec")]
pub enum Order {
    /// As the file has them.
    #[default]
    Kept,
    /// Linear: nodes in the middle of edges are left out.
    Linear,
    /// Second order: linear cells get nodes in the middle of their edges, which stay straight.
    Second,
}

/// A node in the middle of an edge that a cell of first order has too: it follows the ends of the edge, or the cells would part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tie {
    /// The node.
    pub node: u32,
    /// The ends of its edge.
    pub ends: [u32; 2],
}

/// The corners of a facet of a mesh of dimension `D`, without the nodes in the middle of its edges.
pub fn facet_corners<const D: usize>(nodes: &[u32]) -> &[u32] {
    match (D, nodes.len()) {
        (2, 3) => &nodes[..2],
        (3, 6) => &nodes[..3],
        (3, 8) => &nodes[..4],
        _ => nodes,
    }
}

fn sorted(mut ends: [u32; 2]) -> [u32; 2] {
    ends.sort_unstable();
    ends
}

impl<const D: usize> Mesh<D> {
    /// The corners of cell `c`.
    pub fn corners(&self, c: usize) -> &[u32] {
        &self.cell(c)[..self.shapes[c].linear().node_count()]
    }

    /// Returns true if any cell is of second order.
    pub fn has_quadratic_cells(&self) -> bool {
        self.shapes.iter().any(|shape| shape.is_quadratic())
    }

    /// Nodes after the corners of cell `c`, each with the ends of its edge.
    pub fn mid_sides(&self, c: usize) -> impl Iterator<Item = Tie> + '_ {
        let cell = self.cell(c);
        let sides = self.shapes[c].mid_sides();
        let corners = cell.len() - sides.len();
        sides.iter().enumerate().map(move |(k, &[p, q])| Tie {
            node: cell[corners + k],
            ends: [cell[p], cell[q]],
        })
    }

    /// Distance of the nodes in the middle of edges of cell `c` from the midpoints, summed by coordinate \[length\]: zero where its sides are straight and halved.
    pub fn bulge(&self, c: usize) -> Vector<D> {
        let x = |n: u32| self.nodes[n as usize];
        self.mid_sides(c).fold(Vector::zeros(), |sum, side| {
            sum + (x(side.node) - (x(side.ends[0]) + x(side.ends[1])) * 0.5).abs()
        })
    }

    /// The nodes of cells of second order that lie in the middle of an edge which a cell of first order has too; by number.
    pub fn ties(&self) -> Vec<Tie> {
        if !self.has_quadratic_cells() {
            return Vec::new();
        }
        let mut straight: FxHashSet<[u32; 2]> = FxHashSet::default();
        let cells = |quadratic: bool| {
            (0..self.cell_count()).filter(move |&c| self.shapes[c].is_quadratic() == quadratic)
        };
        for c in cells(false) {
            let cell = self.cell(c);
            let edges = self.shapes[c].quadratic().mid_sides().iter();
            straight.extend(edges.map(|&[p, q]| sorted([cell[p], cell[q]])));
        }
        let mut ties: Vec<Tie> = cells(true)
            .flat_map(|c| self.mid_sides(c))
            .filter(|side| straight.contains(&sorted(side.ends)))
            .collect();
        ties.sort_unstable_by_key(|tie| tie.node);
        ties.dedup_by_key(|tie| tie.node);
        ties
    }

    /// Makes cells of second order of linear ones: a new node in the middle of each edge, in the facets of sets too.
    pub fn raise_order(&mut self) {
        let mut middle: FxHashMap<[u32; 2], u32> = FxHashMap::default();
        let mut raised = Self {
            nodes: std::mem::take(&mut self.nodes),
            ..Self::default()
        };
        let mut cell = Vec::new();
        for (c, shape) in self.shapes.iter().enumerate() {
            cell.clear();
            cell.extend_from_slice(self.corners(c));
            let shape = shape.quadratic();
            for &[p, q] in shape.mid_sides() {
                let ends = sorted([cell[p], cell[q]]);
                let number = *middle.entry(ends).or_insert_with(|| {
                    let [x, y] = ends.map(|n| raised.nodes[n as usize]);
                    raised.nodes.push((x + y) * 0.5);
                    raised.nodes.len() as u32 - 1
                });
                cell.push(number);
            }
            raised.push_cell(shape, &cell);
        }
        for facet in self.facet_sets.values_mut().flatten() {
            facet.truncate(facet_corners::<D>(facet).len());
            let n = facet.len();
            let edges = if n == 2 { 1 } else { n };
            for i in 0..if n == 1 { 0 } else { edges } {
                // a facet of no cell keeps its corners alone
                let ends = sorted([facet[i], facet[(i + 1) % n]]);
                facet.extend(middle.get(&ends));
            }
        }
        self.nodes = raised.nodes;
        (self.shapes, self.offsets, self.connectivity) =
            (raised.shapes, raised.offsets, raised.connectivity);
    }

    /// Makes linear cells of the marked ones by leaving out the nodes in the middle of their edges.
    ///
    /// Nodes keep their numbers: those that no cell uses any more stay where they are. Facets of sets become those of their cells; node sets keep what is left in use.
    pub fn linearise(&mut self, marked: impl Fn(usize) -> bool) {
        let mut connectivity = Vec::with_capacity(self.connectivity.len());
        let mut offsets = vec![0];
        for c in 0..self.cell_count() {
            let nodes = if marked(c) {
                self.corners(c)
            } else {
                self.cell(c)
            };
            connectivity.extend_from_slice(nodes);
            offsets.push(connectivity.len() as u32);
        }
        for (c, shape) in self.shapes.iter_mut().enumerate() {
            if marked(c) {
                *shape = shape.linear();
            }
        }
        (self.connectivity, self.offsets) = (connectivity, offsets);
        let mut used = vec![false; self.nodes.len()];
        for &n in &self.connectivity {
            used[n as usize] = true;
        }
        let sets = std::mem::take(&mut self.facet_sets);
        self.facet_sets = (sets.into_iter())
            .map(|(name, facets)| (name, self.present_facets(facets)))
            .collect();
        for set in self.node_sets.values_mut() {
            set.retain(|&n| used[n as usize]);
        }
    }

    /// The facets with the nodes that their cells have: cells that were made linear have no nodes in the middle of their edges.
    pub fn present_facets(&self, facets: Vec<Facet>) -> Vec<Facet> {
        let has_mid_sides = |facet: &Facet| facet_corners::<D>(facet).len() < facet.len();
        if !facets.iter().any(has_mid_sides) {
            return facets;
        }
        let mut longest: FxHashMap<Vec<u32>, usize> = FxHashMap::default();
        let key = |nodes: &[u32]| {
            let mut corners = facet_corners::<D>(nodes).to_vec();
            corners.sort_unstable();
            corners
        };
        for facet in facets.iter().filter(|facet| has_mid_sides(facet)) {
            longest.insert(key(facet), usize::MAX);
        }
        for c in 0..self.cell_count() {
            let cell = self.cell(c);
            for local in self.shapes[c].facets() {
                let nodes: Vec<u32> = local.iter().map(|&i| cell[i]).collect();
                if let Some(length) = longest.get_mut(&key(&nodes)) {
                    *length = (*length).min(nodes.len());
                }
            }
        }
        let present = |mut facet: Facet| {
            if let Some(&length) = longest.get(&key(&facet)) {
                facet.truncate(length);
            }
            facet
        };
        facets.into_iter().map(present).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::CellShape;
    use crate::mesh::generate::{Axis, Grid};

    const QUADRATIC: [CellShape; 5] = [
        CellShape::Line3,
        CellShape::Tri6,
        CellShape::Quad8,
        CellShape::Tet10,
        CellShape::Hex20,
    ];

    #[test]
    fn facets_have_the_corners_of_the_linear_shape_and_what_lies_between() {
        for shape in QUADRATIC {
            let corners = shape.linear().node_count();
            assert_eq!(corners + shape.mid_sides().len(), shape.node_count());
            let between = |p: usize, q: usize| {
                let is_it = |ends: &[usize; 2]| *ends == [p, q] || *ends == [q, p];
                corners + shape.mid_sides().iter().position(is_it).unwrap()
            };
            for (facet, linear) in shape.facets().iter().zip(shape.linear().facets()) {
                let n = linear.len();
                assert_eq!(facet[..n], **linear);
                let sides = if n == 2 { 1 } else { n };
                let expected: Vec<usize> = (0..if n == 1 { 0 } else { sides })
                    .map(|i| between(linear[i], linear[(i + 1) % n]))
                    .collect();
                assert_eq!(facet[n..], expected, "{shape:?}");
            }
        }
    }

    #[test]
    fn half_of_a_mesh_becomes_linear_and_is_tied_to_the_other() {
        let axis = Axis::Uniform {
            min: 0.0,
            max: 1.0,
            cells: 2,
        };
        let mut mesh = Grid::new([axis.clone(), axis.clone(), axis])
            .mesh()
            .unwrap();
        mesh.raise_order();
        assert_eq!((mesh.nodes.len(), mesh.cell_count()), (81, 8));
        assert!(mesh.ties().is_empty());
        // cells 0 to 3 lie below z = ½
        mesh.linearise(|c| c < 4);
        let ties = mesh.ties();
        assert_eq!(ties.len(), 12);
        for tie in &ties {
            let [x, p, q] = [tie.node, tie.ends[0], tie.ends[1]].map(|n| mesh.nodes[n as usize]);
            assert_eq!(x[2], 0.5);
            assert_eq!((p + q) * 0.5, x);
        }
        let lengths = |name: &str, mesh: &Mesh<3>| {
            let mut found: Vec<usize> = mesh.facet_sets[name].iter().map(Vec::len).collect();
            found.sort_unstable();
            found
        };
        assert_eq!(lengths("left", &mesh), [4, 4, 8, 8]);
        assert_eq!(lengths("back", &mesh), [4; 4]);
        assert_eq!(lengths("front", &mesh), [8; 4]);
        assert_eq!(mesh.outer_facets().len(), 24);
        mesh.linearise(|_| true);
        mesh.drop_unused_nodes();
        assert_eq!(mesh.nodes.len(), 27);
    }
}
