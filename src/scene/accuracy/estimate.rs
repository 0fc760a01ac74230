//! Error and order from runs at several spacings (Richardson).

use super::pilot::Pilot;
use crate::trade::Quantity;

/// Orders below are those of a singularity, orders above do not last: linear elements and the nonlocal operator have two
/// (\[SAND2015-7998\] (2.23) to (2.28): the difference from the local operator is δ² times fourth derivatives).
const ORDERS: (f64, f64) = (0.8, 2.0);

/// The order where two runs leave it open.
const USUAL: f64 = 1.6;

/// Halvings of [`ORDERS`] that leave round-off.
const HALVINGS: usize = 50;

/// The factor by which predictions are judged; [`CHOICES`] and [`CHECKS`] say how many keep to it.
pub(crate) const SPREAD: f64 = 3.0;

/// How many errors that a choice predicted were within [`SPREAD`] of the measured ones; `docs/choosing.md` says of which scenes.
pub(super) const CHOICES: &str = "63 of 65 choices";

/// The same of errors that are predicted from coarser versions of a complete scene.
pub(super) const CHECKS: &str = "28 of 41 scenes";

/// The error that is aimed at is the wanted one over this; from the calibration half of `bondline verify choices`.
pub(super) const SAFETY: f64 = 1.25;

/// Below it, differences are round-off.
const ROUND_OFF: f64 = 1e-12;

/// `error(n) = scale n^-order`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fit {
    scale: f64,
    pub order: f64,
    /// A part that no spacing takes away.
    pub rest: f64,
}

impl Fit {
    /// The same with a part that no spacing takes away.
    pub fn with_rest(self, rest: f64) -> Self {
        Self { rest, ..self }
    }

    /// The predicted error with `n` cells along an edge.
    pub fn error(&self, n: f64) -> f64 {
        self.scale * n.powf(-self.order) + self.rest
    }

    /// Cells along an edge for an error; `None` where no number suffices.
    pub fn cells(&self, error: f64) -> Option<f64> {
        let left = error - self.rest;
        (left > 0.0).then(|| (self.scale / left).powf(1.0 / self.order))
    }
}

/// The largest difference of two runs in any of the quantities.
pub(crate) fn difference(coarse: &Pilot, fine: &Pilot, quantities: &[Quantity]) -> Option<f64> {
    quantities
        .iter()
        .map(|q| coarse.measured.error(&fine.measured, q))
        .try_fold(ROUND_OFF, |most, e| Some(e?.max(most)))
}

/// Fits runs in the order of their cells along an edge; `None` for fewer than two that can be compared.
pub(super) fn fit(levels: &[(f64, Pilot)], quantities: &[Quantity]) -> Option<Fit> {
    let steps: Vec<(f64, f64, f64)> = levels
        .windows(2)
        .map(|w| Some((w[0].0, w[1].0, difference(&w[0].1, &w[1].1, quantities)?)))
        .collect::<Option<_>>()?;
    of_differences(&steps)
}

/// From `(n, finer n, difference)`.
fn of_differences(steps: &[(f64, f64, f64)]) -> Option<Fit> {
    let &(coarse, fine, last) = steps.last()?;
    let order = match steps {
        [.., (a, b, first), _] => order(first / last, (*a, *b), (coarse, fine)),
        _ => USUAL,
    };
    let scale = last / (coarse.powf(-order) - fine.powf(-order));
    scale.is_finite().then_some(Fit {
        scale,
        order,
        rest: 0.0,
    })
}

/// The order, within [`ORDERS`], whose differences between the first two and between the last two numbers of cells have this ratio.
fn order(ratio: f64, first: (f64, f64), last: (f64, f64)) -> f64 {
    // grows with the order
    let of = |p: f64| {
        let step = |(a, b): (f64, f64)| a.powf(-p) - b.powf(-p);
        step(first) / step(last)
    };
    let (mut low, mut high) = ORDERS;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if of(middle) < ratio {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_found_from_its_differences() {
        for p in [1.0, 1.5, 2.0] {
            let e = |n: f64| 3.0 * n.powf(-p);
            // steps need not be alike
            for pairs in [[(4.0, 8.0), (8.0, 16.0)], [(4.0, 8.0), (8.0, 11.0)]] {
                let steps = pairs.map(|(a, b)| (a, b, e(a) - e(b)));
                let fit = of_differences(&steps).unwrap();
                assert!((fit.order - p).abs() < 1e-12, "{fit:?}");
                assert!((fit.error(40.0) / e(40.0) - 1.0).abs() < 1e-12);
                assert!((fit.cells(e(25.0)).unwrap() - 25.0).abs() < 1e-9);
            }
        }
        // an error that stays leaves less for the spacing
        let fit = Fit {
            scale: 1.0,
            order: 1.0,
            rest: 0.01,
        };
        assert_eq!(fit.cells(0.01), None);
        assert!((fit.cells(0.02).unwrap() - 100.0).abs() < 1e-9);
        assert_eq!(of_differences(&[]), None);
    }
}
