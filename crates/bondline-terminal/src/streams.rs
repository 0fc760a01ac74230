//! Standard output and standard error, which may be full disks or readers that have left.

use std::fmt::Display;
use std::io::Write as _;

/// Writes a line to standard output.
///
/// # Errors
/// If it cannot be written: results that nobody gets are no success.
pub fn print(text: impl Display) -> miette::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{text}")
        .and_then(|()| out.flush())
        .map_err(|e| {
            miette::miette!(
                "cannot write to standard output: {e}; free the disk, or send it elsewhere"
            )
        })
}

/// Writes a line to standard error. Where that is full or closed there is nobody left to tell; the exit status says how it went.
pub fn tell(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}
