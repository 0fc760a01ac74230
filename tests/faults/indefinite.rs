//! A zone narrower than its families, at the surface of the body and on a lattice that its faces cut: pieces of bonds hand an element less than no volume.

use crate::{Case, flat};

const BLOCK: &str = r#"
kinematics = "solid"
coupling = "truncated"
[mesh.box]
cell = "tet4"
min = [0, 0, 0]
max = [6, 6, 6]
x = { cells = 6 }
y = { cells = 6 }
z = { cells = 6 }
[materials.m.lps]
youngs-modulus = 1
poisson-ratio = 0.3
density = 1
[peridynamics]
horizon = 3
points.lattice.spacing = 0.93
influence = { degree = 1, alpha = 1 }
[zones]
nonlocal.box = { min = [0, 2, 2], max = [4.5, 3.6, 4] }
[conditions.held.displacement]
on = "left"
x = 0
y = 0
z = 0
[conditions.pulled.traction]
on = "right"
x = 1e-3
[output]
vtu = false
"#;

const MOTION: &str = "\n[solve.explicit]\nduration = 12\noutputs = 1\n";

#[test]
fn a_seam_whose_energy_may_be_negative_is_refused_at_rest_and_in_motion() {
    // the motion ran away within nine steps of what was called a sum of squares, and statics took an LU factorisation without a word
    for text in [BLOCK.to_owned(), BLOCK.to_owned() + MOTION] {
        let case = Case::new(&text);
        let along_the_mesh = ["--set", "zones.rim=\"mesh\""];
        let said = case.run(&along_the_mesh).expect_err("it has no minimum");
        let said = flat(&said);
        assert!(said.contains("negative eigenvalue"), "{said}");
        assert!(said.contains("peridynamics.points out"), "{said}");
        // a rim of its own has one, and is taken where nothing is typed
        let summary = case.run(&[]).expect("its seam follows the lattice");
        assert!(
            summary["choices"].to_string().contains("a rim of"),
            "{summary}"
        );
    }
}

#[test]
fn the_same_zone_inside_is_definite() {
    let inside = "zones.nonlocal.box={min=[1,2,2],max=[4.5,3.6,4]}";
    let case = Case::new(&(BLOCK.to_owned() + MOTION));
    let summary = case.run(&["--set", inside]).expect("it runs");
    let proof = summary["proof"].to_string();
    assert!(proof.contains("no mode grows, proved"), "{proof}");
}

/// A zone that follows the lattice has strings along its edges, whose energies have either sign.
const ALIGNED: [&str; 8] = [
    "--set",
    "materials.m={bond-based={youngs-modulus=1,density=1}}",
    "--set",
    "mesh.box={min=[0,0,0],max=[6,6,6],x={cells=6},y={cells=6},z={cells=6}}",
    "--set",
    "peridynamics={horizon=2,points={lattice={spacing=1,origin=[0.5,0.5,0.5]}}}",
    "--set",
    "zones.nonlocal.box={min=[1,2,2],max=[4,4,4]}",
];

#[test]
fn strings_along_the_edges_of_a_zone_are_shown_definite_by_factors() {
    let case = Case::new(&(BLOCK.to_owned() + MOTION));
    let summary = case.run(&ALIGNED).expect("it runs");
    let proof = summary["proof"].to_string();
    assert!(
        proof.contains("proved: a Cholesky factorisation"),
        "{proof}"
    );
}

/// The lattice has its points a horizon apart to round-off, where `P_1/|ξ|` vanishes for one end of a bond and is 1e-31 for the other.
const HORIZON_APART: &str = r#"
kinematics = "plane-stress"
coupling = "truncated"
mesh.file.path = "MESH"
materials.m.lps = { youngs-modulus = 1, poisson-ratio = 0.35, density = 1 }
peridynamics = { horizon = 0.9, points.lattice = { spacing = 0.3 }, influence = { degree = 1, alpha = 1 } }
zones.nonlocal.box = { min = [6.13, 5.88], max = [14.21, 13.77] }
initial.kick.velocity = { x = "1e-3*sin(x)" }
solve.explicit = { duration = 0.1, outputs = 0 }
output.vtu = false
"#;

#[test]
fn weights_that_vanish_at_the_horizon_to_round_off_are_none() {
    // the fit divided one by the other, and what was left was called indefinite
    let mesh = concat!(
        concat!(env!("CARGO_MANIFEST_DIR"), "/../.."),
        "/meshes/graded_triangles.msh"
    );
    let case = Case::new(&HORIZON_APART.replace("MESH", mesh));
    let summary = case.run(&[]).expect("it runs");
    let proof = summary["proof"].to_string();
    assert!(proof.contains("a sum of squares"), "{proof}");
}
