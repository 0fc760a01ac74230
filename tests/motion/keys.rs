//! Every key of a scene in time, wrong once.

use std::path::Path;

use bondline::run::AnyScene;
use bondline::scene::{SceneError, SceneErrorKind, SceneSpec, Source};

use crate::{BREAKING, MODE};

fn wrong(scene: &str, from: &str, to: &str) -> SceneError {
    assert!(scene.contains(from), "{from}");
    let source = Source::new("bar.toml", scene.replacen(from, to, 1));
    if let Err(error) = SceneSpec::parse(&source) {
        return error;
    }
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    AnyScene::from_source(&source, folder, "bar").expect_err("this scene is wrong")
}

// One function: the cases are a table and share nothing.
#[test]
fn every_key_says_what_is_wrong_with_it() {
    use SceneErrorKind::{Choice, Conflict, Dimension, Missing, UnknownKey, WrongType, WrongValue};
    let cases: &[(&str, &str, &str, SceneErrorKind, &str, &str)] = &[
        (
            MODE,
            "duration = 5",
            "duration = -5",
            WrongValue,
            "`solve.explicit.duration` is -5",
            "larger than 0",
        ),
        (
            MODE,
            "duration = 5",
            "",
            Missing,
            "`solve.explicit` lacks `duration`",
            "add `duration",
        ),
        (
            MODE,
            "duration = 5",
            "duration = 5\ndurations = 2",
            UnknownKey,
            "`durations`",
            "`duration`",
        ),
        (
            MODE,
            "[solve.explicit]",
            "[solve.explicite]",
            UnknownKey,
            "`explicite`",
            "`explicit`",
        ),
        (
            MODE,
            "duration = 5",
            "duration = 5\nstep = 0",
            WrongValue,
            "`solve.explicit.step` is 0",
            "auto",
        ),
        (
            MODE,
            "duration = 5",
            "duration = 5\nstep = \"automatic\"",
            WrongValue,
            "automatic",
            "expressions know",
        ),
        (
            MODE,
            "duration = 5",
            "duration = 5\nstep = true",
            WrongType,
            "solve.explicit.step",
            "auto",
        ),
        (
            MODE,
            "duration = 5",
            "duration = 5\nstep-fraction = 1.2",
            WrongValue,
            "step-fraction` is 1.2",
            "0.95",
        ),
        (
            MODE,
            "duration = 5",
            "duration = 5\nsub-steps = 40",
            WrongValue,
            "`solve.explicit.sub-steps` is 40",
            "2 or 3",
        ),
        (
            MODE,
            "duration = 5",
            "duration = 5\nbeyond-limit = \"ignore\"",
            UnknownKey,
            "`ignore`",
            "`refuse`",
        ),
        (
            MODE,
            "duration = 5",
            "duration = 5\noutput-interval = 1",
            Conflict,
            "both `outputs` and `output-interval`",
            "keep one",
        ),
        (
            MODE,
            "outputs = 2",
            "outputs = 1000000",
            WrongValue,
            "VTU files",
            "limit",
        ),
        (
            MODE,
            "outputs = 2",
            "history-interval = 9",
            WrongValue,
            "history-interval` is 9",
            "fraction",
        ),
        (
            MODE,
            "outputs = 2",
            "checkpoint-every = 0",
            WrongValue,
            "`0` is no pace",
            "schema",
        ),
        (
            MODE,
            "outputs = 2",
            "checkpoint-every = \"3 days\"",
            WrongValue,
            "`3 days` is no pace",
            "schema",
        ),
        (
            MODE,
            "density = 1",
            "",
            Missing,
            "the material `bar` has no density",
            "density = ",
        ),
        (
            MODE,
            "sin(pi * x / 2)",
            "sin(t)",
            Conflict,
            "`initial.mode.displacement.x` depends on the time",
            "conditions",
        ),
        (MODE, "sin(pi * x / 2)", "ln(x)", WrongValue, "-inf", "if("),
        (
            MODE,
            "x = 0",
            "y = 0",
            Dimension,
            "`conditions.left.displacement.y`",
            "remove",
        ),
        (
            MODE,
            "[conditions.left.displacement]\non = \"left\"\nx = 0",
            "[conditions.left.velocity]\non = \"left\"\nx = \"x*t\"",
            Conflict,
            "time and on position",
            "integral",
        ),
        (
            MODE,
            "x = 0",
            "x = \"1 / (t - 5)\"",
            WrongValue,
            "t = 5",
            "if(",
        ),
        (
            MODE,
            "[output]",
            "[no-fail.a]\npoint = 0.5\n[output]",
            Conflict,
            "no bond of the material `bar` breaks",
            "fracture-energy",
        ),
        (
            BREAKING,
            "critical-stretch = 0.002",
            "critical-stretch = 0.002\nfracture-energy = 1",
            Choice,
            "at once",
            "keep one",
        ),
        (
            BREAKING,
            "critical-stretch = 0.002",
            "fracture-energy = 0",
            WrongValue,
            "fracture-energy` is 0",
            "larger than 0",
        ),
        (
            BREAKING,
            "critical-stretch = 0.002",
            "",
            Conflict,
            "no bond of the material `plate` breaks",
            "fracture-energy",
        ),
        (
            BREAKING,
            "direction = [0, -1]",
            "direction = [0, 0]",
            WrongValue,
            "`output.tips.notch.direction` is zero",
            "crack runs",
        ),
        (
            BREAKING,
            "threshold = 0.2",
            "threshold = 2",
            WrongValue,
            "threshold` is 2",
            "0.35",
        ),
        (BREAKING, "\"warn\"", "\"go\"", UnknownKey, "`go`", "`stop`"),
        (
            BREAKING,
            "[output]",
            "[contact]\nradius-factor = 1.5\n[output]",
            WrongValue,
            "radius-factor` is 1.5",
            "neighbours at rest",
        ),
        (
            BREAKING,
            "[output]",
            "[contact]\nstiffness-factor = 0\n[output]",
            WrongValue,
            "stiffness-factor` is 0",
            "larger",
        ),
        (
            BREAKING,
            "horizon = 1.5",
            "horizon = 1.5\nbonds = \"precise\"",
            UnknownKey,
            "`precise`",
            "`exact`",
        ),
        (
            BREAKING,
            "[conditions.right.displacement]",
            "[conditions.right.velocity]\non = \"left\"\nx = 0\n[conditions.rightmost.displacement]",
            Conflict,
            "`left` and `right`",
            "agree",
        ),
    ];
    for (scene, from, to, kind, message, help) in cases {
        let error = wrong(scene, from, to);
        assert_eq!(error.kind(), *kind, "{to}: {error}");
        assert!(error.message().contains(message), "{to}: {error}");
        let remedy = error.remedy().unwrap_or_default();
        assert!(remedy.contains(help), "{to}: {remedy}");
        let underlined = error.underlined();
        assert!(!underlined.is_empty(), "{to}: {error}");
    }
    // static scenes know neither velocities nor starts
    let still = MODE.replace("[solve.explicit]\nduration = 5\noutputs = 2", "");
    let error = wrong(&still, "density = 1", "density = 1");
    assert!(error.message().contains("does not move"), "{error}");
}
