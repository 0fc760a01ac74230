//! The patch test: affine fields through the seam of every method, law, dimension and kind of mesh.

pub mod bar;
pub mod influence;

use crate::enclosed::{
    Case, Cells, Enclosed, EnclosedError, Law, Method, SPACING, Widths, YOUNGS_MODULUS,
};
use crate::fields::{Field, affine_modes, monomials, worst};
use crate::{Effort, each};
use bondline::observe::report::{Columns, Table, TableRow};
use bondline::progress::{Progress, Silent};
use bondline::solve::FreeDofs;
use bondline::solve::direct::DirectParams;
use bondline::solve::direct::{Analysis, Factor};
use bondline::solve::krylov::LinearMap as _;
use bondline::solve::ordering::Ordering;
use bondline::solve::statics::SpreadRows;
use bondline::system::{RankRows, RankSolverKind, Ranks, Spread, Symmetry};
use bondline::tensor::{Tensor, Vector, padded};

/// Largest affine residual per volume, relative to `E |G|/h`, with elements aligned to the lattice.
pub const ALIGNED_LIMIT: f64 = 1e-11;

/// The same with jittered or simplicial elements.
pub const IRREGULAR_LIMIT: f64 = 1e-9;

/// Largest error of a solved affine field, relative to the largest displacement.
pub const SOLUTION_LIMIT: f64 = 1e-9;

/// Largest affine internal force per volume of the sites that are not on the outer boundary, relative to `E |G|/h`, over all gradients and rotations.
///
/// [SAND2015-7998] section 2.3 calls such a force a ghost force.
pub fn affine_residual<const D: usize>(enclosed: &Enclosed<D>) -> f64 {
    affine_residual_where(enclosed, |_| true)
}

/// The same over the sites at the places that `counts`.
pub fn affine_residual_where<const D: usize>(
    enclosed: &Enclosed<D>,
    counts: impl Fn(&Vector<D>) -> bool,
) -> f64 {
    let counts = |s: usize| counts(&enclosed.model.sites[s].position);
    affine_modes::<D>()
        .iter()
        .map(|mode| {
            let mut force = enclosed.stiffness.multiply(&mode.at(enclosed.positions()));
            for (s, f) in force.chunks_mut(D).enumerate() {
                if !counts(s) {
                    f.fill(0.0);
                }
            }
            largest_density(enclosed, &force, |_, _| 0.0) * SPACING / YOUNGS_MODULUS
        })
        .fold(0.0, worst)
}

/// Largest difference of the internal force per volume from `C ∇∇u` under quadratic fields, relative to `E` (fields of unit second derivative), over the
/// sites that are not on the outer boundary.
pub fn quadratic_residual<const D: usize>(enclosed: &Enclosed<D>) -> f64 {
    monomials::<D>(2)
        .iter()
        .map(|field| {
            let force = enclosed.stiffness.multiply(&field.at(enclosed.positions()));
            largest_density(enclosed, &force, |site, i| {
                -body_force(enclosed, field, &enclosed.model.sites[site].position, i)
            }) / YOUNGS_MODULUS
        })
        .fold(0.0, worst)
}

/// `C_ijkl ∂_j ∂_l u_k`.
fn body_force<const D: usize>(
    enclosed: &Enclosed<D>,
    field: &Field<D>,
    x: &Vector<D>,
    i: usize,
) -> f64 {
    let Field::Monomial { component, .. } = field else {
        return 0.0;
    };
    let second = field.second_derivatives(x);
    let mut sum = 0.0;
    for j in 0..D {
        for l in 0..D {
            sum += enclosed.tensor.get(i, j, *component, l) * second[(j, l)];
        }
    }
    sum
}

fn largest_density<const D: usize>(
    enclosed: &Enclosed<D>,
    force: &[f64],
    wanted: impl Fn(usize, usize) -> f64,
) -> f64 {
    let mut largest = 0.0;
    for s in (0..enclosed.model.sites.len()).filter(|&s| !enclosed.is_outer(s)) {
        let per_volume = enclosed.per_volume(s);
        for i in 0..D {
            largest = worst(
                largest,
                (force[s * D + i] * per_volume - wanted(s, i)).abs(),
            );
        }
    }
    largest
}

/// Largest error of the solution at any site, relative to the largest displacement, over all gradients and rotations; displacement is given on the outer boundary
/// and nowhere else.
///
/// # Errors
/// The solver's message if the system is singular.
pub fn solution_error<const D: usize>(enclosed: &Enclosed<D>) -> Result<f64, String> {
    let (k, held) = (&enclosed.stiffness, held(enclosed));
    let free = FreeDofs::from_prescribed(&held, D);
    let positions = places(enclosed);
    // one factorisation serves all modes
    let params = DirectParams::default();
    let (factor, _) = Analysis::new(k, &free, &positions, Ordering::default())
        .map_err(|e| e.to_string())
        .and_then(|analysis| {
            Factor::new(k, &free, analysis, &params, &Silent).map_err(|e| e.to_string())
        })?;
    Ok(error_of_solutions(
        enclosed,
        &held,
        |u| k.multiply(u),
        |residual| factor.solve(residual),
    ))
}

/// Collective: the same, by products with rows and a factorisation of which each process has its part.
///
/// # Errors
/// In words, if there are no factors.
///
/// # Panics
/// Of a block that one process assembled.
pub fn solution_error_on<const D: usize>(
    enclosed: &Enclosed<D>,
    ranks: &dyn Ranks,
) -> Result<f64, String> {
    let shared = enclosed.shared.as_ref().expect("rows of several processes");
    let (held, positions) = (held(enclosed), places(enclosed));
    let prescribed: Vec<bool> = held.iter().map(Option::is_some).collect();
    let rows = SpreadRows {
        matrix: &shared.own,
        spread: Spread {
            ranks,
            partition: &shared.partition,
        },
    };
    let mut solver = ranks.solver(
        RankRows {
            matrix: &shared.own,
            partition: &shared.partition,
            symmetry: Symmetry::Unsymmetric,
            positions: &positions,
            prescribed: &prescribed,
        },
        RankSolverKind::Direct,
    )?;
    let mut own = vec![0.0; shared.own.dofs()];
    Ok(error_of_solutions(
        enclosed,
        &held,
        |u| {
            let mut force = vec![0.0; u.len()];
            rows.apply_into(u, &mut force);
            force
        },
        |residual| {
            solver.solve_into(&rows.spread.take_own(residual), &mut own, 0.0, 1);
            let mut all = vec![0.0; residual.len()];
            rows.spread.gather_sites(&own, &mut all);
            all
        },
    ))
}

/// Zero where a displacement is given: on the outer boundary.
fn held<const D: usize>(enclosed: &Enclosed<D>) -> Vec<Option<f64>> {
    let dofs = 0..enclosed.model.sites.len() * D;
    let held = dofs.map(|dof| enclosed.is_outer(dof / D).then_some(0.0));
    held.collect()
}

fn places<const D: usize>(enclosed: &Enclosed<D>) -> Vec<[f64; 3]> {
    enclosed.positions().map(padded).collect()
}

/// The largest error over all modes, by products with the stiffness and by what solves a system with it.
fn error_of_solutions<const D: usize>(
    enclosed: &Enclosed<D>,
    held: &[Option<f64>],
    multiply: impl Fn(&[f64]) -> Vec<f64>,
    mut solve: impl FnMut(&[f64]) -> Vec<f64>,
) -> f64 {
    let mut error = 0.0;
    for mode in affine_modes::<D>() {
        let exact = mode.at(enclosed.positions());
        let mut u: Vec<f64> = held
            .iter()
            .zip(&exact)
            .map(|(held, &exact)| if held.is_some() { exact } else { 0.0 })
            .collect();
        // the second step refines the first
        for _ in 0..2 {
            let mut residual = multiply(&u);
            for (r, held) in residual.iter_mut().zip(held) {
                *r = if held.is_some() { 0.0 } else { -*r };
            }
            for (u, step) in u.iter_mut().zip(solve(&residual)) {
                *u += step;
            }
        }
        let size = exact.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        for (u, exact) in u.iter().zip(&exact) {
            error = worst(error, (u - exact).abs() / size);
        }
    }
    error
}

/// Sum of each block column of the stiffness, `Σ_i K_ij`: the force that the whole model exerts on itself when site `j` moves by 1.
///
/// It vanishes where a model conserves momentum, so it marks the seams; with the rows of the outer boundary included, nothing else.
pub fn column_sums<const D: usize>(enclosed: &Enclosed<D>) -> Vec<Tensor<D>> {
    let k = &enclosed.stiffness;
    let mut sums = vec![Tensor::zeros(); k.rows()];
    for i in 0..k.rows() {
        let (columns, blocks) = k.row(i);
        for (e, &c) in columns.iter().enumerate() {
            let block = &blocks[e * D * D..(e + 1) * D * D];
            sums[c as usize] += Tensor::from_fn(|a, b| block[a * D + b]);
        }
    }
    sums
}

/// Largest component of any column sum: the spurious force per unit displacement of a single site \[N/m per m^(3 − D)\].
pub fn spurious_force<const D: usize>(enclosed: &Enclosed<D>) -> f64 {
    column_sums(enclosed)
        .iter()
        .map(|c| c.amax())
        .fold(0.0, worst)
}

/// Sum of all internal forces along x that the half `x > 0` of the seam adds under `u = x^degree e_x`, by column sums.
pub fn out_of_balance<const D: usize>(enclosed: &Enclosed<D>, degree: u32) -> f64 {
    let mut powers = [0; D];
    powers[0] = degree;
    let field = Field::<D>::Monomial {
        component: 0,
        powers,
    };
    // internal force is −K u
    -column_sums(enclosed)
        .iter()
        .zip(enclosed.positions())
        .filter(|(_, x)| x[0] > 0.0)
        .map(|(c, x)| (c * field.value(x))[0])
        .sum::<f64>()
}

/// [`out_of_balance`] relative to the force that holds the field at the face `x = L` of the block.
pub fn relative_out_of_balance<const D: usize>(enclosed: &Enclosed<D>, degree: u32) -> f64 {
    let l = enclosed.half;
    let stress = enclosed.tensor.get(0, 0, 0, 0) * f64::from(degree) * l.powi(degree as i32 - 1);
    out_of_balance(enclosed, degree) / (stress * (2.0 * l).powi(D as i32 - 1))
}

/// Round-off of [`relative_out_of_balance`], at most: half a unit in the last place of each entry of the stiffness, times its displacement, all of one sign. A column of a seam in exact equilibrium sums to zero but for that, and at a place
/// `x` its share grows as `(x/h)²` against the force on a face, which does not know of the spacing.
pub fn round_off<const D: usize>(enclosed: &Enclosed<D>, degree: u32) -> f64 {
    let k = &enclosed.stiffness;
    let mut sizes = vec![0.0; k.rows()];
    for i in 0..k.rows() {
        let (columns, blocks) = k.row(i);
        for (e, &c) in columns.iter().enumerate() {
            let first = &blocks[e * D * D..][..D];
            sizes[c as usize] += first.iter().map(|b| b.abs()).sum::<f64>();
        }
    }
    let sum: f64 = sizes
        .iter()
        .zip(enclosed.positions())
        .filter(|(_, x)| x[0] > 0.0)
        .map(|(size, x)| size * x[0].powi(degree as i32))
        .sum();
    let l = enclosed.half;
    let stress = enclosed.tensor.get(0, 0, 0, 0) * f64::from(degree) * l.powi(degree as i32 - 1);
    0.5 * f64::EPSILON * sum / (stress * (2.0 * l).powi(D as i32 - 1))
}

/// The zones of a case: as narrow as the method's reach allows, so that the suite stays fast.
pub fn widths<const D: usize>(method: Method, cells: Cells) -> Widths {
    let (nonlocal, transition, local) = match (D, cells, method) {
        (1 | 2, ..) => (6, 6, 12),
        (_, Cells::Coarse, _) => (3, 3, 6),
        // the collar of a blending region takes whole cells, here up to two horizons
        (
            _,
            Cells::Jittered | Cells::Simplices,
            Method::Blending(_) | Method::Balanced | Method::BalancedOver(_),
        ) => (2, 2, 8),
        _ => (2, 2, 4),
    };
    // some have no use for a transition zone
    let transition = if !method.has_transition() {
        0
    } else {
        transition
    };
    Widths {
        nonlocal,
        transition,
        local,
    }
}

/// All cases of a dimension.
pub fn cases<const D: usize>(effort: Effort) -> Vec<Case> {
    let mut cases = Vec::new();
    for law in Law::all::<D>() {
        for method in Method::ALL {
            for kind in Cells::ALL {
                let wanted = match (effort, D) {
                    _ if D == 1 && kind == Cells::Simplices => false,
                    (Effort::Full, _) | (Effort::Quick, 1) => true,
                    (Effort::Quick, 2) => {
                        !matches!(kind, Cells::Jittered)
                            && method != Method::ALL[2]
                            && method != Method::ALL[5]
                    }
                    (Effort::Quick, _) => {
                        kind == Cells::Coarse
                            && method != Method::ALL[1]
                            && method != Method::ALL[2]
                            && method != Method::ALL[5]
                    }
                };
                if wanted && method.is_offered(law) {
                    cases.push(Case {
                        method,
                        law,
                        cells: kind,
                        widths: widths::<D>(method, kind),
                        ratio: if D == 3 { 2 } else { 3 },
                    });
                }
            }
        }
    }
    cases
}

/// The rows of one case.
fn rows<const D: usize>(case: &Case, ranks: Option<&dyn Ranks>) -> Vec<TableRow> {
    let name = format!(
        "{}, {}, {}",
        case.method.name(),
        case.law.name(),
        case.cells.name()
    );
    let limit = if case.cells.is_aligned() {
        ALIGNED_LIMIT
    } else {
        IRREGULAR_LIMIT
    };
    let enclosed = match Enclosed::<D>::on(case, ranks) {
        Ok(enclosed) => enclosed,
        Err(EnclosedError::Scene(e)) if e.is_seam() => {
            return vec![TableRow::refused(&name, "residual", e.to_string())];
        }
        Err(e) => {
            return ["residual", "solution error"]
                .map(|q| TableRow::at_most(&name, q, f64::NAN, limit).because(e.to_string()))
                .to_vec();
        }
    };
    let error = match ranks {
        None => solution_error(&enclosed),
        Some(ranks) => solution_error_on(&enclosed, ranks),
    };
    let error = match error {
        Ok(error) => TableRow::at_most(&name, "solution error", error, SOLUTION_LIMIT),
        Err(why) => {
            TableRow::at_most(&name, "solution error", f64::NAN, SOLUTION_LIMIT).because(why)
        }
    };
    vec![
        TableRow::at_most(&name, "residual", affine_residual(&enclosed), limit),
        error,
        TableRow::info(&name, "quadratic", quadratic_residual(&enclosed)),
        TableRow::info(&name, "cubic force", relative_out_of_balance(&enclosed, 3)),
        TableRow::info(
            &name,
            "quartic force",
            relative_out_of_balance(&enclosed, 4),
        ),
        TableRow::info(&name, "sites", enclosed.model.sites.len() as f64),
    ]
}

/// One table for a dimension; collective where there are several processes.
pub fn table<const D: usize>(
    effort: Effort,
    progress: &dyn Progress,
    ranks: Option<&dyn Ranks>,
) -> Table {
    let cases = cases::<D>(effort);
    let stage = format!("patch test, {D}D");
    progress.stage(&stage, Some(cases.len() as u64));
    let rows = each(ranks, &cases, |case| {
        let mut rows = rows::<D>(case, ranks);
        for row in &mut rows {
            row.case = format!("{D}D {}", row.case);
        }
        progress.advance(1);
        rows
    });
    let mut table = Table::new(
        format!(
            "Patch test in {D}D. residual: largest affine internal force per volume over E|G|/h; solution error: displacement given on the outer \
             boundary only, over the largest displacement; quadratic: force per volume less C:grad grad u, over E; cubic, quartic force: out-of-balance \
             force of half the seam over the force on a face"
        ),
        Columns::ByQuantity,
    );
    rows.into_iter().flatten().for_each(|row| table.push(row));
    table
}

/// The suite `patch`.
pub fn patch(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    patch_on(effort, progress, None)
}

/// The same; where there are several processes, by all of them, without what it has of bars and influence functions alone.
pub fn patch_on(effort: Effort, progress: &dyn Progress, ranks: Option<&dyn Ranks>) -> Vec<Table> {
    let mut tables = vec![
        table::<1>(effort, progress, ranks),
        table::<2>(effort, progress, ranks),
        table::<3>(effort, progress, ranks),
    ];
    if ranks.is_none() {
        tables.push(bar::table());
    }
    if effort == Effort::Full && ranks.is_none() {
        tables.push(influence::table(progress));
    }
    progress.finish();
    tables
}
