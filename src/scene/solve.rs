//! Analysis of a validated scene: static, in time or in load steps.

use toml::Spanned;

use super::bounds_checks;
use super::error::SceneError;
use super::expression::Expression;
use super::spec::{
    BeyondLimitSpec, ExplicitSpec, LoadStepSpec, QuasiStaticSpec, SolveSpec, WhenPartedSpec,
};
use super::value::{Count, Every, INTERVALS, Number, StepTimes};
use crate::observe::checkpoint::Pace;
use crate::solve::sub_cycling;

/// Type of analysis of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Solve {
    /// One state of equilibrium.
    #[default]
    Static,
    /// Motion in time.
    Explicit(Explicit),
    /// States of equilibrium under a load that grows.
    QuasiStatic(QuasiStatic),
}

/// Motion in time.
#[derive(Clone, Debug, PartialEq)]
pub struct Explicit {
    /// Time at the end.
    pub duration: f64,
    /// The time step asked for; none for the stable one.
    pub step: Option<f64>,
    /// The fraction of the stable step that is taken.
    pub fraction: f64,
    /// Treatment of a step beyond the stable one.
    pub beyond_limit: BeyondLimitSpec,
    /// Steps that the stiffest sites take in each step of all others, if not one.
    pub sub_steps: Option<u32>,
    /// Energy gained without work, as a part of the largest energy, at which the run stops.
    pub largest_energy_gain: f64,
    /// Rotation of an element in degrees at which the run stops.
    pub largest_rotation: Option<f64>,
    /// Time between VTU files.
    pub output_interval: f64,
    /// Time between rows of the history.
    pub history_interval: f64,
    /// Interval at which a checkpoint is written.
    pub checkpoint_every: Option<Pace>,
}

/// States of equilibrium under a load that grows.
#[derive(Clone, Debug, PartialEq)]
pub struct QuasiStatic {
    /// Number of load steps; of adaptive ones that of the intervals by which prescribed velocities are integrated.
    pub steps: usize,
    /// Accuracy of the load at which something fails, where steps are adaptive.
    pub accuracy: Option<f64>,
    /// The time of each; empty where they are of equal length.
    pub times: Vec<f64>,
    /// Value of t at the last step.
    pub duration: f64,
    /// Solution method of each step.
    pub method: LoadStepSpec,
    /// Relative out-of-balance force of a solved step.
    pub tolerance: f64,
    /// Most iterations of a step.
    pub max_iterations: usize,
    /// Rotation of an element in degrees at which the run stops.
    pub largest_rotation: Option<f64>,
    /// Treatment of a body that has parted.
    pub when_parted: WhenPartedSpec,
    /// Load steps between VTU files; of adaptive ones the part of the duration.
    pub output_every: usize,
    /// Interval at which a checkpoint is written.
    pub checkpoint_every: Option<Pace>,
}

/// Meaning of `t` in a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Pacing {
    /// Nothing.
    Still,
    /// Nothing: the same through several stages, each of which has a time of its own.
    Lasting,
    /// The load.
    Loading,
    /// Time.
    Moving,
}

/// Meaning of `t`, and instants at which conditions are tested before a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Clock {
    pub pacing: Pacing,
    instants: [f64; 9],
}

impl Clock {
    /// Time at the end; zero where nothing moves.
    pub fn end(&self) -> f64 {
        self.instants.last().copied().unwrap_or(0.0)
    }

    /// Instants at which a condition is tested: the first if it does not change.
    pub fn instants(&self, moving: bool) -> &[f64] {
        if moving { &self.instants } else { &[0.0] }
    }

    /// Refuses `t` where nothing moves.
    pub fn admits(&self, place: &str, expression: &Expression) -> Result<(), SceneError> {
        let is_still = matches!(self.pacing, Pacing::Still | Pacing::Lasting);
        if !is_still || !expression.depends_on_time() {
            return Ok(());
        }
        if self.pacing == Pacing::Lasting {
            return Err(SceneError::conflict(format!(
                "`{place}` depends on the time t in a scene of several stages"
            ))
            .label(expression.span.clone(), "each stage has a time of its own")
            .help("use x, y, z only: a temperature lasts through all stages"));
        }
        Err(SceneError::conflict(format!("`{place}` depends on the time t in a static scene"))
            .label(expression.span.clone(), "t means nothing here")
            .help("add [solve.explicit] with duration = ..., or [solve.quasi-static] with steps = ...; or use x, y, z only"))
    }
}

impl QuasiStatic {
    /// The time of a load step, that of the state before the first being zero.
    pub fn time_of(&self, step: u64) -> f64 {
        match step.checked_sub(1).and_then(|k| self.times.get(k as usize)) {
            Some(time) => *time,
            None => step as f64 * (self.duration / self.steps as f64),
        }
    }

    /// The time of the last load step.
    pub fn end(&self) -> f64 {
        match self.accuracy {
            None => self.time_of(self.steps as u64),
            Some(_) => self.duration,
        }
    }
}

impl Clock {
    /// The clock of what lasts through several stages.
    pub(crate) fn lasting() -> Self {
        Self {
            pacing: Pacing::Lasting,
            instants: [0.0; 9],
        }
    }
}

impl Solve {
    /// The motion, if it is one.
    pub fn motion(&self) -> Option<&Explicit> {
        match self {
            Self::Explicit(motion) => Some(motion),
            Self::Static | Self::QuasiStatic(_) => None,
        }
    }

    /// Returns the meaning of `t`.
    pub(crate) fn clock(&self) -> Clock {
        let (pacing, end) = match self {
            Self::Static => (Pacing::Still, 0.0),
            Self::Explicit(e) => (Pacing::Moving, e.duration),
            Self::QuasiStatic(q) => (Pacing::Loading, q.duration),
        };
        Clock {
            pacing,
            // both ends, and between them nothing that falls on a period
            instants: [0.0, 0.013, 0.097, 0.23, 0.41, 0.59, 0.73, 0.91, 1.0].map(|s| s * end),
        }
    }
}

/// Refuses `t` in a field that does not change.
pub(crate) fn still(place: &str, expression: &Expression) -> Result<(), SceneError> {
    if !expression.depends_on_time() {
        return Ok(());
    }
    Err(
        SceneError::conflict(format!("`{place}` depends on the time t"))
            .label(expression.span.clone(), "does not change with time")
            .help("use x, y, z only; t belongs into conditions"),
    )
}

/// Reads the analysis of a scene of one stage.
///
/// `has_large_strains` tells of materials for strains of any size: they stiffen as they are compressed, and the stable step is that of the undeformed body.
pub(crate) fn solve(
    spec: Option<&Spanned<SolveSpec>>,
    has_large_strains: bool,
) -> Result<Solve, SceneError> {
    Ok(match spec.map(Spanned::get_ref) {
        None | Some(SolveSpec::Static(_) | SolveSpec::Stages(_)) => Solve::Static,
        Some(SolveSpec::Explicit(e)) => {
            Solve::Explicit(explicit("solve.explicit", e, has_large_strains)?)
        }
        Some(SolveSpec::QuasiStatic(q)) => {
            Solve::QuasiStatic(quasi_static("solve.quasi-static", q)?)
        }
    })
}

fn pace(every: Option<&Every>) -> Option<Pace> {
    every.map(|e| e.pace)
}

/// The time between files.
fn output_interval(at: &str, spec: &ExplicitSpec, duration: f64) -> Result<f64, SceneError> {
    let output_interval = match (&spec.outputs, &spec.output_interval) {
        (Some(count), Some(interval)) => {
            return Err(SceneError::conflict(format!(
                "`{at}` has both `outputs` and `output-interval`"
            ))
            .label(count.span.clone(), "a number of files")
            .label(interval.span.clone(), "a time between files")
            .help("keep one of them"));
        }
        (Some(count), None) => duration / count.value.max(1) as f64,
        (None, given) => interval(
            &format!("{at}.output-interval"),
            given,
            duration,
            duration / 20.0,
        )?,
    };
    if duration / output_interval > MOST_FILES {
        return Err(SceneError::wrong_value(format!(
            "`{at}` asks for {:.1e} VTU files",
            duration / output_interval
        ))
        .label(spec.duration.span.clone(), "over this time")
        .help(format!(
            "the limit is {MOST_FILES:.0e}; the history has a row for each of many more instants"
        )));
    }
    Ok(output_interval)
}

/// A time between rows or files; the default where the scene leaves it out.
fn interval(
    place: &str,
    number: &Option<Number>,
    duration: f64,
    default: f64,
) -> Result<f64, SceneError> {
    match number {
        None => Ok(default),
        Some(n) => bounds_checks::within(
            place,
            n,
            n.value > 0.0 && n.value <= duration,
            "must be positive and at most the duration",
            "make it a fraction of the duration",
        ),
    }
}

/// A motion that is typed `at` a place: its steps, and how often it is written and watched.
pub(super) fn explicit(
    at: &str,
    spec: &ExplicitSpec,
    has_large_strains: bool,
) -> Result<Explicit, SceneError> {
    let place = |key: &str| format!("{at}.{key}");
    let duration = bounds_checks::positive(&place("duration"), &spec.duration)?;
    let step = match spec.step.value {
        Some(value) if !(value > 0.0 && value <= duration) => {
            return Err(
                SceneError::wrong_value(format!("`{}` is {value}", place("step")))
                    .label(
                        spec.step.span.clone(),
                        format!("must be positive and at most the duration {duration}"),
                    )
                    .help("use step = \"auto\" for a fraction of the stable step"),
            );
        }
        step => step,
    };
    let fraction = match &spec.step_fraction {
        Some(f) => bounds_checks::within(
            &place("step-fraction"),
            f,
            f.value > 0.0 && f.value <= 1.0,
            "must be positive and at most 1",
            "0.95 suits most scenes; beyond 1 no step is stable",
        )?,
        None if has_large_strains => 0.5,
        None => 0.95,
    };
    let output_interval = output_interval(at, spec, duration)?;
    Ok(Explicit {
        duration,
        step,
        fraction,
        beyond_limit: spec.beyond_limit,
        sub_steps: sub_steps(&place("sub-steps"), spec.sub_steps.as_ref())?,
        largest_energy_gain: match &spec.largest_energy_gain {
            Some(gain) => bounds_checks::positive(&place("largest-energy-gain"), gain)?,
            None => LARGEST_ENERGY_GAIN,
        },
        largest_rotation: rotation(&place("largest-rotation"), spec.largest_rotation.as_ref())?,
        output_interval,
        history_interval: interval(
            &place("history-interval"),
            &spec.history_interval,
            duration,
            duration / 1000.0,
        )?,
        checkpoint_every: pace(spec.checkpoint_every.as_ref()),
    })
}

/// Energy gained without work, as a part of the largest energy so far, at which a run stops.
const LARGEST_ENERGY_GAIN: f64 = 0.1;

fn rotation(place: &str, degrees: Option<&Number>) -> Result<Option<f64>, SceneError> {
    let Some(degrees) = degrees else {
        return Ok(None);
    };
    let value = bounds_checks::within(
        place,
        degrees,
        degrees.value > 0.0 && degrees.value <= 180.0,
        "must be more than 0 and at most 180 degrees",
        "elements are linear: at 5 degrees lengths are off by 0.4 %, at 10 degrees by 1.5 %",
    )?;
    Ok(Some(value))
}

fn sub_steps(place: &str, count: Option<&Count>) -> Result<Option<u32>, SceneError> {
    let Some(count) = count else { return Ok(None) };
    match u32::try_from(count.value) {
        Ok(1) => Ok(None),
        Ok(n) if (2..=sub_cycling::MOST).contains(&n) => Ok(Some(n)),
        _ => Err(SceneError::wrong_value(format!("`{place}` is {}", count.value))
            .label(
                count.span.clone(),
                format!("must be from 1 to {}", sub_cycling::MOST),
            )
            .help("2 or 3 suit a seam or a few small cells; where larger ratios are needed, even out the mesh")),
    }
}

/// The most VTU files of a run: beyond it a typing error is likelier than a wish.
const MOST_FILES: f64 = 1e5;

/// The times of load steps that are listed.
fn listed(place: &str, spec: &QuasiStaticSpec, times: &[f64]) -> Result<Vec<f64>, SceneError> {
    let refuse = |what: String, label: &str, help: &str| {
        Err(SceneError::wrong_value(format!("`{place}.steps` {what}"))
            .label(spec.steps.span.clone(), label)
            .help(help))
    };
    let order = "list the times of the load steps, larger than 0 and increasing: [0.5, 0.8, 1]; the state at t = 0 comes before them";
    if times.is_empty() {
        return refuse("is empty".to_owned(), "nothing is computed", order);
    }
    let mut before = 0.0;
    for time in times {
        if *time <= before {
            return refuse(
                format!("lists {time} after {before}"),
                "not increasing",
                order,
            );
        }
        before = *time;
    }
    if spec.duration.is_some() {
        return refuse(
            "lists times beside `duration`".to_owned(),
            "the last time is the duration",
            "leave `duration` out",
        );
    }
    Ok(times.to_vec())
}

/// Accuracy of the load of adaptive steps.
const ACCURACY: f64 = 0.01;

/// The accuracy of the load of adaptive steps; none of others.
fn accuracy(place: &str, spec: &QuasiStaticSpec) -> Result<Option<f64>, SceneError> {
    let is_auto = spec.steps.choice == StepTimes::Auto;
    match &spec.accuracy {
        None => Ok(is_auto.then_some(ACCURACY)),
        Some(a) if is_auto => bounds_checks::within(
            place,
            a,
            (1e-5..=0.2).contains(&a.value),
            "must lie between 1e-5 and 0.2",
            "0.01 finds the load at which bonds break to 1 %",
        )
        .map(Some),
        Some(a) => Err(SceneError::conflict(format!(
            "`{place}` is set and the load steps are given"
        ))
        .label(a.span.clone(), "of steps that are found on the way")
        .help("use steps = \"auto\", or leave accuracy out")),
    }
}

/// Load steps that are typed `at` a place.
pub(super) fn quasi_static(at: &str, spec: &QuasiStaticSpec) -> Result<QuasiStatic, SceneError> {
    let place = |key: &str| format!("{at}.{key}");
    let count = |key: &str, number: &Count| {
        if number.value > 0 {
            return Ok(number.value);
        }
        Err(SceneError::wrong_value(format!("`{}` is 0", place(key)))
            .label(number.span.clone(), "nothing is computed")
            .help("ask for at least 1"))
    };
    let (steps, times) = match &spec.steps.choice {
        StepTimes::Equal(number) => {
            let number = Count {
                value: *number,
                span: spec.steps.span.clone(),
            };
            (count("steps", &number)?, Vec::new())
        }
        StepTimes::Listed(times) => {
            let listed = listed(at, spec, times)?;
            (listed.len(), listed)
        }
        StepTimes::Auto => (INTERVALS, Vec::new()),
    };
    let accuracy = accuracy(&place("accuracy"), spec)?;
    let duration = match &spec.duration {
        Some(d) => bounds_checks::positive(&place("duration"), d)?,
        None => times.last().copied().unwrap_or(1.0),
    };
    let tolerance = match &spec.tolerance {
        Some(t) => bounds_checks::within(
            &place("tolerance"),
            t,
            t.value > 0.0 && t.value < 1.0,
            "must lie between 0 and 1",
            "1e-8 suits most scenes",
        )?,
        None => 1e-8,
    };
    let max_iterations = match &spec.max_iterations {
        Some(n) => count("max-iterations", n)?,
        None => 50_000,
    };
    Ok(QuasiStatic {
        steps,
        accuracy,
        times,
        duration,
        method: spec.method,
        tolerance,
        max_iterations,
        largest_rotation: rotation(&place("largest-rotation"), spec.largest_rotation.as_ref())?,
        when_parted: spec.when_parted,
        output_every: match &spec.outputs {
            Some(n) => steps.div_ceil(n.value.max(1)),
            None => 1,
        },
        checkpoint_every: pace(spec.checkpoint_every.as_ref()),
    })
}
