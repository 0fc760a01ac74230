//! Observation of each time step: damage at the edge of the zone, the zone, energies and rotations are looked at, and rows, files and checkpoints are written.

use std::ops::ControlFlow;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::RunOptions;
use super::breaks::{Breaks, damage_at_edge};
use super::dynamic_system::{failing_stretch, failure_criterion};
use super::field_output::FieldOutput;
use super::guard::{Balance, Guard};
use super::saved::{EdgeReached, SavedZone, StepChoice};
use super::seen::Seen;
use super::writer::{EnergyRow, Moment, Recorder};
use super::zone_monitor::{ZoneMonitor, fastest_crack};
use crate::observe::ObserveError;
use crate::observe::summary::{Ended, Timings};
use crate::observe::warning::Warning;
use crate::progress::Progress;
use crate::run::error::RunError;
use crate::run::linear_parts::{LinearParts, RunKind};
use crate::run::rotation::Rotations;
use crate::run::setup::RunSettings;
use crate::run::surface_gradient::{Asked, steep_stresses};
use crate::scene::solve::Explicit as Spec;
use crate::scene::spec::EdgeSpec;
use crate::solve::explicit::{Explicit, State};
use crate::{coupling::Operator, model::Model};

/// Interval between reports of progress.
const TOLD_EVERY: Duration = Duration::from_millis(200);

/// Returns true if an instant of a regular sequence lies in the step from `before` to `after`.
fn is_due(before: f64, after: f64, interval: f64) -> bool {
    // an instant that falls on the end of a step belongs to it, whatever rounding says
    let count = |t: f64| (t / interval * (1.0 + 1e-12) + 1e-9).floor();
    count(after) > count(before)
}

/// Reason to leave the run loop early.
pub(super) enum Stop {
    /// Something could not be written.
    Failed(ObserveError),
    /// For this reason.
    Ended(Ended),
    /// The nonlocal zone has to change to these cells.
    Switch(Vec<bool>),
}

/// Data that do not change while steps are taken with one layout of the zones.
pub(super) struct Segment<'a, 'r, const D: usize> {
    pub model: &'a Model<D>,
    pub operator: &'a Operator<'a, D>,
    pub rest: &'r RunSettings<D>,
    pub spec: &'a Spec,
    pub options: &'a RunOptions<'r>,
    pub progress: &'a dyn Progress,
    pub pace: StepChoice,
    pub is_linear: bool,
    pub has_exact_seam: bool,
    /// The stress error of a uniform field at surfaces of points.
    pub uniform: f64,
    pub breaks: Breaks,
}

/// Observations before the first step of a segment.
pub(super) struct Watched {
    pub balance: Balance,
    pub seen: Seen,
    pub edge: Option<EdgeReached>,
    pub zone: Option<SavedZone>,
}

/// Watches and writes the steps of a segment.
pub(super) struct StepObserver<'a, 'r, const D: usize> {
    pub segment: &'a Segment<'a, 'r, D>,
    fields: FieldOutput<'a, D>,
    /// Monitor of a zone that follows the crack.
    monitor: Option<ZoneMonitor<'a, D>>,
    pub guard: Guard<'a, D>,
    pub recorder: Recorder<'r, D>,
    pub edge: Option<EdgeReached>,
    pub zone: Option<SavedZone>,
    /// Warnings of steep stresses, from the first output that shows such.
    pub steep: Vec<Warning>,
    /// Reason for which the steps were left early.
    pub stop: Option<Stop>,
    /// True if a checkpoint was due with the change of the zone: of the state in the next layout.
    pub is_late: bool,
    /// Broken bonds when damage was last looked for at the edge.
    known_broken: u64,
    /// Seconds of looks at the zone.
    looking: f64,
    first: u64,
    clock: Instant,
    told_at: Instant,
}

impl<'a, 'r, const D: usize> StepObserver<'a, 'r, D> {
    /// Before the first step of a segment.
    ///
    /// # Errors
    /// [`RunError::Fracture`] where a zone follows a crack whose critical stretch is unknown.
    pub fn new(
        segment: &'a Segment<'a, 'r, D>,
        watched: Watched,
        recorder: Recorder<'r, D>,
    ) -> Result<Self, RunError> {
        let Segment {
            model, rest, pace, ..
        } = *segment;
        let Watched {
            balance,
            seen,
            edge,
            zone,
        } = watched;
        let failing = failing_stretch(model, rest)?;
        let rotations = Rotations::new(model, rest, failing, segment.options.ranks);
        let how = (RunKind::Explicit, segment.has_exact_seam);
        let ranks = segment.options.ranks;
        let parts = LinearParts::new(model, segment.operator, rest, how, ranks)?;
        let watched = (rotations, parts);
        let guard = Guard::new(watched, balance, segment.spec, pace.steps, seen);
        let monitor = match &rest.follow {
            Some(follow) => {
                let critical = failure_criterion(model, rest)?.filter(|_| model.body().is_some());
                critical.map(|critical| {
                    let critical = critical.single().unwrap_or(f64::INFINITY);
                    let speed = fastest_crack(model, |m| rest.density[m as usize]);
                    ZoneMonitor::new(follow, model, critical, speed, pace.step)
                })
            }
            None => None,
        };
        Ok(Self {
            segment,
            fields: FieldOutput::new(model, segment.operator, rest, segment.options),
            monitor,
            guard,
            recorder,
            edge,
            zone,
            steep: Vec::new(),
            stop: None,
            is_late: false,
            known_broken: u64::MAX,
            looking: 0.0,
            first: 0,
            clock: Instant::now(),
            told_at: Instant::now(),
        })
    }

    /// Writes the first row and file, and a checkpoint that is due before the first step; looks at the zone where that is due.
    ///
    /// # Errors
    /// [`ObserveError`] if they cannot be written.
    pub fn begin(
        &mut self,
        motion: &Explicit<'_>,
        resumed: bool,
        due: bool,
    ) -> Result<(), ObserveError> {
        let moment = Moment::of(motion, self.segment.is_linear);
        if !resumed {
            self.recorder.begin(&moment);
            let energies = self.recorder.energies(&moment);
            self.guard.look_at_energies(&moment, &energies);
            self.write_row(&moment, energies)?;
            self.fields.write(&mut self.recorder, &moment)?;
        }
        if due {
            self.write_checkpoint(&moment)?;
        }
        match resumed.then(|| self.ended_before()).flatten() {
            Some(why) => self.stop = Some(Stop::Ended(why)),
            None => self.look_before_steps(motion),
        }
        Ok(())
    }

    /// Returns the reason for which a resumed run has ended at its checkpoint already, as long as the scene has the same limits.
    fn ended_before(&self) -> Option<Ended> {
        match self.edge.is_some() && self.segment.rest.breaking.at_edge == EdgeSpec::Stop {
            true => Some(Ended::DamageAtEdge),
            false => self.guard.exceeded(),
        }
    }

    /// Looks at the zone where an interrupt left a checkpoint behind in the step in which that was due.
    fn look_before_steps(&mut self, motion: &Explicit<'_>) {
        let (Some(monitor), Some(zone)) = (&self.monitor, &mut self.zone) else {
            return;
        };
        if zone.looked {
            return;
        }
        let state = motion.state();
        let arrived = self.edge.is_none() && damage_at_edge(motion.system()).is_some();
        let [due, whole] = monitor.looks_after(state.step).map(|due| due || arrived);
        if due {
            let left = self.segment.pace.steps - state.step;
            let (now, wanted) = ((state.time, left), &mut zone.wanted);
            let next = monitor.look(&state.u, now, motion.system(), whole, wanted);
            self.stop = next.map(Stop::Switch);
        }
    }

    /// Takes the steps to the end, or to where the segment stops; adds the seconds of the stages to `timings`; the steps taken, and the seconds of all.
    ///
    /// # Errors
    /// [`RunError`] of a step.
    pub fn take_steps(
        &mut self,
        motion: &mut Explicit<'_>,
        timings: &mut Timings,
    ) -> Result<(u64, f64), RunError> {
        let written = self.recorder.seconds;
        let Segment {
            progress,
            options,
            pace,
            ..
        } = *self.segment;
        self.first = motion.state().step;
        progress.stage("steps", Some(pace.steps));
        progress.advance(self.first);
        self.clock = Instant::now();
        self.told_at = Instant::now();
        options.begin_steps();
        if self.stop.is_none() {
            motion.run(pace.steps, &mut |motion| self.observe(motion))?;
        }
        let seconds = self.clock.elapsed().as_secs_f64();
        let writing = self.recorder.seconds - written;
        timings.add("steps", seconds - writing - self.looking);
        timings.add("output", writing);
        if self.monitor.is_some() {
            timings.add("looks at the zone", self.looking);
        }
        Ok((motion.state().step - self.first, seconds))
    }

    /// Watches and writes a step; says whether the next is taken.
    fn observe(&mut self, motion: &mut Explicit<'_>) -> ControlFlow<()> {
        if self.asks_for_all(motion.state().step) {
            motion.gather();
        }
        let arrived = self.find_damage_at_edge(motion);
        if arrived {
            // the run may end here, or look at the zone
            motion.gather();
        }
        let moment = Moment::of(motion, self.segment.is_linear);
        if let Some(impact) = &mut self.recorder.impact {
            impact.watch(moment.state, moment.supports.0);
        }
        let pace = self.segment.pace;
        let step = moment.state.step;
        let last = step == pace.steps;
        let mut next = self.look_at_zone(&moment, arrived, last);
        let (before, after) = (pace.time(step - 1), pace.time(step));
        let row_is_due = last || is_due(before, after, self.segment.spec.history_interval);
        let energies = (row_is_due || self.guard.wants_energies(step))
            .then(|| self.recorder.energies(&moment));
        let ended = self.reason_to_end(&moment, energies.as_ref(), last);
        if let (Some(_), Some(zone)) = (ended, &mut self.zone) {
            // the run that goes on from here looks again
            zone.looked = false;
            next = None;
        }
        let stops = ended.is_some_and(|e| e != Ended::Interrupted);
        let leave = ended.is_some() || (last && self.recorder.keeps_state());
        let due = DueOutput {
            row: row_is_due || stops,
            fields: last || stops || is_due(before, after, self.segment.spec.output_interval),
            must_save: leave,
            changes: next.is_some(),
        };
        if let Err(error) = self.write(&moment, energies, due) {
            self.stop = Some(Stop::Failed(error));
            return ControlFlow::Break(());
        }
        self.tell_progress(moment.state);
        self.stop = match (ended, next) {
            (Some(why), _) => Some(Stop::Ended(why)),
            (None, Some(nonlocal)) => Some(Stop::Switch(nonlocal)),
            (None, None) => return ControlFlow::Continue(()),
        };
        ControlFlow::Break(())
    }

    /// Returns true if something asks for all sites after a step, be it on another process: a row, a file, a checkpoint, a look at energies, rotations or the zone.
    fn asks_for_all(&self, step: u64) -> bool {
        let Segment { spec, pace, .. } = *self.segment;
        let (before, after) = (pace.time(step - 1), pace.time(step));
        let is_due = |interval| is_due(before, after, interval);
        step == pace.steps
            || is_due(spec.history_interval)
            || is_due(spec.output_interval)
            || self.guard.looks_after(step)
            || (self.monitor.as_ref()).is_some_and(|monitor| monitor.looks_after(step)[0])
            || self.recorder.is_checkpoint_step(step)
    }

    /// Looks for damage at the edge of the nonlocal zone where bonds have broken, or may be damaged; says whether it has just come there.
    fn find_damage_at_edge(&mut self, motion: &mut Explicit<'_>) -> bool {
        let (step, time, broken) = {
            let state = motion.state();
            (state.step, state.time, state.broken)
        };
        let changes = match self.segment.breaks {
            Breaks::Possibly => broken != self.known_broken,
            // damage grows before a bond is damaged through
            Breaks::Gradually => true,
            Breaks::Never | Breaks::Dissipating => false,
        };
        if !changes || self.edge.is_some() {
            return false;
        }
        self.known_broken = broken;
        motion.learn_breaks_at_edge();
        self.edge = damage_at_edge(motion.system()).map(|site| EdgeReached {
            step,
            time,
            site: site as u64,
        });
        self.edge.is_some()
    }

    /// Looks at a zone that follows the crack, where that is due; the cells that it has to change to.
    fn look_at_zone(
        &mut self,
        moment: &Moment<'_>,
        arrived: bool,
        last: bool,
    ) -> Option<Vec<bool>> {
        let (Some(monitor), Some(zone)) = (&self.monitor, &mut self.zone) else {
            return None;
        };
        let state = moment.state;
        let mut next = None;
        // damage that has come to the edge between two looks is looked at too
        let [due, whole] = monitor.looks_after(state.step).map(|due| due || arrived);
        zone.looked = !last && due;
        if zone.looked {
            let begun = Instant::now();
            let left = self.segment.pace.steps - state.step;
            let (now, wanted) = ((state.time, left), &mut zone.wanted);
            next = monitor.look(&state.u, now, moment.system, whole, wanted);
            self.looking += begun.elapsed().as_secs_f64();
        }
        if next.is_some() {
            self.edge = None;
        }
        next
    }

    /// Returns the reason, if any, to end the run with this step: damage at the edge, an energy or a rotation beyond its limit, an interrupt.
    fn reason_to_end(
        &mut self,
        moment: &Moment<'_>,
        energies: Option<&EnergyRow>,
        last: bool,
    ) -> Option<Ended> {
        let Segment { rest, options, .. } = *self.segment;
        let gained = energies.and_then(|e| self.guard.look_at_energies(moment, e));
        let limit = self.guard.look_at_strains(moment, last).or(gained);
        if self.edge.is_some() && rest.breaking.at_edge == EdgeSpec::Stop {
            Some(Ended::DamageAtEdge)
        } else if limit.is_some() {
            limit
        } else if options.interrupt.is_some_and(|i| i.load(Ordering::Relaxed)) && !last {
            Some(Ended::Interrupted)
        } else {
            None
        }
    }

    /// Writes the output that is due after a step: a row of the history, the fields, a checkpoint.
    fn write(
        &mut self,
        moment: &Moment<'_>,
        energies: Option<EnergyRow>,
        due: DueOutput,
    ) -> Result<(), ObserveError> {
        if due.row {
            let energies = energies.unwrap_or_else(|| self.recorder.energies(moment));
            self.write_row(moment, energies)?;
        }
        if due.fields {
            self.fields.write(&mut self.recorder, moment)?;
            self.look_for_steep_stresses(moment.state);
        }
        if due.must_save || self.recorder.is_checkpoint_due(moment.state.step) {
            if due.changes {
                self.is_late = true;
            } else {
                self.write_checkpoint(moment)?;
            }
        }
        Ok(())
    }

    /// Looks for stresses that families do not resolve, in a body that stays whole and does not expand.
    fn look_for_steep_stresses(&mut self, state: &State) {
        let Segment {
            model,
            rest,
            uniform,
            ..
        } = *self.segment;
        let is_whole = self.segment.breaks == Breaks::Never;
        if is_whole && rest.stresses.thermal.is_none() && self.steep.is_empty() {
            let asked = Asked {
                stresses: &rest.stresses,
                displacement: &state.u,
                uniform,
            };
            self.steep = steep_stresses(model, self.segment.options.ranks, &asked);
        }
    }

    /// Writes a row of the history and of the tables of tips.
    fn write_row(&mut self, moment: &Moment<'_>, energies: EnergyRow) -> Result<(), ObserveError> {
        let sites = &self.segment.model.sites;
        let probed = self.fields.probed(moment);
        self.recorder
            .row(moment, energies, &probed, |site| sites[site].position)
    }

    /// Writes all that the run needs to go on from here.
    fn write_checkpoint(&mut self, moment: &Moment<'_>) -> Result<(), ObserveError> {
        let (pace, zone) = (self.segment.pace, self.zone.clone());
        self.recorder.checkpoint(
            moment.state,
            moment.system,
            pace,
            self.edge,
            zone,
            &self.guard.seen,
        )
    }

    /// Reports the progress of the run, a few times a second.
    fn tell_progress(&mut self, state: &State) {
        let Segment {
            progress, breaks, ..
        } = *self.segment;
        progress.advance(1);
        if self.told_at.elapsed() < TOLD_EVERY {
            return;
        }
        self.told_at = Instant::now();
        let speed = (state.step - self.first) as f64 / self.clock.elapsed().as_secs_f64();
        let energy = self.recorder.last.kinetic + self.recorder.last.stored;
        let broken = match breaks {
            Breaks::Possibly | Breaks::Gradually => format!(", {} bonds broken", state.broken),
            Breaks::Never | Breaks::Dissipating => String::new(),
        };
        progress.tell(&format!(
            "step {}, t = {:.3e}, energy {energy:.3e}{broken}, {speed:.0} steps/s",
            state.step, state.time
        ));
    }
}

/// Output that is due after a step.
struct DueOutput {
    /// A row of the history.
    row: bool,
    /// The fields.
    fields: bool,
    /// A checkpoint, for the run ends here.
    must_save: bool,
    /// True if the zone changes: a checkpoint is then one of the next layout.
    changes: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instants_are_met_once_each_whatever_rounding_says() {
        let due =
            |n: u64, dt: f64, interval: f64| is_due((n - 1) as f64 * dt, n as f64 * dt, interval);
        for (steps, duration) in [(253u64, 60.0), (1000, 0.1), (7, 7.0), (30_000, 3e-5)] {
            let dt = duration / steps as f64;
            for count in [1u64, 3, 7] {
                let interval = duration / count as f64;
                let due: Vec<u64> = (1..=steps).filter(|&n| due(n, dt, interval)).collect();
                assert_eq!(
                    due.len() as u64,
                    count,
                    "{steps} steps, {count} instants: {due:?}"
                );
                assert_eq!(due.last(), Some(&steps));
                for (k, &n) in due.iter().enumerate() {
                    // the first step that ends at the instant or after it
                    let late = n as f64 * dt - (k + 1) as f64 * interval;
                    assert!(
                        late > -1e-9 * duration && late < dt * (1.0 - 1e-9),
                        "{late}"
                    );
                }
            }
        }
        // more instants than steps: every step
        assert_eq!((1..=5).filter(|&n| due(n, 1.0, 0.1)).count(), 5);
    }
}
