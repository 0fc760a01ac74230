//! Results of a run as files: one VTU with cells and points together, and CSV along lines and at probes.

use std::cell::LazyCell;
use std::path::{Path, PathBuf};

use rustc_hash::FxHashMap;

use super::RunOptions;
use super::bonds;
use super::fields::On;
use super::fields::columns::arrays;
use super::fields::place::{Shared, Spot};
use super::loads::site_of_node;
use super::parts::ElementParts;
use super::pieces::Piece;
use super::point_cells::PointCells;
use super::sections;
use super::solution::Solved;
use super::solution_samples::{SampledSolution, table_header};
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
use crate::tensor::{Vector, padded};

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
    let of = |shown: Shown<'_>| snapshot(solved, &[], output, shown);
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
        for selection in &output.bonds {
            let file = path(&format!("{}.vtu", selection.stem("")));
            let lines = bonds::snapshot(solved, selection, &output.origin);
            write_vtu(&file, &lines, Compression::Zlib)?;
            files.push(file);
        }
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
        let header = table_header::<D>(solved.choice());
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

/// Selection of cells and points that a file shows.
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

/// Memory of laws at sites: a name, and a number for each, zero at nodes that are no sites.
pub type Remembered<'a> = (&'static str, &'a [f64]);

/// Cells and points with the fields of a solution; without a residual, that field is left out.
pub fn snapshot<const D: usize>(
    solved: &Solved<'_, D>,
    remembered: &[Remembered<'_>],
    output: &Output<D>,
    shown: Shown<'_>,
) -> Snapshot {
    let mut rows = SnapshotRows::new(solved);
    rows.snapshot.origin.clone_from(&output.origin);
    rows.push_elements(shown);
    rows.push_points(output.points, shown);
    let shared = Shared::of(solved);
    rows.snapshot.point_fields = arrays(solved, &shared, On::Points, &rows.points);
    rows.push_remembered_by_sites(remembered);
    rows.snapshot.cell_fields = arrays(solved, &shared, On::Cells, &rows.cells);
    rows.push_remembered_by_cells();
    if let Shown::Piece(_) = shown {
        let [points, cells] = rows.identifiers;
        let of_points = Field::identifiers(POINT_IDENTIFIER, points);
        rows.snapshot.point_fields.push(of_points);
        let of_cells = Field::identifiers(CELL_IDENTIFIER, cells);
        rows.snapshot.cell_fields.push(of_cells);
    }
    rows.snapshot
}

/// Points and cells of a file as they are collected: nodes that elements use, corners of parts of elements, and elements and parts, then peridynamic points, or the corners of their cells, and those cells.
struct SnapshotRows<'a, const D: usize> {
    solved: &'a Solved<'a, D>,
    snapshot: Snapshot,
    /// Node, place in an element or point behind each point of the file.
    points: Vec<Spot>,
    /// Element or point behind each cell.
    cells: Vec<Spot>,
    /// Numbers of points and of cells among those of all processes; empty where one shows all.
    identifiers: [Vec<i64>; 2],
}

impl<'a, const D: usize> SnapshotRows<'a, D> {
    fn new(solved: &'a Solved<'a, D>) -> Self {
        Self {
            solved,
            snapshot: Snapshot::default(),
            points: Vec::new(),
            cells: Vec::new(),
            identifiers: [const { Vec::new() }; 2],
        }
    }

    /// Elements and their nodes; of those that are cut the part that is left, in simplices.
    fn push_elements(&mut self, shown: Shown<'_>) {
        let (model, mesh) = (self.solved.model, &self.solved.model.mesh);
        let mut point_of_node = vec![u32::MAX; mesh.nodes.len()];
        let site_of_node = site_of_node(model);
        let cells = || (0..mesh.cell_count()).filter(|&c| shown.includes_cell(c));
        let parts = ElementParts::of(model, cells());
        let mut corners = Vec::new();
        for c in cells().filter(|&c| model.is_element(c)) {
            let cut = parts.get(&(c as u32));
            corners.clear();
            for &n in cut.map_or(mesh.cell(c), |cut| &cut.nodes) {
                let node = n as usize;
                let entry = &mut point_of_node[node];
                if *entry == u32::MAX {
                    *entry = self.snapshot.points.len() as u32;
                    self.snapshot.points.push(padded(&mesh.nodes[node]));
                    let site = site_of_node[node].map(|site| site as usize);
                    self.points.push(Spot::Node { node, site });
                    if let Shown::Piece(piece) = shown {
                        self.identifiers[0].push(piece.node(node).into());
                    }
                }
                corners.push(*entry);
            }
            match cut {
                None => {
                    self.snapshot.push_cell(mesh.shapes[c], &corners);
                    self.cells.push(Spot::Element(c));
                }
                Some(cut) => self.push_parts((c, cut), &mut corners, shown),
            }
            if let Shown::Piece(piece) = shown {
                let count = cut.map_or(1, |cut| cut.simplices.len()) as i64;
                let first = piece.cell(c).map(i64::from);
                self.identifiers[1].extend(first.into_iter().flat_map(|n| n..n + count));
            }
        }
    }

    /// The part of a cut element that is left; `corners` are the points of its nodes there.
    fn push_parts(
        &mut self,
        (c, cut): (usize, &ElementParts<D>),
        corners: &mut Vec<u32>,
        shown: Shown<'_>,
    ) {
        for (k, (x, spot)) in cut.corners.iter().enumerate() {
            corners.push(self.snapshot.points.len() as u32);
            self.snapshot.points.push(padded(x));
            self.points.push(*spot);
            if let Shown::Piece(piece) = shown {
                let first = i64::from(piece.corner(c));
                self.identifiers[0].push(first + k as i64);
            }
        }
        for (simplex, volume) in &cut.simplices {
            let own = simplex.map(|k| corners[k]);
            self.snapshot
                .push_cell(ElementParts::<D>::SHAPE, &own[..=D]);
            self.cells.push(Spot::Part(c, *volume));
        }
    }

    /// Peridynamic points.
    fn push_points(&mut self, form: PointOutputSpec, shown: Shown<'_>) {
        let model = self.solved.model;
        let cells = PointCells::of(model);
        for site in 0..model.sites.len() {
            let Some((_, p)) = model.point_of(site).filter(|_| shown.includes_site(site)) else {
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
            let spots = corners.iter().map(|_| Spot::Point(site));
            self.points.extend(spots);
            self.snapshot.points.extend(corners);
            self.cells.push(Spot::Point(site));
        }
    }

    /// Adds the memory of laws at points.
    fn push_remembered_by_sites(&mut self, remembered: &[Remembered<'_>]) {
        for (name, values) in remembered {
            let of = |spot: &Spot| self.solved.scalar_at(*spot, |site| values[site]);
            let field = Field::scalar(name, self.points.iter().map(of).collect());
            self.snapshot.point_fields.push(field);
        }
    }

    /// Adds the memory of local laws in elements.
    fn push_remembered_by_cells(&mut self) {
        let state = self.solved.state().into_iter();
        for (name, values) in state.flat_map(|state| state.remembered_by_cells()) {
            let values: FxHashMap<u32, f64> = values.into_iter().collect();
            let of = |spot: &Spot| match *spot {
                Spot::Element(c) | Spot::Part(c, _) => {
                    values.get(&(c as u32)).copied().unwrap_or(0.0)
                }
                Spot::Node { .. } | Spot::InElement(..) | Spot::Point(_) => 0.0,
            };
            let field = Field::scalar(name, self.cells.iter().map(of).collect());
            self.snapshot.cell_fields.push(field);
        }
    }
}
