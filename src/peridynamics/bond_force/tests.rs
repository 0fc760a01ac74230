//! Passes against a plain double loop with textbook formulas, and what holds for any force that derives from an energy.

use super::{reference_force::*, *};
use crate::tensor::{Tensor, Vector};

const LAWS: [Law; 2] = [Law::Pmb, Law::Solid];
const BOTH: [BondKinematics; 2] = [BondKinematics::Exact, BondKinematics::Linear];

/// Layouts that a case has a pass for.
fn layouts(jitter: f64) -> &'static [Layout] {
    if jitter == 0.0 {
        &[Layout::List, Layout::Lattice]
    } else {
        &[Layout::List]
    }
}

fn against_naive<const D: usize>(counts: [usize; D], jitter: f64, ghosts: bool) {
    let case = case(counts, jitter, ghosts);
    let n = case.position.len() * D;
    for law in LAWS {
        for kinematics in BOTH {
            for (amplitude, &layout) in [1e-5, 0.2]
                .into_iter()
                .flat_map(|a| layouts(jitter).iter().map(move |l| (a, l)))
            {
                let u = noise(n, amplitude * H, 3);
                let (expected, energy) = naive(&case, law, kinematics, &u, &|_, _| true);
                with(&case, law, kinematics, None, layout, |mut pass| {
                    let mut force = vec![f64::NAN; n];
                    assert_eq!(
                        pass.force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update),
                        BondChanges::default()
                    );
                    // the textbook's difference of lengths loses what the amplitude has less than the length
                    let error = difference(&force, &expected) / largest(&expected);
                    let tolerance = if amplitude < 1e-3 && kinematics == BondKinematics::Exact {
                        1e-9
                    } else {
                        1e-13
                    };
                    assert!(
                        error < tolerance,
                        "{D}D {law:?} {kinematics:?} {amplitude} {}: {error:e}",
                        pass.name()
                    );
                    let error = (pass.stored_energy(&u) - energy).abs() / energy;
                    assert!(
                        error < tolerance,
                        "{D}D {law:?} {kinematics:?} {amplitude} {} energy: {error:e}",
                        pass.name()
                    );
                });
            }
        }
    }
}

#[test]
fn forces_and_energies_are_those_of_a_double_loop() {
    for ghosts in [false, true] {
        for jitter in [0.0, 0.2] {
            against_naive([40], jitter, ghosts);
            against_naive([19, 11], jitter, ghosts);
            against_naive([14, 7, 8], jitter, ghosts);
        }
    }
}

fn derivatives<const D: usize>(counts: [usize; D], jitter: f64) {
    let case = case(counts, jitter, false);
    let n = case.position.len() * D;
    for law in LAWS {
        for &layout in layouts(jitter) {
            with(
                &case,
                law,
                BondKinematics::Exact,
                None,
                layout,
                |mut pass| {
                    let name = format!("{D}D {law:?} {}", pass.name());
                    let direction = noise(n, H, 5);
                    let (mut plus, mut minus, mut tangent) =
                        (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
                    let scaled = |s: f64| -> Vec<f64> { direction.iter().map(|x| s * x).collect() };
                    pass.force_into(
                        &scaled(1e-5),
                        &mut plus,
                        Interval::AT_ONCE,
                        FailureUpdate::Frozen,
                    );
                    pass.force_into(
                        &scaled(-1e-5),
                        &mut minus,
                        Interval::AT_ONCE,
                        FailureUpdate::Frozen,
                    );
                    pass.tangent_into(&direction, &mut tangent);
                    let numeric: Vec<f64> = plus
                        .iter()
                        .zip(&minus)
                        .map(|(p, m)| (p - m) / 2e-5)
                        .collect();
                    let error = difference(&numeric, &tangent) / largest(&tangent);
                    assert!(error < 1e-8, "{name}: tangent {error:e}");

                    // force = dE/du about a strained state
                    let u = noise(n, 0.1 * H, 8);
                    let at = |s: f64| -> Vec<f64> {
                        u.iter().zip(&direction).map(|(u, d)| u + s * d).collect()
                    };
                    let slope =
                        (pass.stored_energy(&at(1e-5)) - pass.stored_energy(&at(-1e-5))) / 2e-5;
                    pass.force_into(&u, &mut plus, Interval::AT_ONCE, FailureUpdate::Frozen);
                    let work: f64 = plus.iter().zip(&direction).map(|(f, d)| f * d).sum();
                    assert!(
                        (slope - work).abs()
                            < 1e-7 * largest(&plus) * largest(&direction) * n as f64,
                        "{name}: {slope} {work}"
                    );

                    balances(&case, &u, &plus, BondKinematics::Exact, &name);
                    row_sums_bound_rows(pass.as_ref(), n, &name);
                },
            );
        }
    }
}

#[test]
fn tangents_forces_and_energies_belong_together() {
    for jitter in [0.0, 0.2] {
        derivatives([40], jitter);
        derivatives([12, 11], jitter);
        derivatives([7, 6, 8], jitter);
    }
}

#[test]
fn a_large_rotation_turns_the_forces() {
    let case = case([7, 6, 8], 0.0, false);
    let n = case.position.len() * 3;
    let rotation = {
        let (s, c) = 2.1f64.sin_cos();
        Tensor::<3>::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
            * Tensor::<3>::new(1.0, 0.0, 0.0, 0.0, 0.6, -0.8, 0.0, 0.8, 0.6)
    };
    let u = noise(n, 0.1 * H, 4);
    let mut turned = vec![0.0; n];
    for (i, x) in case.position.iter().enumerate() {
        let y = rotation * (x + Vector::<3>::from_column_slice(&u[3 * i..3 * i + 3])) - x;
        turned[3 * i..3 * i + 3].copy_from_slice(y.as_slice());
    }
    for law in LAWS {
        for &layout in layouts(0.0) {
            with(
                &case,
                law,
                BondKinematics::Exact,
                None,
                layout,
                |mut pass| {
                    let (mut force, mut other) = (vec![0.0; n], vec![0.0; n]);
                    pass.force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Frozen);
                    pass.force_into(
                        &turned,
                        &mut other,
                        Interval::AT_ONCE,
                        FailureUpdate::Frozen,
                    );
                    let expected: Vec<f64> = force
                        .chunks(3)
                        .flat_map(|f| {
                            let f = rotation * Vector::<3>::from_column_slice(f);
                            [f.x, f.y, f.z]
                        })
                        .collect();
                    let error = difference(&other, &expected) / largest(&expected);
                    assert!(error < 1e-13, "{law:?} {}: {error:e}", pass.name());
                },
            );
        }
    }
}

/// Test for an intact bond, by the numbers of its points.
type Standing<'a> = &'a dyn Fn(usize, usize) -> bool;

/// Checks that the broken bonds took the energy stored before less that stored after, at any displacement.
fn check_lost_energy<const D: usize>(
    case: &Case<D>,
    law: Law,
    pass: &dyn BondPass<D>,
    states: [&[f64]; 2],
    stands: Standing<'_>,
    name: &str,
) {
    let energy = naive(case, law, BondKinematics::Exact, states[0], stands).1;
    for u in states {
        let of = |stands: Standing<'_>| naive(case, law, BondKinematics::Exact, u, stands).1;
        let taken = of(&|_, _| true) - of(stands);
        let found = pass.lost_energy(&|i| std::array::from_fn(|a| u[i * D + a]));
        assert!((found - taken).abs() < 1e-11 * energy, "{name}");
    }
}

/// A pass bonds the points whose bonds stand, and counts the others.
fn check_bonds<const D: usize>(
    case: &Case<D>,
    pass: &dyn BondPass<D>,
    stands: Standing<'_>,
    name: &str,
) -> u64 {
    let points = case.position.len();
    let count = (0..points)
        .flat_map(|i| case.families.of(i).iter().map(move |&j| (i, j as usize)))
        .filter(|&(i, j)| !stands(i, j))
        .count() as u64;
    for i in (0..points).step_by(5) {
        for j in 0..points {
            let bond = case.families.of(i).binary_search(&(j as u32)).is_ok();
            assert_eq!(pass.bonded(i, j), bond && stands(i, j), "{name} {i} {j}");
        }
    }
    count
}

/// Damage is the volume of the bonds that have broken over that of all.
fn check_damage<const D: usize>(
    case: &Case<D>,
    pass: &dyn BondPass<D>,
    stands: Standing<'_>,
    name: &str,
) {
    let points = case.position.len();
    let mut damage = vec![0.0; points];
    pass.damage_into(&mut damage);
    for i in 0..points {
        let volume = |all: bool| {
            case.families
                .of(i)
                .iter()
                .filter(|&&j| all || stands(i, j as usize))
                .map(|&j| case.volume[j as usize])
                .sum::<f64>()
        };
        assert!(
            (damage[i] - (1.0 - volume(false) / volume(true))).abs() < 1e-14,
            "{name}"
        );
        assert_eq!(pass.is_damaged(i), damage[i] > 0.0, "{name}");
    }
}

/// Breaks bonds in one state, then more in another, and puts the damage back.
fn break_twice<const D: usize>(
    case: &Case<D>,
    law: Law,
    pass: &mut dyn BondPass<D>,
    breaks: &dyn Fn(&[f64], usize, usize) -> bool,
    [first, second]: [&[f64]; 2],
) {
    let n = case.position.len() * D;
    let name = format!("{D}D {law:?} {}", pass.name());
    let mut force = vec![0.0; n];
    let fresh = pass.damage_state();
    assert_eq!(
        pass.force_into(first, &mut force, Interval::AT_ONCE, FailureUpdate::Frozen),
        BondChanges::default()
    );
    let whole = force.clone();
    let update = FailureUpdate::Update;
    let mut lost = (pass.force_into(first, &mut force, Interval::AT_ONCE, update)).broken;
    let (expected, energy) = naive(case, law, BondKinematics::Exact, first, &|i, j| {
        !breaks(first, i, j)
    });
    assert!(
        difference(&force, &expected) < 1e-13 * largest(&expected),
        "{name}"
    );
    assert!(
        (pass.stored_energy(first) - energy).abs() < 1e-13 * energy,
        "{name}"
    );
    assert!(lost > 0 && lost < pass.bonds() && lost % 2 == 0);
    // what broke took what was stored before less what is stored after, wherever points are
    let last = pass.last_broken();
    assert_eq!(last.len() as u64, lost, "{name}");
    assert!(
        last.iter()
            .all(|&(i, j)| breaks(first, i as usize, j as usize))
    );
    check_lost_energy(
        case,
        law,
        pass,
        [first, second],
        &|i, j| !breaks(first, i, j),
        &name,
    );
    // once broken, a bond stays so
    let state = pass.damage_state();
    lost += (pass.force_into(second, &mut force, Interval::AT_ONCE, update)).broken;
    let stands = |i: usize, j: usize| !breaks(first, i, j) && !breaks(second, i, j);
    let (expected, _) = naive(case, law, BondKinematics::Exact, second, &stands);
    assert!(
        difference(&force, &expected) < 1e-13 * largest(&expected),
        "{name}"
    );
    let count = check_bonds(case, pass, &stands, &name);
    assert_eq!((lost, pass.broken()), (count, count), "{name}");
    check_damage(case, pass, &stands, &name);
    // and comes back only with a saved state
    assert!(pass.restore_damage(&state) && !pass.restore_damage(&state[1..]));
    assert_eq!(pass.damage_state(), state);
    assert!(pass.restore_damage(&fresh) && pass.broken() == 0);
    pass.force_into(first, &mut force, Interval::AT_ONCE, FailureUpdate::Frozen);
    assert_eq!(force, whole);
}

fn breaking<const D: usize>(counts: [usize; D], jitter: f64) {
    let case = case(counts, jitter, false);
    let n = case.position.len() * D;
    let critical = 0.1;
    let no_fail: Vec<bool> = case
        .position
        .iter()
        .map(|x| x[0] < 0.37 + 1.5 * H)
        .collect();
    let stretch = |u: &[f64], i: usize, j: usize| {
        let at = |i: usize| Vector::<D>::from_fn(|a, _| u[i * D + a]);
        let xi = case.position[j] - case.position[i];
        (xi + at(j) - at(i)).norm() / xi.norm() - 1.0
    };
    let (first, second) = (noise(n, 0.1 * H, 21), noise(n, 0.1 * H, 22));
    let breaks =
        |u: &[f64], i: usize, j: usize| !no_fail[i] && !no_fail[j] && stretch(u, i, j) > critical;
    for law in LAWS {
        for &layout in layouts(jitter) {
            let failure = Failure {
                critical: BondCriterion::Uniform(critical),
                no_fail: &no_fail,
                softening: None,
            };
            with(
                &case,
                law,
                BondKinematics::Exact,
                Some(failure),
                layout,
                |mut pass| {
                    break_twice(&case, law, pass.as_mut(), &breaks, [&first, &second]);
                },
            );
        }
    }
}

#[test]
fn bonds_break_from_both_ends_and_for_good() {
    for jitter in [0.0, 0.2] {
        breaking([40], jitter);
        breaking([19, 11], jitter);
        breaking([9, 7, 8], jitter);
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let case = case([23, 14, 12], 0.0, true);
    let n = case.position.len() * 3;
    let u = noise(n, 0.05 * H, 31);
    let failure = Failure {
        critical: BondCriterion::Uniform(0.08),
        no_fail: &[],
        softening: None,
    };
    for law in LAWS {
        for &layout in layouts(0.0) {
            let run = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .build()
                    .unwrap();
                pool.install(|| {
                    with(
                        &case,
                        law,
                        BondKinematics::Exact,
                        Some(failure),
                        layout,
                        |mut pass| {
                            let (mut force, mut y) = (vec![0.0; n], vec![0.0; n]);
                            let broken = pass.force_into(
                                &u,
                                &mut force,
                                Interval::AT_ONCE,
                                FailureUpdate::Update,
                            );
                            pass.tangent_into(&u, &mut y);
                            let energy = pass.stored_energy(&u);
                            (
                                broken,
                                force,
                                y,
                                energy.to_bits(),
                                pass.damage_state(),
                                pass.row_sums(),
                            )
                        },
                    )
                })
            };
            let one = run(1);
            assert!(one.0.broken > 0);
            assert!(one == run(2) && one == run(5), "{law:?} {layout:?}");
        }
    }
}

#[test]
fn precracks_count_as_damage_and_single_weights_err_by_little() {
    let case = case([19, 11], 0.2, false);
    let n = case.position.len() * 2;
    let u = noise(n, 0.1 * H, 2);
    let cut = |i: usize, j: usize| (case.position[i].x < 1.0) != (case.position[j].x < 1.0);
    let setup = BondSetup {
        position: &case.position,
        volume: &case.volume,
        families: &case.families,
        rows: &[],
        without_energy: &[],
        force: BondForce::Solid {
            omega: &omega,
            bulk: BULK,
            shear: SHEAR,
        },
        kinematics: BondKinematics::Exact,
        failure: None,
        precracked: Some(&cut),
        layout: Layout::List,
        storage: Storage::Double,
        shared: None,
    };
    let (mut force, mut single) = (vec![0.0; n], vec![0.0; n]);
    let mut pass = bond_pass(&setup).unwrap();
    pass.force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Frozen);
    let (expected, _) = naive(&case, Law::Solid, BondKinematics::Exact, &u, &|i, j| {
        !cut(i, j)
    });
    assert!(difference(&force, &expected) < 1e-13 * largest(&expected));
    assert!(pass.broken() > 0);

    let mut pass = bond_pass(&BondSetup {
        storage: Storage::Single,
        ..setup
    })
    .unwrap();
    pass.force_into(&u, &mut single, Interval::AT_ONCE, FailureUpdate::Frozen);
    let error = difference(&force, &single) / largest(&force);
    assert!(error > 1e-10 && error < 1e-7, "{error:e}");
}

#[test]
fn what_cannot_be_is_refused() {
    let mut case = case([12, 9], 0.0, false);
    let setup = |case: &Case<2>, f: &BondFunction<'_, 2>| {
        bond_pass(&BondSetup {
            position: &case.position,
            volume: &case.volume,
            families: &case.families,
            rows: &[],
            without_energy: &[],
            force: BondForce::Pairwise { coefficient: f },
            kinematics: BondKinematics::Exact,
            failure: None,
            precracked: None,
            layout: Layout::Automatic,
            storage: Storage::Double,
            shared: None,
        })
        .err()
        .map(|e| e.to_string())
        .unwrap_or_default()
    };
    assert_eq!(setup(&case, &coefficient), "");
    let lopsided = setup(&case, &|i, _, _| 1.0 + i as f64);
    assert!(
        lopsided.contains("bond of points 0 and 1 has weight"),
        "{lopsided}"
    );
    let leaning = setup(&case, &|_, _, xi| 1.0 + 0.1 * xi.x.signum());
    assert!(leaning.contains("has weight"), "{leaning}");
    // by more than the 1e-12 that ends may differ, by less than a lattice would notice
    let hardly = setup(&case, &|i, _, _| 1.0 + 1e-11 * (i % 2) as f64);
    assert!(hardly.contains("has weight"), "{hardly}");
    case.families.retain(|i, j| i != 5 || j != 6);
    assert!(setup(&case, &coefficient).contains("point 6 has a bond to point 5"));
    case.volume.pop();
    assert!(setup(&case, &coefficient).contains("volume has"));
}
