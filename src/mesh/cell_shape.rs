//! The shapes of cells: data of each for the mesh, its readers and the writer of files, one entry of a table.
//!
//! A new shape is a variant of [`CellShape`], its [`Geometry`] and a line in [`GEOMETRY`]. In every shape corners come first, in the order of the linear shape, so
//! that a cell of second order without its other nodes is a linear cell.

use crate::tensor::Vector;

/// The shapes of cells. Node order is that of VTK: corners first, then the nodes in the middle of edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum CellShape {
    /// A single point; only in output, where each peridynamic point is one.
    Vertex,
    /// Two-node line.
    Line2,
    /// Three-node triangle.
    Tri3,
    /// Four-node quadrilateral, counter-clockwise.
    Quad4,
    /// Four-node tetrahedron.
    Tet4,
    /// Eight-node hexahedron: bottom face counter-clockwise, then top face.
    Hex8,
    /// Three-node line: both ends, then the middle.
    Line3,
    /// Six-node triangle.
    Tri6,
    /// Eight-node quadrilateral.
    Quad8,
    /// Ten-node tetrahedron.
    Tet10,
    /// Twenty-node hexahedron: the edges of the bottom face, of the top face, then those between.
    Hex20,
}

/// Description of a shape.
#[derive(Clone, Copy)]
struct Geometry {
    shape: CellShape,
    /// Name in meshio, numbers in Gmsh and in VTK.
    names: (&'static str, i64, u8),
    /// Topological dimension.
    dimension: usize,
    /// Number of nodes.
    nodes: usize,
    /// The shape of the corners alone, and that with nodes in the middle of edges too.
    orders: [CellShape; 2],
    /// Local nodes of each facet (point, edge or face): corners so that the normal points outwards, then the nodes in the middle of its edges.
    facets: &'static [&'static [usize]],
    /// The ends of the edge of each node after the corners.
    mid_sides: &'static [[usize; 2]],
    /// Positions of the nodes after the corners in Gmsh's order; empty where it is VTK's order.
    gmsh_order: &'static [usize],
    /// For each corner, its neighbours along edges, ordered so that their determinant is positive in a good cell.
    corners: &'static [(usize, &'static [usize])],
    /// Signed length, area or volume of the cell with these corners, of which there are at most [`MOST_CORNERS`].
    volume: fn(&[Vector<3>]) -> f64,
    /// Cells of the shape that together are a line, a quadrilateral or a hexahedron, by its corners; of a shape of second order its linear one.
    in_box: &'static [&'static [usize]],
}

/// Of a hexahedron.
pub(super) const MOST_CORNERS: usize = 8;

/// By the number of the shape.
static GEOMETRY: [&Geometry; 11] = [
    &VERTEX, &LINE2, &TRI3, &QUAD4, &TET4, &HEX8, &LINE3, &TRI6, &QUAD8, &TET10, &HEX20,
];

impl CellShape {
    fn geometry(self) -> &'static Geometry {
        GEOMETRY[self as usize]
    }

    /// Every shape.
    pub fn all() -> impl Iterator<Item = Self> {
        GEOMETRY.iter().map(|geometry| geometry.shape)
    }

    /// Number of nodes.
    pub fn node_count(self) -> usize {
        self.geometry().nodes
    }

    /// Topological dimension.
    pub fn dimension(self) -> usize {
        self.geometry().dimension
    }

    /// Local node numbers of each facet (point, edge or face), ordered so that the facet's normal points outwards.
    pub fn facets(self) -> &'static [&'static [usize]] {
        self.geometry().facets
    }

    /// The shape of the corners alone.
    pub fn linear(self) -> Self {
        self.geometry().orders[0]
    }

    /// The shape with nodes in the middle of its edges too.
    pub fn quadratic(self) -> Self {
        self.geometry().orders[1]
    }

    /// Returns true if it has nodes in the middle of its edges.
    pub fn is_quadratic(self) -> bool {
        self != self.linear()
    }

    /// The nodes of the same cell the other way round.
    pub(super) fn reversed(self) -> Vec<usize> {
        let corners: &[usize] = match self.linear() {
            Self::Line2 => &[1, 0],
            Self::Tri3 => &[0, 2, 1],
            Self::Quad4 => &[0, 3, 2, 1],
            Self::Tet4 => &[0, 2, 1, 3],
            Self::Hex8 => &[4, 5, 6, 7, 0, 1, 2, 3],
            _ => &[0],
        };
        let is_edge =
            |a: usize, b: usize| move |side: &[usize; 2]| *side == [a, b] || *side == [b, a];
        let sides = self.mid_sides().iter().map(|&[p, q]| {
            let of = self
                .mid_sides()
                .iter()
                .position(is_edge(corners[p], corners[q]));
            corners.len() + of.unwrap_or(0)
        });
        corners.iter().copied().chain(sides).collect()
    }

    /// The local ends of the edge of each node after the corners.
    pub fn mid_sides(self) -> &'static [[usize; 2]] {
        self.geometry().mid_sides
    }

    /// Its name in meshio.
    pub fn meshio_name(self) -> &'static str {
        self.geometry().names.0
    }

    /// The number that VTK gives it.
    pub fn vtk_type(self) -> u8 {
        self.geometry().names.2
    }

    /// The shape to which VTK gives a number.
    pub fn of_vtk(number: u8) -> Option<Self> {
        Self::all().find(|shape| shape.vtk_type() == number)
    }

    /// The number that Gmsh gives it.
    pub fn gmsh_type(self) -> i64 {
        self.geometry().names.1
    }

    /// The shape to which Gmsh gives a number.
    pub(super) fn of_gmsh(number: i64) -> Option<Self> {
        Self::all().find(|shape| shape.gmsh_type() == number)
    }

    /// Positions of the nodes after the corners in Gmsh's order; empty where it is VTK's order.
    ///
    /// Source: the reference manual of Gmsh, "Node ordering".
    pub(super) fn gmsh_order(self) -> &'static [usize] {
        self.geometry().gmsh_order
    }

    /// For each corner, its neighbours along edges, ordered so that their determinant is positive in a good cell.
    pub(super) fn corner_edges(self) -> &'static [(usize, &'static [usize])] {
        self.linear().geometry().corners
    }

    /// Signed length, area or volume of a cell with these corners.
    pub(super) fn volume_of_corners(self, corners: &[Vector<3>]) -> f64 {
        (self.linear().geometry().volume)(corners)
    }

    /// Cells of the linear shape that together are a line, a quadrilateral or a hexahedron, by the corners of that.
    pub fn in_box(self) -> &'static [&'static [usize]] {
        self.linear().geometry().in_box
    }
}

/// `det [a b c]`.
fn det3(a: &Vector<3>, b: &Vector<3>, c: &Vector<3>) -> f64 {
    let m = [a, b, c];
    (0..3)
        .map(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            m[k][0] * (m[i][1] * m[j][2] - m[j][1] * m[i][2])
        })
        .sum()
}

/// `det [a b]` of the first two components.
fn det2(a: &Vector<3>, b: &Vector<3>) -> f64 {
    a[0] * b[1] - b[0] * a[1]
}

/// The determinant of the Jacobian is quadratic in each coordinate, hence two Gauss points along each are exact.
fn volume_of_hexahedron(x: &[Vector<3>]) -> f64 {
    let g = 0.5 / 3.0f64.sqrt();
    let mut volume = 0.0;
    for point in 0..8 {
        let at = [0, 1, 2].map(|k| match point >> k & 1 {
            0 => 0.5 - g,
            _ => 0.5 + g,
        });
        let mut jacobian = [Vector::<3>::zeros(); 3];
        for i in 0..8 {
            // corners in VTK order: x of corners 1, 2, 5, 6; y of 2, 3, 6, 7; z of 4 to 7
            let bit = [(i & 1) ^ (i >> 1 & 1), i >> 1 & 1, i >> 2];
            let factor = |k: usize| if bit[k] == 0 { 1.0 - at[k] } else { at[k] };
            for (k, side) in bit.iter().enumerate() {
                let sign = if *side == 0 { -1.0 } else { 1.0 };
                let slope = sign * factor((k + 1) % 3) * factor((k + 2) % 3);
                jacobian[k] += x[i] * slope;
            }
        }
        volume += det3(&jacobian[0], &jacobian[1], &jacobian[2]) / 8.0;
    }
    volume
}

const VERTEX: Geometry = Geometry {
    shape: CellShape::Vertex,
    names: ("vertex", 15, 1),
    dimension: 0,
    nodes: 1,
    orders: [CellShape::Vertex, CellShape::Vertex],
    facets: &[],
    mid_sides: &[],
    gmsh_order: &[],
    corners: &[],
    volume: |_| 0.0,
    in_box: &[],
};

const LINE2: Geometry = Geometry {
    shape: CellShape::Line2,
    names: ("line", 1, 3),
    dimension: 1,
    nodes: 2,
    orders: [CellShape::Line2, CellShape::Line3],
    facets: &[&[0], &[1]],
    mid_sides: &[],
    gmsh_order: &[],
    corners: &[(0, &[1])],
    volume: |x| (x[1] - x[0])[0],
    in_box: &[&[0, 1]],
};

const LINE3: Geometry = Geometry {
    shape: CellShape::Line3,
    names: ("line3", 8, 21),
    nodes: 3,
    mid_sides: &[[0, 1]],
    ..LINE2
};

const TRI3: Geometry = Geometry {
    shape: CellShape::Tri3,
    names: ("triangle", 2, 5),
    dimension: 2,
    nodes: 3,
    orders: [CellShape::Tri3, CellShape::Tri6],
    facets: &[&[0, 1], &[1, 2], &[2, 0]],
    mid_sides: &[],
    gmsh_order: &[],
    corners: &[(0, &[1, 2]), (1, &[2, 0]), (2, &[0, 1])],
    volume: |x| det2(&(x[1] - x[0]), &(x[2] - x[0])) / 2.0,
    in_box: &[&[0, 1, 2], &[0, 2, 3]],
};

const TRI6: Geometry = Geometry {
    shape: CellShape::Tri6,
    names: ("triangle6", 9, 22),
    nodes: 6,
    facets: &[&[0, 1, 3], &[1, 2, 4], &[2, 0, 5]],
    mid_sides: &[[0, 1], [1, 2], [2, 0]],
    ..TRI3
};

const QUAD4: Geometry = Geometry {
    shape: CellShape::Quad4,
    names: ("quad", 3, 9),
    dimension: 2,
    nodes: 4,
    orders: [CellShape::Quad4, CellShape::Quad8],
    facets: &[&[0, 1], &[1, 2], &[2, 3], &[3, 0]],
    mid_sides: &[],
    gmsh_order: &[],
    corners: &[(0, &[1, 3]), (1, &[2, 0]), (2, &[3, 1]), (3, &[0, 2])],
    volume: |x| det2(&(x[2] - x[0]), &(x[3] - x[1])) / 2.0,
    in_box: &[&[0, 1, 2, 3]],
};

const QUAD8: Geometry = Geometry {
    shape: CellShape::Quad8,
    names: ("quad8", 16, 23),
    nodes: 8,
    facets: &[&[0, 1, 4], &[1, 2, 5], &[2, 3, 6], &[3, 0, 7]],
    mid_sides: &[[0, 1], [1, 2], [2, 3], [3, 0]],
    ..QUAD4
};

const TET4: Geometry = Geometry {
    shape: CellShape::Tet4,
    names: ("tetra", 4, 10),
    dimension: 3,
    nodes: 4,
    orders: [CellShape::Tet4, CellShape::Tet10],
    facets: &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[0, 3, 2]],
    mid_sides: &[],
    gmsh_order: &[],
    corners: &[
        (0, &[1, 2, 3]),
        (1, &[2, 0, 3]),
        (2, &[0, 1, 3]),
        (3, &[0, 2, 1]),
    ],
    volume: |x| det3(&(x[1] - x[0]), &(x[2] - x[0]), &(x[3] - x[0])) / 6.0,
    // around the diagonal from corner 0 to corner 6
    in_box: &[
        &[0, 1, 2, 6],
        &[0, 2, 3, 6],
        &[0, 3, 7, 6],
        &[0, 7, 4, 6],
        &[0, 4, 5, 6],
        &[0, 5, 1, 6],
    ],
};

const TET10: Geometry = Geometry {
    shape: CellShape::Tet10,
    names: ("tetra10", 11, 24),
    nodes: 10,
    facets: &[
        &[0, 2, 1, 6, 5, 4],
        &[0, 1, 3, 4, 8, 7],
        &[1, 2, 3, 5, 9, 8],
        &[0, 3, 2, 7, 9, 6],
    ],
    mid_sides: &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]],
    gmsh_order: &[4, 5, 6, 7, 9, 8],
    ..TET4
};

const HEX8: Geometry = Geometry {
    shape: CellShape::Hex8,
    names: ("hexahedron", 5, 12),
    dimension: 3,
    nodes: 8,
    orders: [CellShape::Hex8, CellShape::Hex20],
    facets: &[
        &[0, 3, 2, 1],
        &[4, 5, 6, 7],
        &[0, 1, 5, 4],
        &[1, 2, 6, 5],
        &[2, 3, 7, 6],
        &[3, 0, 4, 7],
    ],
    mid_sides: &[],
    gmsh_order: &[],
    corners: &[
        (0, &[1, 3, 4]),
        (1, &[2, 0, 5]),
        (2, &[3, 1, 6]),
        (3, &[0, 2, 7]),
        (4, &[7, 5, 0]),
        (5, &[4, 6, 1]),
        (6, &[5, 7, 2]),
        (7, &[6, 4, 3]),
    ],
    volume: volume_of_hexahedron,
    in_box: &[&[0, 1, 2, 3, 4, 5, 6, 7]],
};

const HEX20: Geometry = Geometry {
    shape: CellShape::Hex20,
    names: ("hexahedron20", 17, 25),
    nodes: 20,
    facets: &[
        &[0, 3, 2, 1, 11, 10, 9, 8],
        &[4, 5, 6, 7, 12, 13, 14, 15],
        &[0, 1, 5, 4, 8, 17, 12, 16],
        &[1, 2, 6, 5, 9, 18, 13, 17],
        &[2, 3, 7, 6, 10, 19, 14, 18],
        &[3, 0, 4, 7, 11, 16, 15, 19],
    ],
    mid_sides: &[
        [0, 1],
        [1, 2],
        [2, 3],
        [3, 0],
        [4, 5],
        [5, 6],
        [6, 7],
        [7, 4],
        [0, 4],
        [1, 5],
        [2, 6],
        [3, 7],
    ],
    gmsh_order: &[8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15],
    ..HEX8
};

#[cfg(test)]
mod tests {
    use super::*;

    /// The corners of a line, a square or a cube.
    fn corner(i: usize) -> Vector<3> {
        let [x, y] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]][i % 4];
        Vector::<3>::new(x, y, (i / 4) as f64)
    }

    #[test]
    fn each_shape_has_its_place_in_the_table_and_names_of_its_own() {
        for (place, geometry) in GEOMETRY.iter().enumerate() {
            assert_eq!(geometry.shape as usize, place);
            let same = |other: &&&Geometry| {
                let (a, b) = (geometry.names, other.names);
                a.0 == b.0 || a.1 == b.1 || a.2 == b.2
            };
            assert_eq!(GEOMETRY.iter().filter(same).count(), 1);
            let shape = geometry.shape;
            assert_eq!(CellShape::of_vtk(shape.vtk_type()), Some(shape));
            assert_eq!(shape.linear().quadratic(), shape.quadratic());
            let corners = shape.linear().node_count();
            assert_eq!(shape.node_count(), corners + shape.mid_sides().len());
            assert!(!shape.is_quadratic() || shape.quadratic() == shape);
        }
    }

    /// Facets and their normals, corners and their edges, volumes: of the cells that fill a box.
    #[test]
    fn shapes_fill_a_box_with_facets_that_look_outwards() {
        for shape in CellShape::all().filter(|shape| shape.dimension() > 0) {
            let mut volume = 0.0;
            for cell in shape.in_box() {
                assert_eq!(cell.len(), shape.linear().node_count());
                let x = |i: usize| corner(cell[i]);
                let corners: Vec<Vector<3>> = (0..cell.len()).map(x).collect();
                volume += shape.volume_of_corners(&corners);
                let centre = (0..cell.len()).map(x).sum::<Vector<3>>() / cell.len() as f64;
                for facet in shape.linear().facets() {
                    let (a, b) = (x(facet[0]), x(facet[facet.len() - 1]));
                    let normal = match shape.dimension() {
                        1 => a - centre,
                        2 => Vector::<3>::new(b[1] - a[1], a[0] - b[0], 0.0),
                        _ => (x(facet[1]) - a).cross(&(b - a)),
                    };
                    assert!(normal.dot(&(a - centre)) > 0.0, "{shape:?} {facet:?}");
                }
                for (at, neighbours) in shape.corner_edges() {
                    let edges: Vec<Vector<3>> = neighbours.iter().map(|&n| x(n) - x(*at)).collect();
                    let spanned = match edges[..] {
                        [a] => a[0],
                        [a, b] => det2(&a, &b),
                        [a, b, c] => det3(&a, &b, &c),
                        _ => panic!("{shape:?}"),
                    };
                    assert!(spanned > 0.0, "{shape:?} {at}");
                }
            }
            assert!((volume - 1.0).abs() < 1e-14, "{shape:?}: {volume}");
            // nodes in the middle of edges: on each facet those of its edges
            for (facet, linear) in shape.facets().iter().zip(shape.linear().facets()) {
                let corners = linear.len();
                assert_eq!(&facet[..corners], *linear);
                for (k, &side) in facet[corners..].iter().enumerate() {
                    let mut ends = shape.mid_sides()[side - shape.linear().node_count()];
                    let mut wanted = [facet[k], facet[(k + 1) % corners]];
                    ends.sort_unstable();
                    wanted.sort_unstable();
                    assert_eq!(ends, wanted, "{shape:?} {facet:?}");
                }
            }
        }
    }
}
