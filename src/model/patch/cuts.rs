//! Elements of a mesh that a patch cuts or covers.

use std::collections::BTreeMap;

use super::{PatchError, cells::PatchCells, may_be_cut};
use crate::{
    fem,
    mesh::{CutCell, Mesh},
    model::simplex::simplices_of,
    parallel,
    tensor::{Tensor, Vector},
};

/// Part of a cell's volume below which nothing is left of it.
const NOTHING: f64 = 1e-10;

/// Part of a cell's volume that must be left for its nodes to follow no others.
const GOOD: f64 = 0.3;

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
            let (volume, centroid, second, inside) = part_outside(mesh, patch, c);
            let whole = mesh.cell_volume(c).abs();
            if volume <= NOTHING * whole {
                return Ok(Some((met[k], None)));
            }
            if inside <= NOTHING * whole {
                return Ok(None);
            }
            let rule = may_be_cut(mesh, c)
                .then(|| fem::rule_of_part(mesh, c, (volume, centroid, second)))
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

/// Volume, centroid and second moment about it, over the volume, of what lies outside the patch, and the volume inside.
fn part_outside<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    c: usize,
) -> (f64, Vector<D>, Tensor<D>, f64) {
    let about = mesh.centroid(c);
    let (mut volume, mut first, mut second) = (0.0, Vector::<D>::zeros(), Tensor::<D>::zeros());
    let mut inside = 0.0;
    for simplex in simplices_of(mesh, c) {
        patch
            .cells
            .dice(&simplex, &|_, _| true, &mut |index, part| {
                if patch.all.contains(&index) {
                    inside += part.size();
                    return;
                }
                part.quadrature(|x, w| {
                    let x = x - about;
                    volume += w;
                    first += x * w;
                    second += x * x.transpose() * w;
                });
            });
    }
    let centroid = first / volume;
    let second = second / volume - centroid * centroid.transpose();
    (volume, about + centroid, second, inside)
}
