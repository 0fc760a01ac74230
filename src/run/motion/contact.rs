//! Contact of the surfaces of a run, and the record of it.

use std::sync::Arc;

use super::dynamic_system::{DynamicSystem, start};
use crate::contact::{ContactLaw, SurfaceContact, has_cracks};
use crate::model::Model;
use crate::observe::report::number;
use crate::observe::summary::Decision;
use crate::observe::warning::{Code, Warning};
use crate::run::error::RunError;
use crate::run::setup::RunSettings;
use crate::solve::explicit::State;
use crate::system::{ForceTerm, Interval, WithTerms};
use crate::tensor::Vector;

/// Penalty of surfaces in motion over the stiffness of a cell, with the usual stiffness of points.
const IN_MOTION: f64 = 0.25;

/// The same at rest, where no step has to be stable: a strain of the cells of 1 % leaves a depth of 1e-4 of them.
const AT_REST: f64 = 100.0;

/// Factor of contact in the bounds of a motion: two bars of 100 cells that collide then keep their energy to 1e-3, and with 4 no better.
const COUNTED: f64 = 2.0;

/// The usual stiffness of points, in that of a bond as long as the horizon.
const USUAL: f64 = 15.0;

/// Depth up to which places are pushed out of another body, over the size of cells: in motion they come in by a part of it in a step.
const DEEPEST_IN_MOTION: f64 = 0.5;

/// The same at rest, where a step may carry a body far into another.
const DEEPEST_AT_REST: f64 = 5.0;

/// Depth at time zero over the size of a cell up to which surfaces touch only.
const TOUCHES: f64 = 1e-6;

/// Contact at rest: of all surfaces where the scene types contact, else of the faces of cracks alone; none where there are none.
pub(crate) fn at_rest<const D: usize>(
    model: &Model<D>,
    rest: &RunSettings<D>,
) -> Option<SurfaceContact<D>> {
    let typed = rest.breaking.contact.as_ref();
    if typed.is_none() && !has_cracks(model) {
        return None;
    }
    let law = ContactLaw {
        stiffness_factor: AT_REST * typed.map_or(1.0, |typed| typed.stiffness / USUAL),
        friction: typed.map_or(0.0, |typed| typed.friction),
        adjust: typed.map_or(0.0, |typed| typed.adjust),
        deepest: DEEPEST_AT_REST,
        counted: 1.0,
    };
    let contact = SurfaceContact::new(model, law, typed.is_none());
    (contact.facets() > 0).then_some(contact)
}

/// Contact in motion, where the scene types it.
fn in_motion<const D: usize>(model: &Model<D>, rest: &RunSettings<D>) -> Option<SurfaceContact<D>> {
    let typed = rest.breaking.contact.as_ref()?;
    let law = ContactLaw {
        stiffness_factor: IN_MOTION * typed.stiffness / USUAL,
        friction: typed.friction,
        adjust: typed.adjust,
        deepest: DEEPEST_IN_MOTION,
        counted: COUNTED,
    };
    let contact = SurfaceContact::new(model, law, false);
    (contact.facets() > 0).then_some(contact)
}

/// Adds the contact of surfaces to a dynamic system, where the scene types contact.
///
/// # Errors
/// [`RunError::SurfacesOverlap`] for bodies that lie in each other at time zero.
pub(super) fn touching<'a, const D: usize>(
    model: &Model<D>,
    rest: &RunSettings<D>,
    moving: DynamicSystem<'a>,
    choices: &mut Vec<Decision>,
) -> Result<(DynamicSystem<'a>, Option<Arc<SurfaceContact<D>>>), RunError> {
    let found = match rest.is_in_time {
        true => in_motion(model, rest),
        false if rest.breaking.contact.is_some() => at_rest(model, rest),
        false => None,
    };
    let Some(mut contact) = found else {
        return Ok((moving, None));
    };
    if rest.follow.is_some() && contact.law().friction > 0.0 {
        return Err(RunError::Later {
            what: "friction of surfaces while zones.follow moves the zone",
            remedy: "leave contact.friction or zones.follow out",
        });
    }
    begin(&mut contact, &start(model, rest).u)?;
    choices.push(told(&contact));
    let mut terms: Vec<Arc<dyn ForceTerm>> = Vec::new();
    if !rest.is_in_time {
        let bonds = contact.crack_bonds(model);
        terms.extend(bonds.map(|bonds| Arc::new(bonds) as _));
    }
    let contact = Arc::new(contact);
    terms.push(Arc::clone(&contact) as _);
    let moving = DynamicSystem {
        bytes: moving.bytes + contact.memory_bytes(),
        system: Box::new(WithTerms::new(moving.system, terms)),
        is_linear: false,
        has_exact_seam: moving.has_exact_seam,
    };
    Ok((moving, Some(contact)))
}

/// Begins contact at a displacement: adjusts surfaces, and refuses those that lie in each other.
///
/// # Errors
/// [`RunError::SurfacesOverlap`], [`RunError::Later`] for a distance of adjustment beyond half a cell.
pub(crate) fn begin<const D: usize>(
    contact: &mut SurfaceContact<D>,
    u: &[f64],
) -> Result<(), RunError> {
    if contact.law().adjust > 0.5 * contact.smallest() {
        return Err(RunError::Later {
            what: "contact.adjust is more than half of the smallest cell at a surface",
            remedy: "make it smaller, and move the bodies together where they are farther apart",
        });
    }
    contact.adjust(u);
    if let Some(deepest) = contact.deepest(u)
        && deepest.depth > TOUCHES * deepest.size
    {
        return Err(RunError::SurfacesOverlap {
            depth: deepest.depth,
            place: deepest.rest.as_slice().to_vec(),
            // more than the depth, as it is printed
            adjust: Some(1.2 * deepest.depth).filter(|a| 1.1 * a < 0.5 * contact.smallest()),
        });
    }
    ForceTerm::commit(contact, u, Interval::AT_ONCE);
    Ok(())
}

/// The contact of a run in words.
pub(crate) fn told<const D: usize>(contact: &SurfaceContact<D>) -> Decision {
    let law = contact.law();
    let friction = match law.friction > 0.0 {
        true => format!("with friction {}", number(law.friction)),
        false => "without friction".to_owned(),
    };
    let [elements, cracks] = contact.facets_of();
    let parts = [(elements, "of elements"), (cracks, "of cracks")];
    let parts = parts.iter().filter(|(count, _)| *count > 0);
    let parts: Vec<String> = parts.map(|(count, of)| format!("{count} {of}")).collect();
    Decision {
        choice: format!("contact of surfaces {friction}"),
        why: format!(
            "facets that keep each other out, {}, by a penalty of {} of the stiffness of a cell",
            parts.join(" and "),
            number(law.stiffness_factor)
        ),
    }
}

/// Record of the contact of surfaces: columns of the history, and warnings.
pub struct ContactRecord<const D: usize> {
    contact: Arc<SurfaceContact<D>>,
    /// The greatest depth over the size of a cell in a row, with its place and time.
    deepest: (f64, Vector<D>, f64),
}

/// Depth over the size of a cell from which on a run is warned of.
const DEEP: f64 = 0.25;

impl<const D: usize> ContactRecord<D> {
    /// Takes the contact of another layout of the same body.
    pub fn move_to(&mut self, contact: Arc<SurfaceContact<D>>) {
        self.contact = contact;
    }

    /// Of a contact.
    pub fn new(contact: Arc<SurfaceContact<D>>) -> Self {
        Self {
            contact,
            deepest: (0.0, Vector::zeros(), 0.0),
        }
    }

    /// The columns of a row.
    pub fn header(&self) -> Vec<String> {
        let mut header = vec![
            "surface_contact_energy".to_owned(),
            "surface_contact_places".to_owned(),
            "surface_contact_depth".to_owned(),
        ];
        if self.contact.law().friction > 0.0 {
            header.push("friction_work".to_owned());
        }
        header
    }

    /// The numbers of a row.
    pub fn row(&mut self, state: &State) -> Vec<f64> {
        let deepest = self.contact.deepest(&state.u);
        let depth = deepest.as_ref().map_or(0.0, |d| d.depth);
        if let Some(place) = deepest {
            let part = place.depth / place.size;
            if part > self.deepest.0 {
                self.deepest = (part, place.rest, state.time);
            }
        }
        let mut row = vec![
            self.contact.energy(&state.u),
            self.contact.touching(&state.u) as f64,
            depth,
        ];
        row.extend(self.contact.work_of_friction());
        row
    }

    /// Warns of surfaces that came in deep.
    pub fn warnings(&self) -> Option<Warning> {
        let (part, place, time) = &self.deepest;
        let at: Vec<String> = place.iter().map(|x| number(*x)).collect();
        (*part > DEEP).then(|| {
            Warning::new(Code::ContactDepth, format!(
                "contact: at t = {} a surface lay {} of a cell inside another, at ({}) of the body at rest; beyond half a cell it passes through: multiply contact.stiffness-factor by four",
                number(*time),
                number(*part),
                at.join(", ")
            )).at(place.as_slice())
        })
    }
}
