//! `lightoctree man DIR`: writes manual pages.

use std::path::PathBuf;

use anyhow::Context;

/// Options of `man`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  lightoctree man ~/.local/share/man/man1")]
pub struct Args {
    /// Folder to write to; it is created if it does not exist
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

/// Writes a page for the program and one for each of its commands.
pub fn run(args: &Args, program: clap::Command) -> anyhow::Result<()> {
    std::fs::create_dir_all(&args.folder)
        .and_then(|()| clap_mangen::generate_to(program, &args.folder))
        .with_context(|| format!("cannot write manual pages to {}", args.folder.display()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn every_command_has_a_page() {
        let folder = tempfile::tempdir().unwrap();
        let args = Args { folder: folder.path().join("share/man1") };
        run(&args, Cli::command()).unwrap();
        let page = |name: &str| std::fs::read_to_string(args.folder.join(format!("{name}.1"))).unwrap();
        for command in Cli::command().get_subcommands() {
            let name = format!("lightoctree-{}", command.get_name());
            assert!(page(&name).contains(&format!(".TH {name} 1")), "{name}");
            assert!(page("lightoctree").contains(&name.replace('-', "\\-")), "{name}");
        }
        assert!(page("lightoctree-lights-add-sun").contains("\\-\\-shadow"));
    }
}
