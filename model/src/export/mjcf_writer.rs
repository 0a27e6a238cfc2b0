//! An MJCF document under construction, and the names that its tendons refer to.

use std::collections::BTreeMap;

use super::names::Names;
use super::parts::Parts;
use super::xml::Xml;

/// The document under construction.
pub(super) struct Writer<'a> {
    pub xml: Xml,
    pub names: Names,
    pub parts: &'a Parts,
}

/// Names assigned to gears and bearings of the bodies, by joint.
#[derive(Debug, Default)]
pub(super) struct Marks {
    pub gears: BTreeMap<usize, String>,
    pub bearings: BTreeMap<usize, String>,
    pub journals: BTreeMap<usize, String>,
}
