//! A wave through a bar, without a scene file: what a pulse at its end does in the peridynamic middle and behind it. `cargo run --release --example bar_wave`

use std::f64::consts::PI;

use bondline::{Condition, Function, Material, Region, SceneBuilder, Silent};

const MODULUS: f64 = 200e9; // Pa
const DENSITY: f64 = 7800.0; // kg/m³
const STRESS: f64 = 1e6; // Pa, the largest of the pulse
const PULSE: f64 = 80e-6; // s, how long it lasts

/// Returns d'Alembert's solution at a distance from the end before any reflection: the impulse per area on the end, a travel time ago, over ρ c.
fn displacement(distance: f64, time: f64) -> f64 {
    let speed = (MODULUS / DENSITY).sqrt();
    let s = (time - distance / speed).clamp(0.0, PULSE);
    let impulse = STRESS * (s / 2.0 - PULSE / (4.0 * PI) * (2.0 * PI * s / PULSE).sin());
    impulse / (DENSITY * speed)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let push = Function::of_time(|t| match t < PULSE {
        true => STRESS * (PI * t / PULSE).sin().powi(2),
        false => 0.0,
    });
    let solution = SceneBuilder::bar("bar_wave")
        .line(0.0, 1.5, 300)
        .material("steel", Material::bond_based(MODULUS).density(DENSITY))
        .horizon(0.015)
        .nonlocal(Region::cuboid([0.4], [0.6]))
        .condition("push", Condition::traction("left").x(push))
        .probe("middle", [0.5])
        .probe("behind", [0.9])
        .explicit(270e-6)
        .solve(&Silent)?;

    let time = solution.history("time")?;
    let largest = displacement(0.0, PULSE);
    for (probe, place) in [("middle", 0.5), ("behind", 0.9)] {
        let computed = solution.history(&format!("{probe}_ux"))?;
        let pairs = time.iter().zip(&computed);
        let off = pairs.map(|(&t, u)| (u - displacement(place, t)).abs());
        let off = off.fold(0.0, f64::max) / largest;
        println!(
            "{probe}: at most {:.3} % off d'Alembert's solution",
            100.0 * off
        );
        assert!(off < 0.005);
    }
    // what the pulse has done at the end: half of its work moves, half is stored
    let energy = |name: &str| solution.history(name).map(|e| e[e.len() - 1]);
    let (kinetic, stored) = (energy("kinetic_energy")?, energy("stored_energy")?);
    println!("kinetic energy {kinetic:.4e}, stored {stored:.4e}");
    assert!((kinetic / stored - 1.0).abs() < 0.01);
    Ok(())
}
