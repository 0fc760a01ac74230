//! A nonlocal zone that follows the crack: its settings, and the scenes that cannot have it.

use super::bounds_checks;
use super::error::SceneError;
use super::failure::Breaking;
use super::peridynamics::Peridynamics;
use super::solve::Solve;
use super::source::Span;
use super::spec::{CouplingSpec, SceneSpec, SkinSpec, ZonesNeeded};
use crate::coupling::truncated::CutBonds;
use crate::mesh::Mesh;
use crate::model::PointSource;
use crate::observe::report::number;
use crate::peridynamics::Law;
use crate::peridynamics::failure::Fracture;
use crate::scene::selected_coupling::SelectedCoupling;

/// Horizons between damage and the edge of the zone: one in which bonds do not break, and one to the points whose bonds reach there.
const REACH: f64 = 2.0;

/// Horizons more with an LPS, whose bonds act through the dilatations of both ends.
const DILATATION: f64 = 1.0;

/// Padding in horizons, if the scene leaves it out: in `examples/branching_moving.toml` the path keeps within 1 mm of full peridynamics, and the zone has at most 38 % of the plate.
const PADDING: f64 = 5.0;

/// Paddings that it reaches ahead of the tips of cracks, if the scene leaves that out: fewer changes, and points take the place of elements before the waves of the tip are there.
const AHEAD: f64 = 1.5;

/// Fraction of the critical stretch from which a cell is wanted in the zone, if the scene leaves it out: from 0.5 on waves of the branching plate mark most of it at the end.
const STRETCH: f64 = 0.8;

/// Settings of a nonlocal zone that follows the crack, in a scene in time.
#[derive(Clone, Debug, PartialEq)]
pub struct Follow {
    /// Fraction of the critical stretch from which a cell is wanted in the zone.
    pub stretch: f64,
    /// Distance by which the zone extends beyond such cells when it changes \[m\].
    pub padding: f64,
    /// Distance by which it extends ahead of the tips of cracks when it changes \[m\].
    pub ahead: f64,
    /// Distance by which it extends beyond damage, cracks and voids, at all times \[m\].
    pub reach: f64,
    /// Cells that stay elements whatever happens, one entry per cell.
    pub barred: Vec<bool>,
}

/// Refuses scenes whose zone cannot follow the crack; returns the peridynamic side and its law of one whose zone can.
fn supported<'a, const D: usize>(
    span: Span,
    selected: &mut SelectedCoupling,
    solve: &Solve,
    breaking: &Breaking<D>,
    bonds: Option<(&'a Peridynamics<D>, &'a dyn Law<D>)>,
) -> Result<(&'a Peridynamics<D>, &'a dyn Law<D>), SceneError> {
    let refused = |message: String, label: &str, help: &str| {
        SceneError::conflict(message)
            .label(span.clone(), label)
            .help(help)
    };
    let Solve::Explicit(explicit) = solve else {
        return Err(refused(
            "`zones.follow` needs a scene in time".to_owned(),
            "follows a crack that runs",
            "add [solve.explicit] with a duration, or remove it",
        ));
    };
    if breaking.fracture.is_none() {
        return Err(refused(
            "`zones.follow` is set, but no bond breaks".to_owned(),
            "needs a material that breaks",
            "add fracture-energy or critical-stretch to the material, or remove it",
        ));
    }
    if !breaking.fracture.is_none_or(Fracture::is_of_stretch) {
        return Err(refused(
            "`zones.follow` is set, and bonds break by something else than their stretch"
                .to_owned(),
            "follows bonds that are stretched",
            "draw the nonlocal zone where the part may tear, or give a critical-stretch",
        ));
    }
    if explicit.sub_steps.is_some() {
        return Err(refused(
            "`zones.follow` and `solve.explicit.sub-steps` are set".to_owned(),
            "changes which sites are stiff",
            "remove one of the two",
        ));
    }
    let (ZonesNeeded::Nonlocal, Some((p, law))) = (selected.traits.zones, bonds) else {
        return Err(refused(
            format!(
                "`zones.follow` is set, and coupling `{}` has a transition zone",
                selected.traits.name
            ),
            "moves the border of two zones",
            "use coupling.truncated, or remove it",
        ));
    };
    if let CouplingSpec::Truncated(truncated) = &mut selected.coupling {
        // the zone changes before damage comes near, and nothing that broke at the seam would be carried over
        if truncated.cut_bonds == Some(CutBonds::Breaking) {
            return Err(refused(
                "`zones.follow` is set, and `coupling.truncated.cut-bonds` is \"breaking\""
                    .to_owned(),
                "keeps damage two horizons away from the bonds that the seam cuts",
                "write cut-bonds = \"linear\", or leave it out",
            ));
        }
        truncated.cut_bonds = Some(CutBonds::Linear);
    }
    if matches!(p.points, PointSource::Lattices { .. }) {
        return Err(refused(
            "`zones.follow` and `zones.bodies` are set".to_owned(),
            "follows on one lattice",
            "remove one of the two",
        ));
    }
    Ok((p, law))
}

/// Returns the settings of a zone that follows the crack, if the scene has one.
pub(crate) fn follow<const D: usize>(
    spec: &SceneSpec,
    selected: &mut SelectedCoupling,
    solve: &Solve,
    breaking: &Breaking<D>,
    bonds: Option<(&Peridynamics<D>, &dyn Law<D>)>,
    mesh: &Mesh<D>,
    is_peridynamic: impl Fn(usize) -> bool,
) -> Result<Option<Follow>, SceneError> {
    let Some(typed) = &spec.zones.follow else {
        return Ok(None);
    };
    if let ZonesNeeded::Everywhere(_) = selected.traits.zones {
        // one zone ignores what is said of zones
        return Ok(None);
    }
    let (p, law) = supported(typed.span(), selected, solve, breaking, bonds)?;
    let horizon = (0..mesh.cell_count())
        .map(|c| p.horizon_at(&mesh.centroid(c)))
        .fold(0.0, f64::max);
    let follow = typed.get_ref();
    let stretch = match &follow.stretch {
        Some(s) => bounds_checks::within(
            "zones.follow.stretch",
            s,
            s.value > 0.0 && s.value < 1.0,
            "must be between 0 and 1",
            "0.8 suits most scenes: bonds break at 1",
        )?,
        None => STRETCH,
    };
    let reach = horizon
        * match law.linearised().is_pairwise() {
            false => REACH + DILATATION,
            true => REACH,
        };
    let padding = match &follow.padding {
        Some(w) => bounds_checks::within(
            "zones.follow.padding",
            w,
            w.value > reach,
            "must be more than two horizons, three with an lps material",
            &format!(
                "bonds break no nearer to elements; {} is the default",
                number(PADDING * horizon)
            ),
        )?,
        None => PADDING * horizon,
    };
    let ahead = match &follow.ahead {
        Some(w) => bounds_checks::within(
            "zones.follow.ahead",
            w,
            w.value >= padding && w.value.is_finite(),
            &format!("must be at least the padding, {padding}"),
            &format!(
                "the zone has {} ahead of the tips if it is left out; more makes fewer changes",
                number(AHEAD * padding)
            ),
        )?,
        None => AHEAD * padding,
    };
    let mut barred: Vec<bool> = (0..mesh.cell_count()).map(|c| !is_peridynamic(c)).collect();
    if let Some(SkinSpec::FreeSurfaces) = spec.zones.skin {
        let skin = mesh.cells_at_boundary();
        barred.iter_mut().zip(skin).for_each(|(b, s)| *b |= s);
    }
    Ok(Some(Follow {
        stretch,
        padding,
        ahead,
        reach,
        barred,
    }))
}
