//! The seam between models and solvers: the interface of a (coupled) model to a solver.
//!
//! A solver sees sites with positions, a block-sparse stiffness `K` with `K u = f`, and whether `K` is symmetric.
//! It never learns that coupling exists.
//!
//! | file | what |
//! |---|---|
//! | `shared_blocks.rs`, `spmv.rs`, `exact_sum.rs`, `segments.rs` | rows that share blocks; products, exact sums, ranges of sites |
//! | `element_tangent.rs`, `springs.rs`, `neighbour_springs.rs` | parts of the tangent that elements and springs add |
//! | `ranks.rs`, `partition.rs`, `ghosts.rs`, `shared_steps.rs` | several processes, and which sites each has |
//! | `place_stress.rs`, `body_state.rs`, `bond_changes.rs` | the stress of a place; damage, stresses and memory of a body; bonds that broke |
//! | `term.rs`, `with_terms.rs` | force terms beside a body, and their sum |
//! | `tangent.rs`, `history.rs` | the tangent of a system; its memory, damage and dissipation |
//! | `linear_motion.rs` | a system of a matrix |

use crate::parallel;

mod body_state;
mod bond_changes;
mod element_tangent;
mod exact_sum;
mod ghosts;
mod history;
mod linear_motion;
mod neighbour_springs;
mod partition;
mod place_stress;
pub mod ranks;
mod segments;
mod shared_blocks;
mod shared_steps;
mod spmv;
mod springs;
mod tangent;
mod term;
mod with_terms;

pub use body_state::BodyState;
pub use bond_changes::BondChanges;
pub use element_tangent::ElementTangent;
pub use exact_sum::ExactSum;
pub use ghosts::{Ghosts, Traffic};
pub use history::BodyHistory;
pub use linear_motion::LinearMotion;
pub(crate) use neighbour_springs::share_long_rows;
pub use partition::{NeighbourGraph, Partition};
pub use place_stress::PlaceStress;
pub use ranks::{Exchange, RankRows, RankSolve, RankSolver, RankSolverKind, Ranks, Spread};
pub(crate) use ranks::{all_say, first_text};
pub use segments::Segments;
pub use shared_blocks::{GatheredRows, RowBatch, SharedRows};
pub use shared_steps::SharedSteps;
pub use spmv::ROW_CHUNK;
pub use springs::SpringRows;
pub use tangent::Tangent;
pub use term::{ForceTerm, RateBounds};
pub use with_terms::WithTerms;

/// Symmetry of the tangent of a system; solvers choose by it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Symmetry {
    /// `K = Kᵀ` to round-off: Cholesky and conjugate gradients are valid.
    #[default]
    Symmetric,
    /// `K ≠ Kᵀ` (splice, blending and partial stress): LU and GMRES are valid, plain CG is wrong.
    Unsymmetric,
}

impl Symmetry {
    /// One word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Symmetric => "symmetric",
            Self::Unsymmetric => "unsymmetric",
        }
    }
}

/// Treatment of bonds beyond their critical stretch in a pass over the bonds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailureUpdate {
    /// A bond beyond its critical stretch breaks, for good, and carries nothing from this pass on.
    Update,
    /// Bonds stay as they stand: trial states of an implicit solve, energies, output.
    Frozen,
}

/// The step that a force ends: laws with memory integrate over it, from the state that was committed last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Its end \[s\].
    pub end: f64,
    /// Its length Δt \[s\].
    pub length: f64,
}

impl Interval {
    /// No time passes.
    pub const AT_ONCE: Self = Self {
        end: 0.0,
        length: 0.0,
    };
}

/// Cost of the bonds broken so far, and energy that laws with memory have dissipated.
///
/// Units: \[J\] (per thickness in 2D, per section in 1D).
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Dissipation {
    /// Energy that was stored just before less that stored just after bonds broke, at the same displacement.
    pub energy: f64,
    /// Energy that bonds and points dissipated without breaking: flow, viscosity.
    pub inelastic: f64,
}

impl Dissipation {
    /// All energy that is neither stored nor in motion any more.
    pub fn total(&self) -> f64 {
        self.energy + self.inelastic
    }
}

/// A displacement `u − back · v`, computed where it is asked for.
///
/// A step of an explicit motion that breaks bonds exchanges energy with them as if they had broken halfway: half of its impulse is that of the forces before, half that of the forces after. With `back = Δt/2` and the velocity at n + ½
/// their energy there closes the balance to the order Δt².
#[derive(Clone, Copy, Debug)]
pub struct Halfway<'a> {
    /// Displacement of all sites.
    pub u: &'a [f64],
    /// Their velocity; may be empty if `back` is zero.
    pub v: &'a [f64],
    /// Time back from `u` \[s\].
    pub back: f64,
}

impl<'a> Halfway<'a> {
    /// The displacement `u` itself.
    pub fn at(u: &'a [f64]) -> Self {
        Self {
            u,
            v: &[],
            back: 0.0,
        }
    }

    /// The number of one unknown.
    #[inline]
    pub fn of(&self, dof: usize) -> f64 {
        match self.v.get(dof) {
            Some(v) => self.u[dof] - self.back * v,
            None => self.u[dof],
        }
    }

    /// All numbers.
    pub fn all(&self) -> Vec<f64> {
        (0..self.u.len()).map(|dof| self.of(dof)).collect()
    }
}

/// A system that moves: `M ü = f(t) − F(u)`, with lumped masses.
///
/// Shapes: `u` and `force` have [`SemiDiscrete::block`] numbers per site. Units: \[m\], \[N\] (per area of a bar of unit section in 1D, per
/// thickness in 2D). Every method gives the same bits for any number of threads, and every method is required: a force, an energy or a bound that a system does not have is a zero that it writes down.
pub trait SemiDiscrete: Tangent + BodyHistory + Send + Sync {
    /// Unknowns per site (the dimension).
    fn block(&self) -> usize;

    /// Lumped mass of each site \[kg\].
    fn mass(&self) -> &[f64];

    /// Overwrites `force` with the internal force `F(u, t, Δt)` at the end of an interval that begins where [`BodyHistory::commit`] was called last (`K u` of a linear system); returns how many bonds this pass broke and softened.
    fn internal_force_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        interval: Interval,
        breakage: FailureUpdate,
    ) -> BondChanges;

    /// As [`SemiDiscrete::internal_force_into`] with bonds held, but without what [`Tangent::element_tangent`] is the tangent of: forces that are differenced. All of them where that is none.
    fn force_beside_elements_into(&mut self, u: &[f64], force: &mut [f64], interval: Interval);

    /// The work that changes of temperature have done since it was last asked for \[J\], up to the last [`BodyHistory::commit`]: of bonds whose stored energy knows their temperature.
    fn take_heat_work(&mut self) -> f64;

    /// Overwrites `force` with the internal force at `u` as it was at the time `from` (none: before anything expanded), and what the change of temperature until `to` adds to first order; false, and nothing done, where no bond knows its temperature.
    ///
    /// A step sets out by this: bonds that soften must not see the whole change of a temperature before the body has given way to it.
    fn force_of_heating_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        from: Option<f64>,
        to: f64,
    ) -> bool;

    /// Energy stored in the bodies \[J\]; of a coupled system the sum of the bodies' own energies, which the motion conserves only as far as the seam does.
    fn stored_energy(&self, u: &[f64]) -> f64;

    /// Norm of the force \[N\] that rounding of places leaves at a displacement, beside that of the rounding of the displacement; none but where forces depend on places (contact).
    fn round_off(&self, u: &[f64]) -> f64;

    /// Upper bounds of what forces that the tangent at rest does not show may add to the eigenvalues of the motion.
    fn rate_bounds(&self) -> RateBounds;

    /// The system as one of which each process may move its own sites alone; none where each has to have the numbers of all in every step.
    fn shared_steps(&mut self) -> Option<&mut dyn SharedSteps>;

    /// `own` sites and all whose displacements the forces of these take, where processes may each move their own; none where each has to have the numbers of all.
    ///
    /// Shapes: one entry per site.
    fn sites_reached(&self, own: &[bool]) -> Option<Vec<bool>>;
}

/// A square block-sparse matrix by rows; each entry is a dense `block × block` matrix, row-major.
///
/// Shapes: `row_offsets` has one entry more than block rows; the columns of row `i` are `columns[row_offsets[i]..row_offsets[i + 1]]`, ascending; its blocks
/// follow one another in `values` from [`BlockCsr::start`] on. Rows of equal blocks, those of a lattice say, may share them: see [`SharedRows`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BlockCsr {
    /// Unknowns per site (the dimension).
    pub block: usize,
    /// Start of each block row.
    pub row_offsets: Vec<usize>,
    /// Block column of each entry.
    pub columns: Vec<u32>,
    /// Dense blocks, row-major, one after another.
    pub values: Vec<f64>,
    /// Rows that share their blocks; none if each row has its own.
    pub shared: Option<SharedRows>,
}

impl BlockCsr {
    /// Number of block rows (sites).
    pub fn rows(&self) -> usize {
        self.row_offsets.len().saturating_sub(1)
    }

    /// Number of scalar unknowns.
    pub fn dofs(&self) -> usize {
        self.rows() * self.block
    }

    /// Number of scalars in all rows, shared ones counted in every row.
    pub fn nonzeros(&self) -> usize {
        self.columns.len() * self.block * self.block
    }

    /// The largest sum of the sizes of the scalars of a row, `‖K‖_∞`.
    pub fn largest_row_sum(&self) -> f64 {
        let d = self.block;
        let mut largest = 0.0_f64;
        for i in 0..self.rows() {
            let (_, blocks) = self.row(i);
            for a in 0..d {
                let scalars = blocks.chunks(d * d).flat_map(|k| &k[a * d..(a + 1) * d]);
                largest = largest.max(scalars.map(|k| k.abs()).sum());
            }
        }
        largest
    }

    /// The first block of row `i`, counted in blocks from the start of `values`.
    pub fn start(&self, i: usize) -> usize {
        match &self.shared {
            Some(shared) => shared.starts[i],
            None => self.row_offsets[i],
        }
    }

    /// The block columns and the blocks of row `i`.
    pub fn row(&self, i: usize) -> (&[u32], &[f64]) {
        let (a, b) = (self.row_offsets[i], self.row_offsets[i + 1]);
        let (s, first) = (self.block * self.block, self.start(i));
        (
            &self.columns[a..b],
            &self.values[first * s..(first + b - a) * s],
        )
    }

    /// `y = K x`, threaded over rows; the same bits for any number of threads, and whether or not rows share their blocks.
    pub fn multiply_into(&self, x: &[f64], y: &mut [f64]) {
        spmv::multiply_into(self, None, x, y);
    }

    /// As [`BlockCsr::multiply_into`], of those chunks of [`ROW_CHUNK`] rows that are marked; nothing is done to the others.
    pub fn multiply_chunks_into(&self, marked: Option<&[bool]>, x: &[f64], y: &mut [f64]) {
        spmv::multiply_into(self, marked, x, y);
    }

    /// `y = K x` of a matrix whose [rows add up to zero](Self::rows_add_up_to_zero), with differences of `x` within each row.
    ///
    /// The part of `x` that is common to a row drops out of it before it is multiplied, so that the rounding does not grow with it. Rows that share their blocks with those before them are multiplied as by
    /// [`BlockCsr::multiply_into`]. Threaded over rows; the same bits for any number of threads.
    pub fn multiply_differences_into(&self, x: &[f64], y: &mut [f64]) {
        spmv::multiply_differences_into(self, None, x, y);
    }

    /// As [`BlockCsr::multiply_differences_into`], of those chunks of [`ROW_CHUNK`] rows that are marked; nothing is done to the others.
    pub fn multiply_differences_of_chunks_into(
        &self,
        marked: Option<&[bool]>,
        x: &[f64],
        y: &mut [f64],
    ) {
        spmv::multiply_differences_into(self, marked, x, y);
    }

    /// Returns true if every row gives nothing for an `x` that is the same at all sites, to 1e-12 of the sizes of its entries.
    pub fn rows_add_up_to_zero(&self) -> bool {
        let d = self.block;
        parallel::all(self.rows(), 1, |i| {
            let blocks = self.row(i).1;
            let size: f64 = blocks.iter().fold(0.0, |m, k| m.max(k.abs()));
            (0..d * d).all(|e| {
                let entries = || blocks.iter().skip(e).step_by(d * d);
                entries().sum::<f64>().abs() <= 1e-12 * size * entries().count() as f64
            })
        })
    }

    /// `K x`.
    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; self.dofs()];
        self.multiply_into(x, &mut y);
        y
    }

    /// Adds so large a part of its diagonal to the matrix; rows that share their blocks share them still.
    pub fn raise_diagonal(&mut self, part: f64) {
        self.raise_diagonal_of(|row| row as u32, part);
    }

    /// The same where each row is that of a `site`.
    pub fn raise_diagonal_of(&mut self, site: impl Fn(usize) -> u32, part: f64) {
        let d = self.block;
        let mut done = vec![false; self.values.len() / (d * d).max(1)];
        for i in 0..self.rows() {
            let (columns, _) = self.row(i);
            let Ok(place) = columns.binary_search(&site(i)) else {
                continue;
            };
            let block = self.start(i) + place;
            if !std::mem::replace(&mut done[block], true) {
                for a in 0..d {
                    self.values[block * d * d + a * (d + 1)] *= 1.0 + part;
                }
            }
        }
    }

    /// `Σ_b |K_ab|` of every scalar row.
    pub fn row_sums(&self) -> Vec<f64> {
        let d = self.block;
        let mut sums = vec![0.0; self.dofs()];
        for (i, sums) in sums.chunks_exact_mut(d.max(1)).enumerate() {
            for block in self.row(i).1.chunks_exact(d * d) {
                for (sum, row) in sums.iter_mut().zip(block.chunks_exact(d)) {
                    *sum += row.iter().map(|k| k.abs()).sum::<f64>();
                }
            }
        }
        sums
    }

    /// The same matrix by scalar rows, for other programs: products, transposes, Matrix Market files.
    pub fn to_csr(&self) -> sprs::CsMat<f64> {
        let d = self.block;
        let mut offsets = Vec::with_capacity(self.dofs() + 1);
        let (mut columns, mut values) = (Vec::new(), Vec::new());
        offsets.push(0);
        for i in 0..self.rows() {
            let (sites, blocks) = self.row(i);
            for a in 0..d {
                for (e, &site) in sites.iter().enumerate() {
                    for b in 0..d {
                        columns.push(site as usize * d + b);
                        values.push(blocks[(e * d + a) * d + b]);
                    }
                }
                offsets.push(columns.len());
            }
        }
        sprs::CsMat::new((self.dofs(), self.dofs()), offsets, columns, values)
    }

    /// `‖K − Kᵀ‖_F / ‖K‖_F`.
    pub fn asymmetry(&self) -> f64 {
        let d = self.block;
        let of_row = |i: usize| {
            let (mut diff, mut norm) = (0.0, 0.0);
            let (columns, blocks) = self.row(i);
            for (e, &c) in columns.iter().enumerate() {
                let (other, other_blocks) = self.row(c as usize);
                let t = other.binary_search(&(i as u32)).ok();
                for a in 0..d {
                    for b in 0..d {
                        let k = blocks[e * d * d + a * d + b];
                        let kt = t.map_or(0.0, |t| other_blocks[t * d * d + b * d + a]);
                        // an entry without its mirror would be met once only, hence counted twice
                        diff += (k - kt) * (k - kt) * if t.is_none() { 2.0 } else { 1.0 };
                        norm += k * k;
                    }
                }
            }
            (diff, norm)
        };
        // by fixed chunks, so that the sum has the same bits on any number of threads
        let parts: Vec<(f64, f64)> = parallel::map(self.rows().div_ceil(1024), 1, |chunk| {
            (chunk * 1024..((chunk + 1) * 1024).min(self.rows()))
                .map(of_row)
                .fold((0.0, 0.0), |s, r| (s.0 + r.0, s.1 + r.1))
        });
        let (diff, norm) = parts
            .into_iter()
            .fold((0.0, 0.0), |s, r| (s.0 + r.0, s.1 + r.1));
        if norm == 0.0 {
            0.0
        } else {
            (diff / norm).sqrt()
        }
    }
}

#[cfg(test)]
mod tests;
