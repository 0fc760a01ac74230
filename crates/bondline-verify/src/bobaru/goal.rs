//! Goal-oriented refinement in statics: divide whatever sees a watched point, until its displacement settles.

use crate::bobaru::line::{Line, Rule, Sharing, Weights};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    peridynamics::Micromodulus,
};

/// A goal: the displacement of one point to a tolerance.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// Half of the length of the bar.
    pub half: f64,
    /// Intervals of the first grid.
    pub intervals: usize,
    /// Horizon over spacing.
    pub m: f64,
    /// Position at which the displacement is wanted.
    pub target: f64,
    /// Positions of the forces, and their values.
    pub loads: Vec<(f64, f64)>,
    /// Change between two grids, relative to the displacement, at which it ends.
    pub tolerance: f64,
    /// Grids at most.
    pub levels: usize,
    /// Points that must not be seen by coarse nodes.
    pub watch: Watch,
}

/// The points for which the visibility criterion holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Watch {
    /// Target and loads, as the paper concludes from Table I.
    TargetAndLoads,
    /// Only the target.
    Target,
    /// Everything: uniform refinement.
    Everything,
}

/// One grid of a refinement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    /// Nodes.
    pub nodes: usize,
    /// Displacement of the target.
    pub value: f64,
    /// Its change from the grid before, relative to it.
    pub change: f64,
}

/// Refines until the target settles; the stages, the first grid first.
pub fn refine(goal: &Goal, rule: Rule) -> Vec<Stage> {
    let h = 2.0 * goal.half / goal.intervals as f64;
    let mut cells: Vec<f64> = vec![h; goal.intervals];
    let mut finest = h;
    let mut stages: Vec<Stage> = Vec::new();
    let mut watched: Vec<f64> = vec![goal.target];
    if goal.watch == Watch::TargetAndLoads {
        watched.extend(goal.loads.iter().map(|l| l.0));
    }
    // the bar is fixed in its middle: keep the grid symmetric, so that no force is left there
    watched.extend(watched.clone().iter().map(|x| -x));
    for _ in 0..goal.levels {
        let mut x = vec![-goal.half];
        for c in &cells {
            x.push(x[x.len() - 1] + c);
        }
        let n = x.len();
        let horizon: Vec<f64> = (0..n)
            .map(|i| {
                let left = cells[i.saturating_sub(1)];
                goal.m * left.max(cells[i.min(n - 2)])
            })
            .collect();
        let middle = x.partition_point(|&x| x < -1e-9);
        let seen: Vec<bool> = (0..n)
            .map(|i| {
                goal.watch == Watch::Everything
                    || watched
                        .iter()
                        .any(|p| (x[i] - p).abs() <= horizon[i] * (1.0 + 1e-9))
            })
            .collect();
        let line = Line::new(x, &horizon, rule);
        let mut load = vec![0.0; n];
        for &(at, total) in &goal.loads {
            line.add_point_load(&mut load, at, total);
        }
        let value = line.value(
            &line.equilibrium(&load, |i| (i == middle).then_some(0.0)),
            goal.target,
        );
        let change = stages
            .last()
            .map_or(f64::INFINITY, |s| (value / s.value - 1.0).abs());
        stages.push(Stage {
            nodes: n,
            value,
            change,
        });
        if change <= goal.tolerance {
            break;
        }
        cells = cells
            .iter()
            .enumerate()
            .flat_map(|(i, &c)| {
                let divide = c < 1.5 * finest && (seen[i] || seen[i + 1]);
                vec![if divide { 0.5 * c } else { c }; if divide { 2 } else { 1 }]
            })
            .collect();
        finest *= 0.5;
    }
    stages
}

/// The bar of section 5 by three choices of what is refined.
pub fn statics() -> Table {
    let mut table = Table::new(
        "Goal-oriented refinement in statics: forces +-1 at x = +-1, -10 < x < 10, u at x = 0.5, triangular micromodulus, m = 4, tolerance 0.1 %",
        Columns::Full,
    );
    let rule = Rule {
        micromodulus: Micromodulus::Triangular,
        weights: Weights::Normalised,
        sharing: Sharing::Source,
    };
    let goal = |watch| Goal {
        half: 10.0,
        intervals: 80,
        m: 4.0,
        target: 0.5,
        loads: vec![(1.0, 1.0), (-1.0, -1.0)],
        tolerance: 1e-3,
        levels: 7,
        watch,
    };
    let mut last = Vec::new();
    let pairs = Rule {
        sharing: Sharing::Mean,
        ..rule
    };
    for (name, watch, rule) in [
        (
            "visibility of target and loads",
            Watch::TargetAndLoads,
            rule,
        ),
        ("visibility of the target", Watch::Target, rule),
        ("uniform", Watch::Everything, rule),
        (
            "visibility of target and loads, forces in pairs",
            Watch::TargetAndLoads,
            pairs,
        ),
        (
            "visibility of the target, forces in pairs",
            Watch::Target,
            pairs,
        ),
    ] {
        let stages = refine(&goal(watch), rule);
        for (k, s) in stages.iter().enumerate() {
            let case = format!("{name}, grid {}", k + 1);
            table.push(TableRow::info(&case, "nodes", s.nodes as f64));
            table.push(TableRow::info(
                &case,
                "error [%]",
                100.0 * (s.value / 0.5 - 1.0).abs(),
            ));
        }
        if let Some(s) = stages.last() {
            last.push((s.nodes as f64, (s.value / 0.5 - 1.0).abs()));
        }
    }
    if let [seen, blind, uniform, ..] = last[..] {
        table.push(TableRow::at_most(
            "visibility of target and loads",
            "error [%]",
            100.0 * seen.1,
            0.2,
        ));
        table.push(TableRow::at_least(
            "visibility of target and loads",
            "nodes of the uniform grid over these",
            uniform.0 / seen.0,
            2.0,
        ));
        table.push(TableRow::at_least(
            "visibility of the target",
            "error over that with the loads in view",
            blind.1 / seen.1,
            1.0,
        ));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn watched_points_are_seen_only_by_the_finest_nodes() {
        let rule = Rule {
            micromodulus: Micromodulus::Triangular,
            weights: Weights::Normalised,
            sharing: Sharing::Source,
        };
        let goal = Goal {
            half: 10.0,
            intervals: 80,
            m: 4.0,
            target: 0.5,
            loads: vec![(1.0, 1.0), (-1.0, -1.0)],
            tolerance: 0.0,
            levels: 3,
            watch: Watch::TargetAndLoads,
        };
        let stages = refine(&goal, rule);
        assert_eq!(stages.len(), 3);
        // first grid: spacing 1/4, horizon 1, so that |x| ≤ 2 sees a load; 16 intervals and the two beside them are divided
        assert_eq!(stages[0].nodes, 81);
        assert_eq!(stages[1].nodes, 81 + 18);
        // and it ends where it settles
        let early = refine(
            &Goal {
                tolerance: 0.1,
                ..goal
            },
            rule,
        );
        assert_eq!(early.len(), 2);
    }
}
