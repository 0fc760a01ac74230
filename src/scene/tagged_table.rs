//! Tables that hold exactly one key, which is the choice made: `[coupling.splice]`, `[mesh.rectangle]`.
//!
//! A choice may also be written as text, `coupling = "splice"`, where the chosen table would be empty. An override that
//! chooses otherwise replaces the whole choice: `--set coupling=splice` over `[coupling.blending]`.

use serde::de::{self, Deserialize, Deserializer, Error as _, Visitor};
use serde::forward_to_deserialize_any;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::condition_kinds::ConditionSpec;
use super::error::{SceneError, SceneErrorKind, closest, quoted};
use super::spec::{
    AxisSpec, BondLinesSpec, CouplingSpec, HeatConditionSpec, InitialSpec, MaterialSpec, MeshSpec,
    MicromodulusSpec, PointsSpec, ShapeSpec, SolveSpec, TransitionSpec,
};

/// Keys of the top of a scene that often end up below the header of a table.
const TOP: &[&str] = &[
    "title",
    "accuracy",
    "kinematics",
    "mesh",
    "materials",
    "interfaces",
    "peridynamics",
    "zones",
    "coupling",
    "solve",
    "stages",
    "conditions",
    "initial",
    "voids",
    "cracks",
    "no-fail",
    "contact",
    "impactors",
    "solver",
    "output",
    "warnings",
];

/// Keys of a choice, sorted: those that its type reads.
fn keys<T: Deserialize<'static>>() -> Vec<&'static str> {
    let mut found: &'static [&'static str] = &[];
    // a type that is a choice tells its keys before it finds none of them
    drop(T::deserialize(Keys(&mut found)));
    let mut sorted = found.to_vec();
    sorted.sort_unstable();
    sorted
}

/// A text that holds nothing, and learns which keys are asked for.
struct Keys<'k>(&'k mut &'static [&'static str]);

impl<'de> Deserializer<'de> for Keys<'_> {
    type Error = de::value::Error;

    fn deserialize_any<V: Visitor<'de>>(self, _visitor: V) -> Result<V::Value, Self::Error> {
        Err(de::value::Error::custom("no key"))
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Self::Error> {
        *self.0 = variants;
        self.deserialize_any(visitor)
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 u8 u16 u32 u64 f32 f64 char str string bytes byte_buf option unit
        unit_struct newtype_struct seq tuple tuple_struct map struct identifier ignored_any
    }
}

/// The choices at `path`, if the table there is one of exactly one key.
pub(crate) fn options(path: &[&str]) -> Option<Vec<&'static str>> {
    Some(match path {
        ["coupling"] => keys::<CouplingSpec>(),
        ["solve"] => keys::<SolveSpec>(),
        ["stages", _] => vec!["explicit", "quasi-static"],
        ["initial", _] => keys::<InitialSpec>(),
        ["mesh"] => keys::<MeshSpec>(),
        ["mesh", _, "x" | "y" | "z"] => keys::<AxisSpec>(),
        ["materials", _] => MaterialSpec::keys().to_vec(),
        ["materials", _, _, "micromodulus"] => keys::<MicromodulusSpec>(),
        ["peridynamics", "points"] => keys::<PointsSpec>(),
        ["conditions", _] => ConditionSpec::KEYS.to_vec(),
        ["temperature", "conduction", "conditions", _] => keys::<HeatConditionSpec>(),
        ["zones", "transition"] => keys::<TransitionSpec>(),
        ["output", "bonds", _] => keys::<BondLinesSpec>(),
        ["zones", "nonlocal"]
        | ["conditions" | "initial", _, _, "inside"]
        | ["zones", "bodies", _, "inside"]
        | ["temperature", "conduction", "conditions", _, _, "inside"]
        | ["voids", _, "inside"]
        | ["materials", _, _, "cells"]
        | ["output", "tips" | "bonds", _, "inside"]
        | ["cracks" | "no-fail", _] => keys::<ShapeSpec>(),
        _ => return None,
    })
}

/// Choices that may be written as text for an empty table.
fn as_text(path: &[&str]) -> bool {
    matches!(path, ["coupling"] | ["solve"] | ["zones"])
}

/// Writes `over` into `base`, table by table along the `depth` keys that were typed. What stands behind the last of them is a value: a table there
/// replaces the one of `base`.
pub(crate) fn merge<'i>(
    base: &mut DeTable<'i>,
    over: DeTable<'i>,
    depth: usize,
    path: &mut Vec<String>,
) {
    for (key, mut value) in over {
        path.push(key.get_ref().to_string());
        let typed = path.len() >= depth && value.get_ref().is_table();
        // `zones` is no table of exactly one key, but its name stands for all of it
        let named = value.get_ref().is_str() && *path == ["zones"];
        text_to_table(&mut value, path);
        let replaced = match (base.get_mut(key.get_ref().as_ref()), value.get_mut()) {
            (Some(old), DeValue::Table(new)) => {
                text_to_table(old, path);
                match old.get_mut() {
                    DeValue::Table(old)
                        if !(typed || named || chooses_otherwise(path, old, new)) =>
                    {
                        merge(old, std::mem::take(new), depth, path);
                        false
                    }
                    _ => true,
                }
            }
            _ => true,
        };
        if replaced {
            base.remove(key.get_ref().as_ref());
            base.insert(key, value);
        }
        path.pop();
    }
}

/// Returns true if all keys of `new` are choices, none of which `old` has: a key that is none goes in beside what stands there, and is reported as a mistake.
fn chooses_otherwise(path: &[String], old: &DeTable<'_>, new: &DeTable<'_>) -> bool {
    let path: Vec<&str> = path.iter().map(String::as_str).collect();
    let mut keys = new.keys().map(|k| k.get_ref().as_ref());
    options(&path).is_some_and(|all| keys.all(|k| all.contains(&k) && !old.contains_key(k)))
}

fn text_to_table(value: &mut Spanned<DeValue<'_>>, path: &[String]) {
    let path: Vec<&str> = path.iter().map(String::as_str).collect();
    let is_set = matches!(path[..], ["materials", _, _, "cells"]);
    if !(as_text(&path) || is_set) {
        return;
    }
    let span = value.span();
    // the names of stages in their order
    if path[..] == ["solve"] && matches!(value.get_ref(), DeValue::Array(_)) {
        let names = std::mem::replace(value.get_mut(), DeValue::Boolean(false));
        let mut table = DeTable::new();
        let key = Spanned::new(span.clone(), "stages".into());
        table.insert(key, Spanned::new(span, names));
        *value.get_mut() = DeValue::Table(table);
        return;
    }
    if let DeValue::String(name) = value.get_mut() {
        let name = std::mem::take(name);
        let (key, inner) = match is_set {
            // the name of a set of cells
            true => ("set".into(), DeValue::String(name)),
            false => (name, DeValue::Table(DeTable::new())),
        };
        let mut table = DeTable::new();
        table.insert(Spanned::new(span.clone(), key), Spanned::new(span, inner));
        *value.get_mut() = DeValue::Table(table);
    }
}

/// Turns choices written as text into tables and checks that every choice is one.
///
/// # Errors
/// [`SceneErrorKind::Choice`] for none or several keys where one is expected.
pub(crate) fn normalise(table: &mut DeTable<'_>, path: &mut Vec<String>) -> Result<(), SceneError> {
    for (key, value) in table.iter_mut() {
        path.push(key.get_ref().to_string());
        text_to_table(value, path);
        let span = value.span();
        if let DeValue::Table(inner) = value.get_mut() {
            check(path, key.span(), span, inner)?;
            normalise(inner, path)?;
        }
        path.pop();
    }
    Ok(())
}

fn check(
    path: &[String],
    key: std::ops::Range<usize>,
    span: std::ops::Range<usize>,
    table: &DeTable<'_>,
) -> Result<(), SceneError> {
    let borrowed: Vec<&str> = path.iter().map(String::as_str).collect();
    let Some(options) = options(&borrowed) else {
        return Ok(());
    };
    let place = path.join(".");
    match table.len() {
        1 => Ok(()),
        0 => Err(SceneError::choice(format!("`{place}` is empty"))
            .label(
                if span.is_empty() { key } else { span },
                "nothing is chosen",
            )
            .help(format!("write exactly one of {}", quoted(&options)))),
        _ => {
            let mut keys: Vec<_> = table.keys().collect();
            keys.sort_by_key(|k| k.span().start);
            // a key that is no choice at all is the likelier mistake
            let names: Vec<&str> = keys.iter().map(|k| k.get_ref().as_ref()).collect();
            if let Some(stranger) = (keys.iter()).find(|k| !options.contains(&k.get_ref().as_ref()))
            {
                let word = stranger.get_ref();
                let chosen: Vec<&str> = (names.iter().copied())
                    .filter(|n| options.contains(n))
                    .collect();
                let mut error = unknown(word, &place, &options);
                if let ([chosen], None) = (&chosen[..], closest(word, options.iter().copied())) {
                    error = error.help(format!(
                        "write it as `{place}.{chosen}.{word}`, if it belongs to the `{chosen}` chosen there"
                    ));
                }
                return Err(error.label(stranger.span(), "not known here"));
            }
            let mut error = SceneError::choice(format!(
                "`{place}` holds {} at once",
                quoted(&names)
            ))
            .help(format!(
                "keep exactly one of {}; `--set {place}={}` replaces the one that stands there",
                quoted(&options),
                if as_text(&borrowed) {
                    names[0].to_owned()
                } else {
                    format!("{{{} = ...}}", names[0])
                },
            ));
            for (i, k) in keys.iter().enumerate() {
                error = error.label(k.span(), if i == 0 { "one" } else { "and another" });
            }
            Err(error)
        }
    }
}

/// The error for a key or name that does not exist at `place`, where `known` do.
pub(crate) fn unknown(word: &str, place: &str, known: &[&str]) -> SceneError {
    let at = if place.is_empty() {
        "at the top of the scene".to_owned()
    } else {
        format!("in `{place}`")
    };
    let list = if known.is_empty() {
        "no key is allowed here".to_owned()
    } else {
        format!("known here: {}", quoted(known))
    };
    let path: Vec<&str> = place.split('.').collect();
    let help = match closest(word, known.iter().copied()) {
        _ if path[..] == ["mesh"] && word == "path" => format!("write mesh.file.path = \"part.msh\"; {list}"),
        _ if matches!(path[..], ["materials", _, "bond-based"]) && word == "poisson-ratio" => {
            "a bond-based material has the Poisson's ratio 1/3 in plane stress and 1/4 in plane strain and in solids: leave it out, or take `lps`, which has any".to_owned()
        }
        None if matches!(path[..], ["materials", _]) => {
            format!("a material names its law first, and its constants below it, as in `{place}.lps.youngs-modulus`; {list}")
        }
        // a line below a table's header belongs to that table
        _ if !place.is_empty() && TOP.contains(&word) => format!(
            "`{word}` belongs at the top of the scene: move the line above the first [table], or write it as [{word}]; {list}"
        ),
        Some(near) => format!("did you mean `{near}`? {list}"),
        None => list,
    };
    SceneError::new(
        SceneErrorKind::UnknownKey,
        format!("`{word}` is not known {at}"),
    )
    .help(help)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_are_sorted() {
        assert_eq!(
            options(&["mesh"]).unwrap(),
            ["box", "file", "line", "rectangle"]
        );
        let of_zone = options(&["zones", "transition"]).unwrap();
        assert_eq!(
            (of_zone.len(), &of_zone[..3]),
            (12, &["any", "around", "ball"][..])
        );
        assert_eq!(options(&["zones"]), None);
    }
}
