//! JPEG XL photos (ISO/IEC 18181): bare codestreams, and files of boxes.

use std::borrow::Cow;
use std::io::Read;

use brotli_decompressor::Decompressor;
use image::{DynamicImage, ImageBuffer, Pixel, Primitive, Rgb, Rgba};
use jxl_oxide::color::{ColourEncoding, ColourSpace, WhitePoint};
use jxl_oxide::image::BitDepth;
use jxl_oxide::{
    AllocTracker, EnumColourEncoding, FrameBufferSample, ImageStream, InitializeResult, JxlImage, RenderingIntent,
};

use crate::encoded_image::EncodedImage;
use crate::source_color::{self, SourceColor};
use crate::stored_photo::{StoredPhoto, usable_color};
use crate::{ImageError, PhotoNote};

/// First bytes of a codestream.
const CODESTREAM: [u8; 2] = [0xff, 0x0a];

/// Most bytes of EXIF or XMP, compressed or not.
const MOST_METADATA: u64 = 16 << 20;

/// Most bytes that the decoder allocates before the size of the image is known.
const HEADER_BYTES: usize = 64 << 20;

/// Most bytes that the decoder allocates for a pixel: planes of 32 bits, their coefficients, and alpha. A photo of
/// 12 megapixels takes 50.
const BYTES_PER_PIXEL: usize = 128;

/// Reads the first frame, upright, with its colour space and metadata.
pub(crate) fn photo(source: EncodedImage, notes: &mut Vec<PhotoNote>) -> Result<StoredPhoto, ImageError> {
    let boxes = Boxes::read(source.bytes);
    let mut image = open(source, &boxes.codestream)?;
    let color = match depth_of(&image) {
        // `pixels` requests linear Rec. 709 of the decoder
        SampleDepth::Float => SourceColor::Srgb,
        SampleDepth::Eight | SampleDepth::Sixteen => usable_color(color_of(&image), notes),
    };
    Ok(StoredPhoto { pixels: pixels(source, &mut image)?, color, exif: boxes.exif, xmp: boxes.xmp, gain_map: None })
}

/// Decodes the first frame, upright, with alpha if it has some: 8 or 16 bits, or float in linear Rec. 709.
pub(crate) fn samples(source: EncodedImage) -> Result<DynamicImage, ImageError> {
    pixels(source, &mut open(source, &Boxes::read(source.bytes).codestream)?)
}

/// Returns width and height before rotation.
pub(crate) fn size(source: EncodedImage) -> Result<[u32; 2], ImageError> {
    let image = open(source, &Boxes::read(source.bytes).codestream)?;
    let size = &image.image_header().size;
    Ok([size.width, size.height])
}

/// Parses the headers, and checks the image's size.
fn open(source: EncodedImage, codestream: &[u8]) -> Result<JxlImage, ImageError> {
    let tracker = AllocTracker::with_limit(HEADER_BYTES);
    let mut header = JxlImage::builder().alloc_tracker(tracker.clone()).build_uninit();
    header.feed_bytes(codestream).map_err(|e| source.invalid(e))?;
    let InitializeResult::Initialized(mut image) = header.try_init().map_err(|e| source.invalid(e))? else {
        return Err(source.invalid("the file is cut off"));
    };
    let (width, height) = (image.width(), image.height());
    source.check_size(width.into(), height.into())?;
    tracker.expand_limit(BYTES_PER_PIXEL * width as usize * height as usize);
    image.finalize().map_err(|e| source.invalid(e))?;
    Ok(image)
}

fn pixels(source: EncodedImage, image: &mut JxlImage) -> Result<DynamicImage, ImageError> {
    if image.pixel_format().has_black() {
        return Err(source.unsupported("CMYK"));
    }
    if image.num_loaded_keyframes() == 0 {
        return Err(source.invalid("the file is cut off"));
    }
    let depth = depth_of(image);
    if depth == SampleDepth::Float {
        let mut linear = EnumColourEncoding::srgb_linear(RenderingIntent::Relative);
        if image.pixel_format().is_grayscale() {
            linear.colour_space = ColourSpace::Grey;
        }
        image.request_color_encoding(linear);
    }
    let render = image.render_frame(0).map_err(|e| source.invalid(e))?;
    let stream = render.stream();
    match depth {
        SampleDepth::Eight => assemble::<u8>(stream),
        SampleDepth::Sixteen => assemble::<u16>(stream),
        SampleDepth::Float => assemble::<f32>(stream),
    }
    .ok_or_else(|| source.invalid("the image has fewer samples than pixels"))
}

/// Form in which samples are decoded.
#[derive(Clone, Copy, PartialEq, Eq)]
enum SampleDepth {
    Eight,
    Sixteen,
    /// Linear Rec. 709, above 1 where brighter than white.
    Float,
}

/// Returns float for floating-point images, except HDR video's curves, whose range 16 bits hold, and colour spaces
/// that only a profile describes, which the decoder does not convert.
fn depth_of(image: &JxlImage) -> SampleDepth {
    let metadata = &image.image_header().metadata;
    let is_convertible = metadata.xyb_encoded || matches!(metadata.colour_encoding, ColourEncoding::Enum(_));
    match metadata.bit_depth {
        BitDepth::IntegerSample { bits_per_sample: ..=8 } => SampleDepth::Eight,
        BitDepth::FloatSample { .. } if is_convertible && image.hdr_type().is_none() => SampleDepth::Float,
        _ => SampleDepth::Sixteen,
    }
}

/// Determines the colour space of integer samples.
fn color_of(image: &JxlImage) -> Result<SourceColor, &'static str> {
    let is_d65 = match &image.image_header().metadata.colour_encoding {
        ColourEncoding::Enum(encoding) => matches!(encoding.white_point, WhitePoint::D65),
        ColourEncoding::IccProfile(_) => true,
    };
    match image.rendered_cicp() {
        Some([primaries, transfer, ..]) if is_d65 => {
            source_color::of_code_points(primaries, transfer).ok_or("its code points are reserved")
        }
        _ => source_color::of_icc(&image.rendered_icc()),
    }
}

/// Assembles RGB, or RGBA if the image has alpha; grey is repeated.
fn assemble<T>(mut stream: ImageStream) -> Option<DynamicImage>
where
    T: FrameBufferSample + Primitive,
    Rgb<T>: Pixel<Subpixel = T>,
    Rgba<T>: Pixel<Subpixel = T>,
    DynamicImage: From<ImageBuffer<Rgb<T>, Vec<T>>> + From<ImageBuffer<Rgba<T>, Vec<T>>>,
{
    let (width, height, channels) = (stream.width(), stream.height(), stream.channels() as usize);
    let mut samples = vec![T::zero(); width as usize * height as usize * channels];
    if stream.write_to_buffer(&mut samples) < samples.len() {
        return None;
    }
    let has_alpha = channels % 2 == 0;
    if channels < 3 {
        let repeat = |pixel: &[T]| [&[pixel[0]; 3], &pixel[1..]].concat();
        samples = samples.chunks_exact(channels).flat_map(repeat).collect();
    }
    if has_alpha {
        ImageBuffer::<Rgba<T>, _>::from_raw(width, height, samples).map(DynamicImage::from)
    } else {
        ImageBuffer::<Rgb<T>, _>::from_raw(width, height, samples).map(DynamicImage::from)
    }
}

/// Codestream and metadata of a file.
///
/// The decoder reads boxes itself, but inflates compressed ones without a limit.
struct Boxes<'a> {
    codestream: Cow<'a, [u8]>,
    /// A TIFF structure.
    exif: Option<Vec<u8>>,
    xmp: Option<Vec<u8>>,
}

impl<'a> Boxes<'a> {
    /// Reads the boxes up to the first damage.
    fn read(bytes: &'a [u8]) -> Self {
        let mut boxes = Self { codestream: Cow::Borrowed(&[]), exif: None, xmp: None };
        if bytes.starts_with(&CODESTREAM) {
            boxes.codestream = Cow::Borrowed(bytes);
            return boxes;
        }
        let mut rest = bytes;
        while let Some((kind, content, after)) = next_box(rest) {
            match kind {
                b"jxlc" => boxes.codestream = Cow::Borrowed(content),
                // four bytes count the parts
                b"jxlp" => boxes.codestream.to_mut().extend_from_slice(content.get(4..).unwrap_or_default()),
                b"brob" => {
                    if let Some((kind @ (b"Exif" | b"xml "), compressed)) = content.split_first_chunk()
                        && let Some(content) = inflate(compressed)
                    {
                        boxes.keep(kind, &content);
                    }
                }
                kind => boxes.keep(kind, content),
            }
            rest = after;
        }
        boxes
    }

    /// Keeps the first EXIF and XMP.
    fn keep(&mut self, kind: &[u8; 4], content: &[u8]) {
        if content.len() as u64 > MOST_METADATA {
            return;
        }
        match kind {
            b"Exif" if self.exif.is_none() => {
                let tiff = content
                    .split_first_chunk()
                    .and_then(|(&offset, payload)| payload.get(usize::try_from(u32::from_be_bytes(offset)).ok()?..));
                self.exif = tiff.map(<[u8]>::to_vec);
            }
            b"xml " if self.xmp.is_none() => self.xmp = Some(content.to_vec()),
            _ => {}
        }
    }
}

/// Splits the first box off: its type, its content, and what follows it. A box may be cut off.
fn next_box(bytes: &[u8]) -> Option<(&[u8; 4], &[u8], &[u8])> {
    let (&size, rest) = bytes.split_first_chunk()?;
    let (kind, rest) = rest.split_first_chunk()?;
    let (length, rest) = match u32::from_be_bytes(size) {
        0 => (rest.len(), rest),
        1 => {
            let (&size, rest) = rest.split_first_chunk()?;
            (usize::try_from(u64::from_be_bytes(size)).ok()?.checked_sub(16)?, rest)
        }
        size => (usize::try_from(size).ok()?.checked_sub(8)?, rest),
    };
    let (content, after) = rest.split_at(length.min(rest.len()));
    Some((kind, content, after))
}

/// Inflates Brotli; `None` if it is damaged or longer than [`MOST_METADATA`].
fn inflate(compressed: &[u8]) -> Option<Vec<u8>> {
    let mut content = Vec::new();
    let length = Decompressor::new(compressed, 4096).take(MOST_METADATA + 1).read_to_end(&mut content).ok()?;
    (length as u64 <= MOST_METADATA).then_some(content)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn boxes_of_each_length_are_split() {
        let long = [&[0, 0, 0, 1][..], b"jxlc", &18u64.to_be_bytes(), b"ab"].concat();
        let short = b"\0\0\0\x0axml cd";
        let last = b"\0\0\0\0Exif\0\0\0\x01xyz";
        let file = [&long[..], short, last].concat();
        let boxes = Boxes::read(&file);
        assert_eq!(&boxes.codestream[..], b"ab");
        assert_eq!((boxes.xmp.as_deref(), boxes.exif.as_deref()), (Some(&b"cd"[..]), Some(&b"yz"[..])));
        for damaged in [&b"\0\0\0\x07jxlc"[..], b"\0\0\0\x01jxlc\0\0\0\0\0\0\0\x0f", b"\0\0"] {
            assert!(Boxes::read(damaged).codestream.is_empty());
        }
    }

    #[test]
    fn metadata_is_inflated_up_to_a_limit() {
        // 2²⁴ zeros, and one more, by Google's encoder
        let most =
            b"\xcb\xff\xff\x3f\x00\x24\x00\xe2\xb1\x40\x72\xef\xff\xf8\xff\xff\x07\x80\x04\x40\x1c\x16\x80\xee\xfd\xdf";
        let one_more = b"\xcb\xff\xff\x3f\x00\x24\x00\xe2\xb1\x40\x72\xef\xff\xf8\xff\xff\x07\x80\x04\x40\x1c\x16\x80\xee\xfd\x1f\x00\x00\x02\x00\x03";
        assert_eq!(inflate(most).unwrap().len(), 1 << 24);
        assert!(inflate(one_more).is_none() && inflate(b"\xff\xff\xff").is_none());
    }
}
