//! A wave that runs outwards in a ring, and a grid that follows it.
//!
//! The plate is at rest with the displacement `r exp(−r²/2σ²)` away from the middle. It has no curl, so that only waves of pressure (of speed 1) come of it:
//!
//! ```text
//! u_r(r, t) = σ⁴ ∫ k² exp(−k²σ²/2) cos(kt) J₁(kr) dk
//! ```

use std::ops::ControlFlow;

use rayon::prelude::*;

use crate::{
    Effort,
    bobaru::{
        adaptive::Change,
        nested::{
            plate::{Body, Plate},
            transfer::Scattered,
        },
    },
};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    solve::explicit::{Explicit, ExplicitParams, State, Undriven},
    tensor::Vector,
};

/// Width σ of the displacement at the start.
const WIDTH: f64 = 3.0;

/// The Bessel function of order one, by the trapezoidal rule over a period, which converges exponentially once its points are more than `x`.
fn bessel(x: f64) -> f64 {
    let points = x.abs() as usize + 40;
    let step = std::f64::consts::PI / points as f64;
    let sum: f64 = (0..2 * points)
        .map(|k| k as f64 * step)
        .map(|t| (t - x * t.sin()).cos())
        .sum();
    sum / (2 * points) as f64
}

/// The exact radial displacement at a time, at distances 0, `STEP`, … up to `reach`.
struct Exact {
    values: Vec<f64>,
}

impl Exact {
    /// Distance of the values.
    const STEP: f64 = 0.05;

    fn at(time: f64, reach: f64) -> Self {
        // exp(−k²σ²/2) is 1e-16 at 8.6/σ; of the trapezoidal rule Euler and Maclaurin's first term is taken off, dk⁴/720 times the third derivative 3σ⁴r at k = 0
        let dk = std::f64::consts::TAU / (4.0 * (reach + time) + 40.0 * WIDTH);
        let last = (8.6 / WIDTH / dk).ceil() as usize;
        let value = |n: usize| {
            let r = n as f64 * Self::STEP;
            let term = |k: f64| {
                (k * WIDTH).powi(2)
                    * (-0.5 * (k * WIDTH).powi(2)).exp()
                    * (k * time).cos()
                    * bessel(k * r)
            };
            let sum = WIDTH * WIDTH * dk * (1..=last).map(|i| term(i as f64 * dk)).sum::<f64>();
            sum - (dk * WIDTH).powi(4) * r / 240.0
        };
        let count = (reach / Self::STEP).ceil() as usize + 2;
        Self {
            values: (0..count).into_par_iter().map(value).collect(),
        }
    }

    fn displacement(&self, x: &Vector<2>) -> Vector<2> {
        let r = x.norm();
        if r == 0.0 {
            return Vector::zeros();
        }
        let t = r / Self::STEP;
        let n = (t as usize).min(self.values.len() - 2);
        let value = self.values[n] + (t - n as f64) * (self.values[n + 1] - self.values[n]);
        x * (value / r)
    }
}

fn initial(positions: &[Vector<2>]) -> Vec<f64> {
    positions
        .iter()
        .flat_map(|x| {
            let size = (-x.norm_squared() / (2.0 * WIDTH * WIDTH)).exp();
            [size * x[0], size * x[1]]
        })
        .collect()
}

/// Parameters of the refinement, and the duration of the motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The plate.
    pub plate: Plate,
    /// Cells with a site of at least this part of the largest energy density are refined.
    pub threshold: f64,
    /// And all within so many horizons of them.
    pub padding: f64,
    /// Steps between two looks at the energies.
    pub every: u64,
    /// Time step.
    pub step: f64,
    /// Steps.
    pub steps: u64,
}

/// A plate whose grid follows the energy.
pub struct Following {
    plan: Plan,
    levels: Vec<u8>,
    body: Body,
    u: Vec<f64>,
    v: Vec<f64>,
    /// Every change so far; momenta are those of the right half.
    pub changes: Vec<Change>,
    /// Sites times steps so far.
    pub site_steps: usize,
}

impl Following {
    /// The plate at rest with the displacement of the ring; the first grid follows its energy.
    ///
    /// # Errors
    /// The reason why a grid makes no body, as text.
    pub fn new(plan: Plan) -> Result<Self, String> {
        let levels = vec![0; plan.plate.cells().pow(2)];
        let mut plate = Self {
            body: plan.plate.body(&levels)?,
            levels,
            plan,
            u: Vec::new(),
            v: Vec::new(),
            changes: Vec::new(),
            site_steps: 0,
        };
        plate.rest();
        plate.levels = plate.wanted();
        plate.body = plate.plan.plate.body(&plate.levels)?;
        plate.rest();
        Ok(plate)
    }

    fn rest(&mut self) {
        self.u = initial(&self.body.positions);
        self.v = vec![0.0; self.u.len()];
    }

    /// Elastic and kinetic energy together.
    pub fn energy(&self) -> f64 {
        self.body.energies(&self.u, &self.v).iter().sum()
    }

    /// The levels that the energies ask for.
    fn wanted(&self) -> Vec<u8> {
        let plate = &self.plan.plate;
        let mut density = vec![0.0f64; self.levels.len()];
        let energies = self.body.energies(&self.u, &self.v);
        for ((x, e), m) in self
            .body
            .positions
            .iter()
            .zip(&energies)
            .zip(&self.body.motion.mass)
        {
            let cell = plate.index(plate.cell_at(x));
            density[cell] = density[cell].max(e / m);
        }
        let largest = density.iter().copied().fold(0.0, f64::max);
        let marked: Vec<usize> = (0..density.len())
            .filter(|&c| density[c] >= self.plan.threshold * largest)
            .collect();
        plate.levels_about(&marked, self.plan.padding)
    }

    /// Lines 3 to 15 of Algorithm 1.
    fn adapt(&mut self) -> Result<(), String> {
        let wanted = self.wanted();
        if wanted == self.levels {
            return Ok(());
        }
        let before = (self.energy(), self.body.momentum_of_right_half(&self.v));
        let body = self.plan.plate.body(&wanted)?;
        let scattered = Scattered::new(&self.body.positions);
        let [u, v] = scattered.carry(&body.positions, [&self.u, &self.v])?;
        (self.levels, self.body, self.u, self.v) = (wanted, body, u, v);
        self.changes.push(Change {
            energy: self.energy() / before.0 - 1.0,
            momentum: (self.body.momentum_of_right_half(&self.v) - before.1).norm(),
        });
        Ok(())
    }

    /// Lets the plate move to the end; `look` sees it after every leg.
    ///
    /// # Errors
    /// The reason why a grid makes no body or a motion no step, as text.
    pub fn run(&mut self, look: &mut dyn FnMut(&Self)) -> Result<(), String> {
        let mut done = 0;
        while done < self.plan.steps {
            if done > 0 {
                self.adapt()?;
            }
            let leg = self.plan.every.min(self.plan.steps - done);
            let state = State::start(std::mem::take(&mut self.u), std::mem::take(&mut self.v));
            let params = ExplicitParams::with_step(self.plan.step);
            let mut motion = Explicit::new(&mut self.body.motion, &Undriven, params, state)
                .map_err(|e| e.to_string())?;
            motion
                .run(leg, &mut |_| ControlFlow::Continue(()))
                .map_err(|e| e.to_string())?;
            let state = motion.into_state();
            (self.u, self.v) = (state.u, state.v);
            self.site_steps += leg as usize * self.body.positions.len();
            done += leg;
            look(self);
        }
        Ok(())
    }

    /// Relative L2 error of the displacement against another one.
    fn error(&self, exact: &Exact) -> f64 {
        let (mut miss, mut size) = (0.0, 0.0);
        for ((x, u), m) in self
            .body
            .positions
            .iter()
            .zip(self.u.chunks_exact(2))
            .zip(&self.body.motion.mass)
        {
            let wanted = exact.displacement(x);
            miss += m * (Vector::<2>::new(u[0], u[1]) - wanted).norm_squared();
            size += m * wanted.norm_squared();
        }
        (miss / size).sqrt()
    }
}

struct Outcome {
    error: f64,
    drift: f64,
    jump: f64,
    momentum: f64,
    changes: usize,
    site_steps: usize,
}

fn outcome(plan: &Plan, exact: &Exact) -> Result<Outcome, String> {
    let mut plate = Following::new(plan.clone())?;
    let first = plate.energy();
    let mut drift: f64 = 0.0;
    plate.run(&mut |p| drift = drift.max((p.energy() / first - 1.0).abs()))?;
    let speed: f64 = plate
        .v
        .chunks_exact(2)
        .zip(&plate.body.motion.mass)
        .map(|(v, m)| m * v[0].hypot(v[1]))
        .sum();
    let largest = |f: fn(&Change) -> f64| plate.changes.iter().map(f).fold(0.0, f64::max);
    Ok(Outcome {
        error: plate.error(exact),
        drift,
        jump: largest(|c| c.energy.abs()),
        momentum: largest(|c| c.momentum) / speed,
        changes: plate.changes.len(),
        site_steps: plate.site_steps,
    })
}

/// A grid that follows the ring.
struct Case {
    name: &'static str,
    levels: &'static [u32],
    threshold: f64,
}

/// Largest steps of the finest lattice are 0.17 here.
const STEP: f64 = 0.15;

const UNIFORM: Case = Case {
    name: "uniform, h/4",
    levels: &[1, 4],
    threshold: 0.0,
};

/// Ours, the text's threshold, and with a third level; then the uniform ones in between.
const CASES: [Case; 6] = [
    Case {
        name: "h and h/4, 25 %",
        levels: &[1, 4],
        threshold: 0.25,
    },
    Case {
        name: "h and h/4, 75 %",
        threshold: 0.75,
        ..UNIFORM
    },
    Case {
        name: "h, h/2 and h/4, 25 %",
        levels: &[1, 2, 4],
        threshold: 0.25,
    },
    Case {
        name: "h, h/2 and h/4, 75 %",
        levels: &[1, 2, 4],
        threshold: 0.75,
    },
    Case {
        name: "uniform, h/2",
        levels: &[1, 2],
        threshold: 0.0,
    },
    Case {
        name: "uniform, h",
        levels: &[1],
        threshold: 0.0,
    },
];

/// Refinement of nested lattices that follow the ring, against the uniform lattice of the finest level.
pub fn ring(effort: Effort) -> Table {
    let (half, time, cases) = match effort {
        Effort::Quick => (30, 14.0, &CASES[..2]),
        Effort::Full => (44, 28.0, &CASES[..]),
    };
    let mut table = Table::new(
        format!(
            "Refinement in a plane: a ring of pressure, sigma = 3 h, on a plate of {0} x {0} cells h to t = {time}; bond-based, m = 2; padding six horizons, a look at the energies every 16 steps of {STEP}. \
             Elements one cell thick keep the lattices apart",
            2 * half
        ),
        Columns::Full,
    );
    let plan = |case: &Case| Plan {
        plate: Plate {
            half,
            levels: case.levels.to_vec(),
            m: 2.0,
            crack: None,
        },
        threshold: case.threshold,
        padding: 6.0,
        every: 16,
        step: STEP,
        steps: (time / STEP).round() as u64,
    };
    let exact = Exact::at(plan(&UNIFORM).steps as f64 * STEP, 1.5 * half as f64);
    let outcomes: Vec<Result<Outcome, String>> = std::iter::once(&UNIFORM)
        .chain(cases)
        .collect::<Vec<_>>()
        .par_iter()
        .map(|case| outcome(&plan(case), &exact))
        .collect();
    let Some(Ok(base)) = outcomes.first() else {
        table.push(TableRow::at_most(UNIFORM.name, "error", f64::NAN, 0.0));
        return table;
    };
    for (k, (case, outcome)) in std::iter::once(&UNIFORM)
        .chain(cases)
        .zip(&outcomes)
        .enumerate()
    {
        match outcome {
            Ok(o) => table.rows.extend(rows(case.name, o, base, k)),
            Err(why) => {
                table.push(TableRow::at_most(case.name, "error", f64::NAN, 0.0).because(why))
            }
        }
    }
    table
}

/// The rows of a case: judged for the uniform one and ours, the others for comparison.
fn rows(name: &str, o: &Outcome, base: &Outcome, number: usize) -> Vec<TableRow> {
    let at_most = |quantity: &str, value: f64, limit: f64| match number {
        0 | 1 => TableRow::at_most(name, quantity, value, limit),
        _ => TableRow::info(name, quantity, value),
    };
    let mut rows = vec![
        TableRow::info(name, "error of u against the classical wave, L2", o.error),
        TableRow::info(name, "site steps", o.site_steps as f64),
        at_most("largest change of the energy over the run", o.drift, 0.01),
    ];
    if number == 0 {
        return rows;
    }
    let saved = base.site_steps as f64 / o.site_steps as f64;
    let quantity = "site steps of the uniform lattice over these";
    rows.push(at_most(
        "error over that of the uniform lattice",
        o.error / base.error,
        1.05,
    ));
    rows.push(match number {
        1 => TableRow::at_least(name, quantity, saved, 2.0),
        _ => TableRow::info(name, quantity, saved),
    });
    if o.changes > 0 {
        rows.push(TableRow::info(
            name,
            "changes of the grid",
            o.changes as f64,
        ));
        rows.push(at_most(
            "largest jump of the energy at a change",
            o.jump,
            1e-4,
        ));
        rows.push(
            at_most("largest jump of the momentum at a change", o.momentum, 1e-2).because(
                "of the right half of the plate, over the sum of the sizes of all momenta",
            ),
        );
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exact_wave_begins_as_stated_and_solves_its_equation() {
        let start = Exact::at(0.0, 12.0);
        for n in 0..start.values.len() {
            let r = n as f64 * Exact::STEP;
            let wanted = r * (-r * r / (2.0 * WIDTH * WIDTH)).exp();
            assert!(
                (start.values[n] - wanted).abs() < 1e-6,
                "{r}: {}",
                start.values[n] - wanted
            );
        }
        // u_tt = u_rr + u_r/r − u/r², by differences of second order, here 1e-3 of its terms
        let h = Exact::STEP;
        let [a, b, c] = [5.0 - h, 5.0, 5.0 + h].map(|t| Exact::at(t, 12.0));
        for n in [60, 100, 140] {
            let r = n as f64 * h;
            let u = &b.values;
            let rate = (a.values[n] - 2.0 * u[n] + c.values[n]) / (h * h);
            let space = (u[n - 1] - 2.0 * u[n] + u[n + 1]) / (h * h)
                + (u[n + 1] - u[n - 1]) / (2.0 * h * r)
                - u[n] / (r * r);
            assert!(
                (rate - space).abs() < 1e-3 * (rate.abs() + 0.1),
                "{r}: {rate} {space}"
            );
        }
    }

    #[test]
    fn the_grid_follows_the_ring_and_keeps_its_energy() {
        let plan = Plan {
            plate: Plate {
                half: 20,
                levels: vec![1, 2],
                m: 2.0,
                crack: None,
            },
            threshold: 0.25,
            padding: 1.0,
            every: 8,
            step: 0.3,
            steps: 40,
        };
        let mut plate = Following::new(plan).unwrap();
        let first = plate.energy();
        let middle = plate.plan.plate.index([20, 20]);
        assert_eq!(plate.levels[middle], 1);
        plate.run(&mut |_| ()).unwrap();
        // the ring is 12 away from the middle, where nothing is refined any more
        assert_eq!(plate.levels[middle], 0);
        assert_eq!(plate.levels[plate.plan.plate.index([31, 20])], 1);
        assert!(plate.changes.len() > 2);
        let drift = plate.energy() / first - 1.0;
        assert!(drift.abs() < 0.05, "{drift}");
    }
}
