//! Places on a lattice, expressed through sites: interpolated between the points around, extrapolated where these end.

use std::sync::OnceLock;

use nalgebra::DMatrix;
use rustc_hash::{FxHashMap, FxHashSet};

use super::found::Detail;
use crate::model::simplex::Cells;
use crate::{
    fem::Locator,
    model::{Bins, FitDegree, Model, SiteKind, least_squares_gradient},
    shape::Barriers,
    tensor::{Tensor, Vector},
};

/// A site that a place follows: its weight, and the gradient of that weight with the position of the place.
pub(super) type Follows<const D: usize> = (u32, f64, Vector<D>);

/// Weights this small are those of a corner on the other side of a place on a line or a plane of the lattice.
const NO_WEIGHT: f64 = 1e-9;

/// Distance from the middle of a cube up to which it still extrapolates, along each axis and in spacings.
const FARTHEST: f64 = 1.6;

/// Search radii for points around a place where there is no cube of the lattice, in spacings.
const AROUND: [f64; 3] = [1.8, 2.8, 4.0];

/// Tolerances on the distance of a point outside of an element, over the extent of the element: the first for every point, the others for points that were left out.
const BESIDE: [f64; 5] = [1e-9, 0.05, 0.1, 0.2, 0.4];

/// Role of a lattice point in an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Beyond {
    /// A place that follows the nodes of the element.
    Follows,
    /// A point like those of the zone, whose share nobody asks for.
    IsPoint,
}

/// The sites of one lattice of a model, and the finite elements around.
pub(super) struct Grid<'a, const D: usize> {
    model: &'a Model<D>,
    pub cells: Cells<D>,
    sites: FxHashMap<[i32; D], u32>,
    /// Points that continue the lattice among those of another, whose sites they follow.
    continued: FxHashMap<[i32; D], u32>,
    /// Points beside faces that the zone was left without.
    left_out: FxHashSet<[i32; D]>,
    elements: OnceLock<Locator<D>>,
    barriers: Barriers<D>,
    shifts: Vec<[i32; D]>,
    beyond: Beyond,
    /// All points, to find those around where no cube is; sorted when first asked for.
    points: OnceLock<(Vec<u32>, Bins<D>)>,
}

impl<'a, const D: usize> Grid<'a, D> {
    /// Takes in the points of the lattice `number` of a model whose cells `counts` names.
    pub fn new(
        model: &'a Model<D>,
        number: usize,
        cells: Cells<D>,
        beyond: Beyond,
        counts: impl Fn(&[i32; D]) -> bool,
    ) -> Self {
        let own = |p: u32| model.lattice_of_point(p) == number;
        let position = |p: u32| model.body().map(|body| body.cloud.position[p as usize]);
        let continued = model.points.continued.iter().filter(|&&p| own(p));
        let continued = continued.filter_map(|&p| Some((cells.index(&position(p)?), p)));
        let sites = model.sites.iter().enumerate().filter_map(|(s, site)| {
            let SiteKind::Point(p) = site.kind else {
                return None;
            };
            let index = cells.index(&site.position);
            (own(p) && counts(&index)).then_some((index, s as u32))
        });
        let barriers = model.peridynamics.as_ref();
        let mut shifts: Vec<[i32; D]> = (0..5usize.pow(D as u32))
            .map(|n| std::array::from_fn(|i| (n / 5usize.pow(i as u32) % 5) as i32 - 2))
            .collect();
        shifts.sort_by_key(|s| s.iter().map(|k| k * k).sum::<i32>());
        Self {
            model,
            left_out: model
                .points
                .left_out
                .iter()
                .map(|x| cells.index(x))
                .collect(),
            cells,
            sites: sites.collect(),
            continued: match beyond {
                Beyond::Follows => continued.collect(),
                Beyond::IsPoint => FxHashMap::default(),
            },
            elements: OnceLock::new(),
            barriers: Barriers::new(barriers.map_or(Vec::new(), |p| p.barriers.clone())),
            shifts,
            beyond,
            points: OnceLock::new(),
        }
    }

    /// The site at a lattice point, if it is one.
    pub fn site(&self, index: &[i32; D]) -> Option<u32> {
        self.sites.get(index).copied()
    }

    /// Sites and weights of a lattice point: its own, or those of the element that it lies in.
    fn corner(&self, index: &[i32; D]) -> Option<Vec<(u32, f64)>> {
        if let Some(site) = self.site(index) {
            return Some(vec![(site, 1.0)]);
        }
        if let (Some(&point), Some(body)) = (self.continued.get(index), self.model.body()) {
            return Some(body.cloud.transfer.row(point as usize).collect());
        }
        let mesh = &self.model.mesh;
        let elements = self.elements.get_or_init(|| {
            let cells = 0..mesh.cell_count();
            Locator::new(mesh, cells.filter(|&c| self.model.is_element(c)))
        });
        // one that was left out follows the element behind its face
        let tolerances = match self.left_out.contains(index) {
            true => &BESIDE[..],
            false => &BESIDE[..1],
        };
        let centre = self.cells.centre(index);
        let found = tolerances
            .iter()
            .find_map(|t| elements.locate(mesh, &centre, *t))?;
        if self.beyond == Beyond::IsPoint {
            return Some(Vec::new());
        }
        let nodes = mesh.cell(found.cell).iter().zip(&found.shape);
        let nodes = nodes.filter(|(_, w)| **w != 0.0);
        let rows = nodes.flat_map(|(&n, &w)| {
            let row = self.model.node_shares(n as usize);
            row.map(move |(site, v)| (site, v * w))
        });
        Some(rows.collect())
    }

    /// Returns true if a crack or a void hides one position from another.
    fn hides(&self, x: &Vector<D>, y: &Vector<D>) -> bool {
        !self.barriers.is_empty() && self.barriers.cuts(x, y)
    }

    /// Sites and weights of a place: exact for affine fields, from its own side of cracks. Empty if there is no site around. What their gradients are for, `detail` says.
    ///
    /// The cube of lattice points around the place interpolates; where one of its corners is neither a point nor in an element, the nearest whole cube extrapolates. A point that is a corner of no such cube, as on curved surfaces, takes
    /// its neighbours along the axes, or a fit to the points around where it has none along one of them: its own cell is not left to others, or it would stand for nothing.
    pub fn place(&self, x: &Vector<D>, detail: Detail) -> Vec<Follows<D>> {
        let h = self.cells.spacing;
        let local: Vector<D> = (x - self.cells.origin) / h;
        let base: [i32; D] = std::array::from_fn(|i| (local[i] + NO_WEIGHT).floor() as i32);
        // cubes by the distance of the place from their middle, not by the shift alone
        let away = |shift: &[i32; D]| -> f64 {
            let middle = |i: usize| local[i] - f64::from(base[i] + shift[i]) - 0.5;
            (0..D).map(|i| middle(i) * middle(i)).sum()
        };
        // extrapolation by more than a spacing is left to a fit
        let is_near = |shift: &[i32; D]| {
            (0..D).all(|i| (local[i] - f64::from(base[i] + shift[i]) - 0.5).abs() <= FARTHEST)
        };
        let even = |found, from: &[i32; D], is_strict| match detail {
            Detail::Centre => found,
            Detail::Quadrature => self.evened(found, x, &local, from, is_strict),
        };
        if let Some(found) = self.in_cube(x, &local, &base, true) {
            return even(found, &base, true);
        }
        let near = self.shifts.iter().filter(|s| is_near(s));
        let mut order: Vec<(f64, &[i32; D])> = near.map(|s| (away(s), s)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(b.1)));
        let index = self.cells.index(x);
        let own = self.site(&index).filter(|&site| {
            let there = self.model.sites[site as usize].position;
            !self.hides(x, &there)
        });
        for is_strict in [true, false] {
            for (_, shift) in &order {
                let from = std::array::from_fn(|i| base[i] + shift[i]);
                if let Some(found) = self.in_cube(x, &local, &from, is_strict) {
                    let has =
                        |of: &[Follows<D>], site| of.iter().any(|f| f.0 == site && f.1 != 0.0);
                    let Some(site) = own.filter(|&site| !has(&found, site)) else {
                        return even(found, &from, is_strict);
                    };
                    let with_own = self.along_axes(x, &index, site);
                    let with_own = with_own.unwrap_or_else(|| self.fitted(x));
                    return if has(&with_own, site) {
                        with_own
                    } else {
                        even(found, &from, is_strict)
                    };
                }
            }
        }
        self.fitted(x)
    }

    /// The weights that the cube from `from` on gives a place, with the mean gradients of all cubes that meet in the planes of the lattice on which the place lies.
    ///
    /// The gradients of one of them lean to its side, so that the mirror image of a load would not have the mirror image of its forces. The weights of all are the same.
    fn evened(
        &self,
        found: Vec<Follows<D>>,
        x: &Vector<D>,
        local: &Vector<D>,
        from: &[i32; D],
        is_strict: bool,
    ) -> Vec<Follows<D>> {
        let plane = |i: &usize| (local[*i] - local[*i].round()).abs() <= NO_WEIGHT;
        let planes: Vec<usize> = (0..D).filter(plane).collect();
        let mut all = vec![found];
        for turned in 1..1usize << planes.len() {
            let mut other = *from;
            for (k, &i) in planes.iter().enumerate() {
                if turned >> k & 1 == 1 {
                    other[i] = 2 * local[i].round() as i32 - 1 - from[i];
                }
            }
            all.extend(self.in_cube(x, local, &other, is_strict));
        }
        let share = 1.0 / all.len() as f64;
        let of_cube = |(k, cube): (usize, Vec<Follows<D>>)| {
            let factor = if k == 0 { 1.0 } else { 0.0 };
            let each = cube.into_iter();
            each.map(move |(site, w, gradient)| (site, w * factor, gradient * share))
        };
        all.into_iter().enumerate().flat_map(of_cube).collect()
    }

    /// The weights of a place in the cell of a point, from this point and its neighbours along the axes; none if it has no neighbour along an axis.
    fn along_axes(&self, x: &Vector<D>, index: &[i32; D], site: u32) -> Option<Vec<Follows<D>>> {
        let off = x - self.cells.centre(index);
        let mut found = self.own(index, site);
        for axis in 0..D {
            let has_slope = found.iter().any(|f| f.2[axis] != 0.0);
            if !has_slope && off[axis].abs() > NO_WEIGHT * self.cells.spacing {
                return None;
            }
        }
        for (_, weight, gradient) in &mut found {
            *weight += gradient.dot(&off);
        }
        Some(found)
    }

    /// The weights that the cube of the lattice from `base` on gives a place; none if a corner is missing or hidden that has one, or with `is_strict` that any gradient needs.
    fn in_cube(
        &self,
        x: &Vector<D>,
        local: &Vector<D>,
        base: &[i32; D],
        is_strict: bool,
    ) -> Option<Vec<Follows<D>>> {
        let mut found: Vec<Follows<D>> = Vec::with_capacity(1 << D);
        for corner in 0..1usize << D {
            let index: [i32; D] = std::array::from_fn(|i| base[i] + (corner >> i & 1) as i32);
            // the hat of each axis, and its slope
            let hat: [(f64, f64); D] = std::array::from_fn(|i| {
                let t = local[i] - f64::from(base[i]);
                let (t, slope) = match corner >> i & 1 {
                    1 => (t, 1.0),
                    _ => (1.0 - t, -1.0),
                };
                (if t.abs() <= NO_WEIGHT { 0.0 } else { t }, slope)
            });
            let weight: f64 = hat.iter().map(|w| w.0).product();
            let gradient = Vector::<D>::from_fn(|k, _| {
                let others = (0..D).filter(|&i| i != k).map(|i| hat[i].0);
                others.product::<f64>() * hat[k].1 / self.cells.spacing
            });
            if weight == 0.0 && gradient.amax() == 0.0 {
                continue;
            }
            let row = self.corner(&index);
            let row = row.filter(|_| !self.hides(x, &self.cells.centre(&index)));
            match row {
                None if weight == 0.0 && !is_strict => continue,
                None => return None,
                Some(row) => {
                    let followed = row.into_iter().map(|(s, w)| (s, w * weight, gradient * w));
                    found.extend(followed);
                }
            }
        }
        Some(found)
    }

    /// Weights from an affine fit to the points around, and where these lie in a line or a plane to nodes of elements too; from the nearest one if nothing else is there.
    fn fitted(&self, x: &Vector<D>) -> Vec<Follows<D>> {
        let sites = &self.model.sites;
        let (all, bins) = self.points.get_or_init(|| {
            let all: Vec<u32> = (0..sites.len() as u32).collect();
            let position: Vec<Vector<D>> = sites.iter().map(|s| s.position).collect();
            (all, Bins::new(&position, 2.0 * self.cells.spacing))
        });
        for with_nodes in [false, true] {
            for reach in AROUND {
                let seen = self.seen(x, all, bins, reach, with_nodes);
                let position: Vec<Vector<D>> =
                    seen.iter().map(|&s| sites[s as usize].position).collect();
                if let Some(weights) = least_squares_gradient::fit(x, &position, FitDegree::Affine)
                {
                    let gradient = gradients(&position);
                    let each = seen.into_iter().zip(weights).zip(gradient);
                    return each.map(|((s, w), g)| (s, w, g)).collect();
                }
            }
        }
        let distance = |s: u32| (sites[s as usize].position - x).norm();
        let seen = self.seen(x, all, bins, AROUND[2], true);
        let nearest = seen
            .into_iter()
            .min_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)));
        nearest.map_or(Vec::new(), |s| vec![(s, 1.0, Vector::zeros())])
    }

    fn seen(
        &self,
        x: &Vector<D>,
        all: &[u32],
        bins: &Bins<D>,
        reach: f64,
        with_nodes: bool,
    ) -> Vec<u32> {
        let reach = reach * self.cells.spacing;
        let mut seen: Vec<u32> = bins
            .around(x, reach)
            .map(|k| all[k])
            .filter(|&s| {
                let site = &self.model.sites[s as usize];
                let counts = with_nodes || matches!(site.kind, SiteKind::Point(_));
                counts && (site.position - x).norm() <= reach && !self.hides(x, &site.position)
            })
            .collect();
        seen.sort_unstable();
        seen
    }

    /// The own site of a lattice point, with the gradient that its neighbours along the axes give.
    pub fn own(&self, index: &[i32; D], site: u32) -> Vec<Follows<D>> {
        let mut found = vec![(site, 1.0, Vector::zeros())];
        let x = self.cells.centre(index);
        for axis in 0..D {
            let along = |step: i32| {
                let mut to = *index;
                to[axis] += step;
                self.corner(&to)
                    .filter(|_| !self.hides(&x, &self.cells.centre(&to)))
            };
            let mut slope = |row: &[(u32, f64)], factor: f64| {
                for &(s, w) in row {
                    let mut g = Vector::<D>::zeros();
                    g[axis] = factor * w / self.cells.spacing;
                    found.push((s, 0.0, g));
                }
            };
            match (along(1), along(-1)) {
                (Some(next), Some(last)) => {
                    slope(&next, 0.5);
                    slope(&last, -0.5);
                }
                (Some(next), None) => {
                    slope(&next, 1.0);
                    slope(&[(site, 1.0)], -1.0);
                }
                (None, Some(last)) => {
                    slope(&last, -1.0);
                    slope(&[(site, 1.0)], 1.0);
                }
                (None, None) => {}
            }
        }
        found
    }
}

/// The smallest weights of a gradient that is exact for affine fields, over positions: as far as these have an extent.
pub(super) fn gradients<const D: usize>(position: &[Vector<D>]) -> Vec<Vector<D>> {
    let mean = position.iter().sum::<Vector<D>>() / position.len().max(1) as f64;
    let shape: Tensor<D> = position
        .iter()
        .map(|x| (x - mean) * (x - mean).transpose())
        .sum();
    let shape = DMatrix::from_fn(D, D, |i, j| shape[(i, j)]);
    let tolerance = 1e-9 * shape.amax();
    let Ok(inverse) = shape.pseudo_inverse(tolerance) else {
        return vec![Vector::zeros(); position.len()];
    };
    let inverse = Tensor::<D>::from_fn(|i, j| inverse[(i, j)]);
    position.iter().map(|x| inverse * (x - mean)).collect()
}
