//! A smooth field of elasticity converges at second order through a rim, as spacing, horizon and elements are refined together.

use bondline::{Condition, Function, Material, Region, Silent};

use super::meshes::{Body, Random, SURFACE};
use super::scene_of_spacing;

/// Size of the plate.
const SIZE: [f64; 2] = [8.0, 7.6];

/// Middle of the zone.
const MIDDLE: [f64; 2] = [4.1, 3.7];

/// Plane stress without body forces by Kolosov's `φ = a z³ + b z⁴`, `ψ = 0` and unit modulus: `2 μ u = κ φ − z φ̄′`.
fn field(x: &[f64; 3], nu: f64) -> [f64; 2] {
    let times = |a: [f64; 2], b: [f64; 2]| [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]];
    let z = [(x[0] - 3.0) / 8.0, (x[1] - 3.3) / 8.0];
    let (square, fourth) = (times(z, z), times(times(z, z), times(z, z)));
    let cube = times(square, z);
    let (a, b) = ([1.0, 0.4], [-0.3, 0.7]);
    let (a3, b4) = (times(a, cube), times(b, fourth));
    let (da, db) = (times(a, square), times(b, cube));
    let slope = [3.0 * da[0] + 4.0 * db[0], -3.0 * da[1] - 4.0 * db[1]];
    let turned = times(z, slope);
    let kappa = (3.0 - nu) / (1.0 + nu);
    [0, 1].map(|i| (1.0 + nu) * (kappa * (a3[i] + b4[i]) - turned[i]))
}

/// Root mean square of the error at probes in and around the zone, over that of the field.
fn error(coupling: &str, nu: Option<f64>, h: f64, seed: u64) -> f64 {
    let body = Body::<2> {
        size: SIZE,
        edge: 2.0 * h,
        seed,
    };
    let mut random = Random::new(seed);
    let material = nu.map_or(Material::bond_based(1.0), |nu| Material::lps(1.0, nu));
    let nu = nu.unwrap_or(1.0 / 3.0);
    let component = |i: usize| Function::of_position(move |x| field(x, nu)[i]);
    let low = MIDDLE.map(|x| x - 1.1);
    let mut scene = scene_of_spacing(&body, h, &mut random)
        .nonlocal(Region::cuboid(low, MIDDLE.map(|x| x + 1.1)))
        .material("plate", material)
        .horizon(2.0 * h)
        .coupling(coupling)
        .condition(
            "held",
            Condition::displacement(SURFACE)
                .x(component(0))
                .y(component(1)),
        );
    let mut places = Random::new(7);
    let probes: Vec<[f64; 2]> = (0..60)
        .map(|_| MIDDLE.map(|x| x + places.within(-1.8, 1.8)))
        .collect();
    for (k, probe) in probes.iter().enumerate() {
        scene = scene.probe(&format!("p{k:02}"), *probe);
    }
    let solution = scene
        .solve(&Silent)
        .unwrap_or_else(|e| panic!("{coupling} {nu} {h}: {e}"));
    let table = solution.table("probes").unwrap();
    let column = |name: &str| table.column(name).unwrap();
    let (ux, uy) = (column("ux"), column("uy"));
    let (mut off, mut all) = (0.0, 0.0);
    for (k, probe) in probes.iter().enumerate() {
        let wanted = field(&[probe[0], probe[1], 0.0], nu);
        off += (ux[k] - wanted[0]).powi(2) + (uy[k] - wanted[1]).powi(2);
        all += wanted[0].powi(2) + wanted[1].powi(2);
    }
    (off / all).sqrt()
}

#[test]
fn smooth_fields_converge_at_second_order() {
    for (coupling, nu) in [
        ("truncated", None),
        ("truncated", Some(0.2)),
        ("splice", None),
        ("splice", Some(0.3)),
    ] {
        let errors =
            [(0.2, 801), (0.1, 802), (0.05, 803)].map(|(h, seed)| error(coupling, nu, h, seed));
        let order = (errors[0] / errors[2]).log2() / 2.0;
        println!("{coupling} {nu:?}: {errors:?} order {order}");
        assert!(order > 1.8, "{coupling} {nu:?}: {errors:?}, order {order}");
    }
}
