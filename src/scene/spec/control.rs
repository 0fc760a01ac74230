//! Solver and output of a scene.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

use super::motion::TipSpec;
use super::region::ShapeSpec;
use crate::observe::warning::{Code, Policy};
use crate::scene::value::{Coordinates, Count, Number, Text};
use crate::solve::ordering::Ordering;
use crate::solve::statics::Method;

/// The linear solver.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct SolverSpec {
    /// Method of solution.
    #[serde(default)]
    pub method: Method,
    /// Relative residual at which the iteration stops; 1e-10 if left out.
    pub tolerance: Option<Number>,
    /// Most iterations; 500 if left out.
    pub max_iterations: Option<Count>,
    /// Elimination order of the direct solver.
    #[serde(default)]
    pub ordering: Ordering,
    /// Treatment of a model that fails its proof: affine or quadratic fields come out wrong, or loads do not add up.
    #[serde(default)]
    pub unproven: UnprovenSpec,
}

/// Treatment of a model that fails its proof.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum UnprovenSpec {
    /// It is not solved.
    #[default]
    Refuse,
    /// It is solved, with a warning.
    Warn,
}

/// Kinds of warnings by their codes, which `docs/manual/warnings.md` explains: `["W32"]`.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct WarningsSpec {
    /// Kinds that are left out. None if left out.
    #[serde(default)]
    pub allow: Vec<Code>,
    /// Kinds that are refused: before the run where they are known by then, by its exit status else. None if left out.
    #[serde(default)]
    pub deny: Vec<Code>,
}

impl WarningsSpec {
    /// Returns the codes as the run applies them.
    pub(crate) fn policy(&self) -> Policy {
        Policy {
            allowed: self.allow.clone(),
            denied: self.deny.clone(),
        }
    }
}

/// Output files: folder, names and content.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct OutputSpec {
    /// Folder for all files, relative to where the command runs; "out" if left out.
    pub directory: Option<Text>,
    /// Beginning of all file names; the scene's file name if left out.
    pub name: Option<Text>,
    /// True if a VTU file is written; true if left out.
    #[serde(default)]
    pub vtu: Option<bool>,
    /// Representation of peridynamic points in the VTU; "vertices" if left out.
    #[serde(default)]
    pub points: PointOutputSpec,
    /// True if the VTU has the energy density of peridynamic points; false if left out.
    #[serde(default)]
    pub energy_density: Option<bool>,
    /// Stresses that the VTU holds as fields beside the tensor; with any of them tables of static scenes along lines and at probes, and histories for probes, have columns of stress. None if left out.
    #[serde(default)]
    #[schemars(with = "Vec<StressSpec>")]
    pub stresses: Vec<Spanned<StressSpec>>,
    /// Further fields of the VTU, by the names that `bondline fields` lists; tables along lines and at probes and histories for probes have their columns. None if left out.
    #[serde(default)]
    pub fields: Vec<Text>,
    /// Straight lines along which a CSV file samples the solution, by name.
    #[serde(default)]
    pub lines: BTreeMap<Text, LineSpec>,
    /// Points at which a CSV file gives the solution, by name; in a scene that moves, columns of the history.
    #[serde(default)]
    pub probes: BTreeMap<Text, ProbeSpec>,
    /// Sections through the body by name: force and moment that the part beyond a plane exerts on the rest, as columns of the history; of a static scene a CSV file. The summary has them too.
    #[serde(default)]
    pub sections: BTreeMap<Text, SectionSpec>,
    /// Tips of cracks to follow, by name, in a scene in which bonds break.
    #[serde(default)]
    pub tips: BTreeMap<Text, TipSpec>,
    /// Bonds that VTU files of their own show as lines, by name.
    #[serde(default)]
    pub bonds: BTreeMap<Text, BondLinesSpec>,
}

/// Peridynamic points whose bonds are shown.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BondLinesSpec {
    /// Those in a shape.
    Inside(Box<ShapeSpec>),
    /// The nearest one to a probe of the scene, which lies within its horizon.
    Probe(Text),
}

/// Representation of peridynamic points in a VTU file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PointOutputSpec {
    /// Each as a vertex, with its fields once.
    #[default]
    Vertices,
    /// Each as the cell of its lattice, or of the mesh where points lie at centroids, so that viewers slice and shade them; corners have the values of the point.
    Cells,
}

/// A number made of a stress, that out of the plane included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StressSpec {
    /// Von Mises' equivalent stress.
    VonMises,
    /// The largest principal stress.
    MaxPrincipal,
    /// The smallest principal stress.
    MinPrincipal,
}

impl StressSpec {
    /// The name, as a scene spells it.
    pub fn name(self) -> &'static str {
        match self {
            Self::VonMises => "von-mises",
            Self::MaxPrincipal => "max-principal",
            Self::MinPrincipal => "min-principal",
        }
    }
}

/// A line of samples.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct LineSpec {
    /// First sample.
    pub from: Coordinates,
    /// Last sample.
    pub to: Coordinates,
    /// Number of samples, both ends included; at least 2.
    pub samples: Count,
}

/// A point of interest.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct ProbeSpec {
    /// Its position.
    pub at: Coordinates,
}

/// A section through the body: a plane, and the part of the body beyond it.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct SectionSpec {
    /// A point of the plane.
    pub point: Coordinates,
    /// Normal of the plane, of any length; it points to the part whose force on the rest is reported.
    pub normal: Coordinates,
    /// A shape that holds that part beyond the plane; all beyond the plane if left out.
    pub inside: Option<ShapeSpec>,
    /// The point about which the moment is taken; `point` if left out.
    pub about: Option<Coordinates>,
}
