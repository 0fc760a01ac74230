//! One case in a process of its own: its cost, and its outputs.

use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::pareto::parameters::{Cost, TradeError};
use crate::variants::Measured;
use bondline::observe::claim;

/// A case that ran.
pub(super) struct Ran {
    pub cost: Cost,
    pub measured: Measured,
}

/// Outcome of an attempt to run a case.
pub(super) enum Attempt {
    Ran(Ran),
    Refused(String),
    OverTime,
    Interrupted,
}

/// Between looks at a process.
const LOOK: Duration = Duration::from_millis(5);

/// Runs below this are repeated, and the fastest counts.
const SHORT: f64 = 0.5;

/// Program, scene and interrupt flag with which cases run.
pub(super) struct Runner<'a> {
    /// This program.
    pub program: &'a Path,
    pub scene: &'a Path,
    /// Names of the scene's probes, in the order of their rows.
    pub probes: Vec<String>,
    pub interrupt: Option<&'a AtomicBool>,
}

/// Cost and outputs of a run that has ended, from its folder and its summary.
fn read_outcome(folder: &Path, summary: &Path, probes: &[String]) -> Result<Attempt, TradeError> {
    let file_error = |source| TradeError::File {
        path: folder.to_path_buf(),
        source,
    };
    let text = std::fs::read_to_string(summary).map_err(file_error)?;
    let summary: serde_json::Value =
        serde_json::from_str(&text).map_err(|e| TradeError::Summary {
            text: text.clone(),
            why: e.to_string(),
        })?;
    let stages = summary["timings"].as_array().into_iter().flatten();
    let output: f64 = stages
        .filter(|s| s["name"] == "output")
        .filter_map(|s| s["seconds"].as_f64())
        .sum();
    let number = |v: &serde_json::Value| v.as_f64().unwrap_or(0.0);
    let steps = summary["motion"]["steps"].as_f64().unwrap_or(1.0);
    let cost = Cost {
        seconds: number(&summary["total_seconds"]) - output,
        memory: number(&summary["peak_memory_bytes"]),
        bond_visits: number(&summary["sizes"]["bonds"]) * steps,
        unknowns: number(&summary["sizes"]["dofs"]),
    };
    let measured = Measured::read(folder, &summary, probes).map_err(file_error)?;
    Ok(Attempt::Ran(Ran { cost, measured }))
}

impl Runner<'_> {
    /// Runs the scene with overrides in a process of its own; its files go to `folder`.
    pub(super) fn run(
        &self,
        overrides: &[String],
        folder: &Path,
        limit: Duration,
    ) -> Result<Attempt, TradeError> {
        let mut best: Option<Ran> = None;
        for _ in 0..3 {
            match self.once(overrides, folder, limit)? {
                Attempt::Ran(ran) => {
                    let (short, faster) = (
                        ran.cost.seconds < SHORT,
                        best.as_ref()
                            .is_none_or(|b| ran.cost.seconds < b.cost.seconds),
                    );
                    if faster {
                        best = Some(ran);
                    }
                    if !short {
                        break;
                    }
                }
                other => return Ok(other),
            }
        }
        Ok(best.map_or(Attempt::OverTime, Attempt::Ran))
    }

    fn once(
        &self,
        overrides: &[String],
        folder: &Path,
        limit: Duration,
    ) -> Result<Attempt, TradeError> {
        let file_error = |source| TradeError::File {
            path: folder.to_path_buf(),
            source,
        };
        if let Some((process, _)) = claim::holder(folder) {
            return Err(TradeError::Busy {
                path: folder.to_path_buf(),
                process,
            });
        }
        if folder.exists() {
            std::fs::remove_dir_all(folder).map_err(file_error)?;
        }
        std::fs::create_dir_all(folder).map_err(file_error)?;
        let (summary, complaint) = (folder.join("summary.json"), folder.join("complaint.txt"));
        let file = |path: &Path| std::fs::File::create(path).map_err(file_error);
        let mut child = Command::new(self.program)
            .arg("run")
            .arg(self.scene)
            .args(["--json", "--output"])
            .arg(folder)
            .args(overrides.iter().flat_map(|o| ["--set", o]))
            .args(["--set", "output.vtu=false"])
            .stdin(Stdio::null())
            .stdout(file(&summary)?)
            .stderr(file(&complaint)?)
            .spawn()
            .map_err(|source| TradeError::Program {
                path: self.program.to_path_buf(),
                source,
            })?;
        let start = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait().map_err(file_error)? {
                break status;
            }
            let interrupted = self.interrupt.is_some_and(|f| f.load(Ordering::Relaxed));
            if interrupted || start.elapsed() > limit {
                // it may have ended by itself in between
                let _ = child.kill();
                let _ = child.wait();
                return Ok(if interrupted {
                    Attempt::Interrupted
                } else {
                    Attempt::OverTime
                });
            }
            std::thread::sleep(LOOK);
        };
        // 3: damage reached the edge of the zone; what was written until then is no answer to the scene
        if !status.success() {
            let text = std::fs::read_to_string(&complaint).map_err(file_error)?;
            return Ok(Attempt::Refused(if status.code() == Some(3) {
                "damage reached the edge of the nonlocal zone".to_owned()
            } else {
                one_line(&text)
            }));
        }
        read_outcome(folder, &summary, &self.probes)
    }
}

/// Returns the complaint of a program, without frames and places, on one line.
fn one_line(text: &str) -> String {
    let plain: Vec<&str> = text
        .lines()
        .map(|l| l.trim_matches(|c: char| c.is_whitespace() || "×│╰─├▶·╭╮╯┬┴,".contains(c)))
        .filter(|l| !l.is_empty())
        // the picture of the place
        .take_while(|l| !l.starts_with('[') && !l.starts_with("help"))
        .collect();
    plain.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_complaint_becomes_a_line() {
        let text =
            "  × the override `a` has no `=`\n  │ and more of it\n   ╭─[--set:1:1]\n 1 │ a\n";
        assert_eq!(one_line(text), "the override `a` has no `=` and more of it");
    }
}
