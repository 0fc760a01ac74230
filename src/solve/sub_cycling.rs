//! Sub-cycling: a few stiff sites take several steps in each step of all others.
//!
//! Source: \[Diaz2009\], leap-frog with local time steps, damped as in \[Grote2021\]. With `A = M⁻¹ K`, `P` the projection on the fine sites and `p` steps of them in each
//! step Δt, the force `M A u` becomes
//!
//! ```text
//! F_p(u) = M A g(Δt² P A) u ,      x g(x) = 2 (1 − T_p(δ − x/ω) / T_p(δ)) ,      ω = 2 T_p′(δ)/T_p(δ)
//! ```
//!
//! with the Chebyshev polynomial `T_p`. On the fine sites alone that is `p` damped steps of Δt/p: bounded by 4 for `x` up to `ω (1 + δ)`, nearly `4 p²`. Where no fine site is near,
//! `g = 1`. If `K` is symmetric, so is `F_p`, and it vanishes under the same motions: energy and momentum are conserved as without sub-cycling, and the same driver, stable step and
//! checkpoints serve. It differs from `F` by the order Δt². The recurrence for `T_p` costs `p − 1` products with the columns of `K` that belong to fine sites.
//!
//! Loads enter at the whole step. One on a fine site is felt there with an error of the order Δt², at rest too.

use crate::{
    solve::stable_step::{self, StepError, StepLimit},
    system::{
        BlockCsr, BodyHistory, BodyState, BondChanges, Dissipation, ElementTangent, FailureUpdate,
        Halfway, Interval, RateBounds, SemiDiscrete, SharedSteps, Symmetry, Tangent,
    },
};

/// `T_p(δ)`: it keeps modes of the fine sites away from the ends of the stability range. With cells a quarter as long in the middle of a bar the step is 1.28, 1.36 and 1.40 times larger with 2, 3 and 4
/// sub-steps at 1.05, 1.72, 2.84 and 3.80 at 1.2, and 1.84, 2.72 and 3.60 at 1.4; more costs the range of every polynomial.
const DAMPING: f64 = 1.4;

/// Products that find the limit of the coarse sites to some per cent, from above; what is taken is certified afterwards.
const ROUGH: usize = 20;

/// Trials of the step, each at most a tenth below the last.
const TRIALS: usize = 12;

/// Sites beyond this part of all, the stiffest, may be fine: sub-steps of more save little.
const COARSE: f64 = 0.75;

/// Reasons against sub-cycling of a system.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SubCyclingError {
    /// No energy, no guarantee.
    #[error(
        "sub-cycling needs a symmetric stiffness, and that of this coupling is not: leave sub-steps out, or use coupling.truncated"
    )]
    Unsymmetric,
    /// A number of steps that makes no sense.
    #[error("{sub_steps} sub-steps: it must be from 2 to {most}")]
    SubSteps {
        /// Those asked for.
        sub_steps: u32,
        /// The most.
        most: u32,
    },
    /// The small step is everywhere, or belongs to bonds that may break.
    #[error(
        "the step is limited by {what}, which cannot be sub-cycled: use fewer sub-steps, or leave them out"
    )]
    NoGain {
        /// The limit of the step, in words.
        what: &'static str,
    },
    /// The rows give no frequency.
    #[error(transparent)]
    Step(#[from] StepError),
}

/// The most sub-steps: beyond it, cells of such different sizes are a mistake of the mesh.
pub const MOST: u32 = 16;

/// The stiff sites of a system, and the data of their sub-steps.
#[derive(Clone, Debug)]
pub struct FineSites {
    /// Ascending.
    sites: Vec<u32>,
    /// Sites that the columns of the fine ones reach, ascending.
    rows: Vec<u32>,
    /// Position of each fine site among them.
    row_of_fine: Vec<u32>,
    /// Those columns.
    columns: BlockCsr,
    /// 1/m of each fine dof, 0 where it is prescribed.
    inverse_mass: Vec<f64>,
    /// The largest row sum over mass.
    stiffest: f64,
    recurrence: Recurrence,
}

/// A system whose stiff sites are sub-cycled; the step is part of it.
pub struct SubCycled<'a> {
    system: Box<dyn SemiDiscrete + 'a>,
    fine: FineSites,
    step: f64,
}

/// The Chebyshev recurrence from `d_1 = −c_1 X u` on, of what is added to the coarse step.
#[derive(Clone, Debug)]
struct Recurrence {
    /// `2δ T_k/T_{k+1}`, `T_{k−1}/T_{k+1}`, `2 T_k/(ω T_{k+1})` and `c_k` for `k` from 1 to `p − 1`.
    terms: Vec<[f64; 4]>,
    /// `ω (1 + δ)`.
    range: f64,
}

impl Recurrence {
    fn new(sub_steps: u32) -> Self {
        let p = f64::from(sub_steps);
        let phi = DAMPING.acosh() / p;
        let t = |k: u32| (f64::from(k) * phi).cosh();
        let delta = t(1);
        let omega = 2.0 * p * (p * phi).sinh() / phi.sinh() / DAMPING;
        let (mut before, mut c) = (0.0, 1.0 / (delta * omega));
        let mut terms = Vec::new();
        for k in 1..sub_steps {
            let a = 2.0 * delta * t(k) / t(k + 1);
            let b = t(k - 1) / t(k + 1);
            let g = 2.0 * t(k) / (omega * t(k + 1));
            terms.push([a, b, g, c]);
            (before, c) = (c, a * c - b * before + g);
        }
        Self {
            terms,
            range: omega * (1.0 + delta),
        }
    }
}

/// Kind of sum: signed, or the bound by the absolute values of its terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Terms {
    Signed,
    Absolute,
}

/// Returns true for each dof that is free.
fn free_dofs(system: &dyn SemiDiscrete, prescribed: &[u32]) -> Vec<bool> {
    let d = system.block().max(1);
    let mut is_free = vec![true; system.mass().len() * d];
    prescribed.iter().for_each(|&k| is_free[k as usize] = false);
    is_free
}

/// The largest row sum over mass of each site's free dofs.
fn rates(system: &dyn SemiDiscrete, is_free: &[bool]) -> Vec<f64> {
    let (d, mass) = (system.block().max(1), system.mass());
    let sums = system.row_sums();
    mass.iter()
        .enumerate()
        .map(|(site, m)| {
            let free = (site * d..(site + 1) * d).filter(|&k| is_free[k]);
            free.map(|k| sums[k] / m).fold(0.0, f64::max)
        })
        .collect()
}

impl FineSites {
    /// The sites that limit the step, for `sub_steps` steps of them; `prescribed` lists the dofs that are not free.
    ///
    /// Fine are sites whose row sum over mass exceeds the bound of the coarse step, where nothing breaks ([`Tangent::tangent_is_constant`]).
    ///
    /// # Errors
    /// [`SubCyclingError`].
    pub fn find(
        system: &dyn SemiDiscrete,
        prescribed: &[u32],
        sub_steps: u32,
    ) -> Result<Self, SubCyclingError> {
        if !(2..=MOST).contains(&sub_steps) {
            return Err(SubCyclingError::SubSteps {
                sub_steps,
                most: MOST,
            });
        }
        if system.symmetry() != Symmetry::Symmetric {
            return Err(SubCyclingError::Unsymmetric);
        }
        let (d, mass) = (system.block().max(1), system.mass());
        let is_free = free_dofs(system, prescribed);
        let rates = rates(system, &is_free);
        let recurrence = Recurrence::new(sub_steps);
        let unbreakable = system.tangent_is_constant();
        let stiffest = rates.iter().copied().fold(0.0, f64::max);
        if stiffest == 0.0 {
            let what = "nothing";
            return Err(SubCyclingError::NoGain { what });
        }
        let breakable = rates.iter().zip(&unbreakable).filter(|(_, u)| !**u);
        let breakable = breakable.map(|(r, _)| *r).fold(0.0, f64::max);
        let mut sorted = rates.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        let usual = sorted[((sorted.len() - 1) as f64 * COARSE) as usize];
        // half of what the coarse step bears: sites beside the fine ones feel the sums of both
        let borne = breakable.max(usual).max(2.0 * stiffest / recurrence.range);
        let sites: Vec<u32> = (0..rates.len() as u32)
            .filter(|&s| rates[s as usize] > borne * (1.0 + 1e-9))
            .collect();
        if sites.is_empty() {
            let what = if breakable > usual {
                "sites whose force is not linear, or whose bonds may break,"
            } else {
                "most of the sites"
            };
            return Err(SubCyclingError::NoGain { what });
        }
        let mut rows = system.tangent_rows(&sites).columns;
        rows.sort_unstable();
        rows.dedup();
        let columns = restricted(&system.tangent_rows(&rows), &sites);
        let row_of_fine = sites
            .iter()
            .filter_map(|site| rows.binary_search(site).ok())
            .map(|row| row as u32)
            .collect();
        let dofs = sites
            .iter()
            .flat_map(|&s| (0..d).map(move |k| (s as usize, k)));
        let inverse_mass = dofs
            .map(|(s, k)| {
                if is_free[s * d + k] {
                    1.0 / mass[s]
                } else {
                    0.0
                }
            })
            .collect();
        Ok(Self {
            sites,
            rows,
            row_of_fine,
            columns,
            inverse_mass,
            stiffest,
            recurrence,
        })
    }

    /// The largest step of all others with which the fine sites are within the range of their polynomial \[s\].
    fn range(&self) -> f64 {
        (self.recurrence.range / self.stiffest).sqrt()
    }
}

impl<'a> SubCycled<'a> {
    /// Sub-cycles the fine sites of a system, with steps of the size `step` \[s\] of all others; the driver must take the same.
    pub fn new(system: Box<dyn SemiDiscrete + 'a>, fine: FineSites, step: f64) -> Self {
        Self { system, fine, step }
    }

    /// Finds the stable step of a system with given fine sites, of which `fraction` will be taken.
    ///
    /// It is the largest tried at which the eigenvalues of the sub-cycled tangent, as [`stable_step::stable_step`] bounds them, bear it.
    ///
    /// # Errors
    /// [`StepError`] of the rows or the eigenvalues.
    pub fn with_stable_step(
        system: Box<dyn SemiDiscrete + 'a>,
        fine: FineSites,
        prescribed: &[u32],
        fraction: f64,
    ) -> Result<(Self, StepLimit), StepError> {
        // the fine sites within the range of the polynomial, the others as if the fine ones were held
        let d = system.block().max(1) as u32;
        let mut held = prescribed.to_vec();
        held.extend(fine.sites.iter().flat_map(|s| s * d..(s + 1) * d));
        let coarse = stable_step::rough_limit(system.as_ref(), &held, ROUGH)?;
        let mut stable = fine.range().min(coarse);
        let mut cycled = Self::new(system, fine, stable);
        let mut products = ROUGH;
        let mut trial = 0;
        loop {
            cycled.step = fraction * stable;
            let found = stable_step::stable_step(&cycled, prescribed)?;
            products += found.products;
            trial += 1;
            if stable <= found.stable || trial == TRIALS {
                stable = stable.min(found.stable);
                cycled.step = fraction * stable;
                let limit = StepLimit {
                    stable,
                    products,
                    ..found
                };
                return Ok((cycled, limit));
            }
            stable = found.stable.clamp(0.9 * stable, 0.98 * stable);
        }
    }

    /// Takes another step, the stable one or less.
    pub fn set_step(&mut self, step: f64) {
        self.step = step;
    }

    /// Number of fine sites.
    pub fn fine_sites(&self) -> usize {
        self.fine.sites.len()
    }

    /// Bytes held for the fine sites.
    pub fn memory_bytes(&self) -> usize {
        self.fine.columns.values.len() * 8 + self.fine.columns.columns.len() * 4
    }

    /// Turns `F` into `F_p`, or a bound of the rows of `F` into one of those of `F_p`.
    fn correct(&self, columns: &BlockCsr, terms: Terms, force: &mut [f64]) {
        let d = self.system.block().max(1);
        let sign = if terms == Terms::Signed { -1.0 } else { 1.0 };
        let square = self.step * self.step;
        let fine = &self.fine;
        let at_fine: Vec<f64> = gathered(&fine.sites, d, force);
        let size = fine.rows.len() * d;
        let (mut before, mut now) = (vec![0.0; size], vec![0.0; size]);
        let mut product = vec![0.0; size];
        let mut moved = vec![0.0; at_fine.len()];
        for &[a, b, g, c] in &fine.recurrence.terms {
            let added = gathered(&fine.row_of_fine, d, &now);
            for k in 0..moved.len() {
                moved[k] = square * fine.inverse_mass[k] * (added[k] + sign * c * at_fine[k]);
            }
            columns.multiply_into(&moved, &mut product);
            for k in 0..size {
                let next = a * now[k] + sign * (b * before[k] + g * product[k]);
                (before[k], now[k]) = (now[k], next);
            }
        }
        let twice = 2.0 * sign;
        for (&site, e) in fine.rows.iter().zip(now.chunks_exact(d)) {
            for (f, e) in force[site as usize * d..].iter_mut().zip(e) {
                *f += twice * e;
            }
        }
    }
}

/// The entries of some sites.
fn gathered(sites: &[u32], block: usize, from: &[f64]) -> Vec<f64> {
    let entries = sites
        .iter()
        .flat_map(|&s| &from[s as usize * block..][..block]);
    entries.copied().collect()
}

/// Rows with the columns of some sites only, numbered as these are.
fn restricted(rows: &BlockCsr, sites: &[u32]) -> BlockCsr {
    let size = rows.block * rows.block;
    let mut kept = BlockCsr {
        block: rows.block,
        row_offsets: vec![0],
        ..BlockCsr::default()
    };
    for i in 0..rows.rows() {
        let (columns, blocks) = rows.row(i);
        for (column, block) in columns.iter().zip(blocks.chunks_exact(size)) {
            if let Ok(number) = sites.binary_search(column) {
                kept.columns.push(number as u32);
                kept.values.extend(block);
            }
        }
        kept.row_offsets.push(kept.columns.len());
    }
    kept
}

impl SemiDiscrete for SubCycled<'_> {
    fn block(&self) -> usize {
        self.system.block()
    }

    fn mass(&self) -> &[f64] {
        self.system.mass()
    }

    fn internal_force_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        interval: Interval,
        breakage: FailureUpdate,
    ) -> BondChanges {
        let changes = self
            .system
            .internal_force_into(u, force, interval, breakage);
        self.correct(&self.fine.columns, Terms::Signed, force);
        changes
    }

    fn force_beside_elements_into(&mut self, u: &[f64], force: &mut [f64], interval: Interval) {
        self.internal_force_into(u, force, interval, FailureUpdate::Frozen);
    }

    fn take_heat_work(&mut self) -> f64 {
        self.system.take_heat_work()
    }

    fn force_of_heating_into(
        &mut self,
        _u: &[f64],
        _force: &mut [f64],
        _from: Option<f64>,
        _to: f64,
    ) -> bool {
        false
    }

    fn stored_energy(&self, u: &[f64]) -> f64 {
        self.system.stored_energy(u)
    }

    fn round_off(&self, u: &[f64]) -> f64 {
        self.system.round_off(u)
    }

    fn rate_bounds(&self) -> RateBounds {
        self.system.rate_bounds()
    }

    fn shared_steps(&mut self) -> Option<&mut dyn SharedSteps> {
        None
    }

    fn sites_reached(&self, _own: &[bool]) -> Option<Vec<bool>> {
        None
    }
}

impl Tangent for SubCycled<'_> {
    fn tangent_into(&self, x: &[f64], y: &mut [f64]) {
        self.system.tangent_into(x, y);
        self.correct(&self.fine.columns, Terms::Signed, y);
    }

    fn difference_length(&self) -> Option<f64> {
        self.system.difference_length()
    }

    fn row_sums(&self) -> Vec<f64> {
        let mut sums = self.system.row_sums();
        let mut sizes = self.fine.columns.clone();
        sizes.values.iter_mut().for_each(|k| *k = k.abs());
        self.correct(&sizes, Terms::Absolute, &mut sums);
        sums
    }

    fn tangent_is_constant(&self) -> Vec<bool> {
        vec![false; self.mass().len()]
    }

    fn tangent_rows(&self, _sites: &[u32]) -> BlockCsr {
        BlockCsr::default()
    }

    fn seam_sites(&self) -> Vec<u32> {
        self.system.seam_sites()
    }

    fn symmetry(&self) -> Symmetry {
        self.system.symmetry()
    }

    /// None: that of the elements is not the tangent of what is sub-cycled, and no load step asks for it.
    fn element_tangent(&self, _u: &[f64], _interval: Interval) -> Option<ElementTangent> {
        None
    }
}

impl BodyHistory for SubCycled<'_> {
    fn commit(&mut self) {
        self.system.commit();
    }

    fn dissipation(&self) -> Option<Dissipation> {
        self.system.dissipation()
    }

    fn set_dissipation(&mut self, dissipation: Dissipation) {
        self.system.set_dissipation(dissipation);
    }

    fn account_for_breaks(&mut self, at: &Halfway<'_>) {
        self.system.account_for_breaks(at);
    }

    fn damage_state(&self) -> Vec<u64> {
        self.system.damage_state()
    }

    fn restore_damage(&mut self, state: &[u64]) -> bool {
        self.system.restore_damage(state)
    }

    fn body_state(&self) -> Option<&dyn BodyState> {
        self.system.body_state()
    }
}

#[cfg(test)]
#[path = "sub_cycling_tests.rs"]
mod tests;
