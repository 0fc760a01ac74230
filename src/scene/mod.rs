//! Scenes: TOML to a validated problem. The only module that knows TOML; nothing is simulated here.
//!
//! | file | what |
//! |---|---|
//! | `source.rs` | the text and its overrides on one axis of positions |
//! | `tagged_table.rs` | tables of exactly one key, and how overrides replace them |
//! | `expression.rs`, `function.rs`, `table.rs`, `value.rs` | numbers, expressions, functions of a program, tables, coordinates with their places |
//! | `table_rows.rs` | the rows of tables, typed or from files |
//! | `spec/` | what is typed; the JSON Schema comes from here |
//! | `parse.rs` | text to `SceneSpec`, with errors that underline |
//! | `draft.rs`, `validated.rs` | `SceneSpec` to `Scene`: every name resolved, every number checked |
//! | `meshing.rs`, `point_file.rs`, `region.rs`, `zones.rs`, `lattice_regions.rs`, `horizon_change.rs`, `materials.rs`, `material_interfaces.rs`, `peridynamics.rs`, `default_points.rs`, `default_horizon.rs`, `cracks_and_voids.rs`, `crack_tips.rs`, `solve.rs`, `initial.rs`, `failure.rs`, `adaptive_zone.rs`, `output.rs`, `section.rs`, `bond_output.rs`, `file_name.rs` | its parts |
//! | `stages.rs`, `load_stage.rs` | the stages that are typed, and what acts in each; load steps before a motion |
//! | `coupling_selection.rs`, `selected_coupling.rs` | the coupling that is typed, or the one that suits the scene |
//! | `coupling_kinds/` | the couplings that are typed, one file each |
//! | `condition_kinds/` | the conditions that are typed, one file each: loads, supports, springs |
//! | `conditions.rs`, `load.rs`, `condition_at.rs`, `condition_list.rs` | a condition; a load, where it acts and its density; where a condition is read; all conditions together |
//! | `components.rs`, `places.rs` | vector fields, and the sets and shapes that conditions name |
//! | `temperature.rs`, `conduction.rs` | the temperature of the body; the heat conduction whose solution it is |
//! | `impactors.rs` | rigid bodies that strike or press |
//! | `elasticity.rs`, `orthotropic.rs` | linear elasticity of materials; orthotropic ones, of finite elements alone |
//! | `user_material.rs` | materials of a user's routine |
//! | `bounds_checks.rs` | numbers within their bounds |
//! | `elements.rs` | what finite elements follow |
//! | `agreement.rs` | whether parts that are right alone agree |
//! | `unused.rs` | parts of a scene that touch nothing |
//! | `build/` | scenes that a program makes |
//! | `template.rs`, `templates/` | commented scenes to start from |
//! | `error.rs` | place, value and remedy of what is typed |

pub(crate) mod adaptive_zone;
pub(crate) mod agreement;
pub(crate) mod bond_output;
pub(crate) mod bounds_checks;
pub mod build;
pub(crate) mod components;
mod condition_at;
pub mod condition_kinds;
mod condition_list;
pub(crate) mod conditions;
pub(crate) mod conduction;
pub mod coupling_kinds;
pub(crate) mod coupling_selection;
mod crack_tips;
pub(crate) mod cracks_and_voids;
mod default_horizon;
pub mod default_points;
pub(crate) mod draft;
pub(crate) mod elasticity;
pub(crate) mod elements;
pub(crate) mod error;
pub(crate) mod expression;
pub(crate) mod failure;
mod file_name;
pub(crate) mod function;
pub(crate) mod horizon_change;
pub(crate) mod impactors;
pub(crate) mod initial;
pub(crate) mod lattice_regions;
pub(crate) mod load;
pub(crate) mod load_stage;
pub(crate) mod material_interfaces;
pub(crate) mod materials;
pub(crate) mod meshing;
pub(crate) mod orthotropic;
pub(crate) mod output;
pub(crate) mod parse;
pub(crate) mod peridynamics;
pub(crate) mod places;
mod point_file;
pub(crate) mod region;
pub(crate) mod rim;
pub(crate) mod section;
pub(crate) mod selected_coupling;
pub(crate) mod solve;
pub(crate) mod source;
pub mod spec;
mod stages;
pub(crate) mod table;
mod table_rows;
pub(crate) mod tagged_table;
pub(crate) mod temperature;
pub(crate) mod template;
pub(crate) mod unused;
pub(crate) mod user_material;
pub(crate) mod validated;
pub(crate) mod value;
pub(crate) mod zones;

pub use crate::peridynamics::failure::Fracture;
pub use adaptive_zone::Follow;
pub use conditions::{Components, Condition, Field, Prescribed, Support};
pub use elasticity::Elasticity;
pub use error::{SceneError, SceneErrorKind};
pub use expression::{Expression, ExpressionError};
pub use failure::Breaking;
pub use function::Function;
pub use impactors::{Impactor, ImpactorMotion};
pub use initial::{Initial, InitialKind};
pub use load::{Density, Domain, Load};
pub use load_stage::LoadStage;
pub use materials::Material;
pub use peridynamics::Peridynamics;
pub use region::Region;
pub use section::Section;
pub use solve::{Explicit, QuasiStatic, Solve};
pub use source::{Source, Span, read};
pub use spec::SceneSpec;
pub use template::Template;
pub use validated::{Output, Scene, Solver, Tip};
pub use value::{Coordinates, Count, Number, Text};

/// The JSON Schema of scene files, for editors.
pub fn schema() -> schemars::Schema {
    let mut schema = schemars::schema_for!(SceneSpec);
    // what a scene with an `accuracy` may leave out
    for (table, keys) in [
        ("LineMeshSpec", &["x", "y", "z"]),
        ("RectangleMeshSpec", &["x", "y", "z"]),
        ("BoxMeshSpec", &["x", "y", "z"]),
    ] {
        if let Some(serde_json::Value::Array(required)) =
            schema.pointer_mut(&format!("/$defs/{table}/required"))
        {
            required.retain(|key| !keys.iter().any(|k| key == k));
        }
    }
    schema
}
