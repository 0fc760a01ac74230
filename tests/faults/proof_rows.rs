//! Report of the proof on rows that affine fields leave out of balance: the same at rest, where it has a matrix, and in motion, where it has none.

use crate::Case;

const PLATE: &str = r#"
kinematics = "plane-strain"
[mesh.rectangle]
min = [0, 0]
max = [30, 16]
x = { cells = 30 }
y = { cells = 16 }
[materials.m.lps]
youngs-modulus = 1
poisson-ratio = 0.3
density = 1
critical-stretch = 1
[peridynamics]
horizon = 2
points.lattice.spacing = 1
[conditions.held.displacement]
on = "left"
x = 0
y = 0
[conditions.pulled.traction]
on = "right"
x = 1e-3
[output]
vtu = false
"#;

const MOTION: &str = "\n[solve.explicit]\nduration = 1\noutputs = 1\n";

/// Returns the report of the proof on affine fields, from the number of rows on: residuals before it are round-off.
fn rows_out_of_balance(text: &str, arguments: &[&str]) -> String {
    let summary = Case::new(text).run(arguments).expect("it runs");
    let parts = summary["proof"].as_array().expect("a proof");
    let part = parts.iter().find(|part| part["name"] == "affine");
    let line = part.expect("a proof of affine fields")["line"].to_string();
    let (_, rows) = line.split_once("but for").expect("surfaces cut families");
    rows.to_owned()
}

#[test]
fn rows_are_sorted_alike_at_rest_and_in_motion() {
    let zone = "zones.nonlocal.box={min=[8,-1],max=[22,17]}";
    let crack = "cracks.notch.segment={from=[15,-1],to=[15,6]}";
    let points = ["--set", "coupling=nonlocal"];
    let spliced = ["--set", "coupling=splice", "--set", zone];
    for (body, of_seam) in [(&points[..], false), (&spliced[..], true)] {
        for cracks in [&[][..], &["--set", crack][..]] {
            let arguments = [body, cracks].concat();
            let at_rest = rows_out_of_balance(PLATE, &arguments);
            let moving = rows_out_of_balance(&(PLATE.to_owned() + MOTION), &arguments);
            assert_eq!(at_rest, moving);
            assert_eq!(at_rest.contains("seam"), of_seam, "{at_rest}");
            assert_eq!(at_rest.contains("cracks"), !cracks.is_empty(), "{at_rest}");
        }
    }
}
