//! Rings of several thicknesses under pressure in the bore, on meshes made here, with a peridynamic patch in the wall. `cargo run --release --example ring_study`

use bondline::mesh::MeshParts;
use bondline::{CellShape, Condition, Material, Region, SceneBuilder, Silent};

const MODULUS: f64 = 70e9; // Pa
const POISSON: f64 = 0.35;
const PRESSURE: f64 = 50e6; // Pa
const BORE: f64 = 0.1; // m, its radius
const CELLS: [u64; 2] = [20, 40]; // across the wall, and around

/// A quarter of a ring: rays of nodes from the bore outwards, the ray along x first.
fn quarter(outer: f64) -> MeshParts {
    let mut mesh = MeshParts::default();
    let (mut quads, mut bore) = (Vec::new(), Vec::new());
    for j in 0..=CELLS[1] {
        let angle = std::f64::consts::FRAC_PI_2 * j as f64 / CELLS[1] as f64;
        for i in 0..=CELLS[0] {
            let r = BORE + (outer - BORE) * i as f64 / CELLS[0] as f64;
            mesh.points.push([r * angle.cos(), r * angle.sin(), 0.0]);
            let (a, b) = (j * (CELLS[0] + 1) + i, (j + 1) * (CELLS[0] + 1) + i);
            if i < CELLS[0] && j < CELLS[1] {
                quads.extend([a, a + 1, b + 1, b]);
            }
            if i == 0 && j < CELLS[1] {
                bore.extend([a, b]);
            }
        }
    }
    let (facets, last) = (CELLS[0] * CELLS[1], CELLS[1] * (CELLS[0] + 1));
    mesh.blocks = vec![(CellShape::Quad4, quads), (CellShape::Line2, bore)];
    mesh.element_sets = vec![("bore".into(), (facets..facets + CELLS[1]).collect())];
    let ray = |first| (first..=first + CELLS[0]).collect();
    mesh.point_sets = vec![("along x".into(), ray(0)), ("along y".into(), ray(last))];
    mesh
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let bore = Condition::of("pressure").set("on", "bore");
    for outer in [0.15, 0.2, 0.3] {
        let (wall, middle) = (outer - BORE, (BORE + outer) / 8.0_f64.sqrt());
        let solution = SceneBuilder::plane_stress("ring")
            .mesh(quarter(outer))
            .material("metal", Material::lps(MODULUS, POISSON))
            .horizon(0.06 * wall)
            .nonlocal(Region::ball([middle, middle], 0.25 * wall))
            .condition("pressed", bore.clone().set("value", PRESSURE))
            .condition("low", Condition::displacement("along x").y(0))
            .condition("side", Condition::displacement("along y").x(0))
            .solve(&Silent)?;
        let at_bore = |x: &[f64; 3]| (x[0] - BORE).hypot(x[1]) < 1e-9 * BORE;
        let node = solution.points().iter().position(at_bore);
        let widened = solution.displacement()?[node.ok_or("no node")?][0];
        let (a, b) = (BORE * BORE, outer * outer);
        // Lamé's thick ring in plane stress
        let exact = PRESSURE * BORE / MODULUS * ((b + a) / (b - a) + POISSON);
        println!("outer radius {outer}: bore wider by {widened:.4e}, by Lamé {exact:.4e}");
        assert!((widened / exact - 1.0).abs() < 0.01);
    }
    Ok(())
}
