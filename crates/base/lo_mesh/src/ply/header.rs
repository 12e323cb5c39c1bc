use crate::MeshError;

/// Encoding of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Scalar type of a property.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ScalarType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl ScalarType {
    fn parse(name: &str) -> Result<Self, MeshError> {
        match name {
            "char" | "int8" => Ok(Self::I8),
            "uchar" | "uint8" => Ok(Self::U8),
            "short" | "int16" => Ok(Self::I16),
            "ushort" | "uint16" => Ok(Self::U16),
            "int" | "int32" => Ok(Self::I32),
            "uint" | "uint32" => Ok(Self::U32),
            "float" | "float32" => Ok(Self::F32),
            "double" | "float64" => Ok(Self::F64),
            _ => Err(MeshError::syntax("PLY", "header", format!("unknown type '{name}'"))),
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Value of full intensity for colours of integer types; `None` for floats.
    pub(super) fn largest_code(self) -> Option<f64> {
        match self {
            Self::U8 | Self::I8 => Some(255.0),
            Self::U16 | Self::I16 => Some(65535.0),
            // Some programs write 8-bit colours as int.
            Self::I32 | Self::U32 => Some(255.0),
            Self::F32 | Self::F64 => None,
        }
    }
}

#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: ScalarType,
    /// Type of a list's length, which precedes its values; `None` for a scalar.
    pub(super) length: Option<ScalarType>,
}

#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) format: Encoding,
    pub(super) elements: Vec<Element>,
    /// Texture of a `comment TextureFile` line.
    pub(super) texture_file: Option<String>,
}

impl Header {
    /// Parses the header; also returns the bytes after it.
    pub(super) fn parse(bytes: &[u8]) -> Result<(Self, &[u8]), MeshError> {
        let invalid = |line: usize, what: String| MeshError::syntax("PLY", format!("line {line}"), what);
        let mut rest = bytes;
        let mut format = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut texture_file = None;
        for number in 1.. {
            // A lone carriage return also ends a line, as in old Macintosh files.
            let Some(end) = rest.iter().position(|&byte| byte == b'\n' || byte == b'\r') else {
                return Err(invalid(number, "missing end_header".to_owned()));
            };
            let line = String::from_utf8_lossy(&rest[..end]).into_owned();
            rest = &rest[end + 1..];
            if bytes[bytes.len() - rest.len() - 1] == b'\r' && rest.first() == Some(&b'\n') {
                rest = &rest[1..];
            }
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            match words[..] {
                ["ply"] if number == 1 => {}
                _ if number == 1 => return Err(invalid(1, "the file does not start with 'ply'".to_owned())),
                ["format", name, _version] => {
                    format = Some(match name {
                        "ascii" => Encoding::Ascii,
                        "binary_little_endian" => Encoding::LittleEndian,
                        "binary_big_endian" => Encoding::BigEndian,
                        _ => return Err(invalid(number, format!("unknown encoding '{name}'"))),
                    });
                }
                ["comment", "TextureFile", ..] => {
                    texture_file = line.split_once("TextureFile").map(|(_, name)| name.trim().to_owned());
                }
                ["comment" | "obj_info", ..] | [] => {}
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| invalid(number, format!("'{count}' is not a count")))?;
                    // Vertex attributes would have different lengths.
                    if name == "vertex" && elements.iter().any(|element| element.name == name) {
                        return Err(invalid(number, "duplicate element 'vertex'".to_owned()));
                    }
                    elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
                }
                ["property", ref property @ ..] => {
                    let property = match *property {
                        ["list", length, kind, name] => Property {
                            name: name.to_owned(),
                            kind: ScalarType::parse(kind)?,
                            length: Some(ScalarType::parse(length)?),
                        },
                        [kind, name] => {
                            Property { name: name.to_owned(), kind: ScalarType::parse(kind)?, length: None }
                        }
                        _ => return Err(invalid(number, format!("'{line}' is not a valid property"))),
                    };
                    let element = elements.last_mut();
                    let element = element.ok_or_else(|| invalid(number, "a property before any element".to_owned()))?;
                    element.properties.push(property);
                }
                ["end_header"] => break,
                _ => return Err(invalid(number, format!("unexpected header line '{line}'"))),
            }
        }
        let format = format.ok_or_else(|| MeshError::syntax("PLY", "header", "missing format line"))?;
        Ok((Self { format, elements, texture_file }, rest))
    }

    /// Rejects counts for which the body is too short, before allocation.
    pub(super) fn check_counts(&self, body_bytes: usize) -> Result<(), MeshError> {
        for element in &self.elements {
            let least = |property: &Property| match self.format {
                Encoding::Ascii => 2, // A digit and a separator; the file's last separator may be missing.
                _ => property.length.unwrap_or(property.kind).bytes(),
            };
            let least: usize = element.properties.iter().map(least).sum();
            if element.count > 0 && least == 0 {
                let what = format!("element {} has no properties", element.name);
                return Err(MeshError::syntax("PLY", "header", what));
            }
            if element.count.checked_mul(least).is_none_or(|needed| needed > body_bytes + 1) {
                let what = format!(
                    "{} elements '{}' do not fit into the {body_bytes} bytes after the header",
                    element.count, element.name
                );
                return Err(MeshError::syntax("PLY", "header", what));
            }
        }
        Ok(())
    }
}

/// Reads values from the body in sequence.
pub(super) struct Reader<'a> {
    format: Encoding,
    rest: &'a [u8],
    /// Length of the body in bytes.
    body: usize,
    /// Length of the header in bytes.
    header: usize,
}

impl<'a> Reader<'a> {
    pub(super) fn new(format: Encoding, body: &'a [u8], header_bytes: usize) -> Self {
        Self { format, rest: body, body: body.len(), header: header_bytes }
    }

    fn place(&self) -> String {
        format!("byte {}", self.header + self.body - self.rest.len())
    }

    /// Reads the next value.
    pub(super) fn value(&mut self, kind: ScalarType) -> Result<f64, MeshError> {
        if self.format == Encoding::Ascii {
            return self.word();
        }
        let Some((bytes, rest)) = self.rest.split_at_checked(kind.bytes()) else {
            return Err(MeshError::syntax("PLY", self.place(), "unexpected end of file"));
        };
        self.rest = rest;
        let mut word = [0_u8; 8];
        let size = bytes.len();
        word[..size].copy_from_slice(bytes);
        if self.format == Encoding::BigEndian {
            word[..size].reverse();
        }
        let [a, b, c, d, ..] = word;
        Ok(match kind {
            ScalarType::I8 => f64::from(a as i8),
            ScalarType::U8 => f64::from(a),
            ScalarType::I16 => f64::from(i16::from_le_bytes([a, b])),
            ScalarType::U16 => f64::from(u16::from_le_bytes([a, b])),
            ScalarType::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            ScalarType::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            ScalarType::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            ScalarType::F64 => f64::from_le_bytes(word),
        })
    }

    fn word(&mut self) -> Result<f64, MeshError> {
        self.rest = self.rest.trim_ascii_start();
        let end = self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        if word.is_empty() {
            return Err(MeshError::syntax("PLY", self.place(), "unexpected end of file"));
        }
        let value = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok()).ok_or_else(|| {
            let what = format!("'{}' is not a number", String::from_utf8_lossy(&word[..word.len().min(40)]));
            MeshError::syntax("PLY", self.place(), what)
        })?;
        self.rest = rest;
        Ok(value)
    }

    /// Reads the length of a list and checks that the rest of the file can hold it.
    fn length(&mut self, length: ScalarType, kind: ScalarType) -> Result<usize, MeshError> {
        let place = self.place();
        let count = self.value(length)?;
        let least = if self.format == Encoding::Ascii { 2 } else { kind.bytes() };
        // The comparison also rejects NaN.
        if !(count >= 0.0 && count.fract() == 0.0 && count * least as f64 <= self.rest.len() as f64 + 1.0) {
            return Err(MeshError::syntax(
                "PLY",
                place,
                format!("a list of {count} values does not fit into the file"),
            ));
        }
        Ok(count as usize)
    }

    /// Reads a list of integers.
    pub(super) fn list(
        &mut self,
        length: ScalarType,
        kind: ScalarType,
        values: &mut Vec<i64>,
    ) -> Result<(), MeshError> {
        values.clear();
        for _ in 0..self.length(length, kind)? {
            values.push(self.value(kind)? as i64);
        }
        Ok(())
    }

    /// Skips a list.
    pub(super) fn skip_list(&mut self, length: ScalarType, kind: ScalarType) -> Result<(), MeshError> {
        for _ in 0..self.length(length, kind)? {
            self.value(kind)?;
        }
        Ok(())
    }
}
