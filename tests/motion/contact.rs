//! Two bodies that collide.

use std::f64::consts::PI;

use crate::{bondline, column, resumes_with_the_same_bytes, run, write};

/// A strip cut in two; its left half runs into the right one.
const HALVES: &str = r#"
kinematics = "plane-stress"
coupling = "nonlocal"
[mesh.rectangle]
min = [0, 0]
max = [24, 1.5]
x = { cells = 48 }
y = { cells = 3 }
[materials.plate.bond-based]
youngs-modulus = 1
density = 1
[peridynamics]
horizon = 1.5
points.lattice = { spacing = 0.5, origin = [0.25, 0.25] }
[cracks.gap]
segment = { from = [12, -1], to = [12, 4] }
[contact]
radius-factor = 0.9
stiffness-factor = 15
[initial.strike.velocity]
inside = { box = { min = [0, 0], max = [12, 2] } }
x = 0.004
[solve.explicit]
duration = 90
outputs = 1
history-interval = 0.5
[output]
vtu = false
probes.left = { at = [11.75, 0.75] }
probes.right = { at = [12.25, 0.75] }
probes.first = { at = [6.25, 0.75] }
probes.second = { at = [18.25, 0.75] }
"#;

/// Equal bars: the wave of the blow returns from both far ends at once, the first bar stops and the second leaves with all momentum and energy. A strip vibrates a little
/// afterwards, with 1.5 to 2 % of the energy at any step; twice that is allowed.
#[test]
fn equal_bodies_exchange_their_velocities() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "halves.toml", HALVES);
    let said = run(folder.path(), &["halves.toml", "--json"]);
    let history = |name: &str| column(&folder.path().join("out/halves_history.csv"), name);
    // contact is stiffer than bonds, and the stable step knows
    let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
    let stable = summary["motion"]["stable_step"].as_f64().unwrap();
    assert!(stable < 0.6, "{stable}");

    let momentum = history("momentum_x");
    for p in &momentum {
        assert!((p / momentum[0] - 1.0).abs() < 1e-12, "{p} {}", momentum[0]);
    }
    let (kinetic, stored) = (history("kinetic_energy"), history("stored_energy"));
    let before = kinetic[0];
    // 36 square units of plate at half of 0.004²
    assert!((before / (0.5 * 18.0 * 0.004f64.powi(2)) - 1.0).abs() < 1e-12);
    let after = kinetic.last().unwrap() / before;
    assert!((after - 1.0).abs() < 0.04, "{after}");
    for (k, s) in kinetic.iter().zip(&stored) {
        assert!(((k + s) / before - 1.0).abs() < 0.01, "{k} {s}");
    }
    // the faces of the crack touch at once, and no point passes another
    let gap: Vec<f64> = history("right_ux")
        .iter()
        .zip(&history("left_ux"))
        .map(|(right, left)| 0.5 + right - left)
        .collect();
    let closest = gap.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(closest < 0.5 && closest > 0.45, "{closest}");
    assert!(*gap.last().unwrap() > 0.55, "{gap:?}");
    // mean velocities over the last quarter
    let times = history("time");
    let from = times.iter().position(|t| *t > 67.5).unwrap();
    for (name, expected) in [("first_ux", 0.0), ("second_ux", 1.0)] {
        let u = history(name);
        let mean = (u.last().unwrap() - u[from]) / (times.last().unwrap() - times[from]);
        assert!((mean / 0.004 - expected).abs() < 0.04, "{name}: {mean}");
    }
}

/// Points of bodies with horizons of their own: whichever comes first, contact is as stiff. It was that of the last lattice over the horizon of the first: stable steps of 0.29 and 0.17.
#[test]
fn contact_does_not_depend_on_the_order_of_bodies() {
    let strip = |fine: &str, coarse: &str| {
        format!(
            r#"
kinematics = "plane-stress"
coupling = "truncated"
[mesh.rectangle]
min = [0, 0]
max = [34, 4]
x = {{ cells = 34 }}
y = {{ cells = 4 }}
[materials.plate.bond-based]
youngs-modulus = 1
density = 1
critical-stretch = 0.5
[peridynamics]
horizon = 1.5
points.lattice = {{ spacing = 0.5 }}
[zones]
nonlocal = {{ any = [{{ box = {{ min = [2, -1], max = [10, 5] }} }}, {{ box = {{ min = [13, -1], max = [21, 5] }} }}, {{ box = {{ min = [24, -1], max = [30, 5] }} }}] }}
[zones.bodies.{fine}]
inside = {{ box = {{ min = [2, -1], max = [10, 5] }} }}
spacing = 0.25
horizon = 0.75
[zones.bodies.{coarse}]
inside = {{ box = {{ min = [13, -1], max = [21, 5] }} }}
spacing = 0.5
horizon = 1.5
[cracks.gap]
segment = {{ from = [6, -1], to = [6, 5] }}
[contact]
stiffness-factor = 15
[initial.strike.velocity]
inside = {{ box = {{ min = [0, 0], max = [6, 4] }} }}
x = 0.02
[solve.explicit]
duration = 20
outputs = 1
[output]
vtu = false
"#
        )
    };
    let folder = tempfile::tempdir().unwrap();
    let run_of = |name: &str, text: &str| {
        write(folder.path(), name, text);
        let said = run(folder.path(), &[name, "--json"]);
        let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
        let history = format!("out/{}_history.csv", name.trim_end_matches(".toml"));
        let kinetic = column(&folder.path().join(history), "kinetic_energy");
        let step = summary["motion"]["stable_step"].as_f64().unwrap();
        (step, *kinetic.last().unwrap())
    };
    let first = run_of("first.toml", &strip("a", "b"));
    let second = run_of("second.toml", &strip("b", "a"));
    assert!(
        (first.0 / second.0 - 1.0).abs() < 1e-12,
        "{first:?} {second:?}"
    );
    assert!(
        (first.1 / second.1 - 1.0).abs() < 1e-9,
        "{first:?} {second:?}"
    );
}

/// Two squares of four elements each, the sets A and B of a deck, of which A moves: as elements and as points.
#[test]
fn a_set_of_cells_begins_to_move() {
    let folder = tempfile::tempdir().unwrap();
    let mut deck = "*NODE\n".to_owned();
    for (body, x0) in [0.0, 3.0].iter().enumerate() {
        for k in 0..9 {
            let (x, y) = (x0 + (k % 3) as f64, (k / 3) as f64);
            deck += &format!("{}, {x:?}, {y:?}\n", 9 * body + k + 1);
        }
    }
    for (body, name) in ["A", "B"].iter().enumerate() {
        deck += &format!("*ELEMENT, TYPE=CPS4, ELSET={name}\n");
        for e in 0..4 {
            let a = 9 * body + 3 * (e / 2) + e % 2 + 1;
            deck += &format!(
                "{}, {a}, {}, {}, {}\n",
                4 * body + e + 1,
                a + 1,
                a + 4,
                a + 3
            );
        }
    }
    write(folder.path(), "two.inp", &deck);
    let scene = r#"
kinematics = "plane-stress"
mesh.file.path = "two.inp"
materials.m.bond-based = { youngs-modulus = 10, density = 2 }
initial.a.velocity = { inside.set = "A", x = "3 + 0*y", y = 1 }
solve.explicit = { duration = 0.01, outputs = 1 }
output.vtu = false
"#;
    for (coupling, points) in [
        ("local", ""),
        (
            "nonlocal",
            "peridynamics = { horizon = 1.5, points.lattice = { spacing = 0.5, origin = [0.25, 0.25] } }\n",
        ),
    ] {
        write(
            folder.path(),
            "bar.toml",
            &format!("coupling = \"{coupling}\"\n{points}{scene}"),
        );
        run(folder.path(), &["bar.toml"]);
        // the mass of A is ρ A = 8
        for (name, exact) in [("momentum_x", 24.0), ("momentum_y", 8.0)] {
            let found = column(&folder.path().join("out/bar_history.csv"), name);
            assert!((found[0] - exact).abs() < 1e-12, "{coupling}: {found:?}");
        }
    }
}

/// A mesh of two bodies in the format of Gmsh, each by its nodes and cells; facets of the bodies by name.
fn bodies(dimension: usize, parts: &[Part]) -> String {
    let (mut nodes, mut elements, mut names) = (Vec::new(), Vec::new(), Vec::new());
    for (name, positions, cells, sides) in parts {
        let first = nodes.len() + 1;
        nodes.extend(positions.clone());
        let mut group = |of: usize, name: &str, all: &[Vec<usize>]| {
            names.push(format!("{of} {} \"{name}\"", names.len() + 1));
            for cell in all {
                // lines, quadrilaterals
                let kind = if cell.len() == 2 { 1 } else { 3 };
                let own: Vec<String> = cell.iter().map(|n| (n + first).to_string()).collect();
                let tag = names.len();
                elements.push(format!("{kind} 2 {tag} {tag} {}", own.join(" ")));
            }
        };
        group(dimension, name, cells);
        for (side, facets) in sides {
            group(dimension - 1, &format!("{name}-{side}"), facets);
        }
    }
    let numbered = |lines: &[String]| -> String {
        let each = lines.iter().enumerate();
        each.map(|(k, line)| format!("{} {line}\n", k + 1))
            .collect()
    };
    let places: Vec<String> = nodes
        .iter()
        .map(|[x, y]| format!("{x:?} {y:?} 0"))
        .collect();
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n{}\n{}\n$EndPhysicalNames\n$Nodes\n{}\n{}$EndNodes\n$Elements\n{}\n{}$EndElements\n",
        names.len(),
        names.join("\n"),
        places.len(),
        numbered(&places),
        elements.len(),
        numbered(&elements)
    )
}

/// A body: its name, its nodes, its cells, and its sides by name.
type Part = (
    &'static str,
    Vec<[f64; 2]>,
    Vec<Vec<usize>>,
    Vec<(&'static str, Vec<Vec<usize>>)>,
);

/// A bar of so many cells from `from` to `to`.
fn bar(name: &'static str, cells: usize, from: f64, to: f64) -> Part {
    let at = |k: usize| [from + (to - from) * k as f64 / cells as f64, 0.0];
    let all = (0..cells).map(|k| vec![k, k + 1]).collect();
    (name, (0..=cells).map(at).collect(), all, Vec::new())
}

/// A rectangle of so many cells along its sides, with its top and its bottom.
fn block(name: &'static str, cells: [usize; 2], low: [f64; 2], high: [f64; 2]) -> Part {
    let at = |k: usize, s: f64| low[k] + (high[k] - low[k]) * s;
    mapped(name, cells, |s, t| [at(0, s), at(1, t)])
}

/// A body of so many cells along the sides of a unit square, whose places `map` says.
fn mapped(name: &'static str, [n, m]: [usize; 2], map: impl Fn(f64, f64) -> [f64; 2]) -> Part {
    let at = |k: usize| {
        map(
            (k % (n + 1)) as f64 / n as f64,
            (k / (n + 1)) as f64 / m as f64,
        )
    };
    let cell = |k: usize| {
        let a = k / n * (n + 1) + k % n;
        vec![a, a + 1, a + n + 2, a + n + 1]
    };
    let row = |j: usize| {
        (0..n)
            .map(|i| vec![j * (n + 1) + i, j * (n + 1) + i + 1])
            .collect()
    };
    let sides = vec![("bottom", row(0)), ("top", row(m))];
    (
        name,
        (0..(n + 1) * (m + 1)).map(at).collect(),
        (0..n * m).map(cell).collect(),
        sides,
    )
}

const BARS: &str = r#"
kinematics = "bar"
contact = {}
mesh.file.path = "bars.msh"
materials.m.bond-based = { youngs-modulus = 1, density = 1 }
initial.a.velocity = { inside.box = { min = [-1], max = [1.0005] }, x = 0.01 }
solve.explicit = { duration = 2.6, outputs = 1, history-interval = 0.005 }
output = { vtu = false, probes.a = { at = [0.5] }, probes.b = { at = [1.5] } }
"#;

/// Two equal bars, c = ρ = L = 1: they touch for 2L/c, and the second leaves with all the momentum; of elements, with points within each, and elements against points.
#[test]
fn bars_of_elements_and_of_points_exchange_their_velocities() {
    let points = "peridynamics = { horizon = 0.03, points.lattice = { spacing = 0.01 } }\n";
    let within = "zones.nonlocal.any = [{ box = { min = [0.3], max = [0.5] } }, { box = { min = [1.4], max = [1.6] } }]\n";
    let second = "zones.nonlocal.box = { min = [1.0005], max = [2.1] }\n";
    let folder = tempfile::tempdir().unwrap();
    let mesh = bodies(1, &[bar("a", 100, 0.0, 1.0), bar("b", 100, 1.001, 2.001)]);
    write(folder.path(), "bars.msh", &mesh);
    for (coupling, more) in [
        ("local", String::new()),
        ("truncated", format!("{points}{within}")),
        ("truncated", format!("{points}{second}")),
    ] {
        let text = format!("coupling = \"{coupling}\"\n{more}{BARS}");
        write(folder.path(), "bars.toml", &text);
        run(folder.path(), &["bars.toml"]);
        let of = |name: &str| column(&folder.path().join("out/bars_history.csv"), name);
        let momentum = of("momentum_x");
        assert!(
            momentum
                .iter()
                .all(|p| (p / momentum[0] - 1.0).abs() < 1e-12)
        );
        let (kinetic, stored) = (of("kinetic_energy"), of("stored_energy"));
        let off = kinetic
            .iter()
            .zip(&stored)
            .map(|(k, s)| ((k + s) / kinetic[0] - 1.0).abs());
        assert!(off.fold(0.0, f64::max) < 1e-3);
        let (times, energy) = (of("time"), of("surface_contact_energy"));
        let touching: Vec<f64> = (times.iter().zip(&energy))
            .filter_map(|(t, e)| (*e > 0.0).then_some(*t))
            .collect();
        // from the instant at which the gap has closed
        assert!((touching[0] - 0.1).abs() < 0.015);
        let lasts = touching[touching.len() - 1] - touching[0];
        assert!((lasts / 2.0 - 1.0).abs() < 0.03, "{coupling}: {lasts}");
        let from = times.iter().position(|t| *t > 2.3).unwrap();
        for (name, expected) in [("a_ux", 0.0), ("b_ux", 1.0)] {
            let u = of(name);
            let mean = (u.last().unwrap() - u[from]) / (times.last().unwrap() - times[from]);
            assert!(
                (mean / 0.01 - expected).abs() < 0.01,
                "{coupling} {name}: {mean}"
            );
        }
    }
}

/// An error without its frame.
fn in_one_line(error: &[u8]) -> String {
    let text = String::from_utf8_lossy(error);
    let words: Vec<&str> = text
        .split_whitespace()
        .filter(|word| *word != "│")
        .collect();
    words.join(" ")
}

/// A scene of two blocks that are pressed together.
fn pressed_blocks(solve: &str, contact: &str) -> String {
    format!(
        r#"
kinematics = "plane-stress"
coupling = "local"
contact = {{ {contact} }}
mesh.file.path = "blocks.msh"
materials.m.lps = {{ youngs-modulus = 1000, poisson-ratio = 0.3 }}
conditions.base.displacement = {{ on = "lower-bottom", y = 0 }}
conditions.middle.displacement = {{ inside.box = {{ min = [-0.01, -0.01], max = [0.01, 3] }}, x = 0 }}
conditions.press.displacement = {{ on = "upper-top", y = -0.02 }}
{solve}
[output]
vtu = false
"#
    )
}

/// Two blocks whose meshes do not match are pressed together: a uniform stress, in load steps and at rest.
#[test]
fn blocks_that_touch_are_pressed_as_one() {
    let folder = tempfile::tempdir().unwrap();
    let parts = |lift: f64| {
        let upper = block("upper", [7, 3], [0.0, 1.0 + lift], [2.0, 2.0 + lift]);
        bodies(2, &[block("lower", [6, 4], [0.0, 0.0], [2.0, 1.0]), upper])
    };
    let reaction = |solve: &str, contact: &str| {
        write(
            folder.path(),
            "blocks.toml",
            &pressed_blocks(solve, contact),
        );
        let said = run(folder.path(), &["blocks.toml", "--json"]);
        let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
        let all = summary["reactions"].as_array().unwrap().clone();
        let of = |name: &str| {
            let found = all.iter().find(|r| r["condition"] == name).unwrap();
            found["force"][1].as_f64().unwrap()
        };
        (of("base"), of("press"))
    };
    // of a few cells: the far sides are no deeper in each other than the blocks are thick
    let thin = [
        block("lower", [2, 1], [0.0, 0.0], [2.0, 1.0]),
        block("upper", [3, 1], [0.0, 1.0], [2.0, 2.0]),
    ];
    // the penalty gives in by 1e-4 of a cell, of which a block has one or three
    for (mesh, limit) in [(parts(0.0), 2e-3), (bodies(2, &thin), 6e-3)] {
        write(folder.path(), "blocks.msh", &mesh);
        for solve in ["", "solve.quasi-static.steps = 2"] {
            let (base, press) = reaction(solve, "");
            // E times the strain of 1 %, over a length of 2
            assert!((base / 20.0 - 1.0).abs() < limit, "{solve}: {base}");
            assert!((base + press).abs() < 1e-7, "{solve}: {base} {press}");
        }
    }
    // apart by a little, or overlapping
    write(folder.path(), "blocks.msh", &parts(1e-4));
    let (apart, _) = reaction("solve.quasi-static.steps = 1", "");
    assert!((apart / 19.9 - 1.0).abs() < 2e-3, "{apart}");
    let (adjusted, _) = reaction("solve.quasi-static.steps = 1", "adjust = 2e-4");
    assert!((adjusted / 20.0 - 1.0).abs() < 2e-3, "{adjusted}");
    write(folder.path(), "blocks.msh", &parts(-1e-4));
    let text = pressed_blocks("solve.quasi-static.steps = 1", "");
    write(folder.path(), "blocks.toml", &text);
    let refused = bondline(folder.path())
        .args(["run", "blocks.toml"])
        .output()
        .unwrap();
    let said = in_one_line(&refused.stderr);
    assert!(
        !refused.status.success() && said.contains("contact.adjust"),
        "{said}"
    );
    // as it says
    let (adjusted, _) = reaction("solve.quasi-static.steps = 1", "adjust = 1.2e-4");
    assert!((adjusted / 20.0 - 1.0).abs() < 2e-3, "{adjusted}");
    assert!(said.contains("contact.adjust = 1.2e-4"), "{said}");
    // no adjustment that would be refused
    write(folder.path(), "blocks.msh", &parts(-0.2));
    write(folder.path(), "blocks.toml", &text);
    let refused = bondline(folder.path())
        .args(["run", "blocks.toml"])
        .output()
        .unwrap();
    let said = in_one_line(&refused.stderr);
    assert!(
        said.contains("move the bodies apart") && !said.contains("contact.adjust"),
        "{said}"
    );
}

/// A closed crack stores the energy of the whole plate, at 0° and 30° to the lattice; without `contact` too.
#[test]
fn a_closed_crack_bears_as_the_whole_plate() {
    let folder = tempfile::tempdir().unwrap();
    let energy = |law: &str, crack: &str| {
        let text = format!(
            r#"
kinematics = "plane-stress"
mesh.rectangle = {{ min = [0, 0], max = [1, 1], x = {{ cells = 40 }}, y = {{ cells = 40 }} }}
materials.glass.{law}
peridynamics = {{ horizon = "3/40", points.lattice = {{ spacing = "1/40" }} }}
zones.nonlocal = {{ box = {{ min = [0.2, 0.2], max = [0.8, 0.8] }} }}
conditions.held.displacement = {{ on = "bottom", y = 0 }}
conditions.pin.displacement = {{ on = "left", x = 0 }}
conditions.down.traction = {{ on = "top", y = -1 }}
conditions.side.traction = {{ on = "right", x = -1 }}
output.vtu = false
{crack}
"#
        );
        write(folder.path(), "plate.toml", &text);
        let said = run(folder.path(), &["plate.toml", "--json"]);
        let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
        summary["energy"].as_f64().unwrap()
    };
    let flat = "cracks.c.segment = { from = [0.4, 0.5], to = [0.6, 0.5] }";
    let slanted = "cracks.c.segment = { from = [0.4134, 0.45], to = [0.5866, 0.55] }";
    let bond = "bond-based = { youngs-modulus = 1e6 }";
    let lps = "lps = { youngs-modulus = 1e6, poisson-ratio = 0.22 }";
    // bonds push across the crack; of an LPS the faces alone do
    for (law, limit) in [(bond, 3e-4), (lps, 6e-3)] {
        let whole = energy(law, "");
        for crack in [flat, slanted] {
            let closed = energy(law, crack);
            println!("{law}, {crack}: {:.4} %", 100.0 * (closed / whole - 1.0));
            assert!(
                (closed / whole - 1.0).abs() < limit,
                "{law}: {closed} {whole}"
            );
        }
    }
}

/// A block on a slope: with the coefficient 0.3 it stays at 0.25 and slides at 0.6, as a point mass does; the work of friction closes the balance, and a run that resumes has the same bytes.
#[test]
fn a_block_slides_where_friction_does_not_hold_it() {
    let folder = tempfile::tempdir().unwrap();
    let base = block("base", [20, 4], [-0.5, -0.5], [3.5, 0.0]);
    let mesh = bodies(2, &[block("block", [6, 3], [0.0, 0.0], [1.0, 0.5]), base]);
    write(folder.path(), "slope.msh", &mesh);
    let scene = |slope: f64| {
        format!(
            r#"
kinematics = "plane-strain"
coupling = "local"
contact = {{ friction = 0.3 }}
mesh.file.path = "slope.msh"
materials.m.lps = {{ youngs-modulus = 1e4, poisson-ratio = 0.2, density = 1 }}
conditions.held.displacement = {{ on = "base-bottom", x = 0, y = 0 }}
conditions.weight.body-force = {{ inside.box = {{ min = [-0.1, 0.01], max = [1.1, 0.6] }}, x = "{slope}*min(1, t)", y = "-min(1, t)" }}
solve.explicit = {{ duration = 3, outputs = 1, history-interval = 0.02 }}
output = {{ vtu = false, probes.c = {{ at = [0.5, 0.25] }} }}
"#
        )
    };
    let of = |name: &str| column(&folder.path().join("out/slope_history.csv"), name);
    write(folder.path(), "slope.toml", &scene(0.25));
    run(folder.path(), &["slope.toml"]);
    assert!(of("c_ux").last().unwrap().abs() < 1e-4);
    write(folder.path(), "slope.toml", &scene(0.6));
    run(folder.path(), &["slope.toml"]);
    let (times, momentum) = (of("time"), of("momentum_x"));
    // means over half a second: the block rocks on its base
    let mean = |from: f64| {
        let within = |t: f64| t > from && t < from + 0.5;
        let own = times.iter().zip(&momentum).filter(|(t, _)| within(**t));
        own.clone().map(|(_, p)| p).sum::<f64>() / own.count() as f64
    };
    let acceleration = (mean(2.5) - mean(1.5)) / 0.5;
    assert!((acceleration / 0.3 - 1.0).abs() < 0.02, "{acceleration}");
    let work = of("friction_work").last().copied().unwrap();
    // 0.3 of the weight over the way, the first part of which has less
    let way = of("c_ux").last().copied().unwrap();
    assert!(
        work > 0.12 * way && work < 0.15 * way * 1.01,
        "{work} {way}"
    );
    let last = |name: &str| of(name).last().copied().unwrap();
    let balance = last("kinetic_energy") + last("stored_energy") + work - last("external_work");
    assert!(balance.abs() < 5e-3 * last("external_work"), "{balance}");
    let mesh = folder.path().join("slope.msh");
    let typed = scene(0.6).replace("slope.msh", &mesh.to_string_lossy());
    let typed = typed.replace("duration = 3,", "duration = 1.5, checkpoint-every = 500,");
    resumes_with_the_same_bytes(&typed);
}

/// A cylinder of radius R on a block of the same material in plane strain, half of the contact seven cells wide: pressure `p₀ √(1 − x²/a²)` with `a² = 4 P R/(π E*)` and `p₀ = 2 P/(π a)`, `E* = E/(2 (1 − ν²))`.
#[test]
fn a_cylinder_presses_on_a_block_as_hertz_says() {
    let folder = tempfile::tempdir().unwrap();
    let (radius, size) = (10.0, 4.0);
    let graded = |s: f64| size * (2.0 * s - 1.0).abs().powf(2.2).copysign(2.0 * s - 1.0);
    let cylinder = mapped("cylinder", [48, 24], |s, t| {
        let low = graded(s).powi(2) / (2.0 * radius);
        [graded(s), low + (size - low) * t * t]
    });
    let base = mapped("block", [54, 24], |s, t| {
        [graded(s), -size * (1.0 - t) * (1.0 - t)]
    });
    write(folder.path(), "hertz.msh", &bodies(2, &[cylinder, base]));
    let scene = r#"
kinematics = "plane-strain"
coupling = "local"
contact = {}
mesh.file.path = "hertz.msh"
materials.m.lps = { youngs-modulus = 1000, poisson-ratio = 0.3 }
conditions.base.displacement = { on = "block-bottom", x = 0, y = 0 }
conditions.down.displacement = { on = "cylinder-top", x = 0, y = -0.02 }
[output]
vtu = false
stresses = ["von-mises"]
lines.face = { from = [0, -0.0005], to = [0.5, -0.0005], samples = 201 }
"#;
    write(folder.path(), "hertz.toml", scene);
    let said = run(folder.path(), &["hertz.toml", "--json"]);
    let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
    let all = summary["reactions"].as_array().unwrap();
    let found = all.iter().find(|r| r["condition"] == "base").unwrap();
    let load = found["force"][1].as_f64().unwrap();
    let modulus = 1000.0 / (2.0 * (1.0 - 0.09));
    let half = (4.0 * load * radius / (PI * modulus)).sqrt();
    let peak = 2.0 * load / (PI * half);
    // p² is linear in x²; stresses are the means of cells, each at the middle of its samples
    let face = folder.path().join("out/hertz_face.csv");
    let (x, pressure) = (column(&face, "x"), column(&face, "syy"));
    let mut cells: Vec<(f64, f64, f64)> = Vec::new();
    for (x, p) in x.into_iter().zip(pressure) {
        match cells.last_mut() {
            Some(cell) if cell.1 == -p => cell.2 = x,
            _ => cells.push((x, -p, x)),
        }
    }
    let largest = cells.iter().fold(0.0_f64, |most, cell| most.max(cell.1));
    cells.retain(|cell| cell.1 > 0.4 * largest);
    assert!(cells.len() >= 6, "{cells:?}");
    let points = cells
        .iter()
        .map(|c| ((0.5 * (c.0 + c.2)).powi(2), c.1 * c.1));
    let count = cells.len() as f64;
    let (sx, sy) = points
        .clone()
        .fold((0.0, 0.0), |(a, b), (x, y)| (a + x / count, b + y / count));
    let (xx, xy) = points.fold((0.0, 0.0), |(a, b), (x, y)| {
        (a + (x - sx) * (x - sx), b + (x - sx) * (y - sy))
    });
    let slope = xy / xx;
    let fitted = sy - slope * sx;
    let found = ((-fitted / slope).sqrt() / half, fitted.sqrt() / peak);
    println!("half-width and pressure over those of Hertz: {found:?}");
    assert!((found.0 - 1.0).abs() < 0.05, "{found:?}");
    assert!((found.1 - 1.0).abs() < 0.03, "{found:?}");
}
