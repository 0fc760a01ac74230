//! The position-aware solids of [SAND2015-7998] chapter 4, by scenes: energies at surfaces and Young's modulus of a bar with the linear one (PALS), relaxation with the viscoelastic one (PAVE).
//!
//! The paper prints no geometry, moduli or horizon. The cube has 7 × 7 × 7 points, as in figures 4.6 and 4.7; the bar stands for that of figures 4.1 and 4.2.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::{Effort, observed};
use bondline::{
    observe::{
        Observer,
        csv::Entry,
        report::{Columns, Table, TableRow},
        vtu::{Snapshot, Values},
    },
    progress::{Progress, Silent},
    run::{AnyScene, RunOptions},
    scene::Source,
};
use bondline_study::line_plot::{LinePlot, Series, Stroke};

/// Largest relative deviation of the energy density of a point under a field that the law is calibrated on.
pub const ENERGY_LIMIT: f64 = 1e-12;

/// Signed limits of the error of Young's modulus of the bar.
pub const MODULUS_LIMITS: [f64; 2] = [-0.015, 0.0];

const YOUNG: f64 = 1000.0;
const POISSON: f64 = 0.3;
const STRAIN: f64 = 1e-3;

/// Results of a run: the last fields, and the rows of probes.
#[derive(Debug, Default)]
struct Seen {
    snapshot: Mutex<Option<Snapshot>>,
    probes: Mutex<Vec<Vec<f64>>>,
}

impl Observer for Seen {
    fn wants_files(&self) -> bool {
        false
    }

    fn row(&self, table: &str, columns: &[String], row: &[Entry]) {
        if table != "probes" {
            return;
        }
        let reals = columns.iter().zip(row).filter_map(|(name, entry)| {
            let Entry::Real(x) = entry else { return None };
            name.starts_with('u').then_some(*x)
        });
        let mut probes = self.probes.lock().unwrap_or_else(PoisonError::into_inner);
        probes.push(reals.collect());
    }

    fn snapshot(&self, snapshot: Snapshot) {
        *self.snapshot.lock().unwrap_or_else(PoisonError::into_inner) = Some(snapshot);
    }
}

/// Runs a scene without files: what it shows, and the force of each condition along x.
fn run_scene(text: &str) -> Result<(Seen, Vec<f64>), String> {
    let seen = Seen::default();
    let source = Source::new("scene.toml", text.to_owned());
    let scene =
        AnyScene::from_source(&source, Path::new(""), "scene").map_err(|e| e.to_string())?;
    let options = RunOptions {
        observer: Some(&seen),
        ..RunOptions::default()
    };
    let summary = scene
        .run_with(&options, &Silent)
        .map_err(|e| e.to_string())?;
    let forces = summary.reactions.iter().map(|r| r.force[0]).collect();
    Ok((seen, forces))
}

fn material(law: &str) -> String {
    let ratio = match law {
        "bond-based" => String::new(),
        _ => format!("poisson-ratio = {POISSON}\n"),
    };
    format!("[materials.m.{law}]\nyoungs-modulus = {YOUNG}\n{ratio}")
}

/// The least and the largest relative deviation of the energy density among all points of the cube.
fn cube(law: &str, field: &str, exact: f64) -> Result<[f64; 2], String> {
    let text = format!(
        "kinematics = \"solid\"\ncoupling = \"nonlocal\"\nmesh.box = {{ min = [0, 0, 0], max = [7, 7, 7], x = {{ cells = 7 }}, y = {{ cells = 7 }}, z = {{ cells = 7 }} }}\n{}[peridynamics]\nhorizon = 3\nbonds = \"linear\"\npoints.lattice = {{ spacing = 1, origin = [0.5, 0.5, 0.5] }}\n[conditions.strained.displacement]\ninside.box = {{ min = [0, 0, 0], max = [7, 7, 7] }}\n{field}\n[output]\nenergy-density = true\n",
        material(law)
    );
    let (seen, _) = run_scene(&text)?;
    let snapshot = seen.snapshot.into_inner();
    let fields = snapshot
        .unwrap_or_else(PoisonError::into_inner)
        .map_or_else(Vec::new, |s| s.point_fields);
    let density = fields.into_iter().find(|f| f.name == "energy-density");
    let Some(Values::Real(density)) = density.map(|f| f.values) else {
        return Err("the run shows no energy density".to_owned());
    };
    if density.len() != 343 {
        return Err(format!("{} points instead of 343", density.len()));
    }
    let off = density.iter().map(|w| w / exact - 1.0);
    Ok(off.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| {
        [a.min(x), b.max(x)]
    }))
}

/// Energies of all points of the cube under the three fields.
fn energies(progress: &dyn Progress) -> Table {
    let mut table = Table::new(
        "Cube of 7 x 7 x 7 points, horizon 3 spacings: energy density of single points over that of elasticity, less one",
        Columns::Full,
    );
    let shear = 0.5 * YOUNG / (1.0 + POISSON);
    let lambda = 2.0 * shear * POISSON / (1.0 - 2.0 * POISSON);
    let half = 0.5 * STRAIN * STRAIN;
    let fields = [
        (
            "simple shear",
            format!("x = \"{STRAIN}*y\"\ny = 0\nz = 0"),
            half * shear,
        ),
        (
            "uniaxial strain",
            format!("x = \"{STRAIN}*x\"\ny = 0\nz = 0"),
            half * (lambda + 2.0 * shear),
        ),
        (
            "volumetric strain",
            format!("x = \"{STRAIN}*x\"\ny = \"{STRAIN}*y\"\nz = \"{STRAIN}*z\""),
            half * (9.0 * lambda + 6.0 * shear),
        ),
    ];
    for law in ["pals", "lps"] {
        for (name, field, exact) in &fields {
            progress.advance(1);
            let case = format!("{law}, {name}");
            match cube(law, field, *exact) {
                Ok([least, largest]) if law == "pals" => {
                    let off = least.abs().max(largest.abs());
                    table.push(TableRow::at_most(case, "largest", off, ENERGY_LIMIT));
                }
                Ok([least, largest]) => {
                    table.push(TableRow::info(&case, "least", least));
                    table.push(TableRow::info(&case, "largest", largest));
                }
                Err(why) => {
                    table.push(
                        TableRow::at_most(case, "largest", f64::NAN, ENERGY_LIMIT).because(why),
                    );
                }
            }
        }
    }
    table
}

/// The signed error of Young's modulus of a bar with free sides, by the force on its grips and the strain of its gauge.
fn modulus(law: &str, more: &str, coupling: &str, zones: &str) -> Result<f64, String> {
    let text = format!(
        "kinematics = \"solid\"\ncoupling = \"{coupling}\"\nmesh.box = {{ min = [0, 0, 0], max = [32, 8, 8], x = {{ cells = 32 }}, y = {{ cells = 8 }}, z = {{ cells = 8 }} }}\n{}{zones}[peridynamics]\nhorizon = 3\nbonds = \"linear\"\n{more}points.lattice = {{ spacing = 1, origin = [0.5, 0.5, 0.5] }}\n[conditions.a.displacement]\ninside.box = {{ min = [-1, -1, -1], max = [4, 9, 9] }}\nx = 0\ny = 0\nz = 0\n[conditions.b.displacement]\ninside.box = {{ min = [28, -1, -1], max = [33, 9, 9] }}\nx = {STRAIN}\ny = 0\nz = 0\n[output]\nprobes.a = {{ at = [12.5, 4, 4] }}\nprobes.b = {{ at = [19.5, 4, 4] }}\n",
        material(law)
    );
    let (seen, forces) = run_scene(&text)?;
    let probes = seen.probes.into_inner();
    let probes = probes.unwrap_or_else(PoisonError::into_inner);
    let (Some(force), [a, b]) = (forces.get(1), &probes[..]) else {
        return Err("no force on the grips, or no gauge".to_owned());
    };
    let strain = (b[0] - a[0]) / 7.0;
    Ok(force / (64.0 * strain) / YOUNG - 1.0)
}

/// Young's modulus of the bar by every law.
fn tension(progress: &dyn Progress) -> Table {
    let mut table = Table::new(
        "Tension bar of 32 x 8 x 8 points with free sides, horizon 3 spacings (figure 4.2): error of Young's modulus, signed: negative is too soft",
        Columns::Full,
    );
    let skin = "[zones]\nnonlocal = { box = { min = [-1, -1, -1], max = [33, 9, 9] } }\nskin = \"free-surfaces\"\n";
    let cases = [
        ("pals", "pals", "", "nonlocal", ""),
        ("lps", "lps", "", "nonlocal", ""),
        ("bond-based", "bond-based", "", "nonlocal", ""),
        (
            "lps, fitted weights",
            "lps",
            "weights = \"fitted\"\n",
            "nonlocal",
            "",
        ),
        ("lps, a skin of elements", "lps", "", "truncated", skin),
        // what clamped grips and a gauge so near to them make of it
        ("finite elements alone", "lps", "", "local", ""),
    ];
    for (case, law, more, coupling, zones) in cases {
        progress.advance(1);
        match modulus(law, more, coupling, zones) {
            Ok(off) if law == "pals" => {
                let [least, largest] = MODULUS_LIMITS;
                table.push(TableRow::at_least(case, "error of E, not below", off, least));
                table.push(TableRow::at_most(case, "error of E, not above", off, largest));
            }
            Ok(off) if case == "lps" => table.push(
                TableRow::info(case, "error of E", off).because(
                    "in figure 4.2 the LPS lies below the exact line; its horizon and the weighted volume of families at surfaces are not printed",
                ),
            ),
            Ok(off) => table.push(TableRow::info(case, "error of E", off)),
            Err(why) => table.push(TableRow::refused(case, "error of E", why)),
        }
    }
    table
}

/// Parts of the shear modulus that relax, and the relaxation time \[s\], of section 4.4.1.
const SHARES: [f64; 3] = [0.01, 0.5, 0.99];
const RELAXATION_TIME: f64 = 2.0;

/// Largest deviation of the energy of a sheared cube that relaxes from its closed form, over the energy at once.
pub const RELAXATION_LIMIT: f64 = 1e-12;

/// Energy that a cube stores over that at once, by the time \[s\]: sheared within 1e-13 s and held; `share` 0 is the position-aware solid.
fn relaxation(share: f64) -> Result<Vec<[f64; 2]>, String> {
    let law = match share {
        0.0 => material("pals"),
        _ => {
            material("pave")
                + &format!("relaxing-share = {share}\nrelaxation-time = {RELAXATION_TIME}\n")
        }
    };
    let steps: Vec<String> = (1..=20)
        .map(|k| format!("{}", 0.1 * f64::from(k)))
        .collect();
    let text = format!(
        "kinematics = \"solid\"\ncoupling = \"nonlocal\"\nmesh.box = {{ min = [0, 0, 0], max = [7, 7, 7], x = {{ cells = 7 }}, y = {{ cells = 7 }}, z = {{ cells = 7 }} }}\n{law}[peridynamics]\nhorizon = 3\nbonds = \"linear\"\npoints.lattice = {{ spacing = 1, origin = [0.5, 0.5, 0.5] }}\n[conditions.sheared.displacement]\ninside.box = {{ min = [0, 0, 0], max = [7, 7, 7] }}\nx = \"{STRAIN}*y\"\ny = 0\nz = 0\n[solve.quasi-static]\nsteps = [1e-13, {}]\noutputs = 1\n",
        steps.join(", ")
    );
    let seen = observed::run_scene(&text)?;
    let rows = seen.columns("history", ["time", "stored_energy"]);
    let at_once = rows.iter().find(|row| row[0] > 0.0);
    let at_once = at_once.ok_or("the run has no rows")?[1];
    let later = rows.iter().filter(|row| row[0] > 0.0);
    Ok(later.map(|[t, w]| [*t, w / at_once]).collect())
}

/// `(1 − λ) + λ exp(−2 t/τ)`, by the springs of (4.12)–(4.15) under a shear at once.
fn relaxed(share: f64, t: f64) -> f64 {
    1.0 - share + share * (-2.0 * t / RELAXATION_TIME).exp()
}

/// Relaxation of the cube that is sheared at once.
fn relaxations(progress: &dyn Progress) -> Table {
    let mut table = Table::new(
        "Cube of 7 x 7 x 7 points of PAVE, sheared at once and held, relaxation time 2 s (figure 4.7): W(t)/W(0)",
        Columns::Full,
    );
    for share in SHARES {
        progress.advance(1);
        let case = format!("lambda = {share}");
        match relaxation(share) {
            Ok(rows) => {
                let off = rows.iter().map(|[t, w]| (w - relaxed(share, *t)).abs());
                let last = rows.last().map_or(f64::NAN, |row| row[1]);
                table.push(TableRow::info(&case, "W(2 s)/W(0)", last));
                let quantity = "W(t)/W(0) beside the closed form, largest difference of 21 steps";
                let off = match rows.len() {
                    21 => off.fold(0.0, f64::max),
                    _ => f64::NAN,
                };
                table.push(TableRow::at_most(&case, quantity, off, RELAXATION_LIMIT));
            }
            Err(why) => table.push(
                TableRow::at_most(case, "W(t)/W(0)", f64::NAN, RELAXATION_LIMIT).because(why),
            ),
        }
    }
    table
}

/// Draws figure 4.7, the energy of the sheared cube by the time, as `pave_relaxation.svg`.
///
/// # Errors
/// The message of a failed run, or of the file.
pub fn figures(folder: &Path, progress: &dyn Progress) -> Result<Vec<PathBuf>, String> {
    progress.stage("relaxation", Some(4));
    let mut series = Vec::new();
    for share in [&[0.0], &SHARES[..]].concat() {
        progress.advance(1);
        let points = relaxation(share)?.into_iter().map(|[t, w]| (t, w));
        let name = match share {
            0.0 => "PALS".to_owned(),
            _ => format!("PAVE, λ = {share}"),
        };
        series.push(Series::new(name, Stroke::Dots, points.collect()));
    }
    for share in SHARES {
        let exact = (0..=100).map(|k| 0.02 * f64::from(k));
        let exact = exact.map(|t| (t, relaxed(share, t))).collect();
        series.push(Series::new("", Stroke::Line, exact));
    }
    progress.finish();
    let path = folder.join("pave_relaxation.svg");
    LinePlot {
        title: "Cube of 7 × 7 × 7 points sheared at once and held: dots computed, lines exact"
            .into(),
        x_label: "time [s]".into(),
        y_label: "strain energy over that at once".into(),
        series,
        ..LinePlot::default()
    }
    .write(&path)
    .map_err(|e| e.to_string())?;
    Ok(vec![path])
}

/// The suite `pals`.
pub fn run(_effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    progress.stage("position-aware solid", Some(15));
    let tables = vec![energies(progress), tension(progress), relaxations(progress)];
    progress.finish();
    tables
}
