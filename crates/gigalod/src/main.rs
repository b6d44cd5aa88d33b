//! The command line: what design calls a contract, because other tools parse it.
//!
//! Start at [`cli::args::Cli`]; one file for each command. Exit status: 0 done, 1 failed, 2 wrong usage.
#![forbid(unsafe_code)]

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::run()
}
