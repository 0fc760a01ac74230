//! A system whose force is a matrix times its displacement.

use super::{
    BlockCsr, BodyHistory, BodyState, BondChanges, Dissipation, ElementTangent, FailureUpdate,
    Halfway, Interval, RateBounds, SemiDiscrete, SharedSteps, Symmetry, Tangent,
};

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
    ) -> BondChanges {
        self.stiffness.multiply_into(u, force);
        BondChanges::default()
    }

    fn force_beside_elements_into(&mut self, u: &[f64], force: &mut [f64], interval: Interval) {
        self.internal_force_into(u, force, interval, FailureUpdate::Frozen);
    }

    fn take_heat_work(&mut self) -> f64 {
        0.0
    }

    fn force_of_heating_into(
        &mut self,
        _u: &[f64],
        _force: &mut [f64],
        _from: Option<f64>,
        _to: f64,
    ) -> bool {
        false
    }

    fn stored_energy(&self, u: &[f64]) -> f64 {
        let force = self.stiffness.multiply(u);
        0.5 * u.iter().zip(&force).map(|(u, f)| u * f).sum::<f64>()
    }

    fn round_off(&self, _u: &[f64]) -> f64 {
        0.0
    }

    fn rate_bounds(&self) -> RateBounds {
        RateBounds::default()
    }

    fn shared_steps(&mut self) -> Option<&mut dyn SharedSteps> {
        None
    }

    fn sites_reached(&self, _own: &[bool]) -> Option<Vec<bool>> {
        None
    }
}

impl Tangent for LinearMotion {
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

    fn seam_sites(&self) -> Vec<u32> {
        (0..self.mass.len() as u32).collect()
    }

    fn symmetry(&self) -> Symmetry {
        self.symmetry
    }

    fn element_tangent(&self, _u: &[f64], _interval: Interval) -> Option<ElementTangent> {
        None
    }
}

impl BodyHistory for LinearMotion {
    fn commit(&mut self) {}

    fn dissipation(&self) -> Option<Dissipation> {
        None
    }

    fn set_dissipation(&mut self, _dissipation: Dissipation) {}

    fn account_for_breaks(&mut self, _at: &Halfway<'_>) {}

    fn damage_state(&self) -> Vec<u64> {
        Vec::new()
    }

    fn restore_damage(&mut self, state: &[u64]) -> bool {
        state.is_empty()
    }

    fn body_state(&self) -> Option<&dyn BodyState> {
        None
    }
}
