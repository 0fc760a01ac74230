//! Problems with known solutions: a hole under tension, a cantilever, a tapered panel.

use bondline::observe::report::{Columns, Table, TableRow};
use bondline::progress::Progress;
use bondline::tensor::Vector;

use super::Solution;
use crate::Effort;

/// A quarter of a square plate, curved cells of Gmsh: `meshes/second_order/kirsch.geo`.
const TRIANGLES: &str = include_str!("../../../../meshes/second_order/kirsch_tri6.msh");
const QUADRILATERALS: &str = include_str!("../../../../meshes/second_order/kirsch_quad8.msh");

/// The stress concentration at the hole of radius 1 in an infinite plate under unit tension along x, over 3.
///
/// Source: \[TimoshenkoGoodier1970\] section 35 (Kirsch): its stresses are the tractions on the outer boundary, a square of half width 4.
fn kirsch(mesh: &str, overrides: &[&str]) -> Result<f64, String> {
    const NU: f64 = 0.3;
    // cos 2θ, sin 2θ, cos 4θ, sin 4θ and a²/r²
    let c2 = "((x^2 - y^2)/(x^2 + y^2))";
    let s2 = "(2*x*y/(x^2 + y^2))";
    let c4 = format!("(2*{c2}^2 - 1)");
    let s4 = format!("(2*{s2}*{c2})");
    let q = "(1/(x^2 + y^2))";
    let xx = format!("1 - {q}*(1.5*{c2} + {c4}) + 1.5*{q}^2*{c4}");
    let yy = format!("0 - {q}*(0.5*{c2} - {c4}) - 1.5*{q}^2*{c4}");
    let xy = format!("0 - {q}*(0.5*{s2} + {s4}) + 1.5*{q}^2*{s4}");
    let text = format!(
        "kinematics = \"plane-stress\"\ncoupling = \"local\"\n[mesh.file]\npath = \"kirsch.msh\"\n[materials.m.lps]\nyoungs-modulus = 1000\npoisson-ratio = {NU}\n\
        [conditions.symmetry-x.displacement]\non = \"left\"\nx = 0\n[conditions.symmetry-y.displacement]\non = \"bottom\"\ny = 0\n\
        [conditions.right.traction]\non = \"right\"\nx = \"{xx}\"\ny = \"{xy}\"\n[conditions.top.traction]\non = \"top\"\nx = \"{xy}\"\ny = \"{yy}\"\n"
    );
    let found = Solution::<2>::of(&text, overrides, &[("kirsch.msh", mesh)])?;
    let g = found.gradient(&Vector::<2>::new(0.0, 1.0))?;
    let stress = 1000.0 / (1.0 - NU * NU) * (g[(0, 0)] + NU * g[(1, 1)]);
    Ok(stress / 3.0)
}

/// The deflection of the end of a cantilever, 10 long, 1 by 1 wide, over that of Timoshenko's beam: ten hexahedra along it, two through its depth.
///
/// The supported end stays plane and may contract: the beam's theory has no clamp, which would take another 0.8 %.
/// `P L³ / (3 E I) + P L / (κ G A)`, κ = 10 (1 + ν) / (12 + 11 ν) \[Cowper1966\].
fn cantilever(cell: &str) -> Result<f64, String> {
    const NU: f64 = 0.3;
    let text = format!(
        "kinematics = \"solid\"\ncoupling = \"local\"\n[mesh.box]\nmin = [0, 0, 0]\nmax = [10, 1, 1]\nx = {{ cells = 10 }}\ny = {{ cells = 2 }}\nz = {{ cells = 1 }}\ncell = \"{cell}\"\n\
        [materials.m.lps]\nyoungs-modulus = 1000\npoisson-ratio = {NU}\n[conditions.plane.displacement]\non = \"left\"\nx = 0\n\
        [conditions.axis.displacement]\ninside = {{ box = {{ min = [-1e-3, 0.499, -1], max = [1e-3, 0.501, 2] }} }}\ny = 0\n\
        [conditions.middle.displacement]\ninside = {{ box = {{ min = [-1e-3, 0.499, 0.499], max = [1e-3, 0.501, 0.501] }} }}\ny = 0\nz = 0\n\
        [conditions.start.traction]\non = \"left\"\ny = \"-6e-3 * y * (1 - y)\"\n[conditions.end.traction]\non = \"right\"\ny = \"6e-3 * y * (1 - y)\"\n"
    );
    let found = Solution::<3>::of(&text, &[], &[])?;
    let tip = found.nearest(&Vector::<3>::new(10.0, 0.5, 0.5))[1];
    let (p, shear) = (1e-3, 1000.0 / (2.0 * (1.0 + NU)));
    let kappa = 10.0 * (1.0 + NU) / (12.0 + 11.0 * NU);
    let exact = p * 1000.0 / (3.0 * 1000.0 / 12.0) + p * 10.0 / (kappa * shear);
    Ok(tip / exact)
}

/// Cook's membrane in plane stress, E = 1, ν = 1/3, unit shear force on the right: the deflection of the middle of that side, of `n` by `n` cells.
fn cook(cell: &str, n: usize) -> Result<f64, String> {
    use bondline::mesh::generate::{Axis, Grid};
    let axis = || Axis::Uniform {
        min: 0.0,
        max: 1.0,
        cells: n,
    };
    let mut grid = Grid::<2>::new([axis(), axis()]);
    if cell.starts_with("tri") {
        grid.simplices();
    }
    let mut mesh = grid.mesh().map_err(|e| e.to_string())?;
    for x in &mut mesh.nodes {
        let (s, t) = (x[0], x[1]);
        *x = Vector::<2>::new(48.0 * s, 44.0 * s + t * (44.0 - 28.0 * s));
    }
    if cell == "tri6" || cell == "quad8" {
        mesh.raise_order();
    }
    let text = "kinematics = \"plane-stress\"\ncoupling = \"local\"\n[mesh.file]\npath = \"cook.msh\"\n[materials.m.lps]\nyoungs-modulus = 1\npoisson-ratio = \"1/3\"\n\
        [conditions.held.displacement]\non = \"left\"\nx = 0\ny = 0\n[conditions.shear.traction]\non = \"right\"\ny = 0.0625\n";
    let mesh = crate::meshes::gmsh::with_sets(&mesh);
    let found = Solution::<2>::of(text, &[], &[("cook.msh", &mesh)])?;
    Ok(found.nearest(&Vector::<2>::new(48.0, 52.0))[1])
}

/// The table of problems.
pub fn table(effort: Effort, progress: &dyn Progress) -> Table {
    progress.stage("problems", None);
    let mut table = Table::new(
        "Elements alone, known solutions: stress concentration of Kirsch's hole, deflection of a cantilever, of Cook's membrane",
        Columns::ByQuantity,
    );
    let mut within =
        |case: &str, quantity: &str, found: Result<f64, String>, exact: f64, limit: f64| {
            table.push(match found {
                Ok(value) => TableRow::within(case, quantity, value, exact, limit),
                Err(why) => TableRow::refused(case, quantity, why),
            });
        };
    let name = "stress at the hole, over 3";
    within(
        "Kirsch, 320 curved tri6",
        name,
        kirsch(TRIANGLES, &[]),
        1.0,
        0.01,
    );
    within(
        "Kirsch, 120 curved quad8",
        name,
        kirsch(QUADRILATERALS, &[]),
        1.0,
        0.01,
    );
    let linear: &[&str] = &["mesh.file.order=linear"];
    within(
        "Kirsch, the same read linear: tri3",
        name,
        kirsch(TRIANGLES, linear),
        1.0,
        0.25,
    );
    within(
        "Kirsch, the same read linear: quad4",
        name,
        kirsch(QUADRILATERALS, linear),
        1.0,
        0.25,
    );
    let name = "deflection of the end, over Timoshenko's";
    within(
        "cantilever, 10 by 2 by 1 hex20",
        name,
        cantilever("hex20"),
        1.0,
        0.01,
    );
    within(
        "cantilever, 10 by 2 by 1 by 6 tet10",
        name,
        cantilever("tet10"),
        1.0,
        0.01,
    );
    // the limit of refined meshes as quoted since [SimoRifai1990]
    let name = "deflection of the loaded side";
    let n = if effort == Effort::Full { 32 } else { 8 };
    for cell in ["tri6", "quad8"] {
        let case = format!("Cook's membrane, {n} by {n} {cell}");
        within(&case, name, cook(cell, n), 23.96, 0.005);
    }
    table
}
