//! Growth of cracks from one row of the history to the next, which for load steps is growth within one of them.

use serde::{Deserialize, Serialize};

use crate::observe::report::number;
use crate::observe::warning::{Code, Warning};
use crate::solve::explicit::State;

/// The largest growth of cracks between two rows so far.
///
/// Areas are those of the summary: m² (m in 2D, a number in 1D).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CrackGrowth {
    /// Largest area of the cracks at a row.
    area: f64,
    /// Largest growth in one step.
    largest: f64,
    /// That step.
    step: u64,
    /// Its time.
    time: f64,
}

/// Part of the whole growth that one load step takes, from which on the crack counts as having run through in it. The template `load-steps` takes
/// 0.29 in the largest of its steps, plates with edge cracks that snap 0.95 to 1.
const SHARE: f64 = 0.5;

/// Energy set free by breaking, over the energy that breaking dissipates, from which on a crack counts as having run by itself in several steps.
const SET_FREE: f64 = 0.5;

/// Horizons of growth below which nothing is warned of: bonds break in steps of a spacing.
const HORIZONS: f64 = 5.0;

impl CrackGrowth {
    /// Takes the area of a row.
    pub fn watch(&mut self, state: &State, area: f64) {
        let growth = area - self.area;
        if growth > self.largest {
            (self.largest, self.step, self.time) = (growth, state.step, state.time);
        }
        // two cracks that meet may count less than they did apart
        self.area = self.area.max(area);
    }

    /// Returns the warning of load steps of which one took most of the crack, or in which breaking set much energy free; energies \[J\] (per metre of thickness in 2D).
    ///
    /// If one step took most, energies are no criterion: bonds beside the path take the energy that would be set free. A bar breaks at once.
    pub fn warning<const D: usize>(
        &self,
        horizon: f64,
        [free, dissipated]: [f64; 2],
    ) -> Option<Warning> {
        let told = (HORIZONS * horizon).powi(D as i32 - 1);
        let in_one = D > 1 && self.largest > told && self.largest > SHARE * self.area;
        if !in_one {
            let has_run = self.area > 0.0 && self.area >= told;
            return (has_run && free > SET_FREE * dissipated).then(|| {
                Warning::new(Code::CrackRan, format!(
                    "breaking set free {:.0} % of what it dissipated: the crack ran on within load steps, where bonds beside its path break too; its energy is then too large, and [solve.explicit] follows it",
                    100.0 * free / dissipated
                ))
            });
        }
        Some(Warning::new(
            Code::CrackRan,
            format!(
                "load step {}, t = {}, alone took {:.0} % of the crack: it ran on within the step, where bonds beside its path break too, so that its energy comes out too large, and the states in between are left out; smaller load steps tell whether the crack grows with the load, and [solve.explicit] follows one that runs by itself",
                self.step,
                number(self.time),
                100.0 * self.largest / self.area,
            ),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cracks of these lengths after each load step, and energies set free and dissipated.
    fn warned(lengths: &[f64], energies: [f64; 2]) -> Option<String> {
        let mut growth = CrackGrowth::default();
        for (step, length) in (1..).zip(lengths) {
            let state = State {
                step,
                time: 0.1 * step as f64,
                ..State::at_rest(0)
            };
            growth.watch(&state, *length);
        }
        growth.warning::<2>(3.0, energies).map(|told| told.message)
    }

    #[test]
    fn a_crack_that_runs_within_a_step_is_told_and_one_that_grows_is_not() {
        let stable = [0.0, 4.0, 9.0, 14.0, 18.0];
        assert_eq!(warned(&stable, [3.0, 10.0]), None);
        let told = warned(&stable, [6.0, 10.0]).unwrap();
        assert!(told.starts_with("breaking set free 60 %"), "{told}");
        // the first bonds of all are all of the crack
        assert_eq!(warned(&[0.0, 2.0], [6.0, 10.0]), None);
        // bodies without bonds have no horizon, and round-off in their energies
        assert_eq!(CrackGrowth::default().warning::<2>(0.0, [1e-20, 0.0]), None);
        let told = warned(&[0.0, 2.0, 55.0, 56.0], [3.8, 10.0]).unwrap();
        assert!(
            told.starts_with("load step 3, t = 0.3000, alone took 95 %"),
            "{told}"
        );
    }
}
