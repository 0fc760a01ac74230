//! Tests of the data that an observer receives from a run, against the files of the same run.

use std::path::Path;
use std::sync::Mutex;

use super::{AnyScene, RunOptions};
use crate::observe::Observer;
use crate::observe::csv::Entry;
use crate::observe::vtu::{Compression, Snapshot, write_vtu};
use crate::progress::Silent;
use crate::scene::Source;

const BAR: &str = r#"
kinematics = "bar"
coupling = "splice"
mesh.line = { min = 0, max = 10, x = { cells = 40 } }
materials.bar.bond-based = { youngs-modulus = 1, density = 1, critical-stretch = 0.1 }
peridynamics = { horizon = 0.75, points.lattice.spacing = 0.25 }
zones.nonlocal.box = { min = 4, max = 6 }
conditions.left.displacement = { on = "left", x = 0 }
conditions.right.traction = { on = "right", x = 1e-3 }
"#;
const STILL: &str =
    "output = { lines.axis = { from = 0, to = 10, samples = 5 }, probes.middle.at = 5 }";
const MOVING: &str = "solve.explicit = { duration = 2, outputs = 3, history-interval = 0.5 }\n\
    output = { probes.middle.at = 5, tips.front.direction = [1] }";

#[derive(Debug, Default)]
struct Seen {
    files: bool,
    snapshots: Mutex<Vec<Snapshot>>,
    rows: Mutex<Vec<(String, String)>>,
}

impl Observer for Seen {
    fn wants_files(&self) -> bool {
        self.files
    }

    fn row(&self, table: &str, columns: &[String], row: &[Entry]) {
        assert_eq!(columns.len(), row.len());
        let entries = row.iter().map(|entry| match entry {
            Entry::Real(x) => format!("{x}"),
            Entry::Integer(n) => n.to_string(),
            Entry::Text(text) => text.clone(),
        });
        let row = entries.collect::<Vec<_>>().join(",");
        self.rows.lock().unwrap().push((table.to_owned(), row));
    }

    fn snapshot(&self, snapshot: Snapshot) {
        self.snapshots.lock().unwrap().push(snapshot);
    }
}

fn observed(more: &str, folder: &Path, files: bool) -> Seen {
    let seen = Seen {
        files,
        ..Seen::default()
    };
    let source = Source::new("bar.toml", format!("{BAR}{more}"));
    let mut scene = AnyScene::from_source(&source, Path::new(""), "bar").unwrap();
    scene.set_output_directory(folder.to_path_buf());
    let options = RunOptions {
        observer: Some(&seen),
        ..RunOptions::default()
    };
    let summary = scene.run_with(&options, &Silent).unwrap();
    assert_eq!(summary.files.is_empty(), !files);
    seen
}

#[test]
fn an_observer_sees_what_the_files_hold_and_needs_none() {
    let none = tempfile::tempdir().unwrap();
    let unwritten = none.path().join("never");
    for (more, shown, tables) in [
        (STILL, &["bar.vtu"][..], &["axis", "probes"][..]),
        (
            MOVING,
            &[
                "bar_0000.vtu",
                "bar_0001.vtu",
                "bar_0002.vtu",
                "bar_0003.vtu",
            ],
            &["history"],
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let written = observed(more, folder.path(), true);
        let alone = observed(more, &unwritten, false);
        assert!(!unwritten.exists(), "a run without files made a folder");
        let snapshots = alone.snapshots.into_inner().unwrap();
        assert_eq!(snapshots, *written.snapshots.lock().unwrap());
        assert_eq!(snapshots.len(), shown.len());
        for (snapshot, name) in snapshots.iter().zip(shown) {
            let copy = none.path().join(name);
            write_vtu(&copy, snapshot, Compression::Zlib).unwrap();
            let file = std::fs::read(folder.path().join(name)).unwrap();
            assert!(std::fs::read(&copy).unwrap() == file, "{name}");
        }
        let rows = alone.rows.into_inner().unwrap();
        assert_eq!(rows, *written.rows.lock().unwrap());
        for name in tables {
            let text =
                std::fs::read_to_string(folder.path().join(format!("bar_{name}.csv"))).unwrap();
            let numbers =
                |line: &str| -> Vec<f64> { line.split(',').map(|x| x.parse().unwrap()).collect() };
            let seen = rows.iter().filter(|(table, _)| table == name);
            let seen: Vec<Vec<f64>> = seen.map(|(_, row)| numbers(row)).collect();
            let file: Vec<Vec<f64>> = text.lines().skip(1).map(numbers).collect();
            assert!(!file.is_empty() && seen == file, "{name}");
        }
    }
}
