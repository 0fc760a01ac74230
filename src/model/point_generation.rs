//! Placement of peridynamic points: in the cells that hold them and, as far as families reach, in the finite elements around.

use crate::{
    fem::{self, Locator},
    mesh::Mesh,
    model::{
        CellRole, ModelError, Peridynamics, PointSource, Reach, Zone,
        bins::Bins,
        lattice_axes::lattice_axes,
        lattice_box::{LatticeBox, samples_of},
        point_cloud::{PointCarrier, PointCloud},
    },
    parallel,
    peridynamics::Horizon,
    tensor::{Tensor, Vector},
};

/// Continuation of a lattice where neither its own cells nor an element are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Beyond {
    /// There are no points.
    Empty,
    /// There are points, of which bonds that end on faces need the place only.
    Continued,
}

/// Places points in the cells that hold them and, as far as families reach, around; one cloud for each lattice.
pub(crate) fn place<const D: usize>(
    mesh: &Mesh<D>,
    zones: &[Zone],
    roles: &[CellRole],
    p: &Peridynamics<D>,
    reach: Reach,
    beyond: Beyond,
) -> Result<Vec<PointCloud<D>>, ModelError> {
    let all: Vec<bool> = roles.iter().map(|&r| r == CellRole::Points).collect();
    let largest = (0..mesh.cell_count())
        .map(|c| p.reach(p.horizon.at(&mesh.centroid(c))))
        .fold(0.0, f64::max);
    let placement = |mine: Vec<bool>, earlier: Vec<bool>, horizon: Option<f64>| {
        let region = parallel::filter_map(mesh.cell_count(), 1, |c| {
            mine[c].then(|| fem::cell_volume(mesh, c))
        })
        .iter()
        .sum();
        let nodes: Vec<u32> = (0..mesh.cell_count())
            .filter(|&c| mine[c] || roles[c] == CellRole::StressElement)
            .flat_map(|c| mesh.cell(c).iter().copied())
            .collect();
        let (low, high) = mesh.bounds_of(&nodes);
        let levels = if reach == Reach::Own { 1.0 } else { 2.0 };
        let margin = Vector::repeat(levels * horizon.unwrap_or(largest) * (1.0 + 1e-6));
        Placement {
            mesh,
            zones,
            roles,
            p,
            mine,
            earlier,
            own_horizon: horizon,
            beyond,
            margin,
            low: low - margin,
            high: high + margin,
            region,
        }
    };
    match &p.points {
        PointSource::Cells => Ok(vec![placement(all, Vec::new(), None).at_cells()]),
        &PointSource::Lattice { spacing, origin } if spacing.is_finite() && spacing > 0.0 => {
            Ok(vec![
                placement(all, Vec::new(), None).on_lattice(spacing, origin)?,
            ])
        }
        &PointSource::Lattice { spacing, .. } => Err(ModelError::NoPoints { spacing }),
        PointSource::Lattices { lattices, of_cell } => lattices
            .iter()
            .enumerate()
            .map(|(l, lattice)| {
                let cells = |holds: &dyn Fn(usize) -> bool| -> Vec<bool> {
                    let of_cells = all.iter().zip(of_cell);
                    of_cells
                        .map(|(&points, &of)| points && holds(usize::from(of)))
                        .collect()
                };
                let mine = cells(&|of| of == l);
                // bodies that meet share the points on their faces: the one named later has them
                let earlier = match beyond {
                    Beyond::Empty => cells(&|of| of < l),
                    Beyond::Continued => Vec::new(),
                };
                let h = lattice.spacing;
                if !(h.is_finite() && h > 0.0 && mine.contains(&true)) {
                    return Err(ModelError::NoPoints { spacing: h });
                }
                placement(mine, earlier, Some(lattice.horizon)).on_lattice(h, lattice.origin)
            })
            .collect(),
    }
}

/// Input for the placement of points.
struct Placement<'a, const D: usize> {
    mesh: &'a Mesh<D>,
    zones: &'a [Zone],
    roles: &'a [CellRole],
    p: &'a Peridynamics<D>,
    /// Cells whose points are sites.
    mine: Vec<bool>,
    /// Cells of lattices that are placed before this one, where lattices meet; empty elsewhere.
    earlier: Vec<bool>,
    /// The horizon of a lattice that has its own.
    own_horizon: Option<f64>,
    beyond: Beyond,
    /// Corners of the box that holds all points.
    low: Vector<D>,
    high: Vector<D>,
    /// Distance from the cells, along each axis, within which points are needed.
    margin: Vector<D>,
    /// Volume of the cells that hold points.
    region: f64,
}

/// Lattice points per block of work.
const BLOCK: usize = 1024;

impl<const D: usize> Placement<'_, D> {
    fn horizon(&self, x: &Vector<D>) -> f64 {
        self.own_horizon.unwrap_or_else(|| self.p.horizon.at(x))
    }

    fn horizons(&self, position: &[Vector<D>]) -> Horizon {
        match self.own_horizon {
            Some(horizon) => Horizon::Uniform(horizon),
            None => self.p.horizon.of_points(position),
        }
    }

    fn in_void(&self, x: &Vector<D>) -> bool {
        let inside = |d: f64| d < -1e-9 * self.horizon(x);
        self.p.voids.iter().any(|v| inside(v.signed_distance(x)))
    }

    fn at_cells(&self) -> PointCloud<D> {
        let (mesh, zones, roles) = (self.mesh, self.zones, self.roles);
        let mut cloud = PointCloud::empty(0.0, self.region);
        for c in 0..mesh.cell_count() {
            let x = mesh.centroid(c);
            if (0..D).any(|i| x[i] < self.low[i] || x[i] > self.high[i]) || self.in_void(&x) {
                continue;
            }
            let carrier = match roles[c] {
                CellRole::Points => PointCarrier::Own,
                CellRole::Element | CellRole::StressElement => {
                    let n = mesh.cell(c).len();
                    PointCarrier::Element(c as u32, vec![1.0 / n as f64; n])
                }
            };
            let volume = fem::cell_volume(mesh, c);
            if carrier.is_own() {
                cloud.volumes.points += volume;
                cloud.spacing += volume;
            }
            cloud.push(x, volume, zones[c], carrier);
        }
        let sites = cloud.carrier.iter().filter(|c| c.is_own()).count().max(1);
        cloud.spacing = (cloud.spacing / sites as f64).powf(1.0 / D as f64);
        cloud.axes = lattice_axes(&cloud.position, &cloud.volume, cloud.spacing);
        cloud.horizon = self.horizons(&cloud.position);
        cloud
    }

    fn on_lattice(&self, h: f64, origin: Vector<D>) -> Result<PointCloud<D>, ModelError> {
        let sampler = LatticeSampler::new(self, LatticeBox::new(&self.low, &self.high, origin, h)?);
        let found: Vec<(Vec<Found<D>>, f64)> =
            parallel::map(sampler.lattice.total().div_ceil(BLOCK), 1, |block| {
                sampler.block(block)
            });
        Ok(self.cloud_of(found, h))
    }

    /// The cloud of what was found on a lattice, with the volume that voids take of each block.
    fn cloud_of(&self, found: Vec<(Vec<Found<D>>, f64)>, h: f64) -> PointCloud<D> {
        let whole = h.powi(D as i32);
        let mut cloud = PointCloud::empty(h, self.region);
        cloud.axes = Some(Tensor::identity());
        let region = self.region - found.iter().map(|(_, emptied)| emptied).sum::<f64>();
        let found: Vec<Found<D>> = found.into_iter().flat_map(|(list, _)| list).collect();
        let points: f64 = found.iter().map(|f| f.2).sum();
        // what sampling misses on curved edges is spread over the points whose cells the body's surface cuts
        let cut: f64 = found.iter().filter(|f| f.1 < whole).map(|f| f.2).sum();
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
        for (x, volume, share, zone, carrier) in found {
            let factor = if volume < whole { scale } else { 1.0 };
            cloud.volumes.points += share * factor;
            cloud.push(x, volume * factor, zone, carrier);
        }
        cloud.horizon = self.horizons(&cloud.position);
        cloud
    }
}

/// A point of a lattice: position, volume, how much of that lies in the region, zone, and the carrier of its displacement.
type Found<const D: usize> = (Vector<D>, f64, f64, Zone, PointCarrier);

/// Positions that are nearer than this, in sizes of a cell, lie in the cell.
const TOLERANCE: f64 = 1e-9;

/// Decides of each point of a lattice whether it is one of the body's, and how large its volume is.
struct LatticeSampler<'a, const D: usize> {
    place: &'a Placement<'a, D>,
    lattice: LatticeBox<D>,
    /// Elements, and cells of lattices that are placed later.
    elements: Locator<D>,
    /// Cells of lattices that are placed before.
    earlier: Locator<D>,
    nearest: Nearest<'a, D>,
    /// Cells of the region by zones: at a face that zones share, the zone that comes first here has the point.
    by_zone: [(Zone, Locator<D>); 3],
    /// Lattice cells that an edge of the region passes: their volume is sampled.
    edge: Vec<bool>,
    /// Points that are needed: not farther from the region than families reach.
    near: Vec<bool>,
    /// Samples along an edge of a cell.
    samples: usize,
    /// Volume of a whole cell of the lattice.
    whole: f64,
}

impl<'a, const D: usize> LatticeSampler<'a, D> {
    fn new(place: &'a Placement<'a, D>, lattice: LatticeBox<D>) -> Self {
        let (mesh, zones, roles) = (place.mesh, place.zones, place.roles);
        let cells = |keep: &dyn Fn(usize) -> bool| {
            Locator::new(mesh, (0..mesh.cell_count()).filter(|&c| keep(c)))
        };
        let is_earlier = |c: usize| place.earlier.get(c).is_some_and(|is| *is);
        let h = lattice.spacing();
        let mut sampler = Self {
            elements: cells(&|c| !place.mine[c] && !is_earlier(c)),
            earlier: cells(&is_earlier),
            nearest: Nearest::new(mesh, roles, h),
            by_zone: [Zone::Nonlocal, Zone::Transition, Zone::Local]
                .map(|zone| (zone, cells(&|c| place.mine[c] && zones[c] == zone))),
            edge: vec![false; lattice.total()],
            near: vec![false; lattice.total()],
            samples: if D == 3 { 4 } else { 8 },
            whole: h.powi(D as i32),
            place,
            lattice,
        };
        sampler.mark_edge();
        sampler.mark_near();
        sampler
    }

    /// Marks the lattice cells that an edge of the region passes.
    fn mark_edge(&mut self) {
        let Placement { mesh, ref mine, .. } = *self.place;
        let region_cells = (0..mesh.cell_count() as u32).filter(|&c| mine[c as usize]);
        for facet in mesh.boundary_facets(region_cells) {
            let (lo, hi) = mesh.bounds_of(&facet.nodes);
            self.lattice.mark(&mut self.edge, &lo, &hi);
        }
        for &c in mesh.embedded.pieces.keys().filter(|&&c| mine[c as usize]) {
            let (lo, hi) = mesh.bounds_of(mesh.cell(c as usize));
            self.lattice.mark(&mut self.edge, &lo, &hi);
        }
    }

    /// Marks the points that families of the region reach.
    fn mark_near(&mut self) {
        let Placement {
            mesh,
            roles,
            ref mine,
            margin,
            ..
        } = *self.place;
        let wanted = |c: u32| mine[c as usize] || roles[c as usize] == CellRole::StressElement;
        let cells = (0..mesh.cell_count() as u32).filter(|&c| wanted(c));
        for c in cells.clone() {
            let (lo, hi) = mesh.bounds_of(mesh.cell(c as usize));
            self.lattice.mark(&mut self.near, &lo, &hi);
        }
        for facet in mesh.boundary_facets(cells) {
            let (lo, hi) = mesh.bounds_of(&facet.nodes);
            let (lo, hi) = (lo - margin, hi + margin);
            self.lattice.mark(&mut self.near, &lo, &hi);
        }
    }

    /// The zone of the region's cell around a position.
    fn in_region(&self, x: &Vector<D>) -> Option<Zone> {
        self.by_zone
            .iter()
            .find(|(_, l)| l.holds(self.place.mesh, x, TOLERANCE))
            .map(|(z, _)| *z)
    }

    /// The points of a block of the lattice, and the volume of the region that voids take.
    fn block(&self, block: usize) -> (Vec<Found<D>>, f64) {
        let mut list = Vec::new();
        let mut emptied = 0.0;
        for index in block * BLOCK..((block + 1) * BLOCK).min(self.near.len()) {
            if self.near[index] {
                list.extend(self.point(index, &mut emptied));
            }
        }
        (list, emptied)
    }

    /// A point, if there is one here; adds the volume that voids take of its cell to `emptied`.
    fn point(&self, index: usize, emptied: &mut f64) -> Option<Found<D>> {
        let Placement {
            mesh, zones, roles, ..
        } = *self.place;
        let (whole, h) = (self.whole, self.lattice.spacing());
        let x = self.lattice.position(index);
        if self.place.in_void(&x) {
            let mut inside = 0;
            let samples = if self.edge[index] { self.samples } else { 1 };
            let count = samples_of::<D>(samples, |o| {
                inside += usize::from(self.in_region(&(x + o * h)).is_some());
            });
            *emptied += whole * inside as f64 / count as f64;
            return None;
        }
        let mut located = self.elements.locate(mesh, &x, TOLERANCE);
        let zone = match &located {
            Some(_) => None,
            None => self.in_region(&x),
        };
        if zone.is_none() && located.is_none() {
            located = self.earlier.locate(mesh, &x, TOLERANCE);
        }
        let zone = zone.or(located.as_ref().map(|l| zones[l.cell]));
        let zone = match (zone, self.place.beyond) {
            (Some(zone), _) => zone,
            (None, Beyond::Empty) => return None,
            (None, Beyond::Continued) => {
                let (cell, shape) = self.nearest.around(&x);
                return Some((
                    x,
                    whole,
                    0.0,
                    Zone::Local,
                    PointCarrier::Element(cell, shape),
                ));
            }
        };
        let (mut volume, mut share) = (whole, if located.is_none() { whole } else { 0.0 });
        if self.edge[index] {
            (volume, share) = self.sampled_volume(&x, emptied);
        }
        (volume > 0.0).then(|| {
            let carrier = match (located, self.place.beyond) {
                (None, _) => PointCarrier::Own,
                (Some(l), Beyond::Empty) if roles[l.cell] == CellRole::Points => {
                    PointCarrier::Lattice
                }
                (Some(l), _) if roles[l.cell] == CellRole::Points => {
                    let (cell, shape) = self.nearest.around(&x);
                    PointCarrier::Element(cell, shape)
                }
                (Some(l), _) => PointCarrier::Element(l.cell as u32, l.shape[..l.nodes].to_vec()),
            };
            (x, volume, share, zone, carrier)
        })
    }

    /// The volume of the body in the cell around `x`, and that of the region.
    fn sampled_volume(&self, x: &Vector<D>, emptied: &mut f64) -> (f64, f64) {
        let (whole, h) = (self.whole, self.lattice.spacing());
        let (mut body, mut here, mut gone) = (0, 0, 0);
        let count = samples_of::<D>(self.samples, |offset| {
            let s = x + offset * h;
            let inside = self.in_region(&s).is_some();
            if self.place.in_void(&s) {
                gone += usize::from(inside);
                return;
            }
            here += usize::from(inside);
            let mut others = [&self.elements, &self.earlier].into_iter();
            body += usize::from(inside || others.any(|l| l.holds(self.place.mesh, &s, TOLERANCE)));
        });
        *emptied += whole * gone as f64 / count as f64;
        (
            whole * body as f64 / count as f64,
            whole * here as f64 / count as f64,
        )
    }
}

/// The elements by their centroids, to extrapolate from the nearest.
struct Nearest<'a, const D: usize> {
    mesh: &'a Mesh<D>,
    cells: Vec<u32>,
    centres: Vec<Vector<D>>,
    bins: Bins<D>,
    /// Size of a bin, and of the mesh.
    sizes: [f64; 2],
}

impl<'a, const D: usize> Nearest<'a, D> {
    fn new(mesh: &'a Mesh<D>, roles: &[CellRole], spacing: f64) -> Self {
        let cells: Vec<u32> = (0..mesh.cell_count() as u32)
            .filter(|&c| roles[c as usize] != CellRole::Points)
            .collect();
        let centres: Vec<Vector<D>> = cells.iter().map(|&c| mesh.centroid(c as usize)).collect();
        let (low, high) = mesh.bounds();
        Self {
            mesh,
            bins: Bins::new(&centres, 4.0 * spacing),
            cells,
            centres,
            sizes: [4.0 * spacing, (high - low).norm()],
        }
    }

    /// The element whose centroid is nearest, with shape values that extrapolate affine fields exactly; no shape values if there is none.
    fn around(&self, x: &Vector<D>) -> (u32, Vec<f64>) {
        let mut radius = self.sizes[0];
        while radius < 4.0 * self.sizes[1] {
            let distance = |k: usize| (self.centres[k] - x).norm();
            let found = self
                .bins
                .around(x, radius)
                .filter(|&k| distance(k) <= radius)
                .min_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)));
            if let Some(k) = found {
                let c = self.cells[k];
                let shape = fem::reference_of(self.mesh, c as usize, x).map(|at| {
                    let (shape, count) = fem::shape_values(self.mesh, c as usize, &at);
                    shape[..count].to_vec()
                });
                return (c, shape.unwrap_or_default());
            }
            radius *= 2.0;
        }
        (0, Vec::new())
    }
}
