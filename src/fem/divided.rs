//! Quadrilaterals and hexahedra with shape functions that are linear in space, part by part: four triangles, or 24 tetrahedra, meet in the middle of the cell.
//!
//! The middle of the cell, and of each face of a hexahedron, has the mean of the displacements of its corners. With the axes `a_1, …, a_D` in the order in which `|ξ|` falls,
//!
//! ```text
//! N_i = Σ_j (|ξ_{a_j}| − |ξ_{a_{j+1}}|) [i lies on the sides of ξ along a_1 … a_j] / 2^{D−j} ,    |ξ_{a_0}| = 1 , ξ_{a_{D+1}} = 0 ,
//! ```
//!
//! in the plane as in space. Over a whole face `∫ N_i n dA` is that of the bilinear functions: with the vector areas `J = J₀ + J₁ ξ + J₂ η` of a face, both are `J₀ + (J₁ ξ_i + J₂ η_i)/3`. A divided cell that shares a whole face with
//! a cell of bilinear or trilinear functions therefore keeps affine fields in equilibrium.

use super::cell::{PerNode, ReferenceCell};
use super::geometry::{jacobian, normal, relative_nodes};
use super::{hex8, quad4};
use crate::mesh::{CellShape, Mesh};
use crate::tensor::{Vector, determinant, inverse};

/// The divided quadrilateral. A whole cell is none: its rules are those of the parts that are left.
pub(super) static QUADRILATERAL: ReferenceCell = ReferenceCell {
    shape: quad4::CELL.shape,
    corners: quad4::CELL.corners,
    centre: quad4::CELL.centre,
    values: |xi| values::<2>(xi, quad4::CELL.corners),
    gradients: |xi| gradients::<2>(xi, quad4::CELL.corners),
    outside: quad4::CELL.outside,
    stiffness: quad4::CELL.stiffness,
    mass: quad4::CELL.mass,
};

/// The divided hexahedron, as [`QUADRILATERAL`].
pub(super) static HEXAHEDRON: ReferenceCell = ReferenceCell {
    shape: hex8::CELL.shape,
    corners: hex8::CELL.corners,
    centre: hex8::CELL.centre,
    values: |xi| values::<3>(xi, hex8::CELL.corners),
    gradients: |xi| gradients::<3>(xi, hex8::CELL.corners),
    outside: hex8::CELL.outside,
    stiffness: hex8::CELL.stiffness,
    mass: hex8::CELL.mass,
};

/// The divided cell of a shape.
pub(super) fn of(shape: CellShape) -> Option<&'static ReferenceCell> {
    let all = [&QUADRILATERAL, &HEXAHEDRON];
    all.into_iter().find(|cell| cell.shape == shape)
}

/// The axes in the order in which `|ξ|` falls.
fn order<const D: usize>(xi: &[f64; 3]) -> [usize; D] {
    let mut axes: [usize; D] = std::array::from_fn(|k| k);
    axes.sort_by(|&k, &l| xi[l].abs().total_cmp(&xi[k].abs()));
    axes
}

/// Number of the axes, from the first on, along which a corner lies on the side of ξ.
fn common(axes: &[usize], xi: &[f64; 3], corner: &[f64; 3]) -> usize {
    let is_there = |&&k: &&usize| xi[k].is_sign_positive() == corner[k].is_sign_positive();
    axes.iter().take_while(is_there).count()
}

fn values<const D: usize>(xi: &[f64; 3], corners: &[[f64; 3]]) -> PerNode<f64> {
    let axes = order::<D>(xi);
    let at = |j: usize| match j {
        0 => 1.0,
        j => axes.get(j - 1).map_or(0.0, |&k| xi[k].abs()),
    };
    let mut n = PerNode::<f64>::default();
    for (n, corner) in n.iter_mut().zip(corners) {
        let shares = (0..=common(&axes, xi, corner)).map(|j| share::<D>(j) * (at(j) - at(j + 1)));
        *n = shares.sum();
    }
    n
}

fn gradients<const D: usize>(xi: &[f64; 3], corners: &[[f64; 3]]) -> PerNode<[f64; 3]> {
    let axes = order::<D>(xi);
    let mut gradients = PerNode::<[f64; 3]>::default();
    for (gradient, corner) in gradients.iter_mut().zip(corners) {
        let common = common(&axes, xi, corner);
        let of = |j: usize| if j <= common { share::<D>(j) } else { 0.0 };
        for (j, &k) in axes.iter().enumerate() {
            gradient[k] = (of(j + 1) - of(j)) * 1f64.copysign(xi[k]);
        }
    }
    gradients
}

/// The share of a corner in the mean over the corners on the sides along `j` axes.
fn share<const D: usize>(j: usize) -> f64 {
    0.5f64.powi((D - j) as i32)
}

/// A part of a divided cell: its corner, the axes in the order in which `|ξ|` falls there, and a place in it.
type Part = ([f64; 3], &'static [usize], [f64; 3]);

/// The parts of a cell, halved along the middles of its edges.
fn parts(cell: &ReferenceCell) -> impl Iterator<Item = Part> {
    let count = cell.shape.dimension();
    let orders = if count == 2 { &ORDERS[..2] } else { &ORDERS };
    cell.corners.iter().flat_map(move |corner| {
        orders.iter().map(move |axes| {
            let mut within = [0.0; 3];
            for (j, &k) in axes[..count].iter().enumerate() {
                within[k] = corner[k] * (count - j) as f64;
            }
            (*corner, &axes[..count], within)
        })
    })
}

/// Returns true if all parts of a cell have a volume in the same sense.
pub fn may_be_divided<const D: usize>(mesh: &Mesh<D>, c: usize) -> bool {
    let Some(cell) = of(mesh.shapes[c]) else {
        return false;
    };
    let (_, x) = relative_nodes(mesh, c);
    let volume = |(_, _, within): Part| {
        determinant(&jacobian(&x[..cell.nodes()], &(cell.gradients)(&within)))
    };
    let whole = mesh.cell_volume(c);
    parts(cell).all(|part| volume(part) * whole > 0.0)
}

/// Reference coordinates of a position in a divided cell with corners `x`, within or beyond it: those of the part, continued from the middle outwards, that holds the position. Of a face in space the position has to lie on it.
pub(super) fn coordinates<const D: usize>(
    cell: &ReferenceCell,
    x: &[Vector<D>],
    position: &Vector<D>,
) -> Option<Vector<D>> {
    let x = &x[..cell.nodes()];
    let from_middle = position - x.iter().sum::<Vector<D>>() / x.len() as f64;
    let of_part = |(corner, axes, within): Part| {
        // the map is linear there
        let mut jacobian = jacobian(x, &(cell.gradients)(&within));
        if axes.len() < D {
            let normal = normal(&jacobian.column(0).into(), &jacobian.column(1).into());
            jacobian.set_column(2, &normal);
        }
        let xi = inverse(&jacobian)?.0 * from_middle;
        let along = |j: usize| axes.get(j).map_or(0.0, |&k| corner[k] * xi[k]);
        let least = (0..axes.len()).map(|j| along(j) - along(j + 1));
        Some((least.fold(f64::INFINITY, f64::min), xi))
    };
    let all = parts(cell).filter_map(of_part);
    all.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, xi)| xi)
}

/// Orders of the axes; the first two are those in the plane.
static ORDERS: [[usize; 3]; 6] = [
    [0, 1, 2],
    [1, 0, 2],
    [0, 2, 1],
    [1, 2, 0],
    [2, 0, 1],
    [2, 1, 0],
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::cell::MAX_NODES;
    use crate::fem::sample::noise;

    /// Corners of a cell that are moved at random.
    fn distorted<const D: usize>(cell: &ReferenceCell, seed: usize) -> Vec<Vector<D>> {
        let place = |(a, corner): (usize, &[f64; 3])| {
            Vector::<D>::from_fn(|k, _| corner[k] + 0.5 * noise(seed + a, k))
        };
        cell.corners.iter().enumerate().map(place).collect()
    }

    fn places_and_gradients<const D: usize>(cell: &ReferenceCell) {
        for seed in 0..20 {
            let x = distorted::<D>(cell, 1000 * seed);
            let mut all = [Vector::<D>::zeros(); MAX_NODES];
            all[..x.len()].copy_from_slice(&x);
            for place in 0..50 {
                let xi = Vector::<D>::from_fn(|k, _| 3.0 * noise(seed + place, k) - 0.1);
                let padded = crate::tensor::padded(&xi);
                let shape = (cell.values)(&padded);
                assert!((shape.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                let position: Vector<D> = x.iter().zip(&shape).map(|(x, n)| x * *n).sum();
                let found = coordinates(cell, &all, &position).unwrap();
                assert!((found - xi).amax() < 1e-11, "{found} {xi}");
                let gradients = (cell.gradients)(&padded);
                for k in 0..D {
                    let (mut up, mut down) = (padded, padded);
                    up[k] += 1e-7;
                    down[k] -= 1e-7;
                    let (up, down) = ((cell.values)(&up), (cell.values)(&down));
                    for a in 0..x.len() {
                        let slope = (up[a] - down[a]) / 2e-7;
                        assert!((slope - gradients[a][k]).abs() < 1e-7, "{seed} {place}");
                    }
                }
            }
        }
    }

    #[test]
    fn places_are_found_and_gradients_are_those_of_the_shape_functions() {
        places_and_gradients::<2>(&QUADRILATERAL);
        places_and_gradients::<3>(&HEXAHEDRON);
    }

    /// `∫ N_i n dA` over a face of four corners, as the doc comment has it and of the four triangles.
    #[test]
    fn faces_share_their_area_as_bilinear_ones_do() {
        let x: [Vector<3>; 4] = std::array::from_fn(|a| {
            let corner = quad4::CELL.corners[a];
            Vector::<3>::from_fn(|k, _| corner[k] + 0.8 * noise(a, k))
        });
        let middle = x.iter().sum::<Vector<3>>() / 4.0;
        let mut divided = [Vector::<3>::zeros(); 4];
        for a in 0..4 {
            let b = (a + 1) % 4;
            let area = (x[b] - x[a]).cross(&(middle - x[a])) / 2.0;
            // a third each, and a quarter of the middle's
            divided.iter_mut().for_each(|own| *own += area / 12.0);
            divided[a] += area / 3.0;
            divided[b] += area / 3.0;
        }
        let mesh = crate::mesh::Mesh::<3> {
            nodes: x.to_vec(),
            ..Default::default()
        };
        let bilinear = crate::fem::facet_normals(&mesh, &[0, 1, 2, 3]);
        for (own, other) in divided.iter().zip(&bilinear) {
            assert!((own - other).amax() < 1e-14, "{own} {other}");
        }
    }
}
