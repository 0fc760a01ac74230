//! Conditions of a validated scene.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::bounds_checks;
use super::error::{SceneError, SceneErrorKind};
use super::expression::Expression;
use super::region::{Region, region, unknown_set};
use super::solve::{Clock, Pacing};
use super::source::Span;
use super::spec::{ConditionSpec, DisplacementSpec, ShapeSpec, VelocitySpec};
use super::value::Text;
use crate::mesh::{Facet, Mesh};
use crate::tensor::{Vector, padded};

/// A vector field, component by component; components left out are free or zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Components<const D: usize>(pub [Option<Expression>; D]);

impl PartialEq for Expression {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

impl<const D: usize> Components<D> {
    /// The component along `axis` at `x`, if it is given.
    pub fn at(&self, axis: usize, x: &Vector<D>) -> Option<f64> {
        self.0[axis].as_ref().map(|e| e.eval(&padded(x)))
    }

    /// The component along `axis` at `x` and time `t`, if it is given.
    pub fn at_time(&self, axis: usize, x: &Vector<D>, t: f64) -> Option<f64> {
        self.0[axis].as_ref().map(|e| e.eval_at(&padded(x), t))
    }

    /// The vector at `x` and time `t`, zero where nothing is given.
    pub fn vector(&self, x: &Vector<D>, t: f64) -> Vector<D> {
        Vector::from_fn(|k, _| self.at_time(k, x, t).unwrap_or(0.0))
    }

    /// Whether any component changes with time.
    pub fn depends_on_time(&self) -> bool {
        self.0.iter().flatten().any(Expression::depends_on_time)
    }

    /// Whether any component changes in space.
    pub fn depends_on_position(&self) -> bool {
        self.0.iter().flatten().any(Expression::depends_on_position)
    }
}

/// Where a displacement is prescribed.
#[derive(Clone, Debug, PartialEq)]
pub enum Support<const D: usize> {
    /// On a named set of the mesh: its nodes, and the facets among them if it is a set of facets.
    Set {
        /// Its name.
        name: String,
        /// Its nodes.
        nodes: Vec<u32>,
        /// Its facets.
        facets: Vec<Facet>,
    },
    /// At all sites inside a region.
    Inside(Region<D>),
}

/// A displacement given by a function: another solution, say. A program sets it; a scene file has expressions.
#[derive(Clone)]
pub struct Field<const D: usize>(FieldFunction<D>);

type FieldFunction<const D: usize> = Arc<dyn Fn(&Vector<D>) -> Option<Vector<D>> + Send + Sync>;

impl<const D: usize> Field<D> {
    /// Prescribes `function(x)` at every site where it has a value.
    pub fn new(function: impl Fn(&Vector<D>) -> Option<Vector<D>> + Send + Sync + 'static) -> Self {
        Self(Arc::new(function))
    }

    /// The displacement at `x`, if it is prescribed there.
    pub fn at(&self, x: &Vector<D>) -> Option<Vector<D>> {
        (self.0)(x)
    }
}

impl<const D: usize> std::fmt::Debug for Field<D> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Field")
    }
}

impl<const D: usize> PartialEq for Field<D> {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// What is prescribed.
#[derive(Clone, Debug, PartialEq)]
pub enum Prescribed<const D: usize> {
    /// Displacement.
    Displacement(Support<D>),
    /// Velocity, in a scene that moves; the displacement begins with the one at time zero.
    Velocity(Support<D>),
    /// Displacement as a function of position; the components of the condition are not used.
    Field(Field<D>),
    /// Force per area on facets.
    Traction(Vec<Facet>),
    /// Force per volume inside a region.
    BodyForce(Region<D>),
}

impl<const D: usize> Condition<D> {
    /// The sites that the condition holds, if it prescribes how they move.
    pub fn support(&self) -> Option<&Support<D>> {
        match &self.prescribed {
            Prescribed::Displacement(support) | Prescribed::Velocity(support) => Some(support),
            _ => None,
        }
    }

    /// Whether the condition prescribes how sites move.
    pub fn holds(&self) -> bool {
        self.support().is_some() || matches!(self.prescribed, Prescribed::Field(_))
    }

    /// A displacement given by a function.
    pub fn field(name: &str, field: Field<D>) -> Self {
        Self {
            name: name.to_owned(),
            prescribed: Prescribed::Field(field),
            components: Components(std::array::from_fn(|_| None)),
        }
    }
}

/// A condition of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition<const D: usize> {
    /// Its name.
    pub name: String,
    /// What and where.
    pub prescribed: Prescribed<D>,
    /// How much.
    pub components: Components<D>,
}

/// All conditions.
pub(crate) fn conditions<const D: usize>(
    spec: &BTreeMap<Text, ConditionSpec>,
    mesh: &Mesh<D>,
    clock: Clock,
) -> Result<Vec<Condition<D>>, SceneError> {
    let mut found = Vec::with_capacity(spec.len());
    for (name, condition) in spec {
        found.push(one(name, condition, mesh, clock)?);
    }
    let holds = |c: &Condition<D>| matches!(c.prescribed, Prescribed::Displacement(_));
    if clock.pacing != Pacing::Moving && !found.iter().any(holds) {
        return Err(SceneError::new(
            SceneErrorKind::Missing,
            "no condition prescribes a displacement: nothing holds the body",
        )
        .label(0..0, "no [conditions.NAME.displacement] in this scene")
        .help("add one, for example [conditions.base.displacement] with on = \"bottom\", y = 0"));
    }
    agree(spec, &found, mesh, clock)?;
    Ok(found)
}

/// Where a condition holds: a set of the mesh, or a shape.
fn support<const D: usize>(
    place: &str,
    name: &Text,
    on: Option<&Text>,
    inside: Option<&ShapeSpec>,
    mesh: &Mesh<D>,
) -> Result<Support<D>, SceneError> {
    Ok(match (on, inside) {
        (Some(set), None) => {
            let at = format!("{place}.on");
            let known = mesh.set_names();
            let Some(nodes) = mesh.nodes_of_set(&set.value) else {
                return Err(unknown_set(&at, set, "set", &known, mesh));
            };
            not_empty(&at, set, nodes.len())?;
            Support::Set {
                name: set.value.clone(),
                nodes,
                facets: mesh.facet_sets.get(&set.value).cloned().unwrap_or_default(),
            }
        }
        (None, Some(shape)) => Support::Inside(self::inside(place, name, shape, mesh)?),
        (both, _) => {
            let (what, label) = match both {
                Some(_) => ("both `on` and `inside`", "two places"),
                None => ("neither `on` nor `inside`", "where?"),
            };
            return Err(
                SceneError::new(SceneErrorKind::Choice, format!("`{place}` has {what}"))
                    .label(name.span.clone(), label)
                    .help("keep one: `on = \"set\"` of the mesh, or `inside = { box = ... }`"),
            );
        }
    })
}

/// A condition: what is prescribed, where, and by which components.
fn one<const D: usize>(
    name: &Text,
    spec: &ConditionSpec,
    mesh: &Mesh<D>,
    clock: Clock,
) -> Result<Condition<D>, SceneError> {
    let (kind, given) = match spec {
        ConditionSpec::Displacement(c) => ("displacement", [&c.x, &c.y, &c.z]),
        ConditionSpec::Velocity(c) => ("velocity", [&c.x, &c.y, &c.z]),
        ConditionSpec::Traction(c) => ("traction", [&c.x, &c.y, &c.z]),
        ConditionSpec::BodyForce(c) => ("body-force", [&c.x, &c.y, &c.z]),
    };
    let place = format!("conditions.{name}.{kind}");
    let components = components::<D>(&place, name, given)?;
    for (axis, e) in ["x", "y", "z"].iter().zip(&components.0) {
        if let Some(e) = e {
            clock.admits(&format!("{place}.{axis}"), e)?;
        }
    }
    let prescribed = match spec {
        ConditionSpec::Displacement(DisplacementSpec { on, inside, .. })
        | ConditionSpec::Velocity(VelocitySpec { on, inside, .. }) => {
            if kind == "velocity" {
                moves(&place, name, &components, clock)?;
            }
            let support = support(&place, name, on.as_ref(), inside.as_ref(), mesh)?;
            if let Support::Set { nodes, .. } = &support {
                finite(
                    &place,
                    name,
                    &components,
                    clock,
                    nodes.iter().map(|&n| mesh.nodes[n as usize]),
                )?;
            }
            if kind == "velocity" {
                Prescribed::Velocity(support)
            } else {
                Prescribed::Displacement(support)
            }
        }
        ConditionSpec::Traction(c) => {
            let Some(facets) = mesh.facet_sets.get(&c.on.value) else {
                let known: Vec<&str> = mesh.facet_sets.keys().map(String::as_str).collect();
                let wanted = ["set of end points", "set of edges", "set of faces"][D - 1];
                return Err(unknown_set(
                    &format!("{place}.on"),
                    &c.on,
                    wanted,
                    &known,
                    mesh,
                ));
            };
            not_empty(&format!("{place}.on"), &c.on, facets.len())?;
            let nodes = facets.iter().flatten().map(|&n| mesh.nodes[n as usize]);
            finite(&place, name, &components, clock, nodes)?;
            Prescribed::Traction(facets.clone())
        }
        ConditionSpec::BodyForce(c) => {
            let region = match &c.inside {
                Some(shape) => inside(&place, name, shape, mesh)?,
                None => Region::Shape {
                    shape: crate::shape::Shape::Everywhere,
                    margin: 0.0,
                },
            };
            let within = (0..mesh.cell_count())
                .map(|i| mesh.centroid(i))
                .filter(|x| region.contains(x, 0.0));
            finite(&place, name, &components, clock, within)?;
            Prescribed::BodyForce(region)
        }
    };
    Ok(Condition {
        name: name.value.clone(),
        prescribed,
        components,
    })
}

/// Checks that a velocity is one that a run can follow.
fn moves<const D: usize>(
    place: &str,
    name: &Text,
    components: &Components<D>,
    clock: Clock,
) -> Result<(), SceneError> {
    if clock.pacing != Pacing::Moving {
        return Err(SceneError::new(
            SceneErrorKind::Conflict,
            format!("`{place}` in a scene that does not move"),
        )
        .label(name.span.clone(), "a velocity")
        .help("add [solve.explicit] with duration = ..., or prescribe a displacement"));
    }
    match components
        .0
        .iter()
        .flatten()
        .find(|e| e.depends_on_time() && e.depends_on_position())
    {
        None => Ok(()),
        Some(e) => Err(SceneError::new(
            SceneErrorKind::Conflict,
            format!("`{place}` depends on time and on position"),
        )
        .label(e.span.clone(), "has no displacement in closed form")
        .help("prescribe the displacement, its integral over t; or let the velocity depend on one of the two")),
    }
}

pub(crate) fn components<const D: usize>(
    place: &str,
    name: &Text,
    given: [&Option<Expression>; 3],
) -> Result<Components<D>, SceneError> {
    let axes = ["x", "y", "z"];
    if let Some((k, e)) = (D..3).find_map(|k| given[k].as_ref().map(|e| (k, e))) {
        return Err(SceneError::new(
            SceneErrorKind::Dimension,
            format!("`{place}.{}` in a scene of dimension {D}", axes[k]),
        )
        .label(e.span.clone(), "no such axis")
        .help(format!("remove `{}`", axes[k])));
    }
    for (axis, expression) in axes.iter().zip(given) {
        if let Some(e) = expression {
            bounds_checks::no_further_axes::<D>(&format!("{place}.{axis}"), e)?;
        }
    }
    if given.iter().all(|e| e.is_none()) {
        return Err(SceneError::new(
            SceneErrorKind::Missing,
            format!("`{place}` prescribes no component"),
        )
        .label(name.span.clone(), "nothing prescribed")
        .help(format!(
            "add {}",
            ["x = 0", "x = 0 or y = 0", "x = 0, y = 0 or z = 0"][D - 1]
        )));
    }
    Ok(Components(std::array::from_fn(|k| given[k].clone())))
}

pub(crate) fn inside<const D: usize>(
    place: &str,
    name: &Text,
    shape: &ShapeSpec,
    mesh: &Mesh<D>,
) -> Result<Region<D>, SceneError> {
    if let ShapeSpec::Set(set) = shape {
        return Err(SceneError::new(
            SceneErrorKind::Conflict,
            format!("`{place}.inside` is the set `{set}`"),
        )
        .label(set.span.clone(), "no shape")
        .help("name a set by `on`, or give a shape such as `box`"));
    }
    let found = region(&format!("{place}.inside"), shape, mesh)?;
    let tolerance = 1e-9 * (mesh.bounds().1 - mesh.bounds().0).norm();
    let holds_something = mesh.nodes.iter().any(|x| found.contains(x, tolerance))
        || (0..mesh.cell_count()).any(|c| found.contains(&mesh.centroid(c), tolerance));
    if holds_something {
        return Ok(found);
    }
    Err(SceneError::new(
        SceneErrorKind::Empty,
        format!("`{place}.inside` holds no part of the mesh"),
    )
    .label(name.span.clone(), "acts nowhere")
    .help(extent(mesh)))
}

/// The extent of a mesh, as a remedy for what misses it.
pub(crate) fn extent<const D: usize>(mesh: &Mesh<D>) -> String {
    let (lo, hi) = mesh.bounds();
    format!(
        "the mesh reaches from {:?} to {:?}",
        lo.as_slice(),
        hi.as_slice()
    )
}

fn not_empty(place: &str, set: &Text, count: usize) -> Result<(), SceneError> {
    if count > 0 {
        return Ok(());
    }
    Err(SceneError::new(
        SceneErrorKind::Empty,
        format!("`{place}`: the set `{set}` of the mesh is empty"),
    )
    .label(set.span.clone(), "empty")
    .help("put facets or nodes into it, or name another set"))
}

pub(crate) fn finite<const D: usize>(
    place: &str,
    name: &Text,
    components: &Components<D>,
    clock: Clock,
    positions: impl Iterator<Item = Vector<D>>,
) -> Result<(), SceneError> {
    let moving = components.depends_on_time();
    for x in positions {
        for &t in clock.instants(moving) {
            for k in 0..D {
                let Some(value) = components.at_time(k, &x, t).filter(|v| !v.is_finite()) else {
                    continue;
                };
                let span = components.0[k]
                    .as_ref()
                    .map_or(name.span.clone(), |e| e.span.clone());
                let when = if moving {
                    format!(", t = {t}")
                } else {
                    String::new()
                };
                return Err(SceneError::new(
                    SceneErrorKind::WrongValue,
                    format!(
                        "`{place}.{}` is {value} at {:?}{when}",
                        ["x", "y", "z"][k],
                        x.as_slice()
                    ),
                )
                .label(span, "no finite number there")
                .help(
                    "choose between branches with if(condition, a, b), or restrict the condition",
                ));
            }
        }
    }
    Ok(())
}

/// Refuses two motions of one node that differ.
fn agree<const D: usize>(
    spec: &BTreeMap<Text, ConditionSpec>,
    conditions: &[Condition<D>],
    mesh: &Mesh<D>,
    clock: Clock,
) -> Result<(), SceneError> {
    let mut seen: BTreeMap<(u32, usize), usize> = BTreeMap::new();
    for (number, condition) in conditions.iter().enumerate() {
        let Some(Support::Set { nodes, .. }) = condition.support() else {
            continue;
        };
        for &n in nodes {
            for k in (0..D).filter(|&k| condition.components.0[k].is_some()) {
                let Some(other) = seen.insert((n, k), number).map(|o| &conditions[o]) else {
                    continue;
                };
                let x = &mesh.nodes[n as usize];
                let Some((before, value, t)) = difference(other, condition, k, x, clock) else {
                    continue;
                };
                let span = |name: &str| -> Span {
                    spec.get_key_value(name)
                        .map_or(0..0, |(k, _)| k.span.clone())
                };
                let (first, second) = (&other.name, &condition.name);
                let when = if t > 0.0 {
                    format!(", t = {t}")
                } else {
                    String::new()
                };
                return Err(SceneError::new(
                    SceneErrorKind::Conflict,
                    format!(
                        "`{first}` and `{second}` prescribe the {} displacements {before} and {value} at {:?}{when}",
                        ["x", "y", "z"][k],
                        x.as_slice()
                    ),
                )
                .label(span(second), "one")
                .label(span(first), "the other")
                .help("let both agree where their sets meet, or leave the component out of one"));
            }
        }
    }
    Ok(())
}

/// Two values that differ, and when.
fn difference<const D: usize>(
    a: &Condition<D>,
    b: &Condition<D>,
    axis: usize,
    x: &Vector<D>,
    clock: Clock,
) -> Option<(f64, f64, f64)> {
    let kinds = [a, b].map(|c| matches!(c.prescribed, Prescribed::Velocity(_)));
    let moving = [a, b].iter().any(|c| c.components.depends_on_time());
    clock.instants(moving).iter().find_map(|&t| {
        let (p, q) = (
            a.components.at_time(axis, x, t)?,
            b.components.at_time(axis, x, t)?,
        );
        // a displacement and a velocity agree only where both are zero
        let agree = if kinds[0] == kinds[1] {
            (p - q).abs() <= 1e-9 * p.abs().max(q.abs())
        } else {
            p == 0.0 && q == 0.0
        };
        (!agree).then_some((p, q, t))
    })
}
