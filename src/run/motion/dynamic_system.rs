//! The dynamic system of a scene: its forces, its masses and its initial state.

#![deny(clippy::wildcard_enum_match_arm)]

use crate::coupling::semidiscrete::behaviour::{BondBehaviour, BondThreshold, SystemError};
use crate::coupling::semidiscrete::{CoupledSystem, masses};
use crate::fem::Locator;
use crate::observe::report::number;
use crate::observe::summary::Decision;
use crate::peridynamics::bond_force::{BondKinematics, BondSoftening, Storage};
use crate::peridynamics::critical_stretch as failure_stretch;
use crate::peridynamics::failure::{Fracture, Threshold};
use crate::progress::Progress;
use crate::run::definiteness;
use crate::run::equilibrium;
use crate::run::error::RunError;
use crate::run::motion::driven_impactors::extend_start;
use crate::run::motion::material_stretches::{self, stretches_of_materials};
use crate::run::motion::sharing::Sharing;
use crate::run::setup::RunSettings;
use crate::run::thermal::Thermal;
use crate::scene::failure::{Breaking, SofteningChoice};
use crate::scene::initial::InitialKind;
use crate::scene::region::Region;
use crate::scene::spec::CalibrationSpec;
use crate::solve::explicit::State;
use crate::system::{LinearMotion, Ranks, SemiDiscrete};
use crate::tensor::Vector;
use crate::{
    coupling::{BrokenBonds, Coupling, Definiteness, Operator},
    model::{Model, Site, SiteKind},
};

/// Dynamic system of a scene, with its memory and its properties.
pub struct DynamicSystem<'a> {
    /// The system.
    pub system: Box<dyn SemiDiscrete + 'a>,
    /// Bytes of rows and bonds.
    pub bytes: usize,
    /// True if its force is linear in the displacement.
    pub is_linear: bool,
    /// True if bonds of the seam rotate and break like others.
    pub has_exact_seam: bool,
}

/// Input to a layout of the zones, beside the scene.
#[derive(Clone, Copy, Default)]
pub(crate) struct LayoutStart<'a, const D: usize> {
    /// Bonds that are broken from the start.
    pub broken: Option<&'a BrokenBonds<D>>,
    /// The processes that compute together, if there are several.
    pub ranks: Option<&'a dyn Ranks>,
    /// Parts of the run that each of them has to itself.
    pub sharing: Sharing,
}

/// Returns the dynamic system: bonds where they can be traversed, the assembled stiffness where they cannot and forces are linear in the displacement.
///
/// # Errors
/// [`RunError::System`] for bonds that cannot stretch or break, [`RunError::Fracture`].
pub(crate) fn dynamic<'a, const D: usize>(
    model: &'a Model<D>,
    coupling: &dyn Coupling<D>,
    operator: &Operator<'_, D>,
    rest: &RunSettings<D>,
    start: LayoutStart<'a, D>,
    choices: &mut Vec<Decision>,
    progress: &dyn Progress,
) -> Result<DynamicSystem<'a>, RunError> {
    let breaking = &rest.breaking;
    let failure = failure_criterion(model, rest)?;
    let kinematics = rest.kinematics();
    let bonds = match kinematics {
        BondKinematics::Exact => "geometrically exact bonds",
        BondKinematics::Linear => "bonds linear in the displacement",
    };
    let storage = breaking.precision;
    let breaks = failure_text(model, failure.as_ref(), breaking);
    let by_state = matches!(failure, Some(BondThreshold::State(_)));
    let can_fail_nowhere = |x: &_| breaking.no_fail.iter().any(|r| r.contains(x, 0.0));
    let is_linear = is_linear(model, rest, failure.as_ref());
    let thermal = rest.stresses.thermal.as_ref().filter(|_| !is_linear);
    let rows = (model, operator, start.ranks);
    definiteness::check(rows, rest.ratio, choices, progress)?;
    let moving = CoupledSystem::of_processes(
        model,
        operator,
        model.symmetry(),
        |material: u16| rest.density[material as usize],
        &BondBehaviour {
            kinematics,
            failure: failure.clone(),
            softening: breaking.softening.softening(),
            no_fail: &can_fail_nowhere,
            contact: breaking.contact,
            storage,
            heat: thermal.map(Thermal::free_stretch),
            broken: start.broken,
        },
        start.ranks,
    );
    match moving {
        Ok(motion) => {
            let motion = motion.with_local_laws(&model.local_laws(&rest.local_laws))?;
            let motion = sharing_steps(motion.with_ranks(start.ranks), start.sharing);
            let may_lose = failure.is_some()
                && motion.has_seam_bonds()
                && operator.definiteness == Definiteness::NegativeTerms;
            if let Some(ratio) = rest.ratio.filter(|_| may_lose) {
                return Err(RunError::Indefinite {
                    what: "bonds that break at the seam may bring that forth at any time; cut-bonds = \"linear\" in [coupling.truncated] keeps them whole".to_owned(),
                    typed: ratio.typed,
                    pairwise: ratio.pairwise,
                });
            }
            tell_bonds(
                model,
                coupling,
                &motion,
                is_linear,
                (bonds, breaks),
                (storage, by_state),
                choices,
            );
            Ok(DynamicSystem {
                bytes: motion.memory_bytes(),
                has_exact_seam: motion.has_seam_bonds(),
                system: Box::new(motion),
                is_linear,
            })
        }
        Err(error) if is_linear => Ok(assembled(
            model, coupling, operator, rest, &error, choices, progress,
        )),
        Err(error) => Err(error.into()),
    }
}

/// Returns true if forces are linear in the displacement: no failure, no contact, and bonds, laws and elements that are linear.
fn is_linear<const D: usize>(
    model: &Model<D>,
    rest: &RunSettings<D>,
    failure: Option<&BondThreshold>,
) -> bool {
    let breaking = &rest.breaking;
    failure.is_none()
        && breaking.contact.is_none()
        && breaking.bonds == BondKinematics::Linear
        && (model.peridynamics.as_ref()).is_none_or(|p| p.law.is_linear())
        && !rest.has_nonlinear_elements(model)
}

/// Lets processes move their own sites each, where these share so much.
fn sharing_steps<const D: usize>(
    motion: CoupledSystem<'_, D>,
    sharing: Sharing,
) -> CoupledSystem<'_, D> {
    match sharing {
        Sharing::Nothing => motion,
        Sharing::Steps | Sharing::Families => motion.with_shared_steps(),
    }
}

/// Returns in words the stretch at which bonds break, and the fracture energy of that; or the calibration of a law.
fn failure_text<const D: usize>(
    model: &Model<D>,
    critical: Option<&BondThreshold>,
    breaking: &Breaking<D>,
) -> String {
    let law = model.peridynamics.as_ref().map(|p| &p.law);
    if let Some(found) = law.and_then(|law| law.calibrate()?.found()) {
        return found;
    }
    let stretches = critical.map(|critical| match critical {
        BondThreshold::Uniform(s) => format!("bonds break at the stretch {s:.3e}"),
        BondThreshold::PerLattice(list) => {
            let horizons = model.body().map_or(&[][..], |b| b.cloud.horizon.values());
            let each = list
                .iter()
                .zip(horizons)
                .map(|(s, d)| format!("{s:.3e} (horizon {d})"));
            let each: Vec<String> = each.collect();
            format!("bonds break at the stretch {}", each.join(", "))
        }
        BondThreshold::ByMaterials(stretch) => stretches_of_materials(stretch, breaking),
        BondThreshold::State(state) => format!("bonds break at {state}"),
    });
    let at_once = match breaking.softening {
        SofteningChoice::AtOnceFor(why) => {
            format!(
                "; at once, since {why}: a crack grows at up to 1.3 times the load of its energy"
            )
        }
        SofteningChoice::Soften(_) | SofteningChoice::AtOnce => String::new(),
    };
    if let (Some(s), Some(_)) = (&stretches, &breaking.several) {
        return format!("{s}{at_once}");
    }
    match (stretches, breaking.fracture.and_then(Fracture::energy)) {
        (Some(s), Some(g)) => {
            if let SofteningChoice::Soften(softening) = breaking.softening {
                // in space, and beyond the usual ratio, bodies bear more by a fifth and above
                let is_known = D < 3 && softening.ratio <= 3.0;
                let modulus = (law.filter(|_| is_known))
                    .map(|law| law.linearised().tensor().uniaxial_modulus());
                return softening_text(critical, softening, (g, modulus), breaking.calibration);
            }
            let takes = match breaking.calibration {
                CalibrationSpec::Lattice => "bonds through a plane of the lattice take it",
                CalibrationSpec::Continuum => "bonds through a plane of a continuous body take it",
            };
            let relaxes = law.is_some_and(|law| {
                let states = law.force_state();
                !law.damages() && states.is_some_and(|s| !s.history().bond.is_empty())
            });
            let slowly = match relaxes {
                true => ", if at once, and less of it once they have relaxed",
                false => "",
            };
            format!("{s}, the fracture energy is {g:e}: {takes}{slowly}{at_once}")
        }
        (Some(s), _) => s,
        (None, _) if breaking.damages => {
            "their damage grows by the law of the material; a bond is broken once it is 1 at both ends".to_owned()
        }
        (None, _) => "no bond breaks: no fracture-energy, no critical-stretch".to_owned(),
    }
}

/// Returns in words how bonds soften that would take the energy of a break at a `critical` stretch, that of the first lattice, and the strength of a body without a crack.
fn softening_text(
    critical: Option<&BondThreshold>,
    softening: BondSoftening,
    (energy, modulus): (f64, Option<f64>),
    calibration: CalibrationSpec,
) -> String {
    let brittle = critical.map_or(f64::NAN, |critical| critical.at(0, [0; 2]));
    let from = softening.onset(brittle);
    let takes = match calibration {
        CalibrationSpec::Lattice => "planes of all directions take it in the mean",
        CalibrationSpec::Continuum => "bonds through a plane of a continuous body take it",
    };
    // the bonds along a uniaxial stress soften first, and few others before it is largest
    let strength = modulus.map_or(String::new(), |modulus| {
        let stress = number(modulus * from);
        format!("; pulled along one axis, a body without a crack bears a stress of about {stress}")
    });
    format!(
        "bonds soften along a line from the stretch {from:.3e} to {:.3e} and are through there, the fracture energy is {energy:e}: {takes}{strength}",
        softening.ratio * from
    )
}

/// Reports how bonds deform and break, and how they are stored.
fn tell_bonds<const D: usize>(
    model: &Model<D>,
    coupling: &dyn Coupling<D>,
    motion: &CoupledSystem<'_, D>,
    is_linear: bool,
    (bonds, breaks): (&str, String),
    (storage, by_state): (Storage, bool),
    choices: &mut Vec<Decision>,
) {
    if let Some((count, why)) = motion.distribution() {
        let bonds = match motion.softens() {
            true => {
                "; each computes all bonds, since others would not know how far they have softened: softening = 1 shares them out"
            }
            false => "",
        };
        choices.push(Decision {
            choice: format!("{count} processes"),
            why: format!("each has the forces of its own sites, by {why}{bonds}"),
        });
    }
    if model.body().is_some() {
        let at_seam = match (coupling.interface().faces, motion.has_seam_bonds()) {
            _ if is_linear => "",
            (true, true) => "; bonds that end on faces of elements do the same",
            (true, false) => "; within two horizons of the seam they are linear and do not break",
            _ => "",
        };
        choices.push(Decision {
            choice: bonds.to_owned(),
            why: breaks + at_seam,
        });
    }
    let states = model
        .peridynamics
        .as_ref()
        .and_then(|p| p.law.force_state());
    // local laws know the temperature of their point, however it is passed over
    let by_bonds = states.is_some_and(|states| states.correspondence(None).is_none());
    if motion.has_heated_bonds() && by_bonds {
        choices.push(Decision {
            choice: "force states of bonds one by one".to_owned(),
            why: "temperature: laws and criteria see the stretch beyond free expansion, which the faster passes do not know".to_owned(),
        });
    }
    let is_generic = motion
        .pass()
        .is_some_and(|pass| pass.force_states().is_some());
    let law = model.peridynamics.as_ref().map(|p| &p.law);
    if is_generic && by_state && law.is_some_and(|law| law.accelerator().is_some()) {
        choices.push(Decision {
            choice: "force states of bonds one by one".to_owned(),
            why: "bonds break by the state of their points, which the faster passes do not know"
                .to_owned(),
        });
    }
    if storage == Storage::Single {
        let (choice, why) = match model.body() {
            Some(_) if is_generic => (
                "precision = \"single\" changes nothing",
                "a pass over force states keeps its weights in eight bytes",
            ),
            Some(_) => (
                "weights of bonds in four bytes",
                "precision = \"single\": each bond is listed, also where the points fill a lattice, which needs no list",
            ),
            None => (
                "precision = \"single\" changes nothing",
                "there are no bonds",
            ),
        };
        choices.push(Decision {
            choice: choice.to_owned(),
            why: why.to_owned(),
        });
    }
}

/// The assembled stiffness, where bonds cannot be traversed for an `error`.
fn assembled<'a, const D: usize>(
    model: &'a Model<D>,
    coupling: &dyn Coupling<D>,
    operator: &Operator<'_, D>,
    rest: &RunSettings<D>,
    error: &SystemError,
    choices: &mut Vec<Decision>,
    progress: &dyn Progress,
) -> DynamicSystem<'a> {
    let density = |material: u16| rest.density[material as usize];
    let stiffness = model.assemble(operator, progress);
    let symmetry = equilibrium::symmetry(coupling, || stiffness.asymmetry(), choices);
    choices.push(Decision {
        choice: "assembled stiffness instead of bonds".to_owned(),
        why: reason(error),
    });
    DynamicSystem {
        bytes: stiffness.values.len() * 8 + stiffness.columns.len() * 4,
        system: Box::new(LinearMotion {
            mass: masses(model, density),
            stiffness,
            symmetry,
        }),
        is_linear: true,
        has_exact_seam: false,
    }
}

/// The system of a static scene whose forces are not linear, by its law or its exact bonds; none where they are, unless it is `asked_for`.
///
/// # Errors
/// [`RunError::System`] for bonds that cannot stretch.
pub(crate) fn still<'a, const D: usize>(
    model: &'a Model<D>,
    operator: &Operator<'_, D>,
    rest: &RunSettings<D>,
    asked_for: bool,
) -> Result<Option<CoupledSystem<'a, D>>, RunError> {
    let kinematics = rest.kinematics();
    if !asked_for && rest.nonlinear(model).is_none() {
        return Ok(None);
    }
    let behaviour = BondBehaviour {
        kinematics,
        failure: None,
        softening: None,
        no_fail: &|_| false,
        contact: None,
        storage: Storage::Double,
        heat: rest.stresses.thermal.as_ref().map(Thermal::free_stretch),
        broken: None,
    };
    let density = |material: u16| rest.density[material as usize];
    let symmetry = model.symmetry();
    let system = CoupledSystem::new(model, operator, symmetry, density, &behaviour)?;
    Ok(Some(
        system.with_local_laws(&model.local_laws(&rest.local_laws))?,
    ))
}

/// Returns the reason for not traversing bonds, without the remedy of the error: nothing is wrong.
fn reason(error: &SystemError) -> String {
    let text = error.to_string();
    let end = text.find(';').unwrap_or(text.len());
    text[..end].to_owned()
}

/// Returns the failure criterion of bonds, if there is one.
pub(crate) fn failure_criterion<const D: usize>(
    model: &Model<D>,
    rest: &RunSettings<D>,
) -> Result<Option<BondThreshold>, RunError> {
    let (Some(fracture), Some(_), Some(p)) =
        (rest.breaking.fracture, model.body(), &model.peridynamics)
    else {
        return Ok(None);
    };
    if let Some(several) = p.law.several() {
        return material_stretches::of(model, several, &rest.breaking).map(Some);
    }
    let energy = match fracture.criterion.threshold(fracture.value) {
        Threshold::Stretch(s) => return Ok(Some(BondThreshold::Uniform(s))),
        Threshold::State(state) => return Ok(Some(BondThreshold::State(state))),
        Threshold::Energy(energy) => energy,
    };
    let mut list = Vec::new();
    let softening = rest.breaking.softening.softening().map(|s| s.ratio);
    // brittle bonds take it on planes along the lattice, where cracks of the papers run
    let over_directions = match softening {
        Some(_) => model.mean_over_axis_planes()?,
        None => Vec::new(),
    };
    let planes = model.plane_energies(softening)?;
    for (lattice, (horizon, along_axes)) in planes.into_iter().enumerate() {
        let per_square = along_axes * over_directions.get(lattice).unwrap_or(&1.0);
        let Some(bonds) = p.law.bond_energy(horizon) else {
            return Err(SystemError::Law { law: p.law.name() }.into());
        };
        let linear = match rest.breaking.calibration {
            CalibrationSpec::Lattice => failure_stretch::critical_stretch(energy, per_square)?,
            CalibrationSpec::Continuum => bonds.critical_stretch::<D>(energy, horizon)?,
        };
        list.push(failure_stretch::stretch_of_equal_energy(linear, |s| {
            p.law.force_state().map_or(1.0, |law| law.energy_ratio(s))
        })?);
    }
    Ok(Some(match list[..] {
        [s] => BondThreshold::Uniform(s),
        _ => BondThreshold::PerLattice(list),
    }))
}

/// The smallest stretch at which bonds break or soften, if that is known.
pub(crate) fn failing_stretch<const D: usize>(
    model: &Model<D>,
    rest: &RunSettings<D>,
) -> Result<Option<f64>, RunError> {
    let law = model.peridynamics.as_ref().map(|p| &p.law);
    if let Some(limit) = law.and_then(|law| law.calibrate()?.elastic_limit()) {
        return Ok(Some(limit));
    }
    let softening = rest.breaking.softening.softening();
    let begins = |brittle: f64| softening.map_or(brittle, |s| s.onset(brittle));
    Ok(failure_criterion(model, rest)?
        .and_then(|critical| match critical {
            BondThreshold::Uniform(s) => Some(s),
            BondThreshold::ByMaterials(of) => Some(of.smallest()).filter(|s| s.is_finite()),
            BondThreshold::PerLattice(list) => list.iter().copied().reduce(f64::min),
            BondThreshold::State(_) => None,
        })
        .map(begins))
}

/// Returns the energy per area of opening a plane of the lattice at the critical stretch, or of a crack whose bonds soften, and the fracture energy of the scene; none where nothing breaks, or where lattices differ.
pub(crate) fn plane_energy<const D: usize>(
    model: &Model<D>,
    rest: &RunSettings<D>,
) -> Result<Option<PlaneEnergy>, RunError> {
    let Some(critical) = failure_criterion(model, rest)? else {
        return Ok(None);
    };
    let knows_energy =
        (model.peridynamics.as_ref()).is_some_and(|p| p.law.bond_energy(1.0).is_some());
    let Some(stretch) = critical.single().filter(|_| knows_energy) else {
        return Ok(None);
    };
    let softening = rest.breaking.softening.softening();
    let planes = model.plane_energies(softening.map(|s| s.ratio))?;
    let [(_, per_square)] = planes[..] else {
        return Ok(None);
    };
    let law = model
        .peridynamics
        .as_ref()
        .and_then(|p| p.law.force_state());
    Ok(Some(PlaneEnergy {
        of_plane: stretch.powi(2) * per_square * law.map_or(1.0, |law| law.energy_ratio(stretch)),
        typed: rest.breaking.fracture.and_then(Fracture::energy),
    }))
}

/// Energy of opening a plane \[J/m²\].
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneEnergy {
    /// By the bonds of the lattice.
    pub of_plane: f64,
    /// By the fracture energy of the scene.
    pub typed: Option<f64>,
}

/// The sites in a region: of a set, the nodes of its cells and the points within them.
fn sites_within<const D: usize>(model: &Model<D>, region: &Region<D>) -> Vec<bool> {
    let (mesh, sites) = (&model.mesh, &model.sites);
    let Region::Cells(cells) = region else {
        let place = |site: usize| sites[site].position;
        return region.combined(sites.len(), place, |member| sites_within(model, member));
    };
    let nodes = region.select_nodes(mesh);
    let within = Locator::new(mesh, cells.iter().map(|&c| c as usize));
    let holds = |site: &Site<D>| match site.kind {
        SiteKind::Node(n) => nodes[n as usize],
        SiteKind::Point(_) => within.holds(mesh, &site.position, 1e-9),
    };
    sites.iter().map(holds).collect()
}

/// Displacement and velocity at time zero, those of impactors last.
pub fn start<const D: usize>(model: &Model<D>, rest: &RunSettings<D>) -> State {
    let mut state = State::at_rest(model.sites.len() * D);
    for field in &rest.initial {
        let values = match field.kind {
            InitialKind::Displacement => &mut state.u,
            InitialKind::Velocity => &mut state.v,
        };
        let inside = sites_within(model, &field.region);
        let sites: Vec<usize> = (0..model.sites.len()).filter(|&s| inside[s]).collect();
        let places = sites.iter().map(|&site| model.sites[site].position);
        let places: Vec<Vector<D>> = places.collect();
        for k in 0..D {
            let found = field.components.values(k, &places, 0.0);
            for (site, value) in sites.iter().zip(found.into_iter().flatten()) {
                values[site * D + k] = value;
            }
        }
    }
    extend_start(&mut state, &rest.impactors);
    state
}
