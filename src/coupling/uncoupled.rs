//! One model everywhere: pure finite elements and pure peridynamics, as couplings that have nothing to couple.

use crate::{
    assembly::Row,
    coupling::{
        CellStresses, Coupling, Definiteness, ExactStresses, MixedRows, Operator, SeamBonds,
    },
    dimension,
    mesh::Mesh,
    model::{CellRole, Interface, Model, ModelError, Reach, Zone, ZoneLayout},
    peridynamics::LinearForceState,
    system::Symmetry,
};

/// Finite elements everywhere.
#[derive(Clone, Copy, Debug, Default)]
pub struct Local;

/// Peridynamics everywhere.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nonlocal;

impl<const D: usize> ZoneLayout<D> for Local {
    fn name(&self) -> &'static str {
        "local"
    }

    fn interface(&self) -> Interface {
        Interface::OVERLAP
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Symmetric
    }

    fn roles(&self, mesh: &Mesh<D>, _zones: &[Zone], _largest_horizon: f64) -> Vec<CellRole> {
        vec![CellRole::Element; mesh.cell_count()]
    }

    fn reach(&self, law: &dyn LinearForceState<D>) -> Reach {
        Reach::of_bond_forces(law)
    }

    fn takes_deviators(&self) -> bool {
        true
    }
}

impl<const D: usize> Coupling<D> for Local {
    fn operator<'a>(&self, model: &'a Model<D>) -> Result<Box<dyn Operator<D> + 'a>, ModelError> {
        Ok(own_model(model))
    }
}

impl<const D: usize> ZoneLayout<D> for Nonlocal {
    fn name(&self) -> &'static str {
        "nonlocal"
    }

    fn interface(&self) -> Interface {
        Interface::OVERLAP
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Symmetric
    }

    fn roles(&self, mesh: &Mesh<D>, _zones: &[Zone], _largest_horizon: f64) -> Vec<CellRole> {
        vec![CellRole::Points; mesh.cell_count()]
    }

    fn reach(&self, law: &dyn LinearForceState<D>) -> Reach {
        Reach::of_bond_forces(law)
    }

    fn takes_deviators(&self) -> bool {
        true
    }

    fn families_of_all(&self, _law: &dyn LinearForceState<D>) -> Option<usize> {
        Some(0)
    }

    fn moves_with_own_families(&self) -> bool {
        true
    }
}

impl<const D: usize> Coupling<D> for Nonlocal {
    fn operator<'a>(&self, model: &'a Model<D>) -> Result<Box<dyn Operator<D> + 'a>, ModelError> {
        Ok(own_model(model))
    }
}

type Own<const D: usize> = for<'a> fn(&'a Model<D>) -> Box<dyn Operator<D> + 'a>;

/// The rows of a model of which each site takes the equation of its own model, [SAND2015-7998] eq. (2.30).
pub(crate) fn own_model<'a, const D: usize>(model: &'a Model<D>) -> Box<dyn Operator<D> + 'a> {
    fn rows<'a, const D: usize>(model: &'a Model<D>) -> Box<dyn Operator<D> + 'a> {
        Box::new(OwnModel { model })
    }
    static OWN: (Own<1>, Own<2>, Own<3>) = (rows, rows, rows);
    dimension::of::<Own<D>>(&OWN)(model)
}

/// Each site takes the equation of its own model: `L^pd` of [SAND2015-7998] eq. (2.5) at points, `L⁰` of (2.11) at nodes.
struct OwnModel<'a, const D: usize> {
    model: &'a Model<D>,
}

impl<const D: usize> Operator<D> for OwnModel<'_, D> {
    fn add_row(&self, site: usize, row: &mut Row<D>) {
        match self.model.point_of(site) {
            Some((body, point)) => body.add_force_row(point, |_| 1.0, row),
            None => self.model.add_element_rows(site, row),
        }
    }

    fn is_body_row(&self, site: usize) -> bool {
        self.model.point_of(site).is_some()
    }

    fn counts_materials(&self) -> bool {
        true
    }

    fn mixed_rows(&self) -> Option<&dyn MixedRows<D>> {
        None
    }

    fn seam_bonds(&self) -> Option<SeamBonds<'_, D>> {
        None
    }

    fn exact_stresses(&self) -> Option<ExactStresses<D>> {
        None
    }

    fn beta(&self, site: usize) -> f64 {
        f64::from(u8::from(self.model.point_of(site).is_some()))
    }

    fn definiteness(&self) -> Definiteness {
        Definiteness::SumOfSquares
    }

    fn additional_bonds(&self) -> usize {
        0
    }

    fn cell_stresses(&self) -> Option<&dyn CellStresses<D>> {
        None
    }
}
