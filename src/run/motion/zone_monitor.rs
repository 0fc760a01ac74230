//! Monitor of a zone that follows the crack: the cells that are wanted in it, and the steps at which they are looked for.

use super::bounding_boxes::CellBoxes;
use crate::fem;
use crate::scene::adaptive_zone::Follow;
use crate::system::SemiDiscrete;
use crate::tensor::{Tensor, Vector};
use crate::{
    model::{Model, SiteKind, Zone},
    parallel,
};

/// Part of the padding beyond the reach that the fastest crack may cross between two looks; the rest is how far it runs before the zone has to change.
const CROSSED: f64 = 0.3;

/// The zone also changes where it is this many times larger than what was wanted of late, and one that grows keeps all its cells until then.
const TOO_LARGE: f64 = 2.0;

/// Steps for which a cell stays wanted. A change takes as long as some two hundred steps: what a wave marks, leaves and marks again within them is cheaper kept than given up.
const REMEMBERED: u64 = 200;

/// One look in this many is at the whole zone. The others are at its rim, where something stretched asks for cells that are not there yet.
const WHOLE: u64 = 8;

/// A stretched cell is at the front of the damage within this many reaches of it if the middle of that is [`AIMED`] of this distance away: half of it at the tip of a straight crack, nothing within its path.
const SEEN: f64 = 1.5;
const AIMED: f64 = 0.35;

/// Bonds of these lengths, in horizons, are looked at: some of each direction, mirror images together, so that the zone of a symmetric motion stays symmetric.
const LOOKED_AT: [f64; 2] = [0.5, 0.75];

/// Looks at a moving model for cells that must be nonlocal.
pub(crate) struct ZoneMonitor<'a, const D: usize> {
    follow: &'a Follow,
    model: &'a Model<D>,
    /// Stretch beyond which a cell is wanted, and beyond which a bond is broken.
    limits: [f64; 2],
    /// Steps between looks.
    every: u64,
    /// Travel of a crack in a step \[m\].
    travel: f64,
    /// Time for which a cell stays wanted \[s\].
    remembered: f64,
    /// Bonds to look at, by their points, with their lengths squared \[m²\]; first those of the rim.
    bonds: Vec<([u32; 2], f64)>,
    /// Number of bonds of the rim: with an end in a cell within the reach, and the travel of a crack between two looks, of cells that may become nonlocal.
    of_rim: usize,
    /// The cells at whose boxes each site lies that is a point, several for one on a face, and where those of each begin.
    cells_at: Vec<u32>,
    starts: Vec<usize>,
    /// Cells that stay nonlocal for what cuts their bonds at rest, and those that it passes.
    cut: Vec<bool>,
    notched: Vec<bool>,
    boxes: CellBoxes<D>,
    /// Elements with the sites and weights of the gradient at their centres.
    elements: Vec<u32>,
    gradients: Vec<(u32, Vector<D>)>,
    /// Offsets of those of each element.
    offsets: Vec<usize>,
    /// The site of each point; `u32::MAX` for one that follows sites.
    site_of_point: Vec<u32>,
}

impl<'a, const D: usize> ZoneMonitor<'a, D> {
    /// Over the model as it is laid out; `critical` is the critical stretch, `speed` that of the fastest crack, `step` the time step.
    pub fn new(
        follow: &'a Follow,
        model: &'a Model<D>,
        critical: f64,
        speed: f64,
        step: f64,
    ) -> Self {
        let mesh = &model.mesh;
        let cells = mesh.cell_count();
        let free = CROSSED * (follow.padding - follow.reach);
        let every = (free / (speed * step)).floor().clamp(1.0, 1e9) as u64;
        let barriers = model.peridynamics.as_ref().map_or(&[][..], |p| &p.barriers);
        let voids = model.peridynamics.as_ref().map_or(&[][..], |p| &p.voids);
        let boxes = CellBoxes::new(mesh);
        let (cut, notched) = parallel::map(cells, 1, |c| {
            let (x, (low, high)) = (mesh.centroid(c), boxes.of(c));
            let own = 0.5 * (high - low).amax();
            let shapes = barriers.iter().map(|b| b.shape()).chain(voids);
            let distance = shapes
                .map(|s| s.signed_distance(&x))
                .fold(f64::INFINITY, f64::min);
            let is_cut = distance < follow.reach + own * (1.0 - 1e-9);
            (!follow.barred[c] && is_cut, distance < own * (1.0 + 1e-9))
        })
        .into_iter()
        .unzip();
        let mut watch = Self {
            follow,
            model,
            limits: [follow.stretch * critical, critical],
            every,
            travel: speed * step,
            remembered: step * REMEMBERED as f64,
            bonds: Vec::new(),
            of_rim: 0,
            cells_at: Vec::new(),
            starts: vec![0],
            cut,
            notched,
            boxes,
            elements: Vec::new(),
            gradients: Vec::new(),
            offsets: vec![0],
            site_of_point: Vec::new(),
        };
        watch.find_bonds();
        watch.find_gradients();
        watch
    }

    fn find_gradients(&mut self) {
        let model = self.model;
        for c in (0..self.boxes.len()).filter(|&c| !self.follow.barred[c] && model.is_element(c)) {
            for &n in model.mesh.cell(c) {
                // the gradient of a field that is one along the first axis at this node, and zero at the others
                let one = |m: usize| {
                    let here = m == n as usize;
                    Vector::from_fn(|k, _| f64::from(u8::from(k == 0 && here)))
                };
                let g = fem::displacement_gradient_at_centre(&model.mesh, c, one);
                let shape: Vector<D> = g.row(0).transpose();
                let row = model.node_transfer.row(n as usize);
                self.gradients
                    .extend(row.map(|(site, w)| (site, shape * w)));
            }
            self.elements.push(c as u32);
            self.offsets.push(self.gradients.len());
        }
    }

    fn find_bonds(&mut self) {
        let Some(body) = self.model.body() else {
            return;
        };
        let sites = &self.model.sites;
        self.site_of_point = vec![u32::MAX; body.cloud.position.len()];
        // a point on a face belongs to the cells on both sides, or mirror images would differ
        let touching = 1e-9 * self.follow.reach;
        for (site, s) in sites.iter().enumerate() {
            if let SiteKind::Point(p) = s.kind {
                self.site_of_point[p as usize] = site as u32;
                let cells_at = &mut self.cells_at;
                let push = |c: usize| cells_at.push(c as u32);
                (self.boxes).near(&s.position, &s.position, touching, push);
            }
            self.starts.push(self.cells_at.len());
        }
        let is_known = |p: u32| self.site_of_point[p as usize] != u32::MAX;
        let [shortest, longest] = LOOKED_AT;
        for i in (0..self.site_of_point.len() as u32).filter(|&i| is_known(i)) {
            let horizon = body.cloud.horizon.of(i as usize) * (1.0 + 1e-6);
            let of = body.families.of(i as usize).iter().copied();
            let lengths = (shortest * horizon * (1.0 - 2e-6)).powi(2)..(longest * horizon).powi(2);
            self.bonds
                .extend(of.filter(|&j| j > i && is_known(j)).filter_map(|j| {
                    let r2 = body.bond(i as usize, j as usize).norm_squared();
                    lengths.contains(&r2).then_some(([i, j], r2))
                }));
        }
        let free: Vec<bool> = (0..self.boxes.len())
            .map(|c| self.model.zones[c] != Zone::Nonlocal && !self.follow.barred[c])
            .collect();
        let mut rim = vec![false; self.boxes.len()];
        self.grow(&free, self.follow.reach + self.way(u64::MAX), &mut rim);
        let bonds = std::mem::take(&mut self.bonds);
        let is_of_rim = |p: u32| {
            let cells = self.cells_of(self.site_of_point[p as usize]);
            cells.iter().any(|&c| rim[c as usize])
        };
        let (first, rest): (Vec<_>, Vec<_>) =
            (bonds.into_iter()).partition(|(points, _)| points.iter().any(|&p| is_of_rim(p)));
        self.of_rim = first.len();
        self.bonds = first;
        self.bonds.extend(rest);
    }

    /// Returns the travel of a crack until the next look, or until the run ends in so many steps \[m\].
    fn way(&self, left: u64) -> f64 {
        self.travel * self.every.min(left) as f64
    }

    /// Tests if a step ends with a look, and with one at the whole zone.
    pub fn looks_after(&self, step: u64) -> [bool; 2] {
        [self.every, self.every.saturating_mul(WHOLE)].map(|n| step.is_multiple_of(n))
    }

    /// The cells that shall be nonlocal for the steps that are `left`, if the present ones will not do; `wanted` holds when each was wanted last.
    ///
    /// Shapes: displacements `u` by site and axis \[m\]; `wanted` and the result by cell, the first \[s\], as `time`.
    ///
    /// A look that is not at the whole zone finds what must be added at once. Damage comes to the rim with stretched bonds, or is noticed by the caller at the edge.
    pub fn look(
        &self,
        u: &[f64],
        (time, left): (f64, u64),
        system: &dyn SemiDiscrete,
        whole: bool,
        wanted: &mut [f64],
    ) -> Option<Vec<bool>> {
        let cells = self.boxes.len();
        let mut hot = vec![false; cells];
        self.mark_elements(u, &mut hot);
        self.mark_bonds(u, &self.bonds[..self.of_rim], &mut hot);
        if !whole && !hot.contains(&true) {
            return None;
        }
        let mut damaged = vec![false; cells];
        let state = system.body_state();
        for site in state.map_or(Vec::new(), |state| state.damaged_sites()) {
            self.mark_point(site, &mut damaged);
        }
        let reach = self.follow.reach;
        let mut kept = self.cut.clone();
        self.grow(&damaged, reach, &mut kept);
        let mut needed = kept.clone();
        self.grow(
            &self.front(&hot, &damaged),
            reach + self.way(left),
            &mut needed,
        );
        let now: Vec<bool> = (0..cells)
            .map(|c| self.model.zones[c] == Zone::Nonlocal)
            .collect();
        let short = needed.iter().zip(&now).any(|(n, now)| *n && !now);
        if !whole && !short {
            return None;
        }
        self.mark_bonds(u, &self.bonds[self.of_rim..], &mut hot);
        let hot = self.front(&hot, &damaged);
        let mut next = kept;
        self.grow(&hot, self.follow.padding, &mut next);
        for (last, next) in wanted.iter_mut().zip(&mut next) {
            if *next {
                *last = time;
            }
            *next = time - *last <= self.remembered;
        }
        let count = |set: &[bool]| set.iter().filter(|c| **c).count() as f64;
        let is_large = |next: &[bool]| count(&now) > TOO_LARGE * count(next);
        // what follows only adds cells
        if !short && !is_large(&next) {
            return None;
        }
        // a zone that shrinks keeps what lies ahead too, or it would soon have to grow again
        self.mark_ahead(&hot, &damaged, &mut next);
        let both: Vec<bool> = next.iter().zip(&now).map(|(a, b)| *a || *b).collect();
        if short && count(&both) <= TOO_LARGE * count(&next) {
            next = both;
        }
        self.close(&mut next);
        let large = is_large(&next);
        let changes =
            (short || large) && next != now && next.contains(&true) && next.contains(&false);
        changes.then_some(next)
    }

    /// Marks the elements that are stretched beyond the limit.
    fn mark_elements(&self, u: &[f64], hot: &mut [bool]) {
        let limit = self.limits[0];
        let of_site = |site: u32| Vector::<D>::from_column_slice(&u[site as usize * D..][..D]);
        let found: Vec<u32> = parallel::filter_map(self.elements.len(), 256, |e| {
            let mut g = Tensor::<D>::zeros();
            for (site, shape) in &self.gradients[self.offsets[e]..self.offsets[e + 1]] {
                g += of_site(*site) * shape.transpose();
            }
            (largest_stretch(&g, limit) > limit).then(|| self.elements[e])
        });
        found.into_iter().for_each(|c| hot[c as usize] = true);
    }

    /// Marks the cells in which one of some bonds is stretched beyond the limit.
    fn mark_bonds(&self, u: &[f64], bonds: &[([u32; 2], f64)], hot: &mut [bool]) {
        let Some(body) = self.model.body() else {
            return;
        };
        let position = &body.cloud.position;
        let [lowest, highest] = self.limits.map(|s| s * (2.0 + s));
        let found: Vec<[u32; 2]> = parallel::filter_map(bonds.len(), 1024, |bond| {
            let (ends, r2) = &bonds[bond];
            let [i, j] = ends;
            let [a, b] = [*i, *j].map(|p| self.site_of_point[p as usize] as usize * D);
            let (mut along, mut square) = (0.0, 0.0);
            for k in 0..D {
                let eta = u[b + k] - u[a + k];
                along += (position[*j as usize][k] - position[*i as usize][k]) * eta;
                square += eta * eta;
            }
            // (|ξ + η|² − |ξ|²)/|ξ|² = s (2 + s); a bond beyond the critical stretch is broken, or may not break
            let t = 2.0 * along + square;
            (t > lowest * r2 && t <= highest * r2).then_some(*ends)
        });
        for point in found.into_iter().flatten() {
            self.mark_point(self.site_of_point[point as usize], hot);
        }
    }

    /// Marks the cells whose boxes come nearer than `by` to one of a set.
    fn grow(&self, cells: &[bool], by: f64, marked: &mut [bool]) {
        for member in (0..cells.len()).filter(|&c| cells[c]) {
            let (from, to) = self.boxes.of(member);
            self.mark(from, to, by, marked);
        }
    }

    /// Marks the cells at which a site lies that is a point.
    fn mark_point(&self, site: u32, marked: &mut [bool]) {
        let at = self.cells_of(site).iter();
        at.for_each(|&c| marked[c as usize] = true);
    }

    /// The cells at which a site lies that is a point.
    fn cells_of(&self, site: u32) -> &[u32] {
        let site = site as usize;
        &self.cells_at[self.starts[site]..self.starts[site + 1]]
    }

    /// Marks the cells whose boxes come nearer than `by` to a box.
    fn mark(&self, from: &Vector<D>, to: &Vector<D>, by: f64, marked: &mut [bool]) {
        let barred = &self.follow.barred;
        (self.boxes).near(from, to, by, |c| marked[c] |= !barred[c]);
    }

    /// Those of stretched cells that are at the front of the damage, or away from it: in the flanks of a crack that has passed bonds stay stretched, and need no zone around them.
    fn front(&self, hot: &[bool], damaged: &[bool]) -> Vec<bool> {
        let seen = SEEN * self.follow.reach;
        let is_front = |c: usize| {
            let (from, to) = self.boxes.of(c);
            let behind = self.damage_near(from, to, seen, damaged);
            let way = self.mean(&behind).map(|x| self.boxes.middle(c) - x);
            way.is_none_or(|way| way.norm() > AIMED * seen)
        };
        (0..hot.len()).map(|c| hot[c] && is_front(c)).collect()
    }

    /// Cells that are damaged, or cut at rest, nearer than `by` to a box.
    fn damage_near(
        &self,
        from: &Vector<D>,
        to: &Vector<D>,
        by: f64,
        damaged: &[bool],
    ) -> Vec<usize> {
        let mut found = Vec::new();
        self.boxes.near(from, to, by, |c| {
            if damaged[c] || self.notched[c] {
                found.push(c);
            }
        });
        found
    }

    /// Marks the cells ahead of the tips of cracks: groups of cells at the front, moved away from the damage behind them.
    fn mark_ahead(&self, front: &[bool], damaged: &[bool], marked: &mut [bool]) {
        let Follow {
            reach,
            padding,
            ahead,
            ..
        } = *self.follow;
        let beside = 0.5 * (reach + self.way(u64::MAX) + padding);
        let mut is_left = front.to_vec();
        for first in 0..front.len() {
            if !std::mem::take(&mut is_left[first]) {
                continue;
            }
            let (mut group, mut next) = (vec![first], 0);
            while let Some(&member) = group.get(next) {
                next += 1;
                let (from, to) = self.boxes.of(member);
                self.boxes.near(from, to, reach, |c| {
                    if std::mem::take(&mut is_left[c]) {
                        group.push(c);
                    }
                });
            }
            let Some(tip) = self.mean(&group) else {
                continue;
            };
            let behind = self.damage_near(&tip, &tip, padding, damaged);
            let way = self.mean(&behind).map_or(Vector::zeros(), |x| tip - x);
            if way.norm() < AIMED * reach {
                continue;
            }
            let parts = (ahead / reach).ceil();
            for part in 1..=parts as usize {
                let shift = way * (ahead * part as f64 / parts / way.norm());
                for &c in &group {
                    let (from, to) = self.boxes.of(c);
                    self.mark(&(from + shift), &(to + shift), beside, marked);
                }
            }
        }
    }

    /// Mean of the middles of cells; none of no cell.
    fn mean(&self, cells: &[usize]) -> Option<Vector<D>> {
        let sum: Vector<D> = cells.iter().map(|&c| self.boxes.middle(c)).sum();
        (!cells.is_empty()).then(|| sum / cells.len() as f64)
    }

    /// Takes cells in that all but one of their faces join to the set: no slits and no dents one cell wide.
    fn close(&self, cells: &mut [bool]) {
        let mesh = &self.model.mesh;
        loop {
            let facets = mesh.interface_facets(cells, &true, &false);
            let mut joined = vec![0u32; cells.len()];
            for facet in &facets {
                joined[facet.second.cell as usize] += 1;
            }
            let mut changed = false;
            for (c, &n) in joined.iter().enumerate() {
                let faces = mesh.shapes[c].facets().len() as u32;
                if n + 1 >= faces && D > 1 && !cells[c] && !self.follow.barred[c] {
                    cells[c] = true;
                    changed = true;
                }
            }
            if !changed {
                return;
            }
        }
    }
}

/// The largest principal strain of a displacement gradient, or something below `limit` if it is below.
fn largest_stretch<const D: usize>(g: &Tensor<D>, limit: f64) -> f64 {
    let strain = crate::tensor::strain(g);
    if strain.norm() <= limit {
        // no principal value is larger than the norm
        return 0.0;
    }
    let padded =
        nalgebra::Matrix3::from_fn(|i, j| if i < D && j < D { strain[(i, j)] } else { 0.0 });
    padded.symmetric_eigenvalues().max()
}

/// A speed that no crack of the materials exceeds for long, that of their fastest shear wave, `√(C₁₂₁₂/ρ)`; in 1D, where there is none, of their fastest wave \[m/s\].
///
/// A crack that opens runs no faster than the waves of Rayleigh, 0.87 to 0.96 of it.
pub(crate) fn fastest_crack<const D: usize>(model: &Model<D>, density: impl Fn(u16) -> f64) -> f64 {
    (0..model.mesh.cell_count())
        .flat_map(|c| (0..D).map(move |a| (c, a)))
        .map(|(c, a)| {
            let rho = density(model.material_of_cell(c));
            let b = (a + 1) % D;
            (model.tensor_of_cell(c).get(a, b, a, b) / rho).sqrt()
        })
        .fold(0.0, f64::max)
}
