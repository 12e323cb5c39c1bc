//! `lightoctree completions SHELL`.

use clap::CommandFactory;
use clap_complete::Shell;

use crate::args::Cli;

/// Options of `completions`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  lightoctree completions bash > ~/.local/share/bash-completion/completions/lightoctree"
)]
pub struct Args {
    /// Which shell
    shell: Shell,
}

/// Prints the script.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "lightoctree", &mut script);
    crate::report::print(String::from_utf8(script)?.trim_end());
    Ok(())
}
