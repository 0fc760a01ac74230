//! Specimens of fracture mechanics as scenes of `meshes/specimens`, on meshes from Gmsh: the load at which their crack grows beside closed forms.
//!
//! Each is held and moved at its ends, at single nodes or at supports, as its closed form has it. The load rises with every load step until the crack grows;
//! what it does afterwards is that of a crack that runs, and is not looked at.

use crate::Effort;
use crate::observed::{Seen, run_scene_with};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
};
use std::f64::consts::PI;

/// Largest distance of the load at growth from that of fracture mechanics, relative to this.
pub const LOAD_LIMIT: f64 = 0.05;

/// Largest change of a load at growth where the horizon is halved twice.
pub const TREND_LIMIT: f64 = 0.02;

/// E and G0 of the scenes \[MPa, N/mm\].
const GLASS: [f64; 2] = [70e3, 0.01];

/// Horizon of the scenes \[mm\].
const HORIZON: f64 = 3.0;

/// Name and text of a file of `meshes/specimens`.
macro_rules! file {
    ($name:literal) => {
        (
            $name,
            include_str!(concat!("../../../meshes/specimens/", $name)),
        )
    };
}

/// Load steps that end soon after the crack has grown, since those that follow take most of the time of fine points.
const UNTIL_IT_GROWS: &[&str] = &[
    "solve.quasi-static.steps=[0.9,0.95,0.97,0.98,0.985,0.99,0.995,1,1.005,1.01,1.015,1.02,1.025]",
];

type File = (&'static str, &'static str);

/// A mesh, a horizon of three spacings, and keys that are set otherwise than in the scene.
type Run = (File, f64, &'static [&'static str]);

/// A scene and its runs, the first with the largest horizon.
struct Specimen {
    name: &'static str,
    scene: File,
    /// Load at growth over √(E G0), by fracture mechanics.
    critical: f64,
    runs: Vec<Run>,
}

impl Specimen {
    /// Load at growth over that of fracture mechanics: the largest before the load first falls.
    fn growth(&self, (mesh, horizon, set): Run) -> Result<(f64, Seen), String> {
        let mut keys = vec![
            format!("mesh.file.path={}", mesh.0),
            format!("peridynamics.horizon={horizon}"),
            format!("peridynamics.points.lattice.spacing={}", horizon / 3.0),
        ];
        keys.extend(set.iter().map(|key| (*key).to_owned()));
        let seen = run_scene_with(self.scene.1, &keys, &[mesh])?;
        let loads = seen.columns("history", ["load_reaction_y"]);
        let falls = |pair: &&[[f64; 1]]| pair[1][0].abs() < pair[0][0].abs();
        let pair = loads.windows(2).find(falls);
        let [largest] = pair.ok_or("its load does not fall")?[0];
        let [modulus, energy] = GLASS;
        let critical = (modulus * energy).sqrt() * self.critical;
        Ok((largest.abs() / critical, seen))
    }
}

/// Plate of a width W under tension with a crack 2a in its centre [Tada2000].
fn centre_crack(a: f64, w: f64) -> f64 {
    w * ((PI * a / w).cos() / (PI * a)).sqrt()
}

/// The same with a crack a from its edge, ends free to turn [Tada2000].
fn edge_notch(a: f64, w: f64) -> f64 {
    let z = 0.5 * PI * a / w;
    let factor = 0.752 + 2.02 * a / w + 0.37 * (1.0 - z.sin()).powi(3);
    w * z.cos() / (factor * (PI * a * z.tan() / z).sqrt())
}

/// Compact tension [ASTM2022-399].
fn compact_tension(a: f64, w: f64) -> f64 {
    let x = a / w;
    let factor = 0.886 + x * (4.64 + x * (-13.32 + x * (14.72 - 5.6 * x)));
    w.sqrt() * (1.0 - x).powf(1.5) / ((2.0 + x) * factor)
}

/// Three-point bending of a beam of a height W on a span of 4 W [ASTM2022-399].
fn three_point(a: f64, w: f64) -> f64 {
    let x = a / w;
    let factor = 1.99 - x * (1.0 - x) * (2.15 + x * (-3.93 + 2.7 * x));
    w.sqrt() * (1.0 + 2.0 * x) * (1.0 - x).powf(1.5) / (6.0 * x.sqrt() * factor)
}

/// Pure bending of a beam of a height W between loads 2 W apart on a span of 4 W [BrownSrawley1966].
fn four_point(a: f64, w: f64) -> f64 {
    let x = a / w;
    let factor = 1.122 + x * (-1.4 + x * (7.33 + x * (-13.08 + 14.0 * x)));
    // the moment is half of the load times W
    w / (3.0 * factor * (PI * a).sqrt())
}

/// Double cantilever with arms of a height H: beams that shear and whose roots turn, E′ = E [FooteBuchwald1985].
fn double_cantilever(a: f64, h: f64) -> f64 {
    h.powf(1.5) / (12_f64.sqrt() * (a + 0.673 * h))
}

// One function: a list.
fn specimens(effort: Effort) -> Vec<Specimen> {
    let of = |name, scene, critical, runs| Specimen {
        name,
        scene,
        critical,
        runs,
    };
    let once = |mesh| vec![(mesh, HORIZON, &[] as &[_])];
    let (centre, edge) = (file!("centre_crack.toml"), file!("edge_notch.toml"));
    let (strip, beam) = (file!("edge_notch.msh"), file!("bending.msh"));
    let mut three = of(
        "three-point bending, a/W = 0.5, a = 32",
        file!("three_point.toml"),
        three_point(32.0, 64.0),
        once(beam),
    );
    if effort == Effort::Quick {
        return vec![three];
    }
    let finer = [HORIZON / 2.0, HORIZON / 4.0];
    three.runs.extend(finer.map(|h| (beam, h, UNTIL_IT_GROWS)));
    vec![
        of(
            "centre crack, 2a/W = 0.1, a = 30",
            centre,
            centre_crack(30.0, 600.0),
            vec![(
                file!("centre_crack_10.msh"),
                HORIZON,
                &["conditions.load.displacement.y=\"0.0587 * t\""],
            )],
        ),
        of(
            "centre crack, 2a/W = 0.25, a = 30",
            centre,
            centre_crack(30.0, 240.0),
            vec![
                (file!("centre_crack_25.msh"), HORIZON, &[]),
                (
                    file!("centre_crack_half.msh"),
                    finer[0],
                    &["zones.nonlocal.box={min=[-39,-7.5],max=[39,7.5]}"],
                ),
                (
                    file!("centre_crack_quarter.msh"),
                    finer[1],
                    &["zones.nonlocal.box={min=[-34.5,-3.75],max=[34.5,3.75]}"],
                ),
            ],
        ),
        of(
            "centre crack, 2a/W = 0.5, a = 30",
            centre,
            centre_crack(30.0, 120.0),
            vec![(
                file!("centre_crack_50.msh"),
                HORIZON,
                &["conditions.load.displacement.y=\"0.0118 * t\""],
            )],
        ),
        of(
            "edge notch, a/W = 0.2, a = 32",
            edge,
            edge_notch(32.0, 160.0),
            vec![(
                strip,
                HORIZON,
                &[
                    "cracks.start.segment={from=[-1,0],to=[32,0]}",
                    "conditions.load.displacement.y=\"0.0258 * t\"",
                ],
            )],
        ),
        of(
            "edge notch, a/W = 0.5, a = 80",
            edge,
            edge_notch(80.0, 160.0),
            once(strip),
        ),
        of(
            "compact tension, a/W = 0.5, a = 60",
            file!("compact_tension.toml"),
            compact_tension(60.0, 120.0),
            once(file!("compact_tension.msh")),
        ),
        of(
            "double cantilever, a/H = 4, a = 120",
            file!("double_cantilever.toml"),
            double_cantilever(120.0, 30.0),
            once(file!("double_cantilever.msh")),
        ),
        of(
            "four-point bending, a/W = 0.5, a = 32",
            file!("four_point.toml"),
            four_point(32.0, 64.0),
            once(beam),
        ),
        three,
    ]
}

/// Table of the specimens: all of them, or the one that takes the least time.
pub fn table(effort: Effort, progress: &dyn Progress) -> Table {
    let mut table = Table::new(
        "Specimens, coupled, LPS, nu = 0.3, plane stress, m = 3: load at growth over that of fracture mechanics, lengths in mm",
        Columns::Full,
    );
    let all = specimens(effort);
    let runs = all.iter().map(|specimen| specimen.runs.len() as u64);
    progress.stage("specimens", Some(runs.sum()));
    for specimen in &all {
        let mut coarse = None;
        for &run in &specimen.runs {
            let case = format!("{}, horizon {}", specimen.name, run.1);
            let of_load = |load| TableRow::within(&case, "load at growth", load, 1.0, LOAD_LIMIT);
            let load = match specimen.growth(run) {
                Ok((load, seen)) => {
                    table.push(of_load(load));
                    table.push(TableRow::info(&case, "seconds", seen.seconds));
                    load
                }
                Err(why) => {
                    table.push(of_load(f64::NAN).because(why));
                    f64::NAN
                }
            };
            if let Some(coarse) = coarse {
                let change = f64::abs(load / coarse - 1.0);
                let quantity = "change of it from the largest horizon";
                table.push(TableRow::at_most(&case, quantity, change, TREND_LIMIT));
            }
            coarse = coarse.or(Some(load));
            progress.advance(1);
        }
    }
    progress.finish();
    table
}
