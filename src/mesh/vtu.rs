//! VTK XML unstructured grids (`.vtu`): text, base64 and raw data, inline or appended, plain or by zlib, of either byte order.
//!
//! Source: the VTK user's guide, "XML file formats", and `vtkXMLDataParser` where it is silent. A compressed array is a header of numbers (blocks, bytes
//! of a block, bytes of the last one or 0 if that is whole, compressed bytes of each) and the blocks. No size in a file is believed before that much has
//! been decoded: data pass through a buffer, and arrays that say nothing of the mesh are not decoded at all. So a file takes memory in
//! proportion to the cells that it holds, whatever it announces.

use std::borrow::Cow;
use std::io::{Error, ErrorKind, Read as _};
use std::path::Path;

use super::MeshError;
use super::vtk_structured::{Extent, Geometry, Image};
use super::vtu_array::{Array, Content, each_word};
use super::vtu_data::{Blocks, Data, Storage, kind};
use super::xml::{Event, Tag, Xml};
use crate::mesh::raw::{Encoding, Source};
use crate::mesh::vtk_grid::{Grid, Kind, Number, Points};

/// Remedy for a wrong file.
const REWRITE: &str = "write the file again, for instance with VTK, ParaView or meshio";

/// A piece of the grid.
#[derive(Default)]
struct Piece<'a> {
    points: u64,
    cells: u64,
    at: usize,
    coordinates: Option<Array<'a>>,
    connectivity: Option<Array<'a>>,
    offsets: Option<Array<'a>>,
    types: Option<Array<'a>>,
    cell_data: Vec<Array<'a>>,
    point_data: Vec<Array<'a>>,
    /// Of a piece in rows, columns and layers.
    extent: Option<Extent>,
    /// Of a rectilinear piece.
    planes: Vec<Array<'a>>,
}

struct File<'a> {
    source: Source<'a>,
    storage: Storage,
    /// Of an image.
    image: Option<Image>,
    /// Bytes after the underscore of the appended data, and true if they are base64.
    appended: Option<(&'a [u8], bool)>,
}

/// The pieces of a file.
pub(super) fn parse<'a>(
    path: &Path,
    bytes: &'a [u8],
) -> Result<(Vec<Grid>, Source<'a>), MeshError> {
    let mut file = File::new(path, bytes);
    let pieces = file.pieces()?;
    let grids: Result<_, MeshError> = pieces.iter().map(|p| file.grid(p)).collect();
    Ok((grids?, file.source))
}

/// The coordinates of all points of a file, and the number that the point array `name` has for each; cells may be missing.
pub(super) fn points(path: &Path, bytes: &[u8], name: &str) -> Result<Points, MeshError> {
    let mut file = File::new(path, bytes);
    let pieces = file.pieces()?;
    let mut points = Points::default();
    for piece in &pieces {
        file.add_points(piece, name, &mut points)?;
    }
    Ok(points)
}

impl<'a> File<'a> {
    fn new(path: &Path, bytes: &'a [u8]) -> Self {
        Self {
            source: Source {
                path: path.into(),
                bytes,
                encoding: Encoding::Text,
                pieces: &[],
            },
            storage: Storage {
                is_big_endian: false,
                header: 4,
                is_compressed: false,
            },
            image: None,
            appended: None,
        }
    }
}

impl<'a> File<'a> {
    fn pieces(&mut self) -> Result<Vec<Piece<'a>>, MeshError> {
        let bytes = self.source.bytes;
        let mut xml = Xml { bytes, at: 0 };
        let mut path: Vec<&[u8]> = Vec::new();
        let mut pieces: Vec<Piece<'a>> = Vec::new();
        let mut is_seen = false;
        loop {
            let at = xml.at;
            let event = xml
                .next()
                .map_err(|(at, wanted)| self.syntax(at, "no XML", wanted))?;
            match event {
                Event::Start { tag, is_empty } => {
                    if tag.name == b"AppendedData" && path.len() == 1 {
                        let is_base64 = tag.attribute("encoding").as_deref() != Some("raw");
                        self.appended = Some(self.after_underscore(xml.at, is_base64)?);
                        return Ok(pieces);
                    }
                    self.tag(&tag, at, &path, &mut pieces)?;
                    is_seen = true;
                    if !is_empty {
                        path.push(tag.name);
                    }
                }
                Event::Text(text) if path.last() == Some(&&b"DataArray"[..]) => {
                    let array = pieces.last_mut().and_then(|p| p.last_array(&path));
                    if let Some(array) = array {
                        array.add(text);
                    }
                }
                Event::Text(_) => {}
                Event::End(name) => {
                    if path.pop() != Some(name) {
                        let found = format!("</{}>", String::from_utf8_lossy(name));
                        return Err(self.syntax(at, &found, "the end of the tag that is open"));
                    }
                    if path.is_empty() {
                        return Ok(pieces);
                    }
                }
                Event::Nothing => {
                    return Err(MeshError::Truncated {
                        path: self.source.path.clone(),
                        place: self.source.place(bytes.len()),
                        section: match path.last() {
                            Some(name) => format!("<{}>", String::from_utf8_lossy(name)),
                            None => "the file".into(),
                        },
                        wanted: match is_seen {
                            true => "</VTKFile>".into(),
                            false => "<VTKFile>".into(),
                        },
                    });
                }
            }
        }
    }

    /// Takes a tag in.
    fn tag(
        &mut self,
        tag: &Tag<'_>,
        at: usize,
        path: &[&[u8]],
        pieces: &mut Vec<Piece<'a>>,
    ) -> Result<(), MeshError> {
        match (path, tag.name) {
            ([], b"VTKFile") => {
                self.storage = self.storage_of(tag, at)?;
            }
            ([], other) => {
                let found = format!("<{}>", String::from_utf8_lossy(other));
                return Err(self.syntax(at, &found, "<VTKFile>"));
            }
            ([b"VTKFile", b"UnstructuredGrid"], b"Piece") => {
                let count = |name: &str| {
                    let text = tag.attribute(name).unwrap_or_default();
                    let number = text.trim().parse::<u64>();
                    number.map_err(|_| {
                        self.syntax(at, &format!("{name}=\"{text}\""), "a whole number")
                    })
                };
                pieces.push(Piece {
                    points: count("NumberOfPoints")?,
                    cells: count("NumberOfCells")?,
                    at,
                    ..Piece::default()
                });
            }
            ([b"VTKFile"], b"ImageData") => {
                let image = Image::of(|name| tag.attribute(name));
                let wanted = "an image along the axes with a spacing above zero (Origin, Spacing, Direction)";
                let found = "an image that is turned, or has no size";
                let image = image.ok_or_else(|| self.syntax(at, found, wanted))?;
                self.image = Some(image);
            }
            (
                [
                    b"VTKFile",
                    b"ImageData" | b"RectilinearGrid" | b"StructuredGrid",
                ],
                b"Piece",
            ) => {
                let text = tag.attribute("Extent").unwrap_or_default();
                let extent = Extent::parse(&text);
                let known = extent.and_then(|extent| Some((extent, extent.count()?)));
                let (extent, cells) = known.ok_or_else(|| {
                    let wanted = "six planes, first and last along x, y and z (a plane grid is flat along z), and at most 1e8 cells";
                    self.syntax(at, &format!("Extent=\"{text}\""), wanted)
                })?;
                pieces.push(Piece {
                    points: extent.points(),
                    cells,
                    at,
                    extent: Some(extent),
                    ..Piece::default()
                });
            }
            (
                [
                    b"VTKFile",
                    b"UnstructuredGrid" | b"ImageData" | b"RectilinearGrid" | b"StructuredGrid",
                    b"Piece",
                    section,
                ],
                b"DataArray",
            ) => {
                let array = self.array(tag, at)?;
                if let Some(piece) = pieces.last_mut() {
                    piece.take(section, array);
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn storage_of(&self, tag: &Tag<'_>, at: usize) -> Result<Storage, MeshError> {
        let unsupported = |what: String, remedy| MeshError::Unsupported {
            path: self.source.path.clone(),
            place: self.source.place(at),
            what,
            remedy,
        };
        match tag.attribute("type").as_deref() {
            Some("UnstructuredGrid" | "ImageData" | "RectilinearGrid" | "StructuredGrid") => {}
            Some("PUnstructuredGrid") => {
                return Err(unsupported(
                    "a grid spread over several files".into(),
                    "merge its pieces into one .vtu file",
                ));
            }
            _ => {
                return Err(unsupported(
                    "a VTK data set other than a grid or an image".into(),
                    "convert it to an unstructured grid",
                ));
            }
        }
        let is_compressed = match tag.attribute("compressor").as_deref() {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => {
                return Err(unsupported(
                    format!("data compressed by {other}"),
                    "write it compressed by zlib, or not at all",
                ));
            }
        };
        Ok(Storage {
            is_big_endian: tag.attribute("byte_order").as_deref() == Some("BigEndian"),
            header: match tag.attribute("header_type").as_deref() {
                Some("UInt64") => 8,
                _ => 4,
            },
            is_compressed,
        })
    }

    fn array(&self, tag: &Tag<'_>, at: usize) -> Result<Array<'a>, MeshError> {
        let number = |name: &str, otherwise: u64| match tag.attribute(name) {
            None => Ok(otherwise),
            Some(text) => (text.trim().parse())
                .map_err(|_| self.syntax(at, &format!("{name}=\"{text}\""), "a whole number")),
        };
        let nothing = Cow::Borrowed(&[][..]);
        Ok(Array {
            name: tag.attribute("Name").unwrap_or_default().into_owned(),
            kind: tag.attribute("type").and_then(|t| kind(&t)),
            components: number("NumberOfComponents", 1)?,
            content: match tag.attribute("format").as_deref() {
                None | Some("ascii") => Content::Text(nothing),
                Some("binary") => Content::Base64(nothing),
                Some("appended") => Content::Appended(number("offset", 0)?),
                Some(other) => {
                    let found = format!("format=\"{other}\"");
                    return Err(self.syntax(at, &found, "ascii, binary or appended"));
                }
            },
            at,
        })
    }

    fn after_underscore(
        &self,
        begin: usize,
        is_base64: bool,
    ) -> Result<(&'a [u8], bool), MeshError> {
        let rest = self.source.bytes.get(begin..).unwrap_or_default();
        let Some(mark) = rest.iter().position(|b| !b.is_ascii_whitespace()) else {
            return Err(self.syntax(begin, "the end of the file", "`_` and the appended data"));
        };
        if rest[mark] != b'_' {
            return Err(self.syntax(begin + mark, "no `_`", "`_` before the appended data"));
        }
        let data = &rest[mark + 1..];
        let end = match is_base64 {
            true => data.iter().position(|&b| b == b'<'),
            false => None,
        };
        Ok((&data[..end.unwrap_or(data.len())], is_base64))
    }

    fn grid(&self, piece: &Piece<'_>) -> Result<Grid, MeshError> {
        let wanted = |array: &Option<Array<'_>>, name: &str| {
            array.is_none().then(|| {
                self.syntax(
                    piece.at,
                    "a piece without it",
                    &format!("the array `{name}`"),
                )
            })
        };
        let mut grid = Grid::new(piece.at, piece.points);
        if piece.cells == 0 {
            return Ok(grid);
        }
        if let Some(extent) = &piece.extent {
            // a size is believed once as many values have been read
            self.add_cell_data(piece, &mut grid)?;
            let geometry = self.geometry(piece, &grid)?;
            let wanted = "as many as the extent has";
            return (extent.grid(&geometry, grid))
                .map_err(|found| self.syntax(piece.at, &found, wanted));
        }
        let missing = wanted(&piece.coordinates, "Points")
            .or_else(|| wanted(&piece.connectivity, "connectivity"))
            .or_else(|| wanted(&piece.offsets, "offsets"))
            .or_else(|| wanted(&piece.types, "types"));
        let (None, Some(coordinates), Some(connectivity), Some(offsets), Some(types)) = (
            missing.as_ref(),
            &piece.coordinates,
            &piece.connectivity,
            &piece.offsets,
            &piece.types,
        ) else {
            return Err(missing.unwrap_or_else(|| self.syntax(piece.at, "nothing", "a piece")));
        };
        // what grows from cell to cell comes first: it cannot be compressed to nothing, so the file is as large as its cells
        let mut last = 0;
        self.each(offsets, piece.cells, &mut |n| {
            let end = n.integer().filter(|&end| end >= last);
            last = end.ok_or_else(|| format!("the offset {n} after {last}"))?;
            grid.ends.push(last as u64);
            Ok(())
        })?;
        self.each(types, piece.cells, &mut |n| {
            let kind = n.integer().and_then(|n| u8::try_from(n).ok());
            grid.types
                .push(kind.ok_or_else(|| format!("the cell type {n}"))?);
            Ok(())
        })?;
        let nodes = last as u64;
        self.each(connectivity, nodes, &mut |n| {
            let node = n.integer().and_then(|n| u64::try_from(n).ok());
            grid.nodes
                .push(node.ok_or_else(|| format!("the node {n}"))?);
            Ok(())
        })?;
        grid.begin_points();
        let Some(count) = piece.points.checked_mul(3) else {
            return Err(self.syntax(piece.at, &format!("{} points", piece.points), "fewer"));
        };
        self.each(coordinates, count, &mut |n| {
            grid.push_coordinate(n.real());
            Ok(())
        })?;
        self.add_cell_data(piece, &mut grid)?;
        Ok(grid)
    }

    /// The places of the points of a piece in rows, columns and layers, whose values per cell are those of `grid`.
    fn geometry(&self, piece: &Piece<'_>, grid: &Grid) -> Result<Geometry, MeshError> {
        let numbers = |array: &Array<'_>, count: u64| {
            let mut read = Vec::new();
            self.each(array, count, &mut |n| {
                read.push(n.real());
                Ok(())
            })?;
            Ok(read)
        };
        if let Some(image) = self.image {
            if grid.cell_data.is_empty() {
                let reals = piece.cell_data.first();
                let found = match reals {
                    Some(array) => {
                        format!("an image whose array `{}` holds no integers", array.name)
                    }
                    None => "an image without integers per cell".to_owned(),
                };
                let wanted = "CellData with an array of integers (Int8 to UInt64), such as the number of a phase (of values per point: the filter PointDataToCellData)";
                return Err(self.syntax(piece.at, &found, wanted));
            }
            return Ok(Geometry::Image(image));
        }
        match (&piece.coordinates, &piece.planes[..], &piece.extent) {
            (Some(points), ..) => {
                let read: Vec<f64> = numbers(points, piece.points.saturating_mul(3))?;
                let read = read.chunks_exact(3).map(|x| [x[0], x[1], x[2]]);
                Ok(Geometry::Points(read.collect()))
            }
            (None, [x, y, z], Some(extent)) => {
                let [nx, ny, nz] = extent.planes();
                Ok(Geometry::Planes([
                    numbers(x, nx)?,
                    numbers(y, ny)?,
                    numbers(z, nz)?,
                ]))
            }
            _ => {
                let wanted = "Points, or Coordinates along x, y and z";
                Err(self.syntax(piece.at, "a piece without them", wanted))
            }
        }
    }

    /// Adds the points of a piece, each with its number in the array `name`.
    fn add_points(
        &self,
        piece: &Piece<'_>,
        name: &str,
        points: &mut Points,
    ) -> Result<(), MeshError> {
        if piece.points == 0 {
            return Ok(());
        }
        let lacks = |wanted: &str| self.syntax(piece.at, "a piece without it", wanted);
        let coordinates =
            (piece.coordinates.as_ref()).ok_or_else(|| lacks("the array `Points`"))?;
        let is_its = |a: &&Array<'_>| a.name == name && a.components == 1;
        let values = piece.point_data.iter().find(is_its).ok_or_else(|| {
            let wanted = format!("PointData with the array `{name}` of one number per point");
            lacks(&wanted)
        })?;
        // a size is believed once as many values have been read
        self.each(values, piece.points, &mut |n| {
            points.values.push(n.real());
            Ok(())
        })?;
        let mut read = Vec::new();
        self.each(coordinates, piece.points.saturating_mul(3), &mut |n| {
            read.push(n.real());
            Ok(())
        })?;
        let read = read.chunks_exact(3).map(|x| [x[0], x[1], x[2]]);
        points.coordinates.extend(read);
        Ok(())
    }

    /// Reads the integers per cell.
    fn add_cell_data(&self, piece: &Piece<'_>, grid: &mut Grid) -> Result<(), MeshError> {
        for array in &piece.cell_data {
            if array.components == 1 && array.kind.is_some_and(Kind::is_integer) {
                let mut values = Vec::new();
                let found = self.each(array, piece.cells, &mut |n| {
                    // numbers beyond are no groups
                    values.push(n.integer().unwrap_or(i64::MAX));
                    Ok(())
                });
                found?;
                grid.cell_data.push((array.name.clone(), values));
            }
        }
        Ok(())
    }

    /// Hands on the `count` numbers of an array.
    fn each(
        &self,
        array: &Array<'_>,
        count: u64,
        take: &mut dyn FnMut(Number) -> Result<(), String>,
    ) -> Result<(), MeshError> {
        let named = |found: String, wanted: &str| {
            let found = format!("{found} in the array `{}`", array.name);
            self.syntax(array.at, &found, wanted)
        };
        let Some(kind) = array.kind else {
            return Err(named(
                "an unknown type".into(),
                "Int8 to UInt64, Float32 or Float64",
            ));
        };
        let mut data = match &array.content {
            Content::Text(text) => {
                return each_word(text, kind, count, &named, take);
            }
            Content::Base64(text) => Data::base64(text),
            Content::Appended(offset) => {
                let Some((all, is_base64)) = self.appended else {
                    return Err(named("no appended data".into(), "<AppendedData>"));
                };
                let start = usize::try_from(*offset).ok().filter(|&o| o < all.len());
                let Some(start) = start else {
                    let found = format!("the offset {offset} into {} bytes", all.len());
                    return Err(named(found, "an offset into the appended data"));
                };
                match is_base64 {
                    true => Data::base64(&all[start..]),
                    false => Data::raw(&all[start..]),
                }
            }
        };
        let bytes = count.checked_mul(kind.bytes() as u64);
        let Some(bytes) = bytes else {
            return Err(named(format!("{count} numbers"), "fewer"));
        };
        let unread = |e: Error| {
            let found = match e.kind() {
                ErrorKind::UnexpectedEof => "data that end early".to_owned(),
                _ => e.to_string(),
            };
            named(found, &format!("{bytes} bytes ({count} numbers)"))
        };
        let mut blocks = Blocks::begin(&mut data, self.storage, bytes).map_err(unread)?;
        let mut left = bytes;
        let mut buffer = vec![0u8; left.min(1 << 16) as usize];
        while left > 0 {
            let part = &mut buffer[..left.min(1 << 16) as usize];
            blocks.read_exact(part).map_err(unread)?;
            left -= part.len() as u64;
            for word in part.chunks_exact(kind.bytes()) {
                let number = kind.number(word, self.storage.is_big_endian);
                take(number).map_err(|e| named(e, "a number that fits the grid"))?;
            }
        }
        Ok(())
    }

    fn syntax(&self, at: usize, found: &str, wanted: &str) -> MeshError {
        MeshError::Syntax {
            path: self.source.path.clone(),
            place: self.source.place(at),
            found: found.chars().take(200).collect(),
            wanted: wanted.into(),
            remedy: REWRITE,
        }
    }
}

impl<'a> Piece<'a> {
    fn slot(&mut self, section: &[u8], name: &str) -> Option<&mut Option<Array<'a>>> {
        match (section, name) {
            (b"Points", _) => Some(&mut self.coordinates),
            (b"Cells", "connectivity") => Some(&mut self.connectivity),
            (b"Cells", "offsets") => Some(&mut self.offsets),
            (b"Cells", "types") => Some(&mut self.types),
            _ => None,
        }
    }

    fn take(&mut self, section: &[u8], array: Array<'a>) {
        if section == b"CellData" {
            self.cell_data.push(array);
        } else if section == b"PointData" {
            self.point_data.push(array);
        } else if section == b"Coordinates" {
            self.planes.push(array);
        } else if let Some(slot) = self.slot(section, &array.name.clone()) {
            *slot = Some(array);
        }
    }

    /// The array whose content follows its tag, which is the last one of its section.
    fn last_array(&mut self, path: &[&[u8]]) -> Option<&mut Array<'a>> {
        let section = path.len().checked_sub(2).map(|k| path[k])?;
        match section {
            b"CellData" => self.cell_data.last_mut(),
            b"PointData" => self.point_data.last_mut(),
            b"Coordinates" => self.planes.last_mut(),
            b"Points" => self.coordinates.as_mut(),
            b"Cells" => [&mut self.connectivity, &mut self.offsets, &mut self.types]
                .into_iter()
                .flatten()
                .max_by_key(|array| array.at),
            _ => None,
        }
    }
}
