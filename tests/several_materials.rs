//! Points of several materials, through the command line, against closed forms.

use std::path::Path;
use std::process::{Command, Output};

const LPS: &str = "lps]\npoisson-ratio = 0.3";
const BONDS: &str = "bond-based]";

fn bondline(text: &str, folder: &Path) -> Output {
    let path = folder.join("scene.toml");
    std::fs::write(&path, text).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_bondline"));
    command.arg("run").arg(path).arg("--output").arg(folder);
    command.output().unwrap()
}

/// The rows of a table of a scene that runs, and what the run says.
fn run(text: &str, table: &str) -> (Vec<Vec<f64>>, String) {
    let folder = tempfile::tempdir().unwrap();
    let output = bondline(text, folder.path());
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}\n{said}");
    let rows = std::fs::read_to_string(folder.path().join(format!("scene_{table}.csv"))).unwrap();
    let rows = rows.lines().skip(1);
    let rows = rows.map(|l| l.split(',').map(|v| v.parse().unwrap()).collect());
    (
        rows.collect(),
        String::from_utf8_lossy(&output.stdout).into_owned(),
    )
}

/// The rows of the history of a scene in time, what the run says, and the names of the columns.
fn history(text: &str) -> (Vec<Vec<f64>>, String, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let output = bondline(text, folder.path());
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}\n{said}");
    let table = std::fs::read_to_string(folder.path().join("scene_history.csv")).unwrap();
    let mut lines = table.lines();
    let names = lines.next().unwrap().split(',').map(str::to_owned);
    let rows = lines.map(|l| l.split(',').map(|v| v.parse().unwrap()).collect());
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    (rows.collect(), said, names.collect())
}

fn column(names: &[String], name: &str) -> usize {
    names.iter().position(|n| n == name).unwrap()
}

/// The message of a scene that is refused.
fn refusal(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let output = bondline(text, folder.path());
    assert!(!output.status.success(), "{text}");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let words = said.split(|c: char| c.is_whitespace() || c == '│');
    words
        .filter(|w| !w.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

const FORCE: f64 = 0.001;

/// A bar whose right half is `right` times as stiff as its left one, pulled; the nonlocal zone ends at `end`.
fn bar(law: &str, coupling: &str, cells: usize, right: Option<f64>, end: f64) -> String {
    let h = 1.0 / cells as f64;
    let far = right.map_or(String::new(), |modulus| {
        format!("[materials.right.{law}\nyoungs-modulus = {modulus}\ncells.box = {{ min = 0.5, max = 1 }}\n")
    });
    format!(
        "kinematics = \"bar\"\ncoupling = \"{coupling}\"\n[mesh.line]\nmin = 0\nmax = 1\nx.cells = {cells}\n[materials.left.{law}\nyoungs-modulus = 1\n{far}\
         [peridynamics]\nhorizon = {:?}\npoints.lattice = {{ spacing = {h:?}, origin = {:?} }}\n[zones.nonlocal.box]\nmin = 0.3\nmax = {end}\n\
         [conditions.left.displacement]\non = \"left\"\nx = 0\n[conditions.right.traction]\non = \"right\"\nx = {FORCE}\n\
         [output]\nvtu = false\nlines.axis = {{ from = 0.05, to = 0.95, samples = 19 }}\n",
        3.0 * h,
        0.5 * h
    )
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |m, v| if v.is_nan() { v } else { m.max(v.abs()) })
}

#[test]
fn equal_materials_in_two_groups_are_one() {
    for law in [BONDS, LPS] {
        for coupling in ["nonlocal", "splice", "truncated"] {
            if law == LPS && coupling == "truncated" {
                continue;
            }
            let of = |right| run(&bar(law, coupling, 40, right, 0.7), "axis");
            let ((two, said), (one, _)) = (of(Some(1.0)), of(None));
            assert!(
                said.contains("points of the materials left, right"),
                "{said}"
            );
            let off = two
                .iter()
                .flatten()
                .zip(one.iter().flatten())
                .map(|(a, b)| a - b);
            assert!(largest(off) < 1e-13, "{law} {coupling}");
        }
    }
}

#[test]
fn a_bar_of_two_materials_is_stretched_as_in_series() {
    let exact = |x: f64| FORCE / if x < 0.5 { 1.0 } else { 4.0 };
    for (law, coupling) in [(BONDS, "splice"), (BONDS, "truncated"), (LPS, "splice")] {
        let elongation = |cells: usize| {
            let (rows, _) = run(&bar(law, coupling, cells, Some(4.0), 0.7), "axis");
            // elements: a seam in equilibrium passes nothing on of the layer at the border, one by force what is left of it
            let elements = rows.iter().filter(|r| (r[0] - 0.5).abs() > 0.21);
            let strain = largest(elements.map(|r| r[2] / exact(r[0]) - 1.0));
            let limit = if coupling == "truncated" { 1e-11 } else { 1e-4 };
            assert!(strain < limit, "{law} {coupling} {cells}: {strain}");
            let stretch = rows[17][1] - rows[1][1];
            stretch / (0.4 * (exact(0.0) + exact(1.0))) - 1.0
        };
        let (coarse, fine) = (elongation(50), elongation(100));
        // the layer is as wide as the horizon: of first order
        assert!(fine.abs() < 0.01, "{law} {coupling}: {fine}");
        assert!(
            (coarse / fine - 2.0).abs() < 0.01,
            "{law} {coupling}: {coarse} {fine}"
        );
    }
}

#[test]
fn a_seam_on_the_border_of_two_materials_is_exact() {
    for law in [BONDS, LPS] {
        let (rows, _) = run(&bar(law, "truncated", 40, Some(4.0), 0.5), "axis");
        let exact = |x: f64| FORCE / if x < 0.5 { 1.0 } else { 4.0 };
        let inside = rows.iter().filter(|r| (r[0] - 0.5).abs() > 1e-9);
        let error = largest(inside.map(|r| r[2] / exact(r[0]) - 1.0));
        assert!(error < 1e-11, "{law}: {error}");
    }
    // the rows of a splice would take the strain of the elements for that of the points
    let said = refusal(&bar(BONDS, "splice", 40, Some(4.0), 0.5));
    assert!(said.contains("bonds reach into another material"), "{said}");
}

/// A plate of two layers, the upper one `upper` times as stiff, pulled along them; points fill a box about the middle.
fn layers(coupling: &str, upper: f64) -> String {
    format!(
        "kinematics = \"plane-stress\"\ncoupling = \"{coupling}\"\n[mesh.rectangle]\nmin = [0, 0]\nmax = [40, 32]\nx.spacing = 1\ny.spacing = 1\n\
         [materials.lower.bond-based]\nyoungs-modulus = 1\n[materials.upper.bond-based]\nyoungs-modulus = {upper}\ncells.box = {{ min = [0, 16], max = [40, 32] }}\n\
         [peridynamics]\nhorizon = 2\npoints.lattice = {{ spacing = 1, origin = [0.5, 0.5] }}\n[zones.nonlocal.box]\nmin = [10, 4]\nmax = [30, 28]\n\
         [conditions.left.displacement]\non = \"left\"\nx = 0\n[conditions.right.displacement]\non = \"right\"\nx = 0.04\n[conditions.pin.displacement]\ninside.point = [0, 0]\ny = 0\n\
         [output]\nvtu = false\nlines.across = {{ from = [20.2, 4.7], to = [20.2, 27.7], samples = 24 }}\n"
    )
}

#[test]
fn layers_pulled_along_their_border_keep_one_strain() {
    for coupling in ["truncated", "splice"] {
        let (rows, said) = run(&layers(coupling, 4.0), "across");
        // εx = 0.001, εy = −0.001/3 of both, and bonds across the border pull at its points: a layer that dies away
        let far: Vec<&Vec<f64>> = rows.iter().filter(|r| (r[1] - 16.0).abs() > 8.0).collect();
        assert!(far.len() > 5);
        let along = largest(far.iter().map(|r| r[4] / 1e-3 - 1.0));
        let across = largest(far.iter().map(|r| (r[6] + 1e-3 / 3.0) / 1e-3));
        assert!(
            along < 5e-3 && across < 5e-3,
            "{coupling}: {along} {across}\n{said}"
        );
    }
    // one elasticity, and no layer
    let (rows, _) = run(&layers("truncated", 1.0), "across");
    let error = largest(rows.iter().map(|r| r[4] / 1e-3 - 1.0));
    assert!(error < 1e-10, "{error}");
}

/// A pulse that runs into a half of nine times the modulus and the same density.
fn wave(law: &str) -> String {
    format!(
        "kinematics = \"bar\"\ncoupling = \"nonlocal\"\n[mesh.line]\nmin = 0\nmax = 800\nx.cells = 800\n[materials.left.{law}\nyoungs-modulus = 1\ndensity = 1\n\
         [materials.right.{law}\nyoungs-modulus = 9\ndensity = 4\ncells.box = {{ min = 400, max = 800 }}\n\
         [peridynamics]\nhorizon = 3\npoints.lattice = {{ spacing = 1, origin = 0.5 }}\n\
         [initial.shape.displacement]\nx = \"1e-3 * exp(-((x - 200) / 30)^2)\"\n\
         [initial.motion.velocity]\nx = \"1e-3 * 2 * (x - 200) / 900 * exp(-((x - 200) / 30)^2)\"\n\
         [solve.explicit]\nduration = 320\noutputs = 1\nhistory-interval = 0.5\n[output]\nvtu = false\nprobes.before = {{ at = 340.5 }}\nprobes.behind = {{ at = 475.5 }}\n"
    )
}

#[test]
fn a_pulse_at_the_border_is_sent_back_by_the_impedances() {
    // Z = √(E ρ): 1 and 6; reflected (1 − 6)/(1 + 6), passed on 2/(1 + 6)
    for law in [BONDS, LPS] {
        let (rows, said, names) = history(&wave(law));
        let of = |name: &str| {
            let place = column(&names, name);
            rows.iter().map(move |r| r[place] / 1e-3)
        };
        // the pulse goes by, and what is sent back has the other sign
        let back = of("before_ux").fold(0.0, f64::min);
        let on = of("behind_ux").fold(0.0, f64::max);
        assert!((back + 5.0 / 7.0).abs() < 1e-3, "{law}: {back}\n{said}");
        assert!((on - 2.0 / 7.0).abs() < 1e-3, "{law}: {on}\n{said}");
    }
}

/// A square of two materials that is torn apart in motion.
fn torn(law: &str, interface: &str) -> String {
    format!(
        "kinematics = \"plane-stress\"\ncoupling = \"nonlocal\"\n[mesh.rectangle]\nmin = [0, 0]\nmax = [24, 12]\nx.spacing = 1\ny.spacing = 1\n\
         [materials.a.{law}\nyoungs-modulus = 1\ndensity = 1\nfracture-energy = 1e-2\n[materials.b.{law}\nyoungs-modulus = 3\ndensity = 2\nfracture-energy = 2e-2\ncells.box = {{ min = [12, 0], max = [24, 12] }}\n\
         {interface}[peridynamics]\nhorizon = 3\npoints.lattice = {{ spacing = 1, origin = [0.5, 0.5] }}\n\
         [initial.apart.velocity]\nx = \"0.02 * (x - 12)\"\n[solve.explicit]\nduration = 60\nstep-fraction = 0.1\noutputs = 1\n[output]\nvtu = false\n"
    )
}

#[test]
fn the_energy_of_two_materials_that_tear_is_accounted_for() {
    let weak = "[interfaces.glue]\nbetween = [\"b\", \"a\"]\nfracture-energy = 1e-3\n";
    for law in [BONDS, "lps]\npoisson-ratio = 0.35"] {
        let (rows, said, columns) = history(&torn(law, weak));
        assert!(
            said.contains("those between a and b break at the stretch"),
            "{said}"
        );
        let sum = |row: &Vec<f64>| {
            let names = ["kinetic_energy", "stored_energy", "dissipated_energy"];
            names
                .map(|name| row[column(&columns, name)])
                .iter()
                .sum::<f64>()
        };
        let (first, last) = (sum(&rows[0]), sum(rows.last().unwrap()));
        assert!((last / first - 1.0).abs() < 1e-3, "{law}: {first} {last}");
        let of_last = |name: &str| rows.last().unwrap()[column(&columns, name)];
        assert!(of_last("broken_bonds") > 0.0, "{law}");
        // begun with Σ m v, and no force from outside
        let gained = of_last("momentum_x") - rows[0][column(&columns, "momentum_x")];
        assert!(gained.abs() < 1e-11, "{law}: {gained}");
    }
}

#[test]
fn what_materials_do_not_share_is_refused_by_name() {
    let plain = bar(BONDS, "nonlocal", 40, Some(4.0), 0.7);
    let mixed = plain.replace(
        "[materials.right.bond-based]",
        "[materials.right.lps]\npoisson-ratio = 0.3",
    );
    let said = refusal(&mixed);
    assert!(
        said.contains("`left` (bond-based) and `right` (linear peridynamic solid)"),
        "{said}"
    );
    let said = refusal(&plain.replace(
        "[materials.right.bond-based]",
        "[materials.right.bond-based]\nmicromodulus = \"inverted-triangular\"",
    ));
    assert!(
        said.contains("depend on the distance in different ways"),
        "{said}"
    );
    let interface =
        |keys: &str| format!("{plain}[interfaces.glue]\nbetween = [\"left\", \"right\"]\n{keys}\n");
    let said = refusal(&interface("fracture-energy = 1\ncritical-stretch = 1"));
    assert!(said.contains("at once"), "{said}");
    let said = refusal(&interface("").replace("\"left\", \"right\"", "\"left\", \"rihgt\""));
    assert!(said.contains("names the material `rihgt`"), "{said}");
    let said = refusal(&interface("").replace("\"left\", \"right\"", "\"left\", \"left\""));
    assert!(said.contains("twice"), "{said}");
    let said = refusal(&format!(
        "{}[interfaces.other]\nbetween = [\"right\", \"left\"]\n",
        interface("")
    ));
    assert!(said.contains("same two materials"), "{said}");
    let solid = interface("stiffness = \"arithmetic-mean\"").replace(BONDS, LPS);
    assert!(refusal(&solid).contains("force states of their own"));
    let blended = plain
        .replace("coupling = \"nonlocal\"", "coupling = \"blending\"")
        .replace(
            "[conditions.left",
            "[zones.transition]\naround = 0.1\n[conditions.left",
        );
    assert!(refusal(&blended).contains("the coupling is `blending`"));
    let said = refusal(&bar(LPS, "truncated", 40, Some(4.0), 0.7));
    assert!(said.contains("the coupling is `truncated`"), "{said}");
    let said = refusal(&plain.replace("min = 0.5, max = 1 }", "min = 2, max = 3 }"));
    assert!(said.contains("holds no cell"), "{said}");
}

#[test]
fn results_name_the_material_of_points_that_have_several() {
    for (right, is_named) in [(Some(4.0), true), (None, false)] {
        let folder = tempfile::tempdir().unwrap();
        let text = bar(BONDS, "nonlocal", 40, right, 0.7).replace("vtu = false", "vtu = true");
        assert!(bondline(&text, folder.path()).status.success());
        let vtu = std::fs::read(folder.path().join("scene.vtu")).unwrap();
        let field = b"Name=\"material\"";
        let is_found = vtu.windows(field.len()).any(|bytes| bytes == field);
        assert_eq!(is_found, is_named);
    }
}
