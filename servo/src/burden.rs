//! What an arm carries and how it stands beside what its file says: a payload on its last link, links of other masses, a base that leans. The laws are the catalogue's.

use freeplay_arm::{Arm, ArmFile, EffectTable};
use freeplay_laws::Effects;
use toml::{Table, Value};

use crate::quantity::Quantity;

/// The burden of an arm.
#[derive(Clone, Debug)]
pub struct Burden {
    bare: Arm,
    /// Logarithms of true over modelled masses of links.
    links: Vec<f64>,
    /// The numbers of the whole arm, in the order of [`Quantity::OF_WHOLE_ARM`].
    whole: [f64; Quantity::OF_WHOLE_ARM.len()],
}

impl Burden {
    /// No burden of `arm`.
    pub fn none(arm: &Arm) -> Burden {
        Burden { bare: arm.clone(), links: vec![0.0; arm.dof()], whole: [0.0; Quantity::OF_WHOLE_ARM.len()] }
    }

    /// The number `quantity` of the link of `joint`, or of the whole arm.
    pub fn of(&self, joint: usize, quantity: Quantity) -> f64 {
        place(quantity).map_or(self.links[joint], |at| self.whole[at])
    }

    /// Gives it the value `x`.
    pub fn set(&mut self, joint: usize, quantity: Quantity, x: f64) {
        match place(quantity) {
            Some(at) => self.whole[at] = x,
            None => self.links[joint] = x,
        }
    }

    /// Its effects, as an arm file has them.
    pub fn tables(&self) -> Vec<EffectTable> {
        let table = |kind: &str, joint: Option<String>, parameters: Table| EffectTable {
            kind: kind.to_owned(),
            joint,
            parameters,
            line: 0,
        };
        let mut tables = Vec::new();
        let [payload, x, y, z, roll, pitch] = self.whole;
        for (joint, log) in self.bare.joints().iter().zip(&self.links).filter(|(_, log)| **log != 0.0) {
            let scale = Table::from_iter([("scale".to_owned(), Value::Float(log.exp()))]);
            tables.push(table("link_mass", Some(joint.name.clone()), scale));
        }
        if payload != 0.0 {
            let place = self.bare.tool().translation.vector;
            let com = place.iter().zip([x, y, z]).map(|(tool, off)| Value::Float(tool + off)).collect();
            let mass = ("mass".to_owned(), Value::Float(payload));
            tables.push(table(
                "payload",
                None,
                Table::from_iter([mass, ("com".to_owned(), Value::Array(com))]),
            ));
        }
        if [roll, pitch] != [0.0; 2] {
            let turn = ["roll", "pitch"].into_iter().zip([roll, pitch]);
            let turn = turn.map(|(name, angle)| (name.to_owned(), Value::Float(angle)));
            tables.push(table("base_tilt", None, turn.collect()));
        }
        tables
    }

    /// The arm under it; `None` if there can't be one.
    pub fn arm(&self) -> Option<Arm> {
        let file = ArmFile { arm: self.bare.clone(), effects: self.tables(), ignored: Vec::new() };
        Effects::of(&file).ok()?.changed(&self.bare).ok()
    }
}

/// Where `quantity` stands among those of the whole arm; `None` if it is a link's.
fn place(quantity: Quantity) -> Option<usize> {
    Quantity::OF_WHOLE_ARM.iter().position(|one| *one == quantity)
}
