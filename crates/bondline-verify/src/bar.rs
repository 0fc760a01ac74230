//! The coupled bar under tension: finite elements, transition, peridynamics, transition, finite elements, held at its two ends only.
//!
//! Source: [SAND2015-7998] section 7.3, figures 7.7 and 7.8. The answer is the straight line `u_x = 10⁻³ x`. In one dimension, and in three with the
//! peridynamic zone enclosed sideways, every coupling gives it to round-off. With free sides it does not, because peridynamics is softer near a free
//! surface; the enclosed bar tells that from the seam.
//!
//! The bars are the scenes of the example `coupled_bar`.

use std::{fmt, path::Path};

use crate::Effort;
use bondline::model::{SiteKind, Zone};
use bondline::observe::ObserveError;
use bondline::observe::report::{Columns, Table, TableRow};
use bondline::observe::summary::RunSummary;
use bondline::progress::Progress;
use bondline::run::AnyScene;
use bondline::run::{RunError, Solved, solve_with};
use bondline::scene::{Scene, SceneError, Source};
use bondline_study::field_plot::FieldMap;
use bondline_study::line_plot::{LinePlot, Series, Stroke};

/// The scene of the bar in one dimension.
pub const SCENE_1D: &str = include_str!("../../../examples/coupled_bar.toml");
/// The scene of the bar in three dimensions, with free sides.
pub const SCENE_3D: &str = include_str!("../../../examples/coupled_bar_3d.toml");

/// `u_x/x` of the straight line, as the scenes have it.
pub const STRETCH: f64 = 1e-3;
/// Displacement at every site, relative to the largest, where the straight line must come out exactly.
pub const EXACT: f64 = 1e-9;
/// Plane means of the bar in three dimensions, relative to the largest displacement.
pub const PLANE_MEANS: f64 = 5e-3;

/// Enclosure of the peridynamic zone of the bar in three dimensions sideways: transition 2h and finite elements 4h thick
/// (two horizons, as a state-based law at the rim of a blending or meshfree region reaches that far).
pub const ENCLOSED: &[&str] = &[
    "mesh.box.min=[-0.020, -0.0085, -0.0085]",
    "mesh.box.max=[0.020, 0.0085, 0.0085]",
    "mesh.box.y.cells=17",
    "mesh.box.z.cells=17",
    "zones.nonlocal.box={ min = [-0.010, -0.0025, -0.0025], max = [0.010, 0.0025, 0.0025] }",
    "zones.transition.box={ min = [-0.014, -0.0045, -0.0045], max = [0.014, 0.0045, 0.0045] }",
];

/// A wider section, of which the layer near the free sides is a smaller part.
pub const WIDER: &[&str] = &[
    "mesh.box.min=[-0.020, -0.0105, -0.0105]",
    "mesh.box.max=[0.020, 0.0105, 0.0105]",
    "mesh.box.y.cells=21",
    "mesh.box.z.cells=21",
];

/// Every method, as overrides of a scene.
pub const METHODS: [(&str, &[&str]); 6] = [
    ("splice", &["coupling=splice"]),
    ("blending, constant", &["coupling.blending.beta=constant"]),
    ("blending, linear", &["coupling.blending.beta=linear"]),
    ("blending, smooth", &["coupling.blending.beta=smooth"]),
    (
        "partial stress, elements",
        &["coupling.partial-stress.form=elements"],
    ),
    (
        "partial stress, meshfree",
        &["coupling.partial-stress.form=meshfree"],
    ),
];

/// Failure of the solution of a bar.
#[derive(Debug)]
pub enum BarError {
    /// Its scene.
    Scene(Box<SceneError>),
    /// Its model or its system.
    Run(Box<RunError>),
}

impl fmt::Display for BarError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scene(e) => e.fmt(f),
            Self::Run(e) => e.fmt(f),
        }
    }
}

impl std::error::Error for BarError {}

impl From<SceneError> for BarError {
    fn from(e: SceneError) -> Self {
        Self::Scene(Box::new(e))
    }
}

impl From<RunError> for BarError {
    fn from(e: RunError) -> Self {
        Self::Run(Box::new(e))
    }
}

/// The sites of one model in one plane across the bar; displacements relative to the largest.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// Position along the bar \[m\].
    pub x: f64,
    /// Model of the sites.
    pub zone: Zone,
    /// Mean displacement along the bar, weighted by the sites' volumes.
    pub mean: f64,
    /// Mean deviation from the straight line.
    pub deviation: f64,
    /// Largest deviation.
    pub largest: f64,
}

/// A solved bar.
#[derive(Clone, Debug)]
pub struct Bar {
    /// Sizes, timings, balance.
    pub summary: RunSummary,
    /// Planes across it, by position.
    pub planes: Vec<Plane>,
    /// The layer in the middle of a bar in three dimensions: displacement along x of its cells and points \[m\]; empty in 1D.
    pub slice: FieldMap,
    /// Largest force along x with which an end is held, relative to `E A u′`; `None` if no end is held.
    pub pull: Option<f64>,
}

impl Bar {
    /// Largest plane mean of the deviation among the sites of some models.
    pub fn plane_means(&self, of: impl Fn(Zone) -> bool) -> f64 {
        largest(
            self.planes
                .iter()
                .filter(|p| of(p.zone))
                .map(|p| p.deviation),
        )
    }

    /// Largest deviation along the bar among the sites of some models.
    pub fn pointwise(&self, of: impl Fn(Zone) -> bool) -> f64 {
        largest(self.planes.iter().filter(|p| of(p.zone)).map(|p| p.largest))
    }
}

/// The largest size; NaN if any is.
fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |m: f64, v| if v.abs() <= m { m } else { v.abs() })
}

/// A scene from its text and overrides.
///
/// # Errors
/// [`SceneError`] with place, value and remedy.
pub fn scene(text: &str, overrides: &[&str]) -> Result<AnyScene, SceneError> {
    let mut source = Source::new("coupled bar", text);
    for o in overrides {
        source.push_override(o)?;
    }
    bondline_study::from_source(&source, Path::new(""), "coupled_bar")
}

/// Solves a bar and writes nothing.
///
/// # Errors
/// [`RunError`] if the model cannot be built or solved.
pub fn solve(scene: AnyScene, progress: &dyn Progress) -> Result<Bar, RunError> {
    solve_and(scene, Write::Nothing, progress)
}

/// Output of the files of a scene: on or off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Write {
    /// They are not.
    Nothing,
    /// They are.
    Outputs,
}

/// Solves a bar, and writes the scene's outputs if asked.
///
/// # Errors
/// [`RunError`] if the model cannot be built or solved, or a file not written.
pub fn solve_and(scene: AnyScene, write: Write, progress: &dyn Progress) -> Result<Bar, RunError> {
    match scene {
        AnyScene::Bar(s) => solve_dimension(s.scene, write, progress),
        AnyScene::Plane(s) => solve_dimension(s.scene, write, progress),
        AnyScene::Solid(s) => solve_dimension(s.scene, write, progress),
    }
}

fn solve_dimension<const D: usize>(
    scene: Scene<D>,
    write: Write,
    progress: &dyn Progress,
) -> Result<Bar, RunError> {
    let (low, high) = scene.mesh.bounds();
    let section: f64 = (1..D).map(|a| high[a] - low[a]).product();
    let lame = scene.materials.first().and_then(|m| m.lame());
    let youngs_modulus = lame.map_or(f64::NAN, |(lambda, mu)| match D {
        1 => lambda + 2.0 * mu,
        _ => mu * (3.0 * lambda + 2.0 * mu) / (lambda + mu),
    });
    let half = STRETCH * high[0].abs().max(low[0].abs());
    let mut planes = Vec::new();
    let mut slice = FieldMap::default();
    let summary = solve_with(scene, progress, |output, solved| {
        planes = planes_of(solved, half);
        slice = slice_of(solved);
        match write {
            Write::Nothing => Ok(Vec::new()),
            Write::Outputs => bondline::run::write(output, solved),
        }
    })?;
    let pull = summary
        .reactions
        .iter()
        .map(|r| r.force[0].abs() / (youngs_modulus * section * STRETCH))
        .reduce(f64::max);
    Ok(Bar {
        summary,
        planes,
        slice,
        pull,
    })
}

/// Sites by plane and model, in the order of both.
fn planes_of<const D: usize>(solved: &Solved<'_, D>, scale: f64) -> Vec<Plane> {
    let sites = &solved.model.sites;
    let mut order: Vec<usize> = (0..sites.len()).collect();
    let zone = |s: usize| solved.zone_of_site[s];
    // positions that round-off tells apart are one plane
    let key = |s: usize| (sites[s].position[0] * STRETCH / scale * 1e7).round() as i64;
    order.sort_by_key(|&s| (key(s), zone(s)));
    let mut planes = Vec::new();
    for plane in order.chunk_by(|&a, &b| (key(a), zone(a)) == (key(b), zone(b))) {
        let line = |s: usize| STRETCH * sites[s].position[0];
        let u = |s: usize| solved.displacement[s * D];
        let volume: f64 = plane.iter().map(|&s| sites[s].volume).sum();
        let mean = |f: &dyn Fn(usize) -> f64| {
            plane.iter().map(|&s| f(s) * sites[s].volume).sum::<f64>() / (volume * scale)
        };
        planes.push(Plane {
            x: sites[plane[0]].position[0],
            zone: zone(plane[0]),
            mean: mean(&u),
            deviation: mean(&|s| u(s) - line(s)),
            largest: largest(plane.iter().map(|&s| (u(s) - line(s)) / scale)),
        });
    }
    planes
}

/// The cells and points whose middle lies next to the plane z = 0, in millimetres, with `u_x` in micrometres.
fn slice_of<const D: usize>(solved: &Solved<'_, D>) -> FieldMap {
    let mut map = FieldMap::default();
    if D != 3 {
        return map;
    }
    let model = solved.model;
    let flat = |x: &bondline::tensor::Vector<D>| [1e3 * x[0], 1e3 * x[1]];
    let side = 1e3 * model.spacing();
    let near = |x: &bondline::tensor::Vector<D>| 1e3 * x[2].abs() < 0.49 * side;
    for c in (0..model.mesh.cell_count()).filter(|&c| model.is_element(c)) {
        let centre = model.mesh.centroid(c);
        if !near(&centre) {
            continue;
        }
        let nodes = model.mesh.cell(c);
        let sum: f64 = nodes
            .iter()
            .map(|&n| {
                model
                    .node_transfer
                    .displacement::<D>(n as usize, solved.displacement)[0]
            })
            .sum();
        let low = nodes
            .iter()
            .filter(|&&n| model.mesh.nodes[n as usize][2] < centre[2]);
        let corners = low.map(|&n| flat(&model.mesh.nodes[n as usize])).collect();
        map.cells.push((corners, 1e6 * sum / nodes.len() as f64));
    }
    for (s, site) in model.sites.iter().enumerate() {
        if matches!(site.kind, SiteKind::Point(_)) && near(&site.position) {
            let u = 1e6 * solved.displacement[s * D];
            map.points.push((flat(&site.position), side, u));
        }
    }
    map
}

/// Names of the models in tables.
pub fn model_name(zone: Zone) -> &'static str {
    match zone {
        Zone::Local => "FE",
        Zone::Transition => "transition",
        Zone::Nonlocal => "PD",
    }
}

/// Displacement that is expected of a bar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expected {
    /// The straight line at every site, to [`EXACT`].
    Line,
    /// Plane means within [`PLANE_MEANS`].
    PlaneMeans,
    /// Nothing: the surface of the peridynamic zone shows.
    Surface,
}

/// The rows of one bar.
pub fn rows(case: &str, bar: &Bar, expected: Expected) -> Vec<TableRow> {
    let mut rows = Vec::new();
    let all = |_| true;
    let means = bar.plane_means(all);
    rows.push(match expected {
        Expected::Surface => TableRow::info(case, "plane means", means),
        _ => TableRow::at_most(case, "plane means", means, PLANE_MEANS),
    });
    let pointwise = bar.pointwise(all);
    rows.push(match expected {
        Expected::Line => TableRow::at_most(case, "pointwise", pointwise, EXACT),
        _ => TableRow::info(case, "pointwise", pointwise),
    });
    for zone in [Zone::Local, Zone::Transition, Zone::Nonlocal] {
        if bar.planes.iter().any(|p| p.zone == zone) {
            let of = |z| z == zone;
            let (mean, point) = (bar.plane_means(of), bar.pointwise(of));
            let name = model_name(zone);
            rows.push(TableRow::info(case, format!("{name} means"), mean));
            rows.push(TableRow::info(case, format!("{name} pointwise"), point));
        }
    }
    if let Some(pull) = bar.pull {
        rows.push(TableRow::info(case, "pull/(E A u')", pull));
    }
    let summary = &bar.summary;
    let balance = summary.out_of_balance_relative;
    rows.push(TableRow::info(case, "out of balance", balance));
    rows.push(TableRow::info(case, "sites", summary.sizes.sites as f64));
    rows.push(TableRow::info(case, "bonds", summary.sizes.bonds as f64));
    rows.push(TableRow::info(case, "seconds", summary.total_seconds));
    rows
}

fn measure(
    case: &str,
    text: &str,
    overrides: &[&str],
    expected: Expected,
    table: &mut Table,
    progress: &dyn Progress,
) {
    let bar = scene(text, overrides)
        .map_err(BarError::from)
        .and_then(|s| solve(s, progress).map_err(BarError::from));
    match bar {
        Ok(bar) => table.rows.extend(rows(case, &bar, expected)),
        Err(e) => {
            let row = TableRow::at_most(case, "plane means", f64::NAN, PLANE_MEANS);
            table.push(row.because(e.to_string()));
        }
    }
}

/// A law as overrides of the scenes of this file.
const LPS: &[&str] = &[];
const BOND_BASED: &[&str] = &["materials.bar.bond-based.youngs-modulus=200e9"];

/// One dimension, then three with free sides, then three with the peridynamic zone enclosed.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let table = |text: &str| Table::new(text, Columns::ByQuantity);
    let mut line = table(
        "Coupled bar, [SAND2015-7998] section 7.3, 1D: deviation from the straight line, relative to the largest displacement",
    );
    let mut free = table("Coupled bar in 3D, section 13h, free sides, delta = 2h");
    let mut enclosed = table(
        "Coupled bar in 3D, section 17h, peridynamics enclosed sideways by transition 2h and finite elements 4h",
    );
    for (law, choice) in [("LPS", LPS), ("bond-based", BOND_BASED)] {
        for (method, method_choice) in METHODS {
            let case = format!("{law}, {method}");
            let choice = [choice, method_choice].concat();
            let expected = Expected::Line;
            measure(&case, SCENE_1D, &choice, expected, &mut line, progress);
            let thorough = effort == Effort::Full
                && !method.contains("constant")
                && !method.contains("linear");
            if thorough || (law == "LPS" && method == "partial stress, elements") {
                let expected = match method {
                    "partial stress, meshfree" => Expected::Surface,
                    _ => Expected::PlaneMeans,
                };
                measure(&case, SCENE_3D, &choice, expected, &mut free, progress);
                let choice = [&choice, ENCLOSED].concat();
                let expected = Expected::Line;
                measure(&case, SCENE_3D, &choice, expected, &mut enclosed, progress);
            }
        }
    }
    if effort == Effort::Full {
        // where the deviation is the surface's, it goes with the ratio of surface to section
        let choice = [METHODS[0].1, WIDER].concat();
        let case = "LPS, splice, section 21h";
        let expected = Expected::Surface;
        measure(case, SCENE_3D, &choice, expected, &mut free, progress);
    }
    vec![line, free, enclosed]
}

/// Draws `bar_line.svg` and `bar_slice.svg` (figure 7.8) and `bar_deviation.svg`.
///
/// # Errors
/// [`FigureError`] if a bar cannot be solved or a file not written.
pub fn figures(folder: &Path, progress: &dyn Progress) -> Result<(), FigureError> {
    let solve = |overrides: &[&str]| -> Result<Bar, BarError> {
        Ok(solve(scene(SCENE_3D, overrides)?, progress)?)
    };
    let bar = solve(&[])?;
    let half = 0.5e3
        * (bar.planes.last().map_or(0.0, |p| p.x) - bar.planes.first().map_or(0.0, |p| p.x))
        * STRETCH;
    let millimetres = |x: f64| 1e3 * x;
    let series = [Zone::Local, Zone::Transition, Zone::Nonlocal]
        .map(|zone| {
            let planes = bar.planes.iter().filter(|p| p.zone == zone);
            let points = planes
                .map(|p| (millimetres(p.x), 1e3 * p.mean * half))
                .collect();
            Series::new(model_name(zone), Stroke::Dots, points)
        })
        .to_vec();
    LinePlot {
        title: "Bar under tension: plane means of the displacement".into(),
        x_label: "x [mm]".into(),
        y_label: "displacement [µm]".into(),
        series,
        ..LinePlot::default()
    }
    .write(&folder.join("bar_line.svg"))?;
    let seams = [-14.0, -10.0, 10.0, 14.0].map(|x| vec![[x, -6.5], [x, 6.5]]);
    FieldMap {
        title: "Bar with free sides: layer z = 0".into(),
        label: "displacement along x [µm]".into(),
        lines: seams.to_vec(),
        range: Some((-1e3 * half, 1e3 * half)),
        ..bar.slice.clone()
    }
    .write(&folder.join("bar_slice.svg"))?;
    let wider = solve(&[METHODS[0].1, WIDER].concat())?;
    let deviation = |name: &str, bar: &Bar| {
        let points = bar
            .planes
            .iter()
            .map(|p| (millimetres(p.x), 100.0 * p.deviation))
            .collect();
        Series::new(name, Stroke::LineAndDots, points)
    };
    let series = vec![
        deviation("partial stress, free sides", &bar),
        deviation("splice, free sides", &solve(METHODS[0].1)?),
        deviation("splice, free sides, section 21h", &wider),
        deviation("partial stress, enclosed", &solve(ENCLOSED)?),
    ];
    LinePlot {
        title: "Plane means: deviation from the straight line".into(),
        x_label: "x [mm]".into(),
        y_label: "deviation [% of the largest displacement]".into(),
        series,
        ..LinePlot::default()
    }
    .write(&folder.join("bar_deviation.svg"))?;
    Ok(())
}

/// Failure to draw a figure.
#[derive(Debug)]
pub enum FigureError {
    /// The bar.
    Bar(BarError),
    /// The file.
    Write(ObserveError),
}

impl fmt::Display for FigureError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bar(e) => e.fmt(f),
            Self::Write(e) => e.fmt(f),
        }
    }
}

impl std::error::Error for FigureError {}

impl From<BarError> for FigureError {
    fn from(e: BarError) -> Self {
        Self::Bar(e)
    }
}

impl From<ObserveError> for FigureError {
    fn from(e: ObserveError) -> Self {
        Self::Write(e)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bondline::progress::Silent;

    #[test]
    fn the_bar_in_one_dimension_is_straight_with_every_method() {
        for (method, choice) in METHODS {
            let bar = solve(scene(SCENE_1D, choice).unwrap(), &Silent).unwrap();
            assert!(bar.planes.len() >= 200, "{method}: {}", bar.planes.len());
            assert!(
                bar.pointwise(|_| true) < EXACT,
                "{method}: {}",
                bar.pointwise(|_| true)
            );
            // the end of the line is at 1e-3 times half a metre
            let last = bar.planes.last().unwrap();
            assert!((last.mean - 1.0).abs() < 1e-9, "{method}: {last:?}");
        }
    }

    #[test]
    fn another_stretch_is_not_taken_for_the_line() {
        let twice = ["conditions.right.traction.x=400e6", "coupling=local"];
        let bar = solve(scene(SCENE_1D, &twice).unwrap(), &Silent).unwrap();
        assert!((bar.pointwise(|_| true) - 2.0).abs() < 1e-9);
        assert!((bar.pull.unwrap() - 2.0).abs() < 1e-9);
    }
}
