//! The temperature of a body.

use super::bounds_checks;
use super::error::SceneError;
use super::expression::Expression;
use super::materials::Material;
use super::solve::{Clock, Solve};
use super::spec::{CouplingSpec, ElementsSpec, MaterialSpec, SceneSpec, TemperatureSpec};
use crate::coupling::truncated::CutBonds;
use crate::material::Kinematics;
use crate::mesh::Mesh;
use crate::peridynamics::laws::Named;
use crate::tensor::padded;

/// A temperature in space and time.
#[derive(Clone, Debug, PartialEq)]
pub struct Temperature {
    /// The temperature.
    pub value: Expression,
    /// The temperature without thermal strain.
    pub reference: f64,
}

/// The temperature of a scene, checked; none if it names none.
pub(super) fn temperature<const D: usize>(
    spec: Option<&TemperatureSpec>,
    mesh: &Mesh<D>,
    clock: Clock,
) -> Result<Option<Temperature>, SceneError> {
    let Some(spec) = spec else {
        return Ok(None);
    };
    let place = "temperature.value";
    bounds_checks::no_further_axes::<D>(place, &spec.value)?;
    clock.admits(place, &spec.value)?;
    for x in &mesh.nodes {
        for &t in clock.instants(spec.value.depends_on_time()) {
            let found = spec.value.eval_at(&padded(x), t);
            if !found.is_finite() {
                return Err(SceneError::wrong_value(format!(
                    "`{place}` is {found} at {:?}, t = {t}",
                    x.as_slice()
                ))
                .label(spec.value.span.clone(), "no finite number there")
                .help("choose between branches with if(condition, a, b)"));
            }
        }
    }
    Ok(Some(Temperature {
        value: spec.value.clone(),
        reference: spec.reference.as_ref().map_or(0.0, |r| r.value),
    }))
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
    let span = temperature.value.span.clone();
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
