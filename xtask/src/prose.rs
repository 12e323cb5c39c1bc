//! Text written for people: comments of Rust files and paragraphs of Markdown.

use std::ops::Range;
use std::str::FromStr;

use anyhow::{Context, anyhow};
use proc_macro2::{TokenStream, TokenTree};

/// One comment, or one run of lines of a Markdown file.
#[derive(Debug, PartialEq)]
pub struct Block {
    /// Line numbers from 1, and lines without the comment's marker.
    pub lines: Vec<(usize, String)>,
    pub kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    Markdown,
    /// `///`, `//!` and their block forms.
    Doc,
    /// `//` and `/* */`.
    Comment,
}

/// Adjacent lines without an empty line or a code block between them.
#[derive(Debug, PartialEq)]
pub struct Paragraph {
    /// Line numbers from 1, and trimmed lines. Inline code is masked by `_`.
    pub lines: Vec<(usize, String)>,
    /// Whether a doc comment begins here.
    pub opens_doc: bool,
}

/// Blocks of a file; none unless it is Rust or Markdown.
///
/// # Errors
/// A Rust file that has no valid tokens.
pub fn blocks(path: &str, text: &str) -> anyhow::Result<Vec<Block>> {
    if path.ends_with(".md") {
        let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.to_owned())).collect();
        return Ok(vec![Block { lines, kind: Kind::Markdown }]);
    }
    if path.ends_with(".rs") {
        return comments(text).with_context(|| path.to_owned());
    }
    Ok(Vec::new())
}

/// Lines outside of code blocks.
pub fn without_code(lines: &[(usize, String)]) -> impl Iterator<Item = &(usize, String)> {
    let mut is_code = false;
    lines.iter().filter(move |(_, line)| {
        let is_fence = line.trim_start().starts_with("```");
        is_code ^= is_fence;
        !is_code && !is_fence
    })
}

impl Block {
    /// Paragraphs outside of code blocks.
    pub fn paragraphs(&self) -> Vec<Paragraph> {
        let mut paragraphs: Vec<Paragraph> = Vec::new();
        let first = self.lines.first().map(|(number, _)| *number);
        let mut last = None;
        for (number, line) in without_code(&self.lines) {
            let text = masked(line.trim());
            if text.is_empty() {
                continue;
            }
            let follows = last.is_some_and(|last| last + 1 == *number);
            match paragraphs.last_mut().filter(|_| follows) {
                Some(paragraph) => paragraph.lines.push((*number, text)),
                None => {
                    let opens_doc = self.kind == Kind::Doc && first == Some(*number);
                    paragraphs.push(Paragraph { lines: vec![(*number, text)], opens_doc });
                }
            }
            last = Some(*number);
        }
        paragraphs
    }
}

impl Paragraph {
    /// Its lines joined by spaces, and the offset at which each line begins.
    pub fn joined(&self) -> (String, Vec<usize>) {
        let (mut text, mut starts) = (String::new(), Vec::new());
        for (_, line) in &self.lines {
            starts.push(text.len());
            text.push_str(line);
            text.push(' ');
        }
        (text, starts)
    }
}

/// Replaces inline code by `_`, so that identifiers are not read as prose.
fn masked(line: &str) -> String {
    let parts: Vec<_> = line.split('`').collect();
    // An unpaired backtick opens nothing.
    let paired = parts.len() - 1 + parts.len() % 2;
    let mask = |(index, part): (usize, &&str)| {
        if index % 2 == 1 && index < paired { "_".repeat(part.chars().count()) } else { (*part).to_owned() }
    };
    parts.iter().enumerate().map(mask).collect::<Vec<_>>().join("`")
}

/// Comments of a Rust file: what lies between its tokens, and its doc comments.
fn comments(text: &str) -> anyhow::Result<Vec<Block>> {
    let stream = TokenStream::from_str(text).map_err(|error| anyhow!("is not Rust: {error}"))?;
    let mut code = Vec::new();
    token_ranges(stream, text, &mut code);
    let mut blocks: Vec<Block> = Vec::new();
    let mut at = 0;
    for range in code.into_iter().chain(std::iter::once(text.len()..text.len())) {
        if at < range.start {
            let first_line = 1 + text[..at].matches('\n').count();
            append(&mut blocks, &text[at..range.start], first_line);
        }
        at = at.max(range.end);
    }
    Ok(blocks)
}

/// Byte ranges of tokens other than doc comments, in order.
fn token_ranges(stream: TokenStream, text: &str, ranges: &mut Vec<Range<usize>>) {
    for token in stream {
        // A doc comment becomes the tokens of an attribute, each with the span of the whole comment.
        let range = token.span().byte_range();
        if ["//", "/*"].iter().any(|start| text[range.start..].starts_with(start)) {
            continue;
        }
        match token {
            TokenTree::Group(group) => {
                ranges.push(group.span_open().byte_range());
                token_ranges(group.stream(), text, ranges);
                ranges.push(group.span_close().byte_range());
            }
            _ => ranges.push(range),
        }
    }
}

/// Appends the comments of a stretch of text that holds nothing else. Line comments on adjacent lines are one block.
fn append(blocks: &mut Vec<Block>, text: &str, first_line: usize) {
    // Text before the first line break follows code on its line.
    let mut lines = text.split('\n').enumerate().map(|(index, line)| (first_line + index, index > 0, line));
    let mut marker = "";
    while let Some((number, mut is_alone, line)) = lines.next() {
        is_alone |= number == 1;
        let line = line.trim();
        if let Some(rest) = line.strip_prefix("/*") {
            let kind = if rest.starts_with(['*', '!']) { Kind::Doc } else { Kind::Comment };
            let mut block = vec![(number, rest.trim_start_matches(['*', '!']).to_owned())];
            let mut depth = depth_change(line);
            while depth > 0 {
                let Some((number, _, line)) = lines.next() else { break };
                depth += depth_change(line);
                block.push((number, line.trim().trim_start_matches('*').to_owned()));
            }
            if let Some((_, last)) = block.last_mut() {
                *last = last.trim_end().trim_end_matches("*/").to_owned();
            }
            blocks.push(Block { lines: block, kind });
            marker = "";
            continue;
        }
        let found = ["////", "///", "//!", "//"].into_iter().find(|marker| line.starts_with(marker));
        let Some(found) = found else {
            marker = "";
            continue;
        };
        let kind = if ["///", "//!"].contains(&found) { Kind::Doc } else { Kind::Comment };
        let text = line[found.len()..].to_owned();
        match blocks.last_mut().filter(|_| is_alone && found == marker) {
            Some(block) => block.lines.push((number, text)),
            None => blocks.push(Block { lines: vec![(number, text)], kind }),
        }
        marker = if is_alone { found } else { "" };
    }
}

/// Block comments opened less those closed.
fn depth_change(line: &str) -> i64 {
    line.matches("/*").count() as i64 - line.matches("*/").count() as i64
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn texts(source: &str) -> Vec<(Kind, Vec<(usize, String)>)> {
        blocks("a.rs", source).unwrap().into_iter().map(|block| (block.kind, block.lines)).collect()
    }

    fn line(number: usize, text: &str) -> (usize, String) {
        (number, text.to_owned())
    }

    #[test]
    fn comments_are_told_from_code_and_strings() {
        let source = "//! One\n//! two\n\n/// Three\n#[inline]\nfn f<'a>() {\n    // four\n    // five\n    let a = \"// none\"; // six\n\
            \x20   let b = r#\"/// \"none\" \"#;\n    // seven\n    let c = '\"';\n}\n/* eight\n * nine */\n";
        let expected = [
            (Kind::Doc, vec![line(1, " One"), line(2, " two")]),
            (Kind::Doc, vec![line(4, " Three")]),
            (Kind::Comment, vec![line(7, " four"), line(8, " five")]),
            (Kind::Comment, vec![line(9, " six")]),
            (Kind::Comment, vec![line(11, " seven")]),
            (Kind::Comment, vec![line(14, " eight"), line(15, " nine ")]),
        ];
        assert_eq!(texts(source), expected);
        assert!(blocks("a.rs", "fn f( {").is_err());
        assert_eq!(blocks("a.toml", "# One").unwrap(), []);
    }

    #[test]
    fn doc_comments_of_fields_are_apart() {
        let source = "struct A {\n    /// One.\n    a: u8,\n    /// Two.\n    b: u8,\n}\n";
        let expected = [(Kind::Doc, vec![line(2, " One.")]), (Kind::Doc, vec![line(4, " Two.")])];
        assert_eq!(texts(source), expected);
    }

    #[test]
    fn paragraphs_leave_out_code() {
        let source = "/// One `fn two`\n/// three ` four.\n///\n/// ```\n/// code\n/// ```\n/// Five.\nfn f() {}\n";
        let paragraphs = blocks("a.rs", source).unwrap()[0].paragraphs();
        let expected = [
            Paragraph { lines: vec![line(1, "One `______`"), line(2, "three ` four.")], opens_doc: true },
            Paragraph { lines: vec![line(7, "Five.")], opens_doc: false },
        ];
        assert_eq!(paragraphs, expected);
        assert_eq!(paragraphs[0].joined(), ("One `______` three ` four. ".to_owned(), vec![0, 13]));
        let paragraphs = blocks("a.md", "# One\n\nTwo\nthree\n").unwrap()[0].paragraphs();
        assert_eq!(paragraphs.len(), 2);
        assert!(!paragraphs[0].opens_doc, "Markdown files have no doc comments");
    }
}
