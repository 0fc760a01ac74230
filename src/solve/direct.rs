//! Multifrontal Cholesky and LU on the tree of supernodes \[DuffReid1983\], with faer's dense kernels.
//!
//! One code serves both: symbolic work on sites, fronts assembled straight from the block matrix, children's
//! contribution blocks added in a fixed order. LU keeps the pattern of `K + Kᵀ` and exchanges rows only within the
//! pivot block of a front; that suffices because splice, blending and partial-stress operators have structurally
//! near-symmetric rows and strong diagonals, and iterative refinement shows at once where it would not.
//!
//! Rejected: faer's sparse LU (column ordering by COLAMD only), measured against this one in `docs/solvers.md`.

pub use super::direct_params::{DirectError, DirectParams};
use crate::progress::Progress;
use crate::solve::FreeDofs;
use crate::solve::krylov::LinearMap;
use crate::solve::multifrontal::{Assembly, NodeFactor};
use crate::solve::ordering::{Ordering, OrderingError, SiteGraph};
use crate::solve::symbolic::{FactorCost, Symbolic};
use crate::system::{BlockCsr, Symmetry};
use std::time::Instant;

/// Summary of a factorisation.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct DirectInfo {
    /// Elimination order used.
    pub ordering: Ordering,
    /// Scalars in the factors, operations and predicted peak bytes.
    pub cost: FactorCost,
    /// Number of fronts.
    pub fronts: usize,
    /// Size of the largest front, in dofs.
    pub largest_front: usize,
    /// Seconds for the graph, the order and the symbolic analysis.
    pub ordering_seconds: f64,
    /// Seconds for the numerical factorisation.
    pub factor_seconds: f64,
}

/// The factors of a matrix restricted to its free dofs.
#[derive(Debug)]
pub struct Factor {
    symmetry: Symmetry,
    symbolic: Symbolic,
    nodes: Vec<NodeFactor>,
    /// Original dof of each scalar unknown in elimination order.
    dofs: Vec<usize>,
}

/// The elimination order and symbolic factorisation of a pattern: what a factorisation costs is known from here on.
#[derive(Clone, Debug)]
pub struct Analysis {
    ordering: Ordering,
    graph: SiteGraph,
    symbolic: Symbolic,
    seconds: f64,
}

impl Analysis {
    /// Orders and analyses the free part of `matrix`. Zero blocks count as absent.
    ///
    /// Shapes: `positions` has one entry per site.
    ///
    /// # Errors
    /// [`OrderingError`] if an ordering crate refuses the graph.
    pub fn new(
        matrix: &BlockCsr,
        free: &FreeDofs,
        positions: &[[f64; 3]],
        ordering: Ordering,
    ) -> Result<Analysis, OrderingError> {
        let start = Instant::now();
        let mut analysis = Analysis::of_graph(SiteGraph::new(matrix, free), positions, ordering)?;
        analysis.seconds = start.elapsed().as_secs_f64();
        Ok(analysis)
    }

    /// Orders and analyses a graph; with [`SiteGraph::from_pattern`] this predicts the cost of a matrix that is not
    /// assembled yet.
    ///
    /// Shapes: `positions` has one entry per site.
    ///
    /// # Errors
    /// [`OrderingError`] if an ordering crate refuses the graph.
    pub fn of_graph(
        graph: SiteGraph,
        positions: &[[f64; 3]],
        ordering: Ordering,
    ) -> Result<Analysis, OrderingError> {
        let start = Instant::now();
        let order = ordering.order(&graph, positions)?;
        let symbolic = Symbolic::new(&graph, &order);
        Ok(Analysis {
            ordering,
            graph,
            symbolic,
            seconds: start.elapsed().as_secs_f64(),
        })
    }

    /// Bytes of the graph and of the tree while they are made.
    pub fn bytes(&self) -> u64 {
        // the rows of the graph are held twice while it is made symmetric
        (8 * self.graph.neighbours.len() + self.symbolic.bytes()) as u64
    }

    /// The tree of supernodes.
    pub(crate) fn symbolic(&self) -> &Symbolic {
        &self.symbolic
    }

    /// The cost of a Cholesky (`Symmetric`) or an LU factorisation.
    pub fn cost(&self, symmetry: Symmetry) -> FactorCost {
        self.symbolic.cost(symmetry)
    }
}

impl Factor {
    /// Factorises `matrix` restricted to its free dofs, on the tree of `analysis` (of the same matrix or of one with
    /// the same pattern).
    ///
    /// Cholesky reads the upper triangle in the order of elimination, that is one of each pair of mirrored blocks.
    /// The result has the same bits on any number of threads.
    ///
    /// # Errors
    /// [`DirectError::TooLarge`] before any work, [`DirectError::NotPositive`] from Cholesky, and
    /// [`DirectError::Singular`] for a pivot below `params.smallest_pivot`.
    pub fn new(
        matrix: &BlockCsr,
        free: &FreeDofs,
        analysis: Analysis,
        params: &DirectParams,
        progress: &dyn Progress,
    ) -> Result<(Factor, DirectInfo), DirectError> {
        let start = Instant::now();
        let Analysis {
            ordering,
            graph,
            symbolic,
            seconds,
        } = analysis;
        let cost = symbolic.cost(params.symmetry);
        if let Some(limit) = params.memory_limit.filter(|&limit| cost.bytes > limit) {
            return Err(DirectError::TooLarge {
                bytes: cost.bytes,
                limit,
            });
        }
        progress.stage("factorisation", Some(symbolic.nodes.len() as u64));
        let nodes = Assembly::new(matrix, free, &graph, &symbolic, params, progress).run()?;
        let mut dofs = Vec::with_capacity(symbolic.dofs());
        for &v in &symbolic.order {
            let i = graph.sites[v as usize] as usize;
            dofs.extend(free.of_site(i).map(|a| i * matrix.block + a));
        }
        let info = DirectInfo {
            ordering,
            cost,
            fronts: nodes.len(),
            largest_front: symbolic
                .nodes
                .iter()
                .map(|n| n.pivot_dofs + n.row_dofs)
                .max()
                .unwrap_or(0),
            ordering_seconds: seconds,
            factor_seconds: start.elapsed().as_secs_f64(),
        };
        Ok((
            Factor {
                symmetry: params.symmetry,
                symbolic,
                nodes,
                dofs,
            },
            info,
        ))
    }

    /// Bytes of the stored factors.
    pub fn bytes(&self) -> usize {
        self.nodes
            .iter()
            .map(|n| 8 * (n.panel.len() + n.upper.len()) + 4 * n.permutation.len())
            .sum()
    }

    /// Solves with the factors, without refinement: `x` on free dofs, zero on the others.
    ///
    /// Shapes: `rhs` and the result have one entry per dof of the matrix.
    pub fn solve(&self, rhs: &[f64]) -> Vec<f64> {
        let mut y: Vec<f64> = self.dofs.iter().map(|&d| rhs[d]).collect();
        let mut front = Vec::new();
        for s in 0..self.nodes.len() {
            self.forward(s, &mut y, &mut front);
        }
        for s in (0..self.nodes.len()).rev() {
            self.backward(s, &mut y, &mut front);
        }
        let mut x = vec![0.0; rhs.len()];
        for (&d, &v) in self.dofs.iter().zip(&y) {
            x[d] = v;
        }
        x
    }

    /// Unknowns of the rows of supernode `s`, in order.
    fn row_unknowns(&self, s: usize) -> impl Iterator<Item = usize> + '_ {
        let start = &self.symbolic.dof_start;
        self.symbolic.nodes[s]
            .rows
            .iter()
            .flat_map(move |&i| start[i as usize]..start[i as usize + 1])
    }

    fn forward(&self, s: usize, y: &mut [f64], front: &mut Vec<f64>) {
        let (node, factor) = (&self.symbolic.nodes[s], &self.nodes[s]);
        let (p, r) = (node.pivot_dofs, node.row_dofs);
        let first = self.symbolic.dof_start[node.first as usize];
        front.clear();
        match self.symmetry {
            Symmetry::Symmetric => front.extend_from_slice(&y[first..first + p]),
            Symmetry::Unsymmetric => {
                front.extend(factor.permutation.iter().map(|&k| y[first + k as usize]))
            }
        }
        front.resize(p + r, 0.0);
        for k in 0..p {
            let column = &factor.panel[k * (p + r)..(k + 1) * (p + r)];
            if self.symmetry == Symmetry::Symmetric {
                front[k] /= column[k];
            }
            let x = front[k];
            front[k + 1..]
                .iter_mut()
                .zip(&column[k + 1..])
                .for_each(|(f, l)| *f -= x * l);
        }
        y[first..first + p].copy_from_slice(&front[..p]);
        for (i, &f) in self.row_unknowns(s).zip(&front[p..]) {
            y[i] += f;
        }
    }

    fn backward(&self, s: usize, y: &mut [f64], front: &mut Vec<f64>) {
        let (node, factor) = (&self.symbolic.nodes[s], &self.nodes[s]);
        let (p, r) = (node.pivot_dofs, node.row_dofs);
        let first = self.symbolic.dof_start[node.first as usize];
        front.clear();
        front.extend_from_slice(&y[first..first + p]);
        front.extend(self.row_unknowns(s).map(|i| y[i]));
        match self.symmetry {
            Symmetry::Symmetric => {
                for k in (0..p).rev() {
                    let column = &factor.panel[k * (p + r)..(k + 1) * (p + r)];
                    front[k] = (front[k] - dot(&column[k + 1..], &front[k + 1..])) / column[k];
                }
            }
            Symmetry::Unsymmetric => {
                let (pivots, rows) = front.split_at_mut(p);
                for (column, &x) in factor.upper.chunks(p.max(1)).zip(rows.iter()) {
                    pivots.iter_mut().zip(column).for_each(|(f, u)| *f -= x * u);
                }
                for k in (0..p).rev() {
                    let column = &factor.panel[k * (p + r)..k * (p + r) + p];
                    pivots[k] /= column[k];
                    let x = pivots[k];
                    pivots[..k]
                        .iter_mut()
                        .zip(column)
                        .for_each(|(f, u)| *f -= x * u);
                }
            }
        }
        y[first..first + p].copy_from_slice(&front[..p]);
    }
}

/// Dot product with eight running sums, so that it vectorises.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (ca, cb) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = ca
        .remainder()
        .iter()
        .zip(cb.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in ca.zip(cb) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    sums.iter().sum::<f64>() + tail
}

impl LinearMap for Factor {
    fn apply_into(&self, x: &[f64], y: &mut [f64]) {
        y.copy_from_slice(&self.solve(x));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::solve::stencils::{StencilGrid, splice};

    #[test]
    fn the_prediction_from_a_pattern_is_what_is_stored() {
        let lattice = StencilGrid::rectangle(50, 40);
        let x = lattice.positions();
        let spliced = splice(&lattice.bonds(3), &lattice.elements(), |i| x[i][0] > 20.0);
        for (matrix, symmetry) in [
            (lattice.bonds(3), Symmetry::Symmetric),
            (spliced, Symmetry::Unsymmetric),
        ] {
            let mut prescribed = vec![None; matrix.dofs()];
            (0..lattice.len())
                .filter(|&i| x[i][0] == 0.0)
                .for_each(|i| prescribed[2 * i] = Some(0.0));
            prescribed[1] = Some(0.0);
            let free = FreeDofs::from_prescribed(&prescribed, 2);
            let graph = SiteGraph::from_pattern(&matrix.row_offsets, &matrix.columns, &free);
            let ordering = Ordering::CoordinateNestedDissection;
            let cost = Analysis::of_graph(graph, &x, ordering)
                .expect("ordered")
                .cost(symmetry);
            let analysis = Analysis::new(&matrix, &free, &x, ordering).expect("ordered");
            let params = DirectParams {
                symmetry,
                ..DirectParams::default()
            };
            let (factor, info) =
                Factor::new(&matrix, &free, analysis, &params, &Silent).expect("regular");
            assert_eq!(cost, info.cost);
            let stored: usize = factor
                .nodes
                .iter()
                .map(|n| 8 * (n.panel.len() + n.upper.len()))
                .sum();
            // the peak holds contribution blocks beside the factors
            assert!(cost.bytes as usize >= stored && (cost.bytes as usize) < 2 * stored);
            let limited = DirectParams {
                memory_limit: Some(cost.bytes - 1),
                ..params
            };
            let analysis = Analysis::new(&matrix, &free, &x, ordering).expect("ordered");
            let refused = Factor::new(&matrix, &free, analysis, &limited, &Silent);
            assert!(matches!(refused, Err(DirectError::TooLarge { .. })));
        }
    }

    #[test]
    fn pivots_of_free_bodies_are_round_off_and_those_of_held_ones_are_not() {
        let mut held = f64::INFINITY;
        for (lattice, matrix) in [
            (
                StencilGrid::rectangle(60, 60),
                StencilGrid::rectangle(60, 60).bonds(3),
            ),
            (
                StencilGrid::rectangle(200, 4),
                StencilGrid::rectangle(200, 4).elements(),
            ),
            (
                StencilGrid::block(9, 8, 7),
                StencilGrid::block(9, 8, 7).elements(),
            ),
        ] {
            let d = lattice.dimension;
            let x = lattice.positions();
            let factorise = |free: &FreeDofs, smallest_pivot: f64| {
                let analysis =
                    Analysis::new(&matrix, free, &x, Ordering::default()).expect("ordered");
                let params = DirectParams {
                    smallest_pivot,
                    ..DirectParams::default()
                };
                Factor::new(&matrix, free, analysis, &params, &Silent)
            };
            let loose = FreeDofs::all(lattice.len(), d);
            match factorise(&loose, DirectParams::default().smallest_pivot) {
                Err(DirectError::Singular { ratio, .. }) => println!("free {d}D: {ratio:e}"),
                other => panic!("{:?}", other.map(|f| f.1)),
            }
            let prescribed: Vec<Option<f64>> = (0..matrix.dofs())
                .map(|k| (x[k / d][0] == 0.0).then_some(0.0))
                .collect();
            let supported = FreeDofs::from_prescribed(&prescribed, d);
            // the largest bound that fails is the smallest pivot
            for exponent in 0..12 {
                let bound = 10f64.powi(-exponent);
                match factorise(&supported, bound) {
                    Ok(_) => {
                        held = held.min(bound);
                        println!("held {d}D: at least {bound:e}");
                        break;
                    }
                    Err(_) => continue,
                }
            }
        }
        assert!(held >= 1e-7, "{held:e}");
    }
}
