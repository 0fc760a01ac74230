//! Where a zone that follows the crack is wanted, and when that is looked at.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::coupling::{Model, SiteKind, Zone};
use crate::fem;
use crate::peridynamics::PdBody;
use crate::scene::follow::Follow;
use crate::system::Dynamic;
use crate::tensor::{Tensor, Vector};

/// Part of the padding beyond the reach that the fastest crack may cross between two looks; the rest is how far it runs before the zone has to change.
const CROSSED: f64 = 0.3;

/// The zone also changes where it is this many times larger than it would be.
const TOO_LARGE: f64 = 1.5;

/// Bonds of these lengths, in horizons, are looked at: some of each direction, mirror images together, so that the zone of a symmetric motion stays symmetric.
const LOOKED_AT: [f64; 2] = [0.5, 0.75];

/// Looks at a moving model for cells that must be nonlocal.
pub(super) struct Watch<'a, const D: usize> {
    follow: &'a Follow,
    model: &'a Model<D>,
    /// Stretch from which a cell is wanted, and beyond which a bond is broken.
    limits: [f64; 2],
    /// Steps between looks.
    every: u64,
    /// How far a crack comes in between \[m\].
    travel: f64,
    /// Bonds to look at, by their points.
    bonds: Vec<[u32; 2]>,
    /// The cell of each point; `u32::MAX` for one that follows sites.
    cell_of_point: Vec<u32>,
    /// The cell of each site that is a point.
    cell_of_site: Vec<u32>,
    /// Cells that stay nonlocal for what cuts their bonds at rest.
    cut: Vec<bool>,
    boxes: Vec<(Vector<D>, Vector<D>)>,
    /// Cells by the middle of their boxes, and half the extent of the largest.
    bins: HashMap<[i64; D], Vec<u32>>,
    size: f64,
    half: f64,
    /// Elements with the sites and weights of the gradient at their centres.
    elements: Vec<u32>,
    gradients: Vec<(u32, Vector<D>)>,
    /// Where those of each element begin.
    offsets: Vec<usize>,
    /// The site of each point; `u32::MAX` for one that follows sites.
    site_of_point: Vec<u32>,
}

impl<'a, const D: usize> Watch<'a, D> {
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
        let boxes: Vec<_> = (0..cells).map(|c| mesh.bounds_of(mesh.cell(c))).collect();
        let cut = (0..cells)
            .into_par_iter()
            .map(|c| {
                let (x, (low, high)) = (mesh.centroid(c), &boxes[c]);
                let own = 0.5 * (high - low).amax();
                let shapes = barriers.iter().map(|b| b.shape()).chain(voids);
                let near = |d: f64| d < follow.reach + own * (1.0 - 1e-9);
                !follow.barred[c] && shapes.into_iter().any(|s| near(s.signed_distance(&x)))
            })
            .collect();
        let mut watch = Self {
            follow,
            model,
            limits: [follow.stretch * critical, critical],
            every,
            travel: speed * step * every as f64,
            bonds: Vec::new(),
            cell_of_point: Vec::new(),
            cell_of_site: vec![u32::MAX; model.sites.len()],
            cut,
            half: 0.5
                * boxes
                    .iter()
                    .map(|(l, h)| (h - l).amax())
                    .fold(0.0, f64::max),
            boxes,
            bins: HashMap::new(),
            size: follow.padding,
            elements: Vec::new(),
            gradients: Vec::new(),
            offsets: vec![0],
            site_of_point: Vec::new(),
        };
        for c in 0..cells {
            let key = watch.bin(&watch.middle(c));
            watch.bins.entry(key).or_default().push(c as u32);
        }
        watch.find_bonds();
        watch.find_gradients();
        watch
    }

    fn middle(&self, cell: usize) -> Vector<D> {
        let (low, high) = &self.boxes[cell];
        (low + high) * 0.5
    }

    fn bin(&self, x: &Vector<D>) -> [i64; D] {
        std::array::from_fn(|a| (x[a] / self.size).floor() as i64)
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
        let mesh = &self.model.mesh;
        let cells = (0..mesh.cell_count()).filter(|&c| !self.model.is_element(c));
        let locator = fem::Locator::new(mesh, cells);
        let sites = &self.model.sites;
        self.site_of_point = vec![u32::MAX; body.cloud.position.len()];
        for (site, s) in sites.iter().enumerate() {
            if let SiteKind::Point(p) = s.kind {
                self.site_of_point[p as usize] = site as u32;
            }
        }
        self.cell_of_site = sites
            .par_iter()
            .map(|s| match s.kind {
                SiteKind::Node(_) => u32::MAX,
                SiteKind::Point(_) => locator
                    .locate(mesh, &s.position, 1e-9)
                    .map_or(u32::MAX, |l| l.cell as u32),
            })
            .collect();
        self.cell_of_point = vec![u32::MAX; body.cloud.position.len()];
        for (s, &cell) in sites.iter().zip(&self.cell_of_site) {
            if let SiteKind::Point(p) = s.kind {
                self.cell_of_point[p as usize] = cell;
            }
        }
        let is_known = |p: u32| self.cell_of_point[p as usize] != u32::MAX;
        let [shortest, longest] = LOOKED_AT;
        for i in (0..self.cell_of_point.len() as u32).filter(|&i| is_known(i)) {
            let horizon = body.cloud.horizon[i as usize] * (1.0 + 1e-6);
            let of = body.families.of(i as usize).iter().copied();
            self.bonds.extend(
                of.filter(|&j| {
                    let r = body.bond(i as usize, j as usize).norm();
                    j > i
                        && is_known(j)
                        && (shortest * horizon * (1.0 - 2e-6)..longest * horizon).contains(&r)
                })
                .map(|j| [i, j]),
            );
        }
    }

    /// Steps between two looks.
    pub fn every(&self) -> u64 {
        self.every
    }

    /// The cells that shall be nonlocal, if the present ones will not do.
    pub fn look(&self, u: &[f64], system: &dyn Dynamic) -> Option<Vec<bool>> {
        let cells = self.boxes.len();
        let hot = self.stretched(u);
        let mut damaged = vec![false; cells];
        for site in system.damaged_sites() {
            if let Some(c) = damaged.get_mut(self.cell_of_site[site as usize] as usize) {
                *c = true;
            }
        }
        let reach = self.follow.reach;
        let now: Vec<bool> = (0..cells)
            .map(|c| self.model.zones[c] == Zone::Nonlocal)
            .collect();
        let around = |ahead: f64| -> Vec<bool> {
            let mut wanted = self.cut.clone();
            self.grow(&damaged, reach, &mut wanted);
            self.grow(&hot, ahead, &mut wanted);
            wanted
        };
        let short = around(reach + self.travel)
            .iter()
            .zip(&now)
            .any(|(wanted, now)| *wanted && !now);
        let mut next = around(self.follow.padding);
        self.close(&mut next);
        let count = |set: &[bool]| set.iter().filter(|c| **c).count() as f64;
        let large = count(&now) > TOO_LARGE * count(&next);
        ((short || large) && next != now && next.contains(&true) && next.contains(&false))
            .then_some(next)
    }

    /// Cells in which a bond, or an element, is stretched beyond the limit.
    fn stretched(&self, u: &[f64]) -> Vec<bool> {
        let [limit, critical] = self.limits;
        let mut hot = vec![false; self.boxes.len()];
        let of_site = |site: u32| Vector::<D>::from_column_slice(&u[site as usize * D..][..D]);
        let found: Vec<u32> = (0..self.elements.len())
            .into_par_iter()
            .with_min_len(256)
            .filter(|&e| {
                let mut g = Tensor::<D>::zeros();
                for (site, shape) in &self.gradients[self.offsets[e]..self.offsets[e + 1]] {
                    g += of_site(*site) * shape.transpose();
                }
                largest_stretch(&g, limit) > limit
            })
            .map(|e| self.elements[e])
            .collect();
        found.into_iter().for_each(|c| hot[c as usize] = true);
        if let Some(body) = self.model.body() {
            let found: Vec<[u32; 2]> = self
                .bonds
                .par_iter()
                .with_min_len(1024)
                .filter(|[i, j]| {
                    // a bond beyond the critical stretch is broken, or may not break
                    let s = self.stretch(body, *i as usize, *j as usize, u);
                    s > limit && s <= critical
                })
                .copied()
                .collect();
            for point in found.into_iter().flatten() {
                hot[self.cell_of_point[point as usize] as usize] = true;
            }
        }
        hot
    }

    /// Marks the cells whose boxes come nearer than `by` to one of a set, along every axis.
    fn grow(&self, cells: &[bool], by: f64, marked: &mut [bool]) {
        let by = by * (1.0 - 1e-9);
        for member in (0..cells.len()).filter(|&c| cells[c]) {
            let (from, to) = &self.boxes[member];
            let margin = Vector::repeat(by + self.half);
            let (first, last) = (self.bin(&(from - margin)), self.bin(&(to + margin)));
            for_each_bin(first, last, |key| {
                for &c in self.bins.get(&key).into_iter().flatten() {
                    let c = c as usize;
                    let (low, high) = &self.boxes[c];
                    marked[c] |= !self.follow.barred[c]
                        && (0..D).all(|a| from[a] - high[a] < by && low[a] - to[a] < by);
                }
            });
        }
    }

    /// Stretch of the bond between two points that are sites.
    fn stretch(&self, body: &PdBody<D>, i: usize, j: usize, u: &[f64]) -> f64 {
        let of = |p: usize| {
            let site = self.site_of_point[p] as usize;
            Vector::<D>::from_column_slice(&u[site * D..][..D])
        };
        let xi = body.bond(i, j);
        let eta = of(j) - of(i);
        let r = xi.norm();
        (2.0 * xi.dot(&eta) + eta.norm_squared()) / (r * (r + (xi + eta).norm()))
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

/// Visits the bins from one corner to the other.
fn for_each_bin<const D: usize>(first: [i64; D], last: [i64; D], mut visit: impl FnMut([i64; D])) {
    let counts: [i64; D] = std::array::from_fn(|a| last[a] - first[a] + 1);
    for index in 0..counts.iter().product::<i64>() {
        let mut rest = index;
        visit(std::array::from_fn(|a| {
            let k = rest % counts[a];
            rest /= counts[a];
            first[a] + k
        }));
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
pub(super) fn fastest_crack<const D: usize>(model: &Model<D>, density: impl Fn(u16) -> f64) -> f64 {
    (0..model.mesh.cell_count())
        .flat_map(|c| (0..D).map(move |a| (c, a)))
        .map(|(c, a)| {
            let rho = density(model.material_of_cell(c));
            let b = (a + 1) % D;
            (model.tensor_of_cell(c).get(a, b, a, b) / rho).sqrt()
        })
        .fold(0.0, f64::max)
}
