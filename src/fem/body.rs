//! A whole finite-element body: checks, stiffness, internal force, lumped volumes and masses.

use rayon::prelude::*;

use super::cell::Rule;
use super::element::{
    QuadraturePoint, displacement_gradient, for_each_point, jacobian, quadrature, reference,
    relative_nodes, row_at,
};
use crate::material::LocalLaw;
use crate::mesh::{CellShape, Mesh};
use crate::system::BlockCsr;
use crate::tensor::{Tensor, Tensor4, Vector, determinant};

/// Rows per task. Fixed, so that the result has the same bits for any number of threads; cells that reach into
/// several tasks' rows are evaluated in each, which at 256 rows costs a 3D hexahedral mesh about three evaluations
/// of its quadrature points, and of each block row always one.
const ROWS_PER_TASK: usize = 256;

/// A mesh on which no element can live.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FemError {
    /// A cell of a shape that has no element in this dimension.
    #[error(
        "cell {cell} is a {shape:?}, but a {dimension}D body is made of {expected}; leave other cells out of the mesh"
    )]
    WrongShape {
        /// Cell number.
        cell: usize,
        /// Its shape.
        shape: CellShape,
        /// Dimension of the body.
        dimension: usize,
        /// Shapes that would do.
        expected: String,
    },
    /// A cell that is turned inside out, flat, or folded at one of its quadrature points.
    #[error(
        "cell {cell} ({shape:?}) near {position:?} has a Jacobian of {ratio:.2e} relative to its size, but it must be above 1e-10; if it is negative everywhere, reverse the order of its nodes {nodes:?}, else move them apart"
    )]
    Degenerate {
        /// Cell number.
        cell: usize,
        /// Its shape.
        shape: CellShape,
        /// Mean of its nodes' positions.
        position: Vec<f64>,
        /// `det J` over the D-th power of half the largest distance to its first node.
        ratio: f64,
        /// Its nodes.
        nodes: Vec<u32>,
    },
}

/// Checks that elements can live on every cell of the mesh for which `selected` holds.
///
/// # Errors
/// `FemError::WrongShape` for a cell of another dimension, `FemError::Degenerate` unless `det J` is positive at every
/// quadrature point.
pub fn check<const D: usize>(
    mesh: &Mesh<D>,
    selected: impl Fn(usize) -> bool,
) -> Result<(), FemError> {
    for c in (0..mesh.cell_count()).filter(|&c| selected(c)) {
        let shape = mesh.shapes[c];
        let Some(cell) = reference(mesh, c) else {
            let expected: Vec<String> = super::CELLS
                .iter()
                .filter(|cell| cell.shape.dimension() == D)
                .map(|cell| format!("{:?}", cell.shape))
                .collect();
            return Err(FemError::WrongShape {
                cell: c,
                shape,
                dimension: D,
                expected: expected.join(" and "),
            });
        };
        let (_, x) = relative_nodes(mesh, c);
        let size = 0.5 * x.iter().map(|x| x.norm()).fold(0.0, f64::max);
        for (xi, _) in cell.stiffness {
            let ratio = determinant(&jacobian(&x, &(cell.gradients)(xi))) / size.powi(D as i32);
            // the negation also refuses a ratio that is not a number
            if !(ratio > 1e-10) {
                return Err(FemError::Degenerate {
                    cell: c,
                    shape,
                    position: mesh.centroid(c).iter().copied().collect(),
                    ratio,
                    nodes: mesh.cell(c).to_vec(),
                });
            }
        }
    }
    Ok(())
}

/// The stiffness of a body: one block row per node of the mesh, `K u = f_external`.
///
/// `tangent` gives each cell's stiffness tensor [Pa], or `None` for a cell that is no part of the body. Rows of nodes
/// without cells are empty. Rows are built in parallel, each in the order of its cells: the same bits for any
/// number of threads.
///
/// # Errors
/// Those of [`check`].
pub fn assemble<'a, const D: usize>(
    mesh: &Mesh<D>,
    tangent: impl Fn(usize) -> Option<&'a Tensor4<D>> + Sync,
) -> Result<BlockCsr, FemError> {
    check(mesh, |c| tangent(c).is_some())?;
    let count = mesh.nodes.len();
    let (offsets, cells) = mesh.node_cells();
    let cells_of = |n: usize| &cells[offsets[n] as usize..offsets[n + 1] as usize];
    let columns: Vec<Vec<u32>> = (0..count)
        .into_par_iter()
        .map(|n| {
            let mut columns: Vec<u32> = cells_of(n)
                .iter()
                .filter(|&&c| tangent(c as usize).is_some())
                .flat_map(|&c| mesh.cell(c as usize).iter().copied())
                .collect();
            columns.sort_unstable();
            columns.dedup();
            columns
        })
        .collect();
    let mut row_offsets = vec![0usize; count + 1];
    for n in 0..count {
        row_offsets[n + 1] = row_offsets[n] + columns[n].len();
    }
    let columns: Vec<u32> = columns.into_iter().flatten().collect();

    let mut values = vec![0.0; columns.len() * D * D];
    let mut tasks: Vec<(usize, &mut [f64])> = Vec::new();
    let mut rest = values.as_mut_slice();
    for first in (0..count).step_by(ROWS_PER_TASK) {
        let last = (first + ROWS_PER_TASK).min(count);
        let (task, after) = rest.split_at_mut((row_offsets[last] - row_offsets[first]) * D * D);
        tasks.push((first, task));
        rest = after;
    }
    tasks.into_par_iter().for_each(|(first, values)| {
        let last = (first + ROWS_PER_TASK).min(count);
        let mut near: Vec<u32> = (first..last)
            .flat_map(|n| cells_of(n).iter().copied())
            .collect();
        near.sort_unstable();
        near.dedup();
        let mut points: Vec<QuadraturePoint<D>> = Vec::new();
        for c in near {
            let c = c as usize;
            let Some(tangent) = tangent(c) else {
                continue;
            };
            quadrature(mesh, c, &mut points);
            for (a, &n) in mesh.cell(c).iter().enumerate() {
                let n = n as usize;
                if !(first..last).contains(&n) {
                    continue;
                }
                let mut blocks = [Tensor::<D>::zeros(); 8];
                for p in &points {
                    row_at(p, tangent, a, &mut blocks);
                }
                let row = &columns[row_offsets[n]..row_offsets[n + 1]];
                let start = (row_offsets[n] - row_offsets[first]) * D * D;
                for (block, m) in blocks.iter().zip(mesh.cell(c)) {
                    let Ok(e) = row.binary_search(m) else {
                        continue;
                    };
                    let entry = &mut values[start + e * D * D..][..D * D];
                    for i in 0..D {
                        for k in 0..D {
                            entry[i * D + k] += block[(i, k)];
                        }
                    }
                }
            }
        }
    });
    Ok(BlockCsr {
        block: D,
        row_offsets,
        columns,
        values,
    })
}

/// The internal force `f_a = −Σ ∫ σ(G) ∂N_a/∂x dV` [N] of every node, without a matrix and for any law.
///
/// Shapes: `displacement` has one entry per node [m]; `law` gives each cell's law, or `None` for a cell that is no part
/// of the body. Precondition: the mesh has passed [`check`].
pub fn internal_force<'a, const D: usize>(
    mesh: &Mesh<D>,
    law: impl Fn(usize) -> Option<&'a dyn LocalLaw<D>>,
    displacement: &[Vector<D>],
) -> Vec<Vector<D>> {
    let mut force = vec![Vector::zeros(); mesh.nodes.len()];
    for c in 0..mesh.cell_count() {
        let Some(law) = law(c) else {
            continue;
        };
        let nodes = mesh.cell(c);
        for_each_point(mesh, c, Rule::Stiffness, |p| {
            let g = displacement_gradient(p, |a| displacement[nodes[a] as usize]);
            let stress = law.stress(&g) * p.weight;
            for (&n, gradient) in nodes.iter().zip(&p.gradient) {
                force[n as usize] -= stress * gradient;
            }
        });
    }
    force
}

/// Lumped volume of every node over the given cells, `V_a = Σ ∫ N_a dV` [m^D]: they add up to the cells' volume.
pub fn nodal_volumes<const D: usize>(
    mesh: &Mesh<D>,
    cells: impl Iterator<Item = usize>,
) -> Vec<f64> {
    let mut volumes = vec![0.0; mesh.nodes.len()];
    for c in cells {
        add_nodal(mesh, c, 1.0, &mut volumes);
    }
    volumes
}

/// Lumped mass of every node, `M_a = Σ ρ ∫ N_a dV` [kg]; `density` gives each cell's ρ [kg/m^D].
pub fn lumped_mass<const D: usize>(mesh: &Mesh<D>, density: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut mass = vec![0.0; mesh.nodes.len()];
    for c in 0..mesh.cell_count() {
        add_nodal(mesh, c, density(c), &mut mass);
    }
    mass
}

fn add_nodal<const D: usize>(mesh: &Mesh<D>, c: usize, scale: f64, totals: &mut [f64]) {
    for_each_point(mesh, c, Rule::Mass, |p| {
        for (&n, shape) in mesh.cell(c).iter().zip(&p.shape) {
            totals[n as usize] += scale * shape * p.weight;
        }
    });
}
