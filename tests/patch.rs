//! The patch-test and ghost-force suite, in part; `bondline verify patch` runs all of it.

use bondline::{
    observe::report::{Row, Table, Verdict, exit_code},
    peridynamics::Micromodulus,
    progress::Silent,
};
use bondline_verify::{
    Effort,
    enclosed::{Case, Cells, Enclosed, Law, Method, Widths},
    patch,
};
use rayon::prelude::*;

fn shorts(tables: &[Table]) -> String {
    tables
        .iter()
        .flat_map(|t| &t.rows)
        .filter(|r| r.verdict == Verdict::Short)
        .map(|r| format!("{}, {}: {:e} {:?}\n", r.case, r.quantity, r.value, r.reason))
        .collect()
}

/// All methods and laws of a dimension in these cases.
fn assert_complete<'a>(d: usize, cases: impl Iterator<Item = &'a str> + Clone) {
    let laws = match d {
        1 => Law::all::<1>(),
        _ => Law::all::<3>(),
    };
    for law in laws {
        for method in [
            "splice",
            "blending smooth",
            "balanced",
            "meshfree",
            "elements quadratic",
        ] {
            let mut cases = cases.clone();
            assert!(
                cases.any(|c| c.contains(method) && c.contains(law.name())),
                "{d}D {method} {} is missing",
                law.name()
            );
        }
    }
}

#[test]
fn affine_fields_are_exact_through_every_seam() {
    let tables = [
        patch::table::<1>(Effort::Quick, &Silent),
        patch::table::<2>(Effort::Quick, &Silent),
    ];
    assert_eq!(exit_code(&tables), 0, "{}", shorts(&tables));
    for (d, table) in (1..).zip(&tables) {
        // a figure that was measured
        let measured = |r: &&Row| r.quantity == "residual" && r.value > 0.0;
        let rows = table.rows.iter().filter(measured);
        assert_complete(d, rows.map(|r| r.case.as_str()));
    }
}

/// Forces only: factorisations of solids take most of the time of the suite, which `.ci/run` runs with them (`bondline verify patch --quick`).
#[test]
fn affine_fields_leave_no_force_in_solids() {
    let cases = patch::cases::<3>(Effort::Quick);
    let measured: Vec<String> = cases
        .par_iter()
        .map(|case| {
            let name = format!("{} {}", case.method.name(), case.law.name());
            let enclosed = Enclosed::<3>::new(case).unwrap_or_else(|e| panic!("{name}: {e}"));
            let residual = patch::affine_residual(&enclosed);
            let limit = patch::ALIGNED_LIMIT;
            assert!(residual > 0.0 && residual < limit, "{name}: {residual:e}");
            name
        })
        .collect();
    assert_complete(3, measured.iter().map(String::as_str));
}

#[test]
fn a_seam_that_lacks_bonds_is_found() {
    // too thin a local zone: bonds of the last points reach beyond the block
    let case = Case {
        method: Method::Splice,
        law: Law::BondBased(Micromodulus::InverseDistance),
        cells: Cells::Matching,
        widths: Widths {
            nonlocal: 6,
            transition: 0,
            local: 1,
        },
        ratio: 3,
    };
    let thin = Enclosed::<1>::new(&case).unwrap();
    assert!(patch::affine_residual(&thin) > 1e-3);
    assert!(patch::solution_error(&thin).unwrap() > 1e-6);
    let wide = Enclosed::<1>::new(&Case {
        widths: Widths {
            local: 12,
            ..case.widths
        },
        ..case
    })
    .unwrap();
    assert!(patch::affine_residual(&wide) < 1e-13);
}
