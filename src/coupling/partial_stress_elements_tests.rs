//! Stresses of cells, one by one and in sums.

use super::*;
use crate::run::SceneModel;
use crate::run::block::Block;
use crate::tensor::{Tensor, Vector};

/// Sums of all components of some fields at once against the stress under each displacement.
fn sums_are_those_of_single_cells<const D: usize>(material: [&str; 2]) {
    let block = Block {
        coupling: "\"partial-stress\"",
        material,
        influence: "influence = \"gaussian\"\n",
        size: 3,
        has_triangles: false,
        widths: if D == 3 { [3, 3, 6] } else { [6, 6, 12] },
        ratio: 2,
        origin: 0.0,
    };
    let SceneModel {
        model, coupling, ..
    } = block.model::<D>();
    let operator = coupling.operator(&model).unwrap();
    let is_stressed = |c: &usize| model.roles[*c] == CellRole::StressElement;
    let cells: Vec<usize> = (0..model.mesh.cell_count()).filter(is_stressed).collect();
    let fields = [1.7, 0.3].map(|k| -> Vec<f64> {
        let at = |x: Vector<D>| (k * x.sum()).sin() + k * x[0] * x[D - 1];
        model.sites.iter().map(|site| at(site.position)).collect()
    });
    let sums = operator.sums_of_cell_stress(&cells, &fields);
    assert!(!cells.is_empty() && sums.len() == fields.len());
    for (field, sums) in fields.iter().zip(&sums) {
        for (c, sum) in sums.iter().enumerate() {
            let mut u = vec![0.0; field.len() * D];
            for (u, value) in u.chunks_mut(D).zip(field) {
                u[c] = *value;
            }
            let stress = |&cell: &usize| operator.cell_stress(cell, &u).unwrap();
            let (mut expected, mut size) = (Tensor::<D>::zeros(), 0.0);
            for stress in cells.iter().map(stress) {
                expected += stress;
                size += stress.amax();
            }
            let error = (sum - expected).amax() / size;
            assert!(error < 1e-13, "component {c}: {error:e}");
        }
    }
}

#[test]
fn one_pass_over_the_families_gives_the_stress_of_all_fields() {
    let pairwise = ["bond-based", ""];
    let state_based = ["lps", "poisson-ratio = 0.3\n"];
    let position_aware = ["pals", "poisson-ratio = 0.3\n"];
    sums_are_those_of_single_cells::<1>(state_based);
    sums_are_those_of_single_cells::<2>(pairwise);
    sums_are_those_of_single_cells::<2>(state_based);
    sums_are_those_of_single_cells::<2>(position_aware);
    sums_are_those_of_single_cells::<3>(pairwise);
    sums_are_those_of_single_cells::<3>(state_based);
    sums_are_those_of_single_cells::<3>(position_aware);
}
