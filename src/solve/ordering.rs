//! Fill-reducing elimination orders on the graph of sites.
//!
//! Everything here works on sites, not on dofs: a block matrix has the fill of its site graph, which has `D²` times
//! fewer edges.

use crate::system::BlockCsr;
use crate::{parallel, solve::FreeDofs};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering as Memory};

/// The elimination order of a direct factorisation.
///
/// Factor entries and factorisation times of all three stand in `docs/solvers.md`; coordinates give the best order on
/// lattices and on meshes that follow one, and need no graph partitioner.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    serde::Serialize,
    serde::Deserialize,
    schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Ordering {
    /// Recursive bisection of the sites by coordinates, each cut widened to a vertex separator.
    #[default]
    CoordinateNestedDissection,
    /// Multilevel nested dissection of the graph \[KarypisKumar1998\], blind to coordinates.
    Metis,
    /// Approximate minimum degree: the cheapest to compute, the worst fill in 3D.
    Amd,
}

/// Failure of the computation of an elimination order.
#[derive(Debug, thiserror::Error)]
pub enum OrderingError {
    /// The graph has more edges than the ordering code can index.
    #[error(
        "the {what} ordering cannot index {edges} edges between sites; use the coordinate nested dissection ordering"
    )]
    TooLarge {
        /// The ordering asked for.
        what: &'static str,
        /// Directed edges of the graph.
        edges: usize,
    },
    /// The ordering code refused the graph.
    #[error("the {what} ordering failed: {reason}; use the coordinate nested dissection ordering")]
    Failed {
        /// The ordering asked for.
        what: &'static str,
        /// The message of the ordering code.
        reason: String,
    },
}

/// The structurally symmetric graph of the sites that keep at least one free dof.
///
/// Two sites are joined if `K` has a non-zero block between them in either direction.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SiteGraph {
    /// Site number of each vertex, ascending.
    pub sites: Vec<u32>,
    /// Free dofs of each vertex.
    pub weights: Vec<u8>,
    /// Start of the neighbours of each vertex; one entry more than vertices.
    pub offsets: Vec<usize>,
    /// Neighbouring vertices, ascending, without the vertex itself.
    pub neighbours: Vec<u32>,
}

impl SiteGraph {
    /// The graph of `matrix` restricted to the free dofs.
    ///
    /// Blocks that are exactly zero (bonds that were cut) join nothing.
    pub fn new(matrix: &BlockCsr, free: &FreeDofs) -> SiteGraph {
        let size = matrix.block * matrix.block;
        SiteGraph::joined(&matrix.row_offsets, &matrix.columns, free, |i, e| {
            let block = matrix.start(i) + e - matrix.row_offsets[i];
            matrix.values[block * size..(block + 1) * size]
                .iter()
                .any(|&k| k != 0.0)
        })
    }

    /// The graph of a pattern without values, to predict the cost of a matrix before it is assembled.
    ///
    /// Shapes: `row_offsets` and `columns` as in [`BlockCsr`], columns ascending within a row.
    pub fn from_pattern(row_offsets: &[usize], columns: &[u32], free: &FreeDofs) -> SiteGraph {
        SiteGraph::joined(row_offsets, columns, free, |_, _| true)
    }

    /// `joins` says whether an entry of the pattern, given by its site and its place, connects its sites.
    fn joined(
        row_offsets: &[usize],
        columns: &[u32],
        free: &FreeDofs,
        joins: impl Fn(usize, usize) -> bool + Sync,
    ) -> SiteGraph {
        let n_sites = free.sites();
        let sites: Vec<u32> = (0..n_sites as u32)
            .filter(|&i| free.count_of_site(i as usize) > 0)
            .collect();
        let mut vertex = vec![u32::MAX; n_sites];
        for (v, &i) in sites.iter().enumerate() {
            vertex[i as usize] = v as u32;
        }
        let rows: Vec<Vec<u32>> = parallel::map_slice(&sites, |&i| {
            (row_offsets[i as usize]..row_offsets[i as usize + 1])
                .filter(|&e| {
                    columns[e] != i
                        && vertex[columns[e] as usize] != u32::MAX
                        && joins(i as usize, e)
                })
                .map(|e| vertex[columns[e] as usize])
                .collect()
        });
        let missing: Vec<Vec<u32>> = {
            // an edge stored in one direction only is missing in the other row
            let lone: Vec<(u32, u32)> = rows
                .par_iter()
                .enumerate()
                .flat_map_iter(|(v, row)| {
                    let rows = &rows;
                    row.iter()
                        .filter(move |&&w| rows[w as usize].binary_search(&(v as u32)).is_err())
                        .map(move |&w| (w, v as u32))
                })
                .collect();
            let mut missing = vec![Vec::new(); if lone.is_empty() { 0 } else { rows.len() }];
            for (w, v) in lone {
                missing[w as usize].push(v);
            }
            missing
        };
        let weights = sites
            .iter()
            .map(|&i| free.count_of_site(i as usize) as u8)
            .collect();
        let mut offsets = Vec::with_capacity(sites.len() + 1);
        offsets.push(0);
        let total =
            rows.iter().map(Vec::len).sum::<usize>() + missing.iter().map(Vec::len).sum::<usize>();
        let mut neighbours = Vec::with_capacity(total);
        for (v, row) in rows.into_iter().enumerate() {
            let start = neighbours.len();
            neighbours.extend_from_slice(&row);
            if let Some(extra) = missing.get(v).filter(|extra| !extra.is_empty()) {
                neighbours.extend_from_slice(extra);
                neighbours[start..].sort_unstable();
            }
            offsets.push(neighbours.len());
        }
        SiteGraph {
            sites,
            weights,
            offsets,
            neighbours,
        }
    }

    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.sites.len()
    }

    /// Returns true if no dof is free.
    pub fn is_empty(&self) -> bool {
        self.sites.is_empty()
    }

    /// The neighbours of vertex `v`.
    pub fn neighbours_of(&self, v: usize) -> &[u32] {
        &self.neighbours[self.offsets[v]..self.offsets[v + 1]]
    }
}

impl Ordering {
    /// The vertices of `graph` in the order of elimination.
    ///
    /// Shapes: `positions` has one entry per site of the matrix, not per vertex of the graph.
    ///
    /// # Errors
    /// [`OrderingError`] if an ordering crate refuses the graph; the coordinate ordering never fails.
    pub fn order(
        self,
        graph: &SiteGraph,
        positions: &[[f64; 3]],
    ) -> Result<Vec<u32>, OrderingError> {
        match self {
            Ordering::CoordinateNestedDissection => {
                Ok(coordinate_nested_dissection(graph, positions))
            }
            Ordering::Metis => metis(graph),
            Ordering::Amd => minimum_degree(graph),
        }
    }
}

/// Sites below which a part is not cut any further; small parts become one front in any case.
const LEAF: usize = 32;

/// Parts below this many sites are cut on one thread.
const PARALLEL_PART: usize = 4096;

fn coordinate_nested_dissection(graph: &SiteGraph, positions: &[[f64; 3]]) -> Vec<u32> {
    let n = graph.len();
    let at: Vec<[f64; 3]> = graph.sites.iter().map(|&i| positions[i as usize]).collect();
    // how far each vertex reaches along each axis: only those that reach over a cut need their edges read
    let reach: Vec<[f64; 3]> = parallel::map(n, 1, |v| {
        let mut r = [0.0_f64; 3];
        for &w in graph.neighbours_of(v) {
            for k in 0..3 {
                r[k] = r[k].max((at[w as usize][k] - at[v][k]).abs());
            }
        }
        r
    });
    let part: Vec<AtomicU32> = (0..n).map(|_| AtomicU32::new(0)).collect();
    let mut order: Vec<u32> = (0..n as u32).collect();
    let cut = Dissection {
        graph,
        at: &at,
        reach: &reach,
        part: &part,
    };
    cut.dissect(&mut order, 1);
    order
}

/// The read-only data of one nested dissection; `part` labels the half that a vertex is in at the cut under way.
struct Dissection<'a> {
    graph: &'a SiteGraph,
    at: &'a [[f64; 3]],
    reach: &'a [[f64; 3]],
    part: &'a [AtomicU32],
}

impl Dissection<'_> {
    /// Orders `vertices` in place: first half, second half, separator. `label` is the number of this part in the
    /// binary tree of cuts (root 1); labels are distinct, so halves may be cut concurrently: a neighbour outside the
    /// part never carries one of its two labels.
    fn dissect(&self, vertices: &mut [u32], label: u32) {
        if vertices.len() <= LEAF || label >= 1 << 30 {
            return;
        }
        let Some((axis, middle, value)) = self.split(vertices) else {
            return;
        };
        let (left, right) = (2 * label, 2 * label + 1);
        for &v in &vertices[..middle] {
            self.part[v as usize].store(left, Memory::Relaxed);
        }
        for &v in &vertices[middle..] {
            self.part[v as usize].store(right, Memory::Relaxed);
        }
        let boundary = |side: &[u32], other: u32| -> Vec<bool> {
            side.iter()
                .map(|&v| {
                    let v = v as usize;
                    (self.at[v][axis] - value).abs() <= self.reach[v][axis]
                        && self
                            .graph
                            .neighbours_of(v)
                            .iter()
                            .any(|&w| self.part[w as usize].load(Memory::Relaxed) == other)
                })
                .collect()
        };
        let (a, b) = vertices.split_at(middle);
        let (touch_a, touch_b) = (boundary(a, right), boundary(b, left));
        let weight = |side: &[u32], touch: &[bool]| -> usize {
            side.iter()
                .zip(touch)
                .filter(|&(_, &t)| t)
                .map(|(&v, _)| self.graph.weights[v as usize] as usize)
                .sum()
        };
        let cut_a = weight(a, &touch_a) <= weight(b, &touch_b);
        let keep = |side: &[u32], touch: &[bool], touched: bool| -> Vec<u32> {
            side.iter()
                .zip(touch)
                .filter(|&(_, &t)| t == touched)
                .map(|(&v, _)| v)
                .collect()
        };
        let separator = if cut_a {
            keep(a, &touch_a, true)
        } else {
            keep(b, &touch_b, true)
        };
        let first = if cut_a {
            keep(a, &touch_a, false)
        } else {
            a.to_vec()
        };
        let second = if cut_a {
            b.to_vec()
        } else {
            keep(b, &touch_b, false)
        };
        if first.is_empty() || second.is_empty() {
            // everything reaches over the cut: the part is as good as dense
            return;
        }
        let (n1, n2) = (first.len(), second.len());
        vertices[..n1].copy_from_slice(&first);
        vertices[n1..n1 + n2].copy_from_slice(&second);
        vertices[n1 + n2..].copy_from_slice(&separator);
        drop((first, second, separator, touch_a, touch_b));
        let (one, rest) = vertices.split_at_mut(n1);
        let two = &mut rest[..n2];
        if one.len() + two.len() > PARALLEL_PART {
            rayon::join(|| self.dissect(one, left), || self.dissect(two, right));
        } else {
            self.dissect(one, left);
            self.dissect(two, right);
        }
    }

    /// Sorts `vertices` into two halves by the longest axis; returns the axis, the size of the first half and the
    /// coordinate between them. Sites with equal coordinates stay together, so that a lattice is cut along a plane.
    fn split(&self, vertices: &mut [u32]) -> Option<(usize, usize, f64)> {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for &v in vertices.iter() {
            for k in 0..3 {
                low[k] = low[k].min(self.at[v as usize][k]);
                high[k] = high[k].max(self.at[v as usize][k]);
            }
        }
        let axis = (0..3).max_by(|&i, &j| (high[i] - low[i]).total_cmp(&(high[j] - low[j])))?;
        let extent = high[axis] - low[axis];
        if extent.is_nan() || extent <= 0.0 {
            return None;
        }
        let x = |v: u32| self.at[v as usize][axis];
        let half = vertices.len() / 2;
        vertices.select_nth_unstable_by(half, |&a, &b| x(a).total_cmp(&x(b)).then(a.cmp(&b)));
        let median = x(vertices[half]);
        // rounding must not tear a plane of sites in two
        let tolerance = 1e-9 * extent;
        let below = vertices
            .iter()
            .filter(|&&v| x(v) < median - tolerance)
            .count();
        let upto = vertices
            .iter()
            .filter(|&&v| x(v) <= median + tolerance)
            .count();
        let cut_below = below > 0 && (upto == vertices.len() || half - below <= upto - half);
        let value = if cut_below {
            median - tolerance
        } else {
            median + tolerance
        };
        let mut sorted: Vec<u32> = Vec::with_capacity(vertices.len());
        sorted.extend(vertices.iter().copied().filter(|&v| x(v) <= value));
        let middle = sorted.len();
        sorted.extend(vertices.iter().copied().filter(|&v| x(v) > value));
        // the selection above leaves an order that depends on its algorithm; a fixed one keeps runs comparable
        sorted[..middle].sort_unstable();
        sorted[middle..].sort_unstable();
        vertices.copy_from_slice(&sorted);
        (middle > 0 && middle < vertices.len()).then_some((axis, middle, value))
    }
}

fn metis(graph: &SiteGraph) -> Result<Vec<u32>, OrderingError> {
    let what = "METIS";
    let too_large = || OrderingError::TooLarge {
        what,
        edges: graph.neighbours.len(),
    };
    let offsets = graph
        .offsets
        .iter()
        .map(|&o| i32::try_from(o))
        .collect::<Result<Vec<i32>, _>>()
        .map_err(|_| too_large())?;
    let neighbours: Vec<i32> = graph.neighbours.iter().map(|&v| v as i32).collect();
    let failed = |reason: String| OrderingError::Failed { what, reason };
    let pattern = feral_metis::CscPattern::new(graph.len(), &offsets, &neighbours)
        .ok_or_else(|| failed("the site graph is malformed".to_owned()))?;
    let order = feral_metis::metis_order(&pattern).map_err(|e| failed(format!("{e:?}")))?;
    Ok(order.into_iter().map(|v| v as u32).collect())
}

fn minimum_degree(graph: &SiteGraph) -> Result<Vec<u32>, OrderingError> {
    let what = "AMD";
    let n = graph.len();
    let failed = |reason: String| OrderingError::Failed { what, reason };
    // faer reads the upper triangle only, and indexes with one integer type
    let (mut offsets, mut upper) = (vec![0usize], Vec::with_capacity(graph.neighbours.len() / 2));
    for v in 0..n {
        upper.extend(
            graph
                .neighbours_of(v)
                .iter()
                .map(|&w| w as usize)
                .take_while(|&w| w < v),
        );
        offsets.push(upper.len());
    }
    let symbolic = SymbolicSparseColMatRef::new_checked(n, n, &offsets, None, &upper);
    let mut forward = vec![0usize; n];
    let mut inverse = vec![0usize; n];
    let mut memory = MemBuffer::try_new(amd::order_scratch::<usize>(n, upper.len()))
        .map_err(|_| failed("out of memory".to_owned()))?;
    amd::order(
        &mut forward,
        &mut inverse,
        symbolic,
        amd::Control::default(),
        MemStack::new(&mut memory),
    )
    .map_err(|e| failed(e.to_string()))?;
    Ok(forward.into_iter().map(|v| v as u32).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::stencils::{StencilGrid, splice};

    fn graph_of(lattice: &StencilGrid, matrix: &BlockCsr) -> SiteGraph {
        SiteGraph::new(matrix, &FreeDofs::all(lattice.len(), lattice.dimension))
    }

    #[test]
    fn every_ordering_is_a_permutation() {
        let lattice = StencilGrid::rectangle(23, 17);
        let graph = graph_of(&lattice, &lattice.bonds(2));
        for ordering in [
            Ordering::CoordinateNestedDissection,
            Ordering::Metis,
            Ordering::Amd,
        ] {
            let mut order = ordering
                .order(&graph, &lattice.positions())
                .expect("ordered");
            order.sort_unstable();
            assert!(
                order.into_iter().eq(0..lattice.len() as u32),
                "{ordering:?}"
            );
        }
    }

    #[test]
    fn the_last_sites_separate_the_others() {
        // 40 × 20 sites with bonds of two spacings: the first cut is a strip of 2 × 20 sites across the long axis
        let lattice = StencilGrid::rectangle(40, 20);
        let graph = graph_of(&lattice, &lattice.bonds(2));
        let order = Ordering::CoordinateNestedDissection
            .order(&graph, &lattice.positions())
            .expect("ordered");
        let separator = &order[order.len() - 40..];
        let x: Vec<usize> = separator.iter().map(|&v| v as usize % 40).collect();
        let (low, high) = (x.iter().min().copied(), x.iter().max().copied());
        assert!(
            matches!((low, high), (Some(a), Some(b)) if b == a + 1 && (17..22).contains(&a)),
            "{low:?} {high:?}"
        );
        for v in (0..graph.len()).filter(|v| v % 40 < x[0].min(x[1])) {
            assert!(
                graph
                    .neighbours_of(v)
                    .iter()
                    .all(|&w| (w as usize) % 40 <= high.unwrap_or(0))
            );
        }
    }

    #[test]
    fn coincident_sites_do_not_stop_the_bisection() {
        let lattice = StencilGrid::rectangle(30, 30);
        let graph = graph_of(&lattice, &lattice.elements());
        let order = Ordering::CoordinateNestedDissection
            .order(&graph, &[[1.0; 3]; 900])
            .expect("ordered");
        assert_eq!(order.len(), 900);
    }

    #[test]
    fn the_graph_is_symmetric_and_leaves_out_what_is_prescribed() {
        let lattice = StencilGrid::rectangle(12, 9);
        let matrix = splice(&lattice.bonds(3), &lattice.elements(), |i| i % 12 > 5);
        let mut prescribed = vec![None; matrix.dofs()];
        prescribed[2 * 40] = Some(0.0);
        prescribed[2 * 41] = Some(0.0);
        prescribed[2 * 41 + 1] = Some(0.0);
        let graph = SiteGraph::new(&matrix, &FreeDofs::from_prescribed(&prescribed, 2));
        assert_eq!(graph.len(), lattice.len() - 1);
        assert_eq!(graph.weights[40], 1);
        assert!(!graph.sites.contains(&41));
        let joined = |i: u32, j: u32| matrix.row(i as usize).0.binary_search(&j).is_ok();
        for v in 0..graph.len() {
            let i = graph.sites[v];
            let expected: Vec<u32> = (0..graph.len() as u32)
                .filter(|&w| {
                    let j = graph.sites[w as usize];
                    i != j && (joined(i, j) || joined(j, i))
                })
                .collect();
            assert_eq!(graph.neighbours_of(v), expected);
        }
    }
}
