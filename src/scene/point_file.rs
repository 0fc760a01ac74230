//! Bodies of points from a file: a place and a volume each, without a mesh.
//!
//! Each point becomes a cell of its own, a segment, square or cube of its volume around it, so that all that acts on cells and the points at their
//! centroids acts on it: materials, conditions inside of shapes, cracks and voids, masses. These cells overlap and leave gaps where points are no
//! lattice; so the body has no surface, and nothing cuts bonds but cracks and voids.

use std::path::Path;

use rustc_hash::FxHashMap;

use super::error::{SceneError, closest};
use super::meshing;
use super::source::Span;
use super::spec::{PointFileSpec, PointsSpec, SceneSpec, ZonesNeeded};
use super::table_rows;
use super::value::Text;
use crate::mesh::{Mesh, read};
use crate::model::{Surfaces, Zone, bin_of};
use crate::regular_file;
use crate::tensor::Vector;

/// Distance, in edges of a mean cell, below which two points lie at one place.
const SAME_PLACE: f64 = 1e-6;

/// The most points of a body: the corners of their cells are numbered by 32 bits.
const MOST_POINTS: usize = 100_000_000;

/// The file of the points of a scene, if it names one.
pub(crate) fn of(spec: &SceneSpec) -> Option<&PointFileSpec> {
    match spec.peridynamics.as_ref()?.points.as_ref()? {
        PointsSpec::File(file) => Some(file),
        PointsSpec::Cells | PointsSpec::Lattice(_) => None,
    }
}

/// Refuses what a body of such points cannot have: a mesh beside it, and finite elements.
///
/// # Errors
/// [`SceneError`] for a mesh, for surfaces that cut bonds, for a coupling other than `nonlocal`, for a zone that the program places, and for an accuracy.
fn check(spec: &SceneSpec, file: &PointFileSpec) -> Result<(), SceneError> {
    let conflict = |what: &str, span: Span, help: &str| {
        Err(SceneError::conflict(format!(
            "the points of `peridynamics.points.file` are the whole body, and the scene has {what}"
        ))
        .label(span, "does not go with them")
        .label(file.path.span.clone(), "these points")
        .help(help))
    };
    if spec.mesh.is_some() {
        let help = "leave out [mesh], or take the points from it: points = \"cells\", or a lattice";
        return conflict("a `mesh` too", file.path.span.clone(), help);
    }
    if let Some(accuracy) = &spec.accuracy {
        let help = "leave out `accuracy`: points from a file get no finer";
        return conflict("an `accuracy`", accuracy.span.clone(), help);
    }
    if let Some(auto) = &spec.zones.auto {
        let help = "leave out `zones`: all of the body is nonlocal";
        return conflict("a zone that is placed by itself", auto.span(), help);
    }
    let surfaces = spec.peridynamics.as_ref().and_then(|p| p.surfaces.as_ref());
    if let Some(typed) = surfaces.filter(|typed| *typed.get_ref() == Surfaces::Cut) {
        let help = "leave out `surfaces`: such a body has none; a void or a crack cuts bonds";
        return conflict("surfaces that cut bonds", typed.span(), help);
    }
    match &spec.coupling {
        Some(typed)
            if typed.get_ref().traits().zones != ZonesNeeded::Everywhere(Zone::Nonlocal) =>
        {
            let help = "use coupling = \"nonlocal\", or leave it out; elements need a [mesh]";
            conflict("a coupling with finite elements", typed.span(), help)
        }
        _ => Ok(()),
    }
}

/// The body of a scene whose points come from a file in `directory`.
///
/// # Errors
/// [`SceneError`] with file and line for a column that is missing, a file without rows, a number that is not finite, a volume that is not above zero, and
/// two points at one place; and for parts of the scene that need a mesh.
pub(crate) fn body<const D: usize>(
    spec: &SceneSpec,
    file: &PointFileSpec,
    directory: &Path,
) -> Result<Mesh<D>, SceneError> {
    check(spec, file)?;
    let path = directory.join(&file.path.value);
    let is_vtk = path.extension().is_some_and(|e| {
        ["vtk", "vtu"]
            .iter()
            .any(|known| e.eq_ignore_ascii_case(known))
    });
    let cloud = match is_vtk {
        true => from_vtk(file, &path)?,
        false => from_csv(file, &path)?,
    };
    cloud.check(file, &path)?;
    let mesh = Mesh::of_boxes(&cloud.position, &cloud.volume);
    meshing::can_be_computed_with(&mesh)?;
    Ok(mesh)
}

/// The error of a file, with the place in it.
fn wrong(file: &PointFileSpec, path: &Path, what: &str, help: &str) -> SceneError {
    SceneError::file(format!(
        "`peridynamics.points.file`: {}{what}",
        path.display()
    ))
    .label(file.path.span.clone(), "this file")
    .help(help)
}

/// Points as they are read.
struct PointList<const D: usize> {
    position: Vec<Vector<D>>,
    volume: Vec<f64>,
    /// The line of each point, from 1; empty of a file whose points have numbers.
    line: Vec<usize>,
}

impl<const D: usize> PointList<D> {
    /// The place of a point in its file.
    fn place(&self, point: usize) -> String {
        match self.line.get(point) {
            Some(line) => format!("line {line}"),
            None => format!("point {point}"),
        }
    }

    /// Refuses a list that is no body.
    fn check(&self, file: &PointFileSpec, path: &Path) -> Result<(), SceneError> {
        let count = self.position.len();
        let refuse = |what: String, help: &str| Err(wrong(file, path, &what, help));
        if count == 0 {
            return refuse(
                " has no point".to_owned(),
                "give each point a row of its own",
            );
        }
        if count > MOST_POINTS {
            let what = format!(" has {count} points, more than {MOST_POINTS}");
            return refuse(what, "use fewer points");
        }
        for (k, (x, volume)) in self.position.iter().zip(&self.volume).enumerate() {
            if let Some(value) = x.iter().find(|v| !v.is_finite()) {
                let what = format!(", {}: the coordinate {value} is not finite", self.place(k));
                return refuse(what, "give finite coordinates");
            }
            if !(volume.is_finite() && *volume > 0.0) {
                let what = format!(", {}: the volume {volume}", self.place(k));
                return refuse(what, VOLUME[D - 1]);
            }
        }
        let mean = self.volume.iter().sum::<f64>() / count as f64;
        match self.twins(SAME_PLACE * mean.powf(1.0 / D as f64)) {
            None => Ok(()),
            Some([first, second]) => {
                let (one, other) = (self.place(first), self.place(second));
                let what = format!(
                    ", {other}: the point lies at {:?}, where that of {one} lies",
                    self.position[second].as_slice()
                );
                refuse(what, "leave out one of the two, or move it")
            }
        }
    }

    /// Two points within a distance of each other, or hardly farther apart, if there are any.
    fn twins(&self, distance: f64) -> Option<[usize; 2]> {
        // the box of all places within the distance meets two such bins along an axis at the most
        let size = 2.0 * distance;
        let mut bins: FxHashMap<[i64; D], usize> = FxHashMap::default();
        for (k, x) in self.position.iter().enumerate() {
            for corner in 0..1 << D {
                let side = |a: usize| if corner >> a & 1 == 0 { -1.0 } else { 1.0 };
                let at = Vector::<D>::from_fn(|a, _| x[a] + distance * side(a));
                if let Some(&twin) = bins.get(&bin_of(&at, size)) {
                    return Some([twin, k]);
                }
            }
            bins.insert(bin_of(x, size), k);
        }
        None
    }
}

/// Requirement on volumes, by dimension.
const VOLUME: [&str; 3] = [
    "give each point a finite length above zero",
    "give each point a finite area above zero",
    "give each point a finite volume above zero",
];

/// The points of a VTK file.
fn from_vtk<const D: usize>(file: &PointFileSpec, path: &Path) -> Result<PointList<D>, SceneError> {
    let typed = [&file.x, &file.y, &file.z].into_iter().flatten().next();
    if let Some(column) = typed {
        return Err(
            SceneError::conflict("the points of a VTK file have their own coordinates")
                .label(column.span.clone(), "names a column")
                .help("leave out x, y and z; `volume` names an array of the points"),
        );
    }
    let volume = name(&file.volume, "volume");
    let found = read::points(path, volume).map_err(|error| {
        SceneError::file(format!("`peridynamics.points.file`: {error}"))
            .label(file.path.span.clone(), "this file")
    })?;
    let outside = |x: &[f64; 3]| (D..3).find(|&a| x[a] != 0.0);
    if let Some((k, x)) = found
        .coordinates
        .iter()
        .enumerate()
        .find(|(_, x)| outside(x).is_some())
    {
        let what = format!(", point {k}: {x:?} lies outside of the scene's {D} dimensions");
        return Err(wrong(
            file,
            path,
            &what,
            "give the coordinates beyond them the value 0",
        ));
    }
    Ok(PointList {
        position: (found.coordinates.iter())
            .map(|x| Vector::from_fn(|a, _| x[a]))
            .collect(),
        volume: found.values,
        line: Vec::new(),
    })
}

/// A name that is typed, or else the default.
fn name<'a>(typed: &'a Option<Text>, default: &'a str) -> &'a str {
    typed.as_ref().map_or(default, |text| &text.value)
}

/// The points of a table with the names of its columns in the first line.
fn from_csv<const D: usize>(file: &PointFileSpec, path: &Path) -> Result<PointList<D>, SceneError> {
    let text = regular_file::read_to_string(path).map_err(|error| {
        let what = format!(" cannot be read: {error}");
        wrong(file, path, &what, table_rows::remedy(&error))
    })?;
    let mut lines = table_rows::lines(&text).peekable();
    let is_number = |word: &&str| word.parse::<f64>().is_ok();
    let begins = lines
        .peek()
        .is_some_and(|(_, row)| row.iter().all(is_number));
    let commented = table_rows::commented_head(&text).filter(|_| begins);
    let Some((first, head)) = commented.or_else(|| lines.next()) else {
        let help = "name the columns in the first line, and give each point a row of its own";
        return Err(wrong(file, path, " has no line", help));
    };
    let names = [name(&file.x, "x"), name(&file.y, "y"), name(&file.z, "z")];
    let mut columns = Vec::with_capacity(D + 1);
    for wanted in names[..D]
        .iter()
        .copied()
        .chain([name(&file.volume, "volume")])
    {
        let known = || head.iter().map(|word| word.trim_matches('"'));
        let Some(column) = known().position(|word| word == wanted) else {
            let help = match closest(wanted, known()) {
                Some(name) => format!("did you mean `{name}`? Name it by x, y, z or volume of `peridynamics.points.file`"),
                None => "the first line names the columns; name those of coordinates and volume by x, y, z and volume of `peridynamics.points.file`".to_owned(),
            };
            let shown: Vec<&str> = known().take(10).collect();
            let what = format!(", line {first}: no column `{wanted}` among {shown:?}");
            return Err(wrong(file, path, &what, &help));
        };
        if known().filter(|word| *word == wanted).count() > 1 {
            let what = format!(", line {first}: two columns `{wanted}`");
            return Err(wrong(
                file,
                path,
                &what,
                "give each column a name of its own",
            ));
        }
        columns.push(column);
    }
    let mut list = PointList {
        position: Vec::new(),
        volume: Vec::new(),
        line: Vec::new(),
    };
    for (line, words) in lines {
        let refuse = |what: String| {
            let help = "each line holds a number for each column, with a decimal point, separated by commas, semicolons or blanks";
            wrong(file, path, &format!(", line {line}: {what}"), help)
        };
        if words.len() != head.len() {
            return Err(refuse(format!(
                "{} entries under {} columns",
                words.len(),
                head.len()
            )));
        }
        let mut row = [0.0; 4];
        for (value, &column) in row.iter_mut().zip(&columns) {
            let word = words[column].trim_matches('"');
            *value = word
                .parse()
                .map_err(|_| refuse(format!("`{word}` is no number")))?;
        }
        list.position.push(Vector::from_fn(|a, _| row[a]));
        list.volume.push(row[D]);
        list.line.push(line);
    }
    Ok(list)
}
