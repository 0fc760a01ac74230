//! Parts of a seam whose energies may change to make affine fields exact: pieces of bonds, and the whole bonds between points that have pieces.

use rustc_hash::FxHashMap;

use super::bond_segments::{End, Segments};
use super::conditions::Conditions;
use crate::{
    fem,
    model::SiteKind,
    parallel,
    tensor::{Tensor4, Vector},
};

/// Least factor of the energy of a piece; the largest was 4 where this one was asked for.
pub(super) const FLOOR: f64 = 0.1;

/// Tolerance after a fit on what is missing.
pub(super) const MET: f64 = 1e-10;

/// Returns the round-off that coordinates far from the origin leave of a force that is zero: some ulps of them over the spacing.
pub(super) fn rounding<const D: usize>(segments: &Segments<'_, D>) -> f64 {
    let (low, high) = segments.model.mesh.bounds();
    let farthest = low.abs().max().max(high.abs().max());
    8.0 * f64::EPSILON * farthest / segments.model.spacing()
}

/// Something whose energy may change: a piece, or a whole bond between points that have pieces.
pub(super) enum Part {
    Piece(usize),
    Bond(u32, u32),
}

/// Geometry of a part.
pub(super) struct Shape<const D: usize> {
    pub xi: Vector<D>,
    /// Its length as a fraction of the bond.
    pub length: f64,
    /// Share of the bond that it is.
    pub share: f64,
    pub difference: Vec<(u32, f64)>,
}

impl Part {
    pub fn shape<const D: usize>(&self, segments: &Segments<'_, D>) -> Shape<D> {
        match *self {
            Self::Piece(k) => {
                let s = &segments.cut[k];
                Shape {
                    xi: segments.body.bond(s.i as usize, s.j as usize),
                    length: s.piece.to - s.piece.from,
                    share: s.piece.share,
                    difference: segments.difference(s).collect(),
                }
            }
            Self::Bond(i, j) => Shape {
                xi: segments.body.bond(i as usize, j as usize),
                length: 1.0,
                share: 1.0,
                difference: vec![
                    (segments.site[i as usize], -1.0),
                    (segments.site[j as usize], 1.0),
                ],
            },
        }
    }

    pub fn points<const D: usize>(&self, segments: &Segments<'_, D>) -> (u32, u32) {
        match *self {
            Self::Piece(k) => (segments.cut[k].i, segments.cut[k].j),
            Self::Bond(i, j) => (i, j),
        }
    }

    pub fn end<const D: usize>(&self, segments: &Segments<'_, D>, side: usize) -> End {
        match *self {
            Self::Piece(k) => segments.cut[k].ends[side].clone(),
            Self::Bond(i, j) => End::Point([i, j][side]),
        }
    }

    /// Returns the factors of its elongation in the dilatations at its two ends.
    pub fn hands<const D: usize>(&self, segments: &Segments<'_, D>) -> [f64; 2] {
        match *self {
            Self::Piece(k) => segments.cut[k].hands,
            Self::Bond(i, j) => segments.hands(i, j),
        }
    }

    pub fn add_hands<const D: usize>(&self, segments: &mut Segments<'_, D>, change: [f64; 2]) {
        let hands = match *self {
            Self::Piece(k) => &mut segments.cut[k].hands,
            Self::Bond(i, j) => &mut segments.changed.entry((i, j)).or_default().hands,
        };
        for (h, c) in hands.iter_mut().zip(change) {
            *h += c;
        }
    }
}

/// The area of the largest face that loads a node; of a cell of the lattice where the points at the seam lack bonds all along it, as those of a thin plate do, and no node is loaded.
pub(super) fn largest_face<const D: usize>(
    segments: &Segments<'_, D>,
    nodes: &FxHashMap<u32, Vector<D>>,
) -> f64 {
    match nodes.is_empty() {
        true => segments.model.spacing().powi(D as i32 - 1),
        false => nodes.values().map(|b| b.norm()).fold(0.0, f64::max),
    }
}

/// Integrals of the gradient of the shape functions of the nodes at the seam over the elements around them, without nodes from whose faces bonds are missing.
pub(super) fn loaded_nodes<const D: usize>(
    segments: &Segments<'_, D>,
) -> FxHashMap<u32, Vector<D>> {
    let model = segments.model;
    let full = segments.passing.whole[0].bonds().count();
    let mut at_face = vec![false; model.sites.len()];
    let mut is_dropped = at_face.clone();
    for s in &segments.cut {
        let lacks =
            |&p: &u32| segments.is_point(p) && segments.body.families.of(p as usize).len() < full;
        let is_broken = [s.i, s.j].iter().any(lacks);
        for end in &s.ends {
            let End::Face(foot) = end else { continue };
            for &(site, _) in &foot.trace {
                at_face[site as usize] = true;
                is_dropped[site as usize] |= is_broken;
            }
        }
    }
    let integral = |site: usize| {
        let mut sum = Vector::<D>::zeros();
        let mut add = |c: usize, local: usize, part: f64| {
            if model.is_element(c) {
                fem::for_each_point(&model.mesh, c, fem::Rule::Stiffness, |p| {
                    sum += p.gradient[local] * (p.weight * part);
                });
            }
        };
        model
            .cells_of_site(site)
            .for_each(|(c, local)| add(c, local, 1.0));
        for &(follower, part) in model.followers_of_site(site) {
            let cells = model.cells_of_node(follower);
            cells.for_each(|(c, local)| add(c, local, part));
        }
        sum
    };
    // the surface of the body loads the nodes of an element that it cuts
    let is_cut = |c: usize| model.mesh.embedded.pieces.contains_key(&(c as u32));
    let is_at_surface = |site: usize| {
        let mut own = model.cells_of_site(site);
        let mut followers = model.followers_of_site(site).iter();
        own.any(|(c, _)| is_cut(c))
            || followers.any(|&(n, _)| model.cells_of_node(n).any(|(c, _)| is_cut(c)))
    };
    let is_loaded = |site: usize| {
        let is_node = matches!(model.sites[site].kind, SiteKind::Node(_));
        is_node && at_face[site] && !is_dropped[site] && !is_at_surface(site)
    };
    let loads = parallel::filter_map(model.sites.len(), 1, |site| {
        is_loaded(site).then(|| (site as u32, integral(site)))
    });
    loads.into_iter().collect()
}

/// The fourth moments of the lattice's pairwise part.
pub(super) fn pair_tensor<const D: usize>(segments: &Segments<'_, D>) -> Tensor4<D> {
    let h = segments.model.spacing();
    let mut tensor = Tensor4::zeros();
    for (offset, (pair, _)) in segments.passing.whole[0].bonds() {
        let xi = Vector::from_fn(|i, _| f64::from(offset[i]) * h);
        tensor.add_fourth_power(pair * segments.model.typical_volume(), &xi);
    }
    tensor
}

/// Components of a symmetric tensor of third order in 3D.
pub(super) const MOST_TRIPLES: usize = 10;

/// The components `i ≤ j ≤ k` of a symmetric tensor of third order.
pub(super) fn triples<const D: usize>() -> impl Iterator<Item = [usize; 3]> {
    (0..D).flat_map(|i| (i..D).flat_map(move |j| (j..D).map(move |k| [i, j, k])))
}

/// The components of `factor ξ⊗ξ⊗ξ`, as many as [`triples`] gives.
pub(super) fn cube<const D: usize>(xi: &Vector<D>, factor: f64) -> [f64; MOST_TRIPLES] {
    let mut cube = [0.0; MOST_TRIPLES];
    for (c, [i, j, k]) in cube.iter_mut().zip(triples::<D>()) {
        *c = factor * xi[i] * xi[j] * xi[k];
    }
    cube
}

/// `C_ijkl b_l`.
pub(super) fn third<const D: usize>(
    b: &Vector<D>,
    tensor: &Tensor4<D>,
) -> impl Iterator<Item = f64> {
    triples::<D>().map(|[i, j, k]| (0..D).map(|l| tensor.get(i, j, k, l) * b[l]).sum())
}

/// All pieces, and the whole bonds between points at the seam.
pub(super) fn parts<const D: usize>(segments: &Segments<'_, D>) -> Vec<Part> {
    let mut parts: Vec<Part> = (0..segments.cut.len()).map(Part::Piece).collect();
    for i in (0..segments.site.len()).filter(|&i| segments.at_seam[i]) {
        for &j in segments.body.families.of(i) {
            let i = i as u32;
            if j > i && segments.at_seam[j as usize] && segments.is_whole(i, j) {
                parts.push(Part::Bond(i, j));
            }
        }
    }
    parts
}

/// The smallest change, and the largest component that it leaves.
pub(super) fn finish(conditions: &Conditions, target: &[f64], floor: f64) -> (Vec<f64>, f64) {
    let change = conditions.least_change(target, floor);
    let left = conditions
        .sum(&change)
        .iter()
        .zip(target)
        .map(|(s, t)| (t - s).abs())
        .fold(0.0, f64::max);
    (change, left)
}

pub(super) fn points_at_seam<'b, const D: usize>(
    segments: &'b Segments<'_, D>,
) -> impl Iterator<Item = u32> + 'b {
    (0..segments.site.len() as u32).filter(|&p| segments.at_seam[p as usize])
}
