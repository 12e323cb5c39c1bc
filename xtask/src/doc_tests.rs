//! `doctest = false` in `[lib]` exactly where documentation has no code: rustdoc takes a second for each crate.

use crate::workspace::{Target, Workspace};

/// Words of a code block's opening with which rustdoc compiles it; it does so without any, too.
const COMPILED: [&str; 4] = ["rust", "no_run", "should_panic", "compile_fail"];

/// Libraries whose `doctest` contradicts their sources.
pub fn problems(workspace: &Workspace) -> anyhow::Result<Vec<String>> {
    let texts = workspace.texts()?;
    let mut problems = Vec::new();
    for package in &workspace.packages {
        let is_library = |target: &&Target| target.kind.iter().any(|kind| kind == "lib");
        let Some(library) = package.targets.iter().find(is_library) else { continue };
        let sources = format!("{}/src/", package.folder);
        match texts.iter().find(|(path, text)| path.starts_with(&sources) && has_code(text)) {
            Some((path, _)) if !library.doctest => {
                problems.push(format!("{path}: its code is not compiled because of `doctest = false`"))
            }
            None if library.doctest => {
                problems.push(format!("{}: add `doctest = false`, as no documentation has code", package.folder))
            }
            _ => {}
        }
    }
    Ok(problems)
}

/// Whether a doc comment opens a block that rustdoc compiles.
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
