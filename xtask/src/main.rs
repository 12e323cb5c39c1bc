//! `cargo xtask` makes the checks of the house that no compiler makes; `cargo test -p xtask` makes them too.
//! `cargo xtask long [NAME]` lists or runs the ignored tests.

mod arrows;
mod doc_tests;
mod documents;
mod features;
mod house;
mod licences;
mod long;

use std::process::ExitCode;

use house::House;

/// A check's name, and what it finds wrong in the house.
type Check = (&'static str, fn(&House) -> anyhow::Result<Vec<String>>);

const CHECKS: [Check; 5] = [
    ("arrows", arrows::faults),
    ("doc tests", doc_tests::faults),
    ("documents", documents::faults),
    ("licences", licences::faults),
    ("features", features::faults),
];

fn main() -> anyhow::Result<ExitCode> {
    let house = House::read()?;
    let args: Vec<_> = std::env::args().skip(1).collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => check(&house),
        ["long"] => long::run(&house, None).map(code),
        ["long", name] => long::run(&house, Some(name)).map(code),
        _ => anyhow::bail!("cargo xtask | cargo xtask long [NAME]"),
    }
}

fn code(passed: bool) -> ExitCode {
    if passed { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn check(house: &House) -> anyhow::Result<ExitCode> {
    let mut found = 0;
    for (name, faults) in CHECKS {
        for fault in faults(house)? {
            eprintln!("{name}: {fault}");
            found += 1;
        }
    }
    Ok(code(found == 0))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_house_is_in_order() {
        let house = House::read().unwrap();
        let faults: Vec<_> = CHECKS
            .iter()
            .flat_map(|(name, faults)| faults(&house).unwrap().into_iter().map(move |fault| format!("{name}: {fault}")))
            .collect();
        assert!(faults.is_empty(), "\n{}\n", faults.join("\n"));
    }
}
