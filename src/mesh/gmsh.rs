//! Gmsh MSH files of versions 4.1 and 2.x, ASCII and binary of either byte order.
//!
//! Source: Gmsh reference manual, "MSH file format" and "MSH file format version 2 (Legacy)". Physical groups become
//! sets under their names, or `physical_N` where group `N` has none. Sections that say nothing of the mesh itself
//! (`$NodeData`, `$Periodic`, `$Comments`, …) are skipped; those that would change its meaning are refused.

use std::collections::HashMap;
use std::path::Path;

use super::gmsh_kinds::{reorder, shape};
use super::{MeshError, Order};
use crate::mesh::raw::{Encoding, RawMesh, RawNode, RawShape, Source};

/// Remedy for a wrong word in a text file.
const REWRITE: &str = "correct it or write the file again with Gmsh";

/// Parses a file whose cells are to have an order.
pub(super) fn parse<'a>(
    path: &Path,
    bytes: &'a [u8],
    order: Order,
) -> Result<(RawMesh, Source<'a>), MeshError> {
    let mut reader = Reader {
        source: Source {
            path: path.into(),
            bytes,
            encoding: Encoding::Text,
            pieces: &[],
        },
        at: 0,
        order,
        section: "$MeshFormat".into(),
        version: Version::Four,
        swapped: false,
        size_bytes: 8,
        names: HashMap::new(),
        entities: HashMap::new(),
        lists: HashMap::new(),
        partitions: Vec::new(),
        raw: RawMesh::default(),
    };
    reader.file()?;
    Ok((reader.raw, reader.source))
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Version {
    Two,
    Four,
}

struct Reader<'a> {
    source: Source<'a>,
    at: usize,
    /// Order that cells are to have.
    order: Order,
    section: String,
    version: Version,
    /// True if binary numbers have the other byte order than this machine.
    swapped: bool,
    /// Bytes of a `size_t` in the file.
    size_bytes: usize,
    /// Names of physical groups by dimension and tag.
    names: HashMap<(usize, i64), String>,
    /// Physical groups of each entity, by dimension and tag.
    entities: HashMap<(usize, i64), Vec<i64>>,
    /// Lists of groups that already have a number in `raw.groups`.
    lists: HashMap<(usize, Vec<i64>), u32>,
    /// First partition of each element that belongs to any, and the byte where it stands; of version 2.
    partitions: Vec<(i64, usize)>,
    raw: RawMesh,
}

impl<'a> Reader<'a> {
    fn file(&mut self) -> Result<(), MeshError> {
        let mut seen: Vec<String> = Vec::new();
        loop {
            self.skip_space();
            if self.at == self.source.bytes.len() {
                break;
            }
            let start = self.at;
            let line = self.line();
            let Some(name) = line.strip_prefix('$').map(str::to_owned) else {
                return Err(self.syntax_at(start, line, "a section such as $Nodes"));
            };
            self.section = format!("${name}");
            if name == "Comments" {
                self.skip_section(&name)?;
                self.end_of_section(&name)?;
                continue;
            }
            if seen.is_empty() && name != "MeshFormat" {
                return Err(self.syntax_at(start, &format!("${name}"), "$MeshFormat"));
            }
            if ["Nodes", "Elements", "Entities"].contains(&name.as_str()) && seen.contains(&name) {
                return Err(self.unsupported(
                    start,
                    &format!("a second ${name} section"),
                    "write one mesh per file",
                ));
            }
            match name.as_str() {
                "MeshFormat" => self.format()?,
                "PhysicalNames" => self.physical_names()?,
                "Entities" if self.version == Version::Four => self.entities()?,
                "Nodes" if self.version == Version::Four => self.nodes_4()?,
                "Nodes" => self.nodes_2()?,
                "Elements" if self.version == Version::Four => self.elements_4()?,
                "Elements" => self.elements_2()?,
                "PartitionedEntities" => {
                    return Err(self.unsupported(
                        start,
                        "a partitioned mesh ($PartitionedEntities)",
                        "write it without partitions (in Gmsh: Mesh > Unpartition)",
                    ));
                }
                "ParametricNodes" => {
                    return Err(self.unsupported(
                        start,
                        "$ParametricNodes",
                        "write it without parametric coordinates (Mesh.SaveParametric = 0)",
                    ));
                }
                _ => self.skip_section(&name)?,
            }
            self.end_of_section(&name)?;
            seen.push(name);
        }
        for wanted in ["MeshFormat", "Nodes", "Elements"] {
            if !seen.iter().any(|name| name == wanted) {
                self.section = "the file".into();
                return Err(self.truncated(&format!("a section ${wanted}")));
            }
        }
        self.tell_lost_groups();
        Ok(())
    }

    /// Notes that a file of version 2 names groups and has elements of none: Gmsh writes it so with Mesh.SaveAll.
    fn tell_lost_groups(&mut self) {
        let is_lost = self.version == Version::Two && self.raw.groups.len() == 1;
        if !is_lost || self.names.is_empty() {
            return;
        }
        let mut names: Vec<&str> = self.names.values().map(String::as_str).collect();
        names.sort_unstable();
        self.raw.notes.push(format!(
            "{}: no element belongs to any of the physical groups {}: in version 2.2 Gmsh writes none with Mesh.SaveAll; write version 4.1, or without SaveAll",
            self.source.path.display(),
            names.join(", ")
        ));
    }

    fn format(&mut self) -> Result<(), MeshError> {
        let at = self.at;
        let line = self.line();
        let words: Vec<&str> = line.split_whitespace().collect();
        let [version, file_type, size] = words[..] else {
            return Err(self.syntax_at(at, line, "version, file type and data size"));
        };
        self.version = match version {
            "4.1" => Version::Four,
            "2" | "2.0" | "2.1" | "2.2" => Version::Two,
            _ => {
                return Err(self.unsupported(
                    at,
                    &format!("version {version} of the format"),
                    "write version 4.1 or 2.2 (gmsh -format msh41 or msh22)",
                ));
            }
        };
        self.size_bytes = match (size, file_type, self.version) {
            ("8", ..) => 8,
            ("4", "1", Version::Four) => 4,
            _ => {
                return Err(self.unsupported(
                    at,
                    &format!("data size {size}"),
                    "write it with 8-byte numbers, as Gmsh does",
                ));
            }
        };
        match file_type {
            "0" => {}
            "1" => {
                self.source.encoding = Encoding::Binary;
                let at = self.at;
                let one = self.bytes::<4>("the integer 1 that tells the byte order")?;
                self.swapped = match i32::from_ne_bytes(one) {
                    1 => false,
                    n if n.swap_bytes() == 1 => true,
                    n => return Err(self.syntax_at(at, &n.to_string(), "the integer 1")),
                };
            }
            _ => return Err(self.syntax_at(at, file_type, "file type 0 (ASCII) or 1 (binary)")),
        }
        Ok(())
    }

    /// Text in both encodings.
    fn physical_names(&mut self) -> Result<(), MeshError> {
        let at = self.at;
        let line = self.line();
        let count: usize = line
            .parse()
            .map_err(|_| self.syntax_at(at, line, "the number of names"))?;
        for _ in 0..count {
            self.skip_space();
            let at = self.at;
            let line = self.line();
            if line.is_empty() {
                return Err(self.truncated("the name of a physical group"));
            }
            let mut parts = line.splitn(3, char::is_whitespace);
            let dimension = parts.next().and_then(|w| w.parse().ok());
            let tag = parts.next().and_then(|w| w.parse().ok());
            let name = parts.next().map(str::trim).and_then(|n| {
                n.strip_prefix('"')
                    .and_then(|n| n.strip_suffix('"'))
                    .filter(|n| !n.is_empty())
            });
            let (Some(dimension), Some(tag), Some(name)) = (dimension, tag, name) else {
                return Err(self.syntax_at(at, line, "dimension, tag and \"name\""));
            };
            self.names.insert((dimension, tag), name.into());
        }
        Ok(())
    }

    fn entities(&mut self) -> Result<(), MeshError> {
        let mut counts = [0; 4];
        for count in &mut counts {
            *count = self.size("the number of entities")?;
        }
        for (dimension, count) in counts.into_iter().enumerate() {
            for _ in 0..count {
                let tag = self.integer("the tag of an entity")?;
                for _ in 0..if dimension == 0 { 3 } else { 6 } {
                    self.double("the bounds of an entity")?;
                }
                let mut groups = Vec::new();
                for _ in 0..self.size("the number of physical groups")? {
                    // negative where the group holds the entity reversed
                    groups.push(self.integer("a physical group")?.abs());
                }
                if dimension > 0 {
                    for _ in 0..self.size("the number of bounding entities")? {
                        self.integer("a bounding entity")?;
                    }
                }
                self.entities.insert((dimension, tag), groups);
            }
        }
        Ok(())
    }

    fn nodes_4(&mut self) -> Result<(), MeshError> {
        let blocks = self.size("the number of node blocks")?;
        let total = self.size("the number of nodes")?;
        self.size("the smallest node tag")?;
        self.size("the largest node tag")?;
        let mut tags = Vec::new();
        for _ in 0..blocks {
            let dimension = self.integer("the dimension of an entity")?;
            self.integer("the tag of an entity")?;
            let parametric = self.integer("0 or 1 for parametric coordinates")?;
            let count = self.size("the number of nodes in a block")?;
            tags.clear();
            for _ in 0..count {
                tags.push((self.next_at(), self.size("a node tag")? as u64));
            }
            for &(tag_at, tag) in &tags {
                let text = self.source.encoding == Encoding::Text;
                let at = if text { self.next_at() } else { tag_at };
                let x = self.point()?;
                if parametric != 0 {
                    for _ in 0..dimension {
                        self.double("a parametric coordinate")?;
                    }
                }
                self.raw.nodes.push(RawNode { tag, x, at });
            }
        }
        self.check_total(self.raw.nodes.len(), total, "nodes")
    }

    fn elements_4(&mut self) -> Result<(), MeshError> {
        let blocks = self.size("the number of element blocks")?;
        let total = self.size("the number of elements")?;
        self.size("the smallest element tag")?;
        self.size("the largest element tag")?;
        let mut nodes = Vec::new();
        for _ in 0..blocks {
            let dimension = self.integer("the dimension of an entity")?;
            let entity = self.integer("the tag of an entity")?;
            let kind_at = self.next_at();
            let kind = self.integer("the type of the elements")?;
            let count = self.size("the number of elements in a block")?;
            let dimension = dimension.clamp(0, 3) as usize;
            let groups = self
                .entities
                .get(&(dimension, entity))
                .cloned()
                .unwrap_or_default();
            let group = self.group_list(dimension, groups);
            for _ in 0..count {
                let at = self.next_at();
                let tag = self.size("an element tag")? as u64;
                let known = shape(kind, self.order);
                let known = known.map_err(|e| self.element_error(kind_at, tag, kind, e))?;
                let shape = self.nodes_of(known, &mut nodes, |own, what| {
                    own.size(what).map(|n| n as u64)
                })?;
                self.raw.push((tag, group, at), shape, &nodes);
            }
        }
        self.check_total(self.raw.count(), total, "elements")
    }

    /// The count of a section of version 2, which is text in both encodings.
    fn count_2(&mut self, what: &str) -> Result<usize, MeshError> {
        self.skip_space();
        let at = self.at;
        let line = self.line();
        line.parse().map_err(|_| self.syntax_at(at, line, what))
    }

    fn nodes_2(&mut self) -> Result<(), MeshError> {
        for _ in 0..self.count_2("the number of nodes")? {
            let at = self.next_at();
            let tag = self.integer("a node number")? as u64;
            let x = self.point()?;
            self.raw.nodes.push(RawNode { tag, x, at });
        }
        Ok(())
    }

    fn elements_2(&mut self) -> Result<(), MeshError> {
        let total = self.count_2("the number of elements")?;
        let text = self.source.encoding == Encoding::Text;
        let mut nodes = Vec::new();
        while self.raw.count() < total {
            // in binary one header serves several elements; in text each element is its own block
            let mut at = self.next_at();
            let mut tag = if text {
                self.integer("an element number")?
            } else {
                0
            };
            let kind = self.integer("the type of an element")?;
            let count = if text {
                1
            } else {
                self.integer("the number of elements in a block")?
            };
            let tag_count = self.integer("the number of tags")?;
            if count < 1 {
                return Err(self.syntax_at(at, &format!("{count} elements"), "at least one"));
            }
            for _ in 0..count {
                if !text {
                    at = self.at;
                    tag = self.integer("an element number")?;
                }
                let known = shape(kind, self.order);
                let known = known.map_err(|e| self.element_error(at, tag as u64, kind, e))?;
                let mut physical = 0;
                for i in 0..tag_count {
                    let tag = self.integer("a tag of an element")?;
                    match i {
                        0 => physical = tag.abs(),
                        // the entity, how many partitions it belongs to, and the first of these
                        3 => self.partitions.push((tag, at)),
                        _ => {}
                    }
                }
                let groups = if physical == 0 {
                    Vec::new()
                } else {
                    vec![physical]
                };
                let group = self.group_list(known.0.dimension(), groups);
                let shape = self.nodes_of(known, &mut nodes, |own, what| {
                    own.integer(what).map(|n| n as u64)
                })?;
                self.raw.push((tag as u64, group, at), shape, &nodes);
            }
        }
        self.refuse_part()
    }

    /// Refuses one partition of a mesh, as Gmsh writes each to a file of its own.
    fn refuse_part(&self) -> Result<(), MeshError> {
        let Some(&(first, at)) = self.partitions.first() else {
            return Ok(());
        };
        if self.partitions.iter().any(|(other, _)| *other != first) {
            return Ok(());
        }
        Err(self.unsupported(
            at,
            &format!("the partition {first} alone of a partitioned mesh"),
            "write all of them to one file (in Gmsh: Mesh.PartitionSplitMeshFiles = 0), or the mesh without partitions",
        ))
    }

    /// Reads the nodes of an element, one after another by `next`, in our order; returns its shape.
    fn nodes_of(
        &mut self,
        (shape, others): (RawShape, usize),
        nodes: &mut Vec<u64>,
        next: impl Fn(&mut Self, &str) -> Result<u64, MeshError>,
    ) -> Result<RawShape, MeshError> {
        nodes.clear();
        for _ in 0..shape.node_count() {
            nodes.push(next(self, "a node of an element")?);
        }
        for _ in 0..others {
            next(self, "a node of an element")?;
        }
        reorder(shape, nodes);
        Ok(shape)
    }

    /// The number of a list of physical groups, whose names are looked up once.
    fn group_list(&mut self, dimension: usize, groups: Vec<i64>) -> u32 {
        if groups.is_empty() {
            return 0;
        }
        let key = (dimension, groups);
        if let Some(&number) = self.lists.get(&key) {
            return number;
        }
        let name = |tag: &i64| match self.names.get(&(dimension, *tag)) {
            Some(name) => name.clone(),
            None => format!("physical_{tag}"),
        };
        let number = self.raw.groups.len() as u32;
        self.raw.groups.push(key.1.iter().map(name).collect());
        self.lists.insert(key, number);
        number
    }

    /// Passes over a section, up to its end mark.
    fn skip_section(&mut self, name: &str) -> Result<(), MeshError> {
        let end = format!("$End{name}");
        let rest = &self.source.bytes[self.at..];
        match rest.windows(end.len()).position(|w| w == end.as_bytes()) {
            Some(n) => {
                self.at += n;
                Ok(())
            }
            None => {
                self.at = self.source.bytes.len();
                Err(self.truncated(&end))
            }
        }
    }

    fn end_of_section(&mut self, name: &str) -> Result<(), MeshError> {
        self.skip_space();
        let at = self.at;
        let wanted = format!("$End{name}");
        if at == self.source.bytes.len() {
            return Err(self.truncated(&wanted));
        }
        let line = self.line();
        if line == wanted {
            return Ok(());
        }
        Err(self.syntax_at(
            at,
            line,
            &format!("{wanted} (the section holds more than it announces)"),
        ))
    }

    fn check_total(&self, found: usize, announced: usize, what: &str) -> Result<(), MeshError> {
        if found == announced {
            return Ok(());
        }
        Err(self.syntax_at(
            self.at,
            &format!("{found} {what}"),
            &format!("{announced}, as announced,"),
        ))
    }

    fn truncated(&self, wanted: &str) -> MeshError {
        self.source.truncated(self.at, &self.section, wanted)
    }

    fn syntax_at(&self, at: usize, found: &str, wanted: &str) -> MeshError {
        self.source.syntax(at, found, wanted, REWRITE)
    }

    fn unsupported(&self, at: usize, what: &str, remedy: &'static str) -> MeshError {
        MeshError::Unsupported {
            path: self.source.path.clone(),
            place: self.source.place(at),
            what: what.into(),
            remedy,
        }
    }

    fn element_error(
        &self,
        at: usize,
        element: u64,
        kind: i64,
        (name, remedy): (&'static str, &'static str),
    ) -> MeshError {
        MeshError::UnsupportedElement {
            path: self.source.path.clone(),
            place: self.source.place(at),
            element,
            kind: kind.to_string(),
            name,
            remedy,
        }
    }
}

#[path = "gmsh_words.rs"]
mod words;

#[cfg(test)]
#[path = "gmsh_tests.rs"]
mod tests;
