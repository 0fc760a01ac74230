//! The cheapest candidate whose predicted error is small enough.

use std::path::Path;

use super::super::error::{SceneError, SceneErrorKind};
use super::super::source::Source;
use super::ErrorPrediction;
use super::estimate::{self, CHOICES, Fit, SAFETY, SPREAD};
use super::open::{Asked, Family};
use super::pilot::{Bench, Pilot};
use crate::observe::summary::Choice;

/// A candidate: a family at a spacing.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// All but the spacing.
    pub family: Family,
    /// Cells along the shortest edge.
    pub cells: usize,
}

/// What was chosen.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// The keys that the scene leaves open.
    pub overrides: Vec<String>,
    /// What was chosen, and why.
    pub choices: Vec<Choice>,
    /// The predicted error; none where nothing that decides it was open.
    pub error: Option<f64>,
    /// Where it stands on its ladder.
    pub candidate: Candidate,
    /// Seconds of all pilots.
    pub seconds: f64,
    prediction: Option<ErrorPrediction>,
    asked: Asked,
    families: Vec<Family>,
}

impl Chosen {
    /// The predicted error with all that goes with it.
    pub fn prediction(&self) -> Option<ErrorPrediction> {
        self.prediction.clone()
    }

    /// The keys of another candidate.
    pub fn overrides_of(&self, candidate: &Candidate) -> Vec<String> {
        self.asked.overrides(&candidate.family, candidate.cells)
    }

    /// The keys of a reference with so many times the cells.
    pub fn reference(&self, factor: f64) -> Vec<String> {
        // cut-outs of the body lie on its grid too
        let n = self
            .asked
            .fitting((self.candidate.cells as f64 * factor).round() as usize);
        self.asked.reference(&self.candidate.family, n)
    }

    /// All families that were looked at.
    pub fn families(&self) -> &[Family] {
        &self.families
    }
}

/// A family with what its pilots told.
struct Ladder {
    family: Family,
    levels: Vec<(f64, Pilot)>,
    fit: Fit,
    /// Fewest cells along an edge.
    fewest: f64,
}

/// Rungs before the first fit.
const FIRST: usize = 3;

/// A candidate may be finer than its finest pilot by this factor.
const BEYOND: f64 = 2.0;

/// No rung is climbed after a pilot of so many seconds.
const PATIENCE: f64 = 10.0;

/// Fewest cells along an edge: below, no power law holds.
const FEWEST: f64 = 2.0;

impl Ladder {
    fn cells(&self, accuracy: f64) -> f64 {
        self.fit
            .cells(accuracy / SAFETY)
            .map_or(f64::INFINITY, |n| (n - 1e-9).ceil().max(self.fewest))
    }

    /// Work of the candidate, from that of the finest pilot by the usual growth with the number of cells.
    fn cost(&self, accuracy: f64, dimension: usize) -> f64 {
        let Some((n, pilot)) = self.levels.last() else {
            return f64::INFINITY;
        };
        let growth = [1.0, 2.4, 4.5][dimension - 1];
        pilot.work * (self.cells(accuracy) / n).powf(growth)
    }
}

fn error(source: &Source, asked: &Asked, why: &str) -> SceneError {
    SceneError::new(
        SceneErrorKind::Conflict,
        format!("no choice for `accuracy = {}` runs: {why}", asked.accuracy),
    )
    .label(asked.spec.kinematics.span(), "in this scene")
    .help("type the mesh, the horizon, the points and the coupling; `bondline check` says what they cost")
    .shown_in(source)
}

/// Chooses.
pub(super) fn choose(
    asked: &Asked,
    source: &Source,
    directory: &Path,
) -> Result<Chosen, SceneError> {
    let families = asked.families();
    let dimension = asked.spec.dimension();
    let mut bench = Bench::new(source, directory, &asked.spec);
    let done =
        |family: &Family, n: usize, choices, prediction: Option<ErrorPrediction>, seconds| Chosen {
            overrides: asked.overrides(family, n),
            choices,
            error: prediction.as_ref().map(|p| p.error),
            prediction,
            candidate: Candidate {
                family: family.clone(),
                cells: n,
            },
            seconds,
            asked: asked.clone(),
            families: families.clone(),
        };
    if !asked.has_ladder() {
        let family = Family {
            // the scene's own rule where there are points
            coupling: if asked.points() {
                None
            } else {
                families[0].coupling
            },
            ..families[0].clone()
        };
        let choices = coupling(asked, &family)
            .into_iter()
            .chain([Choice {
                choice: "mesh and points as typed".to_owned(),
                why: "`accuracy` chooses what a scene leaves open".to_owned(),
            }])
            .collect();
        return Ok(done(&family, 1, choices, None, 0.0));
    }
    let mut ladders = Vec::new();
    for family in &families {
        if let Some(ladder) = climb(asked, family, &mut bench) {
            ladders.push(ladder);
        }
    }
    loop {
        let cost = |l: &Ladder| l.cost(asked.accuracy, dimension);
        let Some(k) =
            (0..ladders.len()).min_by(|&a, &b| cost(&ladders[a]).total_cmp(&cost(&ladders[b])))
        else {
            let why = bench
                .refusal
                .unwrap_or_else(|| "no pilots agree".to_owned());
            return Err(error(source, asked, &why));
        };
        let ladder = &mut ladders[k];
        let wanted = ladder.cells(asked.accuracy);
        let Some((finest, pilot)) = ladder.levels.last() else {
            continue;
        };
        let near = wanted <= BEYOND * finest;
        if near || pilot.seconds > PATIENCE {
            if wanted.is_infinite() {
                return Err(error(source, asked, "its zone limits the error"));
            }
            let n = asked.fitting(wanted as usize);
            let mut choices = coupling(asked, &ladder.family);
            choices.push(Choice {
                choice: asked.words(&ladder.family, n),
                why: format!(
                    "error {:.1e} predicted, within a factor of {SPREAD} in {CHOICES} that were measured (order {:.1}), for {:.1e} wanted; the least work of {} kinds, counted in pilots of {:.2} s{}",
                    ladder.fit.error(n as f64),
                    ladder.fit.order,
                    asked.accuracy,
                    families.len(),
                    bench.seconds,
                    if near { "" } else { "; a finer pilot would take too long" },
                ),
            });
            let prediction = Some(ErrorPrediction {
                quantities: bench.quantities.iter().map(|q| q.name()).collect(),
                error: ladder.fit.error(n as f64),
                spread: SPREAD,
                share: CHOICES,
                order: ladder.fit.order,
                pilots: ladder.levels.len(),
                seconds: bench.seconds,
            });
            return Ok(done(&ladder.family, n, choices, prediction, bench.seconds));
        }
        let n = asked.fitting(2 * *finest as usize);
        let ran = bench.run(&asked.overrides(&ladder.family, n), 0.0);
        let fitted = ran.and_then(|pilot| {
            ladder.levels.push((n as f64, pilot));
            let rest = ladder.fit.rest;
            let fit = estimate::fit(&ladder.levels, &bench.quantities);
            fit.map(|f| f.with_rest(rest))
        });
        match fitted {
            Some(fit) => ladder.fit = fit,
            None => drop(ladders.remove(k)),
        }
    }
}

/// The first rungs of a family; `None` if one does not run.
fn climb(asked: &Asked, family: &Family, bench: &mut Bench) -> Option<Ladder> {
    let first = asked.first(family);
    let mut levels = Vec::new();
    for rung in 0..FIRST {
        let n = asked.fitting(first << rung);
        levels.push((n as f64, bench.run(&asked.overrides(family, n), 0.0)?));
    }
    let mut fit = estimate::fit(&levels, &bench.quantities)?;
    if let Some(padding) = family.padding {
        // what the edge of the zone does shows in one twice as far
        let wider = Family {
            padding: Some(2.0 * padding),
            ..family.clone()
        };
        let pilot = bench.run(&asked.overrides(&wider, first), 0.0)?;
        fit.rest = estimate::difference(&levels[0].1, &pilot, &bench.quantities)?;
    }
    Some(Ladder {
        family: family.clone(),
        levels,
        fit,
        fewest: match asked.horizon {
            // coarser points would have no neighbours
            Some(_) if asked.points() => first as f64,
            _ => FEWEST,
        },
    })
}

/// The coupling as a choice, where it is one.
fn coupling(asked: &Asked, family: &Family) -> Vec<Choice> {
    let Some(name) = family.coupling else {
        return Vec::new();
    };
    vec![Choice {
        choice: format!("coupling {name}"),
        why: match (asked.breaks, asked.wants_points) {
            (true, _) => {
                "bonds are cut or can break; the horizon is a length of the material, and kept"
            }
            (false, true) => {
                "the scene draws a nonlocal zone; nothing is cut, so its horizon is numerical"
            }
            (false, false) => "nothing is cut and no bond can break: elements alone",
        }
        .to_owned(),
    }]
}
