//! Families: the points within each point's horizon, [SAND2015-7998] eq. (5.2), as the lists (5.6).
//!
//! The result does not depend on the number of threads. The search itself is in `cell_list.rs`.

use crate::parallel;

/// Relative tolerance by which a bond may be longer than the horizon and still belong to the family.
///
/// Bonds that touch the horizon exactly (δ = m h) must not depend on rounding. Typed and written coordinates carry six digits and
/// more, while the next shell of a lattice lies at least `1/(2m²)` (m = 10: 5e-3) farther: 1e-6 keeps clear of both.
pub const TIE_TOLERANCE: f64 = 1e-6;

/// The families of a list of points: row `i` holds the cloud points within the horizon of point `i`, ascending, without `i`.
///
/// Shapes: `neighbours[offsets[i]..offsets[i + 1]]` is row `i`; `offsets` has one entry more than rows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Families {
    /// Start of each row.
    pub offsets: Vec<usize>,
    /// Cloud points of all rows, one after another.
    pub neighbours: Vec<u32>,
}

/// Error in the construction of families.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FamilyError {
    /// A coordinate is not finite.
    #[error("families: {list} {point} has the position {position:?}; give it finite coordinates")]
    Position {
        /// "point" (of the cloud) or "query".
        list: &'static str,
        /// Its number.
        point: usize,
        /// Its coordinates.
        position: Vec<f64>,
    },
    /// A horizon is not positive.
    #[error("families: point {point} has the horizon {horizon}; give it a positive, finite one")]
    Horizon {
        /// Number of the query point.
        point: usize,
        /// Its horizon.
        horizon: f64,
    },
    /// Two points of the cloud lie on top of each other.
    #[error("families: points {first} and {second} coincide at {position:?}; remove one of them")]
    Coincident {
        /// The lower number.
        first: usize,
        /// The higher number.
        second: usize,
        /// Their position.
        position: Vec<f64>,
    },
    /// Lists that belong together differ in length, or a list is longer than point numbers reach.
    #[error("families: {what} has {length} entries, {wanted}")]
    Length {
        /// Name of the list.
        what: &'static str,
        /// Its length.
        length: usize,
        /// The length that was wanted, in words.
        wanted: &'static str,
    },
}

/// The inverse of [`Families`]: for each cloud point, the bonds that end in it.
///
/// Shapes: entries `offsets[j]..offsets[j + 1]` belong to cloud point `j`, rows ascending.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reversed {
    /// Start of each cloud point's entries.
    pub offsets: Vec<usize>,
    /// Row whose family holds the point.
    pub rows: Vec<u32>,
    /// Position of that bond in [`Families::neighbours`].
    pub bonds: Vec<usize>,
}

impl Reversed {
    /// The `(row, bond)` pairs that end in cloud point `j`.
    pub fn of(&self, j: usize) -> impl Iterator<Item = (u32, usize)> + '_ {
        let span = self.offsets[j]..self.offsets[j + 1];
        self.rows[span.clone()]
            .iter()
            .copied()
            .zip(self.bonds[span].iter().copied())
    }
}

impl Families {
    /// Rows of the given lengths, each written by `fill(row, its neighbours)`, in parallel and in any order.
    pub(super) fn filled(
        lengths: impl ExactSizeIterator<Item = usize>,
        fill: impl Fn(usize, &mut [u32]) + Sync,
    ) -> Self {
        let mut offsets = Vec::with_capacity(lengths.len() + 1);
        let mut end = 0;
        offsets.push(0);
        for length in lengths {
            end += length;
            offsets.push(end);
        }
        let mut neighbours = vec![0u32; end];
        let mut rows = Vec::with_capacity(offsets.len() - 1);
        let mut rest = neighbours.as_mut_slice();
        for ends in offsets.windows(2) {
            let (row, tail) = rest.split_at_mut(ends[1] - ends[0]);
            rows.push(row);
            rest = tail;
        }
        parallel::for_each_task(rows, 64, fill);
        Self {
            offsets,
            neighbours,
        }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Returns true if there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of directed bonds.
    pub fn bond_count(&self) -> usize {
        self.neighbours.len()
    }

    /// The neighbours of row `i`, ascending.
    pub fn of(&self, i: usize) -> &[u32] {
        &self.neighbours[self.offsets[i]..self.offsets[i + 1]]
    }

    /// Keeps the bonds `(i, j)` for which `keep` holds and returns how many were cut; `i` is a row, `j` a cloud point.
    ///
    /// `keep` is called from several threads; the result does not depend on their number.
    pub fn retain(&mut self, keep: impl Fn(usize, u32) -> bool + Sync) -> usize {
        self.retain_of(|_| true, keep)
    }

    /// As [`Families::retain`], with the rows for which `may_lose` does not hold as they are.
    pub fn retain_of(
        &mut self,
        may_lose: impl Fn(usize) -> bool + Sync,
        keep: impl Fn(usize, u32) -> bool + Sync,
    ) -> usize {
        let before = self.neighbours.len();
        let kept: Vec<Option<Vec<u32>>> = parallel::map(self.len(), 256, |i| {
            let row = self.of(i);
            let rest = || row.iter().copied().filter(|&j| keep(i, j));
            let loses = may_lose(i) && !row.iter().all(|&j| keep(i, j));
            loses.then(|| rest().collect())
        });
        let mut end = 0;
        for (i, row) in kept.iter().enumerate() {
            let own = self.offsets[i]..self.offsets[i + 1];
            self.offsets[i] = end;
            match row {
                Some(row) => {
                    self.neighbours[end..end + row.len()].copy_from_slice(row);
                    end += row.len();
                }
                None => {
                    end += own.len();
                    self.neighbours.copy_within(own, self.offsets[i]);
                }
            }
        }
        if let Some(last) = self.offsets.last_mut() {
            *last = end;
        }
        self.neighbours.truncate(end);
        before - end
    }

    /// For each of the `cloud` points, the rows whose family holds it.
    pub fn reversed(&self, cloud: usize) -> Reversed {
        let mut offsets = vec![0usize; cloud + 1];
        for &j in &self.neighbours {
            offsets[j as usize + 1] += 1;
        }
        for j in 0..cloud {
            offsets[j + 1] += offsets[j];
        }
        let mut next = offsets.clone();
        let mut rows = vec![0u32; self.neighbours.len()];
        let mut bonds = vec![0usize; self.neighbours.len()];
        for i in 0..self.len() {
            for bond in self.offsets[i]..self.offsets[i + 1] {
                let slot = &mut next[self.neighbours[bond] as usize];
                rows[*slot] = i as u32;
                bonds[*slot] = bond;
                *slot += 1;
            }
        }
        Reversed {
            offsets,
            rows,
            bonds,
        }
    }

    /// The first bond `(i, j)` without a bond `(j, i)`, where rows and cloud points are the same list; `None` if families are mutual.
    pub fn one_sided(&self) -> Option<(u32, u32)> {
        parallel::find_first(self.len(), 1, |i| {
            self.of(i)
                .iter()
                .find(|&&j| {
                    j as usize >= self.len()
                        || self.of(j as usize).binary_search(&(i as u32)).is_err()
                })
                .map(|&j| (i as u32, j))
        })
    }

    /// Returns true if every bond has its reverse, as with a constant horizon.
    pub fn is_symmetric(&self) -> bool {
        self.one_sided().is_none()
    }
}

impl Families {
    /// The same families with points renumbered (`u32::MAX` for a point that is dropped); only `active` points, by old number, keep theirs,
    /// without the neighbours that are dropped.
    pub fn restrict(&self, renumbered: &[u32], active: &[bool]) -> Self {
        let mut result = Self {
            offsets: vec![0],
            neighbours: Vec::new(),
        };
        for i in 0..self.len() {
            if renumbered[i] == u32::MAX {
                continue;
            }
            if active[i] {
                result.neighbours.extend(
                    self.of(i)
                        .iter()
                        .map(|&j| renumbered[j as usize])
                        .filter(|&j| j != u32::MAX),
                );
            }
            result.offsets.push(result.neighbours.len());
        }
        result
    }

    /// The same, and for each of some points without a family (ascending) the points in whose families it is.
    pub(crate) fn mirrored(&self, points: &[u32]) -> Self {
        if points.is_empty() {
            return self.clone();
        }
        let reversed = self.reversed(self.len());
        let seen = |i: usize| match points.binary_search(&(i as u32)) {
            Ok(_) => &reversed.rows[reversed.offsets[i]..reversed.offsets[i + 1]],
            Err(_) => self.of(i),
        };
        Self::filled((0..self.len()).map(|i| seen(i).len()), |i, row| {
            row.copy_from_slice(seen(i));
        })
    }

    /// The same, and of each point that has a family also those points with one in whose families it is: bonds between families are mutual.
    pub(crate) fn completed(&self) -> Self {
        let reversed = self.reversed(self.len());
        let rows = parallel::map(self.len(), 256, |i| {
            let seen = reversed.rows[reversed.offsets[i]..reversed.offsets[i + 1]].iter();
            let mut row = self.of(i).to_vec();
            if !row.is_empty() {
                row.extend(seen.filter(|j| self.of(i).binary_search(j).is_err()));
                row.sort_unstable();
            }
            row
        });
        Self::filled(rows.iter().map(Vec::len), |i, row| {
            row.copy_from_slice(&rows[i]);
        })
    }

    /// Appends the families of another cloud, whose points are numbered on from those of this one.
    pub fn append(&mut self, other: &Self) {
        let (points, bonds) = (self.len() as u32, self.neighbours.len());
        self.neighbours
            .extend(other.neighbours.iter().map(|&j| j + points));
        self.offsets
            .extend(other.offsets.iter().skip(1).map(|&o| o + bonds));
    }

    /// Families of some points of a cloud of `points`, row `r` that of point `centres[r]` (ascending), as families of all points, the rest empty.
    pub fn spread(&self, centres: &[u32], points: usize) -> Self {
        let mut offsets = Vec::with_capacity(points + 1);
        offsets.push(0);
        let mut row = 0;
        for i in 0..points {
            if row < centres.len() && centres[row] as usize == i {
                row += 1;
            }
            offsets.push(self.offsets[row]);
        }
        Self {
            offsets,
            neighbours: self.neighbours.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::Vector;

    /// Reproducible numbers in [0, 1).
    fn random(state: &mut u64) -> f64 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 53) as f64
    }

    fn cloud<const D: usize>(n: usize, extent: [f64; D], seed: u64) -> Vec<Vector<D>> {
        let mut state = seed;
        (0..n)
            .map(|_| Vector::from_fn(|i, _| extent[i] * (random(&mut state) - 0.3)))
            .collect()
    }

    /// Every pair looked at.
    fn brute<const D: usize>(
        queries: &[Vector<D>],
        selves: &[Option<u32>],
        horizons: &[f64],
        cloud: &[Vector<D>],
    ) -> Vec<Vec<u32>> {
        queries
            .iter()
            .enumerate()
            .map(|(r, x)| {
                (0..cloud.len() as u32)
                    .filter(|&j| {
                        let distance = (cloud[j as usize] - x).norm();
                        Some(j) != selves[r]
                            && distance > 0.0
                            && distance <= horizons[r] * (1.0 + TIE_TOLERANCE)
                    })
                    .collect()
            })
            .collect()
    }

    fn rows(f: &Families) -> Vec<Vec<u32>> {
        (0..f.len()).map(|i| f.of(i).to_vec()).collect()
    }

    fn compare<const D: usize>(extent: [f64; D], n: usize) {
        let points = cloud(n, extent, 7 + D as u64);
        let mut state = 99;
        let horizons: Vec<f64> = (0..n).map(|_| 0.02 + 0.2 * random(&mut state)).collect();
        let selves: Vec<Option<u32>> = (0..n as u32).map(Some).collect();
        let families = Families::search(&points, &horizons, TIE_TOLERANCE).unwrap();
        assert_eq!(rows(&families), brute(&points, &selves, &horizons, &points));
        assert!(families.bond_count() > 100);

        // Queries apart from the cloud, some far outside of it, one on a point of it.
        let mut queries = cloud(60, extent.map(|e| 2.0 * e), 5);
        queries.push(points[3]);
        let nobody = vec![None; queries.len()];
        let reach = vec![0.15; queries.len()];
        let found =
            Families::search_from(&queries, &nobody, &reach, &points, TIE_TOLERANCE).unwrap();
        assert_eq!(rows(&found), brute(&queries, &nobody, &reach, &points));
    }

    #[test]
    fn search_finds_what_brute_force_finds() {
        compare([4.0], 200);
        compare([1.0, 1.0], 600);
        compare([30.0, 0.1], 400);
        compare([1.0, 0.7, 0.4], 900);
        compare([40.0, 0.3, 0.2], 700);
    }

    #[test]
    fn bonds_on_the_horizon_do_not_hang_on_rounding() {
        // δ = 3h on lattices whose coordinates round both ways: 28 bonds in the plane.
        for n in [7usize, 30, 120, 977] {
            let h = 1.0 / n as f64;
            for shift in [0.0, 0.1, 123.456] {
                let points: Vec<Vector<2>> = (0..49)
                    .map(|k| {
                        Vector::<2>::new(shift + (k % 7) as f64 * h, (k / 7) as f64 / n as f64)
                    })
                    .collect();
                let families = Families::search(&points, &[3.0 * h; 49], TIE_TOLERANCE).unwrap();
                assert_eq!(families.of(24).len(), 28, "n = {n}, shift = {shift}");
            }
        }
    }

    #[test]
    fn threads_do_not_change_the_result() {
        let points = cloud(2000, [1.0, 1.0, 1.0], 3);
        let horizons = vec![0.12; 2000];
        let pool = |n| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(n)
                .build()
                .unwrap()
        };
        let one = pool(1).install(|| Families::search(&points, &horizons, TIE_TOLERANCE));
        let four = pool(4).install(|| Families::search(&points, &horizons, TIE_TOLERANCE));
        assert_eq!(one, four);
        assert!(one.unwrap().is_symmetric());
    }

    #[test]
    fn retain_cuts_and_reversed_inverts() {
        let points = cloud(300, [1.0, 1.0], 11);
        let mut state = 1;
        let horizons: Vec<f64> = (0..300).map(|_| 0.25 + 0.25 * random(&mut state)).collect();
        let mut families = Families::search(&points, &horizons, TIE_TOLERANCE).unwrap();
        // a point without a family of its own takes part in none
        assert!((0..300).all(|i| !families.of(i).is_empty()));
        let mutual = families.completed();
        assert!(mutual.is_symmetric() && mutual.bond_count() > families.bond_count());
        let (i, j) = families.one_sided().unwrap();
        assert!(mutual.of(j as usize).contains(&i));
        assert!(families.of(i as usize).contains(&j) && !families.of(j as usize).contains(&i));
        assert!(!families.is_symmetric());

        let whole = rows(&families);
        let mut half = families.clone();
        half.retain_of(|i| i % 2 == 0, |i, j| i % 4 == 0 && j % 3 == 0);
        for (i, row) in rows(&half).into_iter().enumerate() {
            let expected: Vec<u32> = match i % 4 {
                0 => whole[i].iter().copied().filter(|j| j % 3 == 0).collect(),
                2 => vec![],
                _ => whole[i].clone(),
            };
            assert_eq!(row, expected);
        }
        let same_side = |i: usize, j: u32| (points[i].x < 0.2) == (points[j as usize].x < 0.2);
        let cut = families.retain(same_side);
        let expected: Vec<Vec<u32>> = whole
            .iter()
            .enumerate()
            .map(|(i, r)| r.iter().copied().filter(|&j| same_side(i, j)).collect())
            .collect();
        assert_eq!(rows(&families), expected);
        let count = |r: &[Vec<u32>]| r.iter().map(Vec::len).sum::<usize>();
        assert!(cut > 0 && cut == count(&whole) - count(&expected));

        let reversed = families.reversed(300);
        for j in 0..300u32 {
            let expected: Vec<u32> = (0..300u32)
                .filter(|&i| families.of(i as usize).contains(&j))
                .collect();
            let got: Vec<(u32, usize)> = reversed.of(j as usize).collect();
            assert_eq!(got.iter().map(|e| e.0).collect::<Vec<_>>(), expected);
            for (i, bond) in got {
                assert_eq!(families.neighbours[bond], j);
                assert!(
                    (families.offsets[i as usize]..families.offsets[i as usize + 1])
                        .contains(&bond)
                );
            }
        }
    }

    #[test]
    fn unusable_input_is_named() {
        let good = vec![Vector::<2>::new(0.0, 0.0), Vector::<2>::new(1.0, 0.0)];
        let search = |p: &[Vector<2>], d: &[f64]| {
            Families::search(p, d, TIE_TOLERANCE)
                .unwrap_err()
                .to_string()
        };
        assert!(search(&good, &[1.0, -2.0]).contains("point 1 has the horizon -2"));
        assert!(search(&good, &[1.0]).contains("horizons has 1 entries"));
        let mut bad = good.clone();
        bad[1].y = f64::NAN;
        assert!(search(&bad, &[1.0, 1.0]).contains("point 1 has the position [1.0, NaN]"));
        bad[1] = bad[0];
        assert!(search(&bad, &[1.0, 1.0]).contains("points 0 and 1 coincide"));
    }

    #[test]
    fn no_points_no_families() {
        let families = Families::search::<3>(&[], &[], TIE_TOLERANCE).unwrap();
        assert!(families.is_empty() && families.bond_count() == 0);
        let lonely =
            Families::search_from(&[Vector::<3>::zeros()], &[None], &[1.0], &[], TIE_TOLERANCE)
                .unwrap();
        assert_eq!(lonely.of(0), &[] as &[u32]);
    }
}
