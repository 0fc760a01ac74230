//! The error of a complete scene, from coarser and finer versions of it.

use std::path::Path;

use super::estimate::{self, Fit, USUAL};
use super::refinement_sequence::growth;
use super::sample_run::{Bench, Pilot};
use super::{ErrorPrediction, ErrorReference};
use crate::variants::Base;
use bondline::scene::SceneError;
use bondline::scene::Source;
use bondline::scene::spec::SceneSpec;

/// Runs that are made at most, the scene itself among them if it is paid for.
const MOST: usize = 4;

/// Fewest runs that tell an order; two tell an error only.
const FEWEST: usize = 3;

/// The error of a complete scene from versions of it with other spacings, in at most so many `seconds` of runs, where one of the scene takes
/// `run_seconds`; else why there is none: fewer than two versions can be paid for, run, and be compared.
///
/// # Errors
/// [`SceneError`] of the scene itself.
pub(crate) fn predicted_error(
    source: &Source,
    directory: &Path,
    run_seconds: f64,
    seconds: f64,
) -> Result<Result<ErrorPrediction, String>, SceneError> {
    let spec = SceneSpec::parse(source)?;
    let base = Base::of(&spec);
    let least = spec.dimension() as f64 + f64::from(u8::from(base.moves));
    // finer points under the same horizon have more neighbours, too
    let most = growth(&spec)
        + if base.breaks {
            spec.dimension() as f64
        } else {
            0.0
        };
    let cost = |f: f64| run_seconds * f.powf(if f < 1.0 { -most } else { -least });
    let mut factors = base.versions();
    let mut bench = Bench::new(source, directory, &spec);
    let mut runs: Vec<(f64, Pilot)> = Vec::new();
    let mut levels: Vec<(f64, Pilot)> = loop {
        let set = paid(&factors, cost, seconds);
        if set.len() < 2 {
            return Ok(Err(unpaid(&factors, cost, bench.refusal)));
        }
        let known = factors.len();
        for &f in set.iter().rev() {
            if runs.iter().any(|(of, _)| *of == f) {
                continue;
            }
            match bench.run(&base.overrides(&base.scaled(f))) {
                Some(pilot) => runs.push((f, pilot)),
                // cut-outs that are not on its grid, for example
                None => factors.retain(|other| *other != f),
            }
        }
        if factors.len() == known {
            runs.retain(|(f, _)| set.contains(f));
            break runs
                .into_iter()
                .map(|(f, pilot)| (1.0 / f, pilot))
                .collect();
        }
    };
    levels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let usual = USUAL[usize::from(base.moves)];
    let fit = estimate::fit(&levels, &bench.quantities, usual);
    let Some((fit, error)) = fit.and_then(|fit| Some((fit, error(&levels, fit, &bench)?))) else {
        return Ok(Err(
            "versions with other spacings cannot be compared".to_owned()
        ));
    };
    let seam = of_zones(&base, &levels, &mut bench, seconds);
    Ok(Ok(ErrorPrediction {
        quantities: bench.quantities.iter().map(|q| q.name()).collect(),
        error: error + seam.unwrap_or(0.0),
        against: match (base.breaks, seam) {
            (false, _) => ErrorReference::Elasticity,
            (true, Some(_)) => ErrorReference::Peridynamics,
            (true, None) => ErrorReference::FinerScene,
        },
        spread: estimate::SPREAD,
        share: estimate::CHECKS,
        order: fit.order,
        pilots: levels.len(),
        seconds: bench.seconds,
    }))
}

/// Returns the reason why there are not two runs to compare, and the remedy.
fn unpaid(factors: &[f64], cost: impl Fn(f64) -> f64, refusal: Option<String>) -> String {
    match (factors, refusal) {
        ([.., b, a], _) => {
            let needed = cost(*a) + cost(*b);
            // rounded up, so that what is named is enough
            let text = match needed < 10.0 {
                true => format!("{:.1}", (10.0 * needed).ceil() / 10.0),
                false => format!("{:.0}", needed.ceil()),
            };
            format!("its runs with other spacings would take about {text} s: --pilots {text}")
        }
        (_, Some(why)) => format!("fewer than two versions with other spacings run: {why}"),
        (_, None) => {
            "it has no versions with other spacings, as with a mesh from a file".to_owned()
        }
    }
}

/// The error of the scene: where it is among the runs, how far it is from the finest and what the fit says of that one; else what the fit says.
fn error(levels: &[(f64, Pilot)], fit: Fit, bench: &Bench) -> Option<f64> {
    let (finest, reference) = levels.last()?;
    match levels.iter().find(|(n, _)| *n == 1.0) {
        Some((n, scene)) if n < finest => {
            let apart = estimate::difference(scene, reference, &bench.quantities)?;
            Some(apart + fit.error(*finest))
        }
        _ => Some(fit.error(1.0)),
    }
}

/// Seconds of a run grow with its points to this power.
const GROWTH: f64 = 1.5;

/// Returns the difference of the coarsest version from one with peridynamics everywhere; `None` where bonds are not cut, or where that takes too long.
fn of_zones(base: &Base, levels: &[(f64, Pilot)], bench: &mut Bench, seconds: f64) -> Option<f64> {
    let (n, coarsest) = levels.first()?;
    let changes = base.everywhere(1.0 / n)?;
    let more = base.points_of_all(1.0 / n)? / coarsest.points as f64;
    if coarsest.seconds * more.max(1.0).powf(GROWTH) > seconds {
        return None;
    }
    let everywhere = bench.run(&base.overrides(&changes))?;
    estimate::difference(coarsest, &everywhere, &bench.quantities)
}

/// The finest of ascending factors that can be paid for together, [`MOST`] at most: enough for an order, or two.
fn paid(factors: &[f64], cost: impl Fn(f64) -> f64, seconds: f64) -> Vec<f64> {
    let from = |first: usize| {
        let mut left = seconds;
        let mut taken = factors[first..].to_vec();
        taken.retain(|&f| {
            let is_paid = cost(f) <= left;
            if is_paid {
                left -= cost(f);
            }
            is_paid
        });
        taken.truncate(MOST);
        taken
    };
    let sets: Vec<Vec<f64>> = (0..factors.len()).map(from).collect();
    let with = |least: usize| sets.iter().find(|set| set.len() >= least);
    with(FEWEST).or(with(2)).cloned().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A scene that takes `run` seconds in 2D: 0.25 of it at twice the spacing, 4 times it at half.
    #[test]
    fn the_finest_runs_that_are_paid_for_are_made() {
        let factors = [0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 8.0];
        let of = |run: f64, seconds: f64| paid(&factors, |f| run * f.powi(-2), seconds);
        assert_eq!(of(0.1, 1.0), [0.5, 1.0, 1.5, 2.0]);
        // 4 of the 4.5 seconds leave nothing for the scene itself
        assert_eq!(of(1.0, 4.6), [0.5, 1.5, 3.0, 8.0]);
        assert_eq!(of(1.0, 4.0), [1.0, 1.5, 2.0, 3.0]);
        // 0.15: what is left of it after a third of the spacing pays for nothing but an eighth
        assert_eq!(of(1.0, 0.15), [3.0, 8.0]);
        assert_eq!(of(1.0, 0.05), Vec::<f64>::new());
    }
}
