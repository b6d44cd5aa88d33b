//! The command line: what design calls a contract, because other tools parse it.
//!
//! Start at [`cli::args::Cli`]; one file for each command. Exit status: 0 done, 1 failed, 2 wrong usage.
#![deny(unsafe_code)]

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    quieten_drivers();
    cli::run()
}

/// Without this variable Wayland's client library, which Mesa's Vulkan drivers load even when nobody wants a window, prints an
/// error of its own on standard error. Any absolute path will do.
#[allow(unsafe_code, reason = "setting a variable is safe only while there is one thread")]
fn quieten_drivers() {
    const VARIABLE: &str = "XDG_RUNTIME_DIR";
    if cfg!(target_os = "linux") && std::env::var_os(VARIABLE).is_none() {
        // SAFETY: this is the first thing the program does. No other thread exists that could read the environment.
        unsafe { std::env::set_var(VARIABLE, std::env::temp_dir()) };
    }
}
