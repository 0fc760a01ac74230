//! Symbolic factorisation on the site graph: elimination tree, supernodes, and the cost of the factors.

use crate::solve::ordering::SiteGraph;
use crate::system::Symmetry;

/// Cost of a factorisation, from the pattern alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct FactorCost {
    /// Scalars stored in the factors.
    pub factor_nnz: u64,
    /// Floating-point operations of the factorisation, a multiplication and an addition counted as two.
    pub flops: f64,
    /// Peak bytes of the factors and of the contribution blocks alive with them, on one thread.
    pub bytes: u64,
}

/// One supernode: sites eliminated together, and the later sites that their columns reach.
#[derive(Clone, Debug, Default)]
pub(crate) struct Supernode {
    /// First and past-the-last pivot, in elimination numbers.
    pub first: u32,
    pub last: u32,
    /// Elimination numbers below the pivots, ascending.
    pub rows: Vec<u32>,
    /// Index of the parent supernode; `u32::MAX` for a root.
    pub parent: u32,
    /// Free dofs of the pivots and of the rows.
    pub pivot_dofs: usize,
    pub row_dofs: usize,
}

/// The elimination tree of supernodes of one ordered graph.
#[derive(Clone, Debug, Default)]
pub struct Symbolic {
    /// Vertices of the graph in the order of elimination.
    pub(crate) order: Vec<u32>,
    /// Elimination number of each vertex.
    pub(crate) number: Vec<u32>,
    /// First scalar unknown of each elimination number; one entry more than vertices.
    pub(crate) dof_start: Vec<usize>,
    /// Supernodes, children before parents.
    pub(crate) nodes: Vec<Supernode>,
    /// Children of each supernode, in the order in which they are visited.
    pub(crate) children: Vec<Vec<u32>>,
    /// All supernodes in the order of a factorisation on one thread.
    pub(crate) schedule: Vec<u32>,
}

const NONE: u32 = u32::MAX;

/// A child is merged into its parent if the merged columns (in sites) are at most `.0` and the fraction of explicit
/// zeros in them is at most `.1`, for any of these pairs. Fronts below about 30 dofs cost more in overhead than
/// in arithmetic. With these pairs Cholesky takes 0.97 to 1.09 of the time of faer's (`docs/solvers.md`); they were not
/// tuned further.
const MERGE: [(usize, f64); 4] = [(8, 1.0), (24, 0.5), (64, 0.15), (usize::MAX, 0.05)];

/// Runs of columns with the same structure: the run of each column, and the columns of each run.
fn fundamental_supernodes(parent: &[u32], count: &[u32]) -> (Vec<u32>, Vec<Vec<u32>>) {
    let n = parent.len();
    let mut of_column = vec![0u32; n];
    let mut columns: Vec<Vec<u32>> = Vec::new();
    for j in 0..n {
        let same = j > 0 && parent[j - 1] == j as u32 && count[j - 1] == count[j] + 1;
        if !same {
            columns.push(Vec::new());
        }
        let s = columns.len() - 1;
        columns[s].push(j as u32);
        of_column[j] = s as u32;
    }
    (of_column, columns)
}

impl Symbolic {
    /// Analyses `graph` for elimination in `order`.
    pub fn new(graph: &SiteGraph, order: &[u32]) -> Symbolic {
        let n = graph.len();
        let mut number = invert(order);
        let (parent, _) = elimination_tree(graph, order, &number);
        let post = postorder(&parent);
        let order: Vec<u32> = post.iter().map(|&j| order[j as usize]).collect();
        number = invert(&order);
        let (parent, count) = elimination_tree(graph, &order, &number);

        // fundamental supernodes: runs of columns with the same structure
        let (of_column, mut columns) = fundamental_supernodes(&parent, &count);
        let mut node_parent: Vec<u32> = columns
            .iter()
            .map(|c| match parent[c[c.len() - 1] as usize] {
                NONE => NONE,
                p => of_column[p as usize],
            })
            .collect();
        let heights: Vec<usize> = columns
            .iter()
            .map(|c| count[c[0] as usize] as usize)
            .collect();
        merge(&mut columns, &mut node_parent, heights);

        // renumber by a postorder of the merged tree, so that pivots are contiguous again
        let post = postorder(&node_parent);
        let kept: Vec<u32> = post
            .into_iter()
            .filter(|&s| !columns[s as usize].is_empty())
            .collect();
        let mut index = vec![NONE; columns.len()];
        let mut last_order = Vec::with_capacity(n);
        let mut nodes = Vec::with_capacity(kept.len());
        for (k, &s) in kept.iter().enumerate() {
            index[s as usize] = k as u32;
            let first = last_order.len() as u32;
            last_order.extend(columns[s as usize].iter().map(|&j| order[j as usize]));
            let last = last_order.len() as u32;
            nodes.push(Supernode {
                first,
                last,
                ..Supernode::default()
            });
        }
        let mut children = vec![Vec::new(); nodes.len()];
        for (k, &s) in kept.iter().enumerate() {
            let p = node_parent[s as usize];
            nodes[k].parent = if p == NONE { NONE } else { index[p as usize] };
            if p != NONE {
                children[index[p as usize] as usize].push(k as u32);
            }
        }
        let order = last_order;
        let number = invert(&order);
        let mut dof_start = Vec::with_capacity(n + 1);
        dof_start.push(0);
        for &v in &order {
            dof_start.push(dof_start[dof_start.len() - 1] + graph.weights[v as usize] as usize);
        }
        let mut symbolic = Symbolic {
            order,
            number,
            dof_start,
            nodes,
            children,
            schedule: Vec::new(),
        };
        symbolic.find_rows(graph);
        symbolic.sort_children();
        symbolic.schedule = symbolic.subtree_schedule();
        symbolic
    }

    /// Union of the pivots' own entries and of the children's rows, bottom up.
    fn find_rows(&mut self, graph: &SiteGraph) {
        let mut mark = vec![NONE; self.order.len()];
        for s in 0..self.nodes.len() {
            let (first, last) = (self.nodes[s].first, self.nodes[s].last);
            let mut rows = Vec::new();
            for j in first..last {
                for &w in graph.neighbours_of(self.order[j as usize] as usize) {
                    let i = self.number[w as usize];
                    if i >= last && mark[i as usize] != s as u32 {
                        mark[i as usize] = s as u32;
                        rows.push(i);
                    }
                }
            }
            for &c in &self.children[s] {
                for &i in &self.nodes[c as usize].rows {
                    if i >= last && mark[i as usize] != s as u32 {
                        mark[i as usize] = s as u32;
                        rows.push(i);
                    }
                }
            }
            rows.sort_unstable();
            let weight = |i: u32| self.dof_start[i as usize + 1] - self.dof_start[i as usize];
            let row_dofs = rows.iter().map(|&i| weight(i)).sum();
            let node = &mut self.nodes[s];
            node.pivot_dofs = self.dof_start[last as usize] - self.dof_start[first as usize];
            node.row_dofs = row_dofs;
            node.rows = rows;
        }
    }

    /// Visits the child with the largest excess of peak over result first: the smallest stack \[Liu1986\].
    fn sort_children(&mut self) {
        // children come before parents, so that their own lists are final when they are met here
        let mut peaks = vec![0u64; self.nodes.len()];
        for s in 0..self.nodes.len() {
            let mut list = std::mem::take(&mut self.children[s]);
            let excess = |c: u32| peaks[c as usize] - self.update_size(c);
            list.sort_by_key(|&c| (std::cmp::Reverse(excess(c)), c));
            let (mut held, mut peak) = (0u64, 0u64);
            for &c in &list {
                peak = peak.max(held + peaks[c as usize]);
                held += self.update_size(c);
            }
            peaks[s] = peak.max(held + self.update_size(s as u32));
            self.children[s] = list;
        }
    }

    /// Scalars in the contribution block of supernode `s`.
    fn update_size(&self, s: u32) -> u64 {
        (self.nodes[s as usize].row_dofs as u64).pow(2)
    }

    /// All supernodes, each subtree contiguous, children in their order of visit.
    fn subtree_schedule(&self) -> Vec<u32> {
        let mut reversed = Vec::with_capacity(self.nodes.len());
        let mut stack: Vec<u32> = (0..self.nodes.len() as u32)
            .filter(|&s| self.nodes[s as usize].parent == NONE)
            .collect();
        while let Some(s) = stack.pop() {
            reversed.push(s);
            stack.extend_from_slice(&self.children[s as usize]);
        }
        reversed.reverse();
        reversed
    }

    /// Bytes of the tree itself.
    pub fn bytes(&self) -> usize {
        let rows: usize = self.nodes.iter().map(|n| n.rows.len()).sum();
        4 * rows + 20 * self.order.len() + std::mem::size_of::<Supernode>() * self.nodes.len()
    }

    /// The supernode that takes up the contribution of `s`.
    pub(crate) fn parent(&self, s: usize) -> Option<usize> {
        let parent = self.nodes[s].parent;
        (parent != NONE).then_some(parent as usize)
    }

    /// Number of unknowns.
    pub fn dofs(&self) -> usize {
        self.dof_start.last().copied().unwrap_or(0)
    }

    /// The cost of a Cholesky (`Symmetric`) or an LU factorisation on this tree.
    pub fn cost(&self, symmetry: Symmetry) -> FactorCost {
        let mut cost = FactorCost::default();
        let (mut stored, mut held, mut peak) = (0u64, 0u64, 0u64);
        for &s in &self.schedule {
            let node = &self.nodes[s as usize];
            let (p, r) = (node.pivot_dofs as u64, node.row_dofs as u64);
            let (pf, rf) = (p as f64, r as f64);
            let cholesky_flops = pf * pf * pf / 3.0 + pf * pf * rf + pf * rf * rf;
            match symmetry {
                Symmetry::Symmetric => {
                    cost.factor_nnz += p * (p + 1) / 2 + p * r;
                    cost.flops += cholesky_flops;
                    stored += p * (p + r);
                }
                Symmetry::Unsymmetric => {
                    cost.factor_nnz += p * p + 2 * p * r;
                    cost.flops += 2.0 * cholesky_flops;
                    stored += p * (p + 2 * r);
                }
            }
            held += self.update_size(s);
            peak = peak.max(stored + held);
            held -= self.children[s as usize]
                .iter()
                .map(|&c| self.update_size(c))
                .sum::<u64>();
        }
        cost.bytes = 8 * peak;
        cost
    }
}

fn invert(order: &[u32]) -> Vec<u32> {
    let mut number = vec![0; order.len()];
    for (k, &v) in order.iter().enumerate() {
        number[v as usize] = k as u32;
    }
    number
}

/// The elimination tree and the length of each column of the factor, diagonal included \[Liu1990\], by walking the
/// row subtrees: time of the order of the factor's entries in sites.
fn elimination_tree(graph: &SiteGraph, order: &[u32], number: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let n = order.len();
    let (mut parent, mut count, mut visited) = (vec![NONE; n], vec![1u32; n], vec![NONE; n]);
    for j in 0..n as u32 {
        visited[j as usize] = j;
        for &w in graph.neighbours_of(order[j as usize] as usize) {
            let mut i = number[w as usize];
            while i < j && visited[i as usize] != j {
                if parent[i as usize] == NONE {
                    parent[i as usize] = j;
                }
                count[i as usize] += 1;
                visited[i as usize] = j;
                i = parent[i as usize];
            }
        }
    }
    (parent, count)
}

/// Vertices of a forest, children before parents, each subtree contiguous.
fn postorder(parent: &[u32]) -> Vec<u32> {
    let n = parent.len();
    let (mut head, mut next) = (vec![NONE; n], vec![NONE; n]);
    for j in (0..n).rev() {
        if parent[j] != NONE {
            next[j] = head[parent[j] as usize];
            head[parent[j] as usize] = j as u32;
        }
    }
    let (mut post, mut stack) = (Vec::with_capacity(n), Vec::new());
    let roots = (0..n as u32).filter(|&j| parent[j as usize] == NONE);
    for root in roots {
        stack.push(root);
        while let Some(&j) = stack.last() {
            match head[j as usize] {
                NONE => {
                    post.push(j);
                    stack.pop();
                }
                child => {
                    head[j as usize] = next[child as usize];
                    stack.push(child);
                }
            }
        }
    }
    post
}

/// Merges children into parents where [`MERGE`] allows; merged nodes lose their columns. `heights` is the length of
/// the first column of each node, in sites.
fn merge(columns: &mut [Vec<u32>], parent: &mut [u32], heights: Vec<usize>) {
    let n = columns.len();
    let mut children = vec![Vec::new(); n];
    for s in 0..n {
        if parent[s] != NONE {
            children[parent[s] as usize].push(s as u32);
        }
    }
    let mut rows: Vec<usize> = (0..n).map(|s| heights[s] - columns[s].len()).collect();
    let triangle = |p: usize, r: usize| p * (p + 1) / 2 + p * r;
    let mut zeros = vec![0usize; n];
    for s in 0..n {
        // the largest children first: they add the fewest zeros
        let mut list = std::mem::take(&mut children[s]);
        list.sort_by_key(|&c| {
            (
                std::cmp::Reverse(columns[c as usize].len() + rows[c as usize]),
                c,
            )
        });
        let mut kept = Vec::new();
        for c in list {
            let c = c as usize;
            let (p, pc) = (columns[s].len(), columns[c].len());
            let merged = triangle(p + pc, rows[s]);
            let z = merged - triangle(p, rows[s]) - triangle(pc, rows[c]) + zeros[s] + zeros[c];
            let fraction = z as f64 / merged as f64;
            if MERGE
                .iter()
                .any(|&(width, limit)| p + pc <= width && fraction <= limit)
            {
                let mut together = std::mem::take(&mut columns[c]);
                together.append(&mut columns[s]);
                columns[s] = together;
                zeros[s] = z;
                rows[c] = 0;
                for &g in &children[c] {
                    parent[g as usize] = s as u32;
                }
                let mut grand = std::mem::take(&mut children[c]);
                kept.append(&mut grand);
            } else {
                kept.push(c as u32);
            }
        }
        children[s] = kept;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::FreeDofs;
    use crate::solve::ordering::Ordering;
    use crate::solve::stencils::StencilGrid;

    /// Marks the entries of the factor by elimination on a dense pattern, vertex by vertex.
    fn dense_fill(graph: &SiteGraph, symbolic: &Symbolic) -> Vec<Vec<bool>> {
        let n = graph.len();
        let mut filled = vec![vec![false; n]; n];
        for v in 0..n {
            for &w in graph.neighbours_of(v) {
                filled[symbolic.number[v] as usize][symbolic.number[w as usize] as usize] = true;
            }
        }
        for k in 0..n {
            let below: Vec<usize> = (k + 1..n).filter(|&i| filled[i][k]).collect();
            for &i in &below {
                for &j in &below {
                    filled[i][j] = true;
                }
            }
        }
        filled
    }

    #[test]
    fn supernodes_hold_all_fill_and_few_zeros() {
        for (lattice, matrix) in [
            (
                StencilGrid::rectangle(16, 13),
                StencilGrid::rectangle(16, 13).elements(),
            ),
            (
                StencilGrid::rectangle(16, 13),
                StencilGrid::rectangle(16, 13).bonds(2),
            ),
            (
                StencilGrid::block(6, 5, 5),
                StencilGrid::block(6, 5, 5).elements(),
            ),
        ] {
            let graph = SiteGraph::new(&matrix, &FreeDofs::all(lattice.len(), lattice.dimension));
            for ordering in [
                Ordering::CoordinateNestedDissection,
                Ordering::Metis,
                Ordering::Amd,
            ] {
                let order = ordering
                    .order(&graph, &lattice.positions())
                    .expect("ordered");
                let symbolic = Symbolic::new(&graph, &order);
                let filled = dense_fill(&graph, &symbolic);
                let mut stored = 0;
                for (s, node) in symbolic.nodes.iter().enumerate() {
                    for j in node.first..node.last {
                        for i in j + 1..graph.len() as u32 {
                            let held = i < node.last || node.rows.binary_search(&i).is_ok();
                            stored += usize::from(held);
                            assert!(
                                held || !filled[i as usize][j as usize],
                                "{ordering:?}: ({i}, {j}) is lost"
                            );
                        }
                    }
                    // the rows of a child belong to the front of its parent
                    if let Some(parent) = symbolic.parent(s) {
                        let parent = &symbolic.nodes[parent];
                        let inside = |i: &u32| {
                            (parent.first..parent.last).contains(i) || parent.rows.contains(i)
                        };
                        assert!(node.rows.iter().all(inside));
                    } else {
                        assert!(node.rows.is_empty());
                    }
                }
                let needed = (0..graph.len())
                    .map(|j| (j + 1..graph.len()).filter(|&i| filled[i][j]).count())
                    .sum();
                assert!(
                    stored >= needed && stored < 2 * needed,
                    "{ordering:?}: {stored} for {needed}"
                );
            }
        }
    }

    #[test]
    fn costs_of_a_dense_matrix_are_the_textbook_ones() {
        // every site of a 3 × 3 lattice sees every other within four spacings: one front of 18 dofs
        let lattice = StencilGrid::rectangle(3, 3);
        let graph = SiteGraph::new(&lattice.bonds(4), &FreeDofs::all(9, 2));
        let symbolic = Symbolic::new(&graph, &(0..9).collect::<Vec<u32>>());
        assert_eq!(symbolic.nodes.len(), 1);
        let llt = symbolic.cost(Symmetry::Symmetric);
        assert_eq!(llt.factor_nnz, 18 * 19 / 2);
        assert!((llt.flops - 18f64.powi(3) / 3.0).abs() < 1e-9);
        let lu = symbolic.cost(Symmetry::Unsymmetric);
        assert_eq!((lu.factor_nnz, lu.bytes), (18 * 18, 8 * 18 * 18));
        assert!((lu.flops - 2.0 * 18f64.powi(3) / 3.0).abs() < 1e-9);
    }
}
