//! Quadrilaterals that a rim cuts: two triangles each, unless they are parallelograms.

use bondline::mesh::MeshParts;
use bondline::{CellShape, Condition, Initial, Material, Region, SceneBuilder, Silent, Solution};

use super::affine::{LIMIT, energy, error, field, held};
use super::meshes::{Body, Random, raised};
use super::structure::{assert_mass, assert_masses, assert_symmetric_and_stiff, truncated};
use super::{Drawn, scene, zone};

/// Part of an edge by which inner nodes are moved.
const MOVED: f64 = 0.28;

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
}

/// The run says how many cells became what.
fn told(solution: &Solution, words: &str) -> bool {
    let mut choices = solution.summary().choices.iter();
    choices.any(|decision| decision.choice.contains(words))
}

fn assert_affine<const D: usize>(case: &str, scene: &SceneBuilder, (nu, volume): (f64, f64)) {
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
    let halved = told(&solution, "quadrilaterals are two triangles each there");
    assert_eq!(halved, case.contains("halved"), "{case}");
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
        let case = format!("{mesh:?} {nu:?} {} halved", body.edge);
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
        assert!(told(&solution, "quadrilaterals are two triangles"));
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
        assert!(told(&solution, "are two triangles each there"));
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

/// The angle between two sides of a quadrilateral at a corner.
fn angle(x: &[[f64; 2]; 4], corner: usize) -> f64 {
    let [a, b] = [1, 3].map(|k| {
        let other = x[(corner + k) % 4];
        [other[0] - x[corner][0], other[1] - x[corner][1]]
    });
    (a[0] * b[1] - a[1] * b[0]).atan2(a[0] * b[0] + a[1] * b[1])
}

#[test]
fn halves_meet_in_the_better_diagonal() {
    let body = Body::<2> {
        size: [24.0, 15.0],
        edge: 1.5,
        seed: 1155,
    };
    let parts = body.boxes(MOVED, 0.0);
    let scene = truncated(&body, Material::bond_based(1.0), Drawn::Ball)
        .mesh(parts.clone())
        .nonlocal(Region::ball([12.1, 7.3], 4.0))
        .condition("held", Condition::displacement("left").x(0.0));
    let mesh = scene.scene().unwrap().of_dimension::<2>().unwrap().mesh;
    let position = |n: &u32| [mesh.nodes[*n as usize][0], mesh.nodes[*n as usize][1]];
    let triangles: Vec<Vec<[f64; 2]>> = (0..mesh.cell_count())
        .filter(|&c| mesh.shapes[c] == CellShape::Tri3)
        .map(|c| mesh.cell(c).iter().map(position).collect())
        .collect();
    let mut found = 0;
    for nodes in parts.blocks[1].1.chunks_exact(4) {
        let x = [0, 1, 2, 3].map(|k| {
            let [x, y, _] = parts.points[nodes[k] as usize];
            [x, y]
        });
        for apex in 0..4 {
            let [p, q] = [1, 3].map(|k| x[(apex + k) % 4]);
            let own = |t: &&Vec<[f64; 2]>| [x[apex], p, q].iter().all(|x| t.contains(x));
            if triangles.iter().any(|t| own(&t)) {
                // Delaunay's: a circle through one triangle holds no corner of the other
                let opposite = angle(&x, apex) + angle(&x, (apex + 2) % 4);
                assert!(opposite < std::f64::consts::PI + 1e-12, "{x:?} {apex}");
                found += 1;
            }
        }
    }
    println!("{found} of {} triangles", triangles.len());
    assert_eq!(found, triangles.len());
    assert!(found > 20);
}

#[test]
fn sets_and_materials_of_cells_go_with_both_halves() {
    let body = Body::<2> {
        size: [24.0, 15.0],
        edge: 2.0,
        seed: 1160,
    };
    let mut parts = body.boxes(MOVED, 0.0);
    let facets = parts.blocks[0].1.len() / 2;
    let cells = parts.blocks[1].1.chunks_exact(4).enumerate();
    let is_left = |x: f64| x < 12.0 + 1e-9;
    let left = cells.filter(|(_, nodes)| {
        let x: f64 = nodes.iter().map(|&n| parts.points[n as usize][0]).sum();
        is_left(0.25 * x)
    });
    let left: Vec<u64> = left.map(|(c, _)| (facets + c) as u64).collect();
    let count = left.len();
    parts.element_sets.push(("left half".into(), left));
    let whole = parts.mesh::<2>().unwrap();
    let set = &whole.cell_sets["left half"];
    assert_eq!(set.len(), count);
    let wanted: f64 = set.iter().map(|&c| whole.cell_volume(c as usize)).sum();
    let scene = scene(&body, &mut Random::new(body.seed))
        .mesh(parts)
        .nonlocal(Region::ball([5.6, 7.3], 2.0))
        .material("soft", Material::bond_based(1.0).set("cells", "left half"))
        .material("stiff", Material::bond_based(3.0))
        .horizon(2.0)
        .coupling("truncated")
        .condition("held", Condition::displacement("left").x(0.0))
        .scene()
        .unwrap()
        .of_dimension::<2>()
        .unwrap();
    let mesh = &scene.mesh;
    let part = |c: u32| {
        let cut = mesh.embedded.cut_cell(c as usize);
        mesh.cell_volume(c as usize) * cut.map_or(1.0, |cut| cut.fraction)
    };
    let set = &mesh.cell_sets["left half"];
    let held: f64 = set.iter().map(|&c| part(c)).sum();
    assert!((held / wanted - 1.0).abs() < 1e-13, "{held} {wanted}");
    for c in 0..mesh.cell_count() {
        let is_soft = scene.cell_material[c] == scene.cell_material[0];
        assert_eq!(set.contains(&(c as u32)), is_soft, "{:?}", mesh.centroid(c));
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
