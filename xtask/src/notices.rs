//! Licence texts of the third-party packages in a program, which its users must receive with it.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, ensure};
use serde::Deserialize;

use crate::workspace::{self, Workspace};

/// Beginnings of the names of files with licence texts and notices, in capitals.
const NAMES: [&str; 5] = ["LICENSE", "LICENCE", "COPYING", "NOTICE", "UNLICENSE"];

/// Prints the licence texts of all packages of registries that `package` is built from on this system. A text that
/// several packages share is printed once, below all their names.
pub fn print(workspace: &Workspace, package: &str) -> anyhow::Result<()> {
    let args = ["tree", "--package", package, "--offline", "--locked", "--edges", "normal", "--prefix", "none"];
    let tree = workspace::cargo(&workspace.root, &[&args[..], &["--format", "{p}"]].concat())?;
    let metadata = Metadata::read(workspace)?;
    let used = packages(&tree);
    let third_party = |package: &&Package| package.source.is_some() && used.contains(&package.title());
    let found: Vec<&Package> = metadata.packages.iter().filter(third_party).collect();
    ensure!(!found.is_empty(), "{package} has no third-party packages");
    print!("{}", text(package, &found)?);
    Ok(())
}

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

impl Metadata {
    /// Reads the packages that this system needs; cargo may not have downloaded others.
    fn read(workspace: &Workspace) -> anyhow::Result<Self> {
        let version = Command::new("rustc").arg("-vV").output().context("cannot run rustc")?;
        let version = String::from_utf8_lossy(&version.stdout).into_owned();
        let host = version.lines().find_map(|line| line.strip_prefix("host: ")).context("rustc -vV names no host")?;
        let args = ["metadata", "--offline", "--locked", "--format-version", "1", "--filter-platform", host];
        serde_json::from_str(&workspace::cargo(&workspace.root, &args)?).context("cargo metadata")
    }
}

#[derive(Deserialize)]
struct Package {
    name: String,
    version: String,
    license: Option<String>,
    /// The registry; `None` for packages of the workspace.
    source: Option<String>,
    manifest_path: PathBuf,
}

impl Package {
    /// Name and version as `cargo tree` prints them.
    fn title(&self) -> String {
        format!("{} v{}", self.name, self.version)
    }
}

/// Returns name and version of each line of `cargo tree --prefix none --format {p}`.
fn packages(tree: &str) -> BTreeSet<String> {
    tree.lines().map(|line| line.split(' ').take(2).collect::<Vec<_>>().join(" ")).collect()
}

fn text(program: &str, packages: &[&Package]) -> anyhow::Result<String> {
    let mut owners: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut without = Vec::new();
    for package in packages {
        let title = format!("{} ({})", package.title(), package.license.as_deref().unwrap_or("see its text"));
        let folder = package.manifest_path.parent().context("a manifest is in a folder")?;
        let texts = texts(folder)?;
        if texts.is_empty() {
            without.push(title.clone());
        }
        for text in texts {
            owners.entry(text).or_default().push(title.clone());
        }
    }
    let mut out = format!("Licences of the third-party packages in {program}, {} in all.\n", packages.len());
    let mut sections: Vec<(Vec<String>, String)> = owners.into_iter().map(|(text, owners)| (owners, text)).collect();
    sections.sort();
    for (owners, text) in sections {
        let rule = "=".repeat(80);
        let _ = write!(out, "\n{rule}\n{}\n{rule}\n\n{text}\n", owners.join("\n"));
    }
    if !without.is_empty() {
        let _ =
            write!(out, "\nPackages without a text of their own, under the licences named:\n{}\n", without.join("\n"));
    }
    Ok(out)
}

/// Returns the licence texts in a package's folder, without differences in line ends and outer white space.
fn texts(folder: &Path) -> anyhow::Result<Vec<String>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_uppercase();
        if path.is_file() && NAMES.iter().any(|start| name.starts_with(start)) {
            files.push(path);
        }
    }
    files.sort();
    let read = |path: PathBuf| -> anyhow::Result<String> {
        let bytes = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let lines = String::from_utf8_lossy(&bytes).lines().map(str::trim_end).collect::<Vec<_>>().join("\n");
        Ok(lines.trim_matches('\n').to_owned())
    };
    files.into_iter().map(read).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn versions_come_from_the_tree() {
        let tree = "lightoctree-cli v0.1.0 (/checkout/apps)\nburn v0.22.0\nclap_derive v4.6.7 (proc-macro)\nburn v0.22.0 (*)\n";
        let expected = ["burn v0.22.0", "clap_derive v4.6.7", "lightoctree-cli v0.1.0"];
        assert_eq!(packages(tree), expected.map(str::to_owned).into());
    }

    #[test]
    fn every_package_of_the_program_has_a_text_or_is_named() {
        let workspace = Workspace::read().unwrap();
        let metadata = Metadata::read(&workspace).unwrap();
        let of = |name: &str| metadata.packages.iter().find(|package| package.name == name).unwrap();
        let chosen = [of("burn"), of("clap"), of("axum")];
        let text = text("a program", &chosen).unwrap();
        for package in chosen {
            assert!(text.contains(&package.title()), "{text}");
        }
        assert!(text.contains("Permission is hereby granted") && text.contains("Apache License"), "{text}");
    }
}
