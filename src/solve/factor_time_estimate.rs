//! Duration of a direct solve on this machine, estimated from a few of its fronts, factorised with made-up entries.
//!
//! Fronts are sorted into classes by their operations; of each class one front runs, with the pivots, rows and
//! contribution blocks that it will have, and counts for all. Large ones run shrunk, and count by their operations. So the
//! cost follows the machine, its load and its instruction set, and the small fronts that no rate per operation fits.

use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::direct::Analysis;
use super::multifrontal::trial_front;
use super::symbolic::Symbolic;
use crate::system::Symmetry;

/// Seconds that parts of a direct solve will take.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rehearsed {
    /// The factorisation.
    pub factorisation: f64,
    /// One substitution, forwards and backwards.
    pub substitution: f64,
}

/// A front of more operations runs shrunk to about as many (some 10 ms).
const LARGEST: f64 = 1e8;

/// A subtree with more than this share of all operations has none of its size beside it.
const ALONE: f64 = 0.6;

/// Fronts of a class have operations within a factor of four.
const CLASS: f64 = 4.0;

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Company {
    /// Other fronts of the size run at the same time.
    Beside,
    /// The whole machine works on it.
    Alone,
}

fn operations(p: f64, r: f64, symmetry: Symmetry) -> f64 {
    let cholesky = p * p * p / 3.0 + p * p * r + p * r * r;
    match symmetry {
        Symmetry::Symmetric => cholesky,
        Symmetry::Unsymmetric => 2.0 * cholesky,
    }
}

/// Rehearses a factorisation for about `time`.
pub fn rehearse(analysis: &Analysis, symmetry: Symmetry, time: Duration) -> Rehearsed {
    let symbolic = analysis.symbolic();
    let n = symbolic.nodes.len();
    let mut own = Vec::with_capacity(n);
    let mut subtree = vec![0.0; n];
    for (s, node) in symbolic.nodes.iter().enumerate() {
        own.push(operations(
            node.pivot_dofs as f64,
            node.row_dofs as f64,
            symmetry,
        ));
        subtree[s] += own[s];
        if let Some(parent) = symbolic.parent(s) {
            subtree[parent] += subtree[s];
        }
    }
    let total: f64 = own.iter().sum();
    let mut classes: std::collections::BTreeMap<(Company, i32), Vec<usize>> = Default::default();
    for s in 0..n {
        let company = if subtree[s] > ALONE * total {
            Company::Alone
        } else {
            Company::Beside
        };
        let class = own[s].max(1.0).log(CLASS) as i32;
        classes.entry((company, class)).or_default().push(s);
    }
    let threads = rayon::current_num_threads();
    let share = time.div_f64(classes.len().max(1) as f64);
    let mut factorisation = 0.0;
    for ((company, _), members) in &classes {
        let sum: f64 = members.iter().map(|&s| own[s]).sum();
        let mean = sum / members.len() as f64;
        let apart = |s: usize| (own[s] - mean).abs();
        let Some(&chosen) = members
            .iter()
            .min_by(|&&a, &&b| apart(a).total_cmp(&apart(b)))
        else {
            continue;
        };
        let front = shape(symbolic, chosen, (LARGEST / own[chosen]).cbrt().min(1.0));
        let run = |_: usize| trial_front(front.0, front.1, &front.2, symmetry);
        let copies = match company {
            Company::Alone => 1,
            Company::Beside => threads,
        };
        let begun = Instant::now();
        let mut times = 0;
        // the first touches memory and wakes threads
        while times < 2 || begun.elapsed() < share && times < members.len().max(4) {
            if copies == 1 {
                run(0);
            } else {
                (0..copies).into_par_iter().for_each(run);
            }
            times += 1;
        }
        let ran = operations(front.0 as f64, front.1 as f64, symmetry).max(1.0);
        let each = begun.elapsed().as_secs_f64() / (times * copies) as f64;
        factorisation += each * sum.max(members.len() as f64) / ran;
    }
    Rehearsed {
        factorisation,
        substitution: substitution(symbolic, symmetry) * seconds_per_scalar(),
    }
}

/// Pivots, rows and rows of the children of a front, times `scale`.
fn shape(symbolic: &Symbolic, s: usize, scale: f64) -> (usize, usize, Vec<usize>) {
    let shrunk = |n: usize| (n as f64 * scale).round() as usize;
    let node = &symbolic.nodes[s];
    let (p, r) = (shrunk(node.pivot_dofs).max(1), shrunk(node.row_dofs));
    let children = symbolic.children[s]
        .iter()
        .map(|&c| shrunk(symbolic.nodes[c as usize].row_dofs).min(p + r))
        .collect();
    (p, r, children)
}

/// Scalars of the factors that a substitution reads.
fn substitution(symbolic: &Symbolic, symmetry: Symmetry) -> f64 {
    symbolic
        .nodes
        .iter()
        .map(|n| {
            let (p, r) = (n.pivot_dofs as f64, n.row_dofs as f64);
            match symmetry {
                Symmetry::Symmetric => 2.0 * p * (p + r),
                Symmetry::Unsymmetric => p * (p + r) + p * r + p * p,
            }
        })
        .sum()
}

/// Seconds in which one thread reads a stored number and multiplies it, measured here.
pub fn seconds_per_scalar() -> f64 {
    const COLUMNS: usize = 4096;
    const HEIGHT: usize = 256;
    let stored: Vec<f64> = (0..COLUMNS * HEIGHT)
        .map(|k| 1e-3 * (k % 7) as f64)
        .collect();
    let mut y = vec![1.0; HEIGHT];
    let begun = Instant::now();
    let mut passes = 0;
    while passes < 2 || begun.elapsed().as_secs_f64() < 3e-2 {
        for column in stored.chunks_exact(HEIGHT) {
            let x = 1e-3 * y[0];
            y.iter_mut().zip(column).for_each(|(y, l)| *y -= x * l);
        }
        passes += 1;
    }
    std::hint::black_box(&y);
    begun.elapsed().as_secs_f64() / (passes * COLUMNS * HEIGHT) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::solve::FreeDofs;
    use crate::solve::direct::Factor;
    use crate::solve::direct_params::DirectParams;
    use crate::solve::ordering::Ordering;
    use crate::solve::stencils::StencilGrid;

    /// Against a factorisation that runs, in alternation, the median of three ratios: within a factor of three. Other tests run at the same time, so that
    /// three times in a row it has to miss before it counts.
    #[test]
    fn a_rehearsal_takes_as_long_as_the_factorisation() {
        let lattice = StencilGrid::rectangle(120, 120);
        let (matrix, positions) = (lattice.bonds(3), lattice.positions());
        // held at one side
        let prescribed: Vec<Option<f64>> = (0..matrix.dofs())
            .map(|dof| (positions[dof / 2][0] == 0.0).then_some(0.0))
            .collect();
        let free = FreeDofs::from_prescribed(&prescribed, 2);
        for symmetry in [Symmetry::Symmetric, Symmetry::Unsymmetric] {
            let ratio = || {
                let analysis =
                    Analysis::new(&matrix, &free, &positions, Ordering::default()).unwrap();
                let told = rehearse(&analysis, symmetry, Duration::from_millis(30));
                let params = DirectParams {
                    symmetry,
                    ..DirectParams::default()
                };
                let (_, info) = Factor::new(&matrix, &free, analysis, &params, &Silent).unwrap();
                told.factorisation / info.factor_seconds
            };
            let holds = |r: &[f64; 3]| (0.33..3.0).contains(&r[1]);
            let mut rounds: Vec<[f64; 3]> = Vec::new();
            while rounds.len() < 3 && !rounds.last().is_some_and(holds) {
                let mut ratios = [ratio(), ratio(), ratio()];
                ratios.sort_by(f64::total_cmp);
                rounds.push(ratios);
            }
            assert!(rounds.last().is_some_and(holds), "{rounds:?}");
        }
    }
}
