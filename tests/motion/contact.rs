//! Two bodies that collide.

use crate::{column, run, write};

/// A strip cut in two; its left half runs into the right one.
const HALVES: &str = r#"
kinematics = "plane-stress"
coupling = "nonlocal"
[mesh.rectangle]
min = [0, 0]
max = [24, 1.5]
x = { cells = 48 }
y = { cells = 3 }
[materials.plate.bond-based]
youngs-modulus = 1
density = 1
[peridynamics]
horizon = 1.5
points.lattice = { spacing = 0.5, origin = [0.25, 0.25] }
[cracks.gap]
segment = { from = [12, -1], to = [12, 4] }
[contact]
radius-factor = 0.9
stiffness-factor = 15
[initial.strike.velocity]
inside = { box = { min = [0, 0], max = [12, 2] } }
x = 0.004
[solve.explicit]
duration = 90
outputs = 1
history-interval = 0.5
[output]
vtu = false
probes.left = { at = [11.75, 0.75] }
probes.right = { at = [12.25, 0.75] }
probes.first = { at = [6.25, 0.75] }
probes.second = { at = [18.25, 0.75] }
"#;

/// Equal bars: the wave of the blow returns from both far ends at once, the first bar stops and the second leaves with all momentum and energy. A strip vibrates a little
/// afterwards, with 1.5 to 2 % of the energy at any step; twice that is allowed.
#[test]
fn equal_bodies_exchange_their_velocities() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "halves.toml", HALVES);
    let said = run(folder.path(), &["halves.toml", "--json"]);
    let history = |name: &str| column(&folder.path().join("out/halves_history.csv"), name);
    // contact is stiffer than bonds, and the stable step knows
    let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
    let stable = summary["motion"]["stable_step"].as_f64().unwrap();
    assert!(stable < 0.6, "{stable}");

    let momentum = history("momentum_x");
    for p in &momentum {
        assert!((p / momentum[0] - 1.0).abs() < 1e-12, "{p} {}", momentum[0]);
    }
    let (kinetic, stored) = (history("kinetic_energy"), history("stored_energy"));
    let before = kinetic[0];
    // 36 square units of plate at half of 0.004²
    assert!((before / (0.5 * 18.0 * 0.004f64.powi(2)) - 1.0).abs() < 1e-12);
    let after = kinetic.last().unwrap() / before;
    assert!((after - 1.0).abs() < 0.04, "{after}");
    for (k, s) in kinetic.iter().zip(&stored) {
        assert!(((k + s) / before - 1.0).abs() < 0.01, "{k} {s}");
    }
    // they touch, at 0.9 of the spacing, and no point passes another
    let gap: Vec<f64> = history("right_ux")
        .iter()
        .zip(&history("left_ux"))
        .map(|(right, left)| 0.5 + right - left)
        .collect();
    let closest = gap.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(closest < 0.45 && closest > 0.4, "{closest}");
    assert!(*gap.last().unwrap() > 0.55, "{gap:?}");
    // mean velocities over the last quarter
    let times = history("time");
    let from = times.iter().position(|t| *t > 67.5).unwrap();
    for (name, expected) in [("first_ux", 0.0), ("second_ux", 1.0)] {
        let u = history(name);
        let mean = (u.last().unwrap() - u[from]) / (times.last().unwrap() - times[from]);
        assert!((mean / 0.004 - expected).abs() < 0.04, "{name}: {mean}");
    }
}

/// Points of bodies with horizons of their own: whichever comes first, contact is as stiff. It was that of the last lattice over the horizon of the first: stable steps of 0.29 and 0.17.
#[test]
fn contact_does_not_depend_on_the_order_of_bodies() {
    let strip = |fine: &str, coarse: &str| {
        format!(
            r#"
kinematics = "plane-stress"
coupling = "truncated"
[mesh.rectangle]
min = [0, 0]
max = [34, 4]
x = {{ cells = 34 }}
y = {{ cells = 4 }}
[materials.plate.bond-based]
youngs-modulus = 1
density = 1
critical-stretch = 0.5
[peridynamics]
horizon = 1.5
points.lattice = {{ spacing = 0.5 }}
[zones]
nonlocal = {{ any = [{{ box = {{ min = [2, -1], max = [10, 5] }} }}, {{ box = {{ min = [13, -1], max = [21, 5] }} }}, {{ box = {{ min = [24, -1], max = [30, 5] }} }}] }}
[zones.bodies.{fine}]
inside = {{ box = {{ min = [2, -1], max = [10, 5] }} }}
spacing = 0.25
horizon = 0.75
[zones.bodies.{coarse}]
inside = {{ box = {{ min = [13, -1], max = [21, 5] }} }}
spacing = 0.5
horizon = 1.5
[cracks.gap]
segment = {{ from = [6, -1], to = [6, 5] }}
[contact]
stiffness-factor = 15
[initial.strike.velocity]
inside = {{ box = {{ min = [0, 0], max = [6, 4] }} }}
x = 0.02
[solve.explicit]
duration = 20
outputs = 1
[output]
vtu = false
"#
        )
    };
    let folder = tempfile::tempdir().unwrap();
    let run_of = |name: &str, text: &str| {
        write(folder.path(), name, text);
        let said = run(folder.path(), &[name, "--json"]);
        let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
        let history = format!("out/{}_history.csv", name.trim_end_matches(".toml"));
        let kinetic = column(&folder.path().join(history), "kinetic_energy");
        let step = summary["motion"]["stable_step"].as_f64().unwrap();
        (step, *kinetic.last().unwrap())
    };
    let first = run_of("first.toml", &strip("a", "b"));
    let second = run_of("second.toml", &strip("b", "a"));
    assert!(
        (first.0 / second.0 - 1.0).abs() < 1e-12,
        "{first:?} {second:?}"
    );
    assert!(
        (first.1 / second.1 - 1.0).abs() < 1e-9,
        "{first:?} {second:?}"
    );
}

/// Two squares of four elements each, the sets A and B of a deck, of which A moves: as elements and as points.
#[test]
fn a_set_of_cells_begins_to_move() {
    let folder = tempfile::tempdir().unwrap();
    let mut deck = "*NODE\n".to_owned();
    for (body, x0) in [0.0, 3.0].iter().enumerate() {
        for k in 0..9 {
            let (x, y) = (x0 + (k % 3) as f64, (k / 3) as f64);
            deck += &format!("{}, {x:?}, {y:?}\n", 9 * body + k + 1);
        }
    }
    for (body, name) in ["A", "B"].iter().enumerate() {
        deck += &format!("*ELEMENT, TYPE=CPS4, ELSET={name}\n");
        for e in 0..4 {
            let a = 9 * body + 3 * (e / 2) + e % 2 + 1;
            deck += &format!(
                "{}, {a}, {}, {}, {}\n",
                4 * body + e + 1,
                a + 1,
                a + 4,
                a + 3
            );
        }
    }
    write(folder.path(), "two.inp", &deck);
    let scene = r#"
kinematics = "plane-stress"
mesh.file.path = "two.inp"
materials.m.bond-based = { youngs-modulus = 10, density = 2 }
initial.a.velocity = { inside.set = "A", x = "3 + 0*y", y = 1 }
solve.explicit = { duration = 0.01, outputs = 1 }
output.vtu = false
"#;
    for (coupling, points) in [
        ("local", ""),
        (
            "nonlocal",
            "peridynamics = { horizon = 1.5, points.lattice = { spacing = 0.5, origin = [0.25, 0.25] } }\n",
        ),
    ] {
        write(
            folder.path(),
            "bar.toml",
            &format!("coupling = \"{coupling}\"\n{points}{scene}"),
        );
        run(folder.path(), &["bar.toml"]);
        // the mass of A is ρ A = 8
        for (name, exact) in [("momentum_x", 24.0), ("momentum_y", 8.0)] {
            let found = column(&folder.path().join("out/bar_history.csv"), name);
            assert!((found[0] - exact).abs() < 1e-12, "{coupling}: {found:?}");
        }
    }
}
