//! Deformation and failure of the bonds of a moving model.

#![deny(clippy::wildcard_enum_match_arm)]

use std::sync::Arc;

use crate::{
    coupling::BrokenBonds,
    model::Model,
    peridynamics::{
        bond_force::{BondKinematics, BondSoftening, KernelError, Storage},
        contact::ContactError,
        failure::StateCriterion,
    },
    tensor::Vector,
};

pub(super) const NONE: u32 = u32::MAX;

/// Points per task of the copies between sites and points.
pub(super) const CHUNK: usize = 4096;

/// Behaviour of the bonds of a moving model.
pub struct BondBehaviour<'a, const D: usize> {
    /// Kinematics of the bonds, which turn with the body or are linear in the displacement.
    pub kinematics: BondKinematics,
    /// Threshold at which bonds break; none if nothing breaks them.
    pub failure: Option<BondThreshold>,
    /// Softening of bonds, with the energy of a break at the threshold, which is then a stretch; none for bonds that break at once.
    pub softening: Option<BondSoftening>,
    /// Region where bonds never break.
    pub no_fail: &'a (dyn Fn(&Vector<D>) -> bool + Sync),
    /// Contact of points that no bond joins; none if they may pass through each other.
    pub contact: Option<ContactBehaviour>,
    /// Storage of the weights of bonds; in four bytes, they are listed one by one.
    pub storage: Storage,
    /// Free thermal stretch of points; none if nothing expands, or if all bonds are linear and expand by their rows.
    pub heat: Option<FreeStretch<D>>,
    /// Bonds that are broken from the start, in a motion that goes on from another layout.
    pub broken: Option<&'a BrokenBonds<D>>,
}

impl<const D: usize> BondBehaviour<'_, D> {
    /// Returns true if accelerators of laws know all of it: neither a temperature nor a criterion of a state.
    pub(super) fn suits_accelerators(&self) -> bool {
        self.heat.is_none() && !matches!(self.failure, Some(BondThreshold::State(_)))
    }
}

/// A number of a position, a material and a time.
pub type StretchOf<const D: usize> = dyn Fn(&Vector<D>, u16, f64) -> f64 + Send + Sync;

/// Displacements of the nodes of a cell of a model at a time.
pub type CellExpansion<const D: usize> =
    dyn Fn(&Model<D>, usize, f64) -> Vec<Vector<D>> + Send + Sync;

/// The stretch `α ΔT` by which points expand freely.
#[derive(Clone)]
pub struct FreeStretch<const D: usize> {
    /// At a place, of a material's number, at a time.
    pub at: Arc<StretchOf<D>>,
    /// The displacements \[m\] by which the nodes of a cell expand freely about its centroid, at a time.
    pub of_cell: Arc<CellExpansion<D>>,
    /// Stretch of the solid over that within the body, of each material: 1, and 1/(1 + ν) in plane strain.
    pub solid: Vec<f64>,
    /// True if it changes with time.
    pub varies_in_time: bool,
}

/// Threshold at which bonds break: a stretch, or a state.
#[derive(Clone, Debug)]
pub enum BondThreshold {
    /// The same everywhere.
    Uniform(f64),
    /// One for each lattice of the model: the same fracture energy takes a larger stretch where the horizon is smaller.
    PerLattice(Vec<f64>),
    /// One for each pair of materials.
    ByMaterials(StretchOfMaterials),
    /// No stretch, but a state of points and bonds.
    State(Arc<dyn StateCriterion>),
}

/// The stretch that breaks bonds of each pair of materials.
#[derive(Clone, Debug, PartialEq)]
pub struct StretchOfMaterials {
    /// Row by row, the same from both ends; infinite where no bond breaks.
    stretch: Vec<f64>,
    materials: usize,
}

impl StretchOfMaterials {
    /// Of so many materials, each pair by `of`.
    pub fn new(materials: usize, of: impl Fn(u16, u16) -> f64) -> Self {
        let pairs = (0..materials as u16).flat_map(|a| (0..materials as u16).map(move |b| (a, b)));
        let stretch = pairs.map(|(a, b)| of(a.min(b), a.max(b))).collect();
        Self { stretch, materials }
    }

    /// The smallest.
    pub fn smallest(&self) -> f64 {
        self.stretch.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Of bonds between two of them.
    pub fn at(&self, a: u16, b: u16) -> f64 {
        self.stretch[usize::from(a) * self.materials + usize::from(b)]
    }
}

impl BondThreshold {
    /// The stretch that breaks a bond of a lattice between two materials; infinite where none does.
    pub fn at(&self, lattice: usize, [a, b]: [u16; 2]) -> f64 {
        match self {
            Self::Uniform(s) => *s,
            Self::PerLattice(list) => list.get(lattice).copied().unwrap_or(f64::INFINITY),
            Self::ByMaterials(stretch) => stretch.at(a, b),
            Self::State(_) => f64::INFINITY,
        }
    }

    /// The stretch that breaks the bonds of the first lattice, whatever their materials; none of a criterion that asks for these, or for no stretch.
    pub fn single(&self) -> Option<f64> {
        match self {
            Self::Uniform(s) => Some(*s),
            Self::PerLattice(list) => list.first().copied(),
            Self::ByMaterials(_) | Self::State(_) => None,
        }
    }
}

/// Contact of points that no bond joins, and of surfaces of elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactBehaviour {
    /// Part of the spacing, or of their distance at rest, to which two points may approach each other.
    pub approach: f64,
    /// Stiffness of the repulsion relative to a bond as long as the horizon; 15 in EMU.
    pub stiffness: f64,
    /// Coefficient of friction on surfaces of elements.
    pub friction: f64,
    /// Distance up to which surfaces that are apart or overlap at time zero count as touching \[m\].
    pub adjust: f64,
}

/// Reasons why a model cannot move bond by bond.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SystemError {
    /// The law has no bonds that could stretch or break one by one.
    #[error(
        "bonds of the material {law} are known to first order only: they can neither break nor turn; use bond-based or lps, or leave fracture-energy, critical-stretch and bonds = \"exact\" out"
    )]
    Law {
        /// Its name.
        law: &'static str,
    },
    /// Bonds of the law know no temperature.
    #[error(
        "bonds of the material {law} break or bend without a temperature of their own; leave [temperature] out"
    )]
    Expansion {
        /// Its name.
        law: &'static str,
    },
    /// The bonds cannot be traversed.
    #[error(transparent)]
    Kernel(#[from] KernelError),
    /// The contact cannot be set up.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// A law that softens would not take its fracture energy in an element.
    #[error(transparent)]
    Band(#[from] crate::fem::CellBandError),
}
