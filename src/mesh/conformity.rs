//! Conformity of cells, which have to meet face to face: else the body tears there, or counts twice.

use rustc_hash::FxHashMap;

use super::boundary::{BoundaryFacet, closest_point};
use super::error::position;
use super::{Mesh, MeshError, facet_corners};
use crate::tensor::Vector;

/// A node this near to a facet lies on it, over the longest side of the facet.
const ON_FACET: f64 = 1e-6;

/// Refuses a facet of three cells, and a node that lies on a facet at the boundary of its body of which it is none; `twins` has for each node the first one at its place.
///
/// # Errors
/// [`MeshError::CrowdedFacet`], [`MeshError::HangingNode`].
pub(super) fn check<const D: usize>(
    mesh: &Mesh<D>,
    bodies: &[u32],
    twins: &[u32],
) -> Result<(), MeshError> {
    if D == 1 {
        return Ok(());
    }
    // of three cells at a facet two find each other, and the third is left alone
    let outer = mesh.outer_facets();
    let keys = outer.iter().map(BoundaryFacet::key::<D>);
    let mut found: FxHashMap<[u32; 4], bool> = keys.map(|key| (key, false)).collect();
    for c in 0..mesh.cell_count() as u32 {
        for (_, key) in mesh.keys_of_cell(c) {
            match found.get_mut(&key) {
                Some(true) => {
                    let centroid = position(mesh.centroid(c as usize).as_slice());
                    return Err(MeshError::CrowdedFacet { cell: c, centroid });
                }
                Some(is_met) => *is_met = true,
                None => {}
            }
        }
    }
    check_nodes(mesh, &outer, bodies, twins)
}

/// Looks for nodes at the boundary that lie on facets of others: along a skew line, on which grids do not pile up.
fn check_nodes<const D: usize>(
    mesh: &Mesh<D>,
    outer: &[BoundaryFacet],
    bodies: &[u32],
    twins: &[u32],
) -> Result<(), MeshError> {
    let line: Vector<D> = Vector::from_fn(|k, _| [1.0, 0.618_033_988_7, 0.324_717_957_2][k]);
    let mut nodes: Vec<u32> = outer.iter().flat_map(|f| f.nodes.iter().copied()).collect();
    nodes.sort_unstable();
    nodes.dedup();
    let place = |n: u32| mesh.nodes[n as usize];
    let mut order: Vec<(f64, u32)> = nodes.iter().map(|&n| (place(n).dot(&line), n)).collect();
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    for facet in outer {
        let corners: Vec<Vector<D>> = (facet_corners::<D>(&facet.nodes).iter())
            .map(|&n| place(n))
            .collect();
        let (low, high) = (corners.iter().skip(1))
            .fold((corners[0], corners[0]), |(low, high), x| {
                (low.inf(x), high.sup(x))
            });
        let reach = ON_FACET * (high - low).amax();
        let along = corners.iter().map(|x| x.dot(&line));
        let (first, last) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), s| {
            (a.min(s), b.max(s))
        });
        let begin = order.partition_point(|(s, _)| *s < first - reach * line.norm());
        let near = order[begin..].iter();
        for &(_, n) in near.take_while(|(s, _)| *s <= last + reach * line.norm()) {
            let x = place(n);
            let is_outside = (0..D).any(|k| x[k] < low[k] - reach || x[k] > high[k] + reach);
            let is_other = bodies[n as usize] != bodies[facet.nodes[0] as usize];
            let is_own = |m: &u32| twins[*m as usize] == twins[n as usize];
            if is_outside || is_other || facet.nodes.iter().any(is_own) {
                continue;
            }
            let mut triangles = vec![corners.clone()];
            if let [a, _, c, d] = corners[..] {
                triangles.push(vec![a, c, d]);
            }
            let is_on = |t: &Vec<Vector<D>>| (closest_point(&x, t).0 - x).norm() <= reach;
            if triangles.iter().any(is_on) {
                return Err(MeshError::HangingNode {
                    node: n,
                    position: position(x.as_slice()),
                    cell: facet.cell,
                    centroid: position(mesh.centroid(facet.cell as usize).as_slice()),
                });
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::CellShape;
    use super::super::generate::{Axis, Grid};
    use super::*;

    /// Of a mesh that is one body.
    fn check<const D: usize>(mesh: &Mesh<D>) -> Result<(), MeshError> {
        let own: Vec<u32> = (0..mesh.nodes.len() as u32).collect();
        super::check(mesh, &vec![0; mesh.nodes.len()], &own)
    }

    /// Quadrilaterals by their corners.
    fn mesh(nodes: &[[f64; 2]], cells: &[[u32; 4]]) -> Mesh<2> {
        let mut mesh = Mesh {
            nodes: nodes.iter().map(|x| Vector::from(*x)).collect(),
            ..Mesh::default()
        };
        for cell in cells {
            mesh.push_cell(CellShape::Quad4, cell);
        }
        mesh
    }

    #[test]
    fn a_node_on_an_edge_of_another_cell_is_refused() {
        let nodes = [
            [0.0, 0.0],
            [1.0, 0.0],
            [1.0, 1.0],
            [0.0, 1.0],
            [2.0, 0.0],
            [2.0, 0.5],
            [1.0, 0.5],
            [2.0, 1.0],
        ];
        let hanging = mesh(&nodes, &[[0, 1, 2, 3], [1, 4, 5, 6], [6, 5, 7, 2]]);
        let message = check(&hanging).unwrap_err().to_string();
        assert!(
            message.contains("node 6 at (1.000000, 0.500000)"),
            "{message}"
        );
        let whole = mesh(&nodes, &[[0, 1, 2, 3], [1, 4, 7, 2]]);
        assert!(check(&whole).is_ok());
        // of another body a node may lie there
        let mut apart = mesh(&nodes[..4], &[[0, 1, 2, 3]]);
        let others = [[1.0, -0.5], [2.0, -0.5], [2.0, 0.5], [1.0, 0.5]];
        apart.nodes.extend(others.map(Vector::<2>::from));
        apart.push_cell(CellShape::Quad4, &[4, 5, 6, 7]);
        assert!(check(&apart).is_err());
        let own: Vec<u32> = (0..apart.nodes.len() as u32).collect();
        assert!(super::check(&apart, &apart.bodies(), &own).is_ok());
    }

    #[test]
    fn three_cells_at_one_edge_are_refused() {
        let nodes = [
            [0.0, 0.0],
            [1.0, 0.0],
            [1.0, 1.0],
            [0.0, 1.0],
            [2.0, 0.0],
            [2.0, 1.0],
            [1.5, 0.0],
            [1.5, 1.0],
        ];
        let crowded = mesh(&nodes, &[[0, 1, 2, 3], [1, 4, 5, 2], [1, 6, 7, 2]]);
        let message = check(&crowded).unwrap_err().to_string();
        assert!(message.contains("three cells"), "{message}");
    }

    #[test]
    fn grids_with_holes_conform() {
        let axis = || Axis::Uniform {
            min: 0.0,
            max: 1.0,
            cells: 6,
        };
        let mut grid = Grid::<3>::new([axis(), axis(), axis()]);
        grid.simplices();
        assert!(check(&grid.jitter(0.1, 7).mesh().unwrap()).is_ok());
        assert!(check(&Grid::<3>::new([axis(), axis(), axis()]).mesh().unwrap()).is_ok());
    }
}
