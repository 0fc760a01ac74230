//! Loads and masses where points of the lattice lie on the faces of the zone.

use crate::Case;

fn force(summary: &serde_json::Value, list: &str, condition: &str) -> Vec<f64> {
    let all = summary[list].as_array().expect("a list");
    let found = all.iter().find(|r| r["condition"] == condition);
    let force = found.expect("the condition is listed")["force"].as_array();
    let force = force.expect("components").iter();
    force.map(|f| f.as_f64().expect("a number")).collect()
}

pub(crate) fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    for (f, e) in found.iter().zip(expected) {
        assert!(
            (f - e).abs() <= tolerance,
            "{found:?} instead of {expected:?}"
        );
    }
}

pub(crate) fn applied(summary: &serde_json::Value, condition: &str) -> Vec<f64> {
    force(summary, "applied", condition)
}

pub(crate) fn reaction(summary: &serde_json::Value, condition: &str) -> Vec<f64> {
    force(summary, "reactions", condition)
}

/// The largest figure of the proof of loads that is a difference from an integral.
pub(crate) fn ledger(summary: &serde_json::Value) -> f64 {
    let parts = summary["proof"].as_array().expect("a proof");
    let part = parts.iter().find(|p| p["name"] == "loads");
    let figures = part.expect("a proof of loads")["figures"].as_array();
    let figures = figures.expect("figures").iter();
    let differences =
        figures.filter(|f| !f["name"].as_str().is_some_and(|n| n.starts_with("support")));
    let each = differences.map(|f| f["value"].as_f64().expect("a number"));
    each.fold(0.0, f64::max)
}

const PLATE: &str = r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [3, 1]
x = { cells = 48 }
y = { cells = 16 }
[materials.m.bond-based]
youngs-modulus = 1
[peridynamics]
horizon = 0.125
points.lattice = { spacing = 0.0625, origin = [0, 0] }
[zones.nonlocal]
box = { min = [1, 0.25], max = [2, 0.75] }
[coupling.truncated]
[conditions.left.displacement]
on = "left"
x = 0
y = 0
[conditions.w.body-force]
x = 1
"#;

#[test]
fn half_cells_at_the_seam_have_their_load() {
    let summary = Case::new(PLATE).run(&[]).expect("it runs");
    close(&applied(&summary, "w"), &[3.0, 0.0], 1e-12);
    close(&reaction(&summary, "left"), &[-3.0, 0.0], 1e-10);
    assert!(ledger(&summary) < 1e-12);
}

#[test]
fn a_body_force_that_varies_has_its_total_and_first_moment_on_every_lattice() {
    // ∫ (2 + x y) over 3 by 1 is 8.25, and a quadratic field is exact in every rule
    let field = r#"conditions.w.body-force={ x = "2 + x*y", y = "y*y" }"#;
    for (coupling, origin) in [
        ("truncated", "[0, 0]"),
        ("truncated", "[0.03125, 0.03125]"),
        ("splice", "[0.011, 0.04]"),
        ("nonlocal", "[0.011, 0.04]"),
    ] {
        let origin = format!("peridynamics.points.lattice.origin={origin}");
        let coupling = format!("coupling={coupling}");
        let summary = Case::new(PLATE).run(&["--set", field, "--set", &origin, "--set", &coupling]);
        let summary = summary.expect("it runs");
        close(&applied(&summary, "w"), &[8.25, 1.0], 1e-11);
        assert!(
            ledger(&summary) < 1e-11,
            "{coupling} {origin}: {}",
            ledger(&summary)
        );
    }
}

#[test]
fn a_bar_falls_freely_as_one() {
    let case = Case::new(
        r#"
kinematics = "bar"
[mesh.line]
min = 0
max = 3
x = { cells = 48 }
[materials.bar.bond-based]
youngs-modulus = 1
density = 1
[peridynamics]
horizon = 0.125
points.lattice = { spacing = 0.0625, origin = [0.0] }
[zones.nonlocal]
box = { min = 1, max = 2 }
[coupling.truncated]
[conditions.g.body-force]
x = -1
[solve.explicit]
duration = 2
"#,
    );
    for coupling in ["truncated", "splice", "balanced", "nonlocal"] {
        for origin in ["[0.0]", "[0.03125]", "[0.02]"] {
            let set = [
                format!("coupling={coupling}"),
                format!("peridynamics.points.lattice.origin={origin}"),
            ];
            let summary = case
                // a splice between the nodes has a mode that grows by exp(0.6) meanwhile: a uniform fall does not wake it
                .run(&["--set", &set[0], "--set", &set[1]])
                .expect("it runs");
            let motion = &summary["motion"];
            let kinetic = motion["kinetic_energy"].as_f64().expect("a number");
            let stored = motion["stored_energy"].as_f64().expect("a number");
            // the mass 3 at the speed 2, and no strain
            assert!((kinetic - 6.0).abs() < 1e-9, "{set:?}: {kinetic}");
            assert!(stored.abs() < 1e-9, "{set:?}: {stored}");
        }
    }
}
