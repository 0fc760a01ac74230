//! Materials whose stress a user's routine gives.

use schemars::JsonSchema;
use serde::Deserialize;

use super::region::CellsSpec;
use crate::material::UmatEnergies;
use crate::scene::value::{Count, Number, Text};

/// A routine of a compiled library with the calling convention of Abaqus' UMAT.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct UmatSpec {
    /// The library, relative to the scene; its code runs within the program.
    pub library: Text,
    /// The routine's name in the library; `umat_`, `umat` or `UMAT` if left out.
    pub symbol: Option<Text>,
    /// Young's modulus E at rest.
    pub youngs_modulus: Number,
    /// Poisson's ratio at rest.
    pub poisson_ratio: Number,
    /// Density.
    pub density: Option<Number>,
    /// Linear thermal expansion α per degree, with `[temperature]`: the routine gets the strain that is left.
    pub thermal_expansion: Option<Number>,
    /// Thermal conductivity k, with `[temperature.conduction]`.
    pub conductivity: Option<Number>,
    /// Heat capacity per volume ρ c, with `[temperature.conduction]` that has `initial`.
    pub heat_capacity: Option<Number>,
    /// PROPS, the numbers that the routine takes.
    #[serde(default)]
    pub constants: Vec<Number>,
    /// NSTATV, the number of history variables of a point; 0 if left out.
    pub state: Option<Count>,
    /// Admissible magnitude of strains and rotations.
    #[serde(default)]
    pub strains: StrainsSpec,
    /// Source of the energies.
    #[serde(default)]
    pub energies: UmatEnergies,
    /// Source of the tangent of Newton's method.
    #[serde(default)]
    pub tangent: TangentSpec,
    /// True if the routine keeps no common state, so that several calls may run at a time; false if left out.
    #[serde(default)]
    pub thread_safe: bool,
    /// True if cells with several quadrature points take the mean of their dilatation, as Abaqus' fully integrated ones do; true if left out.
    #[serde(default)]
    pub mean_dilatation: Option<bool>,
    /// TEMP; 0 if left out.
    pub temperature: Option<Number>,
    /// CELENT; not a number if left out.
    pub element_length: Option<Number>,
    /// Strength of the zero-energy control relative to the bonds of an LPS; 1 if left out, 0 switches it off.
    pub stabilisation: Option<Number>,
    /// Resistance to deformations that are not uniform: a bond force, one by the lengths of bonds alone, or a drag (in explicit dynamics).
    #[serde(default)]
    pub zero_energy_control: ControlSpec,
    /// Stretch at which a bond breaks.
    pub critical_stretch: Option<Number>,
    /// The cells that this material fills: the name of a set, or a shape that holds their centroids.
    pub cells: Option<CellsSpec>,
}

/// Resistance to zero-energy modes, in the order of [`crate::peridynamics::ZeroEnergyControl::WORDS`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ControlSpec {
    /// A bond force.
    #[default]
    BondForce,
    /// The lengths of bonds.
    Length,
    /// A drag.
    Drag,
}

/// Admissible magnitude of strains and rotations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StrainsSpec {
    /// Small ones.
    #[default]
    Small,
    /// Large ones: the rate form, with stresses turned by DROT.
    Large,
}

/// Source of the tangent of Newton's method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TangentSpec {
    /// Differences of the stress: 18 calls.
    #[default]
    Differences,
    /// The routine: DDSDDE.
    Routine,
}
