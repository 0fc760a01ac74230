//! Facets at the boundary of a set of cells or between two sets, their normals, and distances to them.

use rustc_hash::FxHashMap;

use super::error::position;
pub use super::facet::BoundaryFacet;
use super::facet::key;
use super::{Facet, Mesh, MeshError, facet_corners};
use crate::tensor::Vector;

/// A facet between cells of two classes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InterfaceFacet {
    /// Seen from the cell of the first class: the normal points to the second.
    pub first: BoundaryFacet,
    /// Seen from the cell of the second class.
    pub second: BoundaryFacet,
}

/// Facets that wait for their second cell, in a list for each smallest node: a few steps where a table of keys would hash.
struct Waiting {
    /// The last facet of each node's list.
    last: Vec<u32>,
    /// The key of each facet, and the one before it in its list.
    facets: Vec<([u32; 4], u32)>,
}

impl Waiting {
    const NONE: u32 = u32::MAX;

    fn new(nodes: usize) -> Self {
        Self {
            last: vec![Self::NONE; nodes],
            facets: Vec::new(),
        }
    }

    /// The number of the facet with the same nodes, which waits no longer. If there is none this one waits, with the next number.
    fn meet(&mut self, key: [u32; 4]) -> Option<usize> {
        let first = key[0] as usize;
        let (mut at, mut after) = (self.last[first], Self::NONE);
        while at != Self::NONE {
            let (other, before) = self.facets[at as usize];
            if other == key {
                match after {
                    Self::NONE => self.last[first] = before,
                    after => self.facets[after as usize].1 = before,
                }
                return Some(at as usize);
            }
            (after, at) = (at, before);
        }
        let number = self.facets.len() as u32;
        let before = std::mem::replace(&mut self.last[first], number);
        self.facets.push((key, before));
        None
    }
}

impl<const D: usize> Mesh<D> {
    /// The facet of a cell with this number in [`CellShape::facets`](super::CellShape::facets), its normal outwards.
    pub fn facet(&self, (cell, local): (u32, u8)) -> BoundaryFacet {
        let nodes = self.cell(cell as usize);
        let places = self.shapes[cell as usize].facets()[usize::from(local)];
        BoundaryFacet {
            nodes: places.iter().map(|&i| nodes[i]).collect(),
            cell,
            local,
        }
    }

    /// A facet with the nodes that its cell has in this mesh: cells may have been made linear since.
    pub fn present_facet(&self, facet: &BoundaryFacet) -> BoundaryFacet {
        match facet.local == BoundaryFacet::CROSSING {
            true => facet.clone(),
            false => self.facet((facet.cell, facet.local)),
        }
    }

    /// The facets of a cell by their numbers, with their keys.
    pub(super) fn keys_of_cell(&self, c: u32) -> impl Iterator<Item = ((u32, u8), [u32; 4])> + '_ {
        let nodes = self.cell(c as usize);
        // corners tell facets apart, whatever the order of their cells
        let facets = self.shapes[c as usize].linear().facets();
        facets.iter().enumerate().map(move |(local, places)| {
            let key = key(places.iter().map(|&i| nodes[i]));
            ((c, local as u8), key)
        })
    }

    /// The facets that belong to exactly one of `cells`, in the order of the cells, normals outwards.
    pub fn boundary_facets(&self, cells: impl IntoIterator<Item = u32>) -> Vec<BoundaryFacet> {
        let mut found: Vec<Option<(u32, u8)>> = Vec::new();
        let mut waiting = Waiting::new(self.nodes.len());
        for c in cells {
            for (facet, key) in self.keys_of_cell(c) {
                match waiting.meet(key) {
                    Some(other) => found[other] = None,
                    None => found.push(Some(facet)),
                }
            }
        }
        let alone = found.into_iter().flatten();
        alone.map(|facet| self.facet(facet)).collect()
    }

    /// The facets that belong to exactly one cell of the whole mesh, but those within the body where a patch is embedded.
    pub fn outer_facets(&self) -> Vec<BoundaryFacet> {
        let mut facets = self.boundary_facets(0..self.cell_count() as u32);
        if !self.embedded.inner.is_empty() {
            facets.retain(|facet| !self.embedded.inner.contains(&facet.key::<D>()));
        }
        facets.extend(self.embedded.surface.values().cloned());
        facets
    }

    /// For each cell whether it touches the boundary of the mesh, with a facet, an edge or a corner.
    pub fn cells_at_boundary(&self) -> Vec<bool> {
        let mut outer = vec![false; self.nodes.len()];
        let mut crossed = vec![false; self.cell_count()];
        for facet in self.outer_facets() {
            crossed[facet.cell as usize] |= facet.local == BoundaryFacet::CROSSING;
            for n in facet.nodes {
                outer[n as usize] = true;
            }
        }
        let touches = |c: usize| self.cell(c).iter().any(|&n| outer[n as usize]);
        (0..self.cell_count())
            .map(|c| crossed[c] || touches(c))
            .collect()
    }

    /// Nodes at notches: where two facets of the boundary meet that see each other, their normals at least 60° apart; sorted, without repeats.
    ///
    /// None in 1D. A hole whose facets turn by less from one to the next is none.
    pub fn notches(&self) -> Vec<u32> {
        const TURN: f64 = 0.5;
        if D == 1 {
            return Vec::new();
        }
        // facets meet in a node in 2D, in an edge in 3D
        let mut waiting: FxHashMap<[u32; 2], (Vector<D>, Vector<D>)> = FxHashMap::default();
        let mut found = Vec::new();
        for facet in self.outer_facets() {
            let corners = facet_corners::<D>(&facet.nodes);
            let count = corners.len();
            let centre = corners
                .iter()
                .map(|&n| self.nodes[n as usize])
                .sum::<Vector<D>>()
                / count as f64;
            let normal = self.facet_normal_area(&facet).normalize();
            for i in 0..count {
                let mut edge = [corners[i], corners[(i + 1) % count]];
                if D == 2 {
                    edge[1] = edge[0];
                }
                edge.sort_unstable();
                let Some((other, turned)) = waiting.remove(&edge) else {
                    waiting.insert(edge, (centre, normal));
                    continue;
                };
                if (centre - other).dot(&turned) > 0.0 && normal.dot(&turned) <= TURN + 1e-9 {
                    found.extend(edge);
                }
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    /// The facets between a cell of class `first` and one of class `second`; `class` gives each cell's class.
    ///
    /// Shapes: `class` has one entry per cell.
    pub fn interface_facets<C: PartialEq>(
        &self,
        class: &[C],
        first: &C,
        second: &C,
    ) -> Vec<InterfaceFacet> {
        let mut found = self.facets_where(
            |c| class[c] == *first || class[c] == *second,
            |a, b| class[a] != class[b],
        );
        for facet in &mut found {
            if class[facet.first.cell as usize] != *first {
                std::mem::swap(&mut facet.first, &mut facet.second);
            }
        }
        found
    }

    /// The facets between two cells of the mesh that differ.
    pub fn facets_between(&self, differ: impl Fn(usize, usize) -> bool) -> Vec<InterfaceFacet> {
        self.facets_where(|_| true, differ)
    }

    /// The facets between two of some cells that differ; the cell of the higher number comes first.
    fn facets_where(
        &self,
        is_one: impl Fn(usize) -> bool,
        differ: impl Fn(usize, usize) -> bool,
    ) -> Vec<InterfaceFacet> {
        let mut waiting = Waiting::new(self.nodes.len());
        let mut facets = Vec::new();
        let mut found = Vec::new();
        for c in (0..self.cell_count()).filter(|&c| is_one(c)) {
            for (facet, key) in self.keys_of_cell(c as u32) {
                let Some(other) = waiting.meet(key) else {
                    facets.push(facet);
                    continue;
                };
                let other: (u32, u8) = facets[other];
                if differ(c, other.0 as usize) {
                    found.push(InterfaceFacet {
                        first: self.facet(facet),
                        second: self.facet(other),
                    });
                }
            }
        }
        found
    }

    /// The cell of each facet of a set, with the facet turned so that its normal points out of that cell.
    ///
    /// A facet between two cells is seen from the one with the lower number.
    ///
    /// # Errors
    /// [`MeshError::LooseFacet`] for a facet that belongs to no cell.
    pub fn locate_facets(&self, facets: &[Facet]) -> Result<Vec<BoundaryFacet>, MeshError> {
        let mut wanted: FxHashMap<[u32; 4], Option<BoundaryFacet>> = facets
            .iter()
            .map(|f| (key(facet_corners::<D>(f).iter().copied()), None))
            .collect();
        for c in 0..self.cell_count() {
            for (facet, key) in self.keys_of_cell(c as u32) {
                if let Some(slot @ None) = wanted.get_mut(&key) {
                    *slot = Some(self.facet(facet));
                }
            }
        }
        facets
            .iter()
            .map(|f| {
                let found = wanted[&key(facet_corners::<D>(f).iter().copied())].clone();
                found
                    .or_else(|| self.embedded.crossing(f).cloned())
                    .ok_or_else(|| self.loose(f))
            })
            .collect()
    }

    fn loose(&self, facet: &[u32]) -> MeshError {
        let places = facet.iter().map(|&n| self.nodes[n as usize]);
        let middle = places.sum::<Vector<D>>() / facet.len() as f64;
        MeshError::LooseFacet {
            nodes: facet.to_vec(),
            position: position(middle.as_slice()),
        }
    }

    /// Outward normal of a facet times its area [length^(D−1)]; `±1` in 1D.
    ///
    /// For a warped quadrilateral the integral of the normal, `½ (x₂ − x₀) × (x₃ − x₁)`, which is exact. Of a facet of second order that of its corners, exact where its edges are straight, and in 2D.
    pub fn facet_normal_area(&self, facet: &BoundaryFacet) -> Vector<D> {
        let x = |i: usize| self.nodes[facet.nodes[i] as usize];
        if facet.nodes.len() == 1 {
            let out = x(0) - self.centroid(facet.cell as usize);
            return out / out.norm();
        }
        normal_area(
            &facet_corners::<D>(&facet.nodes)
                .iter()
                .map(|&n| self.nodes[n as usize])
                .collect::<Vec<_>>(),
        )
    }

    /// Area of a facet of a set (length in 2D, 1 in 1D), by two triangles for a quadrilateral; of one of second order that of its corners.
    pub fn facet_area(&self, nodes: &[u32]) -> f64 {
        let nodes = facet_corners::<D>(nodes);
        let x: Vec<Vector<D>> = nodes.iter().map(|&n| self.nodes[n as usize]).collect();
        match x.as_slice() {
            [_] => 1.0,
            [_, _] | [_, _, _] => normal_area(&x).norm(),
            [a, b, c, d] => normal_area(&[*a, *b, *c]).norm() + normal_area(&[*a, *c, *d]).norm(),
            _ => 0.0,
        }
    }

    /// Distance from `x` to a facet: a point, an edge, a triangle, or a quadrilateral as two triangles; those of the corners where it is of second order.
    pub fn distance_to_facet(&self, x: &Vector<D>, nodes: &[u32]) -> f64 {
        let nodes = facet_corners::<D>(nodes);
        let p = |i: usize| self.nodes[nodes[i] as usize];
        let to = |corners: &[Vector<D>]| (x - closest_point(x, corners).0).norm();
        match nodes.len() {
            0 => f64::INFINITY,
            1 => to(&[p(0)]),
            2 => to(&[p(0), p(1)]),
            3 => to(&[p(0), p(1), p(2)]),
            _ => to(&[p(0), p(1), p(2)]).min(to(&[p(0), p(2), p(3)])),
        }
    }
}

/// Normal times area of an edge (2D), triangle or quadrilateral (3D); zero where there is none.
pub(crate) fn normal_area<const D: usize>(x: &[Vector<D>]) -> Vector<D> {
    let mut n = Vector::zeros();
    match (D, x) {
        (2, [a, b]) => {
            n[0] = b[1] - a[1];
            n[1] = a[0] - b[0];
        }
        (3, [a, b, c, rest @ ..]) => {
            let (p, q) = match rest {
                [] => (b - a, c - a),
                [d, ..] => (c - a, d - b),
            };
            for k in 0..3 {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                n[k] = 0.5 * (p[i] * q[j] - p[j] * q[i]);
            }
        }
        _ => {}
    }
    n
}

/// The corners of a simplex that span the feature (corner, edge or face) on which a closest point lies.
pub(super) type Feature = &'static [usize];

/// The point of a corner, segment or triangle closest to `x`, and the feature that it lies on.
///
/// Source: the regions of Voronoi cells of a triangle (Ericson, Real-Time Collision Detection, section 5.1.5).
pub(super) fn closest_point<const D: usize>(
    x: &Vector<D>,
    corners: &[Vector<D>],
) -> (Vector<D>, Feature) {
    match corners {
        [a] => (*a, &[0]),
        [a, b] => {
            let e = b - a;
            let t = (x - a).dot(&e) / e.norm_squared();
            if t <= 0.0 {
                (*a, &[0])
            } else if t >= 1.0 {
                (*b, &[1])
            } else {
                (a + e * t, &[0, 1])
            }
        }
        [a, b, c, ..] => {
            let (ab, ac) = (b - a, c - a);
            let (ax, bx, cx) = (x - a, x - b, x - c);
            let (d1, d2) = (ab.dot(&ax), ac.dot(&ax));
            if d1 <= 0.0 && d2 <= 0.0 {
                return (*a, &[0]);
            }
            let (d3, d4) = (ab.dot(&bx), ac.dot(&bx));
            if d3 >= 0.0 && d4 <= d3 {
                return (*b, &[1]);
            }
            let (d5, d6) = (ab.dot(&cx), ac.dot(&cx));
            if d6 >= 0.0 && d5 <= d6 {
                return (*c, &[2]);
            }
            let vc = d1 * d4 - d3 * d2;
            if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
                return (a + ab * (d1 / (d1 - d3)), &[0, 1]);
            }
            let vb = d5 * d2 - d1 * d6;
            if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
                return (a + ac * (d2 / (d2 - d6)), &[0, 2]);
            }
            let va = d3 * d6 - d5 * d4;
            if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
                let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
                return (b + (c - b) * w, &[1, 2]);
            }
            let sum = va + vb + vc;
            (a + ab * (vb / sum) + ac * (vc / sum), &[0, 1, 2])
        }
        [] => (*x, &[]),
    }
}

#[cfg(test)]
mod tests {
    use super::super::generate::{Axis, Grid};
    use super::*;

    fn uniform(cells: usize) -> Axis {
        Axis::Uniform {
            min: 0.0,
            max: 1.0,
            cells,
        }
    }

    #[test]
    fn closed_surface_has_no_net_normal_and_the_right_area() {
        let mut grid = Grid::new([uniform(3), uniform(4), uniform(5)]);
        grid.jitter(0.2, 3);
        for mesh in [grid.clone().mesh(), grid.simplices().mesh()] {
            let mesh = mesh.unwrap();
            let facets = mesh.outer_facets();
            let normals: Vec<Vector<3>> =
                facets.iter().map(|f| mesh.facet_normal_area(f)).collect();
            assert!(normals.iter().sum::<Vector<3>>().norm() < 1e-14);
            assert!((normals.iter().map(|n| n.norm()).sum::<f64>() - 6.0).abs() < 1e-13);
            for (f, n) in facets.iter().zip(&normals) {
                let out = mesh.nodes[f.nodes[0] as usize] - Vector::repeat(0.5);
                assert!(out.dot(n) > 0.0, "outwards");
                assert!((mesh.facet_area(&f.nodes) - n.norm()).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn interface_of_two_halves() {
        let mesh = Grid::new([uniform(4), uniform(3)]).mesh().unwrap();
        let right: Vec<bool> = (0..mesh.cell_count())
            .map(|c| mesh.centroid(c).x > 0.5)
            .collect();
        let interface = mesh.interface_facets(&right, &false, &true);
        assert_eq!(interface.len(), 3);
        for facet in &interface {
            let normal = mesh.facet_normal_area(&facet.first);
            assert!((normal - Vector::from([1.0 / 3.0, 0.0])).norm() < 1e-15);
            assert!((mesh.facet_normal_area(&facet.second) + normal).norm() < 1e-15);
        }
        let left: Vec<u32> = (0..12u32).filter(|&c| !right[c as usize]).collect();
        assert_eq!(mesh.boundary_facets(left).len(), 2 * 3 + 2 * 2);
        assert_eq!(mesh.outer_facets().len(), 14);
    }

    #[test]
    fn facets_are_located_and_loose_ones_named() {
        let mesh = Grid::new([uniform(2), uniform(2)]).mesh().unwrap();
        let found = mesh.locate_facets(&[vec![1, 0], vec![4, 1]]).unwrap();
        assert_eq!((found[0].nodes.as_slice(), found[0].cell), (&[0, 1][..], 0));
        assert_eq!(found[1].cell, 0);
        assert!((mesh.facet_normal_area(&found[1]) - Vector::from([0.5, 0.0])).norm() < 1e-15);
        let message = mesh.locate_facets(&[vec![0, 8]]).unwrap_err().to_string();
        assert!(
            message.contains(
                "around (0.500000, 0.500000) (nodes [0, 8], counted from 0) is no facet of any cell"
            ),
            "{message}"
        );
        let line = Grid::new([uniform(3)]).mesh().unwrap();
        let ends = line.outer_facets();
        assert_eq!(ends.len(), 2);
        assert_eq!(line.facet_normal_area(&ends[0])[0], -1.0);
        assert_eq!(line.facet_normal_area(&ends[1])[0], 1.0);
    }

    /// Distances by hand, in every Voronoi region of a triangle, and for a quadrilateral.
    #[test]
    fn distances_to_facets() {
        let mut mesh = Mesh::<3> {
            nodes: [
                [0.0, 0.0, 0.0],
                [4.0, 0.0, 0.0],
                [4.0, 4.0, 0.0],
                [0.0, 4.0, 0.0],
            ]
            .map(Vector::from)
            .to_vec(),
            ..Mesh::default()
        };
        let x = |a: f64, b: f64, c: f64| Vector::<3>::from([a, b, c]);
        for (p, d) in [
            (x(3.0, 1.0, 2.0), 2.0),
            (x(-3.0, -4.0, 0.0), 5.0),
            (x(2.0, -3.0, 4.0), 5.0),
            (x(7.0, -4.0, 0.0), 5.0),
            (x(7.0, 2.0, 4.0), 5.0),
            (x(4.0, 8.0, 3.0), 5.0),
            (x(1.0, 3.0, 0.0), 2.0f64.sqrt()),
        ] {
            assert!(
                (mesh.distance_to_facet(&p, &[0, 1, 2]) - d).abs() < 1e-14,
                "{p}"
            );
            assert!(
                (mesh.distance_to_facet(&p, &[2, 0, 1]) - d).abs() < 1e-14,
                "{p}"
            );
        }
        assert_eq!(
            mesh.distance_to_facet(&x(1.0, 3.0, -1.0), &[0, 1, 2, 3]),
            1.0
        );
        assert_eq!(mesh.distance_to_facet(&x(1.0, 3.0, 0.0), &[0, 1]), 3.0);
        assert_eq!(mesh.distance_to_facet(&x(3.0, 4.0, 0.0), &[0]), 5.0);
        mesh.nodes[2] = x(4.0, 4.0, 3.0);
        assert!((mesh.facet_area(&[0, 1, 2]) - 10.0).abs() < 1e-14);
    }
}
