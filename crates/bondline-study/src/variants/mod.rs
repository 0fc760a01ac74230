//! Other versions of a scene, and the differences of their outputs: `accuracy` and `bondline trade` choose among them.
//!
//! | file | what |
//! |---|---|
//! | `parameters.rs` | the knobs of a scene, and the overrides of their settings |
//! | `generated.rs` | generated meshes as knobs see them |
//! | `measure.rs` | differences between the outputs of a run and those of the reference |

mod generated;
mod measure;
mod parameters;

pub use measure::{Quantity, distance_from_path};
pub use parameters::{KNOBS, Knob, Setting, typed};

pub(crate) use generated::{corners, cutouts};
pub(crate) use measure::Measured;
pub(crate) use parameters::{Base, Change, coordinates};

use bondline::scene::SceneSpec;
use bondline::scene::spec::SolveSpec;

/// Keys that make a run comparable: samples where a scene asks for none, and as few pictures as may be, which cost more than a motion.
pub(crate) fn measured_keys(spec: &SceneSpec) -> Vec<String> {
    let mut keys = Vec::new();
    match spec.analysis() {
        None | Some(SolveSpec::Static(_) | SolveSpec::Stages(_)) => {
            if spec.output.lines.is_empty() && spec.output.probes.is_empty() {
                keys.extend(lines(spec));
            }
        }
        Some(SolveSpec::Explicit(e)) => {
            if e.output_interval.is_none() {
                keys.push(format!("{}.explicit.outputs=1", spec.analysis_key()));
            }
        }
        Some(SolveSpec::QuasiStatic(_)) => keys.push("solve.quasi-static.outputs=1".to_owned()),
    }
    keys
}

/// Keys of a run that is compared and leaves no pictures.
pub(crate) fn quiet(spec: &SceneSpec) -> Vec<String> {
    let mut keys = measured_keys(spec);
    keys.push("output.vtu=false".to_owned());
    keys
}

/// Lines of samples through a generated mesh, for a scene that asks for none: at a third and two thirds of each width.
fn lines(spec: &SceneSpec) -> Vec<String> {
    let Some((min, max)) = corners(spec) else {
        return Vec::new();
    };
    let d = min.len();
    let mut list = Vec::new();
    for axis in 0..d {
        for (k, share) in [0.31, 0.64].iter().enumerate() {
            let (mut from, mut to) = (min.clone(), max.clone());
            for a in (0..d).filter(|a| *a != axis) {
                from[a] = min[a] + share * (max[a] - min[a]);
                to[a] = from[a];
            }
            list.push(format!(
                "output.lines.trade-{axis}-{k}={{from={},to={},samples=101}}",
                coordinates(&from),
                coordinates(&to)
            ));
            if d == 1 {
                break;
            }
        }
    }
    list
}
