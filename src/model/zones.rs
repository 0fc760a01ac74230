//! Zones of a body, roles of its cells, and the demands of a coupling on the model.

use crate::mesh::Mesh;
use crate::model::FitDegree;
use crate::peridynamics::LinearForceState;
use crate::system::Symmetry;

/// The model that a scene asks for in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Zone {
    /// Classical elasticity by finite elements, `B_0`.
    Local,
    /// Between the two: blending region `B_b` or partial-stress region `B_ps`.
    Transition,
    /// Peridynamics, `B_pd`.
    Nonlocal,
}

/// Role of a cell in a coupling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CellRole {
    /// A finite element with the local law.
    Element,
    /// A finite element whose stress is the partial stress at its Gauss points.
    StressElement,
    /// Filled with peridynamic points.
    Points,
}

/// Extent to which families have to be complete around the sites that are peridynamic points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reach {
    /// Their own families.
    Own,
    /// The families of their neighbours too: force states or stresses of the neighbours enter the row.
    Neighbours,
}

impl Reach {
    /// The extent that forces of bonds ask for: the force states of both ends enter them, which are more than the bond only where a law has a state.
    pub fn of_bond_forces<const D: usize>(law: &dyn LinearForceState<D>) -> Self {
        if law.is_pairwise() {
            Self::Own
        } else {
            Self::Neighbours
        }
    }
}

/// Places that rows at a seam need beside sites; two sets of rows on one model need those of both, [`Interface::with`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interface {
    /// Both models go on behind the seam: places in elements complete families, and elements overlap into the peridynamic zone by one cell, whose far nodes follow the PD points around them. Without, nodes have the rows of their own elements only.
    pub overlap: bool,
    /// The fit to the sites within a horizon that nodes of the seam follow, [SAND2015-7998] section 7.3; without, they are sites.
    pub constrained: Option<FitDegree>,
    /// Bonds end on the faces of elements, behind which the lattice is continued.
    pub faces: bool,
    /// Families end at places on the faces.
    pub feet: bool,
}

impl Interface {
    const SITES: Self = Self {
        overlap: false,
        constrained: None,
        faces: false,
        feet: false,
    };

    /// Nodes of the seam are sites, and both models go on behind it.
    pub const OVERLAP: Self = Self {
        overlap: true,
        ..Self::SITES
    };

    /// Nodes of the seam are sites, nothing overlaps, and bonds end on the faces of elements.
    pub const FACES: Self = Self {
        faces: true,
        ..Self::SITES
    };

    /// As [`Interface::FACES`], where families end at places on the faces.
    pub const FEET: Self = Self {
        feet: true,
        ..Self::SITES
    };

    /// Both models go on behind the seam, whose nodes follow a fit of this degree.
    pub const fn constrained(degree: FitDegree) -> Self {
        Self {
            constrained: Some(degree),
            ..Self::OVERLAP
        }
    }

    /// The places of both, where nodes of the seam are sites in both and families end at feet in none.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self {
            overlap: self.overlap || other.overlap,
            faces: self.faces || other.faces,
            ..self
        }
    }
}

/// Demands of a coupling on the model: role of each cell, treatment of the seam, and extent of the families.
pub trait ZoneLayout<const D: usize>: Send + Sync {
    /// Its usual name.
    fn name(&self) -> &'static str;

    /// Returns the symmetry of the stiffness.
    fn symmetry(&self) -> Symmetry;

    /// Returns the role of each cell, given the zones that the scene asks for.
    fn roles(&self, mesh: &Mesh<D>, zones: &[Zone], largest_horizon: f64) -> Vec<CellRole>;

    /// Returns the extent to which families have to be complete; [`Reach::of_bond_forces`] for rows that are the forces of bonds.
    fn reach(&self, law: &dyn LinearForceState<D>) -> Reach;

    /// Returns the depth, in families from the elements, within which every process needs the families of all points; elsewhere it may hold those of its own alone. None if that is not known.
    ///
    /// Rows of sites beside a seam take the families of several, and every process works out and proves all of a seam.
    fn families_of_all(&self, _law: &dyn LinearForceState<D>) -> Option<usize> {
        None
    }

    /// Returns true if processes may also hold families so in motion: which rows are those of the body alone, and where these end, does not depend on families that lie elsewhere.
    fn moves_with_own_families(&self) -> bool {
        false
    }

    /// Returns true if its rows hold the products of dilatations and deviatoric extensions of a law that is [`OrdinaryWithDeviators`](crate::peridynamics::ForceStateKind::OrdinaryWithDeviators); any other coupling is refused for such a law.
    fn takes_deviators(&self) -> bool {
        false
    }

    /// The places that its rows need at the seam.
    fn interface(&self) -> Interface;
}
