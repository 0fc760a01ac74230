//! A bar of variable horizon as a continuum, by quadrature: forces and stresses of [SAND2015-7998] chapter 2 without a grid.

/// Displacement, horizon and nothing else: Young's modulus and cross-section are 1.
///
/// The reference material is bond-based, `T̂₁⟨n⟩ = 15/4 (1 − n²) (Y₁⟨n⟩ − n)`, whose collapsed stress is `u′`; other horizons follow (2.14).
#[derive(Clone, Copy)]
pub struct Continuum<'a> {
    /// `u(x)`.
    pub displacement: &'a dyn Fn(f64) -> f64,
    /// `δ(x)`, positive, of a slope below 1, smooth within two horizons of the points looked at.
    pub horizon: &'a dyn Fn(f64) -> f64,
    /// Gauss–Legendre rule on (−1, 1).
    pub rule: &'a [(f64, f64)],
}

impl Continuum<'_> {
    /// `T[x]⟨ξ⟩`, eq. (2.14) with D = 1.
    fn force_state(&self, x: f64, xi: f64) -> f64 {
        let delta = (self.horizon)(x);
        let n = xi / delta;
        if n.abs() >= 1.0 {
            return 0.0;
        }
        let stretch = (self.displacement)(x + xi) - (self.displacement)(x);
        3.75 * (1.0 - n * n) * stretch / delta.powi(3)
    }

    fn integral(&self, a: f64, b: f64, f: impl Fn(f64) -> f64) -> f64 {
        let (centre, half) = (0.5 * (a + b), 0.5 * (b - a));
        let sum: f64 = self
            .rule
            .iter()
            .map(|&(s, w)| w * f(centre + half * s))
            .sum();
        half * sum
    }

    /// The farthest point on the right (`side` 1) or left (−1) in whose family `x` is: `|q − x| = δ(q)`.
    fn seen_from(&self, x: f64, side: f64) -> f64 {
        // a contraction, since the slope of the horizon is below 1
        let mut distance = (self.horizon)(x);
        for _ in 0..200 {
            distance = (self.horizon)(x + side * distance);
        }
        x + side * distance
    }

    /// `L^pd`, eq. (2.5).
    pub fn force(&self, x: f64) -> f64 {
        let delta = (self.horizon)(x);
        let (left, right) = (self.seen_from(x, -1.0), self.seen_from(x, 1.0));
        let own = |xi: f64| self.force_state(x, xi);
        let others = |q: f64| self.force_state(q, x - q);
        self.integral(-delta, 0.0, own) + self.integral(0.0, delta, own)
            - self.integral(left, x, others)
            - self.integral(x, right, others)
    }

    /// `ν^pd`, eq. (2.8): the bonds that cross `x`.
    pub fn stress(&self, x: f64) -> f64 {
        let (left, right) = (self.seen_from(x, -1.0), self.seen_from(x, 1.0));
        let from_left = self.integral(left, x, |p| {
            let end = p + (self.horizon)(p);
            self.integral(x, end, |q| self.force_state(p, q - p))
        });
        let from_right = self.integral(x, right, |q| {
            let end = q - (self.horizon)(q);
            self.integral(end, x, |p| self.force_state(q, p - q))
        });
        from_left - from_right
    }

    /// `ν^ps`, eq. (2.19).
    pub fn partial_stress(&self, x: f64) -> f64 {
        let delta = (self.horizon)(x);
        let moment = |xi: f64| xi * self.force_state(x, xi);
        self.integral(-delta, 0.0, moment) + self.integral(0.0, delta, moment)
    }

    /// `L^ps`, eq. (2.20), by differences of order eight.
    pub fn partial_force(&self, x: f64) -> f64 {
        derivative(|x| self.partial_stress(x), x, 0.02)
    }
}

/// A first derivative by central differences of order eight.
pub fn derivative(f: impl Fn(f64) -> f64, x: f64, h: f64) -> f64 {
    const WEIGHTS: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
    let sum: f64 = WEIGHTS
        .iter()
        .enumerate()
        .map(|(k, w)| {
            let d = (k + 1) as f64 * h;
            w * (f(x + d) - f(x - d))
        })
        .sum();
    sum / h
}

/// Nodes and weights of the Gauss–Legendre rule of `n` points on (−1, 1), by Newton on the Legendre polynomial.
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = -(std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..10 {
                let (mut before, mut last) = (1.0, x);
                for k in 2..=n {
                    let k = k as f64;
                    (before, last) = (last, ((2.0 * k - 1.0) * x * last - (k - 1.0) * before) / k);
                }
                slope = n as f64 * (x * last - before) / (x * x - 1.0);
                x -= last / slope;
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}
