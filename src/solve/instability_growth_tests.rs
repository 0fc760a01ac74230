use super::*;
use crate::solve::stable_step::{stable_step, tests::springs};
use crate::system::{
    BlockCsr, BodyHistory, BodyState, BondChanges, Dissipation, ElementTangent, FailureUpdate,
    Halfway, Interval, RateBounds, SharedSteps, Tangent,
};

/// Stores no zeros, of which most of a row of springs consists.
fn leave_out_zeros(system: &mut crate::system::LinearMotion) {
    let dense = std::mem::take(&mut system.stiffness);
    let kept = &mut system.stiffness;
    kept.block = dense.block;
    kept.row_offsets.push(0);
    for row in 0..dense.rows() {
        let (columns, values) = dense.row(row);
        for (&column, &value) in columns.iter().zip(values) {
            if value != 0.0 || column as usize == row {
                kept.columns.push(column);
                kept.values.push(value);
            }
        }
        kept.row_offsets.push(kept.columns.len());
    }
}

#[test]
fn growth_is_that_of_the_eigenvalues() {
    // two uncoupled chains, then a pair [[2, w], [−w, 2]] with eigenvalues 2 ± i w, or one site of negative stiffness
    for n in [40, 620] {
        for (case, expected) in [("complex", [2.0, 0.04]), ("negative", [-0.003, 0.0])] {
            let mut system = springs(n);
            let (i, j) = (n / 2, n / 2 + 1);
            for k in 0..n {
                for (a, b) in [(i, k), (j, k), (k, i), (k, j)] {
                    system.stiffness.values[a * n + b] = 0.0;
                }
            }
            (system.mass[i], system.mass[j]) = (1.0, 1.0);
            let mut set = |a: usize, b: usize, v: f64| system.stiffness.values[a * n + b] = v;
            if case == "complex" {
                set(i, i, 2.0);
                set(j, j, 2.0);
                set(i, j, 0.04);
                set(j, i, -0.04);
            } else {
                set(i, i, -0.003);
                set(j, j, 1.0);
            }
            for k in 0..n {
                // rows stay balanced, or rigid motion would not be free and diagonals too large only
                let row: f64 = (0..n)
                    .filter(|&c| c != k)
                    .map(|c| system.stiffness.values[k * n + c])
                    .sum();
                if k != i && k != j {
                    system.stiffness.values[k * n + k] = -row;
                }
            }
            system.symmetry = Symmetry::Unsymmetric;
            leave_out_zeros(&mut system);
            let step = stable_step(&system, &[]).expect("masses").stable;
            let found = growth(&system, &[], step, 20_000, None).expect("eigenvalues");
            let [re, im]: [f64; 2] = expected;
            let root = by_recurrence(re, im, step);
            assert!(
                (found.rate / root - 1.0).abs() < 1e-3 && (found.site == i || found.site == j),
                "{n} {case}: {found:?} {root}"
            );
            assert!((found.eigenvalue[1].abs() - im).abs() < 1e-4);
            let refused = found.admit(1000.0, "use coupling.splice");
            assert!(
                matches!(&refused, Err(StepError::Unstable { remedy, .. }) if remedy.contains("splice"))
            );
            assert_eq!(found.admit(1e-3, ""), Ok(()));
        }
        let mut stable = springs(n);
        leave_out_zeros(&mut stable);
        let step = stable_step(&stable, &[]).expect("masses").stable;
        let found = growth(&stable, &[], step, 20_000, None).expect("eigenvalues");
        assert!(found.rate == 0.0 && found.resolution < 0.02, "{found:?}");
    }
}

#[test]
fn growth_rates_keep_their_digits() {
    assert_eq!(growth_rate(4.0, 0.0), 0.0);
    assert!((growth_rate(-9.0, 0.0) - 3.0).abs() < 1e-15);
    // √(−1 − i w) ≈ ±(w/2 − i)
    assert!((growth_rate(1.0, 1e-9) / 5e-10 - 1.0).abs() < 1e-12);
}

/// The rate of `z² − (2 − Δt² λ) z + 1 = 0`, the recurrence of a mode under velocity Verlet.
fn by_recurrence(re: f64, im: f64, step: f64) -> f64 {
    let half =
        nalgebra::Complex::new(1.0, 0.0) - nalgebra::Complex::new(re, im) * (0.5 * step * step);
    let root = (half * half - 1.0).sqrt();
    (half + root).norm().max((half - root).norm()).ln() / step
}

#[test]
fn stepped_rates_are_those_of_the_recurrence_and_without_steps_those_of_the_motion() {
    for (re, im) in [
        (3.0, 0.2),
        (3.9, -0.01),
        (5.0, 0.0),
        (5.0, 0.3),
        (-2.0, 0.0),
        (-0.5, 1.0),
    ] {
        for step in [0.1, 0.5, 1.0] {
            let (found, expected) = (
                stepped_growth_rate(re, im, step),
                by_recurrence(re, im, step),
            );
            assert!(
                (found - expected).abs() < 1e-9 * (1.0 + expected),
                "{re} {im} {step}: {found} {expected}"
            );
        }
        let (found, expected) = (stepped_growth_rate(re, im, 1e-7), growth_rate(re, im));
        assert!(
            (found - expected).abs() < 1e-6 * (1.0 + expected),
            "{found} {expected}"
        );
    }
    assert_eq!(stepped_growth_rate(4.0, 0.0, 1.0), 0.0);
    // 1/√(1 − f²) times as fast at the fraction f of the limit
    let f = 0.95_f64;
    let ratio = stepped_growth_rate(4.0 * f * f, 1e-6, 1.0) / growth_rate(4.0 * f * f, 1e-6);
    assert!((ratio * (1.0 - f * f).sqrt() - 1.0).abs() < 1e-6, "{ratio}");
}

#[test]
fn growth_that_noise_cannot_show_is_found_near_the_seam() {
    // three chains; in the middle one two sites feed each other weakly: over 2000 steps of noise nothing is seen of it
    let n = 700;
    let mut system = springs(n);
    let (i, j) = (n / 2, n / 2 + 1);
    for k in 0..n {
        for (a, b) in [(i, k), (j, k), (k, i), (k, j)] {
            system.stiffness.values[a * n + b] = 0.0;
        }
    }
    for k in (0..n).filter(|&k| k != i && k != j) {
        let others = (0..n).filter(|&c| c != k);
        let row: f64 = others.map(|c| system.stiffness.values[k * n + c]).sum();
        system.stiffness.values[k * n + k] = -row;
    }
    (system.mass[i], system.mass[j]) = (1.0, 1.0);
    for (a, b, v) in [(i, i, 2.0), (j, j, 2.0), (i, j, 2e-3), (j, i, -2e-3)] {
        system.stiffness.values[a * n + b] = v;
    }
    system.symmetry = Symmetry::Unsymmetric;
    leave_out_zeros(&mut system);
    let step = stable_step(&system, &[]).expect("masses").stable;
    let seen = growth_from_noise(&mut Scaled::new(&system, &[]).expect("masses"), step, 2000);
    assert_eq!(seen.expect("products").0.rate, 0.0);
    let seam = Fed {
        system,
        sites: vec![i as u32, j as u32],
    };
    let found = growth(&seam, &[], step, 20_000, None).expect("eigenvalues");
    let expected = by_recurrence(2.0, 2e-3, step);
    assert!(
        (found.rate / expected - 1.0).abs() < 0.05,
        "{found:?} {expected}"
    );
    assert_eq!(found.evidence, Evidence::Noise { neighbourhoods: 1 });
    assert!(found.site == i || found.site == j);
}

/// A system that knows where its rows differ from its columns.
struct Fed {
    system: crate::system::LinearMotion,
    sites: Vec<u32>,
}

impl SemiDiscrete for Fed {
    fn block(&self) -> usize {
        1
    }

    fn mass(&self) -> &[f64] {
        self.system.mass()
    }

    fn internal_force_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        interval: Interval,
        b: FailureUpdate,
    ) -> BondChanges {
        self.system.internal_force_into(u, force, interval, b)
    }

    fn force_beside_elements_into(&mut self, u: &[f64], force: &mut [f64], interval: Interval) {
        self.internal_force_into(u, force, interval, FailureUpdate::Frozen);
    }

    fn take_heat_work(&mut self) -> f64 {
        0.0
    }

    fn force_of_heating_into(
        &mut self,
        _u: &[f64],
        _force: &mut [f64],
        _from: Option<f64>,
        _to: f64,
    ) -> bool {
        false
    }

    fn stored_energy(&self, u: &[f64]) -> f64 {
        self.system.stored_energy(u)
    }

    fn round_off(&self, _u: &[f64]) -> f64 {
        0.0
    }

    fn rate_bounds(&self) -> RateBounds {
        RateBounds::default()
    }

    fn shared_steps(&mut self) -> Option<&mut dyn SharedSteps> {
        None
    }

    fn sites_reached(&self, _own: &[bool]) -> Option<Vec<bool>> {
        None
    }
}

impl Tangent for Fed {
    fn tangent_into(&self, x: &[f64], y: &mut [f64]) {
        self.system.tangent_into(x, y);
    }

    fn difference_length(&self) -> Option<f64> {
        None
    }

    fn row_sums(&self) -> Vec<f64> {
        self.system.row_sums()
    }

    fn tangent_is_constant(&self) -> Vec<bool> {
        vec![false; self.mass().len()]
    }

    fn tangent_rows(&self, sites: &[u32]) -> BlockCsr {
        self.system.tangent_rows(sites)
    }

    fn seam_sites(&self) -> Vec<u32> {
        self.sites.clone()
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Unsymmetric
    }

    fn element_tangent(&self, _u: &[f64], _interval: Interval) -> Option<ElementTangent> {
        None
    }
}

impl BodyHistory for Fed {
    fn commit(&mut self) {}

    fn dissipation(&self) -> Option<Dissipation> {
        None
    }

    fn set_dissipation(&mut self, _dissipation: Dissipation) {}

    fn account_for_breaks(&mut self, _at: &Halfway<'_>) {}

    fn damage_state(&self) -> Vec<u64> {
        Vec::new()
    }

    fn restore_damage(&mut self, state: &[u64]) -> bool {
        state.is_empty()
    }

    fn body_state(&self) -> Option<&dyn BodyState> {
        None
    }
}
