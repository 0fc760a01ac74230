//! Scalar damage through scenes: bars that are pulled to separation in elements and at points, checkpoints, and what is refused.

use crate::laws::refused;
use crate::{column, run, write};

/// A bar of elements with a row of weak ones, pulled to separation; units mm, N, MPa.
const ELEMENTS: &str = r#"
kinematics = "{kinematics}"
coupling = "local"
{mesh}
[materials.sound.damage-correspondence]
youngs-modulus = 30e3
poisson-ratio = 0.2
tensile-strength = 3.3
fracture-energy = 0.1
softening = "{softening}"
[materials.weak.damage-correspondence]
youngs-modulus = 30e3
poisson-ratio = 0.2
tensile-strength = 3
fracture-energy = 0.1
softening = "{softening}"
cells = { box = { min = {min}, max = {max} } }
[conditions.left.displacement]
on = "left"
x = 0
[conditions.right.displacement]
on = "right"
x = "0.4*t^2"
{base}
[solve.quasi-static]
duration = 1
steps = 40
[output]
vtu = false
"#;

/// Load, work and dissipated energy of every step, per area.
struct Pulled {
    load: Vec<f64>,
    work: Vec<f64>,
    spent: Vec<f64>,
}

fn pulled(folder: &std::path::Path, typed: &str, area: f64) -> Pulled {
    write(folder, "s.toml", typed);
    run(folder, &["s.toml"]);
    let history = folder.join("out/s_history.csv");
    let of = |name: &str| -> Vec<f64> {
        let values = column(&history, name).into_iter();
        values.map(|x| x / area).collect()
    };
    Pulled {
        load: of("right_reaction_x"),
        work: of("external_work"),
        spent: of("dissipated_energy"),
    }
}

fn bar(cells: usize, softening: &str) -> String {
    let size = 100.0 / cells as f64;
    ELEMENTS
        .replace("{kinematics}", "bar")
        .replace(
            "{mesh}",
            &format!("[mesh.line]\nmin = 0\nmax = 100\nx = {{ cells = {cells} }}"),
        )
        .replace("{min}", "50")
        .replace("{max}", &format!("{}", 50.0 + size))
        .replace("{softening}", softening)
        .replace("{base}", "")
}

#[test]
fn a_bar_of_elements_takes_its_fracture_energy_whatever_its_cells() {
    for softening in ["exponential", "linear"] {
        for cells in [10, 25] {
            let folder = tempfile::tempdir().unwrap();
            let found = pulled(folder.path(), &bar(cells, softening), 1.0);
            let last = found.load.len() - 1;
            let energy = found.spent[last] / 0.1;
            assert!((energy - 1.0).abs() < 1e-3, "{softening} {cells}: {energy}");
            // the trapezoidal rule of the history
            let ratio = found.work[last] / found.spent[last];
            assert!((ratio - 1.0).abs() < 2e-2, "{softening} {cells}: {ratio}");
            let peak = found.load.iter().fold(0.0, |most: f64, x| most.max(*x));
            assert!(peak < 3.0 * (1.0 + 1e-6), "{softening} {cells}: {peak}");
            assert!(peak > 2.7, "{softening} {cells}: {peak}");
            // a millionth of the stiffness of the weak cell is left, which has all of the elongation
            let residual = 1e-6 * 30e3 * 0.4 * cells as f64 / 100.0;
            let left = found.load[last] / residual;
            assert!((left - 1.0).abs() < 0.02, "{softening} {cells}: {left}");
        }
    }
}

#[test]
fn a_strip_of_elements_takes_it_where_the_energy_of_its_strain_damages() {
    // a row of weak squares across a strip of two rows, whose sides the sound ones hold: extensions alone are smaller then than under uniaxial stress
    let found = [
        ("plane-stress", "energy", 1.0),
        ("plane-strain", "energy", 1.0),
        ("plane-stress", "mazars", 1.036),
        ("plane-strain", "mazars", 1.102),
    ];
    for (kinematics, measure, takes) in found {
        let folder = tempfile::tempdir().unwrap();
        let mesh = "[mesh.rectangle]\nmin = [0, 0]\nmax = [100, 20]\nx = { cells = 10 }\ny = { cells = 2 }";
        let typed = ELEMENTS
            .replace("{kinematics}", kinematics)
            .replace("{mesh}", mesh)
            .replace("{min}", "[50, 0]")
            .replace("{max}", "[60, 20]")
            .replace(
                "\"{softening}\"",
                &format!("\"linear\"\nequivalent-strain = \"{measure}\""),
            )
            .replace(
                "{base}",
                "[conditions.base.displacement]\non = \"bottom\"\ny = 0\n",
            );
        let found = pulled(folder.path(), &typed, 20.0);
        let energy = found.spent.last().unwrap() / 0.1;
        assert!(
            (energy - takes).abs() < 1e-3,
            "{kinematics} {measure}: {energy}"
        );
        let load = found.load.last().unwrap();
        assert!(load.abs() < 5e-3, "{kinematics} {measure}: {load}");
    }
}

/// A bar of points that is pulled to separation between two regions that keep their damage.
const POINTS: &str = r#"
kinematics = "bar"
coupling = "nonlocal"
[mesh.line]
min = 0
max = 100
x = { cells = 20 }
[materials.m.damage-correspondence]
youngs-modulus = 30e3
poisson-ratio = 0.2
tensile-strength = 3
fracture-energy = 0.1
softening = "{softening}"
[peridynamics]
horizon = {horizon}
points.lattice = { spacing = 5, origin = 2.5 }
[no-fail]
left.box = { min = 0, max = 35 }
right.box = { min = 65, max = 100 }
[conditions.left.displacement]
inside.box = { min = 0, max = {horizon} }
x = 0
[conditions.right.displacement]
inside.box = { min = {end}, max = 100 }
x = "0.4*t^2"
[solve.quasi-static]
duration = 1
steps = {steps}
[output]
vtu = false
"#;

fn points(softening: &str, horizon: f64, steps: usize) -> String {
    POINTS
        .replace("{softening}", softening)
        .replace("{horizon}", &horizon.to_string())
        .replace("{end}", &(100.0 - horizon).to_string())
        .replace("{steps}", &steps.to_string())
}

/// Softening, horizon, load steps and fracture energy of a bar of points, with what it took over that energy, and its largest stress over the strength: the figures of docs/methods.md.
const MEASURED: [(&str, f64, usize, f64, f64, f64); 8] = [
    ("linear", 15.0, 120, 0.1, 1.0052, 1.0253),
    ("exponential", 15.0, 120, 0.1, 1.0037, 1.0121),
    ("linear", 20.0, 120, 0.1, 1.0063, 1.0438),
    ("exponential", 20.0, 120, 0.1, 0.9912, 1.0295),
    ("linear", 15.0, 20, 0.1, 1.0261, 1.0421),
    ("exponential", 15.0, 20, 0.1, 1.0244, 1.0329),
    // a crack band of 0.15 of the widest
    ("linear", 15.0, 120, 0.02, 1.0254, 0.9996),
    ("exponential", 15.0, 120, 0.02, 1.0242, 0.9951),
];

#[test]
fn a_bar_of_points_takes_its_fracture_energy_whatever_its_horizon() {
    for (softening, horizon, steps, typed, takes, bears) in MEASURED {
        let name = format!("{softening} {horizon} {steps} {typed}");
        let folder = tempfile::tempdir().unwrap();
        let scene = points(softening, horizon, steps)
            .replace(
                "fracture-energy = 0.1",
                &format!("fracture-energy = {typed}"),
            )
            .replace("0.4*t^2", &format!("{}*t^2", 4.0 * typed));
        let found = pulled(folder.path(), &scene, 1.0);
        let last = found.load.len() - 1;
        let energy = found.spent[last] / typed;
        assert!((energy - takes).abs() < 2e-3, "{name}: {energy}");
        assert!((energy - 1.0).abs() < 0.03, "{name}: {energy}");
        // the trapezoidal rule, where few steps lie beyond the peak
        let ratio = found.work[last] / found.spent[last];
        assert!((ratio - 1.0).abs() < 0.06, "{name}: {ratio}");
        let peak = found.load.iter().fold(0.0, |most: f64, x| most.max(*x)) / 3.0;
        assert!((peak - bears).abs() < 2e-3, "{name}: {peak}");
    }
}

#[test]
fn damage_is_written_by_its_name_and_goes_on_from_a_checkpoint() {
    for typed in [bar(10, "exponential"), points("exponential", 15.0, 40)] {
        let typed = typed
            .replace("steps = 40", "steps = 12\ncheckpoint-every = 5")
            .replace("0.4*t^2", "0.02*t")
            .replace("vtu = false", "vtu = true");
        let whole = crate::resumes_with_the_same_bytes(&typed);
        let history = whole.path().join("out/bar_history.csv");
        let spent = column(&history, "dissipated_energy");
        assert!(*spent.last().unwrap() > 0.0);
        let written: Vec<u8> = std::fs::read_dir(whole.path().join("out"))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_some_and(|e| e == "vtu"))
            .flat_map(|path| std::fs::read(path).unwrap())
            .collect();
        let text = String::from_utf8_lossy(&written);
        assert!(text.contains("Name=\"scalar damage\""));
    }
}

#[test]
fn what_scalar_damage_cannot_do_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let elements = bar(10, "linear");
    let refused = |typed: &str, from: &str, to: &str, part: &str| {
        assert!(typed.contains(from), "{from}");
        refused(folder.path(), &typed.replace(from, to), part);
    };
    // 2 E G/f² = 8.264
    refused(
        &elements,
        "fracture-energy = 0.1",
        "fracture-energy = 0.0015",
        "is too large: a crack band of the width 1.0000e1",
    );
    refused(
        &elements,
        "fracture-energy = 0.1",
        "fracture-energy = 0.0015",
        "refine the mesh to cells below 8.26",
    );
    refused(
        &elements,
        "tensile-strength = 3\n",
        "",
        "lacks `tensile-strength`",
    );
    refused(
        &elements,
        "\"linear\"",
        "\"bilinear\"",
        "use one of \"exponential\", \"linear\"",
    );
    let of_points = points("linear", 15.0, 40);
    refused(
        &of_points,
        "fracture-energy = 0.1",
        "fracture-energy = 0.002",
        "take a horizon below 1.0000e1",
    );
    refused(
        &of_points,
        "horizon = 15",
        "horizon = \"15 + 0.01*x\"",
        "calibrated for one horizon",
    );
    refused(&of_points, "horizon = 15\n", "", "lacks `horizon`");
    refused(
        &of_points,
        "fracture-energy = 0.1",
        "fracture-energy = 0.1\ncritical-stretch = 1e-3",
        "whose bonds break by their own damage",
    );
}
