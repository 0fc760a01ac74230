//! The consistent tangent of elements whose law is not linear, as its excess over the tangent at rest of the linear elements.
//!
//! With `C` the algorithmic tangent `∂P/∂G` of the law and `C₀` that at rest,
//!
//! ```text
//!   ΔK_ab = ∫ ∂N_a · (C − C₀) · ∂N_b dV ;
//! ```
//!
//! the total Lagrangian form needs no geometric part beside it, which `∂P/∂G` contains. Where a cell takes the mean dilatation, gradients of the displacement and of its variation are both
//! `G + (θ̄ − θ)/D I`, with `θ̄ − θ = D Σ_b s_b · u_b` and `s_b = (∂N̄_b − ∂N_b)/D`, so that
//!
//! ```text
//!   ΔK_ab += ∫ (C:I ∂N_a) ⊗ s_b + s_a ⊗ (I:C ∂N_b) + s_a ⊗ s_b (I:C:I) dV .
//! ```
//!
//! It is symmetric as `C` is.

use super::{Element, NonlinearElements, mean_gradients};
use crate::{
    fem::{
        cell::{MAX_NODES, Rule},
        element::{QuadraturePoint, displacement_gradient, for_each_point, row_at},
    },
    material::LocalLaw,
    mesh::Mesh,
    parallel,
    tensor::{Tensor, Tensor4, Vector},
};

/// Elements whose tangents are held at a time.
const CHUNK: usize = 512;

impl<const D: usize> NonlinearElements<D> {
    /// Returns true if the tangent of each element is symmetric.
    pub fn has_symmetric_tangent(&self) -> bool {
        self.laws.iter().all(|law| law.has_symmetric_tangent())
    }

    /// Hands `visit` each element, by ascending cell, with what its consistent tangent has beyond the stiffness of the linear element \[N/m^(4−D)\], at a displacement of the nodes \[m\] that ends an interval of the length `step` \[s\] since the last [`NonlinearElements::commit`].
    ///
    /// Shapes: as [`crate::fem::stiffness_into`]; the block of local nodes a and b is number `a · nodes + b`.
    pub fn tangents(
        &self,
        mesh: &Mesh<D>,
        displacement: impl Fn(u32) -> Vector<D> + Sync,
        step: f64,
        mut visit: impl FnMut(usize, &[Tensor<D>]),
    ) {
        for elements in self.elements.chunks(CHUNK) {
            let found: Vec<Vec<Tensor<D>>> = parallel::map_slice(elements, |element| {
                let law = self.laws[element.law as usize].as_ref();
                tangent(mesh, element, law, &displacement, step, &self.past)
            });
            for (element, blocks) in elements.iter().zip(&found) {
                visit(element.cell as usize, blocks);
            }
        }
    }
}

/// Tangent of an element less that of the linear one.
fn tangent<const D: usize>(
    mesh: &Mesh<D>,
    element: &Element,
    law: &dyn LocalLaw<D>,
    displacement: &impl Fn(u32) -> Vector<D>,
    step: f64,
    past: &[f64],
) -> Vec<Tensor<D>> {
    let nodes = mesh.cell(element.cell as usize);
    let mut u = [Vector::zeros(); MAX_NODES];
    for (u, &n) in u.iter_mut().zip(nodes) {
        *u = displacement(n);
    }
    let mut blocks = vec![Tensor::zeros(); nodes.len() * nodes.len()];
    let mean = mean_gradients(mesh, element, law);
    let mut point = 0;
    for_each_point(mesh, element.cell as usize, Rule::Stiffness, |p| {
        let mut gradient = displacement_gradient(p, |a| u[a]);
        if let Some(mean) = &mean {
            let dilatation: f64 = mean.iter().zip(&u).map(|(g, u)| g.dot(u)).sum();
            gradient += Tensor::identity() * ((dilatation - gradient.trace()) / D as f64);
        }
        let past = &past[element.first + point * element.each..][..element.each];
        let present = law.algorithmic_tangent(&gradient, step, past);
        let mut beyond = present;
        beyond.add_scaled(-1.0, law.tangent());
        for (a, row) in blocks.chunks_exact_mut(nodes.len()).enumerate() {
            row_at(p, &beyond, a, row);
        }
        if let Some(mean) = &mean {
            add_dilatation(p, &present, mean, &mut blocks);
        }
        point += 1;
    });
    blocks
}

/// Adds the part of the mean dilatation of a cell in the tangent at a point.
fn add_dilatation<const D: usize>(
    p: &QuadraturePoint<D>,
    tangent: &Tensor4<D>,
    mean: &[Vector<D>; MAX_NODES],
    blocks: &mut [Tensor<D>],
) {
    let by_dilatation = Tensor::<D>::from_fn(|i, j| tangent.0[i][j].trace());
    let pressure = (0..D).fold(Tensor::<D>::zeros(), |sum, i| sum + tangent.0[i][i]);
    let bulk = by_dilatation.trace();
    let shift = |a: usize| (mean[a] - p.gradient[a]) / D as f64;
    for (a, row) in blocks.chunks_exact_mut(p.nodes).enumerate() {
        let own = shift(a) * p.weight;
        // the force of a unit of dilatation
        let force = by_dilatation * p.gradient[a] * p.weight + own * bulk;
        for (b, block) in row.iter_mut().enumerate() {
            *block += force * shift(b).transpose();
            *block += own * (pressure * p.gradient[b]).transpose();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::fem::sample::{boxes, noise};
    use crate::material::{
        Banded, Hardening, J2, Kinematics, LocalHistory, LocalResponse, LogarithmicJ2, NeoHooke,
        Reduced, StVenantKirchhoff,
    };

    const LAME: (f64, f64) = (600.0, 400.0);

    /// A law of solids whose tangent is not symmetric: Neo-Hooke with a shear modulus that falls with its dilatation; it flows at constant volume, for cells to take its mean dilatation.
    #[derive(Debug)]
    struct Unsymmetric(NeoHooke);

    impl LocalLaw<3> for Unsymmetric {
        fn tangent(&self) -> &Tensor4<3> {
            self.0.tangent()
        }

        fn is_linear(&self) -> bool {
            false
        }

        fn is_objective(&self) -> bool {
            true
        }

        fn history(&self) -> LocalHistory {
            LocalHistory::NONE
        }

        fn flows_at_constant_volume(&self) -> bool {
            true
        }

        fn in_band(&self, _width: f64) -> Option<Banded<3>> {
            None
        }

        fn respond(
            &self,
            gradient: &Tensor<3>,
            step: f64,
            past: &[f64],
            present: &mut [f64],
        ) -> LocalResponse<3> {
            let found = self.0.respond(gradient, step, past, present);
            LocalResponse {
                stress: found.stress * (1.0 - 2.0 * (found.volume_ratio - 1.0)),
                ..found
            }
        }
    }

    fn solids() -> Vec<Arc<dyn LocalLaw<3>>> {
        let hardening = Hardening::Voce {
            yield_stress: 2.0,
            modulus: 50.0,
            saturation: 3.0,
            rate: 10.0,
        };
        vec![
            Arc::new(J2::<3>::with_hardening(LAME.0, LAME.1, hardening)),
            Arc::new(LogarithmicJ2::new(LAME.0, LAME.1, hardening)),
            Arc::new(NeoHooke::new(LAME.0, LAME.1)),
            Arc::new(StVenantKirchhoff::new(LAME.0, LAME.1)),
            Arc::new(Unsymmetric(NeoHooke::new(LAME.0, LAME.1))),
        ]
    }

    fn laws<const D: usize>() -> Vec<Arc<dyn LocalLaw<D>>> {
        let kinematics = match D {
            1 => &[Kinematics::Bar][..],
            2 => &[Kinematics::PlaneStress, Kinematics::PlaneStrain],
            _ => &[Kinematics::Solid],
        };
        let reduced = |(law, k): (Arc<dyn LocalLaw<3>>, &Kinematics)| -> Arc<dyn LocalLaw<D>> {
            Arc::new(Reduced::<D>::new(law, *k))
        };
        let pairs = solids()
            .into_iter()
            .flat_map(|law| kinematics.iter().map(move |k| (Arc::clone(&law), k)));
        pairs.map(reduced).collect()
    }

    /// Products of the tangents with a direction beside central differences of the forces, in a first interval and in one that begins with what flowed.
    fn agrees<const D: usize>() {
        let laws = laws::<D>();
        for mesh in boxes::<D>(2, 0.2) {
            for law in &laws {
                let cells = (0..mesh.cell_count()).map(|c| (c, true));
                let mut elements = NonlinearElements::new(&mesh, cells, |_| Some(Arc::clone(law)))
                    .unwrap()
                    .unwrap();
                let along: Vec<Vector<D>> = (0..mesh.nodes.len())
                    .map(|n| Vector::from_fn(|i, _| noise(n + 7, i)))
                    .collect();
                for (interval, size) in [0.03, 0.1].into_iter().enumerate() {
                    let u: Vec<Vector<D>> = (0..mesh.nodes.len())
                        .map(|n| {
                            let x = mesh.nodes[n];
                            let affine = Vector::<D>::from_fn(|i, _| {
                                (0..D).map(|j| noise(i, j + 3 * interval) * x[j]).sum()
                            });
                            (affine + Vector::from_fn(|i, _| 0.1 * noise(n, i + 3))) * size
                        })
                        .collect();
                    let mut forces = |by: f64| -> Vec<Vector<D>> {
                        let at = |n: u32| u[n as usize] + along[n as usize] * by;
                        elements.respond(&mesh, at, 1.0);
                        let nodes = 0..mesh.nodes.len() as u32;
                        nodes.map(|n| elements.force(n)).collect()
                    };
                    let step = 1e-6;
                    let (up, down) = (forces(step), forces(-step));
                    forces(0.0);
                    let mut products = vec![Vector::<D>::zeros(); mesh.nodes.len()];
                    let mut skew = 0.0f64;
                    elements.tangents(
                        &mesh,
                        |n| u[n as usize],
                        1.0,
                        |cell, blocks| {
                            let nodes = mesh.cell(cell);
                            for (a, &n) in nodes.iter().enumerate() {
                                for (b, &m) in nodes.iter().enumerate() {
                                    let block = blocks[a * nodes.len() + b];
                                    products[n as usize] += block * along[m as usize];
                                    let other = blocks[b * nodes.len() + a].transpose();
                                    skew = skew.max((block - other).amax());
                                }
                            }
                        },
                    );
                    let scale = LAME.0 * products.len() as f64;
                    let name = format!("{:?} {law:?} {interval}", mesh.shapes[0]);
                    for (n, product) in products.iter().enumerate() {
                        let slope = (up[n] - down[n]) / (2.0 * step);
                        let off = (slope - product).amax() / scale;
                        assert!(off < 1e-6, "{name}: {off:e}");
                    }
                    let is_symmetric = elements.has_symmetric_tangent();
                    assert!(!is_symmetric || skew < 1e-9 * scale, "{name}: {skew:e}");
                    let is_known = D == 1 || is_symmetric || skew > 1e-3 * LAME.1 * size;
                    assert!(is_known, "{name}: {skew:e}");
                    elements.commit();
                }
            }
        }
    }

    #[test]
    fn tangents_of_all_cells_are_those_of_their_forces() {
        agrees::<1>();
        agrees::<2>();
        agrees::<3>();
    }
}
