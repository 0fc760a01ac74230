//! Rigid impactors of a validated scene.

use super::bounds_checks;
use super::components::{Components, no_such_axis};
use super::error::{SceneError, quoted};
use super::expression::Expression;
use super::region::position;
use super::solve::{Clock, Solve};
use super::source::Span;
use super::spec::{ImpactorMotionSpec, ImpactorSpec, SceneSpec};
use super::value::{Coordinates, Text};
use crate::coupling::ImpactorShape;
use crate::tensor::{AXES, Vector};

/// A rigid body that strikes or presses.
#[derive(Clone, Debug, PartialEq)]
pub struct Impactor<const D: usize> {
    /// Its name.
    pub name: String,
    /// Its shape, where it was typed.
    pub shape: ImpactorShape<D>,
    /// Its motion.
    pub motion: ImpactorMotion<D>,
    /// Factor of its penalty stiffness.
    pub stiffness_factor: f64,
}

/// Motion of an impactor; it never rotates.
#[derive(Clone, Debug, PartialEq)]
pub enum ImpactorMotion<const D: usize> {
    /// As a free body.
    Free {
        /// Its mass.
        mass: f64,
        /// Its velocity at time zero.
        velocity: Vector<D>,
    },
    /// With a prescribed velocity, in t.
    Velocity(Components<D>),
    /// Along a prescribed way, in t.
    Displacement(Components<D>),
}

impl<const D: usize> Impactor<D> {
    /// Its mass, if it moves freely.
    pub fn mass(&self) -> Option<f64> {
        match self.motion {
            ImpactorMotion::Free { mass, .. } => Some(mass),
            _ => None,
        }
    }

    /// Its velocity at time zero, if it moves freely.
    pub fn thrown(&self) -> Option<Vector<D>> {
        match self.motion {
            ImpactorMotion::Free { velocity, .. } => Some(velocity),
            _ => None,
        }
    }
}

/// Factor of the penalty stiffness in motion, if the scene leaves it out: steps grow shorter by 15 to 30 %.
const IN_MOTION: f64 = 0.5;

/// Factor in load steps, which have no stable step: sites penetrate by a twentieth of what they would.
const IN_LOAD_STEPS: f64 = 10.0;

/// All impactors.
pub(crate) fn impactors<const D: usize>(
    spec: &SceneSpec,
    solve: &Solve,
) -> Result<Vec<Impactor<D>>, SceneError> {
    let Some(first) = spec.impactors.keys().next() else {
        return Ok(Vec::new());
    };
    agree(spec, first, solve)?;
    let one = |(name, typed): (&Text, &ImpactorSpec)| {
        if spec.output.probes.contains_key(name.value.as_str()) {
            return Err(refused(
                format!("`impactors.{name}` and `output.probes.{name}` have one name"),
                name.span.clone(),
                "both have columns in the history",
                "give one of them another name",
            ));
        }
        let place = format!("impactors.{name}");
        let factor = match &typed.stiffness_factor {
            Some(f) => bounds_checks::positive(&format!("{place}.stiffness-factor"), f)?,
            None if matches!(solve, Solve::QuasiStatic(_)) => IN_LOAD_STEPS,
            None => IN_MOTION,
        };
        Ok(Impactor {
            name: name.value.clone(),
            shape: shape(&place, name, typed)?,
            motion: motion(&place, name, typed, solve)?,
            stiffness_factor: factor,
        })
    };
    spec.impactors.iter().map(one).collect()
}

fn refused(message: String, span: Span, label: &str, help: &str) -> SceneError {
    SceneError::conflict(message).label(span, label).help(help)
}

/// Refuses impactors in scenes that cannot have them.
fn agree(spec: &SceneSpec, first: &Text, solve: &Solve) -> Result<(), SceneError> {
    let place = format!("impactors.{first}");
    let here = first.span.clone();
    if *solve == Solve::Static {
        return Err(refused(
            format!("`{place}` in a static scene"),
            here,
            "comes from somewhere and goes on",
            "add [solve.explicit] with duration = ..., or [solve.quasi-static] with steps = ...",
        ));
    }
    if let Solve::Explicit(e) = solve
        && e.sub_steps.is_some()
    {
        return Err(refused(
            format!("`{place}` and `solve.explicit.sub-steps` are set"),
            here,
            "may push any site, in every step",
            "leave sub-steps out",
        ));
    }
    if let Some(follow) = &spec.zones.follow {
        return Err(refused(
            format!("`{place}` and `zones.follow` are set"),
            here,
            "acts on sites that a change of the zone replaces",
            "draw the nonlocal zone as large as the cracks will need it, and remove `follow`",
        )
        .label(follow.span(), "changes the zone"));
    }
    if let Some(auto) = &spec.zones.auto {
        return Err(refused(
            format!("`{place}` and `zones.auto` are set"),
            here,
            "is not there at time zero, when the zone is placed",
            "draw the nonlocal zone around the place of the impact",
        )
        .label(auto.span(), "places the zone"));
    }
    if let Some(section) = spec.output.sections.keys().next() {
        return Err(refused(
            format!("`{place}` and `output.sections.{section}` are set"),
            here,
            "pushes sites, which a section takes for forces within the body",
            "remove the section: NAME_force_x, ... of the impactor and the reactions of supports tell the forces",
        )
        .label(section.span.clone(), "adds up forces within the body"));
    }
    if let Some(accuracy) = &spec.accuracy {
        return Err(refused(
            format!("`{place}` and `accuracy` are set"),
            here,
            "is beyond what small runs are compared by",
            "choose mesh, horizon and zone, and remove `accuracy`",
        )
        .label(accuracy.span.clone(), "chooses them"));
    }
    Ok(())
}

/// A vector of length 1 along one of any length.
fn direction<const D: usize>(place: &str, typed: &Coordinates) -> Result<Vector<D>, SceneError> {
    let given = position::<D>(place, typed)?;
    let unit = given.try_normalize(1e-300);
    unit.filter(|n| n.iter().all(|n| n.is_finite()))
        .ok_or_else(|| {
            SceneError::wrong_value(format!("`{place}` has no direction"))
                .label(typed.span.clone(), "zero")
                .help("write a direction, along the last axis say, with a component of 1")
        })
}

/// The one shape of an impactor.
fn shape<const D: usize>(
    place: &str,
    name: &Text,
    typed: &ImpactorSpec,
) -> Result<ImpactorShape<D>, SceneError> {
    let mut shapes: Vec<(&str, ImpactorShape<D>)> = Vec::new();
    if let Some(s) = &typed.sphere {
        let place = format!("{place}.sphere");
        let center = position(&format!("{place}.center"), &s.center)?;
        let radius = bounds_checks::positive(&format!("{place}.radius"), &s.radius)?;
        shapes.push(("sphere", ImpactorShape::Sphere { center, radius }));
    }
    if let Some(c) = &typed.cylinder {
        let place = format!("{place}.cylinder");
        if D < 3 {
            return Err(
                SceneError::dimension(format!("`{place}` in a scene of dimension {D}"))
                    .label(name.span.clone(), "has an axis in space")
                    .help(
                        "write sphere = { center = ..., radius = ... }, which is a disc in a plane",
                    ),
            );
        }
        let shape = ImpactorShape::Cylinder {
            point: position(&format!("{place}.point"), &c.point)?,
            direction: direction(&format!("{place}.direction"), &c.direction)?,
            radius: bounds_checks::positive(&format!("{place}.radius"), &c.radius)?,
        };
        shapes.push(("cylinder", shape));
    }
    if let Some(p) = &typed.plane {
        let place = format!("{place}.plane");
        let shape = ImpactorShape::Plane {
            point: position(&format!("{place}.point"), &p.point)?,
            normal: direction(&format!("{place}.normal"), &p.normal)?,
        };
        shapes.push(("plane", shape));
    }
    let names: Vec<&str> = shapes.iter().map(|(n, _)| *n).collect();
    match shapes.pop() {
        Some((_, shape)) if shapes.is_empty() => Ok(shape),
        _ => Err(SceneError::choice(match names.as_slice() {
            [] => format!("`{place}` has no shape"),
            _ => format!("`{place}` has {} at once", quoted(&names)),
        })
        .label(name.span.clone(), "of what shape?")
        .help("give exactly one of `sphere`, `cylinder`, `plane`")),
    }
}

/// Reads the motion of an impactor.
fn motion<const D: usize>(
    place: &str,
    name: &Text,
    typed: &ImpactorSpec,
    solve: &Solve,
) -> Result<ImpactorMotion<D>, SceneError> {
    let read = |key: &str, typed: &ImpactorMotionSpec| {
        components::<D>(&format!("{place}.{key}"), typed, solve.clock())
    };
    let in_time = matches!(solve, Solve::Explicit(_));
    if let (Some(mass), false) = (&typed.mass, in_time) {
        return Err(refused(
            format!("`{place}.mass` in load steps"),
            mass.span.clone(),
            "a free impactor is held by nothing",
            "prescribe its displacement in t, or add [solve.explicit]",
        ));
    }
    if let (Some(_), false) = (&typed.velocity, in_time) {
        return Err(refused(
            format!("`{place}.velocity` in load steps"),
            name.span.clone(),
            "t is a load there",
            "prescribe its displacement in t",
        ));
    }
    if let Some(displacement) = &typed.displacement {
        let other = match (&typed.velocity, &typed.mass) {
            (Some(_), _) => "velocity",
            (None, Some(_)) => "mass",
            (None, None) => {
                return Ok(ImpactorMotion::Displacement(read(
                    "displacement",
                    displacement,
                )?));
            }
        };
        return Err(refused(
            format!("`{place}` has both `displacement` and `{other}`"),
            name.span.clone(),
            "how does it move?",
            "keep `displacement` or `velocity` for a prescribed motion, or `mass` and `velocity` for a free one",
        ));
    }
    let velocity = match &typed.velocity {
        Some(velocity) => read("velocity", velocity)?,
        None => Components(std::array::from_fn(|_| None)),
    };
    let Some(mass) = &typed.mass else {
        return Ok(match typed.velocity {
            Some(_) => ImpactorMotion::Velocity(velocity),
            // an obstacle
            None => ImpactorMotion::Displacement(velocity),
        });
    };
    let mass = bounds_checks::positive(&format!("{place}.mass"), mass)?;
    let moving = velocity.0.iter().zip(AXES);
    let moving = moving.filter_map(|(e, axis)| Some((e.as_ref()?, axis)));
    if let Some((e, axis)) = moving.into_iter().find(|(e, _)| e.depends_on_time()) {
        return Err(refused(
            format!("`{place}.velocity.{axis}` depends on the time t, and the impactor has a mass"),
            e.span.clone(),
            "is that at time zero",
            "write a number; or leave `mass` out, and the velocity is prescribed",
        ));
    }
    Ok(ImpactorMotion::Free {
        mass,
        velocity: velocity.vector(&Vector::zeros(), 0.0),
    })
}

/// The components of a motion in t.
fn components<const D: usize>(
    place: &str,
    typed: &ImpactorMotionSpec,
    clock: Clock,
) -> Result<Components<D>, SceneError> {
    let given: [&Option<Expression>; 3] = [&typed.x, &typed.y, &typed.z];
    for (k, e) in given.iter().enumerate() {
        let Some(e) = e else { continue };
        let at = format!("{place}.{}", AXES[k]);
        if k >= D {
            return Err(no_such_axis::<D>(place, k, &e.span));
        }
        if e.function().is_some() || e.depends_on_position() {
            return Err(refused(
                format!("`{at}` depends on position"),
                e.span.clone(),
                "an impactor is rigid",
                "use t only",
            ));
        }
        let moving = e.depends_on_time();
        let instants = clock.instants(moving);
        if let Some((t, v)) =
            (instants.iter().map(|&t| (t, e.eval_at(&[0.0; 3], t)))).find(|(_, v)| !v.is_finite())
        {
            let when = match moving {
                true => format!(" at t = {t}"),
                false => String::new(),
            };
            return Err(SceneError::wrong_value(format!("`{at}` is {v}{when}"))
                .label(e.span.clone(), "no finite number there")
                .help("choose between branches with if(condition, a, b)"));
        }
    }
    Ok(Components(std::array::from_fn(|k| given[k].clone())))
}
