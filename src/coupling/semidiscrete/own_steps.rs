//! Steps in which each process moves its own points: a body of points alone whose families are spread over processes.
//!
//! A force takes the displacements of neighbours, of a state-based law also those of their neighbours, for its dilatations: these points are the ghosts. Forces of own
//! points that others have as ghosts are computed first, and travel while the others are. Bonds that break are told to all once somebody asks.

use super::{CoupledSystem, split::Split};
use crate::peridynamics::bond_force::Reach;
use crate::system::{FailureUpdate, Ghosts, Halfway, LostToBreaks, SharedSteps, Spread, Traffic};

/// What belongs to steps that processes share.
pub(super) struct OwnSteps {
    own: Vec<bool>,
    ghosts: Ghosts,
    /// Bonds of own points that others do not know to be broken.
    untold: Vec<u64>,
}

impl Split<'_> {
    fn spread(&self) -> Spread<'_> {
        Spread {
            ranks: self.ranks,
            partition: &self.partition,
        }
    }
}

impl<const D: usize> CoupledSystem<'_, D> {
    /// Whether every force is one of bonds between points that are sites, in their order, and families are spread over processes.
    pub(super) fn may_share_steps(&self) -> bool {
        let sites = self.mass.len();
        let body = self.body.as_ref();
        self.split.is_some()
            && self.model.shared_families().is_some()
            && self.model.row_scale().is_none()
            && self.seam.is_none()
            && self.elements.is_none()
            && (0..sites).all(|site| !self.linear.has(site))
            && body.is_some_and(|b| {
                b.shift == Some(0)
                    && b.site_of_point.len() == sites
                    && b.bonds_of_site == b.site_of_point
                    && b.contact.is_none()
                    && b.transfer.is_none()
                    && b.feet.is_empty()
                    && !b.pass.remembers()
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
        let known = self.model.points_reached(&own);
        let ghosts = Ghosts::new(&split.spread(), &known, D);
        if let Some(pass) = self.body.as_mut().and_then(|b| b.pass.own_points()) {
            pass.reach_only(&Reach {
                own: &own,
                known: &known,
                sent: ghosts.sent(),
            });
        }
        self.own_steps = Some(OwnSteps {
            own,
            ghosts,
            untold: Vec::new(),
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
        let pass = self.body.as_mut().and_then(|b| b.pass.own_points());
        let (Some(steps), Some(pass)) = (&mut self.own_steps, pass) else {
            return 0;
        };
        let ghosts = &mut steps.ghosts;
        let broken = pass.own_force_into(u, force, update, &mut |force| ghosts.begin(force));
        ghosts.end(force);
        if broken > 0 {
            steps.untold.extend(pass.broken_at_own());
        }
        broken
    }

    fn lost(&self, at: &Halfway<'_>) -> LostToBreaks {
        self.lost_by_pass(at)
    }

    fn spend(&mut self, lost: &LostToBreaks) {
        self.spent.energy += lost.energy.value();
        self.spent.area += lost.area.value();
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
        if let Some(pass) = self.body.as_mut().and_then(|b| b.pass.own_points()) {
            pass.take_broken(&words);
        }
    }

    fn traffic(&self) -> Vec<Traffic> {
        match &self.split {
            Some(split) => self.own_steps().ghosts.traffic(split.ranks),
            None => Vec::new(),
        }
    }
}
