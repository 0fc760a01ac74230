use std::path::PathBuf;

use super::super::quality::check;
use super::super::read::{detect_dimension, read};

fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures")
        .join(name)
}

const FILES: [&str; 5] = [
    "plate_zlib.vtu",
    "plate_ascii.vtu",
    "plate_binary.vtk",
    "plate_ascii.vtk",
    "plate_51.vtk",
];

/// Against counts by meshio and numpy, and node by node against the Gmsh file that meshio converted.
#[test]
fn meshio_files_agree_with_their_source() {
    let numbers: serde_json::Value =
        serde_json::from_slice(&std::fs::read(fixture("numbers.json")).unwrap()).unwrap();
    let source = read::<2>(&fixture("plate_41_ascii.msh")).unwrap();
    for name in FILES {
        let mesh = read::<2>(&fixture(name)).unwrap();
        assert_eq!(mesh.nodes.len() as u64, numbers["plate"]["nodes"], "{name}");
        let volume = check(&mesh).unwrap().volume;
        let wanted = numbers["plate"]["volume"].as_f64().unwrap();
        assert!(
            (volume - wanted).abs() < 1e-9 * volume,
            "{name}: {volume} {wanted}"
        );
        assert_eq!(mesh.connectivity, source.connectivity, "{name}");
        for (a, b) in mesh.nodes.iter().zip(&source.nodes) {
            assert!((a - b).norm() < 1e-9, "{name}");
        }
        for group in ["physical_1", "physical_2"] {
            assert_eq!(
                mesh.cell_sets[group].len() as u64,
                numbers["vtk"][group],
                "{name}"
            );
        }
        assert_eq!(
            mesh.facet_sets["physical_9"].len() as u64,
            numbers["vtk"]["physical_9"]
        );
        assert_eq!(mesh.cell_sets["CellEntityIds_7"].len(), mesh.cell_count());
        assert_eq!(
            mesh.set_names().len(),
            5,
            "reals make no sets: {:?}",
            mesh.set_names()
        );
        assert_eq!(detect_dimension(&fixture(name)).unwrap(), 2);
    }
}

#[test]
fn broken_files_are_errors_not_panics() {
    let folder = tempfile::tempdir().unwrap();
    for name in FILES {
        let whole = std::fs::read(fixture(name)).unwrap();
        for share in 0..40 {
            let path = folder.path().join(name);
            std::fs::write(&path, &whole[..whole.len() / 2 * share / 40]).unwrap();
            let message = match read::<2>(&path) {
                Err(e) => e.to_string(),
                Ok(mesh) => panic!(
                    "{name} cut at {share}/80 passes: {} cells",
                    mesh.cell_count()
                ),
            };
            assert!(message.contains(name), "{message}");
        }
    }
}

#[test]
fn unsupported_cells_and_bad_numbers_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let text = "# vtk DataFile Version 3.0\nsmall\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n\
        0 0 0\n1 0 0\n1 1 0\n0 1 0\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n9\n";
    let message = |from: &str, to: &str| {
        assert!(text.contains(from));
        let path = folder.path().join("small.vtk");
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        read::<2>(&path).map_err(|e| e.to_string())
    };
    assert_eq!(message("small", "small").unwrap().cell_count(), 1);
    for (from, to, wanted) in [
        ("1\n9\n", "1\n8\n", "element 0 is of type 8"),
        ("1\n9\n", "1\n5\n", "cell 0 (Tri3) with 4 nodes"),
        ("2 3\nCELL", "2 7\nCELL", "element 0 refers to node 7"),
        ("1 1 0", "1 1 2", "node 2 has z = 2"),
        ("1 1 0", "1 nan 0", ""),
    ] {
        let message = message(from, to).unwrap_err();
        assert!(
            message.contains(wanted) && message.contains("small.vtk"),
            "{message}"
        );
    }
}
