//! VTK legacy files of grids (`.vtk`), unstructured or in rows, columns and layers, ASCII and binary, of versions 1 to 5.
//!
//! Source: the VTK user's guide, "Simple legacy formats"; `vtkDataWriter` for the names of types that it leaves out (`vtktypeint64`, `vtkIdType`) and for
//! version 5, whose cells are offsets and connectivity. Binary numbers have the most significant byte first. Everything but points, cells and
//! integers per cell is skipped.

use std::path::Path;

use super::MeshError;
use crate::mesh::raw::{Encoding, Source};
use crate::mesh::vtk_grid::{Grid, Kind, Number, Points};
use crate::mesh::vtk_structured::Extent;

mod structured;

/// Remedy for a wrong word in a file.
const REWRITE: &str = "write the file again, for instance with VTK, ParaView or meshio";

/// Parses a file.
pub(super) fn parse<'a>(path: &Path, bytes: &'a [u8]) -> Result<(Grid, Source<'a>), MeshError> {
    let mut reader = Reader::new(path, bytes);
    reader.file()?;
    reader.take_cells()?;
    Ok((reader.grid, reader.source))
}

/// The coordinates of all points of a file, and the number that the point array `name` has for each; cells may be missing.
pub(super) fn points<'a>(path: &Path, bytes: &'a [u8], name: &'a str) -> Result<Points, MeshError> {
    let mut reader = Reader::new(path, bytes);
    reader.wanted = Some(name);
    reader.file()?;
    let values = reader.values.take().ok_or_else(|| {
        let wanted = format!("POINT_DATA with the array `{name}` of one number per point");
        reader.syntax(reader.grid.at, "a grid without it", &wanted)
    })?;
    let coordinates = reader.points.chunks_exact(3);
    if values.len() != coordinates.len() {
        let found = format!("{} numbers in the array `{name}`", values.len());
        let wanted = format!("{}, one per point,", coordinates.len());
        return Err(reader.syntax(reader.grid.at, &found, &wanted));
    }
    Ok(Points {
        coordinates: coordinates.map(|x| [x[0], x[1], x[2]]).collect(),
        values,
    })
}

impl<'a> Reader<'a> {
    fn new(path: &Path, bytes: &'a [u8]) -> Self {
        Self {
            source: Source {
                path: path.into(),
                bytes,
                encoding: Encoding::Text,
                pieces: &[],
            },
            at: 0,
            section: "the head of the file".into(),
            points: Vec::new(),
            grid: Grid::default(),
            of_cells: None,
            set: DataSet::Unstructured,
            extent: None,
            image: [None; 2],
            planes: Default::default(),
            wanted: None,
            values: None,
        }
    }
}

/// Kinds of data sets that are read.
#[derive(Clone, Copy, Debug, PartialEq)]
enum DataSet {
    Unstructured,
    Structured,
    Rectilinear,
    Image,
}

impl DataSet {
    /// The sections that one has.
    fn sections(self) -> &'static [&'static str] {
        match self {
            Self::Unstructured => &["DATASET", "POINTS", "CELLS", "CELL_TYPES"],
            Self::Structured => &["DATASET", "DIMENSIONS", "POINTS"],
            Self::Rectilinear => &[
                "DATASET",
                "DIMENSIONS",
                "X_COORDINATES",
                "Y_COORDINATES",
                "Z_COORDINATES",
            ],
            Self::Image => &["DATASET", "DIMENSIONS", "ORIGIN", "SPACING"],
        }
    }
}

struct Reader<'a> {
    source: Source<'a>,
    at: usize,
    section: String,
    points: Vec<f64>,
    grid: Grid,
    /// True while data of cells follow, false for those of points; none before any data.
    of_cells: Option<bool>,
    set: DataSet,
    /// Of a set in rows, columns and layers.
    extent: Option<Extent>,
    /// Origin and spacing of an image.
    image: [Option<[f64; 3]>; 2],
    /// Coordinates of the planes of a rectilinear grid.
    planes: [Vec<f64>; 3],
    /// The array of points that is read.
    wanted: Option<&'a str>,
    /// Its values.
    values: Option<Vec<f64>>,
}

impl<'a> Reader<'a> {
    fn file(&mut self) -> Result<(), MeshError> {
        let first = self.line();
        if !first.starts_with("# vtk DataFile Version") {
            return Err(self.syntax(0, first, "# vtk DataFile Version"));
        }
        self.line();
        let at = self.at;
        let line = self.line();
        if line.eq_ignore_ascii_case("BINARY") {
            self.source.encoding = Encoding::Binary;
        } else if !line.eq_ignore_ascii_case("ASCII") {
            return Err(self.syntax(at, line, "ASCII or BINARY"));
        }
        let mut seen: Vec<String> = Vec::new();
        loop {
            let at = self.next();
            if at == self.source.bytes.len() {
                break;
            }
            let keyword = self.word("a keyword")?.to_ascii_uppercase();
            self.section = keyword.clone();
            let is_once = self.set.sections().contains(&keyword.as_str());
            if is_once && seen.contains(&keyword) {
                return Err(self.syntax(at, &format!("a second {keyword}"), "one grid per file"));
            }
            match keyword.as_str() {
                "DATASET" => self.data_set(at)?,
                "DIMENSIONS" => self.dimensions(at)?,
                "ORIGIN" => self.image[0] = Some(self.triple("the origin")?),
                "SPACING" => self.image[1] = Some(self.triple("the spacing")?),
                "X_COORDINATES" => self.planes[0] = self.coordinates(1)?,
                "Y_COORDINATES" => self.planes[1] = self.coordinates(1)?,
                "Z_COORDINATES" => self.planes[2] = self.coordinates(1)?,
                "POINTS" => {
                    self.points = self.coordinates(3)?;
                    self.grid.points = self.points.len() as u64 / 3;
                }
                "CELLS" => self.cells()?,
                "CELL_TYPES" => self.cell_types()?,
                "CELL_DATA" | "POINT_DATA" => {
                    self.count("the number of entries")?;
                    self.of_cells = Some(keyword == "CELL_DATA");
                }
                "FIELD" => self.field()?,
                "METADATA" => self.skip_metadata(),
                _ => self.attribute(at, &keyword)?,
            }
            seen.push(keyword);
        }
        let needed: &[&str] = match self.wanted {
            Some(_) => &["DATASET", "POINTS"],
            None => self.set.sections(),
        };
        for &wanted in needed {
            if !seen.iter().any(|s| s == wanted) {
                self.section = "the file".into();
                return Err(self.truncated(&format!("a section {wanted}")));
            }
        }
        Ok(())
    }

    /// Takes the cells, and the points that they use.
    fn take_cells(&mut self) -> Result<(), MeshError> {
        if let Some(extent) = self.extent {
            return self.take_structured(&extent);
        }
        if self.grid.ends.len() != self.grid.types.len() {
            let found = format!(
                "{} cells with {} types",
                self.grid.ends.len(),
                self.grid.types.len()
            );
            return Err(self.syntax(self.at, &found, "one type per cell"));
        }
        self.grid.begin_points();
        for x in std::mem::take(&mut self.points) {
            self.grid.push_coordinate(x);
        }
        Ok(())
    }

    fn data_set(&mut self, at: usize) -> Result<(), MeshError> {
        let kind = self.word("the kind of data set")?;
        let known = [
            ("UNSTRUCTURED_GRID", DataSet::Unstructured),
            ("STRUCTURED_GRID", DataSet::Structured),
            ("RECTILINEAR_GRID", DataSet::Rectilinear),
            ("STRUCTURED_POINTS", DataSet::Image),
        ];
        let found = known
            .iter()
            .find(|(name, _)| kind.eq_ignore_ascii_case(name));
        if let Some((_, set)) = found {
            self.set = *set;
            self.grid.at = at;
            return Ok(());
        }
        Err(MeshError::Unsupported {
            path: self.source.path.clone(),
            place: self.source.place(at),
            what: format!("a VTK data set other than a grid ({kind})"),
            remedy: "convert it to an unstructured grid",
        })
    }

    fn cells(&mut self) -> Result<(), MeshError> {
        let (first, second) = (
            self.count("the number of cells")?,
            self.count("the size of their list")?,
        );
        let at = self.next();
        if self.source.bytes[at..].starts_with(b"OFFSETS") {
            return self.offsets(first, second);
        }
        let mut list = Vec::new();
        let at = self.at;
        self.each(INT, second, &mut |n| {
            list.push(n.integer());
            list.last() != Some(&None)
        })?;
        let mut rest = list.as_slice();
        while let [Some(count), tail @ ..] = rest {
            let Some((nodes, after)) = usize::try_from(*count)
                .ok()
                .and_then(|c| tail.split_at_checked(c))
            else {
                return Err(self.syntax(
                    at,
                    "a list of cells that ends early",
                    "the nodes of each cell",
                ));
            };
            for &node in nodes {
                let Some(node) = node.and_then(|n| u64::try_from(n).ok()) else {
                    return Err(self.syntax(at, "a negative node", "the number of a point"));
                };
                self.grid.nodes.push(node);
            }
            self.grid.ends.push(self.grid.nodes.len() as u64);
            rest = after;
        }
        if self.grid.ends.len() as u64 == first {
            return Ok(());
        }
        let found = format!("{} cells", self.grid.ends.len());
        Err(self.syntax(at, &found, &format!("{first}, as announced,")))
    }

    /// The cells of version 5: `count` offsets, of which the first one is 0, and `size` nodes.
    fn offsets(&mut self, count: u64, size: u64) -> Result<(), MeshError> {
        self.word("OFFSETS")?;
        let kind = self.kind()?;
        let at = self.at;
        let mut ends: Vec<u64> = Vec::new();
        let mut wrong = None;
        self.each(kind, count, &mut |n| {
            let last = ends.last().copied().unwrap_or(0);
            let end = n.integer().and_then(|n| u64::try_from(n).ok());
            match end.filter(|&e| e >= last && e <= size) {
                Some(end) => ends.push(end),
                None => wrong = Some(n),
            }
            wrong.is_none()
        })?;
        let all = ends.last().copied().unwrap_or(0);
        if wrong.is_some() || all != size {
            let found = wrong.map_or(format!("the last offset {all}"), |n| {
                format!("the offset {n}")
            });
            return Err(self.syntax(at, &found, &format!("offsets that grow from 0 to {size}")));
        }
        self.grid.ends = ends.split_off(1.min(ends.len()));
        let at = self.next();
        let word = self.word("CONNECTIVITY")?;
        if !word.eq_ignore_ascii_case("CONNECTIVITY") {
            return Err(self.syntax(at, &word, "CONNECTIVITY"));
        }
        let kind = self.kind()?;
        let at = self.at;
        let mut nodes = Vec::new();
        let mut wrong = None;
        self.each(kind, size, &mut |n| {
            match n.integer().and_then(|n| u64::try_from(n).ok()) {
                Some(node) => nodes.push(node),
                None => wrong = Some(n),
            }
            wrong.is_none()
        })?;
        if let Some(n) = wrong {
            return Err(self.syntax(at, &format!("the node {n}"), "the number of a point"));
        }
        self.grid.nodes = nodes;
        Ok(())
    }

    fn cell_types(&mut self) -> Result<(), MeshError> {
        let count = self.count("the number of types")?;
        let at = self.at;
        let mut types = Vec::new();
        let mut wrong = None;
        self.each(INT, count, &mut |n| {
            match n.integer().and_then(|n| u8::try_from(n).ok()) {
                Some(kind) => types.push(kind),
                None => wrong = Some(n),
            }
            wrong.is_none()
        })?;
        if let Some(n) = wrong {
            return Err(self.syntax(at, &format!("the cell type {n}"), "one of VTK's"));
        }
        self.grid.types = types;
        Ok(())
    }

    /// Arrays of several kinds under one head.
    fn field(&mut self) -> Result<(), MeshError> {
        self.word("the name of a field")?;
        for _ in 0..self.count("the number of arrays")? {
            let mut name = self.word("the name of an array")?;
            while name.eq_ignore_ascii_case("METADATA") {
                self.skip_metadata();
                name = self.word("the name of an array")?;
            }
            let components = self.count("the number of components")?;
            let tuples = self.count("the number of tuples")?;
            let kind = self.kind()?;
            self.array(
                (components == 1).then_some(name),
                kind,
                self.times(components, tuples)?,
            )?;
        }
        Ok(())
    }

    /// Skips the metadata of an array, up to an empty line.
    fn skip_metadata(&mut self) {
        self.line();
        while !self.line().is_empty() {}
    }

    /// Numbers that belong to points or cells.
    fn attribute(&mut self, at: usize, keyword: &str) -> Result<(), MeshError> {
        let entries = match self.of_cells {
            Some(true) => match self.extent.and_then(|extent| extent.count()) {
                Some(count) => count,
                None => self.grid.types.len() as u64,
            },
            Some(false) => self.grid.points,
            None => {
                return Err(self.syntax(at, keyword, "a section such as POINTS or CELL_DATA"));
            }
        };
        let known = [
            "SCALARS",
            "COLOR_SCALARS",
            "LOOKUP_TABLE",
            "VECTORS",
            "NORMALS",
            "TENSORS",
            "TENSORS6",
            "TEXTURE_COORDINATES",
            "GLOBAL_IDS",
            "PEDIGREE_IDS",
            "EDGE_FLAGS",
        ];
        if !known.contains(&keyword) {
            return Err(self.syntax(at, keyword, "a section such as SCALARS or FIELD"));
        }
        let name = self.word("the name of an array")?;
        let byte = Kind::Integer {
            bytes: 1,
            signed: false,
        };
        let is_text = self.source.encoding == Encoding::Text;
        let colour = if is_text {
            Kind::Real { bytes: 4 }
        } else {
            byte
        };
        match keyword {
            "COLOR_SCALARS" => {
                let components = self.count("the number of values")?;
                return self.array(None, colour, self.times(entries, components)?);
            }
            "LOOKUP_TABLE" => {
                let size = self.count("the size of a table")?;
                return self.array(None, colour, self.times(size, 4)?);
            }
            _ => {}
        }
        let mut components = match keyword {
            "VECTORS" | "NORMALS" => 3,
            "TENSORS" => 9,
            "TENSORS6" => 6,
            "TEXTURE_COORDINATES" => self.count("the number of coordinates")?,
            _ => 1,
        };
        let kind = self.kind()?;
        if keyword == "SCALARS" {
            let line = self.line();
            if !line.is_empty() {
                components = (line.parse())
                    .map_err(|_| self.syntax(at, line, "the number of components"))?;
            }
            let before = self.at;
            if self
                .word("LOOKUP_TABLE")?
                .eq_ignore_ascii_case("LOOKUP_TABLE")
            {
                self.word("the name of a table")?;
            } else {
                self.at = before;
            }
        }
        self.array(
            (components == 1).then_some(name),
            kind,
            self.times(entries, components)?,
        )
    }

    /// An array, which is kept where it has one number per cell and holds integers, or is the one of points that is wanted.
    fn array(&mut self, name: Option<String>, kind: Kind, count: u64) -> Result<(), MeshError> {
        if self.of_cells == Some(false) && name.is_some() && name.as_deref() == self.wanted {
            let mut values = Vec::new();
            self.each(kind, count, &mut |n| {
                values.push(n.real());
                true
            })?;
            self.values = Some(values);
            return Ok(());
        }
        let mut values = Vec::new();
        let name = name.filter(|_| self.of_cells == Some(true) && kind.is_integer());
        let is_kept = name.is_some();
        self.each(kind, count, &mut |n| {
            if is_kept {
                // numbers beyond are no groups
                values.push(n.integer().unwrap_or(i64::MAX));
            }
            true
        })?;
        if let Some(name) = name {
            self.grid.cell_data.push((name, values));
        }
        Ok(())
    }

    /// Hands on `count` numbers, until `take` says that one is wrong.
    fn each(
        &mut self,
        kind: Kind,
        count: u64,
        take: &mut dyn FnMut(Number) -> bool,
    ) -> Result<(), MeshError> {
        if self.source.encoding == Encoding::Text {
            for _ in 0..count {
                let at = self.next();
                let word = self.word("a number")?;
                let Some(number) = kind.parse(&word) else {
                    return Err(self.syntax(at, &word, "a number"));
                };
                if !take(number) {
                    return Ok(());
                }
            }
            return Ok(());
        }
        // what follows the line of the head, to the byte
        self.line();
        let rest = &self.source.bytes[self.at..];
        let bytes = usize::try_from(count)
            .ok()
            .and_then(|c| c.checked_mul(kind.bytes()));
        let Some(data) = bytes.and_then(|b| rest.get(..b)) else {
            self.at = self.source.bytes.len();
            return Err(self.truncated(&format!("{count} numbers of {} bytes", kind.bytes())));
        };
        self.at += data.len();
        for word in data.chunks_exact(kind.bytes()) {
            if !take(kind.number(word, true)) {
                return Ok(());
            }
        }
        Ok(())
    }

    fn kind(&mut self) -> Result<Kind, MeshError> {
        let at = self.next();
        let name = self.word("the type of numbers")?;
        let integer = |bytes, signed| Ok(Kind::Integer { bytes, signed });
        match name.to_ascii_lowercase().as_str() {
            "char" | "signed_char" | "vtktypeint8" => integer(1, true),
            "unsigned_char" | "vtktypeuint8" => integer(1, false),
            "short" | "vtktypeint16" => integer(2, true),
            "unsigned_short" | "vtktypeuint16" => integer(2, false),
            // VTK writes its own index as an int
            "int" | "vtkidtype" | "vtktypeint32" => integer(4, true),
            "unsigned_int" | "vtktypeuint32" => integer(4, false),
            "long" | "long_long" | "vtktypeint64" => integer(8, true),
            "unsigned_long" | "unsigned_long_long" | "vtktypeuint64" => integer(8, false),
            "float" => Ok(Kind::Real { bytes: 4 }),
            "double" => Ok(Kind::Real { bytes: 8 }),
            _ => Err(MeshError::Unsupported {
                path: self.source.path.clone(),
                place: self.source.place(at),
                what: format!("an array of type `{name}`"),
                remedy: "write the file without it; numbers from char to vtktypeint64, float and double are read",
            }),
        }
    }

    /// The product of two counts of numbers, which the file must be able to hold.
    fn times(&self, a: u64, b: u64) -> Result<u64, MeshError> {
        let all = a.checked_mul(b);
        // a number takes a byte at least
        all.filter(|&n| n <= self.source.bytes.len() as u64)
            .ok_or_else(|| self.truncated(&format!("{a} times {b} numbers")))
    }

    fn count(&mut self, wanted: &str) -> Result<u64, MeshError> {
        let at = self.next();
        let word = self.word(wanted)?;
        word.parse().map_err(|_| self.syntax(at, &word, wanted))
    }

    /// The next word; bytes that are no UTF-8 are replaced.
    fn word(&mut self, wanted: &str) -> Result<String, MeshError> {
        let start = self.next();
        let rest = &self.source.bytes[start..];
        let length = rest
            .iter()
            .position(u8::is_ascii_whitespace)
            .unwrap_or(rest.len());
        if length == 0 {
            self.at = start;
            return Err(self.truncated(wanted));
        }
        self.at = start + length;
        Ok(String::from_utf8_lossy(&rest[..length]).into_owned())
    }

    /// Position of the next word.
    fn next(&self) -> usize {
        self.source.next(self.at)
    }

    /// The rest of the line, trimmed; what is not UTF-8 reads as nothing.
    fn line(&mut self) -> &'a str {
        let (text, next) = self.source.line(self.at);
        self.at = next;
        text
    }

    fn truncated(&self, wanted: &str) -> MeshError {
        self.source.truncated(self.at, &self.section, wanted)
    }

    fn syntax(&self, at: usize, found: &str, wanted: &str) -> MeshError {
        self.source.syntax(at, found, wanted, REWRITE)
    }
}

/// The type of the lists of cells and their types.
const INT: Kind = Kind::Integer {
    bytes: 4,
    signed: true,
};
