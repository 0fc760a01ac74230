//! Errors of a run, and what it was told of them.

use std::collections::BTreeMap;

use super::corpus::{Case, LINES};
use crate::meshes::scene;

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
    fn of(warnings: &[String]) -> Self {
        let mut told = Self {
            sentences: warnings.len(),
            ..Self::default()
        };
        for text in warnings {
            let more = |old: Option<f64>, new: Option<f64>| match (old, new) {
                (Some(a), Some(b)) => Some(a.max(b)),
                (a, b) => a.or(b),
            };
            let of_stress = [
                ("a uniform stress comes out wrong by ", "near ("),
                ("that of outputs may be wrong by ", "at ("),
                ("to the next: it may be wrong by ", "at ("),
            ];
            let of_stress = of_stress.iter().find(|(words, _)| text.contains(words));
            if let Some((words, before)) = of_stress {
                let found = percent_after(text, words);
                if found > told.stress {
                    (told.stress, told.place) = (found, place_after(text, before));
                }
            } else if text.contains("differ from those of elements alone by up to") {
                told.displacement = more(told.displacement, percent_after(text, "by up to "));
            } else if text.contains("cannot be predicted") || text.contains("is not known") {
                told.is_unknown = true;
            }
        }
        told
    }

    /// Returns true if it was told of any error of a result.
    fn is_any(&self) -> bool {
        self.displacement.is_some() || self.stress.is_some() || self.is_unknown
    }
}

/// The number before the percent sign that follows some words.
fn percent_after(text: &str, words: &str) -> Option<f64> {
    let rest = &text[text.find(words)? + words.len()..];
    let number = rest.split('%').next()?.trim();
    number.parse::<f64>().ok().map(|x| 0.01 * x.abs())
}

/// The place that follows some words.
fn place_after(text: &str, words: &str) -> Option<[f64; 3]> {
    let rest = &text[text.find(words)? + words.len()..];
    let mut place = [0.0; 3];
    for (x, entry) in place.iter_mut().zip(rest.split(')').next()?.split(',')) {
        *x = entry.trim().parse().ok()?;
    }
    Some(place)
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

/// Outcome of a scene.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outcome {
    pub run: Run,
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

fn along(tables: Vec<Option<String>>) -> Result<Along, String> {
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

/// The key of a line that is a place, and no other lines.
fn at(place: &[f64]) -> String {
    let mut end = place.to_vec();
    end[0] += 1e-9;
    format!("output.lines={{ a={{ from={place:?}, to={end:?}, samples=2 }} }}")
}

/// Runs a scene as it is typed, and elements alone.
pub(super) fn outcome(case: &Case) -> Result<Outcome, String> {
    let files = &[("m.msh", case.mesh.as_str())];
    let run = |overrides: &[&str]| scene::outputs(&case.text, overrides, files, &LINES);
    let truth = along(run(&["coupling=local"])?.1)?;
    let run = match run(&[]) {
        Ok((summary, tables)) => {
            let told = Told::of(&summary.warnings);
            let there = told.place.and_then(|place| {
                let dimension = summary.dimension;
                let line = at(&place[..dimension]);
                let of = |first: &str| {
                    let keys = [line.as_str(), first];
                    let found = along(run(&keys[..if first.is_empty() { 1 } else { 2 }]).ok()?.1);
                    found
                        .ok()?
                        .into_iter()
                        .next()
                        .map(|(_, (_, stress))| stress)
                };
                let (own, truth) = (of("")?, of("coupling=local")?);
                Some((own - truth).abs() / truth)
            });
            Run::Done {
                error: error(&along(tables)?, &truth),
                told,
                there,
            }
        }
        Err(_) => {
            let let_go = ["solver.unproven=warn", "solve.explicit.growing-modes=warn"];
            let keys = if case.text.contains("solve.explicit") {
                2
            } else {
                1
            };
            let run = run(&let_go[..keys]).and_then(|found| along(found.1));
            Run::Refused {
                error: run.ok().map(|found| error(&found, &truth)),
            }
        }
    };
    Ok(Outcome { run })
}
