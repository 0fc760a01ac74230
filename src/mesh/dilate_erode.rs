//! Sets of cells that grow, shrink and lose their holes.
//!
//! Distances are those of centroids along the axis where they are largest: a cell of a regular mesh grows to a square, so that the edges of what has grown follow the mesh.

use std::collections::HashMap;

use super::Mesh;
use crate::{parallel, tensor::Vector};

impl<const D: usize> Mesh<D> {
    /// The cells of a set and those within `by(c)` of it, a distance of centroids along the axis where it is largest \[length\].
    ///
    /// Shapes: `cells` has one entry per cell; `by` takes the number of a cell outside of the set.
    pub fn grown(&self, cells: &[bool], by: impl Fn(usize) -> f64 + Sync) -> Vec<bool> {
        let distances: Vec<f64> = (0..self.cell_count())
            .map(|c| if cells[c] { 0.0 } else { by(c) })
            .collect();
        let size = distances.iter().copied().fold(0.0, f64::max) * (1.0 + 1e-6);
        if size <= 0.0 || !size.is_finite() {
            return cells.to_vec();
        }
        let bin =
            |x: &Vector<D>| -> [i64; D] { std::array::from_fn(|i| (x[i] / size).floor() as i64) };
        let mut bins: HashMap<[i64; D], Vec<Vector<D>>> = HashMap::new();
        for c in self.rim(cells) {
            let x = self.centroid(c);
            bins.entry(bin(&x)).or_default().push(x);
        }
        parallel::map(self.cell_count(), 1, |c| {
            if cells[c] {
                return true;
            }
            let x = self.centroid(c);
            let limit = distances[c] * (1.0 + 1e-9);
            let middle = bin(&x);
            (0..3usize.pow(D as u32)).any(|index| {
                let mut rest = index;
                let key = std::array::from_fn(|i| {
                    let k = rest % 3;
                    rest /= 3;
                    middle[i] + k as i64 - 1
                });
                bins.get(&key)
                    .is_some_and(|near| near.iter().any(|y| (x - y).amax() <= limit))
            })
        })
    }

    /// The cells of a set without those within `by(c)` of the cells outside of it; the boundary of the mesh takes none.
    ///
    /// Shapes: as for [`Mesh::grown`].
    pub fn shrunk(&self, cells: &[bool], by: impl Fn(usize) -> f64 + Sync) -> Vec<bool> {
        let outside: Vec<bool> = cells.iter().map(|c| !c).collect();
        self.grown(&outside, by).iter().map(|c| !c).collect()
    }

    /// The cells of a set and those of each connected part outside of it that is smaller than `volume` [length^D].
    ///
    /// Shapes: `cells` has one entry per cell. Parts are connected by nodes.
    pub fn filled(&self, cells: &[bool], volume: f64) -> Vec<bool> {
        let (offsets, of_node) = self.node_cells();
        let mut filled = cells.to_vec();
        let mut seen = cells.to_vec();
        let mut part = Vec::new();
        for start in 0..self.cell_count() {
            if seen[start] {
                continue;
            }
            part.clear();
            part.push(start);
            seen[start] = true;
            let (mut next, mut held) = (0, 0.0);
            while let Some(&c) = part.get(next) {
                next += 1;
                held += self.cell_volume(c).abs();
                for &n in self.cell(c) {
                    for &k in
                        &of_node[offsets[n as usize] as usize..offsets[n as usize + 1] as usize]
                    {
                        if !std::mem::replace(&mut seen[k as usize], true) {
                            part.push(k as usize);
                        }
                    }
                }
            }
            if held < volume {
                part.iter().for_each(|&c| filled[c] = true);
            }
        }
        filled
    }

    /// The cells of a set that share a node with a cell outside of it.
    fn rim(&self, cells: &[bool]) -> Vec<usize> {
        let mut outer = vec![false; self.nodes.len()];
        for c in (0..self.cell_count()).filter(|&c| !cells[c]) {
            for &n in self.cell(c) {
                outer[n as usize] = true;
            }
        }
        (0..self.cell_count())
            .filter(|&c| cells[c] && self.cell(c).iter().any(|&n| outer[n as usize]))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::mesh::Mesh;
    use crate::mesh::generate::{Axis, rectangle};

    /// Ten by ten cells of size one.
    fn plate() -> Mesh<2> {
        let axis = || Axis::Uniform {
            min: 0.0,
            max: 10.0,
            cells: 10,
        };
        rectangle(axis(), axis()).mesh().unwrap()
    }

    fn set(mesh: &Mesh<2>, inside: impl Fn(f64, f64) -> bool) -> Vec<bool> {
        (0..mesh.cell_count())
            .map(|c| {
                let x = mesh.centroid(c);
                inside(x[0], x[1])
            })
            .collect()
    }

    #[test]
    fn a_cell_grows_to_a_square_and_shrinks_back() {
        let mesh = plate();
        let one = set(&mesh, |x, y| x == 4.5 && y == 5.5);
        let grown = mesh.grown(&one, |_| 2.0);
        assert_eq!(
            grown,
            set(&mesh, |x, y| (x - 4.5).abs() < 2.1 && (y - 5.5).abs() < 2.1)
        );
        assert_eq!(mesh.shrunk(&grown, |_| 2.0), one);
    }

    #[test]
    fn the_boundary_takes_nothing_and_holes_close() {
        let mesh = plate();
        let all = vec![true; 100];
        assert_eq!(mesh.shrunk(&all, |_| 3.0), all);
        let holed = set(&mesh, |x, y| x < 7.0 && !(x == 3.5 && y == 3.5));
        let closed = mesh.shrunk(&mesh.grown(&holed, |_| 1.0), |_| 1.0);
        assert_eq!(closed, set(&mesh, |x, _| x < 7.0));
    }

    #[test]
    fn small_parts_are_filled_and_large_ones_are_not() {
        let mesh = plate();
        // a corner of four cells and a strip of twenty outside of the set
        let outside = |x: f64, y: f64| (x < 2.0 && y < 2.0) || x > 8.0;
        let cells = set(&mesh, |x, y| !outside(x, y));
        let filled = mesh.filled(&cells, 4.5);
        assert_eq!(filled, set(&mesh, |x, _| x < 8.0));
        assert_eq!(mesh.filled(&cells, 3.5), cells);
    }

    #[test]
    fn corners_of_a_hole_are_notches_and_those_of_the_body_are_not() {
        let whole = plate();
        assert!(whole.notches().is_empty());
        let mut holed = Mesh {
            nodes: whole.nodes.clone(),
            ..Mesh::default()
        };
        for c in 0..whole.cell_count() {
            let x = whole.centroid(c);
            if (x[0] - 5.0).abs() > 1.0 || (x[1] - 5.0).abs() > 2.0 {
                holed.push_cell(whole.shapes[c], whole.cell(c));
            }
        }
        let found: Vec<[f64; 2]> = holed
            .notches()
            .iter()
            .map(|&n| holed.nodes[n as usize].into())
            .collect();
        assert_eq!(found, [[4.0, 3.0], [6.0, 3.0], [4.0, 7.0], [6.0, 7.0]]);
    }
}
