//! Small things that were wrong or silent: overrides of tables, wrong hints, parts of a scene that touch nothing.

use super::Case;

const PLATE: &str = r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [1, 1]
x = { cells = 20 }
y = { cells = 20 }
[materials.m.bond-based]
youngs-modulus = 1
[peridynamics]
horizon = 0.15
points.lattice = { spacing = 0.05 }
[zones.nonlocal]
box = { min = [0.2, 0.2], max = [0.8, 0.8] }
[conditions.b.displacement]
on = "bottom"
x = 0
y = 0
[conditions.t.traction]
on = "top"
x = 1
"#;

/// Standard output and error of `check`, in one line.
fn told(text: &str, sets: &[&str]) -> String {
    let mut arguments = Vec::new();
    sets.iter().for_each(|s| arguments.extend(["--set", *s]));
    let output = Case::new(text).command("check", &arguments);
    let both = [output.stdout, output.stderr].map(|t| String::from_utf8_lossy(&t).into_owned());
    let words: Vec<&str> = both.iter().flat_map(|t| t.split_whitespace()).collect();
    words.join(" ").replace("│ ", "")
}

#[test]
fn a_table_that_is_set_replaces_the_one_of_the_file() {
    // with x free, the plate slides and nothing holds it: kept x = 0 solved another problem
    let case = Case::new(PLATE);
    let set = r#"conditions.b.displacement={on="bottom",y=0}"#;
    let error = case
        .run(&["--set", set])
        .expect_err("nothing holds it along x");
    assert!(error.contains("free to move"), "{error}");
}

#[test]
fn a_study_of_convergence_refuses_points_that_stay() {
    let text = PLATE.replace(
        "[mesh.rectangle]\nmin = [0, 0]\nmax = [1, 1]\nx = { cells = 20 }\ny = { cells = 20 }",
        "[mesh.file]\npath = \"grad.msh\"",
    );
    let text = text.replace("on = \"top\"", "on = \"right\"");
    let case = Case::new(&text).with_file("grad.msh");
    let output = case.command(
        "converge",
        &[
            "--set",
            "peridynamics={horizon=3,points=\"cells\"}",
            "--set",
            "coupling=nonlocal",
            "--set",
            "zones.nonlocal={box={min=[6,6],max=[14,14]}}",
        ],
    );
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(error.contains("get no finer"), "{error}");
}

#[test]
fn hints_name_the_mistake() {
    let coarse = told(PLATE, &["peridynamics.points.lattice.spacing=0.5"]);
    assert!(
        coarse.contains("use a spacing of 0.05000, a third of the horizon"),
        "{coarse}"
    );
    let below = PLATE.replace("horizon = 0.15", "horizon = 0.15\nzones = \"auto\"");
    let below = told(&below, &[]);
    assert!(
        below.contains("`zones` belongs at the top of the scene"),
        "{below}"
    );
    assert!(!below.contains("did you mean"), "{below}");
}

#[test]
fn a_zone_without_peridynamics_is_refused() {
    let start = PLATE.find("[peridynamics]").expect("it is there");
    let end = PLATE.find("[zones.nonlocal]").expect("it is there");
    let without = [&PLATE[..start], &PLATE[end..]].concat();
    let error = told(&without, &[]);
    assert!(
        error.contains("has no [peridynamics] to fill it with"),
        "{error}"
    );
    // and a fracture energy that nothing uses is told of
    let zone = without.find("[zones.nonlocal]").expect("it is there");
    let conditions = without.find("[conditions.b").expect("it is there");
    let alone = [&without[..zone], &without[conditions..]].concat();
    let warned = told(&alone, &["materials.m.bond-based.fracture-energy=1"]);
    assert!(
        warned.contains("`fracture-energy` of the material `m` is not used"),
        "{warned}"
    );
    // nor a region in which nothing fails
    let sets = [
        "no-fail.all.box={min=[0,0],max=[1,1]}",
        "materials.m.bond-based.fracture-energy=1",
        "solve.explicit.duration=0.01",
        "materials.m.bond-based.density=1",
    ];
    let warned = told(&alone, &sets);
    assert!(warned.contains("`no-fail.all` is not used"), "{warned}");
}

#[test]
fn cells_that_soften_are_as_long_as_wide() {
    let bar = r#"
kinematics = "plane-stress"
coupling = "local"
mesh.rectangle = { min = [0, 0], max = [1, 0.5], x = { cells = 10 }, y = { cells = 5 } }
materials.m.damage-correspondence = { youngs-modulus = 1000, poisson-ratio = 0.2, tensile-strength = 1, fracture-energy = 0.01 }
conditions.left.displacement = { on = "left", x = 0, y = 0 }
conditions.right.displacement = { on = "right", x = "5e-4*t" }
solve.quasi-static.steps = 2
output.vtu = false
"#;
    let warned = told(bar, &[]);
    assert!(!warned.contains("as long as wide"), "{warned}");
    let warned = told(bar, &["mesh.rectangle.y.cells=1"]);
    assert!(
        warned.contains("10 elements that soften are up to 5.000 times as long as wide: a crack takes 0.4472 to 2.236"),
        "{warned}"
    );
}

#[test]
fn saturating_hardening_has_both_its_numbers() {
    let typed = PLATE.replace(
        "bond-based]",
        "plastic-correspondence]\npoisson-ratio = 0.3\nyield-stress = 1\nsaturation-stress = 1",
    );
    let error = told(&typed, &[]);
    assert!(
        error.contains("saturation-stress` is 1") && error.contains("saturation-rate"),
        "{error}"
    );
}

#[test]
fn parts_that_touch_nothing_are_warned_of_by_name() {
    let sets = [
        "voids.beside.inside.box={min=[5,5],max=[6,6]}",
        "voids.between.inside.box={min=[0.501,0.501],max=[0.502,0.502]}",
        "voids.hole.inside.box={min=[0.41,0.41],max=[0.49,0.49]}",
        "cracks.short.segment={from=[0.5050,0.5013],to=[0.5055,0.5013]}",
        "cracks.long.segment={from=[0.3,0.6],to=[0.5,0.6]}",
        "zones.transition.around=0.1",
        "materials.m.bond-based.fracture-energy=1",
        "materials.m.bond-based.density=1",
        "solve.explicit.duration=0.1",
        "no-fail.beside.box={min=[5,5],max=[6,6]}",
        "no-fail.inside.box={min=[0.3,0.3],max=[0.6,0.6]}",
        "output.tips.t={direction=[1,0],inside={box={min=[5,5],max=[6,6]}}}",
    ];
    let warned = told(PLATE, &sets);
    for part in [
        "the void `beside` holds no point and cuts no bond",
        "the void `between` holds no point",
        "the crack `short` cuts no bond",
        "the region `no-fail.beside` holds no point",
        "`output.tips.t` looks where no point lies",
        "`zones.transition` is not used: coupling `truncated`",
    ] {
        assert!(warned.contains(part), "{part}: {warned}");
    }
    for part in ["`hole`", "`long`", "`no-fail.inside`"] {
        assert!(!warned.contains(part), "{part}: {warned}");
    }
}

#[test]
fn a_horizon_wider_than_the_zone_is_warned_of() {
    let small = "zones.nonlocal={box={min=[0.4,0.4],max=[0.5,0.5]}}";
    let fails = "materials.m.bond-based.fracture-energy=1";
    let warned = told(PLATE, &[small, fails]);
    assert!(warned.contains("narrower than a horizon"), "{warned}");
    // what stays whole is right in any width
    let whole = told(PLATE, &[small]);
    assert!(!whole.contains("narrower"), "{whole}");
    let outside = "zones.nonlocal={box={min=[0.4,0.4],max=[5,0.6]}}";
    let warned = told(PLATE, &[outside]);
    assert!(warned.contains("reaches beyond the mesh"), "{warned}");
    let through = "zones.nonlocal={box={min=[0.4,-5],max=[0.6,5]}}";
    let fine = told(PLATE, &[through]);
    assert!(!fine.contains("beyond the mesh"), "{fine}");
    let fine = told(PLATE, &[]);
    assert!(
        !fine.contains("horizon wide") && !fine.contains("beyond the mesh"),
        "{fine}"
    );
}

#[test]
fn a_transition_may_be_a_polygon() {
    let sets = [
        "coupling=blending",
        "zones.nonlocal={box={min=[0.45,0.45],max=[0.55,0.55]}}",
        "zones.transition.polygon=[[0.35,0.35],[0.65,0.35],[0.65,0.65],[0.35,0.65]]",
    ];
    let answer = told(PLATE, &sets);
    assert!(answer.contains("the scene is right"), "{answer}");
}

#[test]
fn points_that_are_left_out_are_a_lattice_on_every_mesh() {
    // pulled by 100 on triangles of 0.5 to 1.9; at their centroids the points gave up to 817, and -3697 for -2000
    let text = r#"
kinematics = "plane-stress"
[mesh.file]
path = "grad.msh"
[materials.m.lps]
youngs-modulus = 210e3
poisson-ratio = 0.3
[peridynamics]
horizon = 3
[zones.nonlocal]
box = { min = [6, 6], max = [14, 14] }
[conditions.l.displacement]
on = "left"
x = 0
[conditions.b.displacement]
on = "bottom"
y = 0
[conditions.r.traction]
on = "right"
x = 100
"#;
    let summary = Case::new(text)
        .with_file("grad.msh")
        .run(&[])
        .expect("it runs");
    let reactions = summary["reactions"].as_array().expect("a list");
    let left = reactions
        .iter()
        .find(|r| r["condition"] == "l")
        .expect("held");
    let force = left["force"][0].as_f64().expect("a number");
    assert!((force + 2000.0).abs() < 1e-6, "{force}");
    let told = summary["choices"].to_string();
    assert!(told.contains("points on a lattice of spacing 1"), "{told}");
}
