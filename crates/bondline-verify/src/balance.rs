//! The out-of-balance force of a seam against its leading term, and the spurious force of a single site.
//!
//! Under a smooth field a bar of PD points carries the force `C u' + M₆ u‴/24`, one of finite elements of size h `C u' + 2 C h² u‴/24`,
//! with `C = ½ Σ λ ξ⁴ V` and `M₆ = Σ λ ξ⁶ V` as lattice sums (per unit cross-section). At a seam with peridynamics on its left the sum of all internal forces is therefore
//!
//! ```text
//! splice      + (M₆ − 2 C h²) u‴/24
//! blending    − (M₆′ − 2 C h²) u‴/24
//! ```
//!
//! and the opposite where peridynamics lies on the right. In blending the weighted bonds are pairwise in balance, and the remainder is expanded at one end of each bond:
//! its sum differs from `C u'` by `−M₆′ u‴/24`, to which the compact differences add `4 C h² u‴/24`; the width of β does not enter.
//! For a pairwise law `M₆′ = M₆`. For an LPS in 1D, `M₆ = (6 μ + 8 (k − 3 μ)) Σωξ⁴V/m` since its dilatation reaches over two horizons, while the expansion of
//! the force state sees one, `M₆′ = 2 C Σωξ⁴V/m`. Balanced rows take of each what makes the two cancel.

use crate::{
    Effort, each,
    enclosed::{Case, Cells, Enclosed, INFLUENCE, Law, Method, SPACING, Widths},
    patch::{out_of_balance, relative_out_of_balance, round_off, spurious_force, widths},
    tangents::momentum,
};
use bondline::{
    coupling::BlendingFunction,
    model::FitDegree,
    observe::report::{Columns, Table, TableRow},
    peridynamics::Micromodulus,
    progress::Progress,
    system::Ranks,
};

/// Largest out-of-balance force of a method in exact equilibrium, over the force on a face; where round-off alone may make more of it ([`round_off`]: 1e-11 at 400 spacings from the origin), that.
pub const EQUILIBRIUM_LIMIT: f64 = 1e-12;

/// Largest relative distance from the leading term.
pub const LEADING_TERM_LIMIT: f64 = 0.01;

/// Factor by which the spurious force of a site has to be smaller for a smooth β over 3δ than for a splice.
pub const SPURIOUS_RATIO: f64 = 100.0;

/// Half of the peridynamic zone in spacings: so far from the origin that the third derivative of `x⁴` varies little across a seam.
const FAR: u32 = 400;

/// Lattice sums of one law in 1D \[Pa, Pa m²\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments {
    /// `C`.
    pub stiffness: f64,
    /// `M₆` of the bulk.
    pub bulk: f64,
    /// `M₆′` of the expansion that blending takes.
    pub expanded: f64,
}

/// The moments of a law on a lattice of m = `ratio`, from the kernel's shape alone: in 1D isotropic weights rescale it to the typed stiffness.
pub fn moments(law: Law, ratio: u32) -> Moments {
    let horizon = f64::from(ratio) * SPACING;
    let sum = |power: i32, kernel: &dyn Fn(f64) -> f64| -> f64 {
        (1..=ratio)
            .map(|k| f64::from(k) * SPACING)
            .map(|xi| 2.0 * kernel(xi) * xi.powi(power) * SPACING)
            .sum()
    };
    let (lambda, mu) = law.lame::<1>();
    let stiffness = lambda + 2.0 * mu;
    match law {
        Law::BondBased(kernel) => {
            let shape = |xi: f64| kernel.shape(xi, horizon);
            let bulk = 2.0 * stiffness * sum(6, &shape) / sum(4, &shape);
            Moments {
                stiffness,
                bulk,
                expanded: bulk,
            }
        }
        // stabilised with 1, correspondence is the same operator as an LPS in 1D
        // and on a whole lattice of a bar a position-aware solid is one
        Law::StateBased(influence)
        | Law::Correspondence(influence)
        | Law::PositionAware(influence) => {
            let omega = |xi: f64| influence.value(xi, horizon);
            let length = sum(4, &omega) / sum(2, &omega);
            Moments {
                stiffness,
                bulk: (6.0 * mu + 8.0 * (stiffness - 3.0 * mu)) * length,
                expanded: 2.0 * stiffness * length,
            }
        }
    }
}

/// The leading term at the right-hand seam under `u = x^degree`; `None` for partial stress.
pub fn leading_term(case: &Case, degree: u32) -> Option<f64> {
    let m = moments(case.law, case.ratio);
    let grid = 2.0 * m.stiffness * SPACING * SPACING;
    let edge = f64::from(case.widths.nonlocal);
    let (factor, place) = match case.method {
        // between the last point and the first node
        Method::Splice => (m.bulk - grid, edge - 0.5),
        Method::Blending(_) => (
            grid - m.expanded,
            edge + 0.5 * f64::from(case.widths.transition),
        ),
        _ => return None,
    };
    let x = place * SPACING;
    let third = f64::from(degree * (degree - 1) * (degree - 2)) * x.powi(degree as i32 - 3);
    Some(factor * third / 24.0)
}

fn bar(method: Method, law: Law, ratio: u32, transition: u32) -> Case {
    let transition = if method.has_transition() {
        transition
    } else {
        0
    };
    Case {
        method,
        law,
        cells: Cells::Matching,
        widths: Widths {
            nonlocal: FAR,
            transition,
            local: 8 * ratio,
        },
        ratio,
    }
}

fn laws(effort: Effort) -> Vec<(&'static str, Law)> {
    let mut laws = vec![
        (
            "bond-based c/|xi|^3",
            Law::BondBased(Micromodulus::InverseDistance),
        ),
        ("LPS", Law::StateBased(INFLUENCE)),
    ];
    if effort == Effort::Full {
        laws.extend([
            ("bond-based c", Law::BondBased(Micromodulus::Uniform)),
            (
                "bond-based c/|xi|^2",
                Law::BondBased(Micromodulus::Constant),
            ),
            (
                "bond-based triangular",
                Law::BondBased(Micromodulus::Triangular),
            ),
            ("correspondence", Law::Correspondence(INFLUENCE)),
        ]);
    }
    laws
}

/// A seam of every method, by the name of its law.
fn seam_cases(effort: Effort, ratios: &[u32]) -> Vec<(&'static str, Case)> {
    let mut cases = Vec::new();
    for (name, law) in laws(effort) {
        for &ratio in ratios {
            cases.push((name, bar(Method::Splice, law, ratio, 0)));
            for function in [
                BlendingFunction::Constant,
                BlendingFunction::Linear,
                BlendingFunction::Smooth,
            ] {
                for width in [1, 3] {
                    cases.push((
                        name,
                        bar(Method::Blending(function), law, ratio, width * ratio),
                    ));
                }
            }
            cases.push((name, bar(Method::Meshfree, law, ratio, 3 * ratio)));
            cases.push((
                name,
                bar(
                    Method::Elements(FitDegree::Quadratic),
                    law,
                    ratio,
                    3 * ratio,
                ),
            ));
            cases.push((name, bar(Method::Balanced, law, ratio, 0)));
            let smooth = Method::BalancedOver(BlendingFunction::Smooth);
            cases.push((name, bar(smooth, law, ratio, 3 * ratio)));
            if Method::Truncated.is_offered(law) {
                cases.push((name, bar(Method::Truncated, law, ratio, 0)));
            }
        }
    }
    cases
}

/// Out-of-balance force at one seam of a bar, under cubic and quartic fields.
pub fn leading_terms(effort: Effort, progress: &dyn Progress, ranks: Option<&dyn Ranks>) -> Table {
    let ratios: &[u32] = if effort == Effort::Full {
        &[3, 4, 6]
    } else {
        &[3]
    };
    let cases = seam_cases(effort, ratios);
    progress.stage("out-of-balance force", Some(cases.len() as u64));
    let rows = each(ranks, &cases, |(law, case)| {
        let width = case.widths.transition / case.ratio;
        let name = format!(
            "{law}, m = {}, {}{}",
            case.ratio,
            case.method.name(),
            if width == 0 {
                String::new()
            } else {
                format!(" over {width} delta")
            }
        );
        progress.advance(1);
        let quantities = [(3, "cubic, N"), (4, "quartic, N m")];
        match Enclosed::<1>::on(case, ranks) {
            Ok(bar) => quantities
                .map(|(degree, quantity)| {
                    let force = out_of_balance(&bar, degree);
                    match leading_term(case, degree) {
                        Some(term) => {
                            TableRow::within(&name, quantity, force, term, LEADING_TERM_LIMIT)
                        }
                        None if is_in_balance(case.method, degree) => {
                            let force = relative_out_of_balance(&bar, degree).abs();
                            let quantity = match degree {
                                3 => "cubic, over the force on a face",
                                _ => "quartic, over the force on a face",
                            };
                            TableRow::at_most(
                                &name,
                                quantity,
                                force,
                                equilibrium_limit(&bar, degree),
                            )
                        }
                        None => TableRow::info(&name, quantity, force),
                    }
                })
                .to_vec(),
            Err(e) => quantities
                .map(|(_, q)| {
                    TableRow::at_most(&name, q, f64::NAN, LEADING_TERM_LIMIT).because(e.to_string())
                })
                .to_vec(),
        }
    });
    let mut table = Table::new(
        "Out-of-balance force at a seam of a bar, peridynamics on its left; reference: -+ (M6 - 2 C h^2) u'''/24",
        Columns::Full,
    );
    rows.into_iter().flatten().for_each(|row| table.push(row));
    table
}

/// Returns true if a method leaves no force out of balance in 1D under a field of that degree; a wide β shifts the place of a splice's force against that of a blending's.
fn is_in_balance(method: Method, degree: u32) -> bool {
    match method {
        Method::Truncated | Method::Balanced => true,
        Method::BalancedOver(_) => degree < 4,
        _ => false,
    }
}

fn equilibrium_limit<const D: usize>(enclosed: &Enclosed<D>, degree: u32) -> f64 {
    EQUILIBRIUM_LIMIT.max(round_off(enclosed, degree))
}

/// Largest spurious force of a single site for each method, relative to `C/h` times the area of a point, and the ratio of splice to smooth blending.
pub fn spurious_forces(
    effort: Effort,
    progress: &dyn Progress,
    ranks: Option<&dyn Ranks>,
) -> Table {
    let mut table = Table::new(
        "Largest spurious force per unit displacement of a single site, times h/C over the face of a point; transition zones 3 delta wide",
        Columns::Full,
    );
    let ratios: &[u32] = if effort == Effort::Full {
        &[3, 4, 6]
    } else {
        &[3]
    };
    let methods = [
        Method::Splice,
        Method::Blending(BlendingFunction::Constant),
        Method::Blending(BlendingFunction::Linear),
        Method::Blending(BlendingFunction::Smooth),
        Method::Meshfree,
        Method::Elements(FitDegree::Quadratic),
        Method::Truncated,
        Method::Balanced,
        Method::BalancedOver(BlendingFunction::Smooth),
    ];
    for (name, law) in laws(effort) {
        let methods: Vec<Method> = offered(&methods, law);
        for &ratio in ratios {
            progress.stage("spurious force", None);
            let cases: Vec<Case> = methods
                .iter()
                .map(|&method| Case {
                    widths: Widths {
                        nonlocal: 12 * ratio,
                        ..bar(method, law, ratio, 3 * ratio).widths
                    },
                    ..bar(method, law, ratio, 3 * ratio)
                })
                .collect();
            push_spurious::<1>(
                &mut table,
                &format!("1D {name}, m = {ratio}"),
                &cases,
                Some(SPURIOUS_RATIO),
                ranks,
            );
        }
    }
    if effort == Effort::Full {
        for law in Law::all::<2>() {
            let cases: Vec<Case> = offered(&methods, law)
                .into_iter()
                .map(|method| Case {
                    method,
                    law,
                    cells: Cells::Matching,
                    widths: Widths {
                        nonlocal: 6,
                        transition: if method.has_transition() { 9 } else { 0 },
                        local: 9,
                    },
                    ratio: 3,
                })
                .collect();
            push_spurious::<2>(
                &mut table,
                &format!("2D {}, m = 3", law.name()),
                &cases,
                None,
                ranks,
            );
        }
    }
    table
}

fn offered(methods: &[Method], law: Law) -> Vec<Method> {
    methods
        .iter()
        .copied()
        .filter(|m| m.is_offered(law))
        .collect()
}

fn push_spurious<const D: usize>(
    table: &mut Table,
    name: &str,
    cases: &[Case],
    limit: Option<f64>,
    ranks: Option<&dyn Ranks>,
) {
    let forces = each(ranks, cases, |case| {
        let found = Enclosed::<D>::on(case, ranks).map(|e| {
            let scale = e.tensor.get(0, 0, 0, 0) * SPACING.powi(D as i32 - 2);
            spurious_force(&e) / scale
        });
        found.map_err(|e| e.to_string())
    });
    for (case, force) in cases.iter().zip(&forces) {
        table.push(match force {
            Ok(force) => TableRow::info(name, case.method.name(), *force),
            Err(why) => TableRow::info(name, case.method.name(), f64::NAN).because(why),
        });
    }
    if let (Ok(splice), Ok(smooth)) = (&forces[0], &forces[3]) {
        let quantity = "splice over blending smooth";
        table.push(match limit {
            Some(limit) => TableRow::at_least(name, quantity, splice / smooth, limit),
            None => TableRow::info(name, quantity, splice / smooth),
        });
    }
}

/// Sums of internal forces of every method: under a random displacement, and at half of the seam under polynomials.
pub fn every_method(progress: &dyn Progress, ranks: Option<&dyn Ranks>) -> Table {
    progress.stage("out-of-balance force of every method", None);
    let mut table = Table::new(
        "Out of balance, every method, m = 3 (3D: 2). forces, moments: their sum under a random displacement over the sum of their sizes; cubic, quartic: force of half the seam \
         under u_x = x^3, x^4 over the force on a face",
        Columns::ByQuantity,
    );
    let pairwise = Law::BondBased(Micromodulus::InverseDistance);
    for law in [pairwise, Law::StateBased(INFLUENCE)] {
        table.rows.extend(every_method_rows::<1>(law, ranks));
        table.rows.extend(every_method_rows::<2>(law, ranks));
        table.rows.extend(every_method_rows::<3>(law, ranks));
    }
    table
}

fn every_method_rows<const D: usize>(law: Law, ranks: Option<&dyn Ranks>) -> Vec<TableRow> {
    let rows = each(ranks, &offered(&Method::ALL, law), |&method| {
        let case = Case {
            method,
            law,
            cells: Cells::Matching,
            widths: widths::<D>(method, Cells::Matching),
            ratio: if D == 3 { 2 } else { 3 },
        };
        let name = format!("{D}D {}, {}", law.name(), method.name());
        let e = match Enclosed::<D>::on(&case, ranks) {
            Ok(e) => e,
            Err(e) => return vec![TableRow::refused(name, "forces", e.to_string())],
        };
        let places: Vec<_> = e.positions().copied().collect();
        let (forces, moments) = momentum(&e.stiffness, &places);
        let exact = method == Method::Truncated;
        let row = |quantity: &str, value: f64, limit: Option<f64>| match limit {
            Some(limit) => TableRow::at_most(&name, quantity, value.abs(), limit),
            None => TableRow::info(&name, quantity, value),
        };
        let sums = exact.then_some(EQUILIBRIUM_LIMIT);
        let mut rows = vec![row("forces", forces, sums)];
        if D > 1 {
            rows.push(row("moments", moments, sums));
        }
        for (degree, quantity) in [(3, "cubic"), (4, "quartic")] {
            let limited = exact || D == 1 && is_in_balance(method, degree);
            let limit = limited.then(|| equilibrium_limit(&e, degree));
            rows.push(row(quantity, relative_out_of_balance(&e, degree), limit));
        }
        rows
    });
    rows.into_iter().flatten().collect()
}

/// The suite `balance`.
pub fn balance(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    balance_on(effort, progress, None)
}

/// The same; where there are several processes, by all of them.
pub fn balance_on(
    effort: Effort,
    progress: &dyn Progress,
    ranks: Option<&dyn Ranks>,
) -> Vec<Table> {
    let tables = vec![
        every_method(progress, ranks),
        leading_terms(effort, progress, ranks),
        spurious_forces(effort, progress, ranks),
    ];
    progress.finish();
    tables
}
