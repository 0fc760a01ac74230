//! Loads that grow step by step.

use crate::{BREAKING, column, run, same, table, write};

#[test]
fn load_steps_end_where_the_static_solve_does_by_either_method() {
    let folder = tempfile::tempdir().unwrap();
    // nothing breaks: the loads are a tenth of those of the scene in time
    let still = BREAKING
        .replace(
            "[solve.explicit]\nduration = 60\noutputs = 6\nhistory-interval = 1\n",
            "",
        )
        .replace(" * min(1, t / 8)", "")
        .replace("tips.notch = { direction = [0, -1], threshold = 0.2 }", "")
        .replace("damage-at-edge = \"warn\"\n", "")
        .replace("[no-fail.base]\nbox = { min = [3, 0], max = [9, 1] }\n", "")
        .replace("critical-stretch = 0.002\n", "")
        .replace("[coupling.splice]", "[coupling.truncated]")
        // a body in equilibrium has to be held
        .replace("x = \"-0.004", "y = 0\nx = \"-0.004");
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

#[test]
fn load_steps_break_bonds_and_resume_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let scene = BREAKING
        .replace(
            "[solve.explicit]\nduration = 60\noutputs = 6\nhistory-interval = 1\n",
            "[solve.quasi-static]\nsteps = 8\nmethod = \"implicit\"\n",
        )
        .replace("min(1, t / 8)", "t")
        .replace("0.004", "0.012")
        .replace("x = \"-0.012", "y = 0\nx = \"-0.012");
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
