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

/// Which nodes of finite elements at the seam are sites, and which follow the sites around them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// Nodes of the seam are sites; the elements overlap into the peridynamic zone by one cell, whose far nodes follow the PD points around them.
    Overlap,
    /// Nodes of the seam follow a least-squares fit to the sites within a horizon, [SAND2015-7998] section 7.3.
    Constrained(FitDegree),
    /// Nodes of the seam are sites with the rows of their own elements only: nothing overlaps, and bonds end on the faces of elements.
    Faces,
    /// As [`Interface::Faces`], where families end at places on the faces.
    Feet,
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

    /// Returns true if its rows hold the products of dilatations and deviatoric extensions of a law with [`LinearForceState::has_deviators`]; any other coupling is refused for such a law.
    fn takes_deviators(&self) -> bool {
        false
    }

    /// The treatment of nodes at the seam.
    fn interface(&self) -> Interface;
}
