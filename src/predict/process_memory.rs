//! Memory of each of several processes: that of one process alone, less what others have of it, plus that of MPI and PETSc.

use super::resource_estimate::{Prediction, ProcessShare};
use crate::model::Model;
use crate::run::budget::{PER_BOND, PER_STATE_BOND};
use crate::system::Symmetry;

/// Bytes of MPI and PETSc beside the program; measured, as all that follow.
const LIBRARIES: u64 = 12_000_000;

/// Bytes of PETSc's solvers beside these.
const SOLVERS: u64 = 15_000_000;

/// Bytes of the rows in PETSc and its multigrid over those of the rows, of one process and of several. Rows of several are copied for the graph that is coarsened.
const SYMMETRIC: [f64; 2] = [1.3, 1.5];

/// As [`SYMMETRIC`]; the graph is made symmetric, too.
const UNSYMMETRIC: [f64; 2] = [1.6, 2.3];

/// As [`SYMMETRIC`], of the springs that precondition products: coarse levels are the greater part.
const SPRINGS: [f64; 2] = [1.9, 2.8];

/// Bytes of the factors of MUMPS over those of our own, of one process and of several together.
const MUMPS: [f64; 2] = [1.5, 1.8];

/// Vectors of GMRES, two for each iteration; most solves take fewer.
const GMRES_VECTORS: usize = 100;

/// Distribution of the work of a scene over processes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Spreading {
    /// Steps or load steps: every process holds what one does.
    Work,
    /// Each has the families of its own points.
    Families,
    /// Each has the rows of the stiffness of its own sites, and a factorisation.
    Factors,
    /// Each has the rows of the stiffness of its own sites, and multigrid.
    Rows,
    /// The same, where PETSc has the springs that precondition them in their place.
    Products,
}

/// Bytes of each bond of a family.
pub(super) fn per_bond<const D: usize>(model: &Model<D>) -> f64 {
    match &model.peridynamics {
        Some(p) if !p.law.linearised().is_pairwise() => PER_BOND + PER_STATE_BOND,
        _ => PER_BOND,
    }
}

/// The memory of each process, whose other numbers are known, beside what one process holds `alone`; `per_bond` bytes of each bond of a family that others hold.
pub(super) fn divide(
    shares: &mut [ProcessShare],
    spreading: Spreading,
    per_bond: f64,
    alone: &Prediction,
) {
    let sum = |of: fn(&ProcessShare) -> usize| shares.iter().map(of).sum::<usize>().max(1);
    let (sites, blocks) = (sum(|s| s.sites), sum(|s| s.blocks));
    let bytes = |name: &str| -> u64 {
        let mut all = alone.memory.iter();
        all.find(|s| s.name == name).map_or(0, |s| s.bytes)
    };
    for share in shares {
        let of_sites = share.sites as f64 / sites as f64;
        let of_blocks = share.blocks as f64 / blocks as f64;
        // each process writes the piece of its own sites
        let output = (bytes("output") as f64 * of_sites) as u64;
        let others = alone.sizes.bonds.saturating_sub(share.bonds) as f64 * per_bond;
        let base = (LIBRARIES + alone.base_bytes).saturating_sub(others as u64);
        let rows = SOLVERS + (bytes("stiffness") as f64 * of_blocks) as u64;
        let solver = in_petsc(share, spreading, of_blocks, alone);
        share.memory_bytes = match spreading {
            Spreading::Work => base + bytes("stiffness") + bytes("solver").max(output),
            Spreading::Families => base + output,
            _ => base + rows + solver.max(output),
        };
    }
}

/// Memory of PETSc for the stiffness of a process and its solver \[bytes\].
fn in_petsc(share: &ProcessShare, spreading: Spreading, of_blocks: f64, alone: &Prediction) -> u64 {
    let several = usize::from(of_blocks < 1.0);
    let matrix = share.stiffness_bytes as f64;
    let bytes = match (spreading, alone.symmetry) {
        (Spreading::Work | Spreading::Families, _) => 0.0,
        (Spreading::Factors, _) => {
            matrix + 8.0 * alone.factor_nonzeros as f64 * MUMPS[several] * of_blocks
        }
        (Spreading::Products, _) => matrix * SPRINGS[several],
        (Spreading::Rows, Symmetry::Symmetric) => matrix * SYMMETRIC[several],
        (Spreading::Rows, Symmetry::Unsymmetric) => {
            let vectors = GMRES_VECTORS * share.sites * alone.dimension * 8;
            matrix * UNSYMMETRIC[several] + vectors as f64
        }
    };
    bytes as u64
}
