//! The conditions of a scene, each made of what it types, and all of them together.

use std::collections::BTreeMap;

use super::conditions::{
    Components, Condition, Prescribed, Support, components, facet_set, finite, inside, support,
};
use super::error::{SceneError, SceneErrorKind};
use super::expression::Expression;
use super::region::Region;
use super::solve::{Clock, Pacing};
use super::source::Span;
use super::spec::{ConditionSpec, DisplacementSpec, ShapeSpec, VelocitySpec};
use super::surface_conditions;
use super::value::Text;
use crate::mesh::Mesh;
use crate::tensor::Vector;

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
    let holds = |c: &Condition<D>| {
        matches!(
            c.prescribed,
            Prescribed::Displacement(_) | Prescribed::Spring(_)
        )
    };
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

/// Components of a condition as a scene types them.
struct Typed<'a> {
    name: &'a Text,
    place: String,
    given: [&'a Option<Expression>; 3],
}

impl Typed<'_> {
    /// The components, checked.
    fn components<const D: usize>(&self, clock: Clock) -> Result<Components<D>, SceneError> {
        let components = components::<D>(&self.place, self.name, self.given)?;
        for (axis, e) in ["x", "y", "z"].iter().zip(&components.0) {
            if let Some(e) = e {
                clock.admits(&format!("{}.{axis}", self.place), e)?;
            }
        }
        Ok(components)
    }

    fn condition<const D: usize>(
        &self,
        prescribed: Prescribed<D>,
        components: Components<D>,
    ) -> Condition<D> {
        Condition {
            name: self.name.value.clone(),
            prescribed,
            components,
        }
    }
}

/// A condition: what is prescribed, where, and by which components.
fn one<const D: usize>(
    name: &Text,
    spec: &ConditionSpec,
    mesh: &Mesh<D>,
    clock: Clock,
) -> Result<Condition<D>, SceneError> {
    let typed = |kind: &str, given| Typed {
        name,
        place: format!("conditions.{name}.{kind}"),
        given,
    };
    match spec {
        ConditionSpec::Displacement(DisplacementSpec {
            on,
            inside,
            x,
            y,
            z,
        }) => {
            let typed = typed("displacement", [x, y, z]);
            let (support, components) = held(&typed, on.as_ref(), inside.as_ref(), mesh, clock)?;
            Ok(typed.condition(Prescribed::Displacement(support), components))
        }
        ConditionSpec::Velocity(VelocitySpec {
            on,
            inside,
            x,
            y,
            z,
        }) => {
            let typed = typed("velocity", [x, y, z]);
            moves(&typed.place, name, &typed.components::<D>(clock)?, clock)?;
            let (support, components) = held(&typed, on.as_ref(), inside.as_ref(), mesh, clock)?;
            Ok(typed.condition(Prescribed::Velocity(support), components))
        }
        ConditionSpec::Traction(c) => {
            let typed = typed("traction", [&c.x, &c.y, &c.z]);
            let components = typed.components(clock)?;
            let facets = facet_set(&typed.place, &c.on, mesh)?;
            // else a line through cells would carry a load
            surface_conditions::faces(&typed.place, &c.on, mesh)?;
            let nodes = facets.iter().flatten().map(|&n| mesh.nodes[n as usize]);
            finite(&typed.place, name, &components, clock, nodes)?;
            Ok(typed.condition(Prescribed::Traction(facets.to_vec()), components))
        }
        ConditionSpec::BodyForce(c) => {
            let typed = typed("body-force", [&c.x, &c.y, &c.z]);
            let components = typed.components(clock)?;
            let region = match &c.inside {
                Some(shape) => inside(&typed.place, name, shape, mesh)?,
                None => Region::everywhere(),
            };
            let within = (0..mesh.cell_count())
                .map(|i| mesh.centroid(i))
                .filter(|x| region.contains(x, 0.0));
            finite(&typed.place, name, &components, clock, within)?;
            Ok(typed.condition(Prescribed::BodyForce(region), components))
        }
        ConditionSpec::Pressure(c) => surface_conditions::pressure(name, c, mesh, clock),
        ConditionSpec::Spring(c) => surface_conditions::spring(name, c, mesh),
        ConditionSpec::Symmetry(c) => surface_conditions::symmetry(name, c, mesh),
        ConditionSpec::Rotation(c) => surface_conditions::rotation(name, c, mesh, clock),
    }
}

/// Where a motion is prescribed, and its components, which are numbers there.
fn held<const D: usize>(
    typed: &Typed<'_>,
    on: Option<&Text>,
    inside: Option<&ShapeSpec>,
    mesh: &Mesh<D>,
    clock: Clock,
) -> Result<(Support<D>, Components<D>), SceneError> {
    let components = typed.components(clock)?;
    let support = support(&typed.place, typed.name, on, inside, mesh)?;
    if let Support::Set { nodes, .. } = &support {
        let nodes = nodes.iter().map(|&n| mesh.nodes[n as usize]);
        finite(&typed.place, typed.name, &components, clock, nodes)?;
    }
    Ok((support, components))
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
