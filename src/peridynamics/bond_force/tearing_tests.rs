//! Failure by the tearing parameter, against its integral in closed form.

use super::generic_tests::with_law;
use super::{reference_force::*, *};
use crate::{
    peridynamics::{Families, failure::CriticalTearing, laws},
    tensor::Vector,
};

/// A block of a lattice with one horizon of two spacings.
fn block(side: usize) -> Case<3> {
    let mut position = Vec::new();
    for k in 0..side * side * side {
        let index = [k % side, k / side % side, k / side / side];
        position.push(Vector::<3>::from(index.map(|i| i as f64 * H)));
    }
    let near = |x: &Vector<3>, y: &Vector<3>| x != y && (x - y).norm() < 2.01 * H;
    let mut families = Families {
        offsets: vec![0],
        neighbours: Vec::new(),
    };
    for x in &position {
        let family = (0..position.len()).filter(|j| near(x, &position[*j]));
        families.neighbours.extend(family.map(|j| j as u32));
        families.offsets.push(families.neighbours.len());
    }
    Case {
        volume: vec![H.powi(3); position.len()],
        rows: vec![true; position.len()],
        position,
        families,
    }
}

#[test]
fn points_that_flow_under_a_constant_triaxiality_fail_at_the_integral_of_the_tearing_parameter() {
    // the deviator of uniaxial tension grows, the dilatation stays: with perfect plasticity T = K tr ε/σ_y, and P = (2/3 (1 + 3 T/2))⁴ α
    let (lambda, shear, yields, critical) = (1.7, 1.3, 0.01, 0.3);
    let constants = laws::Constants {
        lambda,
        shear,
        influence: crate::peridynamics::Influence::Gaussian,
        micromodulus: crate::peridynamics::Micromodulus::InverseDistance,
        kinematics: crate::material::Kinematics::Solid,
        density: 1.0,
        is_heated: false,
    };
    let bulk = lambda + 2.0 / 3.0 * shear;
    let named = laws::Named::PlasticCorrespondence;
    let law = named.build::<3>(constants, &[yields, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let case = block(9);
    let centre = case.position.len() / 2;
    for triaxiality in [0.0, 1.0 / 3.0, 1.0, 4.0 / 3.0, 2.0, -1.0 / 3.0] {
        // in compression the axis is pressed
        let sign: f64 = if triaxiality < 0.0 { -1.0 } else { 1.0 };
        let dilatation = triaxiality * yields / bulk;
        let ratio = match sign > 0.0 {
            true => 2.0 / 3.0 * (1.0 + 1.5 * triaxiality),
            false => 0.0,
        };
        let criterion = CriticalTearing(critical);
        let failure = Failure {
            critical: BondCriterion::State(&criterion),
            no_fail: &[],
            softening: None,
        };
        let check = |mut pass: Box<dyn BondPass<3>>| {
            let mut force = vec![0.0; case.position.len() * 3];
            // e = α + σ_y/(3 μ) of the deviator (e, −e/2, −e/2)
            let growth = 1e-3f64
                .max(critical / 40.0 / ratio.max(1e-3).powi(4))
                .min(0.1);
            let mut failed = None;
            for k in 1..=60 {
                let alpha = growth * f64::from(k);
                let e = sign * (alpha + yields / (3.0 * shear));
                let third = dilatation / 3.0;
                let strain = [e + third, -0.5 * e + third, -0.5 * e + third];
                let u: Vec<f64> = (case.position.iter())
                    .flat_map(|x| std::array::from_fn::<f64, 3, _>(|a| strain[a] * x[a]))
                    .collect();
                let interval = Interval {
                    end: f64::from(k),
                    length: 1.0,
                };
                pass.force_into(&u, &mut force, interval, FailureUpdate::Update);
                let of_centre = pass.last_broken().iter().any(|b| b.0 as usize == centre);
                if of_centre {
                    failed = Some(alpha - growth);
                    break;
                }
                pass.commit();
                let told = pass.force_states().unwrap().remembered();
                let found = told.iter().find(|(name, _)| *name == "tearing parameter");
                let expected = ratio.powi(4) * alpha;
                let p = found.unwrap().1[centre];
                assert!(
                    (p - expected).abs() < 1e-8 * expected.max(1e-8),
                    "{p} {expected}"
                );
            }
            match ratio > 0.0 {
                // it broke in the first step after the integral had come to the critical value
                true => {
                    let failed = failed.expect("no failure");
                    let exact = critical / ratio.powi(4);
                    assert!(failed >= exact * (1.0 - 1e-12) && failed < exact + growth * 1.000_001);
                }
                false => assert!(failed.is_none()),
            }
        };
        let linear = BondKinematics::Linear;
        with_law(&case, &law, linear, Some(failure), false, check);
    }
}
