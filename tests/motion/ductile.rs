//! Ductile bodies in large strains, and how they tear, through scenes.

use crate::laws::{STEPS, history, refused, scene, summary};
use crate::{column, run, write};

const YOUNG: f64 = 1000.0;

/// A bar of a law for large strains; `rest` is the criterion that breaks its bonds.
fn law(yields: f64, hardening: f64, rest: &str) -> String {
    format!(
        "plastic-correspondence]\npoisson-ratio = 0.3\nyield-stress = {yields}\nhardening-modulus = {hardening}\nstrains = \"large\"\n{rest}"
    )
}

#[test]
fn a_bar_pulled_to_a_third_more_of_its_length_has_the_curve_of_true_stress() {
    let (yields, hardening) = (5.0, 250.0);
    let tangent = YOUNG * hardening / (YOUNG + hardening);
    for coupling in ["local", "splice"] {
        let folder = tempfile::tempdir().unwrap();
        let steps = STEPS.replace("steps = 5", "steps = 20");
        let typed = scene(coupling, &law(yields, hardening, ""), &steps).replace("0.1*t", "3*t");
        let found = history(folder.path(), &typed, &["a_ux", "b_ux", "right_reaction_x"]);
        for k in 1..=20 {
            let stretch = 1.0 + (found[1][k] - found[0][k]) / 0.9;
            let strain = stretch.ln();
            let kirchhoff = (YOUNG * strain).min(yields + tangent * (strain - yields / YOUNG));
            let expected = kirchhoff / stretch;
            let reaction = found[2][k];
            assert!(
                (reaction - expected).abs() < 1e-6 * expected,
                "{coupling} {k}: {reaction} {expected}"
            );
        }
        assert!(found[2][20] > 40.0);
    }
}

/// A bar in motion whose ends are pulled apart; the middle may tear.
fn torn(criterion: &str) -> String {
    let rest = "[initial.u.velocity]\nx = \"0.2*(x - 5)\"\n[no-fail.ends]\nany = [{ box = { min = 0, max = 3 } }, { box = { min = 7, max = 10 } }]\n[solve.explicit]\nduration = 1.5\noutputs = 6\nhistory-interval = 0.01\ncheckpoint-every = 100\n";
    scene("nonlocal", &law(5.0, 5.0, criterion), rest)
        .replace("x = 0\n[conditions.right", "x = \"-t\"\n[conditions.right")
        .replace("0.1*t", "t")
}

#[test]
fn a_bar_tears_where_its_plastic_strain_reaches_the_tearing_parameter() {
    // uniaxial tension: P is the equivalent plastic strain
    const CRITICAL: f64 = 0.12;
    let folder = tempfile::tempdir().unwrap();
    write(
        folder.path(),
        "bar.toml",
        &torn(&format!("tearing-parameter = {CRITICAL}")),
    );
    let said = run(folder.path(), &["bar.toml"]);
    assert!(
        said.contains("bonds break at the tearing parameter 0.12"),
        "{said}"
    );
    let path = folder.path().join("out/bar_history.csv");
    let [time, broken, a, b] =
        ["time", "broken_bonds", "a_ux", "b_ux"].map(|name| column(&path, name));
    let first = broken.iter().position(|b| *b > 0.0).expect("nothing tore");
    // between the probes the bar is pulled evenly: what is not elastic is plastic
    let plastic = |k: usize| (1.0 + (b[k] - a[k]) / 0.9).ln() - 5.0 / YOUNG;
    assert!(
        plastic(first - 1) < 1.02 * CRITICAL && plastic(first) > 0.98 * CRITICAL,
        "{} {} {}",
        time[first],
        plastic(first - 1),
        plastic(first)
    );
    accounts_for_its_energy(&path, 0.02);
}

/// Checks that the work of the loads and the energy at the start are stored, move, or are dissipated, to a part of it.
fn accounts_for_its_energy(history: &std::path::Path, tolerance: f64) {
    let [kinetic, stored, work, dissipated] = [
        "kinetic_energy",
        "stored_energy",
        "external_work",
        "dissipated_energy",
    ]
    .map(|name| column(history, name));
    let last = work.len() - 1;
    let supplied = kinetic[0] + stored[0] + work[last];
    let off = supplied - kinetic[last] - stored[last] - dissipated[last];
    assert!(
        off.abs() < tolerance * supplied,
        "{off} of {supplied}, {} dissipated",
        dissipated[last]
    );
}

#[test]
fn a_bar_that_tears_goes_on_from_its_checkpoint() {
    let typed = torn("tearing-parameter = 0.12");
    crate::resumes_with_the_same_bytes(&typed);
}

#[test]
fn a_drag_needs_velocities_of_one_time_step() {
    let folder = tempfile::tempdir().unwrap();
    let with = |control: &str| law(5.0, 5.0, &format!("zero-energy-control = \"{control}\""));
    let refused = |typed: &str, part: &str| refused(folder.path(), typed, part);
    refused(
        &scene("nonlocal", &with("drag"), STEPS),
        "this scene is at rest in every step",
    );
    refused(
        &scene("nonlocal", &with("drug"), STEPS),
        "\"length\", \"drag\"",
    );
    let typed = torn("zero-energy-control = \"drag\"");
    refused(
        &typed.replace("outputs = 6", "outputs = 6\nsub-steps = 2"),
        "sub-steps have several",
    );
}

#[test]
fn a_dragged_bar_that_tears_goes_on_from_its_checkpoint() {
    let typed =
        torn("tearing-parameter = 0.12\nzero-energy-control = \"drag\"\nstabilisation = 0.02");
    // the drag and the yield surface on which the step ended answer otherwise once more: the work of the next step begins with the reactions that it ended with
    let whole = crate::resumes_with_the_same_bytes(&typed);
    let path = whole.path().join("out/bar_history.csv");
    assert!(*column(&path, "broken_bonds").last().unwrap() > 0.0);
    accounts_for_its_energy(&path, 0.02);
}

#[test]
fn a_dragged_plate_that_tears_leaves_the_same_bytes_on_any_threads() {
    let folder = tempfile::tempdir().unwrap();
    let dragged = "critical-stretch = 0.1\nzero-energy-control = \"drag\"\nstabilisation = 0.2";
    write(
        folder.path(),
        "plate.toml",
        &PLATE.replace("critical-stretch = 0.1", dragged),
    );
    for (threads, output) in [("1", "one"), ("2", "two")] {
        let to = ["plate.toml", "--output", output, "--threads", threads];
        run(folder.path(), &to);
    }
    let path = folder.path().join("one/plate_history.csv");
    assert!(*column(&path, "broken_bonds").last().unwrap() > 100.0);
    accounts_for_its_energy(&path, 0.02);
    crate::same(&folder.path().join("one"), &folder.path().join("two"));
}

/// Kinetic, stored and dissipated energy of a bar whose points move by turns to the left and to the right, at times up to 0.1.
fn alternating(control: &str, step_fraction: f64) -> [Vec<f64>; 3] {
    let folder = tempfile::tempdir().unwrap();
    let rest = format!(
        "[initial.u.velocity]\nx = \"0.01*cos(10*pi*(x - 0.05))\"\n[solve.explicit]\nduration = 0.1\nhistory-interval = 1e-3\nstep-fraction = {step_fraction}\n"
    );
    let typed = scene("nonlocal", &law(5.0, 5.0, control), &rest)
        .replace("0.1*t", "0")
        .replace("spacing = 0.1", "spacing = 0.1, origin = 0.05");
    write(folder.path(), "bar.toml", &typed);
    run(folder.path(), &["bar.toml"]);
    let path = folder.path().join("out/bar_history.csv");
    ["kinetic_energy", "stored_energy", "dissipated_energy"].map(|name| column(&path, name))
}

#[test]
fn a_drag_takes_the_energy_of_an_alternating_motion_and_a_bond_force_keeps_it() {
    let dragged = |step_fraction: f64| {
        let control = "zero-energy-control = \"drag\"\nstabilisation = 0.02";
        let [kinetic, stored, dissipated] = alternating(control, step_fraction);
        let last = *kinetic.last().unwrap();
        assert!(last < 0.01 * kinetic[0], "{last} {}", kinetic[0]);
        assert!(dissipated.is_sorted(), "{dissipated:?}");
        let off = (0..kinetic.len())
            .map(|k| (kinetic[k] + stored[k] + dissipated[k] - kinetic[0]).abs() / kinetic[0]);
        off.fold(0.0, f64::max)
    };
    // the drag has the velocities of the step before: its energy is exact to first order in the step
    let (coarse, fine) = (dragged(0.25), dragged(0.125));
    assert!(coarse < 0.1 && fine < 0.55 * coarse, "{coarse} {fine}");
    let [kinetic, stored, dissipated] = alternating("", 0.125);
    assert_eq!(dissipated.last(), Some(&0.0));
    let kept = kinetic.last().unwrap() + stored.last().unwrap();
    assert!(
        (kept / kinetic[0] - 1.0).abs() < 0.05,
        "{kept} {}",
        kinetic[0]
    );
}

/// A plate of Neo-Hooke that is pulled in two by its ends.
const PLATE: &str = r#"
kinematics = "plane-strain"
coupling = "nonlocal"
mesh.rectangle = { min = [0, 0], max = [12, 4], x = { cells = 24 }, y = { cells = 8 } }
[materials.m.neo-hooke]
youngs-modulus = 1000
poisson-ratio = 0.3
density = 1
critical-stretch = 0.1
[peridynamics]
horizon = 1.5
points.lattice = { spacing = 0.5, origin = [0.25, 0.25] }
[no-fail.ends]
any = [{ box = { min = [0, 0], max = [2, 4] } }, { box = { min = [10, 0], max = [12, 4] } }]
[initial.u.velocity]
x = "2*(x - 6)"
[conditions.left.velocity]
inside.box = { min = [0, 0], max = [1.5, 4] }
x = "2*(x - 6)"
y = 0
[conditions.right.velocity]
inside.box = { min = [10.5, 0], max = [12, 4] }
x = "2*(x - 6)"
y = 0
[solve.explicit]
duration = 0.5
outputs = 2
"#;

#[test]
fn a_torn_plate_accounts_for_its_energy_and_tells_of_points_without_a_gradient() {
    let folder = tempfile::tempdir().unwrap();
    let summary = summary(folder.path(), PLATE);
    let path = folder.path().join("out/scene_history.csv");
    assert!(*column(&path, "broken_bonds").last().unwrap() > 100.0);
    accounts_for_its_energy(&path, 0.02);
    let warnings = summary["warnings"].to_string();
    assert!(warnings.contains("no deformation gradient"), "{warnings}");
    // the halves are no longer strained
    let force = column(&path, "right_reaction_x");
    let largest = force.iter().fold(0.0f64, |m, f| m.max(f.abs()));
    assert!(largest > 100.0, "{largest}");
}

#[test]
fn criteria_that_a_law_does_not_have_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |typed: &str, part: &str| refused(folder.path(), typed, part);
    refused(
        &scene(
            "nonlocal",
            "lps]\npoisson-ratio = 0.2\ntearing-parameter = 1",
            STEPS,
        ),
        "`tearing-parameter` is not known",
    );
    let elastic = "neo-hooke]\npoisson-ratio = 0.2\ntearing-parameter = 1";
    refused(
        &scene("nonlocal", elastic, STEPS),
        "`tearing-parameter` is not known",
    );
    let both = law(5.0, 5.0, "tearing-parameter = 1\ncritical-stretch = 0.1");
    refused(&scene("nonlocal", &both, STEPS), "at once");
    let energy = law(5.0, 5.0, "fracture-energy = 1");
    refused(
        &scene("nonlocal", &energy, STEPS),
        "`fracture-energy` is not known",
    );
    let zero = law(5.0, 5.0, "tearing-parameter = 0");
    refused(&scene("nonlocal", &zero, STEPS), "must be positive");
    // no solution before the run shows where the material flows
    let auto = scene("splice", &law(5.0, 5.0, "tearing-parameter = 1"), STEPS);
    let auto = auto.replace(
        "[zones.nonlocal]\nbox = { min = 3, max = 7 }",
        "[zones]\nauto = {}",
    );
    refused(&auto, "breaks them by a tearing parameter");
    let strange = law(5.0, 5.0, "").replace("large", "huge");
    refused(&scene("nonlocal", &strange, STEPS), "\"small\", \"large\"");
}

#[test]
fn wherever_the_lattice_lies_in_a_round_bar_each_point_stands_for_some_mass() {
    // on curved surfaces points stick out: they are corners of no whole cube of the lattice
    let folder = tempfile::tempdir().unwrap();
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let scene = root.join("examples/notched_bar.toml");
    for origin in ["[0, 0, 0]", "[0.36, 0.81, 0.55]"] {
        let output = crate::bondline(folder.path())
            .arg("check")
            .arg(&scene)
            .args(["--set", "peridynamics.points.lattice.spacing=1.5"])
            .args(["--set", "peridynamics.horizon=3"])
            .arg("--set")
            .arg(format!("peridynamics.points.lattice.origin={origin}"))
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{origin}: {said}");
    }
}
