//! Conditions of scenes, one file each: what is typed, and the condition that it is.
//!
//! | file | condition |
//! |---|---|
//! | `traction.rs` | force per area on facets |
//! | `pressure.rs` | force per area against the outward normal |
//! | `body_force.rs` | force per volume of cells |
//! | `displacement.rs`, `velocity.rs` | prescribed motion, component by component |
//! | `symmetry.rs`, `rotation.rs` | planes of symmetry, rigid rotations |
//! | `spring.rs` | springs to the ground |
//!
//! A condition that implements `ConditionKind` and has its line in the list at the end of this file is one of scenes, by its key. Nodal forces, resultants, work, the proof of totals
//! and first moments, sections and loaded surfaces follow from the [`super::load::Load`] that it builds: no other place names a load.

mod body_force;
mod displacement;
mod pressure;
mod rotation;
mod spring;
mod symmetry;
mod traction;
mod velocity;

use schemars::JsonSchema;
use serde::Deserialize;

use super::condition_at::ConditionAt;
use super::conditions::Condition;
use super::error::SceneError;
use super::solve::Clock;
use super::value::Text;
use crate::mesh::Mesh;

pub use body_force::BodyForceSpec;
pub use displacement::DisplacementSpec;
pub use pressure::PressureSpec;
pub use rotation::RotationSpec;
pub use spring::SpringSpec;
pub use symmetry::SymmetrySpec;
pub use traction::TractionSpec;
pub use velocity::VelocitySpec;

/// A kind of condition, as scenes type it.
pub(crate) trait ConditionKind {
    /// The condition where a scene names it.
    ///
    /// # Errors
    /// [`SceneError`] for a set, a shape or values that make no condition.
    fn build<const D: usize>(&self, at: &ConditionAt<'_, D>) -> Result<Condition<D>, SceneError>;

    /// The stages of the scene in which it acts, where it names any.
    fn stages(&self) -> Option<&[Text]> {
        None
    }
}

/// Declares [`ConditionSpec`], the conditions by their keys.
macro_rules! conditions {
    ($($(#[doc = $about:literal])+ $key:literal => $kind:ident($spec:ident)),* $(,)?) => {
        /// A condition of a scene.
        #[derive(Clone, Debug, Deserialize, JsonSchema)]
        pub enum ConditionSpec {
            $($(#[doc = $about])+ #[serde(rename = $key)] $kind($spec),)*
        }

        impl ConditionSpec {
            /// Their keys.
            pub const KEYS: &'static [&'static str] = &[$($key),*];

            /// The stages of the scene in which it acts, where it names any.
            pub(crate) fn stages(&self) -> Option<&[Text]> {
                match self {
                    $(Self::$kind(kind) => kind.stages(),)*
                }
            }

            /// The condition on a mesh.
            ///
            /// # Errors
            /// As [`ConditionKind::build`].
            pub(crate) fn build<const D: usize>(
                &self,
                name: &Text,
                mesh: &Mesh<D>,
                clock: Clock,
            ) -> Result<Condition<D>, SceneError> {
                match self {
                    $(Self::$kind(kind) => {
                        let place = format!("conditions.{name}.{}", $key);
                        kind.build(&ConditionAt { place: &place, name, mesh, clock })
                    })*
                }
            }
        }
    };
}

conditions! {
    /// Displacement, component by component; components left out stay free.
    "displacement" => Displacement(DisplacementSpec),
    /// Velocity, component by component, in a scene that moves; components left out stay free.
    "velocity" => Velocity(VelocitySpec),
    /// Force per area (per length of thickness 1 in 2D; a force in 1D) on a set of facets.
    "traction" => Traction(TractionSpec),
    /// Pressure on a set of facets: a force per area against the outward normal, in the reference configuration.
    "pressure" => Pressure(PressureSpec),
    /// Force per volume.
    "body-force" => BodyForce(BodyForceSpec),
    /// Springs to the ground, an elastic foundation: a force per area against the displacement.
    "spring" => Spring(SpringSpec),
    /// A plane of symmetry: no displacement along its normal.
    "symmetry" => Symmetry(SymmetrySpec),
    /// Rigid rotation about a centre, as an axis or a grip imposes it.
    "rotation" => Rotation(RotationSpec),
}
