//! Static scenes whose processes hold the families of their own points, and of those at a seam.

use std::path::Path;

use bondline::progress::Silent;
use bondline::run::{AnyScene, setup};
use bondline::scene::Source;

use crate::pieces::assert_joined;
use crate::rows;
use crate::threads::{ALONE, How, folder, on_processes, predicted, run};

/// A beam of points alone that is bent.
fn beam(material: &str) -> String {
    format!(
        r#"
kinematics = "plane-stress"
coupling = "nonlocal"
mesh.rectangle = {{ min = [0, 0], max = [3, 1], x = {{ cells = 24 }}, y = {{ cells = 8 }} }}
peridynamics = {{ horizon = 0.375, points.lattice = {{ spacing = 0.125, origin = [0.0625, 0.0625] }} }}
conditions.left.displacement = {{ on = "left", x = 0, y = 0 }}
conditions.right.traction = {{ on = "right", y = 5 }}
{}
{OUTPUTS}"#,
        of_material(material)
    )
}

const OUTPUTS: &str = r#"
solver.tolerance = 1e-11
output.sections.middle = { point = [1.5, 0], normal = [1, 0] }
output.probes.tip = { at = [3, 0.5] }
output.lines.axis = { from = [0, 0.5], to = [3, 0.5], samples = 9 }
"#;

fn of_material(material: &str) -> String {
    let ratio = match material {
        "lps" => ", poisson-ratio = 0.3",
        _ => "",
    };
    format!("materials.m.{material} = {{ youngs-modulus = 1000{ratio} }}")
}

/// A plate with a zone in it that is wider than what a seam looks at, families of two spacings, and a crack in the zone that opens: several processes do not keep the faces of a closed one apart.
fn plate(coupling: &str, material: &str) -> String {
    // a collar of one horizon around the transition zone keeps off the surface
    let zones = match coupling {
        "blending" | "partial-stress" => {
            "zones.nonlocal.box = { min = [0.5, 0.5], max = [3.25, 2.5] }
zones.transition.box = { min = [0.375, 0.375], max = [3.375, 2.625] }"
        }
        _ => "zones.nonlocal.box = { min = [0.25, 0.25], max = [3.5, 2.75] }",
    };
    format!(
        r#"
kinematics = "plane-stress"
{}
mesh.rectangle = {{ min = [0, 0], max = [3.75, 3], x = {{ cells = 30 }}, y = {{ cells = 24 }} }}
{zones}
cracks.notch.segment = {{ from = [1.6, 0.8], to = [1.6, 1.3] }}
peridynamics = {{ horizon = 0.25, points.lattice = {{ spacing = 0.125, origin = [0.0625, 0.0625] }} }}
conditions.left.displacement = {{ on = "left", x = 0, y = 0 }}
conditions.right.traction = {{ on = "right", x = "1 + y", y = 5 }}
{}
{OUTPUTS}"#,
        match coupling {
            "partial-stress" => "coupling.partial-stress.form = \"meshfree\"".to_owned(),
            other => format!("coupling = \"{other}\""),
        },
        of_material(material)
    )
}

/// The figures of what is told.
fn figures(told: &str) -> Vec<f64> {
    let words = told.split(|c: char| !(c.is_ascii_alphanumeric() || ".+-".contains(c)));
    let figure = |word: &str| word.trim_end_matches('.').parse().ok();
    words.filter_map(figure).collect()
}

/// A scene has the same solution on one process and on several, and all is told of it alike; a solver of several processes ends at another last digit.
fn assert_alike(text: &str, ranks: &[usize], told: &[&str]) {
    let one = folder();
    let alone = run(text, one.path(), ALONE).expect("one process");
    for what in told {
        assert!(alone.told.contains(what), "{what}: {}", alone.told);
    }
    for &ranks in ranks {
        let several = folder();
        let how = How { ranks, ..ALONE };
        let done = run(text, several.path(), how).expect("several processes");
        let [a, b] = [&alone.told, &done.told].map(|told| figures(told));
        assert_eq!(a.len(), b.len(), "{} {}", alone.told, done.told);
        // round-off is told, too
        let same = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-3 * a.abs().max(1e-9);
        assert!(a.iter().zip(&b).all(same), "{} {}", alone.told, done.told);
        for table in ["scene_axis.csv", "scene_sections.csv", "scene_probes.csv"] {
            let [a, b] = [one.path(), several.path()].map(|f| rows(f, table).concat());
            let largest = a.iter().fold(0.0f64, |m, x| m.max(x.abs()));
            let same = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9 * largest;
            assert!(
                a.len() == b.len() && a.iter().zip(&b).all(same),
                "{table}: {a:?} {b:?}"
            );
        }
        let close = |name: &str, a: f64, b: f64| match name {
            "displacement" => (a - b).abs() < 1e-9,
            "strain" => (a - b).abs() < 1e-8,
            "linear_stress" | "residual" => (a - b).abs() < 1e-5,
            _ => a == b,
        };
        let list = several.path().join("scene.pvtu");
        let sizes = assert_joined(&one.path().join("scene.vtu"), &list, &close);
        assert_eq!(sizes.len(), ranks);
    }
}

#[test]
fn points_alone_are_told_of_alike() {
    for material in ["bond-based", "lps"] {
        assert_alike(
            &beam(material),
            &[2, 5],
            &["has rotated by", "at free surfaces"],
        );
    }
}

const COUPLINGS: [&str; 4] = ["splice", "truncated", "blending", "partial-stress"];

#[test]
fn coupled_points_are_told_of_alike() {
    // of rows that are the body's own, one law each
    for (coupling, material) in [
        ("splice", "lps"),
        ("truncated", "bond-based"),
        ("truncated", "lps"),
        ("blending", "lps"),
        ("partial-stress", "bond-based"),
    ] {
        println!("{coupling} {material}");
        assert_alike(&plate(coupling, material), &[3], &[]);
    }
}

/// Faces that do not follow the lattice: weights of the bonds of two layers are fitted.
#[test]
fn so_are_those_of_a_seam_that_is_fitted() {
    let text = plate("truncated", "bond-based")
        .replace("origin = [0.0625, 0.0625]", "origin = [0.05, 0.03]")
        .replace("horizon = 0.25", "horizon = 0.375");
    assert_alike(&text, &[4], &[]);
}

/// Bonds of the families that each of some processes holds.
pub fn held(text: &str, ranks: usize) -> Vec<usize> {
    on_processes(ranks, |rank| {
        let source = Source::new("scene.toml", text.to_owned());
        let scene = AnyScene::from_source(&source, Path::new("."), "scene").expect("a scene");
        let AnyScene::Plane(scene) = scene else {
            panic!("a scene in 2D");
        };
        let (problem, _) = setup::problem(scene.scene);
        let (model, _) = problem.lay_out(Some(rank), &Silent).expect("a model");
        model.body().expect("points").families.neighbours.len()
    })
}

#[test]
fn each_process_holds_the_families_of_its_own_points_and_of_the_seam() {
    for material in ["bond-based", "lps"] {
        let all = held(&beam(material), 1)[0];
        let shares = held(&beam(material), 4);
        let most = shares.iter().max().expect("processes");
        // three spacings around a quarter of 24
        let part = if material == "lps" { 0.55 } else { 0.3 };
        assert!(
            *most as f64 <= part * all as f64,
            "{material}: {shares:?} of {all}"
        );
        for coupling in COUPLINGS {
            let text = plate(coupling, material);
            let all = held(&text, 1)[0];
            let shares = held(&text, 3);
            assert!(shares.iter().any(|n| *n < all), "{coupling} {material}");
            let told = predicted(&text, 3);
            let told: Vec<usize> = told.shares().iter().map(|s| s.bonds).collect();
            // bonds that the crack cuts are known of after the search
            let fits =
                |(told, held): (&usize, &usize)| (told..=&(told + told / 50)).contains(&held);
            assert!(
                told.iter().zip(&shares).all(fits),
                "{coupling} {material}: {told:?} {shares:?} of {all}"
            );
        }
    }
}
