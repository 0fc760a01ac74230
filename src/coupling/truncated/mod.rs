//! Truncated bonds: a seam that is symmetric, patch-exact and in exact equilibrium.
//!
//! | file | content |
//! |---|---|
//! | `seam.rs`, `piece.rs` | the faces of the peridynamic zone, and the pieces of a bond inside of it |
//! | `bond_segments.rs`, `springs.rs` | pieces with their ends and stiffness, and their rows |
//! | `nonlinear_bonds.rs`, `bond_kinematics.rs` | pieces that rotate, stretch and break |
//! | `dilatation.rs`, `lps_constants.rs` | contributions of pieces to the dilatations of an LPS |
//! | `dilatation_state.rs` | the same where pieces rotate, stretch and break |
//! | `element_dilatation.rs` | the same in elements with the Cauchy–Born law of the bonds |
//! | `corner_correction.rs` | strings along the edges of a zone in 3D |
//! | `affine_fit.rs` | the fit where faces cut the lattice anywhere |
//! | `squares.rs` | its factors of pieces, and an LPS as a sum of squares |
//! | `feet.rs` | its other traces at the ends of pieces, where factors alone do not suffice |
//! | `fit_parts.rs`, `conditions.rs`, `sparse_least_norm.rs` | its unknowns, its conditions, and the smallest change that meets them |
//! | `normal.rs`, `factors.rs` | its normal equations, their factorisation and cost |
//!
//! The lattice is continued behind the faces of the zone. The energy is that of the finite elements, of the bonds within the zone, and of each *piece* of any other bond that lies in the zone:
//!
//! ```text
//! s w(ξ, Δu / s) ,     Δu = u(q) − u(p)
//! ```
//!
//! for a piece from `p` to `q`. Its length `s` is a fraction of that of its bond ξ, whose energy is `w(ξ, η)` \[J\]. An end within the zone is a point; an end on a face has the trace of the displacement of the element behind it. Under `u = G x` every piece
//! pulls like the whole bond. The forces on points therefore cancel as they do far from the seam, and the forces on a face add up to the traction of the lattice. Pieces of bonds with both ends in elements
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

use rustc_hash::FxHashSet;

use self::{bond_segments::Segments, corner_correction::EdgeCorrection, dilatation::Dilatations};
use crate::coupling::truncated::{
    lps_constants::LpsConstants,
    springs::{Springs, WholeBonds},
};
use crate::{
    assembly::Row,
    coupling::{BodyBonds, BondsOfSite, Definiteness, Operator, SeamBonds, Term},
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

/// Treatment of bonds that the seam cuts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "CutBondsSpec")]
pub enum CutBonds {
    /// They rotate, stretch and break like others.
    #[default]
    Breaking,
    /// They are linear and do not break: cheaper, where damage stays two horizons away from the seam.
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
    fn rows<'a, const D: usize>(&self, model: &'a Model<D>) -> Result<Operator<'a, D>, ModelError> {
        let (Some(body), Some(passing)) = (model.body(), model.passing()) else {
            return Ok(super::uncoupled::own_model(model));
        };
        let known = model.operator_cache.get();
        if let Some(pieces) = known.and_then(|known| known.downcast_ref::<Arc<Pieces<D>>>()) {
            return Ok(self.terms(model, None, pieces));
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
        let broken = segments.broken.clone();
        let (whole, states) = match common {
            None => (Some(WholeBonds::of(segments)), None),
            Some(common) => (None, Some((segments, common))),
        };
        let pieces = Arc::new(Pieces {
            whole,
            broken,
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
        Ok(self.terms(model, states, &pieces))
    }

    /// Finite elements outside of the zone, the whole bonds of the body, the strings of edges, and the pieces of bonds with their dilatations.
    fn terms<'a, const D: usize>(
        &self,
        model: &'a Model<D>,
        states: Option<States<'a, D>>,
        pieces: &Arc<Pieces<D>>,
    ) -> Operator<'a, D> {
        let is_node = |site: usize| model.point_of(site).is_none();
        let of_nodes = Arc::clone(pieces);
        Operator {
            model,
            terms: vec![
                Term::Rows(Box::new(move |site, row| {
                    if is_node(site) {
                        model.add_rows_of_own_elements(site, row);
                        of_nodes.strings.add_row(site, row);
                    }
                })),
                Term::Bonds(body_bonds(model, pieces)),
                self.of_seam(model, states, pieces),
            ],
            beta: Box::new(move |site| f64::from(u8::from(!is_node(site)))),
            counts_materials: false,
            definiteness: pieces.definiteness(),
        }
    }

    /// The bonds that the seam cuts: linear rows, or bonds that rotate, stretch and break.
    fn of_seam<'a, const D: usize>(
        &self,
        model: &'a Model<D>,
        states: Option<States<'a, D>>,
        pieces: &Arc<Pieces<D>>,
    ) -> Term<'a, D> {
        let of_rows = Arc::clone(pieces);
        let add_row = Box::new(move |site: usize, row: &mut Row<D>| {
            let point = model.point_of(site).map(|(_, i)| i);
            if point.is_none_or(|i| of_rows.listed[i]) {
                of_rows.springs.add_row(site, row);
                of_rows.dilatations.add_row(site, row);
            }
        });
        // what follows the motion has one dilatation
        let may_move = self.cut_bonds == CutBonds::Breaking && !pieces.has_two_dilatations;
        let Some(body) = model.body().filter(|_| may_move) else {
            return Term::Rows(add_row);
        };
        let [of_motion, beside] = [Arc::clone(pieces), Arc::clone(pieces)];
        Term::SeamBonds(SeamBonds {
            add_row,
            in_motion: Box::new(move || {
                let states = states.as_ref().map(|(segments, common)| (segments, common));
                let Pieces {
                    springs, broken, ..
                } = &*of_motion;
                NonlinearSeam::new(model, body, springs, broken, states)
            }),
            // the elements behind the seam have other dilatations, with the bonds
            add_beside: Box::new(move |site, row| {
                if model.point_of(site).is_none() {
                    beside.dilatations.take_back(site, row);
                }
            }),
        })
    }
}

/// The bonds of the points at the seam, of a law whose bonds share dilatations.
type States<'a, const D: usize> = (Segments<'a, D>, LpsConstants);

/// The bonds of the body: all of points away from the seam, the whole ones of points at the seam of a pairwise law.
fn body_bonds<'a, const D: usize>(
    model: &'a Model<D>,
    pieces: &Arc<Pieces<D>>,
) -> BodyBonds<'a, D> {
    let [at, holds] = [Arc::clone(pieces), Arc::clone(pieces)];
    BodyBonds {
        at: Box::new(move |site| match model.point_of(site) {
            Some((_, i)) if !at.listed[i] => BondsOfSite::Alone,
            // the dilatations of an LPS differ from the body's
            Some(_) if at.whole.is_some() => BondsOfSite::Among,
            _ => BondsOfSite::None,
        }),
        holds: Box::new(move |i, j| {
            (holds.whole.as_ref()).is_none_or(|whole| whole.contains(i, j))
        }),
        feet: Vec::new(),
    }
}

/// Returns the conditions that a seam has to meet whose faces cut the lattice anywhere, without building it; none if the model has no seam.
pub fn seam_conditions<const D: usize>(model: &Model<D>) -> Option<SeamConditions> {
    let (body, passing) = (model.body()?, model.passing()?);
    let mut segments = Segments::new(model, body, passing);
    Some(affine_fit::conditions(&mut segments))
}

/// Decomposition of the bonds of the points at the seam.
struct Pieces<const D: usize> {
    /// The whole bonds that stay with the body, of a pairwise law; none with dilatations, where all bonds are springs.
    whole: Option<WholeBonds>,
    /// Bonds between points of the zone that leave it in between, lower number first.
    broken: FxHashSet<(u32, u32)>,
    springs: Springs<D>,
    dilatations: Dilatations<D>,
    strings: EdgeCorrection<D>,
    /// For each point, true if its row is not that of the body alone.
    listed: Vec<bool>,
    /// True if the energy of springs and dilatations is a sum of squares; of a law with two dilatations, that of the springs.
    squares: bool,
    /// True if dilatations by two influence functions are subtracted from one another.
    has_two_dilatations: bool,
}

impl<const D: usize> Pieces<D> {
    fn definiteness(&self) -> Definiteness {
        let is_plain = self.strings.is_empty() && !self.has_two_dilatations;
        match (self.squares, is_plain) {
            (true, true) => Definiteness::SumOfSquares,
            (true, false) => Definiteness::EdgeTerms,
            (false, _) => Definiteness::NegativeTerms,
        }
    }
}
