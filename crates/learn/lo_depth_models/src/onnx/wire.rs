//! The parts of Protocol Buffers that ONNX needs.

use std::io::{BufRead, Seek, SeekFrom};

use super::MAX_STRUCTURE_BYTES;
use crate::ModelError;

/// Memory of a field or list item besides its bytes.
const ITEM_BYTES: u64 = 64;

/// Reads fields, and tracks its position and the memory used.
pub(super) struct Reader<R> {
    inner: R,
    at: u64,
    kept: u64,
}

/// A field's number and value.
pub(super) struct Field {
    pub number: u64,
    pub value: Wire,
}

#[derive(Clone, Copy)]
pub(super) enum Wire {
    Varint(u64),
    Fixed64(u64),
    Fixed32(u32),
    /// Number of bytes that follow and must be read or skipped.
    Length(u64),
}

impl<R: BufRead + Seek> Reader<R> {
    pub fn new(inner: R) -> Self {
        Self { inner, at: 0, kept: 0 }
    }

    pub fn into_inner(self) -> R {
        self.inner
    }

    pub fn position(&self) -> u64 {
        self.at
    }

    /// The next field of a message that ends at `end`.
    pub fn next(&mut self, end: u64) -> Result<Option<Field>, ModelError> {
        if self.at >= end {
            return if self.at == end { Ok(None) } else { Err(self.malformed("a message is longer than its frame")) };
        }
        self.keep(ITEM_BYTES)?;
        let key = self.varint()?;
        let value = match key & 7 {
            0 => Wire::Varint(self.varint()?),
            1 => Wire::Fixed64(u64::from_le_bytes(self.array()?)),
            2 => Wire::Length(self.varint()?),
            5 => Wire::Fixed32(u32::from_le_bytes(self.array()?)),
            kind => return Err(self.malformed(&format!("the wire type {kind} is invalid"))),
        };
        if let Wire::Length(length) = value {
            self.end_of(length, end)?;
        }
        Ok(Some(Field { number: key >> 3, value }))
    }

    /// End of a nested message.
    pub fn end_of(&self, length: u64, end: u64) -> Result<u64, ModelError> {
        let inner = self.at.checked_add(length).filter(|&inner| inner <= end);
        inner.ok_or_else(|| self.malformed("the file is truncated, or is not an ONNX file"))
    }

    pub fn skip(&mut self, value: Wire) -> Result<(), ModelError> {
        if let Wire::Length(length) = value {
            let by = i64::try_from(length).map_err(|_| self.malformed("a length is invalid"))?;
            self.inner.seek_relative(by).map_err(ModelError::read)?;
            self.at += length;
        }
        Ok(())
    }

    pub fn bytes(&mut self, value: Wire) -> Result<Vec<u8>, ModelError> {
        let Wire::Length(length) = value else { return Err(self.malformed("bytes were expected")) };
        self.keep(length)?;
        let mut bytes = vec![0; length as usize];
        self.inner.read_exact(&mut bytes).map_err(ModelError::read)?;
        self.at += length;
        Ok(bytes)
    }

    pub fn text(&mut self, value: Wire) -> Result<String, ModelError> {
        String::from_utf8(self.bytes(value)?).map_err(|_| self.malformed("a name is not UTF-8"))
    }

    pub fn int(&self, value: Wire) -> Result<i64, ModelError> {
        match value {
            Wire::Varint(value) => Ok(value as i64),
            _ => Err(self.malformed("an integer was expected")),
        }
    }

    pub fn float(&self, value: Wire) -> Result<f32, ModelError> {
        match value {
            Wire::Fixed32(bits) => Ok(f32::from_bits(bits)),
            _ => Err(self.malformed("a float was expected")),
        }
    }

    /// Integers, packed or single.
    pub fn ints(&mut self, value: Wire, into: &mut Vec<i64>) -> Result<(), ModelError> {
        if let Wire::Length(length) = value {
            let end = self.at + length;
            self.keep(8 * length)?;
            while self.at < end {
                into.push(self.varint()? as i64);
            }
            return if self.at == end { Ok(()) } else { Err(self.malformed("a list is longer than its frame")) };
        }
        into.push(self.int(value)?);
        Ok(())
    }

    /// Floats, packed or single, as little-endian bytes.
    pub fn float_bytes(&mut self, value: Wire, into: &mut Vec<u8>) -> Result<(), ModelError> {
        match value {
            Wire::Fixed32(bits) => into.extend(bits.to_le_bytes()),
            Wire::Fixed64(bits) => into.extend(bits.to_le_bytes()),
            packed => into.append(&mut self.bytes(packed)?),
        }
        Ok(())
    }

    pub fn malformed(&self, why: &str) -> ModelError {
        ModelError::Malformed(format!("at byte {}: {why}", self.at))
    }

    fn keep(&mut self, bytes: u64) -> Result<(), ModelError> {
        self.kept = self.kept.saturating_add(bytes);
        if self.kept > MAX_STRUCTURE_BYTES {
            let most_mib = MAX_STRUCTURE_BYTES >> 20;
            return Err(ModelError::TooLarge(format!("its graph takes more than {most_mib} MiB without the weights")));
        }
        Ok(())
    }

    fn varint(&mut self) -> Result<u64, ModelError> {
        let mut value = 0u64;
        for shift in (0..64).step_by(7) {
            let [byte] = self.array()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err(self.malformed("an integer is longer than 64 bits"))
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], ModelError> {
        let mut bytes = [0; N];
        self.inner.read_exact(&mut bytes).map_err(ModelError::read)?;
        self.at += N as u64;
        Ok(bytes)
    }
}

/// Reads bytes at an offset of a file.
pub(super) fn read_at<R: BufRead + Seek>(file: &mut R, start: u64, into: &mut [u8]) -> std::io::Result<()> {
    file.seek(SeekFrom::Start(start))?;
    file.read_exact(into)
}

/// Writes fields.
#[derive(Default)]
pub(super) struct Writer(pub Vec<u8>);

impl Writer {
    pub fn int(&mut self, number: u64, value: i64) {
        self.varint(number << 3);
        self.varint(value as u64);
    }

    pub fn float(&mut self, number: u64, value: f32) {
        self.varint(number << 3 | 5);
        self.0.extend(value.to_le_bytes());
    }

    pub fn bytes(&mut self, number: u64, value: &[u8]) {
        self.varint(number << 3 | 2);
        self.varint(value.len() as u64);
        self.0.extend(value);
    }

    pub fn message(&mut self, number: u64, write: impl FnOnce(&mut Self)) {
        let mut inner = Self::default();
        write(&mut inner);
        self.bytes(number, &inner.0);
    }

    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }
}
