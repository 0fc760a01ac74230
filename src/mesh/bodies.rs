//! Bodies of a mesh: nodes that cells hold together.

use super::Mesh;

impl<const D: usize> Mesh<D> {
    /// The body of each node, by the least number of its nodes: cells hold their nodes together, and nodes that follow others are held by these.
    ///
    /// Shapes: one entry per node; a node without a cell is a body of its own.
    pub fn bodies(&self) -> Vec<u32> {
        let mut above: Vec<u32> = (0..self.nodes.len() as u32).collect();
        for c in 0..self.cell_count() {
            let nodes = self.cell(c);
            nodes.iter().for_each(|&n| join(&mut above, nodes[0], n));
        }
        for (&n, row) in &self.embedded.followers {
            row.iter().for_each(|&(m, _)| join(&mut above, n, m));
        }
        // the least of each comes before it
        for n in 0..above.len() {
            above[n] = above[above[n] as usize];
        }
        above
    }
}

fn least(above: &[u32], mut n: u32) -> u32 {
    while above[n as usize] != n {
        n = above[n as usize];
    }
    n
}

/// Joins the bodies of two nodes, and shortens the ways to their least nodes.
fn join(above: &mut [u32], a: u32, b: u32) {
    let (p, q) = (least(above, a), least(above, b));
    let first = p.min(q);
    for start in [a, b, p, q] {
        above[start as usize] = first;
    }
}

#[cfg(test)]
mod tests {
    use crate::mesh::{CellShape, Mesh};

    #[test]
    fn cells_with_a_node_in_common_are_one_body() {
        let mut mesh = Mesh::<1> {
            nodes: vec![crate::tensor::Vector::<1>::new(0.0); 7],
            ..Mesh::default()
        };
        for nodes in [[5, 6], [3, 4], [1, 2], [2, 5]] {
            mesh.push_cell(CellShape::Line2, &nodes);
        }
        assert_eq!(mesh.bodies(), [0, 1, 1, 3, 3, 1, 1]);
    }
}
