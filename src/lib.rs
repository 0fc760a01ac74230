//! bondline joins a classical finite-element region to a meshfree peridynamic region.

pub mod coupling;
pub mod fem;
pub mod material;
pub mod mesh;
pub mod observe;
pub mod peridynamics;
pub mod progress;
pub mod scene;
pub mod shape;
pub mod solve;
pub mod system;
pub mod tensor;
pub mod verify;
