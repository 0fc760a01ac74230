//! J2 plasticity of points and of finite elements, through scenes.

use crate::laws::{STEPS, history, refused, scene};
use crate::{column, write};

const YIELD: f64 = 5.0;
const HARDENING: f64 = 250.0;
const YOUNG: f64 = 1000.0;

fn law() -> String {
    format!(
        "plastic-correspondence]\npoisson-ratio = 0.3\nyield-stress = {YIELD}\nhardening-modulus = {HARDENING}"
    )
}

#[test]
fn a_plastic_bar_follows_its_bilinear_curve_and_keeps_what_flowed() {
    for coupling in ["nonlocal", "local", "splice"] {
        let folder = tempfile::tempdir().unwrap();
        // up to a mean strain of 1 %, and back beyond where it came from
        let steps = STEPS.replace("steps = 5", "steps = 20");
        let typed = scene(coupling, &law(), &steps).replace("0.1*t", "0.2*min(t, 1.2 - 1.4*t)");
        let found = history(folder.path(), &typed, &["a_ux", "b_ux", "right_reaction_x"]);
        let strain = |k: usize| (found[1][k] - found[0][k]) / 0.9;
        let tangent = YOUNG * HARDENING / (YOUNG + HARDENING);
        let up = |e: f64| (YOUNG * e).min(YIELD + tangent * (e - YIELD / YOUNG));
        let is_near = |k: usize, expected: f64| {
            let reaction = found[2][k];
            assert!(
                (expected - reaction).abs() < 1e-6 * YIELD,
                "{coupling} {k}: {expected} {reaction}"
            );
        };
        (1..11).for_each(|k| is_near(k, up(strain(k))));
        assert!(found[2][10] > 1.05 * YIELD && found[2][4] < 0.99 * YIELD);
        // elastic on the way back, until the other side of the grown yield surface is reached
        let (top, top_strain) = (found[2][10], strain(10));
        let mut turned = 0;
        for k in 11..21 {
            let back = top - YOUNG * (top_strain - strain(k));
            if back > -top {
                is_near(k, back);
            } else {
                turned += 1;
                is_near(
                    k,
                    -top - tangent * (top_strain - 2.0 * top / YOUNG - strain(k)),
                );
            }
        }
        assert!(turned > 0);
        // what was worked is stored or gone
        let path = folder.path().join("out/bar_history.csv");
        let [stored, work, gone] = ["stored_energy", "external_work", "dissipated_energy"]
            .map(|name| *column(&path, name).last().unwrap());
        assert!(
            (stored + gone - work).abs() < 2e-2 * work,
            "{coupling}: {stored} {gone} {work}"
        );
    }
}

/// A square, or a cube, in simple shear: all of its boundary is prescribed.
const SHEAR: &str = r#"
kinematics = "{kinematics}"
coupling = "{coupling}"
{mesh}
[materials.m.plastic-correspondence]
youngs-modulus = 1000
poisson-ratio = 0.3
yield-stress = 5
hardening-modulus = 250
{zone}
[conditions.sheared.displacement]
inside.without = { from = { box = { min = {min}, max = {max} } }, removed = { box = { min = {low}, max = {high} } } }
x = "0.02*t*y"
y = 0
{z}
[output]
probes.a = { at = {inside} }
probes.b = { at = {aside} }
[solve.quasi-static]
duration = 1
steps = 8
tolerance = 1e-11
"#;

fn sheared(coupling: &str, dimension: usize) -> String {
    let all = |x: f64| format!("{:?}", vec![x; dimension]);
    let (kinematics, mesh, z) = match dimension {
        2 => (
            "plane-strain",
            "[mesh.rectangle]\nmin = [0, 0]\nmax = [10, 10]\nx = { cells = 20 }\ny = { cells = 20 }",
            "",
        ),
        _ => (
            "solid",
            "[mesh.box]\nmin = [0, 0, 0]\nmax = [10, 10, 10]\nx = { cells = 4 }\ny = { cells = 4 }\nz = { cells = 4 }",
            "z = 0",
        ),
    };
    let zone = match coupling {
        "local" => String::new(),
        // the cells of the lattice fill the zone, so that the energies of points and elements make up the body's
        _ => format!(
            "[zones.nonlocal]\nbox = {{ min = {}, max = {} }}\n[peridynamics]\nhorizon = 1.5\npoints.lattice = {{ spacing = 0.5, origin = {} }}",
            all(4.0),
            all(6.0),
            all(0.25)
        ),
    };
    SHEAR
        .replace("{kinematics}", kinematics)
        .replace("{coupling}", coupling)
        .replace("{mesh}", mesh)
        .replace("{zone}", &zone)
        .replace("{min}", &all(-1.0))
        .replace("{max}", &all(11.0))
        .replace("{low}", &all(0.1))
        .replace("{high}", &all(9.9))
        .replace("{inside}", &all(5.25))
        .replace("{aside}", &all(2.5))
        .replace("{z}", z)
}

#[test]
fn points_and_elements_flow_alike_in_simple_shear() {
    let shear = YOUNG / 2.6;
    for (coupling, dimension) in [("local", 2), ("splice", 2), ("local", 3)] {
        let folder = tempfile::tempdir().unwrap();
        let typed = sheared(coupling, dimension);
        let columns = ["stored_energy", "dissipated_energy", "a_ux", "b_ux", "a_uy"];
        let found = history(folder.path(), &typed, &columns);
        let volume = 10f64.powi(dimension as i32);
        for k in 0..=8 {
            let gamma = 0.02 * k as f64 / 8.0;
            // √3 τ = σ_y + H α beyond the yield stress, γ = τ/μ + √3 α
            let root = 3f64.sqrt();
            let alpha = ((root * shear * gamma - YIELD) / (HARDENING + 3.0 * shear)).max(0.0);
            let tau = shear * (gamma - root * alpha);
            let stored = 0.5 * (tau * tau / shear + HARDENING * alpha * alpha);
            let expected = [stored * volume, YIELD * alpha * volume];
            for (column, expected) in found.iter().zip(expected) {
                assert!(
                    (column[k] - expected).abs() < 1e-9 * 0.05 * volume,
                    "{coupling} {dimension} {k}: {} {expected}",
                    column[k]
                );
            }
            for (column, expected) in found[2..].iter().zip([gamma * 5.25, gamma * 2.5, 0.0]) {
                assert!(
                    (column[k] - expected).abs() < 1e-9,
                    "{coupling} {dimension} {k}: {} {expected}",
                    column[k]
                );
            }
        }
        assert!(*found[1].last().unwrap() > 0.02 * volume);
        // elements and points tell what they remember, and their stress
        let vtu = std::fs::read_dir(folder.path().join("out")).unwrap();
        let vtu = vtu.map(|e| e.unwrap().path()).find(|p| {
            p.extension().is_some_and(|e| e == "vtu") && p.to_string_lossy().contains('8')
        });
        let text = String::from_utf8_lossy(&std::fs::read(vtu.unwrap()).unwrap()).into_owned();
        let (_, of_cells) = text.split_once("<CellData").unwrap();
        let (of_cells, _) = of_cells.split_once("</CellData").unwrap();
        assert!(of_cells.contains("equivalent plastic strain"));
    }
}

#[test]
fn a_bar_of_elements_goes_on_from_its_checkpoint_with_what_flowed() {
    let rest = "[initial.u.velocity]\nx = \"0.5*sin(pi*x/10)\"\n[solve.explicit]\nduration = 1\noutputs = 4\ncheckpoint-every = 50\n";
    let law = law().replacen(']', "]\ndensity = 1", 1);
    let typed = scene("local", &law, rest)
        .replace("x = \"0.1*t\"", "x = 0")
        .replacen("density = 1\nyoungs", "youngs", 1);
    let whole = crate::resumes_with_the_same_bytes(&typed);
    let path = whole.path().join("out/bar_history.csv");
    let [kinetic, stored, lost] =
        ["kinetic_energy", "stored_energy", "dissipated_energy"].map(|name| column(&path, name));
    let last = kinetic.len() - 1;
    assert!(
        lost[last] > 0.05 * kinetic[0],
        "{} {}",
        lost[last],
        kinetic[0]
    );
    let balance = kinetic[last] + stored[last] + lost[last] - kinetic[0];
    assert!(
        balance.abs() < 5e-3 * kinetic[0],
        "{balance} {}",
        kinetic[0]
    );
}

#[test]
fn what_cannot_yield_on_both_sides_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |typed: &str, part: &str| refused(folder.path(), typed, part);
    // what breaking its bonds costs is not known
    let breaking = format!("{}\nfracture-energy = 0.02", law());
    refused(
        &scene("nonlocal", &breaking, STEPS),
        "`fracture-energy` is not known",
    );
    let still = |coupling: &str| scene(coupling, &law(), "").replace("\"0.1*t\"", "0.1");
    refused(&still("local"), "a static scene has no time");
    refused(&still("nonlocal"), "a static scene has no time");
    refused(&scene("balanced", &law(), STEPS), "does not balance");
    // no temperature, or one at which nothing is solid
    let cook = "johnson-cook]\npoisson-ratio = 0.3\nyield-stress = 5\nhardening-modulus = 40\nhardening-exponent = 0.5\nreference-temperature = 300\nmelting-temperature = 1300";
    refused(&scene("local", cook, STEPS), "`temperature`");
    let melted = format!("{cook}\ntemperature = 1400");
    refused(
        &scene("local", &melted, STEPS),
        "must lie above the temperature 1400",
    );
}

#[test]
fn a_bar_that_saturates_or_flows_at_a_rate_follows_its_curve() {
    let voce = "plastic-correspondence]\npoisson-ratio = 0.3\nyield-stress = 5\nhardening-modulus = 50\nsaturation-stress = 2\nsaturation-rate = 300";
    let cook = "johnson-cook]\npoisson-ratio = 0.3\nyield-stress = 5\nhardening-modulus = 40\nhardening-exponent = 0.5\ntemperature = 500\nreference-temperature = 300\nmelting-temperature = 1300\nsoftening-exponent = 2";
    let of_voce = |a: f64| 5.0 + 50.0 * a + 2.0 * (1.0 - (-300.0 * a).exp());
    let of_cook = |a: f64| (5.0 + 40.0 * a.sqrt()) * (1.0 - 0.04);
    let faster = format!("{cook}\nrate-coefficient = 0.1\nreference-rate = 1e-4");
    for coupling in ["nonlocal", "local", "splice"] {
        for (law, curve) in [(voce, &of_voce as &dyn Fn(f64) -> f64), (cook, &of_cook)] {
            let found = bar(coupling, law);
            for k in 1..=10 {
                let strain = (found[1][k] - found[0][k]) / 0.9;
                // σ = E (ε − α) and σ = σ_y(α), by bisection
                let (mut low, mut high) = (0.0, strain);
                for _ in 0..200 {
                    let a = 0.5 * (low + high);
                    match YOUNG * (strain - a) > curve(a) {
                        true => low = a,
                        false => high = a,
                    }
                }
                let stress = YOUNG * (strain - low);
                assert!(
                    (found[2][k] - stress).abs() < 1e-6 * stress,
                    "{coupling}, {k}: {} {stress}",
                    found[2][k]
                );
            }
            assert!(found[2][10] > 1.05 * curve(0.0));
        }
        let (slow, fast) = (bar(coupling, cook), bar(coupling, &faster));
        let strains = |f: &[Vec<f64>], k: usize| (f[1][k] - f[0][k]) / 0.9;
        for k in 2..=10 {
            let alpha = |k: usize| strains(&fast, k) - fast[2][k] / YOUNG;
            let rate = (alpha(k) - alpha(k - 1)) / 0.1;
            if rate < 1e-3 {
                continue;
            }
            let stress = of_cook(alpha(k)) * (1.0 + 0.1 * (rate / 1e-4).ln());
            assert!(
                (fast[2][k] - stress).abs() < 1e-5 * stress,
                "{coupling}, {k}: {} {stress}",
                fast[2][k]
            );
        }
        assert!(fast[2][10] > 1.2 * slow[2][10]);
    }
}

/// Displacements of the probes and the reaction of a bar that is pulled to a mean strain of 2 % in ten steps.
fn bar(coupling: &str, law: &str) -> Vec<Vec<f64>> {
    let folder = tempfile::tempdir().unwrap();
    let steps = STEPS.replace("steps = 5", "steps = 10");
    let typed = scene(coupling, law, &steps).replace("0.1*t", "0.2*t");
    history(folder.path(), &typed, &["a_ux", "b_ux", "right_reaction_x"])
}

#[test]
fn a_plate_in_plane_stress_yields_at_its_yield_stress() {
    // pulled along x, free along y and out of the plane: the bilinear curve of a bar
    let folder = tempfile::tempdir().unwrap();
    let typed = r#"
kinematics = "plane-stress"
coupling = "local"
mesh.rectangle = { min = [0, 0], max = [4, 4], x = { cells = 4 }, y = { cells = 4 } }
[materials.m.plastic-correspondence]
youngs-modulus = 1000
poisson-ratio = 0.3
yield-stress = 5
hardening-modulus = 250
[conditions.left.displacement]
on = "left"
x = 0
[conditions.low.displacement]
on = "bottom"
y = 0
[conditions.right.displacement]
on = "right"
x = "0.04*t"
[output]
probes.a = { at = [4, 4] }
[solve.quasi-static]
duration = 1
steps = 8
tolerance = 1e-11
"#;
    let found = history(folder.path(), typed, &["right_reaction_x", "a_uy"]);
    let tangent = YOUNG * HARDENING / (YOUNG + HARDENING);
    for k in 1..=8 {
        let strain = 0.01 * k as f64 / 8.0;
        let stress = (YOUNG * strain).min(YIELD + tangent * (strain - YIELD / YOUNG));
        assert!(
            (found[0][k] - 4.0 * stress).abs() < 1e-7 * stress,
            "{k}: {} {stress}",
            found[0][k]
        );
        // the plastic strain keeps its volume
        let across = -0.3 * stress / YOUNG - 0.5 * (strain - stress / YOUNG);
        assert!(
            (found[1][k] - 4.0 * across).abs() < 1e-8,
            "{k}: {} {across}",
            found[1][k]
        );
    }
}

/// A cantilever of elements under a force at its end, in four load steps.
fn cantilever(cell: &str, law: &str) -> String {
    let (kinematics, mesh, fixed, force) = match cell {
        "quad8" | "tri6" => (
            "plane-strain",
            "[mesh.rectangle]\nmin = [0, 0]\nmax = [4, 1]\nx = { cells = 4 }\ny = { cells = 1 }",
            "",
            "y = \"0.1*t\"",
        ),
        _ => (
            "solid",
            "[mesh.box]\nmin = [0, 0, 0]\nmax = [4, 1, 1]\nx = { cells = 4 }\ny = { cells = 1 }\nz = { cells = 1 }",
            "z = 0",
            "y = \"0.1*t\"\nz = \"0.05*t\"",
        ),
    };
    format!(
        "kinematics = \"{kinematics}\"\ncoupling = \"local\"\n{mesh}\ncell = \"{cell}\"\n[materials.m.{law}\nyoungs-modulus = 1000\npoisson-ratio = 0.3\n[conditions.left.displacement]\non = \"left\"\nx = 0\ny = 0\n{fixed}\n[conditions.right.traction]\non = \"right\"\n{force}\n[solve.quasi-static]\nduration = 1\nsteps = 4\ntolerance = 1e-11\n"
    )
}

#[test]
fn cells_of_second_order_are_elastic_below_yield() {
    // with the mean dilatation of a cell they would not resist dilatations that vary within it
    for cell in ["quad8", "tri6", "hex20", "tet10"] {
        let work = |law: &str| {
            let folder = tempfile::tempdir().unwrap();
            let typed = cantilever(cell, law);
            let found = history(folder.path(), &typed, &["stored_energy", "external_work"]);
            [found[0][4], found[1][4]]
        };
        let plastic = work("plastic-correspondence]\nyield-stress = 1e6\nhardening-modulus = 0");
        let linear = work("lps]");
        for (plastic, linear) in plastic.into_iter().zip(linear) {
            assert!(
                (plastic / linear - 1.0).abs() < 1e-9,
                "{cell}: {plastic} {linear}"
            );
        }
    }
}

/// A plate that is turned by 20 degrees, by all of its sites.
const TURNED: &str = r#"
kinematics = "plane-strain"
coupling = "nonlocal"
mesh.rectangle = { min = [0, 0], max = [2, 1], x = { cells = 8 }, y = { cells = 4 } }
materials.m.{law}
peridynamics = { horizon = 0.5, points.lattice = { spacing = 0.25, origin = [0.125, 0.125] } }
[conditions.all.displacement]
inside.everywhere = true
x = "x*(cos(0.349*t) - 1) - y*sin(0.349*t)"
y = "x*sin(0.349*t) + y*(cos(0.349*t) - 1)"
[solve.quasi-static]
steps = 4
[output]
vtu = false
"#;

#[test]
fn points_for_small_rotations_are_warned_of_whatever_their_law() {
    let folder = tempfile::tempdir().unwrap();
    let elastic = "youngs-modulus = 200e3, poisson-ratio = 0.3";
    let laws = [
        ("lps", "", "bonds = \"exact\""),
        (
            "pave",
            ", relaxing-share = 0.5, relaxation-time = 1",
            "bonds = \"exact\"",
        ),
        (
            "plastic-correspondence",
            ", yield-stress = 300",
            "strains = \"large\"",
        ),
        (
            "damage-correspondence",
            ", tensile-strength = 3, fracture-energy = 1",
            "a hyperelastic one",
        ),
    ];
    for (law, numbers, remedy) in laws {
        let typed = TURNED.replace("{law}", &format!("{law} = {{ {elastic}{numbers} }}"));
        let told = crate::laws::summary(folder.path(), &typed)["warnings"].to_string();
        let told = told.replace("\\", "");
        assert!(
            told.contains("has rotated by 20.0 degrees") && told.contains(remedy),
            "{law}: {told}"
        );
        assert!(
            !told.contains("exact bonds of the nonlocal zone"),
            "{law}: {told}"
        );
        // and stopped where the scene says so
        let limited = typed.replace("steps = 4", "steps = 4\nlargest-rotation = 7");
        write(folder.path(), "limited.toml", &limited);
        let output = crate::bondline(folder.path())
            .args(["run", "limited.toml"])
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(3), "{law}");
    }
    let free = [
        "lps = { ELASTIC }".to_owned(),
        "plastic-correspondence = { ELASTIC, yield-stress = 300, strains = \"large\" }".to_owned(),
        "neo-hooke = { ELASTIC }".to_owned(),
    ];
    for law in free {
        let law = law.replace("ELASTIC", elastic);
        let mut typed = TURNED.replace("{law}", &law);
        if law.starts_with("lps") {
            typed = typed.replace("horizon = 0.5", "horizon = 0.5, bonds = \"exact\"");
        }
        let told = crate::laws::summary(folder.path(), &typed)["warnings"].to_string();
        assert!(!told.contains("rotated"), "{law}: {told}");
    }
}

/// A body that begins where it has flowed dissipated energy to get there, which nothing of the run has to account for.
#[test]
fn a_body_that_begins_beyond_its_yield_gains_no_energy() {
    let folder = tempfile::tempdir().unwrap();
    let bar = r#"
kinematics = "plane-strain"
coupling = "local"
mesh.rectangle = { min = [0, 0], max = [10, 1], x = { cells = 20 }, y = { cells = 2 } }
materials.m.plastic-correspondence = { youngs-modulus = 1000, poisson-ratio = 0.3, density = 1, yield-stress = 5, hardening-modulus = 50 }
"#;
    let swings = format!(
        "{bar}[initial.a.displacement]\nx = \"0.02*x\"\n[solve.explicit]\nduration = 2\n[output]\nvtu = false\n"
    );
    let told = crate::laws::summary(folder.path(), &swings);
    let motion = &told["motion"];
    assert_eq!(motion["ended"], "finished", "{motion}");
    let gain = motion["energy_gain"]["largest"].as_f64().unwrap();
    assert!(gain < 1e-3, "{motion}");
    let missing = motion["missing_energy"].as_f64().unwrap();
    let inelastic = motion["inelastic_energy"].as_f64().unwrap();
    // the ends are let go at once, and what flows within a step is of first order in it
    assert!(
        inelastic > 1.0 && (missing - inelastic).abs() < 0.1 * inelastic,
        "{motion}"
    );
    let at_once = format!(
        "{bar}[conditions.left.displacement]\non = \"left\"\nx = 0\ny = 0\n[conditions.right.displacement]\non = \"right\"\nx = \"0.4 + 0.001*t\"\n[solve.quasi-static]\nsteps = 4\n[output]\nvtu = false\n"
    );
    let told = crate::laws::summary(folder.path(), &at_once);
    let warnings = told["warnings"].to_string();
    assert!(!warnings.contains("exceed the work"), "{warnings}");
    let motion = &told["motion"];
    let missing = motion["missing_energy"].as_f64().unwrap();
    let inelastic = motion["inelastic_energy"].as_f64().unwrap();
    assert!(
        inelastic > 0.01 && (missing - inelastic).abs() < 1e-3 * inelastic,
        "{motion}"
    );
}
