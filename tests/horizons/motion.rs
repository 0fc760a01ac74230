//! Motion over a change of the horizon: energy, bounded waves, and bonds that break on either side.

use super::{Done, run};

/// A bar with horizons of 4, 2 and 1 times three spacings, and a pulse on its way through the changes and back.
const WAVE: &str = r#"
kinematics = "bar"
coupling = "nonlocal"
mesh.line = { min = 0, max = 12, x = { cells = 240 } }
materials.m.bond-based = { youngs-modulus = 1, density = 1 }
peridynamics = { horizon = "if(x < 4, 0.6, if(x < 8, 0.3, 0.15))", points.lattice = { spacing = 0.05, origin = 0.025 }, volumes = "full" }
solve.explicit = { duration = 60, outputs = 1, history-interval = 0.5 }
initial.pulse.displacement.x = "1e-3 * exp(-(x - 6)^2)"
output = { vtu = false, probes = { middle = { at = 6 }, left = { at = 2 }, right = { at = 10 } } }
"#;

fn energy(done: &Done) -> Vec<f64> {
    let kinetic = done.column("scene_history.csv", "kinetic_energy");
    let stored = done.column("scene_history.csv", "stored_energy");
    kinetic.iter().zip(stored).map(|(k, s)| k + s).collect()
}

#[test]
fn waves_through_three_horizons_keep_their_energy() {
    for rule in ["dual", "multi-horizon"] {
        for law in [
            "bond-based={youngs-modulus=1,density=1}",
            "lps={youngs-modulus=1,poisson-ratio=0.2,density=1}",
        ] {
            let law = format!("materials.m={{{law}}}");
            let rule = format!("peridynamics.horizon-change={rule}");
            let done = run(WAVE, &[&law, &rule]);
            let energy = energy(&done);
            assert!(energy.len() > 100);
            let most = energy.iter().copied().fold(0.0, f64::max);
            let least = energy.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(most / least < 1.02, "{rule}: {least:e} to {most:e}");
        }
    }
}

#[test]
fn waves_through_a_splice_of_three_horizons_stay_bounded() {
    let done = run(WAVE, &["peridynamics.horizon-change=splice"]);
    for probe in ["middle_ux", "left_ux", "right_ux"] {
        let u = done.column("scene_history.csv", probe);
        let most = u.iter().map(|u| u.abs()).fold(0.0, f64::max);
        assert!(most < 1.2e-3, "{probe}: {most:e}");
    }
}

/// A bar that is torn across the change of its horizon: bonds may break between x = 2.8 and 3.2 only, and there the horizon doubles.
const TORN: &str = r#"
kinematics = "bar"
coupling = "nonlocal"
mesh.line = { min = 0, max = 6, x = { cells = 120 } }
materials.m.bond-based = { youngs-modulus = 1, density = 1, fracture-energy = 1e-4 }
peridynamics = { horizon = "if(x < 3, 0.3, 0.15)", points.lattice = { spacing = 0.05, origin = 0.025 }, volumes = "full", bonds = "exact" }
no-fail = { left.box = { min = -1, max = 2.7 }, right.box = { min = 3.3, max = 7 } }
solve.explicit = { duration = 12, step-fraction = 0.2, outputs = 1, history-interval = 0.5 }
initial.pull.velocity.x = "0.02 * (x - 3)"
output = { vtu = false, probes = { left = { at = 1 }, right = { at = 5 } } }
"#;

#[test]
fn bonds_break_on_either_side_of_a_change_and_the_energy_is_accounted_for() {
    let softening = [
        "materials.m.bond-based.softening=1",
        "materials.m.bond-based.softening=3",
    ];
    for softening in softening {
        for rule in ["dual", "multi-horizon"] {
            let set = format!("peridynamics.horizon-change={rule}");
            let done = run(TORN, &[&set, softening]);
            check_torn(&done, &format!("{rule}, {softening}"));
        }
    }
    // those of an lps differ between their ends by the rule "dual", and break at once
    let law =
        "materials.m={lps={youngs-modulus=1,poisson-ratio=0.2,density=1,fracture-energy=1e-4}}";
    for rule in ["dual", "multi-horizon"] {
        let set = format!("peridynamics.horizon-change={rule}");
        check_torn(&run(TORN, &[law, &set]), &format!("lps, {rule}"));
    }
}

/// The bar is in two, each of which moves on its own, and what is missing of its energy is what broken bonds took.
fn check_torn(done: &Done, case: &str) {
    let motion = done.summary.motion.as_ref().unwrap();
    let cracks = motion.cracks.as_ref().unwrap();
    let spent = cracks.dissipated_energy;
    let whole = motion.kinetic_energy + motion.stored_energy + spent;
    assert!(motion.broken_bonds > 10, "{case}: {}", motion.broken_bonds);
    // a plane of one horizon takes 1e-4, and bonds beside it break too; measured here are 0.92e-4 (lps, dual) and more, and 0.41e-4 (lps, multi-horizon), whose bonds
    // across the change are weakened
    let least = if case.contains("multi") {
        0.3e-4
    } else {
        0.8e-4
    };
    assert!(spent > least && spent < 4e-4, "{case}: {spent:e}");
    let left = (motion.missing_energy - spent).abs() / whole;
    // with one horizon as well: what steps of a fifth of the stable one leave, 25 times as much with whole ones
    assert!(left < 3e-4, "{case}: {left:e} of the energy, {spent:e}");
    let apart = |probe: &str| *done.column("scene_history.csv", probe).last().unwrap();
    assert!(apart("right_ux") - apart("left_ux") > 0.1, "{case}");
}

#[test]
fn a_splice_tears_across_a_change_as_well() {
    for law in ["bond-based", "lps"] {
        let ratio = match law {
            "lps" => ",poisson-ratio=0.2",
            _ => "",
        };
        let law = format!(
            "materials.m={{{law}={{youngs-modulus=1{ratio},density=1,fracture-energy=1e-4}}}}"
        );
        let done = run(TORN, &[&law, "peridynamics.horizon-change=splice"]);
        let motion = done.summary.motion.as_ref().unwrap();
        assert!(motion.broken_bonds > 10, "{law}: {}", motion.broken_bonds);
        assert!(motion.edge_reached.is_none(), "{law}");
        let end = |probe: &str| *done.column("scene_history.csv", probe).last().unwrap();
        assert!(end("right_ux") - end("left_ux") > 0.1, "{law}");
    }
}
