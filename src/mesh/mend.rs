//! Meshes as programs write them, made into those that elements live on: nodes at one place are merged and cells left out on request, prisms and pyramids are split, cells that run clockwise are turned.

use std::collections::{HashMap, HashSet};

use super::facet::key;
use super::quality::SMALLEST_SCALED_JACOBIAN;
use super::raw::{OtherShape, RawMesh, RawShape, Source};
use super::{CellShape, Mesh, MeshError, Order, Place, facet_corners};
use crate::tensor::Vector;

/// Treatment of what a file holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// The order that cells of second order are to have.
    pub order: Order,
    /// Types of elements of a deck, by their names there, and sets of cells that are left out.
    pub ignore: Vec<String>,
    /// Distance within which nodes are one \[length\]; none if all stay.
    pub merge: Option<f64>,
}

/// A line on which grids do not pile up.
const SKEW: [f64; 3] = [1.0, 0.618_033_988_7, 0.324_717_957_2];

/// Gives cells the order, merges nodes, and splits cells, before a mesh is made.
///
/// # Errors
/// [`MeshError::Unsupported`] for cells of second order beside prisms and pyramids, [`MeshError::MissingNode`].
pub(super) fn prepare(
    raw: &mut RawMesh,
    source: &Source,
    options: &Options,
) -> Result<(), MeshError> {
    raw.set_order(options.order);
    if let Some(distance) = options.merge {
        merge(raw, distance);
    }
    match raw.others.is_empty() {
        true => Ok(()),
        false => split(raw, source),
    }
}

/// Replaces each node by the first one within a distance, and notes how many.
fn merge(raw: &mut RawMesh, distance: f64) {
    let along = |x: &[f64; 3]| -> f64 { x.iter().zip(SKEW).map(|(x, s)| x * s).sum() };
    let mut order: Vec<(f64, usize)> = (raw.nodes.iter().enumerate())
        .map(|(i, node)| (along(&node.x), i))
        .collect();
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let reach = distance * Vector::<3>::from(SKEW).norm();
    let mut first: Vec<usize> = (0..raw.nodes.len()).collect();
    for (k, &(s, i)) in order.iter().enumerate() {
        for &(_, j) in order[k + 1..].iter().take_while(|(t, _)| t - s <= reach) {
            let apart = Vector::<3>::from(raw.nodes[i].x) - Vector::<3>::from(raw.nodes[j].x);
            if apart.norm() <= distance {
                let (a, b) = (first[i].min(first[j]), i.max(j));
                first[b] = first[b].min(a);
            }
        }
    }
    // a chain of nodes, each within the distance of the next, is one: the first of each comes before it
    for i in 0..first.len() {
        first[i] = first[first[i]];
    }
    let tags: HashMap<u64, u64> = (first.iter().enumerate())
        .filter(|(i, of)| i != *of)
        .map(|(i, &of)| (raw.nodes[i].tag, raw.nodes[of].tag))
        .collect();
    if tags.is_empty() {
        return;
    }
    for tag in &mut raw.element_nodes {
        *tag = *tags.get(tag).unwrap_or(tag);
    }
    for other in &mut raw.others {
        let nodes = other.nodes.iter_mut();
        nodes.for_each(|tag| *tag = *tags.get(tag).unwrap_or(tag));
    }
    raw.notes.push(format!(
        "{} of {} nodes were merged with others within {distance:e} (mesh.file.merge)",
        tags.len(),
        raw.nodes.len()
    ));
}

/// The faces of a solid by its local nodes, around.
fn faces(solid: Solid) -> &'static [&'static [usize]] {
    match solid {
        Solid::Hexahedron => CellShape::Hex8.facets(),
        Solid::Other(OtherShape::Prism) => &[
            &[0, 1, 2],
            &[3, 4, 5],
            &[0, 1, 4, 3],
            &[1, 2, 5, 4],
            &[2, 0, 3, 5],
        ],
        Solid::Other(OtherShape::Pyramid) => &[
            &[0, 1, 2, 3],
            &[0, 1, 4],
            &[1, 2, 4],
            &[2, 3, 4],
            &[3, 0, 4],
        ],
    }
}

/// A cell that is split.
#[derive(Clone, Copy)]
enum Solid {
    Hexahedron,
    Other(OtherShape),
}

/// The triangles of a face: those of its smallest node, so that both of its cells have the same ones.
fn triangles(face: &[u64]) -> Vec<[u64; 3]> {
    let smallest = (0..face.len()).min_by_key(|&k| face[k]).unwrap_or(0);
    let at = |k: usize| face[(smallest + k) % face.len()];
    (1..face.len() - 1)
        .map(|k| [at(0), at(k), at(k + 1)])
        .collect()
}

/// The tetrahedra of a convex solid: from its smallest node to the triangles of all faces without it.
fn tetrahedra(solid: Solid, nodes: &[u64]) -> Vec<[u64; 4]> {
    let Some(&apex) = nodes.iter().min() else {
        return Vec::new();
    };
    let faces = faces(solid).iter();
    let faces = faces.map(|face| face.iter().map(|&i| nodes[i]).collect::<Vec<u64>>());
    faces
        .filter(|face| !face.contains(&apex))
        .flat_map(|face| triangles(&face))
        .map(|[a, b, c]| [a, b, c, apex])
        .collect()
}

/// Splits prisms and pyramids, and the hexahedra and quadrilaterals beside them, so that cells still meet face to face.
///
/// # Errors
/// [`MeshError::Unsupported`] for cells of second order, [`MeshError::MissingNode`].
fn split(raw: &mut RawMesh, source: &Source) -> Result<(), MeshError> {
    if let Some(element) = raw.elements.iter().find(|e| e.shape.is_quadratic()) {
        return Err(MeshError::Unsupported {
            path: source.file(element.at),
            place: source.place(element.at),
            what: format!(
                "element {} of second order beside prisms or pyramids",
                element.tag
            ),
            remedy: "set mesh.file.order = \"linear\", or mesh without prisms and pyramids",
        });
    }
    let places: HashMap<u64, Vector<3>> = (raw.nodes.iter())
        .map(|node| (node.tag, Vector::from(node.x)))
        .collect();
    let before = std::mem::take(&mut raw.elements);
    let nodes_before = std::mem::take(&mut raw.element_nodes);
    let others = std::mem::take(&mut raw.others);
    let count = others.len();
    let mut solids = Vec::new();
    for element in &before {
        let of = (element.tag, element.group, element.at);
        let nodes = &nodes_before[element.start..][..element.shape.node_count()];
        match element.shape {
            CellShape::Hex8 => solids.push((of, Solid::Hexahedron, nodes)),
            CellShape::Quad4 => {
                for nodes in triangles(nodes) {
                    raw.push(of, RawShape::Cell(CellShape::Tri3), &nodes);
                }
            }
            shape => raw.push(of, RawShape::Cell(shape), nodes),
        }
    }
    let hexahedra = solids.len();
    for other in &others {
        let of = (other.tag, other.group, other.at);
        solids.push((of, Solid::Other(other.shape), &other.nodes));
    }
    let mut found = 0;
    for (of, solid, nodes) in solids {
        if let Some(&node) = nodes.iter().find(|n| !places.contains_key(n)) {
            return Err(MeshError::MissingNode {
                path: source.file(of.2),
                place: source.place(of.2),
                element: of.0,
                node,
            });
        }
        for mut nodes in tetrahedra(solid, nodes) {
            let [a, b, c, d] = nodes.map(|n| places[&n]);
            if (b - a).cross(&(c - a)).dot(&(d - a)) < 0.0 {
                nodes.swap(1, 2);
            }
            raw.push(of, RawShape::Cell(CellShape::Tet4), &nodes);
            found += 1;
        }
    }
    raw.notes.push(format!(
        "{}: {count} prisms and pyramids and {hexahedra} hexahedra are read as {found} tetrahedra, so that all cells meet face to face",
        source.path.display()
    ));
    Ok(())
}

/// Turns cells whose nodes run the wrong way round, and notes how many; `tag` is the number that the file gives to a cell.
pub(super) fn turn<const D: usize>(mesh: &mut Mesh<D>, tag: impl Fn(usize) -> String) {
    let mut turned = Vec::new();
    for c in 0..mesh.cell_count() {
        if mesh.cell_volume(c) >= 0.0 {
            continue;
        }
        let cell = mesh.cell(c).to_vec();
        let reversed = mesh.shapes[c].reversed();
        let start = mesh.offsets[c] as usize;
        for (k, &from) in reversed.iter().enumerate() {
            mesh.connectivity[start + k] = cell[from];
        }
        // a cell that is folded stays as it is
        if mesh.scaled_jacobian(c) > SMALLEST_SCALED_JACOBIAN {
            turned.push(c);
        } else {
            mesh.connectivity[start..start + cell.len()].copy_from_slice(&cell);
        }
    }
    if let Some(&first) = turned.first() {
        mesh.notes.push(format!(
            "the nodes of {} of {} cells run the wrong way round (the first: element {} of the file): they are turned",
            turned.len(),
            mesh.cell_count(),
            tag(first)
        ));
    }
}

/// Leaves out the cells of some sets; returns the numbers of those that stay.
///
/// # Errors
/// [`MeshError::Unsupported`] for a name of no set of cells, and where no cell stays.
pub(super) fn leave_out<const D: usize>(
    mesh: &mut Mesh<D>,
    sets: &[&String],
    source: &Source,
) -> Result<Vec<u32>, MeshError> {
    let mut stays = vec![true; mesh.cell_count()];
    let wrong = |what: String| MeshError::Unsupported {
        path: source.path.clone(),
        place: Place::File,
        what,
        remedy: "name types of elements as the deck does, or sets of cells",
    };
    for name in sets {
        let Some(set) = mesh.cell_sets.get(*name) else {
            let known: Vec<&str> = mesh.cell_sets.keys().map(String::as_str).collect();
            return Err(wrong(format!(
                "`{name}` in mesh.file.ignore, neither a type of its elements nor one of its sets of cells ({}),",
                known.join(", ")
            )));
        };
        set.iter().for_each(|&c| stays[c as usize] = false);
    }
    let kept: Vec<u32> = (0..stays.len() as u32)
        .filter(|&c| stays[c as usize])
        .collect();
    if kept.len() == stays.len() {
        return Ok(kept);
    }
    if kept.is_empty() {
        return Err(wrong(
            "a mesh of which mesh.file.ignore leaves no cell".to_owned(),
        ));
    }
    let mut number = vec![u32::MAX; stays.len()];
    let mut fewer = Mesh::<D> {
        nodes: std::mem::take(&mut mesh.nodes),
        node_sets: std::mem::take(&mut mesh.node_sets),
        facet_sets: std::mem::take(&mut mesh.facet_sets),
        notes: std::mem::take(&mut mesh.notes),
        ..Mesh::default()
    };
    let mut facets = HashSet::new();
    for (new, &c) in kept.iter().enumerate() {
        number[c as usize] = new as u32;
        fewer.push_cell(mesh.shapes[c as usize], mesh.cell(c as usize));
        facets.extend(mesh.keys_of_cell(c).map(|(_, key)| key));
    }
    for (name, set) in &mesh.cell_sets {
        let own = set.iter().map(|&c| number[c as usize]);
        let own: Vec<u32> = own.filter(|&c| c != u32::MAX).collect();
        if !own.is_empty() {
            fewer.cell_sets.insert(name.clone(), own);
        }
    }
    for (name, set) in &mut fewer.facet_sets {
        let all = set.len();
        set.retain(|facet| facets.contains(&key(facet_corners::<D>(facet).iter().copied())));
        if set.len() < all {
            fewer.notes.push(format!(
                "the set {name} loses {} of its {all} facets to mesh.file.ignore",
                all - set.len()
            ));
        }
    }
    fewer.drop_unused_nodes();
    *mesh = fewer;
    Ok(kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::quality;

    /// Of each solid the tetrahedra fill it, whatever the numbers of its nodes.
    #[test]
    fn solids_are_filled_by_their_tetrahedra() {
        let cube = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 1.0],
            [1.0, 1.0, 1.0],
            [0.0, 1.0, 1.0],
        ];
        let prism = [cube[0], cube[1], cube[3], cube[4], cube[5], cube[7]];
        let pyramid = [cube[0], cube[1], cube[2], cube[3], cube[6]];
        for (solid, places, volume) in [
            (Solid::Hexahedron, &cube[..], 1.0),
            (Solid::Other(OtherShape::Prism), &prism, 0.5),
            (Solid::Other(OtherShape::Pyramid), &pyramid, 1.0 / 3.0),
        ] {
            for shift in 0..places.len() as u64 {
                let count = places.len() as u64;
                let nodes: Vec<u64> = (0..count).map(|k| (k * 5 + shift) % count).collect();
                let is_one = nodes
                    .iter()
                    .collect::<std::collections::BTreeSet<_>>()
                    .len();
                assert!(is_one == nodes.len() || count == 5, "{nodes:?}");
                let nodes = if count == 5 {
                    (0..5).map(|k| (k + shift) % 5).collect()
                } else {
                    nodes
                };
                let place = |n: u64| {
                    let k = nodes.iter().position(|&m| m == n).unwrap();
                    Vector::<3>::from(places[k])
                };
                let sum: f64 = (tetrahedra(solid, &nodes).iter())
                    .map(|t| {
                        let [a, b, c, d] = t.map(place);
                        (b - a).cross(&(c - a)).dot(&(d - a)).abs() / 6.0
                    })
                    .sum();
                assert!((sum - volume).abs() < 1e-15, "{nodes:?} {sum}");
            }
        }
    }

    #[test]
    fn cells_of_every_shape_are_turned() {
        for shape in CellShape::all().filter(|shape| shape.dimension() == 2) {
            let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
            let count = shape.linear().node_count();
            let mut nodes: Vec<Vector<2>> = corners[..count].iter().map(|x| (*x).into()).collect();
            for &[a, b] in shape.mid_sides() {
                nodes.push((nodes[a] + nodes[b]) * 0.5);
            }
            let mut mesh = Mesh {
                nodes: nodes.clone(),
                ..Mesh::default()
            };
            let own: Vec<u32> = (0..nodes.len() as u32).collect();
            let wrong: Vec<u32> = shape.reversed().iter().map(|&k| own[k]).collect();
            mesh.push_cell(shape, &wrong);
            turn(&mut mesh, |_| "17".to_owned());
            assert!(quality::check(&mesh).is_ok(), "{shape:?}");
            assert!(mesh.notes[0].contains("element 17"), "{:?}", mesh.notes);
            // each node in the middle of an edge still lies between its ends
            for tie in mesh.mid_sides(0) {
                let [a, b] = tie.ends.map(|n| mesh.nodes[n as usize]);
                assert_eq!(mesh.nodes[tie.node as usize], (a + b) * 0.5);
            }
        }
    }
}
