//! Splice: each site has the equation of its own model, which is continued across the seam.

use crate::{
    coupling::{Coupling, Operator, uncoupled::own_model},
    mesh::Mesh,
    model::{
        CellRole, Interface, Model, ModelError, Reach, Zone, ZoneLayout,
        held_families::depth_of_seam,
    },
    peridynamics::LinearForceState,
    system::Symmetry,
};

/// The splice of a local and a peridynamic region.
///
/// Source: [SAND2015-7998] eq. (2.30): the internal force density is `L = L^pd` in the nonlocal zone `B_pd`, `L = L^0` in the local zone `B_0`. A transition zone, if the scene has one, is local.
/// A peridynamic family that reaches into `B_0` is completed by points interpolated from finite elements, and an element that reaches into `B_pd` by nodes fitted to
/// peridynamic points. Affine fields therefore leave no ghost force; the stiffness is not symmetric.
#[derive(Clone, Copy, Debug, Default)]
pub struct Splice;

impl<const D: usize> ZoneLayout<D> for Splice {
    fn name(&self) -> &'static str {
        "splice"
    }

    fn interface(&self) -> Interface {
        Interface::OVERLAP
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Unsymmetric
    }

    fn roles(&self, _mesh: &Mesh<D>, zones: &[Zone], _largest_horizon: f64) -> Vec<CellRole> {
        zones
            .iter()
            .map(|zone| match zone {
                Zone::Nonlocal => CellRole::Points,
                Zone::Transition | Zone::Local => CellRole::Element,
            })
            .collect()
    }

    fn reach(&self, law: &dyn LinearForceState<D>) -> Reach {
        Reach::of_bond_forces(law)
    }

    fn takes_deviators(&self) -> bool {
        true
    }

    fn families_of_all(&self, law: &dyn LinearForceState<D>) -> Option<usize> {
        Some(depth_of_seam(law.is_pairwise()))
    }

    fn moves_with_own_families(&self) -> bool {
        true
    }
}

impl<const D: usize> Coupling<D> for Splice {
    fn operator<'a>(&self, model: &'a Model<D>) -> Result<Operator<'a, D>, ModelError> {
        Ok(own_model(model))
    }
}
