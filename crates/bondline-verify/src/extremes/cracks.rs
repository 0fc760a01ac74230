//! Pieces that a growing load leaves to themselves, bodies that it tears apart, and cracks that run close by the seam.

use super::{
    body::{Body, METHODS, moved, sampled},
    kept, refused,
};
use crate::Effort;
use bondline::model::Sampler;
use bondline::observe::report::TableRow;
use bondline::observe::summary::MotionSummary;
use bondline::run::warnings;
use bondline::scene::Source;
use bondline::tensor::Vector;

/// Change of energies where a piece is cut off instead of left out, over them.
pub const PIECE_LIMIT: f64 = 1e-8;

/// Difference of two ways to equilibrium, whose tolerance is 1e-8 of the forces.
pub const WAYS_LIMIT: f64 = 1e-6;

/// Energy that stays in a body that is torn apart, over [`WHOLE`]: ½ u·Ku of a piece that has moved by a tenth, which strained by 1e-2, keeps 1e-13.
pub const TORN_LIMIT: f64 = 1e-9;

/// Energy of the whole body at the critical stretch.
const WHOLE: f64 = 0.5 * 0.02 * 0.02;

/// Change of the opening of a slit, over it, where the seam lies farther off than [`doubts`] warn of.
pub const SEAM_LIMIT: f64 = 0.015;

/// Four cracks around the middle fifth.
fn ring() -> String {
    let sides = [
        ("low", [0.4, 0.4], [0.6, 0.4]),
        ("high", [0.4, 0.6], [0.6, 0.6]),
        ("left", [0.4, 0.4], [0.4, 0.6]),
        ("right", [0.6, 0.4], [0.6, 0.6]),
    ];
    let segment =
        |(name, from, to)| format!("[cracks.{name}.segment]\nfrom = {from:?}\nto = {to:?}\n");
    sides.map(segment).concat()
}

fn loaded(coupling: &'static str, obstacle: &str, method: &str) -> Result<MotionSummary, String> {
    let body = Body {
        more: format!(
            "{obstacle}[solve.quasi-static]\nsteps = 1\nmethod = \"{method}\"\n[output]\nvtu = false\n"
        ),
        ..Body::new(coupling)
    };
    moved(&Source::new("extreme.toml", body.scene()))
}

/// Largest change of stored energy and work, over them.
fn change((a, b): (MotionSummary, MotionSummary)) -> f64 {
    let off = |a: f64, b: f64| (a / b - 1.0).abs();
    off(a.stored_energy, b.stored_energy).max(off(a.external_work, b.external_work))
}

/// A piece within the zone that cracks cut off on all sides, under a load: the rest is as if it were not there.
pub(super) fn pieces(_: Effort) -> Vec<TableRow> {
    let void = "[voids.piece.inside.box]\nmin = [0.4, 0.4]\nmax = [0.6, 0.6]\n";
    let mut rows = Vec::new();
    for coupling in METHODS.iter().chain(&["nonlocal"]) {
        let cut_off = loaded(coupling, &ring(), "implicit");
        let left_out = loaded(coupling, void, "implicit");
        let case = format!("{coupling}, a piece that cracks cut off, under a load");
        let both =
            |a: &Result<MotionSummary, String>, b| a.clone().and_then(|a| Ok(change((a, b?))));
        rows.push(kept(
            &case,
            "energies against a void in its place: change",
            both(&cut_off, left_out),
            PIECE_LIMIT,
        ));
        let relaxed = loaded(coupling, &ring(), "relaxation");
        rows.push(if *coupling == "partial-stress" {
            refused(
                &format!("{case}, by relaxation"),
                relaxed.map(|m| m.stored_energy),
                &["ran away"],
            )
        } else {
            kept(
                &case,
                "energies by relaxation against implicit: change",
                both(&cut_off, relaxed),
                WAYS_LIMIT,
            )
        });
    }
    rows
}

/// A strip across the body, of peridynamics, that breaks from side to side under a growing pull.
fn parted(coupling: &'static str, method: &str, bonds: &str) -> Result<MotionSummary, String> {
    let body = Body {
        more: format!(
            "[solve.quasi-static]\nsteps = 10\nmethod = \"{method}\"\n[output]\nvtu = false\n"
        ),
        ..Body::new(coupling)
    };
    let scene = body.scene();
    let (head, tail) = scene
        .split_once("[conditions.right.displacement]")
        .unwrap_or((&scene, ""));
    let tail = tail.split_once("[solver]").map_or("", |t| t.1);
    let pulled = "[conditions.right.displacement]\non = \"right\"\nx = \"0.1*t\"\ny = 0\n[solver]";
    let mut source = Source::new("extreme.toml", format!("{head}{pulled}{tail}"));
    let bonds = format!("peridynamics.bonds={bonds}");
    let mut keys = vec!["materials.body.bond-based.critical-stretch=0.02", &bonds];
    if coupling != "nonlocal" {
        keys.extend([
            "zones.nonlocal.box.min=[0.3329,-1]",
            "zones.nonlocal.box.max=[0.6671,2]",
            "zones.damage-at-edge=warn",
        ]);
    }
    keys.into_iter()
        .try_for_each(|key| source.push_override(key))
        .map_err(|e| e.message().to_owned())?;
    moved(&source)
}

/// Bodies torn apart: no energy is left.
pub(super) fn torn(effort: Effort) -> Vec<TableRow> {
    let mut cases = vec![("nonlocal", "relaxation", "exact")];
    for coupling in [
        "nonlocal",
        "truncated",
        "splice",
        "blending",
        "partial-stress",
    ] {
        cases.push((coupling, "implicit", "linear"));
        if effort == Effort::Full && coupling != "partial-stress" {
            cases.push((coupling, "relaxation", "linear"));
        }
    }
    let row = |(coupling, method, bonds)| {
        kept(
            &format!("{coupling}, torn apart, {method}, {bonds} bonds"),
            "energy left over that at the critical stretch",
            parted(coupling, method, bonds).map(|m| m.stored_energy.abs() / WHOLE),
            TORN_LIMIT,
        )
    };
    cases.into_iter().map(row).collect()
}

/// A slit of a fifth of the plate, and the edge of the zone so many horizons beyond it.
fn slit(coupling: &str, cells: usize, ratio: usize, horizons: f64) -> String {
    let h = 1.0 / cells as f64;
    let horizon = ratio as f64 * h;
    let reach = horizons * horizon + 1e-4 * h;
    let (low, high) = ([0.4 - reach, 0.5 - reach], [0.6 + reach, 0.5 + reach]);
    let (name, form) = coupling.split_once(' ').unwrap_or((coupling, ""));
    let form = match form {
        "" => String::new(),
        form => format!("form = \"{form}\"\n"),
    };
    let transition = match name {
        "blending" | "balanced" | "partial-stress" => {
            format!("[zones.transition]\naround = {:e}\n", 2.5 * horizon)
        }
        _ => String::new(),
    };
    format!(
        "kinematics = \"plane-strain\"\n[coupling.{name}]\n{form}[mesh.rectangle]\nmin = [0, 0]\nmax = [1, 1]\nx = {{ cells = {cells} }}\ny = {{ cells = {cells} }}\n\
         [materials.body.bond-based]\nyoungs-modulus = 1\n[peridynamics]\nhorizon = {horizon:e}\npoints.lattice = {{ spacing = {h:e}, origin = [{0:e}, {0:e}] }}\n\
         [zones.nonlocal]\nbox = {{ min = {low:?}, max = {high:?} }}\n{transition}[cracks.slit.segment]\nfrom = [0.4, 0.5]\nto = [0.6, 0.5]\n\
         [conditions.bottom.displacement]\non = \"bottom\"\nx = 0\ny = 0\n[conditions.top.displacement]\non = \"top\"\nx = 0\ny = 0.01\n",
        0.5 * h
    )
}

/// Measures the opening of a slit near the seam, against that with a seam three horizons off.
pub(super) fn beside_seam(effort: Effort) -> Vec<TableRow> {
    let mut rows = Vec::new();
    let finenesses: &[(usize, usize)] = match effort {
        Effort::Quick => &[(60, 2)],
        Effort::Full => &[(60, 2), (90, 3), (120, 4)],
    };
    for &(cells, ratio) in finenesses {
        for (coupling, warned) in [
            ("splice", warnings::SPLICE),
            ("blending", 0.0),
            ("balanced", 0.0),
            ("truncated", 0.0),
            ("partial-stress elements", warnings::STRESS_ELEMENTS),
            ("partial-stress meshfree", warnings::MESHFREE),
        ] {
            let h = 1.0 / cells as f64;
            let opening = |horizons: f64| {
                let mut open = f64::NAN;
                sampled(
                    &slit(coupling, cells, ratio, horizons),
                    |sampler: &Sampler<'_, 2>, u| {
                        let at = |y: f64| sampler.displacement(&Vector::<2>::new(0.5, y), u);
                        if let (Some(above), Some(below)) = (at(0.5 + 0.3 * h), at(0.5 - 0.3 * h)) {
                            open = above[1] - below[1];
                        }
                    },
                )
                .map(|()| open)
            };
            let far = opening(3.0);
            for horizons in [1.0, 1.5, 2.0] {
                let change = far
                    .clone()
                    .and_then(|far| Ok((opening(horizons)? / far - 1.0).abs()));
                let case = format!("{coupling}, m = {ratio}, seam {horizons} horizons from a slit");
                let quantity = "opening: change";
                rows.push(match change {
                    Ok(change) if horizons <= warned => {
                        TableRow::info(case, quantity, change).because("a warning tells")
                    }
                    change => kept(&case, quantity, change, SEAM_LIMIT),
                });
            }
        }
    }
    rows
}
