//! Proof of a model before it is solved: properties that must hold whatever the load are checked on the model at hand, and reported, warned of, or refused.
//!
//! | file | what is shown |
//! |---|---|
//! | `loads.rs` | mass, total and first moment of each load against integrals over the mesh; supports held everywhere |
//! | `affine.rs` | the force of every affine field, row by row, against that of its constant stress |
//! | `classes.rs`, `fields.rs`, `surface.rs`, `patch.rs` | rows out of balance and the findings on them, the fields and their forces, the boundary of the body, the error of the stress around a row out of balance |
//! | `symmetry.rs` | symmetry of the stiffness where the coupling promises it |
//! | `quadratic.rs` | the force of quadratic fields beside the seam |
//! | `growth.rs` | growth of modes of the motion |
//!
//! A check is one file with one function and one line in [`prove`]. What it returns is plain data ([`Part`]), so the summary, `check` and `--json` know of it without another line.
//! Limits stand in `docs/proof.md`, each beside the measurement that chose it.

mod affine;
mod classes;
mod fields;
pub mod growth;
mod loads;
mod patch;
mod quadratic;
mod surface;
mod symmetry;

use super::setup::RunSettings;
use crate::observe::proof::{Part, Proof, Severity};
use crate::progress::Progress;
use crate::run::error::RunError;
use crate::scene::spec::UnprovenSpec;
use crate::system::{BlockCsr, Ranks, SemiDiscrete};
use crate::{
    coupling::{Coupling, Operator},
    model::Model,
};

/// Subject of the proof: a model laid out, with its conditions.
pub struct Subject<'a, const D: usize> {
    /// Sites, families and zones.
    pub model: &'a Model<D>,
    /// The method that couples them.
    pub coupling: &'a dyn Coupling<D>,
    /// Rows of the stiffness.
    pub operator: &'a Operator<'a, D>,
    /// Settings that the run keeps of the scene.
    pub rest: &'a RunSettings<D>,
    /// The assembled stiffness, where all rows are at hand; else rows come from the operator.
    pub stiffness: Option<&'a BlockCsr>,
    /// Overwrites the second vector by the product of the stiffness, or of the tangent at rest, with the first.
    pub product: &'a (dyn Fn(&[f64], &mut [f64]) + Sync),
    /// The dynamic system, in a scene that has one.
    pub system: Option<&'a dyn SemiDiscrete>,
    /// The processes over which the families of the model may be spread.
    pub ranks: Option<&'a dyn Ranks>,
}

/// Runs every check that the scene calls for.
///
/// # Errors
/// [`RunError`] of a check that cannot be made.
pub fn prove<const D: usize>(
    subject: &Subject<'_, D>,
    progress: &dyn Progress,
) -> Result<Proof, RunError> {
    let parts: [Option<Part>; 4] = [
        loads::part(subject)?,
        affine::part(subject, progress)?,
        symmetry::part(subject),
        quadratic::part(subject)?,
    ];
    let mut proof = Proof {
        parts: parts.into_iter().flatten().collect(),
    };
    if subject.rest.solver.unproven == UnprovenSpec::Warn {
        let findings = proof.parts.iter_mut().flat_map(|p| &mut p.findings);
        findings.for_each(|f| f.severity = Severity::Warning);
    }
    let denied = &subject.rest.warnings.denied;
    for finding in proof.parts.iter_mut().flat_map(|p| &mut p.findings) {
        if denied.contains(&finding.warning.code) {
            (finding.severity, finding.warning.denied) = (Severity::Refusal, true);
        }
    }
    Ok(proof)
}

/// Refuses a model for which the proof does not hold.
///
/// # Errors
/// [`RunError::Unproven`] with the first refusal, [`RunError::Denied`] for a warning that the scene denies.
pub fn hold(proof: &Proof) -> Result<(), RunError> {
    let findings = proof.parts.iter().flat_map(|p| &p.findings);
    let mut refusals = findings.filter(|f| f.severity == Severity::Refusal);
    match refusals.next() {
        Some(refusal) if refusal.warning.denied => {
            Err(RunError::Denied(Box::new(refusal.warning.clone())))
        }
        Some(refusal) => Err(RunError::Unproven {
            message: refusal.warning.message.clone(),
            place: refusal.warning.place.clone(),
        }),
        None => Ok(()),
    }
}
