//! Von Mises plasticity for strains and rotations of any size, in logarithmic strains.

use super::{Banded, Hardening, J2, LocalHistory, LocalLaw, LocalResponse};
use crate::tensor::{Tensor, Tensor4, Vector, inverse, strain};

/// J2 plasticity in logarithmic strains: `F = F_e F_p`, `ε_e = ½ ln b_e`, `b_e = F_e F_eᵀ = F C_p⁻¹ Fᵀ`, and [`J2`] between the elastic strain `ε_e` and the Kirchhoff stress `τ = C : ε_e`.
///
/// With the exponential map the return of small strains holds in the principal directions of the trial state (\[Simo1992\]; \[SimoHughes1998\] section 9.4), so that plastic flow keeps the volume. The elastic response is
/// that of Hencky: `ψ = ½ ε_e : C : ε_e`, `P = τ F⁻ᵀ`. Its history variables are `C_p⁻¹ − I` and the equivalent plastic strain.
#[derive(Clone, Debug)]
pub struct LogarithmicJ2 {
    law: J2<3>,
}

impl LogarithmicJ2 {
    /// A solid of the Lamé parameters \[Pa\] and any hardening, of the Kirchhoff stress over the logarithmic plastic strain.
    pub fn new(lambda: f64, shear: f64, hardening: Hardening) -> Self {
        Self {
            law: J2::with_hardening(lambda, shear, hardening),
        }
    }
}

/// Components of a symmetric tensor, row by row.
const COMPONENTS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// `Σ f_a n_a ⊗ n_a` of the principal directions `n_a`, the columns of `directions`.
fn spectral(directions: &Tensor<3>, values: &Vector<3>) -> Tensor<3> {
    directions * Tensor::from_diagonal(values) * directions.transpose()
}

/// Largest size of `b − I` whose logarithm is a series; beyond it the principal directions give it.
const SERIES: f64 = 0.25;

/// `½ ln(I + x)` of a symmetric x, from its principal directions.
fn half_logarithm(x: &Tensor<3>) -> Tensor<3> {
    let eigen = x.symmetric_eigen();
    let values = eigen.eigenvalues.map(|x| 0.5 * x.ln_1p());
    spectral(&eigen.eigenvectors, &values)
}

/// The same by `½ ln(I + x) = artanh z = z (I + z²/3 + z⁴/5 + …)`, `z = x (2 I + x)⁻¹`, to round-off up to [`SERIES`]: elastic strains of metals are far below, and principal directions cost ten times as much.
fn half_logarithm_series(x: &Tensor<3>) -> Option<Tensor<3>> {
    let size = x.norm();
    if size.is_nan() || size > SERIES {
        return None;
    }
    let (halved, _) = inverse(&(Tensor::identity() * 2.0 + x))?;
    let z = x * halved;
    let square = z * z;
    // the last term is below 1e-17 of the first
    let terms = match size {
        s if s < 1e-3 => 3,
        s if s < 2e-2 => 5,
        s if s < 8e-2 => 7,
        _ => 11,
    };
    let mut sum = Tensor::<3>::identity() * (1.0 / f64::from(2 * terms + 1));
    for k in (0..terms).rev() {
        sum = sum * square + Tensor::identity() * (1.0 / f64::from(2 * k + 1));
    }
    Some(z * sum)
}

/// Largest size of a tensor whose exponential is a series at once.
const HALVED: f64 = 0.05;

/// `exp x − I` of a symmetric x, by its series; a large x is halved first, `exp 2 x − I = (exp x − I)² + 2 (exp x − I)`.
fn exponential_less_one(x: &Tensor<3>) -> Tensor<3> {
    let (mut x, mut halvings) = (*x, 0);
    while x.norm() > HALVED && halvings < 64 {
        x *= 0.5;
        halvings += 1;
    }
    // the last term is below 1e-17 of the first
    let terms = match x.norm() {
        s if s < 1e-5 => 4,
        s if s < 2e-3 => 6,
        _ => 9,
    };
    let mut sum = Tensor::<3>::identity();
    for k in (2..=terms).rev() {
        sum = sum * x * (1.0 / f64::from(k)) + Tensor::identity();
    }
    let mut found = x * sum;
    for _ in 0..halvings {
        found = found * found + found * 2.0;
    }
    found
}

/// The state that a step would end in without flow.
struct Trial {
    deformation: Tensor<3>,
    /// `F⁻¹`, and `det F`.
    reverse: Tensor<3>,
    volume_ratio: f64,
    /// `C_p⁻¹ − I`.
    plastic: Tensor<3>,
    /// `b_e − I`.
    strain: Tensor<3>,
}

impl Trial {
    /// None where the body is turned inside out.
    fn new(gradient: &Tensor<3>, past: &[f64]) -> Option<Self> {
        let mut plastic = Tensor::<3>::zeros();
        for ((i, j), p) in COMPONENTS.into_iter().zip(past) {
            plastic[(i, j)] = *p;
            plastic[(j, i)] = *p;
        }
        let deformation = Tensor::identity() + gradient;
        let (reverse, volume_ratio) = inverse(&deformation).filter(|(_, j)| *j > 0.0)?;
        // without the difference of two ones, which would lose small strains
        let strain = gradient
            + gradient.transpose()
            + gradient * gradient.transpose()
            + deformation * plastic * deformation.transpose();
        Some(Self {
            deformation,
            reverse,
            volume_ratio,
            plastic,
            strain,
        })
    }
}

/// `(ln a − ln b)/(a − b)`, also where both are near each other.
fn divided_logarithm(a: f64, b: f64) -> f64 {
    let z = (a - b) / (a + b);
    let square = z * z;
    // artanh z/z
    let ratio = match z.abs() < 1e-2 {
        true => 1.0 + square * (1.0 / 3.0 + square * (0.2 + square / 7.0)),
        false => z.atanh() / z,
    };
    2.0 * ratio / (a + b)
}

impl LocalLaw<3> for LogarithmicJ2 {
    fn tangent(&self) -> &Tensor4<3> {
        self.law.tangent()
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn is_objective(&self) -> bool {
        true
    }

    fn flows_at_constant_volume(&self) -> bool {
        true
    }

    fn history(&self) -> LocalHistory {
        LocalHistory::of(&[
            "plastic deformation xx",
            "plastic deformation xy",
            "plastic deformation xz",
            "plastic deformation yy",
            "plastic deformation yz",
            "plastic deformation zz",
            "equivalent plastic strain",
        ])
    }

    // dP = dτ F⁻ᵀ − τ F⁻ᵀ dFᵀ F⁻ᵀ; dτ of the return of small strains ([Simo1992]) by the logarithm of b_e = F C_p⁻¹ Fᵀ, whose derivative divides its differences in the principal directions
    fn algorithmic_tangent(&self, gradient: &Tensor<3>, step: f64, past: &[f64]) -> Tensor4<3> {
        let Some(trial) = Trial::new(gradient, past) else {
            return Tensor4::from_fn(|_, _, _, _| f64::NAN);
        };
        let eigen = trial.strain.symmetric_eigen();
        let (q, x) = (eigen.eigenvectors, eigen.eigenvalues);
        let slopes = Tensor::<3>::from_fn(|a, b| 0.5 * divided_logarithm(1.0 + x[a], 1.0 + x[b]));
        let total = spectral(&q, &x.map(|x| 0.5 * x.ln_1p()));
        let mut at_start = [0.0; 7];
        at_start[6] = past[6];
        let moduli = self.law.return_moduli(&total, step, &at_start);
        let kirchhoff = self
            .law
            .respond(&total, step, &at_start, &mut [0.0; 7])
            .stress;
        let (m, n) = (moduli.deviatoric, moduli.direction);
        let spherical = self.law.bulk() - m / 3.0;
        let right = (Tensor::identity() + trial.plastic) * trial.deformation.transpose();
        let a = trial.reverse.transpose();
        let stress = kirchhoff * a;
        let mut tangent = Tensor4::zeros();
        for (k, l) in (0..3).flat_map(|k| (0..3).map(move |l| (k, l))) {
            // db_e of a unit of F_kl
            let mut change = Tensor::<3>::zeros();
            for j in 0..3 {
                change[(k, j)] += right[(l, j)];
                change[(j, k)] += right[(l, j)];
            }
            let principal = (q.transpose() * change * q).component_mul(&slopes);
            let strain = q * principal * q.transpose();
            let stressed = Tensor::identity() * (spherical * strain.trace()) + strain * m
                - n * (moduli.along * n.dot(&strain));
            let turned = stressed * a;
            for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
                tangent.0[i][j][(k, l)] = turned[(i, j)] - stress[(i, l)] * a[(k, j)];
            }
        }
        tangent
    }

    fn has_symmetric_tangent(&self) -> bool {
        true
    }

    fn in_band(&self, _width: f64) -> Option<Banded<3>> {
        None
    }

    fn respond(
        &self,
        gradient: &Tensor<3>,
        step: f64,
        past: &[f64],
        present: &mut [f64],
    ) -> LocalResponse<3> {
        // turned inside out: there is no stress, and solvers see that by the number
        let Some(Trial {
            deformation: _,
            reverse,
            volume_ratio,
            plastic,
            strain: trial,
        }) = Trial::new(gradient, past)
        else {
            return LocalResponse {
                stress: Tensor::repeat(f64::NAN),
                across: 0.0,
                volume_ratio: f64::NAN,
                stored: f64::NAN,
                dissipated: f64::NAN,
            };
        };
        let total = half_logarithm_series(&trial).unwrap_or_else(|| half_logarithm(&trial));
        let before = past[6];
        let mut at_start = [0.0; 7];
        at_start[6] = before;
        let mut found = [0.0; 7];
        let small = self.law.respond(&total, step, &at_start, &mut found);
        present.copy_from_slice(past);
        present[6] = found[6];
        if found[6] > before {
            let mut flow = Tensor::<3>::zeros();
            for ((i, j), p) in COMPONENTS.into_iter().zip(found) {
                flow[(i, j)] = p;
                flow[(j, i)] = p;
            }
            // the flow has the principal directions of the trial state: b_e exp(−2 Δε_p) is symmetric
            let change = exponential_less_one(&(flow * -2.0));
            let change = strain(&((Tensor::identity() + trial) * change));
            let plastic = plastic + reverse * change * reverse.transpose();
            for ((i, j), p) in COMPONENTS.into_iter().zip(present.iter_mut()) {
                *p = plastic[(i, j)];
            }
        }
        LocalResponse {
            stress: small.stress * reverse.transpose(),
            across: 0.0,
            volume_ratio,
            stored: small.stored,
            dissipated: small.dissipated,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::material::{Kinematics, Reduced};

    const LAME: (f64, f64) = (600.0, 400.0);
    const YIELD: f64 = 2.0;
    const MODULUS: f64 = 5.0;

    fn law() -> LogarithmicJ2 {
        LogarithmicJ2::new(
            LAME.0,
            LAME.1,
            Hardening::Voce {
                yield_stress: YIELD,
                modulus: MODULUS,
                saturation: 0.0,
                rate: 0.0,
            },
        )
    }

    fn young() -> f64 {
        LAME.1 * (3.0 * LAME.0 + 2.0 * LAME.1) / (LAME.0 + LAME.1)
    }

    /// Responds to gradients one after another; the last response, its history, and what was dissipated.
    fn along<const D: usize>(
        law: &dyn LocalLaw<D>,
        path: &[Tensor<D>],
    ) -> (LocalResponse<D>, Vec<f64>, f64) {
        let mut past = vec![0.0; law.history().len()];
        let mut present = past.clone();
        let mut last = law.respond(&Tensor::zeros(), 0.0, &past, &mut present);
        let mut dissipated = 0.0;
        for g in path {
            last = law.respond(g, 1.0, &past, &mut present);
            past.clone_from(&present);
            dissipated += last.dissipated;
        }
        (last, past, dissipated)
    }

    /// A path through large strains and a rotation, at `t` from 0 to 1.
    fn path(t: f64) -> Tensor<3> {
        let stretch = Tensor::<3>::new(
            0.4 * t,
            0.5 * t,
            -0.2 * t * t,
            0.1 * t,
            -0.2 * t,
            0.0,
            0.0,
            0.3 * t * t,
            0.1 * t,
        );
        let (sine, cosine) = (1.3 * t).sin_cos();
        let turn = Tensor::<3>::new(cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0);
        turn * (Tensor::identity() + stretch) - Tensor::identity()
    }

    fn sampled(steps: usize) -> Vec<Tensor<3>> {
        (1..=steps).map(|k| path(k as f64 / steps as f64)).collect()
    }

    #[test]
    fn a_bar_has_the_bilinear_curve_of_true_stress_over_logarithmic_strain() {
        let bar = Reduced::<1>::new(Arc::new(law()), Kinematics::Bar);
        let tangent = young() * MODULUS / (young() + MODULUS);
        for top in [0.01, 0.3, 0.9f64] {
            let path: Vec<Tensor<1>> = (1..=4)
                .map(|k| Tensor::<1>::new((top * f64::from(k) / 4.0).exp_m1()))
                .collect();
            let (found, ..) = along(&bar, &path);
            let kirchhoff = YIELD + tangent * (top - YIELD / young());
            let expected = kirchhoff / top.exp();
            assert!(
                (found.stress[0] - expected).abs() < 1e-10 * YIELD,
                "{top}: {} {expected}",
                found.stress[0]
            );
            // plastic flow keeps the volume: ln J = (1 − 2 ν) τ/E
            let bulk = LAME.0 + 2.0 / 3.0 * LAME.1;
            let volume = (kirchhoff / (3.0 * bulk)).exp();
            assert!((found.volume_ratio - volume).abs() < 1e-10, "{top}");
        }
    }

    #[test]
    fn a_rotation_of_the_path_rotates_the_stress_and_leaves_the_history() {
        let (sine, cosine) = 1.1f64.sin_cos();
        let turn = Tensor::<3>::new(1.0, 0.0, 0.0, 0.0, cosine, -sine, 0.0, sine, cosine);
        let turned: Vec<_> = sampled(20)
            .iter()
            .map(|g| turn * (Tensor::identity() + g) - Tensor::identity())
            .collect();
        let (a, history, lost) = along(&law(), &sampled(20));
        let (b, same, also) = along(&law(), &turned);
        assert!((turn * a.stress - b.stress).amax() < 1e-11 * YIELD);
        assert!(
            history
                .iter()
                .zip(&same)
                .all(|(a, b)| (a - b).abs() < 1e-12),
            "{history:?} {same:?}"
        );
        assert!((lost - also).abs() < 1e-11 * lost && lost > YIELD * 0.5);
        // the flow keeps the volume: det C_p⁻¹ = 1
        let mut plastic = Tensor::<3>::identity();
        for ((i, j), p) in COMPONENTS.into_iter().zip(&history) {
            plastic[(i, j)] = f64::from(u8::from(i == j)) + p;
            plastic[(j, i)] = plastic[(i, j)];
        }
        assert!((plastic.determinant() - 1.0).abs() < 1e-11);
    }

    #[test]
    fn work_is_what_is_stored_and_dissipated_to_first_order_in_the_step() {
        let off = |steps: usize| {
            let path = sampled(steps);
            let law = law();
            let (mut past, mut present) = (vec![0.0; 7], vec![0.0; 7]);
            let (mut work, mut dissipated, mut stored) = (0.0, 0.0, 0.0);
            let (mut before, mut stress) = (Tensor::<3>::zeros(), Tensor::<3>::zeros());
            for g in &path {
                let found = law.respond(g, 1.0, &past, &mut present);
                past.clone_from(&present);
                work += 0.5 * (stress + found.stress).dot(&(g - before));
                (before, stress) = (*g, found.stress);
                dissipated += found.dissipated;
                stored = found.stored;
            }
            (work - stored - dissipated).abs() / work
        };
        let (coarse, fine) = (off(400), off(800));
        assert!(fine < 2e-3 && fine < 0.6 * coarse, "{coarse} {fine}");
    }

    #[test]
    fn series_give_what_principal_directions_give() {
        for k in 0..60 {
            // sizes from 1e-13 to the limit, any directions, some with two equal principal values
            let size = SERIES / 3f64.sqrt() * 10f64.powf(-f64::from(k % 14));
            let t = f64::from(k);
            let turn = path(0.01 * t) + Tensor::identity();
            let directions = turn.symmetric_eigen().eigenvectors;
            let third = if k % 3 == 0 { -0.4 } else { (1.7 * t).sin() };
            let values = Vector::<3>::new(t.sin(), -0.4, third) * size;
            let x = spectral(&directions, &values);
            let exact = spectral(&directions, &values.map(|x| 0.5 * x.ln_1p()));
            let found = half_logarithm_series(&x).unwrap();
            assert!(
                (found - exact).amax() < 4e-15 * size,
                "{k}: {found} {exact}"
            );
            assert!((half_logarithm(&x) - exact).amax() < 4e-15 * size, "{k}");
            for stretch in [1.0, 30.0] {
                let exact = spectral(&directions, &(values * stretch).map(f64::exp_m1));
                let found = exponential_less_one(&(x * stretch));
                assert!(
                    (found - exact).amax() < 4e-15 * exact.amax(),
                    "{k}: {found} {exact}"
                );
            }
        }
        assert!(half_logarithm_series(&(Tensor::identity() * SERIES)).is_none());
    }

    #[test]
    fn a_body_turned_inside_out_has_no_stress() {
        let g = Tensor::<3>::from_diagonal(&Vector::<3>::new(-2.0, 0.0, 0.0));
        assert!(along(&law(), &[g]).0.stress[(0, 0)].is_nan());
    }
}
