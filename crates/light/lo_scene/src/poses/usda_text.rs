//! Text of USD files (`.usda`), as far as a camera needs it: the layer's metadata, and the transforms and lens of the
//! first camera with its ancestors. All else is skipped. Nothing is composed: sublayers, references, payloads and
//! variants are not followed.

use std::collections::HashMap;

use super::error::PoseError;
use super::values::content;

/// Most numbers or texts of one value, most samples of an attribute, and most levels of the hierarchy.
const MAX_VALUES: usize = 1024;
const MAX_SAMPLES: usize = 1 << 20;
const MAX_DEPTH: usize = 256;

/// Attributes that are read, besides those of `xformOp`.
const ATTRIBUTES: [&str; 5] =
    ["focalLength", "horizontalAperture", "horizontalApertureOffset", "verticalApertureOffset", "projection"];

/// Metadata of the layer that is read.
const METADATA: [&str; 4] = ["metersPerUnit", "upAxis", "startTimeCode", "endTimeCode"];

/// A layer with its first camera.
pub(super) struct Layer<'a> {
    /// Metadata of the layer.
    pub metadata: HashMap<&'a str, Value<'a>>,
    /// The camera and its ancestors, innermost first; empty if there is none.
    pub camera: Vec<Prim<'a>>,
}

/// A prim with those attributes that are read.
pub(super) struct Prim<'a> {
    pub name: &'a str,
    /// Attributes by their names, without `.timeSamples`.
    pub attributes: HashMap<&'a str, Attribute<'a>>,
    is_camera: bool,
    /// Whether this prim and its ancestors are declared by `def`.
    is_defined: bool,
}

/// Values of an attribute.
#[derive(Default)]
pub(super) struct Attribute<'a> {
    /// Line of the value.
    pub line: usize,
    pub value: Option<Value<'a>>,
    /// Time codes and values, in the order of time.
    pub samples: Vec<(f64, Vec<f64>)>,
}

/// A value. Tuples, arrays and matrices are flattened in their order.
pub(super) enum Value<'a> {
    Numbers(Vec<f64>),
    Texts(Vec<&'a str>),
}

impl Value<'_> {
    /// Returns a single number.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Numbers(numbers) => <[f64; 1]>::try_from(&numbers[..]).ok().map(|[number]| number),
            Self::Texts(_) => None,
        }
    }
}

/// Reads a layer. `name` appears in errors.
pub(super) fn read<'a>(text: &'a str, name: &'a str) -> Result<Layer<'a>, PoseError> {
    let mut reader = Reader { text, line: 1, name, peeked: None };
    let mut layer = Layer { metadata: HashMap::new(), camera: Vec::new() };
    reader.skip_newlines()?;
    if reader.take('(')? {
        layer.metadata = reader.metadata()?;
    }
    let mut open: Vec<Prim<'a>> = Vec::new();
    // Number of ancestors of the last prim of the camera's chain.
    let mut above = 0;
    loop {
        match reader.next()? {
            Token::Newline | Token::Sign(';') => {}
            Token::End if open.is_empty() => break,
            Token::Sign('}') => {
                let prim = open.pop().ok_or_else(|| reader.expected("a prim", Token::Sign('}')))?;
                let found = !layer.camera.is_empty();
                if if found { open.len() < above } else { prim.is_camera && prim.is_defined } {
                    above = open.len();
                    layer.camera.push(prim);
                    if above == 0 {
                        break;
                    }
                }
            }
            Token::Word(specifier @ ("def" | "over" | "class")) => {
                let prim = reader.prim(specifier, open.last())?;
                if open.len() == MAX_DEPTH {
                    return Err(reader.error(format!("more than {MAX_DEPTH} levels of prims")));
                }
                open.push(prim);
            }
            Token::Word(word) => match open.last_mut() {
                Some(prim) => reader.property(word, &mut prim.attributes)?,
                None => reader.property(word, &mut HashMap::new())?,
            },
            token => return Err(reader.expected(if open.is_empty() { "a prim" } else { "a property or `}`" }, token)),
        }
    }
    Ok(layer)
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Token<'a> {
    /// A name, keyword or number.
    Word(&'a str),
    /// A string, asset or path.
    Text(&'a str),
    Sign(char),
    Newline,
    End,
}

struct Reader<'a> {
    /// The text that is left.
    text: &'a str,
    line: usize,
    name: &'a str,
    peeked: Option<Token<'a>>,
}

impl<'a> Reader<'a> {
    /// Reads a prim up to its `{`, after its specifier.
    fn prim(&mut self, specifier: &str, parent: Option<&Prim<'_>>) -> Result<Prim<'a>, PoseError> {
        let (is_camera, name) = match self.next()? {
            Token::Word(kind) => (kind == "Camera", self.next()?),
            name => (false, name),
        };
        let Token::Text(name) = name else { return Err(self.expected("the name of a prim in quotes", name)) };
        self.skip_newlines()?;
        if self.take('(')? {
            self.skip_brackets()?;
            self.skip_newlines()?;
        }
        match self.next()? {
            Token::Sign('{') => {}
            token => return Err(self.expected("`{`", token)),
        }
        let is_defined = specifier == "def" && parent.is_none_or(|parent| parent.is_defined);
        Ok(Prim { name, attributes: HashMap::new(), is_camera, is_defined })
    }

    /// Reads a property up to the end of its line, after its first word.
    fn property(&mut self, first: &'a str, attributes: &mut HashMap<&'a str, Attribute<'a>>) -> Result<(), PoseError> {
        let mut name = first;
        while let Token::Word(_) | Token::Sign('[' | ']') = self.peek()? {
            if let Token::Word(word) = self.next()? {
                name = word;
            }
        }
        let (base, suffix) = name.split_once('.').map_or((name, None), |(base, suffix)| (base, Some(suffix)));
        if (base.starts_with("xformOp") || ATTRIBUTES.contains(&base)) && self.take('=')? {
            let attribute = attributes.entry(base).or_default();
            attribute.line = self.line;
            match suffix {
                None => attribute.value = Some(self.value()?),
                Some("timeSamples") => attribute.samples = self.samples()?,
                Some(_) => return Err(self.error(format!("`{name}` is not supported, only values and timeSamples"))),
            }
        }
        loop {
            match self.peek()? {
                Token::Newline | Token::Sign(';' | '}') | Token::End => return Ok(()),
                _ => self.skip()?,
            }
        }
    }

    /// Reads metadata up to the closing bracket.
    fn metadata(&mut self) -> Result<HashMap<&'a str, Value<'a>>, PoseError> {
        let mut metadata = HashMap::new();
        loop {
            match self.peek()? {
                Token::Sign(')') => {
                    self.next()?;
                    return Ok(metadata);
                }
                Token::Word(key) if METADATA.contains(&key) => {
                    self.next()?;
                    if self.take('=')? {
                        metadata.insert(key, self.value()?);
                    }
                }
                _ => self.skip()?,
            }
        }
    }

    fn value(&mut self) -> Result<Value<'a>, PoseError> {
        let (mut numbers, mut texts, mut depth) = (Vec::new(), Vec::new(), 0usize);
        loop {
            match self.next()? {
                Token::Word(word) => match word.parse::<f64>() {
                    Ok(number) if number.is_finite() => numbers.push(number),
                    _ => return Err(self.expected("a finite number", Token::Word(word))),
                },
                Token::Text(text) => texts.push(text),
                Token::Sign('(' | '[') => depth += 1,
                Token::Sign(')' | ']') if depth > 0 => depth -= 1,
                Token::Sign(',') | Token::Newline if depth > 0 => continue,
                token => return Err(self.expected("a value", token)),
            }
            if numbers.len().max(texts.len()) > MAX_VALUES {
                return Err(self.error(format!("a value of more than {MAX_VALUES} numbers")));
            }
            if depth == 0 {
                break;
            }
        }
        match (numbers.is_empty(), texts.is_empty()) {
            (false, false) => Err(self.error("a value of both numbers and texts")),
            (true, false) => Ok(Value::Texts(texts)),
            (_, true) => Ok(Value::Numbers(numbers)),
        }
    }

    /// Reads samples `{ time: value, … }`, sorted by time.
    fn samples(&mut self) -> Result<Vec<(f64, Vec<f64>)>, PoseError> {
        match self.next()? {
            Token::Sign('{') => {}
            token => return Err(self.expected("`{` of time samples", token)),
        }
        let mut samples: Vec<(f64, Vec<f64>)> = Vec::new();
        loop {
            match self.next()? {
                Token::Newline | Token::Sign(',') => {}
                Token::Sign('}') => break,
                Token::Word(word) => {
                    let time = word.parse().ok().filter(|time: &f64| time.is_finite());
                    let time = time.ok_or_else(|| self.expected("a time code", Token::Word(word)))?;
                    match self.next()? {
                        Token::Sign(':') => {}
                        token => return Err(self.expected("`:` after a time code", token)),
                    }
                    let Value::Numbers(numbers) = self.value()? else {
                        return Err(self.error("a time sample is not a number"));
                    };
                    samples.push((time, numbers));
                }
                token => return Err(self.expected("a time code or `}`", token)),
            }
            if samples.len() > MAX_SAMPLES {
                return Err(self.error(format!("more than {MAX_SAMPLES} time samples")));
            }
        }
        samples.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        Ok(samples)
    }

    /// Skips a token, or brackets with their content.
    fn skip(&mut self) -> Result<(), PoseError> {
        match self.next()? {
            Token::Sign('(' | '[' | '{') => self.skip_brackets(),
            Token::End => Err(self.error("the file ends in the middle of brackets")),
            _ => Ok(()),
        }
    }

    /// Skips up to the bracket that closes one that has been read.
    fn skip_brackets(&mut self) -> Result<(), PoseError> {
        let mut depth = 1;
        while depth > 0 {
            match self.next()? {
                Token::Sign('(' | '[' | '{') => depth += 1,
                Token::Sign(')' | ']' | '}') => depth -= 1,
                Token::End => return Err(self.error("the file ends in the middle of brackets")),
                _ => {}
            }
        }
        Ok(())
    }

    fn skip_newlines(&mut self) -> Result<(), PoseError> {
        while self.peek()? == Token::Newline {
            self.next()?;
        }
        Ok(())
    }

    /// Reads a sign if it is next.
    fn take(&mut self, sign: char) -> Result<bool, PoseError> {
        let is_next = self.peek()? == Token::Sign(sign);
        if is_next {
            self.next()?;
        }
        Ok(is_next)
    }

    fn peek(&mut self) -> Result<Token<'a>, PoseError> {
        let token = match self.peeked {
            Some(token) => token,
            None => self.token()?,
        };
        self.peeked = Some(token);
        Ok(token)
    }

    fn next(&mut self) -> Result<Token<'a>, PoseError> {
        let token = match self.peeked.take() {
            Some(token) => token,
            None => self.token()?,
        };
        self.line += usize::from(token == Token::Newline);
        Ok(token)
    }

    fn token(&mut self) -> Result<Token<'a>, PoseError> {
        self.text = self.text.trim_start_matches([' ', '\t', '\r']);
        if self.text.starts_with('#') {
            self.text = &self.text[self.text.find('\n').unwrap_or(self.text.len())..];
        }
        let Some(first) = self.text.chars().next() else { return Ok(Token::End) };
        match first {
            '\n' => {
                self.text = &self.text[1..];
                Ok(Token::Newline)
            }
            '"' => self.quoted(if self.text.starts_with("\"\"\"") { "\"\"\"" } else { "\"" }),
            '\'' => self.quoted(if self.text.starts_with("'''") { "'''" } else { "'" }),
            '@' => self.quoted(if self.text.starts_with("@@@") { "@@@" } else { "@" }),
            '<' => self.quoted(">"),
            _ => {
                let length = word_length(self.text);
                let (token, rest) = self.text.split_at(if length == 0 { first.len_utf8() } else { length });
                self.text = rest;
                Ok(if length == 0 { Token::Sign(first) } else { Token::Word(token) })
            }
        }
    }

    /// Reads a text up to its closing quotes.
    fn quoted(&mut self, close: &str) -> Result<Token<'a>, PoseError> {
        let text = &self.text[if close == ">" { 1 } else { close.len() }..];
        // Assets and paths have no escapes, except for \@@@, which no attribute in use has.
        let escapes = close.starts_with(['"', '\'']);
        let mut from = 0;
        let length = loop {
            let Some(at) = text[from..].find(close).map(|at| from + at) else {
                return Err(self.error("a text in quotes has no end"));
            };
            let backslashes = text[..at].bytes().rev().take_while(|byte| *byte == b'\\').count();
            if !escapes || backslashes % 2 == 0 {
                break at;
            }
            from = at + 1;
        };
        self.line += text[..length].matches('\n').count();
        self.text = &text[length + close.len()..];
        Ok(Token::Text(&text[..length]))
    }

    fn expected(&self, expected: &str, found: Token<'_>) -> PoseError {
        let clip = |text: &str| text.chars().take(40).collect::<String>();
        // The end of a line has been counted already.
        let line = self.line - usize::from(found == Token::Newline);
        let found = match found {
            Token::Word(word) => format!("`{}`", clip(word)),
            Token::Text(text) => format!("\"{}\"", clip(text)),
            Token::Sign(sign) => format!("`{sign}`"),
            Token::Newline => "the end of the line".to_owned(),
            Token::End => "the end of the file".to_owned(),
        };
        content(self.name, format!("line {line}: expected {expected}, found {found}"))
    }

    fn error(&self, what: impl std::fmt::Display) -> PoseError {
        content(self.name, format!("line {}: {what}", self.line))
    }
}

/// Length of the word at the start of a text, bytes; 0 if there is none.
fn word_length(text: &str) -> usize {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    let mut chars = text.char_indices().peekable();
    let is_number = text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
    while let Some((at, c)) = chars.next() {
        let follows_name = chars.peek().is_some_and(|(_, next)| is_name(*next));
        // A colon in a name has a letter after it, unlike one after a time code.
        let belongs = is_name(c) || c == '.' || if is_number { "+-".contains(c) } else { c == ':' && follows_name };
        if !belongs {
            return at;
        }
    }
    text.len()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn first_defined_camera_with_its_ancestors() {
        let text = r##"#usda 1.0
(
    "a comment with a # and a )"
    customLayerData = { string upAxis = "X"; dictionary a = {} }
    subLayers = [@a (1).usda@, @@@b@c@@@]
    metersPerUnit = 0.01   # comment
    upAxis = "Y"
)
class Camera "template" { float focalLength = 1 }
over "elsewhere" { def Camera "undefined" { float focalLength = 2 } }
def Mesh "mesh" { int[] faceVertexCounts = [3, 3] ( interpolation = "x" ); point3f[] points = [(0, 0, 0)] }
def Xform "a" (
    prepend references = @x.usd@</b> ( offset = 3 )
    doc = """quotes \""" and 'brackets' } """
)
{
    variantSet "v" = {
        "one" { def Camera "variant" { } }
    }
    rel target = </a/b>
    def "empty"
    {
    }
    def Camera "b" { float focalLength = 3; add token[] apiSchemas = ["x"]
        float focalLength.timeSamples = { 2: 5, 1.5: (4), }
        custom string userProperties:x:y = 'a\'b'
        uniform token[] xformOpOrder = [
            "xformOp:translate", "!invert!xformOp:translate",
        ] }
    def Camera "second" { float focalLength = 9 }
    double3 xformOp:translate = (1, -2e1, .5)
}
def Camera "third" {}
unread = }
"##;
        let layer = read(text, "file").unwrap_or_else(|error| panic!("{error}"));
        let names: Vec<&str> = layer.camera.iter().map(|prim| prim.name).collect();
        assert_eq!(names, ["b", "a"]);
        assert_eq!(layer.metadata["metersPerUnit"].number(), Some(0.01));
        assert!(matches!(&layer.metadata["upAxis"], Value::Texts(texts) if texts[..] == ["Y"]));
        let focal = &layer.camera[0].attributes["focalLength"];
        assert_eq!(focal.samples, [(1.5, vec![4.0]), (2.0, vec![5.0])]);
        assert_eq!(focal.value.as_ref().unwrap().number(), Some(3.0));
        let order = &layer.camera[0].attributes["xformOpOrder"].value;
        assert!(matches!(order, Some(Value::Texts(texts)) if texts.len() == 2));
        let translate = &layer.camera[1].attributes["xformOp:translate"];
        assert!(matches!(&translate.value, Some(Value::Numbers(numbers)) if numbers[..] == [1.0, -20.0, 0.5]));
        assert_eq!(translate.line, 31);
    }

    #[test]
    fn invalid_texts_are_named() {
        let deep = format!("#usda 1.0\n{}", "def \"a\" {".repeat(MAX_DEPTH + 1));
        for (text, expected) in [
            ("#usda 1.0\n(\n", "file: line 3: the file ends in the middle of brackets"),
            ("#usda 1.0\ndef Camera b {}", "line 2: expected the name of a prim in quotes, found `b`"),
            ("#usda 1.0\ndef Camera \"b\"", "line 2: expected `{`, found the end of the file"),
            ("#usda 1.0\ndef \"a\" {\n", "line 3: expected a property or `}`, found the end of the file"),
            ("#usda 1.0\n}", "line 2: expected a prim, found `}`"),
            ("#usda 1.0\n\"\"\"a", "line 2: a text in quotes has no end"),
            ("#usda 1.0\ndef \"a\" {\nfloat focalLength = x\n}", "line 3: expected a finite number, found `x`"),
            ("#usda 1.0\ndef \"a\" {\nfloat focalLength = inf\n}", "expected a finite number, found `inf`"),
            ("#usda 1.0\ndef \"a\" {\nfloat focalLength = \n}", "line 3: expected a value, found the end of the line"),
            ("#usda 1.0\ndef \"a\" {\nfloat focalLength = (1, \"a\")\n}", "a value of both numbers and texts"),
            ("#usda 1.0\ndef \"a\" {\nfloat focalLength.timeSamples = 1", "line 3: expected `{` of time samples"),
            ("#usda 1.0\ndef \"a\" {\nfloat focalLength.timeSamples = { a: 1 }", "expected a time code, found `a`"),
            ("#usda 1.0\ndef \"a\" {\nfloat focalLength.timeSamples = { 1 1 }", "expected `:` after a time code"),
            ("#usda 1.0\ndef \"a\" {\nfloat focalLength.timeSamples = { 1: \"\" }", "a time sample is not a number"),
            ("#usda 1.0\ndef \"a\" {\nfloat focalLength.connect = </b>", "`focalLength.connect` is not supported"),
            (&deep, "more than 256 levels"),
        ] {
            let error = read(text, "file").err().map_or_else(String::new, |error| error.to_string());
            assert!(error.contains(expected), "{error:?} has no {expected:?} for {text:?}");
        }
    }
}
