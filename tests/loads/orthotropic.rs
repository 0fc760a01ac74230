//! Orthotropic elements alone, against closed forms that are written by compliances, where the program takes stiffnesses.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::{refused, run};

const YOUNG: [f64; 3] = [140.0, 10.0, 8.0];
const POISSON: [f64; 3] = [0.3, 0.25, 0.4];
const SHEAR: [f64; 3] = [5.0, 4.0, 3.0];
const ALPHA: [f64; 3] = [-1e-6, 2e-5, 3e-5];

/// The keys of the material.
pub fn lamina() -> String {
    format!(
        "e1 = {}, e2 = {}, e3 = {}, nu12 = {}, nu13 = {}, nu23 = {}, g12 = {}, g13 = {}, g23 = {}",
        YOUNG[0],
        YOUNG[1],
        YOUNG[2],
        POISSON[0],
        POISSON[1],
        POISSON[2],
        SHEAR[0],
        SHEAR[1],
        SHEAR[2]
    )
}

/// The strain of a stress in a solid whose axes are the columns of `axes`.
pub fn strain(stress: &Matrix3<f64>, axes: &Matrix3<f64>) -> Matrix3<f64> {
    let s = axes.transpose() * stress * axes;
    let [e1, e2, e3] = YOUNG;
    let [nu12, nu13, nu23] = POISSON;
    let own = Matrix3::new(
        s.m11 / e1 - nu12 * s.m22 / e1 - nu13 * s.m33 / e1,
        0.5 * s.m12 / SHEAR[0],
        0.5 * s.m13 / SHEAR[1],
        0.5 * s.m12 / SHEAR[0],
        s.m22 / e2 - nu12 * s.m11 / e1 - nu23 * s.m33 / e2,
        0.5 * s.m23 / SHEAR[2],
        0.5 * s.m13 / SHEAR[1],
        0.5 * s.m23 / SHEAR[2],
        s.m33 / e3 - nu13 * s.m11 / e1 - nu23 * s.m22 / e2,
    );
    axes * own * axes.transpose()
}

/// The axes of a plate.
pub fn turned(degrees: f64) -> Matrix3<f64> {
    let (s, c) = degrees.to_radians().sin_cos();
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}

/// The largest of some numbers, which have to be numbers.
fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    let worse = |m: f64, v: f64| if v.is_nan() { v } else { m.max(v.abs()) };
    values.into_iter().fold(0.0, worse)
}

/// A plate that is pulled along x, free of all but rigid motions, of cells of any kind.
const PULLED: &str = r#"
kinematics = "plane-stress"
coupling = "local"
mesh.rectangle = { min = [0, 0], max = [2, 1], x = { cells = 4 }, y = { cells = 2 }, cell = "CELL" }
materials.ply.orthotropic = { e1 = 140, e2 = 10, nu12 = 0.3, g12 = 5, angle = ANGLE }
conditions.right.traction = { on = "right", x = 0.1 }
conditions.left.traction = { on = "left", x = -0.1 }
conditions.a.displacement = { inside.ball = { center = [0, 0], radius = 0.01 }, x = 0, y = 0 }
conditions.b.displacement = { inside.ball = { center = [0, 1], radius = 0.01 }, x = 0 }
output.probes.c = { at = [1.3, 0.4] }
output.stresses = ["von-mises"]
output.vtu = false
"#;

#[test]
fn a_lamina_off_its_axes_has_the_modulus_and_the_shear_coupling_of_its_angle() {
    for (cell, degrees) in [
        ("quad4", 0.0),
        ("tri3", 30.0),
        ("quad8", 45.0),
        ("tri6", 90.0),
        ("quad4", -62.0),
    ] {
        let text = PULLED
            .replace("CELL", cell)
            .replace("ANGLE", &degrees.to_string());
        let done = run(&text, &[]);
        let of = |name: &str| done.column("scene_probes.csv", name)[0];
        // 1/E_x, −ν_xy/E_x and η/E_x of an angle, written out
        let (s, c) = f64::to_radians(degrees).sin_cos();
        let [e1, e2, nu, g] = [140.0, 10.0, 0.3, 5.0];
        let along = c.powi(4) / e1 + s.powi(4) / e2 + (1.0 / g - 2.0 * nu / e1) * s * s * c * c;
        let across =
            (1.0 / e1 + 1.0 / e2 - 1.0 / g) * s * s * c * c - nu / e1 * (s.powi(4) + c.powi(4));
        let shear = (2.0 / e1 + 2.0 * nu / e1 - 1.0 / g) * s * c.powi(3)
            - (2.0 / e2 + 2.0 * nu / e1 - 1.0 / g) * s.powi(3) * c;
        let expected = [along, across, 0.5 * shear].map(|part| 0.1 * part);
        for (name, expected) in ["exx", "eyy", "exy"].into_iter().zip(expected) {
            let off = of(name) - expected;
            assert!(
                off.abs() < 1e-9 * 0.1 * along,
                "{cell} {degrees} {name}: {off}"
            );
        }
        assert!(
            (of("sxx") - 0.1).abs() < 1e-10 && of("sxy").abs() < 1e-10 && of("syy").abs() < 1e-10
        );
    }
}

/// Displacements of a gradient as a scene types them.
fn typed(g: &Matrix3<f64>, dimension: usize) -> String {
    let names = ["x", "y", "z"];
    let row = |i: usize| {
        let sum: Vec<String> = (0..dimension)
            .map(|j| format!("({:e})*{}", g[(i, j)], names[j]))
            .collect();
        format!("{} = \"{}\"", names[i], sum.join(" + "))
    };
    (0..dimension).map(row).collect::<Vec<_>>().join(", ")
}

#[test]
fn affine_fields_are_exact_on_irregular_meshes() {
    let stress = Matrix3::new(0.1, 0.03, 0.0, 0.03, -0.07, 0.0, 0.0, 0.0, 0.0);
    let mut g = strain(&stress, &turned(25.0));
    // and a rotation, which stresses nothing
    g.m12 += 1e-3;
    g.m21 -= 1e-3;
    let text = format!(
        r#"
kinematics = "plane-stress"
coupling = "local"
mesh.file.path = "MESHES/quarter_ring.msh"
materials.ply.orthotropic = {{ {}, angle = 25 }}
conditions.outer.displacement = {{ on = "outer", {u} }}
conditions.bore.displacement = {{ on = "bore", {u} }}
conditions.low.displacement = {{ on = "bottom", {u} }}
conditions.left.displacement = {{ on = "left", {u} }}
output.lines.through = {{ from = [1.02, 0.3], to = [1.9, 0.5], samples = 9 }}
output.stresses = ["von-mises"]
output.vtu = false
"#,
        lamina(),
        u = typed(&g, 2)
    );
    let done = run(&text, &[]);
    for (name, expected) in [("sxx", 0.1), ("sxy", 0.03), ("syy", -0.07)] {
        let off = done
            .column("scene_through.csv", name)
            .into_iter()
            .map(|s| s - expected);
        assert!(largest(off) < 1e-11, "{name}");
    }
}

/// A cube under a uniform stress, by its displacements; the axes and the cells are put in.
const CUBE: &str = r#"
kinematics = "solid"
coupling = "local"
mesh.box = { min = [0, 0, 0], max = [1, 1, 1], x = { cells = 2 }, y = { cells = 2 }, z = { cells = 2 }, cell = "CELL" }
materials.ply.orthotropic = { LAMINA, axis-1 = [1, 2, 2], axis-2 = ["1/3", -1, 0.7] }
conditions.l.displacement = { on = "left", U }
conditions.r.displacement = { on = "right", U }
conditions.d.displacement = { on = "bottom", U }
conditions.t.displacement = { on = "top", U }
conditions.f.displacement = { on = "front", U }
conditions.b.displacement = { on = "back", U }
output.probes.c = { at = [0.4, 0.3, 0.55] }
output.stresses = ["von-mises"]
output.vtu = false
"#;

#[test]
fn a_turned_cube_has_the_stress_of_its_turned_compliance() {
    let one = Vector3::new(1.0, 2.0, 2.0).normalize();
    let two = Vector3::new(1.0 / 3.0, -1.0, 0.7);
    let two = (two - one * one.dot(&two)).normalize();
    let axes = Matrix3::from_columns(&[one, two, one.cross(&two)]);
    let stress = Matrix3::new(0.1, 0.03, -0.02, 0.03, -0.07, 0.05, -0.02, 0.05, 0.04);
    let g = strain(&stress, &axes);
    for cell in ["hex8", "tet4", "hex20", "tet10"] {
        let text = (CUBE
            .replace("LAMINA", &lamina())
            .replace("U }", &format!("{} }}", typed(&g, 3))))
        .replace("CELL", cell);
        let done = run(&text, &[]);
        let names = [
            ("sxx", 0.1),
            ("sxy", 0.03),
            ("sxz", -0.02),
            ("syy", -0.07),
            ("syz", 0.05),
            ("szz", 0.04),
        ];
        for (name, expected) in names {
            let off = done.column("scene_probes.csv", name)[0] - expected;
            assert!(off.abs() < 1e-11, "{cell} {name}: {off}");
        }
    }
}

/// A block that expands freely at the temperature 10 + 4 x − 3 y, with six nodes' worth of supports by its exact displacement on one side.
const HEATED: &str = r#"
kinematics = "KINEMATICS"
coupling = "local"
mesh.rectangle = { min = [0, 0], max = [1, 1], x = { cells = 4 }, y = { cells = 4 }, cell = "CELL" }
materials.ply.orthotropic = { LAMINA, alpha1 = -1e-6, alpha2 = 2e-5, alpha3 = 3e-5, angle = 35 }
temperature = { value = "10 + 4*x - 3*y", reference = 0 }
conditions.held.displacement = { on = "left", x = "UX", y = "UY" }
output.lines.through = { from = [0.2, 0.1], to = [0.9, 0.95], samples = 9 }
output.stresses = ["von-mises"]
output.vtu = false
"#;

#[test]
fn a_body_expands_along_its_axes_without_stress_within_the_plane() {
    let axes = turned(35.0);
    for kinematics in ["plane-stress", "plane-strain"] {
        let mut free = ALPHA;
        if kinematics == "plane-strain" {
            // the plane holds axis 3 back by a stress −E₃ α₃ ΔT, under which the others expand by Poisson's ratios
            free[0] += POISSON[1] / YOUNG[0] * YOUNG[2] * ALPHA[2];
            free[1] += POISSON[2] / YOUNG[1] * YOUNG[2] * ALPHA[2];
        }
        let a = axes * Matrix3::from_diagonal(&free.into()) * axes.transpose();
        let a = Matrix2::new(a.m11, a.m12, a.m21, a.m22);
        let slope = Vector2::new(4.0, -3.0);
        let exact = |x: Vector2<f64>| {
            let along = a * x;
            along * (10.0 + slope.dot(&x)) - slope * (0.5 * x.dot(&along))
        };
        let [xx, xy, yy] = [a.m11, a.m12, a.m22];
        let square = format!("({xx:e}*x*x + 2*({xy:e})*x*y + {yy:e}*y*y)");
        let ux = format!("({xx:e}*x + ({xy:e})*y)*(10 + 4*x - 3*y) - 2*{square}");
        let uy = format!("(({xy:e})*x + {yy:e}*y)*(10 + 4*x - 3*y) + 1.5*{square}");
        for cell in ["quad4", "quad8", "tri6"] {
            let text = HEATED
                .replace("KINEMATICS", kinematics)
                .replace("LAMINA", &lamina());
            let text = text
                .replace("UX", &ux)
                .replace("UY", &uy)
                .replace("CELL", cell);
            let done = run(&text, &[]);
            let (header, rows) = done.table("scene_through.csv");
            let at = |name: &str| header.iter().position(|h| h == name).unwrap();
            let stress = rows
                .iter()
                .flat_map(|r| ["sxx", "sxy", "syy"].map(|k| r[at(k)]));
            // over E₁ α₁ ΔT
            assert!(largest(stress) < 1e-10 * 140e-6, "{kinematics} {cell}");
            for row in &rows {
                let x = Vector2::new(row[0], row[1]);
                let off = Vector2::new(row[at("ux")], row[at("uy")]) - exact(x);
                // between nodes cells of first order have straight sides
                let limit = if cell == "quad4" { 0.02 } else { 1e-9 };
                assert!(off.norm() < limit * 3e-4, "{kinematics} {cell}: {off}");
                if kinematics == "plane-strain" && cell == "quad4" {
                    // stresses beside a temperature are means of cells
                    let centre = x.map(|x| 0.25 * ((4.0 * x).floor() + 0.5));
                    let rise = 10.0 + slope.dot(&centre);
                    let off = row[at("szz")] + YOUNG[2] * ALPHA[2] * rise;
                    assert!(off.abs() < 1e-12, "{cell}: {off}");
                }
            }
        }
    }
}

#[test]
fn a_body_that_is_held_has_the_stress_and_the_energy_of_its_expansion() {
    let held = r#"
kinematics = "KINEMATICS"
coupling = "local"
mesh.rectangle = { min = [0, 0], max = [1, 1], x = { cells = 2 }, y = { cells = 2 } }
materials.ply.MATERIAL
temperature.value = 100
conditions.all.displacement = { inside.box = { min = [-1, -1], max = [2, 2] }, x = 0, y = 0 }
output.probes.c = { at = [0.4, 0.3] }
output.stresses = ["von-mises"]
output.fields = ["strain-energy-density"]
output.vtu = false
"#;
    let turned_ply = format!(
        "orthotropic = {{ {}, alpha1 = {:e}, alpha2 = {:e}, alpha3 = {:e}, angle = 35 }}",
        lamina(),
        ALPHA[0],
        ALPHA[1],
        ALPHA[2]
    );
    let steel = "lps = { youngs-modulus = 200, poisson-ratio = 0.3, thermal-expansion = 1e-5 }";
    let [e1, e2, e3] = YOUNG;
    let [nu12, nu13, nu23] = POISSON;
    let compliance = |[e1, e2, e3]: [f64; 3], [nu12, nu13, nu23]: [f64; 3]| {
        let (a, b, c) = (-nu12 / e1, -nu13 / e1, -nu23 / e2);
        Matrix3::new(1.0 / e1, a, b, a, 1.0 / e2, c, b, c, 1.0 / e3)
    };
    for (material, s, alpha) in [
        (
            turned_ply.as_str(),
            compliance([e1, e2, e3], [nu12, nu13, nu23]),
            ALPHA,
        ),
        (steel, compliance([200.0; 3], [0.3; 3]), [1e-5; 3]),
    ] {
        let text = held.replace("MATERIAL", material);
        let free = Vector3::from(alpha) * 100.0;
        // in plane strain all three axes are held, in plane stress two
        let stress = s.try_inverse().unwrap() * -free;
        let plane = s.fixed_view::<2, 2>(0, 0).try_inverse().unwrap() * -free.xy();
        let plane = Vector3::new(plane.x, plane.y, 0.0);
        for (kinematics, stress) in [("plane-strain", stress), ("plane-stress", plane)] {
            let done = run(&text.replace("KINEMATICS", kinematics), &[]);
            let of = |name: &str| done.column("scene_probes.csv", name)[0];
            let energy = -0.5 * stress.dot(&free);
            let off = of("strain_energy_density") / energy - 1.0;
            assert!(off.abs() < 1e-10, "{kinematics} {material}: {off}");
            let axes = turned(if material == steel { 0.0 } else { 35.0 });
            let expected = axes * Matrix3::from_diagonal(&stress) * axes.transpose();
            for (name, expected) in [
                ("sxx", expected.m11),
                ("sxy", expected.m12),
                ("syy", expected.m22),
            ] {
                assert!(
                    (of(name) - expected).abs() < 1e-12,
                    "{kinematics} {material} {name}"
                );
            }
            if kinematics == "plane-strain" {
                assert!((of("szz") - stress.z).abs() < 1e-12, "{material}");
            }
        }
    }
}

#[test]
fn plane_strain_has_the_stress_out_of_its_plane() {
    let axes = turned(25.0);
    // the stress across that leaves no strain there
    let mut stress = Matrix3::new(0.1, 0.03, 0.0, 0.03, -0.07, 0.0, 0.0, 0.0, 0.0);
    let own = axes.transpose() * stress * axes;
    stress.m33 = YOUNG[2] * (POISSON[1] / YOUNG[0] * own.m11 + POISSON[2] / YOUNG[1] * own.m22);
    let g = strain(&stress, &axes);
    assert!(g.m33.abs() < 1e-17);
    let text = format!(
        r#"
kinematics = "plane-strain"
coupling = "local"
mesh.rectangle = {{ min = [0, 0], max = [1, 1], x = {{ cells = 3 }}, y = {{ cells = 3 }} }}
materials.ply.orthotropic = {{ {}, angle = 25 }}
conditions.l.displacement = {{ on = "left", {u} }}
conditions.r.displacement = {{ on = "right", {u} }}
output.probes.c = {{ at = [0.4, 0.3] }}
output.stresses = ["von-mises"]
output.vtu = false
"#,
        lamina(),
        u = typed(&g, 2)
    );
    let text = text.replace("conditions.r", "conditions.t.displacement = { on = \"top\", U }\nconditions.b.displacement = { on = \"bottom\", U }\nconditions.r").replace("U }", &format!("{} }}", typed(&g, 2)));
    let done = run(&text, &[]);
    for (name, expected) in [
        ("sxx", 0.1),
        ("sxy", 0.03),
        ("syy", -0.07),
        ("szz", stress.m33),
    ] {
        let off = done.column("scene_probes.csv", name)[0] - expected;
        assert!(off.abs() < 1e-11, "{name}: {off}");
    }
}

/// A bar, and a strip of plane strain between rollers, that swing freely along x in their first mode.
const SWINGING: &str = r#"
kinematics = "KINEMATICS"
coupling = "local"
MESH
materials.ply.orthotropic = { LAMINA, density = 2 AXES }
initial.stretched.displacement = { x = "1e-3*cos(pi*x)" }
output.probes.end = { at = END }
output.vtu = false
[solve.explicit]
duration = DURATION
"#;

#[test]
fn waves_run_at_the_speed_of_their_direction() {
    let [e1, e2, e3] = YOUNG;
    let [nu12, nu13, nu23] = POISSON;
    // C_11 and C_22 by minors of the compliance
    let s = Matrix3::new(
        1.0 / e1,
        -nu12 / e1,
        -nu13 / e1,
        -nu12 / e1,
        1.0 / e2,
        -nu23 / e2,
        -nu13 / e1,
        -nu23 / e2,
        1.0 / e3,
    );
    let c11 = (s.m22 * s.m33 - s.m23 * s.m23) / s.determinant();
    let c22 = (s.m11 * s.m33 - s.m13 * s.m13) / s.determinant();
    let strip = "mesh.rectangle = { min = [0, 0], max = [1, 0.1], x = { cells = 40 }, y = { cells = 2 } }\n\
                 conditions.low.displacement = { on = \"bottom\", y = 0 }\nconditions.high.displacement = { on = \"top\", y = 0 }";
    for (kinematics, mesh, axes, end, modulus) in [
        (
            "bar",
            "mesh.line = { min = 0, max = 1, x = { cells = 40 } }",
            "",
            "0",
            e1,
        ),
        ("plane-strain", strip, "", "[0, 0]", c11),
        ("plane-strain", strip, ", angle = 90", "[0, 0]", c22),
    ] {
        // a quarter of the period 2 L/c, at which the bar passes through rest, and then half of it
        let half = (2.0f64 / modulus).sqrt();
        let text = SWINGING
            .replace("KINEMATICS", kinematics)
            .replace("MESH", mesh)
            .replace("LAMINA", &lamina());
        let text = text
            .replace("AXES", axes)
            .replace("END", end)
            .replace("DURATION", &half.to_string());
        let done = run(&text, &[]);
        let last = *done.column("scene_history.csv", "end_ux").last().unwrap();
        assert!(
            (last / -1e-3 - 1.0).abs() < 1e-3,
            "{kinematics} {axes}: {last}"
        );
        let of = |name: &str| done.column("scene_history.csv", name);
        let (time, ux) = (of("time"), of("end_ux"));
        let at = (0..time.len())
            .min_by(|a, b| {
                (time[*a] - 0.5 * half)
                    .abs()
                    .total_cmp(&(time[*b] - 0.5 * half).abs())
            })
            .unwrap();
        let exact = 1e-3 * (std::f64::consts::PI * time[at] / half).cos();
        assert!(
            (ux[at] - exact).abs() < 1e-5,
            "{kinematics} {axes}: {} {exact}",
            ux[at]
        );
    }
}

#[test]
fn what_an_orthotropic_material_does_not_have_is_refused_by_name() {
    let plate = PULLED.replace("CELL", "quad4").replace("ANGLE", "30");
    let set = |key: &str| format!("materials.ply.orthotropic.{key}");
    for (over, parts) in [
        (
            "nu12=3.8".to_owned(),
            &["nu12 is 3.8", "3.741657", "sqrt(E1/E2)"][..],
        ),
        (
            "e1=-1".to_owned(),
            &["`materials.ply.orthotropic.e1` is -1", "larger than 0"],
        ),
        ("axis-1=[1,0,0]".to_owned(), &["axis-1", "angle"]),
        ("angle=\"z\"".to_owned(), &["uses z"]),
        ("angle=\"t\"".to_owned(), &["time t"]),
        ("angle=\"1/(x-x)\"".to_owned(), &["gives no axes"]),
        ("youngs-modulus=3".to_owned(), &["youngs-modulus", "e1"]),
    ] {
        refused(&plate, &[&set(&over)], parts);
    }
    let lacking = plate.replace(", nu12 = 0.3", "");
    refused(&lacking, &[], &["lacks `nu12`", "plane-stress"]);
    let strain = plate.replace("plane-stress", "plane-strain");
    refused(&strain, &[], &["lacks `nu13`", "plane-strain"]);
    refused(
        &plate,
        &["coupling=nonlocal", "peridynamics={horizon=1.5}"],
        &["`ply`", "no peridynamic law", "nonlocal zone"],
    );
    let cube = CUBE
        .replace("LAMINA", &lamina())
        .replace("U }", "x = 0 }")
        .replace("CELL", "hex8");
    refused(&cube, &[&set("axis-2=[2,4,4]")], &["gives no axes"]);
    refused(
        &cube,
        &[&set("axis-2=[2,4]")],
        &["axis-2` has 2 components"],
    );
    refused(&cube, &[&set("angle=3")], &["angle", "two vectors"]);
    refused(
        &cube,
        &[&set("nu23=0.99"), &set("nu12=2"), &set("nu13=2")],
        &["1 - nu12 nu21"],
    );
}
