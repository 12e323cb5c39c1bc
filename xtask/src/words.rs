//! Phrases that readers stumble over: `xtask/words.toml`, looked for in comments and Markdown.

use anyhow::Context;
use regex_lite::Regex;
use serde::Deserialize;

use crate::prose::{self, Paragraph};
use crate::workspace::Workspace;

const LIST: &str = "xtask/words.toml";

/// Listed phrases, as `file:line: phrase → advice`.
pub fn problems(workspace: &Workspace) -> anyhow::Result<Vec<String>> {
    let text = std::fs::read_to_string(workspace.root.join(LIST)).with_context(|| format!("cannot read {LIST}"))?;
    let words = Words::parse(&text).with_context(|| LIST.to_owned())?;
    let mut problems = Vec::new();
    for (path, text) in workspace.texts()? {
        for block in prose::blocks(&path, &text)? {
            for paragraph in block.paragraphs() {
                let found = words.find(&paragraph).into_iter();
                problems
                    .extend(found.map(|found| format!("{path}:{}: {} → {}", found.line, found.phrase, found.advice)));
            }
        }
    }
    Ok(problems)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    opening: Vec<Entry>,
    phrase: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    find: String,
    instead: String,
}

/// Compiled patterns with their advice.
struct Words {
    openings: Vec<(Regex, String)>,
    phrases: Vec<(Regex, String)>,
}

#[derive(Debug, PartialEq)]
struct Found<'a> {
    line: usize,
    phrase: String,
    advice: &'a str,
}

impl Words {
    fn parse(text: &str) -> anyhow::Result<Self> {
        let list: List = toml::from_str(text)?;
        let compiled = |entries: Vec<Entry>, before: &str, after: &str| {
            let pattern = |entry: Entry| {
                let regex = Regex::new(&format!("{before}(?:{}){after}", entry.find))?;
                anyhow::Ok((regex, entry.instead))
            };
            entries.into_iter().map(pattern).collect::<anyhow::Result<Vec<_>>>()
        };
        Ok(Self { openings: compiled(list.opening, "^", "\\b")?, phrases: compiled(list.phrase, "(?i)\\b", "\\b")? })
    }

    fn find(&self, paragraph: &Paragraph) -> Vec<Found<'_>> {
        let (text, starts) = paragraph.joined();
        let openings = self.openings.iter().filter(|_| paragraph.opens_doc);
        let mut found = Vec::new();
        for (regex, advice) in openings.chain(&self.phrases) {
            for part in regex.find_iter(&text) {
                let index = starts.partition_point(|&start| start <= part.start()) - 1;
                found.push(Found { line: paragraph.lines[index].0, phrase: part.as_str().to_owned(), advice });
            }
        }
        found.sort_by_key(|found| found.line);
        found
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const TOML: &str = "[[opening]]\nfind = 'Of|What'\ninstead = 'a noun'\n[[phrase]]\nfind = 'stands? (in|beside)'\ninstead = 'is in'\n";

    fn find(path: &str, text: &str) -> Vec<String> {
        let words = Words::parse(TOML).unwrap();
        let blocks = prose::blocks(path, text).unwrap();
        let paragraphs: Vec<_> = blocks.iter().flat_map(|block| block.paragraphs()).collect();
        let found = paragraphs.iter().flat_map(|paragraph| words.find(paragraph));
        found.map(|found| format!("{}: {} → {}", found.line, found.phrase, found.advice)).collect()
    }

    #[test]
    fn doc_comments_do_not_open_with_listed_words() {
        assert_eq!(find("a.rs", "/// What it is.\nfn f() {}\n"), ["1: What → a noun"]);
        assert_eq!(find("a.rs", "//! Offsets.\n\n/// Sizes.\n///\n/// Of all.\nfn f() {}\n// What it is.\n"), [""; 0]);
        assert_eq!(find("a.md", "What it is.\n"), [""; 0]);
    }

    #[test]
    fn phrases_are_found_over_line_breaks_and_only_in_prose() {
        assert_eq!(
            find("a.rs", "// It\n// stands\n// beside it; it stands in it.\n"),
            ["2: stands beside → is in", "3: stands in → is in"]
        );
        assert_eq!(find("a.md", "One.\n\nIt Stands in it.\n"), ["3: Stands in → is in"]);
        assert_eq!(
            find("a.rs", "/// It `stands in` it, or stands inside, or stands.\n///\n/// In it.\nfn f() {}\n"),
            [""; 0]
        );
        assert_eq!(find("a.rs", "fn f() -> &'static str {\n    \"it stands in it\"\n}\n"), [""; 0]);
        assert_eq!(find("a.md", "```sh\nstands in\n```\n"), [""; 0]);
    }

    #[test]
    fn the_list_of_the_workspace_is_valid() {
        let words = Words::parse(include_str!("../words.toml")).unwrap();
        assert!(!words.openings.is_empty() && !words.phrases.is_empty());
        assert!(Words::parse("[[opening]]\nfind = '('\ninstead = ''\n[[phrase]]\n").is_err());
    }
}
