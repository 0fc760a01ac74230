use std::ops::ControlFlow;

use super::*;
use crate::{
    solve::explicit::{Explicit, ExplicitParams, State, Undriven},
    system::LinearMotion,
};

/// A bar of unit density and stiffness, free at both ends, whose cells in the middle are a quarter as long.
fn bar() -> LinearMotion {
    let length = |cell: usize| if (60..76).contains(&cell) { 0.25 } else { 1.0 };
    let cells = 140;
    let (mut row_offsets, mut columns, mut values, mut mass) = (vec![0], vec![], vec![], vec![]);
    for i in 0..=cells {
        let left = (i > 0).then(|| length(i - 1));
        let right = (i < cells).then(|| length(i));
        let stiffness = |l: Option<f64>| l.map_or(0.0, |l: f64| 1.0 / l);
        if i > 0 {
            columns.push(i as u32 - 1);
            values.push(-stiffness(left));
        }
        columns.push(i as u32);
        values.push(stiffness(left) + stiffness(right));
        if i < cells {
            columns.push(i as u32 + 1);
            values.push(-stiffness(right));
        }
        row_offsets.push(columns.len());
        mass.push(0.5 * (left.unwrap_or(0.0) + right.unwrap_or(0.0)));
    }
    LinearMotion {
        stiffness: BlockCsr {
            block: 1,
            row_offsets,
            columns,
            values,
            shared: None,
        },
        mass,
        symmetry: Symmetry::Symmetric,
    }
}

fn cycled(sub_steps: u32, fraction: f64) -> (SubCycled<'static>, StepLimit) {
    let system = bar();
    let fine = FineSites::find(&system, &[], sub_steps).expect("fine cells");
    SubCycled::with_stable_step(Box::new(system), fine, &[], fraction).expect("eigenvalues")
}

/// A pulse on its way to the fine cells.
fn pulse(system: &dyn SemiDiscrete) -> State {
    let n = system.mass().len();
    let shape = |i: usize| (-((i as f64 - 30.0) / 8.0).powi(2)).exp();
    let slope = |i: usize| 2.0 * (i as f64 - 30.0) / 64.0 * shape(i);
    State::start((0..n).map(shape).collect(), (0..n).map(slope).collect())
}

fn after(system: &mut dyn SemiDiscrete, step: f64, steps: u64) -> State {
    let start = pulse(system);
    let params = ExplicitParams::with_step(step);
    let mut motion = Explicit::new(system, &Undriven, params, start).expect("starts");
    motion
        .run(steps, &mut |_| ControlFlow::Continue(()))
        .expect("runs");
    motion.into_state()
}

#[test]
fn the_step_is_that_of_the_coarse_cells_and_the_energy_is_kept() {
    // 2/omega of the fine cells is 1/4, of the coarse ones 1
    let plain = stable_step::stable_step(&bar(), &[]).expect("rows").stable;
    assert!((plain - 0.25).abs() < 0.01, "{plain}");
    for (sub_steps, gain) in [(2, 1.7), (3, 2.5), (4, 3.3)] {
        let (mut system, limit) = cycled(sub_steps, 0.95);
        assert!(limit.stable > gain * plain, "{sub_steps}: {limit:?}");
        // 16 small cells, and no more than their neighbours
        assert!((15..=17).contains(&system.fine_sites()));
        // the bound by row sums holds for the sub-cycled matrix itself
        let n = system.mass().len();
        let mut exact = vec![0.0; n];
        let mut column = vec![0.0; n];
        for k in 0..n {
            let unit: Vec<f64> = (0..n).map(|i| f64::from(u8::from(i == k))).collect();
            system.tangent_into(&unit, &mut column);
            exact
                .iter_mut()
                .zip(&column)
                .for_each(|(s, c)| *s += c.abs());
        }
        for (bound, exact) in system.row_sums().iter().zip(&exact) {
            assert!(*bound >= exact * (1.0 - 1e-12), "{bound} {exact}");
        }
        let start = pulse(&system);
        let params = ExplicitParams::with_step(0.95 * limit.stable);
        let mut motion = Explicit::new(&mut system, &Undriven, params, start).expect("starts");
        let (mut first, mut momentum) = (None, None);
        let (mut change, mut drift) = (0.0_f64, 0.0_f64);
        motion
            .run(20_000, &mut |m| {
                let energy = m.energies().discrete;
                change = change.max((energy / *first.get_or_insert(energy) - 1.0).abs());
                let now = m.momentum()[0];
                drift = drift.max((now - *momentum.get_or_insert(now)).abs());
                ControlFlow::Continue(())
            })
            .expect("runs");
        assert!(change < 1e-11, "{sub_steps}: {change:e}");
        assert!(drift < 1e-12, "{sub_steps}: {drift:e}");
    }
}

#[test]
fn motion_differs_from_that_without_by_the_square_of_the_step() {
    // through the fine cells and beyond
    let time = 48.0;
    let exact = after(&mut bar(), time / 24_000.0, 24_000);
    let error = |state: &State| {
        let differences = state.u.iter().zip(&exact.u).map(|(a, b)| (a - b).powi(2));
        differences.sum::<f64>().sqrt()
    };
    let (mut system, limit) = cycled(4, 1.0);
    let coarse = (time / (0.9 * limit.stable)).ceil() as u64;
    let errors: Vec<f64> = [coarse, 2 * coarse, 4 * coarse]
        .into_iter()
        .map(|steps| {
            let step = time / steps as f64;
            system.set_step(step);
            error(&after(&mut system, step, steps))
        })
        .collect();
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 2.0).abs() < 0.2, "{errors:?}");
    }
    // no larger than twice what the same step makes of equal cells, whose dispersion has the other sign
    assert!(errors[0] < 0.2, "{errors:?}");
}

#[test]
fn what_cannot_be_sub_cycled_is_refused() {
    let unsymmetric = LinearMotion {
        symmetry: Symmetry::Unsymmetric,
        ..bar()
    };
    assert_eq!(
        FineSites::find(&unsymmetric, &[], 2).err(),
        Some(SubCyclingError::Unsymmetric)
    );
    assert!(matches!(
        FineSites::find(&bar(), &[], 1),
        Err(SubCyclingError::SubSteps { .. })
    ));
    // equal cells: the small step is everywhere
    let mut even = bar();
    even.stiffness
        .values
        .iter_mut()
        .for_each(|k| *k = k.signum());
    even.mass.fill(1.0);
    for i in 0..=140 {
        let diagonal = even.stiffness.row_offsets[i] + usize::from(i > 0);
        even.stiffness.values[diagonal] = if i == 0 || i == 140 { 1.0 } else { 2.0 };
    }
    assert!(matches!(
        FineSites::find(&even, &[], 4),
        Err(SubCyclingError::NoGain { .. })
    ));
}

#[test]
fn prescribed_dofs_are_held() {
    let system = bar();
    let held = [66u32, 67];
    let fine = FineSites::find(&system, &held, 3).expect("fine cells");
    let (system, _) =
        SubCycled::with_stable_step(Box::new(system), fine, &held, 0.95).expect("eigenvalues");
    // sub-steps move no held dof: the force elsewhere is that of a system without it
    let n = system.mass().len();
    let mut u = vec![0.0; n];
    u[66] = 1.0;
    let (mut force, mut plain) = (vec![0.0; n], vec![0.0; n]);
    system.tangent_into(&u, &mut force);
    bar().tangent_into(&u, &mut plain);
    // far from 65 and 68, which the held dofs pull at
    for i in (0..n).filter(|i| !(62..=71).contains(i)) {
        assert_eq!(force[i], plain[i], "{i}");
    }
}
