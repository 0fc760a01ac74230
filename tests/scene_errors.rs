//! Wrong scenes: each message names the place, the value and the remedy, and underlines the token at fault.

use bondline::model::Zone;
use bondline::run::AnyScene;
use bondline::scene::{SceneError, SceneErrorKind, SceneSpec, Source, Template};

/// A scene with nothing wrong in it.
const RIGHT: &str = r#"
title = "Plate"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [2, 1]
x = { cells = 20 }
y = { cells = 10 }
[materials.plate.bond-based]
youngs-modulus = 200
[peridynamics]
horizon = "3/10"
points.lattice = { spacing = 0.1 }
[zones.nonlocal]
box = { min = [0.6, 0], max = [1.4, 1] }
[zones.transition]
around = 0.3
[coupling.blending]
beta = "constant"
[conditions.bottom.displacement]
on = "bottom"
x = 0
y = 0
[conditions.top.traction]
on = "top"
y = "1 + x"
"#;

fn parse(text: &str, overrides: &[&str]) -> Result<SceneSpec, SceneError> {
    let mut source = Source::new("plate.toml", text);
    for o in overrides {
        source.push_override(o)?;
    }
    SceneSpec::parse(&source)
}

/// The error of the right scene with `from` replaced by `to`.
fn error(from: &str, to: &str) -> SceneError {
    assert!(RIGHT.contains(from), "{from}");
    parse(&RIGHT.replacen(from, to, 1), &[]).expect_err("this scene is wrong")
}

fn build(text: &str, overrides: &[&str]) -> Result<AnyScene, SceneError> {
    let mut source = Source::new("plate.toml", text);
    for o in overrides {
        source.push_override(o)?;
    }
    bondline_study::from_source(
        &source,
        std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")),
        "plate",
    )
}

/// The error of the right scene with `from` replaced by `to`, which reads well and means something wrong.
fn wrong(from: &str, to: &str) -> SceneError {
    assert!(RIGHT.contains(from), "{from}");
    let text = RIGHT.replacen(from, to, 1);
    parse(&text, &[]).expect("this scene reads well");
    build(&text, &[]).expect_err("this scene is wrong")
}

fn check(error: &SceneError, kind: SceneErrorKind, underlined: &str, message: &str, help: &str) {
    assert_eq!(error.kind(), kind, "{error}");
    assert_eq!(
        error.underlined().first().copied(),
        Some(underlined),
        "{error}"
    );
    assert!(error.message().contains(message), "{error}");
    let remedy = error.remedy().unwrap_or_default();
    assert!(remedy.contains(help), "{error}");
    // a person at a terminal sees the same words
    let shown = format!("{:?}", bondline_terminal::report(error.clone()));
    assert!(
        shown.contains(underlined.lines().next().unwrap()),
        "{shown}"
    );
}

#[test]
fn a_mesh_file_without_its_key_is_told_where_the_path_belongs() {
    let mesh =
        "[mesh.rectangle]\nmin = [0, 0]\nmax = [2, 1]\nx = { cells = 20 }\ny = { cells = 10 }";
    let found = error(mesh, "[mesh]\nfile = \"part.msh\"");
    let help = "mesh.file.path";
    check(
        &found,
        SceneErrorKind::WrongType,
        "\"part.msh\"",
        "`mesh.file` is text",
        help,
    );
}

#[test]
fn the_right_scene_is_right() {
    parse(RIGHT, &[]).unwrap();
}

#[test]
fn misspelt_key() {
    let e = error("horizon =", "horizn =");
    check(
        &e,
        SceneErrorKind::UnknownKey,
        "horizn",
        "`horizn` is not known in `peridynamics`",
        "did you mean `horizon`?",
    );
    assert!(e.to_string().starts_with("plate.toml:12: "), "{e}");
}

#[test]
fn misspelt_table() {
    let e = error("[zones.transition]", "[zones.transitoin]");
    check(
        &e,
        SceneErrorKind::UnknownKey,
        "transitoin",
        "in `zones`",
        "did you mean `transition`?",
    );
}

#[test]
fn misspelt_choice() {
    let e = error(
        "[coupling.blending]\nbeta = \"constant\"",
        "[coupling.blnding]",
    );
    check(
        &e,
        SceneErrorKind::UnknownKey,
        "blnding",
        "in `coupling`",
        "did you mean `blending`?",
    );
}

#[test]
fn misspelt_value() {
    let e = error("\"constant\"", "\"cubic\"");
    check(
        &e,
        SceneErrorKind::UnknownKey,
        "\"cubic\"",
        "`cubic` is not known in `coupling.blending.beta`",
        "`smooth`",
    );
}

#[test]
fn text_for_a_number() {
    let e = error("youngs-modulus = 200", "youngs-modulus = true");
    check(
        &e,
        SceneErrorKind::WrongType,
        "true",
        "materials.plate.bond-based.youngs-modulus",
        "a number",
    );
}

#[test]
fn number_for_a_table() {
    let e = error("x = { cells = 20 }", "x = 20");
    check(
        &e,
        SceneErrorKind::WrongType,
        "20",
        "mesh.rectangle.x",
        "`cells`",
    );
}

#[test]
fn expression_that_ends_early() {
    let e = error("\"1 + x\"", "\"1 +\"");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "\"1 +\"",
        "conditions.top.traction.y",
        "functions",
    );
    assert!(e.message().contains("character 4"), "{e}");
}

#[test]
fn expression_in_time() {
    let e = wrong("\"1 + x\"", "\"sin(t)\"");
    check(
        &e,
        SceneErrorKind::Conflict,
        "\"sin(t)\"",
        "time t in a static scene",
        "[solve.explicit]",
    );
    let e = wrong("\"3/10\"", "\"0.3 + 0 * t\"");
    check(
        &e,
        SceneErrorKind::Conflict,
        "\"0.3 + 0 * t\"",
        "`peridynamics.horizon` depends on the time",
        "conditions",
    );
}

#[test]
fn precision_of_what_stands_still() {
    let e = wrong(
        "horizon = \"3/10\"",
        "horizon = \"3/10\"\nprecision = \"single\"",
    );
    check(
        &e,
        SceneErrorKind::Conflict,
        "\"single\"",
        "`peridynamics.precision` is set, and nothing moves",
        "[solve.explicit]",
    );
}

#[test]
fn variable_where_a_constant_belongs() {
    let e = error("spacing = 0.1", "spacing = \"x\"");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "\"x\"",
        "a constant is expected",
        "",
    );
}

#[test]
fn infinite_number() {
    let e = error("youngs-modulus = 200", "youngs-modulus = inf");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "inf",
        "not a finite number",
        "",
    );
}

#[test]
fn fractional_count() {
    let e = error("cells = 20", "cells = 20.5");
    check(&e, SceneErrorKind::WrongValue, "20.5", "whole number", "");
}

#[test]
fn two_methods() {
    let e = error(
        "[coupling.blending]",
        "[coupling.splice]\n[coupling.blending]",
    );
    check(
        &e,
        SceneErrorKind::Choice,
        "splice",
        "`coupling` holds `splice`, `blending` at once",
        "--set coupling=",
    );
    assert_eq!(e.underlined(), ["splice", "blending"]);
}

#[test]
fn no_method() {
    let e = error("[coupling.blending]\nbeta = \"constant\"", "[coupling]");
    assert_eq!(e.kind(), SceneErrorKind::Choice);
    assert!(e.remedy().unwrap().contains("`partial-stress`"), "{e}");
}

#[test]
fn a_horizon_left_out_is_three_spacings_but_where_bonds_break() {
    let text = RIGHT.replace("horizon = \"3/10\"\n", "");
    let chosen = |overrides: &[&str]| {
        let AnyScene::Plane(plane) = build(&text, overrides).unwrap() else {
            panic!("a plate");
        };
        let told = plane.choices.iter();
        let told = told.filter(|c| c.choice.starts_with("horizon ")).count();
        assert_eq!(told, 1, "{:?}", plane.choices);
        plane.horizon_at(&[1.0, 0.5].into())
    };
    assert!((chosen(&[]) - 0.3).abs() < 1e-12);
    assert!((chosen(&["peridynamics.points.lattice.spacing=0.05"]) - 0.15).abs() < 1e-12);
    // a lattice that is left out too is that of the cells; cells of 0.1 by 0.05 count by their shorter edge
    let unplaced = text.replace("points.lattice = { spacing = 0.1 }\n", "");
    let fine = unplaced.replace("y = { cells = 10 }", "y = { cells = 20 }");
    for (text, horizon) in [(&unplaced, 0.3), (&fine, 0.15)] {
        let AnyScene::Plane(plane) = build(text, &[]).unwrap() else {
            panic!("a plate");
        };
        assert!((plane.horizon_at(&[1.0, 0.5].into()) - horizon).abs() < 1e-12);
    }
    // no lattice has cells of 0.1 by 1/15: the edge of a square as large as they are
    let oblong = unplaced.replace("y = { cells = 10 }", "y = { cells = 15 }");
    let AnyScene::Plane(plane) = build(&oblong, &[]).unwrap() else {
        panic!("a plate");
    };
    let wanted = 3.0 * (0.1f64 / 15.0).sqrt();
    assert!((plane.horizon_at(&[1.0, 0.5].into()) - wanted).abs() < 1e-12);
    // cracks depend on the horizon, at rest they do not grow
    let breaking = [
        "materials.plate.bond-based.fracture-energy=1",
        "coupling=nonlocal",
    ];
    build(&text, &breaking).unwrap();
    let moving = [&breaking[..], &["solve.quasi-static.steps=2"]].concat();
    let e = build(&text, &moving).unwrap_err();
    assert_eq!(e.kind(), SceneErrorKind::Missing);
    assert!(
        e.message().contains("`peridynamics` lacks `horizon`") && e.message().contains("`plate`"),
        "{e}"
    );
    assert!(e.remedy().unwrap().contains("horizon = 0.3000"), "{e}");
    build(RIGHT, &moving).unwrap();
}

#[test]
fn no_toml() {
    let e = error("on = \"top\"", "on = top");
    assert_eq!(e.kind(), SceneErrorKind::Syntax);
    assert!(e.remedy().unwrap().contains("quotes"), "{e}");
    assert_eq!(
        error("[peridynamics]", "[materials.plate.bond-based]").kind(),
        SceneErrorKind::Syntax
    );
}

#[test]
fn overrides() {
    use bondline::coupling::BlendingFunction;
    use bondline::scene::spec::CouplingSpec;
    let spec = parse(
        RIGHT,
        &[
            "peridynamics.horizon=0.4",
            "title=My plate",
            "coupling.blending.beta=smooth",
        ],
    )
    .unwrap();
    assert_eq!(
        spec.peridynamics.unwrap().horizon.unwrap().as_constant(),
        Some(0.4)
    );
    assert_eq!(spec.title.as_deref(), Some("My plate"));
    assert!(
        matches!(spec.coupling.unwrap().into_inner(), CouplingSpec::Blending(b) if b.beta == BlendingFunction::Smooth)
    );
    for choice in [
        "coupling=splice",
        "coupling.splice={}",
        "coupling = \"splice\"",
    ] {
        let spec = parse(RIGHT, &[choice]).unwrap();
        assert!(
            matches!(spec.coupling.unwrap().into_inner(), CouplingSpec::Splice(_)),
            "{choice}"
        );
    }
    // a second override sees the first
    let spec = parse(RIGHT, &["coupling=splice", "coupling.blending.beta=linear"]).unwrap();
    assert!(
        matches!(spec.coupling.unwrap().into_inner(), CouplingSpec::Blending(b) if b.beta == BlendingFunction::Linear)
    );
    let spec = parse(
        RIGHT,
        &[
            "zones.transition.box={min=[0,0],max=[1,1]}",
            "conditions.top.displacement.on=top",
        ],
    )
    .unwrap();
    assert!(matches!(
        spec.zones.transition.map(|t| t.into_inner()),
        Some(bondline::scene::spec::TransitionSpec::Box(_))
    ));
}

#[test]
fn wrong_overrides() {
    let e = parse(RIGHT, &["coupling=splice", "peridynamics.horizn=0.4"]).unwrap_err();
    check(
        &e,
        SceneErrorKind::UnknownKey,
        "horizn",
        "`horizn` is not known in `peridynamics`",
        "did you mean `horizon`?",
    );
    assert!(e.to_string().starts_with("--set:1: "), "{e}");
    let e = parse(RIGHT, &["coupling=spline"]).unwrap_err();
    check(
        &e,
        SceneErrorKind::UnknownKey,
        "\"spline\"",
        "`spline` is not known in `coupling`",
        "did you mean `splice`?",
    );
    let e = parse(RIGHT, &["materials.plate.fracture-energy=1"]).unwrap_err();
    check(
        &e,
        SceneErrorKind::UnknownKey,
        "fracture-energy",
        "`fracture-energy` is not known in `materials.plate`",
        "write it as `materials.plate.bond-based.fracture-energy`",
    );
    let e = parse(RIGHT, &["horizon"]).unwrap_err();
    check(
        &e,
        SceneErrorKind::Syntax,
        "horizon",
        "has no `=`",
        "--set key=value",
    );
    let e = parse(RIGHT, &["a b=1"]).unwrap_err();
    assert_eq!(e.kind(), SceneErrorKind::Syntax);
}

#[test]
fn a_shape_in_the_place_of_a_set_is_told_its_key() {
    let e = error(
        "[conditions.bottom.displacement]",
        "[conditions.shape.displacement]\non = { box = { min = [0, 0], max = [1, 1] } }\nx = 0\n[conditions.bottom.displacement]",
    );
    assert_eq!(e.kind(), SceneErrorKind::WrongType);
    assert!(
        e.remedy().unwrap().contains("is written as `inside`"),
        "{e}"
    );
}

#[test]
fn the_schema_knows_every_choice() {
    let schema = serde_json::to_string(&bondline::scene::schema()).unwrap();
    for word in [
        "partial-stress",
        "bond-based",
        "youngs-modulus",
        "graded",
        "cut-bonds",
        "Horizon δ",
    ] {
        assert!(schema.contains(word), "{word}");
    }
}

#[test]
fn the_right_scene_is_validated() {
    let AnyScene::Plane(scene) = build(RIGHT, &[]).unwrap() else {
        panic!("a plane scene")
    };
    assert_eq!(scene.mesh.cell_count(), 200);
    // columns of cells of width 0.1: centroids 0.65 … 1.35 are nonlocal, 0.35, 0.45, 0.55 and 1.45, 1.55, 1.65 transition
    let count = |zone| scene.zones.iter().filter(|z| **z == zone).count();
    assert_eq!(count(Zone::Nonlocal), 80);
    assert_eq!(count(Zone::Transition), 60);
    // plane stress with ν = 1/3: λ = μ = 3/8 E
    assert!((scene.materials[0].lame().unwrap().0 - 75.0).abs() < 1e-12);
    assert!((scene.materials[0].lame().unwrap().1 - 75.0).abs() < 1e-12);
    // in one dimension C = λ + 2 μ = E
    let AnyScene::Bar(bar) = build(Template::Bar.text(), &[]).unwrap() else {
        panic!("a bar")
    };
    assert!(
        (bar.materials[0].lame().unwrap().0 + 2.0 * bar.materials[0].lame().unwrap().1 - 200e9)
            .abs()
            < 1.0
    );
}

#[test]
fn templates_are_right_and_never_overwritten() {
    build(Template::Plate.text(), &[]).unwrap();
    build(Template::Bar.text(), &[]).unwrap();
    build(Template::Dynamics.text(), &[]).unwrap();
    build(Template::LoadSteps.text(), &[]).unwrap();
    parse(Template::File.text(), &[]).unwrap();
    // the one that names a mesh says so where there is none
    let e = build(Template::File.text(), &[]).unwrap_err();
    check(
        &e,
        SceneErrorKind::Mesh,
        "\"plate.msh\"",
        "plate.msh",
        "relative to the scene",
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    for template in Template::ALL {
        template.write(&path).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), template.text());
        let e = template.write(&path).unwrap_err();
        assert!(e.to_string().contains("nothing is overwritten"), "{e}");
        std::fs::remove_file(&path).unwrap();
    }
    let e = bondline_study::load(&path, &[]).unwrap_err();
    assert_eq!(e.kind(), SceneErrorKind::File);
    assert!(e.to_string().contains("bondline new"), "{e}");
}

#[test]
fn keys_in_the_wrong_table() {
    let unread = |from: &str, to: &str| {
        assert!(RIGHT.contains(from), "{from}");
        parse(&RIGHT.replacen(from, to, 1), &[]).unwrap_err()
    };
    let e = unread(
        "[materials.plate.bond-based]\nyoungs-modulus = 200",
        "[materials.plate]\nyoungs-modulus = 200",
    );
    check(
        &e,
        SceneErrorKind::UnknownKey,
        "youngs-modulus",
        "`youngs-modulus` is not known in `materials.plate`",
        "`materials.plate.lps.youngs-modulus`",
    );
    let e = unread(
        "bond-based]\nyoungs-modulus = 200",
        "bond-based]\nyoungs-modulus = 200\npoisson-ratio = 0.3",
    );
    check(
        &e,
        SceneErrorKind::UnknownKey,
        "poisson-ratio",
        "`poisson-ratio` is not known in `materials.plate.bond-based`",
        "1/3 in plane stress",
    );
    let e = parse("kinematics = \"solid\"\nmesh.path = \"a.msh\"", &[]).unwrap_err();
    check(
        &e,
        SceneErrorKind::UnknownKey,
        "path",
        "`path` is not known in `mesh`",
        "mesh.file.path",
    );
}

#[test]
fn wrong_numbers() {
    let text = RIGHT.replacen("youngs-modulus = 200", "youngs-modulus = \"3 GPa\"", 1);
    let e = parse(&text, &[]).unwrap_err();
    assert!(e.message().contains("a number has no unit here"), "{e}");
    let e = wrong("youngs-modulus = 200", "youngs-modulus = -200");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "-200",
        "`materials.plate.bond-based.youngs-modulus` is -200",
        "larger than 0",
    );
    let e = wrong(
        "bond-based]\nyoungs-modulus = 200",
        "lps]\nyoungs-modulus = 200\npoisson-ratio = 0.5",
    );
    check(
        &e,
        SceneErrorKind::WrongValue,
        "0.5",
        "poisson-ratio` is 0.5",
        "0.49",
    );
    let e = wrong("\"3/10\"", "\"-3/10\"");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "\"-3/10\"",
        "`peridynamics.horizon` is -0.3",
        "larger than 0",
    );
    let e = wrong("spacing = 0.1", "spacing = 0");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "0",
        "spacing` is 0",
        "larger than 0",
    );
    let e = wrong("spacing = 0.1", "spacing = 1e-9");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "1e-9",
        "points would fill the mesh",
        "larger spacing",
    );
    let e = wrong(
        "[zones.nonlocal]",
        "[solver]\ntolerance = 2\n[zones.nonlocal]",
    );
    check(
        &e,
        SceneErrorKind::WrongValue,
        "2",
        "`solver.tolerance` is 2",
        "1e-10",
    );
    let e = wrong(
        "[zones.nonlocal]",
        "[solver]\nmax-iterations = 0\n[zones.nonlocal]",
    );
    check(
        &e,
        SceneErrorKind::WrongValue,
        "0",
        "`solver.max-iterations` is 0",
        "at least 1",
    );
}

#[test]
fn horizon_below_the_spacing() {
    let e = wrong("\"3/10\"", "0.05");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "0.05",
        "below the spacing 0.1",
        "three to six spacings",
    );
    // only somewhere
    let e = wrong("\"3/10\"", "\"if(y > 0.9, 0.01, 0.3)\"");
    assert!(e.message().contains("0.95]"), "{e}");
    let e = wrong("\"3/10\"", "\"0.3 + z\"");
    check(
        &e,
        SceneErrorKind::Dimension,
        "\"0.3 + z\"",
        "uses z in a scene of dimension 2",
        "x and y only",
    );
    let e = wrong("\"3/10\"", "\"0.3 / (x - x)\"");
    assert!(e.message().contains("inf at"), "{e}");
}

#[test]
fn influence_functions_that_do_not_exist() {
    let e = wrong(
        "[zones.nonlocal]",
        "influence = { degree = 2 }\n[zones.nonlocal]",
    );
    check(
        &e,
        SceneErrorKind::WrongValue,
        "2",
        "degree n = 2",
        "0, 1, 3, 5 or 7",
    );
    let e = wrong(
        "[zones.nonlocal]",
        "influence = { degree = 3, alpha = 2 }\n[zones.nonlocal]",
    );
    check(
        &e,
        SceneErrorKind::WrongValue,
        "2",
        "alpha = 2",
        "alpha is 0 or 1",
    );
    let e = error(
        "[zones.nonlocal]",
        "influence = \"gausian\"\n[zones.nonlocal]",
    );
    check(
        &e,
        SceneErrorKind::UnknownKey,
        "\"gausian\"",
        "`gausian` is not known",
        "did you mean `gaussian`?",
    );
}

#[test]
fn wrong_meshes() {
    let e = wrong("max = [2, 1]", "max = [2, 0]");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "[2, 0]",
        "from 0 to 0 along y",
        "larger",
    );
    let e = wrong("max = [2, 1]", "max = [2, 1, 3]");
    check(
        &e,
        SceneErrorKind::Dimension,
        "[2, 1, 3]",
        "has 3 coordinates in a scene of dimension 2",
        "[0.1, 0.2]",
    );
    let e = wrong("cells = 20", "cells = 0");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "0",
        "cells` is 0",
        "at least 1",
    );
    let e = wrong("cells = 20", "cells = 1e12");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "{ cells = 1e12 }",
        "more than",
        "fewer cells",
    );
    let e = wrong("\"plane-stress\"", "\"solid\"");
    check(
        &e,
        SceneErrorKind::Dimension,
        "\"solid\"",
        "`mesh.rectangle` is of dimension 2",
        "[mesh.box]",
    );
    let e = wrong(
        "y = { cells = 10 }",
        "y = { cells = 10 }\ncutouts = { hole = { min = [0.33, 0.4], max = [0.5, 0.6] } }",
    );
    check(&e, SceneErrorKind::Mesh, "hole", "0.33", "");
    let e = wrong(
        "x = { cells = 20 }",
        "x = { graded = { fine = [0.5, 3], spacing = 0.1 } }",
    );
    check(
        &e,
        SceneErrorKind::Mesh,
        "{ graded = { fine = [0.5, 3], spacing = 0.1 } }",
        "must lie within",
        "",
    );
}

#[test]
fn wrong_zones() {
    let e = wrong(
        "min = [0.6, 0], max = [1.4, 1]",
        "min = [5, 0], max = [6, 1]",
    );
    assert_eq!(e.kind(), SceneErrorKind::Empty);
    assert!(
        e.message().contains("`zones.nonlocal` is empty")
            && e.remedy().unwrap().contains("[2.0, 1.0]"),
        "{e}"
    );
    let e = wrong("around = 0.3", "around = 0.01");
    assert!(e.message().contains("`zones.transition` is empty"), "{e}");
    let e = wrong("around = 0.3", "box = { min = [1, 0], max = [1.8, 1] }");
    assert_eq!(e.kind(), SceneErrorKind::Conflict);
    assert!(e.message().contains("overlaps 40 of the 80 cells"), "{e}");
    let e = wrong("[zones.transition]\naround = 0.3\n", "");
    assert!(
        e.message()
            .contains("coupling `blending` needs a transition zone"),
        "{e}"
    );
    let e = wrong("around = 0.3", "around = 3");
    assert!(e.message().contains("nothing is local"), "{e}");
    let e = wrong(
        "box = { min = [0.6, 0], max = [1.4, 1] }",
        "set = \"crack\"",
    );
    check(
        &e,
        SceneErrorKind::UnknownSet,
        "\"crack\"",
        "the mesh has no set `crack`",
        "`all`",
    );
    let e = wrong(
        "box = { min = [0.6, 0], max = [1.4, 1] }",
        "near = { within = 0.1 }",
    );
    check(
        &e,
        SceneErrorKind::Choice,
        "0.1",
        "names no shape",
        "`segment`",
    );
    // what has no seam needs no zone
    build(RIGHT, &["coupling=local"]).unwrap();
    build(RIGHT, &["coupling=nonlocal"]).unwrap();
    let text = RIGHT.replace(
        "[peridynamics]\nhorizon = \"3/10\"\npoints.lattice = { spacing = 0.1 }\n",
        "",
    );
    build(&text, &["coupling=local"]).unwrap();
    let e = build(&text, &["coupling=splice"]).unwrap_err();
    check(
        &e,
        SceneErrorKind::Missing,
        "\"splice\"",
        "needs [peridynamics]",
        "horizon",
    );
}

#[test]
fn wrong_conditions() {
    let e = wrong("on = \"bottom\"", "on = \"botom\"");
    check(
        &e,
        SceneErrorKind::UnknownSet,
        "\"botom\"",
        "`conditions.bottom.displacement.on`: the mesh has no set `botom`",
        "did you mean `bottom`?",
    );
    let e = wrong("on = \"top\"", "on = \"all\"");
    check(
        &e,
        SceneErrorKind::UnknownSet,
        "\"all\"",
        "is no set of edges",
        "`left`",
    );
    let e = wrong("y = \"1 + x\"", "z = 1");
    check(
        &e,
        SceneErrorKind::Dimension,
        "1",
        "`conditions.top.traction.z` in a scene of dimension 2",
        "remove `z`",
    );
    let e = wrong("y = \"1 + x\"", "");
    check(
        &e,
        SceneErrorKind::Missing,
        "top",
        "prescribes no component",
        "x = 0 or y = 0",
    );
    let e = wrong("y = \"1 + x\"", "y = \"sqrt(x - 1)\"");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "\"sqrt(x - 1)\"",
        "`conditions.top.traction.y` is NaN at [0.1, 1.0]",
        "if(condition",
    );
    let e = wrong("on = \"bottom\"\n", "");
    check(
        &e,
        SceneErrorKind::Choice,
        "bottom",
        "neither `on` nor `inside`",
        "on = ",
    );
    let e = wrong(
        "on = \"bottom\"",
        "inside.box = { min = [5, 5], max = [6, 6] }",
    );
    check(
        &e,
        SceneErrorKind::Empty,
        "bottom",
        "holds no part of the mesh",
        "[2.0, 1.0]",
    );
    let e = wrong(
        "[conditions.bottom.displacement]\non = \"bottom\"",
        "[conditions.bottom.body-force]",
    );
    assert_eq!(e.kind(), SceneErrorKind::Missing);
    assert!(e.message().contains("nothing holds the body"), "{e}");
    let e = wrong(
        "[conditions.top.traction]",
        "[conditions.left.displacement]\non = \"left\"\ny = \"1e-3 + y\"\n[conditions.top.traction]",
    );
    assert_eq!(e.kind(), SceneErrorKind::Conflict);
    assert!(
        e.message().contains(
            "`bottom` and `left` prescribe the y displacements 0 and 0.001 at [0.0, 0.0]"
        ),
        "{e}"
    );
}

#[test]
fn wrong_voids_and_cracks() {
    let with = |table: &str| build(&format!("{RIGHT}{table}"), &[]).unwrap_err();
    let e = with("[cracks.notch]\nsegment = { from = [0, 0.5], to = [1, 0.5] }");
    check(
        &e,
        SceneErrorKind::Conflict,
        "notch",
        "passes through the local zone",
        "near",
    );
    let e = with("[cracks.notch]\nball = { center = [1, 0.5], radius = 0.1 }");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "notch",
        "is no surface",
        "[voids.NAME]",
    );
    let e = with("[cracks.notch]\nsegment = { from = [1, 0.5], to = [1, 0.5] }");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "[1, 0.5]",
        "has no length",
        "move one of its ends",
    );
    let e = with("[cracks.notch]\nsegment = { from = [7, 0.5], to = [8, 0.5] }");
    check(
        &e,
        SceneErrorKind::Empty,
        "notch",
        "outside the mesh",
        "[2.0, 1.0]",
    );
    let e = with("[voids.hole]\ninside.segment = { from = [0.8, 0.5], to = [1.2, 0.5] }");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "hole",
        "has no volume",
        "[cracks.NAME]",
    );
    let e = with("[voids.hole]\ninside.ball = { center = [0, 0.5], radius = 0.2 }");
    check(
        &e,
        SceneErrorKind::Conflict,
        "hole",
        "which is not nonlocal",
        "cutouts",
    );
    build(
        &format!("{RIGHT}[voids.hole]\ninside.ball = {{ center = [1, 0.5], radius = 0.2 }}"),
        &[],
    )
    .unwrap();
}

#[test]
fn wrong_materials() {
    let two = "[materials.rest.bond-based]\nyoungs-modulus = 1\n[peridynamics]";
    let e = wrong("[peridynamics]", two);
    assert_eq!(e.kind(), SceneErrorKind::Conflict);
    assert!(
        e.message().contains("`plate` and `rest` both lack `cells`"),
        "{e}"
    );
    let e = wrong(
        "youngs-modulus = 200",
        "youngs-modulus = 200\ncells = \"plate\"",
    );
    check(
        &e,
        SceneErrorKind::UnknownSet,
        "\"plate\"",
        "no set `plate`",
        "`all`",
    );
    let e = wrong(
        "[materials.plate.bond-based]\nyoungs-modulus = 200",
        "[materials]",
    );
    assert_eq!(e.kind(), SceneErrorKind::Missing);
}

#[test]
fn wrong_outputs() {
    let with = |table: &str| build(&format!("{RIGHT}{table}"), &[]).unwrap_err();
    let e = with("[output.lines.mid]\nfrom = [0, 0]\nto = [1, 1]\nsamples = 1");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "1",
        "`output.lines.mid.samples` is 1",
        "two ends",
    );
    let e = with("[output.probes.far]\nat = [9, 9]");
    check(
        &e,
        SceneErrorKind::Empty,
        "[9, 9]",
        "lies outside the mesh",
        "[2.0, 1.0]",
    );
    let e = with("[output.probes.far]\nat = 9");
    check(
        &e,
        SceneErrorKind::Dimension,
        "9",
        "has 1 coordinate in",
        "[0.1, 0.2]",
    );
}

#[test]
fn a_law_that_a_seam_does_not_balance_is_told_a_coupling_that_takes_it() {
    let laws = [
        ("neo-hooke]\npoisson-ratio = 0.3", "splice"),
        ("neo-hooke]\npoisson-ratio = 0.3", "truncated"),
        ("hardening]\nhardening = 20", "truncated"),
    ];
    for (law, takes) in laws {
        let text = RIGHT.replacen("bond-based]", law, 1);
        let refused = build(&text, &[]).expect_err("a law that is not linear");
        let remedy = refused.remedy().unwrap_or_default();
        let told = format!("coupling = \"{takes}\"");
        assert!(remedy.contains(&told), "{refused}");
        let seam = "[coupling.blending]\nbeta = \"constant\"";
        let text = text.replacen(seam, &format!("[coupling.{takes}]"), 1);
        let text = text.replacen("[zones.transition]\naround = 0.3\n", "", 1);
        build(&text, &[]).unwrap_or_else(|e| panic!("{law}: {e}"));
    }
}
