//! A coupled body that spins: elements are linear, and what they cost is told with a number.

use crate::Case;

const SPIN: &str = r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [-1, -1]
max = [1, 1]
x = { cells = 20 }
y = { cells = 20 }
[materials.m.bond-based]
youngs-modulus = 1
density = 1
[peridynamics]
horizon = 0.15
points.lattice = { spacing = 0.05, origin = [0.025, 0.025] }
bonds = "exact"
[zones.nonlocal]
box = { min = [-0.5, -0.5], max = [0.5, 0.5] }
[coupling.truncated]
[initial.spin.velocity]
x = "-0.01*y"
y = "0.01*x"
[solve.explicit]
duration = 8.727
[output]
vtu = false
"#;

#[test]
fn a_rotation_is_warned_of_with_an_estimate_of_what_it_costs() {
    // 5 and 10 degrees at the speed of the start
    for (duration, degrees) in [("8.727", 5.0), ("17.45", 10.0)] {
        let case = Case::new(SPIN);
        let set = format!("solve.explicit.duration={duration}");
        let summary = case.run(&["--set", &set]).unwrap();
        let rotation = &summary["rotation"];
        let angle = rotation["degrees"].as_f64().unwrap();
        assert!((0.75..1.25).contains(&(angle / degrees)), "{angle}");
        let estimate = rotation["energy_error"].as_f64().unwrap();
        let kinetic = summary["motion"]["kinetic_energy"].as_f64().unwrap();
        // ½ ω² ∫ ρ r² over a square of 2 × 2
        let lost = 1.0 - kinetic / (0.5 * 1e-4 * 8.0 / 3.0);
        assert!(
            estimate > lost / 3.0 && estimate < 3.0 * lost,
            "{degrees}: {estimate} {lost}"
        );
        let warnings = summary["warnings"].to_string();
        assert!(
            warnings.contains("what is for small rotations there"),
            "{warnings}"
        );
    }
}

#[test]
fn a_small_rotation_is_not_told_and_a_typed_limit_stops_the_run() {
    let case = Case::new(SPIN);
    let summary = case.run(&["--set", "solve.explicit.duration=2"]).unwrap();
    assert!(summary["rotation"].is_null(), "{summary}");
    let output = case.command("run", &["--set", "solve.explicit.largest-rotation=3"]);
    assert_eq!(output.status.code(), Some(3));
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("beyond largest-rotation"), "{said}");
    assert!(said.contains("has rotated by 3."), "{said}");
    // what has ended takes no further step
    let limit = ["--set", "solve.explicit.largest-rotation=3", "--json"];
    let steps = |more: &[&str]| {
        let checkpoints = ["--checkpoint-every", "1000"];
        let output = case.command("run", &[&limit[..], &checkpoints, more].concat());
        assert_eq!(output.status.code(), Some(3));
        let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        summary["motion"]["time"].as_f64().unwrap()
    };
    let stopped = steps(&[]);
    assert_eq!([stopped; 2], [steps(&["--resume"]), steps(&["--resume"])]);
}

#[test]
fn a_static_scene_that_rotates_is_told_so() {
    let cantilever = r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [10, 1]
x = { cells = 40 }
y = { cells = 4 }
[materials.m.lps]
youngs-modulus = 1000
poisson-ratio = 0.3
[coupling.local]
[conditions.l.displacement]
on = "left"
x = 0
y = 0
[conditions.r.traction]
on = "right"
y = 0.25
"#;
    let summary = Case::new(cantilever).run(&[]).unwrap();
    // the slope of a slender beam at its tip, F l²/(2 E I), less the drop in stiffness of four elements over the height
    let slope = 0.25 * 100.0 / (2.0 * 1000.0 / 12.0);
    let angle = summary["rotation"]["degrees"]
        .as_f64()
        .unwrap()
        .to_radians();
    assert!((0.85..1.02).contains(&(angle.tan() / slope)), "{angle}");
    let small = Case::new(cantilever)
        .run(&["--set", "conditions.r.traction={on=\"right\",y=0.025}"])
        .unwrap();
    assert!(small["rotation"].is_null(), "{small}");
}

#[test]
fn points_alone_whose_bonds_are_linear_are_told_that_they_rotate() {
    let spin = SPIN
        .replace("bonds = \"exact\"\n", "")
        .replace("[coupling.truncated]", "[coupling.nonlocal]")
        .replace("bond-based]", "lps]\npoisson-ratio = 0.3");
    let degrees = |summary: &serde_json::Value| summary["rotation"]["degrees"].as_f64();
    let summary = Case::new(&spin).run(&[]).unwrap();
    let told = degrees(&summary).unwrap();
    // 5 degrees at the speed of the start: linear bodies turn by the arc tangent of the angle
    assert!((4.5..5.5).contains(&told), "{told}");
    let warnings = summary["warnings"].to_string();
    assert!(warnings.contains("use bonds = \\\"exact\\\""), "{warnings}");
    let exact = Case::new(&spin)
        .run(&["--set", "peridynamics.bonds=exact"])
        .unwrap();
    assert!(exact["rotation"].is_null(), "{exact}");
    let limit = ["--set", "solve.explicit.largest-rotation=3"];
    let output = Case::new(&spin).command("run", &limit);
    assert_eq!(output.status.code(), Some(3));
    // both ends are held as by a rigid rotation: nothing strains a body of exact bonds
    let held = spin.split("[initial").next().unwrap().to_owned()
        + "[conditions.a.rotation]\non = \"left\"\ncenter = [0, 0]\nangle = 30\n[conditions.b.rotation]\non = \"right\"\ncenter = [0, 0]\nangle = 30\n";
    let summary = Case::new(&held).run(&[]).unwrap();
    let told = degrees(&summary).unwrap();
    // the free corners turn farther
    assert!((25.0..50.0).contains(&told), "{told}");
}

#[test]
fn a_body_that_only_turns_is_not_out_of_balance() {
    let turned = r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [10, 4]
x = { cells = 40 }
y = { cells = 16 }
[materials.s.neo-hooke]
youngs-modulus = 200
poisson-ratio = 0.3
[zones.nonlocal]
box = { min = [4, 1], max = [6, 3] }
[peridynamics]
horizon = 0.375
points.lattice = { spacing = 0.125 }
[conditions.a.rotation]
on = "left"
center = [5, 2]
angle = 10
[conditions.b.rotation]
on = "right"
center = [5, 2]
angle = 10
"#;
    let summary = Case::new(turned).run(&[]).unwrap();
    let warnings = summary["warnings"].to_string();
    assert!(!warnings.contains("out of balance"), "{warnings}");
}
