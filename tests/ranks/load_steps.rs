//! Load steps by several processes: the bits of one with the same factors on each, the same equilibria with factors of which each has a part.

use crate::rows;
use crate::threads::{ALONE, How, assert_same, folder, run};

/// A notched plate pulled slowly; bonds break at the tip of the notch.
fn pulled(coupling: &str) -> String {
    format!(
        r#"
coupling = "{coupling}"
kinematics = "plane-stress"

[mesh.rectangle]
min = [0, 0]
max = [16, 16]
x = {{ cells = 16 }}
y = {{ cells = 16 }}

[materials.plate.bond-based]
youngs-modulus = 1
critical-stretch = 0.04

[peridynamics]
horizon = 3
points.lattice = {{ spacing = 1, origin = [0.5, 0.5] }}

[zones]
damage-at-edge = "warn"

[zones.nonlocal]
box = {{ min = [-1, 4], max = [17, 12] }}

[cracks.notch]
segment = {{ from = [-1, 8], to = [6.2, 8] }}

[conditions.below.displacement]
on = "bottom"
x = 0
y = 0

[conditions.above.displacement]
on = "top"
y = "0.45 * t"

[solve.quasi-static]
duration = 1
steps = 3
outputs = 3
tolerance = 1e-11
"#
    )
}

/// The history of a run, and the bonds that are broken at its end.
fn broken(table: &[u8]) -> f64 {
    let table = String::from_utf8(table.to_vec()).unwrap();
    let names: Vec<&str> = table.lines().next().expect("names").split(',').collect();
    let column = names.iter().position(|name| *name == "broken_bonds");
    let last: Vec<&str> = table.lines().last().expect("a row").split(',').collect();
    last[column.expect("a column")].parse().unwrap()
}

#[test]
fn load_steps_are_alike_on_any_number_of_processes() {
    let one = assert_same(&pulled("splice"), &[2, 3]);
    let broken = broken(&one["scene_history.csv"]);
    assert!((10.0..600.0).contains(&broken), "{broken}");
}

#[test]
fn factors_of_which_each_process_has_a_part_lead_to_the_same_equilibria() {
    for coupling in ["splice", "truncated"] {
        let text = pulled(coupling) + "\n[solver]\nmethod = \"direct\"\n";
        let one = folder();
        let alone = run(&text, one.path(), ALONE).expect("one process");
        let wanted = rows(one.path(), "scene_history.csv");
        for ranks in [2, 3] {
            let several = folder();
            let done = run(&text, several.path(), How { ranks, ..ALONE }).expect("several");
            assert_eq!((done.told, done.solvers), (alone.told.clone(), 1));
            let found = rows(several.path(), "scene_history.csv");
            assert_eq!(found.len(), wanted.len());
            for column in 0..wanted[0].len() {
                let of = |rows: &[Vec<f64>]| rows.iter().map(|r| r[column]).collect::<Vec<_>>();
                let (found, wanted) = (of(&found), of(&wanted));
                let largest = wanted.iter().fold(0.0f64, |m, x| m.max(x.abs()));
                for (a, b) in found.iter().zip(&wanted) {
                    assert!(
                        // work is summed over states between breaking bonds, which are found to 1e-5
                        (a - b).abs() <= 1e-6 * largest + 1e-13,
                        "{coupling}, {ranks} processes, column {column}: {a} for {b}"
                    );
                }
            }
        }
    }
}
