//! An LPS below the Poisson ratio of a pairwise law beside truncated bonds: runs where the matrix is shown to be positive, or is refused.

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

#[test]
fn a_ratio_below_the_pairwise_one_runs_where_the_matrix_is_positive_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "plate.toml", &scene("-0.1", ""));
    let explicit = ["--set", "solve.explicit={duration=0.2,outputs=0}"];
    for set in [&[][..], &explicit] {
        let said = run(folder.path(), &[&["plate.toml"][..], set].concat());
        assert!(said.contains("the seam is stable"), "{said}");
        assert!(said.contains("-0.1000 is below 0.2500"), "{said}");
    }
    // far below it, and with long bonds, short pieces weigh too much
    let far = [
        "--set",
        "materials.foam.lps.poisson-ratio=-0.9",
        "--set",
        "peridynamics.horizon=0.6",
    ];
    for set in [&[][..], &explicit] {
        let said = refused(folder.path(), &[&far[..], set].concat());
        for part in [
            "-0.9000 is below 0.2500",
            "has a negative eigenvalue (found near (",
            "splice or blending",
        ] {
            assert!(said.contains(part), "{said}");
        }
    }
    // above it nothing is asked
    let said = run(
        folder.path(),
        &[
            "plate.toml",
            "--set",
            "materials.foam.lps.poisson-ratio=0.3",
        ],
    );
    assert!(!said.contains("the seam is stable"), "{said}");
}

#[test]
fn bonds_that_break_below_the_pairwise_ratio_are_refused_unless_those_of_the_seam_are_kept_whole() {
    let folder = tempfile::tempdir().unwrap();
    write(
        folder.path(),
        "plate.toml",
        &scene("0.1", ", critical-stretch = 0.1"),
    );
    let explicit = ["--set", "solve.explicit={duration=0.2,outputs=0}"];
    let said = refused(folder.path(), &explicit);
    for part in ["0.1000 is below 0.2500", "cut-bonds = \"linear\"", "splice"] {
        assert!(said.contains(part), "{said}");
    }
    let kept = ["--set", "coupling={truncated={cut-bonds=\"linear\"}}"];
    run(
        folder.path(),
        &[&["plate.toml"][..], &explicit, &kept].concat(),
    );
}
