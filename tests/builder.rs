//! Scenes that a program makes are those of files: the same bits, and the same errors with the key as place.

use std::path::Path;

use bondline::observe::vtu::Snapshot;
use bondline::scene::{SceneErrorKind, Source};
use bondline::{
    AnyScene, Condition, Function, Initial, Material, Region, SceneBuilder, Silent, Solution,
};

fn bar() -> SceneBuilder {
    SceneBuilder::bar("bar")
        .line(0.0, 10.0, 40)
        .material("bar", Material::bond_based(1.0).density(1.0))
        .horizon(0.75)
        .spacing(0.25)
        .nonlocal(Region::cuboid([4.0], [6.0]))
        .coupling("splice")
        .condition("left", Condition::displacement("left").x(0))
        .probe("middle", 5.0)
}

const BAR: &str = r#"
kinematics = "bar"
coupling = "splice"
mesh.line = { min = 0, max = 10, x = { cells = 40 } }
materials.bar.bond-based = { youngs-modulus = 1, density = 1 }
peridynamics = { horizon = 0.75, points.lattice.spacing = 0.25 }
zones.nonlocal.box = { min = 4, max = 6 }
conditions.left.displacement = { on = "left", x = 0 }
output.probes.middle.at = 5
"#;

/// A snapshot without the hash of its scene: functions have no text.
fn unnamed(snapshot: &Snapshot) -> Snapshot {
    Snapshot {
        origin: String::new(),
        ..snapshot.clone()
    }
}

fn from_text(more: &str) -> Solution {
    let source = Source::new("bar.toml", format!("{BAR}{more}"));
    let scene = AnyScene::from_source(&source, Path::new(""), "bar").unwrap();
    scene.solve(&Silent).unwrap()
}

#[test]
fn a_static_scene_with_functions_has_the_bits_of_one_with_expressions() {
    let built = bar()
        .condition(
            "pull",
            Condition::body_force().x(Function::of_position(|x| 1e-3 * x[0])),
        )
        .solve(&Silent)
        .unwrap();
    let typed = from_text("conditions.pull.body-force.x = \"1e-3 * x\"");
    assert!(unnamed(built.snapshot()) == unnamed(typed.snapshot()));
    assert_eq!(
        built.table("probes").unwrap(),
        typed.table("probes").unwrap()
    );
    // σ(10) = 0, σ(0) = ∫ 1e-3 x, E = 1: u(10) = 1e-3 · 10³ / 3
    let end = built.displacement().unwrap();
    let furthest = end.iter().fold(0.0_f64, |m, u| m.max(u[0]));
    assert!(
        (furthest / (1e-3 * 1000.0 / 3.0) - 1.0).abs() < 1e-3,
        "{furthest}"
    );
}

#[test]
fn a_run_in_time_with_functions_has_the_bits_of_one_with_expressions() {
    let built = bar()
        .explicit(2.0)
        .set("solve.explicit.outputs", 3)
        .initial(
            "pushed",
            Initial::velocity().x(Function::of_points(|places, values| {
                for (x, value) in places.iter().zip(values) {
                    *value = 1e-3 * x[0];
                }
            })),
        )
        .condition(
            "pull",
            Condition::traction("right").x(Function::of_time(|t| 1e-3 * t)),
        )
        .condition(
            "weight",
            Condition::body_force().x(Function::of_position_and_time(|x, t| 1e-4 * x[0] * t)),
        )
        .solve(&Silent)
        .unwrap();
    let typed = from_text(
        "solve.explicit = { duration = 2, outputs = 3 }\ninitial.pushed.velocity.x = \"1e-3 * x\"\nconditions.pull.traction = { on = \"right\", x = \"1e-3 * t\" }\nconditions.weight.body-force.x = \"1e-4 * x * t\"",
    );
    assert_eq!(built.frames().count(), 4);
    let frames = |of: &Solution| -> Vec<Snapshot> {
        of.frames().map(|frame| unnamed(frame.snapshot())).collect()
    };
    assert!(frames(&built) == frames(&typed));
    assert_eq!(
        built.table("history").unwrap(),
        typed.table("history").unwrap()
    );
    assert!(
        built
            .history("external_work")
            .unwrap()
            .last()
            .unwrap()
            .abs()
            > 0.0
    );
}

#[test]
fn displacements_that_a_function_prescribes_are_those_of_the_expression() {
    let built = bar()
        .explicit(1.0)
        .condition(
            "right",
            Condition::displacement("right")
                .x(Function::of_position_and_time(|x, t| 1e-4 * x[0] * t)),
        )
        .solve(&Silent)
        .unwrap();
    let typed = from_text(
        "solve.explicit.duration = 1\nconditions.right.displacement = { on = \"right\", x = \"1e-4 * x * t\" }",
    );
    assert!(unnamed(built.snapshot()) == unnamed(typed.snapshot()));
}

#[test]
fn errors_name_the_key_as_place() {
    let error = |scene: SceneBuilder| scene.scene().unwrap_err();
    let found = error(bar().condition("pull", Condition::traction("rihgt").x(1e-3)));
    assert_eq!(found.kind(), SceneErrorKind::UnknownSet);
    assert!(
        found
            .to_string()
            .starts_with("bar, conditions.pull.traction.on: "),
        "{found}"
    );
    let found = error(bar().horizon(-1.0));
    assert!(
        found.to_string().starts_with("bar, peridynamics.horizon: "),
        "{found}"
    );
    let found = error(bar().set("solver.tolerence", 1e-8));
    assert!(
        found.to_string().contains("did you mean `tolerance`"),
        "{found}"
    );
    // a function that gives no number, and one of time where nothing moves
    let nan = Function::of_position(|x| if x[0] > 9.0 { f64::NAN } else { 0.0 });
    let found = error(bar().condition("pull", Condition::body_force().x(nan)));
    assert!(
        found
            .message()
            .contains("`conditions.pull.body-force.x` is NaN at [9."),
        "{found}"
    );
    let found = error(bar().condition(
        "pull",
        Condition::traction("right").x(Function::of_time(|t| t)),
    ));
    assert!(
        found
            .message()
            .contains("depends on the time t in a static scene"),
        "{found}"
    );
    // the word that stands for a function is none in a file
    let source = Source::new(
        "bar.toml",
        format!("{BAR}conditions.pull.body-force.x = \"function 0\""),
    );
    assert!(AnyScene::from_source(&source, Path::new(""), "bar").is_err());
}

#[test]
fn names_that_a_solution_does_not_have_are_told_with_those_that_it_has() {
    let solution = bar()
        .condition("pull", Condition::traction("right").x(1e-3))
        .solve(&Silent)
        .unwrap();
    let error = solution.field("displacment").unwrap_err().to_string();
    assert!(
        error.contains("`displacment`") && error.contains("`displacement`"),
        "{error}"
    );
    assert!(
        solution
            .history("time")
            .unwrap_err()
            .to_string()
            .contains("`probes`")
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bar.vtu");
    solution.write_vtu(&path).unwrap();
    assert!(path.exists());
}
