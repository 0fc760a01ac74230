//! Dense partial factorisation of one front, threaded over fixed tiles.
//!
//! A front of `p` pivots and `r` rows is held as `panel` (`(p + r) × p`), `upper` (`p × r`, LU only) and `schur`
//! (`r × r`), all column-major. Tiles do not depend on the number of threads and every tile is computed by one
//! thread, so that the factors have the same bits on any machine with the same instruction set.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor as llt;
use faer::linalg::lu::partial_pivoting::factor as lu;
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{BlockStructure, matmul as triangular_matmul};
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_unit_lower_triangular_in_place,
};
use faer::prelude::IntoConst;
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;

/// Columns or rows of a tile.
const TILE: usize = 256;

/// The pivot block could not be factorised: the index of the pivot within the front, at or before which it broke.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BadPivot(pub usize);

fn view(data: &[f64], rows: usize, columns: usize) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(data, rows, columns)
}

fn view_mut(data: &mut [f64], rows: usize, columns: usize) -> MatMut<'_, f64> {
    MatMut::from_column_major_slice_mut(data, rows, columns)
}

/// `panel ← [L11; L21]`, `schur ← schur − L21 L21ᵀ` (lower triangle). The strict upper triangle of `L11` is
/// undefined afterwards.
pub(crate) fn cholesky(
    panel: &mut [f64],
    schur: &mut [f64],
    p: usize,
    r: usize,
) -> Result<(), BadPivot> {
    let height = p + r;
    for k in (0..p).step_by(TILE) {
        let width = TILE.min(p - k);
        let (head, tail) = panel.split_at_mut((k + width) * height);
        let column = view_mut(&mut head[k * height..], height, width);
        let (_, below) = column.split_at_row_mut(k);
        let (mut diagonal, mut below) = below.split_at_row_mut(width);
        let mut memory = MemBuffer::new(llt::cholesky_in_place_scratch::<f64>(
            width,
            Par::Seq,
            Default::default(),
        ));
        llt::cholesky_in_place(
            diagonal.as_mut(),
            Default::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        )
        .map_err(|llt::LltError::NonPositivePivot { index }| BadPivot(k + index))?;
        let diagonal = diagonal.as_ref();
        if below.nrows() > 0 {
            below.as_mut().par_row_chunks_mut(TILE).for_each(|rows| {
                solve_lower_triangular_in_place(diagonal, rows.transpose_mut(), Par::Seq);
            });
        }
        let head = &head[k * height..];
        tail.par_chunks_mut(TILE * height)
            .enumerate()
            .for_each(|(t, columns)| {
                let start = k + width + t * TILE;
                let count = columns.len() / height;
                let factor = view(head, height, width);
                let target = view_mut(columns, height, count);
                subtract_lower(
                    target.split_at_row_mut(start).1,
                    factor.split_at_row(start).1,
                );
            });
    }
    if r > 0 && p > 0 {
        let factor = view(panel, height, p).split_at_row(p).1;
        schur
            .par_chunks_mut(TILE * r)
            .enumerate()
            .for_each(|(t, columns)| {
                let start = t * TILE;
                let count = columns.len() / r;
                let target = view_mut(columns, r, count);
                subtract_lower(
                    target.split_at_row_mut(start).1,
                    factor.split_at_row(start).1,
                );
            });
    }
    Ok(())
}

/// `target ← target − factor factor_topᵀ` on and below the diagonal, where `factor_top` is the rows of `factor`
/// beside the square top of `target`.
fn subtract_lower(target: MatMut<'_, f64>, factor: MatRef<'_, f64>) {
    let width = target.ncols();
    let (top, below) = target.split_at_row_mut(width);
    let (factor_top, factor_below) = factor.split_at_row(width);
    triangular_matmul(
        top,
        BlockStructure::TriangularLower,
        Accum::Add,
        factor_top,
        BlockStructure::Rectangular,
        factor_top.transpose(),
        BlockStructure::Rectangular,
        -1.0,
        Par::Seq,
    );
    if below.nrows() > 0 {
        matmul(
            below,
            Accum::Add,
            factor_below,
            factor_top.transpose(),
            -1.0,
            Par::Seq,
        );
    }
}

/// `P [A11 A12] = L11 [U11 U12]`, `panel ← [L11\U11; L21]`, `upper ← U12`, `schur ← schur − L21 U12`.
///
/// Rows are exchanged within the pivot block only (by size, that is partial pivoting); `permutation[k]` is the row
/// of the pivot block that became row `k`. A zero pivot leaves non-finite numbers behind; the caller checks the
/// diagonal.
pub(crate) fn lu(
    panel: &mut [f64],
    upper: &mut [f64],
    schur: &mut [f64],
    permutation: &mut [u32],
    p: usize,
    r: usize,
) {
    let height = p + r;
    for (k, q) in permutation.iter_mut().enumerate() {
        *q = k as u32;
    }
    for k in (0..p).step_by(TILE) {
        let width = TILE.min(p - k);
        let size = p - k;
        let (left, rest) = panel.split_at_mut(k * height);
        let (current, right) = rest.split_at_mut(width * height);
        let mut forward = vec![0u32; size];
        let mut inverse = vec![0u32; size];
        let mut memory = MemBuffer::new(lu::lu_in_place_scratch::<u32, f64>(
            size,
            width,
            Par::Seq,
            Default::default(),
        ));
        lu::lu_in_place(
            view_mut(current, height, width).subrows_mut(k, size),
            &mut forward,
            &mut inverse,
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        );
        let exchange = |column: &mut [f64], scratch: &mut Vec<f64>| {
            scratch.clear();
            scratch.extend_from_slice(&column[k..p]);
            for (i, &from) in forward.iter().enumerate() {
                column[k + i] = scratch[from as usize];
            }
        };
        let moved = permutation[k..].to_vec();
        for (i, &from) in forward.iter().enumerate() {
            permutation[k + i] = moved[from as usize];
        }
        left.par_chunks_mut(TILE * height).for_each(|columns| {
            let mut scratch = Vec::with_capacity(size);
            columns
                .chunks_mut(height)
                .for_each(|column| exchange(column, &mut scratch));
        });
        let factor = view(current, height, width);
        right.par_chunks_mut(TILE * height).for_each(|columns| {
            let mut scratch = Vec::with_capacity(size);
            columns
                .chunks_mut(height)
                .for_each(|column| exchange(column, &mut scratch));
            let count = columns.len() / height;
            let (_, target) = view_mut(columns, height, count).split_at_row_mut(k);
            let (mut top, target) = target.split_at_row_mut(width);
            solve_unit_lower_triangular_in_place(factor.subrows(k, width), top.as_mut(), Par::Seq);
            let target = target.split_at_row_mut(size - width).0;
            if target.nrows() > 0 {
                matmul(
                    target,
                    Accum::Add,
                    factor.subrows(k + width, size - width),
                    top.as_ref(),
                    -1.0,
                    Par::Seq,
                );
            }
        });
    }
    if r == 0 || p == 0 {
        return;
    }
    let (diagonal, mut below) = view_mut(panel, height, p).split_at_row_mut(p);
    let diagonal = diagonal.into_const();
    below.as_mut().par_row_chunks_mut(TILE).for_each(|rows| {
        // L21 U11 = A21, transposed
        solve_lower_triangular_in_place(diagonal.transpose(), rows.transpose_mut(), Par::Seq);
    });
    let below = below.into_const();
    upper
        .par_chunks_mut(TILE * p)
        .zip(schur.par_chunks_mut(TILE * r))
        .for_each(|(columns, target)| {
            let mut scratch = Vec::with_capacity(p);
            columns.chunks_mut(p).for_each(|column| {
                scratch.clear();
                scratch.extend_from_slice(column);
                for (i, &from) in permutation.iter().enumerate() {
                    column[i] = scratch[from as usize];
                }
            });
            let count = columns.len() / p;
            let mut columns = view_mut(columns, p, count);
            solve_unit_lower_triangular_in_place(diagonal, columns.as_mut(), Par::Seq);
            matmul(
                view_mut(target, r, count),
                Accum::Add,
                below,
                columns.as_ref(),
                -1.0,
                Par::Seq,
            );
        });
}
