//! Continuum damage of bonds, [SAND2015-7998] section 6.2: a bar that is damaged along its length, and the plate with a hole of section 6.2.5, by scenes.
//!
//! The report's plate is a solid of some 38 000 points with ν = 1/4 (`solid`). In plane stress, where bonds that act alone have ν = 1/3, it is cheaper; the plate is thin against its hole.

mod solid;

use std::path::{Path, PathBuf};

use crate::Effort;
use crate::observed::{Seen, run_scene};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
};
use bondline_study::line_plot::{LinePlot, Series, Stroke};

/// Largest error of the stress of the bar, over its largest stress.
pub const STRESS_LIMIT: f64 = 1e-8;

/// Length of a crack from the hole once the plate is cracked through: to the last point of 15 \[mm\].
pub const THROUGH: f64 = 14.0;

/// Nominal strains at which the report shows the plate: stable damage, and cracked through.
const SHOWN: [f64; 2] = [0.0057, 0.009];

/// Strain per second.
const RATE: f64 = 45.0;

/// Damage from which a point counts as damaged, and as cracked. Bonds that break by their stretch leave at least 0.35 beside a crack.
const LEVELS: [f64; 2] = [0.01, 0.35];

/// Tables of the plate in plane stress by these levels.
const TIPS: [&str; 2] = ["tip_level0", "tip_level1"];

/// Young's modulus of the bar, its strain at the onset over ε₀, and η.
const BAR: (f64, f64, f64) = (1000.0, 0.816_496_580_927_726, 10.0);

/// The largest error of the stress of a bar in load steps up to its largest stress, over that one; its ends keep their damage.
fn bar() -> Result<f64, String> {
    let (young, onset, eta) = (BAR.0, 0.01 * BAR.1, BAR.2);
    let text = format!(
        "kinematics = \"bar\"\ncoupling = \"nonlocal\"\nmesh.line = {{ min = 0, max = 20, x = {{ cells = 200 }} }}\n[materials.m.continuum-damage]\nyoungs-modulus = {young}\ndensity = 1\nonset-strain = 0.01\ndamage-hardening = {eta}\n[peridynamics]\nhorizon = 0.3\nbonds = \"linear\"\npoints.lattice = {{ spacing = 0.1 }}\n[no-fail]\nleft.box = {{ min = -1, max = 3 }}\nright.box = {{ min = 17, max = 21 }}\n[conditions.left.displacement]\non = \"left\"\nx = 0\n[conditions.right.displacement]\non = \"right\"\nx = \"0.25*t\"\n[output]\nprobes.a = {{ at = 9.55 }}\nprobes.b = {{ at = 10.45 }}\n[solve.quasi-static]\nduration = 1\nsteps = 20\ntolerance = 1e-11\n"
    );
    let seen = run_scene(&text)?;
    let mut worst: f64 = 0.0;
    let mut damaged = 0;
    for [a, b, stress] in seen.columns("history", ["a_ux", "b_ux", "right_reaction_x"]) {
        let strain = (b - a) / 0.9;
        let damage = (((strain / onset).powi(2) - 1.0) / eta).max(0.0);
        damaged += usize::from(damage > 0.0);
        worst = worst.max((stress - young * strain * (1.0 - damage)).abs());
    }
    // at the strain ε √((1 + η)/3)
    let peak = young * onset * ((1.0 + eta) / 3.0).sqrt() * 2.0 / 3.0 * (1.0 + eta) / eta;
    match damaged {
        0..4 => Err(format!("{damaged} load steps with damage")),
        _ => Ok(worst / peak),
    }
}

/// The plate of section 6.2.5 of a material, with a spacing of its points and a width of its elements \[mm\]; `zones` are those of a coupling.
fn plate(
    material: &str,
    [spacing, width]: [f64; 2],
    coupling: &str,
    zones: &str,
) -> Result<Seen, String> {
    let cells = |length: f64| (length / width).round();
    let (x, y) = (cells(50.0), cells(150.0));
    let tips: String = LEVELS
        .iter()
        .enumerate()
        .map(|(k, level)| format!("tips.level{k} = {{ direction = [1, 0], threshold = {level}, inside = {{ box = {{ min = [0, -50], max = [25, 50] }} }} }}\n"))
        .collect();
    let duration = SHOWN[1] / RATE;
    run_scene(&format!(
        "kinematics = \"plane-stress\"\ncoupling = \"{coupling}\"\n[mesh.rectangle]\nmin = [-25, -75]\nmax = [25, 75]\nx = {{ cells = {x} }}\ny = {{ cells = {y} }}\n[materials.plate.{material}\nyoungs-modulus = 140e3\ndensity = 8e-9\n[peridynamics]\nhorizon = {}\n{zones}[voids.hole]\ninside.ball = {{ center = [0, 0], radius = 10 }}\n[initial.strained.velocity]\ny = \"{RATE}*y\"\n[conditions.bottom.displacement]\ninside.box = {{ min = [-25, -76], max = [25, -72] }}\ny = \"{RATE}*t*y\"\n[conditions.top.displacement]\ninside.box = {{ min = [-25, 72], max = [25, 76] }}\ny = \"{RATE}*t*y\"\n[solve.explicit]\nduration = {duration}\noutputs = 1\nhistory-interval = 5e-7\n[output]\nvtu = false\n{tips}",
        3.0 * spacing
    ))
}

/// Returns the largest distance from the hole of points of a level of damage at a nominal strain, along the ligament \[mm\]; 0 if there are none.
fn extent(seen: &Seen, level: &str, strain: f64) -> f64 {
    let rows = seen.columns(level, ["time", "x"]);
    let until = rows
        .iter()
        .filter(|[time, _]| RATE * time <= strain * (1.0 + 1e-9));
    until.fold(0.0, |most: f64, [_, x]| most.max(x - 10.0))
}

/// The nominal strain at which a level of damage has come so far; none if it never does.
fn reaches(seen: &Seen, level: &str, extent: f64) -> Option<f64> {
    let rows = seen.columns(level, ["time", "x"]);
    let first = rows.iter().find(|[_, x]| x - 10.0 >= extent);
    first.map(|[time, _]| RATE * time)
}

const DAMAGING: &str = "continuum-damage]\nonset-strain = 0.01\ndamage-hardening = 10";

/// Bonds that break by their stretch, where the first breaks at about the nominal strain at which damage begins.
const BRITTLE: &str = "bond-based]\ncritical-stretch = 0.0095";

/// A full peridynamic plate.
fn whole(material: &str, spacing: f64) -> Result<Seen, String> {
    let half = 0.5 * spacing;
    let lattice = format!(
        "points.lattice = {{ spacing = {spacing}, origin = [{}, {}] }}\n",
        half - 25.0,
        half - 75.0
    );
    plate(material, [spacing; 2], "nonlocal", &lattice)
}

/// Quantity of the rows that compare how long damage takes.
const BETWEEN: &str = "strain between";

/// Extents of damage and cracks by the nominal strain, and the growth from the first damage to a crack across.
fn plates(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let spacing = match effort {
        Effort::Quick => 2.0,
        Effort::Full => 1.0,
    };
    let mut table = Table::new(
        format!(
            "Plate of 50 x 150 mm with a hole of 20 mm, strained at 45/s, spacing {spacing} mm: how far damage reaches from the hole [mm], of 15 mm"
        ),
        Columns::Full,
    );
    progress.advance(1);
    let damaged = whole(DAMAGING, spacing);
    progress.advance(1);
    let brittle = whole(BRITTLE, spacing);
    let (damaged, brittle) = match (damaged, brittle) {
        (Ok(damaged), Ok(brittle)) => (damaged, brittle),
        (Err(why), _) | (_, Err(why)) => {
            table.push(TableRow::at_most("plate", "extent", f64::NAN, 0.0).because(why));
            return vec![table];
        }
    };
    for strain in [
        0.0035, 0.0045, 0.0055, 0.0057, 0.006, 0.0065, 0.007, 0.008, 0.009,
    ] {
        let case = |law: &str| format!("{law}, nominal strain {strain}");
        for (level, what) in TIPS.into_iter().zip(["damaged", "cracked"]) {
            let of = |seen: &Seen| extent(seen, level, strain);
            table.push(TableRow::info(case("continuum damage"), what, of(&damaged)));
            table.push(TableRow::info(case("critical stretch"), what, of(&brittle)));
        }
    }
    let mut found = Table::new(
        "The same plate: stable damage at the nominal strain 0.0057, cracked through by 0.009; with a critical stretch no stable phase",
        Columns::Full,
    );
    let through = THROUGH - 0.5 * (spacing - 1.0);
    let case = "continuum damage";
    found.push(TableRow::at_least(
        case,
        "damaged at 0.0057",
        extent(&damaged, TIPS[0], SHOWN[0]),
        1.0,
    ));
    found.push(TableRow::at_most(
        case,
        "cracked at 0.0057",
        extent(&damaged, TIPS[1], SHOWN[0]),
        5.0,
    ));
    found.push(TableRow::at_least(
        case,
        "cracked at 0.009",
        extent(&damaged, TIPS[1], SHOWN[1]),
        through,
    ));
    let growth = |seen: &Seen| {
        let begun = reaches(seen, TIPS[0], 0.0).unwrap_or(f64::NAN);
        let ended = reaches(seen, TIPS[1], through).unwrap_or(f64::NAN);
        (begun, ended)
    };
    for (case, seen) in [(case, &damaged), ("critical stretch", &brittle)] {
        let (begun, ended) = growth(seen);
        found.push(TableRow::info(case, "strain of the first damage", begun));
        found.push(TableRow::info(case, "strain when cracked through", ended));
        match case {
            "critical stretch" => {
                found.push(TableRow::at_most(case, BETWEEN, ended - begun, 0.0012))
            }
            _ => found.push(TableRow::at_least(case, BETWEEN, ended - begun, 0.002)),
        }
        found.push(TableRow::info(case, "seconds", seen.seconds));
    }
    if effort == Effort::Full {
        progress.advance(1);
        coupled(&damaged, spacing, &mut found);
    }
    vec![table, found]
}

/// The plate with finite elements away from the hole, two spacings wide.
fn with_elements(material: &str, spacing: f64) -> Result<Seen, String> {
    let zones = format!(
        "points.lattice = {{ spacing = {spacing} }}\n[zones.nonlocal]\nbox = {{ min = [-26, -30], max = [26, 30] }}\n"
    );
    plate(material, [spacing, 2.0 * spacing], "truncated", &zones)
}

/// Draws figure 6.2, the extent of damage and cracks from the hole over the nominal strain, as `damaged_plate.svg`.
///
/// # Errors
/// The message of a failed run, or of the file.
pub fn figures(folder: &Path, progress: &dyn Progress) -> Result<Vec<PathBuf>, String> {
    progress.stage("damaged plates", Some(4));
    let mut series = Vec::new();
    type Plate = fn(&str, f64) -> Result<Seen, String>;
    let runs: [(&str, &str, Plate); 4] = [
        ("continuum damage, points alone", DAMAGING, whole),
        ("continuum damage, with elements", DAMAGING, with_elements),
        ("critical stretch, points alone", BRITTLE, whole),
        ("critical stretch, with elements", BRITTLE, with_elements),
    ];
    for (name, material, run) in runs {
        progress.advance(1);
        let seen = run(material, 1.0)?;
        let strains = (0..=180).map(|k| SHOWN[1] * f64::from(k) / 180.0);
        let reached = strains.map(|strain| (100.0 * strain, extent(&seen, TIPS[0], strain)));
        series.push(Series::new(name, Stroke::Line, reached.collect()));
    }
    progress.finish();
    let path = folder.join("damaged_plate.svg");
    LinePlot {
        title: "Plate with a hole, strained at 45/s: how far damage reaches".into(),
        x_label: "nominal strain [%]".into(),
        y_label: "damaged region, from the hole [mm]".into(),
        series,
        ..LinePlot::default()
    }
    .write(&path)
    .map_err(|e| e.to_string())?;
    Ok(vec![path])
}

/// The plate with elements beside the one of points alone.
fn coupled(whole: &Seen, spacing: f64, table: &mut Table) {
    let case = "continuum damage, elements away from the hole";
    match with_elements(DAMAGING, spacing) {
        Ok(seen) => {
            let strains = [0.0035, 0.0045, 0.0055, SHOWN[0], 0.006, 0.0065, SHOWN[1]];
            let off = |level: &str| {
                let each = strains.map(|s| extent(&seen, level, s) - extent(whole, level, s));
                each.into_iter()
                    .fold(0.0, |most: f64, off| most.max(off.abs()))
            };
            for (level, what) in TIPS.into_iter().zip(["damaged", "cracked"]) {
                let quantity = format!("{what}, most beside points alone [mm]");
                table.push(TableRow::at_most(case, quantity, off(level), spacing));
            }
            let ratio = seen.seconds / whole.seconds;
            table.push(TableRow::info(
                case,
                "time over that of points alone",
                ratio,
            ));
        }
        Err(why) => table.push(TableRow::refused(case, "extent", why)),
    }
}

/// The suite `damage`.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    progress.stage("continuum damage", Some(5));
    let mut table = Table::new(
        "Bar in load steps up to its largest stress, ends kept whole: stress against E ε (1 − φ), φ = ((ε/ε₁)² − 1)/η",
        Columns::Full,
    );
    progress.advance(1);
    table.push(match bar() {
        Ok(off) => TableRow::at_most("bar", "error of the stress", off, STRESS_LIMIT),
        Err(why) => {
            TableRow::at_most("bar", "error of the stress", f64::NAN, STRESS_LIMIT).because(why)
        }
    });
    let mut tables = vec![table];
    tables.extend(plates(effort, progress));
    if effort == Effort::Full {
        tables.push(solid::plates(progress));
    }
    progress.finish();
    tables
}
