use std::borrow::Cow;
use std::collections::HashMap;
use std::path::PathBuf;

use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::json::{Accessor, Root, get};
use crate::MeshError;
use crate::model::Resolver;

/// Accepts base64 with and without padding, since exporters differ.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Contents of all buffers of a glTF file.
pub(super) struct Buffers<'a> {
    root: &'a Root,
    contents: Vec<Cow<'a, [u8]>>,
    /// Index into `contents` of each buffer: a file used by several buffers is stored once.
    buffers: Vec<usize>,
}

impl<'a> Buffers<'a> {
    /// Reads and decodes every buffer.
    pub(super) fn load(root: &'a Root, binary: Option<&'a [u8]>, resolve: &Resolver) -> Result<Self, MeshError> {
        let mut contents: Vec<Cow<[u8]>> = Vec::new();
        let mut buffers = Vec::with_capacity(root.buffers.len());
        let mut known: HashMap<&str, usize> = HashMap::new();
        for (index, buffer) in root.buffers.iter().enumerate() {
            let place = format!("buffer {index}");
            let content = match buffer.uri.as_deref().and_then(|uri| known.get(uri)) {
                Some(&content) => content,
                None => {
                    contents.push(match (&buffer.uri, binary) {
                        (None, Some(binary)) if index == 0 => binary.into(),
                        // Compression extensions leave placeholder buffers that nothing reads.
                        (None, _) => Cow::Borrowed(&[]),
                        (Some(uri), _) => read_uri(uri, resolve).map_err(|failure| failure.for_buffer(&place))?.into(),
                    });
                    contents.len() - 1
                }
            };
            let length = contents[content].len();
            if let Some(uri) = &buffer.uri {
                known.insert(uri, content);
                if length < buffer.byte_length {
                    let what = format!("it has {length} bytes instead of {}", buffer.byte_length);
                    return Err(MeshError::syntax("glTF", place, what));
                }
            }
            buffers.push(content);
        }
        Ok(Self { root, contents, buffers })
    }

    /// Number of bytes outside the JSON or GLB file itself.
    pub(super) fn external_bytes(&self) -> usize {
        self.contents.iter().filter(|b| matches!(b, Cow::Owned(_))).map(|b| b.len()).sum()
    }

    /// Returns the bytes of a buffer view.
    pub(super) fn view(&self, index: usize) -> Result<&[u8], MeshError> {
        let view = get(&self.root.buffer_views, index, "bufferView")?;
        if view.extensions.meshopt.is_some() {
            return Err(MeshError::UnsupportedExtension {
                name: "EXT_meshopt_compression".to_owned(),
                remedy: "export without meshopt compression",
            });
        }
        let buffer = &self.contents[*get(&self.buffers, view.buffer, "buffer")?];
        let end = view.byte_offset.checked_add(view.byte_length).filter(|&end| end <= buffer.len());
        let end = end.ok_or_else(|| {
            let what = format!("it extends past the end of buffer {} ({} bytes)", view.buffer, buffer.len());
            MeshError::syntax("glTF", format!("bufferView {index}"), what)
        })?;
        Ok(&buffer[view.byte_offset..end])
    }

    /// Reads all elements of an accessor as floats with `N` components.
    ///
    /// Normalised integers are scaled to [0, 1] or [−1, 1]. The count is checked against `limit` before allocation.
    pub(super) fn floats<const N: usize>(&self, index: usize, limit: u64) -> Result<Vec<[f32; N]>, MeshError> {
        let accessor = get(&self.root.accessors, index, "accessor")?;
        check_shape(accessor, index, N)?;
        let component = ComponentType::of(accessor.component_type, index)?;
        let convert = |bytes: &[u8]| component.float(bytes, accessor.normalized);
        self.elements(accessor, index, limit, component.size(), 0.0, convert)
    }

    /// Reads all elements of a scalar integer accessor.
    pub(super) fn indices(&self, index: usize, limit: u64) -> Result<Vec<u32>, MeshError> {
        let accessor = get(&self.root.accessors, index, "accessor")?;
        check_shape(accessor, index, 1)?;
        let component = ComponentType::unsigned(accessor.component_type, index)?;
        let elements = self.elements(accessor, index, limit, component.size(), 0, |bytes| component.index(bytes))?;
        Ok(elements.into_iter().map(|[index]| index).collect())
    }

    /// Number of components of an accessor's elements.
    pub(super) fn components(&self, index: usize) -> Result<usize, MeshError> {
        components(get(&self.root.accessors, index, "accessor")?, index)
    }

    fn elements<T: Copy, const N: usize>(
        &self,
        accessor: &Accessor,
        index: usize,
        limit: u64,
        component_bytes: usize,
        zero: T,
        convert: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<[T; N]>, MeshError> {
        if accessor.count as u64 > limit {
            return Err(MeshError::TooLarge { what: "vertices", count: accessor.count as u64, limit });
        }
        let element_bytes = component_bytes * N;
        let element = |bytes: &[u8]| std::array::from_fn(|c| convert(&bytes[c * component_bytes..][..component_bytes]));
        let place = || format!("accessor {index}");
        let mut result = match accessor.buffer_view {
            None => vec![[zero; N]; accessor.count],
            Some(view) => {
                let stride = self.root.buffer_views.get(view).and_then(|v| v.byte_stride).unwrap_or(element_bytes);
                let bytes = self.view(view)?;
                let bytes = strided(bytes, accessor.byte_offset, stride, element_bytes, accessor.count)
                    .ok_or_else(|| runs_past(place(), accessor.count, view, bytes.len()))?;
                (0..accessor.count).map(|i| element(&bytes[i * stride..])).collect()
            }
        };
        if let Some(sparse) = &accessor.sparse {
            let component = ComponentType::unsigned(sparse.indices.component_type, index)?;
            let (at, values) = (self.view(sparse.indices.buffer_view)?, self.view(sparse.values.buffer_view)?);
            let size = component.size();
            let at = strided(at, sparse.indices.byte_offset, size, size, sparse.count)
                .ok_or_else(|| runs_past(place(), sparse.count, sparse.indices.buffer_view, at.len()))?;
            let values = strided(values, sparse.values.byte_offset, element_bytes, element_bytes, sparse.count)
                .ok_or_else(|| runs_past(place(), sparse.count, sparse.values.buffer_view, values.len()))?;
            for (at, value) in at.chunks_exact(size).zip(values.chunks_exact(element_bytes)).take(sparse.count) {
                let at = component.index(at) as usize;
                *result.get_mut(at).ok_or_else(|| {
                    let what = format!("sparse index {at} is out of range for {} elements", accessor.count);
                    MeshError::syntax("glTF", place(), what)
                })? = element(value);
            }
        }
        Ok(result)
    }
}

/// Returns the bytes from the first element on; `None` if any of `count` elements is out of bounds.
fn strided(bytes: &[u8], offset: usize, stride: usize, element: usize, count: usize) -> Option<&[u8]> {
    let bytes = bytes.get(offset..)?;
    let needed = count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(element))?;
    (needed <= bytes.len() && stride > 0).then_some(bytes)
}

fn runs_past(place: String, count: usize, view: usize, bytes: usize) -> MeshError {
    MeshError::syntax("glTF", place, format!("{count} elements do not fit into bufferView {view} ({bytes} bytes)"))
}

fn components(accessor: &Accessor, index: usize) -> Result<usize, MeshError> {
    match accessor.kind.as_str() {
        "SCALAR" => Ok(1),
        "VEC2" => Ok(2),
        "VEC3" => Ok(3),
        "VEC4" => Ok(4),
        "MAT4" => Ok(16),
        other => {
            let what = format!("type {other} instead of a scalar, vector or 4 × 4 matrix");
            Err(MeshError::syntax("glTF", format!("accessor {index}"), what))
        }
    }
}

fn check_shape(accessor: &Accessor, index: usize, expected: usize) -> Result<(), MeshError> {
    let found = components(accessor, index)?;
    if found == expected {
        return Ok(());
    }
    let what = format!("{found} components per element instead of {expected}");
    Err(MeshError::syntax("glTF", format!("accessor {index}"), what))
}

/// glTF component types.
#[derive(Clone, Copy, PartialEq)]
enum ComponentType {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl ComponentType {
    fn of(code: u32, accessor: usize) -> Result<Self, MeshError> {
        match code {
            5120 => Ok(Self::I8),
            5121 => Ok(Self::U8),
            5122 => Ok(Self::I16),
            5123 => Ok(Self::U16),
            5125 => Ok(Self::U32),
            5126 => Ok(Self::F32),
            _ => {
                let what = format!("unknown componentType {code}");
                Err(MeshError::syntax("glTF", format!("accessor {accessor}"), what))
            }
        }
    }

    fn unsigned(code: u32, accessor: usize) -> Result<Self, MeshError> {
        match Self::of(code, accessor)? {
            component @ (Self::U8 | Self::U16 | Self::U32) => Ok(component),
            _ => {
                let what = format!("componentType {code} is not an index type");
                Err(MeshError::syntax("glTF", format!("accessor {accessor}"), what))
            }
        }
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// Converts one component; `bytes` has [`ComponentType::size`] bytes.
    fn float(self, bytes: &[u8], normalized: bool) -> f32 {
        let word = || [bytes[0], bytes[1], bytes[2], bytes[3]];
        let (value, largest) = match self {
            Self::I8 => (f32::from(bytes[0] as i8), 127.0),
            Self::U8 => (f32::from(bytes[0]), 255.0),
            Self::I16 => (f32::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32767.0),
            Self::U16 => (f32::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65535.0),
            Self::U32 => (u32::from_le_bytes(word()) as f32, u32::MAX as f32),
            Self::F32 => return f32::from_le_bytes(word()),
        };
        if normalized { (value / largest).max(-1.0) } else { value }
    }

    fn index(self, bytes: &[u8]) -> u32 {
        match self {
            Self::U8 => u32::from(bytes[0]),
            Self::U16 => u32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
            _ => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        }
    }
}

/// Error of reading a URI.
pub(super) enum UriError {
    /// An invalid `data:` URI or an unsupported scheme.
    Invalid(String),
    /// A file that cannot be read.
    File {
        /// File name, percent-decoded.
        name: String,
        /// Error of the operating system.
        reason: String,
    },
}

impl UriError {
    fn for_buffer(self, place: &str) -> MeshError {
        match self {
            Self::Invalid(what) => MeshError::syntax("glTF", place, what),
            Self::File { name, reason } => MeshError::MissingBuffer { path: PathBuf::from(name), reason },
        }
    }

    /// Message for a warning.
    pub(super) fn text(self) -> String {
        match self {
            Self::Invalid(what) => what,
            Self::File { name, reason } => format!("cannot read {name}: {reason}"),
        }
    }
}

/// Reads a `data:` URI or a neighbouring file.
pub(super) fn read_uri(uri: &str, resolve: &Resolver) -> Result<Vec<u8>, UriError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, encoded) =
            data.split_once(";base64,").ok_or_else(|| UriError::Invalid("the data URI is not base64".to_owned()))?;
        return BASE64
            .decode(encoded.trim_end())
            .map_err(|error| UriError::Invalid(format!("invalid base64 in a data URI: {error}")));
    }
    let name = percent_encoding::percent_decode_str(uri).decode_utf8_lossy().into_owned();
    if name.contains("://") {
        return Err(UriError::Invalid(format!("{name} is not a local file; download it and put it beside the mesh")));
    }
    resolve(&name).map_err(|error| UriError::File { name, reason: error.to_string() })
}
