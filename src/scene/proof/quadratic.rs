//! The force of quadratic fields beside the seam, against the constant force density that balances them.

use super::Subject;
use crate::observe::proof::Part;
use crate::scene::run::RunError;

/// Applies the rows beside the seam to every quadratic field.
///
/// # Errors
/// None so far.
pub(super) fn part<const D: usize>(_subject: &Subject<'_, D>) -> Result<Option<Part>, RunError> {
    Ok(None)
}
