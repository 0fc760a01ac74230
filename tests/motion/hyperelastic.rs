//! Hyperelastic solids of points and of finite elements at large strains and rotations, through scenes.

use crate::laws::{STEPS, history, refused, scene, summary};
use crate::{column, run, write};

const YOUNG: f64 = 1000.0;
const POISSON: f64 = 0.3;

/// The force of a bar with free sides at a stretch, per undeformed area.
fn force(law: &str, stretch: f64) -> f64 {
    if law == "st-venant-kirchhoff" {
        // S = E (λ² − 1)/2 where the sides carry none
        return YOUNG * 0.5 * (stretch * stretch - 1.0) * stretch;
    }
    let shear = 0.5 * YOUNG / (1.0 + POISSON);
    let lambda = 2.0 * shear * POISSON / (1.0 - 2.0 * POISSON);
    // the side's stretch a: μ (a² − 1) + λ ln(λ a²) = 0
    let (mut low, mut high) = (0.1, 3.0f64);
    for _ in 0..200 {
        let a = 0.5 * (low + high);
        let out = shear * (a * a - 1.0) + lambda * (stretch * a * a).ln();
        if out > 0.0 { high = a } else { low = a }
    }
    shear * (stretch - 1.0 / stretch) + lambda * (stretch * low * low).ln() / stretch
}

#[test]
fn a_bar_at_half_as_much_again_carries_the_force_of_its_stretch() {
    for law in ["neo-hooke", "st-venant-kirchhoff"] {
        for coupling in ["nonlocal", "local", "splice"] {
            let folder = tempfile::tempdir().unwrap();
            let typed = format!("{law}]\npoisson-ratio = {POISSON}");
            // grips longer than a horizon: families at a bare end lack points and strain much more than the bar
            let typed = scene(coupling, &typed, STEPS)
                .replace(
                    "on = \"left\"\nx = 0",
                    "inside.box = { min = -1, max = 0.65 }\nx = \"0.5*t*x\"",
                )
                .replace(
                    "on = \"right\"\nx = \"0.1*t\"",
                    "inside.box = { min = 9.35, max = 11 }\nx = \"0.5*t*x\"",
                );
            let found = history(folder.path(), &typed, &["a_ux", "b_ux", "right_reaction_x"]);
            for k in 1..6 {
                let stretch = 1.0 + (found[1][k] - found[0][k]) / 0.9;
                let (expected, reaction) = (force(law, stretch), found[2][k]);
                assert!(
                    (expected - reaction).abs() < 1e-7 * expected,
                    "{law}, {coupling}, {k}: {expected} {reaction}"
                );
            }
            assert!(found[1][5] - found[0][5] > 0.4 * 0.9);
        }
    }
}

/// A square that is stretched by 1.3 and 0.9 and turned by 0.7, all of its boundary prescribed.
const TURNED: &str = r#"
kinematics = "plane-strain"
coupling = "{coupling}"
mesh.rectangle = { min = [0, 0], max = [10, 10], x = { cells = 20 }, y = { cells = 20 } }
{zone}
[materials.m.{law}]
youngs-modulus = 1000
poisson-ratio = 0.3
[conditions.turned.displacement]
inside.without = { from = { box = { min = [-1, -1], max = [11, 11] } }, removed = { box = { min = [0.1, 0.1], max = [9.9, 9.9] } } }
x = "{t}*(1.3*cos(0.7)*x - 0.9*sin(0.7)*y - x)"
y = "{t}*(1.3*sin(0.7)*x + 0.9*cos(0.7)*y - y)"
[output]
probes.a = { at = [5.25, 5.25] }
probes.b = { at = [2.5, 7.5] }
"#;

fn turned(coupling: &str, law: &str, in_time: bool) -> String {
    let zone = match coupling {
        "local" => "",
        // cells of the lattice fill the zone, so that energies of points and elements make up the body's
        _ => {
            "[zones.nonlocal]\nbox = { min = [4, 4], max = [6, 6] }\n[peridynamics]\nhorizon = 1.5\npoints.lattice = { spacing = 0.5, origin = [0.25, 0.25] }"
        }
    };
    let scene = TURNED
        .replace("{coupling}", coupling)
        .replace("{law}", law)
        .replace("{zone}", zone);
    match in_time {
        true => {
            scene.replace("{t}", "t")
                + "[solve.quasi-static]\nduration = 1\nsteps = 4\ntolerance = 1e-12\n"
        }
        false => scene.replace("{t}", "1"),
    }
}

#[test]
fn points_and_elements_agree_at_a_large_stretch_and_rotation() {
    let shear = 0.5 * YOUNG / (1.0 + POISSON);
    let lambda = 2.0 * shear * POISSON / (1.0 - 2.0 * POISSON);
    let (a, b) = (1.3f64, 0.9f64);
    let log = (a * b).ln();
    let neo = 0.5 * shear * (a * a + b * b - 2.0 - 2.0 * log) + 0.5 * lambda * log * log;
    let (e, f) = (0.5 * (a * a - 1.0), 0.5 * (b * b - 1.0));
    let st_venant = 0.5 * lambda * (e + f).powi(2) + shear * (e * e + f * f);
    for (law, density) in [("neo-hooke", neo), ("st-venant-kirchhoff", st_venant)] {
        for coupling in ["local", "splice"] {
            let folder = tempfile::tempdir().unwrap();
            let names = ["stored_energy", "a_ux", "a_uy", "b_ux", "b_uy"];
            let found = history(folder.path(), &turned(coupling, law, true), &names);
            let last: Vec<f64> = found.iter().map(|c| *c.last().unwrap()).collect();
            let at = |x: f64, y: f64| {
                let (c, s) = (0.7f64.cos(), 0.7f64.sin());
                (a * c * x - b * s * y - x, a * s * x + b * c * y - y)
            };
            let ((ax, ay), (bx, by)) = (at(5.25, 5.25), at(2.5, 7.5));
            for (found, expected) in last[1..].iter().zip([ax, ay, bx, by]) {
                assert!(
                    (found - expected).abs() < 1e-10,
                    "{law}, {coupling}: {found} {expected}"
                );
            }
            assert!(
                (last[0] - 100.0 * density).abs() < 1e-9 * 100.0 * density,
                "{law}, {coupling}: {} {}",
                last[0],
                100.0 * density
            );
            // at rest at once, by Newton's method; the rows of a splice have no energy
            let told = summary(folder.path(), &turned(coupling, law, false));
            assert!(told["rotation"].is_null(), "{told}");
            let residual = told["residual"].as_f64().unwrap();
            assert!(residual < 1e-9, "{law}, {coupling}: {residual}");
            if coupling == "splice" {
                continue;
            }
            let energy = told["energy"].as_f64().unwrap();
            assert!(
                (energy - 100.0 * density).abs() < 1e-9 * 100.0 * density,
                "{law}, {coupling}: {energy} {}",
                100.0 * density
            );
        }
    }
}

#[test]
fn a_hyperelastic_bar_keeps_its_energy_as_it_swings() {
    for coupling in ["nonlocal", "local"] {
        let folder = tempfile::tempdir().unwrap();
        let rest = "[initial.u.velocity]\nx = \"2*sin(pi*x/10)\"\n[solve.explicit]\nduration = 2\noutputs = 20\n";
        let law = format!("neo-hooke]\npoisson-ratio = {POISSON}");
        let typed = scene(coupling, &law, rest).replace("x = \"0.1*t\"", "x = 0");
        history(folder.path(), &typed, &["time"]);
        let path = folder.path().join("out/bar_history.csv");
        let [kinetic, stored] = ["kinetic_energy", "stored_energy"].map(|n| column(&path, n));
        let most = stored.iter().fold(0.0, |m: f64, x| m.max(*x));
        assert!(most > 0.3 * kinetic[0], "{most} {}", kinetic[0]);
        for (k, u) in kinetic.iter().zip(&stored) {
            assert!(
                (k + u - kinetic[0]).abs() < 5e-3 * kinetic[0],
                "{coupling}: {k} {u} {}",
                kinetic[0]
            );
        }
    }
}

#[test]
fn a_hyperelastic_solid_is_refused_where_its_seam_would_not_balance() {
    let folder = tempfile::tempdir().unwrap();
    let law = format!("neo-hooke]\npoisson-ratio = {POISSON}");
    refused(
        folder.path(),
        &scene("balanced", &law, STEPS),
        "does not balance",
    );
}

#[test]
fn a_bar_that_stiffens_beyond_its_step_is_stopped_and_the_default_step_is_small_enough() {
    // pressed to 0.6 of its length its stiffness, over the undeformed length, is up to 2.8 times what it was
    let rest =
        "[initial.u.velocity]\nx = \"-0.4*x\"\n[solve.explicit]\nduration = 1\noutputs = 2\n";
    let law = "neo-hooke]\npoisson-ratio = 0.3";
    let typed = scene("local", law, rest).replace("\"0.1*t\"", "\"-4*t\"");
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", &typed);
    let said = run(folder.path(), &["bar.toml"]);
    assert!(said.contains("0.5 of the stable step"), "{said}");
    let too_large = format!("{typed}step-fraction = 0.95\n");
    write(folder.path(), "bar.toml", &too_large);
    let output = crate::bondline(folder.path())
        .args(["run", "bar.toml"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(3));
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(
        said.contains("smaller solve.explicit.step-fraction"),
        "{said}"
    );
}
