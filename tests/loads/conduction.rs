//! Temperatures by heat conduction, and the stresses that they give, against closed forms.

use std::f64::consts::PI;

use super::{Done, read, refused, run};
use bondline::progress::Silent;

/// The last value of a probe of a scene in time.
fn last(done: &Done, name: &str) -> f64 {
    *done.column("scene_history.csv", name).last().unwrap()
}

/// A block of length 2 that takes in heat at its left, makes some within, and hands it on to air at its right.
const BLOCK: &str = r#"
kinematics = "KINEMATICS"
coupling = "local"
mesh.SHAPE
materials.m.lps = { youngs-modulus = 1, poisson-ratio = 0.3, thermal-expansion = 0, conductivity = 0.5 }
conditions.left.displacement = { on = "left", x = 0 HELD }
output = { fields = ["temperature"], vtu = false, lines.l = { from = FROM, to = TO, samples = 11 } }
[temperature.conduction.conditions]
in.flux = { on = "left", value = "3 + 0*y" }
air.convection = { on = "right", coefficient = 4, ambient = 20 }
made.source = { value = SOURCE }
"#;

/// Fourier's law: q₀ + q x = −k T′, and h (T − T∞) leaves at the end. Exact in every cell that holds the field.
#[test]
fn heat_flows_through_cells_of_every_kind() {
    let plane = |cell: &str| {
        let shape = format!(
            "rectangle = {{ min = [0, 0], max = [2, 1], x = {{ cells = 4 }}, y = {{ cells = 2 }}, cell = \"{cell}\" }}"
        );
        (shape, "plane-stress", ", y = 0", ["[0, 0.3]", "[2, 0.7]"])
    };
    let solid = |cell: &str| {
        let shape = format!(
            "box = {{ min = [0, 0, 0], max = [2, 1, 1], x = {{ cells = 2 }}, y = {{ cells = 2 }}, z = {{ cells = 1 }}, cell = \"{cell}\" }}"
        );
        let ends = ["[0, 0.3, 0.2]", "[2, 0.7, 0.9]"];
        (shape, "solid", ", y = 0, z = 0", ends)
    };
    for (body, source) in [
        (plane("quad4"), 0.0),
        (plane("tri3"), 0.0),
        (plane("quad8"), 1.5),
        (plane("tri6"), 1.5),
        (solid("hex8"), 0.0),
        (solid("tet4"), 0.0),
        (solid("hex20"), 1.5),
        (solid("tet10"), 1.5),
    ] {
        let (shape, kinematics, held, [from, to]) = body;
        let text = BLOCK
            .replace("KINEMATICS", kinematics)
            .replace("SHAPE", &shape)
            .replace("HELD", held)
            .replace("FROM", from)
            .replace("TO", to)
            .replace("SOURCE", &source.to_string());
        let done = run(&text, &[]);
        let end = 20.0 + (3.0 + 2.0 * source) / 4.0;
        let places = done.column("scene_l.csv", "x");
        for (x, found) in places.iter().zip(done.column("scene_l.csv", "temperature")) {
            let wanted = end + (3.0 * (2.0 - x) + 0.5 * source * (4.0 - x * x)) / 0.5;
            assert!(
                (found - wanted).abs() < 1e-9 * wanted,
                "{shape} at {x}: {found}, {wanted}"
            );
        }
    }
}

/// Two layers in series, of conductivities 1 and 4: the temperature falls four times as fast in the first.
#[test]
fn each_material_conducts_by_its_own_number() {
    let done = run(
        r#"
kinematics = "bar"
coupling = "local"
mesh.line = { min = 0, max = 1, x = { cells = 10 } }
conditions.left.displacement = { on = "left", x = 0 }
output = { fields = ["temperature"], vtu = false, probes.p = { at = 0.5 } }
[materials]
m.bond-based = { youngs-modulus = 1, thermal-expansion = 0, conductivity = 1, cells.box = { min = 0, max = 0.5 } }
n.bond-based = { youngs-modulus = 1, thermal-expansion = 0, conductivity = 4 }
[temperature.conduction.conditions]
hot.temperature = { on = "left", value = 100 }
cold.temperature = { inside.box = { min = 0.95, max = 1.05 }, value = 0 }
"#,
        &[],
    );
    let middle = done.column("scene_probes.csv", "temperature")[0];
    assert!((middle - 20.0).abs() < 1e-11, "{middle}");
}

/// A cylinder from r = 1 to 2, hot inside and cooled by air outside.
#[test]
fn a_hollow_cylinder_has_the_temperature_of_its_logarithm() {
    // [CarslawJaeger1959] section 7.2
    let (k, h, hot, air) = (2.0, 3.0, 400.0, 20.0);
    let exact = |r: f64| hot - h * (hot - air) / (0.5 * k + h * 2f64.ln()) * r.ln();
    let mut errors = Vec::new();
    for n in [6, 12, 24] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ring.msh");
        std::fs::write(&path, quarter_ring(n)).unwrap();
        let done = run(
            &format!(
                r#"
kinematics = "plane-strain"
coupling = "local"
mesh.file.path = {path:?}
materials.m.lps = {{ youngs-modulus = 1, poisson-ratio = 0.3, thermal-expansion = 0, conductivity = {k} }}
conditions.held.displacement = {{ on = "inside", x = 0, y = 0 }}
output = {{ fields = ["temperature"], vtu = false, probes.p = {{ at = [1.5, 0] }}, probes.q = {{ at = [2, 0] }} }}
[temperature.conduction.conditions]
hot.temperature = {{ on = "inside", value = {hot} }}
air.convection = {{ on = "outside", coefficient = {h}, ambient = {air} }}
"#
            ),
            &[],
        );
        let found = done.column("scene_probes.csv", "temperature");
        let off = [(0, 1.5), (1, 2.0)].map(|(p, r)| (found[p] - exact(r)).abs() / (hot - air));
        errors.push(off[0].max(off[1]));
    }
    println!("cylinder {errors:?}");
    second_order(&errors, 2e-4);
}

/// Errors fall with the square of the size, to `last` at the most.
fn second_order(errors: &[f64], last: f64) {
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((1.85..2.6).contains(&order), "order {order} of {errors:?}");
    }
    assert!(errors[errors.len() - 1] < last, "{errors:?}");
}

/// A quarter of a ring of `n` by `n` quadrilaterals.
fn quarter_ring(n: usize) -> String {
    let at = |i: usize, j: usize| j * (n + 1) + i + 1;
    let mut text = String::from(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n1 1 \"inside\"\n1 2 \"outside\"\n2 3 \"body\"\n$EndPhysicalNames\n$Nodes\n",
    );
    text += &format!("{}\n", (n + 1) * (n + 1));
    for j in 0..=n {
        for i in 0..=n {
            let (r, angle) = (1.0 + i as f64 / n as f64, 0.5 * PI * j as f64 / n as f64);
            let (x, y) = (r * angle.cos(), r * angle.sin());
            text += &format!("{} {x} {y} 0\n", at(i, j));
        }
    }
    text += &format!("$EndNodes\n$Elements\n{}\n", n * n + 2 * n);
    let mut number = 0;
    let mut add = |what: String| {
        number += 1;
        text += &format!("{number} {what}\n");
    };
    for j in 0..n {
        add(format!("1 2 1 1 {} {}", at(0, j), at(0, j + 1)));
        add(format!("1 2 2 2 {} {}", at(n, j), at(n, j + 1)));
        for i in 0..n {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            add(format!("3 2 3 3 {a} {b} {c} {d}"));
        }
    }
    text + "$EndElements\n"
}

/// The first terms of the series of a slab, 0 < y < 1, that is 1 at first, 0 at y = 0 from then on and insulated at y = 1: `T = Σ c sin λy`, as pairs (λ, c).
fn slab(fourier: f64) -> Vec<(f64, f64)> {
    // [CarslawJaeger1959] section 3.3
    let term = |n: usize| {
        let root = (n as f64 + 0.5) * PI;
        (root, 2.0 / root * (-root * root * fourier).exp())
    };
    (0..40).map(term).collect()
}

/// A slab that is quenched at its left; time steps as fine as cells.
const SLAB: &str = r#"
kinematics = "bar"
coupling = "local"
mesh.line = { min = 0, max = 1, x = { cells = 8 } }
materials.m.bond-based = { youngs-modulus = 1, thermal-expansion = 0, conductivity = 3, heat-capacity = 2 }
conditions.left.displacement = { on = "left", x = 0 }
solve.quasi-static = { steps = 2, duration = 0.1 }
output = { fields = ["temperature"], vtu = false, probes.p = { at = 0.25 }, probes.q = { at = 1 } }
[temperature.conduction]
initial = 1
steps = 8
conditions.cold.temperature = { on = "left", value = 0 }
"#;

#[test]
fn a_quenched_slab_has_the_temperature_of_its_series() {
    let exact = |x: f64| -> f64 {
        let terms = slab(0.15).into_iter();
        terms.map(|(root, c)| c * (root * x).sin()).sum()
    };
    let mut errors = Vec::new();
    for n in [8, 16, 32, 64] {
        let set = [
            format!("mesh.line.x.cells={n}"),
            format!("temperature.conduction.steps={n}"),
        ];
        let done = run(SLAB, &[&set[0], &set[1]]);
        let off = [("p", 0.25), ("q", 1.0)]
            .map(|(p, x)| (last(&done, &format!("{p}_temperature")) - exact(x)).abs());
        errors.push(off[0].max(off[1]));
    }
    println!("slab {errors:?}");
    second_order(&errors, 1e-4);
    // between two instants the temperature is linear in time
    let at = |steps: usize| {
        let steps = format!("solve.quasi-static.steps={steps}");
        let done = run(SLAB, &["temperature.conduction.steps=1", &steps]);
        done.column("scene_history.csv", "q_temperature")
    };
    let (one, four) = (at(1), at(4));
    let quarter = 0.75 * one[0] + 0.25 * one[1];
    assert!((four[1] - quarter).abs() < 1e-12, "{one:?} {four:?}");
}

/// A source of width w and heat Q that moves along a rod at the speed v; the rod ahead is at 0.
#[test]
fn a_moving_source_has_the_temperature_of_rosenthal() {
    // [Rosenthal1946], heat flow along one axis: A exp(−v ξ/κ) ahead of the source, A = Q/(c v) behind it
    let (k, c, v, w, heat) = (0.2, 2.0, 1.5, 0.1, 6.0);
    let (a, peclet) = (heat / (c * v), v * w * c / k);
    let exact = |x: f64, t: f64| {
        let xi = x - 0.5 - v * t;
        let passed = (xi + 0.5 * w) / w;
        if xi < -0.5 * w {
            a
        } else if xi > 0.5 * w {
            a * (0.5 * peclet).sinh() / (0.5 * peclet) * (-v * xi * c / k).exp()
        } else {
            a * (1.0 - passed + (1.0 - (-peclet * passed).exp()) / peclet)
        }
    };
    let xi = format!("(x-0.5-{v}*t)");
    let ahead = a * (0.5 * peclet).sinh() / (0.5 * peclet);
    let field = |xi: &str| {
        format!(
            "if({xi} < -{w}/2, {a}, if({xi} > {w}/2, {ahead}*exp(-{v}*{c}/{k}*{xi}), {a}*(1-({xi}+{w}/2)/{w}+(1-exp(-{peclet}*({xi}+{w}/2)/{w}))/{peclet})))"
        )
    };
    let (begin, always) = (field("(x-0.5)"), field(&xi));
    let mut errors = Vec::new();
    for n in [100, 200, 400] {
        let text = format!(
            r#"
kinematics = "bar"
coupling = "local"
mesh.line = {{ min = 0, max = 2, x = {{ cells = {n} }} }}
materials.m.bond-based = {{ youngs-modulus = 1, thermal-expansion = 0, conductivity = {k}, heat-capacity = {c} }}
conditions.left.displacement = {{ on = "left", x = 0 }}
solve.quasi-static = {{ steps = 1, duration = 0.5 }}
output = {{ fields = ["temperature"], vtu = false, probes.p = {{ at = 1 }}, probes.q = {{ at = 1.28 }}, probes.r = {{ at = 1.36 }} }}
[temperature.conduction]
initial = "{begin}"
steps = {n}
conditions.ends.temperature = {{ on = "right", value = "{always}" }}
conditions.start.temperature = {{ on = "left", value = "{always}" }}
conditions.torch.source = {{ value = "if(abs{xi} < {w}/2, {heat}/{w}, 0)" }}
"#
        );
        let done = run(&text, &[]);
        let off = [("p", 1.0), ("q", 1.28), ("r", 1.36)]
            .map(|(p, x)| (last(&done, &format!("{p}_temperature")) - exact(x, 0.5)).abs() / a);
        errors.push(off.into_iter().fold(0.0, f64::max));
    }
    println!("rod {errors:?}");
    // of the part A of the temperature; below the second order, for the edges of the source lie within cells
    let falls = errors.windows(2).all(|pair| pair[0] > 2.0 * pair[1]);
    assert!(errors[2] < 5e-4 && falls, "{errors:?}");
}

/// A plate of thickness 1 whose lower face is quenched, symmetric at its left and free to bend.
const PLATE: &str = r#"
kinematics = "plane-strain"
mesh.rectangle = { min = [0, 0], max = [4, 1], x = { cells = 144 }, y = { cells = 36 } }
materials.glass.MATERIAL
peridynamics = { horizon = "3/36", points.lattice.spacing = "1/36" }
zones.nonlocal.box = { min = [0.5, 0.25], max = [1.5, 0.75] }
solve.quasi-static = { steps = 1, duration = 0.1 }
conditions.left.symmetry.on = "left"
conditions.pin.displacement = { inside.box = { min = [-0.001, -0.001], max = [0.001, 0.001] }, y = 0 }
output.stresses = ["von-mises"]
output.vtu = false
[temperature]
reference = 300
[temperature.conduction]
initial = 300
steps = 50
conditions.bath.temperature = { on = "bottom", value = 20 }
[output.probes]
"#;

/// Fibres of a plate that remains plane, [BoleyWeiner1960] section 9.4: `σ = E α/(1 − ν) (mean + linear part − T)`, at rest across the plane.
#[test]
fn a_quenched_plate_has_the_stress_of_its_fibres() {
    let (fourier, alpha_e) = (0.1, 200.0 * 1e-5);
    let terms = slab(fourier);
    let sum =
        |of: &dyn Fn(f64) -> f64| -> f64 { terms.iter().map(|(root, c)| c * of(*root)).sum() };
    let mean = sum(&|root| 1.0 / root);
    let moment = sum(&|root| root.sin() / (root * root) - 0.5 / root);
    let stress = |y: f64, nu: f64| {
        let rise = sum(&|root| (root * y).sin());
        280.0 * alpha_e / (1.0 - nu) * (mean + 12.0 * moment * (y - 0.5) - rise)
    };
    // middles of cells and points, in and beside the zone
    let heights = [0.5, 5.5, 12.5, 17.5, 23.5, 30.5, 35.5].map(|row| row / 36.0);
    let mut text = PLATE.to_owned();
    for (k, y) in heights.iter().enumerate() {
        text += &format!("p{k} = {{ at = [\"36.5/36\", {y}] }}\n");
    }
    let lps = "lps = { youngs-modulus = 200, poisson-ratio = 0.3, thermal-expansion = 1e-5, conductivity = 1, heat-capacity = 1 }";
    let pairs = "bond-based = { youngs-modulus = 200, thermal-expansion = 1e-5, conductivity = 1, heat-capacity = 1 }";
    for (material, nu) in [(lps, 0.3), (pairs, 0.25)] {
        let text = text.replace("MATERIAL", material);
        for set in [
            &[
                "coupling=local",
                "zones={}",
                "peridynamics.points.lattice.spacing=1",
            ][..],
            &["coupling=truncated"],
        ] {
            let done = run(&text, set);
            let largest = stress(0.5 / 36.0, nu);
            let mut off = 0.0f64;
            for (k, &y) in heights.iter().enumerate() {
                let found = last(&done, &format!("p{k}_sxx"));
                off = off.max((found - stress(y, nu)).abs() / largest.abs());
            }
            println!("{set:?} {material}: {off:.2e}");
            assert!(off < 0.01, "{set:?} {material}: {off}");
        }
    }
}

/// A temperature that conduction makes linear strains bodies as one that is typed does.
#[test]
fn a_solved_temperature_acts_as_a_typed_one() {
    let scene = |temperature: &str, conducts: &str| {
        format!(
            r#"
kinematics = "plane-stress"
mesh.rectangle = {{ min = [0, 0], max = [2, 1], x = {{ cells = 16 }}, y = {{ cells = 8 }} }}
materials.m.lps = {{ youngs-modulus = 200, poisson-ratio = 0.3, thermal-expansion = 1e-5{conducts} }}
peridynamics = {{ horizon = 0.25, points.lattice.spacing = 0.125 }}
zones.nonlocal.box = {{ min = [0.75, 0.25], max = [1.25, 0.75] }}
conditions.left.displacement = {{ on = "left", x = 0, y = 0 }}
conditions.right.symmetry.on = "right"
output = {{ stresses = ["von-mises"], vtu = false, lines.l = {{ from = [0.03, 0.1], to = [1.97, 0.9], samples = 21 }} }}
{temperature}
"#
        )
    };
    let typed = scene("temperature = { value = \"20 + 50*x\", reference = 5 }", "");
    let solved = scene(
        "temperature = { reference = 5, conduction.conditions = { a.temperature = { on = \"left\", value = 20 }, b.temperature = { on = \"right\", value = 120 } } }",
        ", conductivity = 45",
    );
    for coupling in ["coupling=truncated", "coupling=splice"] {
        let [typed, solved] =
            [&typed, &solved].map(|text| run(text, &[coupling]).rows("scene_l.csv"));
        for (a, b) in typed.iter().flatten().zip(solved.iter().flatten()) {
            assert!((a - b).abs() < 1e-9, "{coupling}: {a} {b}");
        }
    }
}

/// Triangles that fit nothing, of which a zone with a rim of its own replaces some: heat flows in the mesh as it was, and places find their temperature.
#[test]
fn a_zone_with_a_rim_of_its_own_takes_the_temperature_of_the_mesh() {
    let mut text = r#"
kinematics = "plane-stress"
coupling = "truncated"
mesh.file.path = "MESHES/quarter_ring.msh"
materials.steel.lps = { youngs-modulus = 200, poisson-ratio = 0.3, thermal-expansion = 1e-5, conductivity = 45 }
zones = { rim = "own", nonlocal.box = { min = [1.05, 0.25], max = [1.6, 0.75] } }
peridynamics = { horizon = 0.121, points.lattice = { spacing = 0.04, origin = [0.013, 0.007] } }
output.lines.l = { from = [1.02, 0.3], to = [1.9, 0.5], samples = 23 }
output.stresses = ["von-mises"]
output.fields = ["temperature"]
output.vtu = false
temperature.reference = 20
[conditions.outer.displacement]
on = "outer"
x = "1e-5*((30+50*x-20*y)*x - 0.5*50*(x^2+y^2))"
y = "1e-5*((30+50*x-20*y)*y + 0.5*20*(x^2+y^2))"
[temperature.conduction.conditions]
"#
    .to_owned();
    for side in ["outer", "bottom", "left", "bore"] {
        text += &format!("{side}.temperature = {{ on = \"{side}\", value = \"50+50*x-20*y\" }}\n");
    }
    let done = run(&text, &[]);
    let [x, y, temperature, stress] =
        ["x", "y", "temperature", "von_mises"].map(|name| done.column("scene_l.csv", name));
    for k in 0..x.len() {
        let wanted = 50.0 + 50.0 * x[k] - 20.0 * y[k];
        assert!(
            (temperature[k] - wanted).abs() < 1e-10,
            "{} {wanted}",
            temperature[k]
        );
        // E α ΔT is 0.2
        assert!(stress[k].abs() < 1e-12, "{}", stress[k]);
    }
}

#[test]
fn conduction_that_determines_no_temperature_is_refused() {
    let refuse = |set: &str, part: &str| refused(SLAB, &[set], &[part]);
    refuse(
        "temperature={conduction={initial=1},value=3}",
        "both `value` and `conduction`",
    );
    refuse(
        "temperature={reference=3}",
        "neither `value` nor `conduction`",
    );
    refuse(
        "temperature={value=\"3\"}",
        "conducts heat, and the scene has no [temperature.conduction]",
    );
    refuse("temperature.conduction.steps=0", "steps` is 0");
    refuse("temperature.conduction.initial=\"1/x\"", "initial` is inf");
    refuse("solve=static", "in a static scene");
    refuse(
        "materials.m={bond-based={youngs-modulus=1,thermal-expansion=0}}",
        "has no conductivity",
    );
    refuse(
        "materials.m={bond-based={youngs-modulus=1,thermal-expansion=0,conductivity=1}}",
        "has no heat-capacity",
    );
    refuse(
        "materials.m.bond-based.conductivity=-1",
        "conductivity` is -1",
    );
    refuse(
        "temperature.conduction={conditions={}}",
        "known but for a constant",
    );
    refuse(
        "temperature.conduction.conditions={a={temperature={on=\"left\",value=0}},b={temperature={on=\"left\",value=1}}}",
        "prescribe the temperatures 0 and 1",
    );
    refuse(
        "temperature.conduction.conditions={a={convection={on=\"left\",coefficient=0,ambient=1}}}",
        "coefficient` is 0",
    );
    refuse(
        "temperature.conduction.conditions={a={temperature={inside={box={min=0.3,max=0.32}},value=0}}}",
        "holds no",
    );
    // a steady temperature of two bodies, one of which has no condition
    let text = r#"
kinematics = "plane-stress"
coupling = "local"
materials.m.lps = { youngs-modulus = 1, poisson-ratio = 0.3, thermal-expansion = 0, conductivity = 1 }
mesh.rectangle = { min = [0, 0], max = [3, 1], x = { cells = 3 }, y = { cells = 1 }, cutouts.gap = { min = [1, 0], max = [2, 1] } }
conditions.all.displacement = { inside.box = { min = [0, 0], max = [3, 1] }, x = 0, y = 0 }
output.vtu = false
temperature.conduction.conditions.hot.temperature = { on = "left", value = 1 }
"#;
    let error = read(text, &[]).unwrap().run(&Silent).unwrap_err();
    let error = error.to_string();
    assert!(
        error.contains("nothing prescribes the temperature of 4 nodes"),
        "{error}"
    );
}
