//! A mesh of tetrahedra as a deck of CalculiX, with its surface as faces of elements.

use std::fmt::Write as _;

use bondline::mesh::{Mesh, read};

/// Faces of `C3D4`, by the places of their corners among the nodes of the element.
const FACES: [[usize; 3]; 4] = [[0, 1, 2], [0, 1, 3], [1, 2, 3], [0, 2, 3]];

/// The deck of a Gmsh file of tetrahedra whose boundary is the set `outer`.
///
/// # Errors
/// The message of the reader.
pub fn of_tetrahedra(mesh: &str) -> Result<String, String> {
    let folder = super::scene::Folder::with(&[("mesh.msh", mesh)])?;
    let mesh: Mesh<3> = read::read(&folder.path().join("mesh.msh")).map_err(|e| e.to_string())?;
    let mut deck = String::from("*NODE\n");
    for (n, x) in mesh.nodes.iter().enumerate() {
        let _ = writeln!(deck, "{}, {:?}, {:?}, {:?}", n + 1, x[0], x[1], x[2]);
    }
    deck += "*ELEMENT, TYPE=C3D4, ELSET=body\n";
    for c in 0..mesh.cell_count() {
        let nodes: Vec<String> = mesh.cell(c).iter().map(|n| (n + 1).to_string()).collect();
        let _ = writeln!(deck, "{}, {}", c + 1, nodes.join(", "));
    }
    let sorted = |mut list: Vec<u32>| {
        list.sort_unstable();
        list
    };
    let outer = mesh.facet_sets.iter().find(|(name, _)| *name == "outer");
    let outer: Vec<Vec<u32>> = outer
        .map(|(_, facets)| facets.iter().map(|f| sorted(f.to_vec())).collect())
        .unwrap_or_default();
    deck += "*SURFACE, NAME=outer\n";
    for c in 0..mesh.cell_count() {
        for (f, face) in FACES.iter().enumerate() {
            let nodes = sorted(face.iter().map(|&a| mesh.cell(c)[a]).collect());
            if outer.contains(&nodes) {
                let _ = writeln!(deck, "{}, S{}", c + 1, f + 1);
            }
        }
    }
    Ok(deck)
}
