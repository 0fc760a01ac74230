//! Provenance of results: program, scene, machine and times of a run, in one file beside its outputs.
//!
//! Outputs themselves hold version and scene alone, so that those of two runs of a scene are equal byte by byte.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::Serialize;

use super::ObserveError;
use super::atomic_file::write_whole;
use super::summary::{RunSummary, Timings};

/// Version of the library.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// End of the file's name.
pub(crate) const PROVENANCE: &str = ".run.json";

/// The fingerprint of a scene as files name it, 16 hexadecimal digits.
pub(crate) fn scene_hash(fingerprint: u64) -> String {
    format!("{fingerprint:016x}")
}

/// Program and scene, as a comment in a file names them.
pub(crate) fn origin(fingerprint: u64) -> String {
    format!("bondline {VERSION}, scene {}", scene_hash(fingerprint))
}

/// A program that runs scenes.
#[derive(Clone, Copy, Debug)]
pub struct Program<'a> {
    /// Commit that it was built from; none where it was not built from a clone.
    pub commit: Option<&'a str>,
}

/// Program, scene, machine and times of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Provenance<'a> {
    /// Version of the program.
    version: &'static str,
    /// Commit that the program was built from; none where it was not built from a clone.
    commit: Option<&'a str>,
    /// Title of the scene.
    scene: &'a str,
    /// Fingerprint of all of the scene that determines its results, overrides and mesh files included.
    scene_hash: &'a str,
    /// Program and arguments.
    command_line: Vec<String>,
    /// Threads of a process.
    threads: usize,
    /// Processes.
    processes: usize,
    /// Name of the processor, where the system tells it.
    processor: Option<String>,
    /// End of the run, in seconds since 1970-01-01 00:00 UTC.
    ended_unix_seconds: u64,
    /// Wall-clock seconds of each stage.
    timings: &'a Timings,
    /// Wall-clock seconds of all stages.
    total_seconds: f64,
    /// Most memory held, in bytes.
    peak_memory_bytes: Option<u64>,
    /// Files that the run wrote.
    files: &'a [PathBuf],
}

impl<'a> Provenance<'a> {
    /// Provenance of a run that this process has ended on rayon's threads.
    pub fn new(summary: &'a RunSummary, program: Program<'a>, processes: usize) -> Self {
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        Self {
            version: VERSION,
            commit: program.commit,
            scene: &summary.scene,
            scene_hash: &summary.scene_hash,
            command_line: std::env::args_os()
                .map(|argument| argument.to_string_lossy().into_owned())
                .collect(),
            threads: rayon::current_num_threads(),
            processes,
            processor: processor(),
            ended_unix_seconds: now.map_or(0, |time| time.as_secs()),
            timings: &summary.timings,
            total_seconds: summary.total_seconds,
            peak_memory_bytes: summary.peak_memory_bytes,
            files: &summary.files,
        }
    }

    /// Writes it as JSON.
    ///
    /// # Errors
    /// [`ObserveError::Folder`] or [`ObserveError::Write`].
    pub fn write(&self, path: &Path) -> Result<(), ObserveError> {
        write_whole(path, |out| {
            serde_json::to_writer_pretty(&mut *out, self)?;
            writeln!(out)
        })
    }
}

/// Name of the processor, on Linux.
fn processor() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
