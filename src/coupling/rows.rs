//! Rows of a model: those of its elements, and all of them assembled.

use crate::{
    assembly::{self, Centre, Row},
    coupling::Operator,
    fem,
    model::{CellRole, Model},
    progress::Progress,
    system::BlockCsr,
    tensor::Tensor,
};

impl<const D: usize> Model<D> {
    /// Adds the finite-element row of a node: all cells around it but those whose stress is a partial stress.
    pub fn add_element_rows(&self, site: usize, row: &mut Row<D>) {
        self.add_rows_of_elements(site, |c| self.node_takes(c), row);
    }

    /// Adds the finite-element row of a node, of the elements around it that overlap with no points.
    pub fn add_rows_of_own_elements(&self, site: usize, row: &mut Row<D>) {
        self.add_rows_of_elements(site, |c| self.is_element(c), row);
    }

    fn add_rows_of_elements(&self, site: usize, of: impl Fn(usize) -> bool, row: &mut Row<D>) {
        let takes = |c: usize| self.roles[c] != CellRole::StressElement && of(c);
        for (c, local) in self.cells_of_site(site).filter(|(c, _)| takes(*c)) {
            self.add_element_row(c, local, 1.0, row);
        }
        for &(tied, weight) in self.followers_of_site(site) {
            for (c, local) in self.cells_of_node(tied).filter(|(c, _)| takes(*c)) {
                self.add_element_row(c, local, weight, row);
            }
        }
    }

    /// Adds the force that the finite elements around a node of the mesh exert on it, all by their classical law and none that overlaps: the gradient of their own energy.
    pub fn add_own_element_rows(&self, node: u32, row: &mut Row<D>) {
        let (offsets, cells) = self.node_cells();
        for &c in &cells[offsets[node as usize] as usize..offsets[node as usize + 1] as usize] {
            let c = c as usize;
            let cell = self.mesh.cell(c);
            let Some(local) = cell.iter().position(|&n| n == node) else {
                continue;
            };
            if !self.is_element(c) {
                continue;
            }
            self.add_element_row(c, local, 1.0, row);
        }
    }

    /// Adds the row of a local node in the stiffness of cell `c`, times a weight.
    fn add_element_row(&self, c: usize, local: usize, weight: f64, row: &mut Row<D>) {
        let weight = weight * row.part_of(self.material_of_cell(c));
        if weight == 0.0 {
            return;
        }
        let stiffness = |blocks: &mut Vec<_>| {
            fem::stiffness_into(&self.mesh, c, self.tensor_of_cell(c), blocks);
        };
        let add = |row: &mut Row<D>, n: u32, block: &Tensor<D>| match weight == 1.0 {
            true => row.add(&self.node_transfer, n as usize, block),
            false => row.add(&self.node_transfer, n as usize, &(block * weight)),
        };
        row.part(
            || Some(Centre::Cell(c as u32)),
            |row| row.element_row((c, self.mesh.cell(c)), local, stiffness, add),
        );
    }

    /// Adds the row that a site has in the stiffness: that of the operator times its [`Model::row_scale`].
    pub fn add_scaled_row(&self, operator: &Operator<'_, D>, site: usize, row: &mut Row<D>) {
        operator.add_row(site, row);
        if let Some(scale) = self.row_scale() {
            row.scale(scale[site]);
        }
    }

    /// Assembles the stiffness: the rows of the operator, each times its [`Model::row_scale`].
    pub fn assemble(&self, operator: &Operator<'_, D>, progress: &dyn Progress) -> BlockCsr {
        progress.stage("assembly", Some(self.sites.len() as u64));
        let matrix = assembly::assemble_rows(
            self.sites.len(),
            self.sites.len(),
            |by| progress.advance(by),
            |site, row| self.add_scaled_row(operator, site, row),
        );
        progress.finish();
        matrix
    }

    /// Assembles the rows of some sites, in the order of `sites`: as [`Model::assemble`] does those of all.
    pub fn assemble_sites(
        &self,
        operator: &Operator<'_, D>,
        sites: &[u32],
        progress: &dyn Progress,
    ) -> BlockCsr {
        progress.stage("assembly", Some(sites.len() as u64));
        let matrix = assembly::assemble_rows(
            sites.len(),
            self.sites.len(),
            |by| progress.advance(by),
            |r, row| self.add_scaled_row(operator, sites[r] as usize, row),
        );
        progress.finish();
        matrix
    }

    /// About what the row of each site costs to compute and to keep: the places that it sees.
    pub fn work_of_sites(&self) -> Vec<f64> {
        let of_site = |site: usize| match self.point_of(site) {
            Some((body, point)) => 1 + body.families.of(point).len(),
            None => {
                let cells = self.cells_of_site(site);
                1 + cells.map(|(c, _)| self.mesh.cell(c).len()).sum::<usize>()
            }
        };
        (0..self.sites.len())
            .map(|site| of_site(site) as f64)
            .collect()
    }

    /// Assembles the rows of some sites, in the order of `sites`, as the operator writes them, each an equation at its site: for studies of a method, whose sums of forces hold before rows are scaled.
    pub fn assemble_sites_unscaled(&self, operator: &Operator<'_, D>, sites: &[u32]) -> BlockCsr {
        assembly::assemble_rows(
            sites.len(),
            self.sites.len(),
            |_| (),
            |r, row| operator.add_row(sites[r] as usize, row),
        )
    }
}
