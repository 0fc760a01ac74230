//! Surfaces that may touch: facets, and the places that are kept out of them.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::assembly::Transfer;
use crate::parallel;
use crate::tensor::Vector;

/// Cosine between the outward normals of two surfaces above which they do not press on each other.
pub(super) const FACING: f64 = -0.1;

/// Depth beyond which a place of the same body is no longer pushed out, over the smaller size of the cells on both sides: it may have come in from the other side.
const DEEPEST: f64 = 0.5;

/// Number of no facet.
pub(super) const NONE: u32 = u32::MAX;

/// Radius along the surface, in sizes of a facet, within which facets do not touch: they are neighbours.
const NEIGHBOURS: f64 = 2.5;

/// A plane piece of a surface: a point in 1D, a segment in 2D, a triangle in 3D.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facet<const D: usize> {
    /// Its corners, ordered so that [`normal`] points out of the body.
    pub corners: [u32; D],
    /// Its size: the thickness of the cell behind it \[m\].
    pub size: f64,
    /// `C₁₁` over its size \[N/m^(D+1)\].
    pub stiffness: f64,
    /// The body that it belongs to.
    pub body: u32,
}

/// A place that facets of others push out: a quadrature point of a facet, or a peridynamic point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Area that it stands for at rest [m^(D−1)].
    pub area: f64,
    /// `C₁₁` over its size \[N/m^(D+1)\].
    pub stiffness: f64,
    /// Distance by which the body extends beyond it \[m\].
    pub clearance: f64,
    /// Size of the cell behind it \[m\].
    pub size: f64,
    /// The facet that it lies on; [`NONE`] of a point.
    pub facet: u32,
    /// The body that it belongs to.
    pub body: u32,
}

/// Surfaces that may touch.
#[derive(Debug)]
pub(super) struct Surface<const D: usize> {
    /// Corners of facets at rest \[m\], and their displacements by those of sites.
    pub corners: Vec<Vector<D>>,
    pub corner_rows: Transfer,
    pub facets: Vec<Facet<D>>,
    /// Places in the order of their facets, points last; their positions at rest \[m\] and their displacements by those of sites.
    pub places: Vec<Place>,
    pub rest: Vec<Vector<D>>,
    pub place_rows: Transfer,
    /// Facets around each corner: where those of each begin, and their numbers.
    around: (Vec<u32>, Vec<u32>),
    /// In 1D, where corners have no order: the outward direction of each facet.
    pub outward: Vec<f64>,
    /// Extent at rest of the body of each facet along its normal \[m\].
    thickness: Vec<f64>,
    /// The first facet on a crack.
    pub cracks_from: u32,
    /// Depth up to which places are pushed out of another body and of the faces of cracks, which have none behind them, over the size of cells.
    pub deepest: f64,
    /// Distance at rest from a facet of its own body up to which a point does not touch it \[m\]: bonds hold it.
    pub horizon: f64,
}

impl<const D: usize> Surface<D> {
    /// Surfaces of facets by the rows of their corners, and of places in the order of their facets, by rows too. Each row has the position at rest.
    pub fn new(
        corners: (Vec<Vector<D>>, Transfer),
        facets: Vec<Facet<D>>,
        outward: Vec<f64>,
        places: (Vec<Place>, Vec<Vector<D>>, Transfer),
        (cracks_from, deepest): (u32, f64),
        horizon: f64,
    ) -> Self {
        let mut starts = vec![0_u32; corners.0.len() + 1];
        for facet in &facets {
            for &c in &facet.corners {
                starts[c as usize + 1] += 1;
            }
        }
        for c in 0..corners.0.len() {
            starts[c + 1] += starts[c];
        }
        let mut next = starts.clone();
        let mut around = vec![0; facets.len() * D];
        for (f, facet) in facets.iter().enumerate() {
            for &c in &facet.corners {
                around[next[c as usize] as usize] = f as u32;
                next[c as usize] += 1;
            }
        }
        let mut surface = Self {
            corners: corners.0,
            corner_rows: corners.1,
            facets,
            outward,
            thickness: Vec::new(),
            places: places.0,
            rest: places.1,
            place_rows: places.2,
            around: (starts, around),
            cracks_from,
            deepest,
            horizon,
        };
        surface.thickness = surface.thickness_of_bodies();
        surface
    }

    /// The extent of the body of each facet along its normal, by those of its corners that come first in a number of directions.
    fn thickness_of_bodies(&self) -> Vec<f64> {
        let each = (0..5_usize.pow(D as u32))
            .map(|k| Vector::<D>::from_fn(|a, _| (k / 5_usize.pow(a as u32) % 5) as f64 - 2.0));
        let directions: Vec<Vector<D>> = each.collect();
        let mut first: FxHashMap<u32, Vec<Vector<D>>> = FxHashMap::default();
        for facet in &self.facets {
            for x in facet.corners.map(|c| self.corners[c as usize]) {
                let own = first
                    .entry(facet.body)
                    .or_insert_with(|| vec![x; directions.len()]);
                for (first, direction) in own.iter_mut().zip(&directions) {
                    if x.dot(direction) > first.dot(direction) {
                        *first = x;
                    }
                }
            }
        }
        parallel::map(self.facets.len(), 64, |f| {
            let normal = self.normal(f as u32, &self.corners);
            let along = first[&self.facets[f].body].iter().map(|x| x.dot(&normal));
            let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            });
            high - low
        })
    }

    /// Depth inside a facet up to which a place is pushed out of it \[m\].
    pub fn reach_in(&self, place: &Place, facet: u32) -> f64 {
        let is_of_crack = place.facet != NONE && place.facet >= self.cracks_from;
        let other = &self.facets[facet as usize];
        let size = place.size.min(other.size);
        match (is_of_crack, place.body != other.body) {
            // what lies deeper than the body is thick lies before its other side
            (_, true) => (self.deepest * size).min(self.thickness[facet as usize]),
            (true, _) => self.deepest * size,
            _ => DEEPEST * size,
        }
    }

    /// Corners of a facet where corners are `at`.
    #[inline]
    pub fn corners_of(&self, facet: u32, at: &[Vector<D>]) -> [Vector<D>; D] {
        self.facets[facet as usize].corners.map(|c| at[c as usize])
    }

    /// Outward unit normal of a facet where corners are `at`; zero of one that has no area.
    #[inline]
    pub fn normal(&self, facet: u32, at: &[Vector<D>]) -> Vector<D> {
        if D == 1 {
            return Vector::repeat(self.outward[facet as usize]);
        }
        let normal = normal(&self.corners_of(facet, at));
        let length = normal.norm();
        if length > 0.0 {
            normal / length
        } else {
            normal
        }
    }

    /// Returns true if two facets of one body are neighbours: the way along the surface from one to the other is short.
    pub fn are_neighbours(&self, from: u32, to: u32) -> bool {
        if self.facets[from as usize].body != self.facets[to as usize].body {
            return false;
        }
        let middle = |f: u32| {
            let corners = self.corners_of(f, &self.corners);
            corners.iter().sum::<Vector<D>>() / D as f64
        };
        let size = |f: u32| self.facets[f as usize].size;
        let reach = NEIGHBOURS * size(from).max(size(to));
        let start = middle(from);
        let mut met = FxHashSet::from_iter([from]);
        let mut open = vec![from];
        while let Some(f) = open.pop() {
            for &c in &self.facets[f as usize].corners {
                let (starts, around) = &self.around;
                let range = starts[c as usize] as usize..starts[c as usize + 1] as usize;
                for &next in &around[range] {
                    if next == to {
                        return true;
                    }
                    if (middle(next) - start).norm() <= reach && met.insert(next) {
                        open.push(next);
                    }
                }
            }
        }
        false
    }
}

/// Length or area of a facet; 1 for a point.
pub(super) fn area<const D: usize>(corners: &[Vector<D>; D]) -> f64 {
    match D {
        1 => 1.0,
        2 => normal(corners).norm(),
        _ => 0.5 * normal(corners).norm(),
    }
}

/// Normal of a facet whose corners run counter-clockwise seen from outside, of any length; zero in 1D.
pub(super) fn normal<const D: usize>(corners: &[Vector<D>; D]) -> Vector<D> {
    let mut normal = Vector::zeros();
    match D {
        2 => {
            let edge = corners[1] - corners[0];
            (normal[0], normal[1]) = (edge[1], -edge[0]);
        }
        3 => {
            let (p, q) = (corners[1] - corners[0], corners[2] - corners[0]);
            for a in 0..3 {
                let (b, c) = ((a + 1) % 3, (a + 2) % 3);
                normal[a] = p[b] * q[c] - p[c] * q[b];
            }
        }
        _ => {}
    }
    normal
}
