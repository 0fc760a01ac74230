//! A study as a table, CSV, JSON, a plot, and scenes.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{Outcome, front};
use crate::line_plot::{LinePlot, Scale, Series, Stroke};
use crate::pareto::parameters::{Case, CostBy, Trade, TradeEnd, TradeError, TradeParams};
use bondline::observe::atomic_file::write_whole;
use bondline::observe::csv::{CsvTable, Entry};
use bondline::observe::report::{aligned, number};
use bondline::scene::Source;

impl Trade {
    fn points(&self) -> Vec<(usize, (f64, f64))> {
        self.cases
            .iter()
            .enumerate()
            .filter_map(|(k, c)| Some((k, c.point(self.by)?)))
            .collect()
    }

    /// Cases that no other case beats in both cost and error, cheapest first.
    pub fn front(&self) -> Vec<&Case> {
        let points = self.points();
        let plain: Vec<(f64, f64)> = points.iter().map(|p| p.1).collect();
        front(&plain)
            .into_iter()
            .map(|k| &self.cases[points[k].0])
            .collect()
    }

    /// The cheapest case with an error of at most `wanted`.
    pub fn cheapest(&self, wanted: f64) -> Option<&Case> {
        self.front()
            .into_iter()
            .find(|c| c.point(self.by).is_some_and(|p| p.1 <= wanted))
    }

    /// By which factor guesses of cost and error were off, as medians and as the largest of nine tenths; `None` if nothing was guessed.
    pub fn spread(&self) -> Option<Spread> {
        let mut off: [Vec<f64>; 2] = Default::default();
        for case in &self.cases {
            if let (Some(guess), Some(point)) = (case.guessed, case.point(self.by)) {
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
        for &wanted in &params.wanted {
            if let Some(case) = self.cheapest(wanted) {
                files.push(self.scene(params, case, wanted)?);
            }
        }
        Ok(files)
    }

    fn csv(&self, folder: &Path) -> Result<PathBuf, TradeError> {
        let path = folder.join("trade.csv");
        let errors: Vec<String> = self
            .quantities
            .iter()
            .map(|q| format!("error {}", q.name()))
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
            cost: &'a str,
            reference: &'a (Vec<String>, super::Cost),
            front: Vec<String>,
            spread: Option<Spread>,
            left: usize,
            cases: &'a [Case],
        }
        let whole = Whole {
            scene: &self.scene,
            quantities: self.quantities.iter().map(|q| q.name()).collect(),
            cost: self.by.name(),
            reference: &self.reference,
            front: self.front().iter().map(|c| c.name()).collect(),
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
            .and_then(|c| c.point(self.by))
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
            .filter_map(|c| Some((scaled(c.point(self.by)?), c.name())))
            .unzip();
        let base = self.cases.first().and_then(|c| c.point(self.by));
        // where the scene lies means nothing to those who see the plot
        let name = self.scene.file_name().unwrap_or(self.scene.as_os_str());
        LinePlot {
            title: format!("{}: error against cost", name.display()),
            x_label: format!("{} over that of the scene as it is", self.by.name()),
            y_label: "relative error".to_owned(),
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

    fn scene(&self, params: &TradeParams, case: &Case, wanted: f64) -> Result<PathBuf, TradeError> {
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
        let name = format!("{}-{wanted}.toml", stem.unwrap_or("scene".into()));
        let path = params.output.join(name);
        let (_, error) = case.point(self.by).unwrap_or((f64::NAN, f64::NAN));
        write_whole(&path, |out| {
            use std::io::Write as _;
            writeln!(
                out,
                "# {}: the cheapest case found ({}) with an error of at most {wanted}; measured: {error:.3e}.\n",
                case.name(),
                self.by.name(),
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

impl fmt::Display for Trade {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<String> = self.quantities.iter().map(|q| q.name()).collect();
        writeln!(
            f,
            "{}: error of {} against {}, {} of {}\n",
            self.scene.display(),
            names.join(", "),
            self.by.name(),
            self.front().len(),
            self.points().len()
        )?;
        let unit = self.unit();
        let mut grid = vec![
            ["cost", "over the scene's", "error", "case"]
                .map(str::to_owned)
                .to_vec(),
        ];
        let base = self.cases.first();
        let shown = self.front();
        let not_shown = base.filter(|b| !shown.contains(b));
        for case in shown.iter().copied().chain(not_shown) {
            if let Some((cost, error)) = case.point(self.by) {
                grid.push(vec![
                    cost_text(self.by, cost),
                    format!("{:.3}", cost / unit),
                    number(error),
                    case.name(),
                ]);
            }
        }
        writeln!(f, "{}", aligned(&grid))?;
        let (keys, cost) = &self.reference;
        writeln!(
            f,
            "reference: {} ({})",
            keys.join(", "),
            cost_text(self.by, self.by.of(cost))
        )?;
        if let Some(s) = self.spread() {
            writeln!(
                f,
                "guesses before {} runs were off by a factor of {:.2} in cost and {:.2} in error (median), {:.2} and {:.2} at most in nine of ten",
                s.guesses, s.cost.0, s.error.0, s.cost.1, s.error.1
            )?;
        }
        let mut refused = self.cases.iter().filter_map(|c| match &c.outcome {
            Outcome::Refused { why } => Some((c, why.clone())),
            Outcome::OverTime { seconds } => Some((
                c,
                format!("ended after {seconds:.0} s, several times the reference"),
            )),
            Outcome::Ran { .. } => None,
        });
        for (case, why) in refused.by_ref().take(20) {
            let short: String = why.chars().take(160).collect();
            writeln!(f, "did not run: {}: {short}", case.name())?;
        }
        let more = refused.count();
        if more > 0 {
            writeln!(f, "did not run: {more} more, see trade.json")?;
        }
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
