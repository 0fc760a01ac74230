//! Blending whose collar reaches a held face.

use crate::Case;
use crate::b::{applied, close, ledger, reaction};

const PLATE: &str = r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [1, 1]
x = { cells = 20 }
y = { cells = 20 }
[materials.m.bond-based]
youngs-modulus = 1e6
[peridynamics]
horizon = 0.15
points.lattice = { spacing = 0.05 }
[zones.nonlocal]
box = { min = [0, 0.3], max = [1, 0.7] }
[zones.transition]
around = 0.15
[coupling.blending]
[conditions.b.displacement]
on = "bottom"
x = 0
y = 0
[conditions.g.body-force]
y = -1000
"#;

#[test]
fn a_support_on_mixed_rows_is_refused() {
    let said = Case::new(PLATE)
        .run(&[])
        .expect_err("26 % of the weight would be lost");
    assert!(
        said.contains("mixes both models") && said.contains("`b`"),
        "{said}"
    );
}

#[test]
fn the_weight_is_carried_where_elements_hold_it() {
    let box_ = "zones.nonlocal.box={min=[0.45,0.45],max=[0.55,0.55]}";
    let summary = Case::new(PLATE).run(&["--set", box_]).expect("it runs");
    close(&applied(&summary, "g"), &[0.0, -1000.0], 1e-9);
    assert!(ledger(&summary) < 1e-12);
    // the zone lies off the sides; a blending loses what is left of its balance
    close(&reaction(&summary, "b"), &[0.0, 1000.0], 20.0);
}
