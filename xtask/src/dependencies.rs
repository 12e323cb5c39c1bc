//! Dependencies between crates: the manifests against the table of `ARCHITECTURE.md` and against the layers.
//!
//! The table's head begins with `| crate |` and has four columns: the package's folder, its job, its dependencies, and
//! those of its tests. Folders and names are in backticks.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, ensure};

use crate::workspace::{Package, Workspace};

/// Folders of `crates`, lowest first.
const LAYERS: [&str; 5] = ["base", "light", "rooms", "learn", "view"];
/// The facade belongs to the layer `learn`: `lo_nets` is below it, training and evaluation are above.
const FACADE: &str = "crates/lightoctree";
const FACADE_LAYER: usize = 3;
const DOCUMENT: &str = "ARCHITECTURE.md";

/// Dependencies that only the manifests or only the table have, dependencies on a higher layer, and packages with two
/// names.
pub fn problems(workspace: &Workspace) -> anyhow::Result<Vec<String>> {
    let text =
        std::fs::read_to_string(workspace.root.join(DOCUMENT)).with_context(|| format!("cannot read {DOCUMENT}"))?;
    let table = table(&text)?;
    let mut problems = against_table(&workspace.packages, &table);
    problems.extend(against_layers(&workspace.packages));
    problems.extend(against_names(&workspace.packages));
    Ok(problems)
}

/// A row of the table.
#[derive(Debug, PartialEq)]
struct Row {
    dependencies: BTreeSet<String>,
    dev_dependencies: BTreeSet<String>,
}

fn table(text: &str) -> anyhow::Result<BTreeMap<String, Row>> {
    let rows = text.lines().skip_while(|line| !line.starts_with("| crate |")).skip(2);
    let mut table = BTreeMap::new();
    for line in rows.take_while(|line| line.starts_with('|')) {
        let cells: Vec<_> = line.trim().trim_matches('|').split('|').collect();
        let [folder, _, dependencies, dev_dependencies] = cells[..] else {
            anyhow::bail!("{DOCUMENT}: this row does not have four cells: {line}");
        };
        let folder = names(folder).into_iter().next();
        let folder = folder.with_context(|| format!("{DOCUMENT}: this row names no folder: {line}"))?;
        let row = Row { dependencies: names(dependencies), dev_dependencies: names(dev_dependencies) };
        ensure!(table.insert(folder, row).is_none(), "{DOCUMENT}: this row is the crate's second: {line}");
    }
    ensure!(!table.is_empty(), "{DOCUMENT} has no table whose head begins with `| crate |`");
    Ok(table)
}

/// Words in backticks.
fn names(cell: &str) -> BTreeSet<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

fn against_table(packages: &[Package], table: &BTreeMap<String, Row>) -> Vec<String> {
    let mut problems = Vec::new();
    for package in packages {
        let Some(row) = table.get(&package.folder) else {
            problems.push(format!("{DOCUMENT} has no row for `{}`", package.folder));
            continue;
        };
        let name = &package.name;
        for (depends, manifest, table) in [
            ("depends on", &package.dependencies, &row.dependencies),
            ("depends in tests on", &package.dev_dependencies, &row.dev_dependencies),
        ] {
            let missing = manifest.difference(table);
            problems.extend(missing.map(|other| format!("{name} {depends} `{other}`, which {DOCUMENT} does not list")));
            let stale = table.difference(manifest);
            problems
                .extend(stale.map(|other| format!("{DOCUMENT} lists that {name} {depends} `{other}`; it does not")));
        }
    }
    let folders: BTreeSet<_> = packages.iter().map(|package| &package.folder).collect();
    let rows = table.keys().filter(|row| !folders.contains(row));
    problems.extend(rows.map(|row| format!("{DOCUMENT} has a row for `{row}`, which does not exist")));
    problems
}

/// Tests may depend on higher layers where the table lists it.
fn against_layers(packages: &[Package]) -> Vec<String> {
    let layers: BTreeMap<_, _> = packages.iter().map(|package| (&package.name, layer(&package.folder))).collect();
    let mut problems = Vec::new();
    for package in packages {
        let from = layer(&package.folder);
        for other in package.dependencies.iter().filter(|&other| layers.get(other).is_some_and(|&to| to > from)) {
            problems.push(format!("{} (`{}`) depends on {other} of a higher layer", package.name, package.folder));
        }
    }
    problems
}

fn layer(folder: &str) -> usize {
    let name = folder.strip_prefix("crates/").and_then(|rest| rest.split('/').next());
    match LAYERS.iter().position(|&layer| Some(layer) == name) {
        Some(layer) => layer,
        None if folder == FACADE => FACADE_LAYER,
        None => LAYERS.len(),
    }
}

/// Folder, package and library have one name, and no manifest renames them.
fn against_names(packages: &[Package]) -> Vec<String> {
    let mut problems = Vec::new();
    for package in packages {
        let folder = package.folder.rsplit('/').next().unwrap_or_default();
        let library = package.targets.iter().find(|target| target.kind.iter().any(|kind| kind == "lib"));
        let named = [Some(folder), library.map(|library| library.name.as_str())];
        let differs = |other: &&str| other.replace('-', "_") != package.name.replace('-', "_");
        for other in named.into_iter().flatten().filter(differs) {
            problems.push(format!("package {} has a folder or library named {other}", package.name));
        }
        problems.extend(package.renamed.iter().map(|other| format!("{} renames a package to {other}", package.name)));
    }
    problems
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const TABLE: &str = "# Crates\n\n| crate | job | depends on | in tests |\n| --- | --- | --- | --- |\n\
        | `crates/base/a` | one | – | – |\n| `crates/light/b` | two | `a` | `c` |\n| `crates/rooms/c` | three | `a`, `b` | – |\n\ntext\n";

    fn package(folder: &str, dependencies: &[&str], dev_dependencies: &[&str]) -> Package {
        let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        Package {
            name: folder.rsplit('/').next().unwrap().to_owned(),
            folder: folder.to_owned(),
            dependencies: owned(dependencies),
            dev_dependencies: owned(dev_dependencies),
            ..Package::default()
        }
    }

    fn as_in_table() -> Vec<Package> {
        vec![
            package("crates/base/a", &[], &[]),
            package("crates/light/b", &["a"], &["c"]),
            package("crates/rooms/c", &["a", "b"], &[]),
        ]
    }

    #[test]
    fn listed_dependencies_are_no_problem() {
        let (packages, table) = (as_in_table(), table(TABLE).unwrap());
        assert_eq!(table.len(), 3);
        assert_eq!(against_table(&packages, &table), [""; 0]);
        assert_eq!(against_layers(&packages), [""; 0]);
        assert_eq!(against_names(&packages), [""; 0]);
    }

    #[test]
    fn differences_of_manifests_and_table_are_problems() {
        let table = table(TABLE).unwrap();
        let mut packages = as_in_table();
        packages[2].dependencies.remove("b");
        packages[0].dev_dependencies.insert("b".to_owned());
        assert_eq!(
            against_table(&packages, &table),
            [
                "a depends in tests on `b`, which ARCHITECTURE.md does not list",
                "ARCHITECTURE.md lists that c depends on `b`; it does not"
            ]
        );
        packages = as_in_table();
        packages[1].folder = "crates/light/other".to_owned();
        assert_eq!(
            against_table(&packages, &table),
            [
                "ARCHITECTURE.md has no row for `crates/light/other`",
                "ARCHITECTURE.md has a row for `crates/light/b`, which does not exist"
            ]
        );
    }

    #[test]
    fn dependencies_lead_down() {
        let count =
            |from: &str, to: &str| against_layers(&[package(from, &["z"], &[]), package(to, &[], &["a"])]).len();
        assert_eq!(count("crates/base/a", "crates/light/z"), 1);
        assert_eq!(count("crates/rooms/a", "crates/learn/z"), 1);
        assert_eq!(count("crates/light/a", FACADE.replace("lightoctree", "learn/z").as_str()), 1);
        assert_eq!(count("crates/learn/a", "apps/z"), 1);
        assert_eq!(count("crates/learn/a", "crates/rooms/z"), 0);
        assert_eq!(count("crates/light/a", "crates/light/z"), 0);
        assert_eq!((layer(FACADE), layer("crates/learn/a"), layer("xtask")), (3, 3, 5));
        assert_eq!((count(FACADE, "crates/view/z"), count("crates/view/a", "crates/view/z")), (1, 0));
    }

    #[test]
    fn folder_package_and_import_have_one_name() {
        let mut packages = vec![package("crates/base/a", &[], &[]), package("crates/base/b", &["a"], &[])];
        packages[0].name = "lo_a".to_owned();
        packages[1].renamed.insert("alpha".to_owned());
        assert_eq!(
            against_names(&packages),
            ["package lo_a has a folder or library named a", "b renames a package to alpha"]
        );
    }
}
