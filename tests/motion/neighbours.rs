//! Runs side by side in one output folder.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Duration;

use crate::{BREAKING, bondline, files, run, uniform, write};

/// Scenes whose names begin alike.
const NAMES: [&str; 3] = ["bar", "bar_moving", "bar_tip"];

/// Writes the scenes, each with a load of its own, so that their results differ.
fn scenes(folder: &Path, duration: &str) {
    for (k, name) in NAMES.iter().enumerate() {
        let load = format!("0.00{}", 4 + k);
        let text = BREAKING.replace("0.004", &load);
        let text = text.replace("duration = 60", &format!("duration = {duration}"));
        // stable however long it runs
        let text = text.replace("coupling.splice", "coupling.truncated");
        write(folder, &format!("{name}.toml"), &text);
    }
}

fn start(folder: &Path, name: &str) -> Child {
    bondline(folder)
        .args(["run", &format!("{name}.toml"), "--threads", "1"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Ends a run: its exit status and what it said, on one line.
fn ended(child: Child) -> (Option<i32>, String) {
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let words: Vec<&str> = said.split_whitespace().filter(|w| *w != "│").collect();
    (output.status.code(), words.join(" "))
}

/// Waits until a file is there.
fn wait_for(path: &Path) {
    for _ in 0..12_000 {
        if path.exists() {
            return;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    panic!("{} does not come", path.display());
}

/// The files in a folder that belong to a scene.
fn of(all: &BTreeMap<String, Vec<u8>>, name: &str) -> BTreeMap<String, Vec<u8>> {
    let ends = ["_history.csv", "_tip_notch.csv", ".pvd"];
    let is_own = |file: &str| {
        let rest = file.strip_prefix(name).unwrap_or_default();
        let number = rest.strip_prefix('_').and_then(|r| r.strip_suffix(".vtu"));
        ends.contains(&rest) || number.is_some_and(|n| n.parse::<u32>().is_ok())
    };
    let own = all.iter().filter(|(file, _)| is_own(file));
    own.map(|(file, bytes)| (file.clone(), bytes.clone()))
        .collect()
}

#[test]
fn the_same_scene_twice_is_refused_by_name_and_others_go_on() {
    let folder = tempfile::tempdir().unwrap();
    scenes(folder.path(), "60000");
    let mut long = start(folder.path(), "bar_moving");
    wait_for(&folder.path().join("out/bar_moving_0000.vtu"));
    // as a killed run of the shorter name, and as the longer one at this moment
    let parts = [".bar_0001.vtu.99-1.part", ".bar_moving_0001.vtu.99-1.part"];
    for part in parts {
        write(&folder.path().join("out"), part, "half");
    }
    let (status, said) = ended(start(folder.path(), "bar_moving"));
    assert_eq!(status, Some(1), "{said}");
    let holder = format!("(process {}, scene `bar_moving`)", long.id());
    assert!(
        said.contains("another run writes out/bar_moving_history.csv"),
        "{said}"
    );
    assert!(
        said.contains(&holder) && said.contains("--output"),
        "{said}"
    );
    run(
        folder.path(),
        &["bar.toml", "--set", "solve.explicit.duration=2"],
    );
    let left = parts.map(|part| folder.path().join("out").join(part).exists());
    assert_eq!(left, [false, true]);
    assert!(long.try_wait().unwrap().is_none(), "the neighbour runs");
    long.kill().unwrap();
    long.wait().unwrap();
    // nothing is left of the claim of a run that was killed
    run(
        folder.path(),
        &["bar_moving.toml", "--set", "solve.explicit.duration=2"],
    );
    for file in files(&folder.path().join("out")).keys() {
        assert!(
            !file.ends_with(".part") && !file.ends_with(".lock"),
            "{file}"
        );
    }
}

/// `bar_0000` at rest writes the file that `bar` in motion begins with: whoever comes second is refused, also when the first has long ended.
#[test]
fn a_name_that_is_that_of_a_file_of_another_scene_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let moving = ["bar.toml", "--set", "solve.explicit.duration=2"];
    let text = BREAKING.replace("coupling.splice", "coupling.truncated");
    write(folder.path(), "bar.toml", &text);
    let still = text.replace(" * min(1, t / 8)", "");
    let (still, _) = still.split_once("[solve.explicit]").unwrap();
    let name = "output.name = \"bar_0000\"\n";
    let load = "[conditions.load.traction]\non = \"right\"\nx = 1e-6\n[conditions.left.displacement]\non = \"left\"\nx = 0\ny = 0\n";
    write(folder.path(), "still.toml", &format!("{name}{still}{load}"));
    let at_rest = ["still.toml"];
    let refused = |arguments: &[&str], parts: &[&str]| {
        let output = bondline(folder.path()).arg("run").args(arguments).output();
        let said = String::from_utf8(output.unwrap().stderr).unwrap();
        let said = said.split_whitespace().filter(|w| *w != "│");
        let said = said.collect::<Vec<_>>().join(" ");
        for part in parts {
            assert!(said.contains(part), "{said}");
        }
    };
    run(folder.path(), &moving);
    let before = files(&folder.path().join("out"));
    refused(
        &at_rest,
        &["out/bar_0000.vtu belongs to out/bar.pvd", "--output"],
    );
    assert!(before == files(&folder.path().join("out")));
    // what was killed, whatever it left, begins again
    for left in ["bar.pvd", "bar_history.csv"] {
        std::fs::remove_file(folder.path().join("out").join(left)).unwrap();
        run(folder.path(), &moving);
    }
    std::fs::remove_dir_all(folder.path().join("out")).unwrap();
    run(folder.path(), &at_rest);
    refused(
        &moving,
        &[
            "out/bar_0000.vtu belongs to a scene of another name",
            "output.name",
        ],
    );
}

/// No file of a run that did not end is left.
fn none_left_behind(out: &Path) {
    for file in files(out).keys() {
        assert!(
            !file.ends_with(".part") && !file.ends_with(".lock"),
            "{file}"
        );
    }
}

/// Pairs of runs into one folder, begun in random order and killed at random: every run ends right or with a refusal by name, and no file of one is
/// touched by another. `BONDLINE_PAIRS` says how many.
#[test]
fn random_pairs_leave_each_other_alone() {
    let pairs = std::env::var("BONDLINE_PAIRS").map_or(8, |n| n.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    scenes(folder.path(), "20");
    let begun = std::time::Instant::now();
    let wanted = NAMES.map(|name| {
        run(
            folder.path(),
            &[
                &format!("{name}.toml"),
                "--output",
                "alone",
                "--threads",
                "1",
            ],
        );
        of(&files(&folder.path().join("alone")), name)
    });
    let one = begun.elapsed() / NAMES.len() as u32;
    assert!(
        wanted.iter().all(|w| w.len() > 5) && wanted[0]["bar.pvd"] != wanted[1]["bar_moving.pvd"]
    );
    let out = folder.path().join("out");
    let mut seed = 11;
    let mut random = move || uniform(&mut seed);
    let (mut right, mut refused, mut killed) = (0, 0, 0);
    // whether the files of a scene are those of a run that ended
    let mut whole = [false; NAMES.len()];
    for _ in 0..pairs {
        let picked = [0, 1].map(|_| (random() * NAMES.len() as f64) as usize);
        let before = files_or_none(&out);
        let mut children = Vec::new();
        for k in picked {
            children.push(start(folder.path(), NAMES[k]));
            std::thread::sleep(one.mul_f64(0.5 * random()));
        }
        for child in &mut children {
            if random() < 0.4 {
                std::thread::sleep(one.mul_f64(random()));
                child.kill().unwrap();
            }
        }
        for k in picked {
            // until one of its runs ends
            whole[k] = false;
        }
        for (k, child) in picked.into_iter().zip(children) {
            match ended(child) {
                (None, _) => killed += 1,
                (Some(0), _) => {
                    right += 1;
                    whole[k] = picked[0] != picked[1];
                }
                (status, said) => {
                    assert_eq!(status, Some(1), "{said}");
                    assert!(said.contains("another run writes out/"), "{said}");
                    refused += 1;
                }
            }
        }
        let now = files_or_none(&out);
        for (k, name) in NAMES.iter().enumerate() {
            if !picked.contains(&k) {
                assert!(of(&before, name) == of(&now, name), "{name} was touched");
            } else if whole[k] {
                assert!(of(&now, name) == wanted[k], "{name} differs");
            }
        }
    }
    for (k, name) in NAMES.iter().enumerate() {
        run(folder.path(), &[&format!("{name}.toml")]);
        assert!(of(&files(&out), name) == wanted[k], "{name} differs");
    }
    none_left_behind(&out);
    println!("{pairs} pairs: {right} runs right, {refused} refused, {killed} killed");
}

fn files_or_none(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    match folder.is_dir() {
        true => files(folder),
        false => BTreeMap::new(),
    }
}

/// Load steps without number take no memory before they are done, and an interrupt ends them.
#[test]
#[cfg(target_os = "linux")]
fn ten_thousand_million_load_steps_begin() {
    let folder = tempfile::tempdir().unwrap();
    let scene = crate::MODE.replace(
        "[solve.explicit]\nduration = 5\noutputs = 2\n[initial.mode.displacement]\nx = \"0.01 * sin(pi * x / 2)\"",
        "[solve.quasi-static]\nsteps = 10000000000\noutputs = 1\n[conditions.right.displacement]\non = \"right\"\nx = \"0.01 * t\"",
    );
    assert!(scene.contains("steps = "));
    write(folder.path(), "bar.toml", &scene);
    // a byte for each step would be more than twice that; on processors with large caches products of matrices reserve a GiB, of which they touch little
    let limited = "ulimit -v 4000000; exec \"$@\"";
    let child = std::process::Command::new("sh")
        .current_dir(folder.path())
        .args(["-c", limited, "sh", env!("CARGO_BIN_EXE_bondline")])
        .args(["run", "bar.toml", "--threads", "1"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    wait_for(&folder.path().join("out/bar_0000.vtu"));
    let sent = std::process::Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(sent.unwrap().success());
    let (status, said) = ended(child);
    assert_eq!(status, Some(130), "{said}");
    assert!(said.contains("once more ends at once"), "{said}");
}

#[test]
#[cfg(unix)]
fn a_pipe_in_place_of_a_checkpoint_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", crate::MODE);
    std::fs::create_dir(folder.path().join("out")).unwrap();
    let pipe = folder.path().join("out/bar.checkpoint");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.unwrap().success());
    let mut child = bondline(folder.path())
        .args(["run", "bar.toml", "--resume"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    for _ in 0..12_000 {
        if child.try_wait().unwrap().is_some() {
            break;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    // one that waits for a writer is ended here, and has no exit status
    let _ = child.kill();
    let (status, said) = ended(child);
    assert_eq!(status, Some(1), "{said}");
    assert!(said.contains("it is a named pipe, not a file"), "{said}");
}
