//! Elements and attributes of a URDF file, with errors that contain their place.

use roxmltree::{Attribute, Node};

use crate::error::{ModelError, shortened};
use crate::numbers::parse_numbers;
use freeplay_arm::Place;

/// The text and its name, for places in errors.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub origin: &'a str,
    pub text: &'a str,
    /// Byte offset of the text inserted for the parser, and its length.
    pub inserted: (usize, usize),
}

impl Source<'_> {
    /// The place in the original text of the parser's byte `offset`.
    pub fn place(&self, offset: usize) -> Place {
        let (at, length) = self.inserted;
        let offset = if offset > at { offset.saturating_sub(length).max(at) } else { offset };
        Place::in_text(self.origin, self.text, offset)
    }
}

/// Reads elements and collects notes on them.
pub(super) struct Reader<'a> {
    pub source: Source<'a>,
    pub notes: Vec<String>,
}

impl Reader<'_> {
    /// The first child called `tag`, like the ROS parser; further ones become a note.
    pub fn first<'d, 'i>(&mut self, node: Node<'d, 'i>, tag: &str, owner: &str) -> Option<Node<'d, 'i>> {
        let count = children(node, tag).count();
        if count > 1 {
            let within = node.tag_name().name();
            self.notes.push(format!("{owner}: {count} <{tag}> in one <{within}>; the first one counts"));
        }
        children(node, tag).next()
    }

    pub fn not_negative(
        &self,
        node: Node<'_, '_>,
        name: &str,
        owner: &str,
    ) -> Result<Option<f64>, ModelError> {
        let value = self.number(node, name, owner)?;
        if let Some(attribute) = node.attribute_node(name).filter(|_| value.is_some_and(|v| v < 0.0)) {
            let what = format!("{owner}: <{} {name}>", node.tag_name().name());
            return Err(self.value_error(attribute, what, "it must not be negative".to_owned()));
        }
        Ok(value)
    }

    pub fn number(&self, node: Node<'_, '_>, name: &str, owner: &str) -> Result<Option<f64>, ModelError> {
        Ok(self.numbers::<1>(node, name, owner)?.map(|[value]| value))
    }

    /// The numbers of an attribute; `None` without it.
    pub fn numbers<const N: usize>(
        &self,
        node: Node<'_, '_>,
        name: &str,
        owner: &str,
    ) -> Result<Option<[f64; N]>, ModelError> {
        let Some(attribute) = node.attribute_node(name) else { return Ok(None) };
        parse_numbers(attribute.value()).map(Some).map_err(|remedy| {
            self.value_error(attribute, format!("{owner}: <{} {name}>", node.tag_name().name()), remedy)
        })
    }

    pub fn required<'d, 'i>(
        &self,
        node: Node<'d, 'i>,
        name: &str,
        owner: &str,
    ) -> Result<Attribute<'d, 'i>, ModelError> {
        let tag = node.tag_name().name();
        node.attribute_node(name).filter(|a| !a.value().trim().is_empty()).ok_or_else(|| {
            ModelError::Missing {
                at: self.place(node),
                what: format!("{owner}: attribute `{name}` of <{tag}>"),
                remedy: format!("write <{tag} {name}=\"…\">"),
            }
        })
    }

    pub fn value_error(&self, attribute: Attribute<'_, '_>, what: String, remedy: String) -> ModelError {
        let at = self.source.place(attribute.range_value().start);
        ModelError::Value { at, what, value: shortened(attribute.value()), remedy }
    }

    pub fn place(&self, node: Node<'_, '_>) -> Place {
        self.source.place(node.range().start)
    }
}

/// The child elements called `tag`.
pub(super) fn children<'d, 'i>(node: Node<'d, 'i>, tag: &str) -> impl Iterator<Item = Node<'d, 'i>> {
    node.children().filter(move |child| child.has_tag_name(tag))
}
