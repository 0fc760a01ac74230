//! Influence functions and micromoduli of a scene.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::{self, Deserializer, MapAccess, Visitor, value::MapAccessDeserializer};

use crate::scene::value::Count;

/// Stiffness of a bond over its length, up to a factor that Young's modulus and the horizon fix.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MicromodulusSpec {
    /// `λ = c / |ξ|³`: force proportional to stretch (SAND2015-7998 section 3.4).
    #[default]
    InverseDistance,
    /// `λ = c / |ξ|²`: the inverted triangle of Bobaru et al. 2009.
    InvertedTriangular,
    /// A name of two meanings, which is refused with both.
    #[schemars(skip)]
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
