//! Analysis of a scene in time or load steps, its initial fields, and the deformation and fracture of its bonds.

use schemars::JsonSchema;
use serde::Deserialize;

use super::region::ShapeSpec;
use crate::scene::expression::Expression;
use crate::scene::value::{Automatic, Coordinates, Count, Every, Number, Steps, Text};

/// A solve without options.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoOptionsSpec {}

/// Type of analysis.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SolveSpec {
    /// One state of equilibrium.
    Static(NoOptionsSpec),
    /// Motion in time by velocity Verlet.
    Explicit(ExplicitSpec),
    /// States of equilibrium under a load that grows step by step.
    QuasiStatic(QuasiStaticSpec),
    /// Stages one after the other, by the names of their tables, [stages.NAME]; also `solve = ["load", "impact"]`.
    Stages(Vec<Text>),
}

/// Motion in time by velocity Verlet.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct ExplicitSpec {
    /// Time at the end; it begins at zero.
    pub duration: Number,
    /// Time step: a number, or "auto" (default) for a fraction of the measured stable step.
    #[serde(default)]
    pub step: Automatic,
    /// Fraction of the measured stable step that "auto" takes; 0.95 if left out.
    pub step_fraction: Option<Number>,
    /// Treatment of a step beyond the stable one; "refuse" if left out.
    #[serde(default)]
    pub beyond_limit: BeyondLimitSpec,
    /// Steps that the stiffest sites take in each step of all others; 1 if left out.
    pub sub_steps: Option<Count>,
    /// Energy gained without work, as a part of the largest energy, at which the run stops; 0.1 if left out.
    pub largest_energy_gain: Option<Number>,
    /// Rotation of an element in degrees at which the run stops; none if left out.
    pub largest_rotation: Option<Number>,
    /// Number of VTU files after the first; 20 if left out, 0 for none but first and last.
    pub outputs: Option<Count>,
    /// Time between VTU files, instead of `outputs`.
    pub output_interval: Option<Number>,
    /// Time between rows of the history; a thousandth of the duration if left out.
    pub history_interval: Option<Number>,
    /// Checkpoint after this many steps, or after this time of the clock: 1000, "10 min".
    pub checkpoint_every: Option<Every>,
}

/// Treatment of a time step beyond the stable one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BeyondLimitSpec {
    /// The run does not begin.
    #[default]
    Refuse,
    /// The step is shortened to the fraction of the stable one.
    Shorten,
}

/// States of equilibrium under a load that grows step by step.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct QuasiStaticSpec {
    /// Number of load steps of equal length, the list of their times, the last of which takes the place of `duration`, or "auto": as long as nothing fails in them, and as short as `accuracy` where something does.
    pub steps: Steps,
    /// Value of t at the last step; 1 if left out.
    pub duration: Option<Number>,
    /// Length of a step of `steps = "auto"` in which bonds break over its time: the accuracy of the load at which they do; 0.01 if left out.
    pub accuracy: Option<Number>,
    /// Solution method of each step; "implicit" if left out.
    #[serde(default)]
    pub method: LoadStepSpec,
    /// Out-of-balance force at which a step is solved, relative to the largest forces of this load step and at the end of the last; 1e-8 if left out.
    pub tolerance: Option<Number>,
    /// Most products with the tangent (implicit) or passes over the bonds (relaxation) of one equilibrium; 50000 if left out.
    pub max_iterations: Option<Count>,
    /// Rotation of an element in degrees at which the run stops; none if left out.
    pub largest_rotation: Option<Number>,
    /// Treatment of a body that has parted; "end" if left out.
    #[serde(default)]
    pub when_parted: WhenPartedSpec,
    /// Number of VTU files after the first; one per step if left out.
    pub outputs: Option<Count>,
    /// Checkpoint after this many steps, or after this time of the clock: 10, "10 min".
    pub checkpoint_every: Option<Every>,
}

/// Treatment of a body that has parted: bonds have broken, and it stores less than a thousandth of its largest energy at prescribed displacements that are no smaller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum WhenPartedSpec {
    /// The run ends.
    #[default]
    End,
    /// It goes on.
    Continue,
}

/// Solution method of a load step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LoadStepSpec {
    /// By Newton's method, without a matrix.
    #[default]
    Implicit,
    /// Adaptive dynamic relaxation: no matrix.
    Relaxation,
}

/// Initial displacement or velocity, where the body does not start at rest.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum InitialSpec {
    /// Displacement at time zero.
    Displacement(InitialFieldSpec),
    /// Velocity at time zero.
    Velocity(InitialFieldSpec),
}

/// A field at time zero; components left out are zero, or as a field of an earlier name sets them.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct InitialFieldSpec {
    /// Region of the field; everywhere if left out.
    pub inside: Option<ShapeSpec>,
    /// Component along x.
    pub x: Option<Expression>,
    /// Component along y.
    pub y: Option<Expression>,
    /// Component along z.
    pub z: Option<Expression>,
}

/// Constitutive law of the finite elements of the points' materials.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ElementsSpec {
    /// Linear elasticity, whose body must not rotate; or the local law of their material, if it has one.
    #[default]
    Linear,
    /// The bonds of the lattice under the deformation of the element, at any stretch and rotation.
    CauchyBorn,
}

/// Calibration of the critical stretch to a fracture energy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CalibrationSpec {
    /// By the energy that a plane of the lattice takes, pulled apart bond by bond.
    #[default]
    Lattice,
    /// By the integral over a continuous family, as in papers: the lattice takes a few per cent more or less.
    Continuum,
}

/// Contact of bodies, of the faces of a crack, and of fragments: surfaces of elements and points keep out of each other.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct ContactSpec {
    /// Distance below which two points without a bond repel each other, over the spacing, or over their distance at rest where that is less; 1 if left out: their cells touch.
    pub radius_factor: Option<Number>,
    /// Stiffness of the repulsion of points over that of a bond as long as the horizon; 15 if left out. That of surfaces of elements is in proportion.
    pub stiffness_factor: Option<Number>,
    /// Coefficient of friction on surfaces of elements; 0 if left out.
    pub friction: Option<Number>,
    /// Distance up to which surfaces that are apart or overlap at time zero count as touching \[m\]; 0 if left out.
    pub adjust: Option<Number>,
}

/// The tip of a crack: the farthest damaged point along a direction.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct TipSpec {
    /// The direction in which the crack runs.
    pub direction: Coordinates,
    /// Region in which the tip is sought; everywhere if left out.
    pub inside: Option<ShapeSpec>,
    /// Damage from which a point counts; 0.35 if left out.
    pub threshold: Option<Number>,
    /// Energy release rate and stress intensity factors at the tip, of a plane scene at rest or in load steps; none if left out.
    pub energy_release: Option<bool>,
    /// Radii of the rings over which these are integrated, from the smallest to the largest \[m\]; 2, 3, 4 and 5 horizons if left out.
    #[serde(default)]
    pub radii: Vec<Number>,
}
