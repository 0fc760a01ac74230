//! Springs between the body and the ground, on the sites of a model.
//!
//! By virtual work, as loads are: the displacement of each point of a quadrature is `Σ w u` of sites, and `½ ∫ k |u|²` is the energy of the springs. Their rows are therefore
//! symmetric and never negative, whatever the weights; the force of a rigid motion is that of the integral.

use std::collections::BTreeMap;

use crate::coupling::tributary::{Detail, Parts};
use crate::coupling::{CellRole, Model};
use crate::fem;
use crate::observe::summary::Reaction;
use crate::run::error::RunError;
use crate::run::loads::{cells_of, split_facets};
use crate::scene::conditions::{Bedding, Condition};
use crate::system::SpringRows;
use crate::tensor::{Tensor, Vector};

/// The springs of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct Springs {
    /// All of them together.
    pub all: SpringRows,
    /// Those of each condition, by its name.
    each: Vec<(String, SpringRows)>,
}

impl Springs {
    /// Finds the sites that the springs of `conditions` hold.
    ///
    /// # Errors
    /// [`RunError::Idle`] for a condition that meets no site.
    pub fn new<const D: usize>(
        model: &Model<D>,
        conditions: &[Condition<D>],
    ) -> Result<Self, RunError> {
        let mut springs = Self::default();
        let mut all = Blocks::default();
        for condition in conditions {
            let Some(bedding) = condition.springs() else {
                continue;
            };
            let own = blocks(model, bedding);
            if own.0.is_empty() {
                return Err(RunError::Idle {
                    condition: condition.name.clone(),
                    remedy: "name a set on the boundary of the body, or enlarge the shape: it acts on the cells whose centroid it holds",
                });
            }
            for (pair, block) in &own.0 {
                all.add(*pair, block);
            }
            let rows = SpringRows::from_blocks(D, &own.0);
            springs.each.push((condition.name.clone(), rows));
        }
        if !springs.each.is_empty() {
            springs.all = SpringRows::from_blocks(D, &all.0);
        }
        Ok(springs)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.each.is_empty()
    }

    /// Subtracts `S u` from forces by dof.
    pub fn take_from(&self, forces: &mut [f64], u: &[f64]) {
        if !self.is_empty() {
            let mut taken = vec![0.0; forces.len()];
            self.all.add_product(u, &mut taken);
            let each = forces.iter_mut().zip(taken);
            each.for_each(|(f, own)| *f -= own);
        }
    }

    /// The force of each condition on the body, at the displacement `u` of all dofs.
    pub fn reactions<const D: usize>(&self, u: &[f64]) -> Vec<Reaction> {
        let of_one = |(name, rows): &(String, SpringRows)| {
            let mut force = vec![0.0; u.len()];
            rows.add_product(u, &mut force);
            let mut sum = vec![0.0; D];
            for (dof, f) in force.iter().enumerate() {
                sum[dof % D] -= f;
            }
            Reaction {
                condition: name.clone(),
                force: sum,
            }
        };
        self.each.iter().map(of_one).collect()
    }
}

/// Blocks of pairs of sites.
#[derive(Default)]
struct Blocks(BTreeMap<(u32, u32), Vec<f64>>);

impl Blocks {
    fn add(&mut self, pair: (u32, u32), block: &[f64]) {
        let own = self.0.entry(pair).or_insert_with(|| vec![0.0; block.len()]);
        own.iter_mut().zip(block).for_each(|(own, b)| *own += b);
    }

    /// Adds springs of the stiffness `k` at a place that follows these sites.
    fn add_place<const D: usize>(&mut self, follows: &[(u32, f64)], k: &Tensor<D>) {
        for &(row, v) in follows.iter().filter(|(_, w)| *w != 0.0) {
            for &(column, w) in follows.iter().filter(|(_, w)| *w != 0.0) {
                let block: Vec<f64> = (0..D * D).map(|e| k[(e / D, e % D)] * (v * w)).collect();
                self.add((row, column), &block);
            }
        }
    }
}

/// The springs of one condition.
fn blocks<const D: usize>(model: &Model<D>, bedding: &Bedding<D>) -> Blocks {
    let mesh = &model.mesh;
    let mut blocks = Blocks::default();
    let on_nodes = |nodes: &[u32], shape: &[f64]| -> Vec<(u32, f64)> {
        let each = nodes.iter().zip(shape);
        each.flat_map(|(&n, value)| {
            let row = model.node_transfer.row(n as usize);
            row.map(move |(site, w)| (site, w * value))
        })
        .collect()
    };
    match bedding {
        Bedding::Axes { facets, stiffness } => {
            let k = Tensor::from_diagonal(stiffness);
            let (own, zone) = split_facets(model, facets);
            for facet in own {
                fem::facet_points(mesh, &facet, |p| {
                    blocks.add_place(&on_nodes(&facet, &p.shape), &(k * p.weight));
                });
            }
            let parts = Parts::of_facets(model, &zone, Detail::Quadrature);
            parts.each_point(|_, weight, _, follows| blocks.add_place(follows, &(k * weight)));
        }
        Bedding::Normal { facets, stiffness } => {
            let k = |n: &Vector<D>, weight: f64| n * n.transpose() * (stiffness * weight);
            // with the nodes that its cell has in the model: cells at the seam are linear
            let present = facets.iter().map(|f| mesh.facet((f.cell, f.local)));
            let (own, zone): (Vec<_>, Vec<_>) =
                present.partition(|f| model.is_element(f.cell as usize));
            for facet in own {
                fem::outward_points(mesh, &facet, |p| {
                    let follows = on_nodes(&facet.nodes, &p.shape);
                    blocks.add_place(&follows, &k(&p.normal, p.weight));
                });
            }
            let parts = Parts::of_facets(model, &zone, Detail::Quadrature);
            parts.each_point(|_, weight, n, follows| blocks.add_place(follows, &k(n, weight)));
        }
        Bedding::Inside { region, stiffness } => {
            let k = Tensor::from_diagonal(stiffness);
            let inside = cells_of(model, region);
            for c in (0..inside.len()).filter(|&c| inside[c] && model.is_element(c)) {
                fem::for_each_point(mesh, c, fem::Rule::Mass, |p| {
                    let follows = on_nodes(mesh.cell(c), &p.shape);
                    blocks.add_place(&follows, &(k * p.weight));
                });
            }
            let zone: Vec<bool> = (0..inside.len())
                .map(|c| inside[c] && model.roles[c] == CellRole::Points)
                .collect();
            if zone.contains(&true) {
                let parts = Parts::of_cells(model, &zone, Detail::Quadrature);
                parts.each_point(|_, weight, _, follows| blocks.add_place(follows, &(k * weight)));
            }
        }
    }
    blocks
}
