//! Elements, rows at a seam and bonds that stay linear, or whole, beyond where their material is: told with the place and the factor in every kind of run, and not before.

use crate::Case;

/// A strip under a uniform stress, which every seam holds: the strain is that of its ends.
fn strip(strain: f64, material: &str, solve: &str) -> String {
    // a motion begins in equilibrium
    let initial = match solve == EXPLICIT {
        true => format!(
            "[initial.stretched.displacement]\nx = \"{strain}*x\"\ny = \"{}*y\"",
            -strain / 3.0
        ),
        false => String::new(),
    };
    format!(
        r#"
kinematics = "plane-stress"
coupling = "splice"
mesh.rectangle = {{ min = [0, 0], max = [12, 8], x = {{ cells = 12 }}, y = {{ cells = 8 }} }}
{material}
[peridynamics]
horizon = 2.0001
points.lattice = {{ spacing = 1, origin = [0.5, 0.5] }}
[zones.nonlocal.box]
min = [4, 3]
max = [8, 6]
[conditions.left.displacement]
on = "left"
x = 0
[conditions.low.displacement]
inside.box = {{ min = [-1e-6, -1e-6], max = [1e-6, 1e-6] }}
y = 0
[conditions.right.displacement]
on = "right"
x = {}
[output]
vtu = false
{solve}
{initial}
"#,
        12.0 * strain,
    )
}

const BREAKING: &str = "materials.glass.bond-based = { youngs-modulus = 7e4, density = 1e-9, critical-stretch = 2e-3 }\nno-fail.zone.box = { min = [4, 3], max = [8, 6] }";
const LOAD_STEPS: &str = "[solve.quasi-static]\nsteps = 1";
const EXPLICIT: &str = "[solve.explicit]\nduration = 1e-10\noutputs = 1";

/// The warnings of a run.
fn warnings(text: &str, overrides: &[&str]) -> Vec<String> {
    let summary = Case::new(text).run(overrides).expect("it runs");
    let list = summary["warnings"].as_array().into_iter().flatten();
    let text = |w: &serde_json::Value| w["message"].as_str().expect("a text").to_owned();
    list.map(text).collect()
}

/// The warning with some words, if there is one.
fn told(warnings: &[String], words: &str) -> Option<String> {
    let mut found = warnings.iter().filter(|w| w.contains(words));
    let first = found.next().cloned();
    assert!(found.next().is_none(), "twice: {warnings:?}");
    first
}

/// The number before " times".
fn factor(text: &str) -> f64 {
    let end = text.find(" times").expect("a factor");
    let start = text[..end].rfind(' ').map_or(0, |at| at + 1);
    text[start..end].parse().expect("a number")
}

#[test]
fn elements_and_whole_bonds_beyond_the_critical_stretch_are_told_in_every_kind_of_run() {
    let runs = [
        (
            strip(4e-3, BREAKING, ""),
            "no bond breaks in a static scene",
        ),
        (
            strip(4e-3, BREAKING, LOAD_STEPS),
            "no bond breaks in the regions no-fail",
        ),
        (
            strip(4e-3, BREAKING, EXPLICIT),
            "no bond breaks in the regions no-fail",
        ),
    ];
    for (text, whole) in runs {
        let all = warnings(&text, &[]);
        let elements = told(&all, "finite elements are strained").expect("elements are told");
        assert!((factor(&elements) - 2.0).abs() < 0.01, "{elements}");
        // but for the cells of the zone
        assert!(elements.starts_with("84 "), "{elements}");
        assert!(
            elements.contains("zones.nonlocal") && elements.contains("glass"),
            "{elements}"
        );
        let bonds = told(&all, "the bonds of").expect("bonds are told");
        assert!((factor(&bonds) - 2.0).abs() < 0.01, "{bonds}");
        assert!(bonds.contains(whole), "{bonds}");
    }
}

#[test]
fn nothing_is_told_below_the_limit_or_under_compression() {
    // pressed by 5e-3, bonds across are stretched by a third of that
    for strain in [1.9e-3, -5e-3] {
        for solve in [LOAD_STEPS, EXPLICIT] {
            let all = warnings(&strip(strain, BREAKING, solve), &[]);
            assert_eq!(told(&all, "times"), None, "{all:?}");
        }
    }
}

/// A bar that is stretched by 2 % in load steps, all of it elements.
fn bar(material: &str, end: f64) -> String {
    format!(
        r#"
kinematics = "bar"
coupling = "local"
mesh.line = {{ min = 0, max = 2, x = {{ cells = 20 }} }}
{material}
[conditions.held.symmetry]
on = "left"
[conditions.pulled.displacement]
on = "right"
x = "{end}*t"
[output]
vtu = false
[solve.quasi-static]
steps = 4
"#
    )
}

#[test]
fn elements_of_laws_that_they_do_not_follow_are_told_with_what_they_follow() {
    let softening = "materials.m.softening-bond = { youngs-modulus = 1000, tensile-strength = 5, fracture-energy = 0.05 }";
    // the energy E ε²/2 of a bar over E ε₀²/3
    let damage = "materials.m.continuum-damage = { youngs-modulus = 1000, onset-strain = 0.01, damage-hardening = 10 }";
    // β s² = 5 % at s = 0.01
    let hardening = "materials.m.hardening = { youngs-modulus = 1000, hardening = 500 }";
    for (material, expected, instead) in [
        (softening, 4.0, "damage-correspondence"),
        (damage, 2.0 * 1.5f64.sqrt(), "damage-correspondence"),
        (hardening, 2.0, "peridynamics.elements = \"cauchy-born\""),
    ] {
        let all = warnings(&bar(material, 0.04), &[]);
        let text = told(&all, "finite elements are strained").expect("elements are told");
        assert!((factor(&text) / expected - 1.0).abs() < 1e-3, "{text}");
        assert!(text.starts_with("20 ") && text.contains(instead), "{text}");
        assert!(text.contains("at t = 1"), "{text}");
        let below = warnings(&bar(material, 0.99 * 0.04 / expected), &[]);
        assert_eq!(told(&below, "times"), None, "{below:?}");
    }
    // in compression bonds soften by their damage alone
    let pressed = |material| warnings(&bar(material, -0.04), &[]);
    assert_eq!(told(&pressed(softening), "times"), None);
    assert!(told(&pressed(damage), "times").is_some());
    // elements that follow their law are right
    let follows = "materials.m.damage-correspondence = { youngs-modulus = 1000, poisson-ratio = 0.2, tensile-strength = 5, fracture-energy = 0.05 }";
    let all = warnings(&bar(follows, 0.008), &[]);
    assert_eq!(told(&all, "times"), None, "{all:?}");
}

/// A bar whose bonds relax, with a zone.
const RELAXING: &str = r#"
kinematics = "bar"
coupling = "truncated"
mesh.line = { min = 0, max = 2, x = { cells = 20 } }
materials.m.viscoelastic-bond = { youngs-modulus = 1000, relaxing-share = 0.6, relaxation-time = 0.5 }
peridynamics = { horizon = 0.2, points.lattice.spacing = 0.1 }
zones.nonlocal.box = { min = 0.6, max = 1.4 }
conditions.held.symmetry.on = "left"
conditions.pulled.displacement = { on = "right", x = "0.002*min(1,t/0.05)" }
output.vtu = false
solve.quasi-static = { steps = 40, duration = 2 }
"#;

#[test]
fn what_does_not_relax_is_told_with_the_part_of_stress_that_its_law_loses() {
    let all = warnings(RELAXING, &[]);
    let text = told(&all, "stay elastic").expect("they are told");
    // 0.6 (1 − exp(−2/0.5))
    assert!(
        text.contains("lose 59 %") && text.starts_with("12 finite elements and"),
        "{text}"
    );
    assert!(text.contains("viscoelastic-correspondence"), "{text}");
    let local = warnings(RELAXING, &["--set", "coupling=local"]);
    let text = told(&local, "stay elastic").expect("they are told");
    assert!(text.starts_with("20 finite elements stay"), "{text}");
    // all of it relaxes, or nothing does in so short a time
    for set in ["coupling=nonlocal", "solve.quasi-static.duration=0.005"] {
        let all = warnings(RELAXING, &["--set", set]);
        assert_eq!(told(&all, "stay elastic"), None, "{set}: {all:?}");
    }
    let follows = "materials={m={viscoelastic-correspondence={youngs-modulus=1000,poisson-ratio=0.2,relaxing-share=0.6,relaxation-time=0.5}}}";
    let all = warnings(RELAXING, &["--set", follows, "--set", "coupling=local"]);
    assert_eq!(told(&all, "stay elastic"), None, "{all:?}");
}
