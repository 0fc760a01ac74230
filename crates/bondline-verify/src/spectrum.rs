//! The spectrum of coupled models: the boundedness of their motion, and the margin of the stable step below the limit.
//!
//! Source of the question: shared design notes on partial stress with [SAND2015-7998] sections 7.2 and 7.3, which integrate no motion. All eigenvalues of `M⁻¹ K` of a
//! strip are computed; one that is not real and positive grows as `exp(σ t)` whatever the time step ([`bondline::solve::stable_step`]).

use rayon::prelude::*;

use crate::Effort;
use crate::enclosed::{INFLUENCE, Law, Method};
use crate::strip::{Kind, Strip, StripCase};
use bondline::observe::report::{Columns, Table, TableRow, Verdict};
use bondline::peridynamics::influence::{Alpha, Degree};
use bondline::peridynamics::{Influence, Micromodulus};
use bondline::progress::Progress;
use bondline::solve::instability_growth::{self, LARGEST_GAIN};
use bondline::solve::instability_growth::{REMEDY, REMEDY_SEAM};
use bondline::solve::stable_step;
use bondline::{coupling::BlendingFunction, model::FitDegree};

/// Growth exponent per crossing of the strip that is round-off: eigenvalues that are zero or nearly double come out to half of the digits.
pub const ROUND_OFF: f64 = 1e-4;

/// A run of this many crossings is what a configuration is admitted or refused for.
pub const CROSSINGS: f64 = 100.0;

/// Horizon in the transition zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Horizon {
    Constant,
    /// Half as wide at the local side, but no less than a spacing.
    Tapered,
}

impl Horizon {
    fn name(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Tapered => "tapered",
        }
    }
}

/// The strip in 1D of which the spectra are computed.
pub fn case(kind: Kind, law: Law, ratio: u32) -> StripCase {
    StripCase {
        kind,
        law,
        ratio: f64::from(ratio),
        edge_ratio: f64::from(ratio),
        lengths: [30, 2 * ratio, 40, 2 * ratio, 30],
        cell: 1,
        across: 1,
    }
}

/// Name of an influence function in tables.
pub fn influence_name(influence: Influence) -> String {
    match influence {
        Influence::Gaussian => "Gaussian".to_owned(),
        Influence::Polynomial { degree, alpha } => match alpha {
            Alpha::Zero => format!("P{}", degree.order()),
            Alpha::One => format!("P{}/r", degree.order()),
        },
    }
}

fn law_name(law: Law) -> String {
    match law {
        Law::BondBased(m) => format!(
            "bond-based {}",
            match m {
                Micromodulus::InverseDistance => "inverse distance".to_owned(),
                Micromodulus::Uniform => "uniform".to_owned(),
                Micromodulus::Constant => "constant".to_owned(),
                Micromodulus::Triangular => "triangular".to_owned(),
                Micromodulus::Influence(w) => influence_name(w),
            }
        ),
        Law::StateBased(w) => format!("LPS {}", influence_name(w)),
        Law::Correspondence(w) => format!("correspondence {}", influence_name(w)),
        Law::PositionAware(w) => format!("PALS {}", influence_name(w)),
    }
}

/// Every influence function.
pub fn influences() -> Vec<Influence> {
    let mut all: Vec<Influence> = Alpha::ALL
        .into_iter()
        .flat_map(|alpha| {
            Degree::ALL
                .into_iter()
                .map(move |degree| Influence::Polynomial { degree, alpha })
        })
        .collect();
    all.push(Influence::Gaussian);
    all
}

fn laws(effort: Effort) -> Vec<Law> {
    let mut laws = vec![
        Law::BondBased(Micromodulus::InverseDistance),
        Law::BondBased(Micromodulus::Constant),
        Law::BondBased(Micromodulus::Triangular),
    ];
    match effort {
        Effort::Quick => laws.extend([
            Law::StateBased(INFLUENCE),
            Law::StateBased(Influence::Gaussian),
            Law::Correspondence(INFLUENCE),
        ]),
        Effort::Full => {
            laws.extend(influences().into_iter().map(Law::StateBased));
            laws.extend(influences().into_iter().map(Law::Correspondence));
        }
    }
    laws
}

fn kinds() -> Vec<Kind> {
    let mut kinds = vec![
        Kind::Local,
        Kind::Nonlocal,
        Kind::Coupled(Method::Truncated),
        Kind::Coupled(Method::Splice),
        Kind::Coupled(Method::Balanced),
        Kind::Coupled(Method::BalancedOver(BlendingFunction::Smooth)),
    ];
    kinds.extend(
        [
            BlendingFunction::Constant,
            BlendingFunction::Linear,
            BlendingFunction::Smooth,
        ]
        .map(|f| Kind::Coupled(Method::Blending(f))),
    );
    kinds
}

fn partial_stress() -> [Kind; 3] {
    [
        Method::Meshfree,
        Method::Elements(FitDegree::Affine),
        Method::Elements(FitDegree::Quadratic),
    ]
    .map(Kind::Coupled)
}

/// The growth exponent per crossing, with the verdict that a run would get.
fn row<const D: usize>(name: String, quantity: String, case: &StripCase) -> TableRow {
    let found = Strip::new::<D>(case).and_then(|strip| {
        let length: f64 = case.lengths.iter().map(|l| f64::from(*l)).sum();
        instability_growth::growth(&strip.motion, &[], 0.5, 0, None)
            .map(|g| g.rate * length)
            .map_err(|e| e.to_string())
    });
    match found {
        Err(reason) => TableRow::refused(name, quantity, reason),
        Ok(growth) if growth * CROSSINGS > LARGEST_GAIN => TableRow {
            verdict: Verdict::Refused,
            reason: Some(
                match case.kind {
                    Kind::Coupled(Method::Meshfree | Method::Elements(_)) => REMEDY,
                    _ => REMEDY_SEAM,
                }
                .to_owned(),
            ),
            ..TableRow::info(name, quantity, growth)
        },
        Ok(growth) => TableRow::at_most(
            name,
            quantity,
            growth,
            ROUND_OFF.max(LARGEST_GAIN / CROSSINGS),
        ),
    }
}

/// A row for each m.
fn rows<const D: usize>(name: &str, cases: &[StripCase]) -> Vec<TableRow> {
    cases
        .iter()
        .map(|case| row::<D>(name.to_owned(), format!("m={}", case.ratio), case))
        .collect()
}

fn tapered(case: StripCase) -> StripCase {
    StripCase {
        edge_ratio: (0.5 * case.ratio).max(1.0),
        ..case
    }
}

fn table<const D: usize>(title: &str, cases: Vec<(String, Vec<StripCase>)>) -> Table {
    let mut table = Table::new(title, Columns::ByQuantity);
    let all: Vec<Vec<TableRow>> = cases
        .par_iter()
        .map(|(name, cases)| rows::<D>(name, cases))
        .collect();
    all.into_iter().flatten().for_each(|row| table.push(row));
    table
}

/// Runs the suite.
pub fn run(effort: Effort, _progress: &dyn Progress) -> Vec<Table> {
    let ratios: Vec<u32> = match effort {
        Effort::Quick => vec![2, 3, 4],
        Effort::Full => vec![2, 3, 4, 5, 6],
    };
    let of = |kind: Kind, law: Law, horizon: Horizon| -> (String, Vec<StripCase>) {
        let name = format!("{}, {}, {}", kind.name(), law_name(law), horizon.name());
        let cases = ratios
            .iter()
            .map(|&m| match horizon {
                Horizon::Constant => case(kind, law, m),
                Horizon::Tapered => tapered(case(kind, law, m)),
            })
            .collect();
        (name, cases)
    };
    let mut plain = Vec::new();
    let mut partial = Vec::new();
    for law in laws(effort) {
        plain.extend(kinds().into_iter().map(|k| of(k, law, Horizon::Constant)));
        plain.push(of(Kind::Coupled(Method::Splice), law, Horizon::Tapered));
        for horizon in [Horizon::Constant, Horizon::Tapered] {
            partial.extend(partial_stress().into_iter().map(|k| of(k, law, horizon)));
        }
    }
    vec![
        table::<1>(
            "growth exponent per crossing of the strip, 1D: pure models, splice, blending",
            plain,
        ),
        table::<1>(
            "growth exponent per crossing of the strip, 1D: partial stress, the divergence as a scene takes it",
            partial,
        ),
        plane(effort),
        steps(effort),
    ]
}

/// A small strip in two dimensions, with free sides.
fn plane(effort: Effort) -> Table {
    let law = Law::BondBased(Micromodulus::InverseDistance);
    let triangular = Law::BondBased(Micromodulus::Triangular);
    let lps = Law::StateBased(INFLUENCE);
    let mut cases = Vec::new();
    for law in [law, triangular, lps] {
        for kind in kinds().into_iter().chain(partial_stress()) {
            let name = format!("{}, {}", kind.name(), law_name(law));
            let ratios: &[u32] = match effort {
                Effort::Quick => &[2],
                Effort::Full => &[2, 3],
            };
            let strips = ratios.iter().map(|&m| StripCase {
                lengths: [6, 2 * m, 6, 2 * m, 6],
                across: 8,
                ..case(kind, law, m)
            });
            cases.push((name, strips.collect()));
        }
    }
    table::<2>(
        "growth exponent per crossing of the strip, 2D, free sides",
        cases,
    )
}

/// The largest step for which motion from noise stays bounded, by bisection on the motion itself.
///
/// Shapes: nothing is prescribed. Error: relative 1e-4.
pub fn limit_by_growth(strip: &Strip, guess: f64) -> f64 {
    let bounded = |step: f64| {
        let n = strip.x.len() * strip.motion.stiffness.block;
        let mut last: Vec<f64> = (0..n)
            .map(|k| ((k * 7919 + 13) % 101) as f64 - 50.0)
            .collect();
        let mut x = last.clone();
        let scale = bondline::solve::krylov::norm(&x);
        for _ in 0..4000 {
            let y = strip.motion.stiffness.multiply(&x);
            for k in 0..n {
                let mass = strip.motion.mass[k / strip.motion.stiffness.block];
                last[k] = 2.0 * x[k] - last[k] - step * step * y[k] / mass;
            }
            std::mem::swap(&mut last, &mut x);
            // rigid motion and slow modes drift, but no faster than linearly
            let size = bondline::solve::krylov::norm(&x);
            if size > 1e6 * scale || !size.is_finite() {
                return false;
            }
        }
        true
    };
    let (mut low, mut high) = (0.5 * guess, 2.0 * guess);
    while high - low > 1e-4 * low {
        let middle = 0.5 * (low + high);
        if bounded(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Certified and default step against the limit by eigenvalues and by bisection.
fn steps(effort: Effort) -> Table {
    let laws = match effort {
        Effort::Quick => vec![Law::BondBased(Micromodulus::Triangular)],
        Effort::Full => vec![
            Law::BondBased(Micromodulus::Triangular),
            Law::BondBased(Micromodulus::InverseDistance),
            Law::StateBased(INFLUENCE),
        ],
    };
    let mut cases = Vec::new();
    for law in laws {
        for kind in kinds().into_iter().chain(partial_stress()) {
            for cell in [1, 2] {
                let strip = StripCase {
                    cell,
                    lengths: [30, 6, 40, 6, 30],
                    ..case(kind, law, 3)
                };
                let name = format!("{}, {}, cells of {cell} h", kind.name(), law_name(law));
                cases.push((name, strip));
            }
        }
    }
    let all: Vec<Vec<TableRow>> = cases
        .par_iter()
        .map(|(name, case)| step_rows(name, case))
        .collect();
    let mut table = Table::new(
        "time step, in units of h/c; relative to the limit by eigenvalues",
        Columns::ByQuantity,
    );
    all.into_iter().flatten().for_each(|row| table.push(row));
    table
}

fn step_rows(name: &str, case: &StripCase) -> Vec<TableRow> {
    let measured = || -> Result<Vec<TableRow>, String> {
        let strip = Strip::new::<1>(case).map_err(|e| e.to_string())?;
        let values =
            instability_growth::eigenvalues(&strip.motion, &[]).map_err(|e| e.to_string())?;
        let largest = values
            .iter()
            .fold(0.0_f64, |m, [re, im]| m.max(re.hypot(*im)));
        let limit = 2.0 / largest.sqrt();
        let found = stable_step::stable_step(&strip.motion, &[]).map_err(|e| e.to_string())?;
        let default = found.stable / limit;
        let mut rows = vec![
            TableRow::info(name, "limit", limit),
            TableRow::at_most(
                name,
                "certified/limit",
                found.certified / limit,
                1.0 + 1e-12,
            ),
            if default > 0.9 {
                TableRow::at_most(name, "default/limit", default, 1.0)
            } else {
                TableRow::at_least(name, "default/limit", default, 0.9)
            },
        ];
        // a mode that grows at any step leaves no limit to bisect
        let grows = instability_growth::growth(&strip.motion, &[], found.stable, 0, None)
            .map_err(|e| e.to_string())?
            .rate
            * 4000.0
            * found.stable
            > 1.0;
        if !grows {
            let bisected = limit_by_growth(&strip, limit) / limit;
            rows.push(TableRow::within(
                name,
                "bisected/limit",
                bisected,
                1.0,
                2e-3,
            ));
        }
        let refused = found.admit(Some(1.02 * limit), &strip.motion, &[]).is_err();
        let refused = f64::from(u8::from(refused));
        rows.push(TableRow::at_least(name, "1.02 refused", refused, 1.0));
        Ok(rows)
    };
    measured().unwrap_or_else(|reason| vec![TableRow::refused(name, "limit", reason)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_promised_is_stable_and_the_rest_is_refused() {
        let stable = Law::BondBased(Micromodulus::Triangular);
        let wrong = Law::BondBased(Micromodulus::Constant);
        for kind in [
            Kind::Coupled(Method::Splice),
            Kind::Coupled(Method::Blending(BlendingFunction::Smooth)),
            Kind::Coupled(Method::Meshfree),
        ] {
            let row = row::<1>(String::new(), String::new(), &case(kind, stable, 3));
            assert_eq!(row.verdict, Verdict::Pass, "{kind:?} {}", row.value);
        }
        // a constant micromodulus has a partial stress of the wrong sign for short waves; in meshfree form a scene pairs it with a Gaussian, whose sign turns with it
        for kind in partial_stress() {
            let row = row::<1>(String::new(), String::new(), &case(kind, wrong, 3));
            if matches!(kind, Kind::Coupled(Method::Meshfree)) {
                assert_eq!(row.verdict, Verdict::Pass, "{kind:?} {}", row.value);
                continue;
            }
            assert!(
                row.verdict == Verdict::Refused && row.value > 10.0,
                "{kind:?} {}",
                row.value
            );
        }
    }

    #[test]
    fn the_step_by_growth_is_that_of_the_eigenvalues() {
        let law = Law::BondBased(Micromodulus::InverseDistance);
        for kind in [Kind::Local, Kind::Coupled(Method::Splice)] {
            let rows = step_rows("", &case(kind, law, 3));
            assert!(
                rows.len() == 5 && rows.iter().all(|r| r.verdict == Verdict::Pass),
                "{rows:?}"
            );
        }
    }
}
