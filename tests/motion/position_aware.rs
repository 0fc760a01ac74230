//! Position-aware solids, and weights that are fitted family by family: at rest, in load steps, in explicit motion, and with breaking bonds.

use crate::laws::{history, refused, summary};
use crate::{column, run, write};

/// A cube of 7 × 7 × 7 points in a field that is prescribed at all of its points but the middle ones; bonds are linear.
const CUBE: &str = r#"
kinematics = "solid"
coupling = "{coupling}"
[mesh.box]
min = [0, 0, 0]
max = [7, 7, 7]
x = { cells = 7 }
y = { cells = 7 }
z = { cells = 7 }
[materials.m.{law}]
youngs-modulus = 1000
poisson-ratio = 0.3
density = 1
[peridynamics]
horizon = 3
bonds = "linear"
points.lattice = { spacing = 1, origin = [0.5, 0.5, 0.5] }
{zone}
[conditions.strained.displacement]
inside.without = { from = { box = { min = [0, 0, 0], max = [7, 7, 7] } }, removed = { box = { min = [3.2, 3.2, 3.2], max = [3.8, 3.8, 3.8] } } }
{field}
[solver]
tolerance = 1e-13
"#;

const VOLUME: f64 = 343.0;

fn cube(coupling: &str, law: &str, field: &str) -> String {
    CUBE.replace("{coupling}", coupling)
        .replace("{law}", law)
        .replace("{field}", field)
        .replace("{zone}", "")
}

/// Fields of the strain 1e-3, and the energy density that elasticity gives them: E = 1000, ν = 0.3.
fn fields() -> [(&'static str, f64); 3] {
    let shear = 1000.0 / 2.6;
    let lambda = 1000.0 * 0.3 / (1.3 * 0.4);
    [
        ("x = \"1e-3*y\"\ny = 0\nz = 0", 0.5e-6 * shear),
        (
            "x = \"1e-3*x\"\ny = 0\nz = 0",
            0.5e-6 * (lambda + 2.0 * shear),
        ),
        (
            "x = \"1e-3*x\"\ny = \"1e-3*y\"\nz = \"1e-3*z\"",
            0.5e-6 * (9.0 * lambda + 6.0 * shear),
        ),
    ]
}

#[test]
fn a_cube_under_the_fields_of_the_paper_stores_what_elasticity_says_where_an_lps_does_not() {
    let folder = tempfile::tempdir().unwrap();
    for (field, exact) in fields() {
        let energy = |law: &str| {
            let found = summary(folder.path(), &cube("nonlocal", law, field));
            found["energy"].as_f64().unwrap() / (VOLUME * exact) - 1.0
        };
        let off = energy("pals");
        assert!(off.abs() < 1e-12, "{field}: {off:e}");
        // an LPS has the dilatation of a family without shear
        if !field.contains("1e-3*z") {
            let off = energy("lps");
            assert!(off.abs() > 1e-2, "{field}: LPS {off:e}");
        }
    }
}

#[test]
fn seams_that_would_have_to_be_fitted_and_families_without_a_solution_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let zone = "[zones.nonlocal]\nbox = { min = [3, 3, 3], max = [4, 4, 4] }\n";
    let typed = cube("truncated", "pals", fields()[0].0) + zone;
    let off = typed.replace("[0.5, 0.5, 0.5] }", "[0.4, 0.3, 0.4] }");
    // a rim of its own follows the lattice
    let choices = summary(folder.path(), &off)["choices"].to_string();
    assert!(choices.contains("a rim of"), "{choices}");
    let off = off + "[zones]\nrim = \"mesh\"\n";
    // each of these couplings runs in position_aware_seams.rs
    for part in [
        "where a position-aware solid has two",
        "let the faces follow the lattice",
        "coupling.splice, coupling.balanced, coupling.blending or coupling.partial-stress",
    ] {
        refused(folder.path(), &off, part);
    }
    let relaxing = "pave]\nrelaxing-share = 0.5\nrelaxation-time = 1";
    let relaxing = cube("truncated", relaxing, fields()[0].0).replace("= 1]", "= 1") + zone;
    let relaxing = relaxing.replace(
        "[solver]\ntolerance = 1e-13\n",
        "[solve.quasi-static]\nduration = 1\nsteps = 2\n",
    );
    refused(
        folder.path(),
        &relaxing,
        "a position-aware solid that relaxes, with truncated bonds",
    );
    let affine = cube("nonlocal", "pals", fields()[0].0).replace(
        "density = 1",
        "density = 1\ncalibration-fields = \"affine\"",
    );
    refused(folder.path(), &affine, "only with negative weights");
    let wrong = affine.replace("\"affine\"", "\"afine\"");
    refused(folder.path(), &wrong, "\"axes\", \"affine\"");
}

#[test]
fn a_viscoelastic_cube_that_is_sheared_and_held_relaxes_as_its_closed_form() {
    // sheared within 0.1 s, one step, and held to 0.5 s: a spring in an arm keeps q/ε of the extension
    let (end, ramp, steps) = (0.5, 0.1, 5);
    let shear = 1000.0 / 2.6;
    let field = "x = \"1e-3*y*min(10*t, 1)\"\ny = 0\nz = 0";
    // from little to almost all, and from far longer than the ramp to far shorter
    for (share, time) in [(0.01, 2.0), (0.5, 10.0), (0.5, 0.01), (0.99, 0.1)] {
        let folder = tempfile::tempdir().unwrap();
        let law = format!(
            "pave]\nrelaxing-share = {share}\nrelaxation-time = {time}\nrelaxing-share-2 = 0.006\nrelaxation-time-2 = 3\nrelaxing-share-16 = 0.004\nrelaxation-time-16 = 0.3"
        );
        let typed = cube("nonlocal", &law, field)
            .replace("-16 = 0.3]", "-16 = 0.3")
            .replace(
                "[solver]\ntolerance = 1e-13\n",
                &format!(
                    "[solve.quasi-static]\nduration = {end}\nsteps = {steps}\ntolerance = 1e-13\n"
                ),
            );
        let names = ["stored_energy", "external_work", "dissipated_energy"];
        let found = history(folder.path(), &typed, &names);
        let at_once = 0.5e-6 * shear * VOLUME;
        let kept = |time: f64, t: f64| {
            -(-ramp / time).exp_m1() / (ramp / time) * (-(t - ramp) / time).exp()
        };
        for k in 1..=steps {
            let t = end * k as f64 / steps as f64;
            let square = |time: f64| kept(time, t).powi(2);
            let exact =
                0.99 - share + share * square(time) + 0.006 * square(3.0) + 0.004 * square(0.3);
            let off = found[0][k] / (at_once * exact) - 1.0;
            assert!(off.abs() < 1e-12, "{share} {time} {k}: {off:e}");
        }
        // work of the ramp: ½ (1 − Σ λ) and of each arm ∫ q dε
        let of = |time: f64| {
            let x = ramp / time;
            (1.0 + (-x).exp_m1() / x) / x
        };
        let arms = share * of(time) + 0.006 * of(3.0) + 0.004 * of(0.3);
        let work = 2.0 * at_once * (0.5 * (0.99 - share) + arms);
        let lost = found[2][steps] - (work - found[0][steps]);
        assert!(lost.abs() < 1e-10 * work, "{share} {time}: {lost:e}");
    }
}

/// A plate that is pulled by its ends.
const PLATE: &str = r#"
kinematics = "plane-stress"
coupling = "nonlocal"
[mesh.rectangle]
min = [0, 0]
max = [12, 6]
x = { cells = 24 }
y = { cells = 12 }
[materials.m.{law}]
youngs-modulus = 1000
{ratio}
density = 1
{fracture}
[peridynamics]
horizon = 1.5
weights = "{weights}"
points.lattice = { spacing = 0.5, origin = [0.25, 0.25] }
[conditions.left.displacement]
inside.box = { min = [0, 0], max = [1, 6] }
x = "{held}"
[conditions.right.displacement]
inside.box = { min = [11, 0], max = [12, 6] }
x = "{pulled}"
[conditions.centre.displacement]
inside.box = { min = [0, 2.6], max = [12, 3.4] }
y = 0
[output]
vtu = false
probes.a = { at = [6.25, 1.25] }
"#;

/// A plate of a law, stretched up to 1 % over `[solve]`.
fn plate(law: &str, weights: &str, fracture: &str, solve: &str, ramp: &str) -> String {
    let ratio = match law {
        "bond-based" => "",
        _ => "poisson-ratio = 0.25",
    };
    PLATE
        .replace("{law}", law)
        .replace("{ratio}", ratio)
        .replace("{weights}", weights)
        .replace("{fracture}", fracture)
        .replace("{held}", &format!("-0.06*{ramp}"))
        .replace("{pulled}", &format!("0.06*{ramp}"))
        + solve
}

#[test]
fn load_steps_and_slow_motion_end_where_statics_does() {
    let folder = tempfile::tempdir().unwrap();
    let (law, weights) = ("pals", "isotropic");
    let still = plate(law, weights, "", "[solver]\ntolerance = 1e-12\n", "1");
    let found = summary(folder.path(), &still);
    let still = found["reactions"][2]["force"][0].as_f64().unwrap();
    assert!(still > 0.0, "{still}");
    let steps = "[solve.quasi-static]\nduration = 1\nsteps = 2\ntolerance = 1e-11\n";
    // a stretch that is never reached: the pass over bonds, not the rows
    let fracture = "critical-stretch = 10";
    let linear = |typed: String| typed.replace("weights =", "bonds = \"linear\"\nweights =");
    let typed = linear(plate(law, weights, fracture, steps, "t"));
    let stepped = *history(folder.path(), &typed, &["right_reaction_x"])[0]
        .last()
        .unwrap();
    assert!((stepped / still - 1.0).abs() < 1e-8, "{stepped} {still}");
    // smooth loading over many passages of a wave
    let solve = "[solve.explicit]\nduration = 12\noutputs = 1\nhistory-interval = 1\n";
    let ramp = "(1 - cos(pi*min(t, 10)/10))/2";
    let typed = linear(plate(law, weights, fracture, solve, ramp));
    let columns = ["right_reaction_x", "kinetic_energy", "stored_energy"];
    let found = history(folder.path(), &typed, &columns);
    let [force, kinetic, stored] = [0, 1, 2].map(|k: usize| *found[k].last().unwrap());
    assert!((force / still - 1.0).abs() < 1e-2, "{force} {still}");
    assert!(kinetic < 1e-3 * stored, "{kinetic} {stored}");
}

const BREAKING: &str = "critical-stretch = 0.012";
const STRUCK: &str =
    "[solve.explicit]\nduration = 4\noutputs = 1\nhistory-interval = 0.05\nstep-fraction = 0.2\n";
const ENERGIES: [&str; 5] = [
    "broken_bonds",
    "kinetic_energy",
    "stored_energy",
    "external_work",
    "dissipated_energy",
];

/// Checks that more than a hundred bonds broke, and that the work is stored, moves or is spent.
fn balances(found: &[Vec<f64>], what: &str) {
    let [broken, kinetic, stored, work, spent] =
        [0, 1, 2, 3, 4].map(|k: usize| *found[k].last().unwrap());
    assert!(broken > 100.0 && spent > 0.0, "{what}: {broken} {spent}");
    let missing = (kinetic + stored + spent - work) / work;
    assert!(missing.abs() < 1e-2, "{what}: {missing}");
}

#[test]
fn bonds_of_a_position_aware_plate_break_and_its_energies_balance() {
    let folder = tempfile::tempdir().unwrap();
    let typed = plate("pals", "isotropic", BREAKING, STRUCK, "t/2");
    balances(&history(folder.path(), &typed, &ENERGIES), "pals");
}

#[test]
fn fitted_weights_move_as_they_rest_and_break() {
    // the splice grows by less than e over the run
    let solve = STRUCK.to_owned();
    let zone = "[zones]\ndamage-at-edge = \"warn\"\nnonlocal = { box = { min = [3, 1.5], max = [9, 4.5] } }\n[mesh.rect";
    for law in ["lps", "bond-based"] {
        let folder = tempfile::tempdir().unwrap();
        let of = |weights: &str| {
            let typed = plate(law, weights, BREAKING, &solve, "t/2")
                .replace("\"nonlocal\"", "\"splice\"")
                .replace("[mesh.rect", zone)
                .replace(", origin = [0.25, 0.25]", "");
            history(folder.path(), &typed, &ENERGIES)
        };
        let fitted = of("fitted");
        // a splice has no energy of its own: only breaking is asked for
        let broken = *fitted[0].last().unwrap();
        assert!(broken > 100.0, "{law}: {broken}");
        // at rest the rows have the same weights, without a pass over bonds
        let spliced = |fracture: &str, solve: &str, ramp: &str| {
            plate(law, "fitted", fracture, solve, ramp)
                .replace("\"nonlocal\"", "\"splice\"")
                .replace("[mesh.rect", zone)
                .replace(", origin = [0.25, 0.25]", "")
        };
        let still = spliced("", "[solver]\ntolerance = 1e-12\n", "1")
            .replace("damage-at-edge = \"warn\"\n", "");
        write(folder.path(), "still.toml", &still);
        run(folder.path(), &["still.toml"]);
        let still = column(&folder.path().join("out/still_probes.csv"), "ux")[0];
        let steps = "[solve.quasi-static]\nduration = 1\nsteps = 2\ntolerance = 1e-11\n";
        let typed = spliced("critical-stretch = 10", steps, "t")
            .replace("weights =", "bonds = \"linear\"\nweights =");
        let stepped = *history(folder.path(), &typed, &["a_ux"])[0].last().unwrap();
        assert!(
            (stepped / still - 1.0).abs() < 1e-8,
            "{law}: {stepped} {still}"
        );
        if law != "lps" {
            continue;
        }
        // two passes in two orders: until a tie breaks otherwise
        let lattice = of("isotropic");
        let intact = lattice[0].iter().position(|broken| *broken > 0.0).unwrap();
        assert!(intact > 10, "{intact}");
        for k in [1, 2, 3] {
            let off = (fitted[k][intact - 1] / lattice[k][intact - 1] - 1.0).abs();
            assert!(off < 1e-9, "{k}: {off:e}");
        }
    }
}

#[test]
fn a_splice_passes_affine_fields_of_position_aware_points() {
    let zone = "[zones.nonlocal]\nbox = { min = [3, 1.5], max = [9, 4.5] }\n";
    let field = "\n[conditions.all.displacement]\ninside.without = { from = { box = { min = [0, 0], max = [12, 6] } }, removed = { box = { min = [0.2, 0.2], max = [11.8, 5.8] } } }\nx = \"2e-3*x+1e-3*y\"\ny = \"-5e-4*x+1e-3*y\"\n";
    let typed = plate("pals", "isotropic", "", zone, "1").replace("nonlocal\"", "splice\"");
    let begin = typed.find("[conditions.left").unwrap();
    let end = typed.find("[output]").unwrap();
    let typed = format!("{}{field}{}", &typed[..begin], &typed[end..])
        .replace("origin = [0.25, 0.25]", "origin = [0, 0]")
        .replace("at = [6.25, 1.25]", "at = [6.25, 2.25]");
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "splice.toml", &typed);
    run(folder.path(), &["splice.toml"]);
    let path = folder.path().join("out/splice_probes.csv");
    let [x, y] = ["ux", "uy"].map(|name| column(&path, name)[0]);
    let exact = [2e-3 * 6.25 + 1e-3 * 2.25, -5e-4 * 6.25 + 1e-3 * 2.25];
    assert!(
        (x - exact[0]).abs() < 1e-12 && (y - exact[1]).abs() < 1e-12,
        "{x} {y} {exact:?}"
    );
}
