//! A scene as text, run in a folder of its own, and its summary; or its model alone.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use bondline::model::ModelError;
use bondline::observe::summary::RunSummary;
use bondline::progress::Silent;
use bondline::run::{AnyScene, RunError, Samples, SceneModel, Solved, solve_with};
use bondline::scene::{Scene, Source};
use bondline::tensor::Vector;
use bondline_study::Prediction;

/// A folder that is removed with all its files when it is dropped.
#[derive(Debug)]
pub struct Folder(PathBuf);

impl Folder {
    /// A new folder among the system's temporary files, holding `files` (name, text).
    ///
    /// # Errors
    /// The message of the operating system.
    pub fn with(files: &[(&str, &str)]) -> Result<Self, String> {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let name = format!("bondline-meshes-{}-{number}", std::process::id());
        let folder = Self(std::env::temp_dir().join(name));
        std::fs::create_dir_all(&folder.0).map_err(|e| e.to_string())?;
        for (name, text) in files {
            std::fs::write(folder.0.join(name), text).map_err(|e| e.to_string())?;
        }
        Ok(folder)
    }

    /// Returns its path.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // what lies there is of no further use
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A scene beside the files in `folder`.
///
/// # Errors
/// The message of a refusal.
pub fn load(text: &str, overrides: &[&str], folder: &Folder) -> Result<AnyScene, String> {
    let mut source = Source::new("scene.toml", text);
    for o in overrides {
        source
            .push_override(o)
            .map_err(|e| e.message().to_owned())?;
    }
    let mut scene = bondline_study::from_source(&source, folder.path(), "scene")
        .map_err(|e| e.message().to_owned())?;
    scene.set_output_directory(folder.path().join("out"));
    Ok(scene)
}

/// Runs a scene beside the files that it names (meshes, tables) to its end.
///
/// # Errors
/// The message of a refusal.
pub fn run(text: &str, overrides: &[&str], files: &[(&str, &str)]) -> Result<RunSummary, String> {
    let folder = Folder::with(files)?;
    let scene = load(text, overrides, &folder)?;
    scene.run(&Silent).map_err(|e| e.to_string())
}

/// Runs a scene in time to its end and returns a column of its history.
///
/// # Errors
/// The message of a refusal, or of a history without the column.
pub fn history(
    text: &str,
    overrides: &[&str],
    files: &[(&str, &str)],
    column: &str,
) -> Result<Vec<f64>, String> {
    let folder = Folder::with(files)?;
    let scene = load(text, overrides, &folder)?;
    scene.run(&Silent).map_err(|e| e.to_string())?;
    let path = folder.path().join("out/scene_history.csv");
    let table = std::fs::read_to_string(path).map_err(|e| e.to_string())?;
    let mut lines = table.lines();
    let header = lines.next().unwrap_or_default();
    let place = header.split(',').position(|name| name == column);
    let place = place.ok_or_else(|| format!("the history has no column {column}: {header}"))?;
    lines
        .map(|line| {
            let entry = line.split(',').nth(place).unwrap_or_default();
            entry.parse().map_err(|_| format!("`{entry}` is no number"))
        })
        .collect()
}

/// Runs a scene to its end and returns what its output files hold, by their names; none for one that was not written.
///
/// # Errors
/// The message of a refusal.
pub fn files(text: &str, names: &[&str]) -> Result<Vec<Option<String>>, String> {
    outputs(text, &[], &[], names).map(|found| found.1)
}

/// As [`files`], of a scene beside the `files` that it names, with its summary.
///
/// # Errors
/// The message of a refusal.
pub fn outputs(
    text: &str,
    overrides: &[&str],
    files: &[(&str, &str)],
    names: &[&str],
) -> Result<(RunSummary, Vec<Option<String>>), String> {
    let folder = Folder::with(files)?;
    let scene = load(text, overrides, &folder)?;
    let summary = scene.run(&Silent).map_err(|e| e.to_string())?;
    let read = |name: &&str| std::fs::read_to_string(folder.path().join("out").join(name)).ok();
    Ok((summary, names.iter().map(read).collect()))
}

/// Returns the prediction of `check` for a scene, without that of the error.
///
/// # Errors
/// The message of a refusal.
pub fn check(text: &str, overrides: &[&str], files: &[(&str, &str)]) -> Result<Prediction, String> {
    let folder = Folder::with(files)?;
    let scene = load(text, overrides, &folder)?;
    bondline_study::predict(scene, &Silent).map_err(|e| e.to_string())
}

/// Displacements of a static scene at `places`, which become its own sites where there are none; see [`AnyScene::samples`].
///
/// # Errors
/// The message of a refusal.
pub fn samples(
    text: &str,
    overrides: &[&str],
    files: &[(&str, &str)],
    places: &mut Vec<[f64; 3]>,
) -> Result<Samples, String> {
    let folder = Folder::with(files)?;
    let scene = load(text, overrides, &folder)?;
    scene.samples(places, &Silent).map_err(|e| e.to_string())
}

/// Failure to make the model of a scene.
#[derive(Debug, thiserror::Error)]
pub enum SceneFailure {
    /// The scene is refused.
    #[error("{0}")]
    Scene(String),
    /// Its model is.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl SceneFailure {
    /// Returns true if the seam of truncated bonds cannot be fitted.
    pub fn is_seam(&self) -> bool {
        matches!(
            self,
            Self::Run(RunError::Model(
                ModelError::Seam { .. } | ModelError::TwoDilatations
            ))
        )
    }
}

impl From<ModelError> for SceneFailure {
    fn from(error: ModelError) -> Self {
        Self::Run(error.into())
    }
}

/// The model of a scene of `D` dimensions beside the files that it names (meshes), laid out as its run does.
///
/// # Errors
/// The message of a refusal, one of a scene of another dimension among them.
pub fn model<const D: usize>(
    text: &str,
    files: &[(&str, &str)],
) -> Result<SceneModel<D>, SceneFailure> {
    let scene = Folder::with(files).and_then(|folder| load(text, &[], &folder));
    let scene = scene.map_err(SceneFailure::Scene)?.of_dimension::<D>();
    let scene = scene.ok_or_else(|| {
        SceneFailure::Scene(format!(
            "the scene has another dimension than {D}; change its kinematics"
        ))
    })?;
    Ok(SceneModel::new(scene)?)
}

/// A site of a solved static scene: its place, its displacement, and the volume that it stands for.
#[derive(Clone, Debug, PartialEq)]
pub struct Site {
    /// Reference position \[m\], `D` numbers.
    pub position: Vec<f64>,
    /// Displacement \[m\], `D` numbers.
    pub displacement: Vec<f64>,
    /// Volume \[m^D\].
    pub volume: f64,
}

/// Solves a static scene and returns its sites beside the summary.
///
/// # Errors
/// The message of a refusal.
pub fn solve(
    text: &str,
    overrides: &[&str],
    files: &[(&str, &str)],
) -> Result<(RunSummary, Vec<Site>), String> {
    let folder = Folder::with(files)?;
    match load(text, overrides, &folder)? {
        AnyScene::Bar(s) => sites(s.scene),
        AnyScene::Plane(s) => sites(s.scene),
        AnyScene::Solid(s) => sites(s.scene),
    }
}

fn sites<const D: usize>(scene: Scene<D>) -> Result<(RunSummary, Vec<Site>), String> {
    let mut sites = Vec::new();
    let summary = solve_with(scene, &Silent, |_, solved: &Solved<'_, D>| {
        sites = (solved.model.sites.iter().enumerate())
            .map(|(s, site)| Site {
                position: components(&site.position),
                displacement: solved.displacement[s * D..][..D].to_vec(),
                volume: site.volume,
            })
            .collect();
        Ok(Vec::new())
    });
    Ok((summary.map_err(|e| e.to_string())?, sites))
}

fn components<const D: usize>(v: &Vector<D>) -> Vec<f64> {
    v.iter().copied().collect()
}
