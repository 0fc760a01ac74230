//! Visibility of bonds: those that leave the mesh through a hole, a slit or a notch.

use std::collections::HashMap;

use super::boundary::{BoundaryFacet, Feature, closest_point, normal_area};
use super::{Mesh, facet_corners};
use crate::shape::TOUCH;
use crate::tensor::Vector;

/// Boundary facets in a grid, ready to be asked which bonds leave the mesh.
///
/// A bond is cut iff a piece of positive length of it lies outside the mesh. Running along the boundary or touching it is
/// no cut; a bond whose ends lie on opposite faces of a slit is one. Tolerance: 1e-9 of the bond's length.
#[derive(Clone, Debug)]
pub struct SegmentCutter<const D: usize> {
    /// Points, edges or triangles.
    facets: Vec<Simplex<D>>,
    origin: Vector<D>,
    cell_size: f64,
    counts: [usize; D],
    /// Facets of each grid cell.
    offsets: Vec<u32>,
    entries: Vec<u32>,
}

/// Planes of the faces of a convex body at most: more are those of a curved surface, and looking at all of them takes longer than asking about bonds.
const MOST_PLANES: usize = 16;

/// Tolerance for a point beyond a plane, over the size of the body: round-off.
const CONVEX_TOUCH: f64 = 1e-13;

/// A point, edge or triangle of the boundary.
#[derive(Clone, Debug)]
struct Simplex<const D: usize> {
    /// Its `D` corners.
    corners: [Vector<D>; D],
    /// Unit normal out of the mesh.
    normal: Vector<D>,
    /// Mean normals at features: corners 0, 1, 2, then edges 01, 12, 02.
    rim_normals: [Vector<D>; 6],
}

/// Place of a corner or edge in [`Simplex::rim_normals`].
fn rim_place(feature: Feature) -> Option<usize> {
    match feature {
        [i] => Some(*i),
        [0, 1] => Some(3),
        [1, 2] => Some(4),
        [0, 2] => Some(5),
        _ => None,
    }
}

impl<const D: usize> SegmentCutter<D> {
    /// Sorts the facets, whose normals point out of the mesh, into a grid.
    pub fn new(mesh: &Mesh<D>, boundary: &[BoundaryFacet]) -> Self {
        let mut facets = Vec::with_capacity(boundary.len());
        let mut numbers: Vec<Vec<u32>> = Vec::with_capacity(boundary.len());
        for facet in boundary {
            let n = facet_corners::<D>(&facet.nodes);
            let parts = match n.len() {
                4 => vec![vec![n[0], n[1], n[2]], vec![n[0], n[2], n[3]]],
                _ => vec![n.to_vec()],
            };
            for part in parts {
                let corners: [Vector<D>; D] =
                    std::array::from_fn(|i| mesh.nodes[part[i.min(part.len() - 1)] as usize]);
                let normal = if D == 1 {
                    mesh.facet_normal_area(facet)
                } else {
                    normal_area(&corners)
                };
                let size = normal.norm();
                if size > 0.0 {
                    facets.push(Simplex {
                        corners,
                        normal: normal / size,
                        rim_normals: [normal / size; 6],
                    });
                    numbers.push(part);
                }
            }
        }
        set_rim_normals(&mut facets, &numbers);
        Self::in_grid(facets)
    }

    /// All holes and edges of a mesh.
    pub fn of_mesh(mesh: &Mesh<D>) -> Self {
        Self::new(mesh, &mesh.outer_facets())
    }

    /// Returns true if the boundary is that of a convex body with few faces, and all of these points lie in it: then no bond between them leaves it, and none has to be tested.
    pub fn is_convex_around(&self, points: &[Vector<D>]) -> bool {
        let corners = || self.facets.iter().flat_map(|facet| &facet.corners);
        let size = corners().fold(0.0f64, |most, x| most.max(x.amax()));
        let touches = CONVEX_TOUCH * size;
        let mut planes: Vec<(Vector<D>, f64)> = Vec::new();
        for facet in &self.facets {
            let offset = facet.normal.dot(&facet.corners[0]);
            let is_known = planes.iter().any(|(normal, at)| {
                (normal - facet.normal).amax() < CONVEX_TOUCH && (at - offset).abs() < touches
            });
            if is_known {
                continue;
            }
            if planes.len() == MOST_PLANES {
                return false;
            }
            planes.push((facet.normal, offset));
        }
        let is_inside = |x: &Vector<D>| {
            let mut planes = planes.iter();
            planes.all(|(normal, at)| normal.dot(x) <= at + touches)
        };
        !planes.is_empty() && corners().all(is_inside) && points.iter().all(is_inside)
    }

    fn in_grid(facets: Vec<Simplex<D>>) -> Self {
        let mut lo: Vector<D> = Vector::repeat(f64::INFINITY);
        let mut hi: Vector<D> = Vector::repeat(f64::NEG_INFINITY);
        let mut size = 0.0;
        for facet in &facets {
            let (l, h) = facet.bounds();
            (lo, hi) = (lo.inf(&l), hi.sup(&h));
            size += (h - l).amax();
        }
        if facets.is_empty() {
            (lo, hi) = (Vector::zeros(), Vector::zeros());
        }
        let extent = (hi - lo).amax().max(f64::MIN_POSITIVE);
        // about one facet per grid cell that the boundary passes, and never more than a few hundred cells along an axis
        let most = [1 << 20, 1 << 10, 1 << 8][D.min(3) - 1] as f64;
        let count = facets.len().max(1) as f64;
        // the ends of a bar have no size, and a bond would pass a million cells between them
        let cell_size = (size / count)
            .max(extent / most.min(count))
            .max(f64::MIN_POSITIVE);
        let counts = std::array::from_fn(|k| ((hi[k] - lo[k]) / cell_size) as usize + 1);
        let mut grid = Self {
            facets,
            origin: lo,
            cell_size,
            counts,
            offsets: Vec::new(),
            entries: Vec::new(),
        };
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        for (f, facet) in grid.facets.iter().enumerate() {
            let (l, h) = facet.bounds();
            grid.visit(&l, &h, |cell| {
                pairs.push((cell as u32, f as u32));
                Visit::On
            });
        }
        pairs.sort_unstable();
        let mut offsets = vec![0u32; grid.counts.iter().product::<usize>() + 1];
        for (cell, _) in &pairs {
            offsets[*cell as usize + 1] += 1;
        }
        for i in 1..offsets.len() {
            offsets[i] += offsets[i - 1];
        }
        grid.offsets = offsets;
        grid.entries = pairs.into_iter().map(|(_, f)| f).collect();
        grid
    }

    /// Calls `f` with every grid cell that a box overlaps, until it says stop.
    fn visit(&self, lo: &Vector<D>, hi: &Vector<D>, mut f: impl FnMut(usize) -> Visit) {
        let mut first = [0; D];
        let mut last = [0; D];
        for k in 0..D {
            let slack = 1e-6;
            let a = (lo[k] - self.origin[k]) / self.cell_size - slack;
            let b = (hi[k] - self.origin[k]) / self.cell_size + slack;
            if b < 0.0 || a >= self.counts[k] as f64 {
                return;
            }
            first[k] = a.max(0.0) as usize;
            last[k] = (b as usize).min(self.counts[k] - 1);
        }
        let mut at = first;
        loop {
            let mut cell = 0;
            for k in (0..D).rev() {
                cell = cell * self.counts[k] + at[k];
            }
            if f(cell) == Visit::Stop {
                return;
            }
            let mut k = 0;
            while k < D {
                if at[k] < last[k] {
                    at[k] += 1;
                    break;
                }
                at[k] = first[k];
                k += 1;
            }
            if k == D {
                return;
            }
        }
    }

    fn facets_in(&self, cell: usize) -> impl Iterator<Item = &Simplex<D>> {
        self.entries[self.offsets[cell] as usize..self.offsets[cell + 1] as usize]
            .iter()
            .map(|&f| &self.facets[f as usize])
    }

    /// Returns true if a bond of length `reach` or less that starts at `x` can meet a facet; if not, its family needs no test.
    pub fn near(&self, x: &Vector<D>, reach: f64) -> bool {
        let reach = reach * (1.0 + TOUCH);
        let mut found = false;
        self.visit(&x.add_scalar(-reach), &x.add_scalar(reach), |cell| {
            found = self.offsets[cell + 1] > self.offsets[cell];
            if found { Visit::Stop } else { Visit::On }
        });
        found
    }

    /// Returns true if the bond from `a` to `b`, both in the mesh, leaves it on its way. The same answer for `b` to `a`.
    pub fn cuts(&self, a: &Vector<D>, b: &Vector<D>) -> bool {
        let length = (b - a).norm();
        let skin = TOUCH * length;
        let (lo, hi) = (a.inf(b).add_scalar(-skin), a.sup(b).add_scalar(skin));
        let mut cut = false;
        let mut touches: Vec<f64> = Vec::new();
        self.visit(&lo, &hi, |cell| {
            for facet in self.facets_in(cell) {
                cut |= facet.meet(a, b, skin, &mut touches) == Meeting::Crossing;
            }
            if cut { Visit::Stop } else { Visit::On }
        });
        if cut || touches.is_empty() {
            return cut;
        }
        touches.extend([0.0, 1.0]);
        touches.sort_unstable_by(f64::total_cmp);
        touches.windows(2).any(|w| {
            let piece = (w[1] - w[0]) * length;
            // at least one end of the piece lies on the boundary, hence the reach
            piece > 4.0 * skin
                && self.height(
                    &(a + (b - a) * (0.5 * (w[0] + w[1]))),
                    0.5 * piece + skin,
                    skin,
                ) > skin
        })
    }

    /// Distance of `x` from the boundary, positive outside the mesh; `reach` is an upper bound of its size.
    /// A distance below `skin` is as good as none, and ends the search.
    fn height(&self, x: &Vector<D>, reach: f64, skin: f64) -> f64 {
        let mut nearest = (f64::INFINITY, 0.0);
        self.visit(&x.add_scalar(-reach), &x.add_scalar(reach), |cell| {
            for facet in self.facets_in(cell) {
                let (foot, feature) = closest_point(x, &facet.corners);
                let distance = (x - foot).norm();
                if distance < nearest.0 {
                    let normal = match rim_place(feature) {
                        Some(place) => &facet.rim_normals[place],
                        None => &facet.normal,
                    };
                    nearest = (distance, distance.copysign((x - foot).dot(normal)));
                }
            }
            if nearest.0 <= skin {
                Visit::Stop
            } else {
                Visit::On
            }
        });
        nearest.1
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Visit {
    On,
    Stop,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Meeting {
    None,
    Touching,
    /// Through the inside of the facet, from well on one side to well on the other.
    Crossing,
}

impl<const D: usize> Simplex<D> {
    fn bounds(&self) -> (Vector<D>, Vector<D>) {
        self.corners
            .iter()
            .fold((self.corners[0], self.corners[0]), |(lo, hi), x| {
                (lo.inf(x), hi.sup(x))
            })
    }

    /// Returns the kind of intersection of the segment with the facet; positions of touching go to `touches`.
    fn meet(&self, a: &Vector<D>, b: &Vector<D>, skin: f64, touches: &mut Vec<f64>) -> Meeting {
        let height = |x: &Vector<D>| (x - self.corners[0]).dot(&self.normal);
        let (p, q) = (height(a), height(b));
        if (p > skin && q > skin) || (p < -skin && q < -skin) {
            return Meeting::None;
        }
        if p.abs() <= skin && q.abs() <= skin {
            // within the facet's plane: the bond may enter or leave the facet at any of its corners or edges
            return self.meet_in_plane(a, b, skin, touches);
        }
        let t = (p / (p - q)).clamp(0.0, 1.0);
        let x = a + (b - a) * t;
        let (foot, feature) = closest_point(&x, &self.corners);
        if (x - foot).norm() > skin.max((b - a).norm() * TOUCH) {
            return Meeting::None;
        }
        let ends_apart = p.abs() > skin && q.abs() > skin;
        let inside = D == 1 || (feature.len() == D && self.clear_of_rim(&x, skin));
        if ends_apart && inside {
            return Meeting::Crossing;
        }
        touches.push(t);
        Meeting::Touching
    }

    /// Returns true if a point of the facet is more than `skin` away from its rim.
    fn clear_of_rim(&self, x: &Vector<D>, skin: f64) -> bool {
        (0..D).all(|i| {
            let (p, q) = (self.corners[i], self.corners[(i + 1) % D]);
            match D {
                2 => (x - p).norm() > skin,
                _ => (x - closest_point(x, &[p, q]).0).norm() > skin,
            }
        })
    }

    /// A bond in the facet's plane: where it passes the rim.
    fn meet_in_plane(
        &self,
        a: &Vector<D>,
        b: &Vector<D>,
        skin: f64,
        touches: &mut Vec<f64>,
    ) -> Meeting {
        let d = b - a;
        let dd = d.norm_squared();
        let before = touches.len();
        let mut add = |t: f64| {
            if (0.0..=1.0).contains(&t) {
                touches.push(t);
            }
        };
        for i in 0..D {
            let (p, q) = (self.corners[i], self.corners[(i + 1) % D]);
            let t = (p - a).dot(&d) / dd;
            if (a + d * t - p).norm() <= skin {
                add(t);
            }
            if D == 3 {
                // normal to the edge within the plane
                let e = q - p;
                let m = d - e * (d.dot(&e) / e.norm_squared());
                let rate = m.dot(&d);
                if rate > (TOUCH * TOUCH) * dd {
                    let t = (p - a).dot(&m) / rate;
                    let x = a + d * t;
                    if (x - closest_point(&x, &[p, q]).0).norm() <= skin {
                        add(t);
                    }
                }
            }
        }
        if touches.len() > before {
            Meeting::Touching
        } else {
            Meeting::None
        }
    }
}

/// Mean normals at corners (weighted by angle) and edges, which tell inside from outside where a corner is nearest.
///
/// Source: Baerentzen and Aanaes 2005, "Signed distance computation using the angle weighted pseudonormal".
fn set_rim_normals<const D: usize>(facets: &mut [Simplex<D>], numbers: &[Vec<u32>]) {
    const EDGES: [[usize; 2]; 3] = [[0, 1], [1, 2], [0, 2]];
    let mut corners: HashMap<u32, Vector<D>> = HashMap::new();
    let mut edges: HashMap<[u32; 2], Vector<D>> = HashMap::new();
    let edge_key = |n: &[u32], [i, j]: [usize; 2]| [n[i].min(n[j]), n[i].max(n[j])];
    for (facet, nodes) in facets.iter().zip(numbers) {
        for (i, n) in nodes.iter().enumerate() {
            let weight = if D == 3 {
                let u = facet.corners[(i + 1) % D] - facet.corners[i];
                let v = facet.corners[(i + 2) % D] - facet.corners[i];
                (u.dot(&v) / (u.norm() * v.norm())).clamp(-1.0, 1.0).acos()
            } else {
                1.0
            };
            *corners.entry(*n).or_insert_with(Vector::zeros) += facet.normal * weight;
        }
        if D == 3 {
            for edge in EDGES {
                *edges
                    .entry(edge_key(nodes, edge))
                    .or_insert_with(Vector::zeros) += facet.normal;
            }
        }
    }
    for (facet, nodes) in facets.iter_mut().zip(numbers) {
        for (i, n) in nodes.iter().enumerate() {
            facet.rim_normals[i] = corners[n];
        }
        if D == 3 {
            for (k, edge) in EDGES.into_iter().enumerate() {
                facet.rim_normals[3 + k] = edges[&edge_key(nodes, edge)];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::generate::{Axis, CutOut, Grid};
    use super::*;
    use crate::shape::{Barrier, Shape};

    fn axis(cells: usize) -> Axis {
        Axis::Uniform {
            min: -0.5,
            max: 0.5,
            cells,
        }
    }

    /// Every bond of a lattice that fits the mesh, and of one shifted off it, against the same hole as a void; in a solid two of seven.
    fn agrees_with_void<const D: usize>(
        cells: usize,
        min: Vector<D>,
        max: Vector<D>,
        form: impl Fn(&mut Grid<D>),
    ) {
        let mut grid = Grid::new(std::array::from_fn(|_| axis(cells)));
        grid.cut_out(CutOut {
            name: "hole".into(),
            min,
            max,
        });
        form(&mut grid);
        let mesh = grid.mesh().unwrap();
        let cutter = SegmentCutter::of_mesh(&mesh);
        let hole = Barrier::Void(Shape::Box { min, max });
        let h = 1.0 / cells as f64;
        let shifted: Vec<Vector<D>> = mesh
            .nodes
            .iter()
            .map(|x| x.map(|v| (v + 0.313 * h).min(0.5)))
            .filter(|x| hole.shape().signed_distance(x) >= 0.0)
            .collect();
        let mut cuts = 0;
        for points in [&mesh.nodes, &shifted] {
            for (i, a) in points.iter().enumerate() {
                for (j, b) in points.iter().enumerate() {
                    let length = (b - a).norm();
                    if length == 0.0 || length > 3.1 * h {
                        continue;
                    }
                    // the many segments of a solid by turns, those of a pair from one end and the other
                    if D == 3 && (i + 5 * j) % 7 > 1 {
                        continue;
                    }
                    let wanted = hole.cuts(a, b);
                    assert_eq!(cutter.cuts(a, b), wanted, "{a} {b}");
                    assert!(!wanted || cutter.near(a, length));
                    cuts += usize::from(wanted);
                }
            }
        }
        assert!(cuts > 50);
    }

    #[test]
    fn a_meshed_slit_cuts_what_the_void_cuts() {
        let (min, max) = (
            Vector::from([-0.25, -1.0 / 16.0]),
            Vector::from([0.25, 1.0 / 16.0]),
        );
        agrees_with_void::<2>(16, min, max, |_| {});
        agrees_with_void::<2>(16, min, max, |grid| {
            grid.simplices();
        });
        let (min, max) = (Vector::from([-0.25, -0.125, -0.125]), Vector::repeat(0.125));
        agrees_with_void::<3>(8, min, max, |_| {});
        agrees_with_void::<3>(8, min, max, |grid| {
            grid.simplices();
        });
    }

    /// Returns true if no bond of the nodes of a block can leave it, turned by an angle in its first plane: whole, or without a corner.
    fn convex<const D: usize>(is_cut: bool, is_simplicial: bool, angle: f64) -> bool {
        let mut grid = Grid::<D>::new(std::array::from_fn(|_| axis(8)));
        if is_cut {
            grid.cut_out(CutOut {
                name: "corner".into(),
                min: Vector::repeat(0.25),
                max: Vector::repeat(0.5),
            });
        }
        if is_simplicial {
            grid.simplices();
        }
        let mut mesh = grid.mesh().unwrap();
        for x in &mut mesh.nodes {
            if D > 1 {
                let (sine, cosine) = angle.sin_cos();
                (x[0], x[1]) = (cosine * x[0] - sine * x[1], sine * x[0] + cosine * x[1]);
            }
        }
        let cutter = SegmentCutter::of_mesh(&mesh);
        let beyond = Vector::repeat(0.75);
        assert!(!cutter.is_convex_around(&[beyond]));
        cutter.is_convex_around(&mesh.nodes)
    }

    #[test]
    fn no_bond_leaves_a_convex_body() {
        for is_simplicial in [false, true] {
            for angle in [0.0, 0.3, 2.0] {
                assert!(convex::<2>(false, is_simplicial, angle));
                assert!(convex::<3>(false, is_simplicial, angle));
                assert!(!convex::<2>(true, is_simplicial, angle));
                assert!(!convex::<3>(true, is_simplicial, angle));
            }
        }
    }

    #[test]
    fn gaps_in_a_line() {
        let mut grid = Grid::new([axis(10)]);
        let mesh = grid
            .cut_out(CutOut {
                name: "gap".into(),
                min: Vector::from([0.0]),
                max: Vector::from([0.1]),
            })
            .mesh()
            .unwrap();
        let cutter = SegmentCutter::of_mesh(&mesh);
        let cuts = |a: f64, b: f64| cutter.cuts(&Vector::from([a]), &Vector::from([b]));
        assert!(cuts(0.0, 0.1) && cuts(-0.1, 0.2) && cuts(0.2, 0.0));
        assert!(!cuts(-0.1, 0.0) && !cuts(0.1, 0.2) && !cuts(-0.5, 0.0));
    }

    /// A round hole of a real mesh: a chord is cut iff the polygon of its edges covers a part of it.
    #[test]
    fn the_lug_is_cut_at_its_hole_and_outline() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes/lug.msh");
        let mesh = super::super::read::read::<2>(&path).unwrap();
        let cutter = SegmentCutter::of_mesh(&mesh);
        let hole = mesh.locate_facets(&mesh.facet_sets["hole"]).unwrap();
        let mut rim: Vec<Vector<2>> = hole
            .iter()
            .map(|f| mesh.nodes[f.nodes[0] as usize])
            .collect();
        rim.sort_unstable_by(|a, b| a.y.atan2(a.x).total_cmp(&b.y.atan2(b.x)));
        let void = Barrier::Void(Shape::Polygon(rim));
        let near: Vec<Vector<2>> = mesh
            .nodes
            .iter()
            .copied()
            .filter(|x| x.norm() < 0.33)
            .collect();
        let mut cuts = 0;
        for a in near.iter().step_by(3) {
            for b in &near {
                if a != b && (a - b).norm() < 0.15 {
                    assert_eq!(cutter.cuts(a, b), void.cuts(a, b), "{a} {b}");
                    cuts += usize::from(void.cuts(a, b));
                }
            }
        }
        assert!(cuts > 100, "{cuts}");
        // across the rounded end: a chord between two of its nodes stays in the convex outline
        let at = |x: f64, y: f64| Vector::<2>::from([x, y]);
        assert!(!cutter.cuts(&at(0.55, 0.1), &at(0.5, 0.2)));
        assert!(!cutter.near(&at(-0.9, 0.0), 0.3));
    }
}
