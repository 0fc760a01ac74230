//! Errors of the run of a valid scene.

use crate::coupling::semidiscrete::behaviour::SystemError;
use std::sync::Arc;

use crate::material::LocalLaw;
use crate::observe::ObserveError;
use crate::observe::checkpoint::CheckpointError;
use crate::observe::warning::Warning;
use crate::peridynamics::FractureError;
use crate::solve::explicit::ExplicitError;
use crate::solve::quasi_static::QuasiStaticError;
use crate::solve::stable_step::StepError;
use crate::solve::statics::StaticError;
use crate::solve::sub_cycling::SubCyclingError;
use crate::{
    coupling::CarryError,
    model::{Model, ModelError},
};

/// Error of the run of a valid scene.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The model cannot be built.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The system cannot be solved.
    #[error(transparent)]
    Solve(#[from] StaticError),
    /// A result cannot be written.
    #[error(transparent)]
    Observe(#[from] ObserveError),
    /// The motion cannot start or go on.
    #[error(transparent)]
    Explicit(#[from] ExplicitError),
    /// The run cannot go on from a checkpoint.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A load step has no solution.
    #[error(transparent)]
    QuasiStatic(#[from] QuasiStaticError),
    /// The time step, or the model at any step, is not stable.
    #[error(transparent)]
    Step(#[from] StepError),
    /// The stiffest sites cannot take sub-steps.
    #[error(transparent)]
    SubCycling(#[from] SubCyclingError),
    /// The bonds cannot move.
    #[error(transparent)]
    System(#[from] SystemError),
    /// The fracture energy gives no critical stretch.
    #[error("the material of the points cannot break: {0}")]
    Fracture(#[from] FractureError),
    /// The seam may have a negative stiffness, and nothing shows that it has none.
    #[error(
        "{}: {what}; {}",
        match typed < pairwise {
            true => format!("Poisson's ratio {typed:.4} is below {pairwise:.4}, that of bonds that act alone, and the seam of coupling `truncated` then has dilatations of a negative stiffness"),
            false => "the faces of the nonlocal zone leave pieces of bonds that the seam of coupling `truncated` can only balance with a negative stiffness".to_owned(),
        },
        match typed < pairwise {
            true => "couple by splice or blending, or take a larger poisson-ratio",
            false => "leave peridynamics.points out, whose lattice follows the mesh, enlarge the zone, end it off the surface of the body, or couple by splice or blending",
        }
    )]
    Indefinite {
        /// The finding against the matrix.
        what: String,
        /// Poisson's ratio of the material.
        typed: f64,
        /// The ratio of a pairwise law.
        pairwise: f64,
    },
    /// No coupling that the program would choose holds, along no faces.
    #[error("no coupling that was tried holds{}", each_tried(tried))]
    NoCoupling {
        /// The couplings in the order in which they were tried, and why each does not hold.
        tried: Vec<(String, RunError)>,
    },
    /// The steady temperature of a part of the body is known but for a constant.
    #[error(
        "heat conduction: nothing prescribes the temperature of {nodes} nodes around ({}); give that part of the body a temperature or a convection condition, or type temperature.conduction.initial for a transient temperature",
        place.iter().map(|x| format!("{x:.4e}")).collect::<Vec<_>>().join(", ")
    )]
    LooseTemperature {
        /// Number of nodes.
        nodes: usize,
        /// Position of one of them.
        place: Vec<f64>,
    },
    /// The zone cannot have a rim of its own.
    #[error("{0}")]
    Rim(String),
    /// A condition that begins with a motion prescribes another displacement than load steps before it have left.
    #[error(
        "`conditions.{condition}` prescribes the {axis} displacement {prescribed:.6e} at ({}), where the load steps have left {left:.6e}: the body would jump; prescribe a velocity, which begins where the body is, let the condition act in the load steps as well, or free the component",
        place.iter().map(|x| format!("{x:.4e}")).collect::<Vec<_>>().join(", ")
    )]
    Jump {
        /// The condition.
        condition: String,
        /// The axis.
        axis: &'static str,
        /// A site that it holds, at rest.
        place: Vec<f64>,
        /// Displacement that it prescribes at time zero.
        prescribed: f64,
        /// The displacement of the load steps.
        left: f64,
    },
    /// Several processes run a scene in stages.
    #[error(
        "several processes run a scene in stages, and the load steps of `{stage}` leave their state on one of them; run it by one process"
    )]
    LoadStageShared {
        /// The load steps.
        stage: String,
    },
    /// The state cannot be carried over to other zones.
    #[error(transparent)]
    Carry(#[from] CarryError),
    /// The model has a property of which the scene denies warnings.
    #[error("{}; warnings.deny has {}", .0.message, .0.code)]
    Denied(Box<Warning>),
    /// A check of the model failed, so that no result of it can be trusted.
    #[error("{message}; or let it run with solver.unproven = \"warn\"")]
    Unproven {
        /// The defect, its size and a remedy.
        message: String,
        /// Place, one coordinate per dimension; empty where no single place is to blame.
        place: Vec<f64>,
    },
    /// A ring around the tip of a crack leaves the body.
    #[error("`output.tips.{tip}`: the rings around the tip leave the body; type smaller `radii`")]
    TipOutside {
        /// The tip, as the scene names it.
        tip: String,
    },
    /// Something that is planned and not there yet.
    #[error("{what}: {remedy}")]
    Later {
        /// The feature that was asked for.
        what: &'static str,
        /// Alternative.
        remedy: &'static str,
    },
    /// A local law failed, and with it the motion.
    #[error("{}{failure}. {source}", place.as_ref().map_or(String::new(), |x| {
        let x: Vec<String> = x.iter().map(|x| format!("{x:.4e}")).collect();
        format!("at ({}): ", x.join(", "))
    }))]
    Law {
        /// Message of the law.
        failure: String,
        /// The site that the motion or the load step names.
        place: Option<Vec<f64>>,
        /// Error with which the failure ended the run.
        source: Box<RunError>,
    },
    /// The scene needs more memory than there is.
    #[error(
        "the scene needs about {needed} of memory, {there} are there: {largest} ({sizes}); {remedy}"
    )]
    Memory {
        /// Memory that the scene needs.
        needed: String,
        /// The budget, [`memory_budget`](super::memory_budget).
        there: String,
        /// The three largest items.
        largest: String,
        /// Counts from which it was estimated.
        sizes: String,
        /// Remedy.
        remedy: String,
    },
    /// A section with all sites of the model on one side.
    #[error(
        "the section `{section}` has {} sites of the model beyond it; {}",
        match sites { 0 => "no", _ => "all" },
        match sites { 0 => "move its point, or turn its normal to the part whose force is to be told, or enlarge `inside`", _ => "move its point into the body" }
    )]
    EmptySection {
        /// Its name.
        section: String,
        /// Number of sites beyond it.
        sites: usize,
    },
    /// A selection of bonds without any.
    #[error("`output.bonds.{selection}`: {remedy}")]
    NoBonds {
        /// Its name.
        selection: String,
        /// The reason, and the remedy.
        remedy: &'static str,
    },
    /// An impactor lies over the body at time zero.
    #[error(
        "the impactor `{impactor}` lies over the body at time zero, by {depth:.4e} at ({}): move it back by as much", place.iter().map(|x| format!("{x:.4e}")).collect::<Vec<_>>().join(", ")
    )]
    Overlap {
        /// Its name.
        impactor: String,
        /// Depth by which the body lies inside the impactor \[m\].
        depth: f64,
        /// Position of the greatest depth.
        place: Vec<f64>,
    },
    /// Surfaces lie in each other at time zero.
    #[error(
        "contact: surfaces lie in each other at time zero, by {depth:.4e} at ({}): move the bodies apart{}",
        place.iter().map(|x| format!("{x:.4e}")).collect::<Vec<_>>().join(", "),
        adjust.map_or(String::new(), |a| format!(", or type contact.adjust = {a:.1e}, for surfaces that just touch there"))
    )]
    SurfacesOverlap {
        /// Depth \[m\].
        depth: f64,
        /// Position of the greatest depth.
        place: Vec<f64>,
        /// Distance of adjustment that would do \[m\]; none where it would be more than half a cell.
        adjust: Option<f64>,
    },
    /// A condition meets no site.
    #[error("the condition `{condition}` meets no site of the model; {remedy}")]
    Idle {
        /// Its name.
        condition: String,
        /// Remedy.
        remedy: &'static str,
    },
}

fn each_tried(tried: &[(String, RunError)]) -> String {
    let one = |(name, why): &(String, RunError)| format!(". {name}: {why}");
    tried.iter().map(one).collect()
}

impl RunError {
    /// Returns the place of the error, if that is known: a position, the key of a condition, or a file.
    pub fn place(&self) -> Option<String> {
        let at = |x: &[f64]| {
            let x: Vec<String> = x.iter().map(|x| format!("{x:.4e}")).collect();
            (!x.is_empty()).then(|| format!("({})", x.join(", ")))
        };
        match self {
            Self::Denied(warning) => at(&warning.place),
            Self::LooseTemperature { place, .. } => at(place),
            Self::Unproven { place, .. } => at(place),
            Self::Law { place, source, .. } => match place {
                Some(place) => at(place),
                None => source.place(),
            },
            Self::Model(error) => error.position().and_then(at),
            Self::Solve(StaticError::Singular { positions, .. }) => {
                positions.first().and_then(|x| at(x))
            }
            Self::Solve(StaticError::NotFinite { position, .. }) => at(position),
            Self::Observe(error) => Some(error.path().display().to_string()),
            Self::Checkpoint(error) => Some(error.path().display().to_string()),
            Self::NoCoupling { tried } => tried.last().and_then(|(_, error)| error.place()),
            Self::Idle { condition, .. } => Some(format!("conditions.{condition}")),
            Self::EmptySection { section, .. } => Some(format!("output.sections.{section}")),
            Self::NoBonds { selection, .. } => Some(format!("output.bonds.{selection}")),
            _ => None,
        }
    }
}

/// The error of a motion, or of a load step, with what a local law says that failed in it.
pub(crate) fn explained<const D: usize>(
    error: RunError,
    model: &Model<D>,
    laws: &[Option<Arc<dyn LocalLaw<D>>>],
) -> RunError {
    let Some(failure) = laws.iter().flatten().find_map(|law| law.failure()) else {
        return error;
    };
    let site = match &error {
        RunError::Explicit(
            ExplicitError::NotFinite { site, .. } | ExplicitError::Runaway { site, .. },
        )
        | RunError::QuasiStatic(
            QuasiStaticError::NotFinite { site, .. }
            | QuasiStaticError::NoEquilibrium { site, .. }
            | QuasiStaticError::RanAway { site, .. },
        ) => Some(*site),
        RunError::QuasiStatic(QuasiStaticError::Linear { .. }) => None,
        _ => return error,
    };
    let site = site.and_then(|site| model.sites.get(site));
    RunError::Law {
        failure,
        place: site.map(|site| site.position.as_slice().to_vec()),
        source: Box::new(error),
    }
}
