//! The program `bondline`.

use std::process::ExitCode;

use bondline_terminal::memory::Allocator;

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

fn main() -> ExitCode {
    let program = std::env::current_exe();
    ExitCode::from(bondline_cli::command(program, std::env::args_os()))
}
