//! The check that elements can live on the cells of a body.

use super::element::reference;
use super::geometry::{jacobian, relative_nodes};
use crate::mesh::{CellShape, Mesh};
use crate::parallel;
use crate::tensor::determinant;

/// Smallest `det J` relative to a cell's size. A cell a million times longer than thick is at 1e-6 in 2D and 1e-12 in
/// 3D; below 1e-10 coordinates near 1 no longer say which side of the cell is up.
const DEGENERATE: f64 = 1e-10;

/// A mesh on which no element can live.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FemError {
    /// A cell of a shape that has no element in this dimension.
    #[error(
        "cell {cell} is a {shape:?}, but a {dimension}D body is made of {expected}; leave other cells out of the mesh"
    )]
    WrongShape {
        /// Cell number.
        cell: usize,
        /// Its shape.
        shape: CellShape,
        /// Dimension of the body.
        dimension: usize,
        /// Shapes that would do.
        expected: String,
    },
    /// A cell that is turned inside out, flat, or folded at one of its quadrature points.
    #[error(
        "cell {cell} ({shape:?}) near {position:?} has a Jacobian of {ratio:.2e} relative to its size, but it must be above 1e-10; if it is negative everywhere, reverse the order of its nodes {nodes:?}, else move them apart"
    )]
    Degenerate {
        /// Cell number.
        cell: usize,
        /// Its shape.
        shape: CellShape,
        /// Mean of its nodes' positions.
        position: Vec<f64>,
        /// `det J` over the D-th power of half the largest distance to its first node.
        ratio: f64,
        /// Its nodes.
        nodes: Vec<u32>,
    },
}

/// Checks that elements can live on every cell of the mesh for which `selected` holds.
///
/// # Errors
/// `FemError::WrongShape` for a cell of another dimension, `FemError::Degenerate` unless `det J` is positive at every
/// quadrature point.
pub fn check<const D: usize>(
    mesh: &Mesh<D>,
    selected: impl Fn(usize) -> bool + Sync,
) -> Result<(), FemError> {
    let fault = parallel::find_first(mesh.cell_count(), 1, |c| {
        selected(c).then(|| check_cell(mesh, c).err()).flatten()
    });
    match fault {
        Some(error) => Err(error),
        None => Ok(()),
    }
}

fn check_cell<const D: usize>(mesh: &Mesh<D>, c: usize) -> Result<(), FemError> {
    let shape = mesh.shapes[c];
    let Some(cell) = reference(mesh, c) else {
        let expected: Vec<String> = super::CELLS
            .iter()
            .filter(|cell| cell.shape.dimension() == D)
            .map(|cell| format!("{:?}", cell.shape))
            .collect();
        return Err(FemError::WrongShape {
            cell: c,
            shape,
            dimension: D,
            expected: expected.join(" and "),
        });
    };
    let (_, x) = relative_nodes(mesh, c);
    let size = 0.5 * x.iter().map(|x| x.norm()).fold(0.0, f64::max);
    // a curved cell may be folded where only masses and loads look
    let more = if shape.is_quadratic() { cell.mass } else { &[] };
    for (xi, _) in cell.stiffness.iter().chain(more) {
        let ratio =
            determinant(&jacobian(&x[..cell.nodes()], &(cell.gradients)(xi))) / size.powi(D as i32);
        // a comparison that also refuses a ratio that is not a number
        if ratio.is_nan() || ratio <= DEGENERATE {
            return Err(FemError::Degenerate {
                cell: c,
                shape,
                position: mesh.centroid(c).iter().copied().collect(),
                ratio,
                nodes: mesh.cell(c).to_vec(),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::cell::Rule;
    use super::super::element::for_each_point;
    use super::super::sample::{assemble, boxes, noise, solve, unit_box};
    use super::super::{body_force_vector, nodal_volumes, traction_vector};
    use super::*;
    use crate::material::{Elastic, Kinematics};
    use crate::tensor::{Tensor, Tensor4, Vector};

    fn stiffness<const D: usize>() -> Tensor4<D> {
        let kinematics = [Kinematics::Bar, Kinematics::PlaneStrain, Kinematics::Solid][D - 1];
        (Elastic::new(3.0, 0.3, 1.0).unwrap())
            .stiffness(kinematics)
            .unwrap()
    }

    /// Facets of the unit box, mapped by `place`, whose nodes all satisfy `on`.
    fn facets_where<const D: usize>(
        mesh: &Mesh<D>,
        on: impl Fn(&Vector<D>) -> bool,
    ) -> Vec<Vec<u32>> {
        let mut facets = Vec::new();
        for c in 0..mesh.cell_count() {
            for facet in mesh.shapes[c].facets() {
                let nodes: Vec<u32> = facet.iter().map(|&a| mesh.cell(c)[a]).collect();
                if nodes.iter().all(|&n| on(&mesh.nodes[n as usize])) {
                    facets.push(nodes);
                }
            }
        }
        facets
    }

    fn stiffness_is_right<const D: usize>() {
        for mesh in boxes::<D>(4, 0.25) {
            let stiffness = stiffness::<D>();
            let k = assemble(&mesh, |_| Some(&stiffness));
            let scale = k.values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            assert!(k.asymmetry() < 1e-15);
            // rigid translations and rotations, written out as displacements
            let mut modes: Vec<Tensor<D>> = Vec::new();
            for i in 0..D {
                for j in 0..i {
                    let mut w = Tensor::zeros();
                    w[(i, j)] = 1.0;
                    w[(j, i)] = -1.0;
                    modes.push(w);
                }
            }
            for i in 0..D {
                let u = mesh
                    .nodes
                    .iter()
                    .flat_map(|_| (0..D).map(move |k| f64::from(u8::from(k == i))));
                let r = k.multiply(&u.collect::<Vec<f64>>());
                assert!(r.iter().all(|r| r.abs() < 1e-14 * scale), "translation");
            }
            for w in modes {
                let u: Vec<f64> = mesh
                    .nodes
                    .iter()
                    .flat_map(|x| (w * x).iter().copied().collect::<Vec<_>>())
                    .collect();
                let r = k.multiply(&u);
                assert!(r.iter().all(|r| r.abs() < 1e-14 * scale), "rotation");
            }
            // patch test: an affine field leaves no force at inner nodes, and the traction's on the boundary
            let g = Tensor::<D>::from_fn(|i, j| 1e-3 * (1.0 + noise(i, j)));
            let u: Vec<Vector<D>> = mesh.nodes.iter().map(|x| g * x).collect();
            let flat: Vec<f64> = u.iter().flat_map(|u| u.iter().copied()).collect();
            let r = k.multiply(&flat);
            let stress = stiffness.contract(&g);
            let mut expected = vec![0.0; r.len()];
            for axis in 0..D {
                for side in [0.0, 1.0] {
                    let normal =
                        Vector::<D>::from_fn(|i, _| if i == axis { 2.0 * side - 1.0 } else { 0.0 });
                    for facet in facets_where(&mesh, |x| (x[axis] - side).abs() < 1e-12) {
                        for (n, f) in traction_vector(&mesh, &facet, |_| stress * normal) {
                            for i in 0..D {
                                expected[n as usize * D + i] += f[i];
                            }
                        }
                    }
                }
            }
            for (r, e) in r.iter().zip(&expected) {
                assert!(
                    (r - e).abs() < 1e-15 * scale,
                    "{:?}: {r} {e}",
                    mesh.shapes[0]
                );
            }
        }
    }

    #[test]
    fn rigid_modes_are_free_and_affine_fields_are_exact() {
        stiffness_is_right::<1>();
        stiffness_is_right::<2>();
        stiffness_is_right::<3>();
    }

    fn volumes_add_up<const D: usize>() {
        for mesh in boxes::<D>(3, 0.3) {
            let volumes = nodal_volumes(&mesh, 0..mesh.cell_count());
            assert!((volumes.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            assert!(volumes.iter().all(|&v| v > 0.0));
            // Σ V_a x_a = ∫ x dV, half of the box
            let mut first = 0.0;
            for (v, x) in volumes.iter().zip(&mesh.nodes) {
                first += v * x[0];
            }
            // shares in the ratio of a diagonal keep the first moment of affine cells only
            let is_affine = !matches!(mesh.shapes[0], CellShape::Quad8 | CellShape::Hex20);
            let tolerance = if is_affine { 1e-14 } else { 1e-3 };
            let error: f64 = first - 0.5;
            assert!(error.abs() < tolerance, "{:?} {error}", mesh.shapes[0]);
        }
    }

    #[test]
    fn volumes_add_up_to_the_body() {
        volumes_add_up::<1>();
        volumes_add_up::<2>();
        volumes_add_up::<3>();
    }

    #[test]
    fn a_hanging_bar_is_exact_at_its_nodes() {
        // E u'' + b = 0, u(0) = 0, E u'(1) = t: u = (b (x - x²/2) + t x) / E
        let mesh = unit_box::<1>(CellShape::Line2, 7, 0.3);
        let (e, b, t) = (3.0, 0.2, 0.1);
        let stiffness = stiffness::<1>();
        let k = assemble(&mesh, |_| Some(&stiffness));
        let mut f = vec![0.0; k.dofs()];
        for c in 0..mesh.cell_count() {
            for (n, force) in body_force_vector(&mesh, c, |_| Vector::<1>::new(b)) {
                f[n as usize] += force[0];
            }
        }
        for (n, force) in traction_vector(&mesh, &[7], |_| Vector::<1>::new(t)) {
            f[n as usize] += force[0];
        }
        let u = solve(&k, &f, &[(0, 0.0)]);
        for (u, x) in u.iter().zip(&mesh.nodes) {
            let exact = (b * (x[0] - 0.5 * x[0] * x[0]) + t * x[0]) / e;
            assert!((u - exact).abs() < 1e-15);
        }
    }

    /// Relative L2 error of a cantilever under a tip load, against the elasticity solution of Timoshenko and Goodier \[TimoshenkoGoodier1970\].
    fn cantilever(shape: CellShape, n: usize) -> f64 {
        let (length, height, e, nu, p) = (2.0, 1.0, 3.0, 0.3, 1e-3);
        let inertia = height * height * height / 12.0;
        let mut mesh = unit_box::<2>(shape, n, 0.15);
        for x in &mut mesh.nodes {
            *x = Vector::<2>::new(x[0] * length, (x[1] - 0.5) * height);
        }
        let exact = |x: &Vector<2>| {
            let (x, y) = (x[0], x[1]);
            let h2 = height * height / 4.0;
            let s = p / (6.0 * e * inertia);
            Vector::<2>::new(
                s * y * ((6.0 * length - 3.0 * x) * x + (2.0 + nu) * (y * y - h2)),
                -s * (3.0 * nu * y * y * (length - x)
                    + (4.0 + 5.0 * nu) * h2 * x
                    + (3.0 * length - x) * x * x),
            )
        };
        let solid = Elastic::new(e, nu, 0.0).unwrap();
        let tangent = solid.stiffness::<2>(Kinematics::PlaneStress).unwrap();
        let k = assemble(&mesh, |_| Some(&tangent));
        let mut f = vec![0.0; k.dofs()];
        for facet in facets_where(&mesh, |x| x[0] > length - 1e-12) {
            let shear = |x: &Vector<2>| {
                Vector::<2>::new(
                    0.0,
                    -p / (2.0 * inertia) * (0.25 * height * height - x[1] * x[1]),
                )
            };
            for (n, force) in traction_vector(&mesh, &facet, shear) {
                f[2 * n as usize + 1] += force[1];
            }
        }
        assert!((f.iter().sum::<f64>() + p).abs() < 1e-16);
        let mut fixed = Vec::new();
        for (n, x) in mesh.nodes.iter().enumerate() {
            if x[0] < 1e-12 {
                let u = exact(x);
                fixed.extend([(2 * n, u[0]), (2 * n + 1, u[1])]);
            }
        }
        let u = solve(&k, &f, &fixed);
        let (mut error, mut norm) = (0.0, 0.0);
        for c in 0..mesh.cell_count() {
            for_each_point(&mesh, c, Rule::Mass, |q| {
                let mut at = Vector::<2>::zeros();
                for (a, &n) in mesh.cell(c).iter().enumerate() {
                    let n = n as usize;
                    at += Vector::<2>::new(u[2 * n], u[2 * n + 1]) * q.shape[a];
                }
                let exact = exact(&q.position);
                error += q.weight * (at - exact).norm_squared();
                norm += q.weight * exact.norm_squared();
            });
        }
        (error / norm).sqrt()
    }

    #[test]
    fn a_cantilever_converges_at_second_order() {
        // Measured with 8, 16 and 32 cells per side: quadrilaterals 2.67e-2, 7.4e-3, 1.9e-3 (orders 1.85, 1.99), triangles
        // 8.6e-2, 2.5e-2, 6.4e-3 (1.79, 1.95). The finest takes a dense solve of seconds and is left out. On a beam twice as
        // slender with cells 4:1 both lock in bending and start lower, at 1.62 and 1.46, then 1.93 and 1.86.
        for (shape, ceiling) in [(CellShape::Quad4, 0.008), (CellShape::Tri3, 0.027)] {
            let (coarse, fine) = (cantilever(shape, 8), cantilever(shape, 16));
            let order = (coarse / fine).log2();
            println!("{shape:?}: {coarse:.3e} {fine:.3e} order {order:.2}");
            assert!(order > 1.75 && order < 2.2, "{shape:?}: order {order}");
            assert!(fine < ceiling, "{shape:?}: error {fine}");
        }
    }

    #[test]
    fn impossible_cells_are_named() {
        let mut mesh = unit_box::<2>(CellShape::Quad4, 3, 0.0);
        let turned: Vec<u32> = mesh.cell(4).iter().rev().copied().collect();
        mesh.connectivity[16..20].copy_from_slice(&turned);
        let message = check(&mesh, |_| true).unwrap_err().to_string();
        assert!(
            message.contains("cell 4") && message.contains("reverse"),
            "{message}"
        );
        let mut mesh = unit_box::<2>(CellShape::Tri3, 2, 0.0);
        mesh.nodes[4] = mesh.nodes[0];
        assert!(matches!(
            check(&mesh, |_| true),
            Err(FemError::Degenerate { .. })
        ));
        mesh.nodes[4][0] = f64::NAN;
        assert!(matches!(
            check(&mesh, |_| true),
            Err(FemError::Degenerate { cell: 0, .. })
        ));
        let mut mesh = unit_box::<2>(CellShape::Tri3, 2, 0.0);
        mesh.push_cell(CellShape::Line2, &[0, 1]);
        let message = check(&mesh, |_| true).unwrap_err().to_string();
        assert!(
            message.contains("Line2") && message.contains("Tri3 and Quad4"),
            "{message}"
        );
        assert!(check(&mesh, |c| c < 8).is_ok());
    }
}
