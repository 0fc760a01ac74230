use super::*;
use crate::system::{BlockCsr, LinearMotion, Symmetry};

/// A chain of `n` unit masses and unit springs, free at both ends.
fn chain(n: usize) -> LinearMotion {
    let mut k = BlockCsr {
        block: 1,
        row_offsets: vec![0],
        ..BlockCsr::default()
    };
    for i in 0..n {
        let near = [i.checked_sub(1), Some(i), (i + 1 < n).then_some(i + 1)];
        let count = near.iter().flatten().count() as f64;
        for &j in near.iter().flatten() {
            k.columns.push(j as u32);
            k.values.push(if j == i { count - 1.0 } else { -1.0 });
        }
        k.row_offsets.push(k.columns.len());
    }
    LinearMotion {
        stiffness: k,
        mass: vec![1.0; n],
        symmetry: Symmetry::Symmetric,
    }
}

/// The bottom held, the top moved sinusoidally, a load that pulses in the middle.
struct Shaken {
    dofs: [u32; 2],
    middle: usize,
}

impl Drive for Shaken {
    fn load_into(&self, time: f64, load: &mut [f64]) {
        load.fill(0.0);
        load[self.middle] = (0.7 * time).sin();
        load[self.dofs[1] as usize] = 0.3;
    }

    fn prescribed(&self) -> &[u32] {
        &self.dofs
    }

    fn displacement_into(&self, time: f64, values: &mut [f64]) {
        values.copy_from_slice(&[0.0, 0.1 * (0.3 * time).sin()]);
    }

    fn velocity_into(&self, time: f64, values: &mut [f64]) {
        values.copy_from_slice(&[0.0, 0.03 * (0.3 * time).cos()]);
    }
}

/// A force on one dof, without supports.
struct Load(usize, fn(f64) -> f64);

impl Drive for Load {
    fn load_into(&self, time: f64, load: &mut [f64]) {
        load.fill(0.0);
        load[self.0] = (self.1)(time);
    }

    fn prescribed(&self) -> &[u32] {
        &[]
    }

    fn displacement_into(&self, _time: f64, _values: &mut [f64]) {}

    fn velocity_into(&self, _time: f64, _values: &mut [f64]) {}
}

#[test]
fn a_mode_oscillates_at_the_frequency_of_the_scheme() {
    // free chain, mode cos(k π (i + ½)/n) with ω² = 4 sin²(kπ/2n); Verlet turns ω into (2/Δt) asin(ω Δt/2)
    let (n, mode, dt) = (24, 5.0, 0.4);
    let shape: Vec<f64> = (0..n)
        .map(|i| (mode * std::f64::consts::PI * (i as f64 + 0.5) / n as f64).cos())
        .collect();
    let omega = 2.0 * (mode * std::f64::consts::PI / (2.0 * n as f64)).sin();
    let discrete = 2.0 / dt * (0.5 * omega * dt).asin();
    let mut system = chain(n);
    let state = State::start(shape.clone(), vec![0.0; n]);
    let mut motion = Explicit::new(&mut system, &Undriven, ExplicitParams::with_step(dt), state)
        .expect("starts");
    let info = motion
        .run(500, &mut |_| ControlFlow::Continue(()))
        .expect("stable");
    assert_eq!((info.steps, info.end), (500, End::Finished));
    let expected = (discrete * 500.0 * dt).cos();
    for (u, s) in motion.state().u.iter().zip(&shape) {
        assert!((u - expected * s).abs() < 1e-11, "{u} {}", expected * s);
    }
}

#[test]
fn work_of_loads_and_supports_balances_the_discrete_energy() {
    let n = 30;
    let mut system = chain(n);
    let drive = Shaken {
        dofs: [0, n as u32 - 1],
        middle: n / 3,
    };
    let params = ExplicitParams::with_step(0.9);
    let mut motion = Explicit::new(&mut system, &drive, params, State::at_rest(n)).expect("starts");
    let mut offset = None;
    let mut worst: f64 = 0.0;
    motion
        .run(3000, &mut |m| {
            let e = m.energies();
            let difference = e.discrete - e.work_half;
            let first = *offset.get_or_insert(difference);
            worst = worst.max((difference - first).abs());
            let time = m.state().time;
            assert_eq!(m.state().u[n - 1], 0.1 * (0.3 * time).sin());
            ControlFlow::Continue(())
        })
        .expect("stable");
    assert!(motion.energies().kinetic > 0.1 && worst < 1e-11, "{worst}");
    // the support's force is spring plus inertia, less the load
    let (k, force) = motion.reactions().nth(1).expect("two supports");
    let (u, a) = (&motion.state().u, &motion.state().a);
    assert_eq!(k, n as u32 - 1);
    let expected = a[n - 1] + (u[n - 1] - u[n - 2]) - 0.3;
    assert!((force - expected).abs() < 1e-14, "{force} {expected}");
}

#[test]
fn a_resumed_run_and_any_number_of_threads_give_the_same_bits() {
    let n = 5000;
    let drive = Shaken {
        dofs: [0, n as u32 - 1],
        middle: n / 3,
    };
    let start = || {
        let v = (0..n).map(|i| (0.01 * i as f64).sin()).collect();
        State::start(vec![0.0; n], v)
    };
    let params = ExplicitParams::with_step(0.93);
    let go = |state: State, last: u64, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| {
            let mut system = chain(n);
            let mut motion = Explicit::new(&mut system, &drive, params, state).expect("starts");
            motion
                .run(last, &mut |_| ControlFlow::Continue(()))
                .expect("stable");
            (motion.energies(), motion.into_state())
        })
    };
    let whole = go(start(), 100, 1);
    let resumed = go(go(start(), 37, 2).1, 100, 2);
    assert_eq!(whole, resumed);
    assert_eq!(whole, go(start(), 100, 3));
}

#[test]
fn momentum_of_a_free_chain_stays_and_an_observer_stops_the_run() {
    let n = 100;
    let mut system = chain(n);
    let v: Vec<f64> = (0..n).map(|i| f64::from(i as u32 % 7) - 2.0).collect();
    let before: f64 = v.iter().sum();
    let state = State::start(vec![0.0; n], v);
    let params = ExplicitParams::with_step(0.95);
    let mut motion = Explicit::new(&mut system, &Undriven, params, state).expect("starts");
    let info = motion
        .run(10_000, &mut |m| {
            if m.state().step == 4321 {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        })
        .expect("stable");
    assert_eq!((info.steps, info.end), (4321, End::Stopped));
    let after = motion.momentum()[0];
    assert!((after - before).abs() < 1e-11, "{after} {before}");
}

#[test]
fn a_load_that_begins_at_zero_is_no_runaway() {
    let swelling = Load(0, |time| (0.01 * time).sin());
    let mut system = chain(5);
    let params = ExplicitParams::with_step(0.5);
    let mut motion = Explicit::new(&mut system, &swelling, params, State::at_rest(5)).unwrap();
    motion.run(2, &mut |_| ControlFlow::Continue(())).unwrap();
    // v(Δt) = ½ Δt sin(0.01 Δt), v(2 Δt) = Δt sin(0.01 Δt) + ½ Δt sin(0.02 Δt) but for the spring, which is Δt² smaller
    let wanted = 0.5 * 0.005f64.sin() + 0.25 * 0.01f64.sin();
    assert!((motion.state().v[0] / wanted - 1.0).abs() < 0.1);
}

#[test]
fn trouble_is_named() {
    let n = 12;
    let start = || {
        State::start(
            vec![0.0; n],
            (0..n).map(|i| 1e-3 * (i * i) as f64).collect(),
        )
    };
    let go = |dt: f64, state: State, drive: &dyn Drive| {
        let mut system = chain(n);
        let mut motion = Explicit::new(&mut system, drive, ExplicitParams::with_step(dt), state)?;
        motion.run(400, &mut |_| ControlFlow::Continue(()))
    };
    // the limit of the chain is 2/ω = 1/cos(π/2n) > 1
    assert!(go(1.0, start(), &Undriven).is_ok());
    let error = go(1.1, start(), &Undriven).expect_err("unstable");
    assert!(
        matches!(error, ExplicitError::Runaway { step: 2..=200, .. }),
        "{error}"
    );
    for dt in [0.0, f64::NAN, -1.0] {
        let error = go(dt, start(), &Undriven).expect_err("no step");
        assert!(matches!(error, ExplicitError::Step { .. }), "{error}");
    }
    let error = go(0.5, State::at_rest(n + 1), &Undriven).expect_err("another model");
    assert!(matches!(error, ExplicitError::Shape { .. }), "{error}");
    let late = Load(7, |time| if time > 9.9 { f64::NAN } else { 1.0 });
    let error = go(0.5, State::at_rest(n), &late).expect_err("not a number");
    assert!(
        matches!(
            error,
            ExplicitError::NotFinite {
                step: 20,
                site: 7,
                ..
            }
        ),
        "{error}"
    );
    let mut system = chain(n);
    system.mass[3] = 0.0;
    let params = ExplicitParams::with_step(0.5);
    let error = Explicit::new(&mut system, &Undriven, params, State::at_rest(n)).err();
    assert_eq!(error, Some(ExplicitError::Mass { site: 3, mass: 0.0 }));
}
