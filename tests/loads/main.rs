//! Loads and supports of engineers' parts, through scenes as they are typed, against closed forms.

use bondline::observe::summary::RunSummary;
use bondline::progress::Silent;
use bondline::run::AnyScene;
use bondline::scene::Source;

mod along_lines;
mod bonds;
mod conduction;
mod crack_tips;
mod fields;
mod heated_bonds;
mod heated_flow;
mod heated_laws;
mod mirrored;
mod orthotropic;
mod orthotropic_hole;
mod orthotropic_zone;
mod point_file;
mod pressure;
mod rotation;
mod second_order;
mod sections;
mod springs;
mod stages;
mod stress_measures;
mod stresses;
mod tables;
mod thermal;

/// A finished run.
struct Done {
    summary: RunSummary,
    folder: tempfile::TempDir,
}

impl Done {
    /// The rows of a table.
    fn rows(&self, csv: &str) -> Vec<Vec<f64>> {
        self.table(csv).1
    }

    /// Header and rows of a table.
    fn table(&self, csv: &str) -> (Vec<String>, Vec<Vec<f64>>) {
        let text = std::fs::read_to_string(self.folder.path().join(csv)).unwrap();
        let mut lines = text.lines();
        let header = lines.next().unwrap().split(',').map(str::to_owned);
        let row = |l: &str| l.split(',').map(|v| v.parse().unwrap()).collect();
        (header.collect(), lines.map(row).collect())
    }

    /// A column of a table.
    fn column(&self, csv: &str, name: &str) -> Vec<f64> {
        let (header, rows) = self.table(csv);
        let at = header.iter().position(|h| h == name);
        let at = at.unwrap_or_else(|| panic!("no column {name} in {header:?}"));
        rows.iter().map(|r| r[at]).collect()
    }

    /// The force of a load.
    fn applied(&self, condition: &str) -> &[f64] {
        let mut all = self.summary.applied.iter();
        &all.find(|a| a.condition == condition).unwrap().force
    }

    /// The force of a support.
    fn reaction(&self, condition: &str) -> &[f64] {
        let mut all = self.summary.reactions.iter();
        &all.find(|a| a.condition == condition).unwrap().force
    }
}

/// Reads a scene with overrides; meshes are those of the repository.
fn read(text: &str, overrides: &[&str]) -> Result<AnyScene, String> {
    let text = text.replace(
        "MESHES",
        concat!(env!("CARGO_MANIFEST_DIR"), "/../../meshes"),
    );
    let mut source = Source::new("scene.toml", &text);
    for o in overrides {
        source.push_override(o).map_err(|e| format!("{e:?}"))?;
    }
    let here = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    AnyScene::from_source(&source, here, "scene").map_err(|e| e.to_string())
}

/// A scene is refused with a message that has each of `parts`.
fn refused(text: &str, overrides: &[&str], parts: &[&str]) {
    let error = read(text, overrides).unwrap_err();
    let error = error.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in parts {
        assert!(
            error.contains(part),
            "{overrides:?}: {part} is not in {error}"
        );
    }
}

/// Runs a scene with overrides.
fn run(text: &str, overrides: &[&str]) -> Done {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = read(text, overrides).unwrap();
    scene.set_output_directory(folder.path().to_owned());
    let summary = scene
        .run(&Silent)
        .unwrap_or_else(|e| panic!("{overrides:?}: {e}"));
    Done { summary, folder }
}
