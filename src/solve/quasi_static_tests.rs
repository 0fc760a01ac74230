use super::*;
use crate::progress::Silent;
use crate::system::Symmetry;
use crate::{
    solve::statics::{self, StaticParams, StaticProblem},
    system::{BlockCsr, LinearMotion},
};
use systems::{Bundle, Hardening};

#[path = "quasi_static_test_systems.rs"]
mod systems;

/// A chain of springs of uneven stiffness; `skew` makes its rows differ from its columns.
fn chain(n: usize, skew: f64) -> LinearMotion {
    let spring = |i: usize| 1.0 + (i % 4) as f64;
    let mut k = BlockCsr {
        block: 1,
        row_offsets: vec![0],
        ..BlockCsr::default()
    };
    for i in 0..n {
        let left = if i > 0 {
            spring(i - 1) * (1.0 + skew)
        } else {
            0.0
        };
        let right = if i + 1 < n {
            spring(i) * (1.0 - skew)
        } else {
            0.0
        };
        if i > 0 {
            k.columns.push(i as u32 - 1);
            k.values.push(-left);
        }
        k.columns.push(i as u32);
        k.values.push(left + right);
        if i + 1 < n {
            k.columns.push(i as u32 + 1);
            k.values.push(-right);
        }
        k.row_offsets.push(k.columns.len());
    }
    LinearMotion {
        stiffness: k,
        mass: vec![1.0; n],
        symmetry: if skew == 0.0 {
            Symmetry::Symmetric
        } else {
            Symmetry::Unsymmetric
        },
    }
}

/// One end held, the other pulled, a load in the middle.
struct Pulled {
    ends: [u32; 2],
    middle: usize,
}

impl Drive for Pulled {
    fn load_into(&self, time: f64, load: &mut [f64]) {
        load.fill(0.0);
        load[self.middle] = 0.3 * time;
    }

    fn prescribed(&self) -> &[u32] {
        &self.ends
    }

    fn displacement_into(&self, time: f64, values: &mut [f64]) {
        values.copy_from_slice(&[0.0, time]);
    }

    fn velocity_into(&self, _time: f64, values: &mut [f64]) {
        values.fill(0.0);
    }
}

/// Load steps at these times.
fn of(times: &[f64]) -> impl Fn(u64) -> Option<f64> {
    |step| times.get(step as usize).copied()
}

fn go(
    system: &mut dyn SemiDiscrete,
    drive: &dyn Drive,
    equilibrium: Equilibrium,
    times: &[f64],
    observe: &mut dyn FnMut(&LoadStep<'_>),
) -> Result<QuasiStaticInfo, QuasiStaticError> {
    let params = QuasiStaticParams {
        equilibrium,
        tolerance: 1e-11,
        ..QuasiStaticParams::default()
    };
    let mut state = LoadState::at_rest(system.mass().len() * system.block());
    run(
        system,
        drive,
        params,
        Aids::default(),
        Pacing::Listed(&of(times)),
        &mut state,
        &mut |s| {
            observe(s);
            ControlFlow::Continue(())
        },
    )
}

#[test]
fn without_breaking_it_is_the_static_solve() {
    let n = 40;
    let drive = Pulled {
        ends: [0, n as u32 - 1],
        middle: 13,
    };
    for (skew, equilibrium) in [
        (0.0, Equilibrium::Newton),
        (0.1, Equilibrium::Newton),
        (0.0, Equilibrium::Relaxation),
        (0.1, Equilibrium::Relaxation),
    ] {
        let mut system = chain(n, skew);
        let mut load = vec![0.0; n];
        drive.load_into(2.0, &mut load);
        let mut prescribed = vec![None; n];
        (prescribed[0], prescribed[n - 1]) = (Some(0.0), Some(2.0));
        let positions: Vec<[f64; 3]> = (0..n).map(|i| [i as f64, 0.0, 0.0]).collect();
        let exact = statics::solve(
            &StaticProblem {
                stiffness: &system.stiffness,
                symmetry: system.symmetry,
                positions: &positions,
                load: &load,
                prescribed: &prescribed,
            },
            &StaticParams::default(),
            &Silent,
        )
        .expect("solved");
        let mut worst = f64::NAN;
        let info = go(&mut system, &drive, equilibrium, &[1.0, 2.0], &mut |s| {
            worst = s
                .state
                .u
                .iter()
                .zip(&exact.displacement)
                .fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
            let pull = s.force[n - 1];
            if s.state.step == 2 {
                assert!((pull - exact.reactions[n - 1]).abs() < 1e-8, "{pull}");
            }
        })
        .expect("equilibrium");
        assert!(
            info.steps == 2 && info.broken == 0 && worst < 1e-8,
            "{skew} {equilibrium:?}: {worst} {info:?}"
        );
    }
}

/// Pulls site 2 by a displacement, or site 1 by a force.
enum Grip {
    Displacement,
    Force,
}

impl Drive for Grip {
    fn load_into(&self, time: f64, load: &mut [f64]) {
        load.fill(0.0);
        if matches!(self, Self::Force) {
            load[1] = time;
        }
    }

    fn prescribed(&self) -> &[u32] {
        match self {
            Self::Displacement => &[0, 2],
            Self::Force => &[0],
        }
    }

    fn displacement_into(&self, time: f64, values: &mut [f64]) {
        values.fill(0.0);
        if matches!(self, Self::Displacement) {
            values[1] = time;
        }
    }

    fn velocity_into(&self, _time: f64, values: &mut [f64]) {
        values.fill(0.0);
    }
}

#[test]
fn a_bundle_of_fibres_follows_its_curve() {
    // elongation x of n fibres with limits i/n: the force is n (1 − x) x up to the fibres' steps, largest n/4 at x = 1/2 (Daniels)
    for equilibrium in [Equilibrium::Newton, Equilibrium::Relaxation] {
        let count = 50;
        let mut bundle = Bundle::new(count, 1e4);
        let times: Vec<f64> = (1..=90).map(|k| (k as f64 + 0.5) / 100.0).collect();
        let mut largest: f64 = 0.0;
        go(
            &mut bundle,
            &Grip::Displacement,
            equilibrium,
            &times,
            &mut |s| {
                let x = s.state.u[1];
                let alive = (0..count)
                    .filter(|i| (*i as f64 + 1.0) / count as f64 >= x)
                    .count();
                assert_eq!(s.state.broken as usize, count - alive, "x = {x}");
                assert!(
                    (s.force[2] - alive as f64 * x).abs() < 1e-6,
                    "{} {x}",
                    s.force[2]
                );
                largest = largest.max(s.force[2]);
            },
        )
        .expect("equilibrium");
        assert!(
            (largest / (count as f64 / 4.0) - 1.0).abs() < 0.05,
            "{largest}"
        );
    }
}

#[test]
fn a_bundle_under_dead_load_breaks_at_its_strength() {
    // the largest force of i/n times the n − i + 1 fibres that are left as fibre i is about to break
    let count = 20;
    let strength = (1..=count)
        .map(|i| (i * (count - i + 1)) as f64 / count as f64)
        .fold(0.0, f64::max);
    for (load, holds) in [(0.999 * strength, true), (1.001 * strength, false)] {
        let mut bundle = Bundle::new(count, 1.0);
        let times: Vec<f64> = (1..=50).map(|k| load * f64::from(k) / 50.0).collect();
        let mut broken = 0;
        let end = go(
            &mut bundle,
            &Grip::Force,
            Equilibrium::Newton,
            &times,
            &mut |s| {
                broken = s.state.broken;
            },
        );
        assert_eq!(end.is_ok(), holds, "{end:?}");
        if holds {
            assert!(broken < count as u64);
        } else {
            // nothing is left to bear the load
            assert!(
                matches!(
                    end,
                    Err(QuasiStaticError::Linear { .. } | QuasiStaticError::NoEquilibrium { .. })
                ),
                "{end:?}"
            );
            assert_eq!(bundle.alive(), 0.0);
        }
    }
}

#[test]
fn runs_resume() {
    let times: Vec<f64> = (1..=60).map(|k| f64::from(k) / 80.0).collect();
    let whole = {
        let (mut bundle, mut state) = (Bundle::new(30, 10.0), LoadState::at_rest(3));
        let params = QuasiStaticParams::default();
        run(
            &mut bundle,
            &Grip::Displacement,
            params,
            Aids::default(),
            Pacing::Listed(&of(&times)),
            &mut state,
            &mut |_| ControlFlow::Continue(()),
        )
        .expect("equilibrium");
        (state, bundle.intact)
    };
    let (mut bundle, mut state) = (Bundle::new(30, 10.0), LoadState::at_rest(3));
    for stop in [23, 60] {
        let params = QuasiStaticParams::default();
        run(
            &mut bundle,
            &Grip::Displacement,
            params,
            Aids::default(),
            Pacing::Listed(&of(&times)),
            &mut state,
            &mut |s| {
                if s.state.step == stop {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            },
        )
        .expect("equilibrium");
    }
    assert_eq!(whole, (state, bundle.intact));
}

/// Adaptive load steps of a bundle to a displacement, up to a number of them; appends times and fibres broken.
fn adaptive(bundle: &mut Bundle, state: &mut LoadState, last: u64, seen: &mut Vec<(f64, u64)>) {
    let pacing = Pacing::Adaptive(Adaptive {
        end: 1.3,
        accuracy: ACCURACY,
    });
    let params = QuasiStaticParams::default();
    let mut observe = |s: &LoadStep<'_>| {
        seen.push((s.time, s.state.broken));
        match s.state.step == last {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    };
    let grip = Grip::Displacement;
    run(
        bundle,
        &grip,
        params,
        Aids::default(),
        pacing,
        state,
        &mut observe,
    )
    .expect("equilibrium");
}

/// Part of a load to which adaptive steps find it.
const ACCURACY: f64 = 0.01;

#[test]
fn adaptive_steps_find_the_load_of_each_fibre() {
    let (mut bundle, mut state) = (Bundle::new(30, 10.0), LoadState::at_rest(3));
    let mut seen = Vec::new();
    adaptive(&mut bundle, &mut state, u64::MAX, &mut seen);
    assert_eq!(seen.last().map(|s| s.0), Some(1.3));
    // fibre k breaks at its elongation k/30, with those after it: t = e (1 + alive/10)
    let exact = (1..=30).map(|k| f64::from(k) / 30.0 * (1.0 + f64::from(31 - k) / 10.0));
    let exact: Vec<f64> = exact.take_while(|t| *t < 1.3).collect();
    assert!(exact.windows(2).all(|t| t[0] < t[1]) && exact.len() > 10);
    for (k, t) in exact.iter().enumerate() {
        let step = seen.iter().position(|s| s.1 > k as u64).unwrap();
        let (before, after) = (seen[step - 1].0, seen[step].0);
        assert!(before < *t && *t <= after, "{before} {t} {after}");
        let least = ACCURACY * before.max(0.13) * (1.0 + 1e-6);
        assert!(after - before <= least, "{before} {t} {after}");
    }
    // steps of equal length would be 1000
    println!("{} steps for {} fibres", seen.len(), exact.len());
    assert!(seen.len() < 250);
}

#[test]
fn adaptive_steps_resume() {
    let new = || (Bundle::new(30, 10.0), LoadState::at_rest(3), Vec::new());
    let (mut whole, mut state, mut seen) = new();
    adaptive(&mut whole, &mut state, u64::MAX, &mut seen);
    let (mut parts, mut resumed, mut again) = new();
    for stop in [17, u64::MAX] {
        adaptive(&mut parts, &mut resumed, stop, &mut again);
    }
    assert_eq!((seen, state, whole.intact), (again, resumed, parts.intact));
}

#[test]
fn trouble_is_named() {
    let mut bundle = Bundle::new(4, 1.0);
    let mut short = LoadState::at_rest(2);
    let params = QuasiStaticParams {
        max_rounds: 1,
        ..QuasiStaticParams::default()
    };
    let mut none = |_: &LoadStep<'_>| ControlFlow::Continue(());
    let error = run(
        &mut bundle,
        &Grip::Displacement,
        params,
        Aids::default(),
        Pacing::Listed(&of(&[1.0])),
        &mut short,
        &mut none,
    );
    assert!(
        matches!(error, Err(QuasiStaticError::Shape { .. })),
        "{error:?}"
    );
    let mut state = LoadState::at_rest(3);
    let error = run(
        &mut bundle,
        &Grip::Displacement,
        params,
        Aids::default(),
        Pacing::Listed(&of(&[3.0])),
        &mut state,
        &mut none,
    );
    assert!(
        matches!(error, Err(QuasiStaticError::NeverHolds { step: 0, .. })),
        "{error:?}"
    );
    let few = QuasiStaticParams {
        equilibrium: Equilibrium::Relaxation,
        max_iterations: 3,
        ..params
    };
    let mut system = chain(40, 0.0);
    let drive = Pulled {
        ends: [0, 39],
        middle: 13,
    };
    let mut state = LoadState::at_rest(40);
    let error = run(
        &mut system,
        &drive,
        few,
        Aids::default(),
        Pacing::Listed(&of(&[1.0])),
        &mut state,
        &mut none,
    );
    assert!(
        matches!(
            error,
            Err(QuasiStaticError::NoEquilibrium { iterations: 3, .. })
        ),
        "{error:?}"
    );
    let error = run(
        &mut system,
        &drive,
        few,
        Aids::default(),
        Pacing::Listed(&of(&[f64::NAN])),
        &mut LoadState::at_rest(40),
        &mut none,
    );
    assert!(
        matches!(error, Err(QuasiStaticError::NotFinite { .. })),
        "{error:?}"
    );
}

#[test]
fn springs_a_thousand_times_stiffer_than_at_rest_bear_one_force() {
    // pulled in one step until b e² is some 1000 k: each spring bears the force of the support, and their elongations, from that force by Cardano's formula, add up
    let n = 30;
    let k: Vec<f64> = (0..n).map(|i| 1.0 + (i % 4) as f64).collect();
    let mut system = Hardening {
        k: k.clone(),
        b: 100.0,
        mass: vec![1.0; n + 1],
    };
    let drive = Pulled {
        ends: [0, n as u32],
        middle: n,
    };
    let reach = 4.0 * n as f64;
    let mut found = (0.0, Vec::new());
    let info = go(
        &mut system,
        &drive,
        Equilibrium::Newton,
        &[reach],
        &mut |s| found = (s.force[n], s.state.u.clone()),
    )
    .expect("equilibrium");
    let (force, u) = found;
    let elongation = |k: f64| {
        let (half, third) = (force / 200.0, k / 300.0);
        let root = (half * half + third.powi(3)).sqrt();
        (half + root).cbrt() + (half - root).cbrt()
    };
    let total: f64 = k.iter().map(|&k| elongation(k)).sum();
    assert!((total - reach).abs() < 1e-8 * reach, "{total} {reach}");
    for (i, &k) in k.iter().enumerate() {
        let e = u[i + 1] - u[i];
        assert!((e - elongation(k)).abs() < 1e-8, "{i}: {e}");
    }
    // products of conjugate gradients: the tangent at rest alone would need thousands
    assert!(info.iterations < 400, "{info:?}");
}
