//! What an arm carries and how it stands beside what its file says: a payload at the tool, links of other masses, a base that leans. The laws are the catalogue's.

use freeplay_arm::{Arm, ArmFile, EffectTable};
use freeplay_laws::Effects;
use toml::{Table, Value};

use crate::unknowns::Quantity;

/// The burden of an arm.
#[derive(Clone, Debug)]
pub struct Burden {
    bare: Arm,
    payload: f64,
    /// Logarithms of true over modelled masses of links.
    links: Vec<f64>,
    /// Roll and pitch of the base, rad.
    turn: [f64; 2],
}

impl Burden {
    /// No burden of `arm`.
    pub fn none(arm: &Arm) -> Burden {
        Burden { bare: arm.clone(), payload: 0.0, links: vec![0.0; arm.dof()], turn: [0.0; 2] }
    }

    /// The number `quantity` of the link of `joint`, or of the whole arm.
    pub fn of(&self, joint: usize, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Payload => self.payload,
            Quantity::LinkMass => self.links[joint],
            Quantity::Roll => self.turn[0],
            _ => self.turn[1],
        }
    }

    /// Gives it the value `x`.
    pub fn set(&mut self, joint: usize, quantity: Quantity, x: f64) {
        match quantity {
            Quantity::Payload => self.payload = x,
            Quantity::LinkMass => self.links[joint] = x,
            Quantity::Roll => self.turn[0] = x,
            _ => self.turn[1] = x,
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
        for (joint, log) in self.bare.joints().iter().zip(&self.links).filter(|(_, log)| **log != 0.0) {
            let scale = Table::from_iter([("scale".to_owned(), Value::Float(log.exp()))]);
            tables.push(table("link_mass", Some(joint.name.clone()), scale));
        }
        if self.payload != 0.0 {
            let place = self.bare.tool().translation.vector;
            let com = place.iter().map(|x| Value::Float(*x)).collect();
            let mass = ("mass".to_owned(), Value::Float(self.payload));
            tables.push(table(
                "payload",
                None,
                Table::from_iter([mass, ("com".to_owned(), Value::Array(com))]),
            ));
        }
        if self.turn != [0.0; 2] {
            let turn = ["roll", "pitch"].into_iter().zip(self.turn);
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
