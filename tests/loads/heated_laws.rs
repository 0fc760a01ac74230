//! Every law, heated: free it has no stress, held it has that of Hooke's law. A law that is added runs here unasked.

use bondline::material::Kinematics;

use super::{
    read, run,
    stress_measures::{Stuff, YOUNG, every_law},
};

/// Laws of solids that are not linear: in plane strain what they have out of the plane is that of Hooke's law in small strains alone.
const NOT_LINEAR: [&str; 5] = [
    "neo-hooke",
    "st-venant-kirchhoff",
    "plastic-correspondence",
    "johnson-cook",
    "damage-correspondence",
];

const FREE: f64 = 0.04;
const HELD: f64 = 1e-6;
const ALPHA: f64 = 1e-3;

/// Couplings, and kinematics of bonds where there are some.
const COUPLINGS: [(&str, &str); 7] = [
    ("local", ""),
    ("nonlocal", ""),
    ("nonlocal", ", bonds = \"exact\""),
    ("splice", ""),
    ("splice", ", bonds = \"exact\""),
    ("truncated", ""),
    ("truncated", ", bonds = \"exact\""),
];

/// Way in which the body is brought to its temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    AtRest,
    LoadSteps,
    InTime,
}

/// A body that expands by `stretch`: free but for its planes of symmetry, or held everywhere; in time it begins as it will be.
// One function: the text of a scene.
fn scene(
    kinematics: Kinematics,
    stuff: &Stuff,
    coupling: &str,
    bonds: &str,
    (way, stretch, held): (Way, f64, bool),
) -> String {
    let dimension = kinematics.dimension();
    let axes = &["x", "y", "z"][..dimension];
    // without a seam a family and what holds it are enough
    let cells = match (dimension, coupling) {
        (2, "local" | "nonlocal") => [7, 9, 0],
        (2, _) => [11, 9, 0],
        _ => [7, 7, 7],
    };
    let cells = &cells[..dimension];
    let size: Vec<f64> = cells.iter().map(|n| f64::from(*n) * 0.2).collect();
    let shape = if dimension == 2 { "rectangle" } else { "box" };
    let along = axes.iter().zip(cells);
    let along: String = along
        .map(|(a, n)| format!(", {a} = {{ cells = {n} }}"))
        .collect();
    let mesh = format!(
        "{shape} = {{ min = {:?}, max = {size:?}{along} }}",
        vec![0.0; dimension]
    );
    let zone = match dimension {
        2 => "min = [0.6, 0.6], max = [1.2, 1.2]",
        _ => "min = [0.4, 0.4, 0.4], max = [0.8, 0.8, 0.8]",
    };
    let probe = match coupling {
        "local" | "nonlocal" => size.iter().map(|x| 0.5 * x).collect(),
        _ => vec![if dimension == 2 { 0.9 } else { 0.7 }; dimension],
    };
    let peridynamics = match coupling {
        "local" => String::new(),
        _ => format!("peridynamics = {{ horizon = 0.4, points.lattice.spacing = 0.2{bonds} }}"),
    };
    let zone = match coupling {
        "local" | "nonlocal" => String::new(),
        _ => format!("zones.nonlocal.box = {{ {zone} }}"),
    };
    // over the shear that plane strain adds where nothing but the plane may expand
    let across = match kinematics {
        Kinematics::PlaneStrain => 1.0 + stuff.poisson,
        _ => 1.0,
    };
    let supports: String = match held {
        true => {
            let zero = axes.iter().map(|a| format!("{a} = 0"));
            let zero = zero.collect::<Vec<_>>().join(", ");
            let held = match way {
                // some freedom sets the step in time, away from the family of the probe
                Way::InTime => {
                    let mut top = vec![3.0; dimension];
                    top[dimension - 1] = size[dimension - 1] - 0.15;
                    format!(
                        "box = {{ min = {:?}, max = {top:?} }}",
                        vec![-1.0; dimension]
                    )
                }
                Way::AtRest | Way::LoadSteps => "everywhere = true".to_owned(),
            };
            format!("conditions.all.displacement = {{ inside.{held}, {zero} }}\n")
        }
        false => {
            let faces = ["left", "bottom", "back"];
            let on = faces[..dimension].iter();
            on.map(|face| format!("conditions.{face}.symmetry.on = \"{face}\"\n"))
                .collect()
        }
    };
    let moved = match (way, held) {
        (Way::InTime, false) => {
            let field = axes
                .iter()
                .map(|a| format!("{a} = \"{:?}*{a}\"", across * stretch));
            format!(
                "initial.hot.displacement = {{ {} }}",
                field.collect::<Vec<_>>().join(", ")
            )
        }
        _ => String::new(),
    };
    let heat = stretch / ALPHA;
    let (value, solve) = match way {
        Way::AtRest => (format!("{heat:?}"), ""),
        Way::LoadSteps => (
            format!("{heat:?}*t"),
            "solve.quasi-static = { steps = 2, tolerance = 1e-12, outputs = 1 }",
        ),
        Way::InTime => (
            format!("{heat:?}"),
            "solve.explicit = { duration = 1e-3, outputs = 1 }",
        ),
    };
    format!(
        r#"
kinematics = "{}"
coupling = "{coupling}"
mesh.{mesh}
{}
{peridynamics}
{zone}
temperature = {{ value = "{value}" }}
{supports}
{moved}
{solve}
[output]
vtu = false
stresses = ["von-mises"]
probes.p.at = {probe:?}
"#,
        kinematics.name(),
        stuff
            .text
            .replace(" }", &format!(", thermal-expansion = {ALPHA:?} }}")),
    )
}

/// The scene without its temperature.
fn cold(text: &str) -> String {
    let expands = format!(", thermal-expansion = {ALPHA:?}");
    let lines = text.lines().filter(|line| !line.starts_with("temperature"));
    let lines = lines.collect::<Vec<_>>().join("\n");
    lines.replace(&expands, "")
}

/// The stress at the probe in the end.
fn stress(text: &str, way: Way) -> Vec<(String, f64)> {
    let done = run(text, &[]);
    let (table, prefix) = match way {
        Way::AtRest => ("scene_probes.csv", ""),
        Way::LoadSteps | Way::InTime => ("scene_history.csv", "p_"),
    };
    let (header, rows) = done.table(table);
    let last = rows.last().unwrap();
    let components = ["sxx", "syy", "szz", "sxy", "syz", "sxz"];
    let find = |name: &&str| {
        let at = header.iter().position(|h| *h == format!("{prefix}{name}"));
        at.map(|at| ((*name).to_owned(), last[at]))
    };
    components.iter().filter_map(find).collect()
}

/// The stress that Hooke's law has where the body expands by `stretch`.
fn closed(kinematics: Kinematics, poisson: f64, component: &str, stretch: f64, held: bool) -> f64 {
    let pressed = YOUNG * stretch;
    match (kinematics, component, held) {
        (_, "sxy" | "syz" | "sxz", _) => 0.0,
        (Kinematics::PlaneStress, _, true) => -pressed / (1.0 - poisson),
        (_, _, true) => -pressed / (1.0 - 2.0 * poisson),
        (Kinematics::PlaneStrain, "szz", false) => -pressed,
        (_, _, false) => 0.0,
    }
}

/// True of a body that is displaced as an elastic one would expand, and stressed by what relaxes out of its plane.
fn across_the_plane(kinematics: Kinematics, way: Way) -> bool {
    kinematics == Kinematics::PlaneStrain && way == Way::InTime
}

fn check(kinematics: Kinematics) {
    for stuff in every_law(kinematics).iter().filter(|s| !s.is_variant) {
        let mut ran = 0;
        for (coupling, bonds) in COUPLINGS {
            // seams of solids at rest alone, which takes the longest as it is
            let ways: &[Way] = match (kinematics, coupling) {
                (Kinematics::Solid, "splice" | "truncated") => &[Way::AtRest],
                _ => &[Way::AtRest, Way::LoadSteps, Way::InTime],
            };
            for &way in ways {
                // what relaxes is pressed less and less
                let relaxes = way != Way::AtRest && stuff.text.contains("relax");
                let free = match kinematics {
                    Kinematics::PlaneStrain if NOT_LINEAR.contains(&stuff.key) => HELD,
                    _ => FREE,
                };
                for (stretch, held) in [(free, false), (HELD, true)] {
                    let text = scene(kinematics, stuff, coupling, bonds, (way, stretch, held));
                    // a position-aware solid that relaxes has no truncated bonds, and does not expand in plane strain
                    let is_offered = stuff.key != "pave"
                        || (coupling != "truncated" && kinematics != Kinematics::PlaneStrain);
                    let has_changed = relaxes && (held || across_the_plane(kinematics, way));
                    if has_changed || !is_offered || read(&cold(&text), &[]).is_err() {
                        continue;
                    }
                    // what runs without a temperature runs with it
                    read(&text, &[]).unwrap();
                    ran += 1;
                    for (component, found) in stress(&text, way) {
                        let wanted = closed(kinematics, stuff.poisson, &component, stretch, held);
                        if relaxes && wanted != 0.0 {
                            continue;
                        }
                        // the square of the strain is in what exact bonds and nonlinear laws do
                        let bound = if stretch == HELD { 1e-5 } else { 1e-9 };
                        assert!(
                            (found - wanted).abs() < bound * YOUNG * stretch,
                            "{component} {found:e} {wanted:e} {coupling} {bonds} {way:?} held {held}\n{}",
                            stuff.text
                        );
                    }
                }
            }
        }
        let is_left_out = stuff.key == "pave" && kinematics == Kinematics::PlaneStrain;
        assert_eq!(ran > 0, !is_left_out, "{}", stuff.text);
    }
}

#[test]
fn heated_laws_in_plane_stress() {
    check(Kinematics::PlaneStress);
}

#[test]
fn heated_laws_in_plane_strain() {
    check(Kinematics::PlaneStrain);
}

#[test]
fn heated_laws_of_solids() {
    check(Kinematics::Solid);
}
