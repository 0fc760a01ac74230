//! Distribution of a run over several processes.

use super::RunOptions;
use crate::coupling::Problem;
use crate::peridynamics::bond_force::{BondKinematics, Storage};
use crate::peridynamics::failure::Fracture;
use crate::run::setup::RunSettings;
use crate::scene::solve::Explicit;
use crate::scene::spec::ElementsSpec;
use crate::system::{Ranks, all_say};

/// Parts of a run in time that each process has to itself, where the system lets it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Sharing {
    /// Nothing: all processes have the numbers of all sites in every step.
    #[default]
    Nothing,
    /// It moves its own sites.
    Steps,
    /// It holds the families of its own points, too.
    Families,
}

/// Returns the depth, in families from the elements, to which every process needs those of all points, where each may hold those of its own sites alone elsewhere; none where a scene asks for all. Outputs and parts of a step that
/// take bonds one by one, beside strains of points along lines and in VTU files, take those of all.
fn families_of_all<const D: usize>(problem: &Problem<D>, rest: &RunSettings<D>) -> Option<usize> {
    let p = problem.body.peridynamics.as_ref()?;
    let asks_for_own = p.accelerator().is_some()
        && p.law.several().is_none()
        && rest.follow.is_none()
        && rest.breaking.contact.is_none()
        // lists hold the bonds of all points
        && rest.breaking.precision == Storage::Double
        && !rest.stresses.asks_for_more()
        && !rest.output.fields.has_others();
    let coupling = problem.coupling.as_ref();
    (coupling.families_of_all(p.law.linearised())).filter(|_| asks_for_own)
}

/// Returns true if each process of a scene in time may hold the families of its own sites alone.
pub(crate) fn may_share<const D: usize>(problem: &Problem<D>, rest: &RunSettings<D>) -> bool {
    problem.coupling.moves_with_own_families()
        // a criterion of a state reads bonds from both ends
        && rest.breaking.fracture.is_none_or(Fracture::is_of_stretch)
        // how far a bond has softened is known where it is computed alone
        && rest.breaking.softening.softening().is_none()
        && families_of_all(problem, rest).is_some()
}

/// Returns true if each process of a static scene may do so, beside the families at a seam. Forces then have to be linear: of others each process has the rows of all sites.
pub(crate) fn may_share_rows<const D: usize>(problem: &Problem<D>, rest: &RunSettings<D>) -> bool {
    let law = problem.body.peridynamics.as_ref().map(|p| &p.law);
    rest.kinematics() == BondKinematics::Linear
        && law.is_some_and(|law| law.is_linear())
        && rest.elements == ElementsSpec::Linear
        && families_of_all(problem, rest).is_some()
}

/// Collective: the processes over which the families of a static scene are spread, if they can be.
pub(crate) fn holders_at_rest<'a, const D: usize>(
    ranks: Option<&'a dyn Ranks>,
    problem: &Problem<D>,
    rest: &RunSettings<D>,
) -> Option<&'a dyn Ranks> {
    ranks.filter(|&ranks| all_say(ranks, may_share_rows(problem, rest)))
}

/// Returns true if a process then moves its own sites and their ghosts alone, and not all: no sub-steps, no springs, no impactors.
pub(crate) fn moves_own_sites<const D: usize>(spec: &Explicit, rest: &RunSettings<D>) -> bool {
    let mut conditions = rest.conditions.iter();
    spec.sub_steps.is_none() && rest.impactors.is_empty() && conditions.all(|c| c.term().is_none())
}

/// Collective: the sharing of a run by its processes; no more than any of them can, and nothing where an observer looks at each step.
pub(super) fn sharing<const D: usize>(
    problem: &Problem<D>,
    rest: &RunSettings<D>,
    options: &RunOptions<'_>,
) -> Sharing {
    let Some(ranks) = options.ranks else {
        return Sharing::Nothing;
    };
    let own = match may_share(problem, rest) {
        _ if options.observer.is_some() => Sharing::Nothing,
        true => Sharing::Families,
        false => Sharing::Steps,
    };
    let all_share = |sharing| all_say(ranks, own >= sharing);
    match (all_share(Sharing::Steps), all_share(Sharing::Families)) {
        (_, true) => Sharing::Families,
        (true, false) => Sharing::Steps,
        (false, false) => Sharing::Nothing,
    }
}
