//! Interface of a peridynamic law: a linearisation, a nonlinear response, and the energy of breaking bonds.

use std::sync::Arc;

use crate::material::LocalLaw;
use crate::peridynamics::{
    BondEnergy, Departure, ForceState, LinearForceState,
    softening::{CalibrationError, RegularFamily},
};
use crate::tensor::Tensor;

/// A fast pass over all bonds that computes the response of a law's [`ForceState`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Accelerator {
    /// [`crate::peridynamics::bond_force::BondForce::Pairwise`].
    Pairwise,
    /// [`crate::peridynamics::bond_force::BondForce::Solid`].
    Solid {
        /// Bulk modulus of `D` dimensions \[Pa\].
        bulk: f64,
        /// Shear modulus \[Pa\].
        shear: f64,
    },
}

/// Constants that follow from the lattice at hand and its horizon.
pub trait Calibrate<const D: usize> {
    /// The law for a lattice, whatever lattice it was calibrated for before.
    ///
    /// # Errors
    /// [`CalibrationError`] if no constants meet the requirements of the material.
    fn to_lattice(
        &self,
        family: &RegularFamily<'_, D>,
    ) -> Result<Arc<dyn Law<D>>, CalibrationError>;

    /// Returns the constants in words; none before a calibration.
    fn found(&self) -> Option<String>;

    /// The stretch at which bonds cease to be elastic; none before a calibration.
    fn elastic_limit(&self) -> Option<f64>;
}

/// A peridynamic law.
pub trait Law<const D: usize>: Send + Sync + std::fmt::Debug {
    /// Its usual name.
    fn name(&self) -> &'static str;

    /// Its instantaneous linearisation at rest.
    fn linearised(&self) -> &dyn LinearForceState<D>;

    /// The nonlinear response; none for a law that is known to first order only, whose bonds neither rotate nor break.
    fn force_state(&self) -> Option<&dyn ForceState<D>>;

    /// A fast pass for [`Law::force_state`], if there is one: of a law without it the bonds that a seam cuts stay linear.
    fn accelerator(&self) -> Option<Accelerator>;

    /// The local law that finite elements of this material have; none if they are linear, with the collapsed tensor of the bonds.
    fn local_law(&self) -> Option<Arc<dyn LocalLaw<D>>>;

    /// Range in which the force with linear kinematics is that of [`Law::linearised`].
    fn linearity(&self) -> Linearity;

    /// Returns the departure from [`Law::linearised`] under a uniform mechanical `strain` that is reached at once and then held for a `time` \[s\]: finite elements without a [`Law::local_law`] and rows at a seam lack it. Bonds that break by a scene's
    /// criterion are left out. Every law says so, since nothing else would warn of elements that go on as if they were elastic.
    fn departure(&self, strain: &Tensor<D>, time: f64) -> Departure;

    /// Returns true if bonds can break: [`Law::force_state`] then takes families that have lost some.
    fn has_breakable_bonds(&self) -> bool;

    /// Returns the origin of its constants.
    fn parameters(&self) -> Parameters<'_, D>;

    /// Returns the energy stored in the bonds of a continuous family, and the energy of breaking them, to second order in the stretch, if that is known in closed form; `horizon` is δ \[m\].
    fn bond_energy(&self, horizon: f64) -> Option<BondEnergy>;
}

/// Origin of the constants of a law.
#[derive(Clone, Copy)]
pub enum Parameters<'a, const D: usize> {
    /// Those that the law is made with.
    Typed,
    /// The lattice at hand, to which they are calibrated.
    OfLattice(&'a dyn Calibrate<D>),
    /// The materials of a mixture.
    OfMaterials(&'a dyn Mixture<D>),
}

/// Range in which the force of a law with linear kinematics is that of its linearisation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Linearity {
    /// At any displacement and time.
    Always,
    /// As long as nothing is damaged, so that a seam beside undamaged bonds is in equilibrium.
    UntilDamaged,
    /// To first order only; such a law takes part in no coupling by force.
    AtRest,
}

impl<const D: usize> dyn Law<D> + '_ {
    /// Returns the calibration of its constants to the lattice at hand, if they follow from it.
    pub fn calibrate(&self) -> Option<&dyn Calibrate<D>> {
        match self.parameters() {
            Parameters::OfLattice(calibrate) => Some(calibrate),
            _ => None,
        }
    }

    /// The laws of its materials, if it stands for several.
    pub fn several(&self) -> Option<&dyn Mixture<D>> {
        match self.parameters() {
            Parameters::OfMaterials(mixture) => Some(mixture),
            _ => None,
        }
    }

    /// Returns true if the force with linear kinematics is linear at any displacement and time.
    pub fn is_linear(&self) -> bool {
        self.linearity() == Linearity::Always
    }

    /// Returns true if it is as long as nothing is damaged.
    pub fn is_linear_until_damaged(&self) -> bool {
        self.linearity() != Linearity::AtRest
    }

    /// Returns true if bonds or points lose their stiffness by a damage of the law, [`crate::peridynamics::HistoryLayout::damage`].
    pub fn damages(&self) -> bool {
        let states = self.force_state();
        states.is_some_and(|states| states.history().damage.is_some())
    }
}

/// Several materials behind one law, by their numbers.
pub trait Mixture<const D: usize>: Send + Sync {
    /// The numbers of the materials that points have.
    fn used(&self) -> &[u16];

    /// The law of a material.
    fn law(&self, material: u16) -> &dyn Law<D>;

    /// `p` of a bond from a point of the material `own` to one of `far` over that within `own`; 1 for laws that do not act bond by bond.
    fn relative(&self, own: u16, far: u16) -> f64;

    /// Stiffness of a bond between two materials over that within the first in use; of laws that do not act bond by bond what the end in `own` gives.
    fn scale(&self, own: u16, far: u16) -> f64;
}
