//! FE cells and PD points in one VTU file, as ParaView, VTK and meshio read it, a PVTU over several of one time, and a PVD over several times.
//!
//! PD points are cells of one node ([`CellShape::Vertex`]): a piece without cells can be read by nobody, and points and
//! cells so stand in one piece and share the fields. Arrays are inline binary, compressed by zlib, which all three readers
//! know (meshio knows no lz4).

use std::io::Write;
use std::path::{Path, PathBuf};

use super::ObserveError;
use super::atomic_file::write_whole;
pub use super::data_array::Compression;
use super::data_array::{Number, encoded};
use crate::tensor::{Tensor, Vector, padded};
use crate::{
    mesh::{CellShape, Mesh},
    parallel,
};

/// Values of a field.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Reals; must be finite.
    Real(Vec<f64>),
    /// Small labels, such as the model of a point.
    Byte(Vec<u8>),
    /// Integers.
    Integer(Vec<i32>),
    /// Numbers of points or cells among those of a larger data set, each once.
    Identifier(Vec<i64>),
}

impl Values {
    /// Number of values: entries times components.
    pub fn len(&self) -> usize {
        match self {
            Self::Real(v) => v.len(),
            Self::Byte(v) => v.len(),
            Self::Integer(v) => v.len(),
            Self::Identifier(v) => v.len(),
        }
    }

    /// The attributes of their type in VTK's XML; identifiers are of a type of their own there.
    fn type_attributes(&self) -> String {
        let (kind, more) = match self {
            Self::Real(_) => (f64::TYPE, ""),
            Self::Byte(_) => (u8::TYPE, ""),
            Self::Integer(_) => (i32::TYPE, ""),
            Self::Identifier(_) => (i64::TYPE, " IdType=\"1\""),
        };
        format!("type=\"{kind}\"{more}")
    }

    /// Returns true if there is no value.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A field over the points or the cells.
///
/// Shapes: `values` has `components` numbers per entry (1 scalar, 3 vector, 6 symmetric tensor in the order
/// xx yy zz xy yz xz, 9 tensor by rows).
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Name that ParaView lists.
    pub name: String,
    /// Numbers per entry.
    pub components: usize,
    /// The numbers, entry by entry.
    pub values: Values,
}

impl Field {
    /// One real per entry.
    pub fn scalar(name: &str, values: Vec<f64>) -> Self {
        Self::reals(name, 1, values)
    }

    /// `components` reals per entry.
    pub fn reals(name: &str, components: usize, values: Vec<f64>) -> Self {
        Self {
            name: name.to_owned(),
            components,
            values: Values::Real(values),
        }
    }

    /// One vector per entry, filled up with zeros to three components, as ParaView wants to warp by it.
    pub fn vector<const D: usize>(name: &str, entries: &[Vector<D>]) -> Self {
        let values = entries.iter().flat_map(padded).collect();
        Self::reals(name, 3, values)
    }

    /// One tensor per entry by rows, filled up with zeros to 3 × 3.
    pub fn tensor<const D: usize>(name: &str, entries: &[Tensor<D>]) -> Self {
        let entry = |t: &Tensor<D>, i, j| if i < D && j < D { t[(i, j)] } else { 0.0 };
        let rows = |t| std::array::from_fn(|i| std::array::from_fn(|j| entry(t, i, j)));
        Self::rows(name, entries.iter().map(rows))
    }

    /// One tensor of three dimensions per entry, by rows.
    pub fn rows(name: &str, entries: impl Iterator<Item = [[f64; 3]; 3]>) -> Self {
        Self::reals(name, 9, entries.flatten().flatten().collect())
    }

    fn is_vector(&self) -> bool {
        self.components == 3 && matches!(self.values, Values::Real(_))
    }

    /// One small label per entry.
    pub fn labels(name: &str, values: Vec<u8>) -> Self {
        Self {
            name: name.to_owned(),
            components: 1,
            values: Values::Byte(values),
        }
    }

    /// One integer per entry.
    pub fn integers(name: &str, values: Vec<i32>) -> Self {
        Self {
            name: name.to_owned(),
            components: 1,
            values: Values::Integer(values),
        }
    }

    /// One identifier per entry.
    pub fn identifiers(name: &str, values: Vec<i64>) -> Self {
        Self {
            name: name.to_owned(),
            components: 1,
            values: Values::Identifier(values),
        }
    }

    /// The attributes of its array: type, name, components.
    fn attributes(&self) -> String {
        attributes(&self.values.type_attributes(), &self.name, self.components)
    }
}

/// Content of one VTU file: points, cells, and fields over both.
///
/// Shapes: cell `c` takes the next `shapes[c].node_count()` entries of `connectivity`, in VTK's node order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// Positions: FE nodes and PD points.
    pub points: Vec<[f64; 3]>,
    /// Shape of each cell; each PD point has a [`CellShape::Vertex`].
    pub shapes: Vec<CellShape>,
    /// Points of all cells, one after another.
    pub connectivity: Vec<u32>,
    /// Fields with one entry per point.
    pub point_fields: Vec<Field>,
    /// Fields with one entry per cell.
    pub cell_fields: Vec<Field>,
    /// Time, if it means anything here.
    pub time: Option<f64>,
    /// Program and scene that it comes from, for a comment at the head of the file; empty if there is none.
    pub origin: String,
}

impl Snapshot {
    /// The nodes and cells of a mesh, without fields.
    pub fn of_mesh<const D: usize>(mesh: &Mesh<D>) -> Self {
        Self {
            points: mesh.nodes.iter().map(padded).collect(),
            shapes: mesh.shapes.clone(),
            connectivity: mesh.connectivity.clone(),
            ..Self::default()
        }
    }

    /// Appends a cell.
    pub fn push_cell(&mut self, shape: CellShape, points: &[u32]) {
        debug_assert_eq!(points.len(), shape.node_count());
        self.shapes.push(shape);
        self.connectivity.extend_from_slice(points);
    }

    /// Appends points, each with its vertex cell; returns the number of the first point.
    pub fn push_vertices<const D: usize>(&mut self, positions: &[Vector<D>]) -> u32 {
        let first = self.points.len() as u32;
        for (i, x) in positions.iter().enumerate() {
            self.points.push(padded(x));
            self.push_cell(CellShape::Vertex, &[first + i as u32]);
        }
        first
    }

    /// Refuses what no reader could use; errors name the file at `path`, whether or not it is written.
    ///
    /// # Errors
    /// [`ObserveError`]: no cells, cells or fields that do not fit, a value that is not finite.
    pub(crate) fn check(&self, path: &Path) -> Result<(), ObserveError> {
        if self.shapes.is_empty() {
            return Err(ObserveError::Empty {
                path: path.to_path_buf(),
                what: "the snapshot has no cells (a peridynamic point needs its vertex cell)",
            });
        }
        let wanted: usize = self.shapes.iter().map(|s| s.node_count()).sum();
        let cells = |message| ObserveError::Cells {
            path: path.to_path_buf(),
            message,
        };
        if wanted != self.connectivity.len() {
            return Err(cells(format!(
                "the shapes ask for {wanted} node numbers, {} are given",
                self.connectivity.len()
            )));
        }
        let count = self.points.len();
        if let Some(n) = self.connectivity.iter().find(|&&n| n as usize >= count) {
            return Err(cells(format!("point {n} of {count} is asked for")));
        }
        let finite = |field: &str, values: &[f64], components: usize| match values
            .iter()
            .position(|v| !v.is_finite())
        {
            Some(i) => Err(ObserveError::NotFinite {
                path: path.to_path_buf(),
                field: field.to_owned(),
                entry: i / components,
                value: values[i],
            }),
            None => Ok(()),
        };
        finite("position", self.points.as_flattened(), 3)?;
        for (fields, entries) in [
            (&self.point_fields, count),
            (&self.cell_fields, self.shapes.len()),
        ] {
            for (i, field) in fields.iter().enumerate() {
                let (expected, found) = (entries * field.components, field.values.len());
                if expected != found || field.components == 0 {
                    return Err(ObserveError::FieldLength {
                        path: path.to_path_buf(),
                        field: field.name.clone(),
                        expected,
                        found,
                    });
                }
                if fields[..i].iter().any(|other| other.name == field.name) {
                    return Err(ObserveError::FieldTwice {
                        path: path.to_path_buf(),
                        field: field.name.clone(),
                    });
                }
                if let Values::Real(values) = &field.values {
                    finite(&field.name, values, field.components)?;
                }
            }
        }
        Ok(())
    }
}

/// The attributes of an array of a type: its type, name and components.
fn attributes(kind: &str, name: &str, components: usize) -> String {
    // meshio takes one component that is named for a matrix of one column
    let columns = match components {
        1 => String::new(),
        n => format!(" NumberOfComponents=\"{n}\""),
    };
    format!("{kind} Name=\"{}\"{columns}", escape(name))
}

/// The element of an array.
fn array<T: Number>(
    name: &str,
    components: usize,
    numbers: &[T],
    compression: Compression,
) -> std::io::Result<String> {
    let kind = format!("type=\"{}\"", T::TYPE);
    let text = encoded(numbers, compression)?;
    Ok(element(&attributes(&kind, name, components), &text))
}

fn element(attributes: &str, text: &str) -> String {
    format!("<DataArray {attributes} format=\"binary\">{text}</DataArray>\n")
}

/// The elements of some fields.
fn arrays(fields: &[Field], compression: Compression) -> std::io::Result<Vec<String>> {
    let text = |field: &Field| {
        let text = match &field.values {
            Values::Real(v) => encoded(v, compression),
            Values::Byte(v) => encoded(v, compression),
            Values::Integer(v) => encoded(v, compression),
            Values::Identifier(v) => encoded(v, compression),
        };
        Ok(element(&field.attributes(), &text?))
    };
    parallel::try_map(fields.len(), 1, |k| text(&fields[k]))
}

/// The attributes that say which of some fields a reader takes for vectors and for identifiers.
fn active(fields: &[Field]) -> String {
    let of = |kind: &str, is_of: fn(&Field) -> bool| {
        let field = fields.iter().find(|f| is_of(f));
        field.map_or_else(String::new, |f| format!(" {kind}=\"{}\"", escape(&f.name)))
    };
    // an active vector is what ParaView warps by at once
    of("Vectors", Field::is_vector)
        + &of("GlobalIds", |f| matches!(f.values, Values::Identifier(_)))
}

/// Writes a snapshot; makes the folder if it is missing.
///
/// Shapes: as [`Snapshot`] says. Units: those of the scene; VTU knows none. The bytes do not depend on the number of threads.
///
/// # Errors
/// [`ObserveError`]: no cells, cells or fields that do not fit, a value that is not finite, a folder or file that cannot
/// be written. The file that lay at `path` before is then still there.
pub fn write_vtu(
    path: &Path,
    snapshot: &Snapshot,
    compression: Compression,
) -> Result<(), ObserveError> {
    snapshot.check(path)?;
    write_whole(path, |out| {
        let text = |name: &str, n: usize, numbers: &[i64]| array(name, n, numbers, compression);
        // meshio 5.3.5 makes floats of numbers without a sign
        let connectivity: Vec<i64> = snapshot.connectivity.iter().map(|&n| n.into()).collect();
        let ends = snapshot.shapes.iter().scan(0, |end, shape| {
            *end += shape.node_count() as i64;
            Some(*end)
        });
        let ends: Vec<i64> = ends.collect();
        let types: Vec<u8> = snapshot.shapes.iter().map(|s| s.vtk_type()).collect();
        let on_points = arrays(&snapshot.point_fields, compression)?;
        let on_cells = arrays(&snapshot.cell_fields, compression)?;
        let compressor = match compression {
            Compression::Plain => "",
            Compression::Zlib => " compressor=\"vtkZLibDataCompressor\"",
        };
        writeln!(
            out,
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\"{compressor}>"
        )?;
        if !snapshot.origin.is_empty() {
            writeln!(out, "<!-- {} -->", snapshot.origin)?;
        }
        writeln!(out, "<UnstructuredGrid>")?;
        if let Some(t) = snapshot.time {
            writeln!(
                out,
                "<FieldData><DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">{t:e}</DataArray></FieldData>"
            )?;
        }
        let (points, cells) = (snapshot.points.len(), snapshot.shapes.len());
        writeln!(
            out,
            "<Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\">"
        )?;
        for (kind, fields, arrays) in [
            ("PointData", &snapshot.point_fields, on_points),
            ("CellData", &snapshot.cell_fields, on_cells),
        ] {
            let (active, arrays) = (active(fields), arrays.concat());
            writeln!(out, "<{kind}{active}>\n{arrays}</{kind}>")?;
        }
        let positions = array("Points", 3, snapshot.points.as_flattened(), compression)?;
        writeln!(out, "<Points>\n{positions}</Points>")?;
        let numbers = [
            text("connectivity", 1, &connectivity)?,
            text("offsets", 1, &ends)?,
            array("types", 1, &types, compression)?,
        ];
        writeln!(out, "<Cells>\n{}</Cells>", numbers.concat())?;
        writeln!(out, "</Piece>\n</UnstructuredGrid>\n</VTKFile>")
    })
}

/// Writes what makes one data set of VTU files of the same fields; the files are named relative to it.
///
/// `like` is one of their snapshots, of which only the fields count.
///
/// # Errors
/// [`ObserveError::Empty`] without files, or what stops the file from being written.
pub fn write_pvtu(path: &Path, pieces: &[PathBuf], like: &Snapshot) -> Result<(), ObserveError> {
    if pieces.is_empty() {
        return Err(ObserveError::Empty {
            path: path.to_path_buf(),
            what: "no process has cells",
        });
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    write_whole(path, |out| {
        writeln!(
            out,
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"PUnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n  <PUnstructuredGrid GhostLevel=\"0\">"
        )?;
        for (kind, fields) in [
            ("PPointData", &like.point_fields),
            ("PCellData", &like.cell_fields),
        ] {
            writeln!(out, "    <{kind}{}>", active(fields))?;
            for field in fields {
                writeln!(out, "      <PDataArray {}/>", field.attributes())?;
            }
            writeln!(out, "    </{kind}>")?;
        }
        let positions = attributes("type=\"Float64\"", "Points", 3);
        writeln!(
            out,
            "    <PPoints>\n      <PDataArray {positions}/>\n    </PPoints>"
        )?;
        for piece in pieces {
            let name = relative(piece, folder);
            writeln!(out, "    <Piece Source=\"{name}\"/>")?;
        }
        writeln!(out, "  </PUnstructuredGrid>\n</VTKFile>")
    })
}

/// A file as one in `folder` names it: both are moved together.
fn relative(file: &Path, folder: &Path) -> String {
    let name = file.strip_prefix(folder).unwrap_or(file);
    escape(&name.to_string_lossy())
}

/// Writes a collection of VTU files, which ParaView opens as one; the files are named relative to the collection.
///
/// Shapes: one pair of time and file per step, in the order of time.
///
/// # Errors
/// [`ObserveError::Empty`] without files, [`ObserveError::NotFinite`] for a time, or what stops the file from being written.
pub fn write_pvd(path: &Path, steps: &[(f64, PathBuf)]) -> Result<(), ObserveError> {
    if steps.is_empty() {
        return Err(ObserveError::Empty {
            path: path.to_path_buf(),
            what: "the collection lists no files",
        });
    }
    if let Some(entry) = steps.iter().position(|s| !s.0.is_finite()) {
        return Err(ObserveError::NotFinite {
            path: path.to_path_buf(),
            field: "time".to_owned(),
            entry,
            value: steps[entry].0,
        });
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    write_whole(path, |out| {
        writeln!(out, "<?xml version=\"1.0\"?>")?;
        writeln!(
            out,
            "<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n  <Collection>"
        )?;
        for (time, file) in steps {
            let name = relative(file, folder);
            writeln!(
                out,
                "    <DataSet timestep=\"{time:e}\" group=\"\" part=\"0\" file=\"{name}\"/>"
            )?;
        }
        writeln!(out, "  </Collection>\n</VTKFile>")
    })
}

/// Text for an XML attribute or element.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
#[path = "vtu_tests.rs"]
mod tests;
