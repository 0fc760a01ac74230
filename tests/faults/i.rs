//! A peridynamic zone that symmetry planes cross: 128 and more for a stress of 100.

use crate::{Case, percent};

fn plate(law: &str) -> String {
    format!(
        r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [20, 20]
x = {{ cells = 40 }}
y = {{ cells = 40 }}
[materials.m.{law}]
youngs-modulus = 210e3
[peridynamics]
horizon = 1.5
points.lattice = {{ spacing = 0.5, origin = [0.25,0.25] }}
[zones.nonlocal]
box = {{ min = [0, 0], max = [10, 10] }}
[conditions.l.displacement]
on = "left"
x = 0
[conditions.b.displacement]
on = "bottom"
y = 0
[conditions.r.traction]
on = "right"
x = 100
[output]
vtu = false
"#
    )
}

#[test]
fn symmetry_planes_through_the_zone_are_warned_of_with_the_error() {
    let case = Case::new(&plate("lps"));
    let typed = [
        "--set",
        "materials.m.lps.poisson-ratio=0.3",
        "--set",
        "coupling={splice={}}",
    ];
    let summary = case.run(&typed).expect("it runs");
    let warnings = summary["warnings"].to_string();
    assert!(
        warnings.contains("symmetry plane") && warnings.contains("zones.skin"),
        "{warnings}"
    );
    // the largest stress of the solution is 128.2
    let error = percent(&warnings);
    assert!((28.2 / 3.0..28.2 * 3.0).contains(&error), "{warnings}");
    let check = case.command("check", &typed);
    assert!(String::from_utf8_lossy(&check.stdout).contains("symmetry plane"));
}

#[test]
fn a_skin_leaves_nothing_to_warn_of() {
    let case = Case::new(&plate("bond-based"));
    let skin = [
        "--set",
        "zones.skin=free-surfaces",
        "--set",
        "coupling={truncated={}}",
    ];
    let summary = case.run(&skin).expect("it runs");
    let warnings = summary["warnings"].to_string();
    assert!(!warnings.contains("uniform stress"), "{warnings}");
}
