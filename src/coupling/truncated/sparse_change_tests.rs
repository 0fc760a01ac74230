//! Smallest changes by hand, and with conditions that follow from each other.

use super::*;

fn conditions(rows: &[&[f64]]) -> Conditions {
    let mut c = Conditions::new(rows.len());
    for k in 0..rows[0].len() {
        for (r, row) in rows.iter().enumerate() {
            c.add(r, row[k]);
        }
        c.close();
    }
    c
}

#[test]
fn a_change_without_a_floor_makes_up_for_one_on_it() {
    // x - y - z/2 = 3, y at its floor of -1/2: x = a, z = -a/2 with 5/4 a = 5/2; z below the floor of the others
    let mut c = Conditions::new(1);
    for v in [1.0, -1.0] {
        c.add(0, v);
        c.close();
    }
    c.free_from_here();
    c.add(0, -0.5);
    c.close();
    let x = c.least_change(&[3.0], -0.5);
    for (x, wanted) in x.iter().zip([2.0, -0.5, -1.0]) {
        assert!((x - wanted).abs() < 1e-13, "{x}");
    }
}

#[test]
fn smallest_change_by_hand() {
    // x + y = 2 and nothing else: (1, 1)
    let x = conditions(&[&[1.0, 1.0]]).least_change(&[2.0], -0.9);
    assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-14), "{x:?}");
    // x - y = 3 with a floor of -1/2: (5/2, -1/2)
    let x = conditions(&[&[1.0, -1.0]]).least_change(&[3.0], -0.5);
    assert!(
        (x[0] - 2.5).abs() < 1e-13 && (x[1] + 0.5).abs() < 1e-13,
        "{x:?}"
    );
    // the same condition twice, at another scale, does no harm
    let x = conditions(&[&[1.0, 2.0], &[1e6, 2e6]]).least_change(&[5.0, 5e6], -0.9);
    assert!(
        (x[0] - 1.0).abs() < 1e-13 && (x[1] - 2.0).abs() < 1e-13,
        "{x:?}"
    );
}

#[test]
fn a_long_chain_is_met() {
    // x_k+1 − x_k = b_k has the smallest solution whose sum is zero; conjugate gradients alone would take as many iterations as there are conditions
    let n = 12_000;
    let mut c = Conditions::new(n);
    for k in 0..=n {
        if k > 0 {
            c.add(k - 1, 1.0);
        }
        if k < n {
            c.add(k, -1.0);
        }
        c.close();
    }
    let b: Vec<f64> = (0..n).map(|k| (k as f64 * 0.01).sin() + 1e-3).collect();
    let x = c.least_change(&b, -1e6);
    let mut wanted = vec![0.0; n + 1];
    for k in 0..n {
        wanted[k + 1] = wanted[k] + b[k];
    }
    let mean = wanted.iter().sum::<f64>() / (n + 1) as f64;
    let size = wanted.iter().map(|w| (w - mean).abs()).fold(0.0, f64::max);
    for (x, w) in x.iter().zip(&wanted) {
        assert!((x - (w - mean)).abs() < 1e-9 * size, "{x} {w}");
    }
}

/// `x_k − 2 x_k+1 + x_k+2 + beside y_k = b_k`, of a sine: where `beside` is small the normal equations are singular to 1e-10 and less. Also what the largest gap of changes is, over the largest `b_k`.
fn bent(n: usize, beside: f64) -> (Conditions, Vec<f64>, impl Fn(&[f64]) -> f64) {
    let mut c = Conditions::new(n);
    for k in 0..n + 2 {
        for (back, value) in [1.0, -2.0, 1.0].into_iter().enumerate() {
            if k >= back && k - back < n {
                c.add(k - back, value);
            }
        }
        c.close();
    }
    for k in 0..n {
        c.add(k, beside);
        c.close();
    }
    let at = |k: usize| (k as f64 * 0.01).sin();
    let b: Vec<f64> = (0..n)
        .map(|k| at(k) - 2.0 * at(k + 1) + at(k + 2))
        .collect();
    let largest = |v: &[f64]| v.iter().map(|v| v.abs()).fold(0.0, f64::max);
    let (met, wanted) = (c.clone(), b.clone());
    let gap = move |x: &[f64]| largest(&met.left(&wanted, x)) / largest(&wanted);
    (c, b, gap)
}

#[test]
fn nearly_dependent_conditions_are_met() {
    let n = 1200;
    let (c, b, gap) = bent(n, 0.0);
    let x = c.least_change(&b, f64::NEG_INFINITY);
    // 3e-7 without the corrections by the factors
    assert!(gap(&x) < 1e-10, "{}", gap(&x));
    // the smallest of all that meet them has no mean and no slope
    let mean = x.iter().sum::<f64>() / n as f64;
    let slope = x[..n + 2].iter().enumerate().map(|(k, x)| k as f64 * x);
    let slope = slope.sum::<f64>() / (n * n) as f64;
    assert!(mean.abs() < 1e-12 && slope.abs() < 1e-12, "{mean} {slope}");
}

#[test]
fn nearly_dependent_conditions_are_met_on_a_floor() {
    let (n, beside, floor) = (1200, 1e-3, -0.08);
    let (c, b, gap) = bent(n, beside);
    let x = c.least_change(&b, floor);
    // 4e-9 without the corrections by the factors
    assert!(gap(&x) < 1e-11, "{}", gap(&x));
    let (bent, aside) = x.split_at(n + 2);
    let is_held: Vec<bool> = aside.iter().map(|&y| y <= floor).collect();
    let held = is_held.iter().filter(|h| **h).count();
    assert!((100..1000).contains(&held), "{held}");
    assert!(x.iter().all(|&x| x >= floor));
    // off the floor y_k is beside times a multiplier, and x their second difference
    for k in 2..n {
        if !is_held[k - 2..=k].contains(&true) {
            let wanted = (aside[k] - 2.0 * aside[k - 1] + aside[k - 2]) / beside;
            assert!((bent[k] - wanted).abs() < 1e-9, "{} {wanted}", bent[k]);
        }
    }
}

#[test]
fn conditions_that_follow_from_others_are_met_on_a_floor() {
    // the sums of neighbouring conditions beside them
    let (n, floor) = (1200, -1e-4);
    let (alone, ..) = bent(n, 0.3);
    let mut c = Conditions::new(2 * n - 1);
    for k in 0..alone.changes() {
        for (r, v) in alone.column(k) {
            c.add(r, v);
            for sum in [r.wrapping_sub(1), r] {
                if sum < n - 1 {
                    c.add(n + sum, v);
                }
            }
        }
        c.close();
    }
    let mut b: Vec<f64> = (0..n)
        .map(|k| 1e-4 * ((k * k) as f64 * 0.7).sin())
        .collect();
    b.extend((0..n - 1).map(|k| b[k] + b[k + 1]).collect::<Vec<_>>());
    let x = c.least_change(&b, floor);
    let gap = norm(&c.left(&b, &x)) / norm(&b);
    // 1e-2 where the last iterate of conjugate gradients is taken, not the one with the least residual
    assert!(gap < 1e-10, "{gap}");
    let held = x.iter().filter(|&&x| x <= floor).count();
    assert!((100..1000).contains(&held) && x.iter().all(|&x| x >= floor));
}

#[test]
fn contradictions_leave_a_gap() {
    let rows: [&[f64]; 2] = [&[1.0, 1.0], &[1.0, 1.0]];
    let x = conditions(&rows).least_change(&[1.0, 2.0], -0.9);
    let sum = conditions(&rows).sum(&x);
    let gap = (sum[0] - 1.0).abs().max((sum[1] - 2.0).abs());
    assert!((0.5 - 1e-12..0.7).contains(&gap), "{sum:?}");
    // a thousand, each wanted to be two values that are 0.01 apart: half of that is left
    let n = 1000;
    let mut c = Conditions::new(2 * n);
    for k in 0..=n {
        for copy in [0, n] {
            if k > 0 {
                c.add(copy + k - 1, 1.0);
            }
            if k < n {
                c.add(copy + k, -1.0);
            }
        }
        c.close();
    }
    let b: Vec<f64> = (0..2 * n)
        .map(|k| ((k % n) as f64 * 0.01).sin() + if k < n { 0.0 } else { 0.01 })
        .collect();
    let left = c.left(&b, &c.least_change(&b, f64::NEG_INFINITY));
    let gap = left.iter().map(|l| l.abs()).fold(0.0, f64::max);
    assert!((0.005 - 1e-12..0.0055).contains(&gap), "{gap}");
    // a floor in the way
    let rows: [&[f64]; 1] = [&[1.0, 1.0]];
    let x = conditions(&rows).least_change(&[-3.0], -0.9);
    assert!((conditions(&rows).sum(&x)[0] + 1.8).abs() < 1e-12, "{x:?}");
}
