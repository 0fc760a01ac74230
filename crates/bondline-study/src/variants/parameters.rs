//! Settings of a scene that trade speed for accuracy: those of each knob, and the overrides that several of them make together.

use super::generated::{Axis, Generated, generated};
use bondline::model::Zone;
use bondline::scene::SceneSpec;
use bondline::scene::default_points::{RATIO, fraction_of_cells};
use bondline::scene::spec::{
    CouplingSpec, CouplingTraits, LatticeStart, MaterialSpec, PointsSpec, ShapeSpec, SolveSpec,
    TransitionSpec, TruncatedSpec, ZonesNeeded,
};

/// One setting of a knob: how it is called in tables, and what it does.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// In tables, for example `m = 4`.
    pub label: String,
    pub(crate) change: Change,
}

/// Change of a scene by a setting.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Change {
    /// Another coupling.
    Coupling(String),
    /// The horizon times this factor, m kept; elements follow where points lie in them.
    Horizon(f64),
    /// Another m = δ/h under the same horizon.
    Ratio(f64),
    /// Elements so many times larger, where points do not lie in them.
    Elements(f64),
    /// The nonlocal zone wider by so many horizons on every side.
    Padding(f64),
    /// Keys of the scene, as after `--set`.
    Keys(Vec<String>),
}

/// A choice with its settings, but that of the scene itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Knob {
    /// Its name: one of [`KNOBS`], or a key of the scene.
    pub name: String,
    /// The other settings that it can take.
    pub settings: Vec<Setting>,
}

/// Names of the knobs that are turned without being asked for, where they apply.
pub const KNOBS: [&str; 7] = [
    "coupling",
    "horizon",
    "m",
    "elements",
    "padding",
    "step-fraction",
    "precision",
];

/// Spacings of versions of a scene over its own.
const VERSIONS: [f64; 8] = [0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 8.0];

/// The numbers of a scene that knobs change.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Base {
    traits: CouplingTraits,
    /// δ, where it is one number.
    horizon: Option<f64>,
    /// Spacing and origin of a typed lattice.
    lattice: Option<(f64, Option<Vec<f64>>)>,
    mesh: Option<Generated>,
    nonlocal: Option<Grown>,
    transition: Option<Grown>,
    /// Width of a transition zone that is typed as one around the nonlocal zone.
    around: Option<f64>,
    has_transition: bool,
    /// Cracks or voids that elements do not see, or bonds that may break: δ is a length of the material, and elements alone are no model.
    pub breaks: bool,
    /// Bonds that may break.
    pub can_break: bool,
    pub moves: bool,
    /// It moves in time.
    /// The key of the table of its motion, if it is in time.
    explicit: Option<String>,
}

/// A zone whose edge can be moved outwards.
#[derive(Clone, Debug, PartialEq)]
enum Grown {
    Box(Vec<f64>, Vec<f64>),
    Near(f64),
}

impl Base {
    pub(crate) fn of(spec: &SceneSpec) -> Self {
        let pd = spec.peridynamics.as_ref();
        let cell = || generated(spec).as_ref().and_then(Generated::cell);
        let horizon = pd.and_then(|p| match (&p.horizon, &p.points) {
            (Some(typed), _) => typed.as_constant(),
            (None, Some(PointsSpec::Lattice(l))) => Some(RATIO * l.spacing.value),
            (None, _) => cell().map(|a| RATIO * a),
        });
        let lattice = pd.and_then(|p| match &p.points {
            Some(PointsSpec::Lattice(l)) => {
                Some((l.spacing.value, l.origin.as_ref().map(|o| o.values.clone())))
            }
            Some(PointsSpec::Cells | PointsSpec::File(_)) => None,
            // where the lattice is that of the cells, the two are one
            None => {
                let horizon = horizon?;
                let spacing = cell().map_or(horizon / RATIO, |a| fraction_of_cells(a, horizon));
                (Some(spacing) != cell()).then_some((spacing, None))
            }
        });
        let breaks = |m: &MaterialSpec| !m.failure().is_empty();
        let solve = spec.analysis();
        let moves = !matches!(solve, None | Some(SolveSpec::Static(_)));
        let transition = spec.zones.transition.as_ref().map(|t| t.get_ref());
        Self {
            traits: spec.coupling.as_ref().map_or(
                CouplingSpec::Truncated(TruncatedSpec::default()).traits(),
                |c| c.get_ref().traits(),
            ),
            horizon,
            lattice,
            mesh: generated(spec),
            nonlocal: spec
                .zones
                .nonlocal
                .as_ref()
                .and_then(|z| match z.get_ref() {
                    ShapeSpec::Box(b) => {
                        Some(Grown::Box(b.min.values.clone(), b.max.values.clone()))
                    }
                    ShapeSpec::Near(n) => Some(Grown::Near(n.within.value)),
                    _ => None,
                }),
            transition: transition.and_then(|t| match t {
                TransitionSpec::Box(b) => {
                    Some(Grown::Box(b.min.values.clone(), b.max.values.clone()))
                }
                TransitionSpec::Near(n) => Some(Grown::Near(n.within.value)),
                _ => None,
            }),
            around: transition.and_then(|t| match t {
                TransitionSpec::Around(width) => Some(width.value),
                _ => None,
            }),
            has_transition: transition.is_some(),
            breaks: !spec.cracks.is_empty()
                || !spec.voids.is_empty()
                || spec.materials.values().any(breaks),
            can_break: spec.materials.values().any(breaks),
            moves,
            explicit: matches!(solve, Some(SolveSpec::Explicit(_)))
                .then(|| format!("{}.explicit", spec.analysis_key())),
        }
    }

    /// Says that δ is not one number, as far as the text of the scene tells.
    pub(crate) fn lacks_horizon(&self) -> bool {
        self.horizon.is_none()
    }

    /// Edge of the first cells along the first axis.
    pub(crate) fn cell(&self) -> Option<f64> {
        self.mesh.as_ref().and_then(Generated::cell)
    }

    /// Spacing of the points.
    fn spacing(&self) -> Option<f64> {
        self.lattice.as_ref().map(|l| l.0).or_else(|| self.cell())
    }

    /// m = δ/h.
    fn ratio(&self) -> Option<f64> {
        Some(self.horizon? / self.spacing()?)
    }

    /// Everything that can be turned in this scene without being asked for.
    pub(crate) fn knobs(&self) -> Vec<Knob> {
        KNOBS
            .iter()
            .filter_map(|name| {
                let settings = self.settings(name);
                (!settings.is_empty()).then(|| Knob {
                    name: (*name).to_owned(),
                    settings,
                })
            })
            .collect()
    }

    fn settings(&self, knob: &str) -> Vec<Setting> {
        let setting = |label: String, change: Change| Setting { label, change };
        match knob {
            "coupling" => CouplingSpec::names()
                .iter()
                .filter(|name| **name != self.traits.name)
                // elements alone see no crack and break no bond
                .filter(|name| !(**name == "local" && self.breaks))
                .map(|name| setting((*name).to_owned(), Change::Coupling((*name).to_owned())))
                .collect(),
            // where bonds break, the horizon is a length of the material
            "horizon" if !self.breaks && self.horizon.is_some() && self.mesh.is_some() => {
                [1.5, 2.0]
                    .map(|f| setting(format!("horizon x {f}"), Change::Horizon(f)))
                    .into()
            }
            "m" => {
                let Some(base) = self.ratio() else {
                    return Vec::new();
                };
                [2.0, 3.0, 4.0, 6.0]
                    .iter()
                    .filter(|m| (*m / base - 1.0).abs() > 1e-6)
                    .map(|m| setting(format!("m = {m}"), Change::Ratio(*m)))
                    .collect()
            }
            "elements" if self.lattice.is_some() && self.mesh.is_some() => [0.5, 2.0, 4.0]
                .map(|f| setting(format!("elements x {f}"), Change::Elements(f)))
                .into(),
            "padding" if self.nonlocal.is_some() && self.horizon.is_some() => [-1.0, 1.0, 2.0]
                .map(|f| setting(format!("padding {f:+} horizons"), Change::Padding(f)))
                .into(),
            "step-fraction" => (self.explicit.iter())
                .map(|key| {
                    let halved = vec![format!("{key}.step-fraction=0.5")];
                    setting("step-fraction = 0.5".to_owned(), Change::Keys(halved))
                })
                .collect(),
            "precision" if self.moves && self.horizon.is_some() => vec![setting(
                "precision = single".to_owned(),
                Change::Keys(vec!["peridynamics.precision=single".to_owned()]),
            )],
            _ => Vec::new(),
        }
    }

    /// Name of the scene's coupling.
    pub(crate) fn coupling(&self) -> &'static str {
        self.traits.name
    }

    /// Returns true if the mesh is that of a file.
    pub(crate) fn is_from_file(&self) -> bool {
        self.mesh.is_none()
    }

    /// Returns true if a change does something in a scene with this coupling: elements alone have no points, and peridynamics everywhere no zone.
    pub(crate) fn acts(&self, change: &Change, coupling: &str) -> bool {
        let traits = named(coupling).map_or(self.traits, |coupling| coupling.traits());
        let has_elements = !matches!(traits.zones, ZonesNeeded::Everywhere(Zone::Nonlocal));
        let has_points = !matches!(traits.zones, ZonesNeeded::Everywhere(Zone::Local));
        match change {
            // points that lie in the cells move these
            Change::Horizon(_) | Change::Ratio(_) => has_points || self.lattice.is_none(),
            Change::Padding(_) => has_points && has_elements,
            Change::Elements(_) => has_elements || self.lattice.is_none(),
            Change::Keys(keys) => {
                has_points || !keys.iter().any(|key| key.starts_with("peridynamics."))
            }
            Change::Coupling(_) => true,
        }
    }

    /// Keys of elements alone: half as large, or those of a file of second order.
    pub(crate) fn elements_alone(&self) -> Vec<String> {
        let mut keys = vec!["coupling=local".to_owned()];
        match self.mesh {
            Some(_) => self.mesh_overrides(0.5, &mut keys),
            None => keys.push("mesh.file.order=second".to_owned()),
        }
        keys
    }

    /// Returns the changes that make a reference: twice as fine in horizon (unless it is a length of the material), points and elements.
    pub(crate) fn finer(&self) -> Vec<Change> {
        self.scaled(0.5)
    }

    /// Factors of the spacing for which the scene is still one, in rising order: a quarter, half, one, and those that leave an order to be seen.
    ///
    /// They leave a whole number of cells along the first axis. There are none for a mesh from a file.
    pub(crate) fn versions(&self) -> Vec<f64> {
        let Some(mesh) = &self.mesh else {
            return Vec::new();
        };
        let cells = mesh
            .axes
            .iter()
            .enumerate()
            .map(|(k, (_, axis))| match axis {
                Axis::Cells(n) => *n as f64,
                Axis::Spacing(s) | Axis::Graded { spacing: s, .. } => {
                    (mesh.max[k] - mesh.min[k]) / s
                }
            });
        let fewest = cells.fold(f64::INFINITY, f64::min);
        // families of two spacings are the smallest that are any good; cracks that run take other ways in coarser points
        let coarsest = match self.ratio() {
            _ if self.can_break => 1.0,
            Some(m) if self.breaks => m / 1.99,
            _ => f64::INFINITY,
        };
        // coarser ones say nothing of an order
        let fits = |f: &f64| *f <= 1.0 || (*f <= coarsest && fewest / f >= 3.99);
        let mut factors: Vec<f64> = VERSIONS
            .iter()
            .map(|f| self.whole(*f))
            .filter(fits)
            .collect();
        factors.dedup();
        factors
    }

    /// Points of full peridynamics with spacings so many times larger, in the box around the body.
    pub(crate) fn points_of_all(&self, factor: f64) -> Option<f64> {
        let mesh = self.mesh.as_ref()?;
        let spacing = self.spacing()? * factor;
        let edges = mesh.max.iter().zip(&mesh.min);
        Some(edges.map(|(max, min)| (max - min) / spacing).product())
    }

    /// The scene with all spacings `factor` times as large, and peridynamics everywhere; `None` where it is already, or where nothing cuts bonds.
    pub(crate) fn everywhere(&self, factor: f64) -> Option<Vec<Change>> {
        let is_all = matches!(self.traits.zones, ZonesNeeded::Everywhere(_));
        (self.breaks && !is_all).then(|| {
            let all = Change::Coupling("nonlocal".to_owned());
            self.scaled(factor).into_iter().chain([all]).collect()
        })
    }

    /// A factor next to one that leaves a whole number of cells along the first axis.
    fn whole(&self, factor: f64) -> f64 {
        match self.mesh.as_ref().and_then(|m| m.axes.first()) {
            Some((_, Axis::Cells(n))) => *n as f64 / (*n as f64 / factor).round().max(1.0),
            _ => factor,
        }
    }

    /// The scene with all spacings `factor` times as large, and the horizon too unless it is a length of the material.
    pub(crate) fn scaled(&self, factor: f64) -> Vec<Change> {
        let points = self.ratio().map(|m| match self.breaks {
            false => Change::Horizon(factor),
            true => Change::Ratio(m / factor),
        });
        points
            .into_iter()
            .chain([Change::Elements(factor)])
            .collect()
    }

    /// The overrides of several settings together.
    pub(crate) fn overrides<'a>(
        &self,
        changes: impl IntoIterator<Item = &'a Change>,
    ) -> Vec<String> {
        let (mut delta, mut ratio, mut elements, mut padding) = (1.0, None, 1.0, 0.0);
        let mut coupling: Option<&str> = None;
        let mut list = Vec::new();
        for change in changes {
            match change {
                Change::Coupling(name) => coupling = Some(name),
                Change::Horizon(f) => delta = *f,
                Change::Ratio(m) => ratio = Some(*m),
                Change::Elements(f) => elements = *f,
                Change::Padding(f) => padding = *f,
                Change::Keys(keys) => list.extend(keys.iter().cloned()),
            }
        }
        let mut traits = self.traits;
        if let Some(name) = coupling {
            list.push(format!("coupling={name}"));
            if let Some(other) = named(name) {
                traits = other.traits();
            }
        }
        let (Some(horizon), Some(spacing)) = (self.horizon, self.spacing()) else {
            self.mesh_overrides(elements, &mut list);
            return list;
        };
        let finer = match ratio {
            Some(m) => horizon * delta / m / spacing,
            None => delta,
        };
        // the spacing as it is typed, not as it comes back from m
        let finer = if (finer - 1.0).abs() < 1e-12 {
            1.0
        } else {
            finer
        };
        if delta != 1.0 {
            list.push(format!("peridynamics.horizon={:e}", horizon * delta));
        }
        self.lattice_overrides(spacing * finer, coupling.map(|_| traits), &mut list);
        // where points lie in the cells, the two are one
        let cells = if self.lattice.is_some() {
            elements
        } else {
            finer
        };
        self.mesh_overrides(cells, &mut list);
        let grown = padding * horizon;
        if grown != 0.0 {
            zone_overrides("zones.nonlocal", self.nonlocal.as_ref(), grown, &mut list);
        }
        let transition = self.transition_at(delta);
        let key = "zones.transition";
        if grown != 0.0 || transition != self.transition {
            zone_overrides(key, transition.as_ref(), grown, &mut list);
        }
        if let Some(width) = self.around.filter(|_| delta != 1.0) {
            list.push(format!("{key}.around={:e}", width * delta));
        }
        if let ZonesNeeded::Transition { width, .. } = traits.zones
            && !self.has_transition
        {
            // half a cell more, so that the cells make up the width
            let width = width * horizon * delta + 0.5 * spacing * finer;
            list.push(format!("zones.transition.around={width:e}"));
        }
        list
    }

    /// The transition zone as wide in horizons as it is typed, where that of `delta` times the horizon still lies in the body.
    fn transition_at(&self, delta: f64) -> Option<Grown> {
        let typed = self.transition.as_ref()?;
        let moved = |from: f64, to: f64| from + (to - from) * delta;
        let each = |from: &[f64], to: &[f64]| -> Vec<f64> {
            from.iter().zip(to).map(|(f, t)| moved(*f, *t)).collect()
        };
        let scaled = match (self.nonlocal.as_ref(), typed) {
            _ if delta == 1.0 => None,
            (Some(Grown::Near(from)), Grown::Near(to)) => Some(Grown::Near(moved(*from, *to))),
            (Some(Grown::Box(low, high)), Grown::Box(min, max)) => {
                let (low, high) = (each(low, min), each(high, max));
                let stays = |mesh: &Generated| {
                    let mut axes = 0..low.len().min(mesh.min.len());
                    axes.all(|k| {
                        (min[k] <= mesh.min[k] || low[k] > mesh.min[k])
                            && (max[k] >= mesh.max[k] || high[k] < mesh.max[k])
                    })
                };
                let is_inside = self.mesh.as_ref().is_some_and(stays);
                is_inside.then_some(Grown::Box(low, high))
            }
            _ => None,
        };
        scaled.or_else(|| Some(typed.clone()))
    }

    fn lattice_overrides(
        &self,
        spacing: f64,
        coupling: Option<CouplingTraits>,
        list: &mut Vec<String>,
    ) {
        let Some((old, origin)) = &self.lattice else {
            return;
        };
        let same = (spacing / old - 1.0).abs() < 1e-12;
        if !same {
            list.push(format!("peridynamics.points.lattice.spacing={spacing:e}"));
        }
        let (Some(origin), Some(mesh)) = (origin, &self.mesh) else {
            return;
        };
        let typed = origin
            .iter()
            .zip(&mesh.min)
            .all(|(o, m)| ((o - m) / old).rem_euclid(1.0) > 0.25);
        let halfway = match coupling {
            // pure models take the lattice as it is typed
            Some(j) if !matches!(j.zones, ZonesNeeded::Everywhere(_)) => {
                j.lattice == LatticeStart::Halfway
            }
            _ => typed,
        };
        if !same || halfway != typed {
            let start: Vec<f64> = mesh
                .min
                .iter()
                .map(|m| if halfway { m + 0.5 * spacing } else { *m })
                .collect();
            list.push(format!(
                "peridynamics.points.lattice.origin={}",
                coordinates(&start)
            ));
        }
    }

    fn mesh_overrides(&self, factor: f64, list: &mut Vec<String>) {
        let Some(mesh) = &self.mesh else { return };
        if (factor - 1.0).abs() < 1e-12 {
            return;
        }
        for (name, axis) in &mesh.axes {
            let key = format!("mesh.{}.{name}", mesh.shape);
            match axis {
                Axis::Cells(n) => {
                    let cells = (*n as f64 / factor).round().max(1.0);
                    list.push(format!("{key}.cells={cells}"));
                }
                Axis::Spacing(s) => list.push(format!("{key}.spacing={:e}", s * factor)),
                Axis::Graded { spacing, largest } => {
                    list.push(format!("{key}.graded.spacing={:e}", spacing * factor));
                    if let Some(l) = largest {
                        list.push(format!("{key}.graded.largest={:e}", l * factor));
                    }
                }
            }
        }
    }
}

/// The coupling of this name, without options.
fn named(name: &str) -> Option<CouplingSpec> {
    let table: std::collections::BTreeMap<String, CouplingSpec> =
        toml::from_str(&format!("[coupling.{name}]")).ok()?;
    table.into_values().next()
}

fn zone_overrides(key: &str, zone: Option<&Grown>, grown: f64, list: &mut Vec<String>) {
    match zone {
        Some(Grown::Box(min, max)) => {
            let moved = |x: &[f64], by: f64| x.iter().map(|v| v + by).collect::<Vec<_>>();
            list.push(format!(
                "{key}.box.min={}",
                coordinates(&moved(min, -grown))
            ));
            list.push(format!("{key}.box.max={}", coordinates(&moved(max, grown))));
        }
        Some(Grown::Near(within)) => list.push(format!("{key}.near.within={:e}", within + grown)),
        None => {}
    }
}

/// Coordinates as a scene has them: a list, in one dimension a number.
pub(crate) fn coordinates(x: &[f64]) -> String {
    match x {
        [x] => format!("{x:e}"),
        _ => {
            let list: Vec<String> = x.iter().map(|v| format!("{v:e}")).collect();
            format!("[{}]", list.join(", "))
        }
    }
}

/// A knob that turns a key of the scene: `solver.tolerance=[1e-4, 1e-8]`.
///
/// # Errors
/// A message with the fault of the text, and the remedy.
pub fn typed(text: &str) -> Result<Knob, String> {
    let (key, values) = text.split_once('=').ok_or_else(|| {
        format!("`{text}` has no `=`; write --vary 'solver.tolerance=[1e-4, 1e-8]'")
    })?;
    let list: toml::Table = toml::from_str(&format!("values={values}")).map_err(|_| {
        format!("`{values}` is no list; write --vary '{key}=[..., ...]', text in quotes")
    })?;
    let Some(toml::Value::Array(values)) = list.get("values") else {
        return Err(format!(
            "`{values}` is no list; write --vary '{key}=[{values}]' for one other value"
        ));
    };
    if values.is_empty() {
        return Err(format!(
            "`{key}` has no values to vary over; give at least one"
        ));
    }
    Ok(Knob {
        name: key.to_owned(),
        settings: values
            .iter()
            .map(|v| {
                let short = key.rsplit('.').next().unwrap_or(key);
                let value = v.to_string();
                Setting {
                    label: format!("{short} = {}", value.trim_matches('"')),
                    change: Change::Keys(vec![format!("{key}={value}")]),
                }
            })
            .collect(),
    })
}

#[cfg(test)]
#[path = "knobs_tests.rs"]
mod tests;
