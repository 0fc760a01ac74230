//! What drives a scene: its loads and prescribed motion as functions of time.

use crate::coupling::Model;
use crate::scene::conditions::{Condition, Prescribed};
use crate::scene::loads::{Loads, displacement, holders};
use crate::scene::run::RunError;
use crate::solve::explicit::Drive;
use crate::tensor::Vector;

/// The conditions of a scene on the sites of its model.
///
/// What does not change with time is evaluated once; what depends on time alone, once per step and condition; the rest
/// at every place and every step.
pub(super) struct SceneDrive<'a, const D: usize> {
    model: &'a Model<D>,
    conditions: &'a [Condition<D>],
    loads: Loads<'a, D>,
    /// The load that does not change.
    steady: Vec<f64>,
    /// Loads that depend on time alone.
    by_time: Vec<TimedLoad>,
    /// Loads that depend on time and place.
    by_both: Vec<usize>,
    prescribed: Vec<u32>,
    /// The condition that holds each prescribed dof.
    holder: Vec<u32>,
    /// Displacement at time zero of each prescribed dof, from which a prescribed velocity begins.
    start: Vec<f64>,
    /// The integral over time of each prescribed velocity, at every step, by condition and axis.
    travelled: Vec<[Vec<f64>; D]>,
    step: f64,
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
    /// # Errors
    /// [`RunError::Idle`] for a condition that meets no site.
    pub fn new(
        model: &'a Model<D>,
        conditions: &'a [Condition<D>],
        start: &[f64],
        step: f64,
        steps: u64,
    ) -> Result<Self, RunError> {
        let dofs = model.sites.len() * D;
        let loads = Loads::new(model, conditions)?;
        let mut steady = vec![0.0; dofs];
        let (mut by_time, mut by_both) = (Vec::new(), Vec::new());
        for number in loads.conditions() {
            let components = &conditions[number].components;
            if !components.depends_on_time() {
                loads.add(number, |x| components.vector(x, 0.0), &mut steady);
            } else if components.depends_on_position() {
                by_both.push(number);
            } else {
                for axis in (0..D).filter(|&k| components.0[k].is_some()) {
                    let mut unit = vec![0.0; dofs];
                    let along = Vector::<D>::from_fn(|k, _| f64::from(u8::from(k == axis)));
                    loads.add(number, |_| along, &mut unit);
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
        let travelled = conditions
            .iter()
            .map(|c| std::array::from_fn(|axis| travelled(c, axis, step, steps)))
            .collect();
        Ok(Self {
            model,
            conditions,
            loads,
            steady,
            by_time,
            by_both,
            start: prescribed.iter().map(|&k| start[k as usize]).collect(),
            prescribed,
            holder,
            travelled,
            step,
        })
    }

    /// Whether a load changes with place and time, so that it is evaluated everywhere at every step.
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

    /// Displacement of a dof whose velocity is prescribed.
    fn moved(&self, p: usize, dof: usize, time: f64) -> f64 {
        let holder = self.holder[p] as usize;
        let condition = &self.conditions[holder];
        let changes = |e: &crate::scene::Expression| e.depends_on_time();
        let way = if condition.components.0[dof % D]
            .as_ref()
            .is_some_and(changes)
        {
            let table = &self.travelled[holder][dof % D];
            let index = (time / self.step + 1e-6).floor().max(0.0);
            let known = table[(index as usize).min(table.len() - 1)];
            // steps that have changed their size in between do not end where the table has its entries
            let rest = time - index * self.step;
            if rest > 1e-5 * self.step {
                known + simpson(condition, dof % D, index * self.step, rest)
            } else {
                known
            }
        } else {
            displacement(self.model, condition, dof, 0.0) * time
        };
        self.start[p] + way
    }
}

/// The integral of a prescribed velocity that depends on time alone, at the beginning of each step and two beyond the last, by Simpson's rule.
fn travelled<const D: usize>(
    condition: &Condition<D>,
    axis: usize,
    step: f64,
    steps: u64,
) -> Vec<f64> {
    let mut table = vec![0.0];
    let expression = condition.components.0[axis].as_ref();
    let velocity = matches!(condition.prescribed, Prescribed::Velocity(_));
    if expression.is_some_and(|e| velocity && e.depends_on_time()) {
        let mut way = 0.0;
        for n in 0..steps + 2 {
            way += simpson(condition, axis, n as f64 * step, step);
            table.push(way);
        }
    }
    table
}

/// The integral of a prescribed velocity over `step` from `t` on, by Simpson's rule.
fn simpson<const D: usize>(condition: &Condition<D>, axis: usize, t: f64, step: f64) -> f64 {
    let v = |t: f64| {
        let e = condition.components.0[axis].as_ref();
        e.map_or(0.0, |e| e.eval_at(&[0.0; 3], t))
    };
    step / 6.0 * (v(t) + 4.0 * v(t + 0.5 * step) + v(t + step))
}

impl<const D: usize> Drive for SceneDrive<'_, D> {
    fn load_into(&self, time: f64, load: &mut [f64]) {
        load.copy_from_slice(&self.steady);
        for timed in &self.by_time {
            let value = self.uniform(timed.condition, timed.axis, time);
            for (dof, f) in &timed.forces {
                load[*dof as usize] += f * value;
            }
        }
        for &number in &self.by_both {
            let components = &self.conditions[number].components;
            self.loads.add(number, |x| components.vector(x, time), load);
        }
    }

    fn is_steady(&self) -> bool {
        self.by_time.is_empty() && self.by_both.is_empty()
    }

    fn prescribed(&self) -> &[u32] {
        &self.prescribed
    }

    fn displacement_into(&self, time: f64, values: &mut [f64]) {
        self.each_prescribed(time, values, |p, dof, condition, uniform| {
            match (&condition.prescribed, uniform) {
                (Prescribed::Velocity(_), _) => self.moved(p, dof, time),
                (_, Some(value)) => value,
                (_, None) => displacement(self.model, condition, dof, time),
            }
        });
    }

    fn velocity_into(&self, time: f64, values: &mut [f64]) {
        let h = self.step;
        self.each_prescribed(time, values, |_, dof, condition, uniform| {
            let at = |t: f64| displacement(self.model, condition, dof, t);
            match (&condition.prescribed, uniform) {
                (Prescribed::Velocity(_), Some(value)) => value,
                (Prescribed::Velocity(_), None) => at(time),
                // a displacement that changes: one-sided, for before the start there is nothing
                _ => (4.0 * at(time + h) - 3.0 * at(time) - at(time + 2.0 * h)) / (2.0 * h),
            }
        });
    }
}
