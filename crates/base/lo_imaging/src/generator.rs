//! Embeds the name of the writing program in image files.

/// Default name of the writing program.
pub const GENERATOR: &str = "lightoctree";

/// Reduces a name to printable ASCII, which every format can store; other characters become question marks.
pub(crate) fn printable(generator: &str) -> String {
    generator.chars().map(|c| if (' '..='~').contains(&c) { c } else { '?' }).collect()
}

/// Length of a PNG's signature and IHDR chunk, after which a text chunk may follow.
const PNG_HEAD: usize = 8 + 25;

/// Inserts a `Software` text chunk (PNG 1.2, 11.3.4.3) after the header of an encoded PNG.
pub(crate) fn mark_png(png: &mut Vec<u8>, generator: &str) {
    let mut chunk = b"tEXtSoftware\0".to_vec();
    chunk.extend(printable(generator).bytes());
    let length = (chunk.len() - 4) as u32;
    let crc = crc32fast::hash(&chunk);
    let bytes = length.to_be_bytes().into_iter().chain(chunk).chain(crc.to_be_bytes());
    png.splice(PNG_HEAD..PNG_HEAD, bytes);
}

/// Inserts a comment segment (ITU-T T.81, B.2.4.5) after the JFIF header of an encoded JPEG.
pub(crate) fn mark_jpeg(jpeg: &mut Vec<u8>, generator: &str) {
    let text = printable(generator).into_bytes();
    let at = match jpeg.get(2..6) {
        Some(&[0xff, 0xe0, high, low]) => 4 + usize::from(u16::from_be_bytes([high, low])),
        _ => 2,
    };
    let length = (text.len() + 2) as u16;
    let segment = [0xff, 0xfe].into_iter().chain(length.to_be_bytes()).chain(text);
    jpeg.splice(at..at, segment);
}
