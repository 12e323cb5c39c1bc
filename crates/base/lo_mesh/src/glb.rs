//! The container of glTF 2.0 binary files.

use serde_json::{Value, json};

/// Builds a binary glTF: the bytes of its only buffer, and the views and accessors that describe them.
#[derive(Debug, Default)]
pub struct GlbWriter {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

/// Error of a binary glTF larger than 4 GiB, the limit of its 32-bit length.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the binary glTF file would have {bytes} bytes, more than the format's limit of 4 GiB")]
pub struct GlbTooLarge {
    /// Size that the file would have.
    pub bytes: usize,
}

impl GlbWriter {
    /// Component type of 16-bit indices.
    pub const UNSIGNED_SHORT: u32 = 5123;
    /// Component type of 32-bit indices.
    pub const UNSIGNED_INT: u32 = 5125;
    /// Component type of 32-bit floats.
    pub const FLOAT: u32 = 5126;
    /// Target of a view with vertices.
    pub const ARRAY_BUFFER: u32 = 34962;
    /// Target of a view with indices.
    pub const ELEMENT_ARRAY_BUFFER: u32 = 34963;

    /// Appends bytes, such as a PNG, and returns the index of their `bufferView`.
    pub fn view(&mut self, data: &[u8]) -> usize {
        let view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": data.len() });
        self.bytes.extend_from_slice(data);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.views.len() - 1
    }

    /// Appends the little-endian data of `count` elements, each a multiple of four bytes, and returns the index of
    /// their accessor.
    ///
    /// `kind` is the accessor's `type`. `accessor` is an object with its other properties: `min` and `max`,
    /// `normalized`.
    pub fn accessor(
        &mut self,
        data: &[u8],
        count: usize,
        component: u32,
        kind: &str,
        target: u32,
        mut accessor: Value,
    ) -> usize {
        let view = self.view(data);
        self.views[view]["target"] = target.into();
        accessor["bufferView"] = view.into();
        accessor["componentType"] = component.into();
        accessor["count"] = count.into();
        accessor["type"] = kind.into();
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Returns the whole file; `document` is its JSON without accessors, buffer views and the buffer.
    ///
    /// # Errors
    /// [`GlbTooLarge`] for a file of more than 4 GiB.
    pub fn finish(self, mut document: Value) -> Result<Vec<u8>, GlbTooLarge> {
        document["accessors"] = self.accessors.into();
        document["bufferViews"] = self.views.into();
        document["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        // The asset comes first, so that the generator is found without parsing thousands of accessors.
        let asset = document.as_object_mut().and_then(|fields| fields.remove("asset")).unwrap_or_default();
        let rest = document.to_string();
        let mut text = format!("{{\"asset\":{asset},{}", rest.trim_start_matches('{')).into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        // 12 bytes of header, and 8 for each chunk's
        let bytes = 12 + 8 + text.len() + 8 + self.bytes.len();
        let total = u32::try_from(bytes).map_err(|_| GlbTooLarge { bytes })?;
        let mut file = Vec::with_capacity(bytes);
        file.extend_from_slice(b"glTF");
        file.extend(2u32.to_le_bytes());
        file.extend(total.to_le_bytes());
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &self.bytes)] {
            file.extend((chunk.len() as u32).to_le_bytes());
            file.extend_from_slice(kind);
            file.extend_from_slice(chunk);
        }
        Ok(file)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_gltf_crate_reads_what_was_packed() {
        let mut glb = GlbWriter::default();
        assert_eq!(glb.view(b"odd"), 0);
        let data: Vec<u8> = [1.5f32, -2.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        let extra = json!({ "min": [-2.0], "max": [1.5] });
        assert_eq!(glb.accessor(&data, 2, GlbWriter::FLOAT, "SCALAR", GlbWriter::ARRAY_BUFFER, extra), 0);
        let file = glb.finish(json!({ "asset": { "version": "2.0" } })).unwrap();
        assert!(file[20..].starts_with(b"{\"asset\":{\"version\":\"2.0\"},"), "the asset comes first");
        let gltf = ::gltf::Gltf::from_slice(&file).unwrap();
        let accessor = gltf.accessors().next().unwrap();
        let start = accessor.view().unwrap().offset();
        assert_eq!((accessor.count(), start), (2, 4), "data begins at a multiple of four");
        assert_eq!(gltf.blob.as_ref().unwrap()[start..start + 8], data);
    }
}
