//! Softening of bonds: the force of a bond over its stretch, and how it follows from a tensile strength and a fracture energy.
//!
//! A body of softening bonds is a smeared cohesive zone as wide as the horizon δ. Of a given strength and energy, a larger horizon leaves less softening to each bond; beyond a largest one a bond that is stretched alike all along would snap back.
//! Of a continuous family it is `3 E G/σ²` in a bar, `4π/9 E G/σ²` in plane stress and `5/6 E G/σ²` in a solid, which bounds the horizon as `2 E G/σ²` bounds the width of a crack band \[BazantOh1983\].

pub use crate::material::Envelope;
use crate::tensor::Vector;

/// Part of its largest force at which an exponentially softening bond lets go.
const LETS_GO: f64 = 1e-3;

/// The tensile strength and fracture energy of a material, and how its bonds soften.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Softening {
    /// Tensile strength \[Pa\].
    pub strength: f64,
    /// Fracture energy \[J/m²\].
    pub energy: f64,
    /// True if the force falls exponentially; along a line if not.
    pub is_exponential: bool,
}

/// Calibrated softening of the bonds of a horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// Force over stretch.
    pub envelope: Envelope,
    /// The softening that was typed.
    pub typed: Softening,
    /// The largest horizon that the strength and energy allow with as many points to a horizon \[m\].
    pub largest_horizon: f64,
}

impl std::fmt::Display for Calibration {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "they soften from the stretch {:.3e} on and are through at {:.3e}: the lattice has the tensile strength {} and the fracture energy {}, and horizons up to {:.4e} would do",
            self.envelope.onset,
            self.envelope.end,
            self.typed.strength,
            self.typed.energy,
            self.largest_horizon
        )
    }
}

/// Failure of a strength and an energy to fix a softening.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// Bonds would snap back.
    #[error(
        "a horizon of {horizon:.4e} is too large for the tensile strength {strength:e} and the fracture energy {energy:e}: bonds that reach the strength store more than that energy until they break, and would snap back; take a horizon of at most {largest:.4e}, with as many points to it"
    )]
    SnapBack {
        /// δ \[m\].
        horizon: f64,
        /// The largest one \[m\].
        largest: f64,
        /// Tensile strength \[Pa\].
        strength: f64,
        /// Fracture energy \[J/m²\].
        energy: f64,
    },
    /// Points would snap back.
    #[error(
        "a horizon of {horizon:.4e} is too large: {source}; a crack is as wide as the families that it crosses: take a horizon below {largest:.4e}, with as many points to it, or finite elements alone"
    )]
    Band {
        /// δ \[m\].
        horizon: f64,
        /// The largest one \[m\].
        largest: f64,
        /// The crack band of that horizon.
        #[source]
        source: crate::material::WideBand,
    },
    /// No horizon to calibrate for.
    #[error(
        "a material that softens is calibrated for one horizon, and the horizon of this body varies; give peridynamics.horizon a number, and the body one lattice"
    )]
    Varies,
    /// The family has no stiffness along an axis.
    #[error(
        "the bonds of a point have the stiffness {stiffness:e} in uniaxial stress; take a horizon of two spacings or more"
    )]
    Stiffness {
        /// Stress over strain \[Pa\].
        stiffness: f64,
    },
}

/// A point of a regular lattice far from all surfaces, with bonds that act alone.
#[derive(Clone, Copy, Debug)]
pub struct RegularFamily<'a, const D: usize> {
    /// Bond vectors, along the axes of the lattice \[m\], with `p V` \[Pa/m⁴\].
    pub bonds: &'a [(Vector<D>, f64)],
    /// `G0/s_c²` of a plane between two layers, [`crate::peridynamics::plane_energy`] \[J/m²\].
    pub plane_energy: f64,
    /// δ \[m\].
    pub horizon: f64,
}

/// Bonds of the same angle to the axis of a tension bar.
#[derive(Clone, Copy, Debug)]
struct Ray {
    /// cos² of that angle.
    along: f64,
    /// `Σ p |ξ|⁴ V` \[Pa\].
    weight: f64,
}

/// A homogeneous body in uniaxial stress, its bonds linear in the displacement.
struct Tension {
    rays: Vec<Ray>,
    has_sides: bool,
}

impl Tension {
    fn new<const D: usize>(bonds: &[(Vector<D>, f64)]) -> Self {
        let of = |(xi, weight): &(Vector<D>, f64)| {
            let square = xi.norm_squared();
            Ray {
                along: xi[0] * xi[0] / square,
                weight: weight * square * square,
            }
        };
        let mut all: Vec<Ray> = bonds.iter().map(of).collect();
        all.sort_by(|a, b| a.along.total_cmp(&b.along));
        let mut rays: Vec<Ray> = Vec::new();
        for ray in all {
            match rays.last_mut() {
                Some(last) if ray.along - last.along < 1e-12 => last.weight += ray.weight,
                _ => rays.push(ray),
            }
        }
        Self {
            rays,
            has_sides: D > 1,
        }
    }

    /// Stress along the axis and across it, and the derivative of the latter by the strain across, for strains along and across.
    fn stresses(&self, envelope: &Envelope, along: f64, across: f64) -> [f64; 3] {
        let mut sums = [0.0; 3];
        for ray in &self.rays {
            let rest = 1.0 - ray.along;
            let s = along * ray.along + across * rest;
            let g = envelope.force(s) * ray.weight;
            sums[0] += g * ray.along;
            sums[1] += g * rest;
            // the slope of the envelope is that of a secant here: it only steers the search
            let slope = if s == 0.0 { 1.0 } else { envelope.force(s) / s };
            sums[2] += slope * ray.weight * rest * rest;
        }
        sums
    }

    /// The stress at a strain along the axis, and the strain across at which the sides are free, next to `near`.
    fn stress(&self, envelope: &Envelope, along: f64, near: f64) -> (f64, f64) {
        const STEPS: usize = 200;
        if !self.has_sides {
            return (self.stresses(envelope, along, 0.0)[0], 0.0);
        }
        let across = |x: f64| self.stresses(envelope, along, x)[1];
        // an interval in which the sides become free
        let (mut low, mut high) = (near, near);
        let mut width = 1e-3 * along;
        while across(low) > 0.0 {
            low -= width;
            width *= 2.0;
        }
        width = 1e-3 * along;
        while across(high) < 0.0 && high < along {
            high += width;
            width *= 2.0;
        }
        let mut x = 0.5 * (low + high);
        for _ in 0..STEPS {
            let [_, rest, slope] = self.stresses(envelope, along, x);
            if rest > 0.0 {
                high = x;
            } else {
                low = x;
            }
            if high - low <= 1e-15 * along {
                break;
            }
            let newton = x - rest / slope;
            x = match newton > low && newton < high && slope > 0.0 {
                true if (newton - x).abs() <= 1e-15 * along => break,
                true => newton,
                false => 0.5 * (low + high),
            };
        }
        (self.stresses(envelope, along, x)[0], x)
    }

    /// Stress over strain before any bond softens \[Pa\].
    fn stiffness(&self) -> f64 {
        let linear = Envelope::linear(f64::INFINITY, 0.0);
        self.stress(&linear, 1.0, 0.0).0
    }

    /// The largest stress.
    fn strength(&self, envelope: &Envelope) -> f64 {
        /// Growth of the strain from one value to the next.
        const GROWTH: f64 = 1.005;
        /// Part of the largest stress below which none larger is looked for.
        const FALLEN: f64 = 0.5;
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        let mut near = -0.3 * envelope.onset;
        let mut best = (0.0, envelope.onset, near);
        let mut strain = envelope.onset;
        while strain < envelope.end.max(envelope.onset * 2.0) * 2.0 {
            let (stress, across) = self.stress(envelope, strain, near);
            near = across;
            if stress > best.0 {
                best = (stress, strain, across);
            }
            if stress < FALLEN * best.0 {
                break;
            }
            strain *= GROWTH;
        }
        let at = |strain: f64| self.stress(envelope, strain, best.2).0;
        let (mut low, mut high) = (best.1 / GROWTH, best.1 * GROWTH);
        while high - low > 1e-10 * high {
            let (a, b) = (high - golden * (high - low), low + golden * (high - low));
            match at(a) < at(b) {
                true => low = a,
                false => high = b,
            }
        }
        at(0.5 * (low + high)).max(best.0)
    }
}

impl Softening {
    /// The envelope of bonds with which a lattice has this strength and takes this energy.
    ///
    /// With `s_*` the critical stretch at which linear bonds would take the energy, `s₀ = s_*/√(1 + a)`; the strength falls with `a`, by which it is found.
    ///
    /// # Errors
    /// [`CalibrationError::SnapBack`] if the strength is not reached even by bonds that break as they begin to soften, [`CalibrationError::Stiffness`] for a family without any.
    pub fn calibrate<const D: usize>(
        &self,
        family: &RegularFamily<'_, D>,
    ) -> Result<Calibration, CalibrationError> {
        let tension = Tension::new(family.bonds);
        let stiffness = tension.stiffness();
        if !(stiffness.is_finite() && stiffness > 0.0) {
            return Err(CalibrationError::Stiffness { stiffness });
        }
        let critical = (self.energy / family.plane_energy).sqrt();
        let with = |after: f64| {
            let onset = critical / (1.0 + after).sqrt();
            match self.is_exponential {
                true => Envelope::exponential(onset, after, LETS_GO),
                false => Envelope::linear(onset, after),
            }
        };
        let excess = |after: f64| tension.strength(&with(after)) / self.strength - 1.0;
        let brittle = excess(0.0);
        let largest_horizon = family.horizon * (1.0 + brittle).powi(2);
        if brittle < 0.0 {
            return Err(CalibrationError::SnapBack {
                horizon: family.horizon,
                largest: largest_horizon,
                strength: self.strength,
                energy: self.energy,
            });
        }
        let (mut low, mut high) = (0.0, 1.0);
        while excess(high) > 0.0 {
            low = high;
            high *= 4.0;
        }
        while high - low > 1e-9 * (1.0 + high) {
            let middle = 0.5 * (low + high);
            match excess(middle) > 0.0 {
                true => low = middle,
                false => high = middle,
            }
        }
        Ok(Calibration {
            envelope: with(0.5 * (low + high)),
            typed: *self,
            largest_horizon,
        })
    }
}
