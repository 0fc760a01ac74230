//! Costs and errors of settings that were not tried, from those that were.
//!
//! The logarithm of a cost or an error is taken as a sum of one number per setting: settings multiply. The numbers are those of least
//! squares over all that was measured, drawn slightly to zero, so that a setting without evidence does nothing. How far such a guess is
//! off is itself measured: each case is guessed before it runs.

use nalgebra::{DMatrix, DVector};

/// A sum of effects, fitted.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Effects {
    mean: f64,
    numbers: Vec<f64>,
}

/// Ridge parameter that draws the fitted numbers to zero, over one observation.
const RIDGE: f64 = 1e-2;

impl Effects {
    /// Fits `ln value` to indicators of the settings that each case has; `settings` is their number.
    pub(super) fn fit(settings: usize, cases: &[(Vec<usize>, f64)]) -> Self {
        let logarithms: Vec<f64> = cases.iter().map(|c| c.1.max(1e-300).ln()).collect();
        let n = settings + 1;
        let mut normal = DMatrix::<f64>::zeros(n, n);
        let mut right = DVector::<f64>::zeros(n);
        for ((chosen, _), y) in cases.iter().zip(&logarithms) {
            let columns: Vec<usize> = std::iter::once(0)
                .chain(chosen.iter().map(|s| s + 1))
                .collect();
            for &a in &columns {
                right[a] += y;
                for &b in &columns {
                    normal[(a, b)] += 1.0;
                }
            }
        }
        for a in 1..n {
            normal[(a, a)] += RIDGE;
        }
        normal[(0, 0)] += 1e-9;
        let solution = normal
            .cholesky()
            .map_or_else(|| DVector::zeros(n), |c| c.solve(&right));
        Self {
            mean: solution[0],
            numbers: solution.iter().skip(1).copied().collect(),
        }
    }

    /// The value guessed for a case with these settings.
    pub(super) fn guess(&self, chosen: &[usize]) -> f64 {
        (self.mean + chosen.iter().map(|&s| self.numbers[s]).sum::<f64>()).exp()
    }
}

/// Returns the points that no other point beats in both: indices, by ascending cost. Points are `(cost, error)`.
pub fn front(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len())
        .filter(|&k| points[k].0.is_finite() && points[k].1.is_finite())
        .collect();
    order.sort_by(|&a, &b| {
        let key = |k: usize| (points[k].0, points[k].1);
        key(a)
            .partial_cmp(&key(b))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    let mut best = f64::INFINITY;
    order.retain(|&k| {
        let better = points[k].1 < best;
        if better {
            best = points[k].1;
        }
        better
    });
    order
}

/// Of guessed `(cost, error)` the one that would improve a measured front most: the largest factor, in cost or error, by which it beats every point
/// of the front in one of the two; `None` if none does by more than `least`.
pub(super) fn most_promising(
    guessed: &[(f64, f64)],
    measured: &[(f64, f64)],
    least: f64,
) -> Option<usize> {
    let gain = |&(cost, error): &(f64, f64)| {
        measured
            .iter()
            .map(|&(c, e)| (c / cost).max(e / error))
            .fold(f64::INFINITY, f64::min)
    };
    (0..guessed.len())
        .map(|k| (k, gain(&guessed[k])))
        .filter(|(_, g)| *g > least)
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(k, _)| k)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_that_multiply_are_found_from_single_trials() {
        // base 8, settings times 2, 0.5, 3
        let cases = [
            (vec![], 8.0),
            (vec![0], 16.0),
            (vec![1], 4.0),
            (vec![2], 24.0),
        ];
        let effects = Effects::fit(4, &cases);
        let guess = effects.guess(&[0, 2]);
        assert!((guess / 48.0 - 1.0).abs() < 0.05, "{guess}");
        // the fourth setting was never tried
        assert!((effects.guess(&[3]) / effects.guess(&[]) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_front_holds_what_nothing_beats() {
        let points = [
            (1.0, 0.5),
            (2.0, 0.1),
            (2.5, 0.2),
            (4.0, 0.05),
            (f64::NAN, 0.0),
            (1.0, 0.4),
        ];
        assert_eq!(front(&points), [5, 1, 3]);
    }

    #[test]
    fn what_would_fill_the_widest_gap_comes_first() {
        let measured = [(1.0, 0.5), (10.0, 0.01)];
        let guessed = [(1.1, 0.45), (2.0, 0.05), (20.0, 0.02)];
        assert_eq!(most_promising(&guessed, &measured, 1.05), Some(1));
        assert_eq!(most_promising(&guessed[2..], &measured, 1.05), None);
    }
}
