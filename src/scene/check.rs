//! Checks of single numbers.

use super::error::{SceneError, SceneErrorKind};
use super::value::Number;

/// The value, if it is positive.
pub(crate) fn positive(place: &str, number: &Number) -> Result<f64, SceneError> {
    within(
        place,
        number,
        number.value > 0.0,
        "must be positive",
        "make it larger than 0",
    )
}

/// The value, if it is zero or positive.
pub(crate) fn not_negative(place: &str, number: &Number) -> Result<f64, SceneError> {
    within(
        place,
        number,
        number.value >= 0.0,
        "must not be negative",
        "make it 0 or larger",
    )
}

/// The value, if `right`; else an error that says what it must be and what to do.
pub(crate) fn within(
    place: &str,
    number: &Number,
    right: bool,
    must: &str,
    help: &str,
) -> Result<f64, SceneError> {
    if right {
        return Ok(number.value);
    }
    Err(SceneError::new(
        SceneErrorKind::WrongValue,
        format!("`{place}` is {}", number.value),
    )
    .label(number.span.clone(), must)
    .help(help))
}
