//! The machines, by their data sheets: seven arms of one to seven joints.

use std::path::Path;

use freeplay_arm::{Arm, Inertia, JointFriction};
use freeplay_model::{ModelError, paper_arm, parse_toml};
use nalgebra::{Isometry3, Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// A machine by its data sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Machine {
    /// One inclined linear axis.
    Slide,
    /// Two axes in an upright plane.
    Two,
    /// Column, shoulder, elbow.
    Three,
    /// Six axes, three in a row in one plane, offset wrist, 18 kg.
    SixBench,
    /// Six axes, roll-pitch-roll wrist, 64 kg.
    SixCell,
    /// Seven axes, roll and pitch in turn.
    Seven,
    /// The arm of Erkaya (2018) with friction in its joints.
    Paper,
}

impl Machine {
    /// Every machine.
    pub const ALL: [Machine; 7] = [
        Machine::Slide,
        Machine::Two,
        Machine::Three,
        Machine::SixBench,
        Machine::SixCell,
        Machine::Seven,
        Machine::Paper,
    ];

    /// Its name on the data sheet.
    pub fn name(self) -> &'static str {
        ["linear_axis", "two_axis", "three_axis", "bench_six", "cell_six", "seven_axis", "erkaya2018"]
            [self as usize]
    }

    /// The arm of the data sheet, nominal friction and limits included.
    ///
    /// # Errors
    /// None in practice: the files are part of the program, and a test reads them all.
    pub fn data_sheet(self) -> Result<Arm, ModelError> {
        let text = match self {
            Machine::Slide => include_str!("../arms/slide.toml"),
            Machine::Two => include_str!("../arms/two.toml"),
            Machine::Three => include_str!("../arms/three.toml"),
            Machine::SixBench => include_str!("../arms/six_a.toml"),
            Machine::SixCell => include_str!("../arms/six_b.toml"),
            Machine::Seven => include_str!("../arms/seven.toml"),
            Machine::Paper => return Ok(paper_with_friction()),
        };
        Ok(parse_toml(text, Path::new("model.toml"))?.arm)
    }

    /// The largest load at the tool, kg.
    pub fn capacity(self) -> f64 {
        match self {
            Machine::Slide => 15.0,
            Machine::Two | Machine::Three | Machine::SixBench | Machine::Seven => 3.0,
            Machine::SixCell => 6.0,
            Machine::Paper => 12.0,
        }
    }

    /// The arm of the data sheet with `mass` kg as a point at its tool, and that load.
    ///
    /// # Errors
    /// As [`Machine::data_sheet`].
    pub fn loaded(self, mass: f64) -> Result<(Arm, Load), ModelError> {
        let arm = self.data_sheet()?;
        let load = Load { mass, place: arm.tool().translation.vector };
        let mut joints = arm.joints().to_vec();
        if let Some(last) = joints.last_mut() {
            let point = Inertia { mass, com: load.place, about_com: Matrix3::zeros() };
            last.inertia = last.inertia.joined_with(&point, &Isometry3::identity());
        }
        let arm = Arm::new(arm.name(), joints, *arm.tool(), *arm.gravity()).unwrap_or(arm);
        Ok((arm, load))
    }

    /// Joint positions around which the machine works, rad or m.
    pub fn home(self) -> &'static [f64] {
        match self {
            Machine::Slide => &[0.0],
            Machine::Two => &[-0.5, 0.9],
            Machine::Three => &[0.3, 0.5, 0.6],
            Machine::SixBench => &[0.2, 0.6, 0.8, -0.5, 0.3, 0.4],
            Machine::SixCell => &[0.0, 0.3, -0.2, 0.2, 0.5, 0.1],
            Machine::Seven => &[0.2, 0.5, -0.3, 0.9, 0.3, 0.6, 0.2],
            Machine::Paper => &[0.0, 0.3, 0.3, 0.1, 0.6, 0.0],
        }
    }

    /// Largest displacement of each joint from home, rad or m.
    pub fn reach(self) -> &'static [f64] {
        match self {
            Machine::Slide => &[0.45],
            Machine::Two => &[1.2, 1.2],
            Machine::Three => &[1.6, 0.9, 1.0],
            Machine::SixBench => &[1.6, 0.9, 0.9, 1.2, 1.2, 1.5],
            Machine::SixCell => &[1.4, 0.7, 0.7, 1.6, 1.2, 1.8],
            Machine::Seven => &[1.5, 0.8, 1.4, 0.8, 1.5, 0.9, 1.8],
            Machine::Paper => &[1.2, 0.6, 0.6, 1.5, 1.0, 1.8],
        }
    }
}

/// The load at the tool on the data sheet: a point mass, part of the last link's inertia.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// kg.
    pub mass: f64,
    /// Its position in the frame of the last link, m.
    pub place: Vector3<f64>,
}

/// The paper gives no friction, no rotors and limits far beyond the motors of such an arm; a data sheet has them.
fn paper_with_friction() -> Arm {
    let file = paper_arm();
    let friction = [(25.0, 32.0), (30.0, 38.0), (16.0, 22.0), (2.5, 5.0), (1.6, 3.4), (0.8, 1.9)];
    let rotors = [15.0, 14.0, 2.3, 0.009, 0.0045, 0.0008];
    let mut joints = file.arm.joints().to_vec();
    for ((joint, (viscous, coulomb)), rotor) in joints.iter_mut().zip(friction).zip(rotors) {
        joint.friction = JointFriction { viscous, coulomb };
        joint.rotor_inertia = rotor;
        joint.limits.acceleration = joint.limits.acceleration.min(25.0);
    }
    Arm::new(file.arm.name(), joints, *file.arm.tool(), *file.arm.gravity()).unwrap_or(file.arm)
}

#[cfg(test)]
mod tests {
    use super::Machine;

    #[test]
    fn a_machine_is_called_as_its_data_sheet_says() {
        for machine in Machine::ALL {
            assert_eq!(machine.name(), machine.data_sheet().expect("a data sheet").name());
        }
    }
}
