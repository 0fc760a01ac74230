//! A plate with a crack, coupled, without a scene file: how far does a pull open the crack? `cargo run --release --example cracked_plate`

use bondline::{Condition, Material, Region, SceneBuilder, Silent};

const MODULUS: f64 = 70e9; // Pa
const PULL: f64 = 1e6; // Pa

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let crack = Region::segment([-0.1, 0.0], [0.1, 0.0]);
    let held = |min, max| Condition::displacement(Region::cuboid(min, max));
    let solution = SceneBuilder::plane_stress("cracked_plate")
        .rectangle([-0.5, -0.5], [0.5, 0.5], [100, 100])
        .material("glass", Material::lps(MODULUS, 0.25))
        .horizon(0.03)
        .nonlocal(crack.clone().within(0.1))
        .crack("crack", crack)
        .condition("edge", held([-0.5, -0.01], [-0.48, 0.01]).y(0))
        .condition("head", held([-0.01, 0.49], [0.01, 0.5]).x(0))
        .condition("up", Condition::traction("top").y(PULL))
        .condition("down", Condition::traction("bottom").y(-PULL))
        .solve(&Silent)?;

    // the points just above and below the middle of the crack
    let points = solution.points().iter().zip(solution.displacement()?);
    let (above, below): (Vec<_>, Vec<_>) = points
        .filter(|(x, _)| x[0].abs() < 0.006 && x[1].abs() < 0.006)
        .partition(|(x, _)| x[1] > 0.0);
    let opening = above[0].1[1] - below[0].1[1];
    // 4 σ a / E in an endless plate, and 1.024 times that in one five times as wide as the crack, [Tada2000]
    let elastic = 1.024 * 4.0 * PULL * 0.1 / MODULUS;
    println!("{}", solution.summary());
    println!("opening {opening:.3e}, of linear elasticity {elastic:.3e}");
    assert!((opening / elastic - 1.0).abs() < 0.1);
    Ok(())
}
