//! Hexahedra that a rim cuts: divided about their middle, unless all are parallelepipeds.

use std::f64::consts::PI;

use bondline::mesh::MeshParts;
use bondline::{Condition, Initial, Material, Region, Silent};

use super::affine::{LIMIT, error, field, held};
use super::meshes::{Body, Random};
use super::quadrilaterals::{assert_affine, told};
use super::structure::{assert_mass, assert_symmetric_and_stiff, truncated};
use super::{Drawn, scene, zone};

/// Part of an edge by which inner nodes are moved.
const MOVED: f64 = 0.2;

fn body(edge: f64, seed: u64) -> Body<3> {
    Body {
        size: [9.0, 8.0, 8.5],
        edge,
        seed,
    }
}

/// Hexahedra with bent faces inside; those of the surface are general quadrilaterals, too, where nodes are moved along it.
fn hexahedra(body: &Body<3>) -> MeshParts {
    let mut mesh = body.boxes(MOVED, 0.0);
    for x in &mut mesh.points {
        let s: [f64; 3] = std::array::from_fn(|i| x[i] / body.size[i]);
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let across = (2.5 * s[j] + 1.3 * s[k] + i as f64).sin();
            x[i] += 0.06 * body.size[i] * (PI * s[i]).sin() * across;
        }
    }
    mesh
}

#[test]
fn affine_fields_are_exact_in_hexahedra() {
    let cases = [
        (None, Drawn::Ball, 2.7),
        (Some(0.1), Drawn::Box, 1.3),
        (Some(0.25), Drawn::Ball, 4.0),
        (Some(0.45), Drawn::Box, 2.2),
    ];
    for (k, (nu, shape, edge)) in cases.into_iter().enumerate() {
        let body = body(edge, 2100 + k as u64);
        let mut random = Random::new(body.seed);
        // inside, and with the rim at a side
        let drawn = match k {
            3 => Region::cuboid([2.5, 2.5, 4.5], [5.5, 5.0, 7.0]),
            _ => zone(shape, &body, 1.7, &mut random),
        };
        let material = nu.map_or(Material::bond_based(1.0), |nu| Material::lps(1.0, nu));
        let scene = scene(&body, &mut random)
            .mesh(hexahedra(&body))
            .nonlocal(drawn)
            .material("body", material)
            .horizon(2.0)
            .coupling("truncated");
        let case = format!("hexahedra {nu:?} {edge} divided");
        assert_affine::<3>(&case, &scene, (nu.unwrap_or(0.25), body.volume()));
    }
}

#[test]
fn affine_fields_are_exact_in_hexahedra_with_families_that_reach_over_the_rim() {
    let body = Body::<3> {
        size: [16.0; 3],
        edge: 3.1,
        seed: 2110,
    };
    for (coupling, nu) in [("splice", Some(0.3)), ("balanced", None)] {
        let mut random = Random::new(body.seed);
        let material = nu.map_or(Material::bond_based(1.0), |nu| Material::lps(1.0, nu));
        let solution = scene(&body, &mut random)
            .mesh(hexahedra(&body))
            .nonlocal(Region::ball([8.2, 7.9, 8.1], 1.9))
            .material("body", material)
            .horizon(1.5)
            .coupling(coupling)
            .condition("held", held::<3>())
            .solve(&Silent)
            .unwrap();
        let off = error(&solution, field::<3>);
        println!("{coupling}: {off:e}");
        assert!(off < LIMIT, "{coupling}: {off:e}");
        assert!(told(&solution, "of them are divided about their middle"));
    }
}

#[test]
fn hexahedra_move_freely_as_rigid_bodies_alone_and_keep_their_mass() {
    for (k, law) in [Material::bond_based(1.0), Material::lps(1.0, 0.4)]
        .into_iter()
        .enumerate()
    {
        let body = Body::<3> {
            size: [9.0, 8.0, 8.5],
            edge: [2.7, 2.1][k],
            seed: 2120 + k as u64,
        };
        let scene = truncated(&body, law, Drawn::Ball)
            .mesh(hexahedra(&body))
            .nonlocal(Region::ball([4.4, 4.1, 4.2], 0.9));
        assert_symmetric_and_stiff::<3>(&scene, "hexahedra");
        // lumped masses of elements that are not cut have their centre elsewhere
        assert_mass(&scene.explicit(1.0), &body);
    }
}

#[test]
fn pressure_on_facets_that_the_rim_cuts_is_carried() {
    let body = body(2.4, 2130);
    let mesh = hexahedra(&body);
    let uniform = |x: &[f64; 3]| {
        // uniaxial: bond-based, E = 1, a quarter across
        let s = 1e-3;
        [-0.25 * s * x[0], -0.25 * s * x[1], s * x[2]]
    };
    let held = |axis: usize| {
        let condition = Condition::displacement(["left", "bottom", "back"][axis]);
        match axis {
            0 => condition.x(0.0),
            1 => condition.y(0.0),
            _ => condition.z(0.0),
        }
    };
    // the rim ends within the loaded side, so that its facets are cut
    let solution = scene(&body, &mut Random::new(body.seed))
        .mesh(mesh)
        .nonlocal(Region::cuboid([3.0, 2.5, 5.0], [6.0, 5.0, 7.4]))
        .material("body", Material::bond_based(1.0))
        .horizon(2.0)
        .set("peridynamics.points.lattice.origin", [0.0, 0.0, 0.0])
        .coupling("truncated")
        .condition("x", held(0))
        .condition("y", held(1))
        .condition("z", held(2))
        .condition("front", Condition::traction("front").z(1e-3))
        .solve(&Silent)
        .unwrap();
    let off = error(&solution, uniform);
    println!("{off:e}");
    assert!(off < LIMIT, "{off:e}");
    assert!(told(&solution, "of them are divided about their middle"));
}

#[test]
fn a_block_of_hexahedra_swings_without_gain() {
    let body = Body::<3> {
        size: [7.0, 6.0, 6.5],
        edge: 2.3,
        seed: 2140,
    };
    let scene = truncated(&body, Material::lps(1.0, 0.2), Drawn::Ball)
        .mesh(hexahedra(&body))
        .nonlocal(Region::ball([3.6, 3.1, 3.2], 1.2))
        .initial("start", Initial::velocity().x("0.001 * x").y("-0.0005 * y"));
    let motion = scene.clone().explicit(300.0).solve(&Silent).unwrap();
    let energy = motion.history("discrete_energy").unwrap();
    let off = energy
        .iter()
        .map(|e| (e / energy[0] - 1.0).abs())
        .fold(0.0, f64::max);
    let step = |scene: bondline::SceneBuilder| {
        let solution = scene.explicit(1.0).solve(&Silent).unwrap();
        let motion = solution.summary().motion.as_ref();
        motion.and_then(|motion| motion.stable_step).unwrap()
    };
    let alone = ["local", "nonlocal"]
        .map(|model| step(scene.clone().set("zones.rim", "mesh").coupling(model)));
    let ratio = step(scene) / alone[0].min(alone[1]);
    println!("energy {off:e}, stable step {ratio} of that of one model alone");
    assert!(off < 1e-9, "{off:e}");
    assert!(ratio > 0.6, "{ratio}");
}
