//! A plate that is up to 1e8 times stiffer or softer right beyond the seam.

use std::path::Path;

use super::{
    body::{METHODS, solve_in},
    kept, refused,
};
use crate::Effort;
use crate::meshes::gmsh;
use bondline::observe::report::TableRow;

/// Relative residual that every solution must reach.
const RESIDUAL_LIMIT: f64 = 1e-10;

/// Truncated bonds end where the other material begins, and see nothing of it: the field of two springs in series is theirs.
pub const EXACT_LIMIT: f64 = 1e-6;

/// Cells along each edge of the unit square.
const CELLS: usize = 24;

/// The square as a Gmsh file: two materials that meet in the middle, sets of its sides.
fn mesh() -> String {
    let n = CELLS;
    let node = |i: usize, j: usize| j * (n + 1) + i;
    let names = ["near", "far", "left", "right", "bottom", "top"];
    let sets: Vec<_> = (names.iter().zip(1..))
        .map(|(name, k)| (if k < 3 { 2 } else { 1 }, k, *name))
        .collect();
    let nodes: Vec<[f64; 3]> = (0..(n + 1) * (n + 1))
        .map(|k| [k % (n + 1), k / (n + 1), 0].map(|i| i as f64 / n as f64))
        .collect();
    let mut elements = Vec::new();
    for k in 0..n {
        for (set, ends) in [
            (3, [node(0, k), node(0, k + 1)]),
            (4, [node(n, k), node(n, k + 1)]),
            (5, [node(k, 0), node(k + 1, 0)]),
            (6, [node(k, n), node(k + 1, n)]),
        ] {
            elements.push((gmsh::LINE, set, ends.to_vec()));
        }
    }
    for j in 0..n {
        for i in 0..n {
            let cell = [
                node(i, j),
                node(i + 1, j),
                node(i + 1, j + 1),
                node(i, j + 1),
            ];
            let material = if 2 * i < n { 1 } else { 2 };
            elements.push((gmsh::QUADRILATERAL, material, cell.to_vec()));
        }
    }
    gmsh::text(&sets, &nodes, &elements)
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

pub(super) fn rows(_: Effort) -> Vec<TableRow> {
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

fn measured(folder: &Path) -> Vec<TableRow> {
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
                    rows.push(TableRow::at_most(&case, quantity, off, EXACT_LIMIT));
                }
            }
        }
    }
    rows
}
