//! Wrong scenes: each message names the place, the value and the remedy, and underlines the token at fault.

use bondline::scene::{SceneError, SceneErrorKind, SceneSpec, Source};

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
    let shown = format!("{:?}", error.clone().report());
    assert!(
        shown.contains(underlined.lines().next().unwrap()),
        "{shown}"
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
    let e = error("\"1 + x\"", "\"sin(t)\"");
    check(
        &e,
        SceneErrorKind::WrongValue,
        "\"sin(t)\"",
        "explicit driver",
        "",
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
    let e = error("[coupling.blending]\nbeta = \"constant\"", "");
    assert_eq!(e.kind(), SceneErrorKind::Missing);
    assert!(e.message().contains("the scene lacks `coupling`"), "{e}");
}

#[test]
fn missing_horizon() {
    let e = error("horizon = \"3/10\"\n", "");
    assert_eq!(e.kind(), SceneErrorKind::Missing);
    assert!(
        e.message().contains("`peridynamics` lacks `horizon`"),
        "{e}"
    );
    assert!(e.remedy().unwrap().contains("spacing"), "{e}");
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
    use bondline::scene::spec::{BetaSpec, CouplingSpec};
    let spec = parse(
        RIGHT,
        &[
            "peridynamics.horizon=0.4",
            "title=My plate",
            "coupling.blending.beta=smooth",
        ],
    )
    .unwrap();
    assert_eq!(spec.peridynamics.unwrap().horizon.as_constant(), Some(0.4));
    assert_eq!(spec.title.as_deref(), Some("My plate"));
    assert!(
        matches!(spec.coupling.into_inner(), CouplingSpec::Blending(b) if b.beta == BetaSpec::Smooth)
    );
    for choice in [
        "coupling=splice",
        "coupling.splice={}",
        "coupling = \"splice\"",
    ] {
        let spec = parse(RIGHT, &[choice]).unwrap();
        assert!(
            matches!(spec.coupling.into_inner(), CouplingSpec::Splice(_)),
            "{choice}"
        );
    }
    // a second override sees the first
    let spec = parse(RIGHT, &["coupling=splice", "coupling.blending.beta=linear"]).unwrap();
    assert!(
        matches!(spec.coupling.into_inner(), CouplingSpec::Blending(b) if b.beta == BetaSpec::Linear)
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
        spec.zones.transition,
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
