//! Gauss–Hermite quadrature, midpoint rule and linear finite elements of the nonlocal bar, solved exactly in time.

use std::f64::consts::PI;

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

use crate::emmrich_weckner::closed_form::{LAMBDA, exact, initial, micromodulus};

/// Nodes and `σ exp(x²)` of the Gauss–Hermite rule of `n` points.
///
/// Roots from the eigenvalues of the Jacobi matrix, polished by Newton on the orthonormal Hermite function `ψ_n`; `σ exp(x²) = 1/(n ψ_{n−1}²)`,
/// which neither over- nor underflows where the printed `2^(N+2) (N+1)! √π / H_{N+2}²` does.
pub fn gauss_hermite(n: usize) -> (Vec<f64>, Vec<f64>) {
    let mut jacobi = DMatrix::zeros(n, n);
    for k in 1..n {
        let off = (0.5 * k as f64).sqrt();
        jacobi[(k, k - 1)] = off;
        jacobi[(k - 1, k)] = off;
    }
    let mut x: Vec<f64> = SymmetricEigen::new(jacobi)
        .eigenvalues
        .iter()
        .copied()
        .collect();
    x.sort_by(f64::total_cmp);
    let mut weight = vec![0.0; n];
    for (x, weight) in x.iter_mut().zip(&mut weight) {
        for _ in 0..3 {
            let (last, before) = hermite(n, *x);
            *x -= last / ((2.0 * n as f64).sqrt() * before - *x * last);
        }
        *weight = 1.0 / (n as f64 * hermite(n, *x).1.powi(2));
    }
    (x, weight)
}

/// `ψ_n` and `ψ_{n−1}`.
fn hermite(n: usize, x: f64) -> (f64, f64) {
    let (mut before, mut last) = (0.0, PI.powf(-0.25) * (-0.5 * x * x).exp());
    for k in 0..n {
        let k = k as f64;
        let next = x * (2.0 / (k + 1.0)).sqrt() * last - (k / (k + 1.0)).sqrt() * before;
        (before, last) = (last, next);
    }
    (last, before)
}

/// Discretisation of the bar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Gauss–Hermite quadrature, \[EmmrichWeckner2007\] eq. (2.2).
    GaussHermite,
    /// Composite midpoint rule.
    Midpoint,
    /// Linear finite elements, whole hats at the ends, integrals over the whole line.
    Elements,
    /// Linear finite elements, half hats at the ends, integrals over the numerical domain: a finite bar (remark 1).
    HalfHats,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 4] = [
        Self::GaussHermite,
        Self::Midpoint,
        Self::Elements,
        Self::HalfHats,
    ];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::GaussHermite => "Gauss-Hermite",
            Self::Midpoint => "midpoint",
            Self::Elements => "finite elements",
            Self::HalfHats => "finite elements, half hats",
        }
    }
}

/// `M η̈ + K η = 0` with its eigenvectors.
#[derive(Clone, Debug)]
pub struct Bar {
    /// Positions.
    pub x: Vec<f64>,
    /// Mass matrix.
    pub mass: DMatrix<f64>,
    /// Stiffness matrix.
    pub stiffness: DMatrix<f64>,
    /// Mass-orthonormal modes, and their frequencies.
    modes: DMatrix<f64>,
    frequency: Vec<f64>,
}

impl Bar {
    /// The bar of `N + 1 = n` points; `None` if its mass matrix is not positive definite.
    ///
    /// Midpoint rule and elements have the domain of the Gauss–Hermite rule: their outermost nodes are its outermost nodes.
    pub fn new(method: Method, n: usize) -> Option<Self> {
        let (points, weights) = gauss_hermite(n);
        let h = 2.0 * points[n - 1] / (n - 1) as f64;
        let even: Vec<f64> = (0..n)
            .map(|i| (i as f64 - 0.5 * (n - 1) as f64) * h)
            .collect();
        let (x, mass, stiffness) = match method {
            Method::GaussHermite => {
                let (mass, stiffness) = quadrature(&points, &weights);
                (points, mass, stiffness)
            }
            Method::Midpoint => {
                let (mass, stiffness) = quadrature(&even, &vec![h; n]);
                (even, mass, stiffness)
            }
            Method::Elements | Method::HalfHats => {
                let (mass, stiffness) = elements(&even, h, method);
                (even, mass, stiffness)
            }
        };
        let lower = Cholesky::new(mass.clone())?.l();
        let half = lower.solve_lower_triangular(&stiffness)?;
        let standard = lower.solve_lower_triangular(&half.transpose())?;
        let eigen = SymmetricEigen::new(0.5 * (&standard + standard.transpose()));
        let modes = lower
            .transpose()
            .solve_upper_triangular(&eigen.eigenvectors)?;
        let frequency = eigen
            .eigenvalues
            .iter()
            .map(|e| e.max(0.0).sqrt())
            .collect();
        Some(Self {
            x,
            mass,
            stiffness,
            modes,
            frequency,
        })
    }

    /// Displacement and velocity at a time, from the initial displacement at the nodes.
    pub fn at(&self, tau: f64) -> (DVector<f64>, DVector<f64>) {
        let start = DVector::from_iterator(self.x.len(), self.x.iter().map(|&x| initial(x)));
        let amplitude = self.modes.transpose() * &self.mass * start;
        let (mut u, mut v) = (amplitude.clone(), amplitude);
        for (k, &w) in self.frequency.iter().enumerate() {
            u[k] *= (w * tau).cos();
            v[k] *= -w * (w * tau).sin();
        }
        (&self.modes * u, &self.modes * v)
    }

    /// Kinetic and elastic energy, \[EmmrichWeckner2007\] eq. (2.3).
    pub fn energies(&self, tau: f64) -> (f64, f64) {
        let (u, v) = self.at(tau);
        (
            0.5 * v.dot(&(&self.mass * &v)),
            0.5 * u.dot(&(&self.stiffness * &u)),
        )
    }

    /// L2 norm of the error at the nodes, by the mass matrix.
    pub fn error(&self, tau: f64) -> f64 {
        let e = self.miss(tau);
        e.dot(&(&self.mass * &e)).max(0.0).sqrt()
    }

    fn miss(&self, tau: f64) -> DVector<f64> {
        let exact = self.x.iter().map(|&x| exact(x, tau, LAMBDA));
        self.at(tau).0 - DVector::from_iterator(self.x.len(), exact)
    }

    /// Largest error at a node.
    pub fn largest_error(&self, tau: f64) -> f64 {
        self.miss(tau).amax()
    }

    /// L2 norm of the error of the function that is linear between nodes.
    pub fn error_between(&self, tau: f64) -> f64 {
        let u = self.at(tau).0;
        let mut sum = 0.0;
        for i in 1..self.x.len() {
            let (a, b) = (self.x[i - 1], self.x[i]);
            for (s, w) in LEGENDRE {
                let t = 0.5 * (1.0 + s);
                let value = u[i - 1] * (1.0 - t) + u[i] * t;
                sum += 0.5 * w * (b - a) * (value - exact(a + t * (b - a), tau, LAMBDA)).powi(2);
            }
        }
        sum.sqrt()
    }

    /// Largest sum of a row of the stiffness: the force under a translation.
    pub fn largest_row_sum(&self) -> f64 {
        self.stiffness.column_sum().amax()
    }
}

/// Gauss–Legendre rule of 6 points on (−1, 1).
const LEGENDRE: [(f64, f64); 6] = [
    (-0.932_469_514_203_152, 0.171_324_492_379_170_4),
    (-0.661_209_386_466_264_5, 0.360_761_573_048_138_6),
    (-0.238_619_186_083_196_9, 0.467_913_934_572_691),
    (0.238_619_186_083_196_9, 0.467_913_934_572_691),
    (0.661_209_386_466_264_5, 0.360_761_573_048_138_6),
    (0.932_469_514_203_152, 0.171_324_492_379_170_4),
];

fn quadrature(x: &[f64], weight: &[f64]) -> (DMatrix<f64>, DMatrix<f64>) {
    let n = x.len();
    let mass = DMatrix::from_diagonal(&DVector::from_column_slice(weight));
    let mut stiffness = DMatrix::from_fn(n, n, |i, j| {
        if i == j {
            0.0
        } else {
            -weight[i] * weight[j] * micromodulus(x[j] - x[i], LAMBDA)
        }
    });
    for i in 0..n {
        stiffness[(i, i)] = -stiffness.row(i).sum();
    }
    (mass, stiffness)
}

/// Mass and stiffness of linear hats on equal elements; pairs of elements by Gauss–Legendre, which both halves of the kernel share.
fn elements(x: &[f64], h: f64, method: Method) -> (DMatrix<f64>, DMatrix<f64>) {
    let n = x.len();
    // node −1 and node n carry no unknown: the outer halves of whole hats fall towards them
    let cells: Vec<[Option<usize>; 2]> = match method {
        Method::HalfHats => (0..n - 1).map(|i| [Some(i), Some(i + 1)]).collect(),
        _ => (0..=n)
            .map(|i| [i.checked_sub(1), (i < n).then_some(i)])
            .collect(),
    };
    let hat = |k: usize, s: f64| {
        let t = 0.5 * (1.0 + s);
        if k == 0 { 1.0 - t } else { t }
    };
    let mut mass = DMatrix::zeros(n, n);
    let mut stiffness = DMatrix::zeros(n, n);
    for (e, cell) in cells.iter().enumerate() {
        for (a, &i) in cell.iter().enumerate() {
            for (b, &j) in cell.iter().enumerate() {
                if let (Some(i), Some(j)) = (i, j) {
                    mass[(i, j)] += if a == b { h / 3.0 } else { h / 6.0 };
                }
            }
        }
        // ½ ∫∫ (g_j(x̂) − g_j(x)) C (g_i(x̂) − g_i(x)) is ∫ g_i g_j P − ∫∫ g_i(x) C g_j(x̂), with P the integral of C over the domain
        for (other, far) in cells.iter().enumerate() {
            let distance = (other as f64 - e as f64) * h;
            for (s, ws) in LEGENDRE {
                for (t, wt) in LEGENDRE {
                    let c =
                        0.25 * h * h * ws * wt * micromodulus(distance + 0.5 * h * (t - s), LAMBDA);
                    for (a, &i) in cell.iter().enumerate() {
                        let Some(i) = i else { continue };
                        for (b, &j) in far.iter().enumerate() {
                            if let Some(j) = j {
                                stiffness[(i, j)] -= c * hat(a, s) * hat(b, t);
                            }
                        }
                        if method == Method::HalfHats {
                            for (b, &j) in cell.iter().enumerate() {
                                if let Some(j) = j {
                                    stiffness[(i, j)] += c * hat(a, s) * hat(b, s);
                                }
                            }
                        }
                    }
                }
            }
        }
    }
    if method == Method::Elements {
        // over the whole line P is the same everywhere
        stiffness += &mass * (4.0 / (LAMBDA * LAMBDA));
    }
    (mass, stiffness)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_hermite_integrates_powers_exactly() {
        for n in [3, 25, 99] {
            let (x, w) = gauss_hermite(n);
            // ∫ x^(2k) exp(−x²) = Γ(k + 1/2)
            let mut exact = PI.sqrt();
            for k in 0..n.min(8) {
                let sum: f64 = x
                    .iter()
                    .zip(&w)
                    .map(|(x, w)| w * (-x * x).exp() * x.powi(2 * k as i32))
                    .sum();
                assert!((sum / exact - 1.0).abs() < 1e-12, "{n} {k}: {sum} {exact}");
                exact *= k as f64 + 0.5;
            }
        }
    }

    #[test]
    fn elements_have_the_energy_of_their_function() {
        // ½ uᵀ K u against the double integral of section 1 for one hat: ∫∫ ½·½ C (g(x̂) − g(x))²
        let bar = Bar::new(Method::Elements, 25).unwrap();
        let h = bar.x[1] - bar.x[0];
        let g = |x: f64| (1.0 - (x / h).abs()).max(0.0);
        let (step, reach) = (h / 40.0, 400);
        let mut sum = 0.0;
        for i in -reach..reach {
            for j in -reach..reach {
                let (x, y) = ((f64::from(i) + 0.5) * step, (f64::from(j) + 0.5) * step);
                sum += 0.5 * step * step * micromodulus(y - x, LAMBDA) * (g(y) - g(x)).powi(2);
            }
        }
        assert!((bar.stiffness[(12, 12)] / sum - 1.0).abs() < 2e-3, "{sum}");
    }

    #[test]
    fn printed_weights_are_ours() {
        // N = 2: roots 0, ±√1.5 of H_3; H_4 = 16x⁴ − 48x² + 12
        let (x, w) = gauss_hermite(3);
        for (x, w) in x.iter().zip(&w) {
            let h4 = 16.0 * x.powi(4) - 48.0 * x * x + 12.0;
            let printed = 2f64.powi(4) * 6.0 * PI.sqrt() / (h4 * h4);
            assert!((w * (-x * x).exp() - printed).abs() < 1e-13);
        }
    }
}
