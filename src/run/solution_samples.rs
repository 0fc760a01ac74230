//! A solution at places between its nodes and points: tables along lines and at probes.

use rustc_hash::FxHashMap;

use super::fields::columns::{self, Rows};
use super::fields::place::{Place, Shared};
use super::intact::Intact;
use super::slopes::{Slope, Slopes, Teller};
use super::solution::Solved;
use crate::fem::{self, Locator};
use crate::scene::validated::FieldChoice;
use crate::shape::Shape;
use crate::system::Ranks;
use crate::tensor::{AXES, Tensor, Vector, padded};
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
    slope: Option<Slope>,
}

impl<const D: usize> Sample<D> {
    /// The points whose families it needs the strain of.
    fn points(&self) -> Vec<usize> {
        let own = match (&self.slope, self.carrier) {
            (Some(slope), _) => slope.tellers().collect(),
            (None, Carrier::Point(site)) => vec![Teller::Point(site)],
            (None, Carrier::Element(..)) => Vec::new(),
        };
        let points = own.into_iter().filter_map(|teller| match teller {
            Teller::Point(site) => Some(site),
            Teller::Element(_) => None,
        });
        points.collect()
    }
}

/// The solution at sites and between them.
pub(super) struct SampledSolution<'a, const D: usize> {
    solved: &'a Solved<'a, D>,
    shared: Shared,
    sampler: Sampler<'a, D>,
    slopes: Slopes<'a, D>,
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
            slopes: Slopes::new(model),
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

    /// In an element its strain there, among points theirs. `None` outside of the body.
    fn at(&self, x: &Vector<D>) -> Option<Sample<D>> {
        if !self.is_inside(x) {
            return None;
        }
        let displacement = self.sampler.displacement(x, self.solved.displacement)?;
        let carrier = self.sampler.carrier(x)?;
        let slope = match self.solved.has_slope(carrier) {
            true => self.slopes.at(x, carrier),
            false => None,
        };
        let is_whole = |slope: Slope| {
            let slope = slope.of_whole(self.solved.model, &self.shared.intact);
            slope.into_owned()
        };
        Some(Sample {
            displacement,
            carrier,
            slope: slope.map(is_whole),
        })
    }

    /// The gradients of the points that samples need, by their sites.
    fn gradients_of_points(&self, samples: &[Option<Sample<D>>]) -> FxHashMap<usize, Tensor<D>> {
        let solved = self.solved;
        let mut sites: Vec<usize> = samples.iter().flatten().flat_map(Sample::points).collect();
        sites.sort_unstable();
        sites.dedup();
        let point = |site: &usize| solved.model.point_of(*site).map_or(0, |(_, p)| p as u32);
        let points: Vec<u32> = sites.iter().map(point).collect();
        let of_families = |own: &[u32]| {
            let gradient = |k: usize| solved.point_gradient(own[k] as usize, &self.shared.intact);
            let gradients = parallel::map(own.len(), 1, gradient);
            gradients.iter().flat_map(|g| g.iter().copied()).collect()
        };
        let numbers = (solved.model).of_families(self.ranks, &points, D * D, of_families);
        let tensors = numbers.chunks_exact(D * D);
        sites
            .into_iter()
            .zip(tensors.map(Tensor::from_column_slice))
            .collect()
    }

    /// Samples at positions, none outside of the body, and the gradients of the points that they need. Collective where families are spread.
    fn sampled(
        &self,
        positions: &[Vector<D>],
    ) -> (Vec<Option<Sample<D>>>, FxHashMap<usize, Tensor<D>>) {
        let samples: Vec<Option<Sample<D>>> = parallel::map_slice(positions, |x| self.at(x));
        let of_points = self.gradients_of_points(&samples);
        (samples, of_points)
    }

    /// The place of a sample at `x`, from the gradients of the points.
    fn place<'s>(
        &'s self,
        x: &Vector<D>,
        sample: &'s Sample<D>,
        of_points: &FxHashMap<usize, Tensor<D>>,
    ) -> Place<'s, D> {
        let of = |teller: Teller| match teller {
            Teller::Element(c) => self.solved.element_gradient(c),
            Teller::Point(site) => of_points[&site],
        };
        let slope = sample.slope.as_ref();
        let gradients = match (slope, sample.carrier) {
            (Some(slope), Carrier::Point(site)) => Some([slope.value(of), of(Teller::Point(site))]),
            (Some(slope), Carrier::Element(..)) => Some([slope.value(of); 2]),
            (None, Carrier::Point(site)) => Some([of(Teller::Point(site)); 2]),
            (None, Carrier::Element(..)) => None,
        };
        let here = (x, sample.carrier, Some(sample.displacement));
        Place::of_position(self.solved, &self.shared, here, slope, gradients)
    }

    /// The rows of a table along positions, with the columns of [`table_header`]; none for a position outside of the body. Collective where families are spread.
    pub fn rows(&self, positions: &[Vector<D>]) -> Vec<Vec<f64>> {
        let (samples, of_points) = self.sampled(positions);
        let fields = Rows::new(self.solved, true);
        // a line may cross a slit: there is nothing to tell in it
        let places = positions.iter().zip(&samples);
        let told: Vec<_> = places.filter_map(|(x, s)| Some((x, s.as_ref()?))).collect();
        parallel::map_slice(&told, |(x, sample)| {
            let numbers = fields.at(Some(&self.place(x, sample, &of_points)));
            x.iter().copied().chain(numbers).collect()
        })
    }

    /// The displacement gradient and the stress \[Pa\] at each position; none outside of the body. Collective where families are spread.
    pub fn stressed(&self, positions: &[Vector<D>]) -> Vec<Option<(Tensor<D>, Tensor<D>)>> {
        let (samples, of_points) = self.sampled(positions);
        let places: Vec<_> = positions.iter().zip(&samples).collect();
        parallel::map_slice(&places, |(x, sample)| {
            let place = self.place(x, sample.as_ref()?, &of_points);
            Some((place.gradient(), place.stress().tensor))
        })
    }
}

impl<const D: usize> Solved<'_, D> {
    pub(super) fn node(&self, n: usize) -> Vector<D> {
        let transfer = &self.model.node_transfer;
        transfer.displacement(n, self.displacement)
    }

    pub(super) fn element_gradient(&self, c: usize) -> Tensor<D> {
        let mesh = &self.model.mesh;
        let c = mesh.embedded.shown_by(c);
        fem::displacement_gradient_at_centre(mesh, c, |n| self.node(n))
    }

    /// The displacement gradient of an element at its centre, or of a point.
    pub(super) fn gradient_of(&self, teller: Teller, intact: &Intact) -> Tensor<D> {
        match teller {
            Teller::Element(c) => self.element_gradient(c),
            Teller::Point(site) => match self.model.point_of(site) {
                Some((_, p)) => self.point_gradient(p, intact),
                None => Tensor::zeros(),
            },
        }
    }

    /// The displacement gradient at reference coordinates `xi` of an element.
    pub(super) fn gradient_in(&self, c: usize, xi: &[f64; 3]) -> Tensor<D> {
        let mesh = &self.model.mesh;
        let shown = mesh.embedded.shown_by(c);
        let mut at = *xi;
        if shown != c {
            // that of a cell of second order goes on beyond it
            let x = fem::place_in(mesh, c, xi);
            match fem::reference_of(mesh, shown, &x) {
                Some(xi) => at = padded(&xi),
                None => return self.element_gradient(shown),
            }
        }
        fem::superconvergent_gradient(mesh, shown, &at, |n| self.node(n))
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
