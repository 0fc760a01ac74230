//! Refinement that moves with a wave: Algorithm 1, on a coarse grid whose intervals are divided and joined again.
//!
//! Differs from the text by: what it leaves open is a choice of [`Plan`]. Nodes of the coarse grid always stay, so that joining intervals deletes
//! only nodes that dividing them had added, and neither moves a node.

use crate::bobaru::line::{Line, Motion, Rule, RungeKutta};

/// Nodes of the refined zone that have the smaller horizon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Horizons {
    /// All of them.
    Zone,
    /// Those that refinement added ("update volume and horizon of the new node", Algorithm 1).
    NewNodes,
}

/// Interpolation of the fields at new nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// From the two nodes about them.
    Linear,
    /// By the cubic through four nodes of the coarse grid.
    Cubic,
}

/// Time integration of the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrator {
    /// Four force passes a step.
    RungeKutta,
    /// One force pass a step.
    Verlet,
}

/// Parameters of the refinement and of the run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Length of the bar.
    pub length: f64,
    /// Nodes of the coarse grid.
    pub nodes: usize,
    /// Horizon of the coarse grid.
    pub horizon: f64,
    /// Parts of a divided interval, and the ratio of horizons.
    pub ratio: usize,
    /// The discretisation.
    pub rule: Rule,
    /// Nodes whose energy density is at least this part of the largest are refined.
    pub threshold: f64,
    /// And all within so many coarse horizons of them.
    pub padding: f64,
    /// Horizons of the refined zone.
    pub horizons: Horizons,
    /// Transfer to new nodes.
    pub interpolation: Interpolation,
    /// Steps between two looks at the energies.
    pub every: usize,
    /// Time integration.
    pub integrator: Integrator,
    /// Time step.
    pub step: f64,
}

/// Change of energy and momentum by a change of the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Energy after it less energy before it, over that before it.
    pub energy: f64,
    /// Momentum after it less momentum before it.
    pub momentum: f64,
}

/// A bar whose grid follows the energy.
#[derive(Clone, Debug)]
pub struct Adaptive {
    plan: Plan,
    divided: Vec<bool>,
    line: Line,
    motion: Motion,
    /// Force density at the present displacement.
    force: Vec<f64>,
    work: RungeKutta,
    steps: usize,
    /// Every change so far.
    pub changes: Vec<Change>,
    /// Nodes times force passes so far.
    pub point_steps: usize,
    /// Fewest and most nodes so far.
    pub nodes: (usize, usize),
}

impl Adaptive {
    /// The bar at rest with a displacement; the first grid follows its energy.
    pub fn new(plan: Plan, field: impl Fn(f64) -> f64) -> Self {
        let divided = vec![false; plan.nodes - 1];
        let line = grid(&plan, &divided);
        let motion = Motion::at_rest(&line, &field);
        let mut bar = Self {
            force: Vec::new(),
            divided,
            line,
            motion,
            work: RungeKutta::default(),
            steps: 0,
            changes: Vec::new(),
            point_steps: 0,
            nodes: (usize::MAX, 0),
            plan,
        };
        bar.divided = bar.wanted();
        bar.line = grid(&bar.plan, &bar.divided);
        bar.motion = Motion::at_rest(&bar.line, &field);
        bar.refresh();
        bar
    }

    /// The grid now.
    pub fn line(&self) -> &Line {
        &self.line
    }

    /// Displacement and velocity now.
    pub fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Time.
    pub fn time(&self) -> f64 {
        self.steps as f64 * self.plan.step
    }

    fn refresh(&mut self) {
        self.force.resize(self.line.len(), 0.0);
        self.line.force_into(&self.motion.u, &mut self.force);
        let n = self.line.len();
        self.nodes = (self.nodes.0.min(n), self.nodes.1.max(n));
    }

    /// One step, after a look at the energies if one is due.
    pub fn advance(&mut self) {
        if self.steps.is_multiple_of(self.plan.every) && self.steps > 0 {
            self.adapt();
        }
        let passes = match self.plan.integrator {
            Integrator::RungeKutta => {
                self.motion
                    .runge_kutta(&self.line, self.plan.step, &mut self.work);
                4
            }
            Integrator::Verlet => {
                self.motion
                    .verlet(&self.line, self.plan.step, &mut self.force);
                1
            }
        };
        self.point_steps += passes * self.line.len();
        self.steps += 1;
    }

    /// Returns true for each interval of the coarse grid that is to be divided by the energies.
    fn wanted(&self) -> Vec<bool> {
        let energy = self.motion.energy_density(&self.line);
        let largest = energy.iter().copied().fold(0.0, f64::max);
        let reach = self.plan.padding * self.plan.horizon * (1.0 + 1e-9);
        let h = self.plan.length / (self.plan.nodes - 1) as f64;
        let last = self.plan.nodes - 2;
        let mut wanted = vec![false; self.divided.len()];
        let mut done = 0;
        for (x, e) in self.line.x.iter().zip(&energy) {
            if *e < self.plan.threshold * largest {
                continue;
            }
            // nodes within reach; the intervals on both sides of each of them
            let from = (((x - reach) / h).ceil().max(0.0) as usize).saturating_sub(1);
            let to = (((x + reach) / h).floor() as usize).min(last);
            for flag in &mut wanted[from.max(done)..=to] {
                *flag = true;
            }
            done = to + 1;
            if done > last {
                break;
            }
        }
        wanted
    }

    /// Lines 3 to 15 of Algorithm 1.
    fn adapt(&mut self) {
        let wanted = self.wanted();
        if wanted == self.divided {
            return;
        }
        let before = (
            self.motion.energy(&self.line),
            self.motion.momentum(&self.line),
        );
        let u = self.transferred(&wanted, &self.motion.u);
        let v = self.transferred(&wanted, &self.motion.v);
        self.line = grid(&self.plan, &wanted);
        self.divided = wanted;
        self.motion = Motion { u, v };
        self.refresh();
        self.changes.push(Change {
            energy: self.motion.energy(&self.line) / before.0 - 1.0,
            momentum: self.motion.momentum(&self.line) - before.1,
        });
    }

    /// A field on the grid to come: kept where nodes stay, interpolated where they are new.
    fn transferred(&self, wanted: &[bool], field: &[f64]) -> Vec<f64> {
        let ratio = self.plan.ratio;
        let starts = starts(&self.divided, ratio);
        let coarse: Vec<f64> = starts.iter().map(|&k| field[k]).collect();
        let mut out = Vec::with_capacity(field.len());
        for (c, &divide) in wanted.iter().enumerate() {
            out.push(coarse[c]);
            for part in 1..if divide { ratio } else { 1 } {
                out.push(if self.divided[c] {
                    field[starts[c] + part]
                } else {
                    let t = part as f64 / ratio as f64;
                    interpolated(&coarse, c, t, self.plan.interpolation)
                });
            }
        }
        out.push(coarse[wanted.len()]);
        out
    }
}

/// Returns the indices of the nodes of the coarse grid among all.
fn starts(divided: &[bool], ratio: usize) -> Vec<usize> {
    let mut at = vec![0];
    for &d in divided {
        at.push(at[at.len() - 1] + if d { ratio } else { 1 });
    }
    at
}

fn interpolated(coarse: &[f64], c: usize, t: f64, how: Interpolation) -> f64 {
    if how == Interpolation::Linear || coarse.len() < 4 {
        return coarse[c] * (1.0 - t) + coarse[c + 1] * t;
    }
    // the four nodes about the interval, or the outermost four
    let first = c.saturating_sub(1).min(coarse.len() - 4);
    let s = c as f64 + t - first as f64;
    (0..4)
        .map(|i| {
            let weight: f64 = (0..4)
                .filter(|&j| j != i)
                .map(|j| (s - j as f64) / (i as f64 - j as f64))
                .product();
            weight * coarse[first + i]
        })
        .sum()
}

fn grid(plan: &Plan, divided: &[bool]) -> Line {
    let h = plan.length / divided.len() as f64;
    let fine = plan.horizon / plan.ratio as f64;
    let mut x = Vec::new();
    let mut horizon = Vec::new();
    for c in 0..=divided.len() {
        let right = divided.get(c).copied().unwrap_or(false);
        let left = c > 0 && divided[c - 1];
        let inside = (left || c == 0) && (right || c == divided.len());
        x.push(c as f64 * h);
        horizon.push(if inside && plan.horizons == Horizons::Zone {
            fine
        } else {
            plan.horizon
        });
        if right {
            for part in 1..plan.ratio {
                x.push((c as f64 + part as f64 / plan.ratio as f64) * h);
                horizon.push(fine);
            }
        }
    }
    Line::new(x, &horizon, plan.rule)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bobaru::line::{Sharing, Weights};
    use bondline::peridynamics::Micromodulus;

    fn plan(interpolation: Interpolation) -> Plan {
        Plan {
            length: 60.0,
            nodes: 61,
            horizon: 3.0,
            ratio: 4,
            rule: Rule {
                micromodulus: Micromodulus::Triangular,
                weights: Weights::Normalised,
                sharing: Sharing::Mean,
            },
            threshold: 0.25,
            padding: 4.0,
            horizons: Horizons::Zone,
            interpolation,
            every: 8,
            integrator: Integrator::Verlet,
            step: 0.1,
        }
    }

    #[test]
    fn transfer_keeps_polynomials_of_its_degree_and_old_nodes() {
        for (how, degree) in [(Interpolation::Linear, 1), (Interpolation::Cubic, 3)] {
            let bar = Adaptive::new(plan(how), |x| (-0.05 * (x - 30.0).powi(2)).exp());
            assert!(bar.divided.iter().any(|&d| d) && !bar.divided.iter().all(|&d| d));
            let field = |x: f64| (0..=degree).map(|k| (0.1 * x - 2.0).powi(k)).sum::<f64>();
            let old: Vec<f64> = bar.line.x.iter().map(|&x| field(x)).collect();
            // the other intervals are divided, and those that are now are joined
            let wanted: Vec<bool> = bar.divided.iter().map(|d| !d).collect();
            let new = grid(&bar.plan, &wanted);
            let moved = bar.transferred(&wanted, &old);
            assert_eq!(moved.len(), new.len());
            for (x, f) in new.x.iter().zip(&moved) {
                assert!(
                    (f - field(*x)).abs() < 1e-12 * field(*x).abs().max(1.0),
                    "{how:?} at {x}"
                );
            }
        }
    }

    #[test]
    fn the_refined_zone_follows_the_wave_and_keeps_its_energy() {
        let mut bar = Adaptive::new(plan(Interpolation::Linear), |x| {
            (-0.05 * (x - 30.0).powi(2)).exp()
        });
        let first = bar.motion().energy(bar.line());
        let begin = bar.divided.clone();
        while bar.time() < 20.0 {
            bar.advance();
        }
        // two waves, 20 to either side of where they began, and nothing refined in between
        assert!(begin[30] && !bar.divided[30]);
        assert!(bar.divided[10] && bar.divided[49]);
        let drift = (bar.motion().energy(bar.line()) / first - 1.0).abs();
        assert!(drift < 0.01, "{drift}");
        // two equal waves, apart from what changes of the grid leave
        assert!(bar.motion().momentum(bar.line()).abs() < 1e-3);
        assert!(!bar.changes.is_empty());
    }
}
