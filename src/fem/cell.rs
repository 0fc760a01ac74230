//! Description of a reference cell, which the file of each cell fills in.

use crate::mesh::CellShape;

/// `1/√3`, the abscissa of the two-point Gauss rule.
pub(super) const GAUSS: f64 = 0.577_350_269_189_625_8;

/// `√(3/5)`, the outer abscissa of the three-point Gauss rule.
pub(super) const GAUSS_3: f64 = 0.774_596_669_241_483_4;

/// Largest number of nodes of a cell: the size of arrays with an entry per node.
///
/// Loops run over the nodes of the cell at hand, so that small cells pay for no more than zeros.
pub const MAX_NODES: usize = 20;

/// One entry per node of a cell; those beyond its nodes are zero.
pub type PerNode<T> = [T; MAX_NODES];

/// One point of a quadrature rule: reference coordinates (unused ones are zero) and weight.
pub type RulePoint = ([f64; 3], f64);

/// Quadrature rule of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Full integration of a stiffness: exact for an affine cell of constant material.
    Stiffness,
    /// Exact for a product of two shape functions on an affine cell: masses and body forces.
    Mass,
}

/// A cell on its reference domain.
#[derive(Debug)]
pub struct ReferenceCell {
    /// The shape that this describes.
    pub shape: CellShape,
    /// Reference coordinates of the nodes.
    pub corners: &'static [[f64; 3]],
    /// Reference coordinates of the centre.
    pub centre: [f64; 3],
    /// Shape functions `N_a(ξ)`.
    pub values: fn(&[f64; 3]) -> PerNode<f64>,
    /// Their gradients `∂N_a/∂ξ_j`.
    pub gradients: fn(&[f64; 3]) -> PerNode<[f64; 3]>,
    /// Distance of ξ from the reference domain, in units of its extent; negative inside.
    pub outside: fn(&[f64; 3]) -> f64,
    /// The rule of [`Rule::Stiffness`].
    pub stiffness: &'static [RulePoint],
    /// The rule of [`Rule::Mass`].
    pub mass: &'static [RulePoint],
}

impl ReferenceCell {
    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.corners.len()
    }

    /// The points of a quadrature rule.
    pub fn rule(&self, rule: Rule) -> &'static [RulePoint] {
        match rule {
            Rule::Stiffness => self.stiffness,
            Rule::Mass => self.mass,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::CELLS;
    use super::*;

    fn samples(cell: &ReferenceCell) -> Vec<[f64; 3]> {
        let mut points = vec![cell.centre];
        points.extend(cell.corners.iter().map(|c| {
            let mut p = [0.0; 3];
            for i in 0..cell.shape.dimension() {
                p[i] = 0.3 * c[i] + 0.7 * cell.centre[i];
            }
            p
        }));
        points
    }

    #[test]
    fn shape_functions_are_a_partition_of_unity_and_interpolate() {
        for cell in CELLS {
            assert_eq!(cell.nodes(), cell.shape.node_count());
            for (a, corner) in cell.corners.iter().enumerate() {
                let n = (cell.values)(corner);
                for (b, &n) in n.iter().enumerate() {
                    assert_eq!(n, f64::from(u8::from(a == b)), "{:?}", cell.shape);
                }
                // the middle of a line lies within it
                let is_within = cell.shape == CellShape::Line3 && a == 2;
                let outside = (cell.outside)(corner);
                assert!(outside.abs() < 1e-15 || is_within && outside < 0.0);
            }
            for xi in samples(cell) {
                let sum: f64 = (cell.values)(&xi).iter().sum();
                assert!((sum - 1.0).abs() < 1e-14, "{:?}", cell.shape);
                assert!((cell.outside)(&xi) < 0.0);
                for j in 0..3 {
                    let sum: f64 = (cell.gradients)(&xi).iter().map(|g| g[j]).sum();
                    assert!(sum.abs() < 1e-14, "{:?}", cell.shape);
                }
            }
        }
    }

    #[test]
    fn gradients_are_those_of_the_shape_functions() {
        for cell in CELLS {
            for xi in samples(cell) {
                let g = (cell.gradients)(&xi);
                for j in 0..cell.shape.dimension() {
                    let (mut up, mut down) = (xi, xi);
                    up[j] += 1e-4;
                    down[j] -= 1e-4;
                    let (up, down) = ((cell.values)(&up), (cell.values)(&down));
                    for a in 0..MAX_NODES {
                        let difference = (up[a] - down[a]) / 2e-4;
                        assert!((difference - g[a][j]).abs() < 1e-11, "{:?}", cell.shape);
                    }
                }
            }
        }
    }

    /// `∫ ξ^p η^q ζ^r` over the reference domain, in closed form.
    fn monomial(shape: CellShape, powers: [usize; 3]) -> f64 {
        let factorial = |n: usize| (1..=n).product::<usize>() as f64;
        let even = |p: usize| {
            if p.is_multiple_of(2) {
                2.0 / (p + 1) as f64
            } else {
                0.0
            }
        };
        match shape.linear() {
            CellShape::Tri3 | CellShape::Tet4 => {
                let total: usize = powers.iter().sum::<usize>() + shape.dimension();
                powers.iter().map(|&p| factorial(p)).product::<f64>() / factorial(total)
            }
            _ => powers[..shape.dimension()]
                .iter()
                .map(|&p| even(p))
                .product(),
        }
    }

    #[test]
    fn rules_are_exact_to_their_degree() {
        for cell in CELLS {
            let simplex = matches!(cell.shape.linear(), CellShape::Tri3 | CellShape::Tet4);
            let (stiffness, mass) = match (cell.shape, simplex) {
                (CellShape::Tri6, _) => (2, 4),
                (CellShape::Tet10, _) => (2, 5),
                (shape, false) if shape.is_quadratic() => (5, 5),
                (_, true) => (1, 2),
                (_, false) => (3, 3),
            };
            for (rule, degree) in [(Rule::Stiffness, stiffness), (Rule::Mass, mass)] {
                let integrate = |p: [usize; 3]| {
                    cell.rule(rule)
                        .iter()
                        .map(|(xi, w)| w * (0..3).map(|i| xi[i].powi(p[i] as i32)).product::<f64>())
                        .sum::<f64>()
                };
                let d = cell.shape.dimension();
                let top = |axis: usize| if axis < d { degree } else { 0 };
                for p in 0..=top(0) {
                    for q in 0..=top(1) {
                        for r in 0..=top(2) {
                            if simplex && p + q + r > degree {
                                continue;
                            }
                            let exact = monomial(cell.shape, [p, q, r]);
                            let error = integrate([p, q, r]) - exact;
                            assert!(error.abs() < 1e-14, "{:?} {p}{q}{r}", cell.shape);
                        }
                    }
                }
                // and no further, or the degree stated above says too little
                let next = degree + 1;
                let error = integrate([next, 0, 0]) - monomial(cell.shape, [next, 0, 0]);
                assert!(error.abs() > 1e-6, "{:?}: {error:e}", cell.shape);
            }
        }
    }
}
