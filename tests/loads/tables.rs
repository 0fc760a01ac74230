//! Tables as functions in expressions.

use bondline::run::AnyScene;
use bondline::scene::Source;
use bondline::scene::build::SceneBuilder;

use super::{refused, run};

/// A bar that load steps pull by a table.
const BAR: &str = r#"
kinematics = "bar"
coupling = "local"
mesh.line = { min = 0, max = 2, x = { cells = 8 } }
materials.m.lps = { youngs-modulus = 10, poisson-ratio = 0 }
conditions.left.displacement = { on = "left", x = 0 }
conditions.right.traction = { on = "right", x = "3 * ramp(t)" }
solve.quasi-static.steps = 8
tables.ramp.points = [["-1/2", 5], [0, 0], [0.5, 2], [0.75, -1]]
[output]
vtu = false
probes.end.at = 2
"#;

/// The table of the bar, and what it has beyond its last row.
fn ramp(t: f64) -> f64 {
    match t {
        t if t <= 0.5 => 4.0 * t,
        t if t <= 0.75 => 2.0 - 12.0 * (t - 0.5),
        _ => -1.0,
    }
}

#[test]
fn a_bar_follows_its_table() {
    let done = run(BAR, &[]);
    let u = done.column("scene_history.csv", "end_ux");
    assert_eq!(u.len(), 9);
    for (k, u) in u.iter().enumerate() {
        // u = F L / E
        let exact = 3.0 * ramp(k as f64 / 8.0) * 2.0 / 10.0;
        assert!((u - exact).abs() < 1e-9, "{k}: {u} {exact}");
    }
}

#[test]
fn load_steps_are_taken_at_the_times_that_are_listed() {
    let times = [0.1, 0.5, 0.7, 1.3];
    let done = run(BAR, &["solve.quasi-static.steps=[0.1,\"1/2\",0.7,1.3]"]);
    let (t, u) = (
        done.column("scene_history.csv", "time"),
        done.column("scene_history.csv", "end_ux"),
    );
    assert_eq!(t[1..], times);
    for (t, u) in t.iter().zip(u) {
        let exact = 3.0 * ramp(*t) * 2.0 / 10.0;
        assert!((u - exact).abs() < 1e-9, "{t}: {u} {exact}");
    }
    for (steps, part) in [
        ("[]", "is empty"),
        ("[0,1]", "lists 0 after 0"),
        ("[0.5,0.2]", "lists 0.2 after 0.5"),
        ("0", "is 0"),
        ("[0.5,1],duration=2", "beside `duration`"),
    ] {
        let typed = format!("solve.quasi-static={{steps={steps}}}");
        refused(BAR, &[&typed], &[part]);
    }
}

/// The same motion by a table as by an expression: prescribed displacements, rotations, profiles in space.
#[test]
fn tables_take_the_place_of_expressions_everywhere() {
    let plate = r#"
kinematics = "plane-stress"
coupling = "local"
mesh.rectangle = { min = [0, 0], max = [1, 1], x = { cells = 4 }, y = { cells = 4 } }
materials.m.lps = { youngs-modulus = 10, poisson-ratio = 0.3 }
conditions.base.displacement = { on = "bottom", x = 0, y = 0 }
conditions.top.rotation = { on = "top", center = [0.5, 1], angle = "2 * by(t)" }
conditions.side.traction = { on = "right", x = "profile(y) * by(t)" }
solve.quasi-static.steps = 2
tables.by.points = [[0, 0], [1, 1]]
tables.profile.points = [[0, 0], [1, 2]]
[output]
vtu = false
probes.corner.at = [1, 0.5]
"#;
    let by_tables = run(plate, &[]);
    let by_expressions = run(
        plate,
        &[
            "conditions.top.rotation.angle=\"2 * t\"",
            "conditions.side.traction.x=\"2 * y * t\"",
        ],
    );
    for column in ["corner_ux", "corner_uy", "top_reaction_x", "side_force"] {
        if column == "side_force" {
            let forces = [&by_tables, &by_expressions].map(|d| d.applied("side")[0]);
            assert!((forces[0] - forces[1]).abs() < 1e-12 && (forces[0] - 1.0).abs() < 1e-12);
            continue;
        }
        let (a, b) = (
            by_tables.column("scene_history.csv", column),
            by_expressions.column("scene_history.csv", column),
        );
        let differ = a.iter().zip(&b).any(|(a, b)| (a - b).abs() > 1e-10);
        assert!(!differ && a[2] != 0.0, "{column}: {a:?} {b:?}");
    }
}

#[test]
fn a_file_has_the_bytes_of_the_rows_that_it_holds() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("ramp.csv");
    std::fs::write(
        &file,
        "time;factor\n-0.5; 5\n0; 0\n# top\n0.5; 2\n0.75; -1\n",
    )
    .unwrap();
    let place = file.display().to_string().replace('\\', "/");
    let from_file = run(BAR, &[&format!("tables.ramp={{file=\"{place}\"}}")]);
    let typed = run(BAR, &[]);
    let bytes =
        |done: &super::Done| std::fs::read(done.folder.path().join("scene_history.csv")).unwrap();
    assert!(bytes(&from_file) == bytes(&typed));
}

#[test]
fn the_builder_takes_tables() {
    let solution = SceneBuilder::bar("bar")
        .line(0.0, 2.0, 4)
        .set("coupling", "local")
        .set("materials.m.lps.youngs-modulus", 10.0)
        .set("materials.m.lps.poisson-ratio", 0.0)
        .set("conditions.left.displacement.on", "left")
        .set("conditions.left.displacement.x", 0.0)
        .set("conditions.right.displacement.on", "right")
        .set("conditions.right.displacement.x", "0.1 * up(x)")
        .set("tables.up.points", vec![[0.0, 0.0], [1.0, 0.5]])
        .solve(&bondline::progress::Silent)
        .unwrap();
    let u = solution.displacement().unwrap();
    let last = u.iter().map(|u| u[0]).fold(0.0, f64::max);
    assert!((last - 0.05).abs() < 1e-12, "{last}");
}

#[test]
fn wrong_tables_are_refused_with_name_row_and_remedy() {
    for (typed, parts) in [
        (
            "tables.ramp={points=[[0,0]]}",
            ["tables.ramp.points", "1 rows", "pairs"],
        ),
        (
            "tables.ramp={points=[[0,0],[1]]}",
            ["row 2", "1 numbers", "pairs"],
        ),
        (
            "tables.ramp={points=[[0,0],[0,1]]}",
            ["row 2", "0 does not exceed 0", "increases"],
        ),
        (
            "tables.ramp={points=[[0,0],[\"x\",1]]}",
            ["tables.ramp.points", "a variable", "constant"],
        ),
        ("tables.ramp={}", ["tables.ramp", "neither", "curve.csv"]),
        (
            "tables.ramp={points=[[0,0],[1,1]],file=\"a.csv\"}",
            ["tables.ramp", "both", "keep one"],
        ),
        (
            "tables.ramp={file=\"missing.csv\"}",
            ["tables.ramp.file", "missing.csv", "relative to the scene"],
        ),
        (
            "tables.sin={points=[[0,0],[1,1]]}",
            ["table `sin`", "a function", "letters"],
        ),
        (
            "tables.load-curve={points=[[0,0],[1,1]]}",
            ["table `load-curve`", "cannot be named", "load_curve"],
        ),
        (
            "conditions.right.traction.x=\"rampe(t)\"",
            ["`rampe` is unknown", "the tables are ramp", "expressions"],
        ),
        (
            "mesh.line.max=\"ramp(1)\"",
            ["mesh.line.max", "a table", "constant"],
        ),
    ] {
        refused(BAR, &[typed], &parts);
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("ramp.csv"), "0,1\n1,2\n1,3\n").unwrap();
    let text = BAR.replace(
        "tables.ramp.points = [[\"-1/2\", 5], [0, 0], [0.5, 2], [0.75, -1]]",
        "tables.ramp.file = \"ramp.csv\"",
    );
    let source = Source::new("scene.toml", text);
    let error = AnyScene::from_source(&source, folder.path(), "scene").unwrap_err();
    let error = error.to_string();
    assert!(error.contains("line 3: 1 does not exceed 1"), "{error}");
}
