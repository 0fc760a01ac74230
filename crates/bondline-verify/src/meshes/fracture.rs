//! Energy typed against energy spent: planes pulled apart, and the balance of bodies that break.
//!
//! Two halves of a block are moved apart as rigid bodies, in steps of 0.5 % of the opening, until no bond joins them. Blocks of several sections are compared, so that what their sides lack drops out. Steps break bonds a little late,
//! which costs 0.5 % more.

use rayon::prelude::*;

use super::scene;
use crate::Effort;
use bondline::{
    observe::{
        cracks::CrackSummary,
        report::{Columns, Table, TableRow},
        summary::MotionSummary,
    },
    progress::Progress,
};

/// Largest relative difference of the energy that a plane takes from the fracture energy.
pub const PLANE_LIMIT: f64 = 0.02;

/// Largest energy that nothing accounts for, over the work, at a tenth of the stable step.
pub const BALANCE_LIMIT: f64 = 1e-3;

/// Fracture energy of the blocks, with E and the spacing one: bonds stretch by 1e-6 to 1e-5.
const ENERGY: f64 = 1e-10;

/// Two ways to a material.
const LAWS: [(&str, &str); 2] = [
    ("bond-based", "bond-based]"),
    ("LPS", "lps]\npoisson-ratio = 0.2"),
];

/// A block of unit spacing, `lengths` points along each axis, whose halves beyond `x cos a + y sin a = middle` are pulled apart.
fn block(lengths: &[u32], m: u32, material: &str, angle: f64) -> String {
    let d = lengths.len();
    let (kinematics, mesh) = [
        ("bar", "line"),
        ("plane-stress", "rectangle"),
        ("solid", "box"),
    ][d - 1];
    let list = |values: Vec<String>| match &values[..] {
        [one] => one.clone(),
        all => format!("[{}]", all.join(", ")),
    };
    let corner = |f: &dyn Fn(u32) -> f64| list(lengths.iter().map(|&n| f(n).to_string()).collect());
    let axes = &["x", "y", "z"][..d];
    let cells: Vec<String> = axes
        .iter()
        .map(|a| format!("{a} = {{ spacing = 1 }}"))
        .collect();
    // the stretch at which bonds break lies within 0.6 and 1.6 of that of a continuous family
    let stretch = [1.73, 1.18, 0.91][d - 1] * (ENERGY / f64::from(m)).sqrt();
    let (first, last) = (0.6 * stretch, 1.6 * stretch * f64::from(m * m));
    let steps = 2 + ((last / first).ln() / 0.005).ceil() as u32;
    let (sin, cos) = angle.to_radians().sin_cos();
    let opening = format!("{first:e} * min(t, 1) * exp(0.005 * max(t - 1, 0))");
    let along = [cos, sin, 0.0];
    let held: Vec<String> = axes.iter().map(|a| format!("{a} = 0")).collect();
    let moved: Vec<String> = axes
        .iter()
        .zip(along)
        .map(|(a, n)| format!("{a} = \"{n:.17} * {opening}\""))
        .collect();
    // off the points, which lie half a spacing inside of the corner
    let half = f64::from(lengths[0]) * 0.5;
    let far = 4.0 * f64::from(lengths[0]);
    let (behind, ahead) = if angle == 0.0 {
        let of = |from: f64, to: f64| {
            let low = corner(&|n| if n == lengths[0] { from } else { -1.0 });
            let high = corner(&|n| {
                if n == lengths[0] {
                    to
                } else {
                    f64::from(n) + 1.0
                }
            });
            format!("inside.box = {{ min = {low}, max = {high} }}")
        };
        // the first axis is the longest one, and no other is as long
        (of(-1.0, half), of(half, far))
    } else {
        let at = |along: f64, across: f64| {
            let x = half + 0.013 + along * cos - across * sin;
            let y = half + 0.029 + along * sin + across * cos;
            format!("[{x}, {y}]")
        };
        let of = |sign: f64| {
            let corners = [
                at(0.0, -far),
                at(sign * far, -far),
                at(sign * far, far),
                at(0.0, far),
            ];
            format!("inside.polygon = [{}]", corners.join(", "))
        };
        (of(-1.0), of(1.0))
    };
    format!(
        "kinematics = \"{kinematics}\"\ncoupling = \"nonlocal\"\n[mesh.{mesh}]\nmin = {}\nmax = {}\n{}\n[materials.m.{material}\nyoungs-modulus = 1\nfracture-energy = {ENERGY:e}\nsoftening = 1\n\
         [peridynamics]\nhorizon = {m}\npoints.lattice = {{ spacing = 1, origin = {} }}\n[conditions.behind.displacement]\n{behind}\n{}\n[conditions.ahead.displacement]\n{ahead}\n{}\n\
         [solve.quasi-static]\nsteps = {steps}\nduration = {steps}\noutputs = 1\n[output]\nvtu = false\n",
        corner(&|_| 0.0),
        corner(&f64::from),
        cells.join("\n"),
        corner(&|_| 0.5),
        held.join("\n"),
        moved.join("\n"),
    )
}

fn cracks(text: &str) -> Result<CrackSummary, String> {
    let motion = scene::run(text, &[], &[])?.motion;
    motion
        .and_then(|m: MotionSummary| m.cracks)
        .ok_or_else(|| "no bond can break".to_owned())
}

/// Energy and area of a plane normal to the first axis, of a section that has no sides: those of blocks three and two horizons wide, less what is common.
pub fn plane(dimension: usize, m: u32, material: &str) -> Result<[f64; 2], String> {
    let of = |sides: &[u32]| {
        let lengths: Vec<u32> = std::iter::once(4 * m)
            .chain(sides.iter().map(|k| k * m))
            .collect();
        cracks(&block(&lengths, m, material, 0.0)).map(|c| [c.dissipated_energy, c.area])
    };
    let section = f64::from(m).powi(dimension as i32 - 1);
    let sum = match dimension {
        1 => of(&[])?,
        2 => {
            let (wide, narrow) = (of(&[3])?, of(&[2])?);
            [0, 1].map(|k| wide[k] - narrow[k])
        }
        _ => {
            let (wide, oblong, narrow) = (of(&[3, 3])?, of(&[3, 2])?, of(&[2, 2])?);
            [0, 1].map(|k| wide[k] - 2.0 * oblong[k] + narrow[k])
        }
    };
    Ok(sum.map(|s| s / section))
}

/// Energy per length of a line at an angle to the lattice: of squares ten and eight horizons wide.
fn inclined(m: u32, material: &str, angle: f64) -> Result<f64, String> {
    let of = |k: u32| cracks(&block(&[k * m, k * m], m, material, angle));
    let length = 2.0 * f64::from(m) / angle.to_radians().cos();
    Ok((of(10)?.dissipated_energy - of(8)?.dissipated_energy) / length)
}

/// Planes along the lattice's axes, and at angles in 2D.
pub fn planes(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    progress.stage("planes pulled apart", None);
    let mut cases = Vec::new();
    for (d, ratios) in [(1, 3..=6), (2, 3..=6), (3, 3..=6)] {
        for m in ratios {
            for law in LAWS {
                let is_dear = (d == 2 && m > 4) || d == 3;
                if effort == Effort::Full || !is_dear {
                    cases.push((d, m, law));
                }
            }
        }
    }
    let rows: Vec<Vec<TableRow>> = cases
        .into_par_iter()
        .map(|(d, m, (law, material))| {
            let name = format!("{d}D {law}, m = {m}");
            match plane(d, m, material) {
                Ok([energy, area]) => vec![
                    TableRow::within(
                        &name,
                        "energy over fracture energy",
                        energy / ENERGY,
                        1.0,
                        PLANE_LIMIT,
                    ),
                    TableRow::within(&name, "crack area over section", area, 1.0, 1e-9),
                ],
                Err(why) => vec![TableRow::refused(&name, "energy over fracture energy", why)],
            }
        })
        .collect();
    let mut table = Table::new(
        "Planes pulled apart: what bonds take over what was typed, along the axes and at angles",
        Columns::Full,
    );
    table.rows.extend(rows.into_iter().flatten());
    let ratios: &[u32] = if effort == Effort::Full {
        &[3, 4, 6]
    } else {
        &[3]
    };
    let angles: Vec<(u32, (&str, &str), f64)> = ratios
        .iter()
        .flat_map(|&m| LAWS.map(|law| [30.0, 45.0].map(|angle| (m, law, angle))))
        .flatten()
        .collect();
    let found: Vec<TableRow> = angles
        .into_par_iter()
        .map(|(m, (law, material), angle)| {
            let name = format!("2D {law}, m = {m}, at {angle} degrees");
            match inclined(m, material, angle) {
                Ok(energy) => TableRow::info(&name, "energy over fracture energy", energy / ENERGY),
                Err(why) => TableRow::refused(&name, "energy over fracture energy", why),
            }
        })
        .collect();
    table.rows.extend(found);
    vec![table]
}

/// A notched plate whose sides move apart, until a crack has run through a part of it; `fraction` of the stable step.
pub fn plate(coupling: &str, material: &str, fraction: f64) -> String {
    let zones = match coupling {
        "nonlocal" => "",
        "blending" => {
            "[zones]\nnonlocal = { box = { min = [5, 5], max = [27, 19] } }\ntransition = { around = 4 }\ndamage-at-edge = \"warn\"\n"
        }
        _ => {
            "[zones]\nnonlocal = { box = { min = [5, 5], max = [27, 19] } }\ndamage-at-edge = \"warn\"\n"
        }
    };
    format!(
        "kinematics = \"plane-stress\"\ncoupling = \"{coupling}\"\n{zones}[mesh.rectangle]\nmin = [0, 0]\nmax = [32, 24]\nx = {{ spacing = 1 }}\ny = {{ spacing = 1 }}\n\
         [materials.m.{material}\nyoungs-modulus = 1\ndensity = 1\nfracture-energy = 1e-4\nsoftening = 1\n[peridynamics]\nhorizon = 3\npoints.lattice = {{ spacing = 1, origin = [0.5, 0.5] }}\n\
         [cracks]\nnotch = {{ segment = {{ from = [8, 12], to = [14, 12] }} }}\n\
         [conditions.top.velocity]\non = \"top\"\ny = \"0.003 * min(1, t / 40)\"\n[conditions.bottom.displacement]\non = \"bottom\"\ny = 0\n\
         [solve.explicit]\nduration = 110\nstep-fraction = {fraction}\noutputs = 1\n[output]\nvtu = false\n"
    )
}

/// Triangles from Gmsh whose sides move apart: a notch in the middle of a box across them.
const TRIANGLES: &str = r#"
kinematics = "plane-stress"
coupling = "truncated"
mesh.file.path = "m.msh"
peridynamics = { horizon = 0.9, points.lattice = { spacing = 0.3 } }
zones.nonlocal.box = { min = [6.13, 5.88], max = [14.21, 13.77] }
zones.damage-at-edge = "warn"
cracks.notch.segment = { from = [9, 10], to = [11, 10] }
conditions.top.velocity = { inside = { box = { min = [-1, 19.9], max = [21, 21] } }, y = "0.004 * min(1, t / 30)" }
conditions.bottom.displacement = { inside = { box = { min = [-1, -1], max = [21, 0.1] } }, y = 0 }
solve.explicit = { duration = 60, outputs = 0 }
output.vtu = false
"#;

/// A bar of tetrahedra from Gmsh that is pulled: a notch in the middle of a box across them.
const TETRAHEDRA: &str = r#"
kinematics = "solid"
coupling = "truncated"
mesh.file.path = "m.msh"
peridynamics = { horizon = 0.375, points.lattice = { spacing = 0.125 } }
zones.nonlocal.box = { min = [2.05, 0, 0], max = [3.93, 1, 1] }
zones.damage-at-edge = "warn"
cracks.notch.polygon = [[3.01, -0.1, -0.1], [3.01, 0.4, -0.1], [3.01, 0.4, 1.1], [3.01, -0.1, 1.1]]
conditions.end.velocity = { on = "end", x = "0.01 * min(1, t / 6)" }
conditions.start.displacement = { on = "start", x = 0, y = 0, z = 0 }
solve.explicit = { duration = 24, outputs = 0 }
output.vtu = false
"#;

/// Bodies from Gmsh that break: what they are called, scene, mesh.
const FROM_GMSH: [(&str, &str, &str); 2] = [
    (
        "truncated, Gmsh triangles",
        TRIANGLES,
        include_str!("../../../../meshes/graded_triangles.msh"),
    ),
    (
        "truncated, Gmsh tetrahedra",
        TETRAHEDRA,
        include_str!("../../../../meshes/bar_tets.msh"),
    ),
];

/// Energy that nothing accounts for, over the work, and how many bonds broke.
pub fn balance(
    text: &str,
    overrides: &[&str],
    files: &[(&str, &str)],
) -> Result<(f64, u64), String> {
    let motion = scene::run(text, overrides, files)?
        .motion
        .ok_or("it does not move")?;
    let dissipated = motion.cracks.map_or(0.0, |c| c.dissipated_energy);
    Ok((
        (motion.missing_energy - dissipated) / motion.external_work,
        motion.broken_bonds,
    ))
}

/// Parts of the stable step at which balances are taken, falling.
const FRACTIONS: [f64; 3] = [0.4, 0.2, 0.1];

/// Rows of the balance of one body at falling steps; at the smallest one it has to close.
fn closing(
    name: &str,
    closes: bool,
    run: impl Fn(f64) -> Result<(f64, u64), String>,
) -> Vec<TableRow> {
    let row = |fraction: f64| {
        let quantity = format!("unaccounted over work, {fraction} of the stable step");
        match run(fraction) {
            Ok((_, 0)) => {
                TableRow::at_most(name, quantity, f64::NAN, BALANCE_LIMIT).because("no bond broke")
            }
            Ok((gap, _)) if closes && fraction == FRACTIONS[2] => {
                TableRow::at_most(name, quantity, gap.abs(), BALANCE_LIMIT)
            }
            Ok((gap, _)) => TableRow::info(name, quantity, gap),
            Err(why) => TableRow::refused(name, quantity, why),
        }
    };
    FRACTIONS.into_iter().map(row).collect()
}

/// Balance of energy of plates that break.
pub fn balances(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    progress.stage("energy of plates that break", None);
    let laws = [
        ("bond-based", "bond-based]"),
        ("LPS", "lps]\npoisson-ratio = 0.35"),
    ];
    let mut cases = Vec::new();
    for law in laws {
        for coupling in ["nonlocal", "truncated", "splice", "blending", "balanced"] {
            if effort == Effort::Full || matches!(coupling, "nonlocal" | "truncated") {
                cases.push((law, coupling));
            }
        }
    }
    let mut rows: Vec<Vec<TableRow>> = cases
        .into_par_iter()
        .map(|((law, material), coupling)| {
            let closes = matches!(coupling, "nonlocal" | "truncated");
            closing(&format!("{coupling}, {law}"), closes, |fraction| {
                balance(&plate(coupling, material, fraction), &[], &[])
            })
        })
        .collect();
    if effort == Effort::Full {
        let bodies = FROM_GMSH.into_par_iter().flat_map(|body| {
            // an LPS in space is beyond what factors at such a seam can meet
            let count = if body.1 == TRIANGLES { 2 } else { 1 };
            laws[..count].par_iter().map(move |law| (body, law))
        });
        let found: Vec<Vec<TableRow>> = bodies
            .map(|((name, text, mesh), (law, material))| {
                closing(&format!("{name}, {law}"), true, |fraction| {
                    let text = format!("{text}[materials.m.{material}\nyoungs-modulus = 1\ndensity = 1\nfracture-energy = 1e-4\nsoftening = 1\n");
                    let fraction = format!("solve.explicit.step-fraction={fraction}");
                    balance(&text, &[&fraction], &[("m.msh", mesh)])
                })
            })
            .collect();
        rows.extend(found);
    }
    let mut table = Table::new(
        "Balance of energy of a notched plate that breaks: energy at the start and work, less kinetic, stored and dissipated energy",
        Columns::Full,
    );
    table.rows.extend(rows.into_iter().flatten());
    vec![table]
}
