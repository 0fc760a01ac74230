//! A crack within the zone opens as in a plate of points alone on the same lattice.

use bondline::{Condition, Material, Region, SceneBuilder, Silent};

use super::meshes::Body;

/// Edge of the plate; its lattice begins half a spacing within.
const SIZE: f64 = 40.0;

/// Half the length of the crack.
const HALF: f64 = 4.0;

/// Distance from the crack at which its opening is probed.
const BESIDE: f64 = 0.5;

const STRESS: f64 = 0.01;

fn plate(edge: f64) -> SceneBuilder {
    let body = Body::<2> {
        size: [SIZE, SIZE],
        edge,
        seed: 1000,
    };
    let middle = 0.5 * SIZE;
    let mut scene = SceneBuilder::plane_stress("crack")
        .mesh(body.mesh())
        .material("plate", Material::bond_based(1.0))
        .horizon(3.0)
        .spacing(1.0)
        .set("peridynamics.points.lattice.origin", [0.5, 0.5])
        .condition("top", Condition::traction("top").y(STRESS))
        .condition("bottom", Condition::displacement("bottom").y(0.0))
        .condition("left", Condition::displacement("left").x(0.0));
    for (k, x) in openings().into_iter().enumerate() {
        scene = scene
            .probe(&format!("a{k}"), [x, middle + BESIDE])
            .probe(&format!("b{k}"), [x, middle - BESIDE]);
    }
    scene
}

fn cracked(scene: SceneBuilder) -> SceneBuilder {
    let (middle, tips) = (0.5 * SIZE, [0.5 * SIZE - HALF, 0.5 * SIZE + HALF]);
    scene.crack(
        "slit",
        Region::segment([tips[0], middle], [tips[1], middle]),
    )
}

/// Places along the crack, at points of the lattice.
fn openings() -> Vec<f64> {
    (0..8)
        .map(|k| 0.5 * SIZE - HALF + 0.5 + f64::from(k))
        .collect()
}

/// Mean jump of the displacement across the crack, over that in the plate without it.
fn opening(scene: &SceneBuilder) -> f64 {
    let jump = |scene: &SceneBuilder| {
        let solution = scene.solve(&Silent).unwrap();
        let uy = solution.table("probes").unwrap().column("uy").unwrap();
        // probes come in the order of their names: those above, then those below
        let (above, below) = uy.split_at(openings().len());
        above.iter().sum::<f64>() - below.iter().sum::<f64>()
    };
    jump(&cracked(scene.clone())) / jump(scene)
}

#[test]
fn a_crack_in_the_zone_opens_as_in_a_plate_of_points() {
    let edge = 1.0;
    let low = [0.5 * SIZE - HALF - 5.0, 0.5 * SIZE - 5.0];
    let high = [0.5 * SIZE + HALF + 5.0, 0.5 * SIZE + 5.0];
    let with_rim = plate(edge)
        .nonlocal(Region::cuboid(low, high))
        .set("zones.rim", "own")
        .coupling("truncated");
    let own = opening(&with_rim);
    let points = opening(&plate(edge).coupling("nonlocal"));
    println!("opening {own}, of points {points}: {}", own / points - 1.0);
    assert!((own / points - 1.0).abs() < 0.02, "{own} {points}");
}

#[test]
fn elements_as_large_as_the_zone_is_high_do_not_bridge_its_crack() {
    let (middle, tip) = (0.5 * SIZE, 24.0);
    let notched = |scene: SceneBuilder| {
        let notch = Region::segment([-1.0, middle], [tip, middle]);
        let scene = scene
            .crack("notch", notch)
            .probe("above", [0.5, middle + BESIDE])
            .probe("below", [0.5, middle - BESIDE]);
        let solution = scene.solve(&Silent).unwrap();
        let uy = solution.table("probes").unwrap().column("uy").unwrap();
        uy[uy.len() - 2] - uy[uy.len() - 1]
    };
    let points = notched(plate(1.0).coupling("nonlocal"));
    for (edge, half, shift) in [(5.0, 3.2, 0.1), (4.0, 4.2, 0.4)] {
        let zone = Region::cuboid([-1.0, middle - half], [tip + 6.0, middle + half]);
        let with_rim = plate(edge)
            .nonlocal(zone)
            .set("peridynamics.points.lattice.origin", [0.5, 0.5 + shift])
            .set("zones.rim", "own")
            .coupling("truncated");
        let own = notched(with_rim);
        println!("opening {own}, of points {points}: {}", own / points - 1.0);
        assert!((own / points - 1.0).abs() < 0.1, "{own} {points}");
    }
}
