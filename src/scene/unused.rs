//! Parts of a scene that touch nothing: a void without points, a crack that cuts no bond, a region in which no point lies.
//!
//! A shape beside the body is no mistake of the format, and nothing else tells of it: the run goes on as if it had not been typed. So each is warned of
//! by its name. Points are taken where the lattice or the cells of the zone have them, and the search ends with the first that is touched.

use super::material_interfaces;
use super::peridynamics::Peridynamics;
use super::region::Region;
use super::spec::{SceneSpec, ZonesNeeded};
use super::validated::Scene;
use crate::mesh::Mesh;
use crate::model::{PointSource, Zone};
use crate::observe::report::number;
use crate::shape::Barrier;
use crate::tensor::Vector;

/// Points that are tested for one shape, at most: a shape among more of them touches some.
const LOOKED_AT: usize = 4_000_000;

/// Points beside a crack whose bonds are tried, at most.
const BESIDE: usize = 2000;

/// A scene as it is typed, and as it is laid out.
pub(crate) struct Parts<'a, const D: usize> {
    pub spec: &'a SceneSpec,
    pub scene: &'a Scene<D>,
}

impl<const D: usize> Parts<'_, D> {
    /// A warning for each part that touches nothing.
    pub fn unused(&self) -> Vec<String> {
        let (mut list, traits) = (Vec::new(), self.scene.coupling.traits());
        let has_points = (0..self.scene.mesh.cell_count()).any(|c| self.holds(c));
        if !has_points {
            list.extend(self.without_points());
        }
        if self.spec.zones.transition.is_some() && matches!(traits.zones, ZonesNeeded::Nonlocal) {
            list.push(format!(
                "`zones.transition` is not used: coupling `{}` has no transition zone, and its cells are elements",
                traits.name
            ));
        }
        let (materials, used) = (&self.scene.materials, &self.scene.point_materials);
        list.extend(material_interfaces::unused(
            &self.spec.interfaces,
            materials,
            used,
        ));
        let Some(p) = &self.scene.peridynamics else {
            return list;
        };
        if !matches!(traits.zones, ZonesNeeded::Everywhere(_)) {
            list.extend(self.narrow(p));
            list.extend(self.beyond());
        }
        for ((name, typed), shape) in self.spec.voids.iter().zip(&self.scene.voids) {
            if self.any(p, |x| shape.signed_distance(x) < 0.0) {
                continue;
            }
            let cuts = typed.cut_bonds && self.cuts(p, &Barrier::Void(shape.clone()));
            list.push(if cuts {
                format!("the void `{name}` holds no point: it cuts bonds, and its volume stays in the body")
            } else {
                format!("the void `{name}` holds no point and cuts no bond: it does nothing")
            });
        }
        for (name, typed) in &self.spec.cracks {
            let place = format!("cracks.{name}");
            let Ok(shape) = super::region::shape(&place, typed, &self.scene.mesh, &name.span)
            else {
                continue;
            };
            if !self.cuts(p, &Barrier::Crack(shape)) {
                list.push(format!(
                    "the crack `{name}` cuts no bond: it does nothing; it lies between points, or is shorter than their spacing"
                ));
            }
        }
        for (name, region) in self.spec.no_fail.keys().zip(&self.scene.breaking.no_fail) {
            if has_points && !self.touches(p, region) {
                list.push(format!(
                    "the region `no-fail.{name}` holds no point: it does nothing"
                ));
            }
        }
        for tip in &self.scene.output.tips {
            if !self.touches(p, &tip.inside) {
                list.push(format!(
                    "`output.tips.{}` looks where no point lies: it finds no tip",
                    tip.name
                ));
            }
        }
        list
    }

    /// Lists the parts of the scene that a body of finite elements alone does not use.
    fn without_points(&self) -> Vec<String> {
        let mut list = Vec::new();
        for (name, material) in &self.spec.materials {
            if let Some((criterion, _)) = material.failure().first() {
                list.push(format!(
                    "`{}` of the material `{name}` is not used: the body is all finite elements, and they do not break",
                    criterion.key()
                ));
            }
        }
        let regions = self.spec.no_fail.keys();
        list.extend(regions.map(|name| {
            format!("the region `no-fail.{name}` is not used: it keeps bonds and the damage of points, and the body is all finite elements")
        }));
        list
    }

    /// A zone through which every bond reaches into the elements, in a scene in which something may fail: a crack there has no room, while what stays whole is right in any width.
    fn narrow(&self, p: &Peridynamics<D>) -> Option<String> {
        let mut materials = self.spec.materials.values();
        if materials.all(|material| material.failure().is_empty()) {
            return None;
        }
        let mesh = &self.scene.mesh;
        let cells: Vec<usize> = (0..mesh.cell_count())
            .filter(|&c| self.scene.zones[c] == Zone::Nonlocal)
            .collect();
        let nodes: Vec<u32> = (cells.iter())
            .flat_map(|&c| mesh.cell(c).iter().copied())
            .collect();
        let ((low, high), (least, most)) = (mesh.bounds_of(&nodes), mesh.bounds());
        let horizon = cells
            .iter()
            .map(|&c| p.horizon_at(&mesh.centroid(c)))
            .fold(0.0, f64::max);
        // a body that is as thin itself has no seam on that side
        let width = (0..D)
            .filter(|&a| high[a] - low[a] < (most[a] - least[a]) * (1.0 - 1e-9))
            .map(|a| high[a] - low[a])
            .fold(f64::INFINITY, f64::min);
        (width < horizon * (1.0 - 1e-9)).then(|| {
            format!(
                "the nonlocal zone is {} wide, narrower than a horizon of {}: no family lies within it; enlarge [zones.nonlocal], or use a smaller horizon",
                number(width),
                number(horizon)
            )
        })
    }

    /// A zone that is drawn for the most part where the body is not; one that is drawn through all of it is meant so.
    fn beyond(&self) -> Option<String> {
        let typed = self.spec.zones.nonlocal.as_ref()?;
        let region = super::region::region("zones.nonlocal", typed.get_ref(), &self.scene.mesh);
        let Ok(Region::Shape { shape, margin }) = region else {
            return None;
        };
        let (low, high) = shape.bounds();
        let (least, most) = body_bounds(&self.scene.mesh);
        let a = (0..D).find(|&a| {
            let drawn = high[a] - low[a] + 2.0 * margin;
            let (from, to) = (
                (low[a] - margin).max(least[a]),
                (high[a] + margin).min(most[a]),
            );
            let is_through = to - from >= (most[a] - least[a]) * (1.0 - 1e-9);
            drawn.is_finite() && !is_through && to - from < 0.5 * drawn
        })?;
        Some(format!(
            "`zones.nonlocal` reaches beyond the mesh: from {} to {} along {}, where the body reaches from {} to {}",
            number(low[a] - margin),
            number(high[a] + margin),
            ["x", "y", "z"][a],
            number(least[a]),
            number(most[a])
        ))
    }

    /// Returns true if a cell holds points, or may come to hold them where the zone follows a crack.
    fn holds(&self, c: usize) -> bool {
        self.scene.zones[c] != Zone::Local || self.scene.follow.is_some()
    }

    fn touches(&self, p: &Peridynamics<D>, region: &Region<D>) -> bool {
        self.any(p, |x| region.contains(x, 0.0))
            // sets hold cells, not places
            || region
                .select(&self.scene.mesh)
                .iter()
                .enumerate()
                .any(|(c, inside)| *inside && self.holds(c))
    }

    /// Returns true if any point is `wanted`.
    fn any(&self, p: &Peridynamics<D>, mut wanted: impl FnMut(&Vector<D>) -> bool) -> bool {
        let mut looked_at = 0;
        for c in (0..self.scene.mesh.cell_count()).filter(|&c| self.holds(c)) {
            let (spacing, origin) = match &p.points {
                PointSource::Cells => {
                    if wanted(&self.scene.mesh.centroid(c)) {
                        return true;
                    }
                    continue;
                }
                PointSource::Lattice { spacing, origin } => (*spacing, *origin),
                PointSource::Lattices { lattices, of_cell } => {
                    let own = &lattices[usize::from(of_cell[c])];
                    (own.spacing, own.origin)
                }
            };
            // the box of a cell: a point of it that lies beside the cell belongs to a neighbour
            let (low, high) = self.scene.mesh.bounds_of(self.scene.mesh.cell(c));
            let first: Vector<D> = ((low - origin) / spacing).map(|k| (k - 1e-9).ceil());
            let last: Vector<D> = ((high - origin) / spacing).map(|k| (k + 1e-9).floor());
            let counts: [usize; D] =
                std::array::from_fn(|a| (last[a] - first[a] + 1.0).max(0.0) as usize);
            let total: usize = counts.iter().product();
            for index in 0..total {
                let mut rest = index;
                let place = Vector::<D>::from_fn(|a, _| {
                    let k = rest % counts[a];
                    rest /= counts[a];
                    first[a] + k as f64
                });
                if wanted(&(origin + place * spacing)) {
                    return true;
                }
            }
            looked_at += total;
            if looked_at > LOOKED_AT {
                return true;
            }
        }
        false
    }

    /// Returns true if a barrier cuts a bond. Near it bonds of the nearest points are tried; where there are many of those, one is cut.
    fn cuts(&self, p: &Peridynamics<D>, barrier: &Barrier<D>) -> bool {
        let mut beside: Vec<Vector<D>> = Vec::new();
        let (low, high) = barrier.bounds();
        self.any(p, |x| {
            let reach = p.horizon_at(x);
            let is_near = (0..D).all(|a| x[a] >= low[a] - reach && x[a] <= high[a] + reach);
            if !is_near {
                return false;
            }
            let limit = reach * reach * (1.0 + 1e-6);
            let found = beside
                .iter()
                .any(|y| (x - y).norm_squared() <= limit && barrier.cuts(x, y));
            beside.push(*x);
            found || beside.len() > BESIDE
        })
    }
}

/// Corners of the box around a body, of which cells of a patch may lie in part only.
fn body_bounds<const D: usize>(mesh: &Mesh<D>) -> (Vector<D>, Vector<D>) {
    if !mesh.embedded.has_patch() {
        return mesh.bounds();
    }
    let pieces = &mesh.embedded.pieces;
    let whole = (0..mesh.cell_count()).filter(|&c| !pieces.contains_key(&(c as u32)));
    let nodes: Vec<u32> = whole.flat_map(|c| mesh.cell(c)).copied().collect();
    let corners = pieces.values().flatten().flat_map(|piece| &piece[..=D]);
    corners.fold(mesh.bounds_of(&nodes), |(low, high), x| {
        (low.inf(x), high.sup(x))
    })
}
