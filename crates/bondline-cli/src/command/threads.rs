//! Number of threads of a computation.

/// More threads than this for each core are refused unless they are asked for twice: every one of them costs time and none gains any.
const MOST_PER_CORE: usize = 4;

/// The variable by which rayon reads its number of threads.
const VARIABLE: &str = "RAYON_NUM_THREADS";

/// Permission to use more threads than the cores can serve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Oversubscribe {
    /// By `--oversubscribe`.
    Allowed,
    /// Not given.
    Refused,
}

/// Starts the threads that compute: `typed` of them, else one per core, else what the environment says.
///
/// # Errors
/// For numbers that no machine of these cores can use, and where the system refuses them.
pub fn start(typed: Option<usize>, oversubscribe: Oversubscribe) -> miette::Result<()> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let most = MOST_PER_CORE * cores;
    let from_environment = std::env::var(VARIABLE).ok().and_then(|v| v.parse().ok());
    let (wanted, by) = match (typed, from_environment) {
        (Some(n), _) => (n, "--threads"),
        (None, Some(n)) => (n, VARIABLE),
        (None, None) => return Ok(()),
    };
    if wanted > most && oversubscribe == Oversubscribe::Refused {
        return Err(miette::miette!(
            "{by} asks for {wanted} threads, this machine has {cores} cores: at most {most} are started; leave it out, or add --oversubscribe to start them all the same"
        ));
    }
    if typed.is_none() {
        return Ok(());
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(wanted)
        .build_global()
        .map_err(|e| miette::miette!("cannot start {wanted} threads: {e}; ask for fewer"))
}

/// Does `work` on one of the threads that compute. Begun from any other thread, each of its loops would put that to sleep and wake it again.
pub fn on_one<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| work())
}
