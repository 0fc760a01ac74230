//! Dense partial factorisation of one front, threaded over fixed tiles.
//!
//! A front of `p` pivots and `r` rows is held as `panel` (`(p + r) × p`), `upper` (`p × r`, LU only) and `schur`
//! (`r × r`), all column-major. Tiles do not depend on the number of threads and every tile is computed by one
//! thread, so that the factors have the same bits on any machine with the same instruction set. Progress is reported of
//! every tile of columns: a large front takes seconds, and a listener may end the computation there.

use crate::{parallel, progress::Progress};
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
    progress: &dyn Progress,
) -> Result<(), BadPivot> {
    let height = p + r;
    for k in (0..p).step_by(TILE) {
        progress.advance(0);
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
        parallel::for_each_chunk(tail, TILE * height, 1, |t, columns| {
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
        parallel::for_each_chunk(schur, TILE * r, 1, |t, columns| {
            progress.advance(0);
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

/// `L21 ← A21 U11⁻¹`, `upper ← L11⁻¹ P A12`, `schur ← schur − L21 U12`, with the factors of the pivot block.
fn eliminate(
    panel: &mut [f64],
    upper: &mut [f64],
    schur: &mut [f64],
    permutation: &[u32],
    p: usize,
    r: usize,
    progress: &dyn Progress,
) {
    let height = p + r;
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
            progress.advance(0);
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
    progress: &dyn Progress,
) {
    let height = p + r;
    for (k, q) in permutation.iter_mut().enumerate() {
        *q = k as u32;
    }
    for k in (0..p).step_by(TILE) {
        progress.advance(0);
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
        parallel::for_each_chunk(left, TILE * height, 1, |_, columns| {
            let mut scratch = Vec::with_capacity(size);
            columns
                .chunks_mut(height)
                .for_each(|column| exchange(column, &mut scratch));
        });
        let factor = view(current, height, width);
        parallel::for_each_chunk(right, TILE * height, 1, |_, columns| {
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
    eliminate(panel, upper, schur, permutation, p, r, progress);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use nalgebra::DMatrix;

    /// A full front of pseudo-random entries in ±0.5 and a constant on the diagonal.
    fn front(n: usize, diagonal: f64, symmetric: bool) -> DMatrix<f64> {
        let mut state = 12345u64;
        let mut a = DMatrix::from_fn(n, n, |_, _| {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 33) as f64 / (1u64 << 31) as f64 - 0.5
        });
        if symmetric {
            a.fill_lower_triangle_with_upper_triangle();
        }
        for k in 0..n {
            a[(k, k)] += diagonal;
        }
        a
    }

    fn parts(a: &DMatrix<f64>, p: usize) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let n = a.nrows();
        let copy = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
            columns
                .flat_map(|j| rows.clone().map(move |i| a[(i, j)]))
                .collect::<Vec<f64>>()
        };
        (copy(0..n, 0..p), copy(0..p, p..n), copy(p..n, p..n))
    }

    #[test]
    fn cholesky_gives_the_factor_and_the_schur_complement() {
        for (p, r) in [(5, 0), (7, 4), (300, 130), (520, 270)] {
            let a = front(p + r, (p + r) as f64, true);
            let (mut panel, _, mut schur) = parts(&a, p);
            cholesky(&mut panel, &mut schur, p, r, &Silent).expect("positive definite");
            let l = DMatrix::from_fn(
                p + r,
                p,
                |i, j| if i >= j { panel[j * (p + r) + i] } else { 0.0 },
            );
            let product = &l * l.transpose();
            for j in 0..p + r {
                for i in j..p + r {
                    let rest = if j >= p {
                        schur[(j - p) * r + i - p]
                    } else {
                        0.0
                    };
                    assert!(
                        (product[(i, j)] + rest - a[(i, j)]).abs() < 1e-9,
                        "({i}, {j}) of {p} + {r}"
                    );
                }
            }
        }
    }

    #[test]
    fn lu_exchanges_rows_of_the_pivot_block() {
        // without a heavy diagonal only row exchanges keep the factors small
        for (p, r) in [(5, 0), (7, 4), (300, 130), (520, 270)] {
            let a = front(p + r, 0.0, false);
            let (mut panel, mut upper, mut schur) = parts(&a, p);
            let mut permutation = vec![0; p];
            lu(
                &mut panel,
                &mut upper,
                &mut schur,
                &mut permutation,
                p,
                r,
                &Silent,
            );
            let l = DMatrix::from_fn(p + r, p, |i, j| match i.cmp(&j) {
                std::cmp::Ordering::Less => 0.0,
                std::cmp::Ordering::Equal => 1.0,
                std::cmp::Ordering::Greater => panel[j * (p + r) + i],
            });
            let u = DMatrix::from_fn(p, p + r, |i, j| {
                if j >= p {
                    upper[(j - p) * p + i]
                } else if i <= j {
                    panel[j * (p + r) + i]
                } else {
                    0.0
                }
            });
            assert!(
                l.rows(0, p).amax() <= 1.0,
                "partial pivoting bounds L11 by one"
            );
            let product = &l * &u;
            let scale = u.amax().max(1.0) * l.amax();
            for j in 0..p + r {
                for i in 0..p + r {
                    let from = if i < p { permutation[i] as usize } else { i };
                    let rest = if i >= p && j >= p {
                        schur[(j - p) * r + i - p]
                    } else {
                        0.0
                    };
                    let error = (product[(i, j)] + rest - a[(from, j)]).abs();
                    assert!(error < 1e-9 * scale, "({i}, {j}) of {p} + {r}: {error:e}");
                }
            }
        }
    }

    #[test]
    fn a_negative_pivot_is_refused_with_its_index() {
        let mut a = front(400, 400.0, true);
        a[(290, 290)] = -1e4;
        let (mut panel, _, mut schur) = parts(&a, 400);
        assert_eq!(
            cholesky(&mut panel, &mut schur, 400, 0, &Silent),
            Err(BadPivot(290))
        );
    }
}
