//! Supports, springs and sections where a zone with a rim of its own meets them.

use bondline::mesh::MeshParts;
use bondline::{Condition, Material, Region, SceneBuilder, Silent, Solution};

use super::affine::{LIMIT, error, field, held};
use super::meshes::{Body, Random, SURFACE};
use super::scene;

const BODY: Body<2> = Body {
    size: [24.0, 24.0],
    edge: 2.0,
    seed: 2300,
};

/// A plate with a zone, its lattice on the left and the bottom, so that nodes of a rim lie there.
fn plate(zone: Region, coupling: &str) -> SceneBuilder {
    scene(&BODY, &mut Random::new(BODY.seed))
        .set("peridynamics.points.lattice.origin", [0.0, 0.3])
        .nonlocal(zone)
        .material("plate", Material::bond_based(1.0))
        .horizon(2.0)
        .coupling(coupling)
}

/// A plate whose sides are waves.
fn wavy() -> MeshParts {
    let mut mesh = BODY.mesh();
    for x in &mut mesh.points {
        let (a, b) = (x[0], x[1]);
        x[0] += 0.06 * (a - 12.0) * (0.4 * b).sin();
        x[1] += 0.06 * (b - 12.0) * (0.3 * a).cos();
    }
    mesh
}

/// Places of which a run says that elements of the mesh lie there in the place of points.
fn says_so(solution: &Solution, condition: &str) -> bool {
    let mut choices = solution.summary().choices.iter();
    choices.any(|told| told.choice.ends_with(&format!("beside `{condition}`")))
}

/// The reaction of a support is that of the support: none of it reaches the mesh through nodes of the rim that follow it.
#[test]
fn rims_that_end_at_a_support_leave_a_uniform_stress_exact() {
    let stress = 0.01;
    for (coupling, low) in [("splice", 3.0), ("truncated", 1.0)] {
        let solution = plate(Region::cuboid([low, 8.0], [9.0, 15.0]), coupling)
            .condition("left", Condition::displacement("left").x(0.0))
            .condition("bottom", Condition::displacement("bottom").y(0.0))
            .condition("right", Condition::traction("right").x(stress))
            .solve(&Silent)
            .unwrap();
        let error = error(&solution, |x| [stress * x[0], -stress * x[1] / 3.0, 0.0]);
        let mut reactions = solution.summary().reactions.iter();
        let left = reactions.find(|r| r.condition == "left").unwrap().force[0];
        let off = left / (-stress * BODY.size[1]) - 1.0;
        println!("{coupling}: {error:e}, reaction {off:e}");
        assert!(
            error < LIMIT && off.abs() < LIMIT,
            "{coupling} {error:e} {off:e}"
        );
    }
}

#[test]
fn zones_keep_off_a_curved_surface_that_is_held() {
    for coupling in ["truncated", "splice", "balanced", "blending"] {
        let mut scene = plate(Region::cuboid([9.0, 9.0], [30.0, 14.0]), coupling).mesh(wavy());
        if coupling != "truncated" && coupling != "splice" {
            scene = scene.set("zones.transition.around", 1.0);
        }
        let solution = scene
            .condition("held", held::<2>())
            .solve(&Silent)
            .unwrap_or_else(|e| panic!("{coupling}: {e}"));
        let error = error(&solution, field::<2>);
        println!("{coupling}: {error:e}");
        assert!(error < LIMIT, "{coupling}: {error:e}");
        assert!(says_so(&solution, "held"), "{coupling}");
    }
}

#[test]
fn zones_keep_off_springs() {
    let spring = |scene: SceneBuilder| {
        scene
            .condition("left", Condition::displacement("left").x(0.0))
            .condition("bottom", Condition::displacement("bottom").y(0.0))
            .condition("top", Condition::traction("top").y(0.01))
            .set("conditions.bed.spring.on", "right")
            .set("conditions.bed.spring.x", 0.02)
            .solve(&Silent)
            .unwrap()
    };
    let zone = || Region::cuboid([15.0, 8.0], [24.0, 16.0]);
    let solution = spring(plate(zone(), "truncated"));
    let alone = spring(plate(zone(), "local").set("zones.rim", "mesh"));
    let [own, wanted] = [&solution, &alone].map(|s| s.summary().energy.unwrap());
    println!("energy {own:e}, elements alone {wanted:e}");
    assert!((own / wanted - 1.0).abs() < 1e-3);
    assert!(says_so(&solution, "bed"));
}

/// Loads beyond a section are the same with a patch and without.
#[test]
fn sections_through_zone_and_rim_tell_the_load_beyond() {
    let zone = Region::ball([11.0, 12.0], 5.0);
    let scene = plate(zone, "splice")
        .condition("held", Condition::displacement("bottom").x(0.0).y(0.0))
        .condition(
            "weight",
            Condition::of("body-force")
                .set("x", "0.001 * y")
                .set("y", -0.002),
        )
        .condition("side", Condition::traction("right").x("0.001 * y"))
        .set("output.sections.level.point", [0.0, 12.3])
        .set("output.sections.level.normal", [0.0, 1.0]);
    let solution = scene.solve(&Silent).unwrap();
    let section = &solution.summary().sections[0];
    let [width, high] = BODY.size;
    let squares = 0.5 * (high * high - 12.3 * 12.3);
    // the weight along x and y, and the traction on the side
    let wanted = [
        0.001 * squares * width + 0.001 * squares,
        -0.002 * width * (high - 12.3),
    ];
    for (found, wanted) in section.force.iter().zip(wanted) {
        println!("{found:e} {wanted:e}");
        assert!((found / wanted - 1.0).abs() < 1e-10, "{found} {wanted}");
    }
}

/// Families of correspondence end at the faces of a zone, whatever steps it has.
#[test]
fn families_of_correspondence_end_at_a_staircase() {
    for radius in [3.2, 6.4] {
        let solution = plate(Region::ball([12.2, 11.7], radius), "truncated")
            .material("plate", Material::correspondence(1.0, 0.3))
            .horizon(3.0)
            .condition(
                "held",
                Condition::displacement(SURFACE)
                    .x("0.01 * x + 0.003 * y")
                    .y("0.002 * x - 0.004 * y"),
            )
            .solve(&Silent)
            .unwrap();
        let error = error(&solution, |x| {
            [0.01 * x[0] + 0.003 * x[1], 0.002 * x[0] - 0.004 * x[1], 0.0]
        });
        println!("radius {radius}: {error:e}");
        assert!(error < LIMIT, "radius {radius}: {error:e}");
    }
}

/// Balls between two planes of symmetry: steps of their staircases have one cell, whose nodes all belong to faces of lower axes.
#[test]
fn balls_between_planes_of_symmetry_leave_a_uniform_stress_exact() {
    let (stress, modulus, ratio) = (100.0, 210e3, 0.3);
    for (center, radius) in [([17.18, 14.41, 10.60], 7.17), ([15.63, 27.40, 8.51], 9.32)] {
        let solution = SceneBuilder::solid("ball")
            .set("mesh.box.min", [0.0; 3])
            .set("mesh.box.max", [40.0, 40.0, 20.0])
            .set("mesh.box.x.cells", 8)
            .set("mesh.box.y.cells", 8)
            .set("mesh.box.z.cells", 4)
            .set("mesh.box.cell", "tet4")
            .set("zones.rim", "own")
            .nonlocal(Region::ball(center, radius))
            .material("steel", Material::lps(modulus, ratio))
            .horizon(4.5)
            .coupling("truncated")
            .condition("back", Condition::displacement("back").z(0.0))
            .condition("front", Condition::displacement("front").z(0.0))
            .condition("left", Condition::displacement("left").x(0.0))
            .condition("bottom", Condition::displacement("bottom").y(0.0))
            .condition("right", Condition::traction("right").x(stress))
            .solve(&Silent)
            .unwrap_or_else(|refused| panic!("{center:?} {radius}: {refused}"));
        // plane strain
        let (along, across) = (1.0 - ratio * ratio, ratio * (1.0 + ratio));
        let strain = stress / modulus;
        let error = error(&solution, |x| {
            [strain * along * x[0], -strain * across * x[1], 0.0]
        });
        println!("{center:?} {radius}: {error:e}");
        // rows of a part take of those of the next one, along a whole staircase: rounding grows to 6e-11
        assert!(error < 1e-9, "{center:?} {radius}: {error:e}");
    }
}
