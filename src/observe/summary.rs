//! Summary of one run: sizes, choices made, seconds per stage, memory, balance of forces.

use std::fmt;
use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;

pub use super::motion_summary::{Ended, EnergyGain, ImpactorSummary, MotionSummary, Rotation};
use super::proof::Proof;
pub use super::report::grouped;
use super::report::{aligned, components, number};
use super::tip_summary::TipSummary;
use super::warning::Warning;

/// Seconds of one stage.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stage {
    /// Name of the stage.
    pub name: String,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// Seconds of all stages, in the order in which they first ran.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Timings {
    /// The stages.
    pub stages: Vec<Stage>,
}

impl Timings {
    /// Adds seconds to a stage; a new name starts a new stage.
    pub fn add(&mut self, name: &str, seconds: f64) {
        match self.stages.iter_mut().find(|s| s.name == name) {
            Some(stage) => stage.seconds += seconds,
            None => self.stages.push(Stage {
                name: name.to_owned(),
                seconds,
            }),
        }
    }

    /// Adds all stages to those of `other`.
    pub fn add_to(&self, other: &mut Self) {
        for stage in &self.stages {
            other.add(&stage.name, stage.seconds);
        }
    }

    /// Runs `work` and adds its time to a stage.
    pub fn measure<T>(&mut self, name: &str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.add(name, start.elapsed().as_secs_f64());
        result
    }

    /// Seconds of a stage; zero if it never ran.
    pub fn seconds(&self, name: &str) -> f64 {
        self.stages
            .iter()
            .find(|s| s.name == name)
            .map_or(0.0, |s| s.seconds)
    }

    /// Seconds of all stages together.
    pub fn total(&self) -> f64 {
        self.stages.iter().map(|s| s.seconds).sum()
    }
}

/// Splits the time since its start into laps.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    last: Instant,
}

impl Default for Stopwatch {
    fn default() -> Self {
        Self::start()
    }
}

impl Stopwatch {
    /// Starts now.
    pub fn start() -> Self {
        Self {
            last: Instant::now(),
        }
    }

    /// Adds the seconds since the start or the last lap to a stage.
    pub fn lap(&mut self, timings: &mut Timings, name: &str) {
        let now = Instant::now();
        timings.add(name, (now - self.last).as_secs_f64());
        self.last = now;
    }
}

/// The most memory that this process has held so far, in bytes; `None` where the system does not tell (it does on Linux).
///
/// It never falls, so a figure for one of several computations in one process is only an upper bound.
pub fn peak_memory_bytes() -> Option<u64> {
    peak_in_status(&std::fs::read_to_string("/proc/self/status").ok()?)
}

/// The memory that this process holds now, in bytes; `None` where the system does not tell.
pub fn resident_memory_bytes() -> Option<u64> {
    in_status(
        &std::fs::read_to_string("/proc/self/status").ok()?,
        "VmRSS:",
    )
}

fn peak_in_status(status: &str) -> Option<u64> {
    in_status(status, "VmHWM:")
}

fn in_status(status: &str, key: &str) -> Option<u64> {
    let line = status.lines().find_map(|l| l.strip_prefix(key))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

/// Sizes of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Sizes {
    /// FE nodes of the mesh.
    pub nodes: usize,
    /// FE cells of the mesh.
    pub cells: usize,
    /// Places with unknowns: nodes and points that take part.
    pub sites: usize,
    /// PD points.
    pub points: usize,
    /// Bonds that are not cut, each direction counted.
    pub bonds: usize,
    /// Scalar unknowns before conditions.
    pub dofs: usize,
    /// Stored scalars of the tangent.
    pub nonzeros: usize,
}

/// A decision that the scene left open.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Decision {
    /// The choice made.
    pub choice: String,
    /// Its reason.
    pub why: String,
}

/// The force that a condition applies, or with which it holds the body.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConditionForce {
    /// The condition, as the scene names it.
    pub condition: String,
    /// Sum of its forces on all sites, one component per dimension. Units: N (per thickness in 2D, per section in 1D).
    pub force: Vec<f64>,
}

/// The force that the part of the body beyond a section exerts on the rest.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SectionForce {
    /// The section, as the scene names it.
    pub section: String,
    /// Force, one component per dimension. Units: N (per thickness in 2D, per section in 1D).
    pub force: Vec<f64>,
    /// Moment: none in 1D, about z in 2D, about x, y and z in 3D. Units: N m (per thickness in 2D).
    pub moment: Vec<f64>,
}

impl SectionForce {
    /// Force, then moment.
    pub fn numbers(&self) -> impl Iterator<Item = f64> + '_ {
        self.force.iter().chain(&self.moment).copied()
    }
}

/// Summary of one run, for `run --json` and for people.
///
/// Units: those of the scene; with SI units forces are in N and energies in J (per metre of thickness in 2D, per square
/// metre of section in 1D).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RunSummary {
    /// The scene's name or file.
    pub scene: String,
    /// Version of the program.
    pub version: &'static str,
    /// Fingerprint of all of the scene that determines its results, overrides and mesh files included: 16 hexadecimal digits.
    pub scene_hash: String,
    /// Space dimension.
    pub dimension: usize,
    /// Coupling method, as the scene names it.
    pub coupling: String,
    /// Sizes of the model.
    pub sizes: Sizes,
    /// Decisions that the scene left open.
    pub choices: Vec<Decision>,
    /// Seconds per stage.
    pub timings: Timings,
    /// Seconds of all stages.
    pub total_seconds: f64,
    /// Most memory held, in bytes; `null` where the system does not tell.
    pub peak_memory_bytes: Option<u64>,
    /// Krylov iterations, or refinement steps after a factorisation.
    pub iterations: usize,
    /// Scalars stored in the factors; zero without a factorisation.
    pub factor_nonzeros: u64,
    /// Norm of the residual on free unknowns over that of the applied (or reaction) forces.
    pub residual: f64,
    /// Sum of all internal forces, one component per dimension; zero in a model without ghost forces at rest.
    pub out_of_balance_force: Vec<f64>,
    /// Its norm over the sum of the norms of all applied nodal forces and nodal reactions.
    pub out_of_balance_relative: f64,
    /// Forces of the loads, at the end of the run.
    pub applied: Vec<ConditionForce>,
    /// Forces of the displacement conditions; of a run in time or in load steps those of the last row of its history.
    pub reactions: Vec<ConditionForce>,
    /// Forces in the sections that the scene asks for, at the end of the run.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sections: Vec<SectionForce>,
    /// Energy release rates and stress intensity factors at the tips of cracks, as far as the scene asks for them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tips: Vec<TipSummary>,
    /// Stored energy `½ uᵀ K u`; a coupled model with an unsymmetric tangent has none in the strict sense.
    pub energy: Option<f64>,
    /// Results of the checks of the model before it was solved.
    #[serde(skip_serializing_if = "Proof::is_empty")]
    pub proof: Proof,
    /// Properties of the model or the solution that may make results inaccurate.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<Warning>,
    /// The largest rotation of a finite element, from 2 degrees on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation: Option<Rotation>,
    /// Load steps that this run took before its motion.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stages: Vec<StageSummary>,
    /// Results of a scene in time; none of a static one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motion: Option<MotionSummary>,
    /// Files written.
    pub files: Vec<PathBuf>,
}

impl RunSummary {
    /// The summary as JSON; numbers that are not finite become `null`.
    ///
    /// # Errors
    /// Only if a path is not Unicode.
    pub fn json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string_pretty(self)
    }
}

/// Summary of load steps before a motion. Units as in [`RunSummary`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StageSummary {
    /// The stage, as the scene names it.
    pub stage: String,
    /// Steps, energies and cracks at its end.
    pub motion: MotionSummary,
    /// Forces of the loads at its end.
    pub applied: Vec<ConditionForce>,
    /// Forces of the displacement conditions at its end.
    pub reactions: Vec<ConditionForce>,
    /// Forces in sections at its end.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sections: Vec<SectionForce>,
}

impl fmt::Display for StageSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (stage, motion) = (&self.stage, &self.motion);
        writeln!(
            f,
            "stage                  {stage}: {} load steps to t = {}, stored energy {}, work {}, {} broken bonds",
            motion.steps,
            number(motion.time),
            number(motion.stored_energy),
            number(motion.external_work),
            motion.broken_bonds
        )?;
        let applied = self.applied.iter().map(|a| ("applied", a));
        let reactions = self.reactions.iter().map(|r| ("reaction", r));
        for (word, of) in applied.chain(reactions) {
            let (force, name) = (components(&of.force), &of.condition);
            writeln!(f, "{word:<22} {name}, at the end of {stage}: {force}")?;
        }
        Ok(())
    }
}

/// Bytes in the unit that a person would use.
pub fn bytes_text(bytes: u64) -> String {
    let mib = bytes as f64 / f64::from(1 << 20);
    if mib < 1024.0 {
        format!("{mib:.0} MiB")
    } else {
        format!("{:.2} GiB", mib / 1024.0)
    }
}

impl RunSummary {
    /// The table of sizes.
    fn write_sizes(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = &self.sizes;
        let mut grid = vec![vec!["size".to_owned(), "number".to_owned()]];
        for (name, value) in [
            ("FE nodes", s.nodes),
            ("FE cells", s.cells),
            ("PD points", s.points),
            ("bonds", s.bonds),
            ("sites", s.sites),
            ("unknowns", s.dofs),
            ("non-zeros", s.nonzeros),
        ] {
            if self.motion.is_some() && name == "non-zeros" {
                // bonds are passed over, not assembled
                continue;
            }
            grid.push(vec![name.to_owned(), grouped(value)]);
        }
        writeln!(f, "{}", aligned(&grid))?;
        Ok(())
    }

    /// Writes the residual and the balance of forces of a static solution.
    fn write_balance(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "relative residual      {} after {} iteration(s)",
            number(self.residual),
            self.iterations
        )?;
        writeln!(
            f,
            "out-of-balance force   {} relative to the sum of nodal loads and reactions ({})",
            number(self.out_of_balance_relative),
            components(&self.out_of_balance_force)
        )?;
        Ok(())
    }
}

impl fmt::Display for RunSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} ({}D, coupling: {})\n",
            self.scene, self.dimension, self.coupling
        )?;
        self.write_sizes(f)?;
        if !self.choices.is_empty() {
            for c in &self.choices {
                writeln!(f, "chosen: {} ({})", c.choice, c.why)?;
            }
            writeln!(f)?;
        }
        let mut grid = vec![vec!["stage".to_owned(), "seconds".to_owned()]];
        for stage in &self.timings.stages {
            grid.push(vec![stage.name.clone(), format!("{:.3}", stage.seconds)]);
        }
        grid.push(vec![
            "total".to_owned(),
            format!("{:.3}", self.total_seconds),
        ]);
        writeln!(f, "{}", aligned(&grid))?;
        if let Some(bytes) = self.peak_memory_bytes {
            writeln!(f, "peak memory            {}", bytes_text(bytes))?;
        }
        for stage in &self.stages {
            write!(f, "{stage}")?;
        }
        match &self.motion {
            Some(motion) => motion.write(self.dimension, f)?,
            None => self.write_balance(f)?,
        }
        if let Some(energy) = self.energy {
            writeln!(f, "stored energy          {}", number(energy))?;
        }
        let applied = self.applied.iter().map(|a| ("applied", a));
        let reactions = self.reactions.iter().map(|r| ("reaction", r));
        for (word, of) in applied.chain(reactions) {
            let force = components(&of.force);
            writeln!(f, "{word:<22} {}: {force}", of.condition)?;
        }
        for s in &self.sections {
            write!(
                f,
                "section                {}: force {}",
                s.section,
                components(&s.force)
            )?;
            match s.moment.is_empty() {
                true => writeln!(f)?,
                false => writeln!(f, ", moment {}", components(&s.moment))?,
            }
        }
        for tip in &self.tips {
            writeln!(f, "{tip}")?;
        }
        write!(f, "{}", self.proof)?;
        for warning in &self.warnings {
            writeln!(f, "{warning}")?;
        }
        for file in &self.files {
            writeln!(f, "wrote                  {}", file.display())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timings_add_up_by_name() {
        let mut timings = Timings::default();
        timings.add("assemble", 1.5);
        timings.add("solve", 2.0);
        timings.add("assemble", 0.25);
        let names: Vec<&str> = timings.stages.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["assemble", "solve"]);
        assert_eq!(timings.seconds("assemble"), 1.75);
        assert_eq!(timings.seconds("absent"), 0.0);
        assert_eq!(timings.total(), 3.75);
    }

    #[test]
    fn laps_cover_the_time_that_passed() {
        let mut timings = Timings::default();
        let begun = Instant::now();
        let mut watch = Stopwatch::start();
        std::thread::sleep(std::time::Duration::from_millis(20));
        watch.lap(&mut timings, "first");
        let answer = timings.measure("second", || {
            std::thread::sleep(std::time::Duration::from_millis(10));
            42
        });
        watch.lap(&mut timings, "third");
        let passed = begun.elapsed().as_secs_f64();
        assert_eq!(answer, 42);
        assert!(timings.seconds("first") >= 0.02 && timings.seconds("second") >= 0.01);
        let laps = timings.seconds("first") + timings.seconds("third");
        assert!(laps <= passed && laps >= 0.03);
    }

    #[test]
    fn peak_memory_is_read_in_bytes() {
        let status = "Name:\tx\nVmPeak:\t  999 kB\nVmHWM:\t   20480 kB\nVmRSS:\t 1 kB\n";
        assert_eq!(peak_in_status(status), Some(20 * 1024 * 1024));
        assert_eq!(peak_in_status("Name:\tx\n"), None);
        assert_eq!(peak_in_status("VmHWM:\t many kB\n"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn peak_memory_sees_an_allocation() {
        let before = peak_memory_bytes().unwrap();
        let block = vec![1u8; 64 << 20];
        let after = peak_memory_bytes().unwrap();
        assert_eq!(block.iter().map(|&b| u64::from(b)).sum::<u64>(), 64 << 20);
        assert!(after >= 64 << 20 && after >= before);
    }

    #[test]
    fn json_and_text_tell_the_same() {
        let mut summary = RunSummary {
            scene: "slit.toml".into(),
            dimension: 2,
            coupling: "splice".into(),
            sizes: Sizes {
                bonds: 1_234_567,
                ..Sizes::default()
            },
            choices: vec![Decision {
                choice: "LU".into(),
                why: "the tangent is not symmetric".into(),
            }],
            total_seconds: 1.5,
            peak_memory_bytes: Some(3 << 29),
            residual: f64::NAN,
            out_of_balance_force: vec![1e-3, -2.0],
            out_of_balance_relative: 2.5e-6,
            reactions: vec![ConditionForce {
                condition: "left".into(),
                force: vec![-1.0, 0.0],
            }],
            ..RunSummary::default()
        };
        summary.timings.add("assemble", 1.5);
        let json: serde_json::Value = serde_json::from_str(&summary.json().unwrap()).unwrap();
        assert_eq!(json["sizes"]["bonds"], 1_234_567);
        assert_eq!(json["timings"][0]["name"], "assemble");
        assert_eq!(json["residual"], serde_json::Value::Null);
        assert_eq!(json["reactions"][0]["force"][0], -1.0);
        let text = summary.to_string();
        for part in [
            "1 234 567",
            "chosen: LU (the tangent is not symmetric)",
            "1.50 GiB",
            "2.500e-6 relative",
            "left: -1, 0",
        ] {
            assert!(text.contains(part), "{part} is missing in\n{text}");
        }
    }

    #[test]
    fn whole_numbers_in_groups() {
        let texts = [0, 12, 123, 1234, 123_456, 1_234_567].map(grouped);
        assert_eq!(texts, ["0", "12", "123", "1 234", "123 456", "1 234 567"]);
    }
}
