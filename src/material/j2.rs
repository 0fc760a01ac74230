//! Von Mises plasticity with isotropic hardening, for small strains.

use super::{Banded, Hardening, Kinematics, LocalHistory, LocalLaw, LocalResponse};
use crate::tensor::{Tensor, Tensor4, strain};

/// J2 plasticity: `σ = C : (ε − ε_p)`, `f = √(3/2) |dev σ| − σ_y(α) ≤ 0`, `ε̇_p = α̇ √(3/2) dev σ/|dev σ|`, with the yield stress of [`Hardening`].
///
/// The stress at the end of a step is found by radial return (\[SimoHughes1998\] box 3.1), which is exact for loads that keep their direction. α is the equivalent plastic strain; what hardening stores and what flow dissipates is said there.
///
/// In a bar the stress is uniaxial; plane bodies are in plane strain.
#[derive(Clone, Debug)]
pub struct J2<const D: usize> {
    elastic: Tensor4<D>,
    shear: f64,
    hardening: Hardening,
}

impl<const D: usize> J2<D> {
    /// A material of the Lamé parameters of `D` dimensions, the yield stress σ_y and the modulus H of linear hardening \[Pa\].
    pub fn new(lambda: f64, shear: f64, yield_stress: f64, modulus: f64) -> Self {
        let hardening = Hardening::Voce {
            yield_stress,
            modulus,
            saturation: 0.0,
            rate: 0.0,
        };
        Self::with_hardening(lambda, shear, hardening)
    }

    /// A material of the Lamé parameters of `D` dimensions \[Pa\] and any hardening.
    pub fn with_hardening(lambda: f64, shear: f64, hardening: Hardening) -> Self {
        Self {
            elastic: Tensor4::isotropic(lambda, shear),
            shear,
            hardening,
        }
    }

    /// The kinematics in which the law holds.
    pub const KINEMATICS: &'static [Kinematics] =
        &[Kinematics::Bar, Kinematics::PlaneStrain, Kinematics::Solid];

    /// The stress deviator of a solid, `(in plane, out of plane)`, from the strain `e` that is elastic in plane and `out` out of it; in a bar the stress.
    fn deviator(&self, e: &Tensor<D>, out: f64) -> (Tensor<D>, f64) {
        if D == 1 {
            return (self.elastic.contract(e), 0.0);
        }
        let mean = (e.trace() + out) / 3.0;
        let dev = (e - Tensor::identity() * mean) * (2.0 * self.shear);
        // a solid has all of its deviator in the tensor
        let across = if D == 2 { out - mean } else { 0.0 };
        (dev, 2.0 * self.shear * across)
    }
}

/// The state that a step would end in without flow.
struct Trial<const D: usize> {
    plastic: Tensor<D>,
    /// The stress deviator in plane, and its size with what is out of the plane; in a bar the stress.
    deviator: Tensor<D>,
    norm: f64,
    equivalent: f64,
    /// Decrease of the equivalent stress per unit of α.
    stiffness: f64,
}

/// Moduli of the return to the yield surface: `dσ = K tr dε I + m dev dε − a n (n : dε)` with the direction n of the trial deviator (\[SimoHughes1998\] box 3.2); in a bar `dσ = m dε`.
pub(super) struct ReturnModuli<const D: usize> {
    /// m \[Pa\].
    pub deviatoric: f64,
    /// a \[Pa\].
    pub along: f64,
    /// n, of the size one in a solid.
    pub direction: Tensor<D>,
}

impl<const D: usize> J2<D> {
    /// The trial state of a strain.
    fn trial(&self, total: &Tensor<D>, past: &[f64]) -> Trial<D> {
        let mut plastic = Tensor::<D>::zeros();
        for ((i, j), p) in components::<D>().zip(past) {
            plastic[(i, j)] = *p;
            plastic[(j, i)] = *p;
        }
        let (deviator, out) = self.deviator(&(total - plastic), out_of_plane(&plastic));
        let norm = (deviator.norm_squared() + out * out).sqrt();
        let (equivalent, stiffness) = match D {
            1 => (norm, self.elastic.get(0, 0, 0, 0)),
            _ => (1.5f64.sqrt() * norm, 3.0 * self.shear),
        };
        Trial {
            plastic,
            deviator,
            norm,
            equivalent,
            stiffness,
        }
    }

    /// `K` of [`ReturnModuli`] \[Pa\].
    pub(super) fn bulk(&self) -> f64 {
        self.elastic.get(0, 0, 0, 0) - 4.0 / 3.0 * self.shear
    }

    /// The moduli at a strain.
    pub(super) fn return_moduli(
        &self,
        total: &Tensor<D>,
        step: f64,
        past: &[f64],
    ) -> ReturnModuli<D> {
        let trial = self.trial(total, past);
        let before = past[past.len() - 1];
        let flow = (self.hardening).flow(trial.equivalent, trial.stiffness, before, step);
        let elastic = match D {
            1 => trial.stiffness,
            _ => 2.0 * self.shear,
        };
        if flow.is_nan() || flow <= 0.0 {
            return ReturnModuli {
                deviatoric: elastic,
                along: 0.0,
                direction: Tensor::zeros(),
            };
        }
        let (_, slope) = self.hardening.yield_stress(before + flow, flow, step);
        // of the flow: over the equivalent stress, and by that stress
        let mean = trial.stiffness * flow / trial.equivalent;
        let local = trial.stiffness / (trial.stiffness + slope);
        match D {
            1 => ReturnModuli {
                deviatoric: elastic * (1.0 - local),
                along: 0.0,
                direction: Tensor::zeros(),
            },
            _ => ReturnModuli {
                deviatoric: elastic * (1.0 - mean),
                along: elastic * (local - mean),
                direction: trial.deviator / trial.norm,
            },
        }
    }
}

/// The plastic strain out of the plane makes up for that within it, and the elastic one for it; in a solid both are zero.
fn out_of_plane<const D: usize>(plastic: &Tensor<D>) -> f64 {
    if D == 2 { plastic.trace() } else { 0.0 }
}

/// Independent components of a symmetric tensor, row by row.
fn components<const D: usize>() -> impl Iterator<Item = (usize, usize)> {
    (0..D).flat_map(|i| (i..D).map(move |j| (i, j)))
}

impl<const D: usize> LocalLaw<D> for J2<D> {
    fn tangent(&self) -> &Tensor4<D> {
        &self.elastic
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn is_objective(&self) -> bool {
        false
    }

    fn flows_at_constant_volume(&self) -> bool {
        // a bar is in uniaxial stress: its sides are free
        D > 1
    }

    fn history(&self) -> LocalHistory {
        LocalHistory::of(match D {
            1 => &["plastic strain xx", "equivalent plastic strain"],
            2 => &[
                "plastic strain xx",
                "plastic strain xy",
                "plastic strain yy",
                "equivalent plastic strain",
            ],
            _ => &[
                "plastic strain xx",
                "plastic strain xy",
                "plastic strain xz",
                "plastic strain yy",
                "plastic strain yz",
                "plastic strain zz",
                "equivalent plastic strain",
            ],
        })
    }

    fn algorithmic_tangent(&self, gradient: &Tensor<D>, step: f64, past: &[f64]) -> Tensor4<D> {
        let moduli = self.return_moduli(&strain(gradient), step, past);
        let (m, n) = (moduli.deviatoric, moduli.direction);
        if D == 1 {
            return Tensor4::from_fn(|_, _, _, _| m);
        }
        let mut tangent = Tensor4::isotropic(self.bulk() - m / 3.0, 0.5 * m);
        for (i, j) in (0..D).flat_map(|i| (0..D).map(move |j| (i, j))) {
            tangent.0[i][j] -= n * (moduli.along * n[(i, j)]);
        }
        tangent
    }

    fn has_symmetric_tangent(&self) -> bool {
        true
    }

    fn in_band(&self, _width: f64) -> Option<Banded<D>> {
        None
    }

    fn respond(
        &self,
        gradient: &Tensor<D>,
        step: f64,
        past: &[f64],
        present: &mut [f64],
    ) -> LocalResponse<D> {
        let before = past[past.len() - 1];
        let total = strain(gradient);
        let Trial {
            mut plastic,
            deviator,
            norm,
            equivalent,
            stiffness,
        } = self.trial(&total, past);
        let flow = self.hardening.flow(equivalent, stiffness, before, step);
        if flow > 0.0 {
            let along = if D == 1 { 1.0 } else { 1.5f64.sqrt() };
            plastic += deviator * (flow * along / norm);
        }
        let alpha = before + flow;
        for ((i, j), p) in components::<D>().zip(present.iter_mut()) {
            *p = plastic[(i, j)];
        }
        present[past.len() - 1] = alpha;
        let elastic = total - plastic;
        let out = out_of_plane(&plastic);
        let mut stress = self.elastic.contract(&elastic);
        let lambda = self.elastic.get(0, 0, 0, 0) - 2.0 * self.shear;
        let mut stored = 0.5 * stress.dot(&elastic);
        let mut across = 0.0;
        if D == 2 {
            // the strain out of the plane, which is elastic against the plastic one
            stress += Tensor::identity() * (lambda * out);
            across = lambda * (elastic.trace() + out) + 2.0 * self.shear * out;
            stored = 0.5 * (stress.dot(&elastic) + across * out);
        }
        LocalResponse {
            stress,
            across,
            volume_ratio: 1.0,
            stored: stored + self.hardening.stored(alpha),
            dissipated: self.hardening.dissipated(alpha, flow, step),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Elastic;

    const YIELD: f64 = 250.0;
    const HARDENING: f64 = 9e3;

    /// Responds to strains one after another; the last stress.
    fn follow(law: &J2<1>, path: &[f64]) -> f64 {
        let mut past = vec![0.0; law.history().len()];
        let mut stress = 0.0;
        for &strain in path {
            let mut present = past.clone();
            let strain = Tensor::<1>::from_element(strain);
            stress = law.respond(&strain, 1.0, &past, &mut present).stress[0];
            past = present;
        }
        stress
    }

    #[test]
    fn a_bar_follows_its_bilinear_curve_and_unloads_elastically() {
        let solid = Elastic::new(2e5, 0.3, 1.0).unwrap();
        let (lambda, shear) = solid.lame::<1>(Kinematics::Bar).unwrap();
        let law = J2::<1>::new(lambda, shear, YIELD, HARDENING);
        let (top, e) = (4e-3, 2e5);
        let tangent = e * HARDENING / (e + HARDENING);
        let expected = YIELD + tangent * (top - YIELD / e);
        let stress = follow(&law, &[1e-3, top]);
        assert!((stress - expected).abs() < 1e-9 * YIELD, "{stress}");
        // back to no stress, and as far again into compression, where the grown yield surface holds
        let back = top - expected / e;
        assert!(follow(&law, &[top, back]).abs() < 1e-9 * YIELD);
        let turned = top - 2.0 * expected / e;
        let stress = follow(&law, &[top, turned]);
        assert!((stress + expected).abs() < 1e-9 * YIELD, "{stress}");
    }
}
