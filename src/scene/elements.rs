//! Constitutive law of the finite elements of the points' materials, and its agreement with the rest of the scene.

use super::error::SceneError;
use super::materials::Material;
use super::spec::{CouplingSpec, ElementsSpec, SceneSpec, ZonesNeeded};
use crate::coupling::truncated::CutBonds;
use crate::model::Zone;
use crate::peridynamics::bond_force::BondKinematics;
use crate::peridynamics::{BondWeights, Law};

/// Returns the typed law of the elements; those that follow the bonds need a coupling that carries their stress, and one lattice of bonds without memory.
///
/// # Errors
/// A [`SceneError`] with the reason and the remedy.
pub(crate) fn elements<const D: usize>(
    spec: &SceneSpec,
    coupling: &CouplingSpec,
    (materials, used): (&[Material<D>], &[u16]),
    law: Option<&dyn Law<D>>,
    bonds: BondKinematics,
) -> Result<ElementsSpec, SceneError> {
    let typed = spec.peridynamics.as_ref().and_then(|p| p.elements.as_ref());
    let Some(typed) = typed.filter(|typed| *typed.get_ref() == ElementsSpec::CauchyBorn) else {
        return Ok(ElementsSpec::Linear);
    };
    let Some(law) = law else {
        return Err(SceneError::conflict(
            "`peridynamics.elements` is \"cauchy-born\", and no material has points whose bonds the elements could follow",
        )
        .label(typed.span(), "of which bonds?")
        .help("remove this"));
    };
    let accelerated = used
        .iter()
        .all(|&m| materials[usize::from(m)].is_accelerated());
    let obstacle = coupling_without_stress(coupling, law, accelerated)
        .or_else(|| law_without_stress((materials, used), law, bonds))
        .or_else(|| families_that_differ(spec));
    match obstacle {
        None => Ok(ElementsSpec::CauchyBorn),
        Some((why, help)) => Err(SceneError::conflict(format!(
            "`peridynamics.elements` is \"cauchy-born\", and {why}"
        ))
        .label(typed.span(), "of which bonds?")
        .help(help)),
    }
}

/// A reason and its remedy.
type Obstacle = Option<(String, &'static str)>;

/// Returns the obstacle that keeps a coupling from carrying the stress of elements that follow the bonds.
fn coupling_without_stress<const D: usize>(
    coupling: &CouplingSpec,
    law: &dyn Law<D>,
    accelerated: bool,
) -> Obstacle {
    let traits = coupling.traits();
    match (traits.zones, coupling) {
        (ZonesNeeded::Everywhere(Zone::Local), _) => Some((
            "there are no points whose bonds the elements could follow".to_owned(),
            "draw a nonlocal zone and couple it by splice, or remove this",
        )),
        (ZonesNeeded::Everywhere(_), _) => {
            Some(("there are no elements".to_owned(), "remove this"))
        }
        (_, CouplingSpec::Splice(_) | CouplingSpec::PartialStress(_)) => None,
        (_, CouplingSpec::Truncated(typed)) => {
            let why = truncated_bonds(typed.cut_bonds, law, accelerated).err()?;
            let help =
                "use coupling = \"splice\", or elements = \"linear\" for rotations below 2 degrees";
            Some((why, help))
        }
        _ => Some((
            format!(
                "the rows of coupling `{}` at the seam are linear: elements and points would rotate, and the seam would not",
                traits.name
            ),
            "use coupling = \"splice\", \"partial-stress\" or \"truncated\", or elements = \"linear\" for rotations below 2 degrees",
        )),
    }
}

/// Returns the obstacle that keeps a law from giving elements a stress of its bonds.
fn law_without_stress<const D: usize>(
    (materials, used): (&[Material<D>], &[u16]),
    law: &dyn Law<D>,
    bonds: BondKinematics,
) -> Obstacle {
    let mut own = used.iter().map(|&m| &materials[usize::from(m)]);
    if let Some(own) = own.find(|m| m.local_law().is_some()) {
        let why = format!(
            "elements of the material `{}` already have the local law of its points, {}",
            own.name,
            own.law_name()
        );
        return Some((why, "remove this"));
    }
    let states = law.force_state();
    if states.is_none_or(|states| !states.history().is_empty()) {
        let why = format!(
            "bonds of the material `{}` ({}) remember, which a law of elements without their history cannot",
            materials[usize::from(used[0])].name,
            law.name()
        );
        let help = "use a bond-based, hardening, lps or pals material, or elements = \"linear\"";
        return Some((why, help));
    }
    (bonds == BondKinematics::Linear && law.is_linear()).then(|| {
        (
            "the bonds themselves are linear, so that it changes nothing".to_owned(),
            "add bonds = \"exact\", or remove this",
        )
    })
}

/// Returns the obstacle that keeps points from having one family in common.
fn families_that_differ(spec: &SceneSpec) -> Obstacle {
    if !spec.zones.bodies.is_empty() {
        return Some((
            "zones.bodies has several lattices".to_owned(),
            "draw one nonlocal zone, or use elements = \"linear\"",
        ));
    }
    let p = spec.peridynamics.as_ref()?;
    let why = if p.horizon_varies() {
        "the horizon varies, so that there is no one family"
    } else if p.weights == BondWeights::Fitted {
        "weights that are fitted differ from family to family"
    } else {
        return None;
    };
    let help =
        "use a horizon that is a number and weights = \"isotropic\", or elements = \"linear\"";
    Some((why.to_owned(), help))
}

/// Tests that bonds that end on faces rotate with the body; the error says why they do not.
fn truncated_bonds<const D: usize>(
    cut_bonds: Option<CutBonds>,
    law: &dyn Law<D>,
    accelerated: bool,
) -> Result<(), String> {
    if cut_bonds == Some(CutBonds::Linear) {
        return Err("cut-bonds = \"linear\" keeps the bonds at the seam from rotating".to_owned());
    }
    match (law.accelerator(), accelerated) {
        (Some(_), true) => Ok(()),
        (Some(_), false) => Err("bonds that end on faces follow a material that breaks by the state of its points to first order only".to_owned()),
        (None, _) => Err(format!(
            "bonds that end on faces follow the law {} to first order only",
            law.name()
        )),
    }
}
