//! Shapes and regions of a validated scene.

use super::error::{SceneError, SceneErrorKind, quoted};
use super::source::Span;
use super::spec::{BoxSpec, NearSpec, SegmentSpec, ShapeSpec};
use super::value::{Coordinates, Text};
use crate::mesh::Mesh;
use crate::shape::Shape;
use crate::tensor::Vector;

/// A region that selects cells: a shape, perhaps grown by a margin, a named set, or a combination.
#[derive(Clone, Debug, PartialEq)]
pub enum Region<const D: usize> {
    /// All points within `margin` of a shape.
    Shape {
        /// The shape.
        shape: Shape<D>,
        /// Distance by which the shape is extended.
        margin: f64,
    },
    /// Cells of a named set.
    Cells(Vec<u32>),
    /// Any of several regions.
    Union(Vec<Region<D>>),
    /// The first without the second.
    Without(Box<[Region<D>; 2]>),
}

impl<const D: usize> Region<D> {
    /// A region that is the whole space.
    pub fn everywhere() -> Self {
        Self::Shape {
            shape: Shape::Everywhere,
            margin: 0.0,
        }
    }

    /// The cells whose centroid lies in the region; one entry per cell.
    pub fn select(&self, mesh: &Mesh<D>) -> Vec<bool> {
        match self {
            Self::Shape { shape, margin } => (0..mesh.cell_count())
                .map(|c| shape.signed_distance(&mesh.centroid(c)) <= *margin)
                .collect(),
            Self::Cells(cells) => {
                let mut selected = vec![false; mesh.cell_count()];
                cells.iter().for_each(|&c| selected[c as usize] = true);
                selected
            }
            Self::Union(members) => members
                .iter()
                .map(|m| m.select(mesh))
                .reduce(|a, b| a.iter().zip(b).map(|(a, b)| *a || b).collect())
                .unwrap_or_else(|| vec![false; mesh.cell_count()]),
            Self::Without(both) => {
                let removed = both[1].select(mesh);
                let mut selected = both[0].select(mesh);
                selected.iter_mut().zip(removed).for_each(|(s, r)| *s &= !r);
                selected
            }
        }
    }

    /// The cells whose centroid the region holds; one entry per cell.
    pub fn select_cells(&self, mesh: &Mesh<D>) -> Vec<bool> {
        (0..mesh.cell_count())
            .map(|c| self.contains(&mesh.centroid(c), 0.0))
            .collect()
    }

    /// The nodes in the region, those of the cells of a set among them; one entry per node.
    pub fn select_nodes(&self, mesh: &Mesh<D>) -> Vec<bool> {
        match self {
            Self::Cells(cells) => {
                let mut selected = vec![false; mesh.nodes.len()];
                let nodes = cells.iter().flat_map(|&c| mesh.cell(c as usize));
                nodes.for_each(|&n| selected[n as usize] = true);
                selected
            }
            _ => self.combined(
                mesh.nodes.len(),
                |n| mesh.nodes[n],
                |member| member.select_nodes(mesh),
            ),
        }
    }

    /// The places `of` so many numbers in a shape, or in a combination of regions of which `select` gives the places of each; none in a set.
    pub(crate) fn combined(
        &self,
        count: usize,
        of: impl Fn(usize) -> Vector<D>,
        select: impl Fn(&Self) -> Vec<bool>,
    ) -> Vec<bool> {
        let each = |all: &mut Vec<bool>, more: Vec<bool>, join: fn(bool, bool) -> bool| {
            let pairs = all.iter_mut().zip(more);
            pairs.for_each(|(own, other)| *own = join(*own, other));
        };
        let mut all = vec![false; count];
        match self {
            Self::Shape { .. } => (0..count).map(|k| self.contains(&of(k), 0.0)).collect(),
            Self::Cells(_) => all,
            Self::Union(members) => {
                for member in members {
                    each(&mut all, select(member), |a, b| a || b);
                }
                all
            }
            Self::Without(both) => {
                all = select(&both[0]);
                each(&mut all, select(&both[1]), |a, b| a && !b);
                all
            }
        }
    }

    /// Returns true if a position lies in the region, by shapes alone; cells of a set hold none.
    pub fn contains(&self, x: &Vector<D>, tolerance: f64) -> bool {
        match self {
            Self::Shape { shape, margin } => shape.contains(x, margin + tolerance),
            Self::Cells(_) => false,
            Self::Union(members) => members.iter().any(|m| m.contains(x, tolerance)),
            Self::Without(both) => {
                both[0].contains(x, tolerance) && !both[1].contains(x, -tolerance)
            }
        }
    }

    /// Returns the distance of `x` from the region, negative inside, if it is made of shapes.
    pub fn distance(&self, x: &Vector<D>) -> Option<f64> {
        match self {
            Self::Shape { shape, margin } => Some(shape.signed_distance(x) - margin),
            Self::Cells(_) => None,
            Self::Union(members) => members
                .iter()
                .map(|m| m.distance(x))
                .try_fold(f64::INFINITY, |a, b| Some(a.min(b?))),
            Self::Without(both) => Some(both[0].distance(x)?.max(-both[1].distance(x)?)),
        }
    }
}

/// A position of `D` coordinates.
pub(crate) fn position<const D: usize>(
    place: &str,
    typed: &Coordinates,
) -> Result<Vector<D>, SceneError> {
    if typed.values.len() == D {
        return Ok(Vector::from_column_slice(&typed.values));
    }
    let example = ["0.1", "[0.1, 0.2]", "[0.1, 0.2, 0.3]"][D - 1];
    Err(SceneError::dimension(format!(
        "`{place}` has {} coordinate{} in a scene of dimension {D}",
        typed.values.len(),
        if typed.values.len() == 1 { "" } else { "s" }
    ))
    .label(typed.span.clone(), format!("{D} expected"))
    .help(format!(
        "write {D} coordinates such as {example}, or change `kinematics`"
    )))
}

/// The corners of a box that has an extent along every axis.
pub(crate) fn corners<const D: usize>(
    place: &str,
    min: &Coordinates,
    max: &Coordinates,
) -> Result<(Vector<D>, Vector<D>), SceneError> {
    let (lo, hi) = (
        position::<D>(&format!("{place}.min"), min)?,
        position::<D>(&format!("{place}.max"), max)?,
    );
    match (0..D).find(|&k| lo[k] >= hi[k]) {
        None => Ok((lo, hi)),
        Some(k) => Err(SceneError::wrong_value(format!(
            "`{place}` runs from {} to {} along {}",
            lo[k],
            hi[k],
            ["x", "y", "z"][k]
        ))
        .label(max.span.clone(), "not larger than min")
        .label(min.span.clone(), "min")
        .help("make every coordinate of max larger than that of min")),
    }
}

fn path<const D: usize>(
    place: &str,
    points: &[Coordinates],
    least: usize,
) -> Result<Vec<Vector<D>>, SceneError> {
    let found: Vec<Vector<D>> = points
        .iter()
        .map(|p| position(place, p))
        .collect::<Result<_, _>>()?;
    if found.len() >= least {
        return Ok(found);
    }
    let error = SceneError::wrong_value(format!("`{place}` has {} points", found.len()))
        .help(format!("give at least {least} points, [[x, y], ...]"));
    Err(match points.first() {
        Some(p) => error.label(p.span.clone(), "too few"),
        None => error,
    })
}

fn segment<const D: usize>(place: &str, s: &SegmentSpec) -> Result<Shape<D>, SceneError> {
    let a = position(&format!("{place}.from"), &s.from)?;
    let b = position(&format!("{place}.to"), &s.to)?;
    if a == b {
        return Err(SceneError::wrong_value(format!("`{place}` has no length"))
            .label(s.to.span.clone(), "the same as `from`")
            .help("move one of its ends, or use `point`"));
    }
    Ok(Shape::Segment { a, b })
}

fn cuboid<const D: usize>(place: &str, b: &BoxSpec) -> Result<Shape<D>, SceneError> {
    let (min, max) = corners(place, &b.min, &b.max)?;
    Ok(Shape::Box { min, max })
}

fn near<const D: usize>(place: &str, n: &NearSpec) -> Result<Region<D>, SceneError> {
    let within = super::bounds_checks::not_negative(&format!("{place}.within"), &n.within)?;
    let mut shapes: Vec<(&str, Shape<D>)> = Vec::new();
    if let Some(p) = &n.point {
        let a = position(&format!("{place}.point"), p)?;
        shapes.push(("point", Shape::Segment { a, b: a }));
    }
    if let Some(s) = &n.segment {
        shapes.push(("segment", segment(&format!("{place}.segment"), s)?));
    }
    if let Some(p) = &n.polyline {
        let points = path(&format!("{place}.polyline"), p, 2)?;
        shapes.push(("polyline", Shape::Polyline(points)));
    }
    if let Some(p) = &n.polygon {
        let points = path(&format!("{place}.polygon"), p, 3)?;
        shapes.push(("polygon", Shape::Polygon(points)));
    }
    if let Some(b) = &n.cuboid {
        shapes.push(("box", cuboid(&format!("{place}.box"), b)?));
    }
    let names: Vec<&str> = shapes.iter().map(|(n, _)| *n).collect();
    match shapes.pop() {
        Some((_, shape)) if shapes.is_empty() => Ok(Region::Shape {
            shape,
            margin: within,
        }),
        _ => Err(SceneError::choice(match names.as_slice() {
            [] => format!("`{place}` names no shape"),
            _ => format!("`{place}` names {} at once", quoted(&names)),
        })
        .label(n.within.span.clone(), "within what?")
        .help(
            "beside `within`, give exactly one of `point`, `segment`, `polyline`, `polygon`, `box`",
        )),
    }
}

/// The region that a shape of the scene selects.
pub(crate) fn region<const D: usize>(
    place: &str,
    spec: &ShapeSpec,
    mesh: &Mesh<D>,
) -> Result<Region<D>, SceneError> {
    let plain = |shape| Region::Shape { shape, margin: 0.0 };
    Ok(match spec {
        ShapeSpec::Box(b) => plain(cuboid(&format!("{place}.box"), b)?),
        ShapeSpec::Ball(b) => plain(Shape::Ball {
            center: position(&format!("{place}.ball.center"), &b.center)?,
            radius: super::bounds_checks::positive(&format!("{place}.ball.radius"), &b.radius)?,
        }),
        ShapeSpec::Point(p) => {
            let a = position(&format!("{place}.point"), p)?;
            plain(Shape::Segment { a, b: a })
        }
        ShapeSpec::Segment(s) => plain(segment(&format!("{place}.segment"), s)?),
        ShapeSpec::Polyline(p) => plain(Shape::Polyline(path(&format!("{place}.polyline"), p, 2)?)),
        ShapeSpec::Polygon(p) => plain(Shape::Polygon(path(&format!("{place}.polygon"), p, 3)?)),
        ShapeSpec::Near(n) => near(&format!("{place}.near"), n)?,
        ShapeSpec::Set(name) => Region::Cells(cells_of_set(place, name, mesh)?),
        ShapeSpec::Everywhere(true) => plain(Shape::Everywhere),
        ShapeSpec::Everywhere(false) => plain(Shape::Union(Vec::new())),
        ShapeSpec::Any(members) => Region::Union(
            members
                .iter()
                .enumerate()
                .map(|(i, m)| region(&format!("{place}.any.{}", i + 1), m, mesh))
                .collect::<Result<_, _>>()?,
        ),
        ShapeSpec::Without(w) => Region::Without(Box::new([
            region(&format!("{place}.without.from"), &w.from, mesh)?,
            region(&format!("{place}.without.removed"), &w.removed, mesh)?,
        ])),
    })
}

/// The shape of a region that must not depend on sets, such as a void.
pub(crate) fn shape<const D: usize>(
    place: &str,
    spec: &ShapeSpec,
    mesh: &Mesh<D>,
    span: &Span,
) -> Result<Shape<D>, SceneError> {
    match region(place, spec, mesh)? {
        Region::Shape { shape, margin: 0.0 } => Ok(shape),
        _ => Err(
            SceneError::conflict(format!("`{place}` must be one plain shape"))
                .label(span.clone(), "no plain shape")
                .help(
                    "use `box`, `ball` or `polygon`; a set of cells is left out of the mesh itself",
                ),
        ),
    }
}

/// The cells of a named set.
pub(crate) fn cells_of_set<const D: usize>(
    place: &str,
    name: &Text,
    mesh: &Mesh<D>,
) -> Result<Vec<u32>, SceneError> {
    if let Some(cells) = mesh.cell_sets.get(&name.value) {
        return Ok(cells.clone());
    }
    let known: Vec<&str> = mesh.cell_sets.keys().map(String::as_str).collect();
    Err(unknown_set(place, name, "set of cells", &known, mesh))
}

/// The error for a set that the mesh lacks, or that is of another sort.
pub(crate) fn unknown_set<const D: usize>(
    place: &str,
    name: &Text,
    wanted: &str,
    known: &[&str],
    mesh: &Mesh<D>,
) -> SceneError {
    let all = mesh.set_names();
    let message = if all.contains(&name.value.as_str()) {
        format!("`{place}`: the set `{name}` of the mesh is no {wanted}")
    } else {
        format!("`{place}`: the mesh has no set `{name}`")
    };
    let list = if known.is_empty() {
        format!(
            "the mesh has no {wanted}; name one, in Gmsh as a physical group, in a deck by *SURFACE of elements"
        )
    } else {
        format!("it has the {wanted} {}", quoted(known))
    };
    SceneError::new(SceneErrorKind::UnknownSet, message)
        .label(name.span.clone(), format!("no {wanted}"))
        .help(
            match super::error::closest(&name.value, known.iter().copied()) {
                Some(near) => format!("did you mean `{near}`? {list}"),
                // what the reader left out may have been it
                None => [list]
                    .into_iter()
                    .chain(mesh.notes.clone())
                    .collect::<Vec<_>>()
                    .join("; "),
            },
        )
}
