//! A scene: loaded, checked, run.

use std::path::PathBuf;

use bondline::run::{AnyScene, RunOptions, StartFrom};
use bondline::scene::{Source, read};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::attend::{Ending, attend};
use crate::errors::{check_error, defect, run_error, scene_error};
use crate::frame::{columns, frame};
use crate::function::{Functions, Raised};
use crate::mesh::Mesh;
use crate::value::{table, value_at};

/// A validated scene.
#[pyclass(frozen, module = "bondline._bondline")]
pub struct Scene {
    source: Source,
    directory: PathBuf,
    name: String,
    scene: AnyScene,
    raised: Raised,
}

/// Keys with other values, as after `--set`, and the functions of the scene with those among them.
fn set(
    mut source: Source,
    overrides: &Bound<'_, PyDict>,
    mut functions: Functions,
) -> PyResult<(Source, Raised)> {
    let py = overrides.py();
    for (key, value) in overrides {
        let key: String = key.extract()?;
        let value = value_at(&value, &key, 0, &mut functions)?;
        source
            .push_override(&format!("{key}={value}"))
            .map_err(|e| scene_error(py, e))?;
    }
    Ok((source.with_functions(functions.list), functions.raised))
}

impl Scene {
    /// Validates a scene. What an `accuracy` or `zones = "auto"` leaves open takes runs of it, so the interpreter goes on meanwhile.
    fn validated(
        py: Python<'_>,
        (source, raised): (Source, Raised),
        directory: PathBuf,
        name: String,
    ) -> PyResult<Self> {
        let (of_job, place, title) = (source.clone(), directory.clone(), name.clone());
        let scene = attend(
            py,
            Ending::GivenUp,
            None,
            |_| Ok(()),
            move |_, _| bondline_study::from_source(&of_job, &place, &title),
        )?;
        Ok(Self {
            source,
            directory,
            name,
            scene: raised.instead_of(scene.map_err(|e| scene_error(py, e)))?,
            raised,
        })
    }
}

#[pymethods]
impl Scene {
    /// From a file.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf, overrides: &Bound<'_, PyDict>) -> PyResult<Self> {
        let (source, directory, name) = read(&path, &[]).map_err(|e| scene_error(py, e))?;
        let source = set(source, overrides, Functions::default())?;
        Self::validated(py, source, directory.to_path_buf(), name)
    }

    /// From a dictionary with the keys of a scene file, and perhaps a mesh in memory.
    #[staticmethod]
    fn from_table(
        keys: &Bound<'_, PyDict>,
        directory: PathBuf,
        name: String,
        mesh: Option<&Mesh>,
        overrides: &Bound<'_, PyDict>,
    ) -> PyResult<Self> {
        let mut functions = Functions::default();
        let text = table(keys, "", 0, &mut functions)?.to_string();
        let mut source = Source::new(name.clone(), text);
        if let Some(mesh) = mesh {
            source = source.with_mesh(mesh.parts.clone());
        }
        let source = set(source, overrides, functions)?;
        Self::validated(keys.py(), source, directory, name)
    }

    /// Returns true if the scene has a history in time.
    #[getter]
    fn moves(&self) -> bool {
        self.scene.moves()
    }

    /// The name that files begin with.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// The names of the probes in the order in which they are typed.
    #[getter]
    fn probes(&self) -> Vec<String> {
        self.source.typed_keys(&["output", "probes"])
    }

    /// The scene as one TOML text.
    fn text(&self, py: Python<'_>) -> PyResult<String> {
        let table = self.source.table().map_err(|e| scene_error(py, e))?;
        Ok(table.to_string())
    }

    /// The prediction as JSON.
    fn check(
        &self,
        py: Python<'_>,
        pilots: Option<f64>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<String> {
        let (source, directory) = (self.source.clone(), self.directory.clone());
        let name = self.name.clone();
        let found = attend(
            py,
            Ending::InOrder,
            progress,
            |_| Ok(()),
            move |watched, _| {
                bondline_study::check_source(&source, &directory, &name, pilots, watched)
            },
        )?;
        let found = found.map_err(|e| check_error(py, e));
        let prediction = self.raised.instead_of(found)?;
        serde_json::to_string(&prediction).map_err(|e| defect(py, &e.to_string()))
    }

    /// Runs the scene; returns its summary as JSON and its tables by name, columns and numbers. Each solution is handed to `take`.
    fn run<'py>(
        &self,
        py: Python<'py>,
        output: Option<PathBuf>,
        threads: Option<usize>,
        resume: bool,
        progress: Option<&Bound<'py, PyAny>>,
        take: &Bound<'py, PyAny>,
    ) -> PyResult<(String, Bound<'py, PyDict>)> {
        let mut scene = self.scene.clone();
        let files = output.is_some();
        if let Some(output) = output {
            scene.set_output_directory(output);
        }
        let pool = pool(py, threads)?;
        let visit = |shown| take.call1(frame(py, shown)?).map(drop);
        let (summary, tables) = attend(
            py,
            Ending::InOrder,
            progress,
            visit,
            move |watched, outlet| {
                let outlet = outlet.with_files(files);
                let options = RunOptions {
                    start: match resume {
                        true => StartFrom::Checkpoint,
                        false => StartFrom::Beginning,
                    },
                    interrupt: Some(&watched.stop),
                    heeds: Some(&watched.heeded),
                    observer: Some(&outlet),
                    ..RunOptions::default()
                };
                let summary = match pool {
                    Some(pool) => pool.install(|| scene.run_with(&options, watched)),
                    None => scene.run_with(&options, watched),
                };
                (summary, outlet.into_tables())
            },
        )?;
        let summary = summary.map_err(|e| run_error(py, &e));
        let summary = self.raised.instead_of(summary)?;
        let text = summary.json().map_err(|e| defect(py, &e.to_string()))?;
        let by_name = PyDict::new(py);
        for table in tables {
            let name = table.name.clone();
            by_name.set_item(name, columns(py, table)?)?;
        }
        Ok((text, by_name))
    }
}

/// Threads of their own for a run, if it wants another number than the process has.
fn pool(py: Python<'_>, threads: Option<usize>) -> PyResult<Option<rayon::ThreadPool>> {
    let build = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build();
    let made = threads.map(build).transpose();
    made.map_err(|e| defect(py, &format!("no threads can be started: {e}")))
}
