//! Scenes with a user material, by the binary.

use std::path::Path;
use std::process::Command;

use crate::{in_c, j2};

/// A body whose boundary is sheared, or that is pulled at one end.
const SHEARED: &str = r#"
kinematics = "solid"
coupling = "local"
[mesh.box]
min = [0, 0, 0]
max = [3, 3, 3]
x = { cells = 3 }
y = { cells = 3 }
z = { cells = 3 }
{material}
[conditions.sheared.displacement]
inside.without = { from = { box = { min = [-1, -1, -1], max = [2.5, 4, 4] } }, removed = { box = { min = [0.1, 0.1, 0.1], max = [2.9, 2.9, 2.9] } } }
x = "0.02*t*y + 0.003*sin(7*t)*x"
y = "0.001*t*z"
z = 0
[conditions.right.displacement]
inside.box = { min = [2.5, -1, -1], max = [4, 4, 4] }
x = "0.02*t*y + 0.003*sin(7*t)*x"
y = "0.001*t*z"
z = 0
[output]
probes.a = { at = [1.2, 1.3, 1.4] }
[solve.quasi-static]
duration = 1
steps = 8
tolerance = 1e-12
"#;

const PULLED: &str = r#"
kinematics = "bar"
coupling = "{coupling}"
[mesh.line]
min = 0
max = 10
x = { cells = 100 }
[zones.nonlocal]
box = { min = 3, max = 7 }
{material}
density = 1
[peridynamics]
horizon = 0.3
points.lattice = { spacing = 0.1 }
[conditions.left.displacement]
on = "left"
x = 0
[conditions.right.displacement]
on = "right"
x = "{pull}"
[output]
probes.a = { at = 4.55 }
[solve.quasi-static]
duration = 1
steps = {steps}
tolerance = 1e-12
"#;

const OWN: &str = "[materials.m.plastic-correspondence]\nyoungs-modulus = 1000\npoisson-ratio = 0.3\nyield-stress = 5\nhardening-modulus = 250\n";

fn user(library: &Path, rest: &str) -> String {
    format!(
        "[materials.m.umat]\nlibrary = \"{}\"\nyoungs-modulus = 1000\npoisson-ratio = 0.3\n{rest}\n",
        library.display()
    )
}

/// The J2 routine with the constants of [`OWN`].
fn routine(library: &Path, more: &str) -> String {
    user(
        library,
        &format!("constants = [1000, 0.3, 5, 250]\nstate = 1\n{more}"),
    )
}

fn output(folder: &Path, scene: &str) -> std::process::Output {
    std::fs::write(folder.join("scene.toml"), scene).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_bondline"));
    command.current_dir(folder).args(["run", "scene.toml"]);
    command.output().unwrap()
}

/// The rows of a scene's history, and its header.
fn history(folder: &Path, scene: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let output = output(folder, scene);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let text = std::fs::read_to_string(folder.join("out/scene_history.csv")).unwrap();
    let mut lines = text.lines();
    let header = lines
        .next()
        .unwrap()
        .split(',')
        .map(|h| h.trim().to_owned());
    let header = header.collect();
    let rows = lines.map(|l| l.split(',').map(|x| x.trim().parse().unwrap()).collect());
    (header, rows.collect())
}

/// Returns the message by which a scene is refused, on one line.
fn refused(folder: &Path, scene: &str) -> String {
    let output = output(folder, scene);
    let said = String::from_utf8_lossy(&output.stderr).replace('│', " ");
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        !output.status.success() && !said.contains("panicked"),
        "{said}"
    );
    said
}

/// The largest difference of the columns of two histories that `wanted` names, over their largest entry; and that entry.
fn difference(
    a: &(Vec<String>, Vec<Vec<f64>>),
    b: &(Vec<String>, Vec<Vec<f64>>),
    wanted: &str,
) -> (f64, f64) {
    assert_eq!(a.0, b.0);
    let columns = (0..a.0.len()).filter(|&k| a.0[k].contains(wanted));
    let (mut off, mut size): (f64, f64) = (0.0, 0.0);
    for k in columns {
        for (a, b) in a.1.iter().zip(&b.1) {
            off = off.max((a[k] - b[k]).abs());
            size = size.max(a[k].abs());
        }
    }
    assert!(size > 0.0, "{wanted} in {:?}", a.0);
    (off / size, size)
}

#[test]
fn a_routine_gives_our_own_plasticity_in_elements_and_at_points() {
    let folder = tempfile::tempdir().unwrap();
    let pulled = PULLED
        .replace("{pull}", "0.2*min(t, 1.2 - 1.4*t)")
        .replace("{steps}", "10");
    let scenes = [
        ("elements", SHEARED.to_owned()),
        ("a bar of elements", pulled.replace("{coupling}", "local")),
        ("points", pulled.replace("{coupling}", "nonlocal")),
        ("splice", pulled.replace("{coupling}", "splice")),
        ("truncated", pulled.replace("{coupling}", "truncated")),
    ];
    for library in j2(folder.path()) {
        for (name, scene) in &scenes {
            let own = history(folder.path(), &scene.replace("{material}", OWN));
            let found = history(
                folder.path(),
                &scene.replace("{material}", &routine(&library, "")),
            );
            for wanted in ["reaction", "a_ux"] {
                let (off, _) = difference(&own, &found, wanted);
                eprintln!("{name}, {wanted}: {off:.1e}");
                assert!(
                    off < 1e-10,
                    "{} {name} {wanted}: {off:e}",
                    library.display()
                );
            }
            // several calls at a time give the same
            let many = history(
                folder.path(),
                &scene.replace("{material}", &routine(&library, "thread-safe = true")),
            );
            assert_eq!(many, found, "{name}");
        }
    }
}

#[test]
fn a_routine_that_is_heated_gives_our_own_plasticity() {
    let folder = tempfile::tempdir().unwrap();
    let library = in_c(folder.path(), "j2.c");
    for coupling in ["local", "nonlocal", "splice"] {
        let held = PULLED
            .replace("{coupling}", coupling)
            .replace("{pull}", "0")
            .replace("{steps}", "6");
        let hot = |material: &str| {
            let material = format!("{material}thermal-expansion = 1e-3");
            let scene = held.replace("{material}", &material);
            history(
                folder.path(),
                &format!("temperature.value = \"12*t\"\n{scene}"),
            )
        };
        let (own, found) = (hot(OWN), hot(&routine(&library, "")));
        let (off, size) = difference(&own, &found, "reaction");
        assert!(off < 1e-10, "{coupling}: {off:e}");
        // it flows: less than E α ΔT
        assert!(size > 5.0 && size < 11.0, "{coupling}: {size}");
    }
}

#[test]
fn large_strains_are_the_rate_form_of_a_bar() {
    let folder = tempfile::tempdir().unwrap();
    let library = in_c(folder.path(), "j2.c");
    let (young, poisson, yield_stress, modulus) = (1000.0f64, 0.3, 5.0, 250.0);
    let tangent = young * modulus / (young + modulus);
    // uniaxial: σ over ln λ is bilinear, plastic flow keeps the volume, P = J σ/λ
    let expected = |stretch: f64| {
        let log = stretch.ln();
        let stress = (young * log).min(yield_stress + tangent * (log - yield_stress / young));
        ((1.0 - 2.0 * poisson) * stress / young).exp() * stress / stretch
    };
    for coupling in ["local", "nonlocal"] {
        let error = |steps: usize| {
            let scene = PULLED
                .replace("{coupling}", coupling)
                .replace("{pull}", "4*t");
            let scene = scene.replace("{steps}", &steps.to_string());
            let scene = scene.replace("{material}", &routine(&library, "strains = \"large\""));
            let (header, rows) = history(folder.path(), &scene);
            let column = |name: &str| header.iter().position(|h| h == name).unwrap();
            // of points the middle alone is far from the bare ends
            let pulled = rows.last().unwrap()[column("right_reaction_x")];
            (pulled / expected(1.4) - 1.0).abs()
        };
        let (coarse, fine) = (error(20), error(40));
        eprintln!(
            "{coupling}: a bar to 1.4 of its length, off by {coarse:.2e} in 20 steps, {fine:.2e} in 40"
        );
        if coupling == "local" {
            assert!(fine < 1e-4, "{fine:e}");
            assert!(coarse / fine > 3.0, "second order: {coarse:e} {fine:e}");
        }
    }
}

#[test]
fn what_is_not_a_number_names_point_and_step() {
    let folder = tempfile::tempdir().unwrap();
    let library = in_c(folder.path(), "odd.c");
    let lost = user(&library, "symbol = \"lost_\"\nconstants = [1000, 0.0055]")
        .replace("poisson-ratio = 0.3", "poisson-ratio = 0");
    // points at the bare ends strain more than the body
    for (coupling, step) in [("local", 6), ("nonlocal", 4)] {
        let increment = format!("in increment {step} of a point");
        let step = format!("load step {step} at time 0.{step}");
        let scene = PULLED
            .replace("{coupling}", coupling)
            .replace("{pull}", "0.1*t")
            .replace("{steps}", "10");
        let said = refused(folder.path(), &scene.replace("{material}", &lost));
        for part in [
            "at (",
            "`lost_` of the material `m`",
            "gave STRESS whose number 1 is NaN",
            &increment,
            &step,
        ] {
            assert!(said.contains(part), "{coupling}: `{part}` in {said}");
        }
        let hasty = lost.replace("lost_", "hasty_");
        let said = refused(folder.path(), &scene.replace("{material}", &hasty));
        assert!(
            said.contains("PNEWDT = 0.5") && said.contains("more load steps"),
            "{said}"
        );
        let explicit = "[solve.explicit]\nduration = 1\noutputs = 2\n";
        let (head, _) = scene.split_once("[solve.quasi-static]").unwrap();
        let said = refused(
            folder.path(),
            &(head.replace("0.1*t", "t") + explicit).replace("{material}", &lost),
        );
        assert!(
            said.contains("gave STRESS") && said.contains("at step ") && said.contains("at ("),
            "{said}"
        );
    }
}

/// Plane stress and bars find the strain out of the body anew; a stress that takes a rate must not lose it where the state is only looked at.
#[test]
fn a_rate_counts_in_every_kinematics() {
    let folder = tempfile::tempdir().unwrap();
    let (lambda, shear) = (1000.0 * 0.3 / (1.3 * 0.4), 500.0 / 1.3);
    let numbers = format!("symbol = \"viscous_\"\nconstants = [{lambda}, {shear}, 300]");
    let material = user(&in_c(folder.path(), "odd.c"), &numbers);
    let scene = r#"
kinematics = "plane-stress"
coupling = "local"
mesh.rectangle = { min = [0, 0], max = [2, 1], x = { cells = 4 }, y = { cells = 2 } }
conditions.left.displacement = { on = "left", x = 0 }
conditions.base.displacement = { on = "bottom", y = 0 }
conditions.right.displacement = { on = "right", x = "0.01*t" }
solve.quasi-static = { duration = 1, steps = 10, tolerance = 1e-11 }
{material}
[output]
vtu = false
stresses = ["von-mises"]
probes.a.at = [1.2, 0.3]
"#;
    let bar = scene
        .replace("plane-stress", "bar")
        .replace(
            "mesh.rectangle = { min = [0, 0], max = [2, 1], x = { cells = 4 }, y = { cells = 2 } }",
            "mesh.line = { min = 0, max = 2, x = { cells = 4 } }",
        )
        .replace(
            "conditions.base.displacement = { on = \"bottom\", y = 0 }\n",
            "",
        )
        .replace("at = [1.2, 0.3]", "at = 1.2");
    for scene in [scene.to_owned(), bar] {
        let folder = tempfile::tempdir().unwrap();
        let scene = scene.replace("{material}", &material);
        let (names, rows) = history(folder.path(), &scene);
        let column = |name: &str| -> Vec<f64> {
            let k = names.iter().position(|n| n == name).unwrap();
            rows.iter().map(|row| row[k]).collect()
        };
        let (stress, force) = (column("a_sxx"), column("right_reaction_x"));
        let (work, stored) = (column("external_work"), column("stored_energy"));
        for (k, (s, f)) in stress.iter().zip(&force).enumerate() {
            assert!((s - f).abs() < 1e-8, "{k}: {s} {f}");
        }
        // the trapezoids of the reaction
        let trapezoids: f64 = force.windows(2).map(|f| 0.5 * (f[0] + f[1]) * 1e-3).sum();
        assert!(
            (work[10] - trapezoids).abs() < 1e-9 * trapezoids,
            "{work:?}"
        );
        assert!(stored.iter().all(|e| e.is_finite()), "{stored:?}");
    }
}

#[test]
fn a_routine_that_takes_more_statev_than_it_has_is_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let greedy = user(
        &in_c(folder.path(), "odd.c"),
        "symbol = \"greedy_\"\nconstants = [1000]",
    );
    let greedy = greedy.replace("poisson-ratio = 0.3", "poisson-ratio = 0");
    let scene = PULLED
        .replace("{coupling}", "local")
        .replace("{pull}", "0.1*t")
        .replace("{steps}", "2");
    let said = refused(folder.path(), &scene.replace("{material}", &greedy));
    assert!(
        said.contains("wrote to number 3 of STATEV, which has 0") && said.contains("`state`"),
        "{said}"
    );
    let enough = greedy.replace("symbol", "state = 3\nsymbol");
    history(folder.path(), &scene.replace("{material}", &enough));
}

#[test]
fn a_tangent_of_the_routine_solves_the_same_load_steps() {
    let folder = tempfile::tempdir().unwrap();
    let scene = |coupling: &str, material: &str| {
        let scene = PULLED.replace("{coupling}", coupling);
        let scene = scene.replace("{pull}", "0.1*t").replace("{steps}", "5");
        scene.replace("{material}", material)
    };
    let given = "tangent = \"routine\"\n";
    for library in j2(folder.path()) {
        for (coupling, strains) in [("local", "small"), ("splice", "small"), ("local", "large")] {
            let more = format!("strains = \"{strains}\"\n");
            let differenced = history(folder.path(), &scene(coupling, &routine(&library, &more)));
            let material = routine(&library, &(more + given));
            let found = history(folder.path(), &scene(coupling, &material));
            let (off, _) = difference(&differenced, &found, "reaction");
            assert!(off < 1e-9, "{coupling}, {strains}: {off:e}");
        }
    }
    let lost = user(
        &in_c(folder.path(), "odd.c"),
        "symbol = \"lost_\"\nconstants = [1000, 1]",
    );
    let said = refused(folder.path(), &scene("local", &(lost + given)));
    assert!(
        said.contains("gave no DDSDDE") && said.contains("tangent = \"routine\""),
        "{said}"
    );
}

#[test]
fn a_routine_that_gives_up_ends_the_run() {
    let folder = tempfile::tempdir().unwrap();
    for library in j2(folder.path()) {
        let material = user(
            &library,
            "constants = [1000, 0.3, 5, 250, 0.001]\nstate = 1",
        );
        let scene = PULLED
            .replace("{coupling}", "local")
            .replace("{pull}", "0.2*t")
            .replace("{steps}", "10");
        let said = refused(folder.path(), &scene.replace("{material}", &material));
        assert!(
            said.contains("called XIT in increment") && said.contains("load step"),
            "{said}"
        );
    }
}

#[test]
fn libraries_and_routines_that_are_not_there_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let library = in_c(folder.path(), "odd.c");
    let scene = PULLED
        .replace("{coupling}", "local")
        .replace("{pull}", "0.2*t")
        .replace("{steps}", "10");
    let said = |material: String| refused(folder.path(), &scene.replace("{material}", &material));
    let missing = said(user(&folder.path().join("none.so"), ""));
    assert!(
        missing.contains("`materials.m.umat.library`")
            && missing.contains("none.so")
            && missing.contains("relative to the scene file"),
        "{missing}"
    );
    let unknown = said(user(&library, ""));
    assert!(
        unknown.contains("no routine `umat_`, `umat`, `UMAT`") && unknown.contains("`symbol`"),
        "{unknown}"
    );
    let unknown = said(user(&library, "symbol = \"mine_\""));
    assert!(
        unknown.contains("no routine `mine_`") && unknown.contains("nm -D"),
        "{unknown}"
    );
    std::fs::write(folder.path().join("text.so"), "no library").unwrap();
    let text = said(user(Path::new("text.so"), ""));
    assert!(
        text.contains("cannot be loaded") && text.contains("umat.md"),
        "{text}"
    );
}
