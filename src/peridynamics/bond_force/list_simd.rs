//! Eight bonds of a list at a time: gathered one by one, computed together.

use std::ops::Range;

use super::lattice_simd::{Bits, series};
use super::own_points::part;
use super::simd::{LANES, Lanes, Work, dispatch};
use super::stretch::{CHI, PSI};
use crate::peridynamics::bond_force::bond_list::{Limit, List};

/// Quantity summed over the bonds of a point.
#[derive(Clone, Copy)]
pub(super) enum Sum<'a> {
    /// Forces of a pairwise law.
    Pairwise,
    /// `Σ ω r e V`: the dilatation, but for a factor of the point.
    Extension,
    /// Forces of the state-based law, by the dilatation of every point.
    State(&'a [f64]),
}

/// Sums of a run of points, one number each for [`Sum::Extension`], else one per component. Breaks what is beyond its limit first, if bits may change:
/// theirs start with those of the first point. Returns which broke, as point and bond.
pub(super) fn add_up<const D: usize, const EXACT: bool>(
    list: &List<D>,
    points: Range<usize>,
    u: &[f64],
    sum: Sum<'_>,
    bits: Bits<'_>,
    sums: &mut [f64],
) -> Vec<(u32, usize)> {
    dispatch(Points::<D, EXACT> {
        list,
        points,
        u,
        sum,
        bits,
        sums,
    })
}

struct Points<'a, const D: usize, const EXACT: bool> {
    list: &'a List<D>,
    points: Range<usize>,
    u: &'a [f64],
    sum: Sum<'a>,
    bits: Bits<'a>,
    sums: &'a mut [f64],
}

/// Numbers of the other ends, by lanes; zero where there is no bond.
struct Gathered<const D: usize> {
    position: [[f64; LANES]; D],
    displacement: [[f64; LANES]; D],
    volume: [f64; LANES],
    weight: [f64; LANES],
    neighbours: [usize; LANES],
}

impl<const D: usize> Gathered<D> {
    #[inline(always)]
    fn of(list: &List<D>, i: usize, bonds: Range<usize>, u: &[f64]) -> Self {
        let neighbours = list.neighbours.eight(i, bonds.clone());
        let mut all = Self {
            position: [[0.0; LANES]; D],
            displacement: [[0.0; LANES]; D],
            volume: [0.0; LANES],
            weight: list.weights.eight(bonds.clone()),
            neighbours,
        };
        for k in 0..bonds.len() {
            let j = neighbours[k];
            let (x, v) = (&list.position[j], &u[j * D..][..D]);
            for a in 0..D {
                all.position[a][k] = x[a];
                all.displacement[a][k] = v[a];
            }
            all.volume[k] = list.volume[j];
        }
        all
    }
}

/// `1 − r/|ξ+η|`, linear: `ξ·η/r²`.
#[inline(always)]
fn shortening<L: Lanes, const EXACT: bool>(l: L, t: L::V) -> L::V {
    if EXACT {
        l.mul(t, series::<L, true, true>(l, &PSI, t))
    } else {
        l.mul(t, l.splat(0.5))
    }
}

/// `(|ξ+η| − r)/r`, linear: `ξ·η/r²`.
#[inline(always)]
fn extension<L: Lanes, const EXACT: bool>(l: L, t: L::V) -> L::V {
    if EXACT {
        l.mul(t, series::<L, true, false>(l, &CHI, t))
    } else {
        l.mul(t, l.splat(0.5))
    }
}

impl<const D: usize, const EXACT: bool> Work for Points<'_, D, EXACT> {
    type Output = Vec<(u32, usize)>;

    // One function: closures and calls would leave the instruction set that the loop is compiled for, and all of it shares the registers of a point.
    #[inline(always)]
    fn run<L: Lanes>(self, l: L) -> Vec<(u32, usize)> {
        let Self {
            list,
            points,
            u,
            sum: what,
            mut bits,
            sums,
        } = self;
        let start = list.bytes[points.start];
        let width = if matches!(what, Sum::Extension) { 1 } else { D };
        let mut broken = Vec::new();
        for (i, result) in points.zip(sums.chunks_exact_mut(width)) {
            let computed = list.parts.get(i).copied().unwrap_or(part::OWN);
            let is_breaking =
                matches!(bits, Bits::Breaking(_)) && !list.no_fail[i] && computed >= part::SEEN;
            let is_summed = match what {
                Sum::Extension => computed >= part::SEEN,
                _ => list.row[i] && computed == part::OWN,
            };
            result.fill(0.0);
            if !(is_breaking || is_summed) {
                continue;
            }
            // loops, not closures: what a closure does is not compiled for the instruction set at hand
            let zero = [l.splat(0.0); D];
            let (mut x, mut v, mut total) = (zero, zero, zero);
            for a in 0..D {
                x[a] = l.splat(list.position[i][a]);
                v[a] = l.splat(u[i * D + a]);
            }
            let (from, to) = (list.offsets[i], list.offsets[i + 1]);
            for (place, first) in (from..to).step_by(LANES).enumerate() {
                let place = list.bytes[i] + place;
                let mut mask = match &bits {
                    Bits::Held(all) => all[place],
                    Bits::Breaking(own) => own[place - start],
                };
                if mask == 0 {
                    continue;
                }
                let bonds = first..(first + LANES).min(to);
                let g = Gathered::of(list, i, bonds.clone(), u);
                let (mut xi, mut eta) = (zero, zero);
                for a in 0..D {
                    xi[a] = l.sub(l.load(&g.position[a]), x[a]);
                    eta[a] = l.sub(l.load(&g.displacement[a]), v[a]);
                }
                let (mut excess, mut length) = (l.splat(0.0), l.splat(0.0));
                for a in 0..D {
                    let twice = l.add(xi[a], xi[a]);
                    // η (η + 2ξ): no difference of lengths
                    let factor = if EXACT { l.add(eta[a], twice) } else { twice };
                    excess = l.fma(eta[a], factor, excess);
                    length = l.fma(xi[a], xi[a], length);
                }
                if is_breaking {
                    let limit = match &list.limit {
                        Limit::Never => l.splat(f64::INFINITY),
                        Limit::Uniform(t) => l.splat(*t),
                        Limit::PerBond(t) => {
                            let mut eight = [f64::INFINITY; LANES];
                            eight[..bonds.len()].copy_from_slice(&t[bonds.clone()]);
                            l.load(&eight)
                        }
                    };
                    let mut gone = mask & l.above(excess, l.mul(limit, length));
                    if gone != 0 {
                        for (k, &j) in g.neighbours.iter().enumerate() {
                            gone &= !(u8::from(list.no_fail[j]) << k);
                        }
                        let lanes = (0..LANES).filter(|k| gone >> k & 1 == 1);
                        broken.extend(lanes.map(|k| (i as u32, first + k)));
                        mask &= !gone;
                        if let Bits::Breaking(own) = &mut bits {
                            own[place - start] = mask;
                        }
                    }
                }
                if !is_summed {
                    continue;
                }
                let t = l.div(excess, length);
                let weighted = l.mul(l.load(&g.weight), l.load(&g.volume));
                let f = match (what, &list.solid) {
                    (Sum::State(theta), Some(c)) => {
                        let (mut volumetric, mut deviatoric) = ([0.0; LANES], [0.0; LANES]);
                        for k in 0..bonds.len() {
                            let j = g.neighbours[k];
                            volumetric[k] = c.volumetric[j] * theta[j];
                            deviatoric[k] = c.deviatoric[j];
                        }
                        let volumetric =
                            l.add(l.load(&volumetric), l.splat(c.volumetric[i] * theta[i]));
                        let deviatoric = l.add(l.load(&deviatoric), l.splat(c.deviatoric[i]));
                        let f = l.mul(
                            weighted,
                            l.fma(deviatoric, extension::<L, EXACT>(l, t), volumetric),
                        );
                        if EXACT {
                            l.fnma(f, shortening::<L, EXACT>(l, t), f)
                        } else {
                            f
                        }
                    }
                    (Sum::Extension, _) => {
                        l.mul(weighted, l.mul(length, extension::<L, EXACT>(l, t)))
                    }
                    (Sum::Pairwise, _) | (Sum::State(_), None) => {
                        l.mul(weighted, shortening::<L, EXACT>(l, t))
                    }
                };
                // where there is no bond, 0/0
                let f = l.keep(f, mask);
                if matches!(what, Sum::Extension) {
                    total[0] = l.add(total[0], f);
                } else {
                    for a in 0..D {
                        let direction = if EXACT { l.add(xi[a], eta[a]) } else { xi[a] };
                        total[a] = l.fma(f, direction, total[a]);
                    }
                }
            }
            for (result, total) in result.iter_mut().zip(total) {
                let mut eight = [0.0; LANES];
                l.store(total, &mut eight);
                *result = eight.iter().sum();
            }
        }
        broken
    }
}
