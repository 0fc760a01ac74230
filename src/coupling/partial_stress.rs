//! Meshfree partial stress: transition points that feel the divergence of the peridynamic partial stress.

use crate::{
    assembly::Row,
    coupling::{
        CellRole, Coupling, ExactStresses, MixedRows, Model, ModelError, Operator, Reach, Rows,
        SeamBonds, Zone, held_families::depth_of_seam,
    },
    dimension,
    mesh::Mesh,
    peridynamics::{Influence, LinearForceState, PdBody},
    tensor::{Tensor, Vector},
};

/// Partial stress with a meshfree divergence.
///
/// Source: [SAND2015-7998] eq. (2.29), with the divergence (2.20) of the partial stress (2.19) as in section 7.2: in the transition zone
/// `L(x) = Tr(∇ν^ps) = Σ ω {ν(x′) − ν(x)} K⁻¹ ξ V`, with `K = Σ ω ξ⊗ξ V`; peridynamic in the nonlocal zone, finite elements in the local zone.
/// The horizon may vary in the transition zone.
#[derive(Clone, Copy, Debug)]
pub struct PartialStressMeshfree {
    /// ω of the divergence.
    pub influence: Influence,
}

impl<const D: usize> Coupling<D> for PartialStressMeshfree {
    fn name(&self) -> &'static str {
        "partial stress (meshfree)"
    }

    fn roles(&self, _mesh: &Mesh<D>, zones: &[Zone], _largest_horizon: f64) -> Vec<CellRole> {
        zones
            .iter()
            .map(|zone| match zone {
                Zone::Local => CellRole::Element,
                Zone::Transition | Zone::Nonlocal => CellRole::Points,
            })
            .collect()
    }

    fn reach(&self, _law: &dyn LinearForceState<D>) -> Reach {
        Reach::Neighbours
    }

    fn takes_deviators(&self) -> bool {
        true
    }

    fn families_of_all(&self, law: &dyn LinearForceState<D>) -> Option<usize> {
        Some(depth_of_seam(law.is_pairwise()))
    }

    fn operator<'a>(&self, model: &'a Model<D>) -> Result<Box<dyn Operator<D> + 'a>, ModelError> {
        static ROWS: (
            Rows<PartialStressMeshfree, 1>,
            Rows<PartialStressMeshfree, 2>,
            Rows<PartialStressMeshfree, 3>,
        ) = (
            PartialStressMeshfree::rows,
            PartialStressMeshfree::rows,
            PartialStressMeshfree::rows,
        );
        dimension::of::<Rows<Self, D>>(&ROWS)(self, model)
    }
}

impl PartialStressMeshfree {
    fn rows<'a, const D: usize>(
        &self,
        model: &'a Model<D>,
    ) -> Result<Box<dyn Operator<D> + 'a>, ModelError> {
        Ok(Box::new(Meshfree {
            model,
            influence: self.influence,
        }))
    }
}

struct Meshfree<'a, const D: usize> {
    model: &'a Model<D>,
    influence: Influence,
}

impl<const D: usize> Operator<D> for Meshfree<'_, D> {
    fn add_row(&self, site: usize, row: &mut Row<D>) {
        let Some((body, i)) = self.model.point_of(site) else {
            self.model.add_element_rows(site, row);
            return;
        };
        if self.model.zone_of_point(i) == Zone::Nonlocal {
            body.add_force_row(i, |_| 1.0, row);
        } else {
            body.add_partial_stresses(self.divergence(body, i), row);
        }
    }

    fn is_body_row(&self, site: usize) -> bool {
        self.model
            .point_of(site)
            .is_some_and(|(_, i)| self.model.zone_of_point(i) == Zone::Nonlocal)
    }

    fn beta(&self, site: usize) -> f64 {
        match self.model.point_of(site) {
            Some((_, i)) if self.model.zone_of_point(i) == Zone::Nonlocal => 1.0,
            Some(_) => 0.5,
            None => 0.0,
        }
    }

    fn mixed_rows(&self) -> Option<&dyn MixedRows<D>> {
        None
    }

    fn seam_bonds(&self) -> Option<SeamBonds<'_, D>> {
        None
    }

    fn exact_stresses(&self) -> Option<ExactStresses<D>> {
        let of_site = |site: usize| match self.model.point_of(site) {
            Some((body, i)) if self.model.zone_of_point(i) != Zone::Nonlocal => {
                self.divergence(body, i)
            }
            _ => Vec::new(),
        };
        ExactStresses::new(self.model, None, of_site, |_| Vec::new())
    }
}

impl<const D: usize> Meshfree<'_, D> {
    /// The points whose stresses the divergence at a transition point takes, with their weights: `∇·ν^ps` of [SAND2015-7998] eq. (2.20), as section 7.2 discretises it.
    fn divergence(&self, body: &PdBody<D>, i: usize) -> Vec<(usize, Vector<D>)> {
        let horizon = body.cloud.horizon.of(i);
        let weigh = |j: usize, xi: &Vector<D>| {
            self.influence.value(xi.norm(), horizon) * body.cloud.volume[j]
        };
        let mut shape = Tensor::<D>::zeros();
        for &j in body.families.of(i) {
            let xi = body.bond(i, j as usize);
            shape += xi * xi.transpose() * weigh(j as usize, &xi);
        }
        // a family whose law could be evaluated has a regular shape tensor (checked in `operator`'s model)
        let Some(inverse) = shape.try_inverse() else {
            return Vec::new();
        };
        let mut own = Vector::zeros();
        let mut on: Vec<(usize, Vector<D>)> = Vec::new();
        for &j in body.families.of(i) {
            let j = j as usize;
            let xi = body.bond(i, j);
            // K u = f is minus the internal force
            let a = inverse * xi * (-weigh(j, &xi) * body.cloud.volume[i]);
            own -= a;
            on.push((j, a));
        }
        if own.amax() > 1e-15 * body.cloud.volume[i] / horizon {
            on.push((i, own));
        }
        on
    }
}
