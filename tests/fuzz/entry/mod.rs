//! Entry points of fuzzers: each function takes bytes, and panics if bondline does anything but work or end in a named error.
//!
//! The targets of cargo-fuzz in `fuzz/` include this folder, and `tests/fuzz/main.rs` replays what they have found.
//!
//! | file | what |
//! |---|---|
//! | `binary.rs` | arrays of VTU files and states of checkpoints |
//! | `examine.rs` | a scene to its end: what has to hold of it |
//! | `random.rs` | bytes to a scene within the schema |
//! | `size.rs` | which scenes are small enough to be run |
//! | `typed.rs` | bytes to a scene as users type it |
//! | `agree.rs` | such a scene beside its elements alone |

mod agree;
mod binary;
mod examine;
mod random;
mod size;
mod typed;

use std::path::{Path, PathBuf};

use arbitrary::Unstructured;
use bondline::mesh::{MeshError, quality, read};
use bondline::scene::{SceneSpec, Source};

#[allow(unused_imports)] // each target calls its own
pub use agree::{Agreement, typed_scene, typed_text};
#[allow(unused_imports)] // as above
pub use binary::{binary_file, genuine_checkpoint};
pub use examine::Outcome;
use examine::{examine, refused};

/// The folder of the meshes that scenes name.
fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .map(|folder| folder.join("tests/fixtures"))
        .find(|folder| folder.is_dir())
        .expect("the fixtures lie in the repository")
}

/// A folder in memory for what one case writes.
fn folder() -> tempfile::TempDir {
    let memory = Path::new("/dev/shm");
    let made = if memory.is_dir() {
        tempfile::tempdir_in(memory)
    } else {
        tempfile::tempdir()
    };
    made.expect("the folder for temporary files can be written")
}

/// The text of a scene: parsed, and where it is small, laid out, predicted and run.
///
/// # Panics
/// If bondline does, if a result is not finite, if an error has no message.
pub fn scene_text(data: &[u8]) -> Outcome {
    match std::str::from_utf8(data) {
        Ok(text) => run_text(text, &fixtures()),
        Err(_) => Outcome::Skipped("no text"),
    }
}

fn run_text(text: &str, meshes: &Path) -> Outcome {
    let source = Source::new("fuzz.toml", text);
    let spec = match SceneSpec::parse(&source) {
        Ok(spec) => spec,
        Err(error) => return refused(&error),
    };
    if !size::is_small(&spec) {
        return Outcome::Skipped("large");
    }
    match bondline_study::from_source(&source, meshes, "fuzz") {
        Ok(scene) => examine(scene, folder().path()),
        Err(error) => refused(&error),
    }
}

/// The bytes of a mesh file: Gmsh, VTK, VTU or a deck, told by its beginning. A mesh that is read carries scenes on it.
///
/// # Panics
/// As [`scene_text`].
pub fn mesh_file(data: &[u8]) -> Outcome {
    let extension = match data.first() {
        Some(b'#') => "vtk",
        Some(b'<') => "vtu",
        Some(b'*') => "inp",
        _ => "msh",
    };
    let folder = folder();
    let name = format!("mesh.{extension}");
    let path = folder.path().join(&name);
    std::fs::write(&path, data).expect("the folder for temporary files can be written");
    let (kinematics, cells) = match read::detect_dimension(&path) {
        Ok(1) => ("bar", cells::<1>(&path)),
        Ok(2) => ("plane-strain", cells::<2>(&path)),
        Ok(3) => ("solid", cells::<3>(&path)),
        Ok(dimension) => panic!("a mesh of dimension {dimension}"),
        Err(error) => ("", Err(error)),
    };
    match cells {
        Ok(cells) if cells > size::MOST_CELLS => Outcome::Skipped("large"),
        Ok(_) => {
            let scene = |rest: &str| {
                format!(
                    "kinematics = '{kinematics}'\nmesh.file.path = '{name}'\n\
                     materials.m.lps = {{ youngs-modulus = 2, poisson-ratio = 0.2 }}\n{rest}"
                )
            };
            run_text(
                &scene("conditions.held.displacement = { inside.everywhere = true, x = '1e-3*x' }"),
                folder.path(),
            );
            run_text(
                &scene(
                    "coupling = 'nonlocal'\nperidynamics.horizon = 0.3\nperidynamics.weights = 'plain'\n\
                     conditions.pulled.body-force = { x = 1 }",
                ),
                folder.path(),
            )
        }
        Err(error) => {
            let message = error.to_string();
            assert!(message.contains(';'), "no remedy: {message}");
            Outcome::Refused(format!("mesh: {}", variant(&error)))
        }
    }
}

/// Returns the number of cells of a mesh file, which all have a shape to compute with.
fn cells<const D: usize>(path: &Path) -> Result<usize, MeshError> {
    let mesh = read::read::<D>(path)?;
    quality::check(&mesh)?;
    let nodes = mesh.nodes.len() as u32;
    assert!(mesh.connectivity.iter().all(|&n| n < nodes));
    let sets = mesh.cell_sets.values().flatten();
    assert!(sets.copied().all(|c| (c as usize) < mesh.cell_count()));
    let facets = mesh.facet_sets.values().flatten().flatten();
    assert!(
        facets
            .chain(mesh.node_sets.values().flatten())
            .all(|&n| n < nodes)
    );
    Ok(mesh.cell_count())
}

/// The name of an error's variant, by which errors are counted.
fn variant(error: &impl std::fmt::Debug) -> String {
    let text = format!("{error:?}");
    text.chars().take_while(|c| c.is_alphanumeric()).collect()
}

/// A scene within the schema that bytes stand for.
///
/// # Panics
/// As [`scene_text`].
pub fn random_scene(data: &[u8]) -> Outcome {
    let text = random_text(data);
    keep(&text, &[]);
    if size::IS_INSTRUMENTED && text.contains("mesh.file") {
        return Outcome::Skipped("large");
    }
    run_text(&text, &fixtures())
}

/// Writes a scene and its meshes into the folder `BONDLINE_KEEP`, for whoever wants to look at it.
fn keep(text: &str, meshes: &[(String, String)]) {
    let Some(kept) = std::env::var_os("BONDLINE_KEEP") else {
        return;
    };
    let files = meshes
        .iter()
        .map(|(name, mesh)| (name.as_str(), mesh.as_str()));
    for (name, text) in files.chain([("scene.toml", text)]) {
        std::fs::write(Path::new(&kept).join(name), text).expect("BONDLINE_KEEP is a folder");
    }
}

/// The text of [`random_scene`].
pub fn random_text(data: &[u8]) -> String {
    // bytes that run out are read as zeros: the first of all choices
    random::scene(&mut Unstructured::new(data)).unwrap_or_default()
}
