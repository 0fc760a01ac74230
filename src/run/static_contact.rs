//! Surfaces, and the faces of cracks, that press on each other in a static scene.
//!
//! The scene is solved without contact first: where nothing lies in anything else, that is its solution. Else it is solved again by Newton's method, with contact as a term beside the body.

use std::sync::Arc;

use super::equilibrium::{Assembled, Equilibrium, StaticInput, equilibrium};
use super::motion;
use crate::coupling::semidiscrete::CoupledSystem;
use crate::observe::report::number;
use crate::observe::summary::{Decision, Stopwatch, Timings};
use crate::observe::warning::{Code, Warning};
use crate::progress::Progress;
use crate::run::error::RunError;
use crate::run::setup::RunSettings;
use crate::system::{ForceTerm, LinearMotion, SemiDiscrete, WithTerms};

/// Part of the largest displacement by which surfaces may lie in each other before they are kept apart.
const TOUCHES: f64 = 1e-9;

/// The same of the faces of a crack, over the largest distance by which they have moved from each other.
const PRESSED: f64 = 0.02;

/// Bodies that are kept apart.
pub(super) struct Apart<'a, const D: usize> {
    /// The equilibrium with contact; none where nothing presses.
    pub equilibrium: Option<Equilibrium>,
    /// The system of the body in it, where it is not linear.
    pub system: Option<CoupledSystem<'a, D>>,
    /// A warning of surfaces that nothing keeps apart here.
    pub warning: Option<Warning>,
}

/// The equilibrium of a body whose surfaces, or the faces of whose cracks, lie in each other at the one that is `free` of contact.
///
/// # Errors
/// [`RunError`] as for any equilibrium, and for surfaces that lie in each other before.
pub(super) fn with_contact<'a, const D: usize>(
    (at, rest): (&StaticInput<'a, D>, &RunSettings<D>),
    free: &Equilibrium,
    (timings, choices): (&mut Timings, &mut Vec<Decision>),
    progress: &dyn Progress,
) -> Result<Apart<'a, D>, RunError> {
    let model = at.model;
    let mut apart = Apart {
        equilibrium: None,
        system: None,
        warning: None,
    };
    if rest.breaking.contact.is_some() && model.body().is_some() {
        choices.push(Decision {
            choice: "points do not press on each other".to_owned(),
            why: "a static scene keeps apart surfaces of elements and faces of cracks; load steps and motion keep points apart too".to_owned(),
        });
    }
    let Some(mut contact) = motion::contact::at_rest(model, rest) else {
        return Ok(apart);
    };
    let u = &free.solution.displacement;
    let largest = u.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
    motion::contact::begin(&mut contact, &vec![0.0; u.len()])?;
    let deepest = contact.deepest(u).map_or(0.0, |place| place.depth);
    let least = match rest.breaking.contact {
        Some(_) => TOUCHES * largest,
        // of cracks that open or slide, places at their tips may overlap a little
        None => PRESSED * contact.largest_jump(u),
    };
    if deepest <= least {
        return Ok(apart);
    }
    if model.spread.shared.is_some() {
        let depth = number(deepest);
        let message = format!(
            "faces of a crack lie in each other by {depth}: a static scene of several processes does not keep them apart; run it in one, or in load steps (solve.quasi-static.steps = 1)"
        );
        apart.warning = Some(Warning::new(Code::CrackOverlap, message));
        return Ok(apart);
    }
    let mut clock = Stopwatch::start();
    let knows_temperature = rest.stresses.thermal.is_some();
    let op = at.operator;
    let mut own = motion::dynamic_system::still(model, op, rest, knows_temperature)?;
    let mut linear = own.is_none().then(|| LinearMotion {
        stiffness: model.assemble(op, progress),
        mass: vec![1.0; model.sites.len()],
        symmetry: free.symmetry,
    });
    let of_body: &mut dyn SemiDiscrete = match (&mut own, &mut linear) {
        (Some(system), _) => system,
        (None, Some(linear)) => linear,
        (None, None) => return Ok(apart),
    };
    let contact = Arc::new(contact);
    let mut terms: Vec<Arc<dyn ForceTerm>> = vec![Arc::clone(&contact) as _];
    let bonds = contact.crack_bonds(model);
    terms.extend(bonds.map(|bonds| Arc::new(bonds) as _));
    let mut system = WithTerms::new(of_body, terms);
    let taken = Timings::default();
    // proved already
    let proved = |_: &Assembled<'_>| Ok(0.0);
    let found = equilibrium(at, Some(&mut system), taken, proved, progress)?;
    clock.lap(timings, "contact");
    let left = contact.deepest(&found.solution.displacement);
    let of_contact = motion::contact::told(&contact);
    choices.push(Decision {
        why: format!(
            "{}: without it they would lie in each other by {}; a depth of at most {} of a cell is left",
            of_contact.why,
            number(deepest),
            number(left.map_or(0.0, |place| place.depth / place.size))
        ),
        ..of_contact
    });
    apart.equilibrium = Some(found);
    apart.system = own;
    Ok(apart)
}
