//! The tables of \[Bobaru2009\]: convergence, adaptive refinement and scaling in one dimension, beside ours.
//!
//! | file | what it reprints |
//! |---|---|
//! | `line` | the bar: nodes at any distances, one horizon each |
//! | `matrix` | the seven-node system and its condition, the jumps (29) to (34) |
//! | `statics` | Tables I and II |
//! | `goal` | goal-oriented refinement in statics |
//! | `dynamics` | Tables III and IV |
//! | `adaptive` | Algorithm 1: a grid that follows a wave |
//! | `waves` | Table V; energy, momentum and cost of refinement in dynamics |
//! | `nested` | the same refinement in a plane, on nested lattices |
//!
//! Assumptions that had to be made stand in the rows and in `docs/papers.md`.

pub mod adaptive;
pub mod dynamics;
pub mod goal;
pub mod line;
pub mod matrix;
pub mod nested;
pub mod statics;
pub mod waves;

use rayon::prelude::*;

use crate::Effort;
use bondline::{observe::report::Table, peridynamics::Micromodulus, progress::Progress};
use line::{Rule, Sharing, Weights};

/// The paper's discretisation with its constant micromodulus.
pub const PLAIN: Rule = Rule {
    micromodulus: Micromodulus::InverseDistance,
    weights: Weights::Raw,
    sharing: Sharing::Source,
};

/// The two micromoduli of every table, by the paper's names.
pub const KERNELS: [(&str, Micromodulus); 2] = [
    ("constant", Micromodulus::InverseDistance),
    ("triangular", Micromodulus::Triangular),
];

/// Slope of the straight line through `(ln x, ln |y|)` by least squares.
pub fn slope(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len() as f64;
    let lx: Vec<f64> = x.iter().map(|x| x.ln()).collect();
    let ly: Vec<f64> = y.iter().map(|y| y.abs().ln()).collect();
    let (mx, my) = (lx.iter().sum::<f64>() / n, ly.iter().sum::<f64>() / n);
    let both: f64 = lx.iter().zip(&ly).map(|(x, y)| (x - mx) * (y - my)).sum();
    let square: f64 = lx.iter().map(|x| (x - mx) * (x - mx)).sum();
    both / square
}

/// Runs the suite; the quick part leaves out Table III and the fine grids of Tables IV and V.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let mut parts: Vec<fn(Effort) -> Table> = vec![
        |_| matrix::matrix(),
        |_| matrix::jumps(),
        |_| statics::table_one(),
        |_| statics::table_two(),
        |_| goal::statics(),
        |_| waves::refinement(),
        nested::ring,
        |_| nested::opening(),
    ];
    if effort == Effort::Full {
        parts.push(|_| dynamics::table_three());
    }
    parts.push(dynamics::table_four);
    parts.push(waves::table_five);
    progress.stage("tables of Bobaru 2009", Some(parts.len() as u64));
    let tables = parts
        .par_iter()
        .map(|part| {
            let table = part(effort);
            progress.advance(1);
            table
        })
        .collect();
    progress.finish();
    tables
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graded(sharing: Sharing) -> line::Line {
        let mut x: Vec<f64> = (0..30).map(|i| 0.1 * f64::from(i)).collect();
        x.extend((0..60).map(|i| 3.0 + 0.05 * f64::from(i)));
        let horizon: Vec<f64> = x.iter().map(|&x| if x < 3.0 { 0.4 } else { 0.2 }).collect();
        let rule = Rule {
            weights: Weights::Normalised,
            micromodulus: Micromodulus::Triangular,
            sharing,
        };
        line::Line::new(x, &horizon, rule)
    }

    #[test]
    fn shared_bonds_are_pairs_and_the_source_rule_is_not() {
        for (sharing, pairs) in [(Sharing::Mean, true), (Sharing::Source, false)] {
            let line = graded(sharing);
            let u: Vec<f64> = line.x.iter().map(|x| (1.3 * x).sin()).collect();
            let mut force = vec![0.0; u.len()];
            line.force_into(&u, &mut force);
            let sum: f64 = force.iter().zip(&line.volume).map(|(f, v)| f * v).sum();
            let size: f64 = force
                .iter()
                .zip(&line.volume)
                .map(|(f, v)| (f * v).abs())
                .sum();
            assert_eq!(
                sum.abs() < 1e-13 * size,
                pairs,
                "{sharing:?}: {sum:e} of {size:e}"
            );
        }
    }

    #[test]
    fn equilibrium_is_that_of_the_dense_matrix() {
        let line = graded(Sharing::Source);
        let load: Vec<f64> = line.x.iter().map(|x| x.cos()).collect();
        let u = line.equilibrium(&load, |i| (i == 17).then_some(0.0));
        let mut matrix = -line.dense();
        matrix.row_mut(17).fill(0.0);
        matrix[(17, 17)] = 1.0;
        let mut right = nalgebra::DVector::from_vec(load);
        right[17] = 0.0;
        let dense = matrix.lu().solve(&right).unwrap();
        for (u, d) in u.iter().zip(dense.iter()) {
            assert!((u - d).abs() < 1e-9 * dense.amax(), "{u} {d}");
        }
    }

    #[test]
    fn no_row_is_short() {
        for table in run(Effort::Quick, &bondline::progress::Silent) {
            assert_eq!(
                table.count(bondline::observe::report::Verdict::Short),
                0,
                "{}",
                table.text()
            );
        }
    }
}
