//! Affine fields beside zones that are drawn: shape, place, coupling, law, horizon and lattice, by a seed that is written here.
//!
//! A zone that elements enclose must give the field to round-off. Where one reaches the surface of the body, families there lack points, whatever the seam does: the rows of
//! the seam away from the surface must be in balance then, and the scenes are counted apart.

use rayon::prelude::*;

use super::draw::{Draw, PLACES, zone};
use crate::{
    Effort,
    meshes::{
        affine::{COUPLINGS, Family, bent_bar, error, families, field_text, jittered, lug},
        deck, gmsh, scene,
    },
};
use bondline::{
    observe::{
        proof::Proof,
        report::{Columns, Table, TableRow},
    },
    progress::Progress,
};

/// Largest error of a displacement over the largest one, and largest force of a row of the seam over the stress of the field per spacing.
const LIMIT: f64 = 1e-11;

/// The seed of all that is drawn.
const SEED: u64 = 58;

const LAWS: [(&str, &str); 6] = [
    ("bond-based", "bond-based]"),
    ("LPS .05", "lps]\npoisson-ratio = 0.05"),
    ("LPS .2", "lps]\npoisson-ratio = 0.2"),
    ("LPS .3", "lps]\npoisson-ratio = 0.3"),
    ("LPS .45", "lps]\npoisson-ratio = 0.45"),
    ("correspondence", "correspondence]\npoisson-ratio = 0.3"),
];

/// A scene that was drawn, with a mesh of a family.
struct Case {
    family: usize,
    coupling: &'static str,
    /// True if zone and rim were drawn within the body: the field has to be exact then.
    is_inside: bool,
    name: String,
    text: String,
}

/// Draws a scene of a family.
fn drawn<const D: usize>(draw: &mut Draw, (number, family): (usize, &Family), k: usize) -> Case {
    let coupling = COUPLINGS[k % COUPLINGS.len()];
    let (law, place) = (draw.one(&LAWS), draw.one(&PLACES));
    // rows of state-based laws in space have thousands of columns
    let is_small = D == 3 && law.0 != "bond-based";
    let m = if is_small { 3 } else { draw.one(&[3, 4]) };
    // in spacings
    let radius = if D == 3 {
        draw.within(1.6, 2.6)
    } else {
        draw.within(3.0, 7.0)
    };
    // balanced rows may have one
    let has_transition = coupling.2 || coupling.0 == "balanced";
    let around = match has_transition {
        true => draw.within(2.0, 4.0),
        false => 0.0,
    };
    let reach = match (coupling.0, law.0) {
        ("truncated", _) => 1,
        (_, "bond-based") => m,
        _ => 2 * m,
    };
    // what lies inside has its rim inside, too
    let [low, high] = &family.extent;
    let half = (0..D)
        .map(|i| 0.5 * (high[i] - low[i]))
        .fold(f64::INFINITY, f64::min);
    let fits = 0.85 * half / (1.2 * radius + around + f64::from(reach) + 3.0);
    let h = (family.size * draw.within(0.4, 1.0)).min(match place {
        "inside" | "across" => fits,
        _ => 1.6 * fits,
    });
    let radius = h * radius;
    let origin: Vec<f64> = (0..D).map(|_| h * draw.within(0.0, 1.0)).collect();
    let zone = zone::<D>(draw, family, place, radius);
    let transition = match has_transition {
        true => format!("transition.around = {}\n", h * around),
        false => String::new(),
    };
    let text = format!(
        "kinematics = \"{}\"\n[mesh.file]\npath = \"{}\"\n[materials.m.{}\nyoungs-modulus = 7\ndensity = 2\n\
         [peridynamics]\nhorizon = {}\npoints.lattice = {{ spacing = {h}, origin = {origin:?} }}\n\
         [zones]\nnonlocal.{zone}\n{transition}{}\n\
         [conditions.all.displacement]\n{}\n{}[solver]\ntolerance = 1e-13\n",
        family.kinematics,
        family.file,
        law.1,
        f64::from(m) * h,
        coupling.1,
        family.boundary,
        field_text(D),
    );
    Case {
        family: number,
        coupling: coupling.0,
        is_inside: place == "inside",
        name: format!(
            "{}, {}, {}, m = {m}, {} {place}, number {k}",
            family.name,
            coupling.0,
            law.0,
            zone_name(&text),
        ),
        text,
    }
}

/// The shape that a scene types.
fn zone_name(text: &str) -> &str {
    let typed = text.split("nonlocal.").nth(1).unwrap_or_default();
    typed.split(' ').next().unwrap_or_default()
}

/// Parts of the messages of refusals for a surface that zone or rim meets.
const AT_SURFACES: [&str; 3] = [
    "acts where the coupling mixes both models",
    "would cross a surface that",
    "meets the surface of the body",
];

/// Result of a scene.
enum Found {
    /// Elements enclose the points: the largest error of a displacement.
    Enclosed(f64),
    /// Families lack points at a surface: the largest force of a row of the seam away from it.
    AtSurface(f64),
    /// Refused, and not for a surface.
    Refused(String),
    RefusedAtSurface(String),
}

/// Returns the largest force of rows that no surface excuses.
fn of_rows(proof: &Proof) -> f64 {
    let others = ["residual of rows", "residual at the seam", "residual among"];
    others
        .map(|name| proof.largest(name))
        .into_iter()
        .fold(0.0, f64::max)
}

fn found(case: &Case, family: &Family) -> Found {
    let outcome = scene::solve(&case.text, &[], &[(family.file, &family.mesh)]);
    let (summary, sites) = match outcome {
        Ok(solved) => solved,
        Err(why) => {
            return match AT_SURFACES.iter().any(|reason| why.contains(reason)) {
                true => Found::RefusedAtSurface(why),
                false => Found::Refused(why),
            };
        }
    };
    let error = error(&sites);
    match error <= LIMIT || case.is_inside || error.is_nan() {
        true => Found::Enclosed(error),
        false => Found::AtSurface(of_rows(&summary.proof)),
    }
}

/// The table.
pub(super) fn tables(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let mut families = all_families();
    if effort == Effort::Quick {
        // solids take minutes
        families.retain(|family| family.kinematics != "solid");
    }
    let each = if effort == Effort::Quick { 6 } else { 50 };
    let mut cases = Vec::new();
    for (number, family) in families.iter().enumerate() {
        let mut draw = Draw::new(SEED + number as u64);
        for k in 0..each {
            cases.push(match family.kinematics {
                "solid" => drawn::<3>(&mut draw, (number, family), k),
                _ => drawn::<2>(&mut draw, (number, family), k),
            });
        }
    }
    progress.stage("zones that are drawn", Some(cases.len() as u64));
    let found: Vec<Found> = (cases.par_iter())
        .map(|case| {
            let found = found(case, &families[case.family]);
            progress.advance(1);
            found
        })
        .collect();
    let mut table = Table::new(
        format!(
            "Zones drawn by seed {SEED}, {each} on each mesh, affine displacements on the whole surface"
        ),
        Columns::Full,
    );
    for (number, family) in families.iter().enumerate() {
        summed(
            &mut table,
            family.name,
            cases.iter().zip(&found).filter(|(c, _)| c.family == number),
        );
    }
    for (coupling, ..) in COUPLINGS {
        summed(
            &mut table,
            coupling,
            cases
                .iter()
                .zip(&found)
                .filter(|(c, _)| c.coupling == coupling),
        );
    }
    for (case, found) in cases.iter().zip(&found) {
        let name = case.name.as_str();
        match found {
            Found::Enclosed(e) if *e > LIMIT || e.is_nan() => {
                table.push(TableRow::at_most(
                    name,
                    "error of a displacement",
                    *e,
                    LIMIT,
                ));
            }
            Found::AtSurface(e) if *e > LIMIT || e.is_nan() => {
                table.push(TableRow::at_most(
                    name,
                    "rows away from the surface",
                    *e,
                    LIMIT,
                ));
            }
            Found::Refused(why) | Found::RefusedAtSurface(why) => {
                table.push(TableRow::refused(name, "scene", why.clone()));
            }
            Found::Enclosed(_) | Found::AtSurface(_) => {}
        }
    }
    vec![table]
}

/// Counts and largest errors of a list of scenes.
fn summed<'a>(table: &mut Table, name: &str, list: impl Iterator<Item = (&'a Case, &'a Found)>) {
    let (mut enclosed, mut at_surface) = ((0, 0.0f64), (0, 0.0f64));
    let (mut refused, mut refused_at_surface) = (0, 0);
    for (_, found) in list {
        match found {
            Found::Enclosed(e) => enclosed = (enclosed.0 + 1, enclosed.1.max(*e)),
            Found::AtSurface(e) => at_surface = (at_surface.0 + 1, at_surface.1.max(*e)),
            Found::Refused(_) => refused += 1,
            Found::RefusedAtSurface(_) => refused_at_surface += 1,
        }
    }
    table.push(TableRow::at_most(
        name,
        format!("{} zones in elements: error of a displacement", enclosed.0),
        enclosed.1,
        LIMIT,
    ));
    table.push(TableRow::at_most(
        name,
        format!("{} zones at surfaces: rows away from them", at_surface.0),
        at_surface.1,
        LIMIT,
    ));
    table.push(TableRow::info(
        name,
        "zones that are refused for a surface",
        f64::from(refused_at_surface),
    ));
    table.push(TableRow::at_most(
        name,
        "zones that are refused for another reason",
        f64::from(refused),
        0.0,
    ));
}

/// The meshes: of three and four nodes, of second order, jittered, and one read from a deck.
fn all_families() -> Vec<Family> {
    let triangles = families()
        .into_iter()
        .find(|f| f.name == "Delaunay triangles");
    let mut list = vec![jittered(24), lug(12), bent_bar(12)];
    list.extend(triangles);
    let deck = |family: &Family| {
        let mesh = deck::of_tetrahedra(&family.mesh).ok()?;
        Some(Family {
            name: "CalculiX deck",
            mesh,
            file: "m.inp",
            ..family.clone()
        })
    };
    let more: Vec<Family> = list.iter().filter_map(second_order).collect();
    let decks: Vec<Family> = list
        .iter()
        .filter(|f| f.name == "tets of a lug")
        .filter_map(deck)
        .collect();
    list.extend(more);
    list.extend(decks);
    list
}

/// The same body with cells of second order, of those that have a name then.
pub(super) fn second_order(family: &Family) -> Option<Family> {
    let (name, raised) = match family.name {
        "Delaunay triangles" => ("tri6, Delaunay", gmsh::raised::<2>(&family.mesh, |_| ())),
        "tets of a lug" => ("tet10, lug", gmsh::raised::<3>(&family.mesh, |_| ())),
        _ => return None,
    };
    let mesh = raised.ok()?;
    Some(Family {
        name,
        mesh,
        ..family.clone()
    })
}
