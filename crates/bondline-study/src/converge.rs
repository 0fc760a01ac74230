//! One scene at several refinements: δ-, m- and δm-convergence, measured by the differences between one level and the next.

use std::path::Path;

use crate::line_plot::{LinePlot, Scale, Series, Stroke};
use bondline::run::{RunError, Samples};
use bondline::scene::spec::{AxisSpec, MeshSpec, PeridynamicsSpec, PointsSpec};
use bondline::scene::{SceneError, SceneSpec, Source};
use bondline::{
    observe::{
        ObserveError,
        csv::{CsvTable, Entry},
        report::{Columns, Table, TableRow},
    },
    progress::Progress,
    regular_file,
};

/// Lengths that shrink from level to level. Source: \[Bobaru2009\] section 3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refinement {
    /// δ-convergence: the horizon and the spacing shrink together, `m = δ/h` stays.
    Delta,
    /// m-convergence: the spacing shrinks under a fixed horizon.
    M,
    /// δm-convergence: the spacing shrinks by the factor, the horizon by its square root, so that `m` grows.
    DeltaM,
}

impl Refinement {
    /// Powers of the factor by which horizon and spacing shrink.
    fn powers(self) -> (f64, f64) {
        match self {
            Self::Delta => (1.0, 1.0),
            Self::M => (0.0, 1.0),
            Self::DeltaM => (0.5, 1.0),
        }
    }

    /// Its name, in tables and in the names of files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Delta => "delta-convergence",
            Self::M => "m-convergence",
            Self::DeltaM => "delta-m-convergence",
        }
    }
}

/// A study of one scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConvergeParams {
    /// Kind of refinement.
    pub refinement: Refinement,
    /// Number of levels, the scene itself the first; at least 2, and 3 for an order.
    pub levels: usize,
    /// Factor of refinement from level to level, more than 1.
    pub factor: f64,
}

/// One level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Its horizon \[m\].
    pub horizon: f64,
    /// Spacing of its points, or without points the mean size of its cells \[m\].
    pub spacing: f64,
    /// Degrees of freedom.
    pub dofs: usize,
    /// Root mean square, over the samples, of the difference from the next level's displacement, relative to the last level's displacement.
    pub difference: Option<f64>,
    /// The largest difference at a sample, relative to the largest displacement.
    pub largest: Option<f64>,
}

/// Results of a convergence study.
#[derive(Clone, Debug, PartialEq)]
pub struct Converged {
    /// Kind of refinement.
    pub refinement: Refinement,
    /// The levels, coarse to fine.
    pub levels: Vec<Level>,
    /// Samples at which every level has a displacement.
    pub samples: usize,
}

/// Failure of a convergence study.
#[derive(Debug, thiserror::Error)]
pub enum ConvergeError {
    /// The scene.
    #[error("{}", .0.message())]
    Scene(Box<SceneError>),
    /// A level.
    #[error("level {level}: {source}")]
    Run {
        /// Its number, the scene itself is 0.
        level: usize,
        /// Why.
        source: Box<RunError>,
    },
    /// The numbers of the study.
    #[error(
        "convergence: {levels} levels of factor {factor}; use at least 2 levels and a factor above 1"
    )]
    Params {
        /// Levels asked for.
        levels: usize,
        /// Factor asked for.
        factor: f64,
    },
    /// A scene in time, or under a load that grows.
    #[error(
        "convergence: the scene moves, and states at different times are not compared; leave out `solve`, or set --set solve=static"
    )]
    Moves,
    /// No sample lies in every level's body.
    #[error(
        "convergence: no sample lies in the body of every level; use a larger body or finer points"
    )]
    Samples,
}

/// Differences at or below this are round-off of the solutions; orders are not made of them.
const ROUND_OFF: f64 = 1e-9;

/// Runs a scene at every level and compares displacements at fixed samples; nothing is written.
///
/// The horizon must be a constant; generated meshes are refined with the points, a mesh from a file stays. Zones given in horizons follow the
/// horizon. Samples are the sites of the first level. Where the sites of finer levels include them (a lattice on the nodes of the mesh, a whole
/// factor), nothing is interpolated; elsewhere in a lattice an affine fit is, whose own error is of the second order in the spacing.
///
/// # Errors
/// [`ConvergeError`].
pub fn converge(
    path: &Path,
    overrides: &[String],
    params: &ConvergeParams,
    progress: &dyn Progress,
) -> Result<Converged, ConvergeError> {
    let (levels, factor) = (params.levels, params.factor);
    if levels < 2 || factor.is_nan() || factor <= 1.0 {
        return Err(ConvergeError::Params { levels, factor });
    }
    let scene_error = |e: SceneError| ConvergeError::Scene(Box::new(e));
    let text = regular_file::read_scene(path).map_err(|error| {
        scene_error(SceneError::file(format!(
            "cannot read the scene {}: {error}; check the path",
            path.display()
        )))
    })?;
    let mut source = Source::new(path.display().to_string(), text);
    for o in overrides {
        source.push_override(o).map_err(scene_error)?;
    }
    let spec = SceneSpec::parse(&source).map_err(scene_error)?;
    let directory = path.parent().unwrap_or(Path::new(""));
    let mut solved: Vec<Samples> = Vec::new();
    // of a scene that does not place its points, the spacing that its first level got
    let mut chosen = None;
    let mut positions = Vec::new();
    for level in 0..levels {
        let mut source = source.clone();
        if level > 0 {
            let (delta, h) = params.refinement.powers();
            let shrink = |power: f64| factor.powf(-power * level as f64);
            for o in refined(&spec, shrink(delta), shrink(h), chosen).map_err(scene_error)? {
                source.push_override(&o).map_err(scene_error)?;
            }
        }
        let scene =
            crate::load::from_source(&source, directory, "converge").map_err(scene_error)?;
        if scene.moves() {
            return Err(ConvergeError::Moves);
        }
        if level == 0 {
            chosen = crate::load::lattice_spacing(&scene);
        }
        let samples = scene.samples(&mut positions, progress);
        solved.push(samples.map_err(|e| ConvergeError::Run {
            level,
            source: Box::new(e),
        })?);
    }
    compare(params.refinement, &solved)
}

/// The horizon that a study refines.
fn typed_horizon(pd: &PeridynamicsSpec) -> Result<f64, SceneError> {
    let Some(typed) = &pd.horizon else {
        return Err(SceneError::missing("the scene leaves `peridynamics.horizon` out; a study of convergence refines the one that is typed")
            .help("type it: --set peridynamics.horizon=..., `bondline check` says which is taken"));
    };
    typed.as_constant().ok_or_else(|| {
        SceneError::wrong_value(
            "`peridynamics.horizon` varies in space; a study of convergence needs one number",
        )
    })
}

/// The overrides that make a level of the scene.
fn refined(
    spec: &SceneSpec,
    delta: f64,
    h: f64,
    chosen: Option<f64>,
) -> Result<Vec<String>, SceneError> {
    let mut overrides = Vec::new();
    let Some(pd) = &spec.peridynamics else {
        return Err(SceneError::missing(
            "the scene has no [peridynamics], hence no horizon to refine with",
        ));
    };
    let horizon = typed_horizon(pd)?;
    overrides.push(format!("peridynamics.horizon={:e}", horizon * delta));
    let (shape, axes) = match &spec.mesh {
        Some(MeshSpec::Line(m)) => ("line", vec![("x", m.x.get_ref())]),
        Some(MeshSpec::Rectangle(m)) => (
            "rectangle",
            vec![("x", m.x.get_ref()), ("y", m.y.get_ref())],
        ),
        Some(MeshSpec::Box(m)) => (
            "box",
            vec![
                ("x", m.x.get_ref()),
                ("y", m.y.get_ref()),
                ("z", m.z.get_ref()),
            ],
        ),
        Some(MeshSpec::File(file)) => {
            if matches!(pd.points, Some(PointsSpec::Cells)) {
                return Err(SceneError::conflict("points in the cells of a mesh from a file get no finer: the horizon would shrink over the same points")
                    .label(file.path.span.clone(), "stays as it is")
                    .help("use a lattice, --set peridynamics.points.lattice.spacing=..., or a mesh that is generated"));
            }
            ("", Vec::new())
        }
        None => {
            return Err(SceneError::conflict(
                "points from a file get no finer: the horizon would shrink over the same points",
            )
            .help("use a mesh and a lattice of points"));
        }
    };
    // a whole number of cells cannot shrink by any factor: points follow the mesh, or they would leave its nodes
    let mut shrunk = h;
    for (axis, division) in axes.into_iter().rev() {
        overrides.push(match division {
            AxisSpec::Cells(n) => {
                let cells = (n.value as f64 / h).round();
                shrunk = n.value as f64 / cells;
                format!("mesh.{shape}.{axis}.cells={cells}")
            }
            AxisSpec::Spacing(s) => format!("mesh.{shape}.{axis}.spacing={:e}", s.value * h),
            AxisSpec::Graded(g) => {
                format!(
                    "mesh.{shape}.{axis}.graded.spacing={:e}",
                    g.spacing.value * h
                )
            }
        });
    }
    let spacing = match &pd.points {
        Some(PointsSpec::Lattice(lattice)) => Some(lattice.spacing.value),
        Some(PointsSpec::Cells | PointsSpec::File(_)) => None,
        None => chosen,
    };
    if let Some(spacing) = spacing {
        let spacing = spacing * shrunk;
        overrides.push(format!("peridynamics.points.lattice.spacing={spacing:e}"));
    }
    Ok(overrides)
}

fn compare(refinement: Refinement, solved: &[Samples]) -> Result<Converged, ConvergeError> {
    let Some(last) = solved.last() else {
        return Err(ConvergeError::Samples);
    };
    let common: Vec<usize> = (0..last.displacement.len())
        .filter(|&k| solved.iter().all(|s| s.displacement[k].is_some()))
        .collect();
    if common.is_empty() {
        return Err(ConvergeError::Samples);
    }
    let at = |s: &Samples, k: usize| s.displacement[k].unwrap_or_default();
    let square = |u: [f64; 3]| u.iter().map(|c| c * c).sum::<f64>();
    let (mut scale, mut most) = (0.0, 0.0f64);
    for &k in &common {
        let s = square(at(last, k));
        scale += s;
        most = most.max(s);
    }
    let levels = solved
        .iter()
        .enumerate()
        .map(|(l, s)| {
            let differences = solved.get(l + 1).map(|next| {
                let (mut sum, mut largest) = (0.0, 0.0f64);
                for &k in &common {
                    let (a, b) = (at(s, k), at(next, k));
                    let d = square([a[0] - b[0], a[1] - b[1], a[2] - b[2]]);
                    sum += d;
                    largest = largest.max(d);
                }
                ((sum / scale).sqrt(), (largest / most).sqrt())
            });
            Level {
                horizon: s.horizon,
                spacing: s.spacing,
                dofs: s.dofs,
                difference: differences.map(|d| d.0),
                largest: differences.map(|d| d.1),
            }
        })
        .collect();
    Ok(Converged {
        refinement,
        levels,
        samples: common.len(),
    })
}

impl Converged {
    /// Returns the abscissa of a level in the plot: its spacing, or its horizon where that shrinks.
    fn size(&self, level: &Level) -> f64 {
        match self.refinement {
            Refinement::M => level.spacing,
            Refinement::Delta | Refinement::DeltaM => level.horizon,
        }
    }

    /// Observed orders, from each level that has two finer ones; `None` where differences are round-off.
    ///
    /// An error that falls like `size^p` leaves differences that do, so that `p = ln(d_k/d_(k+1))/ln(size_k/size_(k+1))`.
    pub fn orders(&self) -> Vec<Option<f64>> {
        self.levels
            .windows(2)
            .filter_map(|w| Some((w[0].difference?, w[1].difference?, w)))
            .map(|(coarse, fine, w)| {
                (coarse > ROUND_OFF && fine > ROUND_OFF)
                    .then(|| (coarse / fine).ln() / (self.size(&w[0]) / self.size(&w[1])).ln())
            })
            .collect()
    }

    /// The levels as a table.
    pub fn table(&self) -> Table {
        let mut table = Table::new(
            format!(
                "{}: displacement against the next level, {} samples",
                self.refinement.name(),
                self.samples
            ),
            Columns::ByQuantity,
        );
        let orders = self.orders();
        for (l, level) in self.levels.iter().enumerate() {
            let case = format!("level {l}");
            table.push(TableRow::info(&case, "horizon [m]", level.horizon));
            table.push(TableRow::info(&case, "spacing [m]", level.spacing));
            table.push(TableRow::info(&case, "m", level.horizon / level.spacing));
            table.push(TableRow::info(&case, "unknowns", level.dofs as f64));
            if let (Some(d), Some(largest)) = (level.difference, level.largest) {
                table.push(TableRow::info(&case, "difference, L2 over samples", d));
                table.push(TableRow::info(&case, "difference, max", largest));
            }
            match orders.get(l) {
                Some(Some(p)) => table.push(TableRow::info(&case, "observed order", *p)),
                Some(None) => table.push(TableRow::refused(
                    &case,
                    "observed order",
                    "levels agree to round-off",
                )),
                None => {}
            }
        }
        table
    }

    /// Writes one line per level; what a level lacks is empty.
    ///
    /// # Errors
    /// [`ObserveError`], with the path.
    pub fn write_csv(&self, path: &Path) -> Result<(), ObserveError> {
        let header = [
            "level",
            "horizon",
            "spacing",
            "m",
            "unknowns",
            "difference_l2",
            "difference_max",
            "order",
        ];
        let mut table = CsvTable::create(path, &header)?;
        let entry = |value: Option<f64>| value.map_or(Entry::from(""), Entry::from);
        let orders = self.orders();
        for (l, level) in self.levels.iter().enumerate() {
            table.entries(&[
                (l as i64).into(),
                level.horizon.into(),
                level.spacing.into(),
                (level.horizon / level.spacing).into(),
                (level.dofs as i64).into(),
                entry(level.difference),
                entry(level.largest),
                entry(orders.get(l).copied().flatten()),
            ])?;
        }
        Ok(())
    }

    /// The differences over the size, both axes logarithmic.
    pub fn plot(&self) -> LinePlot {
        let series = |name: &str, f: fn(&Level) -> Option<f64>| {
            let points = self
                .levels
                .iter()
                .filter_map(|l| Some((self.size(l), f(l)?)));
            Series::new(name, Stroke::LineAndDots, points.collect())
        };
        LinePlot {
            title: self.refinement.name().to_owned(),
            x_label: match self.refinement {
                Refinement::M => "spacing [m]".to_owned(),
                Refinement::Delta | Refinement::DeltaM => "horizon [m]".to_owned(),
            },
            y_label: "difference from the next level".to_owned(),
            x_scale: Scale::Log,
            y_scale: Scale::Log,
            series: vec![
                series("L2 over samples", |l| l.difference),
                series("max", |l| l.largest),
            ],
        }
    }
}

#[cfg(test)]
#[path = "converge_tests.rs"]
mod tests;
