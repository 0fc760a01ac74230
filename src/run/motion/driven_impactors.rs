//! Motion of impactors that are not free, and the initial state of all impactors.

use super::way::Way;
use crate::scene::conditions::Components;
use crate::scene::impactors::{Impactor, ImpactorMotion};
use crate::solve::explicit::State;
use crate::tensor::Vector;

/// Appends displacement and velocity of the impactors at time zero.
pub(crate) fn extend_start<const D: usize>(state: &mut State, impactors: &[Impactor<D>]) {
    for impactor in impactors {
        let (u, v) = match &impactor.motion {
            ImpactorMotion::Free { velocity, .. } => (Vector::zeros(), *velocity),
            ImpactorMotion::Velocity(_) => (Vector::zeros(), Vector::zeros()),
            ImpactorMotion::Displacement(way) => {
                (way.vector(&Vector::zeros(), 0.0), Vector::zeros())
            }
        };
        state.u.extend(u.iter());
        state.v.extend(v.iter());
    }
}

/// The dofs of impactors whose motion is prescribed; `sites` is the number of sites of the body.
pub(crate) fn prescribed<const D: usize>(
    impactors: &[Impactor<D>],
    sites: usize,
) -> impl Iterator<Item = u32> + '_ {
    let driven = impactors.iter().enumerate();
    driven
        .filter(|(_, i)| i.mass().is_none())
        .flat_map(move |(k, _)| (0..D).map(move |axis| ((sites + k) * D + axis) as u32))
}

/// A prescribed translation.
struct Driven<'a, const D: usize> {
    components: &'a Components<D>,
    /// The ways of a velocity that changes with time; none of a displacement.
    kind: Kind<D>,
}

enum Kind<const D: usize> {
    Velocity([Option<Way>; D]),
    Displacement,
}

/// Impactors whose motion is prescribed, as functions of time.
pub(crate) struct DrivenImpactors<'a, const D: usize> {
    driven: Vec<Driven<'a, D>>,
    step: f64,
}

impl<'a, const D: usize> DrivenImpactors<'a, D> {
    /// Those of `impactors` that have no mass, over `steps` steps of `step`.
    pub fn new(impactors: &'a [Impactor<D>], step: f64, steps: u64) -> Self {
        let driven = impactors.iter().filter_map(|i| match &i.motion {
            ImpactorMotion::Free { .. } => None,
            ImpactorMotion::Velocity(components) => Some(Driven {
                components,
                kind: Kind::Velocity(std::array::from_fn(|k| {
                    let e = components.0[k].as_ref().filter(|e| e.depends_on_time())?;
                    Some(Way::of(e.clone(), step, steps))
                })),
            }),
            ImpactorMotion::Displacement(components) => Some(Driven {
                components,
                kind: Kind::Displacement,
            }),
        });
        Self {
            driven: driven.collect(),
            step,
        }
    }

    /// Overwrites `values` with displacements \[m\] at `time`, `D` of each in their order.
    pub fn displacement_into(&self, time: f64, values: &mut [f64]) {
        for (driven, values) in self.driven.iter().zip(values.chunks_exact_mut(D)) {
            let at = driven.components.vector(&Vector::zeros(), time);
            for (k, value) in values.iter_mut().enumerate() {
                *value = match &driven.kind {
                    Kind::Displacement => at[k],
                    Kind::Velocity(ways) => match &ways[k] {
                        Some(way) => way.at(time),
                        None => at[k] * time,
                    },
                };
            }
        }
    }

    /// Overwrites `values` with velocities \[m/s\] at `time`.
    pub fn velocity_into(&self, time: f64, values: &mut [f64]) {
        let h = self.step;
        for (driven, values) in self.driven.iter().zip(values.chunks_exact_mut(D)) {
            let at = |t: f64| driven.components.vector(&Vector::zeros(), t);
            let v = match driven.kind {
                Kind::Velocity(_) => at(time),
                // one-sided, for before the start there is nothing
                Kind::Displacement => {
                    (at(time + h) * 4.0 - at(time) * 3.0 - at(time + 2.0 * h)) / (2.0 * h)
                }
            };
            values.copy_from_slice(v.as_slice());
        }
    }
}
