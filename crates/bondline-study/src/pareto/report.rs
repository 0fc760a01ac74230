//! A study as a table, CSV, JSON, a plot, and scenes.

use std::cmp::Ordering;
use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{Outcome, OwnError, front};
use crate::line_plot::{LinePlot, Scale, Series, Stroke};
use crate::pareto::parameters::{Case, CostBy, Trade, TradeEnd, TradeError, TradeParams};
use bondline::observe::atomic_file::write_whole;
use bondline::observe::csv::{CsvTable, Entry};
use bondline::observe::report::{aligned, number};
use bondline::scene::Source;

impl Trade {
    fn point(&self, case: &Case) -> Option<(f64, f64)> {
        let wanted: Vec<f64> = self.wants.iter().map(|want| want.1).collect();
        case.point(self.by, &wanted)
    }

    fn points(&self) -> Vec<(usize, (f64, f64))> {
        let cases = self.cases.iter().enumerate();
        cases
            .filter_map(|(k, c)| Some((k, self.point(c)?)))
            .collect()
    }

    /// Cases that no other case beats in both cost and error, cheapest first; the error is the largest one over what is wanted of it.
    pub fn front(&self) -> Vec<&Case> {
        let points = self.points();
        let plain: Vec<(f64, f64)> = points.iter().map(|p| p.1).collect();
        front(&plain)
            .into_iter()
            .map(|k| &self.cases[points[k].0])
            .collect()
    }

    /// The cheapest case whose errors are all as small as wanted.
    pub fn cheapest(&self) -> Option<&Case> {
        let meets = |c: &&Case| self.point(c).is_some_and(|p| p.1 <= 1.0);
        self.front().into_iter().find(meets)
    }

    /// Couplings of the cases that ran, in the order in which they ran.
    fn couplings(&self) -> Vec<&str> {
        let mut found: Vec<&str> = Vec::new();
        for (k, _) in self.points() {
            let own = self.cases[k].coupling.as_str();
            if !found.contains(&own) {
                found.push(own);
            }
        }
        found
    }

    /// The best case of a coupling by a key, of those that `takes` accepts by cost and error.
    fn best(
        &self,
        coupling: &str,
        takes: impl Fn((f64, f64)) -> bool,
        key: impl Fn((f64, f64)) -> f64,
    ) -> Option<&Case> {
        let points = self.points().into_iter();
        let own = points.filter(|(k, p)| self.cases[*k].coupling == coupling && takes(*p));
        let best = own.min_by(|a, b| key(a.1).total_cmp(&key(b.1)))?;
        Some(&self.cases[best.0])
    }

    /// The cheapest case of each coupling with every error as wanted; of one that has none the most accurate case.
    pub fn at_equal_error(&self) -> Vec<&Case> {
        let couplings = self.couplings().into_iter();
        let mut found: Vec<&Case> = couplings
            .filter_map(|coupling| {
                self.best(coupling, |p| p.1 <= 1.0, |p| p.0)
                    .or_else(|| self.best(coupling, |_| true, |p| p.1))
            })
            .collect();
        let key = |c: &&Case| self.point(c).map(|p| (p.1 > 1.0, p.0));
        found.sort_by(|a, b| key(a).partial_cmp(&key(b)).unwrap_or(Ordering::Equal));
        found
    }

    /// The most accurate case of each coupling that costs no more than the scene as it is.
    pub fn at_equal_cost(&self) -> Vec<&Case> {
        let most = self.unit();
        let couplings = self.couplings().into_iter();
        let mut found: Vec<&Case> = couplings
            .filter_map(|coupling| self.best(coupling, |p| p.0 <= most, |p| p.1))
            .collect();
        let key = |c: &&Case| self.point(c).map(|p| p.1);
        found.sort_by(|a, b| key(a).partial_cmp(&key(b)).unwrap_or(Ordering::Equal));
        found
    }

    /// By which factor guesses of cost and error were off, as medians and as the largest of nine tenths; `None` if nothing was guessed.
    pub fn spread(&self) -> Option<Spread> {
        let mut off: [Vec<f64>; 2] = Default::default();
        for case in &self.cases {
            if let (Some(guess), Some(point)) = (case.guessed, self.point(case)) {
                off[0].push((guess.0 / point.0).ln().abs().exp());
                off[1].push((guess.1 / point.1).ln().abs().exp());
            }
        }
        let at = |values: &mut Vec<f64>, share: f64| {
            values.sort_by(f64::total_cmp);
            let k = (share * values.len() as f64).ceil() as usize;
            values.get(k.saturating_sub(1)).copied()
        };
        let [cost, error] = &mut off;
        Some(Spread {
            guesses: cost.len(),
            cost: (at(cost, 0.5)?, at(cost, 0.9)?),
            error: (at(error, 0.5)?, at(error, 0.9)?),
        })
    }

    /// Writes `trade.csv`, `trade.json`, `trade.svg`, `trade.png` and a scene for each wanted error that a case meets; returns the files.
    ///
    /// # Errors
    /// [`TradeError`].
    pub fn write(&self, params: &TradeParams) -> Result<Vec<PathBuf>, TradeError> {
        let mut files = vec![self.csv(&params.output)?, self.json(&params.output)?];
        if self.points().iter().any(|(_, p)| p.1 > 0.0) {
            for name in ["trade.svg", "trade.png"] {
                let path = params.output.join(name);
                self.plot().write(&path)?;
                files.push(path);
            }
        }
        if let Some(case) = self.cheapest() {
            files.push(self.scene(params, case)?);
        }
        Ok(files)
    }

    fn csv(&self, folder: &Path) -> Result<PathBuf, TradeError> {
        let path = folder.join("trade.csv");
        let errors: Vec<String> = self
            .wants
            .iter()
            .map(|(q, _)| format!("error {}", q.name()))
            .collect();
        let mut header = vec![
            "case",
            "on_front",
            "seconds",
            "memory_bytes",
            "bond_visits",
            "unknowns",
            "guessed_cost",
            "guessed_error",
        ];
        header.extend(errors.iter().map(String::as_str));
        let mut table = CsvTable::create(&path, &header)?;
        let front: Vec<String> = self.front().iter().map(|c| c.name()).collect();
        for case in &self.cases {
            let Outcome::Ran { cost, errors } = &case.outcome else {
                continue;
            };
            // a case that nobody guessed has no guess, and the table takes numbers only
            let guess = case.guessed.unwrap_or((-1.0, -1.0));
            let mut row = vec![
                Entry::Text(case.name()),
                Entry::Integer(front.contains(&case.name()).into()),
            ];
            let numbers = [
                cost.seconds,
                cost.memory,
                cost.bond_visits,
                cost.unknowns,
                guess.0,
                guess.1,
            ];
            row.extend(numbers.iter().chain(errors).map(|v| Entry::Real(*v)));
            table.entries(&row)?;
        }
        Ok(path)
    }

    fn json(&self, folder: &Path) -> Result<PathBuf, TradeError> {
        #[derive(Serialize)]
        struct Whole<'a> {
            scene: &'a Path,
            quantities: Vec<String>,
            wanted: Vec<f64>,
            cost: &'a str,
            reference: &'a [String],
            reference_errors: Vec<Option<f64>>,
            front: Vec<String>,
            at_equal_error: Vec<String>,
            at_equal_cost: Vec<String>,
            spread: Option<Spread>,
            left: usize,
            cases: &'a [Case],
        }
        let whole = Whole {
            scene: &self.scene,
            quantities: self.wants.iter().map(|(q, _)| q.name()).collect(),
            wanted: self.wants.iter().map(|(_, wanted)| *wanted).collect(),
            cost: self.by.name(),
            reference: &self.reference.keys,
            reference_errors: self.reference_errors(),
            front: names(&self.front()),
            at_equal_error: names(&self.at_equal_error()),
            at_equal_cost: names(&self.at_equal_cost()),
            spread: self.spread(),
            left: self.left,
            cases: &self.cases,
        };
        let path = folder.join("trade.json");
        write_whole(&path, |out| {
            serde_json::to_writer_pretty(out, &whole).map_err(std::io::Error::other)
        })?;
        Ok(path)
    }

    fn unit(&self) -> f64 {
        self.cases
            .first()
            .and_then(|c| self.point(c))
            .map_or(1.0, |p| p.0)
    }

    /// Error over cost, both axes logarithmic; cost relative to the scene as it is.
    pub fn plot(&self) -> LinePlot {
        let unit = self.unit();
        let scaled = |(cost, error): (f64, f64)| (cost / unit, error);
        let dots = self.points().iter().map(|(_, p)| scaled(*p)).collect();
        let (line, names) = self
            .front()
            .iter()
            .filter_map(|c| Some((scaled(self.point(c)?), c.name())))
            .unzip();
        let base = self.cases.first().and_then(|c| self.point(c));
        // where the scene lies means nothing to those who see the plot
        let name = self.scene.file_name().unwrap_or(self.scene.as_os_str());
        LinePlot {
            title: format!("{}: error against cost", name.display()),
            x_label: format!("{} over that of the scene as it is", self.by.name()),
            y_label: "error over the wanted one".to_owned(),
            x_scale: Scale::Log,
            y_scale: Scale::Log,
            series: vec![
                Series::new("all cases", Stroke::Dots, dots),
                Series::new("front", Stroke::LineAndDots, line).labelled(names),
                Series::new(
                    "the scene as it is",
                    Stroke::Dots,
                    base.map(scaled).into_iter().collect(),
                ),
            ],
        }
    }

    /// Writes the scene with the settings of a case, ready to run.
    fn scene(&self, params: &TradeParams, case: &Case) -> Result<PathBuf, TradeError> {
        let file_error = |path: &Path, source| TradeError::File {
            path: path.to_path_buf(),
            source,
        };
        let text = std::fs::read_to_string(&params.scene)
            .map_err(|source| file_error(&params.scene, source))?;
        let scene_error = |e| TradeError::Scene(Box::new(e));
        let mut source = Source::new(params.scene.display().to_string(), text);
        for o in params.overrides.iter().chain(&case.overrides) {
            source.push_override(o).map_err(scene_error)?;
        }
        let folder = match params.scene.parent() {
            Some(p) if !p.as_os_str().is_empty() => p,
            _ => Path::new("."),
        };
        let folder = std::fs::canonicalize(folder).map_err(|e| file_error(folder, e))?;
        let merged = source.text(&folder).map_err(scene_error)?;
        let stem = params.scene.file_stem().map(|s| s.to_string_lossy());
        let name = format!("{}-chosen.toml", stem.unwrap_or("scene".into()));
        let path = params.output.join(name);
        write_whole(&path, |out| {
            use std::io::Write as _;
            writeln!(
                out,
                "# {}: the cheapest case found ({}) with {}; measured: {}.\n",
                case.name(),
                self.by.name(),
                self.wanted_text(),
                self.errors_of(case).join(", "),
            )?;
            out.write_all(merged.as_bytes())
        })?;
        Ok(path)
    }
}

/// By which factors guesses were off: the median and that of nine tenths.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Cases that were guessed before they ran.
    pub guesses: usize,
    /// Of the cost.
    pub cost: (f64, f64),
    /// Of the error.
    pub error: (f64, f64),
}

/// A cost in its unit.
fn cost_text(by: CostBy, value: f64) -> String {
    match by {
        CostBy::Time => format!("{value:.3} s"),
        CostBy::Memory => format!("{:.0} MiB", value / f64::from(1 << 20)),
        CostBy::BondVisits => number(value),
    }
}

/// Part of a wanted error up to which that of the reference is small.
const SMALL: f64 = 0.34;

/// Refused cases that are listed, and characters of their reasons.
const LISTED: (usize, usize) = (12, 200);

fn names(cases: &[&Case]) -> Vec<String> {
    cases.iter().map(|c| c.name()).collect()
}

fn percent(error: f64) -> String {
    format!("{} %", number(100.0 * error))
}

impl Trade {
    /// The quantities with the errors that are wanted, for a sentence.
    fn wanted_text(&self) -> String {
        let each = self.wants.iter();
        let each = each.map(|(q, wanted)| format!("{} to {}", q.name(), percent(*wanted)));
        each.collect::<Vec<_>>().join(", ")
    }

    fn errors_of(&self, case: &Case) -> Vec<String> {
        match &case.outcome {
            Outcome::Ran { errors, .. } => errors.iter().map(|e| percent(*e)).collect(),
            _ => Vec::new(),
        }
    }

    /// A table of cases: coupling, cost, memory, errors and settings.
    fn table(&self, cases: &[&Case]) -> String {
        let unit = self.unit();
        let mut header = vec!["coupling", self.by.name(), "over the scene's", "memory"];
        let quantities: Vec<String> = self.wants.iter().map(|(q, _)| q.name()).collect();
        header.extend(quantities.iter().map(String::as_str));
        header.push("case");
        let mut grid: Vec<Vec<String>> = vec![header.into_iter().map(str::to_owned).collect()];
        for case in cases {
            let (Some((cost, error)), Outcome::Ran { cost: all, .. }) =
                (self.point(case), &case.outcome)
            else {
                continue;
            };
            let mut row = vec![
                case.coupling.clone(),
                cost_text(self.by, cost),
                format!("{:.3}", cost / unit),
                cost_text(CostBy::Memory, all.memory),
            ];
            row.extend(self.errors_of(case));
            row.push(match error > 1.0 {
                true => format!("{} (no case is as accurate as wanted)", case.name()),
                false => case.name(),
            });
            grid.push(row);
        }
        aligned(&grid)
    }

    fn told_of_reference(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reference = &self.reference;
        let cost = cost_text(self.by, self.by.of(&reference.cost));
        write!(f, "reference: {} ({cost})", reference.why)?;
        if !reference.keys.is_empty() {
            write!(f, ": {}", reference.keys.join(", "))?;
        }
        writeln!(f)?;
        for ((quantity, wanted), own) in self.wants.iter().zip(self.reference_errors()) {
            let name = quantity.name();
            let how = match &reference.own_error {
                OwnError::Bound(_) => "at most",
                _ => "about",
            };
            match own {
                Some(own) if own <= SMALL * wanted => {
                    writeln!(f, "its own error of {name}: {how} {}", percent(own))?;
                }
                Some(own) => writeln!(
                    f,
                    "its own error of {name}: {how} {}, so that errors near this are not known; --reference names another",
                    percent(own)
                )?,
                None => writeln!(f, "its own error of {name} is not known")?,
            }
        }
        Ok(())
    }

    /// Says which cases did not run, once for each reason.
    fn told_of_refusals(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut reasons: Vec<(String, Vec<String>)> = Vec::new();
        for case in &self.cases {
            let why = match &case.outcome {
                Outcome::Refused { why } => why.chars().take(LISTED.1).collect(),
                Outcome::OverTime { .. } => "ended after several times the reference".to_owned(),
                Outcome::Ran { .. } => continue,
            };
            match reasons.iter_mut().find(|(known, _)| *known == why) {
                Some((_, cases)) => cases.push(case.name()),
                None => reasons.push((why, vec![case.name()])),
            }
        }
        for (why, cases) in reasons.iter().take(LISTED.0) {
            writeln!(f, "did not run: {}: {why}", cases.join("; "))?;
        }
        match reasons.len().saturating_sub(LISTED.0) {
            0 => Ok(()),
            more => writeln!(f, "did not run: {more} more, see trade.json"),
        }
    }
}

impl fmt::Display for Trade {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}: {}; {} cases\n",
            self.scene.display(),
            self.wanted_text(),
            self.points().len()
        )?;
        self.told_of_reference(f)?;
        writeln!(
            f,
            "\nat equal error, the cheapest case of each coupling:\n{}",
            self.table(&self.at_equal_error())
        )?;
        writeln!(
            f,
            "at equal {}, {} as of the scene, the most accurate case of each coupling:\n{}",
            self.by.name(),
            cost_text(self.by, self.unit()),
            self.table(&self.at_equal_cost())
        )?;
        let base = self.cases.first();
        let mut shown = self.front();
        shown.extend(base.filter(|b| !shown.contains(b)));
        writeln!(
            f,
            "no case beats these in cost and error; and the scene:\n{}",
            self.table(&shown)
        )?;
        match self.cheapest() {
            Some(case) => writeln!(f, "chosen: {}", case.name())?,
            None => writeln!(f, "no case is as accurate as wanted")?,
        }
        if let Some(s) = self.spread() {
            writeln!(
                f,
                "guesses before {} runs were off by a factor of {:.2} in cost and {:.2} in error (median), {:.2} and {:.2} at most in nine of ten",
                s.guesses, s.cost.0, s.error.0, s.cost.1, s.error.1
            )?;
        }
        self.told_of_refusals(f)?;
        match self.ended {
            TradeEnd::Complete => Ok(()),
            TradeEnd::Budget => writeln!(
                f,
                "the time is used up with {} combinations left; the same command goes on",
                self.left
            ),
            TradeEnd::Interrupted => writeln!(f, "interrupted; the same command goes on"),
        }
    }
}
