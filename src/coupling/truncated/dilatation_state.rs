//! Dilatations at a seam whose bonds rotate, stretch and break.
//!
//! A part of the length s contributes its elongation, `ξ·Δu` to first order and `q = s |ξ|² ε` with its stretch ε in full. Under any homogeneous deformation q is s times that of the whole bond. A dilatation is
//! `F = Σ b·u + Σ c q` with the energy `½ κ F²`. The first sum is an element's own `∫ div u`, linear except in elements that follow the bonds (`element_dilatation.rs`).

use std::{borrow::Cow, collections::BTreeMap, sync::Arc};

use super::{
    bond_segments::Segments,
    dilatation::{Functional, carried, divergence},
    element_dilatation::ElementDilatations,
};
use crate::coupling::truncated::lps_constants::Carrier;
use crate::coupling::truncated::{
    lps_constants::{LpsConstants, stiffness_of_point},
    springs::BySite,
};
use crate::{parallel, peridynamics::bond_force::BondKinematics, tensor::Vector};

/// The dilatations of the points at the seam and of the elements behind it.
pub(super) struct States<const D: usize> {
    /// κ.
    stiffness: Vec<f64>,
    /// The site of each dilatation's point, or the first of its element.
    site: Vec<u32>,
    /// Elements' own parts: site and b, by dilatation.
    own: Vec<(u32, Vector<D>)>,
    own_of: Vec<usize>,
    /// Contributing parts with their factors, by dilatation.
    shares: Vec<(u32, f64)>,
    shares_of: Vec<usize>,
    /// The places in `shares` of each part, as dilatation and factor.
    of_part: Vec<(u32, f64)>,
    parts_of: Vec<usize>,
    /// Dilatations of which each site is an own part.
    of_site: BySite,
    /// Elements that follow the bonds, if they do, and κ of what their own energy has already and the rows take back.
    elements: Option<(ElementDilatations<D>, Vec<f64>)>,
}

/// Elements' own parts of all dilatations under a displacement: their values, and their derivatives by site.
pub(super) struct OwnParts<'a, const D: usize> {
    values: Vec<f64>,
    slopes: Cow<'a, [(u32, Vector<D>)]>,
}

impl<const D: usize> States<D> {
    /// Those of the points at the seam, whose parts are first all pieces, then the bonds of `whole`.
    pub fn new(segments: &Segments<'_, D>, common: &LpsConstants, whole: &[[u32; 2]]) -> Self {
        let body = segments.body;
        let mut shares: BTreeMap<Carrier, Vec<(u32, f64)>> = BTreeMap::new();
        let mut volumes: BTreeMap<u32, f64> = BTreeMap::new();
        for (part, s) in segments.cut.iter().enumerate() {
            common.shares(segments, s, |carrier, factor| {
                shares
                    .entry(carrier)
                    .or_default()
                    .push((part as u32, factor));
                if let Carrier::Cell(cell) = carrier {
                    *volumes.entry(cell).or_default() += carried(segments, s, factor);
                }
            });
        }
        for (bond, part) in whole.iter().zip(segments.cut.len() as u32..) {
            for (own, other) in [(bond[0], bond[1]), (bond[1], bond[0])] {
                if segments.at_seam[own as usize] {
                    let omega = segments.coefficients(own, other).1;
                    let factor =
                        segments.hands(own, other)[0] * omega * body.cloud.volume[other as usize];
                    let of = shares.entry(Carrier::Point(own)).or_default();
                    of.push((part, factor));
                }
            }
        }
        let parts = segments.cut.len() + whole.len();
        let mut states = Self {
            stiffness: Vec::new(),
            site: Vec::new(),
            own: Vec::new(),
            own_of: vec![0],
            shares: Vec::new(),
            shares_of: vec![0],
            of_part: Vec::new(),
            parts_of: vec![0; parts + 1],
            of_site: BySite::default(),
            elements: (segments.model.cauchy_born.dilatation.as_ref())
                .map(|law| (ElementDilatations::new(Arc::clone(law)), Vec::new())),
        };
        for (carrier, of) in shares {
            let first = states.own.len();
            let mut taken_back = 0.0;
            match carrier {
                Carrier::Point(i) => states.stiffness.push(stiffness_of_point(segments, i)),
                Carrier::Cell(cell) => {
                    let (own, size) = divergence(segments, cell);
                    taken_back = common.bulk / size;
                    let size = size + volumes.get(&cell).copied().unwrap_or(0.0);
                    states.stiffness.push(common.bulk / size);
                    states.own.extend(own);
                }
            }
            states.push_element(segments, first, &carrier, taken_back);
            states.own_of.push(states.own.len());
            states.shares.extend(of);
            states.shares_of.push(states.shares.len());
        }
        let mut by_part: Vec<(u32, u32, f64)> = Vec::with_capacity(states.shares.len());
        for f in 0..states.stiffness.len() {
            let of = states.shares_of(f).iter();
            by_part.extend(of.map(|&(part, c)| (part, f as u32, c)));
        }
        by_part.sort_unstable_by_key(|e| (e.0, e.1));
        for &(part, f, c) in &by_part {
            states.of_part.push((f, c));
            states.parts_of[part as usize + 1] += 1;
        }
        for part in 0..parts {
            states.parts_of[part + 1] += states.parts_of[part];
        }
        let (own, own_of) = (&states.own, &states.own_of);
        let sites = segments.model.sites.len();
        states.of_site = BySite::new(sites, states.stiffness.len(), |f, visit| {
            own[own_of[f]..own_of[f + 1]]
                .iter()
                .for_each(|e| visit(e.0));
        });
        states
    }

    /// Notes the site of the dilatation whose own part begins at `first`, and lets it follow the bonds, where elements do.
    fn push_element(
        &mut self,
        segments: &Segments<'_, D>,
        first: usize,
        carrier: &Carrier,
        taken_back: f64,
    ) {
        let (cell, site) = match carrier {
            Carrier::Point(i) => (None, Some(segments.site[*i as usize])),
            Carrier::Cell(cell) => (Some(*cell), self.own.get(first).map(|e| e.0)),
        };
        self.site.push(site.unwrap_or(u32::MAX));
        if let Some((elements, all)) = &mut self.elements {
            let sites: Vec<u32> = self.own[first..].iter().map(|e| e.0).collect();
            elements.push(segments, cell, &sites);
            all.push(taken_back);
        }
    }

    /// The site of a dilatation's point, or the first of its element.
    pub fn site_of(&self, f: usize) -> u32 {
        self.site[f]
    }

    /// The sites of an element's own part of a dilatation, with b.
    pub fn own_of(&self, f: usize) -> &[(u32, Vector<D>)] {
        &self.own[self.own_of[f]..self.own_of[f + 1]]
    }

    /// The parts that contribute to a dilatation, with their factors.
    pub fn shares_of(&self, f: usize) -> &[(u32, f64)] {
        &self.shares[self.shares_of[f]..self.shares_of[f + 1]]
    }

    /// The dilatations to which a part contributes its elongation, with their factors.
    pub fn of_part(&self, part: usize) -> &[(u32, f64)] {
        &self.of_part[self.parts_of[part]..self.parts_of[part + 1]]
    }

    /// Number of dilatations.
    pub fn count(&self) -> usize {
        self.stiffness.len()
    }

    /// Elements' own parts of the `wanted` dilatations under a displacement: `Σ b·u`, or with exact bonds what elements have that follow them.
    pub fn own_parts(
        &self,
        u: &[f64],
        kinematics: BondKinematics,
        wanted: impl Fn(usize) -> bool,
    ) -> OwnParts<'_, D> {
        let at = |site: u32| Vector::<D>::from_column_slice(&u[site as usize * D..][..D]);
        let linear = |f: usize| match wanted(f) {
            true => self.own_of(f).iter().map(|(s, b)| b.dot(&at(*s))).sum(),
            false => 0.0,
        };
        let Some((elements, _)) =
            (self.elements.as_ref()).filter(|_| kinematics == BondKinematics::Exact)
        else {
            return OwnParts {
                values: (0..self.count()).map(linear).collect(),
                slopes: Cow::Borrowed(&self.own),
            };
        };
        let mut slopes = self.own.clone();
        let values = (0..self.count())
            .map(|f| {
                if !wanted(f) {
                    return 0.0;
                }
                let own = &mut slopes[self.own_of[f]..self.own_of[f + 1]];
                let mut found = vec![Vector::zeros(); own.len()];
                let value = elements.of(f, |k| at(own[k].0), &mut found);
                own.iter_mut()
                    .zip(found)
                    .for_each(|(own, found)| own.1 = found);
                value
            })
            .collect();
        OwnParts {
            values,
            slopes: Cow::Owned(slopes),
        }
    }

    /// `κ F` of the `wanted` dilatations, from the elements' own parts and the contributions of all others.
    pub fn pressures(
        &self,
        own: &OwnParts<'_, D>,
        elongation: impl Fn(usize) -> f64 + Sync,
        wanted: impl Fn(usize) -> bool + Sync,
    ) -> Vec<f64> {
        parallel::map(self.count(), 64, |f| {
            if !wanted(f) {
                return 0.0;
            }
            let handed = self.shares_of(f).iter();
            let handed: f64 = handed.map(|&(p, c)| c * elongation(p as usize)).sum();
            self.stiffness[f] * (own.values[f] + handed)
        })
    }

    /// Returns the tension of a part under the pressures, conjugate to its elongation.
    pub fn tension(&self, part: usize, pressures: &[f64]) -> f64 {
        let of = self.of_part(part).iter();
        of.map(|&(f, c)| c * pressures[f as usize]).sum()
    }

    /// Adds the forces of the pressures on the nodes of elements, and what the rows that take elements' own dilatations back lack of those that follow the bonds.
    pub fn add_own_force(
        &self,
        own: &OwnParts<'_, D>,
        pressures: &[f64],
        u: &[f64],
        force: &mut [f64],
    ) {
        let mut add = |site: u32, pull: Vector<D>| {
            for (to, x) in force[site as usize * D..].iter_mut().zip(pull.iter()) {
                *to += x;
            }
        };
        for (f, pressure) in pressures.iter().enumerate() {
            for (site, b) in &own.slopes[self.own_of[f]..self.own_of[f + 1]] {
                add(*site, b * *pressure);
            }
        }
        self.for_each_taken_back(own, u, |f, stiffness, linear| {
            let range = self.own_of[f]..self.own_of[f + 1];
            for ((site, slope), (_, b)) in own.slopes[range.clone()].iter().zip(&self.own[range]) {
                add(*site, (b * linear - slope * own.values[f]) * stiffness);
            }
        });
    }

    /// Visits the dilatations of elements that follow the bonds: number, κ of what is taken back, `Σ b·u`.
    fn for_each_taken_back(
        &self,
        own: &OwnParts<'_, D>,
        u: &[f64],
        mut visit: impl FnMut(usize, f64, f64),
    ) {
        let (Some((_, taken_back)), Cow::Owned(_)) = (&self.elements, &own.slopes) else {
            return;
        };
        let at = |site: u32| Vector::<D>::from_column_slice(&u[site as usize * D..][..D]);
        for (f, &stiffness) in taken_back.iter().enumerate().filter(|(_, k)| **k != 0.0) {
            let linear = self.own_of(f).iter().map(|(s, b)| b.dot(&at(*s))).sum();
            visit(f, stiffness, linear);
        }
    }

    /// `½ κ F²` of one, from the elements' own part and the elongation of each part.
    pub fn energy_of(
        &self,
        f: usize,
        own: &OwnParts<'_, D>,
        elongation: impl Fn(usize) -> f64,
    ) -> f64 {
        let handed = self.shares_of(f).iter();
        let handed: f64 = handed.map(|&(p, c)| c * elongation(p as usize)).sum();
        0.5 * self.stiffness[f] * (own.values[f] + handed).powi(2)
    }

    /// `½ κ F²` of all, and what the rows that take back lack.
    pub fn energy(&self, own: &OwnParts<'_, D>, pressures: &[f64], u: &[f64]) -> f64 {
        let all = pressures.iter().zip(&self.stiffness);
        let mut sum: f64 = all
            .filter(|(_, k)| **k != 0.0)
            .map(|(p, k)| 0.5 * p * p / k)
            .sum();
        self.for_each_taken_back(own, u, |f, stiffness, linear| {
            sum -= 0.5 * stiffness * (own.values[f].powi(2) - linear * linear);
        });
        sum
    }

    /// κ, and b of all sites at rest: `gradient` adds those of a part times a factor.
    pub fn at_rest(
        &self,
        f: usize,
        mut gradient: impl FnMut(usize, f64, &mut Functional<D>),
    ) -> (f64, Functional<D>) {
        let mut b: Functional<D> = self.own_of(f).iter().copied().collect();
        for &(part, c) in self.shares_of(f) {
            gradient(part as usize, c, &mut b);
        }
        (self.stiffness[f], b)
    }

    /// The dilatations of elements to which a site belongs.
    pub fn of_site(&self, site: usize) -> &[u32] {
        self.of_site.of(site)
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        self.own.len() * (D + 1) * 8 + self.shares.len() * 32
    }
}
