//! Lumping: share of each node in a cell's volume and mass, and in a body force on the cell beside lumped masses.

use super::cell::{MAX_NODES, Rule};
use super::element::for_each_point;
use super::load::body_force_vector;
use crate::mesh::Mesh;
use crate::tensor::Vector;

/// Lumped volume of every node over the given cells \[m^D\], as [`for_each_share`] has it: they add up to the cells' volume.
pub fn nodal_volumes<const D: usize>(
    mesh: &Mesh<D>,
    cells: impl Iterator<Item = usize>,
) -> Vec<f64> {
    let mut volumes = vec![0.0; mesh.nodes.len()];
    for c in cells {
        for_each_share(mesh, c, |n, part, volume| {
            volumes[n as usize] += part * volume
        });
    }
    volumes
}

/// Hands the share of each node of cell `c` in its volume to `add`, perhaps in pieces, as a fraction of a volume \[m^D\]: `∫ N_a dV` of a linear cell.
///
/// Those integrals are zero or negative at corners of cells of second order. Their shares are in the ratio of the diagonal of the consistent mass, `∫ N_a² dV / Σ_b ∫ N_b² dV` of the volume: positive, and of the same sum. Of a simplex
/// of which a part is left corners have the integrals of linear shape functions, and the nodes in the middle of edges take as much from both ends.
///
/// Source: \[HintonRockZienkiewicz1976\].
pub fn for_each_share<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    mut add: impl FnMut(u32, f64, f64),
) {
    let nodes = mesh.cell(c);
    if !mesh.shapes[c].is_quadratic() {
        for_each_point(mesh, c, Rule::Mass, |p| {
            for (&n, shape) in nodes.iter().zip(&p.shape) {
                add(n, *shape, p.weight);
            }
        });
        return;
    }
    if mesh.embedded.cut_cell(c).is_some() {
        share_parts(mesh, c, add);
        return;
    }
    let (mut volume, mut squares) = (0.0, [0.0; MAX_NODES]);
    for_each_point(mesh, c, Rule::Mass, |p| {
        volume += p.weight;
        for (square, shape) in squares.iter_mut().zip(&p.shape) {
            *square += shape * shape * p.weight;
        }
    });
    let total: f64 = squares.iter().sum();
    for (&n, square) in nodes.iter().zip(&squares) {
        add(n, square / total, volume);
    }
}

/// As [`for_each_share`], of the part that is left of a simplex of second order.
///
/// Corners begin with the integrals `∫ λ_a dV` of linear shape functions over the part, which are positive, and have its first moment. The node in the middle of an edge takes as much from both ends, so that this moment stays: of the
/// smaller integral the part that it takes in a whole cell, where these shares are those of the diagonal mass.
fn share_parts<const D: usize>(mesh: &Mesh<D>, c: usize, mut add: impl FnMut(u32, f64, f64)) {
    let sides = mesh.shapes[c].mid_sides();
    let nodes = mesh.cell(c);
    let corners = nodes.len() - sides.len();
    let (mut volume, mut linear) = (0.0, [0.0; MAX_NODES]);
    for_each_point(mesh, c, Rule::Mass, |p| {
        volume += p.weight;
        for (integral, shape) in linear.iter_mut().zip(&p.shape[..corners]) {
            *integral += shape * p.weight;
        }
        // λ_a = N_a + ½ Σ N_m over the edges of a corner
        for (ends, shape) in sides.iter().zip(&p.shape[corners..]) {
            ends.iter()
                .for_each(|&a| linear[a] += 0.5 * shape * p.weight);
        }
    });
    // (D + 1)/2 of the share of the middle of an edge
    let taken = [2.0 / 3.0, 8.0 / 19.0, 8.0 / 27.0][D - 1];
    let mut shares = linear;
    for (k, &[a, b]) in sides.iter().enumerate() {
        let part = taken * linear[a].min(linear[b]);
        shares[a] -= part;
        shares[b] -= part;
        shares[corners + k] = 2.0 * part;
    }
    for (&n, share) in nodes.iter().zip(&shares) {
        add(n, share / volume, volume);
    }
}

/// Nodal forces of a body force in cell `c` for a motion with lumped masses: one (node, force) per node of the cell.
///
/// `f_a = ∫ N_a b dV + (s_a − ∫ N_a dV / V) ∫ b dV` with the shares `s_a` of [`for_each_share`]: a body force that is the same everywhere is to all nodes what their masses are, so that all of them
/// fall alike, and the total of any body force is that of the consistent forces. The first moment is, too, where the lumped volume has that of the cell, as in every affine cell. Cells of first order keep their consistent forces, `s_a V = ∫ N_a dV`.
///
/// `body_force` is b(x) [N/m^D]. Forces \[N\].
pub fn lumped_body_force_vector<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
    body_force: impl Fn(&Vector<D>) -> Vector<D>,
) -> Vec<(u32, Vector<D>)> {
    let mut forces = body_force_vector(mesh, c, body_force);
    if !mesh.shapes[c].is_quadratic() {
        return forces;
    }
    let total: Vector<D> = forces.iter().map(|(_, f)| f).sum();
    let (mut volume, mut integrals) = (0.0, [0.0; MAX_NODES]);
    for_each_point(mesh, c, Rule::Mass, |p| {
        volume += p.weight;
        for (integral, shape) in integrals.iter_mut().zip(&p.shape) {
            *integral += shape * p.weight;
        }
    });
    let mut local = 0;
    // one share per node, in the order of the cell
    for_each_share(mesh, c, |_, share, _| {
        forces[local].1 += total * (share - integrals[local] / volume);
        local += 1;
    });
    forces
}

#[cfg(test)]
mod tests {
    use super::super::sample::{boxes, unit_box};
    use super::*;
    use crate::mesh::CellShape;

    /// Shares of a corner and of a node in the middle of an edge of an affine cell.
    fn shares<const D: usize>(shape: CellShape) -> (f64, f64) {
        let mesh = unit_box::<D>(shape, 1, 0.0);
        let volume = super::super::cell_volume(&mesh, 0);
        let mut found = Vec::new();
        for_each_share(&mesh, 0, |_, part, whole| found.push(part * whole / volume));
        let corners = shape.linear().node_count();
        for share in &found[..corners] {
            assert!((share - found[0]).abs() < 1e-14, "{shape:?}");
        }
        for share in &found[corners..] {
            assert!((share - found[corners]).abs() < 1e-14, "{shape:?}");
        }
        (found[0], found[corners])
    }

    #[test]
    fn shares_of_cells_of_second_order_are_those_of_the_textbook() {
        // [CookMalkusPlesha1989] table 13.3-1 in the plane; diagonals 6 : 32 of a tetrahedron's mass (V/420), 1/3 and 8/15 of a line's
        let close = |(p, q): (f64, f64), (a, b): (f64, f64)| {
            assert!(
                (p - a).abs() < 1e-14 && (q - b).abs() < 1e-14,
                "{p} {q}, {a} {b}"
            );
        };
        close(shares::<1>(CellShape::Line3), (1.0 / 6.0, 2.0 / 3.0));
        close(shares::<2>(CellShape::Tri6), (1.0 / 19.0, 16.0 / 57.0));
        close(shares::<2>(CellShape::Quad8), (3.0 / 76.0, 16.0 / 76.0));
        close(shares::<3>(CellShape::Tet10), (1.0 / 36.0, 4.0 / 27.0));
        let (corner, side) = shares::<3>(CellShape::Hex20);
        assert!(corner > 0.0 && (8.0 * corner + 12.0 * side - 1.0).abs() < 1e-14);
    }

    /// Shares of the part of a simplex within some distance of its first corner, of its longest edge: positive, of the part's mass and first moment, and of all of it those of a whole cell.
    fn shares_of_a_part<const D: usize>(shape: CellShape) {
        let mesh = unit_box::<D>(shape, 1, 0.0);
        let whole = super::super::cell_volume(&mesh, 0).abs();
        let corner = |k: usize| mesh.nodes[mesh.cell(0)[k] as usize];
        let own: Vec<f64> = nodal_volumes(&mesh, std::iter::once(0));
        for part in [1.0, 0.7, 0.4] {
            // a similar simplex: centroid and second moment about it shrink alike
            let mean = (0..=D).map(corner).sum::<Vector<D>>() / (D + 1) as f64;
            let spread = |k: usize| (corner(k) - mean) * (corner(k) - mean).transpose();
            let second = (0..=D).map(spread).sum::<crate::tensor::Tensor<D>>();
            let second = second / ((D + 1) * (D + 2)) as f64 * (part * part);
            let centroid = corner(0) + (mean - corner(0)) * part;
            let size = whole * part.powi(D as i32);
            let rule = super::super::rule_of_parts(&mesh, 0, &[(size, centroid, second)]).unwrap();
            let mut cut = mesh.clone();
            cut.embedded.cut.insert(0, rule);
            let (mut mass, mut moment) = (0.0, Vector::<D>::zeros());
            for_each_share(&cut, 0, |n, share, volume| {
                assert!(share > 0.01, "{shape:?} {part} {share}");
                mass += share * volume;
                moment += mesh.nodes[n as usize] * (share * volume);
                let is_whole = part == 1.0;
                assert!(!is_whole || (share * volume - own[n as usize]).abs() < 1e-14);
            });
            assert!((mass - size).abs() < 1e-14, "{shape:?} {part}");
            assert!(
                (moment / mass - centroid).norm() < 1e-14,
                "{shape:?} {part}"
            );
        }
    }

    #[test]
    fn shares_of_a_part_of_a_simplex_have_its_mass_and_first_moment() {
        shares_of_a_part::<1>(CellShape::Line3);
        shares_of_a_part::<2>(CellShape::Tri6);
        shares_of_a_part::<3>(CellShape::Tet10);
    }

    fn forces_of_a_body<const D: usize>() {
        for mesh in boxes::<D>(3, 0.2) {
            let mass = nodal_volumes(&mesh, 0..mesh.cell_count());
            let mut uniform = vec![0.0; mesh.nodes.len()];
            let (mut total, mut moment) = (0.0, 0.0);
            for c in 0..mesh.cell_count() {
                let along = |b: f64| {
                    let mut force = Vector::<D>::zeros();
                    force[0] = b;
                    force
                };
                for (n, f) in lumped_body_force_vector(&mesh, c, |_| along(2.0)) {
                    uniform[n as usize] += f[0];
                }
                // 1 + 2x on the unit box: total 2, first moment in x is 1/2 + 2/3
                let of_x = |x: &Vector<D>| along(1.0 + 2.0 * x[0]);
                for (n, f) in lumped_body_force_vector(&mesh, c, of_x) {
                    total += f[0];
                    moment += f[0] * mesh.nodes[n as usize][0];
                }
            }
            for (f, m) in uniform.iter().zip(&mass) {
                assert!((f - 2.0 * m).abs() < 1e-15, "{:?}", mesh.shapes[0]);
            }
            assert!((total - 2.0).abs() < 1e-13, "{:?}", mesh.shapes[0]);
            // jittered quadrilaterals and hexahedra are not affine: their lumped volume lies off the centroid
            let is_simplex = mesh.shapes[0].linear().node_count() == D + 1;
            let off = if is_simplex { 1e-13 } else { 3e-3 };
            assert!(
                (moment - 7.0 / 6.0).abs() < off,
                "{:?} {}",
                mesh.shapes[0],
                moment - 7.0 / 6.0
            );
        }
    }

    #[test]
    fn body_forces_are_to_all_nodes_what_their_masses_are() {
        forces_of_a_body::<1>();
        forces_of_a_body::<2>();
        forces_of_a_body::<3>();
    }
}
