//! Order of the cases of a study: each setting alone, then the combination that promises most.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::parameters::Outcome;
use super::record::{self, write_line};
use super::surrogate::{Effects, most_promising};
use super::trial::{Attempt, Ran, Runner};
use crate::pareto::parameters::{Case, TradeEnd, TradeError, TradeParams};
use crate::variants::{Base, Change, Measured, Quantity, Setting};
use bondline::progress::Progress;
use bondline::scene::Source;

/// A combination is worth running if it promises this factor in cost or error over the front.
const WORTH: f64 = 1.1;

/// A study under way.
pub(super) struct Study<'a> {
    pub params: &'a TradeParams,
    pub runner: Runner<'a>,
    /// The scene without overrides, and the folder that its paths count from.
    pub plain: Source,
    pub directory: &'a Path,
    pub base: Base,
    pub settings: Vec<(usize, Setting)>,
    pub common: Vec<String>,
    pub reference: Measured,
    /// Keys of the reference, where it is the scene with these.
    pub reference_keys: Option<Vec<String>>,
    pub quantities: Vec<Quantity>,
    /// The error that is wanted of each.
    pub wanted: Vec<f64>,
    pub cases: Vec<Case>,
    /// Combinations that are the reference itself.
    pub skipped: Vec<Vec<String>>,
    pub record: std::fs::File,
    pub record_path: PathBuf,
    pub deadline: Instant,
    /// Longest time that a case may take: some times the reference.
    pub patience: Duration,
}

/// Factor by which guesses of errors may go astray.
const ASTRAY: f64 = 2.0;

/// Combinations beyond this are not looked at.
const MOST_COMBINATIONS: usize = 20_000;

impl Study<'_> {
    /// Runs everything, `first` of all combinations, and returns the reason for its end.
    pub(super) fn all(
        &mut self,
        first: &[String],
        progress: &dyn Progress,
    ) -> Result<TradeEnd, TradeError> {
        let singles = 1 + self.settings.len();
        progress.stage("the scene, and each setting alone", Some(singles as u64));
        if let Some(end) = self.case(&[], None, progress)? {
            return Ok(end);
        }
        let base = |what, why: &str, remedy| TradeError::Base {
            what,
            why: why.to_owned(),
            remedy,
        };
        match self.cases.first().map(|case| &case.outcome) {
            Some(Outcome::Refused { why }) => {
                return Err(base("the scene", why, "try it with `bondline run`"));
            }
            // the reference agrees with itself, and is no case
            None => {
                return Err(base(
                    "the reference",
                    "it is the scene itself, of which nothing can be made finer",
                    "name a finer one with --reference, or generate the mesh in the scene",
                ));
            }
            Some(Outcome::Ran { .. } | Outcome::OverTime { .. }) => {}
        }
        progress.advance(1);
        for k in 0..self.settings.len() {
            if self.acts(&[k])
                && let Some(end) = self.case(&[k], None, progress)?
            {
                return Ok(end);
            }
            progress.advance(1);
        }
        let positions = first.iter().map(|label| self.position(label));
        if let Some(chosen) = positions.collect::<Option<Vec<usize>>>()
            && let Some(end) = self.case(&chosen, None, progress)?
        {
            return Ok(end);
        }
        progress.stage("combinations", None);
        while let Some((chosen, guess)) = self.next() {
            if let Some(end) = self.case(&chosen, Some(guess), progress)? {
                return Ok(end);
            }
        }
        Ok(TradeEnd::Complete)
    }

    fn labels(&self, chosen: &[usize]) -> Vec<String> {
        chosen
            .iter()
            .map(|&k| self.settings[k].1.label.clone())
            .collect()
    }

    fn chosen(&self, case: &Case) -> Option<Vec<usize>> {
        let labels = case.settings.iter();
        labels.map(|label| self.position(label)).collect()
    }

    fn position(&self, label: &str) -> Option<usize> {
        self.settings.iter().position(|s| s.1.label == *label)
    }

    /// The coupling of a case.
    fn coupling(&self, chosen: &[usize]) -> &str {
        let mut changes = chosen.iter().map(|&k| &self.settings[k].1.change);
        changes
            .find_map(|change| match change {
                Change::Coupling(name) => Some(name.as_str()),
                _ => None,
            })
            .unwrap_or_else(|| self.base.coupling())
    }

    /// Returns true if each setting changes something beside the others.
    fn acts(&self, chosen: &[usize]) -> bool {
        let coupling = self.coupling(chosen);
        let mut changes = chosen.iter().map(|&k| &self.settings[k].1.change);
        changes.all(|change| self.base.acts(change, coupling))
    }

    fn point(&self, case: &Case) -> Option<(f64, f64)> {
        case.point(self.params.cost, &self.wanted)
    }

    /// Runs a case unless its outcome is known; why the study has to end, if it has.
    fn case(
        &mut self,
        chosen: &[usize],
        guessed: Option<(f64, f64)>,
        progress: &dyn Progress,
    ) -> Result<Option<TradeEnd>, TradeError> {
        let settings = self.labels(chosen);
        let overrides = self
            .base
            .overrides(chosen.iter().map(|&k| &self.settings[k].1.change));
        // the reference agrees with itself
        if self.reference_keys.as_ref() == Some(&overrides) {
            self.skipped.push(settings);
            return Ok(None);
        }
        let is_this = |c: &Case| c.settings == settings && c.overrides == overrides;
        if self.cases.iter().any(is_this) {
            return Ok(None);
        }
        let left = self.deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(Some(TradeEnd::Budget));
        }
        if self
            .runner
            .interrupt
            .is_some_and(|f| f.load(Ordering::Relaxed))
        {
            return Ok(Some(TradeEnd::Interrupted));
        }
        progress.tell(&format!(
            "{} ({:.0} s left)",
            if settings.is_empty() {
                "as it is".to_owned()
            } else {
                settings.join(", ")
            },
            left.as_secs_f64()
        ));
        let all: Vec<String> = self.common.iter().chain(&overrides).cloned().collect();
        let folder = self.params.output.join("case");
        let mesh = record::mesh(&self.plain, self.directory, &all);
        let started = Instant::now();
        let outcome = match self.runner.run(&all, &folder, left.min(self.patience))? {
            Attempt::Interrupted => return Ok(Some(TradeEnd::Interrupted)),
            Attempt::Refused(why) => Outcome::Refused { why },
            Attempt::OverTime if left < self.patience => return Ok(Some(TradeEnd::Budget)),
            Attempt::OverTime => Outcome::OverTime {
                seconds: started.elapsed().as_secs_f64(),
            },
            Attempt::Ran(ran) => self.outcome(&ran),
        };
        // what a case writes is of no further use
        let _ = std::fs::remove_dir_all(&folder);
        let case = Case {
            coupling: self.coupling(chosen).to_owned(),
            settings,
            overrides,
            mesh,
            outcome,
            guessed,
        };
        write_line(&mut self.record, &case).map_err(|source| TradeError::File {
            path: self.record_path.clone(),
            source,
        })?;
        self.cases.push(case);
        Ok(None)
    }

    /// Cost and errors of a case that has run.
    fn outcome(&self, ran: &Ran) -> Outcome {
        let errors: Vec<Option<f64>> = self
            .quantities
            .iter()
            .map(|q| ran.measured.error(&self.reference, q))
            .collect();
        match errors.iter().position(Option::is_none) {
            Some(k) => Outcome::Refused {
                why: format!("its outputs have no {}", self.quantities[k].name()),
            },
            None => Outcome::Ran {
                cost: ran.cost,
                errors: errors.into_iter().flatten().collect(),
            },
        }
    }

    /// Combinations of settings that ran alone, at most one of each knob, whose outcome is not known.
    pub(super) fn combinations(&self) -> Vec<Vec<usize>> {
        let usable: Vec<usize> = (0..self.settings.len())
            .filter(|&k| {
                let label = &self.settings[k].1.label;
                self.cases.iter().any(|c| {
                    c.settings.as_slice() == std::slice::from_ref(label)
                        && matches!(c.outcome, Outcome::Ran { .. })
                })
            })
            .collect();
        let mut all: Vec<Vec<usize>> = vec![vec![]];
        for &k in &usable {
            let knob = self.settings[k].0;
            let with: Vec<Vec<usize>> = all
                .iter()
                .filter(|c| c.iter().all(|&o| self.settings[o].0 != knob))
                .map(|c| c.iter().copied().chain([k]).collect())
                .filter(|c: &Vec<usize>| self.acts(c))
                .take(MOST_COMBINATIONS.saturating_sub(all.len()))
                .collect();
            all.extend(with);
        }
        all.retain(|c| {
            let labels = self.labels(c);
            c.len() > 1
                && !self.skipped.contains(&labels)
                && !self.cases.iter().any(|case| case.settings == labels)
        });
        all
    }

    /// The most promising combination, with cost and error as guessed.
    fn next(&self) -> Option<(Vec<usize>, (f64, f64))> {
        let ran: Vec<(Vec<usize>, (f64, f64))> = self
            .cases
            .iter()
            .filter_map(|c| Some((self.chosen(c)?, self.point(c)?)))
            .collect();
        let number = self.settings.len();
        let of = |f: fn(&(f64, f64)) -> f64| {
            let values: Vec<_> = ran.iter().map(|(c, p)| (c.clone(), f(p))).collect();
            Effects::fit(number, &values)
        };
        let (cost, error) = (of(|p| p.0), of(|p| p.1));
        let candidates = self.combinations();
        let guessed: Vec<(f64, f64)> = candidates
            .iter()
            .map(|c| (cost.guess(c), error.guess(c)))
            .collect();
        let measured: Vec<(f64, f64)> = ran.iter().map(|r| r.1).collect();
        let k = self
            .cheapest_of_couplings(&candidates, &guessed)
            .or_else(|| most_promising(&guessed, &measured, WORTH))?;
        Some((candidates[k].clone(), guessed[k]))
    }

    /// Of all couplings the candidate that may be the cheapest of its coupling with the errors wanted: first of those that have none yet.
    fn cheapest_of_couplings(
        &self,
        candidates: &[Vec<usize>],
        guessed: &[(f64, f64)],
    ) -> Option<usize> {
        let couplings: BTreeSet<&str> = candidates.iter().map(|c| self.coupling(c)).collect();
        let best = couplings.into_iter().filter_map(|coupling| {
            let is_its = |case: &&Case| case.coupling == coupling;
            let own = self.cases.iter().filter(is_its);
            let own: Vec<(f64, f64)> = own.filter_map(|case| self.point(case)).collect();
            let least =
                |values: &mut dyn Iterator<Item = f64>| values.fold(f64::INFINITY, f64::min);
            let met = least(&mut own.iter().filter(|p| p.1 <= 1.0).map(|p| p.0));
            let its = (0..candidates.len()).filter(|&k| self.coupling(&candidates[k]) == coupling);
            let its: Vec<usize> = its.collect();
            let meeting = its.iter().copied();
            let meeting = meeting.filter(|&k| guessed[k].1 <= 1.0 && WORTH * guessed[k].0 < met);
            let cheapest = meeting.min_by(|&a, &b| guessed[a].0.total_cmp(&guessed[b].0));
            // none is guessed to meet them: the most accurate one, as far as guesses go astray
            let nearest = || {
                let most = ASTRAY.min(least(&mut own.iter().map(|p| p.1)) / WORTH);
                let near = its.iter().copied().filter(|&k| guessed[k].1 <= most);
                near.min_by(|&a, &b| guessed[a].1.total_cmp(&guessed[b].1))
            };
            let found = match met.is_finite() {
                true => cheapest,
                false => cheapest.or_else(nearest),
            };
            // those that meet them already by what they would save
            let before = if met.is_finite() { met } else { 1.0 };
            found.map(|k| (met.is_finite(), guessed[k].0 / before, k))
        });
        let order = |a: &(bool, f64, usize), b: &(bool, f64, usize)| {
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2))
        };
        best.min_by(order).map(|found| found.2)
    }
}
