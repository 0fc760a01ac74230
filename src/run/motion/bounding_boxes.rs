//! Cells of a mesh by their boxes, to find those near one of them.

use crate::mesh::Mesh;
use crate::tensor::Vector;

/// The boxes of all cells, sorted into a grid by their middles.
pub(crate) struct CellBoxes<const D: usize> {
    boxes: Vec<(Vector<D>, Vector<D>)>,
    low: Vector<D>,
    /// Size of a bin, the extent of the largest cell.
    size: f64,
    counts: [usize; D],
    /// Offsets of the bins in the list of cells, and that list.
    offsets: Vec<u32>,
    cells: Vec<u32>,
}

impl<const D: usize> CellBoxes<D> {
    /// Those of a mesh.
    pub fn new(mesh: &Mesh<D>) -> Self {
        let boxes: Vec<_> = (0..mesh.cell_count())
            .map(|c| mesh.bounds_of(mesh.cell(c)))
            .collect();
        let (low, high) = mesh.bounds();
        let largest = boxes
            .iter()
            .map(|(l, h)| (h - l).amax())
            .fold(0.0, f64::max);
        // slender meshes with one large cell must not ask for more bins than there are cells
        let volume: f64 = (high - low).iter().product();
        let even = (volume / boxes.len().max(1) as f64).powf(1.0 / D as f64);
        let size = largest.max(even).max(f64::MIN_POSITIVE);
        let mut all = Self {
            counts: std::array::from_fn(|a| ((high[a] - low[a]) / size) as usize + 1),
            offsets: Vec::new(),
            cells: vec![0; boxes.len()],
            boxes,
            low,
            size,
        };
        let bin: Vec<usize> = all
            .boxes
            .iter()
            .map(|(l, h)| all.number(&all.bin(&((l + h) * 0.5))))
            .collect();
        let mut offsets = vec![0u32; all.counts.iter().product::<usize>() + 1];
        bin.iter().for_each(|&b| offsets[b + 1] += 1);
        for b in 1..offsets.len() {
            offsets[b] += offsets[b - 1];
        }
        let mut next = offsets.clone();
        for (c, &b) in bin.iter().enumerate() {
            all.cells[next[b] as usize] = c as u32;
            next[b] += 1;
        }
        all.offsets = offsets;
        all
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.boxes.len()
    }

    /// The box of a cell.
    pub fn of(&self, cell: usize) -> &(Vector<D>, Vector<D>) {
        &self.boxes[cell]
    }

    /// The middle of a cell's box.
    pub fn middle(&self, cell: usize) -> Vector<D> {
        let (low, high) = self.boxes[cell];
        (low + high) * 0.5
    }

    /// Visits the cells whose boxes come nearer than `by` to a box.
    pub fn near(&self, from: &Vector<D>, to: &Vector<D>, by: f64, mut visit: impl FnMut(usize)) {
        let by = by * (1.0 - 1e-9);
        let margin = Vector::repeat(by + 0.5 * self.size);
        let (first, last) = (self.bin(&(from - margin)), self.bin(&(to + margin)));
        let mut at = first;
        loop {
            let bin = self.number(&at);
            let (start, end) = (self.offsets[bin] as usize, self.offsets[bin + 1] as usize);
            for &c in &self.cells[start..end] {
                let (low, high) = &self.boxes[c as usize];
                let gap =
                    Vector::<D>::from_fn(|a, _| (from[a] - high[a]).max(low[a] - to[a]).max(0.0));
                if gap.norm_squared() < by * by {
                    visit(c as usize);
                }
            }
            let Some(axis) = (0..D).find(|&a| at[a] < last[a]) else {
                return;
            };
            at[axis] += 1;
            at[..axis].copy_from_slice(&first[..axis]);
        }
    }

    fn bin(&self, x: &Vector<D>) -> [usize; D] {
        // a negative place becomes 0 in the cast
        std::array::from_fn(|a| {
            (((x[a] - self.low[a]) / self.size) as usize).min(self.counts[a] - 1)
        })
    }

    fn number(&self, bin: &[usize; D]) -> usize {
        (0..D).rev().fold(0, |n, a| n * self.counts[a] + bin[a])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{Axis, rectangle};

    #[test]
    fn near_cells_are_those_of_a_search_through_all() {
        let axis = |from: f64, by: &[f64]| {
            let mut x = vec![from];
            by.iter().for_each(|b| x.push(x[x.len() - 1] + b));
            x
        };
        let x = axis(-3.0, &[1.0, 0.2, 0.3, 2.5, 0.7, 1.0]);
        let y = axis(10.0, &[0.1, 0.4, 0.9, 0.9]);
        let grid = rectangle(Axis::Coordinates(x), Axis::Coordinates(y));
        let mesh = grid.mesh().expect("ascending");
        let boxes = CellBoxes::new(&mesh);
        assert_eq!(boxes.len(), 24);
        for member in 0..boxes.len() {
            let (from, to) = *boxes.of(member);
            for by in [1e-6, 0.25, 1.1, 3.0, 50.0] {
                let mut found = Vec::new();
                boxes.near(&from, &to, by, |c| found.push(c));
                found.sort_unstable();
                let gap = |c: &usize| {
                    let (low, high) = boxes.of(*c);
                    let along = |a: usize| (from[a] - high[a]).max(low[a] - to[a]).max(0.0);
                    along(0).hypot(along(1))
                };
                let all: Vec<usize> = (0..boxes.len()).filter(|c| gap(c) < by).collect();
                assert_eq!(found, all, "{member} {by}");
            }
        }
    }
}
