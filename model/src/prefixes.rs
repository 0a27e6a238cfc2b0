//! XML with undeclared name-space prefixes, as in the output of some URDF generators: this module inserts the missing declarations.

use std::borrow::Cow;

use roxmltree::{Document, Error, ParsingOptions};

/// Most XML nodes of a file; a robot with meshes by reference has some thousands.
const MAX_NODES: u32 = 2_000_000;
/// Most attributes of an element: the parser compares each with all before it. No element of URDF or MJCF has more than some dozens.
pub(super) const MAX_ATTRIBUTES: usize = 1000;
/// Most prefixes that the module declares for a file. Each requires another parsing of the file.
const MAX_PREFIXES: usize = 32;

/// A text with inserted declarations in its first element, and their position.
pub(super) struct Declared<'a> {
    pub text: Cow<'a, str>,
    /// Byte offset of the inserted declarations, and their length.
    pub inserted: (usize, usize),
    /// The prefixes.
    pub prefixes: Vec<String>,
}

impl<'a> Declared<'a> {
    /// `text` with declarations for the prefixes that lack one.
    ///
    /// # Errors
    /// The parser's error, for a text that is invalid XML for another reason.
    pub fn new(text: &'a str) -> Result<Self, Error> {
        let mut declared = Declared { text: Cow::Borrowed(text), inserted: (0, 0), prefixes: Vec::new() };
        loop {
            let error = match Document::parse_with_options(&declared.text, options()) {
                Ok(_) => return Ok(declared),
                Err(error) => error,
            };
            let prefix = match &error {
                Error::UnknownNamespace(prefix, _) if prefix != "xacro" => prefix.clone(),
                _ => return Err(error),
            };
            if declared.prefixes.contains(&prefix) || declared.prefixes.len() == MAX_PREFIXES {
                return Err(error);
            }
            let Some(at) = end_of_first_name(text) else { return Err(error) };
            declared.prefixes.push(prefix);
            let namespaces =
                declared.prefixes.iter().map(|prefix| format!(" xmlns:{prefix}=\"urn:{prefix}\""));
            let namespaces = namespaces.collect::<String>();
            declared.text = Cow::Owned(format!("{}{namespaces}{}", &text[..at], &text[at..]));
            declared.inserted = (at, namespaces.len());
        }
    }
}

/// Byte offset of the first element with more than [`MAX_ATTRIBUTES`] attributes.
pub(super) fn crowded_tag(text: &str) -> Option<usize> {
    let mut rest = 0;
    loop {
        let at = rest + text[rest..].find('<')?;
        let tag = &text[at..];
        let of = |start: &str, end: &str| tag.starts_with(start).then(|| tag.find(end).unwrap_or(tag.len()));
        let length = of("<!--", "-->").or_else(|| of("<![CDATA[", "]]>")).or_else(|| of("<?", "?>"));
        rest = at
            + match length {
                Some(length) => length,
                None => {
                    let (length, attributes) = extent(tag);
                    if attributes > MAX_ATTRIBUTES {
                        return Some(at);
                    }
                    length
                }
            };
    }
}

/// Length of the tag at the start of `text`, and the number of its attributes.
fn extent(text: &str) -> (usize, usize) {
    let (mut quote, mut attributes) = (None, 0);
    for (at, byte) in text.bytes().enumerate() {
        match (byte, quote) {
            (b'>', None) => return (at, attributes),
            (b'"' | b'\'', None) => quote = Some(byte),
            (b'=', None) => attributes += 1,
            (_, Some(open)) if byte == open => quote = None,
            _ => {}
        }
    }
    (text.len(), attributes)
}

/// Options of the XML parser.
pub(super) fn options<'input>() -> ParsingOptions<'input> {
    ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() }
}

/// Byte offset behind the name of the first element.
fn end_of_first_name(text: &str) -> Option<usize> {
    let mut rest = 0;
    loop {
        let at = rest + text[rest..].find('<')?;
        let tag = &text[at + 1..];
        if let Some(comment) = tag.strip_prefix("!--") {
            rest = text.len() - comment.len() + comment.find("-->")?;
        } else if tag.starts_with(['?', '!']) {
            rest = at + 1;
        } else {
            return Some(at + 1 + tag.find(|c: char| c.is_whitespace() || c == '>' || c == '/')?);
        }
    }
}
