//! Scenes as people type them, drawn.

use crate::{
    Effort,
    meshes::{
        affine::{COUPLINGS, Family, lug},
        gmsh,
        order::octant,
    },
    zones::{
        draw::Draw,
        obstacles::{self, Body, LAWS},
    },
};

/// The seeds of all that is drawn: figures of messages were chosen with the first one at hand, and the second one drawn afterwards.
pub(super) const SEEDS: [u64; 2] = [620, 1201];

/// Scenes of each body, in full and in `Effort::Quick`.
const EACH: [usize; 2] = [5, 2];

/// Name of the files of the lines.
pub(super) const LINES: [&str; 3] = ["scene_a.csv", "scene_b.csv", "scene_c.csv"];

/// A scene that was drawn.
pub(super) struct Case {
    pub name: String,
    pub text: String,
    pub mesh: String,
    /// Place of a sharp root in the plane of x and y, and the distance from it within which no mesh tells a stress.
    pub root: Option<([f64; 2], f64)>,
}

/// Wave speed of the material, about.
const SPEED: f64 = 1.9;

/// Ways to solve a scene: name, the factor of its loads, and its keys, with the time that waves take through the body three times as `T`.
const WAYS: [(&str, &str, &str); 4] = [
    ("at rest", "", ""),
    ("at rest", "", ""),
    (
        "load steps",
        "*t",
        "solve.quasi-static = { duration = 1, steps = 2 }",
    ),
    (
        "in time",
        "*sin(1.5708*min(1, 2*t/T))^2",
        "solve.explicit = { duration = T, outputs = 1 }",
    ),
];

/// Bodies beside those that zones cross: with curved surfaces, and a strip that bends.
fn more() -> Vec<Body> {
    let file = |name, kinematics, mesh, size| Family {
        mesh,
        name,
        kinematics,
        size,
        ..lug(1)
    };
    let mut list = vec![
        Body {
            name: "square of triangles that bends",
            family: file(
                "triangles",
                "plane-stress",
                include_str!("../../../../meshes/graded_triangles.msh").to_owned(),
                1.0,
            ),
            conditions: "left.displacement = { inside.box = { min = [-1, -1], max = [0.01, 21] }, x = 0, y = 0 }
weight.body-force = { y = '1e-4{f}' }",
            inclusion: None,
            root: None,
        },
        Body {
            name: "octant of a thick sphere",
            family: file("sphere", "solid", octant(4, [1.0, 3.0]), 0.25),
            conditions: "held.displacement = { on = \"held\", x = 0, y = 0, z = 0 }
inner.pressure = { on = \"inner\", value = '1e-3{f}' }",
            inclusion: None,
            root: None,
        },
        Body {
            name: "lug of tetrahedra",
            family: lug(8),
            conditions: "left.displacement = { inside.box = { min = [-1, -1, -1], max = [11, 11, 0.01] }, x = 0, y = 0, z = 0 }
weight.body-force = { x = '1e-4{f}', z = '2e-4{f}' }",
            inclusion: None,
            root: None,
        },
    ];
    // linear cells are too coarse a truth
    for body in &mut list {
        let mesh = match body.family.kinematics {
            "solid" => gmsh::raised::<3>(&body.family.mesh, |_| ()),
            _ => gmsh::raised::<2>(&body.family.mesh, |_| ()),
        };
        body.family.mesh = mesh.unwrap_or_default();
    }
    list
}

fn drawn<const D: usize>(draw: &mut Draw, body: &Body, nodes: &[[f64; 3]], number: usize) -> Case {
    let law = draw.one(&LAWS);
    let (way, factor, solve) = draw.one(&WAYS);
    let spacing = body.family.size * draw.within(0.5, 1.0);
    let middle = &draw.one(nodes)[..D];
    let radius = spacing * draw.within(3.0, if D == 3 { 4.0 } else { 7.0 });
    let zone = draw.ball_or_box(middle, radius);
    // every other scene leaves the coupling out
    let coupling = match draw.one(&[true, false]) {
        true => None,
        false => Some(draw.one(&COUPLINGS)),
    };
    let mut more = format!(
        "peridynamics = {{ horizon = {}, points.lattice.spacing = {spacing} }}\nzones.nonlocal.{zone}\n",
        3.0 * spacing
    );
    let typed = match coupling {
        None => "coupling left out",
        Some((name, typed, has_transition)) => {
            if has_transition {
                more += &format!("zones.transition.around = {}\n", 2.0 * spacing);
            }
            more += &inline(typed);
            name
        }
    };
    let bounds = |pick: fn(f64, f64) -> f64| {
        let first = nodes[0];
        nodes
            .iter()
            .fold(first, |a, b| std::array::from_fn(|i| pick(a[i], b[i])))
    };
    let (low, high) = (bounds(f64::min), bounds(f64::max));
    let span = (0..D).map(|i| high[i] - low[i]).fold(0.0, f64::max);
    let time = format!("{}", 3.0 * span / SPEED);
    more += &solve.replace('T', &time);
    more += "\noutput.vtu = false\noutput.stresses = [\"von-mises\"]\n";
    for (axis, name) in ["a", "b", "c"].into_iter().enumerate().take(D) {
        let (mut from, mut to) = (middle.to_vec(), middle.to_vec());
        (from[axis], to[axis]) = (low[axis], high[axis]);
        more +=
            &format!("output.lines.{name} = {{ from = {from:?}, to = {to:?}, samples = 61 }}\n");
    }
    Case {
        name: format!("{}, {}, {typed}, {way}, number {number}", body.name, law.0),
        text: obstacles::text(body, law.1, &more, &factor.replace('T', &time)),
        mesh: body.family.mesh.clone(),
        root: body.root.map(|root| (root, body.family.size)),
    }
}

/// A table of a coupling in one line.
fn inline(typed: &str) -> String {
    let mut lines = typed.lines();
    let name = lines.next().unwrap_or_default().trim_matches(['[', ']']);
    let keys: Vec<&str> = lines.collect();
    format!("{name} = {{ {} }}\n", keys.join(", "))
}

/// The scenes; in `Effort::Quick` those of the first bodies.
pub(super) fn cases(effort: Effort, seed: u64) -> Vec<Case> {
    let mut bodies = obstacles::bodies(effort);
    if effort == Effort::Full {
        bodies.extend(more());
    }
    let each = if effort == Effort::Full {
        EACH[0]
    } else {
        EACH[1]
    };
    let mut cases = Vec::new();
    for (k, body) in bodies.iter().enumerate() {
        let mut draw = Draw::new(seed + k as u64);
        let Ok(nodes) = obstacles::nodes(body) else {
            continue;
        };
        cases.extend((0..each).map(|n| match body.family.kinematics {
            "solid" => drawn::<3>(&mut draw, body, &nodes, n),
            _ => drawn::<2>(&mut draw, body, &nodes, n),
        }));
    }
    cases
}
