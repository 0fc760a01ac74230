//! Python's values as those of a scene: dictionaries as tables, numpy's numbers and arrays as numbers and lists, functions as words that stand for them.

use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use toml::Value;

use crate::errors::value_error;
use crate::function::Functions;

/// Tables and lists may be nested this deep; a dictionary that holds itself is nested without end.
const DEEPEST: usize = 64;

/// A dictionary as a table of a scene; `path` is where it stands. Functions in it are added to `functions`.
///
/// # Errors
/// `SceneError` for a key that is no text and a value that no scene can hold.
pub fn table(
    dictionary: &Bound<'_, PyDict>,
    path: &str,
    depth: usize,
    functions: &mut Functions,
) -> PyResult<toml::Table> {
    let py = dictionary.py();
    let mut table = toml::Table::new();
    for (key, value) in dictionary {
        let Ok(key) = key.cast::<PyString>() else {
            let found = key.repr()?.to_string();
            let place = if path.is_empty() { "scene" } else { path };
            return Err(value_error(
                py,
                place,
                &format!("has the key {found}, which is no text"),
                "write keys as text",
            ));
        };
        let key = key.to_str()?;
        let place = match path {
            "" => key.to_owned(),
            path => format!("{path}.{key}"),
        };
        let value = value_at(&value, &place, depth + 1, functions)?;
        table.insert(key.to_owned(), value);
    }
    Ok(table)
}

/// A value of a scene; `path` is where it stands.
///
/// # Errors
/// As [`table`].
pub fn value_at(
    value: &Bound<'_, PyAny>,
    path: &str,
    depth: usize,
    functions: &mut Functions,
) -> PyResult<Value> {
    let py = value.py();
    let wrong = |message: &str, help: &str| Err(value_error(py, path, message, help));
    if depth > DEEPEST {
        return wrong(
            &format!("is nested more than {DEEPEST} deep"),
            "a scene needs no more than ten",
        );
    }
    let list = |items: Vec<Bound<'_, PyAny>>, functions: &mut Functions| -> PyResult<Value> {
        let items = items.iter().enumerate();
        let list: PyResult<Vec<Value>> = items
            .map(|(i, item)| value_at(item, &format!("{path}.{}", i + 1), depth + 1, functions))
            .collect();
        Ok(Value::Array(list?))
    };
    if let Ok(truth) = value.cast::<PyBool>() {
        return Ok(Value::Boolean(truth.is_true()));
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(Value::String(text.to_str()?.to_owned()));
    }
    if value.cast::<PyInt>().is_ok() {
        return match value.extract::<i64>() {
            Ok(integer) => Ok(Value::Integer(integer)),
            Err(_) => wrong(
                &format!("is {value}, beyond 64 bits"),
                "write it as a float",
            ),
        };
    }
    if let Ok(real) = value.cast::<PyFloat>() {
        return Ok(Value::Float(real.value()));
    }
    if let Ok(inner) = value.cast::<PyDict>() {
        return Ok(Value::Table(table(inner, path, depth, functions)?));
    }
    if let Ok(items) = value.cast::<PyList>() {
        return list(items.iter().collect(), functions);
    }
    if let Ok(items) = value.cast::<PyTuple>() {
        return list(items.iter().collect(), functions);
    }
    // numpy's scalars and arrays
    if let Ok(plain) = value.call_method0("tolist") {
        return value_at(&plain, path, depth + 1, functions);
    }
    if let Ok(text) = value.call_method0("__fspath__")
        && let Ok(text) = text.cast::<PyString>()
    {
        return Ok(Value::String(text.to_str()?.to_owned()));
    }
    if value.is_callable() {
        return Ok(Value::String(functions.add(value, path)?));
    }
    let kind = value.get_type().name()?.to_string();
    wrong(
        &format!("is of the type {kind}, which no scene can hold"),
        "write a number, a text, a truth value, a list, a dictionary or a function, or leave the key out",
    )
}
