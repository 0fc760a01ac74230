//! Share of one of several processes in a scene, in numbers.

use serde::Serialize;

/// Share of one of several processes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProcessShare {
    /// Sites whose rows it computes.
    pub sites: usize,
    /// Sites of other processes whose displacements these rows need, or the forces of these sites where each process moves its own.
    pub ghosts: usize,
    /// Blocks of these rows: bonds, and pairs of nodes of an element; where points alone move in time, bonds.
    pub blocks: usize,
    /// Bonds whose families it holds: those of all points, or of its own, and of these points' neighbours where a law asks for them.
    pub bonds: usize,
    /// Memory of its part of the stiffness in PETSc \[bytes\], or of the springs that precondition it where rows are shared, without factors or coarse levels; zero of a scene in time, which assembles none.
    pub stiffness_bytes: u64,
    /// Data received for each product with the stiffness, or for each step in time \[bytes\]: the numbers of its ghosts, or of all sites that others have.
    pub received_bytes: u64,
    /// Most memory that it will hold \[bytes\].
    pub memory_bytes: u64,
}
