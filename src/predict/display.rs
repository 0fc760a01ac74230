//! A prediction, as people read it.

use std::fmt;

use super::processes;
use super::resource_estimate::Prediction;
use crate::observe::report::{aligned, number};
use crate::observe::summary::{bytes_text, grouped};
impl fmt::Display for Prediction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found = match &self.counted {
            None => "the scene is right".to_owned(),
            Some(why) => {
                format!("counted from volumes, not proven: {why}; `run` proves it before it solves")
            }
        };
        writeln!(
            f,
            "{} ({}D, coupling: {}): {found}\n",
            self.scene, self.dimension, self.coupling
        )?;
        let s = &self.sizes;
        let mut grid = vec![vec!["size".to_owned(), "number".to_owned()]];
        for (name, value) in [
            ("FE nodes", s.nodes),
            ("FE cells", s.cells),
            ("PD points", s.points),
            ("bonds", s.bonds),
            ("sites", s.sites),
            ("unknowns", self.unknowns),
            ("non-zeros", s.nonzeros),
            ("factor non-zeros", self.factor_nonzeros as usize),
        ] {
            if self.motion.is_some() && name.ends_with("non-zeros") {
                // bonds are passed over, not assembled
                continue;
            }
            grid.push(vec![name.to_owned(), grouped(value)]);
        }
        writeln!(f, "{}", aligned(&grid))?;
        for c in &self.choices {
            writeln!(f, "chosen: {} ({})", c.choice, c.why)?;
        }
        writeln!(f, "{}", self.proof)?;
        for share in &self.memory {
            writeln!(
                f,
                "memory of {:<12} {}",
                share.name,
                bytes_text(share.bytes)
            )?;
        }
        writeln!(
            f,
            "peak memory            {}",
            bytes_text(self.peak_memory_bytes)
        )?;
        if self.operations > 0.0 {
            writeln!(
                f,
                "factorisation          {:.1e} operations",
                self.operations
            )?;
        }
        self.write_steps(f)?;
        if !self.processes.is_empty() {
            writeln!(f, "\n{}", aligned(&processes::table(&self.processes)))?;
            writeln!(f, "distributed            by {}", self.distribution)?;
        }
        writeln!(
            f,
            "time                   about {:.1} s on {} threads",
            self.total_seconds,
            rayon::current_num_threads()
        )?;
        self.write_error(f)?;
        for warning in &self.warnings {
            writeln!(f, "{warning}")?;
        }
        Ok(())
    }
}

impl Prediction {
    /// The steps of a scene in time.
    fn write_steps(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(m) = &self.motion {
            writeln!(
                f,
                "stable step            {} (row sums guarantee {}; their largest is at {:?})",
                number(m.stable_step),
                number(m.certified_step),
                m.certified_at
            )?;
            writeln!(
                f,
                "steps                  {} of {}, {:.3e} s each",
                grouped(m.steps as usize),
                number(m.step),
                m.seconds_per_step
            )?;
        }
        Ok(())
    }

    /// Writes the predicted difference of the results from those of a finer model, or the reason why it is not known.
    fn write_error(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(e) = &self.error {
            writeln!(
                f,
                "error                  about {} of {} against {}, within a factor of {} in {} that were measured (order {:.1}, from {} runs with other spacings, {:.2} s)",
                number(e.error),
                e.quantities.join(", "),
                e.against,
                e.spread,
                e.share,
                e.order,
                e.pilots,
                e.seconds
            )?;
        } else if let Some(why) = &self.no_error {
            writeln!(f, "error                  not predicted: {why}")?;
        }
        Ok(())
    }
}
