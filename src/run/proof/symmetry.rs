//! Symmetry of the stiffness where the coupling promises it: a horizon that varies breaks the promise.

use super::Subject;
use crate::observe::proof::{Figure, Finding, Part, Severity};
use crate::observe::report::number;
use crate::observe::warning::{Code, Warning};
use crate::peridynamics::bond_force::Storage;
use crate::system::Symmetry;

/// Relative asymmetry that round-off leaves.
const ROUND_OFF: f64 = 1e-12;

/// Compares `xᵀ K y` with `yᵀ K x` for two pseudo-random vectors.
///
/// None without a promise.
pub(super) fn part<const D: usize>(subject: &Subject<'_, D>) -> Option<Part> {
    if subject.coupling.symmetry() != Symmetry::Symmetric || subject.model.body().is_none() {
        return None;
    }
    let dofs = subject.model.sites.len() * D;
    let vector =
        |seed: u64| -> Vec<f64> { (0..dofs as u64).map(|k| noise(2 * k + seed)).collect() };
    let (x, y) = (vector(0), vector(1));
    let product = |u: &[f64]| {
        let mut force = vec![0.0; dofs];
        (subject.product)(u, &mut force);
        force
    };
    let (kx, ky) = (product(&x), product(&y));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let size = (dot(&x, &x) * dot(&ky, &ky)).sqrt();
    // of independent entries, the difference of both products is the smaller the more there are
    let asymmetry = if size > 0.0 {
        (dot(&x, &ky) - dot(&y, &kx)).abs() / size * (dofs as f64).sqrt()
    } else {
        0.0
    };
    let limit = match (subject.system, subject.rest.breaking.precision) {
        (Some(_), Storage::Single) => 100.0 * f64::from(f32::EPSILON),
        _ => ROUND_OFF * (dofs as f64).sqrt(),
    };
    let is_asymmetric = asymmetry.is_nan() || asymmetry > limit;
    // points that see each other with different horizons are to have no pairs
    let is_meant = subject.model.symmetry() != Symmetry::Symmetric;
    let broken = (is_asymmetric && !is_meant).then(|| Finding {
        severity: Severity::Warning,
        value: asymmetry,
        limit,
        warning: Warning::new(
            Code::Asymmetry,
            format!(
                "the stiffness differs from its transpose by about {} of itself although the coupling is a symmetric one: bonds of its two ends differ, since the horizon or the weights vary; there is no energy that the model conserves; use one horizon, or coupling.partial-stress with a varying one",
                number(asymmetry)
            ),
        ),
    });
    Some(Part {
        name: "symmetry",
        line: match is_asymmetric {
            false => format!("the stiffness is symmetric to {}", number(asymmetry)),
            true => format!("the stiffness is not symmetric, by {}", number(asymmetry)),
        },
        figures: vec![Figure {
            name: "asymmetry".to_owned(),
            value: asymmetry,
        }],
        findings: broken.into_iter().collect(),
    })
}

/// A number in [−1, 1) that depends on its argument only.
fn noise(of: u64) -> f64 {
    let mut z = of.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}
