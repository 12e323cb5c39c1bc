//! Code in documentation is compiled where there is some, and rustdoc is not started where there is none: `doctest = false` in `[lib]`.

use crate::house::{House, Target};

/// What a block's opening may say besides nothing, for it to be compiled.
const COMPILED: [&str; 4] = ["rust", "no_run", "should_panic", "compile_fail"];

/// Libraries whose `doctest` says otherwise than their sources.
pub fn faults(house: &House) -> anyhow::Result<Vec<String>> {
    let texts = house.texts()?;
    let mut faults = Vec::new();
    for package in &house.packages {
        let is_library = |target: &&Target| target.kind.iter().any(|kind| kind == "lib");
        let Some(library) = package.targets.iter().find(is_library) else { continue };
        let sources = format!("{}/src/", package.folder);
        match texts.iter().find(|(path, text)| path.starts_with(&sources) && has_code(text)) {
            Some((path, _)) if !library.doctest => faults.push(format!("{path}: `doctest = false` hides its code")),
            None if library.doctest => faults.push(format!("{} wants `doctest = false`", package.folder)),
            _ => {}
        }
    }
    Ok(faults)
}

/// Whether documentation comments open a block that rustdoc compiles.
fn has_code(text: &str) -> bool {
    let lines = text.lines().filter_map(|line| {
        let line = line.trim_start();
        line.strip_prefix("///").or_else(|| line.strip_prefix("//!"))
    });
    let mut is_open = false;
    lines.filter_map(|line| line.trim_start().strip_prefix("```")).any(|language| {
        is_open = !is_open;
        is_open && language.split(',').all(|word| word.trim().is_empty() || COMPILED.contains(&word.trim()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_rustdoc_compiles_is_code() {
        assert!(has_code("/// ```\n/// f();\n/// ```\n"));
        assert!(has_code("//! Text\n//!\n//! ```no_run\n//! f();\n//! ```\n"));
        assert!(!has_code("/// ```json\n/// {}\n/// ```\n"));
        assert!(!has_code("// ```\n// f();\n// ```\nlet a = \"/// ```\";\n"));
    }
}
