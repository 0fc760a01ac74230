//! Decks of Gmsh, meshio and CalculiX against the same models from elsewhere, and decks by hand.
//!
//! With the folder of `.ci/write_decks.py` in `BONDLINE_DECKS`, all decks in it are compared.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::mesh::read::{detect_dimension, read};
use crate::mesh::{Mesh, MeshError, quality};

fn fixture(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    root.join("tests/fixtures").join(name)
}

/// For each node of `a` the node of `b` at its place, to 1e-13 of the size.
fn matching<const D: usize>(a: &Mesh<D>, b: &Mesh<D>, what: &Path) -> Vec<u32> {
    assert_eq!(a.nodes.len(), b.nodes.len(), "{}", what.display());
    let (lo, hi) = a.bounds();
    let size = (hi - lo).amax();
    let found: Vec<u32> = a
        .nodes
        .iter()
        .map(|x| {
            let far = |n: &usize| (b.nodes[*n] - x).amax();
            let near = (0..b.nodes.len()).min_by(|m, n| far(m).total_cmp(&far(n)));
            let near = near.unwrap();
            assert!(far(&near) <= 1e-13 * size, "{}: {x}", what.display());
            near as u32
        })
        .collect();
    assert_eq!(found.iter().collect::<BTreeSet<_>>().len(), found.len());
    found
}

/// The cells, facets or nodes of a set by the nodes of each.
type Named = BTreeMap<String, BTreeSet<Vec<u32>>>;

fn sorted(nodes: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut nodes: Vec<u32> = nodes.collect();
    nodes.sort_unstable();
    nodes
}

/// Sets of cells, of facets and of nodes, with nodes renumbered.
fn sets<const D: usize>(mesh: &Mesh<D>, new: &[u32]) -> [Named; 3] {
    let renamed = |nodes: &[u32]| sorted(nodes.iter().map(|&n| new[n as usize]));
    let cells = mesh.cell_sets.iter();
    let facets = mesh.facet_sets.iter();
    let nodes = mesh.node_sets.iter();
    [
        cells
            .map(|(k, v)| {
                (
                    k.clone(),
                    v.iter().map(|&c| renamed(mesh.cell(c as usize))).collect(),
                )
            })
            .collect(),
        facets
            .map(|(k, v)| (k.clone(), v.iter().map(|f| renamed(f)).collect()))
            .collect(),
        nodes
            .map(|(k, v)| (k.clone(), v.iter().map(|&n| renamed(&[n])).collect()))
            .collect(),
    ]
}

/// The deck holds nodes, cells and named groups of the mesh of Gmsh.
fn same_model<const D: usize>(gmsh: &Path, deck: &Path, with_points: bool) {
    let (a, b) = (read::<D>(gmsh).unwrap(), read::<D>(deck).unwrap());
    // meshio calls every quadrilateral CAX4P
    let told = b.notes.iter().all(|note| note.contains("axisymmetric"));
    assert!(
        told && (b.notes.is_empty() || !with_points),
        "{:?}",
        b.notes
    );
    let new = matching(&b, &a, deck);
    let same: Vec<u32> = (0..a.nodes.len() as u32).collect();
    let [from, to] = [sets(&a, &same), sets(&b, &new)];
    assert_eq!(a.cell_count(), b.cell_count());
    let kinds = if with_points { 3 } else { 2 };
    let mut compared = 0;
    for (from, to) in from.iter().zip(&to).take(kinds) {
        let named = from
            .iter()
            .filter(|(name, _)| !name.starts_with("physical_"));
        for (name, members) in named {
            // Gmsh writes no blanks into names
            let name = &if with_points {
                name.replace(' ', "_")
            } else {
                name.clone()
            };
            assert_eq!(Some(members), to.get(name), "{}: {name}", deck.display());
            compared += 1;
        }
    }
    assert!(compared > 1, "{}", deck.display());
    let volume = |mesh: &Mesh<D>| quality::check(mesh).unwrap().volume;
    assert!((volume(&a) - volume(&b)).abs() <= 1e-13 * volume(&a));
}

#[test]
fn decks_of_gmsh_and_meshio_hold_the_mesh_of_gmsh() {
    for (writer, with_points) in [("gmsh", true), ("meshio", false)] {
        let deck = |name: &str| fixture(&format!("{name}_{writer}.inp"));
        same_model::<2>(&fixture("plate_41_ascii.msh"), &deck("plate"), with_points);
        same_model::<3>(&fixture("block_41_ascii.msh"), &deck("block"), with_points);
    }
    // meshio writes 17 digits
    let [a, b] =
        ["block_41_ascii.msh", "block_meshio.inp"].map(|f| read::<3>(&fixture(f)).unwrap());
    for x in &b.nodes {
        assert!(a.nodes.contains(x), "to the bit: {x}");
    }
}

/// All decks of a folder, against what Gmsh and meshio say of them.
#[test]
fn decks_of_other_programs() {
    let Some(folder) = std::env::var_os("BONDLINE_DECKS") else {
        return;
    };
    let mut counts = [0; 2];
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    for path in files {
        let extension = path.extension().and_then(|e| e.to_str());
        let stem = path.file_stem().unwrap().to_str().unwrap();
        if extension == Some("msh") {
            for (writer, with_points) in [("gmsh", true), ("meshio", false)] {
                let deck = path.with_file_name(format!("{stem}_{writer}.inp"));
                match detect_dimension(&path).unwrap() {
                    2 => same_model::<2>(&path, &deck, with_points),
                    _ => same_model::<3>(&path, &deck, with_points),
                }
            }
            counts[0] += 1;
        } else if extension == Some("json") {
            let model = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
            let deck = path.with_extension("inp");
            match detect_dimension(&deck) {
                Ok(1) => as_meshio::<1>(&deck, &model),
                Ok(2) => as_meshio::<2>(&deck, &model),
                Ok(_) => as_meshio::<3>(&deck, &model),
                // beams and shells beside solids
                Err(e) => assert!(e.to_string().contains("the stiffness of"), "{e}"),
            }
            counts[1] += 1;
        }
    }
    println!("{} meshes and {} decks agree", counts[0], counts[1]);
    assert!(counts[0] > 0 && counts[1] >= 10, "too few: {counts:?}");
}

/// Names of meshio for the shapes of elements, with their dimension.
const KINDS: [(&str, usize); 11] = [
    ("vertex", 0),
    ("line", 1),
    ("triangle", 2),
    ("quad", 2),
    ("tetra", 3),
    ("hexahedron", 3),
    ("line3", 1),
    ("triangle6", 2),
    ("quad8", 2),
    ("tetra10", 3),
    ("hexahedron20", 3),
];

/// Nodes in order, cells in order, sets by their members.
fn as_meshio<const D: usize>(deck: &Path, model: &Value) {
    let mesh = match read::<D>(deck) {
        Ok(mesh) => mesh,
        // a shell in space
        Err(MeshError::OutOfPlane { .. }) => return,
        Err(e) => panic!("{e}"),
    };
    let numbers = |v: &Value| -> Vec<u32> {
        let all = v.as_array().unwrap().iter();
        all.map(|n| n.as_u64().unwrap() as u32).collect()
    };
    let mut cells: Vec<(usize, Vec<u32>)> = Vec::new();
    for block in model["cells"].as_array().unwrap() {
        let kind = KINDS.iter().find(|(name, _)| block[0] == *name).unwrap();
        for cell in block[1].as_array().unwrap() {
            cells.push((kind.1, numbers(cell)));
        }
    }
    let body: Vec<&Vec<u32>> = cells.iter().filter(|c| c.0 == D).map(|c| &c.1).collect();
    let used: BTreeSet<u32> = body.iter().copied().flatten().copied().collect();
    let new: BTreeMap<u32, u32> = used.iter().zip(0..).map(|(&n, i)| (n, i)).collect();
    assert_eq!(mesh.nodes.len(), used.len(), "{}", deck.display());
    for (n, x) in used.iter().zip(&mesh.nodes) {
        for k in 0..D {
            let wanted = model["points"][*n as usize][k].as_f64().unwrap_or(0.0);
            // meshio's parser of numbers is off by a bit of the last now and then
            let close = (x[k] - wanted).abs() <= f64::EPSILON * wanted.abs();
            assert!(close, "{}: node {n}", deck.display());
        }
    }
    assert_eq!(mesh.cell_count(), body.len());
    let mut notes = mesh.notes.iter();
    let is_turned = notes.any(|note| note.contains("the wrong way round"));
    for (c, nodes) in body.iter().enumerate() {
        let (mut own, mut nodes) = (mesh.cell(c).to_vec(), nodes.to_vec());
        nodes.iter_mut().for_each(|n| *n = new[n]);
        if is_turned {
            own.sort_unstable();
            nodes.sort_unstable();
        }
        assert_eq!(own, nodes, "{}: cell {c}", deck.display());
    }
    let find = |names: Vec<&String>, name: &str| -> Option<String> {
        let mut names = names.into_iter();
        names.find(|n| n.eq_ignore_ascii_case(name)).cloned()
    };
    let same: Vec<u32> = (0..mesh.nodes.len() as u32).collect();
    let [of_cells, of_facets, _] = sets(&mesh, &same);
    for (name, members) in model["cell_sets"].as_object().unwrap() {
        let mut wanted: [BTreeSet<Vec<u32>>; 2] = Default::default();
        for c in numbers(members) {
            let (dimension, nodes) = &cells[c as usize];
            if *dimension + 1 >= D && nodes.iter().all(|n| new.contains_key(n)) {
                wanted[D - dimension].insert(sorted(nodes.iter().map(|n| new[n])));
            }
        }
        for (wanted, found) in wanted.into_iter().zip([&of_cells, &of_facets]) {
            let known = find(found.keys().collect(), name).and_then(|k| found.get(&k).cloned());
            assert_eq!(
                known.unwrap_or_default(),
                wanted,
                "{}: {name}",
                deck.display()
            );
        }
    }
    for (name, members) in model["point_sets"].as_object().unwrap() {
        let members = numbers(members).into_iter();
        let wanted: BTreeSet<u32> = members.filter_map(|n| new.get(&n).copied()).collect();
        let known = find(mesh.node_sets.keys().collect(), name);
        let found = known.map(|k| mesh.node_sets[&k].iter().copied().collect());
        assert_eq!(
            found.unwrap_or_else(BTreeSet::new),
            wanted,
            "{}: {name}",
            deck.display()
        );
    }
}

/// A deck in a folder of its own, with other files beside it.
fn deck(text: &str, others: &[(&str, &str)]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in others {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let path = folder.path().join("deck.inp");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn plane(text: &str) -> Mesh<2> {
    let (_folder, path) = deck(text, &[]);
    read::<2>(&path).unwrap_or_else(|e| panic!("{e}"))
}

fn refused(text: &str, others: &[(&str, &str)]) -> String {
    let (_folder, path) = deck(text, others);
    match detect_dimension(&path).and_then(|d| match d {
        1 => read::<1>(&path).map(|_| ()),
        2 => read::<2>(&path).map(|_| ()),
        _ => read::<3>(&path).map(|_| ()),
    }) {
        Ok(()) => panic!("{text} is taken"),
        Err(error) => error.to_string(),
    }
}

/// Two unit squares side by side, numbers with gaps.
const SQUARES: &str = "*Heading\n anything, goes\n** caf\u{e9}\n*NODE, NSET=Nall\n1, 0., 0.\n2, 1.D0, 0\n3, 2, 0\n11, 0, 1\n12, 1, 1, 0\n13, 2.0e+00, 1,\n99, 7, 7\n\
    *Element, type=CPS4R, elset=Plate\n10, 1, 2, 12,\n 11\n20, 2, 3, 13, 12,\n";

#[test]
fn sets_of_numbers_ranges_and_sets() {
    let text = format!(
        "{SQUARES}*nset, NSET=bottom, GENERATE\n1, 3\n*NSET, nset=odd, generate\n1, 13, 2\n*NSET,NSET=both\nBOTTOM, 11\n\
         *NSET,\n NSET=both\n13\n*ELSET, ELSET=right\n20\n*ELSET, ELSET=All of it\nright, 10\n*NSET, NSET=corners, ELSET=RIGHT\n\
         *ELSET, ELSET=\"Right\"\n10\n*ELSET, ELSET=again\n\"Right\"\n"
    );
    let mesh = plane(&text);
    assert_eq!(
        (mesh.nodes.len(), mesh.cell_count()),
        (6, 2),
        "node 99 is dropped"
    );
    assert_eq!(mesh.node_sets["bottom"], [0, 1, 2]);
    assert_eq!(mesh.node_sets["both"], [0, 1, 2, 3, 5]);
    assert_eq!(mesh.node_sets["Nall"], [0, 1, 2, 3, 4, 5]);
    assert_eq!(mesh.node_sets["corners"], [1, 2, 4, 5]);
    assert_eq!(mesh.cell_sets["right"], [1]);
    assert_eq!(mesh.cell_sets["All of it"], [0, 1]);
    assert_eq!(mesh.cell_sets["again"], mesh.cell_sets["Right"]);
    assert_eq!(mesh.cell_sets["again"], [0]);
    assert_eq!(mesh.cell_sets["Plate"], mesh.cell_sets["all"]);
    assert_eq!(mesh.node_sets["odd"], [0, 2, 3, 5]);
    assert_eq!(mesh.notes.len(), 1, "{:?}", mesh.notes);
    assert!(
        mesh.notes[0].contains("3 numbers of a range of the set odd"),
        "{:?}",
        mesh.notes
    );
    let of_meshio = plane(&format!(
        "{SQUARES}*ELSET, ELSET=gmsh:bounding_entities\n2,-1\n*ELSET, ELSET=one\n10\n"
    ));
    assert_eq!(of_meshio.cell_sets["one"], [0]);
    assert!(!of_meshio.cell_sets.contains_key("gmsh:bounding_entities"));
    assert!(of_meshio.notes[0].contains("gmsh:bounding_entities"));
    // a range as wide as the numbers go takes no time
    let wide = plane(&format!("{SQUARES}*NSET, NSET=w, GENERATE\n1, 999999999\n"));
    assert_eq!(wide.node_sets["w"].len(), 6);
}

/// The middle of an edge is its second node in decks of Abaqus and Gmsh, and the third in those of meshio.
#[test]
fn edges_of_second_order_have_their_middle_second_or_last() {
    for edge in ["2, 6, 3", "2, 3, 6", "3, 6, 2"] {
        let mesh = plane(&format!(
            "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n5,0.5,0\n6,1.01,0.4\n7,0.5,1\n8,0,0.5\n*ELEMENT,TYPE=CPS8,ELSET=BODY\n10,1,2,3,4,5,6,7,8\n*ELEMENT,TYPE=T3D3,ELSET=R\n1,{edge}\n"
        ));
        let facet = &mesh.facet_sets["R"][0];
        assert_eq!(facet[2], 5, "{edge}: {facet:?}");
        mesh.locate_facets(&mesh.facet_sets["R"]).unwrap();
    }
}

#[test]
fn surfaces_of_faces_edges_and_nodes() {
    let mesh = plane(&format!(
        "{SQUARES}*SURFACE, NAME=outlet, TYPE=ELEMENT\n20, S2\n*Surface, name=Rim\nPlate, S1\n20, E3\n*SURFACE, TYPE=NODE, NAME=pins\n11,\nNall,\n"
    ));
    assert_eq!(mesh.facet_sets["outlet"], [[2, 5]]);
    assert_eq!(mesh.facet_sets["Rim"], [[0, 1], [1, 2], [5, 4]]);
    assert_eq!(mesh.node_sets["pins"].len(), 6);
    // every face of both solids lies at the side of the box that the manual's figure shows
    let corners = "1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,1\n6,1,0,1\n7,1,1,1\n8,0,1,1\n";
    let sides = [
        (1, 2, 0.0),
        (2, 2, 1.0),
        (3, 1, 0.0),
        (4, 0, 1.0),
        (5, 1, 1.0),
        (6, 0, 0.0),
    ];
    let surfaces = |n: usize| -> String {
        (1..=n)
            .map(|s| format!("*SURFACE, NAME=f{s}\n1, S{s}\n"))
            .collect()
    };
    let (_a, path) = deck(
        &format!(
            "*NODE\n{corners}*ELEMENT, TYPE=C3D8I\n1,1,2,3,4,5,6,7,8\n{}",
            surfaces(6)
        ),
        &[],
    );
    let mesh = read::<3>(&path).unwrap();
    for (s, axis, value) in sides {
        let facet = &mesh.facet_sets[&format!("f{s}")][0];
        assert!(
            facet.iter().all(|&n| mesh.nodes[n as usize][axis] == value),
            "S{s}"
        );
        assert_eq!(mesh.facet_area(facet), 1.0);
    }
    let (_b, path) = deck(
        &format!(
            "*NODE\n{corners}*ELEMENT, TYPE=C3D4\n1,1,2,4,5\n{}",
            surfaces(4)
        ),
        &[],
    );
    let mesh = read::<3>(&path).unwrap();
    for (s, wanted) in [
        (1, [0, 1, 2]),
        (2, [0, 1, 3]),
        (3, [1, 2, 3]),
        (4, [0, 2, 3]),
    ] {
        let facet = mesh.facet_sets[&format!("f{s}")][0].iter().copied();
        assert_eq!(sorted(facet), wanted, "S{s}");
    }
    mesh.locate_facets(&[mesh.facet_sets["f3"][0].clone()])
        .unwrap();
}

#[test]
fn instances_are_moved_and_their_sets_bear_their_names() {
    let part = "*PART, NAME=Square\n*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n*ELEMENT, TYPE=CPE4, ELSET=body\n1,1,2,3,4\n\
        *NSET, NSET=base\n1,2\n*SURFACE, NAME=top\nbody, S3\n*END PART\n";
    let mesh = plane(&format!(
        "{part}*ASSEMBLY, NAME=a\n*INSTANCE, NAME=part-1, PART=square\n*END INSTANCE\n\
         *Instance, name=part-2, part=Square\n2., 0., 0.\n2., 0., 0., 2., 0., 1., 90.\n*NSET, NSET=own\n3\n*End Instance\n\
         *NODE\n500, 9, 9\n*NSET, NSET=some, INSTANCE=PART-1\n4\n*NSET, NSET=some\npart-2.1, part-2.base\n\
         *ELSET, ELSET=everything, INSTANCE=part-1\nbody\n*ELSET, ELSET=everything, INSTANCE=part-2\n1\n\
         *SURFACE, NAME=tops\npart-1.body, S3\npart-2.body, S3\n*END ASSEMBLY\n"
    ));
    assert_eq!((mesh.nodes.len(), mesh.cell_count()), (8, 2));
    // (x, y) to (2 − y, x)
    for (n, x) in [[2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 0.0]]
        .iter()
        .enumerate()
    {
        assert_eq!(mesh.nodes[4 + n].as_slice(), x);
    }
    assert_eq!(mesh.node_sets["part-2.base"], [4, 5]);
    assert_eq!(mesh.node_sets["part-2.own"], [6]);
    assert_eq!(mesh.node_sets["some"], [3, 4, 5]);
    assert_eq!(mesh.cell_sets["part-1.body"], [0]);
    assert_eq!(mesh.cell_sets["everything"], [0, 1]);
    assert_eq!(mesh.facet_sets["part-2.top"], [[6, 7]]);
    assert_eq!(mesh.facet_sets["tops"], [[2, 3], [6, 7]]);
    let message = refused(part, &[]);
    assert!(
        message.contains("Square") && message.contains("*INSTANCE"),
        "{message}"
    );
    // a turn by 60 degrees about an axis aslant keeps lengths
    let text = "*PART,NAME=p\n*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4\n1,1,2,3,4\n*END PART\n*ASSEMBLY\n\
        *INSTANCE,NAME=i,PART=p\n1,2,3\n1,2,3,2,3,4,120\n*END INSTANCE\n*END ASSEMBLY\n";
    let (_folder, path) = deck(text, &[]);
    let mesh = read::<3>(&path).unwrap();
    // a third of a turn about (1, 1, 1) takes x to y, y to z and z to x
    let wanted = [
        [1.0, 2.0, 3.0],
        [1.0, 3.0, 3.0],
        [1.0, 2.0, 4.0],
        [2.0, 2.0, 3.0],
    ];
    for (x, wanted) in mesh.nodes.iter().zip(wanted) {
        assert!((0..3).all(|k| (x[k] - wanted[k]).abs() < 1e-15), "{x}");
    }
}

#[test]
fn included_files_and_errors_in_them() {
    let others = [
        ("nodes.txt", "1,0,0\n2,1,0\n3,1,1\n4,0,1"),
        (
            "cells.inc",
            "** cells\n*ELEMENT, TYPE=CPS4, ELSET=e\n1,1,2,3,4",
        ),
    ];
    let text = "*NODE, INPUT=nodes.txt\n*INCLUDE, INPUT=cells.inc\n*NSET, NSET=n\n1\n";
    let (_folder, path) = deck(text, &others);
    let mesh = read::<2>(&path).unwrap();
    assert_eq!((mesh.nodes.len(), mesh.cell_count()), (4, 1));
    assert_eq!(mesh.cell_sets["e"], [0]);
    let after = refused("*INCLUDE, INPUT=cells.inc\n*NODE\n1,0,0\n1,0,1\n", &others);
    assert!(
        after.contains("deck.inp: line 4: node 1 was already"),
        "{after}"
    );
    let within = refused(
        "*INCLUDE, INPUT=cells.inc\n*NODE\n1,0,0\n2,1,0\n3,1,1\n",
        &others,
    );
    assert!(
        within.contains("cells.inc: line 3: element 1 refers to node 4"),
        "{within}"
    );
    let circle = refused("*INCLUDE, INPUT=deck.inp\n", &[]);
    assert!(circle.contains("including itself"), "{circle}");
    let none = refused("*NODE\n*INCLUDE, INPUT=none.inc\n", &[]);
    assert!(none.contains("none.inc"), "{none}");
}

#[test]
fn what_is_left_out_is_told_once_with_its_lines() {
    let mesh = plane(&format!(
        "{SQUARES}*MATERIAL, NAME=steel\n*ELASTIC\n210000, .3\n*Solid Section, elset=Plate, material=steel\n*STEP\n*STATIC\n*NODE PRINT, NSET=Nall\nU\n*NODE FILE\nU\n*END STEP\n*STEP\n*END STEP\n*SURFACE, TYPE=SEGMENTS, NAME=s\nSTART, 1\n"
    ));
    assert_eq!(mesh.notes.len(), 1);
    let note = &mesh.notes[0];
    for part in [
        "*MATERIAL (line 16)",
        "*ELASTIC (line 17)",
        "*SOLIDSECTION (line 19)",
        "*STEP (line 20, line 27)",
        "*NODEPRINT",
        "*SURFACE, TYPE=SEGMENTS",
    ] {
        assert!(note.contains(part), "{part}: {note}");
    }
    assert!(
        !note.contains("HEADING") && !note.contains("*NODE ("),
        "{note}"
    );
}

#[test]
fn refusals_name_file_line_and_number() {
    let after = |rest: &str| refused(&format!("{SQUARES}{rest}"), &[]);
    for (text, parts) in [
        ("*NGEN\n1, 3\n", &["line 16", "*NGEN"][..]),
        ("*SYSTEM\n1,1,1\n", &["*SYSTEM"]),
        ("*NODE, SYSTEM=C\n", &["cylindrical"]),
        (
            "*ELEMENT, TYPE=C3D15\n30,1,2,3,4,5,6,7,8,9,10\n",
            &["line 17", "element 30", "C3D15", "second-order prism"],
        ),
        (
            "*ELEMENT, TYPE=SPRINGA\n31,1,2\n",
            &["line 17", "element 31", "SPRINGA"],
        ),
        ("*ELEMENT, TYPE=C3D6\n31,1,2\n", &["C3D6 with 2 nodes", "6"]),
        ("*ELEMENT\n31,1,2\n", &["line 16", "TYPE"]),
        (
            "*ELEMENT, TYPE=CPS3\n31,1,2,13,12\n",
            &["line 17", "element 31 of type CPS3 with 4 nodes", "3"],
        ),
        (
            "*ELEMENT, TYPE=CPS3\n31,1,2\n",
            &["line 17", "with 2 nodes"],
        ),
        (
            "*ELEMENT, TYPE=CPS3\n20,1,2,13\n",
            &["line 17", "element 20 was already defined at line 15"],
        ),
        (
            "*ELEMENT, TYPE=CPS3\n21,1,2,77\n",
            &["line 17", "element 21 refers to node 77"],
        ),
        (
            "*ELEMENT, TYPE=CPS4\n21,1,2,12,11\n",
            &["line 17", "element 21 has the same nodes as element 10"],
        ),
        ("*NODE\n5, 1, nan\n", &["line 17", "nan"]),
        ("*NODE\n5, 1, one\n", &["line 17", "one"]),
        ("*NODE\n0, 1, 1\n", &["line 17", "from 1 to"]),
        (
            "*NODE\n13, 1, 1\n",
            &["line 17", "node 13 was already defined at line 10"],
        ),
        (
            "*NSET, NSET=n\n1, 55\n",
            &["line 17", "node 55 in the set n"],
        ),
        ("*NSET, NSET=n\nnone\n", &["line 17", "none"]),
        ("*NSET, NSET=n, GENERATE\n9, 3\n", &["line 17", "9, 3"]),
        ("*NSET, NSET=n, INSTANCE=i\n9\n", &["line 16", "instance"]),
        ("*NSET\n9\n", &["line 16", "NSET"]),
        (
            "*SURFACE, NAME=s\nPlate\n",
            &["line 17", "Plate", "S1 to S6"],
        ),
        ("*SURFACE, NAME=s\nPlate, S9\n", &["line 17", "S9"]),
        (
            "*SURFACE, NAME=s\nPlate, S5\n",
            &["line 17", "element 10", "surface s"],
        ),
        ("*SURFACE, NAME=s, COMBINE=UNION\na, b\n", &["COMBINE"]),
        ("*INSTANCE, NAME=i, PART=p\n", &["line 16", "part"]),
        ("*NODE\n5, 1, \u{e9}\n", &["line 17"]),
    ] {
        let message = after(text);
        assert!(message.contains("deck.inp"), "{message}");
        for part in parts {
            assert!(message.contains(part), "{text}: no {part} in {message}");
        }
        assert!(message.contains(';'), "a remedy: {message}");
    }
    assert!(refused("1, 2\n*NODE\n", &[]).contains("a keyword"));
    assert!(refused("", &[]).contains("empty"));
}

#[test]
fn cut_decks_are_errors_or_meshes_and_never_panics() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.inp");
    let whole = std::fs::read(fixture("block_gmsh.inp")).unwrap();
    for end in (0..whole.len()).step_by(whole.len() / 97) {
        std::fs::write(&path, &whole[..end]).unwrap();
        if let Err(error) = read::<3>(&path) {
            assert!(error.to_string().contains("cut.inp"), "{error}");
        }
    }
}
