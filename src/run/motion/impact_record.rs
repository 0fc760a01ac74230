//! Record of the impactors of a run: columns of the history, and the summary.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::coupling::{ContactPatch, Impact, ImpactorShape};
use crate::observe::report::number;
use crate::observe::summary::ImpactorSummary;
use crate::observe::warning::{Code, Quantity, Warning};
use crate::scene::impactors::Impactor;
use crate::solve::explicit::State;
use crate::tensor::{AXES, Vector};

/// The largest force of an impactor on the body so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Peak {
    /// Its size \[N\].
    force: f64,
    /// Its time \[s\].
    time: f64,
    /// The sites that touched then, or when they were counted last before.
    contact: ContactPatch,
    /// The force at which they were counted.
    counted: f64,
}

/// Rise of a force from which on the sites that touch are counted again: a pass over all of them, which costs as much as contact itself.
const COUNT_AGAIN: f64 = 1.01;

/// Sites across a contact, and by how much less the peak of its force varies with where a lattice lies: up to 33 % on fewer
/// than the first, 10 % on fewer than the second, 5 % beyond (docs/dynamics.md, rigid impactors).
const COARSE: f64 = 4.0;
/// See [`COARSE`].
const RESOLVED: f64 = 8.0;

/// Record of the impactors of a run.
pub struct ImpactRecord<const D: usize> {
    impact: Arc<Impact<D>>,
    names: Vec<String>,
    /// Velocities at time zero of those that move freely.
    thrown: Vec<Option<Vector<D>>>,
    /// The largest force of each so far.
    pub peaks: Vec<Peak>,
}

impl<const D: usize> ImpactRecord<D> {
    /// Of impactors whose largest forces so far are `peaks`, if there are any yet.
    pub fn new(impact: Arc<Impact<D>>, impactors: &[Impactor<D>], peaks: Option<&[Peak]>) -> Self {
        let none = || vec![Peak::default(); impactors.len()];
        Self {
            impact,
            names: impactors.iter().map(|i| i.name.clone()).collect(),
            thrown: impactors.iter().map(Impactor::thrown).collect(),
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

    /// Returns the force of an impactor on the body: that which decelerates a free one, or moves one that is prescribed.
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
            let peak = &mut self.peaks[k];
            if force > peak.force {
                (peak.force, peak.time) = (force, state.time);
                if force > COUNT_AGAIN * peak.counted {
                    peak.counted = force;
                    peak.contact = self.impact.contact(&state.u, k);
                }
            }
        }
    }

    /// Warns of impactors that have not touched the body, and of round ones that so few sites touch that the peak of the force depends on where these lie.
    pub fn warnings(&self) -> impl Iterator<Item = Warning> + '_ {
        let impactors = self.impact.impactors().iter();
        let all = impactors.zip(&self.names).zip(&self.peaks);
        all.filter_map(|((impactor, name), peak)| {
            if peak.force == 0.0 {
                return Some(Warning::new(Code::Impactor, format!(
                    "impactor `{name}` has not touched the body: look at where it begins, which way it moves, and how long the scene lasts"
                )));
            }
            let across = peak.contact.across;
            // a plane touches all of a face at once
            let is_round = D > 1 && !matches!(impactor.shape, ImpactorShape::Plane { .. });
            let (varies, part) = if across < COARSE { ("a third", 1.0 / 3.0) } else { ("a tenth", 0.1) };
            (is_round && across < RESOLVED).then(|| {
                Warning::new(Code::Impactor, format!(
                    "impactor `{name}`: the contact was {} sites wide at the peak of its force, which may be wrong by {varies}, as nodes and points happen to lie; {RESOLVED} sites resolve it; the momentum that it transfers needs fewer",
                    number(across.round()),
                )).of(Quantity::ContactForce, part)
            })
        })
    }

    /// Returns the summary of each impactor.
    pub fn summary(&self, state: &State) -> Vec<ImpactorSummary> {
        let of = |(k, name): (usize, &String)| {
            let [place, velocity] = self.motion(k, state);
            let mass = self.impact.impactors()[k].mass;
            ImpactorSummary {
                name: name.clone(),
                position: place.as_slice().to_vec(),
                velocity: velocity.as_slice().to_vec(),
                momentum: mass.map(|m| (velocity * m).as_slice().to_vec()),
                transferred: mass
                    .zip(self.thrown[k])
                    .map(|(m, v0)| ((v0 - velocity) * m).as_slice().to_vec()),
                peak_force: self.peaks[k].force,
                peak_time: self.peaks[k].time,
                peak_sites: self.peaks[k].contact.sites,
            }
        };
        self.names.iter().enumerate().map(of).collect()
    }
}
