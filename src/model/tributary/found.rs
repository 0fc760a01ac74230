//! Volumes and moments of the parts of cells that are found for points of a lattice.

use crate::model::simplex::Simplex;
use crate::tensor::{Tensor, Vector};
use rustc_hash::FxHashMap;

/// Level of detail that is kept of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// Its size and its centre: enough for a field that is the same everywhere.
    Centre,
    /// Quadrature points too, for a field that varies in space.
    Quadrature,
}

/// The force on a region and its first moment, `∫ b` and `∫ b ⊗ x`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments<const D: usize> {
    /// `∫ b` \[N\].
    pub force: Vector<D>,
    /// `∫ b ⊗ x` \[N m\], about the origin.
    pub moment: Tensor<D>,
}

impl<const D: usize> Default for Moments<D> {
    fn default() -> Self {
        Self {
            force: Vector::zeros(),
            moment: Tensor::zeros(),
        }
    }
}

impl<const D: usize> Moments<D> {
    /// Adds a force at a position.
    pub fn add(&mut self, force: &Vector<D>, x: &Vector<D>) {
        self.force += force;
        self.moment += force * x.transpose();
    }
}

/// Data of a part while it is put together.
pub(super) struct Found<const D: usize> {
    pub size: f64,
    /// `∫ (x − middle of the cell)`.
    pub moment: Vector<D>,
    pub quadrature: Vec<(Vector<D>, f64)>,
    /// Of a part of a surface, the outward unit normal at each quadrature point.
    pub normals: Vec<Vector<D>>,
}

impl<const D: usize> Default for Found<D> {
    fn default() -> Self {
        Self {
            size: 0.0,
            moment: Vector::zeros(),
            quadrature: Vec::new(),
            normals: Vec::new(),
        }
    }
}

impl<const D: usize> Found<D> {
    pub fn add(&mut self, simplex: &Simplex<D>, middle: &Vector<D>, detail: Detail) {
        let size = simplex.size();
        self.size += size;
        self.moment += (simplex.centre() - middle) * size;
        if detail == Detail::Quadrature {
            simplex.quadrature(|x, w| self.quadrature.push((x, w)));
        }
    }

    /// Adds a part of a surface with the outward unit normal `normal`.
    pub fn add_facet(
        &mut self,
        simplex: &Simplex<D>,
        middle: &Vector<D>,
        normal: &Vector<D>,
        detail: Detail,
    ) {
        self.add(simplex, middle, detail);
        self.normals.resize(self.quadrature.len(), *normal);
    }

    pub(super) fn take_in(&mut self, other: Self) {
        self.size += other.size;
        self.moment += other.moment;
        self.quadrature.extend(other.quadrature);
        self.normals.extend(other.normals);
    }
}

pub(super) type FoundCells<const D: usize> = FxHashMap<[i32; D], Found<D>>;
