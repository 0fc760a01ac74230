//! Whether internal forces of a body in equilibrium sum to nothing, so that loads and reactions do.

use crate::tensor::Vector;

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
