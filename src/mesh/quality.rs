//! Sizes and shapes of cells, and the checks that refuse a mesh no element can live on.

use super::error::position;
use super::twins::Twins;
use super::{Mesh, MeshError, cell_shape::MOST_CORNERS, conformity};
use crate::tensor::{Tensor, Vector, determinant, padded};

/// A corner whose scaled Jacobian is at or below this counts as degenerate.
///
/// Round-off in the edges of a flat cell far from the origin leaves about 1e-13; a cell of usable shape has 1e-2 or more.
pub const SMALLEST_SCALED_JACOBIAN: f64 = 1e-12;

/// A cell whose longest edge is more than this many times its shortest is too thin: round-off of an even stretch grows like 6e-16 times the square of
/// that ratio (`bondline verify extremes`), so that 1e-6 of it would be wrong.
pub const LARGEST_EDGE_RATIO: f64 = 3e4;

/// Quality of a mesh, as [`check`] measures it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Shortest edge of all cells \[length\].
    pub shortest_edge: f64,
    /// Longest edge of all cells \[length\].
    pub longest_edge: f64,
    /// Smallest scaled Jacobian at any corner: 1 for a square corner, 0 for a flat one.
    pub smallest_scaled_jacobian: f64,
    /// Volume of all cells (area in 2D, length in 1D) [length^D].
    pub volume: f64,
}

impl<const D: usize> Mesh<D> {
    /// Exact signed volume of cell `c` (area in 2D, length in 1D); negative if its nodes run the wrong way round. Of a cell of second order that of its corners.
    ///
    /// Zero for a cell whose dimension is not `D`. Units: [length^D].
    pub fn cell_volume(&self, c: usize) -> f64 {
        let shape = self.shapes[c];
        if shape.dimension() != D {
            return 0.0;
        }
        let nodes = self.corners(c);
        let mut x = [Vector::<3>::zeros(); MOST_CORNERS];
        for (x, &n) in x.iter_mut().zip(nodes) {
            *x = padded(&self.nodes[n as usize]).into();
        }
        shape.volume_of_corners(&x[..nodes.len()])
    }

    /// Smallest determinant of the edges at any corner of cell `c`, divided by their lengths; 0 if an edge has no length.
    pub fn scaled_jacobian(&self, c: usize) -> f64 {
        let nodes = self.cell(c);
        let mut smallest = f64::INFINITY;
        for (corner, neighbours) in self.shapes[c].corner_edges() {
            let mut edges = Tensor::<D>::zeros();
            if neighbours.len() != D {
                return 0.0;
            }
            for (k, &n) in neighbours.iter().enumerate() {
                let edge: Vector<D> =
                    self.nodes[nodes[n] as usize] - self.nodes[nodes[*corner] as usize];
                let length = edge.norm();
                if length == 0.0 {
                    return 0.0;
                }
                edges.set_column(k, &(edge / length));
            }
            smallest = smallest.min(determinant(&edges));
        }
        smallest
    }
}

/// Measures a mesh and refuses one that no element can live on.
///
/// # Errors
/// Named by number, place and value: a reference to a node or cell that does not exist, a coordinate that is no number,
/// a node without a cell, two nodes at one place, an inverted or degenerate cell, cells that do not meet face to face.
pub fn check<const D: usize>(mesh: &Mesh<D>) -> Result<Quality, MeshError> {
    check_bodies(mesh, false, false)
}

/// As [`check`], of bodies that may touch each other, with nodes at one place or on faces of another, where `may_touch`. Nodes of a body at one place are taken where they lie along a crack, or where they `may_coincide`.
///
/// # Errors
/// As [`check`].
pub fn check_bodies<const D: usize>(
    mesh: &Mesh<D>,
    may_touch: bool,
    may_coincide: bool,
) -> Result<Quality, MeshError> {
    check_references(mesh)?;
    for (node, x) in mesh.nodes.iter().enumerate() {
        if !x.iter().all(|v| v.is_finite()) {
            let position = position(x.as_slice());
            return Err(MeshError::NonFiniteNode { node, position });
        }
    }
    let mut used = vec![false; mesh.nodes.len()];
    for &n in &mesh.connectivity {
        used[n as usize] = true;
    }
    if let Some(node) = used.iter().position(|u| !u) {
        let position = position(mesh.nodes[node].as_slice());
        return Err(MeshError::IsolatedNode { node, position });
    }
    let bodies = if may_touch {
        mesh.bodies()
    } else {
        vec![0; mesh.nodes.len()]
    };
    let twins = Twins::of(mesh, &bodies);
    if let Some(([first, second], _)) = twins.pair
        && !may_coincide
        && !twins.lie_along_cracks(mesh)
    {
        let place = |n: u32| mesh.nodes[n as usize];
        return Err(MeshError::CoincidentNodes {
            first,
            second,
            position: position(place(first).as_slice()),
            distance: (place(first) - place(second)).norm(),
        });
    }
    let mut quality = Quality {
        shortest_edge: f64::INFINITY,
        longest_edge: 0.0,
        smallest_scaled_jacobian: f64::INFINITY,
        volume: 0.0,
    };
    for cell in 0..mesh.cell_count() {
        let value = mesh.scaled_jacobian(cell);
        let volume = mesh.cell_volume(cell);
        let (shape, centroid) = (mesh.shapes[cell], position(mesh.centroid(cell).as_slice()));
        // a cell folded at one corner is not mended by reversing it
        if value < -SMALLEST_SCALED_JACOBIAN && volume < 0.0 {
            return Err(MeshError::Inverted {
                cell,
                shape,
                centroid,
                value,
            });
        }
        if value <= SMALLEST_SCALED_JACOBIAN || volume <= 0.0 {
            return Err(MeshError::Degenerate {
                cell,
                shape,
                centroid,
                value,
                limit: SMALLEST_SCALED_JACOBIAN,
            });
        }
        let (shortest, longest) = edges(mesh, cell);
        quality.shortest_edge = quality.shortest_edge.min(shortest);
        quality.longest_edge = quality.longest_edge.max(longest);
        quality.smallest_scaled_jacobian = quality.smallest_scaled_jacobian.min(value);
        quality.volume += volume;
    }
    check_thickness(mesh)?;
    conformity::check(mesh, &bodies, &twins.first)?;
    Ok(quality)
}

/// Shortest and longest edge of a cell.
pub(crate) fn edges<const D: usize>(mesh: &Mesh<D>, cell: usize) -> (f64, f64) {
    let nodes = mesh.cell(cell);
    let (mut shortest, mut longest) = (f64::INFINITY, 0.0f64);
    for (corner, neighbours) in mesh.shapes[cell].corner_edges() {
        for &n in *neighbours {
            let edge = mesh.nodes[nodes[n] as usize] - mesh.nodes[nodes[*corner] as usize];
            shortest = shortest.min(edge.norm());
            longest = longest.max(edge.norm());
        }
    }
    (shortest, longest)
}

/// Refuses cells far longer than wide, also in a mesh that is right otherwise.
///
/// # Errors
/// [`MeshError::Thin`].
pub fn check_thickness<const D: usize>(mesh: &Mesh<D>) -> Result<(), MeshError> {
    for cell in 0..mesh.cell_count() {
        let (shortest, longest) = edges(mesh, cell);
        // an edge without length is another error
        if shortest > 0.0 && longest > LARGEST_EDGE_RATIO * shortest {
            return Err(MeshError::Thin {
                cell,
                shape: mesh.shapes[cell],
                centroid: position(mesh.centroid(cell).as_slice()),
                ratio: longest / shortest,
                limit: LARGEST_EDGE_RATIO,
            });
        }
    }
    Ok(())
}

/// Refuses references to nodes or cells that do not exist.
fn check_references<const D: usize>(mesh: &Mesh<D>) -> Result<(), MeshError> {
    let count = mesh.nodes.len();
    let check = |holder: &dyn Fn() -> String, kind, numbers: &[u32], count: usize| match numbers
        .iter()
        .find(|&&n| n as usize >= count)
    {
        Some(&number) => Err(MeshError::OutOfRange {
            holder: holder(),
            kind,
            number,
            count,
        }),
        None => Ok(()),
    };
    for c in 0..mesh.cell_count() {
        check(&|| format!("cell {c}"), "node", mesh.cell(c), count)?;
    }
    for (name, set) in &mesh.cell_sets {
        check(
            &|| format!("cell set \"{name}\""),
            "cell",
            set,
            mesh.cell_count(),
        )?;
    }
    for (name, set) in &mesh.facet_sets {
        for facet in set {
            check(&|| format!("facet set \"{name}\""), "node", facet, count)?;
        }
    }
    for (name, set) in &mesh.node_sets {
        check(&|| format!("node set \"{name}\""), "node", set, count)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::generate::{Axis, Grid};
    use super::*;
    use crate::mesh::CellShape;

    fn unit(cells: usize) -> Axis {
        Axis::Uniform {
            min: 0.0,
            max: 1.0,
            cells,
        }
    }

    fn one_cell<const D: usize>(shape: CellShape, nodes: &[[f64; D]]) -> Mesh<D> {
        let mut mesh = Mesh {
            nodes: nodes.iter().map(|x| Vector::from(*x)).collect(),
            ..Mesh::default()
        };
        mesh.push_cell(shape, &(0..nodes.len() as u32).collect::<Vec<_>>());
        mesh
    }

    #[test]
    fn volumes_by_hand() {
        let line = one_cell(CellShape::Line2, &[[1.0], [3.5]]);
        assert_eq!(line.cell_volume(0), 2.5);
        // the area between y = 0 and a roof from (0, 1) to (2, 3)
        let quad = one_cell(
            CellShape::Quad4,
            &[[0.0, 0.0], [2.0, 0.0], [2.0, 3.0], [0.0, 1.0]],
        );
        assert_eq!(quad.cell_volume(0), 4.0);
        let tet = one_cell(
            CellShape::Tet4,
            &[
                [0.0, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [0.0, 2.0, 0.0],
                [0.0, 0.0, 3.0],
            ],
        );
        assert_eq!(tet.cell_volume(0), 1.0);
        // a unit square under the roof z = 1 + x y, twisted: its volume is 1 + 1/4
        let hex = one_cell(
            CellShape::Hex8,
            &[
                [0.0, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [1.0, 1.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, 0.0, 1.0],
                [1.0, 0.0, 1.0],
                [1.0, 1.0, 2.0],
                [0.0, 1.0, 1.0],
            ],
        );
        assert!((hex.cell_volume(0) - 1.25).abs() < 1e-15);
    }

    /// Any subdivision of a cube with moved inner nodes still fills the cube.
    #[test]
    fn volumes_add_up() {
        for dimension_cells in [3, 4] {
            let mut grid = Grid::new([unit(dimension_cells), unit(3), unit(5)]);
            grid.jitter(0.25, 11);
            for mesh in [
                grid.clone().mesh().unwrap(),
                grid.simplices().mesh().unwrap(),
            ] {
                let quality = check(&mesh).unwrap();
                assert!((quality.volume - 1.0).abs() < 1e-13);
                assert!(quality.smallest_scaled_jacobian < 0.99);
                assert!(quality.shortest_edge < 0.2 && quality.longest_edge > 1.0 / 3.0);
            }
        }
    }

    #[test]
    fn squares_are_perfect() {
        let quality = check(&Grid::new([unit(4), unit(2)]).mesh().unwrap()).unwrap();
        assert!((quality.smallest_scaled_jacobian - 1.0).abs() < 1e-15);
        assert_eq!((quality.shortest_edge, quality.longest_edge), (0.25, 0.5));
    }

    #[test]
    fn an_inverted_cell_is_named() {
        let mut mesh = Grid::new([unit(2), unit(2)]).mesh().unwrap();
        mesh.connectivity[4..8].reverse();
        let message = check(&mesh).unwrap_err().to_string();
        assert!(
            message.contains("cell 1 (Quad4)")
                && message.contains("(0.750000, 0.250000)")
                && message.contains("inverted")
                && message.contains("-1.000e0")
                && message.contains("reverse"),
            "{message}"
        );
        let line = one_cell(CellShape::Line2, &[[1.0], [0.5]]);
        assert!(matches!(
            check(&line),
            Err(MeshError::Inverted { cell: 0, .. })
        ));
    }

    #[test]
    fn flat_and_folded_cells_are_named() {
        let flat = one_cell(CellShape::Tri3, &[[0.0, 0.0], [1.0, 0.1], [2.0, 0.2]]);
        let message = check(&flat).unwrap_err().to_string();
        assert!(
            message.contains("cell 0 (Tri3)") && message.contains("degenerate"),
            "{message}"
        );
        let dart = one_cell(
            CellShape::Quad4,
            &[[0.0, 0.0], [2.0, 0.0], [0.5, 0.5], [0.0, 2.0]],
        );
        assert!(matches!(check(&dart), Err(MeshError::Degenerate { value, .. }) if value < -0.1));
    }

    #[test]
    fn bad_nodes_are_named() {
        let good = Grid::new([unit(3), unit(3)]).mesh().unwrap();
        let mut mesh = good.clone();
        mesh.nodes[5].y = f64::NAN;
        let message = check(&mesh).unwrap_err().to_string();
        assert!(
            message.contains("node 5") && message.contains("NaN"),
            "{message}"
        );

        let mut mesh = good.clone();
        mesh.nodes.push(Vector::from([7.0, 8.0]));
        let message = check(&mesh).unwrap_err().to_string();
        assert!(
            message.contains("node 16 at (7.0") && message.contains("no cell"),
            "{message}"
        );

        // the last cell gets a node of its own where it should share node 5
        let mut mesh = good.clone();
        mesh.nodes.push(mesh.nodes[15]);
        for n in &mut mesh.connectivity {
            *n = if *n == 15 { 16 } else { *n };
        }
        mesh.nodes[15] = mesh.nodes[10] + Vector::from([1e-14, 0.0]);
        mesh.push_cell(CellShape::Tri3, &[5, 15, 9]);
        let message = check(&mesh).unwrap_err().to_string();
        assert!(
            message.contains("nodes 10 and 15 both lie at (0.666667, 0.666667)"),
            "{message}"
        );

        let mut mesh = good;
        mesh.node_sets.insert("pin".into(), vec![3, 99]);
        let message = check(&mesh).unwrap_err().to_string();
        assert!(
            message.contains("node set \"pin\" refers to node 99"),
            "{message}"
        );
    }
}
