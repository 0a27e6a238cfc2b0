//! A writer of XML: elements with attributes, indented.

use std::fmt::Write;

/// A text of elements, written from its beginning to its end.
#[derive(Debug)]
pub(super) struct Xml {
    text: String,
    open: Vec<&'static str>,
}

impl Xml {
    /// The beginning of a document.
    pub fn new() -> Xml {
        Xml { text: "<?xml version=\"1.0\"?>\n".to_owned(), open: Vec::new() }
    }

    /// A comment of several lines.
    pub fn comment<'a>(&mut self, lines: impl IntoIterator<Item = &'a str>) {
        self.text.push_str("<!--\n");
        for line in lines {
            // XML does not permit two hyphens in a row in a comment, nor control characters.
            let line: String = line.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
            self.text.extend(["  ", &line.replace("--", "- -"), "\n"]);
        }
        self.text.push_str("-->\n");
    }

    /// Writes an element without content.
    pub fn empty(&mut self, tag: &str, attributes: &[(&str, String)]) {
        self.begin(tag, attributes);
        self.text.push_str("/>\n");
    }

    /// Starts an element with content.
    pub fn start(&mut self, tag: &'static str, attributes: &[(&str, String)]) {
        self.begin(tag, attributes);
        self.text.push_str(">\n");
        self.open.push(tag);
    }

    /// Ends the innermost open element.
    pub fn end(&mut self) {
        if let Some(tag) = self.open.pop() {
            let indent = "  ".repeat(self.open.len());
            self.text.extend([indent.as_str(), "</", tag, ">\n"]);
        }
    }

    /// The whole text, with all elements ended.
    pub fn finish(mut self) -> String {
        while !self.open.is_empty() {
            self.end();
        }
        self.text
    }

    fn begin(&mut self, tag: &str, attributes: &[(&str, String)]) {
        let indent = "  ".repeat(self.open.len());
        self.text.extend([indent.as_str(), "<", tag]);
        for (name, value) in attributes {
            self.text.extend([" ", name, "=\"", &escaped(value), "\""]);
        }
    }
}

/// The value of an attribute with its special characters escaped.
fn escaped(value: &str) -> String {
    let mut text = String::with_capacity(value.len());
    for c in value.chars() {
        match c {
            '&' => text.push_str("&amp;"),
            '<' => text.push_str("&lt;"),
            '>' => text.push_str("&gt;"),
            '"' => text.push_str("&quot;"),
            '\t' => text.push_str("&#9;"),
            c if c.is_control() => text.push('\u{fffd}'),
            c => text.push(c),
        }
    }
    text
}

/// Numbers with all their digits, separated by spaces.
pub(super) fn numbers(values: &[f64]) -> String {
    let mut text = String::new();
    for value in values {
        let separator = if text.is_empty() { "" } else { " " };
        // Zero has no sign in a file; the digits are the shortest that read back to the same number.
        let value = if *value == 0.0 { 0.0 } else { *value };
        let _ = match value != 0.0 && !(1e-5..1e7).contains(&value.abs()) {
            true => write!(text, "{separator}{value:e}"),
            false => write!(text, "{separator}{value}"),
        };
    }
    text
}

/// One number with all its digits.
pub(super) fn number(value: f64) -> String {
    numbers(&[value])
}

#[cfg(test)]
mod tests {
    use super::{Xml, numbers};

    #[test]
    fn names_and_comments_can_hold_anything() {
        let mut xml = Xml::new();
        xml.comment(["a -- b", "line\u{7}"]);
        xml.start("robot", &[("name", "a<b & \"c\"".to_owned())]);
        xml.empty("link", &[("name", "x\u{1b}".to_owned())]);
        let text = xml.finish();
        let document = roxmltree::Document::parse(&text).expect("well-formed");
        assert_eq!(document.root_element().attribute("name"), Some("a<b & \"c\""));
    }

    #[test]
    fn numbers_read_back_to_the_same_bits() {
        for value in [0.1 + 0.2, 1e-300, -2.5e17, 1.0 / 3.0, 5e-324, f64::MAX] {
            assert_eq!(numbers(&[value]).parse::<f64>().expect("a number").to_bits(), value.to_bits());
        }
        assert_eq!(numbers(&[-0.0, 1.0]), "0 1");
    }
}
