//! Ways to change the horizon in space: ghost force, reciprocity and reflection of each, in one table.
//!
//! Source: \[Jenabidehkordi2019\] section 3, the multi-horizon paper; [SAND2015-7998] section 2.5; \[Bobaru2009\] section 4.2.
//!
//! | file | what |
//! |---|---|
//! | `bar.rs` | a bar of two lattices between walls that mirror, and waves in it |
//! | `variants.rs` | the ways |
//! | `plane.rs` | 2:1 and 4:1 lattices in a plane, and a test if paired bonds can balance every node |
//! | `lattices.rs` | state-based laws on two lattices in two and three dimensions, and waves through the change |
//!
//! In one dimension a node is balanced under a uniform strain if and only if the tensions of all bonds over every cut between two nodes add up to the
//! stress. That is one linear condition per cut, while bonds are many times as many, so reciprocal and patch-exact bonds always exist; a chain of
//! springs between neighbours is one choice, and the one that is nearest to given bonds is found by least change.

pub mod bar;
pub mod lattices;
pub mod plane;
pub mod variants;

use rayon::prelude::*;

use crate::Effort;
use bar::{Bar, CHANGES, FINE, LENGTH, Wave, pulse};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
};
use lattices::{Families, Meeting, Solid};
use plane::{Between, Strip};
use variants::{LEAST, Uniform, Variant};

/// Forces and sums that must vanish may be this large.
const ROUND_OFF: f64 = 1e-11;

/// Results of a variant.
#[derive(Clone, Debug)]
struct Found {
    variant: Variant,
    ghost: f64,
    asymmetry: f64,
    sum: f64,
    /// Reflected height of the paper's pulse and of one half as wide, from coarse to fine and back, over that of the pulse.
    reflected: [[f64; 2]; 2],
    /// Largest velocity error of each pass over the height of the pulse: against the exact wave, and against the bar that is all fine.
    passes: Vec<[f64; 2]>,
}

/// Number of times that the wave returns, as in the paper's figure 5.
const PASSES: usize = 8;
/// Largest velocity error after the eighth, as the text states it.
const PRINTED_ERROR: f64 = 0.15;

/// The whole comparison: 4:1 bars and 2:1 plates, with full effort 2:1 bars and 4:1 plates too.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let ratios: &[usize] = match effort {
        Effort::Quick => &[4],
        Effort::Full => &[4, 2],
    };
    let mut tables = Vec::new();
    let mut widest = Vec::new();
    for &ratio in ratios {
        let (of_ratio, found) = bars(ratio, progress);
        tables.extend(of_ratio);
        if ratio == 4 {
            widest = found;
        }
    }
    progress.stage("horizons, half the spacing", None);
    tables.push(half_the_spacing(effort, &widest));
    tables.extend(planes(effort, progress));
    progress.finish();
    tables
}

/// The tables of bars of a ratio of horizons, and what they are of.
fn bars(ratio: usize, progress: &dyn Progress) -> ([Table; 3], Vec<Found>) {
    progress.stage(
        &format!("horizons, bars {ratio}:1"),
        Some(Variant::ALL.len() as u64),
    );
    let pure: Vec<Pure> = Uniform::ALL
        .par_iter()
        .map(|&law| Pure::new(law, ratio))
        .collect();
    let pure = |law: Uniform| &pure[law as usize];
    let found: Vec<(Variant, Option<Found>)> = Variant::ALL
        .par_iter()
        .map(|&variant| {
            let bar = variant.bar(ratio, FINE);
            let found = bar.map(|bar| measure(variant, &bar, pure(variant.alone())));
            progress.advance(1);
            (variant, found)
        })
        .collect();
    let of_forces = forces(ratio, &found);
    let found: Vec<Found> = found.into_iter().filter_map(|f| f.1).collect();
    let of_passes = passes(ratio, &found, pure(Uniform::BondBased));
    let stated = statements(ratio, &found);
    ([of_forces, of_passes, stated], found)
}

/// The tables of lattices in two and three dimensions.
fn planes(effort: Effort, progress: &dyn Progress) -> [Table; 2] {
    progress.stage("horizons, plates", None);
    let plates = plates(effort);
    progress.stage("horizons, state-based laws on two lattices", None);
    [plates, state_based(effort)]
}

/// Bars of one lattice by a law, and waves in them.
struct Pure {
    fine: Bar,
    coarse: Bar,
    fine_passes: Vec<Vec<f64>>,
    /// Displacements of both pulses from the coarse side in the coarse bar and from the fine side in the fine bar, when [`reflection`] looks.
    alone: [[Vec<f64>; 2]; 2],
}

impl Pure {
    fn new(law: Uniform, ratio: usize) -> Self {
        let (fine, coarse) = (law.bar(FINE), law.bar(FINE * ratio as f64));
        let alone = NARROW.map(|narrow| {
            [
                displacement(&coarse, WAYS[0], narrow),
                displacement(&fine, WAYS[1], narrow),
            ]
        });
        Self {
            fine_passes: eight_passes(&fine),
            alone,
            fine,
            coarse,
        }
    }
}

/// Factors by which the pulses that are sent onto a change are narrower than the paper's.
const NARROW: [f64; 2] = [1.0, 2.0];
/// Start of the pulses, and the change that they meet: from the middle to the right, and from the left end to the right.
const WAYS: [[f64; 2]; 2] = [[0.5 * LENGTH, CHANGES[1]], [10.0, CHANGES[0]]];

/// Velocities each time the wave is back.
fn eight_passes(bar: &Bar) -> Vec<Vec<f64>> {
    let mut wave = Wave::excited(&bar.x);
    (0..PASSES)
        .map(|_| {
            bar.run(&mut wave, LENGTH);
            wave.v.clone()
        })
        .collect()
}

fn measure(variant: Variant, bar: &Bar, pure: &Pure) -> Found {
    let reflected = [0, 1].map(|p| {
        let [coarse, fine] = &pure.alone[p];
        [
            reflection(bar, &pure.coarse, coarse, WAYS[0], NARROW[p]),
            reflection(bar, &pure.fine, fine, WAYS[1], NARROW[p]),
        ]
    });
    let passes = errors_of_passes(bar, &pure.fine_passes, FINE);
    Found {
        variant,
        ghost: bar.ghost_force(),
        asymmetry: bar.asymmetry(),
        sum: bar.out_of_balance(),
        reflected,
        passes,
    }
}

/// Largest velocity error of each pass, against the exact wave and against the bar of one lattice of spacing `h`.
fn errors_of_passes(bar: &Bar, fine_passes: &[Vec<f64>], h: f64) -> Vec<[f64; 2]> {
    let error = |(p, v): (usize, &Vec<f64>)| {
        let turned = if p % 2 == 0 { -1.0 } else { 1.0 };
        let (mut exact, mut fine) = (0.0, 0.0);
        for (x, v) in bar.x.iter().zip(v) {
            let wanted = turned * pulse(x - 0.5 * LENGTH, 1.0);
            exact = larger(exact, v - wanted);
            let twin = (x / h).round() as usize;
            fine = larger(fine, v - fine_passes[p][twin]);
        }
        [exact, fine]
    };
    eight_passes(bar).iter().enumerate().map(error).collect()
}

/// The larger magnitude; one that is not a number stays.
fn larger(most: f64, value: f64) -> f64 {
    if value.abs() <= most {
        most
    } else {
        value.abs()
    }
}

/// Displacements when what a change sends back is 0.6 of the way from it to where the pulse started.
fn displacement(bar: &Bar, [start, change]: [f64; 2], narrow: f64) -> Vec<f64> {
    let mut wave = Wave::moving(&bar.x, start, narrow);
    bar.run(&mut wave, 1.6 * (change - start));
    wave.u
}

/// The largest displacement that a change of the horizon sends back, against `alone`, that of the bar without one, over the height of the pulse.
fn reflection(bar: &Bar, pure: &Bar, alone: &[f64], way: [f64; 2], narrow: f64) -> f64 {
    let [start, change] = way;
    let spacing = pure.x[1] - pure.x[0];
    let mut most = 0.0;
    for (x, u) in bar.x.iter().zip(displacement(bar, way, narrow)) {
        let at = x / spacing;
        let twin = at.round();
        if *x < change - 2.0 && *x > start - 15.0 && (at - twin).abs() < 1e-6 {
            most = larger(most, u - alone[twin as usize]);
        }
    }
    most
}

fn forces(ratio: usize, found: &[(Variant, Option<Found>)]) -> Table {
    let mut table = Table::new(
        format!(
            "Change of the horizon {ratio}:1 along a bar: force under a uniform strain over the stress, pairs, and what a pulse leaves behind"
        ),
        Columns::ByQuantity,
    );
    for (variant, found) in found {
        let case = format!("{ratio}:1 {}", variant.name());
        let Some(f) = found else {
            let why = "no bonds of that sign balance every node";
            table.push(TableRow::refused(case, "ghost force", why));
            continue;
        };
        let judged = |quantity: &str, value: f64, zero: bool| {
            if zero {
                TableRow::at_most(&case, quantity, value, ROUND_OFF)
            } else {
                TableRow::info(&case, quantity, value)
            }
        };
        table.push(judged("ghost force", f.ghost, variant.is_patch_exact()));
        table.push(judged("asymmetry", f.asymmetry, variant.is_reciprocal()));
        table.push(judged("sum of forces", f.sum, variant.is_reciprocal()));
        for (pulse, [out, back]) in ["pulse", "half as wide"].iter().zip(f.reflected) {
            for (way, value) in [("coarse to fine", out), ("fine to coarse", back)] {
                let quantity = format!("{pulse}, {way}");
                // what forces without a potential make grow is measured, not judged
                table.push(if value.is_finite() {
                    TableRow::info(&case, quantity, value)
                } else {
                    TableRow::refused(&case, quantity, "the motion grows without bound")
                });
            }
        }
    }
    table
}

fn passes(ratio: usize, found: &[Found], pure: &Pure) -> Table {
    let mut table = Table::new(
        format!(
            "{ratio}:1, the multi-horizon paper's figure 5: largest velocity error each time the wave is back, over the height of the pulse"
        ),
        Columns::ByQuantity,
    );
    let mut push = |case: &str, passes: &[[f64; 2]]| {
        for (p, [exact, fine]) in passes.iter().enumerate() {
            if ![0, 3, 7].contains(&p) {
                continue;
            }
            for (against, value) in [("the exact wave", exact), ("the fine bar", fine)] {
                let quantity = format!("pass {}, {against}", p + 1);
                table.push(if *value < 1e3 {
                    TableRow::info(case, quantity, *value)
                } else {
                    TableRow::refused(case, quantity, "the motion grows without bound")
                });
            }
        }
    };
    for (name, bar) in [("all fine", &pure.fine), ("all coarse", &pure.coarse)] {
        push(name, &errors_of_passes(bar, &pure.fine_passes, FINE));
    }
    for f in found {
        push(&format!("{ratio}:1 {}", f.variant.name()), &f.passes);
    }
    table
}

fn statements(ratio: usize, found: &[Found]) -> Table {
    let mut table = Table::new(
        format!("{ratio}:1, what follows from both tables"),
        Columns::Full,
    );
    let of = |v: Variant| found.iter().find(|f| f.variant == v);
    let Some(paper) = of(Variant::MultiHorizon) else {
        return table;
    };
    let sound = |f: &&Found| f.variant.is_reciprocal() && f.variant.is_patch_exact();
    for (p, pulse) in ["pulse", "pulse half as wide"].iter().enumerate() {
        for (w, way) in ["coarse to fine", "fine to coarse"].iter().enumerate() {
            let height = |f: &Found| f.reflected[p][w];
            let best = found
                .iter()
                .filter(sound)
                .min_by(|a, b| height(a).total_cmp(&height(b)));
            if let Some(best) = best {
                let quantity = format!("{pulse}, {way}: reflected, of the paper's construction");
                let ratio_of = height(best) / height(paper);
                table.push(TableRow::at_most(
                    best.variant.name(),
                    quantity,
                    ratio_of,
                    0.5,
                ));
            }
        }
    }
    let last = |f: &Found| f.passes[PASSES - 1][1];
    table.push(
        TableRow::info(
            format!("{ratio}:1 {}", paper.variant.name()),
            "eighth pass: largest velocity error against the bar that is all fine",
            last(paper),
        )
        .with_reference(PRINTED_ERROR)
        .differs("the text gives neither the horizons nor where they change nor which bar is \"non-refined\"; here m = 3, x = 24 and 76, the fine one"),
    );
    for v in [Variant::Truncated(0), Variant::Fitted] {
        if let Some(f) = of(v) {
            let case = format!("{ratio}:1 {}", f.variant.name());
            let quantity = "eighth pass: largest velocity error against the bar that is all fine";
            table.push(TableRow::info(case, quantity, last(f)).with_reference(PRINTED_ERROR));
        }
    }
    table
}

/// The multi-horizon paper's figure 7: the same bar with 0.2 mm in the middle and 0.05 mm at its ends.
fn half_the_spacing(effort: Effort, found: &[Found]) -> Table {
    let mut table = Table::new(
        "4:1, the multi-horizon paper's figure 7, half the spacing of figure 5 (0.2 and 0.05 mm): largest velocity error of the eighth pass over the height of the pulse, and that of figure 5 over it",
        Columns::ByQuantity,
    );
    let variants: &[Variant] = match effort {
        Effort::Quick => &[Variant::MultiHorizon, Variant::Truncated(0)],
        Effort::Full => &[
            Variant::MultiHorizon,
            Variant::MultiHorizonState,
            Variant::DualHorizon,
            Variant::Splice,
            Variant::Truncated(0),
            Variant::Fitted,
        ],
    };
    let spacing = 0.5 * FINE;
    let laws = Uniform::ALL.map(|law| variants.iter().any(|v| v.alone() == law).then_some(law));
    let fine: Vec<Option<Vec<Vec<f64>>>> = laws
        .par_iter()
        .map(|law| law.map(|law| eight_passes(&law.bar(spacing))))
        .collect();
    let half = |variant: Variant| {
        let fine = fine[variant.alone() as usize].as_ref()?;
        errors_of_passes(&variant.bar(4, spacing)?, fine, spacing).pop()
    };
    let whole = |variant: Variant| {
        let found = found.iter().find(|f| f.variant == variant)?;
        found.passes.last().copied()
    };
    let rows: Vec<Vec<TableRow>> = variants
        .par_iter()
        .map(|&variant| {
            let (Some(half), Some(whole)) = (half(variant), whole(variant)) else {
                let why = "no bonds of that sign balance every node";
                return vec![TableRow::refused(variant.name(), "error", why)];
            };
            ["the exact wave", "the fine bar"]
                .iter()
                .zip(half.iter().zip(whole))
                .flat_map(|(against, (half, whole))| {
                    [
                        TableRow::info(variant.name(), format!("against {against}"), *half),
                        TableRow::info(
                            variant.name(),
                            format!("figure 5 over it, {against}"),
                            whole / half,
                        ),
                    ]
                })
                .collect()
        })
        .collect();
    table.rows.extend(rows.into_iter().flatten());
    table
}

/// Ghost force, reciprocity and reflection of laws on two lattices, as published and with the least change that balances every node.
fn state_based(effort: Effort) -> Table {
    let mut table = Table::new(
        "Two lattices that meet along a line (2D) or a face (3D), state-based (LPS) and bond-based: largest force per volume under a uniform strain times the fine spacing (C_1111 = 1), |K - K'|, \
         and what a plane pulse exp(-(x/2 delta)^2) from the coarse side leaves behind, of pressure and of shear; balanced: the least change of bonds and dilatations that balances every node",
        Columns::ByQuantity,
    );
    let mut cases = Vec::new();
    for solid in [Solid::StateBased, Solid::BondBased] {
        for families in [Families::DualHorizon, Families::MultiHorizon] {
            let sizes: &[(usize, usize, usize)] = match (effort, solid) {
                (Effort::Quick, _) => &[(2, 2, 2)],
                (Effort::Full, Solid::StateBased) => &[
                    (1, 4, 3),
                    (2, 2, 2),
                    (2, 2, 3),
                    (2, 4, 2),
                    (2, 4, 3),
                    (3, 2, 2),
                    (3, 4, 2),
                ],
                (Effort::Full, Solid::BondBased) => &[(2, 2, 2), (2, 4, 2), (3, 2, 2), (3, 4, 2)],
            };
            for &(dimension, ratio, m) in sizes {
                let meeting = Meeting {
                    ratio,
                    m,
                    families,
                    solid,
                };
                cases.push((dimension, meeting));
            }
        }
    }
    let rows: Vec<Vec<TableRow>> = cases
        .par_iter()
        .map(|&(dimension, meeting)| match dimension {
            1 => meeting_rows::<1>(meeting),
            2 => meeting_rows::<2>(meeting),
            _ => meeting_rows::<3>(meeting),
        })
        .collect();
    table.rows.extend(rows.into_iter().flatten());
    table
}

fn meeting_rows<const D: usize>(meeting: Meeting) -> Vec<TableRow> {
    let law = match meeting.solid {
        Solid::StateBased => "LPS",
        Solid::BondBased => "bond-based",
    };
    let families = match meeting.families {
        Families::DualHorizon => "dual horizon",
        Families::MultiHorizon => "multi-horizon paper",
    };
    let case = format!(
        "{D}D {}:1, m = {}, {law}, {families}",
        meeting.ratio, meeting.m
    );
    // a pulse two horizons wide, and 14 of its widths beyond and before it
    let mut strip = lattices::Strip::<D>::new(meeting, 36 * meeting.m);
    let mut rows = vec![TableRow::info(&case, "ghost force", strip.ghost_force())];
    let measured = |case: &str, strip: &lattices::Strip<D>| {
        let [pressure, shear] = strip.reflected();
        let mut rows = vec![
            TableRow::at_most(case, "asymmetry", strip.asymmetry(), ROUND_OFF),
            TableRow::info(case, "pressure reflected", pressure),
        ];
        if D > 1 {
            rows.push(TableRow::info(case, "shear reflected", shear));
        }
        rows
    };
    rows.extend(measured(&case, &strip));
    let balanced = format!("{case}, balanced");
    match strip.balance(LEAST) {
        Some([least, most]) => {
            rows.push(TableRow::at_most(
                &balanced,
                "ghost force",
                strip.ghost_force(),
                ROUND_OFF,
            ));
            rows.extend(measured(&balanced, &strip));
            rows.push(TableRow::info(&balanced, "smallest factor", least));
            rows.push(TableRow::info(&balanced, "largest factor", most));
        }
        None => rows.push(TableRow::refused(
            &balanced,
            "ghost force",
            "no positive factors balance every node",
        )),
    }
    rows
}

fn plates(effort: Effort) -> Table {
    let mut table = Table::new(
        format!(
            "Two square lattices along a line: largest force under a uniform strain (per volume, times h over E), and the least change of paired bonds, none below {LEAST} of itself, that balances every node"
        ),
        Columns::ByQuantity,
    );
    let cases: &[(usize, usize)] = match effort {
        Effort::Quick => &[(2, 2), (2, 3)],
        Effort::Full => &[(2, 2), (2, 3), (4, 2), (4, 3)],
    };
    let rows: Vec<Vec<TableRow>> = cases
        .par_iter()
        .map(|&(ratio, m)| plate(ratio, m))
        .collect();
    rows.into_iter().flatten().for_each(|row| table.push(row));
    table
}

fn plate(ratio: usize, m: usize) -> Vec<TableRow> {
    let mut rows = Vec::new();
    for (name, between) in [
        ("dual horizon", Between::DualHorizon),
        ("multi-horizon paper", Between::MultiHorizon),
    ] {
        let case = format!("{ratio}:1, m = {m}, {name}");
        let strip = Strip::new(ratio, m, between);
        rows.push(TableRow::info(&case, "ghost force", strip.ghost_force()));
        rows.push(TableRow::info(&case, "bonds", strip.bonds() as f64));
        match strip.balanced(LEAST) {
            Some(b) => {
                rows.push(TableRow::info(&case, "conditions", b.conditions as f64));
                rows.push(TableRow::at_most(
                    &case,
                    "ghost force then",
                    b.left,
                    ROUND_OFF,
                ));
                rows.push(TableRow::at_least(
                    &case,
                    "smallest factor",
                    b.factors[0],
                    0.999 * LEAST,
                ));
                rows.push(TableRow::info(&case, "largest factor", b.factors[1]));
            }
            None => {
                let why = "no positive factors balance every node: bonds between the lattices are too few";
                rows.push(TableRow::refused(&case, "ghost force then", why));
            }
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use bondline::progress::Silent;

    #[test]
    fn waves_in_one_lattice_come_back_as_they_went() {
        let pure = Pure::new(Uniform::BondBased, 4);
        // nothing is sent back where nothing changes, and the fine bar is right to some per mille after one pass
        let [_, alone] = &pure.alone[0];
        assert!(reflection(&pure.fine, &pure.fine, alone, WAYS[1], 1.0) == 0.0);
        let passes = errors_of_passes(&pure.fine, &pure.fine_passes, FINE);
        assert!(passes[0][0] < 5e-3, "{:?}", passes[0]);
        assert!(passes[7][1] == 0.0);
    }

    #[test]
    fn no_row_is_short() {
        // half the spacing has no limits
        let (of_bars, _) = bars(4, &Silent);
        for table in of_bars.into_iter().chain(planes(Effort::Quick, &Silent)) {
            let short = table.count(bondline::observe::report::Verdict::Short);
            assert_eq!(short, 0, "{}", table.text());
        }
    }
}
