//! Cells of second order through scenes: affine fields beside every coupling, order of convergence, problems with known solutions.
//!
//! | file | what |
//! |---|---|
//! | `order.rs` | errors of a manufactured solution in L2 and their orders, elements alone and beside points |
//! | `problems.rs` | Kirsch's hole, a cantilever, Cook's membrane |
//!
//! The affine fields are those of [`meshes`](super::meshes), on the same families of meshes raised to second order.

mod order;
mod problems;

use bondline::fem::Locator;
use bondline::mesh::Mesh;
use bondline::observe::report::Table;
use bondline::progress::{Progress, Silent};
use bondline::run::{Solved, solve_with};
use bondline::tensor::Vector;

use crate::Effort;
use crate::meshes::{affine, scene};

/// The tables of the suite.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    vec![
        affine::of_second_order(effort, progress),
        order::table(effort, progress),
        order::beside_points(effort, progress),
        problems::table(effort, progress),
    ]
}

/// A solved scene: its mesh, and the displacement of each node \[m\], which is zero where no equation uses a node.
struct Solution<const D: usize> {
    mesh: Mesh<D>,
    displacement: Vec<Vector<D>>,
    /// Position \[m\], volume \[m^D\] and displacement \[m\] of each node and point that has an equation.
    sites: Vec<(Vector<D>, f64, Vector<D>)>,
}

impl<const D: usize> Solution<D> {
    /// Solves a static scene beside the files that it names.
    ///
    /// # Errors
    /// The message of a refusal, one of a scene of another dimension among them.
    fn of(text: &str, overrides: &[&str], files: &[(&str, &str)]) -> Result<Self, String> {
        let folder = scene::Folder::with(files)?;
        let scene = scene::load(text, overrides, &folder)?.of_dimension::<D>();
        let scene = scene.ok_or("the scene has another dimension; change its kinematics")?;
        let mut found = None;
        solve_with(scene, &Silent, |_, solved: &Solved<'_, D>| {
            let model = solved.model;
            let of_node = |n: usize| model.node_transfer.displacement(n, solved.displacement);
            let of_site = |i: usize| Vector::from_fn(|k, _| solved.displacement[D * i + k]);
            let sites = model.sites.iter().enumerate();
            found = Some(Self {
                mesh: model.mesh.clone(),
                displacement: (0..model.mesh.nodes.len()).map(of_node).collect(),
                sites: sites
                    .map(|(i, s)| (s.position, s.volume, of_site(i)))
                    .collect(),
            });
            Ok(Vec::new())
        })
        .map_err(|e| e.to_string())?;
        found.ok_or_else(|| "the scene was not solved".to_owned())
    }

    /// The displacement gradient at a place of the mesh.
    ///
    /// # Errors
    /// A place outside of it, as text.
    fn gradient(&self, x: &Vector<D>) -> Result<bondline::tensor::Tensor<D>, String> {
        let locator = Locator::new(&self.mesh, 0..self.mesh.cell_count());
        let found = locator.locate(&self.mesh, x, 1e-6);
        let found = found.ok_or_else(|| format!("{x:?} lies outside of the mesh"))?;
        let xi = bondline::tensor::padded(&found.reference);
        let u = |n: usize| self.displacement[n];
        Ok(bondline::fem::displacement_gradient_at(
            &self.mesh, found.cell, &xi, u,
        ))
    }

    /// The displacement of the node nearest to a place \[m\].
    fn nearest(&self, x: &Vector<D>) -> Vector<D> {
        let distance = |n: &usize| (self.mesh.nodes[*n] - x).norm_squared();
        let nodes = 0..self.mesh.nodes.len();
        let nearest = nodes.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.map_or_else(Vector::zeros, |n| self.displacement[n])
    }
}
