//! Deformation and fracture of the bonds of a validated scene, and contact of its points.

use super::bounds_checks;
use super::error::SceneError;
use super::material_interfaces::MaterialInterface;
use super::materials::Material;
use super::region::{Region, region};
use super::spec::{
    CalibrationSpec, ContactSpec, EdgeSpec, HorizonChangeSpec, PeridynamicsSpec, SceneSpec,
    SolveSpec,
};
use super::value::Number;
use crate::coupling::semidiscrete::behaviour::ContactBehaviour;
use crate::mesh::Mesh;
use crate::peridynamics::BondWeights;
use crate::peridynamics::bond_force::{BondKinematics, BondSoftening, Storage};
use crate::peridynamics::failure::Fracture;

/// Deformation and fracture of bonds, and contact. A scene that names neither fracture nor contact has none, and pays for none.
#[derive(Clone, Debug, PartialEq)]
pub struct Breaking<const D: usize> {
    /// Dependence of the bond force on the displacement.
    pub bonds: BondKinematics,
    /// Storage of the weights of bonds in scenes in time and load steps.
    pub precision: Storage,
    /// Fracture criterion of the peridynamic material, or else of an interface, if there is one.
    pub fracture: Option<Fracture>,
    /// Fracture criteria of each material and of the interfaces, where points have several materials.
    pub several: Option<FractureOfMaterials>,
    /// Softening of bonds that break by the fracture energy.
    pub softening: SofteningChoice,
    /// Calibration of the critical stretch to a fracture energy.
    pub calibration: CalibrationSpec,
    /// True if the law of the peridynamic material damages its bonds.
    pub damages: bool,
    /// Regions in which no bond breaks.
    pub no_fail: Vec<Region<D>>,
    /// Action when damage reaches the edge of the nonlocal zone.
    pub at_edge: EdgeSpec,
    /// Short-range contact.
    pub contact: Option<ContactBehaviour>,
}

impl<const D: usize> Breaking<D> {
    /// Returns true if bonds may break, by a fracture criterion or by their damage.
    pub fn breaks(&self) -> bool {
        self.fracture.is_some() || self.damages
    }
}

/// Fracture criteria of a body of several materials.
#[derive(Clone, Debug, PartialEq)]
pub struct FractureOfMaterials {
    /// Name of each material of the scene, and its fracture criterion, if it has one.
    pub of: Vec<(String, Option<Fracture>)>,
    /// The numbers of those that points have.
    pub used: Vec<u16>,
    /// Interfaces that the scene types.
    pub interfaces: Vec<MaterialInterface>,
}

/// Refuses keys about broken bonds where no bond breaks.
fn refuse_needless<const D: usize>(
    spec: &SceneSpec,
    material: &Material<D>,
    breaks: bool,
) -> Result<(), SceneError> {
    if !breaks {
        let needless = |span, what: &str| {
            SceneError::conflict(format!(
                "{what}, but no bond of the material `{}` breaks",
                material.name
            ))
            .label(span, "needs a material that breaks")
            .help(format!(
                "add fracture-energy or critical-stretch to [materials.{}.…], or remove this",
                material.name
            ))
        };
        if let Some(name) = spec.no_fail.keys().next() {
            return Err(needless(
                name.span.clone(),
                &format!("`no-fail.{name}` names a region"),
            ));
        }
        // the tip of a typed crack may stand
        let mut tips = spec.output.tips.iter();
        if let Some((name, _)) = tips.find(|(_, tip)| tip.energy_release != Some(true)) {
            return Err(needless(
                name.span.clone(),
                &format!("`output.tips.{name}` follows a crack"),
            ));
        }
        if let Some(edge) = &spec.zones.damage_at_edge {
            return Err(needless(edge.span(), "`zones.damage-at-edge` is set"));
        }
    }
    Ok(())
}

/// Returns the dependence of the bond force on the displacement.
fn bonds_of<const D: usize>(
    spec: &SceneSpec,
    material: &Material<D>,
    breaks: bool,
    is_static: bool,
) -> Result<BondKinematics, SceneError> {
    let typed = spec.peridynamics.as_ref().and_then(|p| p.bonds.as_ref());
    let is_objective = material.force_state().is_some_and(|f| f.is_objective());
    Ok(match typed {
        Some(bonds) => {
            if *bonds.get_ref() == BondKinematics::Exact && !is_objective {
                return Err(SceneError::conflict(format!(
                    "`peridynamics.bonds` is \"exact\", and the material `{}` is a {} law",
                    material.name,
                    material.law_name()
                ))
                .label(
                    bonds.span(),
                    "its force does not follow the stretch of a bond",
                )
                .help("use bonds = \"linear\", or a bond-based or lps material"));
            }
            *bonds.get_ref()
        }
        // nothing breaks where nothing moves, and a law for small strains stays linear
        None if !is_static && is_objective && (breaks || spec.contact.is_some()) => {
            BondKinematics::Exact
        }
        None => BondKinematics::Linear,
    })
}

/// Returns the material that decides on fracture, and the fracture criterion of it or of an interface: of several materials the first that breaks.
fn material_that_breaks<'a, const D: usize>(
    materials: &'a [Material<D>],
    used: &[u16],
    interfaces: &[MaterialInterface],
) -> (&'a Material<D>, Option<Fracture>) {
    let mut own = used.iter().map(|&m| &materials[usize::from(m)]);
    let first = &materials[usize::from(used[0])];
    let material = own.find(|m| m.breaks()).unwrap_or(first);
    let mut between = interfaces
        .iter()
        .filter(|i| i.between.iter().all(|m| used.contains(m)));
    let fracture = material
        .fracture
        .or_else(|| between.find_map(|i| i.fracture));
    (material, fracture)
}

/// Growth of the largest stretch of a bond, in parts of that between the onset of softening and its end, below which load steps let it be: equilibria are sought with bonds held.
const TOLERANCE: f64 = 0.01;

/// Softening of bonds that a scene has, or the reason why they break at once although no key says so.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SofteningChoice {
    /// Bonds soften.
    Soften(BondSoftening),
    /// Bonds would soften, but for a reason.
    AtOnceFor(&'static str),
    /// Bonds break at once: their law, their criterion or a key says so.
    AtOnce,
}

impl SofteningChoice {
    /// The softening, if bonds soften.
    pub fn softening(self) -> Option<BondSoftening> {
        match self {
            Self::Soften(softening) => Some(softening),
            Self::AtOnceFor(_) | Self::AtOnce => None,
        }
    }
}

/// Returns the softening of bonds.
fn softening_of<const D: usize>(
    spec: &SceneSpec,
    materials: &[Material<D>],
    used: &[u16],
) -> Result<SofteningChoice, SceneError> {
    let softens = |m: &&Material<D>| m.fracture.is_some_and(|f| f.softening > 1.0);
    let is_typed = |m: &&Material<D>| m.fracture.is_some_and(|f| f.types_softening);
    let of_points = || used.iter().map(|&m| &materials[usize::from(m)]);
    let typed = of_points().filter(softens).find(is_typed);
    let Some((material, fracture)) = (typed.or_else(|| of_points().find(softens)))
        .and_then(|material| Some((material, material.fracture?)))
    else {
        return Ok(SofteningChoice::AtOnce);
    };
    let weights = spec.peridynamics.as_ref().map(|p| p.weights);
    let is_dual = |p: &PeridynamicsSpec| {
        let typed = p.horizon_change.as_ref().map(|typed| *typed.get_ref());
        p.horizon_varies() && typed.is_none_or(|rule| rule == HorizonChangeSpec::Dual)
    };
    let is_dual_solid = spec.peridynamics.as_ref().is_some_and(is_dual)
        && (material.law.as_ref()).is_some_and(|law| !law.linearised().is_pairwise());
    let reasons = [
        (used.len() > 1, "points have several materials"),
        (
            spec.zones.follow.is_some(),
            "the zone moves, and would forget how far bonds have softened",
        ),
        (spec.temperature.is_some(), "their temperature changes"),
        (
            weights == Some(BondWeights::Fitted),
            "their weights are fitted, and differ between their ends",
        ),
        (
            is_dual_solid,
            "horizons change by the rule \"dual\", and those of an lps differ between their ends",
        ),
    ];
    let against = reasons
        .iter()
        .find(|(holds, _)| *holds)
        .map(|(_, why)| *why);
    if let Some(against) = against {
        if !fracture.types_softening {
            return Ok(SofteningChoice::AtOnceFor(against));
        }
        let mut names = spec.materials.keys();
        let name = names.find(|name| name.value == material.name);
        let text = format!(
            "bonds of the material `{}` soften, but {against}",
            material.name
        );
        return Err(SceneError::conflict(text)
            .label(name.map_or(0..0, |name| name.span.clone()), "softens")
            .help("type softening = 1, for bonds that break at once"));
    }
    // a motion after load steps begins with bonds as these have left them
    let solve = spec.solve.as_ref().map(|s| s.get_ref());
    let in_time = matches!(solve, Some(SolveSpec::Explicit(_)));
    Ok(SofteningChoice::Soften(BondSoftening {
        ratio: fracture.softening,
        tolerance: if in_time { 0.0 } else { TOLERANCE },
    }))
}

/// Returns the deformation and fracture of the bonds of points whose materials are those that are `used`.
pub(crate) fn breaking<const D: usize>(
    spec: &SceneSpec,
    materials: &[Material<D>],
    used: &[u16],
    interfaces: Vec<MaterialInterface>,
    mesh: &Mesh<D>,
) -> Result<Breaking<D>, SceneError> {
    let (material, fracture) = material_that_breaks(materials, used, &interfaces);
    let breaks = material.breaks() || fracture.is_some();
    refuse_needless(spec, material, breaks)?;
    let calibration = spec
        .peridynamics
        .as_ref()
        .and_then(|p| p.calibration.as_ref());
    let has_energy = |fracture: Option<Fracture>| fracture.is_some_and(|f| f.energy().is_some());
    let has_energy = has_energy(fracture)
        || used.len() > 1
            && (used
                .iter()
                .any(|&m| has_energy(materials[usize::from(m)].fracture))
                || interfaces.iter().any(|i| has_energy(i.fracture)));
    let is_of_stretch = fracture.is_none_or(Fracture::is_of_stretch);
    if let (Some(typed), false, true) = (calibration, has_energy, is_of_stretch) {
        return Err(SceneError::conflict(format!(
            "`peridynamics.calibration` is set, but the material `{}` has no fracture energy",
            material.name
        ))
        .label(typed.span(), "of what?")
        .help("give the material a fracture-energy, or remove this"));
    }
    let solve = spec.analysis();
    let is_static = matches!(solve, None | Some(SolveSpec::Static(_)));
    let bonds = bonds_of(spec, material, breaks, is_static)?;
    let mut no_fail = Vec::with_capacity(spec.no_fail.len());
    for (name, shape) in &spec.no_fail {
        no_fail.push(region(&format!("no-fail.{name}"), shape, mesh)?);
    }
    let precision = spec
        .peridynamics
        .as_ref()
        .and_then(|p| p.precision.as_ref());
    if let (Some(precision), true) = (precision, is_static) {
        return Err(SceneError::conflict(
            "`peridynamics.precision` is set, and nothing moves".to_owned(),
        )
        .label(
            precision.span(),
            "of bonds that are passed over in every step",
        )
        .help("add [solve.explicit] or [solve.quasi-static], or remove it"));
    }
    Ok(Breaking {
        bonds,
        precision: precision.map_or(Storage::Double, |p| *p.get_ref()),
        fracture,
        several: (used.len() > 1).then(|| FractureOfMaterials {
            of: materials
                .iter()
                .map(|m| (m.name.clone(), m.fracture))
                .collect(),
            used: used.to_vec(),
            interfaces,
        }),
        damages: material.law.as_ref().is_some_and(|law| law.damages()),
        softening: softening_of(spec, materials, used)?,
        calibration: calibration.map_or(CalibrationSpec::Lattice, |c| *c.get_ref()),
        no_fail,
        at_edge: spec
            .zones
            .damage_at_edge
            .as_ref()
            .map_or(EdgeSpec::Stop, |e| *e.get_ref()),
        contact: spec.contact.as_ref().map(contact).transpose()?,
    })
}

fn contact(spec: &ContactSpec) -> Result<ContactBehaviour, SceneError> {
    let approach = match &spec.radius_factor {
        Some(r) => bounds_checks::within(
            "contact.radius-factor",
            r,
            r.value > 0.0 && r.value <= 1.0,
            "must be positive and at most 1",
            "with 1 points touch when their cells do; beyond it neighbours at rest would repel each other",
        )?,
        None => 1.0,
    };
    let stiffness = match &spec.stiffness_factor {
        Some(s) => bounds_checks::positive("contact.stiffness-factor", s)?,
        None => 15.0,
    };
    let not_negative = |key: &str, number: &Option<Number>| {
        let of = number.as_ref();
        of.map_or(Ok(0.0), |number| bounds_checks::not_negative(key, number))
    };
    Ok(ContactBehaviour {
        approach,
        stiffness,
        friction: not_negative("contact.friction", &spec.friction)?,
        adjust: not_negative("contact.adjust", &spec.adjust)?,
    })
}
