//! Compares the public items with `public_items.txt`.
#![allow(clippy::unwrap_used)]

use std::fmt::Write;

const SOURCE: &str = include_str!("../src/lib.rs");
const SNAPSHOT: &str = include_str!("../public_items.txt");

#[test]
fn public_items_are_those_of_the_snapshot() {
    let mut items = public_items(SOURCE);
    items.sort();
    let listed = items.iter().fold(String::new(), |mut text, item| {
        writeln!(text, "{item}").unwrap();
        text
    });
    assert!(listed == SNAPSHOT, "the public items changed; if intended, public_items.txt becomes:\n{listed}");
}

#[test]
fn reads_re_exports_of_modules_and_groups() {
    let source = "pub use a::B;\n/// Doc.\npub mod c {\n    pub use d::{\n        E, f as g,\n    };\n}\nuse h::I;\n";
    assert_eq!(public_items(source), ["B", "c::E", "c::g"]);
}

/// Returns the paths of the items that `source` re-exports at its top level and in its public modules.
fn public_items(source: &str) -> Vec<String> {
    let code: String =
        source.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let (mut module, mut items) = (String::new(), Vec::new());
    let mut rest = code.as_str();
    while let Some(start) = rest.find("pub ") {
        if rest[..start].ends_with("}\n\n") {
            module.clear();
        }
        rest = &rest[start + 4..];
        if let Some(name) = rest.strip_prefix("mod ") {
            module = format!("{}::", name.split([' ', ';']).next().unwrap());
        } else if let Some(path) = rest.strip_prefix("use ") {
            let path = path.split(';').next().unwrap();
            let names = path.split_once('{').map_or_else(|| path.rsplit("::").next().unwrap(), |(_, names)| names);
            let names = names.trim_end_matches('}').split(',').map(str::trim).filter(|name| !name.is_empty());
            items.extend(names.map(|name| format!("{module}{}", name.rsplit(" as ").next().unwrap())));
        } else {
            panic!("neither a module nor a re-export: {}", rest.lines().next().unwrap());
        }
    }
    items
}
