//! Loads and prescribed motion of a scene as functions of time.

#![deny(clippy::wildcard_enum_match_arm)]

use super::driven_impactors::{DrivenImpactors, prescribed};
use super::way::Way;
use crate::run::error::RunError;
use crate::run::loads::{BodyForces, Loads, displacement, holders, is_function, values_at_dofs};
use crate::run::thermal::{ExpandingRows, Thermal};
use crate::scene::conditions::{Condition, Prescribed};
use crate::scene::impactors::Impactor;
use crate::solve::explicit::Drive;
use crate::tensor::Vector;
use crate::{coupling::Operator, model::Model};

/// The conditions of a scene on the sites of its model.
///
/// Conditions that do not change with time are evaluated once; those that depend on time alone, once per step and condition; the rest
/// at every place and every step.
pub struct SceneDrive<'a, const D: usize> {
    model: &'a Model<D>,
    conditions: &'a [Condition<D>],
    loads: Loads<'a, D>,
    /// The load that does not change.
    steady: Vec<f64>,
    /// Loads that depend on time alone.
    by_time: Vec<TimedLoad>,
    /// Loads that depend on time and place.
    by_both: Vec<usize>,
    /// Expansion by a temperature that changes, and the rows of all sites.
    heat: Option<(&'a Thermal<D>, ExpandingRows<D>)>,
    prescribed: Vec<u32>,
    /// The condition that holds each prescribed dof.
    holder: Vec<u32>,
    /// Displacement at time zero of each prescribed dof, from which a prescribed velocity begins.
    start: Vec<f64>,
    /// The way of each prescribed velocity that changes with time, by condition and axis.
    ways: Vec<[Option<Way>; D]>,
    /// Prescribed dofs held by functions of position.
    functions: Vec<FunctionTarget>,
    /// Impactors whose motion is prescribed; their dofs are the last.
    impactors: Option<DrivenImpactors<'a, D>>,
    step: f64,
}

/// A function of position, with the prescribed dofs that it holds and their places in the list of all.
struct FunctionTarget {
    condition: usize,
    axis: usize,
    dofs: Vec<usize>,
    places: Vec<usize>,
}

/// Finds the prescribed dofs that each function of position holds.
fn function_targets<const D: usize>(
    conditions: &[Condition<D>],
    prescribed: &[u32],
    holder: &[u32],
) -> Vec<FunctionTarget> {
    let mut found: Vec<FunctionTarget> = Vec::new();
    for (place, (&dof, &condition)) in prescribed.iter().zip(holder).enumerate() {
        let (dof, condition) = (dof as usize, condition as usize);
        let axis = dof % D;
        if !is_function(&conditions[condition], axis) {
            continue;
        }
        let of = |f: &&mut FunctionTarget| (f.condition, f.axis) == (condition, axis);
        match found.iter_mut().find(of) {
            Some(target) => {
                target.dofs.push(dof);
                target.places.push(place);
            }
            None => found.push(FunctionTarget {
                condition,
                axis,
                dofs: vec![dof],
                places: vec![place],
            }),
        }
    }
    found
}

/// One component of a load that depends on time alone.
struct TimedLoad {
    condition: usize,
    axis: usize,
    /// Dofs with the force of a unit field.
    forces: Vec<(u32, f64)>,
}

impl<'a, const D: usize> SceneDrive<'a, D> {
    /// The conditions of a scene over `steps` steps of `step`, from the displacement `start` of all dofs.
    ///
    /// `body_forces` says how finite elements distribute body forces to their nodes.
    ///
    /// # Errors
    /// [`RunError::Idle`] for a condition that meets no site.
    pub fn new(
        model: &'a Model<D>,
        conditions: &'a [Condition<D>],
        start: &[f64],
        (step, steps): (f64, u64),
        body_forces: BodyForces,
    ) -> Result<Self, RunError> {
        let dofs = model.sites.len() * D;
        let loads = Loads::new(model, conditions, body_forces)?;
        let mut steady = vec![0.0; dofs];
        let (mut by_time, mut by_both) = (Vec::new(), Vec::new());
        for number in loads.conditions() {
            let components = &conditions[number].components;
            if !components.depends_on_time() {
                loads.add_condition(&conditions[number], number, 0.0, &mut steady);
            } else if components.depends_on_position() {
                by_both.push(number);
            } else {
                for axis in (0..D).filter(|&k| components.0[k].is_some()) {
                    let mut unit = vec![0.0; dofs];
                    let field = |_: &_, n: &_| conditions[number].unit_density(axis, n);
                    loads.add(number, field, &mut unit);
                    let forces = unit.iter().enumerate().filter(|(_, f)| **f != 0.0);
                    let forces = forces.map(|(dof, f)| (dof as u32, *f)).collect();
                    by_time.push(TimedLoad {
                        condition: number,
                        axis,
                        forces,
                    });
                }
            }
        }
        let held = holders(model, conditions)?;
        let (prescribed, holder): (Vec<u32>, Vec<u32>) = held
            .iter()
            .enumerate()
            .filter_map(|(dof, h)| h.map(|h| (dof as u32, h as u32)))
            .unzip();
        let ways = conditions
            .iter()
            .map(|c| std::array::from_fn(|axis| way_of(c, axis, step, steps)))
            .collect();
        Ok(Self {
            model,
            conditions,
            loads,
            steady,
            by_time,
            by_both,
            heat: None,
            impactors: None,
            functions: function_targets(conditions, &prescribed, &holder),
            start: prescribed.iter().map(|&k| start[k as usize]).collect(),
            prescribed,
            holder,
            ways,
            step,
        })
    }

    /// With the forces of thermal expansion, by the rows of `operator`, the bonds of the body knowing their temperature unless all `is_linear`.
    ///
    /// # Errors
    /// [`RunError::Later`] for materials that expand differently where the coupling does not count them.
    pub fn heated(
        mut self,
        thermal: Option<&'a Thermal<D>>,
        operator: &Operator<'_, D>,
        is_linear: bool,
    ) -> Result<Self, RunError> {
        let Some(thermal) = thermal else {
            return Ok(self);
        };
        let rows = (operator, None);
        if thermal.temperature.varies_in_time() {
            let rows = thermal.rows(self.model, rows, !is_linear)?;
            self.heat = Some((thermal, rows));
        } else {
            let forces = thermal.forces_at(self.model, rows, !is_linear, 0.0)?;
            let loads = self.steady.iter_mut().zip(forces);
            loads.for_each(|(load, f)| *load += f);
        }
        Ok(self)
    }

    /// With the motion of the impactors that have no mass, over `steps` steps.
    #[must_use]
    pub fn with_impactors(mut self, impactors: &'a [Impactor<D>], steps: u64) -> Self {
        if !impactors.is_empty() {
            let sites = self.model.sites.len();
            self.prescribed.extend(prescribed(impactors, sites));
            self.impactors = Some(DrivenImpactors::new(impactors, self.step, steps));
        }
        self
    }

    /// Each prescribed dof with the condition that holds it; without those of impactors.
    pub fn holders(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        self.prescribed
            .iter()
            .copied()
            .zip(self.holder.iter().copied())
    }

    /// Returns true if a load changes with place and time, so that it is evaluated everywhere at every step.
    pub fn evaluates_everywhere(&self) -> bool {
        !self.by_both.is_empty()
    }

    /// The value of a component of a condition that depends on time at most.
    fn uniform(&self, condition: usize, axis: usize, time: f64) -> f64 {
        let origin = Vector::zeros();
        let components = &self.conditions[condition].components;
        components.at_time(axis, &origin, time).unwrap_or(0.0)
    }

    /// Hands the number, dof and condition of each prescribed dof, and the uniform value of its component if it has
    /// one, to `set`.
    fn each_prescribed(
        &self,
        time: f64,
        values: &mut [f64],
        set: impl Fn(usize, usize, &Condition<D>, Option<f64>) -> f64,
    ) {
        let uniform: Vec<[Option<f64>; D]> = self
            .conditions
            .iter()
            .enumerate()
            .map(|(number, c)| {
                std::array::from_fn(|axis| {
                    let e = c.components.0[axis].as_ref()?;
                    (!e.depends_on_position()).then(|| self.uniform(number, axis, time))
                })
            })
            .collect();
        for (p, value) in values.iter_mut().enumerate() {
            let (dof, holder) = (self.prescribed[p] as usize, self.holder[p] as usize);
            *value = set(p, dof, &self.conditions[holder], uniform[holder][dof % D]);
        }
    }

    /// The values of functions of position at the prescribed dofs that they hold, all of one function at once.
    fn of_functions(&self, time: f64) -> Vec<Option<f64>> {
        let mut values = vec![
            None;
            if self.functions.is_empty() {
                0
            } else {
                self.prescribed.len()
            }
        ];
        for of in &self.functions {
            let components = &self.conditions[of.condition].components;
            let found = values_at_dofs(self.model, components, of.axis, &of.dofs, time);
            for (&p, value) in of.places.iter().zip(found) {
                values[p] = Some(value);
            }
        }
        values
    }

    /// Displacement of a dof whose velocity is prescribed; `ways` are those that change with time.
    fn moved(&self, p: usize, dof: usize, time: f64, ways: &[[Option<f64>; D]]) -> f64 {
        let holder = self.holder[p] as usize;
        let way = ways[holder][dof % D]
            .unwrap_or_else(|| displacement(self.model, &self.conditions[holder], dof, 0.0) * time);
        self.start[p] + way
    }

    /// The way of a condition along an axis from time zero to `time`, if its velocity changes with time.
    fn way(&self, condition: usize, axis: usize, time: f64) -> Option<f64> {
        Some(self.ways[condition][axis].as_ref()?.at(time))
    }
}

/// The way of a condition along an axis, if that is a velocity that changes with time.
fn way_of<const D: usize>(
    condition: &Condition<D>,
    axis: usize,
    step: f64,
    steps: u64,
) -> Option<Way> {
    let expression = condition.components.0[axis].as_ref()?;
    let is_velocity = matches!(condition.prescribed, Prescribed::Velocity(_));
    (is_velocity && expression.depends_on_time()).then(|| Way::of(expression.clone(), step, steps))
}

impl<const D: usize> Drive for SceneDrive<'_, D> {
    fn load_into(&self, time: f64, load: &mut [f64]) {
        let (of_sites, of_impactors) = load.split_at_mut(self.steady.len());
        of_sites.copy_from_slice(&self.steady);
        of_impactors.fill(0.0);
        for timed in &self.by_time {
            let value = self.uniform(timed.condition, timed.axis, time);
            for (dof, f) in &timed.forces {
                load[*dof as usize] += f * value;
            }
        }
        for &number in &self.by_both {
            let condition = &self.conditions[number];
            self.loads.add_condition(condition, number, time, load);
        }
        if let Some((thermal, rows)) = &self.heat {
            let forces = thermal.forces(self.model, rows, time);
            load.iter_mut().zip(forces).for_each(|(load, f)| *load += f);
        }
    }

    fn is_steady(&self) -> bool {
        self.by_time.is_empty() && self.by_both.is_empty() && self.heat.is_none()
    }

    fn prescribed(&self) -> &[u32] {
        &self.prescribed
    }

    fn displacement_into(&self, time: f64, values: &mut [f64]) {
        let (values, of_impactors) = values.split_at_mut(self.holder.len());
        if let Some(impactors) = &self.impactors {
            impactors.displacement_into(time, of_impactors);
        }
        let ways: Vec<[Option<f64>; D]> = (0..self.conditions.len())
            .map(|c| std::array::from_fn(|axis| self.way(c, axis, time)))
            .collect();
        let of_functions = self.of_functions(time);
        self.each_prescribed(time, values, |p, dof, condition, uniform| {
            match (&condition.prescribed, uniform) {
                (Prescribed::Velocity(_), _) => self.moved(p, dof, time, &ways),
                (_, Some(value)) => value,
                (_, None) => match of_functions.get(p) {
                    Some(Some(value)) => *value,
                    _ => displacement(self.model, condition, dof, time),
                },
            }
        });
    }

    fn velocity_into(&self, time: f64, values: &mut [f64]) {
        let (values, of_impactors) = values.split_at_mut(self.holder.len());
        if let Some(impactors) = &self.impactors {
            impactors.velocity_into(time, of_impactors);
        }
        let h = self.step;
        self.each_prescribed(time, values, |_, dof, condition, uniform| {
            let at = |t: f64| displacement(self.model, condition, dof, t);
            match (&condition.prescribed, uniform) {
                (Prescribed::Velocity(_), Some(value)) => value,
                (Prescribed::Velocity(_), None) => at(time),
                // differences of what does not change would leave rounding
                _ if !condition.components.depends_on_time() => 0.0,
                // a displacement that changes: one-sided, for before the start there is nothing
                _ => (4.0 * at(time + h) - 3.0 * at(time) - at(time + 2.0 * h)) / (2.0 * h),
            }
        });
    }
}
