//! Features of what burn is built on: the same for the program, for the lab and for each crate alone, so that neither `cargo bench -p lo_nets` nor
//! building the lab compiles a dependency anew (`crates/base/lo_features`).

use std::collections::BTreeMap;

use crate::house::{self, House};

/// The crate whose dev-dependencies bring the program's features to others.
const FEATURES: &str = "lo_features";
const PROGRAM: &str = "lightoctree-cli";
const LAB: &str = "lightoctree-lab";
/// What takes minutes to compile.
const COSTLY: &str = "burn";

/// Dependencies of burn whose features differ, by crate.
pub fn faults(house: &House) -> anyhow::Result<Vec<String>> {
    let tree = |package: &str, edges: &str| -> anyhow::Result<String> {
        let args = ["tree", "--offline", "--locked", "--prefix", "none", "--format", "{p}|{f}|", "--edges", edges];
        house::cargo(&house.root, &[&args[..], &["--package", package]].concat())
    };
    let below = tree(COSTLY, "normal,build")?;
    let program = tree(PROGRAM, "normal,build")?;
    let mut faults = Vec::new();
    let is_compared = |package: &&house::Package| package.name == LAB || package.knows_in_tests.contains(FEATURES);
    for package in house.packages.iter().filter(is_compared) {
        let edges = if package.name == LAB { "normal,build" } else { "normal,build,dev" };
        let own = tree(&package.name, edges)?;
        faults.extend(differences(&package.name, &features(&below), &features(&program), &features(&own)));
    }
    Ok(faults)
}

/// Package with its version → features, from lines `NAME VERSION (WHERE)|FEATURE,FEATURE| (*)`.
fn features(tree: &str) -> BTreeMap<&str, &str> {
    let cells = tree.lines().filter_map(|line| line.split_once('|'));
    cells.map(|(package, rest)| (package, rest.split('|').next().unwrap_or_default())).collect()
}

fn differences(
    crate_name: &str,
    below: &BTreeMap<&str, &str>,
    program: &BTreeMap<&str, &str>,
    own: &BTreeMap<&str, &str>,
) -> Vec<String> {
    let differs = |package: &&str| match (program.get(package), own.get(package)) {
        (Some(program), Some(own)) if program != own => {
            Some(format!("{package} has [{program}] in the program and [{own}] in `-p {crate_name}`: see {FEATURES}"))
        }
        _ => None,
    };
    below.keys().filter_map(differs).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_burn_stands_on_has_the_features_of_the_program() {
        let program =
            features("burn v1.0.0|std|\nserde v1.0.0|derive,std|\nserde v1.0.0|derive,std| (*)\nclap v4.0.0|std|\n");
        let own = features("burn v1.0.0|std|\nserde v1.0.0|std|\nclap v4.0.0||\nproptest v1.0.0|std|\n");
        let below = features("burn v1.0.0|std|\nserde v1.0.0||\n");
        let faults = differences("nets", &below, &program, &own);
        assert_eq!(
            faults,
            ["serde v1.0.0 has [derive,std] in the program and [std] in `-p nets`: see lo_features"],
            "clap is none of burn's"
        );
        assert!(differences("nets", &below, &program, &program).is_empty());
    }
}
