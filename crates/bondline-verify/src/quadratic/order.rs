//! Order of convergence of elements alone and beside points, with a manufactured solution.
//!
//! ```text
//!   u_i = a sin(k_i · x + φ_i)     b = −(λ + μ) ∇(∇ · u) − μ ∇² u
//! ```
//!
//! The body force stands in the scene, the displacement is prescribed on the whole boundary, and the error is integrated over the cells with the rule of the masses: the norm decides the order, and this one is that of the theory.
//! Beside points the horizon shrinks with the cells. The solution is that of the local theory, which points meet to second order in the horizon, and cells at the seam are linear: order 2.

use bondline::fem::{Rule, for_each_point};
use bondline::observe::report::{Columns, Table, TableRow};
use bondline::progress::Progress;
use bondline::tensor::Vector;

use super::Solution;
use crate::Effort;
use crate::meshes::gmsh;

const E: f64 = 1.0;
const NU: f64 = 0.3;
const AMPLITUDE: f64 = 1e-3;
const WAVES: [[f64; 3]; 3] = [[2.0, 1.0, 0.5], [1.0, -2.0, 1.0], [0.5, 1.0, 1.5]];
const PHASES: [f64; 3] = [0.3, 1.1, -0.4];

/// Displacement \[m\] at x.
fn exact<const D: usize>(x: &Vector<D>) -> Vector<D> {
    Vector::from_fn(|i, _| {
        let phase: f64 = (0..D).map(|j| WAVES[i][j] * x[j]).sum();
        AMPLITUDE * (phase + PHASES[i]).sin()
    })
}

/// `k_i · x + φ_i` as an expression.
fn phase(i: usize, dimension: usize) -> String {
    let terms: Vec<String> = (0..dimension)
        .map(|j| format!("({:e})*{}", WAVES[i][j], ["x", "y", "z"][j]))
        .collect();
    format!("{} + ({:e})", terms.join(" + "), PHASES[i])
}

fn scene(dimension: usize, mesh: &str, boundaries: &[&str]) -> String {
    let (lambda, mu) = (
        E * NU / ((1.0 + NU) * (1.0 - 2.0 * NU)),
        E / (2.0 * (1.0 + NU)),
    );
    let (mut field, mut force) = (String::new(), String::new());
    for i in 0..dimension {
        let axis = ["x", "y", "z"][i];
        let square: f64 = WAVES[i][..dimension].iter().map(|k| k * k).sum();
        field += &format!(
            "{axis} = \"{AMPLITUDE:e} * sin({})\"\n",
            phase(i, dimension)
        );
        // −∂_i ∂_j u_j = k_jj k_ji sin, −∇² u_i = k_i² sin
        let mut terms: Vec<String> = (0..dimension)
            .map(|j| {
                let factor = AMPLITUDE * (lambda + mu) * WAVES[j][j] * WAVES[j][i];
                format!("({factor:e}) * sin({})", phase(j, dimension))
            })
            .collect();
        let factor = AMPLITUDE * mu * square;
        terms.push(format!("({factor:e}) * sin({})", phase(i, dimension)));
        force += &format!("{axis} = \"{}\"\n", terms.join(" + "));
    }
    let held: String = (boundaries.iter().enumerate())
        .map(|(k, place)| format!("[conditions.held-{k}.displacement]\n{place}\n{field}"))
        .collect();
    let kinematics = if dimension == 2 {
        "plane-strain"
    } else {
        "solid"
    };
    format!(
        "kinematics = \"{kinematics}\"\ncoupling = \"local\"\n{mesh}\n[materials.m.lps]\nyoungs-modulus = {E}\npoisson-ratio = {NU}\n{held}[conditions.load.body-force]\ninside = {{ everywhere = true }}\n{force}[solver]\ntolerance = 1e-12\n"
    )
}

/// A generated square or cube of that many cells a side.
fn generated(dimension: usize, cell: &str, n: usize) -> String {
    let (name, corner) = if dimension == 2 {
        ("rectangle", "")
    } else {
        ("box", ", 0")
    };
    let axes: String = ["x", "y", "z"][..dimension]
        .iter()
        .map(|axis| format!("{axis} = {{ cells = {n} }}\n"))
        .collect();
    let top = corner.replace('0', "1");
    let mesh = format!(
        "[mesh.{name}]\nmin = [0, 0{corner}]\nmax = [1, 1{top}]\ncell = \"{cell}\"\n{axes}"
    );
    let inner = "inside = { without = { from = { everywhere = true }, removed = { box = { min = LOW, max = HIGH } } } }";
    let list = |v: f64| format!("{:?}", vec![v; dimension]);
    let boundary = inner
        .replace("LOW", &list(1e-6))
        .replace("HIGH", &list(1.0 - 1e-6));
    scene(dimension, &mesh, &[&boundary])
}

/// A generated square whose middle half is peridynamic, two spacings a cell and m = 3.
fn coupled(cell: &str, coupling: &str, n: usize) -> String {
    let local = generated(2, cell, n);
    let spacing = 0.5 / n as f64;
    let zone = format!(
        "[peridynamics]\nhorizon = {}\npoints.lattice.spacing = {spacing}\n[zones.nonlocal.box]\nmin = [0.25, 0.25]\nmax = [0.75, 0.75]\n",
        3.0 * spacing
    );
    local.replace(
        "coupling = \"local\"",
        &format!("coupling = \"{coupling}\""),
    ) + &zone
}

/// Relative L2 error of a scene.
fn error<const D: usize>(text: &str, files: &[(&str, &str)]) -> Result<f64, String> {
    let found = Solution::<D>::of(text, &[], files)?;
    let (mut wrong, mut whole) = (0.0, 0.0);
    for c in 0..found.mesh.cell_count() {
        for_each_point(&found.mesh, c, Rule::Mass, |p| {
            let mut u = Vector::<D>::zeros();
            for (&n, shape) in found.mesh.cell(c).iter().zip(&p.shape) {
                u += found.displacement[n as usize] * *shape;
            }
            let exact = exact(&p.position);
            wrong += p.weight * (u - exact).norm_squared();
            whole += p.weight * exact.norm_squared();
        });
    }
    Ok((wrong / whole).sqrt())
}

/// Relative error of a coupled scene in L2, lumped: over nodes and points, with their volumes.
fn error_of_sites(text: &str) -> Result<f64, String> {
    let found = Solution::<2>::of(text, &[], &[])?;
    let (mut wrong, mut whole) = (0.0, 0.0);
    for (x, volume, u) in &found.sites {
        wrong += volume * (u - exact(x)).norm_squared();
        whole += volume * exact(x).norm_squared();
    }
    Ok((wrong / whole).sqrt())
}

/// A sector of a ring whose sides of second order lie on circles: `n` cells a side.
fn ring(n: usize) -> Result<String, String> {
    use bondline::mesh::generate::{Axis, Grid};
    let axis = || Axis::Uniform {
        min: 0.0,
        max: 1.0,
        cells: n,
    };
    let mut mesh = Grid::<2>::new([axis(), axis()])
        .mesh()
        .map_err(|e| e.to_string())?;
    mesh.raise_order();
    for x in &mut mesh.nodes {
        let (r, a) = (1.0 + x[0], x[1]);
        *x = Vector::<2>::new(r * a.cos(), r * a.sin());
    }
    Ok(gmsh::with_sets(&mesh))
}

/// Errors of refined meshes: the last one with the order between the last two.
fn rows(table: &mut Table, name: &str, counts: &[usize], errors: &[Result<f64, String>]) {
    let is_linear = ["tri3", "quad4", "tet4", "hex8"].contains(&name);
    let (limit_of_order, ceiling) = match is_linear {
        true => (1.8, 5e-2),
        false => (2.7, 5e-3),
    };
    let mut last: Option<f64> = None;
    for (n, found) in counts.iter().zip(errors) {
        let case = format!("{name}, {n} cells a side");
        match found {
            Ok(error) => {
                if *n == counts[counts.len() - 1] {
                    table.push(TableRow::at_most(
                        &case,
                        "relative L2 error of u",
                        *error,
                        ceiling,
                    ));
                    if let Some(before) = last {
                        let order = (before / error).log2();
                        table.push(TableRow::at_least(&case, "order", order, limit_of_order));
                    }
                } else {
                    table.push(TableRow::info(&case, "relative L2 error of u", *error));
                }
                last = Some(*error);
            }
            Err(why) => table.push(TableRow::refused(&case, "relative L2 error of u", why)),
        }
    }
}

/// The table of orders beside points. A splice beside triangles is out of balance by more than beside a grid, and ends at order 1: its bound is below that.
pub fn beside_points(effort: Effort, progress: &dyn Progress) -> Table {
    let mut table = Table::new(
        "Elements beside LPS points in the middle of a square, two spacings a cell and m = 3, manufactured solution of the local theory: lumped error of the displacement in L2 and its order",
        Columns::ByQuantity,
    );
    let counts: &[usize] = match effort {
        Effort::Quick => &[8, 16],
        Effort::Full => &[8, 16, 32, 64],
    };
    progress.stage("orders beside points", None);
    for cell in ["tri3", "quad4", "tri6", "quad8"] {
        for coupling in ["splice", "truncated"] {
            let mut last: Option<f64> = None;
            for n in counts {
                let case = format!("{cell}, {coupling}, {n} cells a side");
                match error_of_sites(&coupled(cell, coupling, *n)) {
                    Ok(error) => {
                        table.push(TableRow::info(&case, "relative L2 error of u", error));
                        if let Some(before) = last {
                            let order = (before / error).log2();
                            let is_slow = coupling == "splice" && cell.starts_with("tri");
                            let limit = if is_slow { 0.8 } else { 1.8 };
                            table.push(TableRow::at_least(&case, "order", order, limit));
                        }
                        last = Some(error);
                    }
                    Err(why) => table.push(TableRow::refused(&case, "relative L2 error of u", why)),
                }
            }
        }
    }
    table
}

/// The table of orders.
pub fn table(effort: Effort, progress: &dyn Progress) -> Table {
    let mut table = Table::new(
        "Elements alone, manufactured solution: error of the displacement in L2 and its order (affine cells: 3 of second order, 2 of first)",
        Columns::ByQuantity,
    );
    let (plane, solid): (&[usize], &[usize]) = match effort {
        Effort::Quick => (&[4, 8], &[2, 4]),
        Effort::Full => (&[4, 8, 16, 32], &[2, 4, 8]),
    };
    progress.stage("orders", None);
    for cell in ["tri3", "quad4", "tri6", "quad8"] {
        let of = |&n: &usize| error::<2>(&generated(2, cell, n), &[]);
        let errors: Vec<_> = plane.iter().map(of).collect();
        rows(&mut table, cell, plane, &errors);
    }
    let on_rings: Vec<_> = plane
        .iter()
        .map(|&n| {
            let mesh = ring(n)?;
            let sides = ["left", "right", "bottom", "top"].map(|s| format!("on = \"{s}\""));
            let sides: Vec<&str> = sides.iter().map(String::as_str).collect();
            let text = scene(2, "[mesh.file]\npath = \"ring.msh\"", &sides);
            error::<2>(&text, &[("ring.msh", &mesh)])
        })
        .collect();
    rows(&mut table, "curved quad8", plane, &on_rings);
    for cell in ["tet4", "hex8", "tet10", "hex20"] {
        let of = |&n: &usize| error::<3>(&generated(3, cell, n), &[]);
        let errors: Vec<_> = solid.iter().map(of).collect();
        rows(&mut table, cell, solid, &errors);
    }
    table
}
