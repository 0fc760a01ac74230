use super::super::quality::check;
use super::*;

fn uniform(min: f64, max: f64, cells: usize) -> Axis {
    Axis::Uniform { min, max, cells }
}

fn graded_axis(fine: [f64; 2], spacing: f64, ratio: f64, largest: f64) -> Axis {
    Axis::Graded {
        min: -0.5,
        max: 0.5,
        fine,
        spacing,
        ratio,
        largest,
    }
}

#[test]
fn uniform_axes_are_exact_and_symmetric() {
    let x = uniform(-0.5, 0.5, 120).coordinates().unwrap();
    assert_eq!((x[0], x[60], x[120]), (-0.5, 0.0, 0.5));
    for i in 0..=120 {
        assert_eq!(x[i], -x[120 - i]);
    }
}

#[test]
fn grading_hits_its_ends_and_keeps_its_promises() {
    let h = 1.0 / 120.0;
    for (ratio, largest) in [(1.2, 0.05), (1.05, 0.1), (3.0, 0.04), (1.0, h), (1.3, 1e9)] {
        let fine = [-30.0 / 120.0, 0.225];
        let x = graded_axis(fine, h, ratio, largest).coordinates().unwrap();
        assert_eq!((x[0], x[x.len() - 1]), (-0.5, 0.5));
        let a = x.iter().position(|v| *v == fine[0]).unwrap();
        let b = x.iter().position(|v| *v == fine[1]).unwrap();
        assert_eq!(b - a, 57);
        for (i, x) in x.iter().enumerate().take(b).skip(a + 1) {
            assert_eq!(*x, (-30.0 + (i - a) as f64) * h);
        }
        let size: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
        for (i, w) in size.windows(2).enumerate() {
            let growth = if i + 1 < b { w[0] / w[1] } else { w[1] / w[0] };
            assert!(
                growth < ratio + 1e-9 || (i >= a && i + 1 < b),
                "{i}: {growth}"
            );
        }
        assert!(size.iter().all(|s| *s < largest * (1.0 + 1e-9)));
        if ratio == 1.2 {
            assert!(x.len() < 58 + 2 * 14, "{} lines", x.len());
        }
    }
}

#[test]
fn wrong_axes_say_what_is_wrong() {
    for (axis, text) in [
        (uniform(1.0, 1.0, 4), "runs from 1 to 1"),
        (uniform(0.0, f64::NAN, 4), "runs from 0 to NaN"),
        (uniform(0.0, 1.0, 0), "0 cells"),
        (
            graded_axis([-0.6, 0.0], 0.1, 1.2, 1.0),
            "must lie within [-0.5, 0.5]",
        ),
        (
            graded_axis([-0.2, 0.05], 0.1, 1.2, 1.0),
            "2.500000 spacings of 0.1",
        ),
        (graded_axis([-0.2, 0.2], -0.1, 1.2, 1.0), "spacing = -0.1"),
        (
            graded_axis([-0.2, 0.2], 0.1, 0.5, 1.0),
            "growth ratio = 0.5",
        ),
        (
            graded_axis([-0.2, 0.2], 0.1, 1.5, 0.05),
            "largest size 0.05",
        ),
        (
            Axis::Coordinates(vec![0.0, 2.0, 1.0]),
            "1 does not come after 2",
        ),
        (Axis::Coordinates(vec![0.0]), "1 coordinates"),
    ] {
        let message = Grid::new([uniform(0.0, 1.0, 2), axis])
            .mesh()
            .unwrap_err()
            .to_string();
        assert!(
            message.starts_with("axis y: ") && message.contains(text),
            "{message}"
        );
    }
}

#[test]
fn counts_sets_and_volumes() {
    let slit = CutOut {
        name: "slit".into(),
        min: Vector::from([-0.25, -0.25]),
        max: Vector::from([0.25, 0.125]),
    };
    let mut grid = rectangle(uniform(-0.5, 0.5, 8), uniform(-0.5, 0.5, 8));
    let mesh = grid.cut_out(slit.clone()).mesh().unwrap();
    assert_eq!((mesh.cell_count(), mesh.nodes.len()), (64 - 12, 81 - 6));
    assert_eq!(mesh.cell_sets["all"].len(), 52);
    assert_eq!(mesh.facet_sets["slit"].len(), 14);
    for side in ["left", "right", "bottom", "top"] {
        assert_eq!(mesh.facet_sets[side].len(), 8);
    }
    assert!(!mesh.facet_sets.contains_key("front"));
    assert!((check(&mesh).unwrap().volume - (1.0 - 0.5 * 0.375)).abs() < 1e-15);
    let triangles = grid.simplices().mesh().unwrap();
    assert_eq!((triangles.cell_count(), triangles.nodes.len()), (104, 75));
    assert!((check(&triangles).unwrap().volume - (1.0 - 0.5 * 0.375)).abs() < 1e-15);

    let mut grid = cuboid(
        uniform(0.0, 2.0, 4),
        uniform(0.0, 1.0, 3),
        uniform(0.0, 3.0, 2),
    );
    let hexes = grid.mesh().unwrap();
    assert_eq!((hexes.cell_count(), hexes.nodes.len()), (24, 60));
    assert_eq!(hexes.facet_sets["left"].len(), 6);
    assert_eq!(hexes.facet_sets["top"].len(), 8);
    let tets = grid.simplices().mesh().unwrap();
    assert_eq!((tets.cell_count(), tets.nodes.len()), (144, 60));
    assert_eq!(tets.facet_sets["front"].len(), 24);
    assert!((check(&tets).unwrap().volume - 6.0).abs() < 1e-14);
    // conforming: every face inside belongs to two tetrahedra
    assert_eq!(tets.outer_facets().len(), 2 * 2 * (4 * 3 + 4 * 2 + 3 * 2));
    let bar = line(uniform(0.0, 1.0, 5)).simplices().mesh().unwrap();
    assert_eq!(bar.facet_sets["right"], vec![vec![5]]);
}

#[test]
fn a_cut_out_may_notch_the_boundary_but_must_fit_the_grid() {
    let plate = || rectangle(uniform(0.0, 1.0, 4), uniform(0.0, 1.0, 4));
    let cut = |min: [f64; 2], max: [f64; 2]| CutOut {
        name: "notch".into(),
        min: Vector::from(min),
        max: Vector::from(max),
    };
    let mesh = plate()
        .cut_out(cut([-1.0, 0.25], [0.5, 0.75]))
        .mesh()
        .unwrap();
    assert_eq!(mesh.cell_count(), 12);
    assert_eq!(
        (
            mesh.facet_sets["left"].len(),
            mesh.facet_sets["notch"].len()
        ),
        (2, 6)
    );
    let message = plate()
        .cut_out(cut([0.3, 0.25], [0.5, 0.5]))
        .mesh()
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("\"notch\"")
            && message.contains("x = 0.3 ")
            && message.contains("x = 0.25 and x = 0.5"),
        "{message}"
    );
    for (max, text) in [
        ([0.25, 0.5], "removes 0 of 16"),
        ([2.0, 2.0], "removes 16 of 16"),
    ] {
        let min = if max[0] < 1.0 {
            [0.25, 0.25]
        } else {
            [-1.0, -1.0]
        };
        let message = plate()
            .cut_out(cut(min, max))
            .mesh()
            .unwrap_err()
            .to_string();
        assert!(message.contains(text), "{message}");
    }
}

#[test]
fn jitter_moves_inner_nodes_only() {
    let hole = CutOut {
        name: "hole".into(),
        min: Vector::from([0.4, 0.4]),
        max: Vector::from([0.6, 0.6]),
    };
    let mut grid = rectangle(uniform(0.0, 1.0, 10), uniform(0.0, 1.0, 10));
    let plain = grid.cut_out(hole).mesh().unwrap();
    let moved = grid.jitter(0.3, 7).mesh().unwrap();
    assert_eq!(moved, grid.mesh().unwrap(), "the same seed");
    let boundary: Vec<u32> = plain
        .outer_facets()
        .into_iter()
        .flat_map(|f| f.nodes)
        .collect();
    let mut largest = 0.0f64;
    for (n, (a, b)) in plain.nodes.iter().zip(&moved.nodes).enumerate() {
        let distance = (a - b).amax();
        largest = largest.max(distance);
        assert_eq!(distance == 0.0, boundary.contains(&(n as u32)));
    }
    assert!(largest < 0.03 && largest > 0.025);
    assert!((check(&moved).unwrap().volume - 0.96).abs() < 1e-14);
    let message = grid.jitter(0.6, 7).mesh().unwrap_err().to_string();
    assert!(message.contains("0.6 of the spacing"), "{message}");
}
