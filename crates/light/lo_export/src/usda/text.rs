//! Text syntax of USD values.

use std::fmt::{Display, Write};

/// Returns a line `declaration = [values]`, followed by `metadata` in parentheses.
pub fn array(declaration: &str, metadata: &str, values: impl Iterator<Item = impl Display>) -> String {
    let mut text = format!("{declaration} = [");
    for (index, value) in values.enumerate() {
        let separator = if index == 0 { "" } else { ", " };
        write!(text, "{separator}{value}").expect("a String takes any text");
    }
    text + "]" + metadata + "\n"
}

/// Returns metadata with the interpolation of an attribute's values on a mesh.
pub fn interpolation(kind: &str) -> String {
    format!(" (\n    interpolation = \"{kind}\"\n)")
}

/// Formats a tuple with the shortest decimals that round-trip.
pub fn triple([x, y, z]: [f32; 3]) -> String {
    format!("({x}, {y}, {z})")
}

/// Formats a matrix by its columns: USD's vectors are rows.
pub fn matrix(columns: [[f32; 4]; 4]) -> String {
    let row = |[x, y, z, w]: [f32; 4]| format!("({x}, {y}, {z}, {w})");
    format!("( {} )", columns.map(row).join(", "))
}

/// Returns the asset path of a file beside the stage.
pub fn asset(name: &str) -> String {
    // Between single @, an @ in the name would end it; between triple ones, a triple @ is escaped.
    match name.contains('@') {
        true => format!("@@@./{}@@@", name.replace("@@@", "\\@@@")),
        false => format!("@./{name}@"),
    }
}

/// Indents every line by one level, including parentheses of metadata.
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
