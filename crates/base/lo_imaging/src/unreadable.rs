//! Formats that are recognised in order to name the way out.

use std::path::Path;

/// A format that is not read.
pub(crate) struct Unreadable {
    /// Its name.
    pub format: &'static str,
    /// Advice how to convert it.
    pub way_out: &'static str,
}

const AVIF: Unreadable = Unreadable {
    format: "AVIF",
    way_out: "convert it: `avifdec in.avif out.png` (libavif) or `ffmpeg -i in.avif out.png`",
};

const RAW: Unreadable = Unreadable {
    format: "camera raw",
    way_out: "develop it to a 16-bit TIFF, for example with darktable or RawTherapee",
};

const JPEG_2000: Unreadable = Unreadable { format: "JPEG 2000", way_out: "convert it: `ffmpeg -i in.jp2 out.png`" };

const VIDEO: Unreadable =
    Unreadable { format: "video", way_out: "extract a frame: `ffmpeg -ss 2 -i in.mp4 -frames:v 1 -q:v 1 out.jpg`" };

const VECTOR: Unreadable = Unreadable { format: "PDF or SVG", way_out: "render it to PNG" };

const LAYERED: Unreadable =
    Unreadable { format: "Photoshop or GIMP", way_out: "export it flattened as TIFF or PNG, with its colour profile" };

/// Recognises a format that is not read, by content, and camera raw files that are TIFF also by their extension.
pub(crate) fn recognise(bytes: &[u8], name: &str) -> Option<Unreadable> {
    let starts = |magic: &[u8]| bytes.starts_with(magic);
    let brand = (bytes.get(4..8) == Some(b"ftyp")).then(|| bytes.get(8..12)).flatten();
    let extension = Path::new(name).extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let is_tiff = starts(b"II*\0") || starts(b"MM\0*");
    match brand {
        Some(b"avif" | b"avis") => return Some(AVIF),
        Some(b"mif1" | b"mif2" | b"msf1") if is_compatible(bytes, b"avif") => return Some(AVIF),
        Some(b"heic" | b"heix" | b"heim" | b"heis" | b"hevc" | b"hevx" | b"mif1" | b"mif2" | b"msf1") => return None,
        Some(b"crx ") => return Some(RAW),
        Some(_) => return Some(VIDEO),
        None => {}
    }
    Some(match bytes {
        _ if starts(b"\0\0\0\x0cjP  \r\n\x87\n") || starts(&[0xff, 0x4f, 0xff, 0x51]) => JPEG_2000,
        _ if starts(b"\x1a\x45\xdf\xa3") || (starts(b"RIFF") && bytes.get(8..12) == Some(b"AVI ")) => VIDEO,
        _ if starts(b"%PDF") || starts(b"<svg") => VECTOR,
        _ if starts(b"8BPS") || starts(b"gimp xcf") => LAYERED,
        _ if starts(b"FUJIFILMCCD-RAW")
            || starts(b"IIU\0")
            || starts(b"IIRO")
            || bytes.get(8..10) == Some(b"CR") && is_tiff =>
        {
            RAW
        }
        _ if is_tiff && (RAW_EXTENSIONS.contains(&extension.as_str()) || has_dng_version(bytes)) => RAW,
        _ => return None,
    })
}

/// Whether the list of brands at the start of an ISO base media file has one.
fn is_compatible(bytes: &[u8], brand: &[u8; 4]) -> bool {
    let size = bytes.first_chunk().map_or(0, |&size| u32::from_be_bytes(size) as usize);
    bytes[..size.min(bytes.len())].as_chunks().0.iter().skip(4).any(|listed| listed == brand)
}

/// Extensions of camera raw files with the structure of TIFF.
const RAW_EXTENSIONS: [&str; 10] = ["dng", "nef", "nrw", "arw", "sr2", "cr2", "pef", "srw", "3fr", "iiq"];

/// Whether the first directory of a TIFF has the tag DNGVersion (DNG 1.7, 50706); it holds a thumbnail then.
fn has_dng_version(bytes: &[u8]) -> bool {
    let Ok(mut decoder) = tiff::decoder::Decoder::new(std::io::Cursor::new(bytes)) else { return false };
    decoder.find_tag(tiff::tags::Tag::Unknown(50706)).is_ok_and(|tag| tag.is_some())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn formats_are_named_with_a_way_out() {
        let ftyp = |brand: &str| format!("\0\0\0\x18ftyp{brand}\0\0\0\0").into_bytes();
        for (bytes, name, expected) in [
            (ftyp("avif"), "a", "AVIF"),
            (b"\0\0\0\x18ftypmif1\0\0\0\0heicavif".to_vec(), "a.heif", "AVIF"),
            (ftyp("qt  "), "a.mov", "video"),
            (b"II*\0\x08\0\0\0".to_vec(), "a.NEF", "camera raw"),
            (b"8BPS\0\x01".to_vec(), "a.psd", "Photoshop or GIMP"),
        ] {
            assert_eq!(recognise(&bytes, name).unwrap().format, expected);
            let error = crate::photo_from_bytes(&bytes, name).unwrap_err().to_string();
            assert!(error.contains(expected) && error.contains(name), "{error}");
        }
        assert!(recognise(b"II*\0\x08\0\0\0", "a.tif").is_none());
        assert!(recognise(&ftyp("heic"), "a.heic").is_none() && recognise(&ftyp("mif1"), "a.heic").is_none());
        assert!(recognise(b"\x89PNG\r\n\x1a\n", "a.png").is_none());
    }
}
