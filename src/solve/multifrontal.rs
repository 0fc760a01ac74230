//! Numerical factorisation over the tree of supernodes: assembly of fronts, contribution blocks, scheduling.

use crate::progress::{Progress, Silent};
use crate::solve::FreeDofs;
use crate::solve::direct_params::{DirectError, DirectParams};
use crate::solve::frontal_matrix::{self, BadPivot};
use crate::solve::ordering::SiteGraph;
use crate::solve::symbolic::Symbolic;
use crate::system::{BlockCsr, Symmetry};
use rayon::prelude::*;
use std::cell::RefCell;
use std::sync::OnceLock;

/// Factors of one supernode.
#[derive(Debug, Default)]
pub(crate) struct NodeFactor {
    /// `(p + r) × p`, column-major: `[L11; L21]`, or `[L11\U11; L21]`.
    pub panel: Vec<f64>,
    /// `p × r`, column-major: `U12`; empty for Cholesky.
    pub upper: Vec<f64>,
    /// Row exchanges of LU within the pivot block.
    pub permutation: Vec<u32>,
}

/// Subtrees with less than this fraction of all operations are one task.
const GRAIN: f64 = 1.0 / 32.0;

/// A contribution block: `r × r`, column-major; its lower triangle only for Cholesky.
struct Update {
    node: u32,
    values: Vec<f64>,
}

/// Everything a front needs to assemble itself.
pub(crate) struct Assembly<'a> {
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

impl<'a> Assembly<'a> {
    pub(crate) fn new(
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

    /// Factorises every supernode, in the order of their numbers.
    pub(crate) fn run(self) -> Result<Vec<NodeFactor>, DirectError> {
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
        let mut front = Front::new(p, r, symmetric);
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
            frontal_matrix::cholesky(&mut front.panel, &mut front.schur, p, r, self.progress)
                .map_err(|BadPivot(k)| DirectError::NotPositive {
                    site: self.pivot(s, k).0,
                })?;
        } else {
            frontal_matrix::lu(
                &mut front.panel,
                &mut front.upper,
                &mut front.schur,
                &mut permutation,
                p,
                r,
                self.progress,
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

/// Assembles and factorises a front of made-up entries with `p` pivots, `r` rows and children of so many `rows`, as a factorisation
/// does it; to tell how long that takes.
pub(crate) fn trial_front(p: usize, r: usize, rows: &[usize], symmetry: Symmetry) {
    let symmetric = symmetry == Symmetry::Symmetric;
    let mut front = Front::new(p, r, symmetric);
    for &n in rows {
        let map: Vec<u32> = (0..n).map(|i| (i * (p + r) / n) as u32).collect();
        front.add_update(&vec![1e-9; n * n], &map, symmetric);
    }
    for k in 0..p {
        front.panel[k * (p + r) + k] += 1.0;
    }
    let mut permutation = vec![0; if symmetric { 0 } else { p }];
    if symmetric {
        // the diagonal dominates
        let _ = frontal_matrix::cholesky(&mut front.panel, &mut front.schur, p, r, &Silent);
    } else {
        let Front {
            panel,
            upper,
            schur,
            ..
        } = &mut front;
        frontal_matrix::lu(panel, upper, schur, &mut permutation, p, r, &Silent);
    }
    std::hint::black_box(&front.panel);
}

/// Writes zeros to columns of so many `rows`, from row `first(column)` on.
fn write_columns(values: &mut [f64], rows: usize, first: impl Fn(usize) -> usize) {
    for (j, column) in values.chunks_exact_mut(rows.max(1)).enumerate() {
        // or the compiler leaves it out, for it knows that the memory is zero
        std::hint::black_box(&mut column[first(j)..]).fill(0.0);
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
    /// A front of zeros.
    fn new(p: usize, r: usize, symmetric: bool) -> Self {
        let mut front = Self {
            p,
            r,
            panel: vec![0.0; (p + r) * p],
            upper: vec![0.0; if symmetric { 0 } else { p * r }],
            schur: vec![0.0; r * r],
        };
        // A page of fresh memory that is read before it is written, as `+=` does, interrupts the thread twice and the others of
        // the process once: what is assembled is written first, and no more, for the upper triangles are never touched.
        let first = |column: usize| if symmetric { column } else { 0 };
        write_columns(&mut front.panel, p + r, first);
        write_columns(&mut front.upper, p, first);
        write_columns(&mut front.schur, r, first);
        front
    }

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

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    /// Pages that the system has given to this thread so far, or copied for it.
    fn faults() -> u64 {
        let stat = std::fs::read_to_string("/proc/thread-self/stat").expect("a thread");
        // the name of the thread ends with the last bracket; see proc_pid_stat(5)
        let after_name = stat.rsplit(')').next().expect("numbers");
        let minor = after_name.split_whitespace().nth(7);
        minor.expect("minor faults").parse().expect("a number")
    }

    #[test]
    fn what_is_added_to_a_front_finds_its_pages_written() {
        // contribution blocks of 50 MB are in memory of their own, fresh from the system
        let (p, r) = (100, 2500);
        for symmetric in [true, false] {
            let before = faults();
            let mut front = Front::new(p, r, symmetric);
            let made = faults();
            let map: Vec<u32> = (0..(p + r) as u32).collect();
            let values = vec![1.0; map.len() * map.len()];
            let ready = faults();
            front.add_update(&values, &map, symmetric);
            let added = faults() - ready;
            // read first, it is 16 700 of the symmetric one; the system may move a few pages meanwhile
            assert!(added < 1000, "{added} beside {} before", made - before);
        }
    }
}
