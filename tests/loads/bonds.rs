//! Bonds as lines of a VTU file: their number against that of a lattice, their stretch against an affine field, and those that break against the history.

use std::path::Path;

use vtkio::model::{Attribute, DataSet, Vtk};

use super::{read, refused, run};

/// A block of 16 by 10 points with the spacing 0.5 and m = 3, all of which a field moves.
const BLOCK: &str = r#"
kinematics = "plane-strain"
coupling = "nonlocal"
mesh.rectangle = { min = [0, 0], max = [8, 5], x = { cells = 16 }, y = { cells = 10 } }
materials.plate.bond-based.youngs-modulus = 200
peridynamics = { horizon = 1.5, points.lattice = { spacing = 0.5, origin = [0.25, 0.25] } }
conditions.field.displacement = { inside.box = { min = [0, 0], max = [8, 5] }, x = "0.02*x + 0.03*y", y = "-0.01*x + 0.005*y" }
output.probes.middle.at = [4.2, 2.3]
output.bonds.all.inside.everywhere = true
output.bonds.some.inside.box = { min = [3, 2], max = [4, 3] }
output.bonds.one.probe = "middle"
"#;

/// A line of a file: its ends as they are and as they are moved, length, stretch, broken.
struct Line {
    ends: [[f64; 3]; 2],
    moved: [[f64; 3]; 2],
    length: f64,
    stretch: f64,
    is_broken: bool,
}

fn lines(path: &Path) -> Vec<Line> {
    let DataSet::UnstructuredGrid { pieces, .. } = Vtk::import(path).unwrap().data else {
        panic!("no cells");
    };
    let piece = pieces.into_iter().next().unwrap();
    let piece = piece.into_loaded_piece_data(Some(path)).unwrap();
    let points: Vec<f64> = piece.points.cast_into().unwrap();
    let field = |fields: &[Attribute], name: &str| -> Vec<f64> {
        let mut all = fields.iter().filter_map(|attribute| match attribute {
            Attribute::DataArray(array) if array.name == name => Some(array.data.clone()),
            _ => None,
        });
        all.next().unwrap().cast_into().unwrap()
    };
    let moved = field(&piece.data.point, "displacement");
    let [length, stretch, broken] =
        ["length", "stretch", "broken"].map(|name| field(&piece.data.cell, name));
    let kinds: Vec<u8> = piece.cells.types.iter().map(|&t| t as u8).collect();
    assert!(kinds.iter().all(|kind| *kind == 3), "{kinds:?}");
    let (nodes, _) = piece.cells.cell_verts.into_xml();
    let at = |n: u64, k: usize| points[3 * n as usize + k];
    let of = |(c, ends): (usize, &[u64])| Line {
        ends: [0, 1].map(|e| std::array::from_fn(|k| at(ends[e], k))),
        moved: [0, 1]
            .map(|e| std::array::from_fn(|k| at(ends[e], k) + moved[3 * ends[e] as usize + k])),
        length: length[c],
        stretch: stretch[c],
        is_broken: broken[c] == 1.0,
    };
    nodes.chunks_exact(2).enumerate().map(of).collect()
}

fn apart([a, b]: &[[f64; 3]; 2]) -> f64 {
    (0..3).map(|k| (b[k] - a[k]).powi(2)).sum::<f64>().sqrt()
}

/// Offsets of half of a family of m spacings in the plane.
fn half_family(m: i64) -> impl Iterator<Item = (i64, i64)> {
    let all = (0..=m).flat_map(move |a| (-m..=m).map(move |b| (a, b)));
    all.filter(move |(a, b)| a * a + b * b <= m * m && (*a > 0 || *b > 0))
}

#[test]
fn a_lattice_has_its_bonds_and_each_the_stretch_of_the_field() {
    let done = run(BLOCK, &[]);
    let of = |name: &str| lines(&done.folder.path().join(format!("scene_bonds_{name}.vtu")));
    let all = of("all");
    let count: i64 = half_family(3).map(|(a, b)| (16 - a) * (10 - b.abs())).sum();
    assert_eq!(all.len() as i64, count);
    for line in &all {
        let length = apart(&line.ends);
        assert!((line.length - length).abs() < 1e-14 && length < 1.5 + 1e-9);
        // of F ξ, F = I + ∇u
        let [a, b] = line.ends;
        let (x, y) = (b[0] - a[0], b[1] - a[1]);
        let after = (1.02 * x + 0.03 * y).hypot(-0.01 * x + 1.005 * y);
        assert!(
            (line.stretch - (after / length - 1.0)).abs() < 1e-14,
            "{}",
            line.stretch
        );
        assert!((apart(&line.moved) - after).abs() < 1e-14);
        assert!(!line.is_broken);
    }
    // the whole family of a point, of which no bond stands twice
    assert_eq!(of("one").len(), 28);
    assert!(
        of("one")
            .iter()
            .all(|line| line.ends.contains(&[4.25, 2.25, 0.0]))
    );
    // four points: 28 each, less those between two of them
    assert_eq!(of("some").len(), 4 * 28 - 6);
    let told = done.summary.choices.iter().map(|c| &c.choice);
    let told: Vec<&String> = told.filter(|c| c.contains("output.bonds")).collect();
    assert!(
        told[0].contains(&format!("{} bonds", grouped(count))),
        "{told:?}"
    );
    let files = done.summary.files.iter();
    assert_eq!(
        files
            .filter(|f| f.display().to_string().contains("_bonds_"))
            .count(),
        3
    );
}

fn grouped(count: i64) -> String {
    bondline::observe::report::grouped(count as usize)
}

/// In three dimensions, of a point at the edge of a zone: those between points, whatever the seam does with the others.
#[test]
fn bonds_into_elements_are_no_lines() {
    let block = r#"
kinematics = "solid"
mesh.box = { min = [0, 0, 0], max = [7, 7, 7], x = { cells = 7 }, y = { cells = 7 }, z = { cells = 7 } }
materials.block.bond-based.youngs-modulus = 200
peridynamics = { horizon = 2, points.lattice = { spacing = 1, origin = [0.5, 0.5, 0.5] } }
zones.nonlocal.box = { min = [2, 2, 2], max = [5, 5, 5] }
conditions.low.displacement = { on = "left", x = 0, y = 0, z = 0 }
conditions.high.displacement = { on = "right", x = 0.07, y = 0, z = 0 }
output.probes.middle.at = [2.6, 3.5, 3.5]
output.bonds.one.probe = "middle"
"#;
    for coupling in ["splice", "truncated"] {
        let done = run(block, &[&format!("coupling={coupling}")]);
        let found = lines(&done.folder.path().join("scene_bonds_one.vtu"));
        // a² + b² + c² ≤ 4 with a from 0 to 2, b and c from −1 to 1: 8, 9 and 1
        assert_eq!(found.len(), 18, "{coupling}");
        let within = |x: &f64| (2.0..5.0).contains(x);
        let mut ends = found.iter().flat_map(|line| line.ends).flatten();
        assert!(ends.all(|x| within(&x)), "{coupling}");
    }
}

/// Bonds of a bar that parts: those of the last file are as many as the history has, which counts each direction.
#[test]
fn broken_bonds_are_those_of_the_history() {
    let bar = r#"
kinematics = "plane-stress"
coupling = "nonlocal"
mesh.rectangle = { min = [0, 0], max = [20, 6], x = { cells = 20 }, y = { cells = 6 } }
materials.plate.bond-based = { youngs-modulus = 200, critical-stretch = 0.01, density = 1 }
peridynamics = { horizon = 3.01, points.lattice.spacing = 1 }
conditions.low.displacement = { inside.box = { min = [0, 0], max = [3, 6] }, x = 0, y = 0 }
conditions.high.velocity = { inside.box = { min = [17, 0], max = [20, 6] }, x = 1, y = 0 }
cracks.notch.segment = { from = [10, -1], to = [10, 2] }
output.bonds.all.inside.everywhere = true
solve.explicit = { duration = 0.6, outputs = 3 }
"#;
    let done = run(bar, &[]);
    let file = |k: usize| {
        done.folder
            .path()
            .join(format!("scene_bonds_all_{k:04}.vtu"))
    };
    let broken = done.column("scene_history.csv", "broken_bonds");
    let last = lines(&file(3));
    let counted = last.iter().filter(|line| line.is_broken).count();
    assert!(counted > 10);
    assert_eq!(2.0 * counted as f64, *broken.last().unwrap());
    let first = lines(&file(0));
    assert!(first.iter().all(|line| !line.is_broken) && first.len() == last.len());
    // those across the notch are no bonds
    let crosses = |line: &Line| {
        let [a, b] = line.ends;
        (a[0] - 10.0) * (b[0] - 10.0) < 0.0 && a[1].max(b[1]) < 2.0
    };
    assert!(!first.iter().any(crosses));
    let list = std::fs::read_to_string(done.folder.path().join("scene_bonds_all.pvd")).unwrap();
    assert_eq!(list.matches("scene_bonds_all_").count(), 4);
}

#[test]
fn bonds_that_are_not_there_are_refused_by_name() {
    let local = "coupling=local";
    refused(
        BLOCK,
        &[local],
        &[
            "`output.bonds.all`",
            "a local scene",
            "leave `output.bonds` out",
        ],
    );
    refused(
        BLOCK,
        &["output.vtu=false"],
        &["`output.bonds.all`", "without VTU files"],
    );
    let typo = ["output.bonds.one.probe=middel"];
    refused(
        BLOCK,
        &typo,
        &["no probe `middel`", "did you mean `middle`?"],
    );
    let beside = ["output.bonds.some.inside.box={min=[9,9],max=[10,10]}"];
    refused(
        BLOCK,
        &beside,
        &["`output.bonds.some.inside` holds no part of the mesh"],
    );
    refused(
        BLOCK,
        &["output.bonds.one={}"],
        &["`output.bonds.one` is empty", "`inside`, `probe`"],
    );
    refused(
        BLOCK,
        &["output.bonds.one.everywhere=true"],
        &["`output.bonds.one`"],
    );
    // a place without points is known once there are points
    let coupled = [
        "coupling=splice",
        "zones.nonlocal.box={min=[4,0],max=[8,5]}",
    ];
    for (key, part) in [
        (
            "output.bonds={far={inside={box={min=[0,0],max=[1,1]}}}}",
            "no peridynamic point lies inside",
        ),
        (
            "output={probes={p={at=[0.5,0.5]}},bonds={far={probe='p'}}}",
            "within a horizon of the probe",
        ),
    ] {
        let scene = read(BLOCK, &[coupled[0], coupled[1], key]).unwrap();
        let error = scene
            .solve(&bondline::progress::Silent)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("`output.bonds.far`") && error.contains(part),
            "{error}"
        );
    }
}

/// A picture of an inclusion in a matrix, which VTK has written, with a notch that points at its lower part.
const PICTURE: &str = r#"
kinematics = "plane-stress"
coupling = "nonlocal"
mesh.file.path = "MESHES/../tests/fixtures/inclusion.vti"
peridynamics = { horizon = "3.01/40", points = "cells" }
materials.matrix.bond-based = { youngs-modulus = 1, density = 1, fracture-energy = 1e-4, cells.set = "phase_1" }
materials.inclusion.bond-based = { youngs-modulus = 4, density = 1, fracture-energy = 5e-3, cells.set = "phase_2" }
conditions.low.velocity = { inside.box = { min = [0, 0], max = [1, 0.08] }, x = 0, y = "-0.003*min(1, t/2)" }
conditions.high.velocity = { inside.box = { min = [0, 0.92], max = [1, 1] }, x = 0, y = "0.003*min(1, t/2)" }
cracks.notch.segment = { from = [-0.1, 0.5], to = [0.2, 0.5] }
output.bonds.all.inside.everywhere = true
solve.explicit = { duration = 5, outputs = 1 }
"#;

/// The crack of the matrix runs straight on, through the place of the inclusion; a stiff and tough inclusion makes it pass below.
#[test]
fn a_crack_passes_below_the_inclusion_of_a_picture() {
    // 0.15 around (0.55, 0.54)
    let inclusion = |[x, y, _]: [f64; 3]| (x - 0.55).hypot(y - 0.54) < 0.15;
    let broken = |overrides: &[&str]| -> Vec<Line> {
        let done = run(PICTURE, overrides);
        let file = done.folder.path().join("scene_bonds_all_0001.vtu");
        let all = lines(&file).into_iter();
        all.filter(|line| line.is_broken).collect()
    };
    let heights = |broken: &[Line]| -> Vec<f64> {
        let middles = broken
            .iter()
            .map(|Line { ends: [a, b], .. }| [0, 1].map(|k| 0.5 * (a[k] + b[k])));
        let beside = middles.filter(|[x, _]| (0.53..0.57).contains(x));
        beside.map(|[_, y]| y).collect()
    };
    let two = broken(&[]);
    assert!(
        !two.iter()
            .any(|line| line.ends.iter().all(|x| inclusion(*x)))
    );
    let below = heights(&two);
    assert!(
        below.len() > 20 && below.iter().all(|y| *y < 0.4),
        "{below:?}"
    );
    let alike = [
        "materials.inclusion.bond-based.youngs-modulus=1",
        "materials.inclusion.bond-based.fracture-energy=1e-4",
    ];
    let one = heights(&broken(&alike));
    let mean = one.iter().sum::<f64>() / one.len() as f64;
    assert!(
        one.len() > 20 && (mean - 0.5).abs() < 0.02,
        "{mean} {one:?}"
    );
}
