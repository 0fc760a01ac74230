use super::*;
use bondline::progress::Silent;

fn snapshot(spacing: f64, error: f64) -> Samples {
    Samples {
        horizon: 3.0 * spacing,
        spacing,
        dofs: 1,
        displacement: vec![Some([1.0 + error, 0.0, 0.0]), None, Some([2.0, error, 0.0])],
    }
}

#[test]
fn orders_of_a_power_law_are_its_power() {
    let levels: Vec<Samples> = [0.4, 0.2, 0.1, 0.05]
        .map(|h: f64| snapshot(h, 0.1 * h.powf(1.5)))
        .into();
    let found = compare(Refinement::M, &levels).unwrap();
    assert_eq!(found.samples, 2);
    for p in found.orders() {
        assert!((p.unwrap() - 1.5).abs() < 1e-12);
    }
    let same = [snapshot(0.4, 0.0), snapshot(0.2, 0.0), snapshot(0.1, 0.0)];
    assert_eq!(compare(Refinement::M, &same).unwrap().orders(), [None]);
}

/// A bar of peridynamics under a body force, held over a layer at both ends.
const BAR: &str = r#"
kinematics = "bar"
coupling = "nonlocal"
[mesh.line]
min = 0
max = 1
x = { cells = 40 }
[materials.bar.bond-based]
youngs-modulus = 1
[peridynamics]
horizon = 0.1
points = "cells"
weights = "plain"
influence = { degree = 3, alpha = 0 }
[conditions.left.displacement]
on = "left"
x = 0
[conditions.right.displacement]
on = "right"
x = 0
[conditions.pull.body-force]
x = "1+x"
"#;

fn study(
    text: &str,
    refinement: Refinement,
    levels: usize,
    overrides: &[&str],
) -> Result<Converged, ConvergeError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bar.toml");
    std::fs::write(&path, text).unwrap();
    let overrides: Vec<String> = overrides.iter().map(|&o| o.to_owned()).collect();
    let params = ConvergeParams {
        refinement,
        levels,
        factor: 2.0,
    };
    converge(&path, &overrides, &params, &Silent)
}

#[test]
fn a_scene_is_refined_as_asked() {
    let m = study(BAR, Refinement::M, 3, &[]).unwrap();
    let spacing: Vec<f64> = m.levels.iter().map(|l| l.spacing).collect();
    for (h, wanted) in spacing.iter().zip([0.025, 0.0125, 0.00625]) {
        assert!((h / wanted - 1.0).abs() < 1e-9, "{spacing:?}");
    }
    assert!(m.levels.iter().all(|l| (l.horizon - 0.1).abs() < 1e-15));
    let delta = study(BAR, Refinement::Delta, 3, &[]).unwrap();
    let ratio = |l: &Level| l.horizon / l.spacing;
    assert!(delta.levels.iter().all(|l| (ratio(l) - 4.0).abs() < 1e-9));
    // a lattice keeps to the nodes of a mesh whose cells cannot shrink by just that factor
    let lattice = ["peridynamics.points.lattice={spacing=0.025, origin=[0]}"];
    let both = study(BAR, Refinement::DeltaM, 2, &lattice).unwrap();
    assert!((both.levels[1].spacing / 0.0125 - 1.0).abs() < 1e-9);
    assert!((both.levels[1].horizon / (0.1 / 2.0f64.sqrt()) - 1.0).abs() < 1e-9);
    let varying = ["peridynamics.horizon=\"0.1+0.01*x\""];
    let varying = study(BAR, Refinement::Delta, 3, &varying).unwrap_err();
    assert!(varying.to_string().contains("varies in space"));
    let few = study(BAR, Refinement::M, 1, &[]).unwrap_err();
    assert!(matches!(few, ConvergeError::Params { .. }));
}

#[test]
fn levels_that_are_exact_have_no_order() {
    // linear elements of a bar are exact at their nodes under any force
    let found = study(BAR, Refinement::M, 3, &["coupling=local"]).unwrap();
    assert_eq!(found.orders(), [None]);
    assert!(found.table().text().contains("round-off"));
}

#[test]
fn the_raw_triangular_bar_converges_as_its_stiffness() {
    // raw midpoint weights of the triangular micromodulus have 1 - 1/m^2 of the stiffness; u = x^2 in layers of one horizon at both ends, and
    // under that curvature's force the error is 1/(1 - 1/m^2) - 1 times one and the same parabola, up to a spacing of its width
    let layers = BAR
        .replace("on = \"left\"", "inside.box = { min = 0, max = 0.101 }")
        .replace("on = \"right\"", "inside.box = { min = 0.899, max = 1 }")
        .replace("\nx = 0\n", "\nx = \"x^2\"\n")
        .replace("\"1+x\"", "-2");
    let overrides = [
        "peridynamics.points.lattice={spacing=0.025, origin=[0]}",
        "materials.bar.bond-based.micromodulus=triangular",
    ];
    let found = study(&layers, Refinement::M, 4, &overrides).unwrap();
    let defect = |l: i32| 1.0 / (1.0 - 1.0 / (4.0 * 2.0f64.powi(l)).powi(2)) - 1.0;
    for (l, order) in found.orders().into_iter().enumerate() {
        let l = l as i32;
        let wanted = ((defect(l) - defect(l + 1)) / (defect(l + 1) - defect(l + 2))).log2();
        assert!((order.unwrap() - wanted).abs() < 0.15, "{order:?}");
    }
}

#[test]
fn a_study_leaves_one_line_per_level() {
    let levels: Vec<Samples> = [0.4, 0.2, 0.1].map(|h: f64| snapshot(h, 0.1 * h)).into();
    let found = compare(Refinement::M, &levels).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.csv");
    found.write_csv(&path).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
    assert!(lines.len() == 4 && lines.iter().all(|l| l.len() == 8));
    let value = |l: usize, c: usize| lines[l][c].parse::<f64>().ok();
    assert_eq!(value(1, 2), Some(0.4));
    assert!((value(1, 7).unwrap() - 1.0).abs() < 1e-4);
    assert_eq!((value(2, 7), value(3, 5)), (None, None));
}
