//! Bytes within files that are right around them: arrays of a VTU file, and the state within a checkpoint whose checksum holds.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use bondline::Silent;
use bondline::observe::checkpoint::{CheckpointFile, Fingerprint};
use bondline::run::{AnyScene, RunError, RunOptions, StartFrom};
use bondline::scene::Source;

use super::{Outcome, folder, mesh_file, variant};

/// Bytes of a checkpoint before its state, and after it.
const HEAD: usize = 20;

/// A VTU file with these bytes as one of its arrays, or a checkpoint with these bytes as its state: the first byte says which.
///
/// # Panics
/// As [`super::scene_text`].
pub fn binary_file(data: &[u8]) -> Outcome {
    match data {
        [first, rest @ ..] if first % 4 == 3 => checkpoint(rest),
        [first, second, rest @ ..] => mesh_file(&vtu(*first, *second, rest)),
        _ => Outcome::Skipped("too short"),
    }
}

/// A square of one or two cells; `which` array is made of `bytes`, and `how` says how the file is written and what it announces.
fn vtu(which: u8, how: u8, bytes: &[u8]) -> Vec<u8> {
    let bit = |k: u8| (how >> k) & 1 == 1;
    let width = if bit(0) { 64 } else { 32 };
    let order = if bit(1) { "BigEndian" } else { "LittleEndian" };
    let compressor = if bit(2) {
        "compressor=\"vtkZLibDataCompressor\""
    } else {
        ""
    };
    let points = if bit(3) { "4294967296" } else { "6" };
    let cells = if bit(4) { "1000000000" } else { "2" };
    let arrays = [
        (
            "Points",
            "Points",
            "Float64",
            3,
            "0 0 0 1 0 0 2 0 0 0 1 0 1 1 0 2 1 0",
        ),
        ("Cells", "connectivity", "Int64", 1, "0 1 4 3 1 2 5 4"),
        ("Cells", "offsets", "Int32", 1, "4 8"),
        ("Cells", "types", "UInt8", 1, "9 9"),
        ("CellData", "part", "Int16", 1, "1 2"),
    ];
    let mut text = format!(
        "<VTKFile type=\"UnstructuredGrid\" header_type=\"UInt{width}\" byte_order=\"{order}\" {compressor}><UnstructuredGrid>\
         <Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\">"
    )
    .into_bytes();
    let chosen = usize::from(which / 4) % arrays.len();
    let raw = bit(5);
    for (k, (section, name, kind, components, values)) in arrays.into_iter().enumerate() {
        let head = format!(
            "<{section}><DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format="
        );
        text.extend(head.bytes());
        if k != chosen {
            text.extend(format!("\"ascii\">{values}").bytes());
        } else if raw {
            text.extend(b"\"appended\" offset=\"0\">");
        } else {
            text.extend(format!("\"binary\">{}", STANDARD.encode(bytes)).bytes());
        }
        text.extend(format!("</DataArray></{section}>").bytes());
    }
    text.extend(b"</Piece></UnstructuredGrid>");
    if raw {
        text.extend(b"<AppendedData encoding=\"raw\">_");
        text.extend(bytes);
    } else {
        text.extend(b"</VTKFile>");
    }
    text
}

/// A plate whose bonds may break.
const PLATE: &str = "
    kinematics = 'plane-stress'
    coupling = 'splice'
    mesh.rectangle = { min = [0, 0], max = [6, 3], x = { cells = 6 }, y = { cells = 3 } }
    materials.m.bond-based = { youngs-modulus = 1, density = 1, critical-stretch = 0.01 }
    peridynamics = { horizon = 1.5, points.lattice.spacing = 1 }
    zones = { damage-at-edge = 'warn', nonlocal.box = { min = [2, 0], max = [4, 3] } }
    solve.explicit = { duration = 4, outputs = 1, history-interval = 1 }
    conditions.left.displacement = { on = 'left', x = '-0.001*t' }
    output = { vtu = false, probes.middle.at = [3, 1.5] }";

fn scene(folder: &Path) -> (AnyScene, Fingerprint) {
    let source = Source::new("fuzz.toml", PLATE);
    let mut scene =
        bondline_study::from_source(&source, folder, "fuzz").expect("the plate is right");
    scene.set_output_directory(folder.to_path_buf());
    let AnyScene::Plane(plane) = &scene else {
        panic!("the plate is plane")
    };
    let print = plane.fingerprint.clone();
    (scene, print)
}

/// A run that goes on from these bytes ends after a step, or with an error by name.
fn checkpoint(state: &[u8]) -> Outcome {
    let folder = folder();
    let (scene, print) = scene(folder.path());
    let file = CheckpointFile::new(folder.path().join("fuzz.checkpoint"), print);
    file.write(&())
        .expect("the folder for temporary files can be written");
    let mut bytes = std::fs::read(file.path()).expect("it was written");
    bytes.truncate(HEAD);
    bytes.extend(state);
    bytes.extend((state.len() as u64).to_le_bytes());
    let sum = crc32fast::hash(&bytes);
    bytes.extend(sum.to_le_bytes());
    std::fs::write(file.path(), bytes).expect("the folder for temporary files can be written");
    // what the state says was written is there
    let table = vec![b'\n'; 1 << 12];
    std::fs::write(folder.path().join("fuzz_history.csv"), table).expect("as above");
    let interrupt = AtomicBool::new(true);
    let options = RunOptions {
        start: StartFrom::Checkpoint,
        interrupt: Some(&interrupt),
        ..RunOptions::default()
    };
    match scene.run_with(&options, &Silent) {
        Ok(_) => Outcome::Solved,
        Err(error) => {
            let text = error.to_string();
            assert!(
                text.contains("; ") || text.contains(": "),
                "no remedy: {text}"
            );
            let kind = match &error {
                RunError::Checkpoint(error) => variant(error),
                other => variant(other),
            };
            Outcome::Refused(format!("checkpoint: {kind}"))
        }
    }
}

/// The state of a genuine checkpoint of the plate, as [`binary_file`] takes it: a case to begin with.
pub fn genuine_checkpoint() -> Vec<u8> {
    let folder = folder();
    let (scene, _) = scene(folder.path());
    let interrupt = AtomicBool::new(true);
    let options = RunOptions {
        interrupt: Some(&interrupt),
        ..RunOptions::default()
    };
    scene.run_with(&options, &Silent).expect("the plate runs");
    let bytes =
        std::fs::read(folder.path().join("fuzz.checkpoint")).expect("an interrupt leaves one");
    let mut data = vec![3];
    data.extend(&bytes[HEAD..bytes.len() - 12]);
    data
}
