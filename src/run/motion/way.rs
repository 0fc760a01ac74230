//! Displacement (way) by a velocity that is given as a function of time.

use std::sync::{Mutex, PoisonError};

use crate::scene::expression::Expression;

/// The integral of a prescribed velocity that depends on time alone, step by step by Simpson's rule, as far as it has been asked for.
pub(super) struct Way {
    velocity: Expression,
    step: f64,
    /// Two beyond the last step: nothing moves on from there.
    steps: u64,
    known: Mutex<Known>,
}

/// Known part of a way: the sum after so many steps, and after every [`MARK`]-th step before.
struct Known {
    after: u64,
    sum: f64,
    marks: Vec<f64>,
}

/// Steps between sums that are kept: a run of any length keeps few of them, and none is far from the next.
const MARK: u64 = 1024;

impl Way {
    /// Of a velocity in t, over `steps` steps of `step`.
    pub(super) fn of(velocity: Expression, step: f64, steps: u64) -> Self {
        Self {
            velocity,
            step,
            steps: steps.saturating_add(2),
            known: Mutex::new(Known {
                after: 0,
                sum: 0.0,
                marks: vec![0.0],
            }),
        }
    }

    /// The way from time zero to `time`.
    pub(super) fn at(&self, time: f64) -> f64 {
        let index = (time / self.step + 1e-6).floor().max(0.0);
        let known = self.after(index as u64);
        // steps that have changed their size in between do not end where those of the way do
        let rest = time - index * self.step;
        if rest > 1e-5 * self.step {
            known + self.simpson(index * self.step, rest)
        } else {
            known
        }
    }

    /// The way after `step` steps: the same sum in the same order whatever was asked for before.
    fn after(&self, step: u64) -> f64 {
        let step = step.min(self.steps);
        // sums are whole whoever panicked while holding them
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if step < known.after {
            let mark = (step / MARK) as usize;
            (known.after, known.sum) = (mark as u64 * MARK, known.marks[mark]);
        }
        while known.after < step {
            known.sum += self.simpson(known.after as f64 * self.step, self.step);
            known.after += 1;
            if known.after == known.marks.len() as u64 * MARK {
                let sum = known.sum;
                known.marks.push(sum);
            }
        }
        known.sum
    }

    /// The integral of the velocity over `step` from `t` on, by Simpson's rule.
    fn simpson(&self, t: f64, step: f64) -> f64 {
        let v = |t: f64| self.velocity.eval_at(&[0.0; 3], t);
        step / 6.0 * (v(t) + 4.0 * v(t + 0.5 * step) + v(t + step))
    }
}
