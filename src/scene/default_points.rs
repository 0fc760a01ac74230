//! Default positions of the points: a lattice, whatever the mesh is.
//!
//! Points at the centroids of cells have families as irregular as the cells. On triangles of different sizes bonds then carry neither the typed constants
//! nor a uniform stress, so they are for those who ask for them. A lattice carries both on every mesh.
//!
//! Its spacing is that of the cells of the zone where they are alike and their nodes are a lattice themselves, or a whole fraction of it where the cells
//! are coarse beside the horizon: seams then interpolate nothing, or end on faces that follow the lattice. On all other meshes it is a third of the horizon,
//! the ratio that most of the literature uses; a little less where that lets the smallest extent of the body hold a whole number of spacings.

use super::spec::LatticeStart;
use crate::mesh::Mesh;
use crate::model::{PointSource, Zone};
use crate::observe::report::number;
use crate::tensor::Vector;

/// Spacings in a horizon, where nothing else decides.
pub const RATIO: f64 = 3.0;

/// Distance, in cells, by which nodes may deviate from a lattice of cells.
const ALIKE: f64 = 1e-6;

/// A lattice for cells of the edge `cell` under a horizon: the cells themselves, or a whole fraction of them.
pub fn fraction_of_cells(cell: f64, horizon: f64) -> f64 {
    cell / (RATIO * cell / horizon).round().max(1.0)
}

/// The lattice of a scene that does not place its points, and the reason for it.
///
/// `horizon` gives that of each cell \[m\].
pub(crate) fn default_points<const D: usize>(
    mesh: &Mesh<D>,
    zones: &[Zone],
    start: LatticeStart,
    horizon: impl Fn(usize) -> f64,
) -> (PointSource<D>, String) {
    let everywhere = !zones.iter().any(|z| *z != Zone::Local);
    let cells: Vec<usize> = (0..mesh.cell_count())
        .filter(|&c| everywhere || zones[c] != Zone::Local)
        .collect();
    let smallest = cells
        .iter()
        .map(|&c| horizon(c))
        .filter(|d| d.is_finite() && *d > 0.0)
        .fold(f64::INFINITY, f64::min);
    let (low, high) = mesh.bounds();
    if !smallest.is_finite() {
        // refused where horizons are checked, with the place
        let spacing = (high - low).amax();
        return (
            PointSource::Lattice {
                spacing,
                origin: low,
            },
            String::new(),
        );
    }
    let (spacing, corner, as_what) = match of_cells(mesh, &cells, smallest) {
        Some((spacing, corner)) => (spacing, corner, "on the grid of the zone's cells"),
        None => (
            of_horizon(&(high - low), smallest),
            low,
            "a third of the horizon, as the zone's cells are no grid",
        ),
    };
    let origin = match start {
        LatticeStart::OnCorner => corner,
        LatticeStart::Halfway => corner.add_scalar(0.5 * spacing),
    };
    let why = format!(
        "the scene leaves `points` out; {as_what}, {} spacings in a horizon",
        number(smallest / spacing)
    );
    (PointSource::Lattice { spacing, origin }, why)
}

/// A third of the horizon, or what of it fits the smallest extent a whole number of times.
fn of_horizon<const D: usize>(extents: &Vector<D>, horizon: f64) -> f64 {
    let least = extents.min();
    if least < horizon {
        return horizon / RATIO;
    }
    // a ratio of lengths that is whole but for rounding stays
    least / (RATIO * least / horizon - 1e-9).ceil()
}

/// The lattice of the centroids of all cells, if these are equal cubes (squares, intervals) of one grid along the axes.
pub(super) fn of_centroids<const D: usize>(mesh: &Mesh<D>) -> Option<PointSource<D>> {
    let cells: Vec<usize> = (0..mesh.cell_count()).collect();
    let (low, high) = mesh.bounds_of(mesh.cell(*cells.first()?));
    let edges = high - low;
    let is_cube = edges.max() - edges.min() <= ALIKE * edges.min();
    let (spacing, corner) = of_cells(mesh, &cells, RATIO * edges.min())?;
    let is_filled = cells.iter().all(|&c| {
        let volume = spacing.powi(D as i32);
        (mesh.cell_volume(c).abs() - volume).abs() <= ALIKE * volume
    });
    (is_cube && is_filled).then(|| PointSource::Lattice {
        spacing,
        origin: corner.add_scalar(0.5 * spacing),
    })
}

/// Spacing and a corner of the grid that the cells are, if they are one whose edges are multiples of a spacing.
pub(super) fn of_cells<const D: usize>(
    mesh: &Mesh<D>,
    cells: &[usize],
    horizon: f64,
) -> Option<(f64, Vector<D>)> {
    let (low, high) = mesh.bounds_of(mesh.cell(*cells.first()?));
    let (corner, edges) = (low, high - low);
    for &c in cells {
        let (l, h) = mesh.bounds_of(mesh.cell(c));
        if ((h - l) - edges).amax() > ALIKE * edges.min() {
            return None;
        }
        let follows = mesh.corners(c).iter().all(|&n| {
            let k = (mesh.nodes[n as usize] - corner).component_div(&edges);
            k.iter().all(|k| (k - k.round()).abs() <= ALIKE)
        });
        if !follows {
            return None;
        }
    }
    let shortest = edges.min();
    let spacing = fraction_of_cells(shortest, horizon);
    // edges of different lengths share a spacing only if it divides all of them
    let divides = edges.iter().all(|e| {
        let k = e / spacing;
        (k - k.round()).abs() <= ALIKE
    });
    divides.then_some((spacing, corner))
}
