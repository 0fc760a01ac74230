//! Warnings of scenes that are drawn, beside what is wrong with their results.
//!
//! | file | content |
//! |---|---|
//! | `corpus.rs` | bodies, laws, couplings, zones and ways to load them, by seeds that are written here |
//! | `outcome.rs` | the error of a run beside elements alone, and what it was told |
//!
//! The truth of a scene are elements of second order alone on its mesh: displacements and stresses along lines through the zone. Nothing that fails is among them.

mod corpus;
mod outcome;

use rayon::prelude::*;

use self::{
    corpus::Case,
    outcome::{Outcome, Run, outcome},
};
use super::{Effort, tell};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
};

/// The tables of scenes, and those of their verdicts, by seed.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let seeds = match effort {
        Effort::Quick => &corpus::SEEDS[..1],
        Effort::Full => &corpus::SEEDS[..],
    };
    let mut tables = Vec::new();
    for &seed in seeds {
        let cases = corpus::cases(effort, seed);
        progress.stage("warnings", Some(cases.len() as u64));
        let found: Vec<Result<Outcome, String>> = (cases.par_iter())
            .map(|case| {
                let found = outcome(case);
                progress.advance(1);
                found
            })
            .collect();
        let of_seed = [
            scenes(&cases, &found, seed),
            verdicts(&cases, &found, seed),
            remedies(&cases, &found, seed),
        ];
        for table in of_seed {
            tell(&table, effort, progress);
            tables.push(table);
        }
    }
    tables
}

/// The remedies of all warnings, tried.
fn remedies(cases: &[Case], found: &[Result<Outcome, String>], seed: u64) -> Table {
    let title = format!("Remedies that the warnings of seed {seed} print, tried");
    let mut table = Table::new(title, Columns::Full);
    let all = cases.iter().zip(found);
    let all = all.filter_map(|(case, found)| Some((case, found.as_ref().ok()?)));
    let tried: Vec<_> = all
        .flat_map(|(case, outcome)| outcome.tried.iter().map(move |t| (case, t)))
        .collect();
    let refused = tried.iter().filter(|(_, t)| t.helps.is_err());
    let in_vain = tried.iter().filter(|(_, t)| t.helps == Ok(false));
    table.push(TableRow::info("all", "remedies", tried.len() as f64));
    for (name, list) in [
        ("refused when tried", refused.collect::<Vec<_>>()),
        ("of no help", in_vain.collect()),
    ] {
        table.push(TableRow::at_most(name, "remedies", list.len() as f64, 0.0));
        for (case, tried) in list {
            let row = TableRow::info(
                format!("  {}: {}", case.name, tried.name),
                "among them",
                1.0,
            );
            let why = tried.helps.clone().err().unwrap_or_default();
            table.push(row.because(&why));
        }
    }
    table
}

/// Errors and warned figures of each scene.
fn scenes(cases: &[Case], found: &[Result<Outcome, String>], seed: u64) -> Table {
    let title = format!(
        "{} scenes drawn by seed {seed}: largest errors along lines through the zone, over the largest value there, and what was told of them",
        cases.len()
    );
    let mut table = Table::new(title, Columns::ByQuantity);
    for (case, found) in cases.iter().zip(found) {
        let name = case.name.as_str();
        match found {
            Err(why) => table.push(TableRow::refused(name, "displacement", why)),
            Ok(found) => {
                let mut row = |quantity: &str, value: Option<f64>| {
                    if let Some(value) = value {
                        table.push(TableRow::info(name, quantity, value));
                    }
                };
                let error = found.run.error();
                row("displacement", error.map(|e| e.displacement));
                row("told", found.run.told().and_then(|t| t.displacement));
                row("stress", error.map(|e| e.stress));
                let there = match found.run {
                    Run::Done { there, .. } => there,
                    Run::Refused { .. } => None,
                };
                row("stress there", there);
                row("told of it", found.run.told().and_then(|t| t.stress));
                row("sentences", found.run.told().map(|t| t.sentences as f64));
            }
        }
    }
    table
}

/// Numbers of scenes by verdict.
fn verdicts(cases: &[Case], found: &[Result<Outcome, String>], seed: u64) -> Table {
    let title = format!("Verdicts on the warnings of seed {seed}");
    let mut table = Table::new(title, Columns::Full);
    let mut row = |name: &str, limit: Option<f64>, is_so: &dyn Fn(&Outcome) -> bool| {
        let all = cases.iter().zip(found);
        let named: Vec<&str> = all
            .filter(|(_, found)| found.as_ref().is_ok_and(is_so))
            .map(|(case, _)| case.name.as_str())
            .collect();
        let count = named.len() as f64;
        table.push(match limit {
            Some(limit) => TableRow::at_most(name, "scenes", count, limit),
            None => TableRow::info(name, "scenes", count),
        });
        for scene in named.into_iter().filter(|_| limit.is_some()) {
            table.push(TableRow::info(format!("  {scene}"), "among them", 1.0));
        }
    };
    row("right", None, &|o| {
        o.run.error().is_some_and(|e| e.is_right())
    });
    row(
        "refused though right",
        Some(0.0),
        &|o| matches!(&o.run, Run::Refused { error: Some(error) } if error.is_right()),
    );
    row(
        "warned though right",
        Some(0.0),
        &Outcome::is_warned_though_right,
    );
    row("silent though wrong over 5 %", Some(0.0), &|o| {
        o.is_silent(outcome::WRONG)
    });
    row("silent though wrong over 1 %", None, &|o| {
        o.is_silent(outcome::RIGHT)
    });
    row(
        "told of more than twice or less than half",
        Some(0.0),
        &Outcome::is_told_falsely,
    );
    table
}
