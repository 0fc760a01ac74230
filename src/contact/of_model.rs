//! Surfaces of a model: facets of its elements, quadrature points on them, and peridynamic points.

use rustc_hash::FxHashMap;

use super::closest;
use super::surface::{Facet, NONE, Place, Surface, normal};
use super::{ContactLaw, SurfaceContact, touch};
use crate::assembly::Transfer;
use crate::fem::{Locator, facet_points, reference_of, shape_values};
use crate::mesh::boundary::BoundaryFacet;
use crate::mesh::{CellShape, facet_corners};
use crate::model::{CellRole, Model, clearance};
use crate::tensor::Vector;

/// Plane pieces of a facet by its number of nodes in two and three dimensions.
pub(super) fn pieces<const D: usize>(nodes: usize) -> &'static [&'static [usize]] {
    match (D, nodes) {
        (1, _) => &[&[0]],
        (2, 2) => &[&[0, 1]],
        (2, _) => &[&[0, 2], &[2, 1]],
        (_, 3) => &[&[0, 1, 2]],
        (_, 4) => &[&[0, 1, 2], &[0, 2, 3]],
        (_, 6) => &[&[0, 3, 5], &[3, 1, 4], &[5, 4, 2], &[3, 4, 5]],
        (_, _) => &[
            &[0, 4, 7],
            &[4, 1, 5],
            &[5, 2, 6],
            &[6, 3, 7],
            &[4, 5, 6],
            &[4, 6, 7],
        ],
    }
}

/// Sites with their weights in a displacement.
pub(super) type SiteRow = Vec<(u32, f64)>;

/// Surfaces while they are collected.
pub(super) struct Parts<'m, const D: usize> {
    pub model: &'m Model<D>,
    /// The body of each node.
    pub bodies: Vec<u32>,
    pub corners: Vec<Vector<D>>,
    pub corner_rows: Transfer,
    /// Corners that are nodes, by these.
    of_node: FxHashMap<u32, u32>,
    pub facets: Vec<Facet<D>>,
    pub outward: Vec<f64>,
    pub places: Vec<(Place, Vector<D>, SiteRow)>,
}

impl<const D: usize> Parts<'_, D> {
    /// The body of a cell.
    pub fn body_of(&self, cell: usize) -> u32 {
        self.bodies[self.model.mesh.cell(cell)[0] as usize]
    }

    /// The displacement of a place on a facet by those of sites, `shape` being the functions of the facet's nodes there.
    fn row(&self, facet: &BoundaryFacet, x: &Vector<D>, shape: &[f64]) -> Vec<(u32, f64)> {
        let mesh = &self.model.mesh;
        let of_nodes = |nodes: &[u32], shape: &[f64]| {
            let each = nodes.iter().zip(shape);
            each.flat_map(|(&n, &w)| {
                let row = self.model.node_transfer.row(n as usize);
                row.map(move |(site, v)| (site, v * w))
            })
            .collect()
        };
        if facet.local != BoundaryFacet::CROSSING {
            return of_nodes(&facet.nodes, shape);
        }
        let cell = facet.cell as usize;
        let xi = reference_of(mesh, cell, x).unwrap_or_else(Vector::zeros);
        let (shape, count) = shape_values(mesh, cell, &xi);
        of_nodes(mesh.cell(cell), &shape[..count])
    }

    fn corner(&mut self, facet: &BoundaryFacet, place: usize) -> u32 {
        let node = facet.nodes[place];
        let is_node = facet.local != BoundaryFacet::CROSSING;
        if let (true, Some(&c)) = (is_node, self.of_node.get(&node)) {
            return c;
        }
        let x = self.model.mesh.nodes[node as usize];
        let mut shape = [0.0; 8];
        shape[place] = 1.0;
        let number = self.corners.len() as u32;
        let row = self.row(facet, &x, &shape);
        self.corner_rows.push(row);
        self.corners.push(x);
        if is_node {
            self.of_node.insert(node, number);
        }
        number
    }

    /// Thickness of the cell behind a facet \[m\]; half of it where the cell has nodes in the middle.
    fn size(&self, facet: &BoundaryFacet, normal: &Vector<D>) -> f64 {
        let mesh = &self.model.mesh;
        if facet.local == BoundaryFacet::CROSSING {
            return mesh.embedded.covered.edge;
        }
        let cell = facet.cell as usize;
        let corners = facet_corners::<D>(&facet.nodes);
        let middle = corners
            .iter()
            .map(|&n| mesh.nodes[n as usize])
            .sum::<Vector<D>>();
        let depth = (middle / corners.len() as f64 - mesh.centroid(cell)).dot(normal);
        let shape = mesh.shapes[cell];
        // heights of simplices are D + 1 times that of their centroid
        let times = match shape.linear() {
            CellShape::Tri3 | CellShape::Tet4 => D as f64 + 1.0,
            _ => 2.0,
        };
        let size = depth.abs() * times;
        if shape.is_quadratic() {
            0.5 * size
        } else {
            size
        }
    }

    fn add(&mut self, facet: &BoundaryFacet) {
        let mesh = &self.model.mesh;
        let outward = mesh.facet_normal_area(facet);
        let unit = outward / outward.norm();
        let size = self.size(facet, &unit);
        let material = self.model.material_of_cell(facet.cell as usize);
        let modulus = self.model.elastic.tensors[usize::from(material)].longitudinal_modulus();
        let body = self.body_of(facet.cell as usize);
        let (first, stiffness) = (self.facets.len(), modulus / size);
        for piece in pieces::<D>(facet.nodes.len()) {
            let mut corners: [u32; D] = std::array::from_fn(|k| self.corner(facet, piece[k]));
            let at = corners.map(|c| self.corners[c as usize]);
            if D > 1 && normal(&at).dot(&outward) < 0.0 {
                corners.swap(0, 1);
            }
            self.facets.push(Facet {
                corners,
                size,
                stiffness,
                body,
            });
            self.outward.push(outward[0].signum());
        }
        let mut points = Vec::new();
        facet_points(&self.model.mesh, &facet.nodes, |p| points.push(*p));
        for p in points.into_iter().filter(|p| p.weight > 0.0) {
            let distance = |f: usize| {
                let at = self.facets[f].corners.map(|c| self.corners[c as usize]);
                let weights = closest::nearest(&at, &p.position);
                let nearest: Vector<D> = at.iter().zip(weights).map(|(c, w)| c * w).sum();
                (nearest - p.position).norm()
            };
            let pieces = first..self.facets.len();
            let own = pieces.min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
            let place = Place {
                area: p.weight,
                stiffness,
                clearance: 0.0,
                size,
                facet: own.unwrap_or(first) as u32,
                body,
            };
            let row = self.row(facet, &p.position, &p.shape);
            self.places.push((place, p.position, row));
        }
    }

    /// Adds the peridynamic points.
    fn add_points(&mut self) {
        let Some(cloud) = self.model.body().map(|body| &body.cloud) else {
            return;
        };
        let model = self.model;
        let sizes = clearance::sizes(model);
        let clearances = clearance::clearances(model, &sizes);
        let first = self.body_of(0);
        let has_several = (0..model.mesh.cell_count()).any(|c| self.body_of(c) != first);
        let cells = (0..model.mesh.cell_count()).filter(|&c| model.roles[c] == CellRole::Points);
        let cells = Locator::new(&model.mesh, cells);
        for (s, site) in model.sites.iter().enumerate() {
            let Some((_, point)) = model.point_of(s) else {
                continue;
            };
            let located = has_several
                .then(|| cells.locate(&model.mesh, &site.position, 1e-6))
                .flatten();
            let body = located.map_or(first, |found| self.body_of(found.cell));
            let material = match cloud.material.get(point) {
                Some(&material) => material,
                None => model.peridynamic_material(),
            };
            let modulus = model.elastic.tensors[usize::from(material)].longitudinal_modulus();
            let place = Place {
                area: site.volume / sizes[s],
                stiffness: modulus / sizes[s],
                clearance: clearances[s],
                size: sizes[s],
                facet: NONE,
                body,
            };
            self.places
                .push((place, site.position, vec![(s as u32, 1.0)]));
        }
    }
}

impl<const D: usize> SurfaceContact<D> {
    /// Contact of the surfaces of `model`: facets of its elements keep each other out, and its peridynamic points, and so do the faces of its cracks.
    ///
    /// With `cracks_alone` it is that of the faces of cracks and of nothing else.
    pub fn new(model: &Model<D>, law: ContactLaw, cracks_alone: bool) -> Self {
        let mut parts = Parts {
            model,
            bodies: model.mesh.bodies(),
            corners: Vec::new(),
            corner_rows: Transfer::new(model.sites.len()),
            of_node: FxHashMap::default(),
            facets: Vec::new(),
            outward: Vec::new(),
            places: Vec::new(),
        };
        let outer = match cracks_alone {
            true => Vec::new(),
            false => model.mesh.outer_facets(),
        };
        for facet in outer {
            if model.is_element(facet.cell as usize) {
                parts.add(&model.mesh.present_facet(&facet));
            }
        }
        let cracks_from = parts.facets.len();
        parts.add_crack_faces();
        if cracks_from > 0 {
            parts.add_points();
        }
        let Parts {
            corners,
            corner_rows,
            facets,
            outward,
            mut places,
            ..
        } = parts;
        places.sort_by_key(|(place, ..)| place.facet);
        let mut rows = Transfer::new(model.sites.len());
        let (mut all, mut rest) = (Vec::new(), Vec::new());
        for (place, x, row) in places {
            rows.push(row);
            all.push(place);
            rest.push(x);
        }
        let horizon = model.body().map_or(0.0, |body| {
            body.cloud
                .horizon
                .values()
                .iter()
                .copied()
                .fold(0.0, f64::max)
        });
        let limits = (cracks_from as u32, law.deepest);
        let places = (all, rest, rows);
        let corners = (corners, corner_rows);
        let surface = Surface::new(corners, facets, outward, places, limits, horizon);
        Self::of_surface(surface, law, model.sites.len())
    }

    /// Moves places that are no farther than `law().adjust` from another surface at the displacement `u`, apart or overlapping, onto it.
    pub fn adjust(&mut self, u: &[f64]) {
        let reach = self.law.adjust;
        if reach <= 0.0 {
            return;
        }
        let mut work = std::mem::take(&mut *self.work());
        let skin = self.skin;
        self.skin = reach.max(skin);
        work.listed = Default::default();
        self.update(&mut work, u);
        let mut ways = Vec::new();
        for (k, &place) in work.near.places.iter().enumerate() {
            let x = self.place_at(place, u);
            let near = work.near.of(k);
            let way = touch::way_to_surface(&self.surface, &work.corners, (place, x), near);
            ways.extend(
                way.filter(|way| way.norm() <= reach)
                    .map(|way| (place, way)),
            );
        }
        for (place, way) in ways {
            self.surface.rest[place as usize] += way;
        }
        self.skin = skin;
        work.listed = Default::default();
        *self.work() = work;
    }
}
