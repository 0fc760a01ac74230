//! A model whose families are spread over processes.

use crate::{
    coupling::{Model, ModelError, SharedFamilies},
    peridynamics::{Accelerator, PdBody},
    system::{Ranks, Spread, first_text},
};

impl<const D: usize> Model<D> {
    /// The body; collective where its families are spread over processes: if a process could not make its own, the error of the first of them, on all.
    pub(super) fn held_body(
        &mut self,
        shared: Option<(SharedFamilies, &dyn Ranks)>,
        body: Result<PdBody<D>, ModelError>,
    ) -> Result<PdBody<D>, ModelError> {
        let Some((mut shared, ranks)) = shared else {
            return body;
        };
        let own = body.as_ref().err().map(ToString::to_string);
        if let Some(message) = first_text(ranks, own.as_deref()) {
            return Err(ModelError::OfProcess { message });
        }
        let body = body?;
        shared.count(ranks, &body.families);
        self.shared = Some(shared);
        Ok(body)
    }

    /// Who has which families, where they are spread over processes; else every process has all.
    pub fn shared_families(&self) -> Option<&SharedFamilies> {
        self.shared.as_ref()
    }

    /// The sites over processes, where families are spread over these.
    pub fn spread<'a>(&'a self, ranks: Option<&'a dyn Ranks>) -> Option<Spread<'a>> {
        let shared = self.shared.as_ref()?;
        Some(shared.spread(ranks?))
    }

    /// `width` numbers of each of some points, or of the sites that are points, which take their families; collective where these are spread over processes, with the same `points` on all.
    pub fn of_families(
        &self,
        ranks: Option<&dyn Ranks>,
        points: &[u32],
        width: usize,
        of: impl Fn(&[u32]) -> Vec<f64>,
    ) -> Vec<f64> {
        match self.spread(ranks) {
            // every point is a site, of the same number
            Some(spread) => spread.of_sites(points, width, of),
            None => of(points),
        }
    }

    /// Bonds of the family of a point, whoever holds it.
    pub fn family_size(&self, point: usize) -> usize {
        match (&self.shared, self.body()) {
            (Some(shared), _) => shared.sizes()[point] as usize,
            (None, Some(body)) => body.families.of(point).len(),
            (None, None) => 0,
        }
    }

    /// Whether families are searched along a lattice, and can be spread over processes.
    pub fn can_spread_families(&self) -> bool {
        self.is_searched_by_lattice
    }

    /// Own points and all whose displacements the forces of these take, and whether bonds of these break: neighbours, and those of neighbours where a law takes their dilatations.
    ///
    /// Bonds without a weight count, for they break too.
    pub fn points_reached(&self, own: &[bool]) -> Vec<bool> {
        let layers = match self.peridynamics.as_ref().and_then(|p| p.accelerator()) {
            Some(Accelerator::Solid { .. }) => 2,
            _ => 1,
        };
        self.within_families(own, layers)
    }

    /// Own points and all whose families their process holds where families are spread over processes: neighbours as well, if a law asks for these.
    pub fn points_held(&self, own: &[bool]) -> Vec<bool> {
        let law = self.peridynamics.as_ref().map(|p| p.law.linearised());
        let is_pairwise = law.is_none_or(|law| law.is_pairwise());
        self.within_families(own, usize::from(!is_pairwise))
    }

    /// Points, and those in their families, so many times.
    fn within_families(&self, of: &[bool], times: usize) -> Vec<bool> {
        let mut reached = of.to_vec();
        let Some(body) = self.body() else {
            return reached;
        };
        for _ in 0..times {
            let inner = reached.clone();
            let points = inner.iter().enumerate().filter(|(_, is_inner)| **is_inner);
            for &j in points.flat_map(|(i, _)| body.families.of(i)) {
                reached[j as usize] = true;
            }
        }
        reached
    }

    /// Directed bonds of all points, whoever holds them.
    pub fn bond_count(&self) -> usize {
        match &self.shared {
            Some(shared) => shared.bond_count(),
            None => self.body().map_or(0, PdBody::bond_count),
        }
    }
}
