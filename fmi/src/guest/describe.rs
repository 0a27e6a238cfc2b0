//! Reads `modelDescription.xml` of a third-party FMU.

use roxmltree::{Document, Node, ParsingOptions};

use super::GuestError;

/// The version of FMI.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// 2.0.
    Two,
    /// 3.0.
    Three,
}

/// Contents of the description.
#[derive(Clone, Debug, PartialEq)]
pub struct Guest {
    /// The version of FMI.
    pub version: Version,
    /// Name of the library.
    pub identifier: String,
    /// GUID or instantiation token.
    pub token: String,
    /// Numeric inputs: name and value reference.
    pub inputs: Vec<(String, u32)>,
    /// Numeric outputs: name and value reference.
    pub outputs: Vec<(String, u32)>,
}

/// Largest number of XML nodes of a description.
const MAX_NODES: u32 = 1_000_000;

impl Guest {
    /// Reads the description `text`.
    ///
    /// # Errors
    /// [`GuestError::Description`] with its fault.
    pub fn parse(text: &str) -> Result<Guest, GuestError> {
        let wrong = |what: &str| GuestError::Description(what.to_owned());
        let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
        let document = Document::parse_with_options(text, options)
            .map_err(|error| GuestError::Description(error.to_string()))?;
        let root = document.root_element();
        if root.tag_name().name() != "fmiModelDescription" {
            return Err(wrong("the root element is not fmiModelDescription"));
        }
        let version = match root.attribute("fmiVersion").unwrap_or_default() {
            "2.0" => Version::Two,
            version if version.starts_with("3.0") => Version::Three,
            other => return Err(GuestError::Description(format!("FMI {other:?} is neither 2.0 nor 3.0"))),
        };
        let child = |tag: &str| root.children().find(|child| child.has_tag_name(tag));
        let simulation =
            child("CoSimulation").ok_or_else(|| wrong("it is no FMU for Co-Simulation; export it as one"))?;
        let identifier = simulation.attribute("modelIdentifier").unwrap_or_default().to_owned();
        if identifier.is_empty() || identifier.contains(['/', '\\', '.']) {
            return Err(wrong("the modelIdentifier is no name of a library"));
        }
        let token = match version {
            Version::Two => root.attribute("guid"),
            Version::Three => root.attribute("instantiationToken"),
        };
        let token = token.ok_or_else(|| wrong("it has no guid or instantiationToken"))?.to_owned();
        let variables = child("ModelVariables").ok_or_else(|| wrong("it has no ModelVariables"))?;
        let mut guest = Guest { version, identifier, token, inputs: Vec::new(), outputs: Vec::new() };
        for variable in variables.children().filter(Node::is_element) {
            guest.add(variable)?;
        }
        Ok(guest)
    }

    fn add(&mut self, variable: Node<'_, '_>) -> Result<(), GuestError> {
        let list = match variable.attribute("causality") {
            Some("input") => &mut self.inputs,
            Some("output") => &mut self.outputs,
            _ => return Ok(()),
        };
        let name = variable.attribute("name").unwrap_or_default();
        let has = |tag: &str| variable.children().any(|child| child.has_tag_name(tag));
        let is_number = match self.version {
            Version::Two => has("Real"),
            Version::Three => variable.has_tag_name("Float64"),
        };
        if !is_number {
            return Ok(());
        }
        if has("Dimension") {
            let what = format!("`{name}` is an array; give each number a variable of its own");
            return Err(GuestError::Description(what));
        }
        let reference = variable.attribute("valueReference").and_then(|word| word.parse().ok());
        let reference =
            reference.ok_or_else(|| GuestError::Description(format!("`{name}` has no valueReference")))?;
        list.push((name.to_owned(), reference));
        Ok(())
    }
}
