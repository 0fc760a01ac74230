//! Continuum damage of bonds through scenes: energies of a bar, stress of load steps, tips, checkpoints, seams, and what is refused.

use crate::laws::{history, refused, summary};
use crate::{column, write};

/// A bar that is pulled at one end.
const BAR: &str = r#"
kinematics = "bar"
coupling = "nonlocal"
[mesh.line]
min = 0
max = 10
x = { cells = 100 }
[materials.m.continuum-damage]
density = 1
youngs-modulus = 1000
onset-strain = 0.01
damage-hardening = {eta}
[peridynamics]
horizon = 0.3
points.lattice = { spacing = 0.1 }
[conditions.left.displacement]
on = "left"
x = 0
[conditions.right.displacement]
on = "right"
x = "{pull}"
[output]
vtu = false
probes.a = { at = 4.55 }
probes.b = { at = 5.45 }
"#;

fn bar(eta: f64, pull: &str, solve: &str) -> String {
    BAR.replace("{eta}", &eta.to_string())
        .replace("{pull}", pull)
        + solve
}

const COLUMNS: [&str; 6] = [
    "kinetic_energy",
    "stored_energy",
    "external_work",
    "dissipated_energy",
    "missing_energy",
    "broken_bonds",
];

#[test]
fn energies_of_a_bar_balance_to_second_order_in_the_step_and_damage_never_gives_energy_back() {
    // damaged along its length; and damaged through near an end
    for (eta, pull, breaks) in [(300.0, 0.3, false), (10.0, 0.08, true)] {
        let mut off = Vec::new();
        // the default, a half and a quarter of it
        for fraction in ["", "step-fraction = 0.475\n", "step-fraction = 0.2375\n"] {
            let folder = tempfile::tempdir().unwrap();
            let solve = format!(
                "[solve.explicit]\nduration = 0.5\noutputs = 1\nhistory-interval = 5e-3\n{fraction}"
            );
            let typed = bar(eta, &format!("{pull}*(1 - cos(2*pi*t))/2"), &solve);
            let found = history(folder.path(), &typed, &COLUMNS);
            let work = found[2].iter().fold(0.0f64, |most, w| most.max(w.abs()));
            let spent = &found[3];
            assert!(
                spent.windows(2).all(|w| w[1] >= w[0]),
                "{eta}: energy came back"
            );
            let last = spent.len() - 1;
            assert!(
                spent[last] > 0.09 * work,
                "{eta}: {} of {work}",
                spent[last]
            );
            assert_eq!(found[5][last] > 0.0, breaks, "{eta}");
            let missing = found[4]
                .iter()
                .zip(spent)
                .map(|(missing, spent)| (missing - spent).abs());
            off.push(missing.fold(0.0, f64::max) / work);
        }
        assert!(off[0] < 2e-3, "{eta}: {off:?}");
        for pair in off.windows(2) {
            let ratio = pair[0] / pair[1];
            assert!((3.5..5.0).contains(&ratio), "{eta}: {off:?}");
        }
    }
}

/// Ends that keep their damage: points there lack neighbours and would be damaged first.
const HELD: &str =
    "[no-fail]\nleft.box = { min = -1, max = 2 }\nright.box = { min = 8, max = 11 }\n";

#[test]
fn load_steps_follow_the_closed_form_up_to_the_largest_stress_and_back() {
    let folder = tempfile::tempdir().unwrap();
    let (young, eta) = (1000.0, 10.0);
    // E ε²/2 = E ε₀²/3
    let onset = 0.01 * (2.0f64 / 3.0).sqrt();
    // in long steps a relaxation that strained the bonds beside the support first would settle where these are torn
    for (method, steps, near) in [("implicit", 20, 1e-7), ("relaxation", 4, 1e-6)] {
        let solve = format!(
            "{HELD}[solve.quasi-static]\nduration = 1\nsteps = {steps}\nmethod = \"{method}\"\ntolerance = 1e-11\n"
        );
        let typed = bar(eta, "0.13*min(2*t, 2 - 2*t)", &solve)
            .replace("horizon", "bonds = \"linear\"\nhorizon");
        let found = history(
            folder.path(),
            &typed,
            &["a_ux", "b_ux", "right_reaction_x", "broken_bonds"],
        );
        let mut largest: f64 = 0.0;
        for k in 1..=steps {
            let strain = (found[1][k] - found[0][k]) / 0.9;
            largest = largest.max(strain);
            let damage = (((largest / onset).powi(2) - 1.0) / eta).max(0.0);
            let stress = young * strain * (1.0 - damage);
            assert!(
                (found[2][k] - stress).abs() < near,
                "{method}, {k}: {} {stress}",
                found[2][k]
            );
        }
        let damage = ((largest / onset).powi(2) - 1.0) / eta;
        assert!(damage > 0.1 && damage < 0.3, "{method}: {damage}");
        assert!(found[3].iter().all(|broken| *broken == 0.0), "{method}");
    }
}

#[test]
fn a_bar_that_is_torn_shows_damage_counts_its_bonds_and_goes_on_from_a_checkpoint() {
    let solve =
        format!("{HELD}[solve.explicit]\nduration = 0.6\noutputs = 2\ncheckpoint-every = 20\n");
    // a weak place in the middle: the initial strain is largest there
    let moved = "[initial.u.velocity]\nx = \"1.5*tanh(x - 5)\"\n";
    let pulled = bar(10.0, "1.5*t", &(moved.to_owned() + &solve))
        .replace(
            "vtu = false",
            "vtu = false\ntips.t = { direction = [1], threshold = 0.01 }",
        )
        .replace(
            "x = 0\n[conditions.right",
            "x = \"-1.5*t\"\n[conditions.right",
        );
    let whole = crate::resumes_with_the_same_bytes(&pulled);
    let path = whole.path().join("out/bar_history.csv");
    let broken = column(&path, "broken_bonds");
    assert!(*broken.last().unwrap() > 0.0);
    // the tip is told of from the first damage on, before a bond is broken
    let tip = column(&whole.path().join("out/bar_tip_t.csv"), "step");
    let first = column(&path, "step")[broken.iter().position(|b| *b > 0.0).unwrap()];
    assert!(tip[0] < first, "{} {first}", tip[0]);
    let at = column(&whole.path().join("out/bar_tip_t.csv"), "x");
    assert!(at.iter().all(|x| (2.0..8.0).contains(x)), "{at:?}");
}

/// A plate that is pulled by its ends, most at its middle; finite elements at its ends.
const PLATE: &str = r#"
kinematics = "plane-stress"
coupling = "{coupling}"
[mesh.rectangle]
min = [0, 0]
max = [16, 6]
x = { cells = 32 }
y = { cells = 12 }
[materials.m.continuum-damage]
youngs-modulus = 1000
density = 1
onset-strain = 0.01
damage-hardening = 10
weakness = {weakness}
weak-normal-angle = {angle}
[zones]
damage-at-edge = "{edge}"
nonlocal.box = { min = [{from}, -1], max = [{to}, 7] }
[peridynamics]
horizon = 1.5
points.lattice = { spacing = 0.5 }
[voids.hole]
inside.ball = { center = [8, 3], radius = 1 }
[conditions.left.displacement]
on = "left"
x = "-0.09*t"
[conditions.right.displacement]
on = "right"
x = "0.09*t"
[initial.strained.velocity]
x = "0.09*(x-8)/8"
[solve.explicit]
duration = 0.6
outputs = 1
[output]
vtu = false
tips.t = { direction = [0, 1], threshold = 0.02 }
"#;

fn plate(coupling: &str, zone: [f64; 2], edge: &str, weak: [f64; 2]) -> String {
    PLATE
        .replace("{coupling}", coupling)
        .replace("{from}", &zone[0].to_string())
        .replace("{to}", &zone[1].to_string())
        .replace("{edge}", edge)
        .replace("{weakness}", &weak[0].to_string())
        .replace("{angle}", &weak[1].to_string())
}

#[test]
fn damage_beside_a_seam_does_not_depend_on_its_place_and_stops_the_run_where_it_comes_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let spent = |coupling: &str, zone: [f64; 2]| {
        let typed = plate(coupling, zone, "stop", [1.0, 0.0]);
        let found = summary(folder.path(), &typed);
        found["motion"]["inelastic_energy"].as_f64().unwrap()
    };
    for coupling in ["splice", "truncated"] {
        let (near, far) = (spent(coupling, [3.0, 13.0]), spent(coupling, [1.5, 14.5]));
        assert!((near / far - 1.0).abs() < 0.08, "{coupling}: {near} {far}");
        // too near to the hole
        let typed = plate(coupling, [5.5, 10.5], "stop", [1.0, 0.0]);
        write(folder.path(), "near.toml", &typed);
        let run = |more: &[&str]| {
            let arguments = [
                "run",
                "near.toml",
                "--output",
                "near",
                "--checkpoint-every",
                "1",
            ];
            let program = &mut crate::bondline(folder.path());
            let output = program.args(arguments).args(more).output().unwrap();
            let said = String::from_utf8_lossy(&output.stdout).into_owned();
            assert_eq!(output.status.code(), Some(3), "{coupling}: {said}");
            (said, crate::files(&folder.path().join("near")))
        };
        let (said, files) = run(&[]);
        // what has ended takes no further load step
        assert!(files == run(&["--resume"]).1, "{coupling}: other files");
        assert!(
            said.contains("damage reached the edge"),
            "{coupling}: {said}"
        );
        // before any bond is broken
        assert!(!said.contains("broken bonds"), "{coupling}: {said}");
    }
}

#[test]
fn weak_planes_guide_where_damage_goes() {
    let folder = tempfile::tempdir().unwrap();
    let spent = |weak: [f64; 2]| {
        let typed =
            plate("splice", [3.0, 13.0], "warn", weak).replace("duration = 0.6", "duration = 1");
        let found = summary(folder.path(), &typed);
        found["motion"]["inelastic_energy"].as_f64().unwrap()
    };
    // planes across the pull are damaged first; a turn by 180° is none
    let (across, along) = (spent([6.0, 0.0]), spent([6.0, 90.0]));
    assert!(across > 1.1 * along && along > 0.0, "{across} {along}");
    let turned = spent([6.0, 180.0]);
    assert!((turned / across - 1.0).abs() < 1e-6, "{across} {turned}");
}

#[test]
fn what_continuum_damage_cannot_do_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |typed: &str, part: &str| refused(folder.path(), typed, part);
    let moves = "[solve.explicit]\nduration = 0.1\n";
    let typed = bar(10.0, "0.1*t", moves);
    let with = |key: &str| typed.replace("density = 1\n", &format!("density = 1\n{key}\n"));
    refused(
        &with("critical-stretch = 0.01"),
        "whose bonds break by their own damage",
    );
    refused(
        &with("fracture-energy = 1"),
        "`fracture-energy` is not known",
    );
    refused(&with("weakness = 0.5"), "must lie between");
    refused(
        &typed.replace("onset-strain = 0.01", "onset-strain = 0"),
        "must lie between",
    );
    refused(
        &typed.replace("onset-strain = 0.01\n", ""),
        "lacks `onset-strain`",
    );
    refused(&bar(10.0, "0.1", ""), "a static scene has no time");
    let zoned = |zones: &str| {
        typed.replace(
            "coupling = \"nonlocal\"",
            &format!("coupling = \"truncated\"\n{zones}"),
        )
    };
    refused(
        &zoned("zones = \"auto\""),
        "takes their stiffness by a damage",
    );
    refused(
        &zoned("zones = { nonlocal = { box = { min = 3, max = 7 } }, follow = { padding = 1 } }"),
        "their history would be lost",
    );
}
