//! Conditions of a validated scene.

use std::cell::{Cell, RefCell};
use std::sync::Arc;

use super::bounds_checks;
use super::error::{SceneError, SceneErrorKind};
use super::expression::Expression;
use super::region::{Region, region, unknown_set};
use super::solve::Clock;
use super::spec::ShapeSpec;
use super::value::Text;
use crate::mesh::boundary::BoundaryFacet;
use crate::mesh::{Facet, Mesh};
use crate::tensor::{Vector, padded};

/// A vector field, component by component; components left out are free or zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Components<const D: usize>(pub [Option<Expression>; D]);

impl PartialEq for Expression {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text && self.function() == other.function()
    }
}

impl<const D: usize> Components<D> {
    /// The component along `axis` at `x`, if it is given.
    pub fn at(&self, axis: usize, x: &Vector<D>) -> Option<f64> {
        self.0[axis].as_ref().map(|e| e.eval(&padded(x)))
    }

    /// The component along `axis` at `x` and time `t`, if it is given.
    pub fn at_time(&self, axis: usize, x: &Vector<D>, t: f64) -> Option<f64> {
        self.0[axis].as_ref().map(|e| e.eval_at(&padded(x), t))
    }

    /// The vector at `x` and time `t`, zero where nothing is given.
    pub fn vector(&self, x: &Vector<D>, t: f64) -> Vector<D> {
        Vector::from_fn(|k, _| self.at_time(k, x, t).unwrap_or(0.0))
    }

    /// The component along `axis` at some places and the time `t`, if it is given.
    pub fn values(&self, axis: usize, places: &[Vector<D>], t: f64) -> Option<Vec<f64>> {
        let places: Vec<[f64; 3]> = places.iter().map(padded).collect();
        Some(self.0[axis].as_ref()?.values_at(&places, t))
    }

    /// Hands the field at the time `t` to `pass`, which asks for its values in the same order whenever it is called.
    ///
    /// Functions are asked for all of them at once: `pass` is then called twice, first with a field of zeros.
    pub fn visit<T>(
        &self,
        t: f64,
        mut pass: impl FnMut(&dyn Fn(&Vector<D>) -> Vector<D>) -> T,
    ) -> T {
        if !self.0.iter().flatten().any(|e| e.function().is_some()) {
            return pass(&|x| self.vector(x, t));
        }
        let places = RefCell::new(Vec::new());
        pass(&|x| {
            places.borrow_mut().push(*x);
            Vector::zeros()
        });
        let places = places.into_inner();
        let values: [_; D] = std::array::from_fn(|k| self.values(k, &places, t));
        let next = Cell::new(0..places.len());
        pass(&|x| {
            let mut rest = next.take();
            let at = rest.next().filter(|&i| places[i] == *x);
            next.set(rest);
            Vector::from_fn(|k, _| match (&values[k], at) {
                (Some(values), Some(i)) => values[i],
                (Some(_), None) => self.at_time(k, x, t).unwrap_or(0.0),
                (None, _) => 0.0,
            })
        })
    }

    /// Whether any component changes with time.
    pub fn depends_on_time(&self) -> bool {
        self.0.iter().flatten().any(Expression::depends_on_time)
    }

    /// Whether any component changes in space.
    pub fn depends_on_position(&self) -> bool {
        self.0.iter().flatten().any(Expression::depends_on_position)
    }
}

/// Where a displacement is prescribed.
#[derive(Clone, Debug, PartialEq)]
pub enum Support<const D: usize> {
    /// On a named set of the mesh: its nodes, and the facets among them if it is a set of facets.
    Set {
        /// Its name.
        name: String,
        /// Its nodes.
        nodes: Vec<u32>,
        /// Its facets.
        facets: Vec<Facet>,
    },
    /// At all sites inside a region.
    Inside(Region<D>),
}

/// A displacement given by a function: another solution, say. A program sets it; a scene file has expressions.
#[derive(Clone)]
pub struct Field<const D: usize>(FieldFunction<D>);

type FieldFunction<const D: usize> = Arc<dyn Fn(&Vector<D>) -> Option<Vector<D>> + Send + Sync>;

impl<const D: usize> Field<D> {
    /// Prescribes `function(x)` at every site where it has a value.
    pub fn new(function: impl Fn(&Vector<D>) -> Option<Vector<D>> + Send + Sync + 'static) -> Self {
        Self(Arc::new(function))
    }

    /// The displacement at `x`, if it is prescribed there.
    pub fn at(&self, x: &Vector<D>) -> Option<Vector<D>> {
        (self.0)(x)
    }
}

impl<const D: usize> std::fmt::Debug for Field<D> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Field")
    }
}

impl<const D: usize> PartialEq for Field<D> {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// What is prescribed.
#[derive(Clone, Debug, PartialEq)]
pub enum Prescribed<const D: usize> {
    /// Displacement.
    Displacement(Support<D>),
    /// Velocity, in a scene that moves; the displacement begins with the one at time zero.
    Velocity(Support<D>),
    /// Displacement as a function of position; the components of the condition are not used.
    Field(Field<D>),
    /// Force per area on facets.
    Traction(Vec<Facet>),
    /// Pressure on facets at the boundary of the mesh, their normals outwards; the first component is its value.
    Pressure(Vec<BoundaryFacet>),
    /// Force per volume inside a region.
    BodyForce(Region<D>),
    /// Springs to the ground; the components of the condition are not used.
    Spring(Bedding<D>),
}

/// What springs hold, and how stiff they are.
#[derive(Clone, Debug, PartialEq)]
pub enum Bedding<const D: usize> {
    /// Facets.
    Axes {
        /// The facets.
        facets: Vec<Facet>,
        /// Force per area and displacement along each axis \[N/m³\].
        stiffness: Vector<D>,
    },
    /// Facets at the boundary of the mesh, along their normals.
    Normal {
        /// The facets.
        facets: Vec<BoundaryFacet>,
        /// Force per area and displacement \[N/m³\].
        stiffness: f64,
    },
    /// Cells whose centroid lies in a region.
    Inside {
        /// The region.
        region: Region<D>,
        /// Force per volume and displacement along each axis \[N/m⁴\].
        stiffness: Vector<D>,
    },
}

impl<const D: usize> Condition<D> {
    /// The sites that the condition holds, if it prescribes how they move.
    pub fn support(&self) -> Option<&Support<D>> {
        match &self.prescribed {
            Prescribed::Displacement(support) | Prescribed::Velocity(support) => Some(support),
            _ => None,
        }
    }

    /// The force per area or volume of a load at `x` with the outward unit normal `n`, at time `t`: `−p n` of a pressure.
    pub fn force_density(&self, x: &Vector<D>, n: &Vector<D>, t: f64) -> Vector<D> {
        match self.prescribed {
            Prescribed::Pressure(_) => n * -self.components.at_time(0, x, t).unwrap_or(0.0),
            _ => self.components.vector(x, t),
        }
    }

    /// The force per area or volume of a unit of one component, where the outward unit normal is `n`.
    pub fn unit_density(&self, component: usize, n: &Vector<D>) -> Vector<D> {
        match self.prescribed {
            Prescribed::Pressure(_) if component == 0 => -n,
            Prescribed::Pressure(_) => Vector::zeros(),
            _ => Vector::from_fn(|k, _| f64::from(u8::from(k == component))),
        }
    }

    /// Hands the force per area or volume at the time `t`, as [`Condition::force_density`] has it, to `pass`: as [`Components::visit`].
    pub fn visit<T>(
        &self,
        t: f64,
        mut pass: impl FnMut(&dyn Fn(&Vector<D>, &Vector<D>) -> Vector<D>) -> T,
    ) -> T {
        let components = &self.components;
        components.visit(t, |field| match self.prescribed {
            Prescribed::Pressure(_) => pass(&|x, n| n * -field(x)[0]),
            _ => pass(&|x, _| field(x)),
        })
    }

    /// Whether the force of a load differs from place to place.
    pub fn varies_in_space(&self) -> bool {
        matches!(self.prescribed, Prescribed::Pressure(_)) || self.components.depends_on_position()
    }

    /// Whether the condition prescribes how sites move.
    pub fn holds(&self) -> bool {
        self.support().is_some() || matches!(self.prescribed, Prescribed::Field(_))
    }

    /// A displacement given by a function.
    pub fn field(name: &str, field: Field<D>) -> Self {
        Self {
            name: name.to_owned(),
            prescribed: Prescribed::Field(field),
            components: Components(std::array::from_fn(|_| None)),
        }
    }
}

/// A condition of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition<const D: usize> {
    /// Its name.
    pub name: String,
    /// What and where.
    pub prescribed: Prescribed<D>,
    /// How much.
    pub components: Components<D>,
}

/// Where a condition holds: a set of the mesh, or a shape.
pub(super) fn support<const D: usize>(
    place: &str,
    name: &Text,
    on: Option<&Text>,
    inside: Option<&ShapeSpec>,
    mesh: &Mesh<D>,
) -> Result<Support<D>, SceneError> {
    Ok(match (on, inside) {
        (Some(set), None) => {
            let at = format!("{place}.on");
            let known = mesh.set_names();
            let Some(nodes) = mesh.nodes_of_set(&set.value) else {
                return Err(unknown_set(&at, set, "set", &known, mesh));
            };
            not_empty(&at, set, nodes.len())?;
            Support::Set {
                name: set.value.clone(),
                nodes,
                facets: mesh.facet_sets.get(&set.value).cloned().unwrap_or_default(),
            }
        }
        (None, Some(shape)) => Support::Inside(self::inside(place, name, shape, mesh)?),
        (both, _) => {
            let (what, label) = match both {
                Some(_) => ("both `on` and `inside`", "two places"),
                None => ("neither `on` nor `inside`", "where?"),
            };
            return Err(
                SceneError::new(SceneErrorKind::Choice, format!("`{place}` has {what}"))
                    .label(name.span.clone(), label)
                    .help("keep one: `on = \"set\"` of the mesh, or `inside = { box = ... }`"),
            );
        }
    })
}

pub(crate) fn components<const D: usize>(
    place: &str,
    name: &Text,
    given: [&Option<Expression>; 3],
) -> Result<Components<D>, SceneError> {
    let axes = ["x", "y", "z"];
    if let Some((k, e)) = (D..3).find_map(|k| given[k].as_ref().map(|e| (k, e))) {
        return Err(SceneError::new(
            SceneErrorKind::Dimension,
            format!("`{place}.{}` in a scene of dimension {D}", axes[k]),
        )
        .label(e.span.clone(), "no such axis")
        .help(format!("remove `{}`", axes[k])));
    }
    for (axis, expression) in axes.iter().zip(given) {
        if let Some(e) = expression {
            bounds_checks::no_further_axes::<D>(&format!("{place}.{axis}"), e)?;
        }
    }
    if given.iter().all(|e| e.is_none()) {
        return Err(SceneError::new(
            SceneErrorKind::Missing,
            format!("`{place}` prescribes no component"),
        )
        .label(name.span.clone(), "nothing prescribed")
        .help(format!(
            "add {}",
            ["x = 0", "x = 0 or y = 0", "x = 0, y = 0 or z = 0"][D - 1]
        )));
    }
    Ok(Components(std::array::from_fn(|k| given[k].clone())))
}

pub(crate) fn inside<const D: usize>(
    place: &str,
    name: &Text,
    shape: &ShapeSpec,
    mesh: &Mesh<D>,
) -> Result<Region<D>, SceneError> {
    if let ShapeSpec::Set(set) = shape {
        return Err(SceneError::new(
            SceneErrorKind::Conflict,
            format!("`{place}.inside` is the set `{set}`"),
        )
        .label(set.span.clone(), "no shape")
        .help("name a set by `on`, or give a shape such as `box`"));
    }
    let found = region(&format!("{place}.inside"), shape, mesh)?;
    let tolerance = 1e-9 * (mesh.bounds().1 - mesh.bounds().0).norm();
    let holds_something = mesh.nodes.iter().any(|x| found.contains(x, tolerance))
        || (0..mesh.cell_count()).any(|c| found.contains(&mesh.centroid(c), tolerance));
    if holds_something {
        return Ok(found);
    }
    Err(SceneError::new(
        SceneErrorKind::Empty,
        format!("`{place}.inside` holds no part of the mesh"),
    )
    .label(name.span.clone(), "acts nowhere")
    .help(extent(mesh)))
}

/// The extent of a mesh, as a remedy for what misses it.
pub(crate) fn extent<const D: usize>(mesh: &Mesh<D>) -> String {
    let (lo, hi) = mesh.bounds();
    format!(
        "the mesh reaches from {:?} to {:?}",
        lo.as_slice(),
        hi.as_slice()
    )
}

/// The facets of a named set, of which there are some.
pub(super) fn facet_set<'m, const D: usize>(
    place: &str,
    on: &Text,
    mesh: &'m Mesh<D>,
) -> Result<&'m [Facet], SceneError> {
    let place = format!("{place}.on");
    let Some(facets) = mesh.facet_sets.get(&on.value) else {
        let known: Vec<&str> = mesh.facet_sets.keys().map(String::as_str).collect();
        let wanted = ["set of end points", "set of edges", "set of faces"][D - 1];
        return Err(unknown_set(&place, on, wanted, &known, mesh));
    };
    not_empty(&place, on, facets.len())?;
    Ok(facets)
}

fn not_empty(place: &str, set: &Text, count: usize) -> Result<(), SceneError> {
    if count > 0 {
        return Ok(());
    }
    Err(SceneError::new(
        SceneErrorKind::Empty,
        format!("`{place}`: the set `{set}` of the mesh is empty"),
    )
    .label(set.span.clone(), "empty")
    .help("put facets or nodes into it, or name another set"))
}

pub(crate) fn finite<const D: usize>(
    place: &str,
    name: &Text,
    components: &Components<D>,
    clock: Clock,
    positions: impl Iterator<Item = Vector<D>>,
) -> Result<(), SceneError> {
    let moving = components.depends_on_time();
    let instants = clock.instants(moving);
    let all: Vec<Vector<D>> = positions.collect();
    for positions in all.chunks(TOGETHER) {
        let of_instant = |&t: &f64| -> [Option<Vec<f64>>; D] {
            std::array::from_fn(|k| components.values(k, positions, t))
        };
        let values: Vec<_> = instants.iter().map(of_instant).collect();
        for (i, x) in positions.iter().enumerate() {
            for (t, values) in instants.iter().zip(&values) {
                for k in 0..D {
                    let value = values[k].as_ref().map_or(0.0, |v| v[i]);
                    if value.is_finite() {
                        continue;
                    }
                    let span = components.0[k]
                        .as_ref()
                        .map_or(name.span.clone(), |e| e.span.clone());
                    let when = match moving {
                        true => format!(", t = {t}"),
                        false => String::new(),
                    };
                    return Err(SceneError::new(
                        SceneErrorKind::WrongValue,
                        format!(
                            "`{place}.{}` is {value} at {:?}{when}",
                            ["x", "y", "z"][k],
                            x.as_slice()
                        ),
                    )
                    .label(span, "no finite number there")
                    .help(
                        "choose between branches with if(condition, a, b), or restrict the condition",
                    ));
                }
            }
        }
    }
    Ok(())
}

/// Positions whose values are looked at together.
const TOGETHER: usize = 4096;
