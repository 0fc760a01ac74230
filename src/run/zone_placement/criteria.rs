//! Cells that a displacement marks: it needs a nonlocal law where it varies within a horizon, and bonds where they are about to break.

use super::shapes::touching;
use crate::coupling::error_indicator::{Criteria, Need, gradient_ratio};
use crate::peridynamics::critical_stretch::stretch_of_equal_energy;
use crate::scene::conditions::Support;
use crate::scene::draft::Draft;
use crate::scene::error::SceneError;
use crate::scene::materials::{Material, elastic_cells};
use crate::scene::region;
use crate::tensor::Vector;

/// Input to the criteria for cells.
pub(super) struct CriterionInput<'a> {
    /// The material that the points will have.
    pub material: u16,
    /// Horizon at the centre of each cell \[m\].
    pub horizon: &'a [f64],
    /// Error of the local model that may remain, relative in the norm of energy.
    pub tolerance: f64,
    /// Fraction of the critical stretch from which a bond is about to break.
    pub stretch: f64,
}

/// Finds the cells in which the displacement needs bonds.
pub(super) fn need<const D: usize>(
    scene: &Draft<'_, D>,
    asked: &CriterionInput<'_>,
    cut: &[bool],
    displacement: &[Vector<D>],
) -> Result<Need, SceneError> {
    let (spec, mesh) = (scene.spec, &scene.mesh);
    let stuff = &scene.materials[asked.material as usize];
    let largest = asked.horizon.iter().copied().fold(0.0, f64::max);
    let mut no_fail = Vec::with_capacity(spec.no_fail.len());
    for (name, shape) in &spec.no_fail {
        no_fail.push(region::region(&format!("no-fail.{name}"), shape, mesh)?.select(mesh));
    }
    let unbreakable: Vec<bool> = (0..mesh.cell_count())
        .map(|c| no_fail.iter().any(|n| n[c]))
        .collect();
    let cells = scene.cell_material.clone();
    let elastic = elastic_cells(&scene.materials, cells, asked.material, mesh);
    let criteria = Criteria {
        mesh,
        elastic: &elastic,
        material: asked.material,
        horizon: asked.horizon,
        gradient_ratio: gradient_ratio::<D>(|r| micromodulus(stuff, r, largest), largest),
        tolerance: asked.tolerance,
        stretch: critical_stretch(stuff, largest).map(|s| asked.stretch * s),
        cut,
        unbreakable: &unbreakable,
        held: &held(scene, asked.horizon),
    };
    Ok(criteria.need(|n| displacement[n]))
}

/// Cells within a horizon of nodes whose motion is prescribed.
fn held<const D: usize>(scene: &Draft<'_, D>, horizon: &[f64]) -> Vec<bool> {
    let mesh = &scene.mesh;
    let mut nodes: Vec<u32> = Vec::new();
    for condition in &scene.conditions {
        match condition.support() {
            Some(Support::Set { nodes: set, .. }) => nodes.extend(set),
            Some(Support::Inside(region)) => nodes.extend(
                (0..mesh.nodes.len() as u32)
                    .filter(|&n| region.contains(&mesh.nodes[n as usize], 0.0)),
            ),
            None => {}
        }
    }
    mesh.grown(&touching(mesh, nodes), |c| horizon[c])
}

/// The micromodulus of the bonds of a material, up to a factor.
fn micromodulus<const D: usize>(material: &Material<D>, r: f64, horizon: f64) -> f64 {
    (material.law.as_ref()).map_or(0.0, |law| law.linearised().kernel(r, horizon))
}

/// The stretch at which bonds of a material break, or would if they did not soften. A fracture energy that gives none is left to the run to refuse.
fn critical_stretch<const D: usize>(material: &Material<D>, horizon: f64) -> Option<f64> {
    let of_energy = |energy: f64| {
        let bonds = (material.law.as_ref()).and_then(|law| law.bond_energy(horizon));
        let bonds = bonds.ok_or(())?;
        let linear = (bonds.critical_stretch::<D>(energy, horizon)).map_err(|_| ())?;
        let law = material.force_state();
        let ratio = |s: f64| law.map_or(1.0, |law| law.energy_ratio(s));
        stretch_of_equal_energy(linear, ratio).map_err(|_| ())
    };
    // where a criterion of a state holds is not known from an elastic solution
    material.fracture?.stretch(of_energy).ok().flatten()
}
