//! Materials of a validated scene.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::bounds_checks;
use super::elasticity::Elasticity;
use super::error::SceneError;
use super::orthotropic;
use super::peridynamics;
use super::region::region;
use super::spec::named_law::NamedSpec;
use super::spec::{CellsSpec, Given, MaterialSpec, MicromodulusSpec, ShapeSpec};
use super::user_material;
use super::value::{Number, Text};
use crate::material::{Axes, Elastic, Kinematics, LocalLaw};
use crate::mesh::Mesh;
use crate::model::ElasticCells;
use crate::peridynamics::failure::{FRACTURE_ENERGY, Fracture};
use crate::peridynamics::laws::{Constants, Parameter, SOFTENING};
use crate::peridynamics::{ForceState, Influence, Law, Micromodulus};
use crate::tensor::{Tensor, Tensor4, Vector};

/// The Poisson ratio of a material, and that at which its bonds would act alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratio {
    pub typed: f64,
    pub pairwise: f64,
}

impl Ratio {
    /// Of the Lamé parameters of a body; those of plane stress are the plane ones.
    pub fn new((lambda, mu): (f64, f64), kinematics: Kinematics) -> Self {
        match kinematics {
            Kinematics::PlaneStress => Self {
                typed: lambda / (lambda + 2.0 * mu),
                pairwise: 1.0 / 3.0,
            },
            _ => Self {
                typed: 0.5 * lambda / (lambda + mu),
                pairwise: 0.25,
            },
        }
    }
}

/// A material of a scene: elastic constants in the scene's dimension, and the law of its bonds.
#[derive(Clone, Debug)]
pub struct Material<const D: usize> {
    /// Its name.
    pub name: String,
    /// The law of its bonds; none of a material that only finite elements have.
    pub law: Option<Arc<dyn Law<D>>>,
    /// Its linear elasticity.
    pub elasticity: Elasticity<D>,
    /// Density [kg/m³]; zero if not given.
    pub density: f64,
    /// Fracture criterion of its bonds, if there is one.
    pub fracture: Option<Fracture>,
    /// Linear thermal expansion per degree, of an orthotropic material along axis 1; none if not given.
    pub expansion: Option<f64>,
    /// Thermal conductivity [W/(m K)]; none if not given.
    pub conductivity: Option<f64>,
    /// Heat capacity per volume [J/(m³ K)]; none if not given.
    pub heat_capacity: Option<f64>,
}

impl<const D: usize> Material<D> {
    /// Returns true if its bonds may break, by a fracture criterion or by their damage.
    pub fn breaks(&self) -> bool {
        self.fracture.is_some() || self.law.as_ref().is_some_and(|law| law.damages())
    }

    /// Returns true if passes over its bonds are accelerated: by the law, and by a criterion of failure that is a stretch.
    pub fn is_accelerated(&self) -> bool {
        let accelerator = self.law.as_ref().and_then(|law| law.accelerator());
        accelerator.is_some() && self.fracture.is_none_or(Fracture::is_of_stretch)
    }

    /// The name of its law.
    pub fn law_name(&self) -> &'static str {
        (self.law.as_ref()).map_or("orthotropic elasticity", |law| law.name())
    }

    /// The nonlinear response of its points, if it has any.
    pub fn force_state(&self) -> Option<&dyn ForceState<D>> {
        self.law.as_ref()?.force_state()
    }

    /// The local law that its finite elements have, if they are not linear with its stiffness.
    pub fn local_law(&self) -> Option<Arc<dyn LocalLaw<D>>> {
        self.law.as_ref()?.local_law()
    }

    /// Lamé's parameters (λ_D, μ) \[Pa\]; none of an orthotropic material.
    pub fn lame(&self) -> Option<(f64, f64)> {
        match self.elasticity {
            Elasticity::Isotropic { lambda, shear } => Some((lambda, shear)),
            Elasticity::Orthotropic { .. } => None,
        }
    }

    /// The local stiffness \[Pa\]; of a material whose axes turn from place to place, that in its own axes.
    pub fn stiffness(&self) -> Tensor4<D> {
        match &self.elasticity {
            Elasticity::Orthotropic {
                body,
                axes: Axes::Field(_),
            } => body.stiffness(&Tensor::identity()),
            elasticity => elasticity.stiffness_at(&Vector::zeros()),
        }
    }
}

/// The elastic constants of cells of some materials; points have the material `of_points`.
pub(crate) fn elastic_cells<const D: usize>(
    materials: &[Material<D>],
    cell_material: Vec<u16>,
    of_points: u16,
    mesh: &Mesh<D>,
) -> ElasticCells<D> {
    let turns: Vec<bool> = materials.iter().map(|m| m.elasticity.turns()).collect();
    let mut turned = FxHashMap::default();
    if turns.contains(&true) {
        let of = |c: &u32| usize::from(cell_material[*c as usize]);
        let cells = (0..mesh.cell_count() as u32).filter(|c| turns[of(c)]);
        turned.extend(cells.map(|c| {
            let x = mesh.centroid(c as usize);
            (c, materials[of(&c)].elasticity.stiffness_at(&x))
        }));
    }
    ElasticCells {
        tensors: materials.iter().map(Material::stiffness).collect(),
        material: cell_material,
        of_points,
        turned,
    }
}

/// All materials, and the material of each cell; libraries of routines lie relative to `directory`.
pub(crate) fn materials<const D: usize>(
    spec: &BTreeMap<Text, MaterialSpec>,
    influence: Influence,
    kinematics: Kinematics,
    mesh: &Mesh<D>,
    directory: &Path,
) -> Result<(Vec<Material<D>>, Vec<u16>), SceneError> {
    let Some(first) = spec.keys().next() else {
        return Err(SceneError::missing("`materials` names no material")
            .label(0..0, "not found in this scene")
            .help(
                "add one, for example [materials.steel.lps] with youngs-modulus and poisson-ratio",
            ));
    };
    let mut found = Vec::with_capacity(spec.len());
    let mut owner: Vec<Option<u16>> = vec![None; mesh.cell_count()];
    let mut rest: Option<(&Text, u16)> = None;
    for (number, (name, material)) in spec.iter().enumerate() {
        let number = number as u16;
        let density = match material.density() {
            Some(d) => {
                let place = format!("materials.{name}.{}.density", material.law());
                bounds_checks::not_negative(&place, d)?
            }
            None => 0.0,
        };
        let (elasticity, law) =
            elasticity_and_law(name, material, (influence, kinematics), density, directory)?;
        let [conductivity, heat_capacity] = conduction(name, material)?;
        found.push(Material {
            name: name.value.clone(),
            law,
            elasticity,
            density,
            fracture: fracture(name, material)?,
            expansion: material.thermal_expansion().map(|alpha| alpha.value),
            conductivity,
            heat_capacity,
        });
        match (material.cells(), rest) {
            (Some(cells), _) => {
                for c in cells_of(name, cells, mesh)? {
                    if let Some(other) = owner[c].replace(number) {
                        let other = &found[other as usize].name;
                        return Err(claimed_twice(c, other, (name, cells)));
                    }
                }
            }
            (None, Some((other, _))) => {
                return Err(SceneError::conflict(format!(
                    "the materials `{other}` and `{name}` both lack `cells`"
                ))
                .label(name.span.clone(), "which cells?")
                .label(other.span.clone(), "which cells?")
                .help("give `cells = \"set\"` to all materials but one"));
            }
            (None, None) => rest = Some((name, number)),
        }
    }
    let mut material = Vec::with_capacity(owner.len());
    for (c, owner) in owner.into_iter().enumerate() {
        match owner.or(rest.map(|(_, n)| n)) {
            Some(number) => material.push(number),
            None => {
                let at = mesh.centroid(c);
                return Err(SceneError::missing(format!(
                    "cell {c} at {:?} has no material",
                    at.as_slice()
                ))
                .label(first.span.clone(), "leaves cells out")
                .help("add a material without `cells`: it fills what the others leave"));
            }
        }
    }
    Ok((found, material))
}

/// The error of a cell that two materials fill.
fn claimed_twice(cell: usize, other: &str, (name, cells): (&Text, &CellsSpec)) -> SceneError {
    let span = match &cells.0 {
        ShapeSpec::Set(set) => set.span.clone(),
        _ => name.span.clone(),
    };
    SceneError::conflict(format!(
        "cell {cell} belongs to the materials `{other}` and `{name}`"
    ))
    .label(span, "this set overlaps another")
    .help("make the sets of cells disjoint")
}

/// Conductivity and heat capacity, where they are typed.
fn conduction(name: &Text, spec: &MaterialSpec) -> Result<[Option<f64>; 2], SceneError> {
    let [k, c] = spec.conduction();
    let of = |key: &str, number: Option<&Number>| {
        let place = format!("materials.{name}.{}.{key}", spec.law());
        let checked = number.map(|n| bounds_checks::positive(&place, n));
        checked.transpose()
    };
    Ok([of("conductivity", k)?, of("heat-capacity", c)?])
}

/// The cells of a material that names some.
fn cells_of<const D: usize>(
    name: &Text,
    cells: &CellsSpec,
    mesh: &Mesh<D>,
) -> Result<Vec<usize>, SceneError> {
    let selected = region(&format!("materials.{name}.cells"), &cells.0, mesh)?.select(mesh);
    let found: Vec<usize> = (0..selected.len()).filter(|&c| selected[c]).collect();
    match found.is_empty() {
        false => Ok(found),
        true => Err(SceneError::wrong_value(format!("`materials.{name}.cells` holds no cell of the mesh"))
            .label(name.span.clone(), "fills nothing")
            .help("a shape holds the cells whose centroid lies inside; enlarge it, or remove the material")),
    }
}

/// Elasticity and law of a material.
fn elasticity_and_law<const D: usize>(
    name: &Text,
    spec: &MaterialSpec,
    (influence, kinematics): (Influence, Kinematics),
    density: f64,
    directory: &Path,
) -> Result<(Elasticity<D>, Option<Arc<dyn Law<D>>>), SceneError> {
    let (moduli, micromodulus) = match spec {
        MaterialSpec::Orthotropic(m) => {
            return Ok((orthotropic::elasticity(name, m, kinematics)?, None));
        }
        MaterialSpec::Named(m) => (
            (&m.youngs_modulus, m.poisson_ratio.as_ref()),
            m.micromodulus.as_ref(),
        ),
        MaterialSpec::Umat(m) => ((&m.youngs_modulus, Some(&m.poisson_ratio)), None),
    };
    let (lambda, shear) = lame::<D>((name, spec.law()), moduli, kinematics)?;
    let constants = Constants {
        lambda,
        shear,
        influence,
        micromodulus: match micromodulus {
            None | Some(MicromodulusSpec::InverseDistance) => Micromodulus::InverseDistance,
            Some(MicromodulusSpec::InvertedTriangular) => Micromodulus::Constant,
            Some(MicromodulusSpec::Constant) => {
                return Err(SceneError::wrong_value(format!(
                    "`materials.{name}.bond-based.micromodulus` is \"constant\", which means either of two"
                ))
                .label(name.span.clone(), "has this micromodulus")
                .help("use \"inverse-distance\" for a force c s of the stretch s, the constant micromodulus of Bobaru et al. (2009) and the default; or \"inverted-triangular\" for a force c |ξ| s, which \"constant\" stood for before"));
            }
            Some(MicromodulusSpec::Uniform) => Micromodulus::Uniform,
            Some(MicromodulusSpec::Triangular) => Micromodulus::Triangular,
            Some(MicromodulusSpec::Influence(i)) => {
                let place = format!("materials.{name}.bond-based.micromodulus.influence");
                Micromodulus::Influence(peridynamics::influence(&place, i)?)
            }
        },
        kinematics,
        density,
        is_heated: spec.thermal_expansion().is_some(),
    };
    let law = match spec {
        MaterialSpec::Umat(m) => Some(user_material::umat(name, m, constants, directory)?),
        MaterialSpec::Named(m) => Some(named_law(name, m, constants)?),
        MaterialSpec::Orthotropic(_) => None,
    };
    Ok((Elasticity::Isotropic { lambda, shear }, law))
}

/// The law that is known by its key.
fn named_law<const D: usize>(
    name: &Text,
    m: &NamedSpec,
    constants: Constants,
) -> Result<Arc<dyn Law<D>>, SceneError> {
    let (known, kinematics) = (m.law.kinematics(), constants.kinematics);
    if !known.contains(&kinematics) {
        let others: Vec<&str> = known.iter().map(|k| k.name()).collect();
        return Err(SceneError::conflict(format!(
            "the law `{}` of the material `{name}` does not hold for kinematics = \"{}\"",
            m.law.key(),
            kinematics.name()
        ))
        .label(
            name.span.clone(),
            "its stress out of the plane is not known",
        )
        .help(format!("it holds for {}", others.join(", "))));
    }
    Ok(m.law.build(constants, &named_values(name, m)?))
}

/// The numbers of a law that is known by its key.
fn named_values(name: &Text, m: &NamedSpec) -> Result<Vec<f64>, SceneError> {
    let parameters = m.law.parameters().iter().zip(&m.parameters);
    let mut values = Vec::with_capacity(m.parameters.len());
    for (parameter, typed) in parameters.clone() {
        values.push(match typed {
            Some(Given::Word(word)) => place_of_word(name, m.law.key(), parameter, word)?,
            Some(Given::Number(typed)) => bounds_checks::within(
                &format!("materials.{name}.{}.{}", m.law.key(), parameter.key),
                typed,
                typed.value >= parameter.least && typed.value <= parameter.most,
                &format!(
                    "must lie between {:e} and {:e}",
                    parameter.least, parameter.most
                ),
                parameter.about,
            )?,
            None => parameter.default.unwrap_or_default(),
        });
    }
    let Some((key, must)) = m.law.conflict(&values) else {
        return Ok(values);
    };
    let of_key = parameters.zip(&values).find(|((p, _), _)| p.key == key);
    let (span, value) = of_key.map_or((name.span.clone(), 0.0), |((_, typed), value)| {
        let span = match typed {
            Some(Given::Number(typed)) => typed.span.clone(),
            _ => name.span.clone(),
        };
        (span, *value)
    });
    Err(SceneError::conflict(format!(
        "`materials.{name}.{}.{key}` is {value}",
        m.law.key()
    ))
    .label(span, must)
    .help("see docs/scene.md, materials"))
}

/// The value of a parameter that is a word: its place.
fn place_of_word(
    name: &Text,
    law: &str,
    parameter: &Parameter,
    word: &Text,
) -> Result<f64, SceneError> {
    let place = parameter.words.iter().position(|w| *w == word.value);
    place.map(|place| place as f64).ok_or_else(|| {
        SceneError::wrong_value(format!(
            "`materials.{name}.{law}.{}` is \"{}\"",
            parameter.key, word.value
        ))
        .label(word.span.clone(), "not one of its words")
        .help(format!("use one of \"{}\"", parameter.words.join("\", \"")))
    })
}

/// The number of the key `softening`, or none if it is left out, of a law that has it.
fn softening(spec: &MaterialSpec) -> Option<Option<&Number>> {
    let MaterialSpec::Named(m) = spec else {
        return None;
    };
    let place = (m.law.parameters().iter()).position(|p| *p == SOFTENING)?;
    match m.parameters.get(place)? {
        Some(Given::Number(number)) => Some(Some(number)),
        Some(Given::Word(_)) | None => Some(None),
    }
}

fn fracture(name: &Text, spec: &MaterialSpec) -> Result<Option<Fracture>, SceneError> {
    let law = spec.law();
    let softens = softening(spec);
    let typed_ratio = softens.flatten();
    let mut typed = spec.failure().into_iter();
    let found = typed.next();
    let has_energy = found
        .as_ref()
        .is_some_and(|(c, _)| c.key() == FRACTURE_ENERGY.key());
    if let (Some(ratio), false) = (typed_ratio.filter(|r| r.value > 1.0), has_energy) {
        return Err(SceneError::conflict(format!(
            "`materials.{name}.{law}.softening` is {}",
            ratio.value
        ))
        .label(ratio.span.clone(), "bonds soften by a fracture energy")
        .help("add fracture-energy, or remove this"));
    }
    let Some((criterion, number)) = found else {
        return Ok(None);
    };
    if let Some((other, second)) = typed.next() {
        return Err(SceneError::choice(format!(
            "`materials.{name}.{law}` holds `{}`, `{}` at once",
            criterion.key(),
            other.key()
        ))
        .label(number.span.clone(), "one")
        .label(second.span.clone(), "and another")
        .help("keep one of them: bonds break by one criterion"));
    }
    let place = format!("materials.{name}.{law}.{}", criterion.key());
    let value = bounds_checks::positive(&place, number)?;
    Ok(Some(Fracture {
        criterion,
        value,
        softening: match softens.filter(|_| has_energy) {
            Some(typed) => typed.map_or(SOFTENING.default.unwrap_or(1.0), |ratio| ratio.value),
            None => 1.0,
        },
        types_softening: typed_ratio.is_some(),
    }))
}

/// Lamé's parameters of the scene's dimension, of an isotropic material.
fn lame<const D: usize>(
    (name, law): (&Text, &str),
    (modulus, ratio): (&Number, Option<&Number>),
    kinematics: Kinematics,
) -> Result<(f64, f64), SceneError> {
    let place = |key: &str| format!("materials.{name}.{law}.{key}");
    let e = bounds_checks::modulus(&place("youngs-modulus"), modulus)?;
    let nu = match (ratio, kinematics) {
        (Some(ratio), _) => bounds_checks::within(
            &place("poisson-ratio"),
            ratio,
            ratio.value > -1.0 && ratio.value < 0.5,
            "must lie between -1 and 0.5",
            "use 0.2 to 0.35 for most solids, 0.49 for rubber; 0.5 has no finite stiffness",
        )?,
        // bonds that act alone carry equal Lamé parameters, in one dimension C = 3 μ
        (None, Kinematics::Bar) => return Ok((e / 3.0, e / 3.0)),
        (None, Kinematics::PlaneStress) => 1.0 / 3.0,
        (None, Kinematics::PlaneStrain | Kinematics::Solid) => 0.25,
    };
    let failed = |error: crate::material::MaterialError| {
        SceneError::wrong_value(format!("`materials.{name}`: {error}"))
            .label(modulus.span.clone(), "of this material")
    };
    let elastic = Elastic::new(e, nu, 0.0).map_err(failed)?;
    elastic.lame::<D>(kinematics).map_err(failed)
}
