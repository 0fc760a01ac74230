//! The processes of a job under `mpirun`, where a program is built for them.

#[cfg(feature = "petsc")]
pub use petsc::Processes;

#[cfg(not(feature = "petsc"))]
pub use alone::Processes;

/// The number of this process, and how many `mpirun` or the like has started, as the environment tells; none where nothing has started them.
fn started() -> Option<(usize, usize)> {
    let number = |name| std::env::var(name).ok()?.parse::<usize>().ok();
    let kinds = [
        ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"),
        ("PMI_RANK", "PMI_SIZE"),
    ];
    let mut found = kinds
        .into_iter()
        .filter_map(|(rank, size)| Some((number(rank).unwrap_or(0), number(size)?)));
    found.next()
}

/// Refuses several processes for what one has to do alone.
///
/// # Errors
/// Fails if `mpirun` has started several; those after the first wait, so that the error is reported once.
pub fn refuse_several() -> miette::Result<()> {
    match started() {
        Some((rank, count)) if count > 1 => {
            if rank > 0 {
                std::thread::sleep(PATIENCE);
            }
            Err(miette::miette!(
                help = "leave out mpirun",
                "mpirun has started {count} processes, each of which would do all of this: only `bondline run`, and `verify` of some suites, share their work"
            ))
        }
        _ => Ok(()),
    }
}

/// Time for which processes after the first wait for its message, which ends them.
const PATIENCE: std::time::Duration = std::time::Duration::from_secs(2);

#[cfg(feature = "petsc")]
mod petsc {
    use bondline::system::Ranks;
    use bondline_petsc::{PetscRanks, is_under_mpi};

    use crate::tell;

    /// The processes of this run: one, unless `mpirun` has started several.
    pub struct Processes(Option<PetscRanks>);

    impl Processes {
        /// Starts MPI, where there is any.
        ///
        /// # Errors
        /// Fails if MPI does not start.
        pub fn start() -> miette::Result<Self> {
            if !is_under_mpi() {
                return Ok(Self(None));
            }
            let ranks = PetscRanks::start();
            let ranks = ranks.map_err(|e| miette::miette!("cannot start MPI and PETSc: {e}"))?;
            // else the threads of every process would take all cores
            let one = std::env::var_os("RAYON_NUM_THREADS").is_none();
            // as many as the variable says, for 0; this thread, which alone may send messages, is one of them
            let pool = rayon::ThreadPoolBuilder::new().num_threads(usize::from(one));
            let started = pool.use_current_thread().build_global();
            started.map_err(|e| miette::miette!("cannot start a thread: {e}"))?;
            Ok(Self(Some(ranks)))
        }

        /// This process alone, to cut graphs as a run would; nothing where PETSc does not start.
        pub fn of_prediction() -> Self {
            Self(PetscRanks::start().ok())
        }

        /// The processes, if there are several.
        pub fn ranks(&self) -> Option<&dyn Ranks> {
            self.0.as_ref().map(|ranks| ranks as &dyn Ranks)
        }

        /// Ends MPI; with an error all processes, with the exit status `wrong`.
        ///
        /// # Errors
        /// Those of a run by one process.
        pub fn end(self, result: miette::Result<u8>, wrong: u8) -> miette::Result<u8> {
            match (self.0, result) {
                (Some(ranks), Err(report)) => {
                    ranks.fail(|| tell(format_args!("{report:?}")), wrong)
                }
                (Some(ranks), Ok(code)) => {
                    ranks.stop();
                    Ok(code)
                }
                (None, result) => result,
            }
        }
    }
}

#[cfg(not(feature = "petsc"))]
mod alone {
    use bondline::system::Ranks;

    /// The one process of this run.
    pub struct Processes;

    impl Processes {
        /// Nothing is to be started.
        ///
        /// # Errors
        /// Fails if `mpirun` has started several, of which each would run the whole scene.
        pub fn start() -> miette::Result<Self> {
            match super::started() {
                Some((_, count)) if count > 1 => Err(miette::miette!(
                    help = "build it with `cargo build --release --bins --features bondline-cli/petsc` (docs/clusters.md), or run it without mpirun",
                    "mpirun has started {count} processes, and this program was built without the feature petsc, so that each would do all of the work"
                )),
                _ => Ok(Self),
            }
        }

        /// Nothing cuts graphs.
        pub fn of_prediction() -> Self {
            Self
        }

        /// There are no others.
        pub fn ranks(&self) -> Option<&dyn Ranks> {
            None
        }

        /// Gives the result back.
        ///
        /// # Errors
        /// That of the result.
        pub fn end(self, result: miette::Result<u8>, _wrong: u8) -> miette::Result<u8> {
            result
        }
    }
}
