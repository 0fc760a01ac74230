//! The cells of a lattice that the edge of a region cuts, and what cells of the mesh have of them.

use crate::model::simplex::{Cells, Simplex, as_box, box_quadrature, simplices_of};
use crate::model::tributary::found::{Detail, Found, FoundCells};
use crate::{model::Model, shape::Shape, tensor::Vector};

/// Which cells of a lattice the edge of a region cuts.
pub(super) struct Marks<const D: usize> {
    cells: Cells<D>,
    first: [i32; D],
    counts: [usize; D],
    marked: Vec<bool>,
}

impl<const D: usize> Marks<D> {
    pub fn new(cells: Cells<D>, low: &Vector<D>, high: &Vector<D>) -> Self {
        let (first, last) = cells.range(low, high);
        let first = first.map(|k| k - 1);
        let counts: [usize; D] = std::array::from_fn(|i| (last[i] + 2 - first[i]).max(1) as usize);
        Self {
            cells,
            first,
            counts,
            marked: vec![false; counts.iter().product()],
        }
    }

    pub fn limits(&self) -> ([i32; D], [i32; D]) {
        let last = std::array::from_fn(|i| self.first[i] + self.counts[i] as i32 - 1);
        (self.first, last)
    }

    pub fn number(&self, index: &[i32; D]) -> Option<usize> {
        let mut number = 0;
        let limits = self.first.iter().zip(&self.counts);
        for (k, (first, &count)) in index.iter().zip(limits) {
            let k = usize::try_from(k - first).ok()?;
            if k >= count {
                return None;
            }
            number = number * count + k;
        }
        Some(number)
    }

    pub fn is_marked(&self, index: &[i32; D]) -> bool {
        self.number(index).is_some_and(|n| self.marked[n])
    }

    /// The cells within three of a marked one along each axis, as far as extrapolation asks for points.
    pub fn near_marked(&self) -> Vec<bool> {
        let mut near = self.marked.clone();
        let mut stride = 1;
        for axis in (0..D).rev() {
            let count = self.counts[axis];
            let from = near.clone();
            for (number, near) in near.iter_mut().enumerate() {
                let k = number / stride % count;
                let first = number - k.min(3) * stride;
                let last = number + (count - 1 - k).min(3) * stride;
                *near |= (first..=last).step_by(stride).any(|n| from[n]);
            }
            stride *= count;
        }
        near
    }

    /// Returns true if a test holds for all cells of a range.
    fn all(&self, from: &[i32; D], to: &[i32; D], test: &mut dyn FnMut(&[i32; D]) -> bool) -> bool {
        let mut at = *from;
        if (0..D).any(|i| from[i] > to[i]) {
            return true;
        }
        loop {
            if !test(&at) {
                return false;
            }
            let Some(axis) = (0..D).find(|&i| at[i] < to[i]) else {
                return true;
            };
            at[axis] += 1;
            at[..axis].copy_from_slice(&from[..axis]);
        }
    }

    /// Marks the cells that a box meets with more than a face.
    pub fn mark(&mut self, low: &Vector<D>, high: &Vector<D>) {
        let (from, to) = self.cells.range(low, high);
        self.mark_range(&from, &to, |_| true);
    }

    fn mark_range(&mut self, from: &[i32; D], to: &[i32; D], counts: impl Fn(&[i32; D]) -> bool) {
        let mut found = Vec::new();
        self.all(from, to, &mut |index| {
            found.extend(self.number(index).filter(|_| counts(index)));
            true
        });
        for number in found {
            self.marked[number] = true;
        }
    }

    /// Marks the cells that the surface of a void may cut.
    pub fn mark_voids(&mut self, voids: &[Shape<D>]) {
        let reach = 0.5 * self.cells.spacing * (D as f64).sqrt() * (1.0 + 1e-9);
        let (first, last) = self.limits();
        for void in voids {
            let (low, high) = void.bounds();
            let (low, high) = (
                low.sup(&self.cells.centre(&first)),
                high.inf(&self.cells.centre(&last)),
            );
            let (from, to) = self.cells.range(&low, &high);
            let cells = self.cells;
            let is_cut = |index: &[i32; D]| {
                let distance = void.signed_distance(&cells.centre(index));
                distance.abs() <= reach
            };
            self.mark_range(&from, &to, is_cut);
        }
    }

    /// Returns the pieces of a cell of the mesh in the marked cells of the lattice, less voids.
    pub fn pieces(
        &self,
        model: &Model<D>,
        c: usize,
        voids: &[Shape<D>],
        detail: Detail,
    ) -> Vec<([i32; D], Found<D>)> {
        let mesh = &model.mesh;
        let wanted = |from: &[i32; D], to: &[i32; D]| {
            !self.all(from, to, &mut |index| !self.is_marked(index))
        };
        let (low, high) = mesh.bounds_of(mesh.cell(c));
        let (from, to) = self.cells.range(&low, &high);
        if !wanted(&from, &to) {
            return Vec::new();
        }
        let mut found: Vec<([i32; D], Found<D>)> = Vec::new();
        let near_void = |low: &Vector<D>, high: &Vector<D>| {
            let middle = (low + high) / 2.0;
            let reach = (high - low).norm();
            voids.iter().any(|v| v.signed_distance(&middle) <= reach)
        };
        if let Some((low, high)) = as_box(mesh, c).filter(|_| !near_void(&low, &high)) {
            let half = Vector::repeat(0.5 * self.cells.spacing);
            self.all(&from, &to, &mut |index| {
                if self.is_marked(index) {
                    let middle = self.cells.centre(index);
                    let (low, high) = (low.sup(&(middle - half)), high.inf(&(middle + half)));
                    let size = (high - low).product();
                    let mut piece = Found {
                        size,
                        moment: ((low + high) / 2.0 - middle) * size,
                        ..Found::default()
                    };
                    if detail == Detail::Quadrature {
                        box_quadrature(&low, &high, |x, w| piece.quadrature.push((x, w)));
                    }
                    found.push((*index, piece));
                }
                true
            });
            return found;
        }
        let mut of: FoundCells<D> = FoundCells::default();
        for simplex in simplices_of(mesh, c) {
            self.cells.dice(&simplex, &wanted, &mut |index, part| {
                if self.is_marked(&index) {
                    let middle = self.cells.centre(&index);
                    let into = of.entry(index).or_default();
                    outside(part, voids, DEEPEST, &mut |part| {
                        into.add(part, &middle, detail)
                    });
                }
            });
        }
        found.extend(of);
        found.sort_unstable_by_key(|a| a.0);
        found
    }
}

/// Maximum number of bisections of a simplex that the surface of a void cuts.
const DEEPEST: usize = 3 * 4;

/// Visits what of a simplex lies outside of voids: exactly beside boxes, by halves that are in or out beside other shapes.
fn outside<const D: usize>(
    simplex: &Simplex<D>,
    voids: &[Shape<D>],
    depth: usize,
    visit: &mut dyn FnMut(&Simplex<D>),
) {
    let centre = simplex.centre();
    let radius = simplex.corners[..simplex.count]
        .iter()
        .map(|x| (x - centre).norm())
        .fold(0.0, f64::max);
    let mut is_cut = false;
    for void in voids {
        let distance = void.signed_distance(&centre);
        if distance <= -radius {
            return;
        }
        is_cut |= distance < radius;
    }
    if !is_cut {
        visit(simplex);
        return;
    }
    for void in voids {
        if let Shape::Box { min, max } = void {
            let (low, high) = simplex.bounds();
            for axis in 0..D {
                for at in [min[axis], max[axis]] {
                    let skin = 1e-12 * radius;
                    let meets = (0..D).all(|k| low[k] < max[k] - skin && high[k] > min[k] + skin);
                    if meets && low[axis] < at - skin && high[axis] > at + skin {
                        simplex.cut(axis, at, skin, &mut |_, part| {
                            outside(part, voids, depth, visit);
                        });
                        return;
                    }
                }
            }
        }
    }
    let is_box = |v: &Shape<D>| matches!(v, Shape::Box { .. });
    let is_curved_near = voids
        .iter()
        .any(|v| !is_box(v) && v.signed_distance(&centre).abs() < radius);
    if depth > 0 && is_curved_near {
        for half in simplex.halves() {
            outside(&half, voids, depth - 1, visit);
        }
        return;
    }
    if voids.iter().all(|v| v.signed_distance(&centre) >= 0.0) {
        visit(simplex);
    }
}
