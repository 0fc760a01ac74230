//! Weights of the families of quadrature points, fitted to the moments of the lattice.

use crate::model::Model;
use crate::{
    parallel,
    peridynamics::{
        Bound, Cloud, Families, Family, LinearForceState, MomentConditions, PdError, StressFit,
        alike::FamilyShape, moment_fitted_weights,
    },
    tensor::Vector,
};

/// The families of some points.
pub(super) fn shapes<const D: usize>(
    cloud: &Cloud<D>,
    families: &Families,
    points: &[usize],
    horizon: impl Fn(usize) -> f64 + Sync,
) -> Vec<FamilyShape<D>> {
    parallel::map_slice(points, |&i| FamilyShape {
        bonds: families
            .of(i)
            .iter()
            .map(|&j| {
                let j = j as usize;
                (cloud.position[j] - cloud.position[i], cloud.volume[j])
            })
            .collect(),
        horizon: horizon(i),
    })
}

/// Bonds of a whole family with their volumes, and the moments that they have.
pub(super) type LatticeMoments<const D: usize> = (Vec<(Vector<D>, f64)>, Vec<f64>);

/// Fit of the weights of a Gauss point's family, so that its partial stress is that of the elements around under affine fields.
pub(super) struct FamilyFit<'a, const D: usize> {
    pub law: &'a dyn LinearForceState<D>,
    /// Bonds and coefficients of the lattice whose tensor the elements have, where that is not the typed one.
    pub lattice: Option<LatticeMoments<D>>,
    /// True if places in elements lie between the nodes, so that fifth moments should vanish too. If every place is a node, the errors of the points of one element under quadratic fields cancel around each node.
    pub between_nodes: bool,
}

impl<'a, const D: usize> FamilyFit<'a, D> {
    pub fn new(model: &Model<D>, law: &'a dyn LinearForceState<D>) -> Self {
        let lattice = model.plain_lattice().map(|whole| {
            // Σ λ ξ⊗ξ⊗ξ⊗ξ V of a pairwise law, whose p is λ/2; Σ ω ξ⊗ξ⊗ξ⊗ξ/|ξ|² V of another
            let of = |(p, omega): (f64, f64)| if law.is_pairwise() { 2.0 * p } else { omega };
            (whole.vectors(), whole.bonds().map(|(_, c)| of(c)).collect())
        });
        Self {
            law,
            lattice,
            between_nodes: model.has_places_between_nodes(),
        }
    }

    /// Returns the conditions that the coefficients of a family should meet; none where the law is exact on every family.
    pub fn conditions(
        &self,
        bonds: &[(Vector<D>, f64)],
        horizon: f64,
    ) -> Option<(Vec<f64>, MomentConditions<D>)> {
        let (base, conditions) = self.law.moment_conditions(bonds, horizon)?;
        let conditions = match &self.lattice {
            Some((vectors, g)) => conditions.with_values_of(vectors, g),
            None => conditions,
        };
        Some((base, conditions))
    }

    /// The law with influence functions that are fitted to each family, where factors alone do not make its partial stress exact.
    pub fn fitted_law(&self) -> Option<Box<dyn LinearForceState<D> + '_>> {
        self.law.fitted_to(match self.between_nodes {
            true => StressFit::Quadratic,
            false => StressFit::Affine,
        })
    }

    /// Returns true if non-negative weights can meet the conditions for affine fields.
    pub fn is_met_by_positive(&self, bonds: &[(Vector<D>, f64)], horizon: f64) -> bool {
        if let Some(law) = self.law.fitted_to(StressFit::Positive) {
            let (vectors, volumes): (Vec<_>, Vec<_>) = bonds.iter().copied().unzip();
            let family = Family {
                bonds: &vectors,
                volumes: &volumes,
                factors: &vec![1.0; bonds.len()],
                horizon,
                bond_horizons: &[],
                materials: None,
            };
            let (mut pair, mut omega) = (vec![0.0; bonds.len()], vec![0.0; bonds.len()]);
            return law.coefficients(&family, &mut pair, &mut omega).is_ok();
        }
        self.conditions(bonds, horizon).is_none_or(|(base, c)| {
            moment_fitted_weights::fit(bonds, &base, &c, Bound::AtLeast(0.0)).is_ok()
        })
    }

    /// Weights that are exact for quadratic fields and not negative, where they are asked for and there are bonds enough to expect some.
    ///
    /// In space a search for the smallest change that is not negative would take most of the time of a run (36 conditions per Gauss point: the coupled bar of section 7.3 took 2.5 times as long), so only the smallest change of any sign counts there.
    pub fn quadratic(
        &self,
        bonds: &[(Vector<D>, f64)],
        base: &[f64],
        affine: &MomentConditions<D>,
    ) -> Option<moment_fitted_weights::Fit> {
        let conditions = affine.clone().with_vanishing_moments(5);
        if !self.between_nodes || bonds.len() < 2 * conditions.rows.len() {
            return None;
        }
        let smallest = moment_fitted_weights::fit(bonds, base, &conditions, Bound::Free).ok()?;
        if smallest.smallest_factor >= 0.0 {
            return Some(smallest);
        }
        let bounded =
            || moment_fitted_weights::fit(bonds, base, &conditions, Bound::AtLeast(0.0)).ok();
        if D < 3 { bounded() } else { None }
    }

    /// The factors of the bonds: exact for quadratic fields if factors that are not negative can be, else for affine ones.
    pub fn factors(&self, bonds: &[(Vector<D>, f64)], horizon: f64) -> Result<Vec<f64>, PdError> {
        let Some((base, conditions)) = self.conditions(bonds, horizon) else {
            return Ok(vec![1.0; bonds.len()]);
        };
        let positive = |c: &MomentConditions<D>| {
            moment_fitted_weights::fit(bonds, &base, c, Bound::AtLeast(0.0))
        };
        let fit = match self.quadratic(bonds, &base, &conditions) {
            Some(fit) => Ok(fit),
            None => positive(&conditions),
        }
        .or_else(|_| moment_fitted_weights::fit(bonds, &base, &conditions, Bound::Free))?;
        let factor = |(g, b): (&f64, &f64)| if *b > 0.0 { g / b } else { 1.0 };
        Ok(fit.values.iter().zip(&base).map(factor).collect())
    }
}
