//! A family of candidates, with runs of it from coarse to fine.

use super::coarsest_admissible::coarsest;
use super::estimate::{self, Fit, SAFETY, USUAL};
use super::free_parameters::{AccuracyRequest, Family};
use super::sample_run::{Bench, Pilot};
use crate::variants::Base;
use bondline::scene::spec::SceneSpec;

/// Rungs before the first fit.
const FIRST: usize = 3;

/// A rung has at most so many times the work of the one below, and a candidate of the finest.
const RUNG: f64 = 6.0;

/// The finest pilot is to have this share of the wanted error, where that is [`AFFORDABLE`]: so much of a candidate's error is not measured.
const SHARE: f64 = 0.2;

/// A pilot that is finer by less is not worth its run.
const STEP: f64 = 1.25;

/// Work of all pilots beyond the fits, in counted seconds: a matter of patience.
pub(super) const AFFORDABLE: f64 = 1.0;

/// So many candidates are to be paid for beside a finer pilot.
const LOOKED: f64 = 2.0;

/// No rung is climbed after a pilot of so many seconds.
const PATIENCE: f64 = 10.0;

/// Fewest cells along an edge: below, no power law holds.
const FEWEST: f64 = 2.0;

/// A family with its pilots and their fit.
pub(super) struct Ladder {
    pub family: Family,
    /// Runs with their cells along the shortest edge, from coarse to fine; never empty.
    levels: Vec<(f64, Pilot)>,
    pub fit: Fit,
    /// Fewest cells along an edge.
    fewest: f64,
    /// Work goes with the cells along an edge to this power.
    growth: f64,
    /// Its candidate, once it was looked for.
    pub found: Option<Found>,
}

/// A candidate, its predicted error, and its work.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub cells: usize,
    pub error: f64,
    work: f64,
}

impl Ladder {
    /// The first rungs of a family; `None` if one does not run.
    pub fn climb(asked: &AccuracyRequest, family: &Family, bench: &mut Bench) -> Option<Self> {
        let first = asked.first(family);
        let mut levels = Vec::new();
        let growth = growth(&asked.spec);
        let mut n = asked.fitting(first);
        while levels.len() < FIRST {
            levels.push((n as f64, bench.run(&asked.overrides(family, n))?));
            n = asked.fitting(above(n, growth));
        }
        let mut fit = estimate::fit(&levels, &bench.quantities, USUAL[0])?;
        if let Some(padding) = family.padding {
            // what the edge of the zone does shows in one twice as far
            let wider = Family {
                padding: Some(2.0 * padding),
                ..family.clone()
            };
            let pilot = bench.run(&asked.overrides(&wider, first))?;
            fit.rest = estimate::difference(&levels[0].1, &pilot, &bench.quantities)?;
        }
        Some(Self {
            family: family.clone(),
            levels,
            fit,
            found: None,
            growth,
            fewest: match asked.horizon {
                // coarser points would have no neighbours
                Some(_) if asked.points() => first as f64,
                _ => FEWEST,
            },
        })
    }

    /// Cells along an edge for the wanted error, by the fit; infinite where no number suffices.
    pub fn cells(&self, accuracy: f64) -> f64 {
        self.fit
            .cells(accuracy / SAFETY)
            .map_or(f64::INFINITY, |n| (n - 1e-9).ceil().max(self.fewest))
    }

    /// Runs that the fit comes from.
    pub fn pilots(&self) -> usize {
        self.levels.len()
    }

    fn finest(&self) -> f64 {
        self.levels.last().map_or(0.0, |(n, _)| *n)
    }

    /// Returns true if the fit may be trusted for so many cells.
    pub fn reaches(&self, n: f64) -> bool {
        n <= rung(self.growth) * self.finest()
    }

    /// Returns true if no finer rung is to be climbed: the last one took too long.
    pub fn slow(&self) -> bool {
        self.levels
            .last()
            .is_some_and(|(_, pilot)| pilot.seconds > PATIENCE)
    }

    /// Work of `n` cells, from that of the finest pilot.
    fn work(&self, n: f64) -> f64 {
        self.levels.last().map_or(f64::INFINITY, |(finest, pilot)| {
            pilot.work * (n / finest).powf(self.growth)
        })
    }

    /// Work of the candidate.
    pub fn cost(&self, accuracy: f64) -> f64 {
        match self.found {
            Some(found) => found.work,
            None => self.work(self.cells(accuracy)),
        }
    }

    /// Adds the next rung; `None` if it does not run.
    pub fn rise(&mut self, asked: &AccuracyRequest, bench: &mut Bench) -> Option<()> {
        let n = above(self.finest() as usize, self.growth);
        self.refine(asked, asked.fitting(n), bench)
    }

    fn refine(&mut self, asked: &AccuracyRequest, n: usize, bench: &mut Bench) -> Option<()> {
        let pilot = bench.run(&asked.overrides(&self.family, n))?;
        self.levels.push((n as f64, pilot));
        let fit = estimate::fit(&self.levels, &bench.quantities, USUAL[0])?;
        self.fit = fit.with_rest(self.fit.rest);
        Some(())
    }

    /// Cells of the pilot whose error is [`SHARE`] of the wanted one, or of as fine a one as `left` pays beside candidates; `None` where that
    /// is hardly finer than the finest, or than the candidate.
    fn finer(&self, asked: &AccuracyRequest, left: f64) -> Option<usize> {
        let wanted = self.fit.cells(SHARE * asked.accuracy)?;
        let finest = self.finest();
        let guess = self.cells(asked.accuracy);
        let left = (left - LOOKED * self.work(guess)).max(0.0);
        let paid = finest * (left / self.work(finest)).powf(1.0 / self.growth);
        let n = wanted.min(paid);
        let enough = STEP * finest.max(guess);
        (n >= enough).then(|| asked.fitting(n as usize))
    }

    /// Looks for the candidate among runs of candidates, and keeps it; `None` where there is none.
    ///
    /// The error of a candidate is its difference from the finest pilot and what the fit says of that one; only the latter wants a reserve. What
    /// `left` does not pay is left to the fit.
    pub fn look(
        &mut self,
        asked: &AccuracyRequest,
        left: &mut f64,
        bench: &mut Bench,
    ) -> Option<()> {
        while let Some(n) = self.finer(asked, *left) {
            *left -= self.work(n as f64);
            self.refine(asked, n, bench)?;
        }
        let (finest, reference) = self.levels.last()?;
        let beyond = self.fit.error(*finest);
        let mut known: Vec<Found> = Vec::new();
        let mut bound = |cells: usize| {
            let expected = self.work(cells as f64);
            let run = self.levels.iter().find(|(n, _)| *n == cells as f64);
            let pilot = match run {
                _ if cells as f64 >= *finest => None,
                Some((_, pilot)) => Some(pilot.clone()),
                None if expected > *left => None,
                None => {
                    *left -= expected;
                    match bench.run(&asked.overrides(&self.family, cells)) {
                        Some(pilot) => Some(pilot),
                        None => return f64::INFINITY,
                    }
                }
            };
            let Some(pilot) = pilot else {
                let error = self.fit.error(cells as f64);
                known.push(Found {
                    cells,
                    error,
                    work: expected,
                });
                return SAFETY * error;
            };
            let Some(apart) = estimate::difference(&pilot, reference, &bench.quantities) else {
                return f64::INFINITY;
            };
            known.push(Found {
                cells,
                error: apart + beyond,
                work: pilot.work,
            });
            apart + SAFETY * beyond
        };
        let least = match asked.horizon {
            Some(_) if asked.points() => self.fewest as usize,
            // what is run need not follow a power law
            _ => 1,
        };
        let cells = coarsest(
            self.cells(asked.accuracy) as usize,
            least,
            (asked.accuracy, self.fit.order),
            |n| asked.fitting(n),
            &mut bound,
        )?;
        self.found = known.into_iter().find(|f| f.cells == cells);
        Some(())
    }
}

/// Factors of direct solvers grow faster than cells; in motion there are more steps, too.
pub(super) fn growth(spec: &SceneSpec) -> f64 {
    let dimension = spec.dimension();
    if Base::of(spec).moves {
        dimension as f64 + 1.0
    } else {
        [1.0, 2.4, 4.5][dimension - 1]
    }
}

/// Cells along an edge over those of the rung below: two at most, less where work grows fast, as orders of rungs that are near to the candidate
/// are nearer to its own.
fn rung(growth: f64) -> f64 {
    RUNG.powf(1.0 / growth).min(2.0)
}

fn above(n: usize, growth: f64) -> usize {
    ((n as f64 * rung(growth)).round() as usize).max(n + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six times the work: (3/2)^4.5 = 6.2 and (9/6)^4.5, (13/9)^4.5 = 5.2.
    #[test]
    fn rungs_are_nearer_where_work_grows_faster() {
        let ladder = |first, growth| {
            let rungs = std::iter::successors(Some(first), |&n| Some(above(n, growth)));
            rungs.take(4).collect::<Vec<_>>()
        };
        assert_eq!(ladder(8, 1.0), [8, 16, 32, 64]);
        assert_eq!(ladder(4, 2.4), [4, 8, 16, 32]);
        assert_eq!(ladder(4, 4.5), [4, 6, 9, 13]);
        assert_eq!(ladder(1, 4.5), [1, 2, 3, 4]);
    }
}
