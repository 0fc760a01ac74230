//! The algorithmic tangent of a law that has no closed form, by differences at the point.

use crate::tensor::{Tensor, Tensor4};

/// The gradient over which a response is differenced, over the size of the gradient.
const DIFFERENCED: f64 = 1e-6;

/// The least size that counts: the elastic strains of metals.
const LEAST: f64 = 1e-3;

/// `∂P_ij/∂G_kl` by central differences of `stress`, which also overwrites a history of so many numbers; they err by about 1e-9 of it.
///
/// The history is that of the trial alone and is dropped.
pub(crate) fn central_differences<const D: usize>(
    gradient: &Tensor<D>,
    numbers: usize,
    stress: impl Fn(&Tensor<D>, &mut [f64]) -> Tensor<D>,
) -> Tensor4<D> {
    let by = DIFFERENCED * gradient.amax().max(LEAST);
    let mut present = vec![0.0; numbers];
    let mut tangent = Tensor4::zeros();
    for (k, l) in (0..D).flat_map(|k| (0..D).map(move |l| (k, l))) {
        let mut ends = [*gradient, *gradient];
        ends[0][(k, l)] += by;
        ends[1][(k, l)] -= by;
        // what was added, of numbers that are rounded
        let apart = ends[0][(k, l)] - ends[1][(k, l)];
        let [up, down] = ends.map(|gradient| stress(&gradient, &mut present));
        let slope = (up - down) / apart;
        for (i, j) in (0..D).flat_map(|i| (0..D).map(move |j| (i, j))) {
            tangent.0[i][j][(k, l)] = slope[(i, j)];
        }
    }
    tangent
}
