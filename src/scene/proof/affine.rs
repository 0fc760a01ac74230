//! The force of every affine field, row by row, against that of its constant stress.

use super::Subject;
use crate::observe::proof::Part;
use crate::progress::Progress;
use crate::scene::run::RunError;

/// Applies the rows to every affine field.
///
/// # Errors
/// None so far.
pub(super) fn part<const D: usize>(
    _subject: &Subject<'_, D>,
    _progress: &dyn Progress,
) -> Result<Option<Part>, RunError> {
    Ok(None)
}
