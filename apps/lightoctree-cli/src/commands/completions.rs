//! `lightoctree completions SHELL`: prints a shell completion script.

use clap_complete::Shell;

/// Options of `completions`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  lightoctree completions bash > ~/.local/share/bash-completion/completions/lightoctree"
)]
pub struct Args {
    /// Shell that runs the script
    shell: Shell,
}

/// Prints the script for all commands of a program.
pub fn run(args: &Args, command: &mut clap::Command) -> anyhow::Result<()> {
    let mut script = Vec::new();
    let name = command.get_name().to_owned();
    clap_complete::generate(args.shell, command, name, &mut script);
    crate::report::print(String::from_utf8(script)?.trim_end());
    Ok(())
}
