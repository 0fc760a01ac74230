//! Quadrature rules of a part of a cell, from the moments of the part.

use super::element::reference;
use super::geometry::{jacobian, relative_nodes};
use super::locate::reference_of;
use crate::mesh::{CellShape, CutCell, Mesh};
use crate::tensor::{Tensor, Vector, determinant, padded};

/// Size, centroid and second moment about it over the size, of a part of a cell: \[m^D\], \[m\], \[m²\].
pub type CentralMoments<const D: usize> = (f64, Vector<D>, Tensor<D>);

/// Returns the rules of what is left of a cell, by parts in each of which its Jacobian is constant: one part of a simplex, or of a box, whatever its axes are; several of a divided cell.
///
/// The rule of a part has two points along each axis, `c ± l_1 ± … ± l_D` of equal weight, with the centroid `c` and the columns `l_k` of a factor of the second moment
/// about it, `L Lᵀ`: positive, exact for polynomials of degree two, and off the axes, so that no mode of a box is without energy. A simplex has constant gradients, and one point for its stiffness.
///
/// `None` if no element lives on the cell.
pub fn rule_of_parts<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    parts: &[CentralMoments<D>],
) -> Option<CutCell> {
    let cell = reference(mesh, c)?;
    let (_, nodes) = relative_nodes(mesh, c);
    let is_constant = mesh.embedded.is_divided(c)
        || matches!(
            mesh.shapes[c],
            CellShape::Line2 | CellShape::Tri3 | CellShape::Tet4
        );
    let mut rules = CutCell::default();
    let at = |x: &Vector<D>, size: f64| -> Option<([f64; 3], f64)> {
        let xi = padded(&reference_of(mesh, c, x)?);
        let stretch = determinant(&jacobian(&nodes[..cell.nodes()], &(cell.gradients)(&xi)));
        Some((xi, size / stretch.abs()))
    };
    for (size, centroid, second) in parts {
        for x in places_of_part(*centroid, second) {
            // of a divided cell it may lie in the part beside
            rules.mass.push(at(&x, size / f64::from(1 << D))?);
        }
        if is_constant {
            rules.stiffness.push(at(centroid, *size)?);
        }
        rules.fraction += size;
    }
    rules.fraction /= mesh.cell_volume(c).abs();
    if !is_constant {
        rules.stiffness = rules.mass.clone();
    }
    Some(rules)
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
