//! Features of burn's dependencies: the same for the program, for the lab and for each crate alone.
//!
//! Otherwise `cargo bench -p lo_nets` or a build of the lab would compile them again (`crates/base/lo_features`).

use std::collections::BTreeMap;

use crate::workspace::{self, Package, Workspace};

/// The crate that gives others the program's features as a dev-dependency.
const FEATURES: &str = "lo_features";
const PROGRAM: &str = "lightoctree-cli";
const LAB: &str = "lightoctree-lab";
/// The dependency that takes minutes to compile.
const COSTLY: &str = "burn";
/// Features of it that only training enables, and so the lab.
const TRAINING: [&str; 2] = ["autodiff", "burn-autodiff"];

/// Dependencies of burn whose features differ from the program's, by crate.
pub fn problems(workspace: &Workspace) -> anyhow::Result<Vec<String>> {
    let tree = |package: &str, edges: &str| -> anyhow::Result<String> {
        let args = ["tree", "--offline", "--locked", "--prefix", "none", "--format", "{p}|{f}|", "--edges", edges];
        workspace::cargo(&workspace.root, &[&args[..], &["--package", package]].concat())
    };
    let below = tree(COSTLY, "normal,build")?;
    let program = tree(PROGRAM, "normal,build")?;
    let mut problems = Vec::new();
    let is_compared = |package: &&Package| package.name == LAB || package.dev_dependencies.contains(FEATURES);
    for package in workspace.packages.iter().filter(is_compared) {
        let edges = if package.name == LAB { "normal,build" } else { "normal,build,dev" };
        let own = tree(&package.name, edges)?;
        problems.extend(differences(&package.name, &features(&below), &features(&program), &features(&own)));
    }
    Ok(problems)
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
    let inferring = |features: &str| -> Vec<String> {
        features.split(',').filter(|feature| !TRAINING.contains(feature)).map(str::to_owned).collect()
    };
    let differs = |package: &&str| match (program.get(package), own.get(package)) {
        (Some(program), Some(own)) if inferring(program) != inferring(own) => {
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
    fn dependencies_of_burn_have_the_features_of_the_program() {
        let program =
            features("burn v1.0.0|std|\nserde v1.0.0|derive,std|\nserde v1.0.0|derive,std| (*)\nclap v4.0.0|std|\n");
        let own = features("burn v1.0.0|std|\nserde v1.0.0|std|\nclap v4.0.0||\nproptest v1.0.0|std|\n");
        let below = features("burn v1.0.0|std|\nserde v1.0.0||\n");
        let problems = differences("nets", &below, &program, &own);
        assert_eq!(
            problems,
            ["serde v1.0.0 has [derive,std] in the program and [std] in `-p nets`: see lo_features"],
            "burn does not depend on clap"
        );
        assert!(differences("nets", &below, &program, &program).is_empty());
        let training = features("burn v1.0.0|autodiff,std|\nserde v1.0.0|derive,std|\n");
        assert!(differences("nets", &below, &program, &training).is_empty());
    }
}
