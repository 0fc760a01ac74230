//! An L-shaped panel on triangles from Gmsh, coupled by force: its growing modes are found before the first step, and the message says what to do.

use crate::Case;

const PANEL: &str = r#"
kinematics = "plane-stress"
[mesh.file]
path = "l.msh"
[materials.concrete.lps]
youngs-modulus = 25850
poisson-ratio = 0.18
density = 2.4e-9
[peridynamics]
horizon = 15
points.lattice = { spacing = 5 }
[zones.nonlocal]
box = { min = [0, 200], max = [300, 400] }
[coupling.splice]
[conditions.base.displacement]
on = "base"
x = 0
y = 0
[conditions.load.displacement]
on = "load"
y = "0.01*min(1,t/1e-4)"
[output]
vtu = false
[solve.explicit]
duration = 2e-3
"#;

#[test]
fn growth_on_triangles_is_found_before_the_first_step() {
    // a tenth of these steps is too short for the mode to show in noise: the eigenvalues near the seam tell
    let summary = Case::new(PANEL).with_file("l.msh").run(&[]);
    let summary = summary.expect("hardly anything of the mode is in this motion");
    let said = summary["warnings"].to_string();
    for part in ["grows as exp(", "largest at (", "coupling.truncated", "W17"] {
        assert!(said.contains(part), "{said}");
    }
    assert_eq!(summary["motion"]["ended"], "finished");
}
