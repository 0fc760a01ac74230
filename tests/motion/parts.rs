//! Tests of features that parts need, together: springs, sections, tables from files, stresses at probes, across restarts and threads.

use std::path::Path;

use crate::{files, run, same, write};

/// A plate on springs that a measured load pulls until it tears.
const PLATE: &str = r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [12, 6]
x = { cells = 24 }
y = { cells = 12 }
[materials.plate.bond-based]
youngs-modulus = 1
density = 1
critical-stretch = 0.002
[peridynamics]
horizon = 1.5
points.lattice = { spacing = 0.43 }
[zones]
damage-at-edge = "warn"
nonlocal = { box = { min = [3, 0], max = [9, 6] } }
[cracks.notch]
segment = { from = [5.9, 3], to = [5.9, 6] }
[tables.pull]
file = "pull.csv"
[conditions.left.spring]
on = "left"
x = 0.5
y = 0.5
[conditions.right.displacement]
on = "right"
x = "0.02 * pull(t)"
[output]
stresses = ["von-mises"]
probes.middle = { at = [6, 2] }
probes.element = { at = [1, 2] }
sections.cut = { point = [6, 3], normal = [1, 0] }
"#;

const TIME: &str =
    "[solve.explicit]\nduration = 40\noutputs = 3\nhistory-interval = 1\ncheckpoint-every = 40\n";

const STEPS: &str = "[solve.quasi-static]\nsteps = [5, 8, 12, 20]\noutputs = 2\ncheckpoint-every = 1\n[conditions.right_y.displacement]\non = \"right\"\ny = 0\n";

fn scene(folder: &Path, solve: &str) {
    write(folder, "pull.csv", "t,u\n0,0\n8,0.1\n12,0.5\n40,1\n");
    write(folder, "bar.toml", &format!("{PLATE}{solve}"));
}

#[test]
fn parts_resume_with_the_same_bytes_on_any_number_of_threads() {
    for solve in [TIME, STEPS] {
        let (whole, parts) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        for (folder, threads) in [(&whole, "1"), (&parts, "2")] {
            scene(folder.path(), solve);
            run(folder.path(), &["bar.toml", "--threads", threads]);
        }
        same(&whole.path().join("out"), &parts.path().join("out"));
        let previous = parts.path().join("out/bar.checkpoint.previous");
        std::fs::rename(&previous, previous.with_extension("")).unwrap();
        let said = run(parts.path(), &["bar.toml", "--resume", "--threads", "2"]);
        assert!(said.contains("resumed after step"), "{said}");
        same(&whole.path().join("out"), &parts.path().join("out"));
        let history = &files(&whole.path().join("out"))["bar_history.csv"];
        let header = String::from_utf8_lossy(history);
        let header = header.lines().next().unwrap();
        for column in [
            "left_reaction_x",
            "cut_force_x",
            "cut_moment_z",
            "middle_von_mises",
        ] {
            assert!(header.contains(column), "{header}");
        }
        // a checkpoint belongs to the rows of its tables
        write(parts.path(), "pull.csv", "0,0\n8,0.1\n12,0.6\n40,1\n");
        let output = crate::bondline(parts.path())
            .args(["run", "bar.toml", "--resume"])
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains("another scene or mesh"), "{said}");
        assert!(said.contains("that the scene reads has changed"), "{said}");
    }
}
