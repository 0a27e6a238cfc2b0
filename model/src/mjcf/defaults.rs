//! `<default>` classes: the values of attributes that an element does not give.

use std::collections::HashMap;

use roxmltree::{Attribute, Node};

/// Name of the class of elements without a class, whatever its name in the file.
const ROOT: &str = "";

/// The classes of a file by name: their element, and their parent class.
pub(super) struct Defaults<'d, 'i> {
    classes: HashMap<&'d str, (Node<'d, 'i>, Option<&'d str>)>,
}

impl<'d, 'i> Defaults<'d, 'i> {
    /// The classes of the file with this root element.
    pub fn of(root: Node<'d, 'i>) -> Self {
        let mut classes = HashMap::new();
        let mut open: Vec<(Node<'d, 'i>, Option<&'d str>)> = Vec::new();
        for (number, node) in root.children().filter(|node| node.has_tag_name("default")).enumerate() {
            if number == 0 {
                classes.insert(ROOT, (node, None));
            }
            open.push((node, None));
        }
        while let Some((node, parent)) = open.pop() {
            let name = node.attribute("class").unwrap_or(ROOT);
            classes.entry(name).or_insert((node, parent.or(Some(ROOT).filter(|root| *root != name))));
            let nested = node.children().filter(|child| child.has_tag_name("default"));
            open.extend(nested.map(|child| (child, Some(name))));
        }
        Defaults { classes }
    }

    /// The element that gives the attribute `name` for `node`: itself, else its class or that of the bodies around it, outwards.
    pub fn holder(
        &self,
        node: Node<'d, 'i>,
        childclass: Option<&'d str>,
        name: &str,
    ) -> Option<Node<'d, 'i>> {
        if node.attribute(name).is_some() {
            return Some(node);
        }
        let tag = node.tag_name().name();
        let mut class = node.attribute("class").or(childclass).unwrap_or(ROOT);
        // The nesting of a class is at most as deep as the number of classes.
        for _ in 0..=self.classes.len() {
            let (element, parent) = self.classes.get(class)?;
            let mut of_tag = element.children().filter(|child| child.has_tag_name(tag));
            if let Some(said) = of_tag.rfind(|child| child.attribute(name).is_some()) {
                return Some(said);
            }
            class = (*parent)?;
        }
        None
    }

    /// The attribute `name` of `node`, from itself or from its class.
    pub fn attribute(
        &self,
        node: Node<'d, 'i>,
        childclass: Option<&'d str>,
        name: &str,
    ) -> Option<Attribute<'d, 'i>> {
        self.holder(node, childclass, name)?.attribute_node(name)
    }
}
