//! Resources of a run, counted from volumes: the estimate where laying the model out would take longer than a check may.

use super::resource_estimate::Prediction;
use crate::observe::summary::{Decision, Sizes, Timings};
use crate::run::budget::Counts;
use crate::scene::Scene;

/// Seconds that `check` may take, or a [`TENTH`] of the run if that is more.
pub const ANSWERS: f64 = 5.0;

/// See [`ANSWERS`].
pub const TENTH: f64 = 0.1;

/// The counts of a scene as a prediction, where laying it out would take longer than `check` may; `None` where it would not.
pub(crate) fn counted<const D: usize>(scene: &Scene<D>) -> Option<Prediction> {
    let counts = Counts::of(scene);
    let (lay_out, run) = counts.seconds(scene);
    if lay_out <= ANSWERS.max(TENTH * (lay_out + run)) {
        return None;
    }
    let traits = scene.coupling.traits();
    let whole = |x: f64| x.round() as usize;
    let mut timings = Timings::default();
    timings.add("sites and bonds", lay_out);
    timings.add("solve", run);
    let mut choices = scene.choices.clone();
    choices.push(Decision {
        choice: format!("coupling {}", traits.name),
        why: scene
            .coupling_why
            .clone()
            .unwrap_or_else(|| traits.about.to_owned()),
    });
    Some(Prediction {
        scene: scene.title.clone(),
        counted: Some(format!("laying it out would take about {lay_out:.0} s")),
        dimension: D,
        coupling: traits.name.to_owned(),
        sizes: Sizes {
            nodes: counts.nodes,
            cells: counts.cells,
            sites: whole(counts.dofs / D as f64),
            points: whole(counts.points),
            bonds: whole(counts.bonds),
            dofs: whole(counts.dofs),
            nonzeros: whole(counts.nonzeros),
        },
        symmetry: scene.method().symmetry(),
        unknowns: whole(counts.dofs),
        peak_memory_bytes: counts.peak(),
        base_bytes: counts.base(),
        memory: counts.memory(),
        total_seconds: timings.total(),
        timings,
        choices,
        ..Prediction::default()
    })
}
