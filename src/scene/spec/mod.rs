//! Content of a scene file, as typed. The JSON Schema is made from these types and their comments.
//!
//! Every choice is a table of one key (`[coupling.splice]`), so that an error is underlined at its own token.
//!
//! | file | content |
//! |---|---|
//! | `mesh.rs` | the mesh |
//! | `influence.rs`, `material.rs`, `named_law.rs`, `user_material.rs` | materials and peridynamics; laws known by their key; compiled routines |
//! | `orthotropic.rs` | orthotropic materials of finite elements |
//! | `material_interface.rs` | bonds between two materials |
//! | `region.rs` | shapes and zones |
//! | `condition.rs`, `impactor.rs` | conditions and voids, rigid impactors |
//! | `conduction.rs` | heat conduction |
//! | `motion.rs` | time and load steps, initial fields, deformation and fracture of bonds |
//! | `control.rs` | solver and output |
//! | `table.rs` | tables of numbers |

mod condition;
mod conduction;
mod control;
mod impactor;
mod influence;
mod material;
mod material_interface;
mod mesh;
mod motion;
pub(super) mod named_law;
mod orthotropic;
mod region;
mod table;
mod user_material;

pub use super::coupling_kinds::{
    BalancedSpec, BlendingSpec, CouplingSpec, CouplingTraits, FormSpec, LatticeStart, LocalSpec,
    NonlocalSpec, PartialStressSpec, SpliceSpec, TruncatedSpec, ZonesNeeded,
};
pub use condition::{TemperatureSpec, VoidSpec};
pub use conduction::{
    ConductionSpec, HeatConditionSpec, HeatFluxSpec, HeatSourceSpec, HeatTransferSpec,
    HeldTemperatureSpec,
};
pub use control::{
    BondLinesSpec, LineSpec, OutputSpec, PointOutputSpec, ProbeSpec, SectionSpec, SolverSpec,
    StressSpec, UnprovenSpec, WarningsSpec,
};
pub use impactor::{CylinderSpec, ImpactorMotionSpec, ImpactorSpec, PlaneSpec, SphereSpec};
pub use influence::{InfluenceSpec, MicromodulusSpec, PolynomialSpec};
pub use material::{
    HorizonChangeSpec, LatticeSpec, MaterialSpec, PeridynamicsSpec, PointFileSpec, PointsSpec,
};
pub use material_interface::MaterialInterfaceSpec;
pub use mesh::{
    AxisSpec, BoxMeshSpec, CutoutSpec, FileMeshSpec, GradedSpec, LineMeshSpec, MergeSpec, MeshSpec,
    PlaneCellSpec, RectangleMeshSpec, SolidCellSpec,
};
pub use motion::{
    BeyondLimitSpec, CalibrationSpec, ContactSpec, ElementsSpec, ExplicitSpec, InitialFieldSpec,
    InitialSpec, LoadStepSpec, NoOptionsSpec, QuasiStaticSpec, SolveSpec, TipSpec, WhenPartedSpec,
};
pub use named_law::Given;
pub use orthotropic::OrthotropicSpec;
pub use region::{
    AutoSpec, BallSpec, BodySpec, BoxSpec, CellsSpec, EdgeSpec, FollowSpec, NearSpec, RimSpec,
    SegmentSpec, ShapeSpec, SkinSpec, TransitionSpec, WithoutSpec, ZonesSpec,
};
pub use table::TableSpec;
pub use user_material::{StrainsSpec, TangentSpec, UmatSpec};

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

use super::condition_kinds::ConditionSpec;
use super::error::Span;
use super::value::{Number, Text};
use crate::material::Kinematics;

/// A scene of bondline: a body that is finite elements here and peridynamics there, at rest or in motion.
///
/// Units are the user's own, consistent throughout (m, N, Pa; or mm, N, MPa). Every number may also be a constant
/// expression in quotes, "1/120".
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
#[schemars(title = "bondline scene")]
pub struct SceneSpec {
    /// A line that says what the scene is; appears in reports.
    #[serde(default)]
    pub title: Option<String>,
    /// The relative error that is wanted, 0.01 for 1 %: coupling, mesh, horizon, points and zone, as far as the scene leaves them out, are chosen for it.
    pub accuracy: Option<Number>,
    /// Kinematic assumption by which the body represents a three-dimensional solid; fixes the dimension.
    #[schemars(with = "Kinematics")]
    pub kinematics: Spanned<Kinematics>,
    /// The mesh: generated, or read from a file; none where the points of a file are the whole body.
    pub mesh: Option<MeshSpec>,
    /// The materials by name. At most one of several may be without `cells`: it fills what the others leave.
    pub materials: BTreeMap<Text, MaterialSpec>,
    /// Bonds between two materials of the points, by name; those of two that none names have the harmonic mean of their stiffnesses and the smaller critical stretch.
    #[serde(default)]
    pub interfaces: BTreeMap<Text, MaterialInterfaceSpec>,
    /// Horizon, points and weights of the peridynamic region; needed unless the coupling is `local`.
    pub peridynamics: Option<PeridynamicsSpec>,
    /// Nonlocal zone of the body, and transition zone where the two models overlap; all else is local. With "auto" the program places the zone.
    #[serde(default)]
    #[schemars(schema_with = "zones_schema")]
    pub zones: ZonesSpec,
    /// Coupling of the two models; also as text where no option is set, `coupling = "splice"`. Without it `truncated` where that is exact, or else `splice`; the run says which and why.
    #[serde(default)]
    #[schemars(schema_with = "super::coupling_kinds::coupling_schema")]
    pub coupling: Option<Spanned<CouplingSpec>>,
    /// Type of analysis: one state of equilibrium (default), motion in time, or a load that grows; as text where no option is set, `solve = "static"`.
    #[serde(default)]
    #[schemars(schema_with = "solve_schema")]
    pub solve: Option<Spanned<SolveSpec>>,
    /// Stages that `solve` lists, by name: load steps, whose last state of equilibrium a motion begins with.
    #[serde(default)]
    #[schemars(schema_with = "stages_schema")]
    pub stages: BTreeMap<Text, SolveSpec>,
    /// Displacements, velocities, tractions and body forces by name.
    #[serde(default)]
    pub conditions: BTreeMap<Text, ConditionSpec>,
    /// Tables by name, which expressions call: load(t).
    #[serde(default)]
    pub tables: BTreeMap<Text, TableSpec>,
    /// Temperature of the body; without it nothing expands.
    pub temperature: Option<TemperatureSpec>,
    /// Displacements and velocities at time zero by name; at rest where none says otherwise.
    #[serde(default)]
    pub initial: BTreeMap<Text, InitialSpec>,
    /// Empty regions by name: points inside are removed, and bonds across are cut.
    #[serde(default)]
    pub voids: BTreeMap<Text, VoidSpec>,
    /// Cracks by name: surfaces without thickness that cut the bonds across them.
    #[serde(default)]
    pub cracks: BTreeMap<Text, ShapeSpec>,
    /// Regions by name in which no bond breaks: where a load or a grip holds the points.
    #[serde(default)]
    pub no_fail: BTreeMap<Text, ShapeSpec>,
    /// Short-range contact; none if left out.
    pub contact: Option<ContactSpec>,
    /// Rigid bodies that strike or press, by name; scenes in time and load steps.
    #[serde(default)]
    pub impactors: BTreeMap<Text, ImpactorSpec>,
    /// The linear solver.
    #[serde(default)]
    pub solver: SolverSpec,
    /// Output files: folder, names and content.
    #[serde(default)]
    pub output: OutputSpec,
    /// Kinds of warnings that are left out, or with which a run counts as failed.
    #[serde(default)]
    pub warnings: WarningsSpec,
}

impl SceneSpec {
    /// Span of the name of a material; an empty one of a name that there is not.
    pub(super) fn span_of_material(&self, name: &str) -> Span {
        let found = self.materials.get_key_value(name);
        found.map_or(0..0, |(key, _)| key.span.clone())
    }

    /// The analysis, of a scene in stages that of the last one; none where the scene types none, which then is static.
    pub fn analysis(&self) -> Option<&SolveSpec> {
        match self.solve.as_ref()?.get_ref() {
            SolveSpec::Stages(names) => self.stages.get(names.last()?),
            one => Some(one),
        }
    }

    /// The key of the table that holds the analysis: `solve`, or `stages.NAME` of the last stage.
    pub fn analysis_key(&self) -> String {
        match self.solve.as_ref().map(Spanned::get_ref) {
            Some(SolveSpec::Stages(names)) if !names.is_empty() => {
                format!("stages.{}", names[names.len() - 1])
            }
            _ => "solve".to_owned(),
        }
    }

    /// Space dimension.
    pub fn dimension(&self) -> usize {
        self.kinematics.get_ref().dimension()
    }
}

/// A table with options, or the name alone.
fn solve_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
    let table = generator.subschema_for::<SolveSpec>();
    schemars::json_schema!({
        "description": "What is computed: a table, [solve.explicit], a name where no option is set, \"static\" (default), or the names of [stages.NAME] in their order.",
        "anyOf": [table, { "enum": ["static"] }, { "type": "array", "items": { "type": "string" } }]
    })
}

/// Tables by name, each an analysis.
fn stages_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
    let [steps, motion] = [
        generator.subschema_for::<QuasiStaticSpec>(),
        generator.subschema_for::<ExplicitSpec>(),
    ];
    let one = |key: &str, options: schemars::Schema| {
        schemars::json_schema!({
            "type": "object",
            "properties": { key: options },
            "required": [key],
            "additionalProperties": false
        })
    };
    schemars::json_schema!({
        "description": "Stages that `solve` lists, by name: load steps, whose last state of equilibrium a motion begins with.",
        "type": "object",
        "additionalProperties": { "oneOf": [one("quasi-static", steps), one("explicit", motion)] }
    })
}

/// A table, or "auto".
fn zones_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
    let table = generator.subschema_for::<ZonesSpec>();
    schemars::json_schema!({
        "description": "Where the body is nonlocal: a table, [zones], or \"auto\" for a zone that is placed by itself.",
        "anyOf": [table, { "enum": ["auto"] }]
    })
}
