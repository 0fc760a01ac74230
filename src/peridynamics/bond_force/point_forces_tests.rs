//! Correspondence by a stress per point: against its force states bond by bond, and what its zero-energy controls do.

use std::sync::Arc;

use super::{generic::Generic, reference_force::*, *};
use crate::{
    assembly::Transfer,
    peridynamics::{
        Cloud, Ends, Factors, Horizon, Influence, Law, PdBody, ZeroEnergyControl,
        laws::{Constants, Named},
        softening::RegularFamily,
    },
    tensor::{Tensor, Vector},
};

pub(super) const CONSTANTS: Constants = Constants {
    lambda: 1.7,
    shear: 1.3,
    influence: Influence::Gaussian,
    micromodulus: crate::peridynamics::Micromodulus::InverseDistance,
    kinematics: crate::material::Kinematics::Solid,
    density: 2.5,
    is_heated: false,
};

/// Speed of the fastest waves.
fn fastest() -> f64 {
    ((CONSTANTS.lambda + 2.0 * CONSTANTS.shear) / CONSTANTS.density).sqrt()
}

const CONTROLS: [ZeroEnergyControl; 3] = [
    ZeroEnergyControl::BondForce,
    ZeroEnergyControl::Length,
    ZeroEnergyControl::Drag,
];

/// A hyperelastic solid, and one that flows, with a control of this strength.
fn laws(control: ZeroEnergyControl, strength: f64) -> [Arc<dyn Law<3>>; 2] {
    let place = control as usize as f64;
    [
        Named::NeoHookeSolid.build(CONSTANTS, &[strength, place]),
        Named::PlasticCorrespondence.build(CONSTANTS, &[0.02, 0.4, 0.0, 0.0, strength, 1.0, place]),
    ]
}

/// The pass over a case, with bonds that break at `critical`.
pub(super) fn pass(
    case: &Case<3>,
    law: &Arc<dyn Law<3>>,
    kinematics: BondKinematics,
    critical: Option<f64>,
) -> Generic<3> {
    pass_beside(case, law, kinematics, (critical, &[]))
}

/// The same with points that keep their damage.
fn pass_beside(
    case: &Case<3>,
    law: &Arc<dyn Law<3>>,
    kinematics: BondKinematics,
    (critical, no_fail): (Option<f64>, &[bool]),
) -> Generic<3> {
    let cloud = Cloud {
        position: case.position.clone(),
        volume: case.volume.clone(),
        horizon: Horizon::Uniform(3.0 * H),
        transfer: Transfer::default(),
        ..Cloud::default()
    };
    let (families, linear) = (case.families.clone(), law.linearised());
    let body = PdBody::new(cloud, families, linear, &Factors::Plain, Ends::Differ).unwrap();
    let setup = BondSetup {
        position: &case.position,
        volume: &case.volume,
        families: &case.families,
        rows: &case.rows,
        without_energy: &[],
        force: BondForce::Law { law, body: &body },
        kinematics,
        failure: critical.map(|s| Failure {
            critical: BondCriterion::Uniform(s),
            no_fail,
            softening: None,
        }),
        precracked: None,
        layout: Layout::List,
        storage: Storage::Double,
        shared: None,
    };
    Generic::new(&setup, law, law.force_state().unwrap(), &body)
}

const STEP: f64 = 0.3;

pub(super) fn step(pass: &mut Generic<3>, u: &[f64], length: f64) -> Vec<f64> {
    let mut force = vec![f64::NAN; u.len()];
    let interval = Interval {
        end: length,
        length,
    };
    pass.force_into(u, &mut force, interval, FailureUpdate::Frozen);
    force
}

/// Displacements of a gradient.
fn affine(case: &Case<3>, gradient: &Tensor<3>) -> Vec<f64> {
    let u = case.position.iter().map(|x| gradient * x);
    u.flat_map(|u| [u[0], u[1], u[2]]).collect()
}

#[test]
fn forces_are_those_of_the_force_states_bond_by_bond() {
    for ghosts in [false, true] {
        let case = case([9, 7, 8], 0.2, ghosts);
        let n = case.position.len() * 3;
        for control in CONTROLS {
            for law in &laws(control, 0.7) {
                for kinematics in [BondKinematics::Exact, BondKinematics::Linear] {
                    let run = |by_bonds: bool| {
                        let mut pass = pass(&case, law, kinematics, Some(0.2));
                        if by_bonds {
                            pass.by_bonds();
                        }
                        let first = noise(n, 0.08 * H, 3);
                        let mut all = step(&mut pass, &first, 0.0);
                        all.push(pass.commit());
                        // bonds break, and the next step is one of a family that has lost some
                        let mut force = vec![0.0; n];
                        let u = noise(n, 0.14 * H, 7);
                        let now = Interval::AT_ONCE;
                        let changes = pass.force_into(&u, &mut force, now, FailureUpdate::Update);
                        assert!(changes.broken > 20, "{changes:?}");
                        all.extend(&force);
                        all.push(pass.commit());
                        let state = pass.damage_state();
                        all.extend(step(&mut pass, &noise(n, 0.1 * H, 9), 0.0));
                        all.push(pass.stored_energy(&u));
                        assert!(pass.restore_damage(&state));
                        all.extend(step(&mut pass, &u, 0.0));
                        (all, changes.broken)
                    };
                    let (found, expected) = (run(false), run(true));
                    let off = difference(&found.0, &expected.0) / largest(&expected.0);
                    assert!(
                        off < 1e-13,
                        "{control:?} {kinematics:?} {}: {off:e}",
                        law.name()
                    );
                    assert_eq!(found.1, expected.1);
                }
            }
        }
    }
}

#[test]
fn points_that_soften_do_so_bond_by_bond_too_and_show_their_damage() {
    let case = case([9, 7, 8], 0.2, false);
    let (points, n) = (case.position.len(), case.position.len() * 3);
    let held: Vec<bool> = (0..points).map(|i| i % 7 == 0).collect();
    let lattice = RegularFamily {
        bonds: &[(Vector::<3>::new(2.0 * H, 0.0, 0.0), 1.0)],
        plane_energy: 1.0,
        horizon: 3.0 * H,
    };
    for control in CONTROLS {
        let place = control as usize as f64;
        let values = [0.05, 0.05, 0.0, 0.0, 0.7, place];
        let law = Named::DamageCorrespondence.build::<3>(CONSTANTS, &values);
        let law = law.calibrate().unwrap().to_lattice(&lattice).unwrap();
        let run = |by_bonds: bool| {
            let breaks = (Some(f64::INFINITY), held.as_slice());
            let mut pass = pass_beside(&case, &law, BondKinematics::Linear, breaks);
            if by_bonds {
                pass.by_bonds();
            }
            let mut all = Vec::new();
            for (size, seed) in [(0.05, 3), (0.08, 7), (0.02, 9)] {
                let u = noise(n, size * H, seed);
                all.extend(step(&mut pass, &u, 0.0));
                let spent = pass.commit();
                assert!(spent >= 0.0);
                all.extend([spent, pass.stored_energy(&u)]);
            }
            let mut damage = vec![0.0; points];
            pass.damage_into(&mut damage);
            let state = pass.damage_state();
            let u = noise(n, 0.2 * H, 5);
            step(&mut pass, &u, 0.0);
            pass.commit();
            assert!(pass.restore_damage(&state));
            let mut again = vec![0.0; points];
            pass.damage_into(&mut again);
            assert_eq!(again, damage);
            assert!((0..points).all(|i| pass.is_damaged(i) == (damage[i] > 0.0)));
            // damaged or not, no bond is broken by it
            assert_eq!(pass.broken(), 0);
            (all, damage)
        };
        let (found, expected) = (run(false), run(true));
        let off = difference(&found.0, &expected.0) / largest(&expected.0);
        assert!(off < 1e-13, "{control:?}: {off:e}");
        let partly = found.1.iter().filter(|d| **d > 0.01 && **d < 0.99);
        assert!(2 * partly.count() > points);
        for (held, damage) in held.iter().zip(&found.1) {
            assert!(!held || *damage == 0.0);
        }
    }
}

#[test]
fn uniform_deformations_and_rotations_are_not_resisted() {
    let case = case([9, 7, 8], 0.2, false);
    let quarter = Tensor::<3>::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let stretch = Tensor::<3>::new(1.3, 0.2, 0.0, -0.1, 0.9, 0.3, 0.05, 0.0, 1.1);
    for control in CONTROLS {
        let [weak, strong] = [0.0, 5.0].map(|strength| laws(control, strength));
        for (weak, strong) in weak.iter().zip(&strong) {
            for deformation in [quarter, stretch, quarter * stretch] {
                let u = affine(&case, &(deformation - Tensor::identity()));
                let run = |law| {
                    let mut pass = pass(&case, law, BondKinematics::Exact, None);
                    step(&mut pass, &vec![0.0; u.len()], 0.0);
                    pass.commit();
                    step(&mut pass, &u, STEP)
                };
                let (found, without) = (run(strong), run(weak));
                let scale = CONSTANTS.shear * H * H;
                let off = difference(&found, &without) / scale;
                assert!(off < 1e-12, "{control:?} {}: {off:e}", strong.name());
                if deformation == quarter {
                    assert!(largest(&found) < 1e-12 * scale, "{control:?}");
                }
            }
        }
    }
}

#[test]
fn controls_keep_momentum_and_a_drag_takes_energy() {
    let case = case([9, 7, 8], 0.2, false);
    let n = case.position.len() * 3;
    for control in CONTROLS {
        for law in &laws(control, 0.7) {
            for seed in 1..6 {
                let mut pass = pass(&case, law, BondKinematics::Exact, Some(0.25));
                let before = noise(n, 0.1 * H, seed);
                let mut force = vec![0.0; n];
                pass.force_into(
                    &before,
                    &mut force,
                    Interval::AT_ONCE,
                    FailureUpdate::Update,
                );
                pass.commit();
                let now = noise(n, 0.1 * H, seed + 10);
                let force = step(&mut pass, &now, STEP);
                let (mut sum, mut torque) = (Vector::<3>::zeros(), Vector::<3>::zeros());
                let (mut size, mut lever) = (0.0, 0.0);
                for (i, x) in case.position.iter().enumerate() {
                    let f = Vector::from_column_slice(&force[3 * i..3 * i + 3]);
                    let y = x + Vector::from_column_slice(&now[3 * i..3 * i + 3]);
                    sum += f;
                    torque += y.cross(&f);
                    size += f.norm();
                    lever += y.norm() * f.norm();
                }
                let name = format!("{control:?} {}", law.name());
                assert!(
                    sum.norm() < 1e-13 * size,
                    "{name}: force {}",
                    sum.norm() / size
                );
                assert!(
                    torque.norm() < 1e-13 * lever,
                    "{name}: torque {}",
                    torque.norm() / lever
                );
                if control != ZeroEnergyControl::Drag {
                    continue;
                }
                // the drag is what the force has beyond that without its strength
                let [elastic, flowing] = laws(control, 0.0);
                let none = if seed % 2 == 0 { elastic } else { flowing };
                if none.name() != law.name() {
                    continue;
                }
                let mut without = self::pass(&case, &none, BondKinematics::Exact, Some(0.25));
                let mut at_start = vec![0.0; n];
                let at_once = Interval::AT_ONCE;
                without.force_into(&before, &mut at_start, at_once, FailureUpdate::Update);
                without.commit();
                let bare = step(&mut without, &now, STEP);
                let of = (0..n).map(|k| (force[k] - bare[k]) * (now[k] - before[k]) / STEP);
                let taken: f64 = of.sum();
                // internal forces are minus those on the points: what they take is lost
                let lost = (pass.commit() - without.commit()) / STEP;
                assert!(
                    taken > 0.0 && (taken - lost).abs() < 1e-11 * taken,
                    "{taken} {lost}"
                );
            }
        }
    }
}

/// The force of a small displacement `direction` that alternates along `wave`, and of such a velocity, at the middle of a lattice, over displacement or velocity.
fn alternating(control: ZeroEnergyControl, wave: [u32; 3], direction: &Vector<3>) -> (f64, f64) {
    // families of the neighbours are whole, too
    let side = 13;
    let case = lattice_block(side);
    let u: Vec<f64> = (0..case.position.len())
        .flat_map(|p| {
            let index = [p % side, p / side % side, p / side / side];
            let odd: u32 = (0..3).map(|a| wave[a] * index[a] as u32).sum();
            let sign = if odd.is_multiple_of(2) { 1.0 } else { -1.0 };
            (direction * (sign * 1e-6 * H))
                .iter()
                .copied()
                .collect::<Vec<_>>()
        })
        .collect();
    let centre = case.position.len() / 2;
    let [law, _] = laws(control, 0.7);
    let mut pass = pass(&case, &law, BondKinematics::Exact, None);
    step(&mut pass, &vec![0.0; u.len()], 0.0);
    pass.commit();
    let at = |force: &[f64]| {
        let f = Vector::<3>::from_column_slice(&force[3 * centre..3 * centre + 3]);
        let x = Vector::<3>::from_column_slice(&u[3 * centre..3 * centre + 3]);
        f.dot(&x) / x.norm_squared()
    };
    let at_once = at(&step(&mut pass, &u, 0.0));
    let in_time = at(&step(&mut pass, &u, STEP));
    (at_once, (in_time - at_once) * STEP)
}

/// A block of a lattice with a horizon of three spacings.
fn lattice_block(side: usize) -> Case<3> {
    let points = side * side * side;
    let at = |p: usize| [p % side, p / side % side, p / side / side].map(|i| i as f64 * H);
    let position: Vec<Vector<3>> = (0..points).map(|p| at(p).into()).collect();
    let horizon = vec![3.0 * H; points];
    let tie = crate::peridynamics::TIE_TOLERANCE;
    Case {
        volume: vec![H.powi(3); points],
        rows: vec![true; points],
        families: crate::peridynamics::Families::search(&position, &horizon, tie).unwrap(),
        position,
    }
}

#[test]
fn alternating_modes_have_the_frequency_or_the_decay_of_their_control() {
    for (wave, direction) in [
        ([1, 0, 0], Vector::<3>::new(1.0, 0.0, 0.0)),
        ([1, 0, 0], Vector::<3>::new(0.0, 1.0, 0.0)),
        ([1, 1, 1], Vector::<3>::new(0.6, 0.0, 0.8)),
    ] {
        // the closed form over the offsets of the lattice: Ḡ of an alternating field is zero
        let (mut all, mut along, mut moment) = (0.0, 0.0, 0.0);
        for offset in -3i32..=3 {
            for (j, k) in (-3..=3).flat_map(|j| (-3..=3).map(move |k| (j, k))) {
                let offset = [offset, j, k];
                let xi = Vector::from(offset.map(f64::from)) * H;
                let r = xi.norm();
                if r == 0.0 || r > 3.0 * H * (1.0 + 1e-9) {
                    continue;
                }
                let w = CONSTANTS.influence.value(r, 3.0 * H) * H.powi(3);
                moment += w * r * r;
                let odd: i32 = (0..3).map(|a| wave[a] as i32 * offset[a]).sum();
                let grows = 1.0 - f64::from(1 - 2 * odd.rem_euclid(2));
                all += w * grows;
                along += w * grows * (xi.dot(&direction) / r).powi(2);
            }
        }
        let q = 0.7 * 15.0 * CONSTANTS.shear / moment;
        let volume = H.powi(3);
        let close = |found: f64, expected: f64| (found - expected).abs() < 1e-7 * expected;
        // ρ ω² of the elastic ones
        let (stiff, lost) = alternating(ZeroEnergyControl::BondForce, wave, &direction);
        assert!(
            close(stiff, 2.0 * q * all * volume),
            "{stiff} {}",
            2.0 * q * all * volume
        );
        assert!(lost.abs() < 1e-9 * stiff);
        let (stiff, lost) = alternating(ZeroEnergyControl::Length, wave, &direction);
        assert!(
            close(stiff, 2.0 * q * along * volume),
            "{stiff} {}",
            2.0 * q * along * volume
        );
        assert!(lost.abs() < 1e-9 * stiff);
        // ρ times the rate of decay of the drag, which holds nothing in place
        let c = q * 3.0 * H / fastest();
        let (stiff, lost) = alternating(ZeroEnergyControl::Drag, wave, &direction);
        assert!(stiff.abs() < 1e-9 * lost / STEP, "{stiff} {lost}");
        assert!(
            close(lost, 2.0 * c * all * volume),
            "{lost} {}",
            2.0 * c * all * volume
        );
    }
}

#[test]
fn the_tangent_at_rest_is_that_of_the_control() {
    let case = case([9, 7, 8], 0.2, false);
    let n = case.position.len() * 3;
    for control in CONTROLS {
        for law in &laws(control, 3.0) {
            let mut pass = pass(&case, law, BondKinematics::Exact, None);
            let direction = noise(n, H, 5);
            let scaled = |s: f64| -> Vec<f64> { direction.iter().map(|x| s * x).collect() };
            let (plus, minus) = (
                step(&mut pass, &scaled(1e-6), 0.0),
                step(&mut pass, &scaled(-1e-6), 0.0),
            );
            let slope: Vec<f64> = (0..n).map(|k| (plus[k] - minus[k]) / 2e-6).collect();
            let mut tangent = vec![0.0; n];
            pass.tangent_into(&direction, &mut tangent);
            let off = difference(&slope, &tangent) / largest(&tangent);
            assert!(off < 1e-8, "{control:?} {}: {off:e}", law.name());
            // row sums bound what signs can do
            let sums = pass.row_sums();
            for seed in 0..8 {
                let signs: Vec<f64> = noise(n, 1.0, seed).iter().map(|x| x.signum()).collect();
                pass.tangent_into(&signs, &mut tangent);
                assert!(
                    tangent
                        .iter()
                        .zip(&sums)
                        .all(|(k, sum)| k.abs() <= sum * (1.0 + 1e-12))
                );
            }
        }
    }
}

#[test]
fn a_resumed_drag_has_the_same_bits() {
    let case = case([9, 7, 8], 0.2, false);
    let n = case.position.len() * 3;
    let [law, _] = laws(ZeroEnergyControl::Drag, 0.7);
    let mut first = pass(&case, &law, BondKinematics::Exact, Some(0.25));
    for seed in 1..4 {
        step(&mut first, &noise(n, 0.1 * H, seed), STEP);
        first.commit();
    }
    let mut second = pass(&case, &law, BondKinematics::Exact, Some(0.25));
    assert!(second.restore_damage(&first.damage_state()));
    let here = noise(n, 0.1 * H, 3);
    // at once: the drag of the step before
    let (a, b) = (step(&mut first, &here, 0.0), step(&mut second, &here, 0.0));
    assert_eq!(a, b);
    first.commit();
    second.commit();
    let there = noise(n, 0.1 * H, 4);
    assert_eq!(
        step(&mut first, &there, STEP),
        step(&mut second, &there, STEP)
    );
}

#[test]
fn a_drag_is_that_of_its_definition_bond_by_bond() {
    let case = case([9, 7, 8], 0.2, false);
    let n = case.position.len() * 3;
    for kinematics in [BondKinematics::Exact, BondKinematics::Linear] {
        let forces = [0.7, 0.0].map(|strength| {
            let [_, law] = laws(ZeroEnergyControl::Drag, strength);
            let mut pass = pass(&case, &law, kinematics, Some(0.2));
            let before = noise(n, 0.14 * H, 7);
            let mut force = vec![0.0; n];
            let changes = pass.force_into(
                &before,
                &mut force,
                Interval::AT_ONCE,
                FailureUpdate::Update,
            );
            assert!(changes.broken > 20, "{changes:?}");
            pass.commit();
            let now = noise(n, 0.1 * H, 13);
            let force = step(&mut pass, &now, STEP);
            (pass, before, now, force)
        });
        let [(pass, before, now, force), (.., bare)] = &forces;
        let of = |all: &[f64], i: usize| Vector::<3>::from_column_slice(&all[3 * i..3 * i + 3]);
        let bond = |i: usize, bond: usize| {
            let j = pass.neighbour(bond);
            let [now, before] = [now, before].map(|u| of(u, j) - of(u, i));
            let y = match kinematics {
                BondKinematics::Exact => pass.xi(i, j) + now,
                BondKinematics::Linear => pass.xi(i, j),
            };
            (y, (now - before) / STEP)
        };
        let intact = |i: usize| pass.range(i).filter(|&b| pass.intact[b]);
        let gradient = |i: usize| {
            let (mut rate, mut shape) = (Tensor::<3>::zeros(), Tensor::<3>::zeros());
            for b in intact(i) {
                let (y, velocity) = bond(i, b);
                let w = pass.omega[b] * pass.volume[pass.neighbour(b)];
                rate += velocity * y.transpose() * w;
                shape += y * y.transpose() * w;
            }
            rate * shape.try_inverse().unwrap()
        };
        let all: Vec<_> = (0..case.position.len()).map(gradient).collect();
        let mut expected = vec![Vector::<3>::zeros(); all.len()];
        for (i, gradient) in all.iter().enumerate() {
            for b in intact(i) {
                let (y, velocity) = bond(i, b);
                let control = pass.state[i].as_ref().unwrap().control;
                let state = (velocity - gradient * y) * (pass.omega[b] * control);
                let j = pass.neighbour(b);
                let both = state * pass.volume[i] * pass.volume[j];
                expected[i] -= both;
                expected[j] += both;
            }
        }
        let largest = expected.iter().map(|f| f.amax()).fold(0.0, f64::max);
        for (i, expected) in expected.iter().enumerate().filter(|(i, _)| pass.row[*i]) {
            let drag = of(force, i) - of(bare, i);
            let off = (drag - expected).amax() / largest;
            assert!(off < 1e-12, "{kinematics:?} point {i}: {off:e}");
        }
    }
}

#[test]
fn a_torn_family_that_is_flattened_loses_its_bonds_and_their_energy_is_told() {
    let case = case([9, 7, 8], 0.2, false);
    let n = case.position.len() * 3;
    for law in &laws(ZeroEnergyControl::BondForce, 0.7) {
        let mut pass = pass(&case, law, BondKinematics::Exact, Some(0.2));
        let tear = noise(n, 0.14 * H, 7);
        let mut force = vec![0.0; n];
        let mut step = |pass: &mut Generic<3>, u: &[f64]| {
            let update = FailureUpdate::Update;
            let changes = pass.force_into(u, &mut force, Interval::AT_ONCE, update);
            changes.broken
        };
        assert!(step(&mut pass, &tear) > 20);
        pass.commit();
        let damage = |pass: &Generic<3>| -> Vec<f64> {
            let points = 0..case.position.len();
            points.map(|i| pass.damage_of_point(i)).collect()
        };
        let torn = damage(&pass);
        for (stretch, is_flat) in [(0.3, false), (0.2, true)] {
            let gradient = Tensor::from_diagonal(&Vector::from([0.0, 0.0, stretch - 1.0]));
            let u = affine(&case, &gradient);
            let stored = pass.stored_energy(&u);
            let broken = step(&mut pass, &u);
            assert_eq!(broken > 0, is_flat, "{stretch}");
            for (i, (before, after)) in torn.iter().zip(damage(&pass)).enumerate() {
                let expected = if is_flat && *before > 0.0 {
                    1.0
                } else {
                    *before
                };
                assert!(
                    (after - expected).abs() < 1e-12,
                    "point {i}: {before} {after}"
                );
            }
            let released = stored - pass.stored_energy(&u);
            let told = pass.lost_energy(&|j| std::array::from_fn(|a| u[3 * j + a]));
            assert!(
                (told - released).abs() < 1e-12 * stored,
                "{told} {released}"
            );
        }
    }
}
