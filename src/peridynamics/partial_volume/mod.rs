//! Partial volumes: what share of a point's cell counts in a family whose horizon cuts it.
//!
//! | file | what | source |
//! |---|---|---|
//! | `full.rs` | FL, FA, FV: a cell counts wholly if its point is in the family | [SAND2015-7998] eq. (5.6) |
//! | `pdlammps.rs` | a linear ramp over the last half spacing | section 5.2.1, second algorithm |
//! | `hhb.rs` | the same ramp over the last whole spacing | eq. (5.7) |
//! | `length.rs` | exact lengths in 1D | section 5.3 |
//! | `area.rs` | exact areas in 2D, disc against rectangle | section 5.4 (PA-AC) |
//! | `volume.rs` | exact volumes in 3D, ball against box | in the place of PV-NC |
//! | `lattice.rs` | the shares of all cells around a lattice point | |
//!
//! Lengths, areas and volumes that are exact do not know ties: they change continuously with the horizon. The first algorithm does, and the
//! second too (its ramp ends at one half): a point at `|ξ| = δ` belongs to the family up to a relative tolerance that the caller states.

mod area;
mod full;
mod hhb;
mod lattice;
mod length;
mod pdlammps;
mod volume;

pub use lattice::{LatticeCell, lattice_cells, lattice_shells, orbit};

use crate::tensor::Vector;

/// Partial volumes of the cells that the horizon cuts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
#[schemars(rename = "VolumesSpec")]
pub enum PartialVolume {
    /// A cell counts wholly if its point lies within the horizon (FL, FA, FV).
    Full,
    /// A linear ramp over the last half spacing within the horizon.
    PdLammps,
    /// The ramp of Hu, Ha and Bobaru, which goes on to half a spacing beyond the horizon.
    Hhb,
    /// The length, area or volume itself that the horizon cuts from the cell.
    Exact,
}

impl PartialVolume {
    /// Every algorithm, in the paper's order.
    pub const ALL: [Self; 4] = [Self::Full, Self::PdLammps, Self::Hhb, Self::Exact];

    /// The share, in `[0, 1]`, of `cell` that counts in the family of `centre`.
    ///
    /// `point` is where the cell's displacement is kept; for a lattice its middle. `tie_tolerance` is relative to the horizon. The second and
    /// third algorithm are written for a lattice of spacing `h`; for another cell `h` is the edge of the cube (square) of its volume.
    ///
    /// Source: [SAND2015-7998] section 5.2.1. Units: lengths \[m\] → share \[1\].
    pub fn share<const D: usize>(
        self,
        centre: &Vector<D>,
        horizon: f64,
        point: &Vector<D>,
        cell: &BoxCell<D>,
        tie_tolerance: f64,
    ) -> f64 {
        let distance = (point - centre).norm();
        match self {
            Self::Full => full::share(distance, horizon, tie_tolerance),
            Self::PdLammps => {
                pdlammps::share(distance, horizon, cell.equivalent_edge(), tie_tolerance)
            }
            Self::Hhb => hhb::share(distance, horizon, cell.equivalent_edge()),
            Self::Exact => (cell.ball_measure(centre, horizon) / cell.measure()).clamp(0.0, 1.0),
        }
    }

    /// Returns the largest distance beyond the horizon at which the point of such a cell may lie and still have a share \[m\].
    pub fn reach_beyond<const D: usize>(self, cell: &BoxCell<D>) -> f64 {
        match self {
            Self::Full | Self::PdLammps => 0.0,
            Self::Hhb => 0.5 * cell.equivalent_edge(),
            Self::Exact => 0.5 * (cell.high - cell.low).norm(),
        }
    }
}

/// A cell with faces along the axes: an interval, a rectangle or a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxCell<const D: usize> {
    low: Vector<D>,
    high: Vector<D>,
}

/// Error in the computation of a partial volume.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PartialVolumeError {
    /// A box without volume.
    #[error(
        "partial volume: the cell from {low:?} to {high:?} has no volume; give it finite corners, the lower one first"
    )]
    Box {
        /// Lower corner.
        low: Vec<f64>,
        /// Upper corner.
        high: Vec<f64>,
    },
    /// A ratio of horizon to spacing without a family.
    #[error("partial volumes: horizon / spacing is {ratio}; choose a ratio from 1 to 1000")]
    Ratio {
        /// m = δ/h.
        ratio: f64,
    },
}

impl<const D: usize> BoxCell<D> {
    /// The box between two corners \[m\].
    ///
    /// # Errors
    /// [`PartialVolumeError::Box`] unless every component of `low` is less than that of `high`, both finite.
    pub fn new(low: Vector<D>, high: Vector<D>) -> Result<Self, PartialVolumeError> {
        let sound = (0..D).all(|a| low[a].is_finite() && high[a].is_finite() && low[a] < high[a]);
        if sound {
            Ok(Self { low, high })
        } else {
            Err(PartialVolumeError::Box {
                low: low.iter().copied().collect(),
                high: high.iter().copied().collect(),
            })
        }
    }

    /// The cell of a lattice point: a cube of edge `h` about it. `None` if `h` is not positive.
    pub fn cube(centre: Vector<D>, h: f64) -> Option<Self> {
        Self::new(centre.add_scalar(-0.5 * h), centre.add_scalar(0.5 * h)).ok()
    }

    /// Its lower and its upper corner.
    pub fn corners(&self) -> (Vector<D>, Vector<D>) {
        (self.low, self.high)
    }

    /// Its length, area or volume [m^D].
    pub fn measure(&self) -> f64 {
        (self.high - self.low).product()
    }

    /// Edge of the cube of the same measure \[m\].
    pub fn equivalent_edge(&self) -> f64 {
        match D {
            1 => self.measure(),
            2 => self.measure().sqrt(),
            _ => self.measure().cbrt(),
        }
    }

    /// Measure of its intersection with the ball of that centre and radius, in closed form.
    ///
    /// Accurate to some 1e-16 of `radius^D`. Units: \[m\] → [m^D].
    pub fn ball_measure(&self, centre: &Vector<D>, radius: f64) -> f64 {
        let (low, high) = (self.low - centre, self.high - centre);
        let (mut nearest, mut farthest) = (0.0, 0.0);
        for a in 0..D {
            let near = low[a].max(-high[a]).max(0.0);
            let far = high[a].max(-low[a]);
            nearest += near * near;
            farthest += far * far;
        }
        let square = radius * radius;
        if farthest <= square {
            return self.measure();
        }
        if nearest >= square || radius <= 0.0 {
            return 0.0;
        }
        match D {
            1 => length::interval(low[0], high[0], radius),
            2 => area::rectangle([low[0], low[1]], [high[0], high[1]], radius),
            _ => volume::cuboid(
                [low[0], low[1], low[2]],
                [high[0], high[1], high[2]],
                radius,
            ),
        }
    }
}

#[cfg(test)]
mod tests;
