//! The two loops over the bonds of points that have a stress ([`super::point_forces`]).
//!
//! Vectors are padded to a width of 1, 2 or 4 numbers, which a machine adds and multiplies at once, and both loops are compiled for the instruction set at hand; all of them
//! fuse multiplication and addition, so that they have the same bits.

use rayon::prelude::*;

use super::simd::{Lanes, Work, dispatch};
use crate::{
    parallel,
    tensor::{Tensor, Vector},
};

/// Numbers of a padded vector of so many components.
const fn width(components: usize) -> usize {
    components.next_power_of_two()
}

/// Components of a vector of this width.
const fn components(width: usize) -> usize {
    if width == 4 { 3 } else { width }
}

/// Points that a task pads.
const POINTS: usize = 256;

/// Position, displacement and, for a drag, velocity of every point.
#[derive(Default)]
pub(super) struct Sites {
    padded: Vec<f64>,
    has_velocity: bool,
}

impl Sites {
    pub(super) fn set<const D: usize>(
        &mut self,
        position: &[Vector<D>],
        u: &[f64],
        velocity: Option<&[f64]>,
    ) {
        let (width, each) = (width(D), 2 + usize::from(velocity.is_some()));
        self.has_velocity = velocity.is_some();
        self.padded.resize(position.len() * each * width, 0.0);
        parallel::for_each_chunk(
            &mut self.padded,
            POINTS * each * width,
            1,
            |chunk, sites| {
                for (k, site) in sites.chunks_exact_mut(each * width).enumerate() {
                    let i = chunk * POINTS + k;
                    let of =
                        |all: &'_ [f64]| -> [f64; D] { std::array::from_fn(|a| all[i * D + a]) };
                    site[..D].copy_from_slice(position[i].as_slice());
                    site[width..][..D].copy_from_slice(&of(u));
                    if let Some(velocity) = velocity {
                        site[2 * width..][..D].copy_from_slice(&of(velocity));
                    }
                }
            },
        );
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.padded.len() * 8
    }
}

/// The bonds of a point: their far ends, with a weight for each.
#[derive(Clone, Copy)]
pub(super) struct Bonds<'a> {
    pub(super) point: usize,
    pub(super) far: &'a [u32],
    pub(super) weights: &'a [f64],
}

/// Sums over the bonds of a family.
pub(super) struct Moments<const D: usize> {
    /// `Σ w η ⊗ ξ` \[m^(D+2)\].
    pub(super) displacement: Tensor<D>,
    /// `Σ w η` \[m^(D+1)\].
    pub(super) first: Vector<D>,
    pub(super) rates: RateMoments<D>,
}

/// Sums with the velocities of the bonds; zero where there is no drag.
pub(super) struct RateMoments<const D: usize> {
    /// `Σ w Ẏ ⊗ Y`.
    pub(super) rate: Tensor<D>,
    /// `Σ w Y ⊗ Y`.
    pub(super) shape: Tensor<D>,
    /// `Σ w Ẏ`.
    pub(super) first: Vector<D>,
    /// `Σ w |Ẏ|²`.
    pub(super) squares: f64,
}

/// The moments of a family, with `Y = ξ + η`, or `Y = ξ` where displacements are small.
pub(super) fn moments<const D: usize>(
    bonds: Bonds<'_>,
    sites: &Sites,
    is_small: bool,
) -> Moments<D> {
    match const { width(D) } {
        1 => moments_by_width::<D, 1>(bonds, sites, is_small),
        2 => moments_by_width::<D, 2>(bonds, sites, is_small),
        _ => moments_by_width::<D, 4>(bonds, sites, is_small),
    }
}

fn moments_by_width<const D: usize, const W: usize>(
    bonds: Bonds<'_>,
    sites: &Sites,
    is_small: bool,
) -> Moments<D> {
    let (padded, _) = sites.padded.as_chunks::<W>();
    let moved = if is_small { 0.0 } else { 1.0 };
    let sums = match sites.has_velocity {
        true => dispatch(Add::<W, true>(bonds, padded, moved)),
        false => dispatch(Add::<W, false>(bonds, padded, moved)),
    };
    let tensor = |columns: &[[f64; W]; W]| Tensor::from_fn(|a, b| columns[b][a]);
    let vector = |padded: &[f64; W]| Vector::from_fn(|a, _| padded[a]);
    Moments {
        displacement: tensor(&sums.displacement),
        first: vector(&sums.first),
        rates: RateMoments {
            rate: tensor(&sums.rate),
            shape: tensor(&sums.shape),
            first: vector(&sums.rate_first),
            squares: sums.squares.iter().sum(),
        },
    }
}

/// [`Moments`] by columns.
struct Sums<const W: usize> {
    displacement: [[f64; W]; W],
    first: [f64; W],
    rate: [[f64; W]; W],
    shape: [[f64; W]; W],
    rate_first: [f64; W],
    squares: [f64; W],
}

/// Bonds, sites, and what counts of displacements in `Y`.
struct Add<'a, const W: usize, const RATE: bool>(Bonds<'a>, &'a [[f64; W]], f64);

/// `sum += a x`.
#[inline(always)]
fn add<const W: usize>(sum: &mut [f64; W], a: f64, x: &[f64; W]) {
    for k in 0..W {
        sum[k] = x[k].mul_add(a, sum[k]);
    }
}

#[inline(always)]
fn less<const W: usize>(a: &[f64; W], b: &[f64; W]) -> [f64; W] {
    let mut difference = [0.0; W];
    for k in 0..W {
        difference[k] = a[k] - b[k];
    }
    difference
}

impl<const W: usize, const RATE: bool> Work for Add<'_, W, RATE> {
    type Output = Sums<W>;

    // loops, not closures: what a closure does is not compiled for the instruction set at hand
    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> Sums<W> {
        let Self(bonds, sites, moved) = self;
        let each = if RATE { 3 } else { 2 };
        let here = &sites[bonds.point * each..][..each];
        let (zeros, zero) = ([[0.0; W]; W], [0.0; W]);
        let (mut displacement, mut rate, mut shape) = (zeros, zeros, zeros);
        let (mut first, mut rate_first, mut squares) = (zero, zero, zero);
        for (&j, &w) in bonds.far.iter().zip(bonds.weights) {
            let there = &sites[j as usize * each..][..each];
            let xi = less(&there[0], &here[0]);
            let eta = less(&there[1], &here[1]);
            add(&mut first, w, &eta);
            for b in 0..const { components(W) } {
                add(&mut displacement[b], w * xi[b], &eta);
            }
            if RATE {
                let velocity = less(&there[2], &here[2]);
                let mut y = xi;
                add(&mut y, moved, &eta);
                add(&mut rate_first, w, &velocity);
                for b in 0..const { components(W) } {
                    add(&mut rate[b], w * y[b], &velocity);
                    add(&mut shape[b], w * y[b], &y);
                }
                for k in 0..W {
                    squares[k] = (velocity[k] * w).mul_add(velocity[k], squares[k]);
                }
            }
        }
        Sums {
            displacement,
            first,
            rate,
            shape,
            rate_first,
            squares,
        }
    }
}

/// Coefficients that every bond takes from its far point, of `B ξ + q η`, or with a drag of `(B − s L) ξ − s L η + s Ẏ`, as padded columns.
pub(super) struct Given {
    columns: Vec<f64>,
    has_velocity: bool,
}

impl Given {
    pub(super) fn new<const D: usize>(points: usize, has_velocity: bool) -> Self {
        let mut given = Self {
            columns: Vec::new(),
            has_velocity,
        };
        given.columns = vec![0.0; points * given.numbers(D)];
        given
    }

    /// Numbers of a point: the columns of a tensor or of two, and a factor.
    fn numbers(&self, dimension: usize) -> usize {
        let columns = match self.has_velocity {
            true => 2 * dimension,
            false => dimension,
        };
        (columns + 1) * width(dimension)
    }

    /// The places of all points, each to be filled by [`give`].
    pub(super) fn by_points(
        &mut self,
        dimension: usize,
    ) -> impl IndexedParallelIterator<Item = &mut [f64]> {
        let numbers = self.numbers(dimension);
        self.columns.par_chunks_exact_mut(numbers)
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.columns.len() * 8
    }
}

/// Fills the place of a point: a tensor for ξ, one for η (with a drag alone), and the factor of η or Ẏ.
pub(super) fn give<const D: usize>(
    place: &mut [f64],
    of_bond: &Tensor<D>,
    of_difference: Option<&Tensor<D>>,
    factor: f64,
) {
    let width = width(D);
    let (columns, last) = place.split_at_mut(place.len() - width);
    let tensors = std::iter::once(of_bond).chain(of_difference);
    for (to, tensor) in columns.chunks_exact_mut(D * width).zip(tensors) {
        for (b, column) in to.chunks_exact_mut(width).enumerate() {
            column[..D].copy_from_slice(tensor.column(b).as_slice());
        }
    }
    last.fill(factor);
}

/// Returns the sum of the forces that the far points give to the bonds of a point: `Σ w T`.
pub(super) fn taken<const D: usize>(bonds: Bonds<'_>, sites: &Sites, given: &Given) -> [f64; D] {
    match const { width(D) } {
        1 => taken_by_width::<D, 1>(bonds, sites, given),
        2 => taken_by_width::<D, 2>(bonds, sites, given),
        _ => taken_by_width::<D, 4>(bonds, sites, given),
    }
}

fn taken_by_width<const D: usize, const W: usize>(
    bonds: Bonds<'_>,
    sites: &Sites,
    given: &Given,
) -> [f64; D] {
    let sites = sites.padded.as_chunks::<W>().0;
    let columns = given.columns.as_chunks::<W>().0;
    let sum = match given.has_velocity {
        true => dispatch(Take::<W, true>(bonds, sites, columns)),
        false => dispatch(Take::<W, false>(bonds, sites, columns)),
    };
    std::array::from_fn(|a| sum[a])
}

/// Bonds, sites, and what they take from their far points.
struct Take<'a, const W: usize, const RATE: bool>(Bonds<'a>, &'a [[f64; W]], &'a [[f64; W]]);

impl<const W: usize, const RATE: bool> Work for Take<'_, W, RATE> {
    type Output = [f64; W];

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> [f64; W] {
        let Self(bonds, sites, given) = self;
        let each = if RATE { 3 } else { 2 };
        let tensor = const { components(W) };
        let columns = if RATE { 2 * tensor } else { tensor };
        let here = &sites[bonds.point * each..][..each];
        let mut sum = [0.0; W];
        for (&j, &w) in bonds.far.iter().zip(bonds.weights) {
            let there = &sites[j as usize * each..][..each];
            let given = &given[j as usize * (columns + 1)..][..columns + 1];
            let xi = less(&there[0], &here[0]);
            let eta = less(&there[1], &here[1]);
            let mut of = [0.0; W];
            for b in 0..tensor {
                add(&mut of, xi[b], &given[b]);
                if RATE {
                    add(&mut of, eta[b], &given[tensor + b]);
                }
            }
            let last = match RATE {
                true => less(&there[2], &here[2]),
                false => eta,
            };
            for k in 0..W {
                of[k] = given[columns][k].mul_add(last[k], of[k]);
            }
            add(&mut sum, w, &of);
        }
        sum
    }
}
