//! A system whose force is a matrix times its displacement.

use super::{BlockCsr, BodyState, FailureUpdate, Interval, SemiDiscrete, Symmetry};

/// A linear system that moves: its stiffness as a matrix, for scenes in which nothing breaks.
#[derive(Clone, Debug)]
pub struct LinearMotion {
    /// `K`.
    pub stiffness: BlockCsr,
    /// Lumped mass of each site \[kg\].
    pub mass: Vec<f64>,
    /// Symmetry of `K`.
    pub symmetry: Symmetry,
}

impl SemiDiscrete for LinearMotion {
    fn block(&self) -> usize {
        self.stiffness.block
    }

    fn mass(&self) -> &[f64] {
        &self.mass
    }

    fn internal_force_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        _interval: Interval,
        _breakage: FailureUpdate,
    ) -> u64 {
        self.stiffness.multiply_into(u, force);
        0
    }

    fn commit(&mut self) {}

    fn tangent_into(&self, x: &[f64], y: &mut [f64]) {
        self.stiffness.multiply_into(x, y);
    }

    fn difference_length(&self) -> Option<f64> {
        None
    }

    fn row_sums(&self) -> Vec<f64> {
        self.stiffness.row_sums()
    }

    fn tangent_is_constant(&self) -> Vec<bool> {
        vec![true; self.mass.len()]
    }

    fn tangent_rows(&self, sites: &[u32]) -> BlockCsr {
        let mut rows = BlockCsr {
            block: self.stiffness.block,
            row_offsets: vec![0],
            ..BlockCsr::default()
        };
        for &site in sites {
            let (columns, blocks) = self.stiffness.row(site as usize);
            rows.columns.extend(columns);
            rows.values.extend(blocks);
            rows.row_offsets.push(rows.columns.len());
        }
        rows
    }

    fn body_state(&self) -> Option<&dyn BodyState> {
        None
    }

    fn symmetry(&self) -> Symmetry {
        self.symmetry
    }

    fn stored_energy(&self, u: &[f64]) -> f64 {
        let force = self.stiffness.multiply(u);
        0.5 * u.iter().zip(&force).map(|(u, f)| u * f).sum::<f64>()
    }
}
