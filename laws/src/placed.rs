//! An effect at its place.

use freeplay_arm::Arm;
use freeplay_model::EffectTable;

use crate::catalogue::COMMANDED;
use crate::effect::Effect;
use crate::kind::Kind;
use crate::law_error::LawError;
use crate::lookup::{kind, kinds};

/// An effect at its place.
#[derive(Debug)]
pub struct Placed {
    /// Its entry in the catalogue.
    pub kind: &'static Kind,
    /// Index of its joint; `None` for an effect of the whole arm.
    pub joint: Option<usize>,
    /// The law with its parameters.
    pub effect: Box<dyn Effect>,
    /// Line of its table in the arm file; 0 without a file.
    pub line: usize,
}

impl Placed {
    /// The effect that `table` describes, at its place in `arm`.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn new(table: &EffectTable, arm: &Arm) -> Result<Placed, LawError> {
        let Some(kind) = kind(&table.kind) else {
            return Err(LawError::UnknownKind {
                kind: table.kind.clone(),
                line: table.line,
                known: kinds()
                    .chain(COMMANDED.iter().copied())
                    .map(|kind| kind.name)
                    .collect::<Vec<_>>()
                    .join(", "),
            });
        };
        let values = kind.values(table, arm)?;
        Ok(Placed { kind, joint: values.joint().ok(), effect: (kind.build)(&values)?, line: table.line })
    }
}
