//! Right scenes, run end to end against closed forms.

use bondline::progress::Silent;
use bondline::run::AnyScene;
use bondline::scene::{Source, Template};

/// Runs a template with overrides; returns the summary and the named CSV as rows of numbers.
fn run(
    template: Template,
    overrides: &[&str],
    csv: &str,
) -> (bondline::observe::summary::RunSummary, Vec<Vec<f64>>) {
    let folder = tempfile::tempdir().unwrap();
    let mut source = Source::new("scene.toml", template.text());
    for o in overrides {
        source.push_override(o).unwrap();
    }
    let mut scene = AnyScene::from_source(&source, folder.path(), "scene").unwrap();
    scene.set_output_directory(folder.path().to_owned());
    let summary = scene.run(&Silent).unwrap();
    assert!(folder.path().join("scene.vtu").exists());
    let text = std::fs::read_to_string(folder.path().join(csv)).unwrap();
    let rows = text
        .lines()
        .skip(1)
        .map(|l| l.split(',').map(|v| v.parse().unwrap()).collect())
        .collect();
    (summary, rows)
}

#[test]
fn a_coupled_bar_stretches_as_a_bar() {
    // F = 1e6 on E A = 200e9: u = 5e-6 x everywhere, and the left end holds -1e6
    for method in [
        "coupling=local",
        "coupling=splice",
        "coupling=blending",
        "coupling=partial-stress",
        "coupling.partial-stress.form=meshfree",
    ] {
        let (summary, rows) = run(Template::Bar, &[method], "scene_axis.csv");
        for row in &rows {
            assert!(
                (row[1] - 5e-6 * row[0]).abs() < 1e-9 * 5e-6,
                "{method}: {row:?}"
            );
            assert!((row[2] - 5e-6).abs() < 1e-9 * 5e-6, "{method}: {row:?}");
        }
        assert!(
            (summary.reactions[0].force[0] + 1e6).abs() < 1e-3,
            "{method}"
        );
        assert!(summary.out_of_balance_relative < 1e-9, "{method}");
    }
}

#[test]
fn a_body_force_hangs_on_its_support() {
    // b per length on a bar of length 1: the support takes -b, the free end moves by b / (2 E)
    let weight = "conditions.right.body-force={x=1e6}";
    // points on the nodes of the mesh: the seam interpolates nothing and quadratic fields pass it to round-off; points at
    // centroids: u is interpolated linearly over one cell, which errs by h² u''/8 in two rows, measured 5.8e-4
    // (splice), 8.3e-4 (blending), 0.7e-4 (partial stress) at h = 1/200
    for (method, points, limit) in [
        ("local", "points.lattice.spacing=\"1/200\"", 1e-11),
        ("splice", "points.lattice.spacing=\"1/200\"", 1e-11),
        ("blending", "points.lattice.spacing=\"1/200\"", 1e-11),
        ("partial-stress", "points.lattice.spacing=\"1/200\"", 1e-11),
        ("splice", "points=\"cells\"", 7e-4),
        ("blending", "points=\"cells\"", 1e-3),
        ("partial-stress", "points=\"cells\"", 1e-4),
    ] {
        let set = [
            weight.to_owned(),
            format!("coupling={method}"),
            format!("peridynamics.{points}"),
        ];
        let set: Vec<&str> = set.iter().map(String::as_str).collect();
        let (summary, rows) = run(Template::Bar, &set, "scene_axis.csv");
        let reaction = summary.reactions[0].force[0];
        assert!(
            (reaction / -1e6 - 1.0).abs() < limit,
            "{method}: {reaction}"
        );
        let end = rows.last().unwrap()[1];
        assert!((end / 2.5e-6 - 1.0).abs() < limit, "{method}: {end}");
    }
}

#[test]
fn a_plate_hangs_together_by_every_method() {
    let small = [
        "mesh.rectangle.x.cells=30",
        "mesh.rectangle.y.cells=30",
        "peridynamics.points.lattice.spacing=1/30",
        "peridynamics.horizon=0.1",
        "mesh.rectangle.cutouts.slit={min=[-0.1,\"-1/30\"],max=[0.1,\"1/30\"]}",
        "voids.slit.inside.box={min=[-0.1,\"-1/30\"],max=[0.1,\"1/30\"]}",
        "output.probes.lip.at=[0,0.05]",
    ];
    let mut lips = Vec::new();
    for method in [
        "coupling=nonlocal",
        "coupling=splice",
        "coupling=blending",
        "coupling=partial-stress",
    ] {
        let mut overrides = small.to_vec();
        overrides.push(method);
        let (summary, rows) = run(Template::Plate, &overrides, "scene_probes.csv");
        assert!(
            summary.out_of_balance_relative < 1e-2,
            "{method}: {}",
            summary.out_of_balance_relative
        );
        lips.push(rows[0][3]);
    }
    // the couplings agree with each other; peridynamics throughout, its horizon a tenth of the plate, is softer along the
    // free edges of the plate, and the lip opens less: measured 6.4 %
    for lip in &lips {
        assert!((lip / lips[1] - 1.0).abs() < 0.08, "{lips:?}");
    }
    for lip in &lips[1..] {
        assert!((lip / lips[1] - 1.0).abs() < 3e-3, "{lips:?}");
    }
}

/// A bar whose horizon varies, with the partial stress in it and no elements around; both ends move by `u = 1e-3 x`.
const VARYING: &str = r#"
kinematics = "bar"
[mesh.line]
min = -1
max = 1
x.cells = 80
[materials.m.lps]
youngs-modulus = 200e9
poisson-ratio = 0.3
[peridynamics]
horizon = "0.15 - 0.05 * max(0, min(1, 4 * abs(x)))"
points.lattice = { spacing = 0.025 }
[zones]
nonlocal.box = { min = [0.9], max = [1] }
transition.everywhere = true
[coupling.partial-stress]
form = "meshfree"
[conditions.left.displacement]
inside.box = { min = [-1], max = [-0.7] }
x = "1e-3 * x"
[conditions.right.displacement]
inside.box = { min = [0.7], max = [1] }
x = "1e-3 * x"
[output]
vtu = false
lines.axis = { from = [-0.7], to = [0.7], samples = 57 }
"#;

#[test]
fn partial_stress_throughout_a_body_needs_no_elements() {
    for form in ["meshfree", "elements"] {
        let folder = tempfile::tempdir().unwrap();
        let mut source = Source::new("scene.toml", VARYING);
        let set = format!("coupling.partial-stress.form={form}");
        source.push_override(&set).unwrap();
        let mut scene = AnyScene::from_source(&source, folder.path(), "scene").unwrap();
        scene.set_output_directory(folder.path().to_owned());
        scene.run(&Silent).unwrap();
        let text = std::fs::read_to_string(folder.path().join("scene_axis.csv")).unwrap();
        let mut rows = 0;
        for line in text.lines().skip(1) {
            let row: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
            // where forces are those of bonds (coupling `nonlocal`) the varying horizon bends this line by up to 3e-6
            assert!((row[1] - 1e-3 * row[0]).abs() < 1e-13, "{form}: {row:?}");
            rows += 1;
        }
        assert_eq!(rows, 57);
    }
}

#[cfg(not(feature = "umat"))]
#[test]
fn a_user_material_needs_its_feature() {
    let material = "materials={ steel = { umat = { library = \"none.so\", youngs-modulus = 200e9, poisson-ratio = 0.3 } } }";
    let folder = tempfile::tempdir().unwrap();
    let mut source = Source::new("scene.toml", Template::Bar.text());
    source.push_override(material).unwrap();
    let Err(error) = AnyScene::from_source(&source, folder.path(), "scene") else {
        panic!("a routine cannot be called");
    };
    let said = error.to_string();
    let parts = [
        "umat` names a routine",
        "built without the feature `umat`",
        "--features umat",
    ];
    assert!(parts.iter().all(|part| said.contains(part)), "{said}");
    assert_eq!(error.underlined(), ["\"none.so\""]);
}
