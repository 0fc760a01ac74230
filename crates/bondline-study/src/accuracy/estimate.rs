//! Error and order from runs at several spacings (Richardson).

use super::sample_run::Pilot;
use crate::variants::Quantity;

/// Orders below are those of a singularity, orders above do not last: linear elements and the nonlocal operator have two
/// (\[SAND2015-7998\] eq. (2.28) bounds the difference from the local operator by δ; of smooth fields it is δ² times fourth derivatives).
const ORDERS: (f64, f64) = (0.8, 2.0);

/// The order where two runs leave it open: that of the scenes of the calibration half, and in motion that of the dispersion of elements, lattices and steps.
pub(super) const USUAL: [f64; 2] = [1.6, 2.0];

/// Runs that are fitted at most: coarser ones are too far from a power law.
const MOST: usize = 4;

/// Smaller and smaller neighbourhoods in which the order is looked for.
const ZOOMS: usize = 50;

/// The factor by which predictions are judged; `CHOICES` and `CHECKS` say how many keep to it.
pub const SPREAD: f64 = 3.0;

/// Share of the errors predicted by a choice that were within [`SPREAD`] of the measured ones; `docs/choosing.md` says of which scenes.
pub(super) const CHOICES: &str = "63 of 65 choices";

/// The same of errors that are predicted from versions of a complete scene.
pub(super) const CHECKS: &str = "63 of 65 scenes";

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
pub fn difference(coarse: &Pilot, fine: &Pilot, quantities: &[Quantity]) -> Option<f64> {
    quantities
        .iter()
        .map(|q| coarse.measured.error(&fine.measured, q))
        .try_fold(ROUND_OFF, |most, e| Some(e?.max(most)))
}

/// Fits runs in the order of their cells along an edge, the finest [`MOST`] of them; `None` for fewer than two that can be compared.
///
/// Two leave the order open, and have the `usual` one.
pub(super) fn fit(levels: &[(f64, Pilot)], quantities: &[Quantity], usual: f64) -> Option<Fit> {
    let ((finest, reference), coarser) = levels.split_last()?;
    let distances: Vec<(f64, f64)> = coarser[coarser.len().saturating_sub(MOST - 1)..]
        .iter()
        .map(|(n, pilot)| Some((*n, difference(pilot, reference, quantities)?)))
        .collect::<Option<_>>()?;
    of_distances(&distances, *finest, usual)
}

/// From `(n, distance from the finest)`: least squares of logarithms. All distances are from the finest run, as errors of runs whose nodes lie
/// elsewhere need not point the same way, and the finest has the least of its own.
fn of_distances(distances: &[(f64, f64)], finest: f64, usual: f64) -> Option<Fit> {
    if distances.is_empty() {
        return None;
    }
    // logarithm of the scale, and how far distances are from it
    let scales = |order: f64| {
        let each = distances
            .iter()
            .map(|(n, d)| d.ln() - (n.powf(-order) - finest.powf(-order)).ln());
        let mean = each.clone().sum::<f64>() / distances.len() as f64;
        (mean, each.map(|s| (s - mean).powi(2)).sum::<f64>())
    };
    let mut order = usual;
    if distances.len() > 1 {
        let mut half = 0.5 * (ORDERS.1 - ORDERS.0);
        order = ORDERS.0 + half;
        for _ in 0..ZOOMS {
            order = [-1.0, -0.5, 0.0, 0.5, 1.0]
                .map(|k| (order + k * half).clamp(ORDERS.0, ORDERS.1))
                .into_iter()
                .min_by(|&a, &b| scales(a).1.total_cmp(&scales(b).1))
                .unwrap_or(order);
            half *= 0.6;
        }
    }
    let scale = scales(order).0.exp();
    scale.is_finite().then_some(Fit {
        scale,
        order,
        rest: 0.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_found_from_its_differences() {
        for p in [1.0, 1.5, 2.0] {
            let e = |n: f64| 3.0 * n.powf(-p);
            // steps need not be alike
            for coarser in [&[4.0, 8.0][..], &[8.0, 11.0], &[4.0, 6.0, 9.0]] {
                let distances: Vec<_> = coarser.iter().map(|&n| (n, e(n) - e(13.0))).collect();
                let fit = of_distances(&distances, 13.0, 1.6).unwrap();
                assert!((fit.order - p).abs() < 1e-7, "{fit:?}");
                assert!((fit.error(40.0) / e(40.0) - 1.0).abs() < 1e-6, "{fit:?}");
                assert!((fit.cells(e(25.0)).unwrap() - 25.0).abs() < 1e-4);
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
        assert_eq!(of_distances(&[], 8.0, 1.6), None);
        // one distance: the usual order
        let fit = of_distances(&[(4.0, 4f64.powf(-1.6) - 8f64.powf(-1.6))], 8.0, 1.6).unwrap();
        assert!((fit.error(8.0) - 8f64.powf(-1.6)).abs() < 1e-15);
    }
}
