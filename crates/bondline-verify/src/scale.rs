//! Static solves at scale, through scenes: iterations against the size of the model, time against the direct solver, memory.

use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

use crate::Effort;
use bondline::observe::report::{Columns, Table, TableRow};
use bondline::observe::summary::{RunSummary, peak_memory_bytes};
use bondline::progress::Progress;
use bondline::run::AnyScene;
use bondline::run::solve_with;
use bondline::scene::Source;

/// Most iterations with 480² points over those with 120².
pub const GROWTH_LIMIT: f64 = 1.3;

/// Relative residual that every solution must reach.
pub const RESIDUAL_LIMIT: f64 = 1e-8;

/// Most memory of a whole run \[GB\].
pub const MEMORY_LIMIT: f64 = 5.0;

/// Factor by which an iterative solution must be faster than the direct solver.
pub const SPEED_LIMIT: f64 = 5.0;

/// A square or a block of finite elements and peridynamics, held on the left, pulled and sheared on the right.
#[derive(Clone, Copy, Debug)]
struct Case {
    dimension: usize,
    /// Cells, hence spacings, along each edge.
    cells: usize,
    /// m = δ/h.
    ratio: usize,
    coupling: &'static str,
    method: &'static str,
}

impl Case {
    fn name(&self) -> String {
        format!(
            "{}D {}, {}^{} cells, m = {}, {}",
            self.dimension, self.coupling, self.cells, self.dimension, self.ratio, self.method
        )
    }

    /// The scene; peridynamics everywhere, or in the middle quarter of the length.
    fn scene(&self) -> String {
        let Self {
            dimension: d,
            cells: n,
            ratio: m,
            coupling,
            method,
        } = *self;
        let list = |v: &str| vec![v; d].join(", ");
        let axes: String = ["x", "y", "z"][..d]
            .iter()
            .map(|a| format!("{a} = {{ cells = {n} }}\n"))
            .collect();
        let (kinematics, shape) = if d == 2 {
            ("plane-stress", "rectangle")
        } else {
            ("solid", "box")
        };
        // a lattice on the nodes where elements meet it, whole cells where nothing does
        let (points, box_low, box_high) = if coupling == "nonlocal" {
            ("points = \"cells\"".to_owned(), list("-1"), list("2"))
        } else {
            let rest = |v: &str| vec![v; d - 1].join(", ");
            (
                format!(
                    "points.lattice = {{ spacing = \"1/{n}\", origin = [{}] }}",
                    list("0")
                ),
                format!("0.375, {}", rest("-1")),
                format!("0.625, {}", rest("2")),
            )
        };
        let coupling = match coupling {
            "blending" => "[coupling.blending]\nbeta = \"smooth\"".to_owned(),
            "partial-stress" => "[coupling.partial-stress]\nform = \"meshfree\"".to_owned(),
            other => format!("[coupling.{other}]"),
        };
        let transition = if coupling.contains('=') {
            format!(
                "[zones.transition]\nbox = {{ min = [0.25, {0}], max = [0.75, {1}] }}",
                vec!["-1"; d - 1].join(", "),
                vec!["2"; d - 1].join(", ")
            )
        } else {
            String::new()
        };
        let held = ["x = 0\n", "y = 0\n", "z = 0\n"][..d].concat();
        format!(
            "kinematics = \"{kinematics}\"\n[mesh.{shape}]\nmin = [{}]\nmax = [{}]\n{axes}\
             [materials.body.bond-based]\nyoungs-modulus = 1.0\nmicromodulus = \"inverse-distance\"\n\
             [peridynamics]\nhorizon = \"{m}/{n}\"\n{points}\n\
             [zones.nonlocal]\nbox = {{ min = [{box_low}], max = [{box_high}] }}\n{transition}\n{coupling}\n\
             [conditions.left.displacement]\non = \"left\"\n{held}\
             [conditions.right.traction]\non = \"right\"\nx = 1.0\ny = 0.5\n\
             [solver]\nmethod = \"{method}\"\ntolerance = 1e-8\n",
            list("0"),
            list("1"),
        )
    }

    /// Runs the scene without writing files.
    fn run(&self, progress: &dyn Progress) -> Result<RunSummary, String> {
        forget_peak();
        let source = Source::new(self.name(), self.scene());
        let scene = bondline_study::from_source(&source, Path::new(""), "scale")
            .map_err(|e| e.to_string())?;
        let summary = match scene {
            AnyScene::Bar(s) => solve_with(*s, progress, |_, _| Ok(Vec::new())),
            AnyScene::Plane(s) => solve_with(*s, progress, |_, _| Ok(Vec::new())),
            AnyScene::Solid(s) => solve_with(*s, progress, |_, _| Ok(Vec::new())),
        };
        summary.map_err(|e| e.to_string())
    }
}

/// Lets the peak of this process start again from what it holds now, where the system allows it (Linux); else figures are upper bounds.
fn forget_peak() {
    // a figure that stays too large is the honest outcome of a failure
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

fn solver_seconds(run: &RunSummary) -> f64 {
    ["ordering", "factorisation", "solve"]
        .iter()
        .map(|s| run.timings.seconds(s))
        .sum()
}

fn gigabytes() -> f64 {
    peak_memory_bytes().map_or(f64::NAN, |b| b as f64 * 1e-9)
}

/// The rows of one solved case.
fn rows_of(case: &Case, run: &RunSummary, stages: &Stages<'_>) -> Vec<TableRow> {
    let name = case.name();
    let row = |quantity: &str, value: f64| TableRow::info(name.clone(), quantity, value);
    let mut rows = vec![
        row("unknowns", run.sizes.dofs as f64),
        row("iterations", run.iterations as f64),
        TableRow::at_most(
            name.clone(),
            "relative residual",
            run.residual,
            RESIDUAL_LIMIT,
        ),
        row("time of all stages [s]", run.total_seconds).because(stages.text()),
        row("time of the solver [s]", solver_seconds(run)),
    ];
    rows.push(TableRow::at_most(
        name.clone(),
        "peak memory of the process [GB]",
        gigabytes(),
        // a factorisation is there to be compared with
        if case.method == "direct" {
            f64::MAX
        } else {
            MEMORY_LIMIT
        },
    ));
    rows
}

/// Passes stages on and keeps their times.
struct Stages<'a> {
    inner: &'a dyn Progress,
    laps: Mutex<Vec<(String, Instant)>>,
}

impl<'a> Stages<'a> {
    fn new(inner: &'a dyn Progress) -> Self {
        Self {
            inner,
            laps: Mutex::new(Vec::new()),
        }
    }

    fn text(&self) -> String {
        let Ok(laps) = self.laps.lock() else {
            return String::new();
        };
        laps.windows(2)
            .filter(|w| !w[0].0.is_empty())
            .map(|w| format!("{} {:.2}", w[0].0, (w[1].1 - w[0].1).as_secs_f64()))
            .collect::<Vec<_>>()
            .join(", ")
    }

    fn lap(&self, name: &str) {
        if let Ok(mut laps) = self.laps.lock() {
            laps.push((name.to_owned(), Instant::now()));
        }
    }
}

impl Progress for Stages<'_> {
    fn stage(&self, name: &str, total: Option<u64>) {
        self.lap(name);
        self.inner.stage(name, total);
    }

    fn advance(&self, by: u64) {
        self.inner.advance(by);
    }

    fn finish(&self) {
        self.lap("");
        self.inner.finish();
    }
}

fn measured(case: Case, progress: &dyn Progress, rows: &mut Vec<TableRow>) -> Option<RunSummary> {
    let stages = Stages::new(progress);
    match case.run(&stages) {
        Ok(run) => {
            rows.extend(rows_of(&case, &run, &stages));
            Some(run)
        }
        Err(error) => {
            rows.push(TableRow::refused(case.name(), "iterations", error));
            None
        }
    }
}

fn table(title: &str, rows: Vec<TableRow>) -> Table {
    let mut table = Table::new(title, Columns::Full);
    table.rows = rows;
    table
}

/// The largest systems that can be factorised, solved directly too; `largest` are the cells of such a square and a block.
fn against_direct(
    iterative: Vec<(Case, f64)>,
    (square, block): (usize, usize),
    effort: Effort,
    progress: &dyn Progress,
) -> Table {
    let mut rows = Vec::new();
    for (case, seconds) in iterative {
        let largest = case.cells == square && case.ratio == 6
            || case.coupling == "splice" && case.cells == block;
        if !largest {
            continue;
        }
        let direct = Case {
            method: "direct",
            ..case
        };
        if let Some(run) = measured(direct, progress, &mut rows) {
            let ratio = solver_seconds(&run) / seconds;
            let quantity = "time of the direct solver over that of the iterative one";
            rows.push(match effort {
                // small systems are the direct solver's own ground
                Effort::Quick => TableRow::info(case.name(), quantity, ratio),
                Effort::Full => TableRow::at_least(case.name(), quantity, ratio, SPEED_LIMIT),
            });
        }
    }
    table("Against the direct solver", rows)
}

/// Runs the suite.
///
/// A fixed horizon δ on finer and finer lattices (m grows with the lattice), a fixed m, a coupled block of a million unknowns, and direct
/// solutions of the largest of them that fit. Quick: two fifths of each edge of the square, a fifth of the block's.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let (edges, block, factorised): ([usize; 3], usize, usize) = match effort {
        Effort::Quick => ([48, 96, 192], 14, 12),
        Effort::Full => ([120, 240, 480], 69, 29),
    };
    let square = Case {
        dimension: 2,
        cells: edges[0],
        ratio: 3,
        coupling: "nonlocal",
        method: "krylov",
    };
    let mut tables = Vec::new();
    let mut iterative = Vec::new();
    for (title, ratios) in [
        ("Full PD, fixed horizon: m = 3, 6, 12", [3, 6, 12]),
        ("Full PD, fixed m = 3", [3; 3]),
        ("Full PD, fixed m = 6", [6; 3]),
    ] {
        let mut rows = Vec::new();
        let mut iterations = Vec::new();
        for (&cells, ratio) in edges.iter().zip(ratios) {
            let case = Case {
                cells,
                ratio,
                ..square
            };
            if let Some(run) = measured(case, progress, &mut rows) {
                iterations.push(run.iterations as f64);
                iterative.push((case, solver_seconds(&run)));
            }
        }
        let growth = match iterations[..] {
            [first, .., last] => last / first,
            _ => f64::NAN,
        };
        rows.push(TableRow::at_most(
            title,
            "iterations of the finest over those of the coarsest",
            growth,
            GROWTH_LIMIT,
        ));
        tables.push(table(title, rows));
    }
    let mut rows = Vec::new();
    for (coupling, cells) in [
        ("splice", block),
        ("splice", factorised),
        ("blending", factorised),
        ("partial-stress", factorised),
    ] {
        let case = Case {
            dimension: 3,
            cells,
            coupling,
            ..square
        };
        if let Some(run) = measured(case, progress, &mut rows) {
            iterative.push((case, solver_seconds(&run)));
        }
    }
    tables.push(table("FE and PD coupled in a block, m = 3", rows));
    tables.push(against_direct(
        iterative,
        (edges[2], factorised),
        effort,
        progress,
    ));
    tables
}
