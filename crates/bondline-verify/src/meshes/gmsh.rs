//! Meshes as Gmsh 2.2 text: those that a scene's own generators do not make.

use std::fmt::Write as _;

use bondline::mesh::{CellShape, Mesh, read};
use bondline::tensor::{Vector, padded};

/// Kinds of elements in a file.
pub const LINE: usize = 1;
/// Three nodes in a plane.
pub const TRIANGLE: usize = 2;
/// Four nodes in a plane.
pub const QUADRILATERAL: usize = 3;
/// Four nodes in space.
pub const TETRAHEDRON: usize = 4;
/// Eight nodes.
pub const HEXAHEDRON: usize = 5;

/// Gmsh's kind of a shape, and its nodes in Gmsh's order, which differs from ours for solids of second order.
fn element(shape: CellShape, nodes: &[u32]) -> (usize, Vec<usize>) {
    const TET: [usize; 10] = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8];
    const HEX: [usize; 20] = [
        0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 16, 9, 17, 10, 18, 19, 12, 15, 13, 14,
    ];
    let kind = shape.gmsh_type() as usize;
    let order: Vec<usize> = match shape {
        CellShape::Tet10 => TET.to_vec(),
        CellShape::Hex20 => HEX.to_vec(),
        _ => (0..nodes.len()).collect(),
    };
    (kind, order.iter().map(|&a| nodes[a] as usize).collect())
}

/// A mesh with its sets of cells (each cell in one of them at most) and of facets; `all` is no set of its own.
pub fn with_sets<const D: usize>(mesh: &Mesh<D>) -> String {
    let mut sets: Vec<(usize, usize, &str)> = Vec::new();
    let mut set_of = vec![0; mesh.cell_count()];
    for (name, cells) in mesh.cell_sets.iter().filter(|(name, _)| *name != "all") {
        sets.push((D, sets.len() + 1, name));
        cells.iter().for_each(|&c| set_of[c as usize] = sets.len());
    }
    let mut elements: Vec<Element> = Vec::new();
    for (name, facets) in &mesh.facet_sets {
        sets.push((D - 1, sets.len() + 1, name));
        for facet in facets {
            let shape = match (D, facet.len()) {
                (1, _) => CellShape::Vertex,
                (2, 2) => CellShape::Line2,
                (2, _) => CellShape::Line3,
                (_, 3) => CellShape::Tri3,
                (_, 4) => CellShape::Quad4,
                (_, 6) => CellShape::Tri6,
                _ => CellShape::Quad8,
            };
            let (kind, nodes) = element(shape, facet);
            elements.push((kind, sets.len(), nodes));
        }
    }
    for (c, set) in set_of.into_iter().enumerate() {
        let (kind, nodes) = element(mesh.shapes[c], mesh.cell(c));
        elements.push((kind, set, nodes));
    }
    let nodes: Vec<_> = mesh.nodes.iter().map(padded).collect();
    text(&sets, &nodes, &elements)
}

/// A file with its cells raised to second order, each new node in the middle of its edge, then moved by `place`.
///
/// # Errors
/// The message of the reader.
pub fn raised<const D: usize>(
    mesh: &str,
    place: impl Fn(&mut Vector<D>),
) -> Result<String, String> {
    let folder = super::scene::Folder::with(&[("mesh.msh", mesh)])?;
    let mut mesh: Mesh<D> =
        read::read(&folder.path().join("mesh.msh")).map_err(|e| e.to_string())?;
    mesh.raise_order();
    mesh.nodes.iter_mut().for_each(place);
    Ok(with_sets(&mesh))
}

/// An element: its kind, the number of its set (0 for none), and its nodes from 0.
pub type Element = (usize, usize, Vec<usize>);

/// The text of a file: dimension, number (from 1) and name of each set, nodes \[m\], elements. Numbers keep all their digits.
pub fn text(sets: &[(usize, usize, &str)], nodes: &[[f64; 3]], elements: &[Element]) -> String {
    // writing to a string cannot fail
    let mut text = String::from("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n");
    let _ = writeln!(text, "$PhysicalNames\n{}", sets.len());
    for (dimension, number, name) in sets {
        let _ = writeln!(text, "{dimension} {number} \"{name}\"");
    }
    let _ = writeln!(text, "$EndPhysicalNames\n$Nodes\n{}", nodes.len());
    for (n, [x, y, z]) in nodes.iter().enumerate() {
        let _ = writeln!(text, "{} {x:?} {y:?} {z:?}", n + 1);
    }
    let _ = writeln!(text, "$EndNodes\n$Elements\n{}", elements.len());
    for (e, (kind, set, nodes)) in elements.iter().enumerate() {
        let _ = write!(text, "{} {kind} 2 {set} {set}", e + 1);
        for n in nodes {
            let _ = write!(text, " {}", n + 1);
        }
        text.push('\n');
    }
    text.push_str("$EndElements\n");
    text
}

/// A mesh whose cells are drawn as sets, each cell in one of them or in none; `set_of` gives the place of a cell's set among `names`.
pub fn of_mesh<const D: usize>(
    mesh: &Mesh<D>,
    names: &[&str],
    set_of: impl Fn(usize) -> Option<usize>,
) -> String {
    let sets: Vec<_> = names.iter().zip(1..).map(|(n, k)| (D, k, *n)).collect();
    let nodes: Vec<_> = mesh.nodes.iter().map(padded).collect();
    let element = |c: usize| {
        let (kind, nodes) = element(mesh.shapes[c], mesh.cell(c));
        (kind, set_of(c).map_or(0, |s| s + 1), nodes)
    };
    let elements: Vec<Element> = (0..mesh.cell_count()).map(element).collect();
    text(&sets, &nodes, &elements)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bondline::mesh::generate::{Axis, Grid};

    fn axis(cells: usize) -> Axis {
        Axis::Uniform {
            min: -0.1,
            max: 0.3,
            cells,
        }
    }

    #[test]
    fn a_mesh_comes_back_as_it_was_written() {
        fn check<const D: usize>(simplices: bool) {
            // of second order with all of its sets
            let mut raised = Grid::<D>::new(std::array::from_fn(|_| axis(3)));
            if simplices {
                raised.simplices();
            }
            let mut raised = raised.mesh().unwrap();
            raised.raise_order();
            let written = with_sets(&raised);
            let folder = crate::meshes::scene::Folder::with(&[("mesh.msh", &written)]).unwrap();
            let found: Mesh<D> = read::read(&folder.path().join("mesh.msh")).unwrap();
            assert_eq!(found, raised);

            let mut grid = Grid::<D>::new(std::array::from_fn(|_| axis(3)));
            if simplices {
                grid.simplices();
            }
            let mesh = grid.jitter(0.2, 7).mesh().unwrap();
            let written = of_mesh(&mesh, &["a", "b"], |c| [Some(0), None, Some(1)][c % 3]);
            let folder = crate::meshes::scene::Folder::with(&[("mesh.msh", &written)]).unwrap();
            let found: Mesh<D> = read::read(&folder.path().join("mesh.msh")).unwrap();
            assert_eq!(found.nodes, mesh.nodes);
            assert_eq!(found.shapes, mesh.shapes);
            assert_eq!(found.connectivity, mesh.connectivity);
            let third = |k| (0..mesh.cell_count() as u32).filter(move |c| c % 3 == k);
            assert!(found.cell_sets["a"].iter().copied().eq(third(0)));
            assert!(found.cell_sets["b"].iter().copied().eq(third(2)));
        }
        check::<1>(false);
        check::<2>(false);
        check::<2>(true);
        check::<3>(false);
        check::<3>(true);
    }
}
