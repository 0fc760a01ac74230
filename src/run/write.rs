//! Results of a run as files: one VTU with cells and points together, and CSV along lines and at probes.

use std::cell::LazyCell;
use std::path::{Path, PathBuf};

use rustc_hash::FxHashMap;

use super::RunOptions;
use super::loads::site_of_node;
use super::pieces::Piece;
use super::point_cells::PointCells;
use super::sections;
use super::solution::Solved;
use super::solution_samples::{Intact, SampledSolution, label, table_header};
use super::stresses::{self, Expansions, Stress};
use crate::fem;
use crate::mesh::CellShape;
use crate::observe::ObserveError;
use crate::observe::csv::{Entry, write_table};
use crate::observe::pieces::{PieceFiles, agreed, write_pieces};
use crate::observe::summary::SectionForce;
use crate::observe::vtu::{Compression, Field, Snapshot, write_vtu};
use crate::scene::output::{PROBES, SECTIONS};
use crate::scene::spec::PointOutputSpec;
use crate::scene::validated::Output;
use crate::system::Ranks;
use crate::tensor::{Tensor, Vector, padded, strain};
use crate::{coupling::Zone, parallel};

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
    let solution = LazyCell::new(|| SampledSolution::new(solved, options.ranks));
    let path = |end: &str| output.directory.join(format!("{}{end}", output.name));
    let whole = path(".vtu");
    let of = |shown: Shown<'_>| {
        let energies = energy_densities(output, solved, shown);
        let more = energies
            .as_deref()
            .map(|e| OverSites::Scalar(ENERGY_DENSITY, e));
        snapshot(solved, more.as_slice(), output.points, shown)
    };
    let mut written = None;
    if let Some(ranks) = options.writers().filter(|_| output.vtu) {
        let piece = Piece::new(solved.model, output.points, ranks);
        files.push(replaced_by_pieces(
            &whole,
            &of(Shown::Piece(&piece)),
            ranks,
        )?);
    } else if output.vtu && options.writes() {
        let shown = of(Shown::All);
        write_vtu(&whole, &shown, Compression::Zlib)?;
        PieceFiles::new(&whole).remove()?;
        files.push(whole.clone());
        written = Some(shown);
    }
    if let Some(observer) = options.observer {
        let shown = written.unwrap_or_else(|| of(Shown::All));
        shown.check(&whole)?;
        observer.snapshot(shown);
    }
    let mut tables: Vec<(&str, Vec<Vector<D>>)> = Vec::new();
    let lines = output.lines.iter();
    tables.extend(lines.map(|(name, positions)| (name.as_str(), positions.clone())));
    if !output.probes.is_empty() {
        let positions = output.probes.iter().map(|(_, x)| *x).collect();
        tables.push((PROBES, positions));
    }
    let sampled = tables.into_iter().map(|(name, positions)| {
        let header = table_header::<D>(solved.stress_output());
        (name, header, solution.rows(&positions))
    });
    // by all processes before one writes, which may fail
    let sampled: Vec<_> = sampled.collect();
    let forces = solved.sections.iter().flat_map(SectionForce::numbers);
    let sections = (!solved.sections.is_empty()).then(|| {
        let header = sections::header(&output.sections);
        (SECTIONS, header, vec![forces.collect()])
    });
    for (name, header, rows) in sampled.into_iter().chain(sections) {
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

/// Collective: writes a piece of each process and the list over them, in place of a file of one process and of pieces that lay here; returns the list.
///
/// # Errors
/// The error of the first process that could not write, on all.
fn replaced_by_pieces(
    whole: &Path,
    own: &Snapshot,
    ranks: &dyn Ranks,
) -> Result<PathBuf, ObserveError> {
    let files = PieceFiles::new(whole);
    let is_first = ranks.rank() == 0;
    // a list that lay here would name pieces of both
    let removed = if is_first { files.remove() } else { Ok(()) };
    agreed(Some(ranks), removed, whole)?;
    write_pieces(whole, own, ranks)?;
    if is_first {
        // most often there is none
        let _ = std::fs::remove_file(whole);
    }
    Ok(files.list())
}

/// Which cells and points a file shows.
#[derive(Clone, Copy, Debug)]
pub enum Shown<'a> {
    /// All.
    All,
    /// Every so many: a sample, to tell how long all take.
    Every(usize),
    /// Those of one of several processes, with their numbers among all.
    Piece(&'a Piece),
}

impl Shown<'_> {
    fn includes_cell(self, c: usize) -> bool {
        match self {
            Self::All => true,
            Self::Every(n) => c.is_multiple_of(n.max(1)),
            Self::Piece(piece) => piece.cell(c).is_some(),
        }
    }

    fn includes_site(self, site: usize) -> bool {
        match self {
            Self::All => true,
            Self::Every(n) => site.is_multiple_of(n.max(1)),
            Self::Piece(piece) => piece.site(site).is_some(),
        }
    }
}

/// The field of the number of each point in the file that one process writes, named as VTK's filters name it; in pieces only.
const POINT_IDENTIFIER: &str = "GlobalPointIds";

/// The field of the number of each cell.
const CELL_IDENTIFIER: &str = "GlobalCellIds";

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

/// The energy density of each site that is shown, zero at nodes, if the scene asks for it.
pub(super) fn energy_densities<const D: usize>(
    output: &Output<D>,
    solved: &Solved<'_, D>,
    shown: Shown<'_>,
) -> Option<Vec<f64>> {
    let u = solved.displacement;
    let of_site = |intact: &Intact, site: usize| match solved.model.point_of(site) {
        Some((body, p)) if shown.includes_site(site) => {
            body.energy_density(p, u, |j| intact.is_intact(p, j))
        }
        _ => 0.0,
    };
    output.energy_density.then(|| {
        let told = solved.system.and_then(|system| system.energy_densities(u));
        told.unwrap_or_else(|| {
            let intact = Intact::of(solved);
            parallel::map(solved.model.sites.len(), 1, |site| of_site(&intact, site))
        })
    })
}

/// Cells and points with the fields of a solution; without a residual, that field is left out.
pub fn snapshot<const D: usize>(
    solved: &Solved<'_, D>,
    more: &[OverSites<'_>],
    points: PointOutputSpec,
    shown: Shown<'_>,
) -> Snapshot {
    let mut rows = SnapshotRows::new(solved);
    rows.push_elements(shown);
    rows.push_points(points, shown);
    rows.snapshot.point_fields = rows.point_fields(more);
    rows.snapshot.cell_fields = rows.cell_fields();
    if let Shown::Piece(_) = shown {
        let [points, cells] = rows.identifiers;
        let of_points = Field::identifiers(POINT_IDENTIFIER, points);
        rows.snapshot.point_fields.push(of_points);
        let of_cells = Field::identifiers(CELL_IDENTIFIER, cells);
        rows.snapshot.cell_fields.push(of_cells);
    }
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
    /// The material of each cell, where there are several.
    materials: Vec<i32>,
    strains: Vec<Tensor<D>>,
    stresses: Vec<Stress<D>>,
    /// The measure of each.
    measures: Vec<u8>,
    shown_cells: Vec<u32>,
    expansions: Expansions,
    /// Numbers of points and of cells among those of all processes; empty where one shows all.
    identifiers: [Vec<i64>; 2],
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
            measures: Vec::new(),
            shown_cells: Vec::new(),
            expansions: Expansions::of(solved),
            identifiers: [const { Vec::new() }; 2],
        }
    }

    /// Elements with strain and stress at their centres, and their nodes.
    fn push_elements(&mut self, shown: Shown<'_>) {
        let solved = self.solved;
        let (model, mesh) = (solved.model, &solved.model.mesh);
        let mut point_of_node = vec![u32::MAX; mesh.nodes.len()];
        let site_of_node = site_of_node(model);
        for c in 0..mesh.cell_count() {
            if !shown.includes_cell(c) || !model.is_element(c) {
                continue;
            }
            let mut nodes = [0u32; fem::MAX_NODES];
            for (slot, &n) in nodes.iter_mut().zip(mesh.cell(c)) {
                let entry = &mut point_of_node[n as usize];
                if *entry == u32::MAX {
                    *entry = self.snapshot.points.len() as u32;
                    self.snapshot.points.push(padded(&mesh.nodes[n as usize]));
                    self.displacement.push(solved.node(n as usize));
                    self.sizes.push(0.0);
                    let site = site_of_node[n as usize];
                    self.site_of_point.push(site.map(|site| site as usize));
                    self.node_of_point.push(Some(n as usize));
                    if let Shown::Piece(piece) = shown {
                        self.identifiers[0].push(piece.node(n as usize).into());
                    }
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
            let stress = solved.cell_stress(c, &gradient, &self.expansions);
            self.stresses.push(stress);
            self.measures.push(solved.measure_of_cell(c));
            self.shown_cells.push(c as u32);
            if let Shown::Piece(piece) = shown {
                self.identifiers[1].extend(piece.cell(c).map(i64::from));
            }
        }
    }

    /// Peridynamic points with strain and stress of their families.
    fn push_points(&mut self, form: PointOutputSpec, shown: Shown<'_>) {
        let solved = self.solved;
        let model = solved.model;
        let cells = PointCells::of(model);
        let intact = Intact::of(solved);
        let expansions = &self.expansions;
        let on_points: Vec<(usize, Tensor<D>, Stress<D>)> =
            parallel::filter_map(model.sites.len(), 1, |site| {
                let (_, p) = model.point_of(site)?;
                if !shown.includes_site(site) {
                    return None;
                }
                let stress = solved.point_stress(site, |p, j| intact.is_intact(p, j), expansions);
                Some((site, strain(&solved.point_gradient(p, &intact)), stress))
            });
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
            let count = corners.len() as u32;
            let numbers: Vec<u32> = (first..first + count).collect();
            self.snapshot.push_cell(shape, &numbers);
            if let Shown::Piece(piece) = shown
                && let Some([cell, corner]) = piece.site(site)
            {
                let [points, cells] = &mut self.identifiers;
                points.extend((corner..corner + count).map(i64::from));
                cells.push(cell.into());
            }
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
            self.measures.push(solved.measure_of_point(p));
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
            (Some(p), _) => p.horizon.at(&model.sites[site].position),
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
            Field::rows(
                self.solved.stress_name(),
                self.stresses.iter().map(Stress::rows),
            ),
        ];
        if self.solved.has_cauchy_stresses() {
            fields.push(Field::labels("stress_measure", self.measures.clone()));
        }
        let output = self.solved.stress_output();
        let derived: Vec<Vec<f64>> = match self.solved.has_derived() {
            true => parallel::map(shown, 1, |k| self.stresses[k].derived(output)),
            false => Vec::new(),
        };
        for (k, number) in output.numbers.iter().enumerate() {
            let values = derived.iter().map(|d| d[k]).collect();
            fields.push(Field::scalar(stresses::name(number), values));
        }
        let model = self.solved.model;
        let by_points = model.body().is_some_and(|b| !b.cloud.material.is_empty());
        // also in a piece that shows nothing, whose fields stand for those of others
        if model.several().is_some() || by_points {
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
