//! Families that are translations of each other: what is fitted to one holds for all.

use std::hash::{Hash, Hasher};

use rustc_hash::{FxHashMap, FxHasher};

use crate::{parallel, tensor::Vector};

/// Part of the horizon by which bonds of families that are alike may differ, and part by which volumes may.
const ALIKE: f64 = 1e-13;

/// Part of the horizon in which bonds are rounded before they are compared at all.
const ROUNDED: f64 = 1e-9;

/// A family as it is compared: its bonds `(ξ, V)` \[m, m^D\] in the order of the family, and its horizon \[m\].
pub struct FamilyShape<const D: usize> {
    /// Bonds with the volumes of their far ends.
    pub bonds: Vec<(Vector<D>, f64)>,
    /// The horizon.
    pub horizon: f64,
}

impl<const D: usize> FamilyShape<D> {
    fn mark(&self) -> u64 {
        let mut hasher = FxHasher::default();
        self.bonds.len().hash(&mut hasher);
        for (xi, _) in &self.bonds {
            for x in xi.iter() {
                ((x / (ROUNDED * self.horizon)).round() as i64).hash(&mut hasher);
            }
        }
        hasher.finish()
    }

    fn is_like(&self, other: &Self) -> bool {
        let near = |a: f64, b: f64, scale: f64| (a - b).abs() <= ALIKE * scale;
        near(self.horizon, other.horizon, self.horizon)
            && self.bonds.len() == other.bonds.len()
            && self.bonds.iter().zip(&other.bonds).all(|(a, b)| {
                near(a.1, b.1, a.1)
                    && a.0
                        .iter()
                        .zip(b.0.iter())
                        .all(|(x, y)| near(*x, *y, self.horizon))
            })
    }
}

/// For each family the first one of the list that is alike; the same for any number of threads.
pub fn first_alike<const D: usize>(families: &[FamilyShape<D>]) -> Vec<usize> {
    let marks: Vec<u64> = parallel::map_slice(families, FamilyShape::mark);
    let mut known: FxHashMap<u64, Vec<usize>> = FxHashMap::default();
    families
        .iter()
        .zip(marks)
        .enumerate()
        .map(|(i, (family, mark))| {
            let of_mark = known.entry(mark).or_default();
            let found = of_mark.iter().find(|&&k| families[k].is_like(family));
            found.copied().unwrap_or_else(|| {
                of_mark.push(i);
                i
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{FamilyShape, first_alike};
    use crate::tensor::Vector;

    #[test]
    fn translated_families_are_alike_and_others_are_not() {
        let family = |at: f64, volume: f64, second: f64| FamilyShape {
            bonds: [0.1, second]
                .map(|x| (Vector::<2>::new((at + x) - at, 0.0), volume))
                .to_vec(),
            horizon: 0.3,
        };
        let families = [
            family(0.0, 1.0, 0.2),
            family(7.7, 1.0, 0.2),  // the same, but for rounding
            family(0.0, 0.5, 0.2),  // another volume
            family(0.0, 1.0, 0.21), // another bond
            family(3.3, 0.5, 0.2),
            family(0.0, 1.0, 0.2 + 1e-12), // rounds alike, but is not
        ];
        assert_eq!(first_alike(&families), [0, 0, 2, 3, 2, 5]);
    }
}
