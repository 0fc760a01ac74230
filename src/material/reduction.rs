//! A law of solids in bodies of fewer dimensions.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::{Banded, Kinematics, LocalHistory, LocalLaw, LocalResponse};
use crate::tensor::{Tensor, Tensor4};

/// Number of history variables of a point up to which they take no memory of their own.
const FEW: usize = 32;

/// Most corrections of the strain out of the body.
const ITERATIONS: usize = 60;

/// A law of solids as a bar, a plate or a long body has it: strains out of the body are zero (plane strain), or such that no stress acts there (plane stress, and bars, whose two sides
/// contract alike).
///
/// The strain that no stress goes with is found by Newton's method at each response, to round-off; it is a function of the gradient and of the history alone.
/// Beside a history, that strain is remembered: a state that is looked at again is the one that was found.
#[derive(Clone, Debug)]
pub struct Reduced<const D: usize> {
    law: Arc<dyn LocalLaw<3>>,
    /// History of the law, then the numbers of [`OWN`] where it has any and a strain is free.
    history: LocalHistory,
    /// The first direction whose strain follows from the stress being zero; 3 if there is none.
    free: usize,
    tangent: Tensor4<D>,
}

/// Number of history variables beside those of the solid, which are not shown: the strain out of the body, and the largest gradient so far, which sets the scale of round-off.
const OWN: usize = 2;

/// The names of a history, and so many numbers that are not shown.
pub(super) fn with_unnamed(
    history: &'static [&'static str],
    more: usize,
) -> &'static [&'static str] {
    static MADE: Mutex<BTreeMap<Vec<&str>, &'static [&'static str]>> = Mutex::new(BTreeMap::new());
    let names = [history, &vec![""; more]].concat();
    let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
    made.entry(names.clone()).or_insert_with(|| names.leak())
}

impl<const D: usize> Reduced<D> {
    /// The law in these kinematics, which are of `D` dimensions.
    pub fn new(law: Arc<dyn LocalLaw<3>>, kinematics: Kinematics) -> Self {
        debug_assert_eq!(kinematics.dimension(), D);
        let free = match kinematics {
            Kinematics::Bar | Kinematics::PlaneStress => D,
            Kinematics::PlaneStrain | Kinematics::Solid => 3,
        };
        let tangent = condensed(law.tangent(), free);
        let mut history = law.history();
        if free < 3 && !history.is_empty() {
            history.names = with_unnamed(history.names, OWN);
        }
        Self {
            law,
            history,
            free,
            tangent,
        }
    }

    /// The gradient of the solid.
    fn whole(&self, gradient: &Tensor<D>, out: f64) -> Tensor<3> {
        let mut whole = Tensor::<3>::zeros();
        for (i, j) in (0..D).flat_map(|i| (0..D).map(move |j| (i, j))) {
            whole[(i, j)] = gradient[(i, j)];
        }
        (self.free..3).for_each(|f| whole[(f, f)] = out);
        whole
    }

    fn at(
        &self,
        gradient: &Tensor<D>,
        out: f64,
        step: f64,
        past: &[f64],
        present: &mut [f64],
    ) -> LocalResponse<3> {
        let whole = self.whole(gradient, out);
        self.law.respond(&whole, step, past, present)
    }

    /// Returns the history of the solid.
    fn of_solid<'a>(&self, history: &'a [f64]) -> &'a [f64] {
        &history[..self.law.history().len()]
    }

    /// The strain out of the body and the largest gradient that are remembered; zero of a law without a history.
    fn remembered(&self, past: &[f64]) -> [f64; 2] {
        match past.get(self.law.history().len()..) {
            Some(&[out, largest]) => [out, largest],
            _ => [0.0; 2],
        }
    }

    /// The strain out of the body; not a number where none is found.
    fn out(&self, gradient: &Tensor<D>, step: f64, past: &[f64]) -> f64 {
        match self.free {
            3 => 0.0,
            _ if gradient.amax() == 0.0 && past.iter().all(|x| *x == 0.0) => 0.0,
            _ => self.strain_out(gradient, step, self.of_solid(past), self.remembered(past)),
        }
    }

    /// The strain out of the body at which no stress acts there; not a number where none is found.
    fn strain_out(
        &self,
        gradient: &Tensor<D>,
        step: f64,
        past: &[f64],
        [known, largest]: [f64; 2],
    ) -> f64 {
        let solid = self.law.tangent();
        let resistance: f64 = (self.free..3).map(|g| solid.get(2, 2, g, g)).sum();
        // on the stack, for this is asked at every point of every step
        let (mut few, mut many) = ([0.0; FEW], Vec::new());
        let present = match past.len() <= FEW {
            true => &mut few[..past.len()],
            false => {
                many.resize(past.len(), 0.0);
                &mut many[..]
            }
        };
        let mut stress = |out: f64| self.at(gradient, out, step, past, present).stress[(2, 2)];
        let along: f64 = (0..D)
            .map(|k| solid.get(2, 2, k, k) * gradient[(k, k)])
            .sum();
        let is_none = |stress: f64, size: f64| stress.abs() <= 1e-11 * resistance * size;
        // no time has passed: what was found holds, as long as the body is where it was; a law whose stress takes a rate would find another
        if step == 0.0 && largest > 0.0 && is_none(stress(known), largest.max(known.abs())) {
            return known;
        }
        let mut out = (-along / resistance).max(-0.9);
        let mut here = stress(out);
        // a body that is back where it began may be stressed by what it remembers alone, and by the round-off of what it had
        let size = gradient.amax().max(here.abs() / resistance);
        let size = size.max(largest).max(f64::MIN_POSITIVE);
        let mut within = [f64::NEG_INFINITY, f64::INFINITY];
        for _ in 0..ITERATIONS {
            // the stress grows with the strain
            match here > 0.0 {
                true => within[1] = within[1].min(out),
                false => within[0] = within[0].max(out),
            }
            let by = 1e-7 * size.max(out.abs());
            let slope = (stress(out + by) - stress(out - by)) / (2.0 * by);
            let mut change = -here / slope;
            if self.law.is_objective() {
                // the material keeps a positive thickness
                change = change.max(-0.5 * (1.0 + out));
            }
            let is_last = change.abs() <= 1e-15 * size.max(out.abs()) || !change.is_finite();
            let [low, high] = within;
            // between flow in one direction and in the other Newton's method may go to and fro
            if !is_last && (out + change <= low || out + change >= high) {
                let middle = 0.5 * (low + high);
                if middle.is_finite() {
                    change = middle - out;
                }
            }
            out += change;
            here = stress(out);
            if is_last {
                break;
            }
        }
        // the last change may go to and fro by round-off; a stress that stays is none
        match is_none(here, size.max(out.abs())) {
            true => out,
            false => f64::NAN,
        }
    }
}

/// The tangent of a solid, from which the directions from `free` on are condensed: they give way such that no stress acts there, those of two sides alike.
fn condensed<const D: usize>(solid: &Tensor4<3>, free: usize) -> Tensor4<D> {
    let resistance: f64 = (free..3).map(|g| solid.get(2, 2, g, g)).sum();
    Tensor4::from_fn(|i, j, k, l| {
        let across: f64 = (free..3).map(|f| solid.get(i, j, f, f)).sum();
        let yielded = match free {
            3 => 0.0,
            _ => across * solid.get(2, 2, k, l) / resistance,
        };
        solid.get(i, j, k, l) - yielded
    })
}

impl<const D: usize> LocalLaw<D> for Reduced<D> {
    fn tangent(&self) -> &Tensor4<D> {
        &self.tangent
    }

    fn is_linear(&self) -> bool {
        self.law.is_linear()
    }

    fn is_objective(&self) -> bool {
        self.law.is_objective()
    }

    fn flows_at_constant_volume(&self) -> bool {
        // the thickness, or the sides, make up for the rest
        self.free == 3 && self.law.flows_at_constant_volume()
    }

    fn history(&self) -> LocalHistory {
        self.history
    }

    fn in_band(&self, width: f64) -> Option<Banded<D>> {
        let banded = |law| -> Arc<dyn LocalLaw<D>> {
            Arc::new(Self {
                law,
                ..self.clone()
            })
        };
        Some(self.law.in_band(width)?.map(banded))
    }

    fn failure(&self) -> Option<String> {
        self.law.failure()
    }

    fn algorithmic_tangent(&self, gradient: &Tensor<D>, step: f64, past: &[f64]) -> Tensor4<D> {
        let whole = self.whole(gradient, self.out(gradient, step, past));
        let past = self.of_solid(past);
        condensed(&self.law.algorithmic_tangent(&whole, step, past), self.free)
    }

    fn has_symmetric_tangent(&self) -> bool {
        self.law.has_symmetric_tangent()
    }

    fn respond(
        &self,
        gradient: &Tensor<D>,
        step: f64,
        past: &[f64],
        present: &mut [f64],
    ) -> LocalResponse<D> {
        let out = self.out(gradient, step, past);
        let (of_solid, own) = present.split_at_mut(self.law.history().len());
        if let [across, largest] = own {
            let [_, before] = self.remembered(past);
            (*across, *largest) = (out, before.max(gradient.amax()).max(out.abs()));
        }
        let found = self.at(gradient, out, step, self.of_solid(past), of_solid);
        LocalResponse {
            stress: Tensor::from_fn(|i, j| found.stress[(i, j)]),
            // no shear across and no strain: P_zz is the Kirchhoff stress
            across: match self.free {
                3 if D < 3 => found.stress[(2, 2)] / found.volume_ratio,
                _ => 0.0,
            },
            volume_ratio: found.volume_ratio,
            stored: found.stored,
            dissipated: found.dissipated,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{J2, NeoHooke, StVenantKirchhoff};

    const LAME: (f64, f64) = (600.0, 400.0);

    fn plastic() -> Arc<dyn LocalLaw<3>> {
        Arc::new(J2::<3>::new(LAME.0, LAME.1, 2.0, 50.0))
    }

    /// Responds to gradients one after another; the last response.
    fn along<const D: usize>(law: &dyn LocalLaw<D>, path: &[Tensor<D>]) -> LocalResponse<D> {
        let mut past = vec![0.0; law.history().len()];
        let mut present = past.clone();
        let mut last = law.respond(&Tensor::zeros(), 0.0, &past, &mut present);
        for g in path {
            last = law.respond(g, 1.0, &past, &mut present);
            past.clone_from(&present);
        }
        last
    }

    #[test]
    fn a_reduced_law_is_the_one_written_for_the_body() {
        let path: Vec<Tensor<2>> = [(0.01, 0.004), (0.02, -0.01), (-0.01, 0.003)]
            .map(|(a, b)| Tensor::<2>::new(a, b, 0.3 * b, -0.2 * a))
            .to_vec();
        let own = along(&J2::<2>::new(LAME.0, LAME.1, 2.0, 50.0), &path);
        let reduced = along(&Reduced::new(plastic(), Kinematics::PlaneStrain), &path);
        assert!((own.stress - reduced.stress).amax() < 1e-12);
        assert!((own.across - reduced.across).abs() < 1e-12 && own.across != 0.0);
        assert!((own.stored - reduced.stored).abs() < 1e-12);
        assert!((own.dissipated - reduced.dissipated).abs() < 1e-12 && own.dissipated > 0.0);

        // a bar: λ of one dimension is E − 2 μ
        let young = LAME.1 * (3.0 * LAME.0 + 2.0 * LAME.1) / (LAME.0 + LAME.1);
        let path = [0.01, 0.03, -0.02].map(Tensor::<1>::new);
        let own = along(
            &J2::<1>::new(young - 2.0 * LAME.1, LAME.1, 2.0, 50.0),
            &path,
        );
        let reduced = along(&Reduced::new(plastic(), Kinematics::Bar), &path);
        assert!((own.stress - reduced.stress).amax() < 1e-11 * young);
        assert!((own.stored - reduced.stored).abs() < 1e-10);
    }

    #[test]
    fn tangents_are_those_of_linear_elasticity() {
        let poisson = 0.5 * LAME.0 / (LAME.0 + LAME.1);
        let young = 2.0 * LAME.1 * (1.0 + poisson);
        let elastic = crate::material::Elastic::new(young, poisson, 0.0).unwrap();
        fn differs<const D: usize>(a: &Tensor4<D>, b: &Tensor4<D>) -> f64 {
            let mut difference = *a;
            difference.add_scaled(-1.0, b);
            difference.amax()
        }
        for kinematics in [Kinematics::PlaneStress, Kinematics::PlaneStrain] {
            let linear = elastic.stiffness::<2>(kinematics).unwrap();
            let reduced = Reduced::<2>::new(plastic(), kinematics);
            assert!(differs(reduced.tangent(), &linear) < 1e-12 * young);
        }
        let linear = elastic.stiffness::<1>(Kinematics::Bar).unwrap();
        let reduced = Reduced::<1>::new(plastic(), Kinematics::Bar);
        assert!(differs(reduced.tangent(), &linear) < 1e-12 * young);
    }

    #[test]
    fn a_bar_of_a_hyperelastic_solid_has_its_closed_form() {
        let young = LAME.1 * (3.0 * LAME.0 + 2.0 * LAME.1) / (LAME.0 + LAME.1);
        for stretch in [0.8, 1.1, 1.6f64] {
            // S = E_young E_xx where the sides carry none
            let solid = StVenantKirchhoff::new(LAME.0, LAME.1);
            let law = Reduced::<1>::new(Arc::new(solid), Kinematics::Bar);
            let found = along(&law, &[Tensor::<1>::new(stretch - 1.0)]).stress[0];
            let expected = young * 0.5 * (stretch * stretch - 1.0) * stretch;
            assert!(
                (found - expected).abs() < 1e-11 * young,
                "{found} {expected}"
            );
            // μ (λ_t² − 1) + λ ln J = 0 gives ln J, and with it P = μ (λ − 1/λ) + λ ln J/λ, by bisection of λ_t
            let (mut low, mut high) = (0.1, 3.0f64);
            for _ in 0..200 {
                let side = 0.5 * (low + high);
                let out = LAME.1 * (side * side - 1.0) + LAME.0 * (stretch * side * side).ln();
                if out > 0.0 { high = side } else { low = side }
            }
            let expected =
                LAME.1 * (stretch - 1.0 / stretch) + LAME.0 * (stretch * low * low).ln() / stretch;
            let solid = NeoHooke::new(LAME.0, LAME.1);
            let law = Reduced::<1>::new(Arc::new(solid), Kinematics::Bar);
            let found = along(&law, &[Tensor::<1>::new(stretch - 1.0)]).stress[0];
            assert!(
                (found - expected).abs() < 1e-11 * young,
                "{found} {expected}"
            );
        }
    }

    /// A solid that is given by its increments, as user routines are: `Δσ = C : Δε`, and beside it a stress `η Δε/Δt` while time passes.
    #[derive(Debug)]
    struct Increments {
        elastic: Tensor4<3>,
        viscosity: f64,
    }

    /// Gradient and elastic stress, by columns, then the stress of the last step.
    const NUMBERS: [&str; 27] = ["number"; 27];

    impl LocalLaw<3> for Increments {
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
            LocalHistory::of(&NUMBERS)
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
            let [before, elastic, last] =
                [0, 9, 18].map(|k| Tensor::<3>::from_column_slice(&past[k..k + 9]));
            let change = gradient - before;
            let elastic = elastic + self.elastic.contract(&change);
            let stress = match step {
                0.0 if change.amax() == 0.0 => last,
                0.0 => elastic,
                _ => elastic + (change + change.transpose()) * (0.5 * self.viscosity / step),
            };
            for (k, kept) in [*gradient, elastic, stress].iter().enumerate() {
                present[9 * k..9 * k + 9].copy_from_slice(kept.as_slice());
            }
            LocalResponse {
                stress,
                across: 0.0,
                volume_ratio: 1.0 + gradient.trace(),
                stored: 0.0,
                dissipated: 0.0,
            }
        }
    }

    fn increments(viscosity: f64) -> Arc<dyn LocalLaw<3>> {
        let elastic = *StVenantKirchhoff::new(LAME.0, LAME.1).tangent();
        Arc::new(Increments { elastic, viscosity })
    }

    #[test]
    fn a_state_that_is_looked_at_again_has_the_stress_that_was_found() {
        let law = Reduced::<2>::new(increments(80.0), Kinematics::PlaneStress);
        let mut past = vec![0.0; law.history().len()];
        let mut present = past.clone();
        for k in 1..6 {
            let g = Tensor::<2>::new(0.01, 0.002, 0.0, -0.004) * f64::from(k);
            let found = law.respond(&g, 0.1, &past, &mut present);
            past.clone_from(&present);
            let again = law.respond(&g, 0.0, &past, &mut present);
            assert!((again.stress - found.stress).amax() < 1e-12 * found.stress.amax());
            // Kelvin and Voigt in plane stress: σ_zz = λ tr ε + 2 μ ε_zz + η dε_zz/dt = 0, in steps
            let (lambda, shear, rate) = (LAME.0, LAME.1, 80.0 / 0.1);
            let mut out = 0.0;
            for n in 1..=k {
                let within = 0.006 * f64::from(n);
                out = (rate * out - lambda * within) / (lambda + 2.0 * shear + rate);
            }
            let elastic = lambda * (g.trace() + out) + 2.0 * shear * g[(0, 0)];
            let expected = elastic + rate * 0.01;
            assert!((found.stress[(0, 0)] - expected).abs() < 1e-10 * expected);
        }
    }

    #[test]
    fn increments_that_lead_back_leave_round_off() {
        for kinematics in [Kinematics::PlaneStress, Kinematics::PlaneStrain] {
            let law = Reduced::<2>::new(increments(0.0), kinematics);
            let g = Tensor::<2>::new(0.013, 0.002, 0.001, -0.0137);
            let back = [g, g * 0.37, Tensor::zeros(), g * 1e-9];
            for length in 1..=back.len() {
                let last = along(&law, &back[..length]).stress;
                let expected = law.tangent().contract(&back[length - 1]);
                assert!(
                    (last - expected).amax() < 1e-12,
                    "{kinematics:?} {length}: {last}"
                );
            }
        }
        let law = Reduced::<1>::new(increments(0.0), Kinematics::Bar);
        let path = [0.01, -0.02, 0.0].map(Tensor::<1>::new);
        assert!(along(&law, &path).stress.amax() < 1e-12);
    }

    /// Beyond a reversal the stress out of the plane is S-shaped in the strain there, between slopes of which Newton's method may go to and fro where 4 μ/3 > K.
    #[test]
    fn a_plate_that_flows_to_and_fro_has_its_closed_form_at_any_poisson_ratio() {
        let (young, hardening, flow) = (1000.0, 50.0, 2.0);
        for poisson in [0.0, 0.1, 0.15, 0.3, 0.45] {
            let shear = 0.5 * young / (1.0 + poisson);
            let lambda = 2.0 * shear * poisson / (1.0 - 2.0 * poisson);
            let solid = J2::<3>::new(lambda, shear, flow, hardening);
            let law = Reduced::<1>::new(Arc::new(solid), Kinematics::Bar);
            let plate = J2::<3>::new(lambda, shear, flow, hardening);
            let plate = Reduced::<2>::new(Arc::new(plate), Kinematics::PlaneStress);
            for size in [0.005, 0.03, 0.2] {
                let path = [0.5, 1.0, 0.2, -1.0, -0.9, 1.0, 0.0].map(|part| part * size);
                // linear isotropic hardening of a bar
                let (mut plastic, mut equivalent) = (0.0, 0.0);
                let mut expected = 0.0;
                for strain in path {
                    let trial: f64 = young * (strain - plastic);
                    let over = trial.abs() - (flow + hardening * equivalent);
                    let more = (over / (young + hardening)).max(0.0);
                    plastic += more * trial.signum();
                    equivalent += more;
                    expected = young * (strain - plastic);
                }
                let found = along(&law, &path.map(Tensor::<1>::new)).stress[0];
                assert!(
                    (found - expected).abs() < 1e-9 * young * size,
                    "{poisson} {size}"
                );
                // sheared: no strain out of the plane, whatever the ratio
                let turned = path.map(|strain| Tensor::<2>::new(strain, 0.0, 0.0, -strain));
                let stress = along(&plate, &turned).stress;
                assert!(
                    stress.iter().all(|s| s.is_finite()),
                    "{poisson} {size}: {stress}"
                );
                let pulled = path.map(|strain| Tensor::<2>::new(strain, 0.0, 0.0, 0.3 * strain));
                let stress = along(&plate, &pulled).stress;
                assert!(
                    stress.iter().all(|s| s.is_finite()),
                    "{poisson} {size}: {stress}"
                );
            }
        }
    }

    #[test]
    fn a_plate_that_flows_in_tension_has_its_closed_form() {
        // plane stress, pulled along x with free sides: the sides' strain is that at which σ_yy = 0, by bisection
        let law = Reduced::<2>::new(plastic(), Kinematics::PlaneStress);
        let young = LAME.1 * (3.0 * LAME.0 + 2.0 * LAME.1) / (LAME.0 + LAME.1);
        let (mut low, mut high) = (-0.05, 0.0);
        let at = |side: f64| along(&law, &[Tensor::<2>::new(0.02, 0.0, 0.0, side)]).stress;
        for _ in 0..100 {
            let side = 0.5 * (low + high);
            if at(side)[(1, 1)] > 0.0 {
                high = side
            } else {
                low = side
            }
        }
        let tangent = young * 50.0 / (young + 50.0);
        let expected = 2.0 + tangent * (0.02 - 2.0 / young);
        // one step in a direction that the plastic flow keeps
        assert!((at(low)[(0, 0)] - expected).abs() < 1e-9 * expected);
    }
}
