//! Runs that are killed, interrupted, stopped and resumed.

use std::process::{Command, Stdio};
use std::time::Duration;

use crate::{BREAKING, MODE, bondline, column, run, same, table, uniform, write};

#[test]
fn a_run_killed_twenty_times_leaves_the_bytes_of_one_never_stopped() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", BREAKING);
    let every = ["bar.toml", "--checkpoint-every", "7"];
    let begun = std::time::Instant::now();
    run(
        folder.path(),
        &[&every[..], &["--output", "whole", "--threads", "1"]].concat(),
    );
    let whole = begun.elapsed();
    let broken = column(&folder.path().join("whole/bar_history.csv"), "broken_bonds");
    assert!(*broken.last().unwrap() > 20.0, "{broken:?}");

    let mut seed = 7;
    let (mut kills, mut ends) = (0, 0);
    while kills < 20 {
        let mut child = bondline(folder.path())
            .arg("run")
            .args(every)
            .args(["--output", "killed", "--resume", "--threads", "2"])
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // anywhere, from before the first file to after the last
        std::thread::sleep(whole.mul_f64(0.6 * uniform(&mut seed)));
        match child.try_wait().unwrap() {
            None => {
                // SIGKILL: nothing is tidied up
                child.kill().unwrap();
                child.wait().unwrap();
                kills += 1;
            }
            Some(status) => {
                let mut said = String::new();
                std::io::Read::read_to_string(&mut child.stderr.unwrap(), &mut said).unwrap();
                assert!(status.success(), "{said}");
                // begin again, so that every kill meets a run
                ends += 1;
                assert!(ends < 40, "only {kills} kills");
                same(&folder.path().join("whole"), &folder.path().join("killed"));
                std::fs::remove_dir_all(folder.path().join("killed")).unwrap();
            }
        }
    }
    run(
        folder.path(),
        &[&every[..], &["--output", "killed", "--resume"]].concat(),
    );
    same(&folder.path().join("whole"), &folder.path().join("killed"));
    println!("{kills} kills, {ends} ends between them");
}

#[test]
#[cfg(unix)]
fn an_interrupt_leaves_a_checkpoint_and_readable_files() {
    let folder = tempfile::tempdir().unwrap();
    // stable however long it runs
    let scene = BREAKING
        .replace("duration = 60", "duration = 600")
        .replace("coupling.splice", "coupling.truncated");
    write(folder.path(), "bar.toml", &scene);
    let child = bondline(folder.path())
        .args(["run", "bar.toml"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let history = folder.path().join("out/bar_history.csv");
    for _ in 0..600 {
        if std::fs::read_to_string(&history).is_ok_and(|t| t.lines().count() > 5) {
            break;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let sent = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(sent.success());
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(said.contains("go on with --resume"), "{said}");
    assert!(folder.path().join("out/bar.checkpoint").exists());
    let (header, rows) = table(&history);
    assert!(rows.len() > 5 && rows.iter().all(|r| r.len() == header.len()));
    let pvd = std::fs::read_to_string(folder.path().join("out/bar.pvd")).unwrap();
    assert!(pvd.ends_with("</VTKFile>\n"), "{pvd}");
    // and goes on from there
    let last = rows.last().unwrap()[0] as u64;
    let said = run(folder.path(), &["bar.toml", "--resume", "--json"]);
    let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(summary["motion"]["ended"], "finished");
    let choices = summary["choices"].to_string();
    assert!(choices.contains("resumed after step"), "{choices}");
    assert!(column(&history, "step").last().unwrap() > &(last as f64));
    let steps = column(&history, "step");
    assert!(steps.windows(2).all(|w| w[0] < w[1]), "rows twice");
}

#[test]
fn damage_at_the_edge_stops_a_run_with_its_outputs_written() {
    let folder = tempfile::tempdir().unwrap();
    let scene = BREAKING.replace("\"warn\"", "\"stop\"");
    write(folder.path(), "bar.toml", &scene);
    let output = bondline(folder.path())
        .args(["run", "bar.toml"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("edge of the nonlocal zone at t ="), "{said}");
    let times = column(&folder.path().join("out/bar_history.csv"), "time");
    assert!(*times.last().unwrap() < 59.0);
    let pvd = std::fs::read_to_string(folder.path().join("out/bar.pvd")).unwrap();
    let last = format!("{:e}", times.last().unwrap());
    assert!(pvd.contains(&last), "{last} is not in {pvd}");
}

#[test]
fn a_run_that_came_to_a_limit_takes_no_further_step_when_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let scene = BREAKING.replace("\"warn\"", "\"stop\"");
    write(folder.path(), "bar.toml", &scene);
    let ends = |more: &[&str]| {
        let arguments = ["run", "bar.toml", "--checkpoint-every", "1000"];
        let output = bondline(folder.path()).args(arguments).args(more).output();
        let output = output.unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        assert_eq!(output.status.code(), Some(3), "{said}");
        crate::files(&folder.path().join("out"))
    };
    let stopped = ends(&[]);
    for _ in 0..2 {
        assert!(stopped == ends(&["--resume"]), "other files");
    }
}

#[test]
fn checkpoints_of_another_scene_and_damaged_ones_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", BREAKING);
    run(
        folder.path(),
        &[
            "bar.toml",
            "--set",
            "solve.explicit.duration=6",
            "--checkpoint-every",
            "5",
        ],
    );
    let refused = |arguments: &[&str]| -> String {
        let output = bondline(folder.path())
            .args(["run", "bar.toml", "--resume"])
            .args(arguments)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(1));
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        said.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let said = refused(&[]);
    assert!(said.contains("another scene or mesh"), "{said}");
    assert!(
        said.contains("(`solve.explicit.duration` differs)"),
        "{said}"
    );
    let same_scene = ["--set", "solve.explicit.duration=6"];
    // what changes no result does not matter
    run(
        folder.path(),
        &[
            &[
                "bar.toml",
                "--resume",
                "--set",
                "title=\"again\"",
                "--checkpoint-every",
                "9",
            ],
            &same_scene[..],
        ]
        .concat(),
    );
    let checkpoint = folder.path().join("out/bar.checkpoint");
    let whole = std::fs::read(&checkpoint).unwrap();
    std::fs::remove_file(folder.path().join("out/bar.checkpoint.previous")).unwrap();
    for (bytes, what) in [
        (whole[..whole.len() / 2].to_vec(), "is cut off"),
        (b"something else".to_vec(), "is no checkpoint of bondline"),
        ([&whole[..8], &[99], &whole[9..]].concat(), "has format 99"),
        (
            whole
                .iter()
                .enumerate()
                .map(|(i, b)| b ^ u8::from(i == 200))
                .collect(),
            "is damaged",
        ),
    ] {
        std::fs::write(&checkpoint, bytes).unwrap();
        let said = refused(&same_scene);
        assert!(said.contains(what), "{what}: {said}");
        assert!(said.contains("without --resume"), "{said}");
    }
    // without the history that it continues
    std::fs::write(&checkpoint, &whole).unwrap();
    std::fs::write(folder.path().join("out/bar_history.csv"), "step\n").unwrap();
    let said = refused(&same_scene);
    assert!(said.contains("its checkpoint knows of"), "{said}");
}

#[test]
fn a_static_scene_has_no_checkpoints() {
    let folder = tempfile::tempdir().unwrap();
    let still = MODE
        .replace("[solve.explicit]\nduration = 5\noutputs = 2", "")
        .replace(
            "[initial.mode.displacement]\nx = \"0.01 * sin(pi * x / 2)\"",
            "",
        );
    write(folder.path(), "bar.toml", &still);
    let output = bondline(folder.path())
        .args(["run", "bar.toml", "--resume"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("static scene"));
    run(folder.path(), &["bar.toml", "--set", "solve=static"]);
}
