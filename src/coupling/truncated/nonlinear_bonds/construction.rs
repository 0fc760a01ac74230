//! The bonds of a seam, made from its segments: pieces, whole bonds that dilatations need, and the sites at their ends.

use rustc_hash::FxHashSet;

use super::{NonlinearSeam, counted_bonds::OwnBonds};
use crate::{
    assembly::Transfer,
    coupling::truncated::{
        bond_kinematics::{Part, whole_bonds},
        bond_segments::Segments,
        dilatation_state::States,
        lps_constants::LpsConstants,
        springs::Springs,
    },
    model::{Model, SiteKind},
    peridynamics::{PdBody, bond_force::BondKinematics},
};

/// Site, part and weight of an end of a part.
type SiteEnd = (u32, u32, f64);

impl<const D: usize> NonlinearSeam<D> {
    /// Of a law with dilatations `states` gives them.
    pub(in crate::coupling::truncated) fn new(
        model: &Model<D>,
        body: &PdBody<D>,
        springs: &Springs<D>,
        broken: &FxHashSet<(u32, u32)>,
        states: Option<(&Segments<'_, D>, &LpsConstants)>,
    ) -> Self {
        let segments = states.map(|s| s.0);
        let without_energy = segments.map_or(Vec::new(), |s| s.at_seam.clone());
        let mut seam = Self::without_bonds(body, without_energy);
        let mut of_site: Vec<SiteEnd> = Vec::new();
        let mut taken = broken.clone();
        // whole bonds that a fit has changed follow the pieces; with dilatations they are among the whole ones below
        let pieces = segments.map_or(usize::MAX, |s| s.cut.len());
        seam.push_pieces(model, body, springs, pieces, &mut taken, &mut of_site);
        seam.own = seam.bonds.len();
        if let Some((segments, common)) = states {
            let whole = whole_bonds(segments);
            seam.push_whole_bonds(body, segments, &whole, &mut of_site);
            seam.states = Some(States::new(segments, common, &whole));
        }
        seam.first.push(seam.parts.len() as u32);
        let whole = |i: u32, j: u32| !taken.contains(&(i.min(j), i.max(j)));
        let mut is_site = vec![false; body.cloud.position.len()];
        for site in &model.sites {
            if let SiteKind::Point(p) = site.kind {
                is_site[p as usize] = true;
            }
        }
        seam.families
            .retain(|i, j| is_site[j as usize] && whole(i as u32, j));
        seam.find_bonds_along_face(body.cloud.position.len());
        seam.index_sites(of_site);
        seam.intact = vec![0xff; seam.bonds.len().div_ceil(8)];
        seam.pulls = vec![[0.0; D]; seam.parts.len()];
        seam.elongation = vec![0.0; seam.parts.len()];
        seam
    }

    /// A seam without bonds yet, over the families of a body.
    fn without_bonds(body: &PdBody<D>, without_energy: Vec<bool>) -> Self {
        Self {
            families: body.families.clone(),
            without_energy,
            states: None,
            parts: Vec::new(),
            difference: Transfer::new(body.cloud.transfer.sites()),
            bonds: Vec::new(),
            first: Vec::new(),
            own: 0,
            intact: Vec::new(),
            last: Vec::new(),
            breaks: None,
            softening: None,
            kinematics: BondKinematics::Linear,
            sites: Vec::new(),
            offsets: vec![0],
            ends: Vec::new(),
            lost: Vec::new(),
            next_to_face: Vec::new(),
            along_face: Vec::new(),
            pulls: Vec::new(),
            elongation: Vec::new(),
            sums: Vec::new(),
            computed: OwnBonds::default(),
        }
    }

    /// Takes in the first `pieces` of bonds that end on faces; bonds with a piece between two points are `taken` from the body.
    fn push_pieces(
        &mut self,
        model: &Model<D>,
        body: &PdBody<D>,
        springs: &Springs<D>,
        pieces: usize,
        taken: &mut FxHashSet<(u32, u32)>,
        of_site: &mut Vec<SiteEnd>,
    ) {
        for spring in springs.own().take(pieces) {
            let (xi, origin) = (spring.direction, spring.origin);
            let length = origin.piece.to - origin.piece.from;
            let part = Part {
                xi: xi.into(),
                stiffness: spring.stiffness,
                length,
                bond: 0,
            };
            let bond = self.push(part, origin.bond, &spring.difference, of_site);
            for (end, point) in origin.at.into_iter().enumerate() {
                let Some(point) = point else { continue };
                let far = body.cloud.volume[origin.bond[1 - end] as usize] * origin.piece.share;
                self.lost.push((point, bond, far));
                let own = model.passing().map(|p| p.whole_of(point).spacing);
                let spacing = own.unwrap_or(model.spacing());
                let is_near = length * xi.norm() <= spacing * (1.0 + 1e-6);
                if origin.at[1 - end].is_none() && is_near {
                    self.next_to_face.push((bond, point));
                }
            }
            if let [Some(i), Some(j)] = origin.at {
                taken.insert((i.min(j), i.max(j)));
            }
        }
    }

    /// Takes in whole bonds of points at the seam, whose energies are here.
    fn push_whole_bonds(
        &mut self,
        body: &PdBody<D>,
        segments: &Segments<'_, D>,
        whole: &[[u32; 2]],
        of_site: &mut Vec<SiteEnd>,
    ) {
        for &[i, j] in whole {
            let volume = body.cloud.volume[i as usize] * body.cloud.volume[j as usize];
            let half = |own: u32, other: u32| match segments.at_seam[own as usize] {
                true => segments.coefficients(own, other).0 * volume,
                false => 0.0,
            };
            let (plain, scale) = (half(i, j) + half(j, i), segments.scale(i, j));
            let part = Part {
                xi: body.bond(i as usize, j as usize).into(),
                stiffness: plain * scale,
                length: 1.0,
                bond: 0,
            };
            let site = |p: u32| segments.site[p as usize];
            let difference = [(site(i), -1.0), (site(j), 1.0)];
            self.push(part, [i, j], &difference, of_site);
        }
    }

    /// Finds the whole bonds between points next to a face, of so many `points`.
    fn find_bonds_along_face(&mut self, points: usize) {
        let mut near = vec![false; points];
        for &(_, p) in &self.next_to_face {
            near[p as usize] = true;
        }
        for i in (0..near.len() as u32).filter(|&i| near[i as usize]) {
            let family = self.families.of(i as usize).iter();
            let along = family.filter(|&&j| j > i && near[j as usize]);
            self.along_face.extend(along.map(|&j| [i, j]));
        }
    }

    /// Sorts the ends of parts by sites, and what points lose by points.
    fn index_sites(&mut self, mut of_site: Vec<SiteEnd>) {
        self.lost.sort_unstable_by_key(|l| (l.0, l.1));
        of_site.sort_unstable_by_key(|e| (e.0, e.1));
        for of in of_site.chunk_by(|a, b| a.0 == b.0) {
            self.sites.push(of[0].0);
            self.ends.extend(of.iter().map(|&(_, part, w)| (part, w)));
            self.offsets.push(self.ends.len());
        }
    }

    /// Takes in a part of a bond, the last one or the next; returns the bond.
    fn push(
        &mut self,
        part: Part<D>,
        bond: [u32; 2],
        difference: &[(u32, f64)],
        of_site: &mut Vec<SiteEnd>,
    ) -> u32 {
        let number = self.parts.len() as u32;
        if self.bonds.last() != Some(&bond) {
            self.bonds.push(bond);
            self.first.push(number);
        }
        let bond = self.bonds.len() as u32 - 1;
        of_site.extend(difference.iter().map(|&(site, w)| (site, number, w)));
        self.difference.push(difference.to_vec());
        self.parts.push(Part { bond, ..part });
        bond
    }
}
