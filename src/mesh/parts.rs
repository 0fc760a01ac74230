//! A mesh in memory, as another program hands it over: positions, blocks of elements and named sets by numbers.

use super::raw::{Encoding, RawElement, RawMesh, RawNode, Source};
use super::{CellShape, Mesh, MeshError, Order, quality};
use rustc_hash::FxHashMap;
use std::path::PathBuf;

/// A mesh in memory.
///
/// [`MeshParts::mesh`] makes a mesh of it as a reader does of a file: elements of the largest dimension become cells, sets of them cell sets, sets of elements
/// of one dimension less facet sets, and so on.
///
/// Shapes: nodes and elements are numbered from 0, elements through all blocks.
/// Units: whatever the scene uses for length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshParts {
    /// Name in messages.
    pub name: String,
    /// Positions; zero beyond the dimension of the mesh.
    pub points: Vec<[f64; 3]>,
    /// Elements of one shape each, by the nodes of one after another, in VTK's order.
    pub blocks: Vec<(CellShape, Vec<u64>)>,
    /// Named sets of elements.
    pub element_sets: Vec<(String, Vec<u64>)>,
    /// Named sets of nodes.
    pub point_sets: Vec<(String, Vec<u64>)>,
}

impl MeshParts {
    /// Number of elements of all blocks.
    pub fn element_count(&self) -> usize {
        let blocks = self.blocks.iter();
        blocks
            .map(|(shape, nodes)| nodes.len() / shape.node_count())
            .sum()
    }

    /// The mesh, with the checks that one from a file has to pass.
    ///
    /// # Errors
    /// [`MeshError`]: numbers of nodes and elements that are not there, another dimension than `D`, repeated or distorted elements, coordinates that are no numbers.
    pub fn mesh<const D: usize>(&self) -> Result<Mesh<D>, MeshError> {
        self.mesh_of(Order::Kept)
    }

    /// As [`MeshParts::mesh`], with the order that cells of second order are to have.
    ///
    /// # Errors
    /// As [`MeshParts::mesh`].
    pub fn mesh_of<const D: usize>(&self, order: Order) -> Result<Mesh<D>, MeshError> {
        let source = Source {
            path: PathBuf::from(&self.name),
            bytes: &[],
            encoding: Encoding::Memory,
            pieces: &[],
        };
        let mut raw = self.raw(&source)?;
        raw.set_order(order);
        let mesh = raw.assemble(&source)?;
        quality::check(&mesh)?;
        Ok(mesh)
    }

    fn raw(&self, source: &Source) -> Result<RawMesh, MeshError> {
        let mut raw = RawMesh::default();
        let nodes = self.points.iter().enumerate();
        raw.nodes = nodes
            .map(|(at, &x)| RawNode {
                tag: at as u64,
                x,
                at,
            })
            .collect();
        let groups = self.groups(source, &mut raw)?;
        for (shape, nodes) in &self.blocks {
            if !nodes.len().is_multiple_of(shape.node_count()) {
                return Err(source.syntax(
                    raw.elements.len(),
                    &format!("{} node numbers", nodes.len()),
                    &format!("a multiple of {}", shape.node_count()),
                    "give each element of the block all its nodes",
                ));
            }
            for element in nodes.chunks_exact(shape.node_count()) {
                let at = raw.elements.len();
                let group = groups.get(&(at as u64)).copied().unwrap_or(0);
                push(&mut raw, *shape, element, group);
            }
        }
        for (name, set) in &self.point_sets {
            raw.groups.push(vec![name.clone()]);
            let group = raw.groups.len() as u32 - 1;
            for &node in set {
                push(&mut raw, CellShape::Vertex, &[node], group);
            }
        }
        Ok(raw)
    }

    /// The list of sets that each element of a set is in, by its number in `raw.groups`.
    fn groups(&self, source: &Source, raw: &mut RawMesh) -> Result<FxHashMap<u64, u32>, MeshError> {
        let count = self.element_count();
        let mut sets: FxHashMap<u64, Vec<u32>> = FxHashMap::default();
        for (number, (name, set)) in self.element_sets.iter().enumerate() {
            for &element in set {
                if element >= count as u64 {
                    return Err(source.syntax(
                        number,
                        &format!("element {element} in the set {name}"),
                        &format!("one of {count} elements"),
                        "number the elements of a set from 0",
                    ));
                }
                let of_element = sets.entry(element).or_default();
                // a set that names an element twice holds it once
                if of_element.last() != Some(&(number as u32)) {
                    of_element.push(number as u32);
                }
            }
        }
        let mut known: FxHashMap<Vec<u32>, u32> = FxHashMap::default();
        let mut elements: Vec<(u64, Vec<u32>)> = sets.into_iter().collect();
        elements.sort_unstable();
        let group = |(element, of_element): (u64, Vec<u32>)| {
            let names = || {
                let numbers = of_element.iter();
                numbers
                    .map(|&n| self.element_sets[n as usize].0.clone())
                    .collect()
            };
            let found = known.get(&of_element).copied().unwrap_or_else(|| {
                raw.groups.push(names());
                raw.groups.len() as u32 - 1
            });
            known.insert(of_element, found);
            (element, found)
        };
        Ok(elements.into_iter().map(group).collect())
    }
}

fn push(raw: &mut RawMesh, shape: CellShape, nodes: &[u64], group: u32) {
    let at = raw.elements.len();
    raw.elements.push(RawElement {
        tag: at as u64,
        shape,
        start: raw.element_nodes.len(),
        group,
        at,
    });
    raw.element_nodes.extend_from_slice(nodes);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::read;

    const SQUARE: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n0 9 \"corner\"\n1 7 \"side\"\n2 5 \"plate\"\n$EndPhysicalNames\n\
        $Nodes\n5\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 9 9 0\n$EndNodes\n\
        $Elements\n4\n1 15 2 9 1 3\n2 1 2 7 1 2 3\n3 2 2 5 1 1 2 3\n4 2 2 0 1 1 3 4\n$EndElements\n";

    fn square() -> MeshParts {
        MeshParts {
            name: "square".into(),
            points: vec![
                [0.0, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [1.0, 1.0, 0.0],
                [0.0, 1.0, 0.0],
                [9.0, 9.0, 0.0],
            ],
            blocks: vec![
                (CellShape::Line2, vec![1, 2]),
                (CellShape::Tri3, vec![0, 1, 2, 0, 2, 3]),
            ],
            element_sets: vec![("side".into(), vec![0]), ("plate".into(), vec![1, 1])],
            point_sets: vec![("corner".into(), vec![2])],
        }
    }

    #[test]
    fn the_same_mesh_as_from_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("square.msh");
        std::fs::write(&path, SQUARE).unwrap();
        let mesh = square().mesh::<2>().unwrap();
        assert_eq!(mesh, read::read::<2>(&path).unwrap());
        assert_eq!(mesh.facet_sets["side"], [[1, 2]]);
        assert_eq!(mesh.cell_sets["plate"], [0]);
        assert_eq!(mesh.node_sets["corner"], [2]);
    }

    #[test]
    fn numbers_that_are_not_there_are_named() {
        let message = |change: &dyn Fn(&mut MeshParts)| {
            let mut parts = square();
            change(&mut parts);
            parts.mesh::<2>().unwrap_err().to_string()
        };
        let node = message(&|p| p.blocks[1].1[5] = 17);
        assert!(
            node.contains("square: entry 2") && node.contains("node 17"),
            "{node}"
        );
        let element = message(&|p| p.element_sets[1].1[0] = 3);
        assert!(
            element.contains("element 3 in the set plate") && element.contains("3 elements"),
            "{element}"
        );
        let odd = message(&|p| p.blocks[1].1.truncate(5));
        assert!(odd.contains("5 node numbers"), "{odd}");
        let lost = message(&|p| p.points[1][0] = f64::NAN);
        assert!(lost.contains("NaN"), "{lost}");
        let three = square().mesh::<3>().unwrap_err().to_string();
        assert!(three.contains("3"), "{three}");
    }
}
