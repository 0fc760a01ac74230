//! Refusals by name of what a zone with a rim of its own does not have.

use bondline::{Condition, Material, Region, SceneBuilder, Silent};

use super::meshes::{Body, Random};
use super::scene;

const BODY: Body<2> = Body {
    size: [20.0, 20.0],
    edge: 2.5,
    seed: 900,
};

fn plate() -> SceneBuilder {
    scene(&BODY, &mut Random::new(BODY.seed))
        .nonlocal(Region::cuboid([7.0, 7.0], [13.0, 13.0]))
        .material("plate", Material::bond_based(1.0))
        .horizon(2.0)
        .coupling("truncated")
        .condition("left", Condition::displacement("left").x(0.0))
        .condition("bottom", Condition::displacement("bottom").y(0.0))
        .condition("right", Condition::traction("right").x(0.01))
}

/// Refused by the scene or its run, with each of `phrases` in the message.
fn refused(scene: &SceneBuilder, phrases: &[&str]) {
    let error = match scene.solve(&Silent) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("it ran, in spite of {phrases:?}"),
    };
    println!("{error}");
    let error = error.split_whitespace().collect::<Vec<_>>().join(" ");
    for phrase in phrases {
        assert!(error.contains(phrase), "{phrase} is not in {error}");
    }
}

#[test]
fn the_plate_itself_runs() {
    plate().solve(&Silent).unwrap();
}

#[test]
fn keys_that_do_not_go_together() {
    let rim = "a rim of its own";
    refused(
        &plate()
            .set("peridynamics.points", "cells")
            .horizon(8.0)
            .coupling("splice"),
        &[rim, "points are none"],
    );
    refused(
        &plate()
            .set("peridynamics.horizon", "2 + 0.01 * x")
            .coupling("splice"),
        &[rim, "one horizon"],
    );
}

#[test]
fn a_zone_without_cells() {
    refused(
        &plate().nonlocal(Region::cuboid([9.9, 9.9], [10.1, 10.1])),
        &["zones.rim", "no cell of the lattice"],
    );
    refused(
        &plate().nonlocal(Region::cuboid([30.0, 30.0], [36.0, 36.0])),
        &["zones.nonlocal"],
    );
}

#[test]
fn two_materials_in_the_patch() {
    let half = Region::cuboid([0.0, 0.0], [10.0, 20.0]);
    let scene = plate().material("left", Material::bond_based(2.0).cells(half));
    refused(&scene, &["two materials"]);
}

#[test]
fn cells_that_may_not_be_cut() {
    // all Jacobians are positive, and a tetrahedron about the middle is not
    let body = Body::<3> {
        size: [16.0, 8.0, 8.0],
        edge: 8.0,
        seed: 901,
    };
    let moved = [
        [-0.44, -1.79, -0.4],
        [1.73, -0.47, -1.75],
        [1.72, 1.02, -0.53],
        [-0.32, 0.81, -0.46],
        [-1.42, -1.52, 0.28],
        [0.27, -0.86, 0.45],
        [1.25, 0.69, 1.58],
        [-0.94, 1.78, 1.77],
    ];
    let mut mesh = body.boxes(0.0, 0.0);
    for x in mesh.points.iter_mut().filter(|x| x[0] < 9.0) {
        let side = |i: usize| usize::from(x[i] > 0.0);
        let corner = [[0, 1], [3, 2]][side(1)][side(0)] + 4 * side(2);
        *x = moved[corner].map(|x| 4.0 * (1.0 + x));
    }
    let solid = scene(&body, &mut Random::new(body.seed))
        .mesh(mesh)
        .nonlocal(Region::ball([4.0; 3], 0.8))
        .material("body", Material::bond_based(1.0))
        .horizon(2.0)
        .coupling("truncated")
        .condition("left", Condition::displacement("left").x(0.0).y(0.0).z(0.0));
    refused(
        &solid,
        &[
            "zones.rim",
            "is cut by the rim of the zone and is too distorted",
            "Hex8",
        ],
    );
}
