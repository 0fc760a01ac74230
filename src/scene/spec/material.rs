//! Materials and peridynamics of a scene.

use std::borrow::Cow;
use std::fmt;
use std::sync::LazyLock;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::{
    self, DeserializeSeed, Deserializer, EnumAccess, MapAccess, VariantAccess, Visitor,
    value::MapAccessDeserializer,
};

use super::named_law::{self, NamedSpec};
use super::region::CellsSpec;
use super::user_material::UmatSpec;
use crate::peridynamics::laws::Named;
use crate::scene::expression::Expression;
use crate::scene::value::{Coordinates, Count, Number};

/// A material: its peridynamic law, beside which the local law is linear elasticity with the same constants.
#[derive(Clone, Debug)]
pub enum MaterialSpec {
    /// Bonds that act alone; Poisson's ratio follows (1/3 in plane stress, 1/4 in plane strain and solids).
    BondBased(BondBasedSpec),
    /// Linearised ordinary state-based law (linear peridynamic solid), any Poisson ratio.
    Lps(StateBasedSpec),
    /// Elastic correspondence: the local law applied to a deformation gradient averaged over the family.
    Correspondence(CorrespondenceSpec),
    /// A routine of a user's library.
    Umat(UmatSpec),
    /// A law of [`Named`].
    Named(NamedSpec),
}

impl MaterialSpec {
    /// Thermal expansion, where it is typed.
    pub fn thermal_expansion(&self) -> Option<&Number> {
        match self {
            Self::BondBased(m) => m.thermal_expansion.as_ref(),
            Self::Lps(m) => m.thermal_expansion.as_ref(),
            Self::Named(m) => m.thermal_expansion.as_ref(),
            Self::Correspondence(m) => m.thermal_expansion.as_ref(),
            Self::Umat(m) => m.thermal_expansion.as_ref(),
        }
    }
}

/// Keys of materials.
static KEYS: LazyLock<Vec<&'static str>> = LazyLock::new(|| {
    let typed = ["bond-based", "lps", "correspondence", "umat"];
    typed.iter().chain(Named::KEYS).copied().collect()
});

impl<'de> Deserialize<'de> for MaterialSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Materials;
        impl<'de> Visitor<'de> for Materials {
            type Value = MaterialSpec;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "one of {}", KEYS.join(", "))
            }

            fn visit_enum<A: EnumAccess<'de>>(self, data: A) -> Result<MaterialSpec, A::Error> {
                let (key, content) = data.variant_seed(MaterialKey)?;
                Ok(match key {
                    Key::BondBased => MaterialSpec::BondBased(content.newtype_variant()?),
                    Key::Lps => MaterialSpec::Lps(content.newtype_variant()?),
                    Key::Correspondence => MaterialSpec::Correspondence(content.newtype_variant()?),
                    Key::Umat => MaterialSpec::Umat(content.newtype_variant()?),
                    Key::Named(law) => {
                        MaterialSpec::Named(content.newtype_variant_seed(named_law::Seed(law))?)
                    }
                })
            }
        }
        deserializer.deserialize_enum("MaterialSpec", &KEYS, Materials)
    }
}

/// The law that a key of a material names.
enum Key {
    BondBased,
    Lps,
    Correspondence,
    Umat,
    Named(Named),
}

/// Reads such a key.
struct MaterialKey;

impl<'de> DeserializeSeed<'de> for MaterialKey {
    type Value = Key;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Key, D::Error> {
        let key = String::deserialize(deserializer)?;
        Ok(match key.as_str() {
            "bond-based" => Key::BondBased,
            "lps" => Key::Lps,
            "correspondence" => Key::Correspondence,
            "umat" => Key::Umat,
            other => match Named::ALL.iter().find(|law| law.key() == other) {
                Some(law) => Key::Named(*law),
                None => return Err(de::Error::unknown_variant(other, &KEYS)),
            },
        })
    }
}

impl JsonSchema for MaterialSpec {
    fn schema_name() -> Cow<'static, str> {
        "MaterialSpec".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let of = |key: &str, about: &str, content: Schema| {
            json_schema!({
                "description": about,
                "type": "object",
                "properties": { key: content },
                "required": [key],
                "additionalProperties": false
            })
        };
        let mut variants = vec![
            of(
                "bond-based",
                "Bonds that act alone; Poisson's ratio follows (1/3 in plane stress, 1/4 in plane strain and solids).",
                generator.subschema_for::<BondBasedSpec>(),
            ),
            of(
                "lps",
                "Ordinary state-based law (linear peridynamic solid), any Poisson ratio.",
                generator.subschema_for::<StateBasedSpec>(),
            ),
            of(
                "correspondence",
                "Elastic correspondence: the local law applied to a deformation gradient averaged over the family.",
                generator.subschema_for::<CorrespondenceSpec>(),
            ),
            of(
                "umat",
                "Correspondence with the stress of a user's routine, called as Abaqus calls UMAT; the program has to be built with the feature umat.",
                generator.subschema_for::<UmatSpec>(),
            ),
        ];
        for law in Named::ALL {
            let content = named_law::schema(*law, generator);
            variants.push(of(law.key(), law.about(), content));
        }
        json_schema!({
            "description": "A material: its peridynamic law, beside which the local law is linear elasticity with the same constants.",
            "oneOf": variants
        })
    }
}

impl MaterialSpec {
    /// Returns the fracture criteria of a material whose bonds can break; the bonds of all others are known to first order only.
    pub fn fracture(&self) -> Option<FractureSpec<'_>> {
        let (law, energy, stretch, tearing) = match self {
            Self::BondBased(m) => ("bond-based", &m.fracture_energy, &m.critical_stretch, None),
            Self::Lps(m) => ("lps", &m.fracture_energy, &m.critical_stretch, None),
            Self::Named(m) => (
                m.law.key(),
                &m.fracture_energy,
                &m.critical_stretch,
                m.tearing_parameter.as_ref(),
            ),
            Self::Umat(m) => ("umat", &None, &m.critical_stretch, None),
            Self::Correspondence(_) => return None,
        };
        Some(FractureSpec {
            law,
            typed: [
                (FractureKey::Energy, energy.as_ref()),
                (FractureKey::Stretch, stretch.as_ref()),
                (FractureKey::Tearing, tearing),
            ],
        })
    }
}

/// Fracture criteria of a material, as typed.
pub struct FractureSpec<'a> {
    /// The key of the material's law.
    pub law: &'static str,
    /// Keys, and the number that is typed.
    pub typed: [(FractureKey, Option<&'a Number>); 3],
}

/// Key of a fracture criterion of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FractureKey {
    /// By the energy per area of a new crack.
    Energy,
    /// By the stretch of the bond.
    Stretch,
    /// By the tearing parameter of its ends.
    Tearing,
}

impl FractureKey {
    /// As a scene types it.
    pub fn key(self) -> &'static str {
        match self {
            Self::Energy => "fracture-energy",
            Self::Stretch => "critical-stretch",
            Self::Tearing => "tearing-parameter",
        }
    }
}

/// The constants of a bond-based material.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct BondBasedSpec {
    /// Young's modulus E.
    pub youngs_modulus: Number,
    /// Density.
    #[serde(default)]
    pub density: Option<Number>,
    /// Linear thermal expansion α per degree, with `[temperature]`.
    #[serde(default)]
    pub thermal_expansion: Option<Number>,
    /// Dependence of the bond stiffness on the bond length; "inverse-distance" if left out.
    #[serde(default)]
    pub micromodulus: MicromodulusSpec,
    /// Energy per area of a new crack, from which the critical stretch of bonds follows; without it and `critical-stretch` no bond breaks.
    #[serde(default)]
    pub fracture_energy: Option<Number>,
    /// Stretch at which a bond breaks, instead of `fracture-energy`.
    #[serde(default)]
    pub critical_stretch: Option<Number>,
    /// The cells that this material fills: the name of a set, or a shape that holds their centroids.
    #[serde(default)]
    pub cells: Option<CellsSpec>,
}

/// The constants of a state-based material.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct StateBasedSpec {
    /// Young's modulus E.
    pub youngs_modulus: Number,
    /// Poisson's ratio.
    pub poisson_ratio: Number,
    /// Density.
    #[serde(default)]
    pub density: Option<Number>,
    /// Linear thermal expansion α per degree, with `[temperature]`.
    #[serde(default)]
    pub thermal_expansion: Option<Number>,
    /// Energy per area of a new crack, from which the critical stretch of bonds follows; without it and `critical-stretch` no bond breaks.
    #[serde(default)]
    pub fracture_energy: Option<Number>,
    /// Stretch at which a bond breaks, instead of `fracture-energy`.
    #[serde(default)]
    pub critical_stretch: Option<Number>,
    /// The cells that this material fills: the name of a set, or a shape that holds their centroids.
    #[serde(default)]
    pub cells: Option<CellsSpec>,
}

/// The constants of a correspondence material.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct CorrespondenceSpec {
    /// Young's modulus E.
    pub youngs_modulus: Number,
    /// Poisson's ratio.
    pub poisson_ratio: Number,
    /// Density.
    #[serde(default)]
    pub density: Option<Number>,
    /// Linear thermal expansion α per degree, with `[temperature]`.
    #[serde(default)]
    pub thermal_expansion: Option<Number>,
    /// Strength of the stabilising bond force, relative to that of an LPS; 1 if left out, 0 switches it off.
    #[serde(default)]
    pub stabilisation: Option<Number>,
    /// The cells that this material fills: the name of a set, or a shape that holds their centroids.
    #[serde(default)]
    pub cells: Option<CellsSpec>,
}

/// Stiffness of a bond over its length, up to a factor that Young's modulus and the horizon fix.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MicromodulusSpec {
    /// `λ = c / |ξ|³`: force proportional to stretch (SAND2015-7998 section 3.4).
    #[default]
    InverseDistance,
    /// `λ = c / |ξ|²`.
    Constant,
    /// `λ = c`.
    Uniform,
    /// `λ = c (1 - |ξ|/δ) / |ξ|³`.
    Triangular,
    /// `λ = c ω(|ξ|) / |ξ|²` with an influence function (SAND2015-7998 eq. (5.13a)).
    Influence(InfluenceSpec),
}

/// An influence function: `{ degree = 3, alpha = 0 }`, or "gaussian".
#[derive(Clone, Debug)]
pub enum InfluenceSpec {
    /// `P_n / |ξ|^α` (SAND2015-7998 eq. (5.8)).
    Polynomial(PolynomialSpec),
    /// `exp(-|ξ|²/δ²)`.
    Gaussian,
}

/// Degree and exponent of a polynomial influence function.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct PolynomialSpec {
    /// Degree n of P_n: 0, 1, 3, 5 or 7.
    pub degree: Count,
    /// Exponent α: 0 or 1.
    #[serde(default)]
    pub alpha: Count,
}

impl<'de> Deserialize<'de> for InfluenceSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Influences;
        impl<'de> Visitor<'de> for Influences {
            type Value = InfluenceSpec;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("`{ degree = 3, alpha = 0 }` or \"gaussian\"")
            }

            fn visit_str<E: de::Error>(self, v: &str) -> Result<InfluenceSpec, E> {
                match v {
                    "gaussian" => Ok(InfluenceSpec::Gaussian),
                    _ => Err(E::unknown_variant(v, &["gaussian"])),
                }
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<InfluenceSpec, A::Error> {
                PolynomialSpec::deserialize(MapAccessDeserializer::new(map))
                    .map(InfluenceSpec::Polynomial)
            }
        }
        deserializer.deserialize_any(Influences)
    }
}

impl JsonSchema for InfluenceSpec {
    fn schema_name() -> Cow<'static, str> {
        "InfluenceSpec".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let polynomial = generator.subschema_for::<PolynomialSpec>();
        json_schema!({
            "description": "An influence function: { degree = 3, alpha = 0 } for P_n / |ξ|^α, or \"gaussian\".",
            "anyOf": [polynomial, { "const": "gaussian" }]
        })
    }
}

/// Horizon, points and weights of the peridynamic region.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct PeridynamicsSpec {
    /// Horizon δ: a number, or an expression in x, y, z; three spacings of the points if left out, where no bond breaks.
    #[serde(default)]
    pub horizon: Option<Expression>,
    /// Bond weights.
    #[serde(default)]
    pub weights: WeightsSpec,
    /// Partial volume of a cell that the horizon cuts (SAND2015-7998 section 5.2.1); all but "full" need `points.lattice`.
    #[serde(default)]
    #[schemars(with = "Option<VolumesSpec>")]
    pub volumes: Option<toml::Spanned<VolumesSpec>>,
    /// Influence function of state-based laws; `{ degree = 3, alpha = 0 }` if left out.
    #[serde(default)]
    pub influence: Option<InfluenceSpec>,
    /// Positions of the points; a lattice if left out, as fine as the cells of the zone where they are alike, else a third of the horizon.
    #[serde(default)]
    pub points: Option<PointsSpec>,
    /// Dependence of the bond force on the displacement; "linear" without damage and "exact" with it if left out.
    #[serde(default)]
    #[schemars(with = "Option<super::motion::BondsSpec>")]
    pub bonds: Option<toml::Spanned<super::motion::BondsSpec>>,
    /// Constitutive law of the finite elements of the points' materials; "linear" if left out.
    #[serde(default)]
    #[schemars(with = "Option<super::motion::ElementsSpec>")]
    pub elements: Option<toml::Spanned<super::motion::ElementsSpec>>,
    /// Storage of the weights of bonds in scenes in time and load steps; "double" if left out.
    #[serde(default)]
    #[schemars(with = "Option<super::motion::PrecisionSpec>")]
    pub precision: Option<toml::Spanned<super::motion::PrecisionSpec>>,
    /// Calibration of the critical stretch to a fracture energy; "lattice" if left out.
    #[serde(default)]
    #[schemars(with = "Option<super::motion::CalibrationSpec>")]
    pub calibration: Option<toml::Spanned<super::motion::CalibrationSpec>>,
    /// Treatment of bonds across the mesh's own boundary (a hole, a notch); "cut" if left out.
    #[serde(default)]
    pub surfaces: SurfacesSpec,
}

impl PeridynamicsSpec {
    /// Returns true if a horizon is typed that is not constant.
    pub fn horizon_varies(&self) -> bool {
        let typed = self.horizon.as_ref();
        typed.is_some_and(|h| h.as_constant().is_none())
    }
}

/// Weights of bonds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum WeightsSpec {
    /// One weight per shell of bonds, so that the lattice carries exactly the typed elastic constants.
    #[default]
    Isotropic,
    /// Volumes as they are, as in the papers; the lattice's stiffness is then not quite the typed one.
    Plain,
    /// Fitted family by family to the typed elastic constants; for points that are no lattice.
    Fitted,
}

/// Partial volumes of the cells that the horizon cuts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum VolumesSpec {
    /// A cell counts wholly if its point lies within the horizon (FL, FA, FV).
    #[default]
    Full,
    /// A linear ramp over the last half spacing within the horizon.
    Pdlammps,
    /// The ramp of Hu, Ha and Bobaru, which goes on to half a spacing beyond the horizon.
    Hhb,
    /// The length, area or volume itself that the horizon cuts from the cell.
    Exact,
}

/// Positions of the peridynamic points.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PointsSpec {
    /// One at the centroid of each cell of the zone.
    Cells,
    /// A regular lattice that fills the zone.
    Lattice(LatticeSpec),
}

/// A regular lattice of points.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct LatticeSpec {
    /// Distance of neighbours h.
    pub spacing: Number,
    /// Any point of the lattice; the mesh's lowest corner if left out, so that points coincide with the nodes of a
    /// mesh of the same spacing; with the coupling `truncated` half a spacing inside of that corner.
    #[serde(default)]
    pub origin: Option<Coordinates>,
}

/// Treatment of bonds across the boundary of the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SurfacesSpec {
    /// Bonds that leave the body are cut.
    #[default]
    Cut,
    /// Bonds reach across holes.
    Uncut,
}
