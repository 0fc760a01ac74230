//! Springs to the ground.
//!
//! By virtual work, as loads are: the displacement of each point of a quadrature is `Σ w u` of sites, and `½ ∫ k |u|²` is the energy of the springs. Their rows are therefore
//! symmetric and never negative, whatever the weights; the force of a rigid motion is that of the integral.

use std::collections::BTreeMap;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::ConditionKind;
use crate::fem;
use crate::mesh::Facet;
use crate::mesh::boundary::BoundaryFacet;
use crate::model::loaded_places::split_facets;
use crate::model::tributary::{Detail, Parts};
use crate::model::{CellRole, Model};
use crate::scene::bounds_checks;
use crate::scene::components::{Components, no_such_axis};
use crate::scene::condition_at::ConditionAt;
use crate::scene::conditions::{Condition, ConditionTerm, Prescribed};
use crate::scene::error::SceneError;
use crate::scene::region::Region;
use crate::scene::spec::ShapeSpec;
use crate::scene::value::{Number, Text};
use crate::system::{ForceTerm, SpringRows};
use crate::tensor::{AXES, Tensor, Vector};

/// Springs to the ground: exactly one of `on` and `inside`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct SpringSpec {
    /// A named set of facets of the mesh; stiffnesses are forces per area and displacement.
    pub on: Option<Text>,
    /// The cells of the mesh with their centroid in a shape; stiffnesses are forces per volume and displacement.
    pub inside: Option<ShapeSpec>,
    /// Stiffness along x.
    pub x: Option<Number>,
    /// Stiffness along y.
    pub y: Option<Number>,
    /// Stiffness along z.
    pub z: Option<Number>,
    /// Stiffness along the normal of the set, instead of components.
    pub normal: Option<Number>,
}

impl ConditionKind for SpringSpec {
    fn build<const D: usize>(&self, at: &ConditionAt<'_, D>) -> Result<Condition<D>, SceneError> {
        let place = at.place;
        let given = [&self.x, &self.y, &self.z];
        let choice = |what: &str, help: &str| {
            Err(SceneError::choice(format!("`{place}` has {what}"))
                .label(at.name.span.clone(), "springs")
                .help(help))
        };
        let mut stiffness = Vector::<D>::zeros();
        for (k, number) in given.iter().enumerate() {
            let Some(number) = number else { continue };
            let value = bounds_checks::positive(&format!("{place}.{}", AXES[k]), number)?;
            if k >= D {
                return Err(no_such_axis::<D>(place, k, &number.span));
            }
            stiffness[k] = value;
        }
        let has_components = given.iter().any(|g| g.is_some());
        let bedding = match (&self.on, &self.inside, &self.normal) {
            (None, None, _) | (Some(_), Some(_), _) => {
                return choice(
                    match self.on {
                        Some(_) => "both `on` and `inside`",
                        None => "neither `on` nor `inside`",
                    },
                    "keep one: `on = \"set\"` of the mesh, or `inside = { box = ... }`",
                );
            }
            (_, _, Some(_)) if has_components => {
                return choice("`normal` and components", "keep one of the two");
            }
            (None, Some(_), Some(_)) => {
                return choice(
                    "`inside` and `normal`",
                    "cells have no normal: give components, or name a set of facets by `on`",
                );
            }
            (_, _, None) if !has_components => {
                return choice("no stiffness", "add x = ..., or normal = ...");
            }
            (Some(on), None, Some(normal)) => Bedding::Normal {
                facets: at.outer_facets(on)?,
                stiffness: bounds_checks::positive(&format!("{place}.normal"), normal)?,
            },
            (Some(on), None, None) => Bedding::Axes {
                facets: at.facet_set(on)?.to_vec(),
                stiffness,
            },
            (None, Some(shape), None) => Bedding::Inside {
                region: at.inside(shape)?,
                stiffness,
            },
        };
        let none = Components(std::array::from_fn(|_| None));
        Ok(at.prescribes(Prescribed::Term(Arc::new(bedding)), none))
    }
}

/// The places that springs hold, and their stiffness.
#[derive(Clone, Debug, PartialEq)]
enum Bedding<const D: usize> {
    /// Facets.
    Axes {
        /// The facets.
        facets: Vec<Facet>,
        /// Force per area and displacement along each axis \[N/m³\].
        stiffness: Vector<D>,
    },
    /// Facets at the boundary of the mesh, along their normals.
    Normal {
        /// The facets.
        facets: Vec<BoundaryFacet>,
        /// Force per area and displacement \[N/m³\].
        stiffness: f64,
    },
    /// Cells whose centroid lies in a region.
    Inside {
        /// The region.
        region: Region<D>,
        /// Force per volume and displacement along each axis \[N/m⁴\].
        stiffness: Vector<D>,
    },
}

impl<const D: usize> ConditionTerm<D> for Bedding<D> {
    fn facets(&self) -> Vec<&[u32]> {
        match self {
            Self::Axes { facets, .. } => facets.iter().map(AsRef::as_ref).collect(),
            Self::Normal { facets, .. } => facets.iter().map(|f| f.nodes.as_ref()).collect(),
            Self::Inside { .. } => Vec::new(),
        }
    }

    fn holds_at_rest(&self) -> bool {
        true
    }

    fn on_model(&self, model: &Model<D>) -> Option<Arc<dyn ForceTerm>> {
        let own = blocks(model, self).0;
        let rows = (!own.is_empty()).then(|| SpringRows::from_blocks(D, &own))?;
        Some(Arc::new(rows))
    }
}

/// Blocks of pairs of sites.
#[derive(Default)]
struct Blocks(BTreeMap<(u32, u32), Vec<f64>>);

impl Blocks {
    /// Adds springs of the stiffness `k` at a place that follows these sites.
    fn add_place<const D: usize>(&mut self, follows: &[(u32, f64)], k: &Tensor<D>) {
        for &(row, v) in follows.iter().filter(|(_, w)| *w != 0.0) {
            for &(column, w) in follows.iter().filter(|(_, w)| *w != 0.0) {
                let block: Vec<f64> = (0..D * D).map(|e| k[(e / D, e % D)] * (v * w)).collect();
                let own = self.0.entry((row, column));
                let own = own.or_insert_with(|| vec![0.0; block.len()]);
                own.iter_mut().zip(block).for_each(|(own, b)| *own += b);
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
            let present = facets.iter().map(|f| mesh.present_facet(f));
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
            let inside = region.select_cells(mesh);
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
