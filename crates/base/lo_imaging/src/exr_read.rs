//! OpenEXR decoding: scan lines and tiles, half, float and uint channels, several parts and layers.
//!
//! Supports every compression that the `exr` crate decodes: none, RLE, ZIP, ZIPS, PIZ, PXR24, B44, B44A, DWAA and DWAB.
//! The image is the data window; of several resolution levels the largest is read.

use std::io::Cursor;

use exr::block::UncompressedBlock;
use exr::block::reader::ChunksReader;
use exr::compression::Compression;
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Chromaticities, SampleType};
use exr::meta::header::Header;
use rayon::prelude::*;

use crate::chromaticity::rec709_from_primaries;
use crate::encoded_image::EncodedImage;
use crate::{DepthMap, ImageError, RadianceImage};

/// All channels of the first part of an OpenEXR file.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrChannels {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Name (`R`, or `layer.R`) and samples, row by row from the top, in the file's (alphabetical) order.
    pub channels: Vec<(String, Vec<f32>)>,
    /// Custom text attributes, sorted by name.
    pub metadata: Vec<(String, String)>,
}

/// Decodes the colour of the first part with `R G B`, else of the first with `Y`, else the only channel as grey.
///
/// Within a part, plain `R G B` precede a layer's `name.R name.G name.B`. Primaries other than Rec. 709 are converted.
pub(crate) fn decode_radiance(source: EncodedImage) -> Result<RadianceImage, ImageError> {
    let meta = read_meta(source)?;
    let first = |find: fn(&[String]) -> Option<Vec<usize>>| {
        meta.headers.iter().enumerate().find_map(|(part, h)| Some((part, find(&names(h))?)))
    };
    let found = first(rgb_channels).or_else(|| first(luminance_channel)).or_else(|| first(only_channel));
    let (part, channels) = found.ok_or_else(|| no_channel(source, &meta, "no R, G, B or Y channel"))?;
    let header = &meta.headers[part];
    let size = check(source, header)?;
    let to_rec709 = header.shared_attributes.chromaticities.as_ref().and_then(conversion);

    let mut pixels = vec![[0.0f32; 3]; size.area()];
    decode_part(source, part, &channels, size, |slot, index, value| match channels.len() {
        3 => pixels[index][slot] = value,
        _ => pixels[index] = [value; 3],
    })?;
    if let Some(matrix) = to_rec709.filter(|_| channels.len() == 3) {
        pixels.par_iter_mut().for_each(|p| *p = matrix.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2]));
    }
    Ok(RadianceImage::new(size.width(), size.height(), pixels))
}

/// Decodes a depth channel: `Z`, else one named depth or distance in any layer, else `Y`, `V` or `R`, else the only
/// one.
pub(crate) fn decode_depth(source: EncodedImage) -> Result<DepthMap, ImageError> {
    let meta = read_meta(source)?;
    let found = meta.headers.iter().enumerate().find_map(|(part, h)| Some((part, depth_channel(&names(h))?)));
    let (part, channel) = found.ok_or_else(|| no_channel(source, &meta, "no Z, depth, Y or R channel"))?;
    let size = check(source, &meta.headers[part])?;
    let mut depth = vec![0.0f32; size.area()];
    decode_part(source, part, &[channel], size, |_, index, value| depth[index] = value)?;
    Ok(DepthMap::new(size.width(), size.height(), depth))
}

pub(crate) fn decode_channels(source: EncodedImage) -> Result<ExrChannels, ImageError> {
    let meta = read_meta(source)?;
    let header = meta.headers.first().ok_or_else(|| source.invalid("no parts"))?;
    let size = check(source, header)?;
    let names = names(header);
    source.check_size(size.width() as u64 * names.len() as u64, size.height() as u64)?;
    let slots: Vec<usize> = (0..names.len()).collect();
    let mut planes = vec![vec![0.0f32; size.area()]; names.len()];
    decode_part(source, 0, &slots, size, |slot, index, value| planes[slot][index] = value)?;
    let text = |value: &AttributeValue| match value {
        AttributeValue::Text(text) => Some(text.to_string()),
        _ => None,
    };
    let mut metadata: Vec<(String, String)> =
        header.own_attributes.other.iter().filter_map(|(k, v)| Some((k.to_string(), text(v)?))).collect();
    metadata.sort();
    Ok(ExrChannels {
        width: size.width(),
        height: size.height(),
        channels: names.into_iter().zip(planes).collect(),
        metadata,
    })
}

fn read_meta(source: EncodedImage) -> Result<MetaData, ImageError> {
    let meta = MetaData::read_from_buffered(source.bytes, false).map_err(|e| source.invalid(e))?;
    // the decoder allocates by these counts; the offset table alone takes 8 bytes of the file per block
    let blocks = meta.headers.iter().fold(0usize, |sum, h| sum.saturating_add(h.chunk_count));
    if blocks > source.bytes.len() / 8 {
        return Err(source.invalid(format!("{blocks} declared blocks do not fit into {} bytes", source.bytes.len())));
    }
    Ok(meta)
}

fn check(source: EncodedImage, header: &Header) -> Result<Vec2<usize>, ImageError> {
    let size = header.layer_size;
    source.check_size(size.width() as u64, size.height() as u64)?;
    if header.deep {
        return Err(source.unsupported("deep data"));
    }
    if matches!(header.compression, Compression::HTJ2K32 | Compression::HTJ2K256) {
        return Err(source.unsupported("HTJ2K compression"));
    }
    if header.channels.list.iter().any(|c| c.sampling != Vec2(1, 1)) {
        return Err(source.unsupported("subsampled channels (luminance/chroma)"));
    }
    // all channels of a block are decompressed together
    let widest = header.max_block_pixel_size();
    let block_pixels = widest.width().min(size.width()).saturating_mul(widest.height().min(size.height()));
    let block_bytes = block_pixels.saturating_mul(header.channels.bytes_per_pixel);
    if block_bytes > (64 << 20) + source.bytes.len().saturating_mul(4096) {
        let bytes = source.bytes.len();
        return Err(source.unsupported(format!("blocks of {block_bytes} bytes are implausible in {bytes} bytes")));
    }
    Ok(size)
}

fn names(header: &Header) -> Vec<String> {
    header.channels.list.iter().map(|c| c.name.to_string()).collect()
}

fn no_channel(source: EncodedImage, meta: &MetaData, missing: &str) -> ImageError {
    let mut all: Vec<String> = meta.headers.iter().flat_map(names).collect();
    all.truncate(12);
    source.invalid(format!("{missing}; the file has {}", all.join(", ")))
}

fn position(names: &[String], name: &str) -> Option<usize> {
    names.iter().position(|n| n.eq_ignore_ascii_case(name))
}

fn rgb_channels(names: &[String]) -> Option<Vec<usize>> {
    let triple = |prefix: &str| -> Option<Vec<usize>> {
        ["R", "G", "B"].iter().map(|c| position(names, &format!("{prefix}{c}"))).collect()
    };
    let layers = names.iter().filter_map(|n| n.rfind('.').map(|dot| &n[..=dot]));
    triple("").or_else(|| layers.into_iter().find_map(triple))
}

fn luminance_channel(names: &[String]) -> Option<Vec<usize>> {
    position(names, "Y").map(|index| vec![index])
}

fn only_channel(names: &[String]) -> Option<Vec<usize>> {
    (names.len() == 1).then(|| vec![0])
}

fn depth_channel(names: &[String]) -> Option<usize> {
    let last = |name: &str| name.rsplit('.').next().unwrap_or_default().to_ascii_lowercase();
    ["z", "depth", "distance", "y", "v", "r"]
        .iter()
        .find_map(|wanted| names.iter().position(|n| last(n) == *wanted))
        .or((names.len() == 1).then_some(0))
}

/// Returns the matrix to Rec. 709, row by row; `None` for files in Rec. 709 or with invalid chromaticities.
fn conversion(c: &Chromaticities) -> Option<[[f32; 3]; 3]> {
    rec709_from_primaries([c.red, c.green, c.blue, c.white].map(|Vec2(x, y)| [f64::from(x), f64::from(y)]))
}

/// Decompresses selected channels of a part. Calls `put(slot, pixel, value)` once per sample, where `slot` is an index
/// into `channels`.
fn decode_part(
    source: EncodedImage,
    part: usize,
    channels: &[usize],
    size: Vec2<usize>,
    mut put: impl FnMut(usize, usize, f32),
) -> Result<(), ImageError> {
    let reader = exr::block::read(Cursor::new(source.bytes), false).map_err(|e| source.invalid(e))?;
    let mut chunks = reader
        .filter_chunks(false, |_, tile, block| block.layer == part && tile.level_index == Vec2(0, 0))
        .map_err(|e| source.invalid(e))?;
    let meta = chunks.meta_data().clone();
    let header = &meta.headers[part];
    loop {
        // batches: decompression runs in parallel, but all blocks at once would double the memory
        let batch = chunks.by_ref().take(32).collect::<Result<Vec<_>, _>>().map_err(|e| source.invalid(e))?;
        if batch.is_empty() {
            return Ok(());
        }
        let blocks: Result<Vec<_>, _> =
            batch.into_par_iter().map(|chunk| UncompressedBlock::decompress_chunk(chunk, &meta, false)).collect();
        for block in blocks.map_err(|e| source.invalid(format!("{} ({})", e, header.compression)))? {
            if block.index.layer == part && block.index.level == Vec2(0, 0) {
                scatter(source, header, &block, channels, size, &mut put)?;
            }
        }
    }
}

/// Passes the samples of a block to `put`: line by line, and within a line channel by channel.
fn scatter(
    source: EncodedImage,
    header: &Header,
    block: &UncompressedBlock,
    channels: &[usize],
    size: Vec2<usize>,
    put: &mut impl FnMut(usize, usize, f32),
) -> Result<(), ImageError> {
    let (position, extent) = (block.index.pixel_position, block.index.pixel_size);
    let line_bytes = header.channels.bytes_per_pixel * extent.width();
    let inside = position.x() + extent.width() <= size.width() && position.y() + extent.height() <= size.height();
    if !inside || block.data.len() < line_bytes * extent.height() {
        return Err(source.invalid("a pixel block is truncated or out of bounds"));
    }
    for (row, line) in block.data.chunks_exact(line_bytes.max(1)).take(extent.height()).enumerate() {
        let first = (position.y() + row) * size.width() + position.x();
        let mut offset = 0;
        for (index, channel) in header.channels.list.iter().enumerate() {
            let bytes = channel.sample_type.bytes_per_sample() * extent.width();
            let samples = &line[offset..offset + bytes];
            offset += bytes;
            for slot in channels.iter().enumerate().filter(|(_, c)| **c == index).map(|(slot, _)| slot) {
                let mut put = |x: usize, value: f32| put(slot, first + x, value);
                match channel.sample_type {
                    SampleType::F16 => samples.as_chunks().0.iter().enumerate().for_each(|(x, b)| {
                        put(x, half::f16::from_ne_bytes(*b).to_f32());
                    }),
                    SampleType::F32 => samples.as_chunks().0.iter().enumerate().for_each(|(x, b)| {
                        put(x, f32::from_ne_bytes(*b));
                    }),
                    SampleType::U32 => samples.as_chunks().0.iter().enumerate().for_each(|(x, b)| {
                        put(x, u32::from_ne_bytes(*b) as f32);
                    }),
                }
            }
        }
    }
    Ok(())
}
