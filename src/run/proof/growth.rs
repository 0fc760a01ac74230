//! Growth of modes: boundedness of a motion, examined before the first step, and reported with the resolution of the answer.

#![deny(clippy::wildcard_enum_match_arm)]

use crate::observe::proof::{Figure, Finding, Part, Severity};
use crate::observe::report::number;
use crate::observe::warning::{Code, Warning};
use crate::progress::Progress;
use crate::run::definiteness::factorised;
use crate::run::error::RunError;
use crate::run::loads::supports;
use crate::run::setup::RunSettings;
use crate::scene::conditions::{Condition, Prescribed};
use crate::scene::spec::CouplingSpec;
use crate::solve::explicit::State;
use crate::solve::growth_from_start::energy_gained;
use crate::solve::instability_growth::{Evidence, Growth, REMEDY, REMEDY_SEAM, growth};
use crate::system::{Ranks, SemiDiscrete, Symmetry};
use crate::{
    coupling::{Definiteness, Operator},
    model::Model,
};

/// The largest factor by which a mode that is not seen may grow over the run, if the answer is to be that none grows.
const UNSEEN: f64 = 1.1;

/// Growth by less than `exp` of this over a run is reported as none: rounding makes as much of double eigenvalues.
const LEAST: f64 = 1e-3;

/// The growth exponent from which on modes that grow are sought in the start of a motion: they gain 1 % of their energy.
const SOUGHT: f64 = 0.005;

/// Energy of growing modes, over that of a free motion at its start, from which on the motion is warned of.
const GAINED: f64 = 0.01;

/// Part of a motion that a mode shows with: 1 %.
const SHOWN: f64 = 0.01;

/// Part of a motion that a mode of the seam may have to begin with: of smooth motions it is less.
const PRESENT: f64 = 1e-3;

/// Data for the search for growing modes before a run.
#[derive(Clone, Copy)]
pub struct GrowthQuestion<'a> {
    /// Remedy for growing modes.
    pub remedy: &'static str,
    /// Evidence that no mode grows, if there is any.
    pub proved: Option<&'static str>,
    /// True if the scene does not accept one that does.
    pub denied: bool,
    /// True if it may begin even where round-off will stop it in the first half of the run.
    pub may_be_hopeless: bool,
    /// Position of a site.
    pub place: &'a dyn Fn(usize) -> Vec<f64>,
    /// The processes that ask together.
    pub ranks: Option<&'a dyn Ranks>,
    /// Displacement and velocity at the start of a motion that is linear and left to itself; none of another.
    pub free_from: Option<(&'a [f64], &'a [f64])>,
}

/// Displacement and velocity of all sites.
type Pair<'a> = (&'a [f64], &'a [f64]);

/// The start of a motion that is left to itself: nothing loads it, and what is held stays at zero.
pub(crate) fn free_start<'a, const D: usize>(
    (model, rest): (&Model<D>, &RunSettings<D>),
    is_linear: bool,
    begin: &'a State,
) -> Result<Option<Pair<'a>>, RunError> {
    let is_still = |c: &Condition<D>| match &c.prescribed {
        Prescribed::Displacement(_) | Prescribed::Field(_) => !c.components.depends_on_time(),
        Prescribed::Term(term) => term.holds_at_rest(),
        Prescribed::Velocity(_) | Prescribed::Load(_) => false,
    };
    let is_free = is_linear
        && rest.impactors.is_empty()
        && rest.stresses.thermal.is_none()
        && rest.conditions.iter().all(is_still);
    if !is_free {
        return Ok(None);
    }
    let (held, _) = supports(model, &rest.conditions, 0.0)?;
    let is_zero = held.iter().flatten().all(|u| *u == 0.0);
    Ok(is_zero.then_some((&begin.u[..], &begin.v[..])))
}

/// Returns the remedy for modes that grow with a coupling.
// a text, which serves couplings to come as well
#[allow(clippy::wildcard_enum_match_arm)]
pub(crate) fn remedy(coupling: &CouplingSpec) -> &'static str {
    match coupling {
        CouplingSpec::PartialStress(_) => REMEDY,
        _ => REMEDY_SEAM,
    }
}

/// Returns the evidence, if any, that no mode grows at rest: a symmetric stiffness whose energy is a sum of squares, or that has been factorised.
///
/// Collective, of processes. The energy of bonds is a sum of squares if no weight is negative, that of a state-based law below the Poisson ratio of its bonds too: its squares are those of volume and shape.
pub(crate) fn proved<const D: usize>(
    model: &Model<D>,
    operator: &Operator<'_, D>,
    (ranks, system): (Option<&dyn Ranks>, &dyn SemiDiscrete),
    progress: &dyn Progress,
) -> Option<&'static str> {
    if system.symmetry() != Symmetry::Symmetric {
        return None;
    }
    match operator.definiteness {
        Definiteness::SumOfSquares => {}
        // or the run would have been refused
        Definiteness::NegativeTerms => return Some(FACTORISED),
        Definiteness::EdgeTerms => {
            return factorised((model, operator, ranks), MOST_FLOPS, progress)
                .is_ok()
                .then_some(FACTORISED);
        }
    }
    let no_weight_is_negative = model.body().is_none_or(|body| {
        (0..body.families.len()).all(|i| body.kernel(i).0.iter().all(|pair| *pair >= 0.0))
    });
    let no_weight_is_negative = match model.spread(ranks) {
        Some(spread) => spread.all(no_weight_is_negative),
        None => no_weight_is_negative,
    };
    no_weight_is_negative.then_some("the stiffness is symmetric, and its energy a sum of squares")
}

/// Evidence by a factorisation.
const FACTORISED: &str = "a Cholesky factorisation of the stiffness shows no negative eigenvalue";

/// Operations of the costliest factorisation that is made only to prove that no mode grows: some seconds of one core.
const MOST_FLOPS: f64 = 1e10;

/// The line of the proof: growth of a mode or none, and the evidence.
fn line_of(found: &Growth, exponent: f64, unseen: f64, place: &[f64]) -> String {
    let how = evidence(found);
    let hidden = format!(
        "growth by less than a factor of {} over the run would not show",
        factor(unseen)
    );
    match exponent > LEAST {
        true => format!(
            "a mode grows by a factor of {} over the run, as exp({} t), largest at ({}) ({how}); the energy balance is watched",
            factor(exponent),
            number(found.rate),
            coordinates(place)
        ),
        false if unseen <= UNSEEN.ln() => format!("no mode grows over the run ({how}; {hidden})"),
        false => format!(
            "whether a mode grows over the run is not known ({how} showed none; {hidden}); the energy balance is watched"
        ),
    }
}

/// Energy of all growing modes at the end of a motion, over that at its start; none where it is not known.
fn gained(
    asked: &GrowthQuestion<'_>,
    found: &Growth,
    system: &dyn SemiDiscrete,
    held: &[u32],
    (step, steps): (f64, u64),
) -> Result<Option<f64>, RunError> {
    let grows = found.rate * steps as f64 * step > SOUGHT;
    match (asked.free_from, asked.ranks, found.evidence) {
        (Some(start), None, Evidence::Eigenvalues) if grows => {
            Ok(energy_gained(system, held, (step, steps), start)?)
        }
        _ => Ok(None),
    }
}

/// Collective: looks for modes that grow over a run of `steps` steps of `step`; at most a tenth of its products, and at least 200.
///
/// # Errors
/// [`RunError::Denied`] for a mode of which is warned, in a scene that denies it, and [`RunError::Unproven`] for one that shows from round-off in the first half of the run.
pub(crate) fn check(
    asked: &GrowthQuestion<'_>,
    system: &dyn SemiDiscrete,
    held: &[u32],
    (step, steps): (f64, u64),
) -> Result<Part, RunError> {
    if let Some(how) = asked.proved {
        return Ok(Part {
            name: NAME,
            line: format!("no mode grows, proved: {how}"),
            figures: Vec::new(),
            findings: Vec::new(),
        });
    }
    let found = growth(system, held, step, steps, asked.ranks)?;
    let duration = steps as f64 * step;
    let exponent = found.rate * duration;
    // below the least that is told the fastest mode is one that does not show either
    let unseen = (found.resolution * duration).max(exponent.min(LEAST));
    let grows = exponent > LEAST;
    let place = if grows {
        (asked.place)(found.site)
    } else {
        Vec::new()
    };
    let gained = gained(asked, &found, system, held, (step, steps))?;
    let of_this_motion = gained.map_or(String::new(), |gained| {
        format!(
            "; the motion begins with so little of such modes that they end with at most {} of its energy",
            number(gained)
        )
    });
    let line = line_of(&found, exponent, unseen, &place) + &of_this_motion;
    let is_told = gained.map_or(exponent > shows_from(PRESENT), |gained| gained > GAINED);
    let finding = is_told
        .then(|| finding(asked, &found, exponent, place))
        .transpose()?;
    let figure = |name: &str, value: f64| Figure {
        name: name.to_owned(),
        value,
    };
    Ok(Part {
        name: NAME,
        line,
        figures: vec![
            figure("rate", found.rate),
            figure("resolution", found.resolution),
            figure("exponent", exponent),
            figure("exponent that would not show", unseen),
            figure("products", found.products as f64),
        ],
        findings: finding.into_iter().collect(),
    })
}

/// Logarithm of the factor by which a mode grows from a part of the motion until it shows.
fn shows_from(part: f64) -> f64 {
    (SHOWN / part).ln()
}

/// The finding on a mode that grows by `exp(exponent)` over the run.
fn finding(
    asked: &GrowthQuestion<'_>,
    found: &Growth,
    exponent: f64,
    place: Vec<f64>,
) -> Result<Finding, RunError> {
    let message = format!(
        "a mode of the seam grows as exp({} t), by a factor of {} over the run, largest at ({}): begun as a thousandth of the motion it is a hundredth at t = {}, from round-off at t = {}; the run stops where energy gained without work passes solve.explicit.largest-energy-gain; {}",
        number(found.rate),
        factor(exponent),
        coordinates(&place),
        number(shows_from(PRESENT) / found.rate),
        number(shows_from(f64::EPSILON) / found.rate),
        asked.remedy
    );
    if exponent > 2.0 * shows_from(f64::EPSILON) && !asked.may_be_hopeless {
        return Err(RunError::Unproven { message, place });
    }
    let warning = Warning {
        denied: asked.denied,
        ..Warning::new(Code::Growth, message).at(place)
    };
    match asked.denied {
        true => Err(RunError::Denied(Box::new(warning))),
        false => Ok(Finding {
            severity: Severity::Warning,
            value: exponent.exp(),
            limit: shows_from(PRESENT).exp(),
            warning,
        }),
    }
}

/// Name of the part.
const NAME: &str = "growth";

fn coordinates(place: &[f64]) -> String {
    let words: Vec<String> = place.iter().map(|x| format!("{x:.4e}")).collect();
    words.join(", ")
}

fn evidence(found: &Growth) -> String {
    match found.evidence {
        Evidence::Eigenvalues => "all eigenvalues".to_owned(),
        Evidence::Noise { neighbourhoods: 0 } => {
            format!("{} products from noise", found.products)
        }
        Evidence::Noise { neighbourhoods } => format!(
            "{} products from noise, and all eigenvalues of {neighbourhoods} neighbourhood{} of the seam",
            found.products,
            if neighbourhoods == 1 { "" } else { "s" }
        ),
    }
}

/// `exp` of an exponent, as such where the number would say nothing.
fn factor(exponent: f64) -> String {
    match exponent {
        e if e < 10.0 => format!("{:.4}", e.exp()),
        e => format!("exp({})", number(e)),
    }
}
