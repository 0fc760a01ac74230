//! How the bonds of a validated scene deform, where they may break, and what points do that touch.

use super::bounds_checks;
use super::error::{SceneError, SceneErrorKind};
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
) -> Result<(), SceneError> {
    if !material.breaks() {
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
        None if !is_static && is_objective && (material.breaks() || spec.contact.is_some()) => {
            BondsSpec::Exact
        }
        None => BondsSpec::Linear,
    })
}

/// How bonds of the peridynamic material `material` deform and break.
pub(crate) fn breaking<const D: usize>(
    spec: &SceneSpec,
    material: &Material<D>,
    mesh: &Mesh<D>,
) -> Result<Breaking<D>, SceneError> {
    let fracture = material.fracture;
    refuse_needless(spec, material)?;
    let calibration = spec
        .peridynamics
        .as_ref()
        .and_then(|p| p.calibration.as_ref());
    if let (Some(typed), None | Some(Fracture::Stretch(_))) = (calibration, fracture) {
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
    let bonds = bonds_of(spec, material, is_static)?;
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
