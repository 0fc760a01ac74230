//! Energy taken by the bonds that a pass broke: energy stored before less that stored after, at a displacement of choice.

use super::lattice::Lattice;
use super::list::{extension, stretched};
use super::simd::LANES;
use crate::peridynamics::bond_force::bond_list::List;
use crate::system::ExactSum;

impl<const D: usize> Lattice<D> {
    /// Directed bonds that the last pass took stiffness from: group, lane and offset, by point, and the part of it.
    pub(super) fn last(&self) -> Vec<(usize, usize, usize, f64)> {
        if let Some(softened) = &self.softened {
            let losses = softened.losses.iter();
            let of_loss = losses.map(|loss| {
                let place = self.place[loss.bond.near as usize] as usize;
                (
                    place / LANES,
                    place % LANES,
                    loss.bond.slot as usize,
                    loss.part,
                )
            });
            return of_loss.collect();
        }
        let mut bonds = Vec::with_capacity(self.broken.len());
        for b in &self.broken {
            let lanes = (0..LANES).filter(|lane| b.lanes >> lane & 1 == 1);
            bonds.extend(lanes.map(|lane| (b.group as usize, lane, b.offset as usize, 1.0)));
        }
        bonds.sort_unstable_by_key(|b| (b.0, b.1, b.2));
        bonds
    }

    /// Relative extension of the bond from a cell along an offset, and the relative volume of its far end.
    fn extension<const EXACT: bool>(
        &self,
        at: &dyn Fn(usize) -> [f64; D],
        cell: usize,
        offset: usize,
    ) -> (f64, f64) {
        let o = &self.stencil.offsets[offset];
        let there = (cell as isize + o.delta) as usize;
        let point = |cell: usize| at(self.stencil.point_of[cell] as usize);
        let s = stretched::<D, EXACT>(&o.xi, &point(cell), &point(there));
        (extension::<EXACT>(s.t()), self.volume[there])
    }

    pub(super) fn lost<const EXACT: bool>(
        &self,
        at: &dyn Fn(usize) -> [f64; D],
        lost: &mut ExactSum,
    ) {
        for bonds in self.last().chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let (g, lane, ..) = bonds[0];
            let cell = self.stencil.groups[g] as usize + lane;
            let point = self.stencil.point_of[cell] as usize;
            let volume = self.scale.get(point).copied().unwrap_or(self.unit);
            if volume == 0.0 {
                continue;
            }
            let moments = |offset: usize| {
                let (e, v) = self.extension::<EXACT>(at, cell, offset);
                let w = self.stencil.offsets[offset].moment * v * e;
                (w, w * e)
            };
            let (mut first, mut second) = (0.0, 0.0);
            for &(_, _, offset, part) in bonds {
                let (a, b) = moments(offset);
                (first, second) = (first + part * a, second + part * b);
            }
            let of_point = volume
                * match &self.solid {
                    None => 0.25 * second,
                    Some(s) => {
                        let mut left = 0.0;
                        self.each_left(g, lane, |o, part| left += part * moments(o).0);
                        let d = s.dilatation[g][lane];
                        // ½ K′ θ² with θ = d Σ, where K′ d = volumetric
                        let bulk = s.volumetric[g][lane] * d;
                        0.5 * (bulk * first * (first + 2.0 * left) + s.deviatoric[cell] * second)
                    }
                };
            lost.add(of_point);
        }
    }
}

impl<const D: usize> List<D> {
    pub(super) fn lost<const EXACT: bool>(
        &self,
        at: &dyn Fn(usize) -> [f64; D],
        lost: &mut ExactSum,
    ) {
        for bonds in self.losses().chunk_by(|a, b| a.0 == b.0) {
            let i = bonds[0].0 as usize;
            if !self.row[i] {
                continue;
            }
            let here = at(i);
            let moments = |bond: usize| {
                let j = self.neighbours.get(i, bond);
                let s = stretched::<D, EXACT>(&self.xi(i, j), &here, &at(j));
                let e = extension::<EXACT>(s.t());
                let w = self.weights.get(bond) * s.length * self.volume[j] * e;
                (w, w * e)
            };
            let (mut first, mut second) = (0.0, 0.0);
            for &(_, bond, part) in bonds {
                let (a, b) = moments(bond);
                (first, second) = (first + part * a, second + part * b);
            }
            let of_point = self.volume[i]
                * match &self.solid {
                    None => 0.25 * second,
                    Some(c) => {
                        let family = self.offsets[i]..self.offsets[i + 1];
                        let left: f64 = family
                            .map(|bond| (self.left_of(i, bond)[1], bond))
                            .filter(|(left, _)| *left > 0.0)
                            .map(|(left, bond)| left * moments(bond).0)
                            .sum();
                        let bulk = c.volumetric[i] * c.dilatation[i];
                        0.5 * (bulk * first * (first + 2.0 * left) + c.deviatoric[i] * second)
                    }
                };
            lost.add(of_point);
        }
    }
}
