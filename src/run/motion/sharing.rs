//! Which scenes spread the families of their points over processes.

use super::RunOptions;
use crate::coupling::Problem;
use crate::run::setup::RunSettings;
use crate::scene::conditions::Prescribed;
use crate::scene::solve::Explicit;
use crate::scene::spec::PrecisionSpec;
use crate::system::all_say;

/// Whether each process of a scene in time may hold the families of its own sites alone, by what the scene asks for. What of an output or of a step takes bonds one by one, beside strain and stress of
/// points in VTU files, asks for those of all.
pub(crate) fn may_share<const D: usize>(problem: &Problem<D>, rest: &RunSettings<D>) -> bool {
    let has_pass = (problem.peridynamics.as_ref())
        .is_some_and(|p| p.accelerator().is_some() && p.law.several().is_none());
    has_pass
        && problem.coupling.shares_families()
        && rest.follow.is_none()
        && rest.breaking.contact.is_none()
        // lists hold the bonds of all points
        && rest.breaking.precision == PrecisionSpec::Double
        && rest.stresses.at(0.0).is_none()
        && rest.output.lines.is_empty()
        && !rest.output.energy_density
}

/// Whether a process then moves its own sites and their ghosts alone, and not all: no sub-steps, no springs, nothing that strikes.
pub(crate) fn moves_own_sites<const D: usize>(spec: &Explicit, rest: &RunSettings<D>) -> bool {
    let mut conditions = rest.conditions.iter();
    spec.sub_steps.is_none()
        && rest.impactors.is_empty()
        && conditions.all(|c| !matches!(c.prescribed, Prescribed::Spring(_)))
}

/// Collective: whether families are spread over the processes of a run; not where the scene or one of the processes needs all of them.
pub(super) fn sharing<const D: usize>(
    problem: &Problem<D>,
    rest: &RunSettings<D>,
    options: &RunOptions<'_>,
) -> bool {
    let own = options.observer.is_none() && may_share(problem, rest);
    options.ranks.is_some_and(|ranks| all_say(ranks, own))
}
