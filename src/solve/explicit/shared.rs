//! Steps in which each process moves its own sites and ghosts, and the gathering of all sites where they are asked for.

use super::sums::{Sums, total};
use super::{Energies, Explicit, Reading, SITES};
use crate::system::{ExactSum, FailureUpdate, Segments, Traffic};

/// Data of time steps that processes share.
pub(super) struct Shared {
    /// Velocity half a step ago, of sites that are moved here; empty before the first step.
    half: Vec<f64>,
    /// True if the numbers of all sites are those of the present step.
    is_whole: bool,
}

/// Bonds broken by a force evaluation.
#[derive(Default)]
pub(super) struct Outcome {
    /// Bonds that broke.
    pub broken: u64,
    /// Energy that they cost, where these are still to be added over processes.
    pub lost: ExactSum,
}

impl Explicit<'_> {
    /// Begins to share steps with other processes, where the system can.
    pub(super) fn share(&mut self) {
        let Some(system) = self.system.shared_steps() else {
            return;
        };
        system.begin();
        let own = system.own();
        let known = system.known().into_iter().zip(&own);
        let ghosts: Vec<bool> = known.map(|(known, own)| known && !own).collect();
        self.own = Segments::of(&own, SITES);
        self.ghosts = Segments::of(&ghosts, SITES);
        self.shared = Some(Shared {
            half: Vec::new(),
            is_whole: true,
        });
    }

    /// The force on own sites and ghosts.
    pub(super) fn respond_at_own(&mut self) -> Outcome {
        let mut outcome = Outcome::default();
        let Some(system) = self.system.shared_steps() else {
            return outcome;
        };
        let update = FailureUpdate::Update;
        outcome.broken = system.force_into(&self.state.u, &mut self.force, update);
        // a bond that another process counts may cost something here
        outcome.lost = system.lost(&self.state.halfway(self.params.step));
        if let Some(shared) = &mut self.shared {
            shared.is_whole = false;
        }
        outcome
    }

    /// Keeps the velocity of the half step, from which that of all sites can be found later.
    pub(super) fn keep_half(&mut self) {
        let Some(shared) = &mut self.shared else {
            return;
        };
        let (v, d) = (&self.state.v, self.block);
        shared.half.resize(v.len(), 0.0);
        for (chunk, half) in shared.half.chunks_mut(SITES * d).enumerate() {
            let v = &v[chunk * SITES * d..];
            for sites in self.own.of_chunk(chunk) {
                let dofs = sites.start * d..sites.end * d;
                half[dofs.clone()].copy_from_slice(&v[dofs]);
            }
        }
    }

    /// Collective: the sums of a step over all processes. Energies differ from those of one process in their last digits; they serve only to detect an unstable motion.
    pub(super) fn add_over_processes(&mut self, sums: [&mut Sums; 2], outcome: &mut Outcome) {
        let Some(system) = self.system.shared_steps() else {
            return;
        };
        if self.shared.is_none() {
            return;
        }
        let [before, after] = sums;
        let single = |x: f64| {
            let mut sum = ExactSum::default();
            sum.add(x);
            sum
        };
        let mut energies = [after.kinetic, after.kinetic_half, after.pair].map(single);
        let mut words = vec![outcome.broken as i64];
        let powers = [&mut before.power, &mut after.power];
        let powers = powers
            .into_iter()
            .flat_map(|p| [&mut p.sum, &mut p.absolute]);
        let mut all: Vec<&mut ExactSum> = powers
            .chain(&mut energies)
            .chain([&mut outcome.lost])
            .collect();
        all.iter_mut().for_each(|sum| sum.extend(&mut words));
        system.add_into(&mut words);
        let parts = words[1..].chunks_exact(ExactSum::WORDS);
        for (sum, words) in all.into_iter().zip(parts) {
            *sum = ExactSum::of_words(words);
        }
        outcome.broken = words[0] as u64;
        let [kinetic, kinetic_half, pair] = energies.map(|sum| sum.value());
        (after.kinetic, after.kinetic_half, after.pair) = (kinetic, kinetic_half, pair);
        if outcome.broken > 0 {
            system.spend(&outcome.lost);
        }
    }

    /// Gathers all sites where the energies of a step are not those of a motion, so that the error can name the site.
    pub(super) fn gather_for_trouble(&mut self) {
        if self.shared.is_some() && self.check_numbers().is_err() {
            self.gather();
        }
    }

    /// Collective where processes move their own sites alone: the state, forces, energies and bonds of all sites become known to this one, with the bits of one process.
    ///
    /// Displacements, half-step velocities and forces come from their processes; the last half step is then taken for all sites once more.
    pub fn gather(&mut self) {
        let Some(shared) = self.shared.as_mut().filter(|shared| !shared.is_whole) else {
            return;
        };
        let Some(system) = self.system.shared_steps() else {
            return;
        };
        shared.is_whole = true;
        system.learn_breaks();
        system.gather(&mut self.state.u);
        system.gather(&mut shared.half);
        system.gather(&mut self.force);
        self.state.v.copy_from_slice(&shared.half);
        // ghosts are among all of them, and are not moved twice
        let sites = self.inverse_mass.len();
        let own = std::mem::replace(&mut self.own, Segments::all(sites, SITES));
        let ghosts = std::mem::replace(&mut self.ghosts, Segments::none(sites, SITES));
        self.accelerate_prescribed();
        self.add_reactions(Reading::Kept);
        self.accelerate_and_kick();
        self.settle_prescribed();
        let Energies {
            work, work_half, ..
        } = self.energies;
        self.energies = Energies::of(&total(&self.sums), work, work_half);
        (self.own, self.ghosts) = (own, ghosts);
    }

    /// Collective where processes move their own sites alone: the bonds that others broke are broken here too, where damage at the edge of the zone is then looked for.
    pub fn learn_breaks_at_edge(&mut self) {
        if self.shared.as_ref().is_none_or(|shared| shared.is_whole) {
            return;
        }
        if let Some(system) = self.system.shared_steps().filter(|s| s.has_edge()) {
            system.learn_breaks();
        }
    }

    /// Collective: what each process exchanged for its steps; none where each moves all sites.
    pub fn traffic(&mut self) -> Option<Vec<Traffic>> {
        self.shared.as_ref()?;
        Some(self.system.shared_steps()?.traffic())
    }
}
