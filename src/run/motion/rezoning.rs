//! A change of the nonlocal zone in the middle of a motion: transfer of the state, and the energy and momentum that the change costs.

use crate::fem;
use crate::observe::rezoning_event::Switch;
use crate::run::error::RunError;
use crate::solve::explicit::{Drive, State};
use crate::system::SemiDiscrete;
use crate::tensor::Vector;
use crate::{coupling::Carried, model::Model};

/// Energies and momenta that a motion must keep over a change of the zone.
#[derive(Clone, Debug)]
struct Balance<const D: usize> {
    kinetic: f64,
    stored: f64,
    momentum: Vector<D>,
    /// About the middle of the mesh; its components by pairs of axes.
    angular: Vec<f64>,
    /// Sum of masses times speeds.
    scale: f64,
}

impl<const D: usize> Balance<D> {
    fn of(model: &Model<D>, system: &dyn SemiDiscrete, state: &State) -> Self {
        Self::with(model, system, state, system.stored_energy(&state.u))
    }

    /// With a stored energy that is known.
    fn with(model: &Model<D>, system: &dyn SemiDiscrete, state: &State, stored: f64) -> Self {
        let (low, high) = model.mesh.bounds();
        let middle = (low + high) * 0.5;
        let mut account = Self {
            kinetic: 0.0,
            stored,
            momentum: Vector::zeros(),
            angular: vec![0.0; D * (D - 1) / 2],
            scale: 0.0,
        };
        let fields = state.u.chunks_exact(D).zip(state.v.chunks_exact(D));
        for ((site, m), (u, v)) in model.sites.iter().zip(system.mass()).zip(fields) {
            let v = Vector::<D>::from_column_slice(v);
            let arm = site.position + Vector::<D>::from_column_slice(u) - middle;
            account.kinetic += 0.5 * m * v.norm_squared();
            account.momentum += v * *m;
            account.scale += m * v.norm();
            let mut pair = 0;
            for a in 0..D {
                for b in a + 1..D {
                    account.angular[pair] += m * (arm[a] * v[b] - arm[b] * v[a]);
                    pair += 1;
                }
            }
        }
        account
    }
}

/// A motion between two layouts.
pub(crate) struct Leaving<const D: usize> {
    carried: Carried<D>,
    state: State,
    before: Balance<D>,
    was: Vec<bool>,
}

impl<const D: usize> Leaving<D> {
    /// Records the state of a layout before the change.
    pub fn of(model: &Model<D>, system: &dyn SemiDiscrete, state: State) -> Self {
        Self {
            carried: Carried::of(model),
            before: Balance::of(model, system, &state),
            was: nonlocal(model),
            state,
        }
    }

    /// Steps and time so far.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Arrives at another layout: returns the state there, without accelerations, and the record of the change.
    ///
    /// The fields of new sites are fitted. A uniform velocity of them, supports left out, restores the linear momentum that the fit has lost, and a scale of their velocities about the mean restores
    /// the energy: that of short waves, which elements and points do not carry alike.
    ///
    /// # Errors
    /// [`RunError::Carry`] where there is nothing to fit to.
    pub fn arrive(
        self,
        model: &Model<D>,
        system: &dyn SemiDiscrete,
        drive: &dyn Drive,
    ) -> Result<(State, Switch), RunError> {
        let carrying = self.carried.onto(model)?;
        let mut state = State {
            u: carrying.field::<D>(&self.state.u),
            v: carrying.field::<D>(&self.state.v),
            a: Vec::new(),
            held: Vec::new(),
            ..self.state
        };
        let held = drive.prescribed();
        let mut values = vec![0.0; held.len()];
        let mut is_held = vec![false; state.u.len()];
        drive.displacement_into(state.time, &mut values);
        for (&k, value) in held.iter().zip(&values) {
            is_held[k as usize] = true;
            state.u[k as usize] = *value;
        }
        drive.velocity_into(state.time, &mut values);
        for (&k, value) in held.iter().zip(&values) {
            state.v[k as usize] = *value;
        }
        let fitted = Balance::of(model, system, &state);
        let lost = self.before.momentum - fitted.momentum;
        let fresh = Fresh::<D> {
            sites: &carrying.new,
            mass: system.mass(),
            is_held: &is_held,
        };
        fresh.push(&lost, &mut state.v);
        // only velocities change from here on
        let pushed = Balance::with(model, system, &state, fitted.stored);
        let energy = self.before.kinetic + self.before.stored - pushed.kinetic - pushed.stored;
        let restored = fresh.heat(energy, &mut state.v);
        let after = Balance::with(model, system, &state, fitted.stored);
        let now = nonlocal(model);
        let changed = |from: bool| {
            let pairs = self.was.iter().zip(&now);
            pairs
                .filter(|(was, now)| **was == from && **now != from)
                .count()
        };
        let turned: f64 = after
            .angular
            .iter()
            .zip(&self.before.angular)
            .map(|(a, b)| (a - b).powi(2))
            .sum();
        let switch = Switch {
            step: state.step,
            time: state.time,
            added: changed(false),
            removed: changed(true),
            share: share(model),
            energy: self.before.kinetic + self.before.stored,
            kinetic_jump: pushed.kinetic - self.before.kinetic,
            stored_jump: pushed.stored - self.before.stored,
            energy_restored: restored,
            momentum_restored: lost.norm(),
            angular_jump: turned.sqrt(),
            momentum_scale: self.before.scale,
        };
        Ok((state, switch))
    }
}

/// Sites that were none before, with their masses and held degrees of freedom.
struct Fresh<'a, const D: usize> {
    sites: &'a [u32],
    mass: &'a [f64],
    is_held: &'a [bool],
}

/// Velocities are scaled by no more than the root of this and of its inverse: what would need more is no loss of short waves.
const LARGEST_SCALE: f64 = 1.25;

impl<const D: usize> Fresh<'_, D> {
    /// Free sites along an axis, with their masses.
    fn along(&self, axis: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let dofs = self
            .sites
            .iter()
            .map(move |&s| (s as usize * D + axis, self.mass[s as usize]));
        dofs.filter(|(k, _)| !self.is_held[*k])
    }

    /// Mean velocity along an axis; none without a free site.
    fn mean(&self, axis: usize, v: &[f64]) -> Option<f64> {
        let (sum, mass) = self
            .along(axis)
            .fold((0.0, 0.0), |(p, m), (k, mass)| (p + mass * v[k], m + mass));
        (mass > 0.0).then(|| sum / mass)
    }

    /// Adds a linear momentum by one velocity of all.
    fn push(&self, momentum: &Vector<D>, v: &mut [f64]) {
        for axis in 0..D {
            let mass: f64 = self.along(axis).map(|(_, m)| m).sum();
            if mass > 0.0 {
                self.along(axis)
                    .for_each(|(k, _)| v[k] += momentum[axis] / mass);
            }
        }
    }

    /// Adds an energy by a scale of the velocities about their mean, so that the momentum stays; returns the energy added, zero if it is too much for them.
    fn heat(&self, energy: f64, v: &mut [f64]) -> f64 {
        let means: Vec<Option<f64>> = (0..D).map(|axis| self.mean(axis, v)).collect();
        let differing: f64 = (0..D)
            .filter_map(|axis| {
                let mean = means[axis]?;
                Some(
                    self.along(axis)
                        .map(|(k, m)| 0.5 * m * (v[k] - mean).powi(2))
                        .sum::<f64>(),
                )
            })
            .sum();
        let square = 1.0 + energy / differing;
        if !(1.0 / LARGEST_SCALE..LARGEST_SCALE).contains(&square) {
            return 0.0;
        }
        for (axis, mean) in means.iter().enumerate() {
            let Some(mean) = mean else { continue };
            self.along(axis)
                .for_each(|(k, _)| v[k] = mean + square.sqrt() * (v[k] - mean));
        }
        energy
    }
}

/// Returns true for each cell that holds points.
pub(crate) fn nonlocal<const D: usize>(model: &Model<D>) -> Vec<bool> {
    (0..model.mesh.cell_count())
        .map(|c| !model.is_element(c))
        .collect()
}

/// Returns the fraction of the volume of all cells that cells with points have.
pub(crate) fn share<const D: usize>(model: &Model<D>) -> f64 {
    let (mut points, mut all) = (0.0, 0.0);
    for c in 0..model.mesh.cell_count() {
        let volume = fem::cell_volume(&model.mesh, c);
        all += volume;
        if !model.is_element(c) {
            points += volume;
        }
    }
    points / all
}
