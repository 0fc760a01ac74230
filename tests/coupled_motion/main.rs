//! A moving model against the assembled one, closed forms and momentum.

use bondline::coupling::semidiscrete::{BondBehaviour, BondThreshold};
use bondline::coupling::semidiscrete::{CoupledSystem, masses, scale_rows};
use bondline::fem;
use bondline::model::SiteKind;
use bondline::peridynamics::bond_force::BondKinematics;
use bondline::peridynamics::{Influence, Micromodulus};
use bondline::system::BodyState;
use bondline::system::{BodyHistory, FailureUpdate, Interval, SemiDiscrete, Tangent};
use bondline::tensor::Vector;
use bondline_verify::enclosed::{Case, Cells, Enclosed, Law, Method, Widths};

mod seam;

const DENSITY: f64 = 2.5;

fn behaviour<const D: usize>(
    kinematics: BondKinematics,
    critical_stretch: Option<f64>,
) -> BondBehaviour<'static, D> {
    BondBehaviour {
        kinematics,
        failure: critical_stretch.map(BondThreshold::Uniform),
        softening: None,
        no_fail: &|_| false,
        contact: None,
        storage: bondline::peridynamics::bond_force::Storage::Double,
        broken: None,
        heat: None,
    }
}

fn case(method: Method, law: Law) -> Case {
    Case {
        method,
        law,
        cells: Cells::Coarse,
        widths: Widths {
            nonlocal: 6,
            transition: if method.has_transition() { 6 } else { 0 },
            local: 12,
        },
        ratio: 2,
    }
}

/// Every coupling: what an operator says of its rows decides which forces a motion computes bond by bond.
fn all_cases() -> Vec<Case> {
    let laws = [
        Law::BondBased(Micromodulus::InverseDistance),
        Law::StateBased(Influence::Gaussian),
    ];
    Method::ALL
        .into_iter()
        .flat_map(|m| laws.map(|l| case(m, l)))
        .collect()
}

/// Those whose seam has no bonds of its own.
fn cases() -> Vec<Case> {
    let mut cases = all_cases();
    cases.retain(|case| case.method != Method::Truncated);
    cases
}

fn with_motion<const D: usize, T>(
    case: &Case,
    behaviour: &BondBehaviour<'_, D>,
    visit: impl FnOnce(&Enclosed<D>, &mut CoupledSystem<'_, D>) -> T,
) -> T {
    let enclosed = Enclosed::<D>::new(case).unwrap();
    with_motion_by(&enclosed, behaviour, visit)
}

/// As [`with_motion`], of a model that is there.
fn with_motion_by<const D: usize, T>(
    enclosed: &Enclosed<D>,
    behaviour: &BondBehaviour<'_, D>,
    visit: impl FnOnce(&Enclosed<D>, &mut CoupledSystem<'_, D>) -> T,
) -> T {
    let coupling = &enclosed.coupling;
    let operator = coupling.operator(&enclosed.model).unwrap();
    let mut motion = CoupledSystem::new(
        &enclosed.model,
        &operator,
        coupling.symmetry(),
        |_| DENSITY,
        behaviour,
    )
    .unwrap();
    visit(enclosed, &mut motion)
}

fn wave<const D: usize>(enclosed: &Enclosed<D>, amplitude: f64) -> Vec<f64> {
    enclosed
        .positions()
        .flat_map(|x| {
            (0..D).map(move |k| amplitude * (3.1 * x[0] + 2.0 * x[D - 1] + k as f64).sin())
        })
        .collect()
}

/// Returns the values of the rows of a case as runs have them: each times its scale.
fn scaled<const D: usize>(enclosed: &Enclosed<D>, mut values: Vec<f64>) -> Vec<f64> {
    scale_rows(&enclosed.model, &mut values);
    values
}

fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |m, v| m.max(v.abs()))
}

#[test]
fn linear_bonds_are_the_assembled_stiffness() {
    fn check<const D: usize>(case: &Case) {
        with_motion::<D, _>(
            case,
            &behaviour(BondKinematics::Linear, None),
            |enclosed, motion| {
                let u = wave(enclosed, 1.0);
                let wanted = scaled(enclosed, enclosed.stiffness.multiply(&u));
                let (mut force, mut tangent) = (vec![0.0; u.len()], vec![0.0; u.len()]);
                assert_eq!(
                    motion
                        .internal_force_into(
                            &u,
                            &mut force,
                            Interval::AT_ONCE,
                            FailureUpdate::Frozen
                        )
                        .broken,
                    0
                );
                motion.tangent_into(&u, &mut tangent);
                let scale = largest(wanted.iter().copied());
                for found in [&force, &tangent] {
                    let off = largest(found.iter().zip(&wanted).map(|(a, b)| a - b)) / scale;
                    assert!(
                        off < 1e-12,
                        "{} {}: {off:e}",
                        case.method.name(),
                        case.law.name()
                    );
                }
                // row sums bound those of the matrix, and not by much; partial stresses of the Gauss points of one cell cancel in part
                let slack = match case.method {
                    Method::Elements(_) => 16.0,
                    _ => 4.0,
                };
                let exact = scaled(enclosed, enclosed.stiffness.row_sums());
                for (bound, exact) in motion.row_sums().iter().zip(&exact) {
                    assert!(*bound >= exact * (1.0 - 1e-12), "{bound} {exact}");
                    let what = case.method.name();
                    assert!(*bound <= slack * exact, "{what}: {bound} {exact}");
                }
            },
        );
    }
    for case in all_cases() {
        check::<1>(&case);
        check::<2>(&case);
    }
}

#[test]
fn exact_bonds_are_the_stiffness_to_first_order() {
    for case in all_cases() {
        with_motion::<2, _>(
            &case,
            &behaviour(BondKinematics::Exact, None),
            |enclosed, motion| {
                let mut off = [0.0; 2];
                for (off, amplitude) in off.iter_mut().zip([1e-4, 1e-5]) {
                    let u = wave(enclosed, amplitude);
                    let wanted = scaled(enclosed, enclosed.stiffness.multiply(&u));
                    let mut force = vec![0.0; u.len()];
                    motion.internal_force_into(
                        &u,
                        &mut force,
                        Interval::AT_ONCE,
                        FailureUpdate::Frozen,
                    );
                    *off = largest(force.iter().zip(&wanted).map(|(a, b)| a - b))
                        / largest(wanted.iter().copied());
                }
                // what differs is of second order in the force, so of first order relative to it
                assert!(off[0] > 0.0 && off[0] < 0.1, "{off:?}");
                assert!((off[0] / off[1] - 10.0).abs() < 1.0, "{off:?}");
            },
        );
    }
}

#[test]
fn uniform_strain_stores_its_energy_across_the_seam() {
    fn check<const D: usize>(case: &Case) {
        with_motion::<D, _>(
            case,
            &behaviour(BondKinematics::Linear, None),
            |enclosed, motion| {
                let strain = 1e-3;
                let u: Vec<f64> = enclosed
                    .positions()
                    .flat_map(|x| (0..D).map(|k| if k == 0 { strain * x[0] } else { 0.0 }))
                    .collect();
                // the half spacing between the last points and a seam whose nodes carry points belongs to no body
                let model = &enclosed.model;
                let elements: f64 = (0..model.mesh.cell_count())
                    .filter(|&c| model.is_element(c))
                    .map(|c| fem::cell_volume(&model.mesh, c))
                    .sum();
                let points: f64 = (0..model.sites.len())
                    .filter_map(|s| model.point_of(s))
                    .map(|(body, p)| body.cloud.volume[p])
                    .sum();
                let volume = elements + points;
                let exact = 0.5 * enclosed.tensor.get(0, 0, 0, 0) * strain * strain * volume;
                let found = motion.stored_energy(&u);
                assert!(
                    (found / exact - 1.0).abs() < 1e-10,
                    "{} {}: {found} {exact}",
                    case.method.name(),
                    case.law.name()
                );
            },
        );
    }
    for case in cases() {
        check::<1>(&case);
        check::<2>(&case);
    }
}

#[test]
fn masses_add_up_to_the_body() {
    let case = case(
        Method::Splice,
        Law::BondBased(Micromodulus::InverseDistance),
    );
    let enclosed = Enclosed::<2>::new(&case).unwrap();
    let mass = masses(&enclosed.model, |_| DENSITY);
    assert!(mass.iter().all(|m| *m > 0.0));
    // hats of nodes at the seam and cells of points overlap in the rows, not in the masses
    let whole = DENSITY * (2.0 * enclosed.half).powi(2);
    let total: f64 = mass.iter().sum();
    assert!((total / whole - 1.0).abs() < 1e-12, "{total} {whole}");
}

/// Bonds that end on faces leave nothing to count twice; points that lie on them: `tests/motion/driven.rs`.
#[test]
fn masses_of_truncated_bonds_are_those_of_the_body() {
    fn check<const D: usize>() {
        let law = Law::BondBased(Micromodulus::InverseDistance);
        let case = case(Method::Truncated, law);
        let enclosed = Enclosed::<D>::new(&case).unwrap();
        let mass = masses(&enclosed.model, |_| DENSITY);
        let whole = DENSITY * (2.0 * enclosed.half).powi(D as i32);
        let total: f64 = mass.iter().sum();
        assert!((total / whole - 1.0).abs() < 1e-12, "{D}D: {total} {whole}");
    }
    check::<1>();
    check::<2>();
    check::<3>();
}

#[test]
fn bonds_break_in_the_nonlocal_zone_only_and_the_edge_is_told() {
    for case in cases() {
        let strain = 0.02;
        with_motion::<2, _>(
            &case,
            &behaviour(BondKinematics::Exact, Some(0.01)),
            |enclosed, motion| {
                // uniform tension everywhere: every bond along x that may break does, up to the edge
                let u: Vec<f64> = enclosed
                    .positions()
                    .flat_map(|x| [strain * x[0], 0.0])
                    .collect();
                let mut force = vec![0.0; u.len()];
                assert!(motion.damage_at_edge().is_none());
                let broken = motion
                    .internal_force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Update)
                    .broken;
                assert!(broken > 0);
                let damage = motion.damage().unwrap();
                let edge = motion.damage_at_edge().unwrap();
                assert!(damage[edge] > 0.0);
                for (site, damage) in enclosed.model.sites.iter().zip(&damage) {
                    let inside = site.position.amax()
                        <= 6.0 / 6.0 * f64::from(case.widths.nonlocal) * enclosed.half
                            / f64::from(case.widths.total())
                            + 1e-9;
                    assert!(inside || *damage == 0.0, "{:?}", site.position);
                }
                // for good: nothing heals, and held passes break nothing
                let state = motion.damage_state();
                assert_eq!(
                    motion
                        .internal_force_into(
                            &vec![0.0; u.len()],
                            &mut force,
                            Interval::AT_ONCE,
                            FailureUpdate::Update
                        )
                        .broken,
                    0
                );
                assert_eq!(motion.damage_state(), state);
                assert!(!motion.restore_damage(&[1, 2, 3]));
                assert!(motion.restore_damage(&state));
            },
        );
    }
}

#[test]
fn an_exact_body_turns_without_force() {
    // pure peridynamics, turned by 1 radian
    let case = case(Method::Splice, Law::StateBased(Influence::Gaussian));
    with_motion::<2, _>(
        &case,
        &behaviour(BondKinematics::Exact, None),
        |enclosed, motion| {
            let (s, c) = 1f64.sin_cos();
            let turned = |x: &Vector<2>| [c * x[0] - s * x[1] - x[0], s * x[0] + c * x[1] - x[1]];
            let u: Vec<f64> = enclosed.positions().flat_map(turned).collect();
            let mut force = vec![0.0; u.len()];
            motion.internal_force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Frozen);
            let linear = enclosed.stiffness.multiply(&wave(enclosed, 1e-3));
            let scale = largest(linear);
            for (site, s) in enclosed.model.sites.iter().enumerate() {
                // finite elements are linear and resist a large rotation; points away from them do not
                if matches!(s.kind, SiteKind::Point(_)) {
                    let f = largest(force[site * 2..][..2].iter().copied());
                    assert!(f < 1e-9 * scale, "{:?} {f:e} {scale:e}", s.position);
                }
            }
        },
    );
}
