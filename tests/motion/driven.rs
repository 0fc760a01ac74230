//! Bars that vibrate and are driven, against closed forms; the time step.

use crate::{BREAKING, MODE, bondline, column, run, write};

#[test]
fn a_vibrating_bar_keeps_the_frequency_of_its_scheme() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", MODE);
    let said = run(folder.path(), &["bar.toml", "--json"]);
    let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
    let motion = &summary["motion"];
    let dt = motion["step"].as_f64().unwrap();
    // c = 2, h = 1/40: lumped masses give the limit h/c, of which 0.95 less a margin of some per cent is taken
    let share = dt / (1.0 / 80.0);
    assert!((0.90..=0.951).contains(&share), "{share}");
    // lumped masses: ω = 2c/h sin(πh/4L); velocity Verlet: sin(ω'Δt/2) = ωΔt/2
    let h = 1.0 / 40.0;
    let omega = 2.0 * 2.0 / h * (std::f64::consts::PI * h / 4.0).sin();
    let omega = 2.0 / dt * (0.5 * omega * dt).asin();
    let history = folder.path().join("out/bar_history.csv");
    let (times, ends) = (column(&history, "time"), column(&history, "end_ux"));
    assert!(times.len() > 300);
    let error = times
        .iter()
        .zip(&ends)
        .map(|(t, u)| (u - 0.01 * (omega * t).cos()).abs())
        .fold(0.0, f64::max);
    assert!(error < 1e-12, "{error}");
    let energy = column(&history, "discrete_energy");
    let drift = energy[2..]
        .iter()
        .map(|e| (e / energy[1] - 1.0).abs())
        .fold(0.0, f64::max);
    assert!(drift < 1e-12, "{drift}");
}

#[test]
fn a_prescribed_velocity_is_the_derivative_of_its_displacement() {
    let folder = tempfile::tempdir().unwrap();
    let free = MODE
        .replace(
            "[initial.mode.displacement]\nx = \"0.01 * sin(pi * x / 2)\"",
            "",
        )
        .replace("duration = 5", "duration = 1");
    let ends = |name: &str, condition: &str| {
        let scene = free.replace(
            "[conditions.left.displacement]\non = \"left\"\nx = 0",
            condition,
        );
        write(folder.path(), &format!("{name}.toml"), &scene);
        run(folder.path(), &[&format!("{name}.toml")]);
        column(
            &folder.path().join(format!("out/{name}_history.csv")),
            "end_ux",
        )
    };
    let moved = ends(
        "moved",
        "[conditions.left.displacement]\non = \"left\"\nx = \"0.01 * (1 - cos(3 * t))\"",
    );
    let driven = ends(
        "driven",
        "[conditions.left.velocity]\non = \"left\"\nx = \"0.03 * sin(3 * t)\"",
    );
    let steady = ends(
        "steady",
        "[conditions.left.velocity]\non = \"left\"\nx = 0.02",
    );
    assert_eq!(moved.len(), driven.len());
    for (a, b) in moved.iter().zip(&driven) {
        // Simpson's rule over steps of 0.012
        assert!((a - b).abs() < 1e-10, "{a} {b}");
    }
    // the end of a bar that is pushed at 0.02 moves at twice that once the wave has arrived, at t = 0.5
    let last = steady.last().unwrap();
    assert!((last - 0.02).abs() < 4e-4, "{last}");
}

#[test]
fn a_traction_that_varies_in_time_is_that_of_its_factors() {
    let folder = tempfile::tempdir().unwrap();
    // time alone, and time beside a coordinate that changes nothing: two ways through the driver
    let mut found = Vec::new();
    for (name, x) in [
        ("alone", "0.01 * sin(9 * t)"),
        ("both", "0.01 * sin(9 * t) * x"),
    ] {
        let scene = format!("{MODE}[conditions.pulled.traction]\non = \"right\"\nx = \"{x}\"\n");
        write(folder.path(), &format!("{name}.toml"), &scene);
        run(folder.path(), &[&format!("{name}.toml")]);
        found.push(column(
            &folder.path().join(format!("out/{name}_history.csv")),
            "end_ux",
        ));
        let work = column(
            &folder.path().join(format!("out/{name}_history.csv")),
            "external_work",
        );
        assert!(work.iter().any(|w| w.abs() > 1e-6));
    }
    for (a, b) in found[0].iter().zip(&found[1]) {
        assert!((a - b).abs() < 1e-15);
    }
}

#[test]
fn a_step_beyond_the_limit_is_refused_or_shortened() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", MODE);
    // the limit of lumped masses is h/c = 1/80
    let step = format!("solve.explicit.step={}", 1.02 / 80.0);
    let output = bondline(folder.path())
        .args(["run", "bar.toml", "--set", &step])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert!(said.contains("larger than the stable step"), "{said}");
    assert!(
        !folder.path().join("out").exists(),
        "refused before it starts"
    );
    let said = run(
        folder.path(),
        &[
            "bar.toml",
            "--set",
            &step,
            "--set",
            "solve.explicit.beyond-limit=shorten",
            "--json",
        ],
    );
    let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert!(summary["motion"]["step"].as_f64().unwrap() < 1.0 / 80.0);
    assert!(summary["choices"].to_string().contains("is beyond it"));
}

#[test]
fn check_predicts_the_steps_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", BREAKING);
    let output = bondline(folder.path())
        .args(["check", "bar.toml", "--json"])
        .output()
        .unwrap();
    assert!(output.status.success());
    let predicted: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let said = run(folder.path(), &["bar.toml", "--json"]);
    let measured: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(predicted["sizes"], measured["sizes"]);
    let (p, m) = (&predicted["motion"], &measured["motion"]);
    assert_eq!(p["steps"], m["of_steps"]);
    assert_eq!(p["step"], m["step"]);
    assert!(p["certified_step"].as_f64() <= p["stable_step"].as_f64());
    assert!(p["seconds_per_step"].as_f64().unwrap() > 0.0);
    let bytes = |v: &serde_json::Value| v["peak_memory_bytes"].as_f64().unwrap();
    let ratio = bytes(&predicted) / bytes(&measured);
    assert!((0.7..=1.4).contains(&ratio), "{ratio}");
}

/// Every mass counts once at faces where bonds end, whether points lie halfway inside of them (the default with this coupling), on them, or a void takes some away.
#[test]
fn a_truncated_plate_has_the_momentum_of_its_mass() {
    let scene = |rest: &str, points: &str| {
        format!(
            "kinematics = \"plane-stress\"\n{rest}
            mesh.rectangle = {{ min = [0, 0], max = [2, 1], x = {{ cells = 20 }}, y = {{ cells = 10 }} }}
            materials.glass.bond-based = {{ youngs-modulus = 1, density = 3 }}
            peridynamics = {{ horizon = 0.1, points.lattice = {{ spacing = 0.05{points} }} }}
            zones.nonlocal.box = {{ min = [0.5, 0.3], max = [1.5, 0.7] }}
            coupling = \"truncated\"
            solve.explicit = {{ duration = 0.05, outputs = 0 }}
            initial.all.velocity.x = 1
            output.directory = \"out\"\n"
        )
    };
    let folder = tempfile::tempdir().unwrap();
    let void = "voids.hole.inside.box = { min = [0.9, 0.4], max = [1.1, 0.6] }\n";
    for (name, rest, points, area) in [
        ("inside", "", "", 2.0),
        ("on", "", ", origin = [0, 0]", 2.0),
        ("void", void, "", 1.96),
    ] {
        write(folder.path(), &format!("{name}.toml"), &scene(rest, points));
        run(folder.path(), &[&format!("{name}.toml")]);
        let history = folder.path().join(format!("out/{name}_history.csv"));
        let momentum = column(&history, "momentum_x")[0];
        assert!(
            (momentum / (3.0 * area) - 1.0).abs() < 1e-12,
            "{name}: {momentum}"
        );
    }
}

/// Weights in four bytes lie in lists, those in eight on a lattice: what breaks, and what it costs, is the same, also beside points that belong to elements.
#[test]
fn bonds_in_four_bytes_break_alike() {
    let folder = tempfile::tempdir().unwrap();
    // a crack that breaks bonds as far as the seam, in a zone that elements enclose
    let scene = r#"
kinematics = "plane-stress"
coupling = "splice"
[mesh.rectangle]
min = [0, 0]
max = [1, 1]
x = { cells = 24 }
y = { cells = 24 }
[materials.plate.bond-based]
youngs-modulus = 1
density = 1
critical-stretch = 0.02
[peridynamics]
horizon = "2/24"
points.lattice = { spacing = "1/24" }
[zones]
damage-at-edge = "warn"
nonlocal = { box = { min = [0.2499, 0.2499], max = [0.7501, 0.7501] } }
[cracks.notch]
segment = { from = [0.4, 0.51], to = [0.6, 0.51] }
[conditions.bottom.displacement]
on = "bottom"
x = 0
y = 0
[conditions.top.displacement]
on = "top"
x = 0
y = "0.02*min(1,t/10)"
[solve.explicit]
duration = 20
outputs = 2
# a mode of this seam grows by exp(2.2) over the run: here two ways of keeping weights are compared, both with it
"#;
    write(folder.path(), "notch.toml", scene);
    for precision in ["double", "single"] {
        let set = format!("peridynamics.precision={precision}");
        run(
            folder.path(),
            &["notch.toml", "--set", &set, "--output", precision],
        );
    }
    let of = |precision: &str, name: &str| {
        column(
            &folder.path().join(precision).join("notch_history.csv"),
            name,
        )
    };
    for name in ["kinetic_energy", "dissipated_energy", "broken_bonds"] {
        let (double, single) = (of("double", name), of("single", name));
        let largest = double.iter().fold(0.0, |m: f64, v| m.max(*v));
        assert!(largest > 0.0, "{name}");
        for (a, b) in double.iter().zip(&single) {
            assert!((a - b).abs() < 1e-6 * largest, "{name}: {a} {b}");
        }
    }
}

/// A bar of EA = 4 and ρc = 2: the force of a support is EA ε in each load step, and ρ c v before a wave comes back.
#[test]
fn supports_tell_force_and_displacement_of_every_step() {
    let folder = tempfile::tempdir().unwrap();
    let bar = MODE
        .replace(
            "[initial.mode.displacement]\nx = \"0.01 * sin(pi * x / 2)\"",
            "",
        )
        .replace("[solve.explicit]\nduration = 5\noutputs = 2\n", "");
    let run_of = |name: &str, rest: &str| {
        write(
            folder.path(),
            &format!("{name}.toml"),
            &format!("{bar}{rest}"),
        );
        let said = run(folder.path(), &[&format!("{name}.toml"), "--json"]);
        let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
        let path = folder.path().join(format!("out/{name}_history.csv"));
        let of = |what: &str| column(&path, what);
        let columns = [
            of("time"),
            of("right_reaction_x"),
            of("right_displacement_x"),
            of("left_reaction_x"),
            of("left_displacement_x"),
        ];
        (summary, columns)
    };
    let (summary, [time, force, moved, back, held]) = run_of(
        "pulled",
        "[conditions.right.displacement]\non = \"right\"\nx = \"0.01 * t^2\"\n[solve.quasi-static]\nsteps = 5\n",
    );
    assert_eq!(time.len(), 6);
    for k in 0..6 {
        let strain = 0.01 * time[k] * time[k];
        assert!((moved[k] - strain).abs() < 1e-16, "{moved:?}");
        assert!((force[k] - 4.0 * strain).abs() < 1e-9 && (back[k] + force[k]).abs() < 1e-9);
        assert_eq!(held[k], 0.0);
    }
    let last: Vec<_> = summary["reactions"].as_array().unwrap().iter().collect();
    assert_eq!(last[0]["condition"], "left");
    assert_eq!(last[1]["condition"], "right");
    assert_eq!(last[1]["force"][0].as_f64().unwrap(), force[5]);
    let (summary, [time, force, moved, back, _]) = run_of(
        "driven",
        "[conditions.right.velocity]\non = \"right\"\nx = \"0.01 * t^2\"\n[solve.explicit]\nduration = 0.45\n",
    );
    assert!(time.len() > 30);
    for k in 0..time.len() {
        let t = time[k];
        assert!(
            (moved[k] - 0.01 * t * t * t / 3.0).abs() < 1e-6,
            "{t}: {}",
            moved[k]
        );
        // the scheme spreads a wave by O(h²)
        assert!((force[k] - 0.02 * t * t).abs() < 1e-5, "{t}: {}", force[k]);
        assert!(back[k].abs() < 1e-5, "{t}: {}", back[k]);
    }
    let reaction = &summary["reactions"][1];
    assert_eq!(reaction["condition"], "right");
    assert_eq!(
        reaction["force"][0].as_f64().unwrap(),
        *force.last().unwrap()
    );
}
