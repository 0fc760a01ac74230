//! Errors of the library as exceptions of `bondline._errors`: the text that the command line prints, and its parts as attributes.

use bondline::{RunError, SceneError};
use bondline_study::CheckError;
use miette::{GraphicalReportHandler, GraphicalTheme};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Columns of the text of an error.
const WIDTH: usize = 100;

/// An exception of the class `name`.
fn exception(
    py: Python<'_>,
    name: &str,
    text: &str,
    message: &str,
    place: Option<String>,
    help: Option<&str>,
) -> PyErr {
    let made = || -> PyResult<PyErr> {
        let class = py.import("bondline._errors")?.getattr(name)?;
        let parts = PyDict::new(py);
        parts.set_item("message", message)?;
        parts.set_item("place", place)?;
        parts.set_item("help", help)?;
        Ok(PyErr::from_value(class.call((text,), Some(&parts))?))
    };
    made().unwrap_or_else(|error| error)
}

/// A mistake in a scene: message, underlined text and remedy.
pub fn scene_error(py: Python<'_>, error: SceneError) -> PyErr {
    let message = error.message().to_owned();
    let help = error.remedy().map(str::to_owned);
    let place = error.excerpt().map(|shown| match shown.line {
        0 => shown.name.clone(),
        line => format!("{}:{line}", shown.name),
    });
    let plain = error.to_string();
    let report = bondline_terminal::report(error);
    let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor());
    let mut text = String::new();
    let text = match handler
        .with_width(WIDTH)
        .render_report(&mut text, report.as_ref())
    {
        Ok(()) => text.trim_start_matches([' ', '×']).trim_end(),
        Err(_) => &plain,
    };
    exception(py, "SceneError", text, &message, place, help.as_deref())
}

/// A scene that could not be run. The library's text says what, then, after a semicolon, what to do.
pub fn run_error(py: Python<'_>, error: &RunError) -> PyErr {
    let text = error.to_string();
    let (message, help) = match text.split_once("; ") {
        Some((message, help)) => (message, Some(help)),
        None => (text.as_str(), None),
    };
    exception(py, "RunError", &text, message, error.place(), help)
}

/// Turns the error of a check into an exception.
pub fn check_error(py: Python<'_>, error: CheckError) -> PyErr {
    match error {
        CheckError::Scene(error) => scene_error(py, *error),
        CheckError::Run(error) => run_error(py, &error),
    }
}

/// A value that no scene can hold, at a key.
pub fn value_error(py: Python<'_>, place: &str, message: &str, help: &str) -> PyErr {
    let text = format!("`{place}` {message}; {help}");
    let message = format!("`{place}` {message}");
    exception(
        py,
        "SceneError",
        &text,
        &message,
        Some(place.to_owned()),
        Some(help),
    )
}

/// A mistake of bondline itself.
pub fn defect(py: Python<'_>, message: &str) -> PyErr {
    let help = "this is a mistake of bondline: please report it with the scene";
    let text = format!("{message}; {help}");
    exception(py, "BondlineError", &text, message, None, Some(help))
}
