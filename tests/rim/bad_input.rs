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
    let rim = "`zones.rim = \"own\"`";
    refused(
        &plate().set("zones.skin", "free-surfaces"),
        &[rim, "`zones.skin`"],
    );
    refused(
        &plate()
            .set("peridynamics.points", "cells")
            .horizon(8.0)
            .coupling("splice"),
        &[rim, "points", "no lattice"],
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
fn springs_on_what_the_patch_covers() {
    let scene = plate()
        .nonlocal(Region::cuboid([12.0, 7.0], [20.0, 13.0]))
        .set("conditions.held.spring.on", "right")
        .set("conditions.held.spring.x", 1.0);
    refused(&scene, &["`conditions.held`", "covers a part"]);
}

#[test]
fn two_materials_in_the_patch() {
    let half = Region::cuboid([0.0, 0.0], [10.0, 20.0]);
    let scene = plate().material("left", Material::bond_based(2.0).cells(half));
    refused(&scene, &["two materials"]);
}

#[test]
fn cells_that_may_not_be_cut() {
    // the faces of hexahedra of jittered nodes are bent
    let body = Body::<3> {
        size: [8.0; 3],
        edge: 2.7,
        seed: 901,
    };
    let solid = scene(&body, &mut Random::new(body.seed))
        .mesh(body.boxes(0.1, 0.0))
        .nonlocal(Region::ball([4.0; 3], 1.8))
        .material("body", Material::bond_based(1.0))
        .horizon(2.0)
        .coupling("truncated")
        .condition("left", Condition::displacement("left").x(0.0).y(0.0).z(0.0));
    refused(
        &solid,
        &["zones.rim", "is cut by the rim of the zone", "Hex8"],
    );
}
