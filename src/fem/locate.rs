//! From a point in space to the cell that holds it and its shape functions there.

use super::cell::PerNode;
use super::divided;
use super::element::reference;
use super::geometry::{jacobian, relative_nodes};
use crate::mesh::Mesh;
use crate::tensor::{Vector, inverse, padded};

/// Shape functions this close to 0 or 1 are taken to be exactly that, so that a point at a node has one weight.
///
/// Coordinates a thousand cells from the origin leave about 1e-12 of rounding in ξ; the gap to 1e-10 is the margin.
const SNAP: f64 = 1e-10;

/// Reference coordinates of the point `x` in cell `c`, or `None` if Newton's method finds none.
///
/// The point may lie outside of the cell; far outside of a distorted quadrilateral or hexahedron there may be no
/// answer. On lines, triangles and tetrahedra with straight sides the map is affine and the first step is exact.
pub fn reference_of<const D: usize>(mesh: &Mesh<D>, c: usize, x: &Vector<D>) -> Option<Vector<D>> {
    let cell = reference(mesh, c)?;
    let (origin, nodes) = relative_nodes(mesh, c);
    let nodes = &nodes[..cell.nodes()];
    let target = x - origin;
    if !target.iter().all(|t| t.is_finite()) {
        return None;
    }
    if mesh.embedded.is_divided(c) {
        return divided::coordinates(cell, nodes, &target);
    }
    let mut xi = Vector::from_fn(|i, _| cell.centre[i]);
    for _ in 0..30 {
        let at = padded(&xi);
        let mut residual = target;
        for (n, x) in (cell.values)(&at).iter().zip(nodes) {
            residual -= x * *n;
        }
        let (inverse, _) = inverse(&jacobian(nodes, &(cell.gradients)(&at)))?;
        let step = inverse * residual;
        xi += step;
        // quadratic convergence: after a step below 1e-9 the error is at rounding
        if step.amax() < 1e-9 {
            return Some(xi);
        }
        if xi.amax() > 1e6 {
            return None;
        }
    }
    None
}

/// Location of a point: a cell and the weights of its nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Located<const D: usize> {
    /// Cell number in the mesh.
    pub cell: usize,
    /// Weights of the cell's nodes, in their order: `x = Σ shape[a] x_a`; they add up to one.
    pub shape: PerNode<f64>,
    /// Number of nodes.
    pub nodes: usize,
    /// Reference coordinates.
    pub reference: Vector<D>,
}

/// Finds the cell that holds a point: a uniform grid of bins over the bounding boxes of cells.
#[derive(Clone, Debug)]
pub struct Locator<const D: usize> {
    low: Vector<D>,
    bin: Vector<D>,
    counts: [usize; D],
    offsets: Vec<u32>,
    cells: Vec<u32>,
    largest: f64,
}

impl<const D: usize> Locator<D> {
    /// Sorts the given cells of a mesh into bins of about the mean cell's extent.
    pub fn new(mesh: &Mesh<D>, cells: impl Iterator<Item = usize>) -> Self {
        let mut selected: Vec<usize> = cells.filter(|&c| reference(mesh, c).is_some()).collect();
        selected.sort_unstable();
        selected.dedup();
        let mut low: Vector<D> = Vector::repeat(f64::INFINITY);
        let mut high: Vector<D> = Vector::repeat(f64::NEG_INFINITY);
        let mut mean: Vector<D> = Vector::zeros();
        let mut largest = 0.0f64;
        for &c in &selected {
            let (a, b) = bounding_box(mesh, c);
            low = low.inf(&a);
            high = high.sup(&b);
            mean += (b - a) / selected.len() as f64;
            largest = largest.max((b - a).amax());
        }
        // flat cells have no extent along an axis, and bins of none would be without number
        let mut bin: Vector<D> = mean.sup(&((high - low) * 1e-6));
        let mut counts = [1usize; D];
        // far-flung cells must not ask for more bins than there are cells to put in them
        while !selected.is_empty() {
            for i in 0..D {
                let n = ((high[i] - low[i]) / bin[i]).ceil();
                counts[i] = if n >= 1.0 { n.min(1e9) as usize } else { 1 };
            }
            let total: f64 = counts.iter().map(|&n| n as f64).product();
            if total <= 4.0 * selected.len() as f64 + 64.0 {
                break;
            }
            bin *= 1.5;
        }
        let mut locator = Self {
            low,
            bin,
            counts,
            offsets: vec![0; counts.iter().product::<usize>() + 1],
            cells: Vec::new(),
            largest,
        };
        for &c in &selected {
            let (a, b) = bounding_box(mesh, c);
            locator.for_bins(&a, &b, |s, n| s.offsets[n + 1] += 1);
        }
        for n in 1..locator.offsets.len() {
            locator.offsets[n] += locator.offsets[n - 1];
        }
        locator.cells = vec![0; locator.offsets.last().copied().unwrap_or(0) as usize];
        let mut next = locator.offsets.clone();
        for &c in &selected {
            let (a, b) = bounding_box(mesh, c);
            locator.for_bins(&a, &b, |s, n| {
                s.cells[next[n] as usize] = c as u32;
                next[n] += 1;
            });
        }
        locator
    }

    /// The cell that holds `x`, and its shape functions there; `None` if no cell does.
    ///
    /// Of several cells that meet at `x` it is the one of the smallest number. `tolerance` is how far outside of a
    /// cell a point may lie, relative to the cell's extent; 1e-9 is a good value. Shape functions within 1e-10 of 0 or 1
    /// are exactly that.
    pub fn locate(&self, mesh: &Mesh<D>, x: &Vector<D>, tolerance: f64) -> Option<Located<D>> {
        let mut best: Option<Located<D>> = None;
        self.around(x, tolerance, |cells| {
            for &c in cells {
                let c = c as usize;
                if best.as_ref().is_some_and(|b| b.cell <= c) {
                    break;
                }
                if let Some(found) = located(mesh, c, x, tolerance) {
                    best = Some(found);
                    break;
                }
            }
        });
        best
    }

    /// Returns true if a cell holds `x`, as [`Locator::locate`] has it: no more than a look at the cell's box where `x` lies inside of a line, a rectangle or a cuboid along the axes.
    pub fn holds(&self, mesh: &Mesh<D>, x: &Vector<D>, tolerance: f64) -> bool {
        let mut is_held = false;
        self.around(x, tolerance, |cells| {
            let holds = |c: usize| {
                let (low, high) = bounding_box(mesh, c);
                let inside = (0..D).all(|i| x[i] > low[i] && x[i] < high[i]);
                (inside && is_box(mesh, c, &low, &high) && !mesh.embedded.is_taken(c, x))
                    || located(mesh, c, x, tolerance).is_some()
            };
            is_held = is_held || cells.iter().any(|&c| holds(c as usize));
        });
        is_held
    }

    /// Visits the cells of each bin within the tolerance of `x`, by ascending number within a bin; none where `x` is not finite.
    fn around(&self, x: &Vector<D>, tolerance: f64, mut visit: impl FnMut(&[u32])) {
        if self.cells.is_empty() || !x.iter().all(|x| x.is_finite()) {
            return;
        }
        let margin = Vector::repeat(tolerance * self.largest);
        let (first, last) = (self.index(&(x - margin)), self.index(&(x + margin)));
        for_grid(&first, &last, &self.counts, |n| {
            visit(&self.cells[self.offsets[n] as usize..self.offsets[n + 1] as usize]);
        });
    }

    /// Bin index of a point, per axis; points outside belong to the bins at the rim.
    fn index(&self, x: &Vector<D>) -> [usize; D] {
        std::array::from_fn(|i| {
            let t = (x[i] - self.low[i]) / self.bin[i];
            // a negative or undefined t becomes 0 in the cast
            (t as usize).min(self.counts[i] - 1)
        })
    }

    fn for_bins(&mut self, a: &Vector<D>, b: &Vector<D>, mut visit: impl FnMut(&mut Self, usize)) {
        let (first, last) = (self.index(a), self.index(b));
        let counts = self.counts;
        for_grid(&first, &last, &counts, |n| visit(self, n));
    }
}

/// Visits the numbers of all bins from `first` to `last`, both included.
fn for_grid<const D: usize>(
    first: &[usize; D],
    last: &[usize; D],
    counts: &[usize; D],
    mut visit: impl FnMut(usize),
) {
    let mut at = *first;
    loop {
        let number = (0..D).rev().fold(0, |n, i| n * counts[i] + at[i]);
        visit(number);
        let mut axis = 0;
        while axis < D {
            if at[axis] < last[axis] {
                at[axis] += 1;
                break;
            }
            at[axis] = first[axis];
            axis += 1;
        }
        if axis == D {
            return;
        }
    }
}

fn bounding_box<const D: usize>(mesh: &Mesh<D>, c: usize) -> (Vector<D>, Vector<D>) {
    let mut low: Vector<D> = Vector::repeat(f64::INFINITY);
    let mut high: Vector<D> = Vector::repeat(f64::NEG_INFINITY);
    for &n in mesh.cell(c) {
        low = low.inf(&mesh.nodes[n as usize]);
        high = high.sup(&mesh.nodes[n as usize]);
    }
    if mesh.shapes[c].is_quadratic() {
        // curved sides reach beyond their nodes
        let beyond = mesh.bulge(c);
        low -= beyond;
        high += beyond;
    }
    (low, high)
}

/// Returns true if a cell fills its bounding box: as many nodes as the box has corners, and each at one.
fn is_box<const D: usize>(mesh: &Mesh<D>, c: usize, low: &Vector<D>, high: &Vector<D>) -> bool {
    let nodes = mesh.cell(c);
    let at_corner = |x: &Vector<D>| (0..D).all(|i| x[i] == low[i] || x[i] == high[i]);
    nodes.len() == 1 << D && nodes.iter().all(|&n| at_corner(&mesh.nodes[n as usize]))
}

/// The point in cell `c`, unless it lies further outside than the tolerance.
fn located<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    x: &Vector<D>,
    tolerance: f64,
) -> Option<Located<D>> {
    let (low, high) = bounding_box(mesh, c);
    // twice, because the box of a skew cell is larger than its extent along a reference axis is short
    let margin = 2.0 * tolerance * (high - low).amax();
    let is_beyond = (0..D).any(|i| x[i] < low[i] - margin || x[i] > high[i] + margin);
    if is_beyond || mesh.embedded.is_taken(c, x) {
        return None;
    }
    let cell = reference(mesh, c)?;
    let xi = reference_of(mesh, c, x)?;
    let at = padded(&xi);
    if (cell.outside)(&at) > tolerance {
        return None;
    }
    let mut shape = (cell.values)(&at);
    snap(&mut shape, cell.nodes());
    Some(Located {
        cell: c,
        shape,
        nodes: cell.nodes(),
        reference: xi,
    })
}

/// Sets shape functions near 0 to exactly that; the largest makes up their sum to one, and is one if it is alone.
fn snap(shape: &mut PerNode<f64>, nodes: usize) {
    let mut largest = 0;
    for a in 0..nodes {
        if shape[a].abs() < SNAP {
            shape[a] = 0.0;
        }
        if shape[a] > shape[largest] {
            largest = a;
        }
    }
    let others: f64 = (0..nodes).filter(|&a| a != largest).map(|a| shape[a]).sum();
    shape[largest] = 1.0 - others;
}

#[cfg(test)]
mod tests {
    use super::super::sample::{boxes, noise, unit_box};
    use super::super::{CELLS, shape_values};
    use super::*;
    use crate::mesh::CellShape;

    fn round_trip<const D: usize>() {
        for mesh in boxes::<D>(5, 0.3) {
            let locator = Locator::new(&mesh, 0..mesh.cell_count());
            for c in 0..mesh.cell_count() {
                // a point strictly inside of the cell, as a mean of its nodes with random weights
                let weights: Vec<f64> =
                    (0..mesh.cell(c).len()).map(|a| 1.2 + noise(c, a)).collect();
                let total: f64 = weights.iter().sum();
                let cell = CELLS.iter().find(|k| k.shape == mesh.shapes[c]).unwrap();
                let mut xi = Vector::<D>::zeros();
                for (w, corner) in weights.iter().zip(cell.corners) {
                    xi += Vector::from_fn(|i, _| corner[i]) * (w / total);
                }
                let (shape, n) = shape_values(&mesh, c, &xi);
                let mut x = Vector::zeros();
                for (&node, weight) in mesh.cell(c).iter().zip(&shape) {
                    x += mesh.nodes[node as usize] * *weight;
                }
                assert!((reference_of(&mesh, c, &x).unwrap() - xi).amax() < 1e-13);
                let found = locator.locate(&mesh, &x, 1e-9).unwrap();
                assert_eq!((found.cell, found.nodes), (c, n));
                assert!(locator.holds(&mesh, &x, 1e-9));
                for way in [0.7, 1.4] {
                    // somewhere around, within a cell or outside of all
                    let x = x + Vector::from_fn(|i, _| way * (noise(c, i) - 0.3));
                    let found = locator.locate(&mesh, &x, 1e-9).is_some();
                    assert_eq!(locator.holds(&mesh, &x, 1e-9), found);
                }
                for (found, weight) in found.shape.iter().zip(&shape) {
                    assert!((found - weight).abs() < 1e-13);
                }
            }
            for (node, x) in mesh.nodes.iter().enumerate() {
                let found = locator.locate(&mesh, x, 1e-9).unwrap();
                let smallest = (0..mesh.cell_count())
                    .find(|&c| mesh.cell(c).contains(&(node as u32)))
                    .unwrap();
                assert_eq!(found.cell, smallest);
                for (a, &n) in mesh.cell(smallest).iter().enumerate() {
                    assert_eq!(found.shape[a], f64::from(u8::from(n as usize == node)));
                }
            }
            // the middle of a face that two cells share belongs to the cell of the smaller number
            for c in 0..mesh.cell_count() {
                for facet in mesh.shapes[c].facets() {
                    let nodes: Vec<u32> = facet.iter().map(|&a| mesh.cell(c)[a]).collect();
                    let middle = nodes
                        .iter()
                        .map(|&n| mesh.nodes[n as usize])
                        .sum::<Vector<D>>()
                        / nodes.len() as f64;
                    let smallest = (0..mesh.cell_count())
                        .find(|&k| nodes.iter().all(|n| mesh.cell(k).contains(n)))
                        .unwrap();
                    let found = locator.locate(&mesh, &middle, 1e-9).unwrap();
                    assert_eq!(found.cell, smallest, "{:?}", mesh.shapes[c]);
                    // three or more nodes may not lie in a plane after jitter of a hexahedron: the map is still exact
                    let sum: f64 = found.shape.iter().sum();
                    assert!((sum - 1.0).abs() < 1e-15);
                }
            }
            let outside = Vector::repeat(1.0 + 1e-6);
            assert!(locator.locate(&mesh, &outside, 1e-9).is_none());
            assert!(locator.locate(&mesh, &outside, 1e-3).is_some());
            assert!(!locator.holds(&mesh, &outside, 1e-9));
            assert!(locator.holds(&mesh, &outside, 1e-3));
            assert!(!locator.holds(&mesh, &Vector::repeat(f64::NAN), 1e-9));
            assert!(
                locator
                    .locate(&mesh, &Vector::repeat(f64::NAN), 1e-9)
                    .is_none()
            );
        }
    }

    #[test]
    fn points_are_found_where_they_were_put() {
        round_trip::<1>();
        round_trip::<2>();
        round_trip::<3>();
    }

    #[test]
    fn only_the_selected_cells_are_searched() {
        let mesh = unit_box::<2>(CellShape::Quad4, 10, 0.0);
        let locator = Locator::new(&mesh, 50..100);
        let x = |y: f64| Vector::<2>::new(0.55, y);
        assert!(locator.locate(&mesh, &x(0.31), 1e-9).is_none());
        assert_eq!(locator.locate(&mesh, &x(0.71), 1e-9).unwrap().cell, 75);
        assert!(reference_of(&mesh, 0, &x(f64::NAN)).is_none());
        // two flat cells at different heights: refused by `check`, but no reason to search for ever
        let mut flat = unit_box::<2>(CellShape::Quad4, 1, 0.0);
        flat.nodes = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
            .map(|x| Vector::<2>::new(x[0], x[1]))
            .to_vec();
        flat.push_cell(CellShape::Quad4, &[0, 1, 1, 0]);
        flat.push_cell(CellShape::Quad4, &[2, 3, 3, 2]);
        let locator = Locator::new(&flat, 1..3);
        assert!(locator.locate(&flat, &x(0.5), 1e-9).is_none());
        assert!(
            Locator::new(&mesh, std::iter::empty())
                .locate(&mesh, &x(0.5), 1e-9)
                .is_none()
        );
    }

    #[test]
    fn the_smallest_cell_wins_across_bins() {
        // numbered from the right: within the tolerance of two cells, the right one has the smaller number
        let mut mesh = unit_box::<1>(CellShape::Line2, 10, 0.0);
        mesh.connectivity = (0..10).rev().flat_map(|n| [n, n + 1]).collect();
        let locator = Locator::new(&mesh, 0..10);
        for n in 0..9 {
            let x = Vector::<1>::new((n as f64 + 0.95) / 10.0);
            assert_eq!(locator.locate(&mesh, &x, 1e-9).unwrap().cell, 9 - n);
            assert_eq!(locator.locate(&mesh, &x, 0.1).unwrap().cell, 8 - n);
        }
    }

    #[test]
    fn weights_near_zero_and_one_snap() {
        let mesh = unit_box::<2>(CellShape::Quad4, 1, 0.0);
        let locator = Locator::new(&mesh, 0..1);
        let at = |x: f64, y: f64| {
            locator
                .locate(&mesh, &Vector::<2>::new(x, y), 1e-9)
                .unwrap()
                .shape
        };
        assert_eq!(at(1e-11, -1e-11)[..4], [1.0, 0.0, 0.0, 0.0]);
        let edge = at(0.25, 1e-11);
        assert_eq!((edge[2], edge[3], edge[0] + edge[1]), (0.0, 0.0, 1.0));
        assert!(at(1e-8, 0.5)[1] > 0.0);
    }

    #[test]
    fn graded_cells_far_from_the_origin_are_found() {
        // cell sizes from 1 down to 1e-4, at 1000 lengths from the origin
        let mut mesh = Mesh::<1>::default();
        let mut x = 1000.0;
        for n in 0..60 {
            mesh.nodes.push(Vector::<1>::new(x));
            x += 0.85f64.powi(n);
        }
        for n in 0..59 {
            mesh.push_cell(CellShape::Line2, &[n, n + 1]);
        }
        let locator = Locator::new(&mesh, 0..mesh.cell_count());
        for c in 0..59 {
            let middle = (mesh.nodes[c] + mesh.nodes[c + 1]) / 2.0;
            let found = locator.locate(&mesh, &middle, 1e-9).unwrap();
            assert_eq!(found.cell, c);
            let at_node = locator.locate(&mesh, &mesh.nodes[c + 1], 1e-9).unwrap();
            assert_eq!((at_node.cell, at_node.shape[1]), (c, 1.0));
        }
    }
}
