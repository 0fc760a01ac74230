//! A solution at places between its nodes and points: tables along lines and at probes.

use super::fields::columns::{self, Rows};
use super::fields::place::{Place, Shared};
use super::intact::Intact;
use super::solution::Solved;
use crate::fem::{self, Locator};
use crate::scene::validated::FieldChoice;
use crate::shape::Shape;
use crate::system::Ranks;
use crate::tensor::{AXES, Tensor, Vector};
use crate::{
    model::{Carrier, Sampler},
    parallel,
};

/// The columns of a table along positions: place, displacement, strain, the stress where numbers made of it are asked for, further fields that are asked for, and the model.
pub(super) fn table_header<const D: usize>(choice: &FieldChoice) -> Vec<String> {
    let place = AXES[..D].iter().map(|a| (*a).to_owned());
    place.chain(columns::header::<D>(choice, true)).collect()
}

/// A position within the body.
struct Sample<const D: usize> {
    displacement: Vector<D>,
    carrier: Carrier,
}

/// The solution at sites and between them.
pub(super) struct SampledSolution<'a, const D: usize> {
    solved: &'a Solved<'a, D>,
    shared: Shared,
    sampler: Sampler<'a, D>,
    body: Locator<D>,
    tolerance: f64,
    ranks: Option<&'a dyn Ranks>,
}

impl<'a, const D: usize> SampledSolution<'a, D> {
    /// Of a solution, with an index of its cells and points; `ranks` are the processes over which families may be spread.
    pub fn new(solved: &'a Solved<'a, D>, ranks: Option<&'a dyn Ranks>) -> Self {
        let model = solved.model;
        let (lo, hi) = model.mesh.bounds();
        Self {
            solved,
            shared: Shared::of(solved),
            sampler: Sampler::new(model),
            body: Locator::new(&model.mesh, 0..model.mesh.cell_count()),
            tolerance: 1e-9 * (hi - lo).norm(),
            ranks,
        }
    }

    /// Returns true if a position lies in the mesh and in no void.
    fn is_inside(&self, x: &Vector<D>) -> bool {
        let model = self.solved.model;
        let in_void = model.peridynamics.as_ref().is_some_and(|p| {
            let inside = |v: &Shape<D>| v.signed_distance(x) < -self.tolerance;
            p.voids.iter().any(inside)
        });
        !in_void && self.body.locate(&model.mesh, x, self.tolerance).is_some()
    }

    /// In an element its strain there; among points that of the nearest point's family. `None` outside of the body.
    fn at(&self, x: &Vector<D>) -> Option<Sample<D>> {
        if !self.is_inside(x) {
            return None;
        }
        let displacement = self.sampler.displacement(x, self.solved.displacement)?;
        Some(Sample {
            displacement,
            carrier: self.sampler.carrier(x)?,
        })
    }

    /// The gradients of the samples that points carry, in their order.
    fn gradients_of_points<'s>(
        &self,
        samples: impl Iterator<Item = &'s Sample<D>>,
    ) -> Vec<Tensor<D>> {
        let solved = self.solved;
        let points = samples.filter_map(|sample| match sample.carrier {
            Carrier::Point(site) => Some(solved.model.point_of(site)?.1 as u32),
            Carrier::Element(..) => None,
        });
        let points: Vec<u32> = points.collect();
        let of_families = |own: &[u32]| {
            let gradient = |k: usize| solved.point_gradient(own[k] as usize, &self.shared.intact);
            let gradients = parallel::map(own.len(), 1, gradient);
            gradients.iter().flat_map(|g| g.iter().copied()).collect()
        };
        let numbers = (solved.model).of_families(self.ranks, &points, D * D, of_families);
        let tensors = numbers.chunks_exact(D * D);
        tensors.map(Tensor::from_column_slice).collect()
    }

    /// The rows of a table along positions, with the columns of [`table_header`]; none for a position outside of the body. Collective where families are spread.
    pub fn rows(&self, positions: &[Vector<D>]) -> Vec<Vec<f64>> {
        let samples: Vec<Option<Sample<D>>> = parallel::map_slice(positions, |x| self.at(x));
        let of_points = self.gradients_of_points(samples.iter().flatten());
        let mut of_points = of_points.into_iter();
        let fields = Rows::new(self.solved, true);
        let mut told = Vec::new();
        // a line may cross a slit: there is nothing to tell in it
        for (x, sample) in positions.iter().zip(&samples) {
            let Some(Sample {
                displacement,
                carrier,
            }) = sample
            else {
                continue;
            };
            let gradient = match carrier {
                Carrier::Point(_) => of_points.next(),
                Carrier::Element(..) => None,
            };
            let here = (*carrier, *displacement);
            told.push((x, here, gradient));
        }
        parallel::map_slice(&told, |(x, here, gradient)| {
            let place = Place::of_position(self.solved, &self.shared, *here, *gradient);
            let numbers = fields.at(Some(&place));
            x.iter().copied().chain(numbers).collect()
        })
    }
}

impl<const D: usize> Solved<'_, D> {
    pub(super) fn node(&self, n: usize) -> Vector<D> {
        let transfer = &self.model.node_transfer;
        transfer.displacement(n, self.displacement)
    }

    pub(super) fn element_gradient(&self, c: usize) -> Tensor<D> {
        fem::displacement_gradient_at_centre(&self.model.mesh, c, |n| self.node(n))
    }

    /// The displacement gradient at reference coordinates `xi` of an element.
    pub(super) fn gradient_in(&self, c: usize, xi: &[f64; 3]) -> Tensor<D> {
        fem::superconvergent_gradient(&self.model.mesh, c, xi, |n| self.node(n))
    }

    /// Least-squares gradient over the nearest bonds of a point that stand, weighted by 1/|ξ|²: sharper than over the whole family. Zero where they do not span the space.
    pub(super) fn point_gradient(&self, p: usize, intact: &Intact) -> Tensor<D> {
        let Some(body) = self.model.body() else {
            return Tensor::zeros();
        };
        let transfer = &body.cloud.transfer;
        let here = transfer.displacement::<D>(p, self.displacement);
        let bonds: Vec<(Vector<D>, usize)> = body
            .families
            .of(p)
            .iter()
            .filter(|&&j| intact.is_intact(p, j as usize))
            .map(|&j| (body.bond(p, j as usize), j as usize))
            .collect();
        let nearest = bonds
            .iter()
            .map(|(xi, _)| xi.norm())
            .fold(f64::INFINITY, f64::min);
        // the full family where the nearest shells do not span the space
        for reach in [1.5 * nearest, f64::INFINITY] {
            let (mut shape, mut moment) = (Tensor::<D>::zeros(), Tensor::<D>::zeros());
            for (xi, j) in bonds.iter().filter(|(xi, _)| xi.norm() <= reach) {
                let w = 1.0 / xi.norm_squared();
                let eta: Vector<D> = transfer.displacement::<D>(*j, self.displacement) - here;
                shape += xi * xi.transpose() * w;
                moment += eta * xi.transpose() * w;
            }
            if let Ok(inverse) = crate::peridynamics::invert_shape_tensor(&shape, bonds.len()) {
                return moment * inverse;
            }
        }
        Tensor::zeros()
    }
}
