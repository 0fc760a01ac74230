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

/// A body of points alone and beside elements, in every dimension; `D` axes of 6 cells of the edge 0.5.
const BODIES: [(&str, &str, usize); 3] = [
    (
        "bar",
        "mesh.line = { min = 0, max = 3, x = { cells = 6 } }",
        1,
    ),
    (
        "plane-stress",
        "mesh.rectangle = { min = [0, 0], max = [3, 3], x = { cells = 6 }, y = { cells = 6 } }",
        2,
    ),
    (
        "solid",
        "mesh.box = { min = [0, 0, 0], max = [3, 3, 3], x = { cells = 6 }, y = { cells = 6 }, z = { cells = 6 } }",
        3,
    ),
];

/// The solution of a body that is pulled along x, with points shown in a form.
fn shown(kinematics: &str, mesh: &str, more: &str, form: &str) -> bondline::run::Solution {
    let text = format!(
        "kinematics = \"{kinematics}\"\n{mesh}\n{more}\n[materials.m.bond-based]\nyoungs-modulus = 1\n[conditions.held.displacement]\non = \"left\"\nx = 0\n[conditions.pulled.displacement]\non = \"right\"\nx = 0.01\n{}{}[output]\npoints = \"{form}\"\n",
        if kinematics == "bar" {
            ""
        } else {
            "[conditions.low.displacement]\non = \"left\"\ny = 0\n"
        },
        if kinematics == "solid" {
            "[conditions.back.displacement]\non = \"left\"\nz = 0\n"
        } else {
            ""
        },
    );
    let source = Source::new("shown.toml", &text);
    let scene = AnyScene::from_source(&source, std::path::Path::new(""), "shown").unwrap();
    scene.solve(&Silent).unwrap()
}

#[test]
fn cells_of_points_fill_the_body_and_have_the_values_of_their_points() {
    for (kinematics, mesh, dimension) in BODIES {
        // points halfway between the nodes of a mesh of the same spacing: their cells are those of the mesh, beside elements too
        let zone = match dimension {
            1 => "box = { min = 0, max = 1.5 }",
            2 => "box = { min = [0, 0], max = [1.5, 3] }",
            _ => "box = { min = [0, 0, 0], max = [1.5, 3, 3] }",
        };
        let origin = vec!["0.25"; dimension].join(", ");
        for coupling in ["nonlocal", "truncated"] {
            let more = format!(
                "coupling = \"{coupling}\"\nperidynamics = {{ horizon = 1, points.lattice = {{ spacing = 0.5, origin = [{origin}] }} }}\nzones.nonlocal = {{ {zone} }}"
            );
            let cells = shown(kinematics, mesh, &more, "cells");
            let points = shown(kinematics, mesh, &more, "vertices");
            // both have one cell per element and point with the same fields
            let (cells, points) = (cells.snapshot(), points.snapshot());
            assert_eq!(cells.cell_fields, points.cell_fields);
            assert_eq!(cells.shapes.len(), 6usize.pow(dimension as u32));
            // read back as a mesh by the reader of meshes: no cell is folded, and together they are the body
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("shown.vtu");
            bondline::observe::vtu::write_vtu(&path, cells, Default::default()).unwrap();
            let volumes = match dimension {
                1 => volumes_of::<1>(&path),
                2 => volumes_of::<2>(&path),
                _ => volumes_of::<3>(&path),
            };
            let whole = 0.5f64.powi(dimension as i32);
            assert_eq!(volumes.len(), cells.shapes.len());
            assert!(volumes.iter().all(|v| (v / whole - 1.0).abs() < 1e-12));
            let told = cells.cell_fields.iter().find(|f| f.name == "volume");
            let bondline::observe::vtu::Values::Real(told) = &told.unwrap().values else {
                panic!("volumes are numbers");
            };
            assert!(told.iter().all(|v| (v / whole - 1.0).abs() < 1e-12));
            corners_agree(cells, points);
        }
    }
}

/// Volumes of the cells of a file, all above zero or it is not read.
fn volumes_of<const D: usize>(path: &std::path::Path) -> Vec<f64> {
    let mesh = bondline::mesh::read::read::<D>(path).unwrap();
    let cells = 0..mesh.cell_count();
    cells
        .map(|c| bondline::fem::cell_volume(&mesh, c))
        .collect()
}

/// Cell by cell, the mean of the corners is the point, and each corner has the point's values.
fn corners_agree(
    cells: &bondline::observe::vtu::Snapshot,
    points: &bondline::observe::vtu::Snapshot,
) {
    use bondline::mesh::CellShape;
    use bondline::observe::vtu::Values;
    let (mut at, mut of) = (0, 0);
    let mut compared = 0;
    for (shape, other) in cells.shapes.iter().zip(&points.shapes) {
        let corners = &cells.connectivity[at..at + shape.node_count()];
        let nodes = &points.connectivity[of..of + other.node_count()];
        at += shape.node_count();
        of += other.node_count();
        if *other != CellShape::Vertex {
            assert_eq!(corners, nodes, "elements stay");
            continue;
        }
        let point = nodes[0] as usize;
        for axis in 0..3 {
            let sum: f64 = corners
                .iter()
                .map(|&n| cells.points[n as usize][axis])
                .sum();
            let mean = sum / corners.len() as f64;
            assert!((mean - points.points[point][axis]).abs() < 1e-12);
        }
        for (field, one) in cells.point_fields.iter().zip(&points.point_fields) {
            let (Values::Real(field), Values::Real(values), n) =
                (&field.values, &one.values, one.components)
            else {
                continue;
            };
            for &corner in corners {
                assert_eq!(
                    field[corner as usize * n..][..n],
                    values[point * n..][..n],
                    "{}",
                    one.name
                );
                compared += 1;
            }
        }
    }
    assert!(compared > 0);
}

#[test]
fn points_at_centroids_are_shown_as_the_cells_of_the_mesh() {
    let mesh = "mesh.rectangle = { min = [0, 0], max = [3, 3], x = { cells = 6 }, y = { cells = 5 }, cell = \"tri3\" }";
    let more = "coupling = \"nonlocal\"\nperidynamics = { horizon = 1.6, points = \"cells\" }";
    let solution = shown("plane-stress", mesh, more, "cells");
    let snapshot = solution.snapshot();
    assert!(
        snapshot
            .shapes
            .iter()
            .all(|s| *s == bondline::mesh::CellShape::Tri3)
    );
    let folder = tempfile::tempdir().unwrap();
    solution.write_vtu(folder.path().join("c.vtu")).unwrap();
    let volumes = volumes_of::<2>(&folder.path().join("c.vtu"));
    assert_eq!(volumes.len(), 60);
    assert!((volumes.iter().sum::<f64>() - 9.0).abs() < 1e-12);
    let told = solution.cell_field("volume").unwrap();
    assert!(volumes.iter().zip(told).all(|(a, b)| (a - b).abs() < 1e-12));
}

#[test]
fn what_helps_at_a_surface_is_what_the_scene_can_have() {
    let warnings = |overrides: &[&str]| -> Result<String, bondline::SceneError> {
        let text = r#"
kinematics = "plane-stress"
coupling = "truncated"
[mesh.rectangle]
min = [0, 0]
max = [1, 0.5]
x = { cells = 40 }
y = { cells = 20 }
[materials.plate.bond-based]
youngs-modulus = 1
[peridynamics]
horizon = 0.075
points.lattice = { spacing = 0.025, origin = [0.0125, 0.0125] }
[zones.nonlocal]
box = { min = [0, 0.1], max = [1, 0.4] }
[conditions.held.displacement]
on = "bottom"
x = 0
y = 0
[conditions.pulled.traction]
on = "top"
y = 1e-3
"#;
        let mut source = Source::new("plate.toml", text);
        for o in overrides {
            source.push_override(o)?;
        }
        let scene = AnyScene::from_source(&source, std::path::Path::new(""), "plate")?;
        let solution = scene.solve(&Silent).unwrap();
        let warnings = solution.summary().warnings.iter();
        Ok(warnings
            .map(ToString::to_string)
            .collect::<Vec<_>>()
            .join("\n"))
    };
    let skin = "zones.skin=free-surfaces";
    let inside = "cracks.c.segment={from=[0.3,0.25],to=[0.5,0.25]}";
    let told = warnings(&[inside]).unwrap();
    assert!(told.contains("zones.skin = \"free-surfaces\""), "{told}");
    let helped = warnings(&[inside, skin]).unwrap();
    assert!(!helped.contains("at a surface"), "{helped}");
    // a crack that comes in through the surface: elements there are refused, so they are not advised
    let edge = "cracks.c.segment={from=[-0.1,0.25],to=[0.3,0.25]}";
    let told = warnings(&[edge]).unwrap();
    assert!(
        told.contains("at a surface") && told.contains("a smaller horizon"),
        "{told}"
    );
    assert!(!told.contains("zones.skin"), "{told}");
    assert!(warnings(&[edge, skin]).is_err());
}

#[test]
fn an_error_of_a_run_knows_its_place() {
    // two cracks cut the bar into three, and only the left end is held
    let text = r#"
kinematics = "bar"
coupling = "splice"
mesh.line = { min = 0, max = 1, x = { cells = 50 } }
materials.bar.bond-based.youngs-modulus = 2
peridynamics = { horizon = 0.06, points.lattice = { spacing = 0.02 } }
zones.nonlocal.box = { min = 0.4, max = 0.6 }
cracks.a.point = 0.49
cracks.b.point = 0.51
conditions.left.displacement = { on = "left", x = 0 }
conditions.right.traction = { on = "right", x = 1e-3 }
"#;
    let source = Source::new("bar.toml", text);
    let scene = AnyScene::from_source(&source, std::path::Path::new(""), "bar").unwrap();
    let error = scene.solve(&Silent).unwrap_err();
    // the first site of the two pieces, in the order of sites: the node where the elements on the right begin
    assert_eq!(
        error.place().as_deref(),
        Some("(6.0000e-1, 0.0000e0, 0.0000e0)"),
        "{error}"
    );
}

/// A cantilever of plane strain whose free end is pulled down, in cells of one kind.
fn cantilever(cell: &str, poisson_ratio: f64) -> (f64, Vec<String>) {
    let text = format!(
        r#"
kinematics = "plane-strain"
coupling = "local"
[mesh.rectangle]
min = [0, 0]
max = [10, 2]
x = {{ cells = 40 }}
y = {{ cells = 8 }}
cell = "{cell}"
[materials.rubber.lps]
youngs-modulus = 200
poisson-ratio = {poisson_ratio}
[conditions.wall.displacement]
on = "left"
x = 0
y = 0
[conditions.end.traction]
on = "right"
y = -1e-3
[output]
vtu = false
probes.tip = {{ at = [10, 1] }}
"#
    );
    let folder = tempfile::tempdir().unwrap();
    let source = Source::new("scene.toml", text);
    let mut scene = AnyScene::from_source(&source, folder.path(), "scene").unwrap();
    scene.set_output_directory(folder.path().to_owned());
    let summary = scene.run(&Silent).unwrap();
    let table = std::fs::read_to_string(folder.path().join("scene_probes.csv")).unwrap();
    let (names, row) = table.split_once('\n').unwrap();
    let column = names.split(',').position(|n| n == "uy").unwrap();
    let tip = row.trim().split(',').nth(column).unwrap().parse().unwrap();
    let warnings = summary.warnings.into_iter();
    (tip, warnings.map(|warning| warning.message).collect())
}

#[test]
fn elements_of_first_order_that_lock_are_warned_of() {
    // P L³/(3 E′ I) and the shear of a beam: P = 2e-3, I = 8/12, E′ = E/(1 − ν²)
    let of_beam = |nu: f64| {
        let (p, inertia, shear) = (2e-3, 8.0 / 12.0, 200.0 / (2.0 * (1.0 + nu)));
        let bend = p * 1e3 / (3.0 * 200.0 / (1.0 - nu * nu) * inertia);
        -(bend + 1.2 * p * 10.0 / (shear * 2.0))
    };
    for (cell, nu, low, high) in [
        ("quad4", 0.3, 0.97, 1.02),
        ("quad4", 0.45, 0.9, 0.95),
        ("quad4", 0.49, 0.7, 0.85),
        ("quad4", 0.4999, 0.05, 0.1),
        ("quad8", 0.4999, 0.94, 1.02),
    ] {
        let (tip, warnings) = cantilever(cell, nu);
        let part = tip / of_beam(nu);
        println!("{cell}, {nu}: {part:.3}");
        assert!((low..high).contains(&part), "{cell}, {nu}: {part}");
        let locks = warnings.iter().any(|w| w.contains("volumetric locking"));
        assert_eq!(
            locks,
            cell == "quad4" && nu > 0.45,
            "{cell}, {nu}: {warnings:?}"
        );
    }
}
