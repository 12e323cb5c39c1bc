//! Who may know whom: the crates' manifests against the table of `ARCHITECTURE.md` and against the floors.
//!
//! The table is the one whose head begins with `| crate | purpose | depends on | in tests |`. A row names a package by its folder,
//! and the packages that it knows by their names, all in backticks.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, ensure};

use crate::house::{House, Package};

/// Folders of `crates`, lowest first.
const FLOORS: [&str; 5] = ["base", "light", "rooms", "learn", "view"];
/// It stands on the floor of `learn`: `lo_nets` is below it, training and evaluation above.
const FACADE: &str = "crates/lightoctree";
const FACADE_FLOOR: usize = 3;
const DOCUMENT: &str = "ARCHITECTURE.md";

/// Arrows that only the manifests or only the table have, arrows to a higher floor, and packages with two names.
pub fn faults(house: &House) -> anyhow::Result<Vec<String>> {
    let text = std::fs::read_to_string(house.root.join(DOCUMENT)).with_context(|| format!("cannot read {DOCUMENT}"))?;
    let table = table(&text)?;
    let mut faults = against_table(&house.packages, &table);
    faults.extend(against_floors(&house.packages));
    faults.extend(against_names(&house.packages));
    Ok(faults)
}

/// What a row of the table says.
#[derive(Debug, PartialEq)]
struct Row {
    knows: BTreeSet<String>,
    knows_in_tests: BTreeSet<String>,
}

fn table(text: &str) -> anyhow::Result<BTreeMap<String, Row>> {
    let rows = text.lines().skip_while(|line| !line.starts_with("| crate | purpose | depends on | in tests |")).skip(2);
    let mut table = BTreeMap::new();
    for line in rows.take_while(|line| line.starts_with('|')) {
        let cells: Vec<_> = line.trim().trim_matches('|').split('|').collect();
        let [folder, _, knows, knows_in_tests] = cells[..] else {
            anyhow::bail!("{DOCUMENT}: four cells are wanted: {line}");
        };
        let folder = names(folder).into_iter().next().with_context(|| format!("{DOCUMENT}: no folder in: {line}"))?;
        let row = Row { knows: names(knows), knows_in_tests: names(knows_in_tests) };
        ensure!(table.insert(folder, row).is_none(), "{DOCUMENT}: a second row for the crate of: {line}");
    }
    ensure!(!table.is_empty(), "{DOCUMENT} has no table `| crate | purpose | depends on | in tests |`");
    Ok(table)
}

/// What stands in backticks.
fn names(cell: &str) -> BTreeSet<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

fn against_table(packages: &[Package], table: &BTreeMap<String, Row>) -> Vec<String> {
    let mut faults = Vec::new();
    for package in packages {
        let Some(row) = table.get(&package.folder) else {
            faults.push(format!("{DOCUMENT} has no row for `{}`", package.folder));
            continue;
        };
        for (place, has, says) in
            [("", &package.knows, &row.knows), (" in tests", &package.knows_in_tests, &row.knows_in_tests)]
        {
            let missing = has.difference(says).map(|known| format!("and {DOCUMENT} does not say so: `{known}`"));
            let stale = says.difference(has).map(|known| format!("according to {DOCUMENT}, but does not: `{known}`"));
            faults.extend(missing.chain(stale).map(|fault| format!("{} knows{place} {fault}", package.name)));
        }
    }
    let folders: BTreeSet<_> = packages.iter().map(|package| &package.folder).collect();
    faults.extend(
        table.keys().filter(|row| !folders.contains(row)).map(|row| format!("{DOCUMENT}: there is no `{row}`")),
    );
    faults
}

/// Tests may look up where the table says so.
fn against_floors(packages: &[Package]) -> Vec<String> {
    let floors: BTreeMap<_, _> = packages.iter().map(|package| (&package.name, floor(&package.folder))).collect();
    let mut faults = Vec::new();
    for package in packages {
        let from = floor(&package.folder);
        for known in package.knows.iter().filter(|&known| floors.get(known).is_some_and(|&to| to > from)) {
            faults.push(format!("{} (`{}`) knows {known} of a higher floor", package.name, package.folder));
        }
    }
    faults
}

fn floor(folder: &str) -> usize {
    let name = folder.strip_prefix("crates/").and_then(|rest| rest.split('/').next());
    match FLOORS.iter().position(|&floor| Some(floor) == name) {
        Some(floor) => floor,
        None if folder == FACADE => FACADE_FLOOR,
        None => FLOORS.len(),
    }
}

/// Folder, package and library bear one name, and nobody calls them by another.
fn against_names(packages: &[Package]) -> Vec<String> {
    let mut faults = Vec::new();
    for package in packages {
        let folder = package.folder.rsplit('/').next().unwrap_or_default();
        let library = package.targets.iter().find(|target| target.kind.iter().any(|kind| kind == "lib"));
        let named = [Some(folder), library.map(|library| library.name.as_str())];
        for other in
            named.into_iter().flatten().filter(|other| other.replace('-', "_") != package.name.replace('-', "_"))
        {
            faults.push(format!("package {} is called {other} too", package.name));
        }
        faults.extend(
            package
                .renamed
                .iter()
                .map(|other| format!("{} calls a package {other} that has another name", package.name)),
        );
    }
    faults
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const TABLE: &str = "# Crates\n\n| crate | purpose | depends on | in tests |\n| --- | --- | --- | --- |\n\
        | `crates/base/a` | one | – | – |\n| `crates/light/b` | two | `a` | `c` |\n| `crates/rooms/c` | three | `a`, `b` | – |\n\ntext\n";

    fn package(folder: &str, knows: &[&str], knows_in_tests: &[&str]) -> Package {
        let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        Package {
            name: folder.rsplit('/').next().unwrap().to_owned(),
            folder: folder.to_owned(),
            targets: Vec::new(),
            knows: owned(knows),
            knows_in_tests: owned(knows_in_tests),
            renamed: BTreeSet::new(),
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
    fn what_the_table_says_is_no_fault() {
        let (packages, table) = (as_in_table(), table(TABLE).unwrap());
        assert_eq!(table.len(), 3);
        assert_eq!(against_table(&packages, &table), [""; 0]);
        assert_eq!(against_floors(&packages), [""; 0]);
        assert_eq!(against_names(&packages), [""; 0]);
    }

    #[test]
    fn arrows_of_one_side_alone_are_faults() {
        let table = table(TABLE).unwrap();
        let mut packages = as_in_table();
        packages[2].knows.remove("b");
        packages[0].knows_in_tests.insert("b".to_owned());
        let faults = against_table(&packages, &table);
        assert_eq!(
            faults,
            [
                "a knows in tests and ARCHITECTURE.md does not say so: `b`",
                "c knows according to ARCHITECTURE.md, but does not: `b`"
            ]
        );
        packages = as_in_table();
        packages[1].folder = "crates/light/other".to_owned();
        let faults = against_table(&packages, &table);
        assert_eq!(
            faults,
            ["ARCHITECTURE.md has no row for `crates/light/other`", "ARCHITECTURE.md: there is no `crates/light/b`"]
        );
    }

    #[test]
    fn arrows_lead_down() {
        let faults =
            |from: &str, to: &str| against_floors(&[package(from, &["z"], &[]), package(to, &[], &["a"])]).len();
        assert_eq!(faults("crates/base/a", "crates/light/z"), 1);
        assert_eq!(faults("crates/rooms/a", "crates/learn/z"), 1);
        assert_eq!(faults("crates/light/a", FACADE.replace("lightoctree", "learn/z").as_str()), 1);
        assert_eq!(faults("crates/learn/a", "apps/z"), 1);
        assert_eq!(faults("crates/learn/a", "crates/rooms/z"), 0);
        assert_eq!(faults("crates/light/a", "crates/light/z"), 0);
        assert_eq!((floor(FACADE), floor("crates/learn/a"), floor("xtask")), (3, 3, 5));
        assert_eq!((faults(FACADE, "crates/view/z"), faults("crates/view/a", "crates/view/z")), (1, 0));
    }

    #[test]
    fn one_name_for_folder_package_and_import() {
        let mut packages = vec![package("crates/base/a", &[], &[]), package("crates/base/b", &["a"], &[])];
        packages[0].name = "lo_a".to_owned();
        packages[1].renamed.insert("alpha".to_owned());
        assert_eq!(
            against_names(&packages),
            ["package lo_a is called a too", "b calls a package alpha that has another name"]
        );
    }
}
