//! The cell grid behind the family search.
//!
//! Points are counting-sorted into cells of half the largest horizon. Along the last axis the points of neighbouring cells lie side by
//! side, so a query reads a few contiguous runs.

use super::families::{Families, FamilyError};
use crate::{parallel, tensor::Vector};

/// Two points nearer than this fraction of the horizon coincide.
const COINCIDENCE: f64 = 1e-9;

/// Most grid cells per point, so that a sparse or elongated cloud does not buy memory with an empty grid.
const CELLS_PER_POINT: usize = 4;

/// Treatment of a cloud point on which a query lies.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Coincidence {
    /// An error: a cloud has each point once.
    Refused,
    /// It is no neighbour.
    LeftOut,
}

/// Cloud points sorted by grid cell.
pub(super) struct Grid<const D: usize> {
    low: Vector<D>,
    inverse_size: f64,
    counts: [usize; D],
    /// Start of each cell in `points`; the last axis runs fastest.
    starts: Vec<u32>,
    /// Positions in cell order.
    points: Vec<Vector<D>>,
    /// Their numbers in the cloud.
    numbers: Vec<u32>,
}

/// Refuses lists whose lengths do not fit, and numbers that are no positions or horizons.
fn check<const D: usize>(
    cloud: &[Vector<D>],
    queries: &[Vector<D>],
    horizons: &[f64],
) -> Result<(), FamilyError> {
    if cloud.len() >= u32::MAX as usize || queries.len() >= u32::MAX as usize {
        return Err(FamilyError::Length {
            what: "the list of points",
            length: cloud.len().max(queries.len()),
            wanted: "more than 32-bit point numbers reach; split the model",
        });
    }
    if horizons.len() != queries.len() {
        return Err(FamilyError::Length {
            what: "the list of horizons",
            length: horizons.len(),
            wanted: "not one per point",
        });
    }
    for (list, points) in [("point", cloud), ("query", queries)] {
        if let Some(i) = points.iter().position(|x| !x.iter().all(|c| c.is_finite())) {
            return Err(FamilyError::Position {
                list,
                point: i,
                position: points[i].iter().copied().collect(),
            });
        }
    }
    if let Some(i) = horizons.iter().position(|d| !(d.is_finite() && *d > 0.0)) {
        return Err(FamilyError::Horizon {
            point: i,
            horizon: horizons[i],
        });
    }
    Ok(())
}

impl<const D: usize> Grid<D> {
    pub(super) fn new(
        cloud: &[Vector<D>],
        queries: &[Vector<D>],
        horizons: &[f64],
    ) -> Result<Self, FamilyError> {
        check(cloud, queries, horizons)?;

        let low = cloud.iter().skip(1).fold(
            cloud.first().copied().unwrap_or_else(Vector::zeros),
            |a, x| a.inf(x),
        );
        let high = cloud.iter().fold(low, |a, x| a.sup(x));
        let extent = high - low;
        let mut size = 0.5 * horizons.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let most = (CELLS_PER_POINT * cloud.len() + 64) as f64;
        let cells = |size: f64| {
            extent
                .iter()
                .map(|e| (e / size).floor() + 1.0)
                .product::<f64>()
        };
        while cells(size) > most {
            size *= 1.26;
        }
        let counts: [usize; D] = std::array::from_fn(|a| (extent[a] / size).floor() as usize + 1);
        let mut grid = Self {
            low,
            inverse_size: 1.0 / size,
            counts,
            starts: vec![0; counts.iter().product::<usize>() + 1],
            points: Vec::new(),
            numbers: vec![0; cloud.len()],
        };
        let cells: Vec<u32> = parallel::map_slice(cloud, |x| grid.cell_of(x) as u32);
        for &c in &cells {
            grid.starts[c as usize + 1] += 1;
        }
        for c in 1..grid.starts.len() {
            grid.starts[c] += grid.starts[c - 1];
        }
        let mut next = grid.starts.clone();
        for (i, &c) in cells.iter().enumerate() {
            let slot = &mut next[c as usize];
            grid.numbers[*slot as usize] = i as u32;
            *slot += 1;
        }
        grid.points = parallel::map_slice(&grid.numbers, |&i| cloud[i as usize]);
        Ok(grid)
    }

    /// Cell index along one axis, cut to the grid.
    fn along(&self, axis: usize, coordinate: f64) -> usize {
        let cell = ((coordinate - self.low[axis]) * self.inverse_size).floor();
        // Saturating: negative and huge values land on the border cells.
        (cell as usize).min(self.counts[axis] - 1)
    }

    fn cell_of(&self, x: &Vector<D>) -> usize {
        (0..D).fold(0, |cell, a| cell * self.counts[a] + self.along(a, x[a]))
    }

    /// Calls `visit(number, squared distance)` for every cloud point within `reach` of `x`, in cell order.
    fn visit(&self, x: &Vector<D>, reach: f64, mut visit: impl FnMut(u32, f64)) {
        // Wider than the sphere by more than the rounding of the cell arithmetic.
        let width = reach * (1.0 + 1e-9);
        let first: [usize; D] = std::array::from_fn(|a| self.along(a, x[a] - width));
        let last: [usize; D] = std::array::from_fn(|a| self.along(a, x[a] + width));
        let limit = reach * reach;
        let mut cell = first;
        loop {
            let row = (0..D - 1).fold(0, |r, a| r * self.counts[a] + cell[a]) * self.counts[D - 1];
            let run = self.starts[row + first[D - 1]] as usize
                ..self.starts[row + last[D - 1] + 1] as usize;
            for (p, &number) in self.points[run.clone()].iter().zip(&self.numbers[run]) {
                let squared = (p - x).norm_squared();
                if squared <= limit {
                    visit(number, squared);
                }
            }
            // The next run of cells: an odometer over all axes but the last.
            let Some(axis) = (0..D - 1).rev().find(|&a| cell[a] < last[a]) else {
                return;
            };
            cell[axis] += 1;
            cell[axis + 1..D - 1].copy_from_slice(&first[axis + 1..D - 1]);
        }
    }

    /// Counts, then fills: twice the search, but no memory beyond the result.
    pub(super) fn families(
        &self,
        rows: usize,
        query: impl Fn(usize) -> (Vector<D>, f64, Option<u32>) + Sync,
        coincidence: Coincidence,
        tie_tolerance: f64,
    ) -> Result<Families, FamilyError> {
        let each = |row: usize, found: &mut dyn FnMut(u32)| -> Option<u32> {
            let (x, horizon, own) = query(row);
            let near = (COINCIDENCE * horizon).powi(2);
            let mut twin = None;
            self.visit(&x, horizon * (1.0 + tie_tolerance), |j, squared| {
                if Some(j) == own {
                } else if squared <= near {
                    twin = twin.min(Some(j)).or(Some(j));
                } else {
                    found(j);
                }
            });
            twin
        };
        let counted: Vec<(usize, Option<u32>)> = parallel::map(rows, 64, |row| {
            let mut count = 0;
            let twin = each(row, &mut |_| count += 1);
            (count, twin)
        });
        if coincidence == Coincidence::Refused
            && let Some((row, twin)) = counted
                .iter()
                .enumerate()
                .find_map(|(row, (_, twin))| twin.map(|t| (row, t)))
        {
            let (x, _, own) = query(row);
            let own = own.unwrap_or(row as u32);
            return Err(FamilyError::Coincident {
                first: own.min(twin) as usize,
                second: own.max(twin) as usize,
                position: x.iter().copied().collect(),
            });
        }
        let counts = counted.into_iter().map(|(count, _)| count);
        Ok(Families::filled(counts, |row, neighbours| {
            let mut next = 0;
            each(row, &mut |j| {
                neighbours[next] = j;
                next += 1;
            });
            neighbours.sort_unstable();
        }))
    }
}

impl Families {
    /// The families of all points of a cloud, `{j ≠ i : |x_j − x_i| ≤ δ_i (1 + tie_tolerance)}`.
    ///
    /// Units: positions and horizons \[m\]. [`super::TIE_TOLERANCE`] is the tolerance to use unless there is a reason.
    ///
    /// # Errors
    /// [`FamilyError`] on non-finite positions, non-positive horizons and coincident points.
    pub fn search<const D: usize>(
        points: &[Vector<D>],
        horizons: &[f64],
        tie_tolerance: f64,
    ) -> Result<Self, FamilyError> {
        let grid = Grid::new(points, points, horizons)?;
        grid.families(
            points.len(),
            |i| (points[i], horizons[i], Some(i as u32)),
            Coincidence::Refused,
            tie_tolerance,
        )
    }

    /// The families of query points that need not be in the cloud, Gauss points of a cell say.
    ///
    /// `selves[r]` is the cloud point that query `r` is, if it is one. Any cloud point on which a query lies is left out, since a bond
    /// without length has no direction.
    ///
    /// # Errors
    /// [`FamilyError`] on non-finite positions, non-positive horizons and lists of unequal length.
    pub fn search_from<const D: usize>(
        queries: &[Vector<D>],
        selves: &[Option<u32>],
        horizons: &[f64],
        cloud: &[Vector<D>],
        tie_tolerance: f64,
    ) -> Result<Self, FamilyError> {
        if selves.len() != queries.len() {
            return Err(FamilyError::Length {
                what: "the list of self indices",
                length: selves.len(),
                wanted: "not one per query",
            });
        }
        let grid = Grid::new(cloud, queries, horizons)?;
        grid.families(
            queries.len(),
            |r| (queries[r], horizons[r], selves[r]),
            Coincidence::LeftOut,
            tie_tolerance,
        )
    }
}
