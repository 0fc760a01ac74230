//! Positions sorted into bins.

use rustc_hash::FxHashMap;

use crate::tensor::Vector;

/// The bin of a position, of cubes of that edge from the origin on.
pub fn bin_of<const D: usize>(x: &Vector<D>, size: f64) -> [i64; D] {
    std::array::from_fn(|i| (x[i] / size).floor() as i64)
}

/// Positions sorted into bins, to find those near a node without looking at all of them.
pub struct Bins<const D: usize> {
    size: f64,
    bins: FxHashMap<[i64; D], Vec<u32>>,
}

impl<const D: usize> Bins<D> {
    /// Sorts positions \[m\] into cubes of that edge \[m\].
    pub fn new(positions: &[Vector<D>], size: f64) -> Self {
        let mut bins: FxHashMap<[i64; D], Vec<u32>> = FxHashMap::default();
        for (k, x) in positions.iter().enumerate() {
            bins.entry(bin_of(x, size)).or_default().push(k as u32);
        }
        Self { size, bins }
    }

    /// The numbers of all positions in bins that a ball meets, and of no others.
    pub fn around(&self, x: &Vector<D>, radius: f64) -> impl Iterator<Item = usize> + '_ {
        let reach = radius * (1.0 + 1e-9);
        self.in_box(x.add_scalar(-reach), x.add_scalar(reach))
    }

    /// The numbers of all positions in bins that a box meets, and of no others.
    pub fn in_box(&self, low: Vector<D>, high: Vector<D>) -> impl Iterator<Item = usize> + '_ {
        let (low, high) = (bin_of(&low, self.size), bin_of(&high, self.size));
        let counts: [usize; D] = std::array::from_fn(|i| (high[i] - low[i] + 1) as usize);
        (0..counts.iter().product::<usize>())
            .map(move |index| {
                let mut rest = index;
                std::array::from_fn(|i| {
                    let k = rest % counts[i];
                    rest /= counts[i];
                    low[i] + k as i64
                })
            })
            .filter_map(|bin| self.bins.get(&bin))
            .flatten()
            .map(|&k| k as usize)
    }
}
