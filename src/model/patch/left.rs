//! Parts of cut cells that belong to the body, as simplices.

use rustc_hash::FxHashMap;

use super::cells::{Index, block};
use crate::{
    mesh::{Covered, Mesh, boundary::BoundaryFacet},
    model::simplex::{Cells, Simplex, simplices_of, whole_simplices},
    tensor::{Tensor, Vector, determinant},
};

/// Size of a simplex, over that of the box around its cell, up to which it is nothing.
const SLIVER: f64 = 1e-15;

/// Distance, in edges of its cell, up to which a corner of the surface lies in a plane.
const IN_PLANE: f64 = 1e-11;

/// The same over the coordinates: what rounding leaves of a corner beside a plane.
const ROUNDING: f64 = 1e-14;

/// Part of a cell that may be missing from its simplices, by rounding.
const MISSING: f64 = 1e-13;

/// The parts of cut cells that belong to the body.
pub struct Left<'a, const D: usize> {
    mesh: &'a Mesh<D>,
    outside: Outside<'a, D>,
    /// Facets of the surface in the cells that it crosses, the largest first, with their normals times areas.
    surface: FxHashMap<u32, Vec<(&'a BoundaryFacet, Vector<D>)>>,
}

impl<'a, const D: usize> Left<'a, D> {
    /// Those of the cells of a mesh.
    pub fn new(mesh: &'a Mesh<D>) -> Self {
        let mut surface: FxHashMap<u32, Vec<(&BoundaryFacet, Vector<D>)>> = FxHashMap::default();
        for facet in mesh.embedded.crossings() {
            let own = surface.entry(facet.cell).or_default();
            own.push((facet, mesh.facet_normal_area(facet)));
        }
        for facets in surface.values_mut() {
            // their normals are the best
            facets.sort_by(|a, b| b.1.norm_squared().total_cmp(&a.1.norm_squared()));
        }
        Self {
            mesh,
            outside: Outside::of(&mesh.embedded.covered),
            surface,
        }
    }

    /// The part of a cell, as simplices with their sizes \[m^D\]; `None` of a cell that is whole.
    ///
    /// Together they are as large as the rules of the cell say. Corners beyond `D + 1` have no meaning; the others are in the order in which the size is positive.
    pub fn simplices(&self, c: usize) -> Option<Vec<([Vector<D>; 4], f64)>> {
        let embedded = &self.mesh.embedded;
        embedded.cut_cell(c)?;
        let mut left = simplices_of(self.mesh, c);
        if embedded.pieces.contains_key(&(c as u32)) {
            left = self.fewer(c, &left).unwrap_or(left);
        } else {
            let whole = std::mem::take(&mut left);
            (whole.iter()).for_each(|part| self.outside.visit(part, &mut left));
        }
        let (low, high) = self.mesh.bounds_of(self.mesh.corners(c));
        let least = SLIVER * (high - low).product();
        let left = left.into_iter().map(|part| oriented(part.corners));
        Some(left.filter(|part| part.1 > least).collect())
    }

    /// The pieces of a cell of the patch, which all cells of the mesh before have cut, as fewer simplices: the whole cell, cut by the surface alone.
    fn fewer(&self, c: usize, pieces: &[Simplex<D>]) -> Option<Vec<Simplex<D>>> {
        let edge = self.outside.cells.spacing;
        let (low, high) = self.mesh.bounds_of(self.mesh.corners(c));
        let near = IN_PLANE * edge + ROUNDING * low.abs().sup(&high.abs()).amax();
        let mut parts = whole_simplices(self.mesh, c);
        for (facet, area) in self.surface.get(&(c as u32))? {
            let (x, normal) = (self.mesh.nodes[facet.nodes[0] as usize], area.normalize());
            let (from, to) = self.mesh.bounds_of(&facet.nodes);
            let height = |y: &Vector<D>| (y - x).dot(&normal);
            let settle = |y: &mut Vector<D>| *y -= normal * height(y);
            let mut cut = Vec::new();
            for part in &parts {
                let (low, high) = part.bounds();
                let meets = (0..D).all(|i| low[i] <= to[i] + near && high[i] >= from[i] - near);
                match meets {
                    true => part.cut_by(&height, &settle, near, &mut |_, part| cut.push(*part)),
                    false => cut.push(*part),
                }
            }
            parts = cut;
            if parts.len() > pieces.len() {
                return None;
            }
        }
        parts.retain(|part| !self.mesh.embedded.is_taken(c, &part.centre()));
        let size = |parts: &[Simplex<D>]| parts.iter().map(Simplex::size).sum::<f64>();
        let off = (size(&parts) - size(pieces)).abs();
        (off <= MISSING * edge.powi(D as i32)).then_some(parts)
    }
}

/// The corners of a simplex in the order in which its size is positive, and this.
fn oriented<const D: usize>(mut corners: [Vector<D>; 4]) -> ([Vector<D>; 4], f64) {
    let edges = Tensor::<D>::from_fn(|i, k| (corners[k + 1] - corners[0])[i]);
    let size = determinant(&edges) / [1.0, 2.0, 6.0][D - 1];
    if size < 0.0 {
        corners.swap(0, 1);
    }
    (corners, size.abs())
}

/// All that lies outside of a union of cells.
struct Outside<'a, const D: usize> {
    cells: Cells<D>,
    covered: &'a Covered<D>,
}

impl<'a, const D: usize> Outside<'a, D> {
    fn of(covered: &'a Covered<D>) -> Self {
        let cells = Cells {
            origin: covered.corner.add_scalar(0.5 * covered.edge),
            spacing: covered.edge,
        };
        Self { cells, covered }
    }

    /// Appends the parts of a simplex outside, cut by few planes.
    fn visit(&self, simplex: &Simplex<D>, outside: &mut Vec<Simplex<D>>) {
        let (from, to) = self.cells.range_of(simplex);
        let Some((axis, layer)) = self.plane(&from, &to) else {
            if !self.covered.cells.contains(&from) {
                outside.push(*simplex);
            }
            return;
        };
        let (plane, tolerance) = self.cells.plane_above(axis, layer);
        let (low, high) = simplex.bounds();
        if low[axis] < plane - tolerance && high[axis] > plane + tolerance {
            simplex.cut(axis, plane, tolerance, &mut |_, part| {
                self.visit(part, outside);
            });
        } else if !(self.covered.cells).contains(&self.cells.index(&simplex.centre())) {
            outside.push(*simplex);
        }
    }

    /// The axis and the layer above which to divide a block of cells so that the larger part is all inside or all outside; `None` where the whole block is.
    fn plane(&self, from: &Index<D>, to: &Index<D>) -> Option<(usize, i32)> {
        let mut covered: [Vec<usize>; D] =
            std::array::from_fn(|i| vec![0; (to[i] - from[i] + 1).max(0) as usize]);
        let mut all = 0;
        for index in block(*from, *to).filter(|index| self.covered.cells.contains(index)) {
            all += 1;
            (0..D).for_each(|i| covered[i][(index[i] - from[i]) as usize] += 1);
        }
        let count: usize = covered.iter().map(Vec::len).product();
        if all == 0 || all == count {
            return None;
        }
        let mut best = (0, 0, 0);
        for (axis, layers) in covered.iter().enumerate() {
            let per_layer = count / layers.len();
            let mut below = 0;
            for (k, own) in layers[..layers.len() - 1].iter().enumerate() {
                below += own;
                let sizes = [(below, k + 1), (all - below, layers.len() - k - 1)];
                for (inside, n) in sizes {
                    let size = n * per_layer;
                    if (inside == 0 || inside == size) && size > best.0 {
                        best = (size, axis, from[axis] + k as i32);
                    }
                }
            }
        }
        let longest = (0..D).max_by_key(|&i| covered[i].len()).unwrap_or(0);
        let middle = from[longest] + (covered[longest].len() as i32 - 2) / 2;
        Some(match best {
            (0, ..) => (longest, middle),
            (_, axis, layer) => (axis, layer),
        })
    }
}
