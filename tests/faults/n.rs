//! Stress of points with broken bonds is that of the bonds that stand.

use crate::Case;
use vtkio::model::{Attribute, DataSet, Vtk};

/// The stresses of a VTU file.
fn stresses(case: &Case, name: &str) -> Vec<f64> {
    let DataSet::UnstructuredGrid { mut pieces, .. } = Vtk::import(case.path(name)).unwrap().data
    else {
        panic!("not an unstructured grid");
    };
    let piece = pieces.remove(0).into_loaded_piece_data(None).unwrap();
    let stress = piece.data.cell.iter().find(|a| a.name() == "stress");
    let Some(Attribute::DataArray(array)) = stress else {
        panic!("no stress");
    };
    array.data.cast_into::<f64>().unwrap()
}

#[test]
fn halves_that_are_torn_apart_are_free_of_stress() {
    for law in ["bond-based]", "lps]\npoisson-ratio = 0.2"] {
        let case = Case::new(&format!(
            r#"
kinematics = "plane-stress"
coupling = "nonlocal"
[mesh.rectangle]
min = [0, 0]
max = [8, 5]
x = {{ spacing = 1 }}
y = {{ spacing = 1 }}
[materials.concrete.{law}
youngs-modulus = 1
critical-stretch = 1e-4
[peridynamics]
horizon = 2
points.lattice = {{ spacing = 1, origin = [0.5, 0.5] }}
[conditions.left.displacement]
inside.box = {{ min = [-1, -1], max = [4, 6] }}
x = 0
y = 0
[conditions.right.displacement]
inside.box = {{ min = [4, -1], max = [9, 6] }}
x = "0.01 * t"
y = 0
[solve.quasi-static]
steps = 2
[output]
name = "torn"
"#
        ));
        let summary = case.run(&[]).expect("it runs");
        assert!(summary["motion"]["broken_bonds"].as_f64().unwrap() > 0.0);
        // 0.01 apart, the family as it was would be stressed by about that
        for file in ["out/torn_0001.vtu", "out/torn_0002.vtu"] {
            let largest = stresses(&case, file)
                .into_iter()
                .fold(0.0, |m: f64, s| m.max(s.abs()));
            assert!(largest < 1e-12, "{law} {file}: {largest}");
        }
    }
}
