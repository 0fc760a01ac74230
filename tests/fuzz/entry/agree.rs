//! A scene as users type it beside its elements alone: where bondline warns of nothing, both agree.

use std::path::Path;

use arbitrary::Unstructured;
use bondline::scene::Source;
use bondline::{RunSummary, Silent};

use super::examine::{Outcome, ended, refused};
use super::folder;
use super::typed::{Typed, typed};

/// Distance of a scene of which nothing was warned from classical elasticity, on the lines that it writes: root mean square of the difference of
/// displacements over that of the displacements.
#[derive(Clone, Copy, Debug)]
pub struct Agreement {
    /// Of the scene from its elements alone on the same mesh.
    pub from_elements: f64,
    /// Of the scene from elements alone on the mesh with every edge halved; found where `from_elements` is above what was [predicted](Self::predicted).
    pub from_fine: Option<f64>,
    /// Of elements alone on the same mesh from those on the fine one.
    pub elements_from_fine: f64,
    /// Error of the stress that the proof predicts where it finds anything, and effect of nonlocality on a smooth field: the square of the horizon over the
    /// body's smallest extent.
    pub predicted: f64,
}

impl Agreement {
    /// Returns true if the scene agrees with elements alone but for what was predicted, or is no farther from the fine mesh than elements themselves.
    pub fn holds(&self) -> bool {
        let allowed = self.predicted;
        let of_fine = |d: f64| d <= 1.5 * self.elements_from_fine + allowed;
        self.from_elements <= allowed || self.from_fine.is_some_and(of_fine)
    }
}

/// Result of such a scene.
pub struct Told {
    pub outcome: Outcome,
    /// True if anything was warned of.
    pub warned: bool,
    /// Of a scene at rest that is solved and warned of nothing.
    pub agreement: Option<Agreement>,
}

/// The text of [`typed_scene`].
#[allow(dead_code)] // not every target shows it
pub fn typed_text(data: &[u8]) -> String {
    typed(&mut Unstructured::new(data)).map_or_else(|e| e.to_string(), |t| t.text)
}

/// A scene as users type it, and where it warns of nothing, its elements alone.
///
/// # Panics
/// As [`super::scene_text`].
#[allow(dead_code)] // not every target calls it
pub fn typed_scene(data: &[u8]) -> Told {
    let scene = typed(&mut Unstructured::new(data)).expect("bytes that run out are zeros");
    let folder = folder();
    for (name, mesh) in &scene.meshes {
        std::fs::write(folder.path().join(name), mesh)
            .expect("the folder for temporary files can be written");
    }
    super::keep(&scene.text, &scene.meshes);
    let told = |outcome, warned| Told {
        outcome,
        warned,
        agreement: None,
    };
    let summary = match solved(&scene.text, folder.path()) {
        Ok(summary) => summary,
        Err(outcome) => return told(outcome, false),
    };
    if !summary.warnings.is_empty() {
        return told(Outcome::Solved, true);
    }
    Told {
        agreement: agreement(&scene, &summary, folder.path()),
        ..told(Outcome::Solved, false)
    }
}

fn solved(text: &str, folder: &Path) -> Result<RunSummary, Outcome> {
    let source = Source::new("typed.toml", text);
    match bondline_study::from_source(&source, folder, "fuzz") {
        Ok(scene) => ended(scene, folder),
        Err(error) => Err(refused(&error)),
    }
}

/// Elements alone, of which any number is cheap.
fn elements_alone(text: &str, folder: &Path) -> Option<RunSummary> {
    let source = Source::new("alone.toml", text);
    let mut scene = bondline_study::from_source(&source, folder, "fuzz").ok()?;
    scene.set_output_directory(folder.to_path_buf());
    scene.run(&Silent).ok()
}

fn agreement(scene: &Typed, summary: &RunSummary, folder: &Path) -> Option<Agreement> {
    let [same, fine] = scene.alone.as_ref()?;
    let own = displacements(folder);
    elements_alone(same, folder)?;
    let elements = displacements(folder);
    let mut agreement = Agreement {
        from_elements: difference(&own, &elements),
        from_fine: None,
        elements_from_fine: 0.0,
        predicted: predicted(summary) + scene.horizon_over_size.powi(2),
    };
    if agreement.from_elements > agreement.predicted && elements_alone(fine, folder).is_some() {
        let fine = displacements(folder);
        agreement.from_fine = Some(difference(&own, &fine));
        agreement.elements_from_fine = difference(&elements, &fine);
    }
    Some(agreement)
}

/// The largest error that the proof predicts of a stress, and round-off.
fn predicted(summary: &RunSummary) -> f64 {
    let figures = summary.proof.parts.iter().flat_map(|p| &p.figures);
    let errors = figures
        .filter(|f| f.name.starts_with("stress error") || f.name.starts_with("predicted by"));
    errors.map(|f| f.value.abs()).fold(1e-9, f64::max)
}

/// All displacements of the tables of a scene, in the order of its lines.
fn displacements(folder: &Path) -> Vec<f64> {
    let mut all = Vec::new();
    for line in ["across", "up"] {
        let Ok(text) = std::fs::read_to_string(folder.join(format!("fuzz_{line}.csv"))) else {
            continue;
        };
        let mut rows = text.lines().map(|row| row.split(','));
        let header = rows.next().into_iter().flatten();
        let columns: Vec<bool> = header.map(|name| name.starts_with('u')).collect();
        for row in rows {
            let wanted = row.zip(&columns).filter(|(_, wanted)| **wanted);
            all.extend(wanted.map(|(word, _)| word.parse::<f64>().expect("tables hold numbers")));
        }
    }
    all
}

/// Root mean square of the difference over that of the reference.
fn difference(a: &[f64], reference: &[f64]) -> f64 {
    assert_eq!(a.len(), reference.len(), "tables of the same lines");
    let square = |v: f64| v * v;
    let differs: f64 = a.iter().zip(reference).map(|(a, b)| square(a - b)).sum();
    let whole: f64 = reference.iter().map(|b| square(*b)).sum();
    if differs == 0.0 {
        0.0
    } else {
        (differs / whole).sqrt()
    }
}
