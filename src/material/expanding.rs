//! A law of solids that expands freely with its temperature.

use std::sync::Arc;

use super::{Banded, LocalHistory, LocalLaw, LocalResponse, reduction::with_unnamed};
use crate::tensor::{Tensor, Tensor4};

/// History variables of a point beside those of its law: the free stretch s that it is given, `1 + s` at the end of the last step (0 before the first), `∂W/∂s` there, and the work of heating.
const OWN: usize = 4;

/// A law of solids whose stress is that of what is left of the deformation beyond a free stretch `s = α ΔT`.
///
/// Strains of any size: `F_m = F/(1 + s)`, and W is an energy of the expanded body, `W = (1 + s)³ W_m(F_m)`, so that the Cauchy stress is the one of the law at `F_m` and `P = (1 + s)² P_m` (\[BoleyWeiner1960\] for small strains).
/// Small strains: `σ = σ_m(ε − s I)`. At a deformation that is held, the energy changes with the temperature by `∂W/∂s = 3 (1 + s)² W_m − (1 + s) P_m : F`, for small strains `−tr σ`; the work of heating is its sum by the trapezoidal rule.
///
/// The owner of the temperature writes s to the number [`LocalHistory::free_stretch`] of the history of a point. Within [`Reduced`](super::Reduced) the strain out of the body expands too.
#[derive(Clone, Debug)]
pub struct Expanding {
    law: Arc<dyn LocalLaw<3>>,
    history: LocalHistory,
}

impl Expanding {
    /// This law, expanding.
    pub fn new(law: Arc<dyn LocalLaw<3>>) -> Self {
        let of_law = law.history();
        let history = LocalHistory {
            names: with_unnamed(of_law.names, OWN),
            free_stretch: Some(of_law.len()),
            ..of_law
        };
        Self { law, history }
    }

    /// The mechanical part of a displacement gradient, and `1 + s` for strains of any size, 1 for small ones.
    fn mechanical(&self, gradient: &Tensor<3>, past: &[f64]) -> (Tensor<3>, f64) {
        let free = past[self.law.history().len()];
        match self.law.is_objective() {
            // without the difference of two ones
            true => {
                let ratio = 1.0 + free;
                ((gradient - Tensor::identity() * free) / ratio, ratio)
            }
            false => (gradient - Tensor::identity() * free, 1.0),
        }
    }
}

impl LocalLaw<3> for Expanding {
    fn tangent(&self) -> &Tensor4<3> {
        self.law.tangent()
    }

    fn is_linear(&self) -> bool {
        self.law.is_linear()
    }

    fn is_objective(&self) -> bool {
        self.law.is_objective()
    }

    fn flows_at_constant_volume(&self) -> bool {
        self.law.flows_at_constant_volume()
    }

    fn history(&self) -> LocalHistory {
        self.history
    }

    fn in_band(&self, width: f64) -> Option<Banded<3>> {
        let banded = |law| -> Arc<dyn LocalLaw<3>> { Arc::new(Self::new(law)) };
        Some(self.law.in_band(width)?.map(banded))
    }

    fn failure(&self) -> Option<String> {
        self.law.failure()
    }

    fn has_symmetric_tangent(&self) -> bool {
        self.law.has_symmetric_tangent()
    }

    fn algorithmic_tangent(&self, gradient: &Tensor<3>, step: f64, past: &[f64]) -> Tensor4<3> {
        let (mechanical, ratio) = self.mechanical(gradient, past);
        let past = &past[..self.law.history().len()];
        let of_law = self.law.algorithmic_tangent(&mechanical, step, past);
        of_law.scaled(ratio)
    }

    fn respond(
        &self,
        gradient: &Tensor<3>,
        step: f64,
        past: &[f64],
        present: &mut [f64],
    ) -> LocalResponse<3> {
        let (mechanical, ratio) = self.mechanical(gradient, past);
        let kept = self.law.history().len();
        let (of_law, own) = present.split_at_mut(kept);
        let found = self.law.respond(&mechanical, step, &past[..kept], of_law);
        let swollen = ratio.powi(3);
        let by_stretch = match self.law.is_objective() {
            true => {
                let along = found.stress.dot(&(Tensor::identity() + gradient));
                3.0 * ratio * ratio * found.stored - ratio * along
            }
            false => -found.stress.trace(),
        };
        let [free, before, slope, work] = [0, 1, 2, 3].map(|k| past[kept + k]);
        let rise = if before > 0.0 {
            1.0 + free - before
        } else {
            0.0
        };
        let work = work + 0.5 * (slope + by_stretch) * rise;
        own.copy_from_slice(&[free, 1.0 + free, by_stretch, work]);
        LocalResponse {
            stress: found.stress * (ratio * ratio),
            across: found.across,
            volume_ratio: found.volume_ratio * swollen,
            stored: found.stored * swollen,
            dissipated: found.dissipated * swollen,
        }
    }
}

/// The work of heating per volume in the history of a point \[J/m^D\], of a law with [`LocalHistory::free_stretch`] at `place`.
pub fn heat_work(point: &[f64], place: usize) -> f64 {
    point[place + 3]
}

/// Begins the sum of that work at the state that was just found.
pub fn begin_heating(past: &mut [f64], present: &[f64], place: usize) {
    past[place + 1..][..3].copy_from_slice(&[present[place + 1], present[place + 2], 0.0]);
}
