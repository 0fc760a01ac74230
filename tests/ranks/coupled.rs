//! Scenes of finite elements and points on several processes: each receives what its own sites and the seam ask for, and the results are those of one.

use crate::at_rest::held;
use crate::threads::{Done, assert_same, predicted};
use crate::traffic::done;
use crate::{killed_and_resumed, plate};

/// Couplings beside which a crack of this plate runs; at a partial stress it has modes that grow faster than the crack.
const COUPLINGS: [&str; 4] = [
    "[coupling.splice]",
    "[coupling.balanced]",
    "[coupling.blending]",
    "[coupling.truncated]",
];

/// A pulse through a bar of both models.
const BAR: &str = r#"
kinematics = "bar"
[mesh.line]
min = 0
max = 12
x = { cells = 48 }
[materials.bar.bond-based]
youngs-modulus = 1
density = 1
[peridynamics]
horizon = 0.75
points.lattice = { spacing = 0.25 }
[zones.nonlocal]
box = { min = 4, max = 8 }
[zones.transition]
around = 1
[initial.pulse.velocity]
x = "1e-3*exp(-(x-2)^2)"
[solve.explicit]
duration = 6
outputs = 2
history-interval = 1
"#;

/// A smaller plate whose crack runs, with a zone that ends in the plate ahead of it.
fn inner_plate(material: &str, coupling: &str) -> String {
    let mut text = plate(material, coupling, "");
    for (old, new) in [
        ("max = [0.04, 0.02]", "max = [0.016, 0.012]"),
        ("cells = 40", "cells = 16"),
        ("cells = 20", "cells = 12"),
        (
            "min = [0, 0.0061], max = [0.0401, 0.0141]",
            "min = [0, 0.0031], max = [0.0121, 0.0091]",
        ),
        (
            "from = [-0.01, 0.01], to = [0.015, 0.01]",
            "from = [-0.01, 0.006], to = [0.005, 0.006]",
        ),
        ("point = [0.02, 0.01]", "point = [0.008, 0.006]"),
        ("duration = 10e-6", "duration = 5e-6"),
        ("-4e6", "-8e6"),
        ("y = 4e6", "y = 8e6"),
    ] {
        assert!(text.contains(old), "{old}");
        text = text.replace(old, new);
    }
    match ["blending", "balanced"]
        .iter()
        .any(|c| coupling.contains(c))
    {
        true => text + "\n[zones.transition]\naround = 1e-3\n",
        false => text,
    }
}

/// Checks that the exchange is the predicted one: ghosts of each process, no site of which it needs nothing.
fn assert_predicted(text: &str, found: &Done, ranks: usize, name: &str) {
    let (traffic, steps) = &found.traffic;
    let shares = predicted(text, ranks);
    let shares = shares.shares();
    assert_eq!([traffic.len(), shares.len()], [ranks; 2], "{name}");
    let sites: u64 = traffic.iter().map(|t| t.sites).sum();
    for (rank, (t, share)) in traffic.iter().zip(shares).enumerate() {
        let name = format!("{name}, process {rank} of {ranks}");
        assert_eq!(
            [share.sites as u64, share.ghosts as u64],
            [t.sites, t.ghosts],
            "{name}"
        );
        assert_eq!(t.exchanges, *steps, "{name}");
        assert_eq!(t.received_bytes, steps * share.received_bytes, "{name}");
        assert_eq!(t.received_bytes, found.received[rank], "{name}");
        assert!(t.ghosts == 0 || ranks > 1, "{name}");
        // a cut through the plate, not all of it
        assert!(2 * t.ghosts < sites, "{name}: {} of {sites}", t.ghosts);
    }
}

#[test]
fn ghosts_of_coupled_scenes_are_those_predicted() {
    for material in ["bond-based", "lps"] {
        for coupling in COUPLINGS {
            let text =
                inner_plate(material, coupling).replace("duration = 5e-6", "duration = 1e-6");
            for ranks in [1, 4] {
                let name = format!("{material}, {coupling}");
                assert_predicted(&text, &done(&text, ranks), ranks, &name);
                println!("{name} on {ranks}");
            }
        }
    }
}

#[test]
fn coupled_steps_gather_nothing_of_all_sites() {
    let text = inner_plate("bond-based", "[coupling.splice]").replace("outputs = 3", "outputs = 1");
    let [few, many] = ["0.5e-6", "2e-6"].map(|duration| {
        let text = text
            .replace("duration = 5e-6", &format!("duration = {duration}"))
            .replace("interval = 0.5e-6", &format!("interval = {duration}"));
        done(&text, 3)
    });
    assert!(many.traffic.1 > 3 * few.traffic.1);
    assert_eq!(many.of_all, few.of_all);
}

#[test]
fn cracks_run_alike_at_every_seam() {
    for material in ["bond-based", "lps"] {
        for coupling in COUPLINGS {
            let one = assert_same(&inner_plate(material, coupling), &[3]);
            let table = String::from_utf8(one["scene_tip_front.csv"].clone()).unwrap();
            println!(
                "{material}, {coupling}: {} rows of the tip",
                table.lines().count()
            );
            assert!(table.lines().count() > 3, "{material}, {coupling}: {table}");
        }
    }
}

#[test]
fn a_pulse_crosses_partial_stresses_alike() {
    for form in ["elements", "meshfree"] {
        assert_same(
            &format!("{BAR}[coupling.partial-stress]\nform = \"{form}\"\n"),
            &[2, 3],
        );
    }
}

#[test]
fn they_do_on_any_number_of_processes() {
    for (material, coupling) in [
        ("lps", "[coupling.splice]"),
        ("lps", "[coupling.truncated]"),
    ] {
        assert_same(&inner_plate(material, coupling), &[1, 2, 5, 7]);
    }
}

/// The crack meets the end of the zone, where the run stops in a step of which nobody wants a row.
#[test]
fn damage_at_the_edge_is_found_in_the_same_step() {
    for (edge, material) in [
        ("warn", "bond-based"),
        ("stop", "bond-based"),
        ("stop", "lps"),
    ] {
        let text = inner_plate(material, "[coupling.splice]")
            .replace(
                "damage-at-edge = \"warn\"",
                &format!("damage-at-edge = \"{edge}\""),
            )
            .replace("max = [0.0121, 0.0091]", "max = [0.0071, 0.0091]");
        let one = assert_same(&text, &[2, 3, 7]);
        let rows = String::from_utf8(one["scene_history.csv"].clone()).unwrap();
        assert_eq!(edge == "stop", rows.lines().count() < 10, "{edge}: {rows}");
    }
}

#[test]
fn a_zone_that_follows_the_crack_moves_alike() {
    let text = inner_plate("bond-based", "[coupling.splice]")
        .replace(
            "damage-at-edge = \"warn\"",
            "follow = { padding = 2.1e-3, ahead = 3.2e-3 }",
        )
        .replace("max = [0.0121, 0.0091]", "max = [0.0071, 0.0091]");
    assert_same(&text, &[2, 3]);
}

#[test]
fn a_coupled_run_that_was_killed_goes_on_with_other_processes() {
    killed_and_resumed(&inner_plate("lps", "[coupling.splice]"));
}

/// A plate with a zone so wide that families in its middle lie with one process alone, and a crack that runs through it into the seam.
fn wide_plate(material: &str, coupling: &str) -> String {
    let ratio = match material {
        "lps" => ", poisson-ratio = 0.3",
        _ => "",
    };
    format!(
        r#"
kinematics = "plane-stress"
mesh.rectangle = {{ min = [0, 0], max = [3.75, 3], x = {{ cells = 30 }}, y = {{ cells = 24 }} }}
materials.m.{material} = {{ youngs-modulus = 1000, density = 1, critical-stretch = 0.01{ratio} }}
zones.nonlocal.box = {{ min = [0.25, 0.25], max = [3.5, 2.75] }}
zones.damage-at-edge = "warn"
cracks.notch.segment = {{ from = [1.2, 1.5], to = [2.6, 1.5] }}
peridynamics = {{ horizon = 0.25, points.lattice = {{ spacing = 0.125, origin = [0.0625, 0.0625] }} }}
conditions.below.traction = {{ on = "bottom", y = -6 }}
conditions.above.traction = {{ on = "top", y = 6 }}
output.lines.axis = {{ from = [0, 1.4], to = [3.7, 1.6], samples = 9 }}
[solve.explicit]
duration = 0.3
outputs = 2
history-interval = 0.03
{coupling}
"#
    )
}

#[test]
fn cracks_run_alike_where_families_of_a_coupled_zone_are_held_by_their_owner() {
    let couplings = [
        "[coupling.splice]",
        "[coupling.truncated]",
        "[coupling.truncated]\ncut-bonds = \"linear\"",
    ];
    for coupling in couplings {
        for material in ["bond-based", "lps"] {
            println!("{material}, {coupling}");
            let text = wide_plate(material, coupling);
            assert!(held(&text, 4).iter().any(|n| *n < held(&text, 1)[0]));
            let one = assert_same(&text, &[4]);
            let rows = String::from_utf8(one["scene_history.csv"].clone()).unwrap();
            let column = |name: &str| {
                rows.lines()
                    .next()
                    .unwrap()
                    .split(',')
                    .position(|h| h == name)
            };
            let broken = column("broken_bonds").expect("a column");
            let last = rows.lines().last().unwrap().split(',').nth(broken);
            assert!(last.unwrap().parse::<f64>().unwrap() > 100.0, "{rows}");
        }
    }
}

/// Bonds that pass through a corner of the zone, from element to element, break too; no point at their ends is a site.
#[test]
fn broken_bonds_from_element_to_element_are_counted() {
    let text = r#"
kinematics = "plane-stress"
coupling = "truncated"
mesh.rectangle = { min = [0, 0], max = [16, 16], x = { cells = 16 }, y = { cells = 16 } }
materials.m.bond-based = { youngs-modulus = 1000, density = 1, critical-stretch = 0.05 }
peridynamics = { horizon = 2, points.lattice = { spacing = 1, origin = [0, 0] } }
zones.nonlocal.box = { min = [-1, 4], max = [12, 13] }
zones.damage-at-edge = "warn"
conditions.right.traction = { on = "right", x = 80 }
conditions.left.traction = { on = "left", x = -80 }
solver.unproven = "warn"
[solve.explicit]
duration = 0.6
outputs = 2
history-interval = 0.1
"#;
    assert_same(text, &[1, 3]);
}
