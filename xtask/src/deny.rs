//! The rules of `deny.toml` as far as they can be checked without a network and without `cargo deny`: licences,
//! wildcards, sources.
//!
//! Licences cover what cargo compiles on this machine by default, with build scripts and tests. Dependencies of other
//! systems and of features that are off are left to `cargo deny check`, since cargo may not have downloaded them; so
//! are security advisories.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::Context;
use serde::Deserialize;
use spdx::{Expression, ParseMode};

use crate::workspace::{self, Package, Workspace};

const RULES: &str = "deny.toml";
const LOCK: &str = "Cargo.lock";

/// Packages with a licence that is not allowed, versions left open, and packages from git.
pub fn problems(workspace: &Workspace) -> anyhow::Result<Vec<String>> {
    let read =
        |file: &str| std::fs::read_to_string(workspace.root.join(file)).with_context(|| format!("cannot read {file}"));
    let rules: Rules = toml::from_str(&read(RULES)?).with_context(|| RULES.to_owned())?;
    let lock: Lock = toml::from_str(&read(LOCK)?).with_context(|| LOCK.to_owned())?;
    let args = ["tree", "--workspace", "--offline", "--locked", "--edges", "normal,build,dev", "--prefix", "none"];
    let tree = workspace::cargo(&workspace.root, &[&args[..], &["--format", "{p}|{l}|"]].concat())?;
    let mut problems = against_licences(&licences(&tree), &rules.licenses);
    if rules.bans.wildcards == Level::Deny {
        problems.extend(wildcards(&workspace.packages));
    }
    problems.extend(against_sources(&lock, &rules.sources));
    Ok(problems)
}

#[derive(Deserialize)]
struct Rules {
    licenses: Licences,
    bans: Bans,
    sources: Sources,
}

#[derive(Deserialize)]
struct Licences {
    allow: BTreeSet<String>,
    #[serde(default)]
    exceptions: Vec<Exception>,
}

/// Licences that one crate alone may have.
#[derive(Deserialize)]
struct Exception {
    #[serde(rename = "crate")]
    name: String,
    allow: BTreeSet<String>,
}

#[derive(Deserialize)]
struct Bans {
    wildcards: Level,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
struct Sources {
    unknown_registry: Level,
    unknown_git: Level,
}

#[derive(Clone, Copy, Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum Level {
    Allow,
    Warn,
    Deny,
}

#[derive(Deserialize)]
struct Lock {
    package: Vec<Locked>,
}

#[derive(Deserialize)]
struct Locked {
    name: String,
    version: String,
    /// Absent for members of the workspace.
    source: Option<String>,
}

/// Package → licence, from lines `NAME VERSION (WHERE)|LICENCE| (*)`.
fn licences(tree: &str) -> BTreeMap<&str, &str> {
    let cells = tree.lines().filter_map(|line| line.split_once('|'));
    cells.map(|(package, rest)| (package, rest.split('|').next().unwrap_or_default())).collect()
}

fn against_licences(packages: &BTreeMap<&str, &str>, rules: &Licences) -> Vec<String> {
    let mut problems = Vec::new();
    for (&package, &licence) in packages {
        let name = package.split(' ').next().unwrap_or_default();
        let exceptions = || rules.exceptions.iter().filter(|exception| exception.name == name);
        let allowed = |licence: &str| {
            rules.allow.contains(licence) || exceptions().any(|exception| exception.allow.contains(licence))
        };
        match Expression::parse_mode(licence, ParseMode::LAX) {
            Ok(expression) if expression.evaluate(|required| allowed(&required.to_string())) => (),
            Ok(_) => problems.push(format!("{package}: {RULES} does not allow the licence {licence}")),
            Err(_) if licence.is_empty() => problems.push(format!("{package} declares no licence")),
            Err(error) => {
                problems.push(format!("{package}: {licence} is not a licence expression: {}", error.reason));
            }
        }
    }
    problems
}

/// Dependencies with the version `*`. Members of the workspace are exempt: `allow-wildcard-paths`.
fn wildcards(packages: &[Package]) -> Vec<String> {
    let of = |package: &Package| {
        let names = package.wildcards.iter();
        names.map(|name| format!("{} accepts any version of {name}", package.name)).collect::<Vec<_>>()
    };
    packages.iter().flat_map(of).collect()
}

/// Packages from git or from a registry other than crates.io, where the rules deny them.
fn against_sources(lock: &Lock, rules: &Sources) -> Vec<String> {
    let crates_io = ["registry+https://github.com/rust-lang/crates.io-index", "sparse+https://index.crates.io/"];
    let is_denied = |source: &str| {
        if source.starts_with("git+") {
            rules.unknown_git == Level::Deny
        } else {
            rules.unknown_registry == Level::Deny && !crates_io.contains(&source)
        }
    };
    let packages = lock.package.iter().filter_map(|package| Some((package, package.source.as_deref()?)));
    let denied = packages.filter(|(_, source)| is_denied(source));
    denied.map(|(Locked { name, version, .. }, source)| format!("{name} {version} comes from {source}")).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const TREE: &str = "one v1.0.0|MIT OR Apache-2.0|\none v1.0.0|MIT OR Apache-2.0| (*)\n\nold v0.1.0|GPL-3.0/MIT|\n\
        parts v2.0.0 (/somewhere)|Zlib AND (MIT OR GPL-3.0-only)|\nfull v2.0.0|Zlib AND GPL-3.0-only|\n\
        llvm v3.0.0|Apache-2.0 WITH LLVM-exception|\nweak v1.0.0|MPL-2.0|\nother v1.0.0|MPL-2.0|\nnone v1.0.0||\nodd v1.0.0|mine|\n";

    #[test]
    fn a_package_is_allowed_by_the_list_or_by_its_exception() {
        let rules = "allow = [\"MIT\", \"Zlib\"]\nexceptions = [{ crate = \"weak\", allow = [\"MPL-2.0\"] }]";
        let rules: Licences = toml::from_str(rules).unwrap();
        let packages = licences(TREE);
        assert_eq!(packages.len(), 9);
        let problems = against_licences(&packages, &rules);
        let of = |name: &str| problems.iter().find(|problem| problem.starts_with(name)).map(String::as_str);
        assert_eq!([of("one"), of("old"), of("parts"), of("weak")], [None; 4]);
        assert_eq!(of("full").unwrap(), "full v2.0.0: deny.toml does not allow the licence Zlib AND GPL-3.0-only");
        assert!(of("llvm").is_some(), "an exception to a licence is another licence");
        assert!(of("other").is_some(), "an exception holds for its crate alone");
        assert_eq!(of("none"), Some("none v1.0.0 declares no licence"));
        assert!(of("odd").unwrap().contains("is not a licence expression"), "{problems:?}");
        assert_eq!(problems.len(), 5);
    }

    #[test]
    fn versions_are_not_left_open() {
        let wild = Package { name: "a".to_owned(), wildcards: ["serde".to_owned()].into(), ..Package::default() };
        assert_eq!(wildcards(&[wild, Package::default()]), ["a accepts any version of serde"]);
    }

    #[test]
    fn packages_come_from_registries_that_are_allowed() {
        let lock = "version = 4\n[[package]]\nname = \"ours\"\nversion = \"0.1.0\"\n\
            [[package]]\nname = \"usual\"\nversion = \"1.0.0\"\nsource = \"registry+https://github.com/rust-lang/crates.io-index\"\n\
            [[package]]\nname = \"mirrored\"\nversion = \"1.0.0\"\nsource = \"registry+https://mirror.example/index\"\n\
            [[package]]\nname = \"git\"\nversion = \"1.0.0\"\nsource = \"git+https://example.org/git#0a\"\n";
        let lock: Lock = toml::from_str(lock).unwrap();
        let git = "git 1.0.0 comes from git+https://example.org/git#0a";
        let rules = Sources { unknown_registry: Level::Allow, unknown_git: Level::Deny };
        assert_eq!(against_sources(&lock, &rules), [git]);
        let rules = Sources { unknown_registry: Level::Deny, ..rules };
        assert_eq!(
            against_sources(&lock, &rules),
            ["mirrored 1.0.0 comes from registry+https://mirror.example/index", git]
        );
        let rules = Sources { unknown_registry: Level::Allow, unknown_git: Level::Warn };
        assert_eq!(against_sources(&lock, &rules), [""; 0]);
    }
}
