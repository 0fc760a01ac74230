//! Energy release rate and stress intensity factors at the tip of a crack, for summaries.

use std::fmt;

use serde::Serialize;

use super::report::{components, number};

/// Energy release rate and stress intensity factors from one ring around a tip.
///
/// Units: J in J/m² (N/m), K in Pa √m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TipRing {
    /// Inner and outer radius \[m\].
    pub radii: [f64; 2],
    /// Energy release rate J.
    pub energy_release_rate: f64,
    /// Stress intensity factors K_I (opening) and K_II (sliding).
    pub stress_intensity: [f64; 2],
}

/// The tip of a crack: means over its rings, and how far these differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TipSummary {
    /// The tip, as the scene names it.
    pub tip: String,
    /// Position \[m\].
    pub position: Vec<f64>,
    /// Energy release rate J \[J/m²\].
    pub energy_release_rate: f64,
    /// Stress intensity factors K_I and K_II \[Pa √m\].
    pub stress_intensity: [f64; 2],
    /// The largest less the smallest J of the rings, over J.
    pub energy_release_rate_spread: f64,
    /// The largest less the smallest K_I and K_II of the rings, over √(K_I² + K_II²).
    pub stress_intensity_spread: [f64; 2],
    /// The rings, from the innermost.
    pub rings: Vec<TipRing>,
}

impl TipSummary {
    /// Of the rings around a tip.
    pub fn new(tip: String, position: Vec<f64>, rings: Vec<TipRing>) -> Self {
        let mean = |of: &dyn Fn(&TipRing) -> f64| {
            rings.iter().map(of).sum::<f64>() / rings.len().max(1) as f64
        };
        let range = |of: &dyn Fn(&TipRing) -> f64| {
            let largest = rings.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
            let smallest = rings.iter().map(of).fold(f64::INFINITY, f64::min);
            (largest - smallest).max(0.0)
        };
        // nothing differs where nothing is loaded
        let over = |range: f64, size: f64| if size > 0.0 { range / size } else { 0.0 };
        let rate = |ring: &TipRing| ring.energy_release_rate;
        let factor = |k: usize| move |ring: &TipRing| ring.stress_intensity[k];
        let (energy_release_rate, factors) = (mean(&rate), [0, 1].map(|k| mean(&factor(k))));
        let size = factors[0].hypot(factors[1]);
        Self {
            tip,
            position,
            energy_release_rate,
            stress_intensity: factors,
            energy_release_rate_spread: over(range(&rate), energy_release_rate.abs()),
            stress_intensity_spread: [0, 1].map(|k| over(range(&factor(k)), size)),
            rings,
        }
    }
}

impl fmt::Display for TipSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [k1, k2] = self.stress_intensity;
        let percent = |x: f64| format!("{:.2} %", 100.0 * x);
        let [of_k1, of_k2] = self.stress_intensity_spread.map(percent);
        let ends = [self.rings.first(), self.rings.last()];
        let [inner, outer] = [0, 1].map(|k| ends[k].map_or(0.0, |ring| ring.radii[k]));
        write!(
            f,
            "crack tip              {} at {}: J {}, K_I {}, K_II {}; {} rings from {} to {} differ by {}, {of_k1}, {of_k2}",
            self.tip,
            components(&self.position),
            number(self.energy_release_rate),
            number(k1),
            number(k2),
            self.rings.len(),
            number(inner),
            number(outer),
            percent(self.energy_release_rate_spread),
        )
    }
}
