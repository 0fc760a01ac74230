//! Results of the checks of a model before it is solved, as data: one part per check, for people and as JSON.
//!
//! The checks themselves are in `run::proof`; limits and their reasons are in `docs/proof.md`.

use std::fmt;

use serde::Serialize;

use super::warning::Warning;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// The run goes on with a warning.
    Warning,
    /// The run does not start.
    Refusal,
}

/// A figure beyond its limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Its severity.
    pub severity: Severity,
    /// The figure, in the unit that the part states.
    pub value: f64,
    /// The limit that it exceeds, in the same unit.
    pub limit: f64,
    /// The defect, its place, its effect and remedies.
    #[serde(flatten)]
    pub warning: Warning,
}

/// A figure of a check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// Quantity that it measures.
    pub name: String,
    /// Its value.
    pub value: f64,
}

/// Result of one check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Part {
    /// The check: `loads`, `affine`, `surface`, `symmetry`, `quadratic`, `growth`.
    pub name: &'static str,
    /// Result within its limits, in a few words.
    pub line: String,
    /// Every figure, for `--json`.
    pub figures: Vec<Figure>,
    /// Figures beyond their limits.
    pub findings: Vec<Finding>,
}

/// Results of all checks of a model before it is solved.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Proof {
    /// The checks that the scene called for.
    pub parts: Vec<Part>,
}

impl Proof {
    /// Returns true if nothing was checked.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// The findings that let the run go on.
    pub fn warnings(&self) -> impl Iterator<Item = &Warning> {
        let findings = self.parts.iter().flat_map(|p| &p.findings);
        findings
            .filter(|f| f.severity == Severity::Warning)
            .map(|f| &f.warning)
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
    /// One line per part; findings are listed among the warnings.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for part in &self.parts {
            writeln!(f, "proof: {:<16} {}", part.name, part.line)?;
        }
        Ok(())
    }
}
