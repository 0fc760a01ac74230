//! Zones and rims that the curved surface of a body cuts.

use bondline::mesh::MeshParts;
use bondline::{Condition, Initial, Material, Region, SceneBuilder, Silent, Solution};

use super::meshes::{Body, Random, SURFACE};
use super::scene;
use super::structure::matrices;

const BODY: Body<2> = Body {
    size: [30.0, 20.0],
    edge: 2.0,
    seed: 900,
};

/// The mesh of a plate whose top is a wave, and its area by the corners of its triangles.
fn wavy(body: &Body<2>) -> (MeshParts, f64) {
    let mut mesh = body.mesh();
    for x in &mut mesh.points {
        x[1] *= 1.0 + 0.08 * (0.3 * x[0]).sin();
    }
    let triangles = &mesh.blocks[1].1;
    let area = triangles.chunks_exact(3).map(|cell| {
        let [a, b, c] = [0, 1, 2].map(|k| mesh.points[cell[k] as usize]);
        0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
    });
    let area = area.sum();
    (mesh, area)
}

/// The plate on its symmetry planes, with a zone.
fn plate(zone: Region, material: Material, coupling: &str) -> SceneBuilder {
    scene(&BODY, &mut Random::new(BODY.seed))
        .mesh(wavy(&BODY).0)
        .nonlocal(zone)
        .material("plate", material)
        .horizon(2.0)
        .coupling(coupling)
        .condition("left", Condition::displacement("left").x(0.0))
        .condition("bottom", Condition::displacement("bottom").y(0.0))
}

fn force(solution: &Solution, condition: &str) -> Vec<f64> {
    let all = solution.summary().reactions.iter();
    let mut found = all.filter(|r| r.condition == condition);
    found.next().unwrap().force.to_vec()
}

#[test]
fn a_rim_that_the_surface_cuts_carries_uniform_pressure() {
    // the zone ends a family and a little from the wave, the rim of a splice reaches farther
    for (nu, high) in [(None, 16.4), (Some(0.3), 14.2)] {
        let zone = Region::cuboid([9.0, 8.0], [21.0, high]);
        let material = nu.map_or(Material::bond_based(1.0), |nu| Material::lps(1.0, nu));
        let nu = nu.unwrap_or(1.0 / 3.0);
        let solution = plate(zone, material, "splice")
            .condition(
                "sea",
                Condition::of("pressure")
                    .set("on", SURFACE)
                    .set("value", 0.01),
            )
            .solve(&Silent)
            .unwrap();
        let strain = -0.01 * (1.0 - nu);
        let all = solution
            .points()
            .iter()
            .zip(solution.displacement().unwrap());
        let off = all.flat_map(|(x, u)| [u[0] - strain * x[0], u[1] - strain * x[1]]);
        let worst = off.fold(0.0, |worst: f64, off| worst.max(off.abs())) / (30.0 * -strain);
        println!("nu {nu}: {worst:e}");
        assert!(worst < 1e-10, "{nu}: {worst:e}");
    }
}

#[test]
fn a_zone_that_the_surface_cuts_keeps_masses_and_loads() {
    let zone = || Region::cuboid([8.0, 11.0], [19.0, 30.0]);
    let area = wavy(&BODY).1;
    for (name, material) in [
        ("bond-based", Material::bond_based(1.0)),
        ("lps", Material::lps(1.0, 0.3)),
    ] {
        let loaded = plate(zone(), material.density(2.0), "truncated")
            .condition("top", Condition::traction("top").y("0.01 + 0.001 * x"));
        let solution = loaded.solve(&Silent).unwrap();
        let alone = loaded
            .clone()
            .coupling("local")
            .set("zones.rim", "mesh")
            .solve(&Silent)
            .unwrap();
        let (own, wanted) = (force(&solution, "bottom"), force(&alone, "bottom"));
        println!("{name}: {own:?} {wanted:?}");
        assert!(
            (own[1] / wanted[1] - 1.0).abs() < 1e-11,
            "{own:?} {wanted:?}"
        );
        let energies = [&solution, &alone].map(|s| s.summary().energy.unwrap());
        println!("{name}: energy {energies:?}");
        // points at a free surface have fewer bonds
        assert!(
            (energies[0] / energies[1] - 1.0).abs() < 0.08,
            "{energies:?}"
        );
        let model = matrices::<2>(&loaded);
        let total: f64 = model.motion.mass.iter().sum();
        println!("{name}: mass {:e}", total / (2.0 * area) - 1.0);
        assert!((total / (2.0 * area) - 1.0).abs() < 1e-11);
        assert!(model.motion.mass.iter().all(|m| *m > 0.0));
    }
}

#[test]
fn a_plate_that_its_surface_cuts_swings_without_gain() {
    let zone = Region::cuboid([8.0, 11.0], [19.0, 30.0]);
    let material = Material::bond_based(1.0).density(1.0);
    let motion = plate(zone, material, "truncated")
        .initial("start", Initial::velocity().x("0.001 * x").y("-0.0005 * y"))
        .explicit(400.0)
        .solve(&Silent)
        .unwrap();
    let energy = motion.history("discrete_energy").unwrap();
    let (first, last) = (energy[0], energy[energy.len() - 1]);
    println!("energy {first:e}, off by {:e}", last / first - 1.0);
    assert!((last / first - 1.0).abs() < 1e-9);
}
