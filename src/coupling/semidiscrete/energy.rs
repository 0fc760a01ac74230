//! Energy of the finite elements of a moving model, by existing rows where these are those of elements alone.

use super::rows::{SiteRows, row_product};
use crate::coupling::semidiscrete::behaviour::CHUNK;
use crate::{
    assembly::{self, Transfer},
    model::{CellRole, Model, SiteKind},
    parallel,
    system::BlockCsr,
    tensor::Vector,
};

/// Energy of the cells that are finite elements, without those that only overlap: `½ Σ_a u_a · F_a`, the sum over their nodes of the forces that these cells alone exert.
///
/// A node within the finite elements has that force in its own row. One at the seam, whose row knows of overlapping cells or of partial stress, needs a row of its own.
pub(super) struct ElementEnergy {
    /// Sites whose row is that of all cells around a node.
    inner: Vec<u32>,
    /// Nodes with other rows, and these.
    seam: Vec<u32>,
    rows: BlockCsr,
}

impl ElementEnergy {
    pub fn new<const D: usize>(model: &Model<D>) -> Self {
        let nodes = model.mesh.nodes.len();
        let (mut touched, mut whole) = (vec![false; nodes], vec![true; nodes]);
        for c in 0..model.mesh.cell_count() {
            for &n in model.mesh.cell(c) {
                touched[n as usize] |= model.is_element(c);
                whole[n as usize] &= model.roles[c] == CellRole::Element;
            }
        }
        let inner = (0..model.sites.len() as u32)
            .filter(
                |&s| matches!(model.sites[s as usize].kind, SiteKind::Node(n) if whole[n as usize]),
            )
            .collect();
        let seam: Vec<u32> = (0..nodes as u32)
            .filter(|&n| touched[n as usize] && !whole[n as usize])
            .collect();
        let rows = assembly::assemble_rows(
            seam.len(),
            model.sites.len(),
            |_| (),
            |r, row| model.add_own_element_rows(seam[r], row),
        );
        Self { inner, seam, rows }
    }

    /// Returns true if the row of a site is that of finite elements alone.
    pub fn is_inner(&self, site: u32) -> bool {
        self.inner.binary_search(&site).is_ok()
    }

    pub fn of<const D: usize>(&self, linear: &SiteRows, nodes: &Transfer, u: &[f64]) -> f64 {
        let inner: f64 = parallel::map_chunks(&self.inner, CHUNK, |_, sites| {
            sites
                .iter()
                .map(|&site| {
                    let force: Vector<D> = linear.product(site as usize, u);
                    (0..D)
                        .map(|k| force[k] * u[site as usize * D + k])
                        .sum::<f64>()
                })
                .sum::<f64>()
        })
        .iter()
        .sum();
        let seam: f64 = self
            .seam
            .iter()
            .enumerate()
            .map(|(r, &n)| {
                let here: Vector<D> = nodes.displacement(n as usize, u);
                here.dot(&row_product::<D>(&self.rows, r, u))
            })
            .sum();
        0.5 * (inner + seam)
    }
}
