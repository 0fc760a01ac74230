//! How the bonds of a validated scene deform, where they may break, and what points do that touch.

use super::bounds_checks;
use super::error::{SceneError, SceneErrorKind};
use super::material_interfaces::MaterialInterface;
use super::materials::{Fracture, Material};
use super::region::{Region, region};
use super::spec::{
    BondsSpec, CalibrationSpec, ContactSpec, EdgeSpec, PrecisionSpec, SceneSpec, SolveSpec,
};
use crate::mesh::Mesh;

/// How bonds deform and break. A scene that names neither fracture nor contact has none, and pays for none.
#[derive(Clone, Debug, PartialEq)]
pub struct Breaking<const D: usize> {
    /// How the force of a bond depends on the displacement.
    pub bonds: BondsSpec,
    /// How the weights of bonds are kept in motion.
    pub precision: PrecisionSpec,
    /// When bonds of the peridynamic material break; never if there is none.
    pub fracture: Option<Fracture>,
    /// When bonds of each material break, and between materials, where points have several.
    pub several: Option<FractureOfMaterials>,
    /// How the critical stretch follows from a fracture energy.
    pub calibration: CalibrationSpec,
    /// Whether the law of the peridynamic material damages its bonds.
    pub damages: bool,
    /// Regions in which no bond breaks.
    pub no_fail: Vec<Region<D>>,
    /// What is done when damage reaches the edge of the nonlocal zone.
    pub at_edge: EdgeSpec,
    /// Short-range contact.
    pub contact: Option<Contact>,
}

impl<const D: usize> Breaking<D> {
    /// Whether bonds may break, at a stretch or by their damage.
    pub fn breaks(&self) -> bool {
        self.fracture.is_some() || self.damages
    }
}

/// When bonds break in a body of several materials.
#[derive(Clone, Debug, PartialEq)]
pub struct FractureOfMaterials {
    /// Name of each material of the scene, and when its bonds break; never if there is none.
    pub of: Vec<(String, Option<Fracture>)>,
    /// The numbers of those that points have.
    pub used: Vec<u16>,
    /// Interfaces that the scene types.
    pub interfaces: Vec<MaterialInterface>,
}

/// Short-range contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Distance below which points repel each other, over the spacing.
    pub radius_factor: f64,
    /// Stiffness of the repulsion over that of a bond.
    pub stiffness_factor: f64,
}

/// Refuses what is said of broken bonds where none breaks.
fn refuse_needless<const D: usize>(
    spec: &SceneSpec,
    material: &Material<D>,
    breaks: bool,
) -> Result<(), SceneError> {
    if !breaks {
        let needless = |span, what: &str| {
            SceneError::new(
                SceneErrorKind::Conflict,
                format!(
                    "{what}, but no bond of the material `{}` breaks",
                    material.name
                ),
            )
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
        if let Some(name) = spec.output.tips.keys().next() {
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

/// How the force of a bond depends on the displacement.
fn bonds_of<const D: usize>(
    spec: &SceneSpec,
    material: &Material<D>,
    breaks: bool,
    is_static: bool,
) -> Result<BondsSpec, SceneError> {
    let typed = spec.peridynamics.as_ref().and_then(|p| p.bonds.as_ref());
    let is_objective = (material.law.force_state()).is_some_and(|f| f.is_objective());
    Ok(match typed {
        Some(bonds) => {
            if *bonds.get_ref() == BondsSpec::Exact && !is_objective {
                return Err(SceneError::new(
                    SceneErrorKind::Conflict,
                    format!(
                        "`peridynamics.bonds` is \"exact\", and the material `{}` is a {} law",
                        material.name,
                        material.law.name()
                    ),
                )
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
            BondsSpec::Exact
        }
        None => BondsSpec::Linear,
    })
}

/// The material by which questions about breaking bonds are answered, and what breaks bonds of it or of an interface: of several the first that breaks.
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

/// How bonds of the points deform and break, whose materials are those that are `used`.
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
    let has_energy = |fracture: Option<Fracture>| matches!(fracture, Some(Fracture::Energy(_)));
    let has_energy = has_energy(fracture)
        || used.len() > 1
            && (used
                .iter()
                .any(|&m| has_energy(materials[usize::from(m)].fracture))
                || interfaces.iter().any(|i| has_energy(i.fracture)));
    let is_of_stretch = fracture.is_none_or(Fracture::is_of_stretch);
    if let (Some(typed), false, true) = (calibration, has_energy, is_of_stretch) {
        return Err(SceneError::new(
            SceneErrorKind::Conflict,
            format!(
                "`peridynamics.calibration` is set, but the material `{}` has no fracture energy",
                material.name
            ),
        )
        .label(typed.span(), "of what?")
        .help("give the material a fracture-energy, or remove this"));
    }
    let solve = spec.solve.as_ref().map(|s| s.get_ref());
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
        return Err(SceneError::new(
            SceneErrorKind::Conflict,
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
        precision: precision.map_or(PrecisionSpec::Double, |p| *p.get_ref()),
        fracture,
        several: (used.len() > 1).then(|| FractureOfMaterials {
            of: materials
                .iter()
                .map(|m| (m.name.clone(), m.fracture))
                .collect(),
            used: used.to_vec(),
            interfaces,
        }),
        damages: material.law.damages(),
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

fn contact(spec: &ContactSpec) -> Result<Contact, SceneError> {
    let radius_factor = match &spec.radius_factor {
        Some(r) => bounds_checks::within(
            "contact.radius-factor",
            r,
            r.value > 0.0 && r.value <= 1.0,
            "must be positive and at most 1",
            "0.9 suits most scenes; beyond 1 neighbours at rest would repel each other",
        )?,
        None => 0.9,
    };
    let stiffness_factor = match &spec.stiffness_factor {
        Some(s) => bounds_checks::positive("contact.stiffness-factor", s)?,
        None => 15.0,
    };
    Ok(Contact {
        radius_factor,
        stiffness_factor,
    })
}
