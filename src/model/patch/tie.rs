//! Displacement of the nodes on the faces Γ of a rim, by a dual mortar.
//!
//! `Σ_j D_ij u_j = Σ_a M_ia u_a` with `D_ij = ∫_Γ ψ_i φ_j` and `M_ia = ∫_Γ ψ_i N_a`: φ the shape functions of the rim on Γ, N those of the mesh beyond it, ψ_i the dual function of node i on the
//! plane part of Γ that the node belongs to. On each face ψ = A φ for the nodes that belong to its part, `∫ ψ_i φ_j = δ_ij ∫ φ_j` among them and `Σ ψ_i = 1`, of the least norm. Nodes of a face that belong to
//! another part come from parts of lower axes, so that rows are solved in the order of axes.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::{
    NodeRow, PatchError,
    cells::{Face, Index, PatchCells},
    cuts::Cuts,
    gathered,
};
use crate::{
    fem,
    mesh::Mesh,
    model::simplex::{Simplex, simplices_of},
    parallel,
    tensor::Vector,
};

/// Distance beyond Γ at which the mesh is cut by a plane, in edges of a cell: facets of the mesh in Γ itself then belong to the cells beyond.
const BEYOND: f64 = 1e-7;

/// Part of a face that may be without an element beyond it, by rounding.
const UNCOVERED: f64 = 1e-6;

/// Integrals over one face.
struct FaceRows<const D: usize> {
    /// Row of each node that belongs to the face's part: the node, `∫ ψ_i φ_i`, `∫ ψ_i φ_j` of the others, `∫ ψ_i N_a`.
    rows: Vec<(Index<D>, f64, Vec<(Index<D>, f64)>, NodeRow)>,
}

/// The row of each node of Γ: nodes of the mesh with their weights.
///
/// # Errors
/// [`PatchError::Surface`] where the surface of the body meets a face within it.
pub(super) fn rows<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    cuts: &Cuts,
) -> Result<BTreeMap<Index<D>, NodeRow>, PatchError> {
    let faces = patch.faces();
    let axes = PatchCells::axes(&faces);
    let dual = Dual::<D>::new();
    let found = parallel::map(faces.len(), 4, |f| {
        face_rows(mesh, patch, cuts, &faces[f], &axes, &dual)
    });
    let mut sums: BTreeMap<(usize, Index<D>), (f64, Vec<(Index<D>, f64)>, NodeRow)> =
        BTreeMap::new();
    for (face, own) in faces.iter().zip(found) {
        for (node, diagonal, others, row) in own?.rows {
            let sum = sums.entry((face.axis, node)).or_default();
            sum.0 += diagonal;
            sum.1.extend(others);
            sum.2.extend(row);
        }
    }
    // by axis, so that what a row takes of another part is there
    let mut rows: BTreeMap<Index<D>, NodeRow> = BTreeMap::new();
    for ((_, node), (diagonal, others, own)) in sums {
        let others = others.into_iter().flat_map(|(other, d)| {
            let row = rows.get(&other).into_iter().flatten();
            row.map(move |&(n, w)| (n, -w * d))
        });
        let row = gathered(own.into_iter().chain(others));
        rows.insert(
            node,
            row.into_iter().map(|(n, w)| (n, w / diagonal)).collect(),
        );
    }
    Ok(rows)
}

fn face_rows<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    cuts: &Cuts,
    face: &Face<D>,
    axes: &BTreeMap<Index<D>, usize>,
    dual: &Dual<D>,
) -> Result<FaceRows<D>, PatchError> {
    let nodes = face.nodes();
    let keep = nodes.iter().map(|node| axes[node] == face.axis);
    let (kept, psi) = dual.functions(keep.collect());
    let edge = patch.cells.spacing;
    let size = edge.powi(D as i32 - 1);
    let corner = patch.node(&nodes[0]);
    let mut of_mesh: Vec<NodeRow> = vec![Vec::new(); kept.len()];
    let mut covered = 0.0;
    let beyond = face.neighbour();
    for &(c, _) in &patch.held[&beyond] {
        if cuts.is_covered(c) {
            continue;
        }
        for part in sections(mesh, patch, face, c as usize) {
            part.quadrature(|x, w| {
                covered += w;
                let Some(xi) = fem::reference_of(mesh, c as usize, &x) else {
                    return;
                };
                let (shape, _) = fem::shape_values(mesh, c as usize, &xi);
                let phi = shape_on_face(&((x - corner) / edge), face.axis);
                for (row, psi) in of_mesh.iter_mut().zip(psi.row_iter()) {
                    let value: f64 = psi.iter().zip(&phi).map(|(a, phi)| a * phi).sum();
                    let cell = mesh.cell(c as usize).iter().zip(&shape);
                    row.extend(cell.map(|(&n, shape)| (n, value * w * shape)));
                }
            });
        }
    }
    if (covered / size - 1.0).abs() > UNCOVERED {
        return Err(PatchError::Surface {
            position: patch.cells.centre(&beyond).iter().copied().collect(),
            percent: 100.0 * covered / size,
        });
    }
    let moments = &psi * &dual.mass * size;
    let rows = kept
        .iter()
        .zip(of_mesh)
        .enumerate()
        .map(|(k, (&own, row))| {
            let others = (0..nodes.len()).filter(|j| !kept.contains(j));
            (
                nodes[own],
                moments[(k, own)],
                others.map(|j| (nodes[j], moments[(k, j)])).collect(),
                gathered(row),
            )
        });
    Ok(FaceRows {
        rows: rows.collect(),
    })
}

/// The parts of a face that a cell of the mesh has just beyond it.
fn sections<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    face: &Face<D>,
    c: usize,
) -> Vec<Simplex<D>> {
    let (axis, edge) = (face.axis, patch.cells.spacing);
    let plane = patch.node(&face.nodes()[0])[axis];
    let at = plane + BEYOND * edge * if face.is_upper { 1.0 } else { -1.0 };
    let middle = patch.cells.centre(&face.cell)[axis];
    let mut parts = Vec::new();
    for simplex in simplices_of(mesh, c) {
        for section in simplex.section(axis, at) {
            // within its cells, so that the plane is none between two of them
            let flat = section.moved_to(axis, middle);
            patch.cells.dice(
                &flat,
                &|low, high| (0..D).all(|i| low[i] <= face.cell[i] && high[i] >= face.cell[i]),
                &mut |index, part| {
                    if index == face.cell {
                        parts.push(part.moved_to(axis, plane));
                    }
                },
            );
        }
    }
    parts
}

/// Shape functions of a face at a place within it, in edges from its first node.
fn shape_on_face<const D: usize>(s: &Vector<D>, axis: usize) -> Vec<f64> {
    let within: Vec<usize> = (0..D).filter(|&k| k != axis).collect();
    (0..1usize << within.len())
        .map(|bits| {
            let factors = within
                .iter()
                .enumerate()
                .map(|(k, &i)| match bits >> k & 1 {
                    1 => s[i],
                    _ => 1.0 - s[i],
                });
            factors.product()
        })
        .collect()
}

/// Dual functions of a face of unit size.
struct Dual<const D: usize> {
    /// `∫ φ_i φ_j`.
    mass: DMatrix<f64>,
}

impl<const D: usize> Dual<D> {
    fn new() -> Self {
        let count = 1usize << (D - 1);
        let along = |bits: usize| match bits {
            0 => 1.0 / 3.0,
            _ => 1.0 / 6.0,
        };
        let mass = DMatrix::from_fn(count, count, |i, j| {
            (0..D - 1).map(|k| along((i ^ j) >> k & 1)).product()
        });
        Self { mass }
    }

    /// The nodes that are kept, and the coefficients `A` of their functions `ψ = A φ`, one row for each.
    fn functions(&self, keep: Vec<bool>) -> (Vec<usize>, DMatrix<f64>) {
        let count = keep.len();
        let kept: Vec<usize> = (0..count).filter(|&i| keep[i]).collect();
        let n = kept.len();
        // conditions on the entries of A, row by row: biorthogonal to those kept, and a sum of one
        let mut conditions = DMatrix::zeros(n * n + count, n * count);
        let mut wanted = DVector::zeros(n * n + count);
        for p in 0..n {
            for q in 0..n {
                for j in 0..count {
                    conditions[(p * n + q, p * count + j)] = self.mass[(j, kept[q])];
                }
                wanted[p * n + q] = if p == q { 1.0 / count as f64 } else { 0.0 };
            }
        }
        for j in 0..count {
            for p in 0..n {
                conditions[(n * n + j, p * count + j)] = 1.0;
            }
            wanted[n * n + j] = 1.0;
        }
        let solved = conditions.svd(true, true).solve(&wanted, 1e-12);
        let entries = solved.unwrap_or_else(|_| DVector::zeros(n * count));
        (
            kept,
            DMatrix::from_fn(n, count, |p, j| entries[p * count + j]),
        )
    }
}
