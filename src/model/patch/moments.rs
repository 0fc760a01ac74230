//! Moments of a part of a cell or a facet, and the rule that they give.

use crate::{
    fem,
    model::simplex::Simplex,
    tensor::{Tensor, Vector},
};

/// Size, first and second moment of a part of a cell or a facet.
#[derive(Clone, Copy, Debug)]
pub(super) struct PartMoments<const D: usize> {
    pub size: f64,
    about: Vector<D>,
    first: Vector<D>,
    second: Tensor<D>,
}

impl<const D: usize> PartMoments<D> {
    /// Nothing, with moments about a place.
    pub fn about(place: Vector<D>) -> Self {
        Self {
            size: 0.0,
            about: place,
            first: Vector::zeros(),
            second: Tensor::zeros(),
        }
    }

    pub fn add(&mut self, part: &Simplex<D>) {
        part.quadrature(|x, w| {
            let x = x - self.about;
            self.size += w;
            self.first += x * w;
            self.second += x * x.transpose() * w;
        });
    }

    /// Adds another part, with moments about the same place.
    pub fn join(&mut self, other: &Self) {
        self.size += other.size;
        self.first += other.first;
        self.second += other.second;
    }

    /// Size, centroid, and the second moment about it over the size.
    pub fn central(&self) -> (f64, Vector<D>, Tensor<D>) {
        let centroid = self.first / self.size;
        let second = self.second / self.size - centroid * centroid.transpose();
        (self.size, self.about + centroid, second)
    }

    /// Places and weights that integrate polynomials of degree two over the part.
    pub fn rule(&self) -> Vec<(Vector<D>, f64)> {
        let (size, centroid, second) = self.central();
        let places = fem::places_of_part(centroid, &second);
        let weight = size / places.len() as f64;
        places.into_iter().map(|x| (x, weight)).collect()
    }
}
