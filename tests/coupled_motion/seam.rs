//! Bonds at a truncated seam that turn, stretch and break: gradients, energies, a crack beside the seam.

use super::{
    BondBehaviour, BondThreshold, CoupledSystem, DENSITY, behaviour, case, largest, wave,
    with_motion, with_motion_by,
};
use bondline::system::BodyState;
use bondline::{
    model::SiteKind,
    peridynamics::{
        Influence, Micromodulus,
        bond_force::{BondKinematics, BondSoftening},
    },
    system::{BodyHistory, FailureUpdate, Halfway, Interval, SemiDiscrete, Symmetry, Tangent},
    tensor::Vector,
};
use bondline_verify::{
    enclosed::{Case, Cells, Enclosed, Law, Method, Otherwise, SPACING, Widths},
    layers,
    tangents::{Numbers, out_of_balance},
};

fn breaking_at_the_seam() -> Case {
    case(
        Method::Truncated,
        Law::BondBased(Micromodulus::InverseDistance),
    )
}

/// Bonds that share dilatations, above the pairwise Poisson ratio.
fn breaking_states_at_the_seam() -> Case {
    case(Method::Truncated, Law::StateBased(Influence::Gaussian))
}

/// Bonds that soften from `critical`/√3 to √3 `critical`.
fn softening(kinematics: BondKinematics, critical: f64) -> BondBehaviour<'static, 2> {
    BondBehaviour {
        softening: Some(BondSoftening {
            ratio: 3.0,
            tolerance: 0.0,
        }),
        ..behaviour(kinematics, Some(critical))
    }
}

/// Asserts that a force is the gradient of the stored energy, at about a hundred of the unknowns, by differences over twice a step.
fn is_gradient<const D: usize>(motion: &CoupledSystem<'_, D>, u: &[f64], force: &[f64], step: f64) {
    let scale = largest(force.iter().copied());
    for dof in (0..u.len()).step_by(u.len() / 97 + 1) {
        let energy = |by: f64| {
            let mut moved = u.to_vec();
            moved[dof] += by;
            motion.stored_energy(&moved)
        };
        let slope = (energy(step) - energy(-step)) / (2.0 * step);
        let off = (slope - force[dof]).abs();
        assert!(off < 1e-6 * scale, "{D}, {dof}: {slope:e} {:e}", force[dof]);
    }
}

#[test]
fn the_force_of_a_seam_that_stretches_is_the_gradient_of_its_energy_and_adds_up_to_zero() {
    fn check<const D: usize>(case: &Case) {
        let exact = behaviour(BondKinematics::Exact, Some(0.002));
        with_motion::<D, _>(case, &exact, |enclosed, motion| {
            // the largest gradient is some 0.01
            let amplitude = 0.003;
            let u = wave(enclosed, amplitude);
            let mut force = vec![0.0; u.len()];
            // some bonds break, the seam's among them
            let broken = motion
                .internal_force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update)
                .broken;
            assert!(broken > 0);
            let scale = largest(force.iter().copied());
            for k in 0..D {
                let sum: f64 = force[k..].iter().step_by(D).sum();
                assert!(sum.abs() < 1e-12 * scale * u.len() as f64, "{D} {sum:e}");
            }
            is_gradient(motion, &u, &force, 1e-4 * amplitude);
        });
    }
    for case in [breaking_at_the_seam(), breaking_states_at_the_seam()] {
        check::<1>(&case);
        check::<2>(&case);
        check::<3>(&case);
    }
    // where a fit has changed whole bonds too
    check::<2>(&breaking_states_with_a_fit());
}

/// Faces that cut the lattice anywhere, so that a fit changes whole bonds too.
fn breaking_states_with_a_fit() -> Case {
    Case {
        cells: Cells::Simplices,
        ratio: 3,
        ..breaking_states_at_the_seam()
    }
}

/// A random displacement of every site, of up to `size`.
fn random<const D: usize>(enclosed: &Enclosed<D>, size: f64) -> Vec<f64> {
    let mut numbers = Numbers(17);
    let unknowns = 0..enclosed.model.sites.len() * D;
    unknowns.map(|_| size * numbers.draw()).collect()
}

#[test]
fn bonds_of_a_seam_that_soften_have_one_energy_and_spend_what_they_lose() {
    for case in [breaking_at_the_seam(), breaking_states_at_the_seam()] {
        for kinematics in [BondKinematics::Linear, BondKinematics::Exact] {
            with_motion::<2, _>(&case, &softening(kinematics, 0.002), |enclosed, motion| {
                let amplitude = 0.001;
                let wave = wave(enclosed, amplitude);
                let mut force = vec![0.0; wave.len()];
                let mut spent = 0.0;
                // on, back through zero, so that bonds past the onset close, and on again
                for part in [0.6, 1.0, -0.3, 0.01, 1.4, 2.5] {
                    let u: Vec<f64> = wave.iter().map(|u| part * u).collect();
                    let before = motion.stored_energy(&u);
                    let changes = motion.internal_force_into(
                        &u,
                        &mut force,
                        Interval::AT_ONCE,
                        FailureUpdate::Update,
                    );
                    motion.account_for_breaks(&Halfway::at(&u));
                    let taken = motion.dissipation().unwrap().total() - spent;
                    let lost = before - motion.stored_energy(&u);
                    // a bond that closes has all of its pair force again, until it opens
                    if part > 0.1 {
                        assert!(changes.softened > 0, "{part}");
                        let off = (lost - taken).abs();
                        assert!(off < 1e-9 * before, "{part}: {lost:e} {taken:e}");
                    }
                    spent += taken;
                    is_gradient(motion, &u, &force, 1e-4 * amplitude);
                    let sites = vec![Vector::<2>::zeros(); u.len() / 2];
                    let (sums, _) = out_of_balance(&sites, &force);
                    assert!(sums < 1e-12, "{part}: {sums:e}");
                    // kept in a checkpoint, to the last bit
                    let state = motion.damage_state();
                    assert!(!motion.restore_damage(&state[1..]));
                    assert!(motion.restore_damage(&state));
                    assert_eq!(motion.damage_state(), state);
                    let mut again = vec![0.0; u.len()];
                    motion.internal_force_into(
                        &u,
                        &mut again,
                        Interval::AT_ONCE,
                        FailureUpdate::Frozen,
                    );
                    assert_eq!(again, force, "{part}");
                }
                assert!(spent > 0.0);
            });
        }
    }
}

#[test]
fn moments_of_a_seam_that_moves_add_up_to_zero() {
    fn check<const D: usize>(case: &Case) {
        let places = |enclosed: &Enclosed<D>, u: &[f64]| -> Vec<Vector<D>> {
            let moved = enclosed.positions().zip(u.chunks_exact(D));
            moved
                .map(|(x, u)| x + Vector::from_column_slice(u))
                .collect()
        };
        // linear bonds, whatever moves: about the places at rest
        let linear = behaviour(BondKinematics::Linear, Some(0.5));
        with_motion::<D, _>(case, &linear, |enclosed, motion| {
            let u = random(enclosed, 0.4 * SPACING);
            let mut force = vec![0.0; u.len()];
            assert!(
                motion
                    .internal_force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update)
                    .broken
                    > 0
            );
            let (forces, moments) = out_of_balance(&places(enclosed, &vec![0.0; u.len()]), &force);
            assert!(forces.max(moments) < 1e-13, "{D} {forces:e} {moments:e}");
        });
        // exact bonds turn: about the places to which the points have moved; the elements, which are linear, all go the same way
        let exact = behaviour(BondKinematics::Exact, Some(0.5));
        with_motion::<D, _>(case, &exact, |enclosed, motion| {
            let mut u = random(enclosed, 0.4 * SPACING);
            for (site, u) in enclosed.model.sites.iter().zip(u.chunks_exact_mut(D)) {
                if let SiteKind::Node(_) = site.kind {
                    u.copy_from_slice(&[0.3 * SPACING, -0.2 * SPACING, 0.1 * SPACING][..D]);
                }
            }
            let mut force = vec![0.0; u.len()];
            assert!(
                motion
                    .internal_force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update)
                    .broken
                    > 0
            );
            let (forces, moments) = out_of_balance(&places(enclosed, &u), &force);
            assert!(forces.max(moments) < 1e-13, "{D} {forces:e} {moments:e}");
        });
    }
    for case in [breaking_at_the_seam(), breaking_states_at_the_seam()] {
        check::<2>(&case);
        check::<3>(&case);
    }
    check::<2>(&breaking_states_with_a_fit());
}

#[test]
fn forces_are_gradients_and_add_up_to_zero_where_cut_bonds_are_linear_and_others_are_not() {
    fn check<const D: usize>() {
        let case = breaking_at_the_seam();
        let linear = Otherwise {
            coupling: Some("{ truncated = { cut-bonds = \"linear\" } }"),
            ..Otherwise::default()
        };
        let enclosed = Enclosed::<D>::with(&case, &linear).unwrap();
        let exact = behaviour(BondKinematics::Exact, Some(0.5));
        with_motion_by(&enclosed, &exact, |enclosed, motion| {
            let u = random(enclosed, 0.4 * SPACING);
            let mut force = vec![0.0; u.len()];
            assert!(
                motion
                    .internal_force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update)
                    .broken
                    > 0
            );
            let places: Vec<Vector<D>> = enclosed.positions().copied().collect();
            let (forces, _) = out_of_balance(&places, &force);
            assert!(forces < 1e-13, "{D} {forces:e}");
            // bonds turn by as much as they are long, so the energy of the tangent at rest is another
            is_gradient(motion, &u, &force, 1e-5 * SPACING);
        });
    }
    check::<1>();
    check::<2>();
    check::<3>();
}

#[test]
fn a_broken_piece_takes_its_energy_and_the_elements_keep_theirs() {
    fn check<const D: usize>(kinematics: BondKinematics) {
        let critical = 0.01;
        let breaking = behaviour(kinematics, Some(critical));
        with_motion::<D, _>(&breaking_at_the_seam(), &breaking, |enclosed, motion| {
            let strain = critical * (1.0 + 1e-9);
            let u: Vec<f64> = enclosed
                .positions()
                .flat_map(|x| (0..D).map(move |k| if k == 0 { strain * x[0] } else { 0.0 }))
                .collect();
            let mut force = vec![0.0; u.len()];
            let before = motion.stored_energy(&u);
            assert!(motion.damage_at_edge().is_none());
            // of all bonds those along x, whole ones and pieces, are over the limit
            assert!(
                motion
                    .internal_force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update)
                    .broken
                    > 0
            );
            motion.account_for_breaks(&Halfway::at(&u));
            let after = motion.stored_energy(&u);
            let taken = motion.dissipation().unwrap().total();
            assert!((before - after - taken).abs() < 1e-7 * taken, "{D}");
            // of the energy that bonds along x had, nothing is left: that of the elements, and of bonds across
            let damage = motion.damage().unwrap();
            let m = case_reach(&damage);
            assert!(
                m.0 > 0.0 && (m.1 - m.0) < 1e-12,
                "{m:?}: alike up to the face"
            );
            assert!(motion.damage_at_edge().is_some());
            // for good, and kept
            let state = motion.damage_state();
            motion.internal_force_into(
                &vec![0.0; u.len()],
                &mut force,
                Interval::AT_ONCE,
                FailureUpdate::Update,
            );
            assert_eq!(motion.damage_state(), state);
            assert!(!motion.restore_damage(&state[1..]));
            assert!(motion.restore_damage(&state));
        });
    }
    /// The least and the largest damage of points that have any.
    fn case_reach(damage: &[f64]) -> (f64, f64) {
        let some = damage.iter().filter(|d| **d > 0.0);
        some.fold((f64::INFINITY, 0.0), |(a, b), &d| (a.min(d), b.max(d)))
    }
    for kinematics in [BondKinematics::Linear, BondKinematics::Exact] {
        check::<1>(kinematics);
        check::<2>(kinematics);
        check::<3>(kinematics);
    }
}

#[test]
fn linear_bonds_that_may_break_are_the_assembled_stiffness_until_they_do() {
    fn check<const D: usize>(case: &Case) {
        let never = behaviour(BondKinematics::Linear, Some(1e9));
        with_motion::<D, _>(case, &never, |enclosed, motion| {
            let u = wave(enclosed, 1.0);
            let wanted = enclosed.stiffness.multiply(&u);
            let (mut force, mut tangent) = (vec![0.0; u.len()], vec![0.0; u.len()]);
            motion.internal_force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update);
            motion.tangent_into(&u, &mut tangent);
            let sites: Vec<u32> = (0..(u.len() / D) as u32).collect();
            let rows = motion.tangent_rows(&sites).multiply(&u);
            let scale = largest(wanted.iter().copied());
            for found in [&force, &tangent, &rows] {
                let off = largest(found.iter().zip(&wanted).map(|(a, b)| a - b)) / scale;
                assert!(off < 1e-12, "{D} {}: {off:e}", case.law.name());
            }
            for (bound, exact) in motion.row_sums().iter().zip(enclosed.stiffness.row_sums()) {
                assert!(*bound >= exact * (1.0 - 1e-12) && *bound <= 4.0 * exact);
            }
            let energy: f64 = u.iter().zip(&wanted).map(|(u, f)| 0.5 * u * f).sum();
            assert!((motion.stored_energy(&u) / energy - 1.0).abs() < 1e-12);
        });
    }
    for case in [breaking_at_the_seam(), breaking_states_at_the_seam()] {
        check::<1>(&case);
        check::<2>(&case);
        check::<3>(&case);
    }
}

#[test]
fn bodies_of_different_horizons_break_at_their_own_stretch() {
    let laws = [breaking_at_the_seam(), breaking_states_at_the_seam()].map(|c| c.law);
    for law in laws {
        let e = layers::bodies::<2>(law, 2).unwrap();
        let operator = e.coupling.operator(&e.model).unwrap();
        let behaviour = BondBehaviour {
            failure: Some(BondThreshold::PerLattice(vec![0.01, 0.015])),
            ..behaviour(BondKinematics::Exact, None)
        };
        let density = |_| DENSITY;
        let (model, operator) = (&e.model, &operator);
        let mut motion =
            CoupledSystem::new(model, operator, Symmetry::Symmetric, density, &behaviour).unwrap();
        let stretched = |strain: f64| -> Vec<f64> {
            let along = |x: &Vector<2>| [strain * (1.0 + 1e-9) * x[0], 0.0];
            e.positions().flat_map(along).collect()
        };
        let mut force = vec![0.0; 2 * model.sites.len()];
        for (strain, is_fine_broken) in [(0.01, false), (0.015, true)] {
            let u = stretched(strain);
            let taken = motion.dissipation().unwrap().total();
            let before = motion.stored_energy(&u);
            motion.internal_force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update);
            motion.account_for_breaks(&Halfway::at(&u));
            let released = before - motion.stored_energy(&u);
            let taken = motion.dissipation().unwrap().total() - taken;
            assert!(
                (released - taken).abs() < 1e-12 * taken,
                "{released} {taken}"
            );
            let damage = motion.damage().unwrap();
            for (site, d) in model.sites.iter().zip(damage) {
                if matches!(site.kind, SiteKind::Point(_)) {
                    let is_broken = site.position[0] < 0.0 || is_fine_broken;
                    assert_eq!(d > 0.0, is_broken, "{strain} {:?}", site.position);
                }
            }
        }
        let state = motion.damage_state();
        assert!(motion.restore_damage(&state));
    }
}

/// Outcome of a crack one spacing above the lower face of the zone.
#[derive(Debug)]
struct Run {
    /// Energy that the crack has taken at the start, and at the end.
    taken: [f64; 2],
    /// The largest x of a point that has lost a third of its bonds, at the start and at the end.
    tip: [f64; 2],
    /// Height at which it runs on: the mean y of the points at x > 0, weighted with their damage.
    height: f64,
    /// Energy that is not accounted for, relative to what was stored.
    missing: f64,
}

/// A block with ten rows of points and eight of elements.
fn crack_case() -> Case {
    Case {
        cells: Cells::Matching,
        widths: Widths {
            nonlocal: 10,
            transition: 0,
            local: 8,
        },
        ratio: 3,
        ..breaking_at_the_seam()
    }
}

/// An opening along a line, that stretches no bond to its limit but those that cross the crack.
fn opening(x: &[Vector<2>], line: f64, critical: f64) -> Vec<f64> {
    x.iter()
        .flat_map(|x| {
            let along = (1.0 - ((x[0] + 0.04).abs() - 0.04).max(0.0) / 0.04).max(0.0);
            let away = (1.0 - (x[1] - line).abs() / 0.09).max(0.0);
            [0.0, 0.03 * critical * (x[1] - line).signum() * along * away]
        })
        .collect()
}

/// Opens a crack along `y = −0.09` in a block under tension and lets it run; the outer rows are held.
fn crack_beside_the_seam(coupling: &str) -> Run {
    let case = crack_case();
    let (critical, line, update) = (0.002, -0.09, FailureUpdate::Update);
    let typed = Otherwise {
        coupling: Some(coupling),
        ..Otherwise::default()
    };
    let e = Enclosed::<2>::with(&case, &typed).unwrap();
    let operator = e.coupling.operator(&e.model).unwrap();
    // the last rows of either body are held, and do not break
    let is_held = |x: &Vector<2>| x[1].abs() > 0.17 - 1e-9;
    let outside = |x: &Vector<2>| x.amax() > 0.1;
    let behaviour = BondBehaviour {
        kinematics: BondKinematics::Exact,
        failure: Some(BondThreshold::Uniform(critical)),
        softening: None,
        no_fail: &outside,
        contact: None,
        storage: bondline::peridynamics::bond_force::Storage::Double,
        broken: None,
        heat: None,
    };
    let mut motion = CoupledSystem::new(
        &e.model,
        &operator,
        Symmetry::Symmetric,
        |_| DENSITY,
        &behaviour,
    )
    .unwrap();
    let x: Vec<Vector<2>> = e.positions().copied().collect();
    let jump = opening(&x, line, critical);
    let mut force = vec![0.0; jump.len()];
    let torn = motion.internal_force_into(&jump, &mut force, Interval::AT_ONCE, update);
    assert!(torn.broken > 0);
    motion.account_for_breaks(&Halfway::at(&jump));
    let tip = |motion: &CoupledSystem<'_, 2>| {
        let damage = motion.damage().unwrap();
        let lost = x.iter().zip(&damage).filter(|(_, d)| **d > 0.33);
        lost.map(|(x, _)| x[0]).fold(f64::NEG_INFINITY, f64::max)
    };
    let taken = motion.dissipation().unwrap().total();
    let start = tip(&motion);
    let mut u: Vec<f64> = x
        .iter()
        .flat_map(|x| [0.0, 0.75 * critical * x[1]])
        .collect();
    let mut v = vec![0.0; u.len()];
    let mass = motion.mass().to_vec();
    let stored = motion.stored_energy(&u);
    let speed = (bondline_verify::enclosed::YOUNGS_MODULUS / DENSITY).sqrt();
    let step = 0.25 * e.model.spacing() / speed;
    let kick = |v: &mut [f64], force: &[f64]| {
        for (dof, (v, f)) in v.iter_mut().zip(force).enumerate() {
            if !is_held(&x[dof / 2]) {
                *v -= 0.5 * step * f / mass[dof / 2];
            }
        }
    };
    motion.internal_force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Frozen);
    for _ in 0..300 {
        kick(&mut v, &force);
        u.iter_mut().zip(&v).for_each(|(u, v)| *u += step * v);
        motion.internal_force_into(&u, &mut force, Interval::AT_ONCE, update);
        let back = 0.5 * step;
        motion.account_for_breaks(&Halfway { u: &u, v: &v, back });
        kick(&mut v, &force);
    }
    let kinetic: f64 = (0..v.len()).map(|d| 0.5 * mass[d / 2] * v[d] * v[d]).sum();
    let end = motion.dissipation().unwrap().total();
    let damage = motion.damage().unwrap();
    let ahead = x.iter().zip(&damage).filter(|(x, _)| x[0] > 0.0);
    let (all, moment) = ahead.fold((0.0, 0.0), |(a, m), (x, d)| (a + d, m + d * x[1]));
    Run {
        taken: [taken, end],
        tip: [start, tip(&motion)],
        height: moment / all,
        missing: (kinetic + motion.stored_energy(&u) + end - taken) / stored - 1.0,
    }
}

#[test]
fn a_crack_beside_the_seam_runs_as_in_peridynamics_alone() {
    let whole = crack_beside_the_seam("\"nonlocal\"");
    let coupled = crack_beside_the_seam("\"truncated\"");
    println!("alone {whole:?}\ncoupled {coupled:?}");
    // at first it crosses pieces only where whole bonds would be crossed: they take the same
    assert!(
        (coupled.taken[0] / whole.taken[0] - 1.0).abs() < 1e-12,
        "{whole:?} {coupled:?}"
    );
    // then it runs to the other side of the zone: more than as much again, alike to 1.0 %, on a path that turns away from the seam, 0.8 spacings nearer to it
    assert!(
        (coupled.taken[1] / whole.taken[1] - 1.0).abs() < 0.03,
        "{whole:?} {coupled:?}"
    );
    let spacing = 0.01;
    let near = |a: f64, b: f64| (a - b).abs() < 1.01 * spacing;
    assert!(
        near(coupled.tip[1], whole.tip[1]) && near(coupled.height, whole.height),
        "{whole:?} {coupled:?}"
    );
    for run in [&whole, &coupled] {
        assert!(run.tip[1] > run.tip[0] + 0.03, "{run:?}");
        assert!(run.missing.abs() < 1e-3, "{run:?}");
    }
}
