//! Isotropic scalar damage, for small strains: quasi-brittle solids that soften in tension.

use std::sync::Arc;

use super::{Banded, Envelope, LocalHistory, LocalLaw, LocalResponse, WideBand};
use crate::tensor::{Tensor, Tensor4, strain};

/// The part of the stiffness that is left of a material that is damaged through: it holds the nodes of its cells in place, and bears a millionth of what the whole material would.
pub const RESIDUAL: f64 = 1e-6;

/// The measure ε̃ of a strain by which damage grows; in uniaxial tension the strain along the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EquivalentStrain {
    /// `√Σ⟨ε_i⟩₊²` of the principal strains \[Mazars1986\]: extensions alone count, so that a strength in compression is `1/(√2 ν)` times that in tension.
    Mazars,
    /// `√(ε : C : ε/E)`: compression counts like tension, and the tangent is symmetric.
    Energy,
}

/// Decrease of the stress with the strain in uniaxial tension beyond the strength.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SofteningCurve {
    /// `σ = f_t exp(−(ε − ε₀)/ε_f)`.
    Exponential,
    /// Along a line, to zero.
    Linear,
}

/// Parameters of a scalar damage material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScalarDamageSettings {
    /// Lamé's λ of the solid \[Pa\].
    pub lambda: f64,
    /// Shear modulus μ \[Pa\].
    pub shear: f64,
    /// Tensile strength f_t \[Pa\].
    pub strength: f64,
    /// Fracture energy G_f \[J/m²\].
    pub energy: f64,
    /// ε̃.
    pub measure: EquivalentStrain,
    /// Its softening curve.
    pub curve: SofteningCurve,
}

impl ScalarDamageSettings {
    /// Young's modulus \[Pa\].
    pub fn young(&self) -> f64 {
        self.shear * (3.0 * self.lambda + 2.0 * self.shear) / (self.lambda + self.shear)
    }

    /// The width `2 E G_f/f_t²` \[m\] of a crack band that stores the fracture energy when it reaches the strength: a wider one would snap back, whatever the curve.
    pub fn widest_band(&self) -> f64 {
        2.0 * self.young() * self.energy / (self.strength * self.strength)
    }
}

/// Isotropic scalar damage of a solid, `σ = (1 − D) C : ε`, with `ψ₀ = ½ ε : C : ε` of the undamaged material:
///
/// ```text
/// κ(t) = max over τ ≤ t of ε̃(τ) ,     1 − D = r + (1 − r) g(κ)/κ ,     W = (1 − D) ψ₀ ,     Ḋ Z ≥ 0 ,   Z = −∂W/∂D = ψ₀
/// ```
///
/// Source: \[LemaitreChaboche1990\] for `W` and Z, \[Mazars1986\] for ε̃, and \[BazantOh1983\] for the crack band. `E g` is the curve of uniaxial tension ([`Envelope`]): its peak is the tensile strength, and the area under it is `G_f/h`,
/// where h is the width of the band in which the deformation localises: until [`LocalLaw::in_band`] gives it, the law is linearly elastic. `r` is [`RESIDUAL`].
///
/// The dissipation of a step is `∫ ψ₀ dD` with ψ₀ linear in ε̃² from the beginning of the step to its end: exact for strains that keep their direction, and for [`EquivalentStrain::Energy`].
#[derive(Clone, Debug)]
pub struct ScalarDamage {
    elastic: Tensor4<3>,
    settings: ScalarDamageSettings,
    /// `g`, of a band.
    envelope: Option<Envelope>,
}

/// History variables of a point.
const HISTORY: [&str; 4] = [
    "scalar damage",
    "largest equivalent strain",
    "equivalent strain",
    "undamaged energy",
];

impl ScalarDamage {
    /// A material without a band: elastic.
    pub fn new(settings: ScalarDamageSettings) -> Self {
        Self {
            elastic: Tensor4::isotropic(settings.lambda, settings.shear),
            settings,
            envelope: None,
        }
    }

    /// The same within a band of the width `width` \[m\].
    ///
    /// # Errors
    /// [`WideBand`] where it would snap back.
    pub fn banded(&self, width: f64) -> Result<Self, WideBand> {
        let settings = &self.settings;
        let widest = settings.widest_band();
        // the area G_f/h is ½ f_t ε₀ (1 + a)
        let after = widest / width - 1.0;
        if after.is_nan() || after <= 0.0 {
            return Err(WideBand {
                width,
                widest,
                strength: settings.strength,
                energy: settings.energy,
            });
        }
        let onset = settings.strength / settings.young();
        Ok(Self {
            envelope: Some(match settings.curve {
                SofteningCurve::Exponential => Envelope::exponential(onset, after, 0.0),
                SofteningCurve::Linear => Envelope::linear(onset, after),
            }),
            ..self.clone()
        })
    }

    /// ε̃ of a strain that stores `energy` undamaged.
    fn equivalent(&self, strain: &Tensor<3>, energy: f64) -> f64 {
        match self.settings.measure {
            EquivalentStrain::Energy => (2.0 * energy / self.settings.young()).sqrt(),
            EquivalentStrain::Mazars => {
                let principal = strain.symmetric_eigenvalues();
                let square = |e: &f64| e.max(0.0) * e.max(0.0);
                principal.iter().map(square).sum::<f64>().sqrt()
            }
        }
    }
}

impl LocalLaw<3> for ScalarDamage {
    fn tangent(&self) -> &Tensor4<3> {
        &self.elastic
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn is_objective(&self) -> bool {
        false
    }

    fn flows_at_constant_volume(&self) -> bool {
        false
    }

    fn history(&self) -> LocalHistory {
        LocalHistory {
            damage: Some(0),
            ..LocalHistory::of(&HISTORY)
        }
    }

    fn in_band(&self, width: f64) -> Option<Banded<3>> {
        let law = self.banded(width);
        Some(law.map(|law| Arc::new(law) as Arc<dyn LocalLaw<3>>))
    }

    fn respond(
        &self,
        gradient: &Tensor<3>,
        _step: f64,
        past: &[f64],
        present: &mut [f64],
    ) -> LocalResponse<3> {
        let strain = strain(gradient);
        let elastic = self.elastic.contract(&strain);
        let energy = 0.5 * elastic.dot(&strain);
        let equivalent = self.equivalent(&strain, energy);
        let [mut damage, before, earlier, stored] = [past[0], past[1], past[2], past[3]];
        let largest = equivalent.max(before);
        let mut dissipated = 0.0;
        if let Some(envelope) = self.envelope.filter(|e| largest > before.max(e.onset)) {
            let grown = (1.0 - RESIDUAL) * envelope.damage(largest);
            // ψ₀ = a + b ε̃² on the way; the strain is past κ, and with it past where the step began
            let slope = (energy - stored) / (equivalent * equivalent - earlier * earlier);
            let spent = (1.0 - RESIDUAL) * (envelope.spent(largest) - envelope.spent(before));
            let constant = energy - slope * equivalent * equivalent;
            dissipated = (constant * (grown - damage) + 2.0 * slope * spent).max(0.0);
            damage = grown.max(damage);
        }
        present.copy_from_slice(&[damage, largest, equivalent, energy]);
        LocalResponse {
            stress: elastic * (1.0 - damage),
            across: 0.0,
            volume_ratio: 1.0,
            stored: (1.0 - damage) * energy,
            dissipated,
        }
    }
}

#[cfg(test)]
#[path = "scalar_damage_tests.rs"]
mod tests;
