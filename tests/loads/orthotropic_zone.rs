//! Orthotropic elements beside a zone of points of an isotropic material.

use nalgebra::{Matrix3, Vector3};

use super::orthotropic::{lamina, strain, turned};
use super::{Done, read, refused, run};

/// A plate whose left half is isotropic and holds points, its right half orthotropic; the field is put in.
const HALVES: &str = r#"
kinematics = "plane-stress"
coupling = "COUPLING"
mesh.rectangle = { min = [0, 0], max = [24, 12], x = { cells = 24 }, y = { cells = 12 }, cell = "CELL" }
materials.soft.LAW
materials.ply.orthotropic = { LAMINA, angle = 30, density = 1 EXPANDS, cells.box = { min = [12, -1], max = [25, 13] } }
peridynamics = { horizon = 2.01, points.lattice = { spacing = 1, origin = [0.5, 0.5] } }
zones.nonlocal.box = { min = [4, 4], max = [END, 8] }
conditions.left.displacement = { on = "left", FIELD }
conditions.right.displacement = { on = "right", FIELD }
conditions.bottom.displacement = { on = "bottom", FIELD }
conditions.top.displacement = { on = "top", FIELD }
output.lines.along = { from = [0.3, 5.2], to = [23.6, 6.9], samples = 33 }
output.stresses = ["von-mises"]
output.vtu = false
"#;

const PAIRS: &str = "bond-based = { youngs-modulus = 20, density = 1 }";
const LPS: &str = "lps = { youngs-modulus = 20, poisson-ratio = 0.3, density = 1 }";

/// Gradients of the two halves under one traction on their border, with one strain along it; and the stresses of both.
fn halves(poisson: f64) -> [(Matrix3<f64>, Matrix3<f64>); 2] {
    let (xx, xy, along) = (0.1, 0.03, 2e-3);
    let stress = |yy: f64| Matrix3::new(xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, 0.0);
    let gradient =
        |e: Matrix3<f64>| Matrix3::new(e.m11, 0.0, 0.0, 2.0 * e.m12, e.m22, 0.0, 0.0, 0.0, 0.0);
    let isotropic = |s: Matrix3<f64>| {
        (s * (1.0 + poisson) - Matrix3::identity() * (poisson * s.trace())) / 20.0
    };
    let of = |strain: &dyn Fn(Matrix3<f64>) -> Matrix3<f64>| {
        let (none, one) = (strain(stress(0.0)).m22, strain(stress(1.0)).m22);
        let stress = stress((along - none) / (one - none));
        (gradient(strain(stress)), stress)
    };
    [of(&isotropic), of(&|s| strain(&s, &turned(30.0)))]
}

/// The displacement as a scene types it, times `factor`.
fn field(poisson: f64, factor: &str) -> String {
    let [(a, _), (b, _)] = halves(poisson);
    let row = |i: usize| {
        let side = |g: &Matrix3<f64>| format!("({:e})*(x - 12) + ({:e})*y", g[(i, 0)], g[(i, 1)]);
        format!(
            "{} = \"{factor}if(x < 12, {}, {})\"",
            ["x", "y"][i],
            side(&a),
            side(&b)
        )
    };
    format!("{}, {}", row(0), row(1))
}

/// The scene of a law, with the end of its zone.
fn scene(law: &str, coupling: &str, end: f64, factor: &str) -> String {
    HALVES
        .replace("COUPLING", coupling)
        .replace("CELL", "quad4")
        .replace("LAW", law)
        .replace("LAMINA", &lamina())
        .replace(" EXPANDS", "")
        .replace("END", &end.to_string())
        .replace("FIELD", &field(poisson(law), factor))
}

fn poisson(law: &str) -> f64 {
    if law == PAIRS { 1.0 / 3.0 } else { 0.3 }
}

/// The largest error of displacements over the largest one, and of stresses over 0.1, along the line.
fn errors(done: &Done, poisson: f64) -> [f64; 2] {
    let (header, rows) = done.table("scene_along.csv");
    let at = |name: &str| header.iter().position(|h| h == name).unwrap();
    let halves = halves(poisson);
    let (mut off, mut most, mut stress) = (0.0f64, 0.0f64, 0.0f64);
    let worse = |m: f64, v: f64| if v.is_nan() { v } else { m.max(v.abs()) };
    // in time, those of the last state
    for row in &rows[rows.len() - 33..] {
        let (x, y) = (row[at("x")], row[at("y")]);
        let (g, s) = &halves[usize::from(x > 12.0)];
        let u = g * Vector3::new(x - 12.0, y, 0.0);
        for (k, name) in ["ux", "uy"].into_iter().enumerate() {
            off = worse(off, row[at(name)] - u[k]);
            most = worse(most, u[k]);
        }
        for (name, expected) in [("sxx", s.m11), ("sxy", s.m12), ("syy", s.m22)] {
            stress = worse(stress, row[at(name)] - expected);
        }
    }
    [off / most, stress / 0.1]
}

#[test]
fn piecewise_affine_fields_pass_from_points_to_orthotropic_elements() {
    // the zone ends at the border, and a few cells before it
    for (law, coupling, end) in [
        (PAIRS, "truncated", 12.0),
        (LPS, "truncated", 12.0),
        (PAIRS, "splice", 8.0),
        (LPS, "splice", 7.0),
    ] {
        let done = run(&scene(law, coupling, end, ""), &[]);
        let [off, stress] = errors(&done, poisson(law));
        println!("{law} {coupling}: {off:.1e} {stress:.1e}");
        assert!(
            off < 1e-10 && stress < 1e-8,
            "{law} {coupling}: {off} {stress}"
        );
    }
}

/// A block whose far half is orthotropic, and whose zone ends at the border.
const BLOCKS: &str = r#"
kinematics = "solid"
coupling = "truncated"
mesh.box = { min = [0, 0, 0], max = [10, 6, 6], x = { cells = 10 }, y = { cells = 6 }, z = { cells = 6 } }
materials.soft.bond-based.youngs-modulus = 20
materials.ply.orthotropic = { LAMINA, axis-1 = [1, 2, 2], axis-2 = [1, 0, 0], cells.box = { min = [5, -1, -1], max = [11, 7, 7] } }
peridynamics = { horizon = 2.01, points.lattice = { spacing = 1, origin = [0.5, 0.5, 0.5] } }
zones.nonlocal.box = { min = [2, 2, 2], max = [5, 4, 4] }
conditions.a.displacement = { on = "left", FIELD }
conditions.b.displacement = { on = "right", FIELD }
conditions.c.displacement = { on = "bottom", FIELD }
conditions.d.displacement = { on = "top", FIELD }
conditions.e.displacement = { on = "back", FIELD }
conditions.f.displacement = { on = "front", FIELD }
output.lines.along = { from = [0.3, 2.7, 2.6], to = [9.6, 3.4, 3.2], samples = 17 }
output.vtu = false
"#;

#[test]
fn the_same_holds_in_space() {
    let one = Vector3::new(1.0, 2.0, 2.0).normalize();
    let two = (Vector3::x() - one * one.x).normalize();
    let axes = Matrix3::from_columns(&[one, two, one.cross(&two)]);
    let isotropic = |s: Matrix3<f64>| (s * 1.25 - Matrix3::identity() * (0.25 * s.trace())) / 20.0;
    // one traction on the border, and one strain along it
    let traction = [0.1, 0.03, -0.02];
    let along = Vector3::new(2e-3, -1e-3, 5e-4);
    let of = |strain: &dyn Fn(Matrix3<f64>) -> Matrix3<f64>| {
        let stress = |s: Vector3<f64>| {
            let [xx, xy, xz] = traction;
            Matrix3::new(xx, xy, xz, xy, s.x, s.z, xz, s.z, s.y)
        };
        let found = |s: Vector3<f64>| {
            let e = strain(stress(s));
            Vector3::new(e.m22, e.m33, e.m23)
        };
        let none = found(Vector3::zeros());
        let columns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|s| found(s) - none);
        let s = Matrix3::from_columns(&columns).try_inverse().unwrap() * (along - none);
        let e = strain(stress(s));
        Matrix3::new(
            e.m11,
            0.0,
            0.0,
            2.0 * e.m12,
            e.m22,
            e.m23,
            2.0 * e.m13,
            e.m23,
            e.m33,
        )
    };
    let sides = [of(&isotropic), of(&|s| strain(&s, &axes))];
    let row = |i: usize| {
        let side = |g: &Matrix3<f64>| {
            let [x, y, z] = [0, 1, 2].map(|j| g[(i, j)]);
            format!("({x:e})*(x - 5) + ({y:e})*y + ({z:e})*z")
        };
        let name = ["x", "y", "z"][i];
        format!(
            "{name} = \"if(x < 5, {}, {})\"",
            side(&sides[0]),
            side(&sides[1])
        )
    };
    let field = [0, 1, 2].map(row).join(", ");
    let text = BLOCKS.replace("LAMINA", &lamina()).replace("FIELD", &field);
    let done = run(&text, &[]);
    let (header, rows) = done.table("scene_along.csv");
    let at = |name: &str| header.iter().position(|h| h == name).unwrap();
    for row in &rows {
        let g = &sides[usize::from(row[0] > 5.0)];
        let u = g * Vector3::new(row[0] - 5.0, row[1], row[2]);
        let off = Vector3::new(row[at("ux")], row[at("uy")], row[at("uz")]) - u;
        assert!(off.norm() < 1e-10 * 0.05, "{row:?}: {off}");
    }
}

#[test]
fn load_steps_and_motion_keep_to_the_same_field() {
    let steps = scene(PAIRS, "truncated", 12.0, "t*") + "solve.quasi-static.steps = 2\n";
    let done = run(&steps, &[]);
    let [off, stress] = errors(&done, 1.0 / 3.0);
    assert!(off < 1e-7 && stress < 1e-6, "load steps: {off} {stress}");
    for law in [PAIRS, LPS] {
        let motion = scene(law, "truncated", 12.0, "")
            + &format!(
                "initial.begun.displacement = {{ {} }}\n",
                field(poisson(law), "")
            )
            + "solve.explicit = { duration = 20, outputs = 1 }\n";
        let done = run(&motion, &[]);
        let [off, stress] = errors(&done, poisson(law));
        assert!(off < 1e-10 && stress < 1e-8, "{law}: {off} {stress}");
    }
}

#[test]
fn a_zone_beside_triangles_has_its_rim_within_its_material() {
    let text = scene(PAIRS, "truncated", 9.3, "")
        .replace("quad4", "tri3")
        .replace("[4, 4]", "[3.3, 3.4]");
    let done = run(&text, &[]);
    let rim = done
        .summary
        .choices
        .iter()
        .any(|c| c.choice.starts_with("a rim of"));
    assert!(rim, "{:?}", done.summary.choices);
    let [off, stress] = errors(&done, 1.0 / 3.0);
    assert!(off < 1e-10 && stress < 1e-8, "{off} {stress}");
    // a rim over the border would hold two materials
    let over = text.replace("9.3", "12");
    refused(&over, &["zones.rim=own"], &["two materials at [1"]);
}

#[test]
fn a_plate_around_an_isotropic_patch_deforms_as_elements_alone_do() {
    let plate = r#"
kinematics = "plane-stress"
coupling = "truncated"
mesh.rectangle = { min = [0, 0], max = [48, 32], x = { spacing = 1 }, y = { spacing = 1 } }
materials.ply.orthotropic = { LAMINA, angle = 20 }
materials.patch = { bond-based.youngs-modulus = 30, bond-based.cells.box = { min = [16, 8], max = [32, 24] } }
peridynamics = { horizon = 3.01, points.lattice = { spacing = 1, origin = [0.5, 0.5] } }
zones.nonlocal.box = { min = [16, 8], max = [32, 24] }
conditions.left.displacement = { on = "left", x = 0 }
conditions.corner.displacement = { inside.ball = { center = [0, 0], radius = 0.1 }, y = 0 }
conditions.right.traction = { on = "right", x = "0.1 + 0.002*y" }
output.lines.through = { from = [19.7, 13.3], to = [47.9, 19.2], samples = 12 }
output.vtu = false
"#;
    let plate = plate.replace("LAMINA", &lamina());
    let coupled = run(&plate, &[]);
    let fine = [
        "coupling=local",
        "zones={}",
        "mesh.rectangle.x.spacing=0.5",
        "mesh.rectangle.y.spacing=0.5",
    ];
    let alone = run(&plate, &fine);
    let coarse = run(&plate, &fine[..2]);
    let of = |done: &Done, name: &str| done.column("scene_through.csv", name);
    let largest = |list: Vec<f64>| list.into_iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let most = largest([of(&alone, "ux"), of(&alone, "uy")].concat());
    for name in ["ux", "uy"] {
        let exact = of(&alone, name);
        let off = |done: &Done| {
            let both = of(done, name).into_iter().zip(&exact);
            largest(both.map(|(u, v)| (u - v) / most).collect())
        };
        println!(
            "{name}: {:.2e}, elements alone {:.2e}",
            off(&coupled),
            off(&coarse)
        );
        assert!(off(&coupled) < 0.005, "{name}: {}", off(&coupled));
    }
}

#[test]
fn what_touches_the_zone_is_refused_with_its_place() {
    let text = scene(PAIRS, "truncated", 13.0, "");
    refused(
        &text,
        &[],
        &["nonlocal zone", "`ply` at [12.5", "no peridynamic law"],
    );
    // bonds of a splice reach over the border
    let near = read(&scene(PAIRS, "splice", 12.0, ""), &[]).unwrap();
    let error = near
        .run(&bondline::progress::Silent)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("bonds reach into another material at (1"),
        "{error}"
    );
    let interface = text.replace("[13, 8]", "[12, 8]")
        + "interfaces.glue = { between = [\"ply\", \"soft\"] }\n";
    refused(&interface, &[], &["interfaces.glue", "`ply`", "no points"]);
}

#[test]
fn a_zone_that_is_placed_keeps_to_materials_with_points() {
    let text = |y: f64| {
        let text = scene(PAIRS, "truncated", 12.0, "").replace(
            "zones.nonlocal.box = { min = [4, 4], max = [12, 8] }",
            "zones = \"auto\"",
        );
        let (a, b) = if y < 6.0 { (4.5, 7.5) } else { (14.5, 18.5) };
        text + &format!("cracks.flaw.segment = {{ from = [{a}, 6], to = [{b}, 6] }}\n")
    };
    let done = run(&text(0.0), &[]);
    assert!(done.summary.sizes.points > 20);
    refused(&text(12.0), &[], &["`zones.auto`", "crack", "`ply`"]);
}

#[test]
fn a_temperature_stays_clear_of_the_seam() {
    // all expand alike, so that nothing is stressed
    let text = |end: f64| {
        let text = HALVES.replace(" EXPANDS", ", alpha1 = 1e-5, alpha2 = 1e-5, alpha3 = 1e-5");
        let text = text
            .replace("COUPLING", "truncated")
            .replace("CELL", "quad4")
            .replace("LAMINA", &lamina());
        let text = text.replace(
            "LAW",
            "bond-based = { youngs-modulus = 20, density = 1, thermal-expansion = 1e-5 }",
        );
        text.replace("END", &end.to_string())
            .replace("FIELD", "x = \"1e-3*x\", y = \"1e-3*y\"")
            + "temperature.value = 100\n"
    };
    let done = run(&text(9.0), &[]);
    for name in ["sxx", "sxy", "syy"] {
        let most = done
            .column("scene_along.csv", name)
            .into_iter()
            .fold(0.0f64, |m, s| m.max(s.abs()));
        assert!(most < 1e-12, "{name}: {most}");
    }
    let touching = read(&text(12.0), &[]).unwrap();
    let error = touching
        .run(&bondline::progress::Silent)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("orthotropic elements that share nodes with the zone"),
        "{error}"
    );
}
