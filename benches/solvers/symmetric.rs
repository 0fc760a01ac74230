//! The symmetric path against the unsymmetric one on the same scene: time and peak memory of whole runs, each in a process of its own, alternating.

use std::path::Path;
use std::process::Command;

use bondline::observe::summary::RunSummary;
use bondline::progress::Silent;
use bondline::run::{AnyScene, solve_with};
use bondline::scene::Source;

/// The first argument of a child.
pub const CHILD: &str = "symmetric-child";

/// Rounds of all runs.
const ROUNDS: usize = 2;

const COUPLINGS: [&str; 2] = ["truncated", "splice"];
const METHODS: [&str; 2] = ["direct", "krylov"];

/// A square or a block of `n` cells along each edge, the middle half of each axis peridynamic, held on the left, pulled and sheared on the right.
fn scene(dimension: usize, n: usize, coupling: &str, method: &str) -> String {
    let list = |v: &str| vec![v; dimension].join(", ");
    let axes: String = ["x", "y", "z"][..dimension]
        .iter()
        .map(|a| format!("{a} = {{ cells = {n} }}\n"))
        .collect();
    let (kinematics, shape, ratio) = match dimension {
        2 => ("plane-strain", "rectangle", 3),
        _ => ("solid", "box", 2),
    };
    let held = ["x = 0\n", "y = 0\n", "z = 0\n"][..dimension].concat();
    format!(
        "kinematics = \"{kinematics}\"\n[mesh.{shape}]\nmin = [{}]\nmax = [{}]\n{axes}\
         [materials.body.lps]\nyoungs-modulus = 1.0\npoisson-ratio = 0.3\n\
         [peridynamics]\nhorizon = \"{ratio}/{n}\"\npoints.lattice = {{ spacing = \"1/{n}\" }}\n\
         [zones.nonlocal]\nbox = {{ min = [{}], max = [{}] }}\n[coupling.{coupling}]\n\
         [conditions.left.displacement]\non = \"left\"\n{held}\
         [conditions.right.traction]\non = \"right\"\nx = 1.0\ny = 0.5\n\
         [solver]\nmethod = \"{method}\"\ntolerance = 1e-8\n",
        list("0"),
        list("1"),
        list("0.25"),
        list("0.75"),
    )
}

/// Runs one scene and prints a line for the parent: `dimension cells coupling method`.
pub fn child(arguments: &[String]) {
    let [dimension, cells, coupling, method] = arguments else {
        panic!("four arguments are expected, not {arguments:?}");
    };
    let number = |text: &str| text.parse().expect("a number");
    let text = scene(number(dimension), number(cells), coupling, method);
    let source = Source::new("symmetric", text);
    let scene = AnyScene::from_source(&source, Path::new(""), "symmetric").expect("a right scene");
    let run: RunSummary = match scene {
        AnyScene::Bar(s) => solve_with(*s, &Silent, |_, _| Ok(Vec::new())),
        AnyScene::Plane(s) => solve_with(*s, &Silent, |_, _| Ok(Vec::new())),
        AnyScene::Solid(s) => solve_with(*s, &Silent, |_, _| Ok(Vec::new())),
    }
    .expect("solved");
    let solver: f64 = ["ordering", "factorisation", "solve"]
        .iter()
        .map(|s| run.timings.seconds(s))
        .sum();
    let chosen: Vec<&str> = run.choices.iter().map(|c| c.choice.as_str()).collect();
    println!(
        "{} | {:.3} | {:.3} | {:.3} | {} | {:.1e} | {}",
        run.sizes.dofs,
        run.total_seconds,
        solver,
        super::peak(),
        run.iterations,
        run.residual,
        chosen.join("; "),
    );
}

/// Runs all scenes, each in a child, and prints the least time of each over the rounds.
pub fn compare() {
    let exe = std::env::current_exe().expect("this program");
    println!("scene | unknowns | total s | solver s | peak GB | iterations | residual | choices");
    for (dimension, cells) in [("2", "240"), ("3", "29")] {
        for round in 1..=ROUNDS {
            for method in METHODS {
                for coupling in COUPLINGS {
                    let output = Command::new(&exe)
                        .args([CHILD, dimension, cells, coupling, method])
                        .output()
                        .expect("a child");
                    let line = String::from_utf8_lossy(&output.stdout);
                    let error = String::from_utf8_lossy(&output.stderr);
                    println!(
                        "{dimension}D {cells}, {coupling}, {method}, round {round} | {}",
                        if output.status.success() {
                            line.trim()
                        } else {
                            error.trim()
                        }
                    );
                }
            }
        }
    }
}
