//! An LPS below the Poisson ratio of a pairwise law beside truncated bonds: a sum of squares where its pieces can be fitted; else it runs where the matrix is shown to be positive, or is refused.

use crate::{bondline, run, write};

fn scene(ratio: &str, rest: &str) -> String {
    format!(
        "kinematics = \"plane-strain\"
        mesh.rectangle = {{ min = [0, 0], max = [1.6, 1.6], x = {{ cells = 16 }}, y = {{ cells = 16 }} }}
        materials.foam.lps = {{ youngs-modulus = 1, poisson-ratio = {ratio}, density = 1{rest} }}
        peridynamics = {{ horizon = 0.3, points.lattice = {{ spacing = 0.1 }} }}
        zones.nonlocal.box = {{ min = [0.4, 0.4], max = [1.2, 1.2] }}
        coupling = \"truncated\"
        output.directory = \"out\"
        [conditions.left.displacement]
        on = \"left\"
        x = 0
        y = 0
        [conditions.right.displacement]
        on = \"right\"
        x = 1e-4\n"
    )
}

fn refused(folder: &std::path::Path, set: &[&str]) -> String {
    let output = bondline(folder)
        .args([&["run", "plate.toml"][..], set].concat())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr).replace('│', " ");
    said.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A part of the zone with a lattice of its own: the pieces at its faces are not fitted, and their dilatations are no sum of squares.
const BODIES: [&str; 2] = [
    "--set",
    "zones.bodies.fine={inside={box={min=[0.4,0.4],max=[0.8,1.2]}},spacing=0.05,horizon=0.15}",
];

const EXPLICIT: [&str; 2] = ["--set", "solve.explicit={duration=0.2,outputs=0}"];

/// Far below the pairwise ratio, and with long bonds, short pieces weigh too much.
const FAR: [&str; 4] = [
    "--set",
    "materials.foam.lps.poisson-ratio=-0.9",
    "--set",
    "peridynamics.horizon=0.6",
];

#[test]
fn one_lattice_has_a_seam_of_squares_at_every_ratio_and_its_bonds_may_break() {
    let folder = tempfile::tempdir().unwrap();
    write(
        folder.path(),
        "plate.toml",
        &scene("-0.1", ", critical-stretch = 0.1"),
    );
    for set in [&[][..], &FAR] {
        for explicit in [&[][..], &EXPLICIT] {
            let said = run(
                folder.path(),
                &[&["plate.toml"][..], set, explicit].concat(),
            );
            // nothing has to be shown of it
            assert!(!said.contains("the seam is stable"), "{said}");
        }
    }
}

/// Every family of a plate four points thick lacks bonds: the fit has no loaded node to measure what is left by.
#[test]
fn a_thin_plate_of_glass_has_a_seam_of_squares() {
    let folder = tempfile::tempdir().unwrap();
    let solid = scene("0.22", ", critical-stretch = 0.1")
        .replace("plane-strain", "solid")
        .replace(
            "mesh.rectangle = { min = [0, 0], max = [1.6, 1.6], x = { cells = 16 }, y = { cells = 16 } }",
            "mesh.box = { min = [0, 0, 0], max = [1.6, 0.8, 0.4], x = { cells = 16 }, y = { cells = 8 }, z = { cells = 4 } }",
        )
        .replace("{ min = [0.4, 0.4], max = [1.2, 1.2] }", "{ min = [0.5, -1, -1], max = [1.1, 2, 1] }")
        .replace("y = 0\n", "y = 0\n        z = 0\n");
    write(folder.path(), "plate.toml", &solid);
    let said = run(folder.path(), &[&["plate.toml"][..], &EXPLICIT].concat());
    assert!(!said.contains("the seam is stable"), "{said}");
}

#[test]
fn several_lattices_run_where_the_matrix_is_positive_and_say_so() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "plate.toml", &scene("-0.1", ""));
    for set in [&[][..], &EXPLICIT] {
        let said = run(folder.path(), &[&["plate.toml"][..], &BODIES, set].concat());
        assert!(said.contains("the seam is stable"), "{said}");
        assert!(said.contains("-0.1000 is below 0.2500"), "{said}");
    }
    for set in [&[][..], &EXPLICIT] {
        let said = refused(folder.path(), &[&BODIES[..], &FAR, set].concat());
        for part in [
            "-0.9000 is below 0.2500",
            "has a negative eigenvalue (found near (",
            "splice or blending",
        ] {
            assert!(said.contains(part), "{said}");
        }
    }
    // above it nothing is asked
    let above = ["--set", "materials.foam.lps.poisson-ratio=0.3"];
    let said = run(
        folder.path(),
        &[&["plate.toml"][..], &BODIES, &above].concat(),
    );
    assert!(!said.contains("the seam is stable"), "{said}");
}

#[test]
fn bonds_of_several_lattices_that_break_below_the_pairwise_ratio_are_refused_unless_those_of_the_seam_are_kept_whole()
 {
    let folder = tempfile::tempdir().unwrap();
    write(
        folder.path(),
        "plate.toml",
        &scene("0.1", ", critical-stretch = 0.1"),
    );
    let said = refused(folder.path(), &[&BODIES[..], &EXPLICIT].concat());
    for part in ["0.1000 is below 0.2500", "cut-bonds = \"linear\"", "splice"] {
        assert!(said.contains(part), "{said}");
    }
    let kept = ["--set", "coupling={truncated={cut-bonds=\"linear\"}}"];
    run(
        folder.path(),
        &[&["plate.toml"][..], &BODIES, &EXPLICIT, &kept].concat(),
    );
}
