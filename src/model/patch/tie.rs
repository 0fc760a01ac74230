//! Displacement of the nodes on the faces Γ of a rim, by a dual mortar.
//!
//! `Σ_j D_ij u_j = Σ_a M_ia u_a` with `D_ij = ∫_Γ ψ_i φ_j` and `M_ia = ∫_Γ ψ_i N_a`: φ the shape functions of the rim on Γ, N those of the mesh beyond it, ψ_i the dual function of node i on the
//! plane part of Γ that the node belongs to. On each face ψ = A φ for the nodes that belong to its part, `∫ ψ_i φ_j = δ_ij ∫ φ_j` among them and `Σ ψ_i = 1`, of the least norm. Nodes of a face that belong to
//! another part, and those that follow the rim where the surface of the body leaves too little of its elements, stay in the equation. Where that surface cuts the face, integrals are over what has elements beyond it.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, DVector};

use super::{
    cells::{Face, Index, PatchCells},
    cuts::Cuts,
    rows::{Place, Row, gathered},
};
use crate::{
    fem,
    mesh::Mesh,
    model::simplex::{Simplex, simplices_of},
    parallel,
    tensor::Vector,
};

/// Distance beyond Γ at which the mesh is cut by a plane, in edges of a cell: facets of the mesh in Γ itself then belong to the cells beyond.
const BEYOND: f64 = 1e-11;

/// Part of a face below which it has no element beyond it, and above which less one it has everywhere, by rounding.
const COVERED: f64 = 1e-6;

/// A face with the mesh beyond it.
struct TiedFace<const D: usize> {
    face: Face<D>,
    /// Parts of the face, each with its cell of the mesh.
    parts: Vec<(u32, Simplex<D>)>,
    /// True if elements lie beyond all of it.
    is_whole: bool,
}

/// The equation of a node of Γ on a face.
struct FaceRow<const D: usize> {
    node: Index<D>,
    /// `∫ ψ_i φ_i`.
    diagonal: f64,
    /// `∫ ψ_i N_a`, and `∫ ψ_i φ_j` with the opposite sign.
    terms: Row<D>,
}

/// The nodes of Γ that follow the mesh by the mortar.
pub(super) struct Tied<const D: usize> {
    pub rows: BTreeMap<Index<D>, Row<D>>,
    /// The cells of the mesh beyond the faces around each.
    pub beyond: BTreeMap<Index<D>, BTreeSet<u32>>,
}

/// Ties the nodes of Γ to the mesh.
pub(super) fn rows<const D: usize>(mesh: &Mesh<D>, patch: &PatchCells<D>, cuts: &Cuts) -> Tied<D> {
    let all = patch.faces();
    let tied = parallel::map(all.len(), 4, |f| tied_face(mesh, patch, cuts, &all[f]));
    let tied: Vec<TiedFace<D>> = tied.into_iter().flatten().collect();
    let faces: Vec<Face<D>> = tied.iter().map(|tied| tied.face).collect();
    let axes = patch.axes(&faces);
    let mass = mass_of_face::<D>();
    let found = parallel::map(tied.len(), 4, |f| {
        face_rows(mesh, patch, &tied[f], &axes, &mass)
    });
    let mut sums: BTreeMap<Index<D>, (f64, Row<D>)> = BTreeMap::new();
    for own in found.into_iter().flatten() {
        let sum = sums.entry(own.node).or_default();
        sum.0 += own.diagonal;
        sum.1.extend(own.terms);
    }
    let mut beyond: BTreeMap<Index<D>, BTreeSet<u32>> = BTreeMap::new();
    for TiedFace { face, parts, .. } in &tied {
        let nodes = face.nodes().into_iter();
        for node in nodes.filter(|node| sums.contains_key(node)) {
            let own = beyond.entry(node).or_default();
            own.extend(parts.iter().map(|part| part.0));
        }
    }
    let rows = sums.into_iter().map(|(node, (diagonal, row))| {
        let row = gathered(row).into_iter();
        (node, row.map(|(n, w)| (n, w / diagonal)).collect())
    });
    Tied {
        rows: rows.collect(),
        beyond,
    }
}

/// A face with the parts of the mesh beyond it; none where there are none.
fn tied_face<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    cuts: &Cuts,
    face: &Face<D>,
) -> Option<TiedFace<D>> {
    let size = patch.cells.spacing.powi(D as i32 - 1);
    let beyond = patch.held[&face.neighbour()].iter();
    let parts: Vec<(u32, Simplex<D>)> = beyond
        .filter(|(c, _)| !cuts.is_covered(*c))
        .flat_map(|&(c, _)| {
            let parts = sections(mesh, patch, face, c as usize).into_iter();
            parts.map(move |part| (c, part))
        })
        .collect();
    let covered = parts.iter().map(|part| part.1.size()).sum::<f64>() / size;
    (covered > COVERED).then_some(TiedFace {
        face: *face,
        parts,
        is_whole: covered > 1.0 - COVERED,
    })
}

fn face_rows<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    TiedFace {
        face,
        parts,
        is_whole,
    }: &TiedFace<D>,
    axes: &BTreeMap<Index<D>, usize>,
    mass_of_whole: &DMatrix<f64>,
) -> Vec<FaceRow<D>> {
    let nodes = face.nodes();
    let kept: Vec<usize> = patch.kept(face, axes).collect();
    let edge = patch.cells.spacing;
    let corner = patch.node(&nodes[0]);
    let phi = |x: &Vector<D>| shape_on_face(&((x - corner) / edge), face.axis);
    let mut mass = mass_of_whole * edge.powi(D as i32 - 1);
    if !is_whole {
        mass.fill(0.0);
        for (_, part) in parts {
            part.quadrature(|x, w| {
                let phi = DVector::from_vec(phi(&x));
                mass.ger(w, &phi, &phi, 1.0);
            });
        }
    }
    let psi = dual_functions(&kept, &mass);
    let mut rows: Vec<Row<D>> = vec![Vec::new(); kept.len()];
    for (c, part) in parts {
        let c = *c as usize;
        part.quadrature(|x, w| {
            let Some(xi) = fem::reference_of(mesh, c, &x) else {
                return;
            };
            let (shape, _) = fem::shape_values(mesh, c, &xi);
            let phi = phi(&x);
            for (row, psi) in rows.iter_mut().zip(psi.row_iter()) {
                let value: f64 = psi.iter().zip(&phi).map(|(a, phi)| a * phi).sum();
                let cell = mesh.cell(c).iter().zip(&shape);
                row.extend(cell.map(|(&n, shape)| (Place::Mesh(n), value * w * shape)));
            }
        });
    }
    let moments = &psi * &mass;
    let rows = kept.iter().zip(rows).enumerate();
    rows.map(|(k, (&own, mut row))| {
        let others = (0..nodes.len()).filter(|&j| j != own);
        row.extend(others.map(|j| (Place::Patch(nodes[j]), -moments[(k, j)])));
        FaceRow {
            node: nodes[own],
            diagonal: moments[(k, own)],
            terms: gathered(row),
        }
    })
    .collect()
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

/// `∫ φ_i φ_j` of a face of unit size.
fn mass_of_face<const D: usize>() -> DMatrix<f64> {
    let count = 1usize << (D - 1);
    let along = |bits: usize| match bits {
        0 => 1.0 / 3.0,
        _ => 1.0 / 6.0,
    };
    DMatrix::from_fn(count, count, |i, j| {
        (0..D - 1).map(|k| along((i ^ j) >> k & 1)).product()
    })
}

/// Coefficients `A` of the functions `ψ = A φ` of the nodes that are kept, one row for each: biorthogonal to the shape functions of those, with the sum one, of the least norm.
fn dual_functions(kept: &[usize], mass: &DMatrix<f64>) -> DMatrix<f64> {
    let (n, count) = (kept.len(), mass.nrows());
    let size = mass.sum();
    let mut conditions = DMatrix::zeros(n * n + count, n * count);
    let mut wanted = DVector::zeros(n * n + count);
    for p in 0..n {
        for q in 0..n {
            for j in 0..count {
                conditions[(p * n + q, p * count + j)] = mass[(j, kept[q])] / size;
            }
            if p == q {
                wanted[p * n + q] = mass.column(kept[q]).sum() / size;
            }
        }
    }
    for j in 0..count {
        for p in 0..n {
            conditions[(n * n + j, p * count + j)] = 1.0;
        }
        wanted[n * n + j] = 1.0;
    }
    let solved = conditions.svd(true, true).solve(&wanted, 1e-13);
    let entries = solved.unwrap_or_else(|_| DVector::zeros(n * count));
    let mut functions = DMatrix::from_fn(n, count, |p, j| entries[p * count + j]);
    // of a face of which little is covered the solution has few digits: the sum carries the patch test, the rest may be off
    for mut column in functions.column_iter_mut() {
        let missing = (1.0 - column.sum()) / n as f64;
        column.add_scalar_mut(missing);
    }
    functions
}
