//! Validation of a scene as typed: each part is read by its own file, the parts are checked against each other here.
//!
//! A scene may leave the nonlocal zone to the program (`zones = "auto"`), which takes solutions to find: what is validated without it is a [`Draft`], and whoever knows the
//! zone makes the scene.

use std::path::Path;
use std::sync::Arc;

use super::bounds_checks;
use super::condition_list;
use super::conditions::Condition;
use super::error::SceneError;
use super::impactors::{self, Impactor};
use super::initial::Initial;
use super::load_stage::LoadStage;
use super::material_interfaces::MaterialInterface;
use super::materials::{self, Material};
use super::meshing;
use super::peridynamics::{self, Peridynamics};
use super::solve::{Clock, Solve};
use super::spec::{
    CouplingSpec, ElementsSpec, InfluenceSpec, MaterialSpec, SceneSpec, ZonesNeeded,
};
use super::stages::Stages;
use super::table_rows;
use super::temperature::{self, Temperature};
use super::unused::Parts;
use super::user_material;
use super::validated::{Scene, Solver};
use super::zones::Placed;
use super::{
    adaptive_zone, agreement, coupling_selection, crack_tips, cracks_and_voids, elements, failure,
    horizon_change, initial, lattice_regions, material_interfaces, output, point_file, solve,
    zones,
};
use crate::material::Kinematics;
use crate::mesh::Mesh;
use crate::model::{PointSource, Zone};
use crate::observe::checkpoint::Fingerprint;
use crate::observe::report::{components, number};
use crate::observe::summary::Decision;
use crate::peridynamics::bond_force::BondKinematics;
use crate::peridynamics::{Influence, Law};
use crate::scene::selected_coupling::SelectedCoupling;

/// A scene that is validated but for its nonlocal zone, and for what follows from that.
pub(crate) struct Draft<'a, const D: usize> {
    pub spec: &'a SceneSpec,
    pub kinematics: Kinematics,
    pub mesh: Mesh<D>,
    pub materials: Vec<Material<D>>,
    pub cell_material: Vec<u16>,
    pub solve: Solve,
    pub before: Option<LoadStage<D>>,
    pub conditions: Vec<Condition<D>>,
    pub temperature: Option<Temperature<D>>,
    pub initial: Vec<Initial<D>>,
    pub impactors: Vec<Impactor<D>>,
    pub solver: Solver,
    /// Beginning of the names of its files.
    pub name: &'a str,
    pub fingerprint: Fingerprint,
    /// Horizon and points, where they were chosen with another mesh.
    pub lattice: Option<Peridynamics<D>>,
}

impl<'a, const D: usize> Draft<'a, D> {
    /// Validates what does not depend on the zone; relative paths start in `directory`.
    ///
    /// # Errors
    /// A [`SceneError`] with place, value and remedy.
    pub fn new(
        spec: &'a SceneSpec,
        directory: &Path,
        name: &'a str,
        mut fingerprint: Fingerprint,
    ) -> Result<Self, SceneError> {
        let kinematics = *spec.kinematics.get_ref();
        let solver = solver(spec)?;
        table_rows::read_files(&spec.tables, directory, &mut fingerprint)?;
        let may_touch = spec.contact.is_some();
        let label = spec.kinematics.span();
        let mesh = match (point_file::of(spec), &spec.mesh) {
            (Some(file), _) => point_file::body::<D>(spec, file, directory)?,
            (None, Some(mesh)) => meshing::build::<D>(mesh, directory, &label, may_touch)?,
            (None, None) => return Err(meshing::missing()),
        };
        let influence = match spec
            .peridynamics
            .as_ref()
            .and_then(|p| p.influence.as_ref())
        {
            Some(i) => peridynamics::influence("peridynamics.influence", i)?,
            None => default_influence()?,
        };
        let (materials, cell_material) =
            materials::materials(&spec.materials, influence, kinematics, &mesh, directory)?;
        for (name, material) in &spec.materials {
            if let MaterialSpec::Umat(m) = material {
                user_material::add_library(name, m, directory, &mut fingerprint)?;
            }
        }
        let is_objective = |m: &Material<D>| {
            let local = m.local_law();
            local.is_some_and(|law| law.is_objective())
        };
        let has_large_strains = materials.iter().any(is_objective);
        let solve = match Stages::of(spec)? {
            None => solve::solve(spec.solve.as_ref(), has_large_strains)?,
            Some(stages) => stages.motion(has_large_strains)?,
        };
        let clock = solve.clock();
        let (before, conditions) = conditions(spec, &mesh, &solve)?;
        let initial = initial::initial(&spec.initial, &mesh, clock)?;
        let impactors = impactors::impactors(spec, &solve)?;
        let stuff = (materials.as_slice(), cell_material.as_slice());
        let temperature = temperature::temperature(spec, &mesh, stuff, of_heat(&before, clock))?;
        agreement::has_axes(spec, stuff, &mesh)?;
        meshing::add_mesh(&mesh, &mut fingerprint);
        Ok(Self {
            spec,
            kinematics,
            mesh,
            materials,
            cell_material,
            solve,
            before,
            conditions,
            temperature,
            initial,
            impactors,
            solver,
            name,
            fingerprint,
            lattice: None,
        })
    }

    /// The same scene on another mesh of the body, with horizon and points as they were chosen on this one.
    ///
    /// # Errors
    /// A [`SceneError`] for a condition that the other mesh does not bear.
    pub fn on_mesh(
        &self,
        mesh: Mesh<D>,
        cell_material: Vec<u16>,
        lattice: Option<Peridynamics<D>>,
    ) -> Result<Self, SceneError> {
        let (spec, clock) = (self.spec, self.solve.clock());
        agreement::has_axes(spec, (&self.materials, &cell_material), &mesh)?;
        let (before, conditions) = conditions(spec, &mesh, &self.solve)?;
        Ok(Self {
            spec,
            kinematics: self.kinematics,
            materials: self.materials.clone(),
            cell_material,
            temperature: (self.temperature.as_ref())
                .map(|t| t.on_mesh(&mesh, of_heat(&before, clock)))
                .transpose()?,
            before,
            conditions,
            initial: initial::initial(&spec.initial, &mesh, clock)?,
            impactors: self.impactors.clone(),
            solve: self.solve.clone(),
            solver: self.solver,
            name: self.name,
            fingerprint: self.fingerprint.clone(),
            lattice,
            mesh,
        })
    }

    /// The scene with the zone that was placed; with the one that it draws where none was.
    ///
    /// # Errors
    /// A [`SceneError`] with place, value and remedy.
    pub fn scene(&self, placed: Option<&Placed>) -> Result<Scene<D>, SceneError> {
        let (mut scene, otherwise) = self.with_coupling(placed, None)?;
        if let Some(coupling) = otherwise.filter(|_| placed.is_none()) {
            // an alternative that is wrong itself is none
            let other = self.with_coupling(None, Some(&coupling)).ok();
            scene.otherwise = other.map(|(other, _)| Box::new(other));
        }
        let unused = |scene: &Scene<D>| {
            let spec = self.spec;
            Parts { spec, scene }.unused()
        };
        scene.unused = unused(&scene);
        if let Some(other) = &mut scene.otherwise {
            other.unused = unused(other);
        }
        Ok(scene)
    }

    /// Refuses a coupling with a peridynamic side in a scene without [peridynamics].
    fn refuse_missing_peridynamics(&self, selected: &SelectedCoupling) -> Result<(), SceneError> {
        let traits = selected.traits;
        if self.spec.peridynamics.is_none()
            && !matches!(traits.zones, ZonesNeeded::Everywhere(Zone::Local))
        {
            return Err(SceneError::missing(format!(
                "coupling `{}` needs [peridynamics]",
                traits.name
            ))
            .label(selected.span.clone(), "has a peridynamic side")
            .help("add [peridynamics] with horizon = ..., or use coupling = \"local\""));
        }
        Ok(())
    }

    /// The materials of the points, and their law.
    fn point_materials(
        &self,
        coupling: &CouplingSpec,
        p: Option<&Peridynamics<D>>,
        zones: &[Zone],
    ) -> Result<PointMaterials<D>, SceneError> {
        let (spec, materials) = (self.spec, &self.materials);
        let used = material_interfaces::materials_of_points(&self.cell_material, zones);
        let interfaces = material_interfaces::interfaces(spec, materials)?;
        material_interfaces::check(spec, coupling, p, materials, &used, &interfaces)?;
        let law = material_interfaces::law_of_points(spec, materials, &used, &interfaces)?;
        Ok(PointMaterials {
            told: material_interfaces::choice(materials, &used, &interfaces),
            used,
            law,
            interfaces,
        })
    }

    /// Refuses a horizon that is missing where bonds break, or below the spacing.
    fn check_horizon(
        &self,
        p: Option<&Peridynamics<D>>,
        used: &[u16],
        zones: &[Zone],
    ) -> Result<(), SceneError> {
        let Some(p) = p else {
            return Ok(());
        };
        let taken = (p.horizon_why.as_ref()).and(p.horizon.as_constant());
        let of_points = used.iter().map(|&m| &self.materials[usize::from(m)]);
        agreement::horizon_where_bonds_break(self.spec, taken, &self.solve, of_points)?;
        agreement::horizon(self.spec, p, &self.mesh, zones)
    }

    /// Refuses laws that do not agree with the coupling, the elements, or the want of time.
    fn check_laws(
        &self,
        coupling: &CouplingSpec,
        used: &[u16],
        zones: &[Zone],
    ) -> Result<(), SceneError> {
        let (spec, materials, cells) = (self.spec, &self.materials, &self.cell_material);
        for &material in used {
            agreement::balanced_seam(spec, coupling, materials, cells, material)?;
            agreement::cut_bonds(spec, coupling, &materials[usize::from(material)])?;
        }
        agreement::elastic_elements(spec, materials, cells, zones)?;
        agreement::crack_bands(spec, materials, cells, (&self.mesh, zones))?;
        agreement::drag(spec, materials, used)?;
        agreement::memory(spec, materials, cells, zones)
    }

    /// Law of the elements.
    fn elements(
        &self,
        coupling: &CouplingSpec,
        used: &[u16],
        law: Option<&dyn Law<D>>,
        bonds: BondKinematics,
    ) -> Result<ElementsSpec, SceneError> {
        elements::elements(self.spec, coupling, (&self.materials, used), law, bonds)
    }

    /// Refuses a temperature whose strain is not known.
    fn check_heat(
        &self,
        coupling: &CouplingSpec,
        elements: ElementsSpec,
    ) -> Result<(), SceneError> {
        let (spec, materials) = (self.spec, &self.materials);
        temperature::agrees(
            (spec, self.kinematics),
            materials,
            (coupling, elements),
            &self.solve,
        )
    }

    /// The scene with the coupling that it names, or with another one `instead`; and the coupling to go on with if that one turns out not to hold.
    pub(super) fn with_coupling(
        &self,
        placed: Option<&Placed>,
        instead: Option<&CouplingSpec>,
    ) -> Result<(Scene<D>, Option<CouplingSpec>), SceneError> {
        let (spec, mesh) = (self.spec, &self.mesh);
        let materials = (&self.materials[..], &self.cell_material[..]);
        let mut selected = coupling_selection::selected(spec, materials, mesh, placed, instead)?;
        let traits = selected.traits;
        self.refuse_missing_peridynamics(&selected)?;
        let mut zones = zones::zones(spec, &selected, mesh, placed)?;
        let peridynamics = match (&self.lattice, &spec.peridynamics) {
            (Some(chosen), _) => Some(chosen.clone()),
            (None, None) => None,
            (None, Some(p)) => Some(peridynamics::peridynamics(p, traits.lattice, mesh, &zones)?),
        };
        agreement::has_laws(spec, materials, (mesh, zones.as_slice()))?;
        let choices: Vec<Decision> = peridynamics.iter().flat_map(lattice_choices).collect();
        let peridynamics = peridynamics
            .map(|p| {
                let p = horizon_change::with_rule(spec, traits, p)?;
                lattice_regions::bodies(spec, traits, p, mesh, &mut zones)
            })
            .transpose()?;
        let points = self.point_materials(&selected.coupling, peridynamics.as_ref(), &zones)?;
        let (used, law) = (points.used, points.law);
        horizon_change::check_law(spec, peridynamics.as_ref(), law.as_deref())?;
        self.check_horizon(peridynamics.as_ref(), &used, &zones)?;
        let (voids, barriers) = cracks_and_voids::obstacles(spec, mesh, &zones)?;
        densities(spec, &self.materials, &self.solve)?;
        self.check_laws(&selected.coupling, &used, &zones)?;
        let breaking = failure::breaking(spec, &self.materials, &used, points.interfaces, mesh)?;
        let elements = self.elements(&selected.coupling, &used, law.as_deref(), breaking.bonds)?;
        self.check_heat(&selected.coupling, elements)?;
        let follow = adaptive_zone::follow(
            spec,
            &mut selected,
            &self.solve,
            &breaking,
            peridynamics.as_ref().zip(law.as_deref()),
            mesh,
            |c| self.cell_material[c] == used[0],
        )?;
        let by = (self.name, &self.fingerprint);
        let output = output::output(spec, (mesh, self.kinematics), &voids, by)?;
        let scene = Scene {
            title: spec.title.clone().unwrap_or_else(|| self.name.to_owned()),
            kinematics: self.kinematics,
            mesh: mesh.clone(),
            zones,
            materials: self.materials.clone(),
            cell_material: self.cell_material.clone(),
            point_materials: used,
            point_law: law,
            peridynamics,
            coupling: selected.coupling,
            coupling_why: selected.why,
            placement: None,
            choices: choices.into_iter().chain(points.told).collect(),
            before: self.before.clone(),
            conditions: self.conditions.clone(),
            temperature: self.temperature.clone(),
            voids,
            barriers,
            solve: self.solve.clone(),
            initial: self.initial.clone(),
            impactors: self.impactors.clone(),
            breaking,
            elements,
            follow,
            solver: self.solver,
            output,
            otherwise: None,
            refused_rim: None,
            unused: Vec::new(),
            warnings: spec.warnings.policy(),
            fingerprint: self.fingerprint.clone(),
        };
        Ok((crack_tips::laid_out(spec, scene)?, selected.otherwise))
    }
}

/// Supports and loads of a scene, on a mesh: of one in stages those of the load steps before, and those of the motion.
///
/// # Errors
/// A [`SceneError`] with place, value and remedy.
fn conditions<const D: usize>(
    spec: &SceneSpec,
    mesh: &Mesh<D>,
    solve: &Solve,
) -> Result<(Option<LoadStage<D>>, Vec<Condition<D>>), SceneError> {
    match Stages::of(spec)? {
        None => Ok((
            None,
            condition_list::conditions(&spec.conditions, mesh, solve.clock())?,
        )),
        Some(stages) => {
            let (before, conditions) = stages.conditions(&spec.conditions, mesh, solve)?;
            Ok((Some(before), conditions))
        }
    }
}

/// The clock of the temperature, which lasts through all stages.
fn of_heat<const D: usize>(before: &Option<LoadStage<D>>, clock: Clock) -> Clock {
    match before {
        None => clock,
        Some(_) => Clock::lasting(),
    }
}

/// Materials and law of the points.
struct PointMaterials<const D: usize> {
    /// Their materials.
    used: Vec<u16>,
    law: Option<Arc<dyn Law<D>>>,
    interfaces: Vec<MaterialInterface>,
    /// The decision that names them, if there are several.
    told: Option<Decision>,
}

/// Says what horizon and points are, as far as the scene leaves them out.
fn lattice_choices<const D: usize>(p: &Peridynamics<D>) -> Vec<Decision> {
    let both = [horizon_choice(p), points_choice(p)];
    both.into_iter().flatten().collect()
}

/// Says how large a horizon is that the scene does not type.
fn horizon_choice<const D: usize>(p: &Peridynamics<D>) -> Option<Decision> {
    let why = p.horizon_why.clone()?;
    let horizon = p.horizon.as_constant()?;
    Some(Decision {
        choice: format!("horizon {}", number(horizon)),
        why,
    })
}

/// Says where points lie that the scene does not place.
fn points_choice<const D: usize>(p: &Peridynamics<D>) -> Option<Decision> {
    let PointSource::Lattice { spacing, origin } = &p.points else {
        return None;
    };
    Some(Decision {
        choice: format!(
            "points on a lattice of spacing {}, one of them at ({})",
            number(*spacing),
            components(origin.as_slice())
        ),
        why: p.points_why.clone()?,
    })
}

/// Refuses a motion without inertia.
fn densities<const D: usize>(
    spec: &SceneSpec,
    found: &[Material<D>],
    solve: &Solve,
) -> Result<(), SceneError> {
    let light = found.iter().find(|m| m.density <= 0.0);
    let Some(light) = light.filter(|_| matches!(solve, Solve::Explicit(_))) else {
        return Ok(());
    };
    let span = spec.span_of_material(&light.name);
    Err(SceneError::missing(format!("the material `{}` has no density, which [solve.explicit] needs", light.name))
        .label(span, "has no inertia")
        .help("add density = ..., in the units of the scene (kg/m³ beside N and m; t/mm³ beside N and mm)"))
}

fn default_influence() -> Result<Influence, SceneError> {
    peridynamics::influence(
        "peridynamics.influence",
        &InfluenceSpec::Polynomial(super::spec::PolynomialSpec {
            degree: super::value::Count {
                value: 3,
                span: 0..0,
            },
            alpha: super::value::Count::default(),
        }),
    )
}

fn solver(spec: &SceneSpec) -> Result<Solver, SceneError> {
    let s = &spec.solver;
    let tolerance = match &s.tolerance {
        Some(t) => bounds_checks::within(
            "solver.tolerance",
            t,
            t.value > 0.0 && t.value < 1.0,
            "must lie between 0 and 1",
            "1e-10 suits most scenes",
        )?,
        None => 1e-10,
    };
    let max_iterations = match &s.max_iterations {
        Some(n) if n.value == 0 => {
            return Err(SceneError::wrong_value("`solver.max-iterations` is 0")
                .label(n.span.clone(), "no iteration")
                .help("allow at least 1; 500 suits most scenes"));
        }
        Some(n) => n.value,
        None => 500,
    };
    Ok(Solver {
        method: s.method,
        ordering: s.ordering,
        unproven: s.unproven,
        tolerance,
        max_iterations,
    })
}
