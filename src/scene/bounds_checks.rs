//! Checks of single numbers and expressions.

use super::error::SceneError;
use super::expression::Expression;
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

/// The largest modulus, whose square times those of lengths still is a number.
const STIFFEST: f64 = 1e100;

/// The value, if it is a modulus of elasticity.
pub(crate) fn modulus(place: &str, number: &Number) -> Result<f64, SceneError> {
    positive(place, number)?;
    within(
        place,
        number,
        number.value >= 1.0 / STIFFEST && number.value <= STIFFEST,
        "too small or too large to be computed with",
        "choose units in which it lies between 1e-100 and 1e100",
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
    Err(
        SceneError::wrong_value(format!("`{place}` is {}", number.value))
            .label(number.span.clone(), must)
            .help(help),
    )
}

/// Refuses an expression in `y` or `z` where the scene has no such axis.
pub(crate) fn no_further_axes<const D: usize>(
    place: &str,
    expression: &Expression,
) -> Result<(), SceneError> {
    // a function takes all coordinates, of which the further ones are zero
    let is_function = expression.function().is_some();
    match (D..3).find(|&k| !is_function && expression.depends_on(k)) {
        None => Ok(()),
        Some(k) => Err(SceneError::dimension(format!(
            "`{place}` uses {} in a scene of dimension {D}",
            ["x", "y", "z"][k]
        ))
        .label(expression.span.clone(), "no such axis")
        .help(format!(
            "use {} only",
            ["x", "x and y", "x, y and z"][D - 1]
        ))),
    }
}
