//! Truncated bonds: a seam that is symmetric, patch-exact and in exact equilibrium.
//!
//! | file | what |
//! |---|---|
//! | `seam.rs` | the faces of the peridynamic zone, and the pieces of a bond inside of it |
//! | `bond_segments.rs` | pieces with their ends, and their springs |
//! | `nonlinear_bonds.rs`, `bond_kinematics.rs` | pieces that turn, stretch and break |
//! | `dilatation.rs` | contributions of pieces to the dilatations of an LPS |
//! | `dilatation_state.rs` | those dilatations where pieces turn, stretch and break |
//! | `element_dilatation.rs` | those of elements that follow the bonds |
//! | `corner_correction.rs` | strings along the edges of a zone in 3D |
//! | `factors.rs` | factors of the normal equations of the fit, and what they cost |
//! | `feet.rs` | other traces at the ends of pieces, where factors alone do not do |
//! | `squares.rs` | factors of pieces where faces cut the lattice anywhere, and an LPS as a sum of squares |
//! | `conditions.rs`, `normal.rs` | the conditions of the fit, and their normal equations |
//! | `affine_fit.rs`, `sparse_least_norm.rs` | the same for an LPS with few bonds, shares of dilatations apart; the smallest change |
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

mod affine_fit;
mod bond_kinematics;
mod bond_segments;
pub(crate) mod conditions;
mod corner_correction;
mod dilatation;
mod dilatation_state;
mod element_dilatation;
mod factors;
mod feet;
mod fit_parts;
mod lps_constants;
mod nonlinear_bonds;
mod normal;
mod piece;
mod seam;
mod sparse_least_norm;
mod springs;
mod squares;

pub(in crate::coupling) use self::nonlinear_bonds::ReachOfSeam;
pub use self::{affine_fit::SeamConditions, nonlinear_bonds::NonlinearSeam};

use std::sync::Arc;

use self::{bond_segments::Segments, corner_correction::EdgeCorrection, dilatation::Dilatations};
use crate::coupling::truncated::{
    lps_constants::LpsConstants,
    springs::{Springs, WholeBonds},
};
use crate::{
    assembly::Row,
    coupling::{CellStresses, Definiteness, ExactStresses, MixedRows, Operator, SeamBonds},
    mesh::Mesh,
    model::{
        CellRole, Interface, Model, ModelError, Reach, Zone, ZoneLayout,
        held_families::depth_of_seam,
    },
    peridynamics::LinearForceState,
    system::Symmetry,
};

/// Bonds that leave the peridynamic zone end on the faces of the elements around it.
///
/// Source: none; derived in `docs/truncated.md`. A transition zone, if the scene has one, is local. Pairwise laws, LPS and position-aware solids on a regular lattice with one horizon.
#[derive(Clone, Copy, Debug, Default)]
pub struct Truncated {
    /// Treatment in motion of the bonds that the seam cuts.
    pub cut_bonds: CutBonds,
}

/// Treatment in motion of bonds that the seam cuts, where bonds are exact or break.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CutBonds {
    /// They turn, stretch and break like others.
    #[default]
    Breaking,
    /// They are rows of a matrix, which is cheaper. Damage that comes within two horizons of the seam is reported.
    Linear,
}

impl<const D: usize> ZoneLayout<D> for Truncated {
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

    fn reach(&self, _law: &dyn LinearForceState<D>) -> Reach {
        Reach::Own
    }

    fn interface(&self) -> Interface {
        Interface::FACES
    }

    fn takes_deviators(&self) -> bool {
        true
    }

    fn families_of_all(&self, law: &dyn LinearForceState<D>) -> Option<usize> {
        Some(depth_of_seam(law.is_pairwise()))
    }

    fn moves_with_own_families(&self) -> bool {
        true
    }
}

coupling_by_rows!(Truncated);

impl Truncated {
    fn rows<'a, const D: usize>(
        &self,
        model: &'a Model<D>,
    ) -> Result<Box<dyn Operator<D> + 'a>, ModelError> {
        let (Some(body), Some(passing)) = (model.body(), model.passing()) else {
            return Ok(super::uncoupled::own_model(model));
        };
        let known = model.operator_cache.get();
        if let Some(pieces) = known.and_then(|known| known.downcast_ref::<Arc<Pieces<D>>>()) {
            return Ok(Box::new(TruncatedRows {
                model,
                states: None,
                cut_bonds: self.cut_bonds,
                pieces: Arc::clone(pieces),
            }));
        }
        let mut segments = Segments::new(model, body, passing);
        let mut strings = EdgeCorrection::new(&segments);
        if affine_fit::fit(&mut segments, &strings)? {
            // the fit has balanced the corners too
            strings = EdgeCorrection::none();
        }
        let common = LpsConstants::new(&segments)?;
        // a state reaches one family farther than a bond
        let listed = match &common {
            Some(_) => segments.with_neighbours(),
            None => segments.at_seam.clone(),
        };
        // without states the whole bonds of the points at the seam are the body's
        let springs = Springs::new(&segments, common.as_ref().map(|_| &listed[..]));
        let dilatations = match &common {
            Some(common) => Dilatations::new(&segments, common, &listed),
            None => Dilatations::none(model.sites.len()),
        };
        // below the pairwise ratio dilatations take from the bonds what a fit has left them
        let has_two = common
            .as_ref()
            .is_some_and(LpsConstants::has_two_dilatations);
        let squares = match &common {
            Some(common) if common.bulk < 0.0 => segments.is_squares,
            // the energy that θ_σ takes back is that of the pairs
            Some(_) if has_two => springs.is_positive(),
            _ => springs.is_positive() && dilatations.is_positive(),
        };
        let (whole, states) = match common {
            None => (Some(WholeBonds::of(segments)), None),
            Some(common) => (None, Some((segments, common))),
        };
        let pieces = Arc::new(Pieces {
            whole,
            squares,
            has_two_dilatations: has_two,
            strings,
            springs,
            dilatations,
            listed,
        });
        if states.is_none() {
            // one that is there already says the same
            let _ = model.operator_cache.set(Box::new(Arc::clone(&pieces)));
        }
        Ok(Box::new(TruncatedRows {
            model,
            states,
            cut_bonds: self.cut_bonds,
            pieces,
        }))
    }
}

/// Looks at what a seam needs whose faces cut the lattice anywhere, without building it; none if the model has no seam.
///
/// It takes all eigenvalues of a dense matrix of the conditions, some ten for each site at the seam.
pub fn seam_conditions<const D: usize>(model: &Model<D>) -> Option<SeamConditions> {
    let (body, passing) = (model.body()?, model.passing()?);
    let mut segments = Segments::new(model, body, passing);
    Some(affine_fit::conditions(&mut segments))
}

struct TruncatedRows<'a, const D: usize> {
    model: &'a Model<D>,
    /// The bonds of the points at the seam, of a law whose bonds share dilatations.
    states: Option<(Segments<'a, D>, LpsConstants)>,
    cut_bonds: CutBonds,
    pieces: Arc<Pieces<D>>,
}

/// Decomposition of the bonds of the points at the seam.
struct Pieces<const D: usize> {
    /// Those of a pairwise law that are whole, and the body's; the others are springs. With dilatations all are springs.
    whole: Option<WholeBonds>,
    springs: Springs<D>,
    dilatations: Dilatations<D>,
    strings: EdgeCorrection<D>,
    /// Points whose rows are not those of the body alone.
    listed: Vec<bool>,
    /// True if no dilatation has a negative stiffness.
    squares: bool,
    /// True if dilatations by two influence functions are subtracted from one another.
    has_two_dilatations: bool,
}

impl<const D: usize> Operator<D> for TruncatedRows<'_, D> {
    fn add_row(&self, site: usize, row: &mut Row<D>) {
        match self.model.point_of(site) {
            Some((body, i)) if !self.pieces.listed[i] => {
                body.add_force_row(i, |_| 1.0, row);
                return;
            }
            Some((body, i)) => {
                if let Some(whole) = &self.pieces.whole {
                    body.add_force_row(i, |j| f64::from(whole.contains(i, j)), row);
                }
            }
            None => {
                self.model.add_rows_of_own_elements(site, row);
                self.pieces.strings.add_row(site, row);
            }
        }
        self.pieces.springs.add_row(site, row);
        self.pieces.dilatations.add_row(site, row);
    }

    fn counts_materials(&self) -> bool {
        false
    }

    fn is_body_row(&self, site: usize) -> bool {
        self.model
            .point_of(site)
            .is_some_and(|(_, i)| !self.pieces.listed[i])
    }

    fn mixed_rows(&self) -> Option<&dyn MixedRows<D>> {
        Some(self)
    }

    fn exact_stresses(&self) -> Option<ExactStresses<D>> {
        None
    }

    fn definiteness(&self) -> Definiteness {
        let is_plain = self.pieces.strings.is_empty() && !self.pieces.has_two_dilatations;
        match (self.pieces.squares, is_plain) {
            (true, true) => Definiteness::SumOfSquares,
            (true, false) => Definiteness::EdgeTerms,
            (false, _) => Definiteness::NegativeTerms,
        }
    }

    fn seam_bonds(&self) -> Option<SeamBonds<'_, D>> {
        // what follows the motion has one dilatation
        if self.cut_bonds == CutBonds::Linear || self.pieces.has_two_dilatations {
            return None;
        }
        let states = self.states.as_ref();
        let broken = match (&self.pieces.whole, states) {
            (Some(whole), _) => &whole.broken,
            (None, Some((segments, _))) => &segments.broken,
            (None, None) => return None,
        };
        let bonds = NonlinearSeam::new(
            self.model,
            self.model.body()?,
            &self.pieces.springs,
            broken,
            states.map(|(segments, common)| (segments, common)),
        );
        Some(SeamBonds {
            bonds,
            add_rest: Box::new(|site, row| {
                if self.model.point_of(site).is_none() {
                    self.model.add_rows_of_own_elements(site, row);
                    self.pieces.strings.add_row(site, row);
                    // the elements behind the seam have other dilatations, with the bonds
                    self.pieces.dilatations.take_back(site, row);
                }
            }),
        })
    }

    fn beta(&self, site: usize) -> f64 {
        f64::from(u8::from(self.model.point_of(site).is_some()))
    }

    fn additional_bonds(&self) -> usize {
        0
    }

    fn cell_stresses(&self) -> Option<&dyn CellStresses<D>> {
        None
    }
}

impl<const D: usize> MixedRows<D> for TruncatedRows<'_, D> {
    fn has_body_bonds(&self, site: usize) -> bool {
        // the dilatations of an LPS differ from the body's
        let alone = self.pieces.whole.is_some();
        alone && self.model.point_of(site).is_some() && !self.is_body_row(site)
    }

    fn is_body_bond(&self, i: usize, j: usize) -> bool {
        let whole = self.pieces.whole.as_ref();
        whole.is_none_or(|whole| whole.contains(i, j))
    }

    fn add_row_beside_bonds(&self, site: usize, row: &mut Row<D>) {
        if self.has_body_bonds(site) {
            self.pieces.springs.add_row(site, row);
        }
    }
}
