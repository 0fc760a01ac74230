//! Forces in sections through the body, against what stands beyond them.

use bondline::observe::summary::SectionForce;

use super::{Done, refused, run};

/// A column under its weight of 2 per area, sheared and pulled at its top; points in the middle where a coupling takes a zone.
const COLUMN: &str = r#"
kinematics = "plane-stress"
mesh.rectangle = { min = [0, 0], max = [1, 4], x = { cells = 6 }, y = { cells = 24 } }
materials.m.lps = { youngs-modulus = 1e3, poisson-ratio = 0.3 }
conditions.base.displacement = { on = "bottom", x = 0, y = 0 }
conditions.weight.body-force.y = -2
conditions.top.traction = { on = "top", x = 3, y = 1 }
[output]
vtu = false
sections.base = { point = [0.5, 0], normal = [0, 1] }
sections.middle = { point = [0.5, 1.93], normal = [0, 5] }
sections.below = { point = [0.5, 1.93], normal = [0, -1] }
sections.tilted = { point = [0.5, 2], normal = [0.3, 1] }
sections.about = { point = [0.5, 1.93], normal = [0, 1], about = [2.5, 4] }
"#;

fn section<'a>(done: &'a Done, name: &str) -> &'a SectionForce {
    let mut all = done.summary.sections.iter();
    all.find(|s| s.section == name).unwrap()
}

fn near(found: &SectionForce, exact: [f64; 3], tolerance: f64) {
    let numbers: Vec<f64> = found.numbers().collect();
    for (value, exact) in numbers.iter().zip(exact) {
        assert!((value - exact).abs() < tolerance, "{found:?}: {exact}");
    }
    assert_eq!(numbers.len(), 3);
}

#[test]
fn shear_force_normal_force_and_bending_moment_are_those_of_what_stands_above() {
    let zone = "zones.nonlocal.box={min=[0,1.3],max=[1,2.7]}";
    let blended = "zones={nonlocal={box={min=[0,1.5],max=[1,2.5]}},transition={around=0.5}}";
    for (coupling, zones) in [
        ("local", "zones={}"),
        ("nonlocal", "zones={}"),
        ("splice", zone),
        ("truncated", zone),
        ("blending", blended),
        ("partial-stress", blended),
    ] {
        let points = match coupling {
            "local" => "title=\"no points\"",
            // points where its seam wants them
            "truncated" => "peridynamics.horizon=0.5",
            _ => "peridynamics={horizon=0.35,points={lattice={spacing=0.13}}}",
        };
        let done = run(COLUMN, &[&format!("coupling={coupling}"), points, zones]);
        // forces of a seam that are not in balance belong to the free body too
        let off = &done.summary.out_of_balance_force;
        println!("{coupling}: out of balance {off:?}");
        let middle = section(&done, "middle");
        let weight = -2.0 * (4.0 - 1.93);
        near(middle, [3.0, 1.0 + weight, -3.0 * 2.07], 1e-9);
        // the base holds all of it, the layer of cells that the support ends in too
        near(section(&done, "base"), [3.0, 1.0 - 8.0, -12.0], 1e-9);
        // above the tilted plane the centre of gravity lies beside the axis
        let turned = -2.0 * 0.3 / 12.0;
        near(
            section(&done, "tilted"),
            [3.0, 1.0 - 4.0, -6.0 + turned],
            1e-9,
        );
        let about = -2.0 * (1.0 + weight);
        near(section(&done, "about"), [3.0, 1.0 + weight, about], 1e-9);
        let below = section(&done, "below");
        for (k, off) in off.iter().enumerate() {
            let sum = below.force[k] + middle.force[k];
            assert!((sum - off).abs() < 1e-9, "{coupling}: {sum} {off}");
        }
        for (column, value) in [("middle_force_y", 1.0 + weight), ("middle_moment_z", -6.21)] {
            let told = done.column("scene_sections.csv", column);
            assert!(
                told.len() == 1 && (told[0] - value).abs() < 1e-9,
                "{told:?}"
            );
        }
    }
}

/// The hoop force of a thick ring at its plane of symmetry, whose points lie beside that plane.
#[test]
fn what_a_set_holds_lies_where_the_set_does() {
    let ring = r#"
kinematics = "plane-strain"
mesh.file.path = "MESHES/quarter_ring.msh"
materials.steel.lps = { youngs-modulus = 200, poisson-ratio = 0.25 }
conditions.bottom.symmetry.on = "bottom"
conditions.left.symmetry.on = "left"
conditions.bore.pressure = { on = "bore", value = 0.5 }
peridynamics.horizon = 0.25
zones.nonlocal.ball = { center = [0, 0], radius = 1.45 }
[output]
vtu = false
sections.bottom = { point = [0, 0], normal = [0, 1] }
sections.turned = { point = [0, 1e-3], normal = [0, -1] }
"#;
    for coupling in ["local", "truncated", "nonlocal"] {
        let zones = match coupling {
            "nonlocal" => "zones={}",
            _ => "title=\"a zone\"",
        };
        let done = run(ring, &[&format!("coupling={coupling}"), zones]);
        // p times the inner radius
        let bottom = &section(&done, "bottom").force;
        assert!((bottom[1] - 0.5).abs() < 1e-9, "{coupling}: {bottom:?}");
        // the pressure on what the plane leaves of the bore is some 1e-5
        let turned = &section(&done, "turned").force;
        assert!((turned[1] + 0.5).abs() < 1e-4, "{coupling}: {turned:?}");
    }
}

/// Of two legs, `inside` tells one: its shape holds the whole leg beyond the plane.
#[test]
fn a_shape_picks_one_of_two_legs() {
    let frame = r#"
kinematics = "plane-stress"
coupling = "local"
[mesh.rectangle]
min = [0, 0]
max = [3, 3]
x = { cells = 18 }
y = { cells = 18 }
cutouts.gate = { min = [1, 0], max = [2, 2] }
[materials.m.lps]
youngs-modulus = 1e3
poisson-ratio = 0.3
[conditions.base.displacement]
on = "bottom"
x = 0
y = 0
[conditions.top.traction]
on = "top"
x = 2
y = -1
[output]
vtu = false
sections.left = { point = [0.5, 0.71], normal = [0, -1], inside.box = { min = [0, 0], max = [1, 1] } }
sections.right = { point = [0.5, 0.71], normal = [0, -1], inside.box = { min = [2, 0], max = [3, 1] } }
"#;
    let done = run(frame, &[]);
    let (left, right) = (section(&done, "left"), section(&done, "right"));
    // what the legs exert on the frame is what the top takes, upwards against pressure
    let sum: Vec<f64> = (0..2).map(|k| left.force[k] + right.force[k]).collect();
    assert!(
        (sum[0] + 6.0).abs() < 1e-9 && (sum[1] - 3.0).abs() < 1e-9,
        "{sum:?}"
    );
    // pushed to the right, the frame leans on its right leg
    assert!(right.force[1] > left.force[1] + 1.0, "{left:?} {right:?}");
}

/// A bar that is held, pulled by a load that grows, and of which a part has weight, in load steps.
#[test]
fn load_steps_tell_the_normal_force_of_each() {
    let bar = r#"
kinematics = "bar"
coupling = "nonlocal"
mesh.line = { min = 0, max = 2, x = { cells = 40 } }
materials.m.bond-based.youngs-modulus = 10
peridynamics = { horizon = 0.2, points = { lattice = { spacing = 0.05 } } }
conditions.left.displacement = { on = "left", x = 0 }
conditions.right.traction = { on = "right", x = "3 * t" }
conditions.weight.body-force = { inside = { box = { min = 1, max = 2 } }, x = "t * x" }
solve.quasi-static.steps = 4
[output]
vtu = false
sections.cut = { point = 1.23, normal = 1 }
"#;
    let done = run(bar, &[]);
    let told = done.column("scene_history.csv", "cut_force_x");
    assert_eq!(told.len(), 5);
    for (k, told) in told.iter().enumerate() {
        let t = k as f64 / 4.0;
        let exact = t * (3.0 + 0.5 * (4.0 - 1.23 * 1.23));
        assert!((told - exact).abs() < 1e-7, "{told} {exact}");
    }
    assert_eq!(done.summary.sections[0].force[0], told[4]);
}

/// Behind the front of a wave the normal force is that of the traction at the end, before it nothing.
#[test]
fn a_wave_brings_the_force_of_its_load() {
    let bar = r#"
kinematics = "bar"
coupling = "truncated"
mesh.line = { min = 0, max = 2, x = { cells = 200 } }
materials.m.lps = { youngs-modulus = 4, poisson-ratio = 0, density = 1 }
peridynamics = { horizon = 0.035, points = { lattice = { spacing = 0.01 } } }
zones.nonlocal.box = { min = 0.8, max = 1.2 }
conditions.left.displacement = { on = "left", x = 0 }
conditions.right.traction = { on = "right", x = "0.01 * min(1, t / 0.1)" }
solve.explicit = { duration = 0.9, outputs = 0, history-interval = 0.01 }
[output]
vtu = false
sections.near = { point = 0, normal = 1 }
sections.far = { point = 1, normal = 1 }
"#;
    let done = run(bar, &[]);
    let (time, far) = (
        done.column("scene_history.csv", "time"),
        done.column("scene_history.csv", "far_force_x"),
    );
    // c = 2: the front comes to the middle at 0.5, its full height at 0.6
    let mean = |from: f64, to: f64| {
        let during = time
            .iter()
            .zip(&far)
            .filter(|(t, _)| (from..to).contains(*t));
        let (sum, count) = during.fold((0.0, 0), |(s, n), (_, f)| (s + f, n + 1));
        sum / f64::from(count)
    };
    let (before, behind) = (mean(0.0, 0.45), mean(0.65, 0.9));
    assert!(before.abs() < 1e-5, "{before}");
    assert!((behind - 0.01).abs() < 1e-4, "{behind}");
    // half of the ramp has passed in its middle
    let halfway = mean(0.54, 0.561);
    assert!((halfway - 0.005).abs() < 5e-4, "{halfway}");
    // at the support it is what holds the body
    let near = done.column("scene_history.csv", "near_force_x");
    let held = done.column("scene_history.csv", "left_reaction_x");
    for (near, held) in near.iter().zip(held) {
        assert!((near + held).abs() < 1e-10, "{near} {held}");
    }
}

/// A cantilever that is pressed and bent far: the moment is that of the load at the place that it has moved to, and both sides of a plane have the same.
#[test]
fn moments_are_those_of_the_deformed_body_where_forces_turn_with_it() {
    let beam = r#"
kinematics = "plane-stress"
mesh.rectangle = { min = [0, 0], max = [4, 1], x = { cells = 16 }, y = { cells = 4 } }
materials.m.LAW = { youngs-modulus = 1000, poisson-ratio = 0.3, density = 1 }
conditions.base.displacement = { on = "left", x = 0, y = 0 }
conditions.end.traction = { on = "right", x = "-5 * t", y = "5 * t * (1 + 0 * y)" }
conditions.weight.body-force = { y = "t" }
[output]
vtu = false
probes.end = { at = [4, 0.5] }
sections.beyond = { point = [1.03, 0.5], normal = [1, 0] }
sections.before = { point = [1.03, 0.5], normal = [-1, 0], about = [1.03, 0.5] }
"#;
    let points = "peridynamics={horizon=0.5,bonds=\"exact\",points={lattice={spacing=0.25}}}";
    let steps = "solve.quasi-static.steps=2";
    for (coupling, law, rest) in [
        ("nonlocal", "lps", [points, steps]),
        ("local", "neo-hooke", ["zones={}", steps]),
        ("nonlocal", "lps", [points, "zones={}"]),
    ] {
        let typed = beam.replace("LAW", law);
        let typed = match rest[1] == steps {
            true => typed,
            // at rest, without a time
            false => typed.replace("* t", "").replace("\"t\"", "1"),
        };
        let coupling = format!("coupling={coupling}");
        let done = run(&typed, &[&coupling, rest[0], rest[1]]);
        let (beyond, before) = (section(&done, "beyond"), section(&done, "before"));
        // between points the displacement of the load is interpolated otherwise than the load is shared out
        let near = if law == "lps" { 1e-3 } else { 1e-8 };
        for (a, b) in beyond.numbers().zip(before.numbers()) {
            assert!(
                (a + b).abs() < near * beyond.moment[0],
                "{law} {rest:?}: {beyond:?} {before:?}"
            );
        }
        // a load on the end alone, whose resultant acts in its middle
        let typed = typed.replace("conditions.weight.body-force = { y = \"t\" }\n", "");
        let typed = typed.replace("conditions.weight.body-force = { y = 1 }\n", "");
        let done = run(&typed, &[&coupling, rest[0], rest[1]]);
        let beyond = section(&done, "beyond");
        let end: Vec<f64> = match rest[1] == steps {
            true => ["end_ux", "end_uy"]
                .map(|name| *done.column("scene_history.csv", name).last().unwrap())
                .to_vec(),
            false => ["ux", "uy"]
                .map(|name| done.column("scene_probes.csv", name)[0])
                .to_vec(),
        };
        let exact = 5.0 * (4.0 + end[0] - 1.03) + 5.0 * end[1];
        println!(
            "{law} {rest:?}: {beyond:?}, of the load {exact}, at rest {}",
            5.0 * 2.97
        );
        assert!(end[1] > 1.0, "{end:?}");
        // the mean of the end is nearly its middle
        assert!(
            (beyond.moment[0] / exact - 1.0).abs() < 1e-3,
            "{beyond:?} {exact}"
        );
    }
}

#[test]
fn sections_that_cut_nothing_are_refused() {
    for (typed, parts) in [
        (
            "sections.base={point=[0,4],normal=[0,1]}",
            [
                "output.sections.base",
                "nothing of the body beyond",
                "turn its normal",
            ],
        ),
        (
            "sections.base={point=[0,-1],normal=[0,1]}",
            [
                "output.sections.base",
                "all of the body beyond",
                "into the body",
            ],
        ),
        (
            "sections.base={point=[0,1],normal=[0,0]}",
            ["output.sections.base.normal", "no direction", "[1, 0]"],
        ),
        (
            "sections.base={point=[0,1,2],normal=[0,1]}",
            ["output.sections.base.point", "3 coordinates", "write 2"],
        ),
        (
            "sections.base={point=[0,1],normal=[0,1],inside={set=\"bottom\"}}",
            [
                "output.sections.base.inside",
                "set `bottom`",
                "shape such as `box`",
            ],
        ),
        (
            "lines.sections={from=[0,0],to=[1,1],samples=2}",
            [
                "output.lines.sections",
                "the table of all sections",
                "another name",
            ],
        ),
    ] {
        refused(
            COLUMN,
            &["coupling=local", &format!("output.{typed}")],
            &parts,
        );
    }
}
