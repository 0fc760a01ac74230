//! Elements that follow the bonds of the points beside them, by scenes: `elements = "cauchy-born"`.

use super::{bondline, column, run, write};
use std::path::Path;

/// A square meshed by Gmsh, held at one side that moves as `{x}` and `{y}` say.
const SQUARE: &str = r#"
kinematics = "plane-strain"
coupling = "{coupling}"
mesh.file.path = "square.msh"
[materials.m.{law}]
youngs-modulus = 1000
poisson-ratio = 0.3
[peridynamics]
horizon = 1.5
bonds = "exact"
elements = "cauchy-born"
points.lattice = { spacing = 0.5 }
[zones.nonlocal]
box = { min = [7, 7], max = [13, 13] }
[conditions.held.displacement]
{held}
x = "{x}"
y = "{y}"
"#;

const LEFT: &str = "inside.box = { min = [-1, -1], max = [0.01, 21] }";
const ALL: &str = "inside.without = { from = { everywhere = true }, removed = { box = { min = [0.01, 0.01], max = [19.99, 19.99] } } }";

fn square(coupling: &str, law: &str, held: &str, [x, y]: [&str; 2]) -> String {
    let typed = SQUARE
        .replace("{coupling}", coupling)
        .replace("{law}", law)
        .replace("{held}", held)
        .replace("{x}", x)
        .replace("{y}", y);
    let typed = match coupling {
        // elements that carry partial stress take two spacings
        "partial-stress" => typed
            .replace("[conditions", "[zones.transition]\naround = 2\n[conditions")
            .replace("horizon = 1.5", "horizon = 0.75")
            .replace("spacing = 0.5", "spacing = 0.25"),
        _ => typed,
    };
    match law {
        "bond-based" | "hardening" => typed.replace("poisson-ratio = 0.3\n", ""),
        _ => typed,
    }
}

fn folder_with_mesh() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mesh = include_str!("../../meshes/graded_triangles.msh");
    write(folder.path(), "square.msh", mesh);
    folder
}

/// Runs a scene, `s.toml`; what it printed.
fn ran(folder: &Path, typed: &str) -> String {
    write(folder, "s.toml", typed);
    run(folder, &["s.toml"])
}

const TURN: [&str; 2] = [
    "cos(0.5*t)*x - sin(0.5*t)*y - x",
    "sin(0.5*t)*x + cos(0.5*t)*y - y",
];

const QUADRATIC: &str = "coupling = \"partial-stress\"";
/// With this every site has a mass.
const AFFINE: &str = "coupling.partial-stress = { interface = \"affine\" }";

const STEPS: &str = "[solve.quasi-static]\nduration = 1\nsteps = 5\n";

#[test]
fn a_body_that_load_steps_rotate_by_half_a_radian_stores_nothing() {
    for (coupling, law) in [
        ("splice", "lps"),
        ("splice", "bond-based"),
        ("partial-stress", "lps"),
        ("truncated", "bond-based"),
        ("truncated", "lps"),
    ] {
        let folder = folder_with_mesh();
        let typed = square(coupling, law, LEFT, TURN) + STEPS;
        let typed = match coupling {
            "partial-stress" => typed.replace(QUADRATIC, AFFINE).replace(
                "file.path = \"square.msh\"",
                "rectangle = { min = [0, 0], max = [20, 20], x.cells = 40, y.cells = 40 }",
            ),
            _ => typed,
        };
        let energy = |typed: &str| {
            let said = ran(folder.path(), typed);
            let stored = column(&folder.path().join("out/s_history.csv"), "stored_energy");
            (said, stored.last().unwrap().abs())
        };
        let (said, stored) = energy(&typed);
        // over E and the volume: what equilibrium to a tolerance leaves
        assert!(
            stored / (1000.0 * 400.0) < 1e-14,
            "{coupling}, {law}: {stored:e}"
        );
        // a seam of this form tells what it errs by under quadratic fields
        let is_warned = said.contains("warning") && coupling != "partial-stress";
        assert!(!is_warned, "{coupling}, {law}: {said}");
        // linear elements would strain the zone and are warned of
        let linear = typed.replace("\"cauchy-born\"", "\"linear\"");
        let (said, strained) = energy(&linear);
        assert!(said.contains("has rotated by"), "{coupling}, {law}: {said}");
        assert!(strained > 100.0, "{coupling}, {law}: {strained}");
    }
}

#[test]
fn a_large_stretch_with_a_rotation_passes_on_a_mesh_that_does_not_fit() {
    let field = [
        "1.3*cos(0.7)*x - 0.9*sin(0.7)*y - x",
        "1.3*sin(0.7)*x + 0.9*cos(0.7)*y - y",
    ];
    let laws = ["lps", "bond-based", "hardening\nhardening = 3", "pals"];
    let every = ["splice", "partial-stress"].map(|c| laws.map(|law| (c, law)));
    for (coupling, law) in every.concat() {
        let folder = folder_with_mesh();
        let (name, keys) = law.split_once('\n').unwrap_or((law, ""));
        let typed = square(coupling, name, ALL, field)
            .replace("youngs-modulus", &format!("{keys}\nyoungs-modulus"))
            + "[solver]\ntolerance = 1e-12\n[output]\nprobes.a.at = [10.2, 9.9]\nprobes.b.at = [6.9, 10.1]\n";
        ran(folder.path(), &typed);
        let probes = folder.path().join("out/s_probes.csv");
        let [x, y, ux, uy] = ["x", "y", "ux", "uy"].map(|name| column(&probes, name));
        let (cos, sin) = (0.7f64.cos(), 0.7f64.sin());
        for k in 0..2 {
            let wanted = [
                1.3 * cos * x[k] - 0.9 * sin * y[k] - x[k],
                1.3 * sin * x[k] + 0.9 * cos * y[k] - y[k],
            ];
            for (found, wanted) in [ux[k], uy[k]].iter().zip(wanted) {
                let off = (found - wanted).abs();
                assert!(off < 1e-10, "{coupling}, {name}: {found} {wanted}");
            }
        }
    }
}

/// A square plate that spins freely, with a zone in its middle.
const SPIN: &str = r#"
kinematics = "plane-strain"
coupling = "{coupling}"
mesh.rectangle = { min = [0, 0], max = [10, 10], x.cells = 20, y.cells = 20 }
[materials.m.{law}
youngs-modulus = 1
density = 1
[peridynamics]
horizon = 1.5
bonds = "exact"
elements = "cauchy-born"
points.lattice.spacing = 0.5
[zones.nonlocal]
box = { min = [3, 3], max = [7, 7] }
[solve.explicit]
duration = 630
outputs = 4
history-interval = 100
[initial.spin.velocity]
x = "-0.01*(y-5)"
y = "0.01*(x-5)"
"#;

#[test]
fn a_plate_that_spins_keeps_its_energy_over_a_full_turn() {
    for (coupling, law, most) in [
        // a mode of the splice grows by 2.3 within the run
        ("splice", "lps]\npoisson-ratio = 0.3", 1e-3),
        ("partial-stress", "lps]\npoisson-ratio = 0.3", 1e-3),
        ("truncated", "bond-based]", 1e-5),
        ("truncated", "lps]\npoisson-ratio = 0.3", 1e-5),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let history = folder.path().join("out/s_history.csv");
        let least = |typed: &str| {
            let said = ran(folder.path(), typed);
            let [kinetic, stored] =
                ["kinetic_energy", "stored_energy"].map(|name| column(&history, name));
            let all = kinetic.iter().zip(&stored).map(|(k, s)| k + s);
            let off = all
                .map(|e| (e / kinetic[0] - 1.0).abs())
                .fold(0.0, f64::max);
            let least = kinetic.iter().copied().fold(f64::INFINITY, f64::min);
            (said, off, least / kinetic[0])
        };
        let typed = SPIN.replace("{coupling}", coupling).replace("{law}", law);
        let typed = match coupling {
            "partial-stress" => typed
                .replace(QUADRATIC, AFFINE)
                .replace("cells = 20", "cells = 10")
                // a mode of the seam grows by 1000 within a full turn
                .replace("duration = 630", "duration = 315")
                .replace("[solve", "[zones.transition]\naround = 1.5\n[solve"),
            _ => typed,
        };
        let (said, off, least_kinetic) = least(&typed);
        assert!(off < most, "{coupling}: {off:e}");
        // the centrifugal strain takes a little
        assert!(least_kinetic > 0.995, "{coupling}: {least_kinetic}");
        assert!(!said.contains("has rotated by"), "{coupling}: {said}");
    }
}

#[test]
fn what_cannot_follow_the_bonds_is_refused_by_name() {
    let folder = folder_with_mesh();
    let typed = square("splice", "lps", LEFT, ["0", "0"]);
    let refusal = |changes: &[&str]| {
        write(folder.path(), "s.toml", &typed);
        let mut command = bondline(folder.path());
        command.args(["check", "s.toml"]);
        for change in changes {
            command.args(["--set", change]);
        }
        let output = command.output().unwrap();
        assert!(!output.status.success(), "{changes:?} is taken");
        let said = String::from_utf8_lossy(&output.stderr);
        said.split_whitespace()
            .filter(|word| *word != "│")
            .collect::<Vec<_>>()
            .join(" ")
    };
    let around = "zones.transition.around=2";
    for (changes, words) in [
        (&["coupling=local"][..], "no points whose bonds"),
        (&["coupling=nonlocal"], "there are no elements"),
        (
            &["coupling=balanced"],
            "coupling `balanced` at the seam are linear",
        ),
        (
            &["coupling=blending", around],
            "`blending` at the seam are linear",
        ),
        (
            &["peridynamics.bonds=linear"],
            "the bonds themselves are linear",
        ),
        (
            &["peridynamics.weights=fitted"],
            "differ from family to family",
        ),
        (&["peridynamics.horizon=1.5+0.01*x"], "the horizon varies"),
        (&["peridynamics.points=cells"], "whose families differ"),
        (
            &["coupling={truncated={cut-bonds=\"linear\"}}"],
            "cut-bonds",
        ),
        (
            &[
                "coupling=truncated",
                "materials.m={hardening={youngs-modulus=1,hardening=3}}",
            ],
            "to first order only",
        ),
        (
            &["materials.m={neo-hooke={youngs-modulus=1,poisson-ratio=0.3}}"],
            "already have the local law",
        ),
        (
            &[
                "materials.m={softening-bond={youngs-modulus=1,tensile-strength=0.001,fracture-energy=0.001}}",
            ],
            "remember",
        ),
    ] {
        let said = refusal(changes);
        assert!(said.contains(words), "{changes:?}: {said}");
    }
}
