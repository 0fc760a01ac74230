//! Affine fields: their gradients, and the exact nodal forces of their constant stress.

use crate::fem;
use crate::mesh::boundary::BoundaryFacet;
use crate::mesh::{Mesh, facet_corners};
use crate::model::Model;
use crate::tensor::{Tensor, Tensor4, Vector};

/// Gradients of all affine fields, `D²` of them: those that give an elastic body one component of stress each, as large as its largest stiffness, and the
/// infinitesimal rotations.
pub(super) fn gradients<const D: usize>(tensor: &Tensor4<D>) -> Vec<Tensor<D>> {
    let mut list = Vec::with_capacity(D * D);
    for i in 0..D {
        for j in i..D {
            list.push(of_stress(tensor, &unit_stress(i, j)));
        }
    }
    for i in 0..D {
        for j in i + 1..D {
            let mut g = Tensor::zeros();
            (g[(i, j)], g[(j, i)]) = (1.0, -1.0);
            list.push(g);
        }
    }
    list
}

/// The stress with the one component `(i, j)`, of size 1.
fn unit_stress<const D: usize>(i: usize, j: usize) -> Tensor<D> {
    let mut s = Tensor::zeros();
    (s[(i, j)], s[(j, i)]) = (1.0, 1.0);
    s
}

/// The symmetric gradient that gives an isotropic, or nearly isotropic, tensor the stress `scale · s`, `scale` being its largest component.
///
/// Exact for an isotropic tensor: `ε = (s − λ/(D λ + 2 μ) tr s)/(2 μ)`, with `λ = C_1122` and `μ = C_1212`; of a lattice's tensor, the field is affine all the same.
pub(super) fn of_stress<const D: usize>(tensor: &Tensor4<D>, s: &Tensor<D>) -> Tensor<D> {
    let scale = tensor.amax();
    if D == 1 {
        return s * (scale / tensor.get(0, 0, 0, 0));
    }
    let (lambda, mu) = (tensor.get(0, 0, 1, 1), tensor.get(0, 1, 0, 1));
    let mean = lambda / (D as f64 * lambda + 2.0 * mu) * s.trace();
    (s - Tensor::identity() * mean) * (0.5 * scale / mu)
}

/// Integrals `∫ N_a n dA` of the nodes on the outer boundary, over the facets that finite elements carry, and between cells of other materials or axes, from both sides.
///
/// Shapes: one entry per node and facet: its node, the cell whose stress acts, the integral \[m^(D−1)\].
pub(super) fn boundary_integrals<const D: usize>(model: &Model<D>) -> Vec<(u32, u32, Vector<D>)> {
    let mesh = &model.mesh;
    let mut list = Vec::new();
    let mut add = |facet: &BoundaryFacet| {
        let nodes = match facet.local == BoundaryFacet::CROSSING {
            true => mesh.cell(facet.cell as usize),
            false => &facet.nodes,
        };
        for (n, share) in nodes.iter().zip(shares(mesh, facet)) {
            match model.followed_nodes(*n) {
                Some(followed) => {
                    let all = followed.iter();
                    list.extend(all.map(|&(m, w)| (m, facet.cell, share * w)));
                }
                None => list.push((*n, facet.cell, share)),
            }
        }
    };
    let outer = mesh.outer_facets();
    outer
        .iter()
        .filter(|f| model.node_takes(f.cell as usize))
        .for_each(&mut add);
    if !(1..mesh.cell_count()).any(|c| model.differ(0, c)) {
        return list;
    }
    for facet in mesh.facets_between(|a, b| model.differ(a, b)) {
        add(&facet.first);
        add(&facet.second);
    }
    list
}

/// `∫ N_a n dA` of each node of a facet.
fn shares<const D: usize>(mesh: &Mesh<D>, facet: &BoundaryFacet) -> Vec<Vector<D>> {
    if facet.local == BoundaryFacet::CROSSING {
        return shares_of_cell(mesh, facet);
    }
    let count = facet.nodes.len();
    let corners = facet_corners::<D>(&facet.nodes);
    if corners.len() < count || mesh.embedded.cut_facet(corners).is_some() {
        return fem::facet_normals(mesh, &facet.nodes);
    }
    let area = mesh.facet_normal_area(facet);
    if count != 4 || D != 3 {
        // shape functions of an edge or a triangle have equal integrals
        return vec![area / count as f64; count];
    }
    // a quadrilateral may be warped: normal times area, x_ξ × x_η, is a polynomial
    let x: [Vector<D>; 4] = std::array::from_fn(|a| mesh.nodes[facet.nodes[a] as usize]);
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let at = 1.0 / 3f64.sqrt();
    let mut sums = vec![Vector::zeros(); 4];
    for (s, t) in [(-at, -at), (at, -at), (-at, at), (at, at)] {
        let (mut p, mut q) = (Vector::<D>::zeros(), Vector::<D>::zeros());
        for (x, [a, b]) in x.iter().zip(corners) {
            p += x * (0.25 * a * (1.0 + b * t));
            q += x * (0.25 * b * (1.0 + a * s));
        }
        let normal = Vector::<D>::from_fn(|i, _| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            p[j] * q[k] - p[k] * q[j]
        });
        for (sum, [a, b]) in sums.iter_mut().zip(corners) {
            *sum += normal * (0.25 * (1.0 + a * s) * (1.0 + b * t));
        }
    }
    sums
}

/// `∫ N_a n dA` of each node of a cell over a facet that crosses it.
fn shares_of_cell<const D: usize>(mesh: &Mesh<D>, facet: &BoundaryFacet) -> Vec<Vector<D>> {
    let cell = facet.cell as usize;
    let mut sums = vec![Vector::zeros(); mesh.cell(cell).len()];
    fem::outward_points(mesh, facet, |p| {
        let Some(xi) = fem::reference_of(mesh, cell, &p.position) else {
            return;
        };
        let (shape, _) = fem::shape_values(mesh, cell, &xi);
        for (sum, value) in sums.iter_mut().zip(shape) {
            *sum += p.normal * (value * p.weight);
        }
    });
    sums
}

/// Force of a uniform field on the outer boundary, node by node, on the sites that nodes are.
///
/// Shapes: `force` has `D` numbers per site. Units: \[N\] (per thickness in 2D).
pub(super) fn nodal_forces<const D: usize>(
    model: &Model<D>,
    integrals: &[(u32, u32, Vector<D>)],
    site_of_node: &[u32],
    gradient: &Tensor<D>,
    force: &mut [f64],
) {
    force.fill(0.0);
    for (node, cell, integral) in integrals {
        let site = site_of_node[*node as usize];
        if site != u32::MAX {
            let f = model.tensor_of_cell(*cell as usize).contract(gradient) * integral;
            for a in 0..D {
                force[site as usize * D + a] += f[a];
            }
        }
    }
}

/// Part of the largest cell of a site that its row stands for at least.
const LEAST: f64 = 0.01;

/// Returns the volume over which the force of a row is taken \[m^D\]: that of its site, and not what little, or less than nothing, cuts and nodes that follow leave it of cells whose round-off the row has.
pub(super) fn volume_of_row<const D: usize>(model: &Model<D>, site: usize) -> f64 {
    let own = model.sites[site].volume;
    if !model.mesh.embedded.has_patch() || model.point_of(site).is_some() {
        return own;
    }
    let cells = model
        .cells_of_site(site)
        .map(|(c, _)| model.mesh.cell_volume(c).abs());
    cells.map(|volume| LEAST * volume).fold(own, f64::max)
}
