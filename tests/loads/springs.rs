//! Springs to the ground: a bar, a body that is nearly rigid, a beam on an elastic foundation, a mass that swings.

use super::{read, refused, run};

const BAR: &str = r#"
kinematics = "bar"
mesh.line = { min = 0, max = 2, x = { cells = 40 } }
materials.m.lps = { youngs-modulus = 10, poisson-ratio = 0, density = 1 }
conditions.left.spring = { on = "left", x = 5 }
conditions.right.traction = { on = "right", x = "3 * load(t)" }
tables.load.points = [[0, 0], [1, 1]]
[output]
vtu = false
probes.middle.at = 1
sections.cut = { point = 1, normal = 1 }
"#;

const ZONE: &str = "zones.nonlocal.box={min=0.6,max=1.4}";

/// The couplings, each with its points and zone.
fn couplings(points: &str, fitting: &str, zone: &str) -> Vec<[String; 3]> {
    let all = ["local", "splice", "truncated", "nonlocal"];
    let of = |coupling: &str| {
        let (points, zone) = match coupling {
            "local" => ("title=\"no points\"", "zones={}"),
            "nonlocal" => (points, "zones={}"),
            // points where its seam wants them
            "truncated" => (fitting, zone),
            _ => (points, zone),
        };
        [
            format!("coupling={coupling}"),
            points.to_owned(),
            zone.to_owned(),
        ]
    };
    all.into_iter().map(of).collect()
}

#[test]
fn a_bar_on_a_spring_moves_by_both() {
    let points = "peridynamics={horizon=0.16,points={lattice={spacing=0.05}}}";
    for set in couplings(points, points, ZONE) {
        let mut set: Vec<&str> = set.iter().map(String::as_str).collect();
        set.push("conditions.right.traction.x=3");
        let done = run(BAR, &set);
        // F/k + F x / E; where points bear the ends, these are softer
        let u = done.column("scene_probes.csv", "ux")[0];
        let off = (u - (3.0 / 5.0 + 3.0 / 10.0)).abs();
        println!("{}: {off:.1e}", set[0]);
        let limit = if set[0] == "coupling=nonlocal" {
            0.03
        } else {
            1e-9
        };
        assert!(off < limit, "{set:?}: {u}");
        assert!((done.reaction("left")[0] + 3.0).abs() < 1e-9);
        let force = done.summary.sections[0].force[0];
        assert!((force - 3.0).abs() < 1e-9, "{force}");
        let balance = done.summary.out_of_balance_force[0];
        assert!(balance.abs() < 1e-9, "{balance}");
    }
}

/// In load steps the springs take force and energy with the load.
#[test]
fn load_steps_work_against_springs() {
    for (coupling, bonds) in [
        ("local", "exact"),
        ("nonlocal", "linear"),
        ("nonlocal", "exact"),
    ] {
        let mut set = vec!["solve.quasi-static.steps=4".to_owned()];
        set.push(format!("coupling={coupling}"));
        if coupling == "nonlocal" {
            set.push(format!(
                "peridynamics={{horizon=0.16,bonds=\"{bonds}\",points={{lattice={{spacing=0.05}}}}}}"
            ));
        }
        // strains of 3e-7, at which exact bonds are linear
        set.push("conditions.right.traction.x=\"3e-6*load(t)\"".to_owned());
        let set: Vec<&str> = set.iter().map(String::as_str).collect();
        let done = run(BAR, &set);
        let history = |name: &str| done.column("scene_history.csv", name);
        let (reaction, force) = (history("left_reaction_x"), history("cut_force_x"));
        for (k, (reaction, force)) in reaction.iter().zip(&force).enumerate() {
            let load = 3e-6 * k as f64 / 4.0;
            assert!((reaction + load).abs() < 1e-12, "{k}: {reaction}");
            assert!((force - load).abs() < 1e-12, "{k}: {force}");
        }
        let (work, stored) = (history("external_work"), history("stored_energy"));
        assert!(
            work[4] > 0.0 && (work[4] / stored[4] - 1.0).abs() < 1e-5,
            "{work:?} {stored:?}"
        );
        assert!((done.reaction("left")[0] + 3e-6).abs() < 1e-12);
    }
}

/// A plate, stiff beside its springs, whose lattice fits neither it nor its mesh.
const PLATE: &str = r#"
kinematics = "plane-stress"
mesh.rectangle = { min = [0, 0], max = [3, 1], x = { cells = 18 }, y = { cells = 6 } }
materials.m.lps = { youngs-modulus = 1e7, poisson-ratio = 0.3 }
conditions.soil.spring = { on = "bottom", normal = 4 }
conditions.wall.spring = { inside.box = { min = [2, 0], max = [3, 1] }, x = 6 }
conditions.top.traction = { on = "top", x = 0.5, y = "-1 - x" }
[output]
vtu = false
probes.left.at = [0, 0]
probes.right.at = [3, 0]
"#;

#[test]
fn a_rigid_body_sinks_and_turns_on_its_springs() {
    let points = "peridynamics={horizon=0.36,points={lattice={spacing=0.13}}}";
    for set in couplings(
        points,
        "peridynamics.horizon=0.5",
        "zones.nonlocal.box={min=[0.9,0],max=[2.3,1]}",
    ) {
        let set: Vec<&str> = set.iter().map(String::as_str).collect();
        let done = run(PLATE, &set);
        // soil: 4 per length; wall: 6 per area of [2, 3] × [0, 1]; loads 1.5, −(3 + 4.5), about the middle of the base
        let (k, wall) = (4.0, 6.0);
        let (fx, fy) = (1.5, -7.5);
        // moment of the loads about (1.5, 0): −∫ (x − 1.5)(1 + x) dx − 1 · 1.5
        let moment = -2.25 - 1.5;
        // rotation θ and displacement (a, b) of (1.5, 0): u = a − θ y, v = b + θ (x − 1.5)
        let (area, first, second) = (wall, wall * 0.5, wall / 3.0);
        let turning = k * 27.0 / 12.0;
        // [area, −first; −first, second + turning] [a; θ] = [fx; moment]
        let det = area * (second + turning) - first * first;
        let a = (fx * (second + turning) + first * moment) / det;
        let theta = (area * moment + first * fx) / det;
        let b = fy / (k * 3.0);
        let (ux, uy) = (
            done.column("scene_probes.csv", "ux"),
            done.column("scene_probes.csv", "uy"),
        );
        println!("{}: {ux:?} {a} {uy:?} {b} {theta}", set[0]);
        // forces of a splice are not in balance, nor are their moments
        let is_balanced = set[0] != "coupling=splice";
        for (u, exact) in [
            (ux[0], a),
            (uy[0], b - 1.5 * theta),
            (uy[1], b + 1.5 * theta),
        ] {
            let off = (u / exact - 1.0).abs();
            assert!(off < 1e-4 || !is_balanced, "{set:?}: {u} {exact}");
        }
        // what the seam of a splice leaves over, springs take
        let off = done.summary.out_of_balance_force.clone();
        let (soil, wall) = (done.reaction("soil"), done.reaction("wall"));
        for (k, load) in [fx, fy].into_iter().enumerate() {
            let sum = soil[k] + wall[k] + load;
            assert!((sum - off[k]).abs() < 1e-7, "{set:?}: {sum} {off:?}");
        }
    }
}

/// A simply supported beam under a sine load on an elastic foundation.
#[test]
fn a_beam_on_an_elastic_foundation_is_that_of_winkler() {
    let beam = r#"
kinematics = "plane-stress"
coupling = "local"
mesh.rectangle = { min = [0, -0.5], max = [40, 0.5], x = { cells = 80 }, y = { cells = 2 }, cell = "quad8" }
materials.m.lps = { youngs-modulus = 1e4, poisson-ratio = 0.25 }
conditions.left.displacement = { on = "left", y = 0 }
conditions.right.displacement = { on = "right", y = 0 }
conditions.slide.spring = { inside.everywhere = true, x = 1e-4 }
conditions.soil.spring = { on = "bottom", y = 0.03 }
conditions.load.traction = { on = "top", y = "-1e-3 * sin(pi * x / 40)" }
[output]
vtu = false
probes.middle.at = [20, 0]
"#;
    let w = run(beam, &[]).column("scene_probes.csv", "uy")[0];
    let wave = (std::f64::consts::PI / 40.0).powi(2);
    // bending, softened by shear: κ = 5/6, G = 4000
    let (bending, shear) = (1e4 / 12.0, 5.0 / 6.0 * 4e3);
    let stiffness = bending * wave * wave / (1.0 + bending * wave / shear) + 0.03;
    let exact = -1e-3 / stiffness;
    println!("{w} {exact}");
    assert!((w / exact - 1.0).abs() < 3e-3, "{w} {exact}");
    // without the soil it bends about twice as far
    let without = run(beam, &["conditions.soil.spring.y=1e-9"]);
    let bare = without.column("scene_probes.csv", "uy")[0];
    assert!(bare / w > 1.8, "{bare}");
}

/// A bar that is stiff beside its spring swings on it, and no energy is lost.
#[test]
fn a_mass_on_a_spring_swings_with_its_period() {
    let bar = r#"
kinematics = "bar"
mesh.line = { min = 0, max = 1, x = { cells = 20 } }
materials.m.lps = { youngs-modulus = 4e3, poisson-ratio = 0, density = 1 }
conditions.left.spring = { on = "left", x = 1 }
initial.push.velocity.x = 0.01
solve.explicit = { duration = "pi / 2", outputs = 0, history-interval = "pi / 40" }
[output]
vtu = false
probes.middle.at = 0.5
"#;
    let points = "peridynamics={horizon=0.16,points={lattice={spacing=0.05}}}";
    for set in couplings(points, points, "zones.nonlocal.box={min=0.4,max=0.8}") {
        let set: Vec<&str> = set.iter().map(String::as_str).collect();
        let done = run(bar, &set);
        let history = |name: &str| done.column("scene_history.csv", name);
        let (t, u, reaction) = (
            history("time"),
            history("middle_ux"),
            history("left_reaction_x"),
        );
        for (t, u) in t.iter().zip(&u) {
            assert!((u - 0.01 * t.sin()).abs() < 1e-5, "{set:?}: {t} {u}");
        }
        let last = u.len() - 1;
        assert!((reaction[last] + u[last]).abs() < 1e-5, "{reaction:?}");
        let (kinetic, stored) = (history("kinetic_energy"), history("stored_energy"));
        for (kinetic, stored) in kinetic.iter().zip(stored) {
            // m v² / 2
            let off = (kinetic + stored) / 5e-5 - 1.0;
            assert!(off.abs() < 1e-3, "{set:?}: {off}");
        }
    }
}

/// The stable step is that of the springs where they are stiffer than the body.
#[test]
fn stiff_springs_shorten_the_stable_step() {
    let set = ["coupling=local", "solve.explicit={duration=0.02,outputs=0}"];
    let step = |k: &str| {
        let stiffness = format!("conditions.left.spring.x={k}");
        let done = run(BAR, &[&set[..], &[stiffness.as_str()]].concat());
        done.summary.motion.unwrap().step
    };
    let (soft, stiff) = (step("1"), step("1e6"));
    // mass of the node at the end: 0.025; ω² = 1e6 / 0.025
    let limit = 2.0 / (1e6f64 / 0.025).sqrt();
    assert!(
        soft > 5.0 * limit && stiff < limit && stiff > 0.8 * limit,
        "{soft} {stiff} {limit}"
    );
}

#[test]
fn wrong_springs_are_refused() {
    for (typed, parts) in [
        ("{on=\"left\",x=-1}", ["spring.x", "is -1", "larger than 0"]),
        (
            "{on=\"left\"}",
            ["conditions.left.spring", "no stiffness", "normal = ..."],
        ),
        (
            "{x=1}",
            [
                "conditions.left.spring",
                "neither `on` nor `inside`",
                "keep one",
            ],
        ),
        (
            "{on=\"left\",x=1,normal=1}",
            [
                "conditions.left.spring",
                "`normal` and components",
                "keep one",
            ],
        ),
        (
            "{inside={everywhere=true},normal=1}",
            ["spring", "`inside` and `normal`", "by `on`"],
        ),
        (
            "{on=\"left\",y=1}",
            ["spring.y", "dimension 1", "remove `y`"],
        ),
        (
            "{on=\"lefft\",x=1}",
            ["spring.on", "no set `lefft`", "did you mean `left`"],
        ),
        (
            "{on=\"left\",x=\"t\"}",
            ["spring.x", "a variable", "constant"],
        ),
        (
            "{inside={box={min=5,max=6}},x=1}",
            ["spring.inside", "no part of the mesh", "reaches from"],
        ),
    ] {
        refused(
            BAR,
            &[
                "coupling=local",
                "conditions.right.traction.x=1",
                &format!("conditions.left.spring={typed}"),
            ],
            &parts,
        );
    }
    // springs along y alone leave a plate free along x
    let free = PLATE.replace(
        "inside.box = { min = [2, 0], max = [3, 1] }, x = 6",
        "on = \"top\", y = 6",
    );
    let folder = tempfile::tempdir().unwrap();
    let mut scene = read(&free, &["coupling=local"]).unwrap();
    scene.set_output_directory(folder.path().to_owned());
    let error = scene
        .run(&bondline::progress::Silent)
        .unwrap_err()
        .to_string();
    assert!(error.contains("free to move"), "{error}");
}
