//! A bar of two lattices between walls that mirror: its nodes, its bonds, and waves in it.
//!
//! Young's modulus, density and cross-section are 1. The middle has the wide horizon, the two ends the narrow one; the ratio of horizon to spacing is the
//! same everywhere. At both walls the displacement is odd, so that no family is cut and what comes back from a wall is the wave itself.

/// Length of the bar \[mm\]; source: the multi-horizon paper, section 3.
pub const LENGTH: f64 = 100.0;
/// Positions at which the horizon changes \[mm\]; the text shows it only in its figure 3. A bar that is all coarse has nodes there too.
pub const CHANGES: [f64; 2] = [24.0, 76.0];
/// Spacing of the ends \[mm\].
pub const FINE: f64 = 0.1;
/// m = δ/h on both sides; the text does not give it.
pub const RATIO: usize = 3;
/// Time step of all bars whose finest spacing is not below [`FINE`]; the speed of sound is 1.
const STEP: f64 = 0.05;
/// Positions agree within this.
const SAME: f64 = 1e-9;

/// Nodes of the bar and their images beyond the walls, rising.
#[derive(Clone, Debug)]
pub struct Layout {
    /// Positions.
    pub x: Vec<f64>,
    /// Lengths of the cells.
    pub volume: Vec<f64>,
    /// True for each node that has the wide horizon.
    pub wide: Vec<bool>,
    /// Spacing of the fine and of the coarse lattice.
    pub spacing: [f64; 2],
    /// Positions at which the spacing changes, images included.
    pub changes: Vec<f64>,
    step: f64,
    first: usize,
    count: usize,
}

impl Layout {
    /// A bar whose middle has `ratio` times the spacing of its ends, which is `fine`.
    pub fn new(ratio: usize, fine: f64) -> Self {
        let coarse = fine * ratio as f64;
        let [a, b] = CHANGES;
        let count = |length: f64, h: f64| (length / h).round() as usize;
        let mut inside: Vec<f64> = (0..count(a, fine)).map(|i| fine * i as f64).collect();
        inside.extend((0..=count(b - a, coarse)).map(|i| a + coarse * i as f64));
        inside.extend((1..=count(LENGTH - b, fine)).map(|i| b + fine * i as f64));
        Self::mirrored(&inside, [fine, coarse], |x| {
            (a - SAME..=b + SAME).contains(&x)
        })
    }

    /// A bar of one lattice.
    pub fn uniform(h: f64) -> Self {
        let count = (LENGTH / h).round() as usize;
        let inside: Vec<f64> = (0..=count).map(|i| h * i as f64).collect();
        Self::mirrored(&inside, [h, h], |_| false)
    }

    fn mirrored(inside: &[f64], spacing: [f64; 2], wide: impl Fn(f64) -> bool) -> Self {
        // a force on a node reaches over two families, and an image has whole families too
        let margin = 4.0 * spacing[1] * (RATIO + 1) as f64;
        let n = inside.len();
        let before = inside[1..].iter().take_while(|&&x| x < margin).count();
        let after = inside[..n - 1]
            .iter()
            .rev()
            .take_while(|&&x| x > LENGTH - margin)
            .count();
        let mut x: Vec<f64> = inside[1..=before].iter().rev().map(|x| -x).collect();
        x.extend(inside);
        x.extend(
            inside[n - 1 - after..n - 1]
                .iter()
                .rev()
                .map(|x| 2.0 * LENGTH - x),
        );
        let faces: Vec<f64> = x.windows(2).map(|p| 0.5 * (p[0] + p[1])).collect();
        let mut volume: Vec<f64> = faces.windows(2).map(|f| f[1] - f[0]).collect();
        volume.insert(0, x[1] - x[0]);
        volume.push(x[x.len() - 1] - x[x.len() - 2]);
        let changes = if spacing[0] == spacing[1] {
            Vec::new()
        } else {
            CHANGES.to_vec()
        };
        Self {
            wide: x.iter().map(|&x| wide(x)).collect(),
            x,
            volume,
            step: STEP.min(0.5 * spacing[0]),
            spacing,
            changes,
            first: before,
            count: n,
        }
    }

    /// Number of nodes, images included.
    pub fn count(&self) -> usize {
        self.x.len()
    }

    /// Spacing of the lattice that a node belongs to.
    pub fn spacing_of(&self, i: usize) -> f64 {
        self.spacing[usize::from(self.wide[i])]
    }

    /// Horizon of a node.
    pub fn horizon(&self, i: usize) -> f64 {
        RATIO as f64 * self.spacing_of(i)
    }

    /// The nodes within `reach` of node `i`, itself left out.
    pub fn within(&self, i: usize, reach: f64) -> impl Iterator<Item = usize> + '_ {
        let reach = reach * (1.0 + SAME);
        let from = self.x.partition_point(|&p| p < self.x[i] - reach);
        let to = self.x.partition_point(|&p| p <= self.x[i] + reach);
        (from..to).filter(move |&j| j != i)
    }

    /// The part of the cell of node `j` that a horizon about node `i` covers.
    pub fn covered(&self, i: usize, j: usize, horizon: f64) -> f64 {
        let face = |k: usize| {
            if k == 0 || k == self.count() {
                return self.x[k.min(self.count() - 1)];
            }
            0.5 * (self.x[k - 1] + self.x[k])
        };
        let (low, high) = (self.x[i] - horizon, self.x[i] + horizon);
        (face(j + 1).min(high) - face(j).max(low)).max(0.0)
    }

    /// The nodes, with weights, that a displacement at `p` follows: the node there, or the two beside it.
    pub fn at(&self, p: f64) -> Vec<(usize, f64)> {
        let k = self.x.partition_point(|&x| x < p - SAME);
        if k < self.count() && (self.x[k] - p).abs() <= SAME {
            return vec![(k, 1.0)];
        }
        let t = (p - self.x[k - 1]) / (self.x[k] - self.x[k - 1]);
        vec![(k - 1, 1.0 - t), (k, t)]
    }

    /// The distance from node `i` to the nearest change of spacing.
    pub fn to_change(&self, i: usize) -> f64 {
        let distance = |c: &f64| (c - self.x[i]).abs();
        self.changes
            .iter()
            .map(distance)
            .fold(f64::INFINITY, f64::min)
    }

    /// The bar whose node `i` (images included) feels the force `Σ k (u_j − u_i)` of the bonds `rows[i]`.
    pub fn bar(&self, rows: &[Vec<(usize, f64)>]) -> Bar {
        let last = self.first + self.count - 1;
        let home = |k: usize| match k {
            k if k < self.first => (self.first - k, -1.0),
            k if k > last => (2 * last - k - self.first, -1.0),
            k => (k - self.first, 1.0),
        };
        let mut bar = Bar {
            x: self.x[self.first..=last].to_vec(),
            volume: self.volume[self.first..=last].to_vec(),
            step: self.step,
            bonds: vec![Vec::new(); self.count],
        };
        for (i, bonds) in bar.bonds.iter_mut().enumerate() {
            let here = self.first + i;
            for &(j, k) in rows[here].iter().filter(|b| b.1 != 0.0) {
                let (end, sign) = home(j);
                bonds.push(Bond {
                    end,
                    sign,
                    stiffness: k,
                    length: self.x[j] - self.x[here],
                });
            }
        }
        bar
    }
}

/// Bond from a node to another one, directed.
#[derive(Clone, Copy, Debug)]
struct Bond {
    end: usize,
    sign: f64,
    stiffness: f64,
    length: f64,
}

/// Nodes with the bonds that pull at them, directed.
#[derive(Clone, Debug)]
pub struct Bar {
    /// Positions.
    pub x: Vec<f64>,
    /// Masses.
    pub volume: Vec<f64>,
    step: f64,
    bonds: Vec<Vec<Bond>>,
}

impl Bar {
    fn force_into(&self, u: &[f64], force: &mut [f64]) {
        for (i, bonds) in self.bonds.iter().enumerate() {
            let here = u[i];
            force[i] = bonds
                .iter()
                .map(|b| b.stiffness * (b.sign * u[b.end] - here))
                .sum();
        }
        // the walls hold their nodes
        force[0] = 0.0;
        force[u.len() - 1] = 0.0;
    }

    /// Largest force on a node under a uniform strain, in units of the stress that is there.
    pub fn ghost_force(&self) -> f64 {
        let force = |bonds: &Vec<Bond>| -> f64 {
            bonds
                .iter()
                .map(|b| b.stiffness * b.length)
                .sum::<f64>()
                .abs()
        };
        self.bonds.iter().map(force).fold(0.0, f64::max)
    }

    /// Sum of all forces under a pulse that crosses the first change of the horizon, over the sum of their magnitudes.
    pub fn out_of_balance(&self) -> f64 {
        let u: Vec<f64> = self
            .x
            .iter()
            .map(|x| (-((x - CHANGES[0] - 0.7) / 3.0).powi(2)).exp())
            .collect();
        let mut force = vec![0.0; u.len()];
        self.force_into(&u, &mut force);
        let size: f64 = force.iter().map(|f| f.abs()).sum();
        force.iter().sum::<f64>().abs() / size
    }

    /// Largest difference between what two nodes owe each other, over the largest stiffness.
    pub fn asymmetry(&self) -> f64 {
        let n = self.x.len();
        let mut pairs = std::collections::BTreeMap::new();
        for (i, bonds) in self.bonds.iter().enumerate() {
            for b in bonds.iter().filter(|b| b.end != i) {
                *pairs.entry((i, b.end)).or_insert(0.0) += b.sign * b.stiffness;
            }
        }
        let held = |i: usize| i == 0 || i == n - 1;
        let (mut differ, mut largest) = (0.0f64, 0.0f64);
        for (&(i, j), &k) in pairs.iter().filter(|((i, j), _)| !held(*i) && !held(*j)) {
            let back = pairs.get(&(j, i)).copied().unwrap_or(0.0);
            differ = differ.max((k - back).abs());
            largest = largest.max(k.abs());
        }
        differ / largest
    }

    /// Lets a state move for a time, by velocity Verlet.
    pub fn run(&self, state: &mut Wave, time: f64) {
        let step = self.step;
        let mut force = vec![0.0; state.u.len()];
        self.force_into(&state.u, &mut force);
        for _ in 0..(time / step).round() as usize {
            for i in 0..force.len() {
                state.v[i] += 0.5 * step * force[i] / self.volume[i];
                state.u[i] += step * state.v[i];
            }
            self.force_into(&state.u, &mut force);
            for i in 0..force.len() {
                state.v[i] += 0.5 * step * force[i] / self.volume[i];
            }
        }
    }
}

/// Displacement and velocity.
#[derive(Clone, Debug)]
pub struct Wave {
    /// Displacement.
    pub u: Vec<f64>,
    /// Velocity.
    pub v: Vec<f64>,
}

impl Wave {
    /// The paper's excitation: at rest, with the velocity `exp(−0.03 (x − 50)²)`, x in millimetres.
    pub fn excited(x: &[f64]) -> Self {
        Self {
            u: vec![0.0; x.len()],
            v: x.iter().map(|x| pulse(x - 0.5 * LENGTH, 1.0)).collect(),
        }
    }

    /// A displacement of the same shape, `narrow` times as narrow, on its way to larger x.
    pub fn moving(x: &[f64], centre: f64, narrow: f64) -> Self {
        let u: Vec<f64> = x.iter().map(|x| pulse(x - centre, narrow)).collect();
        // v = −u′
        let rate = 0.06 * narrow * narrow;
        let v = x.iter().zip(&u).map(|(x, u)| rate * (x - centre) * u);
        Self { v: v.collect(), u }
    }
}

/// The shape of the paper's excitation at a distance from its middle, `narrow` times as narrow.
pub fn pulse(x: f64, narrow: f64) -> f64 {
    (-0.03 * (narrow * x).powi(2)).exp()
}
