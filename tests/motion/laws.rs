//! Laws that are known by their force states alone: nonlinear bonds, bonds that remember.

use crate::{column, run, table, write};

/// A bar that is pulled at one end, all of its bonds peridynamic where `{coupling}` has points.
const BAR: &str = r#"
kinematics = "bar"
coupling = "{coupling}"
[mesh.line]
min = 0
max = 10
x = { cells = 100 }
[zones.nonlocal]
box = { min = 3, max = 7 }
[materials.m.{law}
density = 1
youngs-modulus = 1000
[peridynamics]
horizon = 0.3
points.lattice = { spacing = 0.1 }
[conditions.left.displacement]
on = "left"
x = 0
[conditions.right.displacement]
on = "right"
x = "0.1*t"
[output]
probes.a = { at = 4.55 }
probes.b = { at = 5.45 }
"#;

pub(crate) const STEPS: &str = "[solve.quasi-static]\nduration = 1\nsteps = 5\ntolerance = 1e-11\n";

pub(crate) fn scene(coupling: &str, law: &str, rest: &str) -> String {
    let scene = BAR.replace("{coupling}", coupling).replace("{law}", law);
    scene + rest
}

/// The history of a scene: a column.
pub(crate) fn history(folder: &std::path::Path, scene: &str, columns: &[&str]) -> Vec<Vec<f64>> {
    write(folder, "bar.toml", scene);
    run(folder, &["bar.toml"]);
    let path = folder.join("out/bar_history.csv");
    columns.iter().map(|c| column(&path, c)).collect()
}

/// Returns the JSON that a run of a scene prints.
pub(crate) fn summary(folder: &std::path::Path, scene: &str) -> serde_json::Value {
    write(folder, "scene.toml", scene);
    serde_json::from_str(&run(folder, &["scene.toml", "--json"])).unwrap()
}

/// A scene is refused for a reason that contains `part`.
pub(crate) fn refused(folder: &std::path::Path, typed: &str, part: &str) {
    write(folder, "refused.toml", typed);
    let output = crate::bondline(folder)
        .args(["run", "refused.toml"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).replace('│', " ");
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(!output.status.success() && said.contains(part), "{said}");
    assert!(!said.contains("panicked"), "{said}");
}

#[test]
fn bonds_that_harden_carry_the_force_of_their_strain() {
    const BETA: f64 = 400.0;
    let law = format!("hardening]\nhardening = {BETA}");
    let folder = tempfile::tempdir().unwrap();
    let typed = scene("truncated", &law, STEPS);
    let found = history(folder.path(), &typed, &["a_ux", "b_ux", "right_reaction_x"]);
    for k in 1..6 {
        // all bonds between the probes have one stretch: their strain
        let strain = (found[1][k] - found[0][k]) / 0.9;
        let force = 1000.0 * strain * (1.0 + BETA * strain * strain);
        let reaction = found[2][k];
        assert!(
            (force - reaction).abs() < 1e-6 * reaction,
            "{k}: {force} {reaction}"
        );
    }
}

#[test]
fn a_bar_that_hardens_manyfold_at_its_supports_is_in_equilibrium_at_rest_and_under_load_steps() {
    // one row of points at each end is held, so that the bonds there stretch far more than the bar
    let law = "hardening]\nhardening = 400";
    let steps = scene("nonlocal", law, STEPS);
    let folder = tempfile::tempdir().unwrap();
    let stepped = history(folder.path(), &steps, &["right_reaction_x"])[0][5];
    let still = steps
        .replace(STEPS, "[solver]\ntolerance = 1e-10\n")
        .replace("\"0.1*t\"", "0.1");
    let summary = summary(folder.path(), &still);
    let reaction = summary["reactions"][1]["force"][0].as_f64().unwrap();
    assert!(
        (reaction - stepped).abs() < 1e-7 * stepped,
        "{reaction} {stepped}"
    );
    // 9.11 without hardening: the ends lack bonds
    assert!(reaction > 9.5, "{reaction}");
}

/// A plate whose sides are turned.
const TURNED: &str = r#"
kinematics = "plane-stress"
coupling = "nonlocal"
[mesh.rectangle]
min = [-1, -1]
max = [1, 1]
x.cells = 16
y.cells = 16
[materials.m.bond-based]
youngs-modulus = 1
density = 1
[peridynamics]
horizon = 0.375
bonds = "exact"
points.lattice = { spacing = 0.125 }
[conditions.turned.displacement]
inside.without = { from = { box = { min = [-1, -1], max = [1, 1] } }, removed = { box = { min = [-0.7, -0.7], max = [0.7, 0.7] } } }
x = "cos(0.5)*x - sin(0.5)*y - x"
y = "sin(0.5)*x + cos(0.5)*y - y"
[output]
probes.a = { at = [0.3125, 0.1875] }
[solver]
tolerance = 1e-10
"#;

#[test]
fn exact_bonds_turn_with_their_supports_in_a_static_scene() {
    let folder = tempfile::tempdir().unwrap();
    let summary = summary(folder.path(), TURNED);
    // a rotation by half a radian costs nothing: bonds linear in the displacement would store (1 − cos 0.5)² of strain
    let energy = summary["energy"].as_f64().unwrap();
    let linear: f64 = (1.0 - 0.5f64.cos()).powi(2);
    assert!(energy.abs() < 1e-12 * linear, "{energy:e}");
    let force = summary["reactions"][0]["force"].as_array().unwrap();
    assert!(force.iter().all(|f| f.as_f64().unwrap().abs() < 1e-9));
}

#[test]
fn a_static_scene_of_exact_bonds_that_nothing_holds_names_its_free_motions() {
    let folder = tempfile::tempdir().unwrap();
    let sliding = TURNED.replace("y = \"sin(0.5)*x + cos(0.5)*y - y\"\n", "");
    refused(folder.path(), &sliding, "translation along y");
}

#[test]
fn a_relaxing_bond_follows_its_hereditary_integral_whatever_the_step() {
    let folder = tempfile::tempdir().unwrap();
    let elastic = scene("nonlocal", "bond-based]", STEPS);
    let rigid = history(folder.path(), &elastic, &["right_reaction_x"])[0][5];
    let (share, time) = (0.4, 0.3);
    let law = format!("viscoelastic-bond]\nrelaxing-share = {share}\nrelaxation-time = {time}");
    for steps in [5, 7, 20] {
        let rest = STEPS.replace("steps = 5", &format!("steps = {steps}"));
        let typed = scene("nonlocal", &law, &rest);
        let columns = ["right_reaction_x", "stored_energy", "external_work"];
        let found = history(folder.path(), &typed, &columns);
        for k in 0..=steps {
            let t = k as f64 / steps as f64;
            let relaxing = time * (1.0 - (-t / time).exp());
            let expected = rigid * ((1.0 - share) * t + share * relaxing);
            let force = found[0][k];
            assert!(
                (force - expected).abs() < 1e-7 * rigid,
                "{steps} {k}: {force} {expected}"
            );
        }
        // what was not stored was dissipated
        let said = run(folder.path(), &["bar.toml", "--json"]);
        let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
        let number = |key: &str| summary["motion"][key].as_f64().unwrap_or(f64::NAN);
        let (work, stored) = (number("external_work"), number("stored_energy"));
        let lost = number("inelastic_energy");
        assert!(lost > 0.02 * work, "{summary}");
        // the trapezoidal rule for the work of the support
        let allowed = 0.5 / (steps * steps) as f64;
        assert!(
            ((stored + lost) / work - 1.0).abs() < allowed,
            "{stored} {lost} {work}"
        );
    }
}

#[test]
fn a_motion_goes_on_from_its_checkpoint_with_what_bonds_remember() {
    let law = "viscoelastic-bond]\nrelaxing-share = 0.5\nrelaxation-time = 0.05";
    let rest = "[initial.u.velocity]\nx = \"sin(pi*x/10)\"\n[solve.explicit]\nduration = 1\noutputs = 4\ncheckpoint-every = 50\n";
    let typed = scene("truncated", law, rest).replace("x = \"0.1*t\"", "x = 0");
    let whole = crate::resumes_with_the_same_bytes(&typed);
    // damped: energy falls, and is accounted for
    let path = whole.path().join("out/bar_history.csv");
    let (kinetic, stored) = (
        column(&path, "kinetic_energy"),
        column(&path, "stored_energy"),
    );
    let lost = column(&path, "dissipated_energy");
    let last = kinetic.len() - 1;
    assert!(kinetic[last] + stored[last] < 0.9 * kinetic[0]);
    let balance = kinetic[last] + stored[last] + lost[last] - kinetic[0];
    assert!(
        balance.abs() < 2e-3 * kinetic[0],
        "{balance} {}",
        kinetic[0]
    );
    assert!(table(&path).1.len() > 4);
}

#[test]
fn scenes_that_would_forget_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let typed = scene("truncated", "hardening]\nhardening = 1", "").replace("\"0.1*t\"", "0.1");
    let refused = |typed: &str, part: &str| refused(folder.path(), typed, part);
    let relaxing = "viscoelastic-bond]\nrelaxing-share = 0.5\nrelaxation-time = 1";
    refused(
        &scene("truncated", relaxing, "").replace("\"0.1*t\"", "0.1"),
        "a static scene has no time",
    );
    for coupling in ["splice", "balanced"] {
        refused(
            &scene(coupling, "hardening]\nhardening = 1", STEPS),
            "finite elements are linear",
        );
    }
    refused(
        &typed.replace("hardening = 1", "hardening = 1e300"),
        "must lie between",
    );
    refused(&typed.replace("hardening = 1", "hardenin = 1"), "hardenin");
    refused(&typed.replace("hardening = 1", ""), "lacks `hardening`");
}
