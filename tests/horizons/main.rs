//! Horizons that change within a body of points: rows by hand, affine fields, balance of forces, waves, and bonds that break on either side.

use bondline::assembly::Row;
use bondline::observe::summary::RunSummary;
use bondline::progress::Silent;
use bondline::run::AnyScene;
use bondline::scene::Source;
use bondline::tensor::Vector;
use bondline_verify::meshes::scene::model;
use nalgebra::{DMatrix, DVector};

mod motion;

/// A finished run.
struct Done {
    summary: RunSummary,
    folder: tempfile::TempDir,
}

impl Done {
    /// A column of a table.
    fn column(&self, csv: &str, name: &str) -> Vec<f64> {
        let text = std::fs::read_to_string(self.folder.path().join(csv)).unwrap();
        let mut lines = text.lines();
        let header: Vec<&str> = lines.next().unwrap().split(',').collect();
        let at = header.iter().position(|h| *h == name);
        let at = at.unwrap_or_else(|| panic!("no column {name} in {header:?}"));
        let value = |line: &str| line.split(',').nth(at).unwrap().parse().unwrap();
        lines.map(value).collect()
    }
}

fn read(text: &str, overrides: &[&str]) -> Result<AnyScene, String> {
    let mut source = Source::new("scene.toml", text);
    for o in overrides {
        source.push_override(o).map_err(|e| format!("{e:?}"))?;
    }
    AnyScene::from_source(&source, std::path::Path::new("."), "scene").map_err(|e| e.to_string())
}

fn run(text: &str, overrides: &[&str]) -> Done {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = read(text, overrides).unwrap();
    scene.set_output_directory(folder.path().to_owned());
    let summary = scene
        .run(&Silent)
        .unwrap_or_else(|e| panic!("{overrides:?}: {e}"));
    Done { summary, folder }
}

/// A scene is refused with a message that has each of `parts`.
fn refused(text: &str, overrides: &[&str], parts: &[&str]) {
    let error = match read(text, overrides) {
        Err(error) => error,
        Ok(scene) => scene.run(&Silent).unwrap_err().to_string(),
    };
    let error = error.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in parts {
        assert!(
            error.contains(part),
            "{overrides:?}: {part} is not in {error}"
        );
    }
}

/// Points of the bar, half a spacing from its ends.
const POINTS: usize = 120;
const SPACING: f64 = 0.05;

/// A bar whose horizon is four spacings on the left and two on the right, held over layers at its ends as if its strain were 1.
const BAR: &str = r#"
kinematics = "bar"
coupling = "nonlocal"
mesh.line = { min = 0, max = 6, x = { cells = 120 } }
materials.m.bond-based = { youngs-modulus = 1 }
peridynamics = { horizon = "if(x < 3, 0.2, 0.1)", points.lattice = { spacing = 0.05, origin = 0.025 }, volumes = "full" }
conditions.left.displacement = { inside.box = { min = -1, max = 0.5 }, x = "x" }
conditions.right.displacement = { inside.box = { min = 5.5, max = 7 }, x = "x" }
output = { vtu = false, lines.all = { from = 0.025, to = 5.975, samples = 120 } }
"#;

fn spacings(point: usize) -> usize {
    if point < POINTS / 2 { 4 } else { 2 }
}

/// The force per relative displacement that a point with a horizon of m spacings gives the bond to its k-th neighbour, both halves of the bond by one rule: the micromodulus
/// c/|ξ|³ makes it fall with 1/k, and the tensions of all bonds over a cut, k of each length, add up to E ε.
fn stiffness(m: usize, k: usize, weights: &str) -> f64 {
    let sum: usize = (1..=m).sum();
    // with plain weights the integral of the continuum stands for the sum
    let sum = match weights {
        "plain" => 0.5 * (m * m) as f64,
        _ => sum as f64,
    };
    match k <= m {
        true => 1.0 / (SPACING * sum * k as f64),
        false => 0.0,
    }
}

/// The stiffness of the bar by hand.
fn by_hand(rule: &str, weights: &str) -> DMatrix<f64> {
    let stiffness = |m: usize, k: usize| stiffness(m, k, weights);
    let bond = |i: usize, j: usize| {
        let (k, m, n) = (i.abs_diff(j), spacings(i), spacings(j));
        match rule {
            "dual" => 0.5 * (stiffness(m, k) + stiffness(n, k)),
            "splice" => stiffness(m, k),
            _ if m == n => stiffness(m, k),
            // eq. (7) of the multi-horizon paper at the end with the smaller horizon
            _ => {
                let fine = if m < n { i } else { j };
                let pull = |horizon: usize| -> f64 {
                    let far = (0..POINTS).filter(|&q| spacings(q) > spacings(fine));
                    far.map(|q| stiffness(horizon, q.abs_diff(fine)) * q.abs_diff(fine) as f64)
                        .sum()
                };
                match pull(2) {
                    0.0 => 0.0,
                    own => own / pull(4) * stiffness(4, k),
                }
            }
        }
    };
    let mut matrix = DMatrix::zeros(POINTS, POINTS);
    for i in 0..POINTS {
        for j in (0..POINTS).filter(|&j| j != i && j.abs_diff(i) <= 4) {
            matrix[(i, j)] = -bond(i, j);
            matrix[(i, i)] += bond(i, j);
        }
    }
    matrix
}

/// The bar in equilibrium by its rows, and by the program; the largest strain less 1.
fn strain_by_hand(rule: &str, weights: &str, found: &[f64]) -> f64 {
    let place = |i: usize| (i as f64 + 0.5) * SPACING;
    let is_held = |i: &usize| !(0.5..=5.5).contains(&place(*i));
    let (held, free): (Vec<usize>, Vec<usize>) = (0..POINTS).partition(is_held);
    let matrix = by_hand(rule, weights);
    let inner = matrix.select_rows(&free).select_columns(&free);
    let outer = matrix.select_rows(&free).select_columns(&held);
    let ends = DVector::from_iterator(held.len(), held.iter().map(|&i| place(i)));
    let wanted = inner.lu().solve(&(-outer * ends)).unwrap();
    let mut strain: f64 = 0.0;
    for (k, &i) in free.iter().enumerate() {
        let error = (found[i] - wanted[k]).abs();
        assert!(error < 1e-11, "{rule} {i}: {} {}", found[i], wanted[k]);
        if k > 0 {
            strain = strain.max(((wanted[k] - wanted[k - 1]) / SPACING - 1.0).abs());
        }
    }
    strain
}

#[test]
fn a_bar_of_two_horizons_has_the_rows_of_its_rule() {
    for (rule, ghost_strain) in [("dual", 0.360), ("multi-horizon", 0.254), ("splice", 0.0)] {
        let set = format!("peridynamics.horizon-change={rule}");
        let done = run(BAR, &[&set]);
        let strain = strain_by_hand(rule, "isotropic", &done.column("scene_all.csv", "ux"));
        assert!((strain - ghost_strain).abs() < 1e-3, "{rule}: {strain}");
        let told = &done.summary.choices;
        let of_rule = format!("\"{rule}\"");
        assert!(told.iter().any(|c| c.choice.contains(&of_rule)), "{told:?}");
        let warns = done.summary.warnings.iter();
        let mut warns = warns.filter(|w| w.to_string().contains("where the horizon changes"));
        assert_eq!(warns.next().is_some(), rule != "splice");
        let plain = run(BAR, &[&set, "peridynamics.weights=plain"]);
        strain_by_hand(rule, "plain", &plain.column("scene_all.csv", "ux"));
    }
}

/// A plate of two horizons with a strip of a third along a slanted border.
fn plate(law: &str, rule: &str, spacing: f64) -> String {
    format!(
        r#"
kinematics = "plane-stress"
coupling = "nonlocal"
mesh.rectangle = {{ min = [0, 0], max = [2, 1.5], x = {{ spacing = 0.1 }}, y = {{ spacing = 0.1 }} }}
materials.m.{law}
peridynamics = {{ horizon = "if(x + 0.5 * y < 1.2, 0.31, 0.21)", points.lattice = {{ spacing = {spacing} }}, volumes = "full", horizon-change = "{rule}" }}
conditions.rim.displacement = {{ inside.without = {{ from.everywhere = true, removed.box = {{ min = [0.65, 0.65], max = [1.35, 0.85] }} }}, x = "2e-3*x + 1e-3*y", y = "5e-4*x - 1e-3*y" }}
output = {{ vtu = false, lines.across = {{ from = [0.1, 0.75], to = [1.9, 0.75], samples = 19 }} }}
"#
    )
}

const BOND_BASED: &str = "bond-based = { youngs-modulus = 1 }";
const SOLID: &str = "lps = { youngs-modulus = 1, poisson-ratio = 0.2 }";

#[test]
fn a_splice_of_horizons_passes_affine_fields() {
    for law in [BOND_BASED, SOLID] {
        let done = run(&plate(law, "splice", 0.1), &[]);
        let (x, ux, uy) = (
            done.column("scene_across.csv", "x"),
            done.column("scene_across.csv", "ux"),
            done.column("scene_across.csv", "uy"),
        );
        for (k, x) in x.iter().enumerate() {
            assert!((ux[k] - (2e-3 * x + 7.5e-4)).abs() < 1e-14, "{law} {x}");
            assert!((uy[k] - (5e-4 * x - 7.5e-4)).abs() < 1e-14, "{law} {x}");
        }
    }
}

#[test]
fn forces_of_dual_and_multi_horizon_balance_and_those_of_a_splice_do_not() {
    for law in [BOND_BASED, SOLID] {
        for rule in ["dual", "multi-horizon", "splice"] {
            let laid = model::<2>(&plate(law, rule, 0.1), &[]).unwrap();
            let operator = laid.coupling.operator(&laid.model).unwrap();
            let sites = laid.model.sites.len();
            // a displacement without any symmetry
            let u: Vec<f64> = (0..2 * sites)
                .map(|k| (1.7 * (k * k) as f64).sin())
                .collect();
            let mut row = Row::<2>::new(sites);
            let (mut sum, mut moment, mut size) = (Vector::<2>::zeros(), 0.0, 0.0);
            for (site, s) in laid.model.sites.iter().enumerate() {
                operator.add_row(site, &mut row);
                let [f] = row.take_products([&u]);
                let x = s.position;
                sum += f;
                moment += x[0] * f[1] - x[1] * f[0];
                size += f.norm();
            }
            let left = sum.amax().max(f64::abs(moment)) / size;
            let is_pair = rule != "splice";
            assert_eq!(left < 1e-13, is_pair, "{law} {rule}: {left:e}");
        }
    }
}

#[test]
fn two_lattices_are_spliced_without_elements_between() {
    let bar = r#"
kinematics = "bar"
mesh.line = { min = 0, max = 10, x = { spacing = 0.1 } }
materials.m.bond-based = { youngs-modulus = 1, density = 1 }
peridynamics = { horizon = 0.3, points.lattice.spacing = 0.1 }
zones = { nonlocal.box = { min = 2, max = 8 }, bodies.fine = { inside.box = { min = 4, max = 6 }, horizon = 0.15, spacing = 0.05 } }
coupling = "splice"
conditions.left.displacement = { on = "left", x = 0 }
conditions.right.displacement = { on = "right", x = 0.01 }
output = { vtu = false, lines.all = { from = 0, to = 10, samples = 401 } }
"#;
    let done = run(bar, &[]);
    let x = done.column("scene_all.csv", "x");
    for (x, u) in x.iter().zip(done.column("scene_all.csv", "ux")) {
        assert!((u - 1e-3 * x).abs() < 1e-14, "{x}: {u}");
    }
    let sum: f64 = done.summary.reactions.iter().map(|r| r.force[0]).sum();
    assert!(sum.abs() < 1e-13, "{sum:e}");
    // in two dimensions, with a lattice that does not meet the other's points
    let plate = r#"
kinematics = "plane-strain"
mesh.rectangle = { min = [0, 0], max = [2, 2], x = { cells = 20 }, y = { cells = 20 } }
materials.m.lps = { youngs-modulus = 1, poisson-ratio = 0.3 }
peridynamics = { horizon = 0.21, points.lattice.spacing = 0.1 }
zones = { nonlocal.box = { min = [0.5, 0.5], max = [1.5, 1.5] }, bodies.fine = { inside.box = { min = [0.8, 0.8], max = [1.2, 1.2] }, horizon = 0.1, spacing = 0.04 } }
coupling = "splice"
conditions.left.displacement = { on = "left", x = "1e-3*x + 2e-3*y", y = "3e-3*y" }
conditions.right.displacement = { on = "right", x = "1e-3*x + 2e-3*y", y = "3e-3*y" }
conditions.bottom.displacement = { on = "bottom", x = "1e-3*x + 2e-3*y", y = "3e-3*y" }
conditions.top.displacement = { on = "top", x = "1e-3*x + 2e-3*y", y = "3e-3*y" }
output = { vtu = false, lines.all = { from = [0.1, 1.03], to = [1.9, 1.03], samples = 61 } }
"#;
    let done = run(plate, &[]);
    let x = done.column("scene_all.csv", "x");
    let (ux, uy) = (
        done.column("scene_all.csv", "ux"),
        done.column("scene_all.csv", "uy"),
    );
    for (k, x) in x.iter().enumerate() {
        assert!((ux[k] - (1e-3 * x + 2.06e-3)).abs() < 1e-13, "{x}");
        assert!((uy[k] - 3.09e-3).abs() < 1e-13, "{x}");
    }
}

#[test]
fn elements_carry_a_partial_stress_without_a_zone_of_points() {
    // free sides, and elements of the body around: the field of uniaxial stress passes
    let plate = r#"
kinematics = "plane-stress"
mesh.rectangle = { min = [0, 0], max = [2, 1], x = { cells = 40 }, y = { cells = 20 } }
materials.m.lps = { youngs-modulus = 1, poisson-ratio = 0.3 }
peridynamics = { horizon = "0.1 + 0.02 * x", points.lattice.spacing = 0.05, influence = { degree = 1, alpha = 1 } }
zones.transition.box = { min = [0.5, 0.2], max = [1.5, 0.8] }
coupling.partial-stress.form = "elements"
conditions.left.displacement = { on = "left", x = 0 }
conditions.bottom.symmetry = { on = "bottom" }
conditions.right.displacement = { on = "right", x = 0.01 }
output = { vtu = false, lines.all = { from = [0.1, 0.5], to = [1.9, 0.5], samples = 19 } }
"#;
    let done = run(plate, &[]);
    let x = done.column("scene_all.csv", "x");
    let (ux, uy) = (
        done.column("scene_all.csv", "ux"),
        done.column("scene_all.csv", "uy"),
    );
    for (k, x) in x.iter().enumerate() {
        assert!((ux[k] - 5e-3 * x).abs() < 1e-11, "{x}: {}", ux[k]);
        assert!((uy[k] + 0.3 * 5e-3 * 0.5).abs() < 1e-11, "{x}: {}", uy[k]);
    }
}

/// Largest strain in a bar of variable horizon that is held as if its strain were 1, less 1.
fn ghost_strain(overrides: &[&str]) -> f64 {
    let bar = r#"
kinematics = "bar"
coupling = "nonlocal"
mesh.line = { min = 0, max = 12, x = { spacing = 0.04 } }
materials.m.bond-based = { youngs-modulus = 1 }
peridynamics = { horizon = "0.4+0.4*(3*min(1,max(0,(x-4.5)/3))^2-2*min(1,max(0,(x-4.5)/3))^3)", points.lattice = { spacing = 0.04, origin = 0.02 } }
conditions.left.displacement = { inside.box = { min = -1, max = 1.2 }, x = "x" }
conditions.right.displacement = { inside.box = { min = 10.8, max = 13 }, x = "x" }
output = { vtu = false, lines.all = { from = 0.02, to = 11.98, samples = 300 } }
"#;
    let done = run(bar, overrides);
    let u = done.column("scene_all.csv", "ux");
    let strain = u.windows(2).map(|u| ((u[1] - u[0]) / 0.04 - 1.0).abs());
    strain.fold(0.0, f64::max)
}

#[test]
fn whole_cells_are_not_the_default_where_a_horizon_varies() {
    let (default, exact, full) = (
        ghost_strain(&[]),
        ghost_strain(&["peridynamics.volumes=exact"]),
        ghost_strain(&["peridynamics.volumes=full"]),
    );
    assert_eq!(default, exact);
    assert!(default < 0.5 * full, "{default} {full}");
}

#[test]
fn rules_that_do_not_fit_are_refused_by_name() {
    let rule = |rule: &str| format!("peridynamics.horizon-change={rule}");
    let one = "peridynamics.horizon=0.2";
    refused(
        BAR,
        &[one, &rule("splice")],
        &["all points have one horizon"],
    );
    refused(BAR, &[&rule("layer")], &["`nonlocal`", "zones.bodies.NAME"]);
    refused(
        BAR,
        &[&rule("partial-stress")],
        &["coupling = \"partial-stress\""],
    );
    let many = "peridynamics.horizon=0.2 - 0.01 * x";
    for name in ["splice", "multi-horizon"] {
        refused(BAR, &[many, &rule(name)], &["values at the points", name]);
    }
    let fitted = "peridynamics.weights=fitted";
    let full = "peridynamics.volumes=full";
    refused(
        BAR,
        &[fitted, full, &rule("multi-horizon")],
        &["fitted weights"],
    );
    let contact = "contact={}";
    refused(BAR, &[contact, &rule("splice")], &["`contact`"]);
    let law = "materials.m={correspondence={youngs-modulus=1,poisson-ratio=0}}";
    refused(
        BAR,
        &[law, &rule("splice")],
        &["correspondence", "`bond-based` or `lps`"],
    );
}
