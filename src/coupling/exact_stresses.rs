//! Partial stresses of geometrically exact bonds, [SAND2015-7998] eq. (2.19), beyond their linear part: the rows of [`PartialStresses`] have ν to first order in the displacement,
//! and are the stiffness at rest. The remainder is computed here.
//!
//! The family of a Gauss point is not that of a lattice point: its weights are fitted to fourth moments, which give the right stress to first order only.
//! So the stress at a Gauss point is that of the element's own law at the gradient G of the element, and the force state gives what the family's deformation has beyond G:
//!
//! ```text
//!   ν = P(G) + ν⟨η⟩ − ν⟨G ξ⟩ .
//! ```
//!
//! The first term is that of the elements, which have `P(G) − C : G`; to first order the sum is `ν⟨η⟩`, for the fit makes `ν⟨G ξ⟩ = C : G`. Every uniform deformation has the stress of the elements, and a rotation turns ν.

use std::sync::Arc;

use super::PartialStresses;
use crate::model::Model;
use crate::{
    parallel,
    peridynamics::{Law, MemorylessFamily, PdBody, bond_force::BondKinematics},
    tensor::{Tensor, Vector},
};

/// Points, or sites, whose forces are computed by one thread at a time.
const CHUNK: usize = 64;

/// A shape function's gradient at a Gauss point, by the node of the mesh.
pub type NodeGradient<const D: usize> = (u32, Vector<D>);

/// The points whose partial stress sites feel, and the weights of these stresses.
pub struct ExactStresses<const D: usize> {
    /// Body in which the points are numbered; none for the model's own body.
    body: Option<Arc<PdBody<D>>>,
    law: Arc<dyn Law<D>>,
    /// The points, ascending.
    points: Vec<u32>,
    /// For each point where its `gradients` begin; those of points without are empty.
    first_gradient: Vec<usize>,
    gradients: Vec<NodeGradient<D>>,
    /// For each site where its `weights` begin.
    first_weight: Vec<usize>,
    /// A place in `points`, and a.
    weights: Vec<(u32, Vector<D>)>,
    /// For each place of the cloud, true if its displacement is needed.
    is_asked: Vec<bool>,
}

impl<const D: usize> ExactStresses<D> {
    /// Of a term; none where it has no points.
    pub fn new(stresses: &PartialStresses<'_, D>) -> Option<Self> {
        let model = stresses.model;
        let law = Arc::clone(&model.peridynamics.as_ref()?.law);
        let body = stresses.body.clone();
        let of = body.as_deref().or_else(|| model.body())?;
        let (mut first_weight, mut all) = (vec![0], Vec::new());
        for site in 0..model.sites.len() {
            let on = (stresses.on_site)(site).into_iter();
            all.extend(on.map(|(j, a)| (j as u32, a)));
            first_weight.push(all.len());
        }
        let mut points: Vec<u32> = all.iter().map(|(j, _)| *j).collect();
        points.sort_unstable();
        points.dedup();
        let mut is_asked = vec![false; of.cloud.position.len()];
        for &j in &points {
            is_asked[j as usize] = true;
            let family = of.families.of(j as usize).iter();
            family.for_each(|&l| is_asked[l as usize] = true);
        }
        let mut of_point = vec![Vec::new(); of.cloud.position.len()];
        let mut quadrature = Vec::new();
        for cell in 0..model.mesh.cell_count() {
            let gauss_points = stresses.gauss_points(cell, &mut quadrature);
            for (point, g) in gauss_points.zip(&quadrature) {
                let nodes = model.mesh.cell(cell).iter().copied();
                of_point[point] = nodes.zip(g.gradient).collect();
            }
        }
        let (mut first_gradient, mut gradients) = (vec![0], Vec::new());
        for &j in &points {
            gradients.append(&mut of_point[j as usize]);
            first_gradient.push(gradients.len());
        }
        for (j, _) in &mut all {
            // every one is among them
            *j = points.partition_point(|p| p < j) as u32;
        }
        (!points.is_empty()).then_some(Self {
            body,
            law,
            points,
            first_gradient,
            gradients,
            first_weight,
            weights: all,
            is_asked,
        })
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        self.points.len() * 4
            + self.gradients.len() * size_of::<NodeGradient<D>>()
            + (self.first_weight.len() + self.first_gradient.len()) * 8
            + self.weights.len() * size_of::<(u32, Vector<D>)>()
            + self.is_asked.len()
    }

    /// Adds to the force of each site what the stresses have beyond the linear ones.
    pub fn add_force(&self, model: &Model<D>, u: &[f64], force: &mut [f64]) {
        let Some(body) = self.body.as_deref().or_else(|| model.body()) else {
            return;
        };
        let places = parallel::map(self.is_asked.len(), CHUNK, |place| {
            match self.is_asked[place] {
                true => body.cloud.transfer.displacement(place, u),
                false => Vector::zeros(),
            }
        });
        let nodes = |n: u32| model.node_transfer.displacement(n as usize, u);
        let stress: Vec<Tensor<D>> = parallel::map(self.points.len(), CHUNK, |k| {
            self.beyond(body, k, &places, nodes)
        });
        parallel::for_each_chunk(force, CHUNK * D, 1, |chunk, force| {
            for (k, force) in force.chunks_exact_mut(D).enumerate() {
                let site = chunk * CHUNK + k;
                let own = self.first_weight[site]..self.first_weight[site + 1];
                let sum = (self.weights[own].iter()).fold(Vector::<D>::zeros(), |sum, (j, a)| {
                    sum + stress[*j as usize] * a
                });
                force.iter_mut().zip(sum.iter()).for_each(|(f, x)| *f += x);
            }
        });
    }

    /// Returns the stress of a point beyond the linear one, without the contribution of the element around a Gauss point.
    fn beyond(
        &self,
        body: &PdBody<D>,
        k: usize,
        places: &[Vector<D>],
        nodes: impl Fn(u32) -> Vector<D>,
    ) -> Tensor<D> {
        let Some(states) = self.law.force_state() else {
            return Tensor::zeros();
        };
        let j = self.points[k] as usize;
        let neighbours = body.families.of(j);
        let (pair, omega) = body.kernel(j);
        let of = |l: &u32| body.bond(j, *l as usize);
        let bonds: Vec<Vector<D>> = neighbours.iter().map(of).collect();
        let volume = |l: &u32| body.cloud.volume[*l as usize];
        let volumes: Vec<f64> = neighbours.iter().map(volume).collect();
        let family = MemorylessFamily {
            bonds: &bonds,
            volumes: &volumes,
            pair,
            omega,
            state: body.state(j),
            material: body.cloud.material.get(j).copied().unwrap_or(0),
            damage: 0.0,
        };
        let exact = |difference: &[Vector<D>]| {
            let (stress, _) = family.stress(states, BondKinematics::Exact, difference);
            stress
        };
        let apart = |l: usize| places[l] - places[j];
        let differences: Vec<Vector<D>> = neighbours.iter().map(|&l| apart(l as usize)).collect();
        let gradients = &self.gradients[self.first_gradient[k]..self.first_gradient[k + 1]];
        if gradients.is_empty() {
            return exact(&differences) - body.partial_stress_under(j, apart);
        }
        let gradient = (gradients.iter()).fold(Tensor::<D>::zeros(), |sum, (node, gradient)| {
            sum + nodes(*node) * gradient.transpose()
        });
        let uniform: Vec<Vector<D>> = bonds.iter().map(|xi| gradient * xi).collect();
        let rest = |l: usize| apart(l) - gradient * body.bond(j, l);
        exact(&differences) - exact(&uniform) - body.partial_stress_under(j, rest)
    }
}
