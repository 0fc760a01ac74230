//! Solvers of `K u = f`: elimination orders, a multifrontal direct solver, Krylov methods with multigrid, and the
//! static problem that chooses among them; explicit dynamics with its stable step and sub-cycling; quasi-static load steps.
//!
//! | file | what |
//! |---|---|
//! | `statics.rs`, `statics/` | the static problem: `K u = f` on free dofs, solved directly or by iteration, by one process or several |
//! | `quasi_static.rs`, `quasi_static/` | load steps: equilibrium by Newton's method or by relaxation, then breaking bonds |
//! | `explicit.rs`, `explicit/` | explicit dynamics by velocity Verlet |
//! | `stable_step.rs`, `sub_cycling.rs` | its stable step; several steps of stiff sites within one of the others |
//! | `instability_growth.rs`, `growth_from_start.rs` | modes that grow at any step; the energy that they add to a motion from a known start |
//! | `direct.rs`, `direct_params.rs` | the multifrontal direct solver; its parameters and errors |
//! | `ordering.rs`, `symbolic.rs` | elimination orders; elimination tree, supernodes and costs |
//! | `multifrontal.rs`, `frontal_matrix.rs` | numerical factorisation over that tree; of one dense front |
//! | `factor_time_estimate.rs` | its duration |
//! | `probes.rs` | a sparse matrix from its products with few vectors |
//! | `krylov.rs` | conjugate gradients and restarted GMRES |
//! | `multigrid.rs`, `aggregation.rs`, `smoother.rs` | smoothed-aggregation multigrid, its coarse matrices, its smoothers |
//! | `singularity_diagnosis.rs` | free motions of a singular system |
//! | `neighbourhood.rs` | the surroundings of one site as a small model |
//! | `stencils.rs` | model matrices on lattices, for tests and benchmarks |

mod aggregation;
pub mod direct;
pub(crate) mod direct_params;
pub mod explicit;
pub mod factor_time_estimate;
mod frontal_matrix;
pub mod growth_from_start;
pub mod instability_growth;
pub mod krylov;
mod multifrontal;
pub mod multigrid;
mod neighbourhood;
pub mod ordering;
mod probes;
pub mod quasi_static;
mod singularity_diagnosis;
pub mod smoother;
pub mod stable_step;
pub mod statics;
pub mod stencils;
pub mod sub_cycling;
pub mod symbolic;

use crate::solve::krylov::LinearMap;
use crate::system::BlockCsr;
use rayon::prelude::*;

/// Dofs that are unknown; the others are prescribed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FreeDofs {
    block: usize,
    bits: Vec<u8>,
}

impl FreeDofs {
    /// Every dof of `sites` sites with `block` dofs each is unknown.
    pub fn all(sites: usize, block: usize) -> FreeDofs {
        FreeDofs {
            block,
            bits: vec![((1u16 << block) - 1) as u8; sites],
        }
    }

    /// The dofs without a prescribed value. Shape: `prescribed` has `sites × block` entries.
    pub fn from_prescribed(prescribed: &[Option<f64>], block: usize) -> FreeDofs {
        let bits = prescribed
            .chunks(block)
            .map(|values| {
                values
                    .iter()
                    .enumerate()
                    .filter(|(_, v)| v.is_none())
                    .map(|(a, _)| 1 << a)
                    .sum()
            })
            .collect();
        FreeDofs { block, bits }
    }

    /// Returns true if dof `a` of site `i` is unknown.
    pub fn is_free(&self, i: usize, a: usize) -> bool {
        self.bits[i] >> a & 1 == 1
    }

    /// Number of unknown dofs of site `i`.
    pub fn count_of_site(&self, i: usize) -> usize {
        self.bits[i].count_ones() as usize
    }

    /// Number of unknown dofs.
    pub fn count(&self) -> usize {
        self.bits.iter().map(|b| b.count_ones() as usize).sum()
    }

    /// The unknown dofs of site `i`, ascending.
    pub fn of_site(&self, i: usize) -> impl Iterator<Item = usize> + '_ {
        let bits = self.bits[i];
        (0..self.block).filter(move |a| bits >> a & 1 == 1)
    }

    /// Number of sites with at least one unknown dof.
    pub fn sites_with_free_dofs(&self) -> usize {
        self.bits.iter().filter(|&&b| b != 0).count()
    }

    /// Sets the entries of prescribed dofs to zero. Shape: `x` has one entry per dof.
    pub fn clear_prescribed(&self, x: &mut [f64]) {
        let full = ((1u16 << self.block) - 1) as u8;
        x.par_chunks_mut(self.block)
            .zip(&self.bits)
            .for_each(|(x, &bits)| {
                if bits != full {
                    x.iter_mut()
                        .enumerate()
                        .filter(|(a, _)| bits >> a & 1 == 0)
                        .for_each(|(_, x)| *x = 0.0);
                }
            });
    }

    /// Dofs per site.
    pub fn block(&self) -> usize {
        self.block
    }

    /// Number of sites.
    pub fn sites(&self) -> usize {
        self.bits.len()
    }
}

/// `K` restricted to its free dofs, as a map: prescribed entries of the result are zero, and those of the argument
/// must be.
#[derive(Clone, Copy, Debug)]
pub struct FreeOperator<'a> {
    matrix: &'a BlockCsr,
    free: &'a FreeDofs,
}

impl<'a> FreeOperator<'a> {
    /// The free part of `matrix`.
    pub fn new(matrix: &'a BlockCsr, free: &'a FreeDofs) -> Self {
        FreeOperator { matrix, free }
    }
}

impl LinearMap for FreeOperator<'_> {
    fn apply_into(&self, x: &[f64], y: &mut [f64]) {
        self.matrix.multiply_into(x, y);
        self.free.clear_prescribed(y);
    }
}
