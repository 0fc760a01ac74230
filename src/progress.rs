//! Reports of a long computation to the person who waits for it.
//!
//! Assembly and solvers report to a [`Progress`]; they do not know whether anybody watches. The terminal bar lives in
//! the crate `bondline-terminal`, so that nothing below it writes to a stream.

/// A listener to the stages of a computation.
///
/// Calls come in the order `stage`, any number of `advance`, `stage`, …, `finish`; a new stage ends the one before it.
/// `advance` may be called from several threads.
pub trait Progress: Sync {
    /// Begins a stage; `total` is the number of steps it will `advance` by, where that is known.
    fn stage(&self, name: &str, total: Option<u64>);

    /// Reports `by` further steps of the current stage; zero within a long step. A listener may end the computation here, by unwinding.
    fn advance(&self, by: u64);

    /// Returns true if the listener wants the computation to end. Only what can end in order looks: load steps, from the last of which a run goes on.
    fn asks_to_end(&self) -> bool {
        false
    }

    /// Reports the state of the current stage in a few words, for the person who watches.
    fn tell(&self, _text: &str) {}

    /// A result on the way that stays to be read, also where nobody watches: hours of work should not be lost with their last line.
    fn note(&self, _line: &str) {}

    /// Ends the last stage.
    fn finish(&self);
}

/// Listens to nothing: for libraries, tests and `--json`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _name: &str, _total: Option<u64>) {}

    fn advance(&self, _by: u64) {}

    fn finish(&self) {}
}
