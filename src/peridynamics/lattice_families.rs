//! Families of points of one lattice and one horizon: a table of the points by their places on the lattice takes the search's place.

use rayon::prelude::*;

use super::families::Families;
use crate::{parallel, tensor::Vector};

/// Largest distance of a point from its place, in spacings: far less than lengths of bonds may differ from the horizon and still count as that.
const OFF_LATTICE: f64 = 1e-9;

/// Most places of the table per point; a cloud that fills less of its box is searched.
const PLACES_PER_POINT: usize = 16;

const NONE: u32 = u32::MAX;

/// The points whose families are searched, by a mark of each point.
#[derive(Clone, Copy, Debug)]
pub enum Wanted<'a> {
    /// All of them.
    All,
    /// Those marked.
    Of(&'a [bool]),
    /// Those marked first, all points in their families, and those marked then.
    WithNeighbours(&'a [bool], &'a [bool]),
}

impl Wanted<'_> {
    /// A mark of each point that is wanted, empty for all; `neighbours` calls back with those of a point.
    fn marks(&self, neighbours: impl Fn(usize, &mut dyn FnMut(u32))) -> Vec<bool> {
        let (own, others) = match self {
            Self::All => return Vec::new(),
            Self::Of(own) => return own.to_vec(),
            Self::WithNeighbours(own, others) => (own, others),
        };
        let mut marks: Vec<bool> = own.iter().zip(*others).map(|(a, b)| *a || *b).collect();
        for i in (0..own.len()).filter(|&i| own[i]) {
            neighbours(i, &mut |j| marks[j as usize] = true);
        }
        marks
    }
}

impl Families {
    /// As [`Families::search`] with one horizon for all, of points that lie on a lattice of the given spacing; `None` if they do not, or fill too little of their box.
    ///
    /// Units: positions, spacing and horizon \[m\].
    pub fn search_lattice<const D: usize>(
        points: &[Vector<D>],
        spacing: f64,
        horizon: f64,
        tie_tolerance: f64,
    ) -> Option<Self> {
        Self::search_lattice_of(points, spacing, horizon, tie_tolerance, &Wanted::All)
    }

    /// As [`Families::search_lattice`], the families of the points that are `wanted`; those of the others are empty. Whether there is a lattice does not depend on which are.
    pub fn search_lattice_of<const D: usize>(
        points: &[Vector<D>],
        spacing: f64,
        horizon: f64,
        tie_tolerance: f64,
        wanted: &Wanted<'_>,
    ) -> Option<Self> {
        let steps = horizon / spacing * (1.0 + tie_tolerance);
        if !(0.0..1e3).contains(&steps) || points.len() >= NONE as usize {
            return None;
        }
        let reach = steps as usize;
        let first = *points.first()?;
        let low = points.iter().fold(first, |a, x| a.inf(x));
        let high = points.iter().fold(first, |a, x| a.sup(x));
        let counts = ((high - low) / spacing).map(|n| n.round() + 1.0 + 2.0 * reach as f64);
        let total: f64 = counts.iter().product();
        if total.is_nan() || total > (PLACES_PER_POINT * points.len() + 100_000) as f64 {
            return None;
        }
        let counts: [usize; D] = std::array::from_fn(|a| counts[a] as usize);
        let flat = |k: &[usize; D]| (0..D).fold(0, |n, a| n * counts[a] + k[a]);
        // padded by the reach on all sides: no bond leaves the table
        let place = |x: &Vector<D>| -> Option<usize> {
            let steps = (x - low) / spacing;
            let k = steps.map(f64::round);
            let is_there = (steps - k).amax() <= OFF_LATTICE;
            is_there.then(|| flat(&std::array::from_fn(|a| k[a] as usize + reach)))
        };
        let places = points.par_iter().map(place).collect::<Option<Vec<_>>>()?;
        let mut table = vec![NONE; counts.iter().product()];
        for (i, &place) in places.iter().enumerate() {
            // two points at one place are for the search to refuse
            if std::mem::replace(&mut table[place], i as u32) != NONE {
                return None;
            }
        }
        // one after another as their places are: families come out ascending where the points are numbered so
        let side = 2 * reach + 1;
        let ways: Vec<isize> = (0..side.pow(D as u32))
            .filter_map(|n| {
                let mut rest = n;
                let mut k = [0isize; D];
                for k in k.iter_mut().rev() {
                    *k = (rest % side) as isize - reach as isize;
                    rest /= side;
                }
                let length: f64 = k.iter().map(|&k| (k * k) as f64).sum::<f64>().sqrt();
                let is_bond = length > 0.0 && length <= steps;
                is_bond.then(|| (0..D).fold(0, |n, a| n * counts[a] as isize + k[a]))
            })
            .collect();
        let of = |place: usize| {
            let table = &table;
            let at = ways
                .iter()
                .map(move |way| table[place.wrapping_add_signed(*way)]);
            at.filter(|&j| j != NONE)
        };
        let is_wanted = wanted.marks(|i, mark| of(places[i]).for_each(mark));
        let size = |(i, &place): (usize, &usize)| match is_wanted.get(i) {
            Some(false) => 0,
            _ => of(place).count(),
        };
        let sizes: Vec<usize> = parallel::map(places.len(), 1, |i| size((i, &places[i])));
        Some(Self::filled(sizes.into_iter(), |i, row| {
            row.iter_mut().zip(of(places[i])).for_each(|(n, j)| *n = j);
            if !row.is_sorted() {
                row.sort_unstable();
            }
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peridynamics::TIE_TOLERANCE;

    /// Points of a block of a lattice, some left out, in or against its order.
    fn block<const D: usize>(
        counts: [usize; D],
        h: f64,
        origin: f64,
        swap: bool,
    ) -> Vec<Vector<D>> {
        let total: usize = counts.iter().product();
        let mut points: Vec<Vector<D>> = (0..total)
            .filter(|n| n % 7 != 3)
            .map(|n| {
                let mut rest = n;
                let mut x = Vector::zeros();
                for a in (0..D).rev() {
                    x[a] = origin + (rest % counts[a]) as f64 * h;
                    rest /= counts[a];
                }
                x
            })
            .collect();
        if swap {
            points.reverse();
        }
        points
    }

    #[test]
    fn families_of_a_lattice_are_those_of_the_search() {
        fn check<const D: usize>(counts: [usize; D]) {
            for (h, origin, swap) in [(0.1, 0.0, false), (1.0 / 977.0, 12.345, true)] {
                let points = block(counts, h, origin, swap);
                for m in [1.0, 2.0, 2.5, 3.0, 4.015] {
                    let horizon = m * h;
                    let horizons = vec![horizon; points.len()];
                    let searched = Families::search(&points, &horizons, TIE_TOLERANCE).unwrap();
                    let found = Families::search_lattice(&points, h, horizon, TIE_TOLERANCE);
                    assert_eq!(found, Some(searched), "{D}D, m = {m}, {swap}");
                }
            }
        }
        check([40]);
        check([17, 12]);
        check([9, 7, 8]);
    }

    #[test]
    fn some_families_are_those_of_all() {
        let points = block([13, 11], 0.1, 0.2, true);
        let search = |wanted: &Wanted<'_>| {
            Families::search_lattice_of(&points, 0.1, 0.3, TIE_TOLERANCE, wanted).unwrap()
        };
        let all = search(&Wanted::All);
        let own: Vec<bool> = points.iter().map(|x| x[0] < 0.7).collect();
        let mut near = own.clone();
        for i in (0..points.len()).filter(|&i| own[i]) {
            all.of(i).iter().for_each(|&j| near[j as usize] = true);
        }
        assert!(near != own && near.contains(&false));
        let mut others = vec![false; own.len()];
        let mut more = near.clone();
        let far = near.iter().position(|is_near| !is_near).unwrap();
        (others[far], more[far]) = (true, true);
        for (found, held) in [
            (search(&Wanted::Of(&own)), &own),
            (search(&Wanted::WithNeighbours(&own, &others)), &more),
        ] {
            for (i, held) in held.iter().enumerate() {
                let wanted: &[u32] = if *held { all.of(i) } else { &[] };
                assert_eq!(found.of(i), wanted);
            }
        }
    }

    #[test]
    fn other_points_are_left_to_the_search() {
        let search = |points: &[Vector<2>], h: f64| {
            Families::search_lattice(points, h, 3.0 * h, TIE_TOLERANCE)
        };
        let points = block([9, 9], 0.1, 0.0, false);
        assert!(search(&points, 0.1).is_some());
        let mut moved = points.clone();
        moved[5][0] += 1e-5;
        assert!(search(&moved, 0.1).is_none());
        let mut twins = points.clone();
        twins[5] = twins[6];
        assert!(search(&twins, 0.1).is_none());
        let mut far = points.clone();
        far[5] = Vector::<2>::new(1e4, 1e4);
        assert!(search(&far, 0.1).is_none());
        far[5][0] = f64::NAN;
        assert!(search(&far, 0.1).is_none());
        assert!(search(&[], 0.1).is_none());
        assert!(search(&points, 0.0).is_none());
    }
}
