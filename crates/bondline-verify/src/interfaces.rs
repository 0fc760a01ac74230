//! Interfaces of two materials: the work to open one, and the path of a crack that meets one at a right angle: along it, or through it.
//!
//! A crack in one of two materials of equal elasticity ends at their interface, normal to it. The energy release rate of a crack that turns along the interface is about 0.26 of that of one that goes on straight
//! \[HeHutchinson1989\], so it turns where the toughness of the interface is below that part of the toughness of the material behind.

use rayon::prelude::*;

use crate::{Effort, meshes::scene};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
};

/// Ratio of the toughness of the interface to that of the material behind at which a crack changes from one to the other, for equal elasticity.
pub const RATIO: f64 = 0.26;

/// Ratios at which it has to turn, and to go through.
pub const BOUNDS: [f64; 2] = [0.20, 0.30];

/// Largest difference of the ratio of a coupled plate from that of full peridynamics.
pub const COUPLED_LIMIT: f64 = 0.05;

/// Largest relative difference of the energy that an interface takes from the one that was typed.
pub const PLANE_LIMIT: f64 = 0.02;

/// Fracture energy, with E and the spacing one.
const ENERGY: f64 = 1e-10;

/// Two halves of a block of two materials that are pulled apart at their interface as rigid bodies; `wide` horizons of three spacings across.
fn halves(law: &str, moduli: [f64; 2], wide: u32) -> String {
    let (length, width) = (12, 3 * wide);
    // below and beyond the stretches at which bonds break
    let stretch = (ENERGY / 3.0 / moduli[0].min(moduli[1])).sqrt();
    let (first, last) = (0.5 * stretch, 16.0 * stretch);
    let steps = 2 + ((last / first).ln() / 0.005_f64).ceil() as u32;
    format!(
        "kinematics = \"plane-stress\"\ncoupling = \"nonlocal\"\n[mesh.rectangle]\nmin = [0, 0]\nmax = [{length}, {width}]\nx = {{ spacing = 1 }}\ny = {{ spacing = 1 }}\n\
         [materials.near.{law}\nyoungs-modulus = {}\nfracture-energy = 1\n[materials.far.{law}\nyoungs-modulus = {}\nfracture-energy = 1\ncells.box = {{ min = [6, 0], max = [{length}, {width}] }}\n\
         [interfaces.border]\nbetween = [\"near\", \"far\"]\nfracture-energy = {ENERGY:e}\n[peridynamics]\nhorizon = 3\npoints.lattice = {{ spacing = 1, origin = [0.5, 0.5] }}\n\
         [conditions.behind.displacement]\ninside.box = {{ min = [-1, -1], max = [6, {width}] }}\nx = 0\ny = 0\n\
         [conditions.ahead.displacement]\ninside.box = {{ min = [6, -1], max = [13, {width}] }}\nx = \"{first:e} * min(t, 1) * exp(0.005 * max(t - 1, 0))\"\ny = 0\n\
         [solve.quasi-static]\nsteps = {steps}\nduration = {steps}\noutputs = 1\n[output]\nvtu = false\n",
        moduli[0], moduli[1]
    )
}

/// Energy that opening an interface takes, over that typed: blocks of three and two horizons across, less what is common.
///
/// # Errors
/// The message of a refusal.
pub fn opening(law: &str, moduli: [f64; 2]) -> Result<f64, String> {
    let of = |wide: u32| {
        let motion = scene::run(&halves(law, moduli, wide), &[], &[])?.motion;
        let cracks = motion.and_then(|motion| motion.cracks);
        let cracks = cracks.ok_or_else(|| "no bond can break".to_owned())?;
        Ok::<f64, String>(cracks.dissipated_energy)
    };
    Ok((of(3)? - of(2)?) / (3.0 * ENERGY))
}

/// Path of a crack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Along the interface.
    Turns,
    /// Into the material behind.
    GoesThrough,
    /// Neither within the load.
    Stays,
}

/// Extent of the square plate, in spacings.
const PLATE: f64 = 40.0;

/// A square plate whose notch ends at an interface in the middle, pulled slowly; the interface has `ratio` of the toughness of either material.
fn plate(ratio: f64, coupling: &str) -> String {
    let (middle, horizon) = (0.5 * PLATE, 3.0);
    // the load at which a crack of this length runs in a wide plate, nearly
    let toughness = 1e-6_f64;
    let unit = PLATE * (toughness / (std::f64::consts::PI * middle)).sqrt() / 1.5;
    let zones = match coupling {
        "nonlocal" => String::new(),
        _ => format!(
            "[zones.nonlocal.box]\nmin = [-1, {0}]\nmax = [{1}, {1}]\n",
            0.25 * PLATE,
            0.75 * PLATE
        ),
    };
    let beside = middle + horizon + 0.1;
    format!(
        "kinematics = \"plane-stress\"\ncoupling = \"{coupling}\"\n[mesh.rectangle]\nmin = [0, 0]\nmax = [{PLATE}, {PLATE}]\nx = {{ spacing = 1 }}\ny = {{ spacing = 1 }}\n\
         [materials.near.bond-based]\nyoungs-modulus = 1\nfracture-energy = {toughness:e}\n\
         [materials.far.bond-based]\nyoungs-modulus = 1\nfracture-energy = {toughness:e}\ncells.box = {{ min = [{middle}, 0], max = [{PLATE}, {PLATE}] }}\n\
         [interfaces.border]\nbetween = [\"near\", \"far\"]\nfracture-energy = {:e}\n\
         [peridynamics]\nhorizon = {horizon}\npoints.lattice = {{ spacing = 1, origin = [0.5, 0.5] }}\n[cracks.notch.segment]\nfrom = [-1, {middle}]\nto = [{middle}, {middle}]\n{zones}\
         [no-fail.bottom.box]\nmin = [-1, -1]\nmax = [41, 4]\n[no-fail.top.box]\nmin = [-1, 36]\nmax = [41, 41]\n\
         [conditions.bottom.displacement]\non = \"bottom\"\ny = 0\n[conditions.pin.displacement]\ninside.box = {{ min = [39.4, -0.1], max = [40.1, 0.6] }}\nx = 0\n\
         [conditions.top.displacement]\non = \"top\"\ny = \"{unit:e} * (1 + 0.1 * t)\"\n[solve.quasi-static]\nsteps = 27\nduration = 27\noutputs = 1\n\
         [output]\nvtu = false\n[output.tips.along]\ndirection = [0, 1]\ninside.box = {{ min = [{}, {beside}], max = [{}, {PLATE}] }}\nthreshold = 0.05\n\
         [output.tips.through]\ndirection = [1, 0]\ninside.box = {{ min = [{beside}, 0], max = [{PLATE}, {PLATE}] }}\nthreshold = 0.1\n",
        ratio * toughness,
        middle - horizon,
        middle + horizon,
    )
}

/// The load step of the first row of a table of tips, of steps that follow one another.
fn first_step(table: Option<&String>) -> f64 {
    let row = table.and_then(|text| text.lines().nth(1));
    let step = row.and_then(|row| row.split(',').next());
    step.and_then(|step| step.parse().ok())
        .unwrap_or(f64::INFINITY)
}

/// Returns the way that a crack takes first by more than a horizon.
///
/// # Errors
/// The message of a refusal.
pub fn way(ratio: f64, coupling: &str) -> Result<Way, String> {
    let names = ["scene_tip_along.csv", "scene_tip_through.csv"];
    let tables = scene::files(&plate(ratio, coupling), &names)?;
    let [along, through] = [0, 1].map(|k| first_step(tables[k].as_ref()));
    Ok(match (along, through) {
        (a, t) if a < t => Way::Turns,
        (a, t) if t < a => Way::GoesThrough,
        _ => Way::Stays,
    })
}

/// The ratio between which and the next one tried a crack changes its way: the middle of the interval that is left after so many halvings.
fn change(coupling: &str, halvings: usize) -> Result<[f64; 2], String> {
    let [mut low, mut high] = BOUNDS;
    for (ratio, wanted) in [(low, Way::Turns), (high, Way::GoesThrough)] {
        let found = way(ratio, coupling)?;
        if found != wanted {
            return Err(format!("at {ratio} the crack is {found:?}, not {wanted:?}"));
        }
    }
    for _ in 0..halvings {
        let middle = 0.5 * (low + high);
        match way(middle, coupling)? {
            Way::Turns => low = middle,
            Way::GoesThrough | Way::Stays => high = middle,
        }
    }
    Ok([low, high])
}

fn openings(effort: Effort) -> Table {
    let mut table = Table::new(
        "Planes between two materials pulled apart, plane stress, m = 3: what bonds take over what was typed of the interface",
        Columns::Full,
    );
    let all = [
        ("bond-based, equal moduli", "bond-based]", [1.0, 1.0]),
        ("bond-based, moduli 1:4", "bond-based]", [1.0, 4.0]),
        ("LPS, equal moduli", "lps]\npoisson-ratio = 0.2", [1.0, 1.0]),
        ("LPS, moduli 1:4", "lps]\npoisson-ratio = 0.2", [1.0, 4.0]),
    ];
    let count = if effort == Effort::Full { 4 } else { 2 };
    let rows: Vec<TableRow> = all[..count]
        .par_iter()
        .map(|(name, law, moduli)| {
            let quantity = "energy over fracture energy";
            match opening(law, *moduli) {
                Ok(ratio) => TableRow::within(*name, quantity, ratio, 1.0, PLANE_LIMIT),
                Err(why) => TableRow::refused(*name, quantity, why),
            }
        })
        .collect();
    table.rows.extend(rows);
    table
}

fn cracks(effort: Effort) -> Table {
    let mut table = Table::new(
        format!(
            "A notch that ends at an interface, normal to it; equal elasticity, {PLATE} by {PLATE} spacings, m = 3, load steps. Ratio of toughnesses at which the crack goes through instead of along the interface, \
             the middle of the last interval ([HeHutchinson1989]: {RATIO})"
        ),
        Columns::Full,
    );
    let (couplings, halvings): (&[&str], usize) = match effort {
        Effort::Full => (&["nonlocal", "truncated"], 2),
        Effort::Quick => (&["nonlocal"], 0),
    };
    let found: Vec<Result<[f64; 2], String>> = couplings
        .par_iter()
        .map(|coupling| change(coupling, halvings))
        .collect();
    let quantity = "ratio of change";
    let middle = |[low, high]: [f64; 2]| 0.5 * (low + high);
    for (coupling, found) in couplings.iter().zip(&found) {
        table.push(match found {
            Ok(interval) => {
                let half = 0.5 * (BOUNDS[1] - BOUNDS[0]) / RATIO;
                TableRow::within(*coupling, quantity, middle(*interval), RATIO, half)
                    .because(format!("between {} and {}", interval[0], interval[1]))
            }
            Err(why) => TableRow::at_most(*coupling, quantity, f64::NAN, 1.0).because(why.clone()),
        });
    }
    if let [Ok(full), Ok(coupled)] = found[..] {
        let difference = (middle(coupled) - middle(full)).abs();
        table.push(TableRow::at_most(
            "truncated less nonlocal",
            quantity,
            difference,
            COUPLED_LIMIT,
        ));
    }
    table
}

/// Runs the openings of interfaces, and the cracks that meet one.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    progress.stage("interfaces pulled apart", None);
    let openings = openings(effort);
    progress.stage("cracks that meet an interface", None);
    vec![openings, cracks(effort)]
}
