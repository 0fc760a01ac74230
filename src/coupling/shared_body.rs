//! A model whose families are spread over processes.

use crate::{
    coupling::{Model, ModelError, SharedFamilies, SiteKind},
    peridynamics::{Accelerator, PdBody},
    system::{Ranks, Spread, first_text},
};

impl<const D: usize> Model<D> {
    /// The body; collective where its families are spread over processes: if a process could not make its own, the error of the first of them, on all.
    pub(super) fn held_body(
        &mut self,
        shared: Option<(SharedFamilies, &dyn Ranks)>,
        site_of_point: &[u32],
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
        shared.count(ranks, site_of_point, &body.families);
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

    /// `width` numbers of each of some points, which take their families; collective where these are spread over processes, with the same `points` on all.
    pub fn of_families(
        &self,
        ranks: Option<&dyn Ranks>,
        points: &[u32],
        width: usize,
        of: impl Fn(&[u32]) -> Vec<f64>,
    ) -> Vec<f64> {
        let (Some(shared), Some(ranks)) = (&self.shared, ranks) else {
            return of(points);
        };
        // every process has those of points in elements
        let (sites, others): (Vec<u32>, Vec<u32>) = points
            .iter()
            .partition(|&&p| shared.site_of_point(p).is_some());
        let sites: Vec<u32> = sites
            .iter()
            .filter_map(|&p| shared.site_of_point(p))
            .collect();
        let point = |site: &u32| Some(self.point_of(*site as usize)?.1 as u32);
        let of_sites = shared.spread(ranks).of_sites(&sites, width, |own| {
            of(&own.iter().filter_map(point).collect::<Vec<u32>>())
        });
        let of_others = of(&others);
        let [mut of_sites, mut of_others] = [of_sites.iter(), of_others.iter()];
        let mut all = Vec::with_capacity(points.len() * width);
        for &p in points {
            match shared.site_of_point(p) {
                Some(_) => all.extend(of_sites.by_ref().take(width)),
                None => all.extend(of_others.by_ref().take(width)),
            }
        }
        all
    }

    /// Bonds of the family of a point, whoever holds it.
    pub fn family_size(&self, point: usize) -> usize {
        match (&self.shared, self.body()) {
            (Some(shared), _) => shared.sizes()[point] as usize,
            (None, Some(body)) => body.families.of(point).len(),
            (None, None) => 0,
        }
    }

    /// Whether families can be spread over processes: they are searched along a lattice, and the coupling says which of them every process needs.
    pub fn can_spread_families(&self) -> bool {
        self.held.is_some()
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

    /// All points whose families a process with these `own` sites holds where families are spread over processes.
    pub fn points_held(&self, own: &[bool]) -> Vec<bool> {
        let (Some(body), Some(held)) = (self.body(), &self.held) else {
            return Vec::new();
        };
        let mut of_own = vec![false; body.cloud.position.len()];
        let mut in_element = vec![true; of_own.len()];
        for (site, own) in self.sites.iter().zip(own) {
            if let SiteKind::Point(p) = site.kind {
                (of_own[p as usize], in_element[p as usize]) = (*own, false);
            }
        }
        let reached = self.within_families(&of_own, usize::from(held.with_neighbours));
        let beside = self.beside_elements(&body.cloud.position, held.depth);
        let each = reached.iter().zip(&beside).zip(&in_element);
        each.map(|((a, b), c)| *a || *b || *c).collect()
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
