//! The rows of truncated families: gradients of an energy.

use crate::assembly::Row;
use crate::mesh::Mesh;
use crate::peridynamics::LinearForceState;
use crate::system::Symmetry;
use crate::{
    coupling::{CellStresses, Definiteness, ExactStresses, MixedRows, Operator, SeamBonds},
    model::{CellRole, Interface, Model, ModelError, Reach, Zone, ZoneLayout},
};

/// Families that leave the peridynamic zone end on the faces of the elements around it.
///
/// Source: none for the weights; `docs/truncated.md`. A transition zone, if the scene has one, is local. Laws whose points have a stress, on one lattice of one horizon.
#[derive(Clone, Copy, Debug, Default)]
pub struct TruncatedFamilies;

impl<const D: usize> ZoneLayout<D> for TruncatedFamilies {
    fn name(&self) -> &'static str {
        "truncated"
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Symmetric
    }

    fn roles(&self, _mesh: &Mesh<D>, zones: &[Zone], _largest_horizon: f64) -> Vec<CellRole> {
        let role = |zone: &Zone| match zone {
            Zone::Nonlocal => CellRole::Points,
            Zone::Transition | Zone::Local => CellRole::Element,
        };
        zones.iter().map(role).collect()
    }

    fn reach(&self, _law: &dyn LinearForceState<D>) -> Reach {
        Reach::Own
    }

    fn interface(&self) -> Interface {
        Interface::FEET
    }
}

coupling_by_rows!(TruncatedFamilies);

impl TruncatedFamilies {
    fn rows<'a, const D: usize>(
        &self,
        model: &'a Model<D>,
    ) -> Result<Box<dyn Operator<D> + 'a>, ModelError> {
        Ok(Box::new(FamilyRows {
            model,
            feet: model.feet_of_sites(),
        }))
    }
}

/// The rows: gradients of the energy.
struct FamilyRows<'a, const D: usize> {
    model: &'a Model<D>,
    /// The feet that follow each site, with their weights.
    feet: Vec<Vec<(u32, f64)>>,
}

impl<const D: usize> Operator<D> for FamilyRows<'_, D> {
    fn add_row(&self, site: usize, row: &mut Row<D>) {
        match self.model.point_of(site) {
            Some((body, point)) => body.add_force_row(point, |_| 1.0, row),
            None => {
                self.model.add_element_rows(site, row);
                if let Some(body) = self.model.body() {
                    for &(foot, weight) in &self.feet[site] {
                        body.add_force_row(foot as usize, |_| weight, row);
                    }
                }
            }
        }
    }

    fn counts_materials(&self) -> bool {
        false
    }

    fn is_body_row(&self, site: usize) -> bool {
        self.model.point_of(site).is_some()
    }

    fn mixed_rows(&self) -> Option<&dyn MixedRows<D>> {
        Some(self)
    }

    fn seam_bonds(&self) -> Option<SeamBonds<'_, D>> {
        None
    }

    fn exact_stresses(&self) -> Option<ExactStresses<D>> {
        None
    }

    fn beta(&self, site: usize) -> f64 {
        f64::from(u8::from(self.is_body_row(site)))
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

impl<const D: usize> MixedRows<D> for FamilyRows<'_, D> {
    fn has_body_bonds(&self, site: usize) -> bool {
        !self.feet[site].is_empty()
    }

    fn is_body_bond(&self, _i: usize, _j: usize) -> bool {
        true
    }

    fn add_row_beside_bonds(&self, site: usize, row: &mut Row<D>) {
        self.model.add_element_rows(site, row);
    }
}

impl<const D: usize> Model<D> {
    /// Returns true if a point of the cloud is a foot.
    pub(crate) fn is_foot(&self, point: u32) -> bool {
        self.points
            .feet
            .first()
            .is_some_and(|first| point >= *first)
    }

    /// The feet that follow each site, with their weights; empty lists without any.
    pub(super) fn feet_of_sites(&self) -> Vec<Vec<(u32, f64)>> {
        let mut of_sites = vec![Vec::new(); self.sites.len()];
        if let Some(body) = self.body() {
            for &foot in &self.points.feet {
                for (site, weight) in body.cloud.transfer.row(foot as usize) {
                    of_sites[site as usize].push((foot, weight));
                }
            }
        }
        of_sites
    }
}
