//! Scenes of finite elements and points on several processes: each receives what its own sites and the seam ask for, and the results are those of one.

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
        // splices and blendings of this plate have modes that grow slowly
        (
            "[solve.explicit]",
            "[solve.explicit]\ngrowing-modes = \"warn\"",
        ),
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

/// What is exchanged is what was predicted: ghosts of each process, no site of which it needs nothing.
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
