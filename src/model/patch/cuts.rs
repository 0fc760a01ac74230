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
            // also what is divided since it touches the patch
            .chain(mesh.embedded.divided.iter().copied())
            .collect();
        met.sort_unstable();
        met.dedup();
        let found = parallel::map(met.len(), 8, |k| {
            let c = met[k] as usize;
            let (outside, inside) = parts(mesh, patch, c);
            let whole = mesh.cell_volume(c).abs();
            let size: f64 = outside.iter().map(|part| part.size).sum();
            if size <= NOTHING * whole {
                return Ok(Some((met[k], None)));
            }
            if inside <= NOTHING * whole && !mesh.embedded.is_divided(c) {
                return Ok(None);
            }
            let central: Vec<_> = outside.iter().map(PartMoments::central).collect();
            let rule = may_be_cut(mesh, c).then(|| fem::rule_of_parts(mesh, c, &central));
            match rule.flatten() {
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

/// The part of a cell outside the patch, of a divided one by its simplices, and the volume inside.
fn parts<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    c: usize,
) -> (Vec<PartMoments<D>>, f64) {
    let is_divided = mesh.embedded.is_divided(c);
    let mut parts = Vec::new();
    let mut inside = 0.0;
    for simplex in simplices_of(mesh, c) {
        if is_divided || parts.is_empty() {
            parts.push(PartMoments::about(mesh.centroid(c)));
        }
        let outside = parts.last_mut().expect("a part was pushed");

        patch.cells.dice(
            &simplex,
            &|_, _| true,
            &mut |index, part| match patch.all.contains(&index) {
                true => inside += part.size(),
                false => outside.add(part),
            },
        );
    }
    parts.retain(|part| part.size > 0.0);
    (parts, inside)
}

/// Returns true if a cell may be cut: its shape functions are polynomials in space, or in each of its simplices.
fn may_be_cut<const D: usize>(mesh: &Mesh<D>, c: usize) -> bool {
    match mesh.shapes[c] {
        CellShape::Line2 | CellShape::Tri3 | CellShape::Tet4 => true,
        CellShape::Quad4 | CellShape::Hex8 => match mesh.embedded.is_divided(c) {
            true => fem::may_be_divided(mesh, c),
            false => has_constant_jacobian(mesh, c),
        },
        _ => false,
    }
}

/// Returns true if a quadrilateral or a hexahedron is a parallelogram or a parallelepiped.
pub(super) fn has_constant_jacobian<const D: usize>(mesh: &Mesh<D>, c: usize) -> bool {
    match mesh.shapes[c] {
        CellShape::Quad4 => is_parallelogram(mesh, mesh.cell(c)),
        shape => (0..shape.facets().len() as u8)
            .all(|local| is_parallelogram(mesh, &mesh.facet((c as u32, local)).nodes)),
    }
}

/// Returns true if four corners, one after another, are those of a parallelogram.
fn is_parallelogram<const D: usize>(mesh: &Mesh<D>, corners: &[u32]) -> bool {
    let x = |i: usize| mesh.nodes[corners[i] as usize];
    let shortest = (x(1) - x(0)).norm().min((x(3) - x(0)).norm());
    (x(0) - x(1) + x(2) - x(3)).norm() <= ROUNDING * shortest
}
