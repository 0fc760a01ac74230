//! Functions of Python that stand for numbers of a scene: loads and fields, called for all places at once.

use std::sync::{Arc, Mutex, PoisonError};

use bondline::Function;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::value_error;

/// Names that the parameters of a function may have: coordinates and the time.
const NAMES: [&str; 4] = ["x", "y", "z", "t"];
const TIME: usize = 3;

/// First exception that a function raised. A field has no errors, only numbers, so that it is kept until the computation has ended.
#[derive(Clone, Debug, Default)]
pub struct Raised(Arc<Mutex<Option<PyErr>>>);

impl Raised {
    fn keep(&self, error: PyErr) {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.get_or_insert(error);
    }

    /// Returns the result of a computation, unless one of its functions raised an exception.
    ///
    /// # Errors
    /// That exception, once.
    pub fn instead_of<T>(&self, found: PyResult<T>) -> PyResult<T> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match kept.take() {
            Some(error) => Err(error),
            None => found,
        }
    }
}

/// The functions of a scene, in the order of their words.
#[derive(Debug, Default)]
pub struct Functions {
    /// The functions as the scene's source takes them.
    pub list: Vec<Function>,
    /// Exceptions that they raise.
    pub raised: Raised,
}

impl Functions {
    /// Takes up a function and returns the word that stands for it in the scene; `place` is the key where it stands.
    ///
    /// # Errors
    /// `SceneError` for parameters that are not coordinates or the time.
    pub fn add(&mut self, callable: &Bound<'_, PyAny>, place: &str) -> PyResult<String> {
        let uses = parameters(callable, place)?;
        let call = Call {
            callable: callable.clone().unbind(),
            uses,
            raised: self.raised.clone(),
        };
        let in_space = uses[..TIME].contains(&true);
        self.list.push(match (in_space, uses[TIME]) {
            (true, true) => Function::of_points_and_time(move |places, t, values| {
                call.fill(places, t, values);
            }),
            (true, false) => Function::of_points(move |places, values| {
                call.fill(places, 0.0, values);
            }),
            (false, _) => Function::of_time(move |t| {
                let mut value = [f64::NAN];
                call.fill(&[[0.0; 3]], t, &mut value);
                value[0]
            }),
        });
        Ok(Function::word(self.list.len() - 1))
    }
}

/// Returns true for each of [`NAMES`] that a function takes.
fn parameters(callable: &Bound<'_, PyAny>, place: &str) -> PyResult<[bool; 4]> {
    let py = callable.py();
    let help = "write a function of any of x, y, z and t, `lambda x, t: 1e6 * x * t`";
    let inspect = py.import("inspect")?;
    let Ok(signature) = inspect.call_method1("signature", (callable,)) else {
        return Err(value_error(
            py,
            place,
            "is a function that does not tell its parameters",
            help,
        ));
    };
    let class = inspect.getattr("Parameter")?;
    let plain = [
        class.getattr("POSITIONAL_OR_KEYWORD")?,
        class.getattr("KEYWORD_ONLY")?,
    ];
    let none = class.getattr("empty")?;
    let mut uses = [false; 4];
    for parameter in signature
        .getattr("parameters")?
        .call_method0("values")?
        .try_iter()?
    {
        let parameter = parameter?;
        let name: String = parameter.getattr("name")?.extract()?;
        let kind = parameter.getattr("kind")?;
        let by_name = kind.eq(&plain[0])? || kind.eq(&plain[1])?;
        match NAMES.iter().position(|known| *known == name) {
            Some(known) if by_name => uses[known] = true,
            // one with a default keeps it
            _ if by_name && !parameter.getattr("default")?.is(&none) => {}
            _ => {
                let message = format!("is a function with the parameter `{name}`");
                return Err(value_error(py, place, &message, help));
            }
        }
    }
    if !uses.contains(&true) {
        return Err(value_error(
            py,
            place,
            "is a function without parameters",
            help,
        ));
    }
    Ok(uses)
}

struct Call {
    callable: Py<PyAny>,
    uses: [bool; 4],
    raised: Raised,
}

impl Call {
    /// Values at places; they stay as they are where the function raises.
    fn fill(&self, places: &[[f64; 3]], t: f64, values: &mut [f64]) {
        if let Err(error) = Python::attach(|py| self.values(py, places, t, values)) {
            self.raised.keep(error);
        }
    }

    fn values(
        &self,
        py: Python<'_>,
        places: &[[f64; 3]],
        t: f64,
        values: &mut [f64],
    ) -> PyResult<()> {
        let arguments = PyDict::new(py);
        for (k, name) in NAMES.iter().enumerate().filter(|(k, _)| self.uses[*k]) {
            if k == TIME {
                arguments.set_item(name, t)?;
            } else {
                let along = places.iter().map(|place| place[k]);
                arguments.set_item(name, PyArray1::from_iter(py, along))?;
            }
        }
        let found = self.callable.bind(py).call((), Some(&arguments))?;
        let found = py
            .import("numpy")?
            .call_method1("asarray", (found, "float64"))?;
        let shape: Vec<usize> = found.getattr("shape")?.extract()?;
        match shape[..] {
            [] => values.fill(found.extract()?),
            [n] if n == values.len() => {
                let found: PyReadonlyArray1<'_, f64> = found.extract()?;
                let each = values.iter_mut().zip(found.as_array());
                each.for_each(|(value, found)| *value = *found);
            }
            _ => {
                return Err(PyValueError::new_err(format!(
                    "a function of a scene returned the shape {} for {} places; return a number, or an array with one for each place",
                    found.getattr("shape")?,
                    values.len()
                )));
            }
        }
        Ok(())
    }
}
