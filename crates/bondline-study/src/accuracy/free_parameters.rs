//! Parameters that a scene leaves open, and the keys of a candidate.

use crate::variants::{self, Base, coordinates};
use bondline::scene::SceneError;
use bondline::scene::Source;
use bondline::scene::spec::SceneSpec;

/// A scene with an `accuracy`, as far as the choice looks at it.
#[derive(Clone, Debug)]
pub(super) struct AccuracyRequest {
    /// The error that is wanted.
    pub accuracy: f64,
    /// A complete version, without meaning beyond what the scene itself says.
    pub spec: SceneSpec,
    /// Cracks, voids, or bonds that can break: the horizon is a length of the material.
    pub breaks: bool,
    shape: String,
    min: Vec<f64>,
    max: Vec<f64>,
    axes: bool,
    pub coupling: bool,
    pub horizon: Option<f64>,
    lattice: bool,
    /// Keys that must be there, whatever they say, where no point is.
    idle: Vec<String>,
    /// Cracks around which a zone may be drawn, where the scene draws none: the tables of their shapes.
    around: Option<Vec<toml::Table>>,
    /// True if the scene itself asks for peridynamics somewhere.
    pub wants_points: bool,
}

/// One way to fill in a scene, but for its spacing.
#[derive(Clone, Debug, PartialEq)]
pub struct Family {
    /// The coupling, where the scene leaves it open.
    pub coupling: Option<&'static str>,
    /// m = δ/h, where the horizon is open; without points none.
    pub ratio: Option<f64>,
    /// Edge of an element over the spacing of the points.
    pub coarser: usize,
    /// Horizons between a crack and the edge of the zone, where the zone is open.
    pub padding: Option<f64>,
}

/// A grid that fits is looked for among so many.
const MOST_STEPS: usize = 200;

const FILLED: [&str; 3] = ["x", "y", "z"];

fn at<'a>(table: &'a toml::Table, path: &[&str]) -> Option<&'a toml::Value> {
    let (last, tables) = path.split_last()?;
    let mut here = table;
    for key in tables {
        here = here.get(*key)?.as_table()?;
    }
    here.get(*last)
}

/// Returns true if the scene itself says where it is nonlocal, or leaves that to `zones.auto`.
fn zoned(spec: &SceneSpec) -> bool {
    spec.zones.nonlocal.is_some() || spec.zones.auto.is_some()
}

/// The error that a scene asks for, if it does.
fn wanted_error(spec: &SceneSpec, source: &Source) -> Result<Option<f64>, SceneError> {
    match &spec.accuracy {
        Some(a) if a.value > 0.0 && a.value < 1.0 => Ok(Some(a.value)),
        Some(a) => Err(
            SceneError::wrong_value(format!("`accuracy` is {}", a.value))
                .label(a.span.clone(), "must lie between 0 and 1")
                .help("write the relative error that is wanted, accuracy = 0.01 for 1 %")
                .shown_in(source),
        ),
        None => Ok(None),
    }
}

impl AccuracyRequest {
    /// Reads the parameters that a scene with an `accuracy` leaves open; `None` without one.
    pub fn of(source: &Source) -> Result<Option<Self>, SceneError> {
        let table = source.table()?;
        if !table.contains_key("accuracy") {
            return Ok(None);
        }
        let shape = at(&table, &["mesh"])
            .and_then(toml::Value::as_table)
            .and_then(|m| m.keys().next().cloned())
            .unwrap_or_default();
        let names = match shape.as_str() {
            "line" => &FILLED[..1],
            "rectangle" => &FILLED[..2],
            "box" => &FILLED[..3],
            _ => &FILLED[..0],
        };
        let missing = names
            .iter()
            .filter(|a| at(&table, &["mesh", &shape, a]).is_none())
            .count();
        let axes = !names.is_empty() && missing == names.len();
        let points = table.contains_key("peridynamics");
        let horizon = points && at(&table, &["peridynamics", "horizon"]).is_none();
        let lattice = points && at(&table, &["peridynamics", "points"]).is_none();
        let mut filled = source.clone();
        if axes {
            for name in names {
                filled.push_override(&format!("mesh.{shape}.{name}.cells=2"))?;
            }
        }
        let mut idle = Vec::new();
        if horizon {
            idle.push("peridynamics.horizon=1".to_owned());
        }
        if lattice {
            idle.push("peridynamics.points=cells".to_owned());
        }
        for o in &idle {
            filled.push_override(o)?;
        }
        let spec = SceneSpec::parse(&filled)?;
        let Some(accuracy) = wanted_error(&spec, source)? else {
            return Ok(None);
        };
        let base = Base::of(&spec);
        let (min, max) = variants::corners(&spec).unwrap_or_default();
        let drawn = zoned(&spec);
        let cracks = at(&table, &["cracks"]).and_then(toml::Value::as_table);
        let only_cracks = base.breaks && spec.voids.is_empty() && !base.can_break;
        let around = (points && !drawn && only_cracks).then(|| {
            let shapes = cracks.into_iter().flat_map(|c| c.values());
            shapes.filter_map(toml::Value::as_table).cloned().collect()
        });
        let coupling = spec.coupling.is_none();
        let typed = spec.coupling.as_ref().map(|c| c.get_ref().traits().name);
        let asked = Self {
            accuracy,
            breaks: base.breaks,
            shape,
            min,
            max,
            axes,
            coupling,
            horizon: match horizon {
                true => None,
                false => spec
                    .peridynamics
                    .as_ref()
                    .and_then(|p| p.horizon.as_ref()?.as_constant()),
            },
            lattice,
            idle,
            around,
            wants_points: points && typed != Some("local") && (drawn || !coupling),
            spec,
        };
        asked.refuse(horizon, points, source)?;
        Ok(Some(asked))
    }

    /// Refuses to choose a length of the material.
    fn refuse(&self, horizon: bool, points: bool, source: &Source) -> Result<(), SceneError> {
        if !self.breaks || points && !horizon {
            return Ok(());
        }
        Err(SceneError::missing(
            "`accuracy` cannot choose a horizon where bonds are cut or can break",
        )
        .label(self.spec.kinematics.span(), "in this scene")
        .help(
            "the horizon is a length of the material there: add [peridynamics] with horizon = ...",
        )
        .shown_in(source))
    }

    /// Returns true if the spacing is open.
    pub fn has_ladder(&self) -> bool {
        self.axes || self.points() && self.lattice
    }

    /// Returns true if candidates have peridynamic points.
    pub fn points(&self) -> bool {
        self.breaks || self.wants_points
    }

    /// Cells along the shortest edge that put the faces of all cut-outs on the grid, `n` or the next more.
    pub fn fitting(&self, n: usize) -> usize {
        if !self.axes {
            return n;
        }
        let fits = |n: usize| {
            let cell = self.shortest() / n as f64;
            variants::cutouts(&self.spec).iter().all(|(low, high)| {
                (0..self.min.len()).all(|a| {
                    let length = self.max[a] - self.min[a];
                    let size = length / (length / cell).round().max(1.0);
                    [low[a], high[a]].iter().all(|x| {
                        let at = (x - self.min[a]) / size;
                        (at - at.round()).abs() < 1e-9
                    })
                })
            })
        };
        (n..n + MOST_STEPS).find(|&n| fits(n)).unwrap_or(n)
    }

    fn shortest(&self) -> f64 {
        self.lengths().fold(f64::INFINITY, f64::min)
    }

    fn lengths(&self) -> impl Iterator<Item = f64> + '_ {
        self.max.iter().zip(&self.min).map(|(b, a)| b - a)
    }

    /// Everything that may be chosen but the spacing.
    pub fn families(&self) -> Vec<Family> {
        if !self.points() {
            return vec![Family {
                coupling: self.coupling.then_some("local"),
                ratio: None,
                coarser: 1,
                padding: None,
            }];
        }
        let couplings: &[Option<&'static str>] = match self.coupling {
            false => &[None],
            // no zone can be drawn around what may break, or around any shape of void
            true if self.breaks && self.around.is_none() && !zoned(&self.spec) => {
                &[Some("nonlocal")]
            }
            true => &[Some("truncated"), Some("splice")],
        };
        let ratio = (self.horizon.is_none() && self.lattice).then_some(2.0);
        let coarser: &[usize] = if self.axes && self.lattice {
            &[1, 2]
        } else {
            &[1]
        };
        let paddings: &[Option<f64>] = match &self.around {
            Some(shapes) if !shapes.is_empty() => &[Some(2.0), Some(4.0)],
            _ => &[None],
        };
        let mut list = Vec::new();
        for &coupling in couplings {
            for &coarser in coarser {
                for &padding in paddings {
                    list.push(Family {
                        coupling,
                        ratio,
                        coarser,
                        padding,
                    });
                }
            }
        }
        list
    }

    /// Cells along the shortest edge on the first rungs of a ladder, or points per edge of a typed element.
    pub fn first(&self, family: &Family) -> usize {
        match (self.horizon, self.points()) {
            _ if !self.axes => 1,
            // two points per horizon
            (Some(delta), true) => {
                (2.0 * self.shortest() / (delta * family.coarser as f64)).ceil() as usize
            }
            _ if self.lengths().count() == 1 => 8,
            _ if self.points() => 6,
            _ => 4,
        }
    }

    /// The keys of a candidate with `n` cells along the shortest edge.
    pub fn overrides(&self, family: &Family, n: usize) -> Vec<String> {
        let mut list = Vec::new();
        if let Some(coupling) = family.coupling {
            list.push(format!("coupling={coupling}"));
        }
        let cell = if self.axes {
            let cell = self.shortest() / n as f64;
            for (name, length) in FILLED.iter().zip(self.lengths()) {
                let cells = (length / cell).round().max(1.0);
                list.push(format!("mesh.{}.{name}.cells={cells}", self.shape));
            }
            cell / family.coarser as f64
        } else {
            Base::of(&self.spec).cell().unwrap_or(1.0) / n as f64
        };
        if !self.points() {
            list.extend(self.idle.iter().cloned());
            return list;
        }
        if self.lattice {
            list.push(format!("peridynamics.points.lattice.spacing={cell:e}"));
        }
        let delta = self.horizon.or_else(|| Some(family.ratio? * cell));
        if self.horizon.is_none()
            && let Some(delta) = delta
        {
            list.push(format!("peridynamics.horizon={delta:e}"));
        }
        if let (Some(padding), Some(shapes), Some(delta)) = (family.padding, &self.around, delta) {
            let zones: Vec<String> = shapes
                .iter()
                .map(|s| {
                    let shape = toml::Value::Table(s.clone()).to_string();
                    let inner = shape.trim();
                    let inner = inner.strip_prefix('{').unwrap_or(inner);
                    let inner = inner.strip_suffix('}').unwrap_or(inner).trim();
                    format!("{{near={{within={:e},{inner}}}}}", padding * delta)
                })
                .collect();
            list.push(format!("zones.nonlocal={{any=[{}]}}", zones.join(",")));
        }
        list
    }

    /// Returns the keys of the reference for errors: elements alone where the horizon is numerical, else peridynamics everywhere.
    pub fn reference(&self, family: &Family, n: usize) -> Vec<String> {
        let coupling = if self.breaks { "nonlocal" } else { "local" };
        let mut list = self.overrides(family, n);
        list.push(format!("coupling={coupling}"));
        list
    }

    /// A candidate in words.
    pub fn words(&self, family: &Family, n: usize) -> String {
        let mut parts = Vec::new();
        if self.axes {
            let cell = self.shortest() / n as f64;
            let cells: Vec<String> = self
                .lengths()
                .map(|l| format!("{}", (l / cell).round().max(1.0)))
                .collect();
            parts.push(format!("{} cells", cells.join(" x ")));
        }
        if self.points() && self.lattice {
            let cell = if self.axes {
                self.shortest() / (n * family.coarser) as f64
            } else {
                Base::of(&self.spec).cell().unwrap_or(1.0) / n as f64
            };
            let m = self.horizon.map(|d| d / cell).or(family.ratio);
            parts.push(format!("points every {}", coordinates(&[cell])));
            parts.extend(m.map(|m| format!("m = {m:.2}")));
        }
        if let Some(padding) = family.padding {
            parts.push(format!("a zone {padding} horizons around cracks"));
        }
        parts.join(", ")
    }
}
