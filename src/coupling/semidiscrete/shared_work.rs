//! The work of a step shared out among processes: each computes the forces of its own sites, and has those of the others from them.
//!
//! Every process has the whole model. Bonds are traversed, and rows multiplied, by the owner of their site alone; what is left (the bonds of a seam that are
//! exact, laws without a pass of their own, energies) every process computes for itself. Forces are gathered, and broken bonds reported, so that all processes
//! have the same bits, which are those of one process.

use super::behaviour::NONE;
use super::split::Split;
use super::{CoupledSystem, scale_rows};
use crate::model::Distribution;
use crate::system::{BondChanges, FailureUpdate, Interval, Ranks, Spread};

impl<'a, const D: usize> CoupledSystem<'a, D> {
    /// Shares the work of each pass out among processes, if there are several; all of them make the same calls from now on.
    #[must_use]
    pub fn with_ranks(mut self, ranks: Option<&'a dyn Ranks>) -> Self {
        let Some(ranks) = ranks else {
            return self;
        };
        let Distribution { partition, why } =
            self.model.distribute(ranks.count(), false, Some(ranks));
        let is_own = |site: u32| partition.owner(site) == ranks.rank();
        self.linear.compute_only(|site| is_own(site as u32));
        let breaks = self.breaks();
        if let Some(body) = &mut self.body {
            let sites = body.site_of_point.iter();
            let own: Vec<bool> = sites.map(|&s| s != NONE && is_own(s)).collect();
            if let Some(pass) = body.pass.own_points() {
                pass.compute_only(&own);
            }
        }
        self.split = Some(Split {
            ranks,
            partition,
            why,
            breaks,
        });
        self
    }

    /// Returns the number of processes that share the work, and the reason for the distribution of the sites.
    pub fn distribution(&self) -> Option<(usize, &str)> {
        let split = self.split.as_ref()?;
        Some((split.ranks.count(), &split.why))
    }

    /// Lets each process move its own sites, where the forces are such; who looks at a step then asks for all.
    #[must_use]
    pub fn with_shared_steps(mut self) -> Self {
        self.is_shareable = true;
        self
    }

    /// Overwrites `force` with that of the linear rows and of the bonds, before [`CoupledSystem::finish`]; how many bonds broke and softened.
    pub(super) fn linear_rows_and_bonds_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        interval: Interval,
        update: FailureUpdate,
    ) -> BondChanges {
        let mut changes = BondChanges::default();
        match &mut self.body {
            None => (self.linear).multiply_into::<D>(u, None, &mut self.products, force),
            Some(body) => {
                changes = body.respond(u, interval, update, self.split.as_ref());
                let bonds = Some((&body.bonds_of_site[..], &body.force[..]));
                (self.linear).multiply_into::<D>(u, bonds, &mut self.products, force);
                body.add_feet(&body.force, force);
                if let Some(seam) = &mut self.seam {
                    seam.begin_pass();
                    seam.follow(body.pass.as_ref(), changes);
                    changes += seam.add_force(u, force, update);
                }
            }
        }
        if let Some(stresses) = &self.stresses {
            stresses.add_force(self.model, u, force);
        }
        changes
    }

    /// Scales rows where those of the model are scaled; of processes, each then has the numbers of all.
    pub(super) fn finish(&self, values: &mut [f64]) {
        scale_rows(self.model, values);
        if let Some(split) = &self.split {
            let spread = Spread {
                ranks: split.ranks,
                partition: &split.partition,
            };
            spread.gather_sites(&spread.take_own(values), values);
        }
    }
}
