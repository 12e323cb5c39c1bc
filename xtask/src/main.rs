//! Checks of the workspace that no compiler makes, and its long tests.
//!
//! `cargo xtask` runs every enforced check, and so does `cargo test -p xtask`. `cargo xtask NAME` runs one check,
//! enforced or not. `cargo xtask long [NAME]` lists or runs the ignored tests. `cargo xtask notices PACKAGE` prints the
//! licences of the third-party packages in a program.

mod deny;
mod dependencies;
mod doc_tests;
mod documents;
mod features;
mod long;
mod notices;
mod prose;
mod publish;
mod rings;
mod width;
mod words;
mod workspace;

use std::process::ExitCode;

use workspace::Workspace;

struct Check {
    name: &'static str,
    problems: fn(&Workspace) -> anyhow::Result<Vec<String>>,
    /// Whether `cargo xtask` without a name and the test suite run it.
    is_enforced: bool,
}

const CHECKS: [Check; 9] = [
    Check { name: "dependencies", problems: dependencies::problems, is_enforced: true },
    Check { name: "doc-tests", problems: doc_tests::problems, is_enforced: true },
    Check { name: "documents", problems: documents::problems, is_enforced: true },
    Check { name: "deny", problems: deny::problems, is_enforced: true },
    Check { name: "features", problems: features::problems, is_enforced: true },
    Check { name: "publish", problems: publish::problems, is_enforced: true },
    Check { name: "words", problems: words::problems, is_enforced: true },
    Check { name: "width", problems: width::problems, is_enforced: true },
    Check { name: "rings", problems: rings::problems, is_enforced: true },
];

fn main() -> anyhow::Result<ExitCode> {
    let workspace = Workspace::read()?;
    let args: Vec<_> = std::env::args().skip(1).collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => run(&workspace, CHECKS.iter().filter(|check| check.is_enforced)),
        ["long"] => long::run(&workspace, None).map(code),
        ["notices", package] => notices::print(&workspace, package).map(|()| ExitCode::SUCCESS),
        ["long", name] => long::run(&workspace, Some(name)).map(code),
        [name] if CHECKS.iter().any(|check| check.name == name) => {
            run(&workspace, CHECKS.iter().filter(|check| check.name == name))
        }
        _ => {
            let names: Vec<_> = CHECKS.iter().map(|check| check.name).collect();
            anyhow::bail!(
                "usage: cargo xtask [{}] | cargo xtask long [NAME] | cargo xtask notices PACKAGE",
                names.join("|")
            )
        }
    }
}

fn code(passed: bool) -> ExitCode {
    if passed { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn run<'a>(workspace: &Workspace, checks: impl Iterator<Item = &'a Check>) -> anyhow::Result<ExitCode> {
    let mut count = 0;
    for check in checks {
        for problem in (check.problems)(workspace)? {
            eprintln!("{}: {problem}", check.name);
            count += 1;
        }
    }
    if count > 0 {
        eprintln!("problems: {count}");
    }
    Ok(code(count == 0))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn enforced_checks_pass() {
        let workspace = Workspace::read().unwrap();
        let problems: Vec<_> = CHECKS
            .iter()
            .filter(|check| check.is_enforced)
            .flat_map(|check| {
                let problems = (check.problems)(&workspace).unwrap();
                problems.into_iter().map(|problem| format!("{}: {problem}", check.name))
            })
            .collect();
        assert!(problems.is_empty(), "\n{}\n", problems.join("\n"));
    }
}
