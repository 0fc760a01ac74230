//! Bonds that break, soften, harden, damage or relax under a temperature: the stretch that counts is the mechanical one.
//!
//! With linear bonds the displacement of a heated body less `α ΔT x` is that of the cold body whose supports move by `−α ΔT x`, for any law: its forces, what breaks and what it dissipates are known from a run without a temperature.

use super::{Done, run};

/// A strip of points, or of points within elements, whose ends are held or move.
const STRIP: &str = r#"
kinematics = "plane-stress"
coupling = "nonlocal"
mesh.rectangle = { min = [0, 0], max = [1.5, 0.75], x = { cells = 12 }, y = { cells = 6 } }
materials.m.MATERIAL
peridynamics = { horizon = 0.25, points.lattice.spacing = 0.125, BONDS }
conditions.left.displacement = { on = "left", x = 0 }
conditions.right.displacement = { on = "right", x = "RIGHT" }
conditions.base.symmetry = { on = "bottom" }
output.vtu = false
HEAT
[solve.quasi-static]
steps = 4
"#;

/// A notch at which bonds break before the others.
const NOTCH: &str = "cracks.notch.polyline=[[0.75,0.4],[0.75,1]]";

/// The materials of the tests: beside the notch all of them break, soften, harden, are damaged or relax at strains of 0.008.
const MATERIALS: [&str; 11] = [
    "bond-based = { youngs-modulus = 200, critical-stretch = 0.011, density = 1 EXPANDS }",
    "lps = { youngs-modulus = 200, poisson-ratio = 0.3, critical-stretch = 0.011, density = 1 EXPANDS }",
    "hardening = { youngs-modulus = 200, hardening = 3000, density = 1 EXPANDS }",
    "softening-bond = { youngs-modulus = 200, tensile-strength = 1.2, fracture-energy = 0.02, density = 1 EXPANDS }",
    "continuum-damage = { youngs-modulus = 200, onset-strain = 0.004, damage-hardening = 30, density = 1 EXPANDS }",
    "viscoelastic-bond = { youngs-modulus = 200, relaxing-share = 0.5, relaxation-time = 0.3, density = 1 EXPANDS }",
    "pals = { youngs-modulus = 200, poisson-ratio = 0.3, critical-stretch = 0.011, density = 1 EXPANDS }",
    "pave = { youngs-modulus = 200, poisson-ratio = 0.3, relaxing-share = 0.4, relaxation-time = 0.3, density = 1 EXPANDS }",
    "damage-correspondence = { youngs-modulus = 200, poisson-ratio = 0.3, tensile-strength = 1.2, fracture-energy = 0.02, density = 1 EXPANDS }",
    "plastic-correspondence = { youngs-modulus = 200, poisson-ratio = 0.3, yield-stress = 0.6, hardening-modulus = 20, density = 1 EXPANDS }",
    "viscoelastic-correspondence = { youngs-modulus = 200, poisson-ratio = 0.3, relaxing-share = 0.4, relaxation-time = 0.3, density = 1 EXPANDS }",
];

/// The last of them do not soften, and their elements have the law of their points.
const OF_ELEMENTS: usize = 2;

/// The strip of a material, heated where it has a temperature.
fn strip(material: &str, bonds: &str, right: &str, temperature: Option<&str>) -> String {
    let (expands, heat) = match temperature {
        Some(value) => (
            ", thermal-expansion = 1e-3",
            format!("temperature = {{ value = \"{value}\", reference = 300 }}"),
        ),
        None => ("", String::new()),
    };
    STRIP
        .replace("MATERIAL", &material.replace("EXPANDS", expands))
        .replace("BONDS", bonds)
        .replace("RIGHT", right)
        .replace("HEAT", &heat)
}

/// Largest of a list of numbers.
fn largest(of: &[f64]) -> f64 {
    of.iter().fold(0.0, |most, x| most.max(x.abs()))
}

fn same(a: &[f64], b: &[f64], within: f64, what: &str) {
    assert_eq!(a.len(), b.len(), "{what}");
    let off = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    let off = off.fold(0.0, f64::max);
    assert!(off <= within, "{what}: {a:?} {b:?}, off by {off:e}");
}

/// Reactions of two runs at the right end are the same, row by row.
fn same_reactions(cooled: &Done, pulled: &Done, material: &str) {
    let [cooled, pulled] =
        [cooled, pulled].map(|done| done.column("scene_history.csv", "right_reaction_x"));
    same(&cooled, &pulled, 1e-6 * largest(&pulled), material);
}

#[test]
fn elements_that_cool_between_walls_are_pulled() {
    for material in &MATERIALS[MATERIALS.len() - OF_ELEMENTS..] {
        for coupling in ["local", "splice"] {
            let zone = "zones.nonlocal.box={min=[0.5,0.25],max=[1,0.5]}";
            let coupled = format!("coupling=\"{coupling}\"");
            let set = [&coupled, zone];
            let set = if coupling == "local" { &set[..1] } else { &set };
            let bonds = "bonds = \"linear\"";
            let without = |text: String| match coupling {
                "local" => text
                    .lines()
                    .filter(|l| !l.starts_with("peri"))
                    .collect::<Vec<_>>()
                    .join("\n"),
                _ => text,
            };
            let cooled = run(
                &without(strip(material, bonds, "0", Some("300 - 8*t"))),
                set,
            );
            let pulled = run(&without(strip(material, bonds, "1.5*8e-3*t", None)), set);
            same_reactions(&cooled, &pulled, material);
        }
    }
}

#[test]
fn a_body_that_cools_between_walls_is_one_that_is_pulled() {
    for material in MATERIALS {
        let bonds = "bonds = \"linear\"";
        let is_notched = ["critical-stretch", "softening-bond", "damage-"]
            .iter()
            .any(|key| material.contains(key));
        let set: &[&str] = if is_notched { &[NOTCH] } else { &[] };
        let cooled = run(&strip(material, bonds, "0", Some("300 - 8*t")), set);
        let pulled = run(&strip(material, bonds, "1.5*8e-3*t", None), set);
        same_reactions(&cooled, &pulled, material);
        let [hot, cold] = [&cooled, &pulled].map(|done| done.summary.motion.as_ref().unwrap());
        assert_eq!(hot.broken_bonds, cold.broken_bonds, "{material}");
        assert_eq!(
            cold.broken_bonds > 0,
            material.contains("critical-stretch"),
            "{material}"
        );
        let scale = cold.stored_energy + cold.external_work.abs();
        // the control of a damaged point fades between load steps, which leaves supports a force beside equilibrium
        let within = if material.starts_with("damage-") {
            2e-3
        } else {
            1e-6
        };
        for (what, a, b) in [
            ("stored", hot.stored_energy, cold.stored_energy),
            ("missing", hot.missing_energy, cold.missing_energy),
        ] {
            println!("{what} {a} {b} {material}");
            assert!((a - b).abs() < within * scale, "{what} {a} {b} {material}");
        }
    }
}
