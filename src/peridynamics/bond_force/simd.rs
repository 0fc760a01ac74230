//! Eight numbers at a time: AVX-512, twice AVX2, or plain code, chosen at run time.
//!
//! All three do the same operations lane by lane, with fused multiplication and addition everywhere, so results do not depend on which one runs.
//! With `lattice_simd.rs` and `src/parallel.rs` the only file of the library with `unsafe` code: intrinsics, and loads that [`Source`] has checked.

/// Numbers per vector.
pub(super) const LANES: usize = 8;

/// Operations on vectors of eight `f64`; masks have one bit per lane.
pub(super) trait Lanes: Copy {
    /// Eight numbers.
    type V: Copy;

    fn splat(self, x: f64) -> Self::V;
    fn load(self, x: &[f64; LANES]) -> Self::V;
    fn store(self, x: Self::V, to: &mut [f64; LANES]);
    fn add(self, a: Self::V, b: Self::V) -> Self::V;
    fn sub(self, a: Self::V, b: Self::V) -> Self::V;
    fn mul(self, a: Self::V, b: Self::V) -> Self::V;
    fn div(self, a: Self::V, b: Self::V) -> Self::V;
    fn sqrt(self, a: Self::V) -> Self::V;
    /// The larger one.
    fn max(self, a: Self::V, b: Self::V) -> Self::V;
    /// The smaller one.
    fn min(self, a: Self::V, b: Self::V) -> Self::V;
    /// `a b + c`, rounded once.
    fn fma(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// `c − a b`, rounded once.
    fn fnma(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// `a` where the mask has a bit, zero elsewhere.
    fn keep(self, a: Self::V, mask: u8) -> Self::V;
    /// `a` where the mask has a bit, `b` elsewhere.
    fn select(self, mask: u8, a: Self::V, b: Self::V) -> Self::V;
    /// Mask of the lanes with `a > b`.
    fn above(self, a: Self::V, b: Self::V) -> u8;
}

/// Work that is compiled for every instruction set.
pub(super) trait Work {
    type Output;
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}

/// Does the work with the widest instructions that the machine has.
#[inline]
pub(super) fn dispatch<W: Work>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
            // SAFETY: the features were detected
            return unsafe { x86::with_avx512(work) };
        }
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the features were detected
            return unsafe { x86::with_avx2(work) };
        }
    }
    work.run(Plain)
}

/// The instruction set that [`dispatch`] chooses.
pub(super) fn instructions() -> &'static str {
    struct Name;
    impl Work for Name {
        type Output = &'static str;
        fn run<L: Lanes>(self, _: L) -> &'static str {
            std::any::type_name::<L>()
                .rsplit("::")
                .next()
                .unwrap_or("plain")
        }
    }
    dispatch(Name)
}

/// Numbers to load from at offsets that were checked once for all.
#[derive(Clone, Copy)]
pub(super) struct Source<'a>(&'a [f64]);

impl<'a> Source<'a> {
    /// Numbers from which eight can be loaded at each of `starts + offsets`, both given by their least and largest.
    ///
    /// # Panics
    /// If that reaches beyond them, which is a mistake of this module.
    pub(super) fn new(numbers: &'a [f64], starts: (usize, usize), offsets: (isize, isize)) -> Self {
        assert!(
            starts.0 as isize + offsets.0 >= 0
                && starts.1 as isize + offsets.1 + LANES as isize <= numbers.len() as isize
        );
        Self(numbers)
    }

    /// The eight numbers from `start + offset` on.
    ///
    /// # Safety
    /// Both lie within the ranges that [`Source::new`] was given.
    #[inline(always)]
    pub(super) unsafe fn at<L: Lanes>(self, lanes: L, start: usize, offset: isize) -> L::V {
        // SAFETY: checked by `new`, as the caller promises
        lanes.load(unsafe {
            &*self
                .0
                .as_ptr()
                .offset(start as isize + offset)
                .cast::<[f64; LANES]>()
        })
    }
}

/// Without intrinsics.
#[derive(Clone, Copy)]
pub(super) struct Plain;

#[inline(always)]
fn each(f: impl Fn(usize) -> f64) -> [f64; LANES] {
    let mut all = [0.0; LANES];
    for k in 0..LANES {
        all[k] = f(k);
    }
    all
}

impl Lanes for Plain {
    type V = [f64; LANES];

    #[inline(always)]
    fn splat(self, x: f64) -> Self::V {
        [x; LANES]
    }
    #[inline(always)]
    fn load(self, x: &[f64; LANES]) -> Self::V {
        *x
    }
    #[inline(always)]
    fn store(self, x: Self::V, to: &mut [f64; LANES]) {
        *to = x;
    }
    #[inline(always)]
    fn add(self, a: Self::V, b: Self::V) -> Self::V {
        each(|k| a[k] + b[k])
    }
    #[inline(always)]
    fn sub(self, a: Self::V, b: Self::V) -> Self::V {
        each(|k| a[k] - b[k])
    }
    #[inline(always)]
    fn mul(self, a: Self::V, b: Self::V) -> Self::V {
        each(|k| a[k] * b[k])
    }
    #[inline(always)]
    fn div(self, a: Self::V, b: Self::V) -> Self::V {
        each(|k| a[k] / b[k])
    }
    #[inline(always)]
    fn sqrt(self, a: Self::V) -> Self::V {
        each(|k| a[k].sqrt())
    }
    #[inline(always)]
    fn max(self, a: Self::V, b: Self::V) -> Self::V {
        each(|k| if a[k] > b[k] { a[k] } else { b[k] })
    }
    #[inline(always)]
    fn min(self, a: Self::V, b: Self::V) -> Self::V {
        each(|k| if a[k] < b[k] { a[k] } else { b[k] })
    }
    #[inline(always)]
    fn fma(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V {
        each(|k| a[k].mul_add(b[k], c[k]))
    }
    #[inline(always)]
    fn fnma(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V {
        each(|k| (-a[k]).mul_add(b[k], c[k]))
    }
    #[inline(always)]
    fn keep(self, a: Self::V, mask: u8) -> Self::V {
        each(|k| if mask >> k & 1 == 1 { a[k] } else { 0.0 })
    }
    #[inline(always)]
    fn select(self, mask: u8, a: Self::V, b: Self::V) -> Self::V {
        each(|k| if mask >> k & 1 == 1 { a[k] } else { b[k] })
    }
    #[inline(always)]
    fn above(self, a: Self::V, b: Self::V) -> u8 {
        (0..LANES).fold(0, |m, k| m | u8::from(a[k] > b[k]) << k)
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{LANES, Lanes, Work};
    use std::arch::x86_64::*;

    /// One register of eight. Made only by [`with_avx512`].
    #[derive(Clone, Copy)]
    pub(super) struct Avx512(());

    /// Two registers of four. Made only by [`with_avx2`].
    #[derive(Clone, Copy)]
    pub(super) struct Avx2(());

    #[target_feature(enable = "avx512f,avx512dq,avx2,fma")]
    pub(super) fn with_avx512<W: Work>(work: W) -> W::Output {
        work.run(Avx512(()))
    }

    #[target_feature(enable = "avx2,fma")]
    pub(super) fn with_avx2<W: Work>(work: W) -> W::Output {
        work.run(Avx2(()))
    }

    // SAFETY of all below: the types exist only where the features were detected, and the references are to eight numbers.
    impl Lanes for Avx512 {
        type V = __m512d;

        #[inline(always)]
        fn splat(self, x: f64) -> Self::V {
            unsafe { _mm512_set1_pd(x) }
        }
        #[inline(always)]
        fn load(self, x: &[f64; LANES]) -> Self::V {
            unsafe { _mm512_loadu_pd(x.as_ptr()) }
        }
        #[inline(always)]
        fn store(self, x: Self::V, to: &mut [f64; LANES]) {
            unsafe { _mm512_storeu_pd(to.as_mut_ptr(), x) }
        }
        #[inline(always)]
        fn add(self, a: Self::V, b: Self::V) -> Self::V {
            unsafe { _mm512_add_pd(a, b) }
        }
        #[inline(always)]
        fn sub(self, a: Self::V, b: Self::V) -> Self::V {
            unsafe { _mm512_sub_pd(a, b) }
        }
        #[inline(always)]
        fn mul(self, a: Self::V, b: Self::V) -> Self::V {
            unsafe { _mm512_mul_pd(a, b) }
        }
        #[inline(always)]
        fn div(self, a: Self::V, b: Self::V) -> Self::V {
            unsafe { _mm512_div_pd(a, b) }
        }
        #[inline(always)]
        fn sqrt(self, a: Self::V) -> Self::V {
            unsafe { _mm512_sqrt_pd(a) }
        }
        #[inline(always)]
        fn max(self, a: Self::V, b: Self::V) -> Self::V {
            unsafe { _mm512_max_pd(a, b) }
        }
        #[inline(always)]
        fn min(self, a: Self::V, b: Self::V) -> Self::V {
            unsafe { _mm512_min_pd(a, b) }
        }
        #[inline(always)]
        fn fma(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V {
            unsafe { _mm512_fmadd_pd(a, b, c) }
        }
        #[inline(always)]
        fn fnma(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V {
            unsafe { _mm512_fnmadd_pd(a, b, c) }
        }
        #[inline(always)]
        fn keep(self, a: Self::V, mask: u8) -> Self::V {
            unsafe { _mm512_maskz_mov_pd(mask, a) }
        }
        #[inline(always)]
        fn select(self, mask: u8, a: Self::V, b: Self::V) -> Self::V {
            unsafe { _mm512_mask_blend_pd(mask, b, a) }
        }
        #[inline(always)]
        fn above(self, a: Self::V, b: Self::V) -> u8 {
            unsafe { _mm512_cmp_pd_mask::<_CMP_GT_OQ>(a, b) }
        }
    }

    #[inline(always)]
    fn both(
        a: [__m256d; 2],
        b: [__m256d; 2],
        f: impl Fn(__m256d, __m256d) -> __m256d,
    ) -> [__m256d; 2] {
        [f(a[0], b[0]), f(a[1], b[1])]
    }

    /// All bits of a lane set where the mask has its bit.
    #[inline(always)]
    fn spread(mask: u8) -> [__m256d; 2] {
        unsafe {
            let m = _mm256_set1_epi64x(i64::from(mask));
            let low = _mm256_setr_epi64x(1, 2, 4, 8);
            let high = _mm256_setr_epi64x(16, 32, 64, 128);
            [
                _mm256_castsi256_pd(_mm256_cmpeq_epi64(_mm256_and_si256(m, low), low)),
                _mm256_castsi256_pd(_mm256_cmpeq_epi64(_mm256_and_si256(m, high), high)),
            ]
        }
    }

    impl Lanes for Avx2 {
        type V = [__m256d; 2];

        #[inline(always)]
        fn splat(self, x: f64) -> Self::V {
            unsafe { [_mm256_set1_pd(x); 2] }
        }
        #[inline(always)]
        fn load(self, x: &[f64; LANES]) -> Self::V {
            unsafe {
                [
                    _mm256_loadu_pd(x.as_ptr()),
                    _mm256_loadu_pd(x.as_ptr().add(4)),
                ]
            }
        }
        #[inline(always)]
        fn store(self, x: Self::V, to: &mut [f64; LANES]) {
            unsafe {
                _mm256_storeu_pd(to.as_mut_ptr(), x[0]);
                _mm256_storeu_pd(to.as_mut_ptr().add(4), x[1]);
            }
        }
        #[inline(always)]
        fn add(self, a: Self::V, b: Self::V) -> Self::V {
            both(a, b, |a, b| unsafe { _mm256_add_pd(a, b) })
        }
        #[inline(always)]
        fn sub(self, a: Self::V, b: Self::V) -> Self::V {
            both(a, b, |a, b| unsafe { _mm256_sub_pd(a, b) })
        }
        #[inline(always)]
        fn mul(self, a: Self::V, b: Self::V) -> Self::V {
            both(a, b, |a, b| unsafe { _mm256_mul_pd(a, b) })
        }
        #[inline(always)]
        fn div(self, a: Self::V, b: Self::V) -> Self::V {
            both(a, b, |a, b| unsafe { _mm256_div_pd(a, b) })
        }
        #[inline(always)]
        fn sqrt(self, a: Self::V) -> Self::V {
            unsafe { [_mm256_sqrt_pd(a[0]), _mm256_sqrt_pd(a[1])] }
        }
        #[inline(always)]
        fn max(self, a: Self::V, b: Self::V) -> Self::V {
            both(a, b, |a, b| unsafe { _mm256_max_pd(a, b) })
        }
        #[inline(always)]
        fn min(self, a: Self::V, b: Self::V) -> Self::V {
            both(a, b, |a, b| unsafe { _mm256_min_pd(a, b) })
        }
        #[inline(always)]
        fn fma(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V {
            unsafe {
                [
                    _mm256_fmadd_pd(a[0], b[0], c[0]),
                    _mm256_fmadd_pd(a[1], b[1], c[1]),
                ]
            }
        }
        #[inline(always)]
        fn fnma(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V {
            unsafe {
                [
                    _mm256_fnmadd_pd(a[0], b[0], c[0]),
                    _mm256_fnmadd_pd(a[1], b[1], c[1]),
                ]
            }
        }
        #[inline(always)]
        fn keep(self, a: Self::V, mask: u8) -> Self::V {
            both(a, spread(mask), |a, m| unsafe { _mm256_and_pd(a, m) })
        }
        #[inline(always)]
        fn select(self, mask: u8, a: Self::V, b: Self::V) -> Self::V {
            let m = spread(mask);
            unsafe {
                [
                    _mm256_blendv_pd(b[0], a[0], m[0]),
                    _mm256_blendv_pd(b[1], a[1], m[1]),
                ]
            }
        }
        #[inline(always)]
        fn above(self, a: Self::V, b: Self::V) -> u8 {
            unsafe {
                let low = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_GT_OQ>(a[0], b[0]));
                let high = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_GT_OQ>(a[1], b[1]));
                (low | high << 4) as u8
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every operation once, over numbers with signs, zeros and a mask.
    fn all<L: Lanes>(l: L) -> Vec<u64> {
        let x: [f64; LANES] = std::array::from_fn(|k| (k as f64 - 3.0) / 7.0);
        let y: [f64; LANES] = std::array::from_fn(|k| 1.0 / (3.0 + k as f64));
        let (a, b) = (l.load(&x), l.load(&y));
        let above = l.above(a, b);
        let results = [
            l.splat(0.1),
            l.add(a, b),
            l.sub(a, b),
            l.mul(a, b),
            l.div(a, b),
            l.sqrt(b),
            l.max(a, b),
            l.min(a, b),
            l.fma(a, b, a),
            l.fnma(a, b, b),
            l.keep(a, 0b1010_0110),
            l.select(above, a, b),
        ];
        let mut bits = vec![u64::from(above)];
        for r in results {
            let mut to = [0.0; LANES];
            l.store(r, &mut to);
            bits.extend(to.map(f64::to_bits));
        }
        bits
    }

    #[test]
    fn instruction_sets_agree_bit_for_bit() {
        struct All;
        impl Work for All {
            type Output = Vec<u64>;
            fn run<L: Lanes>(self, l: L) -> Vec<u64> {
                all(l)
            }
        }
        let plain = All.run(Plain);
        assert_eq!(dispatch(All), plain);
        assert_eq!(plain[0], 0b1111_0000 & plain[0]);
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the features were detected
            assert_eq!(unsafe { x86::with_avx2(All) }, plain);
        }
    }
}
