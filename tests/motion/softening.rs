//! Softening bonds through scenes: a notched strip that is pulled to separation, checkpoints, a beam that rotates, and what is refused.

use crate::laws::{refused, summary};
use crate::{column, run, write};

/// A strip with a notch from either side, pulled to separation; units mm, N, MPa.
const STRIP: &str = r#"
kinematics = "plane-stress"
coupling = "nonlocal"
[mesh.rectangle]
min = [-12, -10.5]
max = [12, 10.5]
x = { cells = 16 }
y = { cells = 14 }
[materials.m.softening-bond]
youngs-modulus = 30e3
tensile-strength = 3
fracture-energy = 0.01
softening = "{softening}"
[peridynamics]
horizon = 4.5
points.lattice = { spacing = 1.5, origin = [-11.25, -9.75] }
[cracks.upper]
polyline = [[0, 6], [0, 16]]
[cracks.lower]
polyline = [[0, -16], [0, -6]]
[no-fail]
left.box = { min = [-16, -16], max = [-5, 16] }
right.box = { min = [5, -16], max = [16, 16] }
[conditions.left.displacement]
inside.box = { min = [-16, -16], max = [-7.5, 16] }
x = "-{opening}/2"
y = 0
[conditions.right.displacement]
inside.box = { min = [7.5, -16], max = [16, 16] }
x = "{opening}/2"
y = 0
[solve.quasi-static]
duration = 1
steps = {steps}
when-parted = "continue"
[output]
vtu = false
"#;

#[test]
fn a_notched_strip_is_separated_by_its_strength_and_energy() {
    // more steps about the largest load than in the long tail
    for (softening, opening, steps) in [
        ("bilinear", "0.015*t^2", "12"),
        ("exponential", "0.04*t^3", "24"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let typed = STRIP
            .replace("{softening}", softening)
            .replace("{opening}", opening)
            .replace("{steps}", steps);
        write(folder.path(), "s.toml", &typed);
        let said = run(folder.path(), &["s.toml"]);
        assert!(
            said.contains("the lattice has the tensile strength 3"),
            "{said}"
        );
        assert!(!said.contains("exceed the work"), "{said}");
        let history = folder.path().join("out/s_history.csv");
        let of = |name: &str| column(&history, name);
        let (load, work, spent) = (
            of("right_reaction_x"),
            of("external_work"),
            of("dissipated_energy"),
        );
        let (ligament, last) = (12.0, load.len() - 1);
        // nothing holds the halves together any more
        assert!(load[last].abs() < 1e-6 * 3.0 * ligament, "{}", load[last]);
        let energy = spent[last] / ligament;
        assert!((energy / 0.01 - 1.0).abs() < 0.05, "{softening}: {energy}");
        assert!((work[last] / spent[last] - 1.0).abs() < 0.01, "{softening}");
        let peak = load.iter().fold(0.0, |most: f64, x| most.max(*x)) / ligament;
        assert!((peak / 3.0 - 1.0).abs() < 0.05, "{softening}: {peak}");
    }
}

#[test]
fn a_strip_goes_on_from_its_checkpoint() {
    let typed = STRIP
        .replace("{softening}", "exponential")
        .replace("{opening}", "0.01*t^2")
        .replace("{steps}", "8");
    let typed = typed
        .replace("steps = 8", "steps = 8\ncheckpoint-every = 3")
        .replace(
            "spacing = 1.5, origin = [-11.25, -9.75]",
            "spacing = 2, origin = [-11, -10]",
        )
        .replace("horizon = 4.5", "horizon = 4");
    let whole = crate::resumes_with_the_same_bytes(&typed);
    let spent = column(
        &whole.path().join("out/bar_history.csv"),
        "dissipated_energy",
    );
    assert!(*spent.last().unwrap() > 0.0);
}

#[test]
fn steps_that_are_found_bear_the_peak_of_fine_ones() {
    let folder = tempfile::tempdir().unwrap();
    let loads = |steps: &str| {
        let typed = STRIP
            .replace("{softening}", "bilinear")
            .replace("{opening}", "0.006*t")
            .replace("{steps}", steps);
        write(folder.path(), "s.toml", &typed);
        let said = run(folder.path(), &["s.toml"]);
        assert!(!steps.contains("auto") || said.contains("as long as nothing fails in them"));
        column(&folder.path().join("out/s_history.csv"), "right_reaction_x")
    };
    let [fine, found, coarse] = ["300", "\"auto\"", "10"].map(loads);
    let peak = |loads: &[f64]| loads.iter().fold(0.0, |most: f64, x| most.max(*x));
    let off = [&found, &coarse].map(|loads| peak(loads) / peak(&fine) - 1.0);
    println!("{off:?} in {} steps and 10", found.len() - 1);
    assert!(off[0].abs() < 0.01, "{off:?}");
    assert!(found.len() < 150, "{}", found.len());
}

#[test]
fn steps_that_are_found_go_on_from_a_checkpoint() {
    let typed = STRIP
        .replace("{softening}", "bilinear")
        .replace("{opening}", "0.006*t")
        .replace(
            "steps = {steps}",
            "steps = \"auto\"\naccuracy = 0.05\ncheckpoint-every = 3",
        )
        .replace(
            "spacing = 1.5, origin = [-11.25, -9.75]",
            "spacing = 2, origin = [-11, -10]",
        )
        .replace("horizon = 4.5", "horizon = 4");
    let whole = crate::resumes_with_the_same_bytes(&typed);
    let spent = column(
        &whole.path().join("out/bar_history.csv"),
        "dissipated_energy",
    );
    assert!(*spent.last().unwrap() > 0.0);
}

#[test]
fn elements_that_rotate_by_a_part_of_the_softening_stretch_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let turned = |angle: f64| {
        let typed = format!(
            "kinematics = \"plane-stress\"\ncoupling = \"splice\"\n[mesh.rectangle]\nmin = [0, 0]\nmax = [20, 10]\nx = {{ cells = 20 }}\ny = {{ cells = 10 }}\n[materials.m.softening-bond]\nyoungs-modulus = 30e3\ntensile-strength = 3\nfracture-energy = 0.01\n[zones]\nnonlocal.box = {{ min = [7, -1], max = [13, 11] }}\n[peridynamics]\nhorizon = 2\npoints.lattice = {{ spacing = 1 }}\n[conditions.left.displacement]\non = \"left\"\nx = \"(cos({angle}*t)-1)*x - sin({angle}*t)*y\"\ny = \"sin({angle}*t)*x + (cos({angle}*t)-1)*y\"\n[solve.quasi-static]\nduration = 1\nsteps = 1\n[output]\nvtu = false\n"
        );
        summary(folder.path(), &typed)["rotation"].clone()
    };
    // θ²/2 over a stretch of some 7e-5, at 0.3 degrees
    let told = turned(0.006);
    let part = told["of_failure"].as_f64().unwrap();
    assert!(part > 0.2 && part < 0.35, "{told}");
    assert!(turned(0.003).is_null());
}

#[test]
fn what_softening_bonds_cannot_do_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let typed = STRIP
        .replace("{softening}", "bilinear")
        .replace("{opening}", "0.01*t^2")
        .replace("{steps}", "8");
    let refused = |from: &str, to: &str, part: &str| {
        assert!(typed.contains(from), "{from}");
        refused(folder.path(), &typed.replace(from, to), part);
    };
    // of a continuous family 4π/9 E G/σ², here 23 mm for a tenth of the energy
    refused(
        "fracture-energy = 0.01",
        "fracture-energy = 0.0009",
        "is too large for the tensile strength 3",
    );
    refused("tensile-strength = 3\n", "", "lacks `tensile-strength`");
    refused(
        "\"bilinear\"",
        "\"linear\"",
        "use one of \"bilinear\", \"exponential\"",
    );
    refused(
        "fracture-energy = 0.01",
        "fracture-energy = 0.01\ncritical-stretch = 1e-3",
        "whose bonds break by their own damage",
    );
    refused(
        "horizon = 4.5",
        "horizon = \"4.5 + 0.01*x\"",
        "calibrated for one horizon",
    );
    refused(
        "fracture-energy = 0.01",
        "fracture-energy = -1",
        "must lie between",
    );
    refused(
        "steps = 8",
        "steps = 8\naccuracy = 0.01",
        "`solve.quasi-static.accuracy` is set and the load steps are given",
    );
    refused(
        "steps = 8",
        "steps = \"auto\"\naccuracy = 0.5",
        "must lie between 1e-5 and 0.2",
    );
    refused("steps = 8", "steps = \"aut\"", "`aut`");
}

/// A plate with a crack whose tips lie two horizons from the seam.
const CRACKED: &str = r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [-20, -20]
max = [20, 20]
x = { spacing = 2 }
y = { spacing = 2 }
[materials.glass.lps]
youngs-modulus = 70e3
poisson-ratio = 0.3
fracture-energy = 0.01
[peridynamics]
horizon = 3
points.lattice = { spacing = 1 }
[zones]
nonlocal.box = { min = [-12, -6], max = [12, 6] }
damage-at-edge = "warn"
[cracks.start]
segment = { from = [-5.5, 0], to = [5.5, 0] }
[conditions.foot.displacement]
inside.ball = { center = [0, -20], radius = 0.6 }
x = 0
[conditions.bottom.displacement]
on = "bottom"
y = 0
[conditions.top.displacement]
on = "top"
y = "5e-3 * t"
[solve.quasi-static]
steps = [0.6, 0.7, 0.74, 0.76, 0.78, 0.8, 0.82, 0.84, 0.86]
[output]
vtu = false
"#;

#[test]
fn a_crack_runs_up_to_the_seam_at_the_load_of_its_energy() {
    let folder = tempfile::tempdir().unwrap();
    let motion = |coupling: &str| {
        let typed = format!("coupling = \"{coupling}\"\n{CRACKED}");
        summary(folder.path(), &typed)["motion"].clone()
    };
    let whole = motion("nonlocal");
    assert_eq!(whole["ended"], "parted");
    let at = whole["time"].as_f64().unwrap();
    // bonds that break at once beside the seam hold the crack up to 1.28 times the displacement
    let coupled = motion("truncated");
    let until = coupled["edge_reached"][0].as_f64().unwrap();
    assert!(until < 1.1 * at, "{until} {at}");
}

#[test]
fn a_crack_at_a_seam_goes_on_from_its_checkpoint() {
    let typed = CRACKED.replace(
        "steps = [0.6, 0.7, 0.74,",
        "checkpoint-every = 2\nsteps = [0.6, 0.7, 0.74,",
    );
    crate::resumes_with_the_same_bytes(&format!("coupling = \"truncated\"\n{typed}"));
}

#[test]
fn a_strip_without_a_crack_bears_what_the_run_says() {
    let folder = tempfile::tempdir().unwrap();
    for (law, limit) in [
        ("bond-based]\nyoungs-modulus = 70e3", 0.02),
        // dilatations share what bonds along the axis lose
        ("lps]\nyoungs-modulus = 70e3\npoisson-ratio = 0.3", 0.06),
    ] {
        let typed = CRACKED
            .replace("lps]\nyoungs-modulus = 70e3\npoisson-ratio = 0.3", law)
            .replace(
                "[cracks.start]\nsegment = { from = [-5.5, 0], to = [5.5, 0] }\n",
                "",
            )
            .replace(
                "min = [-12, -6], max = [12, 6]",
                "min = [-20, -12], max = [20, 12]",
            )
            .replace("5e-3", "1e-2")
            .replace(
                "steps = [0.6, 0.7, 0.74, 0.76, 0.78, 0.8, 0.82, 0.84, 0.86]",
                "duration = 1\nsteps = 50",
            );
        write(folder.path(), "s.toml", &typed);
        let said = run(folder.path(), &["s.toml"]);
        let from = said.find("bears a stress of about ").expect(&said) + 24;
        let told: f64 = said[from..]
            .split([')', ';'])
            .next()
            .unwrap()
            .trim()
            .parse()
            .unwrap();
        let load = column(&folder.path().join("out/s_history.csv"), "top_reaction_y");
        let peak = load.iter().fold(0.0, |most: f64, x| most.max(*x)) / 40.0;
        assert!((peak / told - 1.0).abs() < limit, "{law}: {peak} {told}");
    }
}
