//! Truncated bonds: a seam that is symmetric, patch-exact and in exact equilibrium.
//!
//! | file | what |
//! |---|---|
//! | `seam.rs` | the faces of the peridynamic zone, and the pieces of a bond inside of it |
//! | `segments.rs` | pieces with their ends, and their springs |
//! | `moving.rs` | pieces that turn, stretch and break |
//! | `dilatation.rs` | what pieces hand to the dilatations of an LPS |
//! | `edges.rs` | strings along the edges of a zone in 3D |
//! | `fit.rs`, `sparse_change.rs` | factors of pieces where faces cut the lattice anywhere, and their smallest change |
//!
//! The energy is that of the finite elements, of the bonds within the peridynamic zone, and of the pieces of all other bonds of the lattice, continued behind the faces, that lie within the zone:
//!
//! ```text
//! s · w(ξ, (u(q) − u(p)) / s)
//! ```
//!
//! for a piece from `p` to `q` of the length `s`, a fraction of its bond ξ; an end within the zone is a point, an end on a face follows the trace of the element behind it. Under `u = G x` every piece
//! pulls like the whole bond, so the forces on points cancel as far from the seam, and the forces on a face add up to the traction of the lattice. Pieces of bonds with both ends in elements
//! (through a corner of the zone, or a zone thinner than a horizon) belong to the sum.

mod dilatation;
mod edges;
mod fit;
mod moving;
mod seam;
mod segments;
mod sparse_change;

use std::collections::HashSet;

pub use self::moving::SeamBonds;

use self::{
    dilatation::Dilatations,
    edges::Strings,
    segments::{Segments, Springs},
};
use crate::{
    assembly::Row,
    coupling::{CellRole, Coupling, Interface, Model, ModelError, Operator, Reach, Zone},
    mesh::Mesh,
    peridynamics::BondLaw,
    system::Symmetry,
};

/// Bonds that leave the peridynamic zone end on the faces of the elements around it.
///
/// Source: none; derived in `docs/truncated.md`. A transition zone, if the scene has one, is local. Pairwise laws and LPS on a regular lattice with one horizon.
#[derive(Clone, Copy, Debug, Default)]
pub struct Truncated {
    /// What becomes in motion of the bonds that the seam cuts.
    pub cut_bonds: CutBonds,
}

/// What becomes in motion of bonds that the seam cuts, where bonds are exact or break.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CutBonds {
    /// They turn, stretch and break like others; pairwise laws only.
    #[default]
    Breaking,
    /// They are rows of a matrix, which is cheaper. Damage that comes within two horizons of the seam is told.
    Linear,
}

impl<const D: usize> Coupling<D> for Truncated {
    fn name(&self) -> &'static str {
        "truncated"
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Symmetric
    }

    fn roles(&self, _mesh: &Mesh<D>, zones: &[Zone], _largest_horizon: f64) -> Vec<CellRole> {
        zones
            .iter()
            .map(|zone| match zone {
                Zone::Nonlocal => CellRole::Points,
                Zone::Transition | Zone::Local => CellRole::Element,
            })
            .collect()
    }

    fn reach(&self, _law: &dyn BondLaw<D>) -> Reach {
        Reach::Own
    }

    fn interface(&self) -> Interface {
        Interface::Faces
    }

    fn operator<'a>(&self, model: &'a Model<D>) -> Result<Box<dyn Operator<D> + 'a>, ModelError> {
        let (Some(body), Some(passing)) = (model.body(), model.passing()) else {
            return Ok(Box::new(super::single::OwnModel { model }));
        };
        let mut segments = Segments::new(model, body, passing);
        let mut strings = Strings::new(&segments);
        if fit::fit(&mut segments, &strings)? {
            // the fit has balanced the corners too
            strings = Strings::none();
        }
        // a state reaches one family farther than a bond
        let listed = if passing.whole.iter().any(|w| w.state.is_some()) {
            segments.with_neighbours()
        } else {
            segments.at_seam.clone()
        };
        let springs = Springs::new(&segments, &listed);
        let dilatations = Dilatations::new(&segments, &listed)?;
        Ok(Box::new(TruncatedRows {
            model,
            cut_bonds: self.cut_bonds,
            strings,
            springs,
            dilatations,
            pairwise: passing.whole.iter().all(|w| w.state.is_none()),
            listed,
            broken: segments.broken,
        }))
    }
}

struct TruncatedRows<'a, const D: usize> {
    model: &'a Model<D>,
    cut_bonds: CutBonds,
    springs: Springs<D>,
    dilatations: Dilatations<D>,
    strings: Strings<D>,
    /// Points whose rows are sums of springs and dilatations, not rows of the body.
    listed: Vec<bool>,
    pairwise: bool,
    /// Bonds between points of the zone that are not whole, lower number first.
    broken: HashSet<(u32, u32)>,
}

impl<const D: usize> Operator<D> for TruncatedRows<'_, D> {
    fn add_row(&self, site: usize, row: &mut Row<D>) {
        match self.model.point_of(site) {
            Some((body, i)) if !self.listed[i] => {
                body.add_force_row(i, |_| 1.0, row);
                return;
            }
            Some(_) => {}
            None => {
                self.model.add_element_rows(site, row);
                self.strings.add_row(site, row);
            }
        }
        self.springs.add_row(site, row);
        self.dilatations.add_row(site, row);
    }

    fn is_body_row(&self, site: usize) -> bool {
        self.model
            .point_of(site)
            .is_some_and(|(_, i)| !self.listed[i])
    }

    fn has_body_bonds(&self, site: usize) -> bool {
        // the dilatations of an LPS differ from the body's, so that nothing cancels
        self.pairwise && self.model.point_of(site).is_some() && !self.is_body_row(site)
    }

    fn seam_bonds(&self) -> Option<SeamBonds<D>> {
        let breaking = self.pairwise && self.cut_bonds == CutBonds::Breaking;
        let body = self.model.body().filter(|_| breaking)?;
        Some(SeamBonds::new(
            self.model,
            body,
            &self.springs,
            &self.broken,
        ))
    }

    fn add_row_without_bonds(&self, site: usize, row: &mut Row<D>) {
        if self.model.point_of(site).is_none() {
            self.model.add_element_rows(site, row);
            self.strings.add_row(site, row);
        }
    }

    fn beta(&self, site: usize) -> f64 {
        f64::from(u8::from(self.model.point_of(site).is_some()))
    }
}
