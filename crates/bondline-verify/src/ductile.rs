//! Ductile failure, [SAND2015-7998] section 6.3.1: the notched bar of aluminium, by scenes of several spacings.
//!
//! The report has a spacing of 0.3 mm and 344 000 points, and prints no numbers but in a figure: damage nucleates on the axis, the failure surface is like a cup, and three spacings give about the same load at failure.

use std::path::Path;

use crate::Effort;
use crate::meshes::scene::Folder;
use crate::observed::{Seen, run_scene_in};
use bondline::{
    observe::report::{Columns, Row, Table},
    progress::Progress,
};

/// Radius of the neck \[mm\].
const NECK: f64 = 6.0;

/// Length of the bar \[mm\].
const LENGTH: f64 = 30.0;

/// Strain per second.
const RATE: f64 = 200.0;

const MESH: &str = include_str!("../../../meshes/notched_bar.msh");
const SCENE: &str = include_str!("../../../examples/notched_bar.toml");

/// The bar of the example with another spacing, run for a time \[s\].
fn bar(spacing: f64, duration: f64) -> Result<Seen, String> {
    let folder = Folder::with(&[("notched_bar.msh", MESH)])?;
    let tips = "\n[output]\nvtu = false\ntips.out = { direction = [1, 0, 0], threshold = 0.01 }\ntips.up = { direction = [0, 0, 1], threshold = 0.35 }\ntips.down = { direction = [0, 0, -1], threshold = 0.35 }\n";
    let text = SCENE.replace("../meshes/notched_bar.msh", "notched_bar.msh") + tips;
    let overrides = [
        format!("peridynamics.horizon={}", 3.0 * spacing),
        format!("peridynamics.points.lattice.spacing={spacing}"),
        format!("solve.explicit.duration={duration}"),
        "solve.explicit.outputs=1".to_owned(),
    ];
    run_scene_in(&text, &overrides, Path::new(folder.path()))
}

/// What a bar did.
struct Pulled {
    /// Largest load \[N\] and nominal strain there.
    peak: [f64; 2],
    /// When the first bond breaks, if one does.
    first: Option<[f64; 2]>,
    /// How far the points that are damaged first lie from the axis \[mm\].
    from_axis: f64,
    /// The nominal strain at which the load has fallen to a tenth of the largest, if it has.
    torn: Option<f64>,
    /// How high and how deep the cracked points lie at the end \[mm\].
    height: f64,
}

fn pulled(seen: &Seen) -> Pulled {
    let rows = seen.columns(
        "history",
        [
            "time",
            "broken_bonds",
            "top_reaction_z",
            "bottom_reaction_z",
        ],
    );
    let rows: Vec<[f64; 3]> = rows
        .iter()
        .map(|[time, broken, top, bottom]| [RATE * time, *broken, 0.5 * (top - bottom)])
        .collect();
    let peak = rows
        .iter()
        .fold([0.0; 2], |best, [strain, _, load]| match *load > best[0] {
            true => [*load, *strain],
            false => best,
        });
    let first = rows.iter().find(|[_, broken, _]| *broken > 0.0);
    let torn = rows
        .iter()
        .find(|[strain, _, load]| *strain > peak[1] && *load < 0.1 * peak[0]);
    let of = |name: &str, column: &str| -> Vec<f64> {
        let found = seen.columns(&format!("tip_{name}"), [column]);
        found.iter().map(|[x]| *x).collect()
    };
    let out = of("out", "x");
    let last = |name: &str| of(name, "z").last().copied().unwrap_or(f64::NAN);
    Pulled {
        peak,
        first: first.map(|[strain, _, load]| [*load, *strain]),
        from_axis: out.first().map_or(f64::NAN, |x| x.abs()),
        torn: torn.map(|[strain, ..]| *strain),
        height: last("up") - last("down"),
    }
}

/// Largest distance of the load at the first broken bond, and of the largest load, from that of the finest spacing.
pub const LOAD_LIMIT: f64 = 0.05;

/// The suite `ductile`.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let spacings: &[f64] = match effort {
        Effort::Quick => &[1.5],
        Effort::Full => &[1.5, 1.0, 0.75],
    };
    progress.stage("notched bar", Some(spacings.len() as u64));
    let mut table = Table::new(
        format!(
            "Notched bar of SAND2015-7998 section 6.3.1, neck {} mm wide and bar {LENGTH} mm long, strained at {RATE}/s until it is torn",
            2.0 * NECK
        ),
        Columns::Full,
    );
    let mut found: Vec<(f64, Pulled)> = Vec::new();
    for &spacing in spacings {
        progress.advance(1);
        let case = format!("spacing {spacing} mm");
        match bar(spacing, DURATION) {
            Ok(seen) => {
                let bar = pulled(&seen);
                table.push(Row::info(&case, "largest load [kN]", bar.peak[0] / 1e3));
                table.push(Row::info(&case, "nominal strain there", bar.peak[1]));
                let [load, strain] = bar.first.unwrap_or([f64::NAN; 2]);
                table.push(Row::info(
                    &case,
                    "load at the first broken bond [kN]",
                    load / 1e3,
                ));
                table.push(Row::info(&case, "nominal strain there", strain));
                table.push(Row::at_most(
                    &case,
                    "first damage from the axis [mm]",
                    bar.from_axis,
                    0.5 * NECK,
                ));
                let torn = bar.torn.unwrap_or(f64::NAN);
                table.push(Row::info(&case, "nominal strain when torn", torn));
                table.push(Row::info(
                    &case,
                    "height of the torn surface [mm]",
                    bar.height,
                ));
                table.push(Row::info(&case, "seconds", seen.seconds));
                found.push((spacing, bar));
            }
            Err(why) => table.push(
                Row::at_most(
                    &case,
                    "first damage from the axis [mm]",
                    f64::NAN,
                    0.5 * NECK,
                )
                .because(why),
            ),
        }
    }
    if let Some((finest, best)) = found.last() {
        for (spacing, bar) in &found[..found.len() - 1] {
            let case = format!("spacing {spacing} mm beside {finest} mm");
            let off = (bar.peak[0] / best.peak[0] - 1.0).abs();
            table.push(Row::info(&case, "largest load, relative difference", off));
            let load = |bar: &Pulled| bar.first.map_or(f64::NAN, |[load, _]| load);
            let off = (load(bar) / load(best) - 1.0).abs();
            table.push(Row::info(
                &case,
                "load at the first broken bond, relative difference",
                off,
            ));
        }
    }
    progress.finish();
    vec![table]
}
