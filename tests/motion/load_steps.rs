//! Loads that grow step by step.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use bondline::observe::summary::Ended;
use bondline::progress::Progress;
use bondline::run::{AnyScene, RunOptions, StartFrom};
use bondline::scene::Source;

use crate::{BREAKING, bondline, column, run, same, table, write};

/// The scene that breaks, at rest and whole: the loads are a tenth of those in time.
fn still(coupling: &str) -> String {
    BREAKING
        .replace(
            "[solve.explicit]\nduration = 60\noutputs = 6\nhistory-interval = 1\n",
            "",
        )
        .replace(" * min(1, t / 8)", "")
        .replace("tips.notch = { direction = [0, -1], threshold = 0.2 }", "")
        .replace("damage-at-edge = \"warn\"\n", "")
        .replace("[no-fail.base]\nbox = { min = [3, 0], max = [9, 1] }\n", "")
        .replace("critical-stretch = 0.002\n", "")
        .replace("[coupling.splice]", &format!("[coupling.{coupling}]"))
        // a body in equilibrium has to be held
        .replace("x = \"-0.004", "y = 0\nx = \"-0.004")
}

#[test]
fn load_steps_end_where_the_static_solve_does_by_either_method() {
    let folder = tempfile::tempdir().unwrap();
    let still = still("truncated");
    write(folder.path(), "still.toml", &still);
    run(folder.path(), &["still.toml"]);
    let expected = table(&folder.path().join("out/still_probes.csv")).1[0].clone();
    for method in ["implicit", "relaxation"] {
        let scene = still
            .replace("x = \"-0.004\"", "x = \"-0.004 * t\"")
            .replace("x = \"0.004\"", "x = \"0.004 * t\"");
        let scene = format!(
            "{scene}\n[solve.quasi-static]\nsteps = 4\nmethod = \"{method}\"\ntolerance = 1e-9\n"
        );
        write(folder.path(), "load.toml", &scene);
        let said = run(folder.path(), &["load.toml", "--json"]);
        let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
        let history = folder.path().join("out/load_history.csv");
        let ux = column(&history, "middle_ux");
        assert_eq!(ux.len(), 5);
        for (k, u) in ux.iter().enumerate() {
            let share = k as f64 / 4.0;
            assert!(
                (u - share * expected[2]).abs() < 1e-7 * 0.004,
                "{method}: {u} {expected:?}"
            );
        }
        // pure displacement, linear, a seam with an energy: the work of the supports is what is stored
        let m = &summary["motion"];
        let (work, stored) = (
            m["external_work"].as_f64().unwrap(),
            m["stored_energy"].as_f64().unwrap(),
        );
        assert!(
            (work / stored - 1.0).abs() < 1e-6,
            "{method}: {work} {stored}"
        );
    }
}

/// Partial stress has eigenvalues that are negative: relaxation runs away and says so, factors of the stiffness lead to the static solution.
#[test]
fn load_steps_of_partial_stress_are_led_by_factors() {
    let folder = tempfile::tempdir().unwrap();
    let still = still("partial-stress");
    write(folder.path(), "still.toml", &still);
    let transition = ["--set", "zones.transition.around=1.6"];
    run(
        folder.path(),
        &[&["still.toml"][..], &transition[..]].concat(),
    );
    let expected = table(&folder.path().join("out/still_probes.csv")).1[0].clone();
    let load = format!("{still}[solve.quasi-static]\nsteps = 1\n");
    write(folder.path(), "load.toml", &load);
    let arguments = [&["load.toml"][..], &transition[..]].concat();
    let said = run(folder.path(), &arguments);
    assert!(said.contains("lead the iteration"), "{said}");
    let history = folder.path().join("out/load_history.csv");
    for (column_name, at) in [("middle_ux", 2), ("middle_uy", 3)] {
        let u = column(&history, column_name);
        let u = u.last().unwrap();
        assert!((u - expected[at]).abs() < 1e-7 * 0.004, "{u} {expected:?}");
    }
    let relaxed = [
        &arguments[..],
        &["--set", "solve.quasi-static.method=relaxation"],
    ]
    .concat();
    let refused = bondline(folder.path())
        .arg("run")
        .args(relaxed)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        !refused.status.success() && said.contains("ran away"),
        "{said}"
    );
}

/// Back to where it began, nothing is left to measure a residual by but what was there before; and a body that nothing holds is not at rest anywhere.
#[test]
fn load_steps_return_to_zero_and_refuse_a_body_that_nothing_holds() {
    let folder = tempfile::tempdir().unwrap();
    let scene = |coupling: &str, held: &str, pull: &str| {
        format!(
            "kinematics = \"plane-strain\"\n{coupling}\n[mesh.rectangle]\nmin = [0, 0]\nmax = [1, 1]\nx = {{ cells = 12 }}\ny = {{ cells = 12 }}\n\
             [materials.body.bond-based]\nyoungs-modulus = 1\ndensity = 1\n[conditions.bottom.displacement]\non = \"bottom\"\n{held}\n{pull}\n\
             [solve.quasi-static]\nsteps = 4\n[output]\nvtu = false\nprobes.middle = {{ at = [0.5, 0.51] }}\n"
        )
    };
    let points = "[peridynamics]\nhorizon = 0.17\npoints.lattice.spacing = \"1/12\"\n";
    let zone = "[zones.nonlocal]\nbox = { min = [0.3, 0.3], max = [0.7, 0.7] }\n";
    let there_and_back =
        "[conditions.top.displacement]\non = \"top\"\nx = 0\ny = \"0.01*(1-abs(2*t-1))\"";
    for coupling in ["splice", "truncated", "nonlocal", "local"] {
        for method in ["implicit", "relaxation"] {
            let mut text = scene(
                &format!("coupling = \"{coupling}\""),
                "x = 0\ny = 0",
                there_and_back,
            );
            if coupling != "local" {
                text += points;
            }
            if ["splice", "truncated"].contains(&coupling) {
                text += zone;
            }
            write(folder.path(), "back.toml", &text);
            let method = format!("solve.quasi-static.method={method}");
            run(folder.path(), &["back.toml", "--set", &method]);
            let u = column(&folder.path().join("out/back_history.csv"), "middle_uy");
            assert!(
                u[2] > 4e-3 && u[4].abs() < 1e-8,
                "{coupling}, {method}: {u:?}"
            );
        }
    }
    let text = scene(
        "coupling = \"local\"",
        "y = 0",
        "[conditions.top.traction]\non = \"top\"\nx = 1e-4",
    );
    write(folder.path(), "free.toml", &text);
    for method in ["auto", "krylov"] {
        let set = format!("solver.method={method}");
        let refused = bondline(folder.path())
            .args(["run", "free.toml", "--set", &set])
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(
            !refused.status.success() && said.contains("found no equilibrium"),
            "{method}: {said}"
        );
    }
}

/// The scene that breaks, by load steps.
fn breaking(coupling: &str, method: &str) -> String {
    let steps = format!("[solve.quasi-static]\nsteps = 8\nmethod = \"{method}\"\n");
    BREAKING
        .replace(
            "[solve.explicit]\nduration = 60\noutputs = 6\nhistory-interval = 1\n",
            &steps,
        )
        .replace("min(1, t / 8)", "t")
        .replace("0.004", "0.012")
        .replace("x = \"-0.012", "y = 0\nx = \"-0.012")
        .replace("coupling.splice", &format!("coupling.{coupling}"))
}

/// Asks a run to end at one of the iterations of its load steps.
struct EndsAt {
    at: u64,
    iterations: AtomicU64,
    asked: AtomicBool,
}

impl Progress for EndsAt {
    fn stage(&self, _name: &str, _total: Option<u64>) {}

    fn advance(&self, by: u64) {
        let iteration = self
            .iterations
            .fetch_add(u64::from(by == 0), Ordering::Relaxed);
        if by == 0 && iteration == self.at {
            self.asked.store(true, Ordering::Relaxed);
        }
    }

    fn finish(&self) {}
}

#[test]
fn an_interrupt_within_a_load_step_goes_back_to_the_last_one() {
    let plastic = crate::laws::scene(
        "splice",
        "plastic-correspondence]\npoisson-ratio = 0.3\nyield-stress = 5\nhardening-modulus = 250",
        crate::laws::STEPS,
    );
    for typed in [
        breaking("truncated", "implicit"),
        breaking("splice", "relaxation").replace("steps = 8", "steps = 3\ntolerance = 1e-5"),
        plastic,
    ] {
        let folder = tempfile::tempdir().unwrap();
        let go = |name: &str, start: StartFrom, at: u64| {
            let source = Source::new("bar.toml", &typed);
            let mut scene = AnyScene::from_source(&source, folder.path(), "bar").unwrap();
            scene.set_output_directory(folder.path().join(name));
            let listener = EndsAt {
                at,
                iterations: AtomicU64::new(0),
                asked: AtomicBool::new(false),
            };
            let options = RunOptions {
                start,
                interrupt: Some(&listener.asked),
                ..RunOptions::default()
            };
            let summary = scene.run_with(&options, &listener).unwrap();
            (summary.motion.unwrap(), listener.iterations.into_inner())
        };
        let (_, iterations) = go("whole", StartFrom::Beginning, u64::MAX);
        let mut within = 0;
        for part in [1, 5, 8] {
            let name = format!("part{part}");
            let (motion, _) = go(&name, StartFrom::Beginning, iterations * part / 10);
            assert_eq!(motion.ended, Ended::Interrupted, "{part}");
            // what it says is of the load step that it went back to
            let history = folder.path().join(&name).join("bar_history.csv");
            if history.exists() {
                let last = |name: &str| *column(&history, name).last().unwrap();
                assert_eq!(motion.steps as f64, last("step"), "{part}");
                let [stored, dissipated] = ["stored_energy", "dissipated_energy"].map(last);
                let lost = motion.cracks.map_or(0.0, |c| c.dissipated_energy);
                let lost = lost + motion.inelastic_energy.unwrap_or(0.0);
                let all = 1e-12 * (stored + dissipated);
                assert!((motion.stored_energy - stored).abs() <= all, "{part}");
                assert!(
                    (lost - dissipated).abs() <= all,
                    "{part}: {lost} {dissipated}"
                );
                within += 1;
            }
            let (motion, _) = go(&name, StartFrom::Checkpoint, u64::MAX);
            assert_eq!(motion.ended, Ended::Finished, "{part}");
            let _ = std::fs::remove_file(folder.path().join(&name).join("bar.checkpoint"));
            same(&folder.path().join("whole"), &folder.path().join(&name));
        }
        assert!(within >= 2, "{within} interrupts within load steps");
    }
}

#[test]
fn load_steps_break_bonds_and_resume_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let scene = breaking("splice", "implicit");
    write(folder.path(), "load.toml", &scene);
    let every = ["load.toml", "--checkpoint-every", "1"];
    run(
        folder.path(),
        &[&every[..], &["--output", "whole"]].concat(),
    );
    let broken = column(
        &folder.path().join("whole/load_history.csv"),
        "broken_bonds",
    );
    assert!(*broken.last().unwrap() > 0.0, "{broken:?}");
    assert!(broken.windows(2).all(|w| w[0] <= w[1]), "{broken:?}");
    // taken up again from the state after the last step but one
    run(
        folder.path(),
        &[&every[..], &["--output", "again"]].concat(),
    );
    std::fs::remove_file(folder.path().join("again/load.checkpoint")).unwrap();
    run(
        folder.path(),
        &[
            &every[..],
            &["--output", "again", "--resume", "--threads", "1"],
        ]
        .concat(),
    );
    same(&folder.path().join("whole"), &folder.path().join("again"));
}

/// A script that reads the table of a tip need not know whether anything broke.
#[test]
fn a_tip_that_never_begins_has_a_table_without_rows() {
    let folder = tempfile::tempdir().unwrap();
    let scene = breaking("splice", "implicit").replace("0.012", "0.0001");
    write(folder.path(), "load.toml", &scene);
    run(folder.path(), &["load.toml"]);
    let (header, rows) = table(&folder.path().join("out/load_tip_notch.csv"));
    assert_eq!(header, ["step", "time", "x", "y", "damage"]);
    assert!(rows.is_empty(), "{rows:?}");
}

/// A quarter of a ring from Gmsh, sheared at one end; the seam fits nothing and meets both arcs.
const RING: &str = r#"
kinematics = "plane-stress"

[mesh.file]
path = "quarter_ring.msh"

[materials.m.lps]
youngs-modulus = 1
poisson-ratio = 0.3
critical-stretch = 4e-5

[peridynamics]
horizon = 0.09
points.lattice = { spacing = 0.03 }

[zones.nonlocal]
box = { min = [0.5, 0.2], max = [2.1, 0.7] }

[conditions.bottom.displacement]
on = "bottom"
x = 0
y = 0

[conditions.left.displacement]
on = "left"
x = 1e-4
y = 0

[solve.quasi-static]
steps = 1
"#;

#[test]
fn bonds_of_a_seam_that_fits_nothing_break_by_their_whole_stretch() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "ring.toml", RING);
    let meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../meshes");
    std::fs::copy(
        meshes.join("quarter_ring.msh"),
        folder.path().join("quarter_ring.msh"),
    )
    .unwrap();
    let broken = |coupling: &str, stretch: &str| {
        let coupling = format!("coupling={coupling}");
        let stretch = format!("materials.m.lps.critical-stretch={stretch}");
        let sets = ["--set", &coupling, "--set", &stretch];
        let warn = ["--set", "zones.damage-at-edge=warn"];
        run(folder.path(), &[&["ring.toml"][..], &sets, &warn].concat());
        let column = column(&folder.path().join("out/ring_history.csv"), "broken_bonds");
        column[column.len() - 1]
    };
    // the splice, which cuts no bonds, tells how far any is stretched; pieces of half a spacing are by more
    for coupling in ["splice", "truncated"] {
        assert_eq!(broken(coupling, "4e-5"), 0.0, "{coupling}");
        assert!(broken(coupling, "2.6e-5") > 500.0, "{coupling}");
    }
}

/// A notched plate that is pulled until it parts, in steps that are longer than its crack takes.
const PULLED: &str = r#"
kinematics = "plane-stress"
coupling = "truncated"
[mesh.rectangle]
min = [0, 0]
max = [24, 12]
x = { cells = 24 }
y = { cells = 12 }
[materials.m.lps]
youngs-modulus = 1000
poisson-ratio = 0.2
fracture-energy = 0.01
[peridynamics]
horizon = 3
points.lattice = { spacing = 1, origin = [0.5, 0.5] }
[zones]
nonlocal.box = { min = [6, -1], max = [18, 13] }
[cracks.notch]
polyline = [[12, -1], [12, 4]]
[conditions.left.displacement]
inside.box = { min = [-1, -1], max = [3, 13] }
x = 0
y = 0
[conditions.right.displacement]
inside.box = { min = [21, -1], max = [25, 13] }
x = "0.1 * t"
y = 0
[solve.quasi-static]
steps = 8
[output]
vtu = false
"#;

#[test]
fn a_body_that_has_parted_ends_the_run_unless_it_is_to_go_on() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "pulled.toml", PULLED);
    let summary = |more: &[&str]| {
        let arguments = [&["pulled.toml", "--json"], more].concat();
        let said = run(folder.path(), &arguments);
        serde_json::from_str::<serde_json::Value>(&said).unwrap()["motion"].clone()
    };
    let parted = summary(&[]);
    assert_eq!(parted["ended"], "parted");
    let steps = parted["steps"].as_u64().unwrap();
    assert!((2..8).contains(&steps), "{steps}");
    let rows = column(&folder.path().join("out/pulled_history.csv"), "step");
    assert_eq!(rows.last(), Some(&(steps as f64)));
    let whole = summary(&["--set", "solve.quasi-static.when-parted=continue"]);
    assert_eq!(whole["ended"], "finished");
    assert_eq!(whole["steps"], 8);
    // a point that hangs between the parts by single bonds may go on to lose them
    let broken = [&parted, &whole].map(|m| m["broken_bonds"].as_f64().unwrap());
    assert!(
        broken[0] <= broken[1] && broken[1] < 1.02 * broken[0],
        "{broken:?}"
    );
    let said = run(folder.path(), &["pulled.toml"]);
    let left = format!("{} load steps are left", 8 - steps);
    assert!(said.contains(&left), "{said}");
}

#[test]
fn factors_without_the_broken_bonds_lead_to_the_same_states() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "pulled.toml", PULLED);
    let of = |method: &str| {
        let set = format!("solver.method={method}");
        let said = run(folder.path(), &["pulled.toml", "--json", "--set", &set]);
        let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
        let choices = summary["choices"].to_string();
        (summary["motion"].clone(), choices)
    };
    let [(led, told), (iterated, _)] = ["auto", "krylov"].map(of);
    assert!(told.contains("of whose tangents were factorised"), "{told}");
    assert_eq!(led["broken_bonds"], iterated["broken_bonds"]);
    let work = |m: &serde_json::Value| m["external_work"].as_f64().unwrap();
    assert!((work(&led) / work(&iterated) - 1.0).abs() < 1e-6);
}
