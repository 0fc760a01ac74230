//! Numerical stability at the extremes: every row passes, or is refused with a reason; none is silently wrong.
//!
//! | file | what |
//! |---|---|
//! | `body.rs` | a scene made to measure, and the results of its run |
//! | `scales.rs` | units, distance from the origin, size of displacements, bonds that turn |
//! | `laws.rs` | Poisson ratios, m from 1 to 12, continuity through whole m |
//! | `shapes.rs` | thin cells, small families, zones of one point, fragments, cracks through the seam |
//! | `cracks.rs` | pieces cut off and bodies torn apart under a load, cracks beside the seam |
//! | `contrast.rs` | a body that is far stiffer beyond the seam |
//! | `steps.rs` | time steps on either side of the limit, a million of them, bonds in four bytes |
//!
//! Spectra of all couplings, m and kernels are the suite `spectrum`.

mod body;
mod contrast;
mod cracks;
mod laws;
mod scales;
mod shapes;
mod steps;

use crate::Effort;
use bondline::{
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
};
use rayon::prelude::*;

/// Measures one kind of extreme.
type Part = fn(Effort) -> Vec<TableRow>;

/// Runs the suite. Quick: without the million steps, three dimensions only where nothing else tells.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let parts: [(&str, Part); 12] = [
        ("Units and places", scales::rows),
        ("Bonds that turn", scales::exact),
        ("Poisson ratio of an LPS", laws::poisson),
        ("Horizon over spacing", laws::ratio),
        ("Cells and families", shapes::cells_and_families),
        ("Zones", shapes::zones),
        ("Fragments and cracks", shapes::fragments),
        ("Pieces under a load", cracks::pieces),
        ("Bodies torn apart", cracks::torn),
        ("Cracks beside the seam", cracks::beside_seam),
        ("Stiffness beyond the seam", contrast::rows),
        ("Time steps", steps::rows),
    ];
    progress.stage("extremes", Some(parts.len() as u64));
    let tables = parts
        .par_iter()
        .map(|(title, rows)| {
            let mut table = Table::new(*title, Columns::Full);
            table.rows = rows(effort);
            progress.advance(1);
            table
        })
        .collect();
    progress.finish();
    tables
}

/// A result that must keep a limit; a refusal is short, because nothing forbids the case.
fn kept(case: &str, quantity: &str, result: Result<f64, String>, limit: f64) -> TableRow {
    match result {
        Ok(value) => TableRow::at_most(case, quantity, value, limit),
        Err(why) => TableRow::at_most(case, quantity, f64::NAN, limit).because(why),
    }
}

/// A case that must be refused, with all of these words; a result is short.
fn refused(case: &str, result: Result<f64, String>, words: &[&str]) -> TableRow {
    match result {
        Err(why) if words.iter().all(|w| why.contains(w)) => {
            TableRow::refused(case, "refused", why)
        }
        Err(why) => {
            TableRow::at_most(case, "refused otherwise than expected", f64::NAN, 0.0).because(why)
        }
        Ok(value) => TableRow::at_most(case, "not refused; gives", value, f64::NEG_INFINITY),
    }
}
