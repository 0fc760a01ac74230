//! All conditions of a scene together.

#![deny(clippy::wildcard_enum_match_arm)]

use std::collections::BTreeMap;

use super::condition_kinds::ConditionSpec;
use super::conditions::{Condition, ConditionTerm, Prescribed, Support};
use super::error::{SceneError, Span};
use super::solve::{Clock, Pacing};
use super::value::Text;
use crate::mesh::Mesh;
use crate::tensor::Vector;

/// All conditions.
pub(crate) fn conditions<const D: usize>(
    spec: &BTreeMap<Text, ConditionSpec>,
    mesh: &Mesh<D>,
    clock: Clock,
) -> Result<Vec<Condition<D>>, SceneError> {
    let found = spec.iter().map(|typed| built(typed, mesh, clock));
    let found = found.collect::<Result<Vec<_>, _>>()?;
    bear(&found, clock)?;
    agree(spec, &found, mesh, clock)?;
    Ok(found)
}

/// One condition.
pub(super) fn built<const D: usize>(
    (name, condition): (&Text, &ConditionSpec),
    mesh: &Mesh<D>,
    clock: Clock,
) -> Result<Condition<D>, SceneError> {
    let built = condition.build(name, mesh, clock)?;
    let rests = |term: &dyn ConditionTerm<D>| term.holds_at_rest();
    if clock.pacing == Pacing::Still && !built.term().is_none_or(rests) {
        return Err(
            SceneError::conflict(format!("`conditions.{name}` in a static scene"))
                .label(name.span.clone(), "is not linear in the displacement")
                .help("add [solve.quasi-static] with steps = 1, or [solve.explicit]"),
        );
    }
    Ok(built)
}

/// Refuses conditions that hold nothing, where nothing moves.
pub(super) fn bear<const D: usize>(found: &[Condition<D>], clock: Clock) -> Result<(), SceneError> {
    let holds = |c: &Condition<D>| match &c.prescribed {
        Prescribed::Displacement(_) => true,
        Prescribed::Term(term) => term.holds_at_rest(),
        Prescribed::Velocity(_) | Prescribed::Field(_) | Prescribed::Load(_) => false,
    };
    if clock.pacing != Pacing::Moving && !found.iter().any(holds) {
        return Err(SceneError::missing(
            "no condition prescribes a displacement: nothing holds the body",
        )
        .label(0..0, "no [conditions.NAME.displacement] in this scene")
        .help("add one, for example [conditions.base.displacement] with on = \"bottom\", y = 0"));
    }
    Ok(())
}

/// Refuses two motions of one node that differ.
pub(super) fn agree<const D: usize>(
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
                return Err(SceneError::conflict(format!(
                    "`{first}` and `{second}` prescribe the {} displacements {before} and {value} at {:?}{when}",
                    ["x", "y", "z"][k],
                    x.as_slice()
                ))
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
