//! Rigid impactors of a run: their contact with the body.

use std::sync::Arc;

use super::dynamic_system::DynamicSystem;
use crate::observe::report::number;
use crate::observe::summary::Decision;
use crate::run::error::RunError;
use crate::run::setup::RunSettings;
use crate::scene::impactors::Impactor;
use crate::solve::explicit::State;
use crate::solve::krylov::LinearMap;
use crate::system::WithTerms;
use crate::{
    coupling::{Impact, RigidImpactor},
    model::Model,
};

/// Depth inside an impactor at time zero over the size of the body, up to which a body touches it only.
const TOUCHES: f64 = 1e-9;

/// Adds the impactors of the scene to a dynamic system, which stays as it is where the scene has none. `begin` is the state at time zero; contact counts `counted` times in the bounds of the stable step.
///
/// # Errors
/// [`RunError::Overlap`] for an impactor that lies over the body at time zero.
pub(crate) fn impacted<'a, const D: usize>(
    model: &Model<D>,
    rest: &RunSettings<D>,
    moving: DynamicSystem<'a>,
    begin: &State,
    counted: f64,
    choices: &mut Vec<Decision>,
) -> Result<(DynamicSystem<'a>, Option<Arc<Impact<D>>>), RunError> {
    if rest.impactors.is_empty() {
        return Ok((moving, None));
    }
    let rigid = |i: &Impactor<D>| RigidImpactor {
        shape: i.shape.clone(),
        mass: i.mass(),
        stiffness_factor: i.stiffness_factor,
    };
    let impactors = rest.impactors.iter().map(rigid).collect();
    let impact = Impact::new(model, impactors, counted);
    let (low, high) = model.mesh.bounds();
    if let Some((site, impactor, depth)) = impact.deepest(&begin.u)
        && depth > TOUCHES * (high - low).norm()
    {
        return Err(RunError::Overlap {
            impactor: rest.impactors[impactor].name.clone(),
            depth,
            place: model.sites[site].position.as_slice().to_vec(),
        });
    }
    let names: Vec<&str> = rest.impactors.iter().map(|i| i.name.as_str()).collect();
    choices.push(Decision {
        choice: format!(
            "rigid {}: {}",
            if names.len() == 1 { "impactor" } else { "impactors" },
            names.join(", ")
        ),
        why: format!(
            "frictionless contact by a penalty of at most {} per site, which the stable step counts",
            number(impact.stiffest())
        ),
    });
    let impact = Arc::new(impact);
    let moving = DynamicSystem {
        bytes: moving.bytes + impact.memory_bytes(),
        system: Box::new(WithTerms::new(
            moving.system,
            vec![Arc::clone(&impact) as _],
        )),
        is_linear: false,
        has_exact_seam: moving.has_exact_seam,
    };
    Ok((moving, Some(impact)))
}

/// An approximate inverse of the body's tangent, for a system in which impactors follow the body's sites.
pub(crate) struct BodyOnly<'a> {
    /// That of the body.
    near: &'a dyn LinearMap,
    /// The body's dofs.
    dofs: usize,
}

impl<'a> BodyOnly<'a> {
    /// Of the tangent of `model`.
    pub fn new<const D: usize>(near: &'a dyn LinearMap, model: &Model<D>) -> Self {
        let dofs = model.sites.len() * D;
        Self { near, dofs }
    }
}

impl LinearMap for BodyOnly<'_> {
    fn apply_into(&self, x: &[f64], y: &mut [f64]) {
        let (own, rest) = y.split_at_mut(self.dofs);
        self.near.apply_into(&x[..self.dofs], own);
        rest.fill(0.0);
    }
}
