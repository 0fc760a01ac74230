//! The rows of truncated families: gradients of an energy.

use crate::mesh::Mesh;
use crate::peridynamics::LinearForceState;
use crate::system::Symmetry;
use crate::{
    coupling::{BodyBonds, BondsOfSite, Definiteness, Operator, Term, uncoupled::own_elements},
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
    fn rows<'a, const D: usize>(&self, model: &'a Model<D>) -> Result<Operator<'a, D>, ModelError> {
        let feet = model.feet_of_sites();
        let is_point = |site: usize| model.point_of(site).is_some();
        let has_feet: Vec<bool> = feet.iter().map(|feet| !feet.is_empty()).collect();
        let at = move |site: usize| match (is_point(site), has_feet[site]) {
            (true, _) => BondsOfSite::Alone,
            (false, true) => BondsOfSite::Among,
            (false, false) => BondsOfSite::None,
        };
        Ok(Operator {
            model,
            terms: vec![
                own_elements(model),
                Term::Bonds(BodyBonds {
                    at: Box::new(at),
                    holds: Box::new(|_, _| true),
                    feet,
                }),
            ],
            beta: Box::new(move |site| f64::from(u8::from(is_point(site)))),
            counts_materials: false,
            definiteness: Definiteness::SumOfSquares,
        })
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
