//! A computation on a thread of its own. The thread that asked for it lets the interpreter go on, looks for signals and shows progress.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use bondline::Progress;
use bondline::observe::Observer;
use bondline::observe::csv::Entry;
use bondline::observe::vtu::Snapshot;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::errors::defect;

/// Interval at which signals are looked for, and progress is shown.
const TICK: Duration = Duration::from_millis(50);

/// Stack of the computation, as large as that of a program's first thread.
const STACK: usize = 8 << 20;

/// Payload with which the stack is unwound when a computation is cancelled.
struct Cancelled;

enum Message<T> {
    /// Cells, points and fields of a run on its way.
    Frame(Box<Snapshot>),
    Done(T),
}

/// A table of a run, row by row.
#[derive(Debug)]
pub struct Table {
    /// Its name.
    pub name: String,
    /// The names of its columns.
    pub columns: Vec<String>,
    /// Its rows.
    pub rows: Vec<Vec<Entry>>,
}

/// The stage of a computation.
#[derive(Clone, Debug, Default)]
struct Stage {
    name: String,
    total: Option<u64>,
    text: String,
}

/// A computation as seen from outside.
#[derive(Debug, Default)]
pub struct Watched {
    stage: Mutex<Stage>,
    done: AtomicU64,
    /// Asks the computation to end.
    pub stop: AtomicBool,
    /// Set by a run in time once it looks at `stop` after every step, and ends with a checkpoint.
    pub heeded: AtomicBool,
}

impl Watched {
    fn set(&self, change: impl FnOnce(&mut Stage)) {
        change(&mut self.stage.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// Ends a computation that looks at nothing else, from within what it reports to. All that it holds is dropped; files are written whole or not at all.
    fn go_on_or_unwind(&self) {
        if self.stop.load(Ordering::Relaxed) && !self.heeded.load(Ordering::Relaxed) {
            resume_unwind(Box::new(Cancelled));
        }
    }
}

impl Progress for Watched {
    fn stage(&self, name: &str, total: Option<u64>) {
        self.go_on_or_unwind();
        self.done.store(0, Ordering::Relaxed);
        self.set(|s| {
            *s = Stage {
                name: name.to_owned(),
                total,
                text: String::new(),
            }
        });
    }

    fn advance(&self, by: u64) {
        self.go_on_or_unwind();
        self.done.fetch_add(by, Ordering::Relaxed);
    }

    fn tell(&self, text: &str) {
        self.set(|s| text.clone_into(&mut s.text));
    }

    fn finish(&self) {}
}

/// Hands the results of a run to the thread that asked for it.
pub struct Outlet<T> {
    sender: SyncSender<Message<T>>,
    files: bool,
    tables: Mutex<Vec<Table>>,
}

impl<T> std::fmt::Debug for Outlet<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Outlet")
            .field("files", &self.files)
            .finish()
    }
}

impl<T: Send> Outlet<T> {
    /// Says whether files are written as well.
    pub fn with_files(mut self, files: bool) -> Self {
        self.files = files;
        self
    }

    /// The tables of the run.
    pub fn into_tables(self) -> Vec<Table> {
        self.tables
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T: Send> Observer for Outlet<T> {
    fn wants_files(&self) -> bool {
        self.files
    }

    fn row(&self, table: &str, columns: &[String], row: &[Entry]) {
        let mut tables = self.tables.lock().unwrap_or_else(PoisonError::into_inner);
        match tables.iter_mut().find(|known| known.name == table) {
            Some(known) => known.rows.push(row.to_vec()),
            None => tables.push(Table {
                name: table.to_owned(),
                columns: columns.to_vec(),
                rows: vec![row.to_vec()],
            }),
        }
    }

    fn snapshot(&self, snapshot: Snapshot) {
        // nobody listens to a run that was given up
        let _ = self.sender.send(Message::Frame(Box::new(snapshot)));
    }
}

/// Reaction of a computation to a signal that asks for its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It ends where it next reports progress, or after its step. A second signal gives it up.
    InOrder,
    /// It reports nothing: it is given up, and its result dropped.
    GivenUp,
}

/// Computes `job` on a thread of its own and returns what it returns. Meanwhile `visit` takes its frames, and `progress` is called with stage, steps done,
/// steps of the stage (or None) and a few words.
///
/// # Errors
/// `KeyboardInterrupt` and whatever else a signal raises, what `visit` and `progress` raise, and a defect of the library.
pub fn attend<T: Send + 'static>(
    py: Python<'_>,
    ending: Ending,
    progress: Option<&Bound<'_, PyAny>>,
    mut visit: impl FnMut(Snapshot) -> PyResult<()>,
    job: impl FnOnce(&Watched, Outlet<T>) -> T + Send + 'static,
) -> PyResult<T> {
    let watched = Arc::new(Watched::default());
    // a run waits until what it showed is taken: frames do not pile up
    let (sender, mut receiver) = sync_channel::<Message<T>>(1);
    let seen = Arc::clone(&watched);
    let thread = Builder::new()
        .name("bondline".to_owned())
        .stack_size(STACK)
        .spawn(move || {
            let outlet = Outlet {
                sender: sender.clone(),
                files: false,
                tables: Mutex::default(),
            };
            let done = job(&seen, outlet);
            let _ = sender.send(Message::Done(done));
        })
        .map_err(|e| defect(py, &format!("no thread can be started: {e}")))?;
    let mut raised: Option<PyErr> = None;
    let mut told = (String::new(), u64::MAX);
    loop {
        let (back, message) = py.detach(move || waited(receiver));
        receiver = back;
        let outcome = match message {
            Ok(Message::Done(done)) => {
                // nothing but the end of the thread is left
                let _ = py.detach(move || thread.join());
                return raised.map_or(Ok(done), Err);
            }
            Ok(Message::Frame(shown)) if raised.is_none() => visit(*shown),
            Ok(Message::Frame(_)) => Ok(()),
            Err(RecvTimeoutError::Timeout) => match progress.filter(|_| raised.is_none()) {
                Some(progress) => show(&watched, progress, &mut told),
                None => Ok(()),
            },
            Err(RecvTimeoutError::Disconnected) => return Err(unwound(py, thread, raised)),
        };
        if let Err(error) = outcome.and_then(|()| py.check_signals()) {
            watched.stop.store(true, Ordering::Relaxed);
            if raised.is_some() || ending == Ending::GivenUp {
                return Err(error);
            }
            raised = Some(error);
        }
    }
}

type Waited<T> = (Receiver<Message<T>>, Result<Message<T>, RecvTimeoutError>);

fn waited<T>(receiver: Receiver<Message<T>>) -> Waited<T> {
    let message = receiver.recv_timeout(TICK);
    (receiver, message)
}

/// Shows how a computation stands, if that has changed.
fn show(watched: &Watched, progress: &Bound<'_, PyAny>, told: &mut (String, u64)) -> PyResult<()> {
    let stage = watched
        .stage
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .clone();
    let done = watched.done.load(Ordering::Relaxed);
    if stage.name.is_empty() || (told.0 == stage.name && told.1 == done) {
        return Ok(());
    }
    *told = (stage.name.clone(), done);
    progress.call1((stage.name, done, stage.total, stage.text))?;
    Ok(())
}

/// Returns the exception for a thread that ended without a result.
fn unwound(py: Python<'_>, thread: JoinHandle<()>, raised: Option<PyErr>) -> PyErr {
    let payload = match py.detach(move || thread.join()) {
        Ok(()) => return raised.unwrap_or_else(|| defect(py, "the computation gave no result")),
        Err(payload) => payload,
    };
    if payload.is::<Cancelled>() {
        return raised.unwrap_or_else(|| PyKeyboardInterrupt::new_err(()));
    }
    let words = payload.downcast_ref::<String>().map(String::as_str);
    let words = words.or_else(|| payload.downcast_ref::<&str>().copied());
    defect(
        py,
        &format!("the computation stopped: {}", words.unwrap_or("no reason")),
    )
}
