//! Springs of pieces and of whole bonds, by the sites that they join.

use rustc_hash::FxHashSet;

use super::bond_segments::Segments;
use crate::assembly::Row;
use crate::coupling::truncated::piece::Piece;
use crate::tensor::Vector;
use crate::{
    assembly::Transfer,
    coupling::truncated::bond_segments::{Changed, End},
    tensor::Tensor,
};
use rustc_hash::FxHashMap;

const NONE: u32 = u32::MAX;

/// Bonds that lie in the zone as a whole and have the stiffness of the body's.
pub(super) struct WholeBonds {
    pub site: Vec<u32>,
    pub at_seam: Vec<bool>,
    /// Bonds between points of the zone that leave it in between, lower number first.
    pub broken: FxHashSet<(u32, u32)>,
    pub changed: FxHashMap<(u32, u32), Changed>,
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

/// Springs along bonds: the energy `½ k (ξ·Δu)²` of each, with `Δu = Σ w u` over sites.
pub(super) struct Springs<const D: usize> {
    pub direction: Vec<Vector<D>>,
    pub stiffness: Vec<f64>,
    pub difference: Transfer,
    pub of_site: BySite,
    /// Of the first, which are pieces or changed by a fit; the rest are whole bonds of the body.
    pub origin: Vec<Origin>,
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
    /// k of `½ k (ξ·Δu)²`.
    pub stiffness: f64,
    /// Sites and weights of `Δu`.
    pub difference: Vec<(u32, f64)>,
    pub origin: Origin,
}

/// A stiffness below this part of the largest is none.
pub(super) const ROUND_OFF: f64 = 1e-14;

impl<const D: usize> Springs<D> {
    /// Returns true if no spring has a negative stiffness, but for round-off at the horizon, where weights vanish.
    pub fn is_positive(&self) -> bool {
        let least = -ROUND_OFF * self.stiffness.iter().copied().fold(0.0, f64::max);
        self.stiffness.iter().all(|k| *k >= least)
    }

    /// All pieces, the whole bonds that a fit has changed, and the other whole bonds of the points that `listed` names.
    ///
    /// A piece of the length s, as a fraction of its bond, has the energy `s w(Δu/s)` and hence the stiffness `k/s`.
    pub fn new(segments: &Segments<'_, D>, listed: Option<&[bool]>) -> Self {
        let mut springs = Self {
            direction: Vec::new(),
            stiffness: Vec::new(),
            difference: Transfer::new(segments.model.sites.len()),
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
            springs.difference.push(segments.difference(s).collect());
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

    pub fn push_whole(&mut self, segments: &Segments<'_, D>, i: u32, j: u32) {
        self.direction
            .push(segments.body.bond(i as usize, j as usize));
        self.stiffness
            .push(segments.stiffness(i, j) * segments.scale(i, j) * segments.of_materials(i, j));
        self.difference.push(vec![
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
            row.part(
                || self.difference.heaviest(s),
                |row| row.add(&self.difference, s, &block),
            );
        }
    }
}

/// For each site the rows of a list that involve it.
#[derive(Default)]
pub(super) struct BySite {
    pub offsets: Vec<usize>,
    pub rows: Vec<u32>,
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
