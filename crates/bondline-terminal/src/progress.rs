//! A progress bar with the name of the stage and the time left on standard error, or lines where that is no terminal.

use std::io::{IsTerminal, Write as _};
use std::sync::{PoisonError, RwLock};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use bondline::progress::Progress;

use crate::progress_log::ProgressLog;

/// Draws each stage as one line: a bar with the time left where the number of steps is known, else a spinner. Where standard error is a file or a pipe, a long run
/// writes a plain line now and then.
#[derive(Debug)]
pub struct TerminalProgress {
    /// The bar of the current stage; none where standard error is no terminal.
    bar: RwLock<Option<ProgressBar>>,
    target: Target,
}

#[derive(Debug)]
enum Target {
    StandardError,
    Log(ProgressLog<std::io::Stderr>),
    #[cfg(test)]
    Memory(tests::Screen),
}

impl TerminalProgress {
    /// Draws on standard error if that is a terminal, else writes lines there.
    pub fn on_stderr() -> Self {
        Self::with(if std::io::stderr().is_terminal() {
            Target::StandardError
        } else {
            Target::Log(ProgressLog::on_stderr())
        })
    }

    fn with(target: Target) -> Self {
        Self {
            bar: RwLock::new(None),
            target,
        }
    }

    fn draw_target(&self) -> Option<ProgressDrawTarget> {
        match &self.target {
            Target::StandardError => Some(ProgressDrawTarget::stderr()),
            Target::Log(_) => None,
            #[cfg(test)]
            Target::Memory(screen) => Some(ProgressDrawTarget::term_like(Box::new(screen.clone()))),
        }
    }

    /// Puts a plain line in place of the current bar, then begins the next; in the other order the two would overwrite
    /// each other.
    fn replace(&self, next: impl FnOnce() -> Option<ProgressBar>) {
        // a bar that a panicking thread left behind can still be ended
        let mut bar = self.bar.write().unwrap_or_else(PoisonError::into_inner);
        if let Some(old) = bar.take() {
            // clearing moves the bar to its end, so the record is taken before
            let line = record(&old);
            old.finish_and_clear();
            self.write_line(&line);
        }
        *bar = next();
    }

    fn write_line(&self, line: &str) {
        match &self.target {
            // a terminal that has gone away is no reason to stop the computation
            Target::StandardError => drop(writeln!(std::io::stderr(), "{line}")),
            Target::Log(log) => log.note(line),
            #[cfg(test)]
            Target::Memory(screen) => screen.put(line),
        }
    }
}

/// Returns the line that stays of a stage: its name, its seconds, and its share where it stopped short.
fn record(bar: &ProgressBar) -> String {
    let seconds = bar.elapsed().as_secs_f64();
    let done = match bar.length() {
        Some(total) if bar.position() < total => {
            format!("  ({} of {total} steps)", bar.position())
        }
        _ => String::new(),
    };
    format!("{:<24} {seconds:8.2} s{done}", bar.prefix())
}

/// The style of a stage; the templates are fixed, so they always parse.
fn style(total: Option<u64>) -> ProgressStyle {
    let (template, plain) = match total {
        Some(_) => (
            "{prefix:<24} [{bar:30}] {percent:>3} %  {elapsed} gone, {eta} left  {msg}",
            ProgressStyle::default_bar(),
        ),
        None => (
            "{prefix:<24} {spinner} {pos} steps  {elapsed} gone",
            ProgressStyle::default_spinner(),
        ),
    };
    plain
        .clone()
        .template(template)
        .unwrap_or(plain)
        .progress_chars("=> ")
}

impl Progress for TerminalProgress {
    fn stage(&self, name: &str, total: Option<u64>) {
        if let Target::Log(log) = &self.target {
            log.stage(name, total);
        }
        self.replace(|| {
            let target = self.draw_target()?;
            let bar = ProgressBar::with_draw_target(total, target)
                .with_style(style(total))
                .with_prefix(name.to_owned());
            bar.tick();
            if matches!(self.target, Target::StandardError) {
                // a long step still shows that time passes
                bar.enable_steady_tick(Duration::from_millis(200));
            }
            Some(bar)
        });
    }

    fn advance(&self, by: u64) {
        if let Target::Log(log) = &self.target {
            return log.advance(by);
        }
        let bar = self.bar.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(bar) = &*bar {
            bar.inc(by);
        }
    }

    fn tell(&self, text: &str) {
        if let Target::Log(log) = &self.target {
            return log.tell(text);
        }
        let bar = self.bar.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(bar) = &*bar {
            bar.set_message(text.to_owned());
        }
    }

    fn note(&self, line: &str) {
        let bar = self.bar.read().unwrap_or_else(PoisonError::into_inner);
        match &*bar {
            Some(bar) => bar.suspend(|| self.write_line(line)),
            None => self.write_line(line),
        }
    }

    fn finish(&self) {
        self.replace(|| None);
    }
}

impl Drop for TerminalProgress {
    fn drop(&mut self) {
        self.replace(|| None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    /// A terminal that keeps every line drawn on it.
    #[derive(Clone, Debug, Default)]
    pub(super) struct Screen(Arc<Mutex<String>>);

    impl Screen {
        fn text(&self) -> String {
            self.0.lock().unwrap().clone()
        }

        pub(super) fn put(&self, text: &str) {
            self.0.lock().unwrap().push_str(text);
        }
    }

    impl indicatif::TermLike for Screen {
        fn width(&self) -> u16 {
            100
        }
        fn move_cursor_up(&self, _: usize) -> std::io::Result<()> {
            Ok(())
        }
        fn move_cursor_down(&self, _: usize) -> std::io::Result<()> {
            Ok(())
        }
        fn move_cursor_right(&self, _: usize) -> std::io::Result<()> {
            Ok(())
        }
        fn move_cursor_left(&self, _: usize) -> std::io::Result<()> {
            Ok(())
        }
        fn write_line(&self, text: &str) -> std::io::Result<()> {
            self.put(text);
            self.put("\n");
            Ok(())
        }
        fn write_str(&self, text: &str) -> std::io::Result<()> {
            self.put(text);
            Ok(())
        }
        fn clear_line(&self) -> std::io::Result<()> {
            self.put("\r");
            Ok(())
        }
        fn flush(&self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn stages_are_drawn_with_their_names_and_shares() {
        let screen = Screen::default();
        let progress = TerminalProgress::with(Target::Memory(screen.clone()));
        progress.stage("neighbours", Some(8));
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| progress.advance(1));
            }
        });
        progress.stage("factorise", None);
        progress.advance(3);
        progress.finish();
        let text = screen.text();
        let half = text.split("factorise").next().unwrap();
        assert!(half.contains("neighbours"), "{text}");
        assert!(
            half.contains("left") && half.contains("(4 of 8 steps)"),
            "{text}"
        );
        assert!(
            text.contains("factorise") && text.contains("gone"),
            "{text}"
        );
    }

    #[test]
    fn a_log_has_no_bar() {
        let progress = TerminalProgress::with(Target::Log(ProgressLog::on_stderr()));
        progress.stage("solve", Some(2));
        progress.advance(1);
        assert!(progress.bar.read().unwrap().is_none());
        progress.finish();
    }
}
