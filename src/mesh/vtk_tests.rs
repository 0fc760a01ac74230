use std::path::PathBuf;

use super::super::quality::check;
use super::super::read::{detect_dimension, read};
use crate::mesh::Mesh;
use crate::mesh::generate::Axis;
use crate::tensor::Vector;

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
        ("1\n9\n", "1\n7\n", "element 0 is of type 7"),
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

/// Files that VTK itself wrote: a square of cells, of which some fill blocks of 32 768 bytes to the last one, whose size VTK gives as 0.
#[test]
fn files_of_vtk_are_read() {
    let plate = read::<2>(&fixture("plate_vtk_zlib.vtu")).unwrap();
    assert_eq!((plate.nodes.len(), plate.cell_count()), (1089, 1024));
    assert!((check(&plate).unwrap().volume - 1.0).abs() < 1e-12);
    // appended raw data with the most significant byte first, and 64-bit integers in an older format
    for name in ["plate_vtk_raw.vtu", "plate_vtk_long.vtk"] {
        let plate = read::<2>(&fixture(name)).unwrap();
        assert_eq!((plate.nodes.len(), plate.cell_count()), (25, 16), "{name}");
        assert!(
            (check(&plate).unwrap().volume - 1.0).abs() < 1e-12,
            "{name}"
        );
        let count = |set: &str| plate.cell_sets[set].len();
        assert_eq!([count("part_0"), count("part_1")], [8, 8], "{name}");
        assert_eq!(
            [count("ids_0"), count("ids_1"), count("ids_2")],
            [6, 5, 5],
            "{name}"
        );
        // x is 0.5 at least in the cells of the second half
        let second = &plate.cell_sets["part_1"];
        assert!(
            second.iter().all(|&c| plate.centroid(c as usize)[0] > 0.5),
            "{name}"
        );
    }
}

/// A file whose one cell is right but for what is replaced in it.
fn one_cell(changes: &[(&str, &str)]) -> String {
    let mut text = "<VTKFile type=\"UnstructuredGrid\" header_type=\"UInt32\" compressor=\"vtkZLibDataCompressor\"><UnstructuredGrid>\
        <Piece NumberOfPoints=\"4\" NumberOfCells=\"1\"><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\">\
        0 0 0 1 0 0 1 1 0 0 1 0</DataArray></Points><Cells><DataArray type=\"Int64\" Name=\"connectivity\">0 1 2 3</DataArray>\
        <DataArray type=\"Int64\" Name=\"offsets\">4</DataArray><DataArray type=\"UInt8\" Name=\"types\">9</DataArray></Cells>\
        </Piece></UnstructuredGrid></VTKFile>"
        .to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    text
}

#[test]
fn wrong_arrays_are_named_with_their_line() {
    use base64::Engine as _;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cell.vtu");
    let found = |changes: &[(&str, &str)]| {
        std::fs::write(&path, one_cell(changes)).unwrap();
        read::<2>(&path)
            .map(|m| m.cell_count())
            .map_err(|e| e.to_string())
    };
    assert_eq!(found(&[]), Ok(1));
    let offsets = "Name=\"offsets\">4";
    let blocks = |numbers: &[u32]| {
        let bytes: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
        let text = base64::engine::general_purpose::STANDARD.encode(bytes);
        format!("Name=\"offsets\" format=\"binary\">{text}")
    };
    let huge = blocks(&[3, 0x8000_0000, 0, 1, 1, 1]);
    let many = blocks(&[0xffff_ffff, 8, 0]);
    let beyond = blocks(&[1, 8, 0, 0x7fff_ffff]);
    let nothing = blocks(&[1, 8, 0, 0]);
    for (from, to, wanted) in [
        (offsets, "Name=\"offsets\">5", "but 5 expected"),
        (
            offsets,
            "Name=\"offsets\">3",
            "more numbers in the array `connectivity`",
        ),
        (
            offsets,
            "Name=\"offsets\">x",
            "\"x\" in the array `offsets`",
        ),
        (offsets, "Name=\"offsets\">4 4", "more numbers"),
        (offsets, "Name=\"offsets\">-4", "the offset -4 after 0"),
        (
            offsets,
            "Name=\"offsets\" format=\"appended\" offset=\"9\">",
            "no appended data",
        ),
        (offsets, "Name=\"ends\">4", "the array `offsets` expected"),
        (offsets, huge.as_str(), "a header of 6442450944 bytes"),
        (offsets, many.as_str(), "a header of 34359738360 bytes"),
        (offsets, beyond.as_str(), "data that end early"),
        (offsets, nothing.as_str(), "8 bytes (1 numbers)"),
        (
            "\"4\" Num",
            "\"400000000000\" Num",
            "1200000000000 expected",
        ),
        ("\"4\" Num", "\"-4\" Num", "a whole number"),
        ("ZLib", "LZ4", "compressed by vtkLZ4DataCompressor"),
        ("2 3</Data", "2 3</Daat", "the end of the tag that is open"),
        ("</Cells>", "", "the end of the tag that is open"),
    ] {
        let message = match found(&[(from, to)]) {
            Err(message) => message,
            Ok(cells) => panic!("{to}: {cells} cells"),
        };
        assert!(message.contains(wanted), "{to}: {message}");
        assert!(
            message.contains("cell.vtu: line 1") && message.contains(';'),
            "{message}"
        );
    }
}

/// Sizes that a file announces take no memory: points and arrays that no cell uses are not kept.
#[test]
fn points_that_no_cell_uses_are_not_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cell.vtu");
    let more = format!("0 1 0{}", " 7 7 7".repeat(100_000));
    let text = one_cell(&[
        ("0 1 0<", &format!("{more}<")),
        ("Points=\"4\"", "Points=\"100004\""),
    ]);
    std::fs::write(&path, text).unwrap();
    let mesh = read::<2>(&path).unwrap();
    assert_eq!((mesh.nodes.len(), mesh.nodes.capacity()), (4, 4));
}

#[test]
fn legacy_files_tell_lines_and_pass_over_what_is_no_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cell.vtk");
    let text = "# vtk DataFile Version 3.0\none\nASCII\nDATASET UNSTRUCTURED_GRID\nFIELD FieldData 1\ntime 1 1 double\n0.5\n\
        POINTS 4 float\n0 0 0\n1 0 0\n1 1 0\n0 1 0\nMETADATA\nINFORMATION 0\n\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n9\n\
        POINT_DATA 4\nVECTORS u float\n0 0 0 0 0 0 0 0 0 0 0 nan\nCELL_DATA 1\nSCALARS part vtktypeint64\nLOOKUP_TABLE default\n7\n\
        FIELD more 2\nid 1 1 long\n3\nstress 2 1 double\n1 2\n";
    let found = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        read::<2>(&path).map_err(|e| e.to_string())
    };
    let mesh = found("one", "one").unwrap();
    assert_eq!(mesh.cell_sets["part_7"], [0]);
    assert_eq!(mesh.cell_sets["id_3"], [0]);
    assert!(!mesh.cell_sets.keys().any(|k| k.starts_with("stress")));
    for (from, to, wanted) in [
        ("1 5\n4 0", "1 5\n4 x", "line 17: \"x\""),
        ("CELLS 1 5", "CELLS 1 1000000000000", "a number expected"),
        ("CELLS 1 5", "CELLS 2 5", "\"1 cells\", but 2"),
        ("POINTS 4", "POINTS 99999999999999", "times 3 numbers"),
        ("TYPES 1", "TYPES 2", "\"POINT_DATA\""),
        ("vtktypeint64", "string", "an array of type `string`"),
        (
            "UNSTRUCTURED_GRID",
            "POLYDATA",
            "line 4: a VTK data set other",
        ),
        ("ASCII", "ASCI", "line 3: \"ASCI\""),
    ] {
        let message = found(from, to).unwrap_err();
        assert!(
            message.contains(wanted) && message.contains(';'),
            "{to}: {message}"
        );
    }
}

/// Coordinates of the planes of `tests/fixtures/generate_grids.py`.
const PLANES: [&[f64]; 3] = [&[0.0, 0.5, 2.0, 3.0], &[0.0, 1.0, 1.5], &[0.0, 0.25, 1.0]];

/// Compares a file of VTK's with the mesh of the same planes, each node at `place` of where it lies in them.
fn is_grid<const D: usize>(name: &str, place: impl Fn(Vector<D>) -> Vector<D>) {
    let lines = std::array::from_fn(|a| Axis::Coordinates(PLANES[a].to_vec()));
    let mut wanted: Mesh<D> = crate::mesh::generate::Grid::new(lines).mesh().unwrap();
    wanted.nodes.iter_mut().for_each(|x| *x = place(*x));
    let mesh = read::<D>(&fixture(name)).unwrap();
    assert_eq!(mesh.nodes.len(), wanted.nodes.len(), "{name}");
    assert_eq!(mesh.cell_count(), wanted.cell_count(), "{name}");
    for c in 0..mesh.cell_count() {
        let off = (mesh.centroid(c) - wanted.centroid(c)).norm();
        let volume = mesh.cell_volume(c) - wanted.cell_volume(c);
        assert!(off.max(volume.abs()) < 1e-14, "{name}: {c} {off} {volume}");
    }
    let half = mesh.cell_count() as u32 / 2;
    let first: Vec<u32> = (0..half).collect();
    assert_eq!(mesh.cell_sets["phase_1"], first, "{name}");
    assert_eq!(mesh.cell_sets["phase_2"].len() as u32, half, "{name}");
    check(&mesh).unwrap();
}

#[test]
fn grids_in_rows_columns_and_layers_are_meshes() {
    let sheared = |x: Vector<3>| Vector::<3>::new(x[0] + 0.2 * x[1], x[1] + 0.1 * x[2], x[2]);
    is_grid::<3>("grid_vtk_zlib.vts", sheared);
    is_grid::<3>("grid_vtk_structured.vtk", sheared);
    is_grid::<2>("grid_vtk_flat.vts", |x| {
        Vector::<2>::new(x[0] + 0.2 * x[1], x[1])
    });
    is_grid::<3>("grid_vtk_ascii.vtr", |x| x);
    is_grid::<2>("grid_vtk_flat.vtr", |x| x);
    is_grid::<2>("grid_vtk_rectilinear.vtk", |x| x);
    let image = read::<2>(&fixture("grid_vtk_image.vtk")).unwrap();
    assert_eq!((image.nodes.len(), image.cell_count()), (12, 6));
    let (low, high) = image.bounds();
    assert_eq!((low, high), ([1.0, 2.0].into(), [2.5, 2.5].into()));
    assert_eq!(image.cell_sets["phase_2"], [3, 4, 5]);
}

#[test]
fn grids_with_wrong_numbers_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let found = |name: &str, from: &str, to: &str| {
        let text = std::fs::read_to_string(fixture(name)).unwrap();
        assert!(text.contains(from), "{from}");
        let path = folder.path().join(name);
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        read::<2>(&path).unwrap_err().to_string()
    };
    let (legacy, image) = ("grid_vtk_rectilinear.vtk", "grid_vtk_image.vtk");
    for (name, from, to, wanted) in [
        (
            legacy,
            "DIMENSIONS 4 3 1",
            "DIMENSIONS 4 1 3",
            "line 5: \"DIMENSIONS",
        ),
        (
            legacy,
            "DIMENSIONS 4 3 1",
            "DIMENSIONS 4 4000000 4000000",
            "1e8 cells",
        ),
        (
            legacy,
            "DIMENSIONS 4 3 1",
            "DIMENSIONS 4 three 1",
            "\"three\"",
        ),
        (
            legacy,
            "DIMENSIONS 4 3 1",
            "DIMENSIONS 7 2 1",
            "planes of an extent",
        ),
        (legacy, "DIMENSIONS 4 3 1", "", "a section DIMENSIONS"),
        (image, "SPACING 0.5 0.25 1", "SPACING 0.5 0 1", "above zero"),
        (
            image,
            "phase 1 6 int",
            "phase 1 6 float",
            "integers per cell",
        ),
        (
            "grid_vtk_flat.vts",
            "Piece Extent=\"0 3",
            "Piece Extent=\"0 6",
            "numbers in the array",
        ),
        (
            "grid_vtk_flat.vts",
            "Piece Extent=\"0 3",
            "Piece Extent=\"0 0",
            "six planes",
        ),
    ] {
        let message = found(name, from, to);
        assert!(message.contains(wanted), "{name} {to}: {message}");
    }
}

#[test]
fn points_have_the_numbers_of_their_array() {
    for name in ["points_vtk.vtu", "points_vtk.vtk"] {
        let points = super::super::read::points(&fixture(name), "area").unwrap();
        let place = |k: usize| {
            [
                0.25 + 0.5 * (k % 3) as f64,
                0.25 + 0.5 * (k / 3) as f64,
                0.0,
            ]
        };
        assert_eq!(
            points.coordinates,
            (0..6).map(place).collect::<Vec<_>>(),
            "{name}"
        );
        assert_eq!(points.values, [0.25; 6], "{name}");
        let error = super::super::read::points(&fixture(name), "volume").unwrap_err();
        assert!(error.to_string().contains("the array `volume`"), "{error}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("short.vtk");
    let text = std::fs::read_to_string(fixture("points_vtk.vtk")).unwrap();
    let short = text.replace("area 1 6 double\n0.25 ", "area 1 5 double\n");
    assert_ne!(text, short);
    std::fs::write(&path, short).unwrap();
    let error = super::super::read::points(&path, "area").unwrap_err();
    assert!(error.to_string().contains("6, one per point"), "{error}");
}
