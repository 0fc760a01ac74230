//! Balance of a body in equilibrium: its internal forces sum to zero, so that loads and reactions do.

use crate::model::Model;
use crate::tensor::Vector;

/// Forces that are none, over those that would displace the body as far by strains.
const ROUND_OFF: f64 = 1e-9;

/// Forces \[N\] that equilibria found to a tolerance leave in a body without stress that has moved by up to `furthest` \[m\].
pub(crate) fn round_off<const D: usize>(model: &Model<D>, furthest: f64) -> f64 {
    let cells = 0..model.mesh.cell_count();
    let volume: f64 = cells.map(|c| model.mesh.cell_volume(c).abs()).sum();
    let size = volume.powf(1.0 / D as f64);
    // force over displacement of the whole body
    let stiffness = model.tensor_of_cell(0).get(0, 0, 0, 0) * volume / (size * size);
    ROUND_OFF * stiffness * furthest
}

/// The largest displacement along an axis \[m\].
pub(crate) fn furthest(u: &[f64]) -> f64 {
    u.iter().fold(0.0, |most, u| most.max(u.abs()))
}

/// The sum of internal forces, against the forces that it is made of.
#[derive(Clone, Copy)]
pub(crate) struct Balance<const D: usize> {
    /// The sum of internal forces \[N\]: of loads and reactions together.
    pub force: Vector<D>,
    /// The sizes of nodal loads and reactions \[N\], summed.
    pub scale: f64,
}

impl<const D: usize> Balance<D> {
    /// Of forces by dof \[N\].
    pub fn of(internal: &[f64], load: &[f64], reactions: &[f64]) -> Self {
        let mut force = Vector::<D>::zeros();
        for (dof, f) in internal.iter().enumerate() {
            force[dof % D] += f;
        }
        // the sizes of nodal forces: their sum vanishes where pressure or two faces pull against each other
        let size = |forces: &[f64]| -> f64 {
            let nodal = forces.chunks_exact(D);
            nodal
                .map(|f| Vector::<D>::from_column_slice(f).norm())
                .sum()
        };
        let scale = size(load) + size(reactions);
        Self { force, scale }
    }

    /// The force over the sizes of all; 0 without any.
    pub fn relative(&self) -> f64 {
        match self.scale > 0.0 {
            true => self.force.norm() / self.scale,
            false => 0.0,
        }
    }
}
