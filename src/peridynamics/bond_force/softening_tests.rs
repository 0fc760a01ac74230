//! Bonds that soften, in the passes that hand them over, against a double loop and closed forms.

use std::collections::HashMap;

use super::{reference_force::*, *};

/// Parts of its stiffness that a bond has whose stretch has been `largest` and is `now`, of the pair force and of the dilatation: a line from `s_e` to `s_c`.
fn left([onset, end]: [f64; 2], largest: f64, now: f64) -> [f64; 2] {
    let open = match largest {
        _ if largest >= end => 0.0,
        _ if largest <= onset => 1.0,
        _ => onset * (end - largest) / (end - onset) / largest,
    };
    [
        if now < 0.0 && largest < end {
            1.0
        } else {
            open
        },
        open,
    ]
}

fn stretch<const D: usize>(
    case: &Case<D>,
    kinematics: BondKinematics,
    u: &[f64],
    [i, j]: [usize; 2],
) -> f64 {
    let at = |i: usize| Vector::<D>::from_fn(|a, _| u[i * D + a]);
    let xi = case.position[j] - case.position[i];
    let eta = at(j) - at(i);
    match kinematics {
        BondKinematics::Exact => (xi + eta).norm() / xi.norm() - 1.0,
        BondKinematics::Linear => xi.dot(&eta) / xi.norm_squared(),
    }
}

/// The largest stretches of bonds, as a double loop keeps them.
type Largest = HashMap<[usize; 2], f64>;

fn follow<const D: usize>(
    case: &Case<D>,
    kinematics: BondKinematics,
    u: &[f64],
    largest: &mut Largest,
) {
    for i in 0..case.position.len() {
        for &j in case.families.of(i) {
            let bond = [i, j as usize];
            let kept = largest.entry(bond).or_insert(0.0);
            *kept = kept.max(stretch(case, kinematics, u, bond));
        }
    }
}

/// Damage is the volume of what bonds have lost under tension over that of all.
fn check_damage<const D: usize>(
    case: &Case<D>,
    pass: &dyn BondPass<D>,
    (ends, largest): ([f64; 2], &Largest),
    name: &str,
) {
    let mut damage = vec![0.0; case.position.len()];
    pass.damage_into(&mut damage);
    for (i, damage) in damage.iter().enumerate() {
        let (mut all, mut stands) = (0.0, 0.0);
        for &j in case.families.of(i) {
            let kept = largest[&[i, j as usize]];
            all += case.volume[j as usize];
            stands += left(ends, kept, kept)[1] * case.volume[j as usize];
        }
        assert!((damage - (1.0 - stands / all)).abs() < 1e-12, "{name}");
    }
}

/// A pass takes a state back, and has the same forces to the last bit; it refuses one that is cut short.
fn restored<const D: usize>(
    pass: &mut dyn BondPass<D>,
    state: &[u64],
    u: &[f64],
    expected: &[f64],
    name: &str,
) {
    assert!(!pass.restore_damage(&state[1..]), "{name}");
    assert!(pass.restore_damage(state), "{name}");
    assert_eq!(pass.damage_state(), state, "{name}");
    let mut force = vec![0.0; u.len()];
    pass.force_into(u, &mut force, Interval::AT_ONCE, FailureUpdate::Frozen);
    assert_eq!(force, expected, "{name}");
}

/// Force, energy and what was lost at a displacement are those of the largest stretches before and after it.
fn compare<const D: usize>(
    (case, law, kinematics): (&Case<D>, Law, BondKinematics),
    pass: &dyn BondPass<D>,
    (u, force): (&[f64], &[f64]),
    (kept, ends): ([&Largest; 2], [f64; 2]),
    name: &str,
) {
    let with = |kept: &Largest| {
        let left = |i: usize, j: usize| {
            let most = kept.get(&[i, j]).copied().unwrap_or(0.0);
            left(ends, most, stretch(case, kinematics, u, [i, j]))
        };
        naive_of_parts(case, law, kinematics, u, &left)
    };
    let [(_, was), (expected, energy)] = kept.map(with);
    let error = difference(force, &expected) / largest(&expected);
    assert!(error < 1e-12, "{name}: {error:e}");
    let stored = pass.stored_energy(u);
    assert!((stored / energy - 1.0).abs() < 1e-12, "{name}: {stored}");
    let lost = pass.lost_energy(&|i| std::array::from_fn(|a| u[i * D + a]));
    assert!(
        (lost - (was - energy)).abs() < 1e-12 * was,
        "{name}: {lost}"
    );
}

fn softens<const D: usize>(counts: [usize; D], jitter: f64) {
    let case = case(counts, jitter, false);
    let n = case.position.len() * D;
    let (brittle, ratio) = (0.1, 3.0_f64);
    let ends = [brittle / ratio.sqrt(), brittle * ratio.sqrt()];
    let failure = Failure {
        critical: BondCriterion::Uniform(brittle),
        no_fail: &[],
        softening: Some(BondSoftening {
            ratio,
            tolerance: 0.0,
        }),
    };
    let strained = noise(n, 0.1 * H, 21);
    let layouts = match jitter {
        0.0 => &[Layout::Lattice, Layout::List][..],
        _ => &[Layout::List],
    };
    let kinds = [BondKinematics::Exact, BondKinematics::Linear];
    for (law, kinematics) in kinds
        .map(|k| (Law::Pmb, k))
        .into_iter()
        .chain(kinds.map(|k| (Law::Solid, k)))
    {
        for &layout in layouts {
            with(&case, law, kinematics, Some(failure), layout, |mut pass| {
                let name = format!("{D}D {law:?} {kinematics:?} {}", pass.name());
                let (mut force, mut largest) = (vec![0.0; n], Largest::new());
                let (mut softened, mut broken) = (0, 0);
                for part in [0.6, -0.5, 1.2, 0.2, 1.6] {
                    let u: Vec<f64> = strained.iter().map(|x| part * x).collect();
                    let before = largest.clone();
                    follow(&case, kinematics, &u, &mut largest);
                    let update = FailureUpdate::Update;
                    let changes = pass.force_into(&u, &mut force, Interval::AT_ONCE, update);
                    (softened, broken) = (softened + changes.softened, broken + changes.broken);
                    let of = (&case, law, kinematics);
                    compare(
                        of,
                        pass.as_ref(),
                        (&u, &force),
                        ([&before, &largest], ends),
                        &name,
                    );
                    let gone = largest.values().filter(|s| **s >= ends[1]).count() as u64;
                    assert_eq!(pass.broken(), gone, "{name} {part}");
                    check_damage(&case, pass.as_ref(), (ends, &largest), &name);
                }
                assert!(
                    softened > 100 && broken > 10 && broken == pass.broken(),
                    "{name} {softened} {broken}"
                );
                // a restored state gives the same bits; a broken one is refused
                let state = pass.damage_state();
                pass.force_into(
                    &strained,
                    &mut force,
                    Interval::AT_ONCE,
                    FailureUpdate::Frozen,
                );
                with(
                    &case,
                    law,
                    kinematics,
                    Some(failure),
                    layout,
                    |mut other| {
                        restored(other.as_mut(), &state, &strained, &force, &name);
                    },
                );
                if kinematics == BondKinematics::Linear {
                    row_sums_bound_rows_of_softened(pass.as_ref(), n, &name);
                }
            });
        }
    }
}

/// The tangent is symmetric with bonds as they stand, and its rows are below their bounds.
fn row_sums_bound_rows_of_softened<const D: usize>(pass: &dyn BondPass<D>, n: usize, name: &str) {
    let sums = pass.row_sums();
    let (x, y) = (noise(n, 1.0, 5), noise(n, 1.0, 6));
    let (mut kx, mut ky) = (vec![0.0; n], vec![0.0; n]);
    pass.tangent_into(&x, &mut kx);
    pass.tangent_into(&y, &mut ky);
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (xky, ykx) = (product(&x, &ky), product(&y, &kx));
    assert!(
        (xky - ykx).abs() < 1e-12 * product(&x, &kx),
        "{name}: {xky} {ykx}"
    );
    for (kx, sum) in kx.iter().zip(&sums) {
        assert!(kx.abs() <= sum * (1.0 + 1e-12), "{name}: {kx} {sum}");
    }
}

#[test]
fn softened_bonds_are_those_of_a_double_loop() {
    softens([200], 0.0);
    softens([12, 9], 0.0);
    softens([12, 9], 0.2);
    softens([7, 6, 7], 0.0);
}

/// Opens a bar of two points until its bond is through; returns what that took.
fn torn(softening: Option<BondSoftening>, brittle: f64) -> f64 {
    let case = case([2], 0.0, false);
    let failure = Failure {
        critical: BondCriterion::Uniform(brittle),
        no_fail: &[],
        softening,
    };
    let linear = BondKinematics::Linear;
    with(
        &case,
        Law::Pmb,
        linear,
        Some(failure),
        Layout::List,
        |mut pass| {
            let (mut force, mut spent, steps) = (vec![0.0; 2], 0.0, 20_000);
            for step in 0..=steps {
                let u = [0.0, 4.0 * brittle * H * f64::from(step) / f64::from(steps)];
                pass.force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update);
                spent += pass.lost_energy(&|i| [u[i]]);
            }
            assert_eq!(pass.broken(), 2);
            spent
        },
    )
}

#[test]
fn softening_takes_the_energy_of_a_break() {
    // ½ k s_0² with k = ∂²W/∂s² of both ends
    let brittle = torn(None, 0.01);
    for (ratio, tolerance, off) in [
        (2.0, 0.0, 1e-3),
        (3.0, 0.0, 1e-3),
        (10.0, 0.0, 1e-3),
        (3.0, 0.01, 2e-2),
    ] {
        let spent = torn(Some(BondSoftening { ratio, tolerance }), 0.01);
        assert!(
            (spent / brittle - 1.0).abs() < off,
            "{ratio} {tolerance}: {spent} {brittle}"
        );
    }
}
