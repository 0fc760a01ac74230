//! Triangles and tetrahedra of second order that a rim cuts: they keep their order, with straight sides, and have positive masses.

use bondline::{CellShape, Condition, Initial, Material, Region, Silent};

use super::meshes::{Body, Random, raised};
use super::quadrilaterals::{assert_affine, told};
use super::structure::{assert_masses, assert_symmetric_and_stiff, truncated};
use super::{Drawn, scene, zone};

fn affine_fields<const D: usize>(size: f64, edges: &[f64], radius: f64, seed: u64) {
    let laws = [None, Some(0.2), Some(0.4)];
    let shapes = [Drawn::Ball, Drawn::Box, Drawn::Polygon];
    for (k, &edge) in edges.iter().enumerate() {
        let body = Body::<D> {
            size: [size; D],
            edge,
            seed: seed + k as u64,
        };
        let mut random = Random::new(body.seed);
        let (nu, coupling) = (laws[k % 3], ["truncated", "splice"][k % 2]);
        let material = nu.map_or(Material::bond_based(1.0), |nu| Material::lps(1.0, nu));
        let pairwise = if D == 2 { 1.0 / 3.0 } else { 0.25 };
        let scene = scene(&body, &mut random)
            .mesh(raised(body.mesh(), 0.0, &mut random))
            .nonlocal(zone(shapes[k % 3], &body, radius, &mut random))
            .material("body", material)
            .horizon(2.0)
            .coupling(coupling);
        let case = format!("{D}D {coupling} {nu:?} {edge}");
        // of a splice no energy is printed
        match coupling {
            "truncated" => {
                assert_affine::<D>(&case, &scene, (nu.unwrap_or(pairwise), body.volume()))
            }
            _ => {
                let held = super::affine::held::<D>();
                let solution = scene.condition("held", held).solve(&Silent).unwrap();
                let off = super::affine::error(&solution, super::affine::field::<D>);
                assert!(off < super::affine::LIMIT, "{case}: {off:e}");
            }
        }
    }
}

#[test]
fn affine_fields_are_exact() {
    affine_fields::<2>(30.0, &[2.5, 1.3, 5.0, 3.1], 3.6, 1400);
    affine_fields::<3>(13.0, &[2.6], 1.8, 1410);
}

#[test]
fn the_stiffness_is_symmetric_and_has_no_mode_but_rigid_motions() {
    let body = Body::<2> {
        size: [12.0; 2],
        edge: 2.1,
        seed: 1420,
    };
    let scene = truncated(&body, Material::lps(1.0, 0.3), Drawn::Ball);
    let scene = scene.mesh(raised(body.mesh(), 0.0, &mut Random::new(1421)));
    assert_symmetric_and_stiff::<2>(&scene, "triangles of second order");
}

fn masses<const D: usize>(body: &Body<D>, shape: Drawn) {
    let scene = truncated(body, Material::lps(1.0, 0.3), shape);
    let mesh = raised(body.mesh(), 0.0, &mut Random::new(body.seed + 1));
    assert_masses(&scene.mesh(mesh).explicit(1.0), body);
}

#[test]
fn masses_are_positive_and_those_of_the_body() {
    let shapes = [Drawn::Box, Drawn::Angle, Drawn::Polygon, Drawn::Ball];
    for (k, shape) in (0..).zip(shapes) {
        let body = Body::<2> {
            size: [16.0, 15.0],
            edge: 2.2 + 0.7 * k as f64,
            seed: 1440 + 2 * k,
        };
        masses(&body, shape);
    }
    let body = Body::<3> {
        size: [8.0; 3],
        edge: 2.7,
        seed: 1450,
    };
    masses(&body, Drawn::Ball);
}

/// A cantilever two tetrahedra of second order across, with a small zone in it and a body force along y.
fn bar(force: &str) -> bondline::SceneBuilder {
    let body = Body::<3> {
        size: [16.0, 4.0, 4.0],
        edge: 2.0,
        seed: 1430,
    };
    let mut random = Random::new(body.seed);
    scene(&body, &mut random)
        .mesh(raised(body.mesh(), 0.0, &mut random))
        .nonlocal(Region::ball([6.0, 2.0, 2.0], 0.9))
        .material("body", Material::lps(1.0, 0.3).density(1.0))
        .set("peridynamics.points.lattice.spacing", 0.5)
        .horizon(1.0)
        .set("conditions.held.displacement.on", "left")
        .set("conditions.held.displacement.x", 0)
        .set("conditions.held.displacement.y", 0)
        .set("conditions.held.displacement.z", 0)
        .set("conditions.weight.body-force.y", force)
}

/// The largest displacement of a bar along y by elements alone and with its zone.
fn largest(scene: &bondline::SceneBuilder) -> [f64; 2] {
    ["local", "truncated"].map(|coupling| {
        let solution = scene.clone().coupling(coupling).solve(&Silent).unwrap();
        let is_linear = told(&solution, "of second order are linear there");
        assert!(!is_linear, "{coupling}");
        let u = solution.displacement().unwrap();
        u.iter().map(|u| u[1]).fold(0.0, f64::max)
    })
}

#[test]
fn a_bar_two_tetrahedra_wide_swings_as_without_a_zone() {
    // a quarter of its first period, about 2π/(3.52/L² √(EI/ρA)) = 400
    let [elements, coupled] = largest(&bar("1e-6").explicit(100.0));
    println!("{}", coupled / elements);
    // 0.6 %: masses of nodes that follow are shared by other weights than their displacements
    assert!((coupled / elements - 1.0).abs() < 0.01);
}

#[test]
fn a_bar_two_tetrahedra_wide_bends_as_without_a_zone() {
    // linear ones beside the rim made a bar of three across 5 % too stiff
    let [elements, coupled] = largest(&bar("1e-6"));
    assert!(
        (coupled / elements - 1.0).abs() < 0.005,
        "{coupled} {elements}"
    );
}

/// A plate under a uniform stress that begins in equilibrium stays there, though loads are handed on by other weights than masses.
#[test]
fn a_plate_in_equilibrium_stays_at_rest_in_time() {
    let (stress, nu) = (0.01, 0.3);
    for (k, coupling) in ["splice", "truncated"].into_iter().enumerate() {
        for shape in [CellShape::Tri6, CellShape::Quad8] {
            let body = Body::<2> {
                size: [24.0, 17.0],
                edge: 2.3,
                seed: 1460 + k as u64,
            };
            let mut random = Random::new(body.seed);
            let plain = match shape {
                CellShape::Tri6 => body.mesh(),
                _ => body.boxes(0.2, 0.0),
            };
            let mesh = raised(plain, 0.0, &mut random);
            let motion = scene(&body, &mut random)
                .mesh(mesh)
                .nonlocal(Region::cuboid([9.0, 4.0], [17.0, 17.0]))
                .set("zones.skin", "free-surfaces")
                .material("body", Material::lps(1.0, nu).density(2.0))
                .horizon(2.0)
                .coupling(coupling)
                .condition("left", Condition::traction("left").x(-stress))
                .condition("right", Condition::traction("right").x(stress))
                .initial(
                    "start",
                    Initial::displacement()
                        .x(format!("{stress} * x").as_str())
                        .y(format!("{} * y", -nu * stress).as_str()),
                )
                .explicit(40.0)
                .solve(&Silent)
                .unwrap();
            let kinetic = motion.history("kinetic_energy").unwrap();
            let largest = kinetic.iter().copied().fold(0.0, f64::max);
            let stored = 0.5 * stress * stress * body.volume();
            println!("{coupling} {shape:?}: {:e}", largest / stored);
            assert!(
                largest < 1e-18 * stored,
                "{coupling} {shape:?}: {largest:e}"
            );
        }
    }
}
