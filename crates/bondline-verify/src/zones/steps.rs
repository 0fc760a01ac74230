//! Stable steps of bodies with a zone that is drawn, beside those of elements alone and of points alone.

use rayon::prelude::*;

use super::{
    affine::second_order,
    draw::{Draw, PLACES, zone},
};
use crate::{
    Effort,
    meshes::{
        affine::{Family, bent_bar, families, jittered, lug},
        scene,
    },
};
use bondline::{
    observe::report::{Columns, Table, TableRow, number},
    observe::summary::Decision,
    progress::Progress,
};

/// The seed of all that is drawn.
const SEED: u64 = 582;

/// Least stable step over the smaller one of elements alone and of points alone, in the plane and in space.
const LEAST: [f64; 2] = [0.55, 0.6];

/// Laws, and their Poisson ratio in the plane and in space.
const LAWS: [(&str, &str); 4] = [
    ("bond-based", "bond-based]"),
    ("LPS .2", "lps]\npoisson-ratio = 0.2"),
    ("LPS .3", "lps]\npoisson-ratio = 0.3"),
    ("LPS .4", "lps]\npoisson-ratio = 0.4"),
];

/// A law close to incompressible, which has no limit.
const STIFF: (&str, &str) = ("LPS .45", "lps]\npoisson-ratio = 0.45");

/// A scene that was drawn, with a mesh of a family.
struct Case {
    family: usize,
    law: (&'static str, &'static str),
    name: String,
    m: u32,
    spacing: f64,
    text: String,
}

/// A body of a family that moves, of a law, with further lines.
fn body(family: &Family, law: &str, more: &str) -> String {
    format!(
        "kinematics = \"{}\"\n[mesh.file]\npath = \"{}\"\n[materials.m.{law}\nyoungs-modulus = 7\ndensity = 2\n\
         [initial.v.velocity]\nx = \"1e-3*x\"\n[solve.explicit]\nduration = 1\n{more}",
        family.kinematics, family.file,
    )
}

/// Draws a scene of a family, `elements` being the least and the largest size of its elements in spacings.
fn drawn<const D: usize>(
    draw: &mut Draw,
    (number, family): (usize, &Family),
    law: (&'static str, &'static str),
    k: usize,
) -> Case {
    let place = draw.one(&PLACES);
    let m = if D == 3 { 3 } else { draw.one(&[3, 4]) };
    let spacing = family.size / draw.within(1.0, if D == 3 { 2.5 } else { 4.0 });
    let radius = match D {
        3 => draw.within(1.6, 2.6),
        _ => draw.within(3.0, 7.0),
    };
    let origin: Vec<f64> = (0..D).map(|_| spacing * draw.within(0.0, 1.0)).collect();
    let zone = zone::<D>(draw, family, place, spacing * radius);
    let more = format!(
        "[peridynamics]\nhorizon = {}\npoints.lattice = {{ spacing = {spacing}, origin = {origin:?} }}\n\
         [zones]\nnonlocal.{zone}\n[coupling.truncated]\n",
        f64::from(m) * spacing,
    );
    Case {
        family: number,
        law,
        name: format!("{}, {}, m = {m}, {place}, number {k}", family.name, law.0),
        m,
        spacing,
        text: body(family, law.1, &more),
    }
}

/// The stable step of a scene, and the choices that it makes.
fn step(text: &str, family: Option<&Family>) -> Result<(f64, Vec<Decision>), String> {
    let files = family.map(|family| (family.file, family.mesh.as_str()));
    let files: Vec<(&str, &str)> = files.into_iter().collect();
    let found = scene::check(text, &[], &files)?;
    let motion = found.motion.ok_or("the scene does not move")?;
    Ok((motion.stable_step, found.choices))
}

/// The stable step of points alone at a spacing of one, in a block of `8 m` of them along each axis.
fn step_of_points(kinematics: &str, law: &str, m: u32) -> Result<f64, String> {
    let (mesh, axes): (_, &[&str]) = match kinematics {
        "solid" => ("box", &["x", "y", "z"]),
        _ => ("rectangle", &["x", "y"]),
    };
    let cells = 4 * m;
    let list = |x: u32| format!("{:?}", vec![x; axes.len()]);
    let along: Vec<String> = (axes.iter())
        .map(|axis| format!("{axis} = {{ cells = {cells} }}"))
        .collect();
    let text = format!(
        "kinematics = \"{kinematics}\"\ncoupling = \"nonlocal\"\n[mesh.{mesh}]\nmin = {}\nmax = {}\n{}\n\
         [materials.m.{law}\nyoungs-modulus = 7\ndensity = 2\n[peridynamics]\nhorizon = {m}\npoints.lattice = {{ spacing = 1 }}\n\
         [initial.v.velocity]\nx = \"1e-3*x\"\n[solve.explicit]\nduration = 1\n",
        list(0),
        list(cells),
        along.join("\n"),
    );
    Ok(step(&text, None)?.0)
}

/// Result of a scene.
enum Found {
    /// The stable step over the smaller one of its parts alone, beside a rim whose cells are two spacings wide.
    Wide(f64),
    /// The same where only single cells have room between points and surface.
    Single(f64),
    /// The zone holds no point of the lattice within the body.
    Empty,
    Refused(String),
}

/// Parts of the messages of zones without points.
const EMPTY: [&str; 2] = [
    "holds no peridynamic point",
    "no cell has its centroid inside",
];

fn found(case: &Case, family: &Family) -> Found {
    let ratio = || -> Result<(f64, bool), String> {
        let (coupled, choices) = step(&case.text, Some(family))?;
        let alone = body(family, case.law.1, "[coupling.local]\n");
        let elements = step(&alone, Some(family))?.0;
        let points = case.spacing * step_of_points(family.kinematics, case.law.1, case.m)?;
        let wide = format!("of edge {} around", number(2.0 * case.spacing));
        let is_wide = choices.iter().any(|c| c.choice.contains(&wide));
        Ok((coupled / elements.min(points), is_wide))
    };
    match ratio() {
        Ok((ratio, true)) => Found::Wide(ratio),
        Ok((ratio, false)) => Found::Single(ratio),
        Err(why) if EMPTY.iter().any(|part| why.contains(part)) => Found::Empty,
        Err(why) => Found::Refused(why),
    }
}

/// Adds the distribution of the steps of a law.
fn distribution(table: &mut Table, law: &str, least: f64, all: &[&Found]) {
    let of = |value: fn(&Found) -> Option<f64>| {
        let mut values: Vec<f64> = all.iter().filter_map(|found| value(found)).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let wide = of(|found| match found {
        Found::Wide(ratio) => Some(*ratio),
        _ => None,
    });
    let single = of(|found| match found {
        Found::Single(ratio) => Some(*ratio),
        _ => None,
    });
    for (values, what, is_limited) in [
        (wide, "rims two spacings wide", law != STIFF.0),
        (single, "rims of single cells", false),
    ] {
        let Some(&first) = values.first() else {
            continue;
        };
        let quantity = format!("{what}: least of {}", values.len());
        table.push(match is_limited {
            true => TableRow::at_least(law, quantity, first, least),
            false => TableRow::info(law, quantity, first),
        });
        for (name, part) in [("a tenth is below", 0.1), ("half is below", 0.5)] {
            let k = (part * values.len() as f64) as usize;
            table.push(TableRow::info(law, format!("{what}: {name}"), values[k]));
        }
    }
}

/// The table of the plane, or of space.
fn table<const D: usize>(effort: Effort, progress: &dyn Progress) -> Table {
    let list = match D {
        3 => vec![lug(8), bent_bar(8)],
        _ => {
            let triangles = families().into_iter();
            let triangles = triangles.filter(|f| f.name == "Delaunay triangles");
            [jittered(24)].into_iter().chain(triangles).collect()
        }
    };
    let second = list.iter().filter_map(second_order).collect();
    let list: Vec<Family> = [list, second].concat();
    let count = match (effort, D) {
        (Effort::Quick, 3) => 0,
        (Effort::Quick, _) => 40,
        (_, 3) => 100,
        _ => 200,
    };
    let mut draw = Draw::new(SEED + D as u64);
    let cases: Vec<Case> = (0..count + count / 5)
        .map(|k| {
            let number = k % list.len();
            // the last ones have no limit
            let law = if k < count { draw.one(&LAWS) } else { STIFF };
            drawn::<D>(&mut draw, (number, &list[number]), law, k)
        })
        .collect();
    progress.stage("stable steps", Some(cases.len() as u64));
    let all: Vec<Found> = (cases.par_iter())
        .map(|case| {
            let found = found(case, &list[case.family]);
            progress.advance(1);
            found
        })
        .collect();
    let least = LEAST[D - 2];
    let mut table = Table::new(
        format!(
            "Stable steps beside {count} zones drawn in {D}D by seed {}, truncated, elements of 1 to {} spacings: over the smaller one of elements alone and points alone",
            SEED + D as u64,
            if D == 3 { 2.5 } else { 4.0 },
        ),
        Columns::Full,
    );
    for law in LAWS.iter().chain([&STIFF]) {
        let own = cases.iter().zip(&all).filter(|(c, _)| c.law.0 == law.0);
        let own: Vec<&Found> = own.map(|(_, found)| found).collect();
        distribution(&mut table, law.0, least, &own);
    }
    let empty = all.iter().filter(|f| matches!(f, Found::Empty)).count();
    table.push(TableRow::info("all", "zones without a point", empty as f64));
    for (case, found) in cases.iter().zip(&all) {
        let name = case.name.as_str();
        match found {
            Found::Wide(ratio) if *ratio < least && case.law.0 != STIFF.0 => {
                table.push(TableRow::at_least(name, "step", *ratio, least));
            }
            Found::Refused(why) => {
                table.push(TableRow::refused(name, "scene", why.clone()));
            }
            _ => {}
        }
    }
    table
}

/// The tables.
pub(super) fn tables(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let mut tables = vec![table::<2>(effort, progress)];
    if effort != Effort::Quick {
        tables.push(table::<3>(effort, progress));
    }
    tables
}
