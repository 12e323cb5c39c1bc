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
    let mut text = b"Software\0".to_vec();
    text.extend(printable(generator).bytes());
    insert_chunk(png, *b"tEXt", &text);
}

/// Inserts a chunk after the header of an encoded PNG.
pub(crate) fn insert_chunk(png: &mut Vec<u8>, name: [u8; 4], data: &[u8]) {
    let chunk = [&name, data].concat();
    let length = (data.len() as u32).to_be_bytes();
    let crc = crc32fast::hash(&chunk).to_be_bytes();
    png.splice(PNG_HEAD..PNG_HEAD, length.into_iter().chain(chunk).chain(crc));
}

/// Inserts a comment segment (ITU-T T.81, B.2.4.5) after the JFIF header of an encoded JPEG.
pub(crate) fn mark_jpeg(jpeg: &mut Vec<u8>, generator: &str) {
    insert_segment(jpeg, 0xfe, printable(generator).as_bytes());
}

/// Inserts a segment after the JFIF header of an encoded JPEG. Its payload has at most 65,533 bytes.
pub(crate) fn insert_segment(jpeg: &mut Vec<u8>, marker: u8, payload: &[u8]) {
    let at = match jpeg.get(2..6) {
        Some(&[0xff, 0xe0, high, low]) => 4 + usize::from(u16::from_be_bytes([high, low])),
        _ => 2,
    };
    let length = (payload.len() + 2) as u16;
    let segment = [0xff, marker].into_iter().chain(length.to_be_bytes()).chain(payload.iter().copied());
    jpeg.splice(at..at, segment);
}
