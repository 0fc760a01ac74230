//! The displacement gradient anywhere in a cell, from the points of the cell where it is most accurate.
//!
//! Gradients of shape functions are one order more accurate at the points of the lower Gauss rule than elsewhere in a cell \[Barlow1976\]: in linear cells at the
//! centre, in cells of second order at two points along each direction of a line, quadrilateral or hexahedron, three of a triangle, four of a tetrahedron. Between
//! and beyond them the gradient is taken to be (multi)linear in the reference coordinates.

use super::cell::GAUSS;
use super::element::displacement_gradient_at;
use crate::mesh::{CellShape, Mesh};
use crate::tensor::{Tensor, Vector};

/// The displacement gradient of cell `c` at reference coordinates `xi`; in linear cells that of the centre.
///
/// Shapes: `displacement` gives the displacement \[m\] of a node of the mesh.
pub fn superconvergent_gradient<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    xi: &[f64; 3],
    displacement: impl Fn(usize) -> Vector<D>,
) -> Tensor<D> {
    let shape = mesh.shapes[c];
    if !shape.is_quadratic() {
        return super::displacement_gradient_at_centre(mesh, c, displacement);
    }
    let points = match shape.linear() {
        CellShape::Tri3 | CellShape::Tet4 => simplex(xi, D),
        _ => product(xi, D),
    };
    let gradient = |(at, weight): &([f64; 3], f64)| {
        displacement_gradient_at(mesh, c, at, &displacement) * *weight
    };
    points.iter().map(gradient).sum()
}

/// Position \[m\] to which the value of [`superconvergent_gradient`] at the reference coordinates `xi` of cell `c` belongs: that of `xi` itself, in linear cells the centroid.
pub fn position_in<const D: usize>(mesh: &Mesh<D>, c: usize, xi: &[f64; 3]) -> Vector<D> {
    match mesh.shapes[c].is_quadratic() {
        true => place_in(mesh, c, xi),
        false => mesh.centroid(c),
    }
}

/// Position \[m\] of reference coordinates `xi` in cell `c`.
pub fn place_in<const D: usize>(mesh: &Mesh<D>, c: usize, xi: &[f64; 3]) -> Vector<D> {
    let (shape, count) = super::shape_values(mesh, c, &Vector::from_fn(|i, _| xi[i]));
    let nodes = mesh.cell(c)[..count].iter().zip(shape);
    nodes
        .map(|(&n, share)| mesh.nodes[n as usize] * share)
        .sum()
}

/// Two points along each direction, and their weights at `xi`.
fn product(xi: &[f64; 3], dimension: usize) -> Vec<([f64; 3], f64)> {
    let corners = 0..1_usize << dimension;
    let point = |corner: usize| {
        let (mut at, mut weight) = ([0.0; 3], 1.0);
        for i in 0..dimension {
            let sign = if corner >> i & 1 == 1 { 1.0 } else { -1.0 };
            at[i] = sign * GAUSS;
            weight *= 0.5 * (1.0 + sign * xi[i] / GAUSS);
        }
        (at, weight)
    };
    corners.map(point).collect()
}

/// A point towards each corner of a triangle or tetrahedron, those of the rule of second degree, and their weights at `xi`.
fn simplex(xi: &[f64; 3], dimension: usize) -> Vec<([f64; 3], f64)> {
    // each point has this much of the corners that are not its own, and this much more of its own
    let others = if dimension == 2 {
        1.0 / 6.0
    } else {
        (5.0 - 5_f64.sqrt()) / 20.0
    };
    let own = 1.0 - (dimension + 1) as f64 * others;
    let rest = 1.0 - xi[..dimension].iter().sum::<f64>();
    let point = |corner: usize| {
        let mut at = [0.0; 3];
        at[..dimension].fill(others);
        // the first corner is the origin
        let share = match corner.checked_sub(1) {
            None => rest,
            Some(axis) => {
                at[axis] += own;
                xi[axis]
            }
        };
        (at, (share - others) / own)
    };
    (0..=dimension).map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::super::sample::boxes;
    use super::super::{Locator, displacement_gradient_at_centre};
    use super::*;

    /// In cells that are affine images of the reference cell a quadratic field has its gradient everywhere.
    fn quadratic_fields_are_exact<const D: usize>() {
        // u_i = Σ_jk h_ijk x_j x_k / 2
        let h = |i: usize, j: usize, k: usize| {
            let (j, k) = (j.min(k), j.max(k));
            ((7 * i + 3 * j + 5 * k) % 11) as f64 - 4.0
        };
        let places = |x: &Vector<D>| {
            Vector::<D>::from_fn(|i, _| {
                let pairs = (0..D).flat_map(|j| (0..D).map(move |k| (j, k)));
                pairs.map(|(j, k)| 0.5 * h(i, j, k) * x[j] * x[k]).sum()
            })
        };
        for mesh in boxes::<D>(2, 0.0) {
            let locator = Locator::new(&mesh, 0..mesh.cell_count());
            // a corner of the body, and a place in no middle
            for x in [
                Vector::<D>::zeros(),
                Vector::from_fn(|i, _| 0.31 + 0.17 * i as f64),
            ] {
                let located = locator.locate(&mesh, &x, 1e-9).unwrap();
                let xi = crate::tensor::padded(&located.reference);
                let u = |n: usize| places(&mesh.nodes[n]);
                let found = superconvergent_gradient(&mesh, located.cell, &xi, u);
                let exact = Tensor::<D>::from_fn(|i, j| (0..D).map(|k| h(i, j, k) * x[k]).sum());
                let shape = mesh.shapes[located.cell];
                if shape.is_quadratic() {
                    assert!((found - exact).amax() < 1e-12, "{shape:?}: {found}");
                } else {
                    let centre = displacement_gradient_at_centre(&mesh, located.cell, u);
                    assert_eq!(found, centre, "{shape:?}");
                }
            }
        }
    }

    #[test]
    fn the_gradient_of_a_quadratic_field() {
        quadratic_fields_are_exact::<1>();
        quadratic_fields_are_exact::<2>();
        quadratic_fields_are_exact::<3>();
    }
}
