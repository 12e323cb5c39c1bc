//! Links, files and cargo targets that documents and comments name.
//!
//! Commands of the programs are checked in `apps/lightoctree-lab/tests`, where their options are defined.

use std::collections::BTreeMap;
use std::path::Path;

use crate::workspace::{Package, Workspace};

/// Broken links in documents; files and cargo targets that documents or comments name but that do not exist.
pub fn problems(workspace: &Workspace) -> anyhow::Result<Vec<String>> {
    let texts = workspace.texts()?;
    let documents: BTreeMap<_, _> = texts.iter().filter(|(path, _)| path.ends_with(".md")).collect();
    let mut problems = Vec::new();
    for (&path, text) in &documents {
        problems.extend(dead_links(path, text, &workspace.root, &documents));
    }
    for (path, text) in &texts {
        let is_code = path.ends_with(".rs");
        // A workspace of its own.
        let is_fuzz = path.starts_with("fuzz/");
        for (index, line) in text.lines().enumerate().filter(|(_, line)| !is_code || is_prose(line)) {
            let mut missing = missing_files(line, &workspace.root);
            if !is_fuzz {
                missing.extend(missing_targets(line, &workspace.packages));
            }
            problems.extend(missing.iter().map(|missing| format!("{path}:{}: there is no {missing}", index + 1)));
        }
    }
    Ok(problems)
}

/// Whether a line of code is a comment or the reason of an ignored test.
fn is_prose(line: &str) -> bool {
    ["//", "#[ignore"].iter().any(|start| line.trim_start().starts_with(start))
}

/// Relative links and images of a document whose file or heading does not exist.
fn dead_links(path: &str, text: &str, root: &Path, documents: &BTreeMap<&String, &String>) -> Vec<String> {
    let folder = path.rsplit_once('/').map_or("", |(folder, _)| folder);
    let mut problems = Vec::new();
    for (number, line) in prose(text) {
        for link in links(line).filter(|link| !link.contains("://") && !link.starts_with("mailto:")) {
            let (file, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { Some(path.to_owned()) } else { normal(&format!("{folder}/{file}")) };
            let Some(target) = target.filter(|target| root.join(target).exists()) else {
                problems.push(format!("{path}:{number}: there is no {link}"));
                continue;
            };
            let is_dead =
                |text: &String| !prose(text).any(|(_, line)| anchor(line).is_some_and(|anchor| anchor == heading));
            if !heading.is_empty() && documents.get(&target).is_none_or(|text| is_dead(text)) {
                problems.push(format!("{path}:{number}: {target} has no heading #{heading}"));
            }
        }
    }
    problems
}

/// Lines outside of code blocks, with their numbers.
fn prose(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut is_code = false;
    let lines = text.lines().enumerate().filter(move |(_, line)| {
        let is_fence = line.trim_start().starts_with("```");
        is_code ^= is_fence;
        !is_code && !is_fence
    });
    lines.map(|(index, line)| (index + 1, line))
}

/// Targets of `[text](target)`, `[text]: target` and `src="target"`.
fn links(line: &str) -> impl Iterator<Item = &str> {
    [("](", ')'), ("]: ", ' '), ("src=\"", '"')].into_iter().flat_map(move |(start, end)| {
        line.split(start).skip(1).map(move |rest| rest.split([end, ' ']).next().unwrap_or_default())
    })
}

/// A path without `.` and `..`; `None` if it leads out of the checkout.
fn normal(path: &str) -> Option<String> {
    let mut parts = Vec::new();
    for part in path.split('/') {
        match part {
            "" | "." => (),
            ".." => drop(parts.pop()?),
            part => parts.push(part),
        }
    }
    Some(parts.join("/"))
}

/// GitHub's anchor of a heading.
fn anchor(line: &str) -> Option<String> {
    let text = line.strip_prefix('#')?.trim_start_matches('#').strip_prefix(' ')?.trim().to_lowercase();
    let kept = text.chars().filter(|&c| c.is_alphanumeric() || "-_ ".contains(c));
    Some(kept.map(|c| if c == ' ' { '-' } else { c }).collect())
}

/// Top-level folders whose files are named by their whole path.
const FOLDERS: [&str; 6] = ["crates/", "apps/", "docs/", "configs/", "fuzz/", "xtask/"];

/// Files of the checkout that a line names but that do not exist.
fn missing_files(line: &str, root: &Path) -> Vec<String> {
    let words = line.split(|c: char| !(c.is_alphanumeric() || "/._-*…{".contains(c)));
    let files = words.filter(|word| FOLDERS.iter().any(|folder| word.starts_with(folder)));
    // Patterns and placeholders in capitals.
    let is_any =
        |part: &str| part.contains(['*', '…', '{']) || part.len() > 1 && part.chars().all(|c| c.is_ascii_uppercase());
    let files = files.map(|word| word.trim_end_matches(['.', '/', '-'])).filter(|file| !file.split('/').any(is_any));
    files.filter(|file| !root.join(file).exists()).map(str::to_owned).collect()
}

/// Packages, tests, benches and examples of cargo commands in a line that do not exist.
fn missing_targets(line: &str, packages: &[Package]) -> Vec<String> {
    let commands = line.split("cargo ").skip(1);
    commands
        .flat_map(|rest| {
            missing_in_command(rest.split(['`', '"', '#', ')', '|', '&', ',', ';']).next().unwrap_or(rest), packages)
        })
        .collect()
}

fn missing_in_command(command: &str, packages: &[Package]) -> Vec<String> {
    let words: Vec<_> = command.split_whitespace().take_while(|&word| word != "--").collect();
    let options = || words.windows(2).map(|pair| (pair[0], pair[1]));
    let (mut named, mut missing) = (Vec::new(), Vec::new());
    for (_, name) in options().filter(|(option, _)| ["-p", "--package"].contains(option)) {
        match packages.iter().find(|package| package.name == name) {
            Some(package) => named.push(package),
            None => missing.push(format!("package {name}")),
        }
    }
    if named.is_empty() {
        named.extend(packages);
    }
    for (option, name) in options() {
        let kind = option.trim_start_matches('-');
        if ["--test", "--bench", "--example"].contains(&option) && !named.iter().any(|package| package.has(kind, name))
        {
            missing.push(format!("{kind} {name}"));
        }
    }
    missing
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::workspace::Target;

    #[test]
    fn links_lead_to_files_and_headings() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let other = "# Where things go\n\n## `code`: a *look*\n".to_owned();
        let name = "CONTRIBUTING.md".to_owned();
        let documents = BTreeMap::from([(&name, &other)]);
        let problems = |text: &str| dead_links("docs/here.md", text, folder, &documents);
        assert_eq!(problems("[a](../README.md), [b](https://nowhere/x.md), ![c](images/rooms.jpg \"title\")"), [""; 0]);
        assert_eq!(problems("[a](../CONTRIBUTING.md#where-things-go) [b](../CONTRIBUTING.md#code-a-look)"), [""; 0]);
        assert_eq!(problems("\n[a](README.md)"), ["docs/here.md:2: there is no README.md"]);
        assert_eq!(problems("<img src=\"images/none.jpg\">"), ["docs/here.md:1: there is no images/none.jpg"]);
        assert_eq!(problems("[a]: ../none.md"), ["docs/here.md:1: there is no ../none.md"]);
        assert_eq!(problems("[a](../../main/README.md)").len(), 1, "outside of the checkout");
        assert_eq!(problems("```md\n[a](none.md)\n```\n[b](none.md)").len(), 1, "not in code");
        let dead = "docs/here.md:1: CONTRIBUTING.md has no heading #where";
        assert_eq!(problems("[a](../CONTRIBUTING.md#where)"), [dead]);
    }

    #[test]
    fn named_files_exist() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let missing = |line: &str| missing_files(line, root);
        assert_eq!(
            missing("`xtask/src/workspace.rs`, docs/images/rooms.jpg. crates/base/, fuzz/corpus/TARGET, crates/*/lo_*"),
            [""; 0]
        );
        assert_eq!(missing("see `crates/base/lo_none/src`."), ["crates/base/lo_none/src"]);
        assert_eq!(missing("--config configs/none.toml -o rooms"), ["configs/none.toml"]);
    }

    #[test]
    fn named_targets_exist() {
        let target =
            |name: &str, kind: &str| Target { name: name.to_owned(), kind: vec![kind.to_owned()], ..Target::default() };
        let package = |name: &str, targets| Package { name: name.to_owned(), targets, ..Package::default() };
        let packages = [package("one", vec![target("it", "test"), target("speed", "bench")]), package("two", vec![])];
        let missing = |line: &str| missing_targets(line, &packages);
        assert_eq!(missing("`cargo test -p one --test it name -- --test none`, `cargo bench --bench speed`"), [""; 0]);
        assert_eq!(missing("(`cargo test -p two --test it`)"), ["test it"]);
        assert_eq!(missing("cargo bench --bench it"), ["bench it"]);
        assert_eq!(missing("a && cargo test -p three"), ["package three"]);
    }
}
