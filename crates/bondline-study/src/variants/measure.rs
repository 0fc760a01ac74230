//! Differences between the outputs of a run and those of the reference.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

/// Quantity to compare.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// Displacements along all lines and at all probes; root mean square of the difference over that of the reference.
    Displacement,
    /// Strains there, likewise.
    Strain,
    /// Largest difference of a condition's force, over the largest force.
    Reaction,
    /// Stored energy.
    Energy,
    /// Columns at a probe: `probe.NAME.COLUMN`, where `u` stands for all components of the displacement. At rest the difference over the value of the reference, in time and load steps as of a history.
    Probe(String, String),
    /// Columns along a line of a scene at rest: `line.NAME.COLUMN`; root mean square of the difference over that of the reference.
    Line(String, String),
    /// A column of the history: root mean square over time of the difference, over that of the reference.
    History(String),
    /// The largest absolute value of a column of the history, as a peak load.
    Peak(String),
    /// Area of cracks at the end, in the plane their length.
    CrackLength,
    /// Path of a tip: the largest distance of a point of the reference's path from that of the run, over the length of the former.
    Path(String),
    /// Time of a tip: root mean square, over the points of the reference's path, of the difference in arrival at the same length, over
    /// the time that the tip moved.
    TipTime(String),
}

/// Quantities as they are typed.
const NAMES: &str = "displacement, strain, reaction, energy, probe.NAME.COLUMN, line.NAME.COLUMN, history.COLUMN, peak.COLUMN, crack-length, path.TIP, tip-time.TIP";

impl Quantity {
    /// From the command line: `displacement`, `strain`, `reaction`, `energy`, `probe.NAME.COLUMN`, `line.NAME.COLUMN`, `history.COLUMN`, `peak.COLUMN`, `crack-length`, `path.TIP`, `tip-time.TIP`; the first dot may be a colon.
    ///
    /// # Errors
    /// A message with the known quantities.
    pub fn parse(text: &str) -> Result<Self, String> {
        let unknown = || format!("`{text}` is no quantity; known: {NAMES}");
        let Some((kind, name)) = text.split_once(['.', ':']) else {
            return Ok(match text {
                "displacement" => Self::Displacement,
                "strain" => Self::Strain,
                "reaction" => Self::Reaction,
                "energy" => Self::Energy,
                "crack-length" => Self::CrackLength,
                _ => return Err(unknown()),
            });
        };
        let name = name.to_owned();
        let column = || {
            let (place, column) = name.rsplit_once('.').ok_or_else(|| {
                format!("`{text}` names no column; write {kind}.NAME.COLUMN, as {kind}.{name}.u")
            })?;
            Ok::<_, String>((place.to_owned(), column.to_owned()))
        };
        Ok(match kind {
            "probe" => column().map(|(place, column)| Self::Probe(place, column))?,
            "line" => column().map(|(place, column)| Self::Line(place, column))?,
            "history" => Self::History(name),
            "peak" => Self::Peak(name),
            "path" => Self::Path(name),
            "tip-time" => Self::TipTime(name),
            _ => return Err(unknown()),
        })
    }

    /// As typed.
    pub fn name(&self) -> String {
        match self {
            Self::Displacement => "displacement".to_owned(),
            Self::Strain => "strain".to_owned(),
            Self::Reaction => "reaction".to_owned(),
            Self::Energy => "energy".to_owned(),
            Self::Probe(place, column) => format!("probe.{place}.{column}"),
            Self::Line(place, column) => format!("line.{place}.{column}"),
            Self::History(c) => format!("history.{c}"),
            Self::Peak(c) => format!("peak.{c}"),
            Self::CrackLength => "crack-length".to_owned(),
            Self::Path(t) => format!("path.{t}"),
            Self::TipTime(t) => format!("tip-time.{t}"),
        }
    }
}

/// A table of numbers with named columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Columns {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Columns {
    /// Reads a table that a run wrote.
    pub(super) fn parse(text: &str) -> Self {
        let mut lines = text.lines();
        let names = lines.next().unwrap_or_default();
        Self {
            names: names.split(',').map(str::to_owned).collect(),
            rows: lines
                .map(|l| {
                    l.split(',')
                        .map(|v| v.parse().unwrap_or(f64::NAN))
                        .collect()
                })
                .collect(),
        }
    }

    fn index(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|n| n == name)
    }

    fn columns(&self, wanted: impl Fn(&str) -> bool) -> Vec<usize> {
        (0..self.names.len())
            .filter(|&k| wanted(&self.names[k]))
            .collect()
    }

    fn pairs(&self, x: &str, y: &str) -> Option<Vec<(f64, f64)>> {
        let (x, y) = (self.index(x)?, self.index(y)?);
        Some(self.rows.iter().map(|r| (r[x], r[y])).collect())
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// Everything of a run that can be compared.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// Tables along lines, and that of all probes, of a scene at rest, by the ends of their files' names.
    samples: BTreeMap<String, Columns>,
    /// Names of the probes, in the order of their rows.
    probes: Vec<String>,
    history: Option<Columns>,
    tips: BTreeMap<String, Columns>,
    reactions: BTreeMap<String, Vec<f64>>,
    energy: Option<f64>,
}

impl Measured {
    /// Reads the outputs of a run from its folder, and its summary; `probes` are the names of its probes in the order of their rows.
    pub(crate) fn read(
        folder: &Path,
        summary: &serde_json::Value,
        probes: &[String],
    ) -> std::io::Result<Self> {
        let mut found = Self {
            energy: summary["energy"].as_f64(),
            probes: probes.to_vec(),
            ..Self::default()
        };
        for reaction in summary["reactions"].as_array().into_iter().flatten() {
            let force = reaction["force"].as_array().into_iter().flatten();
            found.reactions.insert(
                reaction["condition"]
                    .as_str()
                    .unwrap_or_default()
                    .to_owned(),
                force.map(|f| f.as_f64().unwrap_or(f64::NAN)).collect(),
            );
        }
        let mut paths: Vec<_> = std::fs::read_dir(folder)?
            .filter_map(|e| e.ok().map(|e| e.path()))
            .collect();
        // a scene may have a title, and its files another name
        let mut names = paths.iter().filter_map(|p| p.file_name()?.to_str());
        let name = names.find_map(|name| name.strip_suffix(RECORD));
        let scene = name.or(summary["scene"].as_str()).unwrap_or_default();
        let scene = scene.to_owned();
        paths.retain(|p| p.extension().is_some_and(|e| e == "csv"));
        paths.sort();
        for path in paths {
            let table = Columns::parse(&std::fs::read_to_string(&path)?);
            let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned());
            let stem = stem.unwrap_or_default();
            if let Some((_, tip)) = stem.split_once("_tip_") {
                found.tips.insert(tip.to_owned(), table);
            } else if stem.ends_with("_history") {
                found.history = Some(table);
            } else {
                let own = stem.strip_prefix(scene.as_str()).unwrap_or(&stem);
                let own = own.trim_start_matches('_').to_owned();
                found.samples.insert(own, table);
            }
        }
        Ok(found)
    }

    /// Returns the quantities that suit the outputs: paths of tips, else the probes of the history, else displacements (and forces of conditions).
    pub(crate) fn quantities(&self) -> Vec<Quantity> {
        if !self.tips.is_empty() {
            return self.tips.keys().cloned().map(Quantity::Path).collect();
        }
        if let Some(history) = &self.history {
            let probes: Vec<Quantity> = history
                .names
                .iter()
                .filter(|n| AXES.iter().any(|a| n.ends_with(&format!("_u{a}"))))
                .filter(|n| !still(history, n))
                .map(|n| Quantity::History(n.clone()))
                .collect();
            if !probes.is_empty() {
                return probes;
            }
            return ["kinetic_energy", "stored_energy"]
                .map(|c| Quantity::History(c.to_owned()))
                .into();
        }
        if self.samples.is_empty() {
            return vec![Quantity::Reaction];
        }
        vec![Quantity::Displacement]
    }

    /// Relative difference from a reference; `None` where one of the two does not have the quantity.
    pub(crate) fn error(&self, reference: &Self, quantity: &Quantity) -> Option<f64> {
        let error = match quantity {
            Quantity::Displacement => sampled(&self.beside(reference)?, |n| is_component(n, 'u')),
            Quantity::Strain => sampled(&self.beside(reference)?, |n| is_component(n, 'e')),
            Quantity::Line(line, column) => {
                let pair = (self.samples.get(line)?, reference.samples.get(line)?);
                sampled(&[pair], |n| is_of(n, column))
            }
            Quantity::Probe(probe, column) => self.at_probe(reference, probe, column),
            Quantity::Reaction => {
                let (mut most, mut scale) = (0.0f64, 0.0f64);
                for (name, force) in &reference.reactions {
                    let own = self.reactions.get(name)?;
                    let apart: Vec<f64> = force.iter().zip(own).map(|(a, b)| a - b).collect();
                    most = most.max(norm(&apart));
                    scale = scale.max(norm(force));
                }
                Some(most / scale)
            }
            Quantity::Energy => Some((self.energy? / reference.energy? - 1.0).abs()),
            Quantity::History(column) => {
                let own = self.history.as_ref()?.pairs("time", column)?;
                let reference = reference.history.as_ref()?.pairs("time", column)?;
                over_time(&own, &reference)
            }
            Quantity::Peak(column) => {
                let peak = |measured: &Self| {
                    let pairs = measured.history.as_ref()?.pairs("time", column)?;
                    Some(pairs.iter().map(|p| p.1.abs()).fold(0.0, f64::max))
                };
                Some((peak(self)? / peak(reference)? - 1.0).abs())
            }
            Quantity::CrackLength => {
                let end = |measured: &Self| {
                    let pairs = measured.history.as_ref()?.pairs("time", CRACK_AREA)?;
                    Some(pairs.last()?.1)
                };
                Some((end(self)? / end(reference)? - 1.0).abs())
            }
            Quantity::Path(tip) => path_error(self.tips.get(tip)?, reference.tips.get(tip)?),
            Quantity::TipTime(tip) => time_error(self.tips.get(tip)?, reference.tips.get(tip)?),
        };
        error.filter(|e| e.is_finite())
    }

    /// All tables of samples, each beside that of a reference.
    fn beside<'a>(&'a self, reference: &'a Self) -> Option<Vec<(&'a Columns, &'a Columns)>> {
        let tables = reference.samples.iter();
        tables
            .map(|(name, table)| Some((self.samples.get(name)?, table)))
            .collect()
    }

    /// The difference from a reference at a probe.
    fn at_probe(&self, reference: &Self, probe: &str, column: &str) -> Option<f64> {
        if let Some(history) = &reference.history {
            let prefix = format!("{probe}_");
            let is_its = |n: &str| n.strip_prefix(&prefix).is_some_and(|n| is_of(n, column));
            let names = history.names.iter().filter(|n| is_its(n));
            let (mut difference, mut size) = (0.0, 0.0);
            for name in names {
                let own = self.history.as_ref()?.pairs("time", name)?;
                let (d, s) = squares_over_time(&own, &history.pairs("time", name)?)?;
                (difference, size) = (difference + d, size + s);
            }
            return Some((difference / size).sqrt());
        }
        let row = |measured: &Self| -> Option<Columns> {
            let number = measured.probes.iter().position(|name| name == probe)?;
            let table = measured.samples.get(PROBES)?;
            Some(Columns {
                names: table.names.clone(),
                rows: vec![table.rows.get(number)?.clone()],
            })
        };
        sampled(&[(&row(self)?, &row(reference)?)], |n| is_of(n, column))
    }
}

/// End of the name of the file in which a run records what it was.
const RECORD: &str = ".run.json";

/// The table of all probes of a scene at rest.
const PROBES: &str = "probes";

/// Column of a history with the area of cracks.
const CRACK_AREA: &str = "crack_area";

/// Returns true if a column is one of those that are asked for: `u` stands for all components of the displacement.
fn is_of(name: &str, wanted: &str) -> bool {
    name == wanted || wanted == "u" && is_component(name, 'u')
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn is_component(name: &str, letter: char) -> bool {
    let mut letters = name.chars();
    letters.next() == Some(letter) && name.len() > 1 && letters.all(|c| "xyz".contains(c))
}

/// Returns true if a column is zero throughout, or missing.
fn still(table: &Columns, name: &str) -> bool {
    let Some(k) = table.index(name) else {
        return true;
    };
    table.rows.iter().all(|r| r[k] == 0.0)
}

/// Root mean square of the difference at common positions over that of the reference.
fn sampled(tables: &[(&Columns, &Columns)], wanted: impl Fn(&str) -> bool) -> Option<f64> {
    let (mut difference, mut size, mut common) = (0.0, 0.0, 0usize);
    for (own, reference) in tables {
        let position = reference.columns(|n| AXES.contains(&n));
        let values = reference.columns(&wanted);
        let key =
            |row: &[f64]| -> Vec<u64> { position.iter().map(|&k| row[k].to_bits()).collect() };
        let places: BTreeMap<Vec<u64>, &Vec<f64>> = own.rows.iter().map(|r| (key(r), r)).collect();
        for row in &reference.rows {
            // a position beside a slit may lie in one of two bodies only
            let Some(other) = places.get(&key(row)) else {
                continue;
            };
            common += 1;
            for &k in &values {
                difference += (row[k] - other[k]).powi(2);
                size += row[k].powi(2);
            }
        }
    }
    (common > 0).then(|| (difference / size).sqrt())
}

/// Linear interpolation.
fn at(series: &[(f64, f64)], x: f64) -> Option<f64> {
    let k = series.partition_point(|p| p.0 < x);
    let ((x0, y0), (x1, y1)) = match k {
        0 => return series.first().map(|p| p.1),
        k if k == series.len() => return series.last().map(|p| p.1),
        k => (series[k - 1], series[k]),
    };
    Some(y0 + (y1 - y0) * (x - x0) / (x1 - x0))
}

fn over_time(own: &[(f64, f64)], reference: &[(f64, f64)]) -> Option<f64> {
    let (difference, size) = squares_over_time(own, reference)?;
    Some((difference / size).sqrt())
}

/// Sums over the times of the reference of the squared difference, and of its squared values.
fn squares_over_time(own: &[(f64, f64)], reference: &[(f64, f64)]) -> Option<(f64, f64)> {
    let (mut difference, mut size) = (0.0, 0.0);
    for &(time, value) in reference {
        difference += (at(own, time)? - value).powi(2);
        size += value * value;
    }
    Some((difference, size))
}

/// Positions of a tip, and its times.
fn tip(table: &Columns) -> Option<Vec<(f64, Vec<f64>)>> {
    let time = table.index("time")?;
    let axes = table.columns(|n| AXES.contains(&n));
    let path: Vec<_> = table
        .rows
        .iter()
        .map(|r| (r[time], axes.iter().map(|&k| r[k]).collect()))
        .collect();
    (!path.is_empty()).then_some(path)
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).powi(2))
        .sum::<f64>()
        .sqrt()
}

/// Distance of a point from a segment.
fn from_segment(x: &[f64], a: &[f64], b: &[f64]) -> f64 {
    let along: Vec<f64> = a.iter().zip(b).map(|(a, b)| b - a).collect();
    let square: f64 = along.iter().map(|v| v * v).sum();
    let t = if square > 0.0 {
        let dot: f64 = along
            .iter()
            .zip(x.iter().zip(a))
            .map(|(v, (x, a))| v * (x - a))
            .sum();
        (dot / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let foot: Vec<f64> = a.iter().zip(&along).map(|(a, v)| a + t * v).collect();
    distance(x, &foot)
}

/// Distance of a point from a path of straight pieces; none from a path without points.
///
/// Shapes: one number per dimension for every point. Units: those of the points.
pub fn distance_from_path<P: AsRef<[f64]>>(x: &[f64], path: &[P]) -> Option<f64> {
    let first = distance(x, path.first()?.as_ref());
    let pieces = path.windows(2);
    let distances = pieces.map(|w| from_segment(x, w[0].as_ref(), w[1].as_ref()));
    Some(distances.fold(first, f64::min))
}

fn length(path: &[(f64, Vec<f64>)]) -> f64 {
    path.windows(2).map(|w| distance(&w[0].1, &w[1].1)).sum()
}

fn path_error(own: &Columns, reference: &Columns) -> Option<f64> {
    let (own, reference) = (tip(own)?, tip(reference)?);
    let own: Vec<_> = own.into_iter().map(|p| p.1).collect();
    let most = reference
        .iter()
        .filter_map(|p| distance_from_path(&p.1, &own))
        .fold(0.0, f64::max);
    Some(most / length(&reference))
}

fn time_error(own: &Columns, reference: &Columns) -> Option<f64> {
    let (own, reference) = (tip(own)?, tip(reference)?);
    let arrival = |path: &[(f64, Vec<f64>)]| -> Vec<(f64, f64)> {
        let mut s = 0.0;
        let mut list = vec![(0.0, path[0].0)];
        for w in path.windows(2) {
            s += distance(&w[0].1, &w[1].1);
            list.push((s, w[1].0));
        }
        list
    };
    let (own, all) = (arrival(&own), arrival(&reference));
    let span = all.last()?.1 - all.first()?.1;
    let mut sum = 0.0;
    for &(s, time) in &all {
        sum += (at(&own, s)? - time).powi(2);
    }
    Some((sum / all.len() as f64).sqrt() / span)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn history(f: impl Fn(f64) -> f64, times: usize) -> Measured {
        let rows: Vec<String> = (0..=times)
            .map(|k| {
                let t = k as f64 / times as f64;
                format!("{t},{}", f(t))
            })
            .collect();
        Measured {
            history: Some(Columns::parse(&format!("time,end_ux\n{}", rows.join("\n")))),
            ..Measured::default()
        }
    }

    #[test]
    fn a_history_is_compared_at_the_reference_s_times() {
        let reference = history(|t| 2.0 * t, 100);
        let own = history(|t| 2.1 * t, 37);
        assert_eq!(
            reference.quantities(),
            [Quantity::History("end_ux".to_owned())]
        );
        let e = own.error(&reference, &reference.quantities()[0]).unwrap();
        assert!((e - 0.05).abs() < 1e-12, "{e}");
        assert_eq!(own.error(&reference, &Quantity::Energy), None);
    }

    #[test]
    fn samples_meet_by_position() {
        let table = |f: f64, skip: usize| {
            let rows: Vec<String> = (0..5)
                .filter(|k| *k != skip)
                .map(|k| format!("{k},0,{},{},1,2,3,0", f * k as f64, f))
                .collect();
            Measured {
                samples: BTreeMap::from([(
                    "middle".to_owned(),
                    Columns::parse(&format!("x,y,ux,uy,exx,exy,eyy,model\n{}", rows.join("\n"))),
                )]),
                ..Measured::default()
            }
        };
        let e = |q| table(1.1, 2).error(&table(1.0, 9), &q).unwrap();
        assert!((e(Quantity::Displacement) - 0.1).abs() < 1e-12);
        assert_eq!(e(Quantity::Strain), 0.0);
    }

    #[test]
    fn a_probe_and_a_line_are_found_by_their_names() {
        let rest = |f: f64| Measured {
            samples: BTreeMap::from([
                (
                    "probes".to_owned(),
                    Columns::parse(&format!("x,ux,sxx\n0,3,1\n1,{},{}", 4.0 * f, 2.0 * f)),
                ),
                (
                    "cut".to_owned(),
                    Columns::parse(&format!("x,ux,sxx\n0,1,1\n2,1,{f}")),
                ),
            ]),
            probes: vec!["left".to_owned(), "tip".to_owned()],
            ..Measured::default()
        };
        let e = |q: &str| rest(1.1).error(&rest(1.0), &Quantity::parse(q).unwrap());
        assert!((e("probe:tip.u").unwrap() - 0.1).abs() < 1e-12);
        assert!((e("probe.tip.sxx").unwrap() - 0.1).abs() < 1e-12);
        assert_eq!(e("probe.left.u"), Some(0.0));
        assert!((e("line.cut.sxx").unwrap() - 0.1 / 2f64.sqrt()).abs() < 1e-12);
        assert_eq!(e("line.cut.u"), Some(0.0));
        for missing in ["probe.right.u", "probe.tip.syy", "line.tip.u"] {
            assert_eq!(e(missing), None, "{missing}");
        }
        // in time
        let (reference, own) = (history(|t| 2.0 * t, 10), history(|t| 1.8 * t, 10));
        let at_end = |q: &str| own.error(&reference, &Quantity::parse(q).unwrap()).unwrap();
        assert!((at_end("probe.end.u") - 0.1).abs() < 1e-12);
        assert!((at_end("peak.end_ux") - 0.1).abs() < 1e-12);
        for wrong in ["probe.tip", "colour", "rod.tip.u"] {
            assert!(Quantity::parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn paths_are_compared_as_curves_and_by_arrival() {
        let tips = |f: &dyn Fn(f64) -> (f64, f64, f64)| {
            let rows: Vec<String> = (0..=10)
                .map(|k| {
                    let (t, x, y) = f(k as f64 / 10.0);
                    format!("{k},{t},{x},{y},0.5")
                })
                .collect();
            let table = Columns::parse(&format!("step,time,x,y,damage\n{}", rows.join("\n")));
            Measured {
                tips: [("front".to_owned(), table)].into(),
                ..Measured::default()
            }
        };
        let reference = tips(&|s| (s, 4.0 * s, 0.0));
        // 0.2 beside it, and a tenth later
        let own = tips(&|s| (s + 0.1, 4.0 * s, 0.2));
        let error = |q| own.error(&reference, &q).unwrap();
        assert!((error(Quantity::Path("front".to_owned())) - 0.05).abs() < 1e-12);
        assert!((error(Quantity::TipTime("front".to_owned())) - 0.1).abs() < 1e-12);
        assert_eq!(
            Quantity::parse("tip-time.front").unwrap(),
            Quantity::TipTime("front".to_owned())
        );
        assert!(Quantity::parse("colour").unwrap_err().contains("known"));
    }
}
