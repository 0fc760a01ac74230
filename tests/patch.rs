//! The patch-test and ghost-force suite, in part; `bondline verify patch` runs all of it.

use bondline::{
    observe::report::{Table, Verdict, exit_code},
    peridynamics::Micromodulus,
    progress::Silent,
};
use bondline_verify::{
    Effort,
    enclosed::{Case, Cells, Enclosed, Law, Method, Widths},
    patch,
};

fn shorts(tables: &[Table]) -> String {
    tables
        .iter()
        .flat_map(|t| &t.rows)
        .filter(|r| r.verdict == Verdict::Short)
        .map(|r| format!("{}, {}: {:e} {:?}\n", r.case, r.quantity, r.value, r.reason))
        .collect()
}

#[test]
fn affine_fields_are_exact_through_every_seam() {
    let tables = patch::patch(Effort::Quick, &Silent);
    assert_eq!(exit_code(&tables), 0, "{}", shorts(&tables));
    // all methods and laws in each dimension, and a figure that was measured in each row
    for (d, table) in (1..=3).zip(&tables) {
        for law in Law::ALL {
            for method in [
                "splice",
                "blending smooth",
                "balanced",
                "meshfree",
                "elements quadratic",
            ] {
                let mut rows = table.rows.iter().filter(|r| {
                    r.case.starts_with(&format!("{d}D "))
                        && r.case.contains(method)
                        && r.case.contains(law.name())
                        && r.quantity == "residual"
                });
                assert!(
                    rows.any(|r| r.value > 0.0),
                    "{d}D {method} {} is missing",
                    law.name()
                );
            }
        }
    }
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
