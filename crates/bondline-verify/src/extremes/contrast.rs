//! A plate that is up to 1e8 times stiffer or softer right beyond the seam.

use std::fmt::Write as _;
use std::path::Path;

use super::{
    body::{METHODS, solve_in},
    kept, refused,
};
use crate::Effort;
use bondline::observe::report::Row;

/// Relative residual that every solution must reach.
const RESIDUAL_LIMIT: f64 = 1e-10;

/// Truncated bonds end where the other material begins, and see nothing of it: the field of two springs in series is theirs.
pub const EXACT_LIMIT: f64 = 1e-6;

/// Cells along each edge of the unit square.
const CELLS: usize = 24;

/// The square as a Gmsh file: two materials that meet in the middle, sets of its sides.
fn mesh() -> String {
    let n = CELLS;
    let node = |i: usize, j: usize| j * (n + 1) + i + 1;
    let mut text = String::from("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n6\n");
    for (d, k, name) in [
        (2, 1, "near"),
        (2, 2, "far"),
        (1, 3, "left"),
        (1, 4, "right"),
        (1, 5, "bottom"),
        (1, 6, "top"),
    ] {
        // writing to a string cannot fail
        let _ = writeln!(text, "{d} {k} \"{name}\"");
    }
    let _ = writeln!(text, "$EndPhysicalNames\n$Nodes\n{}", (n + 1) * (n + 1));
    for j in 0..=n {
        for i in 0..=n {
            let (x, y) = (i as f64 / n as f64, j as f64 / n as f64);
            let _ = writeln!(text, "{} {x} {y} 0", node(i, j));
        }
    }
    let mut elements = Vec::new();
    for k in 0..n {
        elements.push(format!("1 2 3 3 {} {}", node(0, k), node(0, k + 1)));
        elements.push(format!("1 2 4 4 {} {}", node(n, k), node(n, k + 1)));
        elements.push(format!("1 2 5 5 {} {}", node(k, 0), node(k + 1, 0)));
        elements.push(format!("1 2 6 6 {} {}", node(k, n), node(k + 1, n)));
    }
    for j in 0..n {
        for i in 0..n {
            let material = if 2 * i < n { 1 } else { 2 };
            elements.push(format!(
                "3 2 {material} {material} {} {} {} {}",
                node(i, j),
                node(i + 1, j),
                node(i + 1, j + 1),
                node(i, j + 1)
            ));
        }
    }
    let _ = writeln!(text, "$EndNodes\n$Elements\n{}", elements.len());
    for (k, e) in elements.iter().enumerate() {
        let _ = writeln!(text, "{} {e}", k + 1);
    }
    text + "$EndElements\n"
}

fn scene(coupling: &str, modulus: f64) -> String {
    let transition = match coupling {
        "blending" | "partial-stress" | "balanced" => {
            "[zones.transition]\nbox = { min = [0.125, 0.125], max = [0.5, 0.875] }\n"
        }
        _ => "",
    };
    let nonlocal = if transition.is_empty() {
        "[0.25, 0.25], max = [0.5, 0.75]"
    } else {
        "[0.25, 0.25], max = [0.375, 0.75]"
    };
    format!(
        "kinematics = \"plane-strain\"\ncoupling = \"{coupling}\"\n[mesh.file]\npath = \"contrast.msh\"\n\
         [materials.near.bond-based]\nyoungs-modulus = 1\ncells = \"near\"\n[materials.far.bond-based]\nyoungs-modulus = {modulus:e}\ncells = \"far\"\n\
         [peridynamics]\nhorizon = \"2/24\"\npoints.lattice.spacing = \"1/24\"\n[zones.nonlocal]\nbox = {{ min = {nonlocal} }}\n{transition}\
         [conditions.left.displacement]\non = \"left\"\nx = 0\n[conditions.right.displacement]\non = \"right\"\nx = 0.01\n\
         [conditions.bottom.displacement]\non = \"bottom\"\ny = 0\n[conditions.top.displacement]\non = \"top\"\ny = 0\n\
         [solver]\nmethod = \"direct\"\n"
    )
}

/// Displacement of two springs in series, as the samples of a body have it.
fn series(samples: &[f64], modulus: f64) -> f64 {
    let stress = 0.01 / (0.5 + 0.5 / modulus);
    let each = (samples.len() as f64 / 2.0).sqrt().round() as usize;
    let mut most = 0.0f64;
    for (k, u) in samples.chunks(2).enumerate() {
        let x = ((k % each) as f64 + 0.53) / each as f64;
        let exact = stress * (x.min(0.5) + (x - 0.5).max(0.0) / modulus);
        most = most.max((u[0] - exact).abs()).max(u[1].abs());
    }
    most / 0.01
}

pub(super) fn rows(_: Effort) -> Vec<Row> {
    let folder = std::env::temp_dir().join(format!("bondline-contrast-{}", std::process::id()));
    let written = std::fs::create_dir_all(&folder)
        .and_then(|()| std::fs::write(folder.join("contrast.msh"), mesh()));
    if let Err(e) = written {
        return vec![kept("mesh", "written", Err(e.to_string()), 0.0)];
    }
    let rows = measured(&folder);
    // what lies there is of no further use
    let _ = std::fs::remove_dir_all(&folder);
    rows
}

fn measured(folder: &Path) -> Vec<Row> {
    let mut rows = Vec::new();
    for coupling in METHODS {
        for modulus in [1e-8, 1e-4, 1e4, 1e8] {
            let case = format!("{coupling}, {modulus:e} times as stiff");
            match solve_in(folder, &scene(coupling, modulus)) {
                // bonds into the other material were silently wrong by up to nineteen times the displacement
                Err(why) if coupling != "truncated" => {
                    rows.push(refused(&case, Err(why), &["another material"]));
                }
                Err(why) => rows.push(kept(&case, "relative residual", Err(why), 0.0)),
                Ok(solved) => {
                    let off = series(&solved.samples, modulus);
                    rows.push(kept(
                        &case,
                        "relative residual",
                        Ok(solved.residual),
                        RESIDUAL_LIMIT,
                    ));
                    let quantity = "largest distance from two springs in series";
                    rows.push(Row::at_most(&case, quantity, off, EXACT_LIMIT));
                }
            }
        }
    }
    rows
}
