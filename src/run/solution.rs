//! A solved scene, and where its sites lie.

use crate::observe::summary::SectionForce;
use crate::run::stress_settings::StressSettings;
use crate::system::SemiDiscrete;
use crate::{
    coupling::Operator,
    model::{Model, SiteKind, Zone},
};

/// Motion and damage of a scene in time or load steps.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moved<'a> {
    /// Velocity, `D` numbers per site; none at rest.
    pub velocity: Option<&'a [f64]>,
    /// Damage of each site; none where nothing can break.
    pub damage: Option<&'a [f64]>,
    /// Broken bonds by the sites of their ends, each once for each direction.
    pub broken: &'a [(u32, u32)],
}

/// A solved scene.
pub struct Solved<'a, const D: usize> {
    /// The model.
    pub model: &'a Model<D>,
    /// Its rows.
    pub operator: &'a Operator<'a, D>,
    /// Displacement, `D` numbers per site.
    pub displacement: &'a [f64],
    /// Residual `K u − f` of each dof; on prescribed dofs the reaction.
    pub residual: &'a [f64],
    /// Zone of each site.
    pub zone_of_site: &'a [Zone],
    /// The system with nonlinear forces or motion; none of a linear static scene.
    pub system: Option<&'a dyn SemiDiscrete>,
    /// Motion and damage.
    pub moved: Moved<'a>,
    /// Forces in the sections that the scene asks for.
    pub sections: &'a [SectionForce],
    /// Settings of the stresses, and the time.
    pub stresses: (&'a StressSettings<D>, f64),
}

/// The zone that each site lies in; of a node the most nonlocal one of the elements around it.
pub fn zone_of_site<const D: usize>(model: &Model<D>) -> Vec<Zone> {
    let node_zone = |site: usize| {
        model
            .cells_of_site(site)
            .map(|(c, _)| c)
            .filter(|&c| model.is_element(c))
            .map(|c| model.zones[c])
            .max()
            .unwrap_or(Zone::Local)
    };
    (0..model.sites.len())
        .map(|site| match model.sites[site].kind {
            SiteKind::Point(p) => model.zone_of_point(p as usize),
            SiteKind::Node(_) => node_zone(site),
        })
        .collect()
}

/// 0 local, 1 transition, 2 nonlocal.
pub(super) fn label(zone: Zone) -> u8 {
    match zone {
        Zone::Local => 0,
        Zone::Transition => 1,
        Zone::Nonlocal => 2,
    }
}
