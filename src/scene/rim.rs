//! The scene with a rim of its own around the nonlocal zone: horizon and points by the mesh as it is, everything else by the mesh with the patch.

mod conflict;
mod held_places;

use std::sync::Arc;

use self::conflict::{conflict_with, places_of};
use self::held_places::HeldPlaces;

use super::coupling_selection::follows;
use super::draft::Draft;
use super::error::SceneError;
use super::region::{self, Region};
use super::section::UncutBody;
use super::source::Span;
use super::spec::{
    CouplingSpec, LatticeStart, RimSpec, SceneSpec, SkinSpec, TransitionSpec, TruncatedSpec,
    ZonesNeeded,
};
use super::unused::Parts;
use super::validated::Scene;
use super::zones::Placed;
use crate::fem::Locator;
use crate::model::patch::{self, PatchError, PatchLattice, Patched, Places, Replaced};
use crate::model::{PointSource, Reach, Zone};
use crate::observe::report::number;
use crate::observe::summary::Decision;
use crate::scene::solve::Solve;
use crate::tensor::Vector;

/// Spacings along the edge of a cell of the rim in a motion: the rim then takes larger steps than the points. Where the surface of the body leaves no whole number of them, and at rest, it is one.
const PER_CELL: u32 = 2;

/// The place at which a scene asks for a rim of its own.
fn wanted(spec: &SceneSpec) -> Option<Span> {
    let rim = spec.zones.rim.as_ref()?;
    (*rim.get_ref() == RimSpec::Own).then(|| rim.span())
}

/// The scene with the zone that was placed, or with the one that it draws, and with a rim of its own around it if it asks for one.
///
/// # Errors
/// Those of the scene, and [`PatchError`] at the place of the zone.
pub(crate) fn scene<const D: usize>(
    draft: &Draft<'_, D>,
    placed: Option<&Placed>,
) -> Result<Scene<D>, SceneError> {
    // one model alone has no seam
    let typed = draft
        .spec
        .coupling
        .as_ref()
        .map(|c| c.get_ref().traits().zones);
    let is_alone = matches!(typed, Some(ZonesNeeded::Everywhere(_)));
    match wanted(draft.spec).filter(|_| !is_alone) {
        Some(span) => with_rim(draft, placed, span, "the scene asks for a rim of its own"),
        None => Ok(before_others(draft, placed, draft.scene(placed)?)),
    }
}

/// Distance of the middle of a side from a straight one, over the edge of a cell of the rim, that is not told: the digits of a file.
const STRAIGHT: f64 = 1e-6;

/// Distance, in spacings, by which faces may deviate from the lattice and still keep a seam: the digits of a file.
const OFF: f64 = 1e-3;

/// Gives the zone a rim of its own where its faces do not follow the lattice: for bonds that end on faces, and for families that reach into elements other than boxes along the axes, in which fields are interpolated to lower order. Where
/// a rim is refused the faces stay, and the run says why.
fn before_others<const D: usize>(
    draft: &Draft<'_, D>,
    placed: Option<&Placed>,
    mut scene: Scene<D>,
) -> Scene<D> {
    let (zones, lattice) = (
        &draft.spec.zones,
        scene.peridynamics.as_ref().map(|p| &p.points),
    );
    let (Some(zone), None, Some(PointSource::Lattice { spacing, origin })) =
        (&zones.nonlocal, &zones.rim, lattice)
    else {
        return scene;
    };
    let interface = scene.method().interface();
    let ends_on_faces = interface.faces || interface.feet;
    let gains = ends_on_faces || interface.overlap && is_beside_others_than_boxes(&scene);
    if !gains || follows(&scene.mesh, &scene.zones, (*spacing, origin), OFF) {
        return scene;
    }
    let why = "the faces of the mesh do not follow the lattice";
    match with_rim(draft, placed, zone.span(), why) {
        Ok(mut rim) => {
            rim.otherwise = Some(Box::new(scene));
            rim
        }
        Err(refused) => {
            let why = refused.message().to_owned();
            scene.choices.push(Decision {
                choice: "the seam along the faces of the mesh".to_owned(),
                why: format!("a rim of its own is refused: {why}"),
            });
            scene.refused_rim = Some(why);
            scene
        }
    }
}

/// Returns true if an element with a node on the zone is no box along the axes.
fn is_beside_others_than_boxes<const D: usize>(scene: &Scene<D>) -> bool {
    let (mesh, zones) = (&scene.mesh, &scene.zones);
    let mut is_at_zone = vec![false; mesh.nodes.len()];
    let zone = (0..zones.len()).filter(|&c| zones[c] == Zone::Nonlocal);
    zone.flat_map(|c| mesh.corners(c))
        .for_each(|&n| is_at_zone[n as usize] = true);
    let mut others = (0..zones.len()).filter(|&c| zones[c] != Zone::Nonlocal);
    others.any(|c| {
        let corners = mesh.corners(c);
        let (low, high) = mesh.bounds_of(corners);
        let size = (high - low).amax();
        let at_corner = |&n: &u32| {
            let x = mesh.nodes[n as usize];
            (0..D).all(|i| (x[i] - low[i]).min(high[i] - x[i]) <= OFF * size)
        };
        let is_box = corners.len() == 1 << D && corners.iter().all(at_corner);
        corners.iter().any(|&n| is_at_zone[n as usize]) && !is_box
    })
}

/// The scene whose seam runs along a rim of its own; `span` is where it asks for that, or draws the zone.
fn with_rim<const D: usize>(
    draft: &Draft<'_, D>,
    placed: Option<&Placed>,
    span: Span,
    why: &str,
) -> Result<Scene<D>, SceneError> {
    refuse_others(draft.spec, &span)?;
    let truncated = CouplingSpec::Truncated(TruncatedSpec::default());
    let instead = draft.spec.coupling.is_none().then_some(&truncated);
    let touched = placed.is_none().then(|| met(draft)).flatten();
    let (before, _) = draft.with_coupling(placed.or(touched.as_ref()), instead)?;
    let conflict = |what: String, help: &str| {
        SceneError::conflict(what)
            .label(span.clone(), "a layer of elements on the lattice")
            .help(help.to_owned())
    };
    let lattice = before.peridynamics.as_ref().map(|p| &p.points);
    let Some(&PointSource::Lattice { spacing, origin }) = lattice else {
        return Err(conflict(
            "a rim of its own lies on a lattice, and the points are none".to_owned(),
            "use peridynamics.points.lattice, or rim = \"mesh\"",
        ));
    };
    let corner = match before.coupling.traits().lattice {
        LatticeStart::OnCorner => origin,
        LatticeStart::Halfway => origin.add_scalar(-0.5 * spacing),
    };
    let may_part =
        before.breaking.breaks() || !draft.spec.cracks.is_empty() || !draft.spec.voids.is_empty();
    let typed_skin = draft.spec.zones.skin;
    let lattice = PatchLattice {
        corner,
        spacing,
        per_cell: 1,
        within: around(draft, placed, &before),
        has_masses: matches!(draft.solve, Solve::Explicit(_)),
        has_skin: match typed_skin {
            None => !may_part,
            Some(skin) => skin == SkinSpec::FreeSurfaces,
        },
        may_part,
        reach: reach(draft.spec, &before)
            .map_err(|what| conflict(what, "or use rim = \"mesh\""))?,
    };
    let (patched, per_cell, kept_off) =
        borne(draft, placed, (&before, &lattice)).map_err(|(what, help)| conflict(what, help))?;
    let mut choices = vec![told(&patched, spacing * f64::from(per_cell), why)];
    choices.extend(told_of_skin(patched.skin, typed_skin));
    choices.extend(told_of_kept_off(patched.kept_off, &kept_off));
    let zone = Placed {
        nonlocal: patched.nonlocal,
        span: (draft.spec.zones.nonlocal.as_ref()).map_or(span, |zone| zone.span()),
        is_for_patch: true,
    };
    let cell_material = (patched.origin.iter())
        .map(|&c| draft.cell_material[c as usize])
        .collect();
    let draft = draft.on_mesh(patched.mesh, cell_material, before.peridynamics)?;
    let (mut scene, _) = draft.with_coupling(Some(&zone), instead)?;
    scene.choices.extend(choices);
    if !scene.output.sections.is_empty() {
        let uncut = Arc::new(UncutBody {
            mesh: before.mesh,
            conditions: before.conditions,
        });
        for section in &mut scene.output.sections {
            section.uncut = Some(Arc::clone(&uncut));
        }
    }
    let (spec, unused) = (draft.spec, &scene);
    scene.unused = Parts {
        spec,
        scene: unused,
    }
    .unused();
    Ok(scene)
}

/// The mesh with a patch that bears all conditions, the spacings along the edge of its cells, and the conditions that it was kept off; else what stands against it, and a remedy.
fn borne<const D: usize>(
    draft: &Draft<'_, D>,
    placed: Option<&Placed>,
    (before, lattice): (&Scene<D>, &PatchLattice<D>),
) -> Result<(Patched<D>, u32, Vec<String>), (String, &'static str)> {
    let (mut names, mut places) = (Vec::new(), Vec::new());
    loop {
        let found = embedded_with_skin(draft, placed, (before, &places), *lattice);
        let (patched, per_cell) = found.map_err(|error| match (&error, names.first()) {
            (PatchError::Empty { .. }, Some(name)) => (
                format!("the rim of the zone would cross a surface that `conditions.{name}` acts on, and the zone is nowhere deeper in the body than its rim and a cell"),
                "let the zone reach further away from that surface, or use rim = \"mesh\"",
            ),
            _ => (format!("`zones.rim`: {error}"), "or use rim = \"mesh\""),
        })?;
        let unborne: Vec<_> = (draft.conditions.iter())
            .filter_map(|condition| Some((condition, conflict_with(condition, draft, &patched)?)))
            .collect();
        let known = names.len();
        for (condition, conflict) in &unborne {
            if !names.contains(&condition.name) {
                names.push(condition.name.clone());
                places.extend(places_of(conflict, &draft.mesh, lattice));
            }
        }
        match unborne.first() {
            None => return Ok((patched, per_cell, names)),
            // where it was kept off already, a strip that no element carries lies between
            Some((condition, conflict)) if names.len() == known => {
                return Err((
                    format!("`conditions.{}` {}", condition.name, conflict.what),
                    "keep the zone, and a rim of a cell around it, away from there, or use rim = \"mesh\"",
                ));
            }
            Some(_) => {}
        }
    }
}

/// Says how large the rim is, and what of the mesh ends at it.
fn told<const D: usize>(patched: &Patched<D>, edge: f64, why: &str) -> Decision {
    let embedded = &patched.mesh.embedded;
    let Replaced {
        linear,
        halved,
        moved,
        divided,
    } = &patched.replaced;
    let mut replaced = match linear {
        0 => String::new(),
        n => format!(", {n} of second order are linear there"),
    };
    if *halved > 0 {
        replaced += &format!(", {halved} quadrilaterals of second order are two triangles each");
    }
    if *moved > STRAIGHT * edge {
        let moved = number(*moved);
        replaced += &format!(", with straight sides, which move their surfaces by up to {moved}");
    }
    replaced += &match divided {
        0 => String::new(),
        n => format!(", {n} of them are divided about their middle"),
    };
    Decision {
        choice: format!(
            "a rim of {} elements of edge {} around the zone; {} elements of the mesh end at it{replaced}",
            patched.rim,
            number(edge),
            embedded.cut.len() - embedded.pieces.len(),
        ),
        why: why.to_owned(),
    }
}

/// Says how many cells of the lattice the surface of the body has made elements of, if any.
fn told_of_skin(count: usize, typed: Option<SkinSpec>) -> Option<Decision> {
    let why = match typed {
        Some(_) => "the scene asks for a skin",
        None => {
            "nothing fails in this scene, and families lack points at a surface; zones.skin = \"none\" has points there"
        }
    };
    (count > 0).then(|| Decision {
        choice: format!(
            "elements along the surface of the body in the place of {count} cells of points"
        ),
        why: why.to_owned(),
    })
}

/// Says which conditions have made elements of cells of the lattice, and of how many.
fn told_of_kept_off(count: usize, conditions: &[String]) -> Option<Decision> {
    (count > 0).then(|| Decision {
        choice: format!(
            "elements of the mesh in the place of {count} cells of points beside `{}`",
            conditions.join("`, `")
        ),
        why: "a rim across it would have no nodes there".to_owned(),
    })
}

/// The cells of the mesh whose horizon and points those of the patch are, where they are not those that the zone holds in the mesh: all of them where a skin would take some, or one that the zone meets which holds no centroid.
fn met<const D: usize>(draft: &Draft<'_, D>) -> Option<Placed> {
    let (mesh, zone) = (&draft.mesh, draft.spec.zones.nonlocal.as_ref()?);
    let region = region::region("zones.nonlocal", zone.get_ref(), mesh).ok()?;
    let meets = |c: usize| {
        let x = mesh.centroid(c);
        let corners = mesh.corners(c).iter();
        let radius = corners.map(|&n| (mesh.nodes[n as usize] - x).norm());
        region
            .distance(&x)
            .map(|distance| distance <= radius.fold(0.0, f64::max))
    };
    let meets: Vec<bool> = (0..mesh.cell_count()).map(meets).collect::<Option<_>>()?;
    let held = region.select(mesh);
    let nonlocal = match held.contains(&true) {
        true if draft.spec.zones.skin.is_none() => return None,
        true => held,
        // one of them, so that others stay local
        false => {
            let first = meets.iter().position(|meets| *meets)?;
            (0..meets.len()).map(|c| c == first).collect()
        }
    };
    Some(Placed {
        nonlocal,
        span: zone.span(),
        is_for_patch: true,
    })
}

/// Refuses what a zone with a rim of its own does not have.
fn refuse_others(spec: &SceneSpec, span: &Span) -> Result<(), SceneError> {
    let zones = &spec.zones;
    let others = [
        ("zones.auto", zones.auto.is_some()),
        ("zones.follow", zones.follow.is_some()),
        ("zones.bodies", !zones.bodies.is_empty()),
    ];
    match others.iter().find(|other| other.1) {
        None => Ok(()),
        Some((key, _)) => Err(SceneError::conflict(format!(
            "a rim of its own and `{key}` do not go together"
        ))
        .label(span.clone(), "a layer of elements on the lattice")
        .help(format!("leave out {key}, or use rim = \"mesh\""))),
    }
}

/// Distance from the zone up to which a coupling needs the lattice, beside one cell: nothing where bonds end on faces; else the width of the transition zone and as far as families reach.
fn reach<const D: usize>(spec: &SceneSpec, before: &Scene<D>) -> Result<f64, String> {
    let coupling = before.method();
    let Some(law) = before
        .point_law
        .as_ref()
        .filter(|_| coupling.interface().overlap)
    else {
        return Ok(0.0);
    };
    let width = match spec.zones.transition.as_ref().map(|t| t.get_ref()) {
        None => 0.0,
        Some(TransitionSpec::Around(width)) => width.value,
        Some(_) => {
            return Err(
                "a rim of its own needs `zones.transition.around`, a width: it reaches as far"
                    .to_owned(),
            );
        }
    };
    let horizon = before.peridynamics.as_ref().map(|p| &p.horizon);
    let horizon = horizon.and_then(|horizon| horizon.as_constant());
    let families = match (&before.coupling, coupling.reach(law.linearised())) {
        // its blending reaches one family past the zone
        (CouplingSpec::Balanced(_), _) | (_, Reach::Neighbours) => 2.0,
        (_, Reach::Own) => 1.0,
    };
    match horizon {
        Some(horizon) => Ok(width + families * horizon),
        None => Err("a rim of its own needs one horizon".to_owned()),
    }
}

/// The region that a scene draws as its zone, if it does.
fn drawn<const D: usize>(draft: &Draft<'_, D>, placed: Option<&Placed>) -> Option<Region<D>> {
    let typed = (draft.spec.zones.nonlocal.as_ref()).filter(|_| placed.is_none())?;
    region::region("zones.nonlocal", typed.get_ref(), &draft.mesh).ok()
}

/// Corners of a box around the cells of the mesh that the zone may meet.
fn around<const D: usize>(
    draft: &Draft<'_, D>,
    placed: Option<&Placed>,
    before: &Scene<D>,
) -> (Vector<D>, Vector<D>) {
    let (mesh, drawn) = (&draft.mesh, drawn(draft, placed));
    let may_meet = |c: usize| {
        let x = mesh.centroid(c);
        match drawn.as_ref().and_then(|zone| zone.distance(&x)) {
            Some(distance) => {
                let corners = mesh.corners(c).iter();
                let radius = corners.map(|&n| (mesh.nodes[n as usize] - x).norm());
                distance <= radius.fold(0.0, f64::max)
            }
            None => before.zones[c] == Zone::Nonlocal,
        }
    };
    let cells = (0..mesh.cell_count()).filter(|&c| may_meet(c));
    let nodes: Vec<u32> = cells.flat_map(|c| mesh.corners(c)).copied().collect();
    mesh.bounds_of(&nodes)
}

/// As [`embedded`], without a skin that the scene does not ask for where the zone is nowhere thick enough for one.
fn embedded_with_skin<const D: usize>(
    draft: &Draft<'_, D>,
    placed: Option<&Placed>,
    before: (&Scene<D>, &[Vector<D>]),
    lattice: PatchLattice<D>,
) -> Result<(Patched<D>, u32), PatchError> {
    let found = embedded(draft, placed, before, lattice);
    if found.is_ok() || !lattice.has_skin || draft.spec.zones.skin.is_some() {
        return found;
    }
    let without = PatchLattice {
        has_skin: false,
        ..lattice
    };
    embedded(draft, placed, before, without)
}

/// The mesh with a patch that is kept off some places, and how many spacings its cells have along their edges.
fn embedded<const D: usize>(
    draft: &Draft<'_, D>,
    placed: Option<&Placed>,
    (before, kept_off): (&Scene<D>, &[Vector<D>]),
    lattice: PatchLattice<D>,
) -> Result<(Patched<D>, u32), PatchError> {
    let mesh = &draft.mesh;
    let drawn = drawn(draft, placed);
    let locator = Locator::new(mesh, 0..mesh.cell_count());
    let is_wanted = |x: &Vector<D>| match drawn.as_ref().and_then(|zone| zone.distance(x)) {
        Some(distance) => distance <= 0.0,
        // a set, or a zone that was placed, has cells
        None => (locator.locate(mesh, x, 1e-9))
            .is_some_and(|found| before.zones[found.cell] == Zone::Nonlocal),
    };
    let supports = HeldPlaces::new(mesh, &draft.conditions, lattice.spacing);
    let holds = |x: &Vector<D>| supports.holds(mesh, x);
    let places = Places {
        is_wanted: &is_wanted,
        kept_off,
        is_held: &|n| supports.nodes[n as usize],
        holds: (!supports.is_empty()).then_some(&holds),
    };
    let embed = |per_cell: u32| {
        let lattice = PatchLattice {
            per_cell,
            ..lattice
        };
        patch::embed(mesh, lattice, places, &|c| draft.cell_material[c as usize])
            .map(|patched| (patched, per_cell))
    };
    match draft.solve {
        Solve::Explicit(_) => match embed(PER_CELL) {
            // strings along the edges of a zone of bonds that end on faces close over planes alone
            Ok((patched, _)) if D == 3 && is_zone_cut(&patched) => match embed(1) {
                Ok((other, per_cell)) if !is_zone_cut(&other) => Ok((other, per_cell)),
                _ => Ok((patched, PER_CELL)),
            },
            Err(
                PatchError::Empty { .. }
                | PatchError::Mass { .. }
                | PatchError::Circle { .. }
                | PatchError::Torn { .. }
                | PatchError::Grown,
            ) => embed(1),
            found => found,
        },
        Solve::Static | Solve::QuasiStatic(_) => embed(1),
    }
}

/// Returns true if the surface of the body cuts a cell of the zone.
fn is_zone_cut<const D: usize>(patched: &Patched<D>) -> bool {
    let mut cut = patched.mesh.embedded.pieces.keys();
    cut.any(|&c| patched.nonlocal[c as usize])
}
