//! Elements along the surfaces that a zone meets, where nothing fails: a ring under pressure, beside Lamé's closed form.

use std::f64::consts::PI;

use bondline::mesh::MeshParts;
use bondline::{Condition, Material, Region, SceneBuilder, Silent, Solution};

use super::meshes::Body;

/// Radii of the ring.
const BORE: f64 = 6.0;
const OUTER: f64 = 18.0;
const PRESSURE: f64 = 1e-3;

/// A quarter of the ring in triangles of any shape: `bottom` is the bore, `left` and `right` are on the axes.
fn ring(edge: f64) -> MeshParts {
    let body = Body::<2> {
        size: [12.0, OUTER - BORE],
        edge,
        seed: 2200,
    };
    let mut mesh = body.mesh();
    for x in &mut mesh.points {
        let (angle, r) = (0.5 * PI * (1.0 - x[0] / body.size[0]), BORE + x[1]);
        *x = [r * angle.cos(), r * angle.sin(), 0.0];
    }
    mesh
}

/// A zone that holds the bore and what is within a radius of it.
fn scene(material: Material) -> SceneBuilder {
    SceneBuilder::plane_stress("ring")
        .mesh(ring(0.8))
        .nonlocal(Region::ball([0.0, 0.0], 13.0))
        .material("body", material)
        .spacing(0.5)
        .horizon(1.5)
        .condition(
            "bore",
            Condition::of("pressure")
                .set("on", "bottom")
                .set("value", PRESSURE),
        )
        // the first side lies on the axis x = 0
        .condition("x", Condition::displacement("left").x(0.0))
        .condition("y", Condition::displacement("right").y(0.0))
}

/// Energy over that of Lamé's solution for a modulus of one.
fn energy(solution: &Solution, nu: f64) -> f64 {
    let [a, b] = [BORE * BORE, OUTER * OUTER];
    let moved = PRESSURE * BORE * ((a + b) / (b - a) + nu);
    let stored = 0.5 * PRESSURE * moved * 0.5 * PI * BORE;
    solution.summary().energy.unwrap() / stored
}

fn has_skin(solution: &Solution) -> bool {
    let mut choices = solution.summary().choices.iter();
    choices.any(|told| told.choice.contains("elements along the surface"))
}

#[test]
fn a_bore_that_nothing_breaks_is_one_of_elements() {
    for (nu, material) in [
        (1.0 / 3.0, Material::bond_based(1.0)),
        (0.3, Material::lps(1.0, 0.3)),
    ] {
        let run = |scene: &SceneBuilder| scene.solve(&Silent).unwrap();
        let default = run(&scene(material.clone()));
        let without = run(&scene(material.clone()).set("zones.skin", "none"));
        let typed = run(&scene(material.clone()).set("zones.skin", "free-surfaces"));
        let alone = run(&scene(material).coupling("local"));
        let all = [&default, &typed, &without, &alone].map(|s| energy(s, nu));
        println!("{nu}: by default, typed, without, elements alone {all:?}");
        assert!((all[0] - 1.0).abs() < 0.02, "{all:?}");
        assert_eq!(all[0], all[1]);
        // an LPS stores about as much, and has other stresses
        assert!(nu == 0.3 || (all[2] - 1.0).abs() > 0.1, "{all:?}");
        assert!(has_skin(&default) && !has_skin(&without));
        // with points at the bore the error is told
        let told = |s: &Solution| {
            let mut all = s.summary().warnings.iter();
            all.any(|w| w.message.contains("a uniform stress comes out wrong by"))
        };
        assert!(told(&without) && !told(&default));
    }
}

#[test]
fn what_may_break_keeps_its_points_at_the_surface() {
    let scene = scene(Material::bond_based(1.0).fracture_energy(1.0));
    let solution = scene.load_steps(1).solve(&Silent).unwrap();
    assert!(!has_skin(&solution));
}
