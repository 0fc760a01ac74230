//! Single values of a scene, each with the place where it was typed: numbers, counts, texts, coordinates, expressions.

use std::borrow::{Borrow, Cow};
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserialize, Deserializer, SeqAccess, Visitor};
use toml::Spanned;

use super::expression::Expression;
use super::function;
use super::source::Span;
use crate::observe::checkpoint::Pace;

/// A number, typed as `0.05` or as a constant expression in quotes, `"6/120"`.
#[derive(Clone, Debug, Default)]
pub struct Number {
    /// The value.
    pub value: f64,
    /// Span in the text of the scene.
    pub span: Span,
}

/// A whole number that is not negative.
#[derive(Clone, Debug, Default)]
pub struct Count {
    /// The value.
    pub value: usize,
    /// Span in the text of the scene.
    pub span: Span,
}

/// A number, or "auto".
#[derive(Clone, Debug, Default)]
pub struct Automatic {
    /// The value; none for "auto".
    pub value: Option<f64>,
    /// Span in the text of the scene.
    pub span: Span,
}

/// Interval at which something is done: 1000 (steps), or "10 min" of the clock.
#[derive(Clone, Debug)]
pub struct Every {
    /// The interval.
    pub pace: Pace,
    /// Span in the text of the scene.
    pub span: Span,
}

/// A number of load steps, the times of all of them, or "auto".
#[derive(Clone, Debug)]
pub struct Steps {
    /// The value as typed.
    pub choice: StepTimes,
    /// Span in the text of the scene.
    pub span: Span,
}

/// Intervals of a load that load steps of any length divide.
pub(crate) const INTERVALS: usize = 1000;

impl Steps {
    /// Returns the number of load steps, of those that are found on the way the largest that is usual.
    pub fn count(&self) -> usize {
        match &self.choice {
            StepTimes::Equal(number) => *number,
            StepTimes::Listed(times) => times.len(),
            StepTimes::Auto => INTERVALS,
        }
    }
}

/// Load steps of equal length, at the times that are listed, or found on the way.
#[derive(Clone, Debug, PartialEq)]
pub enum StepTimes {
    /// So many of equal length.
    Equal(usize),
    /// At these times.
    Listed(Vec<f64>),
    /// As long as nothing fails in them.
    Auto,
}

/// A piece of text: a path, the name of a set, or a key that the user chose.
#[derive(Clone, Debug, Default)]
pub struct Text {
    /// The text.
    pub value: String,
    /// Span in the text of the scene.
    pub span: Span,
}

/// One, two or three coordinates, `[x, y, z]`; in 1D also a plain number.
#[derive(Clone, Debug, Default)]
pub struct Coordinates {
    /// The coordinates.
    pub values: Vec<f64>,
    /// Span in the text of the scene.
    pub span: Span,
}

impl PartialEq for Text {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl Eq for Text {}

impl PartialOrd for Text {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Text {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.value.cmp(&other.value)
    }
}

impl Borrow<str> for Text {
    fn borrow(&self) -> &str {
        &self.value
    }
}

impl fmt::Display for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.value)
    }
}

/// Reads a number or text into an expression; checks inside, where the deserialiser still knows the place.
#[derive(Clone, Copy)]
enum Scalars {
    /// Any expression.
    Field,
    /// One without variables.
    Constant,
    /// One without variables that is a whole number.
    Whole,
}

impl Scalars {
    fn check<E: de::Error>(self, expression: Expression) -> Result<Expression, E> {
        if matches!(self, Self::Field) {
            return Ok(expression);
        }
        match expression.as_constant() {
            None => Err(E::custom(format!(
                "`{expression}` has a variable or a table where a constant is expected"
            ))),
            Some(v) if !v.is_finite() => Err(E::custom(format!(
                "`{expression}` is {v}, not a finite number"
            ))),
            // 2^53: beyond it whole numbers are not exact
            Some(v)
                if matches!(self, Self::Whole)
                    && (v.fract() != 0.0 || !(0.0..=9_007_199_254_740_992.0).contains(&v)) =>
            {
                Err(E::custom(format!(
                    "{v} is not a whole number of at least 0"
                )))
            }
            Some(_) => Ok(expression),
        }
    }
}

impl Visitor<'_> for Scalars {
    type Value = Expression;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Field => "a number, or an expression in quotes",
            Self::Constant => "a number",
            Self::Whole => "a whole number",
        })
    }

    fn visit_i64<E: de::Error>(self, v: i64) -> Result<Expression, E> {
        self.check(Expression::constant(v as f64))
    }

    fn visit_u64<E: de::Error>(self, v: u64) -> Result<Expression, E> {
        self.check(Expression::constant(v as f64))
    }

    fn visit_f64<E: de::Error>(self, v: f64) -> Result<Expression, E> {
        if v.is_finite() {
            self.check(Expression::constant(v))
        } else {
            Err(E::custom(format!("{v} is not a finite number")))
        }
    }

    fn visit_str<E: de::Error>(self, v: &str) -> Result<Expression, E> {
        match function::in_scope(v) {
            Some(function) => self.check(Expression::of_function(v, function)),
            None => self.check(Expression::parse(v).map_err(E::custom)?),
        }
    }
}

struct Scalar(Expression);

impl<'de> Deserialize<'de> for Scalar {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Scalars::Field).map(Self)
    }
}

struct Constant(f64);

impl<'de> Deserialize<'de> for Constant {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let expression = deserializer.deserialize_any(Scalars::Constant)?;
        Ok(Self(expression.eval(&[0.0; 3])))
    }
}

/// A number, or none for "auto".
struct Chosen(Option<f64>);

impl<'de> Deserialize<'de> for Chosen {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Numbers;
        impl Visitor<'_> for Numbers {
            type Value = Chosen;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number or \"auto\"")
            }

            fn visit_i64<E: de::Error>(self, v: i64) -> Result<Chosen, E> {
                Ok(Chosen(Some(v as f64)))
            }

            fn visit_f64<E: de::Error>(self, v: f64) -> Result<Chosen, E> {
                let constant = Scalars::Constant.visit_f64::<E>(v)?;
                Ok(Chosen(constant.as_constant()))
            }

            fn visit_str<E: de::Error>(self, v: &str) -> Result<Chosen, E> {
                if v == "auto" {
                    return Ok(Chosen(None));
                }
                Ok(Chosen(Scalars::Constant.visit_str::<E>(v)?.as_constant()))
            }
        }
        deserializer.deserialize_any(Numbers)
    }
}

/// A pace, typed as a number of steps or as text with a unit.
struct Typed(Pace);

impl<'de> Deserialize<'de> for Typed {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Paces;
        impl Visitor<'_> for Paces {
            type Value = Typed;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number of steps, or a time such as \"10 min\"")
            }

            fn visit_i64<E: de::Error>(self, v: i64) -> Result<Typed, E> {
                self.visit_str(&v.to_string())
            }

            fn visit_str<E: de::Error>(self, v: &str) -> Result<Typed, E> {
                v.parse().map(Typed).map_err(E::custom)
            }
        }
        deserializer.deserialize_any(Paces)
    }
}

struct Whole(usize);

impl<'de> Deserialize<'de> for Whole {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let expression = deserializer.deserialize_any(Scalars::Whole)?;
        Ok(Self(expression.eval(&[0.0; 3]) as usize))
    }
}

/// Load steps, typed as a number or as a list of times.
impl<'de> Deserialize<'de> for StepTimes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Choices;
        let count = |e: &Expression| StepTimes::Equal(e.eval(&[0.0; 3]) as usize);
        impl<'de> Visitor<'de> for Choices {
            type Value = Result<Expression, StepTimes>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a whole number, \"auto\", or a list of times such as [0.5, 0.8, 1]")
            }

            fn visit_i64<E: de::Error>(self, v: i64) -> Result<Self::Value, E> {
                Scalars::Whole.visit_i64(v).map(Ok)
            }

            fn visit_f64<E: de::Error>(self, v: f64) -> Result<Self::Value, E> {
                Scalars::Whole.visit_f64(v).map(Ok)
            }

            fn visit_str<E: de::Error>(self, v: &str) -> Result<Self::Value, E> {
                match v {
                    "auto" => Ok(Err(StepTimes::Auto)),
                    v => Scalars::Whole.visit_str(v).map(Ok),
                }
            }

            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
                Lists
                    .visit_seq(seq)
                    .map(|times| Err(StepTimes::Listed(times)))
            }
        }
        Ok(match deserializer.deserialize_any(Choices)? {
            Ok(number) => count(&number),
            Err(other) => other,
        })
    }
}

impl<'de> Deserialize<'de> for Expression {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let spanned = Spanned::<Scalar>::deserialize(deserializer)?;
        let span = spanned.span();
        Ok(spanned.into_inner().0.at(span))
    }
}

/// One number or a list of them.
struct List(Vec<f64>);

/// Reads numbers into a list.
struct Lists;

impl<'de> Visitor<'de> for Lists {
    type Value = Vec<f64>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("coordinates such as [0.1, 0.2]")
    }

    fn visit_i64<E: de::Error>(self, v: i64) -> Result<Vec<f64>, E> {
        Ok(vec![v as f64])
    }

    fn visit_f64<E: de::Error>(self, v: f64) -> Result<Vec<f64>, E> {
        if v.is_finite() {
            Ok(vec![v])
        } else {
            Err(E::custom(format!("{v} is not a finite number")))
        }
    }

    fn visit_str<E: de::Error>(self, v: &str) -> Result<Vec<f64>, E> {
        let constant = Scalars::Constant.visit_str::<E>(v)?;
        Ok(vec![constant.eval(&[0.0; 3])])
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Vec<f64>, A::Error> {
        let mut values = Vec::new();
        while let Some(v) = seq.next_element::<Constant>()? {
            values.push(v.0);
        }
        Ok(values)
    }
}

impl<'de> Deserialize<'de> for List {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Lists).map(List)
    }
}

/// Reads values with the places where they are typed.
macro_rules! spanned {
    ($($type:ident { $field:ident } of $read:ty: $value:expr;)+) => {$(
        impl<'de> Deserialize<'de> for $type {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let read = Spanned::<$read>::deserialize(deserializer)?;
                let (span, value): (Span, fn($read) -> _) = (read.span(), $value);
                Ok(Self { $field: value(read.into_inner()), span })
            }
        }
    )+};
}

spanned! {
    Number { value } of Constant: |read| read.0;
    Count { value } of Whole: |read| read.0;
    Automatic { value } of Chosen: |read| read.0;
    Every { pace } of Typed: |read| read.0;
    Steps { choice } of StepTimes: |read| read;
    Text { value } of String: |read| read;
    Coordinates { values } of List: |read| read.0;
}

macro_rules! schema {
    ($type:ty, $name:literal, $($json:tt)+) => {
        impl JsonSchema for $type {
            fn schema_name() -> Cow<'static, str> {
                $name.into()
            }

            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!($($json)+)
            }
        }
    };
}

schema!(Number, "Number", {
    "description": "A number, or a constant expression in quotes such as \"1/120\".",
    "type": ["number", "string"]
});
schema!(Count, "Count", {
    "description": "A whole number, or a constant expression in quotes.",
    "type": ["integer", "string"],
    "minimum": 0
});
schema!(Steps, "Steps", {
    "description": "A number of load steps of equal length, the list of their times, or \"auto\".",
    "type": ["integer", "string", "array"],
    "items": { "type": ["number", "string"] }
});
schema!(Automatic, "Automatic", {
    "description": "A number, or \"auto\".",
    "type": ["number", "string"]
});
schema!(Every, "Every", {
    "description": "A number of steps, or a time of the clock such as \"30 s\", \"10 min\", \"2 h\".",
    "type": ["integer", "string"]
});
schema!(Expression, "Expression", {
    "description": "A number, or an expression in x, y, z (in conditions that move also t) in quotes such as \"1e-3 * x^2\".",
    "type": ["number", "string"]
});
schema!(Coordinates, "Coordinates", {
    "description": "One coordinate per dimension, such as [0.1, 0.2]; in one dimension also a plain number.",
    "type": ["array", "number", "string"],
    "items": { "type": ["number", "string"] }
});

impl JsonSchema for Text {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Text".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string" })
    }
}
