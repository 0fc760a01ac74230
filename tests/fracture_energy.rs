//! Energy that scenes spend on fracture, against the energy typed; `bondline verify meshes` has more laws and steps.

use bondline_verify::interfaces::opening;
use bondline_verify::meshes::fracture::{balance, plane, plate};

const LAWS: [&str; 2] = ["bond-based]", "lps]\npoisson-ratio = 0.2"];

#[test]
fn a_plane_pulled_apart_spends_the_fracture_energy() {
    for (d, m) in [(1, 2), (1, 4), (2, 3)] {
        for law in LAWS {
            let [energy, area] = plane(d, m, law).expect("it runs");
            let ratio = energy / 1e-10;
            assert!((ratio - 1.0).abs() < 0.02, "{d}D {law} m = {m}: {ratio}");
            assert!((area - 1.0).abs() < 1e-9, "{d}D {law} m = {m}: {area}");
        }
    }
}

#[test]
fn the_energy_of_a_plate_that_breaks_is_accounted_for() {
    let law = "lps]\npoisson-ratio = 0.35";
    for coupling in ["nonlocal", "truncated"] {
        let (gap, broken) = balance(&plate(coupling, law, 0.1), &[], &[]).expect("it runs");
        assert!(broken > 0 && gap.abs() < 1e-3, "{coupling} {law}: {gap}");
    }
}

#[test]
fn an_interface_pulled_apart_spends_its_own_energy() {
    for law in LAWS {
        let ratio = opening(law, [1.0, 4.0]).expect("it runs");
        assert!((ratio - 1.0).abs() < 0.02, "{law}: {ratio}");
    }
}
