//! Drive of an explicit motion, its state from step to step, and its errors.

use crate::system::{Halfway, SemiDiscrete};

/// Drive of a motion: external forces and prescribed displacements, as functions of time.
///
/// No answer may depend on earlier calls, or a resumed run would differ from one without interruption.
pub trait Drive: Sync {
    /// Overwrites `load` with the external force on every dof \[N\] at `time` \[s\].
    fn load_into(&self, time: f64, load: &mut [f64]);

    /// Returns true if the load is constant in time; it is then evaluated once.
    fn is_steady(&self) -> bool {
        false
    }

    /// The dofs whose displacement is prescribed, ascending.
    fn prescribed(&self) -> &[u32];

    /// Overwrites `values` with the displacements \[m\] of [`Drive::prescribed`] at `time`.
    fn displacement_into(&self, time: f64, values: &mut [f64]);

    /// Overwrites `values` with the velocities \[m/s\] of [`Drive::prescribed`] at `time`; asked for at the start only.
    fn velocity_into(&self, time: f64, values: &mut [f64]);
}

/// No load and nothing prescribed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Undriven;

impl Drive for Undriven {
    fn load_into(&self, _time: f64, load: &mut [f64]) {
        load.fill(0.0);
    }

    fn is_steady(&self) -> bool {
        true
    }

    fn prescribed(&self) -> &[u32] {
        &[]
    }

    fn displacement_into(&self, _time: f64, _values: &mut [f64]) {}

    fn velocity_into(&self, _time: f64, _values: &mut [f64]) {}
}

/// State of a motion without the damage, which the system keeps ([`BodyHistory::damage_state`](crate::system::BodyHistory::damage_state)): both together resume a run bit for bit.
///
/// Shapes: one entry per dof. Units: time \[s\], u \[m\], v \[m/s\], a \[m/s²\], energies \[J\].
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct State {
    /// Time.
    pub time: f64,
    /// Steps taken.
    pub step: u64,
    /// Displacement.
    pub u: Vec<f64>,
    /// Velocity.
    pub v: Vec<f64>,
    /// Acceleration; empty before the first call of [`Explicit::new`](super::Explicit::new).
    pub a: Vec<f64>,
    /// Work done by loads and supports since the start.
    pub work: f64,
    /// Energy at the start plus the work in absolute values: an upper bound of the energy of the motion, for the check against runaway.
    pub supplied: f64,
    /// Bonds broken since the start.
    pub broken: u64,
    /// External force \[N\] on each prescribed dof at the last step, in the order of [`Drive::prescribed`]; empty before the first. A resumed run takes it for half of the work of its next step:
    /// a new evaluation would differ by rounding, or by a drag.
    pub held: Vec<f64>,
}

impl State {
    /// The start of a motion at time zero, with given fields.
    pub fn start(u: Vec<f64>, v: Vec<f64>) -> State {
        State {
            u,
            v,
            ..State::default()
        }
    }

    /// The displacement half a step back, at which bonds that the last force broke are accounted for; velocities are those of the half step.
    pub(super) fn halfway(&self, step: f64) -> Halfway<'_> {
        Halfway {
            u: &self.u,
            v: &self.v,
            back: 0.5 * step,
        }
    }

    /// The start from rest, undeformed.
    pub fn at_rest(dofs: usize) -> State {
        State::start(vec![0.0; dofs], vec![0.0; dofs])
    }
}

/// Parameters of the time integration.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ExplicitParams {
    /// Time step Δt \[s\]; [`crate::solve::stable_step`] finds one and refuses those that are too large.
    pub step: f64,
    /// The run stops once the kinetic energy exceeds this many times the energy supplied.
    pub runaway: f64,
}

impl ExplicitParams {
    /// Steps of a given size.
    pub fn with_step(step: f64) -> ExplicitParams {
        // unsymmetric couplings change the energy of a pulse at the seam by some per cent; an instability exceeds any factor within a few hundred steps
        ExplicitParams {
            step,
            runaway: 100.0,
        }
    }
}

/// Energies after a step `n → n+1` \[J\]; at the start all are those of the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Energies {
    /// `½ vᵀ M v` at `n+1`.
    pub kinetic: f64,
    /// `½ vᵀ M v` at `n+½`.
    pub kinetic_half: f64,
    /// `½ v_{n+½}ᵀ M v_{n+½} + ½ u_nᵀ F(u_{n+1})`: in a linear symmetric system its change since the start is `work_half`.
    pub discrete: f64,
    /// Work of loads and supports up to `n+1`.
    pub work: f64,
    /// Work of loads and supports up to `n+½`.
    pub work_half: f64,
}

/// Summary of a run.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ExplicitInfo {
    /// Steps taken by this call.
    pub steps: u64,
    /// Time reached \[s\].
    pub time: f64,
    /// Bonds broken by this call.
    pub broken: u64,
    /// Reason for its end.
    pub end: End,
}

/// Reason for the end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum End {
    /// The last step was taken.
    Finished,
    /// The observer asked for it.
    Stopped,
}

/// Failure to start or to continue a motion.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExplicitError {
    /// An input has the wrong length.
    #[error("{what} has {found} entries, the model has {expected}: it belongs to another model")]
    Shape {
        /// Name of the input.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length needed.
        expected: usize,
    },
    /// The step is no step.
    #[error(
        "the time step is {step}: it must be positive and finite; leave it out to get the stable one"
    )]
    Step {
        /// Its value \[s\].
        step: f64,
    },
    /// A site without mass.
    #[error(
        "site {site} has the mass {mass}: explicit dynamics needs a positive density of every material"
    )]
    Mass {
        /// The site.
        site: usize,
        /// Its mass \[kg\].
        mass: f64,
    },
    /// A field at the start is not finite.
    #[error("the {what} of site {site} is {value} at the start; check its expression")]
    Start {
        /// Displacement or velocity.
        what: &'static str,
        /// The site.
        site: usize,
        /// Its value.
        value: f64,
    },
    /// A number is no longer finite.
    #[error(
        "the motion is no longer finite at step {step}, t = {time:e} s, site {site}: the load or the prescribed motion there is not a number, or the time step is too large; check the expressions, or take the stable step"
    )]
    NotFinite {
        /// Step at which it was found.
        step: u64,
        /// Time \[s\].
        time: f64,
        /// The first such site.
        site: usize,
    },
    /// The energy grew beyond everything that was put in.
    #[error(
        "the motion ran away at step {step}, t = {time:.4e} s: its kinetic energy {energy:.3e} J is more than {factor} times the {supplied:.3e} J put in, fastest at site {site}; the time step is too large or the coupling unstable: take the stable step, or use coupling.truncated"
    )]
    Runaway {
        /// Step at which it was found.
        step: u64,
        /// Time \[s\].
        time: f64,
        /// The fastest site.
        site: usize,
        /// Kinetic energy \[J\].
        energy: f64,
        /// Energy at the start plus work in absolute values \[J\].
        supplied: f64,
        /// [`ExplicitParams::runaway`].
        factor: f64,
    },
}

/// Checks that state, step, masses and prescribed dofs are those of a motion of this system.
pub(super) fn check(
    system: &dyn SemiDiscrete,
    params: &ExplicitParams,
    state: &State,
    prescribed: &[u32],
) -> Result<(), ExplicitError> {
    let block = system.block().max(1);
    let dofs = system.mass().len() * block;
    if !(params.step > 0.0 && params.step.is_finite()) {
        return Err(ExplicitError::Step { step: params.step });
    }
    if let Some((site, &mass)) = system
        .mass()
        .iter()
        .enumerate()
        .find(|(_, m)| !(**m > 0.0 && m.is_finite()))
    {
        return Err(ExplicitError::Mass { site, mass });
    }
    let shapes = [
        ("the displacement", state.u.len()),
        ("the velocity", state.v.len()),
        (
            "the acceleration",
            state.a.len().max(if state.a.is_empty() { dofs } else { 0 }),
        ),
    ];
    for (what, found) in shapes {
        if found != dofs {
            return Err(ExplicitError::Shape {
                what,
                found,
                expected: dofs,
            });
        }
    }
    for (what, field) in [("displacement", &state.u), ("velocity", &state.v)] {
        if let Some((k, &value)) = field.iter().enumerate().find(|(_, x)| !x.is_finite()) {
            return Err(ExplicitError::Start {
                what,
                site: k / block,
                value,
            });
        }
    }
    match prescribed.iter().find(|&&k| k as usize >= dofs) {
        Some(&k) => Err(ExplicitError::Shape {
            what: "the list of prescribed dofs",
            found: k as usize + 1,
            expected: dofs,
        }),
        None => Ok(()),
    }
}
