//! The points of a lattice in a box, numbered one after the other.

use crate::{model::ModelError, tensor::Vector};

/// A box of lattice points.
pub(crate) struct LatticeBox<const D: usize> {
    /// The numbers of the first point along the axes, from the origin.
    first: Vector<D>,
    counts: [usize; D],
    origin: Vector<D>,
    h: f64,
}

impl<const D: usize> LatticeBox<D> {
    /// The points of the lattice through `origin` with the spacing `h` that cover the box between two corners.
    ///
    /// # Errors
    /// [`ModelError::TooManyPoints`].
    pub fn new(
        low: &Vector<D>,
        high: &Vector<D>,
        origin: Vector<D>,
        h: f64,
    ) -> Result<Self, ModelError> {
        let first: Vector<D> = ((low - origin) / h).map(f64::floor);
        let last: Vector<D> = ((high - origin) / h).map(f64::ceil);
        let points: f64 = (last - first).iter().map(|n| n + 1.0).product();
        if points > f64::from(u32::MAX) {
            return Err(ModelError::TooManyPoints { spacing: h, points });
        }
        Ok(Self {
            first,
            counts: std::array::from_fn(|i| (last[i] - first[i]) as usize + 1),
            origin,
            h,
        })
    }

    /// Returns the number of points.
    pub fn total(&self) -> usize {
        self.counts.iter().product()
    }

    /// The spacing.
    pub fn spacing(&self) -> f64 {
        self.h
    }

    /// Returns the position of a point.
    pub fn position(&self, index: usize) -> Vector<D> {
        let mut rest = index;
        let mut k = self.first;
        for i in (0..D).rev() {
            k[i] += (rest % self.counts[i]) as f64;
            rest /= self.counts[i];
        }
        self.origin + k * self.h
    }

    /// Marks the points whose cells meet the box between `lo` and `hi`.
    pub fn mark(&self, marks: &mut [bool], lo: &Vector<D>, hi: &Vector<D>) {
        let half = 0.5 * (1.0 - 1e-9);
        let mut from = [0usize; D];
        let mut to = [0usize; D];
        for i in 0..D {
            let a = ((lo[i] - self.origin[i]) / self.h - half - self.first[i])
                .ceil()
                .max(0.0);
            let b = ((hi[i] - self.origin[i]) / self.h + half - self.first[i])
                .floor()
                .min(self.counts[i] as f64 - 1.0);
            if a > b {
                return;
            }
            (from[i], to[i]) = (a as usize, b as usize);
        }
        let mut k = from;
        loop {
            let index = (0..D).fold(0, |index, i| index * self.counts[i] + k[i]);
            marks[index] = true;
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
}

/// Visits `n^D` equal parts of the unit cell around the origin by their centres; returns their number.
pub(crate) fn samples_of<const D: usize>(n: usize, mut visit: impl FnMut(Vector<D>)) -> usize {
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
