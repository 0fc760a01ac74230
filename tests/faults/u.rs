//! Energy typed against energy spent.

use crate::Case;

#[test]
fn load_steps_tell_reactions_energies_and_cracks() {
    let case = Case::new(
        r#"
kinematics = "bar"
coupling = "nonlocal"
[mesh.line]
min = 0
max = 12
x = { spacing = 1 }
[materials.m.bond-based]
youngs-modulus = 1
critical-stretch = 1e-3
[peridynamics]
horizon = 3
points.lattice = { spacing = 1, origin = 0.5 }
[conditions.left.displacement]
inside.box = { min = -1, max = 6 }
x = 0
[conditions.right.displacement]
inside.box = { min = 6, max = 13 }
x = "4e-3 * t"
[solve.quasi-static]
steps = 800
outputs = 1
[output]
name = "bar"
vtu = false
"#,
    );
    let summary = case.run(&[]).expect("it runs");
    let text = case.read("out/bar_history.csv");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<f64>> = lines
        .map(|l| l.split(',').map(|w| w.parse().unwrap()).collect())
        .collect();
    let column = |name: &str| -> Vec<f64> {
        let place = header.iter().position(|h| *h == name);
        let place = place.unwrap_or_else(|| panic!("no {name} in {header:?}"));
        rows.iter().map(|r| r[place]).collect()
    };
    let (force, back) = (column("right_reaction_x"), column("left_reaction_x"));
    let (stored, dissipated) = (column("stored_energy"), column("dissipated_energy"));
    let work = column("external_work");
    // whole and linear but for the turn of bonds: ½ F Δ is stored
    let opening = 4e-3 / 800.0;
    assert!((0.5 * force[1] * opening / stored[1] - 1.0).abs() < 1e-4);
    // bonds of 1, 2 and 3 spacings break at openings of 1, 2 and 3 thousandths
    assert_eq!(column("broken_bonds").last(), Some(&12.0));
    assert_eq!(column("crack_area").last(), Some(&1.0));
    assert_eq!(*force.last().unwrap(), 0.0);
    let scale = force.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
    for k in 0..force.len() {
        assert!((force[k] + back[k]).abs() < 1e-12 * scale, "row {k}");
        let gap = work[k] - stored[k] - dissipated[k];
        assert!(gap.abs() < 1e-5 * work.last().unwrap(), "row {k}: {gap}");
    }
    let cracks = &summary["motion"]["cracks"];
    let of = |key: &str| cracks[key].as_f64().unwrap();
    // the table has sixteen digits
    let last = dissipated.last().unwrap();
    assert!((of("dissipated_energy") / last - 1.0).abs() < 1e-14);
    assert!((of("energy_per_area") / of("plane_energy") - 1.0).abs() < 0.02);
}
