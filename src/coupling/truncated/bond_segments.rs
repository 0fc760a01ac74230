//! The pieces of bonds inside of the peridynamic zone: their ends, their stiffness, and what they hand to dilatations.

use rustc_hash::{FxHashMap, FxHashSet};

use super::seam::{Course, Foot, Piece, Seam};
use crate::{
    assembly::{Row, Transfer},
    model::{Model, SiteKind, continued_lattice::ContinuedLattice},
    parallel,
    peridynamics::{Mixture, PdBody},
    tensor::{Tensor, Vector},
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

/// Which bonds are whole, and the pieces of those that are not.
#[derive(Clone)]
pub(super) struct Segments<'a, const D: usize> {
    pub model: &'a Model<D>,
    pub body: &'a PdBody<D>,
    pub passing: &'a ContinuedLattice<D>,
    /// Site of each point of the cloud; `u32::MAX` for a point in an element.
    pub site: Vec<u32>,
    /// Pieces of bonds that leave the zone or pass through it.
    pub cut: Vec<Segment>,
    /// Bonds between points of the zone that are not whole, lower number first.
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

    /// Counts the neighbours of the points at the seam as at the seam.
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
    fn of_materials(&self, i: u32, j: u32) -> f64 {
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
    fn of_materials(&self, i: u32, j: u32) -> f64 {
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
/// The two add up to 2, so a uniform pressure pulls at it as at the whole bond; over the pieces of parallel bonds of a lattice the surplus of the long ones makes up for the deficit of the short ones, so that an
/// affine field has its own dilatation everywhere.
fn hands_of(piece: &Piece) -> [f64; 2] {
    let length = piece.to - piece.from;
    [
        (1.0 - 2.0 * piece.from) / length,
        (2.0 * piece.to - 1.0) / length,
    ]
}

/// Which bonds of the body lie in the zone as a whole, and are as the body has them.
pub(super) struct WholeBonds {
    site: Vec<u32>,
    at_seam: Vec<bool>,
    /// Bonds between points of the zone that are not whole, lower number first.
    pub broken: FxHashSet<(u32, u32)>,
    changed: FxHashMap<(u32, u32), Changed>,
}

impl WholeBonds {
    /// Those of a seam.
    pub fn of<const D: usize>(segments: Segments<'_, D>) -> Self {
        Self {
            site: segments.site,
            at_seam: segments.at_seam,
            broken: segments.broken,
            changed: segments.changed,
        }
    }

    /// Returns true if the bond from point `i` of the zone to point `j` is one of them.
    pub fn contains(&self, i: usize, j: usize) -> bool {
        if self.site[j] == NONE {
            return false;
        }
        let bond = (i.min(j) as u32, i.max(j) as u32);
        let at_seam = self.at_seam[i] && self.at_seam[j];
        !(at_seam && (self.broken.contains(&bond) || self.changed.contains_key(&bond)))
    }
}

/// Springs along bonds: the energy `½ k (ξ·D)²` of each, with `D = Σ w u`.
pub(super) struct Springs<const D: usize> {
    direction: Vec<Vector<D>>,
    stiffness: Vec<f64>,
    difference: Transfer,
    of_site: BySite,
    /// Of the first, which are pieces or changed by a fit; the rest are whole bonds of the body.
    origin: Vec<Origin>,
}

/// Origin of a spring.
#[derive(Clone, Copy, Debug)]
pub(super) struct Origin {
    /// The points of its bond.
    pub bond: [u32; 2],
    pub piece: Piece,
    /// Those of the two points that are its ends.
    pub at: [Option<u32>; 2],
}

/// A spring that is not a whole bond of the body as it is.
pub(super) struct OwnSpring<const D: usize> {
    /// ξ.
    pub direction: Vector<D>,
    /// k of `½ k (ξ·D)²`.
    pub stiffness: f64,
    /// Sites and weights of `D`.
    pub difference: Vec<(u32, f64)>,
    pub origin: Origin,
}

/// A stiffness below this part of the largest is none.
const ROUND_OFF: f64 = 1e-14;

impl<const D: usize> Springs<D> {
    /// Returns true if no spring has a negative stiffness, but for round-off at the horizon, where weights vanish.
    pub fn is_positive(&self) -> bool {
        let least = -ROUND_OFF * self.stiffness.iter().copied().fold(0.0, f64::max);
        self.stiffness.iter().all(|k| *k >= least)
    }

    /// All pieces, the whole bonds that a fit has changed, and the other whole bonds of the points that `listed` names.
    ///
    /// A piece of the length s, as a fraction of its bond, has the energy `s w(D/s)`, so the stiffness `k/s`.
    pub fn new(segments: &Segments<'_, D>, listed: Option<&[bool]>) -> Self {
        let mut springs = Self {
            direction: Vec::new(),
            stiffness: Vec::new(),
            difference: Transfer::new(),
            of_site: BySite::default(),
            origin: Vec::new(),
        };
        let body = segments.body;
        for s in &segments.cut {
            let length = s.piece.to - s.piece.from;
            springs
                .direction
                .push(body.bond(s.i as usize, s.j as usize));
            springs.stiffness.push(
                s.stiffness * s.piece.share * s.scale / length * segments.of_materials(s.i, s.j),
            );
            springs.difference.push(segments.difference(s));
            springs.origin.push(Origin {
                bond: [s.i, s.j],
                piece: s.piece,
                at: [&s.ends[0], &s.ends[1]].map(|end| match end {
                    End::Point(p) => Some(*p),
                    End::Face(_) => None,
                }),
            });
        }
        let is_changed = |i: u32, j: u32| segments.changed.contains_key(&(i, j));
        let mut changed: Vec<(u32, u32)> = segments.changed.keys().copied().collect();
        changed.sort_unstable();
        for (i, j) in changed {
            springs.push_whole(segments, i, j);
            springs.origin.push(Origin {
                bond: [i, j],
                piece: Piece {
                    from: 0.0,
                    to: 1.0,
                    share: 1.0,
                },
                at: [Some(i), Some(j)],
            });
        }
        if let Some(listed) = listed {
            for i in (0..segments.site.len() as u32).filter(|&i| segments.is_point(i)) {
                for &j in body.families.of(i as usize) {
                    let wanted = listed[i as usize] || listed[j as usize];
                    if j > i && wanted && segments.is_whole(i, j) && !is_changed(i, j) {
                        springs.push_whole(segments, i, j);
                    }
                }
            }
        }
        let rows = springs.stiffness.len();
        let difference = &springs.difference;
        springs.of_site = BySite::new(segments.model.sites.len(), rows, |s, visit| {
            difference.row(s).for_each(|(site, _)| visit(site));
        });
        springs
    }

    fn push_whole(&mut self, segments: &Segments<'_, D>, i: u32, j: u32) {
        self.direction
            .push(segments.body.bond(i as usize, j as usize));
        self.stiffness
            .push(segments.stiffness(i, j) * segments.scale(i, j) * segments.of_materials(i, j));
        self.difference.push([
            (segments.site[i as usize], -1.0),
            (segments.site[j as usize], 1.0),
        ]);
    }

    /// The springs that are not whole bonds of the body as it is.
    pub fn own(&self) -> impl Iterator<Item = OwnSpring<D>> + '_ {
        self.origin.iter().enumerate().map(|(s, origin)| OwnSpring {
            direction: self.direction[s],
            stiffness: self.stiffness[s],
            difference: self.difference.row(s).collect(),
            origin: *origin,
        })
    }

    /// Adds the row of a site.
    pub fn add_row(&self, site: usize, row: &mut Row<D>) {
        for &s in self.of_site.of(site) {
            let s = s as usize;
            let weight = self
                .difference
                .row(s)
                .find(|&(other, _)| other as usize == site)
                .map_or(0.0, |(_, w)| w);
            let xi = &self.direction[s];
            let block: Tensor<D> = xi * xi.transpose() * (self.stiffness[s] * weight);
            row.add(&self.difference, s, &block);
        }
    }
}

/// For each site the rows of a list that involve it.
#[derive(Default)]
pub(super) struct BySite {
    offsets: Vec<usize>,
    rows: Vec<u32>,
}

impl BySite {
    /// Inverts a list of rows; `sites(row, visit)` visits the sites of one, each once.
    pub fn new(count: usize, rows: usize, sites: impl Fn(usize, &mut dyn FnMut(u32))) -> Self {
        let mut offsets = vec![0usize; count + 1];
        for row in 0..rows {
            sites(row, &mut |site| offsets[site as usize + 1] += 1);
        }
        for site in 0..count {
            offsets[site + 1] += offsets[site];
        }
        let mut next = offsets.clone();
        let mut list = vec![0u32; offsets[count]];
        for row in 0..rows {
            sites(row, &mut |site| {
                list[next[site as usize]] = row as u32;
                next[site as usize] += 1;
            });
        }
        Self {
            offsets,
            rows: list,
        }
    }

    /// The rows that involve a site.
    pub fn of(&self, site: usize) -> &[u32] {
        &self.rows[self.offsets[site]..self.offsets[site + 1]]
    }
}
