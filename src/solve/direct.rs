//! Multifrontal Cholesky and LU on the tree of supernodes (Duff & Reid 1983), with faer's dense kernels.
//!
//! One code serves both: symbolic work on sites, fronts assembled straight from the block matrix, children's
//! contribution blocks added in a fixed order. LU keeps the pattern of `K + Kᵀ` and exchanges rows only within the
//! pivot block of a front; that suffices because splice, blending and partial-stress operators have structurally
//! near-symmetric rows and strong diagonals, and iterative refinement shows at once where it would not.
//!
//! Rejected: faer's sparse LU (column ordering by COLAMD only), measured against this one in `docs/solvers.md`.

use crate::progress::Progress;
use crate::solve::FreeDofs;
use crate::solve::front::{self, BadPivot};
use crate::solve::ordering::{Ordering, OrderingError, SiteGraph};
use crate::solve::symbolic::{FactorCost, Symbolic};
use crate::system::{BlockCsr, Symmetry};
use rayon::prelude::*;
use std::cell::RefCell;
use std::sync::OnceLock;
use std::time::Instant;

/// What a factorisation may be asked for.
#[derive(Clone, Copy, Debug)]
pub struct DirectParams {
    /// Elimination order.
    pub ordering: Ordering,
    /// Cholesky for `Symmetric`, LU for `Unsymmetric`.
    pub symmetry: Symmetry,
    /// A pivot smaller than this fraction of its original diagonal entry is an error.
    ///
    /// Free bodies leave pivots of 1e-17 to 1e-14 of the diagonal; the smallest pivot of a supported model is about
    /// the inverse of its condition number, 1e-7 for a plate of 480 × 480 sites.
    pub smallest_pivot: f64,
}

impl Default for DirectParams {
    fn default() -> Self {
        DirectParams {
            ordering: Ordering::default(),
            symmetry: Symmetry::Unsymmetric,
            smallest_pivot: 1e-12,
        }
    }
}

/// What a factorisation did.
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

/// Why a factorisation failed.
#[derive(Debug, thiserror::Error)]
pub enum DirectError {
    /// The elimination order could not be computed.
    #[error(transparent)]
    Ordering(#[from] OrderingError),
    /// Cholesky met a pivot that is not positive: the matrix is not positive definite.
    #[error(
        "site {site} has a pivot that is not positive; the matrix is not positive definite, factorise it by LU"
    )]
    NotPositive {
        /// Site of the pivot.
        site: usize,
    },
    /// A pivot is zero to round-off: the matrix is singular.
    #[error(
        "site {site} has a pivot {ratio:.1e} of its diagonal; the matrix is singular, support the site"
    )]
    Singular {
        /// Site of the pivot.
        site: usize,
        /// Pivot over original diagonal.
        ratio: f64,
    },
}

/// Factors of one supernode.
#[derive(Debug, Default)]
struct NodeFactor {
    /// `(p + r) × p`, column-major: `[L11; L21]`, or `[L11\U11; L21]`.
    panel: Vec<f64>,
    /// `p × r`, column-major: `U12`; empty for Cholesky.
    upper: Vec<f64>,
    /// Row exchanges of LU within the pivot block.
    permutation: Vec<u32>,
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

/// Predicts the factorisation of `matrix` from its pattern alone.
///
/// Zero blocks count as absent. Shapes: `positions` has one entry per site.
///
/// # Errors
/// [`OrderingError`] if an ordering crate refuses the graph.
pub fn factor_cost(
    matrix: &BlockCsr,
    free: &FreeDofs,
    positions: &[[f64; 3]],
    ordering: Ordering,
    symmetry: Symmetry,
) -> Result<FactorCost, OrderingError> {
    let graph = SiteGraph::new(matrix, free);
    let order = ordering.order(&graph, positions)?;
    Ok(Symbolic::new(&graph, &order).cost(symmetry))
}

/// Subtrees with less than this fraction of all operations are one task.
const GRAIN: f64 = 1.0 / 32.0;

/// A contribution block: `r × r`, column-major; its lower triangle only for Cholesky.
struct Update {
    node: u32,
    values: Vec<f64>,
}

/// Everything a front needs to assemble itself.
struct Assembly<'a> {
    matrix: &'a BlockCsr,
    free: &'a FreeDofs,
    graph: &'a SiteGraph,
    symbolic: &'a Symbolic,
    params: &'a DirectParams,
    /// Elimination number of each site; `u32::MAX` without free dofs.
    number_of_site: Vec<u32>,
    /// Operations of each subtree.
    flops: Vec<f64>,
    /// Supernodes in each subtree.
    size: Vec<u32>,
    /// Place of each supernode in the schedule.
    place: Vec<u32>,
    done: Vec<OnceLock<NodeFactor>>,
    progress: &'a dyn Progress,
}

thread_local! {
    /// First local dof of each elimination number in the front under assembly; `u32::MAX` outside of it.
    static LOCAL: RefCell<Vec<u32>> = const { RefCell::new(Vec::new()) };
}

impl Factor {
    /// Factorises `matrix` restricted to its free dofs.
    ///
    /// Cholesky reads the upper triangle in the order of elimination, that is one of each pair of mirrored blocks.
    /// Shapes: `positions` has one entry per site. Deterministic for any number of threads.
    ///
    /// # Errors
    /// [`DirectError::NotPositive`] from Cholesky, [`DirectError::Singular`] for a pivot below
    /// `params.smallest_pivot`, and what the ordering returns.
    pub fn new(
        matrix: &BlockCsr,
        free: &FreeDofs,
        positions: &[[f64; 3]],
        params: &DirectParams,
        progress: &dyn Progress,
    ) -> Result<(Factor, DirectInfo), DirectError> {
        let start = Instant::now();
        progress.stage("ordering", None);
        let graph = SiteGraph::new(matrix, free);
        let order = params.ordering.order(&graph, positions)?;
        let symbolic = Symbolic::new(&graph, &order);
        let ordering_seconds = start.elapsed().as_secs_f64();

        let start = Instant::now();
        let cost = symbolic.cost(params.symmetry);
        progress.stage("factorisation", Some(symbolic.nodes.len() as u64));
        let nodes = Assembly::new(matrix, free, &graph, &symbolic, params, progress).run()?;
        let mut dofs = Vec::with_capacity(symbolic.dofs());
        for &v in &symbolic.order {
            let i = graph.sites[v as usize] as usize;
            dofs.extend(free.of_site(i).map(|a| i * matrix.block + a));
        }
        let info = DirectInfo {
            ordering: params.ordering,
            cost,
            fronts: nodes.len(),
            largest_front: symbolic
                .nodes
                .iter()
                .map(|n| n.pivot_dofs + n.row_dofs)
                .max()
                .unwrap_or(0),
            ordering_seconds,
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

impl<'a> Assembly<'a> {
    fn new(
        matrix: &'a BlockCsr,
        free: &'a FreeDofs,
        graph: &'a SiteGraph,
        symbolic: &'a Symbolic,
        params: &'a DirectParams,
        progress: &'a dyn Progress,
    ) -> Self {
        let n = symbolic.nodes.len();
        let mut number_of_site = vec![u32::MAX; matrix.rows()];
        for (v, &i) in graph.sites.iter().enumerate() {
            number_of_site[i as usize] = symbolic.number[v];
        }
        let (mut flops, mut size) = (vec![0.0; n], vec![1u32; n]);
        for s in 0..n {
            let (p, r) = (
                symbolic.nodes[s].pivot_dofs as f64,
                symbolic.nodes[s].row_dofs as f64,
            );
            flops[s] += p * p * p / 3.0 + p * p * r + p * r * r;
            if let Some(parent) = symbolic.parent(s) {
                flops[parent] += flops[s];
                size[parent] += size[s];
            }
        }
        let mut place = vec![0; n];
        for (k, &s) in symbolic.schedule.iter().enumerate() {
            place[s as usize] = k as u32;
        }
        let done = (0..n).map(|_| OnceLock::new()).collect();
        Assembly {
            matrix,
            free,
            graph,
            symbolic,
            params,
            number_of_site,
            flops,
            size,
            place,
            done,
            progress,
        }
    }

    fn run(self) -> Result<Vec<NodeFactor>, DirectError> {
        let roots: Vec<u32> = (0..self.symbolic.nodes.len())
            .filter(|&s| self.symbolic.parent(s).is_none())
            .map(|s| s as u32)
            .collect();
        let grain = GRAIN * roots.iter().map(|&s| self.flops[s as usize]).sum::<f64>();
        roots
            .par_iter()
            .try_for_each(|&s| self.subtree(s, grain).map(drop))?;
        Ok(self
            .done
            .into_iter()
            .map(|node| node.into_inner().unwrap_or_default())
            .collect())
    }

    /// Factorises the subtree of `s`; concurrent where it branches into large subtrees.
    fn subtree(&self, s: u32, grain: f64) -> Result<Update, DirectError> {
        let heavy = |s: u32| -> Vec<u32> {
            let children = &self.symbolic.children[s as usize];
            children
                .iter()
                .copied()
                .filter(|&c| self.flops[c as usize] > grain)
                .collect()
        };
        if self.flops[s as usize] <= grain {
            return self.small_subtree(s);
        }
        // walk down a chain by iteration, so that recursion is no deeper than the number of branchings
        let mut chain = vec![s];
        let mut branches = heavy(s);
        while let [only] = branches[..] {
            chain.push(only);
            branches = heavy(only);
        }
        let mut large: Vec<Update> = branches
            .par_iter()
            .map(|&c| self.subtree(c, grain))
            .collect::<Result<_, _>>()?;
        while let Some(s) = chain.pop() {
            let mut updates = Vec::new();
            for &c in &self.symbolic.children[s as usize] {
                match large.iter().position(|u| u.node == c) {
                    Some(k) => updates.push(large.swap_remove(k)),
                    None => updates.push(self.small_subtree(c)?),
                }
            }
            large.push(self.eliminate(s, updates)?);
        }
        Ok(large.swap_remove(0))
    }

    /// Factorises the subtree of `s` in the order of the schedule, on one stack.
    fn small_subtree(&self, s: u32) -> Result<Update, DirectError> {
        let end = self.place[s as usize] as usize + 1;
        let mut stack: Vec<Update> = Vec::new();
        for &t in &self.symbolic.schedule[end - self.size[s as usize] as usize..end] {
            let updates = stack.split_off(stack.len() - self.symbolic.children[t as usize].len());
            stack.push(self.eliminate(t, updates)?);
        }
        Ok(stack.swap_remove(0))
    }

    /// Assembles and partially factorises one front.
    fn eliminate(&self, s: u32, updates: Vec<Update>) -> Result<Update, DirectError> {
        let node = &self.symbolic.nodes[s as usize];
        let (p, r) = (node.pivot_dofs, node.row_dofs);
        let symmetric = self.params.symmetry == Symmetry::Symmetric;
        let mut front = Front {
            p,
            r,
            panel: vec![0.0; (p + r) * p],
            upper: vec![0.0; if symmetric { 0 } else { p * r }],
            schur: vec![0.0; r * r],
        };
        let maps: Vec<Vec<u32>> = LOCAL.with_borrow_mut(|local| {
            self.number_front(s, local);
            self.add_entries(s, local, &mut front);
            let maps = updates
                .iter()
                .map(|u| self.update_map(u.node, local))
                .collect();
            for i in (node.first..node.last).chain(node.rows.iter().copied()) {
                local[i as usize] = u32::MAX;
            }
            maps
        });
        for (update, map) in updates.into_iter().zip(maps) {
            front.add_update(&update.values, &map, symmetric);
        }
        let mut permutation = vec![0; if symmetric { 0 } else { p }];
        if symmetric {
            front::cholesky(&mut front.panel, &mut front.schur, p, r).map_err(|BadPivot(k)| {
                DirectError::NotPositive {
                    site: self.pivot(s, k).0,
                }
            })?;
        } else {
            front::lu(
                &mut front.panel,
                &mut front.upper,
                &mut front.schur,
                &mut permutation,
                p,
                r,
            );
        }
        self.check_pivots(s, &front.panel, p, r)?;
        self.progress.advance(1);
        let Front {
            panel,
            upper,
            schur,
            ..
        } = front;
        // each supernode is eliminated once, so the cell is empty
        let _ = self.done[s as usize].set(NodeFactor {
            panel,
            upper,
            permutation,
        });
        Ok(Update {
            node: s,
            values: schur,
        })
    }

    /// Fills `local` for the front of `s`.
    fn number_front(&self, s: u32, local: &mut Vec<u32>) {
        let node = &self.symbolic.nodes[s as usize];
        let start = &self.symbolic.dof_start;
        if local.len() < self.symbolic.order.len() {
            local.resize(self.symbolic.order.len(), u32::MAX);
        }
        let mut next = 0;
        for i in (node.first..node.last).chain(node.rows.iter().copied()) {
            local[i as usize] = next;
            next += (start[i as usize + 1] - start[i as usize]) as u32;
        }
    }

    /// Adds the entries of `K` whose first eliminated index is a pivot of `s`.
    fn add_entries(&self, s: u32, local: &[u32], front: &mut Front) {
        let node = &self.symbolic.nodes[s as usize];
        let symmetric = self.params.symmetry == Symmetry::Symmetric;
        let d = self.matrix.block;
        for j in node.first..node.last {
            let v = self.symbolic.order[j as usize] as usize;
            let site = self.graph.sites[v] as usize;
            let at = local[j as usize] as usize;
            let (columns, blocks) = self.matrix.row(site);
            for (e, &c) in columns.iter().enumerate() {
                let q = self.number_of_site[c as usize];
                let earlier = if symmetric { j } else { node.first };
                // a block that is not in the front is exactly zero
                if q == u32::MAX || q < earlier || local[q as usize] == u32::MAX {
                    continue;
                }
                let to = local[q as usize] as usize;
                let block = &blocks[e * d * d..(e + 1) * d * d];
                for (ka, a) in self.free.of_site(site).enumerate() {
                    for (kb, b) in self.free.of_site(c as usize).enumerate() {
                        let k = block[a * d + b];
                        if symmetric {
                            front.add(to + kb, at + ka, k);
                        } else {
                            front.add(at + ka, to + kb, k);
                        }
                    }
                }
            }
            if symmetric {
                continue;
            }
            for &w in self.graph.neighbours_of(v) {
                let q = self.symbolic.number[w as usize];
                if q < node.last {
                    continue;
                }
                let other = self.graph.sites[w as usize] as usize;
                let (columns, blocks) = self.matrix.row(other);
                let Ok(e) = columns.binary_search(&(site as u32)) else {
                    continue;
                };
                let from = local[q as usize] as usize;
                let block = &blocks[e * d * d..(e + 1) * d * d];
                for (ka, a) in self.free.of_site(other).enumerate() {
                    for (kb, b) in self.free.of_site(site).enumerate() {
                        front.add(from + ka, at + kb, block[a * d + b]);
                    }
                }
            }
        }
    }

    /// Local dof in the parent's front of each row of the contribution block of `child`.
    fn update_map(&self, child: u32, local: &[u32]) -> Vec<u32> {
        let node = &self.symbolic.nodes[child as usize];
        let mut map = Vec::with_capacity(node.row_dofs);
        for &i in &node.rows {
            let count =
                self.symbolic.dof_start[i as usize + 1] - self.symbolic.dof_start[i as usize];
            map.extend((0..count as u32).map(|k| local[i as usize] + k));
        }
        map
    }

    /// Site and component of pivot `k` of supernode `s`.
    fn pivot(&self, s: u32, k: usize) -> (usize, usize) {
        let first = self.symbolic.nodes[s as usize].first as usize;
        let start = &self.symbolic.dof_start;
        let unknown = start[first] + k;
        let number = start.partition_point(|&x| x <= unknown) - 1;
        let site = self.graph.sites[self.symbolic.order[number] as usize] as usize;
        let component = self
            .free
            .of_site(site)
            .nth(unknown - start[number])
            .unwrap_or(0);
        (site, component)
    }

    fn check_pivots(&self, s: u32, panel: &[f64], p: usize, r: usize) -> Result<(), DirectError> {
        for k in 0..p {
            let pivot = match self.params.symmetry {
                Symmetry::Symmetric => panel[k * (p + r) + k].powi(2),
                Symmetry::Unsymmetric => panel[k * (p + r) + k].abs(),
            };
            let (site, component) = self.pivot(s, k);
            let ratio = pivot / self.diagonal(site, component);
            if ratio.is_nan() || ratio < self.params.smallest_pivot {
                return Err(DirectError::Singular { site, ratio });
            }
        }
        Ok(())
    }

    /// Largest entry of row `component` of the diagonal block of `site`.
    fn diagonal(&self, site: usize, component: usize) -> f64 {
        let d = self.matrix.block;
        let (columns, blocks) = self.matrix.row(site);
        columns.binary_search(&(site as u32)).map_or(0.0, |e| {
            blocks[e * d * d + component * d..][..d]
                .iter()
                .fold(0.0, |m: f64, k| m.max(k.abs()))
        })
    }
}

/// One front under assembly; see [`front`] for the layout.
struct Front {
    p: usize,
    r: usize,
    panel: Vec<f64>,
    upper: Vec<f64>,
    schur: Vec<f64>,
}

impl Front {
    /// Adds to an entry that lies in a pivot row or column.
    fn add(&mut self, i: usize, j: usize, value: f64) {
        if j < self.p {
            self.panel[j * (self.p + self.r) + i] += value;
        } else {
            self.upper[(j - self.p) * self.p + i] += value;
        }
    }

    /// Adds a child's contribution block; `map` ascends.
    fn add_update(&mut self, values: &[f64], map: &[u32], symmetric: bool) {
        let (p, r, n) = (self.p, self.r, map.len());
        let pivots = map.partition_point(|&i| (i as usize) < p);
        for (j, &to) in map.iter().enumerate() {
            let to = to as usize;
            let first = if symmetric { j } else { 0 };
            let column = &values[j * n..(j + 1) * n];
            if to < p {
                let target = &mut self.panel[to * (p + r)..(to + 1) * (p + r)];
                for (&i, v) in map[first..].iter().zip(&column[first..]) {
                    target[i as usize] += v;
                }
                continue;
            }
            if !symmetric {
                let target = &mut self.upper[(to - p) * p..(to - p + 1) * p];
                for (&i, v) in map[..pivots].iter().zip(column) {
                    target[i as usize] += v;
                }
            }
            let first = first.max(pivots);
            let target = &mut self.schur[(to - p) * r..(to - p + 1) * r];
            for (&i, v) in map[first..].iter().zip(&column[first..]) {
                target[i as usize - p] += v;
            }
        }
    }
}
