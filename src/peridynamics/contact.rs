//! Short-range contact: points that no bond joins keep their distance, between bodies and across the faces of a crack.

use rayon::prelude::*;

use crate::{
    parallel,
    shape::{Barrier, Barriers},
    tensor::Vector,
};

/// Points per task; a constant, so that no result depends on the number of threads.
const BLOCK: usize = 256;

/// Points and parameters of the contact.
#[derive(Clone)]
pub struct ContactSetup<'a, const D: usize> {
    /// Positions at rest \[m\].
    pub position: &'a [Vector<D>],
    /// Volumes \[m^D\].
    pub volume: &'a [f64],
    /// Points that take part, one entry per point; empty for all.
    pub rows: &'a [bool],
    /// Spacing `h` of the points \[m\].
    pub spacing: f64,
    /// Part of the spacing, or of their distance at rest where that is less, to which two points may approach each other; 0.9 of the distance at rest in EMU and LAMMPS PERI, and at most 1.35 spacings.
    pub approach: f64,
    /// `k`: points closer than `d` push each other with `k (d − r) V_i V_j` \[N/m^(2D+1)\]; see [`contact_stiffness`].
    pub stiffness: f64,
    /// Distance beyond `d` up to which pairs are kept on the list \[m\]. A quarter of the spacing is good.
    pub skin: f64,
    /// Cracks whose faces keep points apart that lie within the `horizon` at rest: these do not push each other.
    pub cracks: Vec<Barrier<D>>,
    /// Horizon \[m\].
    pub horizon: f64,
}

/// Error in the setup of contact.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ContactError {
    /// A number that must be positive and finite is not.
    #[error("contact: {what} is {value}; give it a positive, finite value")]
    Number {
        /// Name of the number.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// Lists that belong together differ in length.
    #[error("contact: {what} has {length} entries for {points} points; give one per point")]
    Length {
        /// Name of the list.
        what: &'static str,
        /// Its length.
        length: usize,
        /// Number of points.
        points: usize,
    },
}

/// `k = 15 c/δ`, fifteen times the bond of length δ, from the bond constant `c` of `f = c s` (with the pairwise coefficient `p` of a bond of length `r`: `c = 2 p r³`).
///
/// Source: the factor 15 and the form `15 c (d − r)/δ` are those of EMU and of LAMMPS PERI (Parks et al., Comput. Phys. Commun. 179 (2008) 777, eq. (10)–(12)).
pub fn contact_stiffness(bond_constant: f64, horizon: f64) -> f64 {
    15.0 * bond_constant / horizon
}

/// The pairs that may touch, and their forces.
///
/// The distance below which two points push each other is `d = a min(|x_i − x_j|, h)` with the `approach` a, so nothing pushes at rest, and bodies touch where cells of their points do.
/// Differs from EMU and LAMMPS PERI, whose distance is `min(0.9 |x_i − x_j|, 1.35 h)`, and in that pairs with an intact bond do not push, their bond does. Pairs come from a list that is rebuilt when some point has moved by half the skin;
/// pairs beyond `d` add nothing, so results do not depend on when that was.
pub struct Contact<const D: usize> {
    position: Vec<[f64; D]>,
    volume: Vec<f64>,
    rows: Vec<bool>,
    spacing: f64,
    approach: f64,
    stiffness: f64,
    skin: f64,
    cracks: Barriers<D>,
    horizon: f64,
    /// Displacements for which the pairs were listed; empty before the first time.
    listed: Vec<f64>,
    offsets: Vec<usize>,
    others: Vec<u32>,
    rebuilds: usize,
}

/// Test for an intact bond between two points.
pub type Bonded<'a> = dyn Fn(usize, usize) -> bool + Sync + 'a;

impl<const D: usize> Contact<D> {
    /// Contact without any pairs yet.
    ///
    /// # Errors
    /// [`ContactError`] if numbers are not positive or lists do not belong together.
    pub fn new(setup: &ContactSetup<'_, D>) -> Result<Self, ContactError> {
        for (what, value) in [
            ("the spacing", setup.spacing),
            ("the approach", setup.approach),
            ("the stiffness", setup.stiffness),
            ("the skin", setup.skin),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(ContactError::Number { what, value });
            }
        }
        let points = setup.position.len();
        for (what, length) in [("volume", setup.volume.len()), ("rows", setup.rows.len())] {
            if length != points && !(what == "rows" && length == 0) {
                return Err(ContactError::Length {
                    what,
                    length,
                    points,
                });
            }
        }
        Ok(Self {
            position: setup.position.iter().map(|x| (*x).into()).collect(),
            volume: setup.volume.to_vec(),
            rows: if setup.rows.is_empty() {
                vec![true; points]
            } else {
                setup.rows.to_vec()
            },
            spacing: setup.spacing,
            approach: setup.approach,
            stiffness: setup.stiffness,
            skin: setup.skin,
            cracks: Barriers::new(setup.cracks.clone()),
            horizon: setup.horizon,
            listed: Vec::new(),
            offsets: vec![0; points + 1],
            others: Vec::new(),
            rebuilds: 0,
        })
    }

    /// Directed pairs on the list.
    pub fn pairs(&self) -> usize {
        self.others.len()
    }

    /// Returns the number of times that pairs were listed so far.
    pub fn rebuilds(&self) -> usize {
        self.rebuilds
    }

    fn at(&self, u: &[f64], i: usize) -> [f64; D] {
        std::array::from_fn(|a| self.position[i][a] + u[i * D + a])
    }

    /// Returns true if the faces of a crack keep two points apart.
    fn are_faced(&self, i: usize, j: usize) -> bool {
        !self.cracks.is_empty() && {
            let (a, b) = (&self.position[i], &self.position[j]);
            distance(a, b) <= self.horizon && self.cracks.cuts(&(*a).into(), &(*b).into())
        }
    }

    /// `d` of a pair.
    fn reach(&self, i: usize, j: usize) -> f64 {
        self.approach * distance(&self.position[i], &self.position[j]).min(self.spacing)
    }

    /// Lists the pairs anew if a point has moved too far since.
    fn update(&mut self, u: &[f64]) {
        let square = 0.25 * self.skin * self.skin;
        let near = self.listed.len() == u.len()
            && parallel::all(u.len().div_ceil(4 * BLOCK * D), 1, |block| {
                let start = block * 4 * BLOCK * D;
                let end = (start + 4 * BLOCK * D).min(u.len());
                let (u, v) = (&u[start..end], &self.listed[start..end]);
                let mut both = u.chunks_exact(D).zip(v.chunks_exact(D));
                both.all(|(u, v)| {
                    u.iter().zip(v).map(|(u, v)| (u - v) * (u - v)).sum::<f64>() <= square
                })
            });
        if !near {
            self.list(u);
            self.listed.clear();
            self.listed.extend_from_slice(u);
            self.rebuilds += 1;
        }
    }

    /// Lists all pairs closer than `d` and the skin, by a grid of cells that wide.
    fn list(&mut self, u: &[f64]) {
        let width = self.approach * self.spacing + self.skin;
        let points = self.position.len();
        let y: Vec<[f64; D]> = (0..points).map(|i| self.at(u, i)).collect();
        let cell = |y: &[f64; D]| -> [i64; D] { y.map(|y| (y / width).floor() as i64) };
        // sorted by cell: neighbours in a cell are found by bisection, so a few points far away cost nothing
        let mut order: Vec<([i64; D], u32)> = (0..points)
            .filter(|&i| self.rows[i] && y[i].iter().all(|y| y.is_finite()))
            .map(|i| (cell(&y[i]), i as u32))
            .collect();
        order.par_sort_unstable();
        let found: Vec<Vec<u32>> = parallel::map(points, BLOCK, |i| {
            let mut others = Vec::new();
            if !self.rows[i] {
                return others;
            }
            let here = cell(&y[i]);
            for n in 0..3usize.pow(D as u32 - 1) {
                // the last axis varies fastest in the order: three cells along it lie side by side
                let mut low = here;
                let mut rest = n;
                for c in &mut low[..D - 1] {
                    *c += (rest % 3) as i64 - 1;
                    rest /= 3;
                }
                let mut high = low;
                low[D - 1] -= 1;
                high[D - 1] += 1;
                let first = order.partition_point(|(c, _)| *c < low);
                for (c, j) in &order[first..] {
                    if *c > high {
                        break;
                    }
                    let k = *j as usize;
                    if k != i
                        && distance(&y[i], &y[k]) < self.reach(i, k) + self.skin
                        && !self.are_faced(i, k)
                    {
                        others.push(*j);
                    }
                }
            }
            others.sort_unstable();
            others
        });
        self.others.clear();
        for (i, others) in found.iter().enumerate() {
            self.others.extend_from_slice(others);
            self.offsets[i + 1] = self.others.len();
        }
    }

    /// The sum over the points that push point `i` of `f(j, d − r, (y_j − y_i)/r)`.
    #[inline]
    fn each(
        &self,
        u: &[f64],
        i: usize,
        bonded: &Bonded<'_>,
        mut f: impl FnMut(usize, f64, [f64; D]),
    ) {
        let here = self.at(u, i);
        for &j in &self.others[self.offsets[i]..self.offsets[i + 1]] {
            let j = j as usize;
            let there = self.at(u, j);
            let r = distance(&here, &there);
            let gap = self.reach(i, j) - r;
            // points on one spot have no direction to part in
            if gap > 0.0 && r > 0.0 && !bonded(i, j) {
                f(j, gap, std::array::from_fn(|a| (there[a] - here[a]) / r));
            }
        }
    }

    /// Adds the contact forces to an internal force (minus the force that acts on the point, as everywhere).
    ///
    /// Shapes: `u` \[m\] and `force` \[N\] have `D` numbers per point. `bonded` says which pairs an intact bond joins.
    pub fn add_force(&mut self, u: &[f64], bonded: &Bonded<'_>, force: &mut [f64]) {
        self.update(u);
        let this = &*self;
        parallel::for_each_chunk(force, D, BLOCK, |i, force| {
            this.each(u, i, bonded, |j, gap, direction| {
                let f = this.stiffness * gap * this.volume[i] * this.volume[j];
                for a in 0..D {
                    force[a] += f * direction[a];
                }
            });
        });
    }

    /// Energy of the contact, `½ k (d − r)² V_i V_j` per pair \[J\].
    pub fn energy(&mut self, u: &[f64], bonded: &Bonded<'_>) -> f64 {
        self.update(u);
        let energies: Vec<f64> = parallel::map(self.position.len(), BLOCK, |i| {
            let mut sum = 0.0;
            self.each(u, i, bonded, |j, gap, _| {
                sum += 0.25 * self.stiffness * gap * gap * self.volume[i] * self.volume[j];
            });
            sum
        });
        energies.iter().sum()
    }

    /// Upper bound of what contact adds to the row sums of point `i` while no more points touch it than in a dense packing of `D` dimensions (2, 6, 12).
    pub fn row_sum(&self, i: usize) -> f64 {
        let touching = [2.0, 6.0, 12.0][D - 1];
        // Σ_b |n_a n_b| ≤ √D, once for the point and once for the other one
        2.0 * touching * (D as f64).sqrt() * self.stiffness * self.volume[i] * self.volume[i]
    }

    /// Upper bound of the eigenvalues of contact alone, per `1/m` of the point, in the same packing.
    ///
    /// `½ Σ k (n·(x_i − x_j))² ≤ Σ_i x_iᵀ (Σ_j k n nᵀ) x_i`, and of directions that fill the space evenly `Σ n nᵀ` is their number over `D`; of a face against a face it is less (2 in 2D, 3 in 3D).
    pub fn stiffest(&self, i: usize) -> f64 {
        let touching = [2.0, 6.0, 12.0][D - 1];
        2.0 * touching / D as f64 * self.stiffness * self.volume[i] * self.volume[i]
    }
}

fn distance<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    let square: f64 = a.iter().zip(b).map(|(a, b)| (b - a) * (b - a)).sum();
    square.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const H: f64 = 0.1;

    /// Two blocks, 2.5 spacings apart.
    fn blocks() -> (Vec<Vector<3>>, Vec<f64>) {
        let mut x = Vec::new();
        for k in 0..2 * 6 * 5 * 4 {
            let (block, k) = (k % 2, k / 2);
            let z = H * (k / 30) as f64 + 5.5 * H * f64::from(block);
            x.push(Vector::<3>::new(
                H * (k % 6) as f64,
                H * (k / 6 % 5) as f64,
                z,
            ));
        }
        let volumes = (0..x.len())
            .map(|i| 1e-3 * (1.0 + 0.1 * (i % 3) as f64))
            .collect();
        (x, volumes)
    }

    /// The blocks pushed into each other and shaken.
    fn motion(x: &[Vector<3>], closer: f64) -> Vec<f64> {
        let mut s = 5u64;
        x.iter()
            .flat_map(|x| {
                let shift = if x.z > 5.0 * H { -closer } else { 0.0 };
                [0.3 * shift, 0.0, shift].map(|v| {
                    s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    v + 0.05 * H * ((s >> 11) as f64 / (1u64 << 53) as f64)
                })
            })
            .collect()
    }

    fn contact(x: &[Vector<3>], volume: &[f64]) -> Contact<3> {
        Contact::new(&ContactSetup {
            position: x,
            volume,
            rows: &[],
            spacing: H,
            approach: 0.9,
            stiffness: 7.0,
            skin: 0.25 * H,
            cracks: Vec::new(),
            horizon: 0.0,
        })
        .unwrap()
    }

    #[test]
    fn pushes_are_those_of_all_pairs_and_derive_from_the_energy() {
        let (x, volume) = blocks();
        let bonded = |i: usize, j: usize| i % 2 == j % 2;
        let mut contact = contact(&x, &volume);
        for closer in [0.0, H, 2.0 * H, 2.1 * H] {
            let u = motion(&x, closer);
            let y = |i: usize| x[i] + Vector::<3>::from_column_slice(&u[3 * i..3 * i + 3]);
            let mut force = vec![0.0; u.len()];
            contact.add_force(&u, &bonded, &mut force);
            let mut pushing = 0;
            let mut energy = 0.0;
            for i in 0..x.len() {
                let mut expected = Vector::<3>::zeros();
                for j in 0..x.len() {
                    let r = (y(j) - y(i)).norm();
                    let d = 0.9 * (x[j] - x[i]).norm().min(H);
                    if i != j && !bonded(i, j) && r < d {
                        expected += (y(j) - y(i)) / r * (7.0 * (d - r) * volume[i] * volume[j]);
                        energy += 0.25 * 7.0 * (d - r).powi(2) * volume[i] * volume[j];
                        pushing += 1;
                    }
                }
                let got = Vector::<3>::from_column_slice(&force[3 * i..3 * i + 3]);
                assert!((got - expected).norm() <= 1e-14 * 7.0 * H * 1e-6);
            }
            assert_eq!(pushing > 0, closer > 1.5 * H, "{closer} {pushing}");
            assert!((contact.energy(&u, &bonded) - energy).abs() <= 1e-13 * energy);
            let total: f64 = force.iter().skip(2).step_by(3).sum();
            assert!(total.abs() < 1e-20);
            if pushing > 0 {
                // along a direction the work is the change of energy
                let step: Vec<f64> = u
                    .iter()
                    .enumerate()
                    .map(|(k, _)| 1e-6 * H * ((k * 7 % 11) as f64 - 5.0))
                    .collect();
                let moved =
                    |s: f64| -> Vec<f64> { u.iter().zip(&step).map(|(u, d)| u + s * d).collect() };
                let slope = 0.5
                    * (contact.energy(&moved(1.0), &bonded)
                        - contact.energy(&moved(-1.0), &bonded));
                let work: f64 = force.iter().zip(&step).map(|(f, d)| f * d).sum();
                assert!(
                    (slope - work).abs() < 1e-6 * work.abs(),
                    "{slope:e} {work:e}"
                );
            }
        }
        assert!(contact.rebuilds() > 1);
    }

    #[test]
    fn when_pairs_were_listed_and_threads_do_not_change_a_bit() {
        let (x, volume) = blocks();
        let apart = |_: usize, _: usize| false;
        let run = |threads: usize, warm: &[f64]| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| {
                let mut contact = contact(&x, &volume);
                let mut force = vec![0.0; 3 * x.len()];
                for closer in warm {
                    contact.add_force(&motion(&x, *closer), &apart, &mut force);
                }
                force.fill(0.0);
                contact.add_force(&motion(&x, 2.05 * H), &apart, &mut force);
                (force, contact.rebuilds())
            })
        };
        let (fresh, _) = run(1, &[]);
        let (kept, rebuilds) = run(2, &[0.0, 2.0 * H]);
        assert_eq!(rebuilds, 2);
        assert!(fresh.iter().any(|f| *f != 0.0));
        assert_eq!(fresh, kept);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let (x, volume) = blocks();
        let setup = ContactSetup {
            position: &x,
            volume: &volume,
            rows: &[],
            spacing: H,
            approach: 0.9,
            stiffness: 1.0,
            skin: 0.0,
            cracks: Vec::new(),
            horizon: 0.0,
        };
        let message = |s: &ContactSetup<'_, 3>| {
            Contact::new(s)
                .err()
                .map(|e| e.to_string())
                .unwrap_or_default()
        };
        assert!(message(&setup).contains("the skin is 0"));
        let short = ContactSetup {
            skin: H,
            volume: &volume[1..],
            ..setup
        };
        assert!(message(&short).contains("volume has 239 entries for 240"));
    }
}
