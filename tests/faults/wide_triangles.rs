//! Partial stress in triangles five spacings wide, whose seam follows points that lie to one side of its nodes.

use crate::Case;
use crate::short_waves::samples;

/// A cubic field on triangles, by a coupling: largest error on two lines over the largest displacement there.
fn error(coupling: &str) -> f64 {
    let sides = [
        ("left", [-1.0, -1.0], [1e-6, 17.0]),
        ("right", [16.0 - 1e-6, -1.0], [17.0, 17.0]),
        ("bottom", [-1.0, -1.0], [17.0, 1e-6]),
        ("top", [-1.0, 16.0 - 1e-6], [17.0, 17.0]),
    ];
    let side = |(name, min, max): (&str, [f64; 2], [f64; 2])| {
        format!(
            "[conditions.{name}.displacement]\ninside.box = {{ min = {min:?}, max = {max:?} }}\n\
             x = \"1e-6*(x^3 + x^2*y - 0.5*x*y^2)\"\ny = \"1e-6*(x^2*y/3 + y^3)\"\n"
        )
    };
    let case = Case::new(&format!(
        r#"
kinematics = "plane-stress"
coupling.{coupling} = {{}}
mesh.file.path = "triangles.msh"
materials.m.bond-based.youngs-modulus = 1
[peridynamics]
horizon = 1.2
points.lattice = {{ spacing = 0.4, origin = [0.2, 0.2] }}
[zones]
nonlocal.box = {{ min = [6, 6], max = [10, 10] }}
transition.around = 2.4
{}[conditions.load.body-force]
x = "-6.875e-6*x - 2.25e-6*y"
y = "-1.5e-6*x - 6.25e-6*y"
[output]
vtu = false
lines.across = {{ from = [0.4, 1.3], to = [15.7, 14.2], samples = 200 }}
lines.beside = {{ from = [5.1, 3], to = [4.7, 13], samples = 200 }}
"#,
        sides.map(side).concat()
    ))
    .with_file("triangles.msh");
    case.run(&["--output", "."]).expect("it runs");
    let (mut worst, mut largest): (f64, f64) = (0.0, 0.0);
    for name in ["scene_across.csv", "scene_beside.csv"] {
        for (at, found) in samples(&case, name, 2) {
            let (x, y) = (at[0], at[1]);
            let exact = [
                1e-6 * (x.powi(3) + x * x * y - 0.5 * x * y * y),
                1e-6 * (x * x * y / 3.0 + y.powi(3)),
            ];
            for (u, exact) in found.iter().zip(exact) {
                worst = worst.max((u - exact).abs());
                largest = largest.max(exact.abs());
            }
        }
    }
    worst / largest
}

/// It was refused: a point at the corner of the zone stood for −117 times the volume of its cell.
#[test]
fn points_beside_wide_triangles_have_a_volume() {
    let [alone, coupled] = ["local", "partial-stress"].map(error);
    assert!(
        coupled < 1.5 * alone,
        "{coupled:.2e}, elements alone {alone:.2e}"
    );
}
