//! A model whose families are spread over processes: which a process searches, and what follows from those that others hold.

use crate::{
    model::{
        CellRole, Model, ModelError, SharedFamilies, Site, SiteKind, bins::Bins,
        held_families::HeldFamilies, point_cloud::PointCloud, shared_families::NONE,
    },
    peridynamics::{Accelerator, Families, PdBody, TIE_TOLERANCE, Wanted},
    system::{Ranks, Spread, first_text},
    tensor::Vector,
};

impl<const D: usize> Model<D> {
    /// The families of this process, and who has which; none where the points are no lattice. Sites that are nodes have been placed, and those that are points come behind them.
    ///
    /// `reach` is how far families do \[m\].
    pub(crate) fn search_shared(
        &self,
        ranks: &dyn Ranks,
        held: &HeldFamilies,
        cloud: &PointCloud<D>,
        reach: f64,
    ) -> Option<(Families, SharedFamilies)> {
        let mut sites = self.sites.clone();
        let mut site_of_point = vec![NONE; cloud.position.len()];
        let points = cloud.carrier.iter().enumerate();
        for (p, _) in points.filter(|(_, carrier)| carrier.is_own()) {
            site_of_point[p] = sites.len() as u32;
            sites.push(Site {
                position: cloud.position[p],
                kind: SiteKind::Point(p as u32),
                volume: cloud.volume[p],
            });
        }
        let count = ranks.count();
        let distribution = self.distribute_before_families(&sites, held, count, Some(ranks));
        let shared = SharedFamilies::new(distribution, ranks.rank(), site_of_point);
        let mut own = shared.own();
        let mut others = self.beside_elements(&cloud.position, held.depth);
        // those in elements complete families of the seam
        let in_element = cloud
            .carrier
            .iter()
            .enumerate()
            .filter(|(_, carrier)| !carrier.is_own());
        for (p, _) in in_element {
            (own[p], others[p]) = (false, true);
        }
        let both: Vec<bool>;
        let wanted = match held.with_neighbours {
            true => Wanted::WithNeighbours(&own, &others),
            false => {
                both = own.iter().zip(&others).map(|(a, b)| *a || *b).collect();
                Wanted::Of(&both)
            }
        };
        let (points, spacing) = (&cloud.position, cloud.spacing);
        let families = Families::search_lattice_of(points, spacing, reach, TIE_TOLERANCE, &wanted)?;
        Some((families, shared))
    }

    /// About what the row of each site costs before families are known: as [`Model::work_of_sites`] with families that lack nothing.
    pub(crate) fn work_before_families(&self, sites: &[Site<D>], held: &HeldFamilies) -> Vec<f64> {
        let of_site = |site: &Site<D>| match site.kind {
            SiteKind::Point(_) => 1 + held.full,
            SiteKind::Node(n) => {
                let cells = self.cells_of_node(n);
                1 + cells.map(|(c, _)| self.mesh.cell(c).len()).sum::<usize>()
            }
        };
        sites.iter().map(|site| of_site(site) as f64).collect()
    }

    /// Returns, for each position, true if it lies no farther than `depth` from the box around an element that shares a node with a cell of points.
    pub(crate) fn beside_elements(&self, positions: &[Vector<D>], depth: f64) -> Vec<bool> {
        let mut beside = vec![false; positions.len()];
        if depth <= 0.0 {
            return beside;
        }
        let mesh = &self.mesh;
        let mut has_points = vec![false; mesh.nodes.len()];
        for c in (0..mesh.cell_count()).filter(|&c| self.roles[c] == CellRole::Points) {
            let nodes = mesh.cell(c).iter();
            nodes.for_each(|&n| has_points[n as usize] = true);
        }
        let elements = (0..mesh.cell_count()).filter(|&c| self.is_element(c));
        let at_seam = elements.filter(|&c| mesh.cell(c).iter().any(|&n| has_points[n as usize]));
        let boxes = at_seam.map(|c| mesh.bounds_of(mesh.cell(c)));
        let (mut first, mut last) = [f64::MAX, f64::MIN].map(Vector::<D>::repeat).into();
        for x in positions {
            (first, last) = (first.inf(x), last.sup(x));
        }
        let bins = Bins::new(positions, depth);
        for (low, high) in boxes {
            let is_near = |p: usize| {
                let x = &positions[p];
                let outside = (low - x).sup(&(x - high)).sup(&Vector::zeros());
                outside.norm() <= depth
            };
            // an element may be far larger than all that has points
            let from = low.add_scalar(-depth).sup(&first);
            let to = high.add_scalar(depth).inf(&last);
            if (0..D).all(|a| from[a] <= to[a]) {
                for p in bins.in_box(from, to) {
                    beside[p] = beside[p] || is_near(p);
                }
            }
        }
        beside
    }

    /// The body; collective where its families are spread over processes: if a process could not make its own, the error of the first of them, on all.
    pub(crate) fn held_body(
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
        let mut body = body?;
        shared.count(ranks, site_of_point, &body.families);
        let sizes = shared.sizes().iter().enumerate();
        let is_elsewhere = |(p, n): (usize, &u32)| *n > 0 && body.families.of(p).is_empty();
        let elsewhere = sizes.map(is_elsewhere).collect();
        body.set_elsewhere(elsewhere);
        self.spread.shared = Some(shared);
        Ok(body)
    }

    /// Returns the distribution of the families, where they are spread over processes; else every process has all.
    pub fn shared_families(&self) -> Option<&SharedFamilies> {
        self.spread.shared.as_ref()
    }

    /// The sites over processes, where families are spread over these.
    pub fn spread<'a>(&'a self, ranks: Option<&'a dyn Ranks>) -> Option<Spread<'a>> {
        let shared = self.spread.shared.as_ref()?;
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
        let (Some(shared), Some(ranks)) = (&self.spread.shared, ranks) else {
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

    /// Number of bonds in the family of a point, whichever process holds it.
    pub fn family_size(&self, point: usize) -> usize {
        match (&self.spread.shared, self.body()) {
            (Some(shared), _) => shared.sizes()[point] as usize,
            (None, Some(body)) => body.families.of(point).len(),
            (None, None) => 0,
        }
    }

    /// Returns true if families can be spread over processes: they are searched along a lattice, and the coupling says which of them every process needs.
    pub fn can_spread_families(&self) -> bool {
        self.spread.held.is_some()
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
        let (Some(body), Some(held)) = (self.body(), &self.spread.held) else {
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

    /// Number of directed bonds of all points, whichever process holds them.
    pub fn bond_count(&self) -> usize {
        match &self.spread.shared {
            Some(shared) => shared.bond_count(),
            None => self.body().map_or(0, PdBody::bond_count),
        }
    }
}
