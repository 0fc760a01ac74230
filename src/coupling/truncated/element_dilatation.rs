//! Dilatations of the elements behind the faces that follow the bonds of an LPS: `∫ θ(F) dV` instead of `∫ div u dV`, so that a rotation changes nothing.

use std::sync::Arc;

use super::bond_segments::Segments;
use crate::{
    fem,
    peridynamics::CauchyBorn,
    tensor::{Tensor, Vector},
};

/// A quadrature point: its volume, and the gradient of each of the element's own sites.
type QuadraturePoint<const D: usize> = (f64, Vec<Vector<D>>);

/// The dilatations of elements, by the numbers that [`super::dilatation_state::States`] has for them.
pub(super) struct ElementDilatations<const D: usize> {
    law: Arc<CauchyBorn<D>>,
    /// Quadrature points of each dilatation; none of that of a point.
    points: Vec<Vec<QuadraturePoint<D>>>,
}

impl<const D: usize> ElementDilatations<D> {
    /// Of a law, without elements yet.
    pub fn new(law: Arc<CauchyBorn<D>>) -> Self {
        Self {
            law,
            points: Vec::new(),
        }
    }

    /// Adds a dilatation: of a point, or of an element with its own sites, ascending.
    pub fn push(&mut self, segments: &Segments<'_, D>, cell: Option<u32>, own: &[u32]) {
        let mut points = Vec::new();
        if let Some(cell) = cell {
            let mesh = &segments.model.mesh;
            fem::for_each_point(mesh, cell as usize, fem::Rule::Stiffness, |p| {
                let mut gradients = vec![Vector::zeros(); own.len()];
                for (&n, g) in mesh.cell(cell as usize).iter().zip(&p.gradient) {
                    for (site, w) in segments.model.node_transfer.row(n as usize) {
                        if let Ok(k) = own.binary_search(&site) {
                            gradients[k] += g * w;
                        }
                    }
                }
                points.push((p.weight, gradients));
            });
        }
        self.points.push(points);
    }

    /// `∫ θ(F) dV` of an element, and its derivatives by the displacements of its sites, which overwrite `slopes`; none of a point.
    pub fn of(
        &self,
        f: usize,
        displacement: impl Fn(usize) -> Vector<D>,
        slopes: &mut [Vector<D>],
    ) -> f64 {
        slopes.fill(Vector::zeros());
        let mut sum = 0.0;
        for (weight, gradients) in &self.points[f] {
            let mut gradient = Tensor::<D>::zeros();
            for (k, g) in gradients.iter().enumerate() {
                gradient += displacement(k) * g.transpose();
            }
            let (theta, slope) = self.law.dilatation(&gradient);
            sum += weight * theta;
            for (to, g) in slopes.iter_mut().zip(gradients) {
                *to += slope * g * *weight;
            }
        }
        sum
    }
}
