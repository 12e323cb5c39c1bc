//! Files of a crate that use each other in a ring.
//!
//! A file uses another where it names one of its items by a path: `crate::a::Item`, `super::Item`, `child::function()`.
//! Re-exports are followed to the file that defines the item, and do not count themselves. Nor do tests. Method
//! calls, traits in scope and what macros expand to are not seen.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{Context, anyhow};
use proc_macro2::{Delimiter, TokenStream, TokenTree};

use crate::workspace::Workspace;

/// Rings in libraries and programs, each with its files and the items that they use of each other.
pub fn problems(workspace: &Workspace) -> anyhow::Result<Vec<String>> {
    let mut problems = Vec::new();
    for package in &workspace.packages {
        let is_ours = |kind: &String| kind == "lib" || kind == "bin";
        for target in package.targets.iter().filter(|target| target.kind.iter().any(is_ours)) {
            let source = |path: &Path| std::fs::read_to_string(path).ok();
            let modules = Modules::read(&target.src_path, &source)?;
            let folder = target.src_path.parent().unwrap_or(Path::new(""));
            let name = |file: &Path| file.strip_prefix(folder).unwrap_or(file).display().to_string();
            let rings = rings(&modules.uses());
            problems
                .extend(rings.iter().map(|ring| format!("{}: {}", workspace.relative(folder), described(ring, &name))));
        }
    }
    Ok(problems)
}

/// Segments of a path from the crate's root.
type Segments = Vec<String>;

/// File → files that it uses, each with the name of one item.
type Uses = BTreeMap<PathBuf, BTreeMap<PathBuf, String>>;

/// `a.rs → b.rs (Item), …` of all uses in a ring.
fn described(ring: &Uses, name: &dyn Fn(&Path) -> String) -> String {
    let uses = ring
        .iter()
        .flat_map(|(from, to)| to.iter().map(|(to, item)| format!("{} → {} ({item})", name(from), name(to))));
    uses.collect::<Vec<_>>().join(", ")
}

/// Sets of files that all reach each other, with the uses between them.
fn rings(uses: &Uses) -> Vec<Uses> {
    let reached = |from: &PathBuf| {
        let (mut reached, mut open) = (BTreeSet::new(), vec![from]);
        while let Some(file) = open.pop() {
            for next in uses.get(file).into_iter().flat_map(BTreeMap::keys) {
                if reached.insert(next) {
                    open.push(next);
                }
            }
        }
        reached
    };
    let reach: BTreeMap<_, _> = uses.keys().map(|file| (file, reached(file))).collect();
    let mut rings = Vec::new();
    let mut done = BTreeSet::new();
    for (file, reached) in &reach {
        if !reached.contains(file) || done.contains(file) {
            continue;
        }
        let is_member =
            |other: &PathBuf| reached.contains(other) && reach.get(other).is_some_and(|back| back.contains(file));
        let members: BTreeSet<_> = uses.keys().filter(|&other| is_member(other)).collect();
        let inner = |to: &BTreeMap<PathBuf, String>| {
            to.iter().filter(|(to, _)| members.contains(to)).map(|(to, item)| (to.clone(), item.clone())).collect()
        };
        rings.push(members.iter().map(|&member| (member.clone(), inner(&uses[member]))).collect());
        done.extend(members);
    }
    rings
}

/// The modules of a crate by their paths; the root's is empty.
#[derive(Default)]
struct Modules(BTreeMap<Segments, Module>);

#[derive(Default)]
struct Module {
    file: PathBuf,
    /// Items that it defines.
    items: BTreeSet<String>,
    /// Local name → what `use` imports or re-exports by it.
    imports: BTreeMap<String, Segments>,
    /// Modules and enums of which everything is imported.
    globs: Vec<Segments>,
    /// Paths in its code and in its private imports, as they are written.
    mentions: BTreeSet<Segments>,
}

impl Modules {
    /// Reads a crate from its root module's file.
    fn read(root: &Path, source: &dyn Fn(&Path) -> Option<String>) -> anyhow::Result<Self> {
        let mut modules = Self::default();
        let folder = root.parent().unwrap_or(Path::new("")).to_owned();
        let mut files = vec![(Vec::new(), root.to_owned(), folder)];
        while let Some((path, file, folder)) = files.pop() {
            let text = source(&file).with_context(|| format!("cannot read {}", file.display()))?;
            let stream =
                TokenStream::from_str(&text).map_err(|error| anyhow!("{} is not Rust: {error}", file.display()))?;
            let mut found = Vec::new();
            modules.0.entry(path.clone()).or_default().file = file.clone();
            modules.scan(stream, &path, &file, &mut found);
            for child in found {
                // Names of inline modules are folders.
                let inline = folder.join(child[path.len()..child.len() - 1].join("/"));
                let Some(name) = child.last() else { continue };
                let choices = [inline.join(format!("{name}.rs")), inline.join(name).join("mod.rs")];
                let Some(file) = choices.into_iter().find(|file| source(file).is_some()) else { continue };
                files.push((child.clone(), file, inline.join(name)));
            }
        }
        Ok(modules)
    }

    /// Collects what a module of a file holds; `files` receives the paths of modules in files of their own.
    fn scan(&mut self, stream: TokenStream, path: &Segments, file: &Path, files: &mut Vec<Segments>) {
        let tokens: Vec<_> = stream.into_iter().collect();
        let mut at = 0;
        while let Some(token) = tokens.get(at) {
            match token {
                TokenTree::Punct(punct) if punct.as_char() == '#' => {
                    let is_inner = is_punct(tokens.get(at + 1), '!');
                    at += 1 + usize::from(is_inner);
                    if tokens.get(at).is_some_and(is_test) {
                        at = if is_inner { tokens.len() } else { after_item(&tokens, at + 1) };
                    } else {
                        at += 1;
                    }
                }
                TokenTree::Group(group) => {
                    self.scan(group.stream(), path, file, files);
                    at += 1;
                }
                TokenTree::Ident(word) => {
                    let next = |offset: usize| tokens.get(at + offset);
                    match (word.to_string().as_str(), next(1), next(2)) {
                        ("mod", Some(TokenTree::Ident(name)), after) => {
                            let child = [&path[..], &[name.to_string()]].concat();
                            self.0.entry(child.clone()).or_default().file = file.to_owned();
                            match after {
                                Some(TokenTree::Group(body)) => self.scan(body.stream(), &child, file, files),
                                _ => files.push(child),
                            }
                            at += 3;
                        }
                        ("use", ..) => {
                            let end = (at..tokens.len()).find(|&end| is_punct(tokens.get(end), ';'));
                            let end = end.unwrap_or(tokens.len());
                            let module = self.0.entry(path.clone()).or_default();
                            module.add_use(&tokens[at + 1..end], &[], is_public(&tokens[..at]));
                            at = end + 1;
                        }
                        ("enum", Some(TokenTree::Ident(name)), _) => {
                            self.0.entry(path.clone()).or_default().items.insert(name.to_string());
                            let is_body = |token: &TokenTree| matches!(token, TokenTree::Group(group) if group.delimiter() == Delimiter::Brace);
                            let end = (at..tokens.len()).find(|&end| is_body(&tokens[end])).unwrap_or(tokens.len());
                            if let Some(TokenTree::Group(body)) = tokens.get(end) {
                                self.scan(without_variants(body.stream()), path, file, files);
                            }
                            at = end + 1;
                        }
                        (
                            "fn" | "struct" | "union" | "trait" | "type" | "const" | "static",
                            Some(TokenTree::Ident(name)),
                            _,
                        ) => {
                            self.0.entry(path.clone()).or_default().items.insert(name.to_string());
                            at += 2;
                        }
                        ("macro_rules", _, Some(TokenTree::Ident(name))) => {
                            self.0.entry(path.clone()).or_default().items.insert(name.to_string());
                            at += 3;
                        }
                        _ => {
                            let is_continued = is_punct(at.checked_sub(1).and_then(|at| tokens.get(at)), '.')
                                || at >= 2 && is_separator(&tokens, at - 2);
                            let mut segments = vec![word.to_string()];
                            at += 1;
                            while let (true, Some(TokenTree::Ident(word))) =
                                (is_separator(&tokens, at), tokens.get(at + 2))
                            {
                                segments.push(word.to_string());
                                at += 3;
                            }
                            if !is_continued {
                                self.0.entry(path.clone()).or_default().mentions.insert(segments);
                            }
                        }
                    }
                }
                _ => at += 1,
            }
        }
    }

    /// A path as it is written in a module, from the crate's root; `None` for those of other crates.
    fn absolute(&self, module: &Segments, written: &[String]) -> Option<Segments> {
        let mut base = module.clone();
        let mut rest = written;
        let mut is_relative = false;
        while let [first, after @ ..] = rest {
            match first.as_str() {
                "crate" if !is_relative => base.clear(),
                "self" if !is_relative => {}
                "super" => {
                    base.pop()?;
                }
                _ => break,
            }
            (rest, is_relative) = (after, true);
        }
        if is_relative {
            return Some([&base[..], rest].concat());
        }
        let first = rest.first()?;
        let own = self.0.get(module)?;
        let child = [&module[..], std::slice::from_ref(first)].concat();
        (own.imports.contains_key(first) || self.0.contains_key(&child)).then(|| [&module[..], rest].concat())
    }

    /// The file that defines what a path from the root names, and the item, unless the path ends at a module; `None`
    /// for other crates.
    fn resolve(&self, path: &[String], depth: usize) -> Option<(&Path, Option<String>)> {
        // Re-exports can form a ring, too.
        let depth = depth.checked_sub(1)?;
        let mut at = Vec::new();
        for (index, name) in path.iter().enumerate() {
            let module = self.0.get(&at)?;
            let child = [&at[..], std::slice::from_ref(name)].concat();
            let (is_last, is_module) = (index + 1 == path.len(), self.0.contains_key(&child));
            if let (Some(import), true) = (module.imports.get(name), is_last || !is_module) {
                let absolute = self.absolute_import(&at, name, import)?;
                return self.resolve(&[&absolute[..], &path[index + 1..]].concat(), depth);
            }
            if !is_module {
                let is_own = module.items.contains(name);
                let through = |glob: &Segments| {
                    let target = self.absolute(&at, glob)?;
                    self.0.get(&target)?.provides(name).then_some(target)
                };
                return match module.globs.iter().find_map(through).filter(|_| !is_own) {
                    Some(target) => self.resolve(&[&target[..], &path[index..]].concat(), depth),
                    None => Some((&module.file, Some(name.clone()))),
                };
            }
            at = child;
        }
        Some((&self.0.get(&at)?.file, None))
    }

    /// Like [`Self::absolute`], for an import that may have the name of what it imports: `use name::name`.
    fn absolute_import(&self, module: &Segments, name: &str, import: &[String]) -> Option<Segments> {
        let child = [&module[..], &[name.to_owned()]].concat();
        if import.first().is_some_and(|first| first == name) && !self.0.contains_key(&child) {
            return None;
        }
        self.absolute(module, import)
    }

    /// Which file uses which.
    fn uses(&self) -> Uses {
        let mut uses = Uses::new();
        for (path, module) in &self.0 {
            for mention in &module.mentions {
                // A local variable may have the name of a module.
                let is_imported = mention.first().is_some_and(|first| module.imports.contains_key(first));
                if mention.len() == 1 && !is_imported {
                    continue;
                }
                let target = self.absolute(path, mention).and_then(|path| self.resolve(&path, 32));
                if let Some((file, Some(item))) = target.filter(|(file, _)| *file != module.file) {
                    uses.entry(module.file.clone()).or_default().entry(file.to_owned()).or_insert(item);
                }
            }
        }
        uses
    }
}

impl Module {
    /// Whether it defines or imports a name.
    fn provides(&self, name: &str) -> bool {
        self.items.contains(name) || self.imports.contains_key(name)
    }

    /// Adds what `use` brings: a tree of names after `before`.
    fn add_use(&mut self, tree: &[TokenTree], before: &[String], is_public: bool) {
        for branch in tree.split(|token| is_punct(Some(token), ',')) {
            let mut segments = before.to_vec();
            let mut alias = None;
            let mut at = 0;
            while let Some(token) = branch.get(at) {
                match token {
                    TokenTree::Ident(word) if word == "as" => {
                        alias = branch.get(at + 1).map(ToString::to_string);
                        break;
                    }
                    TokenTree::Ident(word) if word == "self" && !segments.is_empty() => {}
                    TokenTree::Ident(word) => segments.push(word.to_string()),
                    TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => {
                        let inner: Vec<_> = group.stream().into_iter().collect();
                        self.add_use(&inner, &segments, is_public);
                        segments.clear();
                        break;
                    }
                    TokenTree::Punct(punct) if punct.as_char() == '*' => {
                        self.globs.push(std::mem::take(&mut segments));
                        break;
                    }
                    _ => {}
                }
                at += 1;
            }
            let Some(name) = alias.or_else(|| segments.last().cloned()) else { continue };
            if !is_public {
                self.mentions.insert(segments.clone());
            }
            if name != "_" {
                self.imports.insert(name, segments);
            }
        }
    }
}

/// An enum's body without the names of its variants, which may be those of imports.
fn without_variants(body: TokenStream) -> TokenStream {
    let mut begins = true;
    let keep = |token: &TokenTree| {
        let is_name = begins && matches!(token, TokenTree::Ident(_));
        begins = match token {
            TokenTree::Punct(punct) => punct.as_char() == ',' || (begins && punct.as_char() == '#'),
            // Attributes come before the name.
            TokenTree::Group(group) => begins && group.delimiter() == Delimiter::Bracket,
            _ => false,
        };
        !is_name
    };
    body.into_iter().filter(keep).collect()
}

fn is_punct(token: Option<&TokenTree>, mark: char) -> bool {
    matches!(token, Some(TokenTree::Punct(punct)) if punct.as_char() == mark)
}

/// Whether `::` is at an index.
fn is_separator(tokens: &[TokenTree], at: usize) -> bool {
    is_punct(tokens.get(at), ':') && is_punct(tokens.get(at + 1), ':')
}

/// Whether an attribute's brackets hold `cfg(test)`, `cfg(all(test, …))` or `test`.
fn is_test(attribute: &TokenTree) -> bool {
    let text: String = attribute.to_string().chars().filter(|c| !c.is_whitespace()).collect();
    text == "[cfg(test)]" || text == "[test]" || text.starts_with("[cfg(all(test,")
}

/// Index behind the item that begins at `at`, perhaps with further attributes.
fn after_item(tokens: &[TokenTree], mut at: usize) -> usize {
    while let Some(token) = tokens.get(at) {
        at += 1;
        let is_body = matches!(token, TokenTree::Group(group) if group.delimiter() == Delimiter::Brace);
        let is_use = is_body && is_punct(tokens.get(at), ';');
        if (is_body && !is_use) || is_punct(Some(token), ';') {
            break;
        }
    }
    at
}

/// Whether the tokens before an item end in `pub` or `pub(…)`.
fn is_public(before: &[TokenTree]) -> bool {
    let is_pub = |token: Option<&TokenTree>| matches!(token, Some(TokenTree::Ident(word)) if word == "pub");
    let is_scope =
        matches!(before.last(), Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Parenthesis);
    is_pub(before.last()) || is_scope && is_pub(before.len().checked_sub(2).and_then(|at| before.get(at)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Descriptions of the rings of a crate, given by its files.
    fn found(files: &[(&str, &str)]) -> Vec<String> {
        let source =
            |path: &Path| files.iter().find(|(name, _)| Path::new(name) == path).map(|(_, text)| (*text).to_owned());
        let modules = Modules::read(Path::new("lib.rs"), &source).unwrap();
        let name = |file: &Path| file.display().to_string();
        rings(&modules.uses()).iter().map(|ring| described(ring, &name)).collect()
    }

    #[test]
    fn two_files_that_use_each_other_are_a_ring() {
        let files = [
            ("lib.rs", "mod a;\nmod b;\nmod c;\n"),
            ("a.rs", "use crate::b::{self, B as Other};\npub struct A;\nfn f(b: Other) { b::g() }\n"),
            ("b.rs", "pub struct B;\npub fn g() -> Vec<super::a::A> { c() }\nfn c() {}\n"),
            ("c.rs", "use super::{a::A, b::B};\npub struct C(A, B);\n"),
        ];
        assert_eq!(found(&files), ["a.rs → b.rs (B), b.rs → a.rs (A)"]);
    }

    #[test]
    fn re_exports_lead_to_the_file_that_defines() {
        let lib = "mod a;\npub mod b;\npub use a::A;\npub use b::*;\n";
        let b = "mod deep;\npub use self::deep::{Deep, helper};\npub(crate) use deep::Hidden;\n";
        let deep = "use crate::A;\npub struct Deep(A);\npub struct Hidden;\npub fn helper() {}\n";
        let rings = |a: &str| found(&[("lib.rs", lib), ("a.rs", a), ("b/mod.rs", b), ("b/deep.rs", deep)]);
        let expected = "a.rs → b/deep.rs (Deep), b/deep.rs → a.rs (A)";
        assert_eq!(rings("pub struct A(crate::b::Deep);"), [expected]);
        assert_eq!(rings("use crate::Deep;\npub struct A;"), [expected], "through a glob");
        assert_eq!(
            rings("pub struct A;\nfn f() { println!(\"{}\", crate::b::Hidden); }"),
            [expected.replace("(Deep)", "(Hidden)")]
        );
        assert_eq!(
            rings("use crate::b;\npub struct A;\nfn f() { b::helper() }"),
            [expected.replace("(Deep)", "(helper)")]
        );
        assert_eq!(rings("use crate::b;\npub struct A;"), [""; 0], "a module is no item");
        assert_eq!(rings("pub struct A;"), [""; 0]);
    }

    #[test]
    fn a_parent_counts_where_its_own_code_uses_a_child() {
        let rings =
            |lib: &str| found(&[("lib.rs", lib), ("a.rs", "use super::Own;\npub struct A(Own);\npub fn f() {}")]);
        assert_eq!(rings("mod a;\npub use a::A;\npub struct Own;"), [""; 0]);
        assert_eq!(
            rings("mod a;\npub use a::A;\npub struct Own;\nfn g(a: A) {}"),
            ["a.rs → lib.rs (Own), lib.rs → a.rs (A)"]
        );
        assert_eq!(rings("mod a;\npub struct Own;\nfn g() { a::f() }"), ["a.rs → lib.rs (Own), lib.rs → a.rs (f)"]);
        assert_eq!(rings("mod a;\npub struct Own;\nfn g(a: u8) { a }"), [""; 0], "a variable with a module's name");
        assert_eq!(
            rings("mod a;\nuse a::A;\nmod own { pub struct Own(super::A); }\nuse own::Own;").len(),
            1,
            "an inline module"
        );
    }

    #[test]
    fn tests_comments_strings_and_other_crates_do_not_count() {
        let a = |text: &str| {
            let files = [("lib.rs", "mod a;\nmod b;"), ("a.rs", text), ("b.rs", "pub struct B(crate::a::A);")];
            found(&files)
        };
        assert_eq!(a("pub struct A;\n#[cfg(test)]\nmod tests {\n    use crate::b::B;\n}\n"), [""; 0]);
        assert_eq!(a("pub struct A;\n#[cfg(test)]\n#[allow(unused)]\nuse crate::{b::B};\n"), [""; 0]);
        assert_eq!(a("pub struct A;\n#[cfg(test)]\nfn f(b: crate::b::B) {}\nfn g() {}\n"), [""; 0]);
        assert_eq!(a("/// [`crate::b::B`]\npub struct A; // crate::b::B\nconst C: &str = \"crate::b::B\";"), [""; 0]);
        assert_eq!(a("pub use crate::b::B;\npub enum A { #[doc = \"\"] B { x: u8 }, C }"), [""; 0], "a variant");
        assert_eq!(a("pub use crate::b::B;\npub enum A { C(B) }").len(), 1);
        assert_eq!(a("use other::b::B;\npub struct A(B, std::b::B);"), [""; 0]);
        assert_eq!(a("#[cfg(feature = \"f\")]\nuse crate::b::B;\npub struct A(B);").len(), 1);
    }

    #[test]
    fn rings_of_three_are_found_without_those_who_only_use_them() {
        let files = [
            ("lib.rs", "mod a;\nmod b;\nmod c;\nmod d;\n"),
            ("a.rs", "use crate::b::B;\npub struct A(B);"),
            ("b.rs", "use crate::c::C;\npub struct B(C);"),
            ("c.rs", "use crate::a::A;\npub struct C(Box<A>);"),
            ("d.rs", "use crate::a::A;\npub struct D(A);"),
        ];
        assert_eq!(found(&files), ["a.rs → b.rs (B), b.rs → c.rs (C), c.rs → a.rs (A)"]);
    }
}
