//! Domains around the tips of cracks over which energy release rates and stress intensity factors are integrated.

use std::ops::RangeInclusive;
use std::sync::Arc;

use super::conditions::Prescribed;
use super::error::{SceneError, Span};
use super::load::Domain;
use super::region;
use super::solve::Solve;
use super::spec::{SceneSpec, TipSpec};
use super::validated::{Scene, Tip, TipDomains};
use super::value::Text;
use crate::fem::Locator;
use crate::peridynamics::Law;
use crate::shape::Shape;
use crate::tensor::Vector;

/// Radii of the domains that a scene does not type, in horizons. Closer than two, the stress of points is one of means over families that reach the tip.
const IN_HORIZONS: RangeInclusive<u32> = 2..=5;

/// The least distance that the outermost radius keeps from what ends the body or the crack, over that radius.
const CLEARANCE: f64 = 1.0 + 1e-9;

/// The scene with domains around the tips whose energy release rate it asks for.
///
/// # Errors
/// A [`SceneError`] for a scene in which the integral does not hold, or a tip without room for a domain.
pub(super) fn laid_out<const D: usize>(
    spec: &SceneSpec,
    mut scene: Scene<D>,
) -> Result<Scene<D>, SceneError> {
    for (key, typed) in &spec.output.tips {
        if typed.energy_release != Some(true) {
            if let Some(first) = typed.radii.first() {
                return Err(SceneError::conflict(format!(
                    "`output.tips.{key}.radii` are radii of nothing"
                ))
                .label(first.span.clone(), "no integral is asked for")
                .help("add energy-release = true, or leave the radii out"));
            }
            continue;
        }
        refuse_scene(key, &scene)?;
        let at = scene
            .output
            .tips
            .iter()
            .position(|tip| tip.name == key.value);
        if let Some(at) = at {
            let domains = domains(key, typed, spec, &scene, &scene.output.tips[at])?;
            scene.output.tips[at].domains = Some(domains);
        }
    }
    Ok(scene)
}

/// Refuses a scene in which the integral depends on its domain.
fn refuse_scene<const D: usize>(key: &Text, scene: &Scene<D>) -> Result<(), SceneError> {
    let place = format!("`output.tips.{key}.energy-release`");
    let loads_inside = |p: &Prescribed<D>| matches!(p, Prescribed::Load(load) if matches!(load.on, Domain::Cells(_)));
    let force = (scene.conditions.iter()).find(|c| loads_inside(&c.prescribed));
    let (what, remedy) = if D != 2 {
        (
            "is there in two dimensions",
            "leave it out, or compute a section in plane strain".to_owned(),
        )
    } else if matches!(scene.solve, Solve::Explicit(_)) {
        (
            "knows no inertia",
            "compute the scene at rest or in load steps".to_owned(),
        )
    } else if scene.temperature.is_some() {
        (
            "knows no thermal strain",
            "leave `temperature` out".to_owned(),
        )
    } else if let Some(force) = force {
        (
            "knows no body force",
            format!("let `conditions.{}` act on the surface", force.name),
        )
    } else {
        return Ok(());
    };
    Err(SceneError::conflict(format!("{place} {what}"))
        .label(key.span.clone(), "the integral would depend on its domain")
        .help(remedy))
}

fn domains<const D: usize>(
    key: &Text,
    typed: &TipSpec,
    spec: &SceneSpec,
    scene: &Scene<D>,
    tip: &Tip<D>,
) -> Result<TipDomains<D>, SceneError> {
    let place = format!("output.tips.{key}");
    let Some(end) = crack_end(spec, scene, tip)? else {
        return Err(SceneError::missing(format!(
            "`{place}.energy-release`: no crack ends there"
        ))
        .label(key.span.clone(), "no tip")
        .help("type the crack as a segment or a polyline in [cracks.NAME]; `inside` must hold its end"));
    };
    let (span, tip) = (key.span.clone(), end.tip);
    let horizon = scene.peridynamics.as_ref().map(|p| p.horizon_at(&tip));
    let Some(horizon) = horizon else {
        return Err(SceneError::missing(format!(
            "`{place}.energy-release`: nothing is cut without points"
        ))
        .label(span, "finite elements cannot be cut")
        .help("add [peridynamics], and a nonlocal zone around the crack"));
    };
    let lame = material(&place, &span, scene, &tip)?;
    let (room, what) = room(spec, scene, &end, lame)?;
    let radii = match typed.radii.is_empty() {
        true => default_radii(&place, span, horizon, (room, what))?,
        false => typed_radii(&place, typed, (room, what))?,
    };
    Ok(TipDomains {
        tip,
        along: end.along,
        radii,
        lame,
    })
}

/// The end of a crack.
struct CrackEnd<const D: usize> {
    /// The crack, by its name.
    crack: Text,
    tip: Vector<D>,
    /// The direction in which it would grow straight on, of length 1.
    along: Vector<D>,
    /// The crack but for its last straight piece.
    rest: Shape<D>,
}

/// The end of a typed crack that lies farthest along the direction of a tip, within its region.
fn crack_end<const D: usize>(
    spec: &SceneSpec,
    scene: &Scene<D>,
    tip: &Tip<D>,
) -> Result<Option<CrackEnd<D>>, SceneError> {
    let mut best: Option<CrackEnd<D>> = None;
    for (name, typed) in &spec.cracks {
        let shape = region::shape(&format!("cracks.{name}"), typed, &scene.mesh, &name.span)?;
        let points = match shape {
            Shape::Segment { a, b } => vec![a, b],
            Shape::Polyline(points) => points,
            _ => continue,
        };
        let n = points.len();
        if n < 2 {
            continue;
        }
        let ends = [(points[0], &points[1..]), (points[n - 1], &points[..n - 1])];
        for ((end, rest), before) in ends.into_iter().zip([points[1], points[n - 2]]) {
            let reach = |x: &Vector<D>| tip.direction.dot(x);
            let is_farther = best.as_ref().is_none_or(|b| reach(&end) > reach(&b.tip));
            let along = (end - before).try_normalize(0.0);
            if let Some(along) = along.filter(|_| is_farther && tip.inside.contains(&end, 0.0)) {
                best = Some(CrackEnd {
                    crack: name.clone(),
                    tip: end,
                    along,
                    rest: Shape::Polyline(rest.to_vec()),
                });
            }
        }
    }
    Ok(best)
}

/// Lamé's parameters of the elastic material at a tip.
fn material<const D: usize>(
    place: &str,
    span: &Span,
    scene: &Scene<D>,
    tip: &Vector<D>,
) -> Result<(f64, f64), SceneError> {
    let mesh = &scene.mesh;
    let tolerance = 1e-9 * (mesh.bounds().1 - mesh.bounds().0).norm();
    let located = Locator::new(mesh, 0..mesh.cell_count()).locate(mesh, tip, tolerance);
    let Some(located) = located else {
        return Err(SceneError::empty(format!(
            "`{place}.energy-release`: the crack ends outside of the mesh, at {:?}",
            tip.as_slice()
        ))
        .label(span.clone(), "no tip")
        .help("turn `direction` to the end that lies in the body"));
    };
    let material = &scene.materials[usize::from(scene.cell_material[located.cell])];
    let is_elastic = |law: &Arc<dyn Law<D>>| {
        law.is_linear_until_damaged() && law.local_law().is_none_or(|l| l.is_linear())
    };
    if let (Some(lame), true) = (
        material.lame(),
        material.law.as_ref().is_some_and(is_elastic),
    ) {
        return Ok(lame);
    }
    Err(SceneError::conflict(format!(
        "`{place}.energy-release`: the material `{}` is not isotropic and linearly elastic",
        material.name
    ))
    .label(
        span.clone(),
        "the integrals are those of an isotropic elastic body",
    )
    .help("use `bond-based`, `lps` or `correspondence`"))
}

/// The distance from the end of a crack up to which there is nothing but a homogeneous body and the straight crack, and what ends it.
fn room<const D: usize>(
    spec: &SceneSpec,
    scene: &Scene<D>,
    end: &CrackEnd<D>,
    lame: (f64, f64),
) -> Result<(f64, String), SceneError> {
    let (mesh, tip) = (&scene.mesh, &end.tip);
    let mut nearest = (
        end.rest.signed_distance(tip),
        format!("the rest of the crack `{}`", end.crack),
    );
    let mut meet = |distance: f64, what: &dyn Fn() -> String| {
        if distance < nearest.0 {
            nearest = (distance, what());
        }
    };
    for facet in mesh.outer_facets() {
        meet(mesh.distance_to_facet(tip, &facet.nodes), &|| {
            "the surface of the body".to_owned()
        });
    }
    for (name, typed) in spec.cracks.iter().filter(|(name, _)| **name != end.crack) {
        let shape = region::shape(&format!("cracks.{name}"), typed, mesh, &name.span)?;
        meet(shape.signed_distance(tip), &|| {
            format!("the crack `{name}`")
        });
    }
    for void in &scene.voids {
        meet(void.signed_distance(tip), &|| "a void".to_owned());
    }
    for c in 0..mesh.cell_count() {
        let other = &scene.materials[usize::from(scene.cell_material[c])];
        if other.lame() == Some(lame) {
            continue;
        }
        let (low, high) = mesh.bounds_of(mesh.corners(c));
        let outside = (low - tip).sup(&(tip - high)).sup(&Vector::zeros());
        meet(outside.norm(), &|| format!("the material `{}`", other.name));
    }
    Ok(nearest)
}

/// Radii of two to five horizons, or of as many as there is room for.
fn default_radii(
    place: &str,
    span: Span,
    horizon: f64,
    (room, what): (f64, String),
) -> Result<Vec<f64>, SceneError> {
    let [least, most] = [*IN_HORIZONS.start(), *IN_HORIZONS.end()].map(|n| f64::from(n) * horizon);
    let outermost = most.min(room / CLEARANCE);
    if outermost < least + horizon {
        return Err(SceneError::conflict(format!(
            "`{place}.energy-release`: three horizons around the tip, {:.4}, meet {what} at {room:.4}",
            least + horizon
        ))
        .label(span, "no room for a domain")
        .help("take a smaller horizon, or type `radii`"));
    }
    let domains = IN_HORIZONS.count() - 1;
    let width = (outermost - least) / domains as f64;
    Ok((0..=domains).map(|k| least + width * k as f64).collect())
}

/// Radii that a scene types.
fn typed_radii(
    place: &str,
    typed: &TipSpec,
    (room, what): (f64, String),
) -> Result<Vec<f64>, SceneError> {
    let place = format!("{place}.radii");
    let radii: Vec<f64> = typed.radii.iter().map(|r| r.value).collect();
    let wrong = |k: usize, message: String, label: &str, help: &str| {
        Err(SceneError::wrong_value(message)
            .label(typed.radii[k].span.clone(), label)
            .help(help))
    };
    if radii.len() < 4 {
        return wrong(
            radii.len() - 1,
            format!("`{place}` has {} of at least 4 radii", radii.len()),
            "too few domains",
            "three domains tell the error of the integral: radii = [2, 3, 4, 5] in units of the horizon, say",
        );
    }
    let shrinks = |k: &usize| radii[*k] <= k.checked_sub(1).map_or(0.0, |before| radii[before]);
    if let Some(k) = (0..radii.len()).find(shrinks) {
        return wrong(
            k,
            format!("`{place}` has {} after a radius as large", radii[k]),
            "encloses nothing",
            "list positive radii from the smallest to the largest",
        );
    }
    let last = radii.len() - 1;
    if radii[last] * CLEARANCE > room {
        return wrong(
            last,
            format!(
                "`{place}` has {}, and {what} is {room:.4} from the tip",
                radii[last]
            ),
            "leaves the homogeneous body",
            "take smaller radii",
        );
    }
    Ok(radii)
}
