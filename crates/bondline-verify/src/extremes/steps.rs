//! Time steps on either side of the stable one, and very many of them.

use super::{
    body::{Body, moved},
    kept, refused,
};
use crate::Effort;
use bondline::{
    observe::{report::TableRow, summary::MotionSummary},
    scene::Source,
};

/// Energy not accounted for over that at the end. Near the limit velocity Verlet keeps ½ v·Mv + ½ u·Ku only up to (ωΔt/2)² of what the
/// fastest modes hold; what matters is that it stays bounded.
pub const ENERGY_LIMIT: f64 = 0.1;

/// A pulse in a bar.
fn pulse(coupling: &'static str, time: &str) -> Source {
    let mut body = Body {
        dimension: 1,
        cells: 60,
        ..Body::new(coupling)
    };
    body.more = format!(
        "[initial.pulse.displacement]\nx = \"1e-3*exp(-((x-0.2)/0.08)^2)\"\n[solve.explicit]\n{time}outputs = 1\n[output]\nvtu = false\n"
    );
    let scene = body.scene();
    // free ends keep the energy
    let (head, rest) = scene
        .split_once("[conditions.left.displacement]")
        .unwrap_or((&scene, ""));
    let tail = rest.split_once("[solver]").map_or("", |t| t.1);
    let tail = tail.split_once('\n').map_or("", |t| t.1);
    let tail = tail.split_once('\n').map_or("", |t| t.1);
    Source::new("extreme.toml", format!("{head}{tail}"))
}

pub(super) fn rows(effort: Effort) -> Vec<TableRow> {
    let mut rows = Vec::new();
    for coupling in ["local", "nonlocal", "truncated", "splice"] {
        let stable = match moved(&pulse(coupling, "duration = 0.01\n")) {
            Ok(m) => m.stable_step.unwrap_or(f64::NAN),
            Err(why) => {
                rows.push(kept(coupling, "stable step", Err(why), 0.0));
                continue;
            }
        };
        let at = |factor: f64, steps: f64| {
            let step = factor * stable;
            moved(&pulse(
                coupling,
                &format!("duration = {:e}\nstep = {step:e}\n", steps * step),
            ))
        };
        let drift = |m: MotionSummary| {
            let total = m.kinetic_energy + m.stored_energy;
            (m.missing_energy / total).abs()
        };
        let case = format!("1D {coupling}");
        rows.push(kept(
            &case,
            "10 000 steps at 0.999 of the stable one: energy not accounted for",
            at(0.999, 1e4).map(drift),
            ENERGY_LIMIT,
        ));
        rows.push(refused(
            &format!("{case}, 1.001 of the stable step"),
            at(1.001, 100.0).map(|m| m.step),
            &["step"],
        ));
        if effort == Effort::Full && coupling != "splice" {
            rows.push(kept(
                &case,
                "1 000 000 steps at 0.95 of the stable one: energy not accounted for",
                at(0.95, 1e6).map(drift),
                ENERGY_LIMIT,
            ));
        }
    }
    if effort == Effort::Full {
        rows.extend(precision());
    }
    rows
}

/// The branching crack, without its pictures.
const BRANCHING: &str = include_str!("../../../../examples/branching.toml");

/// Energy at the end with bonds in four bytes, over that in eight: a crack that goes another way changes it by parts in a thousand.
const PRECISION_LIMIT: f64 = 1e-6;

/// Weights of bonds in four bytes: the same crack.
fn precision() -> [TableRow; 2] {
    let run = |precision: &str| {
        let mut source = Source::new("branching.toml", BRANCHING);
        for set in ["solve.explicit.outputs=1", precision] {
            source
                .push_override(set)
                .map_err(|e| e.message().to_owned())?;
        }
        moved(&source)
    };
    let both = run("peridynamics.precision=double")
        .and_then(|double| Ok((double, run("peridynamics.precision=single")?)));
    let case = "branching crack, bonds in four bytes";
    let energy = |(double, single): &(MotionSummary, MotionSummary)| {
        (single.kinetic_energy / double.kinetic_energy - 1.0).abs()
    };
    let broken = |(double, single): &(MotionSummary, MotionSummary)| {
        single.broken_bonds.abs_diff(double.broken_bonds) as f64
    };
    [
        kept(
            case,
            "kinetic energy at the end: change",
            both.as_ref().map(energy).map_err(Clone::clone),
            PRECISION_LIMIT,
        ),
        kept(
            case,
            "broken bonds: change",
            both.as_ref().map(broken).map_err(Clone::clone),
            0.0,
        ),
    ]
}
