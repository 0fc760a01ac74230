//! The plate of section 6.2.5 as the solid that it is in the report, `examples/damaged_plate_coupled.toml`, beside points alone on the same lattice and mesh.

use super::{SHOWN, THROUGH, extent, reaches};
use crate::observed::{Seen, run_scene_with};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
};

const SCENE: &str = include_str!("../../../../examples/damaged_plate_coupled.toml");
const MESH: &str = include_str!("../../../../meshes/plate_with_hole.msh");

/// The tables of the scene that hold how far damage and cracks reach.
pub const LEVELS: [&str; 2] = ["tip_damaged", "tip_cracked"];

/// Largest distance of the extents of damage of the coupled plate from those of points alone \[mm\].
pub const EXTENT_LIMIT: f64 = 1.0;

/// Largest relative distance of the nominal strain at which the coupled plate is cracked through.
pub const FRACTURE_LIMIT: f64 = 0.05;

/// A scene without one of its tables.
fn without_table(text: &str, table: &str) -> String {
    let mut inside = false;
    let lines = text.lines().filter(|line| {
        if line.starts_with('[') {
            inside = line.starts_with(&format!("[{table}]"));
        }
        !inside
    });
    lines.flat_map(|line| [line, "\n"]).collect()
}

/// The plate as the scene has it, with keys set otherwise.
fn plate(text: &str, set: &[&str]) -> Result<Seen, String> {
    let text = text.replace("../meshes/plate_with_hole.msh", "plate.msh");
    let set: Vec<String> = ["output.vtu=false"]
        .iter()
        .chain(set)
        .map(|key| (*key).to_owned())
        .collect();
    run_scene_with(&text, &set, &[("plate.msh", MESH)])
}

/// Points alone.
fn alone(material: Option<&str>) -> Result<Seen, String> {
    let text = without_table(SCENE, "zones.nonlocal");
    let mut text = without_table(&text, "materials.ends.bond-based");
    if let Some(material) = material {
        text = without_table(&text, "materials.plate.continuum-damage") + material;
    }
    plate(&text, &["coupling=nonlocal"])
}

/// Bonds that break by their stretch, with the critical stretch of the plate in plane stress.
const BRITTLE: &str = "[materials.plate.bond-based]\nyoungs-modulus = 140e3\ndensity = 8e-9\ncritical-stretch = 0.0095\n";

/// Nominal strains of the first damage and when a plate is cracked through.
fn growth(seen: &Seen) -> [f64; 2] {
    [(LEVELS[0], 0.0), (LEVELS[1], THROUGH)]
        .map(|(level, extent)| reaches(seen, level, extent).unwrap_or(f64::NAN))
}

/// The plate of points alone: a stable phase with damage, none with a critical stretch.
fn phases(damaged: &Seen, table: &mut Table) {
    let case = "continuum damage";
    let at = |level: usize, strain: f64| extent(damaged, LEVELS[level], strain);
    table.push(TableRow::at_least(
        case,
        "damaged at 0.0057",
        at(0, SHOWN[0]),
        1.0,
    ));
    table.push(TableRow::at_most(
        case,
        "cracked at 0.0057",
        at(1, SHOWN[0]),
        5.0,
    ));
    let [begun, ended] = growth(damaged);
    table.push(TableRow::info(case, "strain of the first damage", begun));
    table.push(TableRow::at_most(
        case,
        "strain when cracked through",
        ended,
        SHOWN[1],
    ));
    table.push(TableRow::at_least(
        case,
        "strain between",
        ended - begun,
        0.002,
    ));
    table.push(TableRow::info(case, "seconds", damaged.seconds));
    let case = "critical stretch";
    match alone(Some(BRITTLE)) {
        Ok(seen) => {
            let [begun, ended] = growth(&seen);
            table.push(TableRow::info(case, "strain of the first damage", begun));
            table.push(TableRow::info(case, "strain when cracked through", ended));
            table.push(TableRow::at_most(
                case,
                "strain between",
                ended - begun,
                0.0012,
            ));
        }
        Err(why) => {
            table.push(TableRow::at_most(case, "strain between", f64::NAN, 0.0).because(why))
        }
    }
}

/// The coupled plate beside points alone.
fn coupled(damaged: &Seen, table: &mut Table) {
    let case = "elements in the ends";
    let seen = match plate(SCENE, &[]) {
        Ok(seen) => seen,
        Err(why) => {
            return table.push(TableRow::at_most(case, "extent", f64::NAN, 0.0).because(why));
        }
    };
    let [_, alone] = growth(damaged);
    let [_, ended] = growth(&seen);
    let strains = (0..).map(|k| 0.003 + 1e-4 * f64::from(k));
    let strains: Vec<f64> = strains.take_while(|strain| *strain < alone).collect();
    for (level, what) in LEVELS.into_iter().zip(["damaged", "cracked"]) {
        let off = |until: f64| {
            let each = strains.iter().filter(|s| **s <= until);
            let each = each.map(|s| (extent(&seen, level, *s) - extent(damaged, level, *s)).abs());
            each.fold(0.0, f64::max)
        };
        let quantity = format!("{what}, most beside points alone up to 0.0065 [mm]");
        table.push(TableRow::at_most(
            case,
            &quantity,
            off(0.0065),
            EXTENT_LIMIT,
        ));
        let quantity = format!("{what}, most beside points alone until cracked through [mm]");
        table.push(TableRow::info(case, &quantity, off(alone)));
    }
    let quantity = "strain when cracked through";
    table.push(TableRow::within(
        case,
        quantity,
        ended,
        alone,
        FRACTURE_LIMIT,
    ));
    let ratio = seen.seconds / damaged.seconds;
    table.push(TableRow::info(
        case,
        "time over that of points alone",
        ratio,
    ));
    // the modulus of a continuous body, which five layers do not have
    let whole = "materials.ends.bond-based.youngs-modulus=140e3";
    if let Ok(stiff) = plate(SCENE, &[whole]) {
        let [_, ended] = growth(&stiff);
        let quantity = "strain when cracked through, with E in the elements";
        table.push(TableRow::info(case, quantity, ended));
        table.push(TableRow::info(
            case,
            "its shift, of that of points alone",
            ended / alone - 1.0,
        ));
    }
}

/// Points alone and the coupled plate.
pub fn plates(progress: &dyn Progress) -> Table {
    progress.advance(1);
    let mut table = Table::new(
        "Solid plate of 50 x 150 x 5 mm with a hole of 20 mm, strained at 45/s, spacing 1 mm: nominal strains, and how far damage reaches from the hole [mm], of 15 mm",
        Columns::Full,
    );
    match alone(None) {
        Ok(damaged) => {
            phases(&damaged, &mut table);
            coupled(&damaged, &mut table);
        }
        Err(why) => table.push(TableRow::at_most("plate", "extent", f64::NAN, 0.0).because(why)),
    }
    table
}
