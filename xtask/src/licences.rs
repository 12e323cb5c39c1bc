//! Licences of all that is compiled, against the lists of `deny.toml` (which `cargo deny check` reads too), without a network.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::Context;
use serde::Deserialize;
use spdx::{Expression, ParseMode};

use crate::house::{self, House};

const RULES: &str = "deny.toml";

/// Packages whose licence is not allowed, by name.
///
/// Judged is what cargo compiles here by default, with build scripts and tests; what other systems or the features that are off would add is
/// left to `cargo deny`, as it may not lie on this machine.
pub fn faults(house: &House) -> anyhow::Result<Vec<String>> {
    let text = std::fs::read_to_string(house.root.join(RULES)).with_context(|| format!("cannot read {RULES}"))?;
    let rules: Rules = toml::from_str(&text).with_context(|| RULES.to_owned())?;
    let args = ["tree", "--workspace", "--offline", "--locked", "--edges", "normal,build,dev", "--prefix", "none"];
    let tree = house::cargo(&house.root, &[&args[..], &["--format", "{p}|{l}|"]].concat())?;
    Ok(against_rules(&packages(&tree), &rules.licenses))
}

#[derive(Deserialize)]
struct Rules {
    licenses: Licences,
}

#[derive(Deserialize)]
struct Licences {
    allow: BTreeSet<String>,
    #[serde(default)]
    exceptions: Vec<Exception>,
}

/// What a single crate may have besides.
#[derive(Deserialize)]
struct Exception {
    #[serde(rename = "crate")]
    name: String,
    allow: BTreeSet<String>,
}

/// Package → licence, from lines `NAME VERSION (WHERE)|LICENCE| (*)`.
fn packages(tree: &str) -> BTreeMap<&str, &str> {
    let cells = tree.lines().filter_map(|line| line.split_once('|'));
    cells.map(|(package, rest)| (package, rest.split('|').next().unwrap_or_default())).collect()
}

fn against_rules(packages: &BTreeMap<&str, &str>, rules: &Licences) -> Vec<String> {
    let mut faults = Vec::new();
    for (&package, &licence) in packages {
        let name = package.split(' ').next().unwrap_or_default();
        let exceptions = || rules.exceptions.iter().filter(|exception| exception.name == name);
        let allowed = |licence: &str| {
            rules.allow.contains(licence) || exceptions().any(|exception| exception.allow.contains(licence))
        };
        match Expression::parse_mode(licence, ParseMode::LAX) {
            Ok(expression) if expression.evaluate(|required| allowed(&required.to_string())) => (),
            Ok(_) => faults.push(format!("{package}: {licence} is not among the licences that {RULES} allows")),
            Err(_) if licence.is_empty() => faults.push(format!("{package} names no licence")),
            Err(error) => faults.push(format!("{package}: {licence} is no licence expression: {}", error.reason)),
        }
    }
    faults
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
        let rules =
            "[licenses]\nallow = [\"MIT\", \"Zlib\"]\nexceptions = [{ crate = \"weak\", allow = [\"MPL-2.0\"] }]";
        let rules: Rules = toml::from_str(rules).unwrap();
        let packages = packages(TREE);
        assert_eq!(packages.len(), 9);
        let faults = against_rules(&packages, &rules.licenses);
        let of = |name: &str| faults.iter().find(|fault| fault.starts_with(name)).map(String::as_str);
        assert_eq!([of("one"), of("old"), of("parts"), of("weak")], [None; 4]);
        assert_eq!(
            of("full").unwrap(),
            "full v2.0.0: Zlib AND GPL-3.0-only is not among the licences that deny.toml allows"
        );
        assert!(of("llvm").is_some(), "an exception to a licence is another licence");
        assert!(of("other").is_some(), "an exception holds for its crate alone");
        assert_eq!(of("none"), Some("none v1.0.0 names no licence"));
        assert!(of("odd").unwrap().contains("is no licence expression"), "{faults:?}");
        assert_eq!(faults.len(), 5);
    }
}
