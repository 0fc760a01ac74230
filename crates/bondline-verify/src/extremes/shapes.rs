//! Thin cells, families of few bonds, zones of odd shapes, pieces that nothing holds.

use super::{
    body::{Body, METHODS, solve},
    kept, refused,
};
use crate::Effort;
use bondline::{mesh::quality::LARGEST_EDGE_RATIO, observe::report::TableRow};

/// Relative residual that every solution must reach.
const RESIDUAL_LIMIT: f64 = 1e-10;

/// Distance of displacements from those of an even stretch, over the largest.
pub const STRETCH_LIMIT: f64 = 1e-6;

fn residual(text: &str) -> Result<f64, String> {
    solve(text).and_then(|s| match s.samples.iter().all(|u| u.is_finite()) {
        true => Ok(s.residual),
        false => Err("a displacement is no number".to_owned()),
    })
}

/// A plate of elements as thin as `aspect` tells.
fn thin(aspect: f64, cell: &str) -> String {
    format!(
        "kinematics = \"plane-strain\"\ncoupling = \"local\"\n[mesh.rectangle]\nmin = [0, 0]\nmax = [1, {:e}]\nx = {{ cells = 10 }}\ny = {{ cells = 10 }}\n\
         cell = \"{cell}\"\n[materials.body.bond-based]\nyoungs-modulus = 1\n[conditions.left.displacement]\non = \"left\"\nx = 0\n\
         [conditions.bottom.displacement]\non = \"bottom\"\ny = 0\n[conditions.right.displacement]\non = \"right\"\nx = 0.01\n",
        1.0 / aspect
    )
}

/// A bar or plate of peridynamics alone with voids or bonds of one kind only.
fn families(dimension: usize, ratio: f64, more: &str) -> String {
    Body {
        dimension,
        ratio,
        cells: 12,
        more: more.to_owned(),
        ..Body::new("nonlocal")
    }
    .scene()
}

pub(super) fn cells_and_families(_: Effort) -> Vec<TableRow> {
    let mut rows = Vec::new();
    for cell in ["quad4", "tri3"] {
        for aspect in [1e2, 1e4, 1e6] {
            let stretched = solve(&thin(aspect, cell)).map(|s| {
                let each = (s.samples.len() as f64 / 2.0).sqrt().round() as usize;
                let off = s.samples.chunks(2).enumerate().map(|(k, u)| {
                    let x = ((k % each) as f64 + 0.53) / each as f64;
                    (u[0] / 0.01 - x).abs()
                });
                off.fold(0.0, |a: f64, b| if b.is_nan() { b } else { a.max(b) })
            });
            let case = format!("{cell}, cells of aspect ratio {aspect:e}");
            let quantity = "distance from the even stretch";
            rows.push(if aspect > LARGEST_EDGE_RATIO {
                refused(&case, stretched, &["times as long as it is wide"])
            } else {
                kept(&case, quantity, stretched, STRETCH_LIMIT)
            });
        }
    }
    for (case, text, words) in [
        (
            "a family of no bond: m = 0.99",
            families(2, 0.99, ""),
            &["horizon"][..],
        ),
        (
            "families along lines only: m = 1.01 in 2D, no shear",
            families(2, 1.01, ""),
            &[],
        ),
        (
            "families in planes only: m = 1.01 in 3D, no shear",
            families(3, 1.01, ""),
            &[],
        ),
        (
            "families of two bonds: m = 1.01 in 1D",
            families(1, 1.01, ""),
            &[],
        ),
        (
            "families cut down to one bond, and collinear ones: a strip one point thick between voids",
            families(
                2,
                1.5,
                "[voids.below.inside.box]\nmin = [0.3, -1]\nmax = [0.6, 0.45]\n[voids.above.inside.box]\nmin = [0.3, 0.55]\nmax = [0.6, 2]\n",
            ),
            &[],
        ),
    ] {
        let result = residual(&text);
        rows.push(match (&result, words.is_empty()) {
            (Err(why), true) => TableRow::refused(case, "refused", why.clone()),
            (Ok(_), true) => kept(case, "relative residual", result, RESIDUAL_LIMIT),
            _ => refused(case, result, words),
        });
    }
    rows
}

fn zoned(coupling: &'static str, zone: &str) -> Result<f64, String> {
    let scene = Body::new(coupling).scene();
    let (head, rest) = scene
        .split_once("[zones.nonlocal]\n")
        .unwrap_or((&scene, ""));
    let tail = rest.split_once('\n').map_or("", |t| t.1);
    residual(&format!("{head}[zones.nonlocal]\n{zone}\n{tail}"))
}

pub(super) fn zones(_: Effort) -> Vec<TableRow> {
    let mut rows = Vec::new();
    for coupling in METHODS {
        for (case, zone) in [
            (
                "one cell",
                "box = { min = [0.459, 0.459], max = [0.4999, 0.4999] }",
            ),
            (
                "at the right end",
                "box = { min = [0.66, 0.3], max = [2, 0.7] }",
            ),
            ("at a corner", "box = { min = [0.66, 0.66], max = [2, 2] }"),
            (
                "two that touch at a corner",
                "any = [{ box = { min = [0.24, 0.24], max = [0.51, 0.51] } }, { box = { min = [0.49, 0.49], max = [0.76, 0.76] } }]",
            ),
            (
                "two that lie side by side",
                "any = [{ box = { min = [0.24, 0.24], max = [0.51, 0.76] } }, { box = { min = [0.49, 0.24], max = [0.76, 0.76] } }]",
            ),
            (
                "two a cell apart",
                "any = [{ box = { min = [0.2, 0.3], max = [0.46, 0.7] } }, { box = { min = [0.54, 0.3], max = [0.8, 0.7] } }]",
            ),
        ] {
            let result = zoned(coupling, zone);
            rows.push(match result {
                Ok(r) => kept(
                    &format!("{coupling}, {case}"),
                    "relative residual",
                    Ok(r),
                    RESIDUAL_LIMIT,
                ),
                // a message that names place and remedy is an answer; nothing else is
                Err(why) => TableRow::refused(format!("{coupling}, {case}"), "refused", why),
            });
        }
    }
    rows
}

pub(super) fn fragments(_: Effort) -> Vec<TableRow> {
    let mut rows = Vec::new();
    let ring: String = [
        ("low", [0.4, 0.4], [0.6, 0.4]),
        ("high", [0.4, 0.6], [0.6, 0.6]),
        ("left", [0.4, 0.4], [0.4, 0.6]),
        ("right", [0.6, 0.4], [0.6, 0.6]),
    ]
    .iter()
    .map(|(name, from, to)| format!("[cracks.{name}.segment]\nfrom = {from:?}\nto = {to:?}\n"))
    .collect();
    for coupling in METHODS {
        let body = Body {
            more: ring.clone(),
            ..Body::new(coupling)
        };
        rows.push(refused(
            &format!("{coupling}, a piece that cracks cut off on all sides"),
            residual(&body.scene()),
            &["move"],
        ));
        let through = Body {
            more: "[cracks.through.segment]\nfrom = [0.2, 0.501]\nto = [0.5, 0.501]\n".to_owned(),
            ..Body::new(coupling)
        };
        let case = format!("{coupling}, a crack that runs through the seam into elements");
        let result = residual(&through.scene());
        rows.push(match result {
            Ok(r) => kept(&case, "relative residual", Ok(r), RESIDUAL_LIMIT),
            Err(why) => TableRow::refused(case, "refused", why),
        });
    }
    rows
}
