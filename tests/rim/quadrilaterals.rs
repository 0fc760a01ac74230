//! Quadrilaterals that a rim cuts: divided about their middle, unless they are parallelograms; those of second order in two triangles.

use bondline::mesh::MeshParts;
use bondline::{Condition, Initial, Material, Region, SceneBuilder, Silent, Solution};

use super::affine::{LIMIT, energy, error, field, held};
use super::meshes::{Body, Random, raised};
use super::structure::{assert_mass, assert_masses, assert_symmetric_and_stiff, truncated};
use super::{Drawn, scene, zone};

/// Part of an edge by which inner nodes are moved.
const MOVED: f64 = 0.28;

/// Part of a sentence of a run that divides cells.
const DIVIDED: &str = "of them are divided about their middle";

/// The same of a run that halves cells.
const HALVED: &str = "quadrilaterals of second order are two triangles each";

/// Kinds of meshes.
#[derive(Clone, Copy, Debug)]
enum Mesh {
    Quadrilaterals,
    /// A third of the boxes as triangles.
    Mixed,
    /// Of second order, with curved sides inside.
    Curved,
}

impl Mesh {
    fn of(self, body: &Body<2>) -> MeshParts {
        match self {
            Self::Quadrilaterals => body.boxes(MOVED, 0.0),
            Self::Mixed => body.boxes(MOVED, 0.3),
            Self::Curved => raised(body.boxes(0.2, 0.0), 0.03, &mut Random::new(body.seed)),
        }
    }

    /// The sentence about what becomes of its cells.
    fn told(self) -> &'static str {
        match self {
            Self::Quadrilaterals | Self::Mixed => DIVIDED,
            Self::Curved => HALVED,
        }
    }
}

/// The run says how many cells became what.
pub fn told(solution: &Solution, words: &str) -> bool {
    let mut choices = solution.summary().choices.iter();
    choices.any(|decision| decision.choice.contains(words))
}

pub fn assert_affine<const D: usize>(case: &str, scene: &SceneBuilder, (nu, volume): (f64, f64)) {
    let solution = scene
        .clone()
        .condition("held", held::<D>())
        .solve(&Silent)
        .unwrap_or_else(|e| panic!("{case}: {e}"));
    let off = error(&solution, field::<D>);
    let stored = solution.summary().energy.unwrap() / energy::<D>(nu, volume) - 1.0;
    println!("{case}: {off:e} {stored:e}");
    assert!(
        off < LIMIT && stored.abs() < LIMIT,
        "{case}: {off:e} {stored:e}"
    );
    for (words, sign) in [(DIVIDED, "divided"), (HALVED, "halved")] {
        assert_eq!(told(&solution, words), case.contains(sign), "{case}");
    }
}

#[test]
fn affine_fields_are_exact_in_quadrilaterals() {
    let laws = [None, Some(0.05), Some(0.2), Some(0.45)];
    let meshes = [Mesh::Quadrilaterals, Mesh::Mixed, Mesh::Curved];
    let shapes = [Drawn::Ball, Drawn::Angle, Drawn::Box, Drawn::Polygon];
    for k in 0..12 {
        let (nu, mesh, shape) = (laws[k % 4], meshes[k % 3], shapes[(k + k / 4) % 4]);
        let body = Body::<2> {
            size: [21.0, 20.0],
            edge: [2.5, 1.3, 5.0, 0.6][(k / 3) % 4],
            seed: 1100 + k as u64,
        };
        let mut random = Random::new(body.seed);
        // inside, with the rim at a side, and with the rim in a corner
        let drawn = match k % 4 {
            1 => Region::cuboid([2.0, 7.0], [8.0, 12.0]),
            3 => Region::cuboid([14.0, 13.0], [19.0, 18.0]),
            _ => zone(shape, &body, 3.6, &mut random),
        };
        let material = nu.map_or(Material::bond_based(1.0), |nu| Material::lps(1.0, nu));
        let scene = scene(&body, &mut random)
            .mesh(mesh.of(&body))
            .nonlocal(drawn)
            .material("body", material)
            .horizon(3.0)
            .coupling("truncated");
        let becomes = ["divided", "halved"][usize::from(matches!(mesh, Mesh::Curved))];
        let case = format!("{mesh:?} {nu:?} {} {becomes}", body.edge);
        assert_affine::<2>(&case, &scene, (nu.unwrap_or(1.0 / 3.0), body.volume()));
    }
}

#[test]
fn affine_fields_are_exact_in_quadrilaterals_with_families_that_reach_over_the_rim() {
    let cases = [
        ("splice", Some(0.3)),
        ("balanced", None),
        ("blending", None),
    ];
    for (k, (coupling, nu)) in cases.into_iter().enumerate() {
        let body = Body::<2> {
            size: [30.0; 2],
            edge: 2.5,
            seed: 1120 + k as u64,
        };
        let mut random = Random::new(body.seed);
        let material = nu.map_or(Material::bond_based(1.0), |nu| Material::lps(1.0, nu));
        let mut scene = scene(&body, &mut random)
            .mesh(Mesh::Quadrilaterals.of(&body))
            .nonlocal(zone(Drawn::Ball, &body, 3.2, &mut random))
            .material("body", material)
            .horizon(2.0)
            .coupling(coupling)
            .condition("held", held::<2>());
        if coupling != "splice" {
            scene = scene.set("zones.transition.around", 2.0);
        }
        let solution = scene.solve(&Silent).unwrap();
        let off = error(&solution, field::<2>);
        println!("{coupling}: {off:e}");
        assert!(off < LIMIT, "{coupling}: {off:e}");
        assert!(told(&solution, DIVIDED));
    }
}

/// A mesh without moved nodes, sheared; the numbers of its sides stay.
fn sheared<const D: usize>(body: &Body<D>) -> MeshParts {
    let mut mesh = body.boxes(0.0, 0.0);
    for x in &mut mesh.points {
        x[0] += 0.3 * x[1] + 0.2 * x[2];
        x[1] += 0.15 * x[2];
    }
    mesh
}

#[test]
fn parallelograms_and_parallelepipeds_are_cut_as_they_are() {
    for (nu, edge) in [(None, 2.5), (Some(0.3), 1.2)] {
        let body = Body::<2> {
            size: [20.0, 16.0],
            edge,
            seed: 1130,
        };
        let material = nu.map_or(Material::bond_based(1.0), |nu| Material::lps(1.0, nu));
        let scene = scene(&body, &mut Random::new(body.seed))
            .mesh(sheared(&body))
            .nonlocal(Region::ball([12.3, 8.1], 3.4))
            .material("body", material)
            .horizon(3.0)
            .coupling("truncated");
        let nu = nu.unwrap_or(1.0 / 3.0);
        assert_affine::<2>(&format!("parallelograms {nu}"), &scene, (nu, body.volume()));
    }
    let body = Body::<3> {
        size: [9.0; 3],
        edge: 2.7,
        seed: 1131,
    };
    let solid = scene(&body, &mut Random::new(body.seed))
        .mesh(sheared(&body))
        .nonlocal(Region::ball([6.7, 5.2, 4.4], 1.8))
        .material("body", Material::lps(1.0, 0.2))
        .horizon(2.0)
        .coupling("truncated");
    assert_affine::<3>("parallelepipeds", &solid, (0.2, body.volume()));
    assert_symmetric_and_stiff::<3>(&solid, "parallelepipeds");
}

#[test]
fn quadrilaterals_move_freely_as_rigid_bodies_alone_and_keep_their_mass() {
    let laws = [
        Material::bond_based(1.0),
        Material::lps(1.0, 0.05),
        Material::lps(1.0, 0.45),
    ];
    let meshes = [Mesh::Quadrilaterals, Mesh::Mixed, Mesh::Curved];
    for (k, (law, mesh)) in laws.into_iter().zip(meshes).enumerate() {
        let body = Body::<2> {
            size: [12.0, 11.0],
            edge: [2.5, 1.0, 3.7][k],
            seed: 1140 + k as u64,
        };
        let shape = [Drawn::Angle, Drawn::Ball, Drawn::Polygon][k];
        let inside = truncated(&body, law, shape).mesh(mesh.of(&body));
        let at_side = inside
            .clone()
            .nonlocal(Region::cuboid([8.0, 4.0], [12.0, 8.0]));
        let in_corner = inside
            .clone()
            .nonlocal(Region::cuboid([7.0, 6.0], [12.0, 11.0]));
        for (place, scene) in [("inside", inside), ("side", at_side), ("corner", in_corner)] {
            assert_symmetric_and_stiff::<2>(&scene, &format!("{mesh:?} {place}"));
            // at rest no node needs a mass
            let motion = scene.explicit(1.0);
            match mesh {
                Mesh::Quadrilaterals | Mesh::Mixed => assert_masses(&motion, &body),
                // lumped masses of curved elements have their centre elsewhere
                Mesh::Curved => drop(assert_mass(&motion, &body)),
            }
        }
    }
}

#[test]
fn loads_on_facets_that_the_rim_cuts_keep_force_and_moment() {
    let (size, high) = ([24.0, 15.0], 15.0);
    let body = Body::<2> {
        size,
        edge: 2.2,
        seed: 1150,
    };
    for mesh in [Mesh::Quadrilaterals, Mesh::Mixed, Mesh::Curved] {
        let mut parts = mesh.of(&body);
        let at = |x: f64| {
            let mut all = parts.points.iter();
            let is_there = |p: &[f64; 3]| (p[0] - x).abs() < 1e-9 && p[1].abs() < 1e-9;
            vec![all.position(is_there).unwrap() as u64]
        };
        parts.point_sets = vec![("pin".into(), at(0.0)), ("roller".into(), at(size[0]))];
        let solution = scene(&body, &mut Random::new(body.seed))
            .mesh(parts)
            .nonlocal(Region::cuboid([7.3, 9.0], [13.1, high]))
            .material("body", Material::bond_based(1.0))
            .horizon(2.0)
            .coupling("truncated")
            .condition("pin", Condition::displacement("pin").x(0.0).y(0.0))
            .condition("roller", Condition::displacement("roller").y(0.0))
            .condition(
                "top",
                Condition::traction("top")
                    .x("0.002 * x")
                    .y("0.01 + 0.001 * x"),
            )
            .solve(&Silent)
            .unwrap();
        assert!(told(&solution, mesh.told()));
        let force = |name: &str| {
            let mut all = solution.summary().reactions.iter();
            all.find(|r| r.condition == name).unwrap().force.clone()
        };
        let (pin, roller) = (force("pin"), force("roller"));
        let l = size[0];
        let (fx, fy) = (0.001 * l * l, 0.01 * l + 0.0005 * l * l);
        let moment = 0.005 * l * l + 0.001 * l.powi(3) / 3.0 - high * fx;
        let off = [
            pin[0] / -fx - 1.0,
            (pin[1] + roller[1]) / -fy - 1.0,
            roller[1] / (-moment / l) - 1.0,
        ];
        println!("{mesh:?}: {off:?}");
        assert!(off.iter().all(|off| off.abs() < 1e-11), "{mesh:?}: {off:?}");
    }
}

#[test]
fn a_plate_of_quadrilaterals_swings_without_gain() {
    let body = Body::<2> {
        size: [14.0, 13.0],
        edge: 2.5,
        seed: 1170,
    };
    for (mesh, material) in [
        (Mesh::Quadrilaterals, Material::bond_based(1.0)),
        (Mesh::Curved, Material::lps(1.0, 0.2)),
    ] {
        let inside = truncated(&body, material, Drawn::Angle)
            .mesh(mesh.of(&body))
            .initial("start", Initial::velocity().x("0.001 * x").y("-0.0005 * y"));
        let at_side = inside
            .clone()
            .nonlocal(Region::cuboid([8.0, 4.0], [14.0, 8.0]));
        for scene in [inside, at_side] {
            let motion = scene.clone().explicit(2000.0).solve(&Silent).unwrap();
            let energy = motion.history("discrete_energy").unwrap();
            let off = energy
                .iter()
                .map(|e| (e / energy[0] - 1.0).abs())
                .fold(0.0, f64::max);
            let step = |solution: &Solution| {
                let motion = solution.summary().motion.as_ref();
                motion.and_then(|motion| motion.stable_step).unwrap()
            };
            // of first order: those of second order have shorter steps of their own
            let linear = scene.mesh(Mesh::Quadrilaterals.of(&body));
            let alone = ["local", "nonlocal"].map(|model| {
                let alone = linear.clone().set("zones.rim", "mesh").coupling(model);
                step(&alone.explicit(1.0).solve(&Silent).unwrap())
            });
            let ratio = step(&motion) / alone[0].min(alone[1]);
            println!("{mesh:?}: energy {off:e}, stable step {ratio} of that of one model alone");
            assert!(off < 1e-9, "{off:e}");
            assert!(ratio > 0.75, "{ratio}");
        }
    }
}

#[test]
fn a_bar_of_two_quadrilaterals_of_second_order_bends_as_without_a_zone() {
    let body = Body::<2> {
        size: [16.0, 4.0],
        edge: 2.0,
        seed: 1180,
    };
    let scene = scene(&body, &mut Random::new(body.seed))
        .mesh(Mesh::Curved.of(&body))
        .nonlocal(Region::ball([6.0, 2.0], 0.9))
        .material("body", Material::lps(1.0, 0.3))
        .set("peridynamics.points.lattice.spacing", 0.5)
        .horizon(1.0)
        .condition("held", Condition::displacement("left").x(0.0).y(0.0))
        .condition("end", Condition::traction("right").y(1e-6));
    let [elements, coupled] = ["local", "truncated"].map(|coupling| {
        let solution = scene.clone().coupling(coupling).solve(&Silent).unwrap();
        let u = solution.displacement().unwrap();
        u.iter().map(|u| u[1]).fold(0.0, f64::max)
    });
    println!("{}", coupled / elements);
    // linear ones beside the rim make it more than a per cent too stiff
    assert!((coupled / elements - 1.0).abs() < 0.003);
}
