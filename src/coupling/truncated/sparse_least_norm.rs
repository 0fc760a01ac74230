//! The smallest change that meets many sparse linear conditions.

use super::conditions::{Conditions, dot, norm};
use crate::{model::sparse_factors::SparseFactors, parallel};

/// Steps of the dual Newton method.
const MOST_STEPS: usize = 20;

/// A step that leaves more than this part of the gap, without a floor in the way, shows conditions that contradict each other.
const STALLED: f64 = 0.5;

/// Corrections by the factors after the last step, each of which has to leave less than [`STALLED`] of the gap.
const MOST_CORRECTIONS: usize = 10;

/// Root mean square of changes, relative to what changes, beyond which they are of no use: none is looked for.
const MOST_CHANGE: f64 = 5.0;

/// Iterations of conjugate gradients within a step, without factors that lead them.
const MOST_ITERATIONS: usize = 4000;

/// The same in all steps together, with factors: seams that are met take 30 a step.
const MOST_LED: usize = 3000;

/// The same in one step, where steps with factors of their own come next: these take a tenth of the time of a step that needs more.
const MOST_LED_STEP: usize = 100;

/// Newton steps with factors of their own.
const MOST_DIRECT_STEPS: usize = 60;

/// Most conditions for such steps: each takes seconds beyond.
const MOST_DIRECT: usize = 6000;

/// Residual of the target, relative, below which no second search is needed.
const MET: f64 = 1e-12;

/// Residual of the target after two searches, relative, up to which a longer one is made.
const NEARLY_MET: f64 = 1e-3;

/// Computation of the steps of Newton's method.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Steps {
    /// By conjugate gradients, led by the factors of the equations of all changes.
    Gradients {
        /// Most iterations with factors in all.
        most: usize,
        /// Most such iterations in one step.
        in_step: usize,
    },
    /// By the factors of the equations of the changes off the floor.
    Direct,
}

/// The change that came nearest.
struct Found {
    /// The norm of what it leaves.
    left: f64,
    change: Vec<f64>,
    /// True if changes that meet the conditions are shown to be far too large.
    is_far: bool,
}

/// Iterate of Newton's method for the dual.
struct DualPoint {
    multiplier: Vec<f64>,
    /// The changes before floors.
    z: Vec<f64>,
    /// Residual of the conditions.
    gap: Vec<f64>,
}

impl Conditions {
    /// The floor of a change.
    fn floor_of(&self, k: usize, floor: f64) -> f64 {
        if k < self.free {
            floor
        } else {
            f64::NEG_INFINITY
        }
    }

    pub(super) fn transposed(&self, multiplier: &[f64]) -> Vec<f64> {
        parallel::map(self.changes(), 512, |k| {
            self.column(k).map(|(r, v)| v * multiplier[r]).sum()
        })
    }

    /// Minimises `½ Σ x²` subject to `A x = missing` and `x ≥ floor`.
    ///
    /// As for the weights of a family the dual is smooth, `x = max(floor, Aᵀ λ)`; Newton's method, its steps by conjugate gradients with the normal equations of the changes off
    /// the floor, led by the factors of those of all changes. What these leave is made up for by the factors alone, in `Aᵀ λ` itself.
    /// With many changes at the floor the conditions on the others nearly depend on each other, and such steps end before they are of use: where something is left, the search
    /// begins again with steps that factorise the equations of the changes off the floor, a little added to their diagonal. No change that meets the conditions has less than twice the dual as its square, so a search ends when only changes far too large are left. Where the conditions contradict each other or the floor, the change
    /// that came nearest is returned: the caller looks at what is still missing.
    pub fn least_change(&self, missing: &[f64], floor: f64) -> Vec<f64> {
        // all rows to the same size, or conjugate gradients take ages
        let (scaled, target) = self.scaled(missing);
        let most = MOST_LED.min(self.most_led / self.count.max(1));
        let is_last = floor == f64::NEG_INFINITY || self.count > MOST_DIRECT;
        let long = Steps::Gradients {
            most,
            in_step: most,
        };
        let ways: &[Steps] = match is_last {
            true => &[long],
            false => &[
                Steps::Gradients {
                    most,
                    in_step: MOST_LED_STEP,
                },
                Steps::Direct,
                long,
            ],
        };
        let (mut least, mut change) = (f64::INFINITY, Vec::new());
        for (tried, way) in ways.iter().enumerate() {
            // a gap that both have left open is there to stay; one that is nearly closed may be conditions that follow from each other
            if tried == 2 && least > NEARLY_MET * norm(&target) {
                break;
            }
            let found = scaled.newton(&target, floor, *way);
            if found.left < least {
                (least, change) = (found.left, found.change);
            }
            if least <= MET * norm(&target) || found.is_far {
                break;
            }
        }
        change
    }

    /// The dual of a change, to be made large; `z` is `Aᵀ λ`.
    fn dual(&self, target: &[f64], multiplier: &[f64], z: &[f64], floor: f64) -> f64 {
        let penalty = z.iter().enumerate().map(|(k, &z)| {
            let floor = self.floor_of(k, floor);
            if z >= floor {
                0.5 * z * z
            } else {
                floor * (z - 0.5 * floor)
            }
        });
        dot(multiplier, target) - penalty.sum::<f64>()
    }

    /// Newton's method for the dual, of rows of the norm 1.
    fn newton(&self, target: &[f64], floor: f64, steps: Steps) -> Found {
        let goal = 1e-15 * norm(target);

        let lifted = |z: &[f64]| self.lifted(z, floor);
        let left = |x: &[f64]| self.left(target, x);
        // the dual is below half of the square of any change that meets the conditions
        let most_change = MOST_CHANGE * floor.abs().max(1.0);
        let bound = 0.5 * self.changes() as f64 * most_change * most_change;
        let z = vec![0.0; self.changes()];
        let mut at = DualPoint {
            multiplier: vec![0.0; self.count],
            gap: left(&lifted(&z)),
            z,
        };
        let mut best = (norm(&at.gap), at.z.clone());
        let (most, factors) = match steps {
            Steps::Gradients { .. } => (MOST_STEPS, self.factors(|_| true)),
            Steps::Direct => (MOST_DIRECT_STEPS, None),
        };
        let (mut led, mut is_far, mut is_slow) = (0, false, false);
        for _ in 0..most {
            if best.0 <= goal {
                break;
            }
            let is_free = |k: usize| at.z[k] >= self.floor_of(k, floor);
            let direction = match steps {
                Steps::Gradients { in_step, .. } => {
                    let led_by = factors.as_ref().map(|f| (f, in_step));
                    let (direction, iterations) = self.newton_step(&at.gap, is_free, led_by);
                    if led_by.is_some() {
                        led += iterations;
                        is_slow = iterations >= in_step;
                    }
                    direction
                }
                Steps::Direct => match self.direct_step(&at.gap, norm(target), is_free) {
                    Some(direction) => direction,
                    None => break,
                },
            };
            let rise = dot(&at.gap, &direction);
            if rise <= 0.0 {
                // conjugate gradients found nothing that leaves less
                break;
            }
            let was = norm(&at.gap);
            let Some(next) = self.line_search(target, floor, &at, &direction, rise) else {
                break;
            };
            at = next;
            let reached = norm(&at.gap);
            // at round-off factors gain nothing more
            let is_met = steps == Steps::Direct
                && best.0 <= MET * norm(target)
                && reached > STALLED * best.0;
            if reached < best.0 {
                best = (reached, at.z.clone());
            }
            let is_stalled = floor == f64::NEG_INFINITY && reached > STALLED * was;
            is_far = self.dual(target, &at.multiplier, &at.z, floor) > bound;
            if is_stalled
                || is_far
                || is_met
                || matches!(steps, Steps::Gradients { most, .. } if led > most || is_slow)
            {
                break;
            }
        }
        let (mut reached, mut z) = best;
        if let Some(factors) = &factors {
            (reached, z) = self.refined(factors, target, floor, (reached, z));
        }
        Found {
            left: reached,
            change: lifted(&z),
            is_far,
        }
    }

    /// Corrects changes by the factors of all conditions as long as that gains; what is left, and the changes.
    fn refined(
        &self,
        factors: &SparseFactors,
        target: &[f64],
        floor: f64,
        (mut reached, mut z): (f64, Vec<f64>),
    ) -> (f64, Vec<f64>) {
        for _ in 0..MOST_CORRECTIONS {
            let correction =
                self.transposed(&factors.solved(&self.left(target, &self.lifted(&z, floor))));
            let next: Vec<f64> = z.iter().zip(correction).map(|(z, c)| z + c).collect();
            let remaining = norm(&self.left(target, &self.lifted(&next, floor)));
            if remaining < STALLED * reached {
                (reached, z) = (remaining, next);
            } else {
                break;
            }
        }
        (reached, z)
    }

    /// A change of each number, no lower than its floor.
    fn lifted(&self, z: &[f64], floor: f64) -> Vec<f64> {
        let all = z.iter().enumerate();
        all.map(|(k, z)| z.max(self.floor_of(k, floor))).collect()
    }

    /// Halves the step along a `direction` until the dual rises by a part of what its slope `rise` promises, or the gap falls; none where it never does.
    fn line_search(
        &self,
        target: &[f64],
        floor: f64,
        at: &DualPoint,
        direction: &[f64],
        rise: f64,
    ) -> Option<DualPoint> {
        let (here, was) = (
            self.dual(target, &at.multiplier, &at.z, floor),
            norm(&at.gap),
        );
        let mut step = 1.0;
        while step > 1e-4 {
            let trial: Vec<f64> = at
                .multiplier
                .iter()
                .zip(direction)
                .map(|(m, d)| m + step * d)
                .collect();
            let next = self.transposed(&trial);
            let changed = self.lifted(&next, floor);
            let remaining = self.left(target, &changed);
            // near the end the dual is flat to round-off, the gap is not
            if norm(&remaining) < 0.9 * was
                || self.dual(target, &trial, &next, floor) > here + 1e-4 * step * rise
            {
                return Some(DualPoint {
                    multiplier: trial,
                    z: next,
                    gap: remaining,
                });
            }
            step *= 0.5;
        }
        None
    }

    /// Solves the normal equations of the changes off the floor as far as their residual falls; the factors of those of all changes that `led_by` has make that a matter of few iterations, and it has the most of them. Returns how many it took.
    fn newton_step(
        &self,
        gap: &[f64],
        is_free: impl Fn(usize) -> bool,
        led_by: Option<(&SparseFactors, usize)>,
    ) -> (Vec<f64>, usize) {
        let most = led_by.map_or(MOST_ITERATIONS, |(_, most)| most);
        let lead = |residual: &[f64]| match led_by {
            Some((factors, _)) => factors.solved(residual),
            None => residual.to_vec(),
        };
        let apply = |v: &[f64]| {
            let mut t = self.transposed(v);
            for (k, t) in t.iter_mut().enumerate() {
                if !is_free(k) {
                    *t = 0.0;
                }
            }
            self.sum(&t)
        };
        let mut solution = vec![0.0; gap.len()];
        let mut residual = gap.to_vec();
        let mut direction = lead(&residual);
        let mut size = dot(&residual, &direction);
        // conditions that follow from each other have directions of round-off alone, and the residual grows there once the rest is met
        let mut best = (dot(gap, gap), solution.clone());
        let goal = best.0 * 1e-20;
        let mut iterations = 0;
        for _ in 0..most {
            iterations += 1;
            let along = apply(&direction);
            let curvature = dot(&direction, &along);
            // conditions that contradict each other have directions without any
            if dot(&residual, &residual) <= goal || curvature <= 1e-13 * dot(&direction, &direction)
            {
                break;
            }
            let step = size / curvature;
            for k in 0..solution.len() {
                solution[k] += step * direction[k];
                residual[k] -= step * along[k];
            }
            let left = dot(&residual, &residual);
            if left < best.0 {
                best = (left, solution.clone());
            }
            let led = lead(&residual);
            let next = dot(&residual, &led);
            let ratio = next / size;
            size = next;
            for (d, r) in direction.iter_mut().zip(&led) {
                *d = r + ratio * *d;
            }
        }
        (best.1, iterations)
    }
}

#[cfg(test)]
#[path = "sparse_change_tests.rs"]
mod tests;
