//! Masses, totals and first moments of loads for every coupling, law, dimension, offset of the lattice and place of the zone.

use super::scene;
use crate::Effort;
use bondline::{
    observe::{
        proof::Part,
        report::{Columns, Table, TableRow},
    },
    progress::Progress,
};

/// Largest relative difference from the integral over the mesh: round-off.
pub const LOAD_LIMIT: f64 = 1e-12;

/// Offsets of the lattice from the lowest corner of the body, in spacings along x, y, z.
const OFFSETS: [[f64; 3]; 9] = [
    [0.0, 0.0, 0.0],
    [0.5, 0.5, 0.5],
    [0.0, 0.5, 0.25],
    [0.5, 0.0, 0.75],
    [0.25, 0.25, 0.25],
    [0.1, 0.9, 0.4],
    [0.9, 0.1, 0.6],
    [0.37, 0.61, 0.13],
    [0.01, 0.99, 0.5],
];

/// Lower and upper corner of the zone in a body of the size 2 along each axis: inside, at an edge, in a corner.
const ZONES: [(&str, [f64; 3], [f64; 3]); 3] = [
    ("inside", [0.5, 0.5, 0.5], [1.5, 1.5, 1.5]),
    ("at an edge", [1.0, 0.5, 0.5], [2.0, 1.5, 1.5]),
    ("in a corner", [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]),
];

/// Couplings as they are typed, and the width of a transition zone if they ask for one.
const COUPLINGS: [(&str, &str, f64); 7] = [
    ("nonlocal", "", 0.0),
    ("truncated", "", 0.0),
    ("splice", "", 0.0),
    ("balanced", "", 0.0),
    ("blending", "", 0.25),
    ("partial-stress", "meshfree", 0.25),
    ("partial-stress", "elements", 0.25),
];

const LAWS: [(&str, &str); 3] = [
    ("bond-based", ""),
    ("lps", "poisson-ratio = 0.3"),
    ("correspondence", "poisson-ratio = 0.3"),
];

/// Cells along each axis of a body of the size 2, and points per cell size.
const CELLS: [usize; 3] = [16, 16, 8];

/// A body that is loaded by a body force and by a traction on its right, both varying, and by a uniform traction above.
fn text<const D: usize>(
    coupling: (&str, &str, f64),
    law: (&str, &str),
    offset: &[f64; 3],
    zone: &(&str, [f64; 3], [f64; 3]),
) -> String {
    let cells = CELLS[D - 1];
    let h = 2.0 / cells as f64;
    let list = |v: &dyn Fn(usize) -> f64| {
        let each: Vec<String> = (0..D).map(|i| format!("{}", v(i))).collect();
        format!("[{}]", each.join(", "))
    };
    let (kinematics, generator) = [
        ("bar", "line"),
        ("plane-strain", "rectangle"),
        ("solid", "box"),
    ][D - 1];
    let (low, high) = match D {
        1 => ("0".to_owned(), "2".to_owned()),
        _ => (list(&|_| 0.0), list(&|_| 2.0)),
    };
    let (from, to) = match D {
        1 => (format!("{}", zone.1[0]), format!("{}", zone.2[0])),
        _ => (list(&|i| zone.1[i]), list(&|i| zone.2[i])),
    };
    let axes: String = ["x", "y", "z"][..D]
        .iter()
        .map(|a| format!("{a} = {{ cells = {cells} }}\n"))
        .collect();
    let held: String = ["x", "y", "z"][..D]
        .iter()
        .map(|a| format!("{a} = 0\n"))
        .collect();
    let (varying, above) = match D {
        1 => ("1 + x", ""),
        2 => (
            "1 + x - y*y",
            "[conditions.above.traction]\non = \"top\"\ny = 2\n",
        ),
        _ => (
            "1 + x - y*z",
            "[conditions.above.traction]\non = \"back\"\ny = 2\n",
        ),
    };
    let transition = match coupling.2 > 0.0 {
        true => format!("[zones.transition]\naround = {}\n", coupling.2),
        false => String::new(),
    };
    let form = match coupling.1 {
        "" => String::new(),
        form => format!("form = \"{form}\"\n"),
    };
    let coupling = format!("[coupling.{}]\n{form}", coupling.0);
    let origin = list(&|i| offset[i] * h);
    format!(
        "kinematics = \"{kinematics}\"\n[mesh.{generator}]\nmin = {low}\nmax = {high}\n{axes}\
         [materials.m.{law}]\nyoungs-modulus = 1\ndensity = 3\n{nu}\n\
         [peridynamics]\nhorizon = {horizon}\npoints.lattice = {{ spacing = {h}, origin = {origin} }}\n\
         [zones.nonlocal]\nbox = {{ min = {from}, max = {to} }}\n{transition}{coupling}\n\
         [conditions.held.displacement]\non = \"left\"\n{held}\
         [conditions.weight.body-force]\nx = \"{varying}\"\n\
         [conditions.uniform.body-force]\nx = 1\n\
         [conditions.pull.traction]\non = \"right\"\nx = \"{varying}\"\n{above}",
        law = law.0,
        nu = law.1,
        horizon = 2.0 * h * 1.001,
    )
}

/// The largest difference from an integral in what `check` shows of loads.
pub(crate) fn worst(parts: &[Part]) -> f64 {
    let part = parts.iter().find(|p| p.name == "loads");
    let Some(part) = part else { return f64::NAN };
    let differences = part
        .figures
        .iter()
        .filter(|f| !f.name.starts_with("support"));
    differences.map(|f| f.value).fold(0.0, f64::max)
}

fn rows<const D: usize>(effort: Effort, table: &mut Table, progress: &dyn Progress) {
    let quick = effort == Effort::Quick;
    let offsets = if quick { &OFFSETS[..3] } else { &OFFSETS[..] };
    let laws = if quick { &LAWS[..2] } else { &LAWS[..] };
    for &coupling in &COUPLINGS {
        for &law in laws {
            let (mut value, mut ran, mut refused) = (0.0f64, 0, Vec::new());
            for zone in &ZONES {
                for offset in offsets {
                    match scene::check(&text::<D>(coupling, law, offset, zone), &[], &[]) {
                        Ok(found) => {
                            let own = worst(&found.proof.parts);
                            value = if own.is_nan() { own } else { value.max(own) };
                            ran += 1;
                        }
                        Err(why) => refused.push(why),
                    }
                    progress.advance(1);
                }
            }
            let name = format!("{} {}", coupling.0, coupling.1);
            let case = format!("{D}D, {}, {}", name.trim_end(), law.0);
            let quantity = format!(
                "mass, loads, moments: {ran} scenes, {} refused",
                refused.len()
            );
            table.push(match (ran, refused.first()) {
                (0, Some(why)) => TableRow::refused(case, quantity, why.clone()),
                _ => TableRow::at_most(case, quantity, value, LOAD_LIMIT),
            });
        }
    }
}

/// The table.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let mut table = Table::new(
        "masses, totals and first moments of loads against integrals over the mesh",
        Columns::Full,
    );
    progress.stage("loads", None);
    rows::<1>(effort, &mut table, progress);
    rows::<2>(effort, &mut table, progress);
    if effort != Effort::Quick {
        rows::<3>(effort, &mut table, progress);
    }
    progress.finish();
    vec![table]
}
