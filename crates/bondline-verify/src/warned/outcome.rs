//! Errors of a run, and what it was told of them.

use std::collections::BTreeMap;

use super::corpus::{Case, LINES};
use crate::meshes::scene;
use bondline::observe::{
    summary::RunSummary,
    warning::{Quantity, Warning},
};

/// Part of the largest value up to which a displacement is right.
pub(super) const RIGHT: f64 = 0.01;

/// Part of the largest value over which it is wrong.
pub(super) const WRONG: f64 = 0.05;

/// Largest errors along the lines, over the largest values there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Error {
    pub displacement: f64,
    /// Of the stress by von Mises.
    pub stress: f64,
}

impl Error {
    /// Returns true if nothing needs a warning: stresses are means over cells and families, and differ by more.
    pub fn is_right(&self) -> bool {
        self.displacement <= RIGHT && self.stress <= WRONG
    }
}

/// Warnings of a run.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Told {
    /// Largest error of displacements that it was told.
    pub displacement: Option<f64>,
    /// The same of stresses.
    pub stress: Option<f64>,
    /// The place of that.
    pub place: Option<[f64; 3]>,
    /// True if it was told that an error is not known.
    pub is_unknown: bool,
    /// Number of warnings.
    pub sentences: usize,
}

impl Told {
    fn of(warnings: &[Warning]) -> Self {
        let mut told = Self {
            sentences: warnings.len(),
            ..Self::default()
        };
        for warning in warnings {
            let effect = warning.effect.map(f64::abs);
            match warning.quantity {
                Some(Quantity::Displacement) if effect > told.displacement => {
                    told.displacement = effect;
                }
                Some(Quantity::Stress) if effect.is_none() => told.is_unknown = true,
                Some(Quantity::Stress) if effect > told.stress => {
                    told.stress = effect;
                    told.place = Some(std::array::from_fn(|k| {
                        warning.place.get(k).copied().unwrap_or(0.0)
                    }));
                }
                _ => {}
            }
        }
        told
    }

    /// Returns true if it was told of any error of a result.
    fn is_any(&self) -> bool {
        self.displacement.is_some() || self.stress.is_some() || self.is_unknown
    }
}

/// End of a run as it is typed.
#[derive(Clone, Copy, Debug)]
pub(super) enum Run {
    /// It ran to its end.
    Done {
        error: Error,
        told: Told,
        /// Error of the stress at the place that it was told of, over the stress there.
        there: Option<f64>,
    },
    /// It was refused; the error of a run that was let go, if it came to its end.
    Refused { error: Option<Error> },
}

impl Run {
    /// The error of the results.
    pub fn error(&self) -> Option<Error> {
        match self {
            Self::Done { error, .. } => Some(*error),
            Self::Refused { error } => *error,
        }
    }

    /// Its warnings.
    pub fn told(&self) -> Option<Told> {
        match self {
            Self::Done { told, .. } => Some(*told),
            Self::Refused { .. } => None,
        }
    }
}

/// A remedy of a warning, tried.
#[derive(Clone, Debug)]
pub(super) struct Tried {
    /// Code of the warning, and the values of `--set`.
    pub name: String,
    /// True if the error of what is warned of is smaller with it, or right; at the place that is named, where there is one.
    pub helps: Result<bool, String>,
}

/// Outcome of a scene.
#[derive(Clone, Debug)]
pub(super) struct Outcome {
    pub run: Run,
    /// The remedies of its warnings.
    pub tried: Vec<Tried>,
}

impl Outcome {
    /// Returns true if it was told of an error where there is none, neither along the lines nor at the place that it was told of.
    pub fn is_warned_though_right(&self) -> bool {
        let Run::Done { error, told, there } = self.run else {
            return false;
        };
        error.is_right() && there.is_none_or(|there| there <= WRONG) && told.is_any()
    }

    /// Returns true if an error over `limit`, and one of the stress over the usual, was told by no word.
    pub fn is_silent(&self, limit: f64) -> bool {
        let is_wrong = |e: Error| e.displacement > limit || e.stress > limit.max(WRONG);
        matches!(self.run, Run::Done { error, told, .. } if is_wrong(error) && !told.is_any())
    }

    /// Returns true if a figure that was told is more than twice the error, or less than half of it.
    pub fn is_told_falsely(&self) -> bool {
        let Run::Done { error, told, there } = self.run else {
            return false;
        };
        let is_false = |told: Option<f64>, error: Option<f64>| {
            let both = told.zip(error);
            both.is_some_and(|(told, error)| told > 2.0 * error || told < 0.5 * error)
        };
        is_false(told.displacement, Some(error.displacement)) || is_false(told.stress, there)
    }
}

/// Displacement and stress at the places of the lines, by their coordinates; of the last state.
type Along = BTreeMap<String, ([f64; 3], f64)>;

/// The last state along the lines, of the places that count.
fn along(tables: Vec<Option<String>>, counts: impl Fn(&[f64; 3]) -> bool) -> Result<Along, String> {
    let mut found = Along::new();
    for table in tables.into_iter().flatten() {
        let mut lines = table
            .lines()
            .filter(|l| !l.starts_with('#') && !l.is_empty());
        let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
        let column = |name: &str| header.iter().position(|h| *h == name);
        for line in lines {
            let entries: Vec<&str> = line.split(',').collect();
            let number = |name: &str| {
                let entry = column(name).and_then(|k| entries.get(k));
                entry.and_then(|e| e.parse::<f64>().ok())
            };
            let place = ["x", "y", "z"].map(|x| number(x).unwrap_or(0.0));
            if !counts(&place) {
                continue;
            }
            let key = format!("{:.6} {:.6} {:.6}", place[0], place[1], place[2]);
            let u = ["ux", "uy", "uz"].map(|u| number(u).unwrap_or(0.0));
            let stress = number("von_mises").ok_or("a line without stress")?;
            found.insert(key, (u, stress));
        }
    }
    match found.is_empty() {
        true => Err("no place of the lines lies in the body".to_owned()),
        false => Ok(found),
    }
}

fn error(found: &Along, truth: &Along) -> Error {
    let mut error = Error {
        displacement: 0.0,
        stress: 0.0,
    };
    let (mut largest, mut peak) = (0.0f64, 0.0f64);
    for (place, (u, stress)) in truth {
        let Some((v, own)) = found.get(place) else {
            continue;
        };
        for (u, v) in u.iter().zip(v) {
            error.displacement = error.displacement.max((u - v).abs());
            largest = largest.max(u.abs());
        }
        error.stress = error.stress.max((stress - own).abs());
        peak = peak.max(*stress);
    }
    error.displacement /= largest;
    error.stress /= peak;
    error
}

impl Case {
    fn run(&self, overrides: &[&str]) -> Result<(RunSummary, Along), String> {
        self.run_where(overrides, |place| self.is_bounded(place))
    }

    /// The same with the places that count.
    fn run_where(
        &self,
        overrides: &[&str],
        counts: impl Fn(&[f64; 3]) -> bool,
    ) -> Result<(RunSummary, Along), String> {
        let files = &[("m.msh", self.mesh.as_str())];
        let (summary, tables) = scene::outputs(&self.text, overrides, files, &LINES)?;
        Ok((summary, along(tables, counts)?))
    }

    /// Returns true if a place is farther than a cell from a sharp root.
    fn is_bounded(&self, place: &[f64; 3]) -> bool {
        self.root
            .is_none_or(|(root, near)| (place[0] - root[0]).hypot(place[1] - root[1]) > near)
    }

    /// The stress at a place alone.
    fn stress_at(&self, place: &[f64], overrides: &[&str]) -> Result<f64, String> {
        let mut end = place.to_vec();
        end[0] += 1e-9;
        let line = format!("output.lines={{ a={{ from={place:?}, to={end:?}, samples=2 }} }}");
        let (_, found) = self.run_where(&[overrides, &[line.as_str()]].concat(), |_| true)?;
        let stress = found.values().next().map(|(_, stress)| *stress);
        stress.ok_or_else(|| "the place lies outside of the body".to_owned())
    }

    /// Error of the stress at a place, over the stress there.
    fn error_at(&self, place: &[f64], overrides: &[&str]) -> Result<f64, String> {
        let truth = self.stress_at(place, &["coupling=local"])?;
        Ok((self.stress_at(place, overrides)? - truth).abs() / truth)
    }

    /// Runs the scene with each remedy of a warning; `own` is the error without.
    fn tried(&self, warning: &Warning, own: Error, truth: &Along) -> Vec<Tried> {
        let is_of_stress = warning.quantity == Some(Quantity::Stress) && !warning.place.is_empty();
        let helps = |values: &[&str]| -> Result<bool, String> {
            // at the place that it names
            if is_of_stress {
                let before = self.error_at(&warning.place, &[])?;
                let after = self.error_at(&warning.place, values)?;
                return Ok(after < before.max(RIGHT));
            }
            let after = error(&self.run(values)?.1, truth);
            Ok(after.displacement < own.displacement.max(RIGHT))
        };
        let each = warning.remedies.iter().map(|remedy| {
            let values: Vec<&str> = remedy.iter().map(String::as_str).collect();
            Tried {
                name: format!("{} by {}", warning.code, remedy.join(", ")),
                helps: helps(&values),
            }
        });
        each.collect()
    }
}

/// Runs a scene as it is typed, and elements alone.
pub(super) fn outcome(case: &Case) -> Result<Outcome, String> {
    let (_, truth) = case.run(&["coupling=local"])?;
    let (summary, found) = match case.run(&[]) {
        Ok(done) => done,
        Err(_) => {
            let run = case.run(&["solver.unproven=warn"]);
            let error = run.ok().map(|(_, found)| error(&found, &truth));
            return Ok(Outcome {
                run: Run::Refused { error },
                tried: Vec::new(),
            });
        }
    };
    let (told, own) = (Told::of(&summary.warnings), error(&found, &truth));
    let place = told.place.map(|place| place[..summary.dimension].to_vec());
    Ok(Outcome {
        run: Run::Done {
            error: own,
            told,
            there: (told.place.filter(|place| case.is_bounded(place)).and(place))
                .and_then(|place| case.error_at(&place, &[]).ok()),
        },
        tried: (summary.warnings.iter())
            .flat_map(|warning| case.tried(warning, own, &truth))
            .collect(),
    })
}
