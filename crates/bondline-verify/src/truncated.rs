//! Truncated bonds, measured: symmetry, definiteness, affine fields, equilibrium, order in the horizon, and the savings by a symmetric matrix.

mod compared;
mod seam_conditions;
mod zones;

use std::time::Instant;

use rayon::prelude::*;

use crate::Effort;
use crate::enclosed::{
    self, Case, Cells, Enclosed, EnclosedError, INFLUENCE, Law, Method, Otherwise, SPACING, Widths,
};
use crate::meshes::scene;
use crate::patch::affine_residual_where;
use crate::tangents::momentum;
use crate::typed;
use bondline::fem;
use bondline::model::SiteKind;
use bondline::observe::report::{Columns, Table, TableRow};
use bondline::peridynamics::Micromodulus;
use bondline::progress::{Progress, Silent};
use bondline::solve::FreeDofs;
use bondline::solve::direct::{Analysis, Factor};
use bondline::solve::direct::{DirectError, DirectParams};
use bondline::solve::ordering::Ordering;
use bondline::solve::statics::{self, StaticParams, StaticProblem};
use bondline::system::Symmetry;
use bondline::tensor::{Vector, padded};

/// Largest `‖K − Kᵀ‖/‖K‖`.
pub const SYMMETRY_LIMIT: f64 = 1e-14;

/// Largest affine residual per volume, relative to `E |G|/h`.
pub const AFFINE_LIMIT: f64 = 1e-11;

/// Largest sum of forces over the sum of their sizes, and of moments.
pub const EQUILIBRIUM_LIMIT: f64 = 1e-12;

/// Least order in δ at fixed m on the last halving.
pub const ORDER: f64 = 2.0;

/// Tolerance of the order about [`ORDER`].
pub const ORDER_TOLERANCE: f64 = 0.15;

/// Poisson ratios of the LPS: at the value at which its state vanishes (1/4 in plane strain and solids), above, and below.
const POISSON: [f64; 7] = [0.25, 0.3, 0.4, 0.45, 0.49, 0.0, -0.25];

/// A pairwise law, or an LPS of some Poisson ratio (plane strain in 2D).
#[derive(Clone, Copy, Debug, PartialEq)]
enum Material {
    Pairwise(Micromodulus),
    Lps(f64),
}

impl Material {
    fn name(self) -> String {
        match self {
            Self::Pairwise(Micromodulus::InverseDistance) => "bond-based".to_owned(),
            Self::Pairwise(kernel) => format!("bond-based {kernel:?}").to_lowercase(),
            Self::Lps(nu) => format!("LPS nu = {nu}"),
        }
    }

    fn law(self) -> Law {
        match self {
            Self::Pairwise(kernel) => Law::BondBased(kernel),
            Self::Lps(_) => Law::StateBased(INFLUENCE),
        }
    }

    fn poisson_ratio(self) -> f64 {
        match self {
            Self::Pairwise(_) => enclosed::POISSON,
            Self::Lps(nu) => nu,
        }
    }

    /// A block of this material, by the case's coupling or the one that is typed.
    fn block<const D: usize>(
        self,
        case: &Case,
        coupling: Option<&str>,
        tables: &str,
    ) -> Result<Enclosed<D>, EnclosedError> {
        let case = Case {
            law: self.law(),
            ..*case
        };
        Enclosed::with(
            &case,
            &Otherwise {
                coupling,
                poisson_ratio: Some(self.poisson_ratio()),
                tables,
            },
        )
    }

    /// Returns true if the matrix has to be positive definite.
    fn is_definite(self) -> bool {
        !matches!(self, Self::Lps(nu) if nu < 0.25)
    }
}

fn block<const D: usize>(cells: Cells, nonlocal: u32, local: u32, ratio: u32) -> Case {
    Case {
        method: Method::Truncated,
        law: Law::BondBased(Micromodulus::InverseDistance),
        cells,
        widths: Widths {
            nonlocal,
            transition: 0,
            local,
        },
        ratio,
    }
}

/// The smallest eigenvalue over the largest diagonal entry, displacement held on the outer boundary; `None` if the matrix is not positive definite.
fn smallest_eigenvalue<const D: usize>(e: &Enclosed<D>) -> Result<Option<f64>, String> {
    let k = &e.stiffness;
    let held: Vec<Option<f64>> = (0..k.dofs())
        .map(|dof| e.is_outer(dof / D).then_some(0.0))
        .collect();
    let free = FreeDofs::from_prescribed(&held, D);
    let positions: Vec<[f64; 3]> = e.positions().map(padded).collect();
    let params = DirectParams {
        symmetry: Symmetry::Symmetric,
        ..DirectParams::default()
    };
    let analysis =
        Analysis::new(k, &free, &positions, Ordering::default()).map_err(|e| e.to_string())?;
    let factor = match Factor::new(k, &free, analysis, &params, &Silent) {
        Ok((factor, _)) => factor,
        Err(DirectError::NotPositive { .. }) => return Ok(None),
        Err(e) => return Err(e.to_string()),
    };
    // inverse iteration; the quotient is an upper bound that falls with every step
    let mut x: Vec<f64> = (0..k.dofs())
        .map(|dof| {
            if held[dof].is_some() {
                0.0
            } else {
                1.0 + 0.1 * (dof as f64).sin()
            }
        })
        .collect();
    let mut eigenvalue = f64::NAN;
    for _ in 0..12 {
        let y = factor.solve(&x);
        let (xy, yy): (f64, f64) = x
            .iter()
            .zip(&y)
            .fold((0.0, 0.0), |(a, b), (x, y)| (a + x * y, b + y * y));
        eigenvalue = xy / yy;
        let size = yy.sqrt();
        x = y.into_iter().map(|y| y / size).collect();
    }
    let mut largest = 0.0f64;
    for i in 0..k.rows() {
        let (columns, blocks) = k.row(i);
        if let Ok(d) = columns.binary_search(&(i as u32)) {
            for a in 0..D {
                largest = largest.max(blocks[d * D * D + a * D + a]);
            }
        }
    }
    Ok(Some(eigenvalue / largest))
}

fn property_rows<const D: usize>(case: &Case, material: Material) -> Vec<TableRow> {
    let name = format!(
        "{D}D {}, m = {}, {}, zone {} h",
        material.name(),
        case.ratio,
        case.cells.name(),
        2 * case.widths.nonlocal
    );
    let e = match material.block::<D>(case, None, "") {
        Ok(e) => e,
        Err(e) => {
            return vec![
                TableRow::at_most(name, "residual", f64::NAN, AFFINE_LIMIT).because(e.to_string()),
            ];
        }
    };
    rows_of(&name, &e, material, AFFINE_LIMIT, |_| true)
}

/// The rows of an assembled model; the affine residual of the places that `counts`.
fn rows_of<const D: usize>(
    name: &str,
    e: &Enclosed<D>,
    material: Material,
    limit: f64,
    counts: impl Fn(&Vector<D>) -> bool,
) -> Vec<TableRow> {
    let places: Vec<Vector<D>> = e.positions().copied().collect();
    let (forces, moments) = momentum(&e.stiffness, &places);
    let asymmetry = e.stiffness.asymmetry();
    let residual = affine_residual_where(e, counts);
    let mut rows = vec![
        TableRow::at_most(name, "asymmetry", asymmetry, SYMMETRY_LIMIT),
        TableRow::at_most(name, "residual", residual, limit),
        TableRow::at_most(name, "forces", forces, EQUILIBRIUM_LIMIT),
    ];
    if D > 1 {
        rows.push(TableRow::at_most(
            name,
            "moments",
            moments,
            EQUILIBRIUM_LIMIT,
        ));
    }
    rows.push(match (smallest_eigenvalue(e), material.is_definite()) {
        (Ok(Some(v)), _) => TableRow::at_least(name, "smallest eigenvalue", v, f64::MIN_POSITIVE),
        (Ok(None), true) => {
            TableRow::at_least(name, "smallest eigenvalue", f64::NAN, f64::MIN_POSITIVE)
                .because("not positive definite")
        }
        (Ok(None), false) => TableRow::info(name, "smallest eigenvalue", -1.0)
            .because("not positive definite: the LPS has a negative state modulus below nu = 1/4"),
        (Err(why), _) => {
            TableRow::at_least(name, "smallest eigenvalue", f64::NAN, f64::MIN_POSITIVE)
                .because(why)
        }
    });
    rows
}

fn properties<const D: usize>(effort: Effort, progress: &dyn Progress) -> Table {
    let mut cases: Vec<(Case, Material)> = Vec::new();
    let pairwise = Material::Pairwise(Micromodulus::InverseDistance);
    let full = effort == Effort::Full;
    let ratios: &[u32] = match (D, full) {
        (3, false) => &[2],
        (3, true) => &[2, 3],
        (_, false) => &[3],
        (_, true) => &[3, 4, 6],
    };
    for &ratio in ratios {
        for size in [1, 2, 4] {
            if D == 3 && ratio == 3 && size == 4 {
                continue;
            }
            let (nonlocal, local) = if D == 3 { (4, 4) } else { (8, 8) };
            let case = block::<D>(Cells::Aligned(size), nonlocal, local, ratio);
            cases.push((case, pairwise));
            cases.push((case, Material::Lps(0.3)));
        }
        // thinner than a horizon: bonds pass through
        let thin = block::<D>(Cells::Matching, 1, if D == 3 { 4 } else { 8 }, ratio);
        cases.push((thin, pairwise));
        cases.push((thin, Material::Lps(0.3)));
    }
    let (nonlocal, local) = if D == 3 { (3, 3) } else { (6, 6) };
    let usual = |ratio| block::<D>(Cells::Matching, nonlocal, local, ratio);
    if D > 1 {
        for nu in POISSON {
            cases.push((usual(ratios[0]), Material::Lps(nu)));
        }
    }
    if full {
        if D == 2 {
            cases.push((usual(6), Material::Lps(-0.25)));
        }
        for kernel in [
            Micromodulus::Constant,
            Micromodulus::Uniform,
            Micromodulus::Triangular,
        ] {
            cases.push((usual(ratios[0].max(3)), Material::Pairwise(kernel)));
        }
    }
    let stage = format!("truncated bonds, {D}D");
    progress.stage(&stage, Some(cases.len() as u64));
    let rows: Vec<Vec<TableRow>> = cases
        .par_iter()
        .map(|(case, material)| {
            let rows = property_rows::<D>(case, *material);
            progress.advance(1);
            rows
        })
        .collect();
    let mut table = Table::new(
        format!(
            "Truncated bonds in {D}D, a zone with corners inside of elements. asymmetry: |K - K^T|/|K|; residual: largest affine force per volume over E|G|/h; forces, moments: their sums \
             under a random displacement over the sums of their sizes; smallest eigenvalue over the largest diagonal entry, outer boundary held"
        ),
        Columns::ByQuantity,
    );
    rows.into_iter().flatten().for_each(|row| table.push(row));
    table
}

/// A smooth body force; `s` is the position over half of the block.
fn body_force<const D: usize>(s: &Vector<D>) -> Vector<D> {
    Vector::from_fn(|i, _| {
        let next = s[(i + 1) % D];
        (1.5 * s[i] + 0.4).cos() + 0.5 * (2.0 * next).sin()
    })
}

/// A solved block.
struct Solved {
    seconds: f64,
    /// Of the factorisation; zero for an iterative method.
    bytes: u64,
    method: &'static str,
}

/// Solves a block under the smooth body force, held on its outer boundary.
fn solve<const D: usize>(e: &Enclosed<D>, symmetry: Symmetry) -> Result<Solved, String> {
    let model = &e.model;
    let scaled = |x: &Vector<D>| body_force(&(x / e.half));
    let mut load = vec![0.0; e.stiffness.dofs()];
    let mut add = |site: u32, f: Vector<D>| {
        for a in 0..D {
            load[site as usize * D + a] += f[a];
        }
    };
    let mut site_of = vec![None; model.mesh.nodes.len()];
    for (s, site) in model.sites.iter().enumerate() {
        if let SiteKind::Node(n) = site.kind {
            site_of[n as usize] = Some(s as u32);
        }
    }
    for c in (0..model.mesh.cell_count()).filter(|&c| model.node_takes(c)) {
        for (n, f) in fem::body_force_vector(&model.mesh, c, scaled) {
            if let Some(site) = site_of[n as usize] {
                add(site, f);
            }
        }
    }
    for (s, site) in model.sites.iter().enumerate() {
        if matches!(site.kind, SiteKind::Point(_)) {
            add(s as u32, scaled(&site.position) * site.volume);
        }
    }
    let prescribed: Vec<Option<f64>> = (0..load.len())
        .map(|dof| e.is_outer(dof / D).then_some(0.0))
        .collect();
    let positions: Vec<[f64; 3]> = e.positions().map(padded).collect();
    let start = Instant::now();
    let solution = statics::solve(
        &StaticProblem {
            stiffness: &e.stiffness,
            symmetry,
            positions: &positions,
            load: &load,
            prescribed: &prescribed,
        },
        &StaticParams {
            tolerance: 1e-11,
            ..StaticParams::default()
        },
        &Silent,
    )
    .map_err(|e| e.to_string())?;
    Ok(Solved {
        seconds: start.elapsed().as_secs_f64(),
        bytes: solution.info.factor_bytes,
        method: solution.info.method.name(),
    })
}

/// The smooth body force of [`body_force`] and supports of the whole boundary, as a scene has them; `half` is half of the block \[m\].
fn loaded<const D: usize>(half: f64) -> String {
    const AXES: [&str; 3] = ["x", "y", "z"];
    const SIDES: [&str; 6] = ["left", "right", "bottom", "top", "back", "front"];
    let mut text = "[conditions.load.body-force]\n".to_owned();
    for i in 0..D {
        let (own, next) = (AXES[i], AXES[(i + 1) % D]);
        text +=
            &format!("{own} = \"cos(1.5*{own}/{half:?} + 0.4) + 0.5*sin(2*{next}/{half:?})\"\n");
    }
    for side in &SIDES[..2 * D] {
        text += &format!("[conditions.{side}.displacement]\non = \"{side}\"\n");
        for axis in &AXES[..D] {
            text += &format!("{axis} = 0\n");
        }
    }
    text
}

/// Relative root-mean-square difference from the solution of finite elements alone on the same mesh, over sites of the coupled scene.
fn difference<const D: usize>(case: &Case, material: Material) -> Result<f64, String> {
    let case = Case {
        law: material.law(),
        ..*case
    };
    let tables = loaded::<D>(f64::from(case.widths.total()) * SPACING);
    let text = |coupling| {
        let otherwise = Otherwise {
            coupling,
            poisson_ratio: Some(material.poisson_ratio()),
            tables: &tables,
        };
        case.text::<D>(&otherwise).replace(typed::FREE, "")
    };
    let mut places = Vec::new();
    let coupled = scene::samples(&text(None), &[], &[], &mut places)?;
    let local = scene::samples(&text(Some("\"local\"")), &[], &[], &mut places)?;
    let (mut error, mut norm) = (0.0, 0.0);
    for (u, v) in coupled.displacement.iter().zip(&local.displacement) {
        if let (Some(u), Some(v)) = (u, v) {
            error += u.iter().zip(v).map(|(u, v)| (u - v).powi(2)).sum::<f64>();
            norm += v.iter().map(|v| v * v).sum::<f64>();
        }
    }
    Ok((error / norm).sqrt())
}

fn order_rows<const D: usize>(table: &mut Table, effort: Effort, progress: &dyn Progress) {
    let (sizes, ratio): (&[u32], u32) = match (D, effort) {
        (1, _) => (&[16, 32, 64, 128], 3),
        (2, Effort::Full) => (&[12, 24, 48, 96], 3),
        (2, _) => (&[12, 24], 3),
        (_, Effort::Full) => (&[4, 8, 16], 2),
        _ => (&[4, 8], 2),
    };
    for material in [
        Material::Pairwise(Micromodulus::InverseDistance),
        Material::Lps(0.3),
        Material::Lps(0.49),
    ] {
        if D == 1 && material == Material::Lps(0.49) {
            continue;
        }
        for method in [Method::Truncated, Method::Splice] {
            progress.stage("order in the horizon", None);
            let errors: Vec<Result<f64, String>> = sizes
                .iter()
                .map(|&n| {
                    let case = Case {
                        method,
                        ..block::<D>(Cells::Matching, n / 2, n / 2, ratio)
                    };
                    difference::<D>(&case, material)
                })
                .collect();
            let name = format!("{D}D {}, m = {ratio}, {}", material.name(), method.name());
            for (n, error) in sizes.iter().zip(&errors) {
                let quantity = format!(
                    "difference, delta = L/{:.4}",
                    f64::from(*n) / f64::from(ratio)
                );
                table.push(match error {
                    Ok(v) => TableRow::info(&name, quantity, *v),
                    Err(why) => TableRow::info(&name, quantity, f64::NAN).because(why),
                });
            }
            if let [.., Ok(coarse), Ok(fine)] = errors.as_slice() {
                let order = (coarse / fine).log2();
                let quantity = "order on the last halving";
                table.push(if method == Method::Truncated && effort == Effort::Full {
                    TableRow::at_most(
                        &name,
                        "order on the last halving less 2",
                        (order - ORDER).abs(),
                        ORDER_TOLERANCE,
                    )
                } else {
                    TableRow::info(&name, quantity, order)
                });
            }
        }
    }
}

/// Order of the difference from finite elements alone, at fixed m.
pub fn orders(effort: Effort, progress: &dyn Progress) -> Table {
    let mut table = Table::new(
        "Difference from finite elements alone on the same mesh (relative root mean square), smooth body force, outer boundary held; half of the block is L = 1, half of the zone 1/2",
        Columns::Full,
    );
    order_rows::<1>(&mut table, effort, progress);
    order_rows::<2>(&mut table, effort, progress);
    order_rows::<3>(&mut table, effort, progress);
    table
}

fn saving_rows<const D: usize>(table: &mut Table, half: u32, ratio: u32) {
    for method in [Method::Truncated, Method::Splice] {
        let case = Case {
            method,
            ..block::<D>(Cells::Matching, half / 2, half - half / 2, ratio)
        };
        let start = Instant::now();
        let e = match Material::Lps(0.3).block::<D>(&case, None, "") {
            Ok(e) => e,
            Err(e) => {
                table.push(
                    TableRow::info(method.name(), "seconds", f64::NAN).because(e.to_string()),
                );
                continue;
            }
        };
        let built = start.elapsed().as_secs_f64();
        let paths: &[Symmetry] = match method {
            Method::Truncated => &[Symmetry::Symmetric, Symmetry::Unsymmetric],
            _ => &[Symmetry::Unsymmetric],
        };
        for &symmetry in paths {
            let name = format!(
                "{D}D LPS, m = {ratio}, {} unknowns, {}, {}",
                e.stiffness.dofs(),
                method.name(),
                symmetry.name()
            );
            match solve(&e, symmetry) {
                Ok(Solved {
                    seconds,
                    bytes,
                    method: used,
                    ..
                }) => {
                    table.push(TableRow::info(
                        &name,
                        "seconds to build and assemble",
                        built,
                    ));
                    table.push(TableRow::info(
                        &name,
                        format!("seconds to solve, {used}"),
                        seconds,
                    ));
                    table.push(TableRow::info(&name, "bytes of factors", bytes as f64));
                }
                Err(why) => table.push(TableRow::info(&name, "seconds", f64::NAN).because(why)),
            }
        }
    }
}

/// Time and memory of the symmetric path against the unsymmetric one.
pub fn savings(progress: &dyn Progress) -> Table {
    progress.stage("symmetric against unsymmetric path", None);
    let mut table = Table::new(
        "The same block by the symmetric and the unsymmetric path, and by a splice",
        Columns::Full,
    );
    saving_rows::<2>(&mut table, 120, 3);
    saving_rows::<3>(&mut table, 15, 2);
    table
}

/// The suite `seams`: truncated bonds beside the other methods, and where they cannot be.
pub fn seams(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let mut tables = compared::cracks(progress);
    tables.push(compared::waves(effort, progress));
    tables.push(zones::obstructions(effort, progress));
    progress.finish();
    tables
}

/// The suite `truncated`.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let mut tables = vec![
        properties::<1>(effort, progress),
        properties::<2>(effort, progress),
        properties::<3>(effort, progress),
        zones::table(effort, progress),
        orders(effort, progress),
    ];
    if effort == Effort::Full {
        tables.push(savings(progress));
    }
    progress.finish();
    tables
}
