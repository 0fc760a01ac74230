//! Solvers of `K u = f`: elimination orders, a multifrontal direct solver, Krylov methods with multigrid, and the
//! static problem that chooses among them.

pub mod direct;
mod front;
mod multifrontal;
pub mod ordering;
mod singular;
pub mod statics;
pub mod stencils;
pub mod symbolic;

/// Which dofs are unknown; the others are prescribed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FreeDofs {
    block: usize,
    bits: Vec<u8>,
}

impl FreeDofs {
    /// Every dof of `sites` sites with `block` dofs each is unknown.
    pub fn all(sites: usize, block: usize) -> FreeDofs {
        FreeDofs {
            block,
            bits: vec![((1u16 << block) - 1) as u8; sites],
        }
    }

    /// The dofs without a prescribed value. Shape: `prescribed` has `sites × block` entries.
    pub fn from_prescribed(prescribed: &[Option<f64>], block: usize) -> FreeDofs {
        let bits = prescribed
            .chunks(block)
            .map(|values| {
                values
                    .iter()
                    .enumerate()
                    .filter(|(_, v)| v.is_none())
                    .map(|(a, _)| 1 << a)
                    .sum()
            })
            .collect();
        FreeDofs { block, bits }
    }

    /// Whether dof `a` of site `i` is unknown.
    pub fn is_free(&self, i: usize, a: usize) -> bool {
        self.bits[i] >> a & 1 == 1
    }

    /// Number of unknown dofs of site `i`.
    pub fn count_of_site(&self, i: usize) -> usize {
        self.bits[i].count_ones() as usize
    }

    /// Number of unknown dofs.
    pub fn count(&self) -> usize {
        self.bits.iter().map(|b| b.count_ones() as usize).sum()
    }

    /// The unknown dofs of site `i`, ascending.
    pub fn of_site(&self, i: usize) -> impl Iterator<Item = usize> + '_ {
        let bits = self.bits[i];
        (0..self.block).filter(move |a| bits >> a & 1 == 1)
    }

    /// Dofs per site.
    pub fn block(&self) -> usize {
        self.block
    }

    /// Number of sites.
    pub fn sites(&self) -> usize {
        self.bits.len()
    }
}
