//! Disks that fill up in the middle of a run, and files that turn into something else.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::{BREAKING, bondline, run, same, write};

/// Runs the bar where no file may grow beyond `blocks` of 512 bytes: to the program it looks like a full disk.
fn on_a_small_disk(folder: &Path, blocks: u32) -> (Option<i32>, String) {
    let limited = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\"");
    let output = Command::new("sh")
        .current_dir(folder)
        .args(["-c", &limited, "sh", env!("CARGO_BIN_EXE_bondline")])
        .args(["run", "bar.toml", "--checkpoint-every", "7"])
        .args(["--threads", "1", "--resume"])
        .env("NO_COLOR", "1")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!said.contains("panicked"), "{said}");
    let words: Vec<&str> = said.split_whitespace().filter(|w| *w != "│").collect();
    (output.status.code(), words.join(" "))
}

#[test]
#[cfg(target_os = "linux")]
fn a_run_on_a_full_disk_stops_by_name_and_goes_on_once_there_is_room() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", BREAKING);
    let every = ["bar.toml", "--checkpoint-every", "7", "--threads", "1"];
    run(
        folder.path(),
        &[&every[..], &["--output", "whole"]].concat(),
    );
    let mut stopped_by = Vec::new();
    // the first file of fields, a checkpoint, a later file of fields; each goes on where the last one stopped
    for blocks in [4, 24, 60] {
        let (status, said) = on_a_small_disk(folder.path(), blocks);
        assert_eq!(status, Some(1), "{said}");
        for word in ["cannot write out/bar", "File too large", "output folder"] {
            assert!(said.contains(word), "{word} is missing in {said}");
        }
        let end = said.split("cannot write out/bar").nth(1).unwrap();
        stopped_by.push(end.split(':').next().unwrap().to_owned());
        // no half file under a name that a reader would take for a whole one, and none left over
        for file in std::fs::read_dir(folder.path().join("out")).unwrap() {
            let name = file.unwrap().file_name().to_string_lossy().into_owned();
            assert!(!name.ends_with(".part"), "{name}");
        }
    }
    assert_eq!(stopped_by, ["_0000.vtu", ".checkpoint", "_0001.vtu"]);
    run(folder.path(), &[&every[..], &["--resume"]].concat());
    same(&folder.path().join("whole"), &folder.path().join("out"));
}

#[test]
fn a_checkpoint_that_cannot_be_read_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "bar.toml", BREAKING);
    let short = ["--set", "solve.explicit.duration=6"];
    run(
        folder.path(),
        &[&["bar.toml", "--checkpoint-every", "5"], &short[..]].concat(),
    );
    let checkpoint = folder.path().join("out/bar.checkpoint");
    let whole = std::fs::read(&checkpoint).unwrap();
    std::fs::remove_file(folder.path().join("out/bar.checkpoint.previous")).unwrap();
    let refused = |what: &str| {
        let output = bondline(folder.path())
            .args(["run", "bar.toml", "--resume"])
            .args(short)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(output.status.code(), Some(1), "{what}: {said}");
        assert!(
            said.contains(what) && !said.contains("panicked"),
            "{what}: {said}"
        );
        assert!(said.contains("without --resume"), "{said}");
    };
    // a folder in its place stands for what not even root may read
    std::fs::remove_file(&checkpoint).unwrap();
    std::fs::create_dir(&checkpoint).unwrap();
    refused("cannot read the checkpoint");
    std::fs::remove_dir(&checkpoint).unwrap();
    // whole by its checksum, and still not the state of this scene: a state within another
    let head = 8 + 4 + 8;
    let mut longer = whole[..whole.len() - 12].to_vec();
    longer.push(0);
    longer.extend(((longer.len() - head) as u64).to_le_bytes());
    let sum = crc32fast::hash(&longer);
    longer.extend(sum.to_le_bytes());
    std::fs::write(&checkpoint, longer).unwrap();
    refused("bytes are left over");
    let mut counts = whole[..head].to_vec();
    // every count in it says that billions of numbers follow
    counts.extend([0xff; 64]);
    counts.extend(64u64.to_le_bytes());
    let sum = crc32fast::hash(&counts);
    counts.extend(sum.to_le_bytes());
    std::fs::write(&checkpoint, counts).unwrap();
    refused("does not hold what this scene needs");
}
