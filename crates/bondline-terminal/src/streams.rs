//! Standard output and standard error, which may be full disks or readers that have left.

use std::fmt::Display;
use std::io::{ErrorKind, Write as _};

/// Writes a line to standard output. A reader that has left, as `head` does, has what it wanted.
///
/// # Errors
/// If it cannot be written for another reason: results that nobody gets are no success.
pub fn print(text: impl Display) -> miette::Result<()> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(miette::miette!(
            "cannot write to standard output: {e}; free the disk, or send it elsewhere"
        )),
        _ => Ok(()),
    }
}

/// Writes a line to standard error. Where that is full or closed there is nobody left to tell; the exit status says how it went.
pub fn tell(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}
