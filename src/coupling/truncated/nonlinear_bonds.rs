//! Bonds at a seam that rotate, stretch and break: pieces one by one; whole bonds of a pairwise law are left to the pass over the body.
//!
//! A piece of the length s, a fraction of its bond ξ, has the energy `s w(ξ, Δu/s)`: it is stretched by `|ξ + Δu/s|/|ξ| − 1`, as the whole bond would be. The pieces of a bond break together, and take `s w` each, when the whole bond
//! passes the critical stretch, or soften together from its onset on (`softening.rs`): its ends move with their points, or with the elements that they lie in (`breaking.rs`). The elements behind the face keep their classical energy: a crack cannot go on into them.
//!
//! In an LPS a piece also contributes its elongation to dilatations (`dilatation_state.rs`). The energies of the points at the seam, halves of whole bonds and dilatations, are then here too, and the body's pass computes the others;
//! whole bonds break and soften there, and are reported here.

mod breaking;
mod construction;
mod counted_bonds;
mod damage;
mod own_bonds;
mod softened_bonds;
mod softening;

use rayon::prelude::*;

use breaking::{Breaking, Carrier};
use counted_bonds::OwnBonds;
pub(in crate::coupling) use own_bonds::ReachOfSeam;
use softened_bonds::SeamSoftening;

use super::{
    bond_kinematics::Part,
    dilatation::Functional,
    dilatation_state::{OwnParts, States},
};
use crate::{
    assembly::{Row, Transfer},
    model::Model,
    parallel,
    peridynamics::{
        Families, PdBody,
        bond_force::{BondKinematics, BondSoftening},
    },
    system::{BondChanges, FailureUpdate},
    tensor::{Tensor, Vector},
};

/// Pieces per task.
const CHUNK: usize = 1024;

/// The bonds of a seam, apart from the whole ones of the body.
///
/// Source: none; `docs/truncated.md`. Shapes: displacements and forces have `D` numbers per site.
pub struct NonlinearSeam<const D: usize> {
    /// The families of the body without bonds that are not whole, or that a fit has changed.
    families: Families,
    /// True for points whose energy is computed here and not in the body's pass; empty for a pairwise law.
    without_energy: Vec<bool>,
    states: Option<States<D>>,
    parts: Vec<Part<D>>,
    /// Difference of displacement over each part.
    difference: Transfer,
    /// The points of each bond, ends or not, and the first of its parts.
    bonds: Vec<[u32; 2]>,
    first: Vec<u32>,
    /// Number of bonds, the first ones, that break here; the others break in the body's pass.
    own: usize,
    /// One bit per bond: set while it has all of its stiffness.
    intact: Vec<u8>,
    /// Bonds that lost stiffness in the last pass, with the lost fraction.
    last: Vec<(u32, f64)>,
    breaks: Option<Breaking<D>>,
    /// Of bonds that soften; none of bonds that break at once.
    softening: Option<SeamSoftening>,
    kinematics: BondKinematics,
    /// Sites at which parts end, and for each the parts with their weights.
    sites: Vec<u32>,
    offsets: Vec<usize>,
    ends: Vec<(u32, f64)>,
    /// Point, bond and volume of the far point: what a point loses with a bond, by point.
    lost: Vec<(u32, u32, f64)>,
    /// Bonds with a part between a face and a point next to it, with that point.
    next_to_face: Vec<(u32, u32)>,
    /// Whole bonds between two points next to a face.
    along_face: Vec<[u32; 2]>,
    pulls: Vec<[f64; D]>,
    elongation: Vec<f64>,
    /// Of each of `sites`, kept between passes.
    sums: Vec<[f64; D]>,
    /// Bonds and dilatations that are computed here, where several processes move the sites.
    computed: OwnBonds,
}

impl<const D: usize> NonlinearSeam<D> {
    /// Sets the kinematics of the bonds.
    pub(in crate::coupling) fn follow_motion(&mut self, kinematics: BondKinematics) {
        self.kinematics = kinematics;
    }

    /// Lets bonds break: `critical` gives the critical stretch of the bond between two points, `softening` the law by which bonds soften, if they do; `never` is true for points whose bonds never break.
    pub(in crate::coupling) fn let_break(
        &mut self,
        model: &Model<D>,
        body: &PdBody<D>,
        (critical, softening): (impl Fn([u32; 2]) -> f64, Option<BondSoftening>),
        never: impl Fn(u32) -> bool,
    ) {
        let first = |s: f64| softening.map_or(s, |law| law.limit(s));
        let limit = |bond| self.kinematics.limit(first(critical(bond)));
        let longest = |bond| self.longest_piece(bond);
        let bonds = &self.bonds[..self.own];
        self.breaks = Some(Breaking::new((model, body), bonds, limit, never, longest));
        self.softening = softening.map(|law| SeamSoftening::new(law, self.bonds.len()));
    }

    fn longest_piece(&self, bond: usize) -> (f64, Carrier) {
        let parts = self.first[bond] as usize..self.first[bond + 1] as usize;
        let length = |p: &usize| self.parts[*p].length;
        let longest = parts.max_by(|p, q| length(p).total_cmp(&length(q)));
        let longest = longest.expect("a bond of a seam has a piece");
        (length(&longest), self.difference.row(longest).collect())
    }

    /// The families over which the body's own pass runs.
    pub(in crate::coupling) fn families(&self) -> &Families {
        &self.families
    }

    /// Returns true if the body's own pass contains the bond between two points.
    pub(in crate::coupling) fn is_whole(&self, i: usize, j: usize) -> bool {
        self.families.of(i).binary_search(&(j as u32)).is_ok()
    }

    /// Points whose energy is not for the body's pass; empty for none.
    pub(in crate::coupling) fn without_energy(&self) -> &[bool] {
        &self.without_energy
    }

    /// Sets `pulls` to the directions of the parts, and their elongations; zero for parts of broken bonds.
    fn stretch<const EXACT: bool>(
        &self,
        u: &[f64],
        pulls: &mut [[f64; D]],
        elongation: &mut [f64],
    ) {
        let both = pulls
            .par_chunks_mut(CHUNK)
            .zip(elongation.par_chunks_mut(CHUNK));
        parallel::for_each(both.enumerate(), |(chunk, (pulls, elongation))| {
            for (k, (pull, elongation)) in pulls.iter_mut().zip(elongation).enumerate() {
                let p = chunk * CHUNK + k;
                let part = &self.parts[p];
                (*pull, *elongation) = ([0.0; D], 0.0);
                if self.stands(part.bond) && self.computed.knows_part(p) {
                    let s = part.strained::<EXACT>(&self.difference.displacement(p, u));
                    (*pull, *elongation) = (s.direction, s.elongation);
                }
            }
        });
    }

    /// Turns directions into forces, in `pulls`; returns the pressures `κ F` of the dilatations.
    fn pull(
        &self,
        own: Option<&OwnParts<'_, D>>,
        elongation: &[f64],
        pulls: &mut [[f64; D]],
    ) -> Vec<f64> {
        let states = self.states.as_ref();
        let pressures = match (states, own) {
            (Some(states), Some(own)) => {
                let handed = |p: usize| self.left(self.parts[p].bond)[1] * elongation[p];
                states.pressures(own, handed, |f| self.computed.knows_dilatation(f))
            }
            _ => Vec::new(),
        };
        parallel::for_each_chunk(pulls, CHUNK, 1, |chunk, pulls| {
            for (k, pull) in pulls.iter_mut().enumerate() {
                let p = chunk * CHUNK + k;
                let [pair, state] = self.left(self.parts[p].bond);
                let f = pair * self.parts[p].stiffness * elongation[p]
                    + states.map_or(0.0, |s| state * s.tension(p, &pressures));
                *pull = pull.map(|x| f * x);
            }
        });
        pressures
    }

    /// Adds the forces in `pulls`, and those of the elements' `own` parts of the dilatations.
    fn add_forces(
        &self,
        pulls: &[[f64; D]],
        (own, pressures): (Option<&OwnParts<'_, D>>, &[f64]),
        u: &[f64],
        sums: &mut Vec<[f64; D]>,
        force: &mut [f64],
    ) {
        self.scatter(pulls, sums, force);
        if let (Some(states), Some(own)) = (&self.states, own) {
            states.add_own_force(own, pressures, u, force);
        }
    }

    /// Elements' own parts of the dilatations, if there are any.
    fn own_parts(&self, u: &[f64], kinematics: BondKinematics) -> Option<OwnParts<'_, D>> {
        let states = self.states.as_ref();
        let is_known = |f| self.computed.knows_dilatation(f);
        states.map(|states| states.own_parts(u, kinematics, is_known))
    }

    /// Adds the internal force; returns how many bonds broke and softened, each counted once for each direction.
    pub(in crate::coupling) fn add_force(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        breakage: FailureUpdate,
    ) -> BondChanges {
        let (mut pulls, mut elongation, mut sums) = (
            std::mem::take(&mut self.pulls),
            std::mem::take(&mut self.elongation),
            std::mem::take(&mut self.sums),
        );
        let changes = match breakage {
            FailureUpdate::Update => self.update_cut_bonds(u),
            FailureUpdate::Frozen => BondChanges::default(),
        };
        match self.kinematics {
            BondKinematics::Exact => self.stretch::<true>(u, &mut pulls, &mut elongation),
            BondKinematics::Linear => self.stretch::<false>(u, &mut pulls, &mut elongation),
        }
        let own = self.own_parts(u, self.kinematics);
        let pressures = self.pull(own.as_ref(), &elongation, &mut pulls);
        self.add_forces(&pulls, (own.as_ref(), &pressures), u, &mut sums, force);
        drop(own);
        (self.pulls, self.elongation, self.sums) = (pulls, elongation, sums);
        changes
    }

    fn scatter(&self, pulls: &[[f64; D]], sums: &mut Vec<[f64; D]>, force: &mut [f64]) {
        sums.resize(self.sites.len(), [0.0; D]);
        parallel::for_each_mut(sums, CHUNK / 8, |s, sum| {
            *sum = [0.0; D];
            for &(part, w) in &self.ends[self.offsets[s]..self.offsets[s + 1]] {
                for (sum, pull) in sum.iter_mut().zip(&pulls[part as usize]) {
                    *sum += w * pull;
                }
            }
        });
        for (&site, sum) in self.sites.iter().zip(&*sums) {
            for (f, sum) in force[site as usize * D..][..D].iter_mut().zip(sum) {
                *f += sum;
            }
        }
    }

    /// Adds the product with the tangent at rest.
    pub(in crate::coupling) fn add_tangent(&self, x: &[f64], y: &mut [f64]) {
        let parts = self.parts.len();
        let (mut pulls, mut elongation) = (vec![[0.0; D]; parts], vec![0.0; parts]);
        self.stretch::<false>(x, &mut pulls, &mut elongation);
        let own = self.own_parts(x, BondKinematics::Linear);
        let pressures = self.pull(own.as_ref(), &elongation, &mut pulls);
        let parts = (own.as_ref(), &pressures[..]);
        self.add_forces(&pulls, parts, x, &mut Vec::new(), y);
    }

    /// κ of a dilatation, and its derivative by the displacement of each site, at rest.
    fn functional(&self, states: &States<D>, f: usize) -> (f64, Functional<D>) {
        states.at_rest(f, |p, c, b| {
            let part = &self.parts[p];
            let [_, state] = self.left(part.bond);
            if state > 0.0 {
                for (site, w) in self.difference.row(p) {
                    *b.entry(site).or_insert_with(Vector::zeros) +=
                        Vector::from(part.xi) * (state * c * w);
                }
            }
        })
    }

    /// Adds for every unknown an upper bound of `Σ_b |K_ab|` \[N/m\].
    pub(in crate::coupling) fn add_row_sums(&self, sums: &mut [f64]) {
        for (s, &site) in self.sites.iter().enumerate() {
            for &(p, w) in &self.ends[self.offsets[s]..self.offsets[s + 1]] {
                let part = &self.parts[p as usize];
                if !self.stands(part.bond) {
                    continue;
                }
                let all: f64 = self.difference.row(p as usize).map(|(_, w)| w.abs()).sum();
                let size: f64 = part.xi.iter().map(|x| x.abs()).sum();
                for (sum, x) in sums[site as usize * D..].iter_mut().zip(&part.xi) {
                    *sum += part.stiffness * w.abs() * all * x.abs() * size;
                }
            }
        }
        let Some(states) = &self.states else { return };
        for f in 0..states.count() {
            let (stiffness, b) = self.functional(states, f);
            let all: f64 = b.values().map(|b| b.abs().sum()).sum();
            for (site, b) in b {
                for (sum, b) in sums[site as usize * D..].iter_mut().zip(b.iter()) {
                    *sum += stiffness.abs() * all * b.abs();
                }
            }
        }
    }

    /// The parts that end at a site, with their weights there.
    fn ends_at(&self, site: usize) -> &[(u32, f64)] {
        match self.sites.binary_search(&(site as u32)) {
            Ok(s) => &self.ends[self.offsets[s]..self.offsets[s + 1]],
            Err(_) => &[],
        }
    }

    /// Adds the row of a site in the tangent at rest.
    pub(in crate::coupling) fn add_row(&self, site: usize, row: &mut Row<D>) {
        let mut of = Vec::new();
        for &(p, w) in self.ends_at(site) {
            let part = &self.parts[p as usize];
            let [pair, _] = self.left(part.bond);
            if pair > 0.0 {
                let xi = Vector::from(part.xi);
                let block: Tensor<D> = xi * xi.transpose() * (pair * part.stiffness * w);
                row.add(&self.difference, p as usize, &block);
                let states = self.states.iter();
                of.extend(states.flat_map(|s| s.of_part(p as usize).iter().map(|e| e.0)));
            }
        }
        let Some(states) = &self.states else { return };
        of.extend(states.of_site(site));
        of.sort_unstable();
        of.dedup();
        for f in of {
            let (stiffness, b) = self.functional(states, f as usize);
            let Some(own) = b.get(&(site as u32)).map(|b| b * stiffness) else {
                continue;
            };
            for (other, b) in b {
                row.add_site(other, &(own * b.transpose()));
            }
        }
    }

    /// Returns true if a bond of the seam ends at a site, or changes a dilatation that depends on it.
    pub(in crate::coupling) fn touches(&self, site: usize) -> bool {
        let states = self.states.as_ref();
        !self.ends_at(site).is_empty() || states.is_some_and(|s| !s.of_site(site).is_empty())
    }
}
