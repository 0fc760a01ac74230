//! Size limits of scenes that are run by the thousand.
//!
//! A scene that asks for more is not wrong; it is left out before anything of its size is made.

use bondline::scene::spec::{AxisSpec, MeshSpec, PointsSpec, SceneSpec, SolveSpec};
use bondline::scene::{Coordinates, Number};
use toml::Spanned;

/// True in builds that are instrumented for a fuzzer: a scene takes some twenty times as long there, and has ten seconds.
#[allow(unexpected_cfgs)] // cargo-fuzz sets it
pub const IS_INSTRUMENTED: bool = cfg!(fuzzing);

/// The most cells of a mesh.
pub const MOST_CELLS: usize = if IS_INSTRUMENTED { 250 } else { 700 };
/// The most cells of a solid, whose factors fill.
const MOST_SOLID_CELLS: usize = if IS_INSTRUMENTED { 40 } else { 300 };
/// The most points of a lattice, were it to fill the mesh.
const MOST_POINTS: f64 = if IS_INSTRUMENTED { 600.0 } else { 3000.0 };
/// The most samples of all lines, and load steps.
const MOST_SAMPLES: usize = 2000;
const MOST_LOAD_STEPS: usize = 12;

pub fn is_small(spec: &SceneSpec) -> bool {
    let samples = spec.output.lines.values().map(|l| l.samples.value);
    let samples = samples.fold(0usize, usize::saturating_add);
    let steps = |solve: &SolveSpec| match solve {
        SolveSpec::QuasiStatic(q) => q.steps.count(),
        _ => 0,
    };
    let steps = (spec.analysis().into_iter().chain(spec.stages.values()))
        .map(steps)
        .max()
        .unwrap_or(0);
    cells_and_points_are_few(spec) && samples <= MOST_SAMPLES && steps <= MOST_LOAD_STEPS
}

fn cells_and_points_are_few(spec: &SceneSpec) -> bool {
    let (min, max, axes) = match &spec.mesh {
        Some(MeshSpec::Line(m)) => (&m.min, &m.max, vec![&m.x]),
        Some(MeshSpec::Rectangle(m)) => (&m.min, &m.max, vec![&m.x, &m.y]),
        Some(MeshSpec::Box(m)) => (&m.min, &m.max, vec![&m.x, &m.y, &m.z]),
        // the meshes at hand have up to 806 cells, and reach up to 4
        Some(MeshSpec::File(_)) => return points(spec, &[4.0, 2.0, 2.0]),
        // refused, or the points of a file, of which none are at hand
        None => return true,
    };
    let lengths = lengths(min, max);
    let cells: f64 = axes
        .iter()
        .zip(&lengths)
        .map(|(axis, &length)| count(axis, length).max(1.0))
        .product();
    let most = [MOST_CELLS, MOST_CELLS, MOST_SOLID_CELLS][axes.len() - 1];
    cells <= most as f64 && points(spec, &lengths)
}

fn lengths(min: &Coordinates, max: &Coordinates) -> Vec<f64> {
    let pairs = min.values.iter().zip(&max.values);
    pairs.map(|(a, b)| (b - a).abs()).collect()
}

fn count(axis: &Spanned<AxisSpec>, length: f64) -> f64 {
    match axis.get_ref() {
        AxisSpec::Cells(count) => count.value as f64,
        AxisSpec::Spacing(spacing) => length / spacing.value.abs(),
        AxisSpec::Graded(g) => {
            // growing cells are few next to the bound by the finest ones
            let fine: f64 = match g.fine.values[..] {
                [a, b] => (b - a).abs().min(length),
                _ => length,
            };
            let growth = g.growth.as_ref().map_or(1.3, |g| g.value);
            let largest = g.largest.as_ref().map_or(length, |l| l.value.abs());
            let outside = (length - fine) / largest;
            let growing = if growth > 1.01 {
                2.0 * (length / g.spacing.value.abs()).max(1.0).ln() / growth.ln() + outside
            } else {
                length / g.spacing.value.abs()
            };
            fine / g.spacing.value.abs() + growing
        }
    }
}

fn points(spec: &SceneSpec, lengths: &[f64]) -> bool {
    let few = |spacing: &Number| {
        let count: f64 = lengths
            .iter()
            .map(|l| (l / spacing.value.abs()).max(1.0))
            .product();
        count <= MOST_POINTS
    };
    let lattice = match spec.peridynamics.as_ref().and_then(|p| p.points.as_ref()) {
        Some(PointsSpec::Lattice(l)) => few(&l.spacing),
        _ => true,
    };
    lattice && spec.zones.bodies.values().all(|b| few(&b.spacing))
}
