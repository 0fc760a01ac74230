//! A validated scene: every name resolved, every number checked.

use std::path::PathBuf;
use std::sync::Arc;

use super::adaptive_zone::Follow;
use super::bond_output::BondSelection;
use super::conditions::Condition;
use super::failure::Breaking;
use super::impactors::Impactor;
use super::initial::Initial;
use super::load_stage::LoadStage;
use super::materials::Material;
use super::peridynamics::Peridynamics;
use super::region::Region;
use super::section::Section;
use super::solve::Solve;
use super::spec::{CouplingSpec, ElementsSpec, UnprovenSpec};
use crate::coupling::{Coupling, Local};
use crate::material::Kinematics;
use crate::mesh::Mesh;
use crate::model::Zone;
use crate::observe::checkpoint::Fingerprint;
use crate::observe::summary::Decision;
use crate::observe::warning::{Code, Policy, Warning};
use crate::peridynamics::Law;
use crate::shape::{Barrier, Shape};
use crate::solve::ordering::Ordering;
use crate::tensor::{Vector, padded};

/// A validated scene of dimension `D`.
#[derive(Clone, Debug)]
pub struct Scene<const D: usize> {
    /// Title of the scene; its name if it has none.
    pub title: String,
    /// Kinematic assumption by which the body represents a solid.
    pub kinematics: Kinematics,
    /// The mesh of the whole body.
    pub mesh: Mesh<D>,
    /// The model of each cell.
    pub zones: Vec<Zone>,
    /// The materials.
    pub materials: Vec<Material<D>>,
    /// The material of each cell.
    pub cell_material: Vec<u16>,
    /// The materials that points have, that of the first cell of the zones first; never empty.
    pub point_materials: Vec<u16>,
    /// The law of the points, of all their materials; none where no cell holds points and the first material has no law.
    pub point_law: Option<Arc<dyn Law<D>>>,
    /// The peridynamic choices; none if the scene is local throughout.
    pub peridynamics: Option<Peridynamics<D>>,
    /// Coupling of the models.
    pub coupling: CouplingSpec,
    /// Reason for the choice of the coupling; none if the scene names it.
    pub coupling_why: Option<String>,
    /// Placement of the nonlocal zone; none if the scene draws it.
    pub placement: Option<Placement>,
    /// Choices made for the accuracy that the scene wants, and for points that it does not place.
    pub choices: Vec<Decision>,
    /// Load steps before a motion, whose last state of equilibrium it begins with.
    pub before: Option<LoadStage<D>>,
    /// Displacements, tractions, body forces; of a scene in stages those that act in the last.
    pub conditions: Vec<Condition<D>>,
    /// The temperature, if the scene has one.
    pub temperature: Option<super::temperature::Temperature<D>>,
    /// Empty regions: no point lies inside.
    pub voids: Vec<Shape<D>>,
    /// Voids and cracks that cut bonds.
    pub barriers: Vec<Barrier<D>>,
    /// Type of analysis; of a scene in stages that of the last.
    pub solve: Solve,
    /// Displacements and velocities at time zero.
    pub initial: Vec<Initial<D>>,
    /// Rigid bodies that strike or press.
    pub impactors: Vec<Impactor<D>>,
    /// Deformation and fracture of bonds.
    pub breaking: Breaking<D>,
    /// Constitutive law of the elements of the points' materials.
    pub elements: ElementsSpec,
    /// Settings of a nonlocal zone that follows the crack, if it does.
    pub follow: Option<Follow>,
    /// The linear solver.
    pub solver: Solver,
    /// Output files.
    pub output: Output<D>,
    /// The scene to go on with, by another coupling or along other faces, if this one was chosen and turns out not to hold.
    pub(crate) otherwise: Option<Box<Self>>,
    /// Reason for which the zone has no rim of its own where it would gain by one.
    pub(crate) refused_rim: Option<String>,
    /// Sentences about parts that touch nothing.
    pub unused: Vec<String>,
    /// Kinds of warnings that are left out or not accepted.
    pub warnings: Policy,
    /// A number for the scene's text, by which a checkpoint knows that it belongs to it.
    pub fingerprint: Fingerprint,
}

/// Placement of the nonlocal zone of a scene that does not draw it.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// The choice, and the reason for it.
    pub choice: Decision,
    /// Seconds of all but the solution that the run goes on with.
    pub seconds: f64,
}

/// The linear solver of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solver {
    /// Method of solution.
    pub method: crate::solve::statics::Method,
    /// Elimination order of a direct one.
    pub ordering: Ordering,
    /// Relative residual.
    pub tolerance: f64,
    /// Treatment of a model that fails its proof.
    pub unproven: UnprovenSpec,
    /// Most iterations.
    pub max_iterations: usize,
}

/// The fields that a scene asks for, beside those that every solution has.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldChoice {
    /// Their names: first the numbers made of the stress.
    pub asked: Vec<String>,
    /// Count of those that are numbers made of the stress.
    pub stresses: usize,
    /// True if there is a normal stress out of the plane: in plane strain.
    pub across: bool,
}

impl FieldChoice {
    /// True if numbers made of the stress are asked for: tables then have its components too.
    pub fn has_numbers(&self) -> bool {
        self.stresses > 0
    }

    /// True if any other field is asked for.
    pub fn has_others(&self) -> bool {
        self.asked.len() > self.stresses
    }
}

/// The outputs of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Output<const D: usize> {
    /// Folder of all files.
    pub directory: PathBuf,
    /// Beginning of all file names.
    pub name: String,
    /// The stage whose files they are, of all but the last of a scene in stages.
    pub stage: Option<String>,
    /// Program and scene, as files name them: `bondline 0.1.0, scene 0123456789abcdef`.
    pub origin: String,
    /// True if a VTU is written.
    pub vtu: bool,
    /// Representation of peridynamic points in it.
    pub points: super::spec::PointOutputSpec,
    /// The fields that it asks for.
    pub fields: FieldChoice,
    /// Lines of samples: name and positions.
    pub lines: Vec<(String, Vec<Vector<D>>)>,
    /// Probes: name and position.
    pub probes: Vec<(String, Vector<D>)>,
    /// Sections through the body.
    pub sections: Vec<Section<D>>,
    /// Tips of cracks to follow.
    pub tips: Vec<Tip<D>>,
    /// Bonds that are shown as lines.
    pub bonds: Vec<BondSelection<D>>,
}

/// The tip of a crack: the farthest damaged point along a direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Tip<const D: usize> {
    /// Its name.
    pub name: String,
    /// The direction, of length 1.
    pub direction: Vector<D>,
    /// Region in which the tip is sought.
    pub inside: Region<D>,
    /// Damage from which a point counts.
    pub threshold: f64,
    /// Domains of the integrals at the tip, if the scene asks for them.
    pub domains: Option<TipDomains<D>>,
}

/// Rings around the tip of a crack, over which its energy release rate is integrated.
#[derive(Clone, Debug, PartialEq)]
pub struct TipDomains<const D: usize> {
    /// The end of the typed crack \[m\]: the tip, as long as the crack does not grow.
    pub tip: Vector<D>,
    /// The direction in which the typed crack would grow straight on, of length 1.
    pub along: Vector<D>,
    /// Radii between which the rings lie, from the smallest to the largest \[m\].
    pub radii: Vec<f64>,
    /// Lamé's parameters (λ_D, μ) of the body there \[Pa\].
    pub lame: (f64, f64),
}

impl<const D: usize> Scene<D> {
    /// Warnings of parts that touch nothing.
    pub fn unused(&self) -> Vec<Warning> {
        let of = |text: &String| Warning::new(Code::Unused, text.as_str());
        self.unused.iter().map(of).collect()
    }

    /// The method of the coupling for the law of the points; finite elements alone where there is none.
    pub fn method(&self) -> Box<dyn Coupling<D>> {
        match &self.point_law {
            Some(law) => self.coupling.build(law.linearised()),
            None => Box::new(Local),
        }
    }

    /// Returns true if the horizon varies in space.
    pub fn horizon_varies(&self) -> bool {
        self.peridynamics
            .as_ref()
            .is_some_and(|p| p.horizon.as_constant().is_none())
    }

    /// The horizon at a position; zero without peridynamics.
    pub fn horizon_at(&self, x: &Vector<D>) -> f64 {
        self.peridynamics
            .as_ref()
            .map_or(0.0, |p| p.horizon.eval(&padded(x)))
    }
}
