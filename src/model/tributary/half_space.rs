//! Quadrature over the parts of cells and facets beyond a plane.

use crate::fem;
use crate::mesh::Mesh;
use crate::mesh::boundary::{BoundaryFacet, normal_area};
use crate::model::simplex::{Simplex, facet_simplices, simplices_of};
use crate::tensor::Vector;

/// Half-space beyond a plane.
///
/// Cells and facets that the plane cuts are divided into simplices, and these by the plane: integrals of fields up to degree 3 over what lies beyond are exact where
/// cells are straight. A facet in the plane does not lie beyond it.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfSpace<const D: usize> {
    /// A point of the plane \[m\].
    pub point: Vector<D>,
    /// Its unit normal, to what lies beyond.
    pub normal: Vector<D>,
    /// Distance from the plane up to which a place lies in it \[m\].
    pub tolerance: f64,
}

/// Position relative to the plane.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    Before,
    Beyond,
    Both,
}

impl<const D: usize> HalfSpace<D> {
    /// Distance from the plane, positive beyond it \[m\].
    pub fn height(&self, x: &Vector<D>) -> f64 {
        self.normal.dot(&(x - self.point))
    }

    /// Returns true if a place lies beyond the plane.
    pub fn holds(&self, x: &Vector<D>) -> bool {
        self.height(x) > self.tolerance
    }

    fn side(&self, mesh: &Mesh<D>, nodes: &[u32]) -> Side {
        let heights = nodes.iter().map(|&n| self.height(&mesh.nodes[n as usize]));
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| {
            (low.min(h), high.max(h))
        });
        match (low >= -self.tolerance, high > self.tolerance) {
            (_, false) => Side::Before,
            (true, true) => Side::Beyond,
            (false, true) => Side::Both,
        }
    }

    /// Visits places and weights \[m^D\] of a quadrature over what of a cell lies beyond.
    pub fn cell_points(&self, mesh: &Mesh<D>, c: usize, mut visit: impl FnMut(&Vector<D>, f64)) {
        match self.side(mesh, mesh.cell(c)) {
            Side::Before => {}
            Side::Beyond => fem::for_each_point(mesh, c, fem::Rule::Mass, |p| {
                visit(&p.position, p.weight);
            }),
            Side::Both => {
                for simplex in simplices_of(mesh, c) {
                    self.beyond(&simplex, &mut |part| part.quadrature(|x, w| visit(&x, w)));
                }
            }
        }
    }

    /// Visits places and weights [m^(D−1)] of a quadrature over what of a facet lies beyond.
    pub fn facet_points(
        &self,
        mesh: &Mesh<D>,
        facet: &[u32],
        mut visit: impl FnMut(&Vector<D>, f64),
    ) {
        match self.side(mesh, facet) {
            Side::Before => {}
            Side::Beyond => fem::facet_points(mesh, facet, |p| visit(&p.position, p.weight)),
            Side::Both => {
                for simplex in facet_simplices(mesh, facet) {
                    self.beyond(&simplex, &mut |part| part.quadrature(|x, w| visit(&x, w)));
                }
            }
        }
    }

    /// As [`HalfSpace::facet_points`], with the outward unit normal of each place.
    pub fn outward_points(
        &self,
        mesh: &Mesh<D>,
        facet: &BoundaryFacet,
        mut visit: impl FnMut(&Vector<D>, f64, &Vector<D>),
    ) {
        match self.side(mesh, &facet.nodes) {
            Side::Before => {}
            Side::Beyond => {
                fem::outward_points(mesh, facet, |p| visit(&p.position, p.weight, &p.normal));
            }
            Side::Both => {
                for simplex in facet_simplices(mesh, &facet.nodes) {
                    let area = normal_area(&simplex.corners[..simplex.count]);
                    let normal = area.try_normalize(0.0).unwrap_or_else(Vector::zeros);
                    self.beyond(&simplex, &mut |part| {
                        part.quadrature(|x, w| visit(&x, w, &normal));
                    });
                }
            }
        }
    }

    /// Hands what of a simplex lies beyond to `visit`, as simplices.
    fn beyond(&self, simplex: &Simplex<D>, visit: &mut dyn FnMut(&Simplex<D>)) {
        let heights: Vec<f64> = (0..simplex.count)
            .map(|i| self.height(&simplex.corners[i]))
            .collect();
        let before = heights.iter().position(|&h| h < -self.tolerance);
        let beyond = heights.iter().position(|&h| h > self.tolerance);
        let (p, q) = match (before, beyond) {
            (_, None) => return,
            (None, Some(_)) => return visit(simplex),
            (Some(p), Some(q)) => (p, q),
        };
        let t = heights[p] / (heights[p] - heights[q]);
        let between = simplex.corners[p] + (simplex.corners[q] - simplex.corners[p]) * t;
        for replaced in [p, q] {
            let mut part = *simplex;
            part.corners[replaced] = between;
            self.beyond(&part, visit);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::sample::boxes;

    fn cut_by<const D: usize>() {
        // simplices have the volume of a cell with warped faces, and another first moment
        let jitter = if D == 3 { 0.0 } else { 0.2 };
        for mesh in boxes::<D>(3, jitter) {
            let (low, high) = mesh.bounds();
            let normal = Vector::<D>::from_fn(|k, _| 1.0 - 0.4 * k as f64).normalize();
            let half = |normal: Vector<D>| HalfSpace {
                point: low + (high - low) * 0.41,
                normal,
                tolerance: 1e-12,
            };
            let sides = [half(normal), half(-normal)];
            // both sides are the whole, and each place lies on its side
            let (mut volume, mut moment, mut area) = (0.0, Vector::<D>::zeros(), 0.0);
            for side in &sides {
                for c in 0..mesh.cell_count() {
                    side.cell_points(&mesh, c, |x, w| {
                        assert!(side.height(x) > -1e-12);
                        volume += w;
                        moment += x * w;
                    });
                }
                for facet in mesh.outer_facets() {
                    let mut own = 0.0;
                    side.outward_points(&mesh, &facet, |x, w, n| {
                        assert!((n.norm() - 1.0).abs() < 1e-12 && side.height(x) > -1e-12);
                        own += w;
                    });
                    side.facet_points(&mesh, &facet.nodes, |_, w| own -= w);
                    assert!(own.abs() < 1e-12, "{own}");
                    side.facet_points(&mesh, &facet.nodes, |_, w| area += w);
                }
            }
            let whole: f64 = (0..mesh.cell_count()).map(|c| mesh.cell_volume(c)).sum();
            assert!((volume - whole).abs() < 1e-12 * whole, "{volume} {whole}");
            let mut exact = Vector::<D>::zeros();
            for c in 0..mesh.cell_count() {
                fem::for_each_point(&mesh, c, fem::Rule::Mass, |p| {
                    exact += p.position * p.weight
                });
            }
            assert!((moment - exact).norm() < 1e-12 * exact.norm());
            let facets = mesh.outer_facets();
            let all: f64 = facets
                .iter()
                .map(|f| fem::facet_area(&mesh, &f.nodes))
                .sum();
            assert!((area - all).abs() < 1e-10 * all, "{area} {all}");
        }
    }

    #[test]
    fn two_sides_of_a_plane_are_the_whole() {
        cut_by::<1>();
        cut_by::<2>();
        cut_by::<3>();
    }
}
