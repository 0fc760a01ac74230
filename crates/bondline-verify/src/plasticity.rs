//! J2 plasticity in finite elements, by scenes: Cook's membrane beside CalculiX, and a thick cylinder beside Hill's solution.

use std::f64::consts::FRAC_PI_2;

use crate::Effort;
use crate::meshes::gmsh;
use crate::observed::{Seen, run_scene_with};
use bondline::{
    mesh::generate::{Axis, rectangle},
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
    tensor::Vector,
};

/// A kind of cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cell {
    /// With the mean dilatation of a cell.
    Quad4,
    /// Of second order.
    Quad8,
}

impl Cell {
    fn name(self) -> &'static str {
        match self {
            Self::Quad4 => "quad4",
            Self::Quad8 => "quad8",
        }
    }
}

/// A mesh as Gmsh writes it: the unit square with so many cells along either axis, its nodes moved to their `place`.
fn mapped(
    cell: Cell,
    cells: [usize; 2],
    place: impl Fn(f64, f64) -> [f64; 2],
) -> Result<String, String> {
    let axis = |cells: usize| Axis::Uniform {
        min: 0.0,
        max: 1.0,
        cells,
    };
    let grid = rectangle(axis(cells[0]), axis(cells[1]));
    let mut mesh = grid.mesh().map_err(|e| e.to_string())?;
    if cell == Cell::Quad8 {
        mesh.raise_order();
    }
    for x in &mut mesh.nodes {
        *x = Vector::<2>::from(place(x[0], x[1]));
    }
    Ok(gmsh::with_sets(&mesh))
}

/// Cells along a side, and the displacement of the corner (48, 60) \[mm\] by CalculiX 2.20 in ten equal increments.
///
/// Its cells are C3D8I, bricks with incompatible modes, one across the thickness and held in plane strain (`tests/fixtures/plasticity/cook.py`, `calculix_tips.csv`).
const TIPS: [(usize, [f64; 2]); 4] = [
    (8, [-2.315836, 3.037983]),
    (16, [-2.330329, 3.065762]),
    (32, [-2.353499, 3.093974]),
    (64, [-2.367733, 3.111036]),
];

/// The displacement of the corner (48, 60) of Cook's membrane \[mm\], `n` by `n` cells: Voce and linear hardening in plane strain, small strains, a shear force of 4 kN/mm on the right.
///
/// Bulk and shear modulus are 164.206 and 80.1938 GPa, the yield stress is `450 + 129.24 α + 265 (1 − exp(−16.93 α))` MPa, constants as in \[SimoHughes1998\].
fn cook(cell: Cell, n: usize) -> Result<([f64; 2], Seen), String> {
    const BULK: f64 = 164_206.0;
    const SHEAR: f64 = 80_193.8;
    let young = 9.0 * BULK * SHEAR / (3.0 * BULK + SHEAR);
    let poisson = (3.0 * BULK - 2.0 * SHEAR) / (2.0 * (3.0 * BULK + SHEAR));
    let mesh = mapped(cell, [n, n], |s, t| {
        [48.0 * s, 44.0 * s + t * (44.0 - 28.0 * s)]
    })?;
    let text = format!(
        "kinematics = \"plane-strain\"\ncoupling = \"local\"\nmesh.file.path = \"cook.msh\"\n[materials.membrane.plastic-correspondence]\nyoungs-modulus = {young}\npoisson-ratio = {poisson}\nyield-stress = 450\nhardening-modulus = 129.24\nsaturation-stress = 265\nsaturation-rate = 16.93\n[conditions.left.displacement]\non = \"left\"\nx = 0\ny = 0\n[conditions.right.traction]\non = \"right\"\ny = \"{}*t\"\n[solve.quasi-static]\nduration = 1\nsteps = 10\n[output]\nvtu = false\nprobes.tip = {{ at = [48, 60] }}\n",
        4000.0 / 16.0
    );
    let seen = run_scene_with(&text, &[], &[("cook.msh", &mesh)])?;
    let rows = seen.columns("history", ["tip_ux", "tip_uy"]);
    let last = rows.last().ok_or("the run has no history")?;
    Ok((*last, seen))
}

/// Largest relative distance of the tip from that of CalculiX: on the same mesh, or on its finest one for cells of second order.
///
/// The mean dilatation of a cell keeps flow from locking, but quad4 is stiffer in bending than bricks with incompatible modes: the two approach each other as the mesh is refined, 2.8 times per halving.
fn cook_limit(cell: Cell, n: usize) -> f64 {
    match (cell, n) {
        (Cell::Quad4, 8) => 0.17,
        (Cell::Quad4, 16) => 0.06,
        (Cell::Quad4, 32) => 0.021,
        (Cell::Quad4, _) => 0.01,
        (Cell::Quad8, 8) => 0.07,
        (Cell::Quad8, _) => 0.03,
    }
}

/// Products with the tangent in ten load steps: Newton's method takes 43 on 16 by 16 quad8 with the consistent tangent, 647 with differences of forces and factors of the elastic tangent, and a relaxation in its place
/// 10 000 in one load step.
const MOST_PRODUCTS: f64 = 500.0;

fn membranes(effort: Effort, progress: &dyn Progress) -> Table {
    let mut table = Table::new(
        "Cook's membrane, Voce and linear hardening, plane strain: displacement of the corner [mm] beside C3D8I of CalculiX on the same mesh, and beside its finest mesh for cells of second order",
        Columns::Full,
    );
    let (finest, converged) = TIPS[3];
    let mut cases: Vec<(Cell, usize, [f64; 2])> = TIPS
        .into_iter()
        .map(|(n, tip)| (Cell::Quad4, n, tip))
        .collect();
    cases.extend([8, 16].map(|n| (Cell::Quad8, n, converged)));
    cases.retain(|(_, n, ..)| effort == Effort::Full || *n <= 16);
    for (cell, n, reference) in cases {
        let limit = cook_limit(cell, n);
        progress.advance(1);
        let beside = match cell {
            Cell::Quad4 => String::new(),
            Cell::Quad8 => format!(" beside {finest} by {finest}"),
        };
        let case = format!("{n} by {n} {}{beside}", cell.name());
        match cook(cell, n) {
            Ok((tip, seen)) => {
                for (k, axis) in ["x", "y"].into_iter().enumerate() {
                    let quantity = format!("tip, {axis}");
                    table.push(TableRow::within(
                        &case,
                        quantity,
                        tip[k],
                        reference[k],
                        limit,
                    ));
                }
                let products = seen.iterations as f64;
                table.push(TableRow::at_most(
                    &case,
                    "products",
                    products,
                    MOST_PRODUCTS,
                ));
                table.push(TableRow::info(&case, "seconds", seen.seconds));
            }
            Err(why) => {
                let quantity = "tip, y";
                table.push(TableRow::at_most(&case, quantity, f64::NAN, limit).because(why));
            }
        }
    }
    table
}

/// Inner and outer radius of the cylinder.
const RADII: [f64; 2] = [1.0, 2.0];
const YOUNG: f64 = 2e5;
const YIELD: f64 = 250.0;

/// Difference of the principal stresses in the plane where the material flows: `2 Y/√3` by von Mises, out of the plane half of their sum.
fn flow_stress() -> f64 {
    2.0 * YIELD / 3f64.sqrt()
}

/// The pressure at which a cylinder without hardening flows without bound.
fn limit_pressure() -> f64 {
    flow_stress() * (RADII[1] / RADII[0]).ln()
}

/// Radial displacements of the bore and the rim under a pressure that makes the inner part of the cylinder flow; none before.
///
/// Source: \[Hill1950\] chapter V. Where it flows `σ_θ − σ_r = k`, outside the cylinder is elastic; the radius c between follows from the pressure, `p = k (ln(c/a) + (1 − c²/b²)/2)`, and
/// `u = (1 + ν)(1 − 2ν) r σ_r/E + (1 − ν²) k c²/(E r)`. Exact for a flow stress k that is the same everywhere, as for ν = 1/2.
fn hill(pressure: f64, poisson: f64) -> Option<[f64; 2]> {
    let ([a, b], k) = (RADII, flow_stress());
    let of = |c: f64| k * ((c / a).ln() + 0.5 * (1.0 - c * c / (b * b)));
    if pressure <= of(a) {
        return None;
    }
    let (mut low, mut high) = (a, b);
    for _ in 0..100 {
        let c = 0.5 * (low + high);
        match of(c) < pressure {
            true => low = c,
            false => high = c,
        }
    }
    let c = low;
    let flow = |r: f64| (1.0 - poisson * poisson) * k * c * c / (YOUNG * r);
    let squeezed = (1.0 + poisson) * (1.0 - 2.0 * poisson) / YOUNG * a * pressure;
    Some([flow(a) - squeezed, flow(b)])
}

/// A quarter of the cylinder, `n` cells across its wall, under a pressure that grows to 0.95 of the limit.
fn cylinder(cell: Cell, n: usize, poisson: f64) -> Result<Seen, String> {
    let [a, b] = RADII;
    let mesh = mapped(cell, [n, 3 * n / 2], |s, t| {
        let (sin, cos) = (FRAC_PI_2 * t).sin_cos();
        let r = a + (b - a) * s;
        [r * cos, r * sin]
    })?;
    let pressure = 0.95 * limit_pressure();
    let text = format!(
        "kinematics = \"plane-strain\"\ncoupling = \"local\"\nmesh.file.path = \"ring.msh\"\n[materials.ring.plastic-correspondence]\nyoungs-modulus = {YOUNG}\npoisson-ratio = {poisson}\nyield-stress = {YIELD}\nhardening-modulus = 0\n[conditions.foot.displacement]\non = \"bottom\"\ny = 0\n[conditions.side.displacement]\non = \"top\"\nx = 0\n[conditions.pressure.traction]\non = \"left\"\nx = \"{pressure}*t*x/hypot(x,y)\"\ny = \"{pressure}*t*y/hypot(x,y)\"\n[solve.quasi-static]\nduration = 1\nsteps = 20\n[output]\nvtu = false\nprobes.bore = {{ at = [{a}, 0] }}\nprobes.rim = {{ at = [{b}, 0] }}\n"
    );
    run_scene_with(&text, &[], &[("ring.msh", &mesh)])
}

/// Largest relative distances of the displacements of bore and rim from Hill's, and those at the last pressure.
fn beside_hill(seen: &Seen, poisson: f64) -> Result<[f64; 4], String> {
    let mut found = [0.0; 4];
    let mut flowing = 0;
    for [time, bore, rim] in seen.columns("history", ["time", "bore_ux", "rim_ux"]) {
        let Some(exact) = hill(0.95 * limit_pressure() * time, poisson) else {
            continue;
        };
        flowing += 1;
        for (k, u) in [bore, rim].into_iter().enumerate() {
            let off = u / exact[k] - 1.0;
            found[k] = f64::max(found[k], off.abs());
            found[2 + k] = off;
        }
    }
    match flowing {
        0..8 => Err(format!("{flowing} load steps with flow")),
        _ => Ok(found),
    }
}

/// Largest relative distance of a displacement from Hill's.
pub const CYLINDER_LIMIT: f64 = 0.01;

fn cylinders(effort: Effort, progress: &dyn Progress) -> Table {
    let mut table = Table::new(
        "Thick cylinder, radii 1:2, without hardening, plane strain, pressure up to 0.95 of the limit in 20 load steps: radial displacements over those of Hill, less 1, once it flows",
        Columns::Full,
    );
    let cells: &[usize] = match effort {
        Effort::Quick => &[8],
        Effort::Full => &[8, 16, 32],
    };
    for poisson in [0.3, 0.49] {
        for (cell, n) in (cells.iter().map(|n| (Cell::Quad4, *n))).chain([(Cell::Quad8, 8)]) {
            progress.advance(1);
            let case = format!("ν = {poisson}, {n} by {} {}", 3 * n / 2, cell.name());
            let seen = cylinder(cell, n, poisson);
            match seen.and_then(|seen| Ok((beside_hill(&seen, poisson)?, seen.seconds))) {
                Ok(([bore, rim, last_bore, last_rim], seconds)) => {
                    for (what, off) in [("bore", bore), ("rim", rim)] {
                        let quantity = format!("{what}, largest");
                        table.push(TableRow::at_most(&case, quantity, off, CYLINDER_LIMIT));
                    }
                    table.push(TableRow::info(&case, "bore at 0.95", last_bore));
                    table.push(TableRow::info(&case, "rim at 0.95", last_rim));
                    table.push(TableRow::info(&case, "seconds", seconds));
                }
                Err(why) => {
                    let quantity = "bore, largest";
                    let row = TableRow::at_most(&case, quantity, f64::NAN, CYLINDER_LIMIT);
                    table.push(row.because(why));
                }
            }
        }
    }
    table
}

/// The suite `plasticity`.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    progress.stage("plasticity", None);
    let tables = vec![membranes(effort, progress), cylinders(effort, progress)];
    progress.finish();
    tables
}
