//! The cheapest candidate whose predicted error is small enough.

use std::path::Path;

use super::estimate::{CHOICES, SPREAD};
use super::free_parameters::{AccuracyRequest, Family};
use super::refinement_sequence::{AFFORDABLE, Found, Ladder};
use super::sample_run::Bench;
use super::{ErrorPrediction, ErrorReference};
use bondline::observe::summary::Decision;
use bondline::scene::SceneError;
use bondline::scene::Source;

/// A candidate: a family at a spacing.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// All but the spacing.
    pub family: Family,
    /// Cells along the shortest edge.
    pub cells: usize,
}

/// The choice for a scene.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// The keys that the scene leaves open.
    pub overrides: Vec<String>,
    /// The decisions, each with its reason.
    pub choices: Vec<Decision>,
    /// The predicted error; none where nothing that decides it was open.
    pub error: Option<f64>,
    /// Its place on its ladder.
    pub candidate: Candidate,
    /// Seconds of all pilots.
    pub seconds: f64,
    prediction: Option<ErrorPrediction>,
    asked: AccuracyRequest,
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

fn error(source: &Source, asked: &AccuracyRequest, why: &str) -> SceneError {
    SceneError::conflict(format!("no choice for `accuracy = {}` runs: {why}", asked.accuracy))
        .label(asked.spec.kinematics.span(), "in this scene")
        .help("type the mesh, the horizon, the points and the coupling; `bondline check` says what they cost")
        .shown_in(source)
}

/// Returns the reasons for a candidate, and the error that is predicted for it.
fn explained(
    asked: &AccuracyRequest,
    ladder: &Ladder,
    found: &Found,
    families: usize,
    bench: &Bench,
) -> (Vec<Decision>, ErrorPrediction) {
    let mut choices = coupling(asked, &ladder.family);
    choices.push(Decision {
                choice: asked.words(&ladder.family, found.cells),
                why: format!(
                    "error {:.1e} predicted, within a factor of {SPREAD} in {CHOICES} that were measured (order {:.1}), for {:.1e} wanted; the least work of {} kinds, counted in pilots of {:.2} s{}",
                    found.error,
                    ladder.fit.order,
                    asked.accuracy,
                    families,
                    bench.seconds,
                    if ladder.reaches(found.cells as f64) {
                        ""
                    } else {
                        "; a finer pilot would take too long"
                    },
                ),
            });
    let prediction = ErrorPrediction {
        quantities: bench.quantities.iter().map(|q| q.name()).collect(),
        error: found.error,
        against: if asked.breaks {
            ErrorReference::Peridynamics
        } else {
            ErrorReference::Elasticity
        },
        spread: SPREAD,
        share: CHOICES,
        order: ladder.fit.order,
        pilots: ladder.pilots(),
        seconds: bench.seconds,
    };
    (choices, prediction)
}

/// Chooses.
pub(super) fn choose(
    asked: &AccuracyRequest,
    source: &Source,
    directory: &Path,
) -> Result<Chosen, SceneError> {
    let families = asked.families();
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
            .chain([Decision {
                choice: "mesh and points as typed".to_owned(),
                why: "`accuracy` chooses what a scene leaves open".to_owned(),
            }])
            .collect();
        return Ok(done(&family, 1, choices, None, 0.0));
    }
    let mut left = AFFORDABLE;
    let mut ladders: Vec<Ladder> = families
        .iter()
        .filter_map(|family| Ladder::climb(asked, family, &mut bench))
        .collect();
    loop {
        let cost = |l: &Ladder| l.cost(asked.accuracy);
        let Some(k) =
            (0..ladders.len()).min_by(|&a, &b| cost(&ladders[a]).total_cmp(&cost(&ladders[b])))
        else {
            let why = bench
                .refusal
                .unwrap_or_else(|| "no pilots agree".to_owned());
            return Err(error(source, asked, &why));
        };
        let ladder = &mut ladders[k];
        if let Some(found) = ladder.found {
            let (choices, prediction) = explained(asked, ladder, &found, families.len(), &bench);
            return Ok(done(
                &ladder.family,
                found.cells,
                choices,
                Some(prediction),
                bench.seconds,
            ));
        }
        let wanted = ladder.cells(asked.accuracy);
        let kept = if ladder.reaches(wanted) || ladder.slow() {
            if wanted.is_infinite() {
                return Err(error(source, asked, "its zone limits the error"));
            }
            ladder.look(asked, &mut left, &mut bench)
        } else {
            ladder.rise(asked, &mut bench)
        };
        if kept.is_none() {
            drop(ladders.remove(k));
        }
    }
}

/// The coupling as a choice, where it is one.
fn coupling(asked: &AccuracyRequest, family: &Family) -> Vec<Decision> {
    let Some(name) = family.coupling else {
        return Vec::new();
    };
    vec![Decision {
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
