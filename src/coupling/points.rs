//! Peridynamic points: those of the peridynamic region, and those that continue its lattice or cells into the finite elements to complete families.

use std::collections::{HashMap, HashSet};

use rayon::prelude::*;

use crate::{
    coupling::{
        CellRole, ModelError, Reach, Zone,
        model::{Peridynamics, PointSource, Surfaces},
    },
    fem::{self, Locator},
    mesh::{Mesh, boundary::BoundaryFacet, cutter::SegmentCutter},
    peridynamics::{
        BondWeights, Families, Family, LatticeFamily, TIE_TOLERANCE, collapsed_tensor,
        isotropic_shell_factors,
    },
    shape::{Barrier, Barriers, Shape},
    tensor::{Tensor4, Vector},
};

/// Volumes of the peridynamic region and of the points in it \[m^D\].
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Volumes {
    /// Sum of the cells that hold points.
    pub region: f64,
    /// What all quadrature points have of that region, including those at its edge that belong to finite elements.
    pub points: f64,
}

/// Points before they are sites.
///
/// Shapes: one entry per point in each vector.
#[derive(Clone)]
pub(super) struct PointCloud<const D: usize> {
    pub position: Vec<Vector<D>>,
    pub volume: Vec<f64>,
    pub horizon: Vec<f64>,
    pub zone: Vec<Zone>,
    /// The finite element that interpolates a point, with its shape values; none for a point that is a site.
    pub element: Vec<Option<(u32, Vec<f64>)>>,
    pub spacing: f64,
    /// Whether the points are some of a lattice's.
    pub is_lattice: bool,
    pub volumes: Volumes,
}

/// Which points are needed.
pub(super) struct Kept {
    /// New number of each point, `u32::MAX` for one that is dropped.
    pub renumbered: Vec<u32>,
    /// Whether each point (by its old number) needs a family.
    pub active: Vec<bool>,
}

const DROPPED: u32 = u32::MAX;

impl<const D: usize> PointCloud<D> {
    /// Keeps sites, what is in their families, and with [`Reach::Neighbours`] what is in the families of those.
    pub fn prune(&self, families: &Families, reach: Reach) -> Kept {
        let n = self.position.len();
        let mut active: Vec<bool> = self.element.iter().map(Option::is_none).collect();
        if reach == Reach::Neighbours {
            let site = active.clone();
            for i in 0..n {
                let mut sees_site = false;
                for &j in families.of(i) {
                    if site[i] {
                        active[j as usize] = true;
                    }
                    sees_site |= site[j as usize];
                }
                // its force state acts on a site, whatever the site's own horizon
                active[i] |= sees_site;
            }
        }
        let mut used = active.clone();
        for i in (0..n).filter(|&i| active[i]) {
            for &j in families.of(i) {
                used[j as usize] = true;
            }
        }
        let mut next = 0;
        let renumbered = used
            .iter()
            .map(|&used| {
                if used {
                    next += 1;
                    next - 1
                } else {
                    DROPPED
                }
            })
            .collect();
        Kept { renumbered, active }
    }

    /// Drops the points that have no new number.
    pub fn retain(&mut self, renumbered: &[u32]) {
        let mut flags = renumbered.iter().map(|&r| r != DROPPED);
        let mut keep = || flags.next().unwrap_or(false);
        self.position.retain(|_| keep());
        retain_by(&mut self.volume, renumbered);
        retain_by(&mut self.horizon, renumbered);
        retain_by(&mut self.zone, renumbered);
        retain_by(&mut self.element, renumbered);
    }
}

fn retain_by<T>(values: &mut Vec<T>, renumbered: &[u32]) {
    let mut flags = renumbered.iter().map(|&r| r != DROPPED);
    values.retain(|_| flags.next().unwrap_or(false));
}

/// Places points in the cells that hold them and, as far as families reach, in the finite elements around.
pub(super) fn place<const D: usize>(
    mesh: &Mesh<D>,
    zones: &[Zone],
    roles: &[CellRole],
    p: &Peridynamics<D>,
    reach: Reach,
) -> Result<PointCloud<D>, ModelError> {
    let region: f64 = (0..mesh.cell_count())
        .into_par_iter()
        .filter(|&c| roles[c] == CellRole::Points)
        .map(|c| fem::cell_volume(mesh, c))
        .collect::<Vec<_>>()
        .iter()
        .sum();
    let horizon = |x: &Vector<D>| (p.horizon)(x);
    let in_void = |x: &Vector<D>| {
        p.voids
            .iter()
            .any(|v| v.signed_distance(x) < -1e-9 * horizon(x))
    };
    let levels = if reach == Reach::Own { 1.0 } else { 2.0 };
    let largest = (0..mesh.cell_count())
        .map(|c| horizon(&mesh.centroid(c)))
        .fold(0.0, f64::max);
    let (mut low, mut high): (Vector<D>, Vector<D>) = (
        Vector::repeat(f64::INFINITY),
        Vector::repeat(f64::NEG_INFINITY),
    );
    for c in (0..mesh.cell_count()).filter(|&c| roles[c] != CellRole::Element) {
        for &n in mesh.cell(c) {
            low = low.inf(&mesh.nodes[n as usize]);
            high = high.sup(&mesh.nodes[n as usize]);
        }
    }
    let margin = Vector::repeat(levels * largest * (1.0 + 1e-6));
    let (low, high) = (low - margin, high + margin);
    match p.points {
        PointSource::Cells => Ok(from_cells(
            mesh, zones, roles, &horizon, &in_void, low, high, region,
        )),
        PointSource::Lattice { spacing, origin } => {
            if !(spacing.is_finite() && spacing > 0.0) {
                return Err(ModelError::NoPoints { spacing });
            }
            Ok(from_lattice(
                mesh, zones, roles, spacing, origin, &horizon, &in_void, low, high, region,
            ))
        }
    }
}

#[allow(clippy::too_many_arguments)] // one call site; a struct would only rename them
fn from_cells<const D: usize>(
    mesh: &Mesh<D>,
    zones: &[Zone],
    roles: &[CellRole],
    horizon: &dyn Fn(&Vector<D>) -> f64,
    in_void: &dyn Fn(&Vector<D>) -> bool,
    low: Vector<D>,
    high: Vector<D>,
    region: f64,
) -> PointCloud<D> {
    let mut cloud = PointCloud::empty(0.0, region);
    for c in 0..mesh.cell_count() {
        let x = mesh.centroid(c);
        if (0..D).any(|i| x[i] < low[i] || x[i] > high[i]) || in_void(&x) {
            continue;
        }
        let element = (roles[c] != CellRole::Points).then(|| {
            let n = mesh.cell(c).len();
            (c as u32, vec![1.0 / n as f64; n])
        });
        let volume = fem::cell_volume(mesh, c);
        if element.is_none() {
            cloud.volumes.points += volume;
            cloud.spacing += volume;
        }
        cloud.push(x, volume, horizon(&x), zones[c], element);
    }
    let sites = cloud.element.iter().filter(|e| e.is_none()).count().max(1);
    cloud.spacing = (cloud.spacing / sites as f64).powf(1.0 / D as f64);
    if let Some(first) = cloud.position.first().copied() {
        let h = cloud.spacing;
        cloud.is_lattice = cloud.position.iter().zip(&cloud.volume).all(|(x, v)| {
            let k = (x - first) / h;
            k.iter().all(|k| (k - k.round()).abs() < 1e-6)
                && (v / h.powi(D as i32) - 1.0).abs() < 1e-6
        });
    }
    cloud
}

impl<const D: usize> PointCloud<D> {
    fn empty(spacing: f64, region: f64) -> Self {
        Self {
            position: Vec::new(),
            volume: Vec::new(),
            horizon: Vec::new(),
            zone: Vec::new(),
            element: Vec::new(),
            spacing,
            is_lattice: false,
            volumes: Volumes {
                region,
                points: 0.0,
            },
        }
    }

    fn push(
        &mut self,
        x: Vector<D>,
        volume: f64,
        horizon: f64,
        zone: Zone,
        element: Option<(u32, Vec<f64>)>,
    ) {
        self.position.push(x);
        self.volume.push(volume);
        self.horizon.push(horizon);
        self.zone.push(zone);
        self.element.push(element);
    }
}

/// Lattice points per block of work.
const BLOCK: usize = 1024;

#[allow(clippy::too_many_arguments)] // one call site; a struct would only rename them
fn from_lattice<const D: usize>(
    mesh: &Mesh<D>,
    zones: &[Zone],
    roles: &[CellRole],
    h: f64,
    origin: Vector<D>,
    horizon: &(dyn Fn(&Vector<D>) -> f64 + Sync),
    in_void: &(dyn Fn(&Vector<D>) -> bool + Sync),
    low: Vector<D>,
    high: Vector<D>,
    region: f64,
) -> PointCloud<D> {
    let cells = |keep: &dyn Fn(usize) -> bool| {
        Locator::new(mesh, (0..mesh.cell_count()).filter(|&c| keep(c)))
    };
    let elements = cells(&|c| roles[c] != CellRole::Points);
    // at a face that zones share, the zone that comes first here has the point
    let by_zone = [Zone::Nonlocal, Zone::Transition, Zone::Local].map(|zone| {
        (
            zone,
            cells(&|c| roles[c] == CellRole::Points && zones[c] == zone),
        )
    });
    let tolerance = 1e-9;
    let in_region = |x: &Vector<D>| {
        by_zone
            .iter()
            .find(|(_, l)| l.locate(mesh, x, tolerance).is_some())
            .map(|(z, _)| *z)
    };

    let first: Vector<D> = ((low - origin) / h).map(f64::floor);
    let counts: [usize; D] =
        std::array::from_fn(|i| (((high[i] - origin[i]) / h).ceil() - first[i]) as usize + 1);
    let total: usize = counts.iter().product();
    let position = |index: usize| {
        let mut rest = index;
        let mut k = first;
        for i in (0..D).rev() {
            k[i] += (rest % counts[i]) as f64;
            rest /= counts[i];
        }
        origin + k * h
    };
    // lattice cells that an edge of the region passes: their volume is sampled
    let mut edge = vec![false; total];
    let region_cells =
        (0..mesh.cell_count() as u32).filter(|&c| roles[c as usize] == CellRole::Points);
    for facet in mesh.boundary_facets(region_cells) {
        let (mut lo, mut hi): (Vector<D>, Vector<D>) = (
            Vector::repeat(f64::INFINITY),
            Vector::repeat(f64::NEG_INFINITY),
        );
        for &n in &facet.nodes {
            lo = lo.inf(&mesh.nodes[n as usize]);
            hi = hi.sup(&mesh.nodes[n as usize]);
        }
        mark_box(&mut edge, &counts, &first, &origin, h, &lo, &hi);
    }
    let samples = if D == 3 { 4 } else { 8 };
    let whole = h.powi(D as i32);
    type Found<const D: usize> = (Vector<D>, f64, f64, Zone, Option<(u32, Vec<f64>)>);
    let found: Vec<Vec<Found<D>>> = (0..total.div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let mut list = Vec::new();
            for index in block * BLOCK..((block + 1) * BLOCK).min(total) {
                let x = position(index);
                if in_void(&x) {
                    continue;
                }
                let located = elements.locate(mesh, &x, tolerance);
                let zone = match &located {
                    Some(l) => Some(zones[l.cell]),
                    None => in_region(&x),
                };
                let Some(zone) = zone else { continue };
                let (mut volume, mut share) = (whole, if located.is_none() { whole } else { 0.0 });
                if edge[index] {
                    let (mut body, mut here) = (0, 0);
                    let count = samples_of::<D>(samples, |offset| {
                        let s = x + offset * h;
                        if in_void(&s) {
                            return;
                        }
                        let inside = in_region(&s).is_some();
                        here += usize::from(inside);
                        body +=
                            usize::from(inside || elements.locate(mesh, &s, tolerance).is_some());
                    });
                    volume = whole * body as f64 / count as f64;
                    share = whole * here as f64 / count as f64;
                }
                if volume > 0.0 {
                    let element = located.map(|l| (l.cell as u32, l.shape[..l.nodes].to_vec()));
                    list.push((x, volume, share, zone, element));
                }
            }
            list
        })
        .collect();
    let mut cloud = PointCloud::empty(h, region);
    cloud.is_lattice = true;
    let points: f64 = found.iter().flatten().map(|f| f.2).sum();
    // what sampling misses on curved edges is spread over the points whose cells the body's surface cuts
    let cut: f64 = found
        .iter()
        .flatten()
        .filter(|f| f.1 < whole)
        .map(|f| f.2)
        .sum();
    let scale = if cut > 0.0 {
        1.0 + (region - points) / cut
    } else {
        1.0
    };
    let scale = if (0.5..2.0).contains(&scale) && (scale - 1.0).abs() > 1e-12 {
        scale
    } else {
        1.0
    };
    for (x, volume, share, zone, element) in found.into_iter().flatten() {
        let factor = if volume < whole { scale } else { 1.0 };
        cloud.volumes.points += share * factor;
        cloud.push(x, volume * factor, horizon(&x), zone, element);
    }
    cloud
}

fn mark_box<const D: usize>(
    edge: &mut [bool],
    counts: &[usize; D],
    first: &Vector<D>,
    origin: &Vector<D>,
    h: f64,
    lo: &Vector<D>,
    hi: &Vector<D>,
) {
    let half = 0.5 * (1.0 - 1e-9);
    let mut from = [0usize; D];
    let mut to = [0usize; D];
    for i in 0..D {
        let a = ((lo[i] - origin[i]) / h - half - first[i]).ceil().max(0.0);
        let b = ((hi[i] - origin[i]) / h + half - first[i])
            .floor()
            .min(counts[i] as f64 - 1.0);
        if a > b {
            return;
        }
        (from[i], to[i]) = (a as usize, b as usize);
    }
    let mut k = from;
    loop {
        let index = (0..D).fold(0, |index, i| index * counts[i] + k[i]);
        edge[index] = true;
        let mut axis = D;
        loop {
            if axis == 0 {
                return;
            }
            axis -= 1;
            if k[axis] < to[axis] {
                k[axis] += 1;
                break;
            }
            k[axis] = from[axis];
        }
    }
}

/// Visits `n^D` equal parts of the unit cell around the origin by their centres; returns their number.
fn samples_of<const D: usize>(n: usize, mut visit: impl FnMut(Vector<D>)) -> usize {
    let count = n.pow(D as u32);
    for index in 0..count {
        let mut rest = index;
        visit(Vector::from_fn(|_, _| {
            let k = rest % n;
            rest /= n;
            (k as f64 + 0.5) / n as f64 - 0.5
        }));
    }
    count
}

/// Removes the bonds that barriers or the boundary of the mesh cut.
pub(super) fn cut<const D: usize>(
    p: &Peridynamics<D>,
    mesh: &Mesh<D>,
    position: &[Vector<D>],
    families: &mut Families,
) {
    let barriers = Barriers::new(p.barriers.clone());
    let surface = (p.surfaces == Surfaces::Cut).then(|| mesh.outer_facets());
    if barriers.is_empty() && surface.is_none() {
        return;
    }
    let reach = position.iter().map(|x| (p.horizon)(x)).fold(0.0, f64::max);
    // a bond crosses a facet only if both of its ends are within a horizon of it
    let bins = surface
        .as_ref()
        .map(|facets| NearBins::new(mesh, facets, reach));
    let cutter = surface.map(|facets| SegmentCutter::new(mesh, &facets));
    let near: Vec<bool> = position
        .par_iter()
        .map(|x| barriers.near(x, reach) || bins.as_ref().is_some_and(|b| b.contains(x)))
        .collect();
    families.retain(|i, j| {
        let j = j as usize;
        if !(near[i] && near[j]) {
            return true;
        }
        let (a, b) = (&position[i], &position[j]);
        !barriers.cuts(a, b) && !cutter.as_ref().is_some_and(|c| c.cuts(a, b))
    });
}

/// Bins of the size of a horizon in or beside which facets lie.
struct NearBins<const D: usize> {
    size: f64,
    bins: HashSet<[i64; D]>,
}

impl<const D: usize> NearBins<D> {
    fn new(mesh: &Mesh<D>, facets: &[BoundaryFacet], size: f64) -> Self {
        let mut bins = HashSet::new();
        for facet in facets {
            let (mut low, mut high): (Vector<D>, Vector<D>) = (
                Vector::repeat(f64::INFINITY),
                Vector::repeat(f64::NEG_INFINITY),
            );
            for &n in &facet.nodes {
                low = low.inf(&mesh.nodes[n as usize]);
                high = high.sup(&mesh.nodes[n as usize]);
            }
            let margin = Vector::repeat(size * (1.0 + 1e-6));
            let (from, to) = (
                Self::bin(&(low - margin), size),
                Self::bin(&(high + margin), size),
            );
            let counts: [usize; D] = std::array::from_fn(|i| (to[i] - from[i] + 1) as usize);
            for index in 0..counts.iter().product::<usize>() {
                let mut rest = index;
                bins.insert(std::array::from_fn(|i| {
                    let k = rest % counts[i];
                    rest /= counts[i];
                    from[i] + k as i64
                }));
            }
        }
        Self { size, bins }
    }

    fn bin(x: &Vector<D>, size: f64) -> [i64; D] {
        std::array::from_fn(|i| (x[i] / size).floor() as i64)
    }

    fn contains(&self, x: &Vector<D>) -> bool {
        self.bins.contains(&Self::bin(x, self.size))
    }
}

/// Bond factors of a lattice, shell by shell, for every horizon in use.
pub(super) struct LatticeFactors {
    tables: HashMap<u64, HashMap<u64, f64>>,
    spacing: f64,
    is_lattice: bool,
}

impl LatticeFactors {
    /// Factors for the horizons of a cloud; without effect unless the points are a lattice's and the weights isotropic.
    pub fn new<const D: usize>(
        p: &Peridynamics<D>,
        cloud: &PointCloud<D>,
    ) -> Result<Self, ModelError> {
        let mut factors = Self {
            tables: HashMap::new(),
            spacing: cloud.spacing,
            is_lattice: cloud.is_lattice,
        };
        if !cloud.is_lattice || p.weights != BondWeights::Isotropic {
            return Ok(factors);
        }
        for &horizon in &cloud.horizon {
            if factors.tables.contains_key(&horizon.to_bits()) {
                continue;
            }
            let mut table = HashMap::new();
            if let Some(target) = p.law.shell_target() {
                let lattice = LatticeFamily::<D>::new(horizon / cloud.spacing, TIE_TOLERANCE)?;
                let base: Vec<f64> = lattice
                    .shells
                    .iter()
                    .map(|s| p.law.kernel(s.length(cloud.spacing), horizon))
                    .collect();
                let weights = isotropic_shell_factors(&lattice, cloud.spacing, &base, target)?;
                table = lattice
                    .shells
                    .iter()
                    .map(|s| s.squared)
                    .zip(weights)
                    .collect();
            }
            factors.tables.insert(horizon.to_bits(), table);
        }
        Ok(factors)
    }

    /// Whether the points are a lattice's.
    pub fn is_lattice(&self) -> bool {
        self.is_lattice
    }

    /// The factor of a bond.
    pub fn factor<const D: usize>(&self, horizon: f64, xi: &Vector<D>) -> f64 {
        let squared = (xi.norm_squared() / (self.spacing * self.spacing)).round() as u64;
        self.tables
            .get(&horizon.to_bits())
            .and_then(|table| table.get(&squared))
            .copied()
            .unwrap_or(1.0)
    }

    /// The elastic tensor of the plain full lattice; none without a lattice.
    pub fn tensor<const D: usize>(
        &self,
        p: &Peridynamics<D>,
        horizon: f64,
    ) -> Result<Option<Tensor4<D>>, ModelError> {
        if !self.is_lattice {
            return Ok(None);
        }
        let lattice = LatticeFamily::<D>::new(horizon / self.spacing, TIE_TOLERANCE)?;
        let bonds: Vec<Vector<D>> = lattice
            .shells
            .iter()
            .flat_map(|s| {
                s.offsets
                    .iter()
                    .map(|k| Vector::from_fn(|i, _| f64::from(k[i]) * self.spacing))
            })
            .collect();
        let volumes = vec![self.spacing.powi(D as i32); bonds.len()];
        let ones = vec![1.0; bonds.len()];
        let family = Family {
            bonds: &bonds,
            volumes: &volumes,
            factors: &ones,
            horizon,
        };
        let (mut pair, mut omega) = (vec![0.0; bonds.len()], vec![0.0; bonds.len()]);
        let state = p
            .law
            .coefficients(&family, &mut pair, &mut omega)
            .map_err(|source| ModelError::Family {
                what: "the full lattice",
                position: vec![],
                bonds: bonds.len(),
                source,
            })?;
        Ok(Some(collapsed_tensor(&family, &pair, state.as_ref())))
    }
}

/// Shapes that barriers made of voids have, for points inside them.
pub fn shapes_of_voids<const D: usize>(barriers: &[Barrier<D>]) -> Vec<Shape<D>> {
    barriers
        .iter()
        .filter_map(|b| match b {
            Barrier::Void(shape) => Some(shape.clone()),
            Barrier::Crack(_) => None,
        })
        .collect()
}
