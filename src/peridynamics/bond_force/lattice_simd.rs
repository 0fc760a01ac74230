//! The inner loops of the lattice pass: eight neighbouring points against one bond of the stencil at a time.
//!
//! The neighbours of eight points in a row along one offset lie in a row as well, so a bond costs `D` plain loads and no index. Bits say which bonds
//! stand. Groups whose bits are all set, or whose volumes are all alike, skip what that makes superfluous.

use super::{
    simd::{LANES, Lanes, Source, Work},
    stencil::Offset,
    stretch::{CHI, PSI, SERIES_RANGE, SHORTEST},
};

/// Sums that a sweep computes.
pub(super) mod job {
    /// Forces of pairwise bonds.
    pub const PAIR: u8 = 0;
    /// Forces of state-based bonds.
    pub const SOLID: u8 = 1;
    /// `Σ w r² V e/r`, of which the dilatation is made, and `Σ w r² V (e/r)²`, of which the energy is.
    pub const MOMENTS: u8 = 2;
}

/// All bits of the group are set.
pub(super) const FULL: u8 = 1;
/// The volumes that the group sees are the lattice's own, and the law's coefficients are those of the group's points.
pub(super) const EVEN: u8 = 2;
/// Some bond needs care: beyond the range of the series, or beyond its critical stretch.
pub(super) const CARE: u8 = 4;
/// Nothing of the group is computed here: others do.
pub(super) const IDLE: u8 = 8;
/// Forces of the group are computed by others.
pub(super) const FOREIGN: u8 = 16;
/// Others wait for forces of the group.
pub(super) const EARLY: u8 = 32;
/// Nobody does.
pub(super) const LATE: u8 = 64;

/// Input of all tasks of a sweep.
#[derive(Clone, Copy)]
pub(super) struct Field<'a, const D: usize> {
    pub offsets: &'a [Offset<D>],
    /// Displacements.
    pub u: [Source<'a>; D],
    /// Volumes in parts of the lattice's own.
    pub volume: Source<'a>,
    /// `D (D+2) μ/m` and `(D k − (D+2) μ) θ/m`.
    pub deviatoric: Source<'a>,
    pub pull: Source<'a>,
    /// Least limit of `t` if bonds may break now, else infinite.
    pub limit: f64,
    /// Points whose bonds never fail, by cell; empty for none.
    pub no_fail: &'a [bool],
}

/// Bonds of one group along one offset that a sweep has broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Broken {
    pub group: u32,
    pub offset: u32,
    /// One bit per lane.
    pub lanes: u8,
}

/// Some groups and what belongs to them.
pub(super) struct Task<'a, 'f, const D: usize, const EXACT: bool, const JOB: u8> {
    pub field: &'a Field<'f, D>,
    /// Number of the first group.
    pub first: usize,
    /// Flags of groups that are left out.
    pub skip: u8,
    /// First cell of each group.
    pub groups: &'a [u32],
    /// One byte per group and offset.
    pub bits: Bits<'a>,
    pub flags: &'a mut [u8],
    /// `D` (forces) or two (moments) vectors per group.
    pub sums: &'a mut [[f64; LANES]],
}

/// Bits that may change or not.
pub(super) enum Bits<'a> {
    Held(&'a [u8]),
    Breaking(&'a mut [u8]),
}

struct Sums<V, const D: usize> {
    sum: [V; D],
    second: V,
    high: V,
    low: V,
}

/// ψ or χ from its series and, if `CAREFUL`, beyond the range of that from `s = √(1 + t)`: the same bits within the range either way.
/// With `ROOT` the function is ψ, `1/((1 + s) s)`, else χ, `1/(1 + s)`.
// A closure for either would not be compiled for the instruction set unless the compiler puts it in its place.
#[inline(always)]
pub(super) fn series<L: Lanes, const CAREFUL: bool, const ROOT: bool>(
    l: L,
    c: &[f64; 6],
    t: L::V,
) -> L::V {
    let mut p = l.splat(c[5]);
    for k in (0..5).rev() {
        p = l.fma(p, t, l.splat(c[k]));
    }
    if !CAREFUL {
        return p;
    }
    let range = l.splat(SERIES_RANGE);
    let outside = l.above(t, range) | l.above(l.splat(-SERIES_RANGE), t);
    if outside == 0 {
        return p;
    }
    let one = l.splat(1.0);
    let s = l.sqrt(l.max(l.add(one, t), l.splat(SHORTEST)));
    let mut below = l.add(one, s);
    if ROOT {
        below = l.mul(below, s);
    }
    l.select(outside, l.div(one, below), p)
}

/// The displacements of eight points.
///
/// # Safety
/// `cell` is that of a group of the field.
#[inline(always)]
unsafe fn displaced<L: Lanes, const D: usize>(
    l: L,
    field: &Field<'_, D>,
    cell: usize,
) -> [L::V; D] {
    let mut u = [l.splat(0.0); D];
    for a in 0..D {
        // SAFETY: group cells are what the sources were checked for
        u[a] = unsafe { field.u[a].at(l, cell, 0) };
    }
    u
}

/// `t` of one bond of eight points, and η.
///
/// # Safety
/// `cell` is that of a group of the field.
#[inline(always)]
unsafe fn stretched<L: Lanes, const D: usize, const EXACT: bool>(
    l: L,
    field: &Field<'_, D>,
    o: &Offset<D>,
    cell: usize,
    here: &[L::V; D],
) -> (L::V, [L::V; D]) {
    // SAFETY: group cells and offsets are what the sources were checked for
    // by loops: `array::from_fn` calls a closure that is not compiled for the instruction set unless the compiler puts it in its place
    let mut eta = *here;
    for a in 0..D {
        eta[a] = l.sub(unsafe { field.u[a].at(l, cell, o.delta) }, here[a]);
    }
    // η (η + 2ξ): no difference of lengths, so nothing cancels that is not small itself
    let mut t = l.splat(0.0);
    for a in 0..D {
        let factor = if EXACT {
            l.add(eta[a], l.splat(o.twice[a]))
        } else {
            l.splat(o.slope[a])
        };
        t = if a == 0 {
            l.mul(eta[a], factor)
        } else {
            l.fma(eta[a], factor, t)
        };
    }
    if EXACT {
        t = l.mul(t, l.splat(o.inverse));
    }
    (t, eta)
}

// One function: the kernel of one bond, unrolled for each law; its parts share the registers of a group.
/// The sums of one group. Without `MASK` all bits count as set, without `VARY` all volumes as the lattice's own; with `CAREFUL`, any `t` is right.
///
/// # Safety
/// `cell` is that of a group of the field.
#[inline(always)]
unsafe fn group<
    L: Lanes,
    const D: usize,
    const EXACT: bool,
    const JOB: u8,
    const MASK: bool,
    const VARY: bool,
    const CAREFUL: bool,
>(
    l: L,
    field: &Field<'_, D>,
    cell: usize,
    bits: &[u8],
) -> Sums<L::V, D> {
    let zero = l.splat(0.0);
    let one = l.splat(1.0);
    // SAFETY (all loads below): group cells and offsets are what the sources were checked for
    let here = unsafe { displaced(l, field, cell) };
    let (mut pull, mut deviatoric) = (zero, zero);
    if JOB == job::SOLID {
        pull = unsafe { field.pull.at(l, cell, 0) };
        deviatoric = unsafe { field.deviatoric.at(l, cell, 0) };
        if !VARY {
            deviatoric = l.add(deviatoric, deviatoric);
        }
    }
    let mut sums = Sums {
        sum: [zero; D],
        second: zero,
        high: zero,
        low: zero,
    };
    for (k, o) in field.offsets.iter().enumerate() {
        let (mut t, eta) = unsafe { stretched::<L, D, EXACT>(l, field, o, cell, &here) };
        if MASK && JOB != job::SOLID {
            t = l.keep(t, bits[k]);
        }
        if !CAREFUL && JOB != job::SOLID {
            sums.high = l.max(t, sums.high);
            if EXACT {
                sums.low = l.min(t, sums.low);
            }
        }
        if JOB == job::MOMENTS {
            let half = l.splat(0.5);
            let chi = if EXACT {
                series::<L, CAREFUL, false>(l, &CHI, t)
            } else {
                half
            };
            let e = l.mul(t, chi);
            let mut w = l.mul(e, l.splat(o.moment));
            if VARY {
                w = l.mul(w, unsafe { field.volume.at(l, cell, o.delta) });
            }
            sums.sum[0] = l.add(sums.sum[0], w);
            sums.second = l.fma(w, e, sums.second);
            continue;
        }
        let mut f = l.splat(o.weight);
        if JOB == job::PAIR {
            f = l.mul(f, t);
            let psi = if EXACT {
                series::<L, CAREFUL, true>(l, &PSI, t)
            } else {
                l.splat(0.5)
            };
            f = l.mul(f, psi);
        } else {
            let (mut there, mut stiffness) =
                (unsafe { field.pull.at(l, cell, o.delta) }, deviatoric);
            there = l.add(there, pull);
            if VARY {
                stiffness = l.add(stiffness, unsafe { field.deviatoric.at(l, cell, o.delta) });
            }
            if EXACT {
                let psi = series::<L, CAREFUL, true>(l, &PSI, t);
                // e/r = t (1 − (1 + t) ψ), r/|ξ+η| = 1 − t ψ
                let e = l.mul(t, l.fnma(t, psi, l.sub(one, psi)));
                let ratio = l.fnma(t, psi, one);
                f = l.mul(f, l.mul(l.fma(stiffness, e, there), ratio));
            } else {
                f = l.mul(f, l.fma(stiffness, l.mul(t, l.splat(0.5)), there));
            }
            if MASK {
                f = l.keep(f, bits[k]);
            }
        }
        if VARY {
            f = l.mul(f, unsafe { field.volume.at(l, cell, o.delta) });
        }
        for a in 0..D {
            let mut direction = l.splat(o.xi[a]);
            if EXACT {
                direction = l.add(direction, eta[a]);
            }
            sums.sum[a] = l.fma(f, direction, sums.sum[a]);
        }
    }
    sums
}

/// Breaks what is beyond its limit in one group, and lists it; returns whether anything broke.
///
/// # Safety
/// `cell` is that of a group of the field.
#[inline(always)]
unsafe fn break_bonds<L: Lanes, const D: usize, const EXACT: bool>(
    l: L,
    field: &Field<'_, D>,
    (group, cell): (usize, usize),
    bits: &mut [u8],
    list: &mut Vec<Broken>,
) -> bool {
    // SAFETY: as above
    let here = unsafe { displaced(l, field, cell) };
    let kept =
        |cell: usize| (0..LANES).fold(0u8, |m, k| m | u8::from(field.no_fail[cell + k]) << k);
    let kept_here = if field.no_fail.is_empty() {
        0
    } else {
        kept(cell)
    };
    let before = list.len();
    for (offset, (bits, o)) in bits.iter_mut().zip(field.offsets).enumerate() {
        let (t, _) = unsafe { stretched::<L, D, EXACT>(l, field, o, cell, &here) };
        let mut over = l.above(t, l.splat(o.limit)) & *bits & !kept_here;
        if over != 0 && !field.no_fail.is_empty() {
            over &= !kept((cell as isize + o.delta) as usize);
        }
        if over != 0 {
            *bits &= !over;
            list.push(Broken {
                group: group as u32,
                offset: offset as u32,
                lanes: over,
            });
        }
    }
    list.len() > before
}

impl<const D: usize, const EXACT: bool, const JOB: u8> Work for Task<'_, '_, D, EXACT, JOB> {
    type Output = Vec<Broken>;

    #[inline(always)]
    fn run<L: Lanes>(self, l: L) -> Vec<Broken> {
        let Task {
            field,
            first,
            skip,
            groups,
            mut bits,
            flags,
            sums,
        } = self;
        let stencil = field.offsets.len();
        let vectors = if JOB == job::MOMENTS { 2 } else { D };
        let range = if EXACT { SERIES_RANGE } else { f64::INFINITY };
        let (high, low) = (l.splat(range.min(field.limit)), l.splat(-range));
        let mut broken = Vec::new();
        for (g, cell) in groups.iter().map(|cell| *cell as usize).enumerate() {
            if flags[g] & skip != 0 {
                continue;
            }
            let span = g * stencil..(g + 1) * stencil;
            let here = match &bits {
                Bits::Held(b) => &b[span.clone()],
                Bits::Breaking(b) => &b[span.clone()],
            };
            // the forces of a state-based law know from the dilatations before them which groups need care
            let known = JOB == job::SOLID;
            let mut care = known && flags[g] & CARE != 0;
            let mut total = None;
            if !care {
                // SAFETY: `groups` are those of the field
                let s = unsafe {
                    match flags[g] & (FULL | EVEN) {
                        3 => group::<L, D, EXACT, JOB, false, false, false>(l, field, cell, here),
                        2 => group::<L, D, EXACT, JOB, true, false, false>(l, field, cell, here),
                        _ => group::<L, D, EXACT, JOB, true, true, false>(l, field, cell, here),
                    }
                };
                if !known {
                    let over = l.above(s.high, high) | if EXACT { l.above(low, s.low) } else { 0 };
                    care = over != 0;
                    flags[g] = flags[g] & !CARE | if care { CARE } else { 0 };
                }
                total = Some(s);
            }
            if care {
                if field.limit < f64::INFINITY
                    && let Bits::Breaking(b) = &mut bits
                {
                    // SAFETY: as above
                    let lost = unsafe {
                        let bits = &mut b[span.clone()];
                        break_bonds::<L, D, EXACT>(l, field, (first + g, cell), bits, &mut broken)
                    };
                    if lost {
                        flags[g] &= !FULL;
                    }
                }
                let here = match &bits {
                    Bits::Held(b) => &b[span],
                    Bits::Breaking(b) => &b[span],
                };
                // SAFETY: as above
                total = Some(unsafe {
                    group::<L, D, EXACT, JOB, true, true, true>(l, field, cell, here)
                });
            }
            if let Some(s) = total {
                let to = &mut sums[g * vectors..(g + 1) * vectors];
                if JOB == job::MOMENTS {
                    l.store(s.sum[0], &mut to[0]);
                    l.store(s.second, &mut to[1]);
                } else {
                    for a in 0..D {
                        l.store(s.sum[a], &mut to[a]);
                    }
                }
            }
        }
        broken
    }
}
