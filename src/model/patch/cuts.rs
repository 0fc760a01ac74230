//! Elements of a mesh that a patch cuts or covers.

use std::collections::BTreeMap;

use super::{
    cells::{GOOD, PatchCells},
    error::PatchError,
    moments::PartMoments,
};
use crate::{
    fem,
    mesh::{CellShape, CutCell, Mesh},
    model::simplex::simplices_of,
    parallel,
};

/// Part of a cell's volume below which nothing is left of it.
pub(super) const NOTHING: f64 = 1e-10;

/// Distance of a corner of a parallelogram from where the others want it, over its shortest side, that rounding leaves.
const ROUNDING: f64 = 1e-10;

/// The elements that a patch cuts.
pub(super) struct Cuts {
    /// Rules of those of which a part is left; none of those that the patch covers.
    of_cell: BTreeMap<u32, Option<CutCell>>,
}

impl Cuts {
    pub fn new<const D: usize>(mesh: &Mesh<D>, patch: &PatchCells<D>) -> Result<Self, PatchError> {
        let mut met: Vec<u32> = (patch.all.iter())
            .flat_map(|index| patch.held[index].iter().map(|part| part.0))
            .collect();
        met.sort_unstable();
        met.dedup();
        let found = parallel::map(met.len(), 8, |k| {
            let c = met[k] as usize;
            let (outside, inside) = parts(mesh, patch, c);
            let whole = mesh.cell_volume(c).abs();
            if outside.size <= NOTHING * whole {
                return Ok(Some((met[k], None)));
            }
            if inside <= NOTHING * whole {
                return Ok(None);
            }
            let rule = may_be_cut(mesh, c)
                .then(|| fem::rule_of_part(mesh, c, outside.central()))
                .flatten();
            match rule {
                Some(rule) => Ok(Some((met[k], Some(rule)))),
                None => Err(PatchError::Kind {
                    cell: c,
                    shape: mesh.shapes[c],
                    position: mesh.centroid(c).iter().copied().collect(),
                }),
            }
        });
        let mut of_cell = BTreeMap::new();
        for cut in found {
            of_cell.extend(cut?);
        }
        Ok(Self { of_cell })
    }

    /// Returns true if the patch covers a cell.
    pub fn is_covered(&self, c: u32) -> bool {
        matches!(self.of_cell.get(&c), Some(None))
    }

    /// The rule of a cell that is cut.
    pub fn rule(&self, c: u32) -> Option<&CutCell> {
        self.of_cell.get(&c)?.as_ref()
    }

    /// Returns true if enough is left of a cell for its nodes.
    pub fn is_good(&self, c: u32) -> bool {
        let rule = self.of_cell.get(&c);
        rule.is_none_or(|rule| rule.as_ref().is_some_and(|rule| rule.fraction >= GOOD))
    }

    /// Returns true if the patch covers a cell or a part of it.
    pub fn is_met(&self, c: u32) -> bool {
        self.of_cell.contains_key(&c)
    }

    /// The cells that are cut.
    pub fn cut(&self) -> impl Iterator<Item = (u32, &CutCell)> {
        (self.of_cell.iter()).filter_map(|(&c, rule)| Some((c, rule.as_ref()?)))
    }
}

/// The part of a cell outside the patch, and the volume inside.
fn parts<const D: usize>(mesh: &Mesh<D>, patch: &PatchCells<D>, c: usize) -> (PartMoments<D>, f64) {
    let mut outside = PartMoments::about(mesh.centroid(c));
    let mut inside = 0.0;
    for simplex in simplices_of(mesh, c) {
        patch.cells.dice(
            &simplex,
            &|_, _| true,
            &mut |index, part| match patch.all.contains(&index) {
                true => inside += part.size(),
                false => outside.add(part),
            },
        );
    }
    (outside, inside)
}

/// Returns true if a cell may be cut: its shape functions are polynomials in space.
pub(super) fn may_be_cut<const D: usize>(mesh: &Mesh<D>, c: usize) -> bool {
    let shape = mesh.shapes[c];
    match shape {
        CellShape::Line2 | CellShape::Tri3 | CellShape::Tet4 => true,
        CellShape::Quad4 => is_parallelogram(mesh, mesh.cell(c)),
        CellShape::Hex8 => (0..shape.facets().len() as u8)
            .all(|local| is_parallelogram(mesh, &mesh.facet((c as u32, local)).nodes)),
        _ => false,
    }
}

/// Returns true if four corners, one after another, are those of a parallelogram.
fn is_parallelogram<const D: usize>(mesh: &Mesh<D>, corners: &[u32]) -> bool {
    let x = |i: usize| mesh.nodes[corners[i] as usize];
    let shortest = (x(1) - x(0)).norm().min((x(3) - x(0)).norm());
    (x(0) - x(1) + x(2) - x(3)).norm() <= ROUNDING * shortest
}
