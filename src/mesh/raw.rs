//! Content of a mesh file before it is a mesh: nodes, elements and groups as they are read, and the places of errors in the file.

use super::error::axis_name;
use super::{CellShape, Facet, Mesh, MeshError, Order, Place};
use crate::regular_file;
use crate::tensor::Vector;
use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Tolerance of a node of a 2D mesh out of its plane, as a fraction of the mesh's extent.
const OUT_OF_PLANE: f64 = 1e-12;

/// The file behind a mesh, for messages.
pub(super) struct Source<'a> {
    pub path: PathBuf,
    pub bytes: &'a [u8],
    pub encoding: Encoding,
    /// Pieces of the text by the file that they come from; empty where all is of one file.
    pub pieces: &'a [Piece],
}

/// A stretch of text that comes from one file.
pub(super) struct Piece {
    /// Byte where it begins in the whole text.
    pub start: usize,
    /// The file.
    pub path: PathBuf,
    /// Number of its first line in that file, from 1.
    pub line: usize,
}

/// Unit in which positions in a file are given in messages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Encoding {
    /// By lines.
    Text,
    /// By bytes.
    Binary,
    /// By numbers of nodes or elements; there is no file.
    Memory,
}

impl<'a> Source<'a> {
    /// Position of the next word: after blanks and line ends from byte `at` on.
    pub fn next(&self, at: usize) -> usize {
        let rest = &self.bytes[at..];
        let blanks = rest.iter().position(|b| !b.is_ascii_whitespace());
        at + blanks.unwrap_or(rest.len())
    }

    /// The rest of the line from byte `at` on, trimmed, and where the next one begins; what is not UTF-8 reads as nothing.
    pub fn line(&self, at: usize) -> (&'a str, usize) {
        let rest = &self.bytes[at..];
        let length = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        let text = std::str::from_utf8(&rest[..length]).unwrap_or("").trim();
        (text, at + (length + 1).min(rest.len()))
    }

    /// The piece that holds byte `at`.
    fn piece(&self, at: usize) -> Option<&Piece> {
        let after = self.pieces.partition_point(|piece| piece.start <= at);
        self.pieces[..after].last()
    }

    /// The file that holds byte `at`.
    pub fn file(&self, at: usize) -> PathBuf {
        self.piece(at)
            .map_or(&self.path, |piece| &piece.path)
            .clone()
    }

    /// The file ends at byte `at`, where `wanted` should stand.
    pub fn truncated(&self, at: usize, section: &str, wanted: &str) -> MeshError {
        MeshError::Truncated {
            path: self.file(at),
            place: self.place(at),
            section: section.to_owned(),
            wanted: wanted.into(),
        }
    }

    /// `found` stands at byte `at` instead of `wanted`.
    pub fn syntax(&self, at: usize, found: &str, wanted: &str, remedy: &'static str) -> MeshError {
        let found: String = found.chars().take(60).collect();
        MeshError::Syntax {
            path: self.file(at),
            place: self.place(at),
            found: if found.is_empty() {
                "nothing legible".into()
            } else {
                format!("\"{found}\"")
            },
            wanted: wanted.into(),
            remedy,
        }
    }

    /// The place of byte `at`.
    pub fn place(&self, at: usize) -> Place {
        match self.encoding {
            Encoding::Text => {
                let at = at.min(self.bytes.len());
                let (start, line) = self.piece(at).map_or((0, 1), |p| (p.start, p.line));
                let before = &self.bytes[start..at];
                Place::Line(line + before.iter().filter(|&&b| b == b'\n').count())
            }
            Encoding::Binary => Place::Byte(at),
            Encoding::Memory => Place::Entry(at),
        }
    }
}

/// The bytes of a file, without the mark that some editors put before a text in UTF-8.
///
/// # Errors
/// [`MeshError::Open`].
pub(super) fn bytes_of(path: &Path) -> Result<Vec<u8>, MeshError> {
    let mut bytes = regular_file::read(path).map_err(|source| MeshError::Open {
        path: path.into(),
        source,
    })?;
    if bytes.starts_with(b"\xef\xbb\xbf") {
        bytes.drain(..3);
    }
    Ok(bytes)
}

/// A node as the file holds it.
pub(super) struct RawNode {
    pub tag: u64,
    pub x: [f64; 3],
    /// Byte where it stands.
    pub at: usize,
}

/// An element as the file holds it.
pub(super) struct RawElement {
    pub tag: u64,
    pub shape: CellShape,
    /// Start of its node tags in [`RawMesh::element_nodes`].
    pub start: usize,
    /// Index of its group in [`RawMesh::groups`].
    pub group: u32,
    /// Byte where it stands.
    pub at: usize,
}

/// Nodes and elements as a file holds them, whatever its format.
pub(super) struct RawMesh {
    pub nodes: Vec<RawNode>,
    pub elements: Vec<RawElement>,
    pub element_nodes: Vec<u64>,
    /// Lists of set names; the first one is empty.
    pub groups: Vec<Vec<String>>,
    /// Prisms and pyramids, which no mesh has: they are split before.
    pub others: Vec<RawOther>,
    /// Types of elements that were left out because they were asked to be.
    pub left_out: Vec<String>,
    /// Notes on what the reader left out, a sentence each.
    pub notes: Vec<String>,
    /// Instances of a deck by the number that their tags exceed those of the deck by, ascending; none where tags are the numbers of the file.
    pub instances: Vec<(u64, String)>,
}

/// A cell of a shape that no mesh has.
pub(super) struct RawOther {
    pub tag: u64,
    pub shape: OtherShape,
    /// Its nodes: of a prism three, and those across; of a pyramid its base around, and its apex.
    pub nodes: Vec<u64>,
    /// Index of its group in [`RawMesh::groups`].
    pub group: u32,
    /// Byte where it stands.
    pub at: usize,
}

/// Shapes that are split into tetrahedra.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OtherShape {
    Prism,
    Pyramid,
}

/// A shape of a file.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum RawShape {
    Cell(CellShape),
    Other(OtherShape),
}

impl std::fmt::Debug for RawShape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Cell(shape) => shape.fmt(f),
            Self::Other(shape) => shape.fmt(f),
        }
    }
}

impl RawShape {
    /// Number of nodes.
    pub fn node_count(self) -> usize {
        match self {
            Self::Cell(shape) => shape.node_count(),
            Self::Other(OtherShape::Prism) => 6,
            Self::Other(OtherShape::Pyramid) => 5,
        }
    }

    /// Topological dimension.
    pub fn dimension(self) -> usize {
        match self {
            Self::Cell(shape) => shape.dimension(),
            Self::Other(_) => 3,
        }
    }
}

impl Default for RawMesh {
    fn default() -> Self {
        Self {
            nodes: Vec::new(),
            elements: Vec::new(),
            element_nodes: Vec::new(),
            groups: vec![Vec::new()],
            others: Vec::new(),
            left_out: Vec::new(),
            notes: Vec::new(),
            instances: Vec::new(),
        }
    }
}

/// Cells by their sorted corners, with the groups that name them.
type KnownCells = HashMap<[u32; 8], (u32, HashSet<u32>)>;

/// Sorts the sets of cells and nodes, and leaves one of equal entries in each set.
fn sort_sets<const D: usize>(mesh: &mut Mesh<D>) {
    for set in mesh
        .cell_sets
        .values_mut()
        .chain(mesh.node_sets.values_mut())
    {
        set.sort_unstable();
        set.dedup();
    }
    for set in mesh.facet_sets.values_mut() {
        let mut seen = HashSet::new();
        set.retain(|facet| {
            let mut key: Facet = facet.clone();
            key.sort_unstable();
            seen.insert(key)
        });
    }
}

impl RawMesh {
    /// Appends an element: tag, group and byte where it stands, and its nodes in the order of VTK.
    pub fn push(&mut self, (tag, group, at): (u64, u32, usize), shape: RawShape, nodes: &[u64]) {
        match shape {
            RawShape::Cell(shape) => {
                self.elements.push(RawElement {
                    tag,
                    shape,
                    start: self.element_nodes.len(),
                    group,
                    at,
                });
                self.element_nodes.extend_from_slice(nodes);
            }
            RawShape::Other(shape) => self.others.push(RawOther {
                tag,
                shape,
                nodes: nodes.to_vec(),
                group,
                at,
            }),
        }
    }

    /// A tag as the file has it: of a deck with several instances `INSTANCE.NUMBER`.
    pub fn number_in_file(&self, tag: u64) -> String {
        let after = self.instances.partition_point(|(first, _)| *first < tag);
        match self.instances[..after].last() {
            Some((first, name)) if !name.is_empty() => format!("{name}.{}", tag - first),
            _ => tag.to_string(),
        }
    }

    /// Number of elements, of all shapes.
    pub fn count(&self) -> usize {
        self.elements.len() + self.others.len()
    }

    /// Gives cells the order; linear ones are without the nodes in the middle of edges, which come after the corners.
    pub(super) fn set_order(&mut self, order: Order) {
        if order != Order::Linear {
            return;
        }
        for element in &mut self.elements {
            element.shape = element.shape.linear();
        }
    }

    pub(super) fn dimension(&self, source: &Source) -> Result<usize, MeshError> {
        let found = self.elements.iter().map(|e| e.shape.dimension()).max();
        match found {
            Some(found) if !self.nodes.is_empty() && found > 0 => Ok(found),
            _ => Err(MeshError::Empty {
                path: source.path.clone(),
                nodes: self.nodes.len(),
                elements: self.elements.len(),
            }),
        }
    }

    pub(super) fn assemble<const D: usize>(&self, source: &Source) -> Result<Mesh<D>, MeshError> {
        let path = || source.path.clone();
        let found = self.dimension(source)?;
        if found != D {
            return Err(MeshError::WrongDimension {
                path: path(),
                wanted: D,
                found,
                remedy: match (found < D, D) {
                    (true, 2) => {
                        "mesh the surface too (in Gmsh: gmsh -2, and a physical group for it), or use the dimension found"
                    }
                    (true, _) => {
                        "mesh the volume too (in Gmsh: gmsh -3, and a physical group for it), or use the dimension found"
                    }
                    (false, _) => "use the dimension found",
                },
            });
        }
        let numbers = self.number_nodes(source)?;
        let mut mesh = Mesh::<D> {
            nodes: self
                .nodes
                .iter()
                .map(|n| Vector::from_fn(|k, _| n.x[k]))
                .collect(),
            notes: self.notes.clone(),
            ..Mesh::default()
        };
        // a 2.2 file repeats an element for each of its groups
        let mut known: KnownCells = HashMap::new();
        let mut nodes: Vec<u32> = Vec::with_capacity(8);
        for element in &self.elements {
            nodes.clear();
            self.find_nodes(element, &numbers, source, &mut nodes)?;
            let names = &self.groups[element.group as usize];
            let dimension = element.shape.dimension();
            if dimension == D {
                let cell = self.cell_of(element, &nodes, source, &mut known, &mut mesh)?;
                for name in names {
                    mesh.cell_sets.entry(name.clone()).or_default().push(cell);
                }
            } else if dimension + 1 == D {
                for name in names {
                    let set = mesh.facet_sets.entry(name.clone()).or_default();
                    set.push(nodes.clone());
                }
            } else {
                for name in names {
                    let set = mesh.node_sets.entry(name.clone()).or_default();
                    set.extend_from_slice(&nodes);
                }
            }
        }
        self.check_plane(&mesh, source)?;
        sort_sets(&mut mesh);
        let all = (0..mesh.cell_count() as u32).collect();
        mesh.cell_sets.entry("all".into()).or_insert(all);
        mesh.drop_unused_nodes();
        Ok(mesh)
    }

    /// The numbers of an element's nodes.
    ///
    /// # Errors
    /// [`MeshError::MissingNode`].
    fn find_nodes(
        &self,
        element: &RawElement,
        numbers: &HashMap<u64, u32>,
        source: &Source,
        nodes: &mut Vec<u32>,
    ) -> Result<(), MeshError> {
        let tags = &self.element_nodes[element.start..][..element.shape.node_count()];
        for tag in tags {
            let Some(&n) = numbers.get(tag) else {
                return Err(MeshError::MissingNode {
                    path: source.file(element.at),
                    place: source.place(element.at),
                    element: element.tag,
                    node: *tag,
                });
            };
            nodes.push(n);
        }
        Ok(())
    }

    /// The cell of an element: a new one, or one that an earlier group has made.
    ///
    /// # Errors
    /// [`MeshError::DuplicateElement`].
    fn cell_of<const D: usize>(
        &self,
        element: &RawElement,
        nodes: &[u32],
        source: &Source,
        known: &mut KnownCells,
        mesh: &mut Mesh<D>,
    ) -> Result<u32, MeshError> {
        let mut key = [u32::MAX; 8];
        let corners = element.shape.linear().node_count();
        key[..corners].copy_from_slice(&nodes[..corners]);
        key.sort_unstable();
        let cell = match known.entry(key) {
            Entry::Vacant(slot) => {
                let cell = mesh.cell_count() as u32;
                slot.insert((cell, HashSet::from([element.group])));
                mesh.push_cell(element.shape, nodes);
                cell
            }
            Entry::Occupied(mut slot) => {
                let (cell, groups) = slot.get_mut();
                if !groups.insert(element.group) {
                    let first = self.cell_tag(D, *cell as usize);
                    return Err(MeshError::DuplicateElement {
                        path: source.file(element.at),
                        place: source.place(element.at),
                        element: element.tag,
                        first,
                    });
                }
                *cell
            }
        };
        Ok(cell)
    }

    /// Number of each node tag; refuses a tag that comes twice and coordinates that are no numbers.
    pub(super) fn number_nodes(&self, source: &Source) -> Result<HashMap<u64, u32>, MeshError> {
        let mut numbers = HashMap::with_capacity(self.nodes.len());
        for (i, node) in self.nodes.iter().enumerate() {
            if let Some(first) = numbers.insert(node.tag, i as u32) {
                return Err(MeshError::DuplicateTag {
                    path: source.file(node.at),
                    place: source.place(node.at),
                    node: node.tag,
                    first: source.place(self.nodes[first as usize].at),
                });
            }
            if let Some(k) = node.x.iter().position(|v| !v.is_finite()) {
                return Err(MeshError::NonFinite {
                    path: source.file(node.at),
                    place: source.place(node.at),
                    node: node.tag,
                    axis: axis_name(k),
                    value: node.x[k],
                });
            }
        }
        Ok(numbers)
    }

    /// The tag of the first element that became cell number `cell`.
    pub(super) fn cell_tag(&self, dimension: usize, cell: usize) -> u64 {
        let mut seen = HashSet::new();
        self.elements
            .iter()
            .filter(|e| e.shape.dimension() == dimension)
            .filter(|e| {
                let mut tags = self.element_nodes[e.start..][..e.shape.node_count()].to_vec();
                tags.sort_unstable();
                seen.insert(tags)
            })
            .nth(cell)
            .map_or(0, |e| e.tag)
    }

    /// The tags of the nodes of a mesh of this dimension, in its order: of those that its cells use.
    pub(super) fn tags_of_nodes(&self, dimension: usize) -> Vec<u64> {
        let cells = self.elements.iter();
        let cells = cells.filter(|e| e.shape.dimension() == dimension);
        let tags = |e: &RawElement| &self.element_nodes[e.start..][..e.shape.node_count()];
        let used: HashSet<u64> = cells.flat_map(tags).copied().collect();
        let all = self.nodes.iter().map(|node| node.tag);
        all.filter(|tag| used.contains(tag)).collect()
    }

    /// Refuses nodes of cells with a coordinate beyond the mesh's dimension.
    pub(super) fn check_plane<const D: usize>(
        &self,
        mesh: &Mesh<D>,
        source: &Source,
    ) -> Result<(), MeshError> {
        let (lo, hi) = mesh.bounds();
        let tolerance = OUT_OF_PLANE * (hi - lo).amax();
        for &n in &mesh.connectivity {
            let node = &self.nodes[n as usize];
            for k in D..3 {
                if node.x[k].abs() > tolerance {
                    return Err(MeshError::OutOfPlane {
                        path: source.file(node.at),
                        place: source.place(node.at),
                        node: node.tag,
                        axis: axis_name(k),
                        value: node.x[k],
                        dimension: D,
                    });
                }
            }
        }
        Ok(())
    }
}
