//! Bodies whose points come from a file.

use std::path::Path;

use bondline::progress::Silent;
use bondline::run::Solution;

use super::{read, refused};

/// A strip of points that are pulled apart, notched from below.
const STRIP: &str = r#"
kinematics = "plane-stress"
coupling = "nonlocal"
materials.plate.lps = { youngs-modulus = 200, poisson-ratio = 0.3, fracture-energy = 0.01 }
peridynamics = { horizon = 0.151, POINTS }
conditions.left.displacement = { inside.box = { min = [0, 0], max = [0.15, 1] }, x = 0, y = 0 }
conditions.right.displacement = { inside.box = { min = [1.85, 0], max = [2, 1] }, x = "0.05*t", y = 0 }
cracks.notch.segment = { from = [1.0, -0.1], to = [1.0, 0.31] }
solve.quasi-static.steps = [0.1, 0.2, 0.25, 0.3, 0.4, 0.5, 0.7, 0.9, 1]
"#;

/// A number between −1/2 and 1/2.
fn random(state: &mut u64) -> f64 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
}

/// A file of the centres of 40 by 20 squares with the edge 1/20, each moved by up to half of `jitter` edges, the columns in another order than the axes.
fn plate(folder: &Path, jitter: f64) -> String {
    let (h, mut state) = (0.05, 7);
    let mut text = String::from("# a plate\nid;volume;y;x\n");
    for k in 0..800 {
        let [x, y] = [k % 40, k / 40].map(|i| h * (i as f64 + 0.5 + jitter * random(&mut state)));
        text += &format!("{k};{};{y};{x}\n", h * h);
    }
    written(folder, "plate.csv", &text)
}

/// The key of the points of a file.
fn written(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    format!("points.file.path = {:?}", path.display().to_string())
}

fn solved(text: &str, overrides: &[&str]) -> Solution {
    read(text, overrides).unwrap().solve(&Silent).unwrap()
}

/// The same lattice, from a file and laid out over a mesh, up to the crack that runs through.
#[test]
fn a_lattice_from_a_file_is_that_lattice() {
    let folder = tempfile::tempdir().unwrap();
    let from_file = STRIP.replace("POINTS", &plate(folder.path(), 0.0));
    let lattice = "points.lattice = { spacing = 0.05, origin = [0.025, 0.025] }";
    let laid_out = STRIP.replace("POINTS", lattice)
        + "mesh.rectangle = { min = [0, 0], max = [2, 1], x = { cells = 40 }, y = { cells = 20 } }\n";
    let [one, other] = [&from_file, &laid_out].map(|text| solved(text, &[]));
    let broken = one.history("broken_bonds").unwrap();
    assert!(broken[9] > 400.0, "{broken:?}");
    for column in ["right_reaction_x", "stored_energy", "dissipated_energy"] {
        let [one, other] = [&one, &other].map(|s| s.history(column).unwrap());
        let largest = other.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        for (k, (a, b)) in one.iter().zip(&other).enumerate() {
            // a crack multiplies what rounding leaves
            let tolerance = if broken[k] == 0.0 { 1e-9 } else { 1e-3 };
            assert!(
                (a - b).abs() < tolerance * largest,
                "{column}, {k}: {a} {b}"
            );
        }
    }
    let force = one.history("right_reaction_x").unwrap();
    let peak = force.iter().fold(0.0, |m: f64, f| m.max(*f));
    assert!(force[9].abs() < 1e-3 * peak, "{force:?}");
}

/// A cloud of points, not a lattice, from its file to two pieces.
#[test]
fn a_cloud_breaks_in_two() {
    let folder = tempfile::tempdir().unwrap();
    let text = STRIP.replace("POINTS", &plate(folder.path(), 0.4));
    let done = solved(&text, &[]);
    let force = done.history("right_reaction_x").unwrap();
    let peak = force.iter().fold(0.0, |m: f64, f| m.max(*f));
    // a few bonds may still join splinters
    assert!(peak > 1.0 && force[9].abs() < 0.03 * peak, "{force:?}");
    // over the ligament of 0.69; the lattice dissipates 1.41 times the fracture energy
    let dissipated = done.history("dissipated_energy").unwrap()[9];
    assert!(
        (1.0..1.6).contains(&(dissipated / (0.01 * 0.69))),
        "{dissipated}"
    );
}

/// `W = ½ E ε² (L − 2δ/3)` of a bar of constant micromodulus `2E/δ²` without bonds beyond its ends, against 400 points in segments of lengths from 0.4 to 1.7
/// of the mean. Which bonds are within the horizon is a matter of chance; it moves the sum by 0.25 % of itself, as its standard deviation.
#[test]
fn a_cloud_stores_the_energy_of_the_bar() {
    let folder = tempfile::tempdir().unwrap();
    let mut state = 3;
    let mut length =
        |k: i32| (1.0 + 0.5 * (f64::from(k) / 10.0).sin()) * (1.0 + 0.4 * random(&mut state));
    let lengths: Vec<f64> = (0..400).map(&mut length).collect();
    let scale = 4.0 / lengths.iter().sum::<f64>();
    let (mut low, mut text) = (0.0, String::from("s length\n"));
    for length in lengths.iter().map(|l| l * scale) {
        text += &format!("{} {length}\n", low + 0.5 * length);
        low += length;
    }
    let points = written(folder.path(), "bar.csv", &text);
    let points = points.replace(".path = ", " = { x = \"s\", volume = \"length\", path = ");
    let scene = format!(
        r#"
kinematics = "bar"
materials.bar.bond-based = {{ youngs-modulus = 5, density = 1 }}
peridynamics = {{ horizon = 0.2, weights = "plain", bonds = "linear", {points} }} }}
initial.pull.displacement.x = "0.01*x"
solve.explicit = {{ duration = 1e-9, outputs = 1 }}
"#
    );
    let done = solved(&scene, &[]);
    let energy = done.history("stored_energy").unwrap()[0];
    let exact = 0.5 * 5.0 * 0.01 * 0.01 * (4.0 - 2.0 * 0.2 / 3.0);
    assert!((energy / exact - 1.0).abs() < 0.01, "{energy} {exact}");
    assert_eq!(done.summary().sizes.points, 400);
}

#[test]
fn points_of_vtk_are_points() {
    let fixture = |name: &str| {
        let path = format!("{}/../../tests/fixtures/{name}", env!("CARGO_MANIFEST_DIR"));
        format!("points.file = {{ path = {path:?}, volume = \"area\" }}")
    };
    for name in ["points_vtk.vtu", "points_vtk.vtk"] {
        let text = STRIP.replace("POINTS", &fixture(name));
        let set = [
            "peridynamics.horizon=1",
            "cracks={}",
            "solve=static",
            "conditions.left.displacement.inside.box.max=[0.3,1]",
            "conditions.right.displacement={inside.box={min=[1,0],max=[2,1]},x=0.01,y=0}",
            "peridynamics.bonds=linear",
            "materials.plate={lps={youngs-modulus=200,poisson-ratio=0.3}}",
        ];
        let done = solved(&text, &set);
        assert_eq!(done.points().len(), 6, "{name}");
        let u = done.displacement().unwrap();
        // halfway between the supports
        assert!((u[1][0] - 0.005).abs() < 1e-12, "{name}: {u:?}");
    }
}

#[test]
fn clouds_that_are_none_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let case = |text: &str, overrides: &[&str], parts: &[&str]| {
        let points = written(folder.path(), "cloud.csv", text);
        refused(&STRIP.replace("POINTS", &points), overrides, parts);
    };
    case(
        "x,y,Volume\n0,0,1\n",
        &[],
        &[
            "cloud.csv, line 1",
            "no column `volume`",
            "did you mean `Volume`",
        ],
    );
    case(
        "0,0,1\n",
        &[],
        &["line 1: no column `x`", "the first line names the columns"],
    );
    case("", &[], &["cloud.csv has no line", "name the columns"]);
    case("x,y,volume\n", &[], &["cloud.csv has no point"]);
    case(
        "x,y,volume\n\n0,nan,1\n",
        &[],
        &["line 3: the coordinate NaN is not finite"],
    );
    case(
        "x,y,volume\n0,0,0\n",
        &[],
        &["line 2: the volume 0", "finite area"],
    );
    case("x,y,volume\n0,0,-1\n", &[], &["line 2: the volume -1"]);
    case("x,y,volume\n0,0,inf\n", &[], &["line 2: the volume inf"]);
    case(
        "x,y,volume\n0,0\n",
        &[],
        &["line 2: 2 entries under 3 columns"],
    );
    case("x,y,volume\n0,o,1\n", &[], &["line 2: `o` is no number"]);
    case(
        "x,y,volume\n0,0,1\n2,0,1\n0,1e-9,1\n",
        &[],
        &["line 4: the point lies at [0.0, 1e-9], where that of line 2 lies"],
    );
}

#[test]
fn points_of_a_file_go_without_a_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let good = "x,y,volume\n0.1,0.2,0.01\n1.9,0.2,0.01\n";
    let points = written(folder.path(), "cloud.csv", good);
    let scene = STRIP.replace("POINTS", &points);
    refused(
        &scene,
        &["mesh.rectangle={min=[0,0],max=[1,1],x={cells=1},y={cells=1}}"],
        &["the whole body", "a `mesh` too", "leave out [mesh]"],
    );
    refused(
        &scene,
        &["coupling=splice"],
        &["a coupling with finite elements", "nonlocal"],
    );
    refused(
        &scene,
        &["zones=auto"],
        &["a zone that is placed by itself"],
    );
    refused(
        &scene,
        &["peridynamics.surfaces=cut"],
        &["surfaces that cut bonds", "a void or a crack"],
    );
    refused(
        &scene,
        &["peridynamics.volumes=hhb"],
        &["`peridynamics.volumes` is partial", "those of a file"],
    );
    refused(
        &scene,
        &["peridynamics.points.file.path=nothing.csv"],
        &["nothing.csv cannot be read", "relative to the scene"],
    );
    refused(
        &scene,
        &["peridynamics.points.file.path=nothing.vtu"],
        &["nothing.vtu"],
    );
    refused(
        &scene,
        &["conditions.left.traction={on=\"left\",x=1}"],
        &["left"],
    );
    refused(
        &STRIP.replace("POINTS", "surfaces = \"cut\""),
        &[],
        &["the scene lacks `mesh`", "points.file"],
    );
}

/// Of a lattice whose horizon reaches 3 spacings, a crack between two layers cuts from the point beside it the bonds to 11 of 28 points: 5, 5 and 1 in the
/// layers beyond.
#[test]
fn damage_counts_what_cracks_of_the_scene_cut() {
    let lattice = "points.lattice = { spacing = 0.05, origin = [0.025, 0.025] }";
    let text = STRIP.replace("POINTS", lattice)
        + "mesh.rectangle = { min = [0, 0], max = [2, 1], x = { cells = 40 }, y = { cells = 20 } }\n";
    let done = solved(&text, &["solve.quasi-static={steps=[1e-3]}"]);
    let damage = done.field("damage").unwrap();
    let broken = done.history("broken_bonds").unwrap();
    assert_eq!(broken.last(), Some(&0.0));
    let at = |x: f64, y: f64| {
        let is_it = |p: &[f64; 3]| (p[0] - x).abs() + (p[1] - y).abs() < 1e-9;
        damage[done.points().iter().position(is_it).unwrap()]
    };
    // offsets (i, j) with i² + j² ≤ 9 and i from `first` on
    let beyond = |first: i32| {
        let all = (-3..=3).flat_map(|i| (-3..=3).map(move |j| (i, j)));
        let family = all.filter(|(i, j)| (1..=9).contains(&(i * i + j * j)));
        let (mut cut, mut whole) = (0, 0);
        for (i, _) in family {
            whole += 1;
            cut += i32::from(i >= first);
        }
        f64::from(cut) / f64::from(whole)
    };
    for (k, x) in [0.975, 0.925, 0.875, 0.825].into_iter().enumerate() {
        let wanted = beyond(k as i32 + 1);
        // deep enough below the tip that all bonds across are cut, and off the lower edge
        assert!(
            (at(x, 0.175) - wanted).abs() < 1e-12,
            "{x}: {} {wanted}",
            at(x, 0.175)
        );
        assert!((at(2.0 - x, 0.175) - wanted).abs() < 1e-12);
    }
    assert_eq!(at(1.025, 0.875), 0.0);
    let none = solved(&text, &["solve.quasi-static={steps=[1e-3]}", "cracks={}"]);
    assert!(none.field("damage").unwrap().iter().all(|d| *d == 0.0));
}

/// Heads and numbers of tables as other programs write them.
#[test]
fn tables_of_points_are_read_as_they_are_written_or_refused_with_the_line() {
    const PULLED: &str = r#"
kinematics = "bar"
coupling = "nonlocal"
materials.bar.bond-based.youngs-modulus = 5
peridynamics = { horizon = 0.3, POINTS }
conditions.low.displacement = { inside.box = { min = [0], max = [0.3] }, x = 0 }
conditions.high.displacement = { inside.box = { min = [1.7], max = [2] }, x = 0.01 }
"#;
    let folder = tempfile::tempdir().unwrap();
    let rows = |between: &str| -> String {
        let row = |k: i32| format!("{:.2}{between}0.1\n", 0.05 + 0.1 * f64::from(k));
        (0..20).map(row).collect()
    };
    let scene = |text: &[u8]| {
        let path = folder.path().join("bar.csv");
        std::fs::write(&path, text).unwrap();
        let points = format!("points.file.path = {:?}", path.display().to_string());
        PULLED.replace("POINTS", &points)
    };
    // numpy writes the names of columns behind #; some editors end lines in a carriage return alone
    for text in [
        format!("x,volume\n{}", rows(",")),
        format!("# x,volume\n{}", rows(",")),
        format!("# made by hand\n\n#x volume\n{}", rows(" ")),
        format!("# a comment\nx;volume\n{}", rows(";")),
        format!("\"x\";\"volume\"\n{}", rows(";")),
        format!("x\tvolume\n{}", rows("\t")).replace('\n', "\r\n"),
        format!("x,volume\n{}", rows(",")).replace('\n', "\r"),
    ] {
        let done = solved(&scene(text.as_bytes()), &[]);
        let largest = done.frames().last().unwrap().displacement().unwrap();
        let largest = largest.iter().fold(0.0, |m: f64, u| m.max(u[0]));
        assert!((largest - 0.01).abs() < 1e-12, "{text}");
    }
    let cases: [(&[u8], &[&str]); 6] = [
        (
            b"x;volume\n0,05;0,1\n",
            &["line 2: `0,05` is no number", "a decimal point"],
        ),
        (
            b"x,x,volume\n0.05,1,0.1\n",
            &["line 1: two columns `x`", "a name of its own"],
        ),
        (
            b"x,gr\xf6\xdfe,volume\n",
            &["cannot be read", "save it as text in UTF-8"],
        ),
        (b"# nothing\n", &["has no line", "name the columns"]),
        (
            b"#x,volume\n0.05,nan\n",
            &["line 2: the volume NaN", "length above zero"],
        ),
        (
            b"0.05,0.1\n",
            &["line 1: no column `x` among [\"0.05\", \"0.1\"]"],
        ),
    ];
    for (text, parts) in cases {
        refused(&scene(text), &[], parts);
    }
}
