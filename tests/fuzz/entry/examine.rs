//! A scene to its end: solved with finite numbers and a small residual, or refused by name.

use std::path::Path;

use bondline::observe::ObserveError;
use bondline::run::{AnyScene, PlacedScene, RunError, RunOptions};
use bondline::scene::{SceneError, SceneErrorKind, Solve};
use bondline::{RunSummary, Silent};

use super::size::IS_INSTRUMENTED;
use super::variant;

/// The most steps in time that are run.
const MOST_STEPS: u64 = if IS_INSTRUMENTED { 60 } else { 200 };
/// The most iterations that a load step is given.
const MOST_ITERATIONS: usize = 3000;
/// The most iterations times bonds.
const MOST_WORK: usize = if IS_INSTRUMENTED {
    5_000_000
} else {
    40_000_000
};
/// The relative residual above which a static scene does not count as solved. The solvers promise the scene's tolerance, 1e-10 by default.
const RESIDUAL: f64 = 1e-8;

/// Outcome of a case, if it ended as it should.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// It was solved.
    Solved,
    /// It was refused: the kind of the error.
    Refused(String),
    /// It was not tried: why.
    Skipped(&'static str),
}

/// Checks that the error of a scene says what is wrong, where, and what to do.
pub fn refused(error: &SceneError) -> Outcome {
    let text = error.to_string();
    assert!(!error.message().is_empty(), "no message: {text}");
    // what the reader of TOML says of a syntax error leaves the remedy open; what a mesh says ends with it
    let syntax = error.kind() == SceneErrorKind::Syntax;
    let within = error.kind() == SceneErrorKind::Mesh
        && [": ", "; "].iter().any(|c| error.message().contains(c));
    assert!(
        syntax || within || error.remedy().is_some(),
        "no remedy: {text}"
    );
    assert!(
        !error.underlined().is_empty() || error.message().contains('`') || syntax,
        "no place: {text}"
    );
    // a terminal shows it without trouble
    let _ = format!("{:?}", bondline_terminal::report(error.clone()));
    Outcome::Refused(format!("scene: {:?}", error.kind()))
}

fn failed(error: &RunError) -> Outcome {
    let text = error.to_string();
    let is_finite = !matches!(error, RunError::Observe(ObserveError::NotFinite { .. }));
    assert!(is_finite, "{text}");
    assert!(
        text.contains("; ") || text.contains(": "),
        "no remedy: {text}"
    );
    let name = variant(error);
    let inner = format!("{error:?}");
    let inner = inner[name.len()..].trim_start_matches('(');
    let inner: String = inner.chars().take_while(|c| c.is_alphanumeric()).collect();
    Outcome::Refused(format!("run: {name} {inner}"))
}

/// Runs a scene that is small enough, whose files go into `folder`.
pub fn examine(scene: AnyScene, folder: &Path) -> Outcome {
    match ended(scene, folder) {
        Ok(_) => Outcome::Solved,
        Err(outcome) => outcome,
    }
}

/// As [`examine`], with the summary of a scene that is solved.
///
/// # Errors
/// The [`Outcome`] of any other scene.
pub fn ended(scene: AnyScene, folder: &Path) -> Result<RunSummary, Outcome> {
    match scene {
        AnyScene::Bar(s) => run(*s, AnyScene::Bar, folder),
        AnyScene::Plane(s) => run(*s, AnyScene::Plane, folder),
        AnyScene::Solid(s) => run(*s, AnyScene::Solid, folder),
    }
}

fn run<const D: usize>(
    mut scene: PlacedScene<D>,
    wrap: fn(Box<PlacedScene<D>>) -> AnyScene,
    folder: &Path,
) -> Result<RunSummary, Outcome> {
    if scene.mesh.cell_count() > 2 * super::size::MOST_CELLS {
        return Err(Outcome::Skipped("large"));
    }
    scene.output.directory = folder.into();
    scene.output.name = "fuzz".into();
    let moves = scene.solve != Solve::Static;
    scene.output.vtu |= !moves;
    match &mut scene.solve {
        Solve::QuasiStatic(q) => q.max_iterations = q.max_iterations.min(MOST_ITERATIONS),
        Solve::Explicit(e) => e.checkpoint_every = None,
        Solve::Static => {}
    }
    let prediction = match bondline_study::predict(wrap(Box::new(scene.clone())), &Silent) {
        Ok(prediction) => prediction,
        // what `check` refuses a run refuses too, or else the check is wrong
        Err(error) => {
            let outcome = failed(&error);
            let steps = matches!(&scene.solve, Solve::Explicit(e) if e.step.is_some());
            if !steps && let Ok(summary) = solve(wrap(Box::new(scene))) {
                panic!("check refuses ({error}) what a run solves: {summary}");
            }
            return Err(outcome);
        }
    };
    if prediction
        .motion
        .as_ref()
        .is_some_and(|m| m.steps > MOST_STEPS)
    {
        return Err(Outcome::Skipped("many steps"));
    }
    let affordable = MOST_WORK / prediction.sizes.bonds.max(1);
    if let Solve::QuasiStatic(q) = &mut scene.solve {
        q.max_iterations = q.max_iterations.min(affordable);
    }
    if let Some(stage) = &mut scene.before {
        let q = &mut stage.solve;
        q.max_iterations = q.max_iterations.min(MOST_ITERATIONS.min(affordable));
    }
    let summary = solve(wrap(Box::new(scene))).map_err(|error| failed(&error))?;
    finite(&summary);
    if moves {
        numbers_in_tables_are_finite(folder);
    } else {
        assert!(summary.residual <= RESIDUAL, "{summary}");
    }
    Ok(summary)
}

/// Runs a scene, whose fields and tables have to be finite: they are looked at where they are written.
fn solve(scene: AnyScene) -> Result<RunSummary, RunError> {
    scene.run_with(&RunOptions::default(), &Silent)
}

fn finite(summary: &RunSummary) {
    let mut numbers = vec![summary.residual, summary.out_of_balance_relative];
    numbers.extend(&summary.out_of_balance_force);
    numbers.extend(summary.reactions.iter().flat_map(|r| &r.force));
    numbers.extend(summary.energy);
    if let Some(m) = &summary.motion {
        numbers.extend([m.time, m.step, m.kinetic_energy, m.stored_energy]);
        numbers.extend([m.external_work, m.missing_energy]);
    }
    assert!(numbers.iter().all(|v| v.is_finite()), "{summary}");
}

fn numbers_in_tables_are_finite(folder: &Path) {
    let files = std::fs::read_dir(folder).expect("the run made it");
    for file in files.flatten() {
        let path = file.path();
        if path.extension().is_none_or(|e| e != "csv") {
            continue;
        }
        let text = std::fs::read_to_string(&path).expect("tables are text");
        for (row, line) in text.lines().enumerate().skip(1) {
            let wrong = line.split(',').find(|w| {
                let number = w.trim().parse::<f64>();
                number.is_ok_and(|v| !v.is_finite())
            });
            assert_eq!(wrong, None, "{} row {row}: {line}", path.display());
        }
    }
}
