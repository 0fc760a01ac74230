use super::*;
use crate::solve::stable_step::{stable_step, tests::springs};

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
            let step = stable_step(&system, &[]).expect("masses").stable;
            let found = growth(&system, &[], step, 20_000).expect("eigenvalues");
            let [re, im]: [f64; 2] = expected;
            let root = nalgebra::Complex::new(-re, -im).sqrt().re.abs();
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
        let stable = springs(n);
        let step = stable_step(&stable, &[]).expect("masses").stable;
        let found = growth(&stable, &[], step, 20_000).expect("eigenvalues");
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
