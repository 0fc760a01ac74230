//! Bonds that break by a fracture energy soften on the way: in load steps and in time, from checkpoints, and where they cannot.

use crate::laws::{refused, summary};
use crate::{column, resumes_with_the_same_bytes};

/// Arms of a plate with a crack along its middle that are opened; units mm, N, MPa.
const ARMS: &str = r#"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [40, 16]
x = { cells = 40 }
y = { cells = 16 }
[materials.m.{material}]
youngs-modulus = 3000
density = 1e-9
fracture-energy = 0.4
[peridynamics]
horizon = 1.5
points.lattice = { spacing = 0.5, origin = [0.25, 0.25] }
[zones]
nonlocal.box = { min = [-1, 5], max = [34, 11] }
damage-at-edge = "warn"
[cracks.middle]
segment = { from = [-1, 8], to = [15, 8] }
[output]
vtu = false
"#;

/// In load steps: the arms are bent apart.
const OPENED: &str = r#"
[conditions.right.displacement]
on = "right"
x = 0
y = 0
[conditions.upper.displacement]
inside.box = { min = [-0.1, 15.9], max = [2.1, 16.1] }
y = "0.35 * t"
[conditions.lower.displacement]
inside.box = { min = [-0.1, -0.1], max = [2.1, 0.1] }
y = "-0.35 * t"
[solve.quasi-static]
steps = 10
checkpoint-every = 4
"#;

/// In time.
const PULLED: &str = r#"
[conditions.right.displacement]
on = "right"
x = 0
[conditions.upper.velocity]
on = "top"
y = 5e3
[conditions.lower.velocity]
on = "bottom"
y = -5e3
[solve.explicit]
duration = 16e-6
history-interval = 1e-6
checkpoint-every = 40
"#;

fn scene(material: &str, solve: &str) -> String {
    let ratio = match material {
        "lps" => "lps]\npoisson-ratio = 0.2",
        _ => "bond-based]",
    };
    ARMS.replace("{material}]", ratio) + solve
}

/// Energy that arms spend over the advance of their crack, over what was typed.
fn spent_over_typed(typed: &str) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    let said = summary(folder.path(), typed);
    let cracks = &said["motion"]["cracks"];
    let of = |name: &str| cracks[name].as_f64().unwrap_or_else(|| panic!("{cracks}"));
    of("dissipated_energy") / of("area") / 0.4
}

#[test]
fn arms_spend_the_fracture_energy() {
    for material in ["bond-based", "lps"] {
        let spent = spent_over_typed(&scene(material, OPENED));
        assert!((spent - 1.0).abs() < 0.12, "{material}: {spent}");
    }
}

#[test]
fn softened_bonds_go_on_from_a_checkpoint() {
    for typed in [scene("bond-based", OPENED), scene("lps", PULLED)] {
        let whole = resumes_with_the_same_bytes(&typed);
        let of = |name: &str| column(&whole.path().join("out/bar_history.csv"), name);
        let (broken, spent) = (of("broken_bonds"), of("dissipated_energy"));
        assert!(*broken.last().unwrap() > 0.0 && *spent.last().unwrap() > 0.0);
    }
}

#[test]
fn the_energy_of_a_plate_that_breaks_in_time_balances() {
    for material in ["bond-based", "lps"] {
        let folder = tempfile::tempdir().unwrap();
        crate::write(folder.path(), "s.toml", &scene(material, PULLED));
        crate::run(folder.path(), &["s.toml"]);
        let of = |name: &str| column(&folder.path().join("out/s_history.csv"), name);
        let (work, spent) = (of("external_work"), of("dissipated_energy"));
        let last = work.len() - 1;
        assert!(
            spent[last] > 0.02 * work[last],
            "{material}: nothing breaks"
        );
        // what is neither stored nor in motion, but for what bonds took
        let missing = of("missing_energy")[last] - spent[last];
        assert!(
            missing.abs() < 0.01 * work[last],
            "{material}: {missing} of {}",
            work[last]
        );
    }
}

#[test]
fn a_scene_whose_bonds_cannot_soften_breaks_them_at_once_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let typed = scene("bond-based", PULLED);
    let breaks = |typed: &str| {
        let said = summary(folder.path(), typed)["choices"].to_string();
        assert!(said.contains("bonds"), "{said}");
        said
    };
    assert!(breaks(&typed).contains("bonds soften along a line"));
    let typed = typed.replace("energy = 0.4", "energy = 0.4\nsoftening = 1");
    let said = breaks(&typed);
    assert!(
        !said.contains("soften") && !said.contains("at once"),
        "{said}"
    );
    let heated = scene("bond-based", PULLED)
        .replace("density", "thermal-expansion = 1e-5\ndensity")
        + "[temperature]\nvalue = \"t\"\n";
    assert!(breaks(&heated).contains("at once, since their temperature changes"));
}

#[test]
fn softening_that_cannot_be_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let typed = scene("lps", PULLED);
    let typed_energy = |keys: &str| typed.replace("fracture-energy = 0.4", keys);
    let refused = |typed: &str, part: &str| refused(folder.path(), typed, part);
    refused(
        &typed_energy("fracture-energy = 0.4\nsoftening = 0.5"),
        "must lie between 1",
    );
    refused(
        &typed_energy("critical-stretch = 0.01\nsoftening = 3"),
        "by a fracture energy",
    );
    refused(&typed_energy("softening = 3"), "by a fracture energy");
    let softens = typed_energy("fracture-energy = 0.4\nsoftening = 3");
    let several = softens.clone()
        + "[materials.other.lps]\nyoungs-modulus = 1000\npoisson-ratio = 0.2\ndensity = 1e-9\ncells.box = { min = [20, 0], max = [40, 16] }\n";
    refused(&several, "points have several materials");
    let heated = softens.replace("density", "thermal-expansion = 1e-5\ndensity")
        + "[temperature]\nvalue = \"t\"\n";
    refused(&heated, "their temperature changes");
    let fitted = softens.replace("horizon = 1.5", "horizon = 1.5\nweights = \"fitted\"");
    refused(&fitted, "their weights are fitted");
    let follows = softens.replace("[zones]\n", "[zones]\nfollow = {}\n");
    refused(&follows, "would forget");
}
