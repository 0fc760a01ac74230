//! Affine fields pass the rim exactly, by every coupling, in every mesh.

use bondline::{Condition, Function, Material, Silent, Solution};

use super::meshes::{Body, Random, SURFACE};
use super::{Drawn, scene, zone};

/// Largest distance of a displacement from the affine field, over the largest displacement.
pub const LIMIT: f64 = 1e-11;

/// The gradient G of the field u = G x.
const GRADIENT: [[f64; 3]; 3] = [
    [0.011, 0.004, -0.003],
    [-0.002, 0.007, 0.005],
    [0.006, -0.001, -0.009],
];

/// A case: coupling, Poisson's ratio (none of bonds alone), edge of the elements, shape of the zone.
type Case = (&'static str, Option<f64>, f64, Drawn);

pub fn field<const D: usize>(x: &[f64; 3]) -> [f64; 3] {
    let mut u = [0.0; 3];
    for i in 0..D {
        u[i] = (0..D).map(|j| GRADIENT[i][j] * x[j]).sum();
    }
    u
}

/// The affine field on all of the surface.
pub fn held<const D: usize>() -> Condition {
    let component = |i: usize| Function::of_position(move |x| field::<D>(x)[i]);
    let on = Condition::displacement(SURFACE).x(component(0));
    match D {
        2 => on.y(component(1)),
        _ => on.y(component(1)).z(component(2)),
    }
}

/// Largest distance of a displacement from a field, over the largest displacement.
pub fn error(solution: &Solution, field: impl Fn(&[f64; 3]) -> [f64; 3]) -> f64 {
    let all = solution
        .points()
        .iter()
        .zip(solution.displacement().unwrap());
    let (mut error, mut largest) = (0.0_f64, 0.0_f64);
    for (x, u) in all {
        for (u, wanted) in u.iter().zip(field(x)) {
            error = error.max((u - wanted).abs());
            largest = largest.max(wanted.abs());
        }
    }
    error / largest
}

/// Energy of the affine field in a body of unit modulus: ½ ε:C:ε over its volume.
pub fn energy<const D: usize>(nu: f64, volume: f64) -> f64 {
    let mu = 0.5 / (1.0 + nu);
    let lambda = match D {
        2 => nu / (1.0 - nu * nu),
        _ => nu / ((1.0 + nu) * (1.0 - 2.0 * nu)),
    };
    let strain = |i: usize, j: usize| 0.5 * (GRADIENT[i][j] + GRADIENT[j][i]);
    let trace: f64 = (0..D).map(|i| strain(i, i)).sum();
    let pairs = (0..D).flat_map(|i| (0..D).map(move |j| (i, j)));
    let square: f64 = pairs.map(|(i, j)| strain(i, j) * strain(i, j)).sum();
    volume * (0.5 * lambda * trace * trace + mu * square)
}

/// Solves a case of the affine field on the surface; its errors in displacement and energy.
fn affine<const D: usize>(
    (coupling, nu, edge, shape): Case,
    (size, radius, horizon): (f64, f64, f64),
    seed: u64,
) -> [f64; 2] {
    let body = Body::<D> {
        size: [size; D],
        edge,
        seed,
    };
    let mut random = Random::new(seed);
    let material = match nu {
        None => Material::bond_based(1.0),
        Some(nu) => Material::lps(1.0, nu),
    };
    let mut scene = scene(&body, &mut random)
        .nonlocal(zone(shape, &body, radius, &mut random))
        .material("body", material)
        .horizon(horizon)
        .coupling(coupling)
        .condition("held", held::<D>());
    if !["truncated", "splice"].contains(&coupling) {
        scene = scene.set("zones.transition.around", 2.0);
    }
    let solution = scene
        .solve(&Silent)
        .unwrap_or_else(|e| panic!("{coupling} {nu:?} {edge}: {e}"));
    let pairwise = if D == 2 { 1.0 / 3.0 } else { 0.25 };
    let wanted = energy::<D>(nu.unwrap_or(pairwise), body.volume());
    [
        error(&solution, field::<D>),
        // an unsymmetric stiffness has none
        (solution.summary().energy).map_or(0.0, |energy| (energy / wanted - 1.0).abs()),
    ]
}

/// Solves cases one after another; all errors have to be below the limit.
fn all_affine<const D: usize>(cases: &[(Case, (f64, f64, f64))], seed: u64) {
    for (k, (case, sizes)) in cases.iter().enumerate() {
        let errors = affine::<D>(*case, *sizes, seed + k as u64);
        println!("{D}D {case:?}: {errors:?}");
        assert!(
            errors.iter().all(|e| *e < LIMIT),
            "{D}D {case:?}: {errors:?}"
        );
    }
}

#[test]
fn affine_fields_are_exact_in_triangles_with_truncated_bonds() {
    let sizes = (21.0, 3.6, 3.0);
    all_affine::<2>(
        &[
            (("truncated", None, 2.5, Drawn::Ball), sizes),
            (("truncated", Some(0.05), 1.0, Drawn::Angle), sizes),
            (("truncated", Some(0.2), 0.4, Drawn::Box), (12.0, 3.2, 3.0)),
            (("truncated", Some(0.3), 7.0, Drawn::Polygon), sizes),
            (("truncated", Some(0.45), 2.5, Drawn::Angle), sizes),
        ],
        100,
    );
}

#[test]
fn affine_fields_are_exact_in_triangles_with_families_that_reach_over_the_rim() {
    let (small, large) = ((28.0, 3.2, 2.0), (42.0, 5.2, 2.0));
    all_affine::<2>(
        &[
            (("splice", None, 1.0, Drawn::Polygon), small),
            (("splice", Some(0.3), 7.0, Drawn::Ball), large),
            (("splice", Some(0.45), 2.5, Drawn::Box), small),
            (("balanced", None, 2.5, Drawn::Ball), small),
            (("balanced", Some(0.2), 7.0, Drawn::Box), large),
            (("blending", None, 7.0, Drawn::Polygon), large),
            (("blending", Some(0.05), 2.5, Drawn::Box), small),
            (("partial-stress", Some(0.3), 2.5, Drawn::Ball), small),
            (("partial-stress", Some(0.3), 7.0, Drawn::Angle), large),
        ],
        200,
    );
}

#[test]
fn affine_fields_are_exact_in_tetrahedra() {
    let small = (9.0, 1.9, 2.0);
    all_affine::<3>(
        &[
            (("truncated", None, 2.5, Drawn::Ball), small),
            (("truncated", Some(0.3), 1.0, Drawn::Box), small),
            (("truncated", Some(0.1), 3.5, Drawn::Ball), (10.5, 1.8, 3.0)),
            (("splice", None, 2.5, Drawn::Ball), (12.0, 1.9, 2.0)),
        ],
        300,
    );
}

/// Strains of the uniform stress.
const STRAINS: [f64; 2] = [0.01, -0.004];

#[test]
fn tractions_pull_a_plate_as_if_it_were_of_one_piece() {
    let laws = [
        (None, "truncated"),
        (Some(0.2), "truncated"),
        (Some(0.45), "splice"),
    ];
    for (k, (nu, coupling)) in laws.into_iter().enumerate() {
        let body = Body::<2> {
            size: [24.0, 21.0],
            edge: [2.5, 1.0, 7.0][k],
            seed: 400 + k as u64,
        };
        let mut random = Random::new(body.seed);
        let material = nu.map_or(Material::bond_based(1.0), |nu| Material::lps(1.0, nu));
        let nu = nu.unwrap_or(1.0 / 3.0);
        let stress = [0, 1].map(|i| (STRAINS[i] + nu * STRAINS[1 - i]) / (1.0 - nu * nu));
        let shape = [Drawn::Angle, Drawn::Polygon, Drawn::Box][k];
        let solution = scene(&body, &mut random)
            .nonlocal(zone(shape, &body, 3.6, &mut random))
            .material("body", material)
            .horizon(2.0)
            .coupling(coupling)
            .condition("left", Condition::displacement("left").x(0.0))
            .condition("bottom", Condition::displacement("bottom").y(0.0))
            .condition("right", Condition::traction("right").x(stress[0]))
            .condition("top", Condition::traction("top").y(stress[1]))
            .solve(&Silent)
            .unwrap();
        let error = error(&solution, |x| [STRAINS[0] * x[0], STRAINS[1] * x[1], 0.0]);
        let reactions = &solution.summary().reactions;
        let reaction = |side: &str, i: usize| {
            reactions
                .iter()
                .find(|r| r.condition == side)
                .unwrap()
                .force[i]
        };
        let off = [
            reaction("left", 0) / (-stress[0] * body.size[1]) - 1.0,
            reaction("bottom", 1) / (-stress[1] * body.size[0]) - 1.0,
        ];
        println!("{coupling} {nu}: {error:e} {off:?}");
        assert!(error < LIMIT, "{coupling} {nu}: {error:e}");
        assert!(
            off.iter().all(|e| e.abs() < LIMIT),
            "{coupling} {nu}: {off:?}"
        );
    }
}

#[test]
fn a_traction_stretches_a_bar_as_if_it_were_of_one_piece() {
    for (k, coupling) in ["truncated", "splice", "truncated", "balanced"]
        .into_iter()
        .enumerate()
    {
        let body = Body::<1> {
            size: [41.0],
            edge: [0.4, 1.0, 2.5, 7.0][k],
            seed: 500 + k as u64,
        };
        let mut random = Random::new(body.seed);
        let mut scene = scene(&body, &mut random)
            .nonlocal(zone(Drawn::Box, &body, 4.0, &mut random))
            .material("bar", Material::bond_based(1.0))
            .horizon(3.0)
            .coupling(coupling)
            .condition("left", Condition::displacement("left").x(0.0))
            .condition("right", Condition::traction("right").x(STRAINS[0]));
        if coupling == "balanced" {
            scene = scene.set("zones.transition.around", 2.0);
        }
        let solution = scene
            .solve(&Silent)
            .unwrap_or_else(|e| panic!("{coupling}: {e}"));
        let error = error(&solution, |x| [STRAINS[0] * x[0], 0.0, 0.0]);
        let off = solution.summary().reactions[0].force[0] / STRAINS[0] + 1.0;
        println!("bar {coupling}: {error:e} {off:e}");
        assert!(
            error < LIMIT && off.abs() < LIMIT,
            "{coupling}: {error:e} {off:e}"
        );
    }
}
