//! FE cells and PD points in one VTU file, as ParaView, VTK and meshio read it, and a PVD over several.
//!
//! PD points are cells of one node ([`CellShape::Vertex`]): a piece without cells can be read by nobody, and points and
//! cells so stand in one piece and share the fields. Arrays are inline binary, compressed by zlib, which all three readers
//! know (meshio knows no lz4).

use std::io::Write;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::ObserveError;
use super::atomic_file::write_whole;
pub use super::data_array::Compression;
use super::data_array::{Number, encoded};
use crate::mesh::{CellShape, Mesh};
use crate::tensor::{Tensor, Vector, padded};

/// Values of a field.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Reals; must be finite.
    Real(Vec<f64>),
    /// Small labels, such as the model of a point.
    Byte(Vec<u8>),
    /// Integers.
    Integer(Vec<i32>),
}

impl Values {
    /// Number of values: entries times components.
    pub fn len(&self) -> usize {
        match self {
            Self::Real(v) => v.len(),
            Self::Byte(v) => v.len(),
            Self::Integer(v) => v.len(),
        }
    }

    /// Whether there is no value.
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
    /// What ParaView lists.
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
        let mut values = vec![0.0; 9 * entries.len()];
        for (row, t) in values.chunks_exact_mut(9).zip(entries) {
            for i in 0..D {
                for j in 0..D {
                    row[3 * i + j] = t[(i, j)];
                }
            }
        }
        Self::reals(name, 9, values)
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
}

/// What one VTU file shows: points, cells, and fields over both.
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

/// The number that VTK gives a shape.
fn vtk_type(shape: CellShape) -> u8 {
    match shape {
        CellShape::Vertex => 1,
        CellShape::Line2 => 3,
        CellShape::Tri3 => 5,
        CellShape::Quad4 => 9,
        CellShape::Tet4 => 10,
        CellShape::Hex8 => 12,
        CellShape::Line3 => 21,
        CellShape::Tri6 => 22,
        CellShape::Quad8 => 23,
        CellShape::Tet10 => 24,
        CellShape::Hex20 => 25,
    }
}

/// The element of an array.
fn array<T: Number>(
    name: &str,
    components: usize,
    numbers: &[T],
    compression: Compression,
) -> std::io::Result<String> {
    let text = encoded(numbers, compression)?;
    let (kind, name) = (T::TYPE, escape(name));
    // meshio takes one component that is named for a matrix of one column
    let columns = match components {
        1 => String::new(),
        n => format!(" NumberOfComponents=\"{n}\""),
    };
    Ok(format!(
        "<DataArray type=\"{kind}\" Name=\"{name}\"{columns} format=\"binary\">{text}</DataArray>\n"
    ))
}

/// The elements of some fields.
fn arrays(fields: &[Field], compression: Compression) -> std::io::Result<Vec<String>> {
    let text = |field: &Field| {
        let (name, n) = (field.name.as_str(), field.components);
        match &field.values {
            Values::Real(v) => array(name, n, v, compression),
            Values::Byte(v) => array(name, n, v, compression),
            Values::Integer(v) => array(name, n, v, compression),
        }
    };
    fields.par_iter().map(text).collect()
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
        let types: Vec<u8> = snapshot.shapes.iter().map(|&s| vtk_type(s)).collect();
        let on_points = arrays(&snapshot.point_fields, compression)?;
        let on_cells = arrays(&snapshot.cell_fields, compression)?;
        let compressor = match compression {
            Compression::Plain => "",
            Compression::Zlib => " compressor=\"vtkZLibDataCompressor\"",
        };
        writeln!(
            out,
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\"{compressor}>\n<UnstructuredGrid>"
        )?;
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
        let vector = snapshot.point_fields.iter().find(|f| f.is_vector());
        // an active vector is what ParaView warps by at once
        let active =
            vector.map_or_else(String::new, |f| format!(" Vectors=\"{}\"", escape(&f.name)));
        writeln!(
            out,
            "<PointData{active}>\n{}</PointData>",
            on_points.concat()
        )?;
        writeln!(out, "<CellData>\n{}</CellData>", on_cells.concat())?;
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
            // a collection and its files are moved together
            let name = file.strip_prefix(folder).unwrap_or(file);
            writeln!(
                out,
                "    <DataSet timestep=\"{time:e}\" group=\"\" part=\"0\" file=\"{}\"/>",
                escape(&name.to_string_lossy())
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
mod tests {
    use vtkio::model;

    use super::*;

    /// `n` vertices, one cell of every other shape, and a field of every kind.
    fn sample(n: usize) -> Snapshot {
        let mut s = Snapshot {
            time: Some(0.125),
            ..Snapshot::default()
        };
        let cloud: Vec<Vector<3>> = (0..n)
            .map(|i| Vector::<3>::new(i as f64 / 7.0, (i as f64).sin(), -0.1 * i as f64))
            .collect();
        assert_eq!(s.push_vertices(&cloud), 0);
        for shape in [
            CellShape::Line2,
            CellShape::Tri3,
            CellShape::Quad4,
            CellShape::Tet4,
            CellShape::Hex8,
        ] {
            let nodes: Vec<u32> = (0..shape.node_count() as u32).collect();
            s.push_cell(shape, &nodes);
        }
        let m = s.shapes.len();
        s.point_fields = vec![
            Field::vector("displacement", &cloud),
            Field::labels("model", (0..n).map(|i| (i % 3) as u8).collect()),
            Field::integers("family size", (0..n as i32).map(|i| -i).collect()),
        ];
        let tensors: Vec<Tensor<2>> = (0..m)
            .map(|i| Tensor::<2>::new(1.0, 2.0, 3.0, i as f64))
            .collect();
        s.cell_fields = vec![
            Field::tensor("stress", &tensors),
            Field::scalar(
                "beta < 1 & \"odd\"",
                (0..m).map(|i| 1.0 / (i + 1) as f64).collect(),
            ),
        ];
        s
    }

    fn read(path: &Path) -> model::UnstructuredGridPiece {
        let model::DataSet::UnstructuredGrid { mut pieces, .. } =
            model::Vtk::import(path).unwrap().data
        else {
            panic!("not an unstructured grid");
        };
        pieces.remove(0).into_loaded_piece_data(None).unwrap()
    }

    fn reals(attribute: &model::Attribute) -> Vec<f64> {
        let model::Attribute::DataArray(array) = attribute else {
            panic!("not a data array");
        };
        array.data.cast_into::<f64>().unwrap()
    }

    fn expected(field: &Field) -> Vec<f64> {
        match &field.values {
            Values::Real(v) => v.clone(),
            Values::Byte(v) => v.iter().map(|&x| f64::from(x)).collect(),
            Values::Integer(v) => v.iter().map(|&x| f64::from(x)).collect(),
        }
    }

    #[test]
    fn everything_comes_back_bit_for_bit() {
        let folder = tempfile::tempdir().unwrap();
        // 4096 reals fill one zlib block of 32 KiB to the last byte
        for (n, compression) in [
            (9, Compression::Plain),
            (9, Compression::Zlib),
            (4096, Compression::Zlib),
            (5000, Compression::Zlib),
        ] {
            let s = sample(n);
            let path = folder.path().join(format!("out/{n}.vtu"));
            write_vtu(&path, &s, compression).unwrap();
            let piece = read(&path);
            assert_eq!(
                piece.points.cast_into::<f64>().unwrap(),
                s.points.as_flattened()
            );
            let (connectivity, offsets) = piece.cells.cell_verts.into_xml();
            let connectivity: Vec<u32> = connectivity.iter().map(|&c| c as u32).collect();
            assert_eq!(connectivity, s.connectivity);
            assert_eq!(offsets[n..], [2, 5, 9, 13, 21].map(|o| o + n as u64));
            let codes: Vec<u8> = piece.cells.types.iter().map(|&t| t as u8).collect();
            assert_eq!(codes[n - 1..], [1, 3, 5, 9, 10, 12]);
            for (fields, read) in [
                (&s.point_fields, &piece.data.point),
                (&s.cell_fields, &piece.data.cell),
            ] {
                assert_eq!(fields.len(), read.len());
                for (field, read) in fields.iter().zip(read) {
                    assert_eq!(field.name, read.name());
                    assert_eq!(expected(field), reals(read));
                }
            }
            let text = std::fs::read(&path).unwrap();
            let text = String::from_utf8_lossy(&text);
            assert!(text.contains("\"TimeValue\"") && text.contains(">1.25e-1<"));
        }
    }

    #[test]
    fn plane_vectors_and_tensors_are_filled_up_by_rows() {
        let v = Field::vector(
            "u",
            &[Vector::<2>::new(1.0, 2.0), Vector::<2>::new(3.0, 4.0)],
        );
        let vector = vec![1.0, 2.0, 0.0, 3.0, 4.0, 0.0];
        assert_eq!((v.components, v.values), (3, Values::Real(vector)));
        let t = Field::tensor("s", &[Tensor::<2>::new(1.0, 2.0, 3.0, 4.0)]);
        let rows = vec![1.0, 2.0, 0.0, 3.0, 4.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!((t.components, t.values), (9, Values::Real(rows)));
    }

    #[test]
    fn zlib_is_smaller() {
        let folder = tempfile::tempdir().unwrap();
        let size = |compression| {
            let path = folder.path().join("a.vtu");
            write_vtu(&path, &sample(5000), compression).unwrap();
            std::fs::metadata(&path).unwrap().len()
        };
        assert!(size(Compression::Zlib) < size(Compression::Plain) * 3 / 4);
    }

    #[test]
    fn what_does_not_fit_is_named_and_nothing_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bad.vtu");
        let message = |change: &dyn Fn(&mut Snapshot)| {
            let mut s = sample(9);
            change(&mut s);
            let error = write_vtu(&path, &s, Compression::Zlib).unwrap_err();
            assert!(!path.exists());
            error.to_string()
        };
        let short = message(&|s| s.point_fields[0].values = Values::Real(vec![0.0; 26]));
        assert!(
            short.contains("`displacement`") && short.contains("26 values where 27"),
            "{short}"
        );
        let nan = message(&|s| {
            let mut v = vec![0.0; 27];
            v[13] = f64::NAN;
            s.point_fields[0].values = Values::Real(v);
        });
        assert!(
            nan.contains("`displacement`") && nan.contains("NaN at entry 4"),
            "{nan}"
        );
        let stray = message(&|s| s.push_cell(CellShape::Line2, &[0, 9]));
        assert!(stray.contains("point 9 of 9"), "{stray}");
        let odd = message(&|s| s.shapes.push(CellShape::Tri3));
        assert!(odd.contains("ask for 33 node numbers, 30"), "{odd}");
        let twice = message(&|s| s.point_fields[1].name = "displacement".into());
        assert!(twice.contains("called `displacement`"), "{twice}");
        let none = message(&|s| *s = Snapshot::default());
        assert!(none.contains("no cells"), "{none}");
        let lost = message(&|s| s.points[3][1] = f64::INFINITY);
        assert!(
            lost.contains("`position`") && lost.contains("entry 3"),
            "{lost}"
        );
    }

    #[test]
    fn a_collection_names_its_files_relative_to_itself() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.pvd");
        let steps = [
            (0.0, folder.path().join("run/a&b.vtu")),
            (0.5, PathBuf::from("elsewhere.vtu")),
        ];
        write_pvd(&path, &steps).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(
            text.contains("timestep=\"0e0\" group=\"\" part=\"0\" file=\"run/a&amp;b.vtu\""),
            "{text}"
        );
        assert!(
            text.contains("timestep=\"5e-1\" group=\"\" part=\"0\" file=\"elsewhere.vtu\""),
            "{text}"
        );
        assert!(matches!(
            write_pvd(&path, &[]),
            Err(ObserveError::Empty { .. })
        ));
        let late = write_pvd(&path, &[(f64::NAN, PathBuf::from("a.vtu"))]);
        assert!(matches!(late, Err(ObserveError::NotFinite { .. })));
    }
}
