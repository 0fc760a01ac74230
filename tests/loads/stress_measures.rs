//! The stress of every law as scenes tell it, at points and in elements, at rest, in load steps and in time: it turns with the body, is that of Hooke's law where strains are small, and
//! none where the body only turns. A law that is added runs here unasked.

use bondline::material::Kinematics;
use bondline::peridynamics::laws::{Named, Parameter, Ratio};

use super::{read, run};

pub(super) const YOUNG: f64 = 1000.0;
const POISSON: f64 = 0.3;

/// Turns by which the stress of exact bonds and of laws for large strains is checked \[degrees\].
const TURNS: [f64; 2] = [20.0, 75.0];

/// One that is small enough for its square to be nothing beside a strain \[rad\].
const SMALL_TURN: f64 = 1e-4;

/// A material of a scene.
pub(super) struct Stuff {
    pub(super) key: &'static str,
    /// It differs from the one before by a word alone.
    pub(super) is_variant: bool,
    pub(super) text: String,
    pub(super) poisson: f64,
}

/// A law that has a key of its own in scenes or is among [`Named`], with usual numbers, and once more for each other word that it can be given.
pub(super) fn every_law(kinematics: Kinematics) -> Vec<Stuff> {
    let pairwise = match kinematics {
        Kinematics::PlaneStress => 1.0 / 3.0,
        _ => 0.25,
    };
    let stuff = |key: &'static str, ratio: Ratio, rest: String| {
        let (poisson, given) = match ratio {
            Ratio::Pairwise => (pairwise, String::new()),
            Ratio::Any => (POISSON, format!(", poisson-ratio = {POISSON}")),
        };
        let rest = if rest.is_empty() {
            rest
        } else {
            format!(", {rest}")
        };
        Stuff {
            key,
            is_variant: false,
            text: format!(
                "materials.m.{key} = {{ youngs-modulus = {YOUNG}, density = 1{given}{rest} }}"
            ),
            poisson,
        }
    };
    let mut all = vec![
        stuff("bond-based", Ratio::Pairwise, String::new()),
        stuff("lps", Ratio::Any, String::new()),
        stuff("correspondence", Ratio::Any, String::new()),
    ];
    for law in Named::ALL {
        if !law.kinematics().contains(&kinematics) {
            continue;
        }
        let value = |p: &Parameter, word: Option<(&str, &str)>| match word {
            Some((key, word)) if key == p.key => format!("{} = \"{word}\"", p.key),
            _ if !p.words.is_empty() => format!("{} = \"{}\"", p.key, p.words[p.usual as usize]),
            _ => format!("{} = {:?}", p.key, p.usual),
        };
        // numbers that have a default may stand against each other
        let numbers = |word| {
            let given = law.parameters().iter();
            let given = given.filter(|p| p.default.is_none() || !p.words.is_empty());
            given.map(|p| value(p, word)).collect::<Vec<_>>().join(", ")
        };
        all.push(stuff(law.key(), law.ratio(), numbers(None)));
        for parameter in law.parameters() {
            for (k, word) in parameter.words.iter().enumerate() {
                // in corners of a lattice no family has all affine fields
                if k != parameter.usual as usize && *word != "affine" {
                    let rest = numbers(Some((parameter.key, word)));
                    all.push(Stuff {
                        is_variant: true,
                        ..stuff(law.key(), law.ratio(), rest)
                    });
                }
            }
        }
    }
    all
}

/// Way in which the body is brought into its last state.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    AtRest,
    LoadSteps,
    InTime,
}

/// The components of a displacement gradient of the unit size.
const GRADIENT: [[f64; 3]; 3] = [[0.9, 0.35, 0.2], [-0.15, 0.5, 0.1], [0.05, -0.3, -0.4]];

/// States that a body goes through, each as the size of its strain and the angle of its turn \[rad\].
type States<'a> = &'a [(f64, f64)];

/// Time from one state to the next: slow enough for what is free not to be thrown about; and one in which no law relaxes.
const PACE: f64 = 1.0;
const SHORT: f64 = 1e-3;

/// A table that holds the value of each state around its time.
fn table(name: &str, values: impl Iterator<Item = f64>, pace: f64) -> String {
    let mut points = vec!["[0, 0]".to_owned()];
    for (k, value) in values.enumerate() {
        let time = pace * (k + 1) as f64;
        points.push(format!("[{:?}, {value:?}]", time - 0.1 * pace));
        points.push(format!("[{:?}, {value:?}]", time + 0.1 * pace));
    }
    format!("tables.{name}.points = [{}]", points.join(", "))
}

/// The scene of a body all of whose displacements are prescribed: strained by `GRADIENT` times the size of each state, and then turned in the plane; at rest it is in the last state.
// One function: the text of a scene.
fn scene(
    kinematics: Kinematics,
    stuff: &Stuff,
    elements: bool,
    bonds: &str,
    way: Way,
    (states, pace): (States<'_>, f64),
) -> String {
    let dimension = kinematics.dimension();
    let last = states[states.len() - 1];
    let (strained, turned) = match way {
        Way::AtRest => (format!("{:?}", last.0), format!("{:?}", last.1)),
        Way::LoadSteps | Way::InTime => ("size(t)".to_owned(), "turn(t)".to_owned()),
    };
    let axes = &["x", "y", "z"][..dimension];
    // (F x)_i, before the turn
    let deformed: Vec<String> = (0..dimension)
        .map(|i| {
            let terms = (0..dimension).map(|j| format!("({:?})*{}", GRADIENT[i][j], axes[j]));
            let sum = terms.collect::<Vec<_>>().join("+");
            format!("({}+{strained}*({sum}))", axes[i])
        })
        .collect();
    let (first, second) = (&deformed[0], &deformed[1]);
    let mut moved = vec![
        format!("cos({turned})*{first}-sin({turned})*{second}-x"),
        format!("sin({turned})*{first}+cos({turned})*{second}-y"),
    ];
    moved.extend(deformed.get(2).map(|z| format!("{z}-z")));
    let moved = axes.iter().zip(moved);
    let moved: String = moved
        .map(|(axis, u)| format!("{axis} = \"{u}\"\n"))
        .collect();
    // some freedom sets the step in time, away from the family of the probe
    let held = match way {
        Way::AtRest | Way::LoadSteps => "everywhere = true",
        Way::InTime => "box = { min = [-1, -1], max = [1, 0.65] }",
    };
    let (mesh, lattice, probe) = match dimension {
        2 => (
            "rectangle = { min = [-0.8, -0.8], max = [0.8, 0.8], x = { cells = 8 }, y = { cells = 8 } }",
            "horizon = 0.5, points = { lattice = { spacing = 0.2, origin = [0.1, 0.1] } }",
            "[0.1, 0.1]",
        ),
        _ => (
            "box = { min = [-0.5, -0.5, -0.5], max = [0.5, 0.5, 0.5], x = { cells = 5 }, y = { cells = 5 }, z = { cells = 5 } }",
            "horizon = 0.5, points = { lattice = { spacing = 0.2, origin = [0, 0, 0] } }",
            "[0, 0, 0]",
        ),
    };
    let (coupling, peridynamics) = match elements {
        true => ("local", String::new()),
        false => ("nonlocal", format!("peridynamics = {{ {lattice}{bonds} }}")),
    };
    let times = (1..=states.len()).map(|k| format!("{:?}", pace * k as f64));
    let times: Vec<String> = times.collect();
    let tables = [
        table("size", states.iter().map(|s| s.0), pace),
        table("turn", states.iter().map(|s| s.1), pace),
    ];
    let solve = match way {
        Way::AtRest => String::new(),
        Way::LoadSteps => format!(
            "{}\n{}\nsolve.quasi-static = {{ steps = [{}], outputs = 1 }}",
            tables[0],
            tables[1],
            times.join(", ")
        ),
        Way::InTime => format!(
            "{}\n{}\nsolve.explicit = {{ duration = {}, outputs = 0, history-interval = {:?} }}",
            tables[0],
            tables[1],
            times[times.len() - 1],
            0.01 * pace
        ),
    };
    format!(
        r#"
kinematics = "{}"
coupling = "{coupling}"
mesh.{mesh}
{}
{peridynamics}
{solve}
[conditions.all.displacement]
inside.{held}
{moved}
[output]
vtu = false
stresses = ["von-mises"]
probes.p.at = {probe}
"#,
        kinematics.name(),
        stuff.text,
    )
}

/// The stress at the probe in each state, at rest in the last one, as a solid has it.
fn stresses(
    text: &str,
    way: Way,
    kinematics: Kinematics,
    (states, pace): (usize, f64),
) -> Vec<[[f64; 3]; 3]> {
    let done = run(text, &[]);
    let (table, prefix) = match way {
        Way::AtRest => ("scene_probes.csv", ""),
        Way::LoadSteps | Way::InTime => ("scene_history.csv", "p_"),
    };
    let (header, rows) = done.table(table);
    let column = |name: &str| header.iter().position(|h| *h == format!("{prefix}{name}"));
    let time = header.iter().position(|h| h == "time");
    let row = |k: usize| {
        let wanted = pace * (k + 1) as f64;
        let away = |row: &&Vec<f64>| time.map_or(0.0, |t| (row[t] - wanted).abs());
        let nearest = rows.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
        nearest.unwrap()
    };
    let of_row = |row: &Vec<f64>| -> [[f64; 3]; 3] {
        let of = |i: usize, j: usize| {
            let name = format!(
                "s{}{}",
                ["x", "y", "z"][i.min(j)],
                ["x", "y", "z"][i.max(j)]
            );
            column(&name).map_or(0.0, |k| row[k])
        };
        let s: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| of(i, j)));
        // a long body tells the stress across it, and the numbers made of the stress know of it
        let mises = row[column("von_mises").unwrap()];
        let apart = |i: usize, j: usize| (s[i][i] - s[j][j]).powi(2) + 6.0 * s[i][j].powi(2);
        let expected = (0.5 * (apart(0, 1) + apart(1, 2) + apart(2, 0))).sqrt();
        let bound = 1e-11 * largest(&s) + 1e-12 * YOUNG;
        assert!(
            (mises - expected).abs() <= bound,
            "{mises} {expected}\n{text}"
        );
        s
    };
    assert!(column("szz").is_some() == (kinematics != Kinematics::PlaneStress));
    let first = if way == Way::AtRest { states - 1 } else { 0 };
    // a motion ends early where what is free in it gains energy
    let last = rows.last().unwrap();
    let is_reached = |k: &usize| {
        let wanted = pace * (k + 1) as f64;
        time.is_none_or(|t| last[t] > wanted - 0.05 * pace)
    };
    let reached = (first..states).take_while(is_reached);
    reached.map(|k| of_row(row(k))).collect()
}

fn turn(s: [[f64; 3]; 3], angle: f64) -> [[f64; 3]; 3] {
    let r = [
        [angle.cos(), -angle.sin(), 0.0],
        [angle.sin(), angle.cos(), 0.0],
        [0.0, 0.0, 1.0],
    ];
    let entry = |i: usize, j: usize| -> f64 {
        let pairs = (0..3).flat_map(|k| (0..3).map(move |l| (k, l)));
        pairs.map(|(k, l)| r[i][k] * s[k][l] * r[j][l]).sum()
    };
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

fn largest(s: &[[f64; 3]; 3]) -> f64 {
    s.iter().flatten().fold(0.0, |m, x| x.abs().max(m))
}

fn difference(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.fold(0.0, |m, (a, b)| (a - b).abs().max(m))
}

/// Hooke's law at `GRADIENT` times `size`.
fn hooke(kinematics: Kinematics, poisson: f64, size: f64) -> [[f64; 3]; 3] {
    let shear = YOUNG / (2.0 * (1.0 + poisson));
    let lambda = match kinematics {
        Kinematics::PlaneStress => YOUNG * poisson / (1.0 - poisson * poisson),
        _ => YOUNG * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)),
    };
    let d = kinematics.dimension();
    let trace: f64 = (0..d).map(|i| size * GRADIENT[i][i]).sum();
    let entry = |i: usize, j: usize| {
        let strain = match i < d && j < d {
            true => 0.5 * size * (GRADIENT[i][j] + GRADIENT[j][i]),
            false => 0.0,
        };
        let across = i == 2 && kinematics == Kinematics::PlaneStress;
        2.0 * shear * strain
            + if i == j && !across {
                lambda * trace
            } else {
                0.0
            }
    };
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// Strain of the body that turns.
const STRAIN: f64 = 2e-3;

/// Checks one law one way; returns how often its stress was seen to turn, none if the scene is refused.
// One function: four states of one body, compared in turn.
fn checked(
    kinematics: Kinematics,
    stuff: &Stuff,
    elements: bool,
    bonds: &str,
    way: Way,
) -> Option<usize> {
    let text = |states: States<'_>, pace: f64| {
        scene(kinematics, stuff, elements, bonds, way, (states, pace))
    };
    let at_pace = |states: States<'_>, pace: f64| match way {
        Way::AtRest => {
            let one = |k: usize| {
                let text = text(&states[k..=k], pace);
                stresses(&text, way, kinematics, (1, pace))[0]
            };
            (0..states.len()).map(one).collect()
        }
        Way::LoadSteps | Way::InTime => {
            let text = text(states, pace);
            stresses(&text, way, kinematics, (states.len(), pace))
        }
    };
    let stresses = |states: States<'_>| at_pace(states, PACE);
    if read(&text(&[(STRAIN, 0.0)], PACE), &[]).is_err() {
        return None;
    }
    let is_exact = !bonds.is_empty();
    let place = || format!("{way:?} elements {elements} {bonds}\n{}", stuff.text);
    let [less, more] = TURNS.map(f64::to_radians);
    // in time what is linear is thrown about by a large turn
    let turns = match way == Way::InTime && !is_exact {
        true => &[(0.0, SMALL_TURN)][..],
        false => &[(0.0, SMALL_TURN), (0.0, less), (0.0, more)],
    };
    let rigid = stresses(turns);
    let small = at_pace(&[(1e-7, 0.0)], SHORT);
    let (Some(small), false) = (small.first(), rigid.is_empty()) else {
        assert!(way == Way::InTime, "{}", place());
        return Some(0);
    };
    // small strains at once: Hooke's law
    let hooke = hooke(kinematics, stuff.poisson, 1e-7);
    let error = difference(small, &hooke) / largest(&hooke);
    let bound = if way == Way::AtRest { 1e-6 } else { 2e-3 };
    assert!(error < bound, "{error:e} {small:?} {hooke:?} {}", place());
    // an infinitesimal turn stresses nothing, to its square
    let bound = match is_exact {
        true => 1e-10,
        false => 2.0 * SMALL_TURN * SMALL_TURN,
    };
    assert!(
        largest(&rigid[0]) < bound * YOUNG,
        "{:?} {}",
        rigid[0],
        place()
    );
    let turns = rigid[1..].iter().all(|s| largest(s) < 1e-10 * YOUNG);
    if rigid.len() == 1 {
        return Some(0);
    }
    if !turns {
        assert!(!is_exact, "{rigid:?} {}", place());
        return Some(0);
    }
    let before = stresses(&[(STRAIN, 0.0); 3]);
    let after = stresses(&[(STRAIN, 0.0), (STRAIN, less), (STRAIN, more)]);
    assert!(way == Way::InTime || after.len() == 3, "{}", place());
    for (k, angle) in [0.0, less, more][..after.len()].iter().copied().enumerate() {
        let wanted = turn(before[k], angle);
        assert!(largest(&wanted) > 1e-5 * YOUNG, "{wanted:?} {}", place());
        let error = difference(&after[k], &wanted) / largest(&wanted);
        assert!(
            error < 1e-10,
            "{error:e} {:?} {wanted:?} {}",
            after[k],
            place()
        );
    }
    Some(1)
}

fn check(kinematics: Kinematics, ways: &[Way]) {
    let mut turned = 0;
    for stuff in every_law(kinematics) {
        let mut ran = false;
        for &way in ways {
            // a word more is tried one way
            if ran && stuff.is_variant {
                break;
            }
            for (elements, bonds) in [(false, ""), (false, ", bonds = \"exact\""), (true, "")] {
                let checked = checked(kinematics, &stuff, elements, bonds, way);
                ran |= checked.is_some();
                turned += checked.unwrap_or(0);
            }
        }
        // a drag resists motion in time alone
        let runs = ways.contains(&Way::InTime) || !stuff.text.contains("drag");
        assert!(ran || !runs, "nothing runs with {}", stuff.text);
    }
    assert!(turned > 8 * ways.len(), "{turned}");
}

#[test]
fn stress_in_plane_stress() {
    check(Kinematics::PlaneStress, &[Way::AtRest, Way::InTime]);
}

#[test]
fn stress_in_plane_strain() {
    check(Kinematics::PlaneStrain, &[Way::LoadSteps, Way::InTime]);
}

#[test]
fn stress_of_solids() {
    check(Kinematics::Solid, &[Way::LoadSteps]);
}
