//! Small runs of a scene.

use std::path::{Path, PathBuf};

use crate::variants::{self, Measured, Quantity};
use bondline::observe::summary::RunSummary;
use bondline::predict::output_cost::TrialFolder;
use bondline::progress::Silent;
use bondline::run::AnyScene;
use bondline::scene::Source;
use bondline::scene::spec::SceneSpec;

/// A run, as far as it is compared.
#[derive(Clone, Debug)]
pub struct Pilot {
    pub measured: Measured,
    /// Seconds of all stages but output.
    pub seconds: f64,
    /// Seconds that it would take by counting, [`work`].
    pub work: f64,
    /// Peridynamic points.
    pub points: usize,
}

/// Seconds of a run but for its output, by its counts and the rates of one machine: a choice between candidates is the same whatever else a
/// machine does. Rates are those of `bondline run examples/slit_plate.toml` (blended, spliced, truncated; two cores), per bond, cell, stored
/// scalar, operation and scalar of the factors, and of `cargo bench --bench bonds -- passes`; only their ratios count.
fn work(summary: &RunSummary) -> f64 {
    let [bonds, cells, dofs, nonzeros] = [
        summary.sizes.bonds,
        summary.sizes.cells,
        summary.sizes.dofs,
        summary.sizes.nonzeros,
    ]
    .map(|n| n as f64);
    let layout = 1.1e-6 * bonds + 4e-6 * cells;
    let iterations = summary.iterations as f64;
    let solved = match (&summary.motion, summary.factor_nonzeros as f64) {
        (Some(motion), _) => {
            let passes = (motion.steps as f64).max(iterations);
            passes * (1.5e-9 * bonds + 20e-9 * cells + 5e-9 * dofs)
        }
        (None, 0.0) => nonzeros * (1e-7 + 8e-9 * iterations),
        (None, factor) => {
            // the mean row of the factors squared, times rows: the operations of the slit plate to a fifth; L alone has half of the scalars
            let half = if summary.energy.is_some() { 2.0 } else { 1.0 };
            let operations = 1.2 * half * factor * factor / dofs;
            35e-9 * nonzeros + operations / 7e9 + 2e-9 * factor * (1.0 + iterations)
        }
    };
    layout + solved
}

/// Setting in which the pilots of one scene run.
pub struct Bench {
    source: Source,
    directory: PathBuf,
    folder: TrialFolder,
    common: Vec<String>,
    /// Quantities to compare; known after the first run.
    pub quantities: Vec<Quantity>,
    /// Seconds of all pilots.
    pub seconds: f64,
    /// Reason why the last pilot did not run.
    pub refusal: Option<String>,
}

impl Bench {
    /// Pilots of `source`, of which `spec` is a complete version.
    pub fn new(source: &Source, directory: &Path, spec: &SceneSpec) -> Self {
        Self {
            source: source.clone(),
            directory: directory.to_path_buf(),
            folder: TrialFolder::new(directory),
            common: variants::quiet(spec),
            quantities: Vec::new(),
            seconds: 0.0,
            refusal: None,
        }
    }

    /// Runs the scene with these keys; `None` if it does not run.
    pub fn run(&mut self, overrides: &[String]) -> Option<Pilot> {
        match self.once(overrides) {
            Ok(pilot) => {
                self.seconds += pilot.seconds;
                if self.quantities.is_empty() {
                    self.quantities = pilot.measured.quantities();
                }
                Some(pilot)
            }
            Err(why) => {
                self.refusal = Some(why);
                None
            }
        }
    }

    fn once(&self, overrides: &[String]) -> Result<Pilot, String> {
        let mut source = self.source.clone();
        for o in self.common.iter().chain(overrides) {
            source
                .push_override(o)
                .map_err(|e| e.message().to_owned())?;
        }
        let mut scene = AnyScene::complete(&source, &self.directory, "pilot")
            .map_err(|e| e.message().to_owned())?;
        // what an earlier pilot left
        let _ = std::fs::remove_dir_all(self.folder.path());
        scene.set_output_directory(self.folder.path().to_path_buf());
        let summary = scene.run(&Silent).map_err(|e| e.to_string())?;
        let seconds = summary.total_seconds - summary.timings.seconds("output");
        let work = work(&summary);
        let json = serde_json::to_value(&summary).map_err(|e| e.to_string())?;
        let measured = Measured::read(self.folder.path(), &json, &[]).map_err(|e| e.to_string())?;
        Ok(Pilot {
            measured,
            seconds,
            work,
            points: summary.sizes.points,
        })
    }
}
