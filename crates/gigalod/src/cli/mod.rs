//! Parses the arguments, runs one command, and reports how it went.

pub(crate) mod args;
mod build;
mod cache;
mod compare;
mod demo;
mod error;
mod files;
mod info;
mod parse;
mod path_file;
mod progress;
mod render;
mod synth;
mod usage;
mod verify;

use args::{Cli, Command};
use clap::Parser;
use error::{CliError, Outcome};
use std::process::ExitCode;

/// Runs the program.
pub(crate) fn run() -> ExitCode {
    let json_asked_for = std::env::args_os().any(|argument| argument == "--json");
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let failed = error.use_stderr();
            if failed && json_asked_for {
                let what = error.to_string().lines().next().unwrap_or_default().replace("error: ", "");
                println!("{}", CliError::new(what).to_json());
            }
            // Help and version go to standard output, what was wrong to standard error. A closed pipe is not our problem.
            let _ = error.print();
            return ExitCode::from(if failed { 2 } else { 0 });
        }
    };
    let console = progress::Console::new(cli.json, cli.verbose);
    let outcome = match &cli.command {
        Command::Build(args) => build::run(args, &console),
        Command::Render(args) => render::run(args, &console),
        Command::Info(args) => info::run(args, &console),
        Command::Verify(args) => verify::run(args, &console),
        Command::Compare(args) => compare::run(args, &console),
        Command::Synth(args) => synth::run(args, &console),
        Command::Demo(args) => demo::run(args, &console),
    };
    match outcome {
        Ok(Outcome { json, text, good }) => {
            if cli.json {
                println!("{json}");
            } else {
                print!("{text}");
            }
            ExitCode::from(if good { 0 } else { 1 })
        }
        Err(error) => {
            if cli.json {
                println!("{}", error.to_json());
            }
            eprintln!("{error}");
            ExitCode::from(if error.is_usage { 2 } else { 1 })
        }
    }
}
