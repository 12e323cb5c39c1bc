//! Comments and Markdown have lines of at most 120 columns. rustfmt keeps code to that, but leaves comments alone.

use regex_lite::Regex;

use crate::prose::{self, Kind};
use crate::workspace::Workspace;

const COLUMNS: usize = 120;

/// Lines that are too wide, as `file:line: columns`.
pub fn problems(workspace: &Workspace) -> anyhow::Result<Vec<String>> {
    let mut problems = Vec::new();
    for (path, text) in workspace.texts()? {
        let wide = wide_lines(&path, &text)?;
        problems
            .extend(wide.into_iter().map(|(number, width)| format!("{path}:{number}: {width} of {COLUMNS} columns")));
    }
    Ok(problems)
}

/// Numbers and widths. Tables, code blocks, HTML tags and the targets of links do not count.
fn wide_lines(path: &str, text: &str) -> anyhow::Result<Vec<(usize, usize)>> {
    let lines: Vec<_> = text.lines().collect();
    let targets = Regex::new(r"\]\([^)]*\)|\]: \S+|<?https?://\S+")?;
    let mut wide = Vec::new();
    for block in prose::blocks(path, text)? {
        for (number, line) in prose::without_code(&block.lines) {
            let is_exempt = block.kind != Kind::Comment && line.trim_start().starts_with(['|', '<']);
            let width = targets.replace_all(lines[number - 1], "]").chars().count();
            if width > COLUMNS && !is_exempt {
                wide.push((*number, width));
            }
        }
    }
    Ok(wide)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn wide(path: &str, text: &str) -> Vec<(usize, usize)> {
        wide_lines(path, text).unwrap()
    }

    #[test]
    fn comments_and_markdown_are_at_most_120_columns_wide() {
        let text = "×".repeat(COLUMNS);
        assert_eq!(wide("a.md", &format!("{text}\n")), []);
        assert_eq!(wide("a.md", &format!("\n{text}×\n")), [(2, 121)]);
        assert_eq!(wide("a.rs", &format!("    // {}\n", &text[..2 * 113])), []);
        assert_eq!(wide("a.rs", &format!("    // {}\n", &text[..2 * 114])), [(1, 121)]);
        assert_eq!(wide("a.rs", &format!("/// A\n/// {text}\nfn f() {{}} // {text}\n")), [(2, 124), (3, 133)]);
    }

    #[test]
    fn code_tables_and_link_targets_do_not_count() {
        let text = "x".repeat(COLUMNS);
        assert_eq!(
            wide("a.rs", &format!("const A: &str = \"{text}\";\n/// ```\n/// {text}\n/// ```\nfn f() {{}}\n")),
            []
        );
        assert_eq!(wide("a.md", &format!("| {text} |\n\n```text\n{text} {text}\n```\n<img src=\"{text}\">\n")), []);
        assert_eq!(wide("a.md", &format!("[a]({text}) [b](https://{text})\n\n[c]: {text}\n")), []);
        assert_eq!(wide("a.rs", &format!("//! Source: <https://{text}>.\n")), []);
        assert_eq!(wide("a.md", &format!("[{text}](a)\n")), [(1, 122)]);
    }
}
