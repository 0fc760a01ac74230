//! Files that are files: a named pipe, a device or a folder in the place of one is refused before it is opened, since reading a pipe waits for its
//! writer and reading a device may never end.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{Error, ErrorKind, Read as _, Result};
use std::path::Path;

/// Opens a regular file, or a link to one.
///
/// # Errors
/// Those of the system, and [`ErrorKind::InvalidInput`] with the kind of thing that lies there instead.
pub fn open(path: &Path, options: &OpenOptions) -> Result<File> {
    let found = std::fs::metadata(path)?;
    if !found.is_file() {
        return Err(Error::new(
            ErrorKind::InvalidInput,
            format!("it is {}, not a file", kind(&found)),
        ));
    }
    options.open(path)
}

/// The content of a regular file.
///
/// # Errors
/// As [`open`], and those of reading.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path, OpenOptions::new().read(true))?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The content of a regular file, as text.
///
/// # Errors
/// As [`open`], and [`ErrorKind::InvalidData`] for what is no text.
pub fn read_to_string(path: &Path) -> Result<String> {
    String::from_utf8(read(path)?).map_err(|e| Error::new(ErrorKind::InvalidData, e.utf8_error()))
}

/// The remedy for a text that cannot be read: another encoding for what is no text, else `otherwise`.
pub fn remedy(error: &Error, otherwise: &'static str) -> &'static str {
    match error.kind() {
        ErrorKind::InvalidData => "save it as text in UTF-8",
        _ => otherwise,
    }
}

/// The longest scene that is read \[bytes\].
const LONGEST_SCENE: u64 = 64 << 20;

/// The text of a scene, which may come through a pipe.
///
/// # Errors
/// Those of the system, and [`ErrorKind::InvalidData`] for what is no text or does not end.
pub fn read_scene(path: &Path) -> Result<String> {
    let mut text = String::new();
    File::open(path)?
        .take(LONGEST_SCENE + 1)
        .read_to_string(&mut text)?;
    if text.len() as u64 > LONGEST_SCENE {
        let message = format!("it is longer than {} MiB", LONGEST_SCENE >> 20);
        return Err(Error::new(ErrorKind::InvalidData, message));
    }
    Ok(text)
}

/// Refuses what is there and no file; a file that is still to be made may be missing.
///
/// # Errors
/// As [`open`].
pub fn may_be_written(path: &Path) -> Result<()> {
    match std::fs::metadata(path) {
        Ok(found) if !found.is_file() => Err(Error::new(
            ErrorKind::InvalidInput,
            format!("it is {}, not a file", kind(&found)),
        )),
        _ => Ok(()),
    }
}

fn kind(found: &Metadata) -> &'static str {
    if found.is_dir() {
        return "a folder";
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        let kind = found.file_type();
        if kind.is_fifo() {
            return "a named pipe";
        }
        if kind.is_socket() {
            return "a socket";
        }
    }
    "a device"
}
