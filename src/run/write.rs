//! Results of a run as files: one VTU with cells and points together, and CSV along lines and at probes.

use std::path::PathBuf;

use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::RunOptions;
use super::point_cells::PointCells;
use super::sections;
use super::solution::Solved;
use super::stresses::{KnownStresses, Place, names};
use crate::coupling::{Carrier, Sampler, SiteKind, Zone};
use crate::fem::{self, Locator};
use crate::mesh::CellShape;
use crate::observe::ObserveError;
use crate::observe::csv::{Entry, write_table};
use crate::observe::summary::SectionForce;
use crate::observe::vtu::{Compression, Field, Snapshot, write_vtu};
use crate::scene::output::{PROBES, SECTIONS};
use crate::scene::spec::PointOutputSpec;
use crate::scene::validated::Output;
use crate::shape::Shape;
use crate::tensor::{Tensor, Vector, padded, strain};

/// Writes what the scene asks for; returns the files.
///
/// # Errors
/// [`ObserveError`] if a file cannot be written.
pub fn write<const D: usize>(
    output: &Output<D>,
    solved: &Solved<'_, D>,
) -> Result<Vec<PathBuf>, ObserveError> {
    write_for(output, solved, &RunOptions::default())
}

/// As [`write`], for a run with an observer: it sees the same, and says whether there are files.
pub(super) fn write_for<const D: usize>(
    output: &Output<D>,
    solved: &Solved<'_, D>,
    options: &RunOptions<'_>,
) -> Result<Vec<PathBuf>, ObserveError> {
    let mut files = Vec::new();
    let solution = Solution::new(solved);
    let path = |end: &str| output.directory.join(format!("{}{end}", output.name));
    let writes = output.vtu && options.writes();
    if writes || options.observer.is_some() {
        let energies = energy_densities(output, solved);
        let more = energies
            .as_deref()
            .map(|e| OverSites::Scalar(ENERGY_DENSITY, e));
        let shown = snapshot(solved, more.as_slice(), output.points, Shown::All);
        if writes {
            files.push(path(".vtu"));
            write_vtu(&files[0], &shown, Compression::Zlib)?;
        }
        if let Some(observer) = options.observer {
            shown.check(&path(".vtu"))?;
            observer.snapshot(shown);
        }
    }
    let mut tables: Vec<(&str, Vec<Vector<D>>)> = Vec::new();
    let lines = output.lines.iter();
    tables.extend(lines.map(|(name, positions)| (name.as_str(), positions.clone())));
    if !output.probes.is_empty() {
        let positions = output.probes.iter().map(|(_, x)| *x).collect();
        tables.push((PROBES, positions));
    }
    let sampled = tables.into_iter().map(|(name, positions)| {
        let (header, rows) = table(&positions, &solution);
        (name, header, rows)
    });
    let forces = solved.sections.iter().flat_map(SectionForce::numbers);
    let sections = (!solved.sections.is_empty()).then(|| {
        let header = sections::header(&output.sections);
        (SECTIONS, header, vec![forces.collect()])
    });
    for (name, header, rows) in sampled.chain(sections) {
        if let Some(observer) = options.observer {
            for row in &rows {
                let row: Vec<Entry> = row.iter().map(|&x| Entry::Real(x)).collect();
                observer.row(name, &header, &row);
            }
        }
        if options.writes() {
            let header: Vec<&str> = header.iter().map(String::as_str).collect();
            files.push(path(&format!("_{name}.csv")));
            write_table(&files[files.len() - 1], &header, rows.into_iter())?;
        }
    }
    Ok(files)
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// Columns and rows of a table along positions.
fn table<const D: usize>(
    positions: &[Vector<D>],
    solution: &Solution<'_, D>,
) -> (Vec<String>, Vec<Vec<f64>>) {
    let mut header: Vec<String> = AXES[..D].iter().map(|a| (*a).to_owned()).collect();
    header.extend(AXES[..D].iter().map(|a| format!("u{a}")));
    for (i, first) in AXES[..D].iter().enumerate() {
        header.extend(AXES[i..D].iter().map(|second| format!("e{first}{second}")));
    }
    if solution.solved.has_derived() {
        header.extend(names::<D>(solution.solved.asked()));
    }
    header.push("model".to_owned());
    let samples: Vec<Option<Sample<D>>> = positions.par_iter().map(|x| solution.at(x)).collect();
    let told = positions.iter().zip(samples).filter_map(|(x, sample)| {
        // a line may cross a slit: there is nothing to tell in it
        let sample = sample?;
        let e = strain(&sample.gradient);
        let mut row: Vec<f64> = x
            .iter()
            .chain(sample.displacement.iter())
            .copied()
            .collect();
        for i in 0..D {
            row.extend((i..D).map(|j| e[(i, j)]));
        }
        if let Some((stress, derived)) = &sample.stress {
            for i in 0..D {
                row.extend((i..D).map(|j| stress[(i, j)]));
            }
            row.extend(derived);
        }
        row.push(f64::from(label(sample.zone)));
        Some(row)
    });
    let rows = told.collect();
    (header, rows)
}

/// 0 local, 1 transition, 2 nonlocal.
fn label(zone: Zone) -> u8 {
    match zone {
        Zone::Local => 0,
        Zone::Transition => 1,
        Zone::Nonlocal => 2,
    }
}

struct Sample<const D: usize> {
    displacement: Vector<D>,
    gradient: Tensor<D>,
    zone: Zone,
    /// The stress and the numbers made of it, if they are asked for.
    stress: Option<(Tensor<D>, Vec<f64>)>,
}

/// The solution at sites and between them.
struct Solution<'a, const D: usize> {
    solved: &'a Solved<'a, D>,
    intact: Intact,
    known: KnownStresses,
    sampler: Sampler<'a, D>,
    body: Locator<D>,
    tolerance: f64,
}

impl<'a, const D: usize> Solution<'a, D> {
    fn new(solved: &'a Solved<'a, D>) -> Self {
        let model = solved.model;
        let (lo, hi) = model.mesh.bounds();
        Self {
            solved,
            intact: Intact::of(solved),
            known: match solved.has_derived() {
                true => KnownStresses::of(solved),
                false => KnownStresses::default(),
            },
            sampler: Sampler::new(model),
            body: Locator::new(&model.mesh, 0..model.mesh.cell_count()),
            tolerance: 1e-9 * (hi - lo).norm(),
        }
    }

    /// Whether a position lies in the mesh and in no void.
    fn is_inside(&self, x: &Vector<D>) -> bool {
        let model = self.solved.model;
        let in_void = model.peridynamics.as_ref().is_some_and(|p| {
            let inside = |v: &Shape<D>| v.signed_distance(x) < -self.tolerance;
            p.voids.iter().any(inside)
        });
        !in_void && self.body.locate(&model.mesh, x, self.tolerance).is_some()
    }

    /// In an element its strain; among points that of the nearest point's family. `None` outside of the body.
    fn at(&self, x: &Vector<D>) -> Option<Sample<D>> {
        if !self.is_inside(x) {
            return None;
        }
        let displacement = self.sampler.displacement(x, self.solved.displacement)?;
        let solved = self.solved;
        let carrier = self.sampler.carrier(x)?;
        let stress = solved
            .has_derived()
            .then(|| solved.carried_stress(carrier, &self.known, &self.intact));
        let (gradient, zone) = match carrier {
            Carrier::Element(c) => (solved.element_gradient(c), solved.model.zones[c]),
            Carrier::Point(site) => (
                solved.point_gradient(site, &self.intact),
                solved.zone_of_site[site],
            ),
        };
        Some(Sample {
            displacement,
            gradient,
            zone,
            stress,
        })
    }
}

/// Which bonds between points stand.
pub(super) struct Intact(FxHashSet<(u32, u32)>);

impl Intact {
    pub fn of<const D: usize>(solved: &Solved<'_, D>) -> Self {
        let sites = &solved.model.sites;
        let point = |site: u32| match sites[site as usize].kind {
            SiteKind::Point(p) => Some(p),
            SiteKind::Node(_) => None,
        };
        let broken = solved.broken.iter();
        Self(
            broken
                .filter_map(|&(i, j)| point(i).zip(point(j)))
                .collect(),
        )
    }

    fn is_intact(&self, i: usize, j: usize) -> bool {
        self.0.is_empty() || !self.0.contains(&(i as u32, j as u32))
    }
}

impl<const D: usize> Solved<'_, D> {
    fn node(&self, n: usize) -> Vector<D> {
        let transfer = &self.model.node_transfer;
        transfer.displacement(n, self.displacement)
    }

    fn site(&self, site: usize) -> Vector<D> {
        Vector::from_column_slice(&self.displacement[site * D..][..D])
    }

    fn element_gradient(&self, c: usize) -> Tensor<D> {
        fem::displacement_gradient_at_centre(&self.model.mesh, c, |n| self.node(n))
    }

    /// Stress of what carries a position, and the numbers made of it.
    pub(super) fn carried_stress(
        &self,
        carrier: Carrier,
        known: &KnownStresses,
        intact: &Intact,
    ) -> (Tensor<D>, Vec<f64>) {
        let (stress, place) = match carrier {
            Carrier::Element(c) => {
                let gradient = self.element_gradient(c);
                (self.cell_stress(c, &gradient, known), Place::Cell(c))
            }
            Carrier::Point(site) => {
                let stands = |p, j| intact.is_intact(p, j);
                let stress = self.point_stress(site, stands, known);
                (stress, Place::Point(site))
            }
        };
        (stress, self.derived(&stress, place))
    }

    /// Least-squares gradient over the nearest bonds of a point that stand, weighted by 1/|ξ|²: sharper than over the whole family. Zero where they do not span the space.
    fn point_gradient(&self, site: usize, intact: &Intact) -> Tensor<D> {
        let Some((body, p)) = self.model.point_of(site) else {
            return Tensor::zeros();
        };
        let here = self.site(site);
        let bonds: Vec<(Vector<D>, usize)> = body
            .families
            .of(p)
            .iter()
            .filter(|&&j| intact.is_intact(p, j as usize))
            .map(|&j| (body.bond(p, j as usize), j as usize))
            .collect();
        let nearest = bonds
            .iter()
            .map(|(xi, _)| xi.norm())
            .fold(f64::INFINITY, f64::min);
        // the full family where the nearest shells do not span the space
        for reach in [1.5 * nearest, f64::INFINITY] {
            let (mut shape, mut moment) = (Tensor::<D>::zeros(), Tensor::<D>::zeros());
            for (xi, j) in bonds.iter().filter(|(xi, _)| xi.norm() <= reach) {
                let w = 1.0 / xi.norm_squared();
                let eta: Vector<D> =
                    body.cloud.transfer.displacement::<D>(*j, self.displacement) - here;
                shape += xi * xi.transpose() * w;
                moment += eta * xi.transpose() * w;
            }
            if let Ok(inverse) = crate::peridynamics::invert_shape_tensor(&shape, bonds.len()) {
                return moment * inverse;
            }
        }
        Tensor::zeros()
    }
}

/// Which cells and points a file shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// All.
    All,
    /// Every so many: a sample, to tell how long all take.
    Every(usize),
}

impl Shown {
    fn includes(self, number: usize) -> bool {
        match self {
            Self::All => true,
            Self::Every(n) => number.is_multiple_of(n.max(1)),
        }
    }
}

/// A field over sites, beside those that every solution has.
#[derive(Clone, Copy, Debug)]
pub enum OverSites<'a> {
    /// A vector, like the displacement.
    Vector(&'static str, &'a [f64]),
    /// A number, zero at nodes that are no sites.
    Scalar(&'static str, &'a [f64]),
}

/// The name of the field of [`energy_densities`].
pub(super) const ENERGY_DENSITY: &str = "energy-density";

/// The energy density of each site, zero at nodes, if the scene asks for it.
pub(super) fn energy_densities<const D: usize>(
    output: &Output<D>,
    solved: &Solved<'_, D>,
) -> Option<Vec<f64>> {
    let u = solved.displacement;
    let of_site = |intact: &Intact, site: usize| match solved.model.point_of(site) {
        Some((body, p)) => body.energy_density(p, u, |j| intact.is_intact(p, j)),
        None => 0.0,
    };
    output.energy_density.then(|| {
        let told = solved.system.and_then(|system| system.energy_densities(u));
        told.unwrap_or_else(|| {
            let intact = Intact::of(solved);
            let sites = (0..solved.model.sites.len()).into_par_iter();
            sites.map(|site| of_site(&intact, site)).collect()
        })
    })
}

/// Cells and points with the fields of a solution; without a residual, that field is left out.
pub fn snapshot<const D: usize>(
    solved: &Solved<'_, D>,
    more: &[OverSites<'_>],
    points: PointOutputSpec,
    shown: Shown,
) -> Snapshot {
    let mut rows = SnapshotRows::new(solved);
    rows.push_elements(shown);
    rows.push_points(points, shown);
    rows.snapshot.point_fields = rows.point_fields(more);
    rows.snapshot.cell_fields = rows.cell_fields();
    rows.snapshot
}

/// Points and cells of a file with their fields as they are collected: nodes that elements use and elements, then peridynamic points, or the corners of their cells, and those cells.
struct SnapshotRows<'a, const D: usize> {
    solved: &'a Solved<'a, D>,
    snapshot: Snapshot,
    /// The site of each point of the file, and its node.
    site_of_point: Vec<Option<usize>>,
    node_of_point: Vec<Option<usize>>,
    displacement: Vec<Vector<D>>,
    /// The spacing at each point of the file, zero at nodes of elements.
    sizes: Vec<f64>,
    zones: Vec<u8>,
    volumes: Vec<f64>,
    /// The material of each cell; empty if all are of one.
    materials: Vec<i32>,
    strains: Vec<Tensor<D>>,
    stresses: Vec<Tensor<D>>,
    shown_cells: Vec<u32>,
    known: KnownStresses,
    places: Vec<Place>,
}

impl<'a, const D: usize> SnapshotRows<'a, D> {
    fn new(solved: &'a Solved<'a, D>) -> Self {
        Self {
            solved,
            snapshot: Snapshot::default(),
            site_of_point: Vec::new(),
            node_of_point: Vec::new(),
            displacement: Vec::new(),
            sizes: Vec::new(),
            zones: Vec::new(),
            volumes: Vec::new(),
            materials: Vec::new(),
            strains: Vec::new(),
            stresses: Vec::new(),
            shown_cells: Vec::new(),
            known: KnownStresses::of(solved),
            places: Vec::new(),
        }
    }

    /// Elements with strain and stress at their centres, and their nodes.
    fn push_elements(&mut self, shown: Shown) {
        let solved = self.solved;
        let (model, mesh) = (solved.model, &solved.model.mesh);
        let mut point_of_node = vec![u32::MAX; mesh.nodes.len()];
        let mut site_of_node = vec![None; mesh.nodes.len()];
        for (site, s) in model.sites.iter().enumerate() {
            if let SiteKind::Node(n) = s.kind {
                site_of_node[n as usize] = Some(site);
            }
        }
        for c in (0..mesh.cell_count()).filter(|&c| shown.includes(c) && model.is_element(c)) {
            let mut nodes = [0u32; fem::MAX_NODES];
            for (slot, &n) in nodes.iter_mut().zip(mesh.cell(c)) {
                let entry = &mut point_of_node[n as usize];
                if *entry == u32::MAX {
                    *entry = self.snapshot.points.len() as u32;
                    self.snapshot.points.push(padded(&mesh.nodes[n as usize]));
                    self.displacement.push(solved.node(n as usize));
                    self.sizes.push(0.0);
                    self.site_of_point.push(site_of_node[n as usize]);
                    self.node_of_point.push(Some(n as usize));
                }
                *slot = *entry;
            }
            self.snapshot
                .push_cell(mesh.shapes[c], &nodes[..mesh.cell(c).len()]);
            self.zones.push(label(model.zones[c]));
            self.volumes.push(fem::cell_volume(mesh, c));
            if model.several().is_some() {
                self.materials.push(i32::from(model.material_of_cell(c)));
            }
            let gradient = solved.element_gradient(c);
            self.strains.push(strain(&gradient));
            let stress = solved.cell_stress(c, &gradient, &self.known);
            self.stresses.push(stress);
            self.places.push(Place::Cell(c));
            self.shown_cells.push(c as u32);
        }
    }

    /// Peridynamic points with strain and stress of their families.
    fn push_points(&mut self, form: PointOutputSpec, shown: Shown) {
        let solved = self.solved;
        let model = solved.model;
        let cells = PointCells::of(model);
        let intact = Intact::of(solved);
        let known = &self.known;
        let on_points: Vec<(usize, Tensor<D>, Tensor<D>)> = (0..model.sites.len())
            .into_par_iter()
            .filter(|&site| {
                shown.includes(site) && matches!(model.sites[site].kind, SiteKind::Point(_))
            })
            .map(|site| {
                let stress = solved.point_stress(site, |p, j| intact.is_intact(p, j), known);
                (site, strain(&solved.point_gradient(site, &intact)), stress)
            })
            .collect();
        for (site, e, stress) in on_points {
            let Some((body, p)) = model.point_of(site) else {
                continue;
            };
            let x = &model.sites[site].position;
            let (shape, corners) = match form {
                PointOutputSpec::Vertices => (CellShape::Vertex, vec![padded(x)]),
                PointOutputSpec::Cells => cells.cell(p, x),
            };
            let first = self.snapshot.points.len() as u32;
            let numbers: Vec<u32> = (first..first + corners.len() as u32).collect();
            self.snapshot.push_cell(shape, &numbers);
            for corner in corners {
                self.snapshot.points.push(corner);
                self.displacement.push(solved.site(site));
                self.sizes.push(cells.size(p));
                self.site_of_point.push(Some(site));
                self.node_of_point.push(None);
            }
            self.zones.push(label(solved.zone_of_site[site]));
            self.volumes.push(body.cloud.volume[p]);
            let material = body.cloud.material.get(p);
            self.materials.extend(material.map(|&m| i32::from(m)));
            self.strains.push(e);
            self.stresses.push(stress);
            self.places.push(Place::Point(site));
        }
    }

    /// Displacement, blending, horizon, spacing and residual, and `more` fields over sites.
    fn point_fields(&self, more: &[OverSites<'_>]) -> Vec<Field> {
        let solved = self.solved;
        let model = solved.model;
        let of_site = |f: &dyn Fn(usize) -> f64| -> Vec<f64> {
            self.site_of_point
                .iter()
                .map(|s| s.map_or(0.0, f))
                .collect()
        };
        // a local site has none
        let horizon = |site: usize| match (&model.peridynamics, solved.zone_of_site[site]) {
            (None, _) | (_, Zone::Local) => 0.0,
            (Some(p), _) => (p.horizon)(&model.sites[site].position),
        };
        let on_site =
            |s: usize, values: &[f64]| Vector::<D>::from_column_slice(&values[s * D..][..D]);
        let mut fields = vec![
            Field::vector("displacement", &self.displacement),
            Field::scalar("beta", of_site(&|s| solved.operator.beta(s))),
            Field::scalar("horizon", of_site(&horizon)),
            Field::scalar("size", self.sizes.clone()),
        ];
        if !solved.residual.is_empty() {
            let residual: Vec<Vector<D>> = self
                .site_of_point
                .iter()
                .map(|s| s.map_or(Vector::zeros(), |s| on_site(s, solved.residual)))
                .collect();
            fields.push(Field::vector("residual", &residual));
        }
        for field in more {
            fields.push(match field {
                OverSites::Scalar(name, values) => Field::scalar(name, of_site(&|s| values[s])),
                OverSites::Vector(name, values) => {
                    let at = |(site, node): (&Option<usize>, &Option<usize>)| match (site, node) {
                        (_, Some(n)) => model.node_transfer.displacement(*n, values),
                        (Some(s), None) => on_site(*s, values),
                        (None, None) => Vector::zeros(),
                    };
                    let places = self.site_of_point.iter().zip(&self.node_of_point);
                    let vectors: Vec<Vector<D>> = places.map(at).collect();
                    Field::vector(name, &vectors)
                }
            });
        }
        fields
    }

    /// Model, volume, strain and stress, and what local laws remember.
    fn cell_fields(&self) -> Vec<Field> {
        let shown = self.zones.len();
        let mut fields = vec![
            Field::labels("model", self.zones.clone()),
            Field::scalar("volume", self.volumes.clone()),
            Field::tensor("strain", &self.strains),
            Field::tensor("stress", &self.stresses),
        ];
        let derived: Vec<Vec<f64>> = match self.solved.has_derived() {
            true => {
                let each = self.stresses.par_iter().zip(&self.places);
                each.map(|(s, place)| self.solved.derived(s, *place))
                    .collect()
            }
            false => Vec::new(),
        };
        for (k, name) in self.solved.derived_names().into_iter().enumerate() {
            let values = derived.iter().map(|d| d[k]).collect();
            fields.push(Field::scalar(name, values));
        }
        if !self.materials.is_empty() {
            fields.push(Field::integers("material", self.materials.clone()));
        }
        let remembered = self
            .solved
            .system
            .map(|system| system.remembered_by_cells());
        for (name, values) in remembered.into_iter().flatten() {
            let values: FxHashMap<u32, f64> = values.into_iter().collect();
            let mut field = vec![0.0; shown];
            for (value, c) in field.iter_mut().zip(&self.shown_cells) {
                *value = values.get(c).copied().unwrap_or(0.0);
            }
            fields.push(Field::scalar(name, field));
        }
        fields
    }
}
