//! The pieces of bonds inside of the peridynamic zone: their ends, their stiffness, and their contributions to dilatations.

use rustc_hash::{FxHashMap, FxHashSet};

use super::seam::{Foot, Seam};
use crate::coupling::truncated::piece::{Course, Piece};
use crate::{
    model::{Model, SiteKind, continued_lattice::ContinuedLattice},
    parallel,
    peridynamics::{Mixture, PdBody},
};

const NONE: u32 = u32::MAX;

/// An end of a piece.
#[derive(Clone, Debug)]
pub(super) enum End {
    /// The point at which the bond ends, by its number in the cloud.
    Point(u32),
    /// A place on the faces.
    Face(Foot),
}

/// A piece of the bond from point `i` to point `j` of the cloud.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    pub i: u32,
    pub j: u32,
    pub piece: Piece,
    pub ends: [End; 2],
    /// Stiffness of the energy `½ k (ξ·η)²` of its whole bond.
    pub stiffness: f64,
    /// Factor of its energy: 1 where the seam follows the lattice.
    pub scale: f64,
    /// Factors of its elongation in the dilatations at its ends.
    pub hands: [f64; 2],
}

/// Changes by a fit of a whole bond's energy, and of the factors of its elongation in the dilatations at its ends.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Changed {
    pub scale: f64,
    pub hands: [f64; 2],
}

/// Whole bonds, and the pieces of all others.
#[derive(Clone)]
pub(super) struct Segments<'a, const D: usize> {
    pub model: &'a Model<D>,
    pub body: &'a PdBody<D>,
    pub passing: &'a ContinuedLattice<D>,
    /// Site of each point of the cloud; `u32::MAX` for a point in an element.
    pub site: Vec<u32>,
    /// Pieces of bonds that leave the zone or pass through it.
    pub cut: Vec<Segment>,
    /// Bonds between points of the zone that leave it in between, lower number first.
    pub broken: FxHashSet<(u32, u32)>,
    /// For each point, true if it has a bond that is not whole, or one that a fit has changed.
    pub at_seam: Vec<bool>,
    /// Whole bonds that a fit has changed, lower number first.
    pub changed: FxHashMap<(u32, u32), Changed>,
    /// Factor of the volume of a point whose bonds a fit has changed, in the energy of its dilatation.
    pub volume: FxHashMap<u32, f64>,
    /// True if a fit has made the energy of an LPS a sum of squares.
    pub is_squares: bool,
}

impl<'a, const D: usize> Segments<'a, D> {
    /// Cuts all bonds near the seam.
    pub fn new(model: &'a Model<D>, body: &'a PdBody<D>, passing: &'a ContinuedLattice<D>) -> Self {
        let cloud = &body.cloud;
        let mut site = vec![NONE; cloud.position.len()];
        for (s, of) in model.sites.iter().enumerate() {
            if let SiteKind::Point(p) = of.kind {
                site[p as usize] = s as u32;
            }
        }
        let seams: Vec<Seam<'_, D>> = (0..passing.whole.len())
            .map(|l| {
                let points = 0..passing.of_point.len();
                let own = points.filter(|&i| usize::from(passing.of_point[i]) == l);
                let horizon = own.map(|i| cloud.horizon.of(i)).fold(0.0, f64::max);
                let longest = model
                    .peridynamics
                    .as_ref()
                    .map_or(horizon, |p| p.reach(horizon));
                Seam::new(model, l, horizon, longest)
            })
            .collect();
        let ends = Ends {
            site: &site,
            body,
            passing,
            several: model.several(),
        };
        let found: Vec<Cut> = parallel::map(cloud.position.len(), 1, |i| {
            let seam = &seams[usize::from(passing.of_point[i])];
            match seam.is_around(&cloud.position[i]) {
                true => ends.cut(seam, i),
                false => Cut::default(),
            }
        });
        let mut cut = Vec::with_capacity(found.iter().map(|f| f.segments.len()).sum());
        let mut broken = FxHashSet::default();
        let mut at_seam = vec![false; site.len()];
        for (i, found) in found.into_iter().enumerate() {
            for &j in &found.to {
                let is_site = [i, j as usize].map(|p| site[p] != NONE);
                at_seam[i] |= is_site[0];
                at_seam[j as usize] |= is_site[1];
                if is_site == [true; 2] {
                    broken.insert((i as u32, j));
                }
            }
            cut.extend(found.segments);
        }
        Self {
            model,
            body,
            passing,
            site,
            cut,
            broken,
            at_seam,
            changed: FxHashMap::default(),
            volume: FxHashMap::default(),
            is_squares: false,
        }
    }

    /// Adds the neighbours of the points at the seam to these.
    pub fn widen(&mut self) -> bool {
        let wide = self.with_neighbours();
        let changes = wide != self.at_seam;
        self.at_seam = wide;
        changes
    }

    /// The points at the seam, and those that a bond joins to one.
    pub fn with_neighbours(&self) -> Vec<bool> {
        let mut wide = self.at_seam.clone();
        for i in (0..wide.len()).filter(|&i| self.at_seam[i]) {
            for &j in self.body.families.of(i) {
                wide[j as usize] |= self.is_point(j);
            }
        }
        wide
    }

    /// Returns true if a point of the cloud is a site.
    pub fn is_point(&self, i: u32) -> bool {
        self.site[i as usize] != NONE
    }

    /// Returns true if the bond between two points of the cloud lies in the zone as a whole.
    pub fn is_whole(&self, i: u32, j: u32) -> bool {
        let at_seam = self.at_seam[i as usize] && self.at_seam[j as usize];
        self.is_point(i)
            && self.is_point(j)
            && !(at_seam && self.broken.contains(&(i.min(j), i.max(j))))
    }

    /// The coefficients `p` and `ω` that point `i` gives its bond to `j`; those of a whole family if it lies in an element.
    pub fn coefficients(&self, i: u32, j: u32) -> (f64, f64) {
        self.ends().coefficients(i, j)
    }

    fn ends(&self) -> Ends<'_, D> {
        Ends {
            site: &self.site,
            body: self.body,
            passing: self.passing,
            several: self.model.several(),
        }
    }

    /// Stiffness of the bond between two points over that within the first material; 1 in a body of one.
    ///
    /// A seam is laid out, and fitted, as if the body were of the first material; its springs then have those of their own bonds.
    pub fn of_materials(&self, i: u32, j: u32) -> f64 {
        self.ends().of_materials(i, j)
    }

    /// Returns the factors of the elongation of the whole bond from `i` to `j` in the dilatations of the two.
    pub fn hands(&self, i: u32, j: u32) -> [f64; 2] {
        let changed = self.changed.get(&(i.min(j), i.max(j)));
        let [a, b] = changed.map_or([0.0; 2], |c| c.hands);
        if i < j {
            [1.0 + a, 1.0 + b]
        } else {
            [1.0 + b, 1.0 + a]
        }
    }

    /// Factor of the energy of the whole bond from `i` to `j`.
    pub fn scale(&self, i: u32, j: u32) -> f64 {
        let changed = self.changed.get(&(i.min(j), i.max(j)));
        1.0 + changed.map_or(0.0, |c| c.scale)
    }

    /// Stiffness of the bond's energy `½ k (ξ·η)²`.
    pub fn stiffness(&self, i: u32, j: u32) -> f64 {
        self.ends().stiffness(i, j)
    }

    /// Sites and weights of the difference of displacement over a piece.
    pub fn difference<'s>(&'s self, segment: &'s Segment) -> impl Iterator<Item = (u32, f64)> + 's {
        let ends = segment.ends.iter().zip([-1.0, 1.0]);
        ends.flat_map(move |(end, sign)| {
            let (point, trace) = match end {
                End::Point(p) => (Some((self.site[*p as usize], sign)), &[][..]),
                End::Face(foot) => (None, &foot.trace[..]),
            };
            let trace = trace.iter().map(move |&(s, w)| (s, sign * w));
            point.into_iter().chain(trace)
        })
    }
}

/// Parts, within the zone, of the bonds of one point to points of higher numbers.
#[derive(Default)]
struct Cut {
    /// Far ends of the bonds that are not whole.
    to: Vec<u32>,
    segments: Vec<Segment>,
}

/// The points of a model, to tell what bonds between them are.
#[derive(Clone, Copy)]
struct Ends<'a, const D: usize> {
    site: &'a [u32],
    body: &'a PdBody<D>,
    passing: &'a ContinuedLattice<D>,
    several: Option<&'a dyn Mixture<D>>,
}

impl<const D: usize> Ends<'_, D> {
    /// Cuts the bonds of a point to those of higher numbers.
    fn cut(&self, seam: &Seam<'_, D>, i: usize) -> Cut {
        let position = &self.body.cloud.position;
        let is_site = |p: usize| self.site[p] != NONE;
        let family = match is_site(i) {
            true => self.body.families.of(i),
            false => self.passing.families.of(i),
        };
        let mut cut = Cut::default();
        let (mut pieces, mut near) = (Vec::new(), Vec::new());
        seam.faces_around(&position[i], &mut near);
        for &j in family.iter().filter(|&&j| j as usize > i) {
            let (a, b) = (&position[i], &position[j as usize]);
            let are_sites = [is_site(i), is_site(j as usize)];
            match seam.course(a, b, are_sites, &near) {
                Course::Inside if are_sites == [true; 2] => continue,
                Course::Outside => continue,
                Course::Unclear if !seam.near(a, b) => continue,
                Course::Unclear => seam.pieces(a, b, &near, &mut pieces),
                course => {
                    pieces.clear();
                    pieces.push(Piece::of(course, are_sites[0]));
                }
            }
            if are_sites == [true; 2] && pieces == [Piece::WHOLE] {
                continue;
            }
            cut.to.push(j);
            let end = |t: f64, point: u32, is_end: bool| match is_end && is_site(point as usize) {
                true => Some(End::Point(point)),
                false => seam.foot(&(a + (b - a) * t), &near).map(End::Face),
            };
            cut.segments.extend(pieces.iter().filter_map(|piece| {
                Some(Segment {
                    i: i as u32,
                    j,
                    piece: *piece,
                    ends: [
                        end(piece.from, i as u32, piece.from == 0.0)?,
                        end(piece.to, j, piece.to == 1.0)?,
                    ],
                    stiffness: self.stiffness(i as u32, j),
                    scale: 1.0,
                    hands: hands_of(piece),
                })
            }));
        }
        cut
    }

    /// As [`Segments::coefficients`].
    fn coefficients(&self, i: u32, j: u32) -> (f64, f64) {
        if self.site[i as usize] == NONE {
            let xi = self.body.bond(i as usize, j as usize);
            return self.passing.whole_of(i).of(&xi);
        }
        let (pair, omega) = self.body.kernel(i as usize);
        match self.body.families.of(i as usize).binary_search(&j) {
            Ok(k) if self.several.is_some() => (pair[k] / self.of_materials(i, j), 0.0),
            Ok(k) => (pair[k], omega.get(k).copied().unwrap_or(0.0)),
            Err(_) => (0.0, 0.0),
        }
    }

    /// As [`Segments::of_materials`].
    pub fn of_materials(&self, i: u32, j: u32) -> f64 {
        let material = &self.body.cloud.material;
        let scale =
            |several: &dyn Mixture<D>| several.scale(material[i as usize], material[j as usize]);
        self.several.map_or(1.0, scale)
    }

    /// As [`Segments::stiffness`].
    fn stiffness(&self, i: u32, j: u32) -> f64 {
        let volume = &self.body.cloud.volume;
        (self.coefficients(i, j).0 + self.coefficients(j, i).0)
            * volume[i as usize]
            * volume[j as usize]
    }
}

/// Returns the factors of a piece's elongation in the dilatations at its ends.
///
/// The two add up to 2, so a uniform pressure acts on it as on the whole bond. Over the pieces of parallel bonds of a lattice the surplus of the long ones cancels the deficit of the short ones, so that the dilatation of
/// an affine field is exact everywhere.
fn hands_of(piece: &Piece) -> [f64; 2] {
    let length = piece.to - piece.from;
    [
        (1.0 - 2.0 * piece.from) / length,
        (2.0 * piece.to - 1.0) / length,
    ]
}
