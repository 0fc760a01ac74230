//! Sparsity pattern of the tangent of elements, as blocks of a matrix by sites.

use crate::{
    assembly::Transfer,
    fem::NonlinearElements,
    model::{Model, SiteKind},
    system::BlockCsr,
    tensor::Tensor,
};

/// The blocks of the tangent of some elements: nodes take forces as sites, or hand them to those that they follow (see [`crate::mesh::Tie`]), and move with the sites that they follow.
#[derive(Clone, Debug)]
pub(super) struct TangentPattern {
    /// The sites in whose rows a node's force counts.
    rows_of_node: Transfer,
    row_offsets: Vec<usize>,
    columns: Vec<u32>,
}

impl TangentPattern {
    pub fn new<const D: usize>(model: &Model<D>, elements: &NonlinearElements<D>) -> Self {
        let mut takers = vec![Vec::new(); model.mesh.nodes.len()];
        for (site, place) in model.sites.iter().enumerate() {
            if let SiteKind::Node(n) = place.kind {
                takers[n as usize].push((site as u32, 1.0));
                for &(tied, weight) in model.ties.followers(n) {
                    takers[tied as usize].push((site as u32, weight));
                }
            }
        }
        let rows_of_node = Transfer::from_rows(model.sites.len(), takers);
        let mut rows = vec![Vec::new(); model.sites.len()];
        for cell in elements.cells() {
            let nodes = model.mesh.cell(cell);
            for (site, _) in nodes.iter().flat_map(|&n| rows_of_node.row(n as usize)) {
                let columns = nodes
                    .iter()
                    .flat_map(|&n| model.node_transfer.row(n as usize));
                rows[site as usize].extend(columns.map(|(column, _)| column));
            }
        }
        let mut pattern = Self {
            rows_of_node,
            row_offsets: vec![0],
            columns: Vec::new(),
        };
        for mut row in rows {
            row.sort_unstable();
            row.dedup();
            pattern.columns.append(&mut row);
            pattern.row_offsets.push(pattern.columns.len());
        }
        pattern
    }

    /// A matrix of zeros.
    pub fn zeros<const D: usize>(&self) -> BlockCsr {
        BlockCsr {
            block: D,
            row_offsets: self.row_offsets.clone(),
            values: vec![0.0; self.columns.len() * D * D],
            columns: self.columns.clone(),
            shared: None,
        }
    }

    /// Adds the blocks of a cell, by pairs of its nodes.
    pub fn add<const D: usize>(
        &self,
        model: &Model<D>,
        cell: usize,
        blocks: &[Tensor<D>],
        matrix: &mut BlockCsr,
    ) {
        let nodes = model.mesh.cell(cell);
        for (&n, row) in nodes.iter().zip(blocks.chunks_exact(nodes.len())) {
            for (site, share) in self.rows_of_node.row(n as usize) {
                let first = self.row_offsets[site as usize];
                let columns = &self.columns[first..self.row_offsets[site as usize + 1]];
                for (&m, block) in nodes.iter().zip(row) {
                    for (column, weight) in model.node_transfer.row(m as usize) {
                        // in the pattern by its construction
                        let Ok(place) = columns.binary_search(&column) else {
                            continue;
                        };
                        let to = &mut matrix.values[(first + place) * D * D..][..D * D];
                        for (a, to) in to.chunks_exact_mut(D).enumerate() {
                            for (b, to) in to.iter_mut().enumerate() {
                                *to += share * weight * block[(a, b)];
                            }
                        }
                    }
                }
            }
        }
    }
}
