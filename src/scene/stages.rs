//! Stages of a scene: load steps, and the motion that begins with their last state of equilibrium.
//!
//! The time `t` of a condition is that of the stage in which it begins; in the stage after, it keeps the values of the end.

use std::collections::BTreeMap;

use super::condition_kinds::ConditionSpec;
use super::condition_list::{agree, bear, built};
use super::conditions::Condition;
use super::error::{SceneError, closest, quoted};
use super::file_name::part_of_a_file_name;
use super::load_stage::LoadStage;
use super::solve::{self, Solve};
use super::spec::{ExplicitSpec, InitialSpec, QuasiStaticSpec, SceneSpec, SolveSpec};
use super::value::Text;
use crate::mesh::Mesh;

/// Two stages, as typed.
#[derive(Clone, Copy)]
pub(crate) struct Stages<'a> {
    load: (&'a Text, &'a QuasiStaticSpec),
    motion: (&'a Text, &'a ExplicitSpec),
}

/// The order of stages, in words.
const ORDER: &str = "write solve = [\"load\", \"impact\"], with [stages.load.quasi-static] and [stages.impact.explicit]";

impl<'a> Stages<'a> {
    /// The stages of a scene; none of one that has no more than one.
    ///
    /// # Errors
    /// A [`SceneError`] for stages that there are not, that are not load steps before a motion, or whose parts do not last through both.
    pub fn of(spec: &'a SceneSpec) -> Result<Option<Self>, SceneError> {
        let Some(SolveSpec::Stages(names)) = spec.solve.as_ref().map(|s| s.get_ref()) else {
            if let Some(name) = spec.stages.keys().next() {
                return Err(SceneError::conflict(format!(
                    "`stages.{name}` is typed, and `solve` does not list it"
                ))
                .label(name.span.clone(), "is not run")
                .help(ORDER));
            }
            if let Some((place, name)) = named_stages(&spec.conditions).next() {
                return Err(SceneError::conflict(format!(
                    "`{place}` names the stage `{name}` in a scene without stages"
                ))
                .label(name.span.clone(), "no stage")
                .help(format!("leave it out; or {ORDER}")));
            }
            return Ok(None);
        };
        let mut found = Vec::with_capacity(names.len());
        for (k, name) in names.iter().enumerate() {
            part_of_a_file_name("solve", name)?;
            if names[..k].contains(name) {
                return Err(
                    SceneError::conflict(format!("`solve` lists `{name}` twice"))
                        .label(name.span.clone(), "once more")
                        .help("give each stage a table of its own"),
                );
            }
            let known = || spec.stages.keys().map(|k| k.value.as_str());
            let stage = spec
                .stages
                .get(name)
                .ok_or_else(|| unknown("solve", name, known()))?;
            found.push((name, stage));
        }
        if let Some(name) = spec.stages.keys().find(|name| !names.contains(name)) {
            return Err(SceneError::conflict(format!(
                "`stages.{name}` is typed, and `solve` does not list it"
            ))
            .label(name.span.clone(), "is not run")
            .help("add its name to `solve`, in the order in which stages follow, or remove it"));
        }
        let stages = ordered(spec, &found)?;
        for (place, name) in named_stages(&spec.conditions) {
            if !names.contains(name) {
                let known = names.iter().map(|n| n.value.as_str());
                return Err(unknown(&place, name, known));
            }
        }
        lasting(spec)?;
        Ok(Some(stages))
    }

    /// The motion.
    pub fn motion(&self, has_large_strains: bool) -> Result<Solve, SceneError> {
        let (name, typed) = self.motion;
        let place = format!("stages.{name}.explicit");
        solve::explicit(&place, typed, has_large_strains).map(Solve::Explicit)
    }

    /// The load steps with what acts in them, and what acts in the motion.
    ///
    /// # Errors
    /// A [`SceneError`] for a condition that cannot be read, or that acts nowhere; load steps that nothing holds.
    pub fn conditions<const D: usize>(
        &self,
        spec: &BTreeMap<Text, ConditionSpec>,
        mesh: &Mesh<D>,
        motion: &Solve,
    ) -> Result<(LoadStage<D>, Vec<Condition<D>>), SceneError> {
        let (name, typed) = self.load;
        let place = format!("stages.{name}.quasi-static");
        let mut steps = solve::quasi_static(&place, typed)?;
        // the motion begins with what is left of balance
        if typed.tolerance.is_none() {
            steps.tolerance = TOLERANCE;
        }
        let load = Solve::QuasiStatic(steps.clone());
        let clocks = [load.clock(), motion.clock()];
        let (mut first, mut second) = (Vec::new(), Vec::new());
        for (key, condition) in spec {
            let [in_load, in_motion] = self.acts(key, condition)?;
            let begins = if in_load { clocks[0] } else { clocks[1] };
            let found = built((key, condition), mesh, begins)?;
            if in_motion {
                let mut kept = found.clone();
                if in_load {
                    kept.components = kept.components.held_at(steps.end());
                }
                second.push(kept);
            }
            if in_load {
                first.push(found);
            }
        }
        bear(&first, clocks[0])?;
        agree(spec, &first, mesh, clocks[0])?;
        agree(spec, &second, mesh, clocks[1])?;
        let stage = LoadStage {
            name: name.value.clone(),
            solve: steps,
            conditions: first,
        };
        Ok((stage, second))
    }

    /// True for each stage in which a condition acts: those that it names; if it names none both, of a velocity the motion.
    fn acts(&self, key: &Text, condition: &ConditionSpec) -> Result<[bool; 2], SceneError> {
        let is_velocity = matches!(condition, ConditionSpec::Velocity(_));
        let Some(names) = condition.stages() else {
            return Ok([!is_velocity, true]);
        };
        let [load, motion] = [self.load.0, self.motion.0];
        if names.is_empty() {
            return Err(SceneError::wrong_value(format!(
                "`conditions.{key}` acts in no stage: `stages` is empty"
            ))
            .label(key.span.clone(), "acts never")
            .help(format!(
                "name {}, or leave `stages` out for both",
                quoted(&[&load.value, &motion.value])
            )));
        }
        Ok([load, motion].map(|stage| names.contains(stage)))
    }
}

/// Out-of-balance force of load steps before a motion, over the largest forces: with 1e-8 a body that was left in peace would move by 1e-8 of what its load moves.
const TOLERANCE: f64 = 1e-12;

/// Each name of a stage that conditions type, with its place.
fn named_stages(
    conditions: &BTreeMap<Text, ConditionSpec>,
) -> impl Iterator<Item = (String, &Text)> {
    conditions.iter().flat_map(|(key, condition)| {
        let place = format!("conditions.{key}.stages");
        let names = condition.stages().unwrap_or_default().iter();
        names.map(move |name| (place.clone(), name))
    })
}

/// The error for the name of a stage that there is not.
fn unknown<'n>(
    place: &str,
    name: &Text,
    known: impl Iterator<Item = &'n str> + Clone,
) -> SceneError {
    let list: Vec<&str> = known.clone().collect();
    let list = match list.is_empty() {
        true => format!("there are no stages: {ORDER}"),
        false => format!("known here: {}", quoted(&list)),
    };
    let help = match closest(&name.value, known) {
        Some(near) => format!("did you mean `{near}`? {list}"),
        None => list,
    };
    SceneError::wrong_value(format!(
        "`{place}` names the stage `{name}`, which there is not"
    ))
    .label(name.span.clone(), "not known")
    .help(help)
}

/// Load steps before a motion, and nothing else.
fn ordered<'a>(
    spec: &'a SceneSpec,
    found: &[(&'a Text, &'a SolveSpec)],
) -> Result<Stages<'a>, SceneError> {
    let refused = |message: String, at: &Text, label: &str, help: &str| {
        Err(SceneError::conflict(message)
            .label(at.span.clone(), label)
            .help(help))
    };
    for (name, stage) in found {
        if matches!(stage, SolveSpec::Static(_) | SolveSpec::Stages(_)) {
            return refused(
                format!("`stages.{name}` is neither load steps nor a motion"),
                name,
                "of a motion with exact bonds its state would be no equilibrium",
                "use quasi-static with steps = 1, which finds the equilibrium of the same model; a scene in stages has one of these and then one explicit",
            );
        }
    }
    match found {
        [
            (load, SolveSpec::QuasiStatic(steps)),
            (motion, SolveSpec::Explicit(time)),
        ] => Ok(Stages {
            load: (load, steps),
            motion: (motion, time),
        }),
        [(first, SolveSpec::Explicit(_)), ..] if found.len() > 1 => refused(
            format!("the stage `{first}` is a motion, and others follow it"),
            first,
            "leaves no state of equilibrium behind",
            "put load steps first: a motion is the last stage; or write one motion whose loads depend on t",
        ),
        [(first, _), (second, SolveSpec::QuasiStatic(_)), ..] => refused(
            format!("the stages `{first}` and `{second}` are both load steps"),
            second,
            "goes on with a load that grows",
            "write one quasi-static stage, whose loads depend on t, as tables do: `1e6 * ramp(t)`",
        ),
        _ => {
            let span = spec.solve.as_ref().map_or(0..0, |s| s.span());
            Err(
                SceneError::wrong_value(format!("`solve` lists {} stages", found.len()))
                    .label(span, "two are run: load steps, then a motion")
                    .help(format!(
                        "{ORDER}; a scene of one stage has [solve.explicit] or [solve.quasi-static]"
                    )),
            )
        }
    }
}

/// Refuses what does not last through both stages.
fn lasting(spec: &SceneSpec) -> Result<(), SceneError> {
    let refused = |what: &str, span, label: &str, help: &str| {
        Err(
            SceneError::conflict(format!("{what} in a scene of several stages"))
                .label(span, label)
                .help(help),
        )
    };
    if let Some(follow) = &spec.zones.follow {
        return refused(
            "`zones.follow`",
            follow.span(),
            "lays points and elements out anew, which load steps cannot",
            "draw the nonlocal zone as large as the cracks will need it, and remove `follow`",
        );
    }
    if let Some(accuracy) = &spec.accuracy {
        return refused(
            "`accuracy`",
            accuracy.span.clone(),
            "is met by trial runs of one stage",
            "type coupling, mesh, horizon and points, and leave it out",
        );
    }
    if let Some(auto) = &spec.zones.auto {
        return refused(
            "`zones.auto`",
            auto.span(),
            "looks at one load",
            "draw the zone: zones.nonlocal",
        );
    }
    for (name, initial) in &spec.initial {
        if matches!(initial, InitialSpec::Displacement(_)) {
            return refused(
                &format!("`initial.{name}.displacement`"),
                name.span.clone(),
                "the motion begins where the load steps end",
                "let a condition of the load steps displace the body, or type a velocity",
            );
        }
    }
    Ok(())
}
