//! An MJCF document as it grows, and the names that its tendons refer to.

use std::collections::BTreeMap;

use super::names::Names;
use super::parts::Parts;
use super::xml::Xml;

/// The document as it grows.
pub(super) struct Writer<'a> {
    pub xml: Xml,
    pub names: Names,
    pub parts: &'a Parts,
}

/// Names that were given while the bodies were written, by joint.
#[derive(Debug, Default)]
pub(super) struct Marks {
    pub gears: BTreeMap<usize, String>,
    pub bearings: BTreeMap<usize, String>,
    pub journals: BTreeMap<usize, String>,
}
