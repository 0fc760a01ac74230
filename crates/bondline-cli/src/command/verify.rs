//! `bondline verify`: the suites are a program of their own, which lies beside this one, so that whoever runs scenes does not build them.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The name of the program.
const NAME: &str = "bondline-verify";

/// Becomes the program of the suites, with the same arguments, streams, signals and exit status.
///
/// # Errors
/// Fails if that program does not lie beside this one, or does not start.
pub fn start(program: std::io::Result<PathBuf>, arguments: &[OsString]) -> miette::Result<u8> {
    let this = program
        .map_err(|e| miette::miette!("cannot find this program, beside which {NAME} lies: {e}"))?;
    let program = beside(&this);
    if !program.is_file() {
        return Err(miette::miette!(
            help = format!(
                "in a clone: cargo build --release --bin {NAME}; else: cargo install --path crates/{NAME}"
            ),
            "there is no {}: the suites of `bondline verify` are a program of their own",
            program.display()
        ));
    }
    let mut command = Command::new(&program);
    command.args(arguments);
    run(&mut command)
        .map_err(|e| miette::miette!("cannot start {}: {e}; build it again", program.display()))
}

/// Returns the path of the program of the suites for a program at `this`.
fn beside(this: &Path) -> PathBuf {
    this.with_file_name(format!("{NAME}{}", std::env::consts::EXE_SUFFIX))
}

/// The process itself becomes the other program: a signal meets that alone.
#[cfg(unix)]
fn run(command: &mut Command) -> std::io::Result<u8> {
    use std::os::unix::process::CommandExt as _;
    Err(command.exec())
}

/// Waits for the other program; Ctrl-C reaches both.
#[cfg(not(unix))]
fn run(command: &mut Command) -> std::io::Result<u8> {
    let status = command.status()?;
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    Ok(code.unwrap_or(1))
}
