//! Names in a scene that become parts of the names of files.

use super::error::SceneError;
use super::value::Text;

/// Refuses a name that would put a file into another folder.
pub(super) fn part_of_a_file_name(place: &str, name: &Text) -> Result<(), SceneError> {
    let stray = |c: char| matches!(c, '/' | '\\') || c.is_control();
    if !name.value.is_empty() && !name.value.contains(stray) {
        return Ok(());
    }
    Err(SceneError::wrong_value(format!(
        "`{place}`: {:?} is no part of a file name",
        name.value
    ))
    .label(name.span.clone(), "names files")
    .help("use letters, digits, `-`, `_`, `.`; folders belong into output.directory"))
}
