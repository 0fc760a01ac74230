//! Refinement in a plane: square cells whose lattices are halved and quartered where a wave is, and joined again behind it.
//!
//! Algorithm 1 of \[Bobaru2009\] with two changes. Lattices of different horizons are kept apart by elements one cell thick and end on their faces (`docs/truncated.md`), so that every grid is reciprocal
//! and exact for affine fields; a horizon per node, as in the paper, is one of the two only. And nodes lie in the middles of their cells: dividing a cell replaces them.
//!
//! | file | what |
//! |---|---|
//! | `plate` | the cells, their levels, and the body that they make |
//! | `transfer` | fields from one set of sites to another |
//! | `crack` | statics: lattices nested about a crack until its opening settles |
//! | `ring` | a wave that runs outwards in a ring: its exact solution, cost and conservation of a grid that follows it |

pub mod crack;
pub mod plate;
pub mod ring;
pub mod transfer;

pub use crack::opening;
pub use ring::ring;
