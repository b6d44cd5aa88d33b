//! What long work says on standard error while it lasts: a bar on a terminal, plain lines elsewhere.

use super::error::CliError;
use gigalod_build::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::fmt::Display;
use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Where messages go.
#[derive(Debug)]
pub(crate) struct Console {
    verbose: bool,
    on_terminal: bool,
}

/// Without a terminal, a line at most so often.
const LINE_EVERY: Duration = Duration::from_secs(5);

/// The same with `-v`.
const VERBOSE_LINE_EVERY: Duration = Duration::from_millis(250);

impl Console {
    pub(crate) fn new(verbose: bool) -> Self {
        Self { verbose, on_terminal: std::io::stderr().is_terminal() }
    }

    /// A line on standard error. Where nobody can be told, work goes on all the same.
    pub(crate) fn line(&self, text: impl Display) {
        let _ = writeln!(std::io::stderr(), "{text}");
    }

    /// Something is not as it should be, but work goes on.
    pub(crate) fn warn(&self, what: &CliError) {
        self.line(what.to_string().replacen("error:", "warning:", 1));
    }

    /// Said with `-v`.
    pub(crate) fn detail(&self, text: impl FnOnce() -> String) {
        if self.verbose {
            self.line(text());
        }
    }

    fn line_every(&self) -> Duration {
        if self.verbose { VERBOSE_LINE_EVERY } else { LINE_EVERY }
    }

    /// Progress of one piece of work.
    pub(crate) fn work(&self, name: &str) -> Work<'_> {
        Work { console: self, name: name.to_string(), state: Mutex::new(None) }
    }
}

/// One piece of work, phase after phase.
pub(crate) struct Work<'a> {
    console: &'a Console,
    name: String,
    state: Mutex<Option<Phase>>,
}

struct Phase {
    name: &'static str,
    bar: ProgressBar,
    total: u64,
    last_line: Instant,
}

impl Work<'_> {
    /// Clears the bar.
    pub(crate) fn finish(&self) {
        if let Some(phase) = self.state.lock().expect("nobody panics while holding it").take() {
            phase.bar.finish_and_clear();
        }
    }
}

impl Drop for Work<'_> {
    fn drop(&mut self) {
        self.finish();
    }
}

impl Progress for Work<'_> {
    fn note(&self, text: &str) {
        self.console.line(format_args!("note: {text}"));
    }

    fn begin(&self, phase: &'static str, total: u64) {
        self.finish();
        let bar = if !self.console.on_terminal {
            ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden())
        } else if total == 0 {
            let style = ProgressStyle::with_template("{prefix} {spinner} {elapsed}");
            let bar = ProgressBar::new_spinner().with_style(style.expect("the template is right"));
            bar.enable_steady_tick(Duration::from_millis(100));
            bar
        } else {
            let template = match phase {
                "read" | "generate" => {
                    "{prefix} {bar:30} {binary_bytes}/{binary_total_bytes} {binary_bytes_per_sec}, {eta} left"
                }
                _ => "{prefix} {bar:30} {human_pos}/{human_len} {per_sec}, {eta} left",
            };
            ProgressBar::new(total).with_style(ProgressStyle::with_template(template).expect("the template is right"))
        };
        bar.set_prefix(format!("{}: {phase}", self.name));
        self.console.detail(|| format!("{}: {phase}", self.name));
        let state = Phase { name: phase, bar, total, last_line: Instant::now() };
        *self.state.lock().expect("nobody panics while holding it") = Some(state);
    }

    fn at(&self, done: u64) {
        let mut state = self.state.lock().expect("nobody panics while holding it");
        let Some(phase) = &mut *state else { return };
        phase.bar.set_position(done);
        if !self.console.on_terminal && phase.total > 0 && phase.last_line.elapsed() >= self.console.line_every() {
            phase.last_line = Instant::now();
            let percent = done.saturating_mul(100) / phase.total;
            let left = phase.bar.eta().as_secs();
            self.console.line(format_args!("{}: {} {percent} %, {left} s left", self.name, phase.name));
        }
    }
}
