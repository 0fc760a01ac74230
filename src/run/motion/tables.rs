//! Tables beside the history: the tip of each crack with every row, and the state along each line with every output.

use super::RunOptions;
use super::tips::farthest;
use crate::observe::ObserveError;
use crate::observe::csv::{CsvTable, Entry};
use crate::observe::tip_summary::TipSummary;
use crate::run::solution::Solved;
use crate::run::solution_samples::{SampledSolution, table_header};
use crate::scene::validated::{Output, Tip};
use crate::solve::explicit::State;
use crate::system::SemiDiscrete;
use crate::tensor::{AXES, Vector};

/// The tables of a scene's tips and lines, in the order in which it names them.
pub(super) struct Tables {
    tips: Vec<CsvTable>,
    lines: Vec<CsvTable>,
}

impl Tables {
    /// Of a scene; `open` makes the table of a name and some columns at its place among all.
    ///
    /// # Errors
    /// Those of `open`.
    pub fn new<const D: usize>(
        output: &Output<D>,
        open: impl Fn(&str, Vec<String>, usize) -> Result<CsvTable, ObserveError>,
    ) -> Result<Self, ObserveError> {
        let when = || ["step", "time"].map(str::to_owned).into_iter();
        let of_tip = |tip: &Tip<D>| -> Vec<String> {
            let place = AXES[..D].iter().chain(&["damage"]);
            let integrals = INTEGRALS.iter().filter(|_| tip.domains.is_some());
            let columns = place.chain(integrals).map(|&h| h.to_owned());
            when().chain(columns).collect()
        };
        let tips = output.tips.iter().enumerate();
        let tips = tips.map(|(i, tip)| open(&format!("tip_{}", tip.name), of_tip(tip), i));
        let of_line: Vec<String> = when().chain(table_header::<D>(&output.fields)).collect();
        let lines = output.lines.iter().zip(output.tips.len()..);
        let lines = lines.map(|((name, _), i)| open(name, of_line.clone(), i));
        Ok(Self {
            tips: tips.collect::<Result<_, _>>()?,
            lines: lines.collect::<Result<_, _>>()?,
        })
    }

    /// All tables.
    pub fn iter(&self) -> impl Iterator<Item = &CsvTable> {
        self.tips.iter().chain(&self.lines)
    }

    /// Appends the tips of a state, as far as points are damaged or `integrals` are known there; a table has its header before.
    ///
    /// # Errors
    /// [`ObserveError`] if a row cannot be written.
    pub fn tips<const D: usize>(
        &mut self,
        (output, integrals): (&Output<D>, &[Option<TipSummary>]),
        options: &RunOptions<'_>,
        (state, system): (&State, &dyn SemiDiscrete),
        may_be_damaged: bool,
        positions: impl Fn(usize) -> Vector<D>,
    ) -> Result<(), ObserveError> {
        if self.tips.is_empty() {
            return Ok(());
        }
        if options.writes() {
            self.tips.iter_mut().try_for_each(CsvTable::begin)?;
        }
        let body = system.body_state().filter(|_| may_be_damaged);
        let damage = body.and_then(|body| body.damage());
        for (k, (tip, table)) in output.tips.iter().zip(&mut self.tips).enumerate() {
            let damaged = damage.as_ref().and_then(|damage| {
                let site = farthest(tip, damage, &positions)?;
                Some((positions(site), damage[site]))
            });
            let whole = tip.domains.as_ref().map(|domains| (domains.tip, 0.0));
            let Some((x, damage)) = damaged.or(whole) else {
                continue;
            };
            let mut row = when(state);
            row.extend(x.iter().copied().chain([damage]).map(Entry::from));
            if tip.domains.is_some() {
                let found = integrals.get(k).and_then(Option::as_ref);
                row.extend(of_integrals(found));
            }
            let name = output.table(&format!("tip_{}", tip.name));
            options.keep(&name, table, &row)?;
        }
        Ok(())
    }

    /// Appends a state along each line. Collective.
    ///
    /// # Errors
    /// [`ObserveError`] if a row cannot be written.
    pub fn lines<const D: usize>(
        &mut self,
        output: &Output<D>,
        options: &RunOptions<'_>,
        state: &State,
        solved: &Solved<'_, D>,
    ) -> Result<(), ObserveError> {
        let sees = options.writes() || options.observer.is_some();
        // others have families that the first process asks for
        let is_asked = solved.model.shared_families().is_some();
        if self.lines.is_empty() || !(sees || is_asked) {
            return Ok(());
        }
        let solution = SampledSolution::new(solved, options.ranks);
        for ((name, positions), table) in output.lines.iter().zip(&mut self.lines) {
            for values in solution.rows(positions) {
                let mut row = when(state);
                row.extend(values.into_iter().map(Entry::from));
                options.keep(&output.table(name), table, &row)?;
            }
        }
        Ok(())
    }
}

/// Columns of the integrals at a tip.
const INTEGRALS: [&str; 6] = [
    "energy_release_rate",
    "stress_intensity_1",
    "stress_intensity_2",
    "energy_release_rate_spread",
    "stress_intensity_1_spread",
    "stress_intensity_2_spread",
];

/// Entries of the integrals at a tip; empty ones where its rings leave the body.
fn of_integrals(found: Option<&TipSummary>) -> Vec<Entry> {
    let Some(tip) = found else {
        return vec![Entry::from(""); INTEGRALS.len()];
    };
    let ([k1, k2], [of_k1, of_k2]) = (tip.stress_intensity, tip.stress_intensity_spread);
    let (rate, of_rate) = (tip.energy_release_rate, tip.energy_release_rate_spread);
    [rate, k1, k2, of_rate, of_k1, of_k2]
        .map(Entry::from)
        .to_vec()
}

/// The first entries of a row.
fn when(state: &State) -> Vec<Entry> {
    vec![(state.step as i64).into(), state.time.into()]
}
