//! Tangents against finite differences of energies that are written out independently, and the other conditions that every stiffness must satisfy.

use rayon::prelude::*;

use crate::{
    Effort,
    enclosed::{Case, Cells, Enclosed, INFLUENCE, Law, Method, Widths},
    fields::{Field, rotations, worst},
};
use bondline::{
    assembly::{self, Transfer},
    observe::report::{Columns, Table, TableRow},
    peridynamics::{
        CalibrationFields, Cloud, Ends, Factors, Families, Family, Influence, PdBody,
        TIE_TOLERANCE, position_aware_influence,
    },
    progress::Progress,
    system::BlockCsr,
    tensor::{Tensor, Tensor4, Vector, inverse, strain},
};

/// Largest relative difference between a tangent and the central difference of its energy, which is exact for a quadratic energy but for round-off.
pub const DIFFERENCE_LIMIT: f64 = 1e-9;

/// Largest relative violation of symmetry, rigid motion and momentum.
pub const BALANCE_LIMIT: f64 = 1e-12;

/// Points at random, with horizons that vary and some bonds cut: nothing about it is regular.
pub struct RandomCloud<const D: usize> {
    /// Positions \[m\].
    pub position: Vec<Vector<D>>,
    /// Volumes \[m^D\].
    pub volume: Vec<f64>,
    /// Horizons \[m\].
    pub horizon: Vec<f64>,
    /// Families, some of whose bonds are cut from both ends.
    pub families: Families,
}

/// A sequence of numbers in [−1, 1) (splitmix64).
pub struct Numbers(pub u64);

impl Numbers {
    /// The next number.
    pub fn draw(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

impl<const D: usize> RandomCloud<D> {
    /// A jittered block of points of spacing about 1.
    ///
    /// # Errors
    /// The message of the search for families.
    pub fn new(seed: u64) -> Result<Self, String> {
        let mut numbers = Numbers(seed);
        let side: usize = [0, 14, 6, 4][D];
        let mut position: Vec<Vector<D>> = Vec::new();
        let (mut volume, mut horizon) = (Vec::new(), Vec::new());
        for index in 0..side.pow(D as u32) {
            let mut rest = index;
            position.push(Vector::from_fn(|_, _| {
                let k = rest % side;
                rest /= side;
                k as f64 + 0.25 * numbers.draw()
            }));
            volume.push(1.0 + 0.3 * numbers.draw());
            horizon.push(2.4 + 0.3 * numbers.draw());
        }
        let mut families =
            Families::search(&position, &horizon, TIE_TOLERANCE).map_err(|e| e.to_string())?;
        // a sixth of the bonds, never between next neighbours, so that no family degenerates
        families.retain(|i, j| {
            let (low, high) = (i.min(j as usize), i.max(j as usize));
            (7 * low + 3 * high) % 6 != 0 || (position[low] - position[high]).norm() < 1.5
        });
        Ok(Self {
            position,
            volume,
            horizon,
            families,
        })
    }

    /// Its peridynamic body.
    ///
    /// # Errors
    /// The message of a family that cannot carry the law.
    pub fn body(&self, law: Law) -> Result<PdBody<D>, String> {
        let cloud = Cloud {
            position: self.position.clone(),
            volume: self.volume.clone(),
            horizon: bondline::peridynamics::Horizon::of_field(self.horizon.clone()),
            transfer: Transfer::from_rows(
                self.position.len(),
                (0..self.position.len() as u32).map(|s| vec![(s, 1.0)]),
            ),
            ..Cloud::default()
        };
        PdBody::new(
            cloud,
            self.families.clone(),
            law.law::<D>().linearised(),
            &Factors::Plain,
            Ends::Differ,
        )
        .map_err(|e| e.source.to_string())
    }

    /// The strain energy density of one family, from the papers' energies and not from force states.
    ///
    /// Bond-based: `¼ Σ λ (ξ·η)² V` [SAND2015-7998] eq. (3.1) (each end has half of a bond); LPS: `½ k θ² + ½ D(D+2) μ/m Σ ω e_d² V`, eq. (5.16); correspondence:
    /// `½ ε : C : ε` of `F̄ = Σ ω η⊗ξ V K⁻¹`, and `½ q Σ ω |η − F̄ ξ|² V`, `q = D(D+2) μ/tr K`.
    pub fn density(&self, law: Law, i: usize, u: &[f64]) -> f64 {
        let d = D as f64;
        let (lambda, mu) = law.lame::<D>();
        let horizon = self.horizon[i];
        let at = |i: usize| Vector::<D>::from_fn(|a, _| u[i * D + a]);
        let bonds: Vec<(Vector<D>, Vector<D>, f64)> = self
            .families
            .of(i)
            .iter()
            .map(|&j| {
                let j = j as usize;
                (
                    self.position[j] - self.position[i],
                    at(j) - at(i),
                    self.volume[j],
                )
            })
            .collect();
        match law {
            Law::BondBased(kernel) => {
                let c = kernel.constant::<D>(horizon, 3.0 * mu);
                0.25 * bonds
                    .iter()
                    .map(|(xi, eta, v)| {
                        c * kernel.shape(xi.norm(), horizon) * xi.dot(eta).powi(2) * v
                    })
                    .sum::<f64>()
            }
            Law::StateBased(w) => {
                let weighted = |f: &dyn Fn(&Vector<D>, &Vector<D>) -> f64| -> f64 {
                    bonds
                        .iter()
                        .map(|(xi, eta, v)| w.value(xi.norm(), horizon) * v * f(xi, eta))
                        .sum()
                };
                let m = weighted(&|xi, _| xi.norm_squared());
                // |ξ| e = ξ · η
                let theta = d / m * weighted(&|xi, eta| xi.dot(eta));
                let deviatoric =
                    weighted(&|xi, eta| (xi.dot(eta) / xi.norm() - theta * xi.norm() / d).powi(2));
                0.5 * (lambda + 2.0 * mu / d) * theta * theta
                    + 0.5 * d * (d + 2.0) * mu / m * deviatoric
            }
            Law::Correspondence(w) => {
                let (mut shape, mut g) = (Tensor::<D>::zeros(), Tensor::<D>::zeros());
                for (xi, eta, v) in &bonds {
                    let omega = w.value(xi.norm(), horizon) * v;
                    shape += xi * xi.transpose() * omega;
                    g += eta * xi.transpose() * omega;
                }
                let Some((k, _)) = inverse(&shape) else {
                    return f64::NAN;
                };
                let f = g * k;
                let e = strain(&f);
                let stress = Tensor4::<D>::isotropic(lambda, mu).contract(&e);
                let rest: f64 = bonds
                    .iter()
                    .map(|(xi, eta, v)| {
                        w.value(xi.norm(), horizon) * v * (eta - f * xi).norm_squared()
                    })
                    .sum();
                0.5 * stress.component_mul(&e).sum()
                    + 0.5 * d * (d + 2.0) * mu / shape.trace() * rest
            }
            Law::PositionAware(w) => position_aware_density(w, horizon, &bonds, (lambda, mu)),
        }
    }

    /// The energy of the whole cloud.
    pub fn energy(&self, law: Law, u: &[f64]) -> f64 {
        (0..self.position.len())
            .map(|i| self.volume[i] * self.density(law, i, u))
            .sum()
    }
}

/// `½ κ θ² + μ Σ σ ε² V` of bonds `(ξ, η, V)`.
fn position_aware_density<const D: usize>(
    influence: Influence,
    horizon: f64,
    bonds: &[(Vector<D>, Vector<D>, f64)],
    (lambda, mu): (f64, f64),
) -> f64 {
    let d = D as f64;
    let (vectors, volumes): (Vec<Vector<D>>, Vec<f64>) =
        bonds.iter().map(|(xi, _, v)| (*xi, *v)).unzip();
    let base: Vec<f64> = vectors
        .iter()
        .map(|xi| influence.value(xi.norm(), horizon))
        .collect();
    let family = Family {
        bonds: &vectors,
        volumes: &volumes,
        factors: &base,
        horizon,
        bond_horizons: &[],
        materials: None,
    };
    let fit = position_aware_influence::fit(&family, &base, CalibrationFields::Axes);
    let Ok(fit) = fit else {
        return f64::NAN;
    };
    let theta: f64 = (bonds.iter().zip(&fit.omega))
        .map(|((xi, eta, v), omega)| omega * xi.dot(eta) * v)
        .sum();
    let deviatoric: f64 = (bonds.iter().zip(&fit.sigma))
        .map(|((xi, eta, v), sigma)| {
            let r = xi.norm();
            sigma * (xi.dot(eta) / r - theta * r / d).powi(2) * v
        })
        .sum();
    0.5 * (lambda + 2.0 * mu / d) * theta * theta + mu * deviatoric
}

/// The stiffness of a body alone.
pub fn stiffness<const D: usize>(body: &PdBody<D>) -> BlockCsr {
    let sites = body.cloud.position.len();
    assembly::assemble_rows(
        sites,
        sites,
        |_| {},
        |site, row| body.add_force_row(site, |_| 1.0, row),
    )
}

/// Largest difference between `K u` and the central difference of the energy, over the largest force.
fn gradient_error<const D: usize>(cloud: &RandomCloud<D>, law: Law, k: &BlockCsr) -> f64 {
    let mut numbers = Numbers(3);
    let u: Vec<f64> = (0..k.dofs()).map(|_| numbers.draw()).collect();
    let force = k.multiply(&u);
    let largest = force.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
    (0..k.dofs())
        .into_par_iter()
        .map(|dof| {
            let energy = |s: f64| {
                let mut v = u.clone();
                v[dof] += s;
                cloud.energy(law, &v)
            };
            (0.5 * (energy(1.0) - energy(-1.0)) - force[dof]).abs() / largest
        })
        .collect::<Vec<_>>()
        .into_iter()
        .fold(0.0, worst)
}

/// Largest difference between the partial stress and the derivative of the energy density by a gradient that is added to the field, over the largest stress:
/// `ν^ps = ∂W/∂F`.
fn stress_error<const D: usize>(cloud: &RandomCloud<D>, law: Law, body: &PdBody<D>) -> f64 {
    let mut numbers = Numbers(4);
    let u: Vec<f64> = (0..cloud.position.len() * D)
        .map(|_| numbers.draw())
        .collect();
    let (mut error, mut largest) = (0.0, 0.0);
    for i in 0..cloud.position.len() {
        let stress = body.partial_stress(i, &u);
        largest = worst(largest, stress.amax());
        for a in 0..D {
            for b in 0..D {
                let density = |s: f64| {
                    let mut v = u.clone();
                    for (j, x) in cloud.position.iter().enumerate() {
                        v[j * D + a] += s * x[b];
                    }
                    cloud.density(law, i, &v)
                };
                let difference = 0.5 * (density(1.0) - density(-1.0));
                error = worst(error, (difference - stress[(a, b)]).abs());
            }
        }
    }
    error / largest
}

/// Largest entry of `K u` over that of `K` times that of `u`.
fn relative_force(k: &BlockCsr, u: &[f64]) -> f64 {
    let size = |v: &[f64]| v.iter().fold(0.0, |m: f64, x| worst(m, x.abs()));
    size(&k.multiply(u)) / (size(&k.values) * size(u))
}

/// Largest force under translations and infinitesimal rotations.
fn rigid_force<const D: usize>(k: &BlockCsr, places: &[Vector<D>]) -> f64 {
    let mut largest = 0.0;
    for a in 0..D {
        let u: Vec<f64> = (0..k.dofs())
            .map(|dof| f64::from(u8::from(dof % D == a)))
            .collect();
        largest = worst(largest, relative_force(k, &u));
    }
    for field in rotations::<D>() {
        largest = worst(largest, relative_force(k, &field.at(places)));
    }
    largest
}

/// Sum of the forces and of the moments under a random displacement, over the sums of their sizes.
pub fn momentum<const D: usize>(k: &BlockCsr, places: &[Vector<D>]) -> (f64, f64) {
    let mut numbers = Numbers(5);
    let u: Vec<f64> = (0..k.dofs()).map(|_| numbers.draw()).collect();
    out_of_balance(places, &k.multiply(&u))
}

/// Sum of forces at places, and of their moments about the origin, over the sums of their sizes.
pub fn out_of_balance<const D: usize>(places: &[Vector<D>], force: &[f64]) -> (f64, f64) {
    let mut sum = Vector::<D>::zeros();
    let mut moment = Tensor::<D>::zeros();
    let (mut forces, mut moments) = (0.0, f64::MIN_POSITIVE);
    for (x, f) in places.iter().zip(force.chunks(D)) {
        let f = Vector::<D>::from_fn(|a, _| f[a]);
        sum += f;
        moment += x * f.transpose() - f * x.transpose();
        forces += f.norm();
        moments += f.norm() * x.norm();
    }
    (sum.amax() / forces, moment.amax() / moments)
}

fn body_rows<const D: usize>(law: Law) -> Result<Vec<TableRow>, String> {
    let name = format!("{D}D {}, random cloud", law.name());
    let cloud = RandomCloud::<D>::new(11)?;
    let body = cloud.body(law)?;
    let k = stiffness(&body);
    let (linear, angular) = momentum(&k, &cloud.position);
    let row =
        |quantity: &str, value: f64, limit: f64| TableRow::at_most(&name, quantity, value, limit);
    Ok(vec![
        row(
            "stiffness less difference of energy",
            gradient_error(&cloud, law, &k),
            DIFFERENCE_LIMIT,
        ),
        row(
            "partial stress less difference of density",
            stress_error(&cloud, law, &body),
            DIFFERENCE_LIMIT,
        ),
        row("asymmetry", k.asymmetry(), BALANCE_LIMIT),
        row(
            "force under rigid motion",
            rigid_force(&k, &cloud.position),
            BALANCE_LIMIT,
        ),
        row("sum of forces", linear, BALANCE_LIMIT),
        row("sum of moments", angular, BALANCE_LIMIT),
    ])
}

fn small<const D: usize>(method: Method, law: Law, cells: Cells) -> Case {
    Case {
        method,
        law,
        cells,
        widths: crate::patch::widths::<D>(method, cells),
        ratio: if D == 3 { 2 } else { 3 },
    }
}

/// Returns true if a coupled stiffness has the same bits with one thread and with three.
fn thread_invariance<const D: usize>(case: &Case) -> Result<bool, String> {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| e.to_string())?;
        pool.install(|| Enclosed::<D>::new(case).map(|e| e.stiffness))
            .map_err(|e| e.to_string())
    };
    let (one, three) = (with(1)?, with(3)?);
    let bits = |k: &BlockCsr| k.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    Ok(one.row_offsets == three.row_offsets
        && one.columns == three.columns
        && bits(&one) == bits(&three))
}

fn coupled_rows<const D: usize>(method: Method, law: Law) -> Result<Vec<TableRow>, String> {
    let case = small::<D>(method, law, Cells::Coarse);
    let name = format!("{D}D {}, {}, coarse x3", method.name(), law.name());
    let same = thread_invariance::<D>(&case)?;
    Ok(vec![TableRow::at_most(
        name,
        "bits that differ between 1 and 3 threads",
        f64::from(u8::from(!same)),
        0.0,
    )])
}

/// Finite elements alone: the rows of nodes whose cells are all local, outside a splice.
fn local_rows<const D: usize>(cells: Cells) -> Result<Vec<TableRow>, String> {
    let case = Case {
        widths: Widths {
            nonlocal: 6,
            transition: 0,
            local: 6,
        },
        ..small::<D>(Method::Splice, Law::all::<D>()[0], cells)
    };
    let name = format!("{D}D finite elements, {}", cells.name());
    let e = Enclosed::<D>::local(&case).map_err(|e| e.to_string())?;
    let places: Vec<Vector<D>> = e.positions().copied().collect();
    let (linear, angular) = momentum(&e.stiffness, &places);
    // ½ u K u of an affine field is its energy density times the volume
    let mut numbers = Numbers(9);
    let g = Tensor::<D>::from_fn(|_, _| numbers.draw());
    let u = Field::Affine(g).at(&places);
    let energy: f64 = 0.5
        * e.stiffness
            .multiply(&u)
            .iter()
            .zip(&u)
            .map(|(f, u)| f * u)
            .sum::<f64>();
    let strain = strain(&g);
    let exact = 0.5
        * e.tensor.contract(&strain).component_mul(&strain).sum()
        * (2.0 * e.half).powi(D as i32);
    let row = |quantity: &str, value: f64| TableRow::at_most(&name, quantity, value, BALANCE_LIMIT);
    Ok(vec![
        row(
            "energy of an affine field, relative error",
            (energy / exact - 1.0).abs(),
        ),
        row("asymmetry", e.stiffness.asymmetry()),
        row(
            "force under rigid motion",
            rigid_force(&e.stiffness, &places),
        ),
        row("sum of forces", linear),
        row("sum of moments", angular),
    ])
}

/// The suite `tangents`.
pub fn tangents(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let mut bodies = Table::new(
        "Peridynamic bodies on a random cloud with varying horizons and cut bonds, finite elements alone",
        Columns::Full,
    );
    let mut threads = Table::new("Coupled stiffness by number of threads", Columns::Full);
    progress.stage("tangents", None);
    let add = |table: &mut Table, rows: Result<Vec<TableRow>, String>, what: &str| match rows {
        Ok(rows) => rows.into_iter().for_each(|row| table.push(row)),
        Err(why) => table.push(TableRow::info(what, "model", f64::NAN).because(why)),
    };
    for law in Law::all::<1>() {
        add(&mut bodies, body_rows::<1>(law), law.name());
    }
    for law in Law::all::<2>() {
        add(&mut bodies, body_rows::<2>(law), law.name());
        // a cloud at random in space has families without a position-aware solution
        if !matches!(law, Law::PositionAware(_)) {
            add(&mut bodies, body_rows::<3>(law), law.name());
        }
    }
    for cells in [Cells::Matching, Cells::Jittered, Cells::Simplices] {
        if cells != Cells::Simplices {
            add(&mut bodies, local_rows::<1>(cells), cells.name());
        }
        add(&mut bodies, local_rows::<2>(cells), cells.name());
        if effort == Effort::Full {
            add(&mut bodies, local_rows::<3>(cells), cells.name());
        }
    }
    for method in Method::ALL {
        if effort == Effort::Quick
            && method == Method::Blending(bondline::coupling::BlendingFunction::Linear)
        {
            continue;
        }
        add(
            &mut threads,
            coupled_rows::<2>(method, Law::StateBased(INFLUENCE)),
            method.name(),
        );
    }
    progress.finish();
    vec![bodies, threads]
}
