//! Agreement of parts of a scene that are right alone: materials with zones, horizons with spacings.

use std::sync::Arc;

use super::elasticity::Elasticity;
use super::error::SceneError;
use super::materials::Material;
use super::orthotropic;
use super::peridynamics::Peridynamics;
use super::solve::Solve;
use super::spec::{CouplingSpec, ElementsSpec, MaterialSpec, SceneSpec, SolveSpec, ZonesNeeded};
use crate::coupling::truncated::CutBonds;
use crate::fem::{CellBandError, banded_law, crack_band};
use crate::material::Axes;
use crate::mesh::Mesh;
use crate::model::{PointSource, Zone};
use crate::observe::report::number;
use crate::peridynamics::failure::Fracture;
use crate::peridynamics::{Law, ZeroEnergyControl};

/// Refuses axes that are given by position and are none at the centroid of a cell of their material.
///
/// # Errors
/// A [`SceneError`] that names the material and the place.
pub(crate) fn has_axes<const D: usize>(
    spec: &SceneSpec,
    (materials, cell_material): (&[Material<D>], &[u16]),
    mesh: &Mesh<D>,
) -> Result<(), SceneError> {
    for (number, material) in materials.iter().enumerate() {
        let Elasticity::Orthotropic {
            axes: axes @ Axes::Field(_),
            ..
        } = &material.elasticity
        else {
            continue;
        };
        let cells = (0..mesh.cell_count()).filter(|&c| usize::from(cell_material[c]) == number);
        let mut places = cells.map(|c| mesh.centroid(c));
        let Some(x) = places.find(|x| axes.at(x).iter().any(|a| !a.is_finite())) else {
            continue;
        };
        let typed = spec.materials.get(material.name.as_str());
        if let Some(MaterialSpec::Orthotropic(m)) = typed {
            let (key, typed) = match (&m.angle, &m.axis_1) {
                (Some(angle), _) => ("angle", angle),
                (None, Some(list)) => ("axis-1", &list[0]),
                (None, None) => continue,
            };
            let place = format!("materials.{}.orthotropic.{key}", material.name);
            return Err(orthotropic::no_axes(
                &place,
                typed,
                &format!(" at {:?}", x.as_slice()),
            ));
        }
    }
    Ok(())
}

/// Refuses points of a material that has no peridynamic law.
///
/// # Errors
/// A [`SceneError`] that names the material and the place.
pub(crate) fn has_laws<const D: usize>(
    spec: &SceneSpec,
    (materials, cell_material): (&[Material<D>], &[u16]),
    (mesh, zones): (&Mesh<D>, &[Zone]),
) -> Result<(), SceneError> {
    let has_none = |c: usize| materials[usize::from(cell_material[c])].law.is_none();
    let Some(c) = (0..zones.len()).find(|&c| zones[c] != Zone::Local && has_none(c)) else {
        return Ok(());
    };
    let material = &materials[usize::from(cell_material[c])];
    let zone = match zones[c] {
        Zone::Transition => "transition",
        _ => "nonlocal",
    };
    Err(SceneError::conflict(format!(
        "the {zone} zone holds a cell of the material `{}` at {:?}, and an orthotropic material has no peridynamic law",
        material.name,
        mesh.centroid(c).as_slice()
    ))
    .label(spec.span_of_material(&material.name), "finite elements only")
    .help("keep the nonlocal and transition zones within materials that have points, zones.nonlocal, or use coupling = \"local\""))
}

/// Refuses a law that is not linear where rows at the seam would not balance it: those of splice, blending, balanced and partial stress hold a uniform strain whatever stress the two sides have.
pub(crate) fn balanced_seam<const D: usize>(
    spec: &SceneSpec,
    coupling: &CouplingSpec,
    materials: &[Material<D>],
    cell_material: &[u16],
    peridynamic: u16,
) -> Result<(), SceneError> {
    let traits = coupling.traits();
    let material = &materials[peridynamic as usize];
    let Some(law) = &material.law else {
        return Ok(());
    };
    let balances = matches!(coupling, CouplingSpec::Truncated(_))
        || matches!(traits.zones, ZonesNeeded::Everywhere(_));
    // a splice gives both sides the stress of one local law, and of the bonds; partial stress that of the bonds
    let is_same = |m: &u16| std::ptr::eq(material, &raw const materials[*m as usize]);
    let elements = spec.peridynamics.as_ref().and_then(|p| p.elements.as_ref());
    let follows_bonds = elements.is_some_and(|e| *e.get_ref() == ElementsSpec::CauchyBorn);
    let has_one_stress = match coupling {
        CouplingSpec::Splice(_) => law.local_law().is_some() || follows_bonds,
        CouplingSpec::PartialStress(_) => follows_bonds,
        _ => false,
    };
    let agrees = has_one_stress && cell_material.iter().all(is_same);
    // elements are linear, and damage at their edge is found
    if balances || agrees || law.is_linear_until_damaged() {
        return Ok(());
    }
    let linear = law.linearised();
    let truncates = linear.is_ordinary() && !linear.has_deviators();
    let remedy = match (truncates, law.local_law()) {
        (_, Some(_)) if !linear.is_ordinary() => {
            "use coupling = \"truncated\", or coupling = \"splice\" with this material in all cells, or \"nonlocal\""
        }
        (_, Some(_)) => {
            "use coupling = \"splice\" with this material in all cells, or coupling = \"nonlocal\""
        }
        (true, None) => {
            "use coupling = \"truncated\", whose seam is in equilibrium at any stretch, or \"nonlocal\"; or, of a law without memory, coupling = \"splice\" with peridynamics.elements = \"cauchy-born\""
        }
        (false, None) => {
            "use coupling = \"nonlocal\"; or, of a law without memory, coupling = \"splice\" with peridynamics.elements = \"cauchy-born\""
        }
    };
    Err(SceneError::conflict(format!(
        "the law of the material `{}`, {}, is not linear, finite elements are linear, and coupling `{}` does not balance the stresses of the two",
        material.name,
        material.law_name(),
        traits.name
    ))
    .label(spec.span_of_material(&material.name), "of this material")
    .help(remedy))
}

/// Refuses an option of cut bonds where there are none: families of a law whose points have a stress end on faces.
pub(crate) fn cut_bonds<const D: usize>(
    spec: &SceneSpec,
    coupling: &CouplingSpec,
    material: &Material<D>,
) -> Result<(), SceneError> {
    let (CouplingSpec::Truncated(typed), Some(named)) = (coupling, &spec.coupling) else {
        return Ok(());
    };
    if typed.cut_bonds == Some(CutBonds::Breaking)
        && !material.fracture.is_none_or(Fracture::is_of_stretch)
    {
        return Err(SceneError::conflict(format!(
            "`coupling.truncated.cut-bonds` is \"breaking\", and bonds of the material `{}` break by the state of their points, which those that the seam cuts do not know",
            material.name
        ))
        .label(named.span(), "cuts bonds")
        .help("let cut-bonds = \"linear\", or leave it out, and keep damage two horizons away from the seam"));
    }
    let is_ordinary = |law: &Arc<dyn Law<D>>| law.linearised().is_ordinary();
    if typed.cut_bonds.is_none() || (material.law.as_ref()).is_none_or(is_ordinary) {
        return Ok(());
    }
    Err(SceneError::conflict(format!(
        "`coupling.truncated.cut-bonds` is set, and the law of the material `{}`, {}, has no bonds that a seam could cut",
        material.name,
        material.law_name()
    ))
    .label(named.span(), "families end on the faces of elements")
    .help("remove cut-bonds"))
}

/// Refuses finite elements of a law whose classical stress is not linear: they would stay elastic where the points yield.
pub(crate) fn elastic_elements<const D: usize>(
    spec: &SceneSpec,
    materials: &[Material<D>],
    cell_material: &[u16],
    zones: &[Zone],
) -> Result<(), SceneError> {
    let bends = |m: &Material<D>| {
        m.law.as_ref().is_some_and(|law| {
            !law.is_linear() && !law.linearised().is_ordinary() && law.local_law().is_none()
        })
    };
    let cells = zones.iter().zip(cell_material);
    let local = cells.filter(|(zone, _)| **zone == Zone::Local);
    let mut of_local = local.map(|(_, &m)| &materials[m as usize]);
    let Some(material) = of_local.find(|m| bends(m)) else {
        return Ok(());
    };
    Err(SceneError::conflict(format!(
        "finite elements of the material `{}` would stay elastic, and its law, {}, is not",
        material.name,
        material.law_name()
    ))
    .label(spec.span_of_material(&material.name), "of this material")
    .help("use coupling = \"nonlocal\", or give these cells an elastic material of their own"))
}

/// Refuses elements in which a material that softens would not take its fracture energy.
pub(crate) fn crack_bands<const D: usize>(
    spec: &SceneSpec,
    materials: &[Material<D>],
    cell_material: &[u16],
    (mesh, zones): (&Mesh<D>, &[Zone]),
) -> Result<(), SceneError> {
    for (own, material) in materials.iter().enumerate() {
        let Some(law) = material
            .local_law()
            .filter(|l| l.history().damage.is_some())
        else {
            continue;
        };
        let cells = (0..mesh.cell_count())
            .filter(|&c| zones[c] == Zone::Local && usize::from(cell_material[c]) == own);
        // the widest speaks for all
        let widest = (cells.clone()).max_by(|a, b| {
            let width = |c: &usize| crack_band(mesh, *c);
            width(a).total_cmp(&width(b))
        });
        let of_second_order = cells.clone().find(|&c| mesh.shapes[c].is_quadratic());
        let asked = of_second_order.or(widest);
        let Some(Err(why)) = asked.map(|c| banded_law(law.as_ref(), mesh, c)) else {
            continue;
        };
        let (cell, help) = match why {
            CellBandError::Wide { cell, source } => (
                cell,
                format!(
                    "refine the mesh to cells below {}, better a tenth of that, or give the material a larger `fracture-energy` or a lower `tensile-strength`",
                    number(source.widest)
                ),
            ),
            CellBandError::SecondOrder { cell } => (
                cell,
                "use cells of first order where this material is".to_owned(),
            ),
        };
        return Err(SceneError::conflict(format!(
            "the material `{}` at {:?}: {why}",
            material.name,
            mesh.centroid(cell).as_slice()
        ))
        .label(
            spec.span_of_material(&material.name),
            "a crack is one row of cells wide",
        )
        .help(help));
    }
    Ok(())
}

/// Returns the first material in use whose law has a history, at its points or in its elements.
fn remembering<'a, const D: usize>(
    materials: &'a [Material<D>],
    cell_material: &[u16],
    zones: &[Zone],
) -> Option<&'a Material<D>> {
    let by_points = |m: &Material<D>| {
        let states = m.force_state();
        states.is_some_and(|states| match states.correspondence(None) {
            Some(point) => point.law.history().is_path_dependent,
            None => !states.history().is_empty(),
        })
    };
    let by_elements = |m: &Material<D>| {
        let law = m.local_law();
        law.is_some_and(|law| law.history().is_path_dependent)
    };
    let mut used = zones.iter().zip(cell_material);
    let remembers = |(zone, m): &(&Zone, &u16)| match zone {
        Zone::Local => by_elements(&materials[**m as usize]),
        Zone::Transition | Zone::Nonlocal => by_points(&materials[**m as usize]),
    };
    used.find(remembers).map(|(_, m)| &materials[*m as usize])
}

/// Refuses a material with a history in static scenes, and where zones are laid out anew.
pub(crate) fn memory<const D: usize>(
    spec: &SceneSpec,
    materials: &[Material<D>],
    cell_material: &[u16],
    zones: &[Zone],
) -> Result<(), SceneError> {
    let solve = spec.analysis();
    let is_static = matches!(solve, None | Some(SolveSpec::Static(_)));
    let follows = spec.zones.follow.as_ref();
    if !is_static && follows.is_none() {
        return Ok(());
    }
    let Some(material) = remembering(materials, cell_material, zones) else {
        return Ok(());
    };
    let of = format!(
        "the law of the material `{}`, {}, remembers",
        material.name,
        material.law_name()
    );
    let refused = |message: String| SceneError::conflict(message);
    Err(match (is_static, follows) {
        (false, Some(follow)) => refused(format!("`zones.follow` is set, and {of}"))
            .label(
                follow.span(),
                "lays points and elements out anew, and their history would be lost",
            )
            .help("draw a zone that is wide enough, or remove it"),
        _ => refused(format!("{of}, and a static scene has no time"))
            .label(
                spec.span_of_material(&material.name),
                "its forces depend on how the load came",
            )
            .help("add [solve.quasi-static] with steps = ..., or [solve.explicit]"),
    })
}

/// Refuses a drag where there are no velocities: in a scene at rest and in load steps, and where sites move in sub-steps of their own.
pub(crate) fn drag<const D: usize>(
    spec: &SceneSpec,
    materials: &[Material<D>],
    points: &[u16],
) -> Result<(), SceneError> {
    let drags = |m: &&Material<D>| {
        let states = m.force_state();
        let stress = states.and_then(|states| states.correspondence(None));
        stress.is_some_and(|stress| stress.control == ZeroEnergyControl::Drag)
    };
    let mut used = points.iter().map(|m| &materials[usize::from(*m)]);
    let why = match spec.analysis() {
        Some(SolveSpec::Explicit(explicit)) if explicit.sub_steps.is_none() => return Ok(()),
        Some(SolveSpec::Explicit(_)) => "and sub-steps have several",
        _ => "and this scene is at rest in every step",
    };
    let Some(material) = used.find(drags) else {
        return Ok(());
    };
    Err(SceneError::conflict(format!(
        "`zero-energy-control` of the material `{}` is \"drag\", which resists velocities of one time step, {why}",
        material.name
    ))
    .label(spec.span_of_material(&material.name), "of this material")
    .help("use zero-energy-control = \"bond-force\" or \"length\", or [solve.explicit] without `sub-steps`"))
}

/// Refuses a horizon that was `taken` since none is typed where bonds of the points' materials may break.
///
/// # Errors
/// [`SceneErrorKind::Missing`](crate::scene::SceneErrorKind::Missing), with the horizon that would have been taken.
pub(crate) fn horizon_where_bonds_break<'a, const D: usize>(
    spec: &SceneSpec,
    taken: Option<f64>,
    solve: &Solve,
    mut of_points: impl Iterator<Item = &'a Material<D>>,
) -> Result<(), SceneError> {
    let (Some(taken), Some(material)) = (taken, of_points.find(|m| m.breaks())) else {
        return Ok(());
    };
    if *solve == Solve::Static {
        return Ok(());
    }
    Err(SceneError::missing(format!(
        "`peridynamics` lacks `horizon`, and bonds of the material `{}` may break",
        material.name
    ))
    .label(spec.span_of_material(&material.name), "its strength and its cracks depend on the horizon, which is a length of the material")
    .help(format!(
        "add horizon = {} to [peridynamics], three spacings of the points, or the length that its cracks have",
        number(taken)
    )))
}

/// Refuses a horizon below the spacing of the points.
pub(crate) fn horizon<const D: usize>(
    spec: &SceneSpec,
    p: &Peridynamics<D>,
    mesh: &Mesh<D>,
    zones: &[Zone],
) -> Result<(), SceneError> {
    for c in (0..mesh.cell_count()).filter(|&c| zones[c] != Zone::Local) {
        let x = mesh.centroid(c);
        let delta = p.horizon_at(&x);
        let spacing = match &p.points {
            PointSource::Lattice { spacing, .. } => *spacing,
            // checked body by body
            PointSource::Lattices { .. } => continue,
            PointSource::Cells if zones[c] == Zone::Nonlocal => {
                mesh.cell_volume(c).abs().powf(1.0 / D as f64)
            }
            PointSource::Cells => 0.0,
        };
        if delta.is_finite() && delta > 0.0 && delta >= spacing * (1.0 - 1e-9) {
            continue;
        }
        return Err(SceneError::wrong_value(if delta.is_finite() && delta > 0.0 {
            format!(
                "`peridynamics.horizon` is {delta} at {:?}, below the spacing {spacing} of the points there",
                x.as_slice()
            )
        } else {
            format!("`peridynamics.horizon` is {delta} at {:?}", x.as_slice())
        })
        .label(
            (spec.peridynamics.as_ref())
                .and_then(|p| p.horizon.as_ref())
                .map_or(0..0, |h| h.span.clone()),
            "no point would have a neighbour",
        )
        .help(if delta.is_finite() && delta > 0.0 {
            let third = number(delta / 3.0);
            let points = match &p.points {
                PointSource::Cells => format!("refine the mesh there, or use points.lattice = {{ spacing = {third} }}, a third of the horizon"),
                _ => format!("use a spacing of {third}, a third of the horizon, or less"),
            };
            format!("{points}; or a horizon of {} to {}, three to six spacings", number(3.0 * spacing), number(6.0 * spacing))
        } else {
            "give a horizon above zero everywhere, three to six spacings".to_owned()
        }));
    }
    Ok(())
}
