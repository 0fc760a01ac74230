//! What was shown about a model before it was solved, as data: one part per check, for people and as JSON.
//!
//! The checks themselves are in `scene::proof`; limits and their reasons are in `docs/proof.md`.

use std::fmt;

use serde::Serialize;

/// How a finding is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// The run goes on and tells it.
    Warning,
    /// The run does not start.
    Refusal,
}

/// A figure beyond its limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// How it is taken.
    pub severity: Severity,
    /// Where, one coordinate per dimension \[m\]; empty where no single place is to blame.
    pub place: Vec<f64>,
    /// The figure, in the unit that the part states.
    pub value: f64,
    /// The limit that it exceeds, in the same unit.
    pub limit: f64,
    /// What is wrong, where, by how much, and what to do: one sentence for people.
    pub message: String,
}

/// A figure of a check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// What it measures.
    pub name: String,
    /// Its value.
    pub value: f64,
}

/// What one check has shown.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Part {
    /// The check: `loads`, `affine`, `surface`, `symmetry`, `quadratic`, `growth`.
    pub name: &'static str,
    /// What it found within its limits, in a few words.
    pub line: String,
    /// Every figure, for `--json`.
    pub figures: Vec<Figure>,
    /// What lies beyond the limits.
    pub findings: Vec<Finding>,
}

/// What was shown about a model before it was solved.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Proof {
    /// The checks that the scene called for.
    pub parts: Vec<Part>,
}

impl Proof {
    /// Whether nothing was checked.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// The messages of all findings of one severity.
    pub fn messages(&self, severity: Severity) -> impl Iterator<Item = &str> {
        let findings = self.parts.iter().flat_map(|p| &p.findings);
        findings
            .filter(move |f| f.severity == severity)
            .map(|f| f.message.as_str())
    }
}

impl Proof {
    /// The largest size of the figures whose names begin so; 0 without any.
    pub fn largest(&self, name: &str) -> f64 {
        let figures = self.parts.iter().flat_map(|p| &p.figures);
        let named = figures.filter(|f| f.name.starts_with(name));
        named.map(|f| f.value.abs()).fold(0.0, f64::max)
    }
}

impl fmt::Display for Proof {
    /// One line per part; findings are told among the warnings.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for part in &self.parts {
            writeln!(f, "proof: {:<16} {}", part.name, part.line)?;
        }
        Ok(())
    }
}
