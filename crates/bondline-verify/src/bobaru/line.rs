//! A bar of nodes at any distances and with any horizons: composite midpoint rule, partial cells, free ends.
//!
//! Source: \[Bobaru2009\] eq. (25). Young's modulus, density and cross-section are 1. A node's cell reaches half-way to its neighbours and ends at
//! the node at a free end, as the seven-node system of section 2.3 has it; a bond counts the part of the cell that lies in the horizon, if the
//! horizon reaches the node itself.

use bondline::peridynamics::Micromodulus;

/// Horizons are reached within this part of themselves, so that a bond as long as the horizon does not depend on rounding.
const TIE: f64 = 1e-9;

/// Weights of the bonds of a family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weights {
    /// The volumes, as in the paper.
    Raw,
    /// The volumes times one factor per family, so that every family has Young's modulus 1.
    Normalised,
}

/// Micromodulus of a bond between two horizons.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sharing {
    /// That of the node whose force is summed: the paper's rule, and a splice of [SAND2015-7998] section 2.5. Exact for affine fields, not reciprocal.
    Source,
    /// The mean of those of both ends: forces are pairs, energy is conserved, affine fields leave a ghost force where the horizon changes.
    Mean,
}

/// Discretisation of a bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rule {
    /// Micromodulus: `InverseDistance`, `Triangular` and `Constant` are the paper's constant, triangular and inverted triangular one.
    pub micromodulus: Micromodulus,
    /// Weights of bonds.
    pub weights: Weights,
    /// Bonds between two horizons.
    pub sharing: Sharing,
}

/// Nodes and bonds of a bar; one row of weights per node.
#[derive(Clone, Debug)]
pub struct Line {
    /// Positions, rising.
    pub x: Vec<f64>,
    /// Lengths of the cells, which are also the masses.
    pub volume: Vec<f64>,
    offsets: Vec<usize>,
    ends: Vec<usize>,
    stiffness: Vec<f64>,
}

impl Line {
    /// The bar of nodes `x` (rising, at least two), of one horizon each.
    pub fn new(x: Vec<f64>, horizon: &[f64], rule: Rule) -> Self {
        let n = x.len();
        let mut faces = vec![x[0]];
        faces.extend(x.windows(2).map(|p| 0.5 * (p[0] + p[1])));
        faces.push(x[n - 1]);
        let volume: Vec<f64> = faces.windows(2).map(|f| f[1] - f[0]).collect();
        let mut line = Self {
            offsets: vec![0],
            ends: Vec::new(),
            stiffness: Vec::new(),
            x,
            volume,
        };
        for i in 0..n {
            let (delta, centre) = (horizon[i], line.x[i]);
            let reach = delta * (1.0 + TIE);
            let first = line.x.partition_point(|&p| p < centre - reach);
            let last = line.x.partition_point(|&p| p <= centre + reach);
            let scale = rule.micromodulus.constant::<1>(delta, 1.0);
            let begin = line.ends.len();
            let mut modulus = 0.0;
            for j in (first..last).filter(|&j| j != i) {
                let r = (line.x[j] - centre).abs();
                let covered = faces[j + 1].min(centre + delta) - faces[j].max(centre - delta);
                let k = scale * rule.micromodulus.shape(r, delta) * r * r * covered;
                modulus += 0.5 * k * r * r;
                line.ends.push(j);
                line.stiffness.push(k);
            }
            if rule.weights == Weights::Normalised {
                line.stiffness[begin..]
                    .iter_mut()
                    .for_each(|k| *k /= modulus);
            }
            line.offsets.push(line.ends.len());
        }
        match rule.sharing {
            Sharing::Source => line,
            Sharing::Mean => line.shared(),
        }
    }

    /// The same bar with the mean of both ends' bonds.
    fn shared(self) -> Self {
        let n = self.x.len();
        let mut rows: Vec<Vec<(usize, f64)>> = vec![Vec::new(); n];
        for i in 0..n {
            for (j, k) in self.bonds(i) {
                let half = 0.5 * k * self.volume[i];
                rows[i].push((j, half / self.volume[i]));
                rows[j].push((i, half / self.volume[j]));
            }
        }
        let mut line = Self {
            offsets: vec![0],
            ends: Vec::new(),
            stiffness: Vec::new(),
            ..self
        };
        for mut row in rows {
            row.sort_unstable_by_key(|b| b.0);
            row.dedup_by(|b, a| {
                let same = a.0 == b.0;
                if same {
                    a.1 += b.1;
                }
                same
            });
            for (j, k) in row {
                line.ends.push(j);
                line.stiffness.push(k);
            }
            line.offsets.push(line.ends.len());
        }
        line
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Returns true if there are no nodes, which [`Line::new`] never makes.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// The other ends and the weights of a node's bonds: its force density is `Σ k (u_j − u_i)`.
    pub fn bonds(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.offsets[i]..self.offsets[i + 1];
        self.ends[range.clone()]
            .iter()
            .copied()
            .zip(self.stiffness[range].iter().copied())
    }

    /// Overwrites `force` with the force density.
    pub fn force_into(&self, u: &[f64], force: &mut [f64]) {
        for i in 0..u.len() {
            let (ui, mut sum) = (u[i], 0.0);
            for b in self.offsets[i]..self.offsets[i + 1] {
                sum += self.stiffness[b] * (u[self.ends[b]] - ui);
            }
            force[i] = sum;
        }
    }

    /// Elastic energy density at each node, `¼ Σ k η²`.
    pub fn elastic(&self, u: &[f64]) -> Vec<f64> {
        (0..u.len())
            .map(|i| {
                let sum: f64 = self
                    .bonds(i)
                    .map(|(j, k)| k * (u[j] - u[i]) * (u[j] - u[i]))
                    .sum();
                0.25 * sum
            })
            .collect()
    }

    /// The matrix of the force density, row by row.
    pub fn dense(&self) -> nalgebra::DMatrix<f64> {
        let n = self.len();
        let mut matrix = nalgebra::DMatrix::zeros(n, n);
        for i in 0..n {
            for (j, k) in self.bonds(i) {
                matrix[(i, j)] += k;
                matrix[(i, i)] -= k;
            }
        }
        matrix
    }

    /// Displacement in equilibrium with a force density; where `prescribed` gives a displacement, that is it.
    ///
    /// Gauss elimination in a band, without exchanges: every row is that of an M-matrix. At least one node must be prescribed.
    pub fn equilibrium(&self, load: &[f64], prescribed: impl Fn(usize) -> Option<f64>) -> Vec<f64> {
        let n = self.len();
        let half = (0..n)
            .flat_map(|i| self.bonds(i).map(move |(j, _)| i.abs_diff(j)))
            .max()
            .unwrap_or(0);
        let width = 2 * half + 1;
        let mut band = vec![0.0; n * width];
        let mut u = load.to_vec();
        for i in 0..n {
            if let Some(value) = prescribed(i) {
                band[i * width + half] = 1.0;
                u[i] = value;
                continue;
            }
            for (j, k) in self.bonds(i) {
                band[i * width + half] += k;
                band[i * width + half + j - i] -= k;
            }
        }
        for p in 0..n {
            let (head, tail) = band.split_at_mut((p + 1) * width);
            let pivot = &head[p * width..];
            for i in p + 1..n.min(p + half + 1) {
                let row = &mut tail[(i - p - 1) * width..(i - p) * width];
                let at = half - (i - p);
                let factor = row[at] / pivot[half];
                if factor == 0.0 {
                    continue;
                }
                for q in 0..=half {
                    row[at + q] -= factor * pivot[half + q];
                }
                u[i] -= factor * u[p];
            }
        }
        for i in (0..n).rev() {
            let row = &band[i * width..(i + 1) * width];
            let mut sum = u[i];
            for q in 1..=half.min(n - 1 - i) {
                sum -= row[half + q] * u[i + q];
            }
            u[i] = sum / row[half];
        }
        u
    }

    /// A force density that adds up to `total` at `at`, shared by the two nodes about it so that its first moment is right too.
    pub fn add_point_load(&self, load: &mut [f64], at: f64, total: f64) {
        let (i, t) = self.locate(at);
        load[i] += total * (1.0 - t) / self.volume[i];
        load[i + 1] += total * t / self.volume[i + 1];
    }

    /// A nodal field at `at`, linear between nodes.
    pub fn value(&self, u: &[f64], at: f64) -> f64 {
        let (i, t) = self.locate(at);
        u[i] * (1.0 - t) + u[i + 1] * t
    }

    fn locate(&self, at: f64) -> (usize, f64) {
        let i = self
            .x
            .partition_point(|&p| p <= at)
            .clamp(1, self.len() - 1)
            - 1;
        let t = (at - self.x[i]) / (self.x[i + 1] - self.x[i]);
        // a node is met within rounding, so that what lies on it is not smeared
        let near = t.round();
        (i, if (t - near).abs() < TIE { near } else { t })
    }
}

/// Displacement and velocity of a bar.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Displacement.
    pub u: Vec<f64>,
    /// Velocity.
    pub v: Vec<f64>,
}

impl Motion {
    /// At rest with the displacement `field`.
    pub fn at_rest(line: &Line, field: impl Fn(f64) -> f64) -> Self {
        Self {
            u: line.x.iter().map(|&x| field(x)).collect(),
            v: vec![0.0; line.len()],
        }
    }

    /// One step of the classical Runge–Kutta method of order four.
    pub fn runge_kutta(&mut self, line: &Line, dt: f64, work: &mut RungeKutta) {
        let n = self.u.len();
        work.resize(n);
        let RungeKutta {
            at,
            rate,
            force,
            du,
            dv,
        } = work;
        du.copy_from_slice(&self.v);
        line.force_into(&self.u, dv);
        rate.copy_from_slice(&self.v);
        force.copy_from_slice(dv);
        for (step, weight) in [(0.5, 2.0), (0.5, 2.0), (1.0, 1.0)] {
            for i in 0..n {
                at[i] = self.u[i] + step * dt * rate[i];
                rate[i] = self.v[i] + step * dt * force[i];
            }
            line.force_into(at, force);
            for i in 0..n {
                du[i] += weight * rate[i];
                dv[i] += weight * force[i];
            }
        }
        for i in 0..n {
            self.u[i] += dt / 6.0 * du[i];
            self.v[i] += dt / 6.0 * dv[i];
        }
    }

    /// One step of velocity Verlet; `force` is that at the beginning, and becomes that at the end.
    pub fn verlet(&mut self, line: &Line, dt: f64, force: &mut [f64]) {
        for i in 0..self.u.len() {
            self.v[i] += 0.5 * dt * force[i];
            self.u[i] += dt * self.v[i];
        }
        line.force_into(&self.u, force);
        for (v, f) in self.v.iter_mut().zip(force) {
            *v += 0.5 * dt * *f;
        }
    }

    /// Elastic and kinetic energy density at each node.
    pub fn energy_density(&self, line: &Line) -> Vec<f64> {
        let mut density = line.elastic(&self.u);
        for (e, v) in density.iter_mut().zip(&self.v) {
            *e += 0.5 * v * v;
        }
        density
    }

    /// Elastic and kinetic energy together.
    pub fn energy(&self, line: &Line) -> f64 {
        let density = self.energy_density(line);
        density.iter().zip(&line.volume).map(|(e, v)| e * v).sum()
    }

    /// Momentum.
    pub fn momentum(&self, line: &Line) -> f64 {
        self.v.iter().zip(&line.volume).map(|(v, m)| v * m).sum()
    }
}

/// Arrays of [`Motion::runge_kutta`], kept between steps.
#[derive(Clone, Debug, Default)]
pub struct RungeKutta {
    at: Vec<f64>,
    rate: Vec<f64>,
    force: Vec<f64>,
    du: Vec<f64>,
    dv: Vec<f64>,
}

impl RungeKutta {
    fn resize(&mut self, n: usize) {
        for array in [
            &mut self.at,
            &mut self.rate,
            &mut self.force,
            &mut self.du,
            &mut self.dv,
        ] {
            array.resize(n, 0.0);
        }
    }
}
