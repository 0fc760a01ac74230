//! Values of keys, and tables of them.

use std::collections::BTreeMap;

use crate::scene::function::Function;

/// Value of a key of a scene.
#[derive(Clone, Debug)]
pub enum Value {
    /// A number, a text or a list. A text that stands for a number is an expression in `x`, `y`, `z` and `t`.
    Plain(toml::Value),
    /// A function of position and time.
    Function(Function),
    /// A table.
    Table(Entries),
}

/// Keys with their values.
#[derive(Clone, Debug, Default)]
pub struct Entries(BTreeMap<String, Value>);

impl Entries {
    /// Sets a key, with dots between tables; what stands there is replaced.
    pub fn set(&mut self, key: &str, value: impl Into<Value>) {
        match key.split_once('.') {
            None => {
                self.0.insert(key.to_owned(), value.into());
            }
            Some((first, rest)) => self.table_at(first).set(rest, value),
        }
    }

    /// Puts a table under a name, which may have dots, into the table at `key`.
    pub(super) fn insert(&mut self, key: &str, name: &str, entries: Entries) {
        let table = key.split('.').fold(self, |table, key| table.table_at(key));
        table.0.insert(name.to_owned(), Value::Table(entries));
    }

    /// The table at a key; an empty one in place of any other value.
    fn table_at(&mut self, key: &str) -> &mut Entries {
        let value = self.0.entry(key.to_owned());
        let value = value.or_insert_with(|| Value::Table(Self::default()));
        if !matches!(value, Value::Table(_)) {
            *value = Value::Table(Self::default());
        }
        match value {
            Value::Table(table) => table,
            Value::Plain(_) | Value::Function(_) => unreachable!("it was made a table"),
        }
    }

    /// The table of a scene, with words for functions, which are added to `functions`.
    pub(super) fn table(&self, functions: &mut Vec<Function>) -> toml::Table {
        let plain = |value: &Value, functions: &mut Vec<Function>| match value {
            Value::Plain(value) => value.clone(),
            Value::Table(entries) => toml::Value::Table(entries.table(functions)),
            Value::Function(function) => {
                functions.push(function.clone());
                toml::Value::String(Function::word(functions.len() - 1))
            }
        };
        let entries = self.0.iter();
        entries
            .map(|(key, value)| (key.clone(), plain(value, functions)))
            .collect()
    }
}

impl From<Function> for Value {
    fn from(value: Function) -> Self {
        Self::Function(value)
    }
}

impl From<Entries> for Value {
    fn from(value: Entries) -> Self {
        Self::Table(value)
    }
}

impl From<toml::Value> for Value {
    fn from(value: toml::Value) -> Self {
        Self::Plain(value)
    }
}

impl From<usize> for Value {
    fn from(value: usize) -> Self {
        // more than 2⁶³ of anything is refused as the largest that a scene holds
        Self::Plain(toml::Value::Integer(
            i64::try_from(value).unwrap_or(i64::MAX),
        ))
    }
}

impl From<Vec<f64>> for Value {
    fn from(values: Vec<f64>) -> Self {
        let list = values.into_iter().map(toml::Value::Float);
        Self::Plain(toml::Value::Array(list.collect()))
    }
}

impl<const N: usize> From<[f64; N]> for Value {
    fn from(values: [f64; N]) -> Self {
        values.to_vec().into()
    }
}

impl<const N: usize> From<Vec<[f64; N]>> for Value {
    fn from(values: Vec<[f64; N]>) -> Self {
        let number = |x: f64| toml::Value::Float(x);
        let list = values.into_iter();
        let list = list.map(|x| toml::Value::Array(x.map(number).to_vec()));
        Self::Plain(toml::Value::Array(list.collect()))
    }
}

/// A list of shapes, in which no function stands.
pub(super) fn list(shapes: &[Entries]) -> Value {
    let shapes = shapes.iter();
    let list = shapes.map(|shape| toml::Value::Table(shape.table(&mut Vec::new())));
    Value::Plain(toml::Value::Array(list.collect()))
}

macro_rules! plain {
    ($($type:ty),+) => {$(
        impl From<$type> for Value {
            fn from(value: $type) -> Self {
                Self::Plain(value.into())
            }
        }
    )+};
}

plain!(f64, i32, i64, bool, &str, String);
