//! The processes of `mpirun`, and PETSc's solvers over them, as the library asks for them by `bondline::system::Ranks`.
//!
//! Empty without the feature `petsc`. All of PETSc and MPI lies behind a C file that includes their headers (`c/shim.c`); `shim.rs` declares its functions, and is the
//! only file with unsafe code.

#![cfg(feature = "petsc")]

mod ranks;
#[allow(unsafe_code, reason = "the functions of the C shim")]
mod shim;

pub use ranks::{PetscRanks, is_under_mpi};
