//! `modelDescription.xml` of FMI 3.0.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use freeplay_laws::LawError;
use freeplay_model::ArmFile;
use sha2::{Digest, Sha256};

use crate::machine::PERIOD;
use crate::units::{BASES, exponents};
use crate::variables::{Causality, Value, Variable, Variables};

/// Name of the library in an FMU, without its extension.
pub const LIBRARY: &str = "freeplay_fmi";

/// The instantiation token of an FMU whose arm file has this `text`. An importer checks with it that description and library belong
/// together.
pub(crate) fn token(text: &str) -> String {
    let digest = Sha256::digest(format!("freeplay-fmu-1\n{}\n{text}", env!("CARGO_PKG_VERSION")));
    let hex: String = digest.iter().take(16).map(|byte| format!("{byte:02x}")).collect();
    format!("{{{hex}}}")
}

/// The description of the FMU of `file`, whose arm file has this `text`.
///
/// # Errors
/// [`LawError`]: an unusable effect.
pub fn description(file: &ArmFile, text: &str) -> Result<String, LawError> {
    let variables = Variables::of(file)?;
    let mut xml = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let name = escaped(file.arm.name());
    let _ = writeln!(
        xml,
        "<fmiModelDescription fmiVersion=\"3.0\" modelName=\"{name}\" instantiationToken=\"{}\" description=\"A robot arm with the effects that its rigid model leaves out\" generationTool=\"freeplay {}\" variableNamingConvention=\"flat\">",
        token(text),
        env!("CARGO_PKG_VERSION")
    );
    let _ = writeln!(
        xml,
        "  <CoSimulation modelIdentifier=\"{LIBRARY}\" canHandleVariableCommunicationStepSize=\"true\" fixedInternalStepSize=\"{PERIOD}\" canGetAndSetFMUState=\"true\" canSerializeFMUState=\"true\"/>"
    );
    write_units(&mut xml, &variables);
    xml.push_str("  <LogCategories>\n    <Category name=\"logStatusError\"/>\n  </LogCategories>\n");
    let _ = writeln!(xml, "  <DefaultExperiment startTime=\"0\" stopTime=\"1\" stepSize=\"{PERIOD}\"/>");
    xml.push_str("  <ModelVariables>\n");
    for (reference, variable) in variables.0.iter().enumerate() {
        write_variable(&mut xml, reference, variable);
    }
    xml.push_str("  </ModelVariables>\n  <ModelStructure>\n");
    let outputs =
        variables.0.iter().enumerate().filter(|(_, variable)| variable.causality == Causality::Output);
    for tag in ["Output", "InitialUnknown"] {
        for (reference, _) in outputs.clone() {
            let _ = writeln!(xml, "    <{tag} valueReference=\"{reference}\"/>");
        }
    }
    xml.push_str("  </ModelStructure>\n</fmiModelDescription>\n");
    Ok(xml)
}

fn write_units(xml: &mut String, variables: &Variables) {
    let units: BTreeSet<&str> =
        variables.0.iter().map(|variable| variable.unit.as_str()).filter(|unit| !unit.is_empty()).collect();
    xml.push_str("  <UnitDefinitions>\n");
    for unit in units {
        let _ = match exponents(unit) {
            None => writeln!(xml, "    <Unit name=\"{unit}\"/>"),
            Some(powers) => {
                let powers = BASES.iter().zip(powers).filter(|(_, power)| *power != 0);
                let powers: String = powers.map(|(base, power)| format!(" {base}=\"{power}\"")).collect();
                writeln!(xml, "    <Unit name=\"{unit}\">\n      <BaseUnit{powers}/>\n    </Unit>")
            }
        };
    }
    xml.push_str("  </UnitDefinitions>\n");
}

fn write_variable(xml: &mut String, reference: usize, variable: &Variable) {
    let Variable { name, description, unit, causality, bounds, start, .. } = variable;
    let (tag, value) = match start {
        Value::Real(value) => ("Float64", value.to_string()),
        Value::Whole(value) => ("Int32", value.to_string()),
        Value::Truth(value) => ("Boolean", value.to_string()),
    };
    let _ = write!(
        xml,
        "    <{tag} name=\"{}\" valueReference=\"{reference}\" description=\"{}\"",
        escaped(name),
        escaped(description)
    );
    let (causality, variability, initial) = match (causality, start) {
        (Causality::Independent, _) => ("independent", "continuous", ""),
        (Causality::Parameter, _) => ("parameter", "tunable", "exact"),
        (Causality::Input, Value::Real(_)) => ("input", "continuous", ""),
        (Causality::Input, _) => ("input", "discrete", ""),
        (Causality::Output, Value::Real(_)) => ("output", "continuous", "calculated"),
        (Causality::Output, _) => ("output", "discrete", "calculated"),
    };
    // A parameter is set before the start and fixed afterwards.
    let variability = if variability == "tunable" { "fixed" } else { variability };
    let _ = write!(xml, " causality=\"{causality}\" variability=\"{variability}\"");
    if !initial.is_empty() {
        let _ = write!(xml, " initial=\"{initial}\"");
    }
    if matches!(start, Value::Real(_)) && !unit.is_empty() {
        let _ = write!(xml, " unit=\"{}\"", escaped(unit));
    }
    for (attribute, bound) in ["min", "max"].into_iter().zip(bounds) {
        if bound.is_finite() {
            let _ = write!(xml, " {attribute}=\"{bound}\"");
        }
    }
    if ["parameter", "input"].contains(&causality) {
        let _ = write!(xml, " start=\"{value}\"");
    }
    xml.push_str("/>\n");
}

fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            c if c.is_control() => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}
