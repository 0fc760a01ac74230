//! A convolution on a periodic grid of at most three axes by real fast Fourier transforms.
//!
//! Transforms along the first axis, the product with the symbol and the transform back are one pass over memory, and lines that hold only zeros, or
//! whose result nobody reads, are left out. Every number is computed by one thread in one order: the result does not depend on how many there are.

use std::sync::Arc;

use rayon::prelude::*;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftPlanner, num_complex::Complex};

type C = Complex<f64>;

/// A periodic grid and the box of it, from its first corner, that holds values.
///
/// Axes are numbered 0, 1, 2; fewer dimensions have leading axes of length one. Values of the box are stored component by component, the last axis
/// fastest.
pub struct Periodic {
    period: [usize; 3],
    inner: [usize; 3],
    forward: [Arc<dyn Fft<f64>>; 2],
    backward: [Arc<dyn Fft<f64>>; 2],
    real: Arc<dyn RealToComplex<f64>>,
    complex: Arc<dyn ComplexToReal<f64>>,
}

/// Smallest even number from `n` on without prime factors above 7.
pub fn smooth_length(n: usize) -> usize {
    let smooth = |mut k: usize| {
        for p in [2, 3, 5, 7] {
            while k.is_multiple_of(p) {
                k /= p;
            }
        }
        k == 1
    };
    (n.max(2)..).find(|&k| k % 2 == 0 && smooth(k)).unwrap_or(n)
}

impl Periodic {
    /// A grid of that period (the last one even) around a box of values.
    pub fn new(period: [usize; 3], inner: [usize; 3]) -> Self {
        let mut planner = FftPlanner::new();
        let mut real = RealFftPlanner::new();
        Self {
            period,
            inner,
            forward: [0, 1].map(|a| planner.plan_fft_forward(period[a])),
            backward: [0, 1].map(|a| planner.plan_fft_inverse(period[a])),
            real: real.plan_fft_forward(period[2]),
            complex: real.plan_fft_inverse(period[2]),
        }
    }

    /// Number of values of one component.
    pub fn values(&self) -> usize {
        self.inner.iter().product()
    }

    /// Modes along each axis; half of them along the last.
    pub fn modes(&self) -> [usize; 3] {
        [self.period[0], self.period[1], self.period[2] / 2 + 1]
    }

    /// `y = S x`, where `S` acts on the modes of the components; `y` is overwritten.
    ///
    /// `symbol` takes the numbers of a mode and its components, and multiplies them in place. Shapes: `x`, `y` hold `components` boxes of values.
    pub fn convolve(
        &self,
        components: usize,
        x: &[f64],
        y: &mut [f64],
        symbol: impl Fn([usize; 3], &mut [C; 3]) + Sync,
    ) {
        let mut planes = self.to_modes(components, x);
        let slabs = self.apply_symbol(components, &planes, symbol);
        self.to_values(components, &slabs, &mut planes, y);
    }

    /// The modes along axes 2 and 1 of planes of constant i0: [component][i0][k2][k1].
    fn to_modes(&self, components: usize, x: &[f64]) -> Vec<C> {
        let [_, m1, m2] = self.modes();
        let [n0, n1, n2] = self.inner;
        let plane = m2 * m1;
        let mut planes = vec![C::default(); components * n0 * plane];
        planes
            .par_chunks_mut(plane)
            .zip(x.par_chunks(n1 * n2))
            .for_each_init(
                || {
                    (
                        self.real.make_input_vec(),
                        self.real.make_output_vec(),
                        self.real.make_scratch_vec(),
                        vec![C::default(); self.forward[1].get_inplace_scratch_len()],
                    )
                },
                |(row, modes, scratch, scratch1), (plane, values)| {
                    for (i1, line) in values.chunks_exact(n2).enumerate() {
                        row[..n2].copy_from_slice(line);
                        row[n2..].fill(0.0);
                        // lengths are those of the plan
                        let _ = self.real.process_with_scratch(row, modes, scratch);
                        for (k2, &v) in modes.iter().enumerate() {
                            plane[k2 * m1 + i1] = v;
                        }
                    }
                    self.forward[1].process_with_scratch(plane, scratch1);
                },
            );
        planes
    }

    /// The modes along axis 0, the symbol and back, for one k2 at a time: [k2][component][i0][k1].
    fn apply_symbol(
        &self,
        components: usize,
        planes: &[C],
        symbol: impl Fn([usize; 3], &mut [C; 3]) + Sync,
    ) -> Vec<C> {
        let [m0, m1, m2] = self.modes();
        let n0 = self.inner[0];
        let plane = m2 * m1;
        let slab = components * n0 * m1;
        let mut slabs = vec![C::default(); m2 * slab];
        slabs.par_chunks_mut(slab).enumerate().for_each_init(
            || {
                (
                    vec![C::default(); components * m1 * m0],
                    vec![
                        C::default();
                        self.forward[0]
                            .get_inplace_scratch_len()
                            .max(self.backward[0].get_inplace_scratch_len())
                    ],
                )
            },
            |(lines, scratch), (k2, slab)| {
                lines.fill(C::default());
                for c in 0..components {
                    for i0 in 0..n0 {
                        let from = (c * n0 + i0) * plane + k2 * m1;
                        for (k1, &v) in planes[from..from + m1].iter().enumerate() {
                            lines[(c * m1 + k1) * m0 + i0] = v;
                        }
                    }
                }
                self.forward[0].process_with_scratch(lines, scratch);
                for k1 in 0..m1 {
                    for k0 in 0..m0 {
                        let mut mode = [C::default(); 3];
                        for c in 0..components {
                            mode[c] = lines[(c * m1 + k1) * m0 + k0];
                        }
                        symbol([k0, k1, k2], &mut mode);
                        for c in 0..components {
                            lines[(c * m1 + k1) * m0 + k0] = mode[c];
                        }
                    }
                }
                self.backward[0].process_with_scratch(lines, scratch);
                for c in 0..components {
                    for i0 in 0..n0 {
                        for k1 in 0..m1 {
                            slab[(c * n0 + i0) * m1 + k1] = lines[(c * m1 + k1) * m0 + i0];
                        }
                    }
                }
            },
        );
        slabs
    }

    /// Values from modes, back along axes 1 and 2; `planes` is work space.
    fn to_values(&self, components: usize, slabs: &[C], planes: &mut [C], y: &mut [f64]) {
        let [_, m1, m2] = self.modes();
        let [n0, n1, n2] = self.inner;
        let plane = m2 * m1;
        let slab = components * n0 * m1;
        let scale = 1.0 / self.period.iter().product::<usize>() as f64;
        y.par_chunks_mut(n1 * n2)
            .zip(planes.par_chunks_mut(plane))
            .enumerate()
            .for_each_init(
                || {
                    (
                        self.complex.make_input_vec(),
                        self.complex.make_output_vec(),
                        self.complex.make_scratch_vec(),
                        vec![C::default(); self.backward[1].get_inplace_scratch_len()],
                    )
                },
                |(modes, row, scratch, scratch1), (at, (values, plane))| {
                    for k2 in 0..m2 {
                        let from = k2 * slab + at * m1;
                        plane[k2 * m1..(k2 + 1) * m1].copy_from_slice(&slabs[from..from + m1]);
                    }
                    self.backward[1].process_with_scratch(plane, scratch1);
                    for (i1, line) in values.chunks_exact_mut(n2).enumerate() {
                        for (k2, v) in modes.iter_mut().enumerate() {
                            *v = plane[k2 * m1 + i1];
                        }
                        // the spectrum of real values is real at both ends; round-off is not
                        modes[0].im = 0.0;
                        modes[m2 - 1].im = 0.0;
                        let _ = self.complex.process_with_scratch(modes, row, scratch);
                        for (v, r) in line.iter_mut().zip(row.iter()) {
                            *v = scale * r;
                        }
                    }
                },
            );
    }
}
