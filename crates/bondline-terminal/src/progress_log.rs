//! Progress as plain lines for a file or a pipe: now and then one on the state of the stage, and none in a short run.

use std::io::Write;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use bondline::progress::Progress;

/// The shortest time between two lines: what takes less needs none.
const SHORTEST: Duration = Duration::from_secs(10);

/// The longest time between two lines.
const LONGEST: Duration = Duration::from_secs(600);

/// Between two lines there is this share of the time so far, so that a log stays short however long a run takes.
const SHARE: f64 = 0.1;

/// Lines on a stream that is no terminal.
#[derive(Debug)]
pub(crate) struct ProgressLog<W> {
    stage: Mutex<Stage<W>>,
    /// Steps of the stage so far; many threads may count.
    done: AtomicU64,
    shortest: Duration,
}

/// The stage at hand.
#[derive(Debug)]
struct Stage<W> {
    stream: W,
    name: String,
    total: Option<u64>,
    message: String,
    /// Begin of the stage.
    begun: Instant,
    /// Begin of the run.
    run_begun: Instant,
    /// Time of the last line, or begin of the run.
    told: Instant,
}

impl ProgressLog<std::io::Stderr> {
    /// Lines on standard error.
    pub fn on_stderr() -> Self {
        Self::new(std::io::stderr(), SHORTEST)
    }
}

impl<W: Write + Send> ProgressLog<W> {
    fn new(stream: W, shortest: Duration) -> Self {
        let now = Instant::now();
        let stage = Stage {
            stream,
            name: String::new(),
            total: None,
            message: String::new(),
            begun: now,
            run_begun: now,
            told: now,
        };
        Self {
            stage: Mutex::new(stage),
            done: AtomicU64::new(0),
            shortest,
        }
    }

    /// Changes the stage, and writes a line if one is due.
    fn change(&self, change: impl FnOnce(&mut Stage<W>)) {
        // a stage that a panicking thread left behind can still be told of
        let mut stage = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut stage);
        self.write_if_due(&mut stage);
    }

    fn write_if_due(&self, stage: &mut Stage<W>) {
        let now = Instant::now();
        let wait = (now - stage.run_begun).mul_f64(SHARE);
        if now - stage.told >= wait.clamp(self.shortest, LONGEST.max(self.shortest)) {
            stage.told = now;
            let line = stage.line(self.done.load(Ordering::Relaxed), now);
            // a log that is full is no reason to stop
            let _ = writeln!(stage.stream, "{line}");
        }
    }
}

impl<W> Stage<W> {
    /// Returns a line on the progress of the stage.
    fn line(&self, done: u64, now: Instant) -> String {
        let gone = (now - self.begun).as_secs_f64();
        let mut line = format!("{}: ", self.name);
        match self.total {
            Some(total) if total > 0 => {
                let share = done.min(total) as f64 / total as f64;
                line += &format!("{:.0} %, {gone:.0} s gone", 100.0 * share);
                if share > 0.0 {
                    line += &format!(", {:.0} s left", gone * (1.0 / share - 1.0));
                }
            }
            _ => line += &format!("{done} steps, {gone:.0} s gone"),
        }
        if !self.message.is_empty() {
            line += ", ";
            line += &self.message;
        }
        line
    }
}

impl<W: Write + Send> Progress for ProgressLog<W> {
    fn stage(&self, name: &str, total: Option<u64>) {
        self.done.store(0, Ordering::Relaxed);
        self.change(|stage| {
            name.clone_into(&mut stage.name);
            stage.total = total;
            stage.message.clear();
            stage.begun = Instant::now();
        });
    }

    fn advance(&self, by: u64) {
        self.done.fetch_add(by, Ordering::Relaxed);
        // whoever holds it looks at the clock
        if let Ok(mut stage) = self.stage.try_lock() {
            self.write_if_due(&mut stage);
        }
    }

    fn tell(&self, text: &str) {
        self.change(|stage| text.clone_into(&mut stage.message));
    }

    fn note(&self, line: &str) {
        let mut stage = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        let _ = writeln!(stage.stream, "{line}");
    }

    fn finish(&self) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(log: ProgressLog<Vec<u8>>) -> String {
        let stage = log.stage.into_inner().unwrap();
        String::from_utf8(stage.stream).unwrap()
    }

    #[test]
    fn a_line_says_how_a_stage_stands() {
        let log = ProgressLog::new(Vec::new(), Duration::ZERO);
        log.stage("explicit dynamics", Some(8));
        log.tell("energy 1");
        // a line is due after a share of the time gone, which is none unless this thread had to wait
        std::thread::sleep(Duration::from_millis(50));
        log.advance(2);
        let text = written(log);
        let last = text.lines().last().unwrap();
        assert_eq!(
            last, "explicit dynamics: 25 %, 0 s gone, 0 s left, energy 1",
            "{text}"
        );
        assert!(
            text.starts_with("explicit dynamics: 0 %, 0 s gone\n"),
            "{text}"
        );
        assert!(!text.contains(['\r', '\x1b']), "{text}");
    }

    #[test]
    fn a_short_run_writes_none_but_notes() {
        let log = ProgressLog::new(Vec::new(), SHORTEST);
        log.stage("solve", None);
        for _ in 0..1000 {
            log.advance(1);
        }
        log.note("stays");
        log.finish();
        assert_eq!(written(log), "stays\n");
    }
}
