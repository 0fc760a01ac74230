//! Heat conduction of a scene, checked.

#![deny(clippy::wildcard_enum_match_arm)]

use std::collections::BTreeMap;
use std::sync::Arc;

use toml::Spanned;

use super::bounds_checks;
use super::condition_at::ConditionAt;
use super::error::SceneError;
use super::expression::Expression;
use super::materials::Material;
use super::places::Support;
use super::region::Region;
use super::solve::{Clock, Pacing, still};
use super::spec::{ConductionSpec, HeatConditionSpec};
use super::value::Text;
use crate::mesh::{Facet, Mesh};
use crate::tensor::{Vector, padded};

/// Heat conduction in a body: a problem to be solved before the body deforms.
#[derive(Clone, Debug)]
pub struct Conduction<const D: usize> {
    /// The mesh as the scene has it: a patch that its zone gets later changes no temperature.
    pub mesh: Arc<Mesh<D>>,
    /// Conductivity of each cell [W/(m K)].
    pub conductivity: Vec<f64>,
    /// Heat capacity of each cell per volume [J/(m³ K)]; empty where the temperature is steady.
    pub capacity: Vec<f64>,
    /// Temperature at time zero; none where the temperature is steady at every instant.
    pub initial: Option<Expression>,
    /// The instants that the temperature is solved for, the first being zero.
    pub times: Vec<f64>,
    /// Conditions by name.
    pub conditions: Vec<HeatCondition<D>>,
}

/// A condition of heat conduction.
#[derive(Clone, Debug)]
pub struct HeatCondition<const D: usize> {
    /// Its name.
    pub name: String,
    /// The prescribed quantity and its place.
    pub kind: HeatConditionKind,
    /// Temperature, flux \[W/m²\], temperature of the surroundings, or source \[W/m³\].
    pub value: Expression,
}

/// Quantity that a condition of heat conduction prescribes, and its place.
#[derive(Clone, Debug)]
pub enum HeatConditionKind {
    /// Temperature at nodes.
    Temperature(Vec<u32>),
    /// Flux into the body on facets.
    Flux(Vec<Facet>),
    /// Heat transfer on facets, and its coefficient [W/(m² K)].
    Transfer(Vec<Facet>, f64),
    /// Source in cells.
    Source(Vec<usize>),
}

/// Time steps where a scene names no number.
const STEPS: usize = 100;

/// The most time steps: every node keeps a temperature of each.
const MOST_STEPS: usize = 100_000;

/// Place of the table in a scene.
const PLACE: &str = "temperature.conduction";

/// The heat conduction that a scene types, on the mesh of the whole body.
///
/// # Errors
/// A [`SceneError`] for a material without the numbers that conduction takes, a place that the mesh does not have, and values that are no numbers there.
pub(super) fn conduction<const D: usize>(
    typed: &Spanned<ConductionSpec>,
    mesh: &Mesh<D>,
    (materials, cell_material): (&[Material<D>], &[u16]),
    clock: Clock,
) -> Result<Conduction<D>, SceneError> {
    let spec = typed.get_ref();
    let times = times(spec, clock)?;
    let conditions = conditions(&spec.conditions, mesh, clock)?;
    let holds = |c: &HeatCondition<D>| match c.kind {
        HeatConditionKind::Temperature(_) | HeatConditionKind::Transfer(..) => true,
        HeatConditionKind::Flux(_) | HeatConditionKind::Source(_) => false,
    };
    if spec.initial.is_none() && !conditions.iter().any(holds) {
        return Err(SceneError::missing(format!(
            "no condition of `{PLACE}` prescribes a temperature: a steady one is known but for a constant"
        ))
        .label(typed.span(), "no temperature and no convection")
        .help("add one, for example [temperature.conduction.conditions.NAME.temperature] with on = \"left\", value = 20"));
    }
    if let Some(initial) = &spec.initial {
        let place = format!("{PLACE}.initial");
        bounds_checks::no_further_axes::<D>(&place, initial)?;
        still(&place, initial)?;
        finite(&place, initial, mesh.nodes.iter(), &[0.0])?;
    }
    let of_cells = |key: &str, of: fn(&Material<D>) -> Option<f64>| {
        let each = materials.iter().map(|m| {
            of(m).ok_or_else(|| {
                SceneError::missing(format!(
                    "`{PLACE}`, and the material `{}` has no {key}",
                    m.name
                ))
                .label(typed.span(), "heat conduction")
                .help(format!("add {key} = ... to it"))
            })
        });
        let each: Vec<f64> = each.collect::<Result<_, _>>()?;
        Ok(cell_material
            .iter()
            .map(|&m| each[usize::from(m)])
            .collect())
    };
    Ok(Conduction {
        mesh: Arc::new(mesh.clone()),
        conductivity: of_cells("conductivity", |m| m.conductivity)?,
        capacity: match spec.initial {
            Some(_) => of_cells("heat-capacity", |m| m.heat_capacity)?,
            None => Vec::new(),
        },
        initial: spec.initial.clone(),
        times,
        conditions,
    })
}

/// The instants that the temperature is solved for.
fn times(spec: &ConductionSpec, clock: Clock) -> Result<Vec<f64>, SceneError> {
    let end = match clock.pacing {
        Pacing::Loading | Pacing::Moving => clock.end(),
        Pacing::Still | Pacing::Lasting => {
            let typed = (spec.initial.as_ref().map(|e| ("initial", e.span.clone())))
                .or_else(|| spec.steps.as_ref().map(|s| ("steps", s.span.clone())));
            return match typed {
                None => Ok(vec![0.0]),
                Some((key, span)) if clock.pacing == Pacing::Lasting => Err(SceneError::conflict(
                    format!("`{PLACE}.{key}` in a scene of several stages"),
                )
                .label(span, "each stage has a time of its own")
                .help("remove it for the steady temperature, which lasts through all stages")),
                Some((key, span)) => Err(SceneError::conflict(format!("`{PLACE}.{key}` in a static scene"))
                    .label(span, "there is no time")
                    .help("remove it for the steady temperature, or add [solve.quasi-static] with steps and duration")),
            };
        }
    };
    let steps = match &spec.steps {
        None => STEPS,
        Some(steps) if (1..=MOST_STEPS).contains(&steps.value) => steps.value,
        Some(steps) => {
            return Err(
                SceneError::wrong_value(format!("`{PLACE}.steps` is {}", steps.value))
                    .label(
                        steps.span.clone(),
                        format!("must lie between 1 and {MOST_STEPS}"),
                    )
                    .help("100 suits most scenes; every node keeps a temperature of each"),
            );
        }
    };
    let time = |k: usize| end * (k as f64 / steps as f64);
    Ok((0..=steps).map(time).collect())
}

fn conditions<const D: usize>(
    spec: &BTreeMap<Text, HeatConditionSpec>,
    mesh: &Mesh<D>,
    clock: Clock,
) -> Result<Vec<HeatCondition<D>>, SceneError> {
    let mut found = Vec::with_capacity(spec.len());
    for (name, condition) in spec {
        found.push(HeatCondition::new(name, condition, mesh, clock)?);
    }
    agree(spec, &found, mesh, clock)?;
    Ok(found)
}

impl<const D: usize> HeatCondition<D> {
    fn new(
        name: &Text,
        spec: &HeatConditionSpec,
        mesh: &Mesh<D>,
        clock: Clock,
    ) -> Result<Self, SceneError> {
        let (key, value_key, value) = match spec {
            HeatConditionSpec::Temperature(s) => ("temperature", "value", &s.value),
            HeatConditionSpec::Convection(s) => ("convection", "ambient", &s.ambient),
            HeatConditionSpec::Flux(s) => ("flux", "value", &s.value),
            HeatConditionSpec::Source(s) => ("source", "value", &s.value),
        };
        let place = format!("{PLACE}.conditions.{name}.{key}");
        let at = ConditionAt {
            place: &place,
            name,
            mesh,
            clock,
        };
        // a line through cells is no surface
        let facets = |on: &Text| at.faces(on).and_then(|_| Ok(at.facet_set(on)?.to_vec()));
        let kind = match spec {
            HeatConditionSpec::Temperature(s) => HeatConditionKind::Temperature(nodes(
                &at,
                at.support(s.on.as_ref(), s.inside.as_ref())?,
            )?),
            HeatConditionSpec::Convection(s) => {
                let coefficient = format!("{place}.coefficient");
                let h = bounds_checks::positive(&coefficient, &s.coefficient)?;
                HeatConditionKind::Transfer(facets(&s.on)?, h)
            }
            HeatConditionSpec::Flux(s) => HeatConditionKind::Flux(facets(&s.on)?),
            HeatConditionSpec::Source(s) => {
                let region = match &s.inside {
                    Some(shape) => at.inside(shape)?,
                    None => Region::everywhere(),
                };
                let cells = 0..mesh.cell_count();
                HeatConditionKind::Source(
                    cells
                        .filter(|&c| region.contains(&mesh.centroid(c), 0.0))
                        .collect(),
                )
            }
        };
        let place = format!("{place}.{value_key}");
        bounds_checks::no_further_axes::<D>(&place, value)?;
        clock.admits(&place, value)?;
        let instants = clock.instants(value.depends_on_time());
        finite(&place, value, kind.nodes(mesh).iter(), instants)?;
        Ok(Self {
            name: name.value.clone(),
            kind,
            value: value.clone(),
        })
    }
}

impl HeatConditionKind {
    /// Positions of the nodes that it acts on.
    fn nodes<const D: usize>(&self, mesh: &Mesh<D>) -> Vec<Vector<D>> {
        let at = |&n: &u32| mesh.nodes[n as usize];
        match self {
            Self::Temperature(nodes) => nodes.iter().map(at).collect(),
            Self::Flux(facets) | Self::Transfer(facets, _) => {
                facets.iter().flatten().map(at).collect()
            }
            Self::Source(cells) => cells.iter().map(|&c| mesh.centroid(c)).collect(),
        }
    }
}

/// The nodes of a set, or those inside a shape, of which there must be one.
fn nodes<const D: usize>(
    at: &ConditionAt<'_, D>,
    support: Support<D>,
) -> Result<Vec<u32>, SceneError> {
    let region = match support {
        Support::Set { nodes, .. } => return Ok(nodes),
        Support::Inside(region) => region,
    };
    let (low, high) = at.mesh.bounds();
    let tolerance = 1e-9 * (high - low).norm();
    let held = |n: &u32| region.contains(&at.mesh.nodes[*n as usize], tolerance);
    let found: Vec<u32> = (0..at.mesh.nodes.len() as u32).filter(held).collect();
    if found.is_empty() {
        return Err(
            SceneError::empty(format!("`{}.inside` holds no node of the mesh", at.place))
                .label(at.name.span.clone(), "acts nowhere")
                .help("enlarge the shape by a cell, or refine the mesh there"),
        );
    }
    Ok(found)
}

/// Refuses values that are no numbers.
pub(super) fn finite<'a, const D: usize>(
    place: &str,
    value: &Expression,
    positions: impl Iterator<Item = &'a Vector<D>>,
    instants: &[f64],
) -> Result<(), SceneError> {
    for x in positions {
        for &t in instants {
            let found = value.eval_at(&padded(x), t);
            if !found.is_finite() {
                return Err(SceneError::wrong_value(format!(
                    "`{place}` is {found} at {:?}, t = {t}",
                    x.as_slice()
                ))
                .label(value.span.clone(), "no finite number there")
                .help("choose between branches with if(condition, a, b)"));
            }
        }
    }
    Ok(())
}

/// Refuses two temperatures of one node that differ.
fn agree<const D: usize>(
    spec: &BTreeMap<Text, HeatConditionSpec>,
    conditions: &[HeatCondition<D>],
    mesh: &Mesh<D>,
    clock: Clock,
) -> Result<(), SceneError> {
    let mut seen: BTreeMap<u32, &HeatCondition<D>> = BTreeMap::new();
    let span = |name: &str| {
        spec.get_key_value(name)
            .map_or(0..0, |(k, _)| k.span.clone())
    };
    for condition in conditions {
        let HeatConditionKind::Temperature(nodes) = &condition.kind else {
            continue;
        };
        for &n in nodes {
            let Some(other) = seen.insert(n, condition) else {
                continue;
            };
            let x = padded(&mesh.nodes[n as usize]);
            for &t in clock.instants(true) {
                let [p, q] = [other, condition].map(|c| c.value.eval_at(&x, t));
                if (p - q).abs() > 1e-9 * p.abs().max(q.abs()) {
                    let (first, second) = (&other.name, &condition.name);
                    return Err(SceneError::conflict(format!(
                        "`{first}` and `{second}` of `{PLACE}.conditions` prescribe the temperatures {p} and {q} at {:?}, t = {t}",
                        mesh.nodes[n as usize].as_slice()
                    ))
                    .label(span(second), "one")
                    .label(span(first), "the other")
                    .help("let both agree where their sets meet"));
                }
            }
        }
    }
    Ok(())
}
