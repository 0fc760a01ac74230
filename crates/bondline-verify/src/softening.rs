//! Softening bonds by scenes: a strip with a notch from either side that is pulled to separation, and a notched beam in three-point bending.

use crate::Effort;
use crate::observed::{Seen, run_scene};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
};

/// Largest deviation of the energy per area from the fracture energy.
pub const ENERGY_LIMIT: f64 = 0.05;

/// Strength \[MPa\], fracture energy \[N/mm\] and ligament \[mm\] of the strip.
const STRIP: (f64, f64, f64) = (3.0, 0.01, 12.0);

/// Largest change of the peak load where the spacing is halved.
pub const PEAK_LIMIT: f64 = 0.05;

/// A strip with a softening, by the spacing of its points \[mm\] at a horizon of 4.5 mm, in 30 steps up to a `time` of at most 1, when it is open by `opening` \[mm\].
fn strip(softening: &str, opening: f64, spacing: f64, time: f64) -> Result<Seen, String> {
    let (strength, energy, ligament) = STRIP;
    let cells = (30.0 / spacing).round();
    let (first, tip) = (0.5 * spacing - 15.0, 0.5 * ligament);
    run_scene(&format!(
        "kinematics = \"plane-stress\"\ncoupling = \"nonlocal\"\n[mesh.rectangle]\nmin = [-15, -15]\nmax = [15, 15]\nx = {{ cells = {cells} }}\ny = {{ cells = {cells} }}\n[materials.m.softening-bond]\nyoungs-modulus = 30e3\ntensile-strength = {strength}\nfracture-energy = {energy}\nsoftening = \"{softening}\"\n[peridynamics]\nhorizon = 4.5\npoints.lattice = {{ spacing = {spacing}, origin = [{first}, {first}] }}\n[cracks.upper]\npolyline = [[0, {tip}], [0, 16]]\n[cracks.lower]\npolyline = [[0, -16], [0, -{tip}]]\n[no-fail]\nleft.box = {{ min = [-16, -16], max = [-5, 16] }}\nright.box = {{ min = [5, -16], max = [16, 16] }}\n[conditions.left.displacement]\ninside.box = {{ min = [-16, -16], max = [-7.5, 16] }}\nx = \"-{opening}*t^2/2\"\ny = 0\n[conditions.right.displacement]\ninside.box = {{ min = [7.5, -16], max = [16, 16] }}\nx = \"{opening}*t^2/2\"\ny = 0\n[solve.quasi-static]\nduration = {time}\nsteps = 30\n[output]\nvtu = false\n"
    ))
}

/// Loads and energies of a run: the largest load, the last one, the work and what the bonds dissipated.
fn found(seen: &Seen, load: &str) -> Option<[f64; 4]> {
    let rows = seen.columns("history", [load, "external_work", "dissipated_energy"]);
    let [last, work, spent] = *rows.last()?;
    let largest = rows
        .iter()
        .fold(0.0, |most: f64, row| most.max(row[0].abs()));
    Some([largest, last, work, spent])
}

fn strips(effort: Effort, progress: &dyn Progress) -> Table {
    let (strength, energy, ligament) = STRIP;
    let mut table = Table::new(
        "Strip of 30 x 30 mm with a ligament of 12 mm, pulled to separation in load steps, horizon 4.5 mm: energy per area over the fracture energy, largest nominal stress over the strength",
        Columns::Full,
    );
    let spacings: &[f64] = match effort {
        Effort::Quick => &[1.5],
        Effort::Full => &[1.5, 0.75],
    };
    for (softening, opening) in [("bilinear", 0.015), ("exponential", 0.04)] {
        for &spacing in spacings {
            progress.advance(1);
            let case = format!("{softening}, spacing {spacing} mm");
            let seen = strip(softening, opening, spacing, 1.0);
            let run = seen.as_ref().map_err(Clone::clone);
            match run.and_then(|seen| found(seen, "right_reaction_x").ok_or("no rows".to_owned())) {
                Ok([largest, last, work, spent]) => {
                    let off = (spent / ligament / energy - 1.0).abs();
                    table.push(TableRow::at_most(
                        &case,
                        "energy per area, deviation",
                        off,
                        ENERGY_LIMIT,
                    ));
                    table.push(TableRow::info(
                        &case,
                        "energy per area over what was typed",
                        spent / ligament / energy,
                    ));
                    table.push(TableRow::info(
                        &case,
                        "work over dissipated energy",
                        work / spent,
                    ));
                    table.push(TableRow::info(
                        &case,
                        "last load over the largest",
                        last.abs() / largest,
                    ));
                    let peak = largest / ligament / strength;
                    table.push(TableRow::info(
                        &case,
                        "largest nominal stress over the strength",
                        peak,
                    ));
                }
                Err(why) => table.push(
                    TableRow::at_most(case, "energy per area, deviation", f64::NAN, ENERGY_LIMIT)
                        .because(why),
                ),
            }
        }
    }
    table
}

/// The largest load at a fixed horizon, in steps fine enough for it, with a spacing and half of it.
fn peaks(progress: &dyn Progress) -> Table {
    let (strength, _, ligament) = STRIP;
    let mut table = Table::new(
        "The same strip up to its largest load, spacings of 1 and 0.5 mm: largest nominal stress over the strength",
        Columns::Full,
    );
    for (softening, opening, time) in [("bilinear", 0.015, 0.45), ("exponential", 0.04, 0.3)] {
        let peak = |spacing: f64| -> Result<f64, String> {
            progress.advance(1);
            let seen = strip(softening, opening, spacing, time)?;
            let rows = found(&seen, "right_reaction_x").ok_or("no rows".to_owned())?;
            Ok(rows[0] / ligament / strength)
        };
        let both = peak(1.0).and_then(|coarse| Ok((coarse, peak(0.5)?)));
        let quantity = "half the spacing over the whole, less 1";
        match both {
            Ok((coarse, fine)) => {
                table.push(TableRow::info(softening, "spacing 1 mm", coarse));
                table.push(TableRow::info(softening, "spacing 0.5 mm", fine));
                let change = (fine / coarse - 1.0).abs();
                table.push(TableRow::at_most(softening, quantity, change, PEAK_LIMIT));
            }
            Err(why) => {
                table.push(
                    TableRow::at_most(softening, quantity, f64::NAN, PEAK_LIMIT).because(why),
                );
            }
        }
    }
    table
}

/// The beam of `examples/softening_beam.toml`.
fn beam(progress: &dyn Progress) -> Table {
    progress.advance(1);
    let mut table = Table::new(
        "Notched beam in three-point bending, examples/softening_beam.toml: N and N mm per mm of width",
        Columns::Full,
    );
    let text = include_str!("../../../examples/softening_beam.toml");
    let seen = run_scene(text).and_then(|seen| {
        let rows = found(&seen, "load_reaction_y").ok_or("no rows".to_owned());
        rows.map(|rows| (seen, rows))
    });
    match seen {
        Ok((seen, [largest, last, work, spent])) => {
            table.push(TableRow::info("beam", "largest load", largest));
            table.push(TableRow::info(
                "beam",
                "load at the deflection 0.25 mm over it",
                last.abs() / largest,
            ));
            table.push(TableRow::info("beam", "work", work));
            table.push(TableRow::info("beam", "dissipated energy", spent));
            for [load, u] in seen
                .columns("history", ["load_reaction_y", "time"])
                .iter()
                .step_by(5)
            {
                let case = format!("deflection {:.4} mm", 0.25 * u * u);
                table.push(TableRow::info(case, "load", load.abs()));
            }
        }
        Err(why) => table.push(TableRow::refused("beam", "largest load", why)),
    }
    table
}

/// The suite `softening`.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    progress.stage("softening bonds", Some(9));
    let mut tables = vec![strips(effort, progress)];
    if effort == Effort::Full {
        tables.push(peaks(progress));
        tables.push(beam(progress));
    }
    progress.finish();
    tables
}
