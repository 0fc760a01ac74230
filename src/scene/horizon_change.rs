//! The rule for bonds between points of different horizons: `peridynamics.horizon-change`.

use toml::Spanned;

use super::error::SceneError;
use super::peridynamics::Peridynamics;
use super::spec::{CouplingTraits, HorizonChangeSpec, SceneSpec};
use crate::model::{HorizonChange, PointSource};
use crate::peridynamics::{BondWeights, Law, PartialVolume};

/// Couplings whose rows are those of whole families of points.
const OF_FAMILIES: [&str; 2] = ["nonlocal", "splice"];

/// Laws that the rules of regions are offered for.
const LAWS: [&str; 2] = ["bond-based", "linear peridynamic solid"];

impl HorizonChangeSpec {
    /// The name, as scenes have it.
    fn name(self) -> &'static str {
        match self {
            Self::Dual => "dual",
            Self::MultiHorizon => "multi-horizon",
            Self::Splice => "splice",
            Self::PartialStress => "partial-stress",
            Self::Layer => "layer",
        }
    }

    /// The obstacle to it in a scene and the remedy, if there is one.
    fn obstacle(self, coupling: &str, has_bodies: bool) -> Option<(&'static str, &'static str)> {
        let of_families = OF_FAMILIES.contains(&coupling);
        match self {
            Self::Layer if has_bodies && coupling == "truncated" => None,
            Self::Layer => Some((
                "is a layer of elements between bodies whose bonds end on its faces",
                "use coupling = \"truncated\" and give the part a horizon and a spacing in [zones.bodies.NAME]",
            )),
            Self::PartialStress if coupling == "partial-stress" && !has_bodies => None,
            Self::PartialStress => Some((
                "takes the divergence of the partial stress where the horizon varies",
                "use coupling = \"partial-stress\", with [zones.transition] where the horizon varies, and an expression for peridynamics.horizon",
            )),
            _ if coupling == "truncated" && has_bodies => Some((
                "joins points by bonds, and the bodies of coupling `truncated` are joined by elements",
                "use \"layer\", or coupling = \"splice\" with horizon-change = \"splice\"",
            )),
            Self::Splice if of_families => None,
            Self::Splice | Self::MultiHorizon if !of_families => Some((
                "needs a coupling whose points have whole families",
                "use coupling = \"splice\" or \"nonlocal\"",
            )),
            Self::Dual | Self::MultiHorizon if has_bodies => Some((
                "joins the points of one lattice, and bodies have lattices of their own",
                "use horizon-change = \"splice\", or an expression for peridynamics.horizon instead of [zones.bodies]",
            )),
            Self::Dual | Self::MultiHorizon | Self::Splice => None,
        }
    }
}

/// The points with the rule of the scene, and the partial volumes that go with it.
///
/// # Errors
/// As [`horizon_change`].
pub(crate) fn with_rule<const D: usize>(
    spec: &SceneSpec,
    traits: CouplingTraits,
    mut p: Peridynamics<D>,
) -> Result<Peridynamics<D>, SceneError> {
    p.horizon_change = horizon_change(spec, traits, &p)?;
    p.volumes = volumes(spec, traits, &p);
    Ok(p)
}

/// The rule of a scene, typed or by its coupling.
///
/// # Errors
/// [`SceneError`] for a rule where all points have one horizon, and where the coupling or the weights do not take it.
fn horizon_change<const D: usize>(
    spec: &SceneSpec,
    traits: CouplingTraits,
    p: &Peridynamics<D>,
) -> Result<HorizonChange, SceneError> {
    let has_bodies = !spec.zones.bodies.is_empty();
    let Some((typed, weights)) =
        (spec.peridynamics.as_ref()).and_then(|p| Some((p.horizon_change.as_ref()?, p.weights)))
    else {
        let splices = has_bodies && OF_FAMILIES.contains(&traits.name);
        return Ok(match splices {
            true => HorizonChange::Splice,
            false => HorizonChange::Dual,
        });
    };
    let rule = *typed.get_ref();
    if !has_bodies && p.horizon.as_constant().is_some() {
        return Err(conflict(
            typed,
            "and all points have one horizon",
            "type peridynamics.horizon as an expression in x, y, z, or give a part of the nonlocal zone its own in [zones.bodies.NAME]; or remove this",
        ));
    }
    if let Some((why, help)) = rule.obstacle(traits.name, has_bodies) {
        return Err(conflict(
            typed,
            &format!("which {why}; the coupling is `{}`", traits.name),
            help,
        ));
    }
    if rule == HorizonChangeSpec::MultiHorizon && weights == BondWeights::Fitted {
        return Err(conflict(
            typed,
            "whose bonds are weakened, and fitted weights would undo that",
            "use weights = \"isotropic\" or \"plain\"",
        ));
    }
    if rule == HorizonChangeSpec::Splice && spec.contact.is_some() {
        return Err(conflict(
            typed,
            "in which points continue the lattices of others, and `contact` would push these apart",
            "remove [contact], or use horizon-change = \"dual\" or \"multi-horizon\"",
        ));
    }
    Ok(match rule {
        HorizonChangeSpec::MultiHorizon => HorizonChange::MultiHorizon,
        HorizonChangeSpec::Splice => HorizonChange::Splice,
        HorizonChangeSpec::Dual | HorizonChangeSpec::PartialStress | HorizonChangeSpec::Layer => {
            HorizonChange::Dual
        }
    })
}

fn conflict(typed: &Spanned<HorizonChangeSpec>, why: &str, help: &str) -> SceneError {
    SceneError::conflict(format!(
        "`peridynamics.horizon-change` is \"{}\", {why}",
        typed.get_ref().name()
    ))
    .label(typed.span(), "joins points of different horizons")
    .help(help)
}

/// Refuses a rule of regions for a law of which it is not known that it holds.
///
/// # Errors
/// [`SceneError`] with the law.
pub(crate) fn check_law<const D: usize>(
    spec: &SceneSpec,
    p: Option<&Peridynamics<D>>,
    law: Option<&dyn Law<D>>,
) -> Result<(), SceneError> {
    let changes = p.filter(|p| p.horizon_change != HorizonChange::Dual);
    let Some((p, law)) = changes.zip(law) else {
        return Ok(());
    };
    let is_one = law.several().is_none();
    if is_one && LAWS.contains(&law.name()) {
        return Ok(());
    }
    let bodies = spec
        .zones
        .bodies
        .keys()
        .next()
        .map(|name| name.span.clone());
    let typed = (spec.peridynamics.as_ref()).and_then(|p| p.horizon_change.as_ref());
    let span = typed.map(Spanned::span).or(bodies);
    let law = match is_one {
        true => format!("the law of the points is {}", law.name()),
        false => "points have several materials".to_owned(),
    };
    Err(SceneError::conflict(format!(
        "horizons that change by the rule \"{}\" are offered for one material, `bond-based` or `lps`; {law}",
        p.horizon_change.name()
    ))
    .label(span.unwrap_or(0..0), "joins points of different horizons")
    .help("use one of these laws, or horizon-change = \"dual\" with an expression for peridynamics.horizon"))
}

/// The partial volumes of a scene that types none: where the horizon of a lattice varies, whole cells would enter and leave families one after another.
fn volumes<const D: usize>(
    spec: &SceneSpec,
    traits: CouplingTraits,
    p: &Peridynamics<D>,
) -> PartialVolume {
    let is_typed = (spec.peridynamics.as_ref()).is_some_and(|p| p.volumes.is_some());
    let is_lattice = matches!(p.points, PointSource::Lattice { .. });
    let varies = p.horizon.as_constant().is_none();
    let is_dual = p.horizon_change == HorizonChange::Dual && OF_FAMILIES.contains(&traits.name);
    match !is_typed && is_lattice && varies && is_dual && p.weights != BondWeights::Fitted {
        true => PartialVolume::Exact,
        false => p.volumes,
    }
}
