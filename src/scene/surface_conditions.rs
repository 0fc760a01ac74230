//! Conditions that know of the geometry of what they act on: pressure, planes of symmetry, rotations.

use rustc_hash::FxHashSet;

use super::bounds_checks;
use super::conditions::{
    Bedding, Components, Condition, Prescribed, facet_set, finite, inside, support,
};
use super::error::{SceneError, SceneErrorKind};
use super::expression::Expression;
use super::region::position;
use super::solve::Clock;
use super::spec::{PressureSpec, RotationSpec, SpringSpec, SymmetrySpec};
use super::value::Text;
use crate::mesh::Mesh;
use crate::mesh::boundary::BoundaryFacet;
use crate::tensor::{Tensor, Vector};

const AXES: [&str; 3] = ["x", "y", "z"];

/// A pressure on facets at the boundary of the mesh.
pub(super) fn pressure<const D: usize>(
    name: &Text,
    spec: &PressureSpec,
    mesh: &Mesh<D>,
    clock: Clock,
) -> Result<Condition<D>, SceneError> {
    let place = format!("conditions.{name}.pressure");
    let at = format!("{place}.value");
    bounds_checks::no_further_axes::<D>(&at, &spec.value)?;
    clock.admits(&at, &spec.value)?;
    let facets = outer_facets(&place, &spec.on, mesh)?;
    let components = only(0, spec.value.clone());
    let nodes = facets.iter().flat_map(|f| f.nodes.iter());
    let nodes = nodes.map(|&n| mesh.nodes[n as usize]);
    finite(&place, name, &components, clock, nodes)?;
    Ok(Condition {
        name: name.value.clone(),
        prescribed: Prescribed::Pressure(facets),
        components,
    })
}

/// The facets of a named set, normals outwards; all of them bound the mesh.
pub(super) fn outer_facets<const D: usize>(
    place: &str,
    on: &Text,
    mesh: &Mesh<D>,
) -> Result<Vec<BoundaryFacet>, SceneError> {
    let facets = facet_set(place, on, mesh)?;
    let sorted = |nodes: &[u32]| {
        let mut nodes = nodes.to_vec();
        nodes.sort_unstable();
        nodes
    };
    let outer = mesh.outer_facets();
    let outer: FxHashSet<Vec<u32>> = outer.iter().map(|f| sorted(&f.nodes)).collect();
    if let Some(inner) = facets.iter().find(|f| !outer.contains(&sorted(f))) {
        let nodes = inner.iter().map(|&n| mesh.nodes[n as usize]);
        let middle = nodes.sum::<Vector<D>>() / inner.len() as f64;
        return Err(SceneError::new(
            SceneErrorKind::Conflict,
            format!(
                "`{place}.on`: the facet of the set `{on}` at {:?} is not at the boundary of the mesh",
                middle.as_slice()
            ),
        )
        .label(on.span.clone(), "has no outside there")
        .help("name a set of facets that each belong to one cell; inside of the body prescribe a traction"));
    }
    faces(place, on, mesh)
}

/// The facets of a named set, each a face of a cell, its normal pointing out of that.
pub(super) fn faces<const D: usize>(
    place: &str,
    on: &Text,
    mesh: &Mesh<D>,
) -> Result<Vec<BoundaryFacet>, SceneError> {
    let facets = facet_set(place, on, mesh)?;
    mesh.locate_facets(facets).map_err(|error| {
        SceneError::new(SceneErrorKind::Conflict, format!("`{place}.on`: {error}"))
            .label(on.span.clone(), "not a face of a cell")
            .help("let the set hold faces of the cells of this mesh only")
    })
}

/// Springs to the ground on facets, or in cells.
pub(super) fn spring<const D: usize>(
    name: &Text,
    spec: &SpringSpec,
    mesh: &Mesh<D>,
) -> Result<Condition<D>, SceneError> {
    let place = format!("conditions.{name}.spring");
    let given = [&spec.x, &spec.y, &spec.z];
    let choice = |what: &str, help: &str| {
        Err(
            SceneError::new(SceneErrorKind::Choice, format!("`{place}` has {what}"))
                .label(name.span.clone(), "springs")
                .help(help),
        )
    };
    let mut stiffness = Vector::<D>::zeros();
    for (k, number) in given.iter().enumerate() {
        let Some(number) = number else { continue };
        let at = format!("{place}.{}", AXES[k]);
        let value = bounds_checks::positive(&at, number)?;
        if k >= D {
            return Err(SceneError::new(
                SceneErrorKind::Dimension,
                format!("`{at}` in a scene of dimension {D}"),
            )
            .label(number.span.clone(), "no such axis")
            .help(format!("remove `{}`", AXES[k])));
        }
        stiffness[k] = value;
    }
    let has_components = given.iter().any(|g| g.is_some());
    let bedding = match (&spec.on, &spec.inside, &spec.normal) {
        (None, None, _) | (Some(_), Some(_), _) => {
            return choice(
                match spec.on {
                    Some(_) => "both `on` and `inside`",
                    None => "neither `on` nor `inside`",
                },
                "keep one: `on = \"set\"` of the mesh, or `inside = { box = ... }`",
            );
        }
        (_, _, Some(_)) if has_components => {
            return choice("`normal` and components", "keep one of the two");
        }
        (None, Some(_), Some(_)) => {
            return choice(
                "`inside` and `normal`",
                "cells have no normal: give components, or name a set of facets by `on`",
            );
        }
        (_, _, None) if !has_components => {
            return choice("no stiffness", "add x = ..., or normal = ...");
        }
        (Some(on), None, Some(normal)) => Bedding::Normal {
            facets: outer_facets(&place, on, mesh)?,
            stiffness: bounds_checks::positive(&format!("{place}.normal"), normal)?,
        },
        (Some(on), None, None) => Bedding::Axes {
            facets: facet_set(&place, on, mesh)?.to_vec(),
            stiffness,
        },
        (None, Some(shape), None) => Bedding::Inside {
            region: inside(&place, name, shape, mesh)?,
            stiffness,
        },
    };
    Ok(Condition {
        name: name.value.clone(),
        prescribed: Prescribed::Spring(bedding),
        components: Components(std::array::from_fn(|_| None)),
    })
}

/// A vector field with one component.
fn only<const D: usize>(axis: usize, value: Expression) -> Components<D> {
    Components(std::array::from_fn(|k| (k == axis).then(|| value.clone())))
}

/// No displacement along the normal of a plane.
pub(super) fn symmetry<const D: usize>(
    name: &Text,
    spec: &SymmetrySpec,
    mesh: &Mesh<D>,
) -> Result<Condition<D>, SceneError> {
    let place = format!("conditions.{name}.symmetry");
    let support = support(&place, name, Some(&spec.on), None, mesh)?;
    let nodes = mesh.nodes_of_set(&spec.on.value).unwrap_or_default();
    let (low, high) = mesh.bounds();
    let tolerance = 1e-9 * (high - low).norm();
    let (from, to) = mesh.bounds_of(&nodes);
    let flat: Vec<usize> = (0..D).filter(|&k| to[k] - from[k] <= tolerance).collect();
    let refuse = |why: String, help: &str| {
        Err(
            SceneError::new(SceneErrorKind::Conflict, format!("`{place}.on`: {why}"))
                .label(spec.on.span.clone(), "whose normal?")
                .help(help),
        )
    };
    match flat[..] {
        [axis] => Ok(Condition {
            name: name.value.clone(),
            prescribed: Prescribed::Displacement(support),
            components: only(axis, Expression::constant(0.0).at(spec.on.span.clone())),
        }),
        [] => refuse(
            format!(
                "the set `{}` reaches from {:?} to {:?}: it is no plane x, y or z = constant",
                spec.on,
                from.as_slice(),
                to.as_slice()
            ),
            "turn the mesh so that its planes of symmetry lie along the axes, or hold the set by stiff [conditions.NAME.spring] with normal = ...",
        ),
        _ => refuse(
            format!(
                "the set `{}` at {:?} has no area: its normal is not known",
                spec.on,
                from.as_slice()
            ),
            "name the set of all facets of the plane, or prescribe a displacement by its components",
        ),
    }
}

/// A rigid rotation, as the displacements `(R(θ) − I)(x − c)` that it is.
pub(super) fn rotation<const D: usize>(
    name: &Text,
    spec: &RotationSpec,
    mesh: &Mesh<D>,
    clock: Clock,
) -> Result<Condition<D>, SceneError> {
    let place = format!("conditions.{name}.rotation");
    if D == 1 {
        return Err(SceneError::new(
            SceneErrorKind::Dimension,
            format!("`{place}` in a scene of dimension 1"),
        )
        .label(name.span.clone(), "a bar does not rotate")
        .help("prescribe a displacement"));
    }
    let at = format!("{place}.angle");
    clock.admits(&at, &spec.angle)?;
    if spec.angle.depends_on_position() {
        return Err(SceneError::new(
            SceneErrorKind::Conflict,
            format!("`{at}` depends on position"),
        )
        .label(spec.angle.span.clone(), "not a rigid rotation")
        .help("let the angle be a number or depend on t only"));
    }
    let centre = position::<D>(&format!("{place}.center"), &spec.center)?;
    let axis = axis::<D>(&place, name, spec)?;
    let components = rotated(&axis, &centre, &spec.angle);
    let support = support(&place, name, spec.on.as_ref(), spec.inside.as_ref(), mesh)?;
    let nodes = mesh.nodes.iter().copied().take(1);
    finite(&place, name, &components, clock, nodes)?;
    Ok(Condition {
        name: name.value.clone(),
        prescribed: Prescribed::Displacement(support),
        components,
    })
}

/// The generator `W` of a rotation: `W r = k × r` with the unit vector k along the axis.
fn axis<const D: usize>(
    place: &str,
    name: &Text,
    spec: &RotationSpec,
) -> Result<Tensor<D>, SceneError> {
    let k = match (&spec.axis, D) {
        (None, 2) => [0.0, 0.0, 1.0],
        (Some(typed), 2) => {
            return Err(SceneError::new(
                SceneErrorKind::Dimension,
                format!("`{place}.axis` in a scene of dimension 2"),
            )
            .label(typed.span.clone(), "the axis of a plane is z")
            .help("remove `axis`"));
        }
        (None, _) => {
            return Err(SceneError::new(
                SceneErrorKind::Missing,
                format!("`{place}` has no `axis`"),
            )
            .label(name.span.clone(), "about which axis?")
            .help("add axis = [0, 0, 1]"));
        }
        (Some(typed), _) => {
            let k = position::<D>(&format!("{place}.axis"), typed)?;
            match k
                .try_normalize(1e-300)
                .filter(|k| k.iter().all(|k| k.is_finite()))
            {
                Some(k) => std::array::from_fn(|i| k[i]),
                None => {
                    return Err(SceneError::new(
                        SceneErrorKind::WrongValue,
                        format!("`{place}.axis` has no direction"),
                    )
                    .label(typed.span.clone(), "zero")
                    .help("write a direction such as [0, 0, 1]"));
                }
            }
        }
    };
    let cross = [[0.0, -k[2], k[1]], [k[2], 0.0, -k[0]], [-k[1], k[0], 0.0]];
    Ok(Tensor::from_fn(|i, j| cross[i][j]))
}

/// The displacements of a rotation by `angle` degrees, exact for any angle: `sin θ W r + 2 sin²(θ/2) W² r`.
///
/// Source: Rodrigues' formula, with `1 − cos θ` written so that small angles lose no digits.
fn rotated<const D: usize>(
    generator: &Tensor<D>,
    centre: &Vector<D>,
    angle: &Expression,
) -> Components<D> {
    let square = generator * generator;
    let of_radians = |factor: &str| format!("sin(({})*pi/{factor})", angle.text);
    let row = |matrix: &Tensor<D>, i: usize| {
        let term = |j: usize| format!("({:?})*({}-({:?}))", matrix[(i, j)], AXES[j], centre[j]);
        let used = (0..D).filter(|&j| matrix[(i, j)] != 0.0).map(term);
        let terms: Vec<String> = used.collect();
        match terms.is_empty() {
            true => "0".to_owned(),
            false => terms.join("+"),
        }
    };
    let component = |i: usize| {
        let text = format!(
            "{}*({})+2*{}^2*({})",
            of_radians("180"),
            row(generator, i),
            of_radians("360"),
            row(&square, i)
        );
        // made of an expression that has been read
        let read = Expression::parse_with(&text, angle.tables())
            .unwrap_or_else(|_| Expression::constant(f64::NAN));
        read.at(angle.span.clone())
    };
    Components(std::array::from_fn(|i| Some(component(i))))
}
