//! Signals: a run in time leaves a checkpoint and ends; whatever else goes on ends at once.

use std::sync::atomic::{AtomicBool, Ordering};

use bondline_terminal::tell;

/// Exit status of a run that was interrupted, as shells have it.
pub const INTERRUPTED: u8 = 130;

/// Flags that Ctrl-C or a termination sets and reads.
#[derive(Debug, Default)]
pub struct Interrupt {
    /// Set by the signal.
    pub asked: AtomicBool,
    /// Set by a run once it looks at `asked` after every step. Before, nothing would be lost by ending, and a run that waits would never look.
    pub heeded: AtomicBool,
}

/// Listens for signals. The first one asks a run that heeds it to end; without such a run it ends the program, and the second one always does.
///
/// # Errors
/// If the system does not let it listen.
pub fn listen() -> miette::Result<&'static Interrupt> {
    static INTERRUPT: Interrupt = Interrupt {
        asked: AtomicBool::new(false),
        heeded: AtomicBool::new(false),
    };
    ctrlc::set_handler(|| {
        let again = INTERRUPT.asked.load(Ordering::Relaxed);
        if again || !INTERRUPT.heeded.load(Ordering::Relaxed) {
            std::process::exit(i32::from(INTERRUPTED));
        }
        tell("ending with a checkpoint of the last step; once more ends at once, without a checkpoint");
        // last: a run that sees it may be at its end before this thread goes on
        INTERRUPT.asked.store(true, Ordering::Relaxed);
    })
    .map_err(|e| miette::miette!("cannot watch for Ctrl-C: {e}"))?;
    Ok(&INTERRUPT)
}
