//! The mesh of a scene: generated or read, and checked.

use std::collections::BTreeMap;
use std::path::Path;

use toml::Spanned;

use super::bounds_checks;
use super::error::{SceneError, closest};
use super::region::{corners, position};
use super::source::Span;
use super::spec::{
    AxisSpec, CutoutSpec, FileMeshSpec, MergeSpec, MeshSpec, PlaneCellSpec, SolidCellSpec,
};
use super::value::{Coordinates, Text};
use crate::fem;
use crate::mesh::generate::{Axis, CutOut, Grid, SIDES};
use crate::mesh::{Mesh, MeshError, Order, quality, read};
use crate::observe::checkpoint::Fingerprint;

/// The most cells that a generated mesh may have: beyond it a typing error is likelier than a wish.
const MOST_CELLS: f64 = 1e8;

/// A mesh that is read from a file, or that the scene was given in memory.
fn from_file<const D: usize>(
    file: &FileMeshSpec,
    directory: &Path,
    may_touch: bool,
) -> Result<Mesh<D>, SceneError> {
    let path = directory.join(&file.path.value);
    let failed = |error: MeshError, numbers: String| {
        let told = SceneError::mesh(format!("`mesh.file.path`: {error}"))
            .label(file.path.span.clone(), "this mesh");
        match (&error, similar(&path)) {
            _ if !numbers.is_empty() => told.help(numbers),
            (MeshError::Open { .. }, Some(name)) => told.help(format!(
                "did you mean `{name}`? The path is relative to the scene file"
            )),
            (MeshError::Open { .. }, None) => told.help("the path is relative to the scene file"),
            // a file that is read says itself what is wrong with it
            _ => told,
        }
    };
    let mut mesh: Mesh<D> = match &file.held {
        Some(parts) => parts.mesh_of(file.order).map_err(|error| {
            SceneError::mesh(format!("`mesh`: {error}"))
                .help("the scene was given this mesh in memory")
        })?,
        None => {
            let unread = |error| failed(error, String::new());
            let options = options(file);
            let mut mesh = read::read_with(&path, &options).map_err(unread)?;
            let keeps = file.merge == Some(MergeSpec::Keep);
            quality::check_bodies(&mesh, may_touch, keeps).map_err(|error| {
                let numbers = numbers_in_file::<D>(&path, &options, &error);
                failed(error, numbers)
            })?;
            if !keeps {
                let cracks = mesh.note_on_cracks();
                mesh.notes.extend(cracks);
            }
            mesh
        }
    };
    let is_second = mesh.shapes.iter().all(|shape| shape.is_quadratic());
    if file.order == Order::Second && !is_second {
        mesh.raise_order();
    }
    // corners do not tell of a side that is curved too far
    fem::check(&mesh, |c| mesh.shapes[c].is_quadratic()).map_err(|error| {
        SceneError::mesh(format!("`mesh.file.path`: {error}"))
            .label(file.path.span.clone(), "this mesh")
            .help("straighten the sides of the cell, refine the mesh there, or set order = \"linear\"")
    })?;
    Ok(mesh)
}

/// The options of a reader, by the keys of `mesh.file`.
fn options(file: &FileMeshSpec) -> read::Options {
    read::Options {
        order: file.order,
        ignore: file.ignore.iter().map(|word| word.value.clone()).collect(),
        merge: match file.merge {
            Some(MergeSpec::Within(distance)) => Some(distance),
            Some(MergeSpec::Keep) | None => None,
        },
    }
}

/// The numbers that the file gives to the cells and nodes of an error; empty of an error without any.
fn numbers_in_file<const D: usize>(
    path: &Path,
    options: &read::Options,
    error: &MeshError,
) -> String {
    let [cells, nodes] = error.numbers();
    let Ok(numbers) = read::numbers_in_file::<D>(path, options, (&cells, &nodes)) else {
        return String::new();
    };
    let told = [("element", &numbers[0]), ("node", &numbers[1])]
        .into_iter()
        .flat_map(|(what, tags)| tags.iter().map(move |tag| format!("{what} {tag}")));
    let told: Vec<String> = told.collect();
    match told.is_empty() {
        true => String::new(),
        false => format!("by the numbers of the file: {}", told.join(", ")),
    }
}

/// The file beside a missing one whose name is most like its own.
fn similar(path: &Path) -> Option<String> {
    let wanted = path.file_name()?.to_str()?;
    if path.exists() {
        return None;
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let names = std::fs::read_dir(folder.unwrap_or(Path::new(".")))
        .ok()?
        .flatten();
    let names: Vec<String> = names
        .filter_map(|e| e.file_name().into_string().ok())
        .collect();
    closest(wanted, names.iter().map(String::as_str)).map(str::to_owned)
}

fn raised<const D: usize>(mut mesh: Mesh<D>) -> Mesh<D> {
    mesh.raise_order();
    mesh
}

/// The error of a scene without a body.
pub(crate) fn missing() -> SceneError {
    SceneError::missing("the scene lacks `mesh`")
        .label(0..0, "not found in this scene")
        .help("add [mesh.line], [mesh.rectangle], [mesh.box] or [mesh.file]; or peridynamics.points.file, whose points are the body")
}

/// The mesh of a scene whose file lies in `directory`.
pub(crate) fn build<const D: usize>(
    spec: &MeshSpec,
    directory: &Path,
    kinematics: &Span,
    may_touch: bool,
) -> Result<Mesh<D>, SceneError> {
    let dimension = |wanted: usize, name: &str, min: &Coordinates| {
        if wanted == D {
            return Ok(());
        }
        Err(SceneError::dimension(format!(
            "`mesh.{name}` is of dimension {wanted}, the scene's kinematics are of dimension {D}"
        ))
        .label(kinematics.clone(), format!("dimension {D}"))
        .label(min.span.clone(), format!("dimension {wanted}"))
        .help(format!(
            "use [mesh.{}], or another `kinematics`",
            ["line", "rectangle", "box"][D - 1]
        )))
    };
    let mesh = match spec {
        MeshSpec::Line(m) => {
            dimension(1, "line", &m.min)?;
            generate("mesh.line", &m.min, &m.max, &[&m.x], &m.cutouts, Boxes)?
        }
        MeshSpec::Rectangle(m) => {
            dimension(2, "rectangle", &m.min)?;
            let cells = match m.cell {
                PlaneCellSpec::Quad4 | PlaneCellSpec::Quad8 => Boxes,
                PlaneCellSpec::Tri3 | PlaneCellSpec::Tri6 => Simplices,
            };
            let is_raised = matches!(m.cell, PlaneCellSpec::Quad8 | PlaneCellSpec::Tri6);
            let mesh = generate(
                "mesh.rectangle",
                &m.min,
                &m.max,
                &[&m.x, &m.y],
                &m.cutouts,
                cells,
            )?;
            if is_raised { raised(mesh) } else { mesh }
        }
        MeshSpec::Box(m) => {
            dimension(3, "box", &m.min)?;
            let cells = match m.cell {
                SolidCellSpec::Hex8 | SolidCellSpec::Hex20 => Boxes,
                SolidCellSpec::Tet4 | SolidCellSpec::Tet10 => Simplices,
            };
            let is_raised = matches!(m.cell, SolidCellSpec::Hex20 | SolidCellSpec::Tet10);
            let mesh = generate(
                "mesh.box",
                &m.min,
                &m.max,
                &[&m.x, &m.y, &m.z],
                &m.cutouts,
                cells,
            )?;
            if is_raised { raised(mesh) } else { mesh }
        }
        MeshSpec::File(file) => from_file(file, directory, may_touch)?,
    };
    can_be_computed_with(&mesh)?;
    if !matches!(spec, MeshSpec::File(_)) {
        quality::check_thickness(&mesh).map_err(|error| {
            SceneError::mesh(format!("`mesh`: {error}"))
                .help("divide the longer axis into more cells, or the shorter into fewer")
        })?;
    }
    Ok(mesh)
}

/// Lengths beyond whose powers (volumes, moments of bonds) numbers overflow or vanish.
const SMALLEST: f64 = 1e-40;
const LARGEST: f64 = 1e40;

pub(super) fn can_be_computed_with<const D: usize>(mesh: &Mesh<D>) -> Result<(), SceneError> {
    let (lo, hi) = mesh.bounds();
    let extent = (hi - lo).amax();
    let farthest = lo.amax().max(hi.amax());
    if extent >= SMALLEST && farthest <= LARGEST {
        return Ok(());
    }
    Err(SceneError::mesh(format!("`mesh` is {extent:e} long and reaches {farthest:e} from the origin"))
        .help(format!("choose units in which lengths lie between {SMALLEST:e} and {LARGEST:e}: their powers are no numbers otherwise")))
}

#[derive(Clone, Copy, PartialEq)]
enum Cells {
    Boxes,
    Simplices,
}
use Cells::{Boxes, Simplices};

fn generate<const D: usize>(
    place: &str,
    min: &Coordinates,
    max: &Coordinates,
    axes: &[&Spanned<AxisSpec>],
    cutouts: &BTreeMap<Text, CutoutSpec>,
    cells: Cells,
) -> Result<Mesh<D>, SceneError> {
    let (lo, hi) = corners::<D>(place, min, max)?;
    let mut lines = Vec::with_capacity(D);
    let mut total = 1.0;
    for (k, spec) in axes.iter().enumerate().take(D) {
        let name = ["x", "y", "z"][k];
        let (line, count) = axis(&format!("{place}.{name}"), lo[k], hi[k], spec)?;
        lines.push(line);
        total *= count;
        if total > MOST_CELLS {
            return Err(SceneError::wrong_value(format!(
                "`{place}` would have more than {total:.1e} cells"
            ))
            .label(spec.span(), "too fine")
            .help(format!(
                "ask for fewer cells; the limit is {MOST_CELLS:.0e}"
            )));
        }
    }
    let Ok(lines) = <[Axis; D]>::try_from(lines) else {
        return Err(
            SceneError::dimension(format!("`{place}` does not divide every axis"))
                .help("give x, y and z as far as the dimension goes"),
        );
    };
    let mut grid = Grid::new(lines);
    if cells == Simplices {
        grid.simplices();
    }
    for (name, cutout) in cutouts {
        let at = format!("{place}.cutouts.{name}");
        if SIDES[..2 * D].contains(&name.value.as_str()) {
            return Err(SceneError::wrong_value(format!(
                "`{at}` has the name of a side of the mesh, whose set it would join"
            ))
            .label(name.span.clone(), "a side")
            .help("give the cutout another name, such as `hole`"));
        }
        let (min, max) = corners::<D>(&at, &cutout.min, &cutout.max)?;
        grid.cut_out(CutOut {
            name: name.value.clone(),
            min,
            max,
        });
    }
    grid.mesh().map_err(|error| {
        let span = match &error {
            MeshError::Axis { axis, .. } => ["x", "y", "z"]
                .iter()
                .position(|n| n.starts_with(*axis))
                .and_then(|k| axes.get(k))
                .map(|a| a.span()),
            MeshError::CutOutOffGrid { name, .. } | MeshError::CutOutEmpty { name, .. } => cutouts
                .get_key_value(name.as_str())
                .map(|(key, _)| key.span.clone()),
            _ => None,
        };
        SceneError::mesh(format!("`{place}`: {error}"))
            .label(span.unwrap_or(min.span.clone()), "here")
    })
}

/// The axis and about how many cells it has.
fn axis(
    place: &str,
    min: f64,
    max: f64,
    spec: &Spanned<AxisSpec>,
) -> Result<(Axis, f64), SceneError> {
    let length = max - min;
    match spec.get_ref() {
        AxisSpec::Cells(count) if count.value == 0 => {
            Err(SceneError::wrong_value(format!("`{place}.cells` is 0"))
                .label(count.span.clone(), "no cells")
                .help("ask for at least 1 cell"))
        }
        AxisSpec::Cells(count) => Ok((
            Axis::Uniform {
                min,
                max,
                cells: count.value,
            },
            count.value as f64,
        )),
        AxisSpec::Spacing(spacing) => {
            let h = bounds_checks::positive(&format!("{place}.spacing"), spacing)?;
            let count = (length / h).round().max(1.0);
            // `as` saturates; the total is refused before anything is allocated
            let cells = count as usize;
            Ok((Axis::Uniform { min, max, cells }, count))
        }
        AxisSpec::Graded(g) => {
            let fine = position::<2>(&format!("{place}.graded.fine"), &g.fine)?;
            let spacing = bounds_checks::positive(&format!("{place}.graded.spacing"), &g.spacing)?;
            let ratio = match &g.growth {
                Some(growth) => bounds_checks::within(
                    &format!("{place}.graded.growth"),
                    growth,
                    growth.value >= 1.0,
                    "must be at least 1",
                    "1.2 to 1.5 suits most meshes; 1 keeps all cells fine",
                )?,
                None => 1.3,
            };
            let largest = match &g.largest {
                Some(largest) => {
                    bounds_checks::positive(&format!("{place}.graded.largest"), largest)?
                }
                None => length,
            };
            let outside = (length - (fine[1] - fine[0])).max(0.0);
            let growing = if ratio > 1.0 {
                2.0 * (outside / spacing).max(1.0).ln() / ratio.ln() + outside / largest
            } else {
                outside / spacing
            };
            Ok((
                Axis::Graded {
                    min,
                    max,
                    fine: [fine[0], fine[1]],
                    spacing,
                    ratio,
                    largest,
                },
                (fine[1] - fine[0]).abs() / spacing + growing,
            ))
        }
    }
}

/// Adds a mesh to the fingerprint of a scene: one from a file may change while its name stays.
pub(crate) fn add_mesh<const D: usize>(mesh: &Mesh<D>, print: &mut Fingerprint) {
    for x in mesh.nodes.iter().flatten() {
        print.add(&x.to_le_bytes());
    }
    for n in &mesh.connectivity {
        print.add(&n.to_le_bytes());
    }
    for shape in &mesh.shapes {
        print.add(&[*shape as u8]);
    }
    // conditions, materials and zones are given by them
    let numbers = |list: &[u32]| -> Vec<u8> { list.iter().flat_map(|n| n.to_le_bytes()).collect() };
    for sets in [&mesh.cell_sets, &mesh.node_sets] {
        for (name, set) in sets {
            print.add(name.as_bytes());
            print.add(&numbers(set));
        }
        print.add(b"end of sets");
    }
    for (name, facets) in &mesh.facet_sets {
        print.add(name.as_bytes());
        for facet in facets {
            print.add(&numbers(facet));
        }
    }
}
