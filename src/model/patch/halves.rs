//! Quadrilaterals of second order that a patch cuts, in two triangles of second order.
//!
//! The shape functions of a general quadrilateral are no polynomials in space, so that moments of what is left of it do not give its stiffness. Those of triangles with straight sides are. The halves have the edges of the quadrilateral, with their nodes, and a node of their own in the middle of the diagonal between them: the
//! displacement is continuous, and keeps its order.

use std::borrow::Cow;

use super::places::Places;
use crate::mesh::{CellShape, Mesh};

/// A mesh of which some quadrilaterals are halved: one half has the number of its quadrilateral, the other follows the cells of the mesh.
pub(super) struct Halves<'m, const D: usize> {
    pub mesh: Cow<'m, Mesh<D>>,
    /// Number of cells of the mesh before.
    cells: usize,
    /// Number of its nodes.
    nodes: usize,
    /// The quadrilateral of each cell that was added.
    of: Vec<u32>,
}

impl<'m, const D: usize> Halves<'m, D> {
    pub fn none(mesh: &'m Mesh<D>) -> Self {
        Self {
            mesh: Cow::Borrowed(mesh),
            cells: mesh.cell_count(),
            nodes: mesh.nodes.len(),
            of: Vec::new(),
        }
    }

    /// The cell of the mesh before that a cell is, or is a half of.
    pub fn origin(&self, c: u32) -> u32 {
        match (c as usize).checked_sub(self.cells) {
            None => c,
            Some(k) => self.of[k],
        }
    }

    /// Returns true if the motion of a node is prescribed, which `places` tell of nodes of the mesh before.
    pub fn is_held(&self, n: u32, places: &Places<'_, D>) -> bool {
        match (n as usize) < self.nodes {
            true => (places.is_held)(n),
            false => (places.holds).is_some_and(|holds| holds(&self.mesh.nodes[n as usize])),
        }
    }

    /// Number of quadrilaterals that are halved.
    pub fn count(&self) -> usize {
        self.of.len()
    }

    /// Halves more of the quadrilaterals, along the shorter diagonal.
    pub fn halve(&mut self, cells: &[u32]) {
        let mesh = self.mesh.to_mut();
        let mut own: Vec<Option<[[u32; 6]; 2]>> = vec![None; mesh.cell_count()];
        for &c in cells {
            let [mut corners, mut middles]: [[u32; 4]; 2] = {
                let nodes = mesh.cell(c as usize);
                [0, 4].map(|k| std::array::from_fn(|i| nodes[k + i]))
            };
            let x = |n: u32| mesh.nodes[n as usize];
            let length = |p: u32, q: u32| (x(q) - x(p)).norm();
            if length(corners[1], corners[3]) < length(corners[0], corners[2]) {
                corners.rotate_left(1);
                middles.rotate_left(1);
            }
            let ([p, q, r, s], [pq, qr, rs, sp]) = (corners, middles);
            let middle = mesh.nodes.len() as u32;
            let at = (x(p) + x(r)) * 0.5;
            mesh.nodes.push(at);
            own[c as usize] = Some([[p, q, r, pq, qr, middle], [p, r, s, middle, rs, sp]]);
        }
        let mut halved = Mesh::<D>::default();
        for (c, halves) in own.iter().enumerate() {
            match halves {
                Some([first, _]) => halved.push_cell(CellShape::Tri6, first),
                None => halved.push_cell(mesh.shapes[c], mesh.cell(c)),
            }
        }
        for &c in cells {
            let [_, second] = own[c as usize].expect("is halved");
            let number = halved.cell_count() as u32;
            halved.push_cell(CellShape::Tri6, &second);
            self.of.push(c);
            let sets = mesh.cell_sets.values_mut();
            sets.filter(|set| set.contains(&c))
                .for_each(|set| set.push(number));
        }
        mesh.shapes = halved.shapes;
        mesh.offsets = halved.offsets;
        mesh.connectivity = halved.connectivity;
    }
}
