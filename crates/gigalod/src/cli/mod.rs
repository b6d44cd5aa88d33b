//! Parses the arguments, runs one command, and reports how it went.

pub(crate) mod args;
mod bench;
mod build;
mod cache;
mod compare;
mod demo;
mod error;
#[cfg(feature = "view")]
mod exact;
mod export;
mod files;
mod info;
mod inputs;
mod parse;
mod path_file;
mod progress;
mod reduction;
mod render;
mod scene_file;
mod stage;
mod subject;
mod synth;
mod usage;
mod verify;
mod verify_hybrid;
#[cfg(feature = "view")]
mod view;
#[cfg(feature = "view")]
mod view_files;
#[cfg(feature = "view")]
mod view_folder;
#[cfg(feature = "view")]
mod view_preview;

use args::{Cli, Command};
use clap::Parser;
use clap::error::ErrorKind;
use error::{CliError, Outcome};
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;

/// Runs the program.
pub(crate) fn run() -> ExitCode {
    let json_asked_for = std::env::args_os().any(|argument| argument == "--json");
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            return usage_error(&error, json_asked_for);
        }
    };
    // Where there are no signals to handle, files of an interrupted run stay behind; that is no reason not to run.
    let _ = ctrlc::set_handler(|| {
        #[cfg(feature = "view")]
        view_files::abandon_builds();
        let kept = gigalod_build::abandon();
        // Where nobody can be told, it ends all the same.
        let _ = writeln!(io::stderr(), "interrupted");
        if !kept.is_empty() {
            let _ = writeln!(io::stderr(), "hint: {}", build::CONTINUE);
        }
        std::process::exit(130);
    });
    let console = progress::Console::new(cli.verbose);
    let outcome = match &cli.command {
        #[cfg(feature = "view")]
        Command::View(args) => view::run(args, &console),
        Command::Build(args) => build::run(args, &console),
        Command::Render(args) => render::run(args, &console),
        Command::Bench(args) => bench::run(args, &console),
        Command::Info(args) => info::run(args, &console),
        Command::Verify(args) => verify::run(args, &console),
        Command::Export(args) => export::run(args, &console),
        Command::Compare(args) => compare::run(args, &console),
        Command::Synth(args) => synth::run(args, &console),
        Command::Demo(args) => demo::run(args, &console),
    };
    match outcome {
        Ok(Outcome { json, text, good }) => {
            let said = say(&if cli.json { json + "\n" } else { text });
            if let Err(error) = &said {
                console.line(CliError::write(Path::new("standard output"), error));
            }
            ExitCode::from(if good && said.is_ok() { 0 } else { 1 })
        }
        Err(error) => {
            if cli.json {
                let _ = say(&format!("{}\n", error.to_json()));
            }
            console.line(&error);
            ExitCode::from(if error.is_usage { 2 } else { 1 })
        }
    }
}

/// What the parser of arguments has to say: help, the version, or one line that says what is wrong.
fn usage_error(error: &clap::Error, json_asked_for: bool) -> ExitCode {
    if !error.use_stderr() || error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        // A closed pipe is not our problem.
        let _ = error.print();
        return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
    }
    // What is wrong stands in the first paragraph; tips, usage and where to find help follow.
    let text = error.to_string();
    let mut paragraphs = text.split("\n\n");
    let what = paragraphs.next().unwrap_or_default();
    let mut wrong = CliError::usage(what.trim_start_matches("error: "));
    for paragraph in paragraphs {
        let hint = paragraph.split_whitespace().collect::<Vec<_>>().join(" ");
        wrong = wrong.hint(hint.trim_start_matches("tip: ").trim_start_matches("For more information, "));
    }
    if json_asked_for {
        let _ = say(&format!("{}\n", wrong.to_json()));
    }
    let _ = writeln!(io::stderr(), "{wrong}");
    ExitCode::from(2)
}

/// Writes to standard output. A reader that has read enough is no error.
fn say(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error),
        _ => Ok(()),
    }
}
