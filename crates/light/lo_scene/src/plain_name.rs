//! Names of files and objects that read as what they are.

/// Returns whether a character is not displayed itself, or reorders its neighbours.
///
/// These are control characters, soft hyphens, zero-width characters, line separators, bidirectional formatting
/// characters, byte order marks, variation selectors and tags.
pub fn is_invisible(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{ad}'
            | '\u{34f}'
            | '\u{61c}'
            | '\u{115f}'..='\u{1160}'
            | '\u{17b4}'..='\u{17b5}'
            | '\u{180b}'..='\u{180f}'
            | '\u{200b}'..='\u{200f}'
            | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}'
            | '\u{3164}'
            | '\u{fe00}'..='\u{fe0f}'
            | '\u{feff}'
            | '\u{ffa0}'
            | '\u{fff0}'..='\u{fffb}'
            | '\u{1d173}'..='\u{1d17a}'
            | '\u{e0000}'..='\u{e0fff}')
}

/// Returns a name without [invisible](is_invisible) characters and outer spaces. May be empty.
pub fn plain_name(name: &str) -> String {
    let visible: String = name.chars().filter(|&c| !is_invisible(c)).collect();
    visible.trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invisible_characters_are_dropped() {
        for (name, plain) in [
            ("sofa.glb", "sofa.glb"),
            ("Küche – 居間.jpg", "Küche – 居間.jpg"),
            // Shown as "sofajpg.obj" by browsers and terminals.
            ("sofa\u{202e}jbo.gpj", "sofajbo.gpj"),
            ("a\u{200b}b\u{feff}\u{ad}c\u{2066}", "abc"),
            ("line\n\u{2028}\u{1b}[31m", "line[31m"),
            ("\u{200d}\u{e0061} \u{3164}", ""),
        ] {
            assert_eq!(plain_name(name), plain);
        }
    }
}
