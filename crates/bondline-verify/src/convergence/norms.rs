//! Error norms, observed orders and medians.

/// Errors of one solution in the three norms that are distinguished.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// `(Σ h^D |u_i − u(x_i)|²)^½` over the inner points.
    pub nodal: f64,
    /// `(∫ |u_h − u|² dV)^½` over the cells of the inner points, `u_h = u_i` in all of cell `i`.
    pub piecewise: f64,
    /// `max |u_i − u(x_i)|`.
    pub largest: f64,
}

impl Errors {
    /// The errors where `u = (x², 0, 0)`, from `u_i − u(x_i)`; `n` points along each axis from `start` \[m\] on, `h` apart.
    ///
    /// Shapes: `error` holds D components one after another, the first axis slowest.
    pub(super) fn of_square<const D: usize>(error: &[f64], n: usize, start: f64, h: f64) -> Self {
        let points = n.pow(D as u32);
        let plane = points / n;
        let volume = h.powi(D as i32);
        let (mut nodal, mut piecewise, mut largest) = (0.0, 0.0, 0.0f64);
        for i in 0..n {
            let x = start + i as f64 * h;
            // ∫ (e − 2xt − t²)² dt/h over [−h/2, h/2], less e²
            let within = (4.0 * x * x + h * h * 3.0 / 20.0) * h * h / 12.0;
            for j in i * plane..(i + 1) * plane {
                let square: f64 = (0..D).map(|c| error[c * points + j].powi(2)).sum();
                nodal += square;
                piecewise += square + within - error[j] * h * h / 6.0;
                largest = largest.max(square);
            }
        }
        Self {
            nodal: (volume * nodal).sqrt(),
            piecewise: (volume * piecewise).sqrt(),
            largest: largest.sqrt(),
        }
    }
}

/// Order of convergence by a straight line through `(ln N, −ln error)`, least squares.
///
/// NaN with fewer than two numbers of points, or where an error is zero.
pub fn observed_order(errors: impl IntoIterator<Item = (f64, f64)>) -> f64 {
    let points: Vec<(f64, f64)> = errors.into_iter().map(|(n, e)| (n.ln(), -e.ln())).collect();
    let count = points.len() as f64;
    let (x, y) = points
        .iter()
        .fold((0.0, 0.0), |s, p| (s.0 + p.0 / count, s.1 + p.1 / count));
    let (mut above, mut below) = (0.0, 0.0);
    for p in &points {
        above += (p.0 - x) * (p.1 - y);
        below += (p.0 - x) * (p.0 - x);
    }
    above / below
}

/// The middle value, or the mean of the two in the middle; NaN of nothing.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    let n = values.len();
    match n {
        0 => f64::NAN,
        _ => 0.5 * (values[(n - 1) / 2] + values[n / 2]),
    }
}

/// Returns true if every value is less than the one before.
pub fn falls(values: &[f64]) -> bool {
    values.windows(2).all(|w| w[1] < w[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_and_medians_by_hand() {
        let order = observed_order([10.0, 20.0, 45.0].map(|n: f64| (n, 3.0 * n.powf(-1.7))));
        assert!((order - 1.7).abs() < 1e-13);
        assert!(observed_order([(10.0, 1.0)]).is_nan());
        assert_eq!(median([3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median([4.0, 1.0, 2.0, 3.0]), 2.5);
        assert!(median([]).is_nan());
        assert!(falls(&[3.0, 2.0, 1.0]) && !falls(&[3.0, 2.0, 2.0]));
    }

    #[test]
    fn piecewise_norm_is_the_integral() {
        // two points in 1D, h = 0.5 from 0.25: fine midpoint sum of (u_i − x²)²
        let error = [0.01, -0.02];
        let e = Errors::of_square::<1>(&error, 2, 0.25, 0.5);
        let pieces = 100_000;
        let sum: f64 = (0..pieces)
            .map(|p| {
                let x = (f64::from(p) + 0.5) / f64::from(pieces);
                let i = usize::from(x > 0.5);
                let at = 0.25 + 0.5 * i as f64;
                (at * at + error[i] - x * x).powi(2) / f64::from(pieces)
            })
            .sum();
        assert!((e.piecewise / sum.sqrt() - 1.0).abs() < 1e-8);
        assert!((e.nodal - (0.5f64 * 5e-4).sqrt()).abs() < 1e-15);
        assert_eq!(e.largest, 0.02);
    }
}
