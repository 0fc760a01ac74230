//! Softening: decrease of a linear response beyond its onset.

/// A response that is linear up to `onset` and softens beyond it, over its stiffness: `g(s) = s` up to `s₀`, then falling to zero at `end`, of a strain of a material or a stretch of a bond.
///
/// Linear: `g = s₀ (s₁ − s)/(s₁ − s₀)`. Exponential: `g = s₀ exp(−(s − s₀)/s_f)`, down to a part of `s₀` at which it lets go, or for ever.
/// `∫ g ds = ½ s₀² (1 + a)`, where `a` is the work of softening over that before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Envelope {
    /// s₀, at which softening begins.
    pub onset: f64,
    /// Strain or stretch from which on nothing is left; infinite if something always is.
    pub end: f64,
    /// s_f of an exponential.
    decay: Option<f64>,
}

impl Envelope {
    /// One that falls along a line, with the work `after` of softening over that before.
    pub fn linear(onset: f64, after: f64) -> Self {
        Self {
            onset,
            end: onset * (1.0 + after),
            decay: None,
        }
    }

    /// One that falls exponentially until the part `lets_go` of its largest value is left, which it drops at once; 0 for none.
    pub fn exponential(onset: f64, after: f64, lets_go: f64) -> Self {
        let decay = 0.5 * after * onset / (1.0 - lets_go);
        let end = match decay > 0.0 {
            true => onset - decay * lets_go.ln(),
            false => onset,
        };
        Self {
            onset,
            end,
            decay: Some(decay),
        }
    }

    /// `g(s)` where there has never been more.
    pub fn force(&self, s: f64) -> f64 {
        if s <= self.onset {
            return s;
        }
        if s >= self.end {
            return 0.0;
        }
        match self.decay {
            Some(decay) => self.onset * (-(s - self.onset) / decay).exp(),
            None => self.onset * (self.end - s) / (self.end - self.onset),
        }
    }

    /// The damage `1 − g(s)/s` where `s` is the largest so far.
    pub fn damage(&self, s: f64) -> f64 {
        match s <= self.onset {
            true => 0.0,
            false => 1.0 - self.force(s) / s,
        }
    }

    /// Returns the energy dissipated up to `s`, over the stiffness: `∫ g ds` less what is stored.
    pub fn spent(&self, s: f64) -> f64 {
        if s <= self.onset {
            return 0.0;
        }
        let until = s.min(self.end);
        let before = 0.5 * self.onset * self.onset;
        let after = match self.decay {
            // zero at once where nothing is left to soften
            Some(0.0) => 0.0,
            Some(decay) => -self.onset * decay * (-(until - self.onset) / decay).exp_m1(),
            None => 0.5 * (self.onset + self.force(until)) * (until - self.onset),
        };
        before + after - 0.5 * self.force(s) * s
    }
}
