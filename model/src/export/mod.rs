//! A mechanism → the text of a URDF or MJCF file.
//!
//! A [`Mechanism`] is a rigid arm with [`Element`]s, in terms that are common to multibody tools. Each format writes the elements that it
//! can express and lists the others: [`Exported::not_expressed`], which also appear as a comment at the top of the file.

mod element;
mod inertia;
mod mjcf;
mod mjcf_joint;
mod mjcf_tendon;
mod mjcf_writer;
mod names;
mod parts;
mod rotation;
mod urdf;
mod xml;

use freeplay_arm::Arm;

pub use element::{Channel, Element};
pub use mjcf::to_mjcf;
pub use urdf::to_urdf;

/// A rigid arm with all elements for an exported file.
#[derive(Clone, Debug)]
pub struct Mechanism {
    /// The rigid arm, including the changes of masses, lengths and gravity.
    pub arm: Arm,
    /// The elements beyond it, in the order in which they act on a measurement.
    pub elements: Vec<Named>,
    /// Properties that no format can express, one line each.
    pub not_expressed: Vec<String>,
}

/// An element with the words that name it in a list, such as `coulomb_friction at joint_3`.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// The words.
    pub name: String,
    /// The element.
    pub element: Element,
}

/// A written file.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The text of the file.
    pub text: String,
    /// Properties of the model that the file cannot express, one line each.
    pub not_expressed: Vec<String>,
}

/// The comment at the top of a file.
fn heading(not_expressed: &[String]) -> Vec<String> {
    let mut lines = vec![format!("Written by freeplay {}. SI units, radians.", env!("CARGO_PKG_VERSION"))];
    if not_expressed.is_empty() {
        lines.push("This file expresses the whole model.".to_owned());
    } else {
        lines.push("This file cannot express:".to_owned());
        lines.extend(not_expressed.iter().map(|line| format!("- {line}")));
    }
    lines
}
