//! Values of XMP packets (ISO 16684-1).

/// Properties of one namespace in an XMP packet: attributes and elements, arrays included.
pub(crate) struct Xmp<'a> {
    document: roxmltree::Document<'a>,
}

/// Longest packet that is parsed, bytes.
const MAX_BYTES: usize = 1 << 20;

impl<'a> Xmp<'a> {
    /// Parses a packet. `None` if it is no well-formed XML.
    pub fn parse(packet: &'a [u8]) -> Option<Self> {
        let text = std::str::from_utf8(packet).ok()?.trim_matches(|c: char| c == '\0' || c.is_whitespace());
        let options = roxmltree::ParsingOptions { nodes_limit: 100_000, ..Default::default() };
        let document = (text.len() <= MAX_BYTES).then(|| roxmltree::Document::parse_with_options(text, options));
        Some(Self { document: document?.ok()? })
    }

    /// Returns the values of a property: one, or those of an array. Empty if the packet does not have it.
    pub fn values(&self, namespace: &str, name: &str) -> Vec<&str> {
        for node in self.document.descendants() {
            if let Some(value) = node.attribute((namespace, name)) {
                return vec![value.trim()];
            }
            if node.has_tag_name((namespace, name)) {
                let is_text =
                    |n: &roxmltree::Node<'_, '_>| n.is_text() && n.text().is_some_and(|t| !t.trim().is_empty());
                return node.descendants().filter(is_text).filter_map(|n| n.text()).map(str::trim).collect();
            }
        }
        Vec::new()
    }

    /// Returns a property with a single value.
    pub fn value(&self, namespace: &str, name: &str) -> Option<&str> {
        self.values(namespace, name).first().copied()
    }

    /// Returns a property with a finite number.
    pub fn number(&self, namespace: &str, name: &str) -> Option<f64> {
        self.value(namespace, name)?.parse().ok().filter(|v: &f64| v.is_finite())
    }
}

/// Replaces the value of `tiff:Orientation` in a packet by 1, upright.
pub(crate) fn with_upright_orientation(mut packet: Vec<u8>) -> Vec<u8> {
    for name in [&b"tiff:Orientation=\""[..], b"tiff:Orientation='", b"<tiff:Orientation>"] {
        let found = packet.windows(name.len()).position(|window| window == name).map(|at| at + name.len());
        if let Some(at) = found
            && packet.get(at).is_some_and(u8::is_ascii_digit)
        {
            packet[at] = b'1';
        }
    }
    packet
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn attributes_elements_and_arrays_are_read() {
        let packet = br#"<x:xmpmeta xmlns:x="adobe:ns:meta/"><r:RDF xmlns:r="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
            <r:Description xmlns:a="urn:a" a:One=" 1.5 "><a:Two>zwei</a:Two>
            <a:Three><r:Seq><r:li>1</r:li><r:li>2</r:li><r:li>3</r:li></r:Seq></a:Three></r:Description></r:RDF></x:xmpmeta>"#;
        let xmp = Xmp::parse(packet).unwrap();
        assert_eq!(xmp.number("urn:a", "One"), Some(1.5));
        assert_eq!(xmp.value("urn:a", "Two"), Some("zwei"));
        assert_eq!(xmp.values("urn:a", "Three"), ["1", "2", "3"]);
        assert_eq!(xmp.value("urn:b", "One"), None);
        assert!(Xmp::parse(b"<x").is_none());
    }

    #[test]
    fn orientation_becomes_upright() {
        let turned = |text: &str| String::from_utf8(with_upright_orientation(text.as_bytes().to_vec())).unwrap();
        assert_eq!(turned(r#"<a tiff:Orientation="6" b="6"/>"#), r#"<a tiff:Orientation="1" b="6"/>"#);
        assert_eq!(turned("<tiff:Orientation>8</tiff:Orientation>"), "<tiff:Orientation>1</tiff:Orientation>");
        assert_eq!(turned("<a/>"), "<a/>");
    }
}
