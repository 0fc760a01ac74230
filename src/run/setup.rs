//! From a validated scene to the problem that is coupled, and the settings that a run keeps.

use std::sync::Arc;

use crate::material::LocalLaw;
use crate::observe::checkpoint::Fingerprint;
use crate::observe::summary::{Decision, Sizes};
use crate::observe::warning::Policy;
use crate::peridynamics::PartialVolume;
use crate::peridynamics::bond_force::BondKinematics;
use crate::progress::Progress;
use crate::run::bonds;
use crate::run::error::RunError;
use crate::run::stress_settings::StressSettings;
use crate::scene::adaptive_zone::Follow;
use crate::scene::conditions::Condition;
use crate::scene::expression::Expression;
use crate::scene::failure::Breaking;
use crate::scene::impactors::Impactor;
use crate::scene::initial::Initial;
use crate::scene::load_stage::LoadStage;
use crate::scene::materials::{Material, Ratio, elastic_cells};
use crate::scene::solve::Solve;
use crate::scene::spec::{CouplingTraits, ElementsSpec};
use crate::scene::validated::{Output, Scene, Solver};
use crate::system::Ranks;
use crate::tensor::padded;
use crate::{
    coupling::{Coupling, Operator, Problem},
    model::{self, HorizonChange, HorizonField, Model, Zone, ZonedBody},
};

/// A typed horizon.
fn horizon_field<const D: usize>(horizon: Expression) -> HorizonField<D> {
    match horizon.as_constant() {
        Some(horizon) => HorizonField::Uniform(horizon),
        None => HorizonField::Field(Arc::new(move |x| horizon.eval(&padded(x)))),
    }
}

/// Settings of a scene that remain once its problem is built.
#[derive(Clone)]
pub struct RunSettings<const D: usize> {
    /// Load steps before a motion, whose last state of equilibrium it begins with.
    pub before: Option<LoadStage<D>>,
    /// Supports and loads.
    pub conditions: Vec<Condition<D>>,
    /// Solver of the systems of equations.
    pub solver: Solver,
    /// Output: quantities and files.
    pub output: Output<D>,
    /// Displacements and velocities at the start.
    pub initial: Vec<Initial<D>>,
    /// Rigid bodies that strike or press.
    pub impactors: Vec<Impactor<D>>,
    /// Failure of bonds.
    pub breaking: Breaking<D>,
    /// True for a scene in time.
    pub is_in_time: bool,
    /// Poisson's ratio of the points; none of a body whose materials have none.
    pub ratio: Option<Ratio>,
    /// Rule by which the nonlocal zone follows damage, where it does.
    pub follow: Option<Follow>,
    /// Kinds of warnings that are not accepted.
    pub warnings: Policy,
    /// A number for all that determines the results.
    pub fingerprint: Fingerprint,
    /// Model that elements of the points' materials follow.
    pub elements: ElementsSpec,
    /// The local law of each material's elements, of those whose elements are not linear by their material.
    pub local_laws: Vec<Option<Arc<dyn LocalLaw<D>>>>,
    /// All materials of the scene.
    pub materials: Vec<Material<D>>,
    /// Density of each material.
    pub density: Vec<f64>,
    /// Thermal expansion, and the stresses that are written.
    pub stresses: StressSettings<D>,
    /// The coupling, where the scene names none.
    pub chosen: Option<Decision>,
    /// Placement of the zone, where the scene draws none.
    pub placed: Option<Decision>,
    /// Choices made for the accuracy that the scene wants.
    pub choices: Vec<Decision>,
}

/// Collective: refuses processes that have read different scenes or tables, or start at different steps.
///
/// # Errors
/// [`RunError::Later`].
pub(crate) fn same_everywhere<const D: usize>(
    rest: &RunSettings<D>,
    step: u64,
    ranks: Option<&dyn Ranks>,
) -> Result<(), RunError> {
    let Some(ranks) = ranks else {
        return Ok(());
    };
    let all = ranks.gather_words(&[rest.fingerprint.value(), step]);
    if all.iter().any(|words| *words != all[0]) {
        return Err(RunError::Later {
            what: "the processes do not read the same scene or the same checkpoint",
            remedy: "run them in a folder that all of them see",
        });
    }
    Ok(())
}

impl<const D: usize> RunSettings<D> {
    /// The settings of load steps before the motion of a scene: what acts in them, and their files. All else is that of the motion, whose forces they balance.
    pub fn of_load_stage(&self, stage: &LoadStage<D>) -> Self {
        Self {
            conditions: stage.conditions.clone(),
            output: self.output.of_stage(&stage.name),
            initial: Vec::new(),
            impactors: Vec::new(),
            ..self.clone()
        }
    }

    /// Returns the choices for the accuracy, the zone and the coupling, in this order.
    pub fn made(&self) -> impl Iterator<Item = &Decision> {
        self.choices.iter().chain(&self.placed).chain(&self.chosen)
    }

    /// Returns true if elements of the model follow a law that is not linear.
    pub fn has_nonlinear_elements(&self, model: &Model<D>) -> bool {
        let laws = model.local_laws(&self.local_laws);
        let bends = |c: usize| laws[model.material_of_cell(c) as usize].is_some();
        laws.iter().any(Option::is_some)
            && (0..model.mesh.cell_count()).any(|c| model.is_element(c) && bends(c))
    }

    /// Returns true if the element of a cell follows a law for strains and rotations of any size.
    pub fn is_objective(&self, model: &Model<D>, cell: usize) -> bool {
        let law = model.local_law(&self.local_laws, model.material_of_cell(cell));
        law.is_some_and(|law| law.is_objective())
    }

    /// Returns true if the forces at a point are for small rotations: of bonds linear in the displacement, or of a local law for small strains.
    pub fn has_linear_point(&self, model: &Model<D>, point: usize) -> bool {
        match model.local_law_at(point) {
            Some(law) => !law.is_objective(),
            None => self.kinematics() == BondKinematics::Linear,
        }
    }

    /// Returns as a choice the reason why the forces of intact bonds, or of elements, depend nonlinearly on the displacement; none where they are linear.
    pub fn nonlinear(&self, model: &Model<D>) -> Option<Decision> {
        let body = model
            .peridynamics
            .as_ref()
            .filter(|_| model.body().is_some());
        let bonds = body.and_then(|p| match (self.breaking.bonds, p.law.is_linear()) {
            (BondKinematics::Linear, true) => None,
            (BondKinematics::Exact, _) => Some(("geometrically exact bonds", "bonds = \"exact\"")),
            (BondKinematics::Linear, false) => {
                Some(("bonds that are not linear", "as their law says"))
            }
        });
        let elements = || {
            self.has_nonlinear_elements(model).then_some((
                "elements that are not linear",
                match self.elements {
                    ElementsSpec::CauchyBorn => "elements = \"cauchy-born\"",
                    ElementsSpec::Linear => "as the local law of their material says",
                },
            ))
        };
        let (choice, why) = bonds.or_else(elements)?;
        Some(Decision {
            choice: choice.to_owned(),
            why: why.to_owned(),
        })
    }

    /// Kinematics of the bonds.
    pub fn kinematics(&self) -> BondKinematics {
        self.breaking.bonds
    }

    /// The coupling as a choice: why it was made, or what it does if the scene names it.
    pub fn coupling(&self, traits: CouplingTraits) -> Decision {
        self.chosen.clone().unwrap_or_else(|| Decision {
            choice: format!("coupling {}", traits.name),
            why: traits.about.to_owned(),
        })
    }
}

/// The problem of a scene, and what remains of the scene; of a temperature that is solved for it knows the reference alone, which is enough for sizes and estimates.
pub fn problem<const D: usize>(scene: Scene<D>) -> (Problem<D>, RunSettings<D>) {
    let stresses = StressSettings::of(&scene);
    let material = scene.point_materials[0];
    // of several the one that is farthest below bonds that act alone
    let ratios = scene.point_materials.iter().filter_map(|&m| {
        let lame = scene.materials[usize::from(m)].lame()?;
        Some(Ratio::new(lame, scene.kinematics))
    });
    let ratio = ratios.min_by(|a, b| a.typed.total_cmp(&b.typed));
    let method = scene.method();
    let chosen = scene.coupling_why.map(|why| Decision {
        choice: format!("coupling {}", scene.coupling.traits().name),
        why,
    });
    let cells = scene.cell_material;
    let elastic = elastic_cells(&scene.materials, cells, material, &scene.mesh);
    let density = scene.materials.iter().map(|m| m.density).collect();
    let (voids, barriers) = (scene.voids, scene.barriers);
    let points = scene.peridynamics.zip(scene.point_law);
    let peridynamics = points.map(|(p, law)| model::Peridynamics {
        horizon_change: p.horizon_change,
        law,
        horizon: horizon_field(p.horizon),
        points: p.points,
        weights: p.weights,
        volumes: p.volumes,
        barriers,
        voids,
        surfaces: p.surfaces,
    });
    (
        Problem {
            body: ZonedBody {
                mesh: scene.mesh,
                zones: scene.zones,
                elastic,
                peridynamics,
            },
            coupling: method,
        },
        RunSettings {
            before: scene.before,
            conditions: scene.conditions,
            solver: scene.solver,
            warnings: scene.warnings,
            output: scene.output,
            initial: scene.initial,
            impactors: scene.impactors,
            is_in_time: matches!(scene.solve, Solve::Explicit(_)),
            breaking: scene.breaking,
            ratio,
            follow: scene.follow,
            fingerprint: scene.fingerprint,
            elements: scene.elements,
            local_laws: stresses.local_laws.clone(),
            materials: scene.materials,
            density,
            stresses,
            chosen,
            placed: scene.placement.map(|p| p.choice),
            choices: scene.choices,
        },
    )
}

/// The model of a problem, whose elements follow what the scene says of them.
///
/// # Errors
/// [`RunError::Model`] for one that cannot be laid out, [`RunError::NoBonds`] for output without a bond.
pub(crate) fn model<const D: usize>(
    problem: Problem<D>,
    rest: &RunSettings<D>,
    progress: &dyn Progress,
) -> Result<(Model<D>, Box<dyn Coupling<D>>), RunError> {
    let found = shared_model(problem, rest, None, progress)?;
    bonds::check(&found.0, &rest.output, None)?;
    Ok(found)
}

/// Collective: as [`model`], with its families spread over processes where they can be.
///
/// # Errors
/// [`RunError::Model`] for one that cannot be laid out.
pub(crate) fn shared_model<const D: usize>(
    problem: Problem<D>,
    rest: &RunSettings<D>,
    ranks: Option<&dyn Ranks>,
    progress: &dyn Progress,
) -> Result<(Model<D>, Box<dyn Coupling<D>>), RunError> {
    let (mut model, coupling) = problem.lay_out(ranks, progress)?;
    if rest.elements == ElementsSpec::CauchyBorn {
        model.follow_bonds(rest.kinematics())?;
    }
    Ok((model, coupling))
}

/// Sizes of a model; it has no stiffness.
pub fn sizes<const D: usize>(model: &Model<D>, operator: &Operator<'_, D>) -> Sizes {
    Sizes {
        nodes: model.mesh.nodes.len(),
        cells: model.mesh.cell_count(),
        sites: model.sites.len(),
        points: (0..model.sites.len())
            .filter(|&site| model.point_of(site).is_some())
            .count(),
        bonds: model.bond_count() + operator.additional_bonds(),
        dofs: model.sites.len() * D,
        nonzeros: 0,
    }
}

/// Properties of a model worth knowing before it is solved: partial volumes, points on a border of materials, sizes of elements beside the points.
pub fn model_choices<const D: usize>(model: &Model<D>) -> Vec<Decision> {
    let all = [
        volumes_choice(model),
        horizon_choice(model),
        border_choice(model),
        elements_choice(model),
    ];
    all.into_iter().flatten().collect()
}

/// Says by which rule bonds join points of different horizons, where they do.
fn horizon_choice<const D: usize>(model: &Model<D>) -> Option<Decision> {
    let (p, body) = (model.peridynamics.as_ref()?, model.body()?);
    let why = match p.horizon_change {
        // of a transition zone the stresses of points count
        HorizonChange::Dual
            if model.zones.contains(&Zone::Transition) || !body.mixes_horizons() =>
        {
            return None;
        }
        HorizonChange::Dual => {
            "each point has the force state of its own horizon, which acts at both ends of its bonds: forces are pairs"
        }
        HorizonChange::MultiHorizon => {
            "a bond has the larger horizon of its ends, weakened for the other: forces are pairs"
        }
        HorizonChange::Splice => {
            "each point sees all others with its own horizon: a uniform strain leaves no force, and forces are no pairs"
        }
    };
    Some(Decision {
        choice: format!(
            "horizons change by the rule \"{}\"",
            p.horizon_change.name()
        ),
        why: why.to_owned(),
    })
}

/// Says how large the elements beside the points are, where there are both.
fn elements_choice<const D: usize>(model: &Model<D>) -> Option<Decision> {
    model.body()?;
    let mesh = &model.mesh;
    let mut is_beside = vec![false; mesh.nodes.len()];
    for c in (0..mesh.cell_count()).filter(|&c| !model.is_element(c)) {
        mesh.cell(c)
            .iter()
            .for_each(|&n| is_beside[n as usize] = true);
    }
    let beside = (0..mesh.cell_count())
        .filter(|&c| model.is_element(c) && mesh.corners(c).iter().any(|&n| is_beside[n as usize]));
    let sizes = beside.map(|c| {
        let (low, high) = mesh.bounds_of(mesh.corners(c));
        (high - low).amax() / model.spacing()
    });
    let (least, most) = sizes.fold((f64::INFINITY, 0.0f64), |(least, most), size| {
        (least.min(size), most.max(size))
    });
    (most > 0.0).then(|| Decision {
        choice: match most - least < 0.05 {
            true => format!("elements of {most:.1} spacings beside the points"),
            false => format!("elements of {least:.1} to {most:.1} spacings beside the points"),
        },
        why: match mesh.embedded.has_patch() {
            true => "those of the rim",
            false => "as the mesh has them; one to four are usual",
        }
        .to_owned(),
    })
}

/// Says how many points lie on a border of two materials, if any do.
fn border_choice<const D: usize>(model: &Model<D>) -> Option<Decision> {
    let points = model.points_on_border();
    (points > 0).then(|| Decision {
        choice: format!("{points} points on a border of two materials"),
        why: "they have the one whose name comes first; peridynamics.points.lattice.origin half a spacing on parts them".to_owned(),
    })
}

/// Says which partial volumes are in use, if not full ones.
fn volumes_choice<const D: usize>(model: &Model<D>) -> Option<Decision> {
    let volumes = model.peridynamics.as_ref()?.volumes;
    let why = match volumes {
        PartialVolume::Full => return None,
        PartialVolume::PdLammps => "a ramp over the last half spacing within the horizon",
        PartialVolume::Hhb => "a ramp over the spacing about the horizon",
        PartialVolume::Exact => "what the horizon cuts from each cell of the lattice",
    };
    Some(Decision {
        choice: format!("{volumes:?} partial volumes"),
        why: why.to_owned(),
    })
}
