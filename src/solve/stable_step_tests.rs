use super::*;
use crate::system::{BlockCsr, LinearMotion};

/// A full matrix as a system with one dof per site.
fn system(n: usize, symmetry: Symmetry, entry: impl Fn(usize, usize) -> f64) -> LinearMotion {
    let values: Vec<f64> = (0..n * n).map(|k| entry(k / n, k % n)).collect();
    LinearMotion {
        stiffness: BlockCsr {
            block: 1,
            row_offsets: (0..=n).map(|i| i * n).collect(),
            columns: (0..n * n).map(|k| (k % n) as u32).collect(),
            values,
            shared: None,
        },
        mass: (0..n).map(|i| 1.0 + (i % 5) as f64).collect(),
        symmetry,
    }
}

/// Springs of uneven stiffness between all pairs of near points.
pub(in crate::solve) fn springs(n: usize) -> LinearMotion {
    let spring = |i: usize, j: usize| match i.abs_diff(j) {
        d @ 1..=3 => 1.0 + ((i * j) % 7) as f64 / d as f64,
        _ => 0.0,
    };
    system(n, Symmetry::Symmetric, |i, j| {
        if i == j {
            (0..n).map(|k| spring(i, k)).sum()
        } else {
            -spring(i, j)
        }
    })
}

/// Largest eigenvalue by nalgebra, on the free dofs.
fn largest(system: &LinearMotion, free: &[usize]) -> f64 {
    let k = &system.stiffness;
    let matrix = nalgebra::DMatrix::from_fn(free.len(), free.len(), |i, j| {
        let m = (system.mass[free[i]] * system.mass[free[j]]).sqrt();
        k.row(free[i]).1[free[j]] / m
    });
    matrix.symmetric_eigenvalues().max()
}

#[test]
fn the_step_is_below_the_limit_and_near_it() {
    for n in [1, 2, 7, 60, 300] {
        let system = springs(n);
        let prescribed: Vec<u32> = if n > 10 { vec![0, 5] } else { vec![] };
        let free: Vec<usize> = (0..n)
            .filter(|k| !prescribed.contains(&(*k as u32)))
            .collect();
        let limit = 2.0 / largest(&system, &free).max(0.0).sqrt();
        let found = stable_step(&system, &prescribed).expect("positive masses");
        if n == 1 {
            assert!(found.stable == f64::INFINITY);
            continue;
        }
        assert!(found.certified <= limit * (1.0 + 1e-12));
        assert!(
            found.stable <= limit && found.stable >= 0.979 * limit,
            "{n}: {found:?} {limit}"
        );
        assert!(found.estimate >= limit * (1.0 - 1e-12) && found.estimate <= 1.001 * limit);
        let refused = found.admit(Some(1.02 * limit), &system, &prescribed);
        assert!(
            matches!(&refused, Err(StepError::TooLarge { requested, .. }) if *requested == 1.02 * limit)
        );
        assert_eq!(found.admit(None, &system, &prescribed), Ok(found.stable));
        assert_eq!(
            found.admit(Some(0.5 * limit), &system, &prescribed),
            Ok(0.5 * limit)
        );
        for bad in [0.0, -1.0, f64::NAN] {
            assert!(matches!(
                found.admit(Some(bad), &system, &prescribed),
                Err(StepError::NoStep { .. })
            ));
        }
    }
}

#[test]
fn lanczos_without_its_basis_finds_the_same_pair() {
    let mut system = springs(200);
    // one stiff pair, where the highest mode is
    for (i, j, k) in [
        (77, 78, -40.0),
        (78, 77, -40.0),
        (77, 77, 60.0),
        (78, 78, 60.0),
    ] {
        system.stiffness.values[i * 200 + j] = k;
    }
    let mut operator = Scaled::new(&system, &[]).expect("masses");
    let (theta, mode) = lanczos(&mut operator, 60, Want::Mode, &|_, _| false).expect("converges");
    let exact = largest(&system, &(0..200).collect::<Vec<_>>());
    assert!((theta / exact - 1.0).abs() < 1e-10, "{theta} {exact}");
    let site = operator.site_of(&mode);
    assert!(site == 77 || site == 78, "{site}");
}

#[test]
fn rows_without_mass_or_number_are_named() {
    let mut system = springs(20);
    system.mass[4] = 0.0;
    let found = stable_step(&system, &[]);
    assert!(
        matches!(found, Err(StepError::Row { site: 4, .. })),
        "{found:?}"
    );
    let mut system = springs(20);
    system.stiffness.values[20 * 6 + 6] = f64::INFINITY;
    let found = stable_step(&system, &[]);
    assert!(
        matches!(found, Err(StepError::Row { site: 6, .. })),
        "{found:?}"
    );
}

#[test]
fn a_step_stays_with_fewer_products_only_where_it_is_stable() {
    let system = springs(300);
    let free: Vec<usize> = (0..300).collect();
    let limit = 2.0 / largest(&system, &free).sqrt();
    let all = stable_step(&system, &[]).expect("positive masses");
    let held = |part: f64| Held {
        step: part * limit,
        fraction: 0.95,
    };
    let mut before = 0;
    for part in [0.5, 0.8, 0.9, 0.929] {
        let (found, stays) = stable_step_beyond(&system, &[], held(part)).expect("masses");
        assert!(stays && found.products < all.products, "{part}: {found:?}");
        // a wider margin for fewer products: the bound lies between the step and the limit
        assert!(found.products >= before && found.stable <= limit);
        assert!(
            found.stable >= part * limit * (1.0 - 1e-8),
            "{part}: {found:?}"
        );
        before = found.products;
    }
    // within the limit, but beyond the fraction of the stable step
    let (found, stays) = stable_step_beyond(&system, &[], held(0.94)).expect("masses");
    assert!(!stays && found == all);
    let whole = Held {
        step: 1.001 * limit,
        fraction: 1.0,
    };
    assert!(!stable_step_beyond(&system, &[], whole).expect("masses").1);
}
