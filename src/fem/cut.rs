//! Quadrature rules of a part of a cell, from the moments of the part.

use super::element::reference;
use super::locate::reference_of;
use crate::mesh::{CellShape, CutCell, CutRule, Mesh};
use crate::tensor::{Tensor, Vector, padded};

/// Returns the rules of a part of a cell with a constant Jacobian: a simplex, or a box along the axes.
///
/// The rule has two points along each axis, `c ± l_1 ± … ± l_D` of equal weight, with the centroid `c` and the columns `l_k` of a factor of the second moment
/// about it, `L Lᵀ`: positive, exact for polynomials of degree two, and off the axes, so that no mode of a box is without energy. A simplex has constant gradients, and one point for its stiffness.
///
/// `volume` \[m^D\], `centroid` \[m\] and `second`, the second moment about the centroid over the volume \[m²\], are those of the part. `None` if no element lives on the cell.
pub fn rule_of_part<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    (volume, centroid, second): (f64, Vector<D>, Tensor<D>),
) -> Option<CutCell> {
    let cell = reference(mesh, c)?;
    let whole = mesh.cell_volume(c).abs();
    let fraction = volume / whole;
    let all: f64 = cell.stiffness.iter().map(|point| point.1).sum();
    let at = |x: Vector<D>, part: f64| -> Option<([f64; 3], f64)> {
        Some((padded(&reference_of(mesh, c, &x)?), fraction * all * part))
    };
    let part = 1.0 / f64::from(1 << D);
    let mass: Option<CutRule> = (places_of_part(centroid, &second))
        .into_iter()
        .map(|x| at(x, part))
        .collect();
    let mass = mass?;
    let stiffness = match mesh.shapes[c] {
        CellShape::Line2 | CellShape::Tri3 | CellShape::Tet4 => vec![at(centroid, 1.0)?],
        _ => mass.clone(),
    };
    Some(CutCell {
        fraction,
        stiffness,
        mass,
    })
}

/// Places whose mean is exact for polynomials of degree two over a part with this centroid \[m\] and second moment about it, over its size \[m²\].
pub fn places_of_part<const D: usize>(centroid: Vector<D>, second: &Tensor<D>) -> Vec<Vector<D>> {
    let factor = cholesky(second);
    let place = |bits: usize| {
        let signs = Vector::<D>::from_fn(|k, _| if bits >> k & 1 == 1 { 1.0 } else { -1.0 });
        centroid + factor * signs
    };
    (0..1usize << D).map(place).collect()
}

/// The lower factor of a positive semi-definite tensor; columns that rounding would make imaginary vanish.
fn cholesky<const D: usize>(a: &Tensor<D>) -> Tensor<D> {
    let mut l = Tensor::<D>::zeros();
    for j in 0..D {
        let square = a[(j, j)] - (0..j).map(|k| l[(j, k)] * l[(j, k)]).sum::<f64>();
        if square <= 1e-14 * a[(j, j)] {
            continue;
        }
        l[(j, j)] = square.sqrt();
        for i in j + 1..D {
            let rest: f64 = (0..j).map(|k| l[(i, k)] * l[(j, k)]).sum();
            l[(i, j)] = (a[(i, j)] - rest) / l[(j, j)];
        }
    }
    l
}
