//! The length of load steps, and the parameters by which each finds its equilibrium.

use super::saved::StepChoice;
use crate::observe::report::number;
use crate::observe::summary::Decision;
use crate::scene::solve::QuasiStatic as Spec;
use crate::scene::spec::LoadStepSpec;
use crate::solve::quasi_static::{Equilibrium, QuasiStaticParams};

/// Load steps of equal length.
pub(super) fn step_choice(spec: &Spec) -> StepChoice {
    StepChoice {
        step: spec.duration / spec.steps as f64,
        steps: spec.steps as u64,
        stable: 0.0,
        certified: 0.0,
        site: 0,
        since: (0, 0.0),
    }
}

/// Returns the parameters by which each load step finds its equilibrium.
pub(super) fn equilibrium_params(spec: &Spec, choices: &mut Vec<Decision>) -> QuasiStaticParams {
    let params = QuasiStaticParams {
        equilibrium: match spec.method {
            LoadStepSpec::Implicit => Equilibrium::Newton,
            LoadStepSpec::Relaxation => Equilibrium::Relaxation,
        },
        tolerance: spec.tolerance,
        max_iterations: spec.max_iterations,
        ..QuasiStaticParams::default()
    };
    choices.push(Decision {
        choice: match params.equilibrium {
            Equilibrium::Newton => "Newton's method, without a matrix",
            Equilibrium::Relaxation => "adaptive dynamic relaxation",
        }
        .to_owned(),
        why: match spec.accuracy {
            None => format!("{} load steps to t = {}", spec.steps, number(spec.duration)),
            Some(part) => format!(
                "load steps to t = {}, as long as nothing fails in them, and {} of the load where bonds break",
                number(spec.duration),
                number(part)
            ),
        },
    });
    params
}
