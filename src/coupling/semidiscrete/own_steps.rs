//! Steps in which each process moves its own sites, for bodies whose forces come from linear rows and from bonds.
//!
//! The force on a site takes the displacements of the columns of its row and of its neighbours, of a state-based law also those of their neighbours, for its dilatations; points between elements take those of the sites that
//! they follow. These sites are the ghosts. Forces of own sites that others have as ghosts are computed first, and travel while the others are. Bonds that break are reported to all once they are asked for.

use super::behaviour::CHUNK;
use super::reached_sites::Reached;
use super::rows::SiteRows;
use super::{CoupledSystem, behaviour::NONE, body::MovingBody, split::Split};
use crate::system::{
    BondChanges, ExactSum, FailureUpdate, Ghosts, Halfway, Segments, SharedSteps, Spread, Traffic,
};
use crate::tensor::Vector;
use crate::{parallel, peridynamics::bond_force::Reach};

/// Data of steps that processes share.
pub(super) struct OwnSteps {
    own: Vec<bool>,
    /// Own sites, in chunks of [`CHUNK`].
    segments: Segments,
    ghosts: Ghosts,
    /// Points whose displacements are known, where not all points follow one another among the sites.
    points: Vec<u32>,
    /// True if forces of points are those of the sites, in their order.
    is_direct: bool,
    /// Bonds of own points that others do not know to be broken, and bonds of a seam.
    untold: Vec<u64>,
    untold_at_seam: Vec<u64>,
}

impl Split<'_> {
    fn spread(&self) -> Spread<'_> {
        Spread {
            ranks: self.ranks,
            partition: &self.partition,
        }
    }
}

/// Contributions to the force of a site.
struct SiteForces<'a, const D: usize> {
    linear: &'a SiteRows,
    /// See [`MovingBody::bonds_of_site`]; empty without points.
    bonds_of_site: &'a [u32],
    scale: Option<&'a [f64]>,
}

impl<const D: usize> SiteForces<'_, D> {
    /// The force of a site, of products of rows and forces of points: summed and scaled in the order of [`SemiDiscrete::internal_force_into`].
    ///
    /// [`SemiDiscrete::internal_force_into`]: crate::system::SemiDiscrete::internal_force_into
    fn of(&self, site: usize, (products, points): (&[f64], &[f64])) -> Vector<D> {
        let point = self.bonds_of_site.get(site).copied().unwrap_or(NONE);
        let mut force = self.linear.with_bonds::<D>(site, products, (point, points));
        if let Some(scale) = self.scale
            && scale[site] != 1.0
        {
            force.iter_mut().for_each(|f| *f *= scale[site]);
        }
        force
    }

    /// Overwrites the forces of some sites.
    fn put_some(&self, sites: &[u32], from: (&[f64], &[f64]), force: &mut [f64]) {
        for &site in sites {
            let of_site = self.of(site as usize, from);
            force[site as usize * D..][..D].copy_from_slice(of_site.as_slice());
        }
    }

    /// Overwrites the forces of the sites of `segments`.
    fn put_all(&self, segments: &Segments, from: (&[f64], &[f64]), force: &mut [f64]) {
        parallel::for_each_chunk(force, CHUNK * D, 1, |chunk, force| {
            for k in segments.of_chunk(chunk).flatten() {
                let of_site = self.of(chunk * CHUNK + k, from);
                force[k * D..][..D].copy_from_slice(of_site.as_slice());
            }
        });
    }
}

/// Scales the forces of own sites, where rows are scaled.
fn scale_own<const D: usize>(scale: Option<&[f64]>, own: &[bool], force: &mut [f64]) {
    let Some(scale) = scale else { return };
    let factors = scale.iter().zip(own);
    for (force, (factor, _)) in force
        .chunks_exact_mut(D)
        .zip(factors)
        .filter(|(_, (_, own))| **own)
    {
        force.iter_mut().for_each(|f| *f *= factor);
    }
}

impl<const D: usize> MovingBody<D> {
    /// The point of each of some sites that take a force from bonds.
    fn points_of(&self, sites: &[u32]) -> Vec<u32> {
        let points = sites.iter().map(|&s| self.bonds_of_site[s as usize]);
        points.filter(|&point| point != NONE).collect()
    }
}

impl<const D: usize> CoupledSystem<'_, D> {
    /// Returns true if every site is a point whose force is that of its bonds, unscaled, in the order of the points.
    fn is_of_points_alone(&self) -> bool {
        let sites = self.mass.len();
        self.model.row_scale().is_none()
            && self.linear.is_empty()
            && self.body.as_ref().is_some_and(|b| {
                b.shift == Some(0)
                    && b.site_of_point.len() == sites
                    && b.bonds_of_site == b.site_of_point
            })
    }

    fn own_steps(&self) -> &OwnSteps {
        self.own_steps.as_ref().expect("steps are shared")
    }
}

impl<const D: usize> SharedSteps for CoupledSystem<'_, D> {
    fn begin(&mut self) {
        let Some(split) = &self.split else { return };
        let rank = split.ranks.rank();
        let sites = 0..self.mass.len() as u32;
        let own: Vec<bool> = sites.map(|s| split.partition.owner(s) == rank).collect();
        let Reached {
            own_points,
            points,
            sites,
            seam,
        } = self.reached_from(&own);
        let ghosts = Ghosts::new(&split.spread(), &sites, D);
        self.linear.begin_with(ghosts.sent());
        let is_direct = self.is_of_points_alone();
        let mut known = Vec::new();
        if let Some(body) = &mut self.body {
            let sent = body.points_of(ghosts.sent());
            if body.shift.is_none() {
                known = (0..points.len() as u32)
                    .filter(|&p| points[p as usize])
                    .collect();
            }
            if let Some(pass) = body.pass.own_points() {
                pass.reach_only(&Reach {
                    own: &own_points,
                    known: &points,
                    sent: &sent,
                    followed: seam.as_ref().map_or(&[], |seam| &seam.followed),
                });
            }
        }
        if let (Some(held), Some(reach)) = (&mut self.seam, seam) {
            held.reach_only(reach);
        }
        self.own_steps = Some(OwnSteps {
            segments: Segments::of(&own, CHUNK),
            own,
            ghosts,
            points: known,
            is_direct,
            untold: Vec::new(),
            untold_at_seam: Vec::new(),
        });
    }

    fn own(&self) -> Vec<bool> {
        self.own_steps().own.clone()
    }

    fn known(&self) -> Vec<bool> {
        let steps = self.own_steps();
        let mut known = steps.own.clone();
        for &site in steps.ghosts.sites() {
            known[site as usize] = true;
        }
        known
    }

    fn force_into(&mut self, u: &[f64], force: &mut [f64], update: FailureUpdate) -> u64 {
        let (Some(steps), linear, products) =
            (&mut self.own_steps, &self.linear, &mut self.products)
        else {
            return 0;
        };
        let OwnSteps {
            segments, ghosts, ..
        } = steps;
        if let Some(body) = &mut self.body {
            body.spread_some(u, &steps.points);
        }
        let mut forces = SiteForces::<D> {
            linear,
            bonds_of_site: &[],
            scale: self.model.row_scale(),
        };
        linear.multiply_early_into::<D>(u, products);
        let Some(MovingBody {
            pass,
            displacement,
            force: of_points,
            bonds_of_site,
            shift,
            ..
        }) = &mut self.body
        else {
            forces.put_some(ghosts.sent(), (products, &[]), force);
            ghosts.begin(force);
            linear.multiply_late_into::<D>(u, products);
            forces.put_all(segments, (products, &[]), force);
            ghosts.end(force);
            return 0;
        };
        let Some(own) = pass.own_points() else {
            return 0;
        };
        forces.bonds_of_site = bonds_of_site;
        let at = match *shift {
            Some(shift) => &u[shift * D..][..displacement.len()],
            None => displacement,
        };
        let mut broken;
        if let Some(seam) = &mut self.seam {
            // which of its bonds stand is known once the pass is done
            broken = own.own_force_into(at, of_points, update, &mut |_| ());
            let follows = own.has_seen_breaks();
            linear.multiply_late_into::<D>(u, products);
            let scale = forces.scale.take();
            forces.put_all(segments, (products, of_points), force);
            seam.begin_pass();
            seam.follow(pass.as_ref(), BondChanges::broken(u64::from(follows)));
            broken += seam.add_force(u, force, update).broken;
            steps.untold_at_seam.extend(seam.broken_here());
            scale_own::<D>(scale, &steps.own, force);
            ghosts.begin(force);
        } else if steps.is_direct {
            broken = own.own_force_into(at, force, update, &mut |force| ghosts.begin(force));
        } else {
            let mut send = |points: &[f64]| {
                forces.put_some(ghosts.sent(), (products, points), force);
                ghosts.begin(force);
            };
            broken = own.own_force_into(at, of_points, update, &mut send);
            linear.multiply_late_into::<D>(u, products);
            forces.put_all(segments, (products, of_points), force);
        }
        ghosts.end(force);
        if let (true, Some(own)) = (broken > 0, pass.own_points()) {
            steps.untold.extend(own.broken_at_own());
        }
        broken
    }

    fn lost(&self, at: &Halfway<'_>) -> ExactSum {
        self.lost_here(at)
    }

    fn spend(&mut self, lost: &ExactSum) {
        self.spent.energy += lost.value();
    }

    fn add_into(&self, sums: &mut [i64]) {
        if let Some(split) = &self.split {
            split.ranks.add_into(sums);
        }
    }

    fn gather(&self, values: &mut [f64]) {
        if let Some(split) = &self.split {
            let spread = split.spread();
            spread.gather_sites(&spread.take_own(values), values);
        }
    }

    fn learn_breaks(&mut self) {
        let (Some(split), Some(steps)) = (&self.split, &mut self.own_steps) else {
            return;
        };
        if !split.breaks {
            return;
        }
        let untold = std::mem::take(&mut steps.untold);
        let words = split.ranks.gather_words(&untold).concat();
        let Some(body) = &mut self.body else { return };
        if let Some(pass) = body.pass.own_points() {
            pass.take_broken(&words);
        }
        if let Some(seam) = &mut self.seam {
            let untold = std::mem::take(&mut steps.untold_at_seam);
            seam.take_broken(&split.ranks.gather_words(&untold).concat());
            let all = BondChanges::broken(words.len() as u64);
            seam.follow(body.pass.as_ref(), all);
        }
    }

    fn has_edge(&self) -> bool {
        self.seam.is_some() || self.body.as_ref().is_some_and(|b| !b.edge.is_empty())
    }

    fn traffic(&self) -> Vec<Traffic> {
        match &self.split {
            Some(split) => self.own_steps().ghosts.traffic(split.ranks),
            None => Vec::new(),
        }
    }
}
