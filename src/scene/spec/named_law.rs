//! Materials of the laws that [`Named`] lists: the constants that all have, and the numbers of each.

use std::fmt;
use std::sync::LazyLock;

use schemars::{Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserialize, DeserializeSeed, Deserializer, MapAccess, Visitor};

use super::influence::MicromodulusSpec;
use super::region::CellsSpec;
use crate::peridynamics::failure::{self, FailureCriterion};
use crate::peridynamics::laws::{Named, Ratio};
use crate::scene::value::{Number, Text};

/// A material of a law that is known by its key.
#[derive(Clone, Debug)]
pub struct NamedSpec {
    /// The law.
    pub law: Named,
    /// Young's modulus E.
    pub youngs_modulus: Number,
    /// Poisson's ratio, of a law that has any.
    pub poisson_ratio: Option<Number>,
    /// Density.
    pub density: Option<Number>,
    /// Linear thermal expansion per degree.
    pub thermal_expansion: Option<Number>,
    /// Thermal conductivity.
    pub conductivity: Option<Number>,
    /// Heat capacity per volume.
    pub heat_capacity: Option<Number>,
    /// Shape of the stiffness of a bond over its length, of a law that has a choice.
    pub micromodulus: Option<MicromodulusSpec>,
    /// Criteria by which bonds break, each with its number.
    pub failure: Vec<(&'static dyn FailureCriterion, Number)>,
    /// The cells that this material fills.
    pub cells: Option<CellsSpec>,
    /// Parameters of the law's own, in the order of [`Named::parameters`]; none where one is left out that has a default.
    pub parameters: Vec<Option<Given>>,
}

/// Value that a scene gives for a parameter of a law.
#[derive(Clone, Debug)]
pub enum Given {
    /// A number.
    Number(Number),
    /// A word of those that the parameter is chosen from, or another.
    Word(Text),
}

/// Keys that materials of all laws have, with what they are.
const COMMON: [(&str, &str); 8] = [
    ("youngs-modulus", "Young's modulus E."),
    ("poisson-ratio", "Poisson's ratio."),
    ("density", "Density."),
    (
        "thermal-expansion",
        "Linear thermal expansion α per degree, with `[temperature]`.",
    ),
    (
        "conductivity",
        "Thermal conductivity k, with `[temperature.conduction]`.",
    ),
    (
        "heat-capacity",
        "Heat capacity per volume ρ c, with `[temperature.conduction]` that has `initial`.",
    ),
    (
        "micromodulus",
        "Stiffness of a bond over its length; \"inverse-distance\" if left out.",
    ),
    (
        "cells",
        "The cells that this material fills: the name of a set, or a shape that holds their centroids.",
    ),
];

/// Keys of each law, as errors list them.
static FIELDS: LazyLock<Vec<Vec<&'static str>>> = LazyLock::new(|| {
    let of = |law: &Named| {
        let common = COMMON.iter().map(|c| c.0);
        let own = law.parameters().iter().map(|p| p.key);
        let common = common.filter(|key| takes(*law, key));
        let traits = law.traits();
        let criteria = failure::all().iter().filter(|c| c.applies_to(&traits));
        common.chain(criteria.map(|c| c.key())).chain(own).collect()
    };
    Named::ALL.iter().map(of).collect()
});

/// Returns true if materials of a law have this common key.
fn takes(law: Named, key: &str) -> bool {
    match key {
        "poisson-ratio" => law.ratio() == Ratio::Any,
        "micromodulus" => law == Named::BondBased,
        _ => true,
    }
}

fn fields(law: Named) -> &'static [&'static str] {
    let place = Named::ALL.iter().position(|l| *l == law);
    place.map_or(&[], |place| &FIELDS[place])
}

impl<'de> DeserializeSeed<'de> for Seed {
    type Value = NamedSpec;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<NamedSpec, D::Error> {
        deserializer.deserialize_struct("material", fields(self.0), self)
    }
}

/// Reads the material of a law.
pub(super) struct Seed(pub Named);

impl<'de> Visitor<'de> for Seed {
    type Value = NamedSpec;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a table of the keys {}", fields(self.0).join(", "))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<NamedSpec, A::Error> {
        let law = self.0;
        let parameters = law.parameters();
        let mut common: [Option<Number>; COMMON.len()] = Default::default();
        let mut own: Vec<Option<Given>> = vec![None; parameters.len()];
        let (mut cells, mut micromodulus) = (None, None);
        let mut failure = Vec::new();
        while let Some(key) = map.next_key_seed(Key(law))? {
            match key {
                Field::Common(k) if COMMON[k].0 == "cells" => cells = Some(map.next_value()?),
                Field::Common(k) if COMMON[k].0 == "micromodulus" => {
                    micromodulus = Some(map.next_value()?);
                }
                Field::Failure(criterion) => failure.push((criterion, map.next_value()?)),
                Field::Common(k) => common[k] = Some(map.next_value()?),
                Field::Own(k) if parameters[k].words.is_empty() => {
                    own[k] = Some(Given::Number(map.next_value()?));
                }
                Field::Own(k) => own[k] = Some(Given::Word(map.next_value()?)),
            }
        }
        let place = |c: &'static dyn FailureCriterion| {
            failure::all().iter().position(|o| o.key() == c.key())
        };
        failure.sort_by_key(|(criterion, _)| place(*criterion));
        let mut taken = |key: &str| {
            let place = COMMON.iter().position(|c| c.0 == key);
            place.and_then(|k| common[k].take())
        };
        let poisson_ratio = taken("poisson-ratio");
        let missing = |key| <A::Error as de::Error>::missing_field(key);
        if law.ratio() == Ratio::Any && poisson_ratio.is_none() {
            return Err(missing("poisson-ratio"));
        }
        for (parameter, typed) in parameters.iter().zip(&own) {
            if typed.is_none() && parameter.default.is_none() {
                return Err(missing(parameter.key));
            }
        }
        Ok(NamedSpec {
            law,
            youngs_modulus: taken("youngs-modulus").ok_or_else(|| missing("youngs-modulus"))?,
            poisson_ratio,
            density: taken("density"),
            thermal_expansion: taken("thermal-expansion"),
            conductivity: taken("conductivity"),
            heat_capacity: taken("heat-capacity"),
            micromodulus,
            failure,
            cells,
            parameters: own,
        })
    }
}

/// A key of a law's material, by its place.
enum Field {
    Common(usize),
    Failure(&'static dyn FailureCriterion),
    Own(usize),
}

/// Reads such a key.
struct Key(Named);

impl<'de> DeserializeSeed<'de> for Key {
    type Value = Field;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Field, D::Error> {
        let key = String::deserialize(deserializer)?;
        let own = self.0.parameters().iter().position(|p| p.key == key);
        let common = COMMON.iter().position(|c| c.0 == key);
        let common = common.filter(|_| takes(self.0, &key));
        let criterion = failure::of_key(&key).filter(|c| c.applies_to(&self.0.traits()));
        match (own, common, criterion) {
            (Some(k), ..) => Ok(Field::Own(k)),
            (None, Some(k), _) => Ok(Field::Common(k)),
            (None, None, Some(criterion)) => Ok(Field::Failure(criterion)),
            _ if key == "critical-stretch" && self.0.traits().damages => {
                Err(de::Error::custom(format!(
                    "`critical-stretch` is no key of `{}`, whose bonds break by their own damage",
                    self.0.key()
                )))
            }
            _ => Err(de::Error::unknown_field(&key, fields(self.0))),
        }
    }
}

/// The schema of a law's material.
pub(super) fn schema(law: Named, generator: &mut SchemaGenerator) -> Schema {
    let number = generator.subschema_for::<Number>();
    let cells = generator.subschema_for::<CellsSpec>();
    let micromodulus = generator.subschema_for::<MicromodulusSpec>();
    let mut properties = serde_json::Map::new();
    let mut required = vec!["youngs-modulus"];
    if law.ratio() == Ratio::Any {
        required.push("poisson-ratio");
    }
    let mut add = |key: &str, about: &str, of: &Schema| {
        let of = of.as_value();
        let entry = serde_json::json!({ "description": about, "allOf": [of] });
        properties.insert(key.to_owned(), entry);
    };
    for (key, about) in COMMON.iter().filter(|c| takes(law, c.0)) {
        let of = match *key {
            "cells" => &cells,
            "micromodulus" => &micromodulus,
            _ => &number,
        };
        add(key, about, of);
    }
    let traits = law.traits();
    for criterion in failure::all().iter().filter(|c| c.applies_to(&traits)) {
        add(criterion.key(), criterion.about(), &number);
    }
    for parameter in law.parameters() {
        if parameter.words.is_empty() {
            add(parameter.key, parameter.about, &number);
        } else {
            let words = json_schema!({ "type": "string", "enum": parameter.words });
            add(parameter.key, parameter.about, &words);
        }
        if parameter.default.is_none() {
            required.push(parameter.key);
        }
    }
    json_schema!({
        "description": law.about(),
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": false
    })
}
