//! The segments of a JPEG file (ITU-T T.81, annex B), as far as decoders leave them to their callers.

/// A JPEG file's application segments and its end.
pub(crate) struct JpegSegments<'a> {
    /// Markers (0xE0 to 0xEF) and payloads, in the file's order.
    pub applications: Vec<(u8, &'a [u8])>,
    /// Position behind the end-of-image marker; `None` if the file ends before it.
    pub end: Option<usize>,
}

impl<'a> JpegSegments<'a> {
    /// Walks over the segments of a file. Damaged lengths end the walk.
    pub fn read(bytes: &'a [u8]) -> Self {
        let mut found = Self { applications: Vec::new(), end: None };
        let mut at = 2;
        while let Some(marker) = next_marker(bytes, &mut at) {
            match marker {
                0xd9 => {
                    found.end = Some(at);
                    break;
                }
                // markers without a payload: TEM, restarts, a repeated SOI
                0x01 | 0xd0..=0xd8 => continue,
                _ => {}
            }
            let length = bytes.get(at..at + 2).map(|b| usize::from(u16::from_be_bytes([b[0], b[1]])));
            let Some(payload) = length.filter(|l| *l >= 2).and_then(|l| bytes.get(at + 2..at + l)) else { break };
            at += payload.len() + 2;
            if (0xe0..=0xef).contains(&marker) {
                found.applications.push((marker, payload));
            }
        }
        found
    }

    /// Returns the payloads of application segments with this marker that begin with `prefix`, without it.
    pub fn with_prefix(&self, marker: u8, prefix: &[u8]) -> impl Iterator<Item = &'a [u8]> {
        let segments = self.applications.iter().filter(move |(m, _)| *m == marker);
        segments.filter_map(move |(_, payload)| payload.strip_prefix(prefix))
    }

    /// Returns the XMP packet (Adobe XMP specification, part 3, 1.1.3).
    pub fn xmp(&self) -> Option<&'a [u8]> {
        self.with_prefix(0xe1, b"http://ns.adobe.com/xap/1.0/\0").next()
    }
}

/// Moves behind the next marker, over entropy-coded data and fill bytes, and returns it.
fn next_marker(bytes: &[u8], at: &mut usize) -> Option<u8> {
    loop {
        *at += bytes.get(*at..)?.iter().position(|b| *b == 0xff)?;
        *at += bytes[*at..].iter().position(|b| *b != 0xff)?;
        let marker = bytes[*at];
        *at += 1;
        // 0xff 0x00 is a data byte
        if marker != 0 {
            return Some(marker);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn segments_and_end_are_found() {
        let mut jpeg = vec![0xff, 0xd8, 0xff, 0xe1, 0, 6, b'a', b'b', b'c', b'd'];
        // a scan with a stuffed byte, a restart and a fill byte before the end
        jpeg.extend([0xff, 0xda, 0, 2, 1, 2, 0xff, 0, 0xff, 0xd3, 7, 0xff, 0xff, 0xd9]);
        let end = jpeg.len();
        jpeg.extend([0xff, 0xd8, 0xff, 0xd9]);
        let found = JpegSegments::read(&jpeg);
        assert_eq!(found.end, Some(end));
        assert_eq!(found.with_prefix(0xe1, b"ab").next(), Some(&b"cd"[..]));
        assert_eq!(JpegSegments::read(&jpeg[..end - 2]).end, None);
        for length in 0..jpeg.len() {
            JpegSegments::read(&jpeg[..length]);
        }
    }
}
