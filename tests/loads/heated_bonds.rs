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
const MATERIALS: [&str; 7] = [
    "bond-based = { youngs-modulus = 200, critical-stretch = 0.011, density = 1 EXPANDS }",
    "lps = { youngs-modulus = 200, poisson-ratio = 0.3, critical-stretch = 0.011, density = 1 EXPANDS }",
    "hardening = { youngs-modulus = 200, hardening = 3000, density = 1 EXPANDS }",
    "softening-bond = { youngs-modulus = 200, tensile-strength = 1.2, fracture-energy = 0.02, density = 1 EXPANDS }",
    "continuum-damage = { youngs-modulus = 200, onset-strain = 0.004, damage-hardening = 30, density = 1 EXPANDS }",
    "viscoelastic-bond = { youngs-modulus = 200, relaxing-share = 0.5, relaxation-time = 0.3, density = 1 EXPANDS }",
    "pals = { youngs-modulus = 200, poisson-ratio = 0.3, critical-stretch = 0.011, density = 1 EXPANDS }",
];

const ALPHA: f64 = 1e-3;

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

#[test]
fn a_body_that_cools_between_walls_is_one_that_is_pulled() {
    for material in MATERIALS {
        let bonds = "bonds = \"linear\"";
        let is_notched = !["hardening", "continuum", "viscoelastic"]
            .iter()
            .any(|law| material.starts_with(law));
        let set: &[&str] = if is_notched { &[NOTCH] } else { &[] };
        let cooled = run(&strip(material, bonds, "0", Some("300 - 8*t")), set);
        let pulled = run(&strip(material, bonds, "1.5*8e-3*t", None), set);
        let reaction = |done: &Done| done.column("scene_history.csv", "right_reaction_x");
        let scale = largest(&reaction(&pulled));
        same(
            &reaction(&cooled),
            &reaction(&pulled),
            1e-6 * scale,
            material,
        );
        let [hot, cold] = [&cooled, &pulled].map(|done| done.summary.motion.as_ref().unwrap());
        assert_eq!(hot.broken_bonds, cold.broken_bonds, "{material}");
        assert_eq!(
            cold.broken_bonds > 0,
            material.contains("critical-stretch"),
            "{material}"
        );
        let scale = cold.stored_energy + cold.external_work.abs();
        for (what, a, b) in [
            ("stored", hot.stored_energy, cold.stored_energy),
            ("missing", hot.missing_energy, cold.missing_energy),
        ] {
            println!("{what} {a} {b} {material}");
            assert!((a - b).abs() < 1e-6 * scale, "{what} {a} {b} {material}");
        }
    }
}

/// Coupling, bonds and kind of run that a material takes.
fn cases_of(material: &str) -> Vec<(&'static str, &'static str, &'static str)> {
    let is_linear = ["bond-based", "lps", "pals"];
    let is_linear = is_linear.iter().any(|law| material.starts_with(law));
    let mut cases = vec![
        (
            "coupling=nonlocal",
            "bonds = \"linear\"",
            "solve.quasi-static={steps=2,tolerance=1e-12}",
        ),
        (
            "coupling=truncated",
            "bonds = \"linear\"",
            "solve.quasi-static={steps=2,tolerance=1e-12}",
        ),
        (
            "coupling=nonlocal",
            "bonds = \"linear\"",
            "solve={explicit={duration=1}}",
        ),
    ];
    if is_linear {
        let seams = [(
            "coupling=splice",
            "bonds = \"linear\"",
            "solve.quasi-static={steps=2,tolerance=1e-12}",
        )];
        cases.extend(seams);
    }
    if !material.starts_with("pals") {
        let exact = [
            (
                "coupling=nonlocal",
                "bonds = \"exact\"",
                "solve.quasi-static={steps=2,tolerance=1e-12}",
            ),
            (
                "coupling=truncated",
                "bonds = \"exact\"",
                "solve.quasi-static={steps=2,tolerance=1e-12}",
            ),
            (
                "coupling=nonlocal",
                "bonds = \"exact\"",
                "solve={explicit={duration=1}}",
            ),
        ];
        cases.extend(exact);
    }
    cases
}

#[test]
fn a_body_that_is_free_expands_without_a_force_whatever_its_bonds_do() {
    for material in MATERIALS {
        for (coupling, bonds, solve) in cases_of(material) {
            // up by 50 degrees, of which every law would know if it counted; in time the body begins as it has expanded
            let (heat, begins) = match solve.contains("explicit") {
                true => (
                    "350",
                    "initial.hot.displacement = { x = \"0.05*x\", y = \"0.05*y\" }\n",
                ),
                false => ("300 + 50*t", ""),
            };
            let free =
                "conditions.right={displacement={inside={box={min=[-1,-1],max=[0.01,3]}},x=0}}";
            let zone = "zones.nonlocal.box={min=[0.5,0.25],max=[1,0.5]}";
            let text = begins.to_owned() + &strip(material, bonds, "0", Some(heat));
            let text = text + "[output.probes]\ncorner = { at = [1.5, 0.75] }\n";
            let mut set = vec![coupling, free, solve];
            if !coupling.contains("nonlocal") {
                set.push(zone);
            }
            let done = run(&text, &set);
            let what = format!("{material} {set:?}");
            assert_eq!(
                done.summary.motion.as_ref().unwrap().broken_bonds,
                0,
                "{what}"
            );
            let last = |name: &str| *done.column("scene_history.csv", name).last().unwrap();
            let (u, v) = (last("corner_ux"), last("corner_uy"));
            let within = 1e-9;
            let expected = [1.5 * 50.0 * ALPHA, 0.75 * 50.0 * ALPHA];
            assert!((u / expected[0] - 1.0).abs() < within, "{what}: {u}");
            assert!((v / expected[1] - 1.0).abs() < within, "{what}: {v}");
            let reaction = last("left_reaction_x");
            // E α ΔT is 10
            assert!(reaction.abs() < 1e-8, "{what}: {reaction}");
        }
    }
}
