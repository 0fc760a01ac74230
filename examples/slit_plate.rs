//! The slit plate of SAND2015-7998 section 3.4: does a coupled plate give the answer of full peridynamics, and at what price?
//!
//! Every coupled model is solved with classical conditions on its outer edges. Full peridynamics has no such conditions: as in the report, its boundary
//! layer, one horizon thick, takes the coupled solution. Both are then compared on the lattice.
//!
//!     cargo run --release --example slit_plate                  h = 1/120, about a minute
//!     cargo run --release --example slit_plate -- --fine        and h = 1/480, horizon 6 h: some minutes and 9 GB
//!     cargo run --release --example slit_plate -- --json        rows for machines
//!     cargo run --release --example slit_plate -- --figures docs/figures

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    sync::Arc,
};

use bondline::{
    fem,
    model::{CellRole, Sampler, SiteKind},
    observe::{
        report::{Columns, Format, Table, TableRow, exit_code, render},
        summary::RunSummary,
    },
    progress::Progress,
    run::{AnyScene, PlacedScene, Solved},
    scene::{Condition, Field},
    tensor::{Vector, strain},
};
use bondline_study::field_plot::FieldMap;
use bondline_terminal::progress::TerminalProgress;

type Failure = Box<dyn std::error::Error>;
type Point = Vector<2>;

/// Half lengths of the slit.
const SLIT: [f64; 2] = [0.1, 1.0 / 120.0];

/// Displacements on the lattice of spacing 1/n over the whole plate; none in the slit.
#[derive(Clone)]
struct Lattice {
    n: usize,
    values: Arc<Vec<Option<Point>>>,
}

impl Lattice {
    fn of(solved: &Solved<'_, 2>, n: usize) -> Self {
        let sampler = Sampler::new(solved.model);
        let values = (0..(n + 1) * (n + 1))
            .map(|k| {
                let x = position(k % (n + 1), k / (n + 1), n);
                let in_slit = (0..2).all(|a| x[a].abs() < SLIT[a] - 1e-9);
                if in_slit {
                    None
                } else {
                    sampler.displacement(&x, solved.displacement)
                }
            })
            .collect();
        Self {
            n,
            values: Arc::new(values),
        }
    }

    fn at(&self, i: usize, j: usize) -> Option<Point> {
        self.values[j * (self.n + 1) + i]
    }

    /// ε_xx by central differences over 2h.
    fn strain_xx(&self, i: usize, j: usize) -> Option<f64> {
        let (left, right) = (
            self.at(i.checked_sub(1)?, j)?,
            if i < self.n {
                self.at(i + 1, j)?
            } else {
                return None;
            },
        );
        self.at(i, j)?;
        Some((right[0] - left[0]) * self.n as f64 / 2.0)
    }

    /// Returns the opening of the slit at its middle: displacement of the upper face relative to the lower.
    fn opening(&self) -> f64 {
        let (middle, half) = (self.n / 2, self.n / 120);
        let face = |j| self.at(middle, j).map_or(f64::NAN, |u| u[1]);
        face(middle + half) - face(middle - half)
    }
}

fn position(i: usize, j: usize, n: usize) -> Point {
    Point::new(i as f64 / n as f64 - 0.5, j as f64 / n as f64 - 0.5)
}

/// Relative L2 difference of two fields over the lattice.
fn difference(n: usize, norm: impl Fn(usize, usize) -> Option<(f64, f64)>) -> f64 {
    let (mut error, mut size) = (0.0, 0.0);
    for j in 0..=n {
        for i in 0..=n {
            if let Some((e, s)) = norm(i, j) {
                error += e;
                size += s;
            }
        }
    }
    (error / size).sqrt()
}

struct Case {
    lattice: Lattice,
    summary: RunSummary,
}

impl Case {
    /// Seconds to the solution, output apart.
    fn seconds(&self) -> f64 {
        self.summary.timings.total() - self.summary.timings.seconds("output")
    }
}

fn load(scene: &str, overrides: &[String]) -> Result<Box<PlacedScene<2>>, Failure> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .join("examples")
        .join(scene);
    match bondline_study::load(&path, overrides).map_err(|e| e.to_string())? {
        AnyScene::Plane(scene) => Ok(scene),
        _ => Err("the slit plate is a plane problem".into()),
    }
}

fn solve(
    scene: PlacedScene<2>,
    n: usize,
    progress: &dyn Progress,
    figure: Option<&Path>,
) -> Result<Case, Failure> {
    let mut lattice = None;
    let mut drawn = Ok(());
    let summary = bondline::run::solve_with(scene, progress, |output, solved| {
        lattice = Some(Lattice::of(solved, n));
        if let Some(path) = figure {
            drawn = draw(solved, path);
        }
        if output.vtu {
            bondline::run::write(output, solved)
        } else {
            Ok(Vec::new())
        }
    })?;
    drawn?;
    let lattice = lattice.ok_or("no solution")?;
    Ok(Case { lattice, summary })
}

/// Full peridynamics on the lattice, its boundary layer fed from a coupled solution.
fn full(
    n: usize,
    overrides: &[String],
    fed: &Lattice,
    progress: &dyn Progress,
) -> Result<Case, Failure> {
    let mut overrides = overrides.to_vec();
    overrides.extend(["coupling=nonlocal".into(), "output.vtu=false".into()]);
    let mut scene = load("slit_plate.toml", &overrides)?;
    let horizon = 6.0 / n as f64;
    let fed = fed.clone();
    let layer = Field::new(move |x: &Point| {
        let inner = 0.5 - horizon * (1.0 + 1e-9);
        if x.amax() <= inner {
            return None;
        }
        let index = |c: f64| ((c + 0.5) * fed.n as f64).round() as usize;
        fed.at(index(x[0]), index(x[1]))
    });
    scene.conditions = vec![Condition::field("boundary layer", layer)];
    solve(*scene, n, progress, None)
}

/// Rows of one coupled case against full peridynamics.
fn compare(table: &mut Table, name: &str, coupled: &Case, pd: &Case, limits: Option<[f64; 3]>) {
    let n = coupled.lattice.n;
    let (a, b) = (&coupled.lattice, &pd.lattice);
    let u = difference(n, |i, j| {
        let (p, q) = a.at(i, j).zip(b.at(i, j))?;
        Some(((p - q).norm_squared(), q.norm_squared()))
    });
    let e = difference(n, |i, j| {
        let (p, q) = a.strain_xx(i, j).zip(b.strain_xx(i, j))?;
        Some(((p - q).powi(2), q * q))
    });
    let opening = (a.opening() / b.opening() - 1.0).abs();
    let rows = [
        ("u, relative L2", u),
        ("eps_xx, relative L2", e),
        ("slit opening, relative", opening),
    ];
    for (k, (quantity, value)) in rows.into_iter().enumerate() {
        table.push(match limits {
            Some(limits) => TableRow::at_most(name, quantity, value, limits[k]),
            None => TableRow::info(name, quantity, value),
        });
    }
    // the seam's opposite sides cancel where the plate is symmetric; `verify balance` has one side alone
    table.push(TableRow::info(
        name,
        "out-of-balance force, relative",
        coupled.summary.out_of_balance_relative,
    ));
}

/// Rows of what a case costs.
fn costs(table: &mut Table, name: &str, case: &Case) {
    let s = &case.summary;
    table.push(TableRow::info(name, "bonds", s.sizes.bonds as f64));
    table.push(TableRow::info(name, "non-zeros", s.sizes.nonzeros as f64));
    for stage in ["sites and bonds", "assembly", "factorisation", "solve"] {
        table.push(TableRow::info(
            name,
            format!("{stage} [s]"),
            s.timings.seconds(stage),
        ));
    }
    table.push(TableRow::info(name, "total [s]", case.seconds()));
}

const METHODS: [(&str, &str); 7] = [
    ("blending, constant", "coupling.blending.beta=constant"),
    ("blending, linear", "coupling.blending.beta=linear"),
    ("blending, smooth", "coupling.blending.beta=smooth"),
    ("splice", "coupling=splice"),
    ("truncated", "coupling=truncated"),
    (
        "partial stress, elements",
        "coupling.partial-stress.form=elements",
    ),
    (
        "partial stress, meshfree",
        "coupling.partial-stress.form=meshfree",
    ),
];

/// Limits of relative L2 of u, of ε_xx, and of the slit opening for blending against full peridynamics.
const LIMITS: [f64; 3] = [3e-4, 1.2e-2, 5e-3];

/// The opening of the slit on a mesh of Gmsh against that on a generated one.
fn push_gmsh(accuracy: &mut Table, n: usize, progress: &dyn Progress) -> Result<(), Failure> {
    let gmsh = solve(
        *load("slit_plate_gmsh.toml", &["output.vtu=false".into()])?,
        n,
        progress,
        None,
    )?;
    let generated = solve(
        *load("slit_plate.toml", &["output.vtu=false".into()])?,
        n,
        progress,
        None,
    )?;
    accuracy.push(TableRow::at_most(
        "blending on the graded Gmsh mesh against the generated one",
        "slit opening, relative",
        (gmsh.lattice.opening() / generated.lattice.opening() - 1.0).abs(),
        1e-2,
    ));
    Ok(())
}

/// The plate with bonds across the slit left whole.
fn push_uncut(accuracy: &mut Table, n: usize, progress: &dyn Progress) -> Result<(), Failure> {
    let cut_opening = solve(
        *load("slit_plate.toml", &["output.vtu=false".into()])?,
        n,
        progress,
        None,
    )?
    .lattice
    .opening();
    let uncut: Vec<String> = vec![
        "peridynamics.surfaces=uncut".into(),
        "output.vtu=false".into(),
    ];
    let coupled = solve(*load("slit_plate.toml", &uncut)?, n, progress, None)?;
    let pd = full(n, &uncut[..1], &coupled.lattice, progress)?;
    compare(
        accuracy,
        "blending, constant, bonds across the slit uncut",
        &coupled,
        &pd,
        Some(LIMITS),
    );
    accuracy.push(TableRow::info(
        "bonds across the slit cut / uncut",
        "slit opening, ratio",
        cut_opening / coupled.lattice.opening(),
    ));
    Ok(())
}

/// Table 3.1 on one lattice: accuracy and cost of each method.
fn same_lattice(progress: &dyn Progress, figures: Option<&Path>) -> Result<Vec<Table>, Failure> {
    let n = 120;
    let mut accuracy = Table::new(
        "Slit plate, Table 3.1, against full peridynamics",
        Columns::ByQuantity,
    );
    let mut cost = Table::new("What they cost on the same lattice", Columns::ByQuantity);
    for (k, (name, choice)) in METHODS.iter().enumerate() {
        let figure = figures.filter(|_| k == 0).map(|f| f.join("slit_plate.svg"));
        let mut overrides = vec![(*choice).to_owned()];
        if k > 0 {
            overrides.push("output.vtu=false".into());
        }
        let coupled = solve(
            *load("slit_plate.toml", &overrides)?,
            n,
            progress,
            figure.as_deref(),
        )?;
        let pd = full(n, &[], &coupled.lattice, progress)?;
        compare(
            &mut accuracy,
            name,
            &coupled,
            &pd,
            name.starts_with("blending").then_some(LIMITS),
        );
        costs(&mut cost, name, &coupled);
        cost.push(TableRow::info(
            *name,
            "full PD / coupled, total",
            pd.seconds() / coupled.seconds(),
        ));
        if k == 0 {
            costs(&mut cost, "full PD", &pd);
        }
    }
    let sides = [
        "conditions.left.displacement={on=\"left\", x=\"5e-4*(y+0.5)\", y=\"5e-4*(y+0.5)\"}",
        "conditions.right.displacement={on=\"right\", x=\"5e-4*(y+0.5)\", y=\"5e-4*(y+0.5)\"}",
        "output.vtu=false",
    ]
    .map(String::from);
    let coupled = solve(*load("slit_plate.toml", &sides)?, n, progress, None)?;
    let pd = full(n, &[], &coupled.lattice, progress)?;
    compare(
        &mut accuracy,
        "blending, constant, edges prescribed",
        &coupled,
        &pd,
        Some(LIMITS),
    );
    push_uncut(&mut accuracy, n, progress)?;
    push_gmsh(&mut accuracy, n, progress)?;
    Ok(vec![accuracy, cost])
}

/// Keys of a mesh that is fine around the slit: one horizon of peridynamics, then cells that grow.
fn graded_overrides(n: usize, spacing: &[String]) -> Vec<String> {
    let (half_x, half_y) = (SLIT[0] + 6.0 / n as f64, SLIT[1] + 6.0 / n as f64);
    let axis = |half: f64| {
        format!(
            "{{graded={{fine=[{:?}, {half:?}], spacing=\"1/{n}\", growth=1.2, largest=0.03}}}}",
            -half
        )
    };
    let region = |half_x: f64, half_y: f64| {
        format!(
            "{{min=[{:?}, {:?}], max=[{half_x:?}, {half_y:?}]}}",
            -half_x, -half_y
        )
    };
    spacing[..2]
        .iter()
        .cloned()
        .chain([
            format!("mesh.rectangle.x={}", axis(half_x)),
            format!("mesh.rectangle.y={}", axis(half_y)),
            format!("zones.nonlocal.box={}", region(half_x, half_y)),
            format!(
                "zones.transition.box={}",
                region(half_x + 1.0 / n as f64, half_y + 1.0 / n as f64)
            ),
            "coupling=splice".into(),
            "output.vtu=false".into(),
        ])
        .collect()
}

/// Keys with a method of the solver.
fn best(overrides: &[String], method: &str) -> Vec<String> {
    overrides
        .iter()
        .cloned()
        .chain([format!("solver.method={method}")])
        .collect()
}

/// Finite elements that coarsen away from the slit: how much faster at what error.
///
/// Both are solved `rounds` times in turn.
fn graded(
    n: usize,
    least_ratio: f64,
    rounds: usize,
    progress: &dyn Progress,
) -> Result<Table, Failure> {
    let mut table = Table::new(
        format!("Finite elements graded away from the slit, h = 1/{n}, horizon 6 h"),
        Columns::ByQuantity,
    );
    let spacing = [
        format!("peridynamics.points.lattice.spacing=\"1/{n}\""),
        format!("peridynamics.horizon=\"6/{n}\""),
        format!("mesh.rectangle.x={{cells={n}}}"),
        format!("mesh.rectangle.y={{cells={n}}}"),
    ];
    let coupled = graded_overrides(n, &spacing);
    let both = || -> Result<_, Failure> {
        let a = solve(
            *load("slit_plate.toml", &best(&coupled, "direct"))?,
            n,
            progress,
            None,
        )?;
        let pd = full(n, &best(&spacing, "direct"), &a.lattice, progress)?;
        Ok((a, pd))
    };
    // in turn, and the least time of each: whatever else the machine does only adds to it
    let (mut a, mut pd) = both()?;
    for _ in 1..rounds {
        let (other_a, other_pd) = both()?;
        if other_a.seconds() < a.seconds() {
            a = other_a;
        }
        if other_pd.seconds() < pd.seconds() {
            pd = other_pd;
        }
    }
    compare(
        &mut table,
        "splice, direct",
        &a,
        &pd,
        Some([1e-3, f64::INFINITY, f64::INFINITY]),
    );
    costs(&mut table, "splice, direct", &a);
    costs(&mut table, "full PD, direct", &pd);
    table.push(TableRow::at_least(
        "splice, direct",
        "full PD / coupled, total",
        pd.seconds() / a.seconds(),
        least_ratio,
    ));
    table.push(TableRow::info(
        "splice, direct",
        "full PD / coupled, bonds",
        pd.summary.sizes.bonds as f64 / a.summary.sizes.bonds as f64,
    ));
    let mut totals = [a.seconds(), pd.seconds()];
    let krylov = solve(
        *load("slit_plate.toml", &best(&coupled, "krylov"))?,
        n,
        progress,
        None,
    )?;
    let krylov_pd = full(n, &best(&spacing, "krylov"), &a.lattice, progress)?;
    for (total, case) in totals.iter_mut().zip([&krylov, &krylov_pd]) {
        *total = total.min(case.seconds());
    }
    costs(&mut table, "splice, multigrid", &krylov);
    costs(&mut table, "full PD, multigrid", &krylov_pd);
    table.push(TableRow::info(
        "best solver of each",
        "full PD / coupled, total",
        totals[1] / totals[0],
    ));
    Ok(table)
}

/// ε_xx in finite elements and at peridynamic points.
fn draw(solved: &Solved<'_, 2>, path: &Path) -> Result<(), Failure> {
    let (model, u) = (solved.model, solved.displacement);
    let mut map = FieldMap {
        title: "Strain ε_xx, blending: squares are PD points".into(),
        label: "ε_xx".into(),
        range: Some((-6e-4, 6e-4)),
        cells: Vec::new(),
        points: Vec::new(),
        lines: Vec::new(),
    };
    for c in 0..model.mesh.cell_count() {
        if model.roles[c] == CellRole::Points {
            continue;
        }
        let nodes = model.mesh.cell(c);
        let gradient = fem::displacement_gradient_at_centre(&model.mesh, c, |n| {
            model.node_transfer.displacement::<2>(n, u)
        });
        let corners = nodes
            .iter()
            .map(|&n| model.mesh.nodes[n as usize].into())
            .collect();
        map.cells.push((corners, strain(&gradient)[(0, 0)]));
    }
    let h = model.spacing();
    let sampler = Sampler::new(model);
    for site in &model.sites {
        if !matches!(site.kind, SiteKind::Point(_)) {
            continue;
        }
        let x = site.position;
        let step = Point::new(h, 0.0);
        let in_slit = |x: &Point| (0..2).all(|a| x[a].abs() < SLIT[a] - 1e-9);
        let ends: Vec<(f64, Point)> = [-1.0, 0.0, 1.0]
            .iter()
            .filter(|&&s| !in_slit(&(x + step * s)))
            .filter_map(|&s| Some((s, sampler.displacement(&(x + step * s), u)?)))
            .collect();
        if let (Some(first), Some(last)) = (ends.first(), ends.last())
            && last.0 > first.0
        {
            map.points.push((
                x.into(),
                h,
                (last.1[0] - first.1[0]) / ((last.0 - first.0) * h),
            ));
        }
    }
    map.write(path)?;
    Ok(())
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |flag: &str| arguments.iter().any(|a| a == flag);
    let figures = arguments
        .iter()
        .position(|a| a == "--figures")
        .and_then(|k| arguments.get(k + 1))
        .map(PathBuf::from);
    let progress = TerminalProgress::on_stderr();
    let tables = same_lattice(&progress, figures.as_deref()).and_then(|mut tables| {
        tables.push(graded(120, 11.0, 3, &progress)?);
        if has("--fine") {
            tables.push(graded(480, 60.0, 1, &progress)?);
        }
        Ok(tables)
    });
    match tables {
        Ok(tables) => {
            let format = if has("--json") {
                Format::Json
            } else {
                Format::Text
            };
            println!("{}", render(&tables, format));
            ExitCode::from(exit_code(&tables))
        }
        Err(error) => {
            eprintln!("slit_plate: {error}");
            ExitCode::FAILURE
        }
    }
}
