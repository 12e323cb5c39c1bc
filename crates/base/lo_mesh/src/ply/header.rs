use crate::MeshError;

/// How the body is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Format {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
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
            _ => Err(MeshError::syntax("PLY", "header", format!("'{name}' is no type"))),
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

    /// Greatest value of the whole-number types that hold colours.
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
    pub(super) kind: Kind,
    /// Type of the length that precedes the values of a list.
    pub(super) length: Option<Kind>,
}

#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) format: Format,
    pub(super) elements: Vec<Element>,
    /// From a `comment TextureFile` line.
    pub(super) texture_file: Option<String>,
}

impl Header {
    /// The header and the bytes after it.
    pub(super) fn parse(bytes: &[u8]) -> Result<(Self, &[u8]), MeshError> {
        let broken = |line: usize, what: String| MeshError::syntax("PLY", format!("line {line}"), what);
        let mut rest = bytes;
        let mut format = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut texture_file = None;
        for number in 1.. {
            // A lone carriage return also ends a line, as old Macintosh programs wrote it.
            let Some(end) = rest.iter().position(|&byte| byte == b'\n' || byte == b'\r') else {
                return Err(broken(number, "the header has no end_header".to_owned()));
            };
            let line = String::from_utf8_lossy(&rest[..end]).into_owned();
            rest = &rest[end + 1..];
            if bytes[bytes.len() - rest.len() - 1] == b'\r' && rest.first() == Some(&b'\n') {
                rest = &rest[1..];
            }
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            match words[..] {
                ["ply"] if number == 1 => {}
                _ if number == 1 => return Err(broken(1, "the file does not begin with 'ply'".to_owned())),
                ["format", name, _version] => {
                    format = Some(match name {
                        "ascii" => Format::Ascii,
                        "binary_little_endian" => Format::LittleEndian,
                        "binary_big_endian" => Format::BigEndian,
                        _ => return Err(broken(number, format!("'{name}' is no format"))),
                    });
                }
                ["comment", "TextureFile", ..] => {
                    texture_file = line.split_once("TextureFile").map(|(_, name)| name.trim().to_owned());
                }
                ["comment" | "obj_info", ..] | [] => {}
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| broken(number, format!("'{count}' is no count")))?;
                    // Lists per vertex would come out at different lengths.
                    if name == "vertex" && elements.iter().any(|element| element.name == name) {
                        return Err(broken(number, "a second element vertex".to_owned()));
                    }
                    elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
                }
                ["property", ref property @ ..] => {
                    let property = match *property {
                        ["list", length, kind, name] => Property {
                            name: name.to_owned(),
                            kind: Kind::parse(kind)?,
                            length: Some(Kind::parse(length)?),
                        },
                        [kind, name] => Property { name: name.to_owned(), kind: Kind::parse(kind)?, length: None },
                        _ => return Err(broken(number, format!("'{line}' is no property"))),
                    };
                    let element = elements.last_mut();
                    let element = element.ok_or_else(|| broken(number, "a property before any element".to_owned()))?;
                    element.properties.push(property);
                }
                ["end_header"] => break,
                _ => return Err(broken(number, format!("'{line}' does not belong in a header"))),
            }
        }
        let format = format.ok_or_else(|| MeshError::syntax("PLY", "header", "it has no format line"))?;
        Ok((Self { format, elements, texture_file }, rest))
    }

    /// Refuses counts for which the body is too short, before anything is allocated.
    pub(super) fn check_counts(&self, body_bytes: usize) -> Result<(), MeshError> {
        for element in &self.elements {
            let least = |property: &Property| match self.format {
                Format::Ascii => 2, // A digit and a separator; the file's last separator may be missing.
                _ => property.length.unwrap_or(property.kind).bytes(),
            };
            let least: usize = element.properties.iter().map(least).sum();
            if element.count > 0 && least == 0 {
                let what = format!("element {} has no properties", element.name);
                return Err(MeshError::syntax("PLY", "header", what));
            }
            if element.count.checked_mul(least).is_none_or(|needed| needed > body_bytes + 1) {
                let what = format!(
                    "{} × {} announced, the file has {body_bytes} bytes after its header",
                    element.count, element.name
                );
                return Err(MeshError::syntax("PLY", "header", what));
            }
        }
        Ok(())
    }
}

/// Takes values from the body one after the other.
pub(super) struct Reader<'a> {
    format: Format,
    rest: &'a [u8],
    body: usize,
    header: usize,
}

impl<'a> Reader<'a> {
    pub(super) fn new(format: Format, body: &'a [u8], header_bytes: usize) -> Self {
        Self { format, rest: body, body: body.len(), header: header_bytes }
    }

    fn place(&self) -> String {
        format!("byte {}", self.header + self.body - self.rest.len())
    }

    /// The next value.
    pub(super) fn value(&mut self, kind: Kind) -> Result<f64, MeshError> {
        if self.format == Format::Ascii {
            return self.word();
        }
        let Some((bytes, rest)) = self.rest.split_at_checked(kind.bytes()) else {
            return Err(MeshError::syntax("PLY", self.place(), "the file ends too early"));
        };
        self.rest = rest;
        let mut word = [0_u8; 8];
        let size = bytes.len();
        word[..size].copy_from_slice(bytes);
        if self.format == Format::BigEndian {
            word[..size].reverse();
        }
        let [a, b, c, d, ..] = word;
        Ok(match kind {
            Kind::I8 => f64::from(a as i8),
            Kind::U8 => f64::from(a),
            Kind::I16 => f64::from(i16::from_le_bytes([a, b])),
            Kind::U16 => f64::from(u16::from_le_bytes([a, b])),
            Kind::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Kind::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Kind::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Kind::F64 => f64::from_le_bytes(word),
        })
    }

    fn word(&mut self) -> Result<f64, MeshError> {
        self.rest = self.rest.trim_ascii_start();
        let end = self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        if word.is_empty() {
            return Err(MeshError::syntax("PLY", self.place(), "the file ends too early"));
        }
        let value = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok()).ok_or_else(|| {
            let what = format!("'{}' is no number", String::from_utf8_lossy(&word[..word.len().min(40)]));
            MeshError::syntax("PLY", self.place(), what)
        })?;
        self.rest = rest;
        Ok(value)
    }

    /// Length of the list that follows, which the rest of the file can hold.
    fn length(&mut self, length: Kind, kind: Kind) -> Result<usize, MeshError> {
        let place = self.place();
        let count = self.value(length)?;
        let least = if self.format == Format::Ascii { 2 } else { kind.bytes() };
        // NaN fails the comparison too.
        if !(count >= 0.0 && count.fract() == 0.0 && count * least as f64 <= self.rest.len() as f64 + 1.0) {
            return Err(MeshError::syntax(
                "PLY",
                place,
                format!("a list of {count} values does not fit into the file"),
            ));
        }
        Ok(count as usize)
    }

    /// The whole numbers of a list.
    pub(super) fn list(&mut self, length: Kind, kind: Kind, values: &mut Vec<i64>) -> Result<(), MeshError> {
        values.clear();
        for _ in 0..self.length(length, kind)? {
            values.push(self.value(kind)? as i64);
        }
        Ok(())
    }

    /// Goes past a list.
    pub(super) fn skip_list(&mut self, length: Kind, kind: Kind) -> Result<(), MeshError> {
        for _ in 0..self.length(length, kind)? {
            self.value(kind)?;
        }
        Ok(())
    }
}
