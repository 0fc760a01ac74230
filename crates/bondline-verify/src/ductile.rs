//! Ductile failure: the notched bar of [SAND2015-7998] section 6.3.1, `examples/notched_bar.toml`, beside CalculiX until it tears.

use crate::Effort;
use crate::observed::{Seen, run_scene_with};
use bondline::{
    observe::report::{Columns, Row, Table},
    progress::Progress,
};

const SCENE: &str = include_str!("../../../examples/notched_bar.toml");
const MESH: &str = include_str!("../../../meshes/notched_bar.msh");

/// Load of the bar without failure \[kN\] over its nominal strain: axisymmetric elements of second order in large strains, CalculiX 2.20 (`tests/fixtures/plasticity/notched_bar.py`).
const LOADS: &str = include_str!("../../../tests/fixtures/plasticity/notched_bar_load.csv");

/// Strain per second, and radius of the neck \[mm\].
const RATE: f64 = 200.0;
const NECK: f64 = 6.0;

/// Largest relative distance of the largest load from that of CalculiX.
///
/// With three spacings to the radius of the neck the lattice has less of a section than the bar; the finer spacing comes closer.
pub const PEAK_LIMIT: f64 = 0.06;

/// Largest distance of the first damage from the axis \[mm\].
pub const AXIS_LIMIT: f64 = 0.5 * NECK;

/// Largest share of the work that is not accounted for before the first bond breaks.
pub const BALANCE_LIMIT: f64 = 1e-3;

/// The mean load of the torn bar beyond the nominal strain `TORN`, over the largest one, at most.
pub const LEFT_LIMIT: f64 = 0.6;

/// See [`LEFT_LIMIT`].
const TORN: f64 = 0.095;

/// Largest load \[kN\] by CalculiX.
fn reference() -> f64 {
    let rows = LOADS.lines().filter_map(|line| line.split_once(','));
    let loads = rows.filter_map(|(_, load)| load.parse::<f64>().ok());
    loads.fold(f64::NAN, f64::max)
}

/// The bar of the example, by the spacing of its points and their horizon \[mm\].
fn bar(spacing: f64, horizon: f64) -> Result<Seen, String> {
    let text = SCENE.replace("../meshes/notched_bar.msh", "bar.msh");
    let set = [
        format!("peridynamics.points.lattice.spacing={spacing}"),
        format!("peridynamics.horizon={horizon}"),
        "output.vtu=false".to_owned(),
        "output.tips.out={ direction = [1, 0, 0], threshold = 0.01 }".to_owned(),
    ];
    run_scene_with(&text, &set, &[("bar.msh", MESH)])
}

/// What a bar did.
struct Pulled {
    /// Largest load \[kN\], and the nominal strain there.
    peak: [f64; 2],
    /// Load \[kN\] and nominal strain when the first bond breaks.
    first: [f64; 2],
    /// How far from the axis the first damage is \[mm\].
    from_axis: f64,
    /// Share of the work that is not accounted for before the first bond breaks, and at the end.
    missing: [f64; 2],
    /// Mean load beyond the strain [`TORN`] \[kN\].
    left: f64,
}

/// # Errors
/// A bar whose bonds stand.
fn pulled(seen: &Seen) -> Result<Pulled, String> {
    let columns = [
        "time",
        "top_reaction_z",
        "bottom_reaction_z",
        "broken_bonds",
        "external_work",
    ];
    let energies = ["kinetic_energy", "stored_energy", "dissipated_energy"];
    let rows = seen.columns("history", columns);
    let energies = seen.columns("history", energies);
    let load = |row: &[f64; 5]| 0.5e-3 * (row[1] - row[2]);
    let first = rows.iter().position(|row| row[3] > 0.0);
    let first = first.ok_or("no bond has broken")?;
    let total = |k: usize| energies[k].iter().sum::<f64>();
    let missing = |k: usize| (rows[k][4] + total(0) - total(k)).abs() / rows[k][4];
    let peak = rows.iter().map(|row| [load(row), RATE * row[0]]);
    let torn = rows.iter().filter(|row| RATE * row[0] > TORN);
    let torn: Vec<f64> = torn.map(load).collect();
    let out = seen.columns("tip_out", ["x"]);
    Ok(Pulled {
        peak: peak.fold(
            [0.0; 2],
            |best, row| if row[0] > best[0] { row } else { best },
        ),
        first: [load(&rows[first]), RATE * rows[first][0]],
        from_axis: out.first().map_or(f64::NAN, |[x]| x.abs()),
        missing: [missing(first - 1), missing(rows.len() - 1)],
        left: torn.iter().sum::<f64>() / torn.len() as f64,
    })
}

/// The suite `ductile`.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let spacings: &[f64] = match effort {
        Effort::Quick => &[1.5],
        Effort::Full => &[1.5, 1.0],
    };
    progress.stage("notched bar", Some(spacings.len() as u64));
    let mut table = Table::new(
        "Notched bar of SAND2015-7998 section 6.3.1, horizon two spacings: loads [kN] by the nominal strain, the largest beside CalculiX, first damage on the axis, the load after it",
        Columns::Full,
    );
    for &spacing in spacings {
        progress.advance(1);
        let case = format!("spacing {spacing} mm");
        let seen = bar(spacing, 2.0 * spacing);
        match seen.and_then(|seen| Ok((pulled(&seen)?, seen.seconds))) {
            Ok((bar, seconds)) => {
                let quantity = "largest load";
                table.push(Row::within(
                    &case,
                    quantity,
                    bar.peak[0],
                    reference(),
                    PEAK_LIMIT,
                ));
                table.push(Row::info(&case, "strain at it", bar.peak[1]));
                table.push(Row::info(&case, "load at the first break", bar.first[0]));
                table.push(Row::info(&case, "strain at the first break", bar.first[1]));
                let quantity = "first damage from the axis [mm]";
                table.push(Row::at_most(&case, quantity, bar.from_axis, AXIS_LIMIT));
                let quantity = "work not accounted for before it";
                table.push(Row::at_most(&case, quantity, bar.missing[0], BALANCE_LIMIT));
                table.push(Row::info(&case, "the same at the end", bar.missing[1]));
                let left = bar.left / bar.peak[0];
                let quantity = "load beyond 0.095, over the largest";
                table.push(Row::at_most(&case, quantity, left, LEFT_LIMIT));
                table.push(Row::info(&case, "seconds", seconds));
            }
            Err(why) => {
                let quantity = "first damage from the axis [mm]";
                table.push(Row::at_most(&case, quantity, f64::NAN, AXIS_LIMIT).because(why));
            }
        }
    }
    progress.finish();
    vec![table]
}
