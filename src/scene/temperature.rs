//! The temperature of a body.

use std::sync::Arc;

use super::bounds_checks;
use super::conduction::{self, Conduction};
use super::error::SceneError;
use super::expression::Expression;
use super::materials::Material;
use super::solve::{Clock, Solve};
use super::source::Span;
use super::spec::{CouplingSpec, ElementsSpec, MaterialSpec, SceneSpec, TemperatureSpec};
use crate::coupling::truncated::CutBonds;
use crate::material::Kinematics;
use crate::mesh::Mesh;
use crate::peridynamics::laws::Named;

/// A temperature in space and time.
#[derive(Clone, Debug)]
pub struct Temperature<const D: usize> {
    /// The temperature.
    pub value: TemperatureValue<D>,
    /// The temperature without thermal strain.
    pub reference: f64,
}

/// A temperature as an expression, or as the solution of heat conduction.
#[derive(Clone, Debug)]
pub enum TemperatureValue<const D: usize> {
    /// An expression.
    Typed(Expression),
    /// Heat conduction, to be solved.
    Conduction(Arc<Conduction<D>>),
}

impl<const D: usize> Temperature<D> {
    /// The same on another mesh of the body: an expression is checked at its nodes, heat conduction keeps the mesh that the scene has.
    pub(super) fn on_mesh(&self, mesh: &Mesh<D>, clock: Clock) -> Result<Self, SceneError> {
        if let TemperatureValue::Typed(value) = &self.value {
            typed(value, mesh, clock)?;
        }
        Ok(self.clone())
    }
}

impl TemperatureSpec {
    /// Span of the expression, or of the table of conduction.
    fn span(&self) -> Span {
        let typed = self.value.as_ref().map(|value| value.span.clone());
        let solved = || self.conduction.as_ref().map(|table| table.span());
        typed.or_else(solved).unwrap_or_default()
    }
}

/// The temperature of a scene, checked; none if it names none.
pub(super) fn temperature<const D: usize>(
    scene: &SceneSpec,
    mesh: &Mesh<D>,
    (materials, cell_material): (&[Material<D>], &[u16]),
    clock: Clock,
) -> Result<Option<Temperature<D>>, SceneError> {
    let Some(spec) = &scene.temperature else {
        conducting_nothing(scene)?;
        return Ok(None);
    };
    let value = match (&spec.value, &spec.conduction) {
        (Some(value), None) => {
            conducting_nothing(scene)?;
            TemperatureValue::Typed(typed(value, mesh, clock)?)
        }
        (None, Some(table)) => {
            let stuff = (materials, cell_material);
            let found = conduction::conduction(table, mesh, stuff, clock)?;
            TemperatureValue::Conduction(Arc::new(found))
        }
        (both, _) => {
            let what = match both {
                Some(_) => "both `value` and `conduction`",
                None => "neither `value` nor `conduction`",
            };
            return Err(SceneError::choice(format!("`temperature` has {what}"))
                .label(spec.span(), "the temperature")
                .help(
                    "keep one: value = \"20 + 100*x\", or [temperature.conduction] with conditions",
                ));
        }
    };
    Ok(Some(Temperature {
        value,
        reference: spec.reference.as_ref().map_or(0.0, |r| r.value),
    }))
}

/// The expression of a temperature, a number at every node.
fn typed<const D: usize>(
    value: &Expression,
    mesh: &Mesh<D>,
    clock: Clock,
) -> Result<Expression, SceneError> {
    let place = "temperature.value";
    bounds_checks::no_further_axes::<D>(place, value)?;
    clock.admits(place, value)?;
    let instants = clock.instants(value.depends_on_time());
    conduction::finite(place, value, mesh.nodes.iter(), instants)?;
    Ok(value.clone())
}

/// Refuses conductivities and heat capacities without heat conduction: they would do nothing without a word.
fn conducting_nothing(spec: &SceneSpec) -> Result<(), SceneError> {
    let of = |m: &MaterialSpec| {
        m.conduction()
            .into_iter()
            .flatten()
            .next()
            .map(|n| n.span.clone())
    };
    let Some((name, span)) = spec.materials.iter().find_map(|(n, m)| Some((n, of(m)?))) else {
        return Ok(());
    };
    Err(SceneError::missing(format!(
        "the material `{name}` conducts heat, and the scene has no [temperature.conduction]"
    ))
    .label(span, "conducts nothing")
    .help("add [temperature.conduction] with conditions, or remove the key"))
}

/// Refuses a temperature where its strain is not known to a law, a bond or a seam.
pub(super) fn agrees<const D: usize>(
    (spec, kinematics): (&SceneSpec, Kinematics),
    materials: &[Material<D>],
    (coupling, elements): (&CouplingSpec, ElementsSpec),
    solve: &Solve,
) -> Result<(), SceneError> {
    let Some(temperature) = &spec.temperature else {
        return unheated(spec);
    };
    let span = temperature.span();
    let refuse = |what: String, help: &str| {
        let error = SceneError::conflict(what);
        Err(error.label(span.clone(), "thermal strain").help(help))
    };
    if let Some(cold) = materials.iter().find(|m| m.expansion.is_none()) {
        return refuse(
            format!(
                "`temperature`, and the material `{}` has no thermal-expansion",
                cold.name
            ),
            "add thermal-expansion = ... to it, 0 is a number too",
        );
    }
    let relaxes = |m: &MaterialSpec| {
        let law = Named::PositionAwareViscoelasticSolid;
        matches!(m, MaterialSpec::Named(named) if named.law == law)
    };
    let mut relaxing = spec.materials.iter().filter(|(_, m)| relaxes(m));
    if let (Kinematics::PlaneStrain, Some((name, _))) = (kinematics, relaxing.next()) {
        return refuse(
            format!(
                "`temperature`, and the material `{name}`, `pave`, in plane strain: what is held across the plane relaxes, and with it the expansion within, which its bonds do not know"
            ),
            "use viscoelastic-correspondence, or kinematics = \"solid\"",
        );
    }
    let has_sub_steps = matches!(solve, Solve::Explicit(e) if e.sub_steps.is_some());
    if has_sub_steps || spec.zones.auto.is_some() || spec.zones.follow.is_some() {
        return refuse(
            "`temperature`, and sub-steps or a zone that is placed or moves by itself".to_owned(),
            "leave out sub-steps and zones.follow, and draw zones.nonlocal",
        );
    }
    if elements == ElementsSpec::CauchyBorn {
        return refuse(
            "`temperature`, and peridynamics.elements = \"cauchy-born\"".to_owned(),
            "leave out peridynamics.elements: linear elements expand",
        );
    }
    match coupling {
        CouplingSpec::Truncated(typed) if typed.cut_bonds == Some(CutBonds::Breaking) => refuse(
            "`temperature`, and cut-bonds = \"breaking\": bonds that a seam cuts know no temperature but linear ones".to_owned(),
            "let cut-bonds = \"linear\" in [coupling.truncated], or leave it out, and keep damage two horizons away from the seam",
        ),
        _ => Ok(()),
    }
}

/// Refuses expansion without a temperature: it would do nothing without a word.
fn unheated(spec: &SceneSpec) -> Result<(), SceneError> {
    let of = |m: &MaterialSpec| m.thermal_expansion().map(|n| n.span.clone());
    let Some((name, span)) = spec.materials.iter().find_map(|(n, m)| Some((n, of(m)?))) else {
        return Ok(());
    };
    Err(SceneError::missing(format!(
        "the material `{name}` has a thermal-expansion, and the scene no temperature"
    ))
    .label(span, "expands by nothing")
    .help("add [temperature] with value = \"...\", or remove the key"))
}
