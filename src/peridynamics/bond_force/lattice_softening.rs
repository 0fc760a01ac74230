//! Bonds of a lattice past the onset of softening.

use super::lattice::Lattice;
use super::lattice_simd::Broken;
use super::list::{Stretched, extension, ratio, stretched};
use super::simd::LANES;
use super::softened_bonds::{SoftenedBond, SoftenedBonds};
use crate::system::BondChanges;

/// Displacements by cell.
type ByCell<'a, const D: usize> = &'a [Vec<f64>; D];

impl<const D: usize> Lattice<D> {
    /// Cells of a softened bond; its first end has a family.
    fn cells(&self, bond: &SoftenedBond) -> [usize; 2] {
        let place = self.place[bond.near as usize] as usize;
        let here = self.stencil.groups[place / LANES] as usize + place % LANES;
        let there = here as isize + self.stencil.offsets[bond.slot as usize].delta;
        [here, there as usize]
    }

    fn stretched<const EXACT: bool>(
        &self,
        bond: &SoftenedBond,
        [here, there]: [usize; 2],
        u: ByCell<'_, D>,
    ) -> Stretched<D> {
        let at = |cell: usize| -> [f64; D] { std::array::from_fn(|a| u[a][cell]) };
        let xi = &self.stencil.offsets[bond.slot as usize].xi;
        stretched::<D, EXACT>(xi, &at(here), &at(there))
    }

    /// Hands over bonds whose bits a sweep has cleared, and follows the stretches of all.
    pub(super) fn soften<const EXACT: bool>(
        &self,
        softened: &mut SoftenedBonds,
        handed: &[Broken],
        u: ByCell<'_, D>,
    ) -> BondChanges {
        let law = softened.law();
        let of_lanes = |b: &Broken| {
            let (group, slot, lanes) = (b.group as usize, b.offset as usize, b.lanes);
            let offset = &self.stencil.offsets[slot];
            let limit = self.kinematics.stretch(offset.limit);
            let bond = move |lane: usize| {
                let here = self.stencil.groups[group] as usize + lane;
                let there = (here as isize + offset.delta) as usize;
                let ends = [here, there].map(|cell| self.stencil.point_of[cell]);
                SoftenedBond::new(ends, slot as u64, law.ends_of(limit))
            };
            let lanes = (0..LANES).filter(move |lane| lanes >> lane & 1 == 1);
            lanes.map(bond)
        };
        let stretch = |bond: &SoftenedBond| {
            let s = self.stretched::<EXACT>(bond, self.cells(bond), u);
            extension::<EXACT>(s.t())
        };
        softened.advance(handed.iter().flat_map(of_lanes), stretch)
    }

    /// Adds them to the moments of the points, of extensions and of their squares.
    pub(super) fn add_softened_moments<const EXACT: bool>(
        &self,
        softened: &SoftenedBonds,
        u: ByCell<'_, D>,
        sums: &mut [[f64; LANES]],
    ) {
        for bond in softened.bonds() {
            let cells = self.cells(bond);
            let e = extension::<EXACT>(self.stretched::<EXACT>(bond, cells, u).t());
            let moment = self.stencil.offsets[bond.slot as usize].moment;
            let [pair, state] = SoftenedBonds::left(bond);
            let first = moment * self.volume[cells[1]] * e;
            let place = self.place[bond.near as usize] as usize;
            let (group, lane) = (place / LANES, place % LANES);
            sums[2 * group][lane] += state * first;
            sums[2 * group + 1][lane] += pair * first * e;
        }
    }

    /// Adds their forces, with the pull of the dilatation of each cell.
    pub(super) fn add_softened_forces<const EXACT: bool>(
        &self,
        softened: &SoftenedBonds,
        (u, pull): (ByCell<'_, D>, &[f64]),
        sums: &mut [[f64; LANES]],
    ) {
        for bond in softened.bonds() {
            let cells @ [here, there] = self.cells(bond);
            let s = self.stretched::<EXACT>(bond, cells, u);
            let weight = self.stencil.offsets[bond.slot as usize].weight * self.volume[there];
            let (e, ratio) = (extension::<EXACT>(s.t()), ratio::<EXACT>(s.t()));
            // per ξ + η: an extension counts as r² (1 − r/|ξ+η|) of a pair
            let [pair, state] = SoftenedBonds::left(bond);
            let tension = match &self.solid {
                None => pair * e,
                Some(solid) => {
                    let stiffness = solid.deviatoric[here] + solid.deviatoric[there];
                    state * (pull[here] + pull[there]) + pair * stiffness * e
                }
            };
            let force = weight * tension * ratio;
            let place = self.place[bond.near as usize] as usize;
            for (a, x) in s.direction.iter().enumerate() {
                sums[place / LANES * D + a][place % LANES] += force * x;
            }
        }
    }

    /// Calls `f(offset, part)` for the bonds of a lane of a group that have not broken, with the part of its stiffness that each has under tension.
    pub(super) fn each_left(&self, g: usize, lane: usize, mut f: impl FnMut(usize, f64)) {
        self.each(&self.stencil.intact, g, lane, |offset, _| f(offset, 1.0));
        let point = self.stencil.point_of[self.stencil.groups[g] as usize + lane];
        for bond in (self.softened.iter()).flat_map(|softened| softened.of(point as usize)) {
            f(bond.slot as usize, SoftenedBonds::left_in_tension(bond));
        }
    }

    /// Bits of all bonds that have not broken.
    pub(super) fn standing(&self) -> std::borrow::Cow<'_, [u8]> {
        let mut bits = std::borrow::Cow::Borrowed(&self.stencil.intact[..]);
        let stencil = self.stencil.offsets.len();
        for bond in self.softened.iter().flat_map(SoftenedBonds::bonds) {
            let place = self.place[bond.near as usize] as usize;
            let at = place / LANES * stencil + bond.slot as usize;
            bits.to_mut()[at] |= 1 << (place % LANES);
        }
        bits
    }
}
