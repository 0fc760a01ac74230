//! Rigid impactors: against wave theory, balances of energy and momentum, equilibrium, and themselves.

use std::path::Path;

use crate::{bondline, column, resumes_with_the_same_bytes, run, same, write};

/// A rigid mass strikes a bar end on; c = ρ = A = 1.
const BAR: &str = r#"
kinematics = "bar"
coupling = "local"
[mesh.line]
min = 0
max = 1
x = { cells = 800 }
[materials.bar.bond-based]
youngs-modulus = 1
density = 1
[solve.explicit]
duration = 1.9
outputs = 1
[impactors.mass]
plane = { point = 0, normal = 1 }
mass = 0.5
velocity = { x = 0.01 }
[output]
vtu = false
"#;

/// The bar of the bar scene made of points, or of both.
fn bar(coupling: &str) -> String {
    let points = "[peridynamics]\nhorizon = 0.00375\npoints.lattice = { spacing = 0.00125 }\n";
    let zone = "[zones]\nnonlocal = { box = { min = [0.0], max = [0.3] } }\n";
    let more = match coupling {
        "local" => String::new(),
        "nonlocal" => points.to_owned(),
        _ => format!("{points}{zone}"),
    };
    let coupling = format!("coupling = \"{coupling}\"");
    BAR.replacen("coupling = \"local\"", &coupling, 1) + &more
}

/// The columns of the history of `bar.toml` in a folder.
fn history(folder: &Path, name: &str) -> Vec<f64> {
    column(&folder.join("out/bar_history.csv"), name)
}

/// The largest part of its first energy by which the balance of a history does not close.
fn imbalance(folder: &Path) -> f64 {
    let of = |name: &str| history(folder, name);
    let (kinetic, stored, work) = (
        of("kinetic_energy"),
        of("stored_energy"),
        of("external_work"),
    );
    let first = kinetic[0] + stored[0];
    let sums = kinetic.iter().zip(&stored).zip(&work);
    sums.map(|((k, s), w)| ((k + s - w) / first - 1.0).abs())
        .fold(0.0, f64::max)
}

/// The wave that a blow sends into a bar resists with `ρ c A v`: until its echo returns, at t = 2 L/c, a mass M has the velocity `v₀ exp(−ρ c A t/M)`, and the force is `ρ c A` times that.
///
/// Tolerances are for 800 cells: the force builds up while a wave passes the penalty and, of points, the end that lacks bonds. Both are as thick as a few cells, and errors fall with them (0.033, 0.009 of
/// the velocity with 200, 800 elements; 0.072, 0.022 of points). Of a single force the sites at the end, which swing on the penalty, tell little: its mean is compared.
#[test]
fn a_mass_that_strikes_a_bar_is_slowed_as_wave_theory_has_it() {
    for (coupling, speed, force, lost) in [
        ("local", 0.015, 0.004, 5e-4),
        ("nonlocal", 0.03, 0.01, 1e-3),
        ("truncated", 0.015, 0.004, 5e-4),
        // exchanges some energy and momentum with its seam
        ("splice", 0.03, 0.01, 2e-3),
    ] {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "bar.toml", &bar(coupling));
        let said = run(folder.path(), &["bar.toml"]);
        assert!(said.contains("impactor mass"), "{said}");
        let (v0, mass) = (0.01, 0.5);
        let times = history(folder.path(), "time");
        let differences = |name: &str| -> Vec<f64> {
            let rows = times.iter().zip(history(folder.path(), name));
            let rows = rows.filter(|(t, _)| **t > 0.1 && **t < 1.85);
            rows.map(|(t, v)| v / v0 - (-t / mass).exp()).collect()
        };
        let worst = differences("mass_vx")
            .iter()
            .fold(0.0, |m: f64, d| m.max(d.abs()));
        assert!(worst < speed, "{coupling}: {worst}");
        let forces = differences("mass_force_x");
        let mean = forces.iter().sum::<f64>() / forces.len() as f64;
        assert!(mean.abs() < force, "{coupling}: mean {mean}");
        let momentum = history(folder.path(), "momentum_x");
        let drift = momentum.iter().map(|p| (p / momentum[0] - 1.0).abs());
        let most = if coupling == "splice" { 1e-4 } else { 1e-12 };
        assert!(drift.fold(0.0, f64::max) < most, "{coupling}");
        assert!((momentum[0] - mass * v0).abs() < 1e-15);
        let found = imbalance(folder.path());
        assert!(found < lost, "{coupling}: {found}");
    }
}

/// Contact begins and ends within a step, which the balance of energy feels; it closes with a power of the step.
#[test]
fn the_balance_of_energy_closes_with_the_step() {
    let lost = |fraction: f64| {
        let folder = tempfile::tempdir().unwrap();
        let typed = BAR.replacen(
            "outputs = 1",
            &format!("outputs = 1\nstep-fraction = {fraction}"),
            1,
        );
        write(folder.path(), "bar.toml", &typed);
        run(folder.path(), &["bar.toml"]);
        imbalance(folder.path())
    };
    let lost = [0.9, 0.45, 0.225].map(lost);
    assert!(
        lost[1] < 0.4 * lost[0] && lost[2] < 0.4 * lost[1],
        "{lost:?}"
    );
}

/// A disc presses on a block in load steps: its force is the reaction of the support, and the work is stored.
const PRESS: &str = r#"
kinematics = "plane-strain"
coupling = "splice"
[mesh.rectangle]
min = [-1, 0]
max = [1, 1]
x = { cells = 20 }
y = { cells = 10 }
[materials.block.lps]
youngs-modulus = 1
poisson-ratio = 0.3
[peridynamics]
horizon = 0.3
points.lattice = { spacing = 0.1 }
[zones]
nonlocal = { box = { min = [-0.5, 0.5], max = [0.5, 1] } }
[solve.quasi-static]
steps = 10
[conditions.base.displacement]
on = "bottom"
x = 0
y = 0
[impactors.punch]
sphere = { center = [0.02, 1.5], radius = 0.5 }
displacement = { y = "-0.05 * t" }
[output]
vtu = false
"#;

#[test]
fn what_presses_is_what_the_support_bears() {
    for (coupling, method, out_of_balance) in [
        ("local", "implicit", 1e-6),
        ("truncated", "implicit", 1e-6),
        ("truncated", "relaxation", 1e-6),
        // whose seam keeps a force of its own, 0.45 % of it here
        ("splice", "implicit", 1e-2),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let typed = PRESS.replacen("splice", coupling, 1).replacen(
            "steps = 10",
            &format!("steps = 10\nmethod = \"{method}\""),
            1,
        );
        write(folder.path(), "bar.toml", &typed);
        run(folder.path(), &["bar.toml"]);
        let of = |name: &str| history(folder.path(), name);
        for axis in ["x", "y"] {
            let (force, reaction) = (
                of(&format!("punch_force_{axis}")),
                of(&format!("base_reaction_{axis}")),
            );
            let most = of("punch_force_y").last().unwrap().abs();
            assert!(most > 1e-3, "{most}");
            for (f, r) in force.iter().zip(&reaction) {
                assert!(
                    (f + r).abs() < out_of_balance * most,
                    "{coupling} {axis}: {f} {r}"
                );
            }
        }
        let place = of("punch_y");
        assert!((place.last().unwrap() - 1.45).abs() < 1e-14);
    }
}

/// The scene of a disc as that of a cylinder, with two cells along its axis.
fn cylinder(plane: &str) -> String {
    plane
        .replace("plane-strain", "solid")
        .replace("mesh.rectangle", "mesh.box")
        .replace("min = [-1, 0]", "min = [-1, 0, 0]")
        .replace("max = [1, 1]\n", "max = [1, 1, 0.2]\nz = { cells = 2 }\n")
        .replace("min = [-0.5, 0.5]", "min = [-0.5, 0.5, 0]")
        .replace("max = [0.5, 1]", "max = [0.5, 1, 1]")
        .replace(
            "sphere = { center = [0.02, 1.5], radius = 0.5 }",
            "cylinder = { point = [0.02, 1.5, 7], direction = [0, 0, -2], radius = 0.5 }",
        )
        + "[conditions.front.symmetry]\non = \"front\"\n[conditions.back.symmetry]\non = \"back\"\n"
}

/// The disc of plane strain and the cylinder of a solid that is held along its axis are one.
#[test]
fn a_cylinder_in_space_is_a_disc_in_the_plane() {
    let plane = PRESS.replacen("splice", "local", 1);
    let solid = cylinder(&plane);
    let forces = [plane, solid].map(|typed| {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "bar.toml", &typed);
        run(folder.path(), &["bar.toml"]);
        history(folder.path(), "punch_force_y")
    });
    let most = forces[0].last().unwrap();
    for (plane, solid) in forces[0].iter().zip(&forces[1]) {
        assert!(
            (plane - solid / 0.2).abs() < 1e-6 * most.abs(),
            "{plane} {solid}"
        );
    }
}

/// A mass that flies the other way.
#[test]
fn an_impactor_that_misses_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let away = BAR
        .replace("x = 0.01 }", "x = -0.01 }")
        .replace("cells = 800", "cells = 8");
    write(folder.path(), "bar.toml", &away);
    let said = run(folder.path(), &["bar.toml"]);
    assert!(
        said.contains("impactor `mass` has not touched the body"),
        "{said}"
    );
}

/// A contact a few sites wide is told, with its width: that of a disc, and of a cylinder, whose length does not count.
#[test]
fn a_contact_that_is_not_resolved_is_told() {
    let warning = |cells: usize, solid: bool| -> (String, u64) {
        let mut typed = PRESS.replacen("splice", "local", 1).replacen(
            "x = { cells = 20 }\ny = { cells = 10 }",
            &format!("x = {{ cells = {} }}\ny = {{ cells = {cells} }}", 2 * cells),
            1,
        );
        // the width is that at the peak, whatever led there
        typed = typed.replacen("steps = 10", "steps = 2", 1);
        if solid {
            typed = cylinder(&typed);
        }
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "bar.toml", &typed);
        let said = run(folder.path(), &["bar.toml", "--json"]);
        let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
        let warnings = summary["warnings"].as_array().unwrap();
        let of_impactor =
            |w: &&serde_json::Value| w["message"].as_str().unwrap().contains("`punch`");
        let warning = warnings.iter().find(of_impactor);
        (
            warning.map_or(String::new(), |w| w["message"].as_str().unwrap().to_owned()),
            summary["motion"]["impactors"][0]["peak_sites"]
                .as_u64()
                .unwrap(),
        )
    };
    let (coarse, touched) = warning(10, false);
    assert!(
        coarse.contains("3 sites wide") && coarse.contains("third"),
        "{coarse}"
    );
    assert_eq!(touched, 3);
    let (solid, all) = warning(10, true);
    assert_eq!((solid, all), (coarse, 3 * touched));
    let (finer, _) = warning(20, false);
    assert!(finer.contains("a tenth"), "{finer}");
    assert_eq!(warning(30, false), (String::new(), 9));
}

/// A ball breaks a plate of points that elements hold, in pieces that touch; a wall drives the other side.
const SHOT: &str = r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [6, 2]
x = { cells = 24 }
y = { cells = 8 }
[materials.plate.bond-based]
youngs-modulus = 1
density = 1
critical-stretch = 0.01
[peridynamics]
horizon = 0.76
points.lattice = { spacing = 0.25 }
[zones]
damage-at-edge = "warn"
nonlocal = { box = { min = [1.5, 0], max = [4.5, 2] } }
[coupling.splice]
[contact]
[conditions.held.displacement]
on = "left"
x = 0
y = 0
[impactors.ball]
sphere = { center = [3, 2.55], radius = 0.5 }
mass = 2
velocity = { x = 0.01, y = -0.15 }
[impactors.wall]
plane = { point = [6.01, 0], normal = [-1, 0.1] }
velocity = { x = "-0.01 * min(1, t / 2)" }
[solve.explicit]
duration = 8
outputs = 4
history-interval = 0.1
checkpoint-every = 40
"#;

#[test]
fn a_shot_resumes_and_has_the_same_bits_on_any_number_of_threads() {
    let whole = resumes_with_the_same_bytes(SHOT);
    let of = |name: &str| history(whole.path(), name);
    assert!(*of("broken_bonds").last().unwrap() > 0.0);
    assert!(of("wall_force_x").iter().any(|f| *f < 0.0));
    assert!(of("ball_force_y").iter().any(|f| *f < 0.0));
    let other = tempfile::tempdir().unwrap();
    write(other.path(), "bar.toml", SHOT);
    run(other.path(), &["bar.toml", "--threads", "3"]);
    same(&whole.path().join("out"), &other.path().join("out"));
}

/// Work of a wall that is driven is external work: what the bodies have of it is missing from nothing.
#[test]
fn a_driven_wall_does_external_work() {
    let folder = tempfile::tempdir().unwrap();
    let typed = BAR.replacen("mass = 0.5\n", "", 1).replacen(
        "x = 0.01",
        "x = \"0.01 * min(1, t / 0.2)\"",
        1,
    );
    write(folder.path(), "bar.toml", &typed);
    run(folder.path(), &["bar.toml"]);
    let of = |name: &str| history(folder.path(), name);
    let (kinetic, stored, work) = (
        of("kinetic_energy"),
        of("stored_energy"),
        of("external_work"),
    );
    let last = work.last().unwrap();
    // the wave has the velocity of the wall: work is ρ c A ∫ v² dt, v = 0.01 from t = 0.2 on
    let expected = 1e-4 * (0.2 / 3.0 + 1.7);
    assert!((last / expected - 1.0).abs() < 0.01, "{last} {expected}");
    for ((k, s), w) in kinetic.iter().zip(&stored).zip(&work) {
        assert!((k + s - w).abs() < 0.002 * last, "{k} {s} {w}");
    }
    let place = of("mass_x");
    // but for the step in which the velocity stops growing
    assert!((place.last().unwrap() - 0.01 * 1.8).abs() < 1e-7);
}

#[test]
fn a_light_impactor_shortens_the_step_and_bounces() {
    let step = |mass: &str| {
        let folder = tempfile::tempdir().unwrap();
        let typed = BAR.replacen("mass = 0.5", &format!("mass = {mass}"), 1);
        write(folder.path(), "bar.toml", &typed);
        let said = run(folder.path(), &["bar.toml", "--json"]);
        let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
        // all energy passes through one contact of a few steps
        assert!(imbalance(folder.path()) < 0.03, "{mass}");
        let momentum = &summary["motion"]["impactors"][0]["momentum"][0];
        let step = summary["motion"]["step"].as_f64().unwrap();
        (step, momentum.as_f64().unwrap())
    };
    let (heavy, _) = step("0.5");
    // lighter than a cell of 1.25e-3
    let (light, momentum) = step("1e-4");
    assert!(light < 0.3 * heavy, "{light} {heavy}");
    assert!(momentum < 0.0, "{momentum}");
}

/// A plane that touches the surface at t = 0, to round-off or by what a place is typed with, presses as one that comes from afar.
#[test]
fn load_steps_begin_with_a_plane_that_touches() {
    let pressed = |coupling: &str, y: f64, way: f64| {
        let folder = tempfile::tempdir().unwrap();
        let typed = format!(
            r#"
kinematics = "plane-stress"
coupling = "{coupling}"
mesh.rectangle = {{ min = [0, 0], max = [2, 1], x = {{ cells = 10 }}, y = {{ cells = 5 }} }}
materials.m.lps = {{ youngs-modulus = 1000, density = 2, poisson-ratio = 0.3 }}
conditions.h.displacement = {{ on = "bottom", x = 0, y = 0 }}
impactors.imp = {{ plane = {{ point = [0, {y:?}], normal = [0, -1] }}, displacement = {{ y = "-{way}*t" }} }}
solve.quasi-static = {{ steps = 2 }}
output.vtu = false
"#
        );
        let points = "[peridynamics]\nhorizon = 0.4\npoints.lattice = { spacing = 0.2, origin = [0.1, 0.1] }\n";
        let typed = match coupling {
            "local" => typed,
            _ => typed + points,
        };
        write(folder.path(), "bar.toml", &typed);
        run(folder.path(), &["bar.toml"]);
        let force = history(folder.path(), "imp_force_y");
        assert!(force[0].abs() < 1e-4, "{coupling}: {force:?}");
        *force.last().unwrap()
    };
    for coupling in ["nonlocal", "local"] {
        let afar = pressed(coupling, 1.01, 0.04);
        for y in [1.0, 1.0 - 1e-10] {
            let force = pressed(coupling, y, 0.03);
            let off = (force / afar - 1.0).abs();
            assert!(off < 1e-6, "{coupling}, {y}: {force} {afar}");
        }
    }
}

/// Checks the message of a scene with an impactor that cannot be run, before any step.
// One function: the cases are a table and share nothing.
#[test]
fn wrong_impactors_say_what_is_wrong() {
    let cases: &[(&str, &str, &str, &str)] = &[
        (
            BAR,
            "plane = { point = 0, normal = 1 }",
            "",
            "exactly one of `sphere`, `cylinder`, `plane`",
        ),
        (
            BAR,
            "plane = { point = 0, normal = 1 }",
            "plane = { point = 0, normal = 1 }\nsphere = { center = -1, radius = 0.5 }",
            "`impactors.mass` has `sphere`, `plane` at once",
        ),
        (
            BAR,
            "normal = 1",
            "normal = 0",
            "`impactors.mass.plane.normal` has no direction",
        ),
        (BAR, "point = 0,", "point = [0, 1],", "has 2 coordinates"),
        (
            BAR,
            "plane = { point = 0, normal = 1 }",
            "cylinder = { point = 0, direction = 1, radius = 1 }",
            "`impactors.mass.cylinder` in a scene of dimension 1",
        ),
        (
            BAR,
            "plane = { point = 0, normal = 1 }",
            "sphere = { center = -1, radius = 0 }",
            "`impactors.mass.sphere.radius` is 0",
        ),
        (
            BAR,
            "mass = 0.5",
            "mass = -1",
            "`impactors.mass.mass` is -1",
        ),
        (
            BAR,
            "mass = 0.5",
            "mass = 0.5\nstiffness-factor = 0",
            "`impactors.mass.stiffness-factor` is 0",
        ),
        (
            BAR,
            "x = 0.01",
            "x = \"t\"",
            "`impactors.mass.velocity.x` depends on the time t",
        ),
        (
            BAR,
            "x = 0.01",
            "x = \"x\"",
            "`impactors.mass.velocity.x` depends on position",
        ),
        (
            BAR,
            "x = 0.01",
            "y = 1",
            "`impactors.mass.velocity.y` in a scene of dimension 1",
        ),
        (
            BAR,
            "mass = 0.5\nvelocity = { x = 0.01 }",
            "velocity = { x = \"1 / t\" }",
            "`impactors.mass.velocity.x` is inf at t = 0",
        ),
        (
            BAR,
            "velocity = { x",
            "displacement = { x",
            "has both `displacement` and `mass`",
        ),
        (
            BAR,
            "mass = 0.5",
            "displacement = { x = 1 }",
            "has both `displacement` and `velocity`",
        ),
        (
            BAR,
            "point = 0,",
            "point = 0.01,",
            "the impactor `mass` lies over the body at time zero, by 1.0000e-2 at (0.0000e0)",
        ),
        (
            BAR,
            "[solve.explicit]\nduration = 1.9\noutputs = 1",
            "[conditions.end.displacement]\non = \"right\"\nx = 0",
            "`impactors.mass` in a static scene",
        ),
        (
            BAR,
            "duration = 1.9",
            "duration = 1.9\nsub-steps = 2",
            "`impactors.mass` and `solve.explicit.sub-steps` are set",
        ),
        (
            BAR,
            "vtu = false",
            "vtu = false\nprobes.mass = { at = 0.5 }",
            "`impactors.mass` and `output.probes.mass` have one name",
        ),
        (
            BAR,
            "kinematics = \"bar\"",
            "accuracy = 0.1\nkinematics = \"bar\"",
            "`impactors.mass` and `accuracy` are set",
        ),
        (
            PRESS,
            "displacement = { y = \"-0.05 * t\" }",
            "mass = 1",
            "`impactors.punch.mass` in load steps",
        ),
        (
            PRESS,
            "displacement = { y =",
            "velocity = { y =",
            "`impactors.punch.velocity` in load steps",
        ),
        (
            SHOT,
            "[conditions.held.displacement]",
            "[output.sections.cut]\npoint = [3, 1]\nnormal = [1, 0]\n[conditions.held.displacement]",
            "`impactors.ball` and `output.sections.cut` are set",
        ),
        (
            SHOT,
            "damage-at-edge",
            "follow = {}\ndamage-at-edge",
            "`impactors.ball` and `zones.follow` are set",
        ),
        (
            SHOT,
            "damage-at-edge = \"warn\"\nnonlocal = { box = { min = [1.5, 0], max = [4.5, 2] } }",
            "auto = {}",
            "`impactors.ball` and `zones.auto` are set",
        ),
    ];
    for (scene, from, to, message) in cases {
        assert!(scene.contains(from), "{from}");
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "bar.toml", &scene.replacen(from, to, 1));
        for command in ["run", "check"] {
            let output = bondline(folder.path())
                .args([command, "bar.toml"])
                .output()
                .unwrap();
            let said = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ");
            assert!(!output.status.success(), "{command}: {to}");
            let flat: String = said.split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(flat.contains(message), "{command}: {message}\n{said}");
            assert!(!said.contains("panicked"), "{said}");
        }
    }
}

/// A body with a round end that is struck there, on a mesh that fits no lattice.
const LUG: &str = r#"
kinematics = "plane-strain"
materials.m.bond-based = { youngs-modulus = 1, density = 1 }
peridynamics = { horizon = 0.06, points.lattice = { spacing = 0.02, origin = [0.007, 0.003] } }
zones = { nonlocal.ball = { center = [0.58, 0.05], radius = 0.12 }, skin = "none" }
conditions.fixed.displacement = { on = "fixed", x = 0, y = 0 }
solve.explicit = { duration = 1.2, outputs = 0 }
output.vtu = false
[impactors.shot]
sphere = { center = [0.905, 0.02], radius = 0.3 }
mass = 0.05
velocity = { x = -0.02 }
"#;

#[test]
fn a_zone_with_a_rim_of_its_own_is_struck_like_points_alone() {
    let momentum = |coupling: &str| {
        let folder = tempfile::tempdir().unwrap();
        let mesh = concat!(env!("CARGO_MANIFEST_DIR"), "/../../meshes/lug.msh");
        let scene = format!("coupling = \"{coupling}\"\nmesh.file.path = \"{mesh}\"\n{LUG}");
        write(folder.path(), "lug.toml", &scene);
        run(folder.path(), &["lug.toml"]);
        let speed = column(&folder.path().join("out/lug_history.csv"), "shot_vx");
        0.05 * (speed[speed.len() - 1] + 0.02)
    };
    let (coupled, points) = (momentum("truncated"), momentum("nonlocal"));
    println!("{coupled:e} {points:e}");
    assert!((coupled / points - 1.0).abs() < 5e-3, "{coupled} {points}");
}
