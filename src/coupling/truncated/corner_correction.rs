//! Strings along the edges of a zone in 3D, which take away what is left at its corners.
//!
//! On the faces and edges of a zone that follows the lattice, sums over the ends of bonds are integrals. At a corner they are not: a bond that passes exactly through it is counted whole or not at all where
//! the integrals over the three faces take quarters, and the ends on the three faces keep apart by sums of Dedekind's kind. What is left, of all bonds `(a, b, c)` of the lattice with three components,
//! is an octopole: under `u = G x` the force
//!
//! ```text
//! R_i = ± q (G_jl + G_lj) ,   i, j, l distinct,   q = 4 h³ Σ_{a,b,c>0} X(a,b,c) k(a,b,c) a b c
//! ```
//!
//! on the corner's node, with the sign of the product of the three outward normals, the stiffness k of a bond with the energy `½ k (ξ·η)²`, and X of `excess`. It adds up to zero over the zone, but not at any corner, so nothing at a corner alone can balance it. The energy
//!
//! ```text
//! − q ∫ (∂_s u · n₁)(∂_s u · n₂) ds
//! ```
//!
//! along every edge of the zone (n₁, n₂ the outward normals of its faces; with the other sign along a re-entrant edge) does: under an affine field its line is in equilibrium but for the ends, and three edges that meet at a
//! corner leave exactly `−R` there. It is symmetric, sparse, and moves no force but along edges. Its sign depends on the field, so that
//! a model with strings is definite only if its matrix is ([`super::super::Definiteness::EdgeTerms`]).

use std::collections::{HashMap, HashSet};

use super::{
    bond_segments::Segments,
    seam::{Side, sides},
};
use crate::{
    assembly::{Centre, Row},
    mesh::Mesh,
    model::bond_cutting::WholeFamily,
    tensor::{Tensor, Vector},
};

/// A string between two sites, by the block that their difference is multiplied by.
#[derive(Clone, Debug)]
struct Line<const D: usize> {
    sites: [u32; 2],
    block: Tensor<D>,
}

/// All strings of a model.
pub(super) struct EdgeCorrection<const D: usize> {
    list: Vec<Line<D>>,
    of_site: HashMap<u32, Vec<u32>>,
}

/// Tolerance on the alignment of an edge with the lattice.
const ALIGNED: f64 = 1e-6;

/// An edge of the faces that close a zone, with the normal and the centre of each face at it.
type FaceEdge<const D: usize> = ([u32; 2], Vec<(Vector<D>, Vector<D>)>);

/// The edges of the faces at which bonds end, by their nodes.
fn edges_of_faces<const D: usize>(mesh: &Mesh<D>, side: &[Side]) -> Vec<FaceEdge<D>> {
    let mut faces: HashMap<[u32; 2], Vec<(Vector<D>, Vector<D>)>> = HashMap::new();
    let seam = mesh.interface_facets(side, &Side::Points, &Side::Element);
    let seam = seam.into_iter().map(|facet| facet.first);
    // where a zone ends at the boundary of the mesh, its edges there close the frame: an open string would turn under a rotation
    let outer = mesh.outer_facets().into_iter();
    for facet in seam.chain(outer.filter(|f| side[f.cell as usize] == Side::Points)) {
        let area = mesh.facet_normal_area(&facet);
        let n = &facet.nodes;
        let centre = n.iter().map(|&n| mesh.nodes[n as usize]).sum::<Vector<D>>() / n.len() as f64;
        for k in 0..n.len() {
            let (a, b) = (n[k], n[(k + 1) % n.len()]);
            faces
                .entry([a.min(b), a.max(b)])
                .or_default()
                .push((area / area.norm(), centre));
        }
    }
    let mut edges: Vec<_> = faces.into_iter().collect();
    edges.sort_unstable_by_key(|e| e.0);
    edges
}

impl<const D: usize> EdgeCorrection<D> {
    /// The strings along the edges where two faces of a zone meet at a right angle, in 3D, on a lattice that is its own mirror image in both faces.
    pub fn new(segments: &Segments<'_, D>) -> Self {
        let mut strings = Self::none();
        if D == 3 {
            for lattice in 0..segments.passing.whole.len() {
                strings.add_lattice(segments, lattice);
            }
            strings.drop_open(segments);
        }
        strings
    }

    /// Drops the frames of zones that a surface off the planes of the lattice cuts: open there, they would turn under a rotation. Octopoles are left at their corners.
    fn drop_open(&mut self, segments: &Segments<'_, D>) {
        let model = segments.model;
        let cut = model.mesh.embedded.pieces.keys();
        let nodes = cut.flat_map(|&c| model.mesh.corners(c as usize));
        let sites = nodes.flat_map(|&n| model.node_transfer.row(n as usize).map(|(s, _)| s));
        let mut rest: Vec<u32> = sites.collect();
        let mut open = HashSet::new();
        while let Some(site) = rest.pop() {
            if open.insert(site) {
                let strings = self.of_site.get(&site).into_iter().flatten();
                rest.extend(strings.flat_map(|&s| self.list[s as usize].sites));
            }
        }
        self.of_site.retain(|site, _| !open.contains(site));
    }

    fn add_lattice(&mut self, segments: &Segments<'_, D>, lattice: usize) {
        let strings = self;
        let model = segments.model;
        let mesh = &model.mesh;
        let whole = &segments.passing.whole[lattice];
        let h = whole.spacing;
        let mut of_point = segments.passing.of_point.iter();
        let Some(first) = of_point.position(|&l| usize::from(l) == lattice) else {
            return;
        };
        let origin = &segments.body.cloud.position[first];
        let side = sides(model, lattice);
        let edges = edges_of_faces(mesh, &side);
        let mut known: HashMap<bool, f64> = HashMap::new();
        for (nodes, faces) in edges {
            let [(n, _), (m, beyond)] = faces.as_slice() else {
                continue;
            };
            if n.dot(m).abs() > ALIGNED {
                continue;
            }
            let x = nodes.map(|n| mesh.nodes[n as usize]);
            let along = x[1] - x[0];
            let length = along.norm();
            let on_axis = |v: &Vector<D>| (v.amax() - v.norm()).abs() <= ALIGNED * v.norm();
            if !(on_axis(n) && on_axis(m) && on_axis(&along)) {
                continue;
            }
            // where the lattice lies relative to the edge: halfway, or on it
            let offset = (x[0] - origin) / h;
            let half = |o: f64| (o - o.floor() - 0.5).abs() <= ALIGNED;
            let aligned = |o: f64| (o - o.round()).abs() <= ALIGNED;
            let between = if offset.iter().all(|&o| half(o)) {
                true
            } else if offset.iter().all(|&o| aligned(o)) {
                false
            } else {
                continue;
            };
            let strength = *known
                .entry(between)
                .or_insert_with(|| octopole(whole, if between { 0.5 } else { 1.0 }));
            // at an outward edge the second face lies behind the first
            let sign = if n.dot(&(beyond - x[0])) < 0.0 {
                1.0
            } else {
                -1.0
            };
            let sites: Vec<u32> = nodes
                .iter()
                .flat_map(|&n| model.node_transfer.row(n as usize).map(|(s, _)| s))
                .collect();
            let [a, b] = sites.as_slice() else { continue };
            let number = strings.list.len() as u32;
            strings.list.push(Line {
                sites: [*a, *b],
                block: (n * m.transpose() + m * n.transpose()) * (-sign * strength / length),
            });
            for s in [a, b] {
                strings.of_site.entry(*s).or_default().push(number);
            }
        }
    }

    /// None.
    pub fn none() -> Self {
        Self {
            list: Vec::new(),
            of_site: HashMap::new(),
        }
    }

    /// Returns true if there are no strings.
    pub fn is_empty(&self) -> bool {
        self.of_site.is_empty()
    }

    /// Returns true if a string ends at a site.
    pub fn holds(&self, site: u32) -> bool {
        self.of_site.contains_key(&site)
    }

    /// Adds the row of a site.
    pub fn add_row(&self, site: usize, row: &mut Row<D>) {
        for &s in self.of_site.get(&(site as u32)).into_iter().flatten() {
            let string = &self.list[s as usize];
            let add = |row: &mut Row<D>| {
                for other in string.sites {
                    if other as usize == site {
                        row.add_site(other, &string.block);
                    } else {
                        row.add_site(other, &(-string.block));
                    }
                }
            };
            row.part(|| Some(Centre::Site(string.sites[0])), add);
        }
    }
}

/// `q`, the strength of what is left at a corner; the lattice's points lie `shift` spacings and more inside of the faces.
fn octopole<const D: usize>(whole: &WholeFamily<D>, shift: f64) -> f64 {
    let h = whole.spacing;
    let volume = h.powi(D as i32);
    let mut q = 0.0;
    for (offset, (pair, _)) in whole.bonds() {
        if offset.iter().all(|&k| k > 0) {
            let k = 2.0 * pair * volume * volume;
            let product: f64 = offset.iter().map(|&k| f64::from(k) * h).product();
            q += 4.0 * excess(&offset, shift) * k * product;
        }
    }
    q
}

/// X: the sum of a corner's shape function over the ends of all bonds with the offset `k` that leave an octant, less its integral over the three faces, whose ends have the density `k`.
fn excess<const D: usize>(k: &[i32; D], shift: f64) -> f64 {
    let mut sum = 0.0;
    let counts: [i32; D] = std::array::from_fn(|i| k[i] + 2);
    for index in 0..counts.iter().product::<i32>() {
        let mut rest = index;
        let start: [f64; D] = std::array::from_fn(|i| {
            let n = rest % counts[i];
            rest /= counts[i];
            f64::from(n) + shift
        });
        let t = (0..D)
            .map(|i| start[i] / f64::from(k[i]))
            .fold(f64::INFINITY, f64::min);
        if t <= 1.0 + 1e-12 {
            sum += (0..D)
                .map(|i| (1.0 - (start[i] - t * f64::from(k[i])).abs()).max(0.0))
                .product::<f64>();
        }
    }
    let quarter = 0.5f64.powi(D as i32 - 1);
    sum - quarter * k.iter().map(|&k| f64::from(k)).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_at_a_corner() {
        // counted by hand: one bond (1, 1, 1) ends at the corner itself, three faces take a quarter each
        assert!((excess(&[1, 1, 1], 0.5) - 0.25).abs() < 1e-14);
        // a lattice on the faces has the same bonds, half a spacing on
        assert!((excess(&[1, 1, 1], 1.0) - 0.25).abs() < 1e-14);
        // in 2D nothing is left: a bond through the corner is half of either face's
        for k in [[1, 1], [1, 2], [3, 2], [4, 1], [3, 3]] {
            for shift in [0.5, 1.0] {
                assert!(excess(&k, shift).abs() < 1e-13, "{k:?}");
            }
        }
        // the order of axes does not matter
        assert!((excess(&[1, 2, 3], 0.5) - excess(&[3, 1, 2], 0.5)).abs() < 1e-13);
    }
}
