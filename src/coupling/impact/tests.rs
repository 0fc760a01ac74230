use super::*;
use crate::system::{
    FailureUpdate, Interval, LinearMotion, SemiDiscrete, Symmetry, Tangent, WithTerms,
};
use nalgebra::DMatrix;
use std::sync::Arc;

/// A cloud of sites around the origin with unequal stiffnesses, and three impactors that reach into it.
fn impact(sites: usize) -> Impact<3> {
    let mut seed = 11_u64;
    let mut number = move || {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let position: Vec<Vector<3>> = (0..sites)
        .map(|_| Vector::<3>::from_fn(|_, _| number()))
        .collect();
    let stiffness = (0..sites).map(|_| 2.0 + number()).collect();
    let rigid = |shape, mass, stiffness_factor| RigidImpactor {
        shape,
        mass,
        stiffness_factor,
    };
    Impact {
        impactors: vec![
            rigid(
                ImpactorShape::Sphere {
                    center: Vector::<3>::new(0.6, 0.1, 0.0),
                    radius: 0.4,
                },
                Some(0.7),
                1.0,
            ),
            rigid(
                ImpactorShape::Cylinder {
                    point: Vector::<3>::new(-0.6, 5.25, 7.0),
                    direction: Vector::<3>::new(0.0, 0.6, 0.8),
                    radius: 0.9,
                },
                None,
                2.0,
            ),
            rigid(
                ImpactorShape::Plane {
                    point: Vector::<3>::new(9.0, 0.0, -0.3),
                    normal: Vector::<3>::new(0.0, 0.0, 1.0),
                },
                Some(3.0),
                0.5,
            ),
        ],
        clearance: vec![0.0; position.len()],
        size: vec![0.1; position.len()],
        position,
        stiffness,
        stiffest_face: 3.0,
        bounds: (
            Vector::<3>::from_element(-0.5),
            Vector::<3>::from_element(0.5),
        ),
        smallest: 0.1,
        counted: 1.0,
        pushes: std::sync::Mutex::default(),
    }
}

fn displacement(dofs: usize) -> Vec<f64> {
    (0..dofs)
        .map(|k| 0.02 * ((k * 37 % 19) as f64 / 9.0 - 1.0))
        .collect()
}

/// Sites of a face, 0.1 apart, beneath a sphere and a cylinder that reach 0.02 into it.
#[test]
fn the_width_of_a_contact_is_across_the_way_out_and_the_axis() {
    let mut contact = impact(0);
    let grid = |k: usize| 0.1 * k as f64 - 1.0;
    contact.position = (0..441)
        .map(|k| Vector::<3>::new(grid(k % 21), grid(k / 21), 0.0))
        .collect();
    contact.size = vec![0.1; 441];
    contact.stiffness = vec![1.0; 441];
    contact.clearance = vec![0.0; 441];
    let center = Vector::<3>::new(0.0, 0.0, 0.98);
    contact.impactors[0].shape = ImpactorShape::Sphere {
        center,
        radius: 1.0,
    };
    contact.impactors[1].shape = ImpactorShape::Cylinder {
        point: center,
        direction: Vector::<3>::new(0.0, 1.0, 0.0),
        radius: 1.0,
    };
    contact.impactors[2].shape = ImpactorShape::Plane {
        point: Vector::<3>::new(0.0, 0.0, 5.0),
        normal: Vector::<3>::new(0.0, 0.0, 1.0),
    };
    let u = vec![0.0; 444 * 3];
    // √(1 − 0.98²) = 0.199: one row on either side, and no corner of 0.2
    let sphere = contact.contact(&u, 0);
    assert_eq!(sphere.sites, 9);
    assert!((sphere.across - (1.0 + 2.0 * 2f64.sqrt())).abs() < 1e-12);
    let cylinder = contact.contact(&u, 1);
    assert_eq!(cylinder.sites, 63);
    assert!((cylinder.across - 3.0).abs() < 1e-12, "{cylinder:?}");
    assert_eq!(contact.contact(&u, 2).sites, 441);
    contact.impactors[0].shape = ImpactorShape::Sphere {
        center,
        radius: 0.9,
    };
    assert_eq!(contact.contact(&u, 0), ContactPatch::default());
}

#[test]
fn forces_derive_from_the_energy_and_are_opposite() {
    let contact = impact(3000);
    let u = displacement(3003 * 3);
    let mut force = vec![0.0; u.len()];
    contact.add_force(&u, &mut force);
    let touched = |k: usize| force[(3000 + k) * 3..][..3].iter().any(|f| *f != 0.0);
    assert!((0..3).all(touched));
    for axis in 0..3 {
        let of_axis = || force.iter().skip(axis).step_by(3);
        let size: f64 = of_axis().map(|f| f.abs()).sum();
        assert!(of_axis().sum::<f64>().abs() < 1e-13 * size);
    }
    let step: Vec<f64> = (0..u.len())
        .map(|k| 1e-6 * ((k * 7 % 11) as f64 - 5.0))
        .collect();
    let moved = |s: f64| -> Vec<f64> { u.iter().zip(&step).map(|(u, d)| u + s * d).collect() };
    let slope = 0.5 * (contact.energy(&moved(1.0)) - contact.energy(&moved(-1.0)));
    let work: f64 = force.iter().zip(&step).map(|(f, d)| f * d).sum();
    assert!(
        (slope - work).abs() < 1e-5 * work.abs(),
        "{slope:e} {work:e}"
    );
    assert!(contact.energy(&u) > 0.0);
}

#[test]
fn depths_are_those_of_the_shapes() {
    let contact = impact(1);
    let at = |k: usize, x: [f64; 3]| {
        contact.impactors[k]
            .shape
            .penetration(&Vector::from(x), 0.0)
    };
    let near = |found: Option<(f64, Vector<3>)>, depth: f64, out: [f64; 3]| {
        let (d, n) = found.expect("inside");
        assert!(
            (d - depth).abs() < 1e-14 && (n - Vector::from(out)).norm() < 1e-14,
            "{d} {n}"
        );
    };
    near(at(0, [0.6, 0.2, 0.0]), 0.3, [0.0, 1.0, 0.0]);
    assert!(at(0, [0.6, 0.51, 0.0]).is_none() && at(0, [0.6, 0.1, 0.0]).is_none());
    // any place along the axis
    near(at(1, [-0.2, 11.25, 15.0]), 0.5, [1.0, 0.0, 0.0]);
    assert!(at(1, [0.31, 11.25, 15.0]).is_none());
    near(at(2, [4.0, 5.0, -0.5]), 0.2, [0.0, 0.0, 1.0]);
    assert!(at(2, [4.0, 5.0, -0.29]).is_none());
}

#[test]
fn threads_do_not_change_a_bit() {
    let contact = impact(5000);
    let u = displacement(5003 * 3);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let mut force = vec![0.0; u.len()];
            contact.add_force(&u, &mut force);
            (force, contact.energy(&u))
        })
    };
    assert_eq!(run(1), run(3));
}

/// The largest eigenvalue of the masses and the contact alone, by the matrix of forces that are differenced.
fn largest_eigenvalue(system: &mut dyn SemiDiscrete, u: &[f64]) -> f64 {
    let n = u.len();
    let mass: Vec<f64> = (0..n).map(|k| system.mass()[k / 3]).collect();
    let mut force = |u: &[f64]| {
        let mut f = vec![0.0; n];
        system.internal_force_into(u, &mut f, Interval::AT_ONCE, FailureUpdate::Frozen);
        f
    };
    let mut matrix = DMatrix::<f64>::zeros(n, n);
    for k in 0..n {
        let moved = |s: f64| {
            let mut u = u.to_vec();
            u[k] += s * 1e-7;
            u
        };
        let (plus, minus) = (force(&moved(1.0)), force(&moved(-1.0)));
        for i in 0..n {
            matrix[(i, k)] = (plus[i] - minus[i]) / 2e-7 / (mass[i] * mass[k]).sqrt();
        }
    }
    let symmetric = (&matrix + matrix.transpose()) * 0.5;
    symmetric.symmetric_eigenvalues().max()
}

#[test]
fn the_frequency_bound_holds_and_is_not_far_off() {
    let mut contact = impact(60);
    // all that may touch counts: here every site of a small cloud does
    contact.impactors[2].shape = ImpactorShape::Plane {
        point: Vector::<3>::new(0.0, 0.0, 1.0),
        normal: Vector::<3>::new(0.0, 0.0, 1.0),
    };
    contact.stiffest_face = 1e3;
    contact.impactors.drain(..2);
    let stiffness = crate::system::BlockCsr {
        block: 3,
        row_offsets: vec![0; 61],
        ..Default::default()
    };
    let body = LinearMotion {
        stiffness,
        mass: (0..60).map(|k| 0.5 + 0.01 * f64::from(k)).collect(),
        symmetry: Symmetry::Symmetric,
    };
    let mut system = WithTerms::new(Box::new(body), vec![Arc::new(contact) as _]);
    let bound = system.rate_bounds().stiffness;
    let found = largest_eigenvalue(&mut system, &[0.0; 61 * 3]);
    assert!(found <= bound, "{found} {bound}");
    assert!(found > 0.8 * bound, "{found} {bound}");
    // the plane has the mass 3 and half of the stiffness of all sites
    let sums = system.row_sums();
    assert!(sums[60 * 3] > 0.0 && sums.len() == 61 * 3);
}
