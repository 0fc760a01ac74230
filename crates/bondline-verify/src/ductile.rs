//! Ductile failure: the notched bar of [SAND2015-7998] section 6.3.1, `examples/notched_bar.toml`, beside CalculiX until it tears.

use crate::observed::{Seen, run_scene_with};
use crate::{Effort, tell};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
};

const SCENE: &str = include_str!("../../../examples/notched_bar.toml");
const MESH: &str = include_str!("../../../meshes/notched_bar.msh");

/// The bar with elements outside its notch.
const COUPLED: &str = include_str!("../../../examples/notched_bar_coupled.toml");
const COUPLED_MESH: &str = include_str!("../../../meshes/notched_bar_ends.msh");

/// The mesh with edges of 1.5 mm where both models meet, three spacings of the finer points.
const FINE_COUPLED_MESH: &str = include_str!("../../../meshes/notched_bar_ends_fine.msh");

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

/// Largest share of the work that is not accounted for, at any time of the run.
pub const BALANCE_LIMIT: f64 = 1e-4;

/// The same of coupled bars: 2e-5 until the first bond breaks, at 0.45 mm 1.3e-4 after the load has fallen to a tenth within 12 µs: what flow and drag dissipate is of first order in the step.
pub const COUPLED_BALANCE_LIMIT: f64 = 2e-4;

/// Largest relative distance of loads of the coupled bar from those of points alone.
pub const COUPLED_LIMIT: f64 = 0.05;

/// Spacings of the points \[mm\], strengths of the drag, and the load at the end over that of CalculiX without failure, at most: a neck of eight spacings tears late, one of twelve by half, those of twenty and more by three quarters.
const BARS: [[f64; 3]; 4] = [
    [1.5, 0.02, 0.95],
    [1.0, 0.005, 0.7],
    [0.6, 0.005, 0.35],
    [0.45, 0.005, 0.35],
];

/// Nominal strains and loads \[kN\] by CalculiX.
fn reference() -> Vec<[f64; 2]> {
    let rows = LOADS.lines().filter_map(|line| line.split_once(','));
    let rows = rows.filter_map(|(strain, load)| Some([strain.parse().ok()?, load.parse().ok()?]));
    rows.collect()
}

/// The bar of the example, by the spacing of its points and their horizon \[mm\].
fn bar(spacing: f64, horizon: f64, drag: f64) -> Result<Seen, String> {
    let text = SCENE.replace("../meshes/notched_bar.msh", "bar.msh");
    let set = [
        format!("peridynamics.points.lattice.spacing={spacing}"),
        format!("peridynamics.horizon={horizon}"),
        format!("materials.aluminium.johnson-cook.stabilisation={drag}"),
        "output.vtu=false".to_owned(),
        "output.tips.out={ direction = [1, 0, 0], threshold = 0.01 }".to_owned(),
    ];
    run_scene_with(&text, &set, &[("bar.msh", MESH)])
}

/// Spacings of the points \[mm\], strengths of the drag and meshes of the coupled bars.
const COUPLED_BARS: [(f64, f64, &str); 2] =
    [(1.5, 0.02, COUPLED_MESH), (0.45, 0.005, FINE_COUPLED_MESH)];

/// The bar with elements outside its notch, and points alone on its mesh and its lattice; the horizon is two spacings.
fn coupled_and_alone(
    (spacing, drag, mesh): (f64, f64, &str),
) -> Result<[(Pulled, f64); 2], String> {
    let mut set = vec![
        "output.vtu=false".to_owned(),
        format!("peridynamics.points.lattice.spacing={spacing}"),
        format!("peridynamics.horizon={}", 2.0 * spacing),
        format!("materials.aluminium.johnson-cook.stabilisation={drag}"),
    ];
    let text = COUPLED.replace("../meshes/notched_bar_ends.msh", "bar.msh");
    let mesh = [("bar.msh", mesh)];
    let coupled = run_scene_with(&text, &set, &mesh)?;
    let text = SCENE.replace("../meshes/notched_bar.msh", "bar.msh");
    let [side, end] = [11.0, 15.0].map(|half| 0.5 * spacing - half);
    set.push(format!(
        "peridynamics.points.lattice.origin=[{side}, {side}, {end}]"
    ));
    let alone = run_scene_with(&text, &set, &mesh)?;
    Ok([
        (pulled(&coupled)?, coupled.seconds),
        (pulled(&alone)?, alone.seconds),
    ])
}

/// A coupled bar beside points alone.
fn coupled(bar: (f64, f64, &str)) -> Table {
    let mut table = Table::new(
        "Notched bar coupled outside the notch (truncated) beside points alone on the same lattice: loads [kN] and nominal strains",
        Columns::Full,
    );
    let (spacing, ..) = bar;
    let (case, alone_case) = (
        format!("coupled, {spacing} mm"),
        format!("points alone, {spacing} mm"),
    );
    match coupled_and_alone(bar) {
        Ok([(bar, seconds), (alone, of_points)]) => {
            for (quantity, found, wanted) in [
                ("largest load", bar.peak[0], alone.peak[0]),
                ("load at the first break", bar.first[0], alone.first[0]),
            ] {
                table.push(TableRow::within(
                    &case,
                    quantity,
                    found,
                    wanted,
                    COUPLED_LIMIT,
                ));
            }
            for (case, bar) in [(&case, &bar), (&alone_case, &alone)] {
                table.push(TableRow::info(
                    case,
                    "strain at the first break",
                    bar.first[1],
                ));
                table.push(TableRow::info(case, "load at the end", bar.left[1]));
            }
            let quantity = "work not accounted for, largest share";
            table.push(TableRow::at_most(
                &case,
                quantity,
                bar.missing,
                COUPLED_BALANCE_LIMIT,
            ));
            let quantity = "seconds over those of points alone";
            table.push(TableRow::info(&case, quantity, seconds / of_points));
        }
        Err(why) => {
            table.push(TableRow::at_most(&case, "largest load", f64::NAN, 0.0).because(why));
        }
    }
    table
}

/// Work of a bar for the estimate of the time left: its bonds times its steps.
fn work(spacing: f64) -> u64 {
    (10.0 / spacing.powi(4)).ceil() as u64
}

/// Results of a bar.
struct Pulled {
    /// Largest load \[kN\], and the nominal strain there.
    peak: [f64; 2],
    /// Load \[kN\] and nominal strain when the first bond breaks.
    first: [f64; 2],
    /// Distance of the first damage from the axis \[mm\].
    from_axis: f64,
    /// Largest share of the work that is not accounted for from a tenth of the run on.
    missing: f64,
    /// Nominal strain and load \[kN\] at the end.
    left: [f64; 2],
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
    let last = rows.len() - 1;
    let out = seen.columns("tip_out", ["x"]);
    Ok(Pulled {
        peak: peak.fold(
            [0.0; 2],
            |best, row| if row[0] > best[0] { row } else { best },
        ),
        first: [load(&rows[first]), RATE * rows[first][0]],
        from_axis: out.first().map_or(f64::NAN, |[x]| x.abs()),
        missing: (last / 10..=last).map(missing).fold(0.0, f64::max),
        left: [RATE * rows[last][0], load(&rows[last])],
    })
}

/// A bar of points alone beside CalculiX, whose largest load is `largest`.
fn alone([spacing, drag, left_limit]: [f64; 3], reference: &[[f64; 2]], largest: f64) -> Table {
    let mut table = Table::new(
        "Notched bar of SAND2015-7998 section 6.3.1, horizon two spacings: loads [kN] by the nominal strain, beside CalculiX without failure, first damage on the axis, balance of energy to the end",
        Columns::Full,
    );
    let case = format!("spacing {spacing} mm");
    let seen = bar(spacing, 2.0 * spacing, drag);
    match seen.and_then(|seen| Ok((pulled(&seen)?, seen.seconds))) {
        Ok((bar, seconds)) => {
            let quantity = "largest load";
            table.push(TableRow::within(
                &case,
                quantity,
                bar.peak[0],
                largest,
                PEAK_LIMIT,
            ));
            table.push(TableRow::info(&case, "strain at it", bar.peak[1]));
            table.push(TableRow::info(
                &case,
                "load at the first break",
                bar.first[0],
            ));
            table.push(TableRow::info(
                &case,
                "strain at the first break",
                bar.first[1],
            ));
            let quantity = "first damage from the axis [mm]";
            table.push(TableRow::at_most(
                &case,
                quantity,
                bar.from_axis,
                AXIS_LIMIT,
            ));
            let quantity = "work not accounted for, largest share";
            table.push(TableRow::at_most(
                &case,
                quantity,
                bar.missing,
                BALANCE_LIMIT,
            ));
            let [strain, left] = bar.left;
            table.push(TableRow::info(&case, "load at the end", left));
            // the load of the bar without failure at the same strain
            let whole = reference.iter().find(|row| row[0] >= strain);
            let left = whole.map_or(f64::NAN, |row| left / row[1]);
            let quantity = "load at the end over that without failure";
            table.push(TableRow::at_most(&case, quantity, left, left_limit));
            table.push(TableRow::info(&case, "seconds", seconds));
        }
        Err(why) => {
            let quantity = "first damage from the axis [mm]";
            table.push(TableRow::at_most(&case, quantity, f64::NAN, AXIS_LIMIT).because(why));
        }
    }
    table
}

/// The suite `ductile`. Each table is also reported once its bar has torn: the finest take most of an hour.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let (bars, coupled_bars) = match effort {
        Effort::Quick => (&BARS[..1], &COUPLED_BARS[..1]),
        Effort::Full => (&BARS[..], &COUPLED_BARS[..]),
    };
    let by_points: u64 = bars.iter().map(|bar| work(bar[0])).sum();
    let pairs: u64 = coupled_bars.iter().map(|bar| 2 * work(bar.0)).sum();
    progress.stage("notched bar", Some(by_points + pairs));
    let reference = reference();
    let largest = reference.iter().map(|row| row[1]).fold(0.0, f64::max);
    let mut tables = Vec::new();
    for &bar in bars {
        let table = alone(bar, &reference, largest);
        tell(&table, effort, progress);
        progress.advance(work(bar[0]));
        tables.push(table);
    }
    for &bar in coupled_bars {
        let table = coupled(bar);
        tell(&table, effort, progress);
        progress.advance(2 * work(bar.0));
        tables.push(table);
    }
    progress.finish();
    tables
}
