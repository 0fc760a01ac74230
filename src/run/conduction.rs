//! The temperature that heat conduction gives, before the body deforms.
//!
//! Steady: `(K + H) T = f` ([`crate::fem::conductance`]). Transient: the Crank–Nicolson method, of second order in the time step Δt,
//!
//! ```text
//!   (C + ½Δt K) T₁ = (C − ½Δt K) T₀ + ½Δt (f₀ + f₁)
//! ```
//!
//! whose first two steps are four half steps of the backward Euler method, `(C + ½Δt K) T₁ = C T₀ + ½Δt f₁`: a temperature that jumps at the surface then does not ring, and the order stays.
//! Both have the same matrix, which is factorised once. Source: \[Rannacher1984\].

use std::sync::Arc;

use crate::coupling::Problem;
use crate::fem;
use crate::observe::report::number;
use crate::observe::summary::{Decision, Stopwatch, Timings};
use crate::progress::Progress;
use crate::run::equilibrium;
use crate::run::error::RunError;
use crate::run::setup::{self, RunSettings};
use crate::run::thermal::TemperatureField;
use crate::scene::Scene;
use crate::scene::conduction::{Conduction, HeatConditionKind};
use crate::scene::temperature::TemperatureValue;
use crate::solve::direct::Factor;
use crate::solve::statics::{self, StaticError, StaticParams, StaticProblem};
use crate::system::{BlockCsr, Symmetry};
use crate::tensor::{Vector, padded};

/// Steps at the beginning that are halved, by the backward Euler method.
const DAMPED: usize = 2;

/// As [`problem`], with the temperature that heat conduction gives if the scene asks for it.
///
/// # Errors
/// [`RunError::LooseTemperature`] for a part of the body whose steady temperature nothing prescribes, [`RunError::Solve`] of the solver.
pub(crate) fn heated_problem<const D: usize>(
    scene: Scene<D>,
    (timings, watch): (&mut Timings, &mut Stopwatch),
    progress: &dyn Progress,
) -> Result<(Problem<D>, RunSettings<D>), RunError> {
    let value = scene.temperature.as_ref().map(|t| t.value.clone());
    let may_part = !scene.barriers.is_empty() || scene.breaking.breaks();
    let (problem, mut rest) = setup::problem(scene);
    if let Some(TemperatureValue::Conduction(conduction)) = value {
        let params = equilibrium::params(&rest.solver);
        let (field, choice) = solve(&conduction, may_part, &params, progress)?;
        if let Some(thermal) = &mut rest.stresses.thermal {
            thermal.temperature = TemperatureField::Solved(Arc::new(field));
        }
        rest.choices.push(choice);
        watch.lap(timings, "heat conduction");
    }
    Ok((problem, rest))
}

/// Solves for the temperature; returns it, and the choice that a run reports. `may_part` is true of a scene with cracks, voids or bonds that break, across which heat flows on.
fn solve<const D: usize>(
    conduction: &Conduction<D>,
    may_part: bool,
    params: &StaticParams,
    progress: &dyn Progress,
) -> Result<(fem::NodalField<D>, Decision), RunError> {
    let heat = HeatProblem::new(conduction);
    let values = match &conduction.initial {
        Some(initial) => {
            let nodes = conduction.mesh.nodes.iter();
            let start = nodes.map(|x| initial.eval(&padded(x))).collect();
            heat.transient(start, params, progress)?
        }
        None => heat.steady(params, progress)?,
    };
    let all = values.iter().flatten();
    let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &t| {
        (low.min(t), high.max(t))
    });
    let steps = conduction.times.len() - 1;
    let kind = match (steps, &conduction.initial) {
        (0, _) => "steady".to_owned(),
        (_, None) => format!("steady at each of {steps} instants after the first"),
        (_, Some(_)) => format!("transient, {steps} steps"),
    };
    let choice = Decision {
        choice: format!("temperature by heat conduction, {kind}: {} to {}", number(low), number(high)),
        why: match may_part {
            true => "solved before the body deforms: cracks, voids and broken bonds do not hinder the heat",
            false => "solved before the body deforms, on the mesh of the scene",
        }
        .to_owned(),
    };
    let mesh = Arc::clone(&conduction.mesh);
    let field = fem::NodalField::new(mesh, conduction.times.clone(), values);
    Ok((field, choice))
}

/// Conductance with heat transfer, and where temperatures are prescribed.
struct HeatProblem<'a, const D: usize> {
    conduction: &'a Conduction<D>,
    conductance: BlockCsr,
    positions: Vec<[f64; 3]>,
}

impl<'a, const D: usize> HeatProblem<'a, D> {
    fn new(conduction: &'a Conduction<D>) -> Self {
        let mesh = &conduction.mesh;
        let mut conductance = fem::conductance(mesh, |c| conduction.conductivity[c]);
        for condition in &conduction.conditions {
            if let HeatConditionKind::Transfer(facets, h) = &condition.kind {
                for facet in facets {
                    fem::add_heat_transfer(mesh, facet, *h, &mut conductance);
                }
            }
        }
        Self {
            conduction,
            conductance,
            positions: mesh.nodes.iter().map(padded).collect(),
        }
    }

    /// The temperature of the nodes where it is prescribed, at the time `t`; zero of those without a cell.
    fn prescribed(&self, t: f64) -> Vec<Option<f64>> {
        let rows = self.conductance.row_offsets.windows(2);
        let mut found: Vec<Option<f64>> = rows.map(|r| (r[0] == r[1]).then_some(0.0)).collect();
        for condition in &self.conduction.conditions {
            if let HeatConditionKind::Temperature(nodes) = &condition.kind {
                for &n in nodes {
                    let x = &self.positions[n as usize];
                    found[n as usize] = Some(condition.value.eval_at(x, t));
                }
            }
        }
        found
    }

    /// The heat that flows into each node at the time `t` \[W\].
    fn load(&self, t: f64) -> Vec<f64> {
        let mesh = &self.conduction.mesh;
        let mut load = vec![0.0; mesh.nodes.len()];
        for condition in &self.conduction.conditions {
            // a heat flow has one component
            let scaled = |factor: f64| {
                move |x: &Vector<D>| {
                    let mut flow = Vector::zeros();
                    flow[0] = factor * condition.value.eval_at(&padded(x), t);
                    flow
                }
            };
            let mut add = |shares: Vec<(u32, Vector<D>)>| {
                for (n, flow) in shares {
                    load[n as usize] += flow[0];
                }
            };
            let (facets, factor) = match &condition.kind {
                HeatConditionKind::Temperature(_) => continue,
                HeatConditionKind::Source(cells) => {
                    for &c in cells {
                        add(fem::body_force_vector(mesh, c, scaled(1.0)));
                    }
                    continue;
                }
                HeatConditionKind::Flux(facets) => (facets, 1.0),
                HeatConditionKind::Transfer(facets, h) => (facets, *h),
            };
            for facet in facets {
                add(fem::traction_vector(mesh, facet, scaled(factor)));
            }
        }
        load
    }

    /// Steady temperatures at all instants.
    fn steady(
        &self,
        params: &StaticParams,
        progress: &dyn Progress,
    ) -> Result<Vec<Vec<f64>>, RunError> {
        let solver = HeatSolver::new(self, &self.conductance, params, progress)?;
        let times = self.conduction.times.iter();
        times
            .map(|&t| solver.solve(&self.load(t), &self.prescribed(t)))
            .collect()
    }

    /// Temperatures at all instants, from those at the first.
    fn transient(
        &self,
        start: Vec<f64>,
        params: &StaticParams,
        progress: &dyn Progress,
    ) -> Result<Vec<Vec<f64>>, RunError> {
        let (mesh, times) = (&self.conduction.mesh, &self.conduction.times);
        let capacity = fem::heat_capacity(mesh, |c| self.conduction.capacity[c]);
        let half = 0.5 * (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
        // both matrices have the pattern of the mesh
        let mut matrix = capacity.clone();
        for (sum, k) in matrix.values.iter_mut().zip(&self.conductance.values) {
            *sum += half * k;
        }
        let solver = HeatSolver::new(self, &matrix, params, progress)?;
        progress.stage("heat conduction", Some(times.len() as u64 - 1));
        let (mut now, mut load) = (start.clone(), self.load(times[0]));
        let mut values = vec![start];
        for (k, step) in times.windows(2).enumerate() {
            let implicit: &[f64] = match k < DAMPED {
                true => &[step[0] + half, step[1]],
                false => &[step[1]],
            };
            for &t in implicit {
                let mut right = capacity.multiply(&now);
                if k >= DAMPED {
                    let out = self.conductance.multiply(&now);
                    for ((right, load), out) in right.iter_mut().zip(&load).zip(&out) {
                        *right += half * (load - out);
                    }
                }
                load = self.load(t);
                for (right, load) in right.iter_mut().zip(&load) {
                    *right += half * load;
                }
                now = solver.solve(&right, &self.prescribed(t))?;
            }
            values.push(now.clone());
            progress.advance(1);
        }
        Ok(values)
    }
}

/// A matrix of conduction with its factors, where it is to be solved more than once and a factorisation is cheap.
struct HeatSolver<'a> {
    matrix: &'a BlockCsr,
    positions: &'a [[f64; 3]],
    factors: Option<Factor>,
    params: &'a StaticParams,
    progress: &'a dyn Progress,
}

impl<'a> HeatSolver<'a> {
    fn new<const D: usize>(
        problem: &'a HeatProblem<'_, D>,
        matrix: &'a BlockCsr,
        params: &'a StaticParams,
        progress: &'a dyn Progress,
    ) -> Result<Self, RunError> {
        let times = &problem.conduction.times;
        let mut made = Self {
            matrix,
            positions: &problem.positions,
            factors: None,
            params,
            progress,
        };
        let (load, prescribed) = (problem.load(times[0]), problem.prescribed(times[0]));
        let first = made.problem(&load, &prescribed);
        statics::well_posed(&first).map_err(loose)?;
        if times.len() > 1 {
            let factors = statics::factors(&first, params, progress)?;
            made.factors = factors.map(|(factors, _)| factors);
        }
        Ok(made)
    }

    fn problem<'p>(&'p self, load: &'p [f64], prescribed: &'p [Option<f64>]) -> StaticProblem<'p> {
        StaticProblem {
            stiffness: self.matrix,
            symmetry: Symmetry::Symmetric,
            positions: self.positions,
            load,
            prescribed,
        }
    }

    fn solve(&self, load: &[f64], prescribed: &[Option<f64>]) -> Result<Vec<f64>, RunError> {
        let Some(factors) = &self.factors else {
            let problem = self.problem(load, prescribed);
            let solved = statics::solve(&problem, self.params, self.progress);
            return Ok(solved.map_err(loose)?.displacement);
        };
        if let Some(site) = load.iter().position(|flow| !flow.is_finite()) {
            return Err(RunError::Solve(StaticError::NotFinite {
                what: "heat load",
                site,
                position: self.positions[site],
            }));
        }
        let held: Vec<f64> = prescribed.iter().map(|p| p.unwrap_or(0.0)).collect();
        let of_held = self.matrix.multiply(&held);
        let right: Vec<f64> = load.iter().zip(&of_held).map(|(f, k)| f - k).collect();
        let free = factors.solve(&right);
        Ok(held
            .iter()
            .zip(&free)
            .map(|(held, free)| held + free)
            .collect())
    }
}

/// The error of a solver of displacements in words of heat.
fn loose(error: StaticError) -> RunError {
    match error {
        StaticError::Singular {
            sites, positions, ..
        } => RunError::LooseTemperature {
            nodes: sites.len(),
            place: positions.first().map_or(Vec::new(), |x| x.to_vec()),
        },
        other => other.into(),
    }
}
