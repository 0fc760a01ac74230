//! Times of load steps: listed, or found on the way.

use super::LoadState;

/// Factor by which a load step is shortened in which the body fails.
const CUT: f64 = 0.25;

/// Factor by which the next one is longer where it does not.
const GROWTH: f64 = 1.5;

/// Part of the whole load up to which a load counts as small: steps are no shorter than the accuracy of this.
const SMALL: f64 = 0.1;

/// Times of load steps.
#[derive(Clone, Copy)]
pub enum Pacing<'a> {
    /// Each by its number; none beyond the last.
    Listed(&'a dyn Fn(u64) -> Option<f64>),
    /// As long as nothing fails in them, as short as the accuracy of the load where something does.
    Adaptive(Adaptive),
}

/// Load steps that are shortened where the body fails.
#[derive(Clone, Copy, Debug)]
pub struct Adaptive {
    /// Time of the last step.
    pub end: f64,
    /// Length of a step in which the body fails over its time, at most: the accuracy of the load at which it does.
    pub accuracy: f64,
}

/// Limits of what fails in a load step.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    /// Part of the stored energy that may be spent. No bond may break.
    pub most_spent: f64,
    /// True if the step is taken again, shorter, where more fails.
    pub may_give_up: bool,
}

/// A load step to come.
pub(super) struct Next {
    pub time: f64,
    /// Limits of what fails in it; none where it is listed.
    pub limits: Option<Limits>,
}

impl Pacing<'_> {
    /// The step after a state; none after the last.
    pub(super) fn next(&self, state: &LoadState) -> Option<Next> {
        match self {
            Self::Listed(times) => times(state.step).map(|time| Next { time, limits: None }),
            Self::Adaptive(_) if state.step == 0 => Some(Next {
                time: 0.0,
                limits: None,
            }),
            Self::Adaptive(own) => (state.time < own.end).then(|| own.after(state)),
        }
    }

    /// Shortens the step from a state to `time`.
    pub(super) fn cut(&self, state: &mut LoadState, time: f64) {
        if let Self::Adaptive(own) = self {
            state.stride = (CUT * (time - state.time)).max(own.least(state.time));
        }
    }

    /// Lengthens the step after one from the time `before` to that of a state; where the body failed in it the next is as short as the accuracy.
    pub(super) fn go_on(&self, state: &mut LoadState, before: f64, fails: bool) {
        if let Self::Adaptive(own) = self
            && state.time > before
        {
            state.stride = match fails {
                true => own.least(state.time),
                false => (GROWTH * (state.time - before)).max(own.least(state.time)),
            };
        }
    }
}

impl Adaptive {
    /// Length of the shortest step from a time.
    fn least(&self, time: f64) -> f64 {
        self.accuracy * time.max(SMALL * self.end)
    }

    fn after(&self, state: &LoadState) -> Next {
        let first = SMALL * self.end;
        let stride = if state.stride > 0.0 {
            state.stride
        } else {
            first
        };
        let stride = stride.min(first);
        // no sliver at the end
        let time = match state.time + (1.0 + 1e-6) * stride < self.end {
            true => state.time + stride,
            false => self.end,
        };
        let is_shortest = time - state.time <= (1.0 + 1e-9) * self.least(state.time);
        Next {
            time,
            limits: Some(Limits {
                most_spent: self.accuracy,
                may_give_up: !is_shortest,
            }),
        }
    }
}
