//! Bond passes: the internal force of a peridynamic body as one threaded sweep over its bonds, with damage at one bit per directed bond.
//!
//! | file | what |
//! |---|---|
//! | `force_problem.rs` | input of a pass, and the errors |
//! | `kinematics.rs` | kinematics of bonds: exact, or to first order |
//! | `stretch.rs` | one bond: stretch, force and extension without cancellation |
//! | `softened_bonds.rs`, `lattice_softening.rs`, `list_softening.rs` | bonds between the onset of softening and their end |
//! | `breaks.rs` | energy of the bonds that a pass broke |
//! | `generic.rs`, `generic_tangent.rs` | the pass that any law takes, by its force states; its tangent at rest |
//! | `point_forces.rs`, `point_state.rs`, `family_control.rs` | the same of correspondence, by a stress per point; its data; its zero-energy control |
//! | `point_loops.rs` | its loops over the bonds |
//! | `bond_failure.rs`, `generic_failure.rs` | failure of its bonds |
//! | `carried_deformation.rs`, `generic_carried.rs` | the deformation that a point which has flowed keeps where its bonds break |
//! | `bond_heat.rs`, `generic_heat.rs` | temperature: the stretch that counts, the work of heating |
//! | `generic_states.rs` | its force states at single points |
//! | `generic_damage.rs` | damage that laws keep of their bonds |
//! | `bond_list.rs` | neighbour lists with the data of their pass |
//! | `list.rs`, `list_simd.rs` | the pass over neighbour lists, for any cloud; eight bonds of it at a time |
//! | `compressed_list.rs` | neighbours and weights of a list in few bytes |
//! | `lattice.rs` | the pass over a regular lattice: a fixed stencil and no list |
//! | `lattice_pass.rs` | its sweeps, and forces by point |
//! | `lattice_setup.rs` | its setup |
//! | `own_points.rs` | points shared out among several passes |
//! | `shared_rows.rs` | families that are spread over processes |
//! | `stencil.rs`, `stencil_numbers.rs` | the lattice's padded box, its offsets and bits; their weights |
//! | `lattice_simd.rs` | the inner loops of the lattice pass |
//! | `simd.rs` | eight numbers at a time, by the machine's widest instructions |
//! | `reference_force.rs`, `tests.rs`, `softening_tests.rs` | passes against a plain double loop |
//!
//! The deformation of a bond is expressed by `t = (2 ξ·η + η·η)/r²`, so that `|ξ + η| = r √(1 + t)`: no length is ever the difference of two long ones, and the stretch
//! `s = √(1 + t) − 1` exceeds `s_c` exactly where `t > s_c (2 + s_c)`, without a root. Both ends of a bond compute the same `t` from the same numbers,
//! hence break together without communication. Every method gives the same bits for any number of threads.

mod bond_failure;
mod bond_heat;
pub(crate) mod bond_list;
mod breaks;
mod carried_deformation;
mod compressed_list;
mod family_control;
mod force_problem;
mod generic;
mod generic_carried;
mod generic_damage;
mod generic_failure;
mod generic_heat;
mod generic_states;
mod generic_tangent;
#[cfg(test)]
mod generic_tests;
mod kinematics;
mod lattice;
mod lattice_pass;
mod lattice_setup;
// vector instructions: besides these two modules only `parallel.rs` has unsafe code
#[allow(unsafe_code)]
mod lattice_simd;
mod lattice_softening;
mod list;
mod list_simd;
mod list_softening;
mod own_points;
mod point_forces;
#[cfg(test)]
mod point_forces_tests;
mod point_loops;
mod point_state;
#[cfg(test)]
mod reference_force;
mod shared_rows;
#[allow(unsafe_code)]
mod simd;
mod softened_bonds;
#[cfg(test)]
mod softening_tests;
mod stencil;
mod stencil_numbers;
pub(super) mod stretch;
#[cfg(test)]
mod tearing_tests;
#[cfg(test)]
mod tests;

pub use force_problem::{
    BondCriterion, BondForce, BondFunction, BondSetup, DistributedRows, Failure, KernelError,
    Layout, Storage,
};
pub use kinematics::BondKinematics;
pub use softened_bonds::BondSoftening;

pub use stencil::BlockSetup;

pub(crate) use carried_deformation::{conjugate, felt};
pub(crate) use list::{extension, ratio, stretched};
pub(crate) use softened_bonds::{SoftenedBond, SoftenedBonds};

use crate::dimension;
use crate::peridynamics::CauchyStress;
use crate::system::{BondChanges, ExactSum, FailureUpdate, Interval};
use crate::tensor::Vector;

/// One sweep over the bonds of a cloud.
///
/// Shapes: `u`, `force`, `x`, `y` and the row sums have `D` numbers per point of the cloud, `damage` one. Units: \[m\], \[N\] (per area of a bar of unit
/// section in 1D, per thickness in 2D).
pub trait BondPass<const D: usize>: Send + Sync {
    /// Number of points of the cloud.
    fn points(&self) -> usize;

    /// Name of this pass, in a word: `list` or `lattice`.
    fn name(&self) -> &'static str;

    /// Directed bonds of the reference families.
    fn bonds(&self) -> u64;

    /// Overwrites `force` with the internal force `F(u, t, Δt)` (`K u` of a linear body, so minus the force that acts on the point), volume included; zero for points without a row.
    /// Returns how many directed bonds this pass broke, and how many it softened.
    fn force_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        interval: Interval,
        breakage: FailureUpdate,
    ) -> BondChanges;

    /// Ends the interval of the last call of [`BondPass::force_into`]: its history is the past of the next. Returns the energy that points with rows dissipated in it \[J\].
    fn commit(&mut self) -> f64;

    /// Returns true if the pass has history variables.
    fn remembers(&self) -> bool;

    /// `y = K x` with the tangent `K` at rest and bonds as they stand; zero for points without a row.
    fn tangent_into(&self, x: &[f64], y: &mut [f64]);

    /// Per unknown an upper bound of `Σ |K_ab|` over the points of the cloud, with bonds as they stand; zero for points without a row.
    fn row_sums(&self) -> Vec<f64>;

    /// Energy stored at the points with rows \[J\]; of each bond, half belongs to each end.
    fn stored_energy(&self, u: &[f64]) -> f64;

    /// Overwrites `damage` with `1 − Σ (1 − φ) V / Σ V` of every point, φ = 1 of broken bonds and else what a law says, 0 if nothing; zero where there is no family.
    fn damage_into(&self, damage: &mut [f64]);

    /// Returns true if a bond of point `i` is broken, or damaged by its law.
    fn is_damaged(&self, i: usize) -> bool;

    /// Directed bonds of the reference families that are broken, or damaged through by their law at both ends.
    fn broken(&self) -> u64;

    /// Directed bonds that the last pass broke, as a point and its neighbour, in a fixed order.
    fn last_broken(&self) -> Vec<(u32, u32)>;

    /// An upper bound on the eigenvalues of `M⁻¹ C` of forces `C v` against velocities, with the mass of each point \[1/s\].
    fn drag_rate(&self, mass: &dyn Fn(usize) -> f64) -> f64;

    /// Adds to `lost`, point by point, what the points with rows would store less at the displacement `at` of each point, for the bonds that the last pass broke:
    /// their energy before less that after, all of these bonds removed at once \[J\]. Of a state-based law that is the change of dilatations too.
    fn add_lost_energy(&self, at: &dyn Fn(usize) -> [f64; D], lost: &mut ExactSum);

    /// Returns the energy that [`BondPass::add_lost_energy`] adds up \[J\].
    fn lost_energy(&self, at: &dyn Fn(usize) -> [f64; D]) -> f64 {
        let mut lost = ExactSum::default();
        self.add_lost_energy(at, &mut lost);
        lost.value()
    }

    /// Parts of its stiffness that the bond of point `i`, which has a family, to point `j` has: of its pair force, and of the extension that enters the dilatation; zero where none of the reference families joins them, or where it has broken.
    fn left(&self, i: usize, j: usize) -> [f64; 2];

    /// Returns true if a bond of the reference families joins the points and has not broken; contact leaves such pairs to their bond.
    fn bonded(&self, i: usize, j: usize) -> bool {
        self.left(i, j) != [0.0; 2]
    }

    /// The bits that say which bonds stand.
    fn damage_state(&self) -> Vec<u64>;

    /// Puts back what [`BondPass::damage_state`] gave; false, and nothing changed, if it belongs to another pass.
    fn restore_damage(&mut self, state: &[u64]) -> bool;

    /// The pass as one that may leave points to others; none where it computes all of them together.
    fn own_points(&mut self) -> Option<&mut dyn OwnPoints>;

    /// The pass as one whose bonds know a temperature; none of an accelerator.
    fn heated(&mut self) -> Option<&mut dyn HeatedBonds>;

    /// The force states that it computes one by one, for queries of them; none of an accelerator.
    fn force_states(&self) -> Option<&dyn ForceStates<D>>;

    /// Bytes that the pass holds.
    fn memory_bytes(&self) -> usize;
}

/// A pass whose bonds know a temperature.
pub trait HeatedBonds {
    /// Sets the stretch `α ΔT` by which each point expands freely; a bond has the mean of its ends. Forces, energies and criteria are those of what is left of its stretch. `solid` is the stretch of the solid that each point is made of, which its local law takes: in plane strain it is smaller.
    fn set_free_stretch(&mut self, free: &[f64], solid: &[f64]);

    /// The work that changes of the free stretch have done since it was last taken \[J\], up to the last [`BondPass::commit`].
    fn take_heat_work(&mut self) -> f64;
}

/// A pass that computes some of its points only.
pub trait OwnPoints {
    /// Leaves all but the points marked to others: their forces are anything from now on, and products with the tangent too. Energies and row sums are still those of all.
    fn compute_only(&mut self, own: &[bool]);

    /// The bonds of own points that the last pass broke, in words that mean the same to every pass of the same body.
    fn broken_at_own(&self) -> Vec<u64>;

    /// Breaks the bonds that all passes broke at their own points, this one's included; from now on they are what the last pass broke. Returns how many.
    fn take_broken(&mut self, words: &[u64]) -> u64;

    /// Goes on with the displacements of some points alone: own ones and all that own forces take theirs from. Each pass then breaks bonds of own points only.
    fn reach_only(&mut self, reach: &Reach<'_>);

    /// Overwrites the forces of own points, and calls `told` with them as soon as those are there that others wait for. Returns how many bonds of own points broke.
    fn own_force_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        breakage: FailureUpdate,
        told: Told<'_>,
    ) -> u64;

    /// Returns true if the last such force broke bonds of points whose breaks are found here, own points or not.
    fn has_seen_breaks(&self) -> bool;
}

/// Callback that runs once the forces are there that others wait for.
pub type Told<'a> = &'a mut dyn FnMut(&[f64]);

/// Points of a process among those of a body.
#[derive(Clone, Copy, Debug)]
pub struct Reach<'a> {
    /// True for each point that is its own.
    pub own: &'a [bool],
    /// True for each point whose displacement is known.
    pub known: &'a [bool],
    /// Own points whose forces others wait for.
    pub sent: &'a [u32],
    /// Points of others whose bonds break here as well, beside those that own forces ask for.
    pub followed: &'a [u32],
}

/// Results from the force states of a body.
pub trait ForceStates<const D: usize> {
    /// The stress of a point by its intact bonds and its history, [`crate::peridynamics::ForceState::stress`], where the points are displaced by `displaced` \[m\].
    fn stress(&self, point: usize, displaced: &dyn Fn(usize) -> Vector<D>) -> CauchyStress<D>;

    /// The energy density that a point stores at the displacements `u`, by its intact bonds \[J/m^D\].
    fn energy_density(&self, point: usize, u: &[f64]) -> f64;

    /// Number of bonds of a point's family.
    fn family_size(&self, point: usize) -> usize;

    /// Number of points with rows that have lost bonds and do not respond at the displacements `u`, [`crate::peridynamics::ForceState::responds`].
    fn points_without_response(&self, u: &[f64]) -> usize;

    /// History variables of points, by name: one number per point.
    fn remembered(&self) -> Vec<(&'static str, Vec<f64>)>;
}

/// The pass that suits the setup: over the lattice where the points fill one, over lists otherwise.
///
/// # Errors
/// [`KernelError`] if lists do not belong together, if a bond does not weigh the same from both ends, or if the lattice pass was asked for where there is no lattice.
pub fn bond_pass<const D: usize>(
    setup: &BondSetup<'_, D>,
) -> Result<Box<dyn BondPass<D>>, KernelError> {
    dimension::of::<Pass<D>>(&PASSES)(setup)
}

type Pass<const D: usize> = fn(&BondSetup<'_, D>) -> Result<Box<dyn BondPass<D>>, KernelError>;

static PASSES: (Pass<1>, Pass<2>, Pass<3>) = (pass, pass, pass);

fn pass<const D: usize>(setup: &BondSetup<'_, D>) -> Result<Box<dyn BondPass<D>>, KernelError> {
    let lists = setup.check_lists();
    if !setup.holds_on_all(lists.is_ok()) {
        return shared_rows::with_all_families(setup, |setup| setup.check_lists())
            .and(lists)
            .and(Err(KernelError::NoLattice {
                why: "lists differ between processes".into(),
            }));
    }
    lists?;
    let reads_flow = (setup.failure.as_ref())
        .is_some_and(|f| matches!(f.critical, BondCriterion::State(s) if s.reads().flow));
    if reads_flow && !setup.flows() {
        return Err(KernelError::NoFlow);
    }
    if let BondForce::Law { law, body } = setup.force {
        if (setup.failure.as_ref()).is_some_and(|f| f.softening.is_some()) {
            return Err(KernelError::Softening { law: law.name() });
        }
        setup.check_bonds()?;
        let states = law
            .force_state()
            .ok_or(KernelError::FirstOrder { law: law.name() })?;
        return Ok(Box::new(generic::Generic::new(setup, law, states, body)));
    }
    let mut why = None;
    if setup.layout != Layout::List {
        match lattice::Lattice::new(setup) {
            Ok(pass) => return Ok(Box::new(pass)),
            Err(reason) => why = Some(reason),
        }
    }
    shared_rows::with_all_families(setup, |setup| {
        // a lattice has looked at its bonds by offsets; what stands against one may be a fault
        setup.check_bonds()?;
        match why {
            Some(why) if setup.layout == Layout::Lattice => Err(KernelError::NoLattice { why }),
            _ => Ok(Box::new(bond_list::List::new(setup)) as _),
        }
    })
}

/// The pass of a full block of a lattice, without lists on the way.
///
/// # Errors
/// [`KernelError::NoLattice`] if its box is too large to be numbered.
pub fn block_pass<const D: usize>(
    setup: &BlockSetup<'_, D>,
) -> Result<Box<dyn BondPass<D>>, KernelError> {
    match lattice::Lattice::block(setup) {
        Ok(pass) => Ok(Box::new(pass)),
        Err(why) => Err(KernelError::NoLattice { why }),
    }
}

/// The instruction set that passes run with on this machine; results do not depend on it.
pub fn instructions() -> &'static str {
    simd::instructions()
}

/// Bits as words, with a last word by which [`unpack`] knows them.
pub(crate) fn pack(bits: &[u8], reference: u64) -> Vec<u64> {
    let word = |c: &[u8]| {
        let mut word = [0; 8];
        word[..c.len()].copy_from_slice(c);
        u64::from_le_bytes(word)
    };
    bits.chunks(8).map(word).chain([reference]).collect()
}

/// Bits from words; false, and nothing changed, if they are not what [`pack`] gave for as many bits and bonds.
pub(crate) fn unpack(state: &[u64], reference: u64, bits: &mut [u8]) -> bool {
    let words = bits.len().div_ceil(8);
    if state.len() != words + 1 || state[words] != reference {
        return false;
    }
    for (bits, word) in bits.chunks_mut(8).zip(state) {
        bits.copy_from_slice(&word.to_le_bytes()[..bits.len()]);
    }
    true
}
