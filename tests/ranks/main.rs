//! Scenes on several processes have the results of one: processes are threads here, which gather as those of `mpirun` do. `.ci/petsc` runs the same on MPI.

mod at_rest;
mod coupled;
mod load_steps;
mod memory;
mod pieces;
mod threads;
mod traffic;

use std::path::Path;

use bondline::observe::checkpoint::Pace;
use bondline::run::StartFrom;

use pieces::assert_same_numbers;
use threads::{ALONE, How, assert_same, files, folder, run};

const PULLED_PLATE: &str = r#"
kinematics = "plane-stress"

[mesh.rectangle]
min = [0, 0]
max = [0.04, 0.02]
x = { cells = 40 }
y = { cells = 20 }

[peridynamics]
horizon = 1e-3
points.lattice = { spacing = "1e-3/3" }

[zones]
damage-at-edge = "warn"

[zones.nonlocal]
box = { min = [0, 0.0061], max = [0.0401, 0.0141] }

[cracks.notch]
segment = { from = [-0.01, 0.01], to = [0.015, 0.01] }

[solve.explicit]
duration = 10e-6
outputs = 3
history-interval = 0.5e-6

[conditions.below.traction]
on = "bottom"
y = -4e6

[conditions.above.traction]
on = "top"
y = 4e6

[output]
tips.front = { direction = [1, 0] }
sections.cut = { point = [0.02, 0.01], normal = [1, 0] }
"#;

/// A plate whose crack runs, with its material and coupling.
fn plate(material: &str, coupling: &str, more: &str) -> String {
    format!(
        "{more}\n{PULLED_PLATE}\n[materials.glass.{material}]\nyoungs-modulus = 72e9\ndensity = 2440\nfracture-energy = 3.8\nsoftening = 1\n{}\n{coupling}\n",
        if material == "lps" {
            "poisson-ratio = 0.25"
        } else {
            ""
        }
    )
}

#[test]
fn cracks_run_alike_on_any_number_of_processes() {
    let text = plate("bond-based", "[coupling.truncated]", "");
    let one = assert_same(&text, &[1, 2, 5]);
    // bonds have broken, or nothing was compared
    let table = String::from_utf8(one["scene_tip_front.csv"].clone()).unwrap();
    assert!(table.lines().count() > 3, "{table}");
}

/// Softened bonds are known to the process alone that computes them, so each computes all.
#[test]
fn so_do_those_whose_bonds_soften() {
    for (material, coupling) in [("bond-based", "truncated"), ("lps", "nonlocal")] {
        let text = match coupling {
            "nonlocal" => points_alone(material, ""),
            _ => plate(material, "[coupling.truncated]", ""),
        };
        let one = assert_same(&text.replace("softening = 1", "softening = 3"), &[1, 3]);
        let table = String::from_utf8(one["scene_tip_front.csv"].clone()).unwrap();
        assert!(table.lines().count() > 3, "{table}");
    }
}

#[test]
fn so_do_those_of_a_solid() {
    assert_same(&plate("lps", "[coupling.truncated]", ""), &[3]);
}

#[test]
fn so_do_those_of_listed_bonds() {
    let listed = plate("lps", "[coupling.splice]", "")
        .replace("points.lattice", "precision = \"single\"\npoints.lattice");
    assert_same(&listed, &[4]);
}

/// The plate of one model everywhere, whose processes hold the families of their own points.
fn points_alone(material: &str, more: &str) -> String {
    let text = plate(material, "[coupling.nonlocal]", more);
    let zones = "[zones]\ndamage-at-edge = \"warn\"\n\n[zones.nonlocal]\nbox = { min = [0, 0.0061], max = [0.0401, 0.0141] }\n";
    assert!(text.contains(zones));
    let text = text.replace(zones, "");
    let line = "lines.across = { from = [0.0101, 0], to = [0.0301, 0.02], samples = 12 }\n";
    text.replace("[output]\n", &format!("[output]\n{line}"))
}

#[test]
fn cracks_run_alike_where_each_process_holds_its_own_families() {
    let one = assert_same(&points_alone("bond-based", ""), &[1, 2, 5]);
    let table = String::from_utf8(one["scene_tip_front.csv"].clone()).unwrap();
    assert!(table.lines().count() > 3, "{table}");
    assert_same(&points_alone("lps", ""), &[2, 3]);
}

#[test]
fn so_do_those_of_listed_bonds_and_of_points_that_count_in_part() {
    for material in ["bond-based", "lps"] {
        let text = points_alone(material, "");
        let listed = text.replace("points.lattice", "precision = \"single\"\npoints.lattice");
        assert_same(&listed, &[3]);
    }
    let text = points_alone("lps", "");
    assert_same(
        &text.replace("points.lattice", "volumes = \"hhb\"\npoints.lattice"),
        &[4],
    );
}

/// A ball strikes the upper edge, across sites of several processes.
#[test]
fn an_impactor_pushes_sites_of_all_processes_alike() {
    let ball = "[impactors.ball]\nsphere = { center = [0.019, 0.0221], radius = 0.002 }\nmass = 0.03\nvelocity = { y = -40 }\n";
    let text = plate("bond-based", "[coupling.truncated]", "") + ball;
    let cut = "sections.cut = { point = [0.02, 0.01], normal = [1, 0] }\n";
    assert!(text.contains(cut));
    let text = text.replace(cut, "");
    let one = assert_same(&text, &[2, 3]);
    let table = String::from_utf8(one["scene_history.csv"].clone()).unwrap();
    let force = |row: &str| -> f64 { row.rsplit(',').next().unwrap().parse().unwrap() };
    assert!(table.lines().skip(1).any(|row| force(row) < 0.0), "{table}");
}

/// A pulse through a bar.
const WAVE: &str = r#"
kinematics = "bar"

[mesh.line]
min = 0
max = 100
x = { cells = 400 }

[materials.bar.bond-based]
youngs-modulus = 1
density = 1

[peridynamics]
horizon = 0.75

[zones.nonlocal]
box = { min = 60, max = 80 }

[coupling.splice]

[solve.explicit]
duration = 20
outputs = 4
history-interval = 0.25

[initial.hump.displacement]
x = "0.01 * exp(-((x - 55) / 4)^2)"

[conditions.left.displacement]
on = "left"
x = 0

[output]
probes.within = { at = 70 }
"#;

#[test]
fn a_pulse_crosses_seams_alike_also_where_there_are_more_processes_than_sites() {
    assert_same(WAVE, &[2, 3]);
    let few = WAVE
        .replace("cells = 400", "cells = 4")
        .replace("[coupling.splice]", "");
    let few = few.replace("[peridynamics]\nhorizon = 0.75\n", "coupling = \"local\"\n");
    let few = few.replace("[zones.nonlocal]\nbox = { min = 60, max = 80 }\n", "");
    let few = format!(
        "coupling = \"local\"\n{}",
        few.replace("coupling = \"local\"\n", "")
    );
    assert_same(&few, &[7]);
}

#[test]
fn more_processes_than_points_run_alike() {
    let few = WAVE
        .replace("cells = 400", "cells = 5")
        .replace("horizon = 0.75", "horizon = 60")
        .replace("[coupling.splice]", "[coupling.nonlocal]")
        .replace("[zones.nonlocal]\nbox = { min = 60, max = 80 }\n", "");
    assert_same(&few, &[7]);
    assert_same(
        &few.replace("bond-based", "lps").replace(
            "youngs-modulus = 1\n",
            "youngs-modulus = 1\npoisson-ratio = 0\n",
        ),
        &[7],
    );
}

#[test]
fn a_run_that_was_killed_goes_on_with_other_processes() {
    killed_and_resumed(&plate("bond-based", "[coupling.truncated]", ""));
}

#[test]
fn so_does_one_whose_processes_hold_their_own_families() {
    killed_and_resumed(&points_alone("lps", ""));
}

/// A run is killed on two processes, and goes on on four and on one.
fn killed_and_resumed(text: &str) {
    let every = Some(Pace::Steps(20));
    let one = folder();
    run(text, one.path(), How { every, ..ALONE }).expect("one process");
    let whole = How {
        ranks: 2,
        every,
        ..ALONE
    };
    let gathers = run(text, folder().path(), whole)
        .expect("two processes")
        .gathers;
    let several = folder();
    let killed = How {
        lives: gathers * 9 / 10,
        ..whole
    };
    assert_eq!(run(text, several.path(), killed), Err("killed".to_owned()));
    let left = files(several.path());
    assert!(left.contains_key("scene.checkpoint"), "{:?}", left.keys());
    assert!(left["scene_history.csv"].len() < files(one.path())["scene_history.csv"].len());
    for ranks in [4, 0] {
        let resumed = folder();
        for (name, bytes) in &left {
            std::fs::write(resumed.path().join(name), bytes).unwrap();
        }
        // of a process that wrote when another was killed
        std::fs::write(resumed.path().join("scene_0003_p7.vtu"), b"").unwrap();
        let how = How {
            ranks,
            start: StartFrom::Checkpoint,
            every,
            lives: usize::MAX,
        };
        run(text, resumed.path(), how).expect("the rest of the run");
        // those of the killed run are pieces, the rest is of these processes
        let sizes = assert_same_numbers(one.path(), resumed.path());
        let of_two = sizes.iter().filter(|pieces| pieces.len() == 2).count();
        let of_four = sizes.iter().filter(|pieces| pieces.len() == 4).count();
        assert!(of_two > 0 && (of_four > 0) == (ranks == 4), "{sizes:?}");
    }
}

#[test]
fn clocks_pace_no_checkpoints_of_several_processes() {
    let how = How {
        ranks: 2,
        every: Some(Pace::Clock(std::time::Duration::from_secs(1))),
        ..ALONE
    };
    let told = run(WAVE, folder().path(), how).expect_err("refused");
    assert!(told.contains("count steps"), "{told}");
}

/// A plastic square that is struck; families end at feet on the faces of elements, whose forces go to nodes of other processes.
#[test]
fn families_that_end_at_a_seam_move_alike() {
    let text = r#"
kinematics = "plane-stress"
coupling = "truncated"
mesh.rectangle = { min = [0, 0], max = [20, 20], x.cells = 20, y.cells = 20 }
[materials.m.plastic-correspondence]
youngs-modulus = 1000
poisson-ratio = 0.3
density = 1
yield-stress = 5
hardening-modulus = 100
[peridynamics]
horizon = 1.5
points.lattice = { spacing = 0.5 }
[zones.nonlocal]
box = { min = [7, 7], max = [13, 13] }
[initial.struck.velocity]
inside.box = { min = [-1, -1], max = [4, 21] }
x = 0.3
[solve.explicit]
duration = 0.5
outputs = 2
history-interval = 0.02
"#;
    assert_same(text, &[2, 5]);
}

/// A bar at rest.
fn bar(coupling: &str) -> String {
    format!(
        r#"
kinematics = "bar"

[mesh.line]
min = -0.5
max = 0.5
x = {{ cells = 100 }}

[materials.bar.lps]
youngs-modulus = 200e9
poisson-ratio = 0

[peridynamics]
horizon = 0.03

[zones.nonlocal]
box = {{ min = -0.25, max = 0.25 }}

[zones.transition]
around = 0.1

{coupling}

[conditions.left.displacement]
on = "left"
x = "1e-3*x"

[conditions.right.traction]
on = "right"
x = 200e6

[output]
lines.axis = {{ from = -0.5, to = 0.5, samples = 41 }}
sections.middle = {{ point = 0.003, normal = 1 }}
"#
    )
}

/// The rows of a CSV file of a folder.
pub fn rows(folder: &Path, name: &str) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(folder.join(name)).expect("a table");
    let numbers = |line: &str| line.split(',').map(|x| x.parse().unwrap_or(0.0)).collect();
    text.lines().skip(1).map(numbers).collect()
}

#[test]
fn bars_at_rest_are_straight_on_any_number_of_processes() {
    for coupling in [
        "[coupling.splice]",
        "[coupling.blending]",
        "[coupling.balanced]",
        "[coupling.truncated]",
        "[coupling.partial-stress]\nform = \"meshfree\"",
    ] {
        for ranks in [1, 3] {
            let folder = folder();
            run(&bar(coupling), folder.path(), How { ranks, ..ALONE }).expect(coupling);
            for row in rows(folder.path(), "scene_axis.csv") {
                let off = (row[1] - 1e-3 * row[0]).abs();
                assert!(off < 1e-9 * 5e-4, "{coupling} on {ranks}: {row:?}");
            }
            let force = rows(folder.path(), "scene_sections.csv")[0][0];
            assert!(
                (force / 200e6 - 1.0).abs() < 1e-9,
                "{coupling} on {ranks}: {force}"
            );
        }
    }
}

#[test]
fn warm_bodies_at_rest_expand_alike() {
    for coupling in ["truncated", "splice", "nonlocal", "local"] {
        let text = format!(
            r#"
kinematics = "plane-stress"
coupling = "{coupling}"
mesh.rectangle = {{ min = [0, 0], max = [2, 1], x = {{ cells = 16 }}, y = {{ cells = 8 }} }}
materials.m.lps = {{ youngs-modulus = 1000, poisson-ratio = 0.3, thermal-expansion = 1e-3 }}
peridynamics = {{ horizon = 0.25, points.lattice = {{ spacing = 0.125, origin = [0.0625, 0.0625] }} }}
{zone}
temperature = {{ value = "2 + x*y", reference = 1 }}
conditions.left.displacement = {{ on = "left", x = 0, y = 0 }}
conditions.right.traction = {{ on = "right", x = 0.5 }}
solver.tolerance = 1e-11
[output]
vtu = false
stresses = ["von-mises"]
lines.axis = {{ from = [0, 0.5], to = [2, 0.5], samples = 9 }}
"#,
            zone = match coupling {
                "nonlocal" | "local" => "",
                _ => "zones.nonlocal.box = { min = [0.5, 0], max = [1.5, 1] }",
            }
        );
        let solved = |ranks: usize| {
            let folder = folder();
            run(&text, folder.path(), How { ranks, ..ALONE }).expect(coupling);
            rows(folder.path(), "scene_axis.csv")
        };
        let one = solved(0);
        // it has expanded by about α ΔT L
        assert!(one[8][2] > 1.5e-3, "{:?}", one[8]);
        for (alone, together) in one.iter().zip(&solved(3)) {
            for (column, (a, b)) in alone.iter().zip(together).enumerate() {
                // stresses of a modulus of 1000 from displacements of 5e-3
                assert!((a - b).abs() < 1e-8, "{coupling}, column {column}: {a} {b}");
            }
        }
    }
}

#[test]
fn springs_swing_alike_and_are_refused_at_rest() {
    let spring = "[conditions.bed.spring]\ninside.box = { min = 40, max = 75 }\nx = 0.01\n";
    assert_same(&format!("{WAVE}\n{spring}"), &[3]);
    let still = format!("{}\n{spring}", bar("[coupling.splice]"));
    let still = still.replace("min = 40, max = 75", "min = 0, max = 0.5");
    let how = How { ranks: 2, ..ALONE };
    let told = run(&still, folder().path(), how).expect_err("refused");
    assert!(
        told.contains("springs in a static scene of several processes"),
        "{told}"
    );
}

#[test]
fn what_is_free_to_move_is_told_by_all() {
    let free = PULLED_PLATE
        .split("[solve.explicit]")
        .next()
        .expect("a plate");
    let free = free.replace("damage-at-edge = \"warn\"\n", "");
    let free = format!(
        "{free}\n[materials.glass.lps]\nyoungs-modulus = 1\npoisson-ratio = 0.25\n[coupling.splice]\n[conditions.below.displacement]\non = \"bottom\"\ny = 0\n"
    );
    let alone = run(&free, folder().path(), ALONE).expect_err("free");
    let several = run(&free, folder().path(), How { ranks: 3, ..ALONE }).expect_err("free");
    assert!(alone.contains("free to move"), "{alone}");
    assert_eq!(alone, several);
}
