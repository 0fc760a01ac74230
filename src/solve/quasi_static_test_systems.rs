//! Systems of a few unknowns for the tests of load steps.

use crate::system::{
    BlockCsr, BodyHistory, BodyState, BondChanges, Dissipation, ElementTangent, FailureUpdate,
    Halfway, Interval, RateBounds, SemiDiscrete, SharedSteps, Symmetry, Tangent,
};

/// Site 0 is held; fibres of stiffness 1 join it to site 1 and break beyond their own elongation; a spring of stiffness `spring` joins site 1 to site 2.
pub(super) struct Bundle {
    limits: Vec<f64>,
    pub intact: Vec<bool>,
    spring: f64,
    mass: [f64; 3],
}

impl Bundle {
    pub fn new(count: usize, spring: f64) -> Bundle {
        Bundle {
            limits: (1..=count).map(|i| i as f64 / count as f64).collect(),
            intact: vec![true; count],
            spring,
            mass: [1.0; 3],
        }
    }

    pub fn alive(&self) -> f64 {
        self.intact.iter().filter(|i| **i).count() as f64
    }
}

impl SemiDiscrete for Bundle {
    fn block(&self) -> usize {
        1
    }

    fn mass(&self) -> &[f64] {
        &self.mass
    }

    fn internal_force_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        _interval: Interval,
        breakage: FailureUpdate,
    ) -> BondChanges {
        let mut broken = 0;
        if breakage == FailureUpdate::Update {
            for (intact, limit) in self.intact.iter_mut().zip(&self.limits) {
                if *intact && u[1] - u[0] > *limit {
                    *intact = false;
                    broken += 1;
                }
            }
        }
        self.tangent_into(u, force);
        BondChanges::broken(broken)
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
        0.5 * (self.alive() * (u[1] - u[0]).powi(2) + self.spring * (u[2] - u[1]).powi(2))
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

impl Tangent for Bundle {
    fn tangent_into(&self, x: &[f64], y: &mut [f64]) {
        let (fibres, spring) = (self.alive() * (x[1] - x[0]), self.spring * (x[2] - x[1]));
        y.copy_from_slice(&[-fibres, fibres - spring, spring]);
    }

    fn difference_length(&self) -> Option<f64> {
        None
    }

    fn row_sums(&self) -> Vec<f64> {
        let (n, s) = (self.alive(), self.spring);
        vec![2.0 * n, 2.0 * (n + s), 2.0 * s]
    }

    fn tangent_is_constant(&self) -> Vec<bool> {
        vec![false; self.mass().len()]
    }

    fn tangent_rows(&self, _sites: &[u32]) -> BlockCsr {
        BlockCsr::default()
    }

    fn seam_sites(&self) -> Vec<u32> {
        (0..self.mass().len() as u32).collect()
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Symmetric
    }

    fn element_tangent(&self, _u: &[f64], _interval: Interval) -> Option<ElementTangent> {
        None
    }
}

impl BodyHistory for Bundle {
    fn commit(&mut self) {}

    fn dissipation(&self) -> Option<Dissipation> {
        None
    }

    fn set_dissipation(&mut self, _dissipation: Dissipation) {}

    fn account_for_breaks(&mut self, _at: &Halfway<'_>) {}

    fn damage_state(&self) -> Vec<u64> {
        self.intact.iter().map(|&i| u64::from(i)).collect()
    }

    fn restore_damage(&mut self, state: &[u64]) -> bool {
        self.intact = state.iter().map(|&i| i == 1).collect();
        true
    }

    fn body_state(&self) -> Option<&dyn BodyState> {
        None
    }
}

/// A chain whose springs bear `k e + b e³` at the elongation `e`.
pub(super) struct Hardening {
    pub k: Vec<f64>,
    pub b: f64,
    pub mass: Vec<f64>,
}

impl SemiDiscrete for Hardening {
    fn block(&self) -> usize {
        1
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
        force.fill(0.0);
        for (i, k) in self.k.iter().enumerate() {
            let e = u[i + 1] - u[i];
            let f = k * e + self.b * e.powi(3);
            force[i] -= f;
            force[i + 1] += f;
        }
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

    fn stored_energy(&self, _u: &[f64]) -> f64 {
        0.0
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

impl Tangent for Hardening {
    fn tangent_into(&self, x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        for (i, k) in self.k.iter().enumerate() {
            let f = k * (x[i + 1] - x[i]);
            y[i] -= f;
            y[i + 1] += f;
        }
    }

    fn difference_length(&self) -> Option<f64> {
        Some(1e-7)
    }

    fn row_sums(&self) -> Vec<f64> {
        let mut sums = vec![0.0; self.mass.len()];
        for (i, k) in self.k.iter().enumerate() {
            sums[i] += 2.0 * k;
            sums[i + 1] += 2.0 * k;
        }
        sums
    }

    fn tangent_is_constant(&self) -> Vec<bool> {
        vec![false; self.mass().len()]
    }

    fn tangent_rows(&self, _sites: &[u32]) -> BlockCsr {
        BlockCsr::default()
    }

    fn seam_sites(&self) -> Vec<u32> {
        (0..self.mass().len() as u32).collect()
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Symmetric
    }

    fn element_tangent(&self, _u: &[f64], _interval: Interval) -> Option<ElementTangent> {
        None
    }
}

impl BodyHistory for Hardening {
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
