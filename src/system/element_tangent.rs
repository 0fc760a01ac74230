//! Part of the tangent that finite elements whose law is not linear add to the tangent at rest.

use super::{BlockCsr, Symmetry};

/// The part of the tangent at a displacement that finite elements have in closed form, as what it has beyond that at rest.
#[derive(Clone, Debug)]
pub struct ElementTangent {
    /// A row for each site; none of them shares its blocks.
    pub excess: BlockCsr,
    /// Its symmetry.
    pub symmetry: Symmetry,
    /// True if all else is linear, so that the tangent at rest and this are the whole tangent.
    pub is_whole: bool,
}

impl ElementTangent {
    /// The sum of the excess and of the tangent at rest, for a factorisation: the pattern is that of both, zero blocks included.
    pub fn added_to(&self, at_rest: &BlockCsr) -> BlockCsr {
        let size = at_rest.block * at_rest.block;
        let mut sum = BlockCsr {
            block: at_rest.block,
            row_offsets: Vec::with_capacity(at_rest.row_offsets.len()),
            ..BlockCsr::default()
        };
        sum.row_offsets.push(0);
        for i in 0..at_rest.rows() {
            sum.merge_row(at_rest.row(i), self.excess.row(i), size);
            sum.row_offsets.push(sum.columns.len());
        }
        sum
    }
}

impl BlockCsr {
    /// Appends the sum of two rows of blocks of so many numbers, columns ascending in each; their end is the caller's to note.
    pub(super) fn merge_row(&mut self, a: (&[u32], &[f64]), b: (&[u32], &[f64]), size: usize) {
        let (mut i, mut j) = (0, 0);
        while i < a.0.len() || j < b.0.len() {
            let column = match (a.0.get(i), b.0.get(j)) {
                (Some(&p), Some(&q)) => p.min(q),
                (Some(&p), None) => p,
                (None, Some(&q)) => q,
                (None, None) => return,
            };
            let first = self.values.len();
            self.columns.push(column);
            self.values.resize(first + size, 0.0);
            for ((columns, blocks), place) in [(a, &mut i), (b, &mut j)] {
                if columns.get(*place) == Some(&column) {
                    let own = &blocks[*place * size..][..size];
                    let to = self.values[first..].iter_mut();
                    to.zip(own).for_each(|(to, own)| *to += own);
                    *place += 1;
                }
            }
        }
    }
}
