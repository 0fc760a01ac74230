//! Errors of a mesh or its file.

use std::path::PathBuf;

use super::CellShape;

/// Place of an error in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Line of a text file, counted from 1.
    Line(usize),
    /// Byte of a binary file, counted from 0.
    Byte(usize),
    /// Node, element or set of a mesh in memory, counted from 0.
    Entry(usize),
    /// Nowhere in particular.
    File,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Line(n) => write!(f, "line {n}"),
            Self::Byte(n) => write!(f, "byte {n}"),
            Self::Entry(n) => write!(f, "entry {n}"),
            Self::File => write!(f, "whole file"),
        }
    }
}

/// Error of a mesh that cannot be read, made or used. Every message names place, value and remedy.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// The file cannot be opened or read.
    #[error("{}: {source}; check that the file exists and may be read", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file name ends in nothing that a reader knows.
    #[error("{}: no reader for this file extension; use .msh (Gmsh 4.1 or 2.2), .inp (Abaqus, CalculiX), .vtk, .vtu, .vts, .vtr or .vti", path.display())]
    UnknownExtension {
        /// The file.
        path: PathBuf,
    },
    /// The file ends too early.
    #[error("{}: {place}: the file ends within {section}: {wanted} expected; it is truncated, write it again", path.display())]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Place of its end.
        place: Place,
        /// The section that is not complete.
        section: String,
        /// The content expected next.
        wanted: String,
    },
    /// Something else stands where the format wants a certain thing.
    #[error("{}: {place}: {found}, but {wanted} expected; {remedy}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Place of the error.
        place: Place,
        /// The content found there.
        found: String,
        /// The content expected there.
        wanted: String,
        /// Remedy.
        remedy: &'static str,
    },
    /// A version, encoding or section that is not read.
    #[error("{}: {place}: {what} is not supported; {remedy}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// Its place.
        place: Place,
        /// Name of the version, encoding or section.
        what: String,
        /// Remedy.
        remedy: &'static str,
    },
    /// A cell that is none of ours.
    #[error("{}: {place}: element {element} is of type {kind} ({name}), which is not supported; {remedy}", path.display())]
    UnsupportedElement {
        /// The file.
        path: PathBuf,
        /// Place of the element.
        place: Place,
        /// Its number in the file.
        element: u64,
        /// The file's number or word for its type.
        kind: String,
        /// The name of that type.
        name: &'static str,
        /// Remedy.
        remedy: &'static str,
    },
    /// An element refers to a node that the file does not hold.
    #[error("{}: {place}: element {element} refers to node {node}, which is not in the file; save the mesh with all its nodes", path.display())]
    MissingNode {
        /// The file.
        path: PathBuf,
        /// Place of the element.
        place: Place,
        /// Its number in the file.
        element: u64,
        /// The node it wants.
        node: u64,
    },
    /// Two nodes have the same tag.
    #[error("{}: {place}: node {node} was already defined at {first}; renumber the nodes (in Gmsh: gmsh -save)", path.display())]
    DuplicateTag {
        /// The file.
        path: PathBuf,
        /// Place of the second one.
        place: Place,
        /// The tag.
        node: u64,
        /// Place of the first one.
        first: Place,
    },
    /// Two elements have the same number.
    #[error("{}: {place}: element {element} was already defined at {first}; give each element its own number", path.display())]
    DuplicateElementNumber {
        /// The file.
        path: PathBuf,
        /// Place of the second one.
        place: Place,
        /// The number.
        element: u64,
        /// Place of the first one.
        first: Place,
    },
    /// A coordinate that is no number.
    #[error("{}: {place}: coordinate {axis} of node {node} is {value}; every coordinate must be a finite number", path.display())]
    NonFinite {
        /// The file.
        path: PathBuf,
        /// Place of the node.
        place: Place,
        /// The node's number in the file.
        node: u64,
        /// x, y or z.
        axis: char,
        /// Its value.
        value: f64,
    },
    /// A node of a 1D or 2D mesh that does not lie in the line or plane.
    #[error("{}: {place}: node {node} has {axis} = {value}, out of the {dimension}D mesh; flatten the mesh to {axis} = 0 or read it as a mesh of a higher dimension", path.display())]
    OutOfPlane {
        /// The file.
        path: PathBuf,
        /// Place of the node.
        place: Place,
        /// The node's number in the file.
        node: u64,
        /// y or z.
        axis: char,
        /// Its value.
        value: f64,
        /// Dimension of the mesh.
        dimension: usize,
    },
    /// The same cell stands twice in one group.
    #[error("{}: {place}: element {element} has the same nodes as element {first}; remove one of them", path.display())]
    DuplicateElement {
        /// The file.
        path: PathBuf,
        /// Place of the second one.
        place: Place,
        /// Its number in the file.
        element: u64,
        /// Number of the first one.
        first: u64,
    },
    /// There are no nodes or no elements.
    #[error("{}: the mesh is empty ({nodes} nodes, {elements} elements); mesh the geometry before saving it (in Gmsh: gmsh -2 or -3) and save all elements or define physical groups", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
        /// Nodes found.
        nodes: usize,
        /// Elements found.
        elements: usize,
    },
    /// The cells are not of the dimension that was asked for.
    #[error("{}: a mesh of dimension {wanted} was asked for, but the largest cells have dimension {found}; {remedy}", path.display())]
    WrongDimension {
        /// The file.
        path: PathBuf,
        /// Asked for.
        wanted: usize,
        /// Found.
        found: usize,
        /// Remedy.
        remedy: &'static str,
    },
    /// A list of coordinates cannot be made from an axis.
    #[error("axis {axis}: {problem}")]
    Axis {
        /// x, y or z.
        axis: char,
        /// The defect and its remedy.
        problem: String,
    },
    /// A face of a cut-out lies between grid lines.
    #[error(
        "cut-out \"{name}\": its face at {axis} = {value} is not on a grid line; the nearest are {axis} = {below} and {axis} = {above}: move the face or the grid"
    )]
    CutOutOffGrid {
        /// Name of the cut-out.
        name: String,
        /// x, y or z.
        axis: char,
        /// Coordinate of the face.
        value: f64,
        /// Largest grid line below it.
        below: f64,
        /// Smallest grid line above it.
        above: f64,
    },
    /// A cut-out that removes nothing, or everything.
    #[error("cut-out \"{name}\" removes {removed} of {cells} cells; {remedy}")]
    CutOutEmpty {
        /// Name of the cut-out.
        name: String,
        /// Cells in it.
        removed: usize,
        /// Cells of the grid.
        cells: usize,
        /// Remedy.
        remedy: &'static str,
    },
    /// A displacement of nodes that would turn cells inside out.
    #[error("jitter: a fraction of {value} of the spacing can turn cells inside out; use 0 to 0.3")]
    Jitter {
        /// The fraction.
        value: f64,
    },
    /// A cell whose nodes run the wrong way round.
    #[error(
        "cell {cell} ({shape:?}), counted from 0, with its centroid at {centroid} is inverted: its smallest scaled Jacobian is {value:.3e}; reverse its node order (in Gmsh: reverse the surface or volume, or ReorientMesh)"
    )]
    Inverted {
        /// Number of the cell, from 0.
        cell: usize,
        /// Its shape.
        shape: CellShape,
        /// Position of its centroid.
        centroid: String,
        /// Smallest scaled Jacobian at its corners.
        value: f64,
    },
    /// A cell without volume, or folded over at a corner.
    #[error(
        "cell {cell} ({shape:?}), counted from 0, with its centroid at {centroid} is degenerate: its smallest scaled Jacobian is {value:.3e}, more than {limit:.0e} is needed; mesh that region again"
    )]
    Degenerate {
        /// Number of the cell, from 0.
        cell: usize,
        /// Its shape.
        shape: CellShape,
        /// Position of its centroid.
        centroid: String,
        /// Smallest scaled Jacobian at its corners.
        value: f64,
        /// Lower limit of the scaled Jacobian.
        limit: f64,
    },
    /// A cell far longer than wide.
    #[error(
        "cell {cell} ({shape:?}), counted from 0, with its centroid at {centroid} is {ratio:.1e} times as long as it is wide, more than {limit:.0e}: round-off would spoil the strain in it; mesh that region again"
    )]
    Thin {
        /// Number of the cell, from 0.
        cell: usize,
        /// Its shape.
        shape: CellShape,
        /// Position of its centroid.
        centroid: String,
        /// Longest edge over the shortest.
        ratio: f64,
        /// The largest ratio that is taken.
        limit: f64,
    },
    /// Two nodes at one place.
    #[error(
        "nodes {first} and {second} both lie at {position} ({distance:.3e} apart; counted from 0); merge them (mesh.file.merge = 1e-9; in Gmsh: Coherence Mesh; in a deck: Merge Instances), or leave a gap between parts that are not bonded; separate parts that touch need contact = {{}}"
    )]
    CoincidentNodes {
        /// Number of one, from 0.
        first: u32,
        /// Number of the other.
        second: u32,
        /// Their position.
        position: String,
        /// Distance between them.
        distance: f64,
    },
    /// A facet of more than two cells.
    #[error(
        "cell {cell}, counted from 0, with its centroid at {centroid} has a face that two others have as well: three cells overlap there, or the body branches; mesh that region again"
    )]
    CrowdedFacet {
        /// Number of the cell, from 0.
        cell: u32,
        /// Position of its centroid.
        centroid: String,
    },
    /// A node on a face of a cell that is not its own.
    #[error(
        "node {node} at {position}, counted from 0, lies on a face of cell {cell} with its centroid at {centroid}, of which it is no node: the body would tear or overlap there; mesh both sides with the same nodes (in Gmsh: BooleanFragments, Coherence), or leave a gap between parts that are not bonded; separate parts that touch need contact = {{}}"
    )]
    HangingNode {
        /// Number of the node, from 0.
        node: u32,
        /// Position of the node.
        position: String,
        /// Number of the cell, from 0.
        cell: u32,
        /// Position of the cell's centroid.
        centroid: String,
    },
    /// A node whose position is no number.
    #[error("node {node} lies at {position}; every coordinate must be a finite number")]
    NonFiniteNode {
        /// Number of the node, from 0.
        node: usize,
        /// Its position.
        position: String,
    },
    /// A node that no cell uses.
    #[error("node {node} at {position} belongs to no cell; remove it (Mesh::drop_unused_nodes)")]
    IsolatedNode {
        /// Number of the node, from 0.
        node: usize,
        /// Its position.
        position: String,
    },
    /// A cell or set that refers to nothing.
    #[error(
        "{holder} refers to {kind} {number}, but the mesh has only {count}; numbers count from 0"
    )]
    OutOfRange {
        /// The cell or set.
        holder: String,
        /// "node" or "cell".
        kind: &'static str,
        /// Number that it refers to.
        number: u32,
        /// Count of those in the mesh.
        count: usize,
    },
    /// A facet of a set that belongs to no cell.
    #[error(
        "the facet around {position} (nodes {nodes:?}, counted from 0) is no facet of any cell; facet sets must lie on the faces of cells"
    )]
    LooseFacet {
        /// Its nodes.
        nodes: Vec<u32>,
        /// The mean of their places.
        position: String,
    },
}

impl MeshError {
    /// The cells and the nodes of the mesh that it speaks of, counted from 0.
    pub fn numbers(&self) -> [Vec<u32>; 2] {
        match self {
            Self::Inverted { cell, .. }
            | Self::Degenerate { cell, .. }
            | Self::Thin { cell, .. } => [vec![*cell as u32], Vec::new()],
            Self::CoincidentNodes { first, second, .. } => [Vec::new(), vec![*first, *second]],
            Self::CrowdedFacet { cell, .. } => [vec![*cell], Vec::new()],
            Self::HangingNode { node, cell, .. } => [vec![*cell], vec![*node]],
            _ => [Vec::new(), Vec::new()],
        }
    }
}

/// A position as text: `(x, y)`.
pub(super) fn position(x: &[f64]) -> String {
    let parts: Vec<String> = x.iter().map(|v| format!("{v:.6}")).collect();
    format!("({})", parts.join(", "))
}

/// The name of axis `k`.
pub(super) fn axis_name(k: usize) -> char {
    ['x', 'y', 'z'][k.min(2)]
}
