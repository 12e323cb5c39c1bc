//! Tests that take minutes or need what a machine may lack: those with `#[ignore = "reason"]`, run by name.

use std::process::Command;

use anyhow::{Context, ensure};

use crate::workspace::Workspace;

/// Lists all of them, or runs those whose names contain `name`. Returns whether all passed.
pub fn run(workspace: &Workspace, name: Option<&str>) -> anyhow::Result<bool> {
    let tests = tests(workspace)?;
    let Some(name) = name else {
        tests.iter().for_each(|test| println!("{:16} {}\n{:16} {}", test.package, test.name, "", test.reason));
        println!("\ncargo xtask long NAME runs those whose names contain NAME");
        return Ok(true);
    };
    let chosen: Vec<_> = tests.iter().filter(|test| test.name.contains(name)).collect();
    ensure!(!chosen.is_empty(), "no ignored test has {name} in its name; cargo xtask long lists them");
    let mut passed = true;
    for test in chosen {
        let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        cargo.current_dir(&workspace.root).args(["test", "--release", "--lib", "--tests", "-p", &test.package]);
        let status = cargo.args([&test.name, "--", "--ignored", "--nocapture"]).status().context("cannot run cargo")?;
        passed &= status.success();
    }
    Ok(passed)
}

#[derive(Debug, PartialEq)]
struct Test {
    package: String,
    name: String,
    reason: String,
}

fn tests(workspace: &Workspace) -> anyhow::Result<Vec<Test>> {
    let mut tests = Vec::new();
    for (path, text) in workspace.texts()? {
        let package = workspace.packages.iter().find(|package| path.starts_with(&format!("{}/", package.folder)));
        if let Some(package) = package.filter(|_| path.ends_with(".rs")) {
            tests.extend(in_source(&package.name, &text));
        }
    }
    Ok(tests)
}

fn in_source(package: &str, text: &str) -> Vec<Test> {
    let mut tests = Vec::new();
    let mut reason = None;
    for line in text.lines().map(str::trim) {
        if let Some(rest) = line.strip_prefix("#[ignore = \"") {
            reason = rest.strip_suffix("\"]");
        } else if let Some((_, rest)) = line.split_once("fn ")
            && let Some(reason) = reason.take()
        {
            let name = rest.split('(').next().unwrap_or(rest);
            tests.push(Test { package: package.to_owned(), name: name.to_owned(), reason: reason.to_owned() });
        }
    }
    tests
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ignored_tests_are_found_with_their_reasons() {
        let source =
            "#[test]\nfn quick() {}\n    #[test]\n    #[ignore = \"an hour\"]\n    fn slow() {\n    }\nfn after() {}\n";
        let expected = Test { package: "one".to_owned(), name: "slow".to_owned(), reason: "an hour".to_owned() };
        assert_eq!(in_source("one", source), [expected]);
    }
}
