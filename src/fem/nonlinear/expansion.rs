//! Free expansion of elements whose law is not linear.

use super::{NonlinearElements, mean_gradients};
use crate::{
    fem::{
        cell::Rule,
        element::{displacement_gradient, for_each_point},
    },
    mesh::Mesh,
    tensor::Vector,
};

impl<const D: usize> NonlinearElements<D> {
    /// Gives the elements whose law expands by itself their temperature: by how much the nodes of a cell are displaced where it expands freely \[m\], and the stretch of the solid over that within the body. What they add is then beyond the linear
    /// elements that expand likewise.
    pub fn expand(&mut self, mesh: &Mesh<D>, of_cell: impl Fn(usize) -> (Vec<Vector<D>>, f64)) {
        self.expanded.resize(self.forces.len(), Vector::zeros());
        for element in &self.elements {
            let law = self.laws[element.law as usize].as_ref();
            let Some(place) = law.history().free_stretch else {
                continue;
            };
            let cell = element.cell as usize;
            let (nodes, solid) = of_cell(cell);
            let mut stretch = Vec::new();
            let (mut mean, mut volume) = (0.0, 0.0);
            for_each_point(mesh, cell, Rule::Stiffness, |p| {
                let free = displacement_gradient(p, |a| nodes[a]).trace() / D as f64;
                stretch.push(solid * free);
                mean += solid * free * p.weight;
                volume += p.weight;
            });
            if mean_gradients(mesh, element, law).is_some() {
                stretch.fill(mean / volume);
            }
            for (point, stretch) in stretch.into_iter().enumerate() {
                self.past[element.first + point * element.each + place] = stretch;
            }
            self.expanded[element.node..][..nodes.len()].copy_from_slice(&nodes);
        }
    }
}
