//! Default of the horizon: three spacings of the points.
//!
//! If no bond breaks, the horizon is a numerical parameter: with it the solution tends to that of elasticity. Three points to a horizon are what most of the literature takes, and what a lattice
//! takes here under a horizon that is typed. If bonds break, the horizon is a length of the material, and has to be typed.

use super::default_points::{RATIO, of_cells};
use super::expression::Expression;
use super::spec::{PeridynamicsSpec, PointsSpec};
use crate::mesh::Mesh;
use crate::model::Zone;

/// The horizon \[m\], and the reason for it if it is not typed; a lattice that is not typed suits the cells that are not local, or all if there are none.
pub(crate) fn horizon_of<const D: usize>(
    spec: &PeridynamicsSpec,
    mesh: &Mesh<D>,
    zones: &[Zone],
) -> (Expression, Option<String>) {
    if let Some(typed) = &spec.horizon {
        return (typed.clone(), None);
    }
    let everywhere = !zones.iter().any(|z| *z != Zone::Local);
    let cells = (0..mesh.cell_count()).filter(|&c| everywhere || zones[c] != Zone::Local);
    let cells: Vec<usize> = cells.collect();
    let (spacing, of_what) = match &spec.points {
        Some(PointsSpec::Lattice(lattice)) => (lattice.spacing.value, "spacings of the points"),
        Some(PointsSpec::Cells | PointsSpec::File(_)) => {
            (mean_size(mesh, &cells), "mean sizes of the cells")
        }
        // as fine as the cells where they are a grid
        None => match of_cells(mesh, &cells, f64::INFINITY) {
            Some((edge, _)) => (edge, "edges of the zone's cells"),
            None => (mean_size(mesh, &cells), "mean sizes of the zone's cells"),
        },
    };
    let why = format!(
        "the scene leaves `horizon` out: {RATIO} {of_what}, as most of the literature takes; no bond breaks, so that it is a matter of accuracy"
    );
    (Expression::constant(RATIO * spacing), Some(why))
}

/// The edge of a square or cube as large as the cells are in the mean.
fn mean_size<const D: usize>(mesh: &Mesh<D>, cells: &[usize]) -> f64 {
    let volume: f64 = cells.iter().map(|&c| mesh.cell_volume(c).abs()).sum();
    (volume / cells.len().max(1) as f64).powf(1.0 / D as f64)
}
