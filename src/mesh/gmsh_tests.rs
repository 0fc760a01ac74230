use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::super::quality::check;
use super::super::read::{detect_dimension, read};
use super::super::{CellShape, Mesh};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures")
        .join(name)
}

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("meshes")
        .join(name)
}

fn count<const D: usize>(mesh: &Mesh<D>, shape: CellShape) -> u64 {
    mesh.shapes.iter().filter(|s| **s == shape).count() as u64
}

/// Against counts, volumes and sets that Gmsh's model, meshio and numpy gave (`tests/fixtures/generate.py`).
fn agrees<const D: usize>(name: &str, numbers: &Value) {
    let mesh = read::<D>(&fixture(name)).unwrap();
    assert_eq!(mesh.nodes.len() as u64, numbers["nodes"], "{name}");
    for (kind, shape) in [
        ("triangle", CellShape::Tri3),
        ("quad", CellShape::Quad4),
        ("tetra", CellShape::Tet4),
        ("hexahedron", CellShape::Hex8),
    ] {
        let wanted = numbers["cells"][kind].as_u64().unwrap_or(0);
        assert_eq!(count(&mesh, shape), wanted, "{name}: {kind}");
    }
    let volume = check(&mesh).unwrap().volume;
    assert!(
        (volume - numbers["volume"].as_f64().unwrap()).abs() < 1e-13 * volume,
        "{name}"
    );
    let sets = numbers["sets"].as_object().unwrap();
    for (set, wanted) in sets {
        let members = match wanted["kind"].as_str().unwrap() {
            "cell" => mesh.cell_sets[set].len(),
            "facet" => mesh.facet_sets[set].len(),
            _ => mesh.node_sets[set].len(),
        };
        assert_eq!(members as u64, wanted["members"], "{name}: {set}");
        let nodes = mesh.nodes_of_set(set).unwrap();
        assert_eq!(nodes.len() as u64, wanted["nodes"], "{name}: {set}");
        let sum: Vector3 = nodes.iter().fold([0.0; 3], |mut sum, &n| {
            (0..D).for_each(|k| sum[k] += mesh.nodes[n as usize][k]);
            sum
        });
        for (k, sum) in sum.iter().enumerate() {
            assert!(
                (sum - wanted["sum"][k].as_f64().unwrap()).abs() < 1e-11,
                "{name}: {set}"
            );
        }
    }
    assert_eq!(
        mesh.set_names().len(),
        sets.len() + 1,
        "one more for all: {:?}",
        mesh.set_names()
    );
    assert_eq!(detect_dimension(&fixture(name)).unwrap(), D);
}

type Vector3 = [f64; 3];

fn numbers() -> Value {
    serde_json::from_slice(&std::fs::read(fixture("numbers.json")).unwrap()).unwrap()
}

#[test]
fn all_versions_and_encodings_agree_with_gmsh_and_meshio() {
    let numbers = numbers();
    for name in ["22_ascii", "22_binary", "41_ascii", "41_binary"] {
        agrees::<2>(&format!("plate_{name}.msh"), &numbers["plate"]);
    }
    for name in ["22_binary", "41_ascii", "41_binary"] {
        agrees::<3>(&format!("block_{name}.msh"), &numbers["block"]);
    }
}

/// Node by node and cell by cell against another reader of version 4.1.
#[test]
fn agrees_with_mshio() {
    for path in [
        fixture("plate_41_ascii.msh"),
        fixture("plate_41_binary.msh"),
        shipped("slit_plate.msh"),
        shipped("lug.msh"),
    ] {
        compare_with_mshio::<2>(&path);
    }
    compare_with_mshio::<3>(&fixture("block_41_binary.msh"));
    compare_with_mshio::<3>(&shipped("bar_hexes.msh"));
}

fn compare_with_mshio<const D: usize>(path: &Path) {
    let mesh = read::<D>(path).unwrap();
    let other = mshio::parse_msh_bytes(&std::fs::read(path).unwrap()).unwrap();
    let mut position = BTreeMap::new();
    for block in &other.data.nodes.as_ref().unwrap().node_blocks {
        // without a table the tags run on from block to block
        let next = 1 + position.len() as u64;
        let mut tags: Vec<(usize, u64)> = match &block.node_tags {
            Some(table) => table.iter().map(|(tag, at)| (*at, *tag)).collect(),
            None => (0..block.nodes.len())
                .map(|i| (i, next + i as u64))
                .collect(),
        };
        tags.sort_unstable();
        for ((_, tag), n) in tags.iter().zip(&block.nodes) {
            position.insert(*tag, [n.x, n.y, n.z]);
        }
    }
    let mut c = 0;
    for block in &other.data.elements.as_ref().unwrap().element_blocks {
        if block.entity_dim as usize != D {
            continue;
        }
        for element in &block.elements {
            assert_eq!(mesh.cell(c).len(), element.nodes.len());
            for (n, tag) in mesh.cell(c).iter().zip(&element.nodes) {
                let x = mesh.nodes[*n as usize];
                assert_eq!(x.as_slice(), &position[tag][..D], "{}", path.display());
            }
            c += 1;
        }
    }
    assert_eq!(c, mesh.cell_count());
}

#[test]
fn shipped_meshes_are_what_their_geometry_says() {
    let plate = read::<2>(&shipped("slit_plate.msh")).unwrap();
    let quality = check(&plate).unwrap();
    assert!((quality.volume - (1.0 - 0.2 / 60.0)).abs() < 1e-12);
    assert_eq!(count(&plate, CellShape::Quad4), plate.cell_count() as u64);
    assert!(quality.smallest_scaled_jacobian > 0.25);
    let h = 1.0 / 120.0;
    assert!((quality.shortest_edge - h).abs() < 0.5 * h && quality.longest_edge < 0.08);
    assert_eq!(plate.cell_sets["plate"].len(), plate.cell_count());
    assert_eq!(plate.facet_sets["slit"].len(), 52);
    for side in ["left", "right", "bottom", "top"] {
        assert!(plate.facet_sets[side].len() >= 20);
    }
    // every lattice point of the block around the slit is a node, to 1e-12
    let mut lattice = std::collections::HashSet::new();
    for x in &plate.nodes {
        let (i, j) = ((x[0] / h).round(), (x[1] / h).round());
        if i.abs() <= 34.0 && j.abs() <= 23.0 {
            assert!((x[0] - i * h).abs() < 1e-12 && (x[1] - j * h).abs() < 1e-12);
            lattice.insert((i as i64, j as i64));
        }
    }
    assert_eq!(lattice.len(), 69 * 47 - 23);

    let hexes = read::<3>(&shipped("bar_hexes.msh")).unwrap();
    assert!((check(&hexes).unwrap().volume - 6.0).abs() < 1e-12);
    assert_eq!((hexes.cell_count(), hexes.nodes.len()), (24 * 16, 25 * 25));
    let tets = read::<3>(&shipped("bar_tets.msh")).unwrap();
    assert!((check(&tets).unwrap().volume - 6.0).abs() < 1e-12);
    assert!(check(&tets).unwrap().smallest_scaled_jacobian > 0.1);
    for (mesh, x) in [(&hexes, "end"), (&tets, "end")] {
        let area: f64 = mesh.facet_sets[x].iter().map(|f| mesh.facet_area(f)).sum();
        assert!((area - 1.0).abs() < 1e-12);
        let nodes = mesh.nodes_of_set(x).unwrap();
        assert!(
            nodes
                .iter()
                .all(|&n| (mesh.nodes[n as usize].x - 6.0).abs() < 1e-12)
        );
    }
    let lug = read::<2>(&shipped("lug.msh")).unwrap();
    let area = 1.8 * 1.2 + std::f64::consts::PI * (0.18 - 0.0625);
    assert!((check(&lug).unwrap().volume - area).abs() < 1e-3 * area);
    for node in lug.nodes_of_set("hole").unwrap() {
        assert!((lug.nodes[node as usize].norm() - 0.25).abs() < 1e-12);
    }
    assert!(
        lug.nodes.iter().all(|x| x.norm() > 0.2),
        "the centre is dropped"
    );
}

const TWO: &str = "$MeshFormat
2.2 0 8
$EndMeshFormat
$Comments
anything goes
$EndComments
$Nodes
5
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
9 7 7 7
$EndNodes
$Elements
4
1 1 2 5 1 1 2
2 2 2 6 1 1 2 3
3 2 2 6 1 1 3 4
4 2 2 8 1 1 2 3
$EndElements
$NodeData
1
\"T\"
$EndNodeData
";

fn written(name: &str, content: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    (folder, path)
}

fn message<const D: usize>(text: &str) -> String {
    let (_folder, path) = written("wrong.msh", text.as_bytes());
    let message = read::<D>(&path).unwrap_err().to_string();
    assert!(message.contains("wrong.msh"), "{message}");
    message
}

#[test]
fn unnamed_groups_repeated_elements_and_unused_nodes() {
    let (_folder, path) = written("small.msh", TWO.as_bytes());
    let mesh = read::<2>(&path).unwrap();
    assert_eq!((mesh.nodes.len(), mesh.cell_count()), (4, 2));
    assert_eq!(mesh.cell_sets["physical_6"], vec![0, 1]);
    assert_eq!(
        mesh.cell_sets["physical_8"],
        vec![0],
        "element 4 is element 2 in another group"
    );
    assert_eq!(mesh.facet_sets["physical_5"], vec![vec![0, 1]]);
}

// One function: the cases are a table and share nothing.
#[test]
fn wrong_files_name_place_value_and_remedy() {
    for (from, to, wanted) in [
        (
            "1 1 0\n",
            "1 NaN 0\n",
            ["line 11", "y of node 3 is NaN", "finite"],
        ),
        (
            "4 0 1 0",
            "3 0 1 0",
            [
                "line 12",
                "node 3 was already defined at line 11",
                "renumber",
            ],
        ),
        (
            "1 3 4\n",
            "1 3 44\n",
            ["line 19", "element 3 refers to node 44", "all its nodes"],
        ),
        (
            "3 1 1 0",
            "3 1 1 0.5",
            ["line 11", "node 3 has z = 0.5", "flatten"],
        ),
        (
            "2 1 0 0",
            "2 1 zero 0",
            ["line 10", "\"zero\", but a coordinate", "correct it"],
        ),
        (
            "3 2 2 6",
            "3 10 2 6",
            [
                "line 19",
                "element 3 is of type 10 (second-order quadrilateral of nine nodes)",
                "SecondOrderIncomplete = 1",
            ],
        ),
        (
            "3 2 2 6",
            "3 14 2 6",
            ["line 19", "(second-order pyramid)", "mesh.file.order"],
        ),
        (
            "3 2 2 6",
            "3 99 2 6",
            ["line 19", "type 99 (unknown)", "supported are"],
        ),
        (
            "4 2 2 8",
            "4 2 2 6",
            [
                "line 20",
                "element 4 has the same nodes as element 2",
                "remove",
            ],
        ),
        (
            "$Nodes\n5",
            "$Nodes\n6",
            ["line 14", "\"$EndNodes\", but a node number", "correct it"],
        ),
        (
            "$Nodes\n5",
            "$Nodes\n4",
            ["line 13", "$EndNodes", "more than it announces"],
        ),
        (
            "$Nodes\n5",
            "$Nodes\nfive",
            ["line 8", "\"five\", but the number of nodes", "correct it"],
        ),
        (
            "2.2 0 8",
            "4.0 0 8",
            ["line 2", "version 4.0", "msh41 or msh22"],
        ),
        (
            "2.2 0 8",
            "1 0 8",
            ["line 2", "version 1", "msh41 or msh22"],
        ),
        (
            "$Comments",
            "$ParametricNodes",
            ["line 4", "$ParametricNodes", "SaveParametric"],
        ),
        (
            "$Comments",
            "$PartitionedEntities",
            ["line 4", "partitioned", "Unpartition"],
        ),
        (
            "$MeshFormat",
            "MeshFormat",
            ["line 1", "\"MeshFormat\", but a section", "correct it"],
        ),
    ] {
        assert!(TWO.contains(from));
        let message = message::<2>(&TWO.replacen(from, to, 1));
        for wanted in wanted {
            assert!(message.contains(wanted), "{wanted:?} missing in: {message}");
        }
    }
    let message = message::<3>(TWO);
    assert!(message.contains("dimension 3 was asked for") && message.contains("have dimension 2"));
}

#[test]
fn truncated_and_empty_files() {
    let end = TWO
        .find("3 1 3 4")
        .unwrap_or_else(|| TWO.find("1 3 4").unwrap());
    let cut = message::<2>(&TWO[..end]);
    assert!(
        cut.contains("ends within $Elements: a node of an element expected"),
        "{cut}"
    );
    let cut = message::<2>(&TWO[..TWO.find("$Elements").unwrap()]);
    assert!(
        cut.contains("a section $Elements expected; it is truncated"),
        "{cut}"
    );
    let empty = message::<2>("");
    assert!(empty.contains("a section $MeshFormat expected"), "{empty}");
    let start = TWO.find("$Nodes").unwrap();
    let hollow = "$Nodes\n0\n$EndNodes\n$Elements\n0\n$EndElements\n";
    let hollow = message::<2>(&format!("{}{hollow}", &TWO[..start]));
    assert!(
        hollow.contains("the mesh is empty (0 nodes, 0 elements)"),
        "{hollow}"
    );
    // no prefix of a binary file may panic or pass
    let whole = std::fs::read(fixture("plate_41_binary.msh")).unwrap();
    for length in (0..whole.len() - 14).step_by(101) {
        let (_folder, path) = written("cut.msh", &whole[..length]);
        let message = read::<2>(&path).unwrap_err().to_string();
        assert!(message.contains("expected"), "{message}");
    }
    let (_folder, path) = written("cut.msh", &whole[..whole.len() / 2]);
    let message = read::<2>(&path).unwrap_err().to_string();
    assert!(
        message.contains("byte 4") && message.contains("truncated"),
        "{message}"
    );
    let missing = read::<2>(Path::new("no/such.msh")).unwrap_err().to_string();
    assert!(
        missing.starts_with("no/such.msh") && missing.contains("check that"),
        "{missing}"
    );
    let odd = written("mesh.unv", b"");
    let odd = read::<2>(&odd.1).unwrap_err().to_string();
    assert!(odd.contains("use .msh"), "{odd}");
}

/// A file of the other byte order, written here number by number.
#[test]
fn binary_of_either_byte_order() {
    for swapped in [false, true] {
        let int = |n: i32| {
            if swapped { n.swap_bytes() } else { n }
                .to_ne_bytes()
                .to_vec()
        };
        let size = |n: u64| {
            if swapped { n.swap_bytes() } else { n }
                .to_ne_bytes()
                .to_vec()
        };
        let double = |x: f64| size(x.to_bits());
        let mut file = b"$MeshFormat\n4.1 1 8\n".to_vec();
        file.extend(int(1));
        file.extend(
            b"\n$EndMeshFormat\n$PhysicalNames\n1\n1 3 \"rod\"\n$EndPhysicalNames\n$Entities\n",
        );
        for n in [0, 1, 0, 0] {
            file.extend(size(n));
        }
        file.extend(int(5));
        for x in [0.0, 0.0, 0.0, 2.0, 0.0, 0.0] {
            file.extend(double(x));
        }
        file.extend(size(1));
        file.extend(int(-3));
        file.extend(size(0));
        file.extend(b"\n$EndEntities\n$Nodes\n");
        for n in [1, 2, 1, 2] {
            file.extend(size(n));
        }
        for n in [1, 5, 1] {
            file.extend(int(n));
        }
        for n in [2, 1, 2] {
            file.extend(size(n));
        }
        // x, y, z and one parametric coordinate
        for x in [0.25, 0.0, 0.0, 0.1, 2.0, 0.0, 0.0, 0.9] {
            file.extend(double(x));
        }
        file.extend(b"\n$EndNodes\n$Elements\n");
        for n in [1, 1, 1, 1] {
            file.extend(size(n));
        }
        for n in [1, 5, 1] {
            file.extend(int(n));
        }
        for n in [1, 1, 1, 2] {
            file.extend(size(n));
        }
        file.extend(b"\n$EndElements\n");
        let (_folder, path) = written("rod.msh", &file);
        let mesh = read::<1>(&path).unwrap();
        assert_eq!(
            mesh.nodes.iter().map(|x| x[0]).collect::<Vec<_>>(),
            [0.25, 2.0]
        );
        assert_eq!(mesh.cell_sets["rod"], vec![0]);
        assert_eq!(mesh.cell_volume(0), 1.75);
    }
}
