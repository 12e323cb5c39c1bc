//! How USD writes values.

use std::fmt::{Display, Write};

/// A line `declaration = [values]` with what stands in brackets behind it.
pub fn array(declaration: &str, metadata: &str, values: impl Iterator<Item = impl Display>) -> String {
    let mut text = format!("{declaration} = [");
    for (index, value) in values.enumerate() {
        let separator = if index == 0 { "" } else { ", " };
        write!(text, "{separator}{value}").expect("a String takes any text");
    }
    text + "]" + metadata + "\n"
}

/// Brackets behind an attribute: where its values lie on the mesh.
pub fn interpolation(kind: &str) -> String {
    format!(" (\n    interpolation = \"{kind}\"\n)")
}

/// Shortest decimals that give the same floats back.
pub fn triple([x, y, z]: [f32; 3]) -> String {
    format!("({x}, {y}, {z})")
}

/// A matrix by its columns: USD's vectors are rows.
pub fn matrix(columns: [[f32; 4]; 4]) -> String {
    let row = |[x, y, z, w]: [f32; 4]| format!("({x}, {y}, {z}, {w})");
    format!("( {} )", columns.map(row).join(", "))
}

/// The path of a file beside the stage.
pub fn asset(name: &str) -> String {
    // In a name between single @, an @ would end it; between triple ones a triple one is escaped.
    match name.contains('@') {
        true => format!("@@@./{}@@@", name.replace("@@@", "\\@@@")),
        false => format!("@./{name}@"),
    }
}

/// Indents every line by one level; brackets of metadata, too.
pub fn indented(text: &str) -> String {
    text.lines().map(|line| if line.is_empty() { "\n".to_owned() } else { format!("    {line}\n") }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_with_an_at_sign_are_quoted() {
        assert_eq!(asset("a b.exr"), "@./a b.exr@");
        assert_eq!(asset("a@b@@@.exr"), "@@@./a@b\\@@@.exr@@@");
    }
}
