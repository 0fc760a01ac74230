//! The Cauchy–Born law of a peridynamic material: the stress of the whole family of a lattice point under a uniform deformation, as a law of finite elements.
//!
//! ```text
//! P(F) = Σ T⟨ξ⟩ ⊗ ξ V ,     T the force state of  y(x + ξ) − y(x) = F ξ
//! ```
//!
//! Source: [SAND2015-7998] eq. (2.10), the collapsed stress, as a sum over the bonds of the lattice instead of an integral over the horizon. An element of this law has the stress of
//! points of the same material at any stretch and rotation, to round-off, for it sums the same bonds. Under a uniform deformation opposite bonds have opposite forces, so that one of each pair counts twice.

use std::sync::Arc;

use super::bond_force::{BondKinematics, stretch::psi};
use crate::{
    material::{Banded, LocalHistory, LocalLaw, LocalResponse, central_differences},
    peridynamics::{Accelerator, EnergyDensity, Law, MemorylessFamily, StatePart},
    tensor::{Tensor, Tensor4, Vector, determinant},
};

/// The whole family of a lattice point, with the coefficients of its law.
///
/// Shapes: one entry per bond; `omega` is not read by a pairwise law.
#[derive(Clone, Debug)]
pub struct LatticeBonds<const D: usize> {
    /// Bond vectors ξ \[m\], each with its opposite.
    pub bonds: Vec<Vector<D>>,
    /// Volumes V of their far points \[m^D\].
    pub volumes: Vec<f64>,
    /// `p` of the linearised law.
    pub pair: Vec<f64>,
    /// `ω` of the linearised law.
    pub omega: Vec<f64>,
    /// Its state part.
    pub state: Option<StatePart<D>>,
}

impl<const D: usize> LatticeBonds<D> {
    /// One bond of each pair of opposite ones, with the volume of both.
    fn halved(&self) -> Self {
        let leads = |xi: &Vector<D>| xi.iter().find(|x| **x != 0.0).is_some_and(|x| *x > 0.0);
        let kept: Vec<usize> = (0..self.bonds.len())
            .filter(|&k| leads(&self.bonds[k]))
            .collect();
        let of = |list: &[f64], times: f64| kept.iter().map(|&k| times * list[k]).collect();
        Self {
            bonds: kept.iter().map(|&k| self.bonds[k]).collect(),
            volumes: of(&self.volumes, 2.0),
            pair: of(&self.pair, 1.0),
            omega: of(&self.omega, 1.0),
            state: self.state.clone(),
        }
    }
}

/// A bond of a law with a fast pass.
#[derive(Clone, Copy, Debug)]
struct FastBond<const D: usize> {
    /// `ξ ⊗ ξ/|ξ|²`.
    dyad: Tensor<D>,
    /// `p |ξ|⁴ V`.
    pair: f64,
    /// `ω |ξ|² V`; zero for a pairwise law.
    omega: f64,
}

/// The Cauchy–Born law of a material without memory.
#[derive(Clone, Debug)]
pub struct CauchyBorn<const D: usize> {
    law: Arc<dyn Law<D>>,
    material: u16,
    kinematics: BondKinematics,
    tangent: Tensor4<D>,
    half: LatticeBonds<D>,
    /// The same bonds, and `κ` of `½ κ θ²`, for exact bonds of a law with an accelerator.
    fast: Option<(Vec<FastBond<D>>, f64)>,
}

impl<const D: usize> CauchyBorn<D> {
    /// Of bonds of the number `material` (0 in a body of one); `tangent` is their collapsed tensor \[Pa\]. None for a law that has a history or no nonlinear response, and for exact bonds of one that is for small strains.
    pub fn new(
        law: &Arc<dyn Law<D>>,
        material: u16,
        family: &LatticeBonds<D>,
        tangent: Tensor4<D>,
        kinematics: BondKinematics,
    ) -> Option<Self> {
        let states = law.force_state()?;
        let is_exact = kinematics == BondKinematics::Exact;
        if !states.history().is_empty() || (is_exact && !states.is_objective()) {
            return None;
        }
        let half = family.halved();
        let fast = law.accelerator().filter(|_| is_exact).map(|accelerator| {
            let is_solid = matches!(accelerator, Accelerator::Solid { .. });
            let bond = |(k, xi): (usize, &Vector<D>)| {
                let (square, volume) = (xi.norm_squared(), half.volumes[k]);
                FastBond {
                    dyad: xi * xi.transpose() / square,
                    pair: half.pair[k] * square * square * volume,
                    omega: match is_solid {
                        true => half.omega[k] * square * volume,
                        false => 0.0,
                    },
                }
            };
            let state = half.state.as_ref().filter(|_| is_solid);
            let bonds = half.bonds.iter().enumerate().map(bond).collect();
            (bonds, state.map_or(0.0, |s| s.modulus.get(0, 0, 0, 0)))
        });
        Some(Self {
            law: Arc::clone(law),
            material,
            kinematics,
            tangent,
            half,
            fast,
        })
    }

    /// `S` of `P = F S`, and the energy, of bonds whose force is linear in their extension, [`super::laws::LinearPeridynamicSolid`] or bonds that act alone.
    ///
    /// With `t = 2 ξ·Eξ/|ξ|²` and the Green–Lagrange strain E, all that a bond does follows from E: a rotation changes nothing.
    fn fast(bonds: &[FastBond<D>], modulus: f64, gradient: &Tensor<D>) -> (Tensor<D>, f64) {
        // 2 E without the difference of two ones
        let strain = gradient + gradient.transpose() + gradient.transpose() * gradient;
        let (mut pairs, mut isotropic) = (Tensor::zeros(), Tensor::zeros());
        let (mut theta, mut stored) = (0.0, 0.0);
        for bond in bonds {
            let t = strain.dot(&bond.dyad);
            let psi = psi(t);
            let extension = t * (1.0 - (1.0 + t) * psi);
            pairs += bond.dyad * (bond.pair * t * psi);
            isotropic += bond.dyad * (bond.omega * (1.0 - t * psi));
            theta += bond.omega * extension;
            stored += bond.pair * extension * extension;
        }
        let stress = pairs + isotropic * (modulus * theta);
        (stress, 0.5 * (stored + modulus * theta * theta))
    }

    /// `∂S/∂E` of [`CauchyBorn::fast`], and S: with the stretches λ of the bonds and their dyads A it is `Σ A ⊗ A (p − κ θ ω)/λ³ + κ B ⊗ B`, `B = Σ A ω/λ`.
    fn fast_moduli(
        bonds: &[FastBond<D>],
        modulus: f64,
        gradient: &Tensor<D>,
    ) -> (Tensor4<D>, Tensor<D>) {
        let strain = gradient + gradient.transpose() + gradient.transpose() * gradient;
        let reversed: Vec<f64> = (bonds.iter())
            .map(|bond| {
                let t = strain.dot(&bond.dyad);
                1.0 - t * psi(t)
            })
            .collect();
        let (mut pairs, mut isotropic, mut theta) = (Tensor::zeros(), Tensor::zeros(), 0.0);
        for (bond, over) in bonds.iter().zip(&reversed) {
            pairs += bond.dyad * (bond.pair * (1.0 - over));
            isotropic += bond.dyad * (bond.omega * over);
            theta += bond.omega * (1.0 / over - 1.0);
        }
        let mut moduli = Tensor4::zeros();
        for (i, j) in (0..D).flat_map(|i| (0..D).map(move |j| (i, j))) {
            let sum = &mut moduli.0[i][j];
            *sum += isotropic * (modulus * isotropic[(i, j)]);
            for (bond, over) in bonds.iter().zip(&reversed) {
                let slope = (bond.pair - modulus * theta * bond.omega) * over.powi(3);
                *sum += bond.dyad * (slope * bond.dyad[(i, j)]);
            }
        }
        (moduli, pairs + isotropic * (modulus * theta))
    }

    /// The dilatation `θ = D/m Σ ω |ξ| e V` of an LPS with exact bonds, [SAND2015-7998] eq. (5.17), and `∂θ/∂F`; zero of other laws.
    ///
    /// At rest it is the trace of the gradient, and a rotation changes nothing of it.
    pub fn dilatation(&self, gradient: &Tensor<D>) -> (f64, Tensor<D>) {
        let (Some((bonds, _)), Some(state)) = (&self.fast, &self.half.state) else {
            return (0.0, Tensor::zeros());
        };
        let strain = gradient + gradient.transpose() + gradient.transpose() * gradient;
        let (mut theta, mut slope) = (0.0, Tensor::zeros());
        for bond in bonds {
            let t = strain.dot(&bond.dyad);
            let psi = psi(t);
            theta += bond.omega * (t * (1.0 - (1.0 + t) * psi));
            slope += bond.dyad * (bond.omega * (1.0 - t * psi));
        }
        let over_m = D as f64 / state.shape.trace();
        let slope = (Tensor::identity() + gradient) * slope;
        (theta * over_m, slope * over_m)
    }

    /// The stress `P` and the energy by the force state of the law.
    fn by_states(&self, gradient: &Tensor<D>) -> (Tensor<D>, EnergyDensity) {
        let half = &self.half;
        let Some(states) = self.law.force_state() else {
            return (Tensor::zeros(), EnergyDensity::default());
        };
        let difference: Vec<Vector<D>> = half.bonds.iter().map(|xi| gradient * xi).collect();
        let family = MemorylessFamily {
            bonds: &half.bonds,
            volumes: &half.volumes,
            pair: &half.pair,
            omega: &half.omega,
            state: half.state.as_ref(),
            material: self.material,
            damage: 0.0,
        };
        family.stress(states, self.kinematics, &difference)
    }
}

impl<const D: usize> LocalLaw<D> for CauchyBorn<D> {
    fn tangent(&self) -> &Tensor4<D> {
        &self.tangent
    }

    fn is_linear(&self) -> bool {
        self.kinematics == BondKinematics::Linear && self.law.is_linear()
    }

    fn is_objective(&self) -> bool {
        self.kinematics == BondKinematics::Exact
    }

    fn history(&self) -> LocalHistory {
        LocalHistory::NONE
    }

    fn flows_at_constant_volume(&self) -> bool {
        false
    }

    // δ_ik S_lj + F_im (∂S/∂E)_mjpl F_kp, and differences for laws without an accelerator
    fn algorithmic_tangent(&self, gradient: &Tensor<D>, step: f64, past: &[f64]) -> Tensor4<D> {
        let Some((bonds, modulus)) = &self.fast else {
            return central_differences(gradient, 0, |gradient, present| {
                self.respond(gradient, step, past, present).stress
            });
        };
        let (moduli, second) = Self::fast_moduli(bonds, *modulus, gradient);
        let f = Tensor::identity() + gradient;
        let mut tangent = Tensor4::zeros();
        for (m, j) in (0..D).flat_map(|m| (0..D).map(move |j| (m, j))) {
            let turned = f * moduli.0[m][j];
            for i in 0..D {
                tangent.0[i][j] += turned * f[(i, m)];
            }
        }
        for (i, j) in (0..D).flat_map(|i| (0..D).map(move |j| (i, j))) {
            for l in 0..D {
                tangent.0[i][j][(i, l)] += second[(l, j)];
            }
        }
        tangent
    }

    fn has_symmetric_tangent(&self) -> bool {
        // without memory, the stress follows from the energy of the family
        true
    }

    fn in_band(&self, _width: f64) -> Option<Banded<D>> {
        None
    }

    fn respond(
        &self,
        gradient: &Tensor<D>,
        _step: f64,
        _past: &[f64],
        _present: &mut [f64],
    ) -> LocalResponse<D> {
        let deformation = Tensor::identity() + gradient;
        let (stress, stored) = match &self.fast {
            Some((bonds, modulus)) => {
                let (second, stored) = Self::fast(bonds, *modulus, gradient);
                (deformation * second, stored)
            }
            None => {
                let (stress, energy) = self.by_states(gradient);
                (stress, energy.stored)
            }
        };
        LocalResponse {
            stress,
            // bonds of a plane know nothing of what is out of it
            across: 0.0,
            volume_ratio: match self.kinematics {
                BondKinematics::Exact => determinant(&deformation),
                BondKinematics::Linear => 1.0,
            },
            stored,
            dissipated: 0.0,
        }
    }
}

#[cfg(test)]
#[path = "cauchy_born_tests.rs"]
mod tests;
