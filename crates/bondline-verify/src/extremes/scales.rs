//! Dimensionless results do not depend on units, hardly on the place, and a linear body on the size of its displacements only in proportion.

use super::{
    body::{Body, METHODS, Solved, moved},
    kept,
};
use crate::Effort;
use bondline::{
    observe::{report::TableRow, summary::MotionSummary},
    scene::Source,
};

/// Relative change that rounding may leave under other units.
pub const UNITS_LIMIT: f64 = 1e-10;

/// Relative change a million lengths from the origin: coordinates there have 1e-10 of the length left.
pub const FAR_LIMIT: f64 = 1e-6;

pub(super) fn rows(effort: Effort) -> Vec<TableRow> {
    let mut rows = Vec::new();
    let dimensions: &[usize] = match effort {
        Effort::Quick => &[1, 2],
        Effort::Full => &[1, 2, 3],
    };
    for &dimension in dimensions {
        for coupling in METHODS.iter().chain(&["local", "nonlocal"]) {
            let mut base = Body {
                dimension,
                ..Body::new(coupling)
            };
            if dimension == 3 {
                // two cells, so that the collar of a blending leaves one before the faces that are held and pulled
                (base.cells, base.transition) = (15, 2.0 / 15.0);
            }
            let case = format!("{dimension}D {coupling}");
            match base.solve() {
                Ok(solved) => of(&case, &base, &solved, &mut rows),
                Err(why) => rows.push(kept(&case, "relative residual", Err(why), 1e-10)),
            }
        }
    }
    rows
}

fn of(case: &str, base: &Body, solved: &Solved, rows: &mut Vec<TableRow>) {
    let against = |body: Body, scale: f64| -> Result<f64, String> {
        let mut other = body.solve()?;
        other.samples.iter_mut().for_each(|u| *u *= scale);
        Ok(other.difference(solved))
    };
    let mut worst = Ok(0.0f64);
    for size in [1e-9, 1e-3, 1e3] {
        for modulus in [1e-6, 1.0, 1e15] {
            let changed = against(
                Body {
                    size,
                    modulus,
                    ..base.clone()
                },
                1.0,
            );
            worst = worst.and_then(|w| Ok(w.max(changed?)));
        }
    }
    rows.push(kept(
        case,
        "lengths 1e-9 to 1e3, moduli 1e-6 to 1e15: largest change",
        worst,
        UNITS_LIMIT,
    ));
    rows.push(kept(
        case,
        "a million lengths from the origin: change",
        against(
            Body {
                origin: 1e6,
                ..base.clone()
            },
            1.0,
        ),
        FAR_LIMIT,
    ));
    let mut worst = Ok(0.0f64);
    for stretch in [1e-14, 10.0] {
        let changed = against(
            Body {
                stretch,
                ..base.clone()
            },
            base.stretch / stretch,
        );
        worst = worst.and_then(|w| Ok(w.max(changed?)));
    }
    rows.push(kept(
        case,
        "displacements of 1e-14 and 10 lengths, linear bonds: largest change",
        worst,
        UNITS_LIMIT,
    ));
}

/// Change of the stored energy of a pulse that flies ten lengths, over it. Bonds take differences of displacements (1e-12); elements ½ u·Ku, whose
/// terms are 1e9 times their sum here.
pub const FLIGHT_LIMIT: f64 = 1e-5;

/// Stored over kinetic energy of a slowly turning body: strains by centrifugal forces are of the order of (edge speed over wave speed)², here 2e-4.
pub const TURN_LIMIT: f64 = 1e-3;

/// A free square with bonds that follow the displacement, and fields at the start.
fn free(
    coupling: &'static str,
    bonds: &str,
    start: &str,
    duration: f64,
) -> Result<MotionSummary, String> {
    let body = Body {
        more: format!(
            "{start}[solve.explicit]\nduration = {duration:e}\nstep = {STEP}\noutputs = 1\n[output]\nvtu = false\n"
        ),
        ..Body::new(coupling)
    };
    let scene = body.scene();
    let (head, held) = scene.split_once("[conditions.").unwrap_or((&scene, ""));
    let more = held.split_once("[initial").map_or("", |t| t.1);
    let mut source = Source::new("extreme.toml", format!("{head}[initial{more}"));
    source
        .push_override(&format!("peridynamics.bonds={bonds}"))
        .map_err(|e| e.message().to_owned())?;
    moved(&source)
}

/// Time steps of the free square: the same whether it flies or not.
const STEP: f64 = 0.01;

/// A pulse of so many lengths.
fn pulse(height: f64) -> String {
    format!("[initial.pulse.displacement]\nx = \"{height:e}*exp(-((x-0.5)^2+(y-0.45)^2)/0.04)\"\n")
}

/// Geometrically exact bonds: small and large displacements, flights and turns.
pub(super) fn exact(_: Effort) -> Vec<TableRow> {
    let mut rows = Vec::new();
    let stored = |m: Result<MotionSummary, String>| m.map(|m| m.stored_energy);
    for coupling in METHODS.iter().chain(&["nonlocal"]) {
        let off = |a: Result<f64, String>, b: Result<f64, String>| Ok((a? / b? - 1.0).abs());
        let tiny = 1e-14;
        let stretched = |bonds: &str| {
            let body = Body {
                dimension: 1,
                stretch: 10.0,
                more: "[solve.quasi-static]\nsteps = 1\n[output]\nvtu = false\n".to_owned(),
                ..Body::new(coupling)
            };
            let mut source = Source::new("extreme.toml", body.scene());
            source
                .push_override(&format!("peridynamics.bonds={bonds}"))
                .map_err(|e| e.message().to_owned())?;
            stored(moved(&source))
        };
        rows.push(kept(
            &format!("1D {coupling}, exact bonds, pulled to eleven times the length"),
            "stored energy against linear bonds, which are the same in 1D: change",
            off(stretched("exact"), stretched("linear")),
            UNITS_LIMIT,
        ));
        let small = stored(free(coupling, "exact", &pulse(tiny), 0.5)).map(|e| e / tiny.powi(2));
        let linear = stored(free(coupling, "linear", &pulse(1e-3), 0.5)).map(|e| e * 1e6);
        rows.push(kept(
            &format!("2D {coupling}, exact bonds, a pulse of 1e-14 lengths"),
            "stored energy against linear bonds: change",
            off(small, linear),
            UNITS_LIMIT,
        ));
        let flight = "[initial.flight.velocity]\nx = 20\n";
        let resting = stored(free(coupling, "exact", &pulse(1e-3), 0.5));
        let flying = stored(free(coupling, "exact", &(pulse(1e-3) + flight), 0.5));
        rows.push(kept(
            &format!("2D {coupling}, exact bonds, a pulse in a body that flies ten lengths"),
            "stored energy against one that rests: change",
            off(flying, resting),
            FLIGHT_LIMIT,
        ));
    }
    // turning about a place five lengths off, and let go: it flies on straight, and turns about itself
    let speed = 0.02;
    let turn = format!("[initial.turn.velocity]\nx = \"-{speed}*y\"\ny = \"{speed}*(x+5)\"\n");
    let turned = free("nonlocal", "exact", &turn, std::f64::consts::PI / speed);
    rows.push(kept(
        "2D nonlocal, exact bonds, half a turn on a flight of seventeen lengths",
        "stored over kinetic energy",
        turned.map(|m| m.stored_energy / m.kinetic_energy),
        TURN_LIMIT,
    ));
    rows
}
