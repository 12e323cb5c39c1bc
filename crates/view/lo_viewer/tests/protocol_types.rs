//! TypeScript declarations of the protocol for the page's type check: `page/protocol.d.ts`.

#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use lo_viewer::protocol::{FromPage, ToPage};
use ts_rs::{Config, TS, TypeVisitor};

const REWRITE: &str = "UPDATE_SNAPSHOTS=1 cargo test -p lo_viewer --features typescript --test protocol_types";

#[test]
fn the_declarations_of_the_page_match_the_protocol() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("page/protocol.d.ts");
    let mut declarations = Declarations::new();
    declarations.visit::<FromPage>();
    declarations.visit::<ToPage>();
    let text = declarations.file();
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        std::fs::write(&file, &text).unwrap();
    }
    let committed = std::fs::read_to_string(&file).unwrap_or_default();
    // Git may check the file out with other line ends.
    assert!(committed.replace("\r\n", "\n") == text, "page/protocol.d.ts is out of date; rewrite it with `{REWRITE}`");
}

/// Declarations of types and of all types that they refer to, by name.
struct Declarations {
    config: Config,
    by_name: BTreeMap<String, String>,
}

impl Declarations {
    fn new() -> Self {
        // JSON numbers.
        Self { config: Config::new().with_large_int("number"), by_name: BTreeMap::new() }
    }

    fn file(&self) -> String {
        let mut text = format!("// Generated from the protocol by the command\n// {REWRITE}\n");
        for declaration in self.by_name.values() {
            write!(text, "\n{declaration}").unwrap();
        }
        text
    }
}

impl TypeVisitor for Declarations {
    fn visit<T: TS + 'static + ?Sized>(&mut self) {
        // Types of the language have no file of their own.
        if T::output_path().is_none() || self.by_name.contains_key(&T::ident(&self.config)) {
            return;
        }
        let declaration = format!("{}export {}", T::docs().unwrap_or_default(), T::decl(&self.config));
        let declaration = declaration.lines().flat_map(|line| [line.trim_end(), "\n"]).collect();
        self.by_name.insert(T::ident(&self.config), declaration);
        T::visit_dependencies(self);
    }
}
