//! Products of a block matrix with a vector.
//!
//! Along a run of rows that share their blocks (see [`super::SharedRows`]) a product is a stencil: for each block, a stretch of the argument is added to a
//! stretch of the result, which the compiler turns into vector instructions, chosen by `pulp` for the machine at hand. Sums are taken in the same order as row by row.

use std::cell::Cell;

use super::BlockCsr;
use crate::parallel;

/// Rows per task: some tasks may be left out.
pub const ROW_CHUNK: usize = 256;
const ROWS: usize = ROW_CHUNK;

/// Sites of a task that copies a number of each.
const SITES: usize = 4096;

/// Returns true if a task is to be done.
fn is_marked(marked: Option<&[bool]>, chunk: usize) -> bool {
    marked.is_none_or(|marked| marked[chunk])
}

/// Rows of a run that are summed at a time, in registers: 16 reach 30 Gflop/s in 2D (|ξ| ≤ 6) and 20 in 3D (|ξ| ≤ 3) on one core of an EPYC with AVX2, 8 reach 27 and 18, a
/// single row 3 (measured on the stencils alone).
const TILE: usize = 16;

/// `y_i = Σ_j K_ij (x_j − x_r)`, r a column in the middle of row i; the same bits for any number of threads.
///
/// Rows that mostly share their blocks are multiplied as by [`multiply_into`]: differences make their stencils two to three times slower (measured; rows with blocks of their own wait for these, and differences cost nothing).
pub(super) fn multiply_differences_into(
    k: &BlockCsr,
    marked: Option<&[bool]>,
    x: &[f64],
    y: &mut [f64],
) {
    match (k.block, runs(k)) {
        (1, None) => of_differences::<1>(k, marked, x, y),
        (2, None) => of_differences::<2>(k, marked, x, y),
        (3, None) => of_differences::<3>(k, marked, x, y),
        _ => multiply_into(k, marked, x, y),
    }
}

fn of_differences<const D: usize>(k: &BlockCsr, marked: Option<&[bool]>, x: &[f64], y: &mut [f64]) {
    parallel::for_each_chunk(y, ROWS * D, 1, |chunk, y| {
        if !is_marked(marked, chunk) {
            return;
        }
        for (i, y) in y.chunks_exact_mut(D).enumerate() {
            y.copy_from_slice(&of_row_differences::<D>(k, chunk * ROWS + i, x));
        }
    });
}

/// Row `i` times the differences of `x` from that of its middle column.
#[inline(always)]
fn of_row_differences<const D: usize>(k: &BlockCsr, i: usize, x: &[f64]) -> [f64; D] {
    let (columns, blocks) = k.row(i);
    let mut sum = [0.0; D];
    let Some(&middle) = columns.get(columns.len() / 2) else {
        return sum;
    };
    let reference: [f64; D] = std::array::from_fn(|b| x[middle as usize * D + b]);
    for (&c, block) in columns.iter().zip(blocks.chunks_exact(D * D)) {
        let xj = &x[c as usize * D..][..D];
        for b in 0..D {
            let difference = xj[b] - reference[b];
            for a in 0..D {
                sum[a] += block[a * D + b] * difference;
            }
        }
    }
    sum
}

/// Returns true for each row that follows the one before it; none if few do.
fn runs(k: &BlockCsr) -> Option<&[bool]> {
    let follows = k.shared.as_ref().map(|s| s.follows.as_slice());
    follows.filter(|f| 2 * f.iter().filter(|f| **f).count() > f.len())
}

/// `y = K x`; the same bits for any number of threads.
pub(super) fn multiply_into(k: &BlockCsr, marked: Option<&[bool]>, x: &[f64], y: &mut [f64]) {
    match k.block {
        1 => of_block::<1>(k, marked, x, y),
        2 => of_block::<2>(k, marked, x, y),
        3 => of_block::<3>(k, marked, x, y),
        6 => of_block::<6>(k, marked, x, y),
        d => parallel::for_each_chunk(y, d.max(1), 1, |i, yi| {
            yi.fill(0.0);
            let (columns, blocks) = k.row(i);
            for (&c, block) in columns.iter().zip(blocks.chunks_exact(d * d)) {
                let xj = &x[c as usize * d..][..d];
                for (y, row) in yi.iter_mut().zip(block.chunks_exact(d)) {
                    for (k, x) in row.iter().zip(xj) {
                        *y += k * x;
                    }
                }
            }
        }),
    }
}

/// The product with blocks of a size known to the compiler, which unrolls them.
fn of_block<const D: usize>(k: &BlockCsr, marked: Option<&[bool]>, x: &[f64], y: &mut [f64]) {
    let Some(follows) = runs(k) else {
        parallel::for_each_chunk(y, ROWS * D, 1, |chunk, y| {
            if !is_marked(marked, chunk) {
                return;
            }
            for (i, y) in y.chunks_exact_mut(D).enumerate() {
                y.copy_from_slice(&of_row::<D>(k, chunk * ROWS + i, x));
            }
        });
        return;
    };
    // component by component, so that neighbouring rows read neighbouring numbers
    let mut kept = PLANES.take();
    kept.resize_with(kept.len().max(D), Vec::new);
    for (b, plane) in kept[..D].iter_mut().enumerate() {
        plane.resize(x.len() / D, 0.0);
        parallel::for_each_chunk(plane, SITES, 1, |chunk, plane| {
            let x = x[chunk * SITES * D..].chunks_exact(D);
            plane.iter_mut().zip(x).for_each(|(p, x)| *p = x[b]);
        });
    }
    let planes: [&[f64]; D] = std::array::from_fn(|b| &kept[b][..]);
    let arch = pulp::Arch::new();
    parallel::for_each_chunk(y, ROWS * D, 1, |chunk, y| {
        if !is_marked(marked, chunk) {
            return;
        }
        arch.dispatch(
            #[inline(always)]
            || of_rows::<D>(k, follows, chunk * ROWS, x, &planes, y),
        );
    });
    PLANES.set(kept);
}

thread_local! {
    /// Memory for the components of an argument, which the thread that asks for a product takes and gives back: a step allocates nothing.
    static PLANES: Cell<Vec<Vec<f64>>> = const { Cell::new(Vec::new()) };
}

/// Rows from `first` on, as many as `y` holds: runs in tiles, the rest row by row.
#[inline(always)]
fn of_rows<const D: usize>(
    k: &BlockCsr,
    follows: &[bool],
    first: usize,
    x: &[f64],
    planes: &[&[f64]; D],
    y: &mut [f64],
) {
    let end = first + y.len() / D;
    let mut i = first;
    while i < end {
        let mut next = i + 1;
        while next < end && follows[next] {
            next += 1;
        }
        let (columns, blocks) = k.row(i);
        let mut shift = 0;
        while i + shift + TILE <= next {
            let y = &mut y[(i + shift - first) * D..][..TILE * D];
            of_tile::<D, TILE>(columns, blocks, shift, planes, y);
            shift += TILE;
        }
        if i + shift + TILE / 2 <= next {
            let y = &mut y[(i + shift - first) * D..][..TILE / 2 * D];
            of_tile::<D, { TILE / 2 }>(columns, blocks, shift, planes, y);
            shift += TILE / 2;
        }
        for row in i + shift..next {
            y[(row - first) * D..][..D].copy_from_slice(&of_row::<D>(k, row, x));
        }
        i = next;
    }
}

/// `T` rows of a run, `shift` rows after the one whose columns are given.
#[inline(always)]
fn of_tile<const D: usize, const T: usize>(
    columns: &[u32],
    blocks: &[f64],
    shift: usize,
    planes: &[&[f64]; D],
    y: &mut [f64],
) {
    let mut sum = [[0.0; T]; D];
    for (&c, block) in columns.iter().zip(blocks.chunks_exact(D * D)) {
        let from = c as usize + shift;
        for b in 0..D {
            let x = &planes[b][from..from + T];
            for a in 0..D {
                let f = block[a * D + b];
                for t in 0..T {
                    sum[a][t] += f * x[t];
                }
            }
        }
    }
    for t in 0..T {
        for a in 0..D {
            y[t * D + a] = sum[a][t];
        }
    }
}

#[inline(always)]
fn of_row<const D: usize>(k: &BlockCsr, i: usize, x: &[f64]) -> [f64; D] {
    let (columns, blocks) = k.row(i);
    let mut sum = [0.0; D];
    for (&c, block) in columns.iter().zip(blocks.chunks_exact(D * D)) {
        let xj = &x[c as usize * D..][..D];
        for b in 0..D {
            for a in 0..D {
                sum[a] += block[a * D + b] * xj[b];
            }
        }
    }
    sum
}
