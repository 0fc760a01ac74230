//! Tests of properties that hold for every law: none is named here, except where an accelerator is compared.

use std::sync::Arc;

use super::{reference_force::*, *};
use crate::{
    assembly::Transfer,
    peridynamics::{Cloud, Ends, Factors, Horizon, Law, PdBody, laws},
    tensor::{Tensor, Vector},
};

const INTERVAL: f64 = 0.3;

/// A pass of a law over a case; with `accelerated`, the fast one that it names.
pub(super) fn with_law<const D: usize, T>(
    case: &Case<D>,
    law: &Arc<dyn Law<D>>,
    kinematics: BondKinematics,
    failure: Option<Failure<'_, D>>,
    accelerated: bool,
    run: impl FnOnce(Box<dyn BondPass<D>>) -> T,
) -> T {
    let points = case.position.len();
    let cloud = Cloud {
        position: case.position.clone(),
        volume: case.volume.clone(),
        horizon: Horizon::Uniform(3.0 * H),
        transfer: Transfer::default(),
        // every third point is of the second material
        material: match law.several() {
            Some(_) => (0..points).map(|i| u16::from(i % 3 == 0)).collect(),
            None => Vec::new(),
        },
        ..Cloud::default()
    };
    let families = case.families.clone();
    let linear = law.linearised();
    let body = PdBody::new(cloud, families, linear, &Factors::Plain, Ends::Differ).unwrap();
    let pair = |i: usize, k: usize, _: &Vector<D>| body.kernel(i).0[k];
    let omega = |i: usize, k: usize, _: &Vector<D>| body.kernel(i).1[k];
    let force = match law.accelerator().filter(|_| accelerated) {
        None => BondForce::Law { law, body: &body },
        Some(crate::peridynamics::Accelerator::Pairwise) => {
            BondForce::Pairwise { coefficient: &pair }
        }
        Some(crate::peridynamics::Accelerator::Solid { bulk, shear }) => BondForce::Solid {
            omega: &omega,
            bulk,
            shear,
        },
    };
    let setup = BondSetup {
        position: &case.position,
        volume: &case.volume,
        families: &case.families,
        rows: &case.rows,
        without_energy: &[],
        force,
        kinematics,
        failure,
        precracked: None,
        layout: Layout::List,
        storage: Storage::Double,
        shared: None,
    };
    run(bond_pass(&setup).unwrap())
}

/// Laws with a nonlinear response.
fn laws_with_states<const D: usize>() -> Vec<Arc<dyn Law<D>>> {
    let all = laws::every().into_iter();
    all.filter(|law| law.force_state().is_some()).collect()
}

fn ways<const D: usize>(law: &Arc<dyn Law<D>>) -> &'static [BondKinematics] {
    match law.force_state().is_some_and(|f| f.is_objective()) {
        true => &[BondKinematics::Exact, BondKinematics::Linear],
        false => &[BondKinematics::Linear],
    }
}

const LATER: Interval = Interval {
    end: INTERVAL,
    length: INTERVAL,
};

fn against_accelerators<const D: usize>(counts: [usize; D], ghosts: bool) {
    let case = case(counts, 0.2, ghosts);
    let points = case.position.len();
    let n = points * D;
    let u = noise(n, 0.1 * H, 3);
    let no_fail: Vec<bool> = case
        .position
        .iter()
        .map(|x| x[0] < 0.37 + 1.5 * H)
        .collect();
    for law in laws_with_states()
        .iter()
        .filter(|law| law.accelerator().is_some())
    {
        for &kinematics in ways(law) {
            let run = |accelerated: bool| {
                let failure = Failure {
                    critical: BondCriterion::Uniform(0.1),
                    no_fail: &no_fail,
                    softening: None,
                };
                with_law(
                    &case,
                    law,
                    kinematics,
                    Some(failure),
                    accelerated,
                    |mut pass| {
                        let mut force = vec![f64::NAN; n];
                        pass.force_into(&u, &mut force, LATER, FailureUpdate::Frozen);
                        let mut all = force.clone();
                        let changes = pass.force_into(&u, &mut force, LATER, FailureUpdate::Update);
                        let lost = changes.broken;
                        all.extend(&force);
                        let x = noise(n, H, 6);
                        pass.tangent_into(&x, &mut force);
                        all.extend(&force);
                        all.extend(pass.row_sums());
                        let mut damage = vec![0.0; points];
                        pass.damage_into(&mut damage);
                        let at = |i: usize| std::array::from_fn(|a| u[i * D + a]);
                        let energies = [pass.stored_energy(&u), pass.lost_energy(&at)];
                        (
                            all,
                            damage,
                            energies,
                            (lost, pass.broken(), pass.last_broken()),
                        )
                    },
                )
            };
            let (found, fast) = (run(false), run(true));
            let name = format!("{D}D {} {kinematics:?}", law.name());
            let error = difference(&found.0, &fast.0) / largest(&fast.0);
            assert!(error < 1e-13, "{name}: {error:e}");
            assert!(difference(&found.1, &fast.1) < 1e-14, "{name}");
            for (a, b) in found.2.iter().zip(&fast.2) {
                assert!((a - b).abs() < 1e-11 * fast.2[0].abs(), "{name}: {a} {b}");
            }
            assert!(found.3.0 > 0, "{name}");
            assert_eq!(found.3, fast.3, "{name}");
        }
    }
}

#[test]
fn accelerators_compute_what_the_laws_say() {
    for ghosts in [false, true] {
        against_accelerators([40], ghosts);
        against_accelerators([19, 11], ghosts);
        against_accelerators([14, 7, 8], ghosts);
    }
}

fn consistent<const D: usize>(counts: [usize; D]) {
    let case = case(counts, 0.2, false);
    let n = case.position.len() * D;
    let direction = noise(n, H, 5);
    let scaled = |s: f64| -> Vec<f64> { direction.iter().map(|x| s * x).collect() };
    for law in laws_with_states() {
        for &kinematics in ways(&law) {
            with_law(&case, &law, kinematics, None, false, |mut pass| {
                let name = format!("{D}D {} {kinematics:?}", law.name());
                let (mut plus, mut minus, mut tangent) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
                let now = Interval::AT_ONCE;
                pass.force_into(&scaled(1e-5), &mut plus, now, FailureUpdate::Frozen);
                pass.force_into(&scaled(-1e-5), &mut minus, now, FailureUpdate::Frozen);
                pass.tangent_into(&direction, &mut tangent);
                let slope: Vec<f64> = plus
                    .iter()
                    .zip(&minus)
                    .map(|(p, m)| (p - m) / 2e-5)
                    .collect();
                let error = difference(&slope, &tangent) / largest(&tangent);
                assert!(error < 1e-8, "{name}: tangent at rest {error:e}");

                // a strained state that is remembered
                let u = noise(n, 0.1 * H, 8);
                pass.force_into(&u, &mut plus, LATER, FailureUpdate::Frozen);
                pass.commit();
                let at = |s: f64| -> Vec<f64> {
                    u.iter().zip(&direction).map(|(u, d)| u + s * d).collect()
                };
                // what is stored, and what is dissipated on the way there
                let state = pass.damage_state();
                let along = |force: &[f64]| -> f64 {
                    force.iter().zip(&direction).map(|(f, d)| f * d).sum()
                };
                let mut spent = |s: f64| {
                    pass.force_into(&at(s), &mut minus, now, FailureUpdate::Frozen);
                    let dissipated = pass.commit();
                    let sum = pass.stored_energy(&at(s)) + dissipated;
                    assert!(pass.restore_damage(&state), "{name}");
                    (sum, along(&minus))
                };
                let (forward, backward) = (spent(1e-5), spent(-1e-5));
                let slope = (forward.0 - backward.0) / 2e-5;
                pass.force_into(&u, &mut plus, now, FailureUpdate::Frozen);
                // the slope of the force may be another one on either side: the trapezoidal rule on each
                let work = 0.5 * along(&plus) + 0.25 * (forward.1 + backward.1);
                assert!(
                    (slope - work).abs() < 1e-7 * largest(&plus) * largest(&direction) * n as f64,
                    "{name}: force is no derivative of the energy, {slope} {work}"
                );
                balances(&case, &u, &plus, kinematics, &name);
                row_sums_bound_rows(pass.as_ref(), n, &name);
            });
        }
    }
}

#[test]
fn tangents_forces_and_energies_of_every_law_belong_together() {
    consistent([40]);
    consistent([9, 8]);
    consistent([6, 5, 6]);
}

/// Size of the strain of points whose stress is compared with the derivative of their energy: below what any law flows, softens or is damaged at.
const STRAIN: f64 = 1e-3;

fn stress_of_energy<const D: usize>(counts: [usize; D]) {
    let case = case(counts, 0.2, false);
    let middle = case.position.len() / 2;
    let gradient =
        Tensor::<D>::from_fn(|i, j| [0.8, -0.3, 0.5, 0.2, -0.6, 0.9, 0.4][(2 * i + 3 * j) % 7]);
    let turned = |angle: f64| {
        let (s, c) = angle.sin_cos();
        Tensor::<D>::from_fn(|i, j| match (i, j) {
            (0, 0) | (1, 1) if D > 1 => c,
            (0, 1) => -s,
            (1, 0) => s,
            _ => f64::from(u8::from(i == j)),
        })
    };
    for law in laws_with_states() {
        for &kinematics in ways(&law) {
            let angles: &[f64] = match kinematics {
                BondKinematics::Exact => &[0.0, 20.0, 75.0],
                BondKinematics::Linear => &[0.0],
            };
            for angle in angles {
                let name = format!("{D}D {} {kinematics:?} {angle}°", law.name());
                let deformed =
                    turned(angle.to_radians()) * (Tensor::identity() + gradient * STRAIN);
                with_law(&case, &law, kinematics, None, false, |pass| {
                    let states = pass.force_states().unwrap();
                    let field = |f: &Tensor<D>| -> Vec<f64> {
                        let moved = case.position.iter().map(|x| f * x - x);
                        moved.flat_map(|u| (0..D).map(move |a| u[a])).collect()
                    };
                    let energy = |f: &Tensor<D>| states.energy_density(middle, &field(f));
                    let step = 0.1 * STRAIN;
                    let derivative = Tensor::<D>::from_fn(|i, j| {
                        let at = |times: f64| {
                            let mut f = deformed;
                            f[(i, j)] += times * step;
                            energy(&f)
                        };
                        (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * step)
                    });
                    let local = law.force_state().and_then(|s| s.correspondence(Some(0)));
                    let turns = local.is_some_and(|stress| stress.law.is_objective());
                    let wanted = match kinematics {
                        BondKinematics::Linear if !turns => derivative,
                        BondKinematics::Exact | BondKinematics::Linear => {
                            derivative * deformed.transpose()
                                / crate::tensor::determinant(&deformed)
                        }
                    };
                    let u = field(&deformed);
                    let at = |k: usize| Vector::from_fn(|a, _| u[k * D + a]);
                    let found = states.stress(middle, &at).tensor;
                    let error = (found - wanted).amax() / wanted.amax();
                    assert!(error < 1e-8, "{name}: {error:e}\n{found}{wanted}");
                });
            }
        }
    }
}

#[test]
fn stresses_are_derivatives_of_energies() {
    // the section of a bar contracts, of which the energy per length says nothing
    stress_of_energy([9, 8]);
    stress_of_energy([6, 5, 6]);
}

fn consistent_when_broken<const D: usize>(counts: [usize; D]) {
    let case = case(counts, 0.2, false);
    let n = case.position.len() * D;
    let (u, direction) = (noise(n, 0.1 * H, 8), noise(n, H, 5));
    let now = Interval::AT_ONCE;
    for law in laws_with_states() {
        if !law.has_breakable_bonds() {
            continue;
        }
        for &kinematics in ways(&law) {
            let failure = Failure {
                critical: BondCriterion::Uniform(0.05),
                no_fail: &[],
                softening: None,
            };
            with_law(&case, &law, kinematics, Some(failure), false, |mut pass| {
                let name = format!("{D}D {} {kinematics:?}", law.name());
                let mut force = vec![0.0; n];
                pass.force_into(&u, &mut force, LATER, FailureUpdate::Update);
                pass.commit();
                let share = pass.broken() as f64 / pass.bonds() as f64;
                assert!((0.1..0.6).contains(&share), "{name}: {share}");
                let state = pass.damage_state();
                let mut other = vec![0.0; n];
                let mut spent = |s: f64| {
                    let at: Vec<f64> = u.iter().zip(&direction).map(|(u, d)| u + s * d).collect();
                    pass.force_into(&at, &mut other, now, FailureUpdate::Frozen);
                    let dissipated = pass.commit();
                    let sum = pass.stored_energy(&at) + dissipated;
                    assert!(pass.restore_damage(&state), "{name}");
                    sum
                };
                let slope = (spent(1e-5) - spent(-1e-5)) / 2e-5;
                pass.force_into(&u, &mut force, now, FailureUpdate::Frozen);
                let work: f64 = force.iter().zip(&direction).map(|(f, d)| f * d).sum();
                let scale = largest(&force) * largest(&direction) * n as f64;
                assert!(
                    (slope - work).abs() < 1e-7 * scale,
                    "{name}: {slope} {work}"
                );
                balances(&case, &u, &force, kinematics, &name);
            });
        }
    }
}

#[test]
fn forces_of_bodies_with_broken_bonds_are_derivatives_of_their_energy() {
    consistent_when_broken([60]);
    consistent_when_broken([9, 8]);
    consistent_when_broken([6, 5, 6]);
}

/// Energy stored, dissipated and supplied by a load that comes, goes and turns round, in so many steps.
fn cycle<const D: usize>(case: &Case<D>, law: &Arc<dyn Law<D>>, steps: usize) -> [f64; 3] {
    let n = case.position.len() * D;
    let shape = noise(n, 0.02 * H, 8);
    with_law(
        case,
        law,
        BondKinematics::Linear,
        None,
        false,
        |mut pass| {
            let mut force = vec![0.0; n];
            let (mut before, mut last) = (vec![0.0; n], vec![0.0; n]);
            let (mut work, mut dissipated) = (0.0, 0.0);
            for k in 1..=steps {
                let time = 1.5 * k as f64 / steps as f64;
                let size = (std::f64::consts::PI * time).sin();
                let u: Vec<f64> = shape.iter().map(|x| x * size).collect();
                let interval = Interval {
                    end: time,
                    length: 1.5 / steps as f64,
                };
                // a trial leaves no trace
                let trial: Vec<f64> = u.iter().map(|u| 3.0 * u).collect();
                pass.force_into(&trial, &mut force, interval, FailureUpdate::Frozen);
                pass.force_into(&u, &mut force, interval, FailureUpdate::Frozen);
                dissipated += pass.commit();
                for k in 0..n {
                    work += 0.5 * (force[k] + last[k]) * (u[k] - before[k]);
                }
                last.copy_from_slice(&force);
                before = u;
            }
            [pass.stored_energy(&before), dissipated, work]
        },
    )
}

#[test]
fn work_is_stored_or_dissipated() {
    let case = case([9, 8], 0.2, false);
    for law in laws_with_states() {
        let off = |steps: usize| {
            let [stored, dissipated, work] = cycle(&case, &law, steps);
            assert!(dissipated >= 0.0, "{}", law.name());
            (stored + dissipated - work).abs()
        };
        let scale = cycle(&case, &law, 50)
            .iter()
            .fold(0.0f64, |m, x| m.max(x.abs()));
        // the trapezoidal rule that adds the work up is of second order
        let (coarse, fine) = (off(100), off(200));
        let name = law.name();
        assert!(fine < 1e-3 * scale, "{name}: {fine:e} of {scale:e}");
        assert!(
            fine < 0.3 * coarse || coarse < 1e-12 * scale,
            "{name}: {coarse:e} {fine:e}"
        );
    }
}

#[test]
fn rotations_turn_the_forces_and_histories_go_on_from_a_checkpoint() {
    let case = case([7, 6, 8], 0.2, false);
    let n = case.position.len() * 3;
    let rotation = {
        let (s, c) = 2.1f64.sin_cos();
        Tensor::<3>::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
            * Tensor::<3>::new(1.0, 0.0, 0.0, 0.0, 0.6, -0.8, 0.0, 0.8, 0.6)
    };
    let (first, u) = (noise(n, 0.1 * H, 4), noise(n, 0.1 * H, 9));
    let mut turned = vec![0.0; n];
    for (i, x) in case.position.iter().enumerate() {
        let y = rotation * (x + Vector::<3>::from_column_slice(&u[3 * i..3 * i + 3])) - x;
        turned[3 * i..3 * i + 3].copy_from_slice(y.as_slice());
    }
    for law in laws_with_states() {
        if ways(&law).len() == 1 {
            continue;
        }
        let begun = |state: Option<&[u64]>, u: &[f64]| {
            with_law(
                &case,
                &law,
                BondKinematics::Exact,
                None,
                false,
                |mut pass| {
                    let mut force = vec![0.0; n];
                    match state {
                        Some(state) => assert!(pass.restore_damage(state), "{}", law.name()),
                        None => {
                            pass.force_into(&first, &mut force, LATER, FailureUpdate::Frozen);
                            pass.commit();
                        }
                    }
                    let state = pass.damage_state();
                    pass.force_into(u, &mut force, LATER, FailureUpdate::Frozen);
                    (force, state)
                },
            )
        };
        let (force, state) = begun(None, &u);
        let (other, _) = begun(None, &turned);
        let expected: Vec<f64> = force
            .chunks(3)
            .flat_map(|f| {
                let f = rotation * Vector::<3>::from_column_slice(f);
                [f.x, f.y, f.z]
            })
            .collect();
        let error = difference(&other, &expected) / largest(&expected);
        assert!(error < 1e-13, "{}: {error:e}", law.name());
        assert_eq!(begun(Some(&state), &u).0, force, "{}", law.name());
        let kept = law.force_state().is_some_and(|f| !f.history().is_empty());
        assert_eq!(!state.is_empty(), kept, "{}", law.name());
    }
}

/// Results of a damaging step.
struct Told {
    damage: Vec<f64>,
    force: Vec<f64>,
    /// Bonds that the step broke, and all that do not stand.
    count: u64,
    gone: u64,
    state: Vec<u64>,
}

/// The damage of a law after a step of a size, or after that of a checkpoint.
fn damaged(
    case: &Case<2>,
    law: &Arc<dyn Law<2>>,
    no_fail: &[bool],
    size: f64,
    state: Option<&[u64]>,
) -> Told {
    let (points, n) = (case.position.len(), case.position.len() * 2);
    let failure = Failure {
        critical: BondCriterion::Uniform(f64::INFINITY),
        no_fail,
        softening: None,
    };
    let name = law.name();
    with_law(
        case,
        law,
        BondKinematics::Linear,
        Some(failure),
        false,
        |mut pass| {
            // all bonds are stretched: some laws are damaged under tension alone
            let mut u = noise(n, 0.1 * size * H, 8);
            for (u, x) in u.iter_mut().zip(case.position.iter().flatten()) {
                *u += size * x;
            }
            let mut force = vec![0.0; n];
            let mut count = 0;
            match state {
                Some(state) => assert!(pass.restore_damage(state), "{name}"),
                None => {
                    // frozen trials show nothing
                    let trial = noise(n, 9.0 * H, 3);
                    pass.force_into(&trial, &mut force, LATER, FailureUpdate::Frozen);
                    let changes = pass.force_into(&u, &mut force, LATER, FailureUpdate::Update);
                    count = changes.broken;
                    assert_eq!(pass.last_broken().len() as u64, count, "{name}");
                    let lost = pass.lost_energy(&|i| [u[2 * i], u[2 * i + 1]]);
                    assert_eq!(lost, 0.0, "{name}: the law has dissipated it");
                    pass.commit();
                    // what was counted is not counted again
                    let again = pass.force_into(&u, &mut force, LATER, FailureUpdate::Update);
                    assert!(again.is_none(), "{name}");
                    pass.commit();
                }
            }
            let mut damage = vec![f64::NAN; points];
            pass.damage_into(&mut damage);
            for (i, d) in damage.iter().enumerate() {
                assert_eq!(pass.is_damaged(i), *d > 0.0, "{name}");
            }
            let bonds = |i: usize| case.families.of(i).iter().map(move |&j| (i, j as usize));
            let bonds = (0..points).flat_map(bonds);
            let gone = bonds.filter(|&(i, j)| !pass.bonded(i, j)).count() as u64;
            assert_eq!(pass.broken(), gone, "{name}");
            let state = pass.damage_state();
            Told {
                damage,
                force,
                count,
                gone,
                state,
            }
        },
    )
}

#[test]
fn damage_that_laws_keep_of_their_bonds_is_shown_counted_and_put_back() {
    let case = case([9, 8], 0.2, false);
    let points = case.position.len();
    let held: Vec<bool> = (0..points).map(|i| i % 7 == 0).collect();
    let laws = laws_with_states::<2>();
    assert!(laws.iter().any(|law| law.damages()));
    let of_bonds = |law: &&Arc<dyn Law<2>>| law.damages() && law.local_law().is_none();
    for law in laws.iter().filter(of_bonds) {
        let name = law.name();
        // none, in part, through
        let none = damaged(&case, law, &[], 1e-4, None);
        assert!(none.damage.iter().all(|d| *d == 0.0), "{name}");
        assert_eq!([none.count, none.gone], [0, 0], "{name}");
        let part = damaged(&case, law, &[], 0.03, None);
        let partly = part.damage.iter().filter(|d| **d > 0.0 && **d < 1.0);
        assert!(2 * partly.count() > points, "{name}");
        let again = damaged(&case, law, &[], 0.03, Some(&part.state));
        assert_eq!(again.damage, part.damage, "{name}");
        let through = damaged(&case, law, &[], 5.0, None);
        assert!(through.damage.iter().all(|d| *d == 1.0), "{name}");
        assert!(through.force.iter().all(|f| *f == 0.0), "{name}");
        assert!(through.count == through.gone && through.gone > 0, "{name}");
        let again = damaged(&case, law, &[], 5.0, Some(&through.state));
        assert_eq!(again.gone, through.gone, "{name}");
        // points that keep their damage hold on to their neighbours
        let kept = damaged(&case, law, &held, 5.0, None);
        let of_points = held.iter().zip(&kept.damage);
        assert!(
            of_points.clone().all(|(held, d)| *held == (*d == 0.0)),
            "{name}"
        );
        assert!(kept.gone > 0 && kept.gone < through.gone, "{name}");
        assert!(kept.force.iter().any(|f| *f != 0.0), "{name}");
    }
}
