//! Forces of a coupled system whose bonds expand with the temperature.

use super::CoupledSystem;
use crate::system::{FailureUpdate, Interval, SemiDiscrete};

/// Part of a change of temperature over which forces are differenced.
const PART: f64 = 1e-3;

impl<const D: usize> CoupledSystem<'_, D> {
    /// Returns true if the traversed bonds take the temperature into account.
    pub fn has_heated_bonds(&self) -> bool {
        self.body.as_ref().is_some_and(|body| body.heat.is_some())
    }

    /// See [`crate::system::SemiDiscrete::force_of_heating_into`].
    pub(super) fn extrapolate_heating(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        from: Option<f64>,
        to: f64,
    ) -> bool {
        if !self.has_heated_bonds() && (self.heat.is_none() || self.elements.is_none()) {
            return false;
        }
        let at_once = Interval {
            end: to,
            length: 0.0,
        };
        let mut further = vec![0.0; force.len()];
        for (part, force) in [(0.0, &mut *force), (PART, &mut further[..])] {
            if let Some(body) = &mut self.body
                && let Some(heat) = &mut body.heat
            {
                heat.set_between((from, to, part), body.pass.as_mut());
            }
            if let Some(elements) = &mut self.elements {
                elements.hold_between(self.model, (from, to, part));
            }
            self.internal_force_into(u, force, at_once, FailureUpdate::Frozen);
        }
        if let Some(heat) = self.body.as_mut().and_then(|body| body.heat.as_mut()) {
            (heat.is_held, heat.is_stale) = (false, true);
        }
        if let Some(elements) = &mut self.elements {
            elements.release();
        }
        for (force, further) in force.iter_mut().zip(further) {
            *force += (further - *force) / PART;
        }
        true
    }
}
