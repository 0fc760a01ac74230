//! Piece of a model that each of several processes writes to its VTU file, and the numbers of its entities in the file that one process writes.

use rustc_hash::FxHashMap;

use super::loads::site_of_node;
use super::parts::ElementParts;
use super::point_cells::PointCells;
use crate::mesh::CellShape;
use crate::model::{Model, SiteKind};
use crate::scene::spec::PointOutputSpec;
use crate::system::{Partition, Ranks};
use crate::tensor::{Vector, padded};

/// Number of an entity that another process shows.
const OTHERS: u32 = u32::MAX;

/// The elements and peridynamic points that one process shows.
///
/// A point is shown by the process that has its site, an element by the one that has the first of its nodes that is a site. Nodes on the border of two pieces stand in both.
#[derive(Clone, Debug)]
pub struct Piece {
    /// The number of each cell of the mesh among the cells of the whole file; of one that is cut that of its first part.
    cells: Vec<u32>,
    /// The number of the first corner of parts of each cut cell that is no node, among the points of the whole file.
    corners: FxHashMap<u32, u32>,
    /// The number of each node among the points of the whole file.
    nodes: Vec<u32>,
    /// The number of the cell of each site that is a point, and of its first corner.
    sites: Vec<[u32; 2]>,
}

impl Piece {
    /// That of this one of several processes, where points are shown in a `form`.
    ///
    /// Sites are distributed as families are, or so that each process has as many.
    pub fn new<const D: usize>(model: &Model<D>, form: PointOutputSpec, ranks: &dyn Ranks) -> Self {
        match model.spread(Some(ranks)) {
            Some(spread) => Self::of(model, form, spread.partition, ranks.rank()),
            None => {
                let positions = model.sites.iter().map(|s| padded(&s.position));
                let positions: Vec<[f64; 3]> = positions.collect();
                let work = vec![1.0; positions.len()];
                let partition = Partition::by_bisection(&positions, &work, ranks.count());
                Self::of(model, form, &partition, ranks.rank())
            }
        }
    }

    fn of<const D: usize>(
        model: &Model<D>,
        form: PointOutputSpec,
        partition: &Partition,
        rank: usize,
    ) -> Self {
        let (mesh, site_of) = (&model.mesh, site_of_node(model));
        let mut piece = Self {
            cells: vec![OTHERS; mesh.cell_count()],
            corners: FxHashMap::default(),
            nodes: vec![OTHERS; mesh.nodes.len()],
            sites: vec![[OTHERS; 2]; model.sites.len()],
        };
        // in the order in which one process writes them
        let (mut cells, mut points) = (0, 0);
        let parts = ElementParts::of(model, 0..mesh.cell_count());
        for c in (0..mesh.cell_count()).filter(|&c| model.is_element(c)) {
            let cut = parts.get(&(c as u32));
            for &n in cut.map_or(mesh.cell(c), |cut| &cut.nodes) {
                let number = &mut piece.nodes[n as usize];
                if *number == OTHERS {
                    *number = points;
                    points += 1;
                }
            }
            if let Some(cut) = cut {
                piece.corners.insert(c as u32, points);
                points += cut.corners.len() as u32;
            }
            let mut sites = mesh.cell(c).iter().filter_map(|&n| site_of[n as usize]);
            // the first process has what has no site
            let owner = sites.next().map_or(0, |site| partition.owner(site));
            if owner == rank {
                piece.cells[c] = cells;
            }
            cells += cut.map_or(1, |cut| cut.simplices.len() as u32);
        }
        let shapes = PointCells::of(model);
        for (site, s) in model.sites.iter().enumerate() {
            let SiteKind::Point(p) = s.kind else {
                continue;
            };
            if partition.owner(site as u32) == rank {
                piece.sites[site] = [cells, points];
            }
            cells += 1;
            points += corners(&shapes, form, p as usize, &s.position);
        }
        piece
    }

    /// The number of an element, or of its first part, among the cells of the whole file, if this process shows it.
    pub fn cell(&self, c: usize) -> Option<u32> {
        Some(self.cells[c]).filter(|number| *number != OTHERS)
    }

    /// The number of the first corner of parts of a cut element that is no node, among the points of the whole file.
    pub fn corner(&self, c: usize) -> u32 {
        self.corners.get(&(c as u32)).copied().unwrap_or(OTHERS)
    }

    /// The number of a node among the points of the whole file.
    pub fn node(&self, n: usize) -> u32 {
        self.nodes[n]
    }

    /// The numbers of the cell of a site that is a point, and of its first corner, in the whole file, if this process shows it.
    pub fn site(&self, site: usize) -> Option<[u32; 2]> {
        Some(self.sites[site]).filter(|numbers| numbers[0] != OTHERS)
    }
}

/// Points of a file that the cell of a peridynamic point at `x` has.
fn corners<const D: usize>(
    cells: &PointCells<'_, D>,
    form: PointOutputSpec,
    point: usize,
    x: &Vector<D>,
) -> u32 {
    match form {
        PointOutputSpec::Vertices => CellShape::Vertex.node_count() as u32,
        PointOutputSpec::Cells => cells.cell(point, x).1.len() as u32,
    }
}
