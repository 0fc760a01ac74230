//! What a run tells of its impactors: columns of the history, and the summary.

use std::sync::Arc;

use crate::coupling::Impact;
use crate::observe::summary::ImpactorSummary;
use crate::scene::impactors::Impactor;
use crate::solve::explicit::State;
use crate::tensor::Vector;

const AXES: [&str; 3] = ["x", "y", "z"];

/// The largest force of an impactor on the body so far: its size \[N\] and its time \[s\].
pub type Peak = (f64, f64);

/// What a run tells of its impactors.
pub struct ImpactRecord<const D: usize> {
    impact: Arc<Impact<D>>,
    names: Vec<String>,
    /// The largest force of each so far.
    pub peaks: Vec<Peak>,
}

impl<const D: usize> ImpactRecord<D> {
    /// Of impactors whose largest forces so far are `peaks`, if there are any yet.
    pub fn new(impact: Arc<Impact<D>>, impactors: &[Impactor<D>], peaks: Option<&[Peak]>) -> Self {
        let none = || vec![(0.0, 0.0); impactors.len()];
        Self {
            impact,
            names: impactors.iter().map(|i| i.name.clone()).collect(),
            peaks: peaks.map_or_else(none, <[Peak]>::to_vec),
        }
    }

    /// The columns of a row: energy of contact, then position, velocity and force on the body of each.
    pub fn header(&self) -> Vec<String> {
        let mut header = vec!["contact_energy".to_owned()];
        for name in &self.names {
            for kind in ["", "v", "force_"] {
                header.extend(AXES[..D].iter().map(|axis| format!("{name}_{kind}{axis}")));
            }
        }
        header
    }

    /// The numbers of a row.
    ///
    /// `forces` are those of supports and loads together by dof, as in the other methods.
    pub fn row(&self, state: &State, forces: &[f64]) -> Vec<f64> {
        let mut row = vec![self.impact.energy(&state.u)];
        for k in 0..self.names.len() {
            let [place, velocity] = self.motion(k, state);
            for vector in [place, velocity, self.force(k, state, forces)] {
                row.extend(vector.iter());
            }
        }
        row
    }

    /// Position and velocity of an impactor.
    fn motion(&self, k: usize, state: &State) -> [Vector<D>; 2] {
        let dof = (self.impact.sites() + k) * D;
        let of = |field: &[f64]| Vector::from_column_slice(&field[dof..][..D]);
        let at_rest = self.impact.impactors()[k].shape.place();
        [at_rest + of(&state.u), of(&state.v)]
    }

    /// The force of an impactor on the body: what decelerates a free one, or moves one that is prescribed.
    fn force(&self, k: usize, state: &State, forces: &[f64]) -> Vector<D> {
        let dof = (self.impact.sites() + k) * D;
        match self.impact.impactors()[k].mass {
            Some(mass) => Vector::from_fn(|axis, _| {
                // no number −0
                0.0 - mass * state.a.get(dof + axis).copied().unwrap_or(0.0)
            }),
            None => Vector::from_column_slice(&forces[dof..][..D]),
        }
    }

    /// Looks at the forces of a state.
    pub fn watch(&mut self, state: &State, forces: &[f64]) {
        for k in 0..self.names.len() {
            let force = self.force(k, state, forces).norm();
            if force > self.peaks[k].0 {
                self.peaks[k] = (force, state.time);
            }
        }
    }

    /// What the summary tells.
    pub fn summary(&self, state: &State) -> Vec<ImpactorSummary> {
        let of = |(k, name): (usize, &String)| {
            let [place, velocity] = self.motion(k, state);
            let mass = self.impact.impactors()[k].mass;
            ImpactorSummary {
                name: name.clone(),
                position: place.as_slice().to_vec(),
                velocity: velocity.as_slice().to_vec(),
                momentum: mass.map(|m| (velocity * m).as_slice().to_vec()),
                peak_force: self.peaks[k].0,
                peak_time: self.peaks[k].1,
            }
        };
        self.names.iter().enumerate().map(of).collect()
    }
}
