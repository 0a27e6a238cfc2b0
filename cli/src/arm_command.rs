//! `freeplay arm`: shows the content of a model file: the chain of the arm, its joints, its effects, and unused parts.

use std::fmt::Write as _;

use clap::Args;
use comfy_table::CellAlignment;
use freeplay_arm::{Joint, JointKind};
use freeplay_harness::setup::load_selected;
use freeplay_model::{ArmFile, Selection};
use freeplay_report::one_line;
use freeplay_report::text::{Digits, MISSING_NUMBER, number};
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::layout::text_table;
use freeplay_terminal::output::{say, show};
use serde_json::{Value, json};

/// Shows the contents of a model file.
#[derive(Args, Debug)]
pub struct ArmArgs {
    /// Model: an arm file (URDF, MJCF or TOML), or "paper".
    model: String,
    /// Link of the model at the end of the arm. Default: tool0, or the end of the longest chain without its fingers.
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
}

/// Shows the model of `args`.
///
/// # Errors
/// A model file that can't be read, with file, line, column, value and remedy.
pub fn arm(args: &ArmArgs) -> Result<Exit, Failure> {
    let file = load_selected(&args.model, &Selection { tip: args.tip.clone(), joints: Vec::new() })?;
    match args.format {
        Format::Json => say(&format!("{:#}\n", described(&args.model, &file)))?,
        Format::Text => show(&in_words(&args.model, &file))?,
    }
    Ok(Exit::Done)
}

fn kind(joint: &Joint) -> &'static str {
    match joint.kind {
        JointKind::Revolute => "revolute",
        JointKind::Prismatic => "prismatic",
    }
}

/// A number of a JSON document; `None` for a missing limit.
fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

fn described(model: &str, file: &ArmFile) -> Value {
    let joint = |joint: &Joint| {
        json!({
            "name": joint.name, "kind": kind(joint),
            "limits": {
                "lower": finite(joint.limits.lower), "upper": finite(joint.limits.upper),
                "velocity": finite(joint.limits.velocity), "effort": finite(joint.limits.effort),
            },
            "friction": { "viscous": joint.friction.viscous, "coulomb": joint.friction.coulomb },
            "mass": joint.inertia.mass,
        })
    };
    let effects = file.effects.iter().map(|effect| json!({ "kind": effect.kind, "joint": effect.joint }));
    json!({
        "schema": "freeplay.arm/1", "file": model, "name": file.arm.name(),
        "joints": file.arm.joints().iter().map(joint).collect::<Vec<_>>(),
        "effects": effects.collect::<Vec<_>>(), "notes": file.ignored,
    })
}

fn in_words(model: &str, file: &ArmFile) -> String {
    let mut text = format!("{model}: {}, {} joints\n\n", one_line(file.arm.name()), file.arm.dof());
    let mut table = text_table();
    table.set_header(["joint", "kind", "lower", "upper", "velocity", "effort", "viscous", "coulomb", "mass"]);
    let brief = |value: f64| match value.is_finite() {
        true => number(value, Digits::Significant(4)),
        false => MISSING_NUMBER.to_owned(),
    };
    for joint in file.arm.joints() {
        let (limits, friction) = (&joint.limits, &joint.friction);
        let numbers = [
            limits.lower,
            limits.upper,
            limits.velocity,
            limits.effort,
            friction.viscous,
            friction.coulomb,
            joint.inertia.mass,
        ];
        let words = [joint.name.clone(), kind(joint).to_owned()];
        table.add_row(words.into_iter().chain(numbers.map(brief)));
    }
    for column in 2..9 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let _ = writeln!(text, "{table}\n\nunits: rad, rad/s, N·m, N·m·s/rad, kg; m, m/s, N, N·s/m for a slide");
    for effect in &file.effects {
        let place = effect.joint.as_ref().map_or_else(String::new, |joint| format!(" at {joint}"));
        let _ = writeln!(text, "effect: {}{place}", effect.kind);
    }
    for note in &file.ignored {
        let _ = writeln!(text, "note: {}", one_line(note));
    }
    text
}
